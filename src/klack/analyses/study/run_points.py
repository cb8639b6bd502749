"""One variant or level at many points, as a table."""

from collections.abc import Iterable, Sequence

from klack.analyses.point_table import NOT_COMPUTED, PointTable, RunsInterrupted, column_of
from klack.analyses.study.asked_points import AskedPoints, PointRow
from klack.analyses.study.evaluation import step_columns
from klack.analyses.study.kinds import ask
from klack.analyses.study.record import steps_of
from klack.analyses.study.where import HERE, Where
from klack.case.any_case import AnyCase, CaseTree
from klack.case.points import GivenPoints
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import refuse_if
from klack.machine.progress import Progress, silent

__all__ = ["require_way", "run_points"]


def run_points(
    case: AnyCase,
    tree: CaseTree,
    points: GivenPoints,
    measures: Iterable[str],
    *,
    variant: str | None = None,
    where: Where = HERE,
    progress: Progress = silent,
) -> PointTable:
    """Compute one variant of a stroke, or one level of an impact, at many points.

    Parameters
    ----------
    points
        Key to value with unit, for every point; or a list of values by key.
    measures
        See :func:`~klack.analyses.study.measures.stroke_measures` and
        :func:`~klack.analyses.study.measures.impact_measures`.
    variant
        The first of the case, or the level ``reduced``, by default.
    where
        One thread for a case whose components call Python or an FMU, which need not bear several
        calls at a time.

    Raises
    ------
    InputError
        Before the first run, also where so many strokes at a time do not fit into the memory.
    RunsInterrupted
        On Ctrl-C, with the table so far.
    """
    asked = ask(case, tree, points, measures, variant)
    rows: list[PointRow | None] = [None] * len(asked.points)
    try:
        with where.open(case, tree) as workers:
            workers.compute(asked, range(len(rows)), rows.__setitem__, progress)
    except KeyboardInterrupt:
        raise RunsInterrupted(_row_table(asked, rows)) from None
    return _row_table(asked, rows)


def require_way(case: AnyCase, variant: str | None, level: str | None) -> None:
    """Refuse a level of a stroke, and a variant of an impact."""
    refuse_if(
        variant is not None and isinstance(case, Case),
        "variant",
        got=f"'{variant}', for an impact of two bodies",
        expected="a level; only strokes have variants",
        hint='write level="interface", or leave the variant out.',
    )
    refuse_if(
        level is not None and isinstance(case, ValveCase),
        "level",
        got=f"'{level}', for a stroke of a whole valve",
        expected="a variant; only impacts have levels",
        hint='write variant="dry", or leave the level out.',
    )


def _row_table(asked: AskedPoints, found: Sequence[PointRow | None]) -> PointTable:
    """Table of all points; those without a row were not computed."""
    none = PointRow((None,) * len(asked.chosen), NOT_COMPUTED)
    rows = [none if row is None else row for row in found]
    return PointTable(
        case=asked.case.name,
        variant=asked.variant,
        points=tuple(
            column_of(
                key.name,
                key.unit,
                [
                    key.value(row[key.name]) if key.name in row else None
                    for row in asked.points.written
                ],
            )
            for key in asked.points.keys
        ),
        measures=tuple(
            column_of(item.name, item.measure.unit, [row.values[k] for row in rows], item.measure)
            for k, item in enumerate(asked.chosen)
        ),
        failures=tuple(row.failure for row in rows),
        warnings=tuple(row.notes for row in rows),
        steps=steps_of(*step_columns(rows)),
    )
