"""Channels of a recording in SI on one uniform time, whole or in windows.

The fastest channel gives the time; others are brought onto it along straight lines, which add no
overshoot at a touch, unless their samples lie on it.
"""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import AccuracyWarning, refuse_if
from klack.measurement.channels import ROLES, Role
from klack.measurement.find_channels import FoundChannel
from klack.measurement.recording import Recording
from klack.measurement.time_base import TimeBase
from klack.signals.sampled import TimeSeries

__all__ = ["CommonTime", "common_time", "read_channels", "windows"]

Vector = NDArray[np.float64]

_SAME = 0.01  # of a step
_MOST_MISSING = 5  # samples in a row
_SPIKE = 2.0  # ranges of all other samples
_FEWEST, _MOST_SPIKES = 20, 10  # samples; more spikes are a signal


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonTime:
    """Uniform time over which all channels have values.

    Parameters
    ----------
    start, step [s]
    notes
        How channels were brought onto it, and assumptions.
    """

    start: float
    step: float
    count: int
    notes: tuple[str, ...] = ()


def common_time(recording: Recording, found: Mapping[Role, FoundChannel]) -> CommonTime:
    """Time of the fastest channel, cut to what all channels cover.

    Rejects channels that do not overlap.
    """
    bases = {name: base for name, (base, _) in _bases(recording, found).items()}
    fastest = min(bases.values(), key=lambda base: base.step)
    begin = max(base.start for base in bases.values())
    end = min(base.end for base in bases.values())
    slack = _SAME * fastest.step
    skipped = max(int(np.ceil((begin - fastest.start - slack) / fastest.step)), 0)
    start = fastest.start + skipped * fastest.step
    count = int(np.floor((end - start + slack) / fastest.step)) + 1
    refuse_if(
        count < 2,
        f"{recording.path.name}: channels",
        got="no common time of "
        + ", ".join(f"{name} ({b.start:.6g} to {b.end:.6g} s)" for name, b in bases.items()),
        expected="channels that were recorded at the same time",
        hint="choose channels of one measurement in the section 'measurement' of the case.",
    )
    notes = [*recording.notes, *(channel.note for channel in found.values())]
    notes += _started(recording, found)
    for name, base in bases.items():
        if base.note:
            same = ", ".join(f"'{n}'" for n, other in bases.items() if other.note == base.note)
            notes.append(f"{recording.path.name}: {same}: {base.note}")
        if base.uniform and not _on_grid(base, start, fastest.step):
            notes.append(
                f"{recording.path.name}: '{name}' (step {base.step:.4g} s) resampled to steps of "
                f"{fastest.step:.4g} s by linear interpolation."
            )
    kept = tuple(dict.fromkeys(note for note in notes if note))
    return CommonTime(start=start, step=fastest.step, count=count, notes=kept)


def read_channels(
    recording: Recording,
    found: Mapping[Role, FoundChannel],
    first: int = 0,
    last: int | None = None,
) -> dict[Role, TimeSeries]:
    """Read a window of all channels [SI], of one start, step and length.

    Rejects empty windows and more than five missing values in a row.

    Parameters
    ----------
    found
        Of :func:`klack.measurement.find_channels.find_channels`.
    first, last
        Samples of the common time, ``last`` excluded; by default all.
    """
    clock = common_time(recording, found)
    last = clock.count if last is None else min(last, clock.count)
    first = max(first, 0)
    refuse_if(
        last <= first,
        f"{recording.path.name}: read_channels",
        got=f"samples {first} to {last} of {clock.count}",
        expected="at least one sample",
        hint="check the window.",
    )
    start = clock.start + clock.step * first
    bases = _bases(recording, found)
    return {
        role: TimeSeries(
            step=clock.step,
            values=channel.offset
            + channel.factor
            * _values_at(
                recording, channel.name, bases[channel.name], start, clock.step, last - first
            ),
            unit=ROLES[role].unit,
            start=start,
            name=channel.name,
        )
        for role, channel in found.items()
    }


def windows(
    recording: Recording,
    found: Mapping[Role, FoundChannel],
    length: float,
    overlap: float = 0.0,
) -> Iterator[dict[Role, TimeSeries]]:
    """Windows of a long recording, as :func:`read_channels` gives them, so that memory stays small.

    Parameters
    ----------
    length [s]
        Of each; the last may be shorter.
    overlap [s]
        With the window before; a stroke not longer lies whole in one window.
    """
    clock = common_time(recording, found)
    size = max(round(length / clock.step), 2)
    shared = round(overlap / clock.step)
    refuse_if(
        shared >= size,
        "windows: overlap",
        got=f"{overlap:g} s of {length:g} s",
        expected="less than the length of a window",
        hint="use longer windows.",
    )
    first = 0
    while first < clock.count:
        last = min(first + size, clock.count)
        yield read_channels(recording, found, first, last)
        if last == clock.count:
            return
        first = last - shared


def _bases(
    recording: Recording, found: Mapping[Role, FoundChannel]
) -> dict[str, tuple[TimeBase, float]]:
    """Time of each channel from their earliest start, and its start after that [s]."""
    origins = {one.name: recording.channel(one.name).origin for one in found.values()}
    known = [origin for origin in origins.values() if origin is not None]
    result = {}
    for name, origin in origins.items():
        later = 0.0 if origin is None else 1e-9 * (origin - min(known))
        result[name] = recording.time_base(name).moved(later), later
    return result


def _started(recording: Recording, found: Mapping[Role, FoundChannel]) -> Iterator[str]:
    """Channels that start later by the clock of the file, and those that do not say."""
    where, bases = recording.path.name, _bases(recording, found)
    for name, (_, later) in bases.items():
        if later > 0.0:
            yield (
                f"{where}: '{name}' starts {later:.9g} s later according to the time stamps of "
                "the file."
            )
    silent = [name for name in bases if recording.channel(name).origin is None]
    if 0 < len(silent) < len(bases):
        yield (
            f"{where}: {', '.join(silent)} without a start time; assumed to start with the "
            "earliest of the others."
        )


def _on_grid(base: TimeBase, start: float, step: float) -> bool:
    """True if samples of a uniform channel fall onto the common time."""
    if abs(base.step - step) * base.count > _SAME * step:
        return False
    shift = (start - base.start) / step
    return abs(shift - round(shift)) <= _SAME


def _values_at(
    recording: Recording,
    name: str,
    known: tuple[TimeBase, float],
    start: float,
    step: float,
    count: int,
) -> Vector:
    """Values of a channel [unit of the file] at ``start + step * k``."""
    base, later = known
    if base.uniform and _on_grid(base, start, step):
        begin = round((start - base.start) / step)
        values = recording.values(name, begin, begin + count)
        _tell_spikes(recording, name, start, step, values)
        if np.all(np.isfinite(values)):
            return values
        time = np.arange(values.size, dtype=np.float64)
        return _filled(recording, name, time, values, start + step * time)
    time, values = recording.read(name, *base.samples(start, start + step * (count - 1)))
    time = time + later
    _tell_spikes(recording, name, float(time[0]), base.step, values)
    if base.uniform:
        time = base.start + base.step * np.round((time - base.start) / base.step)
    if not np.all(np.isfinite(values)):
        values = _filled(recording, name, time, values, time)
    return np.interp(start + step * np.arange(count), time, values)


def _tell_spikes(
    recording: Recording, name: str, start: float, step: float, values: Vector
) -> None:
    """Warn of single samples farther from their neighbours than all others ever move."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size < _FEWEST:
        return
    x = values[known]
    middle = np.median([x[:-2], x[1:-1], x[2:]], axis=0)
    moved = float(np.max(middle) - np.min(middle))
    spikes = known[1 + np.flatnonzero(np.abs(x[1:-1] - middle) > _SPIKE * moved)]
    if moved > 0.0 and 0 < spikes.size <= _MOST_SPIKES:
        at = start + step * spikes[0]
        warnings.warn(
            f"{recording.path.name}: {spikes.size} values of '{name}' are far outside all "
            f"others, the first at {at:.6g} s: {values[spikes[0]]:.3g}.",
            AccuracyWarning,
            stacklevel=4,
        )


def _filled(recording: Recording, name: str, at: Vector, values: Vector, time: Vector) -> Vector:
    """Bridge a few missing values along straight lines; reject many."""
    missing = ~np.isfinite(values)
    edges = np.diff(np.concatenate(([0], missing.astype(np.int8), [0])))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    longest = int(np.argmax(ends - begins))
    refuse_if(
        ends[longest] - begins[longest] > _MOST_MISSING,
        f"{recording.path.name}: channel '{name}'",
        got=f"{ends[longest] - begins[longest]} missing values in a row at "
        f"{time[begins[longest]]:.6g} s",
        expected="at most five",
        hint="leave this part out of the file, or choose another channel.",
    )
    warnings.warn(
        f"{recording.path.name}: {np.count_nonzero(missing)} missing values of '{name}' were "
        f"filled by linear interpolation, the first at {time[begins[0]]:.6g} s.",
        AccuracyWarning,
        stacklevel=4,
    )
    return np.interp(at, at[~missing], values[~missing])
