"""Damaged mesh files: a clear error or a mesh, and never anything else.

Every reader meets files that are cut off at any place, have flipped bytes, shuffled lines, huge
counts, Windows line ends, or are noise from the first byte on.
"""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from klack.errors import InputError
from klack.mesh.files.catalogue import MESH_FORMATS
from klack.mesh.files.mesh_file import read_mesh_file

CDB = """/COM,ANSYS RELEASE
/UNITS,MPA
/PREP7
ET,1,186
ET,2,200
KEYOP,2,1,6
NBLOCK,6,SOLID,         8,         8
(3i9,6e21.13e3)
        1        0        0 0.0000000000000E+000
        2        0        0 2.0000000000000E+000
        3        0        0 2.0000000000000E+000 3.0000000000000E+000
        4        0        0 0.0000000000000E+000 3.0000000000000E+000
        5        0        0 0.0000000000000E+000 0.0000000000000E+000 4.0000000000000E+000
        6        0        0 2.0000000000000E+000 0.0000000000000E+000 4.0000000000000E+000
        7        0        0 2.0000000000000E+000 3.0000000000000E+000 4.0000000000000E+000
        8        0        0 0.0000000000000E+000 3.0000000000000E+000 4.0000000000000E+000
N,R5.3,LOC,       -1,
EBLOCK,19,SOLID,         2,         2
(19i4)
   1   1   1   1   0   0   0   0  20   0   1   1   2   3   4   5   6   7   8
   0   0   0   0   0   0   0   0   0   0   0   0
   1   2   1   1   0   0   0   0   4   0   2   1   4   8   5
  -1
CMBLOCK,SIDE    ,ELEM,       1
(8i10)
         2
CMBLOCK,BASE    ,NODE,       2
(8i10)
         1        -4
MPDATA,R5.0, 1,EX  ,       1, 1, 7.000000000E+10,
MPDATA,R5.0, 1,NUXY,       1, 1, 0.350000000    ,
FINISH
"""

BDF = """$ANSA_NAME_COMMENT;1;PSOLID;nadel \u00e4;
SOL 103
CEND
SET 3 = 1 THRU 4
BEGIN BULK
CORD2R         2       0      0.      0.      0.      0.      0.      1.+
+             1.      0.      0.
GRID           1       0      0.      0.      0.
GRID           2       0     2.0      0.      0.
GRID,3,2,2.,3.,0.
GRID           4       0      0.     3.0      0.
GRID*                  5               0             0.0             0.0*
*                  4.0+0
GRID*                  6               0             2.0             0.0*
*                    4.0
GRID*,7,,2.,3.
*,4.
GRID           8       0      0.     3.0   40.-1
CHEXA          1       1       1       2       3       4       5       6+
+              7       8
CQUAD4         2       2       1       4       8       5
PSOLID         1       1
MAT1           1  2.1+5              0.3  7.8-9
SET1           9       5    THRU       8
ENDDATA
"""

MSH2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
3 1 "nadel \u00e4"
2 2 "left"
$EndPhysicalNames
$Nodes
8
1 0 0 0
2 2 0 0
3 2 3 0
4 0 3 0
5 0 0 4
6 2 0 4
7 2 3 4
8 0 3 4
$EndNodes
$Elements
2
1 5 2 1 1 1 2 3 4 5 6 7 8
2 3 2 2 2 1 4 8 5
$EndElements
"""

MSH4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
0 0 1 1
2 0 0 0 1 1 1 1 2 0
1 0 0 0 1 1 1 1 1 1 2
$EndEntities
$Nodes
1 8 1 8
3 1 0 8
1
2
3
4
5
6
7
8
0 0 0
2 0 0
2 3 0
0 3 0
0 0 4
2 0 4
2 3 4
0 3 4
$EndNodes
$Elements
2 2 1 2
3 1 5 1
1 1 2 3 4 5 6 7 8
2 2 3 1
2 1 4 8 5
$EndElements
"""

VTK = """# vtk DataFile Version 3.0
nadel
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 8 double
0 0 0 2 0 0 2 3 0 0 3 0
0 0 4 2 0 4 2 3 4 0 3 4
CELLS 2 14
8 0 1 2 3 4 5 6 7
4 0 3 7 4
CELL_TYPES 2
12
9
CELL_DATA 2
SCALARS solid int 1
LOOKUP_TABLE default
1 2
POINT_DATA 8
FIELD sets 1
base 1 8 int
1 1 1 1 0 0 0 0
"""

VTU = """<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="8" NumberOfCells="2">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">
0 0 0 2 0 0 2 3 0 0 3 0 0 0 4 2 0 4 2 3 4 0 3 4
</DataArray></Points>
<Cells>
<DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3 4 5 6 7 0 3 7 4</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">8 12</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">12 9</DataArray>
</Cells>
<CellData><DataArray type="Int32" Name="solid" format="ascii">1 2</DataArray></CellData>
</Piece></UnstructuredGrid></VTKFile>
"""


def written(writer: Callable[[Path], None]) -> Callable[[Path], bytes]:
    def make(path: Path) -> bytes:
        writer(path)
        return path.read_bytes()

    return make


def meshio_file(form: str, **options) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        meshio = pytest.importorskip("meshio")
        points = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]], float)
        points = np.vstack([points, points + np.array([0, 0, 4])])
        data = {"solid": [np.array([1])]}
        if form.startswith("gmsh"):
            data = {"gmsh:physical": [np.array([1])], "gmsh:geometrical": [np.array([1])]}
        mesh = meshio.Mesh(points, [("hexahedron", [list(range(8))])], cell_data=data)
        meshio.write(path, mesh, file_format=form, **options)

    return write


def vtk_appended(path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    pyvista.ImageData(dimensions=(2, 2, 2)).cast_to_unstructured_grid().save(path)


SAMPLES: dict[str, tuple[str, str | Callable[[Path], bytes]]] = {
    "cdb": ("a.cdb", CDB),
    "bdf": ("a.bdf", BDF),
    "msh 2": ("a.msh", MSH2),
    "msh 4": ("a.msh", MSH4),
    "vtk": ("a.vtk", VTK),
    "vtu": ("a.vtu", VTU),
    "msh 2 binary": ("a.msh", written(meshio_file("gmsh22", binary=True))),
    "msh 4 binary": ("a.msh", written(meshio_file("gmsh", binary=True))),
    "vtk 4.2 binary": ("a.vtk", written(meshio_file("vtk42", binary=True))),
    "vtk 5.1 binary": ("a.vtk", written(meshio_file("vtk51", binary=True))),
    "vtu zlib": ("a.vtu", written(meshio_file("vtu", compression="zlib"))),
    "vtu lzma": ("a.vtu", written(meshio_file("vtu", compression="lzma"))),
    "vtu appended": ("a.vtu", written(vtk_appended)),
}


def content(form: str, folder: Path) -> tuple[Path, bytes]:
    name, sample = SAMPLES[form]
    path = folder / name
    return path, sample.encode() if isinstance(sample, str) else sample(path)


def volume(path: Path, data: bytes) -> float | None:
    """Extent product of the mesh, or None where the file is refused."""
    path.write_bytes(data)
    try:
        mesh = read_mesh_file(path, 1e-3).mesh
    except InputError:
        return None
    assert np.isfinite(mesh.points).all()
    return float(np.prod(np.ptp(mesh.points, axis=0)))


@pytest.fixture(params=SAMPLES)
def sample(request, tmp_path) -> tuple[Path, bytes]:
    return content(request.param, tmp_path)


def test_whole_file_is_read(sample) -> None:
    path, data = sample
    assert volume(path, data) in (pytest.approx(24e-9), pytest.approx(1e-9))


def test_cut_off(sample) -> None:
    """A file that ends early is refused, unless only what says nothing of the mesh is lost."""
    path, data = sample
    whole = volume(path, data)
    refused = 0
    for end in range(0, len(data), max(1, len(data) // 50)):
        found = volume(path, data[:end])
        refused += found is None
        assert found is None or found == pytest.approx(whole)
    assert refused > 15


def test_flipped_bytes(sample) -> None:
    path, data = sample
    for seed in range(40):
        noise = random.Random(seed)
        damaged = bytearray(data)
        for _ in range(noise.choice((1, 3, 30))):
            damaged[noise.randrange(len(data))] = noise.randrange(256)
        volume(path, bytes(damaged))


def test_shuffled_lines(sample) -> None:
    path, data = sample
    for seed in range(10):
        lines = data.split(b"\n")
        random.Random(seed).shuffle(lines)
        volume(path, b"\n".join(lines))


def test_lines_left_out_or_twice(sample) -> None:
    path, data = sample
    lines = data.split(b"\n")
    for i in range(min(len(lines), 25)):
        volume(path, b"\n".join([*lines[:i], *lines[i + 1 :]]))
        volume(path, b"\n".join([*lines[:i], lines[i], *lines[i:]]))


@pytest.mark.parametrize("huge", [b"999999999", b"99999999999999", b"-1", b"0", b"1e300", b"nan"])
def test_huge_counts(sample, huge: bytes) -> None:
    """Any number replaced by one that is huge, negative or none at all."""
    path, data = sample
    number = [i for i in range(1, len(data)) if data[i : i + 1].isdigit()]
    for at in number[:: max(1, len(number) // 10)]:
        volume(path, data[:at] + huge + data[at + 1 :])


@pytest.mark.parametrize("form", ["cdb", "bdf", "msh 2", "msh 4", "vtk", "vtu"])
def test_windows_line_ends(form: str, tmp_path: Path) -> None:
    path, data = content(form, tmp_path)
    assert volume(path, data.replace(b"\n", b"\r\n")) == pytest.approx(24e-9)


@pytest.mark.parametrize("ending", [ending for ending in MESH_FORMATS if ending != ".inp"])
def test_noise(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    assert volume(path, b"") is None
    for seed in range(15):
        noise = random.Random(seed)
        assert volume(path, noise.randbytes(noise.randrange(1, 3000))) is None
        text = bytes(noise.choice(b" \n0123456789.,+-*$GRIDCTEABLOK/()<>\"'") for _ in range(800))
        assert volume(path, text) is None


@pytest.mark.parametrize(
    ("whole", "other"),
    [("$Nodes\n1 8 1 8", "$Nodes\n1 9 1 9"), ("$Elements\n2 2", "$Elements\n2 3")],
)
def test_blocks_of_less_than_their_section_counts(whole: str, other: str, tmp_path: Path) -> None:
    assert whole in MSH4
    assert volume(tmp_path / "a.msh", MSH4.replace(whole, other).encode()) is None


def test_packed_data_that_would_be_huge(tmp_path: Path) -> None:
    """A small file that says it holds 2 GB is refused before they are unpacked."""
    path, data = content("vtu zlib", tmp_path)
    big = data.replace(b'NumberOfPoints="8"', b'NumberOfPoints="90000000"')
    assert big != data
    assert volume(path, big) is None


def test_cards_behind_the_end_are_refused(tmp_path: Path) -> None:
    """ENDDATA in the middle would leave elements out without a word."""
    lines = BDF.splitlines()
    last = next(k for k, line in enumerate(lines) if line.startswith("CHEXA"))
    path = tmp_path / "a.bdf"
    path.write_text("\n".join([*lines[:last], "ENDDATA", *lines[last:-1]]), "latin-1")
    with pytest.raises(InputError, match="CHEXA after ENDDATA"):
        read_mesh_file(path, 1e-3)
    path.write_text(BDF + "\nsome words\n", "latin-1")
    read_mesh_file(path, 1e-3)


def test_a_misspelt_generate_is_refused(tmp_path: Path) -> None:
    """The first, the last and the step of a range would be three members."""
    deck = "*NODE\n" + "".join(
        f"{k + 1},{x},{y},{z}\n"
        for k, (x, y, z) in enumerate(
            [(0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 0), (0, 0, 4), (2, 0, 4), (2, 3, 4), (0, 3, 4)]
        )
    )
    deck += (
        "*ELEMENT, TYPE=C3D8, ELSET=BODY\n1,1,2,3,4,5,6,7,8\n*NSET, NSET=BASE, GEENRATE\n1,4,1\n"
    )
    path = tmp_path / "a.inp"
    path.write_text(deck)
    with pytest.raises(InputError, match=r"a\.inp:12: \*NSET: got GEENRATE"):
        read_mesh_file(path, 1e-3)
    path.write_text(deck.replace("GEENRATE", "generate"))
    assert read_mesh_file(path, 1e-3).mesh.node_sets.keys() >= {"BASE"}
