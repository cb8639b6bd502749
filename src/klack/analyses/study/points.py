"""Parameters and points of a study, in SI and as the case file has them."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from itertools import product
from math import prod

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.wording import shown_unit
from klack.case.any_case import AnyCase
from klack.case.expressions.expression import RESERVED, Expression, ordered
from klack.case.key_path import Quantity, kind_at, node_at, quantity_at, split_path
from klack.case.points import PointValue
from klack.case.reader import text_of
from klack.case.study import StudyParameter, Written
from klack.case.study_source import StudySource
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, Key, one_of, refuse_key_if
from klack.studies.designs import (
    Listed,
    Normal,
    Range,
    Spread,
    balanced,
    latin_hypercube,
    sobol_sequence,
)
from klack.studies.sensitivity import morris_design, saltelli_design
from klack.units import KINDS, RATIO, TEMPERATURE, TEMPERATURE_RISE, Kind, format_si, parse_quantity

__all__ = [
    "Linked",
    "Parameter",
    "Space",
    "StudyPoints",
    "Values",
    "linked_of",
    "parameters_of",
    "points_in",
    "require_varied",
    "short_names",
    "space_of",
    "unit_of",
    "written",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter of a study: path of its key, or a word of its own for expressions.

    ``kind`` is None for words and whole numbers; ``today`` None for a word of its own.
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
        """Value while others vary alone: that of the case, else its own middle."""
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
    """SI unit; ``"1"`` for a pure number, empty without a kind."""
    if kind is None:
        return ""
    return "1" if kind.bare else kind.unit


def written(value: float | str, kind: Kind | None) -> PointValue:
    """Value [SI] as case text, with unit and all digits."""
    if kind is None or isinstance(value, str):
        return value
    return float(value) if kind.bare else f"{float(value)!r} {kind.unit}"


def parameters_of(case: AnyCase, source: StudySource) -> tuple[Parameter, ...]:
    """Find the parameters of a study in its case, and read their values.

    InputError also for a value outside of the limits of its key, and ends of a range that are
    swapped.
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
            is_plain = isinstance(node, str | int | float) and not isinstance(node, bool)
            today = node if is_plain else None
            return Parameter(name=name, kind=None, spread=_listed(item, today), today=today)
        quantity = quantity_at(case, place)
    except CaseProblem as problem:
        raise source.refuse(at, problem) from None
    spread = _spread(source, name, item, quantity)
    return Parameter(name=name, kind=quantity.kind, spread=spread, today=quantity.value)


def _listed(item: StudyParameter, today: object) -> Listed:
    """Words and whole numbers have no range."""
    refuse_key_if(
        item.fixed is None and item.values is None,
        (),
        got="a range of a key that is not a quantity",
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
    refuse_key_if(
        not name.isidentifier() or name in RESERVED,
        (),
        got=f"'{name}'",
        expected="the path of a key (network.components.spring.preload), or a name of "
        "letters, digits and _ for the expressions in 'linked'",
        hint="write the path of the key from the top level of the case.",
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
    """Standard deviation; 5 degC is a difference, 5 K."""
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
        refuse_if(
            deviation <= 0.0,
            source.where((*at, "normal", "sd")),
            got=format_si(deviation, kind.unit),
            expected="more than 0",
            hint="for a value that does not vary use 'fixed'.",
        )
        return Normal(mean, deviation)
    if item.lowest is not None:
        low, high = read(item.lowest, "from"), read(item.highest, "to")
        refuse_if(
            not low < high,
            source.where((*at, "to")),
            got=f"'{item.highest}'",
            expected=f"more than 'from', which is '{item.lowest}'",
            hint="swap them, or check the units.",
        )
        refuse_if(
            item.scale == "log" and low <= 0.0,
            source.where((*at, "from")),
            got=f"'{item.lowest}'",
            expected="more than 0 for a logarithmic scale",
            hint="give another lower end, or scale: linear.",
        )
        return Range(low, high, item.scale == "log")
    if item.values is not None:
        return Listed(tuple(read(value, "values", i) for i, value in enumerate(item.values)))
    return Listed((read(item.fixed, "fixed"),))


Values = Mapping[str, float | str]

_MOST_POINTS = 1_000_000
_UNBALANCED = (
    "The number of Sobol points is not a power of two: means over them converge more slowly. "
    "Try: 64, 128, 256, ... points."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Linked:
    """A key of the case whose value follows from parameters, ``today`` [SI] in the case.

    ``words`` of the expression mean parameters or other keys.
    """

    name: str
    kind: Kind
    expression: Expression
    words: Mapping[str, str]
    today: float

    @property
    def unit(self) -> str:
        """SI unit; ``"1"`` for a pure number."""
        return unit_of(self.kind)

    def value(self, values: Values) -> float:
        """Value [SI] where parameters and other keys have these."""
        own = {word: float(values[name]) for word, name in self.words.items()}
        return self.expression.value(own)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Space:
    """Parameters of a study and what follows from them: from the unit cube to the case.

    ``linked`` keys are in the order of computation; ``constants`` [SI] are further values for
    expressions.
    """

    parameters: tuple[Parameter, ...]
    linked: tuple[Linked, ...]
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def varied(self) -> tuple[Parameter, ...]:
        """Parameters of a design, in its order."""
        return tuple(item for item in self.parameters if not item.is_fixed)

    def at(self, shares: Iterable[float]) -> Values:
        """Values [SI] at a point of the unit cube."""
        pairs = zip(self.varied, shares, strict=True)
        return self.values([item.spread.at(float(share)) for item, share in pairs])

    def values(self, row: Iterable[float | str]) -> Values:
        """Values [SI] for a row of the varying parameters."""
        point = dict(zip((item.name for item in self.varied), row, strict=True))
        point |= {item.name: item.spread.at(0.5) for item in self.parameters if item.is_fixed}
        return self.completed(point)

    def completed(self, point: Values) -> Values:
        """Values [SI] with those that follow from them."""
        found = {**self.constants, **point}
        for item in self.linked:
            found[item.name] = item.value(found)
        return found

    def written(self, values: Values) -> dict[str, PointValue]:
        """Texts of the case at a point, by key."""
        kinds = {item.name: item.kind for item in self.parameters if item.is_key}
        kinds |= {item.name: item.kind for item in self.linked}
        return {name: written(values[name], kind) for name, kind in kinds.items()}

    def today(self) -> NDArray[np.float64]:
        """Point (parameters that vary,) of the unit cube nearest to the case as it is.

        A word of the study stands for the key that it is linked with, if it is by itself.
        """
        known = self.known()
        found = [
            item.spread.share(known[item.name]) if item.name in known else 0.5  # type: ignore[arg-type]
            for item in self.varied
        ]
        return np.array(found, dtype=float)

    def known(self) -> Values:
        """Known values [SI] of parameters and linked keys in the case."""
        own = {
            name: item.today
            for item in self.linked
            for word, name in item.words.items()
            if item.expression.text == word
        }
        fixed = {item.name: item.spread.at(0.5) for item in self.parameters if item.is_fixed}
        keys = {item.name: item.today for item in self.parameters if item.today is not None}
        return {**fixed, **own, **keys, **{item.name: item.today for item in self.linked}}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyPoints:
    """Points of a study in the order of its design, by name [SI].

    Parameters come first, then what follows from them; ``cube`` has drawn points in the unit cube.
    """

    space: Space
    values: tuple[Values, ...]
    design: str
    notes: tuple[str, ...] = ()
    cube: NDArray[np.float64] | None = None


def space_of(case: AnyCase, source: StudySource) -> Space:
    """Parameters and expressions of a study, found in its case."""
    parameters = parameters_of(case, source)
    return Space(parameters=parameters, linked=linked_of(case, source, parameters))


def points_in(source: StudySource, space: Space) -> StudyPoints:
    """Points of the design of a study in its space."""
    kind = source.study.design.kind
    if kind != "file":
        require_varied(source, space.varied)
    if kind in ("file", "grid", "one-at-a-time"):
        listed = _rows_of_file if kind == "file" else _levels
        rows, words = listed(source, space.varied)
        return StudyPoints(space=space, values=tuple(map(space.values, rows)), design=words)
    return _drawn(source, space)


def linked_of(
    case: AnyCase, source: StudySource, parameters: Sequence[Parameter]
) -> tuple[Linked, ...]:
    """Expressions of a study in the order in which they can be computed.

    InputError for a key without a quantity, one that is a parameter as well, an unknown name,
    another unit, and expressions that follow from each other in a circle.
    """
    given = source.study.linked
    places = {}
    expressions = {}
    for name, text in given.items():
        refuse_if(
            name in source.study.parameters,
            source.where(("linked", name)),
            got="a key that is also a parameter",
            expected="a parameter, or an expression",
            hint="remove one of them.",
        )
        try:
            places[name] = quantity_at(case, split_path(name))
        except CaseProblem as problem:
            raise source.refuse(("linked", name), problem) from None
        expressions[name] = Expression.parse(text, source.where(("linked", name)))
    numbers = [item for item in parameters if item.kind is not None]
    words = short_names((*(item.name for item in numbers), *given))
    for expression in expressions.values():
        expression.require_clear(words)
    known = {word for word, name in words.items() if name not in given}
    named = {word: expressions[name] for word, name in words.items() if name in given}
    order = dict.fromkeys(words[word] for word in ordered(named, known))
    kinds = {item.name: item.kind for item in numbers if item.kind is not None}
    kinds |= {name: place.kind for name, place in places.items()}
    found = []
    for name in order:
        expression = expressions[name]
        meant = {word: words[word] for word in expression.names}
        dimension = expression.unit({word: kinds[whole].unit for word, whole in meant.items()})
        refuse_if(
            not dimension.fits(kinds[name].unit),
            source.where(("linked", name)),
            got=f"'{expression.text}', which is {dimension}",
            expected=f"{kinds[name].name} [{kinds[name].unit}]",
            hint="for a constant with a unit, add a parameter such as {fixed: 0.2 mm}.",
        )
        found.append(
            Linked(
                name=name,
                kind=kinds[name],
                expression=expression,
                words=meant,
                today=places[name].value,
            )
        )
    return tuple(found)


# --------------------------------------------------------------------------- designs


def _levels(
    source: StudySource, varied: Sequence[Parameter]
) -> tuple[Iterable[Sequence[float | str]], str]:
    """Levels on a grid or one at a time, and the design in words."""
    design = source.study.design
    if design.kind == "one-at-a-time":
        return _one_at_a_time(varied, design.levels), "one parameter at a time"
    levels = [item.spread.levels(design.levels) for item in varied]
    count = prod(map(len, levels))
    refuse_if(
        count > _MOST_POINTS,
        source.where(("design", "levels")),
        got=f"a grid of {count} points",
        expected=f"at most {_MOST_POINTS}",
        hint="use fewer levels, or kind: sobol.",
    )
    return product(*levels), f"grid of {' x '.join(str(len(x)) for x in levels)}"


def _drawn(source: StudySource, space: Space) -> StudyPoints:
    design = source.study.design
    cube, name = _cube(source, space.varied)
    even = design.kind not in ("sobol", "saltelli", "made") or balanced(design.points)
    return StudyPoints(
        space=space,
        values=tuple(map(space.at, cube)),
        design=f"{name}, seed {design.seed}",
        notes=() if even else (_UNBALANCED,),
        cube=cube,
    )


def _cube(source: StudySource, varied: Sequence[Parameter]) -> tuple[NDArray[np.float64], str]:
    design, count = source.study.design, len(varied)
    if design.kind == "saltelli":
        return saltelli_design(count, design.points, design.seed), "Saltelli's design"
    if design.kind == "morris":
        bounded = [isinstance(item.spread, Range) for item in varied]
        cube = morris_design(count, design.points, design.seed, bounded=bounded)
        return cube, "trajectories of Morris"
    if design.kind == "latin-hypercube":
        return latin_hypercube(design.points, count, design.seed), "Latin hypercube"
    name = "manufactured valves, Sobol points" if design.kind == "made" else "Sobol points"
    return sobol_sequence(design.points, count, design.seed), name


def _one_at_a_time(varied: Sequence[Parameter], count: int) -> list[list[float | str]]:
    """The middle, then each parameter over its levels alone."""
    middle = [item.middle for item in varied]
    rows = [list(middle)]
    for k, item in enumerate(varied):
        rows += [[*middle[:k], level, *middle[k + 1 :]] for level in item.spread.levels(count)]
    return rows


def require_varied(source: StudySource, varied: Sequence[Parameter]) -> None:
    """Refuse a study in which nothing varies."""
    refuse_if(
        not varied,
        source.where(("parameters",)),
        got="no parameter that varies",
        expected="at least one range, distribution or list of values",
        hint="write {from: 8 N, to: 20 N}.",
    )


def _rows_of_file(
    source: StudySource, varied: Sequence[Parameter]
) -> tuple[Iterable[Sequence[float | str]], str]:
    """Rows of a CSV file: a column per varying parameter, values with units."""
    file = source.study.design.file
    assert file is not None
    table = list(csv.reader(StringIO(text_of(file))))
    names = [item.name for item in varied]
    head = [cell.strip() for cell in table[0]] if table else []
    refuse_if(
        sorted(head) != sorted(names),
        f"{file}:1",
        got=f"a header of: {one_of(head)}",
        expected=f"one column for each parameter that varies: {one_of(names)}",
        hint="write the names as in the study.",
    )
    rows = []
    for number, cells in enumerate(table[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        refuse_if(
            len(cells) != len(head),
            f"{file}:{number}",
            got=f"{len(cells)} values",
            expected=f"{len(head)}, one for each name in the header",
            hint="use a comma between values and a decimal point in numbers.",
        )
        texts = dict(zip(head, (cell.strip() for cell in cells), strict=True))
        at = f"{file}:{number}"
        rows.append([_cell(f"{at}: {item.name}", texts[item.name], item) for item in varied])
    refuse_if(
        not rows,
        str(file),
        got="no rows of values",
        expected="at least one",
        hint="add the points.",
    )
    return rows, f"from {file.name}"


def _cell(where: str, text: str, item: Parameter) -> float | str:
    """A quantity, a whole number if the case has one, or a word."""
    if item.kind is not None:
        return parse_quantity(text, item.kind, where)
    is_whole = isinstance(item.today, int) and text.isascii() and text.isdecimal()
    return int(text) if is_whole else text
