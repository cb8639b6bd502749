"""Positions that a guide leaves to the axis of its shaft."""

from math import cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.case.guide import CaseGuide

__all__ = ["axis_through", "in_disc"]

Vector = NDArray[np.float64]


def axis_through(
    guide: CaseGuide, height: float, low: Vector, high: Vector
) -> tuple[Vector, Vector]:
    """Position at a height and slope of the axis through two points at the outer guide heights."""
    slope = (high - low) / (guide.heights[-1] - guide.heights[0])
    return low + slope * (height - guide.heights[0]), slope


def in_disc(shares: Vector, radius: float) -> Vector:
    """Point of a disc, all places alike, from two numbers between 0 and 1."""
    distance, angle = radius * sqrt(shares[0]), 2.0 * pi * shares[1]
    return distance * np.array([cos(angle), sin(angle)])
