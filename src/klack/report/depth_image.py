"""Pixels of solids in parallel projection, cut open by a quarter.

Each pixel has a line of sight, ``x = u a + v b + d f`` with unit vectors to the right, upwards and
away from the viewer.  It shows the nearest triangle that faces the viewer.  The quarter
``n1 (x - c) > 0, n2 (x - c) > 0`` on the side of the viewer is taken away: a line of sight leaves
it at one depth, and where it is inside a body there, the cut face of this body is seen.  It is
inside where more triangles face the viewer than face away before that depth, so that the cut needs
no mesh of its own.  Surfaces are closed, triangles anticlockwise from outside.

A triangle covers the pixels whose centre it contains; of two triangles that share a side, one has
the pixels on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Camera", "Quarter", "Seen", "Window", "outlines", "seen_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_GRAZING = 1e-9
"""Share of a triangle's area below which its projection is a line."""

_ON_CUT = 1e-6
"""Distance from the cut [window size] that belongs to what is cut away."""


@dataclass(frozen=True, slots=True)
class Camera:
    """Viewing direction [rad] of a parallel projection, from the bodies; z is up."""

    azimuth: float
    elevation: float

    @property
    def axes(self) -> Floats:
        """Unit vectors right, up, and away from the viewer, as rows."""
        c, s = np.cos(self.azimuth), np.sin(self.azimuth)
        right = np.array([-s, c, 0.0])
        away = -np.array([np.cos(self.elevation) * c, np.cos(self.elevation) * s, 0.0])
        away[2] = -np.sin(self.elevation)
        return np.stack([right, np.cross(right, away), away])


@dataclass(frozen=True, slots=True)
class Window:
    """Part of the picture plane, from lower left; ``pixel`` is its side [m]."""

    left: float
    bottom: float
    pixel: float
    columns: int
    rows: int


@dataclass(frozen=True, slots=True, eq=False)
class Quarter:
    """What is taken away: where both products with ``normals`` are positive.

    Parameters
    ----------
    corner (3,) [m]
    normals (2, 3)
        Point towards the viewer.
    """

    corner: Floats
    normals: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What each pixel shows, (rows, columns) each; row 0 is at the bottom.

    Parameters
    ----------
    body
        Place of the body; -1 where there is none.
    triangle
        Of that body; -1 on a cut face.
    cut
        Which plane of the quarter is seen, 0 or 1; -1 on a surface.
    depth [m]
        Along the line of sight; infinite where there is nothing.
    """

    body: Ints
    triangle: Ints
    cut: Ints
    depth: Floats


def seen_of(
    bodies: Sequence[tuple[Floats, Ints]],
    camera: Camera,
    window: Window,
    quarter: Quarter | None = None,
) -> Seen:
    """Look at bodies of points (v, 3) [m] and triangles (t, 3)."""
    shape = (window.rows, window.columns)
    count = window.rows * window.columns
    exits, plane = _exits(camera, window, quarter)
    depth = np.full(count, np.inf)
    body, triangle = np.full(count, -1), np.full(count, -1)
    filled = np.full(count, -1)
    for place, (points, triangles) in enumerate(bodies):
        own = _project(points, camera, window)
        fragments = _fragments(own, triangles, window)
        front = exits[fragments.pixel] > fragments.depth
        level = np.bincount(
            fragments.pixel[front], weights=fragments.facing[front], minlength=count
        )
        filled[(level > 0.5) & (filled < 0)] = place
        kept = ~front & (fragments.facing > 0)
        pixel, far = fragments.pixel[kept], fragments.depth[kept]
        nearest = np.full(count, np.inf)
        np.minimum.at(nearest, pixel, far)
        won = far == nearest[pixel]
        pixel, far = pixel[won], far[won]
        nearer = far < depth[pixel]
        pixel = pixel[nearer]
        depth[pixel] = far[nearer]
        body[pixel] = place
        triangle[pixel] = fragments.triangle[kept][won][nearer]
    capped = filled >= 0
    body[capped], triangle[capped], depth[capped] = filled[capped], -1, exits[capped]
    return Seen(
        body.reshape(shape),
        triangle.reshape(shape),
        np.where(capped, plane, -1).reshape(shape),
        depth.reshape(shape),
    )


def outlines(surface: Ints, depth: Floats, slope: Floats) -> NDArray[np.bool_]:
    """Pixels on a line between two surfaces, or where one surface passes behind itself.

    Parameters
    ----------
    surface (rows, columns)
        A number for each smooth surface.
    depth (rows, columns)
        In sides of a pixel.
    slope (rows, columns)
        Change of depth per pixel that the surface itself may have.
    """
    drawn = np.zeros(surface.shape, dtype=bool)
    for one, other in (
        (np.s_[1:, :], np.s_[:-1, :]),
        (np.s_[:, 1:], np.s_[:, :-1]),
    ):
        differs = surface[one] != surface[other]
        with np.errstate(invalid="ignore"):
            jumps = np.abs(depth[one] - depth[other]) > 3.0 + 2.0 * (slope[one] + slope[other])
        line = differs | jumps
        drawn[one] |= line
        drawn[other] |= line
    return drawn


@dataclass(frozen=True, slots=True, eq=False)
class _Fragments:
    """Pixels of triangles, with depth; ``facing`` is 1, or -1 for away."""

    pixel: Ints
    triangle: Ints
    depth: Floats
    facing: Floats


def _project(points: Floats, camera: Camera, window: Window) -> Floats:
    """Columns, rows (pixel centres at halves) and depth [m]."""
    own = np.asarray(points @ camera.axes.T)
    own[:, 0] = (own[:, 0] - window.left) / window.pixel
    own[:, 1] = (own[:, 1] - window.bottom) / window.pixel
    return own


def _exits(camera: Camera, window: Window, quarter: Quarter | None) -> tuple[Floats, Ints]:
    """Depth where each line of sight leaves the quarter, and the plane."""
    count = window.rows * window.columns
    if quarter is None:
        return np.full(count, -np.inf), np.full(count, -1)
    right, up, away = camera.axes
    u = window.left + window.pixel * (np.arange(window.columns) + 0.5)
    v = window.bottom + window.pixel * (np.arange(window.rows) + 0.5)
    depths = [
        (
            (normal @ quarter.corner) - u[None, :] * (normal @ right) - v[:, None] * (normal @ up)
        ).ravel()
        / (normal @ away)
        for normal in quarter.normals
    ]
    size = window.pixel * max(window.rows, window.columns)
    return np.minimum(*depths) + _ON_CUT * size, (depths[1] < depths[0]).astype(np.int64)


def _fragments(own: Floats, triangles: Ints, window: Window) -> _Fragments:
    corners = own[triangles]  # (t, corner, column row depth)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac = b - a, c - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    flat = corners[:, :, :2]
    low, high = flat.min(axis=1), flat.max(axis=1)
    first = np.maximum(np.ceil(low[:, 1] - 0.5), 0).astype(np.int64)
    end = np.minimum(np.ceil(high[:, 1] - 0.5), window.rows).astype(np.int64)
    reach = np.square(flat - flat[:, [1, 2, 0]]).sum(axis=(1, 2))
    kept = np.flatnonzero(
        (end > first)
        & (high[:, 0] > 0)
        & (low[:, 0] < window.columns)
        & (np.abs(area) > _GRAZING * reach)
    )
    number, row = _expanded(kept, first[kept], end[kept])
    start, stop = _spans(flat, number, row)
    start = np.clip(start, 0, window.columns)
    stop = np.clip(stop, start, window.columns)
    span, column = _expanded(np.arange(len(number)), start, stop)
    of, across = number[span], row[span]
    # depth is linear on a triangle; those seen from their edge have no pixels
    safe = np.where(area == 0.0, 1.0, area)
    du = (ab[:, 2] * ac[:, 1] - ac[:, 2] * ab[:, 1]) / safe
    dv = (ac[:, 2] * ab[:, 0] - ab[:, 2] * ac[:, 0]) / safe
    offset = a[:, 2] + du * (0.5 - a[:, 0]) + dv * (0.5 - a[:, 1])
    depth = offset[of] + du[of] * column + dv[of] * across
    return _Fragments(
        across * window.columns + column, of, depth, np.where(area > 0, 1.0, -1.0)[of]
    )


def _expanded(keys: Ints, first: Ints, end: Ints) -> tuple[Ints, Ints]:
    """Each key once for all whole numbers in its half-open range, and these."""
    lengths = end - first
    before = np.cumsum(lengths) - lengths
    steps = np.arange(int(lengths.sum())) - np.repeat(before - first, lengths)
    return np.repeat(keys, lengths), steps


def _spans(flat: Floats, number: Ints, row: Ints) -> tuple[Ints, Ints]:
    """Half-open column ranges with centres in each triangle, row by row."""
    height = row + 0.5
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(3):
        one, other = flat[:, k], flat[:, (k + 1) % 3]
        # the lower end first, so that both triangles of a side find the same column
        swapped = (other[:, 1] < one[:, 1])[:, None]
        low, high = np.where(swapped, other, one), np.where(swapped, one, other)
        rise = high[:, 1] - low[:, 1]
        lean = (high[:, 0] - low[:, 0]) / np.where(rise > 0, rise, 1.0)
        x = low[number, 0] + lean[number] * (height - low[number, 1])
        crossed = (low[number, 1] <= height) & (height < high[number, 1])
        left = np.where(crossed, np.minimum(left, x), left)
        right = np.where(crossed, np.maximum(right, x), right)
    empty = ~(left <= right)
    left, right = np.where(empty, 0.0, left), np.where(empty, 0.0, right)
    return (
        np.ceil(np.clip(left, -1e9, 1e9) - 0.5).astype(np.int64),
        np.ceil(np.clip(right, -1e9, 1e9) - 0.5).astype(np.int64),
    )
