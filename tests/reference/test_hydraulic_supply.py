"""Pages of shipped hydraulic and pneumatic cases say what these give.

The page of a hydraulic supply says what its case gives; truth: a run, the mean of the pump.

The page of a pneumatic valve says what its case gives; truth: a run, and mass that adds up.

The page of metering notches says what its case gives; truth of the areas: `klack verify`.

The page of injected mass says what its cases give; truth: forces over areas, test_delivery.py.

The page of a common rail says what its case gives; truth: Joukowsky, and the time of a wave.
"""

import re
import shlex
import warnings
from math import pi

import numpy as np
import pytest
from pages import HOW_TO, blocks, numbers, require_parts, run_of
from quoted_output import compare
from ruamel.yaml import YAML

from klack.analyses.operating_point.analysis import OPERATING_POINT
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case, read_valve_case
from klack.cli.main import main
from klack.simulation.network_run import simulate_network

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
        r"([\d.]+) J of shaft work the relief valve turns ([\d.]+) J into heat, the drain "
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


PAGE_VALVE = (HOW_TO / "pneumatic-valve.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result_valve():
    return run_of("pneumatic_valve.yaml")


def test_the_page_shows_parts_of_the_case_valve():
    require_parts(PAGE_VALVE, "pneumatic_valve.yaml")


def test_impacts_pressures_and_flows_are_those_of_the_page(result_valve):
    first = {
        stop: next(e for e in result_valve.events if e.stop == stop) for stop in ("opening", "seat")
    }
    open_at, open_speed, shut_at, shut_speed = numbers(
        PAGE_VALVE,
        r"meets the stop at ([\d.]+) ms with ([\d.]+) m/s and the seat at ([\d.]+) ms with "
        r"([\d.]+) m/s",
    )
    assert first["opening"].time == pytest.approx(open_at * 1e-3, abs=1e-6)
    assert first["opening"].approach_speed == pytest.approx(open_speed, abs=6e-3)
    assert first["seat"].time == pytest.approx(shut_at * 1e-3, abs=2e-6)
    assert first["seat"].approach_speed == pytest.approx(shut_speed, abs=6e-3)
    channels = result_valve.channels
    flow, pressure = numbers(
        PAGE_VALVE, r"up to ([\d.]+) g/s, and the working chamber reaches ([\d.]+) bar"
    )
    assert channels["throat mass flow"].values.max() == pytest.approx(flow * 1e-3, rel=3e-3)
    assert channels["working pressure"].values.max() == pytest.approx(pressure * 1e5, rel=1e-3)
    warm = numbers(PAGE_VALVE, r"heats the gas: here to ([\d.]+) K")[0]
    assert channels["working temperature"].values.max() == pytest.approx(warm, abs=0.6)
    begin = numbers(PAGE_VALVE, r"begins at ([\d.]+) bar")[0]
    assert channels["inlet pressure"].values[0] == pytest.approx(begin * 1e5, rel=1e-4)


def test_steady_flow_at_the_start_energy_and_mass(result_valve):
    channels = result_valve.channels
    flow = {
        name: channels[f"{name} mass flow"].values
        for name in ("line", "throat", "guide", "exhaust")
    }
    assert flow["line"][0] == pytest.approx(flow["throat"][0] + flow["guide"][0], rel=1e-9)
    assert flow["throat"][0] == pytest.approx(flow["exhaust"][0], rel=1e-6)
    assert result_valve.books.relative_residual <= 1e-11
    passed = {name: channels[f"{name} passed mass"].values for name in ("throat", "exhaust")}
    mass = channels["working mass"].values
    filled = passed["throat"] - passed["exhaust"]
    assert mass - mass[0] == pytest.approx(filled, abs=1e-9 * np.ptp(mass))


PAGE_SPOOL = (HOW_TO / "metering-notches.md").read_text(encoding="utf-8")
CHANNELS = {
    "edge opening": 1e3,
    "edge area": 1e6,
    "edge mass flow": 1e3,
    "edge jet force": 1.0,
    "room pressure": 1e-5,
}


def test_the_page_shows_the_edge_of_the_case():
    whole = YAML(typ="safe").load(HOW_TO / "notched_spool.yaml")
    (block,) = blocks(PAGE_SPOOL, "yaml-part")

    assert YAML(typ="safe").load(block)["edge"] == whole["network"]["components"]["edge"]


def test_the_table_is_that_of_a_run():
    case = load_valve_case(HOW_TO / "notched_spool.yaml")
    run = case.run
    rows = case.network.network().rows()
    result = simulate_network(rows, duration=run.duration, record=run.record)

    table = re.findall(r"^\| ([\d.]+) ms \|(.*)\|$", PAGE_SPOOL, re.MULTILINE)
    assert len(table) == 4
    for time, cells in table:
        place = int(np.argmin(np.abs(result.time - 1e-3 * float(time))))
        for cell, (name, factor) in zip(cells.split("|"), CHANNELS.items(), strict=True):
            told = cell.split()[0]
            digit = 10.0 ** -len(told.partition(".")[2])  # one of the last digit
            found = factor * result.channels[name].values[place]
            assert found == pytest.approx(float(told), rel=0.0, abs=digit), (time, name)
    assert result.books.relative_residual <= 1e-12


PAGE_RAIL = (HOW_TO / "common-rail.md").read_text(encoding="utf-8")
LINE, DIAMETER, START = 2.0, 3e-3, 150e5


@pytest.fixture(scope="module")
def case():
    return load_valve_case(HOW_TO / "common_rail.yaml")


@pytest.fixture(scope="module")
def result_rail(case):
    run = case.run
    return simulate_network(case.network.network().rows(), duration=run.duration, record=run.record)


def first_below(time, pressure, drop):
    return float(time[np.argmax(pressure < START - drop)])


def test_the_page_shows_the_include_of_the_case():
    whole = YAML(typ="safe").load(HOW_TO / "common_rail.yaml")
    (block,) = blocks(PAGE_RAIL, "yaml-part")
    assert YAML(typ="safe").load(block) == {"include": whole["include"]}


@pytest.mark.slow
def test_the_energy_balance_closes_and_its_entries_are_those_of_the_page_rail(result_rail):
    assert result_rail.books.relative_residual <= 1e-11
    pump, relief, leak = numbers(
        PAGE_RAIL,
        r"The pump supplies ([\d.]+) J, of which the relief valve turns ([\d.]+) J into heat and "
        r"the leakage of the pump ([\d.]+) J",
    )
    assert result_rail.books.supplies["pump shaft work"] == pytest.approx(pump, abs=0.05)
    assert result_rail.books.losses["relief flow"] == pytest.approx(relief, abs=0.05)
    assert result_rail.books.losses["pump leak flow"] == pytest.approx(leak, abs=0.05)
    for number in range(1, 5):
        assert result_rail.books.supplies[f"injector{number}_coil electric"] == pytest.approx(
            numbers(PAGE_RAIL, r"the coils take ([\d.]+) J each")[0], abs=5e-3
        )


@pytest.mark.slow
def test_the_first_wave_is_that_of_joukowsky_and_takes_its_time(case, result_rail):
    """Before any echo; the chamber at the seat delays the front by some 0.05 ms."""
    speed = float(case.network.network().fluid.sound_speed(START))
    assert speed == pytest.approx(numbers(PAGE_RAIL, r"a sound speed of ([\d.]+) m/s")[0], abs=1.0)
    time, way = result_rail.time, LINE / speed
    assert 1e3 * way == pytest.approx(
        numbers(PAGE_RAIL, r"The wave needs ([\d.]+) ms")[0], abs=0.005
    )
    own = result_rail.channels["injector1_body pressure"].values
    flow = result_rail.channels["injector1_holes mass flow"].values
    held = (time > 1.6e-3) & (time < 2.2e-3)  # open, pressure settled
    drop = START - own[held].mean()
    assert drop == pytest.approx(
        flow[held].mean() * speed / (pi * DIAMETER**2 / 4), rel=0.02
    )  # first order in dp/K, and the film of Zielke's friction
    assert drop == pytest.approx(1e5 * numbers(PAGE_RAIL, r"falls by ([\d.]+) bar")[0], abs=0.1e5)
    other = result_rail.channels["injector3_body pressure"].values
    begin = first_below(time, own, 0.5e5)
    assert begin + 2 * way < first_below(time, other, 0.5e5) < begin + 2 * way + 0.3e-3
    assert START - other[time < 7e-3].min() == pytest.approx(
        1e5 * numbers(PAGE_RAIL, r"at 4.5 ms, with ([\d.]+) bar")[0], abs=0.1e5
    )
    back = own[(time > begin + 2 * way) & (time < 6e-3)]
    assert back.max() - START == pytest.approx(
        1e5 * numbers(PAGE_RAIL, r"adds ([\d.]+) bar")[0], abs=0.6e5
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
def test_each_injector_injects_once_in_each_cycle(result_rail):
    least, most = numbers(PAGE_RAIL, r"between ([\d.]+) mg and ([\d.]+) mg: the mass")
    masses = injected(result_rail)
    for number in (1, 3, 4, 2):
        stops = [e for e in result_rail.events if e.stop == f"injector{number}_stop"]
        assert sum(event.approach_speed > 0.5 for event in stops) == 4
    assert min(masses) == pytest.approx(least, abs=0.01)
    assert max(masses) == pytest.approx(most, abs=0.01)


@pytest.mark.slow
def test_turbulent_friction_changes_the_injected_masses_as_little_as_the_page_says(result_rail):
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

    least, share = numbers(PAGE_RAIL, r"changes by more than ([\d.]+) mg, or ([\d.]+) %")
    masses = injected(result_rail)
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


PAGE_MASS = (HOW_TO / "injected-mass.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("number", range(4))
def test_the_page_of_injected_mass_says_what_its_commands_print(number, capsys, tmp_path):
    """A stroke, studies of one width and of two pulses, operating points with the same flow."""
    parts = re.findall(r"```\nklack ([^\n]*)\n```\n\n```\n(.*?)```", PAGE_MASS, re.DOTALL)
    command, quoted = [part for part in parts if "pressure_valve" not in part[0]][number]
    words = [
        str(HOW_TO / word[12:]) if word.startswith("docs/") else word
        for word in shlex.split(command)
    ]

    assert main([*words, "--out", str(tmp_path), "--no-report"]) == 0

    compare(quoted, capsys.readouterr().out, command)


def test_a_pressure_valve_opens_and_closes_where_its_page_says():
    """Preload and friction over the area within 2 % of both pressures; the page within a digit."""
    variant = run_stroke(load_valve_case(HOW_TO / "pressure_valve.yaml")).reference
    edge, area = variant.deliveries["edge"], pi / 4 * 25e-6
    assert edge.opening_pressure == pytest.approx(38.3 / area, rel=0.02)
    assert edge.closing_pressure == pytest.approx(36.3 / area, rel=0.02)
    for name, value, factor in (
        ("edge.opening_pressure", edge.opening_pressure, 1e-5),
        ("edge.closing_pressure", edge.closing_pressure, 1e-5),
        ("edge.hysteresis", edge.hysteresis, 1e-5),
        ("edge.peak_flow", edge.peak_flow, 1e3),
        ("leak.initial_flow", variant.deliveries["leak"].initial_flow, 1e6),
    ):
        said = numbers(PAGE_MASS, rf"`{name}` . ([\d.]+) ")[0]
        assert value * factor == pytest.approx(said, rel=5e-3)
