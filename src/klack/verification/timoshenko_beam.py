"""Bending frequencies of a free round bar after Euler-Bernoulli and after Timoshenko."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from klack.materials import Material

__all__ = ["free_bar_frequencies"]

_ROOTS = (4.730040744862704, 7.853204624095838, 10.995607838001671)
"""cos x cosh x = 1: three modes."""


def free_bar_frequencies(
    material: Material, radius: float, length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Frequencies of the first three modes after Euler-Bernoulli, and after Timoshenko.

    Frequency equation of the free beam with shear and rotary inertia: Huang 1961.  Shear
    coefficient of the circle: Hutchinson 2001,
    :math:`6 (1 + \nu)^2 / (7 + 12 \nu + 4 \nu^2)`.

    Parameters
    ----------
    material : Material
    radius, length : float [m]
        At least 15 radii long: the search for the roots is not made for shorter bars.

    Returns
    -------
    euler, timoshenko : array, shape (3,) [Hz]
    """
    nu = material.poisson
    shear = 6.0 * (1.0 + nu) ** 2 / (7.0 + 12.0 * nu + 4.0 * nu**2)
    r2 = (radius / (2.0 * length)) ** 2
    s2 = material.young / (shear * material.shear_modulus) * r2
    unit = np.sqrt(material.young / material.density) * radius / (2.0 * length**2) / (2.0 * np.pi)

    def determinant(b: float) -> float:
        root = np.sqrt((r2 - s2) ** 2 + 4.0 / b**2)
        alpha, beta = (b * np.sqrt((root - sign * (r2 + s2)) / 2.0) for sign in (1.0, -1.0))
        slope = b / np.sqrt(1.0 - b**2 * r2 * s2) * (b**2 * r2 * (r2 - s2) ** 2 + 3.0 * r2 - s2)
        # divided by cosh, which is large
        shared = slope * np.tanh(alpha) * np.sin(beta)
        return float(2.0 / np.cosh(alpha) - 2.0 * np.cos(beta) + shared)

    euler = np.array(_ROOTS) ** 2
    timoshenko = [brentq(determinant, 0.75 * x, 1.001 * x, xtol=1e-12) for x in euler]
    return unit * euler, unit * np.array(timoshenko)
