"""What the lines above a text table say of all its rows: start and step, units, dates.

Oscilloscopes and loggers write a word and its values, one for all channels or one for each:
``Sample Interval,1e-9``, ``Vertical Units,V,A``, ``Delta_X 1e-5 1e-5``, ``t0 = -5e-3``, or
``Start,Increment`` above two numbers.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from klack.errors import InputError
from klack.measurement.files.clock import instant
from klack.measurement.unit_text import no_unit, unit_factor
from klack.units import TIME

__all__ = ["TableHeader", "read_header"]

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
_NAMES = ("source", "tracename", "trace name")
_HERTZ = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0, "sa/s": 1.0}
_VALUE = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)")
_EQUATION = re.compile(r"(?P<key>[A-Za-z]\w*)\s*=\s*(?P<value>.+)")
_BARE = re.compile(r"[\s_:]+")


_Said = Mapping[str, tuple[str, list[str]]]
"""Words as they are written and their values, by the word in plain letters."""


@dataclass(frozen=True, kw_only=True)
class TableHeader:
    """Values for all channels together, or one for each; none where the file says nothing.

    Parameters
    ----------
    starts, steps : tuple of float [s]
    units, names : tuple of str
    origins : tuple of int [ns]
        Dates of the zero of time since 1970.
    count : int
        Rows of the table, of each segment; 0 if it is not said.
    words : str
        Where the step comes from, ``"Sample Interval"``.
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
    """Header of a table, and its lines without the cells of start and increment beside names."""
    said: dict[str, tuple[str, list[str]]] = {}
    rows = [_cells(line, separator) for line in lines]
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
        names=_texts(said, _NAMES),
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
    """Word and numbers of the first key there is; times in seconds, rates (0) in hertz."""
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


def _cells(line: str, separator: str) -> list[str]:
    text = line.strip(" \r\n").lstrip("#%!" if separator == ";" else "#%!;").strip(" ")
    cells = text.split(separator) if separator else re.split(r"\t|\s{2,}", text)
    return [cell.strip().strip('"').strip() for cell in cells]


def _key(text: str) -> str:
    return _BARE.sub(" ", text).strip().lower()
