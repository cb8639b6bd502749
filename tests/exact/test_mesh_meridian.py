"""Axisymmetric meshes against the exact profile.

Truth: exact geometry.  Nodes on edges to 1e-15 m (round-off at 10 mm); volume by quadrature of the
curved triangles: a quadratic edge follows an arc to fourth order, 1e-6 at the sizes used here.
"""

import numpy as np
import pytest

from klack.elasticity.quadrature import quadrature
from klack.elasticity.shape_functions import shape_functions
from klack.errors import InputError
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.quality import mesh_summary, require_connected
from klack.mesh.sizing import MeshSizing, Refinement

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
        assert surface_area(fine, name) == pytest.approx(profile.surface_area(name), rel=1e-5)


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
