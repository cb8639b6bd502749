"""Sets, surfaces and text of Abaqus files in all their notations.

Truth: exact.  A row of four unit cubes and a wedge on top, numbered by hand.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.errors import InputError
from klack.mesh.files.abaqus.deck import read_deck
from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.mesh import Mesh
from klack.mesh.quality import corner_volume

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


def numbers(path: Path, text: str, name: str) -> list[int]:
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
    assert numbers(tmp_path / "x.inp", ROW + text, "s") == expected


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
    with pytest.raises(InputError, match=r"got TYPE=CAX4P(?s:.*)meshio writes quadrilaterals so"):
        read(tmp_path / "cube.inp", text)
