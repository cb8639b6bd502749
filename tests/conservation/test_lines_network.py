"""Truth: dashpot until the echo, mass and energy of lines in a network, run by the time loop."""

from math import exp, pi

import pytest

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network

BAR = 1e5
HEPTANE = library_fluid("n-heptane").at(293.15)


@pytest.mark.parametrize("coarse", [1, 16])
def test_needle_in_front_of_a_line_meets_a_dashpot_until_the_echo(coarse):
    mass, speed, face = 3e-3, -0.5, 1.5e-3
    supply = Line(length=0.06, diameter=2.5e-3, pressure=6 * BAR, friction="none")
    ambient = Ambient(pressure=6 * BAR)  # no net force on the face at rest
    parts = {
        "needle": RigidMass(mass=mass, speed=speed),
        "face": PressureFace(direction="opening", outer_diameter=face),
        "sac": Chamber(volume=1e-9),
        "line": supply,
        "tank": PressureSource(pressure=6 * BAR),
    }
    connections = [
        ["needle.body", "face.body"],
        ["face.fluid", "sac.fluid", "line.a"],
        ["line.b", "tank.fluid"],
    ]
    rows = Network(parts, connections, ambient=ambient, fluid=HEPTANE).rows()

    result = simulate_network(
        rows, duration=100e-6, step=20e-9, coarse=coarse, record=1e-6, start="free"
    )

    area = pi / 4 * face**2
    dashpot = rows.lines[0].impedance * area**2
    lag = 1e-9 / float(HEPTANE.bulk_modulus(6 * BAR)) * rows.lines[0].impedance  # the sac fills
    end = result.time[-1]  # of the last record
    assert 99e-6 < end < supply.echo_time(HEPTANE)
    velocity = result.channels["needle velocity"].values[-1]
    expected = speed * exp(-dashpot * (end - lag) / mass)
    # what is left is of second order in the lag of 0.2 us
    assert velocity == pytest.approx(expected, rel=1e-5)
    assert 1.0 - velocity / speed > 0.01
    assert result.books.relative_residual < 1e-10


@pytest.mark.parametrize("gas", [0.0, 1e-3])
@pytest.mark.parametrize("coarse", [1, 16])
@pytest.mark.parametrize("friction", ["none", "kagawa"])
def test_two_rooms_and_two_lines_keep_their_fluid_and_energy(gas, coarse, friction):
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=gas)
    bore = {"pressure": 5 * BAR, "friction": friction}
    parts = {
        "needle": RigidMass(mass=2e-3),  # a network needs one
        "spring": Spring(stiffness=5e5, preload=0.0),
        "left": Chamber(volume=40e-9, pressure=8 * BAR),
        "right": Chamber(volume=60e-9, pressure=3 * BAR),
        "line": Line(length=0.03, diameter=2e-3, **bore),
        "bypass": Line(length=0.05, diameter=1e-3, segments=2, **bore),
        "hole": Orifice(diameter=0.4e-3),
    }
    connections = [
        ["needle.body", "spring.end"],
        ["left.fluid", "line.a", "bypass.b", "hole.a"],
        ["right.fluid", "line.b", "bypass.a", "hole.b"],
    ]
    rows = Network(parts, connections, fluid=fluid).rows()

    result = simulate_network(
        rows, duration=4e-4, step=20e-9, coarse=coarse, record=1e-6, start="free"
    )

    assert result.books.relative_residual < 1e-10
    assert all(loss >= 0.0 for name, loss in result.books.losses.items() if "line" in name)
    assert result.books.stores_after["line waves"] > 0.0


def test_steady_flow_through_a_line_is_that_of_hagen_and_poiseuille():
    oil = library_fluid("iso-vg-46").at(313.15)
    line = Line(length=0.06, diameter=1e-3, pressure=5 * BAR)
    parts = {
        "needle": RigidMass(mass=2e-3),  # a network needs one
        "spring": Spring(stiffness=5e5, preload=0.0),
        "pump": PressureSource(pressure=6 * BAR),
        "line": line,
        "end": Chamber(volume=20e-9, pressure=4 * BAR),
        "hole": Orifice(diameter=0.5e-3),
    }
    connections = [
        ["needle.body", "spring.end"],
        ["pump.fluid", "line.a"],
        ["line.b", "end.fluid", "hole.a"],
        ["hole.b", "ambient"],
    ]
    rows = Network(parts, connections, fluid=oil).rows()

    result = simulate_network(rows, duration=30e-3, step=100e-9, coarse=8, record=1e-5)

    flow = result.channels["hole mass flow"].values[-1]
    p = result.channels["end pressure"].values[-1]
    mu, rho = float(oil.viscosity(5 * BAR)), float(oil.density(5 * BAR))
    expected = rho * pi * 1e-3**4 / (128.0 * mu * 0.06) * (6 * BAR - p)
    # 4e-4: the line has one density, that of the fluid differs by 1e-4 per bar
    assert flow == pytest.approx(expected, rel=4e-4)


@pytest.mark.parametrize("segments", [1, 2])
def test_a_volume_that_boils_at_the_end_of_a_line_gives_what_the_line_gets(segments):
    """Its pressure energy bends within a step; the first order alone left 3e-7."""
    parts = {
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "pump": FlowSource(flow=3e-6),
        "room": Chamber(volume=3.4e-9, pressure=2.2e5),
        "line": Line(length=0.118, diameter=0.814e-3, pressure=4e5, segments=segments),
        "rail": PressureSource(pressure=4e5, step={"to": 1e5, "at": 1e-4}),
    }
    joints = [
        ["needle.body", "spring.end"],
        ["pump.b", "room.fluid", "line.a"],
        ["line.b", "rail.fluid"],
    ]
    network = Network(parts, joints, fluid=HEPTANE)
    result = simulate_network(network.rows(), duration=2.3e-3, step=1e-7, record=1e-6)

    assert result.channels["room pressure"].values.min() < 5e3  # boils at 4.7 kPa
    assert result.books.relative_residual <= 1e-12
