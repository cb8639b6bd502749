r"""Compiled loops: element integrals and their place in the sparse matrices.

Every isotropic stiffness follows from one small tensor per pair of nodes,

.. math:: G_{ab} = \int g_a(N_i)\, g_b(N_j)\, dV,

where ``g`` holds the three gradient components of a solid, or (d/dr, d/dz, 1/r) of a body of
revolution: the 3 x 3 block of a solid is ``lambda G + mu (G^T + tr G 1)``.
"""

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import inner, njit

__all__ = ["add_elements", "block_pattern", "diagonal_blocks", "node_graph"]


@njit(nogil=True)
def node_graph(
    elements: NDArray[np.int32], offsets: NDArray[np.int64], node_count: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Sorted neighbours of each node (itself included): starts (node_count + 1,), and neighbours.

    Parameters
    ----------
    elements (sum of nodes per element,)
        Nodes of all elements, one after the other.
    offsets (n_elements + 1,)
    """
    n_elements = offsets.size - 1
    first = np.zeros(node_count + 1, np.int64)
    for node in elements:
        first[node + 1] += 1
    for i in range(node_count):
        first[i + 1] += first[i]
    fill = first[:-1].copy()
    of_node = np.empty(elements.size, np.int32)
    for e in range(n_elements):
        for p in range(offsets[e], offsets[e + 1]):
            of_node[fill[elements[p]]] = e
            fill[elements[p]] += 1

    start = np.zeros(node_count + 1, np.int64)
    seen = np.full(node_count, -1, np.int32)
    for i in range(node_count):
        count = 0
        for k in range(first[i], first[i + 1]):
            for p in range(offsets[of_node[k]], offsets[of_node[k] + 1]):
                if seen[elements[p]] != i:
                    seen[elements[p]] = i
                    count += 1
        start[i + 1] = start[i] + count
    neighbours = np.empty(start[-1], np.int32)
    seen[:] = -1
    for i in range(node_count):
        at = start[i]
        for k in range(first[i], first[i + 1]):
            for p in range(offsets[of_node[k]], offsets[of_node[k] + 1]):
                if seen[elements[p]] != i:
                    seen[elements[p]] = i
                    neighbours[at] = elements[p]
                    at += 1
        neighbours[start[i] : at].sort()
    return start, neighbours


@njit(nogil=True)
def block_pattern(
    start: NDArray[np.int64], neighbours: NDArray[np.int32], d: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Column indices and row starts of a CSR matrix with a full (d, d) block per pair."""
    nodes = start.size - 1
    columns = np.empty(neighbours.size * d * d, np.int32)
    row_start = np.empty(nodes * d + 1, np.int32)
    at = 0
    row_start[0] = 0
    for i in range(nodes):
        for a in range(d):
            for k in range(start[i], start[i + 1]):
                for b in range(d):
                    columns[at] = neighbours[k] * d + b
                    at += 1
            row_start[i * d + a + 1] = at
    return columns, row_start


@njit(nogil=True)
def diagonal_blocks(
    start: NDArray[np.int64], neighbours: NDArray[np.int32], values: NDArray[np.float64], d: int
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """CSR arrays of a matrix with ``value * 1`` (d, d) per pair of nodes."""
    nodes = start.size - 1
    entries = np.empty(neighbours.size * d)
    columns = np.empty(neighbours.size * d, np.int32)
    row_start = np.empty(nodes * d + 1, np.int32)
    at = 0
    row_start[0] = 0
    for i in range(nodes):
        for a in range(d):
            for k in range(start[i], start[i + 1]):
                entries[at] = values[k]
                columns[at] = neighbours[k] * d + a
                at += 1
            row_start[i * d + a + 1] = at
    return entries, columns, row_start


@inner(nogil=True)
def _geometry(x, dN, N, axisymmetric, g):  # type: ignore[no-untyped-def]
    """Fill ``g`` (n, 3) at one point; return the Jacobian and the volume factor."""
    n, d = dN.shape
    J = np.zeros((3, 3))
    for i in range(n):
        for a in range(d):
            for b in range(d):
                J[a, b] += x[i, a] * dN[i, b]
    if axisymmetric:
        det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
        r = 0.0
        for i in range(n):
            r += N[i] * x[i, 0]
        if det == 0.0 or r == 0.0:
            return det, 0.0
        for i in range(n):
            g[i, 0] = (dN[i, 0] * J[1, 1] - dN[i, 1] * J[1, 0]) / det
            g[i, 1] = (dN[i, 1] * J[0, 0] - dN[i, 0] * J[0, 1]) / det
            g[i, 2] = N[i] / r
        return det, 2.0 * np.pi * r
    c00 = J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1]
    c01 = J[1, 2] * J[2, 0] - J[1, 0] * J[2, 2]
    c02 = J[1, 0] * J[2, 1] - J[1, 1] * J[2, 0]
    det = J[0, 0] * c00 + J[0, 1] * c01 + J[0, 2] * c02
    if det == 0.0:
        return det, 0.0
    c10 = J[0, 2] * J[2, 1] - J[0, 1] * J[2, 2]
    c11 = J[0, 0] * J[2, 2] - J[0, 2] * J[2, 0]
    c12 = J[0, 1] * J[2, 0] - J[0, 0] * J[2, 1]
    c20 = J[0, 1] * J[1, 2] - J[0, 2] * J[1, 1]
    c21 = J[0, 2] * J[1, 0] - J[0, 0] * J[1, 2]
    c22 = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    for i in range(n):
        u, v, w = dN[i, 0] / det, dN[i, 1] / det, dN[i, 2] / det
        g[i, 0] = u * c00 + v * c01 + w * c02
        g[i, 1] = u * c10 + v * c11 + w * c12
        g[i, 2] = u * c20 + v * c21 + w * c22
    return det, 1.0


@inner(nogil=True)
def _position(neighbours, low, high, node):  # type: ignore[no-untyped-def]
    """Index of ``node`` in the sorted slice [low, high)."""
    while high - low > 1:
        middle = (low + high) // 2
        if neighbours[middle] <= node:
            low = middle
        else:
            high = middle
    return low


@njit(nogil=True)
def add_elements(
    points: NDArray[np.float64],
    connectivity: NDArray[np.int32],
    stiffness_rule: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    mass_rule: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    lame_lambda: float,
    shear_modulus: float,
    density: float,
    order: int,
    start: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    K: NDArray[np.float64],
    M: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Add the elements of one block to the values of K and of the scalar M.

    Parameters
    ----------
    points (n, d) [m]
    connectivity (n_elements, n_nodes)
    stiffness_rule, mass_rule : (N (q, n), dN (q, n, d), w (q,))
    lame_lambda, shear_modulus [Pa]
    density [kg/m^3]
    order
        Of a body of revolution with three displacements per node; else -1.
    start, neighbours
        Of :func:`node_graph`.
    K (start[-1] * c * c,) [N/m], c displacements per node
        In the order of the full CSR matrix; changed in place.
    M (start[-1],) [kg]
        Scalar mass matrix; changed in place.

    Returns
    -------
    (n_elements, 2) [m^d]
        Smallest and largest Jacobian determinant.
    """
    n_elements, n = connectivity.shape
    d = points.shape[1]
    axisymmetric = d == 2
    c = d if order < 0 else 3
    circle = 0.5 if order > 0 else 1.0  # mean of cos^2 and of sin^2 around the axis
    N_k, dN_k, w_k = stiffness_rule
    N_m, dN_m, w_m = mass_rule
    jacobians = np.empty((n_elements, 2))
    x = np.empty((n, d))
    g = np.empty((n, 3))
    G = np.empty((n, n, 3, 3))
    S = np.empty((n, n))
    block = np.empty((3, 3))
    for e in range(n_elements):
        low, high = np.inf, -np.inf
        for i in range(n):
            for a in range(d):
                x[i, a] = points[connectivity[e, i], a]
        G[:] = 0.0
        for q in range(w_k.size):
            det, volume = _geometry(x, dN_k[q], N_k[q], axisymmetric, g)
            low, high = min(low, det), max(high, det)
            weight = w_k[q] * det * volume * circle
            for i in range(n):
                for j in range(i, n):
                    for a in range(3):
                        s = weight * g[i, a]
                        for b in range(3):
                            G[i, j, a, b] += s * g[j, b]
        S[:] = 0.0
        for q in range(w_m.size):
            det, volume = _geometry(x, dN_m[q], N_m[q], axisymmetric, g)
            low, high = min(low, det), max(high, det)
            weight = w_m[q] * det * volume * circle * density
            for i in range(n):
                s = weight * N_m[q, i]
                for j in range(i, n):
                    S[i, j] += s * N_m[q, j]
        jacobians[e, 0], jacobians[e, 1] = low, high
        for i in range(n):
            row = connectivity[e, i]
            for j in range(i, n):
                column = connectivity[e, j]
                if order < 0:
                    _stiffness_block(G[i, j], lame_lambda, shear_modulus, axisymmetric, block)
                else:
                    _fourier_block(G[i, j], lame_lambda, shear_modulus, order, block)
                k = _position(neighbours, start[row], start[row + 1], column)
                M[k] += S[i, j]
                at = start[row] * c * c + (k - start[row]) * c
                width = (start[row + 1] - start[row]) * c
                for a in range(c):
                    for b in range(c):
                        K[at + a * width + b] += block[a, b]
                if j > i:
                    k = _position(neighbours, start[column], start[column + 1], row)
                    M[k] += S[i, j]
                    at = start[column] * c * c + (k - start[column]) * c
                    width = (start[column + 1] - start[column]) * c
                    for a in range(c):
                        for b in range(c):
                            K[at + a * width + b] += block[b, a]
    return jacobians


@inner(nogil=True)
def _stiffness_block(G, lame_lambda, mu, axisymmetric, block):  # type: ignore[no-untyped-def]
    if axisymmetric:  # components r, z, hoop
        volume_r = G[0, 0] + G[0, 2] + G[2, 0] + G[2, 2]
        block[0, 0] = lame_lambda * volume_r + mu * (2 * (G[0, 0] + G[2, 2]) + G[1, 1])
        block[0, 1] = lame_lambda * (G[0, 1] + G[2, 1]) + mu * G[1, 0]
        block[1, 0] = lame_lambda * (G[1, 0] + G[1, 2]) + mu * G[0, 1]
        block[1, 1] = lame_lambda * G[1, 1] + mu * (2 * G[1, 1] + G[0, 0])
        return
    trace = G[0, 0] + G[1, 1] + G[2, 2]
    for a in range(3):
        for b in range(3):
            block[a, b] = lame_lambda * G[a, b] + mu * G[b, a]
        block[a, a] += mu * trace


@inner(nogil=True)
def _fourier_block(G, lame_lambda, mu, n, block):  # type: ignore[no-untyped-def]
    """Fill the (3, 3) block of one pair of nodes in order n, for the amplitudes a, b, w."""
    rr, rz, rh = G[0, 0], G[0, 1], G[0, 2]  # components r, z, hoop
    zr, zz, zh = G[1, 0], G[1, 1], G[1, 2]
    hr, hz, hh = G[2, 0], G[2, 1], G[2, 2]
    # amplitudes u, v, w of the radius, around, and along the axis
    plane = lame_lambda + 2 * mu
    uu = plane * (rr + hh) + lame_lambda * (rh + hr) + mu * (zz + n * n * hh)
    uv = n * (plane * hh + lame_lambda * rh - mu * (hr - hh))
    vu = n * (plane * hh + lame_lambda * hr - mu * (rh - hh))
    vv = n * n * plane * hh + mu * (rr - rh - hr + hh + zz)
    uw = lame_lambda * (rz + hz) + mu * zr
    wu = lame_lambda * (zr + zh) + mu * rz
    vw = n * (lame_lambda * hz - mu * zh)
    wv = n * (lame_lambda * zh - mu * hz)
    block[2, 2] = plane * zz + mu * (rr + n * n * hh)
    # u = a + b, v = b - a
    block[0, 0], block[0, 1] = uu - uv - vu + vv, uu + uv - vu - vv
    block[1, 0], block[1, 1] = uu - uv + vu - vv, uu + uv + vu + vv
    block[0, 2], block[1, 2] = uw - vw, uw + vw
    block[2, 0], block[2, 1] = wu - wv, wu + wv
