r"""One time step of a contact law with memory, compiled: see :mod:`klack.contact.rubbing_law`.

With a constant force over a step the modes move exactly, ``d1 = d_free - G F``.  The force is the
mean of the law along the straight way from d0 to d1 with all that happens on it (sliders that let
go, springs that touch), in closed form:

.. math:: F = \frac{1}{d_1 - d_0} \int_{d_0}^{d_1} F(d)\, \mathrm dd ,

so that the work is what the springs store and what the sliders lose, for steps of any size.  No
loss is negative, spring by spring.
"""

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import inner, njit
from klack.contact.step_constants import NEWTON_LIMIT, TOUCH

__all__ = ["rubbed_on", "rubbing_mean", "rubbing_step"]

Vector = NDArray[np.float64]

_LEFT = 1e-13  # last Newton step over the indentation; kinks leave no better error than this
_STRAIGHT = 1e-4  # way over the indentation below which the slope is half that of the law
_STILL = 1e-15  # way over the indentation that is none


@inner
def _lets_go(ratio: float, x0: float, x1: float, slip: float) -> float:
    """Where between x0 and x1 a slider lets go, x1 where it holds."""
    if x1 >= x0:
        if ratio <= 1.0:
            return x1
        return min(max(slip * ratio / (ratio - 1.0), x0), x1)
    return max(min(slip * ratio / (ratio + 1.0), x0), x1)


@njit
def rubbing_mean(p: Vector, start: int, slip: Vector, d0: float, d1: float) -> tuple[float, float]:
    """Mean force between two indentations, from sliders at ``slip``, and its slope over ``d1``."""
    count, ratio = int(p[start]), p[start + 1]
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    way, deep = d1 - d0, max(d0, d1)
    still = abs(way) <= _STILL * deep
    work, end, slope = 0.0, 0.0, 0.0
    for j in range(count):
        if p[g + j] >= deep:
            break
        x0, x1 = max(d0 - p[g + j], 0.0), max(d1 - p[g + j], 0.0)
        k = ratio * p[h + j]
        go = _lets_go(ratio, x0, x1, slip[j])
        held = 0.5 * k * (go - x0) * (x0 + go - 2.0 * slip[j])
        sign = 1.0 if x1 > x0 else -1.0
        rubbed = 0.5 * sign * p[h + j] * (x1 - go) * (x1 + go)
        work += 0.5 * p[n + j] * (x1 - x0) * (x1 + x0) + held + rubbed
        force = k * (x1 - slip[j]) if go == x1 else sign * p[h + j] * x1
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
def rubbed_on(p: Vector, start: int, slip: Vector, d0: float, d1: float) -> float:
    """Take the sliders along from d0 to d1, in place; returns what they lose [J]."""
    count, ratio = int(p[start]), p[start + 1]
    g, h = start + 2, start + 2 + 2 * count
    lost = 0.0
    for j in range(count):
        x0, x1 = max(d0 - p[g + j], 0.0), max(d1 - p[g + j], 0.0)
        go = _lets_go(ratio, x0, x1, slip[j])
        back = 1.0 - 1.0 / ratio if x1 > x0 else 1.0 + 1.0 / ratio
        if go != x1:
            lost += 0.5 * back * p[h + j] * abs(x1 - go) * (x1 + go)
            slip[j] = back * x1
        if x1 == 0.0:
            slip[j] = 0.0
    return lost


@njit
def rubbing_step(
    p: Vector, start: int, slip: Vector, G: float, d0: float, df: float, guess: float
) -> tuple[float, float]:
    """Contact force of one step and what it loses; the sliders ``slip`` are taken along.

    As :func:`klack.simulation.contact_step.solve_step`: the excess ``d1 - df + G F(d0, d1)`` rises
    with a slope of 1 or more.
    """
    if d0 <= TOUCH and df <= TOUCH:
        return 0.0, 0.0
    low, high = -np.inf, df
    d1, force = df - G * guess, 0.0
    for _ in range(NEWTON_LIMIT):
        if d0 <= TOUCH and d1 <= TOUCH:
            force, slope = 0.0, 0.0
        else:
            force, slope = rubbing_mean(p, start, slip, d0, d1)
        excess = d1 - df + G * force
        if excess > 0.0:
            low, high = max(low, d1 - excess), d1
        else:
            low, high = d1, min(high, d1 - excess)
        step = excess / (1.0 + G * slope)
        if abs(step) <= _LEFT * max(d0, d1):
            break
        d1 -= step
        if not low <= d1 <= high:
            d1 = 0.5 * (low + high)
    return force, rubbed_on(p, start, slip, d0, df - G * force)
