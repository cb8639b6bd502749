"""Variants of a network: without fluid, lumped, and with parts added."""

import numpy as np
import pytest

from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ConstantForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import GROUND
from klack.reduction.reduced_body import ReducedBody

FILM = {"shape": "disc", "radius": 2e-3, "roughness": 0.2e-6}


def body(name: str, rigid: int, ports: tuple[str, ...]) -> ReducedBody:
    """Two modes, the first one rigid for a free body."""
    shapes = np.arange(1.0, 1.0 + 2 * len(ports)).reshape(2, -1)
    shapes[:rigid] = 1.0 / np.sqrt(3e-3)
    return ReducedBody(
        name=name,
        mass=3e-3,
        omega=np.array([0.0 if rigid else 1e5, 2e5]),
        damping=np.full(2, 1e-3),
        port_names=ports,
        port_shapes=shapes,
        observer_names=(),
        observer_shapes=np.zeros((2, 0)),
        static_compliance=np.eye(len(ports)) * 1e-9,
        rigid_count=rigid,
        rigid_axial=np.full(rigid, np.sqrt(3e-3)),
        dof_count=99,
    )


def valve(film: dict | None = None) -> Network:
    """Flexible needle and housing, two stops, a spring, a face in a chamber with a drain."""
    stop = {"law": {"kind": "linear", "stiffness": 2e9}, "film": film}
    parts = {
        "needle": FlexibleBody.of(body("needle", 1, ("tip", "top", "rim")), ("top", "tip")),
        "housing": FlexibleBody.of(body("housing", 0, ("seat", "stop"))),
        "spring": Spring(stiffness=5e3, preload=20.0),
        "seat": EndStop(gap=0.0, **stop),
        "opening": EndStop(gap=80e-6, series_compliance=1e-9, **stop),
        "sac": Chamber(volume=1e-9),
        "face": PressureFace(direction="opening", area=1e-6),
        "drain": Orifice(diameter=0.2e-3),
    }
    connections = [
        ["needle.tip", "seat.upper", "face.body"],
        ["needle.top", "opening.lower", "spring.end"],
        ["housing.seat", "seat.lower"],
        ["housing.stop", "opening.upper"],
        ["sac.fluid", "face.fluid", "drain.a"],
        ["drain.b", "ambient"],
    ]
    return Network(parts, connections, fluid=FluidChoice(name="n-heptane").at(293.15))


def test_the_whole_valve_becomes_rows():
    rows = valve().rows()

    assert [row.component for row in rows.bodies] == ["needle", "housing"]
    assert [row.component for row in rows.interfaces] == ["seat", "opening"]
    assert len(rows.walls) == len(rows.branches) == 1
    assert len(rows.nodes) == 2  # sac and ambient
    needle = rows.bodies[0]
    assert needle.body.port_names == ("top", "tip")
    assert rows.interfaces[0].upper == needle.ports[1] == rows.walls[0].port
    assert rows.interfaces[1].lower == needle.ports[0]


def test_ports_of_a_flexible_body_keep_their_shapes():
    full = body("needle", 1, ("tip", "top", "rim"))

    chosen = FlexibleBody.of(full, ("rim", "tip")).reduced

    assert chosen.port_shapes == pytest.approx(full.port_shapes[:, [2, 0]])
    assert chosen.static_compliance == pytest.approx(full.static_compliance[np.ix_([2, 0], [2, 0])])


def test_dry_leaves_mechanics_alone():
    wet = valve(FILM)

    dry = wet.dry()

    assert set(dry.components) == {"needle", "housing", "spring", "seat", "opening"}
    assert dry.fluid is None
    rows = dry.rows()
    assert rows.nodes == {}
    assert rows.walls == rows.branches == []
    assert all(row.film is None for row in rows.interfaces)
    assert all(row.film is not None for row in wet.rows().interfaces)
    assert [row.law for row in rows.interfaces] == [row.law for row in wet.dry().rows().interfaces]


def test_lumped_makes_one_mass_and_two_springs():
    rows = valve(FILM).lumped(1e9, 0.3).rows()

    assert len(rows.bodies) == 1
    assert rows.bodies[0].body.mass == 3e-3
    assert rows.bodies[0].body.mode_count == 1
    seat, opening = rows.interfaces
    assert seat.lower == opening.upper == GROUND
    assert seat.law.flat().parameters[0] == opening.law.flat().parameters[0] == 1e9
    assert seat.law.flat().dissipation > 0.0
    assert opening.series_compliance == 0.0
    assert opening.film is not None
    assert len(rows.walls) == 1


def test_dry_and_lumped_commute():
    first, second = valve(FILM).dry().lumped(1e9), valve(FILM).lumped(1e9).dry()

    assert set(first.components) == set(second.components)
    assert first.connections == second.connections
    assert first.fluid is None
    assert second.fluid is None


def test_a_film_keeps_the_fluid_of_a_lumped_valve_without_chambers():
    wet = valve(FILM)
    kept = {key: wet.components[key] for key in ("needle", "housing", "spring", "opening")}
    small = Network(kept, [wet.connections[1], wet.connections[3]], fluid=wet.fluid)

    assert small.lumped(1e9).rows().interfaces[0].film is not None


def test_a_flexible_needle_starts_with_its_speed_also_when_lumped():
    needle = FlexibleBody.of(body("needle", 1, ("tip",)), speed=-0.4)
    stop = EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e9})
    network = Network(
        {"needle": needle, "stop": stop}, [["needle.tip", "stop.upper"], ["stop.lower", "ground"]]
    )

    assert network.rows().bodies[0].speed == -0.4
    assert network.lumped(1e9).rows().bodies[0].speed == -0.4


def test_parts_can_be_added_where_others_are():
    network = valve().with_components(
        {"magnet": ConstantForce(force=40.0)}, [["needle.top", "magnet.end"]]
    )

    rows = network.rows()

    assert len(network.connections) == 6
    magnet = next(row for row in rows.elements if row.component == "magnet")
    assert magnet.ports == (rows.bodies[0].ports[0],)


def test_parts_can_be_replaced():
    network = valve().with_components({"spring": Spring(stiffness=1e4, preload=5.0)})

    assert network.rows().elements[0].parameters[0] == 1e4


def test_a_flexible_body_without_modes_says_where_they_come_from():
    with pytest.raises(InputError, match=r"FlexibleBody\.of"):
        Network({"needle": FlexibleBody(body="needle", points=("tip",))}, []).rows()


def test_a_flexible_body_names_the_ports_it_has():
    with pytest.raises(InputError, match=r"no port .tipp.[^\n]*\n.*did you mean .tip."):
        FlexibleBody.of(body("needle", 1, ("tip", "top")), ("tipp",))


def test_a_held_body_cannot_start_with_a_speed():
    with pytest.raises(InputError, match="which is supported"):
        FlexibleBody.of(body("housing", 0, ("seat",)), speed=0.1)


def test_lumped_keeps_points_apart_in_the_results():
    assert valve().lumped(1e9).components["needle"] == RigidMass(mass=3e-3, points=("top", "tip"))
