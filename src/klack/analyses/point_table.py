"""Points of a parameter space and their measures."""

import csv
from dataclasses import dataclass
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack import __version__
from klack.analyses.measures import Measure
from klack.errors import InputError, MissingExtraError
from klack.files.whole import whole_file
from klack.input.problem import nearest, one_of

__all__ = ["NOT_COMPUTED", "PointColumn", "PointTable", "RunsInterrupted", "column_of"]

NOT_COMPUTED = "not computed: the runs were interrupted before this point"
_SHOWN = 10  # rows of a short view


@dataclass(frozen=True, slots=True, eq=False)
class PointColumn:
    """One column of a table of points.

    Parameters
    ----------
    name
        Key or measure.
    unit
        SI; ``"1"`` for pure numbers, empty for texts.
    values (points,)
        Numbers or nan; of a key without unit its text.
    """

    name: str
    unit: str
    values: NDArray[Any]
    measure: Measure[Any] | None = None

    @property
    def head(self) -> str:
        """Name with the unit."""
        return self.name if self.unit in ("", "1") else f"{self.name} [{self.unit}]"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointTable:
    """Measures of a case at points of its parameter space, one row per point in the given order.

    Parameters
    ----------
    points
        Changed keys, in SI; nan or None where a point leaves the case as it is.
    measures
        In the order asked for; nan where a run does not have the number.
    failures
        Why a point has no measures; else empty.
    warnings
        Doubts about the numbers of each point.
    steps
        Of strokes: halvings of the steps, and the largest change over the promised accuracy with
        steps twice as long (certified up to 0.5).
    """

    case: str
    variant: str
    points: tuple[PointColumn, ...]
    measures: tuple[PointColumn, ...]
    failures: tuple[str, ...]
    warnings: tuple[tuple[str, ...], ...]
    steps: tuple[PointColumn, ...] = ()

    def __len__(self) -> int:
        return len(self.failures)

    @property
    def columns(self) -> tuple[PointColumn, ...]:
        """Points, measures, then the check of steps."""
        return (*self.points, *self.measures, *self.steps)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Values of a key or a measure, shape (points,)."""
        for column in self.columns:
            if column.name == name:
                return column.values
        names = [column.name for column in self.columns]
        raise InputError(
            "column of a table of points",
            got=f"'{name}'",
            expected=f"one of: {one_of(names)}",
            hint=nearest(str(name), names, "name a key or a measure of this table."),
        )

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Points without measures, shape (points,)."""
        return np.array([bool(text) for text in self.failures], dtype=bool)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Columns by name, then texts ``"failure"`` and ``"doubts"`` of each point."""
        found = {column.name: column.values for column in self.columns}
        return found | {name: np.array(texts, dtype=object) for name, texts in self._texts}

    @property
    def _texts(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        return (("failure", self.failures), ("doubts", tuple(map("\n".join, self.warnings))))

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame``; units are in its ``attrs["units"]``."""
        try:
            from pandas import DataFrame
        except ImportError:
            raise MissingExtraError("pandas", "A table of points as a DataFrame", None) from None
        frame = DataFrame(self.arrays())
        frame.attrs["units"] = {column.name: column.unit for column in self.columns}
        return frame

    def to_csv(self, file: str | Path) -> Path:
        """Write a CSV file: a head with units, all digits, empty where there is no number.

        The last two columns say why a point has no measures, and what speaks against its numbers.
        """
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        names, texts = zip(*self._texts, strict=True)
        writer.writerow([*(column.head for column in self.columns), *names])
        for i, said in enumerate(zip(*texts, strict=True)):
            writer.writerow([*(_text(column.values[i], "", "") for column in self.columns), *said])
        path = Path(file)
        with whole_file(path) as part:
            part.write_text(text.getvalue(), encoding="utf-8", newline="")
        return path

    def to_parquet(self, file: str | Path) -> Path:
        """Write a Parquet file; units are in the metadata of fields."""
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            raise MissingExtraError("pyarrow", "A table of points as Parquet", "parquet") from None
        units = {column.name: column.unit for column in self.columns}
        arrays = {name: pyarrow.array(_plain(x)) for name, x in self.arrays().items()}
        fields = [
            pyarrow.field(name, array.type, metadata={"unit": units[name]} if name in units else {})
            for name, array in arrays.items()
        ]
        about = {"case": self.case, "variant": self.variant, "klack": __version__}
        schema = pyarrow.schema(fields, metadata=about)
        path = Path(file)
        with whole_file(path) as part:
            parquet.write_table(pyarrow.table(list(arrays.values()), schema=schema), part)
        return path

    def __repr__(self) -> str:
        rows = [[column.head for column in self.columns]]
        rows += [self._row(i) for i in range(min(len(self), _SHOWN))]
        widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
        lines = ["  ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in rows]
        marks = ["", *(_first_line(text) for text in self.failures)]
        table = [f"{line}  {mark}".rstrip() for line, mark in zip(lines, marks, strict=False)]
        return "\n".join([self._title(), *table, *self._rest()])

    def _repr_html_(self) -> str:
        heads = "".join(f"<th>{escape(column.head)}</th>" for column in self.columns)
        rows = "".join(
            "<tr>"
            + "".join(f"<td>{escape(cell)}</td>" for cell in self._row(i))
            + f"<td>{escape(_first_line(self.failures[i]))}</td></tr>"
            for i in range(min(len(self), _SHOWN))
        )
        rest = "".join(f"<p>{escape(line)}</p>" for line in self._rest())
        return (
            f"<b>{escape(self._title())}</b><table><thead><tr>{heads}<th></th></tr></thead>"
            f"<tbody>{rows}</tbody></table>{rest}"
        )

    def _title(self) -> str:
        failed = int(self.failed.sum())
        doubts = sum(bool(notes) for notes in self.warnings)
        parts = [f"{self.case}, {self.variant}: {len(self)} points"]
        parts += [f"{failed} without measures"] if failed else []
        parts += [f"{doubts} with warnings"] if doubts else []
        return ", ".join(parts)

    def _row(self, i: int) -> list[str]:
        return [_text(column.values[i], "-", ".6g") for column in self.columns]

    def _rest(self) -> list[str]:
        return [f"... and {len(self) - _SHOWN} more"] if len(self) > _SHOWN else []


class RunsInterrupted(KeyboardInterrupt):
    """Ctrl-C during the runs of many points.

    ``table`` is what was computed until then; the other points say that they were not computed.
    """

    def __init__(self, table: PointTable) -> None:
        super().__init__(f"interrupted after {int((~table.failed).sum())} of {len(table)} points")
        self.table = table


def column_of(
    name: str, unit: str, values: list[Any], measure: Measure[Any] | None = None
) -> PointColumn:
    """Column of floats with a unit, nan for None; else of objects."""
    if not unit:
        kept = np.empty(len(values), dtype=object)
        kept[:] = values
        return PointColumn(name, unit, kept, measure)
    numbers = [float("nan") if value is None else float(value) for value in values]
    return PointColumn(name, unit, np.array(numbers, dtype=float), measure)


def _plain(values: NDArray[Any]) -> list[Any]:
    found = values.tolist()
    if values.dtype == object and not all(x is None or isinstance(x, str) for x in found):
        return [None if x is None else str(x) for x in found]
    return found


def _text(value: Any, none: str, form: str) -> str:
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return none
    return format(float(value), form) if isinstance(value, float) else str(value)


def _first_line(text: str) -> str:
    return text.partition("\n")[0]
