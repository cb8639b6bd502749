"""Points of a study: the values of its parameters, and what the case file has at each point."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from itertools import product
from math import prod

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.parameters import (
    Parameter,
    parameters_of,
    short_names,
    unit_of,
    written,
)
from klack.case.any_case import AnyCase
from klack.case.key_path import quantity_at, split_path
from klack.case.points import PointValue
from klack.case.reader import text_of
from klack.case.study_source import StudySource
from klack.errors import InputError
from klack.expressions.expression import Expression, ordered
from klack.input.problem import CaseProblem, one_of
from klack.studies.designs import balanced, latin_hypercube, sobol_sequence
from klack.studies.screening import morris_design
from klack.studies.sensitivity import saltelli_design
from klack.studies.spread import Range
from klack.units import Kind, parse_quantity

__all__ = [
    "Linked",
    "Space",
    "StudyPoints",
    "Values",
    "linked_of",
    "points_in",
    "require_varied",
    "space_of",
]

Values = Mapping[str, float | str]

_MOST_POINTS = 1_000_000
_UNBALANCED = (
    "The number of Sobol points is no power of two: means over them converge more slowly. "
    "Try: 64, 128, 256, ... points."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Linked:
    """A key of the case whose value follows from parameters.

    Parameters
    ----------
    name : str
        Path of the key.
    kind : Kind
        Of quantity.
    expression : Expression
    words : mapping of str to str
        Parameter, or other key, that each word of the expression means.
    today : float [SI]
        In the case.
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

    Parameters
    ----------
    parameters : tuple of Parameter
        All of the study.
    linked : tuple of Linked
        In the order in which they can be computed.
    constants : mapping of str to float [SI]
        What expressions need beside the parameters; no part of a point.
    """

    parameters: tuple[Parameter, ...]
    linked: tuple[Linked, ...]
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def varied(self) -> tuple[Parameter, ...]:
        """Parameters of a design, in its order."""
        return tuple(item for item in self.parameters if not item.is_fixed)

    def at(self, shares: Iterable[float]) -> Values:
        """Values [SI] by name at a point of the unit cube."""
        pairs = zip(self.varied, shares, strict=True)
        return self.values([item.spread.at(float(share)) for item, share in pairs])

    def values(self, row: Iterable[float | str]) -> Values:
        """Values [SI] by name where the parameters that vary have these.

        Raises
        ------
        InputError
            For an expression without a value there.
        """
        point = dict(zip((item.name for item in self.varied), row, strict=True))
        point |= {item.name: item.spread.at(0.5) for item in self.parameters if item.is_fixed}
        return self.completed(point)

    def completed(self, point: Values) -> Values:
        """Values [SI] of the parameters with those that follow from them.

        Raises
        ------
        InputError
            For an expression without a value there.
        """
        found = {**self.constants, **point}
        for item in self.linked:
            found[item.name] = item.value(found)
        return found

    def written(self, values: Values) -> dict[str, PointValue]:
        """What the case file has at a point, by the path of the key."""
        kinds = {item.name: item.kind for item in self.parameters if item.is_key}
        kinds |= {item.name: item.kind for item in self.linked}
        return {name: written(values[name], kind) for name, kind in kinds.items()}

    def today(self) -> NDArray[np.float64]:
        """Point of the unit cube nearest to the case as it is, shape (parameters that vary,).

        A word of the study stands for the key that it is linked with, if it is by itself.
        """
        known = self.known()
        found = [
            item.spread.share(known[item.name]) if item.name in known else 0.5  # type: ignore[arg-type]
            for item in self.varied
        ]
        return np.array(found, dtype=float)

    def known(self) -> Values:
        """Values [SI] of parameters and linked keys in the case as it is, as far as it has them."""
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
    """Points of a study in the order of its design.

    Parameters
    ----------
    space : Space
    values : tuple of mapping of str to value
        Of each point by name [SI]: parameters, then what follows from them.
    design : str
        In words.
    notes : tuple of str
    cube : array, shape (points, parameters that vary), optional
        Where they lie in the unit cube, if they were drawn there.
    """

    space: Space
    values: tuple[Values, ...]
    design: str
    notes: tuple[str, ...] = ()
    cube: NDArray[np.float64] | None = None


def space_of(case: AnyCase, source: StudySource) -> Space:
    """Parameters and expressions of a study, found in its case.

    Raises
    ------
    InputError
        With file, line and key.
    """
    parameters = parameters_of(case, source)
    return Space(parameters=parameters, linked=linked_of(case, source, parameters))


def points_in(source: StudySource, space: Space) -> StudyPoints:
    """Points of the design of a study in its space.

    Raises
    ------
    InputError
        With file, line and key.
    """
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

    Raises
    ------
    InputError
        For a key without a quantity, one that is a parameter as well, an unknown name, another
        unit, and expressions that follow from each other in a circle.
    """
    given = source.study.linked
    places = {}
    expressions = {}
    for name, text in given.items():
        if name in source.study.parameters:
            raise InputError(
                source.where(("linked", name)),
                got="a key that is a parameter as well",
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
        if not dimension.fits(kinds[name].unit):
            raise InputError(
                source.where(("linked", name)),
                got=f"'{expression.text}', which is {dimension}",
                expected=f"{kinds[name].name} [{kinds[name].unit}]",
                hint="add a parameter with a unit, {fixed: 0.2 mm}, for a constant that is no "
                "number.",
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
    """Values of the parameters on a grid or one at a time, and the design in words."""
    design = source.study.design
    if design.kind == "one-at-a-time":
        return _one_at_a_time(varied, design.levels), "one parameter at a time"
    levels = [item.spread.levels(design.levels) for item in varied]
    _require_few(source, prod(map(len, levels)))
    return product(*levels), f"grid of {' x '.join(str(len(x)) for x in levels)}"


def _drawn(source: StudySource, space: Space) -> StudyPoints:
    """Points that are drawn in the unit cube."""
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
    """Points of the unit cube of a drawn design, and its name."""
    design, count = source.study.design, len(varied)
    if design.kind == "saltelli":
        return saltelli_design(count, design.points, design.seed), "Saltelli's design"
    if design.kind == "morris":
        bounded = [isinstance(item.spread, Range) for item in varied]
        cube = morris_design(count, design.points, design.seed, bounded=bounded)
        return cube, "trajectories of Morris"
    if design.kind == "latin-hypercube":
        return latin_hypercube(design.points, count, design.seed), "Latin hypercube"
    name = "valves made after the case, Sobol points" if design.kind == "made" else "Sobol points"
    return sobol_sequence(design.points, count, design.seed), name


def _one_at_a_time(varied: Sequence[Parameter], count: int) -> list[list[float | str]]:
    """The middle, then each parameter over its levels while the others stay there."""
    middle = [item.middle for item in varied]
    rows = [list(middle)]
    for k, item in enumerate(varied):
        rows += [[*middle[:k], level, *middle[k + 1 :]] for level in item.spread.levels(count)]
    return rows


def require_varied(source: StudySource, varied: Sequence[Parameter]) -> None:
    """Refuse a study in which nothing varies."""
    if not varied:
        raise InputError(
            source.where(("parameters",)),
            got="no parameter that varies",
            expected="at least one range, distribution or list of values",
            hint="write {from: 8 N, to: 20 N}.",
        )


def _require_few(source: StudySource, count: int) -> None:
    if count > _MOST_POINTS:
        raise InputError(
            source.where(("design", "levels")),
            got=f"a grid of {count} points",
            expected=f"at most {_MOST_POINTS}",
            hint="use fewer levels, or kind: sobol.",
        )


def _rows_of_file(
    source: StudySource, varied: Sequence[Parameter]
) -> tuple[Iterable[Sequence[float | str]], str]:
    """Rows of a CSV file: a column for each parameter that varies, values with their units."""
    file = source.study.design.file
    assert file is not None
    table = list(csv.reader(StringIO(text_of(file))))
    names = [item.name for item in varied]
    head = [cell.strip() for cell in table[0]] if table else []
    if sorted(head) != sorted(names):
        raise InputError(
            f"{file}:1",
            got=f"a head of: {one_of(head)}",
            expected=f"one column for each parameter that varies: {one_of(names)}",
            hint="write the names as in the study.",
        )
    rows = []
    for number, cells in enumerate(table[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(head):
            raise InputError(
                f"{file}:{number}",
                got=f"{len(cells)} values",
                expected=f"{len(head)}, one for each name in the head",
                hint="use a comma between values and a point in numbers.",
            )
        texts = dict(zip(head, (cell.strip() for cell in cells), strict=True))
        at = f"{file}:{number}"
        rows.append([_cell(f"{at}: {item.name}", texts[item.name], item) for item in varied])
    if not rows:
        raise InputError(
            str(file), got="no row of values", expected="at least one", hint="add the points."
        )
    return rows, f"from {file.name}"


def _cell(where: str, text: str, item: Parameter) -> float | str:
    """A quantity, a whole number where the case has one, or a word."""
    if item.kind is not None:
        return parse_quantity(text, item.kind, where)
    is_whole = isinstance(item.today, int) and text.isascii() and text.isdecimal()
    return int(text) if is_whole else text
