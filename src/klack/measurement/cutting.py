"""Starts of strokes in a recording read in windows.

A stroke begins where the trigger channel crosses its level in the direction asked for, found
between two samples along a straight line.  The channel has to go back behind the level by five
standard deviations of its noise before it can trigger again, and no second stroke begins within
the dead time.  What is found does not depend on how the recording is divided into windows.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.roles import Role
from klack.measurement.trigger import Trigger
from klack.signals import TimeSeries

__all__ = ["Piece", "cut_strokes", "trigger_level", "whole_piece"]

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
    start, step : float [s]
        Time of the first sample since the trigger, and spacing.
    values : mapping of role to array, shape (n,) [SI]
    instant : float [s]
        Of the trigger, in the time of the recording.
    """

    start: float
    step: float
    values: Mapping[Role, Vector]
    instant: float

    @property
    def end(self) -> float:
        """Time of the last sample since the trigger [s]."""
        count = len(next(iter(self.values.values())))
        return self.start + self.step * (count - 1)


def trigger_level(windows: Iterable[Window], trigger: Trigger) -> float:
    """Value at which a trigger fires [SI], read off the whole recording where it is a share.

    The resting value is the median of what lies in the lowest quarter of the range; the highest
    value leaves single samples (spikes) out.

    Raises
    ------
    InputError
        If the channel never changes.
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
    if not high > low:
        raise InputError(
            f"measurement.trigger: channel '{trigger.channel}'",
            got=f"a channel that stays at {low:g} (SI)",
            expected="a channel that moves with every stroke",
            hint="choose another channel for the trigger.",
        )
    rest = float(np.median(all_values[all_values <= low + _LOW * (high - low)]))
    return rest + trigger.share_of_way * (high - rest)


def cut_strokes(windows: Iterable[Window], trigger: Trigger, level: float) -> Iterator[Piece]:
    """Strokes of a recording, in order of time.

    Parameters
    ----------
    windows : iterable of mapping of role to TimeSeries
        Each overlaps the one before by ``trigger.before + trigger.after`` and two samples or more.
    trigger : Trigger
    level : float [SI]

    Yields
    ------
    Piece
        From ``before`` to ``after``; less where the recording begins later or ends earlier.
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
    """State of the trigger channel up to the sample scanned last."""

    dead_time: float
    armed: bool = False
    scanned: float = -np.inf
    last: float = -np.inf
    margin: float = 0.0
    pending: list[float] = field(default_factory=list)

    def scan(self, series: TimeSeries, sign: float, level: float) -> None:
        """Continue over the samples not yet scanned."""
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
    """Instant between the sample behind the level and the one beyond it."""
    if index == 0:
        return series.start
    below, above = float(distance[index - 1]), float(distance[index])
    share = above / (above - below) if above > below else 0.0
    return series.start + series.step * (index - min(max(share, 0.0), 1.0))


def _noise(values: Vector) -> float:
    """White noise of a channel, from its second differences (variance 6 times as large)."""
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
