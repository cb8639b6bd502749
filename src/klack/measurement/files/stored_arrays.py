"""Named arrays of HDF5 and MATLAB files become channels.

Such files have no fixed form. Known are

- vectors side by side, one of them the time: ``time``, ``lift``, ``current``;
- a group or structure per channel: ``lift`` with ``time``, ``values``, ``unit``;
- a sampling step or rate beside them or as attribute: ``dt``, ``fs``, ``sampling_rate``;
- matrices with one stroke per row or column: ``lift #1``, ``lift #2``, ...;
- units as attribute, as text beside (``unit``, ``lift_unit``) or in the name (``lift_um``);
- starts as numbers (``t0``) or dates (``start_time``, ``seconds since 2026-03-02 08:00``);
- ``TimeInfo`` and ``DataInfo`` beside ``Time`` and ``Data`` of a MATLAB timeseries.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.mat5 import MatValue, read_mat5
from klack.errors import InputError, refuse_if
from klack.measurement.files.clock import (
    PACKED,
    clock_factor,
    instant,
    is_clock,
    no_clock,
    since,
    unique_names,
    unknown_scales,
    unpacked,
)
from klack.measurement.files.csv_dialect import split_label
from klack.measurement.recording import ChannelInfo, Recording, left_out
from klack.measurement.unit_text import no_unit, plain_unit

__all__ = ["ArrayRecording", "MatlabFile", "StoredArray", "StoredGroup", "stored_array"]


Vector = NDArray[np.float64]

_VALUES = {"values", "value", "data", "y", "samples", "signal", "wert", "werte"}
_TIMES = {"x", "t", "time", "times", "zeit"}
_UNITS = ("unit", "units", "unit_string", "einheit")
_STEPS = ("dt", "step", "time_step", "timestep", "ts", "wf_increment", "sample_time", "increment")
_RATES = (
    "fs",
    "sampling_rate",
    "sample_rate",
    "samplerate",
    "samplingrate",
    "sampling_frequency",
    "rate",
    "abtastrate",
)
_STARTS = ("t0", "start", "start_time", "wf_start_offset")
_DATES = (*_STARTS, "wf_start_time", "startdate", "start_date", "date_time")
_ABOUT = {"timeinfo": "time_units", "datainfo": "data_units"}
_MOST_STROKES = 100_000


@dataclass(frozen=True, kw_only=True)
class StoredArray:
    """An array of numbers that can be read in parts.

    Parameters
    ----------
    shape
        One axis, or two for a matrix.
    read
        Arguments: index of a line (0 for a vector), axis of time, first and last sample.
    about
        Attributes, names in lower case.
    """

    name: str
    shape: tuple[int, ...]
    read: Callable[[int, int, int, int], Vector]
    whole: Callable[[int, int], NDArray[np.int64]] | None = None
    """Samples of a vector of whole numbers."""
    zero: int = 0
    """Number taken off all, as the first time stamp."""
    about: Mapping[str, str | float] = field(default_factory=dict)


def stored_array(
    name: str,
    values: Any,
    about: Mapping[str, str | float] | None = None,
    reading: Callable[[], AbstractContextManager[Any]] = nullcontext,
) -> StoredArray:
    """Vector or matrix held, or of a file that each ``reading`` reads in part."""

    def read(line: int, axis: int, first: int, last: int) -> Vector:
        part: tuple[Any, ...] = (slice(first, last),)
        if values.ndim == 2:
            part = (*part, line) if axis == 0 else (line, *part)
        with reading():
            return np.asarray(values[part], dtype=np.float64)

    def whole(first: int, last: int) -> NDArray[np.int64]:
        with reading():
            return np.asarray(values[first:last], dtype=np.int64)

    return StoredArray(
        name=name,
        shape=values.shape,
        read=read,
        whole=whole if values.ndim == 1 and values.dtype.kind in "iu" else None,
        about=about or {},
    )


@dataclass(frozen=True, kw_only=True)
class StoredGroup:
    """Arrays, texts and numbers that belong together, and groups below."""

    path: str = ""
    arrays: Sequence[StoredArray] = ()
    about: Mapping[str, str | float] = field(default_factory=dict)
    groups: Sequence["StoredGroup"] = ()
    unread: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Names of what is neither, by reason."""


_Clock = tuple[StoredArray, str]


@dataclass(frozen=True, kw_only=True)
class _Line:
    array: StoredArray
    line: int
    axis: int
    name: str
    unit: str
    count: int
    clock: tuple[StoredArray, float] | None
    start: float
    step: float
    origin: int | None
    own_start: float | None
    unapplied: str


class ArrayRecording(Recording):
    """Channels of named arrays; ``time_step`` [s] for those without time."""

    def __init__(self, path: Path, root: StoredGroup, time_step: float | None) -> None:
        notes: list[str] = []
        lines = _lines(path.name, root, None, {}, time_step, notes)
        _require_one_start(path.name, lines)
        names = unique_names([line.name for line in lines])
        self._line = dict(zip(names, lines, strict=True))
        infos = tuple(
            ChannelInfo(
                name=name,
                unit=line.unit,
                count=line.count,
                start=line.start,
                step=line.step,
                clock="" if line.clock is None else f"{id(line.clock[0])}",
                label=line.array.name,
                origin=line.origin,
                unapplied=line.unapplied,
            )
            for name, line in self._line.items()
        )
        super().__init__(path, infos, tuple(dict.fromkeys(notes)))

    def _values(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        line = self._line[channel.name]
        return line.array.read(line.line, line.axis, first, last)

    def _clock_time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        clock = self._line[channel.name].clock
        assert clock is not None
        return clock[1] * clock[0].read(0, _long_axis(clock[0].shape), first, last)


def _long_axis(shape: tuple[int, ...]) -> int:
    return int(np.argmax(shape))


def _split(name: str) -> tuple[str, str]:
    return split_label(name.rsplit("/", 1)[-1])


def _unit_of(array: StoredArray, group: StoredGroup) -> str:
    name, in_name = _split(array.name)
    for key in _UNITS:
        for text in (array.about.get(key), group.about.get(f"{name.lower()}_{key}")):
            if isinstance(text, str) and not no_unit(text):
                return plain_unit(text)
    if name.lower() in _VALUES:
        for key in _UNITS:
            text = group.about.get(key)
            if isinstance(text, str) and not no_unit(text):
                return plain_unit(text)
    return in_name


def _lines(
    file: str,
    group: StoredGroup,
    clock: _Clock | None,
    about: Mapping[str, str | float],
    time_step: float | None,
    notes: list[str],
) -> list[_Line]:
    """Channels of a group and of those below, which inherit time and step."""
    notes += left_out(file, group.unread)
    group = _with_info(group)
    group = replace(group, arrays=[_unpacked(array, group) for array in group.arrays])
    about = {**about, **group.about}
    times = [array for array in group.arrays if _is_time(array, group)]
    clock = (_from_first(times[0]), _unit_of(times[0], group)) if times else clock
    lines = []
    for array in group.arrays:
        if array not in times:
            lines += _lines_of(file, array, group, clock, about, time_step, notes)
    for below in group.groups:
        lines += _lines(file, below, clock, about, time_step, notes)
    return lines


def _with_info(group: StoredGroup) -> StoredGroup:
    """MATLAB timeseries with ``TimeInfo`` and ``DataInfo`` as texts."""
    about, groups = dict(group.about), []
    for below in group.groups:
        key = _ABOUT.get(below.path.rsplit("/", 1)[-1].lower())
        if key is None:
            groups.append(below)
            continue
        about |= {key: below.about.get("units", "")}
        about |= {name: value for name, value in below.about.items() if name == "startdate"}
    return replace(group, about=about, groups=groups)


def _own(array: StoredArray, group: StoredGroup) -> dict[str, str | float]:
    """Attributes of an array, and values beside it that bear its name."""
    name = _split(array.name)[0].lower()
    if name in _VALUES:
        beside = dict(group.about)
    else:
        beside = {
            key.removeprefix(f"{name}_"): value
            for key, value in group.about.items()
            if key.startswith(f"{name}_")
        }
    return beside | dict(array.about)


def _of_all(group: StoredGroup, about: Mapping[str, str | float]) -> dict[str, str | float]:
    """What is said of all arrays of a group."""
    names = tuple(f"{_split(array.name)[0].lower()}_" for array in group.arrays)
    return {key: value for key, value in about.items() if not key.startswith(names)}


def _unpacked(array: StoredArray, group: StoredGroup) -> StoredArray:
    values = unpacked(_own(array, group))
    if values is None:
        return array
    return replace(array, read=lambda *where: values(array.read(*where)))


def _require_one_start(file: str, lines: Sequence[_Line]) -> None:
    """Reject channels of one stored time that start apart."""
    first: dict[int, _Line] = {}
    for line in lines:
        if line.clock is None:
            continue
        other = first.setdefault(id(line.clock[0]), line)
        if other.own_start != line.own_start:
            starts = [
                f"'{one.name}' " + ("without" if one.own_start is None else f"{one.own_start:g} s")
                for one in (other, line)
            ]
            raise InputError(
                f"{file}: start of '{line.name}'",
                got=f"different starts with one stored time: {', '.join(starts)}",
                expected="a start, or a stored time",
                hint="give each channel its own time, or a step and a start.",
            )


def _from_first(array: StoredArray) -> StoredArray:
    """Stamps since the first one: 19 digits do not fit real numbers."""
    whole = array.whole
    zero = 0 if whole is None else int(whole(0, 1)[0])
    if whole is None or abs(zero) < 2**53:
        return array
    stamps = whole
    return replace(
        array,
        zero=zero,
        read=lambda line, axis, first, last: (stamps(first, last) - zero).astype(np.float64),
    )


def _is_time(array: StoredArray, group: StoredGroup) -> bool:
    if max(array.shape) <= 1 or int(np.prod(array.shape)) != max(array.shape):
        return False
    name, unit = _split(array.name)[0], _unit_of(array, group)
    has_values = any(_split(other.name)[0].lower() in _VALUES for other in group.arrays)
    return is_clock(name, since(unit)[0]) or (
        has_values and name.lower() in _TIMES and no_unit(unit)
    )


def _lines_of(
    file: str,
    array: StoredArray,
    group: StoredGroup,
    clock: _Clock | None,
    about: Mapping[str, str | float],
    time_step: float | None,
    notes: list[str],
) -> list[_Line]:
    """One channel of a vector, several of a matrix."""
    axis = _long_axis(array.shape)
    if clock is not None and max(clock[0].shape) in array.shape:
        axis = array.shape.index(max(clock[0].shape))
    count = array.shape[axis]
    strokes = int(np.prod(array.shape)) // count
    if strokes > _MOST_STROKES or (strokes > 1 and count < 2):
        notes += left_out(file, {f"{strokes} columns of {count} values": [array.name]})
        return []
    unit = _unit_of(array, group)
    name = _split(array.name)[0]
    path = "/".join(part for part in (group.path, name) if part)
    if name.lower() in _VALUES and group.path:
        path = group.path
    own = _own(array, group)
    of_all = {key: value for key, value in _of_all(group, about).items() if key not in own}
    unapplied = ", ".join(
        text for text in (unknown_scales(own, PACKED), unknown_scales(of_all)) if text
    )
    start, step, used, origin = _time_of(file, path, array, count, clock, about, time_step, notes)
    return [
        _Line(
            array=array,
            line=line,
            axis=axis,
            name=path,
            unit=unit,
            count=count,
            clock=used,
            start=start,
            step=step,
            origin=origin,
            own_start=_start(array.about),
            unapplied=unapplied,
        )
        for line in range(strokes)
    ]


def _time_of(
    file: str,
    name: str,
    array: StoredArray,
    count: int,
    clock: _Clock | None,
    about: Mapping[str, str | float],
    time_step: float | None,
    notes: list[str],
) -> tuple[float, float, tuple[StoredArray, float] | None, int | None]:
    """Start, step, stored time and its zero: by own attributes, a time, the group."""
    date, start = _date(array.about) or _date(about), _start(array.about)
    start = (_start(about) or 0.0) if start is None else start
    step = _step(file, name, array.about)
    if step is not None:
        return start, step, None, date
    if clock is not None and max(clock[0].shape) == count:
        stored, unit = clock
        if not no_unit(unit) or time_step is None:
            axis = _long_axis(stored.shape)
            first, last = (float(stored.read(0, axis, k, k + 1)[0]) for k in (0, count - 1))
            mean = (last - first) / (count - 1)
            unit, zero = since(unit)
            factor, note = clock_factor(unit, mean, f"{file}: '{stored.name}'")
            notes += [note] if note else []
            zero = date if zero is None else zero
            if stored.zero:
                zero = (zero or 0) + stored.zero * round(1e9 * factor)
            return factor * first, factor * mean, (stored, factor), zero
    step = _step(file, name, about) if time_step is None else time_step
    if step is None:
        raise no_clock(f"{file}: '{name}'")
    return start, step, None, date


def _step(file: str, name: str, about: Mapping[str, str | float]) -> float | None:
    for keys, is_rate in ((_STEPS, False), (_RATES, True)):
        for key in keys:
            value = about.get(key)
            if not isinstance(value, float):
                continue
            refuse_if(
                not (0 < value < np.inf),
                f"{file}: '{name}': {key}",
                got=f"{value:g}",
                expected="a value above 0",
                hint="correct it in the file.",
            )
            return 1.0 / value if is_rate else value
    return None


def _start(about: Mapping[str, str | float]) -> float | None:
    return next((v for key in _STARTS if isinstance(v := about.get(key), float)), None)


def _date(about: Mapping[str, str | float]) -> int | None:
    found = (instant(v) for key in _DATES if isinstance(v := about.get(key), str))
    return next((date for date in found if date is not None), None)


_DEEPEST = 8


class MatlabFile(ArrayRecording):
    """Variables and structures of a MATLAB file."""

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        super().__init__(path, _group(read_mat5(path), "", 0), time_step)


def _group(fields: dict[str, MatValue], path: str, depth: int) -> StoredGroup:
    arrays, groups, unread = [], [], []
    about: dict[str, str | float] = {}
    for key, value in fields.items():
        if depth > _DEEPEST:
            continue
        below = f"{path}/{key}" if path else key
        if isinstance(value, dict):
            groups.append(_group(value, below, depth + 1))
        elif isinstance(value, list):
            # one group per element of an array of structures
            groups += [
                _group(item, f"{below}/{k + 1}", depth + 1)
                for k, item in enumerate(value)
                if isinstance(item, dict)
            ]
        elif isinstance(value, tuple):
            if len(value) == 1:
                about[key.lower()] = str(value[0])
        elif not isinstance(value, np.ndarray) or np.iscomplexobj(value):
            unread.append(below)
        elif value.size == 1:
            about[key.lower()] = float(value.ravel()[0])
        elif value.size and value.ndim == 2:
            arrays.append(stored_array(key, value))
        else:
            unread.append(below)
    reasons = {"no vector or matrix of real numbers": unread} if unread else {}
    return StoredGroup(path=path, arrays=arrays, about=about, groups=groups, unread=reasons)
