r"""The scalar contact equation of one time step, compiled.

With a constant force over a step the modes move exactly, so the indentation at its end is ``d1 =
d_free - G F`` and the work done is exactly ``F (d1 - d0)``.  The force is the discrete gradient of
the potential (Gonzalez 1996),

.. math:: F = \frac{V(d_1) - V(d_0)}{d_1 - d_0}\,\Bigl(1 + \chi\frac{d_1 - d_0}{h}\Bigr),

so that work is stored energy plus a loss that is never negative, for every step size.  ``V(d_1) -
V(d_0)`` is never formed by subtraction where digits would be lost.  Laws are flat numbers, see
:class:`klack.contact.laws.FlatLaw`.
"""

from math import sqrt

import numpy as np

from klack.arrays import Vector
from klack.contact.step_constants import (
    FORCE_LEFT,
    HERTZ_EQUAL,
    HERTZ_SERIES_BELOW,
    LAW_HERTZ,
    LAW_LINEAR,
    LAW_RUBBING,
    LAW_TABLE,
    LAW_YIELDING,
    NEWTON_LIMIT,
    RUBBED_LEFT,
    STEP_LEFT,
    TOUCH,
)
from klack.machine.compiling.jit import inner, njit
from klack.simulation.lasting_laws import rubbing_mean, rubbing_store, yielding_mean, yielding_store
from klack.simulation.phase import compiled

__all__ = ["law_potential", "mean_force", "solve_linear", "solve_step"]


@njit(inline="always")
def _power(d: float, n: float) -> float:
    if n == 1.5:
        return d * sqrt(d)
    return d**n


@njit(inline="always")
def _interval(p: Vector, start: int, d: float, hint: int) -> int:
    """Offset in ``p`` of the table interval that holds ``d``, searched from ``hint`` on."""
    first = start + 1
    last = first + 6 * (int(p[start]) - 1)
    i = first + 6 * hint
    while i > first and d < p[i]:
        i -= 6
    while i < last and d >= p[i + 6]:
        i += 6
    return i


@njit
def law_potential(kind: int, p: Vector, start: int, d: float) -> float:
    """Stored energy [J] of the elastic law at indentation ``d``."""
    if d <= 0.0:
        return 0.0
    if kind == LAW_LINEAR:
        return 0.5 * p[start] * d * d
    if kind == LAW_HERTZ:
        return p[start] / (p[start + 1] + 1.0) * _power(d, p[start + 1]) * d
    if kind == LAW_RUBBING:
        return rubbing_store(p, start, d)
    if kind == LAW_YIELDING:
        return yielding_store(p, start, d)
    i = _interval(p, start, d, 0)
    s = d - p[i]
    return p[i + 5] + s * (p[i + 1] + s * (p[i + 2] / 2 + s * (p[i + 3] / 3 + s * p[i + 4] / 4)))


@inner
def _hertz_mean(K: float, n: float, low: float, high: float) -> float:
    """Mean of ``K d^n`` over ``low < d < high``, both positive."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    r = half / middle
    if r < HERTZ_SERIES_BELOW:
        c = n * (n - 1.0) / 6.0
        r2 = r * r
        tail = 1.0 + (n - 2.0) * (n - 3.0) / 20.0 * r2
        return K * _power(middle, n) * (1.0 + c * r2 * tail)
    return K / (n + 1.0) * (_power(high, n) * high - _power(low, n) * low) / (high - low)


@njit(inline="always")
def _cubic_mean(p: Vector, i: int, s0: float, s1: float) -> tuple[float, float]:
    """Mean force between two places of one interval, and its slope over ``s1``."""
    c1, c2, c3 = p[i + 2], p[i + 3], p[i + 4]
    sum1, sum2 = s0 + s1, s0 * s0 + s1 * s1
    mean = p[i + 1] + c1 / 2 * sum1 + c2 / 3 * (sum2 + s0 * s1) + c3 / 4 * sum1 * sum2
    slope = c1 / 2 + c2 / 3 * (s0 + 2.0 * s1) + c3 / 4 * (sum2 + 2.0 * s1 * sum1)
    return mean, slope


@njit(inline="always")
def _within(p: Vector, start: int, i: int, d0: float, d1: float) -> bool:
    return min(d0, d1) >= p[i] and (i + 6 > start + 6 * int(p[start]) or max(d0, d1) < p[i + 6])


@inner
def _table_mean(p: Vector, start: int, d0: float, d1: float, hint: int) -> tuple[float, float, int]:
    i = _interval(p, start, max(d1, 0.0), hint)
    number = (i - start - 1) // 6
    if _within(p, start, i, d0, d1):
        mean, slope = _cubic_mean(p, i, d0 - p[i], d1 - p[i])
        return mean, slope, number
    low, high = max(min(d0, d1), 0.0), max(d0, d1)
    i = _interval(p, start, low, number)
    j = _interval(p, start, high, number)
    work, left = 0.0, low
    for piece in range(i, j + 1, 6):
        right = high if piece == j else p[piece + 6]
        mean, _ = _cubic_mean(p, piece, left - p[piece], right - p[piece])
        work += (right - left) * mean
        left = right
    mean = work / abs(d1 - d0)
    f1 = 0.0
    if d1 > 0.0:
        end = j if d1 >= d0 else i
        f1, _ = _cubic_mean(p, end, d1 - p[end], d1 - p[end])
    return mean, (f1 - mean) / (d1 - d0), number


@njit
def mean_force(
    kind: int, p: Vector, start: int, d0: float, d1: float, hint: int
) -> tuple[float, float, int]:
    """Mean force between two indentations, its slope over ``d1``, and the table interval."""
    if d0 <= TOUCH and d1 <= TOUCH:
        return 0.0, 0.0, hint
    if kind == LAW_LINEAR:
        k = p[start]
        if d0 >= 0.0 and d1 >= 0.0:
            return 0.5 * k * (d0 + d1), 0.5 * k, hint
        mean = 0.5 * k * max(d0, d1) ** 2 / abs(d1 - d0)
        return mean, (k * max(d1, 0.0) - mean) / (d1 - d0), hint
    if kind == LAW_HERTZ:
        K, n = p[start], p[start + 1]
        low, high = min(d0, d1), max(d0, d1)
        mean = _hertz_mean(K, n, max(low, 0.0), high)
        if high - low < HERTZ_EQUAL * high:
            return mean, 0.5 * n * mean / high, hint
        mean *= (high - max(low, 0.0)) / (high - low)
        return mean, (K * _power(max(d1, 0.0), n) - mean) / (d1 - d0), hint
    if kind == LAW_RUBBING:
        mean, slope = rubbing_mean(p, start, d0, d1)
        return mean, slope, hint
    if kind == LAW_YIELDING:
        mean, slope = yielding_mean(p, start, d0, d1)
        return mean, slope, hint
    return _table_mean(p, start, d0, d1, hint)


@compiled()
def solve_linear(k: float, G: float, d0: float, df: float) -> float:
    """Closed form of the elastic step for ``F = k d``: both closed, release, onset."""
    if d0 <= TOUCH and df <= TOUCH:
        return 0.0
    a = 1.0 + 0.5 * G * k
    if d0 >= 0.0:
        if df >= 0.5 * G * k * d0:
            return 0.5 * k * (d0 + df) / a
        b, c = df + d0, d0 * (df - 0.5 * G * k * d0)
        root = sqrt(max(b * b - 4.0 * c, 0.0))
        d1 = 2.0 * c / (b + root) if b > 0.0 else 0.5 * (b - root)
        return 0.5 * k * d0 * d0 / (d0 - d1)
    b, c = df + d0, df * d0
    root = sqrt(max(b * b - 4.0 * a * c, 0.0))
    d1 = 0.5 * (b + root) / a if b > 0.0 else 2.0 * c / (b - root)
    return 0.5 * k * d1 * d1 / (d1 - d0)


@njit
def solve_step(
    kind: int,
    p: Vector,
    start: int,
    chi_over_h: float,
    G: float,
    d0: float,
    df: float,
    guess: float,
    hint: int,
) -> tuple[float, int, float]:
    """Contact force of one step, table interval, and lost part of the work ``F (d1 - d0)``.

    Solves ``excess = d1 - df + G F(d0, d1) = 0``.  Its slope is 1 or more, so the one root lies
    within ``|excess|`` of any ``d1``: the bracket of the safeguarded Newton iteration costs
    nothing.
    """
    if d0 <= TOUCH and df <= TOUCH:
        return 0.0, hint, 0.0
    if kind == LAW_LINEAR and chi_over_h == 0.0:
        return solve_linear(p[start], G, d0, df), hint, 0.0
    low, high, longest = -np.inf, df, np.inf
    d1 = df - G * guess
    force = 0.0
    for _ in range(NEWTON_LIMIT):
        i = start + 1 + 6 * hint
        if kind == LAW_TABLE and chi_over_h == 0.0 and _within(p, start, i, d0, d1):
            force, slope = _cubic_mean(p, i, d0 - p[i], d1 - p[i])  # the usual case, no call
            curvature = abs(p[i + 3]) + abs(p[i + 4]) * (d0 + 3.0 * d1 - 4.0 * p[i])
            excess = d1 - df + G * force
            step = excess / (1.0 + G * slope)
            last = curvature * step * step <= FORCE_LEFT * force
            last = last and _within(p, start, i, d0, d1 - step)  # another cubic beyond
        else:
            force, slope, hint = _step_force(kind, p, start, chi_over_h, d0, d1, hint)
            excess = d1 - df + G * force
            step = excess / (1.0 + G * slope)
            deep = max(d0, d1)
            if chi_over_h * deep > 1.0:
                deep = 1.0 / chi_over_h
            last = abs(step) <= (RUBBED_LEFT if kind >= LAW_RUBBING else STEP_LEFT) * deep
        # taken without a look back, and before the bracket test: both its ends are round-off then
        if last:
            force = max(force - slope * step, 0.0)
            d1 -= step
            break
        if excess > 0.0:
            low, high = max(low, d1 - excess), d1
        else:
            low, high = d1, min(high, d1 - excess)
        d1 -= step
        # about the kinks of laws with memory Newton's method can turn in a circle
        circles = kind >= LAW_RUBBING and 2.0 * abs(step) > longest
        longest = abs(step)
        if circles or not low <= d1 <= high:
            d1 = 0.5 * (low + high)
    if chi_over_h == 0.0:
        return force, hint, 0.0
    return force, hint, _lost(kind, p, start, chi_over_h, d0, d1, hint)


@inner
def _step_force(
    kind: int, p: Vector, start: int, chi_over_h: float, d0: float, d1: float, hint: int
) -> tuple[float, float, int]:
    mean, slope, hint = mean_force(kind, p, start, d0, d1, hint)
    if chi_over_h == 0.0:
        return mean, slope, hint
    factor = 1.0 + chi_over_h * (d1 - d0)
    if factor <= 0.0:
        return 0.0, 0.0, hint  # the law would pull
    return mean * factor, slope * factor + mean * chi_over_h, hint


@inner
def _lost(
    kind: int, p: Vector, start: int, chi_over_h: float, d0: float, d1: float, hint: int
) -> float:
    mean, _, _ = mean_force(kind, p, start, d0, d1, hint)
    stored = mean * (d1 - d0)
    rate = chi_over_h * (d1 - d0)
    if rate <= -1.0:
        return -stored  # clipped: the store empties without doing work
    return stored * rate
