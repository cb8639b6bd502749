r"""Shape functions of every element family and their derivatives.

Simplices use barycentric coordinates :math:`L_i`, corner :math:`L_i (2 L_i - 1)` and edge
:math:`4 L_i L_j`; quads and hexes are serendipity elements; the 15-node wedge is the serendipity
product of a triangle and a line (Zienkiewicz, Taylor & Zhu 2013, ch. 6).
"""

import numpy as np
from numpy.typing import NDArray

from klack.mesh.families import FAMILIES

__all__ = ["reference_nodes", "shape_functions"]

Table = tuple[NDArray[np.float64], NDArray[np.float64]]

_SIGNS = {
    "quad": np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float),
    "hex": np.array(
        [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], dtype=float
    ),
}


def shape_functions(family: str, xi: NDArray[np.float64]) -> Table:
    """Values (q, n) and derivatives (q, n, d) of the shape functions at reference coordinates xi.

    Reference domains: line [-1, 1]; triangle and tetrahedron with corners in the origin and at
    distance 1 along the axes; quad and hex [-1, 1]^d; wedge triangle x [-1, 1].

    Parameters
    ----------
    family
        Key of :data:`klack.mesh.families.FAMILIES`.

    Examples
    --------
    >>> N, dN = shape_functions("tet10", np.array([[0.25, 0.25, 0.25]]))
    >>> float(N.sum()), float(abs(dN.sum(axis=1)).max())
    (1.0, 0.0)
    """
    topology = FAMILIES[family]
    xi = np.asarray(xi, dtype=float)
    if family.startswith(("line", "tri", "tet")):
        return _simplex(*_barycentric(family, xi), topology.edges if topology.quadratic else ())
    if family.startswith("wedge"):
        return _wedge(xi, topology.quadratic, topology.edges)
    return _box(xi, _SIGNS[family.rstrip("0123456789")], topology.quadratic, topology.edges)


def reference_nodes(family: str) -> NDArray[np.float64]:
    """Reference coordinates of the nodes, shape (n_nodes, d)."""
    topology = FAMILIES[family]
    triangle = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    match family.rstrip("0123456789"):
        case "line":
            corners = np.array([[-1.0], [1.0]])
        case "tri":
            corners = triangle
        case "tet":
            corners = np.vstack([np.zeros(3), np.eye(3)])
        case "wedge":
            corners = np.vstack([np.c_[triangle, np.full(3, z)] for z in (-1.0, 1.0)])
        case shape:
            corners = _SIGNS[shape]
    if not topology.quadratic:
        return corners
    return np.vstack([corners, [(corners[i] + corners[j]) / 2 for i, j in topology.edges]])


def _barycentric(family: str, xi: NDArray[np.float64]) -> Table:
    """Coordinates L (q, k) and their constant derivatives (k, d)."""
    d = xi.shape[1]
    if family.startswith("line"):
        return np.hstack([(1 - xi) / 2, (1 + xi) / 2]), np.array([[-0.5], [0.5]])
    return np.hstack([1 - xi.sum(axis=1, keepdims=True), xi]), np.vstack([-np.ones(d), np.eye(d)])


def _simplex(
    L: NDArray[np.float64], dL: NDArray[np.float64], edges: tuple[tuple[int, int], ...]
) -> Table:
    if not edges:
        return L, np.broadcast_to(dL, (len(L), *dL.shape)).copy()
    i, j = np.array(edges).T
    N = np.hstack([L * (2 * L - 1), 4 * L[:, i] * L[:, j]])
    corner = (4 * L - 1)[:, :, None] * dL
    edge = 4 * (L[:, i, None] * dL[j] + L[:, j, None] * dL[i])
    return N, np.concatenate([corner, edge], axis=1)


def _wedge(xi: NDArray[np.float64], quadratic: bool, edges: tuple[tuple[int, int], ...]) -> Table:
    L, dL = _barycentric("tri", xi[:, :2])
    z = xi[:, 2:]
    levels = [((1 + s * z) / 2, np.full_like(z, s / 2)) for s in (-1, 1)]
    bubble, dbubble = 1 - z**2, -2 * z
    if not quadratic:
        corners = [_product(L, dL, h, dh) for h, dh in levels]
        return _join(corners)
    i, j = np.array(edges[:3]).T
    square = L * (2 * L - 1)
    dsquare = (4 * L - 1)[:, :, None] * dL
    pair = 4 * L[:, i] * L[:, j]
    dpair = 4 * (L[:, i, None] * dL[j] + L[:, j, None] * dL[i])
    vertical = _product(L, dL, bubble, dbubble)
    # N = L (2 L - 1) (1 +- z)/2 - L (1 - z^2)/2 at the corners
    corners = [_product(square, dsquare, h, dh) for h, dh in levels]
    corners = [(N - vertical[0] / 2, dN - vertical[1] / 2) for N, dN in corners]
    rims = [_product(pair, dpair, h, dh) for h, dh in levels]
    return _join([*corners, *rims, vertical])


def _product(
    f: NDArray[np.float64], df: NDArray[np.float64], h: NDArray[np.float64], dh: NDArray[np.float64]
) -> Table:
    """Triangle functions f (q, k) times one function of height h (q, 1)."""
    plane = np.broadcast_to(df, (*f.shape, 2)) * h[:, :, None]
    return f * h, np.concatenate([plane, (f * dh)[:, :, None]], axis=2)


def _join(parts: list[Table]) -> Table:
    return np.hstack([N for N, _ in parts]), np.concatenate([dN for _, dN in parts], axis=1)


def _box(
    xi: NDArray[np.float64],
    signs: NDArray[np.float64],
    quadratic: bool,
    edges: tuple[tuple[int, int], ...],
) -> Table:
    d = xi.shape[1]
    factors = (1 + xi[:, None, :] * signs) / 2
    N, dN = _products(factors, np.broadcast_to(signs / 2, factors.shape))
    if not quadratic:
        return N, dN
    s = (xi[:, None, :] * signs).sum(axis=2) - (d - 1)
    corner = N * s, dN * s[:, :, None] + N[:, :, None] * signs
    middle = np.array([(signs[i] + signs[j]) / 2 for i, j in edges])
    along = middle == 0
    x = np.broadcast_to(xi[:, None, :], (len(xi), *middle.shape))
    factors = np.where(along, 1 - x**2, (1 + x * middle) / 2)
    slopes = np.where(along, -2 * x, middle / 2)
    return _join([corner, _products(factors, slopes)])


def _products(factors: NDArray[np.float64], slopes: NDArray[np.float64]) -> Table:
    """Product over the last axis and its derivative by each coordinate."""
    d = factors.shape[2]
    derivative = np.empty(factors.shape)
    for k in range(d):
        others = np.prod(np.delete(factors, k, axis=2), axis=2)
        derivative[:, :, k] = others * slopes[:, :, k]
    return np.prod(factors, axis=2), derivative
