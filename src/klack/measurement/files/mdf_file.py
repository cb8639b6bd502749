"""Measurement Data Format of ASAM, versions 3 and 4, read record by record through asammdf.

Values are converted to physical units. A formula written in the file is not computed: such
channels are left out, with a note. Values that mean a text (``sensor fault``) are missing.
"""

import logging
from contextlib import AbstractContextManager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from traceback import walk_tb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, foreign_reading, optional_package, refuse_if
from klack.measurement.files.clock import no_clock, unique_names
from klack.measurement.recording import ChannelInfo, Recording, left_out
from klack.measurement.unit_text import no_unit, plain_unit, unit_factor
from klack.units import TIME

__all__ = ["MdfFile"]

Vector = NDArray[np.float64]

_NUMBERS_4 = range(6)  # whole and floating-point numbers in either byte order
_NUMBERS_3 = (0, 1, 2, 3, 9, 10, 11, 12, 13, 14, 15, 16)
_FORMULA_4, _TEXTS_4 = 3, (7, 8, 9, 10, 11)
_FORMULA_3, _TEXTS_3 = 10, (11, 12)
_TEXT_OF_VALUE, _TEXT_OF_RANGE = 7, 8
_CONVERTED = (0, 1, 2, 4, 5, 6)  # conversions from numbers to numbers
_SYNC_TIME = 1
_VIRTUAL = (3, 6)  # types of channels that are counted, not stored


class MdfFile(Recording):
    """Numbers over time of all groups; ``time_step`` [s] for those without time."""

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        self.path = path
        self._file = path.open("rb")
        try:
            self._mdf = _opened(path, self._file)
            self._place: dict[str, tuple[int, int]] = {}
            self._second: dict[int, float] = {}
            self._partial: dict[tuple[int, int], _Partial] = {}
            notes: list[str] = []
            super().__init__(path, self._listed(path, time_step, notes), tuple(notes))
        except BaseException:
            self._file.close()
            raise

    def _listed(
        self, path: Path, time_step: float | None, notes: list[str]
    ) -> tuple[ChannelInfo, ...]:
        old = self._mdf.version < "4"
        places: list[tuple[int, int]] = []
        without: dict[str, list[str]] = {}
        for g, group in enumerate(self._mdf.groups):
            master = self._mdf.masters_db.get(g)
            if (
                group.channel_group.cycles_nr >= 2
                and master is not None
                and not _in_record(group, group.channels[master], old)
            ):
                raise _outside(path, group.channels[master])
            for c, channel in enumerate(group.channels):
                if c == master:
                    continue
                reason = self._unread(path, g, c, old)
                if reason:
                    without.setdefault(reason, []).append(channel.name)
                else:
                    places.append((g, c))
        notes += left_out(path.name, without)
        texts = [self._mdf.groups[g].channels[c].name for g, c in self._partial]
        if texts:
            notes.append(f"{path.name}: {', '.join(texts)}: text samples are treated as missing.")
        names = unique_names([self._mdf.groups[g].channels[c].name for g, c in places])
        self._place = dict(zip(names, places, strict=True))
        times = {g: self._group_time(path, g, time_step, old) for g in {g for g, _ in places}}
        return tuple(self._info(name, g, c, times[g]) for name, (g, c) in self._place.items())

    def _unread(self, path: Path, g: int, c: int, old: bool) -> str:
        """Why a channel is left out, or empty."""
        group = self._mdf.groups[g]
        channel = group.channels[c]
        if group.channel_group.cycles_nr < 2:
            return "fewer than two samples"
        if channel.data_type not in (_NUMBERS_3 if old else _NUMBERS_4):
            return "no numbers"
        if group.channel_dependencies[c]:
            return "a structure or an array"
        if not _in_record(group, channel, old):
            raise _outside(path, channel)
        kind = getattr(channel.conversion, "conversion_type", 0)
        if kind == (_FORMULA_3 if old else _FORMULA_4):
            return "its conversion is a formula"
        if kind not in (_TEXTS_3 if old else _TEXTS_4):
            return ""
        partial = None if old else _partial(channel.conversion)
        if partial is None:
            return "its values are codes of texts, or follow a formula"
        self._partial[g, c] = partial
        return ""

    def _group_time(
        self, path: Path, g: int, time_step: float | None, old: bool
    ) -> tuple[float, float, str]:
        """Start, step and name of the time of a group."""
        group = self._mdf.groups[g]
        count = group.channel_group.cycles_nr
        master = self._mdf.masters_db.get(g)
        if master is None or (not old and group.channels[master].sync_type != _SYNC_TIME):
            if time_step is None:
                raise no_clock(f"{path.name}: group {g + 1}")
            return 0.0, time_step, ""
        channel = group.channels[master]
        unit = _unit_of(channel)
        name = channel.name or "time"
        where = f"{path.name}: time '{name}'"
        self._second[g] = 1.0 if no_unit(unit) else unit_factor(unit, TIME, where).factor
        first = self._master(g, 0, 1)
        last = self._master(g, count - 1, count)
        refuse_if(
            first.size != 1 or last.size != 1,
            where,
            got=f"less than the {count} records declared in the file",
            expected="a complete file",
            hint="the recording was truncated; repair it with the program that wrote it.",
        )
        return float(first[0]), float(last[0] - first[0]) / (count - 1), f"{name} of group {g + 1}"

    def _info(self, name: str, g: int, c: int, time: tuple[float, float, str]) -> ChannelInfo:
        group = self._mdf.groups[g]
        unit = _unit_of(group.channels[c])
        return ChannelInfo(
            name=name,
            unit="" if no_unit(unit) else plain_unit(unit),
            count=int(group.channel_group.cycles_nr),
            start=time[0],
            step=time[1],
            clock=time[2],
            label=group.channels[c].name,
        )

    def _master(self, g: int, first: int, last: int) -> Vector:
        # asammdf prints when a disk is slow
        with redirect_stdout(StringIO()), _damage(f"{self.path.name}: time"):
            time = self._mdf.get_master(g, record_offset=first, record_count=last - first)
        return self._second[g] * np.asarray(time, dtype=np.float64)

    def _clock_time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        return self._master(self._place[channel.name][0], first, last)

    def _values(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        g, c = self._place[channel.name]
        with redirect_stdout(StringIO()), _damage(f"{self.path.name}: '{channel.name}'"):
            samples, invalid = self._mdf.get(
                group=g,
                index=c,
                record_offset=first,
                record_count=last - first,
                samples_only=True,
                ignore_invalidation_bits=True,
                raw=(g, c) in self._partial,
            )
        if (g, c) in self._partial:
            values = self._partial[g, c](np.asarray(samples))
        else:
            values = np.array(samples, dtype=np.float64)
        if invalid is not None:
            values[np.asarray(invalid, dtype=bool)] = np.nan
        refuse_if(
            values.size != last - first,
            f"{self.path.name}: channel '{channel.name}'",
            got=f"{values.size} values from sample {first + 1}",
            expected=f"{last - first}",
            hint="the recording was truncated; repair it with the program that wrote it.",
        )
        return values

    def close(self) -> None:
        """Close the file."""
        self._mdf.close()
        self._file.close()


@dataclass(frozen=True)
class _Partial:
    """Ranges of stored values with conversion or text, and that of all others."""

    ranges: tuple[tuple[float, float, Any], ...]
    default: Any

    def __call__(self, stored: NDArray[Any]) -> Vector:
        values = _converted(self.default, stored)
        for low, high, rule in self.ranges:
            ends_in = stored.dtype.kind in "iu" or low == high  # of ASAM: else it ends before
            inside = (stored >= low) & ((stored <= high) if ends_in else (stored < high))
            values[inside] = _converted(rule, stored[inside])
        return values


def _converted(rule: Any, stored: NDArray[Any]) -> Vector:
    if not hasattr(rule, "conversion_type"):
        return np.full(stored.shape, np.nan)
    return np.array(rule.convert(stored), dtype=np.float64)


def _partial(conversion: Any) -> _Partial | None:
    """Numbers for some values, texts for others; None without numbers."""
    kind, refs = conversion.conversion_type, conversion.referenced_blocks
    if kind == _TEXT_OF_VALUE:
        ends = [(conversion[f"val_{k}"],) * 2 for k in range(conversion.val_param_nr)]
    elif kind == _TEXT_OF_RANGE:
        count = conversion.val_param_nr // 2
        ends = [(conversion[f"lower_{k}"], conversion[f"upper_{k}"]) for k in range(count)]
    else:
        return None
    rules = [refs.get(f"text_{k}") for k in range(len(ends))]
    kinds = {getattr(rule, "conversion_type", None) for rule in (*rules, refs["default_addr"])}
    if kinds == {None} or kinds - {None} - set(_CONVERTED):
        return None
    ranges = tuple((*end, rule) for end, rule in zip(ends, rules, strict=True))
    return _Partial(ranges, refs["default_addr"])


def _opened(path: Path, file: Any) -> Any:
    asammdf = optional_package("asammdf", f"reading {path.name} (MDF)", "measurement")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # else it writes parts of damaged files
    with _damage(str(path)):
        try:
            # of an open file asammdf reads only the records that are asked for
            return asammdf.MDF(file, raise_on_multiple_occurrences=False)
        except Exception as error:  # of any kind, and on its way again below
            _forget_half_open(error)
            raise


def _damage(where: str) -> AbstractContextManager[None]:
    return foreign_reading(where, "an MDF file", "repair it with the program that wrote it.")


def _forget_half_open(error: Exception) -> None:
    """Keep the failed reader from reporting again when deleted."""
    for frame, _ in walk_tb(error.__traceback__):
        half: Any = frame.f_locals.get("self")
        if hasattr(half, "_closed"):
            half._closed = True


def _in_record(group: Any, channel: Any, old: bool) -> bool:
    """False for bytes behind the record, where asammdf would read."""
    if not old and channel.channel_type in _VIRTUAL:
        return True
    if old:
        first = channel.start_offset + 8 * channel.additional_byte_offset
    else:
        first = 8 * channel.byte_offset + channel.bit_offset
        flags = 8 * group.channel_group.invalidation_bytes_nr
        if flags and not 0 <= channel.pos_invalidation_bit < flags:
            return False
    last = first + channel.bit_count
    return 0 <= first < last <= min(8 * group.channel_group.samples_byte_nr, first + 64)


def _outside(path: Path, channel: Any) -> InputError:
    return InputError(
        f"{path.name}: channel '{channel.name}'",
        got="a position outside its record",
        expected="a complete MDF file",
        hint="repair it with the program that wrote it.",
    )


def _unit_of(channel: Any) -> str:
    conversion = channel.conversion
    unit = getattr(channel, "unit", "") or getattr(conversion, "unit", "") or ""
    for rule in (getattr(conversion, "referenced_blocks", None) or {}).values():
        unit = unit or getattr(rule, "unit", "") or ""
    if isinstance(unit, bytes):
        unit = unit.decode("latin-1").rstrip(" \x00")
    return str(unit)
