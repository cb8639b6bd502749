r"""Contact laws along the axis of motion: force over indentation, with an exact potential.

The indentation is ``d = -gap`` [m]. Every law is zero for ``d <= 0``, rises monotonically and
never pulls. The potential is the stored work,

.. math:: V(d) = \int_0^d F(s)\,\mathrm ds ,

which the discrete-gradient time step of :mod:`klack.simulation` balances to round-off. Elastic
laws have no damping: the wave losses of modal bodies are in the modes.
"""

from dataclasses import dataclass, field
from math import log1p

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.contact.step_constants import LAW_HERTZ, LAW_LINEAR, LAW_TABLE
from klack.errors import refuse_if, require_nonnegative, require_positive

__all__ = [
    "ContactLaw",
    "ElasticLaw",
    "FlatLaw",
    "HertzLaw",
    "HuntCrossley",
    "LinearLaw",
    "TableLaw",
    "gonthier_coefficient",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlatLaw:
    """A law as plain numbers for a compiled kernel.

    Parameters
    ----------
    kind
        ``LAW_LINEAR``: ``parameters = [k]``; ``LAW_HERTZ``: ``[K, n]``; ``LAW_TABLE``: ``[n]`` and
        six numbers for each of ``n`` intervals: its start, the force there, the factors of ``s``,
        ``s^2``, ``s^3`` (``s`` from the start) and the potential there. The last interval is the
        endless linear continuation.
    dissipation [-]
        ``alpha`` of :class:`HuntCrossley`; 0 for an elastic law.
    """

    kind: int
    parameters: NDArray[np.float64]
    dissipation: float = 0.0


@dataclass(frozen=True, slots=True)
class LinearLaw:
    """Force proportional to the indentation, ``F = k d``.

    Parameters
    ----------
    stiffness [N/m]
        Of the contact zone: *what the modes do not carry already*.
    """

    stiffness: float

    def __post_init__(self) -> None:
        require_positive("LinearLaw.stiffness", self.stiffness, "N/m")

    def force(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Force [N] at an indentation [m]."""
        return self.stiffness * _closed(indentation)

    def potential(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Stored energy [J] at an indentation [m]."""
        return 0.5 * self.stiffness * _closed(indentation) ** 2

    def tangent_stiffness(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Slope dF/dd [N/m] at an indentation [m]."""
        return np.where(np.asarray(indentation, dtype=float) > 0.0, self.stiffness, 0.0)

    def flat(self) -> FlatLaw:
        """Law as numbers for the kernel."""
        return FlatLaw(kind=LAW_LINEAR, parameters=np.array([self.stiffness]))


@dataclass(frozen=True, slots=True)
class HertzLaw:
    r"""Power law, ``F = K d^n``; ``n = 1.5`` is Hertz (1882) for smooth curved bodies.

    For a sphere of radius R on a plane ``K = 4/3 E* sqrt(R)`` with
    ``1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2`` (Johnson 1985, eq. 4.23).

    Parameters
    ----------
    coefficient [N/m^n]
    exponent [-]
        At least 1.
    """

    coefficient: float
    exponent: float = 1.5

    def __post_init__(self) -> None:
        require_positive("HertzLaw.coefficient", self.coefficient, "N/m^n")
        refuse_if(
            not self.exponent >= 1.0,
            "HertzLaw.exponent",
            got=f"{self.exponent:g}",
            expected="1 or more",
            hint="use 1.5 for smooth curved bodies, or LinearLaw for flat faces.",
        )

    def force(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Force [N] at an indentation [m]."""
        return self.coefficient * _closed(indentation) ** self.exponent

    def potential(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Stored energy [J] at an indentation [m]."""
        n = self.exponent
        return self.coefficient / (n + 1.0) * _closed(indentation) ** (n + 1.0)

    def tangent_stiffness(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Slope dF/dd [N/m] at an indentation [m]."""
        n = self.exponent
        d = np.asarray(indentation, dtype=float)
        return np.where(d > 0.0, self.coefficient * n * _closed(d) ** (n - 1.0), 0.0)

    def flat(self) -> FlatLaw:
        """Law as numbers for the kernel."""
        return FlatLaw(kind=LAW_HERTZ, parameters=np.array([self.coefficient, self.exponent]))


@dataclass(frozen=True, slots=True, eq=False)
class TableLaw:
    """Monotone curve through tabulated points, starting at the origin.

    Between the points a monotone cubic (PCHIP, Fritsch and Carlson 1980; Fritsch and Butland
    1984), beyond the last its tangent. The potential is a piecewise quartic, exact.

    Parameters
    ----------
    indentation (n,) [m]
        Increasing, not negative; a missing origin is added.
    force (n,) [N]
        Increasing.

    Examples
    --------
    >>> law = TableLaw([1e-6, 2e-6], [100.0, 250.0])
    >>> float(law.force(2e-6)), float(law.force(-1e-6))
    (250.0, 0.0)
    """

    indentation: NDArray[np.float64]
    force_points: NDArray[np.float64] = field(init=False, repr=False)
    coefficients: NDArray[np.float64] = field(init=False, repr=False)
    stored: NDArray[np.float64] = field(init=False, repr=False)

    def __init__(self, indentation: ArrayLike, force: ArrayLike) -> None:
        d, f = _with_origin(
            np.array(indentation, dtype=float).ravel(), np.array(force, dtype=float).ravel()
        )
        coefficients = _monotone_cubics(d, f)
        c1, c2, c3 = coefficients
        s = np.diff(d)
        work = s * (f[:-1] + s * (c1[:-1] / 2 + s * (c2[:-1] / 3 + s * c3[:-1] / 4)))
        object.__setattr__(self, "indentation", d)
        object.__setattr__(self, "force_points", f)
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "stored", np.concatenate(([0.0], np.cumsum(work))))

    def force(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Force [N] at an indentation [m]."""
        i, s = self._locate(indentation)
        c1, c2, c3 = self.coefficients
        return self.force_points[i] + s * (c1[i] + s * (c2[i] + s * c3[i]))

    def potential(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Stored energy [J] at an indentation [m]."""
        i, s = self._locate(indentation)
        c1, c2, c3 = self.coefficients
        return self.stored[i] + s * (
            self.force_points[i] + s * (c1[i] / 2 + s * (c2[i] / 3 + s * c3[i] / 4))
        )

    def tangent_stiffness(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Slope dF/dd [N/m] at an indentation [m]."""
        i, s = self._locate(indentation)
        c1, c2, c3 = self.coefficients
        tangent = c1[i] + s * (2 * c2[i] + s * 3 * c3[i])
        return np.where(np.asarray(indentation, dtype=float) > 0.0, tangent, 0.0)

    def flat(self) -> FlatLaw:
        """Law as numbers for the kernel."""
        columns = (
            self.indentation,
            self.force_points,
            *self.coefficients,
            self.stored,
        )
        return FlatLaw(
            kind=LAW_TABLE,
            parameters=np.append(float(self.indentation.size), np.column_stack(columns).ravel()),
        )

    def _locate(self, indentation: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        d = _closed(indentation)
        i = np.clip(np.searchsorted(self.indentation, d, side="right") - 1, 0, None)
        return i, d - self.indentation[i]


@dataclass(frozen=True, slots=True)
class HuntCrossley:
    r"""Elastic law with indentation-proportional damping, for **rigid** bodies only.

    .. math:: F = F_e(d)\,\bigl(1 + \chi \dot d\bigr), \qquad \chi = \alpha / v_0

    (Hunt and Crossley 1975); ``v0`` is the approach speed at first touch, found by the time
    integration, and anew once the contact has been open by a tenth of its deepest indentation:
    each bounce is damped by its own speed, trembling is not. With ``alpha`` of
    :func:`gonthier_coefficient` two rigid bodies rebound with exactly the prescribed restitution,
    for every elastic law. On bodies with modes the wave loss would count twice. Where it would
    pull, the law is clipped, and the clipped work is a loss.
    """

    law: "ElasticLaw"
    dissipation: float

    def __post_init__(self) -> None:
        require_nonnegative("HuntCrossley.dissipation", self.dissipation, "-")
        refuse_if(
            isinstance(self.law, HuntCrossley),
            "HuntCrossley.law",
            got="another HuntCrossley law",
            expected="LinearLaw, HertzLaw or TableLaw",
            hint="add the two dissipation factors instead.",
        )

    def force(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Elastic force [N] (zero rate) at an indentation [m]."""
        return self.law.force(indentation)

    def potential(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Stored energy [J] at an indentation [m]."""
        return self.law.potential(indentation)

    def tangent_stiffness(self, indentation: ArrayLike) -> NDArray[np.float64]:
        """Slope dF/dd [N/m] of the elastic part."""
        return self.law.tangent_stiffness(indentation)

    def flat(self) -> FlatLaw:
        """Law as numbers for the kernel."""
        elastic = self.law.flat()
        return FlatLaw(
            kind=elastic.kind, parameters=elastic.parameters, dissipation=self.dissipation
        )


ElasticLaw = LinearLaw | HertzLaw | TableLaw
ContactLaw = LinearLaw | HertzLaw | TableLaw | HuntCrossley


def gonthier_coefficient(restitution: float) -> float:
    r"""Dissipation factor ``alpha`` [-] that gives two rigid bodies exactly this restitution.

    With ``alpha = D/e`` the speed after release solves

    .. math:: \frac{1 + D/e}{1 - D} = \exp\bigl(D\,(1 + 1/e)\bigr)

    (Gonthier et al. 2004, eq. 29), whatever the exponent of the elastic law.

    Parameters
    ----------
    restitution [-]
        Above 0, up to 1.

    Examples
    --------
    >>> round(gonthier_coefficient(0.9), 4), gonthier_coefficient(1.0)
    (0.1665, 0.0)
    """
    e = restitution
    refuse_if(
        not 0.0 < e <= 1.0,
        "gonthier_coefficient: restitution",
        got=f"{e:g}",
        expected="a value above 0, up to 1",
        hint="a restitution of 0.3 to 0.95 is usual for dry steel.",
    )
    if e == 1.0:
        return 0.0

    def excess(d: float) -> float:
        return log1p(d / e) - log1p(-d) - d * (1.0 + 1.0 / e)

    # excess ~ d^2 (1 - 1/e^2)/2 < 0 for small d and -> +inf for d -> 1: one root between
    upper = float(np.nextafter(1.0, 0.0))
    if excess(upper) <= 0.0:
        return upper / e  # below e = 0.028 the root is 1 in double precision
    return (
        float(scipy.optimize.brentq(excess, (1.0 - e) * 1e-3, upper, xtol=1e-17, rtol=8.9e-16)) / e
    )


def _closed(indentation: ArrayLike) -> NDArray[np.float64]:
    """Indentation where the contact is closed, else 0."""
    return np.maximum(np.asarray(indentation, dtype=float), 0.0)


def _with_origin(
    d: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Prepend a missing (0, 0) and reject what is no monotone curve."""
    refuse_if(
        d.size != f.size or d.size == 0,
        "TableLaw",
        got=f"{d.size} indentations and {f.size} forces",
        expected="an equal number of both, at least one",
        hint="give one force per indentation.",
    )
    if d[0] != 0.0:
        d, f = np.concatenate(([0.0], d)), np.concatenate(([0.0], f))
    increasing = np.all(np.diff(d) > 0.0) and np.all(np.diff(f) > 0.0)
    refuse_if(
        d.size < 2 or f[0] != 0.0 or not increasing,
        "TableLaw",
        got=f"points from ({d[0]:g} m, {f[0]:g} N) to ({d[-1]:g} m, {f[-1]:g} N)",
        expected="indentation and force, both strictly increasing from (0, 0)",
        hint="sort the points, remove repeated ones, and start at first touch.",
    )
    return d, f


def _monotone_cubics(d: NDArray[np.float64], f: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factors of s, s^2, s^3 in each interval, shape (3, n); last: the straight continuation."""
    secant = np.diff(f) / np.diff(d)
    if d.size == 2:
        slope = np.repeat(secant, 2)
    else:
        slope = scipy.interpolate.PchipInterpolator(d, f)(d, 1)
        if slope[-1] <= 0.0:
            slope[-1] = secant[-1]  # else the continuation would be a constant force
    h = np.diff(d)
    c2 = (3.0 * secant - 2.0 * slope[:-1] - slope[1:]) / h
    c3 = (slope[:-1] + slope[1:] - 2.0 * secant) / h**2
    return np.array([slope, np.append(c2, 0.0), np.append(c3, 0.0)])
