"""What hydraulic components and end stops refuse and say.

Truth: what valves by characteristic, accumulators and pumps refuse and say.

Truth: what a restriction refuses and says, and what it hands to the solver.

End stops: their rows, their variants without fluid or modes, and what they refuse.
"""

import re
import warnings
from math import pi, sqrt

import numpy as np
import pytest
from doubts import doubts
from draws import each

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.accumulator import Accumulator
from klack.hydraulics.annulus import Annulus
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.film import RingFilm
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.land_face import LandFace
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.pulsating_flow import PulsatingFlow
from klack.hydraulics.pump import Pump
from klack.hydraulics.relief_valve import ReliefValve
from klack.hydraulics.seat import Seat
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import AMBIENT, GROUND, Ambient, Rows
from klack.simulation.network_run import simulate_network

OIL = library_fluid("ISO VG 46").at(313.15)
CHECK = {"cracking_pressure": 5e4, "open_pressure": 2e5, "diameter": 5e-3}
RELIEF = {"set_pressure": 1e7, "rated_pressure": 1.1e7, "rated_flow": 3e-4, "diameter": 5e-3}


@each(
    ("build", "text"),
    [
        (lambda: CheckValve(**{**CHECK, "open_pressure": 5e4}), "more than the cracking pressure"),
        (lambda: CheckValve(**CHECK, area=1e-6), "diameter and area together"),
        (lambda: CheckValve(**CHECK, leak_area=1e-3), "less than the area when open"),
        (lambda: ReliefValve(**{**RELIEF, "rated_pressure": 1e7}), "more than the set pressure"),
        (lambda: ReliefValve(**RELIEF, hysteresis=2e7), "less than the set pressure"),
        (lambda: ReliefValve(**{**RELIEF, "diameter": None}), "exactly one of diameter, area"),
        (lambda: Accumulator(volume=1e-3, precharge=1e6, exponent=0.9), "greater than or equal"),
        (lambda: Accumulator(volume=1e-3, precharge=1e6, full_at=1.0), "less than 1"),
        (lambda: Accumulator(volume=1e-3, precharge=0.0), "greater than 0"),
        (lambda: VariableOrifice(area=[0.0, 1e-6]), "exactly one of lift, time"),
        (lambda: VariableOrifice(lift=[0.0, 1e-4], area=[0.0]), "at least 2"),
        (lambda: VariableOrifice(lift=[0.0, 1e-4], area=[0.0, 1.0, 2.0]), "3 areas for 2 values"),
        (lambda: VariableOrifice(time=[1.0, 1.0], area=[0.0, 1e-6]), "values that rise"),
        (lambda: VariableOrifice(time=[0.0, 1.0], area=[0.0, -1e-6]), "0 or more"),
        (lambda: Pump(displacement=1e-5, speed=0.0), "greater than 0"),
        (lambda: Pump(displacement=1e-5, speed=25.0, pistons=0), "greater than or equal to 1"),
        (lambda: Pump(displacement=1e-5, speed=25.0, rated_pressure=1e7), "without"),
        (lambda: Pump(displacement=1e-5, speed=25.0, volumetric_efficiency=0.9), "without"),
        (lambda: PulsatingFlow(mean=1e-5, harmonics=[]), "at least 1"),
        (
            lambda: PulsatingFlow(mean=1e-5, harmonics=[{"frequency": 0.0, "amplitude": 1e-6}]),
            "greater than 0",
        ),
    ],
)
def test_wrong_numbers_are_refused_in_words(build, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        build()

    assert text in str(caught.value)


def network(parts, joints):
    held = {"needle": RigidMass(mass=1e-3), "spring": Spring(stiffness=1e4, preload=0.0)}
    return Network({**held, **parts}, [["needle.body", "spring.end"], *joints], fluid=OIL)


def test_a_rated_point_that_the_open_valve_cannot_pass_is_refused():
    valve = ReliefValve(**{**RELIEF, "rated_flow": 5e-3})
    parts = {"rail": Chamber(volume=1e-6), "relief": valve}

    with pytest.raises(InputError, match=r"relief.rated_flow.*less than the area when fully open"):
        network(parts, [["rail.fluid", "relief.a"], ["relief.b", "ambient"]]).rows()


def test_an_accumulator_without_a_volume_beside_it_asks_for_a_chamber():
    parts = {"pump": FlowSource(flow=1e-5), "gas": Accumulator(volume=1e-5, precharge=5e6)}

    with pytest.raises(InputError, match="a chamber, a prescribed pressure"):
        network(parts, [["pump.b", "gas.fluid"]])


@pytest.mark.slow
def test_an_accumulator_at_a_prescribed_pressure_takes_what_it_holds():
    parts = {
        "rail": PressureSource(pressure=50e5, step={"to": 100e5, "at": 1e-4, "rise": 1e-4}),
        "gas": Accumulator(volume=1e-5, precharge=40e5),
    }
    result = simulate_network(
        network(parts, [["rail.fluid", "gas.fluid"]]).rows(), duration=5e-4, step=1e-7
    )

    end = result.channels["gas gas volume"].values[-1]
    assert end == pytest.approx(1e-5 * 0.4 ** (1 / 1.4), rel=1e-9)
    assert result.books.relative_residual <= 1e-12


def filled(flow, pressure, precharge=60e5, volume=2e-6):
    """Run a pump against an accumulator, with a leak."""
    parts = {
        "pump": FlowSource(flow=flow),
        "rail": Chamber(volume=5e-6, pressure=pressure),
        "gas": Accumulator(volume=volume, precharge=precharge, full_at=0.3),
        "leak": Orifice(diameter=0.5e-3),
    }
    joints = [["pump.b", "rail.fluid", "gas.fluid", "leak.a"], ["leak.b", "ambient"]]
    return simulate_network(network(parts, joints).rows(), duration=60e-3, step=1e-6, record=1e-4)


def test_a_full_accumulator_says_so_and_the_pressure_rises():
    with doubts() as told:
        result = filled(5e-5, 80e5)

    (text,) = told
    assert re.match(r"'gas': at .* ms the gas volume.*It is full", text)
    assert result.channels["gas gas volume"].values.min() == pytest.approx(0.3 * 2e-6, rel=1e-12)
    # full from 60 bar / 0.3^1.4 on
    assert result.channels["rail pressure"].values[-1] > 1.2 * 60e5 * 0.3**-1.4


def test_an_empty_accumulator_says_so_and_holds_nothing():
    with pytest.warns(AccuracyWarning, match=r"'gas': at .* ms the gas volume.*It is empty"):
        result = filled(0.0, 65e5)

    assert result.channels["gas gas volume"].values[-1] == 2e-6
    assert result.channels["rail pressure"].values[-1] < 10e5


def test_an_accumulator_that_fills_from_below_its_precharge_is_silent():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = filled(2e-5, 20e5)

    gas = result.channels["gas gas volume"].values
    assert gas[0] == 2e-6
    assert gas[-1] < 2e-6


def test_full_and_empty_are_told_of_apart():
    parts = {
        "rail": PressureSource(
            table={"time": [0.0, 1e-4, 2e-4, 3e-4], "pressure": [50e5, 500e5, 500e5, 30e5]}
        ),
        "gas": Accumulator(volume=1e-5, precharge=40e5, full_at=0.3),
    }
    with doubts() as texts:
        simulate_network(
            network(parts, [["rail.fluid", "gas.fluid"]]).rows(), duration=5e-4, step=1e-7
        )

    assert len(texts) == 2
    assert "It is full" in texts[0]
    assert "It is empty" in texts[1]


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
def test_wrong_numbers_are_refused_in_words_components(build, text):
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


LINEAR = {"kind": "linear", "stiffness": 1e9}
RING = {"shape": "ring", "inner_radius": 1e-3, "outer_radius": 1.2e-3}


def rows(fluid=True):
    heptane = library_fluid("n-heptane").at(293.15) if fluid else None
    return Rows(
        ambient=Ambient(), fluid=heptane, component="seat", handles={"upper": 3, "lower": -1}
    )


def test_adds_one_interface():
    built = rows()
    EndStop(gap=80e-6, law=LINEAR, series_compliance=2e-10, film=RING).add_rows(built)

    (row,) = built.interfaces
    mu = float(built.fluid.viscosity(101_325.0))
    tension = 101_325.0 - built.fluid.vapour_pressure
    assert (row.component, row.upper, row.lower, row.gap) == ("seat", 3, -1, 80e-6)
    assert row.law == LinearLaw(1e9)
    assert row.series_compliance == 2e-10
    assert row.film.cubic == pytest.approx(mu * RingFilm(**RING).coefficients()[0])
    assert row.film.suction == pytest.approx(tension * pi * (1.2e-3**2 - 1e-3**2))


def test_film_knows_the_pressure_around_it():
    built = rows()
    EndStop(gap=0.0, film={**RING, "pressure": 6e5, "cavitation_pressure": -4e5}).add_rows(built)

    assert built.interfaces[0].law is None
    assert built.interfaces[0].film.suction == pytest.approx(1e6 * RingFilm(**RING).area)


@pytest.mark.parametrize(
    ("given", "law"),
    [
        (LINEAR, LinearLaw(1e9)),
        (
            {"kind": "hertz", "radius": 2e-3, "modulus": 115.4e9},
            HertzLaw(4.0 / 3.0 * 115.4e9 * sqrt(2e-3)),
        ),
    ],
)
def test_laws_with_closed_forms(given, law):
    assert EndStop(gap=0.0, law=given).contact_law() == law


def test_asperity_law_is_the_exponential():
    law = EndStop(gap=0.0, law={"kind": "asperity", "force": 2.0, "height": 0.2e-6}).contact_law()
    d = np.linspace(0.01e-6, 2e-6, 3001)

    # cubic pieces of 1/40 of the height
    np.testing.assert_allclose(law.force(d), 2.0 * np.expm1(d / 0.2e-6), rtol=5e-6)


def test_table_law_passes_its_points():
    law = EndStop(
        gap=0.0, law={"kind": "table", "indentation": [1e-6, 2e-6], "force": [100.0, 250.0]}
    ).contact_law()

    assert isinstance(law, TableLaw)
    np.testing.assert_allclose(law.force([1e-6, 2e-6]), [100.0, 250.0])


def test_restitution_becomes_the_dashpot_of_gonthier():
    law = EndStop(gap=0.0, law=LINEAR, restitution=0.6).contact_law()

    assert law == HuntCrossley(LinearLaw(1e9), gonthier_coefficient(0.6))


def test_consistent_law_is_filled_in_and_kept_by_variants():
    stop = EndStop(gap=0.0, law={"kind": "consistent"}, film=RING)
    law = TableLaw([1e-6, 2e-6], [100.0, 250.0])

    with pytest.raises(InputError, match="has not been computed"):
        stop.contact_law()
    filled = stop.with_law(law, series_compliance=1e-10)

    assert filled.contact_law() is law
    assert filled.series_compliance == 1e-10
    assert filled.dry().contact_law() is law
    assert filled.dry().film is None
    with pytest.raises(InputError, match="has not been computed"):
        stop.contact_law()


def test_lumped_stop_is_one_spring_and_one_dashpot():
    stop = EndStop(gap=5e-6, law={"kind": "consistent"}, film=RING).with_law(
        TableLaw([1e-6], [100.0]), series_compliance=1e-10
    )

    lumped = stop.lumped(2e8, 0.5)

    assert lumped.contact_law() == HuntCrossley(LinearLaw(2e8), gonthier_coefficient(0.5))
    assert stop.lumped(2e8, None).contact_law() == LinearLaw(2e8)
    assert lumped.series_compliance == 0.0
    assert (lumped.gap, lumped.film) == (5e-6, stop.film)


def test_film_alone_is_nothing_without_fluid():
    assert EndStop(gap=0.0, film=RING).dry() is None


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({}, "neither law nor film"),
        ({"film": RING, "restitution": 0.5}, "restitution without a law"),
        ({"law": {"kind": "linear", "stiffness": 0.0}}, "stiffness"),
        ({"film": {**RING, "outer_radius": 0.9e-3}}, "more than the inner radius, 1 mm"),
        ({"film": {**RING, "roughness": 1e-6, "cut_off": 0.1e-6}}, "half the roughness"),
        (
            {"film": {"shape": "cone", "mean_radius": 1e-4, "width": 1e-3, "half_angle": 1.0}},
            "the land must not reach the axis",
        ),
        ({"law": LINEAR, "gap": -1e-6}, "gap"),
    ],
)
def test_refused(given, text):
    with pytest.raises(InputError, match=text):
        EndStop(**{"gap": 0.0, **given})


def test_film_needs_a_fluid():
    with pytest.raises(InputError, match="no fluid in the network"):
        EndStop(gap=0.0, law=LINEAR, film=RING).add_rows(rows(fluid=False))


def test_cavitation_pressure_is_absolute():
    film = {**RING, "cavitation_pressure": 2e5}
    with pytest.raises(InputError, match=r"seat.film.cavitation_pressure: got 2 bar absolute"):
        EndStop(gap=0.0, law=LINEAR, film=film).add_rows(rows())
