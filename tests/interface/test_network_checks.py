"""Every way in which a network cannot be a valve has one error, with its key and what to try."""

from dataclasses import replace
from typing import ClassVar

import pytest
from draws import each

from klack.errors import ConvergenceError, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_choice import FluidChoice
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce
from klack.mechanics.gravity import Gravity
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import COIL, COMPLIANCE, FLOW, MOTION, PRESSURE, VOLTAGE, Port, Role
from klack.network.rows import AMBIENT, GROUND, Rows
from klack.simulation.network_run import simulate_network


class Part(Component):
    """A component of a test: it has ports and adds nothing."""

    def add_rows(self, rows: Rows) -> None: ...


class Pipe(Part):
    type: ClassVar[str] = "pipe"
    ports: ClassVar = {"a": FLOW, "b": FLOW}


class Tank(Part):
    type: ClassVar[str] = "tank"
    ports: ClassVar = {"fluid": COMPLIANCE}

    def add_rows(self, rows: Rows) -> None:
        rows.chamber(rows.port("fluid"), volume=1e-9, pressure=1e5)


class Rail(Part):
    type: ClassVar[str] = "rail"
    ports: ClassVar = {"fluid": PRESSURE}

    def add_rows(self, rows: Rows) -> None:
        rows.pressure(rows.port("fluid"), time=[0.0], pressure=[1e6])


class Pump(Part):
    type: ClassVar[str] = "pump"
    ports: ClassVar = {"a": Port("hydraulic", Role.FLOW, optional=True), "b": FLOW}


class Coil(Part):
    type: ClassVar[str] = "coil"
    ports: ClassVar = {"terminals": COIL}


class Driver(Part):
    type: ClassVar[str] = "driver"
    ports: ClassVar = {"terminals": VOLTAGE}


FLUID = FluidChoice(name="n-heptane").at(293.15)
SPRING = Spring(stiffness=5e3, preload=20.0)
VALVE = {"needle": RigidMass(mass=3e-3), "spring": SPRING}
JOINED = [["needle.body", "spring.end"]]
PLUMBING = [["tank.fluid", "pipe.a"], ["pipe.b", "ambient"]]


def network(parts: dict[str, Component], connections: list[list[str]]) -> Network:
    return Network(parts, connections, fluid=FLUID)


def complaint(parts: dict[str, Component], connections: list[list[str]]) -> InputError:
    with pytest.raises(InputError) as caught:
        network(parts, connections).rows()
    return caught.value


WRONG = {
    "unknown component": (VALVE, [["needle.body", "sprng.end"]], "no component 'sprng'", "spring"),
    "unknown port": (VALVE, [["needle.body", "spring.ende"]], "no port 'ende'", "spring.end"),
    "no port": (VALVE, [["needle", "spring.end"]], "'needle'", "needle.body"),
    "misspelt word": (VALVE, [*JOINED, ["spring.base", "grund"]], "'grund'", "'ground'"),
    "joined twice": (
        {**VALVE, "force": ConstantForce(force=1.0)},
        [*JOINED, ["needle.body", "force.end"]],
        "needle.body for the second time (first in connections[0])",
        "list all ports that meet there together",
    ),
    "alone": (VALVE, [*JOINED, ["spring.base"]], "only spring.base", "all ports"),
    "empty": (VALVE, [*JOINED, []], "an empty connection", "all ports"),
    "only words": (VALVE, [*JOINED, ["ground", "ground"]], "no port other than", "remove"),
    "dangling": (
        {**VALVE, "force": ConstantForce(force=1.0)},
        JOINED,
        "the port force.end in no connection",
        "[force.end, ground]",
    ),
    "dangling flow": (
        {**VALVE, "pipe": Pipe(), "tank": Tank()},
        [*JOINED, ["pipe.a", "tank.fluid"]],
        "the port pipe.b in no connection",
        "[pipe.b, ambient]",
    ),
    "mixed domains": (
        {**VALVE, "tank": Tank()},
        [["needle.body", "spring.end", "tank.fluid"]],
        "tank.fluid (hydraulic)",
        "one by one",
    ),
    "mixed with a word": (
        {**VALVE, "tank": Tank()},
        [*JOINED, ["tank.fluid", "ground"]],
        "ground (mechanical)",
        "one by one",
    ),
    "two bodies": (
        {**VALVE, "armature": RigidMass(mass=1e-3)},
        [["needle.body", "armature.body", "spring.end"]],
        "2 bodies at one point: needle.body and armature.body",
        "end stop or a spring",
    ),
    "body and ground": (
        VALVE,
        [["needle.body", "spring.end", "ground"]],
        "needle.body connected to the ground",
        "stiff spring",
    ),
    "no body": (
        {**VALVE, "force": ConstantForce(force=1.0)},
        [["spring.end", "force.end"]],
        "nothing there has a mass",
        "add the body",
    ),
    "two pressures": (
        {**VALVE, "rail": Rail(), "return": Rail(), "pipe": Pipe()},
        [*JOINED, ["rail.fluid", "return.fluid", "pipe.a"], ["pipe.b", "ambient"]],
        "2 pressures at one node: rail.fluid and return.fluid",
        "orifice",
    ),
    "rail at ambient": (
        {**VALVE, "rail": Rail()},
        [*JOINED, ["rail.fluid", "ambient"]],
        "rail.fluid and ambient",
        "orifice",
    ),
    "volume at a rail": (
        {**VALVE, "rail": Rail(), "tank": Tank()},
        [*JOINED, ["rail.fluid", "tank.fluid"]],
        "the volume tank.fluid where rail.fluid prescribes the pressure",
        "orifice",
    ),
    "no compliance": (
        {**VALVE, "rail": Rail(), "p": Pipe(), "q": Pipe()},
        [*JOINED, ["rail.fluid", "p.a"], ["p.b", "q.a"], ["q.b", "ambient"]],
        "p.b, q.a: nothing there stores fluid",
        "chamber",
    ),
    "no reference pressure": (
        {**VALVE, "p": Pipe(), "q": Pipe()},
        [*JOINED, ["p.a", "q.b"], ["p.b", "q.a"]],
        "nothing there stores fluid or prescribes the pressure",
        "pressure source",
    ),
    "flow into a rigid node": (
        {**VALVE, "pump": Pump(), "pipe": Pipe()},
        [*JOINED, ["pump.b", "pipe.a"], ["pipe.b", "ambient"]],
        "a flow is forced into a node without volume",
        "chamber",
    ),
    "flow at a rail": (
        {**VALVE, "pump": Pump(), "rail": Rail()},
        [*JOINED, ["pump.b", "rail.fluid"]],
        "pump.b, which forces a flow, at the prescribed pressure rail.fluid",
        "chamber",
    ),
    "coil without driver": (
        {**VALVE, "coil": Coil()},
        JOINED,
        "the coil coil.terminals without a driver",
        "voltage-step",
    ),
    "two coils, no driver": (
        {**VALVE, "coil": Coil(), "other": Coil()},
        [*JOINED, ["coil.terminals", "other.terminals"]],
        "without a driver",
        "voltage-step",
    ),
    "driver without coil": (
        {**VALVE, "driver": Driver()},
        JOINED,
        "the driver driver.terminals without a coil",
        "solenoid",
    ),
    "two drivers": (
        {**VALVE, "coil": Coil(), "a": Driver(), "b": Driver()},
        [*JOINED, ["coil.terminals", "a.terminals", "b.terminals"]],
        "a.terminals and b.terminals and coil.terminals in one circuit",
        "driver of its own",
    ),
    "reserved name": ({"ground": RigidMass(mass=1.0)}, [], "the name 'ground'", "rename"),
    "no moving body": (
        {"spring": SPRING},
        [["spring.end", "ground"]],
        "no body that moves",
        "needle",
    ),
    "weight of nothing": (
        {**VALVE, "weight": Gravity()},
        [*JOINED, ["weight.body", "ground"]],
        "no body with a mass",
        "connect it to its body",
    ),
    "two start pressures": (
        {**VALVE, "a": Chamber(volume=1e-9, pressure=1e5), "b": Chamber(volume=1e-9, pressure=2e5)},
        [*JOINED, ["a.fluid", "b.fluid"]],
        "2 bar at the start where 'a' has 1 bar",
        "orifice",
    ),
}


@each("name", WRONG)
def test_what_is_wrong_is_said_once_and_clearly(name):
    parts, connections, got, hint = WRONG[name]

    error = complaint(parts, connections)

    assert got in error.got
    assert hint in error.hint
    assert error.where.startswith(("connections", "component", "network"))


class Unsettled(Spring):
    """A spring that finds no start."""

    def add_rows(self, rows: Rows) -> None:
        raise ConvergenceError("the fluxes do not converge.\nTry: another loop.")


def test_what_does_not_converge_at_the_start_names_its_component():
    parts = {"coil": Unsettled(stiffness=1e3, preload=0.0), "m": RigidMass(mass=1.0)}
    network = Network(parts, [["coil.end", "m.body"]])

    with pytest.raises(ConvergenceError, match=r"^coil, at the start: the fluxes do not converge"):
        network.rows()


def test_forces_that_do_not_converge_name_body_port_and_time():
    """Truth: a spring on a mass, explicitly coupled, is unstable where k h^2 is above 4 m."""
    parts = {
        "light": RigidMass(mass=1e-9),
        "spring": Spring(stiffness=1e6, preload=0.0),
        "stop": EndStop(gap=1e-6, law=LinearStopLaw(kind="linear", stiffness=1e8)),
    }
    joints = [["light.body", "spring.end", "stop.upper"], ["ground", "spring.base", "stop.lower"]]
    rows = Network(parts, joints).rows()
    rows.bodies[0] = replace(rows.bodies[0], speed=-1.0)

    with pytest.raises(ConvergenceError, match=r"^light: the forces .* at \d+ n?s \('body'") as end:
        simulate_network(rows, duration=1e-4, step=1e-7, start="free")

    assert "Try: a smaller step; a stiffness at 'light'" in str(end.value)


def test_an_interface_closed_at_the_start_is_refused():
    class Jammed(EndStop):
        def add_rows(self, rows: Rows) -> None:
            rows.interface(upper=rows.port("upper"), lower=rows.port("lower"), gap=-1e-6, law=None)

    stop = Jammed(gap=0.0, law={"kind": "linear", "stiffness": 1e9})
    error = complaint(
        {**VALVE, "seat": stop},
        [["needle.body", "spring.end", "seat.upper"], ["seat.lower", "ground"]],
    )

    assert error.got == "a gap of -1 um at the start: already closed"


def test_hydraulics_needs_a_fluid():
    with pytest.raises(InputError, match="no fluid, but the hydraulic component 'tank'"):
        Network({**VALVE, "tank": Tank(), "pipe": Pipe()}, [*JOINED, *PLUMBING])


def test_a_body_that_nothing_holds_is_allowed_with_a_warning():
    parts = {"needle": RigidMass(mass=3e-3), "force": ConstantForce(force=1.0)}

    with pytest.warns(LooseBodyWarning, match="nothing holds 'needle'"):
        rows = network(parts, [["needle.body", "force.end"]]).rows()

    assert len(rows.elements) == 1


@pytest.mark.filterwarnings("error")
def test_a_spring_or_a_stop_holds_a_body():
    stop = EndStop(gap=80e-6, law={"kind": "linear", "stiffness": 1e9})
    needle = RigidMass(mass=3e-3)

    network(VALVE, JOINED).rows()
    network(
        {"needle": needle, "stop": stop}, [["needle.body", "stop.lower"], ["stop.upper", "ground"]]
    ).rows()


def test_ports_get_handles_of_their_nodes():
    seen = {}

    class Probe(Component):
        type: ClassVar[str] = "probe"
        ports: ClassVar = {
            "a": FLOW,
            "b": FLOW,
            "drain": Port("hydraulic", Role.FLOW, optional=True),
            "needle": Port("mechanical", Role.ELEMENT),
            "base": Port("mechanical", Role.ELEMENT),
            "guide": Port("mechanical", Role.ELEMENT, optional=True),
        }

        def add_rows(self, rows: Rows) -> None:
            seen.update({name: rows.port(name) for name in self.ports})
            seen["partner"] = rows.partner("needle")
            seen["pressures"] = dict(rows.nodes)

    parts = {"probe": Probe(), **VALVE, "tank": Tank(), "other": RigidMass(mass=1.0)}
    connections = [
        ["probe.needle", "needle.body", "spring.end"],
        ["probe.a", "tank.fluid"],
        ["probe.b", "ambient"],
        ["probe.base", "ground"],
    ]

    with pytest.warns(LooseBodyWarning):
        rows = network(parts, connections).rows()

    assert rows.bodies[0].ports == (seen["needle"],)
    assert rows.bodies[1].ports != rows.bodies[0].ports
    assert seen["base"] == seen["guide"] == GROUND
    assert seen["b"] == seen["drain"] == AMBIENT
    assert seen["a"] not in (AMBIENT, GROUND)
    assert seen["partner"] == (VALVE["needle"], SPRING)
    assert set(seen["pressures"]) == {AMBIENT, seen["a"]}  # those are there before the others
    assert rows.nodes[AMBIENT].pressure == pytest.approx([101_325.0])


def test_a_dry_network_has_no_hydraulic_node():
    assert Network(VALVE, JOINED).rows().nodes == {}


def test_bodies_may_have_points_that_nothing_uses():
    parts = {"needle": RigidMass(mass=3e-3, points=("tip", "top")), "spring": SPRING}

    rows = Network(parts, [["needle.top", "spring.end"]]).rows()

    assert rows.elements[0].ports == (rows.bodies[0].ports[1], GROUND)
    assert MOTION.optional is False
