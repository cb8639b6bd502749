"""Points inside a closed surface, where the equation of the outside has no solution but silence."""

from collections.abc import Callable

import numpy as np

from klack.arrays import Flags, Matrix, Vector
from klack.errors import InputError

__all__ = ["spread_inside"]

_TRIES, _MOST_TRIES = 400, 40
_DEPTH = 0.3  # of the deepest place: nearer the surface constant elements are seen one by one


def spread_inside(
    nodes: Matrix,
    count: int,
    draw: int,
    within: Callable[[Matrix], Flags],
    distance: Callable[[Matrix], Vector],
) -> Matrix:
    """Random points (count, d) inside, at 0.3 of the largest depth or below.

    Parameters
    ----------
    draw
        Another number, other points; the same number, the same points.
    within, distance
        Of points (k, d): whether inside, and how far [m] from the surface.
    """
    random = np.random.default_rng(draw)
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    found = np.empty((0, nodes.shape[1]))
    for _ in range(_MOST_TRIES):
        points = random.uniform(low, high, (_TRIES, nodes.shape[1]))
        found = np.vstack([found, points[within(points)]])
        if len(found) >= 2 * count:
            depth = distance(found)
            deep = found[depth > _DEPTH * depth.max()]
            if len(deep) >= count:
                return deep[:count]
    raise InputError(
        "boundary elements: surface",
        got="almost no volume inside",
        expected="a closed surface around a body",
        hint="close openings, and orient the normals into the air.",
    )
