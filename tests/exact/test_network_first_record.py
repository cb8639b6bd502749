"""Truth: the geometry of a cone seat. What follows from the lift is right before the first step."""

from math import cos, pi, sin

import pytest

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.seat import Seat
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
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
        if not name.endswith(("force", "flow")):  # means over the record before
            assert channel.values[0] == first.channels[name].values[-1], name
