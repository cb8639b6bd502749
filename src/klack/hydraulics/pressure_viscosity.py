r"""Viscosity that rises with pressure, after Barus or Roelands, in the time loop and outside.

Both laws are one formula with three numbers,

.. math:: \ln\frac{\mu(p)}{\mu_0} = B\Bigl[\Bigl(1 + \frac{p - p_0}{c}\Bigr)^{Z} - 1\Bigr],

with the same slope :math:`\alpha = B Z / c` at one atmosphere :math:`p_0`:

=========  ======================  =========  =====================
law        ``B``                   ``c``      ``Z``
=========  ======================  =========  =====================
Barus      ``alpha c``             196.2 MPa  1
Roelands   ``ln(mu_0) + 9.67``     196.2 MPa  ``alpha c / B``
=========  ======================  =========  =====================

``mu_0`` in Pa s.  A laminar gap between two pressures has exactly the flow and the shear of one
mean viscosity (:func:`mean_viscosity_ratio`).

Sources: Barus, Am. J. Sci. 45 (1893) 87; Roelands, thesis, Delft 1966; Hamrock, Schmid and
Jacobson, Fundamentals of Fluid Film Lubrication, 2004, sec. 4.6.
"""

from dataclasses import dataclass
from math import exp, log, log1p

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.errors import refuse_if
from klack.hydraulics.liquid import ATMOSPHERE, HIGHEST_PRESSURE
from klack.machine.compiling.jit import njit

__all__ = ["CONSTANT", "PressureViscosity", "mean_viscosity_ratio"]

_SCALE = 1.962e8  # [Pa] of Roelands' law
_UNIT = 9.67  # [-] -ln(6.31e-5 Pa s), where all his lines meet
_LOWEST = -0.01  # of the scale: no viscosity of a liquid in tension is known
_HIGHEST = HIGHEST_PRESSURE / _SCALE

# Gauss-Legendre with five points on 0 .. 1
_AT = tuple(float(0.5 + 0.5 * x) for x in np.polynomial.legendre.leggauss(5)[0])
_WEIGHT = tuple(float(0.5 * w) for w in np.polynomial.legendre.leggauss(5)[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureViscosity:
    """Rise of the viscosity of a fluid with pressure.

    Parameters
    ----------
    exponent [-]
        ``B``.
    power [-]
        ``Z``; 1 for Barus.

    Examples
    --------
    An oil with 40 mPa s and 18 per GPa at 2000 bar: Barus 37 times, Roelands 21 times as viscous.

    >>> [round(float(law.ratio(2000e5))) for law in (
    ...     PressureViscosity.barus(18e-9), PressureViscosity.roelands(0.04, 18e-9))]
    [37, 21]
    """

    exponent: float
    power: float = 1.0

    @classmethod
    def barus(cls, coefficient: float) -> "PressureViscosity":
        """``mu_0 exp(alpha (p - p_0))`` with the coefficient ``alpha`` [1/Pa]."""
        return cls(exponent=coefficient * _SCALE)

    @classmethod
    def roelands(cls, viscosity: float, coefficient: float) -> "PressureViscosity":
        """Law with a viscosity [Pa s] and its relative slope [1/Pa] at one atmosphere."""
        refuse_if(
            not log(viscosity) + _UNIT > 0.1,
            "PressureViscosity.roelands: viscosity",
            got=f"viscosity_law roelands with {viscosity:g} Pa s",
            expected="more than 0.07 mPa s, where the lines of Roelands intersect",
            hint="check the unit, or take viscosity_law: barus.",
        )
        exponent = log(viscosity) + _UNIT
        power = coefficient * _SCALE / exponent
        refuse_if(
            power > 1.0,
            "PressureViscosity.roelands: coefficient",
            got=f"viscosity_law roelands with {1e9 * coefficient:.3g} per GPa and "
            f"{1e3 * viscosity:.3g} mPa s, an exponent Z of {power:.3g}",
            expected="an exponent Z of at most 1, as of the oils that Roelands measured",
            hint="take viscosity_law: barus; thin and hot fuels are outside this law.",
        )
        return cls(exponent=exponent, power=power)

    @property
    def numbers(self) -> tuple[float, float]:
        """What :func:`mean_viscosity_ratio` takes."""
        return self.exponent, self.power

    def ratio(self, pressure: ArrayLike) -> Floats:
        """Viscosity at the absolute pressure [Pa] over that at one atmosphere."""
        x = (np.asarray(pressure, dtype=float) - ATMOSPHERE) / _SCALE
        rise = np.expm1(self.power * np.log1p(np.clip(x, _LOWEST, _HIGHEST)))
        return np.asarray(np.exp(self.exponent * rise))


CONSTANT = PressureViscosity(exponent=0.0)
"""Viscosity that no pressure changes."""


@njit(error_model="numpy")
def mean_viscosity_ratio(
    p_a: float, p_b: float, exponent: float, power: float
) -> tuple[float, float, float]:
    r"""Mean viscosity of a laminar gap over that at one atmosphere [-], and its slopes [1/Pa].

    .. math:: \bar r = \frac{p_a - p_b}{\int_{p_b}^{p_a} \mu_0/\mu \, dp}

    Hagen-Poiseuille flow is :math:`Q = k (p_a - p_b)/\bar r`, and since :math:`dx \propto dp/\mu`,
    the mean of ``mu`` over the length, which the walls feel, is :math:`\mu_0 \bar r` too.  Five
    points of Gauss: right to 1e-9 where the viscosity of Barus changes by a factor of 6 over the
    gap, to 1e-7 for a factor of 37.

    Parameters
    ----------
    p_a, p_b [Pa]
        Absolute.
    exponent, power [-]
        Of :class:`PressureViscosity`.
    """
    if exponent == 0.0:
        return 1.0, 0.0, 0.0
    fluidity = by_a = by_b = 0.0
    for k in range(5):
        t = _AT[k]
        x = (p_b + t * (p_a - p_b) - ATMOSPHERE) / _SCALE
        inside = _LOWEST < x < _HIGHEST
        if x < _LOWEST:
            x = _LOWEST
        if x > _HIGHEST:
            x = _HIGHEST
        raised = exp(power * log1p(x))
        part = _WEIGHT[k] * exp(-exponent * (raised - 1.0))
        fluidity += part
        if inside:
            fall = part * exponent * power * raised / (_SCALE * (1.0 + x))
            by_a += t * fall
            by_b += (1.0 - t) * fall
    ratio = 1.0 / fluidity
    return ratio, ratio * ratio * by_a, ratio * ratio * by_b
