"""One stroke of many."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from klack.analyses.noise.measures import DESIGN_MEASURES
from klack.analyses.noise.run import noise_design
from klack.analyses.noise.source import stroke_sources
from klack.analyses.shots.draw import drawn_face_friction, drawn_friction, drawn_position, polar
from klack.analyses.stroke.analysis import first_impact
from klack.analyses.stroke.delivery import unfinished
from klack.analyses.stroke.missing import rest_note
from klack.analyses.stroke.record import StopSummary, StrokeVariant
from klack.analyses.stroke.run import VariantRun, one_variant, study_of_run
from klack.analyses.stroke_shots.record import StopColumns, StrokeColumns
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.assembling.body_summary import BodySummary
from klack.assembling.spatial import placed_bodies, placement_of, seat_height
from klack.assembling.valve import Valve
from klack.case.levels import Variant
from klack.case.shots import StrokeShots
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles
from klack.contact.friction import Friction
from klack.errors import ConvergenceError, InputError, KlackError, refuse_if
from klack.machine.progress import silent
from klack.machine.stages import collected_warnings
from klack.mesh.rigid import rigid_placement
from klack.simulation.network_result import ImpactEvent, NetworkResult
from klack.simulation.spatial_impact import SpatialPath
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel
from klack.transient.spatial_run import SpatialValve

__all__ = [
    "CENTRED",
    "STROKE_LOG",
    "Starts",
    "StrokeKey",
    "StrokeLog",
    "StrokeOutcome",
    "StrokeSetup",
    "StrokeStart",
    "StrokeTask",
    "rebound_height",
    "run_one_stroke",
    "shots_of_valve",
    "strokes_mark",
]


Vector = NDArray[np.float64]

CENTRED = -1
"""Number of the stroke that starts centred and upright."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrokeStart:
    """Start of one stroke.

    Parameters
    ----------
    aside (2,) [m]
        Axis of the needle at the height of its seat.
    lean (2,) [rad]
        Slope of that axis, towards x and y.
    placement (6,) [m], [rad]
        The same as translation of the centre of mass and rotation vector, with the turn about the
        axis that friction in guides leaves; then those of the bodies that move beside the needle.
    friction [-]
        Coefficient of Coulomb friction in the guide.
    contact_friction [-]
        That between the faces of all stops; nan: each has that of the case.
    """

    index: int
    aside: Vector
    lean: Vector
    placement: Vector
    friction: float
    contact_friction: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Starts:
    """Draws the starts of the strokes of a case.

    ``height`` [m] is that of the seat in the drawing of the needle, ``centres`` (3,) [m] the
    centres of mass of the bodies that move, the needle first.
    """

    case: ValveCase
    seed: int
    height: float
    centres: Mapping[str, Vector]

    @property
    def centre(self) -> Vector:
        """Centre of mass of the needle as drawn (3,) [m]."""
        return next(iter(self.centres.values()))

    @classmethod
    def of(cls, valve: Valve, needle: str, seed: int) -> "Starts":
        """Starts for a valve with this needle."""
        return cls(
            case=valve.case,
            seed=seed,
            height=seat_height(valve.contacts, needle),
            centres={needle: valve.bodies[needle].centre_in_space}
            | {n: body.centre_in_space for n, body in valve.bodies.items() if not body.is_fixed},
        )

    def drawn(self, index: int) -> StrokeStart:
        """Start of an independent stroke, or of the first one of a row.

        It depends on the seed and on its number alone.  InputError when the guide leaves no room
        for the stated eccentricity and tilt.
        """
        if self.case.placement is not None:
            position = placement_of(self.case, self.height)
        else:
            shots = shots_of_valve(self.case)
            position = drawn_position(self.case, shots, self.seed, index, self.height)
        return self._at(index, *position, self.friction(index))

    def centred(self) -> StrokeStart:
        """Centred and upright, without friction in the guide, which it does not touch."""
        return self._at(CENTRED, np.zeros(2), np.zeros(2), 0.0)

    def contact_friction(self, index: int) -> float:
        """Friction coefficient of the faces, the mean in the centred stroke."""
        shots = shots_of_valve(self.case)
        if index == CENTRED and shots.contact_friction is not None:
            return shots.contact_friction.mean
        return drawn_face_friction(shots, self.seed, max(index, 0))

    def after(self, index: int, end: Vector) -> StrokeStart:
        """Start of a stroke where the one before has left the needle across its axis.

        ``end`` (6,) [m], [rad] is the translation of its centre of mass and its rotation vector
        there.
        """
        lean = np.array([end[4], -end[3]])
        aside = end[:2] + (self.height - self.centre[2]) * lean
        return self._at(index, aside, lean, self.friction(index), float(end[5]))

    def friction(self, index: int) -> float:
        """Friction coefficient of the guide in a stroke."""
        return drawn_friction(self.case, shots_of_valve(self.case), self.seed, index)

    def _at(
        self, index: int, aside: Vector, lean: Vector, friction: float, turn: float = 0.0
    ) -> StrokeStart:
        about = np.array([0.0, 0.0, self.height])
        placement = rigid_placement(aside, lean, about, self.centre)
        placement[5] = turn
        seed = None if index == CENTRED else [self.seed, index]
        return StrokeStart(
            index=index,
            aside=aside,
            lean=lean,
            placement=placed_bodies(self.case, placement, self.centres, seed),
            friction=friction,
            contact_friction=self.contact_friction(index),
        )


def shots_of_valve(case: ValveCase) -> StrokeShots:
    """Section ``shots`` of the case of a valve.

    InputError for a motion along the axis, in which all strokes are alike.
    """
    where = str(case.path or "case")
    refuse_if(
        case.motion == "axial",
        f"{where}: motion",
        got="'axial' in klack shots",
        expected="motion: three-dimensional, or the case of an impact: along the axis all "
        "strokes are equal",
        hint="set 'motion: three-dimensional', add 'guide' and 'shots: {count: 50}'.",
    )
    if case.shots is None:
        raise InputError(
            f"{where}: shots",
            got="no section 'shots'",
            expected="the number of strokes, and the quantities that vary from stroke to stroke",
            hint="add 'shots: {count: 50}' and a 'guide', and remove 'placement'.",
        )
    return case.shots


Numbers = dict[str, float]

_TRACE_POINTS = 600
_AT_REST = 0.01  # [m/s] of the centre of mass: a bounce of 5 um under 10 g
_NAN = float("nan")
_CHECKED = (CENTRED, 0)
"""Strokes whose steps are checked: others of the same valve depend on theirs as much."""
_ENERGIES = {
    measure.key: measure
    for measure in DESIGN_MEASURES
    if measure.key in ("injected_energy", "radiated_energy")
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrokeSetup:
    """Shared by all strokes, sent to each process once; no meshes and contacts."""

    valve: Valve
    spatial: SpatialValve
    roles: ValveRoles
    bodies: tuple[BodySummary, ...]
    stops: tuple[StopSummary, ...]

    @property
    def trace_time(self) -> Vector:
        """Times at which the lift is kept [s]."""
        return np.linspace(0.0, self.valve.case.run.duration, _TRACE_POINTS + 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrokeTask:
    """Variant and start of a stroke."""

    variant: Variant
    start: StrokeStart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrokeOutcome:
    """Result of one stroke: ``stroke`` and ``stops`` have the numbers of their columns.

    ``end`` (6,) [m], [rad], where it leaves the needle, is translation of the centre of mass and
    rotation vector.  ``failure`` says why it ended early; ``doubts`` come from whichever process.
    """

    variant: str
    label: str
    index: int
    stroke: Numbers
    stops: dict[str, Numbers]
    lift: NDArray[np.float32]
    end: Vector
    failure: str = ""
    doubts: tuple[str, ...] = ()


def run_one_stroke(setup: StrokeSetup, task: StrokeTask) -> StrokeOutcome:
    """Compute and measure one stroke, on one thread."""
    start, spatial = task.start, setup.spatial
    spatial = replace(
        spatial,
        placement=start.placement,
        guide=_guide(spatial, start.friction),
        model=_faces(spatial, start),
    )
    valve = replace(setup.valve, spatial=spatial)
    with collected_warnings() as doubts, threadpool_limits(limits=1, user_api="blas"):
        try:
            check = start.index in _CHECKED
            run = one_variant(valve, setup.roles, task.variant, silent, check=check)
        except ConvergenceError as error:  # before the first record
            return _nothing(setup, task, str(error))
        energies, notes = _energies(valve, setup, task.variant, run)
    result = run.variant.result
    path = result.path or SpatialPath()
    paths = result.paths or (path,)
    stops = {
        stop: _stop_numbers(
            run.variant, stop, paths[pair.mover], float(arm[2]), above=not pair.is_upper
        )
        for stop, arm, pair in zip(spatial.stops, spatial.arms, spatial.pairings, strict=True)
    }
    begun = result.start.notes if result.start is not None else ()
    rest = rest_note(task.variant, result, setup.roles)
    unrest = "" if start.index == CENTRED else _unrest(setup, result, path)
    flowing = unfinished(item for item in run.variant.ways_out if item.left > 0.0)
    return StrokeOutcome(
        variant=task.variant,
        label=run.variant.label,
        index=start.index,
        stroke=_stroke_numbers(start, run.variant, energies, spatial.stops),
        stops=stops,
        lift=_lift(setup, result),
        end=path.position[-1],
        failure=" ".join(str(run.failure).split()) if run.failure is not None else "",
        doubts=tuple(
            dict.fromkeys([*doubts, *notes, *begun, *filter(None, (rest, unrest)), *flowing])
        ),
    )


def _guide(spatial: SpatialValve, friction: float) -> Guide | None:
    """Guides with this friction coefficient [-] at the heights of the needle."""
    guide = spatial.guide
    if guide is None:
        return None
    own = np.array(spatial.guided) == 0
    return guide._replace(friction=np.where(own, friction, guide.friction))


def _faces(spatial: SpatialValve, start: StrokeStart) -> InterfaceModel:
    model = spatial.model
    if np.isnan(start.contact_friction):
        return model
    return replace(model, friction=(Friction.coulomb(start.contact_friction),) * len(spatial.stops))


def _nothing(setup: StrokeSetup, task: StrokeTask, failure: str) -> StrokeOutcome:
    return StrokeOutcome(
        variant=task.variant,
        label=task.variant,
        index=task.start.index,
        stroke={**dict.fromkeys(StrokeColumns.keys(), _NAN), **_started(task.start)},
        stops={stop: dict.fromkeys(StopColumns.keys(), _NAN) for stop in setup.spatial.stops},
        lift=np.full(_TRACE_POINTS + 1, np.nan, dtype=np.float32),
        end=np.full(6, np.nan),
        failure=" ".join(failure.split()),
    )


# --------------------------------------------------------------------------- the whole of it


def _started(start: StrokeStart) -> Numbers:
    eccentricity, direction = polar(start.aside)
    tilt, tilt_direction = polar(start.lean)
    return {
        "eccentricity": eccentricity,
        "direction": direction,
        "tilt": tilt,
        "tilt_direction": tilt_direction,
        "friction": start.friction,
        "contact_friction": start.contact_friction,
    }


def _stroke_numbers(
    start: StrokeStart, variant: StrokeVariant, energies: Numbers, stops: Sequence[str]
) -> Numbers:
    result, times = variant.result, (variant.opening_time, variant.closing_time)
    opening, closing = (_NAN if time is None else float(time) for time in times)
    lost = [event.energy_loss for event in result.events]
    losses = result.books.losses
    rubbed = [losses[f"{stop} friction"] for stop in stops if f"{stop} friction" in losses]
    return {
        **_started(start),
        "opening_time": opening,
        "closing_time": closing,
        "impacts": float(len(result.events)),
        "impact_loss": float(np.nansum(lost)) if lost else 0.0,
        "guide_loss": float(result.books.losses.get("guide friction", 0.0)),
        "faces_loss": float(sum(rubbed)) if rubbed else _NAN,
        **energies,
        "delivered_mass": _NAN if variant.delivered_mass is None else variant.delivered_mass,
        "energy_residual": float(result.books.relative_residual),
    }


def _energies(
    valve: Valve, setup: StrokeSetup, variant: Variant, run: VariantRun
) -> tuple[Numbers, list[str]]:
    found = dict.fromkeys(_ENERGIES, _NAN)
    if run.failure is not None:
        return found, []
    try:
        study = study_of_run(valve, setup.roles, variant, run, setup.bodies, setup.stops)
        source = stroke_sources(study, case=valve.case)[0]
        design = noise_design(source)
    except KlackError as error:  # the other numbers stand
        return found, [f"structure-borne energy: {error}"]
    for key, measure in _ENERGIES.items():
        value = measure.read(design)
        if value is not None and (key != "radiated_energy" or valve.case.noise is not None):
            found[key] = float(value)
    return found, list(source.notes)


def _lift(setup: StrokeSetup, result: NetworkResult) -> NDArray[np.float32]:
    channel = result.channels[f"{setup.roles.needle}.{setup.roles.point} displacement"]
    trace = np.interp(setup.trace_time, result.time, channel.values, right=np.nan)
    return trace.astype(np.float32)


def _unrest(setup: StrokeSetup, result: NetworkResult, path: SpatialPath) -> str:
    """Doubt about the next start: this stroke does not end at rest on the seat."""
    shots, seat = setup.valve.case.shots, setup.roles.seat
    if shots is None or not shots.carry or result.failure:
        return ""
    pressed = result.channels.get(f"{seat} contact force")
    speed = float(np.linalg.norm(path.velocity[-1][:3]))
    if pressed is not None and pressed.values[-1] > 0.0 and speed < _AT_REST:
        return ""
    return (
        f"the needle is not at rest on its seat at the end, it moves at {speed:.2g} m/s; the next "
        "stroke starts at rest from its position. Try: a longer run.duration."
    )


# --------------------------------------------------------------------------- first impact


def _stop_numbers(
    variant: StrokeVariant, stop: str, path: SpatialPath, arm: float, *, above: bool
) -> Numbers:
    """First impact on a stop ``arm`` [m] above the centre of mass."""
    event, side = first_impact(variant, stop), -1.0 if above else 1.0
    if event is None:
        return {
            **dict.fromkeys(StopColumns.keys(), _NAN),
            "impacts": float(len(variant.impacts(stop))),
        }
    at = path.position_at(np.array([event.time]))[0]
    lean = np.array([at[4], -at[3]])
    eccentricity, direction = polar(at[:2] + arm * lean)
    tilt, tilt_direction = polar(lean)
    return {
        "eccentricity": eccentricity,
        "direction": direction,
        "tilt": tilt,
        "tilt_direction": tilt_direction,
        "approach_speed": event.approach_speed,
        "peak_force": event.peak_force,
        "contact_time": event.contact_time,
        "impulse": event.impulse,
        "restitution": event.restitution,
        "rebound_height": rebound_height(variant.result.events, event, path, side),
        "energy_loss": event.energy_loss,
        "impacts": float(sum(item.time >= event.time for item in variant.impacts(stop))),
    }


def rebound_height(
    events: Sequence[ImpactEvent], event: ImpactEvent, path: SpatialPath, side: float
) -> float:
    """Farthest turn [m] of the centre of mass from a stop before another is touched.

    From the place at first touch of an impact; 0 where the needle comes to rest there, nan where it
    does not turn, or still moves away at the end.  ``events`` are those of the whole stroke;
    ``side`` is 1 for a stop below the needle, -1 for one above.
    """
    others = [e.time for e in events if e.time > event.time and e.stop != event.stop]
    until = min(others, default=float(path.time[-1]))
    z = scipy.interpolate.CubicHermiteSpline(path.time, path.position[:, 2], path.velocity[:, 2])
    turns = z.derivative().roots(extrapolate=False)
    turns = turns[(turns > event.time) & (turns < until)]
    away = side * (z(np.append(turns, until)) - z(event.time))
    highest = float(np.max(away[:-1], initial=0.0))
    if highest == 0.0:
        return 0.0 if event.restitution == 0.0 else _NAN
    if not others and away[-1] > highest:  # it still rises
        return _NAN
    return highest


StrokeKey = tuple[str, int]
"""Variant and number of a stroke."""
StrokeLog = UnfinishedLog[StrokeKey, StrokeOutcome]


def strokes_mark(case: ValveCase, seed: int, threads: int | None) -> str:
    """Digest of all that decides the numbers of a stroke."""
    files = (path.read_bytes() for path in case.component_files.values())
    own = (f"{name} {digest}".encode() for name, digest in case.own_components.items())
    run = case.run.model_dump_json().encode()
    return fingerprint(case, (run, str(seed).encode(), str(threads).encode(), *own, *files))


def _data(key: StrokeKey, outcome: StrokeOutcome) -> Mapping[str, Any]:
    return {
        "variant": outcome.variant,
        "label": outcome.label,
        "index": outcome.index,
        "stroke": outcome.stroke,
        "stops": outcome.stops,
        "lift": outcome.lift.tolist(),
        "end": outcome.end.tolist(),
        "failure": outcome.failure,
        "doubts": list(outcome.doubts),
    }


def _outcome(data: Mapping[str, Any]) -> tuple[StrokeKey, StrokeOutcome]:
    outcome = StrokeOutcome(
        variant=str(data["variant"]),
        label=str(data["label"]),
        index=int(data["index"]),
        stroke={str(key): float(value) for key, value in data["stroke"].items()},
        stops={
            str(stop): {str(key): float(value) for key, value in numbers.items()}
            for stop, numbers in data["stops"].items()
        },
        lift=np.array(data["lift"], dtype=np.float32),
        end=np.array(data["end"], dtype=float),
        failure=str(data["failure"]),
        doubts=tuple(map(str, data["doubts"])),
    )
    return (outcome.variant, outcome.index), outcome


STROKE_LOG = LogForm(
    file="strokes.unfinished.jsonl",
    format="klack strokes 1",
    parts="finished strokes",
    data=_data,
    read=_outcome,
)
"""How finished strokes are kept."""
