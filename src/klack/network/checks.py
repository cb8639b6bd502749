"""Checks that a network is a computable valve."""

import warnings
from collections.abc import Iterable, Mapping

from klack.errors import refuse_if
from klack.input.problem import CaseProblem, refuse_key_if
from klack.network.component import Component
from klack.network.nodes import Joint, Node
from klack.network.port import Role
from klack.network.ranges import check_ranges
from klack.network.rows import GROUND, Rows
from klack.units import format_si

__all__ = ["LooseBodyWarning", "check_nodes", "check_rows"]

_TOUCHING = 1e-12  # [m]; what rounding may leave of a gap of zero


class LooseBodyWarning(UserWarning):
    """A body that nothing holds: correct, but seldom meant."""


def check_nodes(components: Mapping[str, Component], nodes: Iterable[Node]) -> None:
    """Checks that need only the connections; raises CaseProblem."""
    nodes = tuple(nodes)
    _check_dangling(components, nodes)
    checks = {
        "mechanical": _check_motion,
        "hydraulic": _check_pressure,
        "pneumatic": _check_pressure,
        "electric": _check_drive,
        "thermal": _check_temperature,
    }
    for node in nodes:
        checks[node.domain](components, node)


def _check_dangling(components: Mapping[str, Component], nodes: Iterable[Node]) -> None:
    joined = {(joint.component, joint.name) for node in nodes for joint in node.joints}
    for component, part in components.items():
        for name, port in part.port_kinds().items():
            if port.optional or port.role is Role.MOTION or (component, name) in joined:
                continue
            if port.role is Role.COIL:
                raise _no_driver(("components", component), f"{component}.{name}")
            if port.role is Role.FEEDS:
                raise CaseProblem(
                    ("components", component),
                    got=f"the boost capacitor {component}.{name} without a driver",
                    expected="boost-drivers that draw from it",
                    hint=f"join them: [{component}.{name}, driver.supply], or remove it.",
                )
            if port.role is Role.FED:
                raise CaseProblem(
                    ("components", component),
                    got="a boost-driver without a capacitor",
                    expected="capacitance, boost_voltage and recharge_power, or its port 'supply' "
                    "joined to a boost-capacitor",
                    hint=f"write [capacitor.outlet, {component}.{name}] among the connections.",
                )
            if port.role is Role.VOLTAGE:
                raise _no_coil(("components", component), f"{component}.{name}")
            raise CaseProblem(
                ("components", component),
                got=f"the port {component}.{name} in no connection",
                expected=f"every port connected ({port.domain}: it {port.role.value})",
                hint=_where_to(port.domain, f"{component}.{name}"),
            )


def _where_to(domain: str, port: str) -> str:
    words = {
        "mechanical": f"connect it to a port of a body, or to the ground: [{port}, ground].",
        "hydraulic": f"connect it to a chamber or a pressure, or to ambient: [{port}, ambient].",
        "pneumatic": f"connect it to a gas-chamber or a gas-source, or to ambient: "
        f"[{port}, ambient].",
        "electric": f"connect it to its partner: [driver.terminals, {port}].",
        "thermal": f"connect it to a heat capacity, or to ambient: [{port}, ambient].",
    }
    return words[domain]


def _check_motion(components: Mapping[str, Component], node: Node) -> None:
    bodies = [str(joint) for joint in node.having(Role.MOTION)]
    if node.word and bodies:
        raise CaseProblem(
            ("connections", node.index),
            got=f"{_and(bodies)} connected to the ground",
            expected="a body or the ground, not both at one point",
            hint="fix the body in its definition, or support it by a stiff spring.",
        )
    if len(bodies) > 1:
        raise CaseProblem(
            ("connections", node.index),
            got=f"{len(bodies)} bodies at one point: {_and(bodies)}",
            expected="one body and the components that act on it",
            hint="put an end stop or a spring between the bodies, or make them one body.",
        )
    if not node.word and not bodies:
        raise CaseProblem(
            ("connections", node.index),
            got=f"{node}: nothing there has a mass",
            expected="a port of one body, or the ground",
            hint="add the body that they act on to this list; springs in series need one in "
            "between.",
        )


def _check_pressure(components: Mapping[str, Component], node: Node) -> None:
    prescribed = [str(joint) for joint in node.having(Role.PRESSURE)]
    prescribed += [node.word] if node.word else []
    volumes = [str(joint) for joint in node.having(Role.COMPLIANCE)]
    if len(prescribed) > 1:
        raise CaseProblem(
            ("connections", node.index),
            got=f"{len(prescribed)} pressures at one node: {_and(prescribed)}",
            expected="one pressure",
            hint="put an orifice or a line between them.",
        )
    if prescribed and volumes:
        raise CaseProblem(
            ("connections", node.index),
            got=f"the volume {volumes[0]} where {prescribed[0]} prescribes the pressure",
            expected="either a volume with a computed pressure, or a prescribed pressure",
            hint="remove the chamber, or put an orifice between the two.",
        )
    if prescribed and not node.word:
        _refuse_forced_flow(components, node, prescribed[0])
    if not prescribed and not volumes:
        raise _no_compliance(components, node)


def _refuse_forced_flow(components: Mapping[str, Component], node: Node, pressure: str) -> None:
    for joint in node.joints:
        if _is_flow_source(components, joint):
            raise CaseProblem(
                ("connections", node.index),
                got=f"{joint}, which forces a flow, at the prescribed pressure {pressure}",
                expected="a flow into a volume, whose pressure can respond",
                hint="connect it to a chamber; at a prescribed pressure it has no effect.",
            )


def _is_flow_source(components: Mapping[str, Component], joint: Joint) -> bool:
    """Whether the component forces a flow through this port alone."""
    ports = components[joint.component].port_kinds().values()
    needed = [port for port in ports if not port.optional]
    two = len(ports) > 1  # a store of fluid has one alone
    return two and needed == [joint.port] and joint.port.role is Role.FLOW


def _no_compliance(components: Mapping[str, Component], node: Node) -> CaseProblem:
    if node.domain == "pneumatic":
        return CaseProblem(
            ("connections", node.index),
            got=f"{node}: nothing there stores gas or prescribes the pressure",
            expected="a gas-chamber, a gas-source or ambient at every pneumatic node",
            hint="add the dead volume there as a gas-chamber (a few mm^3), or a gas-source.",
        )
    got = f"{node}: nothing there stores fluid or prescribes the pressure"
    if any(_is_flow_source(components, joint) for joint in node.joints):
        got = f"{node}: a flow is forced into a node without volume"
    return CaseProblem(
        ("connections", node.index),
        got=got,
        expected="a chamber, a prescribed pressure or ambient at every hydraulic node",
        hint="add the dead volume there as a chamber (a few mm^3), a junction where lines meet, or "
        "a pressure source.",
    )


def _check_temperature(components: Mapping[str, Component], node: Node) -> None:
    prescribed = [str(joint) for joint in node.having(Role.TEMPERATURE)]
    prescribed += [node.word] if node.word else []
    stores = [str(joint) for joint in node.having(Role.HEAT_STORE)]
    if len(prescribed) > 1 or (prescribed and stores):
        raise CaseProblem(
            ("connections", node.index),
            got=f"{_and([*prescribed, *stores])} at one node",
            expected="one prescribed temperature, or heat capacities",
            hint="put a thermal-conductance or a convection between them.",
        )


def _check_drive(components: Mapping[str, Component], node: Node) -> None:
    if node.having(Role.FEEDS) or node.having(Role.FED):
        _check_feed(node)
        return
    drivers = [str(joint) for joint in node.having(Role.VOLTAGE)]
    coils = [str(joint) for joint in node.having(Role.COIL)]
    key = ("connections", node.index)
    if not drivers:
        raise _no_driver(key, _and(coils))
    if not coils:
        raise _no_coil(key, _and(drivers))
    if len(drivers) > 1 or len(coils) > 1:
        raise CaseProblem(
            key,
            got=f"{_and([*drivers, *coils])} in one circuit",
            expected="one driver and one coil",
            hint="give every coil a driver of its own, with equal settings if you like; coils of "
            "one magnetic-network without 'circuit' are in series.",
        )


def _check_feed(node: Node) -> None:
    sources = [str(joint) for joint in node.having(Role.FEEDS)]
    drivers = [str(joint) for joint in node.having(Role.FED)]
    others = [str(joint) for joint in node.joints if str(joint) not in (*sources, *drivers)]
    if len(sources) != 1 or not drivers or others:
        raise CaseProblem(
            ("connections", node.index),
            got=f"{_and([*sources, *drivers, *others])} at one node",
            expected="one boost-capacitor, and the port 'supply' of each boost-driver that draws "
            "from it",
            hint="write [capacitor.outlet, first_driver.supply, second_driver.supply].",
        )


def _no_driver(key: tuple[str | int, ...], coil: str) -> CaseProblem:
    return CaseProblem(
        key,
        got=f"the coil {coil} without a driver",
        expected="a driver at its terminals",
        hint=f"add one, e.g. of the type voltage-step, and connect it: [driver.terminals, {coil}].",
    )


def _no_coil(key: tuple[str | int, ...], driver: str) -> CaseProblem:
    return CaseProblem(
        key,
        got=f"the driver {driver} without a coil",
        expected="a solenoid at its terminals",
        hint=f"join it: [{driver}, solenoid.terminals], or remove it.",
    )


def check_rows(rows: Rows) -> None:
    """Check the rows of all components; warn of an unsupported body.

    Raises
    ------
    InputError
        For no body at all, an interface closed at the start, a node without a row, or a stroke
        that leaves the range of a law (:mod:`klack.network.ranges`).
    """
    refuse_if(
        not rows.bodies,
        "network",
        got="no body that moves",
        expected="at least one, of the type rigid-mass or flexible-body",
        hint="add the needle as a component.",
    )
    for interface in rows.interfaces:
        if interface.gap < -_TOUCHING:
            raise CaseProblem(
                ("components", interface.component),
                got=f"a gap of {format_si(interface.gap, 'm')} at the start: already closed",
                expected="a gap of 0 or more",
                hint="start in contact (gap 0): a preload then compresses the stop.",
            )
    _check_driven(rows)
    _check_node_rows(rows)
    _check_junctions(rows)
    check_ranges(rows)
    _warn_of_loose_bodies(rows)


def _check_driven(rows: Rows) -> None:
    """Reject a stop or a friction between a prescribed motion and what cannot move."""
    driven = {port for row in rows.bodies if row.course is not None for port in row.ports}
    fixed = driven | {GROUND}
    joined = [(row.component, {row.upper, row.lower}) for row in rows.interfaces]
    joined += [(row.component, {row.upper, row.lower}) for row in rows.sliders]
    for component, sides in joined:
        refuse_key_if(
            driven & sides and sides <= fixed,
            ("components", component),
            got="a prescribed motion on one side, and nothing that can yield on the other",
            expected="a body that its force can move",
            hint="leave it out, or give the other side a mass on a spring.",
        )


def _check_node_rows(rows: Rows) -> None:
    used = [(wall.node, wall.component) for wall in rows.walls]
    used += [(node, row.component) for row in rows.branches for node in (row.a, row.b)]
    used += [(node, row.component) for row in rows.lines for node in (row.a, row.b)]
    used += [(node, row.component) for row in rows.waves for node in (row.a, row.b)]
    for node, component in used:
        refuse_key_if(
            node not in rows.nodes,
            ("components", component),
            got="a flow or wall at a node that has no pressure",
            expected="a chamber, a prescribed pressure or ambient there",
            hint="a component with a port of the role COMPLIANCE must call rows.chamber.",
        )


def _check_junctions(rows: Rows) -> None:
    """Reject a junction without a line, whose pressure nothing sets, or with a moving face."""
    lines = {node for row in rows.lines for node in (row.a, row.b)}
    lines |= {node for row in rows.waves for node in (row.a, row.b)}
    for node, row in rows.nodes.items():
        if not row.junction:
            continue
        refuse_key_if(
            node not in lines,
            ("components", row.component),
            got="a junction without the end of a line",
            expected="at least one line there: its impedance sets the pressure",
            hint="make it a chamber of the volume of the crossing (a few mm^3).",
        )
        moving = [w.component for w in rows.walls if w.node == node and w.port != GROUND]
        if moving:
            raise CaseProblem(
                ("components", moving[0]),
                got=f"a face that moves at the junction '{row.component}', which has no volume",
                expected="a chamber there: the moving face displaces fluid",
                hint="replace the junction with a chamber of the volume in front of the face.",
            )


def _warn_of_loose_bodies(rows: Rows) -> None:
    """Warn of free bodies that no contact, no spring and no enclosed fluid can bring to rest."""
    held = {port for row in rows.interfaces for port in (row.upper, row.lower)}
    for element in rows.elements:
        if any(book.kind == "store" for book in element.books):
            held |= set(element.ports)
    held |= {wall.port for wall in rows.walls if rows.nodes[wall.node].volume > 0.0}
    for body in rows.bodies:
        if body.body.rigid_count and not held & (set(body.ports) - {GROUND}):
            warnings.warn(
                f"nothing holds '{body.component}': a steady force accelerates it without limit.\n"
                "Try: add an end stop or a spring.",
                LooseBodyWarning,
                stacklevel=4,
            )


def _and(names: Iterable[str]) -> str:
    return " and ".join(names)
