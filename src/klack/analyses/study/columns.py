"""Columns of a study from the rows of its points, and what speaks against them."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from klack.analyses.study.points import Space, Values
from klack.analyses.study.record import StudyColumn
from klack.analyses.study.strokes import AskedPoints, PointRow
from klack.case.study_source import StudySource
from klack.errors import InputError

__all__ = [
    "measure_columns",
    "parameter_columns",
    "require_some",
    "row_warnings",
]

_TOLD = 5
"""Different notes that are told."""


def require_some(source: StudySource, rows: Sequence[PointRow]) -> None:
    """Refuse a study without a single number.

    Raises
    ------
    InputError
    """
    reasons = Counter(row.failure for row in rows)
    if rows and not reasons[""]:
        reason, times = reasons.most_common(1)[0]
        raise InputError(
            source.where(("parameters",)),
            got=f"{len(rows)} points, none of which can be computed; {times} times: {reason}",
            expected="ranges in which the valve works",
            hint="narrow the ranges, or try single points with klack stroke.",
        )


def parameter_columns(
    space: Space, values: Sequence[Values]
) -> tuple[tuple[StudyColumn, ...], tuple[StudyColumn, ...]]:
    """Columns of the parameters, and of what follows from them."""
    own = tuple(
        _column(values, item.name, item.unit, item.text(), item.today) for item in space.parameters
    )
    linked = tuple(
        _column(values, item.name, item.unit, f"= {item.expression.text}", item.today)
        for item in space.linked
    )
    return own, linked


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
        is_whole=bool(unit) and all(isinstance(point[name], int) for point in points),
    )


def measure_columns(
    asked: AskedPoints, rows: Sequence[PointRow], today: PointRow
) -> tuple[StudyColumn, ...]:
    """Columns of the measures; ``today`` is the row of the case as it is."""
    return tuple(
        StudyColumn(
            name=item.name,
            title=item.measure.name,
            unit=item.measure.unit,
            spread="",
            today=today.numbers[k],
            values=np.array([row.numbers[k] for row in rows], dtype=float),
        )
        for k, item in enumerate(asked.chosen)
    )


def _today_notes(today: PointRow) -> tuple[str, ...]:
    if today.failure:
        return (f"The case as it is cannot be computed: {today.failure.partition(chr(10))[0]}",)
    return tuple(f"The case as it is: {note}" for note in today.notes)


def _of_rows(rows: Sequence[PointRow]) -> tuple[str, ...]:
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


def row_warnings(
    rows: Sequence[PointRow], today: PointRow, columns: Sequence[StudyColumn]
) -> tuple[str, ...]:
    """How many points failed or are in doubt, with the most frequent reasons."""
    return (*_of_rows(rows), *_missing_measures(columns), *_today_notes(today))
