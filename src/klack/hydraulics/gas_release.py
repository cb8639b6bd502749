r"""Liquid whose gas leaves and enters solution with time constants, for the time loop.

A share ``y`` of the gas is free, the rest is dissolved and has no volume of its own:

.. math:: v(p, y) = v_t(p) - (1 - y)\,v_g(p), \qquad v_g = c\,p^{-1/n}, \qquad
          \dot y = \frac{\theta(p) - y}{\tau}

with ``v_t`` of :func:`~klack.hydraulics.fluid_table.fluid_table` for a fluid all of whose gas is
free, the volume ``v_g`` of this gas per mass of fluid, the share ``theta`` at equilibrium, and
``tau`` of release where ``y`` is below it and of absorption above.  Over a step ``H`` the share
follows the pressure at its end, :math:`y = y_0 + (1 - e^{-H/\tau})(\theta(p) - y_0)`, exactly for a
constant pressure; a short ``tau`` leads to equilibrium.

.. math:: E = m\,g_t(p) - (p - p_a) V - D\,G(p), \qquad dE = g_t\,dm - (p - p_a)\,dV - G\,dD

is the energy of a chamber with the dissolved mass ``D = m (1 - y)`` (fluid whose gas is dissolved)
and :math:`G = \int_{p_a}^p v_g\,dp`: gas that leaves the liquid gives ``-G dD`` and takes it back
when dissolved.
"""

from math import exp, log
from typing import Any

import numpy as np

from klack.arrays import Vector
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_table import fluid_at, pressure_at
from klack.hydraulics.mixture import LOWEST_PRESSURE
from klack.machine.compiling.jit import njit

__all__ = [
    "NO_RELEASE",
    "free_gas",
    "mixture_at",
    "mixture_pressure",
    "release_numbers",
    "settled_share",
    "share_moved",
]


NO_RELEASE = np.zeros(8)
"""Numbers of a fluid whose gas has no time constants."""

_MOST = 200
_SETTLED = 1e-15
_ONE = LOWEST_PRESSURE


def release_numbers(fluid: Fluid, ambient_pressure: float) -> Vector:
    """Numbers of :func:`free_gas` and the following: ``c``, ``1/n``, ambient, band, both times."""
    gas = fluid.gas
    assert gas.release_pressure is not None
    assert gas.saturation_pressure is not None
    assert gas.release_time is not None
    assert gas.absorption_time is not None
    volume, _ = fluid.all_free().gas.volume(gas.reference_pressure)
    return np.array(
        [
            float(volume) / fluid.mixture_mass * gas.reference_pressure ** (1.0 / gas.exponent),
            1.0 / gas.exponent,
            ambient_pressure,
            gas.release_pressure,
            gas.saturation_pressure,
            gas.release_time,
            gas.absorption_time,
            0.0,
        ]
    )


@njit(error_model="numpy", _nrt=False)
def free_gas(law: Any, p: float) -> tuple[float, float, float]:
    """Volume of all gas per mass of fluid, its slope with pressure, and the energy ``G``.

    Linear below 1 Pa, as the volume of the fluid.
    """
    c, power, ambient = law[0], law[1], law[2]
    at = max(p, _ONE)
    v = c * exp(-power * log(at))
    slope = -power * v / at
    if power == 1.0:
        energy = c * log(at / ambient)
    else:
        energy = (at * v - c * exp((1.0 - power) * log(ambient))) / (1.0 - power)
    if p < at:
        s = p - at
        energy += s * (v + 0.5 * slope * s)
        v += slope * s
    return v, slope, energy


@njit(error_model="numpy", _nrt=False)
def settled_share(law: Any, p: float) -> tuple[float, float]:
    """Free share of the gas at equilibrium, and its slope with pressure."""
    width = law[4] - law[3]
    t = min(max((p - law[3]) / width, 0.0), 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t), -6.0 * t * (1.0 - t) / width


@njit(error_model="numpy", _nrt=False)
def share_moved(
    law: Any, p: float, before: float, freed: float, taken: float
) -> tuple[float, float]:
    """Free share at the end of a step and its slope with the pressure there.

    ``freed`` and ``taken``: share of the way to equilibrium by release and absorption.
    """
    there, slope = settled_share(law, p)
    part = freed if there > before else taken
    return before + part * (there - before), part * slope


@njit(error_model="numpy", _nrt=False)
def mixture_at(
    table: Any, law: Any, p: float, before: float, freed: float, taken: float, hint: int
) -> tuple[float, float, float, int]:
    """As :func:`fluid_at` with the free share of :func:`share_moved`; the energy is ``g_t``."""
    rho, by_p, g, hint = fluid_at(table, p, hint)
    share, share_slope = share_moved(law, p, before, freed, taken)
    gas, gas_slope, _ = free_gas(law, p)
    missing = 1.0 - share
    v = 1.0 / rho - missing * gas
    slope = -by_p / (rho * rho) - missing * gas_slope + share_slope * gas
    return 1.0 / v, -slope / (v * v), g, hint


@njit(error_model="numpy", _nrt=False)
def mixture_pressure(
    table: Any, law: Any, rho: float, before: float, freed: float, taken: float, hint: int
) -> tuple[float, int]:
    """Pressure at which :func:`mixture_at` has this density, and its place.

    Upper bound: the pressure with all gas free, since the mixture is never lighter.
    """
    high, hint = pressure_at(table, rho, hint)
    if high <= _ONE:  # less than a trace of gas is dissolved
        return high, hint
    low, p = _ONE, high
    for _ in range(_MOST):
        found, slope, _, hint = mixture_at(table, law, p, before, freed, taken, hint)
        if found > rho:
            high = p
        else:
            low = p
        step = (rho - found) / slope
        if abs(step) <= _SETTLED * p:
            return p, hint
        p += step
        if not low < p < high:
            if high - low <= _SETTLED * high:
                return high, hint
            p = 0.5 * (low + high)
    return p, hint
