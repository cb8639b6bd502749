"""Measures: the numbers that people name, each described once.

From the description of a measure come its key in JSON, its column in tables, its row in a report,
its entry in the glossary, its attributes in exported files and its line in the reference.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import Field
from typing_extensions import TypedDict

from klack.report.wording import count, fixed, power, quantity, share, signed, signed_share

__all__ = [
    "Column",
    "Measure",
    "described",
    "glossary",
    "json_of",
    "json_type",
    "number_or_none",
]

Of = TypeVar("Of", contravariant=True)

Value = float | int | bool | None
Form = Literal["quantity", "fixed", "share", "power", "count", "signed", "signed share"]

_SUFFIXES = {
    "N": "_N",
    "s": "_s",
    "m": "_m",
    "J": "_J",
    "Hz": "_Hz",
    "rad": "_rad",
    "N s": "_Ns",
    "m/s": "_m_s",
    "sone": "_sone",
    "phon": "_phon",
    "acum": "_acum",
    "dB": "_dB",
    "dBA": "_dBA",
    "1": "",
}
_KINDS: Mapping[str, Any] = {"number": float | None, "whole": int, "truth": bool}


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a terminal table with a measure.

    Parameters
    ----------
    unit : str
        In which people read it; empty for a pure number.
    factor : float
        From SI to that unit.
    form : str
        Format of the number.
    head : str
        Instead of the name of the measure.
    """

    unit: str
    factor: float
    form: str
    head: str = ""


@dataclass(frozen=True, kw_only=True)
class Measure(Generic[Of]):
    """One number that people name.

    Parameters
    ----------
    key : str
        In JSON, before its unit.
    name : str
        In words; ``title`` is what a report calls it where that differs.
    symbol : str
        In formulas.
    unit : str
        SI, ``"1"`` for a pure number.
    definition : str
        One sentence; ``note`` may add to it in a glossary.
    source : str
        Page of the theory, or standard.
    read : callable
        Its value [unit], nan or None where it does not exist.
    kind : str
        A ``"number"``, a ``"whole"`` number or a ``"truth"`` value.
    form : str
        How a report prints it: a ``"quantity"`` with ``digits`` significant digits and a prefix,
        ``"fixed"`` decimals, a ``"share"`` in per cent, a ``"power"`` of ten, a ``"count"``, or
        with a sign.
    digits : int
    column : Column, optional
        Of tables on a terminal that show it.
    given : callable
        Whether a record stands for it as defined; elsewhere it is left out of JSON.
    remark : callable
        Behind the value in tables, for example that it was cut off.
    deviation : str
        How two runs are compared: ``"relative"`` or by their ``"difference"``.
    page : bool
        Whether it stands among the key numbers of a report.
    absent : str
        What tables say where there is no value.
    """

    key: str
    name: str
    symbol: str
    unit: str
    definition: str
    source: str
    read: Callable[[Of], Value]
    kind: Literal["number", "whole", "truth"] = "number"
    form: Literal["quantity", "fixed", "share", "power", "count", "signed", "signed share"] = (
        "quantity"
    )
    digits: int = 4
    column: Column | None = None
    given: Callable[[Of], bool] = lambda _: True
    remark: Callable[[Of], str] = lambda _: ""
    deviation: Literal["", "relative", "difference"] = ""
    page: bool = False
    absent: str = "–"
    title: str = ""
    note: str = ""

    @property
    def json_key(self) -> str:
        """Key in JSON, with its unit.

        >>> Measure(key="impulse", name="impulse", symbol="J", unit="N s", definition="",
        ...         source="", read=float).json_key
        'impulse_Ns'
        """
        return self.key + _SUFFIXES[self.unit]

    @property
    def head(self) -> str:
        """Head of its column on a terminal."""
        unit = self.column.unit if self.column is not None else self.unit
        name = (self.column.head if self.column is not None else "") or self.name
        return f"{name} [{unit}]" if unit not in ("", "1") else name

    def cell(self, of: Of) -> str:
        """Value in its column on a terminal; a dash where it does not exist."""
        value = self.read(of)
        if self.column is None or value is None or not isfinite(value):
            return self.absent
        # whole numbers stay whole
        scaled = value if self.kind == "whole" else self.column.factor * value
        return f"{scaled:{self.column.form}}{self.remark(of)}"

    def told(self, of: Of) -> str:
        """Value with its unit, for a sentence on a terminal."""
        value = self.read(of)
        if self.column is None or value is None or not isfinite(value):
            return self.absent
        number = f"{self.column.factor * value:{self.column.form}}"
        return f"{number} {self.column.unit}".rstrip() + self.remark(of)

    def on_page(self, of: Of) -> str:
        """Value in a report."""
        value = self.read(of)
        return (self.absent if value is None else self.printed(value)) + self.remark(of)

    def printed(self, value: float) -> str:
        """A value of this kind as a report prints it."""
        if self.form == "count":
            return count(int(value))
        if self.form == "fixed":
            return fixed(value, self.digits, self.unit if self.unit != "1" else "")
        if self.form == "share":
            return share(value, self.digits)
        if self.form == "power":
            return power(value)
        if self.form == "signed":
            return signed(value, self.digits)
        if self.form == "signed share":
            return signed_share(value, self.digits)
        return quantity(value, self.unit if self.unit != "1" else "", self.digits)


def json_of(measures: Iterable[Measure[Of]], of: Of) -> dict[str, Value]:
    """Values by JSON key; None where there is no number (JSON knows no nan and no infinity)."""
    return {
        measure.json_key: _plain(measure.read(of), measure.kind) if measure.given(of) else None
        for measure in measures
    }


def number_or_none(value: float) -> float | None:
    """Number for JSON, which has no nan and no infinity."""
    return float(value) if isfinite(value) else None


def _plain(value: Value, kind: str) -> Value:
    if value is None or not isfinite(value):
        return None
    return {"number": float, "whole": int, "truth": bool}[kind](value)


def json_type(
    name: str, words: str, measures: Iterable[Measure[Any]], more: Mapping[str, Any] | None = None
) -> Any:
    """Type of what :func:`json_of` returns, with further keys, for the schema of results."""
    keys: dict[str, Any] = {
        item.json_key: Annotated[_KINDS[item.kind], Field(description=item.definition)]
        for item in measures
    }
    found: Any = TypedDict(name, {**keys, **(more or {})})  # type: ignore[misc]
    found.__doc__ = words
    return found


def described(measures: Iterable[Measure[Any]]) -> list[dict[str, str]]:
    """Description of each measure, for schema and reference."""
    return [
        {
            "key": item.json_key,
            "name": item.name,
            "symbol": item.symbol,
            "unit": item.unit,
            "definition": item.definition,
            "source": item.source,
        }
        for item in measures
    ]


def glossary(measures: Iterable[Measure[Any]]) -> tuple[tuple[str, str], ...]:
    """Names and definitions, for the end of a report."""
    return tuple(
        (item.title or item.name, f"{item.definition} {item.note}".strip()) for item in measures
    )
