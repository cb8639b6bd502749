"""Decks that hold more than solids, and files that are something else than their ending says.

Truth: the volume of the one tetrahedron that every deck holds, 1/6 mm^3, and the numbers of other
elements that were written into it by hand.
"""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from doubts import doubts

from klack.bodies.model_files.matrices import read_matrix
from klack.cli.main import main
from klack.errors import AccuracyWarning, InputError
from klack.measurement.files.opening import open_recording
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.quality import corner_volume

MM = 1e-3
NODES = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 2, 0), (3, 2, 1))

ABAQUS = """*NODE
{nodes}
*ELEMENT, TYPE=C3D4, ELSET=body
1, 1, 2, 3, 4
*ELEMENT, TYPE=B31, ELSET=beams
10, 4, 5
11, 5, 6
*ELEMENT, TYPE=B31, ELSET=turned
12, 4, 6, 1
*ELEMENT, TYPE=SPRINGA, ELSET=springs
20, 4, 5
*ELEMENT, TYPE=MASS, ELSET=masses
30, 6
31, 5
*ELEMENT, TYPE=S3, ELSET=skin
40, 1, 3, 2
*ELEMENT, TYPE=S3, ELSET=sail
41, 4, 5, 6
*ELEMENT, TYPE=S9R5, ELSET=sail
42, 4, 5, 6, 1, 2, 3, 4, 5, 6
*ELSET, ELSET=everything
body, beams, springs, masses, sail
*SOLID SECTION, ELSET=body, MATERIAL=steel
*MATERIAL, NAME=steel
*ELASTIC
210000., 0.3
*MATERIAL, NAME=ply
*ELASTIC, TYPE=ENGINEERING CONSTANTS
1., 2., 3., 0.1, 0.1, 0.1, 1., 1.
1.
""".format(nodes="\n".join(f"{i}, {x}., {y}., {z}." for i, (x, y, z) in enumerate(NODES, 1)))

NASTRAN = "\n".join(
    [
        *(f"GRID,{i},,{x}.,{y}.,{z}." for i, (x, y, z) in enumerate(NODES, 1)),
        "CTETRA,1,1,1,2,3,4",
        "CBAR,10,2,4,5,1.,0.,0.",
        "CBAR,11,2,5,6,1.,0.,0.",
        "CELAS2,20,100.,4,1,5,1",
        "CONM2,30,6,,0.1",
        "RBE2,50,4,123,5,6",
        "CTRIA3,40,7,1,3,2",
        "CTRIA3,41,8,4,5,6",
        "MAT9,5,1.,2.,3.",
        "ENDDATA",
    ]
)


def _archive() -> str:
    types = ("ET,1,185", "ET,2,188", "ET,3,14", "ET,4,21", "ET,5,181", "ET,6,154")
    rows = (
        (1, [1, 2, 3, 3, 4, 4, 4, 4]),
        (2, [4, 5, 1]),
        (2, [5, 6, 1]),
        (3, [4, 5]),
        (4, [6]),
        (5, [4, 5, 6, 6]),
        (6, [1, 3, 2, 2]),
    )
    lines = ["/PREP7", *types, f"NBLOCK,3,,6,{len(NODES)}", "(1i8,3e20.9)"]
    lines += [f"{i:8d}" + "".join(f"{v:20.9e}" for v in x) for i, x in enumerate(NODES, 1)]
    lines += ["N,R5.3,LOC,-1,", f"EBLOCK,19,SOLID,,{len(rows)}", "(19i8)"]
    for number, (kind, nodes) in enumerate(rows, 1):
        row = [1, kind, 1, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
        lines.append("".join(f"{v:8d}" for v in row))
    lines += ["      -1", "MP,EX,1,2.1E11", "MP,EY,1,1.1E11", "MP,PRXY,1,0.3"]
    return "\n".join([*lines, "MP,EX,2,2.1E11", "MP,PRXY,2,0.3", ""])


GMSH = "\n".join(
    [
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes",
        str(len(NODES)),
        *(f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(NODES, 1)),
        "$EndNodes\n$Elements\n4",
        "1 4 2 1 1 1 2 3 4",
        "2 2 2 5 1 1 3 2",
        "3 2 2 6 1 4 5 6",
        "4 1 2 7 1 5 6",
        "$EndElements\n",
    ]
)

VTK = "\n".join(
    [
        "# vtk DataFile Version 3.0\nparts\nASCII\nDATASET UNSTRUCTURED_GRID",
        f"POINTS {len(NODES)} double",
        *(f"{x} {y} {z}" for x, y, z in NODES),
        "CELLS 4 18\n4 0 1 2 3\n3 0 2 1\n3 3 4 5\n4 3 4 5 1",
        "CELL_TYPES 4\n10\n5\n5\n7\n",
    ]
)

SHELLS = "surface elements that are not on a solid"
DECKS: dict[str, tuple[str, dict[str, int], str]] = {
    "abaqus.inp": (
        ABAQUS,
        {"B31": 3, "SPRINGA": 1, "MASS": 2, "S3": 1, "S9R5": 1},
        "got TYPE=",
    ),
    "nastran.bdf": (NASTRAN, {"CBAR": 2, "CELAS2": 1, "CONM2": 1, "RBE2": 1, SHELLS: 1}, "CBAR"),
    "ansys.cdb": (
        _archive(),
        {"BEAM188": 2, "COMBIN14": 1, "MASS21": 1, "SHELL181": 1},
        "element 2: got BEAM188",
    ),
    "gmsh.msh": (GMSH, {SHELLS: 1}, "element 3"),
    "grid.vtk": (VTK, {"polygons": 1, SHELLS: 1}, "got polygons"),
}


@pytest.fixture(params=DECKS)
def deck(request, tmp_path) -> tuple[Path, dict[str, int], str]:
    text, counts, words = DECKS[request.param]
    path = tmp_path / request.param
    path.write_text(text)
    return path, counts, words


def test_the_solids_are_read_and_the_others_counted(deck):
    path, counts, _ = deck

    with doubts() as texts:
        model = read_mesh_file(path, MM, solids_only=True)

    assert model.left_out == counts
    assert corner_volume(model.mesh) == pytest.approx(1e-9 / 6, rel=1e-12)
    assert model.mesh.node_count == 4
    (told,) = texts
    assert "left out" in told
    assert all(f"{count} {kind}" in told for kind, count in counts.items())


@pytest.mark.parametrize(
    ("name", "surface_name"),
    [
        ("abaqus.inp", "skin"),
        ("nastran.bdf", "pshell_7"),
        ("gmsh.msh", "surface_5"),
        ("grid.vtk", "surface"),
    ],
)
def test_a_skin_on_the_solid_is_still_a_surface(name, surface_name, tmp_path):
    path = tmp_path / name
    path.write_text(DECKS[name][0])

    with pytest.warns(AccuracyWarning):
        mesh = read_mesh_file(path, MM, solids_only=True).mesh

    surface = mesh.surfaces[surface_name]
    assert surface.face_count == 1
    assert np.ptp(mesh.points[surface.nodes, 2]) == 0.0


def test_without_the_key_the_error_names_it(deck):
    path, _, words = deck

    with pytest.raises(InputError, match="elements: solids-only") as caught:
        read_mesh_file(path, MM)

    assert words in str(caught.value)


def test_a_deck_of_solids_alone_has_no_note(tmp_path):
    path = tmp_path / "a.bdf"
    path.write_text(NASTRAN.partition("CBAR")[0] + "ENDDATA\n")

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_mesh_file(path, MM, solids_only=True).left_out == {}


HOLES: dict[str, Callable[[], str]] = {
    "a.inp": lambda: ABAQUS.replace("TYPE=MASS", "TYPE=C3D5"),
    "b.inp": lambda: ABAQUS.replace("TYPE=MASS", "TYPE=GK3D8"),
    "a.bdf": lambda: NASTRAN.replace("CONM2,30,6,,0.1", "CPYRAM,30,1,1,2,5,3,4"),
    "a.cdb": lambda: _archive().replace("ET,4,21", "ET,4,65"),
    "a.vtk": lambda: VTK.replace("\n7\n", "\n14\n"),
}


@pytest.mark.parametrize("name", HOLES)
def test_a_volume_that_klack_does_not_know_is_no_element_to_leave_out(name, tmp_path):
    path = tmp_path / name
    path.write_text(HOLES[name]())

    with pytest.raises(InputError) as caught:
        read_mesh_file(path, MM, solids_only=True)

    assert "solids-only" not in str(caught.value)


CASE = """\
klack: 1
title: Pin on a block
materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  pin:
    geometry: {mesh: {file: nastran.bdf, unit: mm, elements: %s}}
    material: steel
  block:
    geometry: {mesh: {file: nastran.bdf, unit: mm, elements: solids-only}}
    material: steel
    fixed: [{surface: pshell_7}]
contact: {between: [pin.pshell_7, block.pshell_7], gap: 0 um}
motion: {speed: 1 m/s}
run: {duration: 10 us}
"""


def test_the_key_of_the_case(tmp_path, capsys):
    (tmp_path / "nastran.bdf").write_text(NASTRAN)
    case = tmp_path / "case.yaml"

    case.write_text(CASE % "solids-only")
    assert main(["inspect", str(case)]) == 0
    assert "2 CBAR" in capsys.readouterr().err

    case.write_text(CASE % "all")
    assert main(["inspect", str(case)]) == 2
    assert "elements: solids-only" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("abaqus.inp", "ply anisotropic (*ELASTIC, TYPE=ENGINEERING CONSTANTS)"),
        ("nastran.bdf", "mat9_5 anisotropic (MAT9)"),
        ("ansys.cdb", "material_1 orthotropic (MP, EX, EY, EZ differ)"),
    ],
)
def test_inspect_shows_materials_that_klack_does_not_compute(name, words, tmp_path, capsys):
    """Young's modulus of one direction is not that of the material."""
    path = tmp_path / name
    path.write_text(DECKS[name][0])

    assert main(["inspect", str(path), "--unit", "mm"]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert f"material {words}; klack computes isotropic materials only" in shown
    assert "material material_1 E" not in shown
    assert "left out" in shown


# --------------------------------------------------------------------------- something else


@pytest.mark.parametrize("name", ["needle.dat", "needle.inp"])
@pytest.mark.parametrize(
    "text",
    [
        "/PREP7\nET,1,187\nBLOCK,0,1,0,1,0,1\nVMESH,ALL\nFINISH\n",
        "finish\n/clear\n  et , 1 , 187\n",
        "! needle\nK,1,0,0\nK,2,1,0\n",
    ],
)
def test_a_script_of_ansys_is_no_mesh(name, text, tmp_path):
    path = tmp_path / name
    path.write_text(text)

    with pytest.raises(InputError, match=r"commands of ANSYS \(MAPDL\)[\s\S]*CDWRITE"):
        read_mesh_file(path, MM)


@pytest.mark.parametrize("spare", [",", ",,", ", ,", ",,,"])
def test_spare_commas_behind_coordinates(spare, tmp_path):
    nodes = "\n".join(f"{i}, {x}., {y}., {z}.{spare}" for i, (x, y, z) in enumerate(NODES, 1))
    path = tmp_path / "a.inp"
    path.write_text(f"*NODE\n{nodes}\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n")

    assert corner_volume(read_mesh_file(path, MM).mesh) == pytest.approx(1e-9 / 6, rel=1e-12)


POINTER = (
    "version https://git-lfs.github.com/spec/v1\n"
    "oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n"
)


ENDINGS = "inp cdb bdf dat msh vtk vtu step full mtx mat fmu".split()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_pointer_of_git_is_no_file(ending, tmp_path, capsys):
    path = tmp_path / f"a.{ending}"
    path.write_text(POINTER)

    assert main(["inspect", str(path)]) == 2

    told = capsys.readouterr().err
    assert "a git-LFS pointer" in told
    assert "git lfs pull" in told


def test_a_case_that_names_a_pointer(tmp_path, capsys):
    (tmp_path / "nastran.bdf").write_text(POINTER)
    case = tmp_path / "case.yaml"
    case.write_text(CASE % "all")

    assert main(["inspect", str(case)]) == 2

    assert "bodies.pin.geometry.mesh.file: got a git-LFS pointer" in capsys.readouterr().err


def test_a_recording_that_is_a_pointer(tmp_path):
    path = tmp_path / "strokes.csv"
    path.write_text(POINTER)

    with pytest.raises(InputError, match="a git-LFS pointer"):
        open_recording(path)


@pytest.mark.parametrize("values", [np.eye(3), np.array([[1.0 + 2.0j, 3.0]]), "text"])
def test_a_file_of_matlab_4_is_named(values, tmp_path):
    """Truth: SciPy writes version 4."""
    path = tmp_path / "old.mat"
    scipy.io.savemat(path, {"K_1": values}, format="4")

    for read in (read_matrix, open_recording):
        with pytest.raises(InputError, match="a MATLAB file of version 4, expected version 5"):
            read(path)


def test_noise_is_not_matlab_4(tmp_path):
    rng, path, named = np.random.default_rng(3), tmp_path / "old.mat", 0
    for size in (20, 40, 300):
        for _ in range(100):
            path.write_bytes(rng.bytes(size))
            with pytest.raises(InputError) as caught:
                read_matrix(path)
            named += "version 4" in caught.value.got
    assert named == 0
