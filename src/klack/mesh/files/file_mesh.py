"""From the nodes, elements and sets of a file to a mesh.

Readers give numbers of the file and the node order of :mod:`klack.mesh.families`; the rest is the
same for all formats.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from klack.arrays import Flags, Floats, Ints
from klack.errors import AccuracyWarning, InputError, refuse_if, require_positive
from klack.mesh.families import FAMILIES
from klack.mesh.files.mesh_model import FileMaterial, MeshModel
from klack.mesh.files.named_faces import LOOSE, MarkedFaces, loose_faces, named_faces
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.quality import require_positive_jacobians

__all__ = [
    "FileElements",
    "FileMesh",
    "mesh_model",
    "renumbered",
    "require_right_of_axis",
    "require_sound",
    "same_nodes",
]


_CHUNK = 50_000
_FARTHEST = 1e4  # [m] of a node from the origin


def require_near(path: Path, points: Floats, numbers: Ints) -> None:
    """Reject a node so distant that its unit or its columns must be wrong."""
    far = np.abs(points).max(axis=1) > _FARTHEST
    if far.any():
        at = int(np.argmax(far))
        raise InputError(
            f"{path}: node {numbers[at]}",
            got=f"a coordinate of {np.abs(points[at]).max():.3g} m",
            expected=f"coordinates within {_FARTHEST:g} m",
            hint="check the unit, and the columns of this node.",
        )


def require_right_of_axis(path: Path, mesh: Mesh, numbers: Ints) -> None:
    """Reject a node left of the axis."""
    if mesh.dimension != 2:
        return
    lowest = int(np.argmin(mesh.points[:, 0]))
    refuse_if(
        mesh.points[lowest, 0] < 0,
        f"{path}: node {numbers[lowest]}",
        got=f"r = x = {mesh.points[lowest, 0] * 1e3:.6g} mm",
        expected="r >= 0: the axis of an axisymmetric mesh is x = 0",
        hint="draw the half of the section at positive x.",
    )


def require_sound(path: Path, mesh: Mesh, numbers: Sequence[Ints]) -> None:
    """Reject elements on the same corners, and inverted ones; in parts, for the memory.

    Two elements in one place count mass and stiffness twice, and lose their outer faces.
    """
    for corners in sorted({block.topology.corners for block in mesh.blocks}):
        alike = [i for i, block in enumerate(mesh.blocks) if block.topology.corners == corners]
        nodes = np.concatenate([mesh.blocks[i].connectivity[:, :corners] for i in alike])
        if (twice := same_nodes(nodes)) is not None:
            first, second = np.concatenate([numbers[i] for i in alike])[list(twice)]
            raise InputError(
                f"{path}: element {second}",
                got=f"the same corners as element {first}"
                if first != second
                else "the same element for the second time",
                expected="every element once",
                hint="look for duplicate lines, or write the file again.",
            )
    blocks, labels = [], []
    for block, own in zip(mesh.blocks, numbers, strict=True):
        for begin in range(0, len(own), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            blocks.append(ElementBlock(block.family, block.connectivity[part], block.solid))
            labels.append(own[part])
    parts = replace(mesh, blocks=tuple(blocks))
    with np.errstate(all="ignore"):  # damaged numbers: what is not above 0 is refused
        require_positive_jacobians(str(path), parts, numbers=labels)


def same_nodes(nodes: Ints) -> tuple[int, int] | None:
    """Rows of the first two elements on the same nodes, in any order."""
    ordered = np.sort(nodes, axis=1)
    # equal rows have equal sums; others hardly ever, and are told apart below
    weights = np.array([pow(0x9E3779B97F4A7C15, k, 1 << 64) for k in range(1, nodes.shape[1] + 1)])
    sums = (ordered.astype(np.uint64) * weights.astype(np.uint64)).sum(axis=1)
    by_sum = np.argsort(sums, kind="stable")
    again = np.flatnonzero(sums[by_sum[1:]] == sums[by_sum[:-1]])
    if not len(again):
        return None
    rows = np.unique(np.concatenate([by_sum[again], by_sum[again + 1]]))
    rows = rows[np.lexsort(ordered[rows].T)]
    twice = np.flatnonzero((ordered[rows[1:]] == ordered[rows[:-1]]).all(axis=1))
    return (int(rows[twice[0]]), int(rows[twice[0] + 1])) if len(twice) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class FileElements:
    """Elements of one family under one name.

    Parameters
    ----------
    name
        Of the solid, or the marked surface.
    numbers (n,)
    nodes (n, k)
        Of the file; of surface elements corners are enough.
    """

    family: str
    name: str
    numbers: Ints
    nodes: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class FileMesh:
    """Content of a mesh file.

    Parameters
    ----------
    numbers (n,)
        Of the nodes.
    points (n, 3) [unit of the file]
    solids, faces
        Elements with volume (plane ones, if axisymmetric), and those that mark surfaces.
    faces_of_sets
        A node set that holds all nodes of some outer faces is a surface too.
    loose_faces
        Surface elements on no solid are ignored, since they have no stiffness.
    solids_only
        Surface elements on no solid are left out and counted.
    of_netgen
        Tetrahedra that are all mirrored are turned, with a warning.
    left_out
        Elements of other kinds left out by the reader, by type.
    foreign_materials, materials, sections
        As in :class:`~klack.mesh.files.mesh_model.MeshModel`.
    """

    numbers: Ints
    points: Floats
    solids: tuple[FileElements, ...]
    faces: tuple[FileElements, ...] = ()
    node_sets: Mapping[str, Ints] = field(default_factory=dict)
    faces_of_sets: bool = False
    loose_faces: bool = False
    solids_only: bool = False
    of_netgen: bool = False
    left_out: Mapping[str, int] = field(default_factory=dict)
    foreign_materials: Mapping[str, str] = field(default_factory=dict)
    materials: Mapping[str, FileMaterial] = field(default_factory=dict)
    sections: Mapping[str, str] = field(default_factory=dict)


def mesh_model(
    path: Path, raw: FileMesh, unit_length: float, wanted: Sequence[str] | None
) -> MeshModel:
    """Build the mesh of the wanted solids: nodes of its elements, surfaces and sets, checked.

    Rejects missing and repeated nodes, repeated and inverted elements, missing solids, surface
    elements on no solid, and points left of the axis.
    """
    require_positive(f"{path}: unit of length", unit_length, "m")
    solids = tuple(part for part in raw.solids if len(part.numbers))
    dimension = _dimension(path, solids)
    _require_once(path, "element", np.sort(np.concatenate([part.numbers for part in solids])))
    nodes = _NodeNumbers(path, raw.numbers)
    everything = tuple(
        ElementBlock(part.family, nodes.index(part), part.name) for part in _merged(solids)
    )
    marks = tuple(
        MarkedFaces(part.name, part.numbers, nodes.index(part)[:, : FAMILIES[part.family].corners])
        for part in raw.faces
        if len(part.numbers)
    )
    sets = {name: nodes.present(members) for name, members in raw.node_sets.items()}
    left_out = dict(raw.left_out)
    if raw.solids_only and not raw.loose_faces and (loose := loose_faces(everything, marks)):
        left_out[LOOSE] = loose
    kept = _kept(path, everything, wanted)
    blocks = tuple(everything[i] for i in kept)
    numbers = tuple(_merged(solids)[i].numbers for i in kept)
    used = np.zeros(len(raw.numbers), dtype=bool)
    for block in blocks:
        used[block.connectivity] = True
    new = np.cumsum(used) - 1
    new[~used] = -1
    points = raw.points[nodes.order][used, :dimension] * unit_length
    require_near(path, points, nodes.sorted[used])
    blocks = tuple(
        _turned(points, ElementBlock(b.family, new[b.connectivity], b.solid)) for b in blocks
    )
    if raw.of_netgen and _all_mirrored(points, blocks):
        warnings.warn(
            f"{path.name}: netgen has written all tetrahedra mirrored ('Gmsh2 Format'); their "
            "nodes are reordered, and the shape is unchanged.",
            AccuracyWarning,
            stacklevel=4,
        )
        blocks = tuple(
            ElementBlock(b.family, b.connectivity[:, _TETRAHEDRA[b.family]], b.solid)
            for b in blocks
        )
    sets = {name: own for name, members in sets.items() if len(own := renumbered(new, members))}
    surfaces, inner = named_faces(
        str(path),
        blocks,
        tuple(MarkedFaces(m.name, m.numbers, new[m.corners]) for m in marks),
        sets if raw.faces_of_sets else {},
        all_solids=wanted is None and not (raw.loose_faces or raw.solids_only),
    )
    mesh = Mesh(points=points, blocks=blocks, surfaces=surfaces, node_sets={**inner, **sets})
    require_right_of_axis(path, mesh, nodes.sorted[used])
    require_sound(path, mesh, numbers)
    return MeshModel(
        mesh=mesh,
        node_numbers=nodes.sorted[used],
        element_numbers=numbers,
        materials=raw.materials,
        sections={name: raw.sections[name] for name in mesh.solids if name in raw.sections},
        unit_length=unit_length,
        left_out=left_out,
        foreign_materials=raw.foreign_materials,
    )


def _dimension(path: Path, solids: tuple[FileElements, ...]) -> int:
    dimensions = {FAMILIES[part.family].dimension for part in solids}
    refuse_if(
        len(dimensions) != 1,
        str(path),
        got="no solid elements" if not dimensions else "solid and plane elements",
        expected="solid elements (tetrahedra, hexahedra, wedges)",
        hint="save the volume elements too; the file may be truncated.",
    )
    return dimensions.pop()


def _merged(parts: tuple[FileElements, ...]) -> tuple[FileElements, ...]:
    """One part for each solid and family."""
    groups: dict[tuple[str, str], list[FileElements]] = {}
    for name in dict.fromkeys(part.name for part in parts):
        for part in parts:
            if part.name == name:
                groups.setdefault((name, part.family), []).append(part)
    return tuple(
        group[0]
        if len(group) == 1
        else FileElements(
            family=family,
            name=name,
            numbers=np.concatenate([part.numbers for part in group]),
            nodes=np.concatenate([part.nodes for part in group]),
        )
        for (name, family), group in groups.items()
    )


def _require_once(path: Path, kind: str, ascending: Ints) -> None:
    """Reject a number that comes twice."""
    twice = np.flatnonzero(ascending[1:] == ascending[:-1])
    if len(twice):
        raise InputError(
            str(path),
            got=f"{kind} {ascending[twice[0]]} for the second time",
            expected=f"every {kind} once",
            hint="look for duplicate lines, or write the file again.",
        )


class _NodeNumbers:
    """Node numbers of the file in ascending order."""

    def __init__(self, path: Path, numbers: Ints) -> None:
        self._path = path
        self.order = np.argsort(numbers, kind="stable")
        self.sorted = numbers[self.order]
        _require_once(path, "node", self.sorted)

    def index(self, part: FileElements) -> Ints:
        """Nodes of elements, counted from 0."""
        rows, found = self._find(part.nodes)
        if not found.all():
            row, column = np.argwhere(~found)[0]
            raise InputError(
                f"{self._path}: element {part.numbers[row]}",
                got=f"node {part.nodes[row, column]}, which the file does not define",
                expected="nodes of this file",
                hint="the file may be truncated: write it again from the preprocessor.",
            )
        return rows

    def present(self, numbers: Ints) -> Ints:
        """Defined nodes among some, from 0."""
        rows, found = self._find(np.asarray(numbers, dtype=np.int64))
        return np.unique(rows[found])

    def _find(self, numbers: Ints) -> tuple[Ints, Flags]:
        if not len(self.sorted):
            return np.zeros(numbers.shape, dtype=np.int64), np.zeros(numbers.shape, dtype=bool)
        first = int(self.sorted[0])
        if int(self.sorted[-1]) - first == len(self.sorted) - 1:  # without holes
            rows = numbers - first
            found = (rows >= 0) & (rows < len(self.sorted))
            return np.where(found, rows, 0), found
        rows = np.minimum(np.searchsorted(self.sorted, numbers), len(self.sorted) - 1)
        return rows, self.sorted[rows] == numbers


def _kept(path: Path, blocks: tuple[ElementBlock, ...], wanted: Sequence[str] | None) -> list[int]:
    known = dict.fromkeys(block.solid for block in blocks)
    for name in () if wanted is None else wanted:
        if name not in known:
            raise InputError(
                f"{path}: solid '{name}'",
                got="a name that is not in the file",
                expected=f"one of: {', '.join(known)}",
                hint="'klack inspect FILE' lists the solids of a mesh file.",
            )
    return [i for i, block in enumerate(blocks) if wanted is None or block.solid in wanted]


def renumbered(new: Ints, nodes: Ints) -> Ints:
    """New numbers of those nodes that have one."""
    kept = new[nodes]
    return kept[kept >= 0]


_MIRRORED = {
    "tri3": (0, 2, 1),
    "tri6": (0, 2, 1, 5, 4, 3),
    "quad4": (0, 3, 2, 1),
    "quad8": (0, 3, 2, 1, 7, 6, 5, 4),
    "wedge6": (0, 2, 1, 3, 5, 4),
    "wedge15": (0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13),
}


_TETRAHEDRA = {"tet4": (0, 2, 1, 3), "tet10": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)}


def _all_mirrored(points: Floats, blocks: Sequence[ElementBlock]) -> bool:
    """Whether there are tetrahedra alone, all of negative volume."""
    if not all(block.family in _TETRAHEDRA for block in blocks):
        return False
    for block in blocks:
        a, b, c, d = np.moveaxis(points[block.connectivity[:, :4]], 1, 0)
        if ((np.cross(b - a, c - a) * (d - a)).sum(axis=1) >= 0).any():
            return False
    return True


def _turned(points: Floats, block: ElementBlock) -> ElementBlock:
    """Turn elements whose sense differs between programs: plane ones and wedges.

    A plane mesh has the sense of its drawing; VTK numbers a wedge from its other side.
    """
    if block.family not in _MIRRORED:
        return block
    x = points[block.connectivity[:, : block.topology.corners]]
    if block.topology.dimension == 2:
        a, b = x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]
        if x.shape[1] == 3:
            a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
        sense = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    else:
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        sense = (normal * (x[:, 3:].mean(axis=1) - x[:, :3].mean(axis=1))).sum(axis=1)
    backward = sense < 0
    if not backward.any():
        return block
    nodes = block.connectivity.copy()
    nodes[backward] = nodes[backward][:, _MIRRORED[block.family]]
    return ElementBlock(block.family, nodes, block.solid)
