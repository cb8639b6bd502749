r"""The scalar contact equation of one time step, compiled.

With a constant force over a step the modes move exactly, so the indentation at its end is
``d1 = d_free - G F`` and the work done is exactly ``F (d1 - d0)``.  The force is the discrete gradient
of the potential (Gonzalez 1996),

.. math:: F = \frac{V(d_1) - V(d_0)}{d_1 - d_0}\,\Bigl(1 + \chi\frac{d_1 - d_0}{h}\Bigr),

which makes that work equal to the stored energy plus a loss that is never negative: an energy identity
for every step size.  ``V(d_1) - V(d_0)`` is never formed by subtraction where digits would be lost.
Laws arrive as flat numbers, see :class:`klack.contact.laws.FlatLaw`.
"""

from math import sqrt

from numba import njit

from klack.contact.laws import LAW_HERTZ, LAW_LINEAR

__all__ = ["law_potential", "mean_force", "solve_step"]

_LINEAR, _HERTZ = LAW_LINEAR, LAW_HERTZ
_STEP_ACCEPTED = 1e-15  # [m] Newton step that is taken without a look at what it leaves
_NEWTON_LIMIT = 60


@njit(cache=True, inline="always")
def _power(d, n):
    if n == 1.5:
        return d * sqrt(d)
    return d**n


@njit(cache=True)
def _interval(p, start, n, d, hint):
    """Interval of a table that holds ``d``, searched from where it was last."""
    i = hint
    while i > 0 and d < p[start + 1 + i]:
        i -= 1
    while i < n - 1 and d >= p[start + 2 + i]:
        i += 1
    return i


@njit(cache=True, inline="always")
def _cubic(p, start, n, i, d):
    s = d - p[start + 1 + i]
    base = start + 1 + i
    return p[base + n] + s * (p[base + 2 * n] + s * (p[base + 3 * n] + s * p[base + 4 * n]))


@njit(cache=True)
def law_potential(kind, p, start, d):
    """Stored energy [J] of the elastic law at indentation ``d``."""
    if d <= 0.0:
        return 0.0
    if kind == _LINEAR:
        return 0.5 * p[start] * d * d
    if kind == _HERTZ:
        return p[start] / (p[start + 1] + 1.0) * _power(d, p[start + 1]) * d
    n = int(p[start])
    i = _interval(p, start, n, d, 0)
    base = start + 1 + i
    s = d - p[base]
    return p[base + 5 * n] + s * (
        p[base + n]
        + s * (p[base + 2 * n] / 2 + s * (p[base + 3 * n] / 3 + s * p[base + 4 * n] / 4))
    )


@njit(cache=True)
def _hertz_mean(K, n, low, high):
    """Mean of ``K d^n`` over ``low < d < high``, both positive and close together or not."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    r = half / middle
    if r < 5e-3:
        c = n * (n - 1.0) / 6.0
        r2 = r * r
        tail = 1.0 + (n - 2.0) * (n - 3.0) / 20.0 * r2
        return K * _power(middle, n) * (1.0 + c * r2 * tail)
    return K / (n + 1.0) * (_power(high, n) * high - _power(low, n) * low) / (high - low)


@njit(cache=True)
def mean_force(kind, p, start, d0, d1, hint):
    """Mean force between two indentations, its slope over ``d1``, and the table interval of ``d1``."""
    low, high = min(d0, d1), max(d0, d1)
    if high <= 0.0:
        return 0.0, 0.0, hint
    below = max(low, 0.0)
    width, closed = high - low, high - below
    if kind == _LINEAR:
        k = p[start]
        f1 = k * max(d1, 0.0)
        mean = 0.5 * k * (below + high)
        tangent = k
    elif kind == _HERTZ:
        K, n = p[start], p[start + 1]
        f1 = K * _power(max(d1, 0.0), n)
        mean = _hertz_mean(K, n, below, high)
        tangent = 0.0  # set below where it is needed
        if width < 1e-16:
            tangent = n * mean / high
    else:
        n_points = int(p[start])
        i = _interval(p, start, n_points, below, hint)
        j = _interval(p, start, n_points, high, i)
        if i == j:
            f_low = _cubic(p, start, n_points, i, below)
            f_high = _cubic(p, start, n_points, i, high)
            f_middle = _cubic(p, start, n_points, i, 0.5 * (below + high))
            mean = (f_low + 4.0 * f_middle + f_high) / 6.0  # exact for a cubic
        else:
            work = 0.0
            left = below
            f_high = 0.0
            for piece in range(i, j + 1):
                right = high if piece == j else p[start + 2 + piece]
                f_left = _cubic(p, start, n_points, piece, left)
                f_high = _cubic(p, start, n_points, piece, right)
                f_middle = _cubic(p, start, n_points, piece, 0.5 * (left + right))
                work += (right - left) * (f_left + 4.0 * f_middle + f_high) / 6.0
                left = right
            mean = work / closed
        hint = j
        f1 = f_high
        if d1 < high:
            f1 = 0.0
            if d1 > 0.0:
                f1 = _cubic(p, start, n_points, i, below)
        s = below - p[start + 1 + i]
        base = start + 1 + i
        tangent = p[base + 2 * n_points] + s * (
            2.0 * p[base + 3 * n_points] + 3.0 * s * p[base + 4 * n_points]
        )
    if width < 1e-16:
        return mean, 0.5 * tangent, hint
    mean *= closed / width
    return mean, (f1 - mean) / (d1 - d0), hint


@njit(cache=True)
def _solve_linear(k, G, d0, df):
    """Closed form of the elastic step for ``F = k d``: both closed, release, onset."""
    a = 1.0 + 0.5 * G * k
    if d0 >= 0.0:
        d1 = (df - 0.5 * G * k * d0) / a
        if d1 >= 0.0:
            return 0.5 * k * (d0 + df) / a
        b, c = df + d0, d0 * (df - 0.5 * G * k * d0)
        root = sqrt(max(b * b - 4.0 * c, 0.0))
        d1 = 2.0 * c / (b + root) if b > 0.0 else 0.5 * (b - root)
        return 0.5 * k * d0 * d0 / (d0 - d1)
    b, c = df + d0, df * d0
    root = sqrt(max(b * b - 4.0 * a * c, 0.0))
    d1 = 0.5 * (b + root) / a if b > 0.0 else 2.0 * c / (b - root)
    return 0.5 * k * d1 * d1 / (d1 - d0)


@njit(cache=True)
def solve_step(kind, p, start, chi_over_h, G, d0, df, guess, hint):
    """Contact force of one step.

    Solves ``d1 = df - G F(d0, d1)``; its left minus right side rises with ``d1``, so there is one
    root, between ``df - G F(d0, df)`` and ``df``.

    Returns the force, the table interval, and the part of the work ``F (d1 - d0)`` that is lost.
    """
    if d0 <= 0.0 and df <= 0.0:
        return 0.0, hint, 0.0
    if kind == _LINEAR and chi_over_h == 0.0:
        return _solve_linear(p[start], G, d0, df), hint, 0.0
    high = df
    force, slope, hint = _step_force(kind, p, start, chi_over_h, d0, df, hint)
    if force <= 0.0:
        return 0.0, hint, _lost(kind, p, start, chi_over_h, d0, df, hint)
    low = df - G * force
    d1 = min(max(df - G * guess, low), high)
    for _ in range(_NEWTON_LIMIT):
        force, slope, hint = _step_force(kind, p, start, chi_over_h, d0, d1, hint)
        excess = d1 - df + G * force
        step = excess / (1.0 + G * slope)
        if abs(step) < _STEP_ACCEPTED:  # before the bracket test: both its ends are round-off now
            force -= slope * step
            d1 -= step
            break
        if excess > 0.0:
            high = d1
        else:
            low = d1
        d1 -= step
        if not low < d1 < high:
            d1 = 0.5 * (low + high)
    force = max(force, 0.0)
    return force, hint, _lost(kind, p, start, chi_over_h, d0, d1, hint)


@njit(cache=True)
def _step_force(kind, p, start, chi_over_h, d0, d1, hint):
    mean, slope, hint = mean_force(kind, p, start, d0, d1, hint)
    if chi_over_h == 0.0:
        return mean, slope, hint
    factor = 1.0 + chi_over_h * (d1 - d0)
    if factor <= 0.0:
        return 0.0, 0.0, hint  # the law would pull
    return mean * factor, slope * factor + mean * chi_over_h, hint


@njit(cache=True)
def _lost(kind, p, start, chi_over_h, d0, d1, hint):
    if chi_over_h == 0.0:
        return 0.0
    mean, _, _ = mean_force(kind, p, start, d0, d1, hint)
    stored = mean * (d1 - d0)
    rate = chi_over_h * (d1 - d0)
    if rate <= -1.0:
        return -stored  # clipped: the store empties without doing work
    return stored * rate
