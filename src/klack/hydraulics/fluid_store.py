r"""Fluid that a compliant part holds at a node: its volume, and the energy that fills it.

The part holds the volume ``V(p)``, not falling with the pressure, and stores ``U(p)`` with ``dU =
(p - p_amb) dV``; with the compression of the fluid mass and energy are

.. math:: m = \varrho(p)\,V(p), \qquad E = m\,g(p) - (p - p_{amb})\,V + U, \qquad dE = g\,dm ,

so that ``E`` is a convex function of ``m``.  With the pressure at the end of the step the energy
``g_a dm`` that arrives covers the change of ``E``; the rest is a loss, never negative.
"""

from math import exp, inf, log
from typing import Any

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.orifice import orifice_flow
from klack.machine.compiling.jit import inner, njit
from klack.network.step_function import carray, step_function

__all__ = ["GAS", "WALL", "fluid_store_step", "gas_store", "wall_store"]

GAS, WALL = 0.0, 1.0
"""Kinds of the volume law of :func:`fluid_store_step`."""

_MOST = 100  # iterations for the pressure behind the inlet; bisection alone takes 60
_SETTLED = 1e-14


@njit(error_model="numpy")
def gas_store(
    p: float, ambient: float, precharge: float, whole: float, exponent: float, least: float
) -> tuple[float, float, float]:
    r"""Volume [m^3] of fluid beside a gas, its slope [m^3/Pa], and the energy [J] of the gas.

    .. math:: V = V_0\Bigl(1 - \bigl(\tfrac{p_0}{p}\bigr)^{1/n}\Bigr), \qquad
              U = \int_{p_0}^{p} (p - p_{amb})\,dV

    nothing below the precharge ``p_0``; at the volume ``least`` the gas cannot be compressed
    further.

    Parameters
    ----------
    p, ambient, precharge [Pa]
    whole, least [m^3]
        Of the gas at the precharge, and when the accumulator is full.
    exponent [-]
    """
    if p <= precharge:
        return 0.0, 0.0, 0.0
    share = exp(log(precharge / p) / exponent)  # of the gas that is left
    gas, slope = whole * share, whole * share / (exponent * p)
    if gas <= least:
        gas, slope = least, 0.0
        p = precharge * exp(exponent * log(whole / least))
    if exponent == 1.0:
        work = precharge * whole * log(whole / gas)
    else:
        work = (p * gas - precharge * whole) / (exponent - 1.0)
    return whole - gas, slope, work - ambient * (whole - gas)


@njit(error_model="numpy")
def wall_store(p: float, ambient: float, compliance: float) -> tuple[float, float, float]:
    """Volume by which an elastic wall yields, its slope with pressure, and its strain energy."""
    volume = compliance * (p - ambient)
    return volume, compliance, 0.5 * volume * (p - ambient)


@inner(error_model="numpy")
def _held(par: Any, table: Any, p: float, hint: int) -> tuple[float, float, float, float, int]:
    """Mass inside, its slope with pressure, energy, density, and place in the table."""
    rho, by_p, g, hint = fluid_at(table, p, hint)
    if par[1] == GAS:
        volume, slope, energy = gas_store(p, par[2], par[3], par[4], par[5], par[6])
    else:
        volume, slope, energy = wall_store(p, par[2], par[3])
    mass = rho * volume
    energy += mass * g - (p - par[2]) * volume
    return mass, by_p * volume + rho * slope, energy, rho, hint


@step_function
def fluid_store_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow into a store of fluid, with or without an inlet.

    ``par``: 0 size of all, 1 kind, 2 ambient pressure, 3-6 of the volume law, 7-10 inlet
    (conductance, 0 for none; number, throat, vapour pressure), fluid table.  ``state``: pressure
    inside, volume of gas, place in the fluid table, 1 once that pressure is known.  Port b is at
    the surroundings: what is inside counts as a store.
    """
    table = carray(par, (int(par[0]),))[11:]
    h, p_a, hint = inp[1], inp[2], int(state[2])
    known = state[3] > 0.0
    before = state[0] if known else p_a
    m0, _, energy, _, hint = _held(par, table, before, hint)
    p, flow, slope = before, 0.0, 0.0
    if h > 0.0 and inp[0] >= 0.0 and known:
        if par[7] == 0.0:
            p = p_a
            m1, by1, energy, _, hint = _held(par, table, p, hint)
            flow, slope = (m1 - m0) / h, by1 / h
        else:
            low, high = min(p_a, before), max(p_a, before)
            for _ in range(_MOST):
                m1, by1, energy, rho, hint = _held(par, table, p, hint)
                through, up, down = orifice_flow(
                    p_a, p, inp[4], rho, par[7], par[8], par[9], par[10], 0.0, 1.0
                )
                missing = h * through - (m1 - m0)
                if missing > 0.0:
                    low = p
                else:
                    high = p
                rate = by1 - h * down
                slope = up * by1 / rate if rate > 0.0 else 0.0
                change = missing / rate if rate > 0.0 else inf
                new = p + change
                if not low <= new <= high:
                    new = 0.5 * (low + high)
                moved = abs(new - p)
                p = new
                if moved <= _SETTLED * p:
                    break
            m1, by1, energy, _, hint = _held(par, table, p, hint)
            flow = (m1 - m0) / h
    out[0], out[1], out[2] = flow, slope, 0.0
    volume = gas_store(p, par[2], par[3], par[4], par[5], par[6])[0] if par[1] == GAS else 0.0
    out[3], out[4], out[5], out[6] = p, par[4] - volume, hint, 1.0
    out[7] = energy
    return 0
