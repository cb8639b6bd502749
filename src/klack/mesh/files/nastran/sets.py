"""Named sets of nodes, and coordinate systems, of bulk data."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.files.nastran.cards import BulkData, Card
from klack.mesh.files.text_columns import Ranges, within

__all__ = ["Frames", "names_in_comments", "node_sets"]


_DEGREES = ("ASET", "BSET", "CSET", "QSET", "OMIT")


def node_sets(bulk: BulkData, numbers: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """Sets of nodes: SET of the case control, SET1, SET3 of grids, ASET and the like, USET.

    Called ``set_5``, ``aset``, or after USET; members that are no nodes are left out (a SET of the
    case control may be one of elements), and sets without nodes.
    """
    ordered = np.sort(numbers)
    given = names_in_comments(bulk).get("SET", {})
    members: dict[str, Ranges] = {}
    for name, ranges in _of_cards(bulk, given):
        members.setdefault(name, []).extend(ranges)
    for label, ranges in _of_case_control(bulk.head):
        members.setdefault(given.get(label, f"set_{label}"), []).extend(ranges)
    sets = {name: within(ordered, ranges) for name, ranges in members.items()}
    return {name: nodes for name, nodes in sets.items() if len(nodes)}


def _of_cards(bulk: BulkData, given: dict[int, str]) -> Iterator[tuple[str, Ranges]]:
    for card in bulk.cards("SET1"):
        label = card.integer(1, "number of the set")
        yield given.get(label, f"set_{label}"), _ranges(card, card.fields[1:])
    for card in bulk.cards("SET3"):
        label = card.integer(1, "number of the set")
        if card.field(2).upper() in ("GRID", "POINT"):
            yield given.get(label, f"set_{label}"), _ranges(card, card.fields[2:])
    for name in _DEGREES:
        for card in bulk.cards(name):
            yield name.lower(), _ranges(card, card.fields[::2])
        for card in bulk.cards(name + "1"):
            yield name.lower(), _ranges(card, card.fields[1:])
    for card in bulk.cards("USET"):
        yield card.field(1) or "uset", _ranges(card, card.fields[1::2])
    for card in bulk.cards("USET1"):
        yield card.field(1) or "uset", _ranges(card, card.fields[2:])


def _ranges(card: Card, fields: list[str]) -> Ranges:
    words = [word for word in fields if word]
    try:
        return _read(words)
    except ValueError:
        card.refuse(f"the members {' '.join(words)[:60]}", "node numbers, or 'first THRU last'")
        raise


def _read(words: list[str]) -> Ranges:
    """Ranges of ``1 THRU 10 EXCEPT 4 5 20``; ValueError for others."""
    ranges: Ranges = []
    i = 0
    while i < len(words):
        if words[i].upper() == "ALL":
            return [(1, 10**18)]
        first = _number(words[i])
        if i + 2 < len(words) and words[i + 1].upper() == "THRU":
            last = _number(words[i + 2])
            if last < first:
                raise ValueError(words[i])
            i += 3
            left_out: list[int] = []
            if i < len(words) and words[i].upper() == "EXCEPT":
                i += 1
                while i < len(words) and words[i].isdecimal() and _number(words[i]) <= last:
                    left_out.append(_number(words[i]))
                    i += 1
            for gap in sorted(set(left_out)):
                if first <= gap - 1:
                    ranges.append((first, gap - 1))
                first = gap + 1
            if first <= last:
                ranges.append((first, last))
        else:
            ranges.append((first, first))
            i += 1
    return ranges


def _number(word: str) -> int:
    if not re.fullmatch(r"\d{1,18}", word):
        raise ValueError(word)
    return int(word)


_SET = re.compile(r"\s*SET\s+(\d{1,9})\s*=\s*(.*)", re.IGNORECASE)


def _of_case_control(head: tuple[str, ...]) -> Iterator[tuple[int, Ranges]]:
    """Sets of integers."""
    lines = iter(head)
    for line in lines:
        match = _SET.match(line)
        if not match:
            continue
        text = [match[2]]
        while text[-1].rstrip().endswith(","):
            text.append(next(lines, ""))
        words = " ".join(text).replace(",", " ").split()
        try:
            yield int(match[1]), _read(words)
        except ValueError:
            if any(re.search(r"[.A-Za-z]", w.upper().replace("THRU", "")) for w in words):
                continue
            raise InputError(
                f"SET {match[1]} of the case control",
                got=" ".join(words)[:60],
                expected="numbers, or 'first THRU last'",
                hint="correct the set, or remove it from the file.",
            ) from None


_NAMES = (
    # $HMNAME PROP  1"needle" 4
    re.compile(r"\$HMNAME\s+(?P<kind>[A-Z]+)\s+(?P<label>\d{1,9})\s*\"(?P<name>[^\"]+)\"", re.I),
    re.compile(r"\$HM(?P<kind>SET)\s+(?P<label>\d{1,9})\s+\d+\s*\"(?P<name>[^\"]+)\"", re.I),
    # $ANSA_NAME_COMMENT;1;PSOLID;needle;
    re.compile(r"\$ANSA_NAME_COMMENT;(?P<label>\d{1,9});(?P<kind>\w+);(?P<name>[^;]+);", re.I),
    # $ Femap Property 1 : needle
    re.compile(r"\$ Femap (?P<kind>\w+) (?P<label>\d{1,9}) : (?P<name>.+)", re.I),
)
_KINDS = {
    **{"PROP": "PROPERTY", "PROPERTY": "PROPERTY", "PSOLID": "PROPERTY", "PSHELL": "PROPERTY"},
    **{"MAT": "MATERIAL", "MATS": "MATERIAL", "MATERIAL": "MATERIAL", "MAT1": "MATERIAL"},
    **{"SET": "SET", "GROUP": "SET"},
}


def names_in_comments(bulk: BulkData) -> dict[str, dict[int, str]]:
    """Names in comments of HyperMesh, ANSA and Femap, by kind and number."""
    names: dict[str, dict[int, str]] = {}
    for comment in bulk.comments:
        if comment[1:3].upper() not in ("HM", "AN", " F"):
            continue
        for pattern in _NAMES:
            match = pattern.match(comment)
            if match and match["kind"].upper() in _KINDS:
                kind = _KINDS[match["kind"].upper()]
                names.setdefault(kind, {}).setdefault(int(match["label"]), match["name"].strip())
    return names


_DEEPEST = 50


@dataclass(frozen=True, slots=True)
class _Definition:
    card: Card
    kind: str  # R, C or S
    reference: int
    points: NDArray[np.float64] | None  # three rows in the reference system
    nodes: tuple[int, int, int] | None


class Frames:
    r"""All coordinate systems of a file.

    Given by three points: A the origin, B on the z axis, C in the x-z plane. Angles are in
    degrees; the spherical angle :math:`\theta` is from the z axis. ``node`` gives the basic
    coordinates of a node.
    """

    def __init__(self, bulk: BulkData, node: Callable[[int, int], NDArray[np.float64]]) -> None:
        self._node = node
        self._known: dict[int, _Definition] = {}
        for kind in "RCS":
            for card in bulk.cards(f"CORD2{kind}"):
                points = np.array([card.real(i, "coordinate") for i in range(3, 12)])
                reference = card.integer(2, "coordinate system") if card.field(2) else 0
                label = card.integer(1, "number of the coordinate system")
                self._add(label, _Definition(card, kind, reference, points.reshape(3, 3), None))
            for card in bulk.cards(f"CORD1{kind}"):
                for first in (1, 5):
                    if card.field(first):
                        label, *nodes = (card.integer(first + i, "number") for i in range(4))
                        triple = (nodes[0], nodes[1], nodes[2])
                        self._add(label, _Definition(card, kind, 0, None, triple))

    def _add(self, label: int, definition: _Definition) -> None:
        if label in self._known:
            definition.card.refuse(f"coordinate system {label} for the second time", "one of each")
        self._known[label] = definition

    def basic(
        self, label: int, x: NDArray[np.float64], place: str, depth: int = 0
    ) -> NDArray[np.float64]:
        """Coordinates (n, 3) of one system as basic ones."""
        if label == 0:
            return x
        refuse_if(
            label not in self._known or depth > _DEEPEST,
            f"{place}: coordinate system {label}",
            got="no CORD1 or CORD2 card for it" if depth <= _DEEPEST else "a loop of systems",
            expected="a system that the file defines, or 0",
            hint="the file may be truncated, or the card may be in a file that is not included.",
        )
        own = self._known[label]
        if own.nodes is not None:
            corners = np.array([self._node(node, depth + 1) for node in own.nodes])
        else:
            assert own.points is not None
            corners = self.basic(own.reference, own.points, own.card.place, depth + 1)
        axes = _axes(own.card, corners)
        return corners[0] + _rectangular(own.kind, x) @ axes


def _axes(card: Card, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors of the axes, as rows."""
    z = corners[1] - corners[0]
    y = np.cross(z, corners[2] - corners[0])
    lengths = np.linalg.norm(z), np.linalg.norm(y)
    if not min(lengths) > 1e-9 * np.linalg.norm(corners[2] - corners[0]):
        card.refuse("three points on one line", "an origin, a point on z and one in the x-z plane")
    z, y = z / lengths[0], y / lengths[1]
    return np.array([np.cross(y, z), y, z])


def _rectangular(kind: str, x: NDArray[np.float64]) -> NDArray[np.float64]:
    if kind == "R":
        return x
    a, b = np.radians(x[:, 1]), np.radians(x[:, 2])
    if kind == "C":
        return np.stack([x[:, 0] * np.cos(a), x[:, 0] * np.sin(a), x[:, 2]], axis=1)
    ring = x[:, 0] * np.sin(a)
    return np.stack([ring * np.cos(b), ring * np.sin(b), x[:, 0] * np.cos(a)], axis=1)
