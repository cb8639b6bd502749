"""The points of a study as a table: for CSV, for pandas."""

import numpy as np
from numpy.typing import NDArray

from klack.analyses.point_table import PointColumn, PointTable, column_of
from klack.analyses.study.record import StudyColumn, StudyRecord

__all__ = ["steps_of", "study_table"]


def study_table(record: StudyRecord) -> PointTable:
    """Points in the order of the design: parameters, what follows from them, measures."""
    return PointTable(
        case=record.case,
        variant=record.variant,
        points=tuple(_column(item) for item in (*record.parameters, *record.linked)),
        measures=tuple(_column(item) for item in record.measures),
        failures=record.failures,
        warnings=tuple(tuple(text.splitlines()) for text in record.notes),
        steps=steps_of(record.halvings, record.step_changes),
    )


def steps_of(
    halvings: NDArray[np.float64], changes: NDArray[np.float64]
) -> tuple[PointColumn, ...]:
    """Columns of what the check of the steps has found; none of impacts."""
    named = (("halvings", halvings), ("step_change", changes))
    return tuple(PointColumn(name, "1", values) for name, values in named if len(values))


def _column(item: StudyColumn) -> PointColumn:
    if item.words:
        return column_of(item.name, "", [item.words[int(value)] for value in item.values])
    return column_of(item.name, item.unit, item.values.tolist())
