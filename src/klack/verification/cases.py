"""Case files: quantities in SI, expressions, parameters and included parts of networks."""

from collections.abc import Iterator
from math import pi, sin, sqrt
from pathlib import Path

import numpy as np

from klack.case.any_case import read_valve_case
from klack.case.expressions.expression import Expression
from klack.case.valve import ValveCase
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, check

__all__ = ["checks"]


_SI = "BIPM, The International System of Units, 9th ed. (2019), Table 8"
_NIST = "Thompson & Taylor, NIST SP 811 (2008), App. B.8"


def checks() -> list[Check]:
    """Return the checks."""
    return [*_expressions(), *_oscillators(), *_written_out()]


def _expressions() -> Iterator[Check]:
    inch, pound = 0.0254, 4.4482216152605
    for name, text, expected, unit, source in (
        ("1 inch", "1 inch", inch, "m", _NIST),
        ("1 lbf", "1 lbf", pound, "N", _NIST),
        ("1 psi", "1 psi", pound / inch**2, "Pa", _NIST),
        ("1 l/min", "1 l/min", 1e-3 / 60.0, "m^3/s", _SI),
        ("1 km/h", "1 km/h", 1.0 / 3.6, "m/s", _SI),
        ("180 deg", "180 deg", pi, "rad", _SI),
        ("3000 rpm", "3000 rpm", 50.0, "1/s", _SI),
        ("20 degC", "20 degC", 293.15, "K", _SI),
        (
            "rate of a helical spring, 80 GPa, 1.2 mm wire, 8 mm, 6 coils",
            "80 GPa * (1.2 mm)^4 / (8 * (8 mm)^3 * 6)",
            6750.0,
            "N/m",
            "Budynas & Nisbett, Shigley's Mechanical Engineering Design (2011), eq. 10-9",
        ),
        (
            "natural frequency of 3 g on that spring",
            "sqrt(6.75 N/mm / 3 g) / (2 * pi)",
            750.0 / pi,
            "Hz",
            "sqrt(k / m) / (2 pi), k / m = 1500^2 / s^2",
        ),
        (
            "speed of a jet from 200 bar, 800 kg/m^3",
            "sqrt(2 * 200 bar / (0.8 g/cm^3))",
            sqrt(5e4),
            "m/s",
            "Torricelli, sqrt(2 p / rho)",
        ),
        (
            "lift that opens a cone of 90 deg as wide as a bore of 0.8 mm, seat of 1.6 mm",
            "pi/4 * (0.8 mm)^2 / (pi * 1.6 mm * sin(90 deg / 2))",
            1e-4 / sin(pi / 4),
            "m",
            "pi d_b^2 / 4 = pi d_s h sin(alpha / 2)",
        ),
    ):
        found = Expression.parse(text)
        computed = found.value({}) if found.unit({}).fits(unit) else float("nan")
        yield check(f"{name} [{unit}]", expected, computed, 1e-14, source)


_OSCILLATOR = """klack: 1
part: A mass on a spring, pulled by a force that rises and stays
parameters: {m: , k: 10 N/mm, F: 10 N}
components:
  mass: {type: rigid-mass, mass: = m, points: [a]}
  spring: {type: spring, stiffness: = k, preload: 0 N}
  pull: {type: force-over-time, time: [0 us, 100 us], force: [0 N, = F]}
ports: {a: mass.a}
connections: [[mass.a, spring.end, pull.end]]
"""
_OSCILLATORS = """klack: 1
title: Three masses
parameters: {m: 1 g}
include: [{file: oscillator.yaml, as: copy, count: 3, with: {m: m * number^2}}]
network: {components: {}, connections: []}
run: {duration: 2 ms, lift: copy1_mass.a}
"""


def _oscillators() -> Iterator[Check]:
    """Response to a ramp of a force that stays, of three copies with masses of 1, 4 and 9 g."""
    case = _case(_OSCILLATORS, {"oscillator.yaml": _OSCILLATOR})
    result = simulate_network(case.network.network().rows(), duration=2e-3, coarse=1, record=1e-6)
    t, rise, static = result.time, 100e-6, 10.0 / 1e4
    for number in (1, 2, 3):
        omega = sqrt(1e4 / (1e-3 * number**2))
        ramp = (
            np.minimum(t, rise)
            - (np.sin(omega * t) - np.sin(omega * np.maximum(t - rise, 0.0))) / omega
        )
        found = result.channels[f"copy{number}_mass.a displacement"].values
        yield check(
            f"copy {number} of an included mass on a spring, deviation from its response to a ramp "
            "over 2 ms, relative to the static displacement",
            0.0,
            float(np.abs(found - static * ramp / rise).max() / static),
            (2e-8, 5e-9, 2e-9)[number - 1],
            "F/k (min(t, t_1) - (sin w t - sin w max(t - t_1, 0)) / w) / t_1, w^2 = k / m",
        )


_INJECTOR = """klack: 1
part: An injector
parameters: {lift: , delay: 0 us, d_seat: 1.2 mm}
ports: {inlet: bore.a}
components:
  needle: {type: rigid-mass, mass: 3 g, points: [tip]}
  seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e9 N/m}, restitution: 0.5}
  top: {type: end-stop, gap: = lift, law: {kind: linear, stiffness: 1e9 N/m}, restitution: 0.5}
  spring: {type: spring, stiffness: 10 N/mm, preload: 20 N}
  magnet: {type: force-over-time, time: [= 10 us + delay, = 20 us + delay], force: [0 N, 60 N]}
  bore: {type: orifice, diameter: 1 mm}
  chamber: {type: chamber, volume: 50 mm^3}
  face: {type: pressure-face, direction: closing, area: = pi/4 * d_seat^2}
  nozzle: {type: seat, shape: cone, diameter: = d_seat, half_angle: 45 deg}
connections:
  - [needle.tip, seat.upper, nozzle.needle, top.lower, spring.end, magnet.end, face.body]
  - [seat.lower, ground]
  - [top.upper, ground]
  - [bore.b, chamber.fluid, face.fluid, nozzle.a]
  - [nozzle.b, ambient]
"""
_RAIL = """klack: 1
title: Four injectors on one rail
{head}network:
  fluid: n-heptane
  components:
    pump: {{type: pressure-source, pressure: 50 bar}}
    supply: {{type: orifice, diameter: 0.8 mm}}
    rail: {{type: chamber, volume: 2 cm^3, pressure: 50 bar}}
{components}  connections:
    - [pump.fluid, supply.a]
    - [supply.b, rail.fluid, {inlets}]
{connections}run: {{duration: 600 us, lift: injector1_needle.tip}}
"""
_HEAD = """parameters: {lift: 80 um}
include:
  - {file: injector.yaml, as: injector, count: 4, with: {lift: lift, delay: 100 us * (number - 1)}}
"""


def _written_out() -> Iterator[Check]:
    """Four included injectors against the same network written out."""
    included = _RAIL.format(head=_HEAD, components="", inlets="injector*.inlet", connections="")
    runs = [
        simulate_network(case.network.network().rows(), duration=600e-6, record=1e-6)
        for case in (
            _case(included, {"injector.yaml": _INJECTOR}),
            read_valve_case(_by_hand(), Path("rail.yaml")),
        )
    ]
    for number in range(1, 5):
        forces = [
            next(event for event in run.events if event.stop == f"injector{number}_top").peak_force
            for run in runs
        ]
        yield check(
            f"injector {number} of four included ones, peak force at the stop [N]",
            forces[1],
            forces[0],
            0.0,
            "the same network written out by hand, to the bit",
        )


def _by_hand() -> str:
    """The same without parameters and parts."""
    components, connections, inlets = "", "", []
    head, tail = _INJECTOR.split("components:\n")[1].split("connections:\n")
    for number in range(1, 5):
        name, start = f"injector{number}_", 10 + 100 * (number - 1)
        lines = head.replace("= lift", "80 um").replace("= 10 us + delay", f"{start} us")
        lines = lines.replace("= 20 us + delay", f"{start + 10} us").replace("= d_seat,", "1.2 mm,")
        lines = lines.replace("= pi/4 * d_seat^2", "1.13097335529233 mm^2")
        components += "".join(f"    {name}{line.strip()}\n" for line in lines.splitlines())
        for line in tail.splitlines():
            ports = line.strip().removeprefix("- [").removesuffix("]").split(", ")
            named = (port if "." not in port else name + port for port in ports)
            connections += f"    - [{', '.join(named)}]\n"
        inlets.append(f"{name}bore.a")
    return _RAIL.format(
        head="", components=components, inlets=", ".join(inlets), connections=connections
    )


def _case(text: str, parts: dict[str, str]) -> ValveCase:
    kept = "".join(
        f"  {name}: |\n" + "".join(f"    {line}\n" for line in part.splitlines())
        for name, part in parts.items()
    )
    return read_valve_case(f"{text}parts:\n{kept}", Path("case.yaml"))
