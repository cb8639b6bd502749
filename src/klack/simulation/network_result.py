"""Result of a network run, and the state to continue from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, nan

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError
from klack.simulation.spatial_impact import SpatialImpact, SpatialPath
from klack.simulation.step_sizes import StepSizes

__all__ = [
    "ChannelData",
    "EnergyBooks",
    "ImpactEvent",
    "IncompleteRunError",
    "InterfaceRecord",
    "NetworkResult",
    "PressedFaces",
    "StaticStart",
    "StepCounts",
]

BODY_STORE = "kinetic and strain"  # what a body holds; its component stands before it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelData:
    """One recorded quantity.

    Parameters
    ----------
    unit
        SI.
    values (n,)
        At :attr:`NetworkResult.time`; forces and flows are means over the record before, first
        their value at the start.
    """

    unit: str
    values: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceRecord:
    """Every step in which an interface carried force: coarse ones only while it is closed.

    Parameters
    ----------
    time (k,) [s]
        Starts.
    step (k,) [s]
    contact_force, film_force (k,) [N]
        Means over the step, above zero when they press; a film may pull.
    gap (k,) [m]
        At the end of the step, negative when closed; of the bodies, without the series compliance.
    complete
        False after more than a million steps: the later ones are missing, but impacts are found,
        and means of the forces are among the channels.
    """

    time: NDArray[np.float64]
    step: NDArray[np.float64]
    contact_force: NDArray[np.float64]
    film_force: NDArray[np.float64]
    gap: NDArray[np.float64]
    complete: bool


_LATE = 0.75  # of a contact that is not over: a peak after that may still grow


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactEvent:
    """One impact: contacts closer together than the longest period of the needle are one.

    Parameters
    ----------
    stop
        Component of the interface.
    time [s]
        First touch.
    approach_speed [m/s]
        Closing speed of the centres of mass: at first touch, or the highest one since the film
        began to press.  Levers, and bodies that follow a course, count with the speed of the face.
    peak_force [N]
        Of contact and film together.
    peak_time [s]
    contact_time [s]
        Closed, all contacts together; up to rest, that is when they have been closed for
        :func:`~klack.simulation.rest.rest_time`.
    separation_time [s]
        End of the last contact, with the rest; nan if it lasts to the end of the run.
    impulse [N s]
        Of contact and film, while it presses before and pulls after the contact; up to rest.
    restitution [-]
        Opening speed over approach speed of the centres of mass; 0 if the bodies come to rest, nan
        if the run ends in the contact.  With a film the opening speed is the highest one while it
        pulls.
    energy_loss [J]
        Kinetic energy of the centre of mass before less after; nan as above.
    touch_speed [m/s]
        Closing speed of the centres of mass at first touch, behind the film; nan in results of
        former versions.
    besides
        Other stops that act on one of the bodies meanwhile, or its rotation, so much that this
        impact has no restitution and no energy loss; see
        :func:`klack.simulation.impact_events.judged`.
    """

    stop: str
    time: float
    approach_speed: float
    peak_force: float
    peak_time: float
    contact_time: float
    separation_time: float
    impulse: float
    restitution: float
    energy_loss: float
    touch_speed: float = nan
    besides: str = ""

    @property
    def is_over(self) -> bool:
        """Whether the bodies have parted, or come to rest."""
        return isfinite(self.restitution) or bool(self.besides)

    @property
    def grows(self) -> bool:
        """Whether the run ends before its highest force: in the last quarter of its contact."""
        return not self.is_over and self.peak_time - self.time > _LATE * self.contact_time


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EnergyBooks:
    """Energy over the whole run [J], every entry named ``<component> <label>``.

    ``supplies - losses = stores_after - stores_before + residual``.
    """

    supplies: Mapping[str, float]
    losses: Mapping[str, float]
    stores_before: Mapping[str, float]
    stores_after: Mapping[str, float]

    @property
    def residual(self) -> float:
        """What does not balance [J]."""
        change = sum(self.stores_after.values()) - sum(self.stores_before.values())
        return sum(self.supplies.values()) - sum(self.losses.values()) - change

    @property
    def throughput(self) -> float:
        """Larger of what came in and what was spent or stored [J]."""
        rises = {key: self.stores_after[key] - self.stores_before[key] for key in self.stores_after}
        incoming = [*self.supplies.values(), *(-x for x in self.losses.values())]
        incoming += [-x for x in rises.values()]
        return sum(x for x in incoming if x > 0.0)

    @property
    def relative_residual(self) -> float:
        """Residual over :attr:`scale` [-]."""
        return abs(self.residual) / self.scale if self.scale > 0.0 else 0.0

    @property
    def least_loss(self) -> float:
        """Smallest entry of the losses [J]; below zero it is a source."""
        return min(self.losses.values(), default=0.0)

    @property
    def scale(self) -> float:
        """What a residual is judged by [J]: the largest of three.

        - The throughput.  It compares only the ends of the run: after whole periods of a mass that
          swings on a spring it is zero.
        - Hence the kinetic and strain energy of the bodies at the start or the end, as in the
          energy balance of an impact.
        - A thousandth of all that is stored: a valve at rest turns no energy over, but leaves the
          round-off of its stores.
        """
        held = (self.stores_before, self.stores_after)
        moving = [
            sum(abs(x) for name, x in stores.items() if name.endswith(f" {BODY_STORE}"))
            for stores in held
        ]
        stored = sum(abs(x) for x in self.stores_after.values())
        return max(self.throughput, *moving, 1e-3 * stored)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StaticStart:
    """Equilibrium at time zero, in which a run began.

    Parameters
    ----------
    displacement [m]
        By ``"<body>.<port>"``.
    pressure [Pa]
        Of each volume, absolute.
    stated
        Whether the case states that pressure; else it is that of steady flow.
    flow [kg/s]
        Of each branch and line.
    residual [N]
        Force left on each free body.
    notes
        What has no steady state, and how it starts instead.
    """

    displacement: Mapping[str, float]
    pressure: Mapping[str, float]
    stated: Mapping[str, bool]
    flow: Mapping[str, float]
    residual: Mapping[str, float]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PressedFaces:
    """Faces of an end stop that yield, as a run left them.

    Parameters
    ----------
    set [m]
        By which they part later than new ones.
    force [N]
        Largest force so far; they are elastic up to it.
    known_force [N]
        Up to which their static loops go.
    """

    set: float
    force: float
    known_force: float


@dataclass(frozen=True, slots=True)
class StepCounts:
    """Steps of a run.

    Parameters
    ----------
    fine
        Taken by bodies, elements and fluid together.
    flight
        Macro steps in flight, at rest, while closed contacts swing or films change slowly.
    near
        Macro steps about a touch, in sub-steps of the bodies.
    sub
        These sub-steps.
    sub_fine
        Those that were fine ones.
    repeats
        Steps repeated because the guess of the forces of elements and fluid missed too much.
    """

    fine: int = 0
    flight: int = 0
    near: int = 0
    sub: int = 0
    sub_fine: int = 0
    repeats: int = 0

    @property
    def taken(self) -> int:
        """Steps of the bodies."""
        return self.fine + self.flight + self.sub


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkResult:
    """Result of a network run.

    Parameters
    ----------
    time (n,) [s]
        Records, evenly spaced from the start.
    channels
        ``"<component> <label>"``, for example ``"needle velocity"`` (centre of mass),
        ``"needle.tip displacement"``, ``"seat contact force"``, ``"seat film force"``,
        ``"seat gap"``, ``"coil current"``, ``"sac pressure"``, ``"spring.end force"``.
    wall_time [s]
        Of the time loop.
    state
        Everything needed to continue, bit-identically.  The continued run reports an unfinished
        impact again, whole, with the same stop and time.
    failure
        Why the run ended early, with the record up to there; else empty.
    start
        None for a continued or free start.
    path
        Of a needle in three dimensions; not stored with a result.
    paths
        Of all bodies that move there, likewise.
    faces
        By component, where faces yield.
    spatial_impacts
        First impacts of bodies that meet point by point; empty for a motion along the axis, None in
        results of versions that did not record it.
    """

    time: NDArray[np.float64]
    channels: Mapping[str, ChannelData]
    interfaces: Mapping[str, InterfaceRecord]
    events: tuple[ImpactEvent, ...]
    books: EnergyBooks
    sizes: StepSizes
    steps: StepCounts
    wall_time: float
    state: Mapping[str, NDArray[np.generic]]
    failure: str = ""
    start: StaticStart | None = None
    path: SpatialPath | None = None
    paths: tuple[SpatialPath, ...] = ()
    faces: Mapping[str, PressedFaces] = field(default_factory=dict)
    spatial_impacts: tuple[SpatialImpact, ...] | None = None

    @property
    def step(self) -> float:
        """Fine step [s]."""
        return self.sizes.step

    @property
    def fine_steps(self) -> int:
        """Fine steps of the bodies, with or without elements and fluid."""
        return self.steps.fine + self.steps.sub_fine

    @property
    def coarse_steps(self) -> int:
        """Macro steps: those after which elements and fluid answer once."""
        return self.steps.flight + self.steps.near


class IncompleteRunError(ConvergenceError):
    """A run failed on its way; ``result``, with the text as ``failure``, holds it until then."""

    def __init__(self, text: str, result: NetworkResult) -> None:
        super().__init__(text)
        self.result = result
