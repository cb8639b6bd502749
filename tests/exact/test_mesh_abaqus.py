"""Reader of Abaqus and CalculiX files: geometry, sets, faces.

Truth: exact.  Face numbers S1..S6 as in the Abaqus and CalculiX manuals, written out here by corner
numbers and independent of the tables in klack.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.quality import corner_volume

DATA = Path(__file__).parents[1] / "data"
MM = 1e-3

# Corners of an element on irregular places (so that no two faces are alike), by shape.
TET = [[0, 0, 0], [2, 0, 0], [0.3, 3, 0], [0.2, 0.1, 4]]
HEX = [[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0], [0, 0, 4], [2, 0, 4], [2, 3, 4], [0, 3, 4]]
WEDGE = [[0, 0, 0], [2, 0, 0], [0.3, 3, 0], [0, 0, 4], [2, 0, 4], [0.3, 3, 4]]
TRI = [[1, 0], [3, 0.2], [1.2, 2]]
QUAD = [[1, 0], [3, 0], [3, 2], [1, 2.5]]

# Faces S1, S2, ... by corner number, from the manuals.
TET_S = ["1 2 3", "1 4 2", "2 4 3", "3 4 1"]
HEX_S = ["1 2 3 4", "5 8 7 6", "1 5 6 2", "2 6 7 3", "3 7 8 4", "4 8 5 1"]
WEDGE_S = ["1 2 3", "4 5 6", "1 2 5 4", "2 3 6 5", "3 1 4 6"]
TRI_S = ["1 2", "2 3", "3 1"]
QUAD_S = ["1 2", "2 3", "3 4", "4 1"]
# Mid nodes: the edges on which they lie, in the order of the manuals.
TET_M = ["1 2", "2 3", "3 1", "1 4", "2 4", "3 4"]
HEX_M = ["1 2", "2 3", "3 4", "4 1", "5 6", "6 7", "7 8", "8 5", "1 5", "2 6", "3 7", "4 8"]
WEDGE_M = ["1 2", "2 3", "3 1", "4 5", "5 6", "6 4", "1 4", "2 5", "3 6"]

CASES = [
    ("C3D4", "tet4", TET, TET_S, []),
    ("C3D10", "tet10", TET, TET_S, TET_M),
    ("C3D10M", "tet10", TET, TET_S, TET_M),
    ("C3D8", "hex8", HEX, HEX_S, []),
    ("C3D8R", "hex8", HEX, HEX_S, []),
    ("C3D8I", "hex8", HEX, HEX_S, []),
    ("C3D20", "hex20", HEX, HEX_S, HEX_M),
    ("C3D20R", "hex20", HEX, HEX_S, HEX_M),
    ("C3D6", "wedge6", WEDGE, WEDGE_S, []),
    ("C3D15", "wedge15", WEDGE, WEDGE_S, WEDGE_M),
    ("CAX3", "tri3", TRI, TRI_S, []),
    ("CAX6M", "tri6", TRI, TRI_S, TRI_S),
    ("CAX4R", "quad4", QUAD, QUAD_S, []),
    ("CAX8R", "quad8", QUAD, QUAD_S, QUAD_S),
]


def numbers(text: str) -> list[int]:
    return [int(part) - 1 for part in text.split()]


def single_element(path: Path, kind: str, corners, sides, edges) -> np.ndarray:
    x = np.array(corners, dtype=float)
    x = np.vstack([x, *(x[numbers(edge)].mean(axis=0, keepdims=True) for edge in edges)])
    lines = ["*NODE"]
    lines += [f"{i}, " + ", ".join(map(repr, map(float, p))) for i, p in enumerate(x, start=1)]
    nodes = list(map(str, range(1, len(x) + 1)))
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=one", ", ".join(["1", *nodes[:15]]) + ","]
    lines += [", ".join(nodes[15:])] if len(nodes) > 15 else []
    for i in range(len(sides)):
        lines += [f"*SURFACE, NAME=side{i + 1}", f"one, S{i + 1}"]
    path.write_text("\n".join(lines))
    return x


def vector_area(mesh: Mesh, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Compute normal times area of the straight face, and its middle."""
    (block,) = surface.blocks
    x = mesh.points[block.connectivity[0, : FAMILIES[block.family].corners]]
    if mesh.dimension == 2:
        t = x[1] - x[0]
        return np.array([t[1], -t[0]]), x.mean(axis=0)
    fan = [np.cross(x[i] - x[0], x[i + 1] - x[0]) / 2 for i in range(1, len(x) - 1)]
    return np.sum(fan, axis=0), x.mean(axis=0)


@pytest.mark.parametrize(
    ("kind", "family", "corners", "sides", "edges"), CASES, ids=[c[0] for c in CASES]
)
def test_every_face_number_is_the_right_face_outwards(
    tmp_path, kind, family, corners, sides, edges
):
    x = single_element(tmp_path / "one.inp", kind, corners, sides, edges) * MM
    mesh = read_abaqus(tmp_path / "one.inp", MM).mesh

    assert mesh.solids == ("one",)
    assert mesh.blocks[0].family == family
    np.testing.assert_allclose(mesh.points, x, rtol=1e-15)
    for i, side in enumerate(sides):
        surface = mesh.surface(f"side{i + 1}")
        (block,) = surface.blocks
        corner_count = FAMILIES[block.family].corners
        assert set(block.connectivity[0, :corner_count]) == set(numbers(side))
        for k, middle in enumerate(block.connectivity[0, corner_count:]):
            pair = block.connectivity[0, [k, (k + 1) % max(corner_count, 2)]]
            np.testing.assert_allclose(mesh.points[middle], mesh.points[pair].mean(axis=0))
        normal, place = vector_area(mesh, surface)
        inside = mesh.points[: len(corners)].mean(axis=0)
        assert normal @ (place - inside) > 0
    total = sum(vector_area(mesh, mesh.surface(f"side{i + 1}"))[0] for i in range(len(sides)))
    np.testing.assert_allclose(total, 0, atol=1e-18)


def test_sets_surfaces_sections_and_materials():
    model = read_abaqus(DATA / "block.inp", MM)
    mesh = model.mesh

    assert mesh.solids == ("Short", "Long")
    assert corner_volume(mesh) == pytest.approx(3 * MM**3, rel=1e-12)
    assert mesh.node_count == 12  # not the reference point
    assert model.node_numbers.tolist() == list(range(1, 13))
    assert [part.tolist() for part in model.element_numbers] == [[10], [20]]
    file_numbers = {
        name: model.node_numbers[nodes].tolist() for name, nodes in mesh.node_sets.items()
    }
    assert file_numbers["left"] == [1, 4, 5, 8]
    assert file_numbers["nested"] == [1, 2, 4, 5, 8]
    assert file_numbers["Foot"] == [1, 2, 3, 4, 9, 10]
    assert "in_a_step" not in file_numbers
    assert sorted(set(mesh.points[mesh.surface("Ends").nodes, 0].tolist())) == [0.0, 3 * MM]
    assert mesh.surface("Bottom").face_count == mesh.surface("Foot").face_count == 2
    assert np.all(mesh.points[mesh.surface("Foot").nodes, 2] == 0)
    assert mesh.surface("Skin").face_count == 10  # without the face between the bricks
    assert model.sections == {"Short": "Steel", "Long": "Soft iron"}
    steel = model.materials["Steel"]
    assert (steel.young, steel.poisson) == (2.1e5, 0.3)
    assert steel.density == pytest.approx(7850e-12, rel=1e-12, abs=0.0)
    assert model.materials["Soft iron"].density is None


def test_one_solid_of_several():
    mesh = read_abaqus(DATA / "block.inp", MM, solids=("Long",)).mesh

    assert mesh.solids == ("Long",)
    assert corner_volume(mesh) == pytest.approx(2 * MM**3, rel=1e-12)
    assert mesh.surface("Ends").face_count == 1
    assert mesh.surface("Skin").face_count == 6


def test_part_with_one_instance_is_axisymmetric():
    """A ring of 2 < r < 3 mm, 1 mm high."""
    model = read_abaqus(DATA / "part.inp", MM)

    assert model.mesh.dimension == 2
    assert model.mesh.blocks[0].family == "quad8"
    assert corner_volume(model.mesh) == pytest.approx(np.pi * 5 * MM**3, rel=1e-12)
    assert np.all(model.mesh.points[model.mesh.surface("Outside").nodes, 0] == 3 * MM)
    assert np.all(model.mesh.points[model.mesh.surface("Under").nodes, 1] == 0)
    assert model.sections == {"Set-1": "Steel"}


def test_sets_of_surface_elements_become_surfaces(tmp_path):
    """Two tetrahedra on either side of z = 0: triangles outside, and one between the solids."""
    (tmp_path / "two.inp").write_text(
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,0,0,-1\n"
        "*ELEMENT, TYPE=SFM3D3, ELSET=slope\n1, 3, 2, 4\n"
        "*ELEMENT, TYPE=S3, ELSET=joint\n2, 1, 2, 3\n"
        "*ELEMENT, TYPE=C3D4, ELSET=upper\n3, 1, 2, 3, 4\n"
        "*ELEMENT, TYPE=C3D4, ELSET=lower\n4, 1, 3, 2, 5\n"
    )
    mesh = read_abaqus(tmp_path / "two.inp", 1.0).mesh

    assert mesh.solids == ("upper", "lower")
    assert set(mesh.surfaces) == {"slope"}
    normal, _ = vector_area(mesh, mesh.surface("slope"))
    np.testing.assert_allclose(normal, [0.5, 0.5, 0.5])  # outwards, though listed inwards
    assert mesh.node_sets["joint"].tolist() == [0, 1, 2]


def test_lines_mark_surfaces_of_axisymmetric_meshes(tmp_path):
    """Three-node lines with the middle last (gmsh) and second (Abaqus)."""
    (tmp_path / "tri.inp").write_text(
        "*NODE\n1,0,0\n2,1,0\n3,0,1\n4,.5,0\n5,.5,.5\n6,0,.5\n"
        "*ELEMENT, TYPE=T3D3, ELSET=foot\n1, 2, 1, 4\n"
        "*ELEMENT, TYPE=SAX2, ELSET=cone\n2, 2, 5, 3\n"
        "*ELEMENT, TYPE=CAX6, ELSET=body\n3, 1, 2, 3, 4, 5, 6\n"
    )
    mesh = read_abaqus(tmp_path / "tri.inp", 1.0).mesh

    assert mesh.surface("foot").blocks[0].connectivity.tolist() == [[0, 1, 3]]
    assert mesh.surface("cone").blocks[0].connectivity.tolist() == [[1, 2, 4]]


def test_included_files_are_read(tmp_path):
    folder = tmp_path / "mesh"
    folder.mkdir()
    (folder / "nodes.inp").write_text("*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n")
    (folder / "elements.dat").write_text("1, 1, 2,\n 3, 4\n")
    (tmp_path / "main.inp").write_text(
        "*Include, Input=mesh/nodes.inp\n*ELEMENT, TYPE=C3D4, INPUT=mesh/elements.dat, ELSET=a\n"
    )
    mesh = read_abaqus(tmp_path / "main.inp", 1.0).mesh

    assert corner_volume(mesh) == pytest.approx(1 / 6, rel=1e-12)
    assert mesh.solids == ("a",)
