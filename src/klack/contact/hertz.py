"""Width of smooth contacts on half-spaces: a line and a point (Hertz 1882; Johnson 1985, ch. 4).

For sizing a mesh before any mesh resolves the contact.
"""

from math import pi, sqrt

from klack.errors import require_nonnegative, require_positive

__all__ = ["line_half_width", "point_radius"]


def line_half_width(load: float, curvature: float, modulus: float) -> float:
    r"""Half width of a line contact [m].

    .. math:: b = \sqrt{\frac{4 F'}{\pi E^* \kappa}}

    Parameters
    ----------
    load [N/m]
        F'.
    curvature [1/m]
        Relative, across the line: sum of both bodies, convex positive.
    modulus [Pa]
        E* with 1/E* = (1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b.

    Examples
    --------
    Steel rollers of 10 mm relative radius under 100 N/mm:

    >>> f"{1e6 * line_half_width(1e5, 100.0, 115.4e9):.1f} um"
    '105.0 um'
    """
    require_nonnegative("line_half_width: load", load, "N/m")
    require_positive("line_half_width: curvature", curvature, "1/m")
    require_positive("line_half_width: modulus", modulus, "Pa")
    return sqrt(4.0 * load / (pi * modulus * curvature))


def point_radius(force: float, curvature: float, modulus: float) -> float:
    r"""Radius of the contact of two spheres [m].

    .. math:: a = \left(\frac{3 F}{4 E^* \kappa}\right)^{1/3}

    Parameters
    ----------
    force [N]
    curvature [1/m]
        Sum of both bodies, convex positive.
    modulus [Pa]
        E*.

    Examples
    --------
    >>> f"{1e6 * point_radius(100.0, 500.0, 115.4e9):.0f} um"
    '109 um'
    """
    require_nonnegative("point_radius: force", force, "N")
    require_positive("point_radius: curvature", curvature, "1/m")
    require_positive("point_radius: modulus", modulus, "Pa")
    return float((3.0 * force / (4.0 * modulus * curvature)) ** (1.0 / 3.0))
