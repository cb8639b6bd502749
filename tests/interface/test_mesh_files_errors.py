"""Mesh files that klack refuses: the text says where, what came and what to do."""

from pathlib import Path

import numpy as np
import pytest

from klack.errors import InputError
from klack.mesh.files.mesh_file import read_mesh_file

MM = 1e-3


def refusal(path: Path, text: str, unit: float | None = MM) -> str:
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_mesh_file(path, unit)
    return str(error.value)


TET_NODES = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0))


def bdf(*cards: str, nodes=TET_NODES) -> str:
    grid = [f"GRID,{i},,{x}.,{y}.,{z}." for i, (x, y, z) in enumerate(nodes, start=1)]
    return "\n".join([*grid, *cards, "ENDDATA"])


TETRA = "CTETRA,1,1,1,2,3,4"

NASTRAN = {
    "pyramid": (bdf("CPYRAM,7,1,1,2,5,3,4"), "a.bdf:6: CPYRAM 7: got a pyramid"),
    "beam": (bdf(TETRA, "CBAR,8,1,1,2"), "a.bdf:7: CBAR 8: got a beam or rod"),
    "rigid": (bdf(TETRA, "RBE2,8,1,123,2"), "RBE2 8: got a rigid or coupling element"),
    "shell": (bdf(TETRA, "CTRIA3,9,4,2,3,5"), "element 9 ('pshell_4'): got 1 surface elements"),
    "missing node": (bdf("CTETRA,1,1,1,2,3,9"), "element 1: got node 9, which the file does not"),
    "some mid nodes": (bdf("CTETRA,1,1,1,2,3,4,5"), "CTETRA 1: got 5 nodes, expected 4 corners"),
    "node twice": (bdf(TETRA, "GRID,2,,0.,0.,0."), "got node 2 for the second time"),
    "number": (bdf("CTETRA,1,1,1,2,3,x4"), "a.bdf:6: CTETRA: got 'x4', expected a whole number"),
    "coordinate": (bdf(TETRA, "GRID,8,,1..,0.,0."), "GRID: got '1..', expected a real number"),
    "no system": (bdf(TETRA, "GRID,8,5,1.,0.,0."), "coordinate system 5: got no CORD1 or CORD2"),
    "flat system": (
        bdf(TETRA, "GRID,8,5,1.,0.,0.", "CORD2R,5,,0.,0.,0.,0.,0.,1.", ",0.,0.,2."),
        "CORD2R: got three points on one line",
    ),
    "mark": (
        "GRID           1\nCTETRA         1       1       1       2       3       4"
        "                +A\n+B             5\nENDDATA\n",
        "a.bdf:3: got a continuation marked '+B      '",
    ),
    "include": (bdf("INCLUDE '../other.bdf'"), "INCLUDE: got the file '../other.bdf'"),
    "include itself": (bdf("INCLUDE 'a.bdf'"), "'a.bdf' for the second time"),
    "material": (bdf(TETRA, "MAT1,1,2.1e11"), "MAT1: got less than two of E, G and nu"),
    "inverted": (bdf("CTETRA,77,1,1,3,2,4"), "element 77 (tet4, solid 'psolid_1')"),
    "no elements": (bdf(), "got no solid elements"),
    "cut off": (bdf(TETRA).removesuffix("ENDDATA"), "got no ENDDATA behind its last line ('CTE"),
    "element twice": (bdf(TETRA, TETRA), "got element 1 for the second time"),
    "place twice": (
        bdf(TETRA, "CTETRA,9,2,2,3,1,4"),
        "element 9: got the corners of element 1 again, expected every element once",
    ),
}


@pytest.mark.parametrize("fault", NASTRAN)
def test_nastran(fault: str, tmp_path: Path) -> None:
    text, expected = NASTRAN[fault]
    assert expected in refusal(tmp_path / "a.bdf", text)


def cdb(rows: list[list[int]], kind: int = 185, tail: str = "") -> str:
    lines = ["/PREP7", f"ET,1,{kind}", "NBLOCK,3,,5,5", "(1i8,3e20.9)"]
    lines += [
        f"{i:8d}" + "".join(f"{v:20.9e}" for v in x) for i, x in enumerate(TET_NODES, start=1)
    ]
    lines += ["N,R5.3,LOC,-1,", f"EBLOCK,19,SOLID,,{len(rows)}", "(19i8)"]
    for number, nodes in enumerate(rows, start=1):
        row = [1, 1, 1, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
        lines.append("".join(f"{v:8d}" for v in row))
    return "\n".join([*lines, "      -1", tail, ""])


TET = [1, 2, 3, 3, 4, 4, 4, 4]

ANSYS = {
    "pyramid": (cdb([[1, 2, 5, 3, 4, 4, 4, 4]]), "a.cdb:13: element 1: got a pyramid"),
    "shell": (cdb([[1, 2, 5, 3]], kind=181), "element 1: got SHELL181"),
    "no type": (cdb([TET]).replace("ET,1,185", ""), "got type 1 without an ET command"),
    "repeated": (cdb([[1, 2, 2, 3, 4, 4, 4, 4]]), "got a pyramid"),
    "repeated pair": (cdb([[1, 1, 2, 3, 4, 4, 5, 5]]), "corner nodes with an unknown repetition"),
    "unblocked": ("/PREP7\nN,1,0.,0.,0.\n", "a.cdb:2: got 'N,1,0.,0.,0.', expected nodes and el"),
    "count": (cdb([TET]).replace("3,,5,5", "3,,5,6"), "NBLOCK: got 5 lines of items, expected 6"),
    "no end": (cdb([TET]).partition("      -1")[0], "the end of the file, expected the end mark"),
    "format": (cdb([TET]).replace("(19i8)", "(free)"), "got '(free)', expected the format"),
    "nothing": ("/PREP7\n", "got no NBLOCK"),
    "element twice": (
        cdb([TET, TET]).replace("       0       2", "       0       1"),
        "got element 1 for the second time",
    ),
    "parameter": (
        cdb([TET]).replace("ET,1", "*GET,tid,ETYP,0,NUM,MAX\nET,tid"),
        "a.cdb:3: got 'tid', a formula, or a parameter that the file does not set to a number",
    ),
    "damage": (cdb([TET]).replace("ET,1", "ET,1#"), "the file may be damaged"),
}


def test_ansys_parameters(tmp_path: Path) -> None:
    """As *Write Input File* sets them, one after the other; truth: the same file with numbers."""
    text = "*set,tid,4\nET,tid,170\ntid=1\n" + cdb([TET]).replace("ET,1,", "et,TID,")
    text += "cid = 3\nMP,EX,cid,2.1e5\nMP,NUXY,cid,0.3\n*SET,cid,5\nMP,DENS,cid,7e-9\n"
    (tmp_path / "a.cdb").write_text(text)
    model = read_mesh_file(tmp_path / "a.cdb", MM)
    assert model.mesh.element_count == 1
    assert list(model.materials) == ["material_3"]
    assert model.materials["material_3"].young == 2.1e5


@pytest.mark.parametrize("fault", ANSYS)
def test_ansys(fault: str, tmp_path: Path) -> None:
    text, expected = ANSYS[fault]
    assert expected in refusal(tmp_path / "a.cdb", text)


def test_ansys_without_unit(tmp_path: Path) -> None:
    assert "no /UNITS in the file" in refusal(tmp_path / "a.cdb", cdb([TET]), None)
    assert "got 'USER'" in refusal(tmp_path / "a.cdb", "/UNITS,USER\n" + cdb([TET]), None)


def test_ansys_input_with_the_ending_of_nastran(tmp_path: Path) -> None:
    (tmp_path / "ds.dat").write_text(cdb([TET]))
    assert read_mesh_file(tmp_path / "ds.dat", MM).mesh.node_count == 4


HEAD = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"


def msh(elements: list[str], nodes=TET_NODES) -> str:
    lines = [f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(nodes, start=1)]
    text = [HEAD + "$Nodes", str(len(lines)), *lines, "$EndNodes", "$Elements"]
    return "\n".join([*text, str(len(elements)), *elements, "$EndElements", ""])


GMSH = {
    "pyramid": (msh(["1 7 2 1 1 1 2 5 3 4"]), "element 1: got pyramids"),
    "third order": (msh(["1 29 2 1 1 1 2 5 3 4"]), "got element type 29, expected elements of ord"),
    "two groups": (
        msh(["1 4 2 1 1 1 2 3 4", "2 4 2 9 1 1 2 3 4"]),
        "element 1: got an element that is in two physical groups",
    ),
    "surface only": (msh(["1 2 2 1 1 1 2 4"]), "got elements of dimension 2 at most"),
    "left of the axis": (
        msh(["1 2 2 1 1 1 2 3"], ((-1, 0, 0), (1, 0, 0), (0, 1, 0))),
        "node 1: got r = x = -1 mm",
    ),
    "version": (HEAD.replace("2.2", "4.0"), "got version 4.0, expected 2.2 or 4.1"),
    "not gmsh": ("solid cube\n", "got no $MeshFormat at its start"),
    "element twice": (
        msh(["1 4 2 1 1 1 2 3 4", "1 4 2 1 1 1 2 3 4"]),
        "got element 1 for the second time",
    ),
    "elements behind the count": (
        msh(["1 4 2 1 1 1 2 3 4", "2 2 2 2 1 1 2 4", "2 2 2 2 1 1 2 4"]).replace(
            "$Elements\n3", "$Elements\n2"
        ),
        "got more elements than the 2 of its count",
    ),
    "lost name": (
        HEAD
        + '$PhysicalNames\n2\n3 1 "body"\n$EndPhysicalNames\n'
        + msh(["1 4 2 1 1 1 2 3 4"]).removeprefix(HEAD),
        "PhysicalNames: got 1 names, expected 2, according to its count",
    ),
    "nodes behind the count": (
        msh(["1 4 2 1 1 1 2 3 4"]).replace("$Nodes\n5", "$Nodes\n4"),
        "got 4 numbers more than its counts",
    ),
    "partitions": (HEAD.replace("2.2", "4.1") + "$PartitionedEntities\n", "without partitions"),
}


@pytest.mark.parametrize("fault", GMSH)
def test_gmsh(fault: str, tmp_path: Path) -> None:
    text, expected = GMSH[fault]
    assert expected in refusal(tmp_path / "a.msh", text)


def vtk(cells: list[str], types: str, dataset: str = "UNSTRUCTURED_GRID") -> str:
    points = " ".join(" ".join(map(str, x)) for x in TET_NODES)
    size = sum(len(cell.split()) for cell in cells)
    return (
        f"# vtk DataFile Version 3.0\nx\nASCII\nDATASET {dataset}\nPOINTS 5 double\n{points}\n"
        f"CELLS {len(cells)} {size}\n" + "\n".join(cells) + f"\nCELL_TYPES {len(cells)}\n{types}\n"
    )


VTK = {
    "pyramid": (vtk(["5 0 1 4 2 3"], "14"), "cell 1: got pyramids"),
    "lagrange": (vtk(["4 0 1 2 3"], "71"), "cell 1: got cell type 71"),
    "surface": (vtk(["3 0 1 3"], "5"), "got surface cells only"),
    "dataset": (vtk(["4 0 1 2 3"], "10", "POLYDATA"), "got DATASET POLYDATA"),
    "point": (vtk(["4 0 1 2 9"], "10"), "got a cell with a point that does not exist"),
    "count": (vtk(["4 0 1 2 3"], "10").replace("POINTS 5", "POINTS 6"), "got 15 numbers, expec"),
    "shape": (vtk(["3 0 1 2"], "10"), "cell 1: got 3 points, expected 4"),
}


@pytest.mark.parametrize("fault", VTK)
def test_vtk(fault: str, tmp_path: Path) -> None:
    text, expected = VTK[fault]
    assert expected in refusal(tmp_path / "a.vtk", text)


VTU = '<VTKFile type="{}" version="1.0"><{}>{}</{}></VTKFile>'


def test_vtu(tmp_path: Path) -> None:
    path = tmp_path / "a.vtu"
    assert "got type PolyData" in refusal(path, VTU.format("PolyData", "a", "", "a"))
    grid = "UnstructuredGrid"
    two = '<Piece NumberOfPoints="1" NumberOfCells="1"/>' * 2
    assert "got 2 pieces with cells" in refusal(path, VTU.format(grid, grid, two, grid))
    bomb = '<!DOCTYPE a [<!ENTITY b "c">]>' + VTU.format(grid, grid, "&b;", grid)
    assert "own entities" in refusal(path, bomb)
    assert "XML that cannot be read" in refusal(path, "<VTKFile>")


@pytest.mark.parametrize("name", ["a.bdf", "a.msh", "a.vtk", "a.vtu", "a.nas", "a.dat"])
def test_no_unit(name: str, tmp_path: Path) -> None:
    assert "got no unit of length" in refusal(tmp_path / name, "x", None)


def test_unknown_ending(tmp_path: Path) -> None:
    assert "a file that ends in '.stl'" in refusal(tmp_path / "a.stl", "x")


SIZES = [
    # extent in the file, unit that was said, unit that is probably meant
    (25.0, 1.0, "unit: mm"),
    (0.02, 1e-3 * 1e-3, "unit: m"),
    (5e3, 1e-3, "unit: um"),
    (1e-9, 1.0, "check the coordinates"),
]


@pytest.mark.parametrize(("extent", "unit", "hint"), SIZES)
def test_implausible_size(extent: float, unit: float, hint: str, tmp_path: Path) -> None:
    nodes = np.array(TET_NODES) * extent
    lines = [f"GRID,{i},,{x!r},{y!r},{z!r}" for i, (x, y, z) in enumerate(nodes.tolist(), 1)]
    text = "\n".join([*lines, TETRA, "ENDDATA"]).replace("e-", "E-")
    message = refusal(tmp_path / "a.bdf", text, unit)
    assert "got a body of" in message
    assert "an extent of 10 um to 2 m" in message
    assert hint in message
