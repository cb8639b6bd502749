"""Soft magnetic iron: field strength over flux density, ``H(B)``, without hysteresis.

With the flux as unknown a circuit needs ``H`` *of* ``B``: points with slopes, a cubic between them
(C1), odd in ``B``, straight beyond the last point.  Energy density and co-energy follow exactly.

====================== ========================================================================= ===
law                    equation                                                                  ref
====================== ========================================================================= ===
:func:`froehlich`      ``B = mu0 H + H/(a + b H)``, ``1/a = mu0 (mu_r - 1)``, ``1/b = B_s``      [1]
:func:`tanh_curve`     ``B = mu0 H + B_s tanh(mu0 (mu_r - 1) H / B_s)``                          [1]
:func:`brauer`         ``H = (k1 exp(k2 B^2) + k3) B``                                           [2]
:func:`rational_curve` ``H = B/(mu0 mu_r)``, ``mu_r = 1 + (mu_i - 1 + c_a b)/(1 + c_b b + b^n)`` [3]
:func:`measured`       monotone cubic through points                                             [4]
====================== ========================================================================= ===

[1] Bozorth, Ferromagnetism, 1951, ch. 11. [2] Brauer, IEEE Trans. Magn. 11 (1975) 81.
[3] Roschke 2000, as used in the FluxTubes package of the Modelica Standard Library.
[4] Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980) 238.

Limits: no hysteresis, no anisotropy, no temperature.  Far above any use, where ``dB/dH < mu0``, the
vacuum takes over.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.errors import refuse_if, require_positive
from klack.magnetics.reluctance import IronReluctance
from klack.magnetics.tabulation import hermite_grid

__all__ = [
    "VACUUM_PERMEABILITY",
    "IronCurve",
    "brauer",
    "froehlich",
    "measured",
    "rational_curve",
    "tanh_curve",
]

VACUUM_PERMEABILITY = 4e-7 * np.pi
"""mu0 [H/m]; the measured value of 2019 differs by 1e-10."""

_MU0 = VACUUM_PERMEABILITY
_HIGHEST = 4.0  # [T]
_TOLERANCE = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class IronCurve:
    """Magnetisation curve ``H(B)``.

    Parameters
    ----------
    flux_density (k,) [T]
        Increasing from 0.
    field_strength, slope (k,) [A/m], [m/H]
        ``H`` and ``dH/dB`` there.
    """

    flux_density: Vector
    field_strength: Vector
    slope: Vector

    def law(self, length: float, area: float) -> IronReluctance:
        """Reluctance law of a part of this iron with a length [m] and a cross-section [m^2]."""
        require_positive("iron part: length", length, "m")
        require_positive("iron part: area", area, "m^2")
        return IronReluctance(
            self.flux_density * area, self.field_strength * length, self.slope * (length / area)
        )

    def field(self, flux_density: ArrayLike) -> Vector:
        """Return ``H`` [A/m] at ``B`` [T]."""
        return self.law(1.0, 1.0).mmf(flux_density, 0.0)

    def field_slope(self, flux_density: ArrayLike) -> Vector:
        """Return ``dH/dB`` [m/H] at ``B`` [T]."""
        return self.law(1.0, 1.0).slope(flux_density, 0.0)

    def energy_density(self, flux_density: ArrayLike) -> Vector:
        r"""Return :math:`\int_0^B H\,\mathrm dB` [J/m^3]."""
        return self.law(1.0, 1.0).energy(flux_density, 0.0)

    def flux_density_at(self, field: float) -> float:
        """Return ``B`` [T] at ``H`` [A/m]."""
        law, most = self.law(1.0, 1.0), _HIGHEST + 2.0 * _MU0 * abs(field)
        if field == 0.0:
            return 0.0
        root = scipy.optimize.brentq(
            lambda b: float(law.mmf(b, 0.0)) - abs(field), 0.0, most, xtol=1e-15
        )
        return float(np.copysign(root, field))


def froehlich(saturation: float, permeability: float) -> IronCurve:
    """Curve with a smooth knee, from two numbers of a data sheet.

    Parameters
    ----------
    saturation [T]
        Polarisation ``B_s``.
    permeability [-]
        Initial, relative, above 1.

    Examples
    --------
    >>> iron = froehlich(2.15, 5000.0)
    >>> round(float(iron.field(1.0)), 1)
    297.4
    """
    _check_saturation("froehlich", saturation, permeability)
    a, b = 1.0 / (_MU0 * (permeability - 1.0)), 1.0 / saturation

    def curve(B: Vector) -> tuple[Vector, Vector]:
        p = _MU0 * a + 1.0 - b * B
        root = np.sqrt(p * p + 4.0 * _MU0 * a * b * B)
        # the larger root of mu0 b H^2 + p H - a B = 0, without cancellation on either side
        H = np.where(p > 0, 2.0 * a * B / (p + root), (root - p) / (2.0 * _MU0 * b))
        return H, 1.0 / (_MU0 + a / (a + b * H) ** 2)

    return _tabulate(curve)


def tanh_curve(saturation: float, permeability: float) -> IronCurve:
    """Curve with a sharp knee: saturated within twice the field that would reach ``B_s``.

    Parameters
    ----------
    saturation [T]
    permeability [-]
        Initial, relative, above 1.
    """
    _check_saturation("tanh_curve", saturation, permeability)
    rise = _MU0 * (permeability - 1.0) / saturation

    def induction(H: Vector) -> tuple[Vector, Vector]:
        t = np.tanh(rise * H)
        return _MU0 * H + saturation * t, _MU0 + saturation * rise * (1.0 - t * t)

    def curve(B: Vector) -> tuple[Vector, Vector]:
        # B(H) is concave: Newton from below the root in H climbs to it without overshoot
        H = np.maximum(B / (_MU0 * permeability), (B - saturation) / _MU0)
        for _ in range(200):
            value, slope = induction(H)
            step = (B - value) / slope
            H = H + step
            if np.all(np.abs(step) <= 1e-15 * np.abs(H)):
                break
        return H, 1.0 / induction(H)[1]

    return _tabulate(curve)


def brauer(k1: float, k2: float, k3: float) -> IronCurve:
    """Exponential curve, the usual fit when the flux is the unknown.

    Parameters
    ----------
    k1, k3 [m/H]
        ``k1 + k3`` is the initial slope ``dH/dB``.
    k2 [1/T^2]
    """
    for name, value in (("k1", k1), ("k2", k2)):
        require_positive(f"brauer: {name}", value, "m/H" if name == "k1" else "1/T^2")
    refuse_if(
        not 0.0 < k1 + k3 < 1.0 / _MU0,
        "brauer: k1 + k3",
        got=f"{k1 + k3:g} m/H",
        expected=f"a value between 0 and 1/mu0 = {1.0 / _MU0:.6g} m/H",
        hint="k1 + k3 is the initial slope 1/(mu0 mu_r); check the units (SI).",
    )

    def curve(B: Vector) -> tuple[Vector, Vector]:
        E = k1 * np.exp(np.minimum(k2 * B * B, 200.0))
        return (E + k3) * B, E * (1.0 + 2.0 * k2 * B * B) + k3

    return _tabulate(curve)


def rational_curve(
    *, initial: float, peak_density: float, rise: float, width: float, exponent: float
) -> IronCurve:
    r"""Curve with a maximum of the permeability, as real iron has it.

    .. math:: \mu_r = 1 + \frac{\mu_i - 1 + c_a b}{1 + c_b b + b^n}, \qquad b = B/B_\mu

    Parameters
    ----------
    initial, rise, width, exponent [-]
        ``mu_i``, ``c_a``, ``c_b``, ``n``.
    peak_density [T]
        ``B_mu``: where the permeability is highest.
    """
    # an initial permeability below the one at 1 % of the peak would make H jump at B = 0
    least = 1.0 + 0.01 * rise / (1.0 + 0.01 * width)
    start = max(initial, min(least, 10.0)) if initial < 1.0 else initial

    def curve(B: Vector) -> tuple[Vector, Vector]:
        b = B / peak_density
        top, bottom = start - 1.0 + rise * b, 1.0 + width * b + b**exponent
        mu = 1.0 + top / bottom
        dmu = (rise * bottom - top * (width + exponent * b ** (exponent - 1.0))) / bottom**2
        return B / (_MU0 * mu), (1.0 - b * dmu / mu) / (_MU0 * mu)

    return _tabulate(curve)


def measured(flux_density: ArrayLike, field_strength: ArrayLike) -> IronCurve:
    """Curve through measured points; beyond the last one the iron saturates within 0.1 T.

    Parameters
    ----------
    flux_density [T]
        Increasing; the origin is added where it is missing.
    field_strength [A/m]
        Increasing with it.
    """
    B, H = (np.array(v, dtype=float).ravel() for v in (flux_density, field_strength))
    refuse_if(
        B.size != H.size or B.size == 0,
        "measured magnetisation curve",
        got=f"{B.size} flux densities and {H.size} field strengths",
        expected="an equal number of both, at least one",
        hint="give one field strength per flux density.",
    )
    if B[0] != 0.0:
        B, H = np.concatenate(([0.0], B)), np.concatenate(([0.0], H))
    rising = np.all(np.diff(B) > 0.0) and np.all(np.diff(H) > 0.0)
    refuse_if(
        B.size < 2 or H[0] != 0.0 or not rising,
        "measured magnetisation curve",
        got=f"points from ({B[0]:g} T, {H[0]:g} A/m) to ({B[-1]:g} T, {H[-1]:g} A/m)",
        expected="flux density and field strength, both increasing from (0, 0)",
        hint="use the initial magnetisation curve, sorted; remove repeated points.",
    )
    slope = (
        scipy.interpolate.PchipInterpolator(B, H)(B, 1) if B.size > 2 else np.full(2, H[1] / B[1])
    )
    secant = np.diff(H) / np.diff(B)
    slope[-1] = min(max(slope[-1], secant[-1]), 1.0 / _MU0)
    slope = np.where(slope > 0.0, slope, np.append(secant, secant[-1]))
    beyond = 0.1  # slope rises linearly to 1/mu0: one cubic (in fact a parabola) more
    B = np.append(B, B[-1] + beyond)
    H = np.append(H, H[-1] + 0.5 * beyond * (slope[-1] + 1.0 / _MU0))
    return IronCurve(B, H, np.append(slope, 1.0 / _MU0))


def _tabulate(curve: Callable[[Vector], tuple[Vector, Vector]]) -> IronCurve:
    """Points up to where the slope is that of the vacuum."""

    def excess(B: float) -> float:
        return float(curve(np.array([B]))[1][0]) * _MU0 - 1.0

    end = _HIGHEST
    coarse = np.linspace(0.0, _HIGHEST, 401)[1:]
    above = np.flatnonzero(curve(coarse)[1] * _MU0 >= 1.0)
    if above.size:
        high = float(coarse[above[0]])
        low = max(high - 0.01, 1e-12)
        end = float(scipy.optimize.brentq(excess, low, high)) if excess(low) < 0.0 else high
    B = hermite_grid(curve, 0.0, end, tolerance=_TOLERANCE)
    H, slope = curve(B)
    H[0] = 0.0
    return IronCurve(B, H, slope)


def _check_saturation(where: str, saturation: float, permeability: float) -> None:
    require_positive(f"{where}: saturation", saturation, "T")
    refuse_if(
        not permeability > 1.0,
        f"{where}: permeability",
        got=f"{permeability:g}",
        expected="a relative permeability above 1",
        hint="soft magnetic iron has several hundred to several thousand.",
    )
