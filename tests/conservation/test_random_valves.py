"""Truth: energy is conserved, in any sensible valve; and any sensible valve runs.

The draws are those of ``benchmarks/random_valves.py``, which runs as many as wanted.
"""

import runpy
from pathlib import Path

import pytest

from klack.case.valve_reader import read_valve_case
from klack.errors import AccuracyWarning
from klack.simulation.network_result import IncompleteRunError

ROOT = Path(__file__).parents[2]
DRAWS = runpy.run_path(str(ROOT / "benchmarks" / "random_valves.py"))

# 4, 16: plain ones; 58, 156, 227: no drop at a wide feed when the supply steps; 159: a needle
# pressed on its seat with far more than what moves it
SAMPLE = (*range(14), 58, 156, 159, 227)

# 300, 1076: a preloaded needle that ends between two steps; 262, 726: a film that pulls; 195: a
# dashpot that has let go of its stop, which is still compressed
UNSEEN = (195, 262, 300, 726, 1076)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", SAMPLE)
def test_a_random_valve_runs_and_keeps_its_energy(seed):
    case = read_valve_case(DRAWS["draw"](seed), Path(f"draw{seed}.yaml"))

    residuals = DRAWS["residuals"](case)

    assert set(residuals) == set(case.run.variants)
    assert max(residuals.values()) <= 1e-9


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", UNSEEN)
def test_what_is_left_of_the_sweeps_is_counted(seed):
    """What the sweeps leave is 5e-5 of the way, times the whole force: above 1e-9 uncounted."""
    case = read_valve_case(DRAWS["draw"](seed), Path(f"draw{seed}.yaml"))

    assert max(DRAWS["residuals"](case).values()) <= 1e-10


def test_a_magnet_that_pulls_through_its_stop_ends_the_run_with_gap_and_time():
    """It pulls harder the deeper it presses: no equation fails before the range is named."""
    case = read_valve_case(DRAWS["draw"](744), Path("draw744.yaml"))

    with (
        pytest.warns(AccuracyWarning, match="'coil': at 116.2 us the gap leaves the range"),
        pytest.raises(IncompleteRunError, match=r"coil: the gap is -14.* um at 118.* us, far out"),
    ):
        DRAWS["residuals"](case)


BALANCED = """
klack: 1
title: a poppet whose spring and pressure balance
network:
  fluid: {name: oil, density: 860 kg/m^3, bulk_modulus: 1.4 GPa, bulk_modulus_slope: 0.01,
    kinematic_viscosity: 10 mm^2/s, gas_fraction: 0}
  components:
    tank: {type: pressure-source, table: {time: [0 ms, 1 ms, 21 ms], pressure: [15 bar, 15 bar,
      26 bar]}}
    pipe: {type: line, length: 2.0 m, diameter: 10 mm, pressure: 25 bar, friction: none}
    inlet: {type: chamber, volume: 500 mm^3, pressure: 15 bar}
    out: {type: seat, shape: cone, diameter: 10 mm, half_angle: 45 deg, discharge: 0.7,
      cavitation: null}
    face: {type: pressure-face, direction: opening, outer_diameter: 10 mm}
    poppet: {type: rigid-mass, mass: 20 g, points: [nose]}
    spring: {type: spring, stiffness: 20 N/mm, preload: 157.0796 N, damping: 60 N*s/m}
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
run: {duration: 14 ms, step: 500 ns, record: 5 us, variants: [wet], lift: poppet.nose}
"""


def test_forces_that_hold_each_other_settle():
    """Lifted by a slow pressure against its spring: nothing is left of 157 N but round-off."""
    case = read_valve_case(BALANCED, Path("balanced.yaml"))

    assert DRAWS["residuals"](case)["wet"] <= 1e-9
