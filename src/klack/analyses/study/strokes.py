"""Strokes of a valve as points of a study.

The time loop runs outside of the interpreter, so that threads share meshes, modes and laws.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from klack.analyses.noise.body import Transfers
from klack.analyses.noise.source import NoiseSource, stroke_sources
from klack.analyses.stroke.delivery import unfinished
from klack.analyses.stroke.missing import rest_note
from klack.analyses.stroke.record import StopSummary, StrokeVariant
from klack.analyses.stroke.run import (
    body_summaries,
    one_variant,
    stop_summaries,
    study_of_run,
    variant_network,
)
from klack.analyses.study.asked_points import (
    UNCHECKED,
    AskedPoints,
    PointGroup,
    PointKind,
    PointRow,
    PointSteps,
    Taken,
    doubts_in,
    others_in,
)
from klack.analyses.study.computing import Stopped, never_stopped
from klack.analyses.study.measures import (
    ChosenMeasure,
    PointNoise,
    StrokeOfPoint,
    stroke_measures,
    told_until,
)
from klack.assembling.body_summary import BodySummary
from klack.assembling.bolts import opening_doubts
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.case.any_case import CaseTree
from klack.case.placed_errors import tells_place
from klack.case.points import PointValue, case_at, checked_parts
from klack.case.study import CaseStudy
from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP, FLEXIBLE_BODY, ValveRoles, find_roles
from klack.errors import AccuracyWarning, KlackError, refuse_if
from klack.input.problem import Key
from klack.machine.cores import available_cores
from klack.machine.memory import require_memory
from klack.machine.progress import Progress
from klack.machine.stages import collected_warnings
from klack.signals.sampled import TimeSeries
from klack.simulation.network_recorder import recorded_columns
from klack.simulation.network_run import has_python_steps

__all__ = ["STROKES"]

_AROUND = 50e6  # [byte] of a run beside its records
_FINE, _MOST_FINE = 80.0, 1e6  # [byte] of a step with contact, and how many of them are kept
_ASIDE = (
    *("run", "lumped", "shots", "noise", "study", "measurement", "calibration"),
    *("title", "description"),
)
_RADIATING = ("noise", "surfaces")
"""but for these surfaces of bodies."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Built:
    """Bodies and laws of a group.

    Parameters
    ----------
    tree
        With the values ``made`` of the group.
    parts
        The same, checked where no point changes it.
    valve
        Of one point, without meshes.
    notes
        Doubts about bodies and laws.
    transfers
        Of the bodies to the sound.
    """

    made: Mapping[Key, PointValue]
    tree: CaseTree
    parts: CaseTree
    valve: Valve
    bodies: tuple[BodySummary, ...]
    stops: tuple[StopSummary, ...]
    notes: tuple[str, ...]
    transfers: Transfers = field(default_factory=Transfers)


class _Strokes(PointKind[ValveCase, _Built]):
    builds = 8
    same = (
        ("run", "variants"),
        "variant",
        'write variant="dry", and compute two tables.',
    )

    def asked_variant(self, study: CaseStudy) -> str | None:
        refuse_if(
            study.level is not None,
            "level",
            got=f"'{study.level}' in the study of a whole valve",
            expected="a variant; only impacts have levels",
            hint="write variant: wet.",
        )
        return study.variant

    def variant(self, case: ValveCase, name: str | None, chosen: Sequence[ChosenMeasure]) -> str:
        return case.one_variant(name)

    def measures(self, case: ValveCase, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
        return stroke_measures(case, names)

    def makes_bodies(self, case: ValveCase, place: Key) -> bool:
        """Whether meshes, modes or contact laws may follow from what stands there.

        They do from the damping of a body: the port pattern of a stop is that of an impact.
        """
        if place[0] != "network":
            return place[0] not in _ASIDE or place[:2] == _RADIATING
        if place[1:2] != ("components",):
            return False
        if len(place) < 4 or place[3] == "type":
            return True
        part = case.network.components[str(place[2])]
        if part.type == FLEXIBLE_BODY:
            return place[3] != "speed"
        if part.type != END_STOP:
            return False
        # in three dimensions the gap is that between the meshes
        return place[3] == "law" or (place[3] == "gap" and case.motion != "axial")

    def holds_interpreter(self, asked: AskedPoints[ValveCase]) -> bool:
        """Noise does, and a motion in three dimensions."""
        return asked.case.motion != "axial" or any(item.is_noise for item in asked.chosen)

    def build(
        self,
        asked: AskedPoints[ValveCase],
        group: PointGroup,
        tree: CaseTree,
        case: ValveCase,
        progress: Progress,
    ) -> _Built:
        with collected_warnings() as notes:
            valve = build_valve(case, progress, threads=1)
        places = [key.place for key in asked.points.keys if key.place not in group.made]
        return _Built(
            made=group.made,
            tree=tree,
            parts=checked_parts(tree, case, places),
            valve=Valve(
                case=case,
                bodies={},
                reduced={name: replace(b, recovery=None) for name, b in valve.reduced.items()},
                contacts={},
                laws=valve.laws,
                network=valve.network,
                structures=valve.structures,
                spatial=valve.spatial,
            ),
            bodies=body_summaries(valve),
            stops=stop_summaries(valve),
            notes=tuple(notes),
        )

    def crew(
        self,
        asked: AskedPoints[ValveCase],
        built: _Built,
        places: Sequence[int],
        threads: int | None,
    ) -> int:
        """One where the time loop is in Python."""
        crew = min(available_cores() if threads is None else threads, max(len(places), 1))
        for i in places:
            try:
                valve = _valve_at(asked, built, i)
                variant = valve.case.one_variant(asked.variant)
                rows = variant_network(valve, variant).rows()
            except KlackError:
                continue  # its row will say
            if has_python_steps(rows) or valve.spatial is not None:
                return 1
            run = valve.case.run
            records = run.duration / run.record
            steps = min(run.duration / run.fine_step, _MOST_FINE) * len(rows.interfaces)
            require_memory(
                "run_many: threads",
                crew * (8.0 * records * recorded_columns(rows) + _FINE * steps + _AROUND),
                what=f"{crew} strokes at a time, each of {records:.4g} records of "
                f"{recorded_columns(rows)} channels,",
                hint="use fewer threads, a longer record interval (run.record), or a shorter "
                "duration.",
            )
            return crew
        return crew

    def row(
        self,
        asked: AskedPoints[ValveCase],
        built: _Built,
        place: int,
        check: Callable[[], None],
        taken: Taken,
    ) -> PointRow:
        try:
            whole, steps, roles = _point_run(asked, built, place, check)
            values = tuple(item.value(whole) for item in asked.chosen)
        except Stopped:
            raise
        except BaseException as error:  # a component of the user's own may raise anything
            return replace(asked.failed(error), others=others_in(taken()))
        caught = taken()
        result = whole.variant.result
        begun = result.start.notes if result.start is not None else ()
        rest = rest_note(whole.variant.name, result, roles)
        notes = [*built.notes, *doubts_in(caught), *whole.noise.notes]
        notes += [note for note in begun if not any(note in other for other in notes)]
        notes += [rest] if rest else []
        notes += _unfinished(asked.chosen, whole)
        told = tuple(dict.fromkeys(notes))
        return PointRow(values, notes=told, others=others_in(caught), steps=steps)

    def pressure(
        self, asked: AskedPoints[ValveCase], built: _Built, place: int
    ) -> TimeSeries | None:
        return _point_run(asked, built, place, never_stopped)[0].noise.pressure


STROKES = _Strokes()
"""Strokes of a case of a whole valve."""


def _unfinished(chosen: Sequence[ChosenMeasure], run: StrokeOfPoint) -> Iterator[str]:
    """Doubts about what measures of flows count: it still flows at the end."""
    found = [item.part(run) for item in chosen if item.of == "delivery"]
    if any(item.name == "delivered_mass" for item in chosen):
        found += [item for item in run.variant.ways_out if item.left > 0.0]
    return unfinished(item for item in found if item is not None)


def _valve_at(asked: AskedPoints[ValveCase], built: _Built, i: int) -> Valve:
    changes = asked.points.changes(i)
    own = {place: value for place, value in changes.items() if place not in built.made}
    case = case_at(ValveCase, built.tree, built.parts, own)
    case.require_variants((asked.variant,))
    network = filled_network(case, built.valve.reduced, built.valve.laws)
    return replace(built.valve, case=case, network=network)


def _point_run(
    asked: AskedPoints[ValveCase], built: _Built, i: int, check: Callable[[], None]
) -> tuple[StrokeOfPoint, PointSteps, ValveRoles]:
    valve = _valve_at(asked, built, i)
    return _stroke_of(valve.case, valve, asked, built, check)


@tells_place
def _stroke_of(
    case: ValveCase,
    valve: Valve,
    asked: AskedPoints[ValveCase],
    built: _Built,
    check: Callable[[], None],
) -> tuple[StrokeOfPoint, PointSteps, ValveRoles]:
    roles = find_roles(case, valve.network)
    variant = case.one_variant(asked.variant)

    def source() -> NoiseSource:
        study = study_of_run(valve, roles, variant, run, built.bodies, built.stops)
        return stroke_sources(study, case=case)[0]

    def whole(found: StrokeVariant) -> StrokeOfPoint:
        return StrokeOfPoint(found, PointNoise(source, built.transfers))

    run = one_variant(
        valve,
        roles,
        variant,
        lambda stage, fraction: check(),
        check=asked.checks,
        until=lambda found: told_until(asked.chosen, whole(found)),
    )
    if run.failure is not None:
        raise run.failure
    for doubt in opening_doubts(case, (event.peak_force for event in run.variant.result.events)):
        warnings.warn(doubt, AccuracyWarning, stacklevel=2)
    steps = UNCHECKED
    if run.steps is not None:
        steps = PointSteps(*run.steps.certificate(case.run.accuracy))
    return whole(run.variant), steps, roles
