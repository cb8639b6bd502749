"""Measures: the numbers that people name, each described once.

The description gives a measure its key in JSON, its column in tables, its row in a report, its
entry in the glossary, its attributes in exported files and its line in the reference.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import isfinite, log10
from typing import Any, Generic, Literal, TypeVar

from klack.report.wording import count, fixed, power, quantity, share, signed, signed_share
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "JSON_TYPES",
    "Column",
    "Measure",
    "Value",
    "cells",
    "described",
    "described_in",
    "glossary",
    "heads",
    "json_of",
    "page_cells",
    "page_heads",
    "text_table",
]

Of = TypeVar("Of", contravariant=True)


Value = float | int | bool | None

_SUFFIXES = {
    "N": "_N",
    "s": "_s",
    "m": "_m",
    "J": "_J",
    "Hz": "_Hz",
    "rad": "_rad",
    "N s": "_Ns",
    "m/s": "_m_s",
    "rad/s": "_rad_s",
    "sone": "_sone",
    "phon": "_phon",
    "acum": "_acum",
    "dB": "_dB",
    "dBA": "_dBA",
    "um": "_um",
    "kg": "_kg",
    "m^3": "_m3",
    "kg/s": "_kg_s",
    "Pa": "_Pa",
    "m/N": "_m_per_N",
    "1": "",
    "": "",
}
_LEVELS = {"amplitude": 20.0, "energy": 10.0}
JSON_TYPES: Mapping[str, Any] = {"number": float | None, "whole": int, "truth": bool}
"""By the kind of a measure."""


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a terminal table with a measure.

    ``unit`` is that for people, ``factor`` from SI to it; ``head`` replaces the name.
    """

    unit: str
    factor: float
    form: str
    head: str = ""


def _unread(_: Any) -> Value:
    return None


def _under(key: str, of: Any) -> Value:
    value: Value = of[key] if isinstance(of, Mapping) else getattr(of, key)
    return value


@dataclass(frozen=True, kw_only=True)
class Measure(Generic[Of]):
    """One number that people name.

    Parameters
    ----------
    key
        In JSON, before its unit; or ``json_name``.
    name
        In words, by default of the key; ``title`` in a report, if other.
    symbol
        In formulas.
    unit
        SI, ``"1"`` for a pure number; empty with ``unit_of``.
    definition
        One sentence; ``note`` may add to it in a glossary.
    source
        Page of the documentation; see :func:`described_in`.
    read
        Its value [unit], nan or None without one; by default that under its key.
    form
        How a report prints it: a ``"quantity"`` with ``digits`` significant digits and a prefix,
        ``"fixed"`` decimals, a ``"share"`` in per cent, a ``"power"`` of ten, a ``"count"``, which
        is that of whole numbers, or with a sign.
    column
        In tables on a terminal.
    given
        Whether a record has it as defined; else JSON leaves it out.
    remark
        Behind the value in tables, as that it was cut off; a second line is for reports only.
    deviation
        How two runs are compared: by their ``"relative"`` or plain ``"difference"``, by the
        ``"factor"`` between them, or by its level in dB, of an ``"amplitude"`` or an ``"energy"``.
    page
        Whether it is a key number of reports.
    absent
        For tables without a value; ``why`` may say more, and stands instead.
    unit_of, digits_of
        Unit of the value of one thing, empty for a pure number; its significant digits.
    """

    key: str
    definition: str
    name: str = ""
    symbol: str = ""
    unit: str = "1"
    source: str = ""
    read: Callable[[Of], Value] = _unread
    kind: Literal["number", "whole", "truth"] = "number"
    form: Literal["quantity", "fixed", "share", "power", "count", "signed", "signed share"] = (
        "quantity"
    )
    digits: int = 4
    column: Column | None = None
    given: Callable[[Of], bool] = lambda _: True
    remark: Callable[[Of], str] = lambda _: ""
    deviation: Literal["", "relative", "difference", "factor", "amplitude", "energy"] = ""
    page: bool = False
    absent: str = "–"
    why: Callable[[Of], str] = lambda _: ""
    title: str = ""
    note: str = ""
    json_name: str = ""
    unit_of: Callable[[Of], str] | None = None
    digits_of: Callable[[Of], int] | None = None

    def __post_init__(self) -> None:
        """Take from the key what is not said."""
        if not self.name:
            object.__setattr__(self, "name", self.key.replace("_", " "))
        if self.read is _unread:
            object.__setattr__(self, "read", partial(_under, self.key))
        if self.kind != "number" and self.form == "quantity":
            object.__setattr__(self, "form", "count")

    @property
    def json_key(self) -> str:
        """Key in JSON, with its unit.

        >>> Measure(key="impulse", name="impulse", symbol="J", unit="N s", definition="",
        ...         source="", read=float).json_key
        'impulse_Ns'
        """
        return self.json_name or self.key + _SUFFIXES[self.unit]

    @property
    def head(self) -> str:
        """Head of its column on a terminal."""
        unit = self.column.unit if self.column is not None else self.unit
        name = (self.column.head if self.column is not None else "") or self.name
        return f"{name} [{unit}]" if unit not in ("", "1") else name

    def json(self, of: Of) -> Value:
        """Value as JSON, without nan and infinity."""
        value = self.read(of) if self.given(of) else None
        if value is None or not isfinite(value):
            return None
        return {"number": float, "whole": int, "truth": bool}[self.kind](value)

    def cell(self, of: Of) -> str:
        """Value in its column; a dash without one."""
        value = self.read(of)
        if value is not None and isfinite(value) and self.unit_of is not None:
            return format_si(value, self.unit_of(of), self.settled(of).digits)
        if self.column is None or value is None or not isfinite(value):
            return self.why(of) or self.absent
        # whole numbers stay whole
        scaled = value if self.kind == "whole" else self.column.factor * value
        return f"{scaled:{self.column.form}}{self._short_remark(of)}"

    def told(self, of: Of) -> str:
        """Value with unit, for a sentence."""
        value = self.read(of)
        if self.column is None or value is None or not isfinite(value):
            return self.absent
        number = f"{self.column.factor * value:{self.column.form}}"
        return f"{number} {self.column.unit}".rstrip() + self._short_remark(of)

    def _short_remark(self, of: Of) -> str:
        return self.remark(of).partition("\n")[0]

    def on_page(self, of: Of) -> str:
        """Value in a report."""
        value = self.read(of)
        if value is None or (self.unit_of is not None and not isfinite(value)):
            return self.absent
        if not isfinite(value) and (reason := self.why(of)):
            return reason
        return self.settled(of).printed(value) + self.remark(of)

    def settled(self, of: Of) -> "Measure[Of]":
        """The same in the unit and digits of one thing."""
        if self.unit_of is None:
            return self
        digits = self.digits if self.digits_of is None else self.digits_of(of)
        return replace(self, unit=self.unit_of(of) or "1", digits=digits, unit_of=None)

    def printed(self, value: float) -> str:
        """A value as a report prints it."""
        unit = {"1": "", "um": "µm"}.get(self.unit, self.unit)
        if self.form == "count":
            return count(int(value))
        if self.form == "fixed":
            return fixed(value, self.digits, unit)
        if self.form == "share":
            return share(value, self.digits)
        if self.form == "power":
            return power(value)
        if self.form == "signed":
            return signed(value, self.digits)
        if self.form == "signed share":
            return signed_share(value, self.digits)
        return quantity(value, unit, self.digits)

    def apart(self, of: Of, reference: Of) -> str:
        """How far a value is from that of a reference on a terminal: ``+3.0 dB``, ``x 1.2``.

        Differences are those of levels.
        """
        values = (self.read(of), self.read(reference))
        value, other = (float("nan") if item is None else float(item) for item in values)
        if self.deviation == "factor" and value > 0.0 and other > 0.0:
            return f"x {value / other:.3g}"
        if self.deviation == "difference":
            level = value - other
        elif self.deviation in _LEVELS and value > 0.0 and other > 0.0:
            level = _LEVELS[self.deviation] * log10(value / other)
        else:
            return self.absent
        return f"{round(level, 1) + 0.0:+.1f} dB" if isfinite(level) else self.absent


def described_in(source: str, *measures: Measure[Of]) -> tuple[Measure[Of], ...]:
    """Measures whose equations are on one page of the documentation."""
    return tuple(replace(item, source=item.source or source) for item in measures)


def heads(measures: Iterable[Measure[Of]]) -> tuple[str, ...]:
    """Heads of the columns, for measures that have one."""
    return tuple(measure.head for measure in measures if measure.column is not None)


def cells(measures: Iterable[Measure[Of]], of: Of) -> tuple[str, ...]:
    """One row below :func:`heads`."""
    return tuple(measure.cell(of) for measure in measures if measure.column is not None)


def text_table(
    title: str, first: str, measures: Sequence[Measure[Of]], named: Iterable[tuple[str, Of]]
) -> TextTable:
    """Table with things down and their measures across."""
    rows = tuple((name, *cells(measures, of)) for name, of in named)
    return TextTable(title=title, columns=(first, *heads(measures)), rows=rows)


def page_heads(measures: Iterable[Measure[Of]]) -> tuple[str, ...]:
    """Names of the key numbers of a report, those with ``page``."""
    return tuple(measure.title or measure.name for measure in measures if measure.page)


def page_cells(measures: Iterable[Measure[Of]], of: Of) -> tuple[str, ...]:
    """Key numbers in the order of :func:`page_heads`."""
    return tuple(measure.on_page(of) for measure in measures if measure.page)


def json_of(measures: Iterable[Measure[Of]], of: Of) -> dict[str, Value]:
    """Values by JSON key; None where there is no number."""
    return {measure.json_key: measure.json(of) for measure in measures}


def described(measures: Iterable[Measure[Any]]) -> list[dict[str, str]]:
    """Description of each measure, for schema and reference."""
    return [
        {
            "key": item.json_key,
            "name": item.name,
            "symbol": item.symbol,
            "unit": item.unit or "that of the quantity",
            "definition": item.definition,
            "source": item.source,
        }
        for item in measures
    ]


def glossary(measures: Iterable[Measure[Any]]) -> tuple[tuple[str, str], ...]:
    """Names and definitions of the key numbers of a report."""
    return tuple(
        (item.title or item.name, f"{item.definition} {item.note}".strip())
        for item in measures
        if item.page
    )
