"""Operating points of valves: where everything rests, and what is said where nothing does.

Truth: sums of forces and flows by hand, closed forms of a magnet and of a spring, conservation of
mass, and that a run which begins at an operating point stays there.
"""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.operating_point.conditions import Conditions, asked_sweeps, stated_drive
from klack.analyses.operating_point.content import sweep_charts, write_csv
from klack.analyses.operating_point.record import OperatingPoints
from klack.analyses.operating_point.run import find_point, run_operating_points
from klack.assembling.valve import build_valve
from klack.case.any_case import CaseTree, read_case_tree, tree_of
from klack.case.valve_roles import find_roles
from klack.errors import ConvergenceError, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource, FlowStep
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_source import PressureSource, PressureTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import far_ends, operating_point, steady_rows
from klack.units import CURRENT

VALVES = Path(__file__).parents[1] / "data" / "valves"
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
NOWHERE = Path("case.yaml")
AMBIENT = 101325.0
MU0 = 4e-7 * pi

MAGNET = (HOW_TO / "held_open.yaml").read_text(encoding="utf-8")

SHUT = """
klack: 1
title: A pump that pushes against a valve which no pressure opens
network:
  fluid: n-heptane
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [tip]}
    spring: {type: spring, stiffness: 10 N/mm, preload: 25 N}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e9 N/m}, restitution: 0.5}
    pump: {type: flow-source, flow: 0 l/min}
    inlet: {type: chamber, volume: 100 mm^3, pressure: 7 bar}
    valve: {type: seat, shape: flat, diameter: 2 mm}
  connections:
    - [needle.tip, spring.end, seat.upper, valve.needle]
    - [ground, seat.lower]
    - [pump.b, inlet.fluid, valve.a]
    - [valve.b, ambient]
run: {duration: 1 ms, variants: [wet]}
"""


def written(text: str) -> CaseTree:
    return tree_of(text, NOWHERE)


def points(tree: CaseTree, *sweeps: tuple[str, str, str, int], **asked) -> OperatingPoints:
    case = tree.case()
    return run_operating_points(case, tree, sweeps=asked_sweeps(case, tree, sweeps), **asked)


def one(record: OperatingPoints, name: str) -> float:
    found = record.quantity(name)
    assert found is not None, [item.name for item in record.quantities]
    return float(found.values[0])


def pull(current: float, lift: float) -> float:
    return MU0 * pi * 3e-3**2 * (100.0 * current) ** 2 / (2.0 * (150e-6 - lift) ** 2)


# --------------------------------------------------------------------------- valves of usual kinds


def test_a_closed_direct_injector_is_pressed_by_spring_and_pressure():
    found = points(read_case_tree(VALVES / "direct_injector.yaml"))

    pressed = 22.0 + pi / 4 * 1.3e-3**2 * (100e5 - AMBIENT)  # sac at ambient pressure
    assert one(found, "seat contact force") == pytest.approx(
        pressed / (1.0 + 30e3 / 1e8), rel=1e-9
    )  # spring and seat share


def test_a_note_of_a_point_keeps_its_remedy():
    text = (VALVES / "direct_injector.yaml").read_text(encoding="utf-8")
    line = "diameter: 2.5 mm, pressure: 100 bar"
    assert line in text
    record = points(written(text.replace(line, line.replace("100 bar", "1 bar"))))

    (note,) = [note for note in record.warnings if note.startswith("'feed': at the start")]
    assert " Try: give components.feed.pressure the working pressure" in note
    assert not any(note.startswith("Try") for note in record.warnings)


def test_a_held_direct_injector_passes_what_both_restrictions_pass():
    tree = read_case_tree(VALVES / "direct_injector.yaml")
    found = points(tree, base=Conditions(current={"": 8.0}))

    sac = one(found, "sac pressure")
    fluid = library_fluid("n-heptane").at(293.15)
    density, area = float(fluid.density(sac)), 6 * pi / 4 * 0.18e-3**2
    assert one(found, "holes mass flow") == pytest.approx(
        0.62 * area * np.sqrt(2.0 * density * sac), rel=1e-3
    )  # the holes cavitate: Nurick, without the vapour pressure of 5 kPa
    assert one(found, "valve mass flow") == pytest.approx(one(found, "holes mass flow"), rel=1e-9)
    assert one(found, "stop contact force") == pytest.approx(
        one(found, "coil armature force")
        - 22.0
        - 30e3 * one(found, "needle tip displacement")
        - pi / 4 * 1.3e-3**2 * (one(found, "body pressure") - sac)
        + one(found, "valve jet force"),
        rel=1e-6,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "current"),
    [
        ("brake_valve_hot", 0.0),
        ("brake_valve_hot", 2.0),
        ("direct_injector", 0.0),
        ("direct_injector", 8.0),
        ("pilot_injector", 0.0),
        ("pilot_injector", 12.0),
        ("pump_and_relief", None),
        ("relief_on_pipe", None),
    ],
)
def test_a_run_from_the_operating_point_of_a_valve_stays_there(name, current):
    case = read_case_tree(VALVES / f"{name}.yaml").case()
    conditions = Conditions() if current is None else Conditions(current={"": current})

    found = find_point(build_valve(case), find_roles(case), case.run.variants[0], conditions)
    result = simulate_network(
        steady_rows(found.rows), duration=0.2e-3, record=10e-6, state=found.point.state
    )

    for channel, data in result.channels.items():
        if data.unit not in ("m", "Pa", "A", "Wb"):
            continue
        scale = {"m": 1e-4, "Pa": 1e5, "A": 1.0, "Wb": 1e-5}[data.unit]
        scale = max(scale, abs(data.values[0]))
        moved = float(np.max(np.abs(data.values - data.values[0])))
        assert moved < 1e-9 * scale, channel  # round-off of 2e-16, in loops of up to 1e4
    assert max(map(abs, found.point.start.residual.values())) < 1e-9
    assert max(map(abs, found.point.inflow.values()), default=0.0) < 1e-15


@pytest.mark.slow
def test_forces_on_the_needle_of_the_open_brake_valve_add_up():
    record = points(
        read_case_tree(VALVES / "brake_valve_hot.yaml"), base=Conditions(current={"coil": 2.0})
    )

    lift = one(record, "arm tip displacement")
    assert 250e-6 < lift < 251e-6  # on its upper stop
    area = pi / 4 * np.array([0.9e-3**2, 7e-3**2 - 0.9e-3**2, 7e-3**2])
    p = [one(record, f"{name} pressure") - AMBIENT for name in ("caliper", "acc", "armch")]
    forces = [
        -12.0 - 3e3 * lift,
        -1e8 * (lift - 250e-6),
        area[0] * p[0] + area[1] * p[1] - area[2] * p[2],
        one(record, "coil armature force"),
        one(record, "valve jet force"),
    ]
    assert abs(sum(forces)) < 1e-9 * sum(map(abs, forces))
    flows = [one(record, f"{name} volume flow") for name in ("feed", "valve", "back")]
    np.testing.assert_allclose(flows, flows[0], rtol=1e-12)
    assert one(record, "coil voltage") == pytest.approx(2.0 * 4.0 * 1.393, rel=1e-13)


@pytest.mark.slow
def test_the_energised_pilot_lets_the_control_volume_down():
    """12 A open the pilot: the two throttles divide the rail pressure, and the needle lifts."""
    tree = read_case_tree(VALVES / "pilot_injector.yaml")

    closed, opened = (points(tree, base=Conditions(current={"coil": i})) for i in (0.0, 12.0))

    assert one(closed, "control pressure") > 0.99 * 1600e5
    assert one(opened, "control pressure") < 0.8 * 1600e5
    assert one(closed, "needle tip displacement") < 0.0 < 200e-6
    assert one(opened, "needle tip displacement") > 200e-6
    through = [one(opened, f"{name} mass flow") for name in ("Z", "guide", "A")]
    assert through[0] == pytest.approx(through[1] + through[2], rel=1e-10)


# --------------------------------------------------------------------------- one point or several


def test_the_magnet_holds_what_it_would_not_lift():
    """1.6 A pull with 20 N over the whole gap, below the 25 N of the spring; with 180 N close."""
    tree = written(MAGNET)

    low = points(tree, base=Conditions(current={"coil": 1.6}))
    high = points(tree, base=Conditions(current={"coil": 1.6}), origin="far")

    assert one(low, "needle tip displacement") < 0.0
    assert one(low, "coil armature force") == pytest.approx(pull(1.6, -4.8e-9), rel=1e-4)
    assert one(high, "needle tip displacement") > 100e-6
    assert one(high, "needle static stiffness") == pytest.approx(1e9, rel=1e-2)
    for record in (low, high):
        assert len(record.warnings) == 1
        assert "more than one operating point" in record.warnings[0]
        assert "100.2 um" in record.warnings[0]


def test_a_single_point_is_told_without_a_word():
    record = points(written(MAGNET), base=Conditions(current={"": 0.0}))

    assert record.warnings == ()
    assert one(record, "seat contact force") == pytest.approx(25.0 * 1e9 / (1e9 + 1e4), rel=1e-12)


IRON = (
    "      iron: [{material: X6Cr17, length: 40 mm, area: 28 mm^2, "
    "hysteresis: {coercivity: 200 A/m, initial_permeability: 150}}]\n"
)
MAGNET_IN_SERIES = (
    "      magnets: [{polarity: with-coil, remanence: 0.3 T, recoil_permeability: 1.05, "
    "length: 1 mm, area: 40 mm^2}]\n"
)


@pytest.mark.slow
def test_iron_with_hysteresis_is_told_to_lie_on_its_mean_curve():
    plain = IRON[: IRON.index(", hysteresis")] + "}]\n"
    base = Conditions(current={"coil": 1.0})
    marked, mean = (
        points(written(MAGNET.replace("    driver:", f"{iron}    driver:")), base=base)
        for iron in (IRON, plain)
    )

    force = one(mean, "coil armature force")
    assert one(marked, "coil armature force") == pytest.approx(force, rel=1e-13)  # round-off
    assert mean.warnings == ()
    assert [text for text in marked.warnings if "'coil' has iron with hysteresis" in text]


def test_a_permanent_magnet_pulls_without_a_current():
    """Magnet and gap in series, 3 mm in radius and 150 um wide, by hand."""
    tree = written(MAGNET.replace("    driver:", f"{MAGNET_IN_SERIES}    driver:"))

    record = points(tree, base=Conditions(current={"coil": 0.0}))

    gap = 150e-6 - one(record, "needle tip displacement")
    area = pi * 3e-3**2
    strength = 0.3 * 1e-3 / (MU0 * 1.05)
    flux = strength / (1e-3 / (MU0 * 1.05 * 40e-6) + gap / (MU0 * area))
    assert one(record, "coil armature force") == pytest.approx(flux**2 / (2 * MU0 * area), rel=1e-6)


def test_voltage_and_current_are_two_ways_to_say_the_same():
    tree = written(MAGNET)

    by_voltage = points(tree, base=Conditions(voltage={"coil": 2.0}))
    by_current = points(tree, base=Conditions(current={"coil": 1.0}))

    assert one(by_voltage, "coil current") == pytest.approx(1.0, rel=1e-15)
    assert one(by_voltage, "coil armature force") == one(by_current, "coil armature force")


def test_an_armature_between_its_stops_that_a_magnet_would_pull_away_does_not_hold():
    """Held halfway the point is one of all balances but that of the needle: its force is told."""
    record = points(written(MAGNET), base=Conditions(current={"": 1.6}, lift=50e-6))

    assert one(record, "needle holding force") == pytest.approx(
        25.0 + 1e4 * 50e-6 - pull(1.6, 50e-6), rel=1e-9
    )


def test_bodies_are_looked_for_at_their_far_stops():
    rows = written(MAGNET).case().network.network().rows()

    assert far_ends(rows) == [{"needle": pytest.approx(100e-6)}]
    drawn_open = MAGNET.replace("gap: 0 um", "gap: 130 um")
    rows = written(drawn_open).case().network.network().rows()
    assert far_ends(rows) == [{"needle": pytest.approx(-130e-6)}]


# --------------------------------------------------------------------------- doubts and errors


def test_an_enclosed_volume_keeps_its_pressure_and_says_so():
    record = points(written(SHUT))

    assert one(record, "inlet pressure") == pytest.approx(7e5, rel=1e-11)
    assert "'inlet'" in record.warnings[0]
    assert "no open path" in record.warnings[0]


def test_a_flow_without_a_way_out_is_an_error():
    text = SHUT.replace("flow: 0 l/min", "flow: 1 l/min")

    with pytest.raises(InputError, match=r"'inlet' with a forced flow in") as error:
        points(written(text))

    assert "open the valve" in str(error.value)


def test_a_chamber_that_is_pumped_empty_is_an_error():
    text = SHUT.replace("flow: 0 l/min", "flow: 1 l/min").replace("pump.b,", "pump.a,")

    with pytest.raises(InputError, match=r"'inlet' with a forced flow in or out"):
        points(written(text.replace("- [valve.b, ambient]", "- [valve.b, pump.b, ambient]")))


def test_a_needle_that_nothing_holds_is_an_error():
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "push": ConstantForce(force=-25.0),
        "stop": EndStop(gap=1e-4, law={"kind": "linear", "stiffness": 1e9}),
    }
    joints = [["needle.tip", "push.end", "stop.lower"], ["ground", "stop.upper"]]
    rows = Network(parts, joints).rows()

    with pytest.raises(InputError, match="'needle', unsupported"):
        operating_point(rows)


def test_an_armature_that_a_force_takes_out_of_reach_of_its_magnet_is_an_error():
    """It used to creep towards the end of the range of the magnet for minutes."""
    text = "\n".join(line for line in MAGNET.splitlines() if "seat" not in line)
    text = text.replace(
        "- [ground, stop.upper]",
        "- [needle.tip, push.end, stop.lower, coil.armature]\n    - [ground, stop.upper]",
    ).replace(
        "spring: {type: spring, stiffness: 10 N/mm, preload: 25 N}",
        "push: {type: constant-force, force: -25 N}",
    )

    with pytest.raises(ConvergenceError, match="magnet of 'coil'"):
        points(written(text))


def test_friction_that_may_hold_a_needle_elsewhere_is_told():
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=-0.5),
        "guide": GuideFriction(coulomb=0.2, breakaway=0.3),
    }
    point = operating_point(Network(parts, [["needle.tip", "spring.end", "guide.body"]]).rows())

    assert point.start.displacement["needle.tip"] == pytest.approx(50e-6, rel=1e-12)
    assert point.friction["needle"] == pytest.approx(0.3 / 1e4, rel=1e-6)


@pytest.mark.parametrize(
    ("conditions", "words"),
    [
        (Conditions(current={"coli": 1.0}), "coil 'coli'"),
        (Conditions(current={"coil": -1.0}), "0 A or more"),
        (Conditions(current={"coil": 1.0}, voltage={"": 2.0}), "more than one statement"),
        (Conditions(lift=150e-6), "between the stops"),
        (Conditions(lift=-50e-6), "between the stops"),
    ],
)
def test_conditions_that_cannot_be_are_refused(conditions, words):
    with pytest.raises(InputError, match=words):
        points(written(MAGNET), base=conditions)


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        (("network.components.spring.preloda", "1 N", "2 N", 3), "did you mean 'preload'"),
        (("network.components.spring.preload", "1", "2 N", 3), "unit"),
        (("network.components.spring.preload", "1 N", "2 mm", 3), "force"),
        (("network.components.spring.stiffness", "-1 N/m", "2 N/m", 3), "greater than 0"),
        (("network.components.needle.points", "1 N", "2 N", 3), "no number with a unit"),
        (("lift", "0 um", "0 um", 3), "two different ends"),
        (("lift", "0 um", "10 um", 1), "2 or more"),
        (("lift", "0 um", "10 um", 5000), "2000 at most"),
    ],
)
def test_a_sweep_that_cannot_be_is_refused(sweep, words):
    with pytest.raises(InputError, match=words):
        points(written(MAGNET), sweep)


def test_a_law_out_of_its_range_is_told():
    """A map that ends at 1 A, and a coil that carries 3 A."""
    coil = """
      type: force-map-solenoid
      resistance: 2 ohm
      gap: 200 um
      current: [0 A, 0.5 A, 1 A]
      gaps: [50 um, 100 um, 200 um, 300 um]
      linkage:
        - [0 mWb, 0 mWb, 0 mWb, 0 mWb]
        - [2 mWb, 1.2 mWb, 0.8 mWb, 0.6 mWb]
        - [4 mWb, 2.4 mWb, 1.6 mWb, 1.2 mWb]
"""
    head, tail = MAGNET.index("\n      type: solenoid"), MAGNET.index("    driver:")

    record = points(
        written(MAGNET[:head] + coil + MAGNET[tail:]), base=Conditions(current={"": 3.0})
    )

    assert one(record, "coil current") == pytest.approx(3.0, rel=1e-12)
    assert any("leaves the range of the map of 'coil'" in text for text in record.warnings)


def test_two_values_for_one_coil_are_refused():
    with pytest.raises(InputError, match="one value for each coil"):
        stated_drive(["coil=1 A", "coil=2 A"], "--current", CURRENT)


# --------------------------------------------------------------------------- sweeps


def test_force_over_gap_and_current_is_that_of_one_gap(tmp_path):
    record = points(written(MAGNET), ("lift", "0 um", "90 um", 4), ("current", "0 A", "2 A", 3))

    lift, current = (item.values for item in record.swept)
    force = record.quantity("coil armature force")
    held = record.quantity("needle holding force")
    assert force is not None
    assert held is not None
    assert record.count == 12
    np.testing.assert_allclose(lift[:4], [0.0, 30e-6, 60e-6, 90e-6], rtol=1e-12)
    np.testing.assert_allclose(current, np.repeat([0.0, 1.0, 2.0], 4))
    expected = [pull(i, y) for i, y in zip(current, lift, strict=True)]
    np.testing.assert_allclose(force.values, expected, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(held.values, 25.0 + 1e4 * lift - expected, rtol=1e-9)
    write_csv(record, tmp_path / "points.csv")
    lines = (tmp_path / "points.csv").read_text().splitlines()
    assert len(lines) == 13
    assert lines[0].startswith("lift [m],current [A],")


def test_a_key_is_swept_as_if_the_case_said_so():
    sweep = ("network.components.spring.preload", "10 N", "30 N", 3)

    record = points(written(MAGNET), sweep)

    alone = [points(written(MAGNET.replace("preload: 25 N", f"preload: {x} N"))) for x in (10, 30)]
    force = record.quantity("seat contact force")
    assert force is not None
    for value, single in zip(force.values[[0, -1]], alone, strict=True):
        assert value == one(single, "seat contact force")


def test_every_chart_of_a_sweep_has_its_own_name():
    record = points(read_case_tree(VALVES / "brake_valve_hot.yaml"), ("lift", "0 um", "250 um", 3))

    names = [chart.name for chart in sweep_charts(record)]

    assert len(names) == len(set(names)) > 4
    (chosen,) = sweep_charts(record, "feed volume flow", ["caliper pressure"])
    assert chosen.x.text == "feed volume flow [l/min]"
    assert chosen.panels[0].y.text == "caliper pressure [bar]"
    curve = chosen.panels[0].curves[0]
    assert curve.y[0] == pytest.approx(80.0, rel=1e-9)  # shut: the pressure of the source


def test_points_that_do_not_settle_are_marked():
    record = points(written(SHUT), ("network.components.pump.flow", "0 l/min", "1 l/min", 3))

    pressure = record.quantity("inlet pressure")
    assert pressure is not None
    assert record.found.tolist() == [True, False, False]
    np.testing.assert_array_equal(np.isnan(pressure.values), [False, True, True])
    assert "forced flow in" in record.failures[1]
    assert record.warnings[0].startswith("2 of 3 points were not found")


def test_a_sweep_without_a_single_point_is_the_error_of_its_first_one():
    with pytest.raises(InputError, match="with a forced flow in or out"):
        points(written(SHUT), ("network.components.pump.flow", "1 l/min", "2 l/min", 2))


# --------------------------------------------------------------------------- held at time zero


def test_sources_and_forces_are_held_at_their_value_at_time_zero():
    table = PressureTable(time=(-1e-3, 1e-3), pressure=(1e5, 3e5))
    parts = {
        "supply": PressureSource(table=table),
        "pump": FlowSource(flow=1e-6, step=FlowStep(to=2e-6, at=0.0)),
        "hole": Orifice(diameter=1e-3),
        "room": Chamber(volume=1e-6, pressure=9e5),
        "push": ForceOverTime(time=(-1.0, 1.0), force=(2.0, 6.0)),
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "stop": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e8}),
        "spring": Spring(stiffness=1e4, preload=10.0),
    }
    joints = [
        ["supply.fluid", "hole.a"],
        ["hole.b", "room.fluid", "pump.b"],
        ["needle.tip", "push.end", "spring.end", "stop.upper"],
        ["ground", "stop.lower"],
    ]

    held = Network(parts, joints, fluid=library_fluid("n-heptane").at(293.15)).at_start()

    assert held.components["supply"] == PressureSource(pressure=2e5)
    assert held.components["pump"] == FlowSource(flow=1e-6)
    assert held.components["push"] == ConstantForce(force=4.0)
    point = operating_point(held.rows())
    assert point.start.flow["hole"] == pytest.approx(-point.start.flow["pump"], rel=1e-12)
    assert point.start.stated == {"room": False}
