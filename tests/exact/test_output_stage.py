"""Boost capacitor and output stage; truth: energy balance, limits by hand, numbers of the page."""

import re
from pathlib import Path

import numpy as np
import pytest
from draws import each
from ruamel.yaml import YAML

from klack.case.any_case import load_valve_case, read_valve_case
from klack.errors import InputError
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.driver import When
from klack.magnetics.remanent_start import remanent_state
from klack.network.rows import Book
from klack.simulation.network_run import simulate_network
from klack.verification.drivers import injector, linear_coil
from klack.verification.output_stage import random_driver, run_stage

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
PAGE = " ".join((HOW_TO / "boost-capacitor.md").read_text(encoding="utf-8").split())
USUAL = {
    "battery": 14.0,
    "capacitance": 20e-6,
    "boost_voltage": 65.0,
    "recharge_power": 10.0,
    "peak_current": 10.0,
    "hold_current": 3.0,
    "hold_band": 1.0,
    "shots": (Shot(start=0.0, end=0.5e-3), Shot(start=0.6e-3, end=0.9e-3)),
}


@pytest.fixture(scope="module")
def case():
    return load_valve_case(HOW_TO / "boost_driver.yaml")


@pytest.fixture(scope="module")
def result(case):
    return simulate_network(case.network.network().rows(), duration=case.run.duration, record=1e-6)


@pytest.mark.slow
@each("seed", range(20, 32))
@each("step", [1e-7, 1.28e-6, 10e-6])
def test_random_stages_balance_at_any_step(seed, step):
    plant = injector() if seed % 2 else linear_coil()
    time = step * np.arange(round(0.9e-3 / step) + 1)
    lift = 60e-6 * np.clip((time - 0.1e-3) / 0.2e-3, 0.0, 1.0)
    if step < 1e-6:  # a part of it is enough
        lift = lift[:1500]

    run = run_stage(
        plant, random_driver(seed), step=step, duration=step * (lift.size - 1), lift=lift
    )

    assert run.residual < 1e-11
    for name in ("ohmic", "eddy", "switches", "diodes", "clamp", "converter"):
        assert run.energies[name] >= -1e-15
    assert np.all(run.current >= 0.0)
    assert np.all(run.capacitor >= 0.0)


@pytest.mark.slow
def test_a_capacitor_that_is_empty_at_the_start_leaves_the_boost_to_the_battery():
    driver = BoostDriver(**USUAL | {"start_voltage": 5.0, "recharge_power": 0.0})

    run = run_stage(linear_coil(), driver, step=1e-6, duration=0.1e-3)

    assert run.capacitor[-1] == 5.0
    rate = 0.5 / (60.0**2 * (1 / 2e7 + 1 / 2e8))
    assert run.current[-1] == pytest.approx(13.3 / 0.5 * (1 - np.exp(-0.1e-3 * rate)), rel=1e-6)


@pytest.mark.slow
def test_recuperation_may_raise_the_capacitor_above_its_nominal_voltage():
    late = (Shot(start=40e-3, end=41e-3),)
    driver = BoostDriver(**USUAL | {"shots": late})

    run = run_stage(linear_coil(), driver, step=1e-6, duration=0.2e-3, current=8.0)

    assert run.capacitor[-1] > 66.0
    assert run.energies["converter"] == 0.0
    assert run.energies["capacitor"] > 0.0


def test_states_of_the_second_shot_have_times_of_their_own():
    program = BoostDriver(**USUAL | {"peak_duration": 0.1e-3, "repeat_every": 2e-3}).program()

    states = {state.name: state for state in program.states}
    assert states["off"].switches[0].value == 0.6e-3
    assert states["off"].switches[0].to == "boost-2"
    assert states["off-2"].switches[0].new_cycle
    (leave,) = [s for s in states["peak-off-2"].switches if s.to == "fall-2"]
    assert (leave.when, leave.value) == (When.TIME, pytest.approx(0.7e-3))
    assert program.stage is not None
    assert program.stage.paths["boost"].empty == (pytest.approx(13.3), "supply")


COMPLAINTS = {
    "boost below battery": ({"boost_voltage": 12.0}, "more than the battery, 14 V"),
    "band": ({"hold_band": 7.0}, "less than twice the hold current"),
    "peak": ({"peak_current": 3.2}, "a current above the band of the hold"),
    "clamp": ({"decay": "clamp"}, "the Zener or avalanche voltage of the clamp"),
    "overlap": (
        {"shots": (Shot(start=0.0, end=0.5e-3), Shot(start=0.4e-3, end=0.9e-3))},
        "a start from 0.0005 s on",
    ),
    "backwards": ({"shots": (Shot(start=0.5e-3, end=0.4e-3),)}, "an end after it"),
    "peak too long": ({"peak_duration": 0.4e-3}, "less than the shot from 0.0006 s"),
    "period": ({"repeat_every": 0.8e-3}, "at least 0.0009 s"),
    "none": ({"shots": ()}, "at least 1 item"),
    "no capacitor": ({"capacitance": 0.0}, "greater than 0"),
}


@pytest.mark.parametrize("name", COMPLAINTS)
def test_a_complaint_says_what_is_wrong(name):
    change, text = COMPLAINTS[name]

    with pytest.raises(InputError, match=re.escape(text)):
        BoostDriver(**USUAL | change)


def test_only_a_coil_behind_a_stage_has_its_entries(case):
    rows = case.network.network().rows()
    labels = [book.label for row in rows.elements for book in row.books]

    assert {"battery", "switches", "diodes", "clamp", "converter", "capacitor"} <= set(labels)
    assert Book("electric", "supply") not in [b for row in rows.elements for b in row.books]


IRON = "{material: X6Cr17, length: 30 mm, area: 34 mm^2}"
LOOP = (
    "{material: X6Cr17, length: 30 mm, area: 34 mm^2, "
    "hysteresis: {coercivity: 300 A/m, initial_permeability: 150}}"
)
EDDY = (
    "      eddy: [{conductivity: 1.5 MS/m, length: 18 mm, radius: 3.5 mm, slots: 0.3, terms: 3, "
    "permeability: 500}]\n    driver:\n"
)
MAP = """    coil:
      type: force-map-solenoid
      resistance: 0.5 ohm
      gap: 80 um
      current: [0 A, 4 A, 20 A]
      gaps: [10 um, 40 um, 80 um, 120 um]
      linkage:
        - [0 mWb, 0 mWb, 0 mWb, 0 mWb]
        - [1.6 mWb, 1 mWb, 0.6667 mWb, 0.5 mWb]
        - [8 mWb, 5 mWb, 3.3333 mWb, 2.5 mWb]
"""


@pytest.mark.slow
@pytest.mark.parametrize("coil", ["hysteresis", "eddy", "map"])
def test_other_coils_balance_behind_a_stage(coil):
    text = (HOW_TO / "boost_driver.yaml").read_text(encoding="utf-8")
    if coil == "hysteresis":
        changed = text.replace(IRON, LOOP)
    elif coil == "eddy":
        changed = text.replace("    driver:\n", EDDY)
    else:
        changed = text[: text.index("    coil:")] + MAP + text[text.index("    driver:") :]
    assert changed != text

    case = read_valve_case(changed, HOW_TO / "changed.yaml")
    run = simulate_network(case.network.network().rows(), duration=1.6e-3, record=2e-6)

    assert run.books.relative_residual < 1e-11
    assert run.channels["coil current"].values.max() == pytest.approx(12.0, rel=0.05)
    assert run.channels["coil capacitor voltage"].values.min() < 55.0
    if coil == "hysteresis":
        assert run.books.losses["coil hysteresis"] > 0.0


@pytest.mark.slow
def test_a_run_in_two_parts_is_the_run_of_the_whole_time(case):
    rows, keys = case.network.network().rows(), {"record": 2e-6, "coarse": 10, "step": 20e-9}

    whole = simulate_network(rows, duration=0.9e-3, **keys)
    first = simulate_network(rows, duration=0.6e-3, **keys)
    second = simulate_network(rows, duration=0.3e-3, state=first.state, **keys)

    for name in ("coil capacitor voltage", "coil current", "needle.tip displacement"):
        joined = np.concatenate((first.channels[name].values, second.channels[name].values[1:]))
        np.testing.assert_array_equal(joined, whole.channels[name].values, err_msg=name)


def test_the_page_shows_the_driver_of_the_case():
    whole = YAML(typ="safe").load(HOW_TO / "boost_driver.yaml")["network"]["components"]
    text = (HOW_TO / "boost-capacitor.md").read_text(encoding="utf-8")
    block = re.findall(r"```yaml-part\n(.*?)```", text, re.DOTALL)[0]
    assert YAML(typ="safe").load(block)["driver"] == whole["driver"]


@pytest.mark.slow
def test_the_second_shot_is_late_as_the_page_says(result):
    assert result.books.relative_residual < 1e-11
    found = re.search(r"as in the case \| ([\d.]+) V \| ([\d.]+) us \| ([\d.]+) us", PAGE)
    assert found is not None
    voltage, time, late = (float(number) for number in found.groups())
    capacitor = result.channels["coil capacitor voltage"].values
    at = np.argmin(np.abs(result.time - 0.7e-3))
    assert capacitor[at] == pytest.approx(voltage, abs=0.1)
    assert capacitor[result.time < 0.4e-3].min() == pytest.approx(
        float(re.search(r"from 65 V to ([\d.]+) V", PAGE)[1]), abs=0.1
    )
    opened = [e.time for e in result.events if e.stop == "opening" and e.approach_speed > 0.5]
    first, second = opened[0] - 0.1e-3, opened[1] - 0.7e-3
    assert 1e6 * second == pytest.approx(time, abs=0.1)
    assert 1e6 * (second - first) == pytest.approx(late, abs=0.1)


@pytest.mark.slow
def test_the_energies_are_those_of_the_page(result):
    found = re.search(
        r"Of ([\d.]+) mJ from the battery ([\d.]+) mJ become heat in the coil, ([\d.]+) mJ in "
        r"diodes, ([\d.]+) mJ in switches and ([\d.]+) mJ in the converter",
        PAGE,
    )
    assert found is not None
    battery, ohmic, diodes, switches, converter = (float(x) * 1e-3 for x in found.groups())
    losses = result.books.losses
    assert result.books.supplies["coil battery"] == pytest.approx(battery, abs=0.2e-3)
    for name, value in (
        ("ohmic", ohmic),
        ("diodes", diodes),
        ("switches", switches),
        ("converter", converter),
    ):
        assert losses[f"coil {name}"] == pytest.approx(value, abs=0.1e-3)


def test_a_magnet_with_remanence_starts_so_behind_a_stage():
    text = (HOW_TO / "boost_driver.yaml").read_text(encoding="utf-8").replace(IRON, LOOP)
    text = text.replace("    coil:\n", "    coil:\n      start: remanent\n")
    network = read_valve_case(text, HOW_TO / "remanent.yaml").network.network()
    (coil,) = (row for row in network.rows().elements if row.component == "coil")

    circuit, gap = network.components["coil"].circuit(), float(coil.parameters[2])
    fluxes, stops = remanent_state(circuit, current=0.0, gap=gap)

    assert coil.state[-2] == 65.0  # the capacitor
    assert list(coil.state[-2 - len(stops) : -2]) == list(stops)
    assert coil.state[-1] == np.abs(fluxes).max() > 0.0
