"""Numbers of a study as one plain table, from which all writers start."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.exchange.modal_model import identifier

__all__ = [
    "ResultAxis",
    "ResultChannel",
    "ResultRun",
    "ResultScalar",
    "ResultTable",
    "file_stems",
    "identifiers",
    "octave_text",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResultAxis:
    """Axis of channels.

    Parameters
    ----------
    name
        As ``"time"``; unique in a run.
    unit
        SI.
    values (n,) [unit]
        Rising strictly.
    """

    name: str
    quantity: Literal["time", "frequency"]
    unit: str
    values: NDArray[np.float64]
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResultChannel:
    """One quantity over an axis.

    Parameters
    ----------
    name
        As ``"needle.tip displacement"``.
    axis
        Of the same run.
    unit
        SI; ``"1"`` for a pure number.
    values (n,) [unit]
    meaning
        Sign, and where between two instants the value holds.
    """

    name: str
    axis: str
    unit: str
    values: NDArray[np.float64]
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultScalar:
    """Number of a run, or nan."""

    name: str
    unit: str
    value: float
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResultRun:
    """One level of an impact, one variant of a stroke, or one comparison of transfer functions.

    Parameters
    ----------
    name
        As ``"reduced"`` or ``"wet"``.
    label
        For a legend.
    solver
        In words.
    """

    name: str
    label: str
    solver: str
    axes: tuple[ResultAxis, ...]
    channels: tuple[ResultChannel, ...]
    scalars: tuple[ResultScalar, ...]

    def __post_init__(self) -> None:
        sizes = {axis.name: axis.values.size for axis in self.axes}
        for channel in self.channels:
            refuse_if(
                channel.values.shape != (sizes.get(channel.axis, -1),),
                f"result '{self.name}': channel '{channel.name}'",
                got=f"values of shape {channel.values.shape} over '{channel.axis}'",
                expected=f"one value for each of the {sizes.get(channel.axis, 0)} points of "
                f"its axis",
                hint="the stored result is damaged; run the case again.",
            )

    def along(self) -> Iterator[tuple[ResultAxis, tuple[ResultChannel, ...]]]:
        """Every axis with its channels."""
        for axis in self.axes:
            yield axis, tuple(item for item in self.channels if item.axis == axis.name)

    def channel(self, name: str) -> ResultChannel:
        """Channel of that name, or :class:`KeyError`."""
        return {item.name: item for item in self.channels}[name]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResultTable:
    """A whole study.

    Parameters
    ----------
    about
        Case, title, version of klack, date, mesh, ...
    case_text
        As read.
    runs
        The reference first.
    """

    kind: Literal["impact", "stroke"]
    about: Mapping[str, str]
    case_text: str
    runs: tuple[ResultRun, ...]

    def run(self, name: str) -> ResultRun:
        """Run of that name, or :class:`KeyError`."""
        return {item.name: item for item in self.runs}[name]


LONGEST = 63
"""Characters of a name in MATLAB."""


def identifiers(names: Sequence[str], taken: Collection[str] = ()) -> tuple[str, ...]:
    """Letters, digits and underscores, no digit first, at most 63, all different and not taken.

    Examples
    --------
    >>> identifiers(["needle.tip force", "needle tip force", "2 x"])
    ('needle_tip_force', 'needle_tip_force_2', 'm_2_x')
    """
    return _distinct([identifier(name) for name in names], taken)


def file_stems(names: Sequence[str]) -> tuple[str, ...]:
    """File names without suffix: no folder, no hidden file, all different.

    Examples
    --------
    >>> file_stems(["reduced-none", "../wet"])
    ('reduced-none', '___wet')
    """
    plain = ["".join(c if c.isalnum() or c in "_-" else "_" for c in name) for name in names]
    return _distinct([name or "run" for name in plain], ())


def octave_text(words: str) -> str:
    """Text with a blank per further byte of its letters.

    scipy counts letters, Octave bytes: the end of "Stäbe" would be lost.
    """
    return words + " " * (len(words.encode()) - len(words))


def _distinct(names: Sequence[str], taken: Collection[str]) -> tuple[str, ...]:
    # file systems and some tools do not tell upper from lower case
    used = {name.lower() for name in taken}
    out = []
    for name in names:
        free, number = name[:LONGEST], 1
        while free.lower() in used:
            number += 1
            end = f"_{number}"
            free = name[: LONGEST - len(end)] + end
        used.add(free.lower())
        out.append(free)
    return tuple(out)
