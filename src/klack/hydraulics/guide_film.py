r"""Film of a needle in its guide: a short bearing that does not turn, eccentric and whirling.

.. math:: \frac{\partial}{\partial z}\Bigl(\frac{h^3}{12\mu}\frac{\partial p}{\partial z}\Bigr)
          = \dot h, \qquad h = c - e_x \cos\theta - e_y \sin\theta

(Ocvirk 1952 for a journal that turns, Booker 1965 for squeeze.)  The pressure is a parabola along
the guide, with the line load :math:`\mu L^3 (-\dot h)/h^3`, whose integrals over ``theta`` are
closed with Sommerfeld's angle ``psi``, ``1 - eps cos(theta) = (1 - eps^2)/(1 + eps cos(psi))``.

A rotation of the journal with ``omega`` is a whirl of ``-omega/2``.
"""

from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np

from klack.arrays import Matrix
from klack.machine.compiling.jit import inner, njit

__all__ = ["guide_film_damping", "guide_film_force", "guide_film_step"]


@njit
def guide_film_force(
    eccentricity: float, rate: float, whirl: float, ruptured: bool
) -> tuple[float, float]:
    r"""Radial and tangential force on the needle over ``mu L^3 R / c^2`` [1/s].

    .. math:: F_r = -\frac{\mu L^3 R}{c^2}\,[\dot\epsilon\,J_{cc} + \epsilon\dot\gamma\,J_{sc}],
              \qquad
              F_t = -\frac{\mu L^3 R}{c^2}\,[\dot\epsilon\,J_{sc} + \epsilon\dot\gamma\,J_{ss}]

    Parameters
    ----------
    eccentricity [-]
        ``eps = e / c``, from 0 to below 1.
    rate [1/s]
        ``d eps / dt``.
    whirl [1/s]
        ``d gamma / dt`` of the direction of the eccentricity.
    ruptured
        Only the half above ambient pressure acts (Ocvirk's film of 180 degrees).

    Returns
    -------
    radial, tangential : float [1/s]
        Along the eccentricity, and 90 degrees ahead.
    """
    first, last = 0.0, 2.0 * pi
    across = eccentricity * whirl
    if ruptured:
        middle = atan2(across, rate)
        first, last = middle - 0.5 * pi, middle + 0.5 * pi
    cc, sc, ss = _integrals(eccentricity, first, last)
    return -(rate * cc + across * sc), -(rate * sc + across * ss)


@njit
def guide_film_damping(x: float, y: float) -> Matrix:
    """Damping of the whole film over ``mu L^3 R / c^3``, symmetric, above 0; shape (2, 2) [-].

    ``x`` and ``y`` are the place of the needle over the clearance.
    """
    radius = hypot(x, y)
    left = 1.0 - radius * radius
    across = pi / (left * sqrt(left))
    # along: pi (1 + 2 eps^2)/(1 - eps^2)^(5/2), which is 3 pi/(1 - eps^2)^(5/2) more per eps^2
    more = 3.0 * across / left
    C = np.empty((2, 2))
    C[0, 0] = across + more * x * x
    C[1, 1] = across + more * y * y
    C[0, 1] = C[1, 0] = more * x * y
    return C


@njit
def guide_film_step(
    x0: float, y0: float, x1: float, y1: float, step: float
) -> tuple[float, float, Matrix]:
    """Mean force of the whole film over a step, and its slopes with the place at the end.

    With the damping in the middle of the way, which lies within the clearance, work is dissipated
    exactly at every step size.

    Parameters
    ----------
    x0, y0, x1, y1 [-]
        Places over the clearance.
    step [s]

    Returns
    -------
    x, y : float [1/s]
        Force over ``mu L^3 R / c^2``.
    slopes : array (2, 2) [1/s]
    """
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    u, v = (x1 - x0) / step, (y1 - y0) / step
    C = guide_film_damping(x, y)
    left = 1.0 - x * x - y * y
    across = pi / (left * sqrt(left))
    more = 3.0 * across / left
    # d across = more (x dx + y dy), d more = 5 more / left (x dx + y dy)
    along = x * u + y * v
    steep = 5.0 * more / left * along
    slopes = np.empty((2, 2))
    slopes[0, 0] = -C[0, 0] / step - 0.5 * (more * (x * u + along + x * u) + steep * x * x)
    slopes[0, 1] = -C[0, 1] / step - 0.5 * (more * (y * u + x * v) + steep * x * y)
    slopes[1, 0] = -C[1, 0] / step - 0.5 * (more * (x * v + y * u) + steep * x * y)
    slopes[1, 1] = -C[1, 1] / step - 0.5 * (more * (y * v + along + y * v) + steep * y * y)
    return -(C[0, 0] * u + C[0, 1] * v), -(C[1, 0] * u + C[1, 1] * v), slopes


@inner
def _integrals(eps: float, first: float, last: float) -> tuple[float, float, float]:
    """``int (cos^2, sin cos, sin^2)/(1 - eps cos)^3`` from ``first`` to ``last``, up to 3 pi."""
    a, b = _sommerfeld(eps, first), _sommerfeld(eps, last)
    left = 1.0 - eps * eps
    span, sines, cosines = b - a, sin(b) - sin(a), cos(b) - cos(a)
    doubled, squares = 0.5 * (sin(2.0 * b) - sin(2.0 * a)), cos(b) ** 2 - cos(a) ** 2
    cc = (eps * eps * span + 2.0 * eps * sines + 0.5 * (span + doubled)) / (
        left * left * sqrt(left)
    )
    sc = -(eps * cosines + 0.5 * squares) / (left * left)
    ss = 0.5 * (span - doubled) / (left * sqrt(left))
    return cc, sc, ss


@inner
def _sommerfeld(eps: float, theta: float) -> float:
    """Continuous ``psi`` of an angle within one turn and a half of 0."""
    turns = 0.0
    if theta > pi:
        turns, theta = 2.0 * pi, theta - 2.0 * pi
    elif theta < -pi:
        turns, theta = -2.0 * pi, theta + 2.0 * pi
    half = 0.5 * theta
    return turns + 2.0 * atan2(sqrt(1.0 + eps) * sin(half), sqrt(1.0 - eps) * cos(half))
