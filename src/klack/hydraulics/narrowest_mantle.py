r"""Narrowest section between needle and conical seat, and the area where the tip pressure acts.

Between two points of the contours the flow passes the mantle of a frustum,

.. math:: A = \pi (r_P + r_Q)\,|PQ| ,

and the smallest is the flow area.  Between two straight pieces it always has a vertex at one end:
with both ends moved together the area is quadratic and has no minimum above zero.  From a vertex at
the distance ``h`` of a line of slope ``s = dr/dl`` it ends at

.. math:: \tau = -q h, \quad q = \frac{2 s h}{R + \sqrt{R^2 - 8 s^2 h^2}}, \quad
          A = \pi (R - s q h)\, h \sqrt{1 + q^2}

beyond the foot of the perpendicular towards the axis, where the frustum is smaller; ``R`` is the
sum of the radii of vertex and foot.  On a rounded edge regula falsi finds the end where the area
has no slope along the arc.

Limit: nothing beyond the ends of the contours may be nearer.

Below its narrowest sections the pressure of the tip acts on the needle.  Up to three of them are in
series: the *upper* one between edge or shank and seat, the *lower* one between the cone of the tip
and the lower end of the seat, and the bore.  Like orifices with one flow coefficient, each takes a
share of the pressure drop with one over the square of its area,

.. math:: S(x) = \pi\,\frac{r_u^2\,A_u^{-2} + r_l^2\,A_l^{-2}}{A_u^{-2} + A_l^{-2} + A_b^{-2}} ,

with the radii ``r`` of the needle at both; at the bore all of the needle is above.  Closed, ``S``
is the area within the circle of contact; far open it tends to zero.  Each area is continuous in the
lift; ``S`` steps where another corner becomes the nearest one (chamfer, blunt tip).

Limits: the pressure steps at the sections, each jet is dissipated before the next one; what its
momentum takes from the pressure beside the section is the flow force of the seat.
Sources: elementary geometry; Merritt 1967, ch. 3 (orifices in series).
"""

from math import cos, inf, pi, sin, sqrt
from typing import Any

from klack.machine.compiling.jit import inner, njit

__all__ = ["acting_area", "narrowest_mantle"]

_FIRST, _PER_POINT = 13, 5  # place of the first point of the needle, and numbers of each

_ROUNDS = 30


@inner(error_model="numpy")
def _to_point(pr: float, pz: float, qr: float, qz: float) -> float:
    """Area over pi between two points."""
    return (pr + qr) * sqrt((pr - qr) * (pr - qr) + (pz - qz) * (pz - qz))


@inner(error_model="numpy")
def _to_line(
    pr: float, pz: float, r0: float, z0: float, ur: float, uz: float, side: float
) -> tuple[float, float, float, float]:
    """Best end on a line for a point: place, area over pi, distance, its tangent."""
    wr, wz = pr - r0, pz - z0
    along = wr * ur + wz * uz
    h = max(side * (wz * ur - wr * uz), 0.0)
    both = pr + r0 + along * ur
    free = both * both - 8.0 * ur * ur * h * h
    if both <= 0.0 or free <= 0.0:
        return -1.0, inf, 0.0, 0.0
    q = 2.0 * ur * h / (both + sqrt(free))
    d = h * sqrt(1.0 + q * q)
    return along - q * h, (both - ur * q * h) * d, d, q


@inner(error_model="numpy")
def _on_arc(
    par: Any, base: int, x: float, theta: float, target: int
) -> tuple[float, float, float, float]:
    """Slope of the area towards the tip, area over pi, radius, place on the seat.

    ``target``: 0 the surface of the seat, 1 its lower and 2 its upper end.
    """
    s, c = sin(theta), cos(theta)
    pr = par[base + 1] + par[base + 3] * c
    pz = par[base + 2] - par[base + 3] * s + x
    if target == 0:
        ur, uz = par[base + 10], par[base + 11]
        t, area, d, q = _to_line(pr, pz, par[base + 6], par[base + 7], ur, uz, 1.0)
        if area == inf:
            return 0.0, inf, pr, -1.0
        both = area / d if d > 0.0 else 2.0 * pr
        aligned = ((q * ur - uz) * s + (ur + q * uz) * c) / sqrt(1.0 + q * q)
        return -(s * d + both * aligned), area, pr, t
    place = base + 4 + 2 * target
    dr, dz = pr - par[place], pz - par[place + 1]
    d, both = sqrt(dr * dr + dz * dz), pr + par[place]
    return -(s * d + both * (dr * s + dz * c) / d), both * d, pr, 0.0


@inner(error_model="numpy")
def _arc_to(par: Any, base: int, x: float, target: int) -> tuple[float, float]:
    """Smallest area over pi between arc and a part of the seat, and its radius on the arc."""
    low, high = par[base + 4], par[base + 5]
    g_low, area, radius, t = _on_arc(par, base, x, low, target)
    g_high, a_high, _, _ = _on_arc(par, base, x, high, target)
    if area == inf or a_high == inf or g_low >= 0.0 or g_high <= 0.0:
        return inf, radius
    last = 0
    for _ in range(_ROUNDS):
        theta = (low * g_high - high * g_low) / (g_high - g_low)
        g, area, radius, t = _on_arc(par, base, x, theta, target)
        if area == inf:
            return inf, radius
        moved = min(theta - low, high - theta)
        if g < 0.0:
            low, g_low = theta, g
            if last < 0:
                g_high = 0.5 * g_high
            last = -1
        else:
            high, g_high = theta, g
            if last > 0:
                g_low = 0.5 * g_low
            last = 1
        if g == 0.0 or moved < 1e-12:
            break
    if target == 0 and (t < 0.0 or t > par[base + 12]):
        return inf, radius
    return area, radius


@inner(error_model="numpy")
def _narrowest_above(par: Any, base: int, first: int, x: float) -> tuple[float, float]:
    """Area over pi and radius of the narrowest section from a point of the needle up."""
    area, radius = inf + 0.0 * x, 0.0 * x
    for i in range(first, int(par[base])):
        k = base + _FIRST + _PER_POINT * i
        pr, pz = par[k], par[k + 1] + x
        t, found, _, _ = _to_line(
            pr, pz, par[base + 6], par[base + 7], par[base + 10], par[base + 11], 1.0
        )
        if 0.0 < t < par[base + 12] and found < area:
            area, radius = found, pr + 0.0 * x
        for end in range(2):
            qr, qz = par[base + 6 + 2 * end], par[base + 7 + 2 * end]
            found = _to_point(pr, pz, qr, qz)
            if found < area:
                area, radius = found, pr + 0.0 * x
            t, found, _, _ = _to_line(qr, qz, pr, pz, par[k + 2], par[k + 3], -1.0)
            if 0.0 < t < par[k + 4] and found < area:
                area, radius = found, pr + t * par[k + 2]
    if par[base + 3] > 0.0:
        for target in range(3):
            found, at = _arc_to(par, base, x, target)
            if found < area:
                area, radius = found, at
    return area, radius


@njit(error_model="numpy")
def narrowest_mantle(par: Any, base: int, x: float) -> tuple[float, float]:
    """Flow area [m^2] at the lift ``x`` and radius [m] of its end on the needle.

    ``par`` from ``base`` on: 0 number of points of the needle, 1-5 centre, radius, first and last
    angle of its arc (radius 0: none), 6-9 radius and height of lower and upper end of the seat,
    10-12 its direction and length, from 13 on for each point radius, height, direction and length
    to the next one.
    """
    area, radius = _narrowest_above(par, base, 0, x)
    return pi * area, radius


@inner(error_model="numpy")
def _lower(par: Any, base: int, edge: int, x: float) -> tuple[float, float]:
    """Area over pi and radius of the narrowest section between tip and lower end of the seat."""
    qr, qz = par[base + 6], par[base + 7]
    area, radius = inf + 0.0 * x, 0.0 * x
    for i in range(edge + 1):
        k = base + _FIRST + _PER_POINT * i
        pr, pz = par[k], par[k + 1] + x
        found = _to_point(pr, pz, qr, qz)
        if found < area:
            area, radius = found, pr + 0.0 * x
        if i == edge:
            break
        t, found, _, _ = _to_line(qr, qz, pr, pz, par[k + 2], par[k + 3], -1.0)
        if 0.0 < t < par[k + 4] and found < area:
            area, radius = found, pr + t * par[k + 2]
    return area, radius


@njit(error_model="numpy")
def acting_area(par: Any, base: int, edge: int, x: float, bore: float) -> float:
    """Area ``S`` [m^2] at the lift ``x`` [m] with the area ``bore`` [m^2].

    ``par`` from ``base`` on as for :func:`narrowest_mantle`;
    ``edge`` is the point of the needle where the cone of the tip ends.
    """
    upper, r_u = _narrowest_above(par, base, edge, x)
    lower, r_l = _lower(par, base, edge, x)
    to_lower, to_bore = upper / lower, pi * upper / bore
    share = to_lower * to_lower
    return pi * (r_u * r_u + r_l * r_l * share) / (1.0 + share + to_bore * to_bore)
