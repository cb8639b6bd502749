"""Meshes from ANSYS: archives of MAPDL (.cdb), and input files of Workbench (.dat).

Read are SOLID185, SOLID186, SOLID187 and SOLID285 (and the older 45, 95 and 92), degenerate forms,
components, linear elastic materials and /UNITS; loads, constraints and contact settings are
ignored.

mapdl-archive (0.4.2) takes 222 of 300 damaged archives, this reader 17.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Ints
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.files.ansys.blocks import Archive, ElementTable, read_archive
from klack.mesh.files.file_mesh import FileElements, FileMesh, mesh_model
from klack.mesh.files.mesh_model import FileMaterial, MeshModel
from klack.mesh.files.named_faces import ALSO_OTHERS
from klack.mesh.files.plausible import SAY_UNIT
from klack.mesh.files.text_columns import TextLines, within

__all__ = ["read_ansys_archive"]


@dataclass(frozen=True, slots=True)
class Shape:
    """Family, and the nodes of the ANSYS element in its order.

    Corners of a brick are I J K L M N O P, mid nodes Q to X of the two quadrilaterals and Y Z A B
    between them.  A wedge has K = L and O = P, a tetrahedron K = L and M = N = O = P, a pyramid M =
    N = O = P (ANSYS element reference, SOLID185 and SOLID186).
    """

    family: str
    order: tuple[int, ...]


SHAPES = (
    Shape("hex8", tuple(range(8))),
    Shape("hex20", tuple(range(20))),
    Shape("wedge6", (0, 1, 2, 4, 5, 6)),
    Shape("wedge15", (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18)),
    Shape("tet4", (0, 1, 2, 4)),
    Shape("tet10", (0, 1, 2, 4, 8, 9, 11, 16, 17, 18)),
    # SOLID187, SOLID92 and SOLID285 are tetrahedra from the start
    Shape("tet4", tuple(range(4))),
    Shape("tet10", tuple(range(10))),
)

_TETRAHEDRA = (92, 187, 285)


def shapes_of(lines: TextLines, table: ElementTable, kind: Ints) -> Ints:
    """Number in :data:`SHAPES` for every element of a kind (185, ...).

    Rejects pyramids, other repeated nodes, and elements that miss some mid nodes.
    """
    nodes = table.nodes
    K, L, M, N, O, P = nodes[:, 2:8].T  # noqa: E741
    own_tetrahedron = np.isin(kind, _TETRAHEDRA)
    top = (M == N) & (N == O) & (O == P)
    tetrahedron = ~own_tetrahedron & top & (K == L)
    pyramid = ~own_tetrahedron & top & (K != L)
    wedge = ~own_tetrahedron & ~top & (K == L) & (O == P)
    _refuse(lines, table, pyramid, "a pyramid", "split it into tetrahedra, or mesh without it.")
    linear = np.where(own_tetrahedron, 6, np.where(tetrahedron, 4, np.where(wedge, 2, 0)))
    shapes = linear.copy()
    for code in range(0, len(SHAPES), 2):
        here = linear == code
        corners = FAMILIES[SHAPES[code].family].nodes
        own = nodes[here][:, SHAPES[code + 1].order]
        middle = (own[:, corners:] > 0).sum(axis=1)
        every = own.shape[1] - corners
        partly = np.zeros(len(nodes), dtype=bool)
        partly[here] = (middle > 0) & (middle < every)
        _refuse(
            lines,
            table,
            partly,
            "an element without some of its mid nodes",
            "add them with EMID, ADD, or remove all of them with EMID, REMOVE.",
        )
        shapes[here] += middle == every
        strange = np.zeros(len(nodes), dtype=bool)
        ordered = np.sort(own[:, :corners], axis=1)
        strange[here] = (ordered[:, :1] <= 0)[:, 0] | (ordered[:, 1:] == ordered[:, :-1]).any(
            axis=1
        )
        _refuse(
            lines,
            table,
            strange,
            "corner nodes with an unknown repetition, or missing ones",
            "mesh with tetrahedra, hexahedra and wedges.",
        )
    return shapes


def _refuse(
    lines: TextLines, table: ElementTable, bad: NDArray[np.bool_], got: str, hint: str
) -> None:
    if bad.any():
        at = int(np.argmax(bad))
        raise InputError(
            f"{lines.place(int(table.row[at]))}: element {table.number[at]}",
            got=got,
            expected="a tetrahedron, hexahedron or wedge",
            hint=hint,
        )


def faces_of(
    nodes: Ints, kind: Ints, option: Ints
) -> Iterator[tuple[str, NDArray[np.bool_], Ints]]:
    """Triangles and quadrilaterals among surface elements: family, which, corner nodes.

    Parameters
    ----------
    nodes (n, 20)
    kind (n,)
    option (n,)
        KEYOPT(1), the shape of MESH200.
    """
    facet = kind == 200
    count = (nodes > 0).sum(axis=1)
    triangle = np.where(facet, np.isin(option, (4, 5)), (nodes[:, 2] == nodes[:, 3]) | (count == 3))
    quadrilateral = np.where(facet, np.isin(option, (6, 7)), ~triangle & (count >= 4))
    repeated = nodes[:, 2] == nodes[:, 3]
    triangle, quadrilateral = triangle | (quadrilateral & repeated), quadrilateral & ~repeated
    for family, here, corners in (("tri3", triangle, 3), ("quad4", quadrilateral, 4)):
        if here.any():
            yield family, here, nodes[here][:, :corners]


_UNITS = {
    **{"SI": 1.0, "MKS": 1.0, "CGS": 0.01, "MPA": 1e-3},
    **{"UMKS": 1e-6, "BFT": 0.3048, "BIN": 0.0254},
}
_SOLID_TYPES = {45, 92, 95, 185, 186, 187, 285}
_MARKERS = {154, 173, 174, 200}  # surface effect, contact, mesh facets: they have no stiffness
_PASSED_OVER = {153, 169, 170, 175, 176, 177}
_MAY_BE_LEFT_OUT = {
    **dict.fromkeys((3, 4, 23, 24, 44, 54, 188, 189), "BEAM"),
    **dict.fromkeys((16, 18, 20, 59, 288, 289), "PIPE"),
    **dict.fromkeys((1, 8, 10, 11, 160, 167, 180), "LINK"),
    **dict.fromkeys((7, 14, 37, 38, 39, 40, 165, 214), "COMBIN"),
    **dict.fromkeys((21, 71, 166), "MASS"),
    **dict.fromkeys((28, 41, 43, 63, 91, 93, 99, 143, 150, 163, 181, 208, 209, 281), "SHELL"),
    **{27: "MATRIX", 184: "MPC", 290: "ELBOW", 178: "CONTA", 12: "CONTAC", 52: "CONTAC"},
    **{171: "CONTA", 172: "CONTA", 179: "PRETS", 201: "FOLLW", 42: "PLANE", 82: "PLANE"},
    **{151: "SURF", 152: "SURF", 156: "SURF", 182: "PLANE", 183: "PLANE"},
}
"""Elements without a volume that have stiffness or mass."""


def read_ansys_archive(
    path: str | Path,
    unit_length: float | None,
    *,
    solids: Sequence[str] | None = None,
    solids_only: bool = False,
) -> MeshModel:
    """Read mesh, components and materials of an ANSYS archive.

    Parameters are those of :func:`klack.mesh.files.mesh_file.read_mesh_file`.  Pyramids and files
    without any unit are rejected.

    Returns
    -------
    MeshModel
        A component of solid elements is a solid; elements in none are called ``material_1`` after
        their material.  Where components overlap, the larger one counts, unless smaller ones fill
        it; the other one is a node set.  A component of nodes is a node set, and if it holds all
        nodes of some outer faces a surface as well; so is one of surface elements (SURF154,
        CONTA174, MESH200).
    """
    path = Path(path)
    archive = read_archive(path)
    unit = _unit(path, archive) if unit_length is None else unit_length
    kinds, options = _element_types(archive)
    left_out = _left_out(archive, kinds) if solids_only else {}
    _require_known(archive, kinds, solids_only=solids_only)
    element_kind = _look_up(kinds, archive.elements.kind)
    solid = np.isin(element_kind, list(_SOLID_TYPES))
    table = _subset(archive.elements, solid)
    names = _ComponentNames(archive, table)
    materials, foreign = _materials(archive)
    raw = FileMesh(
        numbers=archive.node_numbers,
        points=archive.points,
        solids=tuple(_solids(archive, table, element_kind[solid], names.solid)),
        faces=tuple(
            _faces(
                archive,
                _subset(archive.elements, np.isin(element_kind, list(_MARKERS))),
                kinds,
                options,
            )
        ),
        node_sets=names.node_sets,
        faces_of_sets=True,
        loose_faces=True,
        left_out=left_out,
        materials=materials,
        foreign_materials=foreign,
        sections=_sections(table, names.solid, materials),
    )
    return mesh_model(path, raw, unit, solids)


def _unit(path: Path, archive: Archive) -> float:
    for row, fields in archive.commands:
        if fields[0].startswith("/UNI"):
            label = fields[1].upper() if len(fields) > 1 else ""
            if label not in _UNITS:
                raise InputError(
                    f"{archive.lines.place(row)}: /UNITS",
                    got=f"'{label}'",
                    expected=f"one of: {', '.join(_UNITS)}",
                    hint=SAY_UNIT,
                )
            return _UNITS[label]
    raise InputError(
        str(path),
        got="no unit of length, and no /UNITS in the file",
        expected="the unit of its coordinates",
        hint=SAY_UNIT,
    )


def _whole(archive: Archive, row: int, text: str) -> int:
    if not text.lstrip("-").isdecimal() or len(text) > 18:
        raise _no_number(archive, row, text, "a whole number")
    return int(text)


_FORMULA = re.compile(r"[A-Za-z_(][\w%()*/+-]*|\d+[*/+-][\w%()*/+-]+")


def _no_number(archive: Archive, row: int, text: str, expected: str) -> InputError:
    """A formula or an unset parameter is no damage."""
    if _FORMULA.fullmatch(text):
        return InputError(
            archive.lines.place(row),
            got=f"'{text}', a formula, or a parameter that the file does not set to a number",
            expected=expected,
            hint="*SET it to a number above, or write the mesh with CDWRITE, DB from ANSYS.",
        )
    hint = "the file may be damaged: write it again with CDWRITE, DB."
    return InputError(archive.lines.place(row), got=repr(text), expected=expected, hint=hint)


def _element_types(archive: Archive) -> tuple[dict[int, int], dict[int, int]]:
    """Element (185, ...) and first KEYOPT by type number, from ET, ETBLOCK and KEYOPT."""
    kinds: dict[int, int] = {}
    first_option: dict[int, int] = {}
    for row, fields in archive.commands:
        if fields[0] == "ET" and len(fields) > 2:
            name = re.sub(r"^[A-Za-z]+(?=\d)", "", fields[2])
            kinds[_whole(archive, row, fields[1])] = _whole(archive, row, name)
            if len(fields) > 3 and fields[3].isdecimal():
                first_option[int(fields[1])] = int(fields[3])
        if fields[0].startswith("KEYO") and len(fields) > 3 and fields[2] == "1":
            first_option[_whole(archive, row, fields[1])] = _whole(archive, row, fields[3])
        if fields[0] == "ETBLOCK":
            for line in range(row + 2, len(archive.lines)):
                words = archive.lines.line(line).split()
                if len(words) < 2 or not words[0].isdecimal():
                    break
                label = _whole(archive, line, words[0])
                kinds[label] = _whole(archive, line, words[1])
                if len(words) > 2 and words[2].isdecimal():
                    first_option[label] = _whole(archive, line, words[2])
    return kinds, first_option


def _look_up(table: Mapping[int, int], labels: Ints) -> Ints:
    unique, inverse = np.unique(labels, return_inverse=True)
    return np.array([table.get(label, 0) for label in unique.tolist()], dtype=np.int64)[inverse]


def _left_out(archive: Archive, kinds: Mapping[int, int]) -> dict[str, int]:
    """Count elements that have stiffness or mass but no volume."""
    counts: dict[str, int] = {}
    for label in np.unique(archive.elements.kind).tolist():
        kind = kinds.get(label, 0)
        if kind in _MAY_BE_LEFT_OUT:
            name = f"{_MAY_BE_LEFT_OUT[kind]}{kind}"
            count = int(np.sum(archive.elements.kind == label))
            counts[name] = counts.get(name, 0) + count
    return counts


def _require_known(archive: Archive, kinds: Mapping[int, int], *, solids_only: bool) -> None:
    for label in np.unique(archive.elements.kind).tolist():
        kind = kinds.get(label, 0)
        if kind in _SOLID_TYPES | _MARKERS | _PASSED_OVER:
            continue
        if solids_only and kind in _MAY_BE_LEFT_OUT:
            continue
        at = int(np.argmax(archive.elements.kind == label))
        name = f"{_MAY_BE_LEFT_OUT.get(kind, 'element type ')}{kind}"
        raise InputError(
            f"{archive.lines.place(int(archive.elements.row[at]))}: "
            f"element {archive.elements.number[at]}",
            got=name if kind else f"type {label} without an ET command",
            expected="SOLID185, SOLID186, SOLID187 or SOLID285",
            hint="select the solid elements of the body (ESEL) and their nodes before CDWRITE"
            + (f"; or {ALSO_OTHERS}" if kind in _MAY_BE_LEFT_OUT else "."),
        )


def _subset(table: ElementTable, keep: NDArray[np.bool_]) -> ElementTable:
    return ElementTable(
        table.material[keep],
        table.kind[keep],
        table.number[keep],
        table.nodes[keep],
        table.row[keep],
    )


class _ComponentNames:
    """Solid of every element, and node sets, from the components."""

    def __init__(self, archive: Archive, table: ElementTable) -> None:
        ordered = np.sort(archive.node_numbers)
        self.node_sets = {
            name: within(ordered, ranges)
            for name, kind, ranges in archive.components
            if kind == "NODE"
        }
        order = np.argsort(table.number, kind="stable")
        numbers = table.number[order]
        members = {
            name: np.searchsorted(numbers, found)
            for name, kind, ranges in archive.components
            if kind == "ELEM" and len(found := within(numbers, ranges))
        }
        codes = np.zeros(len(numbers), dtype=np.int64)
        names = [""]
        by_size = sorted(members, key=lambda name: -len(members[name]))
        for i, name in enumerate(by_size):
            own = members[name]
            smaller = np.zeros(len(numbers), dtype=bool)
            for other in by_size[i + 1 :]:
                smaller[members[other]] |= len(members[other]) < len(own)
            if codes[own].any() or smaller[own].all():
                nodes = table.nodes[order[own]]
                self.node_sets.setdefault(name, np.unique(nodes[nodes > 0]))
            else:
                names.append(name)
                codes[own] = len(names) - 1
        self.solid = np.empty(len(numbers), dtype=object)
        self.solid[order] = np.array(names, dtype=object)[codes]
        free = self.solid == ""
        for material in np.unique(table.material[free]).tolist():
            self.solid[free & (table.material == material)] = f"material_{material}"


def _solids(
    archive: Archive, table: ElementTable, kind: Ints, solid: NDArray[np.object_]
) -> Iterator[FileElements]:
    shapes = shapes_of(archive.lines, table, kind)
    for name in dict.fromkeys(solid.tolist()):
        own = solid == name
        for code in np.unique(shapes[own]).tolist():
            here = own & (shapes == code)
            yield FileElements(
                family=SHAPES[code].family,
                name=name,
                numbers=table.number[here],
                nodes=table.nodes[here][:, SHAPES[code].order],
            )


def _faces(
    archive: Archive, table: ElementTable, kinds: Mapping[int, int], options: Mapping[int, int]
) -> Iterator[FileElements]:
    """Surface elements, once per component."""
    if not len(table.number):
        return
    kind, option = _look_up(kinds, table.kind), _look_up(options, table.kind)
    order = np.argsort(table.number, kind="stable")
    numbers = table.number[order]
    for name, which, ranges in archive.components:
        found = within(numbers, ranges) if which == "ELEM" else numbers[:0]
        own = order[np.searchsorted(numbers, found)]
        for family, here, nodes in faces_of(table.nodes[own], kind[own], option[own]):
            yield FileElements(
                family=family, name=name, numbers=table.number[own][here], nodes=nodes
            )


def _sections(
    table: ElementTable, solid: NDArray[np.object_], materials: Mapping[str, FileMaterial]
) -> dict[str, str]:
    sections = {}
    for name in dict.fromkeys(solid.tolist()):
        own = np.unique(table.material[solid == name])
        if len(own) == 1 and f"material_{own[0]}" in materials:
            sections[name] = f"material_{own[0]}"
    return sections


def _materials(archive: Archive) -> tuple[dict[str, FileMaterial], dict[str, str]]:
    """Isotropic materials of MP and MPDATA, and what others are.

    Those that depend on temperature are left out.
    """
    found: dict[int, dict[str, float | None]] = {}
    for row, fields in archive.commands:
        if fields[0] == "MPDATA" and len(fields) > 6 and fields[1].upper().startswith("R"):
            what, label, values = fields[3].upper(), fields[4], fields[6:]
        elif fields[0] == "MPDATA" and len(fields) > 4:
            what, label, values = fields[1].upper(), fields[2], fields[4:]
        elif fields[0] == "MP" and len(fields) > 3:
            what, label, values = fields[1].upper(), fields[2], fields[3:]
        else:
            continue
        numbers = [_real(archive, row, text) for text in values if text]
        own = found.setdefault(_whole(archive, row, label), {})
        values_so_far = {*numbers, own.get(what, numbers[0])} if numbers else {None}
        own[what] = values_so_far.pop() if len(values_so_far) == 1 else None
    materials = {}
    foreign = {
        f"material_{_whole(archive, row, fields[2])}": "anisotropic (TB, ANEL)"
        for row, fields in archive.commands
        if fields[0] == "TB" and len(fields) > 2 and fields[1].upper() == "ANEL"
    }
    for number, own in found.items():
        if any(own.get(f"E{axis}", own.get("EX")) != own.get("EX") for axis in "YZ"):
            foreign.setdefault(f"material_{number}", "orthotropic (MP, EX, EY, EZ differ)")
        if f"material_{number}" in foreign:
            continue
        young, poisson = own.get("EX"), own.get("PRXY", own.get("NUXY"))
        if young is not None and poisson is not None:
            name = f"material_{number}"
            materials[name] = FileMaterial(
                name=name, young=young, poisson=poisson, density=own.get("DENS")
            )
    return materials, foreign


def _real(archive: Archive, row: int, text: str) -> float:
    try:
        return float(text.replace("D", "E"))
    except ValueError:
        raise _no_number(archive, row, text, "a number") from None
