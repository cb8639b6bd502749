"""One drop of a valve at the interface level."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.interface_level import set_doubts
from klack.analyses.shots.draw import ShotDraw, polar
from klack.analyses.shots.record import ShotTraces
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.schema import Case
from klack.contact.gap_update import RigidGaps
from klack.contact.restitution import ImpactMeasures, measure_impact
from klack.machine.stages import collected_warnings
from klack.mesh.rigid import rigid_placement
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_result import InterfaceResult
from klack.transient.interface_run import simulate_interface

__all__ = [
    "SHOT_LOG",
    "ShotLog",
    "ShotOutcome",
    "ShotSetup",
    "run_shot",
    "shot_log",
    "shots_mark",
    "simulate_shot",
    "traces_of",
]


_TRACE_POINTS = 600
_FORCE_POINTS = 400
_APEX_POINTS = 16  # between two records of the motion in flight


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShotSetup:
    """Everything that all shots of a valve share; plain arrays, cheap to send to other processes.

    Parameters
    ----------
    model
        Centred, in first touch, with the mean friction between the faces.
    about (3,) [m]
        Point of the axis at the height of first touch, about which the body tilts.
    inertia (3, 3) [kg m^2]
        About the centre of mass.
    opposite_gap (m,) [m]
        At an upper stop, at the placement of the model.
    opposite_slope (m, 6)
        Their change per unit of a rigid placement; there the gaps stay linear.
    radial (nc - m,) [-]
        Change of gaps at the seat per growth of the moving body's radius.
    angle (nc - m,) [rad]
        Of these points round the axis.
    speed [m/s]
    start_height [m]
        Above first touch.
    spring_stiffness [N/m]
    duration, step [s]
    force_span [s]
        Length of the record of the first impact.
    """

    model: InterfaceModel
    guide: Guide | None
    gaps: RigidGaps
    about: NDArray[np.float64]
    inertia: NDArray[np.float64]
    opposite_gap: NDArray[np.float64]
    opposite_slope: NDArray[np.float64]
    radial: NDArray[np.float64]
    angle: NDArray[np.float64]
    speed: float
    start_height: float
    spring_stiffness: float
    duration: float
    step: float
    impacts: int
    force_span: float

    @property
    def trace_time(self) -> NDArray[np.float64]:
        """Grid of the motion, from first touch [s]."""
        return np.linspace(0.0, self.duration, _TRACE_POINTS + 1)

    @property
    def force_time(self) -> NDArray[np.float64]:
        """Grid of the force of the first impact, from first touch [s]."""
        return np.linspace(0.0, self.force_span, _FORCE_POINTS + 1)

    def model_of(self, draw: ShotDraw) -> InterfaceModel:
        """Model with the friction between the faces of this draw, at all contacts.

        A static coefficient keeps its ratio to the kinetic one; speeds of slip stay.
        """
        if not self.model.ways:
            return self.model
        faces = tuple(friction.scaled(draw.contact_friction) for friction in self.model.friction)
        return replace(self.model, friction=faces)

    def gaps_of(self, draw: ShotDraw) -> "ShotGaps":
        """Gaps by placement, with the ring of this draw."""
        added = self.radial * draw.radial_deviation(self.angle)
        return ShotGaps(self.gaps, added, self.opposite_gap, self.opposite_slope)

    def placement(self, draw: ShotDraw) -> NDArray[np.float64]:
        """Rigid placement (6,) at the start, without its height."""
        return rigid_placement(draw.aside, draw.lean, self.about, self.model.centre)


@dataclass(frozen=True, slots=True, eq=False)
class ShotGaps:
    """Gaps [m] at a rigid placement, with those of an out-of-round ring."""

    exact: RigidGaps
    added: NDArray[np.float64]
    opposite_gap: NDArray[np.float64]
    opposite_slope: NDArray[np.float64]

    def __call__(self, placement: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gaps (nc,) [m] at a placement (6,) [m], [rad]."""
        seat = self.exact(placement) + self.added
        return np.concatenate([seat, self.opposite_gap + self.opposite_slope @ placement])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShotOutcome:
    """Result of one shot: ``numbers`` of its columns, ``height`` and ``force`` on the grids.

    ``approach`` [m] is the largest way after first touch, ``worn`` (nc,) [m] the set of contact
    points, none where they stay elastic.  ``doubts`` are accuracy warnings, from whichever process.
    """

    index: int
    numbers: dict[str, float]
    height: NDArray[np.float32]
    force: NDArray[np.float32]
    approach: float
    doubts: tuple[str, ...] = ()
    worn: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


def simulate_shot(
    setup: ShotSetup,
    draw: ShotDraw,
    *,
    impacts: int | None = None,
    points: bool = False,
    worn: NDArray[np.float64] | None = None,
) -> InterfaceResult:
    """Simulate the moving body as drawn.

    It stops after so many ``impacts``, may keep the force of every contact point (``points``), and
    meets faces with a set ``worn`` (nc,) [m].
    """
    guide = setup.guide.with_friction(draw.friction) if setup.guide is not None else None
    return simulate_interface(
        setup.model_of(draw),
        speed=setup.speed,
        duration=setup.duration,
        step=setup.step,
        force=draw.force + setup.spring_stiffness * setup.start_height,
        spring_stiffness=setup.spring_stiffness,
        guide=guide,
        offset=setup.placement(draw),
        height=setup.start_height,
        gaps=setup.gaps_of(draw),
        flight=True,
        impacts=setup.impacts if impacts is None else impacts,
        points=points,
        worn=worn,
    )


def run_shot(
    setup: ShotSetup, draw: ShotDraw, worn: NDArray[np.float64] | None = None
) -> ShotOutcome:
    """Simulate a shot; measure its first impact and rebound."""
    with collected_warnings() as doubts:
        result = simulate_shot(setup, draw, worn=worn)
    first = measure_impact(result.impacts[0].history)
    second = np.nan
    if len(result.impacts) > 1:
        second = measure_impact(result.impacts[1].history).first_touch
    time, height = _path(result)
    height = height - np.interp(first.first_touch, time, height)
    release = first.first_touch + first.total_contact_time
    eccentricity, direction = polar(draw.aside)
    tilt, tilt_direction = polar(draw.lean)
    energy = 0.5 * setup.model.mass * first.approach_speed**2
    numbers = {
        "eccentricity": eccentricity,
        "direction": direction,
        "tilt": tilt,
        "tilt_direction": tilt_direction,
        "force": draw.force,
        "friction": draw.friction,
        "contact_friction": draw.contact_friction,
        "waviness": draw.waviness,
        "approach_speed": first.approach_speed,
        "restitution": first.restitution,
        "rebound_height": _highest(time, height, release, second),
        "peak_force": first.peak_force,
        "contact_time": first.contact_time,
        "impulse": first.impulse,
        "sub_contacts": float(first.sub_contacts),
        "rocking": _rocking(setup, result, release, first),
        "friction_loss": result.impacts[0].history.ledger.friction / energy,
        "plastic_loss": result.energy.plastic / energy,
        "deepest_set": float(np.max(result.worn, initial=0.0)),
        "second_impact": second - first.first_touch,
        "impacts": float(len(result.impacts)),
        "energy_residual": result.energy.residual,
    }
    trace = np.interp(first.first_touch + setup.trace_time, time, height, right=np.nan)
    history = result.impacts[0].history
    force = np.interp(
        first.first_touch + setup.force_time, history.time, history.force, left=0.0, right=0.0
    )
    return ShotOutcome(
        index=draw.index,
        numbers={key: float(value) for key, value in numbers.items()},
        height=trace.astype(np.float32),
        force=force.astype(np.float32),
        approach=result.approach,
        doubts=(*doubts, *set_doubts(setup.model, result)),
        worn=result.worn,
    )


def traces_of(setup: ShotSetup, outcomes: Sequence[ShotOutcome]) -> ShotTraces:
    """Motion and force of several shots in rows."""
    return ShotTraces(
        time=setup.trace_time,
        height=np.stack([outcome.height for outcome in outcomes]),
        force_time=setup.force_time,
        force=np.stack([outcome.force for outcome in outcomes]),
    )


def _path(result: InterfaceResult) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Height of the centre of mass: all steps of impacts, parabolas in flight."""
    motion = result.motion
    z, v = motion.position[:, 2], motion.velocity[:, 2]
    times, heights = [], []
    spans = []
    for segment in result.impacts:
        history = segment.history
        speed = segment.side * history.velocity_a
        way = np.cumsum(0.5 * (speed[1:] + speed[:-1])) * history.step
        times.append(history.edges)
        heights.append(segment.position[2] + np.append(0.0, way))
        spans.append((history.edges[0], history.edges[-1]))
    s = np.arange(_APEX_POINTS) / _APEX_POINTS
    for i in range(len(motion.time) - 1):
        start, end = motion.time[i], motion.time[i + 1]
        middle = 0.5 * (start + end)
        if any(first <= middle <= last for first, last in spans):
            continue
        h = end - start
        # cubic through both positions and velocities (Hermite); exact under a constant force
        curve = (
            z[i] * (1 + 2 * s) * (1 - s) ** 2
            + z[i + 1] * s**2 * (3 - 2 * s)
            + h * s * (1 - s) * (v[i] * (1 - s) - v[i + 1] * s)
        )
        times.append(start + h * s)
        heights.append(curve)
    times.append(motion.time[-1:])
    heights.append(z[-1:])
    time, height = np.concatenate(times), np.concatenate(heights)
    order = np.argsort(time, kind="stable")
    return time[order], height[order]


def _highest(
    time: NDArray[np.float64], height: NDArray[np.float64], release: float, second: float
) -> float:
    """Highest place between two impacts; nan if the record ends before."""
    end = second if np.isfinite(second) else np.inf
    flight = np.flatnonzero((time >= release) & (time <= end))
    if not len(flight):
        return float("nan")
    top = flight[np.argmax(height[flight])]
    if top == flight[-1] and not np.isfinite(second):
        return float("nan")
    return float(height[top])


def _rocking(
    setup: ShotSetup, result: InterfaceResult, release: float, first: ImpactMeasures
) -> float:
    """Energy across the axis and of rotation after the impact, over that of approach."""
    motion = result.motion
    after = min(int(np.searchsorted(motion.time, release)), len(motion.time) - 1)
    v = motion.velocity[after]
    energy = setup.model.mass * float(v[:2] @ v[:2]) + float(v[3:] @ setup.inertia @ v[3:])
    return energy / (setup.model.mass * first.approach_speed**2)


ShotLog = UnfinishedLog[int, ShotOutcome]
"""Shots by their number."""


def shots_mark(case: Case, seed: int, threads: int | None) -> str:
    """Digest of all that decides the numbers of a shot."""
    return fingerprint(case, (str(seed).encode(), str(threads).encode()))


def _data(index: int, outcome: ShotOutcome) -> Mapping[str, Any]:
    more: dict[str, Any] = {"doubts": list(outcome.doubts)} if outcome.doubts else {}
    if len(outcome.worn):
        more["worn"] = outcome.worn.tolist()
    return {
        "index": index,
        "numbers": outcome.numbers,
        "height": outcome.height.tolist(),
        "force": outcome.force.tolist(),
        "approach": outcome.approach,
    } | more


def _outcome(data: Mapping[str, Any]) -> tuple[int, ShotOutcome]:
    outcome = ShotOutcome(
        index=int(data["index"]),
        numbers={str(key): float(value) for key, value in data["numbers"].items()},
        height=np.array(data["height"], dtype=np.float32),
        force=np.array(data["force"], dtype=np.float32),
        approach=float(data["approach"]),
        doubts=tuple(map(str, data.get("doubts", ()))),
        worn=np.array(data.get("worn", ()), dtype=float),
    )
    return outcome.index, outcome


SHOT_LOG = LogForm(
    file="shots.unfinished.jsonl",
    format="klack shots 1",
    parts="finished shots",
    data=_data,
    read=_outcome,
)
"""How finished shots are kept."""
shot_log = SHOT_LOG.open
