"""``klack optimise``: search for points that no other one beats."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import case_fields, run_fields
from klack.analyses.sensitivities.parameters import SlopeSpace
from klack.analyses.study.asked_points import AskedPoints, PointRow
from klack.analyses.study.computing import sounds_of
from klack.analyses.study.evaluation import (
    Evaluation,
    asked_of,
    dry_warnings,
    measure_columns,
    point_fields,
    point_log_form,
    require_some,
    row_warnings,
)
from klack.analyses.study.goals import Goals, Side, goals_of, require_objectives
from klack.analyses.study.gradients import Gradients, require_gradients
from klack.analyses.study.live import Pace, Seen
from klack.analyses.study.made_valves import MadeValves, made_valves_of
from klack.analyses.study.points import Space, Values, require_varied, space_of
from klack.analyses.study.record import Optimum, PointSound, StudyColumn, StudyRecord
from klack.analyses.study.where import HERE, Where
from klack.analyses.study.wording import number_text
from klack.case.any_case import AnyCase, CaseTree
from klack.case.points import PointValue
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.errors import refuse_if
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.studies.batches import Batches
from klack.studies.designs import Range
from klack.studies.fronts import compromise, find_front, spread_over
from klack.studies.polish import NoValue, polish
from klack.studies.refinement import Refinement, RefinementSettings
from klack.studies.search import Search, SearchSettings, require_pymoo

__all__ = ["run_optimisation"]

_EDGE = 1e-3
"""Share that points keep from infinite ends of a distribution."""
_REFINED = 8
_PLAYED = 8
"""Points of the front with stored sound, beside the recommended and today."""
_ROUNDS = 8
"""Rounds of checking the steps of front points."""
_POLLS = 4
"""Rounds of each refined point that must fit into the points allowed."""


def run_optimisation(
    case: AnyCase,
    tree: CaseTree,
    source: StudySource,
    *,
    folder: Path | None = None,
    where: Where = HERE,
    progress: Progress = silent,
    seen: Callable[[StudyRecord], None] | None = None,
    live: Seen | None = None,
) -> StudyRecord:
    """Search for the best points of a study, and refine those of the front.

    The points depend on nothing but the study and the case: an interrupted search finds those that
    were computed.  Strokes are searched in steps as they are; those of the front are then computed
    again with their steps checked.  ``seen`` takes records now and then, ``live`` often.

    Raises
    ------
    InputError
        Before the first run, with file, line and key; and if no point can be computed.
    """
    begin = perf_counter()
    require_objectives(source)
    require_pymoo()
    space = space_of(case, source)
    require_varied(source, space.varied)
    study = source.study
    settings = SearchSettings(
        parameters=len(space.varied),
        objectives=len(study.objectives),
        population=study.search.population,
        generations=study.search.generations,
        seed=study.search.seed,
        edge=_edge(space),
    )
    _require_same_draws(source)
    names = dict.fromkeys((*study.measures, *study.objectives, *study.constraints))
    asked = asked_of(case, tree, source, [{}], names)
    slopes = require_gradients(source, asked, space)
    made = made_valves_of(case, source, space)
    clock = StageClock(progress)
    form, mark = point_log_form(case, tree)
    with (
        form.open(folder, mark) as log,
        where.open(case, tree) as workers,
        collected_warnings() as notes,
    ):
        work = _Work(asked, source, space, made, Evaluation(log, workers), clock)
        today = work.rows([{}], work.names)[0]
        known = {item.name: item.measure for item in asked.chosen}
        front = _Front(goals_of(source, known, dict(zip(known, today.numbers, strict=True))))
        robust_today = made.row_of_today(front.goals.sides, work.rows) if made else None
        work.checks = False
        search = Search(settings, [space.today()])

        def record(
            sounds: tuple[PointSound, ...] = (), warnings: tuple[str, ...] = ()
        ) -> StudyRecord:
            columns = measure_columns(asked, work.found, today)
            if made is not None and robust_today is not None:
                columns += made.columns(columns, front.goals.sides, work.made_rows, robust_today)
            optimum = _optimum(front, settings.algorithm, source, columns, made)
            of_rows = row_warnings(work.found, today, columns)
            return StudyRecord(
                **case_fields(case),
                **run_fields(begin, clock, "pymoo"),
                **work.evaluation.effort(work.done),
                **point_fields(asked, space, work.values, work.found, today),
                study_text=source.text,
                design=optimum.algorithm,
                measures=columns,
                optimum=optimum,
                sounds=sounds,
                warnings=(
                    *_without_best(optimum),
                    *_lucky_draws(asked, source),
                    *dry_warnings(asked, space),
                    *warnings,
                    *of_rows,
                ),
            )

        if seen is not None:
            work.now_and_then = lambda: seen(record())
        if live is not None:
            work.always = lambda: live(record)
        for cube in search:
            search.tell(*work.told(cube, front))
        require_some(source, work.found)
        if source.study.search.refinements:
            refinement = _refinement(source, work, front)
            if refinement is not None:
                for cube in refinement:
                    refinement.tell(*work.told(cube, front))
        ended = _polish(source, work, front, slopes, clock) if slopes is not None else []
        work.check(front)
        sounds = _sounds(work, front, clock)
    return record(sounds, (*ended, *notes))


def _without_best(optimum: Optimum) -> tuple[str, ...]:
    if optimum.front.size == 0:
        return ("No point has a value of every objective, so none is best. Try: wider ranges.",)
    if optimum.feasible:
        return ()
    return (
        "No point meets all bounds; the points shown miss them least. Try: wider ranges, or other "
        "bounds.",
    )


_DRAWS = ("shots.seed", "shots.count")
"""Keys of the draws of shots, not of the valve."""


def _require_same_draws(source: StudySource) -> None:
    """Refuse a search among draws of shots: it would find the luckiest."""
    for name in _DRAWS:
        refuse_if(
            name in source.study.parameters,
            source.where(("parameters", name)),
            got=f"'{name}' as a parameter of a search, which would only find the most favourable "
            "draw",
            expected="the same shots for all points",
            hint="remove the seed here; klack study compares seeds.",
        )


class _Work:
    def __init__(
        self,
        asked: AskedPoints,
        source: StudySource,
        space: Space,
        made: MadeValves | None,
        evaluation: Evaluation,
        progress: Progress,
    ) -> None:
        self.asked_today, self._source = asked, source
        self.space, self._made, self._progress = space, made, progress
        self.evaluation = evaluation
        self.values: list[Values] = []
        self.found: list[PointRow] = []
        self.made_rows: list[PointRow] = []
        self.cubes: list[NDArray[np.float64]] = []
        self.names = tuple(item.name for item in asked.chosen)
        search = source.study.search
        designs = search.population * search.generations + search.refinements + search.polish
        self._most = designs * (1 if made is None else 1 + len(made.scatter.cube))
        self._pace = Pace(progress, self._most)
        self._shown = tuple(source.study.objectives)
        self._units = {item.name: item.measure.unit for item in self.asked_today.chosen}
        self.done, self.checks = 0, True
        self.now_and_then: Callable[[], None] = lambda: None
        self.always: Callable[[], None] = lambda: None

    def asked(
        self, written: Sequence[Mapping[str, PointValue]], names: Sequence[str]
    ) -> AskedPoints:
        today = self.asked_today
        asked = asked_of(today.case, today.tree, self._source, written, names)
        return replace(asked, checks=self.checks)

    def rows(
        self, written: Sequence[Mapping[str, PointValue]], names: Sequence[str]
    ) -> list[PointRow]:

        def told(stage: str, fraction: float) -> None:
            self._progress(stage, min((self.done + fraction * len(written)) / self._most, 1.0))

        rows = self.evaluation.rows(self.asked(written, names), told)
        self.done += len(written)
        return rows

    def told(
        self, cube: NDArray[np.float64], front: "_Front"
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Objectives and violations of points, which join the front."""
        values = [self.space.at(point) for point in cube]
        rows, made, columns = self._computed(values, front.goals.sides)
        self.values += values
        self.found += rows
        self.made_rows += made
        self.cubes += list(cube)
        objectives, violations = front.add(columns)
        if self._pace.tell(self.done, self.evaluation.computed, self._best_words(front)):
            self.now_and_then()
        self.always()
        return objectives, violations

    def check(self, front: "_Front") -> None:
        """Compute strokes of the front again with their steps checked, which may change the front.

        A few times, until all of it are; then those that are keep it among themselves.
        """
        case = self.asked_today.case
        if not isinstance(case, ValveCase) or case.run.check_steps is not None:
            return  # the search has done as the case says
        self.checks = True
        checked = np.zeros(len(self.found), dtype=bool)
        for _ in range(_ROUNDS):
            places = front.points[~checked[front.points]].tolist()
            if not places:
                return
            values = [self.values[i] for i in places]
            rows, made, columns = self._computed(values, front.goals.sides)
            for k, i in enumerate(places):
                self.found[i] = rows[k]
                if made:
                    self.made_rows[i] = made[k]
            checked[places] = True
            front.exchange(places, columns)
        front.choose(np.flatnonzero(checked))

    def _computed(
        self, values: Sequence[Values], sides: Sequence[Side]
    ) -> tuple[list[PointRow], list[PointRow], Mapping[Side, NDArray[np.float64]]]:
        rows = self.rows([self.space.written(point) for point in values], self.names)
        table = np.array([row.numbers for row in rows])
        columns = {side: table[:, self.names.index(side[0])] for side in sides}
        if self._made is None:
            return rows, [], columns
        made = self._made.rows(values, sides, self.rows)
        columns = dict(zip(sides, np.array([row.numbers for row in made]).T, strict=True))
        rows = [
            replace(row, notes=(*row.notes, *of_made.notes))
            for row, of_made in zip(rows, made, strict=True)
        ]
        return rows, made, columns

    def _best_words(self, front: "_Front") -> str:
        if not front.feasible:
            return ""
        own = dict(zip(self.names, self.found[front.best].numbers, strict=True))
        parts = [f"{name} {number_text(own[name], self._units[name])}" for name in self._shown]
        text = f"best so far point {front.best}: {', '.join(parts)}"
        several = len(self._shown) > 1
        return f"{text}; {front.points.size} on the front" if several else text


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
        self, columns: Mapping[Side, NDArray[np.float64]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        objectives = self.goals.objective_values(columns)
        violations = self.goals.violations(columns)
        new = np.arange(len(self.objectives), len(self.objectives) + len(objectives))
        self.objectives = np.vstack([self.objectives, objectives])
        self.violations = np.vstack([self.violations, violations])
        self.choose(np.append(self.points, new))
        return objectives, violations

    def exchange(self, places: Sequence[int], columns: Mapping[Side, NDArray[np.float64]]) -> None:
        self.objectives[places] = self.goals.objective_values(columns)
        self.violations[places] = self.goals.violations(columns)
        self.choose(np.arange(len(self.objectives)))

    def choose(self, places: NDArray[np.int64]) -> None:
        found = find_front(self.objectives[places], self.violations[places])
        self.points, self.feasible = places[found.points], found.feasible

    def row(self, point: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.objectives[point], self.violations[point]

    @property
    def ordered(self) -> NDArray[np.int64]:
        """By the first objective."""
        first = self.objectives[self.points, 0]
        return self.points[np.argsort(first, kind="stable")]

    @property
    def scales(self) -> NDArray[np.float64]:
        """Ranges of the objectives on the front; sizes where a range is zero."""
        found = self.objectives[self.points]
        spans, sizes = np.ptp(found, axis=0), np.abs(found).max(axis=0)
        return np.where(spans > 0.0, spans, np.maximum(sizes, 1e-300))

    @property
    def best(self) -> int:
        """The compromise; -1 without a front."""
        if not self.points.size:
            return -1
        order = self.ordered
        return int(order[compromise(self.objectives[order])])


def _edge(space: Space) -> float:
    return 0.0 if all(isinstance(item.spread, Range) for item in space.varied) else _EDGE


def _refinement(source: StudySource, work: _Work, front: _Front) -> Batches | None:
    if not front.points.size:
        return None
    order, given = front.ordered, source.study.search
    polls = 2 * len(work.cubes[0]) * _POLLS
    count = min(max(given.refinements // polls, 1), _REFINED)
    chosen = spread_over(order, count)
    settings = RefinementSettings(
        evaluations=given.refinements, seed=given.seed, edge=_edge(work.space)
    )
    return Refinement(
        settings,
        np.array(work.cubes)[chosen],
        front.objectives[chosen],
        front.violations[chosen],
        scales=front.scales,
    )


def _polish(
    source: StudySource, work: _Work, front: _Front, slopes: SlopeSpace, progress: Progress
) -> list[str]:
    """Polish the recommended point, if any; return what ended it early."""
    if front.best < 0:
        return []
    start, known = work.cubes[front.best], front.row(front.best)
    gradients = Gradients.of(work.asked_today, slopes, work.space, front.goals, progress)

    def values(point: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if np.array_equal(point, start):
            return known
        objectives, violations = work.told(point[None, :], front)
        if not (np.isfinite(objectives).all() and np.isfinite(violations).all()):
            raise NoValue
        return objectives[0], violations[0]

    polish(
        start,
        values,
        gradients.at,
        scales=front.scales,
        steps=source.study.search.polish,
        edge=_edge(work.space),
    )
    return gradients.notes


def _optimum(
    front: _Front,
    algorithm: str,
    source: StudySource,
    columns: Sequence[StudyColumn],
    made: MadeValves | None,
) -> Optimum:
    given, goals = source.study.search, front.goals
    words = f"{algorithm}, {given.generations} generations of {given.population}"
    if given.refinements:
        words += f", {given.refinements} refinements"
    if given.polish:
        words += f", polished in {given.polish} steps at most"
    if made is not None:
        words += f", {len(made.scatter.cube)} manufactured valves per design"
    units = {item.name: item.unit for item in columns}

    def name(measure: str, high: bool) -> str:
        return measure if made is None else made.name((measure, high))

    signs = zip(goals.objectives, goals.signs, strict=True)
    kept = np.all(front.violations <= 0.0, axis=1) & np.isfinite(front.objectives).all(axis=1)
    return Optimum(
        algorithm=f"{words}, seed {given.seed}",
        objectives=tuple(name(measure, sign > 0.0) for measure, sign in signs),
        ways=goals.ways,
        bounds=goals.bound_texts(units, name),
        kept=kept,
        front=front.ordered,
        best=front.best,
        feasible=front.feasible,
    )


def _sounds(work: _Work, front: _Front, progress: Progress) -> tuple[PointSound, ...]:
    """Of the case and of spread front points, if noise was asked for."""
    if front.best < 0 or not any(item.is_noise for item in work.asked_today.chosen):
        return ()
    chosen = spread_over(front.ordered, _PLAYED)
    points = list(dict.fromkeys([-1, front.best, *map(int, chosen)]))
    written = [work.space.written(work.values[i]) if i >= 0 else {} for i in points]
    found = sounds_of(work.asked(written, work.names), progress)
    pairs = zip(points, found, strict=True)
    return tuple(PointSound(point=i, pressure=sound) for i, sound in pairs if sound is not None)


def _lucky_draws(asked: AskedPoints, source: StudySource) -> tuple[str, ...]:
    """The best of many points owes part of its lead to the common draws."""
    sought = {*source.study.objectives, *source.study.constraints}
    if not any(item.of == "shots" and item.name in sought for item in asked.chosen):
        return ()
    return (
        "All points were compared with the same draws of shots, to which the best point is "
        "adapted. Try: klack export --to case --point, and klack shots --seed with other seeds "
        "for that case and for today's.",
    )
