"""Straight edges and circular arcs in the meridian (r, z)."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["SAME", "Curve", "Point", "crossings", "on_axis"]

Point = tuple[float, float]

SAME = 1e-9
"""Points closer than this, relative to the size of the profile, are the same point."""


@dataclass(frozen=True, slots=True)
class Curve:
    """An edge with both ends: straight if ``centre`` is None, else an arc of signed ``angle``.

    Parameters
    ----------
    start, end : (r, z) [m]
    name : str
    centre : (r, z) [m] or None
    angle : float [rad]
        Angle turned from start to end, positive anticlockwise.
    """

    start: Point
    end: Point
    name: str
    centre: Point | None = None
    angle: float = 0.0

    @property
    def radius(self) -> float:
        """Radius of the arc [m]; infinite for a straight edge."""
        if self.centre is None:
            return np.inf
        return float(np.hypot(self.start[0] - self.centre[0], self.start[1] - self.centre[1]))

    @property
    def length(self) -> float:
        """Arc length [m]."""
        if self.centre is None:
            return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))
        return abs(self.angle) * self.radius

    @property
    def reversed(self) -> "Curve":
        """The same edge, walked backwards."""
        return Curve(self.end, self.start, self.name, self.centre, -self.angle)

    def at(self, s: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Points at the fractions ``s`` of the length, shape (..., 2) [m]."""
        s = np.asarray(s, dtype=float)[..., None]
        start, end = np.array(self.start), np.array(self.end)
        if self.centre is None:
            return (1 - s) * start + s * end
        centre = np.array(self.centre)
        d = start - centre
        phi = np.arctan2(d[1], d[0]) + s * self.angle
        arc = centre + self.radius * np.concatenate([np.cos(phi), np.sin(phi)], axis=-1)
        return np.where(s == 0, start, np.where(s == 1, end, arc))

    def fraction(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fraction of the length of the nearest point of the edge, clipped to [0, 1]."""
        points = np.asarray(points, dtype=float)
        start, end = np.array(self.start), np.array(self.end)
        if self.centre is None:
            t = end - start
            return np.clip((points - start) @ t / (t @ t), 0, 1)
        # measured from the middle of the arc, so that the cut lies opposite to the arc
        middle = self.at(0.5) - np.array(self.centre)
        d = points - np.array(self.centre)
        cross = middle[0] * d[..., 1] - middle[1] * d[..., 0]
        delta = np.arctan2(cross, d @ middle)
        return np.clip(0.5 + delta / self.angle, 0, 1)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of points to the edge [m]."""
        return np.linalg.norm(np.asarray(points) - self.at(self.fraction(points)), axis=-1)

    def quadrature(self, order: int = 24) -> tuple[NDArray, NDArray, NDArray]:
        """Points (q, 2) [m], tangents times weight (q, 2) [m], lengths times weight (q,) [m]."""
        x, w = _gauss(order)
        s, w = 0.5 * (x + 1), 0.5 * w
        points = self.at(s)
        if self.centre is None:
            tangent = np.tile(np.array(self.end) - np.array(self.start), (order, 1))
        else:
            d = points - np.array(self.centre)
            tangent = self.angle * np.column_stack([-d[:, 1], d[:, 0]])
        return points, tangent * w[:, None], self.length * w


@cache
def _gauss(order: int) -> tuple[NDArray, NDArray]:
    """Points and weights of Gauss on [-1, 1]; the eigenvalues behind them take their time."""
    return np.polynomial.legendre.leggauss(order)


def on_axis(curve: Curve) -> bool:
    """Whether an edge is straight and on r = 0."""
    return curve.centre is None and curve.start[0] == 0 == curve.end[0]


def crossings(a: Curve, b: Curve) -> NDArray[np.float64]:
    """Points (n, 2) where two edges cross [m]; edges on one line or circle give none."""
    if a.centre is None and b.centre is not None:
        a, b = b, a
    scale = a.length + b.length
    if a.centre is None:
        points = _line_line(a, b)
    elif b.centre is None:
        points = _circle_line(a, b)
    else:
        points = _circle_circle(a, b)
    if len(points) == 0:
        return points
    on_both = (a.distance(points) < SAME * scale) & (b.distance(points) < SAME * scale)
    return points[on_both]


def _line_line(a: Curve, b: Curve) -> NDArray[np.float64]:
    p, q = np.array(a.start), np.array(b.start)
    s, t = np.array(a.end) - p, np.array(b.end) - q
    cross = s[0] * t[1] - s[1] * t[0]
    if abs(cross) < 1e-12 * a.length * b.length:
        return np.empty((0, 2))
    u = ((q - p)[0] * t[1] - (q - p)[1] * t[0]) / cross
    return (p + u * s)[None, :]


def _circle_line(a: Curve, b: Curve) -> NDArray[np.float64]:
    p = np.array(b.start)
    t = (np.array(b.end) - p) / b.length
    d = p - np.array(a.centre)
    half = d @ t
    root = half**2 - d @ d + a.radius**2
    if root < 0:
        return np.empty((0, 2))
    u = -half + np.sqrt(root) * np.array([-1.0, 1.0])
    return p + u[:, None] * t


def _circle_circle(a: Curve, b: Curve) -> NDArray[np.float64]:
    p = np.array(a.centre)
    d = np.array(b.centre) - p
    distance = np.hypot(*d)
    if distance < 1e-12 * (a.radius + b.radius):
        return np.empty((0, 2))
    along = (distance**2 + a.radius**2 - b.radius**2) / (2 * distance)
    root = a.radius**2 - along**2
    if root < 0:
        return np.empty((0, 2))
    e = d / distance
    side = np.sqrt(root) * np.array([-1.0, 1.0])
    return p + along * e + side[:, None] * np.array([-e[1], e[0]])
