"""Looks of curves and bars: style or hatch beside colour."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.report.chart import Colour, Curve, Style

__all__ = [
    "LINE_LOOKS",
    "LOOKS",
    "OTHER",
    "PART_LOOKS",
    "PIXELS",
    "Look",
    "dotted",
    "look_of",
    "thinned",
]


class Look(NamedTuple):
    """Of a curve; the width [px] holds for paper and screen."""

    colour: Colour
    style: Style
    width: float

    def curve(
        self, x: NDArray[np.float64], y: NDArray[np.float64], label: str = "", **more: Any
    ) -> Curve:
        """Curve of this look; ``more`` are its other fields."""
        return Curve(
            x=x, y=y, label=label, colour=self.colour, style=self.style, width=self.width, **more
        )


LOOKS: tuple[Look, ...] = (
    Look("black", "solid", 2.0),
    Look("red", "dashed", 2.0),
    Look("blue", "dashdot", 1.9),
    Look("orange", "dotted", 2.2),
    Look("green", "long", 1.9),
    Look("pink", "sparse", 2.1),
    Look("sky", "dashed", 1.6),
)
"""Of curves without looks of their own."""

OTHER = Look("grey", "dashed", 1.9)
"""Of anything with an unknown name."""

PART_LOOKS: tuple[tuple[Colour, str], ...] = (
    ("blue", ""),
    ("sky", "/"),
    ("red", ""),
    ("orange", "\\"),
    ("green", ""),
    ("pink", "x"),
    ("yellow", "."),
    ("grey", "-"),
)


LINE_LOOKS: tuple[tuple[Colour, Style], ...] = (
    ("blue", "solid"),
    ("orange", "dashed"),
    ("green", "dotted"),
    ("red", "dashdot"),
    ("sky", "long"),
    ("pink", "sparse"),
)
"""Of lines with a dot at each point."""


def dotted(line: Curve) -> tuple[Curve, Curve]:
    """A line, and a dot at each of its points."""
    return line, replace(line, label="", style="solid", drawn="points", width=3.0, listed=False)


def look_of(index: int) -> Look:
    """Look of the k-th curve."""
    return LOOKS[index % len(LOOKS)]


PIXELS = 700
"""Columns of a picture on the page."""

Floats = NDArray[np.float64]


def thinned(
    x: Floats, y: Floats, *, window: tuple[float, float] | None = None, columns: int = PIXELS
) -> tuple[Floats, Floats]:
    """Points of a curve that a picture of some columns can show.

    Each column keeps the points with the smallest and the largest ``y``, so that no peak is lost or
    moves; short curves stay.

    Parameters
    ----------
    x (n,)
        Rising.
    y (n,)
        nan breaks the curve; it is not thinned then.

    Examples
    --------
    >>> x = np.arange(10000.0)
    >>> y = np.where(x == 4321, 1.0, 0.0)
    >>> few_x, few_y = thinned(x, y, columns=100)
    >>> few_x.size <= 202, float(few_x[few_y == 1.0][0])
    (True, 4321.0)
    """
    if window is not None:
        seen = (x >= window[0]) & (x <= window[1])
        x, y = x[seen], y[seen]
    if x.size <= 2 * columns or np.isnan(y).any():
        return x, y
    column = ((x - x[0]) / (x[-1] - x[0]) * columns).astype(np.int64).clip(0, columns - 1)
    begins = np.flatnonzero(np.diff(column, prepend=-1))
    counts = np.diff(begins, append=x.size)
    low, high = (
        np.flatnonzero(y == np.repeat(extreme.reduceat(y, begins), counts))
        for extreme in (np.minimum, np.maximum)
    )
    first = low[np.diff(column[low], prepend=-1) > 0]
    last = high[np.diff(column[high], append=columns) > 0]
    kept = np.unique(np.concatenate([[0, x.size - 1], first, last]))
    return x[kept], y[kept]
