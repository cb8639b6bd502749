"""Truth: conservation of energy, and the mean value theorem for the pressures of one step.

A relief valve that chatters empties its chamber until it boils, and fills it again and again.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.case.reader import parse, validated
from klack.case.valve import ValveCase
from klack.simulation.network_kernel import _bracketed
from klack.simulation.network_run import simulate_network

CASE = """
klack: 1
title: relief poppet with inlet pipe
network:
  fluid: {name: oil, density: 860 kg/m^3, bulk_modulus: 1.4 GPa, bulk_modulus_slope: 0.01,
          kinematic_viscosity: 10 mm^2/s, gas_fraction: 0}
  components:
    tank:
      type: pressure-source
      table: {time: [0 ms, 1 ms, 21 ms], pressure: [15 bar, 15 bar, 26 bar]}
    pipe: {type: line, length: 2.0 m, diameter: 10 mm, pressure: 25 bar, friction: none}
    inlet: {type: chamber, volume: 500 mm^3, pressure: 15 bar}
    out:
      {type: seat, shape: cone, diameter: 10 mm, half_angle: 45 deg, discharge: 0.7,
       cavitation: null}
    face: {type: pressure-face, direction: opening, outer_diameter: 10 mm}
    poppet: {type: rigid-mass, mass: 20 g, points: [nose]}
    spring: {type: spring, stiffness: 20 N/mm, preload: 157.0796 N, damping: 2 N*s/m}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 5e7 N/m}, restitution: 0.3}
    stop: {type: end-stop, gap: 3 mm, law: {kind: linear, stiffness: 5e7 N/m}, restitution: 0.3}
  connections:
    - [tank.fluid, pipe.a]
    - [pipe.b, inlet.fluid, out.a, face.fluid]
    - [out.b, ambient]
    - [poppet.nose, seat.upper, stop.lower, spring.end, face.body, out.needle]
    - [ground, seat.lower]
    - [ground, stop.upper]
    - [ground, spring.base]
    - [ground, out.body]
run: {duration: 95 ms, step: 200 ns, record: 5 us, variants: [wet], lift: poppet.nose}
"""


def test_a_chattering_valve_runs_through_cavitation():
    data, lines = parse(CASE, Path("relief.yaml"))
    case = validated(ValveCase, CASE, Path("relief.yaml"), data, lines)
    run = case.run
    result = simulate_network(
        case.network.network().rows(), duration=run.duration, step=run.step, record=run.record
    )
    pressure = result.channels["inlet pressure"].values

    assert result.time[-1] == pytest.approx(run.duration, rel=1e-4)
    assert pressure.min() < 3e3  # it boils
    assert pressure.max() > 30e5  # and the poppet shuts it off
    assert result.books.relative_residual < 1e-9


def test_a_root_between_two_misleading_slopes_is_found():
    """Newton alone goes to and fro for ever on a kink like that between boiling and liquid."""

    def step(x: float) -> float:
        """Newton step of a falling function with its root at 0.9, steep above 1."""
        value, slope = (0.9 - x, -1.0) if x < 0.95 else (-0.05 - 1e-3 * (x - 0.95), -1e-3)
        return -value / slope

    x, lower, upper = 2.0, 0.0, np.inf
    for _ in range(60):
        x, lower, upper = _bracketed(x + step(x), x, lower, upper)
    assert x == pytest.approx(0.9, abs=1e-12)
