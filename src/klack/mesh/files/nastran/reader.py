"""Meshes from Nastran bulk data (.bdf, .dat, .nas).

Read are GRID in any coordinate system, the solids CTETRA, CHEXA and CPENTA (linear and quadratic),
PSOLID, MAT1, the surface elements CTRIA3, CTRIA6, CQUAD4 and CQUAD8 (a surface per property), and
sets of nodes; loads, constraints and solution control are ignored.

meshio (5.3.5) takes points in a local coordinate system for global ones without a word, and reads
no sets and names.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Ints
from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.files.file_mesh import FileElements, FileMesh, mesh_model
from klack.mesh.files.mesh_model import FileMaterial, MeshModel
from klack.mesh.files.named_faces import ALSO_OTHERS
from klack.mesh.files.nastran.cards import BulkData, read_bulk
from klack.mesh.files.nastran.sets import Frames, names_in_comments, node_sets
from klack.mesh.files.plausible import require_unit
from klack.mesh.files.text_columns import integers, reals

__all__ = ["read_nastran"]


# Linear and quadratic family, and the quadratic order: nodes of the card for those of klack.
_SOLIDS = {
    "CTETRA": ("tet4", "tet10", tuple(range(10))),
    "CHEXA": ("hex8", "hex20", (*range(12), *range(16, 20), *range(12, 16))),
    "CPENTA": ("wedge6", "wedge15", (*range(9), *range(12, 15), *range(9, 12))),
}
_SHELLS = {
    **{"CTRIA3": "tri3", "CTRIAR": "tri3", "CTRIA6": "tri3"},
    **{"CQUAD4": "quad4", "CQUADR": "quad4", "CQUAD8": "quad4", "CQUAD": "quad4"},
}
_REFUSED = {
    **{"CPYRAM": "a pyramid", "CPYRA": "a pyramid"},
    **{name: "an axisymmetric element" for name in ("CTRIAX", "CTRIAX6", "CQUADX", "CQUADX4")},
    **{name: "an element of fluid or infinite extent" for name in ("CHACAB", "CHACBR", "CAABSF")},
}
_MAY_BE_LEFT_OUT = {
    **{name: "a beam or rod" for name in ("CBAR", "CBEAM", "CBEND", "CROD", "CONROD", "CTUBE")},
    **{f"CELAS{i}": "a spring" for i in (1, 2, 3, 4)},
    **{f"CDAMP{i}": "a damper" for i in (1, 2, 3, 4)},
    **{"CBUSH": "a bushing", "CBUSH1D": "a bushing", "CGAP": "a gap element"},
    **{f"CONM{i}": "a point mass" for i in (1, 2)},
    **{f"CMASS{i}": "a point mass" for i in (1, 2, 3, 4)},
    **{name: "a rigid or coupling element" for name in ("RBE1", "RBE2", "RBE3", "RBAR", "RROD")},
    **{"CSHEAR": "a shear panel", "CVISC": "a damper", "GENEL": "a general element"},
    **{name: "a joint between parts" for name in ("CFAST", "CWELD", "CSEAM", "CBUSH2D")},
}
"""Elements without a volume of their own."""
_ANISOTROPIC = {
    **{"MAT2": "anisotropic shell", "MAT3": "orthotropic", "MAT8": "orthotropic shell"},
    **{"MAT9": "anisotropic", "MAT11": "orthotropic", "MAT12": "orthotropic"},
}
_PYRAMID = "mesh with tetrahedra, hexahedra and wedges, or split every pyramid into tetrahedra."


def read_nastran(
    path: str | Path,
    unit_length: float | None,
    *,
    solids: Sequence[str] | None = None,
    solids_only: bool = False,
) -> MeshModel:
    """Read mesh, materials and sections of a Nastran file.

    Parameters are those of :func:`klack.mesh.files.mesh_file.read_mesh_file`.

    Returns
    -------
    MeshModel
        Solids are called ``psolid_1`` after their property, or as HyperMesh, ANSA or Femap named
        it in a comment; surfaces ``pshell_2`` after the property of their elements.  A node set
        that holds all nodes of some outer faces is a surface too.
    """
    path = Path(path)
    unit_length = require_unit(path, unit_length)
    bulk = read_bulk(path)
    _refuse_elements(bulk, solids_only=solids_only)
    names = names_in_comments(bulk)
    numbers, points = _nodes(bulk)
    properties = {
        card.integer(1, "property"): card.integer(2, "material") for card in bulk.cards("PSOLID")
    }
    materials = _materials(bulk, names.get("MATERIAL", {}))
    given = names.get("PROPERTY", {})
    raw = FileMesh(
        numbers=numbers,
        points=points,
        solids=_solids(bulk, given),
        faces=tuple(
            part for name, family in _SHELLS.items() for part in _shells(bulk, name, family, given)
        ),
        node_sets=node_sets(bulk, numbers),
        faces_of_sets=True,
        solids_only=solids_only,
        left_out={
            name: len(bulk.numbers_of(name)) for name in bulk.known if name in _MAY_BE_LEFT_OUT
        },
        foreign_materials={
            _named(names.get("MATERIAL", {}), kind.lower(), card.integer(1, "material")): (
                f"{words} ({kind})"
            )
            for kind, words in _ANISOTROPIC.items()
            for card in bulk.cards(kind)
        },
        materials={material.name: material for material in materials.values()},
        sections={
            _named(given, "psolid", label): materials[material].name
            for label, material in properties.items()
            if material in materials
        },
    )
    return mesh_model(path, raw, unit_length, solids)


def _named(given: dict[int, str], kind: str, label: int) -> str:
    return given.get(label, f"{kind}_{label}")


def _refuse_elements(bulk: BulkData, *, solids_only: bool) -> None:
    refused = _REFUSED if solids_only else {**_REFUSED, **_MAY_BE_LEFT_OUT}
    for name in bulk.known:
        if name in refused:
            card = next(bulk.cards(name))
            hint = "remove elements of other kinds from the file."
            if name in _MAY_BE_LEFT_OUT:
                hint = ALSO_OTHERS
            raise InputError(
                f"{card.place}: {name} {card.field(1)}",
                got=refused[name],
                expected="CTETRA, CHEXA, CPENTA, and shells that mark surfaces",
                hint=_PYRAMID if name.startswith("CPYRA") else hint,
            )


def _whole(bulk: BulkData, name: str, rows: Ints, cells: NDArray[np.uint8]) -> Ints:
    values, good = integers(cells)
    if not good.all():
        row, column = np.argwhere(~good)[0]
        _refuse_field(bulk, name, int(rows[row]), cells[row, column], "a whole number")
    return values


def _refuse_field(
    bulk: BulkData, name: str, row: int, cell: NDArray[np.uint8], expected: str
) -> None:
    text = cell.tobytes().decode("latin-1").strip()
    raise InputError(
        f"{bulk.place(row)}: {name}",
        got=repr(text),
        expected=expected,
        hint="the file may be truncated, or its columns shifted: write it again.",
    )


def _nodes(bulk: BulkData) -> tuple[Ints, NDArray[np.float64]]:
    """Numbers and basic coordinates of all nodes."""
    for card in bulk.cards("GRDSET"):
        if card.field(2) not in ("", "0"):
            card.refuse(
                f"coordinate system {card.field(2)} for all nodes",
                "a coordinate system in every GRID",
            )
    numbers, systems, points, lines = [], [], [], []
    for rows, cells in bulk.tables("GRID", 5):
        whole = _whole(bulk, "GRID", rows, cells[:, :2])
        x, good = reals(cells[:, 2:])
        good[:, 0] &= whole[:, 0] > 0
        if not good.all():
            row, column = np.argwhere(~good)[0]
            _refuse_field(bulk, "GRID", int(rows[row]), cells[row, 2 + column], "a real number")
        numbers.append(whole[:, 0])
        systems.append(whole[:, 1])
        points.append(x)
        lines.append(rows)
    if not numbers:
        return np.empty(0, dtype=np.int64), np.empty((0, 3))
    label, system = np.concatenate(numbers), np.concatenate(systems)
    x, line = np.concatenate(points), np.concatenate(lines)
    if not system.any():
        return label, x
    return label, _in_basic(bulk, label, system, x, line)


def _in_basic(
    bulk: BulkData, label: Ints, system: Ints, x: NDArray[np.float64], line: Ints
) -> NDArray[np.float64]:
    def node(number: int, depth: int) -> NDArray[np.float64]:
        found = np.flatnonzero(label == number)
        refuse_if(
            not len(found),
            f"{bulk.lines.file}: CORD1: node {number}",
            got="a node that the file does not define",
            expected="nodes of this file",
            hint="the file may be truncated: write it again from the preprocessor.",
        )
        at = found[0]
        place = bulk.place(int(line[at]))
        return frames.basic(int(system[at]), x[at : at + 1], place, depth)[0]

    frames = Frames(bulk, node)
    basic = x.copy()
    for own in np.unique(system[system != 0]).tolist():
        here = np.flatnonzero(system == own)
        basic[here] = frames.basic(own, x[here], bulk.place(int(line[here[0]])))
    return basic


def _solids(bulk: BulkData, given: dict[int, str]) -> tuple[FileElements, ...]:
    """Solids in the order of their property numbers."""
    parts = [
        part
        for name, (linear, quadratic, order) in _SOLIDS.items()
        for part in _solids_of(bulk, name, linear, quadratic, order, given)
    ]
    return tuple(part for _, part in sorted(parts, key=lambda item: item[0]))


def _solids_of(
    bulk: BulkData,
    name: str,
    linear: str,
    quadratic: str,
    order: tuple[int, ...],
    given: dict[int, str],
) -> list[tuple[int, FileElements]]:
    """Elements of one card with property numbers."""
    corners, most = FAMILIES[linear].nodes, FAMILIES[quadratic].nodes
    parts = []
    for rows, cells in bulk.tables(name, 2 + most):
        table = _whole(bulk, name, rows, cells)
        nodes = table[:, 2:]
        middle = (nodes[:, corners:] != 0).sum(axis=1)
        bad = (nodes[:, :corners] <= 0).any(axis=1) | ((middle > 0) & (middle < most - corners))
        bad |= (nodes < 0).any(axis=1) | (table[:, 0] <= 0)
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise InputError(
                f"{bulk.place(int(rows[first]))}: {name} {table[first, 0]}",
                got=f"{np.count_nonzero(nodes[first] > 0)} nodes",
                expected=f"{corners} corners, and all or none of {most - corners} mid nodes",
                hint="the file may be truncated; otherwise let the mesher put a node on every "
                "edge.",
            )
        for full, family in ((middle == 0, linear), (middle > 0, quadratic)):
            for label in np.unique(table[full, 1]).tolist():
                here = full & (table[:, 1] == label)
                own = nodes[here]
                part = FileElements(
                    family=family,
                    name=_named(given, "psolid", label),
                    numbers=table[here, 0],
                    nodes=own[:, list(order)] if family == quadratic else own[:, :corners],
                )
                parts.append((label, part))
    return parts


def _shells(bulk: BulkData, name: str, family: str, given: dict[int, str]) -> list[FileElements]:
    corners = FAMILIES[family].nodes
    parts = []
    for rows, cells in bulk.tables(name, 2 + corners):
        table = _whole(bulk, name, rows, cells)
        for label in np.unique(table[:, 1]).tolist():
            here = table[:, 1] == label
            parts.append(
                FileElements(
                    family=family,
                    name=_named(given, "pshell", label),
                    numbers=table[here, 0],
                    nodes=table[here, 2:],
                )
            )
    return parts


def _materials(bulk: BulkData, given: dict[int, str]) -> dict[int, FileMaterial]:
    """Isotropic materials, by two of E, G and nu."""
    materials = {}
    for card in bulk.cards("MAT1"):
        label = card.integer(1, "number of the material")
        E, G, nu = (card.real(i, "number") if card.field(i) else None for i in (2, 3, 4))
        if E is None and G is not None and nu is not None:
            E = 2 * G * (1 + nu)
        if nu is None and E is not None and G:
            nu = E / (2 * G) - 1
        if E is None or nu is None:
            card.refuse("less than two of E, G and nu", "an isotropic elastic material")
            continue
        density = card.real(5, "density") if card.field(5) else None
        name = _named(given, "mat1", label)
        materials[label] = FileMaterial(name=name, young=E, poisson=nu, density=density)
    return materials
