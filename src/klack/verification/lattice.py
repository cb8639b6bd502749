"""Structured meshes of boxes for checks: any family, any map of the box into space.

All nodes are points of one lattice with two steps per cell: a map moves mid nodes onto curved
surfaces exactly.
"""

from collections.abc import Callable, Sequence
from itertools import permutations, product

import numpy as np

from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface

__all__ = ["STEEL", "lattice_mesh"]


STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)

_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_SPLITS: dict[str, list[list[tuple[int, ...]]]] = {
    "quad": [list(_SQUARE)],
    "tri": [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]],
    "hex": [[(*corner, z) for z in (0, 1) for corner in _SQUARE]],
    "wedge": [
        [(*corner, z) for z in (0, 1) for corner in triangle]
        for triangle in (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1)))
    ],
}
_SIDES = {
    2: ("inner", "outer", "bottom", "top"),
    3: ("left", "right", "front", "back", "bottom", "top"),
}


def _kuhn() -> list[list[tuple[int, ...]]]:
    """Six tetrahedra of a unit cube around one diagonal, all of positive volume."""
    tets = []
    for order in permutations(range(3)):
        path = [np.zeros(3, dtype=int)]
        for axis in order:
            path.append(path[-1] + np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(path[1:]) - path[0]) < 0:
            path[1], path[2] = path[2], path[1]
        if np.linalg.det(np.array(path[1:]) - path[0]) < 0:
            path[2], path[3] = path[3], path[2]
        tets.append([tuple(int(i) for i in corner) for corner in path])
    return tets


_SPLITS["tet"] = _kuhn()


def lattice_mesh(
    family: str,
    lines: Sequence[np.ndarray],
    shape: Callable[[np.ndarray], np.ndarray] = lambda x: x,
    *,
    solid: str = "solid",
) -> Mesh:
    """Box cut along ``lines`` in each direction and mapped into space.

    It has the surfaces left, right (x), front, back (y), bottom, top (z), or, with two directions,
    inner, outer (r), bottom, top (z).

    Parameters
    ----------
    family
        Triangles, wedges and tetrahedra split the cells.
    lines [m]
        Ascending borders of the cells in each direction.
    shape
        Map of points (n, d) that keeps the orientation.
    """
    topology = FAMILIES[family]
    counts = [2 * len(line) - 1 for line in lines]
    split = _SPLITS[family.rstrip("0123456789")]
    cells = np.array(list(product(*(range(len(line) - 1) for line in lines))))
    parts = []
    for element in split:
        corners = 2 * (cells[:, None, :] + np.array(element))
        if topology.quadratic:
            i, j = np.array(topology.edges).T
            corners = np.concatenate([corners, (corners[:, i] + corners[:, j]) // 2], axis=1)
        parts.append(corners)
    lattice = np.concatenate(parts)
    flat = np.ravel_multi_index(tuple(np.moveaxis(lattice, -1, 0)), counts)
    used, connectivity = np.unique(flat, return_inverse=True)
    connectivity = connectivity.reshape(flat.shape).astype(np.int64)
    place = np.stack(np.unravel_index(used, counts), axis=1)
    halves = [
        np.interp(np.arange(n) / 2, np.arange(len(x)), x)
        for n, x in zip(counts, lines, strict=True)
    ]
    points = shape(np.stack([half[place[:, k]] for k, half in enumerate(halves)], axis=1))
    surfaces = {}
    for number, name in enumerate(_SIDES[len(lines)]):
        axis, end = divmod(number, 2)
        on_side = place[:, axis] == end * (counts[axis] - 1)
        surfaces[name] = _side(name, topology.faces, connectivity, on_side)
    return Mesh(
        points=points, blocks=(ElementBlock(family, connectivity, solid),), surfaces=surfaces
    )


def _side(name: str, faces: tuple, connectivity: np.ndarray, on_side: np.ndarray) -> Surface:
    found: dict[str, list[np.ndarray]] = {}
    for face in faces:
        nodes = connectivity[:, list(face.nodes)]
        found.setdefault(face.family, []).append(nodes[on_side[nodes].all(axis=1)])
    blocks = [FaceBlock(family, np.concatenate(parts)) for family, parts in found.items()]
    return Surface(name, tuple(block for block in blocks if len(block.connectivity)))
