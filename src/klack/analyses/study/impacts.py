"""Impacts and shots of two bodies as points of a study.

What the measures ask for is computed: one impact at the level of the study, many shots at the
interface level, or both.  Every point draws its shots with the seed of the case, so that two
designs differ by what they are and not by their luck.

Most of it holds the interpreter, so that threads compute one point at a time.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

from klack.analyses.contact_doubts import contact_doubt
from klack.analyses.impact.analysis import no_estimate
from klack.analyses.impact.given_models import require_given_levels
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import ImpactBodies, impact_bodies, impact_of_bodies, run_impact
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.source import impact_sources
from klack.analyses.shots.draw import shots_of
from klack.analyses.shots.model import shot_bodies, shot_model
from klack.analyses.shots.one_shot import shot_log
from klack.analyses.shots.run import drop_shots, shot_doubts
from klack.analyses.study.asked_points import (
    AskedPoints,
    PointGroup,
    PointKind,
    PointRow,
    Taken,
    doubts_in,
    others_in,
)
from klack.analyses.study.computing import Stopped, never_stopped
from klack.analyses.study.measures import (
    SHOTS,
    ChosenMeasure,
    ImpactOfPoint,
    PointNoise,
    impact_measures,
    shot_notes,
)
from klack.case.any_case import CaseTree
from klack.case.points import case_at
from klack.case.schema import Case
from klack.case.study import CaseStudy
from klack.errors import refuse_if
from klack.input.problem import Key
from klack.machine.progress import Progress
from klack.signals.sampled import TimeSeries

__all__ = ["IMPACTS"]

_ASIDE = (
    *("run", "lumped", "guide", "shots"),
    *("measurement", "noise", "study", "title", "description"),
)
_OF_THE_IMPACT = (
    ("motion", "speed"),
    ("motion", "force"),
    ("motion", "spring"),
    ("contact", "local_law"),
    ("contact", "reach"),
    ("contact", "friction"),
    ("contact", "static_friction"),
    ("contact", "stribeck_speed"),
    ("reduction", "correction"),
)


@dataclass(frozen=True, slots=True, eq=False)
class _Built:
    """Bodies of a group.

    ``bodies`` of the impact are None where every impact builds its own (in full, and of given
    models); those of ``shots`` start centred and in first touch.  Either is None without a measure
    of it.
    """

    bodies: ImpactBodies | None
    shots: ImpactBodies | None


class _Impacts(PointKind[Case, _Built]):
    builds = 2  # each with its factorisations
    same = (
        ("run", "levels"),
        "level",
        "write level: interface in the study, and compute two of them.",
    )

    def asked_variant(self, study: CaseStudy) -> str | None:
        refuse_if(
            study.variant is not None,
            "variant",
            got=f"'{study.variant}' in the study of an impact",
            expected="a level; only strokes have variants",
            hint="write level: reduced, or leave the variant out.",
        )
        return study.level

    def variant(self, case: Case, name: str | None, chosen: Sequence[ChosenMeasure]) -> str:
        """Level, ``reduced`` by default, if a measure takes an impact; and shots."""
        (level,) = case.require_levels([name or "reduced"])
        if not case.has_surfaces:
            require_given_levels(case, [level])
        of_shots = [item.of == SHOTS for item in chosen]
        return _WITH.join([level] * (not all(of_shots)) + [SHOTS] * any(of_shots))

    def measures(self, case: Case, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
        return impact_measures(case, names)

    def makes_bodies(self, case: Case, place: Key) -> bool:
        """Whether meshes, places or modes may follow from what stands there.

        Each point has its own static contact, pressure pattern and law, which follow from speed,
        forces and friction, contact points of shots, which follow from their distributions too, and
        guide.  An upper stop is built for the energy of one impact.
        """
        if place[0] in _ASIDE:
            return place[:2] == ("run", "transfer")  # takes more modes
        if case.opposite is not None or case.backing is not None:
            return True
        is_damping = place[0] == "bodies" and place[2:3] == ("damping",)
        return not (is_damping or place[:2] in _OF_THE_IMPACT)

    def build(
        self,
        asked: AskedPoints[Case],
        group: PointGroup,
        tree: CaseTree,
        case: Case,
        progress: Progress,
    ) -> _Built:
        level = _level(asked)
        with ExitStack() as opened:
            bodies = shots = None
            if level not in ("", "full") and case.has_surfaces and case.backing is None:
                bodies = impact_bodies(case, levels=(level,), progress=progress, threads=1)
                opened.enter_context(bodies).placed.keep_no_more()
            if asked.variant.rpartition(_WITH)[2] == SHOTS:
                shots = shot_bodies(case, progress, threads=1)
                opened.enter_context(shots).placed.keep_no_more()
            opened.pop_all()
        return _Built(bodies, shots)

    def close(self, built: _Built) -> None:
        for bodies in (built.bodies, built.shots):
            if bodies is not None:
                bodies.close()

    def row(
        self,
        asked: AskedPoints[Case],
        built: _Built,
        place: int,
        check: Callable[[], None],
        taken: Taken,
    ) -> PointRow:
        try:
            found = _point(asked, built, place, check)
            values = tuple(item.value(found.run) for item in asked.chosen)
        except Stopped:
            raise
        except Exception as error:  # one point less, as the caller says
            return replace(asked.failed(error), others=others_in(taken()))
        caught = taken()
        notes = [*found.notes, *doubts_in(caught)]
        if found.run.noise is not None:
            notes += found.run.noise.notes
        return PointRow(
            values,
            notes=tuple(dict.fromkeys(filter(None, notes))),
            others=others_in(caught),
            model=found.model,
        )

    def pressure(self, asked: AskedPoints[Case], built: _Built, place: int) -> TimeSeries | None:
        noise = _point(asked, built, place, never_stopped).run.noise
        return None if noise is None else noise.pressure


IMPACTS = _Impacts()
"""Impacts and shots of a case of two bodies."""

_WITH = " + "


def _level(asked: AskedPoints[Case]) -> str:
    return asked.variant.partition(_WITH)[0] if asked.variant != SHOTS else ""


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """What a point was computed to.

    ``models`` are levels with their modes and laws, ``meshes`` bodies and their nodes.  Notes are
    doubts; an empty one is none.
    """

    run: ImpactOfPoint
    notes: tuple[str, ...]
    models: tuple[str, ...]
    meshes: tuple[tuple[str, int], ...]

    @property
    def model(self) -> str:
        meshes = ", ".join(f"{name} {nodes} nodes" for name, nodes in self.meshes)
        return "; ".join(filter(None, (*self.models, meshes)))

    def with_shots(self, other: "_Point") -> "_Point":
        return _Point(
            replace(self.run, shots=other.run.shots),
            (*self.notes, *other.notes),
            (*self.models, *other.models),
            self.meshes,
        )


def _point(
    asked: AskedPoints[Case], built: _Built, place: int, check: Callable[[], None]
) -> _Point:
    case = case_at(Case, asked.tree, asked.tree, asked.points.changes(place))
    level, progress = _level(asked), lambda stage, fraction: check()
    if built.shots is None:
        return _impact(case, built.bodies, level, progress)
    names = [item.name for item in asked.chosen if item.of == SHOTS]
    if not level:
        return _shots(case, built.shots, names, progress)
    impact = _impact(case, built.bodies, level, progress)
    return impact.with_shots(_shots(case, built.shots, names, progress))


def _impact(case: Case, bodies: ImpactBodies | None, level: str, progress: Progress) -> _Point:
    levels = case.require_levels((level,))
    if bodies is None:
        study = run_impact(case, levels=levels, progress=progress, threads=1)
    else:
        study = impact_of_bodies(case, bodies, levels=levels, progress=progress)
    noise = PointNoise(lambda: impact_sources(study, levels, case)[0], Transfers())
    return _Point(
        ImpactOfPoint(level=study.levels[level], noise=noise),
        (
            *study.warnings,
            contact_doubt(study.contact),
            no_estimate(study),
            _other_answer(study, level),
        ),
        (study.levels[level].label,),
        tuple((body.name, body.nodes) for body in study.bodies if body.nodes),
    )


def _shots(case: Case, bodies: ImpactBodies, names: list[str], progress: Progress) -> _Point:
    given, model = shots_of(case), shot_model(case, bodies, progress)
    with shot_log(None, "") as log:
        found = drop_shots(case, model, given.count, given.seed, 1, log, progress)
    notes = (*model.notes, *shot_doubts(case, found), *shot_notes(names, found))
    pair = bodies.placed.pair
    modes = " + ".join(map(str, model.modes))
    return _Point(
        ImpactOfPoint(shots=found),
        notes,
        (f"shots at the interface level, {modes} modes",),
        tuple((body.name, body.mesh.node_count) for body in (pair.upper, pair.lower)),
    )


def _other_answer(study: ImpactStudy, level: str) -> str:
    """Warning that a single impact would answer with another level."""
    if study.reference == level:
        return ""
    return (
        f"the numbers of this point come from level '{level}', but the answer of a single impact "
        f"would come from level '{study.reference}'. Try: level: {study.reference} in the study."
    )
