"""One variant of a stroke at many points, as a table."""

from collections.abc import Iterable

from klack.analyses.point_table import PointTable, RunsInterrupted
from klack.analyses.study.point_row import PointRow
from klack.analyses.study.strokes import AskedPoints, row_table
from klack.analyses.study.where import HERE, Where
from klack.case.case_tree import CaseTree
from klack.case.points import GivenPoints
from klack.case.valve import ValveCase
from klack.progress import Progress, silent

__all__ = ["run_strokes"]


def run_strokes(
    case: ValveCase,
    tree: CaseTree,
    points: GivenPoints,
    measures: Iterable[str],
    *,
    variant: str | None = None,
    where: Where = HERE,
    progress: Progress = silent,
) -> PointTable:
    """Compute one variant of a stroke at many points.

    Parameters
    ----------
    case : ValveCase
    tree : CaseTree
        The same as it was written.
    points : sequence of mappings, or mapping of sequences
        Key of the case to a value with its unit, for every point; or a list of values by key.
    measures : iterable of str
        See :class:`~klack.analyses.study.chosen_measures.ChosenMeasure`.
    variant : str, optional
        The first one of the case by default.
    where : Where
        Points are computed; one thread for a case whose components call Python or an FMU, which
        need not bear several calls at a time.
    progress : callable
        Called with a stage and the share of the points that are done.

    Raises
    ------
    InputError
        Before the first run: for a key, a unit or a measure that does not exist, and where so many
        strokes at a time do not fit into the memory.
    RunsInterrupted
        On Ctrl-C, with the table of what was computed until then.
    """
    asked = AskedPoints.of(case, tree, points, measures, variant)
    rows: list[PointRow | None] = [None] * len(asked.points)
    try:
        with where.open(case, tree) as workers:
            workers.compute(asked, range(len(rows)), rows.__setitem__, progress)
    except KeyboardInterrupt:
        raise RunsInterrupted(row_table(asked, rows)) from None
    return row_table(asked, rows)
