"""The page of a common rail says what its case gives; truth: Joukowsky, and the time of a wave."""

import re
import warnings
from math import pi

import numpy as np
import pytest
from pages import HOW_TO, blocks, numbers
from ruamel.yaml import YAML

from klack.analyses.operating_point.analysis import OPERATING_POINT
from klack.case.any_case import load_valve_case, read_valve_case
from klack.cli.main import main
from klack.simulation.network_run import simulate_network

PAGE = (HOW_TO / "common-rail.md").read_text(encoding="utf-8")
LINE, DIAMETER, START = 2.0, 3e-3, 150e5


@pytest.fixture(scope="module")
def case():
    return load_valve_case(HOW_TO / "common_rail.yaml")


@pytest.fixture(scope="module")
def result(case):
    run = case.run
    return simulate_network(case.network.network().rows(), duration=run.duration, record=run.record)


def first_below(time, pressure, drop):
    return float(time[np.argmax(pressure < START - drop)])


def test_the_page_shows_the_include_of_the_case():
    whole = YAML(typ="safe").load(HOW_TO / "common_rail.yaml")
    (block,) = blocks(PAGE, "yaml-part")
    assert YAML(typ="safe").load(block) == {"include": whole["include"]}


@pytest.mark.slow
def test_the_energy_balance_closes_and_its_entries_are_those_of_the_page(result):
    assert result.books.relative_residual <= 1e-11
    pump, relief, leak = numbers(
        PAGE,
        r"Of the ([\d.]+) J of the pump the relief valve turns ([\d.]+) J into heat and the "
        r"leakage of the pump ([\d.]+) J",
    )
    assert result.books.supplies["pump shaft work"] == pytest.approx(pump, abs=0.05)
    assert result.books.losses["relief flow"] == pytest.approx(relief, abs=0.05)
    assert result.books.losses["pump leak flow"] == pytest.approx(leak, abs=0.05)
    for number in range(1, 5):
        assert result.books.supplies[f"injector{number}_coil electric"] == pytest.approx(
            numbers(PAGE, r"the coils take ([\d.]+) J each")[0], abs=5e-3
        )


@pytest.mark.slow
def test_the_first_wave_is_that_of_joukowsky_and_takes_its_time(case, result):
    """Before any echo; the chamber at the seat delays the front by some 0.05 ms."""
    speed = float(case.network.network().fluid.sound_speed(START))
    assert speed == pytest.approx(numbers(PAGE, r"a sound speed of ([\d.]+) m/s")[0], abs=1.0)
    time, way = result.time, LINE / speed
    assert 1e3 * way == pytest.approx(numbers(PAGE, r"The wave needs ([\d.]+) ms")[0], abs=0.005)
    own = result.channels["injector1_body pressure"].values
    flow = result.channels["injector1_holes mass flow"].values
    held = (time > 1.6e-3) & (time < 2.2e-3)  # open, pressure settled
    drop = START - own[held].mean()
    assert drop == pytest.approx(
        flow[held].mean() * speed / (pi * DIAMETER**2 / 4), rel=0.02
    )  # first order in dp/K, and the film of Zielke's friction
    assert drop == pytest.approx(1e5 * numbers(PAGE, r"falls by ([\d.]+) bar")[0], abs=0.1e5)
    other = result.channels["injector3_body pressure"].values
    begin = first_below(time, own, 0.5e5)
    assert begin + 2 * way < first_below(time, other, 0.5e5) < begin + 2 * way + 0.3e-3
    assert START - other[time < 7e-3].min() == pytest.approx(
        1e5 * numbers(PAGE, r"at 4.5 ms, with ([\d.]+) bar")[0], abs=0.1e5
    )
    back = own[(time > begin + 2 * way) & (time < 6e-3)]
    assert back.max() - START == pytest.approx(
        1e5 * numbers(PAGE, r"adds ([\d.]+) bar")[0], abs=0.6e5
    )


def injected(result) -> np.ndarray:
    """Mass of each injection [mg], by injector and cycle."""
    time, cycle = result.time, 25e-3
    masses = []
    for place, number in enumerate((1, 3, 4, 2)):
        flow = result.channels[f"injector{number}_holes mass flow"].values
        for turn in range(4):
            start = 1e-3 + (turn + place / 4) * cycle
            inside = (time > start) & (time <= start + cycle / 4)
            masses.append(1e6 * float(flow[inside].sum() * (time[1] - time[0])))
    return np.array(masses)


@pytest.mark.slow
def test_each_injector_injects_once_in_each_cycle(result):
    least, most = numbers(PAGE, r"between ([\d.]+) mg and ([\d.]+) mg: the mass")
    masses = injected(result)
    for number in (1, 3, 4, 2):
        stops = [e for e in result.events if e.stop == f"injector{number}_stop"]
        assert sum(event.approach_speed > 0.5 for event in stops) == 4
    assert min(masses) == pytest.approx(least, abs=0.01)
    assert max(masses) == pytest.approx(most, abs=0.01)


@pytest.mark.slow
def test_turbulent_friction_changes_the_injected_masses_as_little_as_the_page_says(result):
    laminar = (HOW_TO / "common_rail.yaml").read_text(encoding="utf-8")
    lines = r"(type: line, .*pressure: = p_rail)"
    text, count = re.subn(lines, r"\1, friction: turbulent, roughness: 1.5 um", laminar)
    assert count == 5
    case = read_valve_case(text, HOW_TO / "common_rail.yaml")

    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="(?s).*Reynolds")
        turbulent = simulate_network(
            case.network.network().rows(), duration=case.run.duration, record=case.run.record
        )

    least, share = numbers(PAGE, r"changes by more than ([\d.]+) mg, or ([\d.]+) %")
    masses = injected(result)
    change = np.abs(injected(turbulent) - masses)
    assert 0.5 * least < change.max() < least + 5e-3
    assert (change / masses).max() < 1e-2 * share


@pytest.mark.slow
def test_at_rest_the_relief_valve_passes_what_the_pump_delivers(tmp_path, monkeypatch):
    """Behind closed injectors nothing flows, which is no reason to find no operating point."""
    monkeypatch.chdir(tmp_path)
    words = ["--steady", "--no-report", "--quiet", "--out", "out"]
    assert main(["stroke", str(HOW_TO / "common_rail.yaml"), *words]) == 0

    point = OPERATING_POINT.load(tmp_path / "out")
    value = {(x.component, x.quantity): x.values[0] for x in point.quantities}
    pump, leak = value["pump", "mass flow"], value["pump", "leak mass flow"]
    assert value["relief", "mass flow"] == pytest.approx(pump + leak, rel=1e-12)
    assert 145e5 < value["rail", "pressure"] < 155e5  # set and rated pressure of the relief valve
    assert value["rail", "pressure"] == pytest.approx(value["outlet", "pressure"], rel=1e-12)
