"""A measured file: named channels, each read in windows of its samples.

Every format has a class in :mod:`klack.measurement.files`. Files are untrusted: nothing is
executed, no foreign object is rebuilt, sizes are checked before memory is taken.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.files.closing import Closing
from klack.measurement.time_base import TimeBase, survey_time

__all__ = ["ChannelInfo", "Recording", "left_out", "some_names"]


Vector = NDArray[np.float64]

OVER_RANGE = 9.9e37
"""IEEE 488.2: 9.9e37 is infinity, 9.91e37 not a number."""
_LARGEST_WINDOW = 200_000_000  # samples, 1.6 GB


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelInfo:
    """One channel of a recording.

    Parameters
    ----------
    name
        Without its unit; unique.
    unit
        Of the file, or empty.
    count
        Of samples.
    start [s]
    step [s]
        Mean.
    clock
        Name of the stored time; empty if the file gives start and step alone.
    label
        Name and unit as written, ``"lift [um]"``.
    origin [ns]
        Zero of its time since 1970, where the file has date and time of day.
    unapplied
        A scale that klack does not know, ``"gain = 0.5"``.
    """

    name: str
    unit: str
    count: int
    start: float
    step: float
    clock: str = ""
    label: str = ""
    origin: int | None = None
    unapplied: str = ""


class Recording(Closing):
    """Channels of an open file; use it in a ``with`` statement.

    Parameters
    ----------
    channels
        In the order of the file, without time.
    notes
        What was assumed on opening.
    """

    def __init__(
        self, path: Path, channels: tuple[ChannelInfo, ...], notes: tuple[str, ...] = ()
    ) -> None:
        self.path, self.channels, self.notes = path, channels, notes
        self._time_bases: dict[tuple[str, int], TimeBase] = {}
        self._by_name = {channel.name: channel for channel in channels}
        refuse_if(
            not channels,
            str(path),
            got="no channel of numbers over time" + "".join(f"; {note}" for note in notes),
            expected="at least one channel",
            hint="check that the file was exported completely, and the range of the instrument.",
        )

    def channel(self, name: str) -> ChannelInfo:
        """Channel of a name."""
        if name in self._by_name:
            return self._by_name[name]
        raise InputError(
            f"{self.path.name}: channels",
            got=f"no channel '{name}'",
            expected=f"one of: {some_names(self.channels)}",
            hint="correct the name in the section 'measurement' of the case.",
        )

    def read(self, name: str, first: int = 0, last: int | None = None) -> tuple[Vector, Vector]:
        """Time [s] and values [unit of the file] of samples ``first`` to before ``last``.

        Limited to the recording; missing values are nan.
        """
        channel = self.channel(name)
        begin, end = self._window(channel, first, last)
        return self._time(channel, begin, end), self._known(channel, begin, end)

    def values(self, name: str, first: int = 0, last: int | None = None) -> Vector:
        """Values [unit of the file] alone of the same samples."""
        channel = self.channel(name)
        return self._known(channel, *self._window(channel, first, last))

    def time(self, name: str, first: int = 0, last: int | None = None) -> Vector:
        """Time [s] alone of the same samples."""
        channel = self.channel(name)
        return self._time(channel, *self._window(channel, first, last))

    def time_base(self, name: str) -> TimeBase:
        """Channel time against a uniform one; a stored time is read once."""
        channel = self.channel(name)
        if not channel.clock:
            return TimeBase(
                start=channel.start,
                end=channel.start + channel.step * (channel.count - 1),
                step=channel.step,
                count=channel.count,
                uniform=True,
                marks=np.empty(0),
            )
        key = (channel.clock, channel.count)
        if key not in self._time_bases:
            self._time_bases[key] = survey_time(
                lambda first, last: self._time(channel, first, last),
                channel.count,
                f"{self.path.name}: time of '{name}'",
                lambda sample: self.place(name, sample),
            )
        return self._time_bases[key]

    def place(self, name: str, sample: int) -> str:
        """Sample in words, for messages."""
        return f"sample {sample + 1}"

    def _window(self, channel: ChannelInfo, first: int, last: int | None) -> tuple[int, int]:
        end = channel.count if last is None else min(last, channel.count)
        begin = min(max(first, 0), end)
        refuse_if(
            end - begin > _LARGEST_WINDOW,
            f"{self.path.name}: channel '{channel.name}'",
            got=f"{end - begin} samples at once",
            expected=f"at most {_LARGEST_WINDOW}",
            hint="read the record in pieces: give a trigger in the section 'measurement'.",
        )
        return begin, end

    def _known(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        """Values, nan where out of range of any instrument."""
        values = self._values(channel, first, last)
        over = ~(np.abs(values) < OVER_RANGE)
        return np.where(over, np.nan, values) if np.any(over) else values

    @abstractmethod
    def _values(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        """Values of samples that exist, in the unit of the file."""

    def _time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        """Time of existing samples [s], even or stored."""
        if channel.clock:
            return self._clock_time(channel, first, last)
        return channel.start + channel.step * np.arange(first, last, dtype=np.float64)

    def _clock_time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        """Stored time of existing samples [s]."""
        raise NotImplementedError

    def close(self) -> None:  # many formats hold nothing open
        """Close the file."""


def some_names(channels: Sequence[ChannelInfo], most: int = 12) -> str:
    """Channel names for an error text, the first of many."""
    return _some([channel.name for channel in channels], most)


def _some(names: Sequence[str], most: int = 12) -> str:
    more = f", ... ({len(names)} in all)" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def left_out(file: str, reasons: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Notes of what does not become a channel, by reason."""
    for reason, names in reasons.items():
        quoted = _some([f"'{name}'" for name in names])
        yield f"{file}: {quoted} left out: {reason}."
