"""Meshes from Abaqus and CalculiX input files (.inp).

Read are nodes, solid and axisymmetric elements, node and element sets, surfaces, and, as extra
information, elastic materials and sections.  Steps, loads and constraints are passed over.  A set
of surface elements (membranes, shells, plane elements: what gmsh and most preprocessors write for
a named surface) becomes a surface, provided that every one of them lies on a solid element.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, require_positive
from klack.materials import Material
from klack.mesh.abaqus_elements import ElementGroup, read_elements
from klack.mesh.abaqus_keywords import DataLine, Keyword, read_keywords
from klack.mesh.abaqus_sets import NamedSets, integer, number, records
from klack.mesh.boundary import FaceTable
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.quality import require_positive_jacobians

__all__ = ["AbaqusMaterial", "AbaqusModel", "read_abaqus", "read_abaqus_model"]

_GENERATING = {"NGEN", "NFILL", "NMAP", "NCOPY", "ELGEN", "ELCOPY", "SYSTEM"}


@dataclass(frozen=True, slots=True, kw_only=True)
class AbaqusMaterial:
    """Elastic material as the file has it, in the units of the file.

    Parameters
    ----------
    name : str
    young : float [stress unit of the file]
    poisson : float [-]
    density : float [density unit of the file], or None
    """

    name: str
    young: float
    poisson: float
    density: float | None

    def in_si(self, *, stress: float, density: float) -> Material:
        """Convert to SI: ``stress`` [Pa] and ``density`` [kg/m^3] are the units of the file.

        For a model in tonne, mm, s, N these are 1e6 Pa and 1e12 kg/m^3.
        """
        if self.density is None:
            raise InputError(
                f"material '{self.name}'",
                got="no *DENSITY",
                expected="Young's modulus, Poisson's ratio and density",
                hint="add *DENSITY to the file, or name a material in the case.",
            )
        return Material(
            name=self.name,
            young=self.young * stress,
            poisson=self.poisson,
            density=self.density * density,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AbaqusModel:
    """Mesh with what else the file says.

    Parameters
    ----------
    mesh : Mesh
    node_numbers : int array, shape (n_nodes,)
        Number in the file of every node of the mesh.
    element_numbers : tuple of int arrays
        The same for the elements, one array per block.
    materials : mapping of name to AbaqusMaterial
    sections : mapping of solid name to material name
        From *SOLID SECTION.
    """

    mesh: Mesh
    node_numbers: NDArray[np.int64]
    element_numbers: tuple[NDArray[np.int64], ...]
    materials: Mapping[str, AbaqusMaterial]
    sections: Mapping[str, str]


def read_abaqus(
    path: str | Path, unit_length: float, *, solids: Sequence[str] | None = None
) -> Mesh:
    """Read the mesh of an Abaqus or CalculiX file.

    Parameters
    ----------
    path : path
    unit_length : float [m]
        What the file's unit of length is: 1e-3 for millimetres.  Such files do not say.
    solids : sequence of str or None
        Keep these solids only; None keeps all.

    Returns
    -------
    Mesh
        Of dimension 3 (C3D elements), or 2 (CAX elements: x is r, y is z).  The solids are called
        after the element sets of *SOLID SECTION; without sections after the sets of *ELEMENT, or
        after the *ELSET that is made of whole such sets (a physical group of gmsh).

    Raises
    ------
    InputError
        With file and line, if the file is cut off, uses what is not supported, or names nodes,
        elements or sets that it does not define.
    """
    return read_abaqus_model(path, unit_length, solids=solids).mesh


def read_abaqus_model(
    path: str | Path, unit_length: float, *, solids: Sequence[str] | None = None
) -> AbaqusModel:
    """Read mesh, materials and sections; see :func:`read_abaqus`."""
    require_positive("read_abaqus: unit_length", unit_length, "m")
    path = Path(path)
    deck = _read_deck(path)
    return _build(path, deck, unit_length, solids)


@dataclass
class _Deck:
    """Content of the keywords, numbers as in the file."""

    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    groups: list[ElementGroup] = field(default_factory=list)
    elements: set[int] = field(default_factory=set)
    nsets: NamedSets = field(default_factory=lambda: NamedSets("node"))
    elsets: NamedSets = field(default_factory=lambda: NamedSets("element"))
    listed: list[str] = field(default_factory=list)  # names of *ELSET keywords
    surfaces: list[Keyword] = field(default_factory=list)
    sections: list[Keyword] = field(default_factory=list)
    materials: dict[str, AbaqusMaterial] = field(default_factory=dict)
    parts: list[Keyword] = field(default_factory=list)
    instances: list[Keyword] = field(default_factory=list)


def _read_deck(path: Path) -> _Deck:
    deck = _Deck()
    keywords = read_keywords(path)
    in_step = False
    for i, keyword in enumerate(keywords):
        in_step = (in_step or keyword.name == "STEP") and keyword.name != "END STEP"
        if not in_step:
            _take(deck, keyword, keywords[i + 1 :])
    return deck


def _take(deck: _Deck, keyword: Keyword, rest: list[Keyword]) -> None:
    """Put one keyword into the deck."""
    match keyword.name:
        case "NODE":
            _take_nodes(deck, keyword)
        case "ELEMENT":
            _take_elements(deck, keyword)
        case "NSET":
            name = keyword.parameter("NSET")
            if "ELSET" in keyword.parameters:
                members = deck.elsets.resolve(
                    DataLine(keyword.place, ()), keyword.parameter("ELSET")
                )
                deck.nsets.add(name, _nodes_of(deck, members))
            else:
                deck.nsets.read(keyword, name, deck.nodes.__contains__)
        case "ELSET":
            name = keyword.parameter("ELSET")
            deck.elsets.read(keyword, name, deck.elements.__contains__)
            deck.listed.append(name)
        case "SURFACE":
            deck.surfaces.append(keyword)
        case "SOLID SECTION":
            deck.sections.append(keyword)
        case "MATERIAL":
            _take_material(deck, keyword, rest)
        case "PART":
            _take_single(deck.parts, keyword)
        case "INSTANCE":
            _take_single(deck.instances, keyword)
        case name if name in _GENERATING:
            raise InputError(
                f"{keyword.place}: *{keyword.name}",
                got="a keyword that makes nodes or elements",
                expected="all nodes and elements written out",
                hint="write the file again from the preprocessor, as a flat mesh.",
            )


def _take_single(seen: list[Keyword], keyword: Keyword) -> None:
    seen.append(keyword)
    if len(seen) > 1 or (keyword.name == "INSTANCE" and keyword.data):
        raise InputError(
            f"{keyword.place}: *{keyword.name}",
            got="a second one" if len(seen) > 1 else "an instance that is moved or turned",
            expected="one part with one instance in place",
            hint="write every body into its own file, or as a flat file without parts.",
        )


def _take_nodes(deck: _Deck, keyword: Keyword) -> None:
    if keyword.parameters.get("SYSTEM", "R").upper() != "R":
        raise InputError(
            f"{keyword.place}: *NODE",
            got=f"SYSTEM={keyword.parameters['SYSTEM']}",
            expected="rectangular coordinates",
            hint="write the file again with global rectangular coordinates.",
        )
    numbers = []
    for line in keyword.data:
        count = len(line.fields)
        if count not in (3, 4):
            raise InputError(
                line.place,
                got=f"{count} numbers",
                expected="a node number and 2 or 3 coordinates",
                hint="the file may be cut off: write it again from the preprocessor.",
            )
        label = integer(line, line.fields[0])
        x = [number(line, text) for text in line.fields[1:]]
        if label in deck.nodes:
            _defined_twice(line, "node", label)
        deck.nodes[label] = (x[0], x[1], x[2] if count == 4 else 0.0)
        numbers.append(label)
    if "NSET" in keyword.parameters:
        deck.nsets.add(keyword.parameter("NSET"), numbers)


def _take_elements(deck: _Deck, keyword: Keyword) -> None:
    group = read_elements(keyword)
    before = len(deck.elements)
    deck.elements.update(group.numbers.tolist())
    if len(deck.elements) != before + len(group.numbers):
        known = np.concatenate([*(g.numbers for g in deck.groups), group.numbers])
        labels, counts = np.unique(known, return_counts=True)
        _defined_twice(keyword.data[0], "element", int(labels[counts > 1][0]))
    missing = [n for n in np.unique(group.nodes).tolist() if n not in deck.nodes]
    if missing:
        row = int(np.flatnonzero((group.nodes == missing[0]).any(axis=1))[0])
        raise InputError(
            f"{group.place}: *ELEMENT: element {group.numbers[row]}",
            got=f"node {missing[0]}, which the file does not define above",
            expected="nodes of this file",
            hint="the file may be cut off, or its *NODE lines are in a file that is not included.",
        )
    deck.groups.append(group)
    if group.elset:
        deck.elsets.add(group.elset, group.numbers.tolist())


def _defined_twice(line: DataLine, kind: str, label: int) -> None:
    raise InputError(
        line.place,
        got=f"{kind} {label} for the second time",
        expected=f"every {kind} number once",
        hint="look for a file that is included twice, or for two parts in one file.",
    )


def _nodes_of(deck: _Deck, elements: NDArray[np.int64]) -> list[int]:
    parts = [g.nodes[np.isin(g.numbers, elements)].ravel() for g in deck.groups]
    return np.unique(np.concatenate(parts)).tolist()


def _take_material(deck: _Deck, keyword: Keyword, rest: list[Keyword]) -> None:
    """Read *ELASTIC (isotropic) and *DENSITY below a *MATERIAL."""
    name = keyword.parameter("NAME")
    elastic, density = None, None
    for part in rest:
        if part.name in ("MATERIAL", "STEP", "PART", "SOLID SECTION", "NODE", "ELEMENT"):
            break
        isotropic = part.parameters.get("TYPE", "ISOTROPIC").upper().startswith("ISO")
        if part.name == "ELASTIC" and isotropic:
            line, fields = next(records(part, (2, 3), "Young's modulus and Poisson's ratio"))
            elastic = number(line, fields[0]), number(line, fields[1])
        if part.name == "DENSITY":
            line, fields = next(records(part, (1, 2), "a density"))
            density = number(line, fields[0])
    if elastic is not None:
        deck.materials[name] = AbaqusMaterial(
            name=name, young=elastic[0], poisson=elastic[1], density=density
        )


# ---------------------------------------------------------------------------- mesh from the deck


def _build(
    path: Path, deck: _Deck, unit_length: float, wanted: Sequence[str] | None
) -> AbaqusModel:
    solid_groups = [group for group in deck.groups if group.solid and len(group.numbers)]
    _require_solids(path, deck, solid_groups)
    labels = np.array(sorted(deck.nodes), dtype=np.int64)
    coordinates = np.array([deck.nodes[i] for i in labels.tolist()])
    name_of, sections = _solid_names(deck, solid_groups)
    blocks, numbers = _blocks(solid_groups, name_of, labels)
    _require_on_solids(deck, blocks, labels)
    blocks, numbers = _kept(path, blocks, numbers, wanted)
    resolver = _FaceFinder(blocks, numbers, labels, deck)
    surfaces, node_sets = resolver.surfaces_and_sets()
    dimension = blocks[0].topology.dimension
    used = np.unique(np.concatenate([block.connectivity.ravel() for block in blocks]))
    new = np.full(len(labels), -1)
    new[used] = np.arange(len(used))
    mesh = Mesh(
        points=coordinates[used, :dimension] * unit_length,
        blocks=tuple(ElementBlock(b.family, new[b.connectivity], b.solid) for b in blocks),
        surfaces={name: _renumbered(surface, new) for name, surface in surfaces.items()},
        node_sets={
            name: kept for name, nodes in node_sets.items() if len(kept := _present(new, nodes))
        },
    )
    _require_right_of_axis(path, mesh, labels[used])
    require_positive_jacobians(str(path), mesh, numbers=numbers)
    return AbaqusModel(
        mesh=mesh,
        node_numbers=labels[used],
        element_numbers=numbers,
        materials=deck.materials,
        sections={name: sections[name] for name in mesh.solids if name in sections},
    )


def _require_solids(path: Path, deck: _Deck, groups: list[ElementGroup]) -> None:
    dimensions = {FAMILIES[group.family].dimension for group in groups}
    if len(dimensions) != 1:
        kinds = ", ".join(sorted({group.family for group in deck.groups})) or "none"
        raise InputError(
            str(path),
            got=f"elements with the topology {kinds}",
            expected="solid elements (C3D...), or axisymmetric ones (CAX...), not both",
            hint="save the volume elements too; name a plane mesh of a meridian CAX6, not CPS6.",
        )


def _solid_names(deck: _Deck, groups: list[ElementGroup]) -> tuple[dict[int, str], dict[str, str]]:
    """Name of the solid of every solid element number, and material name by solid."""
    name_of: dict[int, str] = {}
    sections: dict[str, str] = {}
    members: dict[str, NDArray[np.int64]] = {}
    for group in groups:
        label = group.elset or "solid"
        members[label] = np.append(members.get(label, group.numbers[:0]), group.numbers)
    free = dict(members)
    for name in dict.fromkeys(deck.listed):
        listed = set(deck.elsets.numbers(name).tolist())
        whole = [label for label, part in free.items() if listed.issuperset(part.tolist())]
        if whole and sum(len(free[label]) for label in whole) == len(listed):
            for label in whole:
                name_of.update(dict.fromkeys(free.pop(label).tolist(), name))
    for label, part in free.items():
        name_of.update(dict.fromkeys(part.tolist(), label))
    for keyword in deck.sections:
        name = keyword.parameter("ELSET")
        elements = deck.elsets.resolve(DataLine(keyword.place, ()), name).tolist()
        known = [element for element in elements if element in name_of]
        name_of.update(dict.fromkeys(known, name))
        if "MATERIAL" in keyword.parameters:
            sections[name] = keyword.parameters["MATERIAL"]
    return name_of, sections


def _blocks(
    groups: list[ElementGroup], name_of: dict[int, str], labels: NDArray[np.int64]
) -> tuple[tuple[ElementBlock, ...], tuple[NDArray[np.int64], ...]]:
    """One block per solid and family, nodes counted from 0, and their element numbers."""
    blocks, numbers = [], []
    names = [np.array([name_of[i] for i in group.numbers.tolist()]) for group in groups]
    for name in dict.fromkeys(np.concatenate(names).tolist()):
        for family in dict.fromkeys(group.family for group in groups):
            here = [
                (group, own == name)
                for group, own in zip(groups, names, strict=True)
                if group.family == family and (own == name).any()
            ]
            if here:
                nodes = np.concatenate([group.nodes[mask] for group, mask in here])
                blocks.append(ElementBlock(family, np.searchsorted(labels, nodes), name))
                numbers.append(np.concatenate([group.numbers[mask] for group, mask in here]))
    return tuple(blocks), tuple(numbers)


def _kept(
    path: Path,
    blocks: tuple[ElementBlock, ...],
    numbers: tuple[NDArray[np.int64], ...],
    wanted: Sequence[str] | None,
) -> tuple[tuple[ElementBlock, ...], tuple[NDArray[np.int64], ...]]:
    if wanted is None:
        return blocks, numbers
    known = {block.solid for block in blocks}
    for name in wanted:
        if name not in known:
            raise InputError(
                f"{path}: solid '{name}'",
                got="a name that the file does not have",
                expected=f"one of: {', '.join(sorted(known))}",
                hint="solids are called after the sets of *SOLID SECTION or *ELEMENT.",
            )
    keep = [i for i, block in enumerate(blocks) if block.solid in wanted]
    return tuple(blocks[i] for i in keep), tuple(numbers[i] for i in keep)


def _corner_candidates(group: ElementGroup) -> list[list[int]]:
    """Local corner nodes; a three-node line has its middle last (gmsh) or second (Abaqus)."""
    if group.family == "line3":
        return [[0, 2], [0, 1]]
    return [list(range(FAMILIES[group.family].corners))]


def _find_surface_elements(
    table: FaceTable, group: ElementGroup, labels: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Row in the face table of every surface element, -1 where it is on no solid."""
    nodes = np.searchsorted(labels, group.nodes)
    rows = np.full(len(nodes), -1)
    for corners in _corner_candidates(group):
        rows = np.where(rows < 0, table.find(nodes[:, corners]), rows)
    return rows


def _require_on_solids(
    deck: _Deck, blocks: tuple[ElementBlock, ...], labels: NDArray[np.int64]
) -> None:
    """Surface elements carry no stiffness here, so they must be faces of solid elements."""
    table = FaceTable.of(blocks)
    for group in deck.groups:
        if group.solid or not len(group.numbers):
            continue
        lost = _find_surface_elements(table, group, labels) < 0
        if lost.any():
            raise InputError(
                f"{group.place}: *ELEMENT: element {group.numbers[lost][0]}",
                got=f"{lost.sum()} surface elements that are no faces of a solid element",
                expected="surface elements that only mark faces of the solid mesh",
                hint="shells and membranes are not modelled: take them out of the file.",
            )


class _FaceFinder:
    """Turns sets and *SURFACE keywords into surfaces of the mesh."""

    def __init__(
        self,
        blocks: tuple[ElementBlock, ...],
        numbers: tuple[NDArray[np.int64], ...],
        labels: NDArray[np.int64],
        deck: _Deck,
    ) -> None:
        self._deck = deck
        self._labels = labels
        self._table = FaceTable.of(blocks)
        # numbers of the solid elements with their place in the table, and of the surface ones
        self._solid = {
            label: (block, row)
            for block, part in enumerate(numbers)
            for row, label in enumerate(part.tolist())
        }
        self._marker: dict[int, int] = {}
        for group in deck.groups:
            if not group.solid and len(group.numbers):
                rows = _find_surface_elements(self._table, group, labels)
                self._marker.update(zip(group.numbers.tolist(), rows.tolist(), strict=True))

    def surfaces_and_sets(self) -> tuple[dict[str, Surface], dict[str, NDArray[np.int64]]]:
        """All named surfaces and node sets, nodes counted from 0."""
        sets = {
            name: np.searchsorted(self._labels, self._deck.nsets.numbers(name))
            for name in self._deck.nsets
        }
        rows: dict[str, list[int]] = {}
        for name in self._deck.elsets:
            members = self._deck.elsets.numbers(name).tolist()
            marked = [self._marker[i] for i in members if self._marker.get(i, -1) >= 0]
            inner = [row for row in marked if self._table.shared[row]]
            if inner:  # between two solids: no side to choose
                sets.setdefault(name, self._table.surface(name, np.array(inner)).nodes)
            if len(inner) < len(marked):
                rows[name] = [row for row in marked if not self._table.shared[row]]
        rows |= self._explicit(sets)
        surfaces = {
            name: self._table.surface(name, np.unique(np.array(part, dtype=np.int64)))
            for name, part in rows.items()
            if part
        }
        return surfaces, sets

    def _explicit(self, sets: dict[str, NDArray[np.int64]]) -> dict[str, list[int]]:
        rows: dict[str, list[int]] = {}
        for keyword in self._deck.surfaces:
            name = keyword.parameter("NAME")
            kind = keyword.parameters.get("TYPE", "ELEMENT").upper()
            if kind == "NODE":
                sets[name] = self._node_surface(keyword)
                rows.setdefault(name, []).extend(self._faces_within(sets[name]))
            elif kind == "ELEMENT":
                for line in keyword.data:
                    rows.setdefault(name, []).extend(self._element_faces(line))
            else:
                raise InputError(
                    f"{keyword.place}: *SURFACE",
                    got=f"TYPE={kind}",
                    expected="TYPE=ELEMENT or TYPE=NODE",
                    hint="define the surface by element faces.",
                )
        return rows

    def _node_surface(self, keyword: Keyword) -> NDArray[np.int64]:
        members: list[int] = []
        for line in keyword.data:
            target = line.fields[0]
            if target.isdecimal() and int(target) in self._deck.nodes:
                members.append(int(target))
            else:
                members += self._deck.nsets.resolve(line, target).tolist()
        return np.searchsorted(self._labels, np.unique(members))

    def _faces_within(self, nodes: NDArray[np.int64]) -> list[int]:
        """Outer faces all of whose corners are among the nodes."""
        keys = self._table.keys
        inside = (np.isin(keys, nodes) | (keys < 0)).all(axis=1) & ~self._table.shared
        return np.flatnonzero(inside).tolist()

    def _element_faces(self, line: DataLine) -> list[int]:
        target = line.fields[0]
        label = line.fields[1].upper() if len(line.fields) > 1 else ""
        if target.isdecimal():
            if int(target) not in self._deck.elements:
                self._deck.elsets.resolve(line, target)
            members = [int(target)]
        else:
            members = self._deck.elsets.resolve(line, target).tolist()
        marked = [self._marker[i] for i in members if i in self._marker]
        solid = [self._solid[i] for i in members if i in self._solid]
        rows = [row for row in marked if row >= 0]
        if label in ("", "SPOS", "SNEG"):
            for block, element in solid if not label else []:
                own = self._table.rows_of(block, element)
                rows += own[~self._table.shared[own]].tolist()
            return rows
        return rows + [self._face(line, label, block, element) for block, element in solid]

    def _face(self, line: DataLine, label: str, block: int, element: int) -> int:
        own = self._table.rows_of(block, element)
        side = int(label[1:]) if label[:1] == "S" and label[1:].isdecimal() else 0
        if not 1 <= side <= len(own):
            raise InputError(
                line.place,
                got=f"face '{label}'",
                expected=f"S1 to S{len(own)} ({self._table.blocks[block].family})",
                hint="check the surface in the preprocessor.",
            )
        return int(own[side - 1])


def _present(new: NDArray[np.int64], nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    kept = new[nodes]
    return kept[kept >= 0]


def _renumbered(surface: Surface, new: NDArray[np.int64]) -> Surface:
    blocks = tuple(FaceBlock(b.family, new[b.connectivity]) for b in surface.blocks)
    return Surface(surface.name, blocks)


def _require_right_of_axis(path: Path, mesh: Mesh, labels: NDArray[np.int64]) -> None:
    if mesh.dimension != 2:
        return
    lowest = int(np.argmin(mesh.points[:, 0]))
    if mesh.points[lowest, 0] < 0:
        raise InputError(
            f"{path}: node {labels[lowest]}",
            got=f"r = x = {mesh.points[lowest, 0] * 1e3:.6g} mm",
            expected="r >= 0: the axis of axisymmetric elements is x = 0",
            hint="draw the half of the section that lies at positive x.",
        )
