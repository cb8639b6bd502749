"""One level of a keyword file: a part, an instance, or the assembly (or a flat file)."""

from dataclasses import dataclass, field

import numpy as np

from klack.arrays import Floats, Ints
from klack.errors import InputError, refuse_if
from klack.mesh.files.abaqus.elements import ElementGroup, place_of_element, read_elements
from klack.mesh.files.abaqus.keywords import DataLine, Keyword
from klack.mesh.files.abaqus.numbers import is_integer, node_records, number
from klack.mesh.files.abaqus.sets import NamedSets, Names, Numbering, read_members

__all__ = ["Entities", "FaceSelection", "Instance", "Scope", "Section"]


_SMALLEST = 1e-9  # sine of the angle between axes, relative length


@dataclass(frozen=True, slots=True, eq=False)
class NodeSystem:
    """Frame of node coordinates, :math:`x = a + x_1' e_1 + x_2' e_2 + x_3' e_3`.

    Parameters
    ----------
    origin (3,)
    axes (3, 3)
        Unit vectors in rows.
    """

    origin: Floats
    axes: Floats

    def of(self, points: Floats) -> Floats:
        """Global coordinates of points, shape (n, 3)."""
        return self.origin + points @ self.axes


def read_system(keyword: Keyword) -> NodeSystem | None:
    """Frame of a *SYSTEM; None (global) without data.

    First line: origin and a point of the first axis; second: a point of the plane of the first and
    second axis. Without it the third axis stays, and the first one is laid into the plane z = 0.
    """
    rows = [[number(line, t) for t in line.fields] for line in keyword.lines() if line.fields]
    lengths = [len(row) for row in rows]
    if not rows:
        return None
    if lengths == [3]:
        return NodeSystem(np.array(rows[0]), np.eye(3))
    _unfit_if(
        lengths not in ([6], [6, 3]),
        keyword,
        f"data lines of {', '.join(map(str, lengths[:8]))} numbers",
    )
    a, b = np.array(rows[0][:3]), np.array(rows[0][3:])
    first = b - a
    second = np.array(rows[1]) - a if len(rows) == 2 else np.array([-first[1], first[0], 0.0])
    if len(rows) == 1:
        first = np.array([first[0], first[1], 0.0])
    normal = np.cross(first, second)
    size = np.linalg.norm(first) * np.linalg.norm(second)
    _unfit_if(
        not (np.isfinite(size) and np.linalg.norm(normal) > _SMALLEST * size),
        keyword,
        "points on one line",
    )
    e1, e3 = first / np.linalg.norm(first), normal / np.linalg.norm(normal)
    return NodeSystem(a, np.array([e1, np.cross(e3, e1), e3]))


def _unfit_if(wrong: object, keyword: Keyword, got: str) -> None:
    refuse_if(
        wrong,
        f"{keyword.place}: *SYSTEM",
        got=got,
        expected="an origin (3 numbers), with a point of the x axis (6), and in a second line a "
        "point of the x-y plane (3)",
        hint="write the file again with global rectangular coordinates.",
    )


@dataclass
class Entities:
    """Nodes or elements of a scope: numbers, count, and sets."""

    kind: str
    sets: NamedSets
    numbering: Numbering = field(default_factory=Numbering)
    count: int = 0

    @classmethod
    def of(cls, kind: str) -> "Entities":
        """None yet; ``kind`` is ``"node"`` or ``"element"``."""
        return cls(kind, NamedSets(Names(f"{kind} set")))

    def copy(self) -> "Entities":
        """Independent copy of the entities."""
        return Entities(self.kind, self.sets.copy(), self.numbering.copy(), self.count)


@dataclass(frozen=True, slots=True)
class FaceSelection:
    """Faces that a *SURFACE names.

    Parameters
    ----------
    elements
        Rows.
    side
        From 1; 0 for exposed faces, and for surface elements.
    """

    elements: Ints
    side: int


@dataclass(frozen=True, slots=True)
class Section:
    """A *SOLID SECTION: key of the element set, material or ""."""

    elset: str
    material: str


@dataclass(frozen=True, slots=True)
class Instance:
    """A part in the assembly, with the rows of its first node and element."""

    name: str
    scope: "Scope"
    first_node: int
    first_element: int


@dataclass
class Scope:
    """Nodes, elements, sets, surfaces and sections of one level.

    Nodes and elements are rows, from 0 in the order of the file.
    """

    nodes: Entities = field(default_factory=lambda: Entities.of("node"))
    elements: Entities = field(default_factory=lambda: Entities.of("element"))
    labels: list[Ints] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)
    groups: list[ElementGroup] = field(default_factory=list)
    listed: list[str] = field(default_factory=list)  # keys of *ELSET keywords
    sections: list[Section] = field(default_factory=list)
    surfaces: Names[FaceSelection] = field(default_factory=lambda: Names("surface"))
    node_surfaces: NamedSets = field(default_factory=lambda: NamedSets(Names("surface")))
    instances: dict[str, Instance] = field(default_factory=dict)
    system: NodeSystem | None = None  # of the nodes that follow
    solids_only: bool = False  # elements of other kinds are left out
    waiting: list[Keyword] = field(default_factory=list)  # until all sets are known

    def copy(self) -> "Scope":
        """Copy of a finished part."""
        return Scope(
            nodes=self.nodes.copy(),
            elements=self.elements.copy(),
            labels=list(self.labels),
            points=list(self.points),
            groups=list(self.groups),
            listed=list(self.listed),
            sections=list(self.sections),
            surfaces=self.surfaces.copy(),
            node_surfaces=self.node_surfaces.copy(),
            solids_only=self.solids_only,
        )

    def take(self, keyword: Keyword) -> None:
        """Process one keyword; irrelevant ones are ignored."""
        match keyword.name:
            case "NODE":
                self._take_nodes(keyword)
            case "ELEMENT":
                self._take_elements(keyword)
            case "NSET":
                self._take_set(keyword, "NSET", self.nodes)
            case "ELSET":
                self._take_set(keyword, "ELSET", self.elements)
                self.listed.append(keyword.parameter("ELSET").upper())
            case "SYSTEM":
                self.system = read_system(keyword)
            case "SURFACE" | "SOLID SECTION":
                self.waiting.append(keyword)

    def named(self, line: DataLine, text: str, kind: str) -> Ints:
        """Rows that a data line names: a set, a number, instance.number."""
        own = self._entities(kind)
        if own.sets.names.find(text) is not None:
            return own.sets.resolve(line.place, text)
        head, _, tail = text.rpartition(".")
        scope, first = self, 0
        if head and head.upper() in self.instances:
            instance = self.instances[head.upper()]
            scope = instance.scope
            first = instance.first_node if kind == "node" else instance.first_element
        elif head:
            tail = text
        if not is_integer(tail):
            return own.sets.resolve(line.place, text)
        row = scope._entities(kind).numbering.find(np.array([int(tail)]))
        refuse_if(
            row[0] < 0,
            line.place,
            got=f"{kind} {text}, which the file does not define",
            expected=f"numbers of {kind}s of this file",
            hint="the file may be truncated or edited by hand: write it "
            "again from the preprocessor.",
        )
        return row + first

    def group_of(self, rows: Ints) -> Ints:
        """Index of the element group of every element."""
        return np.searchsorted([group.first for group in self.groups], rows, side="right") - 1

    def _entities(self, kind: str) -> Entities:
        return self.nodes if kind == "node" else self.elements

    def _take_nodes(self, keyword: Keyword) -> None:
        if keyword.parameters.get("SYSTEM", "R").upper() != "R":
            raise InputError(
                f"{keyword.place}: *NODE",
                got=f"SYSTEM={keyword.parameters['SYSTEM'][:40]}",
                expected="rectangular coordinates",
                hint="write the file again with global rectangular coordinates.",
            )
        labels, points = node_records(keyword)
        label = self.nodes.numbering.repeated(labels)
        if label is not None:
            known = self.nodes.numbering.find(np.array([label]))[0] >= 0
            lines = (line for line in keyword.lines() if number(line, line.fields[0]) == label)
            places = [line.place for line in lines]
            _defined_twice(places[0 if known else 1], "node", label)
        self.nodes.numbering.add(labels, self.nodes.count)
        self.labels.append(labels)
        self.points.append(points if self.system is None else self.system.of(points))
        if "NSET" in keyword.parameters:
            rows = np.arange(self.nodes.count, self.nodes.count + len(labels))
            self.nodes.sets.add(keyword.place, keyword.parameter("NSET"), rows)
        self.nodes.count += len(labels)

    def _take_elements(self, keyword: Keyword) -> None:
        family, solid, table = read_elements(keyword, solids_only=self.solids_only)
        numbers = np.ascontiguousarray(table[:, 0])
        label = self.elements.numbering.repeated(numbers)
        if label is not None:
            known = self.elements.numbering.find(np.array([label]))[0] >= 0
            _defined_twice(place_of_element(keyword, label, 1 if known else 2), "element", label)
        nodes = self.nodes.numbering.find(table[:, 1:]) if family else table[:, 1:]
        if (nodes < 0).any():
            row = int(np.argmax((nodes < 0).any(axis=1)))
            missing = table[row, 1:][nodes[row] < 0][0]
            raise InputError(
                f"{keyword.place}: *ELEMENT: element {numbers[row]}",
                got=f"node {missing}, which the file does not define above",
                expected="nodes of this file",
                hint="the file may be truncated, or its *NODE lines are in a file that is not "
                "included.",
            )
        group = ElementGroup(
            family=family,
            solid=solid,
            numbers=numbers,
            nodes=nodes,
            first=self.elements.count,
            elset=keyword.parameters.get("ELSET", ""),
            instance="",
            place=keyword.place,
            kind=keyword.parameter("TYPE").upper(),
        )
        if group.elset:
            self.elements.sets.add(keyword.place, group.elset, group.rows)
        if len(numbers):
            self.elements.numbering.add(numbers, self.elements.count)
            self.elements.count += len(numbers)
            self.groups.append(group)

    def _take_set(self, keyword: Keyword, parameter: str, own: Entities) -> None:
        name = keyword.parameter(parameter)
        source, first_node, first_element = self._source(keyword)
        first = first_node if own.kind == "node" else first_element
        if own.kind == "node" and "ELSET" in keyword.parameters:
            named = source.elements.sets.resolve(keyword.place, keyword.parameter("ELSET"))
            rows = source.nodes_of(named)
        else:
            rows = read_members(
                keyword,
                source._entities(own.kind).numbering,
                lambda line, text: source.named(line, text, own.kind),
            )
        own.sets.add(keyword.place, name, rows + first if first else rows)

    def _source(self, keyword: Keyword) -> tuple["Scope", int, int]:
        """Scope whose numbers a set lists: its INSTANCE, or this one."""
        if "INSTANCE" not in keyword.parameters:
            return self, 0, 0
        name = keyword.parameter("INSTANCE")
        instance = self.instances.get(name.upper())
        if instance is None:
            known = ", ".join(part.name for part in list(self.instances.values())[:12])
            raise InputError(
                f"{keyword.place}: *{keyword.name}",
                got=f"INSTANCE={name[:80]}",
                expected=f"an instance that is defined above ({known or 'none'})",
                hint="check the spelling, or define the instance before its sets.",
            )
        return instance.scope, instance.first_node, instance.first_element

    def nodes_of(self, elements: Ints) -> Ints:
        """Rows of the nodes of these elements."""
        owner = self.group_of(elements)
        used = np.zeros(self.nodes.count, dtype=bool)
        for index in np.unique(owner).tolist():
            group = self.groups[index]
            used[group.nodes[elements[owner == index] - group.first]] = True
        return np.flatnonzero(used)


def _defined_twice(place: str, kind: str, label: int) -> None:
    raise InputError(
        place,
        got=f"{kind} {label} for the second time",
        expected=f"every {kind} number once",
        hint="look for a file that is included twice, or for two parts without *PART.",
    )
