r"""Area of a needle below its narrowest sections on a conical seat, where the tip pressure acts.

Up to three narrow sections are in series: the *upper* one between edge or shank and seat, the
*lower* one between the cone of the tip and the lower end of the seat, and the bore.  Like orifices
with one flow coefficient, each takes a share of the pressure drop with one over the square of its
area,

.. math:: S(x) = \pi\,\frac{r_u^2\,A_u^{-2} + r_l^2\,A_l^{-2}}{A_u^{-2} + A_l^{-2} + A_b^{-2}} ,

with the radii ``r`` of the needle at both; at the bore all of the needle is above.  Closed, ``S``
is the area within the circle of contact; far open it tends to zero.  Each area is continuous in the
lift; ``S`` steps where another corner becomes the nearest one (chamfer, blunt tip).

Limits: the pressure steps at the sections, each jet is dissipated before the next one; what its
momentum takes from the pressure beside the section is the flow force of the seat.
Source: Merritt 1967, ch. 3 (orifices in series); elementary geometry.
"""

from math import inf, pi, sqrt
from typing import Any

from klack.hydraulics.narrowest_mantle import FIRST, PER_POINT, arc_to, to_line
from klack.machine.compiling.jit import inner, njit

__all__ = ["acting_area"]


@inner(error_model="numpy")
def _to_point(pr: float, pz: float, qr: float, qz: float) -> float:
    return (pr + qr) * sqrt((pr - qr) * (pr - qr) + (pz - qz) * (pz - qz))


@inner(error_model="numpy")
def _upper(par: Any, base: int, edge: int, x: float) -> tuple[float, float]:
    """Area over pi and radius of the narrowest section from the edge of the needle up."""
    area, radius = inf + 0.0 * x, 0.0 * x
    for i in range(edge, int(par[base])):
        k = base + FIRST + PER_POINT * i
        pr, pz = par[k], par[k + 1] + x
        t, found, _, _ = to_line(
            pr, pz, par[base + 6], par[base + 7], par[base + 10], par[base + 11], 1.0
        )
        if 0.0 < t < par[base + 12] and found < area:
            area, radius = found, pr + 0.0 * x
        for end in range(2):
            qr, qz = par[base + 6 + 2 * end], par[base + 7 + 2 * end]
            found = _to_point(pr, pz, qr, qz)
            if found < area:
                area, radius = found, pr + 0.0 * x
            t, found, _, _ = to_line(qr, qz, pr, pz, par[k + 2], par[k + 3], -1.0)
            if 0.0 < t < par[k + 4] and found < area:
                area, radius = found, pr + t * par[k + 2]
    if par[base + 3] > 0.0:
        for target in range(3):
            found, at = arc_to(par, base, x, target)
            if found < area:
                area, radius = found, at
    return area, radius


@inner(error_model="numpy")
def _lower(par: Any, base: int, edge: int, x: float) -> tuple[float, float]:
    """Area over pi and radius of the narrowest section between tip and lower end of the seat."""
    qr, qz = par[base + 6], par[base + 7]
    area, radius = inf + 0.0 * x, 0.0 * x
    for i in range(edge + 1):
        k = base + FIRST + PER_POINT * i
        pr, pz = par[k], par[k + 1] + x
        found = _to_point(pr, pz, qr, qz)
        if found < area:
            area, radius = found, pr + 0.0 * x
        if i == edge:
            break
        t, found, _, _ = to_line(qr, qz, pr, pz, par[k + 2], par[k + 3], -1.0)
        if 0.0 < t < par[k + 4] and found < area:
            area, radius = found, pr + t * par[k + 2]
    return area, radius


@njit(error_model="numpy")
def acting_area(par: Any, base: int, edge: int, x: float, bore: float) -> float:
    """Area ``S`` [m^2] at the lift ``x`` [m] with the area ``bore`` [m^2].

    ``par`` from ``base`` on as for :func:`~klack.hydraulics.narrowest_mantle.narrowest_mantle`;
    ``edge`` is the point of the needle where the cone of the tip ends.
    """
    upper, r_u = _upper(par, base, edge, x)
    lower, r_l = _lower(par, base, edge, x)
    to_lower, to_bore = upper / lower, pi * upper / bore
    share = to_lower * to_lower
    return pi * (r_u * r_u + r_l * r_l * share) / (1.0 + share + to_bore * to_bore)
