"""Chart described once, and drawn by any renderer.

``klack.report.interactive`` draws it with plotly for the browser, ``klack.report.printed`` with
matplotlib for paper. Curves differ by style and colour, for copies in black and white; the colours
of Okabe & Ito (2008) are safe for colour-blind eyes.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError

__all__ = [
    "AREA_OPACITY",
    "COLOURS",
    "DASHES",
    "AnyChart",
    "AxisSpec",
    "Band",
    "BarChart",
    "BarPart",
    "Chart",
    "Curve",
    "Mark",
    "Panel",
    "ParallelAxis",
    "ParallelChart",
    "RingFrames",
    "dots",
    "frame_text",
    "mark_rows",
    "squeezed",
    "stems",
    "ticks_of",
]


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingFrames:
    """Values of the sectors of a ring, seen from above, at some moments.

    Colours are linear up to ``linear`` and logarithmic beyond, on both sides of zero.

    Parameters
    ----------
    label, unit
        Of the values.
    time (k,)
        In ``time_unit``.
    values (k, S)
        Sector ``s`` has its middle at the angle ``2 pi s / S`` from x towards y.
    marked (k, S)
        Sectors drawn in grey; ``mark`` says what that means.
    captions
        Of each moment, beside its time.
    prefix
        Stands before the time.
    """

    name: str
    title: str
    label: str
    unit: str
    time: Floats
    time_unit: str
    values: Floats
    marked: NDArray[np.bool_]
    mark: str
    captions: tuple[str, ...]
    linear: float = 1.0
    prefix: str = "time: "
    note: str = ""

    @property
    def sectors(self) -> int:
        """Number of sectors."""
        return self.values.shape[1]

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value of the colours."""
        low, high = float(self.values.min()), float(self.values.max())
        return min(low, 0.0), max(high, self.linear)


def squeezed(chart: RingFrames, values: Floats) -> Floats:
    """Place on the colour scale: ``asinh(v / linear)``."""
    return np.asarray(np.arcsinh(values / chart.linear))


def ticks_of(chart: RingFrames) -> tuple[float, ...]:
    """Round values within the scale of colours."""
    low, high = chart.ends
    powers = [chart.linear * 10.0**k for k in range(12)]
    both = [-p for p in reversed(powers)] + [0.0] + powers
    return tuple(v for v in both if low <= v <= high)


def frame_text(chart: RingFrames, k: int) -> str:
    """Time and caption of a moment."""
    time = f"{chart.time[k]:.2f}".replace("-", "\N{MINUS SIGN}")
    return ", ".join(filter(None, (f"{time} {chart.time_unit}", chart.captions[k])))


Colour = Literal["black", "orange", "sky", "green", "yellow", "blue", "red", "pink", "grey"]
Style = Literal["solid", "dashed", "dotted", "dashdot", "long", "sparse"]

COLOURS: dict[Colour, str] = {
    "black": "#111111",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "green": "#009E73",
    "yellow": "#F0E442",
    "blue": "#0072B2",
    "red": "#D55E00",
    "pink": "#CC79A7",
    "grey": "#8A8F98",
}

DASHES: dict[Style, tuple[float, ...]] = {
    "solid": (),
    "dashed": (7, 3),
    "dotted": (2, 2.5),
    "dashdot": (9, 3, 2, 3),
    "long": (14, 4),
    "sparse": (2, 6),
}
"""Lengths in px of strokes and spaces."""

AREA_OPACITY = 0.3

_MARGIN = 0.05

_TURNING = 0.6
"""Share of the x axis beyond which labels stand left of their lines, also where it is narrow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSpec:
    """An axis; ``range`` in printed units."""

    label: str
    unit: str = ""
    log: bool = False
    range: tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """Label with its unit, for example ``time [us]``."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    @property
    def ticks(self) -> tuple[float, ...]:
        """Round values 1, 2, 5, 10 ... of a logarithmic axis with a range; else none.

        >>> AxisSpec(label="frequency", log=True, range=(3.0, 60.0)).ticks
        (5.0, 10.0, 20.0, 50.0)
        """
        if not self.log or self.range is None:
            return ()
        low, high = self.range
        decades = range(floor(log10(low)), ceil(log10(high)) + 1)
        steps = (1, 2, 5) if log10(high / low) < 3.01 else (1,)
        # 1e-3 * 2 is not the float that 2e-3 is
        values = [float(f"{step}e{power}") for power in decades for step in steps]
        return tuple(value for value in values if low <= value <= high)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One line: x and y in the units of the axes; nan breaks the line.

    Parameters
    ----------
    label
        For the legend and the number under the pointer.
    drawn
        In ``steps`` value k holds from x_k to x_k+1; for an ``area`` the points go round it.
    listed
        False leaves it out of the legend alone.
    names
        Words for points, under the pointer.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    label: str = ""
    style: Style = "solid"
    colour: Colour = "black"
    width: float = 1.8
    drawn: Literal["line", "steps", "points", "area"] = "line"
    listed: bool = True
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if np.shape(self.x) != np.shape(self.y) or np.ndim(self.x) != 1:
            raise InputError(
                f"curve '{self.label}'",
                got=f"x of shape {np.shape(self.x)}, y of shape {np.shape(self.y)}",
                expected="two equally long rows of numbers",
                hint="the result may be damaged; compute it again.",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Shaded range of x with a label."""

    low: float
    high: float
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """Thin line across the panel at one value of x or y."""

    value: float
    label: str = ""
    axis: Literal["x", "y"] = "x"


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One plot area; ``share`` is its relative height."""

    y: AxisSpec
    curves: tuple[Curve, ...]
    bands: tuple[Band, ...] = ()
    marks: tuple[Mark, ...] = ()
    share: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Panels above each other over one common x axis, from top to bottom.

    Parameters
    ----------
    name
        Word for links and file names.
    note
        What the reader has to know and to look for.
    """

    name: str
    title: str
    x: AxisSpec
    panels: tuple[Panel, ...]
    note: str = ""

    def turns(self, x: float) -> bool:
        """Whether a label at this value stands left of it: the right end would cut it."""
        return self.share(x) > _TURNING

    def label_place(self, band: Band) -> float:
        """Where the label of a band stands: at its left end, as far as the axis shows it."""
        return max(band.low, self._ends[0])

    def share(self, x: float) -> float:
        """Place along the x axis: 0 at its left end, 1 at its right one."""
        low, high = self._ends
        if self.x.log:
            if min(low, x) <= 0.0:
                return 0.0
            low, high, x = log10(low), log10(high), log10(x)
        return (x - low) / (high - low) if high > low else 0.0

    def shows(self, x: float) -> bool:
        """Whether a value lies on the axis or in the margin of one without a range."""
        return -_MARGIN <= self.share(x) <= 1.0 + _MARGIN

    @property
    def _ends(self) -> tuple[float, float]:
        """Lowest and highest value of the x axis."""
        if self.x.range is not None:
            return self.x.range
        drawn = [curve.x for panel in self.panels for curve in panel.curves]
        known = np.concatenate(drawn) if drawn else np.zeros(0)
        known = known[np.isfinite(known) & (known > 0.0 if self.x.log else True)]
        return (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)


def mark_rows(chart: Chart, panel: Panel, letters: float) -> tuple[tuple[Mark, int], ...]:
    """Row of each label of an upright line, where none covers another; ``letters`` span the axis.

    Lines outside the axis have no label.
    """
    ends: list[float] = []
    rows = []
    upright = [mark for mark in panel.marks if mark.label and mark.axis == "x"]
    for mark in sorted(upright, key=lambda mark: mark.value):
        if not chart.shows(mark.value):
            continue
        place, width = chart.share(mark.value), (len(mark.label) + 2) / letters
        begin = place - width if chart.turns(mark.value) else place
        row = next((row for row, end in enumerate(ends) if end <= begin), len(ends))
        ends[row:] = [begin + width, *ends[row + 1 :]]
        rows.append((mark, row))
    return tuple(rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class BarPart:
    r"""One share of every bar; ``hatch`` is one of ``/ \ x . - | +``."""

    label: str
    values: tuple[float, ...]
    colour: Colour
    hatch: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class BarChart:
    """Horizontal stacked bars, from top to bottom."""

    name: str
    title: str
    x: AxisSpec
    rows: tuple[str, ...]
    parts: tuple[BarPart, ...]
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParallelAxis:
    """Upright axis: a value per line, of words which; nan leaves a line out."""

    spec: AxisSpec
    values: NDArray[np.float64]
    words: tuple[str, ...] = ()

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value, apart also where equal."""
        known = self.values[np.isfinite(self.values)]
        if not known.size:
            return 0.0, 1.0
        low, high = float(known.min()), float(known.max())
        apart = 0.0 if low < high else 0.5 * (abs(low) or 1.0)
        return low - apart, high + apart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParallelChart:
    """Parallel axes: every point of many dimensions is a line from axis to axis.

    Inselberg, A. (1985), The plane with parallel coordinates.  In the browser a range of an axis
    can be marked, and only the lines that pass it stay.  ``coloured`` is the axis whose values give
    the lines their colours.
    """

    name: str
    title: str
    axes: tuple[ParallelAxis, ...]
    coloured: int
    note: str = ""

    @property
    def lines(self) -> NDArray[np.float64]:
        """Values (lines, axes) of complete lines."""
        return self._table[self.places]

    @property
    def places(self) -> NDArray[np.int64]:
        """Places of these lines among all points."""
        return np.flatnonzero(np.isfinite(self._table).all(axis=1))

    @property
    def _table(self) -> NDArray[np.float64]:
        return np.column_stack([axis.values for axis in self.axes])


AnyChart = Chart | BarChart | ParallelChart | RingFrames


def dots(
    x: ArrayLike, y: ArrayLike, label: str, colour: Colour, width: float, names: Iterable[str]
) -> Curve:
    """Points, each with its name under the pointer."""
    return Curve(
        x=np.atleast_1d(np.asarray(x, dtype=float)),
        y=np.atleast_1d(np.asarray(y, dtype=float)),
        label=label,
        colour=colour,
        width=width,
        drawn="points",
        names=tuple(names),
    )


def stems(
    x: NDArray[np.float64], y: NDArray[np.float64], floor: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Upright strokes from ``floor`` to each point, as one broken line.

    >>> x, y = stems(np.array([1.0, 2.0]), np.array([5.0, 6.0]), 0.0)
    >>> [float(v) for v in y]
    [0.0, 5.0, nan, 0.0, 6.0, nan]
    """
    gap = np.full_like(x, np.nan)
    low = np.full_like(y, floor)
    return np.column_stack([x, x, gap]).ravel(), np.column_stack([low, y, gap]).ravel()
