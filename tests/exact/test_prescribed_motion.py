"""A lift curve moves a body exactly, whatever pushes it; its work is a supply."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.mechanics.end_stop import EndStop
from klack.mechanics.friction import GuideFriction
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network

TIME = (0.0, 0.1e-3, 0.3e-3, 0.6e-3, 0.8e-3)
PLACE = (0.0, 40e-6, 100e-6, 100e-6, 5e-6)
LIFT = PrescribedMotion(time=TIME, displacement=PLACE)
LAW = LinearStopLaw(kind="linear", stiffness=1e8)


def curve(t):
    return PchipInterpolator(TIME, PLACE)(np.minimum(t, TIME[-1]))


@pytest.mark.parametrize("keys", [{}, {"coarse": 1}, {"step": 5e-9}, {"step": 100e-9}])
def test_it_follows_its_curve_against_impacts_and_friction(keys):
    parts = {
        "lift": LIFT,
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
        "lift": LIFT,
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
        "lift": LIFT,
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
        "lift": LIFT,
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e3, preload=0),
        "stop": EndStop(gap=20e-6, law=LAW),
    }
    low = "ground"
    if other == "driven":
        parts["second"], low = LIFT, "second.body"
    ends = [["needle.body", "spring.end"], ["lift.body", "stop.upper"], [low, "stop.lower"]]

    with pytest.raises(InputError, match="nothing that gives way"):
        Network(parts, ends).rows()
