"""Gas: closed solutions of ISO 6358 and gas dynamics, and networks by SciPy."""

from collections.abc import Callable, Iterator
from functools import partial
from math import asin, exp, log, pi, sin, sqrt

import numpy as np
from scipy.integrate import quad, solve_ivp

from klack.hydraulics.gas.flow_law import VALVE, gap_flow, restriction_flow
from klack.hydraulics.gas.gas import Gas, critical_ratio, nozzle_factor
from klack.hydraulics.gas.gas_element import GasNetwork
from klack.hydraulics.gas.gas_gap import GasGap
from klack.hydraulics.gas.gas_library import AIR, HYDROGEN, METHANE
from klack.hydraulics.gas.gas_step import ISOTHERMAL, OF_CHAMBER, gas_step
from klack.hydraulics.gas.gas_valve import mantle_area
from klack.hydraulics.gas.restriction import factor_of_area, factor_of_conductance
from klack.network.gas_rows import GasBranchRow, GasChamberRow, GasRows, GasSourceRow
from klack.network.step_function import evaluate
from klack.verification.benches import AMBIENT, component, last, run_network
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["checks"]


R, K = AIR.gas_constant, AIR.kappa
CV, CP = R / (K - 1.0), K * R / (K - 1.0)
P0, T0 = 101_325.0, 293.15
FACE, SMALL = 50e-6, 30e-6  # [m^2]
RATIO = (2.0 / (K + 1.0)) ** (K / (K - 1.0))
NOZZLE = sqrt(K / R) * (2.0 / (K + 1.0)) ** ((K + 1.0) / (2.0 * (K - 1.0)))
REFERENCE = 1e5 / (R * 293.15) * sqrt(293.15)
SOURCE = "the same equations coded independently, integrated by SciPy DOP853, rtol 1e-11"
WIDE = "steps of 1.28 us"


def _flow(
    pa: float, pb: float, Ta: float, Tb: float, factor: float, b: float, m: float
) -> tuple[float, float]:
    """Mass flow from a to b, and the enthalpy that it takes along."""
    if pa < pb:
        flow, enthalpy = _flow(pb, pa, Tb, Ta, factor, b, m)
        return -flow, -enthalpy
    r, share = pb / pa, 1.0
    if r > 1.0 - 1e-3:
        share = (1.0 - ((1.0 - 1e-3 - b) / (1.0 - b)) ** 2) ** m * (1.0 - r) / 1e-3
    elif r > b:
        share = (1.0 - ((r - b) / (1.0 - b)) ** 2) ** m
    flow = factor * pa * share / sqrt(Ta)
    return flow, flow * CP * Ta


def _integrated(
    f: Callable[[float, np.ndarray], list[float]], x0: list[float], end: float
) -> np.ndarray:
    scale = np.array([1e-6, 1e-2, *[1e-8, 100.0] * ((len(x0) - 2) // 2)])
    found = solve_ivp(f, (0.0, end), x0, method="DOP853", rtol=1e-11, atol=1e-10 * scale)
    return np.asarray(found.y[:, -1])


def _piston() -> list[Check]:
    hole, out, heat = 0.8 * pi / 4.0 * 1e-6, 0.9 * 0.2e-6, 0.05
    result = run_network(
        {
            "piston": component("rigid-mass", mass=10e-3),
            "spring": component("spring", stiffness=4e4, preload=0.0, damping=2.0),
            "low": component("gas-chamber", volume=2e-8, pressure=P0, heat_conductance=heat),
            "top": component("gas-chamber", volume=8e-8, pressure=P0),
            "supply": component("gas-source", pressure=6e5),
            "inlet": component("gas-orifice", diameter=1e-3),
            "between": component(
                "gas-orifice", conductance=2e-9, critical_ratio=0.3, subsonic_index=0.48
            ),
            "outlet": component("gas-orifice", area=0.2e-6, discharge=0.9),
            "up": component("gas-face", direction="opening", area=FACE),
            "down": component("gas-face", direction="closing", area=SMALL),
        },
        [
            ["piston.body", "spring.end", "up.body", "down.body"],
            ["supply.gas", "inlet.a"],
            ["inlet.b", "low.gas", "between.a", "up.gas"],
            ["between.b", "top.gas", "down.gas", "outlet.a"],
            ["outlet.b", "ambient"],
        ],
        gas=AIR,
        duration=2e-3,
        coarse=None,
        record=1.28e-6,
        start="rest",
    )

    def f(t: float, x: np.ndarray) -> list[float]:
        y, v, m1, T1, m2, T2 = (float(value) for value in x)
        p1, p2 = m1 * R * T1 / (2e-8 + FACE * y), m2 * R * T2 / (8e-8 - SMALL * y)
        a, ha = _flow(6e5, p1, T0, T1, NOZZLE * hole, RATIO, 0.5)
        b, hb = _flow(p1, p2, T1, T2, REFERENCE * 2e-9, 0.3, 0.48)
        c, hc = _flow(p2, P0, T2, T0, NOZZLE * out, RATIO, 0.5)
        dU1 = ha - hb - p1 * FACE * v + heat * (T0 - T1)
        dU2 = hb - hc + p2 * SMALL * v
        force = (p1 - P0) * FACE - (p2 - P0) * SMALL - 4e4 * y - 2.0 * v
        dT1, dT2 = (dU1 - CV * T1 * (a - b)) / (m1 * CV), (dU2 - CV * T2 * (b - c)) / (m2 * CV)
        return [v, force / 10e-3, a - b, dT1, b - c, dT2]

    known = _integrated(
        f, [0.0, 0.0, P0 * 2e-8 / (R * T0), T0, P0 * 8e-8 / (R * T0), T0], float(result.time[-1])
    )
    channels = ("piston.body displacement", "low mass", "low temperature", "top temperature")
    found = [last(result, channel) for channel in channels]
    inside = "piston between two chambers, 2 ms after 6 bar: {}"
    names = (
        "displacement [m]",
        "mass in the lower chamber [kg]",
        "its temperature [K]",
        "temperature in the upper one [K]",
    )
    expected = (known[0], known[2], known[3], known[5])
    return [
        *(
            check(inside.format(name), float(e), c, 2e-5, SOURCE, reason=WIDE)
            for name, e, c in zip(names, expected, found, strict=True)
        ),
        check(
            inside.format("pressure in the lower chamber [Pa]"),
            float(known[2] * R * known[3] / (2e-8 + FACE * known[0])),
            last(result, "low pressure"),
            2e-5,
            SOURCE,
            reason=WIDE,
        ),
        check(
            inside.format("energy residual, relative"),
            0.0,
            result.books.relative_residual,
            1e-12,
            "first law, enthalpy flows and heat included",
            reason="round-off of a whole run",
        ),
    ]


def _gas_spring() -> Iterator[Check]:
    """A mass on enclosed gas: adiabatic, and as warm as its wall."""
    for word, isothermal in (("adiabatic", False), ("isothermal", True)):
        mass, volume = 10e-3, 1e-7
        result = run_network(
            {
                "piston": component("rigid-mass", mass=mass, speed=2e-3),
                "gas": component("gas-chamber", volume=volume, pressure=P0, isothermal=isothermal),
                "face": component("gas-face", direction="opening", area=FACE),
            },
            [["piston.body", "face.body"], ["gas.gas", "face.gas"]],
            gas=AIR,
            duration=20e-3,
            coarse=None,
            record=2.56e-6,
        )
        y = result.channels["piston.body displacement"].values
        falls = np.flatnonzero((y[:-1] > 0.0) & (y[1:] <= 0.0))
        at = result.time[falls] + (result.time[1] - result.time[0]) * y[falls] / (
            y[falls] - y[falls + 1]
        )
        kappa = 1.0 if isothermal else K
        yield check(
            f"mass on enclosed gas, {word}: angular frequency [1/s]",
            sqrt(kappa * P0 * FACE**2 / (volume * mass)),
            2.0 * pi * (len(at) - 1) / float(at[-1] - at[0]),
            2e-5,
            "gas spring: n p A^2/V",
            reason="amplitude of 0.2 % of the volume",
        )


def _closing() -> list[Check]:
    """A spring closes a needle that drives gas through its seat."""
    diameter, mass, stiffness, preload, open_by = 2e-3, 3e-3, 2e3, 8.0, 0.3e-3
    face = pi / 4.0 * 25e-6
    result = run_network(
        {
            "needle": component("rigid-mass", mass=mass),
            "spring": component("spring", stiffness=stiffness, preload=preload),
            "supply": component("gas-source", pressure=6e5),
            "feed": component("gas-orifice", conductance=2e-9, critical_ratio=0.25),
            "below": component("gas-chamber", volume=4e-8, pressure=1.05e5),
            "seat": component("gas-valve", diameter=diameter, discharge=0.8, start_lift=open_by),
            "face": component("gas-face", direction="opening", area=face),
        },
        [
            ["needle.body", "spring.end", "seat.needle", "face.body"],
            ["supply.gas", "feed.a"],
            ["feed.b", "below.gas", "seat.a", "face.gas"],
            ["seat.b", "ambient"],
        ],
        gas=AIR,
        duration=0.8e-3,
        coarse=None,
        record=1.28e-6,
    )

    def f(t: float, x: np.ndarray) -> list[float]:
        y, v, m, T = (float(value) for value in x)
        p = m * R * T / (4e-8 + face * y)
        area = 0.8 * pi * diameter * min(max(open_by + y, 0.0), diameter / 4.0)
        a, ha = _flow(6e5, p, T0, T, REFERENCE * 2e-9, 0.25, 0.5)
        b, hb = _flow(p, P0, T, T0, NOZZLE * area, RATIO, 0.5)
        dU = ha - hb - p * face * v
        force = (p - P0) * face - preload - stiffness * y
        return [v, force / mass, a - b, (dU - CV * T * (a - b)) / (m * CV)]

    start = [0.0, 0.0, 1.05e5 * 4e-8 / (R * T0), T0]
    y = result.channels["needle.body displacement"].values
    low = int(np.flatnonzero(y < -0.5 * open_by)[0])
    share = (-0.5 * open_by - y[low - 1]) / (y[low] - y[low - 1])
    half = float(result.time[low - 1] + share * (result.time[low] - result.time[low - 1]))
    event = partial(_half_way, -0.5 * open_by)
    event.terminal = True  # type: ignore[attr-defined]
    known = solve_ivp(
        f,
        (0.0, 1e-3),
        start,
        method="DOP853",
        rtol=1e-11,
        atol=[1e-16, 1e-12, 1e-18, 1e-8],
        events=event,
    )
    end = _integrated(f, start, float(result.time[-1]))
    return [
        check(
            "needle closing over its own choked seat, time to half the lift [s]",
            float((known.t_events or [np.full(1, np.nan)])[0][0]),
            half,
            2e-5,
            SOURCE,
            reason=WIDE,
        ),
        check(
            "its lift left after 0.8 ms [m]",
            float(open_by + end[0]),
            float(open_by + y[-1]),
            1e-4,
            SOURCE,
            reason=WIDE,
        ),
        check(
            "pressure below it then [Pa]",
            float(end[2] * R * end[3] / (4e-8 + face * end[0])),
            last(result, "below pressure"),
            1e-4,
            SOURCE,
            reason=WIDE,
        ),
    ]


def _half_way(lift: float, t: float, x: np.ndarray) -> float:
    return float(x[0] - lift)


BAR, LITRE = 1e5, 1e-3
C = 2e-8  # [m^3/(s Pa)]: 2 l/(s bar)
FACTOR = factor_of_conductance(AIR) * C
_OF_STEP = "the step of 0.51 is almost of second order: what is left falls with the step"
_LAW = "ISO 6358-1:2013: C rho_0 p_1 sqrt(T_0/T_1) [1 - ((r - b)/(1 - b))^2]^m"


def checks() -> list[Check]:
    """Return the checks."""
    return [*_nozzles(), *_laws(), *_vessels(), *_mixing(), *_piston(), *_gas_spring(), *_closing()]


def _nozzles() -> Iterator[Check]:
    source = "Shapiro, Compressible Fluid Flow 1953, tables of isentropic flow"
    digits = "four digits of a printed table"
    for kappa, ratio, factor in (
        (1.4, 0.5283, 0.6847),
        (5.0 / 3.0, 0.4871, 0.7262),
        (1.3, 0.5457, 0.6673),
    ):
        yield from [
            check(
                f"critical pressure ratio of an ideal nozzle, kappa = {kappa:.4g} [-]",
                ratio,
                critical_ratio(kappa),
                1e-4,
                source,
                reason=digits,
            ),
            check(
                f"choked flow factor of an ideal nozzle, kappa = {kappa:.4g} [-]",
                factor,
                nozzle_factor(kappa),
                1e-4,
                source,
                reason=digits,
            ),
        ]
    ratio = sqrt(HYDROGEN.gas_constant / AIR.gas_constant) * nozzle_factor(AIR.kappa)
    yield from [
        check(
            "mass flow of air over that of hydrogen through one choked hole [-]",
            ratio / nozzle_factor(HYDROGEN.kappa),
            factor_of_area(AIR) / factor_of_area(HYDROGEN),
            1e-14,
            "A p Psi/sqrt(R T)",
        ),
        check(
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
    curve = ComparedCurve(
        x_label="pressure ratio [-]",
        y_label="flow over choked flow [-]",
        expected=(ratios, np.sqrt(1.0 - np.clip((ratios - 0.3) / 0.7, 0.0, 1.0) ** 2)),
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
    r = 1.0 - 0.25e-3
    lift, d, half = 0.2e-3, 1.6e-3, pi / 6
    return [
        check(
            "choked flow at 7 bar, C = 2 l/(s bar) [kg/s]",
            whole,
            flow(7e5, 1e5, T0)[0],
            1e-14,
            "definition of C: 14 l/s at 100 kPa and 20 degC",
            curve,
        ),
        check(
            "flow at r = 0.65, b = 0.3 [kg/s]",
            whole * sqrt(0.75),
            flow(7e5, 0.65 * 7e5, T0)[0],
            1e-14,
            _LAW,
            curve,
        ),
        check(
            "flow from 373.15 K over that from 293.15 K [-]",
            sqrt(T0 / 373.15),
            flow(7e5, 1e5, 373.15)[0] / flow(7e5, 1e5, T0)[0],
            1e-14,
            "sqrt(T_0/T_1)",
        ),
        check(
            "flow at r = 0.7 with m = 0.6 and a cracking pressure of 0.5 bar [kg/s]",
            FACTOR * p1 / sqrt(T1) * (1.0 - ((0.7 - 0.3) / (end - 0.3)) ** 2) ** 0.6,
            cracked(p1, p2, T1)[0],
            1e-14,
            "ISO 6358-1:2013, with r_c = 1 - dp_c/p_1",
        ),
        check(
            "flow below the cracking pressure [kg/s]",
            0.0,
            cracked(p1, p1 - 0.49e5, T1)[0],
            0.0,
            "closed",
        ),
        check(
            "b = 1: choked down to the laminar end, r = 0.99 over r = 0 [-]",
            1.0,
            restriction_flow(7e5, 0.99 * 7e5, T0, FACTOR, 1.0, 0.5, 0.0)[0] / whole,
            1e-14,
            _LAW,
        ),
        check(
            "b = 0: flow at r = 0.6 [kg/s]",
            0.8 * whole,
            restriction_flow(7e5, 0.6 * 7e5, T0, FACTOR, 0.0, 0.5, 0.0)[0],
            1e-14,
            "3-4-5",
        ),
        check(
            "laminar end, flow at r = 1 - 0.25e-3 [kg/s]",
            0.25 * whole * sqrt(1.0 - ((1.0 - 1e-3 - 0.3) / 0.7) ** 2),
            flow(7e5, r * 7e5, T0)[0],
            1e-11,
            "straight line from r = 0.999 to none",
            reason="1 - r has lost four digits",
        ),
        *(
            check(
                f"slope of the flow with the {name}",
                (flow(p1 + dp, p2 + dq, T1 + dT)[0] - flow(p1 - dp, p2 - dq, T1 - dT)[0])
                / (2.0 * (dp + dq + dT)),
                slopes[name],
                5e-9,
                "central difference",
            )
            for name, (dp, dq, dT) in steps.items()
        ),
        check(
            "leakage through an eccentric gap, 7 bar to 1 bar [kg/s]",
            slot * density,
            gap_flow(7e5, 1e5, T0, slot / (2.0 * AIR.gas_constant))[0],
            5e-14,
            "plane Poiseuille flow with density p/(R T), by quadrature; Hamrock 1994",
        ),
        check(
            "mantle of a cone of 30 deg at a lift of 0.2 mm [m^2]",
            pi * lift * sin(half) * (d - lift * sin(half) * sqrt(0.75)),
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
    """Vessel filled from a source, or emptied into it, through one restriction."""
    rows = GasRows()
    rows.chambers[2] = GasChamberRow(
        component="vessel", volume=volume, pressure=pressure, temperature=T0, heat=heat, wall=T0
    )
    rows.sources[1] = GasSourceRow(
        component="source", time=(0.0,), pressure=(source,), temperature=T0
    )
    rows.branches.append(
        GasBranchRow(component="hole", a=1, b=2, law=(VALVE, factor, b, 0.5, 0.0, 0.0))
    )
    return GasNetwork(rows, gas, AMBIENT)


def march(net: GasNetwork, duration: float, steps: int) -> np.ndarray:
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
    cold = march(vessel(10e5, source=0.2e5), t, steps)[:, 0]
    x = 1.0 + 0.5 * (kappa - 1.0) * t / tau
    into = march(vessel(1.0, source=7e5, heat=ISOTHERMAL), 0.25 * tau, steps)[:, 0]
    start, end = 0.4, 0.95
    late = march(
        vessel(start * 7e5, source=7e5, heat=ISOTHERMAL),
        0.7 * (asin((end - 0.3) / 0.7) - asin((start - 0.3) / 0.7)) * tau,
        steps,
    )[:, 0]
    warm = march(vessel(1.0, source=7e5), 0.2 * tau, steps)[:, 0]
    closed = "Beater, Pneumatic Drives 2007, ch. 4; ISO 6358-2:2013: "
    return [
        check("time constant V/(C p_0) of a litre [s]", 0.5, tau, 1e-14, "1 l, 2 l/(s bar), 1 bar"),
        check(
            "isothermal discharge of 10 bar, choked, after tau [Pa]",
            10e5 * exp(-1.0),
            float(out[-1, 2]),
            3e-5,
            closed + "p = p_0 exp(-t/tau)",
            ComparedCurve(
                x_label="time [s]",
                y_label="pressure [bar]",
                expected=(time, 10.0 * np.exp(-time / tau)),
                computed=(time, out[:, 2] / BAR),
            ),
            reason=_OF_STEP,
        ),
        check(
            "adiabatic discharge of 10 bar, choked, mass over that at the start [-]",
            x ** (-2.0 / (kappa - 1.0)),
            float(cold[-1, 0] / cold[0, 0]),
            3e-5,
            closed + "(1 + (k - 1) t/(2 tau))^(-2/(k - 1))",
            reason=_OF_STEP,
        ),
        check(
            "its temperature [K]",
            T0 / x**2,
            float(cold[-1, 3]),
            3e-5,
            closed + "isentropic, T_0/(1 + (k - 1) t/(2 tau))^2",
            reason=_OF_STEP,
        ),
        check(
            "isothermal charge from vacuum, choked, after 0.25 tau [Pa]",
            1.0 + 0.25 * 7e5,
            float(into[-1, 2]),
            5e-13,
            closed + "p = p_s t/tau",
        ),
        check(
            "isothermal charge from 0.4 to 0.95 of the supply, subsonic [Pa]",
            end * 7e5,
            float(late[-1, 2]),
            1e-5,
            closed + "r = b + (1 - b) sin(t/((1 - b) tau) + asin((r_0 - b)/(1 - b)))",
            reason=_OF_STEP,
        ),
        check(
            "adiabatic charge of a vacuum, temperature over that of the supply [-]",
            kappa,
            float(warm[-1, 3]) / T0,
            1e-5,
            "first law: c_v T = c_p T_s",
            reason="1 Pa at the start",
        ),
        check(
            "adiabatic charge, choked, rise of the pressure in 0.2 tau [Pa]",
            kappa * 0.2 * 7e5,
            float(warm[-1, 2] - 1.0),
            1e-12,
            "dp/dt = k R T_s m_dot/V",
        ),
    ]


def _mixing() -> list[Check]:
    """Two vessels, one hole: the end follows from mass and energy alone."""
    rows = GasRows()
    for i, (p, V) in enumerate(((8e5, 1e-3), (2e5, 2e-3))):
        rows.chambers[i + 2] = GasChamberRow(
            component=f"v{i}", volume=V, pressure=p, temperature=T0, heat=0.0, wall=T0
        )
    rows.branches.append(
        GasBranchRow(component="hole", a=2, b=3, law=(VALVE, FACTOR, 0.3, 0.5, 0.0, 0.0))
    )
    states = march(GasNetwork(rows, AIR, AMBIENT), 5.0, 2000)
    mass = states[:, :, 0].sum(axis=1)
    # choked, then subsonic between equal holes: 1/3 of the supply before a hole three times as wide
    chain = GasRows()
    chain.chambers[2] = GasChamberRow(
        component="middle", volume=1e-6, pressure=None, temperature=T0, heat=0.0, wall=T0
    )
    chain.sources[1] = GasSourceRow(component="s", time=(0.0,), pressure=(9e5,), temperature=T0)
    chain.sources[0] = GasSourceRow(component="out", time=(0.0,), pressure=(1e5,), temperature=T0)
    chain.branches.append(
        GasBranchRow(component="in", a=1, b=2, law=(VALVE, FACTOR, 0.4, 0.5, 0.0, 0.0))
    )
    chain.branches.append(
        GasBranchRow(component="out", a=2, b=0, law=(VALVE, 3.0 * FACTOR, 0.4, 0.5, 0.0, 0.0))
    )
    steady = GasNetwork(chain, AIR, AMBIENT).start(np.zeros(0))
    return [
        check(
            "two adiabatic vessels after exchange: pressure [Pa]",
            4e5,
            float(states[-1, 0, 2]),
            5e-14,
            "energy: (p_1 V_1 + p_2 V_2)/(V_1 + V_2)",
        ),
        check(
            "mass in both, relative change over 2000 steps",
            0.0,
            float(np.abs(mass / mass[0] - 1.0).max()),
            1e-14,
            "closed system",
        ),
        check(
            "temperature of the vessel that was emptied [K]",
            T0 * (4e5 / 8e5) ** ((AIR.kappa - 1.0) / AIR.kappa),
            float(states[-1, 0, 3]),
            3e-5,
            "what stays behind expands isentropically, T (p/p_0)^((k - 1)/k)",
            reason=_OF_STEP,
        ),
        check(
            "pressure between two choked holes at the start [Pa]",
            3e5,
            float(steady[2]),
            5e-14,
            "series of choked restrictions: C_1 p_1 = C_2 p_2",
        ),
        check(
            "log of the pressure ratio over that of the temperatures, emptied vessel [-]",
            AIR.kappa / (AIR.kappa - 1.0),
            log(float(states[-1, 0, 2]) / 8e5) / log(float(states[-1, 0, 3]) / T0),
            2e-4,
            "isentropic exponent",
            reason=_OF_STEP,
        ),
    ]
