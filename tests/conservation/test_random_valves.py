"""Truth: energy is conserved, in any sensible valve; and any sensible valve runs.

The draws are those of ``benchmarks/random_valves.py``, which runs as many as wanted.
"""

from pathlib import Path

import pytest
from draws import program
from rigid_valve import RELIEF_VALVE

from klack.case.any_case import read_valve_case
from klack.errors import AccuracyWarning
from klack.simulation.network_result import IncompleteRunError

DRAWS = program("random_valves")

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
        pytest.warns(AccuracyWarning, match="'coil': at 116.5 us the gap leaves the range"),
        pytest.raises(IncompleteRunError, match=r"coil: the gap is -16.* um at 119.* us, far out"),
    ):
        DRAWS["residuals"](case)


BALANCED = RELIEF_VALVE.replace("damping: 2 N", "damping: 60 N").replace(
    "duration: 95 ms, step: 200 ns", "duration: 14 ms, step: 500 ns"
)


def test_forces_that_hold_each_other_settle():
    """Lifted by a slow pressure against its spring: nothing is left of 157 N but round-off."""
    assert DRAWS["residuals"](read_valve_case(BALANCED, Path("balanced.yaml")))["wet"] <= 1e-9
