r"""Contact law of faces that yield in a time step, compiled: see :mod:`klack.contact.yielding_law`.

With the work W along the way from an indentation to another, elastic up to the largest one so far
and along the loading curve beyond,

.. math:: F = \frac{W(d_1) - W(d_0)}{d_1 - d_0} ,

so that the work of a step is what the faces store and what they lose, for steps of any size.
Trying a force changes nothing; :func:`press` takes the largest indentation along once a step is
accepted, and takes the loss as the difference, which is right for any tables.

The largest indentation [m] is the third of the numbers of the law, the fourth a copy of it for
steps that are taken back.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import inner, njit

__all__ = ["press", "pressed_state", "yielding_mean", "yielding_store"]

Vector = NDArray[np.float64]

_SMALL = 1e-6  # way over the indentation below which the force is that of its middle


def pressed_state(p: Vector, start: int) -> Vector:
    """Largest indentation so far [m], shape (1,), as a view."""
    return p[start + 2 : start + 3]


@inner
def _state(p: Vector, start: int, deep: float) -> tuple[int, float]:
    """State below a largest indentation, and the share of the way to the next one."""
    count, first = int(p[start]), start + 4
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if p[first + middle] <= deep:
            low = middle
        else:
            high = middle
    share = (deep - p[first + low]) / (p[first + low + 1] - p[first + low])
    return low, max(share, 0.0)


@inner
def _between(p: Vector, start: int, table: int, i: int, share: float) -> float:
    """One of the tables over the states: set 1, force 2, work 3."""
    at = start + 4 + table * int(p[start]) + i
    return p[at] + share * (p[at + 1] - p[at])


@inner
def _elastic(p: Vector, start: int, deep: float, d: float) -> tuple[float, float, float]:
    """Force [N], stiffness [N/m] and energy [J] of the elastic curve up to ``deep``."""
    count, places = int(p[start]), int(p[start + 1])
    i, share = _state(p, start, deep)
    parted = _between(p, start, 1, i, share)
    if d <= parted:
        return 0.0, 0.0, 0.0
    way, size = deep - parted, _between(p, start, 2, i, share)
    s = min((d - parted) / way, 1.0)
    k = min(int(sqrt(s) * (places - 1)), places - 2)
    n = float(places - 1)
    s0 = (k / n) * (k / n)
    s1 = ((k + 1) / n) * ((k + 1) / n)
    if s < s0:
        k -= 1
        s0, s1 = (k / n) * (k / n), s0
    a = start + 4 + 4 * count + i * places + k
    b = a + places
    low = p[a] + share * (p[b] - p[a])
    high = p[a + 1] + share * (p[b + 1] - p[a + 1])
    whole = count * places
    below = p[a + whole] + share * (p[b + whole] - p[a + whole])
    slope = (high - low) / (s1 - s0)
    x = s - s0
    return (
        size * (low + slope * x),
        size * slope / way,
        size * way * (below + x * (low + 0.5 * slope * x)),
    )


@inner
def _closing(p: Vector, start: int, d: float) -> tuple[float, float, float]:
    """Force [N], stiffness [N/m] and work [J] of the loading curve."""
    first, count = start + 4, int(p[start])
    i, share = _state(p, start, d)
    width = p[first + i + 1] - p[first + i]
    f0, f1 = p[first + 2 * count + i], p[first + 2 * count + i + 1]
    slope, x = (f1 - f0) / width, share * width
    return f0 + slope * x, slope, p[first + 3 * count + i] + x * (f0 + 0.5 * slope * x)


@inner
def _along(p: Vector, start: int, d: float) -> tuple[float, float, float]:
    """Force, stiffness and work of the faces as they are now, up to an indentation."""
    deep = p[start + 2]
    if d <= deep:
        return _elastic(p, start, deep, d)
    force, slope, work = _closing(p, start, d)
    _, _, stored = _elastic(p, start, deep, deep)
    _, _, before = _closing(p, start, deep)
    return force, slope, stored + work - before


@njit
def yielding_mean(p: Vector, start: int, d0: float, d1: float) -> tuple[float, float]:
    """Mean force between two indentations, and its slope over ``d1``."""
    way = d1 - d0
    if abs(way) <= _SMALL * max(d0, d1):
        force, slope, _ = _along(p, start, 0.5 * (d0 + d1))
        return force, 0.5 * slope
    force, _, work = _along(p, start, d1)
    _, _, before = _along(p, start, d0)
    mean = (work - before) / way
    return mean, (force - mean) / way


@njit
def yielding_store(p: Vector, start: int, d: float) -> float:
    """Elastic energy [J] at an indentation."""
    _, _, energy = _elastic(p, start, p[start + 2], d)
    return energy


@njit
def press(p: Vector, start: int, d0: float, d1: float, force: float) -> float:
    """Take the largest indentation along from d0 to d1, in place; returns the loss [J]."""
    if d1 <= p[start + 2]:
        return 0.0
    before = yielding_store(p, start, d0)
    p[start + 2] = d1
    return before + force * (d1 - d0) - yielding_store(p, start, d1)
