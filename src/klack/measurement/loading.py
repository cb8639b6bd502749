"""From files to a set of strokes."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.measurement.channels import LIFT_ALONE, ROLES, Channels, Role, Trigger
from klack.measurement.cutting import (
    Piece,
    between_samples,
    common_axis,
    covers,
    cut_strokes,
    onto_axis,
    trigger_level,
    whole_piece,
)
from klack.measurement.differentiation import noise_floor
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import FoundChannel, find_channels
from klack.measurement.read_channels import common_time, read_channels, windows
from klack.measurement.recording import Recording
from klack.measurement.stroke_measures import MeasuredStroke, Rejection, StrokeSet

__all__ = ["MeasurementSection", "find_outliers", "load_stroke_set"]


Matrix = NDArray[np.float64]

_MOTION = 0.2
_CLIPPED_SAMPLES = 10
_CLIPPED_NOISE = 5.0
_NOISY = 3  # runs of another value, over which the samples of a clipped one are
_NOISE = 3.0
_DISTANCE, _SPREAD = 4.0, 6.0
_FEWEST = 6


def find_outliers(time: NDArray[np.float64], lift: Matrix) -> dict[int, str]:
    """Reasons to discard, by stroke.

    Only what is beyond doubt: scatter from shot to shot is to be measured.

    ========== ===============================================================================
    no motion  lift moves by less than 20 % of the median way
    clipped    ten samples or more stay at the largest or smallest value, while the median stroke
               exceeds it by five standard deviations of the noise
    noise      more than 3 times the median noise of the set
    shape      RMS distance from the median stroke above 4 times the median distance, and above
               it by 6 standard deviations (from the median absolute deviation); 6 strokes or more
    ========== ===============================================================================

    Parameters
    ----------
    time (n,) [s]
    lift (strokes, n) [m]
    """
    step = float(time[1] - time[0])
    way = np.quantile(lift, 0.99, axis=1) - np.quantile(lift, 0.01, axis=1)
    noise = np.array([noise_floor(row[None], step)[1] for row in lift])
    out: dict[int, str] = {}
    for k in np.flatnonzero(way < _MOTION * np.median(way)).tolist():
        out[k] = f"no motion: moves by {1e6 * way[k]:.3g} um, the others by "
        out[k] += f"{1e6 * float(np.median(way)):.3g} um"
    good = [k for k in range(len(lift)) if k not in out]
    middle, usual = np.median(lift[good], axis=0), float(np.median(noise[good]))
    for k in good:
        if len(good) > 2 and (reason := _clipped(lift[k], middle, usual)):
            out[k] = reason
        elif len(good) > 2 and noise[k] > _NOISE * usual > 0.0:
            out[k] = f"noise of {1e6 * noise[k]:.3g} um, the others {1e6 * usual:.3g} um"
    good = [k for k in good if k not in out]
    if len(good) >= _FEWEST:
        out.update(_far(lift, good))
    return out


def _clipped(row: Matrix, middle: Matrix, noise: float) -> str:
    for sign, word in ((1.0, "highest"), (-1.0, "lowest")):
        limit = float(np.max(sign * row))
        stays = sign * row == limit
        missed = stays & (sign * middle > limit + _CLIPPED_NOISE * noise)
        if _longest_run(stays & missed) >= _CLIPPED_SAMPLES:
            return f"clipped: stays at its {word} value of {sign * limit * 1e6:.4g} um"
    return ""


def _saturated(lifts: Sequence[NDArray[np.float64]]) -> Iterator[str]:
    """Doubts where most strokes stay at one end of their range, while noise moves all else."""
    for sign, word in ((1.0, "highest"), (-1.0, "lowest")):
        ends = []
        for lift in lifts:
            end = sign * float(np.max(sign * lift))
            same, at_end = np.diff(lift) == 0.0, lift[1:] == end
            others = _longest_run(same & ~at_end)
            if _longest_run(same & at_end) >= _CLIPPED_SAMPLES > _NOISY * others:
                ends.append(end)
        if 2 * len(ends) > len(lifts):
            yield (
                f"{len(ends)} of {len(lifts)} strokes stay at their {word} lift (median "
                f"{1e6 * float(np.median(ends)):.4g} um) without any noise: the sensor or recorder "
                "may be saturated there, and impacts beyond are missing. Try: a larger range."
            )


def _longest_run(mask: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _far(lift: Matrix, good: list[int]) -> dict[int, str]:
    middle = np.median(lift[good], axis=0)
    distance = np.sqrt(np.mean((lift[good] - middle) ** 2, axis=1))
    usual = float(np.median(distance))
    spread = 1.4826 * float(np.median(np.abs(distance - usual)))
    limit = max(_DISTANCE * usual, usual + _SPREAD * spread)
    return {
        k: f"shape: {1e6 * d:.3g} um (RMS) from the median stroke, the others {1e6 * usual:.3g} um"
        for k, d in zip(good, distance.tolist(), strict=True)
        if d > limit
    }


_WINDOW = 1_000_000  # samples
_WINDOW_TIMES = 20.0  # of one stroke: windows are not shorter


class MeasurementSection(Protocol):
    """Description of the recordings in a case (:class:`klack.case.measurement.CaseMeasurement`)."""

    @property
    def channels(self) -> Channels:
        """Channels by quantity."""

    @property
    def time_step(self) -> float | None:
        """Step of files without a time [s]."""

    @property
    def trigger(self) -> Trigger | None:
        """Where strokes begin."""

    @property
    def zero(self) -> str:
        """``"start"`` or ``"none"``."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cut:
    name: str
    piece: Piece


def load_stroke_set(
    paths: Sequence[Path],
    measurement: MeasurementSection | None = None,
    progress: Callable[[float], None] = lambda share: None,
    *,
    roles: Collection[Role] = tuple(ROLES),
) -> StrokeSet:
    """Read recordings, cut them into strokes, align these, and discard what cannot be used.

    Long recordings are read in windows; only strokes are kept, as the sensor showed them; with
    ``zero: start`` less the median lift before the trigger.

    Parameters
    ----------
    paths
        Of one valve: one long recording, one file per stroke, or a mixture.
    measurement
        Channels, trigger, zero; without it channels are found by name, and every recording is one
        stroke in its own time.
    progress
        Gets the share of the files that is done.
    roles
        Channels to read beside that of the trigger, of which the lift must exist.  Benches that
        record less than others can so share a description.
    """
    trigger = None if measurement is None else measurement.trigger
    cuts: list[_Cut] = []
    notes: list[str] = []
    for k, path in enumerate(paths):
        progress(k / len(paths))
        step = None if measurement is None else measurement.time_step
        with open_recording(Path(path), time_step=step) as recording:
            needed = {role for role in LIFT_ALONE if role in roles}
            needed |= set() if trigger is None else {trigger.channel}
            channels = None if measurement is None else measurement.channels
            wanted = {*roles, *needed}
            found = find_channels(recording, channels, needed=needed, roles=wanted)
            for one in found:
                notes.extend(common_time(recording, one).notes)
                cuts.extend(_cuts(recording, one, trigger, several=len(found) > 1))
    progress(1.0)
    source = ", ".join(Path(path).name for path in paths)
    refuse_if(
        not cuts,
        source or "measurement",
        got="no stroke",
        expected="a channel that crosses the trigger level",
        hint="check measurement.trigger: channel, level or share, and slope; scale: -1 "
        "reverses a channel.",
    )
    zero = measurement is not None and measurement.zero == "start"
    return _aligned(source, cuts, trigger, zero=zero or measurement is None, notes=notes)


def _cuts(
    recording: Recording,
    found: Mapping[Role, FoundChannel],
    trigger: Trigger | None,
    *,
    several: bool,
) -> Iterator[_Cut]:
    name = recording.path.name
    if several:
        name += f" {next(iter(found.values())).name}"
    if trigger is None:
        yield _Cut(name=name, piece=whole_piece(read_channels(recording, found)))
        return
    clock = common_time(recording, found)
    overlap = trigger.before + trigger.after + 8.0 * clock.step
    length = max(_WINDOW * clock.step, _WINDOW_TIMES * overlap)
    channel = {trigger.channel: found[trigger.channel]}
    level = trigger_level(windows(recording, channel, length), trigger)
    whole = windows(recording, found, length, overlap)
    for number, piece in enumerate(cut_strokes(whole, trigger, level), start=1):
        yield _Cut(name=f"{name} #{number}", piece=piece)


def _aligned(
    source: str, cuts: list[_Cut], trigger: Trigger | None, *, zero: bool, notes: list[str]
) -> StrokeSet:
    first = -np.inf if trigger is None else -trigger.before
    last = np.inf if trigger is None else trigger.after
    axis = common_axis([cut.piece for cut in cuts], first, last)
    if trigger is not None:
        notes.extend(_shortened(axis, trigger))
    if any(between_samples(cut.piece, axis) for cut in cuts):
        notes.append(
            f"{', '.join(cuts[0].piece.values)}: samples interpolated onto a common time from "
            f"the trigger, in steps of {axis[1] - axis[0]:.4g} s, by cubic splines limited to "
            "the range of the samples."
        )
    rejected, strokes = [], []
    cuts.reverse()
    while cuts:  # each piece goes when its stroke has come: a long set is not held twice
        cut = cuts.pop()
        if covers(cut.piece, axis):
            values = _zeroed(axis, onto_axis(cut.piece, axis), zero)
            strokes.append(MeasuredStroke(name=cut.name, values=values, start=cut.piece.instant))
        else:
            rejected.append(Rejection(name=cut.name, reason=_incomplete(cut.piece, axis)))
    if strokes and all("lift" in stroke.values for stroke in strokes):
        reasons = find_outliers(axis, np.array([stroke.values["lift"] for stroke in strokes]))
        rejected.extend(
            Rejection(name=strokes[k].name, reason=reason) for k, reason in sorted(reasons.items())
        )
        strokes = [stroke for k, stroke in enumerate(strokes) if k not in reasons]
        notes.extend(_saturated([stroke.values["lift"] for stroke in strokes]))
    if not strokes:
        raise InputError(
            source,
            got=f"{len(rejected)} strokes, none of them "
            f"usable ({rejected[0].name}: {rejected[0].reason})",
            expected="at least one complete stroke",
            hint="check the trigger and the recorded time.",
        )
    return StrokeSet(
        source=source,
        time=axis,
        strokes=tuple(strokes),
        rejected=tuple(rejected),
        notes=tuple(dict.fromkeys(notes)),
    )


def _zeroed(
    axis: NDArray[np.float64], values: Mapping[str, NDArray[np.float64]], zero: bool
) -> Mapping[str, NDArray[np.float64]]:
    """Lift from the closed valve, where there is time before the trigger."""
    before = axis < 0.0
    if not zero or "lift" not in values or not before.any():
        return values
    lift = values["lift"]
    return {**values, "lift": lift - float(np.median(lift[before]))}


def _incomplete(piece: Piece, axis: NDArray[np.float64]) -> str:
    return (
        f"incomplete: recorded from {1e3 * piece.start:.3g} ms to {1e3 * piece.end:.3g} ms around "
        f"its trigger, needed {1e3 * axis[0]:.3g} ms to {1e3 * axis[-1]:.3g} ms"
    )


def _shortened(axis: NDArray[np.float64], trigger: Trigger) -> Iterator[str]:
    step = float(axis[1] - axis[0])
    if axis[0] > -trigger.before + 2.0 * step or axis[-1] < trigger.after - 2.0 * step:
        yield (
            f"Recorded around the trigger is {1e3 * axis[0]:.4g} ms to {1e3 * axis[-1]:.4g} ms, "
            f"less than the {-1e3 * trigger.before:.4g} ms to {1e3 * trigger.after:.4g} ms "
            "requested."
        )
