"""Connections turned into nodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from klack.input.problem import CaseProblem, nearest, one_of
from klack.network.component import Component
from klack.network.port import Port, Role

__all__ = ["RESERVED", "Joint", "Node", "join"]

RESERVED = {"ground": "mechanical", "ambient": "hydraulic"}
"""Words allowed in a connection instead of a port, and their domains.

``ambient`` beside ports of gas is the pressure of the surroundings as well, beside thermal ports
their temperature.
"""


@dataclass(frozen=True, slots=True)
class Joint:
    """A port at a node."""

    component: str
    name: str
    port: Port

    def __str__(self) -> str:
        return f"{self.component}.{self.name}"


@dataclass(frozen=True, slots=True)
class Node:
    """Ports that are one point, one pressure, one pair of wires, or one temperature.

    Parameters
    ----------
    index
        Place of its connection in the list.
    word
        ``"ground"``, ``"ambient"`` or empty.
    """

    index: int
    domain: str
    joints: tuple[Joint, ...]
    word: str = ""

    def having(self, role: Role) -> tuple[Joint, ...]:
        """Joints of one role."""
        return tuple(joint for joint in self.joints if joint.port.role is role)

    def __str__(self) -> str:
        return ", ".join([*(str(joint) for joint in self.joints), *([self.word] * bool(self.word))])


def join(
    components: Mapping[str, Component], connections: Sequence[Sequence[str]]
) -> tuple[Node, ...]:
    """Look up the ports of every connection.

    Raises
    ------
    CaseProblem
        For an unknown component or port, a port in two connections, or mixed domains.
    """
    ports = {name: component.port_kinds() for name, component in components.items()}
    seen: dict[str, int] = {}
    return tuple(
        _node(index, connection, ports, seen) for index, connection in enumerate(connections)
    )


def _node(
    index: int,
    connection: Sequence[str],
    ports: Mapping[str, Mapping[str, Port]],
    seen: dict[str, int],
) -> Node:
    if len(connection) < 2:
        raise CaseProblem(
            ("connections", index),
            got=f"only {connection[0]}" if connection else "an empty connection",
            expected="two ports or more, or a port and ground or ambient",
            hint="list all ports that meet: [needle.tip, spring.end].",
        )
    joints: list[Joint] = []
    words: list[str] = []
    for place, text in enumerate(connection):
        key = ("connections", index, place)
        if text in RESERVED:
            words.append(text)
            continue
        joint = _joint(key, text, ports)
        if str(joint) in seen:
            raise _joined_twice(key, joint, seen[str(joint)])
        seen[str(joint)] = index
        joints.append(joint)
    domains = {str(joint): joint.port.domain for joint in joints}
    others = set(domains.values())
    of_ambient = next((d for d in ("pneumatic", "thermal") if others == {d}), RESERVED["ambient"])
    domains |= {word: of_ambient if word == "ambient" else RESERVED[word] for word in words}
    if {"hydraulic", "pneumatic"} <= set(domains.values()):
        raise _mixed_fluids(index, domains)
    if len(set(domains.values())) > 1:
        raise CaseProblem(
            ("connections", index),
            got=" with ".join(f"{name} ({domain})" for name, domain in domains.items()),
            expected="ports of one domain",
            hint="a component of two domains has a port in each: connect them one by one.",
        )
    if not joints:
        raise CaseProblem(
            ("connections", index),
            got=f"no port other than {one_of(words)}",
            expected="at least one port of a component",
            hint="remove the connection, or add the missing port.",
        )
    domain = next(iter(domains.values()))
    return Node(index, domain, tuple(joints), words[0] if words else "")


def _mixed_fluids(index: int, domains: Mapping[str, str]) -> CaseProblem:
    words = {"hydraulic": "liquid", "pneumatic": "gas"}
    return CaseProblem(
        ("connections", index),
        got=" with ".join(f"{name} ({words.get(d, d)})" for name, d in domains.items()),
        expected="only liquid ports, or only gas ports",
        hint="join them through a body, with a pressure-face on the liquid side and a gas-face "
        "on the gas side; or use an accumulator, which contains its own gas.",
    )


def _joint(key: tuple[str | int, ...], text: str, ports: Mapping[str, Mapping[str, Port]]) -> Joint:
    component, dot, name = text.partition(".")
    if not dot:
        raise CaseProblem(
            key,
            got=f"'{text}'",
            expected="component.port, or one of the words ground, ambient",
            hint=nearest(text, RESERVED, f"write the port as well, e.g. {_example(text, ports)}."),
        )
    if component not in ports:
        raise CaseProblem(
            key,
            got=f"'{text}', but there is no component '{component}'",
            expected=f"a port of one of: {one_of(ports)}",
            hint=nearest(component, ports, "add the component, or correct its name."),
        )
    known = ports[component]
    if name not in known:
        full = [f"{component}.{port}" for port in known]
        raise CaseProblem(
            key,
            got=f"'{text}', but '{component}' has no port '{name}'",
            expected=f"one of: {one_of(full)}",
            hint=nearest(
                text,
                full,
                "a component has the ports of its type, some only with certain keys: a "
                "boost-driver has 'supply' only without a capacitance of its own.",
            ),
        )
    return Joint(component, name, known[name])


def _example(text: str, ports: Mapping[str, Mapping[str, Port]]) -> str:
    names = list(ports.get(text, {})) or ["port"]
    return f"{text}.{names[0]}"


def _joined_twice(key: tuple[str | int, ...], joint: Joint, first: int) -> CaseProblem:
    return CaseProblem(
        key,
        got=f"{joint} for the second time (first in connections[{first}])",
        expected="each port in one connection",
        hint="list all ports that meet there together: [a.x, b.y, c.z].",
    )
