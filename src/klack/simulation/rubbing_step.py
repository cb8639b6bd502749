r"""Contact law with memory in a time step, compiled: see :mod:`klack.contact.rubbing_law`.

The force of a step is the mean of the law along the straight way from d0 to d1 with all that
happens on it (sliders that let go, springs that touch), in closed form:

.. math:: F = \frac{1}{d_1 - d_0} \int_{d_0}^{d_1} F(d)\, \mathrm dd ,

so that the work is what the springs store and what the sliders lose, for steps of any size.  No
loss is negative, spring by spring.

The places of the sliders [m] lie behind the numbers of the law, then a copy of them for steps that
are taken back.  Trying a force leaves them where they are; :func:`slide` takes them along once a
step is accepted.
"""

from klack.arrays import Vector
from klack.compiling.jit import inner, njit

__all__ = [
    "begin_sliders",
    "closing_force",
    "keep_sliders",
    "rubbing_mean",
    "rubbing_store",
    "slide",
    "slider_places",
    "take_back_sliders",
]


_STRAIGHT = 1e-4  # way over the indentation below which the slope is half that of the law
_STILL = 1e-15  # way over the indentation that is none


def slider_places(p: Vector, start: int) -> Vector:
    """Places [m] of the sliders of the law from ``p[start]`` on, as a view."""
    count = int(p[start])
    first = start + 2 + 3 * count
    return p[first : first + count]


@inner
def _lets_go(ratio: float, x0: float, x1: float, slip: float) -> float:
    """Where between x0 and x1 a slider lets go, x1 where it holds."""
    if x1 >= x0:
        if ratio <= 1.0:
            return x1
        return min(max(slip * ratio / (ratio - 1.0), x0), x1)
    return max(min(slip * ratio / (ratio + 1.0), x0), x1)


@njit
def rubbing_mean(p: Vector, start: int, d0: float, d1: float) -> tuple[float, float]:
    """Mean force between two indentations, and its slope over ``d1``."""
    count, ratio = int(p[start]), p[start + 1]
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    s = h + count
    way, deep = d1 - d0, max(d0, d1)
    still = abs(way) <= _STILL * deep
    work, end, slope = 0.0, 0.0, 0.0
    for j in range(count):
        if p[g + j] >= deep:
            break
        x0, x1 = max(d0 - p[g + j], 0.0), max(d1 - p[g + j], 0.0)
        # the way itself where there is no end of the spring on it: a short one keeps its digits
        moved = way if x0 > 0.0 and x1 > 0.0 else x1 - x0
        k, slip = ratio * p[h + j], p[s + j]
        go = _lets_go(ratio, x0, x1, slip)
        holds = moved if go == x1 else go - x0
        held = 0.5 * k * holds * (x0 + go - 2.0 * slip)
        sign = 1.0 if x1 > x0 else -1.0
        rubbed = 0.5 * sign * p[h + j] * (moved - holds) * (x1 + go)
        work += 0.5 * p[n + j] * moved * (x1 + x0) + held + rubbed
        force = k * (x1 - slip) if go == x1 else sign * p[h + j] * x1
        end += p[n + j] * x1 + force
        if x1 > 0.0:
            slope += p[n + j] + (k if go == x1 else sign * p[h + j])
    if still:
        return end, 0.5 * slope
    mean = work / way
    if abs(way) <= _STRAIGHT * deep:
        return mean, 0.5 * slope
    return mean, (end - mean) / way


@njit
def rubbing_store(p: Vector, start: int, d: float) -> float:
    """Energy [J] of springs and held sliders at an indentation."""
    count, ratio = int(p[start]), p[start + 1]
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    s = h + count
    stored = 0.0
    for j in range(count):
        x = max(d - p[g + j], 0.0)
        held = x - p[s + j]
        stored += 0.5 * p[n + j] * x * x + 0.5 * ratio * p[h + j] * held * held
    return stored


@njit
def closing_force(p: Vector, start: int, d: float) -> tuple[float, float]:
    """Force [N] while the contact closes from first touch, and its slope [N/m]."""
    count, share = int(p[start]), min(p[start + 1], 1.0)
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    force, slope = 0.0, 0.0
    for j in range(count):
        if p[g + j] >= d:
            break
        stiffness = p[n + j] + share * p[h + j]
        force += stiffness * (d - p[g + j])
        slope += stiffness
    return force, slope


@njit
def slide(p: Vector, start: int, d0: float, d1: float) -> float:
    """Take the sliders along from d0 to d1, in place; returns what they lose [J]."""
    count, ratio = int(p[start]), p[start + 1]
    g, h = start + 2, start + 2 + 2 * count
    s = h + count
    lost = 0.0
    for j in range(count):
        x0, x1 = max(d0 - p[g + j], 0.0), max(d1 - p[g + j], 0.0)
        go = _lets_go(ratio, x0, x1, p[s + j])
        back = 1.0 - 1.0 / ratio if x1 > x0 else 1.0 + 1.0 / ratio
        if go != x1:
            lost += 0.5 * back * p[h + j] * abs(x1 - go) * (x1 + go)
            p[s + j] = back * x1
        if x1 == 0.0:
            p[s + j] = 0.0
    return lost


@njit
def begin_sliders(p: Vector, start: int, d: float) -> None:
    """Let the sliders lie as after closing from first touch to an indentation."""
    count = int(p[start])
    s = start + 2 + 3 * count
    for j in range(count):
        p[s + j] = 0.0
    slide(p, start, 0.0, d)


@njit
def keep_sliders(p: Vector, start: int) -> None:
    """Remember where the sliders are."""
    count = int(p[start])
    s = start + 2 + 3 * count
    for j in range(count):
        p[s + count + j] = p[s + j]


@njit
def take_back_sliders(p: Vector, start: int) -> None:
    """Put the sliders back to where they were remembered."""
    count = int(p[start])
    s = start + 2 + 3 * count
    for j in range(count):
        p[s + j] = p[s + count + j]
