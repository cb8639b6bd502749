"""Meshes from Gmsh (.msh 2.2 and 4.1, ASCII and binary).

Physical groups of volumes are solids, of surfaces on them surfaces; all others are node sets. A
plane mesh in z = 0 is axisymmetric: x is r, y is z.

meshio (5.3.5) loses node numbers, takes another node for an undefined one, and rejects quadratic
wedges, and entities without group beside others; nor is it faster (477 000 tetrahedra: 3.5 s
against 2.3 s as text, 0.4 s against 0.1 s binary).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.files.file_mesh import FileElements, FileMesh, mesh_model, same_nodes
from klack.mesh.files.gmsh.sections import GmshContent, GmshElements, read_content
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.files.plausible import require_unit

__all__ = ["read_gmsh"]

# Family and node order: nodes of the Gmsh element for those of klack.
_FAMILIES = {
    1: ("line2", (0, 1)),
    2: ("tri3", (0, 1, 2)),
    3: ("quad4", (0, 1, 2, 3)),
    4: ("tet4", (0, 1, 2, 3)),
    5: ("hex8", tuple(range(8))),
    6: ("wedge6", tuple(range(6))),
    8: ("line3", (0, 1, 2)),
    9: ("tri6", tuple(range(6))),
    11: ("tet10", (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)),
    16: ("quad8", tuple(range(8))),
    17: ("hex20", (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)),
    18: ("wedge15", (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11)),
}
_DIMENSIONS = {15: 0, 1: 1, 8: 1, 2: 2, 3: 2, 9: 2, 10: 2, 16: 2}  # all others: 3
_WORDS = ("point", "curve", "surface", "volume")
_REFUSED = {
    **{7: "pyramids", 14: "pyramids", 19: "pyramids"},
    **{10: "quadrilaterals with 9 nodes", 12: "hexahedra with 27", 13: "wedges with 18"},
}


def read_gmsh(
    path: str | Path,
    unit_length: float | None,
    *,
    solids: Sequence[str] | None = None,
    solids_only: bool = False,
) -> MeshModel:
    """Read the mesh of a Gmsh file.

    Parameters are those of :func:`klack.mesh.files.mesh_file.read_mesh_file`; ``solids_only``
    leaves out shells on no solid. Pyramids, other orders and elements in two groups of volumes are
    rejected.

    Returns
    -------
    MeshModel
        Solids, surfaces and node sets are called as their physical groups, or ``volume_7``,
        ``surface_3``; elements in no group are one solid called as the file.

    Warns
    -----
    AccuracyWarning
        Of the elements of netgen's "Gmsh2 Format", which are all mirrored, and turned here.
    """
    path = Path(path)
    unit_length = require_unit(path, unit_length)
    content = read_content(path)
    dimension = max((_dimension(part) for part in content.elements), default=0)
    bodies = [part for part in content.elements if _dimension(part) == dimension]
    _require_bodies(path, content, bodies, dimension)
    sides = [part for part in content.elements if _dimension(part) == dimension - 1 and part.groups]
    return mesh_model(
        path,
        FileMesh(
            numbers=content.node_numbers,
            points=content.points,
            solids=tuple(_solid(path, content, part) for part in bodies),
            faces=tuple(
                _face(part, _name(content, dimension - 1, group))
                for part in sides
                for group in part.groups
            ),
            node_sets=_node_sets(content, dimension),
            solids_only=solids_only,
            of_netgen=content.of_netgen,
        ),
        unit_length,
        solids,
    )


def _dimension(part: GmshElements) -> int:
    return _DIMENSIONS.get(part.kind, 3)


def _name(content: GmshContent, dimension: int, group: int) -> str:
    return content.names.get((dimension, group), f"{_WORDS[dimension]}_{group}")


def _require_bodies(
    path: Path, content: GmshContent, bodies: list[GmshElements], dimension: int
) -> None:
    flat = dimension == 2 and not content.points[:, 2].any()
    refuse_if(
        dimension != 3 and not flat,
        str(path),
        got=f"only elements of dimension {dimension} or less" if dimension else "no elements",
        expected="volume elements, or a plane mesh in z = 0 (axisymmetric: x = r, y = z)",
        hint="mesh the volume (gmsh -3), and put it into a physical group.",
    )
    for part in bodies:
        if part.kind in _REFUSED:
            raise InputError(
                f"{path}: element {part.numbers[0]}",
                got=_REFUSED[part.kind],
                expected="tetrahedra, hexahedra and wedges (plane: triangles, quadrilaterals)",
                hint="mesh with tetrahedra, or recombine fully."
                if _REFUSED[part.kind] == "pyramids"
                else "mesh with Mesh.SecondOrderIncomplete = 1.",
            )
        if len(part.groups) > 1:
            names = [_name(content, dimension, group) for group in part.groups]
            _refuse_two_groups(path, int(part.numbers[0]), " and ".join(names))
    _require_once(path, bodies)


def _refuse_two_groups(path: Path, element: int, groups: str) -> None:
    raise InputError(
        f"{path}: element {element}",
        got=f"an element that is in two physical groups: {groups}",
        expected="every element of the solid in one group",
        hint="put every volume into one physical group only.",
    )


def _require_once(path: Path, bodies: list[GmshElements]) -> None:
    """A file of version 2 repeats elements for each group."""
    for kind in {part.kind for part in bodies}:
        same = [part for part in bodies if part.kind == kind]
        if len({part.groups for part in same}) < 2:
            continue
        corners = FAMILIES[_FAMILIES[kind][0]].corners
        nodes = np.concatenate([part.nodes[:, :corners] for part in same])
        if (twice := same_nodes(nodes)) is not None:
            numbers = np.concatenate([part.numbers for part in same])
            _refuse_two_groups(path, int(numbers[twice[0]]), "the file contains it twice")


def _solid(path: Path, content: GmshContent, part: GmshElements) -> FileElements:
    family, order = _FAMILIES[part.kind]
    name = _name(content, _dimension(part), part.groups[0]) if part.groups else path.stem
    return FileElements(
        family=family, name=name, numbers=part.numbers, nodes=part.nodes[:, list(order)]
    )


def _face(part: GmshElements, name: str) -> FileElements:
    """Only corners of surface elements count: a quadrilateral may have 9 nodes."""
    family = {8: "line2", 9: "tri3", 10: "quad4", 16: "quad4"}.get(part.kind)
    family = family or _FAMILIES[part.kind][0]
    return FileElements(
        family=family,
        name=name,
        numbers=part.numbers,
        nodes=part.nodes[:, : FAMILIES[family].corners],
    )


def _node_sets(content: GmshContent, dimension: int) -> dict[str, NDArray[np.int64]]:
    """Nodes of groups below the dimension of the body."""
    parts: dict[str, list[NDArray[np.int64]]] = {}
    for part in content.elements:
        if _dimension(part) < dimension:
            for group in part.groups:
                name = _name(content, _dimension(part), group)
                parts.setdefault(name, []).append(part.nodes.ravel())
    return {name: np.unique(np.concatenate(nodes)) for name, nodes in parts.items()}
