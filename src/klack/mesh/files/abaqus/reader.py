"""Meshes from Abaqus and CalculiX input files (.inp).

Read are nodes, solid and axisymmetric elements, sets, surfaces, instances of parts, elastic
materials and sections; steps, loads and constraints are ignored.  A set of surface elements
(membranes, shells, plane elements: what gmsh and most preprocessors write for a named surface)
becomes a surface if each lies on a solid element.

meshio (5.3.5) reads one of two instances of a part and no surfaces, and rejects axisymmetric
elements and numbers such as ``1.D0``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, require_positive
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.deck import Deck, read_deck
from klack.mesh.files.abaqus.elements import ElementGroup
from klack.mesh.files.abaqus.faces import FaceFinder, RowBlock, left_out
from klack.mesh.files.abaqus.scope import Scope
from klack.mesh.files.abaqus.sets import distinct
from klack.mesh.files.file_mesh import renumbered, require_right_of_axis, require_sound
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.files.plausible import require_unit
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface

__all__ = ["read_abaqus"]


def read_abaqus(
    path: str | Path,
    unit_length: float | None,
    *,
    solids: Sequence[str] | None = None,
    solids_only: bool = False,
) -> MeshModel:
    """Read mesh, materials and sections of an Abaqus or CalculiX file.

    Parameters are those of :func:`klack.mesh.files.mesh_file.read_mesh_file`.

    Returns
    -------
    MeshModel
        Of dimension 3 (C3D elements), or 2 (CAX elements: x is r, y is z). The solids are called
        after the element sets of *SOLID SECTION; without sections after the sets of *ELEMENT, or
        after the *ELSET that is made of whole such sets (a physical group of gmsh). Of several
        instances, sets and surfaces are called ``instance.set``, and ``set`` too if that is
        unique; solids have the shorter name. Node and element numbers are those of the file; where
        instances repeat them, they count through the file from 1.

    Warns
    -----
    AccuracyWarning
        Once, of ignored constraints between nodes (*TIE, *EQUATION, ...) and *TRANSFORM.
    """
    path = Path(path)
    unit_length = require_unit(path, unit_length)
    require_positive("read_abaqus: unit_length", unit_length, "m")
    return _build(path, read_deck(path, solids_only=solids_only), unit_length, solids)


def _build(path: Path, deck: Deck, unit_length: float, wanted: Sequence[str] | None) -> MeshModel:
    scope = deck.scope
    _require_solids(path, scope)
    labels = np.concatenate(scope.labels)
    dimension = next(FAMILIES[group.family].dimension for group in scope.groups if group.solid)
    names, sections = _solid_names(scope)
    blocks = _blocks(scope, names)
    others = left_out(scope, blocks)
    blocks = _kept(path, scope, blocks, wanted)
    surfaces, node_sets = FaceFinder(blocks, scope).surfaces_and_sets()
    used = _used_nodes(scope, blocks, labels)
    new = np.full(len(labels), -1)
    new[used] = np.arange(len(used))
    mesh = Mesh(
        points=_points(scope)[used, :dimension] * unit_length,
        blocks=tuple(
            ElementBlock(
                block.elements.family, new[block.elements.connectivity], block.elements.solid
            )
            for block in blocks
        ),
        surfaces={name: _renumbered(surface, new) for name, surface in surfaces.items()},
        node_sets={
            name: kept for name, nodes in node_sets.items() if len(kept := renumbered(new, nodes))
        },
    )
    require_right_of_axis(path, mesh, labels[used])
    numbers = np.concatenate([group.numbers for group in scope.groups])
    require_sound(path, mesh, [numbers[block.rows] for block in blocks])
    rows, sizes = np.concatenate([b.rows for b in blocks]), [len(b.rows) for b in blocks]
    return MeshModel(
        mesh=mesh,
        node_numbers=_unique(labels, used),
        element_numbers=tuple(np.split(_unique(numbers, rows), np.cumsum(sizes)[:-1])),
        materials=deck.materials,
        sections={name: sections[name] for name in mesh.solids if name in sections},
        unit_length=unit_length,
        left_out=others,
        foreign_materials=deck.foreign,
    )


def _require_solids(path: Path, scope: Scope) -> None:
    dimensions = {FAMILIES[group.family].dimension for group in scope.groups if group.solid}
    if len(dimensions) != 1:
        kinds = ", ".join(sorted({group.family or group.kind for group in scope.groups})) or "none"
        raise InputError(
            str(path),
            got=f"elements with the topology {kinds}",
            expected="solid elements (C3D...), or axisymmetric ones (CAX...), not both",
            hint="save the volume elements too; name a plane mesh of a meridian CAX6, not CPS6.",
        )


@dataclass(frozen=True, slots=True)
class _SolidNames:
    """Solid of every element: place in a list, -1 for surface elements."""

    shown: list[str]
    of_element: NDArray[np.int32]


def _solid_names(scope: Scope) -> tuple[_SolidNames, dict[str, str]]:
    """Names of the solids, and material name by solid."""
    shown: dict[str, int] = {}
    of_element = np.full(scope.elements.count, -1, dtype=np.int32)
    sets = scope.elements.sets
    for group in scope.groups:
        if group.solid:
            name = _label(scope, group)
            of_element[group.first : group.first + len(group.numbers)] = shown.setdefault(
                name, len(shown)
            )
    label, solid = of_element.copy(), of_element >= 0
    free = np.bincount(label[solid], minlength=len(shown))  # elements of a label without a name
    for key in dict.fromkeys(scope.listed):
        listed = sets.members(key)
        if not len(listed) or not solid[listed].all():
            continue
        count = np.bincount(label[listed], minlength=len(free))
        inside = count > 0
        if (count[inside] == free[inside]).all():  # made of whole labels
            of_element[listed] = shown.setdefault(sets.names.shortest(key), len(shown))
            free[inside] = -1
    sections: dict[str, str] = {}
    for section in scope.sections:
        name = sets.names.shortest(section.elset)
        rows = sets.members(section.elset)
        of_element[rows[solid[rows]]] = shown.setdefault(name, len(shown))
        if section.material:
            sections[name] = section.material
    return _SolidNames(list(shown), of_element), sections


def _label(scope: Scope, group: ElementGroup) -> str:
    """Name of a solid without another."""
    if group.elset:
        names = scope.elements.sets.names
        return names.shortest(names.require(group.place, group.elset))
    return group.instance if len(scope.instances) > 1 else "solid"


def _blocks(scope: Scope, names: _SolidNames) -> tuple[RowBlock, ...]:
    """One block per solid and family, nodes as rows."""
    found: dict[tuple[int, str], list[tuple[NDArray[np.int64], NDArray[np.int64]]]] = {}
    for group in scope.groups:
        if not group.solid:
            continue
        own = names.of_element[group.first : group.first + len(group.numbers)]
        if (own == own[0]).all():
            found.setdefault((int(own[0]), group.family), []).append((group.rows, group.nodes))
            continue
        order = np.argsort(own, kind="stable")
        cuts = np.flatnonzero(np.diff(own[order])) + 1
        for part in sorted(np.split(order, cuts), key=lambda part: int(part[0])):
            key = int(own[part[0]]), group.family
            found.setdefault(key, []).append((group.first + part, group.nodes[part]))
    solids = list(dict.fromkeys(name for name, _ in found))
    families = list(dict.fromkeys(group.family for group in scope.groups if group.solid))
    order_of = {solid: i for i, solid in enumerate(solids)}
    keys = sorted(found, key=lambda key: (order_of[key[0]], families.index(key[1])))
    blocks = []
    for name, family in keys:
        rows, nodes = zip(*found[name, family], strict=True)
        joined = nodes[0] if len(nodes) == 1 else np.concatenate(nodes)
        element_block = ElementBlock(family, joined, names.shown[name])
        blocks.append(RowBlock(element_block, np.concatenate(rows)))
    return tuple(blocks)


def _kept(
    path: Path, scope: Scope, blocks: tuple[RowBlock, ...], wanted: Sequence[str] | None
) -> tuple[RowBlock, ...]:
    if wanted is None:
        return blocks
    known = {block.elements.solid for block in blocks}
    names = scope.elements.sets.names
    chosen = set()
    for name in wanted:
        key = None if name in known else names.find(name)
        solid = name if key is None else names.shortest(key)
        if solid not in known:
            raise InputError(
                f"{path}: solid '{name}'",
                got="a name that is not in the file",
                expected=f"one of: {', '.join(sorted(known))}",
                hint="solids are named after the sets of *SOLID SECTION or *ELEMENT.",
            )
        chosen.add(solid)
    return tuple(block for block in blocks if block.elements.solid in chosen)


def _used_nodes(
    scope: Scope, blocks: Sequence[RowBlock], labels: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Rows of used nodes, by instance and number."""
    mask = np.zeros(len(labels), dtype=bool)
    for block in blocks:
        mask[block.elements.connectivity] = True
    used = np.flatnonzero(mask)
    owner = np.zeros(len(labels), dtype=np.int32)
    for number, instance in enumerate(scope.instances.values(), start=1):
        owner[instance.first_node : instance.first_node + instance.scope.nodes.count] = number
    return used[np.lexsort((labels[used], owner[used]))]


def _unique(numbers: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the file, or counted from 1 where instances share them."""
    own = numbers[rows]
    return own if len(distinct(own)) == len(own) else rows + 1


def _points(scope: Scope) -> NDArray[np.float64]:
    """Coordinates of all nodes, taken out of the scope."""
    points = scope.points[0] if len(scope.points) == 1 else np.concatenate(scope.points)
    scope.points.clear()
    return points


def _renumbered(surface: Surface, new: NDArray[np.int64]) -> Surface:
    blocks = tuple(FaceBlock(b.family, new[b.connectivity]) for b in surface.blocks)
    return Surface(surface.name, blocks)
