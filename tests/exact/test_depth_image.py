"""What is seen of solids: skin, sections, depth.

Outer surface as triangles; truth: areas, volumes and normals of boxes and prisms.

Sections of boxes and swept bodies against exact areas, lengths and displacement fields.

What a viewer sees of solids; truth: areas, depths and hidden faces of boxes and a tube.
"""

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest
from draws import each

from klack.analyses.impact.record import SectionPicture
from klack.analyses.impact.section import section_picture
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, Mesh, Surface, outer_surface
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.skin import Skin, skin_of_mesh
from klack.mesh.swept import sweep
from klack.report.depth_image import Camera, Quarter, Seen, Window, outlines, seen_of

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


CORNERS = np.array(
    [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
)
PARTS = {
    "hex": ((0, 1, 2, 3, 4, 5, 6, 7),),
    "wedge": ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)),
    "tet": ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
}
SHIFT = 2e-6  # relative; the plane is moved by 1e-8, points closer than 1e-6 are merged


def box_section(family: str, low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
    """Box of 3 x 2 x 2 cells of the given elements."""
    cells = (3, 2, 2)
    axes = [np.linspace(a, b, 2 * n + 1) for a, b, n in zip(low, high, cells, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    shape = tuple(2 * n + 1 for n in cells)
    topology = FAMILIES[family]
    elements = []
    for cell in np.ndindex(*cells):
        place = 2 * np.array(cell) + CORNERS
        for part in PARTS[family.rstrip("0123456789")]:
            where = [place[i] for i in part]
            if topology.quadratic:
                where += [(where[a] + where[b]) // 2 for a, b in topology.edges]
            elements.append(np.ravel_multi_index(np.array(where).T, shape))
    used, nodes = np.unique(np.array(elements), return_inverse=True)
    connectivity = nodes.reshape(len(elements), -1)
    return Mesh(points=grid[used], blocks=(ElementBlock(family, connectivity, "box"),))


def rectangle(columns: int, rows: int, family: str = "tri6") -> Mesh:
    """Radius 1, height 2, in six-node triangles or eight-node quadrilaterals."""
    r, z = np.linspace(0, 1, 2 * columns + 1), np.linspace(0, 2, 2 * rows + 1)
    points = np.stack(np.meshgrid(r, z, indexing="ij"), axis=-1).reshape(-1, 2)
    i, j = np.meshgrid(2 * np.arange(columns), 2 * np.arange(rows), indexing="ij")
    patterns = {
        "tri6": [
            [(0, 0), (2, 0), (2, 2), (1, 0), (2, 1), (1, 1)],
            [(0, 0), (2, 2), (0, 2), (1, 1), (1, 2), (0, 1)],
        ],
        "quad8": [[(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]],
    }[family]
    elements = [
        np.column_stack([((i + a) * len(z) + j + b).ravel() for a, b in pattern])
        for pattern in patterns
    ]
    return Mesh(points=points, blocks=(ElementBlock(family, np.concatenate(elements), "rod"),))


def areas(picture: SectionPicture) -> np.ndarray:
    a, b, c = (picture.points[picture.triangles[:, i]] for i in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def rim_length(picture: SectionPicture) -> float:
    """Length of all sides that only one triangle has: the outline, if nothing gapes inside."""
    sides = np.concatenate([picture.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    unique, number = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    a, b = picture.points[unique[number == 1].T]
    return float(np.linalg.norm(b - a, axis=1).sum())


def length(picture: SectionPicture) -> float:
    a, b = picture.points[picture.edges[:, 0]], picture.points[picture.edges[:, 1]]
    return float(np.linalg.norm(b - a, axis=1).sum())


@each("family", ["tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15"])
@each("left", [-1.0, -1.3, 0.25])
@each("front", [-1.0, -0.7])
def test_area_of_a_box(family: str, left: float, front: float) -> None:
    picture = _section(box_section(family, (left, front, 0), (2, 1, 1)))

    assert areas(picture).sum() == pytest.approx(2.0 - max(left, 0.0), rel=SHIFT)
    assert areas(picture).min() >= 0.0
    assert rim_length(picture) == pytest.approx(2.0 * (3.0 - max(left, 0.0)), rel=SHIFT)
    assert picture.points[:, 0].min() >= -1e-12


def _section(mesh: Mesh) -> SectionPicture:
    return section_picture(mesh, np.zeros(mesh.dof_count), 0.0, "box")


@pytest.mark.parametrize("family", ["hex8", "hex20"])
def test_outline_of_bricks(family: str) -> None:
    """Two by two cells over 2 x 1: three lines of length 2, three of length 1, nothing inside."""
    picture = _section(box_section(family, (-1, -1, 0), (2, 1, 1)))

    assert length(picture) == pytest.approx(9.0, rel=SHIFT)


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15"])
def test_quadratic_displacement_is_exact_at_the_nodes_of_the_cut(family: str) -> None:
    """Quadratic fields lie in the element spaces; plane x-z through nodes, so cut points are nodes.

    Centres of hexahedra are interpolated with 20 nodes, exact for quadratic fields.
    """
    mesh = box_section(family, (-1, -1, 0), (2, 1, 1))
    x, y, z = mesh.points.T
    u = np.column_stack([x * z, 0.3 * x, z * z + x * x - y])

    picture = section_picture(mesh, u.ravel(), 1e-6, "box")

    r, h = picture.points.T
    # 1e-5: slope of the field times the merging distance of 2e-6
    np.testing.assert_allclose(
        picture.displacement, np.column_stack([r * h, h**2 + r**2]), atol=1e-5
    )
    expected = np.sqrt((r * h) ** 2 + (0.3 * r) ** 2 + (h**2 + r**2) ** 2)
    np.testing.assert_allclose(picture.magnitude, expected, atol=1e-5)
    assert picture.time == 1e-6


def test_a_swept_body_gives_its_meridian_back() -> None:
    """Element sides lie exactly in the cutting plane: the worst case for a cut, exact area 2."""
    meridian = rectangle(4, 8)
    solid = sweep(meridian, 12)
    x, y, z = solid.points.T

    flat = _section(meridian)
    cut = section_picture(solid, np.column_stack([-0.3 * x, -0.3 * y, z]).ravel(), 0.0, "rod")

    assert areas(cut).sum() == pytest.approx(2.0, rel=SHIFT)
    assert len(cut.triangles) == len(flat.triangles) == 4 * 64
    assert length(cut) == pytest.approx(length(flat), rel=SHIFT)
    np.testing.assert_allclose(cut.displacement[:, 0], -0.3 * cut.points[:, 0], atol=1e-5)
    np.testing.assert_allclose(cut.displacement[:, 1], cut.points[:, 1], atol=1e-5)


@pytest.mark.parametrize(("family", "triangles"), [("tri6", 4 * 2), ("quad8", 6)])
def test_axisymmetric_elements_through_their_mid_nodes(family: str, triangles: int) -> None:
    mesh = rectangle(3, 2, family)
    picture = _section(mesh)

    assert len(picture.triangles) == triangles * 6
    assert areas(picture).sum() == pytest.approx(2.0, rel=1e-12)
    lines = 4 * 2.0 + 3 * 1.0 + (6 * np.hypot(1 / 3, 1.0) if family == "tri6" else 0.0)
    assert length(picture) == pytest.approx(lines, rel=1e-12)


def test_closing_motion_is_the_mean_of_a_free_body_only() -> None:
    """u_z = -3 + z on a cylinder of height 2: mean -2 over the volume; held bodies have none."""
    mesh = rectangle(4, 4)
    u = np.zeros((mesh.node_count, 2))
    u[:, 1] = -3.0 + mesh.points[:, 1]

    assert section_picture(mesh, u.ravel(), 0.0, "rod").closing == pytest.approx(-2.0, rel=1e-12)

    u[mesh.points[:, 1] == 0.0] = 0.0
    assert section_picture(mesh, u.ravel(), 0.0, "rod").closing == 0.0


def test_wrong_displacements_and_missed_bodies_are_refused() -> None:
    mesh = box_section("tet10", (-1, -1, 0), (2, 1, 1))
    with pytest.raises(InputError, match="section of body 'box': displacement"):
        section_picture(mesh, np.zeros(7), 0.0, "box")
    aside = mesh.moved(np.array([0.0, 5.0, 0.0]))
    with pytest.raises(InputError, match="half plane y = 0"):
        section_picture(aside, np.zeros(mesh.dof_count), 0.0, "box")


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
