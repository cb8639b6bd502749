r"""Contour of a needle with an edge on a conical seat: two cones, sharp, rounded or chamfered.

The edge is where tip and shank would meet.  With a tip blunter and a shank steeper than the seat
the closed needle touches along one circle, the sealing diameter: the edge, an end of the chamfer,
or the point of the rounding with the tangent of the seat,

.. math:: r_s = r_e - \rho\Bigl(\cos\beta_2 + \sin\beta_2
          \tan\tfrac{\beta_2 - \beta_1}{2}\Bigr) + \rho \cos\alpha

with the half angles of tip, shank and seat.
Source: elementary geometry.
"""

from dataclasses import dataclass
from math import cos, hypot, sin, tan
from typing import Self

__all__ = ["NeedleContour"]

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class NeedleContour:
    """Contour in the half plane of radius and height; height 0 is the edge.

    Parameters
    ----------
    points [m], [m]
        From the axis up; the last one far away.
    edge_start [m]
        Radius where the cone of the tip ends.
    arc [m], [m], [m], [rad], [rad]
        Centre, radius, angles of shank and tip; radius 0 without a rounding.
    """

    points: tuple[Point, ...]
    edge_start: float
    arc: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @classmethod
    def of(
        cls,
        edge: float,
        tip: float,
        shank: float,
        far: float,
        *,
        tip_radius: float = 0.0,
        rounding: float = 0.0,
        chamfer: Point | None = None,
    ) -> Self:
        """Build from the radius [m] of the edge, half angles [rad], a length [m] of the shank.

        Also ``tip_radius`` [m], ``rounding`` [m] of the edge, ``chamfer`` half angle [rad] and
        width [m].
        """
        below = above = 0.0
        arc = (0.0, 0.0, 0.0, 0.0, 0.0)
        if rounding > 0.0:
            below = above = rounding * tan(0.5 * (tip - shank))
        elif chamfer is not None:
            angle, width = chamfer
            below = width * sin(angle - shank) / sin(tip - shank)
            above = width * sin(tip - angle) / sin(tip - shank)
        low = (edge - below * sin(tip), -below * cos(tip))
        high = (edge + above * sin(shank), above * cos(shank))
        if rounding > 0.0:
            arc = (
                high[0] - rounding * cos(shank),
                high[1] + rounding * sin(shank),
                rounding,
                shank,
                tip,
            )
        along = (low[0] - tip_radius) / sin(tip)
        end = (tip_radius, low[1] - along * cos(tip))
        middle = (low,) if low == high else (low, high)
        last = (high[0] + far * sin(shank), high[1] + far * cos(shank))
        foot = ((0.0, end[1]),) if tip_radius > 0.0 else ()
        return cls(points=(*foot, end, *middle, last), edge_start=low[0], arc=arc)

    @property
    def edge_point(self) -> int:
        """Number of the point where the cone of the tip ends."""
        return next(k for k, point in enumerate(self.points) if point[0] >= self.edge_start)

    def seal(self, angle: float) -> Point:
        """Radius and height [m] where it touches a cone of this half angle [rad]."""
        out, down = cos(angle), sin(angle)
        if self.arc[2] > 0.0:
            return self.arc[0] + self.arc[2] * out, self.arc[1] - self.arc[2] * down
        return max(self.points, key=lambda p: p[0] * out - p[1] * down)

    def numbers(self, angle: float, lower: float, upper: float) -> tuple[float, ...]:
        """Parameters of :func:`~klack.hydraulics.narrowest_mantle.narrowest_mantle`.

        Closed on a seat of this half angle [rad] between two radii [m]; its lower end has height 0.
        """
        radius, height = self.seal(angle)
        up = (radius - lower) / tan(angle) - height
        length = (upper - lower) / sin(angle)
        numbers = [float(len(self.points)), self.arc[0], self.arc[1] + up, *self.arc[2:]]
        numbers += [lower, 0.0, upper, length * cos(angle), sin(angle), cos(angle), length]
        for p, q in zip(self.points, (*self.points[1:], self.points[-1]), strict=True):
            size = hypot(q[0] - p[0], q[1] - p[1])
            way = ((q[0] - p[0]) / size, (q[1] - p[1]) / size) if size > 0.0 else (0.0, 0.0)
            numbers += [p[0], p[1] + up, *way, size]
        return tuple(numbers)
