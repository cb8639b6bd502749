"""Starts of strokes in a recording read in windows.

A stroke begins where the trigger channel crosses its level in the wanted direction, on a straight
line between samples.  The channel must return behind the level by five standard deviations of its
noise before it triggers again, and no second stroke begins within the dead time.  Results do not
depend on the windows.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.measurement.channels import Role, Trigger
from klack.signals.sampled import TimeSeries

__all__ = [
    "Piece",
    "between_samples",
    "common_axis",
    "covers",
    "cut_strokes",
    "onto_axis",
    "trigger_level",
    "whole_piece",
]


Vector = NDArray[np.float64]
Window = Mapping[Role, TimeSeries]

_HYSTERESIS = 5.0  # standard deviations of the noise
_SAMPLED = 20_000  # values per window from which the resting value is taken
_LOW = 0.25  # of the range: values below are at rest


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """Samples of one stroke, time from its trigger.

    Parameters
    ----------
    start, step [s]
        Of the first sample since the trigger, and spacing.
    values (n,) [SI]
    instant [s]
        Of the trigger in the recording.
    """

    start: float
    step: float
    values: Mapping[Role, Vector]
    instant: float

    @property
    def end(self) -> float:
        """Last sample since the trigger [s]."""
        count = len(next(iter(self.values.values())))
        return self.start + self.step * (count - 1)


def trigger_level(windows: Iterable[Window], trigger: Trigger) -> float:
    """Value at which a trigger fires [SI], read off the whole recording where it is a share.

    Rest is the median of the lowest quarter of the range; the highest value leaves out single
    samples (spikes). Rejects a channel that never changes.
    """
    if trigger.value is not None:
        return trigger.value
    high, sampled = -np.inf, []
    for window in windows:
        values = window[trigger.channel].values
        if values.size >= 3:
            middle = np.median([values[:-2], values[1:-1], values[2:]], axis=0)
            high = max(high, float(middle.max()))
        sampled.append(values[:: max(1, values.size // _SAMPLED)])
    all_values = np.concatenate(sampled) if sampled else np.empty(0)
    low = float(all_values.min(initial=np.inf))
    refuse_if(
        not high > low,
        f"measurement.trigger: channel '{trigger.channel}'",
        got=f"a channel that stays at {low:g} (SI)",
        expected="a channel that changes with every stroke",
        hint="choose another channel for the trigger.",
    )
    rest = float(np.median(all_values[all_values <= low + _LOW * (high - low)]))
    return rest + trigger.share_of_way * (high - rest)


def cut_strokes(windows: Iterable[Window], trigger: Trigger, level: float) -> Iterator[Piece]:
    """Strokes in order of time, from ``before`` to ``after``; less at the ends of the recording.

    Parameters
    ----------
    windows
        By role; each overlaps the one before by ``trigger.before + trigger.after`` and at least
        two samples.
    level [SI]
    """
    state = _State(dead_time=trigger.after if trigger.dead_time is None else trigger.dead_time)
    window: Window | None = None
    for window in windows:
        series = window[trigger.channel]
        state.scan(series, 1.0 if trigger.slope == "rising" else -1.0, level)
        end = series.start + series.step * (series.values.size - 1)
        while state.pending and state.pending[0] + trigger.after <= end:
            yield _piece(window, state.pending.pop(0), trigger.before, trigger.after)
    if window is not None:
        for instant in state.pending:
            yield _piece(window, instant, trigger.before, trigger.after)


def whole_piece(window: Window) -> Piece:
    """A recording that is one stroke, in its own time."""
    series = next(iter(window.values()))
    return Piece(
        start=series.start,
        step=series.step,
        values={role: channel.values for role, channel in window.items()},
        instant=0.0,
    )


@dataclass
class _State:
    dead_time: float
    armed: bool = False
    scanned: float = -np.inf
    last: float = -np.inf
    margin: float = 0.0
    pending: list[float] = field(default_factory=list)

    def scan(self, series: TimeSeries, sign: float, level: float) -> None:
        distance = sign * (series.values - level)
        if self.scanned == -np.inf:
            self.margin = _HYSTERESIS * _noise(series.values)
            first = 0
        else:
            first = round((self.scanned - series.start) / series.step) + 1
        interesting = np.flatnonzero((distance[first:] < -self.margin) | (distance[first:] >= 0.0))
        # only changes between the two sides matter
        side = distance[first:][interesting] >= 0.0
        before = np.concatenate(([not self.armed], side[:-1])) if side.size else side
        for k in np.flatnonzero(side != before).tolist():
            index = first + int(interesting[k])
            if not side[k]:
                continue
            instant = _crossing(series, distance, index)
            if instant >= self.last + self.dead_time:
                self.last = instant
                self.pending.append(instant)
        if side.size:
            self.armed = not bool(side[-1])
        self.scanned = series.start + series.step * (series.values.size - 1)


def _crossing(series: TimeSeries, distance: Vector, index: int) -> float:
    """Instant between a sample behind the level and the next one."""
    if index == 0:
        return series.start
    below, above = float(distance[index - 1]), float(distance[index])
    share = above / (above - below) if above > below else 0.0
    return series.start + series.step * (index - min(max(share, 0.0), 1.0))


def _noise(values: Vector) -> float:
    """White noise, from second differences (variance 6 times as large)."""
    second = np.diff(values, 2)
    return 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6.0) if second.size else 0.0


def _piece(window: Window, instant: float, before: float, after: float) -> Piece:
    series = next(iter(window.values()))
    position = (instant - series.start) / series.step
    first = max(int(np.floor(position - before / series.step)) - 1, 0)
    last = min(int(np.ceil(position + after / series.step)) + 2, series.values.size)
    return Piece(
        start=(first - position) * series.step,
        step=series.step,
        values={role: channel.values[first:last].copy() for role, channel in window.items()},
        instant=instant,
    )


_ON_AXIS = 1e-6  # of a step


def common_axis(pieces: Sequence[Piece], first: float, last: float) -> Vector:
    """Uniform time with a sample at zero, of the finest step, that most pieces cover [s].

    Parameters
    ----------
    first, last [s]
        Wanted; less where at least half of the pieces have less.
    """
    step = min(piece.step for piece in pieces)
    begin = max(first, float(np.median([piece.start for piece in pieces])))
    end = min(last, float(np.median([piece.end for piece in pieces])))
    a, b = int(np.ceil(begin / step - 1e-6)), int(np.floor(end / step + 1e-6))
    refuse_if(
        b - a < 2,
        "strokes",
        got=f"{len(pieces)} pieces with no common time around their trigger",
        expected="strokes with samples before and after the trigger",
        hint="check the trigger: channel, level, 'before' and 'after'.",
    )
    return np.asarray(step * np.arange(a, b + 1), dtype=np.float64)


def covers(piece: Piece, axis: Vector) -> bool:
    """Whether a piece has samples over the whole axis, to a step."""
    return piece.start <= axis[0] + piece.step and piece.end >= axis[-1] - piece.step


def onto_axis(piece: Piece, axis: Vector) -> Mapping[str, Vector]:
    """Channels of a piece at the times of an axis, by cubic splines held within their samples.

    Samples on the axis stay. Half-way between, white noise keeps about 0.7 of its variance; a
    straight line would keep half, and blur a touch. The spline alone would overshoot a step by
    11 %.
    """
    count = len(next(iter(piece.values.values())))
    time = piece.start + piece.step * np.arange(count)
    inside = np.clip(axis, time[0], time[-1])
    left = np.clip(((inside - time[0]) / piece.step).astype(np.int64), 0, count - 2)
    found: dict[str, Vector] = {}
    for role, values in piece.values.items():
        low, high = _bounds(values)
        curve = scipy.interpolate.CubicSpline(time, values)(inside)
        found[role] = np.clip(curve, low[left], high[left])
    return found


def between_samples(piece: Piece, axis: Vector) -> bool:
    """True if samples of a piece lie between those of the axis."""
    shift = (piece.start - axis[0]) / piece.step
    same = abs(piece.step / (axis[1] - axis[0]) - 1.0) * axis.size < _ON_AXIS
    return not (same and abs(shift - round(shift)) < _ON_AXIS)


def _bounds(x: Vector) -> tuple[Vector, Vector]:
    """Lowest and highest value between each sample and the next.

    Of both, and where the record turns the crest of the flatter parabola through three samples,
    beyond by ``|x[k-1] - 2 x[k] + x[k+1]| / 8`` at most.
    """
    low, high = np.minimum(x[:-1], x[1:]), np.maximum(x[:-1], x[1:])
    if x.size > 3:
        slope, bend = np.diff(x), np.diff(x, 2)
        flatter = np.minimum(np.abs(bend[:-1]), np.abs(bend[1:])) / 8.0
        turns = (slope[:-2] * slope[2:] < 0.0) & (bend[:-1] * bend[1:] > 0.0)
        low[1:-1] -= np.where(turns & (bend[1:] > 0.0), flatter, 0.0)
        high[1:-1] += np.where(turns & (bend[1:] < 0.0), flatter, 0.0)
    return low, high
