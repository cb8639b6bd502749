"""What a viewer sees of solids; truth: areas, depths and hidden faces of boxes and a tube."""

from math import cos, radians

import numpy as np
import pytest

from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.skin import Skin, skin_of_mesh
from klack.report.depth_image import Camera, Quarter, Seen, Window, outlines, seen_of

OBLIQUE = Camera(radians(-58.0), radians(24.0))
LEVEL = Camera(radians(-90.0), 0.0)
QUARTER = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
SIDES = np.array([3.0, 1.0, 2.0])


def solid(*sides: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)):
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    brick = ElementBlock("hex8", np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), "box")
    skin = skin_of_mesh(Mesh(points=corners * sides, blocks=(brick,)))
    return skin.points + np.array(at), skin.triangles


def tube() -> Skin:
    """Of 2 to 3 mm radius, 5 mm high, revolved."""
    profile = Profile(
        (2e-3, 0.0),
        (
            Line((3e-3, 0.0), "bottom"),
            Line((3e-3, 5e-3), "outside"),
            Line((2e-3, 5e-3), "top"),
            Line((2e-3, 0.0), "bore"),
        ),
    )
    return skin_of_mesh(mesh_meridian({"tube": profile}, MeshSizing(size=1e-3)))


def look(bodies, camera=OBLIQUE, quarter=None, pixels=400, size=6.0) -> tuple[Seen, float]:
    """Seen in a square window round the middle of the first body, and the area of a pixel."""
    middle = bodies[0][0].mean(axis=0) @ camera.axes[:2].T
    left, bottom = middle - 0.5 * size
    window = Window(left, bottom, size / pixels, pixels, pixels)
    return seen_of(bodies, camera, window, quarter), (size / pixels) ** 2


def area_seen(camera: Camera, sides: np.ndarray) -> float:
    """Of the silhouette of a box: its three visible faces, each across the line of sight."""
    a, b, c = sides
    return float(np.abs(camera.axes[2]) @ [b * c, a * c, a * b])


def test_the_axes_of_a_picture_are_those_of_the_viewer() -> None:
    right, up, away = LEVEL.axes

    np.testing.assert_allclose(right, [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(away, [0, 1, 0], atol=1e-15)
    assert np.linalg.det(OBLIQUE.axes) == pytest.approx(-1.0, rel=1e-14)


def test_a_box_seen_from_the_front_has_its_exact_number_of_pixels() -> None:
    """Sides and diagonals of triangles run through pixel centres: none is lost, none doubled."""
    points, triangles = solid(3.0, 1.0, 2.0)

    seen = seen_of([(points, triangles)], LEVEL, Window(-0.05, -0.05, 0.1, 40, 30))

    assert np.sum(seen.body == 0) == 30 * 20
    np.testing.assert_allclose(seen.depth[seen.body == 0], 0.0, atol=1e-15)


def test_a_box_covers_its_projected_area() -> None:
    seen, pixel = look([solid(*SIDES)])

    # a pixel at the rim counts whole or not at all: half a pixel along the upright sides is 0.4 %
    assert np.sum(seen.body == 0) * pixel == pytest.approx(area_seen(OBLIQUE, SIDES), rel=6e-3)


def test_each_face_is_seen_where_it_is_nearest() -> None:
    """Shares of front, side and top, and the depth of each pixel on its plane."""
    points, triangles = solid(*SIDES)
    seen, pixel = look([(points, triangles)])
    normal = np.cross(
        points[triangles[:, 1]] - points[triangles[:, 0]],
        points[triangles[:, 2]] - points[triangles[:, 0]],
    )
    axis = np.argmax(np.abs(normal), axis=1)[seen.triangle]
    weights = np.abs(OBLIQUE.axes[2]) * [2.0, 6.0, 3.0]

    for k in range(3):
        area = np.sum((seen.body == 0) & (axis == k)) * pixel
        assert area == pytest.approx(weights[k], rel=1e-2)
    # the viewer stands at x > 0, y < 0, z > 0: the nearest corner is there
    near = points @ OBLIQUE.axes[2]
    nearest = np.array([3.0, 0.0, 2.0]) @ OBLIQUE.axes[2]
    assert near.min() == pytest.approx(nearest, rel=1e-14)
    assert seen.depth.min() == pytest.approx(nearest, abs=0.02)


@pytest.mark.parametrize(("place", "share"), [(3.0, 0.0), (-3.0, 1.0)])
@pytest.mark.parametrize("order", [1, -1])
def test_what_is_behind_is_hidden(place: float, share: float, order: int) -> None:
    """A small box behind a large one along the line of sight, or before it; in either order."""
    large, small = solid(2.0, 2.0, 2.0), solid(0.2, 0.2, 0.2)
    points = small[0] - 0.1 + 1.0 + place * OBLIQUE.axes[2]
    seen, pixel = look([large, (points, small[1])][::order], size=8.0)

    own = np.sum(seen.body == (1 if order > 0 else 0)) * pixel
    expected = share * area_seen(OBLIQUE, np.full(3, 0.2))
    assert own == pytest.approx(expected, rel=0.06)  # 0.2 is ten pixels


def test_the_cut_faces_of_a_box_have_their_area_and_depth() -> None:
    corner = np.array([1.0, 0.6, 1.0])
    seen, pixel = look([solid(*SIDES)], quarter=Quarter(corner, QUARTER))
    away = np.abs(OBLIQUE.axes[2])

    # behind x = 1 lies the face of 0.6 x 2, behind y = 0.6 that of 2 x 2
    assert np.sum(seen.cut == 0) * pixel == pytest.approx(0.6 * 2.0 * away[0], rel=1e-2)
    assert np.sum(seen.cut == 1) * pixel == pytest.approx(2.0 * 2.0 * away[1], rel=1e-2)
    assert np.all(seen.triangle[seen.cut >= 0] == -1)
    rows, columns = np.nonzero(seen.cut == 1)
    side = np.sqrt(pixel)
    middle = np.array([1.5, 0.5, 1.0]) @ OBLIQUE.axes[:2].T - 3.0
    flat = middle + side * (np.stack([columns, rows], axis=1) + 0.5)
    x = flat @ OBLIQUE.axes[:2] + seen.depth[rows, columns][:, None] * OBLIQUE.axes[2]
    np.testing.assert_allclose(x[:, 1], 0.6, atol=1e-5)
    assert x[:, 0].min() > 1.0 - 1e-9


def test_a_cut_that_lies_on_the_surface_is_whole() -> None:
    """Half a body, drawn up to its plane of symmetry: the surface itself is the cut face."""
    points, triangles = solid(2.0, 1.0, 2.0)
    seen, pixel = look(
        [(points - [1.0, 0.0, 0.0], triangles)], quarter=Quarter(np.zeros(3), QUARTER)
    )

    assert np.sum(seen.cut == 1) * pixel == pytest.approx(2.0 * abs(OBLIQUE.axes[2, 1]), rel=1e-2)


def test_a_tube_is_cut_through_its_wall_and_stays_open() -> None:
    skin = tube()
    seen, pixel = look(
        [(skin.points, skin.triangles)],
        Camera(radians(-45.0), radians(20.0)),
        Quarter(np.zeros(3), QUARTER),
        size=10e-3,
    )

    wall = 1e-3 * 5e-3 * cos(radians(45.0)) * cos(radians(20.0))
    for plane in (0, 1):
        assert np.sum(seen.cut == plane) * pixel == pytest.approx(wall, rel=2e-2)
    # through the bore the inner wall is seen: in the middle, above the lower rim
    middle = seen.triangle[200, 200]
    assert middle >= 0
    assert skin.faces[skin.face[skin.triangles[middle, 0]]] == "bore"


def test_a_quarter_beside_the_bodies_takes_nothing_away() -> None:
    bodies = [solid(*SIDES)]
    whole, _ = look(bodies)
    far, _ = look(bodies, quarter=Quarter(np.array([10.0, 0.5, 1.0]), QUARTER))

    np.testing.assert_array_equal(whole.triangle, far.triangle)


def test_lines_are_drawn_between_surfaces_and_where_one_hides_itself() -> None:
    surface = np.zeros((4, 6), dtype=int)
    surface[:, 3:] = 1
    depth, slope = np.zeros((4, 6)), np.zeros((4, 6))
    depth[2:, :2] = 10.0

    lines = outlines(surface, depth, slope)

    expected = np.zeros((4, 6), dtype=bool)
    expected[:, 2:4] = True
    expected[1:3, :2] = True
    expected[2:, 1:3] = True
    np.testing.assert_array_equal(lines, expected)
    assert not outlines(np.zeros((4, 6), int), depth, slope + 2.0).any()
