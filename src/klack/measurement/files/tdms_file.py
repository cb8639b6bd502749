"""TDMS files of LabVIEW and DIAdem, streamed through npTDMS.

Time is given by properties (``wf_start_time``, ``wf_start_offset``, ``wf_increment``), or by a
channel of the group, as numbers or stamps. Names are ``group/channel``, without a single group.
"""

import logging
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import foreign_reading, optional_package
from klack.measurement.files.clock import clock_factor, is_clock, no_clock, unknown_scales
from klack.measurement.files.csv_dialect import split_label
from klack.measurement.recording import ChannelInfo, Recording, left_out
from klack.measurement.unit_text import no_unit, plain_unit

__all__ = ["TdmsFile"]

Vector = NDArray[np.float64]

_SCALES = {
    *("Linear", "Polynomial", "RTD", "Strain", "Table", "Thermistor", "Thermocouple", "Add"),
    *("Subtract", "AdvancedAPI"),
}
"""Scales that npTDMS applies; of others it returns the stored numbers."""
_SINCE_1904 = 2_082_844_800  # [s] from the zero of LabVIEW to 1970
_LONGEST = 200  # signs of what npTDMS says
_HALF = 1 << 63  # of a unit of 2^-64 of a second


class TdmsFile(Recording):
    """Channels of numbers; ``time_step`` [s] for those without time."""

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        self.path = path
        notes: list[str] = []
        self._tdms = _opened(path, notes)
        self._channel: dict[str, Any] = {}
        self._clock: dict[str, tuple[Any, float]] = {}
        self._zero: dict[str, int | None] = {}  # first stamp [ns] of a channel of time stamps
        try:
            super().__init__(path, self._listed(path, time_step, notes), tuple(notes))
        except BaseException:
            self._tdms.close()
            raise

    def _listed(
        self, path: Path, time_step: float | None, notes: list[str]
    ) -> tuple[ChannelInfo, ...]:
        groups = [group for group in self._tdms.groups() if _numbers(group)]
        every = [c for group in self._tdms.groups() for c in group.channels()]
        for reason, found in (
            ("fewer than two samples", [c for c in every if len(c) < 2]),
            (
                "no numbers",
                [c for c in every if len(c) > 1 and np.dtype(c.dtype).kind not in "iufM"],
            ),
        ):
            names = [f"{c.group_name}/{c.name}" for c in found]
            notes += left_out(path.name, {reason: names} if names else {})
        infos = []
        for group in groups:
            clocks = [c for c in group.channels() if _is_clock(c)]
            for channel in _numbers(group):
                if channel in clocks:
                    continue
                name, unit = _name_and_unit(channel)
                full = f"{group.name}/{name}" if len(groups) > 1 else name
                start, step, clock, origin = self._time_of(path, channel, clocks, time_step, notes)
                count = len(channel) if not clock else min(len(channel), len(self._clock[clock][0]))
                self._channel[full] = channel
                infos.append(
                    ChannelInfo(
                        name=full,
                        unit=unit,
                        count=count,
                        start=start,
                        step=step,
                        clock=clock,
                        label=channel.name,
                        origin=origin,
                        unapplied=self._unapplied(group, channel),
                    )
                )
        return tuple(infos)

    def _time_of(
        self,
        path: Path,
        channel: Any,
        clocks: list[Any],
        time_step: float | None,
        notes: list[str],
    ) -> tuple[float, float, str, int | None]:
        """Start, step, name of the stored time if any, and its zero."""
        increment = float(channel.properties.get("wf_increment", 0.0) or 0.0)
        if increment > 0:
            start = float(channel.properties.get("wf_start_offset", 0.0))
            return start, increment, "", _nanoseconds(channel.properties.get("wf_start_time"))
        same = [c for c in clocks if len(c) == len(channel)] or clocks[:1]
        if same and (_is_stamped(same[0]) or time_step is None or _name_and_unit(same[0])[1]):
            clock = same[0]
            ends = self._read(clock, 0, 1)[0], self._read(clock, len(clock) - 1, len(clock))[0]
            step = float(ends[1] - ends[0]) / (len(clock) - 1)
            unit = "s" if _is_stamped(clock) else _name_and_unit(clock)[1]
            factor, note = clock_factor(unit, step, f"{path.name}: {clock.name}")
            if note and note not in notes:
                notes.append(note)
            self._clock[clock.path] = clock, factor
            return factor * float(ends[0]), factor * step, clock.path, self._zero.get(clock.path)
        if time_step is None:
            raise no_clock(f"{path.name}: channel '{channel.name}'")
        return 0.0, time_step, "", None

    def _unapplied(self, group: Any, channel: Any) -> str:
        """Scales of other programs, and those that npTDMS leaves out."""
        about = {**self._tdms.properties, **group.properties, **channel.properties}
        odd = {
            key: value
            for key, value in about.items()
            if key.endswith("_Scale_Type") and value not in _SCALES
        }
        scaled = about.get("NI_Scaling_Status", "unscaled") == "scaled"
        left = "" if scaled else ", ".join(f"{key} = {value}" for key, value in odd.items())
        return ", ".join(text for text in (unknown_scales(about), left) if text)

    def _values(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        return self._read(self._channel[channel.name], first, last)

    def _clock_time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        clock, factor = self._clock[channel.clock]
        return factor * self._read(clock, first, last)

    def _read(self, channel: Any, first: int, last: int) -> Vector:
        with _damage(f"{self.path.name}: channel '{channel.name}'"):
            with _heard():
                values = channel.read_data(offset=first, length=last - first)
            if not _is_stamped(channel):
                return np.asarray(values, dtype=np.float64)
            zero = channel.read_data(0, 1)[0]
            self._zero[channel.path] = _nanoseconds(zero)
            seconds = (values["seconds"] - zero.seconds).astype(np.float64)
            parts = values["second_fractions"].astype(np.float64)
            return np.asarray(seconds + (parts - float(zero.second_fractions)) / 2.0**64)

    def close(self) -> None:
        """Close the file."""
        self._tdms.close()


def _opened(path: Path, notes: list[str]) -> Any:
    nptdms = optional_package(
        "npTDMS", f"reading {path.name} (TDMS)", "measurement", module="nptdms"
    )
    with _damage(str(path)), _heard() as said:
        tdms = nptdms.TdmsFile.open(path, raw_timestamps=True)  # others are cut to 1 us
    notes += [f"{path.name}: {' '.join(text.split())[:_LONGEST]}." for text in dict.fromkeys(said)]
    return tdms


@contextmanager
def _heard() -> Iterator[list[str]]:
    """Collect what npTDMS logs of a file."""
    said: list[str] = []
    kept = [
        (logger, list(logger.handlers), logger.propagate)
        for name, logger in logging.Logger.manager.loggerDict.items()
        if name.startswith("nptdms") and isinstance(logger, logging.Logger)
    ]
    handler = logging.Handler()
    handler.emit = lambda record: said.append(record.getMessage())  # type: ignore[method-assign]
    for logger, _, _ in kept:
        logger.handlers, logger.propagate = [handler], False
    try:
        yield said
    finally:
        for logger, handlers, propagate in kept:
            logger.handlers, logger.propagate = handlers, propagate


def _damage(where: str) -> AbstractContextManager[None]:
    return foreign_reading(
        where, "a TDMS file", "open and save it again with the program that wrote it."
    )


def _numbers(group: Any) -> list[Any]:
    return [c for c in group.channels() if len(c) > 1 and np.dtype(c.dtype).kind in "iuf"]


def _is_stamped(channel: Any) -> bool:
    return np.dtype(channel.dtype).kind == "M"


def _is_clock(channel: Any) -> bool:
    return len(channel) > 1 and (_is_stamped(channel) or is_clock(*_name_and_unit(channel)))


def _nanoseconds(stamp: Any) -> int | None:
    """Time stamp since 1970 [ns]; LabVIEW's zero, 1904, says nothing."""
    if not getattr(stamp, "seconds", 0):
        return None
    return (int(stamp.seconds) - _SINCE_1904) * 10**9 + (
        int(stamp.second_fractions) * 10**9 + _HALF >> 64
    )


def _name_and_unit(channel: Any) -> tuple[str, str]:
    name, unit = split_label(channel.name)
    written = str(channel.properties.get("unit_string", "") or "")
    return name, unit if no_unit(written) else plain_unit(written)
