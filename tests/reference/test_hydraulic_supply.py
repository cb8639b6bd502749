"""The page of a hydraulic supply says what its case gives; truth: a run, the mean of the pump."""

import numpy as np
import pytest
from pages import HOW_TO, numbers, require_parts, run_of

PAGE = (HOW_TO / "hydraulic-supply.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result():
    return run_of("hydraulic_supply.yaml")


def test_the_page_shows_parts_of_the_case():
    require_parts(PAGE, "hydraulic_supply.yaml")


def test_the_energy_balance_closes_and_its_entries_are_those_of_the_page(result):
    assert result.books.relative_residual <= 1e-12
    shaft, relief, drain, leak = numbers(
        PAGE,
        r"of ([\d.]+) J of the shaft the relief valve turns ([\d.]+) J into heat, the drain "
        r"([\d.]+) J and the leakage of the pump ([\d.]+) J",
    )
    losses = result.books.losses
    assert result.books.supplies["pump shaft work"] == pytest.approx(shaft, abs=0.05)
    assert losses["relief flow"] == pytest.approx(relief, abs=0.05)
    assert losses["drain flow"] == pytest.approx(drain, abs=0.05)
    assert losses["pump leak flow"] == pytest.approx(leak, abs=0.05)


def test_pressures_flows_and_the_impact_are_those_of_the_page(result):
    rail = result.channels["rail pressure"].values / 1e5
    start, lowest = (
        numbers(PAGE, r"at ([\d.]+) bar, and the accumulator")[0],
        numbers(PAGE, r"falls to ([\d.]+)")[0],
    )
    assert rail[0] == pytest.approx(start, abs=0.05)
    assert rail.min() == pytest.approx(lowest, abs=0.05)
    delivered = -result.channels["accumulator mass flow"].values.min() / 855.0 * 6e4
    assert delivered == pytest.approx(numbers(PAGE, r"delivers up to ([\d.]+) l/min")[0], abs=0.1)
    first = result.events[0]
    time, speed = numbers(PAGE, r"meets the stop at ([\d.]+) ms with ([\d.]+) m/s")
    assert (first.stop, first.time) == ("stop", pytest.approx(time * 1e-3, abs=5e-6))
    assert first.approach_speed == pytest.approx(speed, abs=0.05)


def test_the_pump_delivers_its_mean_and_the_ripple_its_order(result):
    flow = result.channels["pump displaced flow"].values[1:]
    # 40 ms is one turn; a record has the flow of its last step, which is shorter about a touch
    assert flow.mean() == pytest.approx(250e-6, rel=1e-7, abs=0.0)
    assert 1 + np.argmax(np.abs(np.fft.rfft(flow))[1:]) == 18
