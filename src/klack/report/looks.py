"""How curves and parts of bars look: told apart by style or hatch as well as by colour."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.report.chart import Colour, Curve, Style

__all__ = ["LOOKS", "OTHER", "PART_LOOKS", "Look", "look_of"]


class Look(NamedTuple):
    """Of a curve; the width is that of paper and screen [px]."""

    colour: Colour
    style: Style
    width: float

    def curve(
        self, x: NDArray[np.float64], y: NDArray[np.float64], label: str = "", **more: Any
    ) -> Curve:
        """A curve that looks so; ``more`` are fields of :class:`klack.report.chart.Curve`."""
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
"""Of curves without a look of their own, in their order."""

OTHER = Look("grey", "dashed", 1.9)
"""Of what has a name that nobody knows."""

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
"""Colour and hatch of the parts of a bar."""


def look_of(index: int) -> Look:
    """Look of the k-th curve."""
    return LOOKS[index % len(LOOKS)]
