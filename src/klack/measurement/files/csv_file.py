"""Text tables: any separator and either decimal mark."""

import re
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.files.clock import (
    SLOWEST,
    clock_factor,
    instant,
    is_clock,
    no_clock,
    unique_names,
)
from klack.measurement.files.csv_dialect import (
    SEQUENCE,
    Column,
    Dialect,
    TableHeader,
    encoding_of,
    find_dialect,
    first_row,
    read_columns,
    read_header,
    rows_above,
)
from klack.measurement.files.number_kernel import TOO_MANY, parse_rows
from klack.measurement.recording import ChannelInfo, Recording

__all__ = ["CsvFile"]


_KEPT = 32_000_000  # numbers kept in memory, 256 MB
_BLOCK = 1_000_000  # numbers parsed at once
_RECENT = 16  # blocks of a large table kept, 128 MB
_CELL = 40  # bytes of a faulty cell shown


class NumberTable:
    """Columns of numbers.

    One pass counts rows and finds faults: a cell that is no number, a row with too many. Tables of
    moderate size stay in memory; of larger ones only the places of the blocks, which are parsed
    again when needed.

    Parameters
    ----------
    data
        The whole file, in an encoding that agrees with ASCII.
    start
        First byte of the rows.
    """

    def __init__(self, path: Path, data: NDArray[np.uint8], start: int, dialect: Dialect) -> None:
        self.path, self._data, self._dialect = path, data, dialect
        self._comments = np.frombuffer(dialect.comments.encode(), np.uint8)
        self._place = np.arange(dialect.width)
        self._block_rows = max(_BLOCK // dialect.width, 256)
        self._kept: dict[int, NDArray[np.float64]] = {}
        self._offsets: list[int] = []
        self.rows = 0
        self.filled = np.zeros(dialect.width, dtype=np.int64)
        self._go_through(start)

    def _go_through(self, at: int) -> None:
        while at < self._data.size:
            block, behind = self._parse(at)
            if block.shape[1] == 0:
                break
            for column, values in enumerate(block):
                present = np.flatnonzero(np.isfinite(values[-1:]))
                if present.size == 0:
                    present = np.flatnonzero(np.isfinite(values))
                    last = present[-1] + 1 if present.size else 0
                else:
                    last = values.size
                if last:
                    self.filled[column] = self.rows + last
            if self.rows * self._dialect.width < _KEPT:
                self._kept[len(self._offsets)] = block
            self._offsets.append(at)
            self.rows += block.shape[1]
            at = behind
        if self.rows * self._dialect.width >= _KEPT:
            self._kept.clear()

    def _parse(self, at: int) -> tuple[NDArray[np.float64], int]:
        out = np.empty((self._dialect.width, self._block_rows))
        rows, behind, error, column = parse_rows(
            self._data,
            at,
            self._dialect.separator_byte,
            ord(self._dialect.decimal),
            self._comments,
            self._place,
            out,
        )
        if error:
            raise self._fault(error, behind, column)
        return (out if rows == out.shape[1] else out[:, :rows].copy()), behind

    def _fault(self, error: int, at: int, column: int) -> InputError:
        line = np.count_nonzero(self._data[:at] == ord("\n")) + 1
        text = self._data[at : at + _CELL].tobytes().decode("latin-1").splitlines()[0]
        cell = (
            text.split(self._dialect.separator)[0] if self._dialect.separator else text.split()[0]
        )
        where = f"{self.path}:{line}, column {column + 1}"
        if error == TOO_MANY:
            return InputError(
                where,
                got=f"a surplus value '{cell.strip()}'",
                expected=f"{self._dialect.width} values ({self._dialect})",
                hint="check the line; every row needs the same columns.",
            )
        return InputError(
            where,
            got=f"'{cell.strip()}'",
            expected=f"a number ({self._dialect})",
            hint="correct the line, or begin it with # if it is a comment.",
        )

    def column(self, column: int, first: int, last: int) -> NDArray[np.float64]:
        """Rows ``first`` to before ``last``; missing values are nan."""
        parts = [
            self._block(k)[
                column, max(first - k * self._block_rows, 0) : last - k * self._block_rows
            ]
            for k in range(first // self._block_rows, -(-last // self._block_rows))
        ]
        return np.concatenate(parts) if parts else np.empty(0)

    def _block(self, k: int) -> NDArray[np.float64]:
        if k not in self._kept:
            if self.rows * self._dialect.width >= _KEPT and len(self._kept) >= _RECENT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[k], _ = self._parse(self._offsets[k])
        return self._kept[k]


Vector = NDArray[np.float64]
Value = TypeVar("Value")

_LEFT_OF_ROWS = re.compile(rb"Record Length,[^,\r\n]*,[^,\r\n]*,\s*[-+.\d]+[^,\r\n]*,\s*[-+.\d]")
_STAMP = re.compile(
    rb"(?<![\d:.])(?P<day>\d{4}[-/.]\d\d?[-/.]\d\d?[T ]+)?"
    rb"\d\d?:\d\d:\d\d[.,]\d+(Z|[+-]\d\d:\d\d)?(?![\d:])"
)
_LARGEST_REWRITTEN = 1 << 28  # bytes
_APART = ".wfm.csv"
_LENGTHS = (("SignalHardwareRecordLength", "HardwareXStart"), ("RecordLength", "XStart"))
_HEAD = 1 << 18  # bytes in which the header must end
_SAMPLE = 1 << 14  # bytes looked at in the middle and at the end
_TIME_BLOCK = 1 << 20  # rows looked at together
_SHORTEST_SEGMENT, _MOST_SEGMENTS = 20, 10_000  # rows, segments
_TRIED = 1000  # rows by which a first column without name is recognised as time


class CsvFile(Recording):
    """Table of a text file.

    A time, by its name or unit, holds for the columns right of it, up to the next one; without
    one, ``time_step`` [s] is needed. Missing values at the end of a column end the channel; others
    are nan. Where a time restarts (segments of an oscilloscope), each part is a channel.
    """

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        data = _bytes_of(path)
        data = _stamps_as_numbers(_beside(_with_its_header(path, data)))
        dialect, columns, header, texts, start = _survey(path, data)
        self._table = NumberTable(path, data, start, dialect)
        self._column: dict[str, tuple[int, int]] = {}  # and first row
        self._factor: dict[str, float] = {}
        self._segments: dict[int, list[tuple[int, int]]] = {}
        self._clock_column: dict[str, tuple[int, int]] = {}
        notes: list[str] = []
        if above := rows_above(texts, dialect):
            notes.append(
                f"{path.name}: {len(above)} row{'s' * (len(above) > 1)} above the first complete "
                f"rows, from line {above[0] + 1}, left out."
            )
        if len(header.names) == dialect.width:
            columns = tuple(Column(name, "", name) for name in header.names)
        if columns is None:
            notes.append(f"{path.name}: no column names; they are called column 1, column 2, ...")
            columns = tuple(Column(f"column {k + 1}", "", "") for k in range(dialect.width))
            clocks = _first_as_clock(path, self._table, time_step, notes)
        else:
            clocks = _named_clocks(path, self._table, columns, time_step, notes)
        channels = self._channels(columns, clocks, time_step, header, notes)
        if not channels and self._table.rows:
            notes.append("all values are missing or marked as over range")
        longest = max((channel.count for channel in channels), default=0)
        if header.count and longest != header.count:
            notes.append(
                f"{path.name}: the header states {header.count} rows, but the table has {longest}."
            )
        super().__init__(path, channels, tuple(notes))

    def _channels(
        self,
        columns: tuple[Column, ...],
        clocks: dict[int, float],
        time_step: float | None,
        header: TableHeader,
        notes: list[str],
    ) -> tuple[ChannelInfo, ...]:
        times = {k for k, c in enumerate(columns) if k in clocks or is_clock(c.name, c.unit)}
        counts = {k for k, c in enumerate(columns) if c.unit.lower() == SEQUENCE}
        times |= counts
        values = [k for k in range(len(columns)) if k not in times]
        if not clocks and time_step is None and header.steps:
            notes.append(f"{self._table.path.name}: time made from '{header.words}' of the header.")
        names = unique_names([c.name or f"column {k + 1}" for k, c in enumerate(columns)])
        channels = []
        for k, column in enumerate(columns):
            filled = int(self._table.filled[k])
            if k in times or filled == 0:
                continue
            place = values.index(k)
            unit = column.unit or _of(header.units, place, len(values), all_of_one=False) or ""
            start, step, parts = 0.0, time_step, [(0, filled)]
            of = max((c for c in clocks if c < k), default=min(clocks, default=0))
            if clocks:
                parts = self._parts(of, notes)
            elif time_step is None:
                start = _of(header.starts, place, len(values)) or 0.0
                step = _of(header.steps, place, len(values))
                start += self._first_count(counts) * (step or 0.0)
            for number, (begin, end) in enumerate(parts, start=1):
                count, clock = min(filled, end) - begin, ""
                behind = f" #{number}" if len(parts) > 1 else ""
                if count < 1:
                    continue
                if clocks:
                    clock = names[of] + behind
                    self._clock_column[clock], self._factor[clock] = (of, begin), clocks[of]
                    start, step = self._mean_step(of, clocks[of], begin, begin + count)
                if step is None:
                    looked = ", ".join(f"'{c.label or c.name}'" for c in columns[:12])
                    raise no_clock(str(self._table.path), f" among the columns {looked}")
                self._column[names[k] + behind] = k, begin
                channels.append(
                    ChannelInfo(
                        name=names[k] + behind,
                        unit=unit,
                        count=count,
                        start=start,
                        step=step,
                        clock=clock,
                        label=column.label,
                        origin=_of(header.origins, place, len(values)),
                    )
                )
        return tuple(channels)

    def _parts(self, clock: int, notes: list[str]) -> list[tuple[int, int]]:
        """Rows of each segment, where a time restarts from one value."""
        if clock in self._segments:
            return self._segments[clock]
        count, begins, last = int(self._table.filled[clock]), [0], np.inf
        for first in range(0, count, _TIME_BLOCK):
            time = self._table.column(clock, first, min(first + _TIME_BLOCK, count))
            back = np.flatnonzero(np.diff(time, prepend=last) < 0.0)
            begins += (first + back[back + first > 0]).tolist()
            last = float(time[-1])
            if len(begins) > _MOST_SEGMENTS:
                break
        parts = list(zip(begins, [*begins[1:], count], strict=True))
        if not self._alike(clock, parts):
            parts = [(0, count)]
        if len(parts) > 1:
            notes.append(
                f"{self._table.path.name}: the time restarts; the record is cut into "
                f"{len(parts)} parts."
            )
        self._segments[clock] = parts
        return parts

    def _alike(self, clock: int, parts: list[tuple[int, int]]) -> bool:
        """True for parts of one length that start within a step."""
        lengths = [end - begin for begin, end in parts]
        if min(lengths) < _SHORTEST_SEGMENT or max(lengths) - min(lengths) > 2:
            return False
        two = self._table.column(clock, 0, 2)
        starts = [float(self._table.column(clock, begin, begin + 1)[0]) for begin, _ in parts]
        return max(starts) - min(starts) <= two[1] - two[0]

    def _first_count(self, columns: set[int]) -> float:
        """First number of a column that counts the rows; rejects gaps."""
        for column in columns:
            rows = int(self._table.filled[column])
            first, last = (self._table.column(column, k, k + 1)[0] for k in (0, rows - 1))
            if last - first == rows - 1:
                return float(first)
            raise InputError(
                f"{self._table.path.name}: column {column + 1}",
                got=f"{rows} rows counted from {first:g} to {last:g}",
                expected="every row of the record",
                hint="export the whole record again.",
            )
        return 0.0

    def _mean_step(
        self, clock: int, factor: float, begin: int, end: int
    ) -> tuple[float, float | None]:
        first, last = (float(self._table.column(clock, k, k + 1)[0]) for k in (begin, end - 1))
        return factor * first, factor * (last - first) / max(end - begin - 1, 1)

    def _values(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        column, begin = self._column[channel.name]
        return self._table.column(column, begin + first, begin + last)

    def place(self, name: str, sample: int) -> str:
        """Row of a sample among the rows of numbers."""
        return f"row {self._column[name][1] + sample + 1} of its numbers"

    def _clock_time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        column, begin = self._clock_column[channel.clock]
        time = self._table.column(column, begin + first, begin + last)
        return self._factor[channel.clock] * time


def _bytes_of(path: Path) -> NDArray[np.uint8]:
    """File as bytes that agree with ASCII; mapped, but for UTF-16."""
    with path.open("rb") as file:
        encoding = encoding_of(file.read(_HEAD))
    if encoding.startswith("utf-16"):
        text = path.read_bytes().decode(encoding, errors="replace")
        return np.frombuffer(text.encode("utf-8"), np.uint8)
    return np.asarray(np.memmap(path, np.uint8, "r"))


def _of(
    values: tuple[Value, ...], place: int, count: int, *, all_of_one: bool = True
) -> Value | None:
    """Value of one of ``count`` channels; a single one holds for all if ``all_of_one``."""
    if len(values) == count:
        return values[place]
    return values[0] if len(values) == 1 and all_of_one else None


def _beside(data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Tektronix table whose header is left of its first rows."""
    head = data[:200].tobytes()
    if not _LEFT_OF_ROWS.match(head) or data.size > _LARGEST_REWRITTEN:
        return data
    rows = [line.split(",") for line in data.tobytes().decode("latin-1").splitlines()]
    said = {row[0]: row[1] for row in rows if len(row) > 4 and row[0]}
    unit, value = said.get("Horizontal Units", "s"), said.get("Vertical Units", "")
    lines = [f"time [{unit}],{said.get('Source', 'value')} [{value}]"]
    lines += [",".join(row[3:5]) for row in rows if len(row) > 4]
    return np.frombuffer("\n".join(lines).encode("latin-1"), np.uint8)


def _with_its_header(path: Path, data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """R&S RTO or RTE table, ``a.Wfm.csv``, under its header ``a.csv``."""
    beside = path.with_name(path.name[: -len(_APART)] + path.suffix)
    if not path.name.lower().endswith(_APART) or not beside.is_file():
        return data
    lines = beside.read_text(encoding="utf-8", errors="replace")[:_HEAD].splitlines()
    said = {key: values for key, *values in (line.rstrip(":").split(":") for line in lines) if key}
    text = data.tobytes()
    count = text.rstrip().count(b"\n") + 1
    for length, start in _LENGTHS:
        try:
            if float(said[length][0]) == count:
                step, begin = float(said["SignalResolution"][0]), float(said[start][0])
                break
        except (KeyError, IndexError, ValueError):
            continue
    else:
        found = said.get(_LENGTHS[0][0], ["none"])
        raise InputError(
            f"{path.name}, with its header {beside.name}",
            got=f"{count} rows, but the header states {' '.join(found)}",
            expected="one record of one channel: SignalHardwareRecordLength rows",
            hint="export each channel and each acquisition as a file of its own.",
        )
    name = " ".join(said.get("Source", ["value"]))
    head = f"XIncrement: {step!r}\nXStart: {begin!r}\nSource: {name}\n"
    return np.frombuffer(head.encode() + text, np.uint8)


def _stamps_as_numbers(data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Table with time stamps as seconds since the first."""
    if data.size > _LARGEST_REWRITTEN:
        return data
    lines = data[:_HEAD].tobytes().splitlines(keepends=True)[:_TRIED]
    stamped = [bool(_STAMP.search(line)) for line in lines]
    begin = next((k for k in range(len(lines) - 2) if all(stamped[k : k + 3])), None)
    if begin is None:
        return data
    at = sum(len(line) for line in lines[:begin])
    zero: int | None = None

    def seconds(found: "re.Match[bytes]") -> bytes:
        nonlocal zero
        text = found[0].decode("ascii")
        stamp = instant(text if found["day"] else f"1970-01-01 {text}")
        if stamp is None:
            return found[0]
        zero = stamp if zero is None else zero
        return b"%de-9" % (stamp - zero)  # without a decimal mark

    text = data.tobytes()
    return np.frombuffer(text[:at] + _STAMP.sub(seconds, text[at:]), np.uint8)


def _survey(
    path: Path, data: NDArray[np.uint8]
) -> tuple[Dialect, tuple[Column, ...] | None, TableHeader, list[str], int]:
    """Dialect, columns (None without header), header, its lines, first byte."""
    raw = data[:_HEAD].tobytes()
    encoding = encoding_of(raw)
    mark = 3 if raw[:3] == b"\xef\xbb\xbf" else 0
    lines = _complete_lines(raw[mark:], data.size > _HEAD)
    texts = [
        line.decode("latin-1" if encoding == "latin-1" else "utf-8", "replace") for line in lines
    ]
    middle = data.size // 2
    dialect = find_dialect(
        texts,
        [
            *texts[:400],
            *texts[400:][-200:],
            *_lines_at(data, middle, middle + _SAMPLE),
            *_lines_at(data, max(data.size - _SAMPLE, mark), data.size),
        ],
    )
    if dialect is None:
        raise InputError(
            str(path),
            got="no line of numbers",
            expected="a table: values separated by commas, semicolons, tabs or spaces",
            hint=f"give {table.name}, whose header this is."
            if (table := path.with_name(path.stem + ".Wfm.csv")).is_file()
            else "check the file; MDF4, TDMS, UFF, HDF5 and MATLAB files are recognised as well.",
        )
    row = first_row(texts, dialect)
    start = mark + sum(len(line) for line in lines[:row])
    header, above = read_header(texts[:row], dialect.separator, dialect.decimal)
    return dialect, read_columns(above, dialect), header, texts[:row], start


def _complete_lines(raw: bytes, cut: bool) -> list[bytes]:
    lines = raw.splitlines(keepends=True)
    return lines[:-1] if cut and len(lines) > 1 else lines


def _lines_at(data: NDArray[np.uint8], first: int, last: int) -> list[str]:
    if data.size <= _HEAD:
        return []
    lines = data[first:last].tobytes().splitlines()[1:]
    if last < data.size:
        lines = lines[:-1]
    return [line.decode("latin-1") for line in lines]


def _named_clocks(
    path: Path,
    table: NumberTable,
    columns: tuple[Column, ...],
    time_step: float | None,
    notes: list[str],
) -> dict[int, float]:
    """Times with their seconds per unit."""
    found = {}
    for k, column in enumerate(columns):
        if not is_clock(column.name, column.unit) or table.filled[k] < 2:
            continue
        if not column.unit and time_step is not None:
            notes.append(f"{path.name}: time without unit replaced by time_step of the case.")
            continue
        count = int(table.filled[k])
        ends = table.column(k, 0, 1)[0], table.column(k, count - 1, count)[0]
        step = float(ends[1] - ends[0]) / (count - 1)
        found[k], note = clock_factor(column.unit, step, f"{path.name}: '{column.label}'")
        if note:
            notes.append(note)
    return found


def _first_as_clock(
    path: Path, table: NumberTable, time_step: float | None, notes: list[str]
) -> dict[int, float]:
    """Take an evenly rising first column without name as time in seconds."""
    if time_step is not None or table.rows < 3 or table.filled.size < 2:
        return {}
    steps = np.diff(table.column(0, 0, min(table.rows, _TRIED)))
    mean = float(np.mean(steps))
    if not 0 < mean <= SLOWEST or np.max(np.abs(steps - mean)) > 0.01 * mean:
        return {}
    notes.append(f"{path.name}: column 1 increases evenly and is taken as the time in seconds.")
    return {0: 1.0}
