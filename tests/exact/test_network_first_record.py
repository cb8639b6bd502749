"""The record before the first step holds the values of the started state, of every channel.

Truth: the geometry of a cone seat; continuity (what is smooth changes little within a record); the
force of a spring and of a squeeze film at the moment at which a flight begins.
"""

from math import cos, pi, sin

import numpy as np
import pytest

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
from klack.mechanics.force import ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.gravity import Gravity
from klack.mechanics.imported_fmu import ImportedFmu
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

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
