"""Dialect of a text table: encoding, separator, decimal mark and header.

Separator and decimal mark are those with which most lines, in the beginning, the middle and the
end of the file, become rows of numbers of one length. The header is above the first such row.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from klack.errors import InputError
from klack.measurement.files.clock import instant, is_clock
from klack.measurement.files.number_kernel import MISSING, WHITESPACE
from klack.measurement.unit_text import is_unit, no_unit, plain_unit, unit_factor
from klack.units import TIME

__all__ = [
    "SEQUENCE",
    "Column",
    "Dialect",
    "TableHeader",
    "encoding_of",
    "find_dialect",
    "first_row",
    "read_columns",
    "read_header",
    "rows_above",
    "split_label",
]


_SEPARATORS = (";", "\t", ",", "|", "")
_NAMES = {";": "semicolons", "\t": "tabs", ",": "commas", "|": "bars", "": "blanks"}
SEQUENCE = "sequence"
"""Unit of a column that counts the rows."""
_COMMENTS = "#%!;"
_NO_COLUMN = {"", "comment"}  # LabVIEW names a column of remarks that is not there
_AXIS = ("x-axis", "x axis", "x", "time")
_FOLLOWING = 3  # rows of numbers that end a header
_NUMBERS = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eEdD][+-]?\d+)?"),
}
_LIKE_NUMBER = re.compile(r"[^A-Za-z\[(]*\d[^A-DF-Za-df-z]*|[-+]?[\d.]+\w*")
_BRACKETS = re.compile(r"(?P<name>.*?)\s*(?P<open>[\[({])(?P<unit>[^\[\]{}]*)[\])}]")
_SLASH = re.compile(r"(?P<name>.*?\S)(?:\s*/\s*|\s+in\s+)(?P<unit>\S+)")
_SUFFIX = re.compile(r"(?P<name>.*[^_])_(?P<unit>[A-Za-zµμ][A-Za-zµμ0-9]*)")
_NO_SUFFIX = re.compile(r"(ch|channel|kanal|phase|probe|sensor|input|trace)", re.IGNORECASE)
_WORDS = re.compile(r"[^\s\[({]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?|\[[^\]]*\]|\([^)]*\)")


@dataclass(frozen=True, slots=True)
class Dialect:
    """Separator ("" for runs of blanks), decimal mark, and number of columns."""

    separator: str
    decimal: str
    width: int

    @property
    def separator_byte(self) -> int:
        """For the compiled reader."""
        return ord(self.separator) if self.separator else WHITESPACE

    @property
    def comments(self) -> str:
        """Signs that begin a comment."""
        return _COMMENTS.replace(self.separator, "") if self.separator else _COMMENTS

    def __str__(self) -> str:
        return f"{_NAMES[self.separator]}, decimal {'point' if self.decimal == '.' else 'comma'}"


@dataclass(frozen=True, slots=True)
class Column:
    """Name, unit and header text of a column."""

    name: str
    unit: str
    label: str


def encoding_of(head: bytes) -> str:
    """Encoding by the first bytes: UTF-8, UTF-16 (also without mark), Latin-1."""
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if head[:3] == b"\xef\xbb\xbf":
        return "utf-8-sig"
    if head[1:60:2].count(0) > len(head[1:60:2]) // 2:
        return "utf-16-le"
    if head[0:60:2].count(0) > len(head[0:60:2]) // 2:
        return "utf-16-be"
    try:
        head[: max(len(head) - 4, 1)].decode("utf-8")  # the last sign may be cut
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _cells(line: str, separator: str) -> list[str]:
    cells = line.split(separator) if separator else line.split()
    return [cell.strip().strip('"').strip() for cell in cells]


def find_dialect(head: Sequence[str], samples: Iterable[str]) -> Dialect | None:
    """Choose separator and decimal mark; None if no line is a row of numbers.

    Parameters
    ----------
    samples
        Complete lines from anywhere.
    """
    lines = [line for line in samples if line.strip() and line.lstrip()[0] not in "#%!"]
    best, most = None, (0, 0, 0)
    for separator in _SEPARATORS:
        for decimal in ".,":
            if decimal == separator:
                continue
            widths = Counter(_width(line, separator, decimal) for line in lines)
            widths.pop(0, None)
            if not widths:
                continue
            rows = sum(widths.values())
            # rows that end early miss their last values: the widest row counts, unless it is alone
            width = max(w for w in widths if widths[w] >= min(2, max(widths.values())))
            score = (rows, max(widths.values()), width)
            if score > most:
                best, most = Dialect(separator, decimal, width), score
    if best is not None and best.separator == "," and best.width == 2:
        return _one_or_two(head, lines, best)
    return best


def _one_or_two(head: Sequence[str], lines: Sequence[str], found: Dialect) -> Dialect:
    """Whether ``0,5`` is one column with a decimal comma or two, by the header."""
    alone = Dialect("", ",", 1)
    rows = [line for line in lines if _width(line, found.separator, found.decimal)]
    if any(_width(line, alone.separator, alone.decimal) != 1 for line in rows):
        return found
    names = [line for line in head[: first_row(head, alone)] if line.strip(" #%!;\t")]
    return alone if names and all("," not in line for line in names) else found


def _width(line: str, separator: str, decimal: str) -> int:
    """Cells of a row of numbers, without empty ones at its end; else 0."""
    cells = _cells(line, separator)
    while cells and not cells[-1]:
        cells.pop()
    pattern, numbers = _NUMBERS[decimal], 0
    for cell in cells:
        if pattern.fullmatch(cell):
            numbers += 1
        elif cell.lower() not in MISSING and cell.lower().lstrip("+-") not in MISSING:
            return 0
    return len(cells) if numbers else 0


def first_row(lines: Sequence[str], dialect: Dialect) -> int:
    """Index of the first row of numbers followed by more; their count without."""
    at = [
        k
        for k, line in enumerate(lines)
        if line.strip() and line.lstrip()[0] not in dialect.comments
    ]
    good = [0 < _width(lines[k], dialect.separator, dialect.decimal) <= dialect.width for k in at]
    for n, k in enumerate(at):
        if all(good[n : n + _FOLLOWING]):
            return k
    return len(lines)


def rows_above(header: Sequence[str], dialect: Dialect) -> list[int]:
    """Header lines that are rows of a table of several columns: whole, or the damaged last."""
    if dialect.width < 2:
        return []
    found = [
        k
        for k, line in enumerate(header)
        if _width(line, dialect.separator, dialect.decimal) == dialect.width
    ]
    last = len(header) - 1
    if last > 0 and last not in found:
        cells = _cells(header[last], dialect.separator)
        if 2 * sum(map(_like_number, cells)) > max(len(cells), dialect.width):
            found.append(last)
    return found


def _like_number(cell: str) -> bool:
    return _LIKE_NUMBER.fullmatch(cell) is not None


def read_columns(header: Sequence[str], dialect: Dialect) -> tuple[Column, ...] | None:
    """Names and units from the lines above the numbers; None without a row of names.

    A row of names has a cell for every column; a row of units may follow, else see
    :func:`split_label`. Where blanks separate, any sentence looks like names: only the last lines
    count.
    """
    lines = [line for line in header if line.strip(dialect.comments + "/ \t\r\n")]
    if not dialect.separator:
        lines = lines[-2:]
    found = [_header_cells(line, dialect) for line in lines]
    if not dialect.separator and found and found[-1] is None:
        return None
    rows = [cells for cells in found if cells is not None]
    if not rows:
        return None
    units: list[str] = [""] * dialect.width
    names = rows.pop()
    if rows and (all(map(_like_number, filter(None, names))) or _named_after(rows[-1], names)):
        names = rows.pop()  # the other is a damaged row of numbers
    if _is_unit_row(names):
        units = [plain_unit(cell) for cell in names]
        names = rows.pop() if rows else [f"column {k + 1}" for k in range(dialect.width)]
    return tuple(_column(name, unit) for name, unit in zip(names, units, strict=True))


def _named_after(above: Sequence[str], cells: Sequence[str]) -> bool:
    """Whether the row above alone names a time with unit, and this is no row of units."""
    first, unit = split_label(above[0])
    return (
        bool(unit)
        and is_clock(first, unit)
        and not (_is_unit_row(cells) or is_clock(*split_label(cells[0])))
    )


def _header_cells(line: str, dialect: Dialect) -> list[str] | None:
    """Cells of a header line if one for every column."""
    text = line.strip("\r\n ")
    if text[:1] in tuple(dialect.comments):
        text = text.lstrip(dialect.comments + "/ \t")
    others = [s for s in _SEPARATORS if s not in (dialect.separator, "")]
    for separator in (dialect.separator, *others):
        cells = (
            _cells(text, separator)
            if separator
            else [word.strip('"') for word in _WORDS.findall(text)]
        )
        while len(cells) > dialect.width and cells[-1].lower() in _NO_COLUMN:
            cells.pop()
        if len(cells) == dialect.width - 1 and dialect.width > 2 and separator:
            cells.append("")  # the last column has no name
        numbers = any(_NUMBERS[dialect.decimal].fullmatch(cell) for cell in cells)
        if numbers and cells[0].lower() in _AXIS and all(c.isdigit() for c in cells[1:]):
            numbers = False  # channels are called by their numbers
        if len(cells) == dialect.width and any(cells) and not numbers:
            return cells
    return None


def _is_unit_row(cells: Sequence[str]) -> bool:
    written = [cell for cell in cells if not no_unit(cell)]
    return bool(written) and all(
        is_unit(cell) or re.fullmatch(r"[\[(].*[\])]", cell) or cell.lower() == SEQUENCE
        for cell in written
    )


def split_label(label: str) -> tuple[str, str]:
    """Name and unit of ``lift [um]``, ``lift (um)``, ``lift / um``, ``lift in um``, ``lift_um``.

    The last form keeps its unit in the name.

    Examples
    --------
    >>> split_label("lift [µm]"), split_label("p_rail_bar"), split_label("Channel A")
    (('lift', 'um'), ('p_rail_bar', 'bar'), ('Channel A', ''))
    """
    match = _BRACKETS.fullmatch(label)
    if match and match["name"]:
        unit = match["unit"]
        if no_unit(unit):
            return match["name"], ""
        if match["name"].lower() == "time" and is_unit(unit.lower()):
            return match["name"], unit.lower()  # Scopy writes Time(S)
        if match["open"] == "[" or is_unit(unit):
            return match["name"], plain_unit(unit)
    match = _SLASH.fullmatch(label)
    if match and is_unit(match["unit"]):
        return match["name"], plain_unit(match["unit"])
    match = re.fullmatch(r"in (\S+)", label)
    if match and is_unit(match[1]):
        return "", plain_unit(match[1])
    match = _SUFFIX.fullmatch(label)
    if match and is_unit(match["unit"]) and not _NO_SUFFIX.fullmatch(match["name"]):
        return label, plain_unit(match["unit"])
    return label, ""


def _column(label: str, unit: str) -> Column:
    name, found = split_label(label)
    return Column(name, unit or found, label)


_STEPS = (
    *("sample interval", "sampling interval", "sample period", "sampling period", "increment"),
    *("tinc", "xinc", "x inc", "xincrement", "x increment", "delta x", "hresolution", "dt"),
    "delta(second)",
)
_RATES = ("sample rate", "samplerate", "sampling rate", "sampling frequency", "sample frequency")
_STARTS = ("xorg", "xorigin", "x origin", "x0", "t0", "hoffset", "xstart", "xzero", "start")
_INDICES = ("zero index", "trigger point", "trigger address")  # samples before the zero of time
_COUNTS = (
    *("record length", "points", "samples", "blocksize", "nr of samples", "memory length"),
    "segmentsize",
)
_TIME_UNITS = ("horizontal units", "hunit", "xunits", "x units", "x unit")
_UNITS = ("vertical units", "vunit", "y unit label", "yunits", "y units", "y unit")
_SOURCE_NAMES = ("source", "tracename", "trace name")
_HERTZ = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0, "sa/s": 1.0}
_VALUE = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)")
_EQUATION = re.compile(r"(?P<key>[A-Za-z]\w*)\s*=\s*(?P<value>.+)")
_BARE = re.compile(r"[\s_:]+")


_Said = Mapping[str, tuple[str, list[str]]]
"""Words as written and their values, by the word in plain letters."""


@dataclass(frozen=True, kw_only=True)
class TableHeader:
    """One value for all channels, or one for each; none where the file says nothing.

    As of oscilloscopes and loggers: ``Sample Interval,1e-9``, ``Vertical Units,V,A``, ``Delta_X
    1e-5 1e-5``, ``t0 = -5e-3``, or ``Start,Increment`` above two numbers.

    Parameters
    ----------
    starts, steps [s]
    origins [ns]
        Zero of time since 1970.
    count
        Rows of the table, or of each segment; 0 if not given.
    words
        Source of the step, ``"Sample Interval"``.
    """

    starts: tuple[float, ...] = ()
    steps: tuple[float, ...] = ()
    units: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    origins: tuple[int | None, ...] = ()
    count: int = 0
    words: str = ""


def read_header(
    lines: Sequence[str], separator: str, decimal: str
) -> tuple[TableHeader, list[str]]:
    """Header, and its lines without the cells of start and increment beside names."""
    said: dict[str, tuple[str, list[str]]] = {}
    rows = [_said_cells(line, separator) for line in lines]
    read: list[set[int]] = [set() for _ in rows]
    for k, cells in enumerate(rows):
        below = rows[k + 1] if k + 1 < len(rows) else []
        for place, cell in enumerate(cells):
            if found := _EQUATION.fullmatch(cell):
                said[_key(found["key"])] = found["key"], [found["value"]]
                read[k].add(place)
            elif place and _key(cell) in (*_STARTS, *_STEPS) and _is_number(below, place, decimal):
                said[_key(cell)] = cell, [below[place]]
                read[k].add(place)
                read[k + 1].add(place)
        if len(cells) > 1:
            said[_key(cells[0])] = cells[0], cells[1:]
        elif ":" in cells[0]:
            key, _, value = cells[0].partition(":")
            said[_key(key)] = key, [value.strip()]
    texts = [
        separator.join(cell for place, cell in enumerate(cells) if place not in used)
        if used and separator
        else line
        for line, cells, used in zip(lines, rows, read, strict=True)
    ]
    return _header({key: value for key, value in said.items() if key}, decimal), texts


def _header(said: _Said, decimal: str) -> TableHeader:
    about = TableHeader(
        units=_texts(said, _UNITS),
        names=_texts(said, _SOURCE_NAMES),
        origins=_dates(said),
        count=next((int(n) for n in _first(said, _COUNTS, decimal, 1.0)[1] if n >= 1.0), 0),
    )
    unit = next((said[key][1][0] for key in _TIME_UNITS if key in said), "s")
    try:
        second = 1.0 if no_unit(unit) else unit_factor(_bare(unit), TIME, "header").factor
    except InputError:
        return about  # over something else than time
    words, steps = _first(said, _STEPS, decimal, second)
    if not steps:
        words, rates = _first(said, _RATES, decimal, 0.0)
        steps = tuple(1.0 / rate for rate in rates if rate > 0.0)
    starts = _first(said, _STARTS, decimal, second)[1]
    if steps and not starts:
        starts = tuple(-steps[0] * at for at in _first(said, _INDICES, decimal, 1.0)[1])
    steps = tuple(step for step in steps if step > 0.0)
    return replace(about, starts=starts, steps=steps, words=words)


def _texts(said: _Said, keys: Sequence[str]) -> tuple[str, ...]:
    return tuple(_bare(text) for key in keys if key in said for text in said[key][1] if text)


def _dates(said: _Said) -> tuple[int | None, ...]:
    days, times = (said.get(key, ("", []))[1] for key in ("date", "time"))
    return tuple(
        instant(f"{day} {time}") for day, time in zip(days, times, strict=False) if day and time
    )


def _first(
    said: _Said, keys: Sequence[str], decimal: str, second: float
) -> tuple[str, tuple[float, ...]]:
    """Word and numbers of the first existing key; times in seconds, rates (0) in hertz."""
    for key in keys:
        word, texts = said.get(key, ("", []))
        found = tuple(_numbers((text for text in texts if text), decimal, second))
        if found:
            return word, found
    return "", ()


def _numbers(texts: Iterator[str], decimal: str, second: float) -> Iterator[float]:
    for text in texts:
        found = _VALUE.fullmatch(_bare(text).replace(decimal, "."))
        if found is None:
            return
        number, unit = float(found["number"]), found["unit"]
        if second == 0.0:
            if unit.lower() not in _HERTZ:
                return
            yield number * _HERTZ[unit.lower()]
        elif unit:
            try:
                yield number * unit_factor(unit, TIME, "header").factor
            except InputError:
                return
        else:
            yield number * second


def _bare(text: str) -> str:
    """Value without its channel, ``CH1:V``."""
    return text.rsplit(":", 1)[-1].strip()


def _is_number(cells: Sequence[str], place: int, decimal: str) -> bool:
    return place < len(cells) and _VALUE.fullmatch(cells[place].replace(decimal, ".")) is not None


def _said_cells(line: str, separator: str) -> list[str]:
    text = line.strip(" \r\n").lstrip("#%!" if separator == ";" else "#%!;").strip(" ")
    cells = text.split(separator) if separator else re.split(r"\t|\s{2,}", text)
    return [cell.strip().strip('"').strip() for cell in cells]


def _key(text: str) -> str:
    return _BARE.sub(" ", text).strip().lower()
