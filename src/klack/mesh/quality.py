"""Checks of a mesh before any equation is solved with it.

The scaled Jacobian at the corners is the determinant of the edge tangents over the product of
their lengths, times the factor that makes it 1 for the ideal corner. The tangent at a corner of a
serendipity element depends on the edge only, :math:`t = 4 x_m - 3 x_0 - x_1` (linear:
:math:`x_1 - x_0`), so it is exact for every family.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import coo_array

from klack.errors import InputError
from klack.mesh.families import ElementFamily
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.moments import Moments

__all__ = [
    "MeshSummary",
    "PoorElementError",
    "corner_moments",
    "corner_volume",
    "edge_lengths",
    "mesh_summary",
    "require_connected",
    "require_positive_jacobians",
    "scaled_jacobians",
]


class PoorElementError(InputError):
    """An element is inverted or too flat; ``elements`` counts them."""

    elements: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshSummary:
    """Counts and extremes of a mesh.

    Parameters
    ----------
    families
        Elements of each.
    smallest_edge, largest_edge [m]
    worst_quality [-]
        Smallest scaled Jacobian.
    worst_element
        With its place.
    surfaces
        Faces of each.
    """

    nodes: int
    elements: int
    families: dict[str, int]
    smallest_edge: float
    largest_edge: float
    worst_quality: float
    worst_element: str
    surfaces: dict[str, int]


def _corner_stars(family: ElementFamily) -> list[list[tuple[int, int]]]:
    """Neighbours of each corner with edge numbers, right-handed."""
    stars: list[list[tuple[int, int]]] = []
    for corner in range(family.corners):
        star = []
        for number, (a, b) in enumerate(family.edges):
            if corner in (a, b):
                star.append((b if corner == a else a, number))
        stars.append(_right_handed(family.name, corner, star))
    return stars


_REFERENCE = {
    "tri": np.array([[0, 0], [1, 0], [0, 1]], float),
    "quad": np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float),
    "tet": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
    "wedge": np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]], float),
    "hex": np.array(
        [
            *([-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]),
            *([-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]),
        ],
        float,
    ),
}
# Determinant of unit edge vectors at a corner of the ideal (equilateral, square) element.
_IDEAL = {
    "tri": np.sqrt(3) / 2,
    "quad": 1.0,
    "tet": np.sqrt(0.5),
    "wedge": np.sqrt(3) / 2,
    "hex": 1.0,
}


def _shape(name: str) -> str:
    return name.rstrip("0123456789")


def _right_handed(name: str, corner: int, star: list[tuple[int, int]]) -> list[tuple[int, int]]:
    x = _REFERENCE[_shape(name)]
    tangents = np.array([x[other] - x[corner] for other, _ in star])
    if np.linalg.det(tangents) < 0:
        star[0], star[1] = star[1], star[0]
    return star


def scaled_jacobians(points: NDArray[np.float64], block: ElementBlock) -> NDArray[np.float64]:
    """Scaled Jacobian at every corner, shape (n_elements, n_corners) [-]."""
    family = block.topology
    x = points[block.connectivity]
    result = np.empty((len(x), family.corners))
    for corner, star in enumerate(_corner_stars(family)):
        tangents = np.empty((len(x), family.dimension, family.dimension))
        for row, (other, edge) in enumerate(star):
            tangents[:, row] = x[:, other] - x[:, corner]
            if family.quadratic:
                middle = x[:, family.corners + edge]
                tangents[:, row] = 4 * middle - 3 * x[:, corner] - x[:, other]
        lengths = np.linalg.norm(tangents, axis=2).prod(axis=1)
        determinant = np.linalg.det(tangents)
        result[:, corner] = np.divide(
            determinant, lengths, out=np.full(len(x), -1.0), where=lengths > 0
        )
    return result / _IDEAL[_shape(block.family)]


def edge_lengths(mesh: Mesh) -> NDArray[np.float64]:
    """Straight length of every element edge [m], repeated where shared."""
    parts = []
    for block in mesh.blocks:
        pairs = block.connectivity[:, np.array(block.topology.edges)]
        parts.append(np.linalg.norm(np.diff(mesh.points[pairs], axis=2), axis=-1).ravel())
    return np.concatenate(parts)


def corner_volume(mesh: Mesh) -> float:
    """Volume [m^3] of elements with straight edges; a plane mesh is turned."""
    total = 0.0
    for part in _simplices(mesh):
        determinant = np.linalg.det(part[:, 1:] - part[:, :1])
        if part.shape[2] == 2:
            total += float(np.sum(np.pi * determinant * part[:, :, 0].mean(axis=1)))
        else:
            total += float(determinant.sum() / 6)
    return total


def _simplices(mesh: Mesh) -> Iterator[NDArray[np.float64]]:
    """Corners (n, d + 1, d) of the triangles or tetrahedra that fill straight-edged elements."""
    for block in mesh.blocks:
        x = mesh.points[block.connectivity[:, : block.topology.corners]]
        for corners in _SPLIT[_shape(block.family)]:
            yield x[:, list(corners)]


def corner_moments(mesh: Mesh) -> Moments:
    r"""Of elements with straight edges; a plane mesh is turned.

    Exact integrals of products over simplices, as of three linear functions over a triangle:
    :math:`\int fgh = A/60\,(F G H + F\,\Sigma gh + G\,\Sigma fh + H\,\Sigma fg + 2\,\Sigma fgh)`,
    with sums over the corners and :math:`F = \Sigma f`.
    """
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for x in _simplices(mesh):
        size = np.linalg.det(x[:, 1:] - x[:, :1])
        total = x.sum(axis=1)
        if x.shape[2] == 3:
            volume += float(size.sum()) / 6.0
            first += size @ total / 24.0
            pairs = np.einsum("nci,ncj->nij", x, x) + total[:, :, None] * total[:, None, :]
            second += np.einsum("n,nij->ij", size, pairs) / 120.0
            continue
        ring, (r, z) = np.pi * size, (x[:, :, 0], x[:, :, 1])  # twice the area, times 2 pi / 2
        volume += float(ring @ total[:, 0]) / 3.0
        first[2] += ring @ _product(r, z) / 12.0
        rr, zz = ring @ _product(r, r, r) / 60.0, ring @ _product(r, z, z) / 60.0
        second += np.diag([0.5 * rr, 0.5 * rr, zz])
    return Moments.about_origin(volume, first, second)


def _product(
    f: NDArray[np.float64], g: NDArray[np.float64], h: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Symmetric sum of linear functions over corners (n, corners), as above, without ``A``."""
    F, G, fg = f.sum(axis=1), g.sum(axis=1), (f * g).sum(axis=1)
    if h is None:
        return F * G + fg
    H = h.sum(axis=1)
    mixed = F * (g * h).sum(axis=1) + G * (f * h).sum(axis=1) + H * fg
    return F * G * H + mixed + 2.0 * (f * g * h).sum(axis=1)


# Simplices that fill the straight-edged element.
_SPLIT = {
    "tri": ((0, 1, 2),),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "tet": ((0, 1, 2, 3),),
    "wedge": ((0, 1, 2, 5), (0, 1, 5, 4), (0, 4, 5, 3)),
    "hex": (
        *((0, 1, 3, 7), (1, 2, 3, 7), (0, 1, 7, 4)),
        *((1, 5, 7, 4), (1, 2, 7, 6), (1, 6, 7, 5)),
    ),
}


def _worst(mesh: Mesh) -> tuple[float, int, ElementBlock, NDArray[np.float64]]:
    """Smallest scaled Jacobian, number of its element over all blocks, block, place."""
    found = []
    before = 0
    for block in mesh.blocks:
        if len(block.connectivity):
            lowest = scaled_jacobians(mesh.points, block).min(axis=1)
            i = int(np.argmin(lowest))
            place = mesh.points[block.connectivity[i]].mean(axis=0)
            found.append((float(lowest[i]), before + i, block, place))
        before += len(block.connectivity)
    return min(found, key=lambda item: item[0])


def _place(x: NDArray[np.float64]) -> str:
    letters = "x, y, z" if len(x) == 3 else "r, z"
    return f"{letters} = {', '.join(f'{1e3 * c:.4g}' for c in x)} mm"


def mesh_summary(mesh: Mesh) -> MeshSummary:
    """Counts, edge lengths and worst element."""
    quality, number, block, place = _worst(mesh)
    worst = f"element {number} ({block.family}, solid '{block.solid}')"
    lengths = edge_lengths(mesh)
    families: dict[str, int] = {}
    for part in mesh.blocks:
        families[part.family] = families.get(part.family, 0) + len(part.connectivity)
    return MeshSummary(
        nodes=mesh.node_count,
        elements=mesh.element_count,
        families=families,
        smallest_edge=float(lengths.min()),
        largest_edge=float(lengths.max()),
        worst_quality=quality,
        worst_element=f"{worst} at {_place(place)}",
        surfaces={name: surface.face_count for name, surface in mesh.surfaces.items()},
    )


def require_positive_jacobians(
    where: str,
    mesh: Mesh,
    smallest: float = 0.0,
    numbers: Sequence[NDArray[np.int64]] | None = None,
) -> None:
    """Reject an element whose scaled Jacobian is not above ``smallest``.

    ``numbers`` are element numbers for the message, by block; default: from 0.
    """
    quality, number, block, place = _worst(mesh)
    if numbers is not None:
        number = int(np.concatenate(list(numbers))[number])
    if not quality > smallest:
        error = PoorElementError(
            f"{where}: element {number} ({block.family}, solid '{block.solid}') at {_place(place)}",
            got=f"a smallest scaled Jacobian of {quality:.3g}",
            expected=f"above {smallest:g} (1 is ideal, below 0 is inverted)",
            hint="refine the mesh where the boundary is curved, or check the order of the nodes.",
        )
        error.elements = mesh.element_count
        raise error


def require_connected(where: str, mesh: Mesh) -> None:
    """Reject elements in several parts, and nodes of no element."""
    rows = [np.repeat(b.connectivity[:, :1], b.connectivity.shape[1] - 1, 1) for b in mesh.blocks]
    i = np.concatenate([row.ravel() for row in rows])
    j = np.concatenate([block.connectivity[:, 1:].ravel() for block in mesh.blocks])
    n = mesh.node_count
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(n, n))
    count, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    if count > 1:
        sizes = np.bincount(labels)
        small = int(np.argmin(sizes))
        node = int(np.flatnonzero(labels == small)[0])
        raise InputError(
            where,
            got=f"{count} parts that share no node (one of {sizes[small]} nodes, "
            f"at {_place(mesh.points[node])})",
            expected="one connected body without loose nodes",
            hint="merge coincident nodes in the mesher, or define one body per part.",
        )
