"""The section ``thermal`` of a case: its errors, its doubts, and what a stroke takes from it."""

from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.heat.heated_stroke import (
    _since,
    _uncommanded,
    aspects_of,
    heated_stroke,
    sent_heat,
    warm_valve,
)
from klack.analyses.heat.run import HEAT_LOG, run_heat
from klack.analyses.heat.summary import answer
from klack.analyses.stroke.run import one_variant
from klack.assembling.valve import Valve, build_valve
from klack.case.any_case import read_valve_case
from klack.case.valve import ValveCase
from klack.case.valve_roles import find_roles
from klack.errors import InputError
from klack.machine.progress import silent
from klack.verification.heat import SMALL

COLD = {"copper": 293.15, "ambient": 293.15}
WET = """
    sac: {type: chamber, volume: 50 mm^3}
    leak: {type: orifice, diameter: 0.5 mm}
    face: {type: pressure-face, direction: opening, area: 1 mm^2}
"""


def read(*changes: tuple[str, str]) -> ValveCase:
    text = SMALL
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return read_valve_case(text, Path("small.yaml"))


def wet(fluid: str) -> ValveCase:
    """The same with a fluid whose temperature is that of the copper."""
    return read(
        ("network:\n  components:", f"network:\n  fluid: {fluid}\n  components:"),
        ("    path: {type", WET.strip("\n") + "\n    path: {type"),
        ("[needle.low, seat.upper]", "[needle.low, seat.upper, face.body]"),
        (
            "[path.b, ambient]",
            "[path.b, ambient]\n    - [sac.fluid, leak.a, face.fluid]\n    - [leak.b, ambient]",
        ),
        ("  windings:", "  fluid: copper\n  windings:"),
        ("variants: [dry]", "variants: [wet]"),
    )


WRONG = {
    "node": ("node: copper}]\n  windings", "node: coper}]\n  windings", "did you mean 'copper'"),
    "winding": ("windings: {coil: copper}", "windings: {coil: body}", "'body'"),
    "coil": ("windings: {coil: copper}", "windings: {driver: copper}", "'driver'"),
    "period": ("period: 20 ms", "period: 2 ms", "run.duration or more, 7 ms"),
    "loss": ("loss: coil ohmic", "loss: coyl ohmic", "did you mean 'coil'"),
    "share": (
        "[{loss: coil ohmic, node: copper}]",
        "[{loss: coil, node: copper, share: 60 %}, {loss: coil, node: copper, share: 0.5}]",
        "1.1 of 'coil' in all",
    ),
    "twice": (
        "[{loss: coil ohmic, node: copper}]",
        "[{loss: coil, node: copper}, {loss: coil ohmic, node: copper}]",
        "would count some heat twice",
    ),
    "grown": ("of: [stop.gap, coil.gap]", "of: [stop.gp]", "did you mean 'stop.gap'"),
    "grown number": ("of: [stop.gap, coil.gap]", "of: [coil.turns]", "coil.gap"),
    "fluid": ("  windings:", "  fluid: copper\n  windings:", "a node for the fluid of a dry valve"),
    "magnets": (
        "  windings:",
        "  magnets: {coil: {node: copper, coefficient: -0.001 1/K}}\n  windings:",
        "solenoid with magnets",
    ),
    "open port": ("[path.b, ambient]", "[driver.terminals]", "two ports or more"),
    "ground": ("[path.b, ambient]", "[path.b, ground]", "ports of one domain"),
    "no capacity": ("capacity: 0.02 J/K", "mass: 1 g", "the specific heat"),
    "difference": ("tolerance: 20 mK", "tolerance: 20 degC", "K"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_one_clear_error(name):
    old, new, said = WRONG[name]

    with pytest.raises(InputError) as caught:
        read((old, new))

    assert said in str(caught.value)
    assert "small.yaml:" in str(caught.value)


def test_two_prescribed_temperatures_do_not_meet():
    with pytest.raises(InputError, match=r"bath\.node and ambient at one node"):
        read(
            (
                "    path: {type",
                "    bath: {type: fixed-temperature, temperature: 0 degC}\n    path: {type",
            ),
            ("[path.b, ambient]", "[path.b, bath.node, ambient]"),
        )


def test_a_case_without_the_section_says_what_to_add():
    text = SMALL[: SMALL.index("thermal:")] + SMALL[SMALL.index("run:") :]

    with pytest.raises(InputError, match="no section 'thermal'"):
        run_heat(read_valve_case(text, Path("small.yaml")))


def test_a_loss_that_the_stroke_does_not_have_is_named():
    case = read(("loss: coil ohmic", "loss: coil omic"))
    assert case.thermal is not None

    with pytest.raises(InputError, match="did you mean 'coil ohmic'"):
        sent_heat(case.thermal, {"coil ohmic": 1.0, "coil eddy": 2.0})


def test_shares_of_losses_go_to_their_nodes():
    case = read(
        (
            "[{loss: coil ohmic, node: copper}]",
            "[{loss: coil, node: copper, share: 25 %}, {loss: seat contact, node: copper}]",
        )
    )
    assert case.thermal is not None

    found = sent_heat(
        case.thermal, {"coil ohmic": 1.0, "coil eddy": 2.0, "coil2 ohmic": 8.0, "seat contact": 4.0}
    )

    assert found == {"copper": pytest.approx(0.25 * 3.0 + 4.0, rel=1e-15)}


@pytest.fixture(scope="module")
def valve() -> Valve:
    return build_valve(read())


def test_thermal_components_leave_a_stroke_as_it_is(valve):
    """Truth = the same valve without them, bit for bit."""
    bare = SMALL[: SMALL.index("thermal:")] + SMALL[SMALL.index("run:") :]
    for line in ("copper: {type", "path: {type", "- [copper.node", "- [path.b"):
        bare = "\n".join(text for text in bare.split("\n") if not text.strip().startswith(line))
    other = build_valve(read_valve_case(bare, Path("small.yaml")))
    assert len(other.network.components) == len(valve.network.components) - 2

    runs = [
        one_variant(v, find_roles(v.case), "dry", silent, check=False).variant.result
        for v in (valve, other)
    ]

    for name, channel in runs[0].channels.items():
        np.testing.assert_array_equal(channel.values, runs[1].channels[name].values)
    assert runs[0].books.losses == runs[1].books.losses


def test_at_20_degrees_it_is_the_stroke_of_the_case(valve):
    roles = find_roles(valve.case)
    plain = one_variant(valve, roles, "dry", silent, check=False).variant

    found = heated_stroke(valve, roles, "dry", {a: COLD for a in aspects_of(valve.case)})

    assert found.losses == plain.result.books.losses
    assert found.numbers["closing delay"] == plain.closing_time - 4e-3
    assert found.numbers["opening delay"] == plain.needle_times.opening.at_90


PULSE = (
    "time: [0 ms, 3 ms, 3.001 ms, 4 ms, 4.001 ms, 7 ms], "
    "voltage: [12 V, 12 V, -30 V, -30 V, 0 V, 0 V]}"
)
TWO = PULSE.replace("7 ms", "5 ms, 5.001 ms, 7 ms").replace("0 V]", "0 V, 12 V, 12 V]")


def test_a_second_pulse_is_no_rebound():
    """Truth = the same stroke without the second pulse."""
    driver = "{type: voltage-step, voltage: 12 V, end: 4 ms, decay: 30 V}"
    found = []
    for course in (PULSE, TWO):
        case = read((driver, "{type: voltage-table, " + course))
        at = {a: COLD for a in aspects_of(case)}
        found.append(heated_stroke(build_valve(case), find_roles(case), "dry", at).numbers)

    one, two = found

    assert 5e-6 < one["rebound"] < 50e-6
    assert two["rebound"] == one["rebound"]


@pytest.mark.parametrize("end", ["4 ms", "4 ms, repeat_every: 5 ms"], ids=["once", "again"])
def test_the_rebound_of_a_normally_open_valve_ends_before_it_opens(end):
    """Truth = the first bounce, which is the highest, over the position at touch."""
    case = read(
        ("seat: {type: end-stop, gap: 0 um", "seat: {type: end-stop, gap: 100 um"),
        ("stop: {type: end-stop, gap: 100 um", "stop: {type: end-stop, gap: 0 um"),
        ("preload: 10 N", "preload: -10 N"),
        ("resistance: 2 ohm,", "resistance: 2 ohm, closes: downward,"),
        ("end: 4 ms", f"end: {end}"),
        (
            "  growth:\n    lift:\n      of: [stop.gap, coil.gap]",
            "  growth:\n    lift:\n      of: [seat.gap]",
        ),
    )
    valve, roles = build_valve(case), find_roles(case)
    result = one_variant(valve, roles, "dry", silent, check=False).variant.result
    first, second = [item.time for item in result.events if item.stop == "seat"][:2]
    lift = result.channels["needle.low displacement"].values
    between = lift[(result.time >= first) & (result.time <= second)]

    found = heated_stroke(valve, roles, "dry", {a: COLD for a in aspects_of(case)}).numbers

    expected = between.max() - np.interp(first, result.time, lift)
    assert found["rebound"] == pytest.approx(expected, rel=1e-12, abs=0.0)


def test_each_aspect_takes_its_own_temperature(valve):
    hot = {"copper": 393.15, "ambient": 293.15}

    found = warm_valve(valve, {"copper": hot, "gaps": COLD}).values

    assert found["coil resistance"] == (pytest.approx(2.0 * 1.393, rel=1e-12), "ohm")
    assert found["stop.gap"] == (100e-6, "m")
    grown = warm_valve(valve, {"copper": COLD, "gaps": hot}).values
    assert grown["coil resistance"] == (2.0, "ohm")
    assert grown["coil.gap"][0] == pytest.approx(100e-6 + 20e-3 * 16.5e-6 * 100.0, rel=1e-12)


def test_a_preload_follows_its_room_by_the_stiffness():
    case = read(("of: [stop.gap, coil.gap]", "of: [spring.preload]"))
    hot = {"copper": 393.15, "ambient": 293.15}

    found = warm_valve(build_valve(case), {"copper": hot, "gaps": hot}).values

    assert found["spring.preload"] == (pytest.approx(10.0 - 5e3 * 33e-6, rel=1e-12), "N")


def test_a_gap_that_growth_closes_is_refused():
    case = read(("length: 20 mm", "length: -200 mm"))
    hot = {"copper": 393.15, "ambient": 293.15}

    with pytest.raises(InputError, match=r"thermal\.growth\.lift: got gap = "):
        warm_valve(build_valve(case), {"copper": hot, "gaps": hot})


def test_a_magnet_weakens_by_its_coefficient():
    case = read(
        (
            "poles: [{",
            "magnets: [{remanence: 1.2 T, recoil_permeability: 1.05, length: 1 mm, "
            "area: 30 mm^2, polarity: with-coil}], poles: [{",
        ),
        ("  windings:", "  magnets: {coil: {node: copper, coefficient: -0.0012 1/K}}\n  windings:"),
    )
    hot = {"copper": 393.15, "ambient": 293.15}

    warm = warm_valve(build_valve(case), {"copper": hot, "magnets": hot, "gaps": COLD})

    magnets = warm.valve.case.network.components["coil"].magnets
    assert magnets[0].remanence == pytest.approx(1.2 * 0.88, rel=1e-12)


def test_a_fluid_beyond_its_range_is_taken_from_the_end_with_a_doubt():
    valve = build_valve(wet("DOT 4"))
    hot = {"copper": 440.15, "ambient": 293.15}

    warm = warm_valve(valve, {a: hot for a in aspects_of(valve.case)})

    assert warm.valve.network.fluid.temperature == pytest.approx(413.15)
    assert (
        "'DOT 4' is known from -40 to 140 °C: beyond that its properties at 140 °C"
        in warm.doubts[0]
    )


def test_a_fluid_of_fixed_numbers_does_not_follow_and_says_so():
    own = "{name: own, density: 800 kg/m^3, bulk_modulus: 1.3 GPa, viscosity: 2 mPa*s}"
    valve = build_valve(wet(own))

    warm = warm_valve(valve, {a: COLD for a in aspects_of(valve.case)})

    assert "'own' has the same properties at every temperature" in warm.doubts[0]


def test_viscosity_and_density_are_two_aspects():
    valve = build_valve(wet("DOT 4"))
    hot = {"copper": 353.15, "ambient": 293.15}
    at = dict.fromkeys(aspects_of(valve.case), COLD)
    cold, whole = valve.network.fluid, valve.case.network.fluid.at(353.15)

    thin = warm_valve(valve, {**at, "viscosity": hot}).valve.network.fluid
    light = warm_valve(valve, {**at, "density": hot}).valve.network.fluid

    assert thin.base_viscosity == whole.base_viscosity
    assert thin.density(1e6) == cold.density(1e6)
    assert light.base_viscosity == cold.base_viscosity
    assert light.density(1e6) == whole.density(1e6)
    assert light.bulk_modulus(1e6) == whole.bulk_modulus(1e6)


def test_a_stopped_warm_up_resumes_with_the_same_numbers(tmp_path, monkeypatch):
    case = read(("duration: 1 s", "duration: 0.2 s"))
    whole = run_heat(case)
    computed = []

    def counted(*args):
        computed.append(1)
        if len(computed) == 2:
            raise KeyboardInterrupt
        return heated_stroke(*args)

    monkeypatch.setattr("klack.analyses.heat.run.heated_stroke", counted)
    with pytest.raises(KeyboardInterrupt):
        run_heat(case, folder=tmp_path)
    assert HEAT_LOG.count(tmp_path) == 1

    again = run_heat(case, folder=tmp_path)

    assert len(computed) == 2 + len(HEAT_LOG_KEYS(tmp_path)) - 1
    np.testing.assert_array_equal(again.time, whole.time)
    for one, other in zip(again.columns, whole.columns, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


def HEAT_LOG_KEYS(folder: Path) -> list[str]:
    return (folder / HEAT_LOG.file).read_text().splitlines()[1:]


@pytest.mark.slow
def test_a_notebook_soaks_a_valve(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SMALL, encoding="utf-8")

    found = klack.run_heat(path, soak=[273.15, 323.15])

    assert found.json["temperature_K"] == {"valve": [273.15, 323.15]}
    assert "closing delay" in found._repr_html_()


def test_a_current_that_does_not_end_is_a_doubt():
    case = read(
        ("end: 4 ms, decay: 30 V", "end: 6.9 ms, decay: 1 V"), ("duration: 1 s", "duration: 20 ms")
    )

    assert any(
        "coil current does not end with the stroke" in text for text in run_heat(case).warnings
    )


def test_a_node_that_one_stroke_warms_noticeably_is_a_doubt():
    case = read(("capacity: 0.02 J/K", "capacity: 0.001 J/K"), ("duration: 1 s", "duration: 40 ms"))

    assert any("one stroke warms 'copper' by" in text for text in run_heat(case).warnings)


@pytest.mark.parametrize(
    ("stated", "kelvin", "words"),
    [
        ("", 453.15, None),
        ("", 573.15, "'coil' reaches 300 °C, above the 180 °C of class H of IEC 60085, and states"),
        ("F", 428.15, None),
        ("F", 429.15, "'coil' reaches 156 °C, above the 155 °C of its insulation, class F"),
        ("R", 493.15, None),
        ('"250"', 530.15, "'coil' reaches 257 °C, above the 250 °C of its insulation, class 250"),
    ],
)
def test_copper_warmer_than_its_insulation_is_a_doubt(stated, kelvin, words):
    change = [("turns: 200,", f"turns: 200, insulation_class: {stated},")] if stated else []
    told = [
        text for text in run_heat(read(*change), soak=(kelvin,)).warnings if "copper of" in text
    ]

    assert len(told) == (words is not None)
    assert words is None or words in told[0]


def test_each_coil_of_a_magnet_follows_its_own_copper():
    path = Path(__file__).parents[2] / "docs" / "how-to" / "two_coils.yaml"
    valve = build_valve(read_valve_case(path.read_text(encoding="utf-8"), path), silent, threads=1)
    cold = dict.fromkeys(("copper", "holding_copper", "body", "ambient"), 293.15)

    warm = warm_valve(valve, {"copper": cold | {"copper": 393.15, "holding_copper": 343.15}})

    assert warm.values["magnet resistance"] == (pytest.approx(0.8 * 1.393), "ohm")
    assert warm.values["magnet.holding resistance"] == (pytest.approx(9.0 * 1.1965), "ohm")
    magnet = warm.valve.network.components["magnet"]
    assert magnet.winding_temperature == 393.15
    assert magnet.circuits["holding"].winding_temperature == 343.15


def test_a_winding_may_follow_a_fixed_temperature():
    case = read(
        (
            "    path: {type",
            "    block: {type: fixed-temperature, temperature: 90 degC}\n    path: {type",
        ),
        ("windings: {coil: copper}", "windings: {coil: block}"),
        ("[path.b, ambient]", "[path.b, block.node]"),
        ("duration: 1 s", "duration: 40 ms"),
    )

    study = run_heat(case)

    assert study.values[0].values == pytest.approx(2.0 * (1.0 + 3.93e-3 * 70.0), rel=1e-12)
    assert set(study.given_off) == {"ambient", "block"}


def test_strokes_in_which_the_valve_does_not_open_are_a_doubt():
    study = run_heat(read(("voltage: 12 V", "voltage: 2.2 V")), soak=(243.15, 573.15))

    opening = next(x.values for x in study.numbers if x.name == "opening delay")
    assert np.isfinite(opening).tolist() == [True, False]
    assert any("1 of 2 strokes have no opening delay" in text for text in study.warnings)


def test_copper_at_a_held_current_runs_away_and_says_so():
    """The current is held whatever the resistance; truth: its gain alpha P / G is above 1."""
    case = read(
        ("  duration: 1 s\n", ""),
        ("capacity: 0.02 J/K", "capacity: 2 J/K"),
        ("conductance: 0.025 W/K", "conductance: 0.012 W/K"),
        ("tolerance: 20 mK", "tolerance: 0.2 K"),
        (
            "gap: 100 um, law: {kind: linear, stiffness: 1e8",
            "gap: 100 um, law: {kind: linear, stiffness: 1e9",
        ),
        (
            "{type: voltage-step, voltage: 12 V, end: 4 ms, decay: 30 V}",
            "{type: two-point, voltage: 60 V, upper: 4.1 A, lower: 3.9 A, end: 4 ms, decay: 30 V}",
        ),
    )

    study = run_heat(case)

    assert study.end == "runaway"
    power = study.heat[0].values
    rise = study.temperature[0].values - study.temperature[0].values[0]
    assert study.gain == pytest.approx((power[-1] - power[-2]) / (rise[-1] - rise[-2]) / 0.012)
    assert study.gain > 1.0
    assert "thermal runaway: there is no steady state" in answer(study)


@pytest.mark.parametrize(
    ("time", "commands", "delay"),
    [
        (2.0, (0.1, 1.5, 3.0), 0.5),  # after the last command before it
        (0.05, (0.1, 1.5), -0.05),  # before all of them
        (2.0, (), 2.0),  # no driver says: from the start of the stroke
    ],
)
def test_a_delay_counts_from_the_command_before_it(time, commands, delay):
    assert _since(time, commands) == pytest.approx(delay, rel=1e-12)
    assert bool(_uncommanded("closing", delay, commands)) is not bool(commands)


def test_gas_stands_apart_from_the_heat_of_the_fluid_and_says_so():
    tank = "tank: {type: gas-chamber, volume: 1 cm^3, pressure: 1.2 bar, heat_conductance: 0.1 W/K}"
    case = read(
        (
            "network:\n  components:",
            "network:\n  gas: air\n  fluid: DOT 4\n  components:\n"
            f"    {tank}\n    hole: {{type: gas-orifice, diameter: 0.1 mm}}",
        ),
        (
            "[path.b, ambient]",
            "[path.b, ambient]\n    - [tank.gas, hole.a]\n    - [hole.b, ambient]",
        ),
        ("  windings:", "  fluid: copper\n  windings:"),
        ("variants: [dry]", "variants: [wet]"),
    )
    valve = build_valve(case)
    hot = {"copper": 353.15, "ambient": 293.15}

    warm = warm_valve(valve, {a: hot for a in aspects_of(case)}).valve.network

    (cold,) = (row for row in valve.network.rows().elements if row.component == "gas")
    (gas,) = (row for row in warm.rows().elements if row.component == "gas")
    assert np.array_equal(gas.parameters, cold.parameters)
    assert warm.fluid.temperature == pytest.approx(353.15)
    found = heated_stroke(valve, find_roles(case), "wet", {a: COLD for a in aspects_of(case)})
    assert any("gas is separate from the heat network" in text for text in found.doubts)
