"""Sections of boxes and swept bodies against exact areas, lengths and displacement fields."""

import numpy as np
import pytest
from draws import each

from klack.analyses.impact.record import SectionPicture
from klack.analyses.impact.section import section_picture
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.swept import sweep

CORNERS = np.array(
    [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
)
PARTS = {
    "hex": ((0, 1, 2, 3, 4, 5, 6, 7),),
    "wedge": ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)),
    "tet": ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
}
SHIFT = 2e-6  # relative; the plane is moved by 1e-8, points closer than 1e-6 are merged


def box(family: str, low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
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
    picture = _section(box(family, (left, front, 0), (2, 1, 1)))

    assert areas(picture).sum() == pytest.approx(2.0 - max(left, 0.0), rel=SHIFT)
    assert areas(picture).min() >= 0.0
    assert rim_length(picture) == pytest.approx(2.0 * (3.0 - max(left, 0.0)), rel=SHIFT)
    assert picture.points[:, 0].min() >= -1e-12


def _section(mesh: Mesh) -> SectionPicture:
    return section_picture(mesh, np.zeros(mesh.dof_count), 0.0, "box")


@pytest.mark.parametrize("family", ["hex8", "hex20"])
def test_outline_of_bricks(family: str) -> None:
    """Two by two cells over 2 x 1: three lines of length 2, three of length 1, nothing inside."""
    picture = _section(box(family, (-1, -1, 0), (2, 1, 1)))

    assert length(picture) == pytest.approx(9.0, rel=SHIFT)


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15"])
def test_quadratic_displacement_is_exact_at_the_nodes_of_the_cut(family: str) -> None:
    """Quadratic fields lie in the element spaces; plane x-z through nodes, so cut points are nodes.

    Centres of hexahedra are interpolated with 20 nodes, exact for quadratic fields.
    """
    mesh = box(family, (-1, -1, 0), (2, 1, 1))
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
    mesh = box("tet10", (-1, -1, 0), (2, 1, 1))
    with pytest.raises(InputError, match="section of body 'box': displacement"):
        section_picture(mesh, np.zeros(7), 0.0, "box")
    aside = mesh.moved(np.array([0.0, 5.0, 0.0]))
    with pytest.raises(InputError, match="half plane y = 0"):
        section_picture(aside, np.zeros(mesh.dof_count), 0.0, "box")
