r"""A sphere that falls on a simply supported beam and meets it several times.

Euler-Bernoulli beam with modes

.. math:: \omega_n = \left(\frac{n \pi}{L}\right)^2 \sqrt{\frac{E I}{\rho A}}, \qquad
    \varphi_n(L/2) = \sqrt{2 / m_b} \, \sin(n \pi / 2), \quad n \text{ odd},

rigid sphere, Hertz contact in pieces: parallel springs with gaps :math:`a_i` and stiffnesses
:math:`k_i` that meet :math:`K \delta^{3/2}` at :math:`\delta = a_i`.  Each spring is one contact
point of the interface level.  The other solution here knows nothing of klack: the equations of
motion in the hands of an explicit Runge-Kutta method of order 8.
"""

from dataclasses import dataclass
from math import inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from klack.transient.interface_model import InterfaceModel
from klack.verification.interface_bodies import modal_model

__all__ = ["BeamImpact", "Touch", "sphere_on_beam"]

Array = NDArray[np.float64]

_YOUNG, _POISSON, _DENSITY = 210e9, 0.3, 7850.0
_LARGEST_DEPTH = 80e-6  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One sub-impact: first touch and separation [s], impulse [N s]."""

    start: float
    end: float
    impulse: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamImpact:
    """Sphere, beam, and the springs between them.

    Parameters
    ----------
    mass : float [kg]
        Of the sphere.
    omega, shapes : array, shape (m,) [rad/s], [1/sqrt(kg)]
        Frequencies of the beam and its modes at the middle.
    gaps, stiffness : array, shape (n,) [m], [N/m]
    hertz : float [N/m^1.5]
        K of the law that the springs follow.
    """

    mass: float
    omega: Array
    shapes: Array
    gaps: Array
    stiffness: Array
    hertz: float

    def model(self) -> InterfaceModel:
        """Model of the interface level."""
        row = np.concatenate([[self.mass**-0.5], -self.shapes])
        return modal_model(
            masses=(self.mass, inf),
            omega=np.concatenate([[0.0], self.omega]),
            traces=np.repeat(row[None], len(self.gaps), axis=0),
            compliance=np.diag(1.0 / self.stiffness),
            gap=self.gaps,
            owner=np.minimum(np.arange(len(row)), 1),
        )

    def force(self, depth: Array) -> Array:
        """Contact force [N] at depths [m] below first touch."""
        return np.maximum(depth[..., None] - self.gaps, 0.0) @ self.stiffness

    def touches(
        self, *, speed: float, duration: float, smooth: bool = False, samples: int = 100_001
    ) -> tuple[Touch, ...]:
        """Sub-impacts by the Runge-Kutta method DOP853 with tight tolerances.

        Parameters
        ----------
        speed, duration : float [m/s], [s]
        smooth : bool
            Take Hertz' law itself instead of the springs.
        samples : int
            Instants at which the force is looked at.
        """
        m = len(self.omega)

        def law(y: Array) -> Array:
            depth = self.shapes @ y[1 : 1 + m] - y[0]
            return self.hertz * np.maximum(depth, 0.0) ** 1.5 if smooth else self.force(depth)

        def rate(_: float, y: Array) -> Array:
            P = law(y)
            return np.concatenate(
                [y[1 + m :], [P / self.mass], -(self.omega**2) * y[1 : 1 + m] - self.shapes * P]
            )

        start = np.zeros(2 * m + 2)
        start[1 + m] = -speed
        t = np.linspace(0.0, duration, samples)
        solution = solve_ivp(
            rate,
            (0.0, duration),
            start,
            method="DOP853",
            t_eval=t,
            rtol=1e-9,
            atol=1e-13,
            max_step=5e-6,
        )
        return _touches(t, law(solution.y))


def _touches(t: Array, force: Array) -> tuple[Touch, ...]:
    on = np.concatenate([[False], force > 0.0, [False]])
    first, last = np.flatnonzero(on[1:] & ~on[:-1]), np.flatnonzero(~on[1:] & on[:-1])
    return tuple(
        Touch(
            start=float(t[a]),
            end=float(t[b - 1]),
            impulse=float(np.trapezoid(force[a:b], t[a:b])),
        )
        for a, b in zip(first, last, strict=True)
    )


def sphere_on_beam(*, modes: int = 20, springs: int = 30) -> BeamImpact:
    """Sphere R70 mm above the middle of a beam of 60 x 27.8 x 780 mm, both of steel.

    Several sub-impacts were measured on this arrangement (Adv. Mech. Eng. 2016, 8(9),
    10.1177/1687814016668089).

    Parameters
    ----------
    modes : int
        Symmetric ones of the beam.
    springs : int
        Pieces of Hertz' law, up to a depth of 80 um.
    """
    radius, length, width, height = 70e-3, 780e-3, 60e-3, 27.8e-3
    beam_mass = _DENSITY * length * width * height
    n = 2 * np.arange(modes) + 1
    K = 4.0 / 3.0 * 0.5 * _YOUNG / (1.0 - _POISSON**2) * sqrt(radius)
    depth = _LARGEST_DEPTH * (np.arange(springs + 1) / springs) ** 2
    slope = np.diff(K * depth**1.5) / np.diff(depth)
    return BeamImpact(
        mass=_DENSITY * 4.0 / 3.0 * pi * radius**3,
        omega=np.asarray((n * pi / length) ** 2 * sqrt(_YOUNG * height**2 / 12.0 / _DENSITY)),
        shapes=np.sqrt(2.0 / beam_mass) * np.sin(n * pi / 2.0),
        gaps=depth[:-1],
        stiffness=np.diff(slope, prepend=0.0),
        hertz=K,
    )
