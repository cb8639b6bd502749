"""Faulty Abaqus files: the error names file and line, what came, what was expected."""

import pytest
from draws import each

from klack.errors import InputError
from klack.mesh.files.abaqus.reader import read_abaqus

NODES = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n"
TET = NODES + "*ELEMENT, TYPE=C3D4, ELSET=body\n1, 1, 2, 3, 4\n"
PART = "*PART, NAME=a\n" + TET + "*END PART\n"
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
        TET + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n",
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
    "frame without plane": (
        "*SYSTEM\n0.,0.,0.,0.,0.,1.\n*NODE\n1,1,1,1\n",
        "x.inp:1: .SYSTEM: got points on one line",
    ),
    "half a frame": ("*SYSTEM\n0.,0.,0.,0.\n", "x.inp:1: .SYSTEM: got data lines of 4 numbers"),
    "instance alone": (TET + "*INSTANCE, NAME=i\n", "x.inp:8: .INSTANCE: got no parameter PART"),
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
        TET + "*ELEMENT, TYPE=C3D4, ELSET=body\n7, 4, 2, 1, 3\n",
        "x.inp: element 7: got the corners of element 1 again",
    ),
    "end only": (TET + "*END PART\n", "x.inp:8: .END PART: got an end without a start"),
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
        TET + "*ELEMENT, TYPE=S3, ELSET=m\n2, 1, 2, 3\n*SURFACE, NAME=s\nm, S3\n",
        r"x.inp:11: got face 'S3', expected SPOS or SNEG \(tri3\)",
    ),
    "side of a solid": (TET + "*SURFACE, NAME=s\n1, SPOS\n", "x.inp:9: got face 'SPOS'"),
    "faces cut out": (TET + "*SURFACE, NAME=s, CROP\nbody,\n", "the parameter CROP"),
    "difference": (
        TET + "*SURFACE, NAME=s, COMBINE=DIFFERENCE\na, b\n",
        "got COMBINE=DIFFERENCE, expected COMBINE=UNION",
    ),
    "union of nothing": (
        TET + "*SURFACE, NAME=s, COMBINE=UNION\na, b\n",
        r"x.inp:9: got surface 'a', expected a surface defined above \(none\)",
    ),
    "empty field": (NODES + "5, , 1, 2\n", "x.inp:6: got '', expected a finite number"),
    "two in one field": (NODES + "5, 0, 1 2, 2\n", "x.inp:6: got '1 2'"),
    "one too few and one too many": (NODES + "5, , 1 2, 2\n", "x.inp:6: got '', expected a finite"),
    "huge label": (f"*NODE\n{10**30}, 0, 0, 0\n", "x.inp:2: got '10000"),
    "thousands": ("*NODE\n1, 1_000, 0, 0\n", "x.inp:2: got '1_000'"),
    "infinite": ("*NODE\n1, 1e999, 0, 0\n", "x.inp:2: got '1e999'"),
    "material without values": (
        TET + "*MATERIAL, NAME=m\n*ELASTIC\n*DENSITY\n1.\n",
        "x.inp:9: .ELASTIC: got no data line",
    ),
    "letter left out": (
        "*NODE\n*ELEMNT, TYPE=C3D4\n",
        r"x.inp:2: got \*ELEMNT, expected \*ELEMENT",
    ),
    "letter too many": ("*NODES\n1, 0, 0, 0\n", r"x.inp:1: got \*NODES, expected \*NODE"),
    "other letter": (TET + "*SURFASE, NAME=s\n", r"x.inp:8: got \*SURFASE, expected \*SURFACE"),
    "letters swapped": (TET + "*MATERAIL, NAME=m\n", r"got \*MATERAIL, expected \*MATERIAL"),
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
    (tmp_path / "x.inp").write_text(TET + rest)

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
    (tmp_path / "x.inp").write_text(TET)

    with pytest.raises(InputError, match=r"(?s)solid 'needle'.*one of: body"):
        read_abaqus(tmp_path / "x.inp", 1.0, solids=("needle",))


def test_size_of_all_files_is_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.files.abaqus.keywords.LARGEST_BYTES", 100)
    (tmp_path / "x.inp").write_text(TET + "**" + 80 * "x")

    with pytest.raises(InputError, match="with all includes"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_members_of_all_sets_are_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.files.abaqus.sets.LARGEST_MEMBERS", 5)
    (tmp_path / "x.inp").write_text(TET + "*NSET, NSET=a\n1, 2\n*NSET, NSET=b, ELSET=body\n")

    with pytest.raises(InputError, match=r"x.inp:10: got sets of 6 members"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_nodes_of_all_instances_are_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.mesh.files.abaqus.deck.LARGEST_NODES", 7)
    (tmp_path / "x.inp").write_text(PART + INSTANCE + INSTANCE.replace("NAME=i", "NAME=j"))

    with pytest.raises(InputError, match=r"x.inp:12: .INSTANCE: got 8 nodes with this"):
        read_abaqus(tmp_path / "x.inp", 1.0)


def test_a_set_of_nodes_is_no_surface(tmp_path):
    path = tmp_path / "x.inp"
    path.write_text(TET + "*NSET, NSET=foot\n1, 2, 3\n*SURFACE, NAME=face\nbody, S1\n")
    with pytest.raises(InputError, match=r"surface 'foot': got a set of nodes.*one of: face"):
        read_abaqus(path, 1.0).mesh.surface("foot")


def test_a_lost_include_says_where_it_is_looked_for(tmp_path):
    path = tmp_path / "x.inp"
    path.write_text("*INCLUDE, INPUT=lost.inp\n" + TET)
    with pytest.raises(
        InputError, match=r"(?s)lost.inp: got no such file.*the file that contains it"
    ):
        read_abaqus(path, 1.0)
