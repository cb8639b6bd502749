"""Cells of a schematic: a component with its symbol, its texts and its ports, not placed yet.

Ports are at the left and right edge, :data:`ROW` apart, so that a name fits above its line.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from klack.network.catalogue import type_words
from klack.network.component import Component
from klack.network.port import Role
from klack.schematic.drawn_symbols import (
    FRAME,
    FRAMELESS,
    LENGTH,
    MARKS,
    framed_strokes,
    two_ended_strokes,
)
from klack.schematic.shapes import Box, Domain, Label, Lead, Point, Stroke, Symbol, cut, text_width
from klack.schematic.values import value_lines

__all__ = ["STEP", "Cell", "Pin", "PlannedPort", "Side", "cell_of", "passage"]

Side = Literal["left", "right"]
ROW, STEP = 24.0, 6.0
_NAME, _KIND, _VALUE, _PORT = 12.0, 9.5, 10.5, 9.5
_HALF = 12.0  # of a symbol with two ends, across
_MARK, _GAP, _WAVE = 14.0, 6.0, 26.0


@dataclass(frozen=True, slots=True)
class PlannedPort:
    """A port and where it leads to.

    ``node`` is None for one that is drawn as a ``mark``: ``ground``, ``ambient`` or ``open``.
    ``is_missing``: it is open and must not be, in a network that is still drawn.
    """

    name: str
    domain: Domain
    sides: tuple[Side, ...]
    node: int | None
    mark: str = ""
    is_missing: bool = False


@dataclass(frozen=True, slots=True)
class Pin:
    """Begin of a wire at a cell's edge; ``y`` from the top."""

    port: str
    node: int
    side: Side
    y: float


@dataclass(frozen=True, slots=True)
class Cell:
    """Drawing of one component, from its own left upper corner.

    ``name`` is empty for the passage of a wire through a column.
    """

    name: str
    width: float
    height: float
    pins: tuple[Pin, ...]
    symbols: tuple[Symbol, ...] = ()
    labels: tuple[Label, ...] = ()
    leads: tuple[Lead, ...] = ()


def passage(node: int) -> Cell:
    """Where a wire runs through a column."""
    pins = (Pin("", node, "left", _HALF), Pin("", node, "right", _HALF))
    return Cell("", 0.0, ROW, pins)


def cell_of(name: str, part: Component, ports: Sequence[PlannedPort]) -> Cell:
    """Draw one component; ports in order from top to bottom on each side."""
    if any(kind.role is Role.MOTION for kind in part.port_kinds().values()):
        return _body(name, part, ports)
    strokes = two_ended_strokes(part)
    if strokes is not None and len(ports) == 2:
        return _two_ended(name, part, ports, strokes)
    return _framed(name, part, ports)


# --------------------------------------------------------------------------- parts of a cell


def _on(ports: Iterable[PlannedPort], side: Side) -> list[PlannedPort]:
    return [port for port in ports if side in port.sides]


_OPEN: Mapping[str, str] = {
    "mechanical": "open: ground",
    "hydraulic": "open: surroundings",
    "pneumatic": "open: surroundings",
    "thermal": "open: surroundings",
}
"""What a port in no connection counts as."""


def _port_text(port: PlannedPort) -> str:
    name = cut(port.name, 24)
    if port.is_missing:
        return f"{name} (to be connected)"
    return f"{name} ({_OPEN.get(port.domain, 'open')})" if port.mark == "open" else name


def _lead_width(ports: Sequence[PlannedPort]) -> float:
    """Length of the lines of one side for their names."""
    if not ports:
        return 0.0
    marks = _MARK if any(port.mark for port in ports) else 0.0
    return 2 * _GAP + marks + max(text_width(_port_text(port), _PORT) for port in ports)


def _lead(
    component: str, port: PlannedPort, side: Side, edge: float, inner: float, y: float
) -> "_Drawn":
    way = 1.0 if side == "left" else -1.0
    start = edge + way * _MARK if port.mark else edge
    text, joint = _port_text(port), f"{component}.{port.name}"
    label = Label(
        text, start + way * 4.0, y - 3.0, _PORT, "start" if side == "left" else "end", soft=True
    )
    marks: tuple[Symbol, ...] = ()
    if port.mark:
        box = Box(start - 12.0 if side == "left" else start, y - 9.0, 12.0, 18.0)
        turn = 0 if side == "left" else 180
        if port.mark == "ambient":  # a tank stays upright
            turn, start_x = 0, start if side == "left" else start + 10.0
        else:
            start_x = start
        marks = (Symbol(MARKS[port.mark], start_x, y, box, turn),)
    pins = () if port.node is None else (Pin(port.name, port.node, side, y),)
    return _Drawn(
        pins, marks, (label,), (Lead(port.domain, ((start, y), (inner, y)), joint, port.node),)
    )


@dataclass(frozen=True, slots=True)
class _Drawn:
    pins: tuple[Pin, ...] = ()
    symbols: tuple[Symbol, ...] = ()
    labels: tuple[Label, ...] = ()
    leads: tuple[Lead, ...] = ()

    def __add__(self, other: "_Drawn") -> "_Drawn":
        return _Drawn(
            self.pins + other.pins,
            self.symbols + other.symbols,
            self.labels + other.labels,
            self.leads + other.leads,
        )


def _texts(name: str, part: Component) -> tuple[tuple[str, float, bool, bool], ...]:
    """Lines of text: words, size, bold, soft."""
    kind = part.type if part.type in type_words() else f"own: {part.type}"
    return (
        (cut(name), _NAME, True, False),
        (cut(kind), _KIND, False, True),
        *((cut(line), _VALUE, False, False) for line in value_lines(part, name)),
    )


_Texts = tuple[tuple[str, float, bool, bool], ...]


def _text_size(texts: _Texts) -> tuple[float, float]:
    width = max(text_width(text, size, bold=bold) for text, size, bold, _ in texts)
    return width, sum(size + 3.0 for _, size, _, _ in texts)


def _block(
    texts: _Texts, x: float, top: float, anchor: Literal["start", "middle", "end"]
) -> tuple[Label, ...]:
    labels, y = [], top
    for text, size, bold, soft in texts:
        y += size
        labels.append(Label(text, x, y, size, anchor, bold, soft))
        y += 3.0
    return tuple(labels)


def _up(height: float) -> float:
    """Round up to the grid."""
    return STEP * -(-height // STEP)


# --------------------------------------------------------------------------- kinds of cells


def _body(name: str, part: Component, ports: Sequence[PlannedPort]) -> Cell:
    """Box of a body with points in rows; a point may be joined on both sides."""
    texts = _texts(name, part)
    wide, high = _text_size(texts)
    names = [f"{cut(port.name, 24)} (open)" if port.mark else cut(port.name, 24) for port in ports]
    inside = max(wide + _WAVE, *(text_width(text, _PORT) for text in names)) + 4 * _GAP
    margin = _MARK  # of marks beside the box
    head = _up(high + 2 * _GAP)
    height = head + ROW * len(ports)
    body = Box(margin, 0.0, inside, height)
    strokes = [Stroke(f"M0,0 H{inside:g} V{height:g} H0 Z", "metal")]
    strokes.append(Stroke(f"M0,{head:g} H{inside:g}", "thin"))
    if part.type == "flexible-body":  # it bends: a wave beside its name
        strokes.append(Stroke(f"M{inside - _WAVE:g},12 q3,-6 6,0 t6,0 t6,0", "thin"))
    middle = margin + 0.5 * inside
    drawn = _Drawn(
        symbols=(Symbol(tuple(strokes), margin, 0.0, body, component=name),),
        labels=_block(texts, margin + _GAP, _GAP, "start"),
    )
    for i, port in enumerate(ports):
        y = head + 12.0 + ROW * i
        drawn += _Drawn(labels=(Label(names[i], middle, y + 3.0, _PORT, "middle"),))
        for side, outer, inner in (
            ("left", 0.0, margin),
            ("right", 2 * margin + inside, margin + inside),
        ):
            if side not in port.sides:
                continue
            if port.mark:
                found = _lead(name, port, side, outer, inner, y)
                drawn += _Drawn(symbols=found.symbols)
            else:
                assert port.node is not None
                pin = Pin(port.name, port.node, side, y)
                lead = Lead(port.domain, ((outer, y), (inner, y)), f"{name}.{port.name}", port.node)
                drawn += _Drawn(pins=(pin,), leads=(lead,))
    return _cell(name, 2 * margin + inside, height, drawn)


def _two_ended(
    name: str, part: Component, ports: Sequence[PlannedPort], strokes: tuple[Stroke, ...]
) -> Cell:
    first, second = ports
    kinds = list(part.port_kinds())
    turned = kinds.index(first.name) > kinds.index(second.name)
    left, right = _on(ports, "left"), _on(ports, "right")
    texts = _texts(name, part)
    wide, high = _text_size(texts)
    if left and right:
        return _level(name, texts, left[0], right[0], strokes, kinds.index(left[0].name) > 0)
    side: Side = "left" if left else "right"
    lead = _lead_width(ports)
    width = lead + 2 * _HALF + _GAP + wide + _GAP
    height = _up(max(3 * ROW, high + _GAP))
    top, bottom = ROW, ROW + LENGTH + 12.0
    x = lead + _HALF if side == "left" else width - lead - _HALF
    edge = 0.0 if side == "left" else width
    begin = Box(x - _HALF, top + 6.0, 2 * _HALF, LENGTH)
    origin = (x, bottom - 6.0) if turned else (x, top + 6.0)
    drawn = _Drawn(
        symbols=(Symbol(strokes, *origin, begin, -90 if turned else 90, name),),
        labels=_block(
            texts,
            x + _HALF + _GAP if side == "left" else x - _HALF - _GAP,
            6.0,
            "start" if side == "left" else "end",
        ),
    )
    for port, y, end in ((first, top, top + 6.0), (second, bottom, bottom - 6.0)):
        found = _lead(name, port, side, edge, x, y)
        bent = tuple(_to(lead, (x, end)) for lead in found.leads)
        drawn += replace(found, leads=bent)
    return _cell(name, width, max(height, bottom + _HALF), drawn)


def _to(lead: Lead, end: Point) -> Lead:
    return replace(lead, points=(*lead.points, end))


def _level(
    name: str,
    texts: _Texts,
    left: PlannedPort,
    right: PlannedPort,
    strokes: tuple[Stroke, ...],
    turned: bool,
) -> Cell:
    """Symbol between its ports, texts below."""
    before, after = _lead_width([left]), _lead_width([right])
    wide, high = _text_size(texts)
    width = max(before + LENGTH + after, wide + 2 * _GAP)
    spare = 0.5 * (width - before - LENGTH - after)
    x, y = before + spare, ROW
    box = Box(x, y - _HALF, LENGTH, 2 * _HALF)
    drawn = (
        _Drawn(
            symbols=(
                Symbol(strokes, x + LENGTH if turned else x, y, box, 180 if turned else 0, name),
            ),
            labels=_block(texts, 0.5 * width, y + _HALF + 4.0, "middle"),
        )
        + _lead(name, left, "left", 0.0, x, y)
        + _lead(name, right, "right", width, x + LENGTH, y)
    )
    return _cell(name, width, _up(y + _HALF + 4.0 + high), drawn)


def _framed(name: str, part: Component, ports: Sequence[PlannedPort]) -> Cell:
    left, right = _on(ports, "left"), _on(ports, "right")
    texts = _texts(name, part)
    wide, high = _text_size(texts)
    before, after = _lead_width(left), _lead_width([p for p in right if p not in left])
    after = after or (2 * _GAP if right else 0.0)
    across, tall = FRAMELESS.get(part.type, FRAME)
    rows = max(len(left), len(right), 1)
    tall = max(tall, ROW * rows)
    # where only a line on the left comes in, there is room to the right
    beside = not right and all(port.domain == "mechanical" for port in left)
    if beside:
        width = before + across + _GAP + wide + _GAP
        x = before
    else:
        width = max(before + across + after, wide + 2 * _GAP)
        x = before + 0.5 * (width - before - across - after)
    top = 12.0
    middle = top + 0.5 * tall
    strokes = framed_strokes(part)
    frame = f"M{-0.5 * across:g},{-0.5 * tall:g} h{across:g} v{tall:g} h{-across:g} Z"
    if strokes is None:
        strokes = (Stroke(frame, "unknown"),)
    elif part.type not in FRAMELESS:
        strokes = (Stroke(frame, "paper"), *strokes)
    backward = part.type == "pressure-source" and not right
    symbol = Symbol(
        strokes, x + 0.5 * across, middle, Box(x, top, across, tall), 180 * backward, name
    )
    if not beside:
        labels = _block(texts, x + 0.5 * across, top + tall + 4.0, "middle")
        high += top + tall + 4.0
        labels, width, shift = _within(labels, width)
    else:
        labels = _block(texts, x + across + _GAP, 6.0, "start")
        high, shift = high + 6.0, 0.0
    drawn = _Drawn(symbols=(symbol.moved(shift, 0.0),), labels=labels)
    for side, found, edge, inner in (
        ("left", left, 0.0, x + shift),
        ("right", right, width, x + shift + across),
    ):
        first = middle - 0.5 * ROW * (len(found) - 1)
        for i, port in enumerate(found):
            lead = _lead(name, port, side, edge, inner, first + ROW * i)  # type: ignore[arg-type]
            again = side == "right" and "left" in port.sides
            drawn += replace(lead, labels=()) if again else lead
    return _cell(name, width, _up(max(high, top + tall + _GAP)), drawn)


def _within(labels: tuple[Label, ...], width: float) -> tuple[tuple[Label, ...], float, float]:
    """Move labels right and widen the cell until all fit."""
    left = min(label.box.x for label in labels)
    shift = max(0.0, _GAP - left)
    moved = tuple(label.moved(shift, 0.0) for label in labels)
    right = max(label.box.x + label.box.width for label in moved)
    return moved, max(width + shift, right + _GAP), shift


def _cell(name: str, width: float, height: float, drawn: _Drawn) -> Cell:
    return Cell(name, width, height, drawn.pins, drawn.symbols, drawn.labels, drawn.leads)
