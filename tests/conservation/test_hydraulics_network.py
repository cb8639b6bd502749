"""Truth: mass and energy of small hydraulic networks, run by the time loop."""

import numpy as np
import pytest

from klack.hydraulics.annulus import Annulus
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

FLUIDS = {
    "liquid": library_fluid("n-heptane").at(293.15),
    "with gas": library_fluid("n-heptane").at(293.15, gas_fraction=1e-3),
}
BAR = 1e5
AREA = np.pi / 4 * 4e-3**2


def run(parts, connections, fluid, duration=2e-4, step=20e-9, coarse=1):
    rows = Network(parts, connections, fluid=FLUIDS[fluid]).rows()
    return simulate_network(
        rows, duration=duration, step=step, coarse=coarse, record=1e-6, start="free"
    )


def closed_valve():
    """A needle between two rooms that only a seat, a guide gap and a channel connect."""
    parts = {
        "needle": RigidMass(mass=3e-3, speed=0.2),
        "spring": Spring(stiffness=2e4, preload=0.0),
        "below": Chamber(volume=60e-9, pressure=8 * BAR),
        "above": Chamber(volume=90e-9, pressure=5 * BAR),
        "lower": PressureFace(direction="opening", outer_diameter=4e-3),
        "upper": PressureFace(direction="closing", outer_diameter=4e-3),
        "seat": Seat(
            shape="cone", diameter=1.5e-3, half_angle=0.8, lift=20e-6, land_width=0.1e-3,
            flow_force={"damping_length": 1e-3},
        ),
        "guide": Annulus(diameter=4e-3, length=8e-3, clearance=6e-6),
        "channel": Inertance(length=8e-3, diameter=0.8e-3),
    }  # fmt: skip
    connections = [
        ["needle.body", "spring.end", "lower.body", "upper.body", "seat.needle", "guide.needle"],
        ["below.fluid", "lower.fluid", "seat.a", "guide.a", "channel.a"],
        ["above.fluid", "upper.fluid", "seat.b", "guide.b", "channel.b"],
    ]
    return parts, connections


@pytest.mark.parametrize("fluid", FLUIDS)
@pytest.mark.parametrize("coarse", [1, 16])
def test_a_closed_valve_keeps_its_fluid_and_its_energy(fluid, coarse):
    result = run(*closed_valve(), fluid, coarse=coarse)

    y = result.channels["needle.body displacement"].values
    held = {
        name: (volume + sign * AREA * y)
        * FLUIDS[fluid].density(result.channels[f"{name} pressure"].values)
        for name, volume, sign in (("below", 60e-9, 1.0), ("above", 90e-9, -1.0))
    }
    total = held["below"] + held["above"]
    assert np.ptp(held["below"]) > 1e-4 * total[0]  # fluid went to and fro
    # 1e-10: accuracy of the fluid table
    np.testing.assert_allclose(total, total[0], rtol=1e-9)
    assert result.books.relative_residual < 1e-9
    losses = result.books.losses
    assert all(losses[f"{part} flow"] > 0.0 for part in ("seat", "guide", "channel"))
    assert all(loss >= 0.0 for loss in losses.values())


HELD = ["needle.body", "spring.end"]


def held_needle():
    """A body that no fluid touches: every network has one."""
    return {"needle": RigidMass(mass=1e-3), "spring": Spring(stiffness=2e4, preload=0.0)}


def test_a_pump_fills_a_chamber_with_what_it_says():
    parts = {
        **held_needle(),
        "room": Chamber(volume=50e-9),
        "pump": FlowSource(flow=1e-6),
    }
    fluid = FLUIDS["liquid"]
    result = run(parts, [["pump.b", "room.fluid"], HELD], "liquid")

    p = result.channels["room pressure"].values
    gained = 50e-9 * (fluid.density(p) - fluid.density(p[0]))
    pumped = 1e-6 * fluid.density(101_325.0) * result.time
    np.testing.assert_allclose(gained[1:], pumped[1:], rtol=1e-8)
    assert p[-1] - p[0] == pytest.approx(3.6e6, rel=0.03)  # K Q t / V, K = 0.9 GPa
    assert result.books.relative_residual < 1e-9
    assert sum(result.books.supplies.values()) > 0.0


def test_flow_from_a_rail_settles_where_two_throttles_share_the_drop():
    parts = {
        **held_needle(),
        "rail": PressureSource(pressure=6 * BAR),
        "first": Orifice(diameter=0.3e-3, cavitation=None),
        "room": Chamber(volume=2e-9),
        "second": Orifice(diameter=0.3e-3, count=2, cavitation=None),
    }
    connections = [
        ["rail.fluid", "first.a"],
        ["first.b", "room.fluid", "second.a"],
        ["second.b", "ambient"],
        HELD,
    ]

    result = run(parts, connections, "liquid")

    # equal flow through areas 1 : 2, turbulent; the density differs by 4e-4
    p = result.channels["room pressure"].values[-1]
    assert (6 * BAR - p) / (p - 101_325.0) == pytest.approx(4.0, rel=2e-3)
    first = result.channels["first mass flow"].values[-1]
    assert first == pytest.approx(result.channels["second mass flow"].values[-1], rel=1e-9)
    assert result.books.relative_residual < 1e-9


@pytest.mark.parametrize("excess", [10.0, 1e4])
def test_a_column_without_friction_gives_back_what_it_took(excess):
    """No loss, at no amplitude: its kinetic energy follows from the pressures that do the work.

    Pressures settle to 3e-5 of the ambient pressure before their last Newton step, 3 Pa.  A column
    that does not see that step gave back 2e-4 of the energy here; round-off leaves 1e-13.
    """
    size, length, volume = 1e-3, 5e-3, 50e-9
    parts = {
        **held_needle(),
        "tank": PressureSource(pressure=101_325.0),
        "neck": Inertance(length=length, diameter=size, friction="none"),
        "room": Chamber(volume=volume, pressure=101_325.0 + excess),
    }
    connections = [["tank.fluid", "neck.a"], ["neck.b", "room.fluid"], HELD]

    result = run(parts, connections, "liquid", duration=5e-4, step=0.25e-6)

    start = result.books.stores_before["room compression"]
    # the mean pressure acts: next to nothing is lost by the step, 0.51 of its end
    assert 0.0 <= result.books.losses["room implicit step"] < 0.1 * start
    # round-off of the pressure energy that is left of its change by 3 Pa
    assert abs(result.books.losses["neck flow"]) < 1e-10 * start
    assert result.books.relative_residual < 1e-9


@pytest.mark.parametrize("direction", ["opening", "closing"])
def test_a_source_pays_for_the_room_behind_a_face(direction):
    """It fills what the body sweeps: (p - p_amb) A y, not only what flows away."""
    area, pressure = 1.5e-6, 17e5
    parts = {
        "body": RigidMass(mass=0.07, speed=0.1),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "rail": PressureSource(pressure=pressure),
        "face": PressureFace(direction=direction, area=area),
    }
    joints = [["body.body", "spring.end", "face.body"], ["rail.fluid", "face.fluid"]]
    rows = Network(parts, joints, fluid=FLUIDS["liquid"]).rows()
    result = simulate_network(rows, duration=1e-3, step=5e-8, record=1e-6, start="free")

    travelled = np.diff(result.channels["body.body displacement"].values[[0, -1]])[0]
    sign = 1.0 if direction == "opening" else -1.0
    work = sign * (pressure - 101325) * area * travelled
    assert abs(travelled) > 1e-5
    assert result.books.supplies["rail pressure"] == pytest.approx(work, rel=1e-9, abs=0.0)
    assert result.books.relative_residual <= 1e-12
