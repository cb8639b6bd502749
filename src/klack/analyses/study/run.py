"""``klack study``: measures at the points of a design."""

from pathlib import Path
from time import perf_counter

from klack.analyses.record import case_fields, run_fields
from klack.analyses.study.asked_points import AskedPoints, PointRow
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
from klack.analyses.study.findings import (
    missed_bound,
    require_surrogates,
    screening_of,
    sensitivity_of,
    surrogate_warnings,
    surrogates_of,
)
from klack.analyses.study.goals import bounds_of, is_by_today
from klack.analyses.study.live import Pace, Seen
from klack.analyses.study.made_valves import made_space
from klack.analyses.study.points import StudyPoints, points_in, space_of
from klack.analyses.study.record import NOT_YET, StudyRecord
from klack.analyses.study.where import HERE, Where
from klack.case.any_case import AnyCase, CaseTree
from klack.case.study_source import StudySource
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings

__all__ = ["asked_points", "run_study"]

_DRAWN = ("sobol", "latin-hypercube", "made")


def asked_points(
    case: AnyCase, tree: CaseTree, source: StudySource
) -> tuple[StudyPoints, AskedPoints]:
    """Check a study as far as that is possible without a run.

    The last point asked for is the case as it is.
    """
    study, space = source.study, space_of(case, source)
    names = (*study.measures, *study.constraints)
    if study.design.kind == "made":
        space = made_space(case, source, space)
        names = (*names, *study.objectives)
    points = points_in(source, space)
    require_surrogates(source, points)
    # the last one is the case as it is, to compare with
    written = [*map(points.space.written, points.values), {}]
    return points, asked_of(case, tree, source, written, names)


def run_study(
    case: AnyCase,
    tree: CaseTree,
    source: StudySource,
    *,
    folder: Path | None = None,
    where: Where = HERE,
    progress: Progress = silent,
    live: Seen | None = None,
) -> StudyRecord:
    """Compute the points of a study that are not known yet.

    ``folder`` keeps computed points: an interrupted study resumes, and another study of the same
    case finds what both have.  ``live`` is often offered a record of the points so far.  InputError
    before the first run, see :func:`asked_points`, and if no point can be computed; Ctrl-C after
    computed points have been kept.
    """
    begin = perf_counter()
    points, asked = asked_points(case, tree, source)
    clock = StageClock(progress)
    form, mark = point_log_form(case, tree)
    with (
        form.open(folder, mark) as log,
        where.open(case, tree) as workers,
        collected_warnings() as notes,
    ):
        evaluation = Evaluation(log, workers)
        clock("points", 0.0)
        pace = Pace(progress, len(asked.points))
        waiting = PointRow((None,) * len(asked.chosen), NOT_YET)

        def so_far() -> StudyRecord:
            *rows, today = (row or waiting for row in evaluation.so_far)
            return StudyRecord(
                **case_fields(case),
                **run_fields(begin, clock),
                **evaluation.effort(len(asked.points)),
                **point_fields(asked, points.space, points.values, rows, today),
                study_text=source.text,
                design=points.design,
                measures=measure_columns(asked, rows, today),
            )

        def told(stage: str, fraction: float) -> None:
            clock(stage, fraction)
            pace.tell(evaluation.done, evaluation.computed)
            if live is not None:
                live(so_far)

        *found, today = evaluation.rows(asked, told)
    require_some(source, found)
    known = {item.name: item.measure for item in asked.chosen}
    bounds = bounds_of(source, known, dict(zip(known, today.numbers, strict=True)))
    columns = measure_columns(asked, found, today)
    own, varied = {c.name: c for c in columns}, tuple(item.name for item in points.space.varied)
    wanted, design = source.study.surrogate, source.study.design.kind
    surrogates = surrogates_of(wanted.kind, points, columns, clock) if wanted else ()
    return StudyRecord(
        **case_fields(case),
        **run_fields(begin, clock),
        **evaluation.effort(len(asked.points)),
        **point_fields(asked, points.space, points.values, found, today),
        study_text=source.text,
        design=points.design,
        measures=columns,
        sensitivities=tuple(
            sensitivity_of(item, varied) for item in columns if design == "saltelli"
        ),
        screenings=tuple(
            screening_of(item, varied, points.cube)
            for item in columns
            if design == "morris" and points.cube is not None
        ),
        surrogates=surrogates,
        missed=tuple(missed_bound(b, own[b.measure]) for b in bounds if design in _DRAWN),
        warnings=(
            *points.notes,
            *_bounds_by_today(source),
            *dry_warnings(asked, points.space),
            *notes,
            *row_warnings(found, today, columns),
            *surrogate_warnings(surrogates),
        ),
    )


def _bounds_by_today(source: StudySource) -> tuple[str, ...]:
    """A bound by today moves with the case that valves are made after."""
    found = [
        f"{name} {key} {bound}"
        for name, limit in source.study.constraints.items()
        for key, bound in (("most", limit.most), ("least", limit.least))
        if is_by_today(bound)
    ]
    if source.study.design.kind != "made" or not found:
        return ()
    return (
        "'Today' of a bound refers to the case from which the valves are manufactured "
        f"({'; '.join(found)}). Try: a bound with its unit.",
    )
