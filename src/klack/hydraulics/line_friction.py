r"""Friction of unsteady laminar and turbulent flow in a round bore.

The wall shear of an accelerated flow depends on its history (Zielke 1968): with the mean velocity
``V``, the radius ``R`` and ``tau = nu t / R^2``,

.. math:: J = -\frac{dp}{dx} = \frac{8\mu}{R^2} V
              + \frac{4\mu}{R^2}\int_0^t W\bigl(\tau(t - s)\bigr)\,\frac{dV}{ds}\,ds .

For laminar flow ``W`` is ``sum_k exp(-j_k^2 tau)`` over the zeros of the Bessel function ``J_2``.
A sum of exponentials turns the convolution into one state per term.  Lines use Kagawa's ten terms,
which follow ``W`` to 0.3 % down to ``tau`` = 1e-5.  Trikha's three are up to 38 % off and halve the
damping of a short fuel line: they are here to show that.
"""

from dataclasses import dataclass
from functools import cache
from math import pi

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.errors import require_positive

__all__ = [
    "KAGAWA",
    "TRIKHA",
    "ExponentialWeights",
    "laminar_resistance",
    "laminar_weight",
    "unsteady_terms",
    "vardy_brown_weight",
    "zielke_weight",
]


@dataclass(frozen=True, slots=True)
class ExponentialWeights:
    """Weighting function ``W(tau) = sum_k factors_k exp(-rates_k tau)``."""

    factors: tuple[float, ...]
    rates: tuple[float, ...]
    source: str

    def __call__(self, tau: ArrayLike) -> Floats:
        """``W`` at the dimensionless time ``nu t / R^2``."""
        shape = np.asarray(tau, dtype=float)[..., None]
        return np.sum(np.array(self.factors) * np.exp(-np.array(self.rates) * shape), axis=-1)


KAGAWA = ExponentialWeights(
    factors=(1.0, 1.16725, 2.20064, 3.92861, 6.78788, 11.6761, 20.0612, 34.4541, 59.1642, 101.590),
    rates=(
        26.3744,
        72.8033,
        187.424,
        536.626,
        1570.60,
        4618.13,
        13601.1,
        40082.5,
        118153.0,
        348316.0,
    ),
    source="Kagawa, Lee, Kitagawa, Takenaka, Trans. JSME B 49 (1983) 2638",
)

TRIKHA = ExponentialWeights(
    factors=(1.0, 8.1, 40.0),
    rates=(26.4, 200.0, 8000.0),
    source="Trikha, J. Fluids Eng. 97 (1975) 97",
)

_ZIELKE_RATES = (26.3744, 70.8493, 135.0198, 218.9216, 322.5544)
_ZIELKE_POWERS = (0.282095, -1.25, 1.057855, 0.9375, 0.396696, -0.351563)
_ZIELKE_SEAM = 0.02
_SERIES_TERMS = 4000  # exp(-j_k^2 tau) < 1e-16 beyond, for tau > 3e-7
_SERIES_FROM = 3e-7


def laminar_weight(tau: ArrayLike) -> Floats:
    """Exact series of ``W`` for laminar flow at ``tau`` of at least 3e-7."""
    times = np.asarray(tau, dtype=float)
    require_positive(
        "laminar_weight: tau - 3e-7", float(np.min(times, initial=1.0)) - _SERIES_FROM, "-"
    )
    total = np.zeros(times.shape)
    for zero in _bessel_zeros()[::-1]:
        total += np.exp(-(zero**2) * times)
    return total


@cache
def _bessel_zeros() -> tuple[float, ...]:
    return tuple(float(zero) for zero in scipy.special.jn_zeros(2, _SERIES_TERMS))


def zielke_weight(tau: ArrayLike) -> Floats:
    """``W`` of laminar flow by Zielke's two formulas, to 0.05 %.

    J. Basic Eng. 90 (1968) 109: five exponentials above ``tau`` = 0.02, below it a series in powers
    of ``sqrt(tau)`` that starts with ``1 / (2 sqrt(pi tau))``.
    """
    times = np.asarray(tau, dtype=float)
    late = sum(np.exp(-rate * times) for rate in _ZIELKE_RATES)
    early = sum(m * times ** (0.5 * j - 0.5) for j, m in enumerate(_ZIELKE_POWERS))
    return np.where(times > _ZIELKE_SEAM, late, early)


def vardy_brown_weight(tau: ArrayLike, reynolds: float) -> Floats:
    r"""``W`` of turbulent flow in a smooth bore.

    .. math:: W = \frac{e^{-B\tau}}{2\sqrt{\pi\tau}}, \quad B = \frac{Re^k}{12.86}, \quad
              k = \log_{10}\frac{15.29}{Re^{0.0567}}

    with ``Re`` of the mean flow from 2e3 to 1e8 (Vardy & Brown, J. Sound Vib. 259 (2003) 1011).  It
    starts as the laminar one and forgets sooner, since eddies carry the momentum to the wall.
    """
    require_positive("vardy_brown_weight: reynolds", reynolds, "-")
    times = np.asarray(tau, dtype=float)
    B = reynolds ** np.log10(15.29 / reynolds**0.0567) / 12.86
    return np.exp(-B * times) / (2.0 * np.sqrt(pi * times))


def laminar_resistance(length: float, diameter: float, viscosity: float) -> float:
    """Pressure drop per volume flow of steady laminar flow, ``128 mu L / (pi D^4)`` [Pa s/m^3].

    Parameters
    ----------
    length, diameter [m]
    viscosity [Pa s]

    Examples
    --------
    >>> round(laminar_resistance(0.06, 2.5e-3, 0.4e-3) / 1e6, 2)
    25.03
    """
    return 128.0 * viscosity * length / (pi * diameter**4)


def unsteady_terms(
    weights: ExponentialWeights, *, resistance: float, diameter: float, kinematic_viscosity: float
) -> tuple[Floats, Floats]:
    """Gains [Pa s/m^3] and rates [1/s] of a :class:`~klack.network.rows.LineRow` by a weighting.

    Parameters
    ----------
    resistance [Pa s/m^3]
        :func:`laminar_resistance` of the line; a term gains half of it times its factor.
    diameter [m]
    kinematic_viscosity [m^2/s]
    """
    rate = 4.0 * kinematic_viscosity / diameter**2
    return 0.5 * resistance * np.array(weights.factors), rate * np.array(weights.rates)
