"""Columns of a study from the rows of its points, and what speaks against them."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.asked_points import AskedPoints, PointRow
from klack.analyses.study.points import Space, Values
from klack.analyses.study.record import StudyColumn
from klack.case.study_source import StudySource
from klack.errors import InputError

__all__ = [
    "PointFields",
    "measure_columns",
    "point_fields",
    "require_some",
    "row_warnings",
    "step_columns",
]

_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_TOLD = 5
"""Kinds of notes that are told; those of a kind differ in numbers only."""


def require_some(source: StudySource, rows: Sequence[PointRow]) -> None:
    """Refuse a study without a single number.

    Raises
    ------
    InputError
    """
    reasons = Counter(row.failure.partition("\n")[0] for row in rows)
    if rows and not reasons[""]:
        reason, times = reasons.most_common(1)[0]
        raise InputError(
            source.where(("parameters",)),
            got=f"{len(rows)} points, none of which can be computed; {times} times: {reason}",
            expected="ranges in which the valve works",
            hint="narrow the ranges, or compute the case with one of these values by itself.",
        )


class PointFields(TypedDict):
    """Fields of a record that its points give, beside their measures."""

    variant: str
    parameters: tuple[StudyColumn, ...]
    linked: tuple[StudyColumn, ...]
    failures: tuple[str, ...]
    notes: tuple[str, ...]
    model: str
    halvings: NDArray[np.float64]
    step_changes: NDArray[np.float64]


def point_fields(
    asked: AskedPoints,
    space: Space,
    values: Sequence[Values],
    rows: Sequence[PointRow],
    today: PointRow,
) -> PointFields:
    """Values of the parameters and of what follows from them, and how each point ended."""
    known = space.known()
    steps = step_columns(rows)
    return PointFields(
        variant=asked.variant,
        parameters=tuple(
            _column(values, item.name, item.unit, item.text(), known.get(item.name))
            for item in space.parameters
        ),
        linked=tuple(
            _column(values, item.name, item.unit, f"= {item.expression.text}", item.today)
            for item in space.linked
        ),
        failures=tuple(row.failure for row in rows),
        notes=tuple("\n".join(row.notes) for row in rows),
        model=_model(rows, today),
        halvings=steps[0],
        step_changes=steps[1],
    )


def step_columns(rows: Sequence[PointRow]) -> NDArray[np.float64]:
    """What the check of the steps of each stroke has found, shape (2, points); (2, 0) of impacts.

    Rows: see :class:`~klack.analyses.study.asked_points.PointSteps`; nan where none was computed.
    """
    if all(row.steps is None for row in rows):
        return np.zeros((2, 0))
    return np.array([row.steps or (np.nan, np.nan) for row in rows], dtype=float).T


def _model(rows: Sequence[PointRow], today: PointRow) -> str:
    """Model of the case as it is, and how many points have another one; empty for strokes."""
    first = next((row.model for row in (today, *rows) if row.model), "")
    others = sum(1 for row in rows if row.model not in ("", first))
    points = "1 point" if others == 1 else f"{others} points"
    return f"{first}; other modes, meshes or laws at {points}" if others else first


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
    alike: dict[str, Counter[str]] = {}
    for row in rows:
        for kind, note in {_NUMBER.sub("#", note): note for note in row.notes}.items():
            alike.setdefault(kind, Counter())[note] += 1
    kinds = sorted(alike.values(), key=lambda notes: -notes.total())
    for notes in kinds[:_TOLD]:
        note = notes.most_common(1)[0][0]
        other = ", with other numbers" if len(notes) > 1 else ""
        found.append(f"{notes.total()} of {len(rows)} points{other}: {note}")
    if len(kinds) > _TOLD:
        found.append(f"{len(kinds) - _TOLD} other notes; the table of points has them all.")
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
