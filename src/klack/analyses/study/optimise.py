"""``klack optimise``: search the points of a study for those that no other one beats."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import case_fields, run_fields
from klack.analyses.study.columns import (
    measure_columns,
    parameter_columns,
    require_some,
    row_warnings,
)
from klack.analyses.study.evaluation import Evaluation
from klack.analyses.study.goals import Goals, bound_text, goals_of
from klack.analyses.study.log import point_log_form
from klack.analyses.study.points import Space, Values, require_varied, space_of
from klack.analyses.study.record import Optimum, StudyRecord
from klack.analyses.study.strokes import AskedPoints, PointRow
from klack.case.case_tree import CaseTree
from klack.case.points import PointValue
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.cores import available_cores
from klack.errors import InputError
from klack.progress import Progress, remark, silent
from klack.stages import StageClock, collected_warnings
from klack.studies.batches import Batches
from klack.studies.fronts import compromise, find_front
from klack.studies.refinement import Refinement, RefinementSettings
from klack.studies.search import Search, SearchSettings
from klack.studies.spread import Range

__all__ = ["run_optimisation"]

_EDGE = 1e-3
"""Share that points keep from the ends of a distribution without ends."""
_REFINED = 8
"""Most points of the front that are refined."""
_POLLS = 4
"""Rounds about each of them that have to fit into the points allowed."""


def run_optimisation(
    case: ValveCase,
    tree: CaseTree,
    source: StudySource,
    *,
    folder: Path | None = None,
    threads: int | None = None,
    progress: Progress = silent,
) -> StudyRecord:
    """Search for the best points of a study, and refine those of the front.

    The points depend on nothing but the study and the case: an interrupted search asks for the same
    points again and finds those that were computed.

    Parameters
    ----------
    case : ValveCase
    tree : CaseTree
        The same as it was written.
    source : StudySource
        With objectives.
    folder : Path, optional
        Where computed points are kept.
    threads : int, optional
    progress : callable

    Raises
    ------
    InputError
        Before the first run, with file, line and key; and if no point can be computed.
    MissingExtraError
        Without pymoo.
    """
    begin = perf_counter()
    space = space_of(case, source)
    require_varied(source, space.varied)
    clock = StageClock(progress)
    form, mark = point_log_form(case, tree)
    with form.open(folder, mark) as log, collected_warnings() as notes:
        work = _Work(case, tree, source, space, Evaluation(log, threads), clock)
        today = work.rows([{}])[0]
        asked = work.asked([{}])
        known = {item.name: item.measure for item in asked.chosen}
        front = _Front(goals_of(source, known, dict(zip(known, today.numbers, strict=True))))
        search = _search(source, space, front.goals)
        for cube in search:
            search.tell(*work.told(cube, front))
        require_some(source, work.found)
        if source.study.search.refinements:
            refinement = _refinement(source, work, front)
            if refinement is not None:
                for cube in refinement:
                    refinement.tell(*work.told(cube, front))
    columns = measure_columns(asked, work.found, today)
    parameters, linked = parameter_columns(space, work.values)
    units = {item.name: item.unit for item in columns}
    optimum = _optimum(front, search.settings.algorithm, source, units)
    return StudyRecord(
        **case_fields(case),
        **run_fields(begin, clock, "pymoo"),
        study_text="" if source.path == tree.path else source.path.read_text(encoding="utf-8"),
        variant=asked.variant,
        design=optimum.algorithm,
        threads=available_cores() if threads is None else threads,
        computed=work.evaluation.computed,
        kept=len(work.found) + 1 - work.evaluation.computed,
        point_time=work.evaluation.seconds,
        parameters=parameters,
        linked=linked,
        measures=columns,
        failures=tuple(row.failure for row in work.found),
        notes=tuple("\n".join(row.notes) for row in work.found),
        optimum=optimum,
        warnings=(*_doubts(optimum), *notes, *row_warnings(work.found, today, columns)),
    )


class _Work:
    """Points of a search in the order in which they were asked for, with their rows."""

    def __init__(
        self,
        case: ValveCase,
        tree: CaseTree,
        source: StudySource,
        space: Space,
        evaluation: Evaluation,
        progress: Progress,
    ) -> None:
        self._case, self._tree, self._source = case, tree, source
        self.space, self._progress = space, progress
        self.evaluation = evaluation
        self.values: list[Values] = []
        self.found: list[PointRow] = []
        self.cubes: list[NDArray[np.float64]] = []
        study = source.study
        wanted = (*study.measures, *study.objectives, *study.constraints)
        self._names = tuple(dict.fromkeys(wanted))
        self._most = study.search.population * study.search.generations + study.search.refinements
        self._best = ""

    def asked(self, written: Sequence[Mapping[str, PointValue]]) -> AskedPoints:
        """Points to compute.

        Raises
        ------
        InputError
            For a measure that does not exist.
        """
        study = self._source.study
        try:
            return AskedPoints.of(self._case, self._tree, written, self._names, study.variant)
        except InputError as error:
            if error.where == "measures":
                raise self._source.refuse(("measures",), error) from None
            raise

    def rows(self, written: Sequence[Mapping[str, PointValue]]) -> list[PointRow]:
        """Rows of these points."""

        def told(stage: str, fraction: float) -> None:
            done = len(self.found) + fraction * len(written)
            self._progress(stage, min(done / self._most, 1.0))

        return self.evaluation.rows(self.asked(written), told)

    def told(
        self, cube: NDArray[np.float64], front: "_Front"
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Objectives and violations of points of the unit cube, which join the front."""
        values = [self.space.at(point) for point in cube]
        rows = self.rows([self.space.written(point) for point in values])
        self.values += values
        self.found += rows
        self.cubes += list(cube)
        table = np.array([row.numbers for row in rows])
        columns = dict(zip(self._names, table.T, strict=True))
        objectives, violations = front.add(columns)
        self._tell_best(front)
        return objectives, violations

    def _tell_best(self, front: "_Front") -> None:
        """A line when a single objective, or the compromise of several, has become better."""
        if not front.feasible:
            return
        best = front.best
        own = dict(zip(self._names, self.found[best].numbers, strict=True))
        numbers = ", ".join(f"{name} {own[name]:.5g}" for name in front.goals.objectives)
        text = f"point {best}: {numbers}; {front.points.size} on the front"
        if text != self._best:
            self._best = text
            remark(self._progress, f"{len(self.found)} points, best so far {text}")


class _Front:
    """Points that no other one beats, kept while points come: only they meet the next ones.

    What a point of the front beats, it beats for good, so that this is the front of all points.
    """

    def __init__(self, goals: Goals) -> None:
        self.goals = goals
        self.objectives = np.zeros((0, len(goals.objectives)))
        self.violations = np.zeros((0, len(goals.bounds)))
        self.points: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.feasible = False

    def add(
        self, columns: Mapping[str, NDArray[np.float64]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Take the measures of the next points; return their objectives and violations."""
        objectives = self.goals.objective_values(columns)
        violations = self.goals.violations(columns)
        new = np.arange(len(self.objectives), len(self.objectives) + len(objectives))
        self.objectives = np.vstack([self.objectives, objectives])
        self.violations = np.vstack([self.violations, violations])
        places = np.append(self.points, new)
        found = find_front(self.objectives[places], self.violations[places])
        self.points, self.feasible = places[found.points], found.feasible
        return objectives, violations

    @property
    def ordered(self) -> NDArray[np.int64]:
        """By the first objective."""
        first = self.objectives[self.points, 0]
        return self.points[np.argsort(first, kind="stable")]

    @property
    def best(self) -> int:
        """The compromise; -1 without a front."""
        if not self.points.size:
            return -1
        order = self.ordered
        return int(order[compromise(self.objectives[order])])


def _edge(space: Space) -> float:
    return 0.0 if all(isinstance(item.spread, Range) for item in space.varied) else _EDGE


def _search(source: StudySource, space: Space, goals: Goals) -> Search:
    given = source.study.search
    settings = SearchSettings(
        parameters=len(space.varied),
        objectives=len(goals.objectives),
        population=given.population,
        generations=given.generations,
        seed=given.seed,
        edge=_edge(space),
    )
    return Search(settings, [space.today()])


def _refinement(source: StudySource, work: _Work, front: _Front) -> Batches | None:
    """Refinement of points spread over the front; None without a front."""
    if not front.points.size:
        return None
    order, given = front.ordered, source.study.search
    polls = 2 * len(work.cubes[0]) * _POLLS
    count = min(max(given.refinements // polls, 1), _REFINED)
    chosen = order[np.unique(np.linspace(0, order.size - 1, count).round().astype(int))]
    spans = np.ptp(front.objectives[order], axis=0)
    sizes = np.abs(front.objectives[order]).max(axis=0)
    settings = RefinementSettings(
        evaluations=given.refinements, seed=given.seed, edge=_edge(work.space)
    )
    return Refinement(
        settings,
        np.array(work.cubes)[chosen],
        front.objectives[chosen],
        front.violations[chosen],
        scales=np.where(spans > 0.0, spans, np.maximum(sizes, 1e-300)),
    )


def _optimum(
    front: _Front, algorithm: str, source: StudySource, units: Mapping[str, str]
) -> Optimum:
    given, goals = source.study.search, front.goals
    words = f"{algorithm}, {given.generations} generations of {given.population}"
    if given.refinements:
        words += f", {given.refinements} refinements"
    bounds = [f"{b.measure} {bound_text(b, units[b.measure])}" for b in goals.bounds]
    kept = np.all(front.violations <= 0.0, axis=1) & np.isfinite(front.objectives).all(axis=1)
    return Optimum(
        algorithm=f"{words}, seed {given.seed}",
        objectives=goals.objectives,
        ways=tuple(source.study.objectives.values()),
        bounds=tuple(bounds),
        kept=kept,
        front=front.ordered,
        best=front.best,
        feasible=front.feasible,
    )


def _doubts(optimum: Optimum) -> tuple[str, ...]:
    if optimum.feasible:
        return ()
    return (
        "No point keeps all bounds; the points shown miss them least. Try: wider ranges, or other "
        "bounds.",
    )
