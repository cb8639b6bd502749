"""Solid meshes of a full turn, swept from an axisymmetric mesh.

Every triangle of the meridian becomes one ring of wedges, every wedge three tetrahedra. The
diagonal of the quadrilateral between two columns of nodes goes from the column with the lower
number in this layer to the other one in the next layer, so neighbours agree. On the axis a column
is a single node, and tetrahedra without volume are dropped. Nodes are placed in (r, z, theta), mid
nodes halfway in theta on the mid node of the meridian: all nodes of a surface lie on the exact
surface of revolution. A fine meridian with 12-24 layers resolves a contact ring with far fewer
points than an unstructured mesh.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.machine.memory import require_memory
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.quality import require_positive_jacobians
from klack.mesh.sizing import element_memory

__all__ = ["sweep"]

# (column, layer) of the four corners, for columns in ascending order, and the sign of the volume
# if those columns run anticlockwise in (r, z): theta, r, z is a left-handed order.
_STAIRCASE = (
    (((0, 0), (1, 0), (2, 0), (2, 1)), -1),
    (((0, 0), (1, 0), (1, 1), (2, 1)), +1),
    (((0, 0), (0, 1), (1, 1), (2, 1)), -1),
)


@dataclass(frozen=True)
class _Ring:
    """Corner nodes: columns of ``layers`` nodes, one node per column on the axis."""

    first: NDArray[np.int64]  # node of layer 0, by meridian node (-1 for mid nodes)
    axis: NDArray[np.bool_]  # by meridian node
    layers: int
    column: NDArray[np.int64]  # meridian node, by corner node
    layer: NDArray[np.int64]  # by corner node

    def node(self, column: NDArray[np.int64], layer: NDArray[np.int64]) -> NDArray[np.int64]:
        """Node of a column in a layer."""
        return self.first[column] + np.where(self.axis[column], 0, layer % self.layers)


def sweep(meridian: Mesh, layers: int, start_angle: float = 0.0) -> Mesh:
    """Turn a mesh of six-node triangles once around its axis into ten-node tetrahedra.

    Solids, surfaces and node sets stay; x = r cos(theta), y = r sin(theta).

    Parameters
    ----------
    meridian
        All elements ``tri6``.
    layers
        Elements around, at least 6.
    start_angle [rad]
        Of the first layer; two bodies in contact need not match.
    """
    _require_sweepable(meridian, layers)
    count = 3.0 * meridian.element_count * layers
    require_memory(
        "sweep: layers",
        element_memory(3, count),
        what=f"{layers} layers, which give {count:.2g} tetrahedra, a mesh",
        hint="fewer layers (18 are usual), or larger elements in the half section.",
    )
    ring = _ring(meridian, layers)
    tets = [_tetrahedra(ring, block.connectivity[:, :3]) for block in meridian.blocks]
    faces = {name: _triangles(ring, surface) for name, surface in meridian.surfaces.items()}
    edges = np.array(FAMILIES["tet10"].edges)
    keys = np.unique(np.concatenate([_keys(ring, t[:, edges]) for t in tets]))
    origin, layer = _middles(meridian, ring, keys)
    origin = np.concatenate([ring.column, origin])
    theta = start_angle + 2 * np.pi / layers * np.concatenate([ring.layer, layer])
    r, z = meridian.points[origin].T

    def quadratic(corners: NDArray[np.int64], family: str) -> NDArray[np.int64]:
        wanted = _keys(ring, corners[:, np.array(FAMILIES[family].edges)])
        middle = len(ring.column) + np.searchsorted(keys, wanted).reshape(len(corners), -1)
        return np.hstack([corners, middle])

    mesh = Mesh(
        points=np.column_stack([r * np.cos(theta), r * np.sin(theta), z]),
        blocks=tuple(
            ElementBlock("tet10", quadratic(corners, "tet10"), block.solid)
            for corners, block in zip(tets, meridian.blocks, strict=True)
        ),
        surfaces={
            name: Surface(name, (FaceBlock("tri6", quadratic(corners, "tri6")),))
            for name, corners in faces.items()
        },
        node_sets={
            name: np.flatnonzero(np.isin(origin, nodes))
            for name, nodes in meridian.node_sets.items()
        },
    )
    require_positive_jacobians("sweep", mesh)
    return mesh


def _require_sweepable(meridian: Mesh, layers: int) -> None:
    families = sorted({block.family for block in meridian.blocks})
    refuse_if(
        families != ["tri6"],
        "sweep: meridian",
        got=f"elements {', '.join(families) or 'none'}",
        expected="tri6 only",
        hint="make the meridian with mesh_meridian.",
    )
    refuse_if(
        layers < 6,
        "sweep: layers",
        got=str(layers),
        expected="at least 6 around the circumference",
        hint="12 to 24 are usual.",
    )


def _ring(meridian: Mesh, layers: int) -> _Ring:
    corners = np.unique(np.concatenate([b.connectivity[:, :3].ravel() for b in meridian.blocks]))
    axis = meridian.points[:, 0] == 0.0
    count = np.where(axis[corners], 1, layers)
    first = np.full(meridian.node_count, -1)
    first[corners] = np.cumsum(count) - count
    column = np.repeat(corners, count)
    layer = np.arange(len(column)) - first[column]
    return _Ring(first, axis, layers, column, layer)


def _tetrahedra(ring: _Ring, triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corner tetrahedra (n, 4) with positive volume."""
    order = np.argsort(triangles, axis=1)
    columns = np.take_along_axis(triangles, order, axis=1)
    # cyclic permutations of (0, 1, 2) keep the sense of the triangle
    even = (order[:, 1] - order[:, 0]) % 3 == 1
    layer = np.arange(ring.layers)
    parts = []
    for corners, sign in _STAIRCASE:
        nodes = [ring.node(columns[:, c, None], layer[None, :] + up) for c, up in corners]
        tets = np.stack(nodes, axis=-1)
        positive = even == (sign > 0)
        tets[~positive] = tets[~positive][..., [1, 0, 2, 3]]
        parts.append(tets.reshape(-1, 4))
    tets = np.concatenate(parts)
    ordered = np.sort(tets, axis=1)
    return tets[(np.diff(ordered, axis=1) > 0).all(axis=1)]


def _triangles(ring: _Ring, surface: Surface) -> NDArray[np.int64]:
    """Corner triangles (n, 3), anticlockwise from outside."""
    lines = np.concatenate([block.connectivity[:, :2] for block in surface.blocks])
    layer = np.arange(ring.layers)
    a, b = lines[:, :1], lines[:, 1:]
    a0, a1 = ring.node(a, layer), ring.node(a, layer + 1)
    b0, b1 = ring.node(b, layer), ring.node(b, layer + 1)
    up = np.broadcast_to(a < b, a0.shape)  # diagonal a0-b1, else b0-a1
    one = np.stack([a0, a1, np.where(up, b1, b0)], axis=-1)
    two = np.stack([np.where(up, a0, a1), b1, b0], axis=-1)
    tris = np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)])
    ordered = np.sort(tris, axis=1)
    return tris[(np.diff(ordered, axis=1) > 0).all(axis=1)]


def _keys(ring: _Ring, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of a pair of corner nodes, in either order."""
    pairs = np.sort(pairs.reshape(-1, 2), axis=1)
    return pairs[:, 0] * len(ring.column) + pairs[:, 1]


def _middles(
    meridian: Mesh, ring: _Ring, keys: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Meridian node and (half-integer) layer of each mid node."""
    p, q = np.divmod(keys, len(ring.column))
    a, b = ring.column[p], ring.column[q]
    origin = np.where(a == b, a, -1)
    across = a != b
    origin[across] = _meridian_middles(meridian, a[across], b[across])
    la, lb = ring.layer[p], ring.layer[q]
    layer = np.where(np.abs(la - lb) > 1, ring.layers - 0.5, 0.5 * (la + lb))
    layer = np.where(ring.axis[a], lb, np.where(ring.axis[b], la, layer))
    return origin, layer


def _meridian_middles(
    meridian: Mesh, a: NDArray[np.int64], b: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Mid node of meridian edges between corner nodes."""
    count = meridian.node_count
    keys, middles = [], []
    for block in meridian.blocks:
        pairs = np.sort(block.connectivity[:, np.array(FAMILIES["tri6"].edges)], axis=-1)
        keys.append((pairs[..., 0] * count + pairs[..., 1]).ravel())
        middles.append(block.connectivity[:, 3:].ravel())
    table, index = np.unique(np.concatenate(keys), return_index=True)
    wanted = np.minimum(a, b) * count + np.maximum(a, b)
    return np.concatenate(middles)[index][np.searchsorted(table, wanted)]
