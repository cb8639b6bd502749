"""What the slider page shows of one position of its sliders."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Answer", "Curve", "Hearing", "Judgement", "Number", "ResultCard"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A line of a chart."""

    name: str
    x: Floats
    y: Floats

    @classmethod
    def scaled(cls, name: str, x: Floats, y: Floats, x_scale: float, y_scale: float) -> "Curve":
        """A line in the units of the chart."""
        return cls(name=name, x=x_scale * x, y=y_scale * y)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number beside the charts.

    Parameters
    ----------
    key, name, unit : str
    value : float or None
        In ``unit``.
    difference : str
        How a difference is given: ``"%"`` of the pinned one, ``"us"``, ``"dB"`` or ``"1"``.
    """

    key: str
    name: str
    unit: str
    value: float | None
    difference: str = "%"


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Force, motion, bands and sound of one position.

    Parameters
    ----------
    force, lift : tuple of Curve
        Over time in us (impact) or ms (stroke); force in N, lift in um.
    time_unit : str
    bands : array [Hz]
        Middle frequencies.
    levels : array [dB]
        Of the force, re 1e-12 N^2 s.
    numbers : tuple of Number
    wav, ghost_wav : bytes
        The click now and that of the pinned design, to one full scale; empty if nothing radiates.
    scale : str
        Full scale of both in words.
    doubts : tuple of str
        Why the numbers are doubtful; shown at once.
    seconds : float
        That it took.
    """

    force: tuple[Curve, ...]
    lift: tuple[Curve, ...]
    time_unit: str
    bands: Floats
    levels: Floats
    numbers: tuple[Number, ...]
    wav: bytes = b""
    ghost_wav: bytes = b""
    scale: str = ""
    doubts: tuple[str, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Whether the numbers can be relied on; follows once the sliders rest.

    Parameters
    ----------
    grade : str
        ``"good"``, ``"fair"``, ``"out"`` of range, or ``"none"`` where there is no estimate.
    words : str
    """

    grade: str
    words: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Hearing:
    """Loudness, spectrogram and drive pattern; follows once the sliders rest.

    Parameters
    ----------
    number, pinned : Number
        Loudness now, and of the pinned design.
    spectrogram : tuple of arrays
        Time [ms], frequency [kHz], level [dB re 20 uPa].
    pattern_wav : bytes
        The click as often as the drive pattern of the case has it, to the full scale of the clicks.
    """

    number: Number
    pinned: Number
    spectrogram: tuple[Floats, Floats, Floats]
    pattern_wav: bytes


@dataclass(frozen=True, kw_only=True)
class ResultCard:
    """A stored result in short.

    Parameters
    ----------
    command, title, case, created : str
    numbers : tuple of Number
    doubts : tuple of str
    compares : bool
        Whether two of its kind can be compared.
    """

    command: str
    title: str
    case: str
    created: str
    numbers: tuple[Number, ...]
    doubts: tuple[str, ...]
    compares: bool
