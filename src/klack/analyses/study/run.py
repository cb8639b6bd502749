"""``klack study``: the measures of a case at the points of a design."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from klack.analyses.record import case_fields, run_fields
from klack.analyses.study.log import KeptPoint, PointLog, point_key, point_log_form
from klack.analyses.study.points import StudyPoints, Values, points_of_study
from klack.analyses.study.record import StudyColumn, StudyRecord
from klack.analyses.study.strokes import AskedPoints, PointRow, compute_points
from klack.case.case_tree import CaseTree
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.cores import available_cores
from klack.errors import InputError
from klack.progress import Progress, silent
from klack.stages import StageClock, collected_warnings

__all__ = ["asked_points", "run_study"]

_TOLD = 5
"""Different notes that are told."""


def asked_points(
    case: ValveCase, tree: CaseTree, source: StudySource
) -> tuple[StudyPoints, AskedPoints]:
    """Check a study as far as that is possible without a run.

    The last point asked for is the case as it is.

    Raises
    ------
    InputError
        With file, line and key: for parameters, expressions, measures and designs that cannot be.
    """
    points = points_of_study(case, source)
    written = [*points.written(), {}]  # the case as it is, to compare with
    try:
        asked = AskedPoints.of(case, tree, written, source.study.measures, source.study.variant)
    except InputError as error:
        if error.where == "measures":
            raise source.refuse(("measures",), error) from None
        raise
    return points, asked


def run_study(
    case: ValveCase,
    tree: CaseTree,
    source: StudySource,
    *,
    folder: Path | None = None,
    threads: int | None = None,
    progress: Progress = silent,
) -> StudyRecord:
    """Compute the points of a study that are not known yet.

    Parameters
    ----------
    case : ValveCase
    tree : CaseTree
        The same as it was written.
    source : StudySource
    folder : Path, optional
        Where computed points are kept: an interrupted study resumes, and another study of the same
        case finds what both have.
    threads : int, optional
    progress : callable

    Raises
    ------
    InputError
        Before the first run, see :func:`asked_points`; and if no point at all can be computed.
    KeyboardInterrupt
        Ctrl-C, after all computed points have been kept.
    """
    begin = perf_counter()
    points, asked = asked_points(case, tree, source)
    clock = StageClock(progress)
    form, mark = point_log_form(case, tree)
    measures = tuple(item.name for item in asked.chosen)
    keys = [point_key(tree, asked.variant, row) for row in asked.points.written]
    with form.open(folder, mark) as log, collected_warnings() as notes:
        rows = [_known(log, key, measures) for key in keys]
        missing = _first_of_each(keys, rows)
        clock("points", 0.0)
        spent = perf_counter()
        compute_points(asked, missing, _keeping(log, keys, measures, rows), threads, clock)
        spent = perf_counter() - spent
        *found, today = [
            _found(log, key, measures, row) for key, row in zip(keys, rows, strict=True)
        ]
    _require_some(source, found)
    columns = _measure_columns(asked, found, today)
    return StudyRecord(
        **case_fields(case),
        **run_fields(begin, clock),
        study_text="" if source.path == tree.path else source.path.read_text(encoding="utf-8"),
        variant=asked.variant,
        design=points.design,
        threads=available_cores() if threads is None else threads,
        computed=len(missing),
        kept=len(rows) - len(missing),
        point_time=spent,
        parameters=_parameter_columns(points),
        linked=_linked_columns(points),
        measures=columns,
        failures=tuple(row.failure for row in found),
        notes=tuple("\n".join(row.notes) for row in found),
        warnings=(
            *points.notes,
            *notes,
            *_warnings(found),
            *_missing_measures(columns),
            *_today_notes(today),
        ),
    )


# --------------------------------------------------------------------------- computing


def _known(log: PointLog, key: str, measures: tuple[str, ...]) -> PointRow | None:
    kept = log.done.get(key)
    return None if kept is None else kept.row(measures)


def _first_of_each(keys: Sequence[str], rows: Sequence[PointRow | None]) -> list[int]:
    """Places of the points that have to be computed: of equal points the first one."""
    first: dict[str, int] = {}
    for place, (key, row) in enumerate(zip(keys, rows, strict=True)):
        if row is None:
            first.setdefault(key, place)
    return list(first.values())


def _keeping(
    log: PointLog, keys: Sequence[str], measures: tuple[str, ...], rows: list[PointRow | None]
) -> Callable[[int, PointRow], None]:
    def keep(place: int, row: PointRow) -> None:
        rows[place] = row
        if not row.by_chance:
            key = keys[place]
            before = log.done.get(key, KeptPoint(values={}, failure="", notes=()))
            log.add(key, before.with_row(measures, row))

    return keep


def _found(log: PointLog, key: str, measures: tuple[str, ...], row: PointRow | None) -> PointRow:
    """Row of a point; of one that equals an earlier one, that of the earlier."""
    found = row or _known(log, key, measures)
    return found or PointRow((None,) * len(measures), "not computed", by_chance=True)


def _require_some(source: StudySource, rows: Sequence[PointRow]) -> None:
    reasons = Counter(row.failure for row in rows)
    if rows and not reasons[""]:
        reason, times = reasons.most_common(1)[0]
        raise InputError(
            source.where(("parameters",)),
            got=f"{len(rows)} points, none of which can be computed; {times} times: {reason}",
            expected="ranges in which the valve works",
            hint="narrow the ranges, or try single points with klack stroke.",
        )


# --------------------------------------------------------------------------- columns


def _parameter_columns(points: StudyPoints) -> tuple[StudyColumn, ...]:
    return tuple(
        _column(points.values, item.name, item.unit, item.text(), item.today)
        for item in points.parameters
    )


def _linked_columns(points: StudyPoints) -> tuple[StudyColumn, ...]:
    return tuple(
        _column(points.values, item.name, item.unit, f"= {item.expression.text}", item.today)
        for item in points.linked
    )


def _column(
    points: Sequence[Values], name: str, unit: str, spread: str, today: float | str | None
) -> StudyColumn:
    values = [point[name] for point in points]
    words: tuple[str, ...] = ()
    if not unit:
        words = tuple(dict.fromkeys(str(value) for value in values))
        values = [float(words.index(str(value))) for value in values]
        today = words.index(str(today)) if str(today) in words else None
    return StudyColumn(
        name=name,
        title=name.rpartition(".")[2].replace("_", " "),
        unit=unit,
        spread=spread,
        today=float("nan") if today is None else float(today),
        values=np.array(values, dtype=float),
        words=words,
    )


def _measure_columns(
    asked: AskedPoints, rows: Sequence[PointRow], today: PointRow
) -> tuple[StudyColumn, ...]:
    return tuple(
        StudyColumn(
            name=item.name,
            title=item.measure.name,
            unit=item.measure.unit,
            spread="",
            today=_number(today.values[k]),
            values=np.array([_number(row.values[k]) for row in rows], dtype=float),
        )
        for k, item in enumerate(asked.chosen)
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _today_notes(today: PointRow) -> tuple[str, ...]:
    if today.failure:
        return (f"The case as it is cannot be computed: {today.failure.partition(chr(10))[0]}",)
    return tuple(f"The case as it is: {note}" for note in today.notes)


def _warnings(rows: Sequence[PointRow]) -> tuple[str, ...]:
    """How many points failed or are in doubt, with the most frequent reasons."""
    found = []
    failures = Counter(row.failure.partition("\n")[0] for row in rows if row.failure)
    if failures:
        reason, times = failures.most_common(1)[0]
        found.append(
            f"{failures.total()} of {len(rows)} points have no measures; {times} times: {reason}"
        )
    notes = Counter(note for row in rows for note in dict.fromkeys(row.notes))
    for note, times in notes.most_common(_TOLD):
        found.append(f"{times} of {len(rows)} points: {note}")
    if len(notes) > _TOLD:
        found.append(f"{len(notes) - _TOLD} other notes; the table of points has them all.")
    return tuple(found)


def _missing_measures(columns: Sequence[StudyColumn]) -> tuple[str, ...]:
    return tuple(
        f"'{item.name}' has no value at any point. Try: a longer run.duration if it comes later."
        for item in columns
        if not np.isfinite(item.values).any()
    )
