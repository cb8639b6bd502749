"""Pump, relief valve, accumulator and throttle together, against the same equations written apart.

The other side integrates one pressure per volume with SciPy to 1e-9, from the density of the fluid
and the formulas alone.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from klack.hydraulics.accumulator import Accumulator
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.flow_source import FlowSource, FlowStep
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pulsating_flow import FlowHarmonic, PulsatingFlow
from klack.hydraulics.relief_valve import ReliefValve
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, ComparedCurve, compare

__all__ = ["OIL", "supply_networks"]

AMBIENT = Ambient()
OIL = library_fluid("ISO VG 46").at(313.15)
RHO = float(OIL.density(AMBIENT.pressure))
BAR = 1e5
APART = "the same equations integrated apart by SciPy (DOP853, 1e-10)"
BALANCE = "conservation of energy"

Vector = NDArray[np.float64]
_check = partial(compare, "hydraulic-parts")


def supply_networks() -> list[Check]:
    """Filling, a jump of the flow, a pulsation, and a compressor of fluid."""
    return [*_filling(), *_pulsation(), *_one_way(), *_lagging_relief()]


def _run(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    duration: float,
    step: float,
    record: float,
) -> NetworkResult:
    held = {"needle": RigidMass(mass=1e-3), "spring": Spring(stiffness=1e4, preload=0.0)}
    network = Network(
        {**held, **parts}, [["needle.body", "spring.end"], *connections], AMBIENT, OIL
    )
    return simulate_network(
        network.rows(), duration=duration, step=step, coarse=1, record=record, start="free"
    )


def _apart(
    rates: Callable[[float, Vector], Vector], start: Sequence[float], time: Vector, longest: float
) -> Vector:
    found = solve_ivp(
        rates,
        (0.0, time[-1]),
        start,
        method="DOP853",
        t_eval=time,
        rtol=1e-10,
        atol=1e-3,
        max_step=longest,
    )
    return np.asarray(found.y)


def _stiffness(p: float) -> float:
    """Slope of the density with pressure [kg/(m^3 Pa)]."""
    return float(OIL.density(p)) / float(OIL.bulk_modulus(p))


def _throttle(p: float, area: float) -> float:
    """Mass flow to the surroundings, turbulent."""
    drop = p - AMBIENT.pressure
    return 0.7 * area * sqrt(2.0 * float(OIL.density(p)) * max(drop, 0.0))


_PLACES = ((10e-3, 2e-6), (28e-3, 2e-5), (60e-3, 2e-4))  # [s], accepted there
V_RAIL, V_GAS, PRECHARGE = 100e-6, 50e-6, 60 * BAR
SET, GAIN = 100 * BAR, 40 / 6e4 / (10 * BAR)


def _gas(p: float) -> float:
    """Slope of the mass in the accumulator with pressure [kg/Pa], n = 1.4."""
    if p <= PRECHARGE:
        return 0.0
    gas = V_GAS * (PRECHARGE / p) ** (1 / 1.4)
    return _stiffness(p) * (V_GAS - gas) + float(OIL.density(p)) * gas / (1.4 * p)


def _relief(p: float) -> float:
    """Mass flow of the relief valve, straight above its set pressure."""
    drop = p - AMBIENT.pressure
    # its area is that of ambient density
    return GAIN * max(drop - SET, 0.0) * sqrt(RHO * float(OIL.density(p)))


def _filling() -> list[Check]:
    hole = pi / 4 * 1.5e-3**2
    flow = 20 / 6e4

    def rates(t: float, y: Vector) -> Vector:
        p = float(y[0])
        into = RHO * flow * (1.0 + np.clip((t - 30e-3) / 1e-3, 0.0, 1.0))
        into -= _throttle(p, hole) + _relief(p)
        return np.array([into / (V_RAIL * _stiffness(p) + _gas(p))])

    step = 5e-6
    result = _run(
        {
            "pump": FlowSource(flow=flow, step=FlowStep(to=2 * flow, at=30e-3, rise=1e-3)),
            "rail": Chamber(volume=V_RAIL, pressure=20 * BAR),
            "load": Orifice(area=hole, critical_flow_number=1.0, cavitation=None),
            "relief": ReliefValve(
                set_pressure=SET,
                rated_pressure=110 * BAR,
                rated_flow=40 / 6e4,
                diameter=8e-3,
                critical_flow_number=1.0,
                cavitation=None,
            ),
            "accumulator": Accumulator(volume=V_GAS, precharge=PRECHARGE),
        },
        [
            ["pump.b", "rail.fluid", "load.a", "relief.a", "accumulator.fluid"],
            ["load.b", "ambient"],
            ["relief.b", "ambient"],
        ],
        60e-3,
        step,
        100e-6,
    )
    time, p = result.time, result.channels["rail pressure"].values
    known = _apart(rates, [20 * BAR], time, 50e-6)[0]
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="pressure [bar]",
        expected=(time * 1e3, known / BAR),
        computed=(time * 1e3, p / BAR),
    )
    source = APART + "; steps of 5 us, first order where the accumulator holds the pressure"
    places = {int(np.argmin(np.abs(time - t))): tolerance for t, tolerance in _PLACES}
    out = [
        _check(
            f"pump, relief valve, accumulator, throttle: pressure after {1e3 * time[k]:.0f} ms "
            "[Pa]",
            float(known[k]),
            float(p[k]),
            tolerance,
            source,
            curve,
        )
        for k, tolerance in places.items()
    ]
    out.append(
        _check(
            "pump, relief valve, accumulator, throttle: energy residual [-]",
            0.0,
            result.books.relative_residual,
            1e-13,
            BALANCE,
        )
    )
    return out


def _pulsation() -> list[Check]:
    hole, frequency = pi / 4 * 1.2e-3**2, 400.0

    def rates(t: float, y: Vector) -> Vector:
        p = float(y[0])
        into = RHO * (15 + 3 * np.sin(2 * pi * frequency * t)) / 6e4 - _throttle(p, hole)
        return np.array([into / (20e-6 * _stiffness(p))])

    result = _run(
        {
            "pump": PulsatingFlow(
                mean=15 / 6e4, harmonics=(FlowHarmonic(frequency=frequency, amplitude=3 / 6e4),)
            ),
            "rail": Chamber(volume=20e-6, pressure=60 * BAR),
            "load": Orifice(area=hole, critical_flow_number=1.0, cavitation=None),
        },
        [["pump.b", "rail.fluid", "load.a"], ["load.b", "ambient"]],
        20e-3,
        1e-6,
        20e-6,
    )
    time, p = result.time, result.channels["rail pressure"].values
    known = _apart(rates, [60 * BAR], time, 50e-6)[0]
    last = time > 15e-3
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="pressure [bar]",
        expected=(time * 1e3, known / BAR),
        computed=(time * 1e3, p / BAR),
    )
    return [
        _check(
            "flow that pulsates by 20 % at 400 Hz, ripple of the pressure [Pa]",
            float(np.ptp(known[last])),
            float(np.ptp(p[last])),
            5e-5,
            APART,
            curve,
        ),
        _check(
            "flow that pulsates by 20 % at 400 Hz, mean pressure [Pa]",
            float(known[last].mean()),
            float(p[last].mean()),
            5e-6,
            APART,
        ),
    ]


def _one_way() -> list[Check]:
    """A pulsating flow between two volumes with a check valve: a piston compressor of fluid."""
    size = pi / 4 * 3e-3**2
    frequency, hole = 200.0, pi / 4 * 0.8e-3**2

    def check_flow(p: float, q: float) -> float:
        s = min(max((p - q - 0.5 * BAR) / (1.5 * BAR), 0.0), 1.0)
        area = size * s
        return 0.7 * area * sqrt(2.0 * float(OIL.density(p)) * max(p - q, 0.0))

    def rates(t: float, y: Vector) -> Vector:
        p, q = (float(x) for x in y)
        into = RHO * (5 + 12 * np.sin(2 * pi * frequency * t)) / 6e4
        through = check_flow(p, q)
        return np.array(
            [
                (into - through) / (200e-6 * _stiffness(p)),
                (through - _throttle(q, hole)) / (30e-6 * _stiffness(q)),
            ]
        )

    result = _run(
        {
            "pump": PulsatingFlow(
                mean=5 / 6e4, harmonics=(FlowHarmonic(frequency=frequency, amplitude=12 / 6e4),)
            ),
            "rail": Chamber(volume=200e-6, pressure=60 * BAR),
            "valve": CheckValve(
                cracking_pressure=0.5 * BAR,
                open_pressure=2 * BAR,
                diameter=3e-3,
                critical_flow_number=1.0,
                cavitation=None,
            ),
            "second": Chamber(volume=30e-6, pressure=60 * BAR),
            "load": Orifice(area=hole, critical_flow_number=1.0, cavitation=None),
        },
        [
            ["pump.b", "rail.fluid", "valve.a"],
            ["valve.b", "second.fluid", "load.a"],
            ["load.b", "ambient"],
        ],
        20e-3,
        0.5e-6,
        20e-6,
    )
    time, p = result.time, result.channels["second pressure"].values
    known = _apart(rates, [60 * BAR, 60 * BAR], time, 20e-6)[1]
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="pressure [bar]",
        expected=(time * 1e3, known / BAR),
        computed=(time * 1e3, p / BAR),
    )
    return [
        _check(
            "flow to and fro before a check valve, pressure behind it after 20 ms [Pa]",
            float(known[-1]),
            float(p[-1]),
            1e-6,
            APART,
            curve,
        ),
        _check(
            "flow to and fro before a check valve, ripple behind it [Pa]",
            float(np.ptp(known[time > 10e-3])),
            float(np.ptp(p[time > 10e-3])),
            1e-5,
            APART,
        ),
        _check(
            "flow to and fro before a check valve, energy residual [-]",
            0.0,
            result.books.relative_residual,
            5e-14,
            BALANCE,
        ),
    ]


def _lagging_relief() -> list[Check]:
    """A chamber before a relief valve with a lag swings about its equilibrium."""
    volume, tau, above = 2e-3, 4e-3, 5 * BAR
    drop = SET + above
    p = AMBIENT.pressure + drop
    density = float(OIL.density(p))
    capacity = volume * _stiffness(p)
    # A = k (dp - p_s)/sqrt(dp) and C_q A sqrt(2 rho dp): slopes at constant area, and with the area
    mass_flow = GAIN * above * sqrt(RHO * density)
    direct = 0.5 * mass_flow / drop
    by_area = mass_flow * (1.0 / above - 0.5 / drop)
    poles = np.roots([capacity * tau, capacity + direct * tau, direct + by_area])
    pole = poles[np.argmax(poles.imag)]
    result = _run(
        {
            "pump": FlowSource(
                flow=mass_flow / RHO,
                step=FlowStep(to=mass_flow / RHO * 1.0002, at=1e-3, rise=1e-6),
            ),
            "rail": Chamber(volume=volume, pressure=p),
            "relief": ReliefValve(
                set_pressure=SET,
                rated_pressure=110 * BAR,
                rated_flow=40 / 6e4,
                diameter=8e-3,
                critical_flow_number=1.0,
                cavitation=None,
                time_constant=tau,
            ),
        },
        [["pump.b", "rail.fluid", "relief.a"], ["relief.b", "ambient"]],
        60e-3,
        10e-6,
        10e-6,
    )
    time = result.time - 1e-3
    swing = result.channels["rail pressure"].values - p
    final = mass_flow * 0.0002 / (direct + by_area)
    # answer of the second-order system to a step of the flow
    decay, omega = -pole.real, pole.imag
    slope = mass_flow * 0.0002 / capacity
    wave = np.exp(-decay * time) * (
        np.cos(omega * time) + (decay - slope / final) / omega * np.sin(omega * time)
    )
    known = np.where(time > 0, final * (1.0 - wave), 0.0)
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="rise of pressure [Pa]",
        expected=(result.time * 1e3, known),
        computed=(result.time * 1e3, swing),
    )
    top = int(np.argmax(known))
    return [
        _check(
            "relief valve with a lag of 4 ms on 2 l, first swing of the pressure [Pa]",
            float(known[top]),
            float(swing.max()),
            2e-3,
            "C tau s^2 + (C + G tau) s + G + G_A = 0",
            curve,
        ),
        _check(
            "relief valve with a lag of 4 ms on 2 l, time of that swing [s]",
            float(time[top]),
            float(time[int(np.argmax(swing))]),
            1e-2,
            "the same; records of 10 us",
        ),
    ]
