"""Points of a parameter space: a case with other values at some keys."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from klack.case.any_case import AnyCase, CaseTree
from klack.case.key_path import kind_at, node_at, split_path
from klack.case.reader import validated
from klack.case.rewriting import merged
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, Key, one_of
from klack.network.component import Component
from klack.units import Kind, parse_quantity

__all__ = [
    "GivenPoints",
    "PointKey",
    "PointValue",
    "Points",
    "case_at",
    "checked_parts",
    "points_of",
    "with_changes",
]

PointValue = str | int | float
CaseKind = TypeVar("CaseKind", Case, ValveCase)
GivenPoints = Sequence[Mapping[str, PointValue]] | Mapping[str, Sequence[PointValue]]
"""Key to value for each point, or a list of values per key."""

_WHERE = "points"


@dataclass(frozen=True, slots=True)
class PointKey:
    """A key that points exchange.

    Parameters
    ----------
    name
        As ``"network.components.spring.preload"``.
    kind
        None without unit, such as a name.
    """

    name: str
    place: Key
    kind: Kind | None

    @property
    def unit(self) -> str:
        """SI unit; ``"1"`` for a number, empty for texts."""
        if self.kind is None:
            return ""
        return "1" if self.kind.bare else self.kind.unit

    def value(self, written: PointValue) -> PointValue:
        """SI value of a quantity, else as written."""
        if self.kind is None:
            return written
        return parse_quantity(written, self.kind, f"{_WHERE}: {self.name}")


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points with checked keys and units.

    Parameters
    ----------
    written
        What each point exchanges by key name, as in a case file.
    """

    keys: tuple[PointKey, ...]
    written: tuple[Mapping[str, PointValue], ...]

    def __len__(self) -> int:
        return len(self.written)

    def changes(self, i: int) -> dict[Key, PointValue]:
        """Exchanged values of one point."""
        row = self.written[i]
        return {key.place: row[key.name] for key in self.keys if key.name in row}


def points_of(case: AnyCase, tree: CaseTree, given: GivenPoints) -> Points:
    """Check the keys of points and the units of their values.

    Whether the case allows a value is checked at the point, see :func:`checked_parts`. Rejects
    unknown keys, other kinds, missing units, and lists of different lengths.

    Parameters
    ----------
    case
        Without the points.
    tree
        The same as written.
    """
    rows = list(_rows(given))
    names = dict.fromkeys(name for row in rows for name in row)
    keys = {name: _key(case, tree, name) for name in names}
    _require_apart(keys.values())
    written = tuple(
        {str(name): _scalar(i, name, value) for name, value in row.items()}
        for i, row in enumerate(rows)
    )
    for row in written:
        for name, value in row.items():
            keys[name].value(value)
    return Points(tuple(keys.values()), written)


def checked_parts(tree: CaseTree, case: ValveCase, places: Iterable[Key]) -> CaseTree:
    """Replace every part of the data that no point touches by its checked object.

    Sections and components are then not read again, only that all fit together.  Components of the
    user's own are made anew for every point: they may remember something.

    Parameters
    ----------
    case
        What the tree holds, checked.
    places
        That points touch.
    """
    touched = set(places)
    if any(place[0] in _EXPANDED for place in touched):  # any section may follow from it
        return tree
    heads = {place[0] for place in touched}
    data = {
        name: value if name in heads or name not in _SECTIONS else getattr(case, name)
        for name, value in tree.data.items()
    }
    network = tree.data["network"]
    inside = {place[1] for place in touched if place[0] == "network" and len(place) > 1}
    if ("network",) not in touched:
        data["network"] = {
            name: value if name in inside else getattr(case.network, name)
            for name, value in network.items()
        } | {"components": _components(tree, case, touched)}
    return CaseTree(
        path=tree.path, text=tree.text, data=data, lines=tree.lines, components=tree.components
    )


def case_at(
    kind: type[CaseKind], tree: CaseTree, parts: CaseTree, changes: Mapping[Key, PointValue]
) -> CaseKind:
    """Check the case of a point.

    Parameters
    ----------
    tree
        As written.
    parts
        Of :func:`checked_parts`.
    """
    data = with_changes(parts.data, changes)
    try:
        return validated(kind, tree.text, tree.path, data, tree.lines, tree.components)
    except InputError:  # in the words of the file
        whole = with_changes(tree.data, changes)
        return validated(kind, tree.text, tree.path, whole, tree.lines, tree.components)


_EXPANDED = ("parameters", "include", "parts")
_SECTIONS = frozenset(ValveCase.model_fields) - {*_EXPANDED}


def _components(tree: CaseTree, case: ValveCase, touched: set[Key]) -> dict[str, Any]:
    written = tree.data["network"]["components"]
    changed = {
        place[2] for place in touched if place[:2] == ("network", "components") and place[2:]
    }
    if ("network", "components") in touched:
        return dict(written)
    made: Mapping[str, Component] = case.network.components
    return {
        name: value if name in changed or value["type"] in tree.components else made[name]
        for name, value in written.items()
    }


def with_changes(data: Any, changes: Mapping[Key, PointValue]) -> Any:
    """Copy of plain data with other values at some keys."""
    for place, value in changes.items():
        data = merged(data, place, value)
    return data


def _rows(given: GivenPoints) -> Iterable[Mapping[str, PointValue]]:
    if not isinstance(given, Mapping):
        return _given_rows(given)
    columns = {name: _column(name, values) for name, values in given.items()}
    counts = {name: len(values) for name, values in columns.items()}
    if len(set(counts.values())) > 1:
        words = (f"{count} for '{name}'" for name, count in counts.items())
        raise InputError(
            _WHERE,
            got=f"lists of different lengths ({', '.join(words)})",
            expected="the same number of values for every key",
            hint="give one value of every key for every point.",
        )
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _given_rows(given: Iterable[Any]) -> Iterable[Mapping[str, PointValue]]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise _not_points(f"{type(given).__name__}")
    rows = list(given)
    for i, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise _not_points(f"point {i} of the type {type(row).__name__}")
    return rows


def _not_points(got: str) -> InputError:
    return InputError(
        _WHERE,
        got=got,
        expected="a mapping of key to value for every point, or a list of values for every key",
        hint='write [{"network.components.spring.preload": "12 N"}, ...]; of a table of pandas: '
        'table.to_dict("list").',
    )


def _column(name: str, values: Any) -> list[Any]:
    refuse_if(
        isinstance(values, str | int | float) or not isinstance(values, Iterable),
        f"{_WHERE}: {name}",
        got=f"'{values}'",
        expected="a list with a value for every point",
        hint="put it into brackets; a constant value belongs in the case.",
    )
    return list(values)


def _key(case: AnyCase, tree: CaseTree, name: object) -> PointKey:
    try:
        place = split_path(name if isinstance(name, str) else str(name))
        node, field = node_at(case, place)
        merged(tree.data, place, None)
    except CaseProblem as problem:
        raise InputError(
            f"{_WHERE}: {name}", got=problem.got, expected=problem.expected, hint=problem.hint
        ) from None
    number = node is None or (isinstance(node, float | int) and not isinstance(node, bool))
    return PointKey(str(name), place, kind_at(node, field) if number else None)


def _require_apart(keys: Iterable[PointKey]) -> None:
    """Reject a key twice or below another: their order would count."""
    places: dict[Key, str] = {}
    for key in keys:
        if key.place in places:
            raise InputError(
                f"{_WHERE}: {key.name}",
                got=f"the key '{places[key.place]}', written in two ways",
                expected="one name for each key",
                hint="leave one of them out.",
            )
        places[key.place] = key.name
    for place, name in places.items():
        for depth in range(1, len(place)):
            if place[:depth] in places:
                raise InputError(
                    f"{_WHERE}: {name}",
                    got=f"a key below '{places[place[:depth]]}', which the points change as well",
                    expected="keys that do not contain each other",
                    hint="leave one of them out.",
                )


def _scalar(i: int, name: str, value: Any) -> PointValue:
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, str | int | float):
        return plain
    raise InputError(
        f"{_WHERE}: {name}, point {i}",
        got=f"a {type(value).__name__}",
        expected="one value, as in the case file",
        hint='give a text such as "14 N", or a number; set entries of a list one by one, by '
        f"position: {one_of([name + '.0'])}.",
    )
