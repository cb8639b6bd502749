r"""Compiled cut of lines with curved faces.

A face is a polynomial :math:`x(\xi, \eta) = \sum_m c_m\, p_m(\xi, \eta)` in the eight monomials
that every face family spans; a line of an axisymmetric body becomes a strip around it.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from klack.elasticity.shape_functions import reference_nodes, shape_functions
from klack.mesh.families import FAMILIES

__all__ = ["MONOMIALS", "cut_nearest", "face_polynomials"]

MONOMIALS = 8
"""1, x, y, x^2, x y, y^2, x^2 y, x y^2."""


def face_polynomials(
    points: NDArray[np.float64], family: str, connectivity: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Coefficients of every face, shape (f, 8, 3); axisymmetric points are put at (r, 0, z)."""
    corner = points[connectivity]
    if corner.shape[2] == 3:
        return np.einsum("nm,fnd->fmd", _monomial_factors(family), corner)
    coefficients = np.zeros((len(corner), MONOMIALS, 3))
    flat = np.einsum("nm,fnd->fmd", _monomial_factors(family), corner)
    coefficients[:, [[0], [1], [3]], [0, 2]] = flat[:, [0, 1, 3]]
    # against y, so that tangent x strip is the outward normal
    coefficients[:, 2, 1] = -np.linalg.norm(flat[:, 1], axis=1)
    return coefficients


def _monomial_factors(family: str) -> NDArray[np.float64]:
    """Shape function n as sum of monomials m, shape (n, 8)."""
    flat = FAMILIES[family].dimension == 1
    count = len(reference_nodes(family))
    # sample where all monomials of the family differ, not only at its nodes
    grid = np.array([(x, y) for x in (0.0, 0.3, 0.5, 1.0) for y in (0.0, 0.4, 0.5, 1.0)])
    xi = grid[:, :1] if flat else grid
    values, _ = shape_functions(family, xi)
    if count in (3, 6) and not flat:  # a triangle lacks the two cubic terms
        used = [0, 1, 2, 3, 4, 5]
    else:
        used = [0, 1, 3] if flat else list(range(MONOMIALS))
    x, y = grid.T
    table = np.stack([np.ones_like(x), x, y, x**2, x * y, y**2, x**2 * y, x * y**2], axis=1)
    factors = np.zeros((count, MONOMIALS))
    factors[:, used] = np.linalg.lstsq(table[:, used], values, rcond=None)[0].T
    return np.round(4.0 * factors) / 4.0  # all are quarters


@numba.njit(cache=True)
def cut_nearest(  # type: ignore[no-untyped-def]
    points, normals, coefficients, centre, radius, triangle, inside, opposed, deepest
):
    """Nearest valid cut of every line.

    Parameters
    ----------
    points, normals : array, shape (p, 3)
    coefficients : array, shape (f, 8, 3)
    centre, radius : array, shape (f, 3), (f,)
        Ball around each face.
    triangle : bool
        Reference domain: triangle, or square [-1, 1]^2.
    inside, opposed, deepest : float
        Slack of the domain, largest cosine of the normals, deepest penetration [m].

    Returns
    -------
    face : int array, shape (p,)
        -1 where nothing is cut.
    xi : array, shape (p, 2)
    gap : array, shape (p,)
    """
    count = len(points)
    face = np.full(count, -1, dtype=np.int64)
    xi = np.zeros((count, 2))
    gap = np.full(count, np.nan)
    start = 1.0 / 3.0 if triangle else 0.0
    for p in range(count):
        x0, x1, x2 = points[p]
        n0, n1, n2 = normals[p]
        best = np.inf
        for f in range(len(coefficients)):
            d0, d1, d2 = centre[f, 0] - x0, centre[f, 1] - x1, centre[f, 2] - x2
            along = d0 * n0 + d1 * n1 + d2 * n2
            r = radius[f]
            if d0 * d0 + d1 * d1 + d2 * d2 - along * along > r * r:
                continue
            if along < -deepest - r or abs(along) - r > best:
                continue
            u, v, g, cosine, settled = _newton(
                coefficients[f], x0, x1, x2, n0, n1, n2, start, along
            )
            if not settled or cosine > opposed or g < -deepest or abs(g) >= best:
                continue
            if triangle:
                within = u >= -inside and v >= -inside and u + v <= 1.0 + inside
            else:
                within = abs(u) <= 1.0 + inside and abs(v) <= 1.0 + inside
            if within:
                best = abs(g)
                face[p] = f
                xi[p, 0], xi[p, 1] = u, v
                gap[p] = g
    return face, xi, gap


@numba.njit(cache=True)
def _newton(c, x0, x1, x2, n0, n1, n2, start, distance):  # type: ignore[no-untyped-def]
    """Solve x + g n = face(u, v); returns u, v, g, cosine between the normals, settled."""
    u, v, g = start, start, distance
    for _ in range(25):
        r0, r1, r2 = x0 + g * n0, x1 + g * n1, x2 + g * n2
        a = np.empty(3)
        b = np.empty(3)
        for k in range(3):
            value = (
                c[0, k]
                + u * (c[1, k] + u * c[3, k] + v * (c[4, k] + u * c[6, k] + v * c[7, k]))
                + v * (c[2, k] + v * c[5, k])
            )
            a[k] = c[1, k] + 2 * u * c[3, k] + v * (c[4, k] + 2 * u * c[6, k] + v * c[7, k])
            b[k] = c[2, k] + 2 * v * c[5, k] + u * (c[4, k] + u * c[6, k] + 2 * v * c[7, k])
            if k == 0:
                r0 -= value
            elif k == 1:
                r1 -= value
            else:
                r2 -= value
        m0 = a[1] * b[2] - a[2] * b[1]
        m1 = a[2] * b[0] - a[0] * b[2]
        m2 = a[0] * b[1] - a[1] * b[0]
        length = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        slope = m0 * n0 + m1 * n1 + m2 * n2
        if not abs(slope) > 1e-3 * length:  # a line that grazes the face meets nothing
            return u, v, g, 0.0, False
        # residual + dg n - du a - dv b = 0
        dg = -(r0 * m0 + r1 * m1 + r2 * m2) / slope
        r0, r1, r2 = r0 + dg * n0, r1 + dg * n1, r2 + dg * n2
        aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
        bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        ra = r0 * a[0] + r1 * a[1] + r2 * a[2]
        rb = r0 * b[0] + r1 * b[1] + r2 * b[2]
        det = aa * bb - ab * ab
        du, dv = (ra * bb - rb * ab) / det, (rb * aa - ra * ab) / det
        move = max(abs(du), abs(dv))
        if move > 1.0:
            du, dv = du / move, dv / move
        u, v, g = u + du, v + dv, g + dg
        if move < 1e-12:
            return u, v, g, slope / length, True
        if abs(u) > 4.0 or abs(v) > 4.0:
            return u, v, g, 0.0, False
    return u, v, g, 0.0, False
