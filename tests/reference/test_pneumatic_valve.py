"""The page of a pneumatic valve says what its case gives; truth: a run, and mass that adds up."""

import numpy as np
import pytest
from pages import HOW_TO, numbers, require_parts, run_of

PAGE = (HOW_TO / "pneumatic-valve.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result():
    return run_of("pneumatic_valve.yaml")


def test_the_page_shows_parts_of_the_case():
    require_parts(PAGE, "pneumatic_valve.yaml")


def test_impacts_pressures_and_flows_are_those_of_the_page(result):
    first = {stop: next(e for e in result.events if e.stop == stop) for stop in ("opening", "seat")}
    open_at, open_speed, shut_at, shut_speed = numbers(
        PAGE,
        r"meets the stop at ([\d.]+) ms with ([\d.]+) m/s and the seat at ([\d.]+) ms with "
        r"([\d.]+) m/s",
    )
    assert first["opening"].time == pytest.approx(open_at * 1e-3, abs=1e-6)
    assert first["opening"].approach_speed == pytest.approx(open_speed, abs=6e-3)
    assert first["seat"].time == pytest.approx(shut_at * 1e-3, abs=2e-6)
    assert first["seat"].approach_speed == pytest.approx(shut_speed, abs=6e-3)
    channels = result.channels
    flow, pressure = numbers(
        PAGE, r"up to ([\d.]+) g/s, and the working chamber reaches ([\d.]+) bar"
    )
    assert channels["throat mass flow"].values.max() == pytest.approx(flow * 1e-3, rel=3e-3)
    assert channels["working pressure"].values.max() == pytest.approx(pressure * 1e5, rel=1e-3)
    warm = numbers(PAGE, r"heats the gas: here to ([\d.]+) K")[0]
    assert channels["working temperature"].values.max() == pytest.approx(warm, abs=0.6)
    begin = numbers(PAGE, r"begins at ([\d.]+) bar")[0]
    assert channels["inlet pressure"].values[0] == pytest.approx(begin * 1e5, rel=1e-4)


def test_steady_flow_at_the_start_energy_and_mass(result):
    channels = result.channels
    flow = {
        name: channels[f"{name} mass flow"].values
        for name in ("line", "throat", "guide", "exhaust")
    }
    assert flow["line"][0] == pytest.approx(flow["throat"][0] + flow["guide"][0], rel=1e-9)
    assert flow["throat"][0] == pytest.approx(flow["exhaust"][0], rel=1e-6)
    assert result.books.relative_residual <= 1e-11
    # flows are those of the last step of a record: the trapezoidal rule sums them up
    net = flow["throat"] - flow["exhaust"]
    filled = np.concatenate([[0.0], np.cumsum(0.5 * (net[1:] + net[:-1]) * np.diff(result.time))])
    mass = channels["working mass"].values
    assert mass - mass[0] == pytest.approx(filled, abs=2e-3 * np.ptp(mass))
