"""Opening of a seat whose needle is off-axis or tilted, in compiled code.

The area is that of :func:`klack.hydraulics.off_axis_seat.flow_area`.  Sectors round the edge are in
parallel: laminar flow through the land goes with the mean of :math:`h^3`, that of a sharp edge at
rest with the mean of :math:`h^2` over that of ``h``.
"""

from math import cos, pi, sin, sqrt

import numpy as np

from klack.machine.compiling.jit import njit

__all__ = ["ANGLES", "FLAT", "off_axis_opening"]

FLAT, CONE, BALL = 0.0, 1.0, 2.0
ANGLES = 72
_NODES, _WEIGHTS = (tuple(map(float, part)) for part in np.polynomial.legendre.leggauss(8))
_TURN_COS, _TURN_SIN = cos(2.0 * pi / ANGLES), sin(2.0 * pi / ANGLES)


@njit(error_model="numpy")
def off_axis_opening(
    kind: float,
    r: float,
    s: float,
    c: float,
    x: float,
    ex: float,
    ey: float,
    tx: float,
    ty: float,
) -> tuple[float, float, float]:
    """Area [m^2], gap of the edge [m], and mean cube of the gap [m^3].

    Parameters
    ----------
    kind
        0 flat, 1 cone, 2 ball.
    r [m]
        Radius of the edge.
    s, c
        Sine and cosine of the angle between axis and face.
    x [m]
        Lift; below zero the faces overlap.
    ex, ey [m]
        Offset.
    tx, ty
        Slopes of the plane across the axis of the needle.
    """
    length = sqrt(1.0 + tx * tx + ty * ty)
    ax, ay, az = -tx / length, -ty / length, 1.0 / length
    R, x0 = r, 0.0
    if kind == BALL:
        R, x0 = r / c, r * s / c
    u, v = 1.0, 0.0  # cosine and sine of the angle round the edge
    area = ones = squares = cubes = 0.0
    for _ in range(ANGLES):
        # way along the edge, and from the needle's point to the edge
        wx, wy = -r * v, r * u
        dx, dy, dz = r * u - ex, r * v - ey, -x
        along = dx * ax + dy * ay + dz * az
        excess = x * x + ex * ex + ey * ey - 2.0 * r * (u * ex + v * ey)  # |D|^2 - r^2
        if kind == FLAT:
            h, turn = -along, 0.0
            meridian, across = 0.0, r * r - (wx * ax + wy * ay) ** 2
        elif kind == BALL:
            rise = excess - 2.0 * x0 * along
            distance = sqrt(R * R + rise)
            nx, ny = (x0 * ax - dx) / distance, (x0 * ay - dy) / distance
            h, turn = rise / (distance + R), 1.0 / distance
            meridian, across = 0.0, r * r - (wx * nx + wy * ny) ** 2
        else:
            beyond = excess - along * along
            rho = sqrt(r * r + beyond)
            ox, oy = (dx - along * ax) / rho, (dy - along * ay) / rho
            h, turn = beyond / (rho + r) * c - along * s, c / rho
            nx, ny = -c * ox + s * ax, -c * oy + s * ay
            meridian = ((wx * ax + wy * ay) * c + (wx * ox + wy * oy) * s) ** 2
            across = r * r - (wx * nx + wy * ny) ** 2 - meridian
        if h > 0.0:
            ones += h
            squares += h * h
            cubes += h * h * h
            if kind == CONE:
                if h * turn > 1.0:
                    h = 1.0 / turn
                total = 0.0
                for node, weight in zip(_NODES, _WEIGHTS):  # noqa: B905  compiled
                    width = 1.0 - 0.5 * h * (1.0 + node) * turn
                    total += weight * sqrt(meridian + across * width * width)
                area += 0.5 * h * total
            else:
                area += sqrt(across) * h * (1.0 - 0.5 * h * turn)
        u, v = u * _TURN_COS - v * _TURN_SIN, v * _TURN_COS + u * _TURN_SIN
    if ones <= 0.0:
        return 0.0, 0.0, 0.0
    return 2.0 * pi / ANGLES * area, squares / ones, cubes / ANGLES
