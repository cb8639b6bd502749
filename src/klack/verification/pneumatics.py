"""Gas: closed solutions of ISO 6358 and of gas dynamics, and networks integrated apart."""

from functools import partial
from math import asin, exp, log, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from klack.network.gas_rows import GasBranchRow, GasChamberRow, GasRows, GasSourceRow
from klack.network.rows import Ambient
from klack.network.step_function import evaluate
from klack.pneumatics.conductance import factor_of_area, factor_of_conductance
from klack.pneumatics.flow_law import VALVE, gap_flow, restriction_flow
from klack.pneumatics.gas import Gas, critical_ratio, nozzle_factor
from klack.pneumatics.gas_element import GasNetwork
from klack.pneumatics.gas_gap import GasGap
from klack.pneumatics.gas_library import AIR, HYDROGEN, METHANE
from klack.pneumatics.gas_step import ISOTHERMAL, OF_CHAMBER, gas_step
from klack.pneumatics.gas_valve import mantle_area
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.gas_networks import gas_networks

__all__ = ["checks"]

GROUP = "pneumatics"
AMBIENT = Ambient()
BAR, T0, LITRE = 1e5, 293.15, 1e-3
C = 2e-8  # [m^3/(s Pa)]: 2 l/(s bar)
FACTOR = factor_of_conductance(AIR) * C
WIDE = "the step of 0.51 is almost of second order: what is left falls with the step"
_LAW = "ISO 6358-1:2013: C rho_0 p_1 sqrt(T_0/T_1) [1 - ((r - b)/(1 - b))^2]^m"

_check = partial(compare, GROUP)


def checks() -> list[Check]:
    """Flow laws, vessels with closed solutions, then networks."""
    return [*_nozzles(), *_laws(), *_vessels(), *_mixing(), *gas_networks()]


def _nozzles() -> list[Check]:
    known = ((1.4, 0.5283, 0.6847), (5.0 / 3.0, 0.4871, 0.7262), (1.3, 0.5457, 0.6673))
    source = "Shapiro, Compressible Fluid Flow 1953, tables of isentropic flow"
    digits = "four digits of a printed table"
    found = []
    for kappa, ratio, factor in known:
        found += [
            _check(
                f"critical pressure ratio of an ideal nozzle, kappa = {kappa:.4g} [-]",
                ratio,
                critical_ratio(kappa),
                1e-4,
                source,
                reason=digits,
            ),
            _check(
                f"choked flow factor of an ideal nozzle, kappa = {kappa:.4g} [-]",
                factor,
                nozzle_factor(kappa),
                1e-4,
                source,
                reason=digits,
            ),
        ]
    ratio = sqrt(HYDROGEN.gas_constant / AIR.gas_constant) * nozzle_factor(AIR.kappa)
    air_over_hydrogen = factor_of_area(AIR) / factor_of_area(HYDROGEN)
    return [
        *found,
        _check(
            "mass flow of air over that of hydrogen through one choked hole [-]",
            ratio / nozzle_factor(HYDROGEN.kappa),
            air_over_hydrogen,
            1e-14,
            "A p Psi/sqrt(R T)",
        ),
        _check(
            "specific gas constant of methane [J/(kg K)]",
            518.27,
            METHANE.gas_constant,
            1e-5,
            "NIST Chemistry WebBook: molar mass 16.0425 g/mol",
            reason="five digits of the molar mass",
        ),
    ]


def _laws() -> list[Check]:
    flow = partial(restriction_flow, factor=FACTOR, b=0.3, m=0.5, crack=0.0)
    whole = 14e-3 * AIR.reference_density  # 2 l/(s bar) times 7 bar, at the reference state
    ratios = np.linspace(0.0, 1.0, 201)
    u = np.clip((ratios - 0.3) / 0.7, 0.0, 1.0)
    curve = ComparedCurve(
        x_label="pressure ratio [-]",
        y_label="flow over choked flow [-]",
        expected=(ratios, np.sqrt(1.0 - u**2)),
        computed=(ratios, np.array([flow(7e5, 7e5 * r, T0)[0] for r in ratios]) / whole),
    )
    p1, p2, T1 = 6e5, 4.2e5, 350.0
    steps = {
        "pressure before [kg/(s Pa)]": (6.0, 0.0, 0.0),
        "pressure behind [kg/(s Pa)]": (0.0, 6.0, 0.0),
        "temperature [kg/(s K)]": (0.0, 0.0, 3e-3),
    }
    slopes = dict(zip(steps, flow(p1, p2, T1)[1:], strict=True))
    cracked = partial(restriction_flow, factor=FACTOR, b=0.3, m=0.6, crack=0.5e5)
    end = 1.0 - 0.5 / 6.0
    gap = GasGap(diameter=4e-3, length=6e-3, clearance=10e-6, eccentricity=1.0)
    slot = 2.5 * pi * gap.diameter * gap.clearance**3 / (12.0 * AIR.viscosity * gap.length)
    density, _ = quad(lambda p: p / (AIR.gas_constant * T0), 1e5, 7e5, epsrel=1e-13)
    factor = slot / (2.0 * AIR.gas_constant)
    r = 1.0 - 0.25e-3
    edge = 1.0 - ((1.0 - 1e-3 - 0.3) / 0.7) ** 2
    lift, d, half = 0.2e-3, 1.6e-3, pi / 6
    frustum = pi * lift * sin(half) * (d - lift * sin(half) * sqrt(0.75))
    return [
        _check(
            "choked flow at 7 bar, C = 2 l/(s bar) [kg/s]",
            whole,
            flow(7e5, 1e5, T0)[0],
            1e-14,
            "definition of C: 14 l/s at 100 kPa and 20 degC",
            curve,
        ),
        _check(
            "flow at r = 0.65, b = 0.3 [kg/s]",
            whole * sqrt(0.75),
            flow(7e5, 0.65 * 7e5, T0)[0],
            1e-14,
            _LAW,
            curve,
        ),
        _check(
            "flow from 373.15 K over that from 293.15 K [-]",
            sqrt(T0 / 373.15),
            flow(7e5, 1e5, 373.15)[0] / flow(7e5, 1e5, T0)[0],
            1e-14,
            "sqrt(T_0/T_1)",
        ),
        _check(
            "flow at r = 0.7 with m = 0.6 and a cracking pressure of 0.5 bar [kg/s]",
            FACTOR * p1 / sqrt(T1) * (1.0 - ((0.7 - 0.3) / (end - 0.3)) ** 2) ** 0.6,
            cracked(p1, p2, T1)[0],
            1e-14,
            "ISO 6358-1:2013, with r_c = 1 - dp_c/p_1",
        ),
        _check(
            "flow below the cracking pressure [kg/s]",
            0.0,
            cracked(p1, p1 - 0.49e5, T1)[0],
            0.0,
            "closed",
        ),
        _check(
            "b = 1: choked down to the laminar end, r = 0.99 over r = 0 [-]",
            1.0,
            restriction_flow(7e5, 0.99 * 7e5, T0, FACTOR, 1.0, 0.5, 0.0)[0] / whole,
            1e-14,
            _LAW,
        ),
        _check(
            "b = 0: flow at r = 0.6 [kg/s]",
            0.8 * whole,
            restriction_flow(7e5, 0.6 * 7e5, T0, FACTOR, 0.0, 0.5, 0.0)[0],
            1e-14,
            "3-4-5",
        ),
        _check(
            "laminar end, flow at r = 1 - 0.25e-3 [kg/s]",
            0.25 * whole * sqrt(edge),
            flow(7e5, r * 7e5, T0)[0],
            1e-11,
            "straight line from r = 0.999 to none",
            reason="1 - r has lost four digits",
        ),
        *(
            _check(
                f"slope of the flow with the {name}",
                (flow(p1 + dp, p2 + dq, T1 + dT)[0] - flow(p1 - dp, p2 - dq, T1 - dT)[0])
                / (2.0 * (dp + dq + dT)),
                slopes[name],
                5e-9,
                "central difference",
            )
            for name, (dp, dq, dT) in steps.items()
        ),
        _check(
            "leakage through an eccentric gap, 7 bar to 1 bar [kg/s]",
            slot * density,
            gap_flow(7e5, 1e5, T0, factor)[0],
            5e-14,
            "plane Poiseuille flow with density p/(R T), by quadrature; Hamrock 1994",
        ),
        _check(
            "mantle of a cone of 30 deg at a lift of 0.2 mm [m^2]",
            frustum,
            float(mantle_area(np.array([lift]), d, half)[0]),
            1e-13,
            "frustum: pi h (d - h cos a)",
        ),
    ]


def vessel(
    pressure: float,
    *,
    source: float,
    heat: float = 0.0,
    volume: float = LITRE,
    factor: float = FACTOR,
    b: float = 0.3,
    gas: Gas = AIR,
) -> GasNetwork:
    """A vessel that is filled from a source, or emptied into it, through one restriction."""
    rows = GasRows()
    rows.chambers[2] = GasChamberRow(
        component="vessel", volume=volume, pressure=pressure, temperature=T0, heat=heat, wall=T0
    )
    rows.sources[1] = GasSourceRow(
        component="source", time=(0.0,), pressure=(source,), temperature=T0
    )
    law = (VALVE, factor, b, 0.5, 0.0, 0.0)
    rows.branches.append(GasBranchRow(component="hole", a=1, b=2, law=law))
    return GasNetwork(rows, gas, AMBIENT)


def march(net: GasNetwork, duration: float, steps: int) -> NDArray[np.float64]:
    """States of all chambers after each step, shape (steps + 1, chambers, 5)."""
    par, size, n = net.parameters(), net.states(), len(net.rows.chambers)
    state, h = net.start(np.zeros(0)), duration / steps
    found = [state[: OF_CHAMBER * n]]
    for k in range(steps):
        status, out = evaluate(gas_step, par, state, [k * h, h], size + 3)
        if status != 0:
            raise ArithmeticError(f"gas_step: status {status}")
        state = out[:size]
        found.append(state[: OF_CHAMBER * n])
    return np.array(found).reshape(steps + 1, n, OF_CHAMBER)


def _vessels() -> list[Check]:
    """Charge and discharge of one litre through C = 2 l/(s bar), b = 0.3."""
    R, kappa = AIR.gas_constant, AIR.kappa
    tau = LITRE / (FACTOR * R * sqrt(T0))  # = V/(C p_0) at T_0
    steps = 2000
    t = tau
    time = np.linspace(0.0, t, steps + 1)
    out = march(vessel(10e5, source=1e5, heat=ISOTHERMAL), t, steps)[:, 0]
    emptied = ComparedCurve(
        x_label="time [s]",
        y_label="pressure [bar]",
        expected=(time, 10.0 * np.exp(-time / tau)),
        computed=(time, out[:, 2] / BAR),
    )
    cold = march(vessel(10e5, source=0.2e5), t, steps)[:, 0]
    x = 1.0 + 0.5 * (kappa - 1.0) * t / tau
    into = march(vessel(1.0, source=7e5, heat=ISOTHERMAL), 0.25 * tau, steps)[:, 0]
    start, end = 0.4, 0.95
    subsonic = 0.7 * (asin((end - 0.3) / 0.7) - asin((start - 0.3) / 0.7)) * tau
    late = march(vessel(start * 7e5, source=7e5, heat=ISOTHERMAL), subsonic, steps)[:, 0]
    warm = march(vessel(1.0, source=7e5), 0.2 * tau, steps)[:, 0]
    closed = "Beater, Pneumatic Drives 2007, ch. 4; ISO 6358-2:2013: "
    return [
        _check(
            "time constant V/(C p_0) of a litre [s]", 0.5, tau, 1e-14, "1 l, 2 l/(s bar), 1 bar"
        ),
        _check(
            "isothermal discharge of 10 bar, choked, after tau [Pa]",
            10e5 * exp(-1.0),
            float(out[-1, 2]),
            3e-5,
            closed + "p = p_0 exp(-t/tau)",
            emptied,
            reason=WIDE,
        ),
        _check(
            "adiabatic discharge of 10 bar, choked, mass over that at the start [-]",
            x ** (-2.0 / (kappa - 1.0)),
            float(cold[-1, 0] / cold[0, 0]),
            3e-5,
            closed + "(1 + (k - 1) t/(2 tau))^(-2/(k - 1))",
            reason=WIDE,
        ),
        _check(
            "its temperature [K]",
            T0 / x**2,
            float(cold[-1, 3]),
            3e-5,
            closed + "isentropic, T_0/(1 + (k - 1) t/(2 tau))^2",
            reason=WIDE,
        ),
        _check(
            "isothermal charge from vacuum, choked, after 0.25 tau [Pa]",
            1.0 + 0.25 * 7e5,
            float(into[-1, 2]),
            5e-13,
            closed + "p = p_s t/tau",
        ),
        _check(
            "isothermal charge from 0.4 to 0.95 of the supply, subsonic [Pa]",
            end * 7e5,
            float(late[-1, 2]),
            1e-5,
            closed + "r = b + (1 - b) sin(t/((1 - b) tau) + asin((r_0 - b)/(1 - b)))",
            reason=WIDE,
        ),
        _check(
            "adiabatic charge of a vacuum, temperature over that of the supply [-]",
            kappa,
            float(warm[-1, 3]) / T0,
            1e-5,
            "first law: c_v T = c_p T_s",
            reason="1 Pa at the start",
        ),
        _check(
            "adiabatic charge, choked, rise of the pressure in 0.2 tau [Pa]",
            kappa * 0.2 * 7e5,
            float(warm[-1, 2] - 1.0),
            1e-12,
            "dp/dt = k R T_s m_dot/V",
        ),
    ]


def _mixing() -> list[Check]:
    """Two vessels, one hole: what is left in the end follows from mass and energy alone."""
    rows = GasRows()
    for i, (p, V) in enumerate(((8e5, 1e-3), (2e5, 2e-3))):
        rows.chambers[i + 2] = GasChamberRow(
            component=f"v{i}", volume=V, pressure=p, temperature=T0, heat=0.0, wall=T0
        )
    law = (VALVE, FACTOR, 0.3, 0.5, 0.0, 0.0)
    rows.branches.append(GasBranchRow(component="hole", a=2, b=3, law=law))
    states = march(GasNetwork(rows, AIR, AMBIENT), 5.0, 2000)
    mass = states[:, :, 0].sum(axis=1)
    cooled = T0 * (4e5 / 8e5) ** ((AIR.kappa - 1.0) / AIR.kappa)
    # choked, then subsonic between equal holes: 1/3 of the supply before a hole three times as wide
    chain = GasRows()
    chain.chambers[2] = GasChamberRow(
        component="middle", volume=1e-6, pressure=None, temperature=T0, heat=0.0, wall=T0
    )
    chain.sources[1] = GasSourceRow(component="s", time=(0.0,), pressure=(9e5,), temperature=T0)
    chain.sources[0] = GasSourceRow(component="out", time=(0.0,), pressure=(1e5,), temperature=T0)
    wide = (VALVE, 3.0 * FACTOR, 0.4, 0.5, 0.0, 0.0)
    narrow = (VALVE, FACTOR, 0.4, 0.5, 0.0, 0.0)
    chain.branches.append(GasBranchRow(component="in", a=1, b=2, law=narrow))
    chain.branches.append(GasBranchRow(component="out", a=2, b=0, law=wide))
    steady = GasNetwork(chain, AIR, AMBIENT).start(np.zeros(0))
    return [
        _check(
            "two adiabatic vessels after exchange: pressure [Pa]",
            4e5,
            float(states[-1, 0, 2]),
            5e-14,
            "energy: (p_1 V_1 + p_2 V_2)/(V_1 + V_2)",
        ),
        _check(
            "mass in both, relative change over 2000 steps",
            0.0,
            float(np.abs(mass / mass[0] - 1.0).max()),
            1e-14,
            "closed system",
        ),
        _check(
            "temperature of the vessel that was emptied [K]",
            cooled,
            float(states[-1, 0, 3]),
            3e-5,
            "what stays behind expands isentropically, T (p/p_0)^((k - 1)/k)",
            reason=WIDE,
        ),
        _check(
            "pressure between two choked holes at the start [Pa]",
            3e5,
            float(steady[2]),
            5e-14,
            "series of choked restrictions: C_1 p_1 = C_2 p_2",
        ),
        _check(
            "log of the pressure ratio over that of the temperatures, emptied vessel [-]",
            AIR.kappa / (AIR.kappa - 1.0),
            log(float(states[-1, 0, 2]) / 8e5) / log(float(states[-1, 0, 3]) / T0),
            2e-4,
            "isentropic exponent",
            reason=WIDE,
        ),
    ]
