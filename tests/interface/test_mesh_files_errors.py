"""Faulty meshes and profiles: what is said.

Mesh files that klack refuses: the text says where, what came and what to do.

Faulty Abaqus files: the error names file and line, what came, what was expected.

Faulty profiles: the error names the edge and says what to do.

The catalogue of mesh formats: every folder is in it, and shared endings are told apart.
"""

import inspect
from pathlib import Path

import numpy as np
import pytest
from draws import each

import klack.mesh.files
from klack.errors import InputError
from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.files.catalogue import FORMATS, MESH_FORMATS, MeshFormat, MeshReader, format_of
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.profile import Arc, Line, Profile

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
    "cut off": (bdf(TETRA).removesuffix("ENDDATA"), "got no ENDDATA after its last line ('CTE"),
    "element twice": (bdf(TETRA, TETRA), "got element 1 for the second time"),
    "place twice": (
        bdf(TETRA, "CTETRA,9,2,2,3,1,4"),
        "element 9: got the same corners as element 1, expected every element once",
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
    "surface only": (msh(["1 2 2 1 1 1 2 4"]), "got only elements of dimension 2 or less"),
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


NODES = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n"
DECK = NODES + "*ELEMENT, TYPE=C3D4, ELSET=body\n1, 1, 2, 3, 4\n"
PART = "*PART, NAME=a\n" + DECK + "*END PART\n"
INSTANCE = "*INSTANCE, NAME=i, PART=a\n*END INSTANCE\n"
RING = "*PART, NAME=r\n*NODE\n1,1,0\n2,2,0\n3,1,1\n*ELEMENT, TYPE=CAX3\n1,1,2,3\n*END PART\n"

FAULTS = {
    "not a deck": ("solid cube\n", r"x.inp:1: got 'solid cube', expected a keyword"),
    "no elements": (NODES, "expected solid elements"),
    "only membranes": (
        NODES + "*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n",
        "topology tri3, expected solid elements",
    ),
    "short node": ("*NODE\n1, 0\n", "x.inp:2: got 2 numbers, expected a node number and 2 or 3"),
    "bad number": ("*NODE\n1, 0, 0, x1\n", "x.inp:2: got 'x1', expected a finite number"),
    "not a number": ("*NODE\n1, 0, 0, nan\n", "x.inp:2: got 'nan'"),
    "bad label": ("*NODE\n1.5, 0, 0, 0\n", "x.inp:2: got '1.5', expected a whole number"),
    "node twice": (NODES + "*NODE\n3,0,0,0\n", "x.inp:7: got node 3 for the second time"),
    "element twice": (
        DECK + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n",
        "x.inp:9: got element 1 for the second time",
    ),
    "cut off": (
        NODES + "*ELEMENT, TYPE=C3D10\n1, 1, 2, 3, 4, 1, 2\n",
        r"x.inp:7: got 7 numbers, expected an element number and 10 nodes \(C3D10\).*truncated",
    ),
    "too long": (
        NODES + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4, 4\n",
        "x.inp:7: got 6 numbers, expected an element number and 4 nodes",
    ),
    "unknown node": (
        NODES + "*ELEMENT, TYPE=C3D4\n7, 1, 2, 3, 8\n",
        "x.inp:6: .ELEMENT: element 7: got node 8, which the file does not define",
    ),
    "unknown type": (NODES + "*ELEMENT, TYPE=C3D27\n", "TYPE=C3D27, expected C3D4, C3D10"),
    "no type": (NODES + "*ELEMENT\n", "x.inp:6: .ELEMENT: got no parameter TYPE"),
    "shell": (
        DECK + "*NODE\n9, 5, 5, 5\n*ELEMENT, TYPE=S3\n2, 1, 2, 9\n",
        "element 2: got 1 surface elements that are not faces",
    ),
    "unknown set": (DECK + "*NSET, NSET=a\nb, 1\n", "x.inp:9: got node set 'b', expected a number"),
    "unknown member": (DECK + "*ELSET, ELSET=a\n1, 5\n", "x.inp:9: got element 5, which"),
    "bad range": (DECK + "*NSET, NSET=a, GENERATE\n4, 1\n", "x.inp:9: got 4, 1, expected first"),
    "face number": (DECK + "*SURFACE, NAME=s\nbody, S5\n", r"x.inp:9: got face 'S5'.*S1 to S4"),
    "surface set": (DECK + "*SURFACE, NAME=s\nboby, S1\n", r"'boby'.*defined above \(body\)"),
    "surface type": (DECK + "*SURFACE, NAME=s, TYPE=CUTTING\n1\n", "got TYPE=CUTTING"),
    "generated": (DECK + "*NGEN\n1, 4\n", "x.inp:8: .NGEN: got a keyword that generates nodes"),
    "cylindrical": ("*NODE, SYSTEM=C\n1,1,1,1\n", "got SYSTEM=C"),
    "frame without plane": (
        "*SYSTEM\n0.,0.,0.,0.,0.,1.\n*NODE\n1,1,1,1\n",
        "x.inp:1: .SYSTEM: got points on one line",
    ),
    "half a frame": ("*SYSTEM\n0.,0.,0.,0.\n", "x.inp:1: .SYSTEM: got data lines of 4 numbers"),
    "instance alone": (DECK + "*INSTANCE, NAME=i\n", "x.inp:8: .INSTANCE: got no parameter PART"),
    "unknown part": (
        PART + "*INSTANCE, NAME=i, PART=b\n",
        r"x.inp:10: .INSTANCE: got PART=b, expected a part that is defined above \(A\)",
    ),
    "half a placement": (
        PART + "*INSTANCE, NAME=i, PART=a\n0., 0., 1.\n0., 0., 1., 90.\n",
        "x.inp:10: .INSTANCE: got data lines of 3, 4 numbers, expected a translation",
    ),
    "no axis": (
        PART + "*INSTANCE, NAME=i, PART=a\n0., 0., 1.\n1., 2., 3., 1., 2., 3., 90.\n",
        "x.inp:10: .INSTANCE: got an axis of length 0",
    ),
    "instance twice": (PART + 2 * INSTANCE, "x.inp:12: .INSTANCE: got a second instance 'i'"),
    "part twice": (PART + PART, "x.inp:10: .PART: got a second part 'a'"),
    "part in a part": (
        "*PART, NAME=a\n*PART, NAME=b\n",
        "x.inp:2: .PART: got .PART of x.inp:1 without its end",
    ),
    "open part": (PART + "*PART, NAME=b\n", "x.inp:10: .PART: got the end of the file"),
    "open assembly": (
        PART + "*ASSEMBLY, NAME=s\n" + INSTANCE,
        "x.inp:10: .ASSEMBLY: got the end of the file, expected .END ASSEMBLY before",
    ),
    "place twice": (
        DECK + "*ELEMENT, TYPE=C3D4, ELSET=body\n7, 4, 2, 1, 3\n",
        "x.inp: element 7: got the same corners as element 1",
    ),
    "end only": (DECK + "*END PART\n", "x.inp:8: .END PART: got an end without a start"),
    "parts without assembly": (
        PART + PART.replace("NAME=a", "NAME=b"),
        "got 2 parts and no .INSTANCE",
    ),
    "set of no instance": (
        PART + INSTANCE + "*NSET, NSET=n, INSTANCE=j\n1\n",
        r"x.inp:12: .NSET: got INSTANCE=j, expected an instance that is defined above \(i\)",
    ),
    "not in the instance": (
        PART + INSTANCE + "*NSET, NSET=n, INSTANCE=i\n1, 9\n",
        "x.inp:13: got node 9, which the file does not define",
    ),
    "number without instance": (
        PART + INSTANCE + "*NSET, NSET=n\n1\n",
        "x.inp:13: got node 1, which the file does not define",
    ),
    "set of two instances": (
        PART + INSTANCE + INSTANCE.replace("NAME=i", "NAME=j") + "*ELSET, ELSET=e\nbody\n",
        r"x.inp:15: got element set 'body' of several instances.*\(i.body, j.body\)",
    ),
    "ring off its axis": (
        RING + "*INSTANCE, NAME=i, PART=r\n1., 0., 0.\n*END INSTANCE\n",
        "x.inp:9: .INSTANCE: got an axisymmetric part that is rotated, or moved away",
    ),
    "offset": (NODES + "*ELEMENT, TYPE=C3D4, OFFSET=10\n1,1,2,3,4\n", "the parameter OFFSET"),
    "edge of a shell": (
        DECK + "*ELEMENT, TYPE=S3, ELSET=m\n2, 1, 2, 3\n*SURFACE, NAME=s\nm, S3\n",
        r"x.inp:11: got face 'S3', expected SPOS or SNEG \(tri3\)",
    ),
    "side of a solid": (DECK + "*SURFACE, NAME=s\n1, SPOS\n", "x.inp:9: got face 'SPOS'"),
    "faces cut out": (DECK + "*SURFACE, NAME=s, CROP\nbody,\n", "the parameter CROP"),
    "difference": (
        DECK + "*SURFACE, NAME=s, COMBINE=DIFFERENCE\na, b\n",
        "got COMBINE=DIFFERENCE, expected COMBINE=UNION",
    ),
    "union of nothing": (
        DECK + "*SURFACE, NAME=s, COMBINE=UNION\na, b\n",
        r"x.inp:9: got surface 'a', expected a surface defined above \(none\)",
    ),
    "empty field": (NODES + "5, , 1, 2\n", "x.inp:6: got '', expected a finite number"),
    "two in one field": (NODES + "5, 0, 1 2, 2\n", "x.inp:6: got '1 2'"),
    "one too few and one too many": (NODES + "5, , 1 2, 2\n", "x.inp:6: got '', expected a finite"),
    "huge label": (f"*NODE\n{10**30}, 0, 0, 0\n", "x.inp:2: got '10000"),
    "thousands": ("*NODE\n1, 1_000, 0, 0\n", "x.inp:2: got '1_000'"),
    "infinite": ("*NODE\n1, 1e999, 0, 0\n", "x.inp:2: got '1e999'"),
    "material without values": (
        DECK + "*MATERIAL, NAME=m\n*ELASTIC\n*DENSITY\n1.\n",
        "x.inp:9: .ELASTIC: got no data line",
    ),
    "letter left out": (
        "*NODE\n*ELEMNT, TYPE=C3D4\n",
        r"x.inp:2: got \*ELEMNT, expected \*ELEMENT",
    ),
    "letter too many": ("*NODES\n1, 0, 0, 0\n", r"x.inp:1: got \*NODES, expected \*NODE"),
    "other letter": (DECK + "*SURFASE, NAME=s\n", r"x.inp:8: got \*SURFASE, expected \*SURFACE"),
    "letters swapped": (DECK + "*MATERAIL, NAME=m\n", r"got \*MATERAIL, expected \*MATERIAL"),
    "long name of a file": (f"*INCLUDE, INPUT={'x' * 5000}\n", "xxx: got file name too long"),
    "endless line": ("*NODE " + 30_000 * "x", "x.inp:1: got a line of 30006 bytes"),
    "inverted": (
        NODES + "*ELEMENT, TYPE=C3D4, ELSET=body\n77, 1, 3, 2, 4\n",
        r"element 77 \(tet4, solid 'body'\) at x, y, z = 250, 250, 250 mm: got a smallest scaled",
    ),
    "left of the axis": (
        "*NODE\n1,-1,0\n2,1,0\n3,0,1\n*ELEMENT, TYPE=CAX3\n1, 1, 2, 3\n",
        "node 1: got r = x = -1000 mm",
    ),
    "outside": ("*INCLUDE, INPUT=../a.inp\n", "x.inp:1: .INCLUDE: got the file '../a.inp'"),
    "absolute": ("*INCLUDE, INPUT=/etc/hostname\n", "in the folder of the main file or below"),
    "circle": ("*INCLUDE, INPUT=x.inp\n", "included from itself"),
    "not there": ("*INCLUDE, INPUT=y.inp\n", "y.inp: got no such file"),
    "binary": ("*NODE\n\0\0\n", "got a binary file"),
}  # fmt: skip


@each(("text", "message"), FAULTS.values())
def test_fault_is_located(tmp_path, text, message):
    (tmp_path / "x.inp").write_text(text)

    with pytest.raises(InputError, match=f"(?s){message}"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_other_keywords_are_no_slips(tmp_path):
    rest = (
        "*HEADING\nplate\n*ORIENTATION, NAME=o\n1,0,0,0,1,0\n"
        "*MATERIAL, NAME=m\n*ELASTIC\n2e11, .3\n*PLASTIC\n3e8, 0\n*DENSITY\n7850\n"
        "*EXPANSION\n1e-5\n*DAMPING, ALPHA=1\n*AMPLITUDE, NAME=a\n0,0,1,1\n*BOUNDARY\n1, 1\n"
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE\n"
        "*STEP\n*STATIC\n*NODE PRINT\nU\n*EL PRINT\nS\n*NODE FILE\nU\n*END STEP\n"
    )
    (tmp_path / "x.inp").write_text(DECK + rest)

    assert read_abaqus(tmp_path / "x.inp", 1.0).mesh.element_count == 1


def test_unit_must_be_a_length(tmp_path):
    with pytest.raises(InputError, match="unit_length"):
        read_abaqus(tmp_path / "x.inp", 0.0)


def test_link_to_a_file_outside_is_refused(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "outside.inp").write_text(NODES)
    (folder / "link.inp").symlink_to(tmp_path / "outside.inp")
    (folder / "x.inp").write_text("*INCLUDE, INPUT=link.inp\n")

    with pytest.raises(InputError, match="folder of the main file"):
        read_abaqus(folder / "x.inp", 1.0)


def test_unknown_solid_lists_the_known_ones(tmp_path):
    (tmp_path / "x.inp").write_text(DECK)

    with pytest.raises(InputError, match=r"(?s)solid 'needle'.*one of: body"):
        read_abaqus(tmp_path / "x.inp", 1.0, solids=("needle",))


def test_size_of_all_files_is_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.files.abaqus.keywords.LARGEST_BYTES", 100)
    (tmp_path / "x.inp").write_text(DECK + "**" + 80 * "x")

    with pytest.raises(InputError, match="with all includes"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_members_of_all_sets_are_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.files.abaqus.sets.LARGEST_MEMBERS", 5)
    (tmp_path / "x.inp").write_text(DECK + "*NSET, NSET=a\n1, 2\n*NSET, NSET=b, ELSET=body\n")

    with pytest.raises(InputError, match=r"x.inp:10: got sets with a total of 6 members"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_nodes_of_all_instances_are_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.files.abaqus.deck.LARGEST_NODES", 7)
    (tmp_path / "x.inp").write_text(PART + INSTANCE + INSTANCE.replace("NAME=i", "NAME=j"))

    with pytest.raises(InputError, match=r"x.inp:12: .INSTANCE: got 8 nodes with this"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_a_set_of_nodes_is_no_surface(tmp_path):
    path = tmp_path / "x.inp"
    path.write_text(DECK + "*NSET, NSET=foot\n1, 2, 3\n*SURFACE, NAME=face\nbody, S1\n")
    with pytest.raises(InputError, match=r"surface 'foot': got a set of nodes.*one of: face"):
        read_abaqus(path, 1.0).mesh.surface("foot")


def test_a_lost_include_says_where_it_is_looked_for(tmp_path):
    path = tmp_path / "x.inp"
    path.write_text("*INCLUDE, INPUT=lost.inp\n" + DECK)
    with pytest.raises(
        InputError, match=r"(?s)lost.inp: got no such file.*the file that contains it"
    ):
        read_abaqus(path, 1.0)


def make(*edges: Line | Arc) -> Profile:
    return Profile((0, 0), edges)


@pytest.mark.parametrize(
    ("edges", "text"),
    [
        ((Line((1, 0)), Line((1, 1), "lid")), r"edge 2 'lid'.*an end at .*closes the profile"),
        ((Line((1, 0)),), "1 edges"),
        ((Line((1, 0)), Line((1, float("nan"))), Line((0, 0))), "not finite"),
        ((Line((1, 0)), Line((-1, 1), "left"), Line((0, 0))), "'left'.*r >= 0"),
        (
            (Line((1, 0)), Arc((0, 1), (0.2, 0), "round"), Line((0, 0))),
            r"'round': got a centre 800 mm from the start and 1019.8 mm from the end",
        ),
        (
            (Line((2, 0)), Line((0, 2), "x"), Line((2, 2), "y"), Line((0, 0), "z")),
            r"edges 2 'x' and 4 'z': got a common point at \(1000, 1000\) mm",
        ),
        (
            (Line((2, 0), "a"), Line((2, 1)), Line((1, 0), "c"), Line((0, 1)), Line((0, 0))),
            "got a common point at",
        ),
        ((Line((1, 0)), Line((1, 0), "nothing"), Line((1, 1)), Line((0, 0))), "zero length"),
        ((Line((3, 0)), Arc((3, 2), (3, 1), "half"), Line((0, 0))), "half circle.*clockwise"),
    ],
    ids=["open", "one edge", "nan", "left", "radius", "crossing", "touch", "length", "half"],
)
def test_faulty_profile_is_explained(edges, text):
    with pytest.raises(InputError, match=f"(?s){text}"):
        make(*edges)


def test_arc_through_a_line_is_found():
    """A half circle that bulges through the opposite side."""
    with pytest.raises(InputError, match=r"'bulge' and 3 'side'"):
        Profile(
            (2, 0),
            (
                Arc((2, 4), (2, 2), "bulge", clockwise=True),
                Line((1, 4)),
                Line((1, 0), "side"),
                Line((2, 0)),
            ),
        )


FOLDER = Path(klack.mesh.files.__file__).parent


def test_every_folder_is_one_line() -> None:
    folders = sorted(reader.parent.name for reader in FOLDER.glob("*/reader.py"))
    assert sorted(one.path.split(".")[0] for one in FORMATS) == folders


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.path.split(".")[0])
def test_reader_is_found_and_takes_what_all_take(one: MeshFormat) -> None:
    taken = inspect.signature(one.reader).parameters
    asked = list(inspect.signature(MeshReader.__call__).parameters)[1:]
    assert list(taken) == asked
    assert all(taken[name].kind is inspect.Parameter.KEYWORD_ONLY for name in asked[2:])


def test_endings_are_in_small_letters_and_name_their_programs() -> None:
    assert all(ending == ending.lower() and ending[0] == "." for ending in MESH_FORMATS)
    assert MESH_FORMATS[".dat"] == "ANSYS archive or Nastran bulk data"


@pytest.mark.parametrize(
    ("text", "program"),
    [
        ("/COM\n  nblock , 3\n", "ANSYS archive"),
        ("$ NBLOCK,3 in a comment\nGRID,1\n", "Nastran bulk data"),
        (None, "Nastran bulk data"),
    ],
    ids=["its mark", "elsewhere", "no file"],
)
def test_content_decides_where_an_ending_is_shared(
    text: str | None, program: str, tmp_path: Path
) -> None:
    """Only a mark at the start of a line counts."""
    path = tmp_path / "a.DAT"
    if text is not None:
        path.write_text(text)
    assert format_of(path).program == program
