r"""Rough faces: a layer of asperities on every contact point, whose pressure rises with closure.

Greenwood & Williamson (Proc. R. Soc. A 295 (1966) 300): spherical summits of radius :math:`\beta`
and density :math:`\eta`, heights normal with the deviation :math:`\sigma`, each pressed as by
Hertz, independent of its neighbours. At the separation d of the mean planes of summits

.. math:: p = \tfrac43 (\eta\beta\sigma)\, E^* \sqrt{\sigma/\beta}\; F_{3/2}(d/\sigma), \qquad
    F_{3/2}(h) = \frac{1}{\sqrt{2\pi}} \int_h^\infty (s - h)^{3/2} e^{-s^2/2}\, ds .

The closure c counts from the highest summits, 4 sigma above the mean. The layer is elastic, its
energy

.. math:: U = \sum_k A_k \int_0^{c_k} p\, dc .

With :math:`c_k = \max(-g_k, 0)` the gap of a point is negative by the closure of its layer, and
the forces :math:`\lambda_k = A_k\, p(c_k)` need no complementarity. Limits: summits that yield do
so in the first contacts; their real area stays small against the face, p << E* sqrt(sigma/beta).
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Self

import numpy as np

from klack.arrays import Floats
from klack.errors import ConvergenceError

__all__ = ["AsperityLayer", "press", "summit_integral"]


_HIGHEST = 4.0  # summits over sigma above their mean
_DEEPEST = -3.0  # separation over sigma at the end of the curve
_POINTS = 701
_ROUNDS = 100


def summit_integral(separation: Floats) -> Floats:
    """F_{3/2} of Greenwood & Williamson at separations over sigma, shape (n,)."""
    x, w = np.polynomial.legendre.leggauss(200)
    # s = h + t^2 takes the root at the lower end away
    h = np.asarray(separation, dtype=float)[:, None]
    top = np.sqrt(10.0 - h)
    t = 0.5 * top * (x + 1.0)
    density = np.exp(-0.5 * (h + t**2) ** 2) / sqrt(2.0 * pi)
    return np.asarray((0.5 * top * w * 2.0 * t**4 * density).sum(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AsperityLayer:
    """Pressure of a layer over its closure, straight between points; the last slope continues.

    Parameters
    ----------
    closure (n,) [m]
        Rising from 0.
    pressure (n,) [Pa]
        Rising from 0.
    """

    closure: Floats
    pressure: Floats

    @classmethod
    def of_summits(cls, *, rms: float, radius: float, density: float, modulus: float) -> Self:
        """Layer of Greenwood & Williamson.

        Parameters
        ----------
        rms [m]
            sigma, of the heights of both faces together.
        radius [m]
            beta.
        density [-]
            eta beta sigma.
        modulus [Pa]
            E*.
        """
        separation = np.linspace(_HIGHEST, _DEEPEST, _POINTS)
        shape = summit_integral(separation)
        scale = 4.0 / 3.0 * density * modulus * sqrt(rms / radius)
        return cls(closure=rms * (_HIGHEST - separation), pressure=scale * (shape - shape[0]))

    def state(self, closure: Floats) -> tuple[Floats, Floats, Floats]:
        """Pressure [Pa], slope [Pa/m] and energy [J/m^2] at closures, shape (n,)."""
        at = np.clip(np.searchsorted(self.closure, closure, "right") - 1, 0, len(self.closure) - 2)
        start = self.closure[at]
        slope = np.diff(self.pressure)[at] / np.diff(self.closure)[at]
        along = closure - start
        half = 0.5 * np.diff(self.closure) * (self.pressure[1:] + self.pressure[:-1])
        below = np.append(0.0, np.cumsum(half))[at]
        pressure = self.pressure[at] + slope * along
        energy = below + (self.pressure[at] + 0.5 * slope * along) * along
        is_closed = closure > 0.0
        return tuple(np.where(is_closed, one, 0.0) for one in (pressure, slope, energy))  # type: ignore[return-value]

    def mean_pressure(self, closure: Floats, before: Floats) -> tuple[Floats, Floats]:
        """Pressure [Pa] whose work over a step is the change of energy, and its slope [Pa/m].

        Parameters
        ----------
        closure, before (n,) [m]
            At the end and the start of the step; below 0 where open.
        """
        moved = closure - before
        tiny = np.abs(moved) < 1e-7 * self.closure[-1]
        pressure, _, energy = self.state(closure)
        middle, inside, _ = self.state(0.5 * (closure + before))
        span = np.where(tiny, 1.0, moved)
        mean = (energy - self.state(before)[2]) / span
        return (
            np.where(tiny, middle, mean),
            np.where(tiny, 0.5 * inside, (pressure - mean) / span),
        )

    def closure_at(self, pressure: float) -> float:
        """Closure [m] at a pressure [Pa]."""
        if pressure > self.pressure[-1]:
            rise = np.diff(self.closure)[-1] / np.diff(self.pressure)[-1]
            return float(self.closure[-1] + (pressure - self.pressure[-1]) * rise)
        return float(np.interp(pressure, self.pressure, self.closure))


def press(
    layer: AsperityLayer,
    area: Floats,
    C: Floats,
    q: Floats,
    *,
    before: Floats | None = None,
    start: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Forces (n,) [N] and gaps (n,) [m] of points with a layer; gaps negative by the closure.

    Newton's method on :math:`g = q + C A p(-g)`, a monotone equation, halved where it goes too
    far.

    Parameters
    ----------
    area (n,) [m^2]
    C (n, n) [m/N]
        Symmetric positive definite compliance of the bodies.
    q (n,) [m]
        Gaps without forces.
    before (n,) [m]
        Gaps at the start of a step: forces are then those whose work is the change of energy.
    start (n,) [m]
        First guess of the gaps.
    """

    def missed(gap: Floats) -> tuple[Floats, Floats, Floats]:
        if before is None:
            pressure, slope, _ = layer.state(-gap)
        else:
            pressure, slope = layer.mean_pressure(-gap, -before)
        force = area * pressure
        return gap - q - C @ force, force, area * slope

    gap = np.array(q if start is None else start, dtype=float)
    tolerance = 1e-14 + 1e-12 * float(np.max(np.abs(q), initial=0.0))
    rest, force, stiffness = missed(gap)
    for _ in range(_ROUNDS):
        size = float(np.max(np.abs(rest), initial=0.0))
        if size <= tolerance:
            return force, gap
        # d(force)/d(gap) = -stiffness
        step = np.linalg.solve(np.eye(len(q)) + C * stiffness, -rest)
        share = 1.0
        while True:
            trial = missed(gap + share * step)
            if float(np.max(np.abs(trial[0]))) <= (1.0 - 0.1 * share) * size or share < 1e-3:
                break
            share *= 0.5
        gap = gap + share * step
        rest, force, stiffness = trial
    raise ConvergenceError(
        f"asperity layer: no forces found in {_ROUNDS} rounds for {len(q)} contact points, the "
        f"gaps are still wrong by {size:.2g} m.\n"
        "Try: a curve of pressure over closure that rises steadily, or a shorter step."
    )
