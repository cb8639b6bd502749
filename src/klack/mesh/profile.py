r"""Meridian of a body of revolution: a closed chain of straight edges and circular arcs.

Turned around the z axis; exact mass properties follow from Green's theorem along the
(anticlockwise) boundary,

.. math:: \iint r^m z^n \, dr\, dz = \oint \frac{r^{m+1}}{m+1} z^n \, dz ,

which gives the area (m=0), the volume over 2 pi (m=1), moments of inertia (m=3).
"""

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.moments import Moments

__all__ = ["Arc", "Curve", "Line", "Profile", "on_axis"]


Point = tuple[float, float]

SAME = 1e-9
"""Distance of equal points over the size of the profile."""


@dataclass(frozen=True, slots=True)
class Curve:
    """An edge with both ends: straight if ``centre`` is None, else an arc of signed ``angle``.

    Parameters
    ----------
    start, end : (r, z) [m]
    centre : (r, z) [m] or None
    angle [rad]
        From start to end, positive anticlockwise.
    """

    start: Point
    end: Point
    name: str
    centre: Point | None = None
    angle: float = 0.0

    @property
    def radius(self) -> float:
        """Radius [m]; infinite for a straight edge."""
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
        """Fraction of the length at the nearest point of the edge, in [0, 1]."""
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

    def quadrature(self, order: int = 24) -> tuple[NDArray, NDArray]:
        """Points (q, 2) [m], tangents times weight (q, 2) [m]."""
        x, w = _gauss(order)
        s, w = 0.5 * (x + 1), 0.5 * w
        points = self.at(s)
        if self.centre is None:
            tangent = np.tile(np.array(self.end) - np.array(self.start), (order, 1))
        else:
            d = points - np.array(self.centre)
            tangent = self.angle * np.column_stack([-d[:, 1], d[:, 0]])
        return points, tangent * w[:, None]


@cache
def _gauss(order: int) -> tuple[NDArray, NDArray]:
    """Gauss points and weights on [-1, 1], kept: their eigenvalues take time."""
    return np.polynomial.legendre.leggauss(order)


def on_axis(curve: Curve) -> bool:
    """Whether an edge is straight and on r = 0."""
    return curve.centre is None and curve.start[0] == 0 == curve.end[0]


def crossings(a: Curve, b: Curve) -> NDArray[np.float64]:
    """Points (n, 2) where edges cross [m]; none on one line or circle."""
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


@dataclass(frozen=True, slots=True)
class Line:
    """Straight edge from the edge before to ``end`` (r, z) [m]."""

    end: Point
    name: str = ""


@dataclass(frozen=True, slots=True)
class Arc:
    """Circular arc to ``end`` around ``centre`` (r, z) [m].

    Parameters
    ----------
    name
        Of the surface; edges of one name make one surface.
    clockwise
        None: the shorter way; for a half circle the way at r >= 0.
    """

    end: Point
    centre: Point
    name: str = ""
    clockwise: bool | None = None


@dataclass(frozen=True)
class Profile:
    """Closed meridian (r, z) of one solid.

    Parameters
    ----------
    start : (r, z) [m]
        The last edge must end there.
    edges
        In either sense; :attr:`curves` is anticlockwise in the (r, z) plane.

    Examples
    --------
    A hemisphere of radius 2 mm, tip down:

    >>> half = Profile((0, 0), (Arc((2e-3, 2e-3), (0, 2e-3), "tip"),
    ...                         Line((0, 2e-3), "top"), Line((0, 0), "axis")))
    >>> round(half.volume / (2 / 3 * np.pi * 2e-3**3), 12)
    1.0
    """

    start: Point
    edges: tuple[Line | Arc, ...]
    _curves: tuple[Curve, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        curves = _chain(self.start, self.edges)
        _require_simple(curves)
        area = sum(_moment(curve, 0, 0) for curve in curves)
        if area < 0:
            curves = tuple(curve.reversed for curve in reversed(curves))
        object.__setattr__(self, "_curves", curves)

    @property
    def curves(self) -> tuple[Curve, ...]:
        """Edges with both ends, anticlockwise (material left)."""
        return self._curves

    @property
    def names(self) -> tuple[str, ...]:
        """Surfaces in order; edges on the axis sweep none."""
        used = [c.name for c in self.curves if c.name and not on_axis(c)]
        return tuple(dict.fromkeys(used))

    @cached_property
    def area(self) -> float:
        """Area of the meridian [m^2]."""
        return self._integral(0, 0)

    @cached_property
    def volume(self) -> float:
        """Volume of the body of revolution [m^3] (Pappus)."""
        return 2 * np.pi * self._integral(1, 0)

    @cached_property
    def centre(self) -> float:
        """Height z of the centre of gravity of the body of revolution [m]."""
        return self._integral(1, 1) / self._integral(1, 0)

    @cached_property
    def moments(self) -> Moments:
        """Of the body of revolution."""
        across, along = np.pi * self._integral(3, 0), 2 * np.pi * self._integral(1, 2)
        first = np.array([0.0, 0.0, self.volume * self.centre])
        return Moments.about_origin(self.volume, first, np.diag([across, across, along]))

    def _integral(self, m: int, n: int) -> float:
        """Integral of r^m z^n over the meridian [m^(m+n+2)]."""
        return sum(_moment(curve, m, n) for curve in self.curves)


def _moment(curve: Curve, m: int, n: int) -> float:
    points, tangent = curve.quadrature()
    r, z = points.T
    return float(np.sum(r ** (m + 1) / (m + 1) * z**n * tangent[:, 1]))


def _text(point: NDArray | Point) -> str:
    return f"({point[0] * 1e3:.6g}, {point[1] * 1e3:.6g}) mm"


def _chain(start: Point, edges: tuple[Line | Arc, ...]) -> tuple[Curve, ...]:
    """Edges with both ends; checks numbers, closure, r >= 0."""
    corners = np.array([start, *(edge.end for edge in edges)], dtype=float)
    centres = np.array([e.centre for e in edges if isinstance(e, Arc)], dtype=float)
    refuse_if(
        len(edges) < 2 or not (np.all(np.isfinite(corners)) and np.all(np.isfinite(centres))),
        "Profile.edges",
        got=f"{len(edges)} edges" if len(edges) < 2 else "a coordinate that is not finite",
        expected="at least two edges with finite (r, z) in m",
        hint="list the edges in order, each with its end point.",
    )
    size = float(np.ptp(corners, axis=0).max())
    refuse_if(
        np.linalg.norm(corners[-1] - corners[0]) > SAME * size,
        f"Profile: edge {len(edges)} '{edges[-1].name}'",
        got=f"an end at {_text(corners[-1])}",
        expected=f"the start of the profile, {_text(corners[0])}",
        hint="add the edge that closes the profile (often the axis).",
    )
    corners[-1] = corners[0]
    corners[np.abs(corners[:, 0]) < SAME * size, 0] = 0.0
    curves = []
    for i, edge in enumerate(edges):
        where = f"Profile: edge {i + 1} '{edge.name}'"
        curve = _curve(where, corners[i], corners[i + 1], edge, size)
        lowest = curve.at(np.linspace(0, 1, 65))[:, 0].min()
        refuse_if(
            lowest < -SAME * size,
            where,
            got=f"a radius of {lowest * 1e3:.6g} mm",
            expected="r >= 0 everywhere",
            hint="draw the half of the section at positive r.",
        )
        curves.append(curve)
    return tuple(curves)


def _curve(where: str, start: NDArray, end: NDArray, edge: Line | Arc, size: float) -> Curve:
    first: Point = (float(start[0]), float(start[1]))
    last: Point = (float(end[0]), float(end[1]))
    refuse_if(
        np.linalg.norm(end - start) <= SAME * size,
        where,
        got="an edge of zero length",
        expected="different start and end",
        hint="remove the edge; a full circle needs two arcs.",
    )
    if isinstance(edge, Line):
        return Curve(first, last, edge.name)
    centre = np.array(edge.centre, dtype=float)
    a, b = start - centre, end - centre
    ra, rb = np.hypot(*a), np.hypot(*b)
    refuse_if(
        abs(ra - rb) > 1e-6 * max(ra, rb),
        where,
        got=f"a centre {ra * 1e3:.6g} mm from the start and {rb * 1e3:.6g} mm from the end",
        expected="the same distance (the radius) to both",
        hint="the centre must lie on the perpendicular bisector of start and end.",
    )
    angle = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
    # put the centre on the bisector exactly, so that both ends lie on one circle
    chord = end - start
    centre = centre - ((centre - 0.5 * (start + end)) @ chord) / (chord @ chord) * chord
    middle: Point = (float(centre[0]), float(centre[1]))
    clockwise = edge.clockwise
    if clockwise is None and np.pi - abs(angle) < 1e-6:
        clockwise = _half_circle_sense(where, first, last, middle)
    if clockwise is not None:
        angle = angle % (2 * np.pi) - (2 * np.pi if clockwise else 0.0)
    return Curve(first, last, edge.name, middle, angle)


def _half_circle_sense(where: str, start: Point, end: Point, centre: Point) -> bool:
    """Sense of a half circle that stays at r >= 0."""
    keeps = [
        Curve(start, end, "", centre, angle).at(np.linspace(0, 1, 65))[:, 0].min()
        >= -1e-6 * np.hypot(start[0] - centre[0], start[1] - centre[1])
        for angle in (np.pi, -np.pi)
    ]
    refuse_if(
        keeps[0] == keeps[1],
        where,
        got="a half circle, whose two arcs are equally long",
        expected="clockwise True or False",
        hint="set clockwise, or split the arc in two.",
    )
    return keeps[1]


def _require_simple(curves: tuple[Curve, ...]) -> None:
    """Reject edges that touch or cross but at their shared corner."""
    count = len(curves)
    corners = np.array([curve.start for curve in curves])
    size = float(np.ptp(corners, axis=0).max())
    for i, curve in enumerate(curves):
        others = [k for k in range(count) if k not in (i, (i + 1) % count)]
        for k in others:
            if curve.distance(corners[k]) < SAME * size:
                _raise_crossing(curves, i, k, corners[k])
    for i in range(count):
        for j in range(i + 1, count):
            for point in crossings(curves[i], curves[j]):
                near = np.linalg.norm(corners - point, axis=1) < 1e-6 * size
                if not near.any():
                    _raise_crossing(curves, i, j, point)


def _raise_crossing(curves: tuple[Curve, ...], i: int, j: int, point: NDArray) -> None:
    raise InputError(
        f"Profile: edges {i + 1} '{curves[i].name}' and {j + 1} '{curves[j].name}'",
        got=f"a common point at {_text(point)}",
        expected="edges that meet only at the corners that join them",
        hint="check the order of the edges and the direction of the arcs.",
    )
