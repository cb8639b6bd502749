"""Gas networks against the same equations, written apart and integrated by SciPy's DOP853."""

from collections.abc import Callable
from functools import partial
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.pneumatics.gas_chamber import GasChamber
from klack.pneumatics.gas_face import GasFace
from klack.pneumatics.gas_library import AIR
from klack.pneumatics.gas_orifice import GasOrifice
from klack.pneumatics.gas_source import GasSource
from klack.pneumatics.gas_valve import GasValve
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, compare

__all__ = ["gas_networks"]

GROUP = "pneumatics"
R, K = AIR.gas_constant, AIR.kappa
CV, CP = R / (K - 1.0), K * R / (K - 1.0)
P0, T0 = 101_325.0, 293.15
FACE, SMALL = 50e-6, 30e-6  # [m^2]
RATIO = (2.0 / (K + 1.0)) ** (K / (K - 1.0))
NOZZLE = sqrt(K / R) * (2.0 / (K + 1.0)) ** ((K + 1.0) / (2.0 * (K - 1.0)))
REFERENCE = 1e5 / (R * 293.15) * sqrt(293.15)
SOURCE = "the same equations written apart, integrated by SciPy DOP853, rtol 1e-11"
WIDE = "steps of 1.28 us"

_check = partial(compare, GROUP)
Vector = NDArray[np.float64]


def gas_networks() -> list[Check]:
    """A piston between two chambers, a gas spring, and a needle that closes against gas."""
    return [*_piston(), *_gas_spring(), *_closing()]


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


def _integrated(f: Callable[[float, Vector], list[float]], x0: list[float], end: float) -> Vector:
    scale = np.array([1e-6, 1e-2, *[1e-8, 100.0] * ((len(x0) - 2) // 2)])
    found = solve_ivp(f, (0.0, end), x0, method="DOP853", rtol=1e-11, atol=1e-10 * scale)
    return np.asarray(found.y[:, -1])


def _last(result: NetworkResult, *names: str) -> list[float]:
    return [float(result.channels[name].values[-1]) for name in names]


def _piston() -> list[Check]:
    hole, out, heat = 0.8 * pi / 4.0 * 1e-6, 0.9 * 0.2e-6, 0.05
    network = Network(
        {
            "piston": RigidMass(mass=10e-3),
            "spring": Spring(stiffness=4e4, preload=0.0, damping=2.0),
            "low": GasChamber(volume=2e-8, pressure=P0, heat_conductance=heat),
            "top": GasChamber(volume=8e-8, pressure=P0),
            "supply": GasSource(pressure=6e5),
            "inlet": GasOrifice(diameter=1e-3),
            "between": GasOrifice(conductance=2e-9, critical_ratio=0.3, subsonic_index=0.48),
            "outlet": GasOrifice(area=0.2e-6, discharge=0.9),
            "up": GasFace(direction="opening", area=FACE),
            "down": GasFace(direction="closing", area=SMALL),
        },
        [
            ["piston.body", "spring.end", "up.body", "down.body"],
            ["supply.gas", "inlet.a"],
            ["inlet.b", "low.gas", "between.a", "up.gas"],
            ["between.b", "top.gas", "down.gas", "outlet.a"],
            ["outlet.b", "ambient"],
        ],
        gas=AIR,
    )

    def f(t: float, x: Vector) -> list[float]:
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

    result = simulate_network(network.rows(), duration=2e-3, record=1.28e-6)
    start = [0.0, 0.0, P0 * 2e-8 / (R * T0), T0, P0 * 8e-8 / (R * T0), T0]
    known = _integrated(f, start, float(result.time[-1]))
    found = _last(
        result, "piston.body displacement", "low mass", "low temperature", "top temperature"
    )
    pressure = known[2] * R * known[3] / (2e-8 + FACE * known[0])
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
            _check(inside.format(name), float(e), c, 2e-5, SOURCE, reason=WIDE)
            for name, e, c in zip(names, expected, found, strict=True)
        ),
        _check(
            inside.format("pressure in the lower chamber [Pa]"),
            float(pressure),
            _last(result, "low pressure")[0],
            2e-5,
            SOURCE,
            reason=WIDE,
        ),
        _check(
            inside.format("energy residual, relative"),
            0.0,
            result.books.relative_residual,
            1e-12,
            "first law, enthalpy flows and heat included",
            reason="round-off of a whole run",
        ),
    ]


def _gas_spring() -> list[Check]:
    """A mass on enclosed gas: adiabatic, and as warm as its wall."""
    found = []
    for word, isothermal in (("adiabatic", False), ("isothermal", True)):
        mass, volume = 10e-3, 1e-7
        network = Network(
            {
                "piston": RigidMass(mass=mass, speed=2e-3),
                "gas": GasChamber(volume=volume, pressure=P0, isothermal=isothermal),
                "face": GasFace(direction="opening", area=FACE),
            },
            [["piston.body", "face.body"], ["gas.gas", "face.gas"]],
            gas=AIR,
        )
        result = simulate_network(network.rows(), duration=20e-3, record=2.56e-6, start="free")
        y = result.channels["piston.body displacement"].values
        falls = np.flatnonzero((y[:-1] > 0.0) & (y[1:] <= 0.0))
        at = result.time[falls] + (result.time[1] - result.time[0]) * y[falls] / (
            y[falls] - y[falls + 1]
        )
        omega = 2.0 * pi * (len(at) - 1) / float(at[-1] - at[0])
        kappa = 1.0 if isothermal else K
        found.append(
            _check(
                f"mass on enclosed gas, {word}: angular frequency [1/s]",
                sqrt(kappa * P0 * FACE**2 / (volume * mass)),
                omega,
                2e-5,
                "gas spring: n p A^2/V",
                reason="amplitude of 0.2 % of the volume",
            )
        )
    return found


def _closing() -> list[Check]:
    """A needle that a spring closes while it drives gas through its own seat."""
    diameter, mass, stiffness, preload, open_by = 2e-3, 3e-3, 2e3, 8.0, 0.3e-3
    face = pi / 4.0 * 25e-6
    network = Network(
        {
            "needle": RigidMass(mass=mass),
            "spring": Spring(stiffness=stiffness, preload=preload),
            "supply": GasSource(pressure=6e5),
            "feed": GasOrifice(conductance=2e-9, critical_ratio=0.25),
            "below": GasChamber(volume=4e-8, pressure=1.05e5),
            "seat": GasValve(diameter=diameter, discharge=0.8, start_lift=open_by),
            "face": GasFace(direction="opening", area=face),
        },
        [
            ["needle.body", "spring.end", "seat.needle", "face.body"],
            ["supply.gas", "feed.a"],
            ["feed.b", "below.gas", "seat.a", "face.gas"],
            ["seat.b", "ambient"],
        ],
        gas=AIR,
    )

    def f(t: float, x: Vector) -> list[float]:
        y, v, m, T = (float(value) for value in x)
        p = m * R * T / (4e-8 + face * y)
        area = 0.8 * pi * diameter * min(max(open_by + y, 0.0), diameter / 4.0)
        a, ha = _flow(6e5, p, T0, T, REFERENCE * 2e-9, 0.25, 0.5)
        b, hb = _flow(p, P0, T, T0, NOZZLE * area, RATIO, 0.5)
        dU = ha - hb - p * face * v
        force = (p - P0) * face - preload - stiffness * y
        return [v, force / mass, a - b, (dU - CV * T * (a - b)) / (m * CV)]

    result = simulate_network(network.rows(), duration=0.8e-3, record=1.28e-6, start="free")
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
        _check(
            "needle closing over its own choked seat, time to half the lift [s]",
            float((known.t_events or [np.full(1, np.nan)])[0][0]),
            half,
            2e-5,
            SOURCE,
            reason=WIDE,
        ),
        _check(
            "its lift left after 0.8 ms [m]",
            float(open_by + end[0]),
            float(open_by + y[-1]),
            1e-4,
            SOURCE,
            reason=WIDE,
        ),
        _check(
            "pressure below it then [Pa]",
            float(end[2] * R * end[3] / (4e-8 + face * end[0])),
            _last(result, "below pressure")[0],
            1e-4,
            SOURCE,
            reason=WIDE,
        ),
    ]


def _half_way(lift: float, t: float, x: Vector) -> float:
    return float(x[0] - lift)
