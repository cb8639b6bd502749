"""What holds for every schematic, as rules, and random networks to hold them on."""

import random
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse.csgraph import connected_components

from klack.hydraulics.annulus import Annulus
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce
from klack.mechanics.friction import GuideFriction
from klack.mechanics.gravity import Gravity
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import COIL, ELEMENT, FLOW, MOTION, Port, Role
from klack.network.rows import Rows
from klack.schematic.picture import Schematic
from klack.schematic.shapes import Box, Point
from klack.units import Pressure

Segment = tuple[Point, Point]
FLUID = FluidChoice(name="n-heptane").at(293.15)


class Actuator(Component):
    """A component of the user's own, with ports in two domains: nothing knows its symbol."""

    type: ClassVar[str] = "tests:Actuator"
    ports: ClassVar = {
        "upper": FLOW,
        "lower": FLOW,
        "pilot": Port("hydraulic", FLOW.role, optional=True),
        "rod": ELEMENT,
    }

    relief: Pressure = Field(gt=0, description="Pressure at which it opens.")

    def add_rows(self, rows: Rows) -> None:
        """Nothing: it is only drawn."""


class Plunger(Component):
    """A body of the user's own that is magnet and piston at once: its wires pass other columns."""

    type: ClassVar[str] = "tests:Plunger"
    ports: ClassVar = {"body": MOTION, "fluid": FLOW, "terminals": COIL}

    def add_rows(self, rows: Rows) -> None:
        """Nothing: it is only drawn."""


# --------------------------------------------------------------------------- rules


def broken_rules(drawn: Schematic, network: Network) -> list[str]:
    """Every rule that a schematic breaks, in words; none if it is right."""
    return [
        *_each_component_once(drawn, network),
        *_nothing_overlaps(drawn),
        *_all_in_view(drawn),
        *_every_connection(drawn, network),
        *_wires_apart(drawn),
    ]


def _each_component_once(drawn: Schematic, network: Network) -> Iterator[str]:
    found = [symbol.component for symbol in drawn.symbols if symbol.component]
    if sorted(found) != sorted(network.components):
        yield f"components drawn: {sorted(found)}"
    at_node = {str(joint) for node in network.nodes if not node.word for joint in node.joints}
    every = {
        f"{name}.{port}" for name, part in network.components.items() for port in part.port_kinds()
    }
    drawn_ports = {lead.port for lead in drawn.leads if lead.port}
    points = {  # of a body in no connection: a mark beside its name, without a line
        f"{name}.{port}"
        for name, part in network.components.items()
        for port, kind in part.port_kinds().items()
        if kind.role is Role.MOTION
    }
    if missing := every - drawn_ports - (points - at_node):
        yield f"ports without a line: {sorted(missing)}"


def _meet(first: Sequence[Box], second: Sequence[Box], gap: float = 0.0) -> list[tuple[int, int]]:
    """Pairs of boxes that have a common area; numbers of the boxes."""
    (x, y, right, bottom), (a, b, c, d) = (
        np.array([(q.x, q.y, q.x + q.width, q.y + q.height) for q in boxes]).reshape(-1, 4).T
        for boxes in (first, second)
    )
    across = (x[:, None] < c + gap) & (a < right[:, None] + gap)
    found = across & (y[:, None] < d + gap) & (b < bottom[:, None] + gap)
    return [(int(i), int(j)) for i, j in np.argwhere(found)]


def _nothing_overlaps(drawn: Schematic) -> Iterator[str]:
    names = [symbol.component or "mark" for symbol in drawn.symbols]
    boxes = [symbol.box for symbol in drawn.symbols]
    texts = [label.box for label in drawn.labels]
    for i, j in _meet(boxes, boxes):
        if i < j:
            yield f"symbols overlap: {names[i]} and {names[j]}"
    for i, j in _meet(texts, texts):
        if i < j:
            yield f"labels overlap: {drawn.labels[i].text} and {drawn.labels[j].text}"
    bodies = {s.component for s in drawn.symbols if s.box.height > 60 and s.box.width > 60}
    for i, j in _meet(texts, boxes):
        if not (names[j] in bodies and _inside(texts[i], boxes[j])):
            yield f"the label {drawn.labels[i].text} lies on the symbol of {names[j]}"


def _inside(inner: Box, outer: Box) -> bool:
    near = 1e-6  # rounding
    return (
        outer.x <= inner.x + near
        and outer.y <= inner.y + near
        and inner.x + inner.width <= outer.x + outer.width + near
        and inner.y + inner.height <= outer.y + outer.height + near
    )


def _all_in_view(drawn: Schematic) -> Iterator[str]:
    for item in (*drawn.labels, *drawn.symbols):
        if not _inside(item.box, drawn.box):
            yield f"out of view: {item}"
    for points in (*(lead.points for lead in drawn.leads), *_lines(drawn)):
        for x, y in points:
            if not _inside(Box(x, y, 0.0, 0.0), drawn.box):
                yield f"a line out of view: {points}"


def _lines(drawn: Schematic) -> list[Segment]:
    return [line for wire in drawn.wires for line in wire.lines]


def _segments(drawn: Schematic) -> dict[int, list[Segment]]:
    """Straight pieces of each node, with those between the edge of a cell and its symbol."""
    found = {wire.node: list(wire.lines) for wire in drawn.wires}
    for lead in drawn.leads:
        if lead.node is not None:
            found[lead.node] += list(zip(lead.points, lead.points[1:], strict=False))
    return found


def _every_connection(drawn: Schematic, network: Network) -> Iterator[str]:
    nodes = {node.index: node for node in network.nodes if not node.word}
    if {wire.node for wire in drawn.wires} != set(nodes):
        yield f"nodes drawn: {[wire.node for wire in drawn.wires]}"
    boxes = {s.component: s.box for s in drawn.symbols}
    for index, segments in _segments(drawn).items():
        joints = {str(joint) for joint in nodes[index].joints}
        leads = [lead for lead in drawn.leads if lead.node == index]
        if {lead.port for lead in leads} != joints:
            yield f"node {index} has leads to {sorted(lead.port for lead in leads)}"
        ends: dict[str, list[Point]] = {}
        for lead in leads:
            ends.setdefault(lead.port, []).append(lead.points[-1])
        # a port on both sides of its symbol joins them
        through = [(found[0], found[1]) for found in ends.values() if len(found) == 2]
        if _pieces([*segments, *through]) > 1:
            yield f"node {index} is in pieces: {nodes[index]}"
        for lead in leads:
            x, y = lead.points[-1]
            if not Box(x, y, 0.0, 0.0).meets(boxes[lead.port.partition(".")[0]], 7.0):
                yield f"the line of {lead.port} ends before its symbol"


def _pieces(segments: Sequence[Segment]) -> int:
    """Number of parts that are not joined; a crossing alone joins nothing."""
    return int(connected_components(_touching(segments, segments), directed=False)[0])


def _touching(first: Sequence[Segment], second: Sequence[Segment]) -> NDArray[np.bool_]:
    """Whether an end of one lies on the other."""
    return _ends_on(first, second) | _ends_on(second, first).T


def _ends_on(first: Sequence[Segment], second: Sequence[Segment]) -> NDArray[np.bool_]:
    ends = np.array(first, dtype=float)[:, :, None, :]
    low, high = (f(np.array(second, dtype=float), axis=1) for f in (np.min, np.max))
    near = 1e-6
    on = ((low - near <= ends) & (ends <= high + near)).all(axis=3)
    return np.asarray(on.any(axis=1))


def _wires_apart(drawn: Schematic) -> Iterator[str]:
    """Level or upright; none along another node, or ending on it; none through a symbol."""
    owned = [(index, line) for index, lines in _segments(drawn).items() for line in lines]
    for index, ((a, b), (c, d)) in owned:
        if a != c and b != d:
            yield f"node {index} has a slanted line"
    if not owned:
        return
    nodes = np.array([index for index, _ in owned])
    touching = _touching([line for _, line in owned], [line for _, line in owned])
    for i, j in np.argwhere(touching & (nodes[:, None] < nodes)):
        yield f"nodes {nodes[i]} and {nodes[j]} touch"
    wires = [Box(min(a, c), min(b, d), abs(a - c), abs(b - d)) for (a, b), (c, d) in _lines(drawn)]
    items = (*drawn.symbols, *drawn.labels)
    for i, j in _meet(wires, [item.box for item in items], -0.5):
        yield f"the wire {wires[i]} runs through {items[j]}"


# --------------------------------------------------------------------------- random networks


def random_network(seed: int) -> Network:
    """A network of up to 60 components of every domain, joined by chance."""
    draw = random.Random(seed)
    parts: dict[str, Component] = {}
    nodes: dict[str, list[str]] = {"ground": ["ground"], "ambient": ["ambient"]}
    for name in [f"body_{i}" for i in range(draw.randint(1, 6))]:
        points = tuple(f"{draw.choice(_WORDS)}_{k}" for k in range(draw.randint(1, 6)))
        parts[name] = RigidMass(mass=draw.choice((1e-3, 2.0)), points=points, speed=draw.random())
        nodes |= {f"{name}.{point}": [f"{name}.{point}"] for point in points}
    points = [node for node in nodes if "." in node]
    volumes = []
    for i in range(draw.randint(0, 8)):
        name = f"volume_{i}"
        is_source = draw.random() < 0.25
        parts[name] = PressureSource(pressure=5e5) if is_source else Chamber(volume=1e-7)
        nodes[name] = [f"{name}.fluid"]
        volumes.append(name)
    for i in range(draw.randint(1, 60 - len(parts))):
        if len(parts) >= 59:
            break
        name = f"{draw.choice(_WORDS)}{i}"
        kinds = [*_MECHANICAL, _coil] + ([*_WET] if volumes else [])
        draw.choice(kinds)(draw, name, parts, nodes, points, volumes)
    used = [ports for ports in nodes.values() if len(ports) > 1]
    alone = [name for name in volumes if len(nodes[name]) == 1]
    for name in alone:  # a volume in no connection is not allowed
        del parts[name]
    wet = any(p.domain == "hydraulic" for x in parts.values() for p in x.port_kinds().values())
    return Network(parts, used, fluid=FLUID if wet else None)


_WORDS = ("seat", "a", "a_very_long_name_of_a_part_of_this_valve", "upper-land", "W_WWWWW")
_Nodes = dict[str, list[str]]


def _body(draw: random.Random, points: list[str], *, ground: bool = True) -> str:
    return "ground" if ground and draw.random() < 0.3 else draw.choice(points)


def _one(cls: Any, port: str, **values: Any) -> Any:
    def add(
        draw: random.Random,
        name: str,
        parts: dict[str, Component],
        nodes: _Nodes,
        points: list[str],
        volumes: list[str],
    ) -> None:
        parts[name] = cls(**values)
        nodes[_body(draw, points, ground=False)].append(f"{name}.{port}")

    return add


def _two(cls: Any, first: str, second: str, optional: bool, **values: Any) -> Any:
    def add(
        draw: random.Random,
        name: str,
        parts: dict[str, Component],
        nodes: _Nodes,
        points: list[str],
        volumes: list[str],
    ) -> None:
        parts[name] = cls(**values)
        nodes[_body(draw, points)].append(f"{name}.{first}")
        if not (optional and draw.random() < 0.5):
            nodes[_body(draw, points)].append(f"{name}.{second}")

    return add


def _coil(
    draw: random.Random,
    name: str,
    parts: dict[str, Component],
    nodes: _Nodes,
    points: list[str],
    volumes: list[str],
) -> None:
    parts[name] = ForceMapSolenoid(
        resistance=1.0,
        gap=1e-4,
        closes=draw.choice(("upward", "downward")),
        current=(0.0, 1.0, 2.0),
        gaps=(0.0, 1e-4, 2e-4),
        linkage=((0.0, 0.0, 0.0), (3e-3, 2e-3, 1e-3), (6e-3, 4e-3, 2e-3)),
    )
    parts[f"driver_of_{name}"] = VoltageStep(voltage=12.0)
    nodes[_body(draw, points, ground=False)].append(f"{name}.armature")
    if draw.random() < 0.5:
        nodes[_body(draw, points)].append(f"{name}.base")
    nodes[f"circuit of {name}"] = [f"driver_of_{name}.terminals", f"{name}.terminals"]


def _plunger(
    draw: random.Random,
    name: str,
    parts: dict[str, Component],
    nodes: _Nodes,
    points: list[str],
    volumes: list[str],
) -> None:
    parts[name] = Plunger()
    parts[f"driver_of_{name}"] = VoltageStep(voltage=12.0)
    nodes[f"{name}.body"] = [f"{name}.body"]
    points.append(f"{name}.body")
    nodes[draw.choice(volumes)].append(f"{name}.fluid")
    nodes[f"circuit of {name}"] = [f"driver_of_{name}.terminals", f"{name}.terminals"]


def _fluid_part(cls: Any, wet: tuple[str, ...], solid: Mapping[str, bool], **values: Any) -> Any:
    """``wet`` ports go to volumes or ambient, ``solid`` ones to bodies: whether they must."""

    def add(
        draw: random.Random,
        name: str,
        parts: dict[str, Component],
        nodes: _Nodes,
        points: list[str],
        volumes: list[str],
    ) -> None:
        parts[name] = cls(**values)
        for port in wet:
            place = "ambient" if draw.random() < 0.2 else draw.choice(volumes)
            nodes[place].append(f"{name}.{port}")
        for port, needed in solid.items():
            if needed or draw.random() < 0.5:
                nodes[_body(draw, points)].append(f"{name}.{port}")

    return add


_MECHANICAL = (
    _two(Spring, "end", "base", True, stiffness=1e4, preload=10.0),
    _two(GuideFriction, "body", "guide", True, coulomb=0.5),
    _two(EndStop, "upper", "lower", False, gap=1e-4, law={"kind": "linear", "stiffness": 1e8}),
    _one(ConstantForce, "end", force=1.0),
    _one(Gravity, "body"),
)
_WET = (
    _fluid_part(Orifice, ("a", "b"), {}, diameter=1e-3),
    _fluid_part(Line, ("a", "b"), {}, length=0.1, diameter=2e-3, pressure=5e5),
    _fluid_part(PressureFace, ("fluid",), {"body": True}, direction="opening", area=1e-5),
    _fluid_part(
        Annulus,
        ("a", "b"),
        {"needle": True, "body": False},
        diameter=4e-3,
        length=5e-3,
        clearance=5e-6,
    ),
    _fluid_part(
        Seat,
        ("a", "b"),
        {"needle": True, "body": False},
        shape="flat",
        diameter=2e-3,
    ),
    _plunger,
    _fluid_part(Actuator, ("upper", "lower"), {"rod": True}, relief=3e6),
)
