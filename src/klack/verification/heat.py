"""Heat networks against closed solutions, and an averaged warm-up against all of its strokes."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import exp, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm

from klack.analyses.heat.heated_stroke import aspects_of, heated_stroke, sent_heat, warm_valve
from klack.analyses.heat.run import run_heat
from klack.assembling.valve import build_valve
from klack.case.any_case import read_valve_case
from klack.case.valve_roles import find_roles
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.thermal.heat_network import HeatNetwork, heat_network
from klack.thermal.heat_source import HeatSource, HeatTable
from klack.thermal.heat_step import HeatStep, heat_step, steady_temperature
from klack.thermal.radiation import STEFAN_BOLTZMANN, Radiation
from klack.thermal.slow_warm_up import SlowSettings, warm_up
from klack.verification.benches import component
from klack.verification.check import Check, check

__all__ = ["checks"]

AMBIENT = 293.15  # [K]
ALPHA = 3.93e-3  # [1/K] of copper, IEC 60028
CLOSED = "closed form"
MODELICA = "Modelica Standard Library 4.0.0, Thermal.HeatTransfer.Examples"


def checks() -> list[Check]:
    """Steps, steady states, self-heating and warm-up."""
    return [
        *_one_node(),
        *_pulses(),
        *_two_masses(),
        *_far_apart(),
        *_sources(),
        *_self_heating(),
        *_motor(),
        *_all_strokes(),
        *_growth(),
    ]


def _network(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    ambient: float = AMBIENT,
) -> HeatNetwork:
    found = heat_network(Network(parts, connections, ambient=Ambient(temperature=ambient)))
    assert found is not None
    return found


def _node(capacity: float, conductance: float) -> HeatNetwork:
    return _network(
        {
            "part": component("heat-capacity", capacity=capacity),
            "path": component("thermal-conductance", conductance=conductance),
        },
        [["part.node", "path.a"], ["path.b", "ambient"]],
    )


def _step(network: HeatNetwork, start: np.ndarray, power: float, length: float) -> HeatStep:
    flow = np.zeros(network.count)
    flow[0] = power
    return heat_step(network, network.links(start), start, (flow, flow), length)


def _one_node() -> list[Check]:
    """Node of 12 J/K on 0.3 W/K: a time constant of 40 s."""
    C, G, P, t = 12.0, 0.3, 6.0, 60.0
    network = _node(C, G)
    step = _step(network, network.start, P, t)
    rise = P / G * (1.0 - exp(-t * G / C))
    zero = np.zeros(1)
    ramp = heat_step(network, network.links(network.start), network.start, (zero, zero + P), t)
    slope, tau = P / t, C / G
    return [
        check(
            "one node under constant heat, rise after 1.5 time constants [K]",
            rise,
            float(step.temperature[0] - AMBIENT),
            1e-13,
            CLOSED,
        ),
        check(
            "the same, heat given off until then [J]",
            P * t - C * rise,
            float(step.given_off[0]),
            1e-13,
            CLOSED,
        ),
        check(
            "one node under heat that grows with time, rise [K]",
            slope / G * (t - tau * (1.0 - exp(-t / tau))),
            float(ramp.temperature[0] - AMBIENT),
            1e-13,
            CLOSED,
        ),
    ]


def _pulses() -> list[Check]:
    """Heat of 40 W for 5 s of every 30 s: the highest and the lowest temperature, periodic."""
    C, G, P, on, period = 12.0, 0.3, 40.0, 5.0, 30.0
    network, tau = _node(C, G), C / G
    T, high = network.start, network.start
    for _ in range(80):  # 60 time constants
        high = _step(network, T, P, on).temperature
        T = _step(network, high, 0.0, period - on).temperature
    top = P / G * (1.0 - exp(-on / tau)) / (1.0 - exp(-period / tau))
    source = "geometric sum of the decays of all pulses before"
    return [
        check(
            "pulsed heat, highest rise of the steady period [K]",
            top,
            float(high[0] - AMBIENT),
            1e-13,
            source,
        ),
        check(
            "pulsed heat, lowest rise of the steady period [K]",
            top * exp(-(period - on) / tau),
            float(T[0] - AMBIENT),
            1e-13,
            source,
        ),
    ]


def _two_masses() -> list[Check]:
    """Two bodies of 15 J/K at 100 and 0 degC, joined by 10 W/K."""
    network = _network(
        {
            "mass1": component("heat-capacity", capacity=15.0, temperature=373.15),
            "mass2": component("heat-capacity", capacity=15.0, temperature=273.15),
            "conduction": component("thermal-conductance", conductance=10.0),
        },
        [["mass1.node", "conduction.a"], ["conduction.b", "mass2.node"]],
        293.15,
    )
    early = _step(network, network.start, 0.0, 0.5).temperature
    late = _step(network, network.start, 0.0, 1e6).temperature
    return [
        check(
            "TwoMasses, final temperature [K]",
            323.15,
            float(late[0]),
            1e-13,
            f"{MODELICA}.TwoMasses: T_final_K",
        ),
        check(
            "TwoMasses, difference after 0.5 s [K]",
            100.0 * exp(-0.5 * 10.0 * 2.0 / 15.0),
            float(early[0] - early[1]),
            1e-13,
            CLOSED,
        ),
    ]


def _far_apart() -> list[Check]:
    """Conductances of 1 GW/K and 1 mW/K, capacities of 1 mJ/K, 10 J/K and none."""
    network = _network(
        {
            "a": component("heat-capacity", capacity=10.0),
            "b": component("heat-capacity", capacity=1e-3),
            "none": component("heat-capacity", capacity=0.0),
            "huge": component("thermal-conductance", conductance=1e9),
            "middle": component("thermal-conductance", conductance=2.0),
            "tiny": component("thermal-conductance", conductance=1e-3),
        },
        [
            ["a.node", "huge.a"],
            ["huge.b", "b.node", "middle.a"],
            ["middle.b", "none.node", "tiny.a"],
            ["tiny.b", "ambient"],
        ],
    )
    t, P = 2e4, 0.01
    step = _step(network, network.start, P, t)
    # one capacity of 10.001 J/K behind both resistances; 1e-9 K/W of the link apart
    C, R = 10.001, 1.0 / 2.0 + 1.0 / 1e-3
    rise = P * R * (1.0 - exp(-t / (R * C)))
    steady = steady_temperature(
        network, network.links(network.start), network.start, np.array([P, 0.0, 0.0])
    )
    assert steady is not None
    reason = "the links of 1 GW/K are taken as ideal in the closed form"
    return [
        check(
            "conductances 12 decades apart, rise after 2 time constants [K]",
            rise,
            float(step.temperature[0] - AMBIENT),
            1e-10,
            CLOSED,
            reason=reason,
        ),
        check(
            "the same, node without capacity [K]",
            rise * 1e3 / R,
            float(step.temperature[2] - AMBIENT),
            1e-10,
            CLOSED,
            reason=reason,
        ),
        check(
            "the same, steady rise [K]", P * (R + 1e-9), float(steady[0] - AMBIENT), 1e-13, CLOSED
        ),
    ]


def _sources() -> list[Check]:
    """Table heat into a radiating body; and heat that has no way out."""
    eps, A, P = 0.9, 1e-3, 1.0
    network = _network(
        {
            "part": component("heat-capacity", capacity=10.0),
            "skin": Radiation(emissivity=eps, area=A),
            "heater": HeatSource(table=HeatTable(time=(0.0, 100.0), power=(0.0, P))),
        },
        [["part.node", "skin.surface", "heater.node"]],
    )
    nothing = np.zeros(1)
    found = warm_up(network, lambda T: nothing, SlowSettings(tolerance=1e-3))
    kept = warm_up(
        _network({"part": component("heat-capacity", capacity=10.0)}, []),
        lambda T: nothing + 3.0,
        SlowSettings(duration=50.0),
    )
    return [
        check(
            "radiating body, steady temperature [K]",
            (P / (eps * STEFAN_BOLTZMANN * A) + AMBIENT**4) ** 0.25,
            float(found.points[-1].temperature[0]),
            1e-6,
            "Stefan and Boltzmann",
            reason="steady states are found to a tenth of 1 mK",
        ),
        check(
            "heat without a way out, rise in 50 s [K]",
            15.0,
            float(kept.points[-1].temperature[0] - AMBIENT),
            1e-13,
            "heat over capacity",
        ),
    ]


def _copper(loss: Callable[[float], float]) -> Callable[[np.ndarray], np.ndarray]:
    """Mean heat of a copper node over the factor of its resistance from 20 degC."""
    return lambda T: np.array([loss(1.0 + ALPHA * (float(T[0]) - AMBIENT))])


def _self_heating() -> list[Check]:
    """Copper of 8 W at 20 degC on 0.05 W/K; constant current, constant voltage, 13 W."""
    C, G, P = 10.0, 0.05, 8.0
    network = _node(C, G)
    fine = SlowSettings(tolerance=0.02)
    current = warm_up(network, _copper(lambda r: P * r), fine)
    voltage = warm_up(network, _copper(lambda r: P / r), fine)
    timed = warm_up(network, _copper(lambda r: P * r), SlowSettings(tolerance=0.02, duration=300.0))
    away = warm_up(network, _copper(lambda r: 13.0 * r))
    left = G - ALPHA * P
    return [
        check(
            "copper at constant current, steady rise [K]",
            P / left,
            float(current.points[-1].temperature[0] - AMBIENT),
            1e-4,
            CLOSED,
        ),
        check(
            "copper at constant voltage, steady rise [K]",
            (sqrt(1.0 + 4.0 * ALPHA * P / G) - 1.0) / (2.0 * ALPHA),
            float(voltage.points[-1].temperature[0] - AMBIENT),
            1e-5,
            CLOSED,
        ),
        check(
            "copper at constant current, rise after 300 s [K]",
            P / left * (1.0 - exp(-300.0 * left / C)),
            float(timed.points[-1].temperature[0] - AMBIENT),
            2e-4,
            CLOSED,
        ),
        check(
            "thermal runaway, gain of the heat over what is given off",
            ALPHA * 13.0 / G,
            away.gain,
            1e-3,
            CLOSED,
        ),
        check(
            "thermal runaway is reported as such",
            1.0,
            float(away.end == "runaway"),
            0.0,
            "gain above 1",
        ),
        check(
            "no runaway is reported at a gain of 0.63",
            1.0,
            float(current.end == "steady"),
            0.0,
            "gain below 1",
        ),
    ]


def _motor() -> list[Check]:
    """Modelica's motor: winding losses of 100 W, from 360 s on 1000 W, that grow with heat."""
    parts = {
        "winding": component("heat-capacity", capacity=2500.0),
        "core": component("heat-capacity", capacity=25000.0),
        "winding2core": component("thermal-conductance", conductance=10.0),
        "convection": component("thermal-conductance", conductance=25.0),
        "coreLosses": HeatSource(power=500.0),
    }
    joined = [
        ["winding.node", "winding2core.a"],
        ["winding2core.b", "core.node", "convection.a", "coreLosses.node"],
        ["convection.b", "ambient"],
    ]
    alpha, reference = 3.03e-3, 368.15
    exact = computed = np.full(2, AMBIENT)
    for P, length in ((100.0, 360.0), (1000.0, 240.0)):
        exact = _exact_motor(exact, P, alpha, reference, length)
        warm = {
            "winding": component("heat-capacity", capacity=2500.0, temperature=float(computed[0])),
            "core": component("heat-capacity", capacity=25000.0, temperature=float(computed[1])),
        }

        def loss(T: np.ndarray, P: float = P) -> np.ndarray:
            return np.array([P * (1.0 + alpha * (T[0] - reference)), 0.0])

        found = warm_up(
            _network({**parts, **warm}, joined), loss, SlowSettings(tolerance=0.01, duration=length)
        )
        computed = found.points[-1].temperature
    source = f"{MODELICA}.Motor: its numbers, solved by the matrix exponential of SciPy"
    reason = "steps to 10 mK"
    return [
        check(
            "Motor, winding after 600 s [K]",
            float(exact[0]),
            float(computed[0]),
            2e-5,
            source,
            reason=reason,
        ),
        check(
            "Motor, core after 600 s [K]",
            float(exact[1]),
            float(computed[1]),
            2e-5,
            source,
            reason=reason,
        ),
    ]


def _exact_motor(
    start: np.ndarray, P: float, alpha: float, reference: float, t: float
) -> np.ndarray:
    C, g, h = (2500.0, 25000.0), 10.0, 25.0
    A = np.array(
        [
            [(P * alpha - g) / C[0], g / C[0], P * (1.0 - alpha * reference) / C[0]],
            [g / C[1], -(g + h) / C[1], (500.0 + h * AMBIENT) / C[1]],
            [0.0, 0.0, 0.0],
        ]
    )
    return (expm(A * t) @ np.append(start, 1.0))[:2]


SMALL = """
klack: 1
title: Small magnet valve whose copper warms up within a second
network:
  components:
    needle: {type: rigid-mass, mass: 2 g, points: [low, high]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    stop: {type: end-stop, gap: 100 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 5 N/mm, preload: 10 N}
    coil:
      {type: solenoid, turns: 200, resistance: 2 ohm, gap: 100 um, residual_gap: 50 um,
       poles: [{outer_radius: 3 mm, fringing: plane, shoulder: 2 mm}]}
    driver: {type: voltage-step, voltage: 12 V, end: 4 ms, decay: 30 V}
    copper: {type: heat-capacity, capacity: 0.02 J/K}
    path: {type: thermal-conductance, conductance: 0.025 W/K}
  connections:
    - [needle.low, seat.upper]
    - [ground, seat.lower, stop.upper, spring.base, coil.base]
    - [needle.high, stop.lower, spring.end, coil.armature]
    - [driver.terminals, coil.terminals]
    - [copper.node, path.a]
    - [path.b, ambient]
thermal:
  period: 20 ms
  duration: 1 s
  tolerance: 20 mK
  heat: [{loss: coil ohmic, node: copper}]
  windings: {coil: copper}
  growth:
    lift:
      of: [stop.gap, coil.gap]
      lengths: [{node: copper, length: 20 mm, expansion: 16.5e-6 1/K}]
run: {duration: 7 ms, step: 100 ns, record: 10 us, variants: [dry]}
"""


@cache
def _warmed() -> tuple[float, Any, float]:
    """Rise of the copper over 50 computed strokes; averaged warm-up; total heat."""
    case = read_valve_case(SMALL, Path("small.yaml"))
    valve, roles = build_valve(case), find_roles(case)
    thermal = case.thermal
    assert thermal is not None
    T, C, G, heat = AMBIENT, 0.02, 0.025, 0.0
    decay = exp(-thermal.period * G / C)
    for _ in range(50):
        at = {aspect: {"copper": T, "ambient": AMBIENT} for aspect in aspects_of(case)}
        loss = sent_heat(thermal, heated_stroke(valve, roles, "dry", at).losses)["copper"]
        heat += loss
        mean = loss / thermal.period
        T = AMBIENT + (T - AMBIENT) * decay + mean / G * (1.0 - decay)
    return T - AMBIENT, run_heat(case), heat


def _all_strokes() -> list[Check]:
    """A warm-up by a few strokes against every stroke."""
    rise, study, heat = _warmed()
    copper = study.temperature[0].values
    source = "each of the 50 strokes computed at its own temperature"
    return [
        check(
            "averaged warm-up of 1 s, rise of the copper [K]",
            rise,
            float(copper[-1] - AMBIENT),
            5e-3,
            source,
            reason="a period of 20 ms is 2.5 % of the time constant of 0.8 s",
        ),
        check(
            "the same, heat of all strokes [J]",
            heat,
            study.supplied["copper"],
            5e-3,
            source,
            reason="as above",
        ),
        check(
            "the same, residual of the energy balance over all heat",
            0.0,
            study.energy_residual,
            1e-13,
            "heat in = stored + given off",
        ),
        check(
            "copper resistance of the last stroke [ohm]",
            2.0 * (1.0 + ALPHA * (float(copper[-1]) - AMBIENT)),
            float(study.values[0].values[-1]),
            1e-4,
            "IEC 60028: R20 (1 + 0.00393/K (T - 20 °C))",
            reason="its stroke is computed at the temperature within 20 mK",
        ),
    ]


def _growth() -> list[Check]:
    """A gap of 100 um that a part of 20 mm widens."""
    case = read_valve_case(SMALL, Path("small.yaml"))
    hot = {"copper": 393.15, "ambient": AMBIENT}
    warm = warm_valve(build_valve(case), {aspect: hot for aspect in aspects_of(case)})
    return [
        check(
            "gap of 100 um grown by 20 mm of copper at 120 degC [m]",
            100e-6 + 20e-3 * 16.5e-6 * 100.0,
            warm.values["stop.gap"][0],
            1e-13,
            "g_0 + l alpha (T - T_ref)",
        ),
    ]
