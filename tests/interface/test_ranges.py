"""Ranges of laws: refused before the run, told once in it, or the end of it.

Truth: lengths, areas and volumes by hand; the mass that a closed chamber holds.
"""

import re
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from doubts import doubts

from klack.case.any_case import read_valve_case
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.controlled_pressure import ControlledPressure
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.liquid import Murnaghan, TabulatedLiquid, Tait
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.network import Network
from klack.network.ranges import Travel, limits_of, value_text
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network

HEPTANE = library_fluid("n-heptane").at(293.15)
LAW = LinearStopLaw(kind="linear", stiffness=1e8)

MAGNET = """
klack: 1
title: magnet
network:
  components:
    arm: {type: rigid-mass, mass: 5 g, points: [p]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    stop: {type: end-stop, gap: 300 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 1 N/mm, preload: 5 N}
    coil: {type: solenoid, turns: 100, resistance: 1 ohm, gap: 60 um, residual_gap: 40 um,
      poles: [{outer_radius: 4 mm, fringing: plane, shoulder: 1 mm}]}
    drv: {type: voltage-step, voltage: 12 V}
  connections:
    - [arm.p, seat.upper, stop.lower, spring.end, coil.armature]
    - [ground, seat.lower]
    - [ground, stop.upper, coil.base]
    - [drv.terminals, coil.terminals]
run: {duration: 1 ms, step: 100 ns, variants: [dry]}
"""
MAP = re.sub(
    r"\{type: solenoid.*?\]\}",
    "{type: force-map-solenoid, resistance: 2 ohm, gap: 1 mm, current: [0 A, 1 A], "
    "gaps: [0.1 mm, 0.5 mm, 1.2 mm], "
    "linkage: [[0 Wb, 0 Wb, 0 Wb], [6 mWb, 1.2 mWb, 0.5 mWb]]}",
    MAGNET,
    flags=re.DOTALL,
)
CLOSED = """
klack: 1
title: closed
network:
  fluid: n-heptane
  components:
    m: {type: rigid-mass, mass: 1 kg, points: [p]}
    s: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.1}
    k: {type: spring, stiffness: 1 N/mm, preload: 100 N}
    q: {type: flow-source, flow: 1 l/min}
    c: {type: chamber, volume: 1 mm^3}
  connections:
    - [q.a, ambient]
    - [q.b, c.fluid]
    - [m.p, s.upper, k.end]
    - [s.lower, ground]
run: {duration: 0.1 ms, step: 20 ns, record: 1 us, variants: [wet]}
"""


def moment(error):
    """When a run ended [s], as its message says."""
    number, prefix = re.search(r" at ([\d.]+) ([um])s,", str(error)).groups()
    return float(number) * {"u": 1e-6, "m": 1e-3}[prefix]


def rows_of(text):
    return read_valve_case(text, Path("valve.yaml")).network.network().rows()


def test_an_armature_that_would_pass_through_its_pole_is_refused_with_both_gaps():
    with pytest.raises(
        InputError, match=r"components\.coil\.gap: got 60 um at the start"
    ) as caught:
        rows_of(MAGNET)

    assert "take up to 300 um (components.stop.gap: 300 um)" in caught.value.got
    assert "0 um to 4 mm" in caught.value.expected
    rows_of(MAGNET.replace("gap: 300 um", "gap: 60 um"))  # it may just touch


def test_a_pole_that_the_armature_leaves_downwards_is_refused_as_well():
    rows_of(MAGNET.replace("gap: 60 um", "gap: 60 um, closes: downward"))  # opens upwards
    text = MAGNET.replace("gap: 60 um", "gap: 60 um, closes: downward")
    with pytest.raises(InputError, match=re.escape("(components.seat.gap: 100 um)")):
        rows_of(
            text.replace("seat: {type: end-stop, gap: 0 um", "seat: {type: end-stop, gap: 100 um")
        )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("gap: 1 mm", "gap: 2 mm", "components.coil.gap: got 2 mm at the start"),
        ("gap: 300 um", "gap: 950 um", "take up to 950 um (components.stop.gap: 950 um)"),
        ("gap: 0 um", "gap: 250 um", "add up to 250 um (components.seat.gap: 250 um)"),
    ],
)
def test_a_map_has_to_hold_every_gap_that_the_stops_allow(old, new, said):
    rows_of(MAP)
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        rows_of(MAP.replace(old, new))

    assert "100 um to 1.2 mm" in caught.value.expected
    assert "components.coil.gaps" in caught.value.hint


def test_an_armature_that_no_stop_holds_ends_the_run_with_its_name_and_time():
    text = MAGNET.replace("stop.lower, ", "").replace("stop.upper, ", "")
    text = re.sub(r"    stop: .*\n", "", text)
    rows, said = rows_of(text), r"^coil: the gap is -\d+\.\d* um at [\d.]+ us"
    with doubts() as told, pytest.raises(ConvergenceError, match=said) as end:
        simulate_network(rows, duration=4e-3, step=100e-9)

    (text,) = [one for one in told if "'coil'" in one]
    assert "leaves the range of the magnet of 'coil', from 0 um to 4 mm" in text
    # 5 N and 60 to 100 um of way against a magnet of some 10 N: within a millisecond or two
    assert 0.1e-3 < moment(end.value) < 4e-3


def test_a_contact_that_gives_way_a_little_is_no_reason_for_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error", AccuracyWarning)
        text = MAGNET.replace("gap: 300 um", "gap: 58 um").replace("1e8 N/m", "1e9 N/m")
        result = simulate_network(rows_of(text), duration=1e-3, step=50e-9)

    assert result.channels["arm.p displacement"].values.max() > 58e-6


def chain(control):
    """A needle that pushes a piston; the piston closes a chamber and ends the stroke."""
    parts = {
        "needle": RigidMass(mass=5e-3, points=("tip", "top")),
        "piston": RigidMass(mass=5e-3, points=("foot", "head")),
        "seat": EndStop(gap=0.0, law=LAW),
        "rod": EndStop(gap=20e-6, law=LAW),
        "stop": EndStop(gap=250e-6, law=LAW),
        "spring": Spring(stiffness=1e4, preload=10.0),
        "face": PressureFace(direction="closing", area=10e-6),
        "ring": PressureFace(direction="opening", area=4e-6),
        "room": Chamber(volume=control),
    }
    joints = [
        ["needle.tip", "seat.upper", "ring.body"],
        ["seat.lower", "ground"],
        ["needle.top", "rod.lower", "spring.end"],
        ["piston.foot", "rod.upper"],
        ["piston.head", "stop.lower", "face.body"],
        ["stop.upper", "ground"],
        ["room.fluid", "face.fluid", "ring.fluid"],
    ]
    return Network(parts, joints, ambient=Ambient(), fluid=HEPTANE)


def test_bodies_that_push_each_other_end_at_the_stop_of_the_last_one():
    travel = Travel.of(chain(control=10e-9).rows())

    far, stops = travel.highest({"needle": 1.0})
    assert far == pytest.approx(270e-6, rel=1e-12)
    assert stops == ("stop", "rod")  # what ends the way of both comes first
    assert travel.lowest({"needle": 1.0}) == (0.0, ("seat",))
    assert travel.lowest({"piston": 1.0})[0] == pytest.approx(-20e-6, rel=1e-12)
    # the piston up by 250 um, the needle still on its seat: 10 mm^2 250 um
    least = travel.lowest({"needle": 4e-6, "piston": -10e-6})[0]
    assert least == pytest.approx(-2.5e-9, rel=1e-12)


def test_a_chamber_smaller_than_area_times_stroke_is_refused_with_both_numbers():
    chain(control=2.51e-9).rows()
    with pytest.raises(InputError, match=r"components\.room\.volume: got 2\.49 mm\^3") as caught:
        chain(control=2.49e-9).rows()

    assert "take up to 2.5 mm^3" in caught.value.got
    assert "components.stop.gap: 250 um" in caught.value.got


def test_a_chamber_that_overflows_ends_the_run_when_its_pressure_leaves_all_sense():
    case = read_valve_case(CLOSED, Path("closed.yaml"))
    with (
        pytest.warns(AccuracyWarning, match=r"leaves the range of the fluid .*up to 780 bar"),
        pytest.raises(ConvergenceError, match=r"^c: the pressure is 4\d{3}\.\d bar at") as end,
    ):
        simulate_network(case.network.network().rows(), duration=1e-4, step=20e-9, record=64e-8)

    # V rho(p) = V rho_0 + rho_0 q t
    rho_0, rho = (float(HEPTANE.density(p)) for p in (101325.0, 4e8))
    full = 1e-9 * (rho / rho_0 - 1.0) / (1e-3 / 60.0)
    assert full <= moment(end.value) <= full + 2 * 64e-8


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fluid: n-heptane", "fluid: n-heptane\n  ambient: {pressure: 5000 bar}", "ambient: got"),
        ("volume: 1 mm^3", "volume: 1 mm^3, pressure: 16000 bar", "components.c: got"),
    ],
)
def test_pressures_that_no_fluid_is_described_at_are_refused(old, new, said):
    with pytest.raises(InputError, match="expected at most 4000 bar") as caught:
        rows_of(CLOSED.replace(old, new))

    assert str(caught.value).startswith(said)


SUPPLIED = """
klack: 1
title: supplied
network:
  ambient: {temperature: 20 degC}
  fluid: water
  components:
    m: {type: rigid-mass, mass: 1 kg, points: [p]}
    s: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.1}
    k: {type: spring, stiffness: 1 N/mm, preload: 100 N}
    supply: {type: pressure-source, pressure: 5 bar}
    o: {type: orifice, diameter: 0.1 mm}
    c: {type: chamber, volume: 10 mm^3, pressure: 5 bar}
  connections:
    - [supply.fluid, o.a]
    - [o.b, c.fluid]
    - [m.p, s.upper, k.end]
    - [s.lower, ground]
run: {duration: 0.1 ms, step: 20 ns, record: 1 us, variants: [wet]}
"""
SOURCE = "{type: pressure-source, pressure: 5 bar}"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({SOURCE: "{type: pressure-source, pressure: 0.02 bar}"}, "components.supply: got a pres"),
        (
            {SOURCE: "{type: pressure-source, table: {time: [0 s, 1 s], pressure: [1 Pa, 1 bar]}}"},
            "components.supply: got a pressure of 1e-05 bar at the start",
        ),
        (
            {"supply.fluid": "ambient", f"    supply: {SOURCE}\n": "", "20 degC": "110 degC"},
            "ambient: got a pressure of 1.0132 bar at the start",
        ),
    ],
    ids=["constant", "begin of a table", "surroundings of hot water"],
)
def test_a_supply_of_vapour_is_refused(changes, said):
    """Water boils at 0.02339 bar at 20 degC and 1.4338 bar at 110 degC (IAPWS)."""
    rows_of(SUPPLIED)
    text = SUPPLIED
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        rows_of(text)

    boils = re.search(r"boils at ([\d.]+) bar at (\d+) degC", caught.value.expected)
    assert float(boils[1]) == pytest.approx({"20": 0.02339, "110": 1.4338}[boils[2]], rel=2e-2)


def test_surroundings_that_no_fluid_comes_from_may_be_below_its_vapour_pressure():
    rows_of(SUPPLIED.replace("20 degC", "110 degC"))


@pytest.mark.parametrize("pressure", ["-1 bar", "0 bar"])
def test_a_table_of_pressures_that_do_not_exist_is_refused(pressure):
    table = f"{{time: [0 ms, 1 ms], pressure: [5 bar, {pressure}]}}"
    with pytest.raises(InputError, match=r"supply\.table\.pressure\[1\]: got '.* above 0"):
        rows_of(SUPPLIED.replace(SOURCE, f"{{type: pressure-source, table: {table}}}"))


def test_a_supply_that_falls_below_boiling_is_told_when_it_does():
    """5 bar to 0.01 bar in 100 us: the last 0.7 us are below 0.0434 bar."""
    falls = "{type: pressure-source, table: {time: [0 us, 100 us], pressure: [5 bar, 0.01 bar]}}"
    rows = rows_of(SUPPLIED.replace(SOURCE, falls))
    with doubts() as told:
        simulate_network(rows, duration=105e-6, step=20e-9, record=100e-9)

    (text,) = [one for one in told if "'supply'" in one]
    assert re.match(r"'supply': at .* 'water' in 'supply'", text)
    assert float(re.search(r"at ([\d.]+) us", text)[1]) == pytest.approx(99.3, abs=1.0)  # a look
    with warnings.catch_warnings():
        warnings.simplefilter("error", AccuracyWarning)
        simulate_network(rows, duration=98e-6, step=20e-9, record=100e-9)


def test_a_controller_that_asks_for_less_than_boiling_is_told_when_it_does():
    supply = ControlledPressure(sample_time=10e-6, start=5e5).by(
        lambda time, signals: 5e5 if time < 35e-6 else 500.0
    )
    valve = read_valve_case(SUPPLIED, Path("valve.yaml")).network.network()
    rows = replace(valve, components={**valve.components, "supply": supply}).rows()

    with pytest.warns(AccuracyWarning, match=r"^'supply': at 4[01][\d.]* us .* it is 0\.005 bar"):
        simulate_network(rows, duration=100e-6, step=20e-9, record=100e-9)


def line_between(first, second, pressure=None, fluid=HEPTANE, begin=PressureSource):
    parts = {
        "m": RigidMass(mass=1.0),
        "k": Spring(stiffness=1e3, preload=0.0),
        "source": begin(pressure=first),
        "line": Line(length=0.1, diameter=2e-3, pressure=pressure, friction="none"),
        "room": Chamber(volume=1e-7, pressure=second),
    }
    joints = [["m.body", "k.end"], ["source.fluid", "line.a"], ["line.b", "room.fluid"]]
    return Network(parts, joints, fluid=fluid).rows()


def test_a_line_without_a_pressure_takes_the_higher_one_of_its_ends():
    given, taken = line_between(2e7, 1e7, pressure=2e7), line_between(2e7, 1e7)

    assert taken.lines[0].delay == given.lines[0].delay
    assert taken.lines[0].impedance == given.lines[0].impedance
    assert taken.lines[0].delay == 0.1 / float(HEPTANE.sound_speed(2e7))


@pytest.mark.parametrize(
    "begin", [Junction, partial(Chamber, volume=1e-7)], ids=["junction", "volume"]
)
def test_what_begins_below_boiling_is_told(begin):
    """n-heptane of the library boils at 0.0472 bar, and the model is all liquid 0.02 bar above."""
    liquid = HEPTANE.vapour_pressure + 2e3
    with doubts() as told:
        simulate_network(line_between(0.999 * liquid, 5e5, begin=begin), duration=2e-6, step=20e-9)

    (text,) = [one for one in told if "holds vapour" in one]
    assert text.startswith("'source': at the start the pressure leaves the range of liquid")
    assert "it boils at 0.0472 bar at 20 degC" in text
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*holds vapour", AccuracyWarning)
        simulate_network(line_between(1.001 * liquid, 5e5, begin=begin), duration=2e-6, step=20e-9)


def test_a_volume_that_boils_later_is_no_doubt():
    """1 mm^3/ms out of 1 mm^3 of a bulk modulus of some GPa: 1 bar is gone within 1 us."""
    text = CLOSED.replace("[q.a, ambient]", "[q.b, ambient]").replace(
        "[q.b, c.fluid]", "[q.a, c.fluid]"
    )
    text = text.replace("volume: 1 mm^3", "volume: 1 mm^3, pressure: 1 bar")
    rows = rows_of(text.replace("1 l/min", "0.06 l/min"))
    with warnings.catch_warnings():
        warnings.simplefilter("error", AccuracyWarning)
        result = simulate_network(rows, duration=50e-6, step=20e-9)

    assert result.channels["c pressure"].values[-1] < HEPTANE.all_liquid_from


@pytest.mark.parametrize(
    ("given", "key"),
    [(3e3, "components.line.pressure: got 0.03 bar, "), (None, "components.line:")],
)
def test_waves_of_a_line_in_vapour_are_refused(given, key):
    """Its ends begin at 0.03 bar, where n-heptane is vapour (0.0472 bar)."""
    with pytest.raises(InputError, match="has no vapour left") as caught:
        line_between(3e3, 3e3, given, begin=Junction)

    assert str(caught.value).startswith(key)
    line_between(3e3, 3e3, 7e3, begin=Junction)


def test_a_line_far_from_its_pressure_says_both_speeds_and_the_error():
    gassy = FluidChoice(name="n-heptane", gas_fraction=0.01).at(293.15)
    with doubts() as told:
        simulate_network(line_between(400e5, 1e5, 1e5, gassy), duration=64e-6, step=20e-9)

    (text,) = [one for one in told if "'line'" in one]
    assert "the line 'line' with the fluid of 1 bar" in text
    assert text.startswith("'line': at the start the pressure")
    slow, fast = (float(gassy.sound_speed(p)) for p in (1e5, 400e5))
    assert f"{slow:.4g} m/s, but waves at 400 bar run at {fast:.4g} m/s" in text
    assert f"wrong by up to {100 * (1 - slow / fast):.2g} %" in text


def test_numbers_of_ranges_are_written_as_people_write_them():
    assert value_text(6.483e-4, "kg/s") == "0.6483 g/s"
    assert value_text(1.35e7, "Pa") == "135 bar"
    assert value_text(2e-9, "m^3") == "2 mm^3"
    assert value_text(4e-5, "m") == "40 um"


def test_a_line_near_its_pressure_is_silent():
    with warnings.catch_warnings():
        warnings.simplefilter("error", AccuracyWarning)
        simulate_network(line_between(210e5, 200e5), duration=64e-6, step=20e-9)


def test_laws_of_liquids_state_their_range():
    oil = Murnaghan(density_at_reference=850.0, bulk_modulus_at_reference=1.5e9, slope=10.0)
    steep = Murnaghan(density_at_reference=700.0, bulk_modulus_at_reference=1.0e9, slope=12.0)
    table = TabulatedLiquid([1e5, 200e5], [780.0, 790.0])
    K = 790.0 / (10.0 / 199e5)

    assert oil.pressure_range.highest == pytest.approx(3e8, rel=1e-3)
    assert steep.pressure_range.highest == pytest.approx(1e8, rel=2e-3)
    assert Tait(density_at_zero=860.0, bulk_modulus_at_zero=1.5e9).pressure_range.highest == 1500e5
    assert table.pressure_range.lowest == 0.0
    assert table.pressure_range.highest == pytest.approx(200e5 + 0.01 * K, rel=1e-12)
    assert table.pressure_range.usable == pytest.approx(200e5 + 0.1 * K, rel=1e-12)


def test_every_row_of_a_network_that_can_leave_a_range_is_watched():
    text = {(limit.component, limit.quantity) for limit in limits_of(chain(control=10e-9).rows())}

    assert text == {("room", "volume"), ("room", "pressure"), ("ambient", "pressure")}
    watched = limits_of(rows_of(MAP))
    assert [(limit.component, limit.quantity) for limit in watched] == [
        ("coil", "gap"),
        ("coil", "current"),
    ]
    assert watched[1].valid == (-1.0, 1.0)
    assert np.isinf(watched[1].usable).all()


def test_a_chamber_out_of_which_more_flows_than_it_holds_ends_the_run():
    """A pump drains 1 mm^3 at 1 ml/s: after 1 ms nothing is left."""
    text = CLOSED.replace("[q.a, ambient]", "[q.b, ambient]").replace(
        "[q.b, c.fluid]", "[q.a, c.fluid]"
    )
    text = text.replace("1 l/min", "0.06 l/min").replace("duration: 0.1 ms", "duration: 2 ms")

    with (
        pytest.warns(AccuracyWarning),
        pytest.raises(ConvergenceError, match=r"^c: the pressure is -[\d.]+ bar at") as caught,
    ):
        simulate_network(rows_of(text), duration=2e-3, step=20e-9)

    assert moment(caught.value) == pytest.approx(1e-3, rel=0.01)
