"""The first record of the force of a driven body is that of its surroundings at rest."""

import numpy as np
import pytest

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.pressure_face import PressureFace
from klack.mechanics.force import ConstantForce
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network


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
