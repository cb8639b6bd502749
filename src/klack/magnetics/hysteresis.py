r"""Hysteresis of iron: elastic-plastic elements in the flux density beside the mean curve.

The field strength is that of the mean (anhysteretic) curve and of ``n`` stops, each elastic up to a
yield that may fall with the flux density:

.. math::

    H = H_\text{an}(B) + \sum_k s_k, \qquad
    \mathrm ds_k = c\,\mathrm dB \;\text{ within }\; |s_k| \le \rho_k\,w(B), \qquad \sum\rho_k = 1 .

This is the stop model [1], the energy-based hysteresis model [2] with ``B`` as input.  ``w`` is
half the width of the major loop, ``w(0) = H_c``: once all stops have yielded, ``H = H_an + w`` on
the rising branch and ``H_an - w`` on the falling one.  The stored energy density is :math:`\int
H_\text{an}\mathrm dB + \sum s_k^2/2c`, the rest of :math:`H\,\mathrm dB` is heat, never negative.
With equal stiffnesses :math:`c = 2H_c/(nb)` and shares :math:`\rho_k = (2k-1)/n^2` the curve from
the demagnetised state is :math:`H_\text{an} + H_c[1 - (1 - B/b)^2]` up to ``b``, in ``n`` straight
pieces: the Rayleigh law with ``B`` as its argument [3].

Minor loops close exactly at their return points, and loops between equal limits are congruent
where ``w`` is constant.  Tellinen's model [4] has the same major loop, but its minor loops drift,
and it has no stored energy of its own.

[1] Matsuo and Shimasaki, IEEE Trans. Magn. 41 (2005) 1548.  [2] Bergqvist, Physica B 233 (1997)
342; Henrotte, Nicolet and Hameyer, COMPEL 25 (2006) 71.  [3] Bozorth, Ferromagnetism, 1951,
ch. 11.  [4] Tellinen, IEEE Trans. Magn. 34 (1998) 2200.

Limits: static (eddy currents are separate), scalar, no temperature, no accommodation.  Changes
below ``b/n`` of the flux density after a reversal are elastic and lose nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.errors import InputError, refuse_if, require_positive
from klack.magnetics.iron import VACUUM_PERMEABILITY, IronCurve, measured

__all__ = [
    "STOPS_PER_PART",
    "IronStops",
    "LoopWidth",
    "constant_width",
    "falling_width",
    "measured_loop",
    "measured_width",
]


STOPS_PER_PART = 8
"""Stops of a part of iron."""

_INTERVALS = 128
_CROSSED = 0.05  # of the coercivity, by which noise may make the branches of a loop cross
_UNEVEN = 0.01  # of its larger tip: difference accepted between the ends of a measured branch


@dataclass(frozen=True, slots=True, eq=False)
class LoopWidth:
    """Half the width of the major loop over the flux density, and the reversal range.

    Parameters
    ----------
    flux_density (k,) [T]
        From 0, evenly spaced; constant beyond the last point.
    width, slope (k,) [A/m], [m/H]
        ``w`` and ``dw/dB`` there: a cubic between.
    reversal [T]
        ``b``: where the last stop yields from the demagnetised state.
    """

    flux_density: Vector
    width: Vector
    slope: Vector
    reversal: float

    def __post_init__(self) -> None:
        require_positive("hysteresis: reversal range", self.reversal, "T")
        steepest = float(np.max(np.abs(self.slope)))
        most = float(self.width[0]) / steepest if steepest > 0.0 else np.inf
        refuse_if(
            self.reversal > most,
            "hysteresis: initial_permeability",
            got=f"a value with which the loop reverses over {self.reversal:.3g} T",
            expected=f"a reversal within {most:.3g} T, where its width changes little",
            hint="lower initial_permeability, or give a smaller coercivity.",
        )

    @property
    def coercivity(self) -> float:
        """``H_c`` [A/m]."""
        return float(self.width[0])

    def at(self, flux_density: ArrayLike) -> Vector:
        """Return ``w`` [A/m] at ``B`` [T]."""
        x, step = np.abs(np.asarray(flux_density, dtype=float)), float(self.flux_density[1])
        c = self._cubics()
        i = np.minimum(x / step, len(c)).astype(int)
        u = np.where(i < len(c), x / step - i, 1.0)
        a = c[np.minimum(i, len(c) - 1)]
        return np.asarray(a[..., 0] + u * (a[..., 1] + u * (a[..., 2] + u * a[..., 3])))

    def stops(self, length: float, area: float) -> "IronStops":
        """Stops of a part of iron with a length [m] and a cross-section [m^2]."""
        n, H_c = STOPS_PER_PART, self.coercivity
        cubics = length * self._cubics()
        table = np.concatenate(
            ([float(len(cubics)), 1.0 / (area * self.flux_density[1])], cubics.ravel())
        )
        return IronStops(
            stiffness=np.full(n, 2.0 * H_c * length / (n * self.reversal * area)),
            share=(2.0 * np.arange(1, n + 1) - 1.0) / n**2,
            width=np.append(table, cubics[-1].sum()),
        )

    def _cubics(self) -> Vector:
        """Factors of 1, u, u^2, u^3 in each interval, ``u`` from 0 to 1."""
        d = float(self.flux_density[1])
        y, m = self.width, d * self.slope
        rise = np.diff(y)
        return np.column_stack(
            (y[:-1], m[:-1], 3 * rise - 2 * m[:-1] - m[1:], m[:-1] + m[1:] - 2 * rise)
        )


@dataclass(frozen=True, slots=True, eq=False)
class IronStops:
    """Stops of one part of iron over its flux.

    Parameters
    ----------
    stiffness (n,) [A/Wb]
    share (n,) [-]
        Yield of each stop, over that of all.
    width
        Yield of all stops [A] over the size of the flux, for a compiled loop: ``[m, 1 / step]``,
        four factors for each of ``m`` intervals, and the value beyond the last.
    """

    stiffness: Vector
    share: Vector
    width: Vector


def constant_width(curve: IronCurve, coercivity: float, initial_permeability: float) -> LoopWidth:
    """Loop of the same width everywhere: the mean ``curve`` moved by ``H_c`` to both sides.

    Parameters
    ----------
    coercivity [A/m]
        ``H_c``.
    initial_permeability [-]
        Relative, of the demagnetised iron for small changes, below that of the curve.
    """
    require_positive("hysteresis: coercivity", coercivity, "A/m")
    end = float(curve.flux_density[-1])
    grid = np.array([0.0, end])
    reversal = _reversal(curve, coercivity, initial_permeability)
    return LoopWidth(grid, np.full(2, coercivity), np.zeros(2), reversal)


def falling_width(
    curve: IronCurve, coercivity: float, remanence: float, initial_permeability: float
) -> LoopWidth:
    r"""Loop through coercivity and remanence, closing towards saturation.

    .. math:: w = H_c\,e^{-(B/b_w)^2}, \qquad w(B_r) = H_\text{an}(B_r)

    Parameters
    ----------
    coercivity, initial_permeability
        As in :func:`constant_width`.
    remanence [T]
        ``B_r`` of the major loop.
    """
    require_positive("hysteresis: coercivity", coercivity, "A/m")
    require_positive("hysteresis: remanence", remanence, "T")
    most, field = curve.flux_density_at(coercivity), float(curve.field(remanence))
    refuse_if(
        not field < coercivity,
        "hysteresis: remanence",
        got=f"{remanence:g} T, where the mean curve needs {field:.4g} A/m",
        expected=f"less than {most:.4g} T, where it needs the coercivity of {coercivity:g} A/m",
        hint="a loop symmetric about this curve cannot retain more: lower the remanence, or "
        "give a steeper mean curve (not the initial curve).",
    )
    scale = remanence / np.sqrt(np.log(coercivity / field))

    def law(B: Vector) -> tuple[Vector, Vector]:
        w = coercivity * np.exp(-((B / scale) ** 2))
        return w, -2.0 * B / scale**2 * w

    grid = np.linspace(0.0, max(float(curve.flux_density[-1]), remanence), _INTERVALS + 1)
    width = LoopWidth(grid, *law(grid), _reversal(curve, coercivity, initial_permeability))
    _require_rising(curve, law, grid, remanence)
    return width


def measured_loop(flux_density: ArrayLike, field_strength: ArrayLike) -> IronCurve:
    """Mean curve of a major loop from its measured falling branch, tip to tip.

    Parameters
    ----------
    flux_density [T]
        From the positive tip to the negative one, or back.
    field_strength [A/m]
        There, on the branch of falling flux density.

    Raises
    ------
    InputError
        If the branch does not fall, belongs to no loop about the origin, or is the rising one.
    """
    branch, tip = _branch(flux_density, field_strength)
    B = np.linspace(0.0, tip, _INTERVALS + 1)
    return measured(B[1:], 0.5 * (branch(B) - branch(-B))[1:])


def measured_width(
    flux_density: ArrayLike, field_strength: ArrayLike, initial_permeability: float
) -> LoopWidth:
    """Half width of such a loop; arguments as in :func:`measured_loop`."""
    branch, tip = _branch(flux_density, field_strength)
    curve = measured_loop(flux_density, field_strength)
    B = np.linspace(0.0, tip, _INTERVALS + 1)
    width = np.maximum(-0.5 * (branch(B) + branch(-B)), 0.0)
    width[-1] = 0.0
    even = scipy.interpolate.PchipInterpolator(
        np.append(-B[:0:-1], B), np.append(width[:0:-1], width)
    )
    return LoopWidth(B, width, even(B, 1), _reversal(curve, width[0], initial_permeability))


def _branch(
    flux_density: ArrayLike, field_strength: ArrayLike
) -> "tuple[scipy.interpolate.PPoly, float]":
    """Falling branch ``H(B)``, symmetric at its tips, and the flux density of the tip."""
    B, H = (np.array(v, dtype=float).ravel() for v in (flux_density, field_strength))
    where = "hysteresis loop"
    refuse_if(
        B.size != H.size or B.size < 5,
        where,
        got=f"{B.size} flux densities and {H.size} field strengths",
        expected="an equal number of both, at least 5",
        hint="give the falling branch from the positive tip of the loop to the negative one.",
    )
    if B[0] > B[-1]:
        B, H = B[::-1], H[::-1]
    refuse_if(
        not (np.all(np.diff(B) > 0.0) and np.all(np.diff(H) > 0.0)),
        where,
        got="a branch on which flux density and field strength do not both fall",
        expected="points of one branch, in order, each below the previous one",
        hint="use only one branch; smooth its noise and remove repeated points.",
    )
    uneven = max(abs(B[0] + B[-1]) / B[-1], abs(H[0] + H[-1]) / H[-1]) if B[-1] > 0 else np.inf
    refuse_if(
        uneven > _UNEVEN,
        where,
        got=f"tips at ({B[-1]:g} T, {H[-1]:g} A/m) and ({B[0]:g} T, {H[0]:g} A/m)",
        expected="opposite tips, within 1 %",
        hint="remove the offset of the integrator, and give the branch from tip to tip.",
    )
    tip, field = 0.5 * (B[-1] - B[0]), 0.5 * (H[-1] - H[0])
    B = B - 0.5 * (B[0] + B[-1])
    H[0], H[-1] = -field, field
    branch: scipy.interpolate.PPoly = scipy.interpolate.PchipInterpolator(B, H)
    inner = np.linspace(0.0, tip, 8 * _INTERVALS + 1)[:-1]
    least = float(np.min(-(branch(inner) + branch(-inner))))
    refuse_if(
        not least > 2.0 * _CROSSED * float(branch(0.0)),
        where,
        got=f"a field strength of {float(branch(0.0)):.4g} A/m at 0 T",
        expected="the falling branch: the flux density is zero at minus the coercivity",
        hint="give the branch through (0 A/m, +B_r); mirror a rising branch about the origin.",
    )
    return branch, tip


def _reversal(curve: IronCurve, coercivity: float, initial_permeability: float) -> float:
    """``b`` [T], so that the slope at the origin is that of the initial permeability."""
    steep = float(curve.field_slope(0.0))
    most = 1.0 / (VACUUM_PERMEABILITY * steep)
    refuse_if(
        not 1.0 < initial_permeability < most,
        "hysteresis: initial_permeability",
        got=f"{initial_permeability:g}",
        expected=f"above 1 and below {most:.6g}, the value of the mean curve at the origin",
        hint="demagnetised soft magnetic iron has 100 to 1000."
        if most > 100.0
        else "the curve of this material begins flatter than iron: give your own curve, the "
        "mean of both branches of its loop.",
    )
    return 2.0 * coercivity / (1.0 / (VACUUM_PERMEABILITY * initial_permeability) - steep)


def _require_rising(
    curve: IronCurve,
    law: Callable[[Vector], tuple[Vector, Vector]],
    grid: Vector,
    remanence: float,
) -> None:
    """Reject a loop on whose branches the field strength falls as the flux density rises."""
    fine = np.linspace(0.0, float(grid[-1]), 10 * grid.size)
    least = curve.field_slope(fine) - np.abs(law(fine)[1])
    if np.min(least) <= 0.0:
        at = float(fine[np.argmin(least)])
        raise InputError(
            "hysteresis: remanence",
            got=f"{remanence:g} T, with which H falls as B rises near {at:.3g} T on a branch",
            expected="a loop on which H rises with B everywhere",
            hint="increase the remanence, or leave it out for a loop of constant width.",
        )
