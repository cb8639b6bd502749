"""One mixed body in every file format: volume, areas, sets, mid nodes, frequencies.

Truth: exact.  A brick, a wedge on its side and a tetrahedron on top of the wedge, joined face to
face.  The files are written here by the rules of each manual, and by meshio, VTK and mapdl-archive
as independent writers.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.errors import AccuracyWarning, InputError
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.quality import corner_volume

MM = 1e-3
SCALE = np.pi / 3  # numbers that no decimal format holds exactly

CORNERS = SCALE * np.array(
    [
        *([0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]),
        *([0, 0, 4], [2, 0, 4], [2, 3, 4], [0, 3, 4]),
        *([5, 1, 0], [5, 1, 4], [3, 1, 6]),
    ],
    dtype=float,
)
HEX, WEDGE, TET = [0, 1, 2, 3, 4, 5, 6, 7], [1, 8, 2, 5, 9, 6], [5, 9, 6, 10]
# Mid nodes: the edges on which they lie, in the order of the Abaqus manual.
HEX_EDGES = "01 12 23 30 45 56 67 74 04 15 26 37"
WEDGE_EDGES = "01 12 20 34 45 53 03 14 25"
TET_EDGES = "01 12 20 03 13 23"
VOLUME = 45 * SCALE**3
# Faces by corners; which of them belong together under one name
LEFT, SLOPE, TOP = [[0, 3, 7, 4]], [[1, 8, 9, 5]], [[5, 9, 10]]
AREAS = {"left": 12.0, "slope": 4 * np.sqrt(10), "top": 0.5 * np.sqrt(6**2 + 2**2 + 2**2)}


@dataclass
class Body:
    """Points and elements in the order of the Abaqus manual, nodes counted from 0."""

    points: np.ndarray
    hexahedra: np.ndarray
    wedges: np.ndarray
    tetrahedra: np.ndarray
    left: np.ndarray  # quadrilaterals
    slope: np.ndarray
    top: np.ndarray  # triangles

    @property
    def ground(self) -> np.ndarray:
        return np.flatnonzero(self.points[:, 2] == 0)


def body(quadratic: bool) -> Body:
    points = list(CORNERS)
    middles: dict[frozenset[int], int] = {}

    def complete(corners: list[int], edges: str) -> np.ndarray:
        nodes = list(corners)
        for a, b in edges.split() if quadratic else []:
            edge = frozenset((corners[int(a)], corners[int(b)]))
            if edge not in middles:
                middles[edge] = len(points)
                points.append(CORNERS[sorted(edge)].mean(axis=0))
            nodes.append(middles[edge])
        return np.array([nodes])

    elements = (
        complete(HEX, HEX_EDGES),
        complete(WEDGE, WEDGE_EDGES),
        complete(TET, TET_EDGES),
        *(complete(quad[0], "01 12 23 30") for quad in (LEFT, SLOPE)),
        complete(TOP[0], "01 12 20"),
    )
    return Body(np.array(points), *elements)


def nodes_text(nodes) -> list[str]:
    return [str(int(n) + 1) for n in nodes]


# --- ANSYS -------------------------------------------------------------------------------------


def write_cdb(path: Path, b: Body) -> None:
    """All elements as SOLID186 or SOLID185, wedge and tetrahedron as degenerate bricks."""
    h, w, t = b.hexahedra[0], b.wedges[0], b.tetrahedra[0]
    quadratic = len(h) == 20
    I, J, K, M, N, O = w[:6]  # noqa: E741
    wedge = [I, J, K, K, M, N, O, O]
    tet = [t[0], t[1], t[2], t[2], *[t[3]] * 4]
    if quadratic:
        Q, R, T, U, V, X, Y, Z, A = w[6:]
        wedge += [Q, R, K, T, U, V, O, X, Y, Z, A, A]
        q, r, u, y, z, a = t[4:]
        tet += [q, r, t[2], u, *[t[3]] * 4, y, z, a, a]
    left = [*b.left[0]]
    lines = ["/COM,ANSYS RELEASE", "/PREP7", "/UNITS,MPA", "ET,1,186" if quadratic else "ET,1,185"]
    lines += ["ET,2,154", f"NBLOCK,6,SOLID,{len(b.points):10d},{len(b.points):10d}"]
    lines += ["(3i9,6e21.13e3)"]
    for i, x in enumerate(b.points, start=1):
        numbers = "".join(f"{v:20.13E}".replace("E+", "E+0").replace("E-", "E-0") for v in x)
        lines.append(f"{i:9d}{0:9d}{0:9d}{numbers}")
    lines += ["N,R5.3,LOC,       -1,", "EBLOCK,19,SOLID,         4,         4", "(19i9)"]
    rows = [(1, 1, 11, h), (1, 1, 12, wedge), (2, 1, 13, tet), (1, 2, 14, left)]
    for material, kind, number, nodes in rows:
        whole = [material, kind, 1, 1, 0, 0, 0, 0, len(nodes), 0, number]
        whole += [int(n) + 1 for n in nodes]
        lines.append("".join(f"{v:9d}" for v in whole[:19]))
        lines += ["".join(f"{v:9d}" for v in whole[19:])] if len(whole) > 19 else []
    lines.append(f"{-1:9d}")
    for name, kind, members in (
        ("BODY", "ELEM", [11, -12]),
        ("CAP", "ELEM", [13]),
        ("LEFT", "ELEM", [14]),
        ("SLOPE", "NODE", sorted(int(n) + 1 for n in b.slope[0])),
        ("TOP", "NODE", sorted(int(n) + 1 for n in b.top[0])),
        ("GROUND", "NODE", [int(n) + 1 for n in b.ground]),
    ):
        lines += [f"CMBLOCK,{name:8s},{kind},{len(members):8d}  ! users component", "(8i10)"]
        for i in range(0, len(members), 8):
            lines.append("".join(f"{v:10d}" for v in members[i : i + 8]))
    for material, young in ((1, 2.1e5), (2, 7.0e4)):
        lines.append("MPTEMP,R5.0, 1, 1,  0.00000000    ,")
        lines.append(f"MPDATA,R5.0, 1,EX  , {material:6d}, 1, {young:.7f},")
        lines.append(f"MPDATA,R5.0, 1,NUXY, {material:6d}, 1, 0.300000000    ,")
        lines.append(f"MPDATA,R5.0, 1,DENS, {material:6d}, 1, 7.850000000E-09,")
    path.write_text("\n".join(lines) + "\nFINISH\n")


# --- Nastran -----------------------------------------------------------------------------------

# Order of the mid nodes in the Nastran guide, by edges.
NASTRAN_HEX = "01 12 23 30 04 15 26 37 45 56 67 74"
NASTRAN_WEDGE = "01 12 20 03 14 25 34 45 53"


def reordered(nodes: np.ndarray, corners: int, own: str, theirs: str) -> list[int]:
    """Mid nodes in another order, found by their edges."""
    if len(nodes) == corners:
        return nodes.tolist()
    edges = [frozenset(edge) for edge in own.split()]
    return [
        *nodes[:corners].tolist(),
        *(int(nodes[corners + edges.index(frozenset(edge))]) for edge in theirs.split()),
    ]


def card_small(name: str, fields: list[str]) -> list[str]:
    lines = []
    for i in range(0, len(fields), 8):
        head = name if i == 0 else f"+C{i}"
        mark = f"+C{i + 8}" if i + 8 < len(fields) else ""
        lines.append(f"{head:8s}" + "".join(f"{f:>8s}" for f in fields[i : i + 8]) + mark)
    return lines


def card_large(name: str, fields: list[str]) -> list[str]:
    lines = []
    for i in range(0, len(fields), 4):
        head = name + "*" if i == 0 else "*"
        lines.append(f"{head:8s}" + "".join(f"{f:>16s}" for f in fields[i : i + 4]))
    return lines


def card_free(name: str, fields: list[str]) -> list[str]:
    lines = []
    for i in range(0, len(fields), 8):
        lines.append(",".join([name.lower() if i == 0 else "", *fields[i : i + 8]]))
    return lines


def short(value: float, width: int) -> str:
    """Shortest text of a number that fits a field, with the exponent as Nastran writes it."""
    for digits in range(17, 0, -1):
        text = f"{value:.{digits}g}"
        mantissa, _, exponent = text.partition("e")
        mantissa += "" if "." in mantissa else "."
        text = mantissa + (f"{int(exponent):+d}" if exponent else "")
        if len(text) <= width:
            return text
    raise AssertionError(value)


def write_bdf(path: Path, b: Body, card: Callable, width: int) -> None:
    lines = ["SOL 103", "CEND", "SET 7 = 1 THRU 3, 4,", "  9", "BEGIN BULK"]
    lines += ['$HMNAME PROP                   2"cap" 4']
    for i, x in enumerate(b.points, start=1):
        lines += card("GRID", [str(i), "", *(short(v, width) for v in x)])
    h = reordered(b.hexahedra[0], 8, HEX_EDGES, NASTRAN_HEX)
    w = reordered(b.wedges[0], 6, WEDGE_EDGES, NASTRAN_WEDGE)
    lines += card("CHEXA", ["11", "1", *nodes_text(h)])
    lines += card("CPENTA", ["12", "1", *nodes_text(w)])
    lines += card("CTETRA", ["13", "2", *nodes_text(b.tetrahedra[0])])
    quadratic = len(h) == 20
    quad, tri = ("CQUAD8", "CTRIA6") if quadratic else ("CQUAD4", "CTRIA3")
    lines += card(quad, ["14", "5", *nodes_text(b.left[0])])
    lines += card(quad, ["15", "6", *nodes_text(b.slope[0])])
    lines += card(tri, ["16", "7", *nodes_text(b.top[0])])
    lines += card("PSOLID", ["1", "1"]) + card("PSOLID", ["2", "2"]) + card("PSHELL", ["5", "1"])
    lines += card("MAT1", ["1", "210000.", "", ".3", "7.85-9"])
    lines += card("MAT1", ["2", "70000.", "", ".3", "7.85-9"])
    ground = nodes_text(b.ground)
    lines += card("SET1", ["8", *ground[:1], *ground[1:]])
    path.write_text("\n".join([*lines, "ENDDATA", ""]))


# --- Gmsh --------------------------------------------------------------------------------------

# Mid nodes in the manual of Gmsh, by edges; type numbers of linear and quadratic elements.
GMSH_HEX = "01 03 04 12 15 23 26 37 45 47 56 67"
GMSH_WEDGE = "01 02 03 12 14 25 34 35 45"
GMSH_TET = "01 12 02 03 23 13"
GMSH_TYPES = {False: (5, 6, 4, 3, 2), True: (17, 18, 11, 16, 9)}
GMSH_NAMES = ['3 1 "body"', '3 2 "cap"', '2 5 "left"', '2 6 "slope"', '2 7 "top"', '0 9 "ground"']


def gmsh_rows(b: Body) -> list[tuple[int, int, list[int]]]:
    """Type, physical group and nodes of every element."""
    kinds = GMSH_TYPES[len(b.hexahedra[0]) == 20]
    rows = [
        (kinds[0], 1, reordered(b.hexahedra[0], 8, HEX_EDGES, GMSH_HEX)),
        (kinds[1], 1, reordered(b.wedges[0], 6, WEDGE_EDGES, GMSH_WEDGE)),
        (kinds[2], 2, reordered(b.tetrahedra[0], 4, TET_EDGES, GMSH_TET)),
        (kinds[3], 5, b.left[0].tolist()),
        (kinds[3], 6, b.slope[0].tolist()),
        (kinds[4], 7, b.top[0].tolist()),
    ]
    return rows + [(15, 9, [int(n)]) for n in b.ground]


def write_msh2(path: Path, b: Body) -> None:
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(GMSH_NAMES))]
    lines += [*GMSH_NAMES, "$EndPhysicalNames", "$Nodes", str(len(b.points))]
    lines += [f"{10 * i} " + " ".join(map(repr, x.tolist())) for i, x in enumerate(b.points, 1)]
    rows = gmsh_rows(b)
    lines += ["$EndNodes", "$Elements", str(len(rows))]
    for number, (kind, group, nodes) in enumerate(rows, start=1):
        text = " ".join(str(10 * (n + 1)) for n in nodes)
        lines.append(f"{number} {kind} 2 {group} {group} {text}")
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def write_msh4(path: Path, b: Body) -> None:
    rows = gmsh_rows(b)
    points = [n + 1 for n in range(len(b.ground))]
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(GMSH_NAMES))]
    lines += [*GMSH_NAMES, "$EndPhysicalNames", "$Entities", f"{len(points)} 0 3 2"]
    lines += [f"{n} 0 0 0 1 9 " for n in points]
    lines += [f"{n} 0 0 0 1 1 1 1 -{n} 0 " for n in (5, 6, 7)]  # minus: turned round
    lines += [f"{n} 0 0 0 1 1 1 1 {n} 2 5 -6 " for n in (1, 2)]
    n = len(b.points)
    lines += ["$EndEntities", "$Nodes", f"1 {n} 1 {n}", f"3 1 0 {n}"]
    lines += [str(i + 1) for i in range(n)]
    lines += [" ".join(map(repr, x.tolist())) for x in b.points]
    lines += ["$EndNodes", "$Elements", f"{len(rows)} {len(rows)} 1 {len(rows)}"]
    corner = iter(points)
    for number, (kind, group, nodes) in enumerate(rows, start=1):
        dimension = {15: 0}.get(kind, 2 if group in (5, 6, 7) else 3)
        entity = next(corner) if kind == 15 else group
        lines += [f"{dimension} {entity} {kind} 1"]
        lines += [" ".join(map(str, [number, *(i + 1 for i in nodes)]))]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


# --- meshio and VTK as writers -------------------------------------------------------------------


def meshio_mesh(b: Body, gmsh: bool):
    meshio = pytest.importorskip("meshio")
    quadratic = len(b.hexahedra[0]) == 20
    names = ("hexahedron20", "wedge15", "tetra10", "quad8", "triangle6")
    if not quadratic:
        names = ("hexahedron", "wedge", "tetra", "quad", "triangle")
    cells = [
        *zip(names[:3], (b.hexahedra, b.wedges, b.tetrahedra), strict=True),
        (names[3], b.left),
        (names[3], b.slope),
        (names[4], b.top),
    ]
    groups = [np.array([g], dtype=np.int32) for g in (1, 1, 2, 5, 6, 7)]
    if not gmsh:
        ground = np.isin(np.arange(len(b.points)), b.ground).astype(np.int32)
        return meshio.Mesh(b.points, cells, cell_data={"solid": groups}, point_data={"g": ground})
    # an entity of its own for every block, and nodes on each of them
    entity = [np.array([g], dtype=np.int32) for g in (1, 3, 2, 5, 6, 7)]
    tags = np.full((len(b.points), 2), 3)
    tags[:, 1] = 1
    for i, tag in enumerate(((3, 1), (3, 3), (3, 2), (2, 5), (2, 6), (2, 7))):
        tags[i] = tag
    fields = {"body": [1, 3], "cap": [2, 3], "left": [5, 2], "slope": [6, 2], "top": [7, 2]}
    return meshio.Mesh(
        b.points,
        cells,
        cell_data={"gmsh:physical": groups, "gmsh:geometrical": entity},
        field_data={name: np.array(value) for name, value in fields.items()},
        point_data={"gmsh:dim_tags": tags},
    )


def with_meshio(form: str, **options) -> Callable[[Path, Body], None]:
    def write(path: Path, b: Body) -> None:
        mesh = meshio_mesh(b, form.startswith("gmsh"))
        meshio = pytest.importorskip("meshio")
        # its table of dimensions lacks this one
        meshio._mesh.topological_dimension.setdefault("wedge15", 3)
        meshio.write(path, mesh, file_format=form, **options)

    return write


def with_vtk(mode: str, compressor: str, header: int, legacy: bool = False) -> Callable:
    """Write with VTK itself, through pyvista."""

    def write(path: Path, b: Body) -> None:
        pyvista = pytest.importorskip("pyvista")
        vtk = pytest.importorskip("vtkmodules.vtkIOXML")
        old = pytest.importorskip("vtkmodules.vtkIOLegacy")
        kinds = (25, 26, 24, 23, 23, 22) if len(b.hexahedra[0]) == 20 else (12, 13, 10, 9, 9, 5)
        parts = (b.hexahedra, b.wedges, b.tetrahedra, b.left, b.slope, b.top)
        cells = np.concatenate([[len(p[0]), *p[0]] for p in parts])
        grid = pyvista.UnstructuredGrid(cells, np.array(kinds, dtype=np.uint8), b.points)
        grid.cell_data["MaterialIds"] = np.array([1, 1, 2, 5, 6, 7])
        grid.cell_data["stress"] = np.linspace(0, 1, 6)
        grid.point_data["g"] = np.isin(np.arange(len(b.points)), b.ground).astype(np.uint8)
        writer = old.vtkUnstructuredGridWriter() if legacy else vtk.vtkXMLUnstructuredGridWriter()
        if legacy:
            getattr(writer, f"SetFileTypeTo{mode}")()
            writer.SetFileVersion(header)
        else:
            getattr(writer, f"SetDataModeTo{mode.removesuffix('Base64')}")()
            writer.SetEncodeAppendedData(mode.endswith("Base64"))
            getattr(writer, f"SetCompressorTypeTo{compressor}")()
            writer.SetHeaderType(header)
        writer.SetInputData(grid)
        writer.SetFileName(str(path))
        assert writer.Write() == 1

    return write


def small(path: Path, b: Body) -> None:
    write_bdf(path, b, card_small, 8)


def large(path: Path, b: Body) -> None:
    write_bdf(path, b, card_large, 16)


def free(path: Path, b: Body) -> None:
    write_bdf(path, b, card_free, 24)


ROUNDED = 2e-5  # eight columns hold six digits

WRITERS = {
    "cdb": ("a.cdb", write_cdb, 1e-8),
    "bdf small": ("a.bdf", small, ROUNDED),
    "bdf large": ("a.nas", large, 1e-8),
    "bdf free": ("a.dat", free, 1e-8),
    "msh 2.2": ("a.msh", write_msh2, 1e-8),
    "msh 4.1": ("a.msh", write_msh4, 1e-8),
    "msh 2.2 meshio": ("a.msh", with_meshio("gmsh22", binary=False), 1e-8),
    "msh 2.2 meshio binary": ("a.msh", with_meshio("gmsh22", binary=True), 1e-8),
    "msh 4.1 meshio": ("a.msh", with_meshio("gmsh", binary=False), 1e-8),
    "msh 4.1 meshio binary": ("a.msh", with_meshio("gmsh", binary=True), 1e-8),
    "vtk 4.2 meshio": ("a.vtk", with_meshio("vtk42", binary=False), 1e-8),
    "vtk 4.2 meshio binary": ("a.vtk", with_meshio("vtk42", binary=True), 1e-8),
    "vtk 5.1 meshio": ("a.vtk", with_meshio("vtk51", binary=False), 1e-8),
    "vtk 5.1 meshio binary": ("a.vtk", with_meshio("vtk51", binary=True), 1e-8),
    "vtk 5.1 vtk": ("a.vtk", with_vtk("ASCII", "None", 51, legacy=True), 1e-8),
    "vtk 4.2 vtk binary": ("a.vtk", with_vtk("Binary", "None", 42, legacy=True), 1e-8),
    "vtu meshio": ("a.vtu", with_meshio("vtu", binary=False), 1e-8),
    "vtu meshio zlib": ("a.vtu", with_meshio("vtu", compression="zlib"), 1e-8),
    "vtu meshio lzma": ("a.vtu", with_meshio("vtu", compression="lzma"), 1e-8),
    "vtu vtk ascii": ("a.vtu", with_vtk("Ascii", "None", 32), 1e-8),
    "vtu vtk binary": ("a.vtu", with_vtk("Binary", "None", 64), 1e-8),
    "vtu vtk binary zlib": ("a.vtu", with_vtk("Binary", "ZLib", 32), 1e-8),
    "vtu vtk appended raw": ("a.vtu", with_vtk("Appended", "None", 64), 1e-8),
    "vtu vtk appended raw zlib": ("a.vtu", with_vtk("Appended", "ZLib", 32), 1e-8),
    "vtu vtk appended base64 lzma": ("a.vtu", with_vtk("AppendedBase64", "LZMA", 64), 1e-8),
}

# Names that the formats give to the surfaces of the body.
NAMES = {
    "cdb": {"left": "LEFT", "slope": "SLOPE", "top": "TOP"},
    "bdf": {"left": "pshell_5", "slope": "pshell_6", "top": "pshell_7"},
    "msh": {"left": "left", "slope": "slope", "top": "top"},
    "vtk": {"left": "surface_5", "slope": "surface_6", "top": "surface_7"},
    "vtu": {"left": "surface_5", "slope": "surface_6", "top": "surface_7"},
}
SOLIDS = {
    "cdb": ("BODY", "CAP"),
    "bdf": ("psolid_1", "cap"),
    "msh": ("body", "cap"),
    "vtk": ("solid_1", "solid_2"),
    "vtu": ("solid_1", "solid_2"),
}
GROUND = {"cdb": "GROUND", "bdf": "set_8", "msh": "ground", "vtk": "g", "vtu": "g"}


def area(mesh: Mesh, surface: Surface) -> float:
    total = 0.0
    for block in surface.blocks:
        x = mesh.points[block.connectivity[:, : FAMILIES[block.family].corners]]
        diagonals = x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]
        if x.shape[1] == 3:
            diagonals = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
        total += float(np.linalg.norm(0.5 * np.cross(*diagonals), axis=1).sum())
    return total


def worst_middle(mesh: Mesh) -> float:
    """Largest distance of a mid node from the middle of its edge."""
    worst = 0.0
    for block in mesh.blocks:
        family = block.topology
        for i, (a, b) in enumerate(family.edges if family.quadratic else ()):
            x = mesh.points[block.connectivity]
            gap = x[:, family.corners + i] - 0.5 * (x[:, a] + x[:, b])
            worst = max(worst, float(np.abs(gap).max()))
    return worst


STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


def frequencies(mesh: Mesh) -> np.ndarray:
    elastic = elastic_body("body", mesh, {name: STEEL for name in mesh.solids})
    return eigenmodes(elastic, count=8).frequency


def reference(path: Path, b: Body) -> MeshModel:
    """Read the body from an Abaqus file, whose node order is that of klack."""
    quadratic = len(b.hexahedra[0]) == 20
    kinds = ("C3D20", "C3D15", "C3D10") if quadratic else ("C3D8", "C3D6", "C3D4")
    lines = ["*NODE"]
    lines += [f"{i}, " + ", ".join(map(repr, x.tolist())) for i, x in enumerate(b.points, 1)]
    for number, (kind, part) in enumerate(
        zip(kinds, (b.hexahedra, b.wedges, b.tetrahedra), strict=True), start=1
    ):
        nodes = nodes_text(part[0])
        lines += [f"*ELEMENT, TYPE={kind}, ELSET=all", ", ".join([str(number), *nodes[:15]])]
        lines[-1] += "," if len(nodes) > 15 else ""
        lines += [", ".join(nodes[15:])] if len(nodes) > 15 else []
    path.write_text("\n".join(lines))
    return read_mesh_file(path, MM)


@pytest.mark.parametrize("quadratic", [False, True], ids=["linear", "quadratic"])
@pytest.mark.parametrize("form", WRITERS)
def test_same_body_from_every_format(form: str, quadratic: bool, tmp_path: Path) -> None:
    name, write, accuracy = WRITERS[form]
    b = body(quadratic)
    write(tmp_path / name, b)
    model = read_mesh_file(tmp_path / name, None if form == "cdb" else MM)
    mesh = model.mesh
    kind = form[:3]
    assert mesh.node_count == len(b.points)
    families = {("hex8", "hex20")[quadratic], ("wedge6", "wedge15")[quadratic]}
    assert {block.family for block in mesh.blocks} == families | {("tet4", "tet10")[quadratic]}
    assert corner_volume(mesh) == pytest.approx(VOLUME * 1e-9, rel=max(1e-12, accuracy))
    assert worst_middle(mesh) <= max(1e-15, accuracy * 1e-2)
    assert mesh.solids == (("MaterialIds_1", "MaterialIds_2") if " vtk" in form else SOLIDS[kind])
    for truth, label in NAMES[kind].items():
        expected = AREAS[truth] * SCALE**2 * 1e-6
        assert area(mesh, mesh.surface(label)) == pytest.approx(expected, rel=max(1e-12, accuracy))
        side = getattr(b, truth)[0]
        assert len(mesh.surface(label).nodes) == len(side)
    if not ("meshio" in form and kind == "msh"):
        ground = mesh.node_sets[GROUND[kind]]
        np.testing.assert_allclose(mesh.points[ground, 2], 0.0, atol=0)
        assert len(ground) == len(b.ground)
    truth = reference(tmp_path / "a.inp", b)
    np.testing.assert_allclose(frequencies(mesh), frequencies(truth.mesh), rtol=accuracy)


def netgen_file(path: Path, quadratic: bool) -> None:
    """A box of 1 x 2 x 3 as netgen writes it, all tetrahedra mirrored."""
    from netgen.occ import Box, OCCGeometry, Pnt

    found = OCCGeometry(Box(Pnt(0, 0, 0), Pnt(1, 2, 3))).GenerateMesh(maxh=1.0)
    if quadratic:
        found.SecondOrder()
    found.Export(str(path), "Gmsh2 Format")


@pytest.mark.parametrize("quadratic", [False, True], ids=["linear", "quadratic"])
def test_mirrored_tetrahedra_of_netgen_are_turned(quadratic: bool, tmp_path: Path) -> None:
    netgen_file(tmp_path / "box.msh", quadratic)
    with pytest.warns(AccuracyWarning, match="netgen has written all tetrahedra mirrored"):
        mesh = read_mesh_file(tmp_path / "box.msh", MM).mesh

    assert corner_volume(mesh) == pytest.approx(6e-9, rel=1e-12)
    assert worst_middle(mesh) <= 1e-9 * MM  # netgen writes six decimals, here exact ones
    assert sum(area(mesh, surface) for surface in mesh.surfaces.values()) == pytest.approx(22e-6)


def test_a_single_inverted_tetrahedron_of_netgen_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "box.msh"
    netgen_file(path, False)
    *lines, last, end = path.read_text().rstrip().splitlines()
    *row, one, two = last.split()
    path.write_text("\n".join([*lines, " ".join([*row, two, one]), end, ""]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # none is turned
        with pytest.raises(InputError, match="element"):
            read_mesh_file(path, MM)


@pytest.mark.parametrize("form", ["cdb", "bdf large", "bdf free"])
def test_materials_and_sections(form: str, tmp_path: Path) -> None:
    name, write, _ = WRITERS[form]
    write(tmp_path / name, body(True))
    model = read_mesh_file(tmp_path / name, MM)
    found = [model.materials[model.sections[solid]] for solid in SOLIDS[form[:3]]]
    assert [m.young for m in found] == pytest.approx([2.1e5, 7e4], rel=1e-12)
    assert [m.poisson for m in found] == [0.3, 0.3]
    assert [m.density for m in found] == pytest.approx([7.85e-9] * 2, rel=1e-12)


def test_units_of_the_ansys_file_or_of_the_user(tmp_path: Path) -> None:
    write_cdb(tmp_path / "a.cdb", body(False))
    assert read_mesh_file(tmp_path / "a.cdb", None).unit_length == 1e-3
    assert read_mesh_file(tmp_path / "a.cdb", 0.01).unit_length == 0.01


def test_tetrahedra_of_solid187(tmp_path: Path) -> None:
    write_cdb(tmp_path / "a.cdb", body(True))
    text = (tmp_path / "a.cdb").read_text()
    t = [int(n) + 1 for n in body(True).tetrahedra[0]]
    start = text.index("        2        1        1        1")
    end = text.index("\n", text.index("\n", start) + 1)
    head = [2, 3, 1, 1, 0, 0, 0, 0, 10, 0, 13, *t]
    lines = ["".join(f"{v:9d}" for v in part) for part in (head[:19], head[19:])]
    text = text[:start] + "\n".join(lines) + text[end:]
    (tmp_path / "a.cdb").write_text(text.replace("ET,2,154", "ET,2,154\nET,3,187"))
    mesh = read_mesh_file(tmp_path / "a.cdb", None).mesh
    assert corner_volume(mesh) == pytest.approx(VOLUME * 1e-9, rel=1e-12)
    assert worst_middle(mesh) < 1e-15


@pytest.mark.parametrize("form", ["cdb", "bdf large", "msh 4.1", "vtu vtk ascii"])
def test_one_solid_alone(form: str, tmp_path: Path) -> None:
    name, write, _ = WRITERS[form]
    write(tmp_path / name, body(True))
    cap = "MaterialIds_2" if form.startswith("vtu") else SOLIDS[form[:3]][1]
    mesh = read_mesh_file(tmp_path / name, MM, solids=[cap]).mesh
    assert mesh.solids == (cap,)
    assert mesh.node_count == 10
    assert corner_volume(mesh) == pytest.approx(3 * SCALE**3 * 1e-9, rel=1e-9)
    assert set(mesh.surfaces) == {NAMES[form[:3]]["top"]}
