"""Swept solid meshes against the exact body of revolution.

Truth: exact geometry and topology.  The volume error of quadratic edges along a circle falls with
the fourth power of the number of layers.
"""

import numpy as np
import pytest

from klack.assembling.held_nodes import sector_nodes, surface_nodes
from klack.elasticity.quadrature import quadrature
from klack.elasticity.shape_functions import shape_functions
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, FaceTable, Mesh, Surface, outer_surface
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.quality import require_connected
from klack.mesh.sizing import MeshSizing, Refinement
from klack.mesh.swept import sweep

MM = 1e-3


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

    flux = sum(flux_and_area(mesh, surface)[0] for surface in mesh.surfaces.values())
    assert flux == pytest.approx(volume(mesh), rel=1e-12)
    skin = outer_surface(mesh)
    assert skin.face_count == sum(s.face_count for s in mesh.surfaces.values())
    assert flux_and_area(mesh, skin)[0] == pytest.approx(flux, rel=1e-12)
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
        area = flux_and_area(solid, solid.surface(name))[1]
        assert area == pytest.approx(needle().surface_area(name), rel=2e-4)


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
    assert flux_and_area(mesh, outer_surface(mesh))[0] == pytest.approx(volume(mesh), rel=1e-12)


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
        (solid, "shank", 3, 2.2, "do not overlap"),
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
