"""Truth: conservation of energy, and the mean value theorem for the pressures of one step.

A relief valve that chatters empties its chamber until it boils, and fills it again and again.
"""

from pathlib import Path

import numpy as np
import pytest
from rigid_valve import RELIEF_VALVE

from klack.case.reader import parse, validated
from klack.case.valve import ValveCase
from klack.simulation.network_pressures import bracketed
from klack.simulation.network_run import simulate_network


def test_a_chattering_valve_runs_through_cavitation():
    data, lines = parse(RELIEF_VALVE, Path("relief.yaml"))
    case = validated(ValveCase, RELIEF_VALVE, Path("relief.yaml"), data, lines)
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
        x, lower, upper = bracketed(x + step(x), x, lower, upper)
    assert x == pytest.approx(0.9, abs=1e-12)
