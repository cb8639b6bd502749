"""Results as plain text tables, one per run and axis, numbers to the last bit."""

import csv
import json
from collections.abc import Sequence
from math import isnan
from pathlib import Path

from klack.exchange.results.table import ResultAxis, ResultChannel, ResultTable, file_stems
from klack.files.whole import whole_files

__all__ = ["write_csv"]


def write_csv(table: ResultTable, folder: Path) -> tuple[Path, ...]:
    """Write ``<run>.csv``, ``<run>_<axis>.csv`` for further axes, ``numbers.csv``, ``about.json``.

    UTF-8, comma and decimal point; one line names each column with its unit, ``contact force
    [N]``; the first column is the axis. Every number is the shortest text of its double; missing
    ones are empty. Files of the same names are replaced, once all are complete.
    """
    parts = [
        (run.name if i == 0 else f"{run.name}_{axis.name}", axis, channels)
        for run in table.runs
        for i, (axis, channels) in enumerate(run.along())
    ]
    stems = file_stems(["numbers", *(name for name, _, _ in parts)])[1:]
    with whole_files(folder) as stage:
        for stem, (_, axis, channels) in zip(stems, parts, strict=True):
            _write_curves(stage / f"{stem}.csv", axis, channels)
        _write_numbers(stage / "numbers.csv", table)
        about = {"kind": table.kind, **table.about, "case_text": table.case_text}
        text = json.dumps(about, indent=2, ensure_ascii=False) + "\n"
        (stage / "about.json").write_text(text, encoding="utf-8")
    names = [f"{stem}.csv" for stem in stems]
    return tuple(folder / name for name in (*names, "numbers.csv", "about.json"))


def _write_curves(path: Path, axis: ResultAxis, channels: Sequence[ResultChannel]) -> None:
    known = [item.values for item in channels]
    first = "frequency" if axis.quantity == "frequency" else "time"
    with path.open("w", encoding="utf-8", newline="") as file:
        header = [f"{first} [{axis.unit}]", *(f"{item.name} [{item.unit}]" for item in channels)]
        csv.writer(file, lineterminator="\n").writerow(header)
        columns = [map(_text, values.tolist()) for values in (axis.values, *known)]
        file.writelines(",".join(row) + "\n" for row in zip(*columns, strict=True))


def _write_numbers(path: Path, table: ResultTable) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", "name", "value", "unit", "meaning"])
        for run in table.runs:
            for item in run.scalars:
                writer.writerow([run.name, item.name, _text(item.value), item.unit, item.meaning])


def _text(value: float) -> str:
    return "" if isnan(value) else repr(value)
