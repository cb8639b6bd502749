"""A rigid valve with hidden values, and the strokes that it would show: a small calibration.

Truth is its own model at a finer step with parameters that differ from stroke to stroke, and noise.
"""

from pathlib import Path

import numpy as np

from klack.case.any_case import CaseTree
from klack.case.reader import parse
from klack.measurement.channels import LiftSensor
from klack.measurement.lift_sensor import sense
from klack.measurement.stroke_measures import MeasuredStroke, StrokeSet
from klack.simulation.network_run import simulate_network

TEXT = """
klack: 1
title: Rigid valve
network:
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [tip, top]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    stop: {type: end-stop, gap: 80 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 10 N/mm, preload: 11 N}
    guide: {type: guide-friction, coulomb: 0.8 N}
    magnet:
      type: force-over-time
      time: [0 us, 50 us, 900 us, 950 us]
      force: [0 N, 30 N, 30 N, 0 N]
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [needle.top, stop.lower, spring.end, magnet.end, guide.body]
    - [stop.upper, ground]
run: {duration: 1.5 ms, step: 0.2 us, coarse: 8, record: 2 us, variants: [dry]}
measurement:
  zero: none
  sensor: {bandwidth: 100 kHz, offset: 0 um}
calibration:
  variant: dry
  parameters:
    preload: {key: network.components.spring.preload, lower: 8 N, upper: 16 N}
    friction: {key: network.components.guide.coulomb, lower: 0 N, upper: 3 N}
    offset: {key: measurement.sensor.offset, lower: -10 um, upper: 10 um}
  profile: [friction]
"""
RELIEF_VALVE = """
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
"""A poppet behind a pipe whose supply rises slowly above its spring."""

NO_PROFILE = TEXT.replace("  profile: [friction]\n", "")
TRUTH = np.array([12.4, 0.5, 2.5e-6])
SCATTER = np.array([0.06, 0.05, 0.2e-6])
STROKES, NOISE = 6, 0.5e-6


def tree_of(text=TEXT):
    path = Path("rigid.yaml")
    data, lines = parse(text, path)
    return CaseTree(path=path, text=text, data=data, lines=lines)


def lift_of(tree, preload, friction, offset, grid):
    case = tree.case(
        {
            ("network", "components", "spring", "preload"): f"{preload!r} N",
            ("network", "components", "guide", "coulomb"): f"{friction!r} N",
        }
    )
    result = simulate_network(
        case.network.network().rows(), duration=1.5e-3, step=50e-9, coarse=32, record=2e-6
    )
    true = result.channels["needle.tip displacement"].values
    sensor = LiftSensor(bandwidth=100e3, offset=offset)
    return np.interp(grid, result.time, sense(result.time, true, sensor))


def measured(seed, count=STROKES, begin=0.0, text=TEXT):
    rng = np.random.default_rng(seed)
    grid = 2e-6 * np.arange(round(begin / 2e-6), 700)
    strokes = []
    for k in range(count):
        values = TRUTH + SCATTER * rng.standard_normal(3)
        lift = lift_of(tree_of(text), *map(float, values), grid)
        lift += NOISE * rng.standard_normal(grid.size)
        strokes.append(MeasuredStroke(name=f"#{k + 1}", values={"lift": lift}))
    return StrokeSet(source="computed", time=grid, strokes=tuple(strokes))


def write_bench(folder, seed, count):
    """Write ``valve.yaml`` and ``strokes.csv``, one column for each stroke."""
    channels = "measurement:\n  channels: {lift: 'lift_*'}\n"
    text = NO_PROFILE.replace("measurement:\n", channels) + "  # the end\n"
    (folder / "valve.yaml").write_text(text)
    strokes = measured(seed, count=count)
    table = np.column_stack([strokes.time, *strokes.matrix("lift")])
    head = "time [s]," + ",".join(f"lift_{i} [m]" for i in range(count))
    np.savetxt(folder / "strokes.csv", table, delimiter=",", header=head, comments="", fmt="%.9e")
