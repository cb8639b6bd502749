"""Record of a stroke study."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord
from klack.analyses.stroke.acting import ActingForce, FluidPassage, MovingBody
from klack.analyses.stroke.delivery import Delivery, Restriction, deliveries
from klack.analyses.stroke.stairs import LineEnd, Stair, stairs
from klack.analyses.stroke.step_check import ImpactChange
from klack.analyses.stroke.times import LiftTimes, Passage
from klack.assembling.body_summary import BodySummary
from klack.bodies.reduction.structure import Structure
from klack.errors import ConvergenceError
from klack.simulation.network_result import ChannelData, ImpactEvent, NetworkResult

__all__ = [
    "FluidSummary",
    "IncompleteStrokeError",
    "LineSummary",
    "StopSummary",
    "StrokeChannels",
    "StrokeStudy",
    "StrokeVariant",
]


@dataclass(frozen=True, kw_only=True)
class FluidSummary:
    """The fluid at its working temperature.

    Parameters
    ----------
    temperature [K]
    pressure [Pa]
        Absolute, for the numbers below: the highest start pressure.
    density [kg/m^3]
    bulk_modulus [Pa]
        With its entrained gas.
    sound_speed [m/s]
    viscosity [Pa s]
        Dynamic.
    vapour_pressure [Pa]
        Absolute.
    """

    name: str
    temperature: float
    pressure: float
    density: float
    bulk_modulus: float
    sound_speed: float
    viscosity: float
    vapour_pressure: float


@dataclass(frozen=True, kw_only=True)
class LineSummary:
    """One line of the valve.

    Parameters
    ----------
    length [m]
    sound_speed [m/s]
        Of its waves, with the elasticity of the wall.
    echo_time [s]
        ``2 L / a``: spacing of the stairs in pressure and rebound velocity.
    """

    name: str
    length: float
    sound_speed: float
    echo_time: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StopSummary:
    """One end stop: its surfaces, static contact and local law.

    Parameters
    ----------
    name
        Component, ``"seat"``.
    surfaces
        ``"needle.tip on housing.seat"``; empty without.
    kind
        ``"consistent"`` if the law was computed, else the kind that the case gives.
    gap [m]
        At the start; of the opening stop, the lift.
    film
        Whether there is a squeeze film.
    indentation, force (k,) [m], [N]
        Local law; empty for a law that is given.
    share (k,) [-]
        Of the static compliance that the law carries.
    approach, static_force, area (n,) [m], [N], [m^2]
        Static contact of the full bodies, from first touch.
    pattern_force [N]
        Force whose pressure pattern the ports carry; nan for a law that is given.
    half_width [m]
        Of the contact at that force.
    size_ratio, points_across, doubts, needed_yield
        See :class:`klack.analyses.impact.record.ContactSummary`.
    friction [-]
        Coefficient of Coulomb friction between the faces.
    returning (k,) [N]
        Force at ``indentation`` while faces with friction slip back; empty for a law without loss.
    """

    name: str
    surfaces: str
    kind: str
    gap: float
    film: bool
    indentation: NDArray[np.float64]
    force: NDArray[np.float64]
    share: NDArray[np.float64]
    approach: NDArray[np.float64]
    static_force: NDArray[np.float64]
    area: NDArray[np.float64]
    pattern_force: float
    half_width: float
    size_ratio: float
    points_across: int = 0
    doubts: tuple[str, ...] = ()
    needed_yield: float = float("nan")
    friction: float = 0.0
    returning: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, kw_only=True)
class StrokeChannels:
    """Names of the main channels of a stroke, in every variant that has them.

    Parameters
    ----------
    lift
        ``"needle.tip displacement"``; ``lift_velocity`` is its rate.
    velocity
        Of the centre of mass of the needle.
    voltage, current, magnetic_force
        One per solenoid.
    opening_stop, seat
        Components, or empty.
    """

    lift: str
    lift_velocity: str
    velocity: str
    voltage: tuple[str, ...]
    current: tuple[str, ...]
    magnetic_force: tuple[str, ...]
    pressures: tuple[str, ...]
    flows: tuple[str, ...]
    opening_stop: str
    seat: str


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeVariant:
    """One run of the valve.

    Parameters
    ----------
    name
        ``"wet"``, ``"dry"``, ``"dry-mounted"``, ``"wet-lumped"`` or ``"dry-lumped"``.
    label
        For a legend, for example ``"n-heptane at 5 bar, 20 + 40 modes"``.
    modes
        Degrees of freedom of all bodies.
    opening_time [s]
        First touch of the opening stop in the stroke of ``times``, if any.
    closing_time [s]
        The same for the seat, after the largest lift of that stroke.  A valve that starts open
        closes before it opens.  Neither is ever negative.
    times
        Of the needle first, then of other bodies between stops.
    setup_time [s]
        Wall time before the time loop, for this variant alone.
    changes
        Of each impact when all steps are doubled, if asked for.
    halvings
        Of all steps, by their check.
    acting, moving, passages, restrictions, line_ends
        Recorded forces and where they act, what moves, the fluid's columns and ways in and out,
        where it flows, and lines that end at a body; empty in results of former versions.
    """

    name: str
    label: str
    wet: bool
    flexible: bool
    modes: int
    opening_time: float | None
    closing_time: float | None
    result: NetworkResult
    setup_time: float
    times: tuple[LiftTimes, ...] = ()
    changes: tuple[ImpactChange, ...] = ()
    halvings: int = 0
    acting: tuple[ActingForce, ...] = ()
    moving: tuple[MovingBody, ...] = ()
    passages: tuple[FluidPassage, ...] = ()
    restrictions: tuple[Restriction, ...] = ()
    line_ends: tuple[LineEnd, ...] = ()

    @cached_property
    def deliveries(self) -> Mapping[str, Delivery]:
        """What restrictions pass, by :attr:`~klack.analyses.stroke.delivery.Delivery.name`."""
        return {item.name: item for item in deliveries(self.restrictions, self.result)}

    @cached_property
    def stairs(self) -> tuple[Stair, ...]:
        """Steps that waves in lines leave in the velocity after impacts."""
        return tuple(stairs(self.line_ends, self.result))

    @property
    def delivered_mass(self) -> float | None:
        """Mass that leaves the valve through all restrictions that lead out [kg]."""
        return sum(item.left for item in self.ways_out) if self.ways_out else None

    @property
    def ways_out(self) -> tuple[Delivery, ...]:
        """Of the whole run, through restrictions that lead out."""
        found = self.deliveries.values()
        return tuple(item for item in found if item.leads_out and not item.pulse)

    @property
    def needle_times(self) -> LiftTimes:
        """Opening and closing of the needle; of older results, its touches."""
        if self.times:
            return self.times[0]
        touches = [
            time if time is not None and isfinite(time) else None
            for time in (self.opening_time, self.closing_time)
        ]
        opening, closing = (Passage(touch=touch) for touch in touches)
        return LiftTimes(
            body="",
            starts="closed",
            lift=None,
            between_stops=False,
            opening=opening,
            closing=closing,
        )

    def impacts(self, stop: str, *, slowest: float = 0.0) -> tuple[ImpactEvent, ...]:
        """Impacts on one stop, faster than ``slowest`` [m/s]."""
        return tuple(
            event
            for event in self.result.events
            if event.stop == stop and event.approach_speed >= slowest
        )

    def channel(self, name: str) -> ChannelData | None:
        """Recorded channel, if this variant has it."""
        return self.result.channels.get(name)


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeStudy(CaseRecord):
    """All variants of one actuation, side by side.

    Parameters
    ----------
    lift [m]
        Travel between the unloaded stops, if they end it.
    switch_off [s]
        End of the drivers' command, if any.
    duration, step [s]
    variants
        Compared with the first; the last may be incomplete, see
        :attr:`~klack.simulation.network_result.NetworkResult.failure`.
    bodies
        Their ``compliance_share`` is the smallest of all contact ports.
    structures
        Held bodies as sources of sound, with named end stops.
    schematic
        Picture of the network (SVG); empty in older results.
    """

    needle: str
    lift: float | None
    switch_off: float | None
    duration: float
    step: float
    variants: Mapping[str, StrokeVariant]
    channels: StrokeChannels
    bodies: tuple[BodySummary, ...]
    stops: tuple[StopSummary, ...]
    fluid: FluidSummary | None = None
    lines: tuple[LineSummary, ...] = ()
    structures: tuple[Structure, ...] = ()
    schematic: str = ""

    @property
    def reference(self) -> StrokeVariant:
        """First variant, with which others are compared."""
        return next(iter(self.variants.values()))

    @property
    def opening_time(self) -> float | None:
        """Opening time of the reference [s], if it reaches its stop."""
        return self.reference.opening_time

    @property
    def closing_time(self) -> float | None:
        """Closing time of the reference [s], if it reaches its seat."""
        return self.reference.closing_time


class IncompleteStrokeError(ConvergenceError):
    """A variant failed; ``study`` has it until then, and those before it."""

    def __init__(self, text: str, study: StrokeStudy) -> None:
        super().__init__(text)
        self.study = study
