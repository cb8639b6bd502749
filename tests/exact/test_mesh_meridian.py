"""Meshes of half sections: profiles, meridians, quality.

Profiles against closed formulas of bodies of revolution (Pappus, Archimedes).

Truth: exact.  Tolerance 1e-12 relative: Gauss rule of order 24 per edge, round-off only.

Axisymmetric meshes against the exact profile.

Truth: exact geometry.  Nodes on edges to 1e-15 m (round-off at 10 mm); volume by quadrature of the
curved triangles: a quadratic edge follows an arc to fourth order, 1e-6 at the sizes used here.

Quality measures against elements whose shape is known. Truth: exact, 1e-12.
"""

import numpy as np
import pytest
from draws import each
from swept_area import swept_area

from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.errors import InputError, KlackError
from klack.mesh.families import FAMILIES
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.quality import (
    corner_volume,
    edge_lengths,
    mesh_summary,
    require_connected,
    require_positive_jacobians,
    scaled_jacobians,
)
from klack.mesh.sizing import MeshSizing, Refinement

EXACT = 1e-12


def sphere(radius: float, height: float = 0.0) -> Profile:
    half = Arc((0, height + radius), (0, height), "ball")
    return Profile((0, height - radius), (half, Line((0, height - radius), "axis")))


@pytest.mark.parametrize("radius", [1.0, 2e-3])  # [m]
def test_sphere_volume_and_area(radius):
    ball = sphere(radius, height=3 * radius)

    assert ball.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=EXACT)
    assert swept_area(ball, "ball") == pytest.approx(4 * np.pi * radius**2, rel=EXACT)


def test_ring_of_circular_section_follows_pappus():
    """Torus of two explicit half circles: 2 pi^2 R a^2 and 4 pi^2 R a."""
    big, small = 5e-3, 1e-3
    ring = Profile(
        (big - small, 0),
        (
            Arc((big + small, 0), (big, 0), "under", clockwise=False),
            Arc((big - small, 0), (big, 0), "over", clockwise=False),
        ),
    )

    assert ring.volume == pytest.approx(2 * np.pi**2 * big * small**2, rel=EXACT)
    area = swept_area(ring, "under") + swept_area(ring, "over")
    assert area == pytest.approx(4 * np.pi**2 * big * small, rel=EXACT)


def test_truncated_cone():
    r0, r1, h = 1e-3, 3e-3, 4e-3
    cone = Profile(
        (0, 0), (Line((r0, 0)), Line((r1, h), "seat"), Line((0, h), "top"), Line((0, 0)))
    )

    assert cone.volume == pytest.approx(np.pi * h / 3 * (r0**2 + r0 * r1 + r1**2), rel=EXACT)
    slant = np.hypot(r1 - r0, h)
    assert swept_area(cone, "seat") == pytest.approx(np.pi * (r0 + r1) * slant, rel=EXACT)
    assert cone.names == ("seat", "top")


def test_either_sense_gives_the_same_anticlockwise_profile():
    forward = Profile((0, 0), (Line((1, 0), "a"), Arc((0, 1), (0, 0), "b"), Line((0, 0), "c")))
    back = Profile((0, 0), (Line((0, 1), "c"), Arc((1, 0), (0, 0), "b"), Line((0, 0), "a")))

    assert back.area == pytest.approx(np.pi / 4, rel=EXACT)
    assert [c.name for c in back.curves] == [c.name for c in forward.curves] == ["a", "b", "c"]
    for one, other in zip(forward.curves, back.curves, strict=True):
        np.testing.assert_allclose(one.at(0.3), other.at(0.3), rtol=0, atol=1e-15)


def test_arc_takes_the_shorter_way_unless_told():
    """Three quarters of a circle of radius 1 around (2, 0), closed by its chord."""
    start, end, centre = (3.0, 0.0), (2.0, -1.0), (2.0, 0.0)
    short = Profile(start, (Arc(end, centre), Line(start)))
    long = Profile(start, (Arc(end, centre, clockwise=False), Line(start)))

    assert short.area == pytest.approx(np.pi / 4 - 0.5, rel=EXACT)
    assert long.area == pytest.approx(3 * np.pi / 4 + 0.5, rel=EXACT)


def test_nearest_points_on_an_arc_beyond_half_a_turn():
    curve = Profile(
        (3.0, 0.0), (Arc((2.0, -1.0), (2.0, 0.0), clockwise=False), Line((3.0, 0.0)))
    ).curves[0]

    s = np.linspace(0, 1, 13)
    np.testing.assert_allclose(curve.fraction(curve.at(s)), s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(curve.distance(np.array([[2.0, 0.0], [0.5, 0.0]])), [1.0, 0.5])


MM = 1e-3
SIN45 = np.sqrt(0.5)


def needle() -> Profile:
    return Profile(
        (0, 0),
        (
            Arc((2 * MM, 2 * MM), (0, 2 * MM), "tip"),
            Line((2 * MM, 22 * MM), "shank"),
            Line((4 * MM, 22 * MM), "shoulder"),
            Line((4 * MM, 24 * MM), "rim"),
            Line((0, 24 * MM), "top"),
            Line((0, 0), "axis"),
        ),
    )


def volume(mesh: Mesh) -> float:
    xi, w = quadrature("tri6", "mass")
    N, dN = shape_functions("tri6", xi)
    total = 0.0
    for block in mesh.blocks:
        x = mesh.points[block.connectivity]
        jacobian = np.linalg.det(np.einsum("enc,qnd->eqcd", x, dN))
        total += float(np.einsum("q,qn,en,eq->", w, N, x[:, :, 0], jacobian))
    return 2 * np.pi * total


def surface_area(mesh: Mesh, name: str) -> float:
    xi, w = quadrature("line3", "mass")
    N, dN = shape_functions("line3", xi)
    total = 0.0
    for block in mesh.surface(name).blocks:
        x = mesh.points[block.connectivity]
        speed = np.linalg.norm(np.einsum("enc,qn->eqc", x, dN[:, :, 0]), axis=2)
        total += float(np.einsum("q,qn,en,eq->", w, N, x[:, :, 0], speed))
    return 2 * np.pi * total


RING = Refinement(position=(2 * MM * SIN45, 2 * MM * (1 - SIN45)), size=0.02 * MM, radius=0.1 * MM)


@pytest.fixture(scope="module")
def fine() -> Mesh:
    return mesh_meridian({"needle": needle()}, MeshSizing(size=1.5 * MM, refinements=(RING,)))


def test_nodes_lie_on_the_exact_edges_and_the_axis(fine):
    for curve in needle().curves:
        if curve.name != "axis":
            assert curve.distance(fine.points[fine.surface(curve.name).nodes]).max() < 1e-15
    assert "axis" not in fine.surfaces
    axis = fine.points[fine.points[:, 0] < 1e-9]
    assert len(axis) > 10
    assert np.all(axis[:, 0] == 0.0)


def test_mid_nodes_of_an_arc_are_halfway_in_angle(fine):
    (block,) = fine.surface("tip").blocks
    d = fine.points[block.connectivity] - [0, 2 * MM]
    angle = np.arctan2(d[..., 1], d[..., 0])
    np.testing.assert_allclose(angle[:, 2], angle[:, :2].mean(axis=1), rtol=0, atol=1e-12)


def test_volume_and_surface_areas_follow_pappus(fine):
    profile = needle()
    assert volume(fine) == pytest.approx(profile.volume, rel=1e-6)
    for name in profile.names:
        assert surface_area(fine, name) == pytest.approx(swept_area(profile, name), rel=1e-5)


def test_faces_point_outwards(fine):
    """Divergence theorem: the flux of (0, z), of divergence 1, over the skin is the volume."""
    flux = 0.0
    xi, w = quadrature("line3", "mass")
    N, dN = shape_functions("line3", xi)
    for surface in fine.surfaces.values():
        for block in surface.blocks:
            x = fine.points[block.connectivity]
            t = np.einsum("enc,qn->eqc", x, dN[:, :, 0])
            p = np.einsum("enc,qn->eqc", x, N)
            flux += float(np.einsum("q,eq,eq,eq->", w, p[..., 0], p[..., 1], -t[..., 0]))
    assert 2 * np.pi * flux == pytest.approx(needle().volume, rel=1e-6)


def test_contact_ring_is_uniform_and_the_mesh_small(fine):
    """Truth: what was asked for; boundary edges come out even to 3 %."""
    (block,) = fine.surface("tip").blocks
    ends = fine.points[block.connectivity[:, :2]]
    middle = ends.mean(axis=1)
    length = np.linalg.norm(np.diff(ends, axis=1)[:, 0], axis=1)
    near = np.linalg.norm(middle - RING.position, axis=1) < 0.1 * MM
    assert near.sum() in (9, 10, 11)  # 0.2 mm of arc in steps of 0.02 mm
    np.testing.assert_allclose(length[near], 0.02 * MM, rtol=0.03)
    summary = mesh_summary(fine)
    assert summary.elements < 400
    assert summary.worst_quality > 0.4
    require_connected("test", fine)


def test_surface_size_is_kept():
    mesh = mesh_meridian({"n": needle()}, MeshSizing(size=1.5 * MM, surfaces={"top": 0.2 * MM}))
    assert mesh.surface("top").face_count in range(20, 26)  # 4 mm in steps of 0.2 mm


def test_glued_solids_share_nodes_and_hide_their_interface():
    """Steel pin with a cap that is wider, so that one edge is partly glued, partly free."""
    pin = Profile(
        (0, 0),
        (Line((2 * MM, 0), "foot"), Line((2 * MM, 5 * MM), "side"), Line((0, 5 * MM), "joint"),
         Line((0, 0))),
    )  # fmt: skip
    cap = Profile(
        (0, 5 * MM),
        (Line((3 * MM, 5 * MM), "brim"), Line((3 * MM, 8 * MM), "edge"), Line((0, 8 * MM), "lid"),
         Line((0, 5 * MM))),
    )  # fmt: skip
    mesh = mesh_meridian({"pin": pin, "cap": cap}, MeshSizing(size=1 * MM))

    require_connected("test", mesh)
    assert mesh.solids == ("pin", "cap")
    assert set(mesh.surfaces) == {"foot", "side", "brim", "edge", "lid"}
    free = np.pi * (3**2 - 2**2) * MM**2
    assert surface_area(mesh, "brim") == pytest.approx(free, rel=1e-12)
    joint = mesh.points[mesh.node_sets["joint"]]
    assert np.all(joint[:, 1] == 5 * MM)
    assert joint[:, 0].max() == 2 * MM
    assert volume(mesh) == pytest.approx(pin.volume + cap.volume, rel=1e-12)


@pytest.mark.parametrize(
    ("shift", "text"),
    [(-1 * MM, "no overlap"), (+1 * MM, "2 parts that share no node")],
    ids=["overlap", "apart"],
)
def test_solids_that_do_not_fit_are_refused(shift, text):
    def block(low: float) -> Profile:
        high = low + 2 * MM
        return Profile(
            (0, low), (Line((MM, low)), Line((MM, high)), Line((0, high)), Line((0, low)))
        )

    with pytest.raises(InputError, match=text):
        mesh_meridian({"a": block(0.0), "b": block(2 * MM + shift)}, MeshSizing(size=MM))


def test_point_off_the_axis_cannot_refine_a_meridian():
    sizing = MeshSizing(size=MM, refinements=(Refinement(position=(MM, 0, 0), size=0.1 * MM),))

    with pytest.raises(InputError, match=r"(?s)not on the axis.*give \(r, z\)"):
        mesh_meridian({"needle": needle()}, sizing)


def test_unknown_sized_surface_lists_the_names():
    with pytest.raises(InputError, match="one of: rim, shank, shoulder, tip, top"):
        mesh_meridian({"needle": needle()}, MeshSizing(size=MM, surfaces={"tipp": MM}))


H = np.sqrt(3) / 2
TET = [[0, 0, 0], [1, 0, 0], [0.5, H, 0], [0.5, H / 3, np.sqrt(2 / 3)]]
TRI = [[0, 0], [1, 0], [0.5, H]]
QUAD = [[0, 0], [1, 0], [1, 1], [0, 1]]
IDEAL = {
    "tet": (TET, np.sqrt(2) / 12),
    "hex": ([[*p, z] for z in (0, 1) for p in QUAD], 1.0),
    "wedge": ([[*p, z] for z in (0, 1) for p in TRI], np.sqrt(3) / 4),
    "tri": (TRI, 2 * np.pi * 0.5 * np.sqrt(3) / 4),  # Pappus
    "quad": (QUAD, 2 * np.pi * 0.5),
}
VOLUME_FAMILIES = [name for name in FAMILIES if not name.startswith("line")]


def ideal(name: str, stretch: float = 1.0) -> Mesh:
    family = FAMILIES[name]
    corners = np.array(IDEAL[name.rstrip("0123456789")][0], dtype=float)
    middle = [corners[list(e)].mean(axis=0) for e in family.edges] if family.quadratic else []
    points = stretch * np.array([*corners, *middle])
    block = ElementBlock(name, np.arange(family.nodes)[None, :], "body")
    return Mesh(points=points, blocks=(block,))


@each("name", VOLUME_FAMILIES)
@each("stretch", [1.0, 1e-5])
def test_ideal_element_has_quality_one(name, stretch):
    mesh = ideal(name, stretch)

    np.testing.assert_allclose(scaled_jacobians(mesh.points, mesh.blocks[0]), 1, rtol=1e-12)
    np.testing.assert_allclose(edge_lengths(mesh), stretch, rtol=1e-12)
    volume = IDEAL[name.rstrip("0123456789")][1]
    assert corner_volume(mesh) == pytest.approx(volume * stretch**3, rel=1e-12)


@pytest.mark.parametrize("name", VOLUME_FAMILIES)
def test_mirrored_element_has_quality_minus_one(name):
    mesh = ideal(name)
    mirrored = mesh.points * [-1, *[1] * (mesh.dimension - 1)]

    np.testing.assert_allclose(scaled_jacobians(mirrored, mesh.blocks[0]), -1, rtol=1e-12)


def test_mid_node_at_the_quarter_point_makes_the_corner_singular():
    """The known quarter-point element: the tangent at the corner vanishes."""
    mesh = ideal("tri6")
    points = mesh.points.copy()
    points[3] = [0.25, 0]

    with pytest.raises(InputError, match=r"(?s)element 0 .tri6, solid 'body'.*smallest scaled"):
        require_positive_jacobians("test", Mesh(points=points, blocks=mesh.blocks))


def test_summary_names_the_worst_element():
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [3, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]])
    summary = mesh_summary(Mesh(points=points, blocks=(ElementBlock("tri3", triangles, "plate"),)))

    assert (summary.nodes, summary.elements, summary.families) == (5, 3, {"tri3": 3})
    assert summary.largest_edge == pytest.approx(np.sqrt(5), rel=1e-12)
    assert summary.smallest_edge == pytest.approx(1.0, rel=1e-12)
    # right angle between 1 and 2: smallest sine 1 / sqrt(5), over sin 60 deg
    assert summary.worst_quality == pytest.approx(1 / np.sqrt(5) / H, rel=1e-12)
    assert summary.worst_element.startswith("element 2 (tri3, solid 'plate') at r, z =")


def test_loose_parts_and_nodes_are_found():
    points = np.array([[0, 0], [1, 0], [0, 1], [2, 2], [3, 2], [2, 3.0]])
    block = ElementBlock("tri3", np.array([[0, 1, 2]]), "a")
    far = ElementBlock("tri3", np.array([[3, 4, 5]]), "b")

    with pytest.raises(InputError, match="2 parts that share no node"):
        require_connected("test", Mesh(points=points, blocks=(block, far)))
    with pytest.raises(InputError, match=r"2 parts .*one of 1 nodes, at r, z = 2000, 2000 mm"):
        require_connected("test", Mesh(points=points[:4], blocks=(block,)))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: MeshSizing(size=0.0), "MeshSizing.size: got 0 m"),
        (lambda: MeshSizing(size=1.0, surfaces={"top": -1.0}), r"surfaces\['top'\]: got -1 m"),
        (lambda: MeshSizing(size=1.0, grading=0.0), "above 0 and up to 1"),
        (lambda: Refinement(position=(1.0,), size=1.0), "1 numbers, expected two"),
        (lambda: Refinement(position=(1.0, 0.0), size=float("nan")), "Refinement.size: got nan"),
        (lambda: Refinement(position=(1.0, 0.0), size=1.0, radius=-1.0), "radius: got -1 m"),
    ],
)
def test_faulty_sizes_are_explained(make, text):
    with pytest.raises(KlackError, match=text):
        make()


@pytest.mark.parametrize("raised", [0.0, 7e-3])
def test_centre_and_inertia_are_those_of_a_cylinder_and_a_ball(raised):
    """``m r^2 / 2`` and ``m (3 r^2 + h^2) / 12``; ``2/5 m r^2``; and Steiner's term."""
    r, h = 2e-3, 5e-3
    corners = [(r, raised), (r, raised + h), (0.0, raised + h), (0.0, raised)]
    cylinder = Profile((0.0, raised), tuple(Line(end, "edge") for end in corners))
    for body, centre, polar, across in (
        (cylinder, raised + 0.5 * h, 0.5 * r**2, (3 * r**2 + h**2) / 12),
        (sphere(r, raised), raised, 0.4 * r**2, 0.4 * r**2),
    ):
        inertia = body.moments.inertia / body.volume
        assert body.moments.centre == pytest.approx([0.0, 0.0, centre], rel=1e-12, abs=1e-15)
        np.testing.assert_allclose(
            inertia, np.diag([across, across, polar]), rtol=1e-11, atol=1e-20
        )
