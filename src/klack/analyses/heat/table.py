"""Warm-ups as CSV: one row per point, SI, all digits."""

import csv
from io import StringIO
from math import isfinite
from pathlib import Path

from klack.analyses.heat.record import HeatStudy
from klack.whole_file import whole_file

__all__ = ["CAUSES_NAME", "CSV_NAME", "write_causes", "write_csv"]

CSV_NAME, CAUSES_NAME = "heat.csv", "heat-causes.csv"


def write_csv(record: HeatStudy, file: Path) -> None:
    """Write time, temperatures, heat flows, and the numbers of the stroke at each point."""
    groups = (
        ("temperature", record.temperature),
        ("heat", record.heat),
        ("", record.numbers),
        ("", record.values),
    )
    columns = [(f"{x.name} {word}".strip(), x) for word, group in groups for x in group]
    heads = [name if x.unit == "1" else f"{name} [{x.unit}]" for name, x in columns]
    rows = [
        [_written(record.time[i]), *(_written(x.values[i]) for _, x in columns)]
        for i in range(len(record.time))
    ]
    _write(file, ["time [s]", *heads], rows)


def write_causes(record: HeatStudy, file: Path) -> None:
    """Write the strokes with one cause at a time."""
    units = {x.name: x.unit for x in record.numbers}
    heads = [name if unit == "1" else f"{name} [{unit}]" for name, unit in units.items()]
    rows = [
        [row.state, row.cause, *(_written(row.numbers[name]) for name in units)]
        for row in record.causes
    ]
    _write(file, ["state", "cause", *heads], rows)


def _written(value: float) -> str:
    return repr(float(value)) if isfinite(value) else "steady" if value > 0 else ""


def _write(file: Path, heads: list[str], rows: list[list[str]]) -> None:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([heads, *rows])
    with whole_file(file) as part:
        part.write_text(text.getvalue(), encoding="utf-8", newline="")
