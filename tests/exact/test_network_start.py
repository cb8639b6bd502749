"""The start of a network and its first record.

The static start of a network.

Truth: Hooke's law for the rest position, the energy of the spring for what comes after it, and the
decay of a damped oscillator.

The record before the first step holds the values of the started state, of every channel.

Truth: the geometry of a cone seat; continuity (what is smooth changes little within a record); the
force of a spring and of a squeeze film at the moment at which a flight begins.

The first record of the force of a driven body is that of its surroundings at rest.

A lift curve moves a body exactly, whatever pushes it; its work is a supply.
"""

from math import cos, pi, sin

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from klack.contact.laws import gonthier_coefficient
from klack.errors import InputError
from klack.hydraulics.annulus import Annulus
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.gravity import Gravity
from klack.mechanics.imported_fmu import ImportedFmu
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

MASS, STIFFNESS, FORCE = 2e-3, 1e9, 12.0
PULLED = 20e-6  # [s]


def pressed(step: float, *, restitution: float, pull: float, **law: float) -> NetworkResult:
    """A mass is pressed onto a stop from the start on, and pulled at a known time."""
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "seat": EndStop(gap=0.0, law={"kind": "linear", **law}, restitution=restitution),
        "force": ForceOverTime(
            time=(0.0, PULLED, PULLED + 1e-9, 1.0),
            force=(-FORCE, -FORCE, pull - FORCE, pull - FORCE),
        ),
    }
    joints = [["needle.tip", "seat.upper", "force.end"], ["seat.lower", "ground"]]
    return simulate_network(
        Network(parts, joints).rows(), duration=100e-6, step=step, coarse=1, record=4 * step
    )


@pytest.mark.parametrize("step", [20e-9, 5e-9])
def test_a_pressed_mass_rests_at_hookes_depth_and_leaves_with_its_energy(step):
    result = pressed(step, restitution=1.0, pull=FORCE, stiffness=STIFFNESS)

    way = result.channels["needle.tip displacement"].values
    held = result.time < PULLED - 1e-6
    np.testing.assert_allclose(way[held], -FORCE / STIFFNESS, rtol=1e-9)
    speed = result.channels["needle.tip velocity"].values[-1]
    # the force ends within 1 ns, and the step resolves 0.014 of the period over 2 pi
    assert speed == pytest.approx(FORCE / np.sqrt(STIFFNESS * MASS), rel=1e-4)


@pytest.mark.parametrize("step", [20e-9, 5e-9])
@pytest.mark.parametrize("stiffness", [1e9, 3e7])
@pytest.mark.parametrize("restitution", [0.5, 0.8])
def test_a_resting_contact_has_half_of_its_factor_as_damping_ratio(restitution, stiffness, step):
    """Pulled by a little, it swings beyond by exp(-pi zeta / sqrt(1 - zeta^2)) of the way."""
    pull = 1e-3 * FORCE
    result = pressed(step, restitution=restitution, pull=pull, stiffness=stiffness)

    way = result.channels["needle.tip displacement"].values
    beyond = (way.max() - way[0]) / (pull / stiffness) - 1.0
    zeta = 0.5 * gonthier_coefficient(restitution)
    expected = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
    # the law is not linear: its damping falls with the indentation, 1e-3 of it here
    assert beyond == pytest.approx(expected, abs=3e-3)


LIFT, DIAMETER, ANGLE = 30e-6, 2e-3, 0.7


def test_area_of_an_open_seat_in_the_first_record():
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "below": Chamber(volume=60e-9, pressure=2e5),
        "valve": Seat(shape="cone", diameter=DIAMETER, half_angle=ANGLE, lift=LIFT),
    }
    joints = [
        ["needle.tip", "spring.end", "valve.needle"],
        ["valve.body", "ground"],
        ["below.fluid", "valve.a"],
        ["valve.b", "ambient"],
    ]
    rows = Network(parts, joints, fluid=library_fluid("n-heptane").at(293.15)).rows()
    first = simulate_network(rows, duration=10e-6, record=1e-6, start="free")
    again = simulate_network(rows, duration=10e-6, record=1e-6, state=first.state)

    expected = pi * LIFT * sin(ANGLE) * (DIAMETER - LIFT * sin(ANGLE) * cos(ANGLE))
    assert first.channels["valve area"].values[0] == pytest.approx(expected, rel=1e-12)
    assert first.channels["valve lift"].values[0] == pytest.approx(LIFT, rel=1e-12)
    for name, channel in again.channels.items():
        assert channel.values[0] == first.channels[name].values[-1], name


def begins(result: NetworkResult, expected: dict[str, float]) -> None:
    for name, value in expected.items():
        assert result.channels[name].values[0] == pytest.approx(value, rel=1e-6), name


def steady(result: NetworkResult) -> None:
    """Assert that nothing jumps from the first record to the second."""
    for name, channel in result.channels.items():
        first, second, third = channel.values[:3]
        scale = np.abs(channel.values).max()
        assert abs(second - first) <= 2.0 * abs(third - second) + 1e-6 * scale, name


def held_open() -> Network:
    """A valve that its holding current keeps open against spring and flow."""
    stop = {"gap": LIFT, "law": {"kind": "linear", "stiffness": 1e8}, "series_compliance": 1e-9}
    film = {"shape": "ring", "inner_radius": 1.5e-3, "outer_radius": 2e-3}
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "weight": Gravity(),
        "spring": Spring(stiffness=1e4, preload=2.0, damping=1.0),
        "guide": GuideFriction(coulomb=0.5),
        "stop": EndStop(**stop, film=film, restitution=0.5),
        "push": ForceOverTime(time=(-1e-3, 1e-3), force=(0.5, 0.5)),
        "coil": Solenoid(
            turns=200,
            resistance=2.0,
            gap=LIFT,
            residual_gap=5e-5,
            poles=[{"outer_radius": 3e-3, "fringing": "none"}],
            leakage_share=0.1,
            eddy=[{"conductivity": 1.5e6, "length": 20e-3, "radius": 3.8e-3}],
            start_current=1.0,
        ),
        "supply": VoltageTable(time=[0.0], voltage=[2.0]),
        "rail": PressureSource(table={"time": (-1e-3, 1e-3), "pressure": (20e5, 20e5)}),
        "pump": FlowSource(flow=1e-7),
        "pipe": Line(length=0.1, diameter=2e-3, pressure=20e5),
        "inlet": Chamber(volume=100e-9),
        "sac": Chamber(volume=50e-9),
        "valve": Seat(
            shape="cone",
            diameter=DIAMETER,
            half_angle=ANGLE,
            flow_force={"damping_length": 2e-3},
        ),
        "channel": Inertance(length=5e-3, diameter=1e-3),
        "end": Chamber(volume=50e-9),
        "nozzle": Orifice(diameter=0.3e-3),
        "seal": Annulus(diameter=3e-3, length=5e-3, clearance=4e-6),
        "face": PressureFace(direction="opening", outer_diameter=DIAMETER),
    }
    pushed = ["weight.body", "spring.end", "guide.body", "stop.lower", "push.end", "coil.armature"]
    joints = [
        ["needle.tip", *pushed, "valve.needle", "seal.needle", "face.body"],
        ["stop.upper", "ground"],
        ["coil.terminals", "supply.terminals"],
        ["rail.fluid", "pipe.a"],
        ["pipe.b", "inlet.fluid", "valve.a", "seal.a", "pump.b"],
        ["valve.b", "sac.fluid", "channel.a", "face.fluid"],
        ["channel.b", "end.fluid", "nozzle.a"],
        ["seal.b", "ambient"],
        ["nozzle.b", "ambient"],
    ]
    return Network(parts, joints, fluid=library_fluid("n-heptane").at(293.15))


def test_a_valve_that_is_held_open_stays_as_its_first_record_says():
    result = simulate_network(held_open().rows(), duration=4e-6, step=50e-9, record=0.8e-6)

    assert result.start is not None
    begins(
        result,
        {
            "coil voltage": 2.0,
            "coil current": 1.0,
            "push.end force": 0.5,
            "rail pressure": 20e5,
            "valve mass flow": result.start.flow["valve"],
            "channel mass flow": result.start.flow["channel"],
        },
    )
    for name in ("coil flux", "coil.armature force", "stop contact force", "stop peak force"):
        assert result.channels[name].values[0] > 0.0, name
    for name, channel in result.channels.items():
        if channel.unit == "N s":  # impulses grow: their forces stay
            assert np.diff(channel.values, 2) == pytest.approx(0.0, abs=1e-15), name
            continue
        np.testing.assert_allclose(
            channel.values, channel.values[0], rtol=1e-9, atol=1e-12, err_msg=name
        )


def test_a_map_and_an_fmu_start_with_their_force(spring_damper_fmu):
    gaps, current = np.linspace(-1e-4, 4e-4, 21), np.linspace(0.0, 4.0, 5)
    inductance = 1e-6 / (gaps + 2e-4)
    parts = {
        "armature": RigidMass(mass=5e-3, points=("at",)),
        "coil": ForceMapSolenoid(
            resistance=1.0,
            gap=3e-4,
            current=tuple(current),
            gaps=tuple(gaps),
            linkage=[tuple(inductance * i) for i in current],
            start_current=1.0,
        ),
        "supply": VoltageTable(time=[0.0], voltage=[1.0]),
        "spring": ImportedFmu(
            file=spring_damper_fmu(2),
            coupling_step=1e-6,
            displacement="x",
            velocity="v",
            force="F",
            parameters={"k": 2e5, "c": 1.0},
        ),
    }
    joints = [["armature.at", "coil.armature", "spring.end"]]
    joints += [["coil.terminals", "supply.terminals"]]
    rows = Network(parts, joints).rows()
    result = simulate_network(rows, duration=4e-6, step=50e-9, coarse=1, record=1e-6)

    pull = result.channels["coil.armature force"].values[0]
    assert pull > 1.0
    steady(result)
    begins(
        result,
        {"coil voltage": 1.0, "spring.end force": -pull, "spring force of the FMU": -pull},
    )


def test_a_flight_starts_with_the_forces_of_its_speed(spring_damper_fmu):
    speed, gap = 0.4, 2e-5
    film = {"shape": "ring", "inner_radius": 1.5e-3, "outer_radius": 2e-3, "cut_off": 1e-6}
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",), speed=speed),
        "stop": EndStop(gap=gap, law={"kind": "linear", "stiffness": 1e8}, film=film),
        "spring": Spring(stiffness=1e4, preload=2.0, damping=3.0),
        "guide": GuideFriction(coulomb=0.5, viscous=0.2),
        "device": ImportedFmu(
            file=spring_damper_fmu(2),
            coupling_step=0.2e-6,
            displacement="x",
            velocity="v",
            force="F",
            parameters={"k": 2e3, "c": 5.0},
        ),
    }
    joints = [["needle.tip", "stop.lower", "spring.end", "guide.body", "device.end"]]
    joints += [["stop.upper", "ground"]]
    rows = Network(parts, joints, fluid=library_fluid("n-heptane").at(293.15)).rows()
    result = simulate_network(
        rows, duration=1e-6, step=20e-9, coarse=1, record=0.2e-6, start="free"
    )

    (row,) = rows.interfaces
    assert row.film is not None
    h = gap + row.film.cut_off
    steady(result)
    begins(
        result,
        {
            "spring.end force": -2.0 - 3.0 * speed,
            "guide.body force": -0.5 - 0.2 * speed,
            "device.end force": -5.0 * speed,
            "stop film force": (row.film.cubic / h**3 + row.film.linear / h) * speed,
            "stop peak force": (row.film.cubic / h**3 + row.film.linear / h) * speed,
        },
    )


def drive(**keys):
    parts = {
        "lift": PrescribedMotion(time=(0.0, 1e-3), displacement=(0.0, 1e-4), between="straight"),
        "spring": Spring(stiffness=1e5, preload=20.0),
        "push": ConstantForce(force=3.0),
        "rail": Chamber(volume=1e-3, pressure=6e5),
        "face": PressureFace(direction="opening", area=1e-5),
    }
    nodes = [
        ["lift.body", "spring.end", "push.end", "face.body"],
        ["rail.fluid", "face.fluid"],
    ]
    ambient = Ambient(pressure=1e5, temperature=293.15)
    fluid = library_fluid("n-heptane").at(293.15)
    return simulate_network(Network(parts, nodes, ambient=ambient, fluid=fluid).rows(), **keys)


def test_spring_force_and_pressure_at_rest():
    run = drive(duration=1e-4, record=1e-5)

    force = run.channels["lift drive force"].values
    # it holds 20 N of the spring against 3 N and 5 bar on 10 mm^2, then 1e5 N/m along the lift
    assert force[0] == pytest.approx(20.0 - 3.0 - 5.0, rel=1e-9)
    assert force[1:] == pytest.approx(12.0 + 1e4 * run.time[1:], rel=1e-3)


def test_a_run_that_continues_begins_with_the_force_of_its_end():
    whole = drive(duration=1e-4, record=1e-5)
    first = drive(duration=5e-5, record=1e-5)
    force = drive(duration=5e-5, record=1e-5, state=first.state).channels["lift drive force"].values
    np.testing.assert_allclose(force, whole.channels["lift drive force"].values[5:], rtol=1e-9)
    assert force[0] == first.channels["lift drive force"].values[-1]


def test_a_needle_that_hangs_on_it():
    parts = {
        "lift": PrescribedMotion(time=(0.0, 1e-3), displacement=(0.0, 1e-4), between="straight"),
        "needle": RigidMass(mass=3e-3),
        "between": Spring(stiffness=1e6, preload=0.0),
        "weight": ConstantForce(force=-7.0),
    }
    nodes = [["lift.body", "between.base"], ["needle.body", "between.end", "weight.end"]]

    run = simulate_network(Network(parts, nodes).rows(), duration=1e-5)

    assert run.channels["lift drive force"].values[0] == pytest.approx(7.0, rel=1e-6)


TIME = (0.0, 0.1e-3, 0.3e-3, 0.6e-3, 0.8e-3)
PLACE = (0.0, 40e-6, 100e-6, 100e-6, 5e-6)
LIFT_MOTION = PrescribedMotion(time=TIME, displacement=PLACE)
LAW = LinearStopLaw(kind="linear", stiffness=1e8)


def curve(t):
    return PchipInterpolator(TIME, PLACE)(np.minimum(t, TIME[-1]))


@pytest.mark.parametrize("keys", [{}, {"coarse": 1}, {"step": 5e-9}, {"step": 100e-9}])
def test_it_follows_its_curve_against_impacts_and_friction(keys):
    parts = {
        "lift": LIFT_MOTION,
        "needle": RigidMass(mass=3e-3),
        "stop": EndStop(gap=20e-6, law=LAW, restitution=0.6),
        "spring": Spring(stiffness=1e5, preload=10.0),
        "seat": EndStop(gap=0.0, law=LAW, restitution=0.5),
        "guide": GuideFriction(coulomb=2.0),
        "link": Spring(stiffness=5e4, preload=2.0, damping=20.0),
    }
    # the driven body strikes the needle from below and rubs along it
    ends = [
        ["lift.body", "stop.lower", "guide.guide", "link.base"],
        ["needle.body", "stop.upper", "spring.end", "seat.upper", "guide.body", "link.end"],
        ["seat.lower", "ground"],
    ]
    run = simulate_network(Network(parts, ends).rows(), duration=1e-3, **keys)

    place = run.channels["lift.body displacement"].values
    assert np.abs(place - curve(run.time)).max() <= 1e-17
    assert run.channels["needle.body displacement"].values.max() > 70e-6
    assert abs(run.books.residual) <= 1e-9 * run.books.scale
    assert run.books.supplies["lift motion"] > 0.0
    assert len(run.interfaces["stop"].time) > 10


def test_alone_it_needs_no_force():
    parts = {
        "lift": LIFT_MOTION,
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e3, preload=0),
    }
    run = simulate_network(Network(parts, [["needle.body", "spring.end"]]).rows(), duration=1e-3)

    assert np.all(run.channels["lift drive force"].values == 0.0)
    assert run.books.supplies["lift motion"] == 0.0


def test_a_piston_pushes_its_volume_through_an_orifice():
    ambient, fluid = (
        Ambient(pressure=1e5, temperature=293.15),
        library_fluid("n-heptane").at(293.15),
    )
    speed, area = 0.5, 20e-6
    parts = {
        "piston": PrescribedMotion(
            time=(0.0, 2e-3), displacement=(0.0, -speed * 2e-3), between="straight"
        ),
        "room": Chamber(volume=100e-9, pressure=1e5),
        "face": PressureFace(direction="opening", area=area),
        "hole": Orifice(diameter=1e-3, discharge=0.7, critical_flow_number=1e-3, cavitation=None),
    }
    ends = [
        ["piston.body", "face.body"],
        ["room.fluid", "face.fluid", "hole.a"],
        ["hole.b", "ambient"],
    ]
    rows = Network(parts, ends, ambient=ambient, fluid=fluid).rows()
    run = simulate_network(rows, duration=1.9e-3)

    drop = 0.5 * float(fluid.density(1e5)) * (speed * area / (0.7 * np.pi / 4 * 1e-6)) ** 2
    # the density in the orifice is that of the chamber: 1e-4 more
    assert run.channels["room pressure"].values[-1] - 1e5 == pytest.approx(drop, rel=1e-3)
    assert run.channels["piston drive force"].values[-1] == pytest.approx(-area * drop, rel=1e-3)
    assert abs(run.books.residual) <= 1e-9 * run.books.scale
    assert run.books.supplies["piston motion"] == pytest.approx(
        area * drop * speed * 1.9e-3, rel=2e-2
    )


def test_displacements_count_from_time_zero():
    part = PrescribedMotion(
        time=(-1e-4, 1e-4, 2e-4), displacement=(10e-6, 30e-6, 50e-6), between="straight"
    )
    parts = {
        "lift": part,
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e3, preload=0),
    }
    ends = [["needle.body", "spring.end"], ["lift.body", "spring.base"]]
    run = simulate_network(Network(parts, ends).rows(), duration=3e-4)

    exact = np.interp(run.time, (-1e-4, 1e-4, 2e-4), (10e-6, 30e-6, 50e-6)) - 20e-6
    assert run.channels["lift.body displacement"].values == pytest.approx(exact, abs=1e-17)


def test_it_continues_from_a_stored_state():
    parts = {
        "lift": LIFT_MOTION,
        "needle": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=1e5, preload=0),
    }
    rows = Network(parts, [["needle.body", "spring.end"], ["lift.body", "spring.base"]]).rows()
    half = simulate_network(rows, duration=0.4e-3)
    rest = simulate_network(rows, duration=0.4e-3, state=half.state)

    place = rest.channels["lift.body displacement"].values
    assert np.abs(place - curve(rest.time)).max() <= 1e-17
    assert abs(rest.books.residual) <= 1e-9 * rest.books.scale


@pytest.mark.parametrize("comma", [",", ";", "\t"])
def test_a_file_gives_the_same_curve(tmp_path, comma):
    lines = [f"{1e3 * t:.6g}{comma}{1e6 * y:.6g}" for t, y in zip(TIME, PLACE, strict=True)]
    file = tmp_path / "lift.csv"
    file.write_text("\n".join([f"time{comma}lift", *lines, ""]))

    part = PrescribedMotion(file=file, time_unit="ms", displacement_unit="um")

    assert part.course().displacement == pytest.approx(np.array(PLACE), rel=1e-12)
    assert part.course().time == pytest.approx(np.array(TIME), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,lift\n", "0 displacements at 0 times"),
        ("0,0\n1,2\n1,3\n", "not rising"),
        ("0,0\n1,zwei\n2,1\n", "'1,zwei' in line 2"),
        ("0,0\n1,nan\n", "not finite"),
    ],
)
def test_a_damaged_file_is_one_clear_error(tmp_path, text, words):
    file = tmp_path / "lift.csv"
    file.write_text(text)

    with pytest.raises(InputError, match=words):
        PrescribedMotion(file=file, time_unit="ms", displacement_unit="um")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "an incomplete curve"),
        ({"time": (0.0, 1.0)}, "0 displacements at 2 times"),
        ({"time": (0.0,), "displacement": (0.0,)}, "at least two"),
        ({"time": (0.0, 1.0), "displacement": (0.0, 1.0), "time_unit": "ms"}, "a table and a file"),
        (
            {"time": (0.0, 1.0), "displacement": (0.0, 1.0), "points": ("a", "a")},
            "every name once",
        ),
    ],
)
def test_a_wrong_curve_is_one_clear_error(keys, words):
    with pytest.raises(InputError, match=words):
        PrescribedMotion(**keys)


@pytest.mark.parametrize("other", ["ground", "driven"])
def test_a_stop_against_what_cannot_give_way_is_refused(other):
    parts = {
        "lift": LIFT_MOTION,
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e3, preload=0),
        "stop": EndStop(gap=20e-6, law=LAW),
    }
    low = "ground"
    if other == "driven":
        parts["second"], low = LIFT_MOTION, "second.body"
    ends = [["needle.body", "spring.end"], ["lift.body", "stop.upper"], [low, "stop.lower"]]

    with pytest.raises(InputError, match="nothing that can yield"):
        Network(parts, ends).rows()
