"""Element families: nodes, and those on faces and edges.

Node order is that of Abaqus and CalculiX: corners first, then mid-edge nodes. Face normals point
*out* of the element: corners of a 3-D face run anticlockwise seen from outside; a plane
(axisymmetric) element is left of its edge, and the outward normal is the tangent turned by -90
deg.
"""

from dataclasses import dataclass

__all__ = ["FAMILIES", "ElementFamily", "Face"]


@dataclass(frozen=True, slots=True)
class Face:
    """One side of an element: its family and local nodes."""

    family: str
    nodes: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementFamily:
    """Topology of one kind of element.

    Parameters
    ----------
    dimension
        3 for solids, 2 for plane (axisymmetric) elements and faces of solids, 1 for edges.
    corners
        Number; they come first.
    edges
        Local corners. In a quadratic family node ``corners + i`` is the middle of edge ``i``.
    faces
        Sides of codimension one.
    quadratic
        Every edge has a mid node.
    """

    name: str
    dimension: int
    corners: int
    edges: tuple[tuple[int, int], ...]
    faces: tuple[Face, ...]
    quadratic: bool

    @property
    def nodes(self) -> int:
        """Number of nodes per element."""
        return self.corners + (len(self.edges) if self.quadratic else 0)

    @property
    def linear(self) -> str:
        """Name of the family with the same corners and no mid nodes."""
        shape = self.dimension, self.corners
        return next(
            name
            for name, other in FAMILIES.items()
            if (other.dimension, other.corners) == shape and not other.quadratic
        )


_TRI_EDGES = ((0, 1), (1, 2), (2, 0))
_QUAD_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_HEX_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_WEDGE_EDGES = (
    *((0, 1), (1, 2), (2, 0)),
    *((3, 4), (4, 5), (5, 3)),
    *((0, 3), (1, 4), (2, 5)),
)
_TET_FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_HEX_FACES = (
    (0, 3, 2, 1),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
)
_WEDGE_FACES = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))

_FACE_NAMES = {(2, False): "line2", (2, True): "line3", (3, False): "tri3"}
_FACE_NAMES |= {(3, True): "tri6", (4, False): "quad4", (4, True): "quad8"}


def _face(
    corners: tuple[int, ...], edges: tuple[tuple[int, int], ...], n_corners: int, quadratic: bool
) -> Face:
    """Face with its mid nodes."""
    nodes = list(corners)
    size = len(corners)
    if quadratic:
        lookup = {frozenset(edge): n_corners + i for i, edge in enumerate(edges)}
        pairs = [(corners[i], corners[(i + 1) % size]) for i in range(size if size > 2 else 1)]
        nodes += [lookup[frozenset(pair)] for pair in pairs]
    return Face(_FACE_NAMES[size, quadratic], tuple(nodes))


def _family(
    name: str,
    dimension: int,
    corners: int,
    edges: tuple[tuple[int, int], ...],
    face_corners: tuple[tuple[int, ...], ...],
    quadratic: bool,
) -> ElementFamily:
    faces = tuple(_face(f, edges, corners, quadratic) for f in face_corners)
    return ElementFamily(
        name=name,
        dimension=dimension,
        corners=corners,
        edges=edges,
        faces=faces,
        quadratic=quadratic,
    )


FAMILIES: dict[str, ElementFamily] = {
    family.name: family
    for family in (
        _family("line2", 1, 2, ((0, 1),), (), False),
        _family("line3", 1, 2, ((0, 1),), (), True),
        _family("tri3", 2, 3, _TRI_EDGES, _TRI_EDGES, False),
        _family("tri6", 2, 3, _TRI_EDGES, _TRI_EDGES, True),
        _family("quad4", 2, 4, _QUAD_EDGES, _QUAD_EDGES, False),
        _family("quad8", 2, 4, _QUAD_EDGES, _QUAD_EDGES, True),
        _family("tet4", 3, 4, _TET_EDGES, _TET_FACES, False),
        _family("tet10", 3, 4, _TET_EDGES, _TET_FACES, True),
        _family("hex8", 3, 8, _HEX_EDGES, _HEX_FACES, False),
        _family("hex20", 3, 8, _HEX_EDGES, _HEX_FACES, True),
        _family("wedge6", 3, 6, _WEDGE_EDGES, _WEDGE_FACES, False),
        _family("wedge15", 3, 6, _WEDGE_EDGES, _WEDGE_FACES, True),
    )
}
