"""Result of a full-order impact."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.contact.history import ImpactHistory

__all__ = [
    "EnergyRecord",
    "FieldsOfBody",
    "FullOrderResult",
    "MotionOfBody",
    "RubbingRecord",
    "Snapshots",
    "SolverStatistics",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EnergyRecord:
    """Energies at every m-th step, at the start and at the end.

    Parameters
    ----------
    time (k,) [s]
    kinetic, strain (k, n_bodies) [J]
        Of body a, then body b.
    contact (k,) [J]
        Taken from the bodies when points closed or opened within a step; the first numerical loss.
        Never below zero in the stabilised scheme; the massless one may gain (3e-4 of the energy in
        60 steps through an impact of 25 us).
    overshoot (k,) [J]
        Taken by removing the inertial overshoot, >= 0; the second one.
    work (k,) [J]
        Done by the constant force.
    damping (k,) [J]
        Lost in the damping of the bodies, >= 0.
    spring (k,) [J]
        Taken up by the spring since the start.
    friction (k,) [J]
        Lost in friction of the faces, >= 0; grows only.
    radiated (k,) [J]
        Carried away through non-reflecting ends, >= 0; grows only.
    """

    time: NDArray[np.float64]
    kinetic: NDArray[np.float64]
    strain: NDArray[np.float64]
    contact: NDArray[np.float64]
    overshoot: NDArray[np.float64]
    work: NDArray[np.float64]
    damping: NDArray[np.float64]
    spring: NDArray[np.float64]
    friction: NDArray[np.float64]
    radiated: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """Kinetic and strain energy of all bodies, shape (k,) [J]."""
        return self.kinetic.sum(axis=1) + self.strain.sum(axis=1)

    @property
    def residual(self) -> NDArray[np.float64]:
        """Energy from nowhere, shape (k,) [J]: round-off in a sound run."""
        lost = self.contact + self.overshoot + self.damping + self.friction + self.radiated
        return self.total - self.total[0] + self.spring + lost - self.work


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldsOfBody:
    """Nodal fields of one body, all degrees of freedom (zero where fixed).

    Parameters
    ----------
    peak_displacement (n_dof,) [m]
        At the end of the step with the largest contact force, counted from the start of the run.
    end_displacement (n_dof,) [m]
    end_velocity (n_dof,) [m/s]
        Its mass-weighted projection on the modes tells where the energy went.  Modes that the step
        does not resolve alternate from step to step, visibly at single contact nodes.
    """

    name: str
    peak_displacement: NDArray[np.float64]
    end_displacement: NDArray[np.float64]
    end_velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionOfBody:
    """Motion of one body at one instant, all degrees of freedom (zero where fixed).

    Parameters
    ----------
    displacement (n_dof,) [m]
        From the given placement, with the flight to the first touch.
    velocity (n_dof,) [m/s]
        Mean over the step before, in which modes cancel that the step does not resolve.
    """

    name: str
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshots:
    """Reads fields of a run in progress, which are not kept.

    Parameters
    ----------
    steps
        After which to look; 0 is the start.
    receive
        Called with the time [s] and the bodies, a first.
    """

    steps: Collection[int]
    receive: Callable[[float, tuple[MotionOfBody, ...]], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverStatistics:
    """Effort of one run.

    Parameters
    ----------
    degrees_of_freedom
        Free ones, of both bodies.
    rounds_per_step
        Active sets tried per step in contact.
    watched
        Mean number of contact points near enough to be checked.
    repeats
        Steps repeated because another point closed.
    factor_entries
        Stored entries of all factors (0 if unknown).
    turns
        Steps whose forces with friction were found point by point.
    set_up_time, loop_time [s]
        Wall-clock.
    """

    scheme: str
    backend: str
    degrees_of_freedom: int
    contact_points: int
    steps: int
    steps_in_contact: int
    rounds_per_step: float
    watched: float
    repeats: int
    factor_entries: int
    turns: int
    set_up_time: float
    loop_time: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RubbingRecord:
    """Motion of the contact points across their normals.

    Parameters
    ----------
    force (n, ways, nc) [N]
        On body a along each tangential direction, mean over each step.
    doing (n, nc)
        Open, sticking or slipping in each step, as of :mod:`klack.transient.rubbing`.
    """

    force: NDArray[np.float32]
    doing: NDArray[np.int8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullOrderResult:
    """One impact with every degree of freedom.

    Parameters
    ----------
    history
        Its contact dissipation is the numerical loss of the scheme.
    point_force (n, nc) [N]
        Of every contact point, mean over each step.
    area (nc,) [m^2]
        Of the contact points.
    fields
        Of body a and, unless it is a rigid wall, body b.
    rigid_velocity (6,) [m/s], [rad/s]
        Of body a at the end: centre of mass and spin, of its momenta.
    approach [m]
        Largest approach of the centre of mass of a after the first touch.
    retraction [m]
        Distance that a was moved back along +z at the start because the bodies overlapped.
    """

    history: ImpactHistory
    point_force: NDArray[np.float32]
    area: NDArray[np.float64]
    energy: EnergyRecord
    fields: tuple[FieldsOfBody, ...]
    rigid_velocity: NDArray[np.float64]
    approach: float
    retraction: float
    statistics: SolverStatistics
    rubbing: RubbingRecord | None = None

    @property
    def pressure(self) -> NDArray[np.float32]:
        """Contact pressure of every point, shape (n, nc) [Pa]."""
        return np.asarray(self.point_force / self.area, dtype=np.float32)

    @property
    def peak_index(self) -> int:
        """Step with the largest contact force."""
        return int(np.argmax(self.history.force))

    @property
    def energy_loss(self) -> float:
        """Loss of the scheme over the energy at the start [-]."""
        given = self.energy.total[0] + self.energy.work[-1]
        kept = self.energy.total[-1] + self.energy.spring[-1] + self.energy.damping[-1]
        lost = given - kept - self.energy.friction[-1] - self.energy.radiated[-1]
        return float(lost / max(self.energy.total[0], abs(self.energy.work[-1])))
