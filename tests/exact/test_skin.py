"""Outer surface as triangles; truth: areas, volumes and normals of boxes and prisms."""

from dataclasses import replace
from math import pi, sin

import numpy as np
import pytest

from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, Mesh, Surface, outer_surface
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.skin import Skin, skin_of_mesh
from klack.mesh.swept import sweep

ROUND_OFF = 1e-12


def box(*sides: float) -> Mesh:
    """One brick."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float) * sides
    return Mesh(
        points=corners, blocks=(ElementBlock("hex8", np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), "box"),)
    )


def with_top(mesh: Mesh) -> Mesh:
    """The same with the name 'top' for its highest face."""
    height = mesh.points[:, 2].max()
    blocks = tuple(
        replace(
            b, connectivity=b.connectivity[(mesh.points[b.connectivity][..., 2] == height).all(1)]
        )
        for b in outer_surface(mesh).blocks
    )
    return replace(mesh, surfaces={"top": Surface("top", blocks)})


def triangle_vectors(skin: Skin) -> np.ndarray:
    a, b, c = (skin.points[skin.triangles[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def volume(skin: Skin) -> float:
    """Of what the triangles enclose, above zero where they are seen anticlockwise from outside."""
    middle = skin.points[skin.triangles].mean(axis=1)
    return float(np.sum(middle * triangle_vectors(skin)) / 3.0)


def ring() -> Mesh:
    """Half section of a ring of 2 to 3 mm, 5 mm high, with names."""
    profile = Profile(
        (2e-3, 0.0),
        (
            Line((3e-3, 0.0), "bottom"),
            Line((3e-3, 5e-3), "outside"),
            Line((2e-3, 5e-3), "top"),
            Line((2e-3, 0.0), "bore"),
        ),
    )
    return mesh_meridian({"ring": profile}, MeshSizing(size=1e-3))


def test_a_box_has_its_area_volume_and_sharp_edges():
    skin = skin_of_mesh(with_top(box(2.0, 3.0, 5.0)))

    vectors = triangle_vectors(skin)
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(2 * (6 + 10 + 15), rel=ROUND_OFF)
    assert volume(skin) == pytest.approx(30.0, rel=ROUND_OFF)
    assert len(skin.points) == 24  # a corner once for each of its three faces
    assert len(skin.creases) == 24  # twelve edges from both sides
    assert len(skin.element_edges) == 12
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    for corner in range(3):
        np.testing.assert_allclose(skin.normals[skin.triangles[:, corner]], unit, atol=ROUND_OFF)


def test_the_name_of_a_face_is_at_its_vertices_only():
    skin = skin_of_mesh(with_top(box(2.0, 3.0, 5.0)))

    assert skin.faces == ("top",)
    np.testing.assert_array_equal(skin.face == 0, skin.normals[:, 2] > 0.5)
    assert np.all(skin.points[skin.face == 0, 2] == 5.0)


@pytest.mark.parametrize("layers", [12, 18])
def test_a_swept_body_has_the_volume_of_its_prism_and_all_named_areas(layers):
    skin = skin_of_mesh(sweep(ring(), layers))

    # curved sides become chords through their mid nodes: a prism of twice as many corners
    corners = 2 * layers
    section = 0.5 * corners * sin(2 * pi / corners) * (3e-3**2 - 2e-3**2)
    assert volume(skin) == pytest.approx(5e-3 * section, rel=1e-9)
    top = skin.face[skin.triangles[:, 0]] == skin.faces.index("top")
    area = np.linalg.norm(triangle_vectors(skin)[top], axis=1).sum()
    assert area == pytest.approx(section, rel=1e-9)


def test_a_half_section_is_revolved_with_normals_to_the_outside():
    mesh = ring()
    skin = skin_of_mesh(mesh)

    corners = len(np.unique(np.round(skin.angle, 9)))
    section = 0.5 * corners * sin(2 * pi / corners) * (3e-3**2 - 2e-3**2)
    assert volume(skin) == pytest.approx(5e-3 * section, rel=1e-9)
    radius, height = mesh.points[skin.node].T
    np.testing.assert_allclose(np.hypot(*skin.points[:, :2].T), radius, rtol=ROUND_OFF)
    np.testing.assert_array_equal(skin.points[:, 2], height)
    outside = skin.face == skin.faces.index("outside")
    outward = skin.points[outside] * [1.0, 1.0, 0.0] / radius[outside, None]
    # a vertex at the end of a side has one triangle to the left and two to the right: the mean of
    # their normals is a third of half a segment off
    np.testing.assert_allclose(skin.normals[outside], outward, atol=1.001 * pi / corners / 3)


def test_a_body_on_the_axis_is_closed_there():
    profile = Profile(
        (0.0, 0.0),
        (
            Line((2e-3, 0.0), "end"),
            Line((2e-3, 4e-3), "side"),
            Line((0.0, 4e-3), "top"),
            Line((0.0, 0.0), "axis"),
        ),
    )
    skin = skin_of_mesh(mesh_meridian({"rod": profile}, MeshSizing(size=1e-3)))

    corners = len(np.unique(np.round(skin.angle, 9)))
    area = 0.5 * corners * sin(2 * pi / corners) * 2e-3**2
    assert volume(skin) == pytest.approx(4e-3 * area, rel=1e-9)
    np.testing.assert_allclose(triangle_vectors(skin).sum(axis=0), 0.0, atol=1e-18)
    assert "axis" not in {skin.faces[i] for i in skin.face if i >= 0}
