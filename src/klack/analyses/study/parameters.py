"""Parameters of a study, found in their case, with their values in SI."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from klack.analyses.study.wording import shown_unit
from klack.case.any_case import AnyCase
from klack.case.key_path import Quantity, kind_at, node_at, quantity_at, split_path
from klack.case.points import PointValue
from klack.case.study import StudyParameter, Written
from klack.case.study_source import StudySource
from klack.errors import InputError
from klack.expressions.expression import RESERVED
from klack.input.problem import CaseProblem, Key
from klack.studies.spread import Listed, Normal, Range, Spread
from klack.units import KINDS, RATIO, TEMPERATURE, TEMPERATURE_RISE, Kind, format_si, parse_quantity

__all__ = ["Parameter", "parameters_of", "short_names", "unit_of", "written"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter of a study.

    Parameters
    ----------
    name : str
        Path of its key in the case; a word of its own where only expressions use it.
    kind : Kind or None
        Of quantity; None for words and whole numbers.
    spread : Range, Normal or Listed
        Its values [SI].
    today : float, str or None
        What stands in the case; None for a word of its own.
    """

    name: str
    kind: Kind | None
    spread: Spread
    today: float | str | None

    @property
    def is_key(self) -> bool:
        """Whether the case has this key."""
        return "." in self.name

    @property
    def is_fixed(self) -> bool:
        """Whether it has one value."""
        return isinstance(self.spread, Listed) and len(self.spread.values) == 1

    @property
    def unit(self) -> str:
        """SI unit; ``"1"`` for a pure number, empty for words."""
        if isinstance(self.spread, Listed) and all(isinstance(x, int) for x in self.spread.values):
            return "1"
        return unit_of(self.kind)

    @property
    def middle(self) -> float | str:
        """Where the others vary alone: the value of the case, else the middle of its own."""
        return self.spread.at(0.5) if self.today is None else self.today

    def text(self) -> str:
        """Its values in words."""
        spread = self.spread
        if isinstance(spread, Listed):
            return ", ".join(self._in_words(value) for value in spread.values)
        if isinstance(spread, Normal):
            mean, deviation = self._in_words(spread.mean), self._in_words(spread.deviation)
            return f"normal, mean {mean}, standard deviation {deviation}"
        ends = f"{self._in_words(spread.low)} to {self._in_words(spread.high)}"
        return f"{ends}, logarithmic" if spread.is_log else ends

    def _in_words(self, value: float | str) -> str:
        if self.kind is None or isinstance(value, str):
            return str(value)
        unit, factor = shown_unit(self.kind.unit)
        return format_si(factor * value, unit)


def unit_of(kind: Kind | None) -> str:
    """SI unit of a kind of quantity; ``"1"`` for a pure number, empty for none."""
    if kind is None:
        return ""
    return "1" if kind.bare else kind.unit


def written(value: float | str, kind: Kind | None) -> PointValue:
    """Value [SI] as a case file has it, with its unit and all digits."""
    if kind is None or isinstance(value, str):
        return value
    return float(value) if kind.bare else f"{float(value)!r} {kind.unit}"


def parameters_of(case: AnyCase, source: StudySource) -> tuple[Parameter, ...]:
    """Find the parameters of a study in its case, and read their values.

    Raises
    ------
    InputError
        With file, line and key: for a key that the case does not have, a value of another kind of
        quantity or outside of the limits of its key, and ends of a range that are swapped.
    """
    return tuple(
        _parameter(case, source, name, item) for name, item in source.study.parameters.items()
    )


def short_names(names: Mapping[str, object] | tuple[str, ...]) -> dict[str, str]:
    """Words by which expressions may call each parameter: the ends of its path, joined with ``_``.

    An end that several parameters share calls none of them.

    >>> short_names(("network.components.spring.preload", "tip"))["spring_preload"]
    'network.components.spring.preload'
    """
    found: dict[str, str] = {}
    shared: set[str] = set()
    for name in names:
        parts = [re.sub(r"\W", "_", part) for part in name.split(".")]
        for k in range(len(parts)):
            word = "_".join(parts[k:])
            if word.isidentifier() and word not in RESERVED:
                shared |= {word} if word in found else set()
                found[word] = name
    return {word: name for word, name in found.items() if word not in shared}


def _parameter(case: AnyCase, source: StudySource, name: str, item: StudyParameter) -> Parameter:
    at: Key = ("parameters", name)
    try:
        place = split_path(name)
        if len(place) == 1:
            return _own_word(source, name, item)
        node, field = node_at(case, place)
        if kind_at(node, field) is None or isinstance(node, str | bool):
            today = node if _plain(node) else None
            return Parameter(name=name, kind=None, spread=_listed(item, today), today=today)
        quantity = quantity_at(case, place)
    except CaseProblem as problem:
        raise source.refuse(at, problem) from None
    spread = _spread(source, name, item, quantity)
    return Parameter(name=name, kind=quantity.kind, spread=spread, today=quantity.value)


def _plain(node: object) -> bool:
    return isinstance(node, str | int | float) and not isinstance(node, bool)


def _listed(item: StudyParameter, today: object) -> Listed:
    """Words and whole numbers have no range."""
    if item.fixed is None and item.values is None:
        raise CaseProblem(
            (),
            got="a range of a key that is no quantity",
            expected="{values: [...]}",
            hint="list its values.",
        )
    given = item.values if item.values is not None else (item.fixed,)
    whole = isinstance(today, int)
    return Listed(
        tuple(
            int(value) if whole and isinstance(value, float) and value.is_integer() else value
            for value in given
            if value is not None
        )
    )


def _own_word(source: StudySource, name: str, item: StudyParameter) -> Parameter:
    if not name.isidentifier() or name in RESERVED:
        raise CaseProblem(
            (),
            got=f"'{name}'",
            expected="the path of a key (network.components.spring.preload), or a word of letters, "
            "digits and _ for the expressions of 'linked'",
            hint="write the path of the key from the top of the case.",
        )
    kind = _kind_of(item)
    return Parameter(name=name, kind=kind, spread=_spread(source, name, item, kind), today=None)


def _kind_of(item: StudyParameter) -> Kind:
    """Kind of quantity that the first value has."""
    given = [item.lowest, item.normal.mean if item.normal else None, item.fixed]
    first = next((value for value in (*given, *(item.values or ())) if value is not None), None)
    for kind in (RATIO, *KINDS):
        try:
            parse_quantity(first, kind)
        except InputError:
            continue
        return kind
    raise CaseProblem(
        (),
        got=f"'{first}'",
        expected="a number with its unit, such as 1.25 mm",
        hint="write the path of a key of the case, or a quantity.",
    )


def _deviation(value: Written, kind: Kind) -> float:
    """Standard deviation; one of 5 degC is a difference of temperatures, 5 K."""
    if kind != TEMPERATURE:
        return parse_quantity(value, kind)
    text = re.sub(r"(degC|°C)$", "K", value.strip()) if isinstance(value, str) else value
    return parse_quantity(text, TEMPERATURE_RISE)


def _spread(source: StudySource, name: str, item: StudyParameter, of: Quantity | Kind) -> Spread:
    at: Key = ("parameters", name)

    def read(value: Written | None, *key: str | int) -> float:
        def parsed() -> float:
            return of.parse(value) if isinstance(of, Quantity) else parse_quantity(value, of)

        return source.read((*at, *key), parsed)

    if item.normal is not None:
        kind = of.kind if isinstance(of, Quantity) else of
        mean = read(item.normal.mean, "normal", "mean")
        deviation = source.read(
            (*at, "normal", "sd"),
            lambda: _deviation(item.normal.sd, kind),  # type: ignore[union-attr]
        )
        if deviation <= 0.0:
            raise InputError(
                source.where((*at, "normal", "sd")),
                got=format_si(deviation, kind.unit),
                expected="more than 0",
                hint="a value that does not vary is 'fixed'.",
            )
        return Normal(mean, deviation)
    if item.lowest is not None:
        low, high = read(item.lowest, "from"), read(item.highest, "to")
        if not low < high:
            raise InputError(
                source.where((*at, "to")),
                got=f"'{item.highest}'",
                expected=f"more than 'from', which is '{item.lowest}'",
                hint="swap them, or check the units.",
            )
        if item.scale == "log" and low <= 0.0:
            raise InputError(
                source.where((*at, "from")),
                got=f"'{item.lowest}'",
                expected="more than 0 for a logarithmic scale",
                hint="give another lower end, or scale: linear.",
            )
        return Range(low, high, item.scale == "log")
    if item.values is not None:
        return Listed(tuple(read(value, "values", i) for i, value in enumerate(item.values)))
    return Listed((read(item.fixed, "fixed"),))
