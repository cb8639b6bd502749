r"""Compiled cut of lines with curved faces.

A face is a polynomial :math:`x(\xi, \eta) = \sum_m c_m\, p_m(\xi, \eta)` in the eight monomials
that every face family spans; a line of an axisymmetric body becomes a strip around it.
"""

from typing import NamedTuple

import numpy as np

from klack.arrays import Cube, Flags, Floats, Index, Ints, Matrix, Vector
from klack.bodies.elasticity.shape_functions import reference_nodes, shape_functions
from klack.machine.compiling.jit import inner, njit
from klack.mesh.families import FAMILIES

__all__ = [
    "MONOMIALS",
    "CurvedFaces",
    "cut_face",
    "cut_listed",
    "cut_nearest",
    "face_boxes",
    "face_polynomials",
    "list_near",
]

MONOMIALS = 8
"""1, x, y, x^2, x y, y^2, x^2 y, x y^2."""

_INSIDE = 1e-8  # reference coordinate by which a cut may lie outside a face: they share their edges
_OPPOSED = -0.1  # largest cosine between the normals of two points that face each other
_CLOSE = 0.1  # half widths of a face within which no other sheet of the surface can be

_BOX_SAMPLES = 5  # along an edge, at which a face is sampled for its box


class CurvedFaces(NamedTuple):
    """Faces of a master surface, all blocks in turn, ready to be cut by lines."""

    coefficients: Cube  # (f, 8, 3)
    centre: Matrix  # (f, 3) [m] middle of the box around each face
    axes: Cube  # (f, 3, 3) its directions in rows
    half: Matrix  # (f, 3) [m] its half widths
    triangle: Flags  # (f,) reference domain: triangle, or square [-1, 1]^2
    deepest: float  # [m] deepest penetration that counts as one


def face_polynomials(points: Floats, family: str, connectivity: Ints) -> Floats:
    """Coefficients of every face, shape (f, 8, 3); axisymmetric points as (r, 0, z)."""
    corner = points[connectivity]
    if corner.shape[2] == 3:
        return np.einsum("nm,fnd->fmd", _monomial_factors(family), corner)
    coefficients = np.zeros((len(corner), MONOMIALS, 3))
    flat = np.einsum("nm,fnd->fmd", _monomial_factors(family), corner)
    coefficients[:, [[0], [1], [3]], [0, 2]] = flat[:, [0, 1, 3]]
    # against y, so that tangent x strip is the outward normal
    coefficients[:, 2, 1] = -np.linalg.norm(flat[:, 1], axis=1)
    return coefficients


def face_boxes(coefficients: Floats, triangle: Flags) -> tuple[Floats, Floats, Floats]:
    """Box around every face: middle (f, 3), directions in rows (f, 3, 3), half widths (f, 3).

    The first direction is the longest, the last one the normal. Between samples of a face that is
    quadratic along each line, its extent can exceed theirs by 1/16 of the bulge; the box has a
    tenth more.
    """
    s = np.linspace(0.0, 1.0, _BOX_SAMPLES)
    square = np.stack(np.meshgrid(2.0 * s - 1.0, 2.0 * s - 1.0), axis=-1).reshape(-1, 2)
    corner = np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2)
    corner = corner[corner.sum(axis=1) <= 1.0 + 1e-12]
    count = len(triangle)
    centre, axes, half = np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3))
    for kind, xi in ((False, square), (True, corner)):
        chosen = triangle == kind
        if not np.any(chosen):
            continue
        x = np.einsum("qm,fmd->fqd", _monomials(xi), coefficients[chosen])
        middle = x.mean(axis=1, keepdims=True)
        _, vectors = np.linalg.eigh(np.matmul((x - middle).transpose(0, 2, 1), x - middle))
        directions = vectors.transpose(0, 2, 1)[:, ::-1]
        local = np.einsum("fqd,fkd->fqk", x - middle, directions)
        low, high = local.min(axis=1), local.max(axis=1)
        extent = (high - low) / 2.0
        axes[chosen] = directions
        centre[chosen] = middle[:, 0] + np.einsum("fk,fkd->fd", (low + high) / 2.0, directions)
        half[chosen] = 1.1 * extent + 1e-3 * extent.max(axis=1, keepdims=True)
    return centre, axes, half


def _monomials(xi: Floats) -> Floats:
    """Values of the monomials at reference points, shape (q, 8)."""
    x, y = xi.T
    return np.stack([np.ones_like(x), x, y, x**2, x * y, y**2, x**2 * y, x * y**2], axis=1)


def _monomial_factors(family: str) -> Floats:
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
    table = _monomials(grid)
    factors = np.zeros((count, MONOMIALS))
    factors[:, used] = np.linalg.lstsq(table[:, used], values, rcond=None)[0].T
    return np.round(4.0 * factors) / 4.0  # all are quarters


@njit
def cut_nearest(
    points: Matrix, normals: Matrix, faces: CurvedFaces
) -> tuple[Index, Matrix, Vector]:
    """Nearest valid cut of every line, points and normals (p, 3), with any of the faces.

    Returns face (p,), -1 where nothing is cut, xi (p, 2) and gap (p,).
    """
    count = len(points)
    face = np.full(count, -1, dtype=np.int64)
    xi = np.zeros((count, 2))
    gap = np.full(count, np.nan)
    every = np.arange(len(faces.coefficients))
    for p in range(count):
        found = _nearest_of(every, points[p], normals[p], faces, 0.0)
        face[p], xi[p, 0], xi[p, 1], gap[p] = found
    return face, xi, gap


@njit
def cut_listed(
    first: Index, listed: Index, points: Matrix, normals: Matrix, faces: CurvedFaces
) -> Vector:
    """Gap (p,) of the nearest valid cut of every line, first among a few faces; nan where none is.

    Line p tries the faces ``listed[first[p]:first[p + 1]]``, and all others if none of these is
    cut.  A cut much nearer than its face is wide is the nearest one: between two sheets of a
    surface that look the same way there is a whole wall.
    """
    gap = np.full(len(points), np.nan)
    every = np.arange(len(faces.coefficients))
    for p in range(len(points)):
        for tried in (listed[first[p] : first[p + 1]], every):
            face, _, _, gap[p] = _nearest_of(tried, points[p], normals[p], faces, _CLOSE)
            if face >= 0:
                break
    return gap


@njit
def list_near(
    points: Matrix, normals: Matrix, start: Index, faces: CurvedFaces, within: float
) -> tuple[Index, Index]:
    """Faces whose boxes, larger by ``within`` [m] on all sides, each line meets.

    Face ``start[p]`` (-1: none) comes first; of line p ``listed[first[p]:first[p + 1]]``.
    """
    first = np.zeros(len(points) + 1, dtype=np.int64)
    for fill in (False, True):
        listed = np.empty(first[-1], dtype=np.int64)
        count = 0
        for p in range(len(points)):
            for i in range(-1, len(faces.centre)):
                f = i if i >= 0 else start[p]
                if f < 0 or (i == start[p] and i >= 0):
                    continue
                middle = faces.centre[f] - points[p]
                if _meets_box(middle, normals[p], faces.axes[f], faces.half[f], within):
                    if fill:
                        listed[count] = f
                    count += 1
            first[p + 1] = count
    return first, listed


@inner
def _meets_box(d, n, axes, half, within):  # type: ignore[no-untyped-def]
    """Whether a line along n meets a box whose middle is at d from it."""
    x = d[0] * axes[0, 0] + d[1] * axes[0, 1] + d[2] * axes[0, 2]
    y = d[0] * axes[1, 0] + d[1] * axes[1, 1] + d[2] * axes[1, 2]
    z = d[0] * axes[2, 0] + d[1] * axes[2, 1] + d[2] * axes[2, 2]
    a = n[0] * axes[0, 0] + n[1] * axes[0, 1] + n[2] * axes[0, 2]
    b = n[0] * axes[1, 0] + n[1] * axes[1, 1] + n[2] * axes[1, 2]
    c = n[0] * axes[2, 0] + n[1] * axes[2, 1] + n[2] * axes[2, 2]
    h0, h1, h2 = half[0] + within, half[1] + within, half[2] + within
    # no plane along the line separates it from the box (Gottschalk et al. 1996)
    return (
        abs(x * b - y * a) <= h0 * abs(b) + h1 * abs(a)
        and abs(y * c - z * b) <= h1 * abs(c) + h2 * abs(b)
        and abs(z * a - x * c) <= h2 * abs(a) + h0 * abs(c)
    )


@inner
def _nearest_of(tried, x, n, faces, close):  # type: ignore[no-untyped-def]
    """Nearest valid cut of one line: face, u, v, gap.

    A cut nearer than ``close`` half widths of its face ends the search.
    """
    x0, x1, x2 = x
    n0, n1, n2 = n
    centre, axes, half, triangle = faces.centre, faces.axes, faces.half, faces.triangle
    best, found, at_u, at_v, gap = np.inf, -1, 0.0, 0.0, np.nan
    for f in tried:
        d = (centre[f, 0] - x0, centre[f, 1] - x1, centre[f, 2] - x2)
        h0, h1, h2 = half[f]
        along = d[0] * n0 + d[1] * n1 + d[2] * n2
        square = h0 * h0 + h1 * h1 + h2 * h2  # of the ball around the box
        if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - along * along > square:
            continue
        if not _meets_box(d, n, axes[f], half[f], 0.0):
            continue
        r = np.sqrt(square)
        if along < -faces.deepest - r or abs(along) - r > best:
            continue
        start = 1.0 / 3.0 if triangle[f] else 0.0
        u, v, g, cosine, settled = cut_face(
            faces.coefficients[f], x0, x1, x2, n0, n1, n2, start, start, along
        )
        if not settled or cosine > _OPPOSED or g < -faces.deepest or abs(g) >= best:
            continue
        if triangle[f]:
            within = u >= -_INSIDE and v >= -_INSIDE and u + v <= 1.0 + _INSIDE
        else:
            within = abs(u) <= 1.0 + _INSIDE and abs(v) <= 1.0 + _INSIDE
        if within:
            best, found, at_u, at_v, gap = abs(g), f, u, v, g
            if best < close * h0:
                break
    return found, at_u, at_v, gap


@njit(inline="always")
def _component(c, k, u, v):  # type: ignore[no-untyped-def]
    """Coordinate k of a face at (u, v) and its two slopes."""
    value = (
        c[0, k]
        + u * (c[1, k] + u * c[3, k] + v * (c[4, k] + u * c[6, k] + v * c[7, k]))
        + v * (c[2, k] + v * c[5, k])
    )
    along_u = c[1, k] + 2 * u * c[3, k] + v * (c[4, k] + 2 * u * c[6, k] + v * c[7, k])
    along_v = c[2, k] + 2 * v * c[5, k] + u * (c[4, k] + u * c[6, k] + 2 * v * c[7, k])
    return value, along_u, along_v


@inner
def cut_face(c, x0, x1, x2, n0, n1, n2, u, v, g):  # type: ignore[no-untyped-def]
    """Solve x + g n = face(u, v) from a guess; u, v, g, cosine of the normals, settled."""
    for _ in range(25):
        p0, a0, b0 = _component(c, 0, u, v)
        p1, a1, b1 = _component(c, 1, u, v)
        p2, a2, b2 = _component(c, 2, u, v)
        r0, r1, r2 = x0 + g * n0 - p0, x1 + g * n1 - p1, x2 + g * n2 - p2
        m0 = a1 * b2 - a2 * b1
        m1 = a2 * b0 - a0 * b2
        m2 = a0 * b1 - a1 * b0
        length = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        slope = m0 * n0 + m1 * n1 + m2 * n2
        if not abs(slope) > 1e-3 * length:  # a line that grazes the face meets nothing
            return u, v, g, 0.0, False
        # residual + dg n - du a - dv b = 0
        dg = -(r0 * m0 + r1 * m1 + r2 * m2) / slope
        r0, r1, r2 = r0 + dg * n0, r1 + dg * n1, r2 + dg * n2
        aa = a0 * a0 + a1 * a1 + a2 * a2
        bb = b0 * b0 + b1 * b1 + b2 * b2
        ab = a0 * b0 + a1 * b1 + a2 * b2
        ra = r0 * a0 + r1 * a1 + r2 * a2
        rb = r0 * b0 + r1 * b1 + r2 * b2
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
