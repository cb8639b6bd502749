"""A small valve as a network: the books of its run, and variants against hand-made networks."""

import numpy as np
import pytest

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

LAW = {"kind": "linear", "stiffness": 1e9}
MECHANICS = {
    "needle": RigidMass(mass=3e-3),
    "spring": Spring(stiffness=5e3, preload=20.0),
    "magnet": ForceOverTime(time=(0.0, 0.1e-3, 0.5e-3, 0.6e-3), force=(0.0, 60.0, 60.0, 0.0)),
    "guide": GuideFriction(coulomb=0.2, breakaway=0.4),
    "seat": EndStop(gap=0.0, law=LAW, restitution=0.4),
    "stop": EndStop(gap=80e-6, law=LAW, restitution=0.4),
}
HYDRAULICS = {
    "sac": Chamber(volume=2e-9),
    "face": PressureFace(direction="opening", area=1e-6),
    "hole": Orifice(diameter=0.2e-3),
}
AT_THE_NEEDLE = [
    f"{part}.{port}"
    for part, port in (
        ("needle", "body"),
        ("spring", "end"),
        ("magnet", "end"),
        ("guide", "body"),
        ("seat", "upper"),
        ("stop", "lower"),
    )
]
GROUNDED = [["seat.lower", "ground"], ["stop.upper", "ground"]]
DRY = Network(MECHANICS, [AT_THE_NEEDLE, *GROUNDED])
WET = Network(
    {**HYDRAULICS, **MECHANICS},
    [
        [*AT_THE_NEEDLE, "face.body"],
        *GROUNDED,
        ["sac.fluid", "face.fluid", "hole.a"],
        ["hole.b", "ambient"],
    ],
    fluid=FluidChoice(name="n-heptane", gas_fraction=1e-3).at(293.15),
)


def run(network: Network) -> NetworkResult:
    return simulate_network(network.rows(), duration=2e-3, step=20e-9, coarse=16, record=1e-6)


@pytest.fixture(scope="module")
def wet() -> NetworkResult:
    return run(WET)


def test_the_needle_opens_and_closes(wet):
    lift = wet.channels["needle.body displacement"].values

    assert lift.max() == pytest.approx(80e-6, rel=0.05)  # plus the indentation of the stop
    assert abs(lift[-1]) < 0.1e-6
    assert {event.stop for event in wet.events} >= {"stop", "seat"}


def test_books_of_the_run_balance(wet):
    assert wet.books.relative_residual < 1e-9  # of all steps; what the forces did not settle
    assert wet.books.supplies["magnet work"] > 1e-3
    for name, loss in wet.books.losses.items():
        assert loss >= -1e-12 * wet.books.throughput, name
    assert wet.books.losses["hole flow"] > 0.0


def test_dry_is_the_valve_built_without_hydraulics():
    derived, built = run(WET.dry()), run(DRY)

    assert derived.channels.keys() == built.channels.keys()
    for name, channel in built.channels.items():
        assert np.array_equal(derived.channels[name].values, channel.values), name


def test_lumped_is_the_valve_built_with_other_stops():
    law = {"kind": "linear", "stiffness": 5e8}
    stops = {
        "seat": EndStop(gap=0.0, law=law, restitution=0.3),
        "stop": EndStop(gap=80e-6, law=law, restitution=0.3),
    }

    derived, built = run(DRY.lumped(5e8, 0.3)), run(DRY.with_components(stops))

    lift = "needle.body displacement"
    assert np.array_equal(derived.channels[lift].values, built.channels[lift].values)


def test_the_order_of_components_does_not_matter(wet):
    turned = Network(
        dict(reversed(WET.components.items())), WET.connections[::-1], WET.ambient, WET.fluid
    )

    again = run(turned)

    lift = "needle.body displacement"
    before_first_touch = wet.time < 0.17e-3  # afterwards round-off grows from bounce to bounce
    assert again.channels[lift].values[before_first_touch] == pytest.approx(
        wet.channels[lift].values[before_first_touch], rel=1e-9, abs=1e-16
    )
