"""Quality measures against elements whose shape is known. Truth: exact, 1e-12."""

import numpy as np
import pytest
from draws import each

from klack.errors import InputError, KlackError
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.quality import (
    corner_volume,
    edge_lengths,
    mesh_summary,
    require_connected,
    require_positive_jacobians,
    scaled_jacobians,
)
from klack.mesh.sizing import MeshSizing, Refinement

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
