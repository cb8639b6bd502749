"""Faulty Abaqus files: the error names file and line, what came, what was expected."""

import pytest

from klack.errors import InputError
from klack.mesh.abaqus import read_abaqus

NODES = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n"
TET = NODES + "*ELEMENT, TYPE=C3D4, ELSET=body\n1, 1, 2, 3, 4\n"

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
        TET + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n",
        "x.inp:9: got element 1 for the second time",
    ),
    "cut off": (
        NODES + "*ELEMENT, TYPE=C3D10\n1, 1, 2, 3, 4, 1, 2\n",
        r"x.inp:7: got 7 numbers, expected an element number and 10 nodes \(C3D10\).*cut off",
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
        TET + "*NODE\n9, 5, 5, 5\n*ELEMENT, TYPE=S3\n2, 1, 2, 9\n",
        "element 2: got 1 surface elements that are no faces",
    ),
    "unknown set": (TET + "*NSET, NSET=a\nb, 1\n", r"x.inp:9: got node set 'b', expected a number"),
    "unknown member": (TET + "*ELSET, ELSET=a\n1, 5\n", "x.inp:9: got element 5, which"),
    "bad range": (TET + "*NSET, NSET=a, GENERATE\n4, 1\n", "x.inp:9: got 4, 1, expected first"),
    "face number": (TET + "*SURFACE, NAME=s\nbody, S5\n", r"x.inp:9: got face 'S5'.*S1 to S4"),
    "surface set": (TET + "*SURFACE, NAME=s\nboby, S1\n", r"'boby'.*defined above \(body\)"),
    "surface type": (TET + "*SURFACE, NAME=s, TYPE=CUTTING\n1\n", "got TYPE=CUTTING"),
    "generated": (TET + "*NGEN\n1, 4\n", "x.inp:8: .NGEN: got a keyword that makes nodes"),
    "cylindrical": ("*NODE, SYSTEM=C\n1,1,1,1\n", "got SYSTEM=C"),
    "moved instance": (TET + "*INSTANCE, NAME=i\n0., 0., 1.\n", "moved or turned"),
    "two parts": (TET + "*PART, NAME=a\n*PART, NAME=b\n", "x.inp:9: .PART: got a second one"),
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


@pytest.mark.parametrize(("text", "message"), FAULTS.values(), ids=FAULTS.keys())
def test_fault_is_located(tmp_path, text, message):
    (tmp_path / "x.inp").write_text(text)

    with pytest.raises(InputError, match=f"(?s){message}"):
        read_abaqus(tmp_path / "x.inp", 1.0)


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
    (tmp_path / "x.inp").write_text(TET)

    with pytest.raises(InputError, match=r"(?s)solid 'needle'.*one of: body"):
        read_abaqus(tmp_path / "x.inp", 1.0, solids=("needle",))


def test_size_of_all_files_is_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.abaqus_keywords.LARGEST_BYTES", 100)
    (tmp_path / "x.inp").write_text(TET + "**" + 80 * "x")

    with pytest.raises(InputError, match="with all includes"):
        read_abaqus(tmp_path / "x.inp", 1.0)
