"""Fluids: reference equations, mixtures with gas and vapour, and their table."""

from collections.abc import Iterator
from itertools import pairwise
from math import exp, log

import numpy as np
from scipy.integrate import quad

from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import EntrainedGas, Vapour
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["checks"]

ATMOSPHERE = 101_325.0
IAPWS = "IAPWS-95 and IAPWS 2008 at 25 degC and 1 atm, between the columns of the library"
NSRDS = "NSRDS functions (Daubert and Danner; coefficients as in OpenFOAM), 30 degC"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_water(),
        *_heptane(),
        *_oils(),
        *_bubbles(),
        *_boiling(),
        *_conservation(),
        *_table(),
    ]


def _water() -> list[Check]:
    water = library_fluid("water").at(298.15)
    return [
        check("water, density [kg/m^3]", 997.047, float(water.density(ATMOSPHERE)), 1e-4, IAPWS),
        check(
            "water, sound speed [m/s]", 1496.7, float(water.sound_speed(ATMOSPHERE)), 5e-5, IAPWS
        ),
        check("water, viscosity [Pa s]", 8.90e-4, float(water.viscosity(ATMOSPHERE)), 2e-3, IAPWS),
        check("water, vapour pressure [Pa]", 3169.9, water.vapour_pressure, 1e-3, IAPWS),
    ]


def _heptane() -> list[Check]:
    """Against functions that share no data with the library; they differ by up to 2 %."""
    T = 303.15
    heptane = library_fluid("n-heptane").at(T)
    return [
        check(
            "n-heptane, density [kg/m^3]",
            61.38396836 / 0.26211 ** (1.0 + (1.0 - T / 540.2) ** 0.28141),
            float(heptane.density(ATMOSPHERE)),
            5e-3,
            NSRDS,
        ),
        check(
            "n-heptane, viscosity [Pa s]",
            exp(-24.451 + 1533.1 / T + 2.0087 * log(T)),
            float(heptane.viscosity(ATMOSPHERE)),
            2.5e-2,
            NSRDS,
        ),
        check(
            "n-heptane, vapour pressure [Pa]",
            exp(87.829 - 6996.4 / T - 9.8802 * log(T) + 7.2099e-6 * T**2),
            heptane.vapour_pressure,
            1e-2,
            NSRDS,
        ),
        check(
            "n-heptane, sound speed at 350 bar and 20 degC [m/s]",
            1360.70,
            float(library_fluid("n-heptane").at(293.15).sound_speed(350e5)),
            1e-2,
            "Span and Wagner 2003 (CoolProp 8.0.0); one bulk modulus line from 5 to 350 bar",
        ),
    ]


def _oils() -> list[Check]:
    oil = library_fluid("generic mineral oil").at(313.15)
    source = "OpenHydraulics GenericOil, 40 degC"
    brake = library_fluid("DOT 4").at(233.15)
    vg46 = library_fluid("ISO VG 46").at(313.15)
    test = library_fluid("ISO 4113").at(313.15)
    nu = [float(f.viscosity(ATMOSPHERE) / f.density(ATMOSPHERE)) for f in (brake, vg46, test)]
    return [
        check(
            "mineral oil, density at 100 bar [kg/m^3]",
            849.970,
            float(oil.density(1e7)),
            1e-6,
            source,
        ),
        check(
            "mineral oil, bulk modulus at 100 bar [Pa]",
            1.4747e9,
            float(oil.bulk_modulus(1e7)),
            5e-5,
            source,
        ),
        check(
            "mineral oil, kinematic viscosity [m^2/s]",
            4.1343e-5,
            float(oil.viscosity(ATMOSPHERE) / oil.density(ATMOSPHERE)),
            2e-5,
            source,
        ),
        check("DOT 4, viscosity at -40 degC [m^2/s]", 1.2e-3, nu[0], 5e-3, "data sheet"),
        check("ISO VG 46, viscosity at 40 degC [m^2/s]", 46e-6, nu[1], 2e-3, "ISO 3448"),
        check(
            "ISO 4113, viscosity at 40 degC [m^2/s]",
            2.6e-6,
            nu[2],
            0.15e-6 / 2.6e-6,
            "ISO 4113:2010, 2.45 to 2.75 mm^2/s",
            reason="the band of the standard",
        ),
    ]


def _bubbly(fraction: float) -> Fluid:
    return Fluid(
        name="bubbly oil",
        temperature=293.15,
        liquid=Murnaghan(
            density_at_reference=820.0,
            bulk_modulus_at_reference=1.4e9,
            slope=10.0,
            reference_pressure=1e5,
        ),
        base_viscosity=3e-3,
        vapour=Vapour(pressure=1e3, density=0.08, half_width=500.0),
        gas=EntrainedGas(fraction=fraction, exponent=1.4, reference_pressure=1e5),
    )


def _wood(fraction: float, p: np.ndarray) -> np.ndarray:
    """Wood's law by the volumes of both phases [m/s]."""
    n, above = 1.4, p - 1e5
    K_l = 1.4e9 + 10.0 * above
    gas = fraction * (p / 1e5) ** (-1.0 / n)
    liquid = (1.0 - fraction) * (1.0 + 10.0 * above / 1.4e9) ** -0.1
    share = gas / (gas + liquid)
    K = 1.0 / (share / (n * p) + (1.0 - share) / K_l)
    rho = ((1.0 - fraction) * 820.0 + fraction * 1.204 * 1e5 / ATMOSPHERE) / (gas + liquid)
    return np.asarray(np.sqrt(K / rho))


def _bubbles() -> Iterator[Check]:
    p = 6e5
    pressures = np.geomspace(1e5, 300e5, 150)
    for fraction in (0.0, 1e-4, 1e-3, 1e-2):
        curve = ComparedCurve(
            x_label="pressure [bar]",
            y_label="sound speed [m/s]",
            expected=(pressures / 1e5, _wood(fraction, pressures)),
            computed=(pressures / 1e5, np.asarray(_bubbly(fraction).sound_speed(pressures))),
            x_log=True,
        )
        yield check(
            f"sound speed of oil with {100 * fraction:g} % air at 6 bar [m/s]",
            float(_wood(fraction, np.array(p))),
            float(_bubbly(fraction).sound_speed(p)),
            5e-14,
            "Wood, A Textbook of Sound, 1930",
            curve if fraction > 0.0 else None,
        )
        if fraction == 1e-3:
            yield check(
                "bulk modulus of oil with 0.1 % air at 6 bar [Pa]",
                9.59e8,
                float(_bubbly(fraction).bulk_modulus(p)),
                5e-4,
                "polytropic gas and Murnaghan's liquid by hand, three digits",
            )


def _boiling() -> list[Check]:
    heptane = library_fluid("n-heptane").at(293.15)
    p_v = heptane.vapour_pressure
    ideal = 0.100202 / (8.314462618 * 293.15)
    return [
        check(
            "n-heptane, half liquid and half vapour at the vapour pressure [kg/m^3]",
            0.5 * (float(heptane.liquid.density(p_v)) + ideal * p_v),
            float(heptane.density(p_v)),
            5e-14,
            "homogeneous equilibrium, middle of the band",
        ),
        check(
            "n-heptane vapour at 100 Pa [kg/m^3]",
            ideal * 100.0,
            float(heptane.density(100.0)),
            5e-14,
            "ideal gas, p M/(R T)",
        ),
    ]


def _conservation() -> list[Check]:
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=1e-3)
    places = [1.0, 10.0, 100.0, 1e3, *fluid.kinks, 1e4, 1e5, 1e6, 350e5]
    strain = sum(
        quad(
            lambda x: exp(x) / float(fluid.bulk_modulus(exp(x))),
            log(a),
            log(b),
            epsabs=1e-13,
            epsrel=1e-11,
            limit=200,
        )[0]
        for a, b in pairwise(places)
    )
    return [
        check(
            "mass of a volume expanded from 350 bar to 1 Pa, ln of the densities [-]",
            log(float(fluid.density(350e5)) / float(fluid.density(1.0))),
            strain,
            5e-14,
            "int dp/K by quadrature",
        ),
        check(
            "steps from 1 Pa to 3000 bar in which the density does not rise [-]",
            0.0,
            float(np.count_nonzero(np.diff(fluid.density(np.geomspace(1.0, 3e8, 200_001))) <= 0.0)),
            0.0,
            "stability; 200 000 steps",
        ),
    ]


def _table() -> list[Check]:
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=1e-3)
    table = fluid_table(fluid, ATMOSPHERE)
    p = np.geomspace(1.0, 3e8, 30_011)
    rho, slope = np.array([fluid_at(table, x, 0)[:2] for x in p]).T
    v, tangent = fluid.specific_volume(p)
    few = slice(None, None, 30)
    worst = 0.0
    places = [100.0, 1e3, *fluid.kinks, 2e4, ATMOSPHERE, 6e5, 1e7, 3e8]
    for a, b in pairwise(places):
        exact = quad(lambda x: float(fluid.specific_volume(x)[0]), a, b, epsrel=1e-12, limit=500)[0]
        ours = fluid_at(table, b, 0)[2] - fluid_at(table, a, 0)[2]
        worst = max(worst, abs(ours / exact - 1.0))
    return [
        check(
            "table: largest relative error of the density [-]",
            0.0,
            float(np.max(np.abs(rho * v - 1.0))),
            1e-9,
            "the fluid itself, 1 Pa to 3000 bar",
            ComparedCurve(
                x_label="pressure [Pa]",
                y_label="density [kg/m^3]",
                expected=(p[few], 1.0 / v[few]),
                computed=(p[few], rho[few]),
                x_log=True,
                y_log=True,
            ),
        ),
        check(
            "table: largest relative error of the compressibility [-]",
            0.0,
            float(np.max(np.abs(slope * rho**-2 / -tangent - 1.0))),
            1e-5,
            "the fluid itself, 1 Pa to 3000 bar",
        ),
        check(
            "table: largest relative error of the pressure energy [-]",
            0.0,
            worst,
            1e-10,
            "int dp/rho by quadrature, 100 Pa to 3000 bar",
        ),
        check(
            "table: least loss of an implicit step over its energy [-]",
            0.0,
            min(0.0, _least_loss(table)),
            1e-14,
            "convexity of the energy of a chamber: no implicit step can gain any",
        ),
    ]


def _least_loss(table: np.ndarray) -> float:
    """Smallest ``g1 (m1 - m0) - (p1 - p_a)(V1 - V0) - (E1 - E0)`` over the terms it is made of."""
    random = np.random.default_rng(1)
    p0 = 10.0 ** random.uniform(0.0, 8.0, 20_000)
    p1 = p0 * np.exp(random.normal(0.0, 10.0 ** random.uniform(-6.0, 0.5, p0.size)))
    V0, V1 = 1e-8 * np.exp(random.normal(0.0, 0.3, (2, p0.size)))
    least = 0.0
    for a, b, Va, Vb in zip(p0, p1, V0, V1, strict=True):
        rho_a, _, g_a, _ = fluid_at(table, a, 0)
        rho_b, _, g_b, _ = fluid_at(table, b, 0)
        ma, mb = rho_a * Va, rho_b * Vb
        stored_a, stored_b = ma * g_a, mb * g_b
        squeezed_a, squeezed_b = (a - ATMOSPHERE) * Va, (b - ATMOSPHERE) * Vb
        work = g_b * (mb - ma) - (b - ATMOSPHERE) * (Vb - Va)
        loss = work - (stored_b - squeezed_b) + (stored_a - squeezed_a)
        size = abs(stored_a) + abs(stored_b) + abs(squeezed_a) + abs(squeezed_b)
        least = min(least, loss / (size + abs(g_b) * (ma + mb)))
    return least
