"""Films by other means: Reynolds' equation on a grid, two bodies and a film by an ODE solver."""

from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded

from klack.network.rows import FilmRow
from klack.reduction.reduced_body import ReducedBody

__all__ = ["film_by_ode", "squeeze_by_volumes"]

Vector = NDArray[np.float64]


def squeeze_by_volumes(inner: float, outer: float, cells: int) -> float:
    r"""Squeeze coefficient ``B/mu`` [m^4] of a flat ring or disc by finite volumes, second order.

    .. math:: \frac1r \frac{\mathrm d}{\mathrm dr}\Bigl(\frac{r h^3}{12 \mu}
              \frac{\mathrm dp}{\mathrm dr}\Bigr) = -V

    Parameters
    ----------
    inner, outer : float [m]
        Radii; an inner one of 0 makes a disc.
    cells : int
    """
    edges = np.linspace(inner, outer, cells + 1)
    r, dr = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]
    conductance = edges / (12.0 * dr)
    conductance[[0, -1]] *= 2.0  # p = 0 at the edges, half a cell away
    bands = np.zeros((3, cells))
    bands[0, 1:] = bands[2, :-1] = -conductance[1:-1]
    bands[1] = conductance[:-1] + conductance[1:]
    pressure = solve_banded((1, 1), bands, r * dr)
    return float(np.sum(2.0 * pi * r * dr * pressure))


def film_by_ode(
    upper: ReducedBody,
    lower: ReducedBody,
    film: FilmRow,
    *,
    series: float,
    gap: float,
    speed: float,
    duration: float,
    relative: float,
) -> tuple[float, Vector]:
    r"""Peak force [N] and final state of two undamped bodies that only a film and ``D`` part.

    .. math:: \dot e = -\dot g - \frac{e/D}{B/x^3 + C/x}, \qquad x = g + e + h_r

    Implicit Runge-Kutta (Radau IIA, order 5) with an analytic Jacobian.  Holds while the film
    keeps the faces apart (``g + e > 0``) and does not cavitate.

    Parameters
    ----------
    upper, lower : ReducedBody
        Ports ``bottom`` and ``top`` meet.
    film : FilmRow
    series, gap, speed, duration : float [m/N], [m], [m/s], [s]
    relative : float [-]
        Tolerance.
    """
    omega = np.concatenate([upper.omega, lower.omega])
    c = np.concatenate(
        [
            upper.port_shapes[:, upper.port_names.index("bottom")],
            -lower.port_shapes[:, lower.port_names.index("top")],
        ]
    )
    m = omega.size

    def mobility(x: float) -> tuple[float, float]:
        """``V/F`` of the film and its slope over ``x``."""
        below = film.cubic + film.linear * x * x
        return x**3 / below, (3.0 * film.cubic * x**2 + film.linear * x**4) / below**2

    def rate(t: float, y: Vector) -> Vector:
        q, v, e = y[:m], y[m:-1], y[-1]
        flow, _ = mobility(gap + c @ q + e + film.cut_off)
        force = e / series
        return np.concatenate([v, c * force - omega**2 * q, [-(c @ v) - flow * force]])

    def jacobian(t: float, y: Vector) -> Vector:
        q, e = y[:m], y[-1]
        flow, slope = mobility(gap + c @ q + e + film.cut_off)
        J = np.zeros((2 * m + 1, 2 * m + 1))
        J[:m, m:-1] = np.eye(m)
        J[m:-1, :m] = np.diag(-(omega**2))
        J[m:-1, -1] = c / series
        J[-1, :m] = -slope * e / series * c
        J[-1, m:-1] = -c
        J[-1, -1] = -slope * e / series - flow / series
        return J

    start = np.zeros(2 * m + 1)
    start[m : m + upper.rigid_count] = -speed * upper.rigid_axial
    scale = np.concatenate([np.full(m, 1e-7), np.full(m, 1e-1), [1e-8]])
    solution = solve_ivp(
        rate,
        (0.0, duration),
        start,
        method="Radau",
        jac=jacobian,
        rtol=relative,
        atol=relative * scale,
        dense_output=True,
    )
    assert solution.sol is not None  # dense_output was asked for
    fine = solution.sol(np.linspace(0.0, duration, 20001))
    return float(np.max(fine[-1]) / series), solution.y[:-1, -1]
