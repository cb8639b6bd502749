"""Abaqus and CalculiX files: geometry, sets, faces, parts and instances.

Reader of Abaqus and CalculiX files: geometry, sets, faces.

Truth: exact.  Face numbers S1..S6 as in the Abaqus and CalculiX manuals, written out here by corner
numbers and independent of the tables in klack.

Sets, surfaces and text of Abaqus files in all their notations.

Truth: exact.  A row of four unit cubes and a wedge on top, numbered by hand.

Parts, instances and assemblies of Abaqus files.

Truth: exact.  Volumes and places of boxes that are moved and turned by hand.
"""

from pathlib import Path

import numpy as np
import pytest
from doubts import doubts

from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.deck import read_deck
from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.files.mesh_model import MeshModel
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


CUBES = 4
# Node 10 x + k: corner k = 1..4 of the section at x.
NODES = "".join(
    f"{10 * x + k}, {x}., {y}., {z}.\n"
    for x in range(CUBES + 1)
    for k, (y, z) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)], start=1)
)
ROW = (
    "*NODE, NSET=Nall\n"
    + NODES
    + "*ELEMENT, TYPE=C3D8, ELSET=row\n"
    + "".join(
        f"{100 * (x + 1)}, {10 * x + 1}, {10 * x + 11}, {10 * x + 12}, {10 * x + 2},\n"
        f"  {10 * x + 4}, {10 * x + 14}, {10 * x + 13}, {10 * x + 3}\n"
        for x in range(CUBES)
    )
)


def read(path: Path, text: str | bytes) -> Mesh:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_abaqus(path, 1.0).mesh


def numbers_sets(path: Path, text: str, name: str) -> list[int]:
    """File numbers of a node set."""
    path.write_text(text)
    model = read_abaqus(path, 1.0)
    return model.node_numbers[model.mesh.node_sets[name]].tolist()


SETS = {
    "unsorted and twice": ("*NSET, NSET=s, UNSORTED\n12, 1, 3\n 3, 1\n", [1, 3, 12]),
    "range": ("*NSET, NSET=s, GENERATE\n1, 3\n11, 31, 10\n", [1, 2, 3, 11, 21, 31]),
    "range with gaps": ("*NSET, NSET=s, GENERATE\n4, 12\n", [4, 11, 12]),
    "wide range": ("*NSET, NSET=s, GENERATE\n41, 900000000000000, 1\n", [41, 42, 43, 44]),
    "sparse range": ("*NSET, NSET=s, GENERATE\n1, 900000000000000, 20\n", [1, 21, 41]),
    "in two keywords": ("*NSET, NSET=s\n1\n*NSET, NSET=S\n2,\n", [1, 2]),
    "of sets": (
        "*NSET, NSET=a, INTERNAL\n1, 2\n*NSET, NSET=b\n3\n*NSET, NSET=s\nA, 4, b\n",
        [1, 2, 3, 4],
    ),
    "of elements": (
        "*ELSET, ELSET=e, GENERATE\n100, 200, 100\n*NSET, NSET=s, ELSET=e\n",
        [1, 2, 3, 4, 11, 12, 13, 14, 21, 22, 23, 24],
    ),
    "with comments": ("*NSET, NSET=s\n1,\n** 2\n\n3\n", [1, 3]),
    "quoted": ('*NSET, NSET="a, b"\n1\n*NSET, NSET=s\n"a, b", 2\n', [1, 2]),
    "named like a number": ("*NSET, NSET=77\n1\n*NSET, NSET=s\n77, 2\n", [1, 2]),
    "over two lines": ("*NSET,\n NSET=s\n4\n", [4]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), SETS.values(), ids=SETS.keys())
def test_node_sets(tmp_path, text, expected):
    assert numbers_sets(tmp_path / "x.inp", ROW + text, "s") == expected


SURFACES = {
    "numbers": ("100, S6\n200, S1\n", 2, [-1, 0, -1]),
    "set and number": ("row, S1\n400, S4\n", 5, [1, 0, -4]),
    "set whole": ("row,\n", 18, [0, 0, 0]),
    "set in part": ("first,\n", 5, [-1, 0, 0]),
    # all corners of the cube between belong to the set, its faces do not
    "set with a gap": ("odd,\n", 9, [-1, 0, 0]),
    "number whole": ("400\n", 5, [1, 0, 0]),
    "twice the same": ("100, S6\nfirst, S6\n", 1, [-1, 0, 0]),
}


@pytest.mark.parametrize(("text", "count", "area"), SURFACES.values(), ids=SURFACES.keys())
def test_surfaces(tmp_path, text, count, area):
    sets = "*ELSET, ELSET=first\n100\n*ELSET, ELSET=odd\n100, 300\n"
    mesh = read(tmp_path / "x.inp", ROW + sets + "*SURFACE, NAME=s\n" + text)
    surface = mesh.surface("s")

    total = np.zeros(3)
    for block in surface.blocks:
        x = mesh.points[block.connectivity]
        total += np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]).sum(axis=0) / 2
    assert surface.face_count == count
    np.testing.assert_allclose(total, area, atol=1e-15)


def test_surface_elements_name_faces_in_every_way(tmp_path):
    """A membrane on the face at x = 0, another between two cubes."""
    markers = (
        "*ELEMENT, TYPE=M3D4, ELSET=end\n7, 1, 2, 3, 4\n"
        "*ELEMENT, TYPE=M3D4, ELSET=inside\n8, 21, 22, 23, 24\n"
        "*SURFACE, NAME=up\nend, SPOS\n*SURFACE, NAME=down\n7, SNEG\n"
        "*SURFACE, NAME=faces\n400, S4\n*SURFACE, NAME=all, COMBINE=UNION\nup, faces\n"
    )
    mesh = read(tmp_path / "x.inp", ROW + markers)

    assert set(mesh.surfaces) == {"end", "up", "down", "all", "faces"}
    assert all(mesh.surface(n).face_count == 1 for n in ("end", "up", "down", "faces"))
    assert sorted(set(mesh.points[mesh.surface("all").nodes, 0].tolist())) == [0.0, 4.0]
    assert np.all(mesh.points[mesh.node_sets["inside"], 0] == 2.0)
    assert corner_volume(mesh) == pytest.approx(4.0, rel=1e-12)


def test_several_families_in_one_solid(tmp_path):
    """Cubes, and a wedge of half their height on the last one."""
    wedge = (
        "*NODE\n51, 3., 0.5, 1.5\n52, 4., 0.5, 1.5\n"
        "*ELEMENT, TYPE=C3D6, ELSET=roof\n1, 34, 33, 51, 44, 43, 52\n"
        "*ELSET, ELSET=house\nrow, roof\n*SURFACE, NAME=skin\nhouse,\n"
    )
    mesh = read(tmp_path / "x.inp", ROW + wedge)

    assert mesh.solids == ("house",)
    assert {block.family for block in mesh.blocks} == {"hex8", "wedge6"}
    assert corner_volume(mesh) == pytest.approx(4.25, rel=1e-12)
    assert mesh.surface("skin").face_count == 18 + 3


@pytest.mark.parametrize("line_end", ["\r\n", "\r", "\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_line_ends_and_letters(tmp_path, line_end, encoding):
    text = ROW + "*NSET, NSET=Sitzfläche\n1, 2\n*SURFACE, NAME=Düse Ø3, TYPE=NODE\nSITZFLÄCHE,\n"
    mesh = read(tmp_path / "x.inp", text.replace("\n", line_end).encode(encoding))

    assert mesh.node_sets["Sitzfläche"].tolist() == [0, 1]
    assert mesh.node_sets["Düse Ø3"].tolist() == [0, 1]


def test_digits_are_read_to_the_last_bit(tmp_path):
    """Seventeen digits, Fortran exponents, signs and blanks; as Python reads them."""
    texts = ["0.1", "+1.7976931348623157e-5", " -2.2250738585072014E-8 ", "3.", ".5", "1.D0"]
    texts += ["7d-3", "4.35", "9007199254740993.", "123456789012345678e-17", "0.30000000000000004"]
    rows = np.arange(3 * 1000).reshape(1000, 3) % len(texts)
    lines = [f"{i}, " + ", ".join(texts[k] for k in row) for i, row in enumerate(rows, start=9)]
    tets = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
    exact = np.array([float(text.upper().replace("D", "E")) for text in texts])
    (tmp_path / "x.inp").write_text(tets + "*NODE\n" + "\n".join(lines) + "\n")
    points = np.concatenate(read_deck(tmp_path / "x.inp").scope.points)

    np.testing.assert_array_equal(points[4:], exact[rows])


def test_blocks_may_alternate_and_need_not_be_sorted(tmp_path):
    """One *NODE and one *ELEMENT per cube, the last cube first."""
    sections = NODES.splitlines(keepends=True)
    text = "*NODE\n" + "".join(sections[4 * CUBES :])
    for x in reversed(range(CUBES)):
        text += "*NODE\n" + "".join(sections[4 * x : 4 * x + 4])
        record = [x + 1, *(10 * x + k for k in (1, 11, 12, 2, 4, 14, 13, 3))]
        text += "*ELEMENT, TYPE=C3D8R, ELSET=row\n" + ", ".join(map(str, record)) + "\n"
    (tmp_path / "x.inp").write_text(text)
    model = read_abaqus(tmp_path / "x.inp", 1.0)

    assert model.node_numbers.tolist() == sorted(10 * x + k for x in range(5) for k in range(1, 5))
    assert model.element_numbers[0].tolist() == [4, 3, 2, 1]
    assert corner_volume(model.mesh) == pytest.approx(4.0, rel=1e-12)


def test_blocks_longer_than_a_piece(tmp_path, monkeypatch):
    """Records that are cut by the end of a piece are put together again."""
    whole = read(tmp_path / "x.inp", ROW)
    for size in (1, 7, 40, 90):
        monkeypatch.setattr("klack.mesh.files.abaqus.keywords._PIECE", size)
        cut = read(tmp_path / "x.inp", ROW)

        np.testing.assert_array_equal(cut.points, whole.points)
        np.testing.assert_array_equal(cut.blocks[0].connectivity, whole.blocks[0].connectivity)


def test_data_of_keywords_in_other_files(tmp_path):
    (tmp_path / "n.dat").write_text(NODES)
    (tmp_path / "e.dat").write_text(ROW.partition("ELSET=row\n")[2])
    mesh = read(
        tmp_path / "x.inp",
        "*NODE, NSET=all, INPUT=n.dat\n*ELEMENT, INPUT=.\\e.dat, TYPE=C3D8, ELSET=row\n",
    )

    assert corner_volume(mesh) == pytest.approx(4.0, rel=1e-12)
    assert len(mesh.node_sets["all"]) == 20


SYSTEMS = {
    "shift": ("1., 2., 3.\n", [[1, 2, 3], [2, 2, 3], [1, 3, 3], [1, 2, 4]]),
    # a point of the x axis above the plane z = 0: only its direction in the plane counts
    "turn about z": ("1., 2., 3., 1., 7., 9.\n", [[1, 2, 3], [1, 3, 3], [0, 2, 3], [1, 2, 4]]),
    # x along z, y in the plane of z and x; the point on that plane is not square to x
    "three points": (
        "1., 2., 3., 1., 2., 5.\n4., 2., 9.\n",
        [[1, 2, 3], [1, 2, 4], [2, 2, 3], [1, 3, 3]],
    ),
    "none": ("", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
}


@pytest.mark.parametrize(("text", "expected"), SYSTEMS.values(), ids=SYSTEMS.keys())
def test_nodes_in_a_frame(tmp_path, text, expected):
    mesh = read(
        tmp_path / "x.inp",
        "*SYSTEM\n9., 9., 9.\n*SYSTEM\n" + text + "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n"
        "*SYSTEM\n" + text + "*NODE\n4,0,0,1\n*ELEMENT, TYPE=C3D4, ELSET=e\n1, 1, 2, 3, 4\n",
    )

    np.testing.assert_allclose(mesh.points, expected, atol=1e-15)


def test_quadrilaterals_of_meshio_are_named_as_such(tmp_path):
    text = ROW + "*ELEMENT, TYPE=CAX4P\n7, 1, 2, 3, 4\n"
    with pytest.raises(
        InputError, match=r"got TYPE=CAX4P(?s:.*)meshio writes quadrilaterals like this"
    ):
        read(tmp_path / "cube.inp", text)


@pytest.mark.parametrize("tag", ["-3", "100", "99"])
def test_tags_of_gmsh_that_meshio_stores_as_a_set_are_left_out(tmp_path, tag):
    """They are numbers of bounding entities; some are those of elements too."""
    with doubts() as texts:
        mesh = read(tmp_path / "row.inp", f"{ROW}*ELSET, ELSET=gmsh:bounding_entities\n{tag}\n")

    assert mesh.solids == ("row",)
    (told,) = texts
    assert "ignored: *ELSET, ELSET=gmsh:bounding_entities (" in told


# A box 1 x 2 x 3 and a tetrahedron, as Abaqus/CAE writes parts: numbers from 1 in each.
BOX = """*Part, name=Box
*Node
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 2., 0.
4, 0., 2., 0.
5, 0., 0., 3.
6, 1., 0., 3.
7, 1., 2., 3.
8, 0., 2., 3.
*Element, type=C3D8R
1, 1, 2, 3, 4, 5, 6, 7, 8
*Nset, nset=Set-1, generate
1, 8, 1
*Elset, elset=Set-1
1,
*Elset, elset=_Top_S2, internal
1,
*Surface, type=ELEMENT, name=Top
_Top_S2, S2
*Solid Section, elset=Set-1, material=Steel
,
*End Part
"""
TET_INSTANCES = """*Part, name=Tet
*Node, nset=corners
1, 0., 0., 0.
2, 1., 0., 0.
3, 0., 1., 0.
4, 0., 0., 1.
*Element, type=C3D4, elset=Set-1
1, 1, 2, 3, 4
*Elset, elset=Only
1,
*Surface, type=NODE, name=Foot
1,
2, 1.
3,
*Solid Section, elset=Set-1, material=BRASS
*End Part
"""
ASSEMBLY = """*Assembly, name=Assembly
**
*Instance, name=Left, part=Box
*End Instance
*Instance, name=Right, part=Box
 5., 0., 0.
 5., 0., 0., 5., 0., 1., 90.
*End Instance
*Instance, name=Tip, part=TET
 0., 0., 10.
*End Instance
*Node
1, 7., 7., 7.
*Nset, nset=RP
1,
*Nset, nset=Mixed, instance=Right
1, 3
*Nset, nset=Mixed, instance=Tip
4,
*Nset, nset=Dotted
Left.1, Right.1, Tip.corners
*Nset, nset=OfElements, elset=Ends, instance=Tip
*Elset, elset=Both, internal, instance=Left
1,
*Elset, elset=Both, internal, instance=Right, generate
1, 1, 1
*Elset, elset=Nested
Both, Tip.Only
*Surface, type=ELEMENT, name=Under
Both, S1
*Surface, type=ELEMENT, name=Skin
Nested,
*Surface, name=Joined, combine=union
Left.Top, Right.Top
*End Assembly
*Material, name=Steel
*Elastic
210000., 0.3
*Material, name=Brass
*Elastic
105000., 0.34
"""
MODEL = (BOX + TET_INSTANCES + ASSEMBLY).replace(
    "elset=Ends, instance=Tip", "elset=Only, instance=Tip"
)


@pytest.fixture
def model(tmp_path) -> MeshModel:
    (tmp_path / "two.inp").write_text(MODEL)
    return read_abaqus(tmp_path / "two.inp", MM)


def sorted_points(points: np.ndarray) -> np.ndarray:
    rounded = np.round(points / MM, 9) + 0.0
    return rounded[np.lexsort(rounded.T)]


def area_vector(model: MeshModel, surface: Surface) -> np.ndarray:
    """Sum of normals times areas of quadrilaterals and triangles [mm^2]."""
    total = np.zeros(3)
    for block in surface.blocks:
        x = model.mesh.points[block.connectivity] / MM
        for k in range(1, x.shape[1] - 1):
            total += np.cross(x[:, k] - x[:, 0], x[:, k + 1] - x[:, 0]).sum(axis=0) / 2
    return total


def test_every_instance_stands_where_the_assembly_puts_it(model):
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=float)
    # a quarter turn about the vertical through (5, 0): (x, y) -> (5 - y, x - 5), after the shift
    right = np.column_stack([5 - box[:, 1], box[:, 0], box[:, 2]])
    tip = np.array([[0, 0, 10], [1, 0, 10], [0, 1, 10], [0, 0, 11]], dtype=float)

    mesh = model.mesh
    assert mesh.node_count == 20
    np.testing.assert_allclose(
        sorted_points(mesh.points), sorted_points(MM * np.vstack([box, right, tip]))
    )
    np.testing.assert_allclose(mesh.points[[0, 8, 16]], MM * np.array([box[0], right[0], tip[0]]))
    assert corner_volume(mesh) == pytest.approx((6 + 6 + 1 / 6) * MM**3, rel=1e-12)


def test_solids_have_their_instance_in_front_where_names_repeat(model):
    assert model.mesh.solids == ("Left.Set-1", "Right.Set-1", "Tip.Set-1")
    assert model.sections == {
        "Left.Set-1": "Steel",
        "Right.Set-1": "Steel",
        "Tip.Set-1": "Brass",
    }
    assert [block.family for block in model.mesh.blocks] == ["hex8", "hex8", "tet4"]


def test_numbers_that_repeat_are_counted_on(model):
    assert len(set(model.node_numbers.tolist())) == 20
    assert np.concatenate(model.element_numbers).tolist() == [1, 2, 3]


def test_sets_of_the_assembly_and_of_instances(model):
    sets = model.mesh.node_sets
    points = model.mesh.points / MM

    assert {"Left.Set-1", "Right.Set-1", "Tip.corners", "corners"} <= set(sets)
    assert "Set-1" not in sets  # two instances have one
    assert "RP" not in sets  # a point without element
    np.testing.assert_array_equal(sets["corners"], sets["Tip.corners"])
    np.testing.assert_allclose(
        sorted_points(points[sets["Mixed"]] * MM), [[5, 0, 0], [3, 1, 0], [0, 0, 11]], atol=1e-12
    )
    assert len(sets["Dotted"]) == 6
    np.testing.assert_array_equal(sets["OfElements"], sets["corners"])
    np.testing.assert_array_equal(points[sets["Foot"], 2], 10.0)


def test_surfaces_of_the_assembly_and_of_instances(model):
    mesh = model.mesh

    assert {"Left.Top", "Right.Top", "Tip.Foot", "Foot"} <= set(mesh.surfaces)
    assert "Top" not in mesh.surfaces
    np.testing.assert_allclose(area_vector(model, mesh.surface("Under")), [0, 0, -4], atol=1e-12)
    np.testing.assert_allclose(area_vector(model, mesh.surface("Joined")), [0, 0, 4], atol=1e-12)
    np.testing.assert_allclose(area_vector(model, mesh.surface("Foot")), [0, 0, -0.5])
    assert mesh.surface("Skin").face_count == 6 + 6 + 4
    np.testing.assert_allclose(area_vector(model, mesh.surface("Skin")), 0, atol=1e-12)


@pytest.mark.parametrize("name", ["Right.Set-1", "right.set-1", "Tip.Only"])
def test_one_instance_alone(tmp_path, name):
    (tmp_path / "two.inp").write_text(MODEL)
    if name == "Tip.Only":
        with pytest.raises(ValueError, match=r"one of: Left\.Set-1"):
            read_abaqus(tmp_path / "two.inp", MM, solids=(name,))
        return
    mesh = read_abaqus(tmp_path / "two.inp", MM, solids=(name,)).mesh

    assert mesh.solids == ("Right.Set-1",)
    assert mesh.node_count == 8
    assert mesh.points[:, 0].min() == pytest.approx(3 * MM)
    assert mesh.surface("Under").face_count == 1


def test_turn_about_a_slanted_axis_keeps_volume_and_axis(tmp_path):
    """The axis passes through two corners of the moved box: both stay, a third turns by 120 deg."""
    cube = BOX.replace("2.,", "1.,").replace("3.\n", "1.\n")
    placed = (
        "*Assembly, name=A\n*Instance, name=I, part=Box\n1., 1., 1.\n"
        "1., 1., 1., 2., 2., 2., 120.\n*End Instance\n*End Assembly\n"
    )
    (tmp_path / "cube.inp").write_text(cube + placed)
    mesh = read_abaqus(tmp_path / "cube.inp", 1.0).mesh

    assert mesh.solids == ("Set-1",)
    assert corner_volume(mesh) == pytest.approx(1.0, rel=1e-12)
    # x goes to y, y to z, z to x
    np.testing.assert_allclose(mesh.points[0], [1, 1, 1])
    np.testing.assert_allclose(mesh.points[6], [2, 2, 2])
    np.testing.assert_allclose(mesh.points[1], [1, 2, 1])
    np.testing.assert_allclose(mesh.points[3], [1, 1, 2])
    np.testing.assert_allclose(mesh.points[4], [2, 1, 1])


def test_single_instance_keeps_plain_names_and_numbers(tmp_path):
    assembly = (
        "*Assembly, name=A\n*Instance, name=I, part=Box\n*End Instance\n*Node\n1, 9., 9., 9.\n"
        "*Nset, nset=Set-1\n1,\n*Nset, nset=two, instance=I\n1, 2\n*End Assembly\n"
    )
    (tmp_path / "one.inp").write_text(BOX + assembly)
    model = read_abaqus(tmp_path / "one.inp", 1.0)

    assert model.node_numbers.tolist() == list(range(1, 9))
    assert model.mesh.solids == ("Set-1",)
    assert set(model.mesh.surfaces) == {"Top"}
    # the assembly's own Set-1 holds a point without element; that of the part is I.Set-1
    assert set(model.mesh.node_sets) == {"I.Set-1", "two"}


def test_instance_may_add_sets_to_its_part(tmp_path):
    assembly = (
        "*Instance, name=I, part=Box\n0., 0., 1.\n*Nset, nset=more\n7, 8\n*End Instance\n"
        "*Instance, name=J, part=Box\n0., 0., 9.\n*End Instance\n"
    )
    (tmp_path / "more.inp").write_text(BOX + assembly)
    mesh = read_abaqus(tmp_path / "more.inp", 1.0).mesh

    np.testing.assert_allclose(mesh.points[mesh.node_sets["more"], 2], 4.0)
    assert "J.more" not in mesh.node_sets


def test_part_without_assembly_is_taken_as_drawn(tmp_path):
    (tmp_path / "part.inp").write_text(TET_INSTANCES)

    mesh = read_abaqus(tmp_path / "part.inp", 1.0).mesh

    assert corner_volume(mesh) == pytest.approx(1 / 6, rel=1e-12)
    assert mesh.solids == ("Set-1",)


def test_ring_may_move_along_its_axis(tmp_path):
    ring = "*PART, NAME=r\n*NODE\n1,1,0\n2,2,0\n3,1,1\n*ELEMENT, TYPE=CAX3\n1,1,2,3\n*END PART\n"
    (tmp_path / "r.inp").write_text(
        ring + "*INSTANCE, NAME=i, PART=r\n0., 5.\n*END INSTANCE\n".replace("5.", "5., 0.")
    )
    mesh = read_abaqus(tmp_path / "r.inp", 1.0).mesh

    np.testing.assert_array_equal(mesh.points, [[1, 5], [2, 5], [1, 6]])


def test_transform_and_ties_are_passed_over_with_one_warning(tmp_path):
    extra = "*Transform, nset=Left.Set-1\n1.,0.,0.,0.,1.,0.\n*Tie, name=t\nUnder, Skin\n"
    (tmp_path / "two.inp").write_text(
        MODEL.replace("*End Assembly\n", extra + extra + "*End Assembly\n")
    )
    with doubts() as texts:
        mesh = read_abaqus(tmp_path / "two.inp", MM).mesh

    (text,) = texts
    line = MODEL[: MODEL.index("*End Assembly")].count("\n") + 1
    assert f"*TRANSFORM (two.inp:{line}), *TIE (two.inp:{line + 2})" in text
    assert corner_volume(mesh) == pytest.approx((6 + 6 + 1 / 6) * MM**3, rel=1e-12)
