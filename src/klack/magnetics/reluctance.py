r"""Reluctance laws: magnetomotive force over flux for the parts of a magnetic circuit.

Three laws are enough for an actuator,

.. math::

    \Theta = R\,\varphi \;\text{(linear)}, \qquad
    \Theta = R(x)\,\varphi \;\text{(air gap)}, \qquad
    \Theta = l\,H(\varphi / A) \;\text{(iron)} ,

with the exact potential :math:`W = \int_0^\varphi \Theta\,\mathrm d\varphi` and one working gap
``x`` for the whole circuit.

A compiled loop reads the same laws as flat numbers (:meth:`~GapReluctance.table`):

========  ==========================================================================================
linear    ``[R]``
gap       ``[n]`` and six numbers for each of ``n`` intervals over ``x``: start ``x_i``, ``R``
          there, the factors of ``s``, ``s^2``, ``s^3`` (``s = x - x_i``), and ``int R dx`` from
          ``x_0``.  The first interval reaches down without end, the last one up.
iron      ``[n]`` and six numbers for each of ``n`` intervals over ``|flux|``: start, mmf there,
          factors of ``s``, ``s^2``, ``s^3``, and the energy ``W`` there.  The first start is 0, the
          last interval has no end (slope of the vacuum); the law is odd, its energy even.
========  ==========================================================================================
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Ints, Vector
from klack.errors import InputError, refuse_if, require_nonnegative

__all__ = ["GapReluctance", "IronReluctance", "LinearReluctance", "ReluctanceLaw"]


_ROUND_OFF = 32.0 * float(np.finfo(float).eps)  # of the values of a cubic: what differences leave


@dataclass(frozen=True, slots=True)
class LinearReluctance:
    r"""Constant reluctance, :math:`\Theta = R\,\varphi`, :math:`W = R\,\varphi^2/2`.

    Parameters
    ----------
    reluctance [A/Wb]
        0 for a branch that only carries eddy currents.
    """

    reluctance: float

    def __post_init__(self) -> None:
        require_nonnegative("LinearReluctance.reluctance", self.reluctance, "A/Wb")

    def mmf(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Mmf [A] at a flux [Wb], whatever the gap [m]."""
        return self.reluctance * np.asarray(flux, dtype=float)

    def slope(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return d(mmf)/d(flux) [A/Wb]."""
        return np.full(np.shape(flux), self.reluctance)

    def energy(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return the stored energy [J]."""
        return 0.5 * self.reluctance * np.asarray(flux, dtype=float) ** 2

    def energy_slope(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return dW/dx at constant flux [N]: none."""
        return np.zeros(np.shape(flux))

    def table(self) -> Vector:
        """Return ``[R]``."""
        return np.array([self.reluctance])


@dataclass(frozen=True, slots=True, eq=False)
class GapReluctance:
    r"""Air gap, :math:`\Theta = R(x)\,\varphi`, :math:`W = R(x)\,\varphi^2/2`.

    The force along ``x``, the only one of a circuit, is :math:`-\tfrac12 \varphi^2 R'(x)`.

    Parameters
    ----------
    points (k,) [m]
        Working gaps ``x``, increasing.
    reluctance, slope (k,) [A/Wb], [A/(Wb m)]
        ``R`` and ``dR/dx`` there: a cubic between (C1), straight beyond both ends.

    Examples
    --------
    >>> law = GapReluctance.of(lambda x: (1e7 + 1e11 * x, 1e11 + 0 * x), [0.0, 1e-4])
    >>> round(float(law.mmf(1e-5, 5e-5)), 6), round(float(law.energy_slope(1e-5, 2e-4)), 6)
    (150.0, 5.0)
    """

    points: Vector
    rows: Vector = field(init=False, repr=False)

    def __init__(self, points: ArrayLike, reluctance: ArrayLike, slope: ArrayLike) -> None:
        x, R, dR = (np.array(v, dtype=float).ravel() for v in (points, reluctance, slope))
        refuse_if(
            not (x.size == R.size == dR.size and x.size >= 2 and np.all(np.diff(x) > 0)),
            "GapReluctance",
            got=f"{x.size} gaps, {R.size} reluctances, {dR.size} slopes",
            expected="an equal number of each, at least two, the gaps increasing",
            hint="sort the gaps and remove repeated ones.",
        )
        if not np.all(R > 0):
            raise InputError(
                "GapReluctance",
                got=f"a reluctance of {R.min():g} A/Wb",
                expected="reluctances above 0",
                hint="give the closed gap its residual gap (coating, roughness, shim).",
            )
        object.__setattr__(self, "points", x)
        object.__setattr__(self, "rows", _two_sided_rows(x, R, dR))

    @classmethod
    def of(
        cls, law: Callable[[Vector], tuple[Vector, Vector]], points: ArrayLike
    ) -> "GapReluctance":
        """Tabulate ``law(x) -> (R, dR/dx)`` at the given gaps."""
        x = np.array(points, dtype=float)
        return cls(x, *law(x))

    def reluctance_at(self, gap: ArrayLike) -> Vector:
        """``R`` [A/Wb] at a working gap [m]."""
        return _value(self.rows, np.asarray(gap, dtype=float))

    def reluctance_slope_at(self, gap: ArrayLike) -> Vector:
        """``dR/dx`` [A/(Wb m)] at a working gap [m]."""
        return _slope(self.rows, np.asarray(gap, dtype=float))

    def mmf(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Mmf [A] at a flux [Wb] and a working gap [m]."""
        return np.asarray(self.reluctance_at(gap) * np.asarray(flux, dtype=float))

    def slope(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return d(mmf)/d(flux) [A/Wb]."""
        return self.reluctance_at(gap) + np.zeros(np.shape(flux))

    def energy(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return the stored energy [J]."""
        return np.asarray(0.5 * self.reluctance_at(gap) * np.asarray(flux, dtype=float) ** 2)

    def energy_slope(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """``dW/dx`` at constant flux [N]: minus the force along the gap."""
        return np.asarray(0.5 * self.reluctance_slope_at(gap) * np.asarray(flux, dtype=float) ** 2)

    def table(self) -> Vector:
        """``[n]`` and six numbers per interval, as above."""
        return _flat(self.rows)


@dataclass(frozen=True, slots=True, eq=False)
class IronReluctance:
    r"""Iron part of constant section, :math:`\Theta = l\,H(\varphi/A)`, odd in the flux.

    Parameters
    ----------
    points (k,) [Wb]
        Fluxes, increasing from 0.
    mmf, slope (k,) [A], [A/Wb]
        Mmf and its slope there; a cubic between, straight beyond the last point.  Both must rise:
        the solver relies on one solution.
    """

    rows: Vector = field(init=False, repr=False)

    def __init__(self, points: ArrayLike, mmf: ArrayLike, slope: ArrayLike) -> None:
        phi, F, dF = (np.array(v, dtype=float).ravel() for v in (points, mmf, slope))
        refuse_if(
            not (phi.size == F.size == dF.size and phi.size >= 2 and phi[0] == 0.0 == F[0]),
            "IronReluctance",
            got=f"{phi.size} fluxes, {F.size} mmfs, {dF.size} slopes",
            expected="an equal number of each, at least two, starting at (0 Wb, 0 A)",
            hint="begin the table at the origin.",
        )
        refuse_if(
            not (np.all(np.diff(phi) > 0) and np.all(np.diff(F) > 0) and np.all(dF > 0)),
            "IronReluctance",
            got="a magnetisation curve that is not increasing",
            expected="mmf and slope that increase with the flux",
            hint="sort the points by flux; smooth measured curves first.",
        )
        object.__setattr__(self, "rows", _one_sided_rows(phi, F, dF))

    def mmf(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Mmf [A] at a flux [Wb], whatever the gap [m]."""
        phi = np.asarray(flux, dtype=float)
        return np.asarray(np.sign(phi) * _value(self.rows, np.abs(phi)))

    def slope(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return d(mmf)/d(flux) [A/Wb]."""
        return _slope(self.rows, np.abs(np.asarray(flux, dtype=float)))

    def energy(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return the stored energy [J]."""
        return _integral(self.rows, np.abs(np.asarray(flux, dtype=float)))

    def energy_slope(self, flux: ArrayLike, gap: ArrayLike) -> Vector:
        """Return dW/dx at constant flux [N]: none."""
        return np.zeros(np.shape(flux))

    def table(self) -> Vector:
        """``[n]`` and six numbers per interval, as above."""
        return _flat(self.rows)


ReluctanceLaw = LinearReluctance | GapReluctance | IronReluctance


def _cubic_rows(x: Vector, y: Vector, dy: Vector) -> Vector:
    """Hermite cubics between the points: start, value, three factors; shape (n-1, 5).

    Factors that are only round-off of the values are zero: they would jump with the parameters of
    the curve, and spoil its derivatives.
    """
    h = np.diff(x)
    secant = np.diff(y) / h
    c2 = (3.0 * secant - 2.0 * dy[:-1] - dy[1:]) / h
    c3 = (dy[:-1] + dy[1:] - 2.0 * secant) / h**2
    least = _ROUND_OFF * np.maximum(np.abs(y[:-1]), np.abs(y[1:]))
    c2[np.abs(c2) * h**2 <= least] = 0.0
    c3[np.abs(c3) * h**3 <= least] = 0.0
    return np.column_stack((x[:-1], y[:-1], dy[:-1], c2, c3))


def _with_integral(rows: Vector) -> Vector:
    s = np.diff(rows[:, 0])
    y, c1, c2, c3 = rows[:-1, 1:].T
    pieces = s * (y + s * (c1 / 2 + s * (c2 / 3 + s * c3 / 4)))
    return np.column_stack((rows, np.concatenate(([0.0], np.cumsum(pieces)))))


def _one_sided_rows(x: Vector, y: Vector, dy: Vector) -> Vector:
    line = np.array([[x[-1], y[-1], dy[-1], 0.0, 0.0]])
    return _with_integral(np.vstack((_cubic_rows(x, y, dy), line)))


def _two_sided_rows(x: Vector, y: Vector, dy: Vector) -> Vector:
    """One more straight interval in front, one step long, which also holds below its start."""
    step = x[1] - x[0]
    line = np.array([[x[0] - step, y[0] - dy[0] * step, dy[0], 0.0, 0.0]])
    last = np.array([[x[-1], y[-1], dy[-1], 0.0, 0.0]])
    return _with_integral(np.vstack((line, _cubic_rows(x, y, dy), last)))


def _locate(rows: Vector, x: Vector) -> tuple[Ints, Vector]:
    i: Ints = np.maximum(np.searchsorted(rows[:, 0], x, side="right") - 1, 0)
    return i, x - rows[i, 0]


def _value(rows: Vector, x: Vector) -> Vector:
    i, s = _locate(rows, x)
    value: Vector = rows[i, 1] + s * (rows[i, 2] + s * (rows[i, 3] + s * rows[i, 4]))
    return value


def _slope(rows: Vector, x: Vector) -> Vector:
    i, s = _locate(rows, x)
    slope: Vector = rows[i, 2] + s * (2 * rows[i, 3] + s * 3 * rows[i, 4])
    return slope


def _integral(rows: Vector, x: Vector) -> Vector:
    i, s = _locate(rows, x)
    integral: Vector = rows[i, 5] + s * (
        rows[i, 1] + s * (rows[i, 2] / 2 + s * (rows[i, 3] / 3 + s * rows[i, 4] / 4))
    )
    return integral


def _flat(rows: Vector) -> Vector:
    return np.append(float(rows.shape[0]), rows.ravel())
