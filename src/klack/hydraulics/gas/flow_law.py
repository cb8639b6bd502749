r"""Mass flow of gas through restrictions, with its slopes, at given states on both sides.

A component after ISO 6358-1:2013 has a sonic conductance ``C``, a critical pressure ratio ``b``, a
subsonic index ``m`` and perhaps a cracking pressure ``dp_c``; with the ratio ``r = p_2/p_1`` of the
absolute pressures behind and before it, and ``r_c = 1 - dp_c/p_1``,

.. math:: \dot m = C \varrho_0 p_1 \sqrt{\frac{T_0}{T_1}}\;\psi, \qquad
          \psi = \begin{cases} 1 & r \le b \\
          \Bigl[1 - \bigl(\frac{r - b}{r_c - b}\bigr)^2\Bigr]^m & b < r < r_c \\
          0 & r \ge r_c \end{cases}

Its slope is infinite where the flow ends; so in the last thousandth of the pressure ratio the flow
is laminar, a straight line that joins this law.
"""

from math import exp, log, sqrt
from typing import Any

from klack.machine.compiling.jit import inner, njit

__all__ = ["GAP", "LAMINAR", "VALVE", "flow_through", "gap_flow", "restriction_flow"]

LAMINAR = 1e-3
"""Share of the pressure ratio in which the flow is a straight line to zero."""

VALVE, GAP = 0.0, 1.0
"""Kinds of restrictions of :func:`flow_through`."""


@njit(error_model="numpy")
def restriction_flow(
    p1: float, p2: float, T1: float, factor: float, b: float, m: float, crack: float
) -> tuple[float, float, float, float]:
    """Mass flow [kg/s] from p1 to p2, its slopes with both [kg/(s Pa)] and with T1 [kg/(s K)].

    Parameters
    ----------
    p1, p2 [Pa]
        ``p1 >= p2``.
    T1 [K]
    factor [kg K^0.5/(s Pa)]
        ``C rho_0 sqrt(T_0)``.
    b, m [-]
    crack [Pa]
    """
    if p1 <= crack or p1 <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    r, end = p2 / p1, 1.0 - crack / p1
    if r > end:
        return 0.0, 0.0, 0.0, 0.0
    short = min(LAMINAR, end)
    psi, by_r, by_end = 1.0, 0.0, 0.0
    if r > end - short:
        top, top_by_end = 1.0, 0.0
        if end - short > b:
            u = 1.0 - short / (end - b)
            left = 1.0 - u * u
            top = exp(m * log(left))
            top_by_end = -2.0 * m * u * top / left * short / ((end - b) * (end - b))
        share = (end - r) / short
        psi, by_r = top * share, -top / short
        by_end = top / short + share * top_by_end
    elif r > b:
        u = (r - b) / (end - b)
        left = 1.0 - u * u
        psi = exp(m * log(left))
        slope = 2.0 * m * u * psi / left / (end - b)
        by_r, by_end = -slope, slope * u
    scale = factor / sqrt(T1)
    flow = scale * p1 * psi
    by_p1 = scale * (psi - r * by_r + by_end * crack / p1)
    return flow, by_p1, scale * by_r, -0.5 * flow / T1


@njit(error_model="numpy")
def gap_flow(p1: float, p2: float, T1: float, factor: float) -> tuple[float, float, float, float]:
    """Laminar isothermal flow through a narrow gap, ``G (p_1^2 - p_2^2)/T_1``.

    As :func:`restriction_flow`, with ``factor`` [kg K/(s Pa^2)].
    """
    flow = factor * (p1 - p2) * (p1 + p2) / T1
    return flow, 2.0 * factor * p1 / T1, -2.0 * factor * p2 / T1, -flow / T1


@inner(error_model="numpy")
def flow_through(
    par: Any, at: int, opening: float, p_a: float, p_b: float, T_a: float, T_b: float
) -> tuple[float, float, float, float, float]:
    """Mass flow from a to b, its slopes with both pressures and both temperatures.

    ``par[at:]``: kind, factor, b, m, cracking pressure, 1 where it blocks gas from b to a.
    ``opening`` scales the factor.
    """
    forward = p_a >= p_b
    p1, p2, T1 = (p_a, p_b, T_a) if forward else (p_b, p_a, T_b)
    if not forward and par[at + 5] > 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    factor = par[at + 1] * opening
    if par[at] == GAP:
        flow, up, down, by_T = gap_flow(p1, p2, T1, factor)
    else:
        flow, up, down, by_T = restriction_flow(
            p1, p2, T1, factor, par[at + 2], par[at + 3], par[at + 4]
        )
    if forward:
        return flow, up, down, by_T, 0.0
    return -flow, -down, -up, 0.0, -by_T
