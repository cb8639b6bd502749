"""The points of a study as a table: for CSV, for pandas."""

from klack.analyses.point_table import PointColumn, PointTable, column_of
from klack.analyses.study.record import StudyColumn, StudyRecord

__all__ = ["study_table"]


def study_table(record: StudyRecord) -> PointTable:
    """Points in the order of the design: parameters, what follows from them, measures."""
    return PointTable(
        case=record.case,
        variant=record.variant,
        points=tuple(_column(item) for item in (*record.parameters, *record.linked)),
        measures=tuple(_column(item) for item in record.measures),
        failures=record.failures,
        warnings=tuple(tuple(text.splitlines()) for text in record.notes),
    )


def _column(item: StudyColumn) -> PointColumn:
    if item.words:
        return column_of(item.name, "", [item.words[int(value)] for value in item.values])
    return column_of(item.name, item.unit, item.values.tolist())
