"""Fluids of the library against published values, and their viscosity under pressure."""

from collections.abc import Iterator
from math import exp, log, pi

import numpy as np
from scipy.integrate import quad

from klack.hydraulics.annulus import Annulus, annulus_step
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.liquid import ATMOSPHERE
from klack.hydraulics.pressure_viscosity import PressureViscosity, mean_viscosity_ratio
from klack.hydraulics.property_table import PropertyTable
from klack.network.step_function import evaluate
from klack.verification.check import Check, check

__all__ = ["checks"]

IAPWS = "IAPWS-95, Wagner and Pruss 2002, at one atmosphere"
STEAM = "IAPWS release on the viscosity of water, 2008, table 4"
HIGH = 2000e5  # [Pa]

_BETWEEN = "cubic splines between the columns of the library, 20 K apart"


def checks() -> list[Check]:
    """Return the checks."""
    return [*_water(), *_alkanes(), *_laws(), *_gap(), *_file(), *_grades()]


def _water() -> Iterator[Check]:
    """At temperatures between the columns of the library."""
    known = (  # degC, density [kg/m^3], sound speed [m/s], vapour pressure [Pa]
        (10.0, 999.702, 1447.3, 1228.2),
        (30.0, 995.649, 1509.1, 4247.0),
        (50.0, 988.035, 1542.6, 12352.0),
        (70.0, 977.765, 1554.8, 31202.0),
        (90.0, 965.309, 1550.5, 70182.0),
    )
    for celsius, density, speed, boiling in known:
        water = library_fluid("water").at(273.15 + celsius)
        at = f"water at {celsius:g} degC"
        yield from [
            check(
                f"{at}, density [kg/m^3]",
                density,
                float(water.density(ATMOSPHERE)),
                5e-5,
                IAPWS,
                reason=_BETWEEN,
            ),
            check(
                f"{at}, sound speed [m/s]",
                speed,
                float(water.sound_speed(ATMOSPHERE)),
                3e-4,
                IAPWS,
                reason=_BETWEEN,
            ),
            check(
                f"{at}, vapour pressure [Pa]",
                boiling,
                water.vapour_pressure,
                2e-4,
                IAPWS,
                reason=_BETWEEN,
            ),
        ]
    water = library_fluid("water").at(298.15)
    yield check(
        "water at 25 degC and 998 kg/m^3, viscosity [Pa s]",
        889.7351e-6,
        float(water.viscosity(2.2e5)),
        5e-4,
        STEAM,
        reason=_BETWEEN,
    )


def _alkanes() -> Iterator[Check]:
    """The same, 1 atm (hot ones 5 bar) and 200 bar."""
    source = {
        "n-heptane": "Span and Wagner 2003; Michailidou et al. 2014 (CoolProp 8.0.0)",
        "n-dodecane": "Lemmon and Huber 2004; Huber et al. 2004 (CoolProp 8.0.0)",
    }
    for name, celsius, pressure, speed, viscosity in _ALKANES:
        fluid = library_fluid(name).at(273.15 + celsius)
        at = f"{name} at {celsius:g} degC"
        where = "1 atm" if pressure == ATMOSPHERE else f"{1e-5 * pressure:g} bar"
        yield from [
            check(
                f"{at}, sound speed at {where} [m/s]",
                speed,
                float(fluid.sound_speed(pressure)),
                1e-3,
                source[name],
                reason="the uncertainty of the equation of state is 0.5 %",
            ),
            check(
                f"{at}, viscosity at 200 bar [Pa s]",
                viscosity,
                float(fluid.viscosity(200e5)),
                2.5e-2,
                source[name],
                reason="one exponential for 5 to 350 bar; uncertainty 2 to 5 %",
            ),
        ]


_ALKANES = (  # degC, Pa, sound speed [m/s] there, viscosity [Pa s] at 200 bar
    ("n-heptane", -30.0, ATMOSPHERE, 1367.84, 0.00097979),
    ("n-heptane", 30.0, ATMOSPHERE, 1107.81, 0.00045286),
    ("n-heptane", 70.0, ATMOSPHERE, 946.00, 0.00031499),
    ("n-heptane", 130.0, 5e5, 713.183, 0.00020467),
    ("n-dodecane", -5.0, ATMOSPHERE, 1407.43, 0.0033358),
    ("n-dodecane", 30.0, ATMOSPHERE, 1260.95, 0.0015752),
    ("n-dodecane", 70.0, ATMOSPHERE, 1110.34, 0.00089033),
    ("n-dodecane", 130.0, ATMOSPHERE, 906.175, 0.00049520),
)


def _laws() -> Iterator[Check]:
    """Laws of Barus and Roelands as their authors wrote them; means over a gap."""
    mu, alpha, rise = 0.04, 18e-9, HIGH - ATMOSPHERE
    barus, roelands = PressureViscosity.barus(alpha), PressureViscosity.roelands(mu, alpha)
    z = alpha * 1.962e8 / (log(mu) + 9.67)
    yield from [
        check(
            "Barus, viscosity at 2000 bar over that at 1 atm [-]",
            exp(alpha * rise),
            float(barus.ratio(HIGH)),
            1e-13,
            "Barus 1893, exp(alpha (p - p_0))",
        ),
        check(
            "Roelands, viscosity at 2000 bar over that at 1 atm [-]",
            exp((log(mu) + 9.67) * (1.0 + rise / 1.962e8) ** z - 9.67) / mu,
            float(roelands.ratio(HIGH)),
            1e-13,
            "Roelands 1966, ln(mu/6.31e-5 Pa s) = ln(mu_0/6.31e-5 Pa s) (1 + p/1.962e8 Pa)^Z",
        ),
    ]
    for drop in (100e5, 1000e5, rise):
        mean = mean_viscosity_ratio(ATMOSPHERE + drop, ATMOSPHERE, *barus.numbers)[0]
        yield check(
            f"Barus, mean in a gap with a drop of {drop / 1e5:.0f} bar [-]",
            float(alpha * drop / -np.expm1(-alpha * drop)),
            mean,
            1e-6,
            "alpha dp/(1 - exp(-alpha dp))",
            reason="Gauss with five points",
        )
    whole = quad(lambda p: 1.0 / float(roelands.ratio(p)), ATMOSPHERE, HIGH, epsrel=1e-12)[0]
    yield check(
        "Roelands, mean in a gap with a drop of 2000 bar [-]",
        rise / whole,
        mean_viscosity_ratio(HIGH, ATMOSPHERE, *roelands.numbers)[0],
        5e-6,
        "int mu_0/mu dp by quadrature",
        reason="Gauss with five points",
    )


def _gap() -> list[Check]:
    """Leakage and drag of a guide with oil at 2000 bar: Reynolds' equation with mu(p)."""
    alpha, p_a, p_b = 18e-9, HIGH, ATMOSPHERE
    oil = FluidChoice(name="ISO VG 46", viscosity_law="barus").at(313.15)
    mu, rho = oil.base_viscosity, 900.0
    gap = Annulus(diameter=4e-3, length=10e-3, clearance=3e-6)
    par = (gap.conductance(mu), 0.5 * pi * 4e-3 * 3e-6, gap.drag(mu))
    numbers = (*par, *PressureViscosity.barus(alpha).numbers)
    inputs = [0.0, 1e-6, p_a, p_b, rho, rho, 0.0, 1e-6, 0.0, 0.0]
    _, moved = evaluate(annulus_step, numbers, [], inputs, 5)
    _, held = evaluate(annulus_step, numbers, [], [*inputs[:7], 0.0, 0.0, 0.0], 5)
    fluidity = (1.0 - exp(-alpha * (p_a - p_b))) / (alpha * mu)
    return [
        check(
            "guide with oil, leakage from 2000 bar [kg/s]",
            rho * pi * 4e-3 * 3e-6**3 / (12.0 * 10e-3) * fluidity,
            float(held[0]),
            1e-6,
            "Reynolds' equation with Barus' law, closed: (1 - exp(-alpha dp))/(alpha mu_0)",
            reason="Gauss with five points",
        ),
        check(
            "guide with oil, drag at 1 m/s and 2000 bar [N]",
            (p_a - p_b) / fluidity * pi * 4e-3 * 10e-3 / 3e-6,
            float(0.5 * (held[3] - moved[3] - held[4] + moved[4])),
            1e-6,
            "int mu dx over the pressure of that equation",
            reason="Gauss with five points",
        ),
    ]


def _file() -> list[Check]:
    """A table of a liquid of Murnaghan with the viscosity of Barus, against both laws."""
    T, p = np.array([293.15, 313.15]), np.array([1.0, 100.0, 300.0, 700.0, 1200.0, 2000.0]) * 1e5
    rise, m = p - p[0], 11.0
    K = np.array([[1.6e9], [1.4e9]]) + m * rise
    table = PropertyTable(
        name="oil.csv",
        temperature=T,
        pressure=p,
        density=np.array([[860.0], [845.0]]) * (K / K[:, :1]) ** (1.0 / m),
        viscosity=np.array([[0.04], [0.02]]) * np.exp(18e-9 * (p - ATMOSPHERE)),
        bulk_modulus=K,
    )
    liquid = table.definition("oil").at(293.15)
    at = 950e5
    middle = 1.6e9 + m * (at - p[0])
    strain = log(float(liquid.liquid.density(2000e5) / liquid.liquid.density(1e5)))
    area = quad(
        lambda x: 1.0 / float(liquid.liquid.bulk_modulus(x)), 1e5, 2000e5, points=list(p[1:-1])
    )[0]
    law, curve = "Murnaghan 1944, K = K_0 + m (p - p_0)", "monotone cubic through six pressures"
    return [
        check(
            "table of a liquid, density at 950 bar between its rows [kg/m^3]",
            860.0 * (middle / 1.6e9) ** (1.0 / m),
            float(liquid.density(at)),
            1e-4,
            law,
            reason=curve,
        ),
        check(
            "table of a liquid, bulk modulus at 950 bar between its rows [Pa]",
            middle,
            float(liquid.bulk_modulus(at)),
            1e-2,
            law,
            reason=curve,
        ),
        check(
            "table of a liquid, ln of its densities from 1 to 2000 bar [-]",
            area,
            strain,
            5e-14,
            "int dp/K by quadrature",
        ),
        check(
            "table of a liquid, viscosity at 950 bar [Pa s]",
            0.04 * exp(18e-9 * (at - ATMOSPHERE)),
            float(liquid.viscosity(at)),
            5e-14,
            "Barus 1893",
        ),
        check(
            "table of a liquid, c^2 rho/K at 950 bar [-]",
            1.0,
            float(liquid.sound_speed(at) ** 2 * liquid.density(at) / liquid.bulk_modulus(at)),
            1e-14,
            "Newton and Laplace, c^2 = K/rho",
        ),
    ]


def _grades() -> list[Check]:
    """Oils and fuels at the values that their standards state."""
    glycol, atf = library_fluid("water-glycol").at(313.15), library_fluid("ATF").at(373.15)
    nu = [float(f.viscosity(ATMOSPHERE) / f.liquid.density(ATMOSPHERE)) for f in (glycol, atf)]
    return [
        check(
            "water-glycol, kinematic viscosity at 40 degC [m^2/s]",
            46e-6,
            nu[0],
            0.1,
            "ISO 3448, VG 46",
            reason="the band of the grade is 10 %",
        ),
        check("ATF, kinematic viscosity at 100 degC [m^2/s]", 6.0e-6, nu[1], 2e-3, "DEXRON-VI"),
        check(
            "petrol, vapour pressure at 37.8 degC [Pa]",
            52.5e3,
            library_fluid("petrol").at(310.95).vapour_pressure,
            7.5 / 52.5,
            "EN 228, class A, 45 to 60 kPa",
            reason="the band of the standard",
        ),
    ]
