"""Truth: what a restriction refuses and says, and what it hands to the solver."""

import numpy as np
import pytest
from draws import each

from klack.errors import InputError
from klack.hydraulics.annulus import Annulus
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.land_face import LandFace
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import AMBIENT, GROUND, Ambient, Rows

CONE = {"shape": "cone", "diameter": 1.5e-3, "half_angle": 0.8}
HEPTANE = library_fluid("n-heptane").at(293.15)


@each(
    ("build", "text"),
    [
        (lambda: Orifice(), "exactly one of diameter, area"),
        (lambda: Orifice(diameter=1e-3, area=1e-6), "diameter and area together"),
        (lambda: Orifice(diameter=1e-3, hydraulic_diameter=1e-3), "no hydraulic_diameter"),
        (lambda: Orifice(diameter=-1e-3), "greater than 0"),
        (lambda: Orifice(diameter=1e-3, discharge=1.2), "less than or equal to 1"),
        (lambda: Seat(shape="cone", diameter=1e-3), "half_angle, since the shape is cone"),
        (lambda: Seat(shape="ball", diameter=1e-3), "ball_diameter, since the shape is ball"),
        (lambda: Seat(**CONE, ball_diameter=3e-3), "no ball_diameter"),
        (lambda: Seat(**{**CONE, "half_angle": 45.0}), "less than 90 deg"),
        (lambda: Seat(shape="ball", diameter=1e-3, ball_diameter=0.9e-3), "larger than its seat"),
        (lambda: Seat(**CONE, flow_force={"velocity_coefficient": 2.0}), "flow_force"),
        (lambda: Annulus(diameter=4e-3, length=1e-2, clearance=5e-6, eccentricity=1), "less than"),
        (lambda: Chamber(volume=0.0), "greater than 0"),
        (lambda: Inertance(length=1e-3), "exactly one of diameter, area"),
        (lambda: PressureFace(direction="up", area=1e-6), "'opening' or 'closing'"),
        (lambda: PressureFace(direction="opening"), "exactly one of area, outer_diameter"),
        (
            lambda: PressureFace(direction="opening", area=1e-6, inner_diameter=1e-3),
            "no inner_diameter",
        ),
        (
            lambda: PressureFace(direction="opening", outer_diameter=1e-3, inner_diameter=2e-3),
            "less than outer_diameter",
        ),
        (
            lambda: LandFace(direction="opening", outer_diameter=1e-3, inner_diameter=1e-3),
            "less than outer_diameter",
        ),
        (lambda: PressureSource(), "exactly one of pressure, table"),
        (
            lambda: PressureSource(
                table={"time": [0.0], "pressure": [1e5]}, step={"to": 2e5, "at": 0.0}
            ),
            "no step",
        ),
        (
            lambda: PressureSource(table={"time": [0.0, 1.0], "pressure": [1e5]}),
            "1 values at 2 times",
        ),
        (
            lambda: FlowSource(table={"time": [1.0, 1.0], "flow": [0.0, 1.0]}),
            "times that rise",
        ),
        (lambda: FlowSource(), "exactly one of flow, table"),
    ],
)
def test_wrong_numbers_are_refused_in_words(build, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        build()

    assert text in str(caught.value)


def test_a_case_gives_every_number_its_unit():
    numbers = {"shape": "cone", "diameter": "1.5 mm", "half_angle": "45 deg", "leak_area": "2 um^2"}
    seat = Seat.model_validate(
        {**numbers, "flow_force": {"damping_length": "2 mm"}}, context={"path": None}
    )

    assert (seat.diameter, seat.leak_area) == pytest.approx((1.5e-3, 2e-12), rel=1e-12)
    assert seat.half_angle == pytest.approx(np.pi / 4, rel=1e-12)
    with pytest.raises(ValueError, match="a length with its unit"):
        Seat.model_validate({**numbers, "diameter": 1.5}, context={"path": None})


@pytest.mark.parametrize(
    "part",
    [
        Orifice(diameter=1e-3),
        Seat(**CONE),
        Annulus(diameter=4e-3, length=1e-2, clearance=5e-6),
        Chamber(volume=1e-9),
        Inertance(length=1e-3, diameter=1e-3),
        PressureFace(direction="opening", area=1e-6),
        PressureSource(pressure=6e5),
        FlowSource(flow=1e-6),
    ],
    ids=lambda part: part.type,
)
def test_a_network_without_fluid_is_refused(part):
    rows = Rows(ambient=Ambient(), component="part", handles=dict.fromkeys(part.port_kinds(), 0))

    with pytest.raises(InputError, match=r"part: fluid.*no fluid in the network"):
        part.add_rows(rows)


def test_a_chain_of_parts_becomes_branches_between_nodes():
    network = Network(
        components={
            "rail": PressureSource(pressure=6e5),
            "throttle": Orifice(diameter=0.3e-3, count=2),
            "column": Inertance(length=3e-3, diameter=1e-3),
            "sac": Chamber(volume=20e-9, pressure=3e5),
            "second": Chamber(volume=30e-9),
            "pump": FlowSource(flow=1e-6),
            "drain": Orifice(area=1e-7),
            "needle": RigidMass(mass=3e-3),
            "spring": Spring(stiffness=1e4, preload=5.0),
            "tip": PressureFace(direction="opening", outer_diameter=1.5e-3),
        },
        connections=[
            ["rail.fluid", "throttle.a"],
            ["throttle.b", "sac.fluid", "column.a", "tip.fluid"],
            ["column.b", "second.fluid", "pump.b", "drain.a"],
            ["drain.b", "ambient"],
            ["needle.body", "tip.body", "spring.end"],
        ],
        fluid=HEPTANE,
    )

    rows = network.rows()

    ends = {row.component: (row.a, row.b) for row in rows.branches}
    assert ends["throttle"] == (1, 2)
    assert ends["column"] == (2, 3)
    assert ends["pump"] == (AMBIENT, 3)  # left alone it takes from the surroundings
    assert ends["drain"] == (3, AMBIENT)
    assert rows.nodes[2].volume == 20e-9
    assert [book.kind for row in rows.branches for book in row.books] == ["store", "supply"]


def test_a_seat_whose_body_is_not_joined_stands_on_the_ground():
    handles = {"a": 1, "b": 2, "needle": 0, "body": GROUND}
    rows = Rows(ambient=Ambient(), fluid=HEPTANE, handles=handles)

    Seat(**CONE, lift=10e-6).add_rows(rows)

    (row,) = rows.branches
    assert row.ports == (0, GROUND)
    assert {channel.label: channel.unit for channel in row.channels} == {
        "lift": "m",
        "area": "m^2",
        "jet force": "N",
    }
    assert row.state[0] == 10e-6
