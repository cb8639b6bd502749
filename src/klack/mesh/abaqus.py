"""Meshes from Abaqus and CalculiX input files (.inp).

Read are nodes, solid and axisymmetric elements, node and element sets, surfaces, and, as extra
information, elastic materials and sections.  Steps, loads and constraints are passed over.  A set
of surface elements (membranes, shells, plane elements: what gmsh and most preprocessors write for
a named surface) becomes a surface, provided that every one of them lies on a solid element.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, require_positive
from klack.mesh.abaqus_deck import Deck, read_deck
from klack.mesh.abaqus_elements import ElementGroup
from klack.mesh.abaqus_keywords import DataLine
from klack.mesh.abaqus_surfaces import FaceFinder, require_on_solids
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.mesh_model import MeshModel
from klack.mesh.quality import require_positive_jacobians

__all__ = ["read_abaqus", "read_abaqus_model"]


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
) -> MeshModel:
    """Read mesh, materials and sections; see :func:`read_abaqus`."""
    require_positive("read_abaqus: unit_length", unit_length, "m")
    path = Path(path)
    deck = read_deck(path)
    return _build(path, deck, unit_length, solids)


def _build(path: Path, deck: Deck, unit_length: float, wanted: Sequence[str] | None) -> MeshModel:
    solid_groups = [group for group in deck.groups if group.solid and len(group.numbers)]
    _require_solids(path, deck, solid_groups)
    labels = np.array(sorted(deck.nodes), dtype=np.int64)
    coordinates = np.array([deck.nodes[i] for i in labels.tolist()])
    name_of, sections = _solid_names(deck, solid_groups)
    blocks, numbers = _blocks(solid_groups, name_of, labels)
    require_on_solids(deck, blocks, labels)
    blocks, numbers = _kept(path, blocks, numbers, wanted)
    resolver = FaceFinder(blocks, numbers, labels, deck)
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
    return MeshModel(
        mesh=mesh,
        node_numbers=labels[used],
        element_numbers=numbers,
        materials=deck.materials,
        sections={name: sections[name] for name in mesh.solids if name in sections},
        unit_length=unit_length,
    )


def _require_solids(path: Path, deck: Deck, groups: list[ElementGroup]) -> None:
    dimensions = {FAMILIES[group.family].dimension for group in groups}
    if len(dimensions) != 1:
        kinds = ", ".join(sorted({group.family for group in deck.groups})) or "none"
        raise InputError(
            str(path),
            got=f"elements with the topology {kinds}",
            expected="solid elements (C3D...), or axisymmetric ones (CAX...), not both",
            hint="save the volume elements too; name a plane mesh of a meridian CAX6, not CPS6.",
        )


def _solid_names(deck: Deck, groups: list[ElementGroup]) -> tuple[dict[int, str], dict[str, str]]:
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
