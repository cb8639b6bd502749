"""The equilibrium from which a stroke starts: bodies, pressures, flows and fluxes.

Truth: Hooke's law, Hertz' law, steady flow through restrictions in series, the pull of an air gap;
and that a run which begins in equilibrium stays there.
"""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_compile import compile_network
from klack.simulation.network_result import NetworkResult, StaticStart
from klack.simulation.network_run import simulate_network
from klack.simulation.static_start import RestState, begin_at_rest
from klack.simulation.step_sizes import step_sizes

AMBIENT = Ambient()
MU0 = 4e-7 * pi
TIGHT = 1e-12  # the solver ends at the round-off of the forces, about 1e-14 of them


def run(
    parts: dict[str, Component], joints: list[list[str]], *, fluid: str | None = None, **options
) -> NetworkResult:
    given = {} if fluid is None else {"fluid": library_fluid(fluid).at(AMBIENT.temperature)}
    rows = Network(parts, joints, **given).rows()
    return simulate_network(rows, **({"duration": 20e-6} | options))


def start(*arguments, **options) -> StaticStart:
    begun = run(*arguments, **options).start
    assert begun is not None
    return begun


def stays(result: NetworkResult, channel: str, share: float = 1e-9) -> None:
    values = result.channels[channel].values
    np.testing.assert_allclose(values, values[0], rtol=share)


@pytest.mark.parametrize(("mass", "stiffness"), [(0.1, 1e3), (1e-4, 1.0), (10.0, 1e8)])
def test_a_negative_preload_stretches_the_spring(mass, stiffness):
    preload = -1e-3 * stiffness
    parts = {
        "body": RigidMass(mass=mass, points=("tip",)),
        "spring": Spring(stiffness=stiffness, preload=preload),
    }

    result = run(parts, [["body.tip", "spring.end"]])

    assert result.start is not None
    assert result.start.displacement["body.tip"] == pytest.approx(1e-3, rel=TIGHT)
    stays(result, "body.tip displacement", TIGHT)


def test_bodies_in_series_share_the_way_as_their_springs():
    stiffness, preload = (3e2, 5e4, 7e3), (-1.0, 0.0, -2.0)
    parts: dict[str, Component] = {}
    joints = []
    for k in range(3):
        parts[f"b{k}"] = RigidMass(mass=10.0 ** (k - 3), points=("at",))
        parts[f"s{k}"] = Spring(stiffness=stiffness[k], preload=preload[k])
        node = [f"b{k}.at", f"s{k}.end"]
        joints.append(node if k == 2 else [*node, f"s{k + 1}.base"])
    parts["load"] = ConstantForce(force=4.0)
    joints[-1].append("load.end")

    found = start(parts, joints).displacement

    # each spring carries the load: F0 + k (y_end - y_base) = 4 N
    stretch = [(4.0 - F) / k for F, k in zip(preload, stiffness, strict=True)]
    expected = np.cumsum(stretch)
    np.testing.assert_allclose([found[f"b{k}.at"] for k in range(3)], expected, rtol=TIGHT)


@pytest.mark.parametrize("series", [0.0, 2e-9])
def test_a_force_at_time_zero_presses_into_the_far_stop(series):
    """35 N against 12 N: not 0.029 of the way to the stop, but on it, as deep as Hertz says."""
    radius, modulus, lift, rate = 5e-3, 115e9, 1e-3, 1e3
    law = {"kind": "hertz", "radius": radius, "modulus": modulus}
    stop = EndStop(gap=lift, law=law)
    contact = stop.contact_law()
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e9}, restitution=0.5),
        "stop": stop.with_law(contact, series),
        "spring": Spring(stiffness=rate, preload=12.0),
        "magnet": ForceOverTime(time=(0.0, 1.0), force=(35.0, 35.0)),
    }
    joints = [
        ["needle.tip", "seat.upper", "stop.lower", "spring.end", "magnet.end"],
        ["ground", "seat.lower"],
        ["ground", "stop.upper"],
    ]

    result = run(parts, joints)

    def left(force: float) -> float:  # what the bodies overlap is indentation and compression
        d = brentq(lambda x: float(contact.force(x)) - force, 0.0, 1e-3, xtol=1e-20)
        return 35.0 - 12.0 - rate * (lift + d + series * force) - force

    force = brentq(left, 1.0, 30.0, xtol=1e-13)
    assert result.start is not None
    pressed = 35.0 - 12.0 - rate * result.start.displacement["needle.tip"]
    assert pressed == pytest.approx(force, rel=1e-10)  # 22 N of indentations of some um in 1 mm
    stays(result, "needle.tip displacement")


def test_small_valve_with_a_spring_that_opens_rests_on_its_upper_stop():
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "stop": EndStop(gap=1e-4, law={"kind": "linear", "stiffness": 1e9}, restitution=0.5),
        "spring": Spring(stiffness=1e4, preload=-12.0),
    }
    joints = [["needle.tip", "stop.lower", "spring.end"], ["ground", "stop.upper"]]

    found = start(parts, joints)

    assert found.displacement["needle.tip"] == pytest.approx(
        (12.0 + 1e9 * 1e-4) / (1e4 + 1e9), rel=TIGHT
    )
    assert abs(found.residual["needle"]) < 1e-12 * 12.0 * 1e2  # 1e9 N/m times round-off of 0.1 mm


def divider(first: Component, **options) -> tuple[StaticStart, NetworkResult]:
    parts = {
        "rail": PressureSource(pressure=50e5),
        "first": first,
        "middle": Chamber(volume=1e-7),
        "second": Orifice(diameter=0.5e-3, cavitation=None),
        "face": PressureFace(direction="opening", area=1e-6),
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=0.0),
    }
    joints = [
        ["rail.fluid", "first.a"],
        ["first.b", "middle.fluid", "second.a", "face.fluid"],
        ["second.b", "ambient"],
        ["needle.tip", "face.body", "spring.end"],
    ]
    result = run(parts, joints, fluid="n-heptane", **options)
    assert result.start is not None
    return result.start, result


def test_two_orifices_divide_the_pressure_and_the_needle_follows():
    found, result = divider(Orifice(diameter=0.4e-3, cavitation=None))

    fluid, rail = library_fluid("n-heptane").at(AMBIENT.temperature), 50e5

    def excess(p: float) -> float:  # far beyond laminar flow: m = C A sqrt(2 rho dp)
        inflow = 0.4**4 * float(fluid.density(rail)) * (rail - p)
        return inflow - 0.5**4 * float(fluid.density(p)) * (p - AMBIENT.pressure)

    middle = brentq(excess, AMBIENT.pressure, rail, xtol=1e-6)
    assert found.pressure["middle"] == pytest.approx(middle, rel=1e-9)
    assert found.stated == {"middle": False}
    assert found.flow["first"] == pytest.approx(found.flow["second"], rel=1e-12)
    push = 1e-6 * (found.pressure["middle"] - AMBIENT.pressure)
    assert found.displacement["needle.tip"] == pytest.approx(push / 1e4, rel=TIGHT)
    stays(result, "middle pressure")
    stays(result, "needle.tip displacement")


@pytest.mark.parametrize(
    "column",
    [
        Line(length=0.2, diameter=1e-3, pressure=50e5, friction="steady"),
        Line(length=0.2, diameter=1e-3, pressure=50e5, friction="kagawa"),
        Line(length=0.2, diameter=1e-3, pressure=50e5, friction="none"),
        Inertance(length=0.02, diameter=1e-3),
        Inertance(length=0.02, diameter=1e-3, friction="none"),
    ],
    ids=["steady", "kagawa", "frictionless line", "inertance", "frictionless inertance"],
)
def test_a_column_of_fluid_starts_with_its_steady_flow(column):
    found, result = divider(column, duration=2e-3)

    assert found.flow["first"] == pytest.approx(found.flow["second"], rel=1e-10)
    if column.friction == "none":
        assert found.pressure["middle"] == pytest.approx(50e5, rel=TIGHT)
    else:
        assert 40e5 < found.pressure["middle"] < 50e5
    # waves have crossed a line ten times
    stays(result, "middle pressure", 1e-8)
    mean = "second mean mass flow"
    stays(result, mean if mean in result.channels else "middle pressure", 1e-7)


def test_next_to_no_flow_is_steady_as_well():
    """A column between pressures that differ by less than the round-off of their energies."""
    excess = 1.0
    parts = {
        "rail": PressureSource(pressure=AMBIENT.pressure + excess),
        "hole": Orifice(diameter=0.05e-3),
        "sac": Chamber(volume=1e-9),
        "column": Inertance(length=0.02, diameter=3e-3),
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=0.0),
    }
    joints = [
        ["rail.fluid", "hole.a"],
        ["hole.b", "sac.fluid", "column.a"],
        ["column.b", "ambient"],
        ["needle.tip", "spring.end"],
    ]

    found = start(parts, joints, fluid="n-heptane")

    assert found.pressure["sac"] == pytest.approx(AMBIENT.pressure, abs=0.05 * excess + 1e-9)


def test_a_stated_pressure_is_kept_and_a_closed_volume_says_that_it_is():
    parts = {
        "rail": PressureSource(pressure=50e5),
        "hole": Orifice(diameter=0.4e-3),
        "stated": Chamber(volume=1e-7, pressure=7e5),
        "closed": Chamber(volume=1e-7),
        "shut": Seat(shape="flat", diameter=2e-3),
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=5.0),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e8}),
    }
    joints = [
        ["rail.fluid", "hole.a"],
        ["hole.b", "stated.fluid", "shut.a"],
        ["shut.b", "closed.fluid"],
        ["needle.tip", "spring.end", "seat.upper", "shut.needle"],
        ["ground", "seat.lower"],
        ["ground", "shut.body"],
    ]

    found = start(parts, joints, fluid="n-heptane")

    assert found.pressure == pytest.approx({"stated": 7e5, "closed": AMBIENT.pressure}, rel=1e-11)
    assert found.stated == {"stated": True, "closed": False}
    assert len(found.notes) == 1
    assert "'closed' is closed at the start" in found.notes[0]


def test_a_flow_that_cannot_flow_on_is_told():
    parts = {
        "pump": FlowSource(flow=1e-5),
        "sac": Chamber(volume=1e-7),
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=5.0),
    }

    with pytest.warns(AccuracyWarning, match="'sac' has no steady pressure"):
        found = start(
            parts, [["pump.b", "sac.fluid"], ["needle.tip", "spring.end"]], fluid="n-heptane"
        )

    assert found.pressure["sac"] == AMBIENT.pressure


def test_enclosed_fluid_holds_a_piston():
    area, volume, force = 1e-4, 1e-6, 300.0
    parts = {
        "piston": RigidMass(mass=0.05, points=("at",)),
        "load": ConstantForce(force=-force),
        "face": PressureFace(direction="opening", area=area),
        "oil": Chamber(volume=volume, pressure=AMBIENT.pressure),
    }

    result = run(
        parts,
        [["piston.at", "load.end", "face.body"], ["face.fluid", "oil.fluid"]],
        fluid="n-heptane",
    )

    fluid = library_fluid("n-heptane").at(AMBIENT.temperature)
    found = result.start
    assert found is not None
    p = AMBIENT.pressure + force / area
    assert found.pressure["oil"] == pytest.approx(p, rel=1e-11)
    squeezed = volume * (float(fluid.density(AMBIENT.pressure)) / float(fluid.density(p)) - 1.0)
    assert found.displacement["piston.at"] == pytest.approx(squeezed / area, rel=1e-7)
    stays(result, "oil pressure")
    assert not found.stated["oil"]


def test_a_stated_pressure_that_holds_no_body_is_a_doubt_where_fluid_can_leave():
    """Truth: balance of forces; it starts elsewhere than the case states, and flow sets in."""
    area, force, stated = 2e-5, 5.0, 5e5
    parts = {
        "piston": RigidMass(mass=5e-3, points=("at",)),
        "load": ConstantForce(force=-force),
        "face": PressureFace(direction="opening", area=area),
        "oil": Chamber(volume=3e-7, pressure=stated),
        "bore": Orifice(diameter=0.5e-3),
        "rail": PressureSource(pressure=stated),
    }
    joints = [
        ["piston.at", "load.end", "face.body"],
        ["face.fluid", "oil.fluid", "bore.a"],
        ["bore.b", "rail.fluid"],
    ]

    with pytest.warns(
        AccuracyWarning, match="'oil' starts at 351.3 kPa, not at the stated 500 kPa"
    ):
        found = start(parts, joints, fluid="n-heptane")

    assert found.pressure["oil"] == pytest.approx(AMBIENT.pressure + force / area, rel=1e-11)
    assert not found.stated["oil"]


def test_a_holding_current_balances_the_spring():
    """One pole, no iron: F = mu0 A (N i)^2 / (2 x^2), here from 1 A and 200 turns."""
    radius, gap, closed, rate = 3e-3, 3e-4, 5e-5, 2e5
    pole = {"outer_radius": radius, "fringing": "none"}
    coil = Solenoid(
        turns=200, resistance=1.0, gap=gap, residual_gap=closed, poles=[pole], start_current=1.0
    )

    found, result = held(coil, rate)

    y = found.displacement["armature.at"]
    pull = MU0 * pi * radius**2 * 200.0**2 / (2.0 * (gap - y + closed) ** 2)
    assert rate * y - 2.0 == pytest.approx(pull, rel=1e-8)  # the reluctance is a table of 1e-8
    stays(result, "coil.armature force")
    assert result.channels["coil current"].values[-1] == pytest.approx(1.0, rel=1e-9)


def test_a_holding_current_acts_through_a_force_map():
    gaps, current = np.linspace(-1e-4, 4e-4, 21), np.linspace(0.0, 4.0, 5)
    inductance = 1e-6 / (gaps + 2e-4)
    coil = ForceMapSolenoid(
        resistance=1.0,
        gap=3e-4,
        current=tuple(current),
        gaps=tuple(gaps),
        linkage=[tuple(inductance * i) for i in current],
        start_current=1.0,
    )

    found, result = held(coil, 2e5)

    y = found.displacement["armature.at"]
    pull = 0.5 * 1e-6 / (3e-4 - y + 2e-4) ** 2  # i^2/2 dL/dx
    assert 2e5 * y - 2.0 == pytest.approx(pull, rel=2e-3)  # splines through 21 gaps
    stays(result, "coil current", 1e-8)


def held(coil: Component, rate: float) -> tuple[StaticStart, NetworkResult]:
    parts = {
        "armature": RigidMass(mass=5e-3, points=("at",)),
        "spring": Spring(stiffness=rate, preload=-2.0),
        "coil": coil,
        "supply": VoltageTable(time=[0.0], voltage=[1.0]),
    }
    joints = [
        ["armature.at", "spring.end", "coil.armature"],
        ["coil.terminals", "supply.terminals"],
    ]
    result = run(parts, joints, duration=200e-6)
    assert result.start is not None
    return result.start, result


def pulled_onto_a_stop(stiffness: float, gap: float = 60e-6) -> StaticStart:
    """A magnet that pulls 200 N at its pole, 40 um of which stay open."""
    parts = {
        "armature": RigidMass(mass=5e-3, points=("at",)),
        "spring": Spring(stiffness=1e3, preload=5.0),
        "stop": EndStop(gap=60e-6, law={"kind": "linear", "stiffness": stiffness}),
        "coil": Solenoid(
            turns=100,
            resistance=1.0,
            gap=gap,
            residual_gap=40e-6,
            poles=[{"outer_radius": 4e-3, "fringing": "none"}],
            start_current=1.0,
        ),
        "supply": VoltageTable(time=[0.0], voltage=[1.0]),
    }
    joints = [
        ["armature.at", "spring.end", "stop.lower", "coil.armature"],
        ["ground", "stop.upper"],
        ["coil.terminals", "supply.terminals"],
    ]
    return start(parts, joints)


def test_an_armature_rests_before_its_pole_and_not_beyond():
    """Beyond the pole there is a second balance of forces, of which no armature knows."""
    found = pulled_onto_a_stop(1e8)

    def left(y: float) -> float:
        pull = MU0 * pi * 4e-3**2 * 100.0**2 / (2.0 * (100e-6 - y) ** 2)
        return pull - 5.0 - 1e3 * y - 1e8 * (y - 60e-6)

    assert found.displacement["armature.at"] == pytest.approx(
        brentq(left, 60e-6, 65e-6, xtol=1e-15), rel=1e-7
    )


def test_of_two_rest_states_the_one_nearby_is_kept():
    """32 N pull at the seat, 197 N at the stop, against 50 N: it stays where it was."""

    def rests(preload: float, near: RestState | None = None) -> tuple[float, RestState]:
        stiff = {"kind": "linear", "stiffness": 1e8}
        parts = {
            "armature": RigidMass(mass=5e-3, points=("at",)),
            "spring": Spring(stiffness=1e3, preload=preload),
            "seat": EndStop(gap=0.0, law=stiff),
            "stop": EndStop(gap=60e-6, law=stiff),
            "coil": Solenoid(
                turns=100,
                resistance=1.0,
                gap=60e-6,
                residual_gap=40e-6,
                poles=[{"outer_radius": 4e-3, "fringing": "none"}],
                start_current=1.0,
            ),
            "supply": VoltageTable(time=[0.0], voltage=[1.0]),
        }
        joints = [
            ["armature.at", "spring.end", "seat.upper", "stop.lower", "coil.armature"],
            ["ground", "seat.lower"],
            ["ground", "stop.upper"],
            ["coil.terminals", "supply.terminals"],
        ]
        rows = Network(parts, joints).rows()
        sizes = step_sizes(rows, "normal", step=None, coarse=None)
        begun, found = begin_at_rest(compile_network(rows, sizes), sizes.step, near)
        return begun.displacement["armature.at"], found

    def left(y: float) -> float:
        pull = MU0 * pi * 4e-3**2 * 100.0**2 / (2.0 * (100e-6 - y) ** 2)
        return pull - 50.0 - 1e3 * y - 1e8 * (min(y, 0.0) + max(y - 60e-6, 0.0))

    (_, down), (_, up) = rests(51.0), rests(20.0)

    for near, low, high in ((None, -1e-6, 0.0), (down, -1e-6, 0.0), (up, 60e-6, 65e-6)):
        assert rests(50.0, near)[0] == pytest.approx(brentq(left, low, high, xtol=1e-15), rel=1e-7)


@pytest.mark.slow
def test_a_magnet_that_is_stronger_than_its_stop_is_named():
    said = r"static equilibrium: coil: none found with a gap in the range of the magnet of"
    with pytest.raises(ConvergenceError, match=said):
        pulled_onto_a_stop(1e7)


def test_a_body_that_is_pressed_far_into_its_stop_is_named():
    parts = {
        "body": RigidMass(mass=1e-3, points=("tip",)),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e8}),
        "soft": EndStop(gap=1e-4, law={"kind": "linear", "stiffness": 1e4}),
        "push": ConstantForce(force=12.0),
    }
    joints = [
        ["body.tip", "seat.upper", "soft.lower", "push.end"],
        ["ground", "soft.upper"],
        ["ground", "seat.lower"],
    ]

    with pytest.raises(InputError, match=r"components\.soft: got bodies pressed 1.2 mm into"):
        run(parts, joints)


def test_a_body_that_nothing_holds_is_named():
    parts = {
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "force": ConstantForce(force=-3.0),
        "plunger": RigidMass(mass=1e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=5.0),
    }
    joints = [["needle.tip", "force.end"], ["plunger.tip", "spring.end"]]

    with (
        pytest.warns(LooseBodyWarning),
        pytest.raises(InputError, match="got 'needle', unsupported"),
    ):
        run(parts, joints)


@pytest.mark.parametrize("push", [-0.9, 0.9])
def test_friction_holds_a_body_that_nothing_else_does(push):
    """Below breakaway it stays where it is drawn; the force it resists is that of the push."""
    parts = {
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "force": ConstantForce(force=push),
        "guide": GuideFriction(coulomb=0.5, breakaway=1.0),
    }

    with pytest.warns(LooseBodyWarning):
        result = run(parts, [["needle.tip", "force.end", "guide.body"]], duration=2e-3)

    assert result.start is not None
    assert result.start.residual["needle"] == pytest.approx(push, rel=TIGHT)
    assert "900 mN of 1 N" in result.start.notes[0]
    moved = result.channels["needle.tip displacement"].values
    assert np.abs(moved).max() < 1e-15  # free, it would have gone 1.8 mm


def test_a_body_that_friction_is_too_weak_for_is_named():
    parts = {
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "force": ConstantForce(force=-1.1),
        "guide": GuideFriction(coulomb=0.5, breakaway=1.0),
    }

    with (
        pytest.warns(LooseBodyWarning),
        pytest.raises(InputError, match=r"got 'needle', unsupported.*or friction above it"),
    ):
        run(parts, [["needle.tip", "force.end", "guide.body"]])


def test_friction_between_two_loose_bodies_holds_neither():
    parts = {
        "needle": RigidMass(mass=1e-3, points=("tip",)),
        "sleeve": RigidMass(mass=1e-3, points=("tip",)),
        "force": ConstantForce(force=-0.5),
        "guide": GuideFriction(coulomb=1.0),
    }
    joints = [["needle.tip", "force.end", "guide.body"], ["sleeve.tip", "guide.guide"]]

    with pytest.warns(LooseBodyWarning), pytest.raises(InputError, match="'needle', unsupported"):
        run(parts, joints)


def test_a_body_without_force_stays_and_one_with_a_speed_flies():
    parts = {
        "idle": RigidMass(mass=1e-3, points=("tip",)),
        "thrown": RigidMass(mass=1e-3, points=("tip",), speed=1.0),
        "held": RigidMass(mass=1e-3, points=("tip",)),
        "push": ConstantForce(force=2.0),
        "spring": Spring(stiffness=1e4, preload=-5.0),
    }
    joints = [["thrown.tip", "push.end"], ["held.tip", "spring.end"]]

    with pytest.warns(LooseBodyWarning):
        result = run(parts, joints)

    assert result.start is not None
    found = result.start.displacement
    assert found["idle.tip"] == found["thrown.tip"] == 0.0
    assert found["held.tip"] == pytest.approx(5e-4, rel=TIGHT)
    t = result.time[-1]
    way = result.channels["thrown.tip displacement"].values[-1]
    assert way == pytest.approx(t + 1e3 * t * t, rel=TIGHT)


def test_a_source_is_asked_for_its_value_at_time_zero():
    parts = {
        "body": RigidMass(mass=1e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "push": ForceOverTime(time=(-1e-3, 1e-3), force=(0.0, 8.0)),
    }

    found = start(parts, [["body.tip", "spring.end", "push.end"]])

    assert found.displacement["body.tip"] == pytest.approx(4e-4, rel=1e-9)


def lever(mass: float, reach: float) -> ReducedBody:
    """Rigid body with a port at its centre of mass and one so far aside, in radii of inertia."""
    axial = sqrt(mass)
    return ReducedBody(
        name="lever",
        mass=mass,
        omega=np.zeros(2),
        damping=np.zeros(2),
        port_names=("centre", "aside"),
        # rigid modes that mix the shift and the rotation
        port_shapes=np.array([[0.6, 0.6 + 0.8 * reach], [0.8, 0.8 - 0.6 * reach]]) / axial,
        observer_names=(),
        observer_shapes=np.zeros((2, 0)),
        static_compliance=np.full((2, 2), 1e-12),
        rigid_count=2,
        rigid_axial=np.array([0.6, 0.8]) * axial,
        dof_count=6,
    )


@pytest.mark.parametrize("guided", [False, True])
def test_forces_along_the_axis_balance_along_the_axis(guided):
    """Exact: Hooke's law; a body that can rotate as well rests where its axial forces balance."""
    body = lever(2e-3, 0.3)
    parts = {
        "lever": FlexibleBody.of(body.along_axis() if guided else body),
        "spring": Spring(stiffness=5e3, preload=0.0),
        "push": ConstantForce(force=12.0),
    }
    found = start(parts, [["lever.aside", "spring.end"], ["lever.centre", "push.end"]])
    assert found.displacement["lever.aside"] == pytest.approx(12.0 / 5e3, rel=1e-9)
    assert abs(found.residual["lever"]) < 1e-9


def test_a_guided_body_does_not_rotate():
    """Exact: an eccentric force moves a body in a guide as if it acted at the centre of mass."""
    body = lever(2e-3, 0.3)
    push = {"push": ConstantForce(force=12.0)}
    shares = []
    for one in (body, body.along_axis()):
        parts = {"lever": FlexibleBody.of(one)} | push
        with pytest.warns(LooseBodyWarning):
            moved = run(parts, [["lever.aside", "push.end"]], start="free", duration=1e-3)
        way = moved.channels["lever.aside displacement"].values[-1]
        shares.append(way / (0.5 * 12.0 / 2e-3 * moved.time[-1] ** 2))
    assert shares == pytest.approx([1.0 + 0.3**2, 1.0], rel=1e-9)


@pytest.mark.parametrize("level", [5e5, 4.72093e6, 2e7])
def test_a_dead_end_behind_a_check_valve_fills_up_to_where_it_closes(level):
    """The supply less the cracking pressure: there the flow law has a kink.

    A junction before it: what round-off lets through has to be found as none.
    """
    parts = {
        "needle": RigidMass(mass=2e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "rail": PressureSource(pressure=level),
        "pipe": Line(length=0.0866607, diameter=5.68531e-3, pressure=level),
        "tee": Junction(),
        "feed": CheckValve(cracking_pressure=0.3e5, open_pressure=3e5, diameter=3.035e-3),
        "room": Chamber(volume=6.28773e-8),
    }
    joints = [
        ["needle.body", "spring.end"],
        ["rail.fluid", "pipe.a"],
        ["pipe.b", "tee.fluid", "feed.a"],
        ["feed.b", "room.fluid"],
    ]

    begun = start(parts, joints, fluid="n-dodecane")

    assert begun.pressure["room"] == pytest.approx(level - 0.3e5, rel=1e-8)
    assert abs(begun.flow["feed"]) < 1e-12
    assert not any("ambient" in note for note in begun.notes)
