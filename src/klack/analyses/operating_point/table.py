"""Operating points as CSV: one row per quantity of a single point, or one row per point."""

import csv
from io import StringIO
from pathlib import Path

from klack.analyses.operating_point.record import OperatingPoints
from klack.analyses.point_table import PointTable, column_of
from klack.whole_file import whole_file

__all__ = ["CSV_NAME", "write_csv"]

CSV_NAME = "operating-point.csv"


def write_csv(record: OperatingPoints, file: Path) -> None:
    """Write component, quantity, value and unit of one point; of a sweep a table of its points."""
    if record.swept:
        left = (
            ("force left", "N", record.force_left),
            ("flow left", "m^3/s", record.flow_left),
            ("voltage left", "V", record.voltage_left),
        )
        PointTable(
            case=record.case,
            variant=record.variant,
            points=tuple(column_of(x.name, x.unit, x.values.tolist()) for x in record.swept),
            measures=(
                *(column_of(x.name, x.unit, x.values.tolist()) for x in record.quantities),
                *(column_of(name, unit, values.tolist()) for name, unit, values in left),
            ),
            failures=record.failures,
            warnings=tuple(tuple(text.splitlines()) for text in record.doubts),
        ).to_csv(file)
        return
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("component", "quantity", "value", "unit"))
    for item in record.quantities:
        writer.writerow((item.component, item.quantity, repr(float(item.values[0])), item.unit))
    with whole_file(file) as part:
        part.write_text(text.getvalue(), encoding="utf-8", newline="")
