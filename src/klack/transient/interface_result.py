"""Result of an interface-level run."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.contact.history import ImpactHistory

__all__ = ["ImpactSegment", "InterfaceEnergy", "InterfaceResult", "RigidMotion"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImpactSegment:
    """Fine steps around one impact.

    Parameters
    ----------
    contact
        That carried first.
    side [-]
        1 when it pushes the moving body to +z, -1 when the stop is above.
    history
        Axial contact force (magnitude), smallest gap, velocities of the centres of mass; seen with
        the other body below, so velocities and outside forces along +z are ``side`` times these.
    point_force (n, nc) [N]
        Mean force of every contact point in each step; no rows without ``points``.
    position (6,) [m], [rad]
        Rigid placement of the moving body at the start: translation of the centre of mass and
        rotation vector.
    velocity (6,) [m/s], [rad/s]
    friction_force (n, ways nc) [N]
        Mean friction of every contact point on the moving body in each step, all points in the
        first tangential direction, then in the second; no rows without friction or points.
    doing (n, nc)
        0 open, 1 sticking, 2 slipping at the end of each step; likewise.
    """

    contact: str
    side: float
    history: ImpactHistory
    point_force: NDArray[np.float32]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    friction_force: NDArray[np.float32]
    doing: NDArray[np.int8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidMotion:
    """Rigid motion of the moving body over a whole run.

    Parameters
    ----------
    time (n,) [s]
    position, velocity (n, 6)
        Of the centre of mass [m], [m/s], and rotation vector [rad], [rad/s].
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceEnergy:
    """Energy balance of a whole run.

    Parameters
    ----------
    initial, final [J]
        Kinetic and strain energy of all bodies, of the contacts, the guides and the spring.
    damping, guide [J]
        Lost in modal damping; in guides (friction, drag, and their numerical part).
    work [J]
        Of constant forces.
    debt [J]
        What the contact steps gave too much and have not yet taken back; the residual except for
        round-off.
    friction, plastic [J]
        Lost in friction between the faces, and to their yield.
    """

    initial: float
    final: float
    damping: float
    guide: float
    work: float
    debt: float
    friction: float = 0.0
    plastic: float = 0.0

    @property
    def lost(self) -> float:
        """Sum of all losses [J]."""
        return self.damping + self.guide + self.friction + self.plastic

    @property
    def residual(self) -> float:
        """Energy balance residual over :attr:`turned_over` [-]."""
        return (self.final - self.initial + self.lost - self.work) / self.turned_over

    @property
    def turned_over(self) -> float:
        """Larger one of initial energy and work [J]."""
        return max(abs(self.initial), abs(self.work), 1e-300)

    @property
    def least_loss(self) -> float:
        """Smallest loss over :attr:`turned_over` [-]."""
        return min(self.damping, self.guide, self.friction) / self.turned_over


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceResult:
    """One or several impacts at the interface level.

    Parameters
    ----------
    impacts
        In order of time; without flight one segment holds the whole run.
    worn (nc,) [m]
        Set of the contact points at the end; no points where they stay elastic.
    steps, steps_in_contact
        Fine steps.
    rounds_per_step
        Active sets tried per step in contact.
    approach [m]
        Largest displacement of the centre of mass of the moving body to -z after the first touch
        below.
    wall_time [s]
        Of the time loop.
    """

    impacts: tuple[ImpactSegment, ...]
    motion: RigidMotion
    energy: InterfaceEnergy
    worn: NDArray[np.float64]
    steps: int
    steps_in_contact: int
    rounds_per_step: float
    approach: float
    wall_time: float

    @property
    def history(self) -> ImpactHistory:
        """History of the first segment."""
        return self.impacts[0].history
