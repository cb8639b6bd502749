r"""A solenoid known by a table only: linkage ``psi(i, x)``, as finite elements or a bench give it.

Everything follows from the stored energy :math:`W(\psi, x)`,

.. math:: i = \frac{\partial W}{\partial \psi}, \qquad F = -\frac{\partial W}{\partial x} ,

so a given force is only compared (:class:`ForceComparison`): two contradicting tables would create
energy.  Per gap of the table, ``psi(i)`` is a monotone cubic; its inverse ``i(psi)`` is tabulated
on common linkages, integrated exactly, and joined over the gap by cubic splines into one bicubic
surface, C1: current and force are continuous.  The current rises with the linkage,
:math:`\partial^2 W/\partial\psi^2 > 0`, so a voltage leads to one current only; a table whose
splines fall between two gaps is rejected.

Limits: no eddy currents (add them as a resistance, or describe the circuit); beyond the table
the surface continues linearly in each direction, in ``psi`` with the last differential inductance.
"""

import warnings
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.errors import AccuracyWarning, InputError, refuse_if
from klack.units import format_si

__all__ = ["FluxMap", "ForceComparison"]


_LINKAGES = 129
_ACCEPTED = 0.05  # largest disagreement of a given force, of its peak
_SHARE = 0.34  # a little above a third, where the curvature ends
_PLACES = 33  # looked at between two gaps


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceComparison:
    r"""Difference of a given force from that of the linkage, by virtual work.

    Force and linkage are slopes of one co-energy, so at constant current

    .. math:: \frac{\partial F}{\partial i} = \frac{\partial \psi}{\partial x}, \qquad
              F(i, x) = \int_0^i \frac{\partial \psi}{\partial x}\,\mathrm di .

    Parameters
    ----------
    current, gap [A], [m]
        Point of the largest difference of the forces.
    given, derived [N]
        Both forces there.
    share [-]
        Their difference over the largest given force.
    ratio [-]
        Given over derived force on the whole (least squares).
    step [A], [A], [m]
        Two neighbouring currents and the gap where ``dF`` and ``(dpsi/dx) di`` differ most: there
        the contradiction arises.
    """

    current: float
    gap: float
    given: float
    derived: float
    share: float
    ratio: float
    step: tuple[float, float, float]

    def advice(self) -> str:
        """Likely reason."""
        if self.ratio < 0.0:
            return "the sign of the force is reversed; from a file: force_closing: positive."
        for factor, words in ((2.0, "2"), (4.0, "4"), (0.5, "0.5")):
            if abs(self.ratio * factor - 1.0) < _ACCEPTED:
                return (
                    f"overall it is {self.ratio:.3g} times as large: is the force that of half a "
                    f"model? From a file: force_factor: {words}."
                )
        return (
            "more gaps and currents in the table, and force and linkage from the same computation."
        )


@dataclass(frozen=True, slots=True, eq=False)
class FluxMap:
    """Stored energy over linkage and gap on a rectangular grid.

    Parameters
    ----------
    linkage (m,) [Wb]
        Evenly spaced from 0.
    gap (n,) [m]
        Increasing.
    energy, current, slope, mixed (m, n)
        ``W`` [J], ``dW/dpsi`` [A], ``dW/dx`` [N] and ``d2W/dpsi dx`` [A/m] on the grid.
    """

    linkage: Vector
    gap: Vector
    energy: Vector
    current: Vector
    slope: Vector
    mixed: Vector

    @classmethod
    def of(
        cls, *, current: ArrayLike, gap: ArrayLike, linkage: ArrayLike, force: ArrayLike | None
    ) -> "FluxMap":
        """Build the map from a table.

        Parameters
        ----------
        current (k,) [A]
            Increasing from 0 or above; no linkage is assumed at 0.
        gap (n,) [m]
            Increasing.
        linkage (k, n) [Wb]
            Increasing with the current.
        force (k, n) [N]
            Negative where it closes the gap; a deviation above 5 % of its peak is warned of.

        Raises
        ------
        InputError
            If the table is not increasing, or so rough over the gap that the current would fall
            with rising linkage between two of its gaps.
        """
        i, x, psi = _checked(current, gap, linkage)
        common = np.linspace(0.0, float(psi.max()), _LINKAGES)
        columns = [_column(i, psi[:, j], common) for j in range(x.size)]
        energy = np.column_stack([column[0] for column in columns])
        through = np.column_stack([column[1] for column in columns])
        made = cls(
            common,
            x,
            energy,
            through,
            scipy.interpolate.CubicSpline(x, energy, axis=1)(x, 1),
            scipy.interpolate.CubicSpline(x, through, axis=1)(x, 1),
        )
        made._require_rising()
        if force is not None:
            given = np.array(force, dtype=float)
            rest = np.zeros((i.size - len(given), x.size))  # without current, added above
            made._require_force(i, psi, np.vstack((rest, given)))
        return made

    def energy_at(self, linkage: float, gap: float) -> float:
        """Return ``W`` [J]."""
        return self._evaluate(linkage, gap)[0]

    def current_at(self, linkage: float, gap: float) -> float:
        """Return ``i`` [A]; odd in the linkage."""
        return float(np.copysign(1.0, linkage)) * self._evaluate(linkage, gap)[1]

    def force_at(self, linkage: float, gap: float) -> float:
        """Force along the gap [N]; negative closes it."""
        return -self._evaluate(linkage, gap)[2]

    def table(self) -> Vector:
        """Flat numbers for a compiled loop.

        ``[m, n, step of psi]``, the ``n`` gaps, then for each cell ``(k, j)``, ``k`` slowest, 16
        numbers ``c[a, b]``, ``b`` fastest: ``W = sum c[a, b] u^a v^b`` with linkage ``u`` and gap
        ``v`` from 0 to 1 within the cell.
        """
        step = float(self.linkage[1])
        head = np.array([float(self.linkage.size), float(self.gap.size), step])
        cells = [
            self._cell(k, j).ravel()
            for k in range(self.linkage.size - 1)
            for j in range(self.gap.size - 1)
        ]
        return np.concatenate((head, self.gap, *cells))

    def _cell(self, k: int, j: int) -> Vector:
        h, d = float(self.linkage[1]), float(self.gap[j + 1] - self.gap[j])
        part = np.s_[k : k + 2, j : j + 2]
        corner = np.block(
            [
                [self.energy[part], d * self.slope[part]],
                [h * self.current[part], h * d * self.mixed[part]],
            ]
        )
        cell: Vector = _HERMITE @ corner @ _HERMITE.T
        return cell

    def _evaluate(self, linkage: float, gap: float) -> tuple[float, float, float]:
        """``W`` and its two derivatives; straight on beyond the grid."""
        size, h = abs(linkage), float(self.linkage[1])
        inside = np.clip((size, gap), (0.0, self.gap[0]), (self.linkage[-1], self.gap[-1]))
        k = min(int(inside[0] / h), self.linkage.size - 2)
        j = int(np.clip(np.searchsorted(self.gap, inside[1], "right") - 1, 0, self.gap.size - 2))
        d = float(self.gap[j + 1] - self.gap[j])
        u, v = (inside[0] - self.linkage[k]) / h, (inside[1] - self.gap[j]) / d
        c = self._cell(k, j)
        U = np.array([[1.0, u, u * u, u**3], [0.0, 1.0, 2 * u, 3 * u * u], [0.0, 0.0, 2.0, 6 * u]])
        V = np.array([[1.0, v, v * v, v**3], [0.0, 1.0, 2 * v, 3 * v * v]])
        W = U @ c @ V.T / np.outer([1.0, h, h * h], [1.0, d])
        p, q = size - inside[0], gap - inside[1]
        energy = W[0, 0] + q * W[0, 1] + p * (W[1, 0] + q * W[1, 1]) + 0.5 * p * p * W[2, 0]
        current = W[1, 0] + q * W[1, 1] + p * W[2, 0]
        slope = W[0, 1] + p * W[1, 1]
        if p > 0.0:
            slope += 0.5 * p * p * W[2, 1]
            energy += 0.5 * p * p * q * W[2, 1]
            current += p * q * W[2, 1]
        return float(energy), float(current), float(slope)

    def _require_rising(self) -> None:
        """Reject a surface on which the current falls as the linkage rises."""
        values = _bending(self.energy, self.linkage[1] * self.current)
        slopes = _bending(self.slope, self.linkage[1] * self.mixed)
        wide = np.diff(self.gap)
        corners = np.stack(
            [values[..., :-1], values[..., 1:], wide * slopes[..., :-1], wide * slopes[..., 1:]],
            axis=-1,
        )
        v = np.linspace(0.0, 1.0, _PLACES)[:, None] ** np.arange(4.0)
        least = np.min(corners @ _HERMITE.T @ v.T, axis=(0, 3))
        if np.min(least) <= 0.0:
            k, j = np.unravel_index(int(np.argmin(least)), least.shape)
            gaps = " and ".join(format_si(gap, "m") for gap in self.gap[j : j + 2])
            raise InputError(
                "FluxMap",
                got=f"a table that changes too abruptly between the gaps {gaps}: the current "
                f"falls as the linkage rises, near {format_si(self.linkage[k], 'Wb', 3)}",
                expected="linkages that change smoothly with the gap",
                hint="add gaps or currents to the table there, or smooth its noise.",
            )

    def compare_force(
        self, current: ArrayLike, linkage: ArrayLike, force: ArrayLike
    ) -> ForceComparison:
        """Compare a force table (k, n) with the map of a linkage table, by virtual work.

        ``current`` are the ``k`` currents; gaps are those of the map.
        """
        i, psi, given = (np.array(v, dtype=float) for v in (current, linkage, force))
        derived = np.array(
            [[self.force_at(p, g) for p, g in zip(row, self.gap, strict=True)] for row in psi]
        )
        apart = np.abs(derived - given)
        peak = float(np.max(np.abs(given))) or 1.0
        k, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
        changes = np.abs(np.diff(derived - given, axis=0))
        s, g = np.unravel_index(int(np.argmax(changes)), changes.shape)
        return ForceComparison(
            current=float(i[k]),
            gap=float(self.gap[j]),
            given=float(given[k, j]),
            derived=float(derived[k, j]),
            share=float(apart[k, j]) / peak,
            ratio=float(np.sum(given * derived) / (np.sum(derived**2) or 1.0)),
            step=(float(i[s]), float(i[s + 1]), float(self.gap[g])),
        )

    def _require_force(self, i: Vector, psi: Vector, force: Vector) -> None:
        found = self.compare_force(i, psi, force)
        if found.share > _ACCEPTED:
            low, high, gap = found.step
            warnings.warn(
                f"force map: the given force is {found.given:.4g} N at {found.current:.4g} A and "
                f"a gap of {format_si(found.gap, 'm')}, but the linkage gives "
                f"{found.derived:.4g} N there: {100.0 * found.share:.3g} % of the largest force. "
                f"dF/di and dpsi/dx differ most between {low:.4g} A and {high:.4g} A at "
                f"{format_si(gap, 'm')}. The linkage is used, because only it conserves energy. "
                "Try: " + found.advice(),
                AccuracyWarning,
                stacklevel=3,
            )


_HERMITE = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [-3.0, 3.0, -2.0, -1.0], [2.0, -2.0, 1.0, 1.0]]
)
"""Coefficients of a cubic from values and slopes at 0 and 1."""


def _bending(W: Vector, i: Vector) -> Vector:
    """Second derivative by the linkage at both ends of all cells, shape (2, m - 1, n).

    ``W`` and ``i`` are values and slopes at the linkages, in lengths of a cell.
    """
    rise = 6.0 * np.diff(W, axis=0)
    return np.stack([rise - 4.0 * i[:-1] - 2.0 * i[1:], 4.0 * i[1:] + 2.0 * i[:-1] - rise])


def _checked(
    current: ArrayLike, gap: ArrayLike, linkage: ArrayLike
) -> tuple[Vector, Vector, Vector]:
    i, x = (np.array(v, dtype=float).ravel() for v in (current, gap))
    psi = np.array(linkage, dtype=float)
    refuse_if(
        psi.shape != (i.size, x.size) or i.size < 2 or x.size < 3,
        "FluxMap",
        got=f"{i.size} currents, {x.size} gaps, linkages of shape {psi.shape}",
        expected="a linkage for each of at least 2 currents (rows) and 3 gaps (columns)",
        hint="one row of linkages per current.",
    )
    rising = np.all(np.diff(i) > 0) and np.all(np.diff(x) > 0) and np.all(np.diff(psi, axis=0) > 0)
    refuse_if(
        not rising or i[0] < 0.0 or (i[0] == 0.0 and np.any(psi[0] != 0.0)) or np.any(psi[0] < 0),
        "FluxMap",
        got="a table that is not increasing",
        expected="currents from 0 or above, gaps, and linkages (over the current) that increase"
        ", no linkage at 0 A",
        hint="sort the table; remove remanence.",
    )
    if i[0] > 0.0:
        i, psi = np.concatenate(([0.0], i)), np.vstack((np.zeros(x.size), psi))
    return i, x, psi


def _column(i: Vector, psi: Vector, common: Vector) -> tuple[Vector, Vector]:
    curve: scipy.interpolate.PPoly = scipy.interpolate.PchipInterpolator(psi, i)
    slope = float(curve(psi[-1], 1)) or float((i[-1] - i[-2]) / (psi[-1] - psi[-2]))
    inside = np.minimum(common, psi[-1])
    beyond = common - inside
    work = curve.antiderivative()
    at_end = float(curve(psi[-1]))
    energy = work(inside) + beyond * (at_end + 0.5 * slope * beyond)
    current = np.asarray(curve(inside) + slope * beyond)
    return _convex(np.asarray(energy), current, float(common[1])), current


def _convex(energy: Vector, current: Vector, step: float) -> Vector:
    """Energies between which a cubic with the slopes ``current`` bends upwards everywhere.

    A current like ``psi^p`` with ``p > 2`` within one cell would not: the energy of a cell above a
    straight line must be one to two thirds of what the rise of the current would give.
    """
    rise = step * np.diff(current)
    least, most = _SHARE * rise, (1.0 - _SHARE) * rise
    above = np.diff(energy) - step * current[:-1]
    return np.concatenate(([0.0], np.cumsum(step * current[:-1] + np.clip(above, least, most))))
