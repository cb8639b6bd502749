"""Parts, instances and assemblies of Abaqus files.

Truth: exact.  Volumes and places of boxes that are moved and turned by hand.
"""

import numpy as np
import pytest
from doubts import doubts

from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.mesh import Surface
from klack.mesh.quality import corner_volume

MM = 1e-3

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
TET = """*Part, name=Tet
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
MODEL = (BOX + TET + ASSEMBLY).replace("elset=Ends, instance=Tip", "elset=Only, instance=Tip")


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
    (tmp_path / "part.inp").write_text(TET)

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
