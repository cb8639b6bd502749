"""Axisymmetric meshes of Gmsh and VTK, coordinate systems and node sets of Nastran, components.

Truth: exact.  A cylinder's section has a known volume when it is turned round.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.mesh import Mesh
from klack.mesh.quality import corner_volume

MM = 1e-3
# Section r 0..2, z 0..3 with one quadrilateral and two triangles
POINTS = ((0, 0), (1, 0), (2, 0), (0, 3), (1, 3), (2, 3))
VOLUME = np.pi * 2**2 * 3 * 1e-9


def gmsh(path: Path, clockwise: bool) -> Mesh:
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '1 4 "seat"']
    lines += ['2 1 "needle"', "$EndPhysicalNames", "$Nodes", "6"]
    lines += [f"{i} {r} {z} 0" for i, (r, z) in enumerate(POINTS, start=1)]
    quad, a, b = ("1 2 5 4", "2 3 6", "2 6 5") if not clockwise else ("1 4 5 2", "2 6 3", "2 5 6")
    lines += ["$EndNodes", "$Elements", "5", f"1 3 2 1 1 {quad}", f"2 2 2 1 1 {a}"]
    lines += [f"3 2 2 1 1 {b}", "4 1 2 4 1 1 2", "5 1 2 4 1 2 3", "$EndElements", ""]
    path.write_text("\n".join(lines))
    return read_mesh_file(path, MM).mesh


def vtk(path: Path, clockwise: bool) -> Mesh:
    points = " ".join(f"{r} {z} 0" for r, z in POINTS)
    quad, a, b = ("0 1 4 3", "1 2 5", "1 5 4") if not clockwise else ("0 3 4 1", "1 5 2", "1 4 5")
    path.write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        f"POINTS 6 double\n{points}\n"
        f"CELLS 5 19\n4 {quad}\n3 {a}\n3 {b}\n2 0 1\n2 1 2\nCELL_TYPES 5\n9 5 5 3 3\n"
        "CELL_DATA 5\nSCALARS seat char 1\nLOOKUP_TABLE default\n0 0 0 1 1\n"
    )
    return read_mesh_file(path, MM).mesh


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize(("write", "name"), [(gmsh, "a.msh"), (vtk, "a.vtk")])
def test_section_in_the_plane(write, name: str, clockwise: bool, tmp_path: Path) -> None:
    mesh = write(tmp_path / name, clockwise)
    assert mesh.dimension == 2
    assert corner_volume(mesh) == pytest.approx(VOLUME, rel=1e-13)
    seat = mesh.surface("seat")
    assert seat.face_count == 2
    np.testing.assert_array_equal(mesh.points[seat.nodes, 1], 0)
    for block in seat.blocks:  # material on the left: r grows along the lower side
        r = mesh.points[block.connectivity, 0]
        assert (r[:, 1] > r[:, 0]).all()


def test_quadratic_section_of_gmsh(tmp_path: Path) -> None:
    x = [(0, 0), (2, 0), (0, 3), (1, 0), (1, 1.5), (0, 1.5)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", "6"]
    lines += [f"{i} {r} {z} 0" for i, (r, z) in enumerate(x, start=1)]
    lines += ["$EndNodes", "$Elements", "2", "1 9 2 0 1 1 3 2 6 5 4", "2 8 2 7 1 1 2 4"]
    path = tmp_path / "nadel.msh"
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    mesh = read_mesh_file(path, MM).mesh
    assert mesh.solids == ("nadel",)
    assert corner_volume(mesh) == pytest.approx(np.pi * 2**2 * 3e-9 / 3, rel=1e-13)  # a cone
    (face,) = mesh.surface("curve_7").blocks
    np.testing.assert_allclose(mesh.points[face.connectivity[0], 0], np.array([0, 2, 1]) * MM)


# --- Nastran -----------------------------------------------------------------------------------


def test_coordinate_systems_of_nastran(tmp_path: Path) -> None:
    """The same tetrahedron in turned rectangular, cylindrical and spherical coordinates."""
    x = np.array([[1.0, 1, 0], [3, 1, 0], [1, 4, 0], [1, 1, 5]])
    shift = np.array([0.5, -0.25, 2.0])
    axes = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # x', y', z' in basic coordinates
    local = (x - shift) @ axes.T
    ring = np.hypot(local[:, 0], local[:, 1])
    angle = np.degrees(np.arctan2(local[:, 1], local[:, 0]))
    radius = np.linalg.norm(local, axis=1)
    tilt = np.degrees(np.arctan2(ring, local[:, 2]))
    forms = {
        "R": local,
        "C": np.stack([ring, angle, local[:, 2]], axis=1),
        "S": np.stack([radius, tilt, angle], axis=1),
    }
    b, c = shift + axes[2], shift + 3 * axes[0] + axes[2]
    corners = [*(shift - 1), *(b - 1), *(c - 1)]  # in system 9, moved by (1, 1, 1)
    for kind, values in forms.items():
        lines = [
            f"GRID*,{i},4,{v[0]!r},{v[1]!r}\n*,{v[2]!r}" for i, v in enumerate(values.tolist(), 1)
        ]
        lines += [f"CORD2{kind},4,9," + ",".join(f"{v}" for v in corners[:6])]
        lines += ["," + ",".join(f"{v}" for v in corners[6:])]
        lines += ["CORD2R,9,,1.,1.,1.,1.,1.,2.", ",2.,1.,1.", "CTETRA,1,1,1,2,3,4", "ENDDATA"]
        path = tmp_path / f"{kind}.bdf"
        path.write_text("\n".join(lines))
        np.testing.assert_allclose(
            read_mesh_file(path, 1e-3).mesh.points, x * 1e-3, rtol=1e-12, atol=1e-15
        )


def test_coordinate_system_by_nodes(tmp_path: Path) -> None:
    lines = ["GRID,11,,1.,0.,0.", "GRID,12,,1.,0.,1.", "GRID,13,,1.,1.,0.", "CORD1R,4,11,12,13"]
    lines += ["GRID,1,4,0.,0.,0.", "GRID,2,4,1.,0.,0.", "GRID,3,4,0.,1.,0.", "GRID,4,4,0.,0.,1."]
    path = tmp_path / "a.bdf"
    path.write_text("\n".join([*lines, "CTETRA,1,1,1,2,3,4", "ENDDATA"]))
    truth = [[1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 0, 1]]
    np.testing.assert_allclose(read_mesh_file(path, 1.0).mesh.points, truth, atol=1e-15)


SETS = {
    "SET1,8,1,THRU,3": ("set_8", [1, 2, 3]),
    "SET1,8,1,2,4": ("set_8", [1, 2, 4]),
    "SET3,8,GRID,2,3": ("set_8", [2, 3]),
    "ASET1,123,1,THRU,1000000000": ("aset", [1, 2, 3, 4]),
    "ASET,1,123,4,123": ("aset", [1, 4]),
    "USET,tip,2,3,3,3": ("tip", [2, 3]),
    "USET1,tip,0,1,3": ("tip", [1, 3]),
}


@pytest.mark.parametrize("card", SETS)
def test_node_sets_of_nastran(card: str, tmp_path: Path) -> None:
    name, members = SETS[card]
    lines = ["GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0.", "GRID,3,,0.,1.,0.", "GRID,4,,0.,0.,1."]
    path = tmp_path / "a.bdf"
    path.write_text("\n".join([*lines, "CTETRA,1,1,1,2,3,4", card, "ENDDATA"]))
    model = read_mesh_file(path, 1.0)
    np.testing.assert_array_equal(model.node_numbers[model.mesh.node_sets[name]], members)
    assert (name in model.mesh.surfaces) == (len(members) >= 3)


def test_includes_and_comments_of_nastran(tmp_path: Path) -> None:
    (tmp_path / "nodes").mkdir()
    (tmp_path / "nodes" / "kn\u00f6pfe.inc").write_text(
        "$ nodes\nGRID,1,,0.,0.,0. $ first\nGRID,2,,1.,0.,0.\n", encoding="utf-8"
    )
    text = "INCLUDE 'nodes/kn\u00f6pfe.inc'\nGRID,3,,0.,1.,0.\n\nGRID,4,,0.,0.,1.\n"
    text += "CTETRA,1,1,1,2,3,x\nENDDATA\n"
    path = tmp_path / "a.bdf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(Exception, match=r"a.bdf:5: CTETRA: got 'x'"):
        read_mesh_file(path, 1.0)
    path.write_text(text.replace("x", "4"), encoding="utf-8")
    assert read_mesh_file(path, 1.0).mesh.node_count == 4


# --- ANSYS -------------------------------------------------------------------------------------


def row_of_bricks(path: Path, components: dict[str, list[int]], materials: list[int]) -> Mesh:
    """Bricks 1, 2, ... side by side, with element components."""
    count = len(materials)
    lines = ["/PREP7", "ET,1,185", f"NBLOCK,3,,{4 * count + 4},{4 * count + 4}", "(1i8,3e20.9)"]
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    for i in range(4 * count + 4):
        x = (*corners[i % 4], i // 4)
        lines.append(f"{i + 1:8d}" + "".join(f"{v:20.9e}" for v in x))
    lines += ["-1".rjust(8), f"EBLOCK,19,SOLID,,{count}", "(19i8)"]
    for i, material in enumerate(materials):
        nodes = [4 * i + k + 1 for k in range(8)]
        lines.append(
            "".join(f"{v:8d}" for v in [material, 1, 1, 1, 0, 0, 0, 0, 8, 0, i + 1, *nodes])
        )
    lines.append("      -1")
    for name, members in components.items():
        lines += [f"CMBLOCK,{name},ELEM,{len(members)}", "(8i10)"]
        lines.append("".join(f"{v:10d}" for v in members))
    path.write_text("\n".join([*lines, ""]))
    return read_mesh_file(path, MM).mesh


COMPONENTS = [
    ({}, {"material_1": 3, "material_2": 1}),
    ({"BODY": [1, -4]}, {"BODY": 4}),
    ({"ALL": [1, -4], "A": [1, 2], "B": [3, 4]}, {"A": 2, "B": 2}),
    ({"TIP": [1], "BODY": [1, -4]}, {"BODY": 4}),
    ({"TIP": [1], "BODY": [1, -3]}, {"BODY": 3, "material_2": 1}),
]


@pytest.mark.parametrize(("components", "solids"), COMPONENTS)
def test_element_components_are_solids(
    components: dict[str, list[int]], solids: dict[str, int], tmp_path: Path
) -> None:
    mesh = row_of_bricks(tmp_path / "a.cdb", components, [1, 1, 1, 2])
    counts = {b.solid: len(b.connectivity) for b in mesh.blocks}
    assert counts == solids
    assert components.keys() - counts.keys() <= mesh.node_sets.keys()


MATERIALS = {
    "MP,EX,1,2.1e5\nMP,PRXY,1,0.3\nMP,DENS,1,7.85e-9\t! t mm^-3": (2.1e5, 0.3, 7.85e-9),
    "mp,ex,1,2.1e5\nmp,ex,1,2.1e5\nmp,nuxy,1,0.25": (2.1e5, 0.25, None),
    "MPDATA,EX,1,1,2.1e5,2.1e5\nMPDATA,NUXY,1,1,0.3": (2.1e5, 0.3, None),
    "MPDATA,R5.0,2,EX,1,1,2.1e5,1.9e5\nMP,PRXY,1,0.3": None,  # depends on temperature
}


@pytest.mark.parametrize("commands", MATERIALS)
def test_materials_of_ansys(commands: str, tmp_path: Path) -> None:
    path = tmp_path / "a.cdb"
    row_of_bricks(path, {}, [1])
    path.write_text(path.read_text() + commands + "\n")
    model = read_mesh_file(path, MM)
    truth = MATERIALS[commands]
    if truth is None:
        assert not model.materials
        return
    found = model.materials[model.sections["material_1"]]
    assert (found.young, found.poisson, found.density) == truth


def test_names_in_comments_of_nastran(tmp_path: Path) -> None:
    lines = ["GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0.", "GRID,3,,0.,1.,0.", "GRID,4,,0.,0.,1."]
    lines += ["CTETRA,1,3,1,2,3,4", "CTRIA3,2,4,1,2,3", "PSOLID,3,6", "MAT1,6,2.1+5,,.3"]
    lines += ['$HMNAME PROP                   3"needle" 4', "$ANSA_NAME_COMMENT;4;PSHELL;seat;"]
    lines += ["$ Femap Material 6 : steel 1.4125", "ENDDATA"]
    path = tmp_path / "a.bdf"
    path.write_text("\n".join(lines))
    model = read_mesh_file(path, 1.0)
    assert model.mesh.solids == ("needle",)
    assert set(model.mesh.surfaces) == {"seat"}
    assert model.sections == {"needle": "steel 1.4125"}
    assert model.materials["steel 1.4125"].young == 2.1e5
