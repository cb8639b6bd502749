"""Meshes of solids, from CAD and swept.

Unstructured solid meshes from CAD against the exact body.

Truth: exact geometry (volume, areas, place of nodes) and the declared units of a STEP file.
Tolerances: 1e-4 in volume and 3e-4 in area from quadratic faces of a third of the radius.

Swept solid meshes against the exact body of revolution.

Truth: exact geometry and topology.  The volume error of quadratic edges along a circle falls with
the fourth power of the number of layers.
"""

from pathlib import Path

import numpy as np
import pytest
from swept_area import swept_area

from klack.assembling.held_nodes import sector_nodes, surface_nodes
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, FaceTable, Mesh, Surface, outer_surface
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.quality import mesh_summary, require_connected
from klack.mesh.sizing import MeshSizing, Refinement
from klack.mesh.solid import mesh_revolved, mesh_step, write_step_revolved
from klack.mesh.step_content import step_content
from klack.mesh.swept import sweep

MM = 1e-3
COARSE = MeshSizing(size=1.5 * MM)


def pin() -> Profile:
    return Profile(
        (0, 0),
        (
            Arc((2 * MM, 2 * MM), (0, 2 * MM), "tip"),
            Line((2 * MM, 6 * MM), "shank"),
            Line((0, 6 * MM), "joint"),
            Line((0, 0), "axis"),
        ),
    )


def cap() -> Profile:
    return Profile(
        (0, 6 * MM),
        (
            Line((3 * MM, 6 * MM), "brim"),
            Line((3 * MM, 8 * MM), "rim"),
            Line((0, 8 * MM), "top"),
            Line((0, 6 * MM)),
        ),
    )


def volume(mesh: Mesh) -> float:
    xi, w = quadrature("tet10", "mass")
    _, dN = shape_functions("tet10", xi)
    total = 0.0
    for block in mesh.blocks:
        jacobian = np.linalg.det(np.einsum("enc,qnd->eqcd", mesh.points[block.connectivity], dN))
        assert jacobian.min() > 0
        total += float(np.einsum("q,eq->", w, jacobian))
    return total


def flux_and_area(mesh: Mesh, surface: Surface) -> tuple[float, float]:
    """Flux of x/3 through a surface (its divergence is 1), and area."""
    xi, w = quadrature("tri6", "mass")
    N, dN = shape_functions("tri6", xi)
    (block,) = surface.blocks
    x = mesh.points[block.connectivity]
    t = np.einsum("enc,qnd->eqdc", x, dN)
    n = np.cross(t[:, :, 0], t[:, :, 1])
    p = np.einsum("enc,qn->eqc", x, N)
    flux = float(np.einsum("q,eqc,eqc->", w, p, n)) / 3
    return flux, float(np.einsum("q,eq->", w, np.linalg.norm(n, axis=2)))


@pytest.fixture(scope="module")
def body() -> Mesh:
    ring = Refinement(position=(1.4 * MM, 0.5717 * MM), size=0.2 * MM, radius=0.2 * MM)
    sizing = MeshSizing(size=1.5 * MM, refinements=(ring,), surfaces={"top": 0.6 * MM})
    return mesh_revolved({"pin": pin(), "cap": cap()}, sizing)


@pytest.fixture(scope="module")
def step(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("cad") / "body.step"
    write_step_revolved({"pin": pin(), "cap": cap()}, path)
    return path


def test_volume_and_areas(body):
    assert volume(body) == pytest.approx(pin().volume + cap().volume, rel=1e-4)
    for profile, names in ((pin(), ("tip", "shank")), (cap(), ("rim", "top"))):
        for name in names:
            area = flux_and_area(body, body.surface(name))[1]
            assert area == pytest.approx(swept_area(profile, name), rel=3e-4)
    brim = flux_and_area(body, body.surface("brim"))[1]
    assert brim == pytest.approx(np.pi * 5 * MM**2, rel=3e-4)  # outside the joint


def test_faces_are_watertight_and_point_outwards(body):
    """Gauss' theorem on the very same curved mesh, to round-off."""
    assert set(body.surfaces) == {"tip", "shank", "brim", "rim", "top"}
    flux = sum(flux_and_area(body, surface)[0] for surface in body.surfaces.values())
    assert flux == pytest.approx(volume(body), rel=1e-12)


def test_nodes_lie_on_the_exact_surfaces(body):
    """Mid nodes too; 1e-12 m is netgen's arithmetic in mm."""
    x, y, z = body.points.T
    meridian = np.column_stack([np.hypot(x, y), z])
    for profile in (pin(), cap()):
        for curve in profile.curves:
            if curve.name in body.surfaces:
                assert curve.distance(meridian[body.surface(curve.name).nodes]).max() < 1e-12


def test_solids_are_joined_and_their_interface_is_a_node_set(body):
    assert body.solids == ("pin", "cap")
    np.testing.assert_allclose(body.points[body.node_sets["joint"]][:, 2], 6 * MM, rtol=1e-12)
    one, other = (np.unique(block.connectivity) for block in body.blocks)
    assert np.array_equal(np.intersect1d(one, other), body.node_sets["joint"])


def test_ring_and_surface_sizes_are_kept(body):
    """Netgen's edges on a curved face are 20-30 % longer than asked; a disc has its faces."""
    (block,) = body.surface("tip").blocks
    x = body.points[block.connectivity[:, :3]]
    middle = x.mean(axis=1)
    ring = np.hypot(np.hypot(*middle[:, :2].T) - 1.4 * MM, middle[:, 2] - 0.5717 * MM)
    near = x[ring < 0.1 * MM]
    edges = np.linalg.norm(near - np.roll(near, 1, axis=1), axis=2)
    assert edges.mean() == pytest.approx(0.2 * MM, rel=0.3)
    faces = np.pi * 9 / (np.sqrt(3) / 4 * 0.6**2)  # equilateral triangles
    assert body.surface("top").face_count == pytest.approx(faces, rel=0.25)
    assert mesh_summary(body).worst_quality > 0.05


@pytest.mark.slow
def test_step_keeps_names_solids_and_size(step):
    content = step_content(step)
    assert [solid.name for solid in content.solids] == ["pin", "cap"]
    drawn = pin().volume, cap().volume
    assert [solid.size for solid in content.solids] == pytest.approx(drawn, rel=1e-9)
    names = ["tip", "shank", "joint", "brim", "rim", "top"]
    assert [face.name for face in content.faces] == names
    (top,) = (face for face in content.faces if face.name == "top")
    assert top.low[2] == top.high[2]  # a flat face
    assert top.size == pytest.approx(np.pi * top.high[0] ** 2, rel=1e-9)
    mesh = mesh_step(step, COARSE)

    assert mesh.solids == ("pin", "cap")
    assert set(mesh.surfaces) == {"tip", "shank", "brim", "rim", "top"}
    assert volume(mesh) == pytest.approx(pin().volume + cap().volume, rel=3e-4)


@pytest.mark.slow
def test_unit_of_the_step_file_is_respected(step, tmp_path):
    text = step.read_text()
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    metres = tmp_path / "metres.step"
    metres.write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)"))

    mesh = mesh_step(metres, MeshSizing(size=1.5))

    assert volume(mesh) == pytest.approx(1e9 * (pin().volume + cap().volume), rel=3e-4)


def test_same_profiles_write_the_same_file(step, tmp_path):
    again = tmp_path / "again.step"
    write_step_revolved({"pin": pin(), "cap": cap()}, again)

    assert again.read_bytes() == step.read_bytes()


@pytest.mark.slow
def test_faces_without_a_name_are_numbered(step, tmp_path):
    nameless = tmp_path / "nameless.step"
    text = step.read_text()
    for name in ("tip", "shank", "joint", "brim", "rim", "top"):
        text = text.replace(f"ADVANCED_FACE('{name}'", "ADVANCED_FACE(''")
    nameless.write_text(text)

    faces = step_content(nameless).faces
    assert [face.name for face in faces[:3]] == ["face1", "face2", "face3"]
    assert not any(face.named for face in faces)
    assert "face1" in mesh_step(nameless, COARSE).surfaces


def test_files_that_are_not_usable(step, tmp_path):
    with pytest.raises(InputError, match="got no such file, expected a STEP file"):
        mesh_step(tmp_path / "none.step", COARSE)
    other = tmp_path / "mesh.step"
    for text, words in (
        ("solid ascii stl\n", r"(?s)starts with 'solid ascii stl.*ISO-10303-21"),
        (step.read_text()[:4000], r"damaged STEP file: entity #\d+ is missing"),
        ("ISO-10303-21;\n", "that OpenCASCADE cannot read"),
    ):
        other.write_text(text)
        with pytest.raises(InputError, match=words):
            mesh_step(other, COARSE)
    with pytest.raises(InputError, match="one of: brim, joint, rim, shank, tip, top"):
        mesh_step(step, MeshSizing(size=MM, surfaces={"seat": MM}))


def test_solid_inside_out_is_refused(monkeypatch):
    """A clockwise face turned about the axis has a negative volume (STEP readers mend that)."""
    from netgen.occ import Axes, Axis, WorkPlane, X, Y, Z

    plane = WorkPlane(Axes((0, 0, 0), n=Z, h=X)).MoveTo(1, 0)
    face = plane.LineTo(1, 1).LineTo(2, 1).LineTo(2, 0).Close().Face()
    solid = face.Revolve(Axis((0, 0, 0), Y), 360)
    solid.name = "ring"
    assert solid.mass == pytest.approx(-3 * np.pi, rel=1e-12)
    monkeypatch.setattr("klack.mesh.solid.revolved_solids", lambda profiles: [solid])

    with pytest.raises(InputError, match=r"(?s)solid 'ring': got a volume of -9.42.*reverse"):
        mesh_revolved({"ring": pin()}, COARSE)


@pytest.mark.slow
def test_solids_that_overlap_or_lie_apart_are_refused():
    def disc(low: float) -> Profile:
        high = low + 2 * MM
        return Profile(
            (0, low), (Line((MM, low)), Line((MM, high)), Line((0, high)), Line((0, low)))
        )

    for solids, words in (
        ({"a": disc(0), "b": disc(1 * MM)}, "3 regions of space from 2 solids"),
        ({"a": disc(0), "b": disc(3 * MM)}, "2 parts that share no node"),
        ({}, "got none, expected one profile per solid"),
    ):
        with pytest.raises(InputError, match=words):
            mesh_revolved(solids, COARSE)


def needle() -> Profile:
    return Profile(
        (0, 0),
        (
            Arc((2 * MM, 2 * MM), (0, 2 * MM), "tip"),
            Line((2 * MM, 8 * MM), "shank"),
            Line((0, 8 * MM), "top"),
            Line((0, 0), "axis"),
        ),
    )


def tube() -> Profile:
    """Build a body that does not touch the axis."""
    return Profile(
        (2 * MM, 0),
        (
            Line((4 * MM, 0), "foot"),
            Line((4 * MM, 5 * MM), "outside"),
            Line((2 * MM, 5 * MM), "top"),
            Line((2 * MM, 0), "bore"),
        ),
    )


@pytest.fixture(scope="module")
def meridian() -> Mesh:
    ring = Refinement(position=(1.2 * MM, 0.4 * MM), size=0.1 * MM, radius=0.1 * MM)
    return mesh_meridian({"needle": needle()}, MeshSizing(size=1 * MM, refinements=(ring,)))


@pytest.fixture(scope="module")
def solid(meridian) -> Mesh:
    return sweep(meridian, 16, start_angle=0.1)


def flux_and_area_swept(mesh: Mesh, surface: Surface) -> tuple[float, float]:
    """Flux of x/3 through a surface (its divergence is 1), and area."""
    flux, area = 0.0, 0.0
    for block in surface.blocks:
        xi, w = quadrature(block.family, "mass")
        N, dN = shape_functions(block.family, xi)
        x = mesh.points[block.connectivity]
        t = np.einsum("enc,qnd->eqdc", x, dN)
        n = np.cross(t[:, :, 0], t[:, :, 1])
        p = np.einsum("enc,qn->eqc", x, N)
        flux += float(np.einsum("q,eqc,eqc->", w, p, n)) / 3
        area += float(np.einsum("q,eq->", w, np.linalg.norm(n, axis=2)))
    return flux, area


def test_volume_converges_with_order_four():
    """A tube has straight edges in the meridian: the only error is that along the circle."""
    meridian = mesh_meridian({"tube": tube()}, MeshSizing(size=1 * MM))
    layers = np.array([8, 12, 16, 24])
    error = np.array([volume(sweep(meridian, int(n))) / tube().volume - 1 for n in layers])

    assert np.all(error < 0)
    assert -np.polyfit(np.log(layers), np.log(-error), 1)[0] == pytest.approx(4, abs=0.05)


@pytest.mark.parametrize(("layers", "tolerance"), [(12, 3e-4), (24, 3e-5)])
def test_volume_of_a_needle_follows_pappus(meridian, layers, tolerance):
    assert volume(sweep(meridian, layers)) == pytest.approx(needle().volume, rel=tolerance)


@pytest.mark.parametrize("profile", [needle(), tube()], ids=["on the axis", "tube"])
def test_mesh_is_watertight_and_faces_point_outwards(profile):
    """Gauss' theorem on the very same curved mesh, to round-off.

    It holds only if every inner face is shared and every named face points out.
    """
    mesh = sweep(mesh_meridian({"body": profile}, MeshSizing(size=1 * MM)), 12)

    flux = sum(flux_and_area_swept(mesh, surface)[0] for surface in mesh.surfaces.values())
    assert flux == pytest.approx(volume(mesh), rel=1e-12)
    skin = outer_surface(mesh)
    assert skin.face_count == sum(s.face_count for s in mesh.surfaces.values())
    assert flux_and_area_swept(mesh, skin)[0] == pytest.approx(flux, rel=1e-12)
    require_connected("test", mesh)


def test_no_face_belongs_to_three_elements(solid):
    table = FaceTable.of(solid.blocks)
    _, counts = np.unique(table.keys, axis=0, return_counts=True)
    assert counts.max() == 2


def test_every_surface_node_lies_on_the_surface_of_revolution(solid):
    x, y, z = solid.points.T
    meridian_points = np.column_stack([np.hypot(x, y), z])
    for curve in needle().curves:
        if curve.name != "axis":
            assert curve.distance(meridian_points[solid.surface(curve.name).nodes]).max() < 2e-15


def test_areas_of_named_surfaces(solid):
    """16 layers: 6e-5 from the chords of quadratic edges."""
    for name in needle().names:
        area = flux_and_area_swept(solid, solid.surface(name))[1]
        assert area == pytest.approx(swept_area(needle(), name), rel=2e-4)


def test_nodes_on_the_axis_are_merged_and_mid_nodes_are_in_the_middle(meridian, solid):
    on_axis = meridian.points[:, 0] == 0
    x, y, _ = solid.points.T
    assert (np.hypot(x, y) < 1e-12).sum() == on_axis.sum()
    # edges that end on the axis are straight and their mid node is the mid node of the meridian
    (block,) = solid.blocks
    pairs = block.connectivity[:, np.array(FAMILIES["tet10"].edges)].reshape(-1, 2)
    middle = block.connectivity[:, 4:].ravel()
    r = np.hypot(x, y)
    radial = (r[pairs] < 1e-12).sum(axis=1) == 1
    wanted = solid.points[pairs[radial]].mean(axis=1)
    inner = r[middle[radial]] < 1.0 * MM  # not on the tip, where the meridian edge is curved
    np.testing.assert_allclose(
        solid.points[middle[radial]][inner], wanted[inner], rtol=0, atol=5e-5
    )


def test_the_rule_does_not_depend_on_node_numbers(meridian):
    """Any numbering of the meridian gives a conforming mesh of the same volume."""
    order = np.random.default_rng(4).permutation(meridian.node_count)
    new = np.argsort(order)
    shuffled = Mesh(
        points=meridian.points[order],
        blocks=tuple(ElementBlock(b.family, new[b.connectivity], b.solid) for b in meridian.blocks),
    )
    mesh = sweep(shuffled, 12)

    assert volume(mesh) == pytest.approx(volume(sweep(meridian, 12)), rel=1e-5)
    assert flux_and_area_swept(mesh, outer_surface(mesh))[0] == pytest.approx(
        volume(mesh), rel=1e-12
    )


def test_sectors_cover_their_share_of_the_circumference(meridian):
    mesh = sweep(meridian, 36)  # nodes every 5 degrees
    nodes = sector_nodes(mesh, "shank", 3, np.radians(40.0), np.radians(90.0))

    x, y, _ = mesh.points[nodes].T
    angle = np.degrees(np.arctan2(y, x)) - 90.0
    assert np.abs((angle + 60) % 120 - 60).max() == pytest.approx(20.0, abs=1e-9)
    assert len(nodes) / len(surface_nodes(mesh, "shank")) == pytest.approx(27 / 72, rel=0.02)


def test_sectors_are_refused_where_they_make_no_sense(meridian, solid):
    for mesh, name, count, width, words in (
        (meridian, "shank", 3, 0.5, r"(?s)an axisymmetric mesh.*hold the whole surface"),
        (solid, "shank", 3, 2.2, "avoid overlap"),
        (solid, "shank", 40, 0.01, r"nodes in \d+ of 40 sectors"),
        (solid, "shaft", 3, 0.5, "one of: shank, tip, top"),
    ):
        with pytest.raises(InputError, match=words):
            sector_nodes(mesh, name, count, width, 0.0)


def test_sweep_refuses_solids_and_too_few_layers(meridian, solid):
    with pytest.raises(InputError, match="tet10, expected tri6"):
        sweep(solid, 12)
    with pytest.raises(InputError, match="at least 6"):
        sweep(meridian, 5)
