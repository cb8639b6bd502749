"""Columns of a schematic: bodies in the middle, hydraulics to their left, magnets to their right.

Column 0 has the bodies, 1 what pushes them without fluid, 2 drivers of coils, -1 what joins fluid
and bodies: seats, gaps, faces under pressure. Further left the hydraulics follow node by node: -2
the chambers that column -1 meets, -3 the restrictions and lines to those, and so on to the sources.
So most wires lead to the next column.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from klack.network.network import Network
from klack.network.nodes import Joint, Node
from klack.network.port import FLUID_DOMAINS, Role
from klack.schematic.cells import PlannedPort, Side
from klack.schematic.shapes import Domain

__all__ = ["Plan", "plan_of"]

_RULERS = (
    Role.MOTION,
    Role.COMPLIANCE,
    Role.PRESSURE,
    Role.VOLTAGE,
    Role.HEAT_STORE,
    Role.TEMPERATURE,
)
_BODIES, _PUSHING, _DRIVING = 0, 1, 2


@dataclass(frozen=True, slots=True)
class Plan:
    """Where everything of a network goes, before it has a size.

    Parameters
    ----------
    ports
        In the order of the class of the component.
    nodes
        Those that are drawn as wires.
    homes
        Column of the component that rules a node, to which its wires lead.
    """

    columns: Mapping[str, int]
    ports: Mapping[str, tuple[PlannedPort, ...]]
    nodes: Mapping[int, Node]
    homes: Mapping[int, int]


def plan_of(network: Network) -> Plan:
    """Columns of components, and sides of joined ports."""
    nodes = {node.index: node for node in network.nodes if not node.word}
    words = {str(joint): node.word for node in network.nodes for joint in node.joints if node.word}
    at = {str(joint): index for index, node in nodes.items() for joint in node.joints}
    columns, homes = _columns(network, nodes)
    rulers = {index: _ruler(node) for index, node in nodes.items()}
    ends: dict[int, set[int]] = {
        index: {columns[joint.component] for joint in node.joints if joint is not rulers[index]}
        for index, node in nodes.items()
    }
    ports = {}
    for name, part in network.components.items():
        planned = []
        for port, kind in part.port_kinds().items():
            joint, column = f"{name}.{port}", columns[name]
            domain: Domain = kind.domain  # type: ignore[assignment]
            if joint not in at:
                side: Side = "left" if column in (_BODIES, _PUSHING) or column < -1 else "right"
                if kind.domain in FLUID_DOMAINS:
                    side = "left"
                mark = words.get(joint, "open")
                is_missing = mark == "open" and not (kind.optional or kind.role is Role.MOTION)
                planned.append(PlannedPort(port, domain, (side,), None, mark, is_missing))
                continue
            node = at[joint]
            ruler = rulers[node]
            sides: tuple[Side, ...]
            if ruler is not None and str(ruler) == joint:
                sides = _sides(column, ends[node])
            else:
                sides = ("right",) if homes[node] > column else ("left",)
            planned.append(PlannedPort(port, domain, sides, node))
        ports[name] = tuple(planned)
    return Plan(columns, ports, nodes, homes)


def _sides(column: int, ends: Iterable[int]) -> tuple[Side, ...]:
    """Sides of a ruler towards the others; left for its own column."""
    ends = tuple(ends)
    found: list[Side] = []
    if any(end < column for end in ends) or not ends:
        found.append("left")
    if any(end > column for end in ends):
        found.append("right")
    if any(end == column for end in ends) and "left" not in found:
        found.append("left")
    return tuple(found)


def _ruler(node: Node) -> Joint | None:
    """Main port of a node: body, volume, source or driver."""
    for role in _RULERS:
        if found := node.having(role):
            return found[0]
    return None


def _columns(network: Network, nodes: Mapping[int, Node]) -> tuple[dict[str, int], dict[int, int]]:
    columns: dict[str, int] = {}
    fluid: list[str] = []
    for name, part in network.components.items():
        kinds = part.port_kinds().values()
        domains = {kind.domain for kind in kinds}
        if any(kind.role is Role.MOTION for kind in kinds):
            columns[name] = _BODIES
        elif domains & set(FLUID_DOMAINS) and len(domains) > 1:
            columns[name] = -1
        elif domains & set(FLUID_DOMAINS):
            fluid.append(name)
        else:
            columns[name] = _DRIVING if domains == {"electric"} else _PUSHING
    homes = {}
    for index, node in nodes.items():
        if node.domain not in FLUID_DOMAINS:
            ruler = _ruler(node)
            rest = max(columns[joint.component] for joint in node.joints)
            homes[index] = rest + 1 if ruler is None else columns[ruler.component]
    _spread(fluid, nodes, columns, homes)
    return columns, homes


def _spread(
    fluid: Iterable[str],
    nodes: Mapping[int, Node],
    columns: dict[str, int],
    homes: dict[int, int],
) -> None:
    """Add columns of the hydraulics and their nodes, stepping out from the bodies."""
    wet = {index: node for index, node in nodes.items() if node.domain in FLUID_DOMAINS}
    meets: dict[str, list[int]] = {}
    for index, node in wet.items():
        for joint in node.joints:
            meets.setdefault(joint.component, []).append(index)
    todo: deque[int] = deque()

    def reach(index: int, column: int) -> None:
        if index not in homes:
            homes[index] = column
            todo.append(index)

    for name, column in list(columns.items()):
        for index in meets.get(name, ()):
            reach(index, min(column, -1) - 1)
    left = [index for index in wet if index not in homes]
    while todo or left:
        if not todo:  # a part of the hydraulics that meets no body
            reach(_far_end(left[0], wet, meets), -2)
        index = todo.popleft()
        ruler = _ruler(wet[index])
        for joint in wet[index].joints:
            if joint.component not in columns:
                columns[joint.component] = homes[index] - (joint is not ruler)
                for other in meets[joint.component]:
                    reach(other, homes[index] - 2)
        left = [index for index in left if index not in homes]
    for name in fluid:
        columns.setdefault(name, -2)


def _far_end(start: int, wet: Mapping[int, Node], meets: Mapping[str, list[int]]) -> int:
    """The node farthest from a node."""
    seen, todo = {start: 0}, deque([start])
    while todo:
        index = todo.popleft()
        for joint in wet[index].joints:
            for other in meets[joint.component]:
                if other not in seen:
                    seen[other] = seen[index] + 1
                    todo.append(other)
    return max(seen, key=lambda index: seen[index])
