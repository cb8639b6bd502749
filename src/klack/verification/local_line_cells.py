"""Single cells of lines with local properties: the flux at a face, the wave speed in a cell."""

from functools import partial
from math import pi, sqrt

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.local_line import LocalLine
from klack.verification.cell_runs import cell_rates, cell_state
from klack.verification.check import Check, compare

__all__ = ["local_line_cells"]

BAR = 1e5
AMBIENT = 1.01325 * BAR
HEPTANE = library_fluid("n-heptane").at(293.15)
LENGTH, BORE, CELLS = 0.1, 2e-3, 4
AREA = pi / 4 * BORE**2
_check = partial(compare, "lines")


def local_line_cells() -> list[Check]:
    """Mean mass of the flux where its series acts, and where it does not; wall of a cell."""
    return [*_mean_mass(), *_wave_speed()]


def _line(stretch: float) -> LocalLine:
    sizes = {"length": LENGTH, "diameter": BORE, "roughness": 0.0}
    return LocalLine(friction="none", cells=CELLS, stretch=stretch, **sizes)


def _gained(low: float, high: float) -> float:
    """Difference of ``g`` between two pressures [J/kg], by quadrature."""
    found = quad(lambda x: float(HEPTANE.specific_volume(x)[0]), low, high, epsrel=1e-13)
    return float(found[0])


def _pressure_at(low: float, gained: float) -> float:
    """Pressure [Pa] up to which ``g`` gains so much [J/kg]."""
    return float(brentq(lambda x: _gained(low, x) - gained, low, 10.0 * low, rtol=1e-15))


def _mean_mass() -> list[Check]:
    """Equal differences of ``g`` and an even velocity: nothing dissipates."""
    low, u, checks = 100 * BAR, 10.0, []
    for words, first in (("with its series", 108 * BAR), ("with its quotient", 150 * BAR)):
        step = _gained(low, first)
        p = [low, first, _pressure_at(low, 2.0 * step), _pressure_at(low, 3.0 * step)]
        parameters = _line(0.0).parameters(HEPTANE, AMBIENT)
        _, rate = cell_rates(parameters, cell_state(parameters, np.array(p), u))
        checks.append(
            _check(
                f"local line, mean mass per length of the flux at a face, {words} [g/m]",
                expected=1e3 * AREA * (first - low) / step,
                computed=-1e3 * float(rate[0]) * LENGTH / CELLS / u,
                tolerance=1e-10,
                source="[Pi]/[g] by quadrature of the specific volume; Tadmor 1987",
            )
        )
    return checks


def _wave_speed() -> list[Check]:
    """A bore that gives way slows the waves of its cell."""
    p, modulus = 60 * BAR, 0.5e9
    parameters = _line(1.0 / modulus).parameters(HEPTANE, AMBIENT)
    speed, _ = cell_rates(parameters, cell_state(parameters, p))
    grown = 1.0 + (p - AMBIENT) / modulus
    slowness = float(HEPTANE.sound_speed(p)) ** -2 + float(HEPTANE.density(p)) / modulus / grown
    return [
        _check(
            "local line with a wall of 0.5 GPa, wave speed of a cell [m/s]",
            expected=1.0 / sqrt(slowness),
            computed=float(speed[0]),
            tolerance=2e-9,
            source="1/a^2 = 1/c^2 + rho A_0/(A K_w)",
        )
    ]
