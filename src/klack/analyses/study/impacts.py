"""Impacts of two bodies as points of a study.

Most of an impact holds the interpreter, so that threads compute one point at a time.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from klack.analyses.contact_doubts import contact_doubt
from klack.analyses.impact.given_models import require_given_levels
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import ImpactBodies, impact_bodies, impact_of_bodies, run_impact
from klack.analyses.impact.summary import no_estimate
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.source import impact_sources
from klack.analyses.study.asked_points import AskedPoints, PointGroup, Taken, require_same_for_all
from klack.analyses.study.chosen_measures import ChosenMeasure, PointNoise
from klack.analyses.study.impact_measures import ImpactOfPoint, impact_measures
from klack.analyses.study.point_row import PointRow, doubts_in, others_in
from klack.analyses.threads import Stopped, never_stopped
from klack.case.case_tree import CaseTree
from klack.case.points import PointKey, case_at
from klack.case.schema import Case
from klack.case.study import CaseStudy
from klack.errors import InputError
from klack.input.problem import Key
from klack.progress import Progress
from klack.signals import TimeSeries

__all__ = ["IMPACTS"]

_ASIDE = ("run", "lumped", "shots", "measurement", "noise", "study", "title", "description")
"""Sections that bodies and modes do not depend on."""
_OF_THE_IMPACT = (
    ("motion", "speed"),
    ("motion", "force"),
    ("motion", "spring"),
    ("contact", "local_law"),
    ("contact", "reach"),
    ("reduction", "correction"),
)
"""Keys of an impact of the same bodies."""


@dataclass(frozen=True, slots=True, eq=False)
class _Built:
    """Bodies of a group; None where every impact builds its own: in full, and of given models."""

    bodies: ImpactBodies | None


class _Impacts:
    """See :class:`~klack.analyses.study.asked_points.PointKind`."""

    builds = 2  # each with its factorisations

    def asked_variant(self, study: CaseStudy) -> str | None:
        """The level of the study."""
        if study.variant is not None:
            raise InputError(
                "variant",
                got=f"'{study.variant}' in the study of an impact",
                expected="a level; variants are of strokes",
                hint="write level: reduced, or leave it out.",
            )
        return study.level

    def variant(self, case: Case, name: str | None) -> str:
        """The level ``reduced`` by default."""
        (level,) = case.require_levels([name or "reduced"])
        if not case.has_surfaces:
            require_given_levels(case, [level])
        return level

    def measures(self, case: Case, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
        """Of a level, and of its noise."""
        return impact_measures(case, names)

    def require_keys(self, keys: Iterable[PointKey]) -> None:
        """All but the levels."""
        hint = "write level: interface in the study, and compute two of them."
        require_same_for_all(keys, ("run", "levels"), "level", hint)

    def makes_bodies(self, case: Case, place: Key) -> bool:
        """Whether meshes, places or modes may follow from what stands there.

        The static contact, the pressure pattern and the law follow from speed and forces, and are
        those of each point.  An upper stop is built for the energy of one impact.
        """
        if place[0] in _ASIDE:
            return place[:2] == ("run", "transfer")  # takes more modes
        if case.opposite is not None:
            return True
        is_damping = place[0] == "bodies" and place[2:3] == ("damping",)
        return not (is_damping or place[:2] in _OF_THE_IMPACT)

    def holds_interpreter(self, asked: AskedPoints[Case]) -> bool:
        """Nearly all of the time."""
        return True

    def build(
        self,
        asked: AskedPoints[Case],
        group: PointGroup,
        tree: CaseTree,
        case: Case,
        progress: Progress,
    ) -> _Built:
        """Bodies and modes."""
        if asked.variant == "full" or not case.has_surfaces:
            return _Built(None)
        bodies = impact_bodies(case, levels=(asked.variant,), progress=progress, threads=1)
        bodies.placed.keep_no_more()
        return _Built(bodies)

    def close(self, built: _Built) -> None:
        """Free the factorisations."""
        if built.bodies is not None:
            built.bodies.close()

    def crew(
        self,
        asked: AskedPoints[Case],
        built: _Built,
        places: Sequence[int],
        threads: int | None,
    ) -> int:
        """One: they share the bodies, and hold the interpreter."""
        return 1

    def row(
        self,
        asked: AskedPoints[Case],
        built: _Built,
        place: int,
        check: Callable[[], None],
        taken: Taken,
    ) -> PointRow:
        """Compute one point."""
        try:
            study, run = _impact(asked, built, place, check)
            values = tuple(item.value(run) for item in asked.chosen)
        except Stopped:
            raise
        except Exception as error:  # one point less, as the caller says
            return replace(asked.failed(error), others=others_in(taken()))
        caught = taken()
        notes = [*study.warnings, contact_doubt(study.contact), no_estimate(study)]
        notes += [_other_answer(study, asked.variant), *run.noise.notes, *doubts_in(caught)]
        return PointRow(
            values,
            notes=tuple(dict.fromkeys(filter(None, notes))),
            others=others_in(caught),
            model=_model(study, asked.variant),
        )

    def pressure(self, asked: AskedPoints[Case], built: _Built, place: int) -> TimeSeries | None:
        """Sound of a click."""
        return _impact(asked, built, place, never_stopped)[1].noise.pressure


IMPACTS = _Impacts()
"""Impacts of a case of two bodies."""


def _impact(
    asked: AskedPoints[Case], built: _Built, place: int, check: Callable[[], None]
) -> tuple[ImpactStudy, ImpactOfPoint]:
    """Impact of a point."""
    case = case_at(Case, asked.tree, asked.tree, asked.points.changes(place))
    levels = case.require_levels((asked.variant,))

    def progress(stage: str, fraction: float) -> None:
        check()

    if built.bodies is None:
        study = run_impact(case, levels=levels, progress=progress, threads=1)
    else:
        study = impact_of_bodies(case, built.bodies, levels=levels, progress=progress)
    noise = PointNoise(lambda: impact_sources(study, levels, case)[0], Transfers())
    return study, ImpactOfPoint(study.levels[asked.variant], noise)


def _other_answer(study: ImpactStudy, level: str) -> str:
    """Warning that a single impact would answer with another level; empty if it would not."""
    if study.reference == level:
        return ""
    return (
        f"the numbers of this point are those of level '{level}', the answer of a single impact "
        f"would be that of level '{study.reference}'. Try: level: {study.reference} in the study."
    )


def _model(study: ImpactStudy, level: str) -> str:
    """Level, modes and law, and the meshes of the bodies."""
    meshes = (f"{body.name} {body.nodes} nodes" for body in study.bodies if body.nodes)
    return "; ".join(filter(None, (study.levels[level].label, ", ".join(meshes))))
