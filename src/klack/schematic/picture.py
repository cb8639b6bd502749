"""The schematic of a network as a picture for a file or a report."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from xml.sax.saxutils import escape

from klack.network.network import Network
from klack.network.ranges import value_text
from klack.report.chart import COLOURS
from klack.schematic.cells import Cell
from klack.schematic.columns import plan_of
from klack.schematic.drawn_symbols import MARKS
from klack.schematic.placing import Column, columns_of_cells
from klack.schematic.routing import channel_width, routed, runs_between, tracks_of
from klack.schematic.shapes import (
    Box,
    Domain,
    Label,
    Lead,
    Point,
    Stroke,
    Symbol,
    Wire,
    bounds,
    cut,
    text_width,
)

__all__ = ["Schematic", "schematic_of", "schematic_svg", "with_legend"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Schematic:
    """A drawn network, in px; its order is that of :mod:`klack.schematic.columns`.

    Parameters
    ----------
    symbols
        One for each component, by its ``component``; marks and junctions have none.
    leads
        From the edges of the cells to the symbols.
    wires
        One for each node with two ports or more.
    """

    symbols: tuple[Symbol, ...]
    labels: tuple[Label, ...]
    leads: tuple[Lead, ...]
    wires: tuple[Wire, ...]
    box: Box


def schematic_of(network: Network) -> Schematic:
    """Lay out a network, always alike."""
    plan = plan_of(network)
    columns = columns_of_cells(network, plan)
    runs = [runs_between(a.pins("right"), b.pins("left")) for a, b in pairwise(columns)]
    symbols: list[Symbol] = []
    labels: list[Label] = []
    leads: list[Lead] = []
    lines: dict[int, list[tuple[Point, Point]]] = {index: [] for index in plan.nodes}
    branches: dict[int, list[Point]] = {index: [] for index in plan.nodes}
    x = 0.0
    for i, column in enumerate(columns):
        for cell, top in zip(column.cells, column.tops, strict=True):
            shift = _shift(cell, column, i, columns)
            symbols += [item.moved(x + shift, top) for item in cell.symbols]
            labels += [item.moved(x + shift, top) for item in cell.labels]
            leads += [item.moved(x + shift, top) for item in cell.leads]
            for node, line in _to_edges(cell, shift, column.width):
                lines[node].append(tuple((a + x, b + top) for a, b in line))  # type: ignore[arg-type]
        x += column.width
        if i < len(runs):
            width = channel_width(1 + max(tracks_of(runs[i]).values(), default=0))
            for node, (found, meet) in routed(runs[i], x, width).items():
                lines[node] += found
                branches[node] += meet
            x += width
    wires = tuple(
        Wire(
            index,
            node.domain,  # type: ignore[arg-type]
            tuple(lines[index]),
            tuple(branches[index]),
            tuple(str(joint) for joint in node.joints),
        )
        for index, node in plan.nodes.items()
    )
    return _at_origin(symbols, labels, leads, wires)


def _shift(cell: Cell, column: Column, i: int, columns: list[Column]) -> float:
    """Place of a cell: towards the bodies, or in the middle between."""
    spare = column.width - cell.width
    sides = {pin.side for pin in cell.pins}
    if sides == {"left"}:
        return 0.0
    return spare if sides == {"right"} else 0.5 * spare


def _to_edges(cell: Cell, shift: float, width: float) -> list[tuple[int, tuple[Point, Point]]]:
    """Lines from ports to the column's edges; through it for a passage."""
    if not cell.name and not cell.symbols:
        pin = cell.pins[0]
        return [(pin.node, ((0.0, pin.y), (width, pin.y)))]
    found: list[tuple[int, tuple[Point, Point]]] = []
    for pin in cell.pins:
        begin = 0.0 if pin.side == "left" else shift + cell.width
        end = shift if pin.side == "left" else width
        if end > begin:
            found.append((pin.node, ((begin, pin.y), (end, pin.y))))
    return found


def _at_origin(
    symbols: list[Symbol], labels: list[Label], leads: list[Lead], wires: tuple[Wire, ...]
) -> Schematic:
    points = [p for wire in wires for line in wire.lines for p in line]
    points += [p for lead in leads for p in lead.points]
    boxes = [*(symbol.box for symbol in symbols), *(label.box for label in labels)]
    whole = bounds([*boxes, *(Box(a, b, 0.0, 0.0) for a, b in points)])
    dx, dy = -whole.x, -whole.y
    return Schematic(
        symbols=tuple(item.moved(dx, dy) for item in symbols),
        labels=tuple(item.moved(dx, dy) for item in labels),
        leads=tuple(item.moved(dx, dy) for item in leads),
        wires=tuple(item.moved(dx, dy) for item in wires),
        box=whole.moved(dx, dy),
    )


_SIZE, _TITLE, _ROW, _LINE, _MARGIN = 10.0, 14.0, 20.0, 30.0, 16.0
_NARROWEST = 620.0
_LINES: tuple[tuple[Domain, str], ...] = (
    ("hydraulic", "fluid"),
    ("pneumatic", "gas"),
    ("mechanical", "motion and force"),
    ("electric", "voltage and current"),
    ("thermal", "temperature and heat"),
)
_MARKED = (
    ("ground", "ground"),
    ("ambient", "surroundings"),
    ("open", "port in no connection"),
    ("unknown", "type without a symbol"),
)
_NOTE = "(0): at the start"


def with_legend(drawn: Schematic, network: Network, title: str = "") -> Schematic:
    """Add a title, a legend of what occurs, and a margin.

    The legend names the fluid, its temperature and the ambient pressure.
    """
    symbols: list[Symbol] = []
    labels: list[Label] = []
    leads: list[Lead] = []
    title = cut(title, 90)
    head = _TITLE + 16.0 if title else 0.0
    width = max(drawn.box.width, _NARROWEST, text_width(title, _TITLE, bold=True))
    dx, dy = _MARGIN + 0.5 * (width - drawn.box.width), _MARGIN + head
    if title:
        labels.append(Label(title, _MARGIN, _MARGIN + _TITLE, _TITLE, bold=True))
    x, y = _MARGIN, dy + drawn.box.height + 2 * _ROW
    domains = {lead.domain for lead in drawn.leads}
    marks = {symbol.strokes for symbol in drawn.symbols}
    if any(symbol.component and symbol.strokes[0].ink == "unknown" for symbol in drawn.symbols):
        marks.add(MARKS["unknown"])
    outside = {"ambient": f": {value_text(network.ambient.pressure, 'Pa')}"}
    entries: list[tuple[Domain | None, str, str]] = [
        (domain, "", text + _of_fluid(network, domain))
        for domain, text in _LINES
        if domain in domains
    ]
    entries += [
        (None, mark, text + outside.get(mark, "")) for mark, text in _MARKED if MARKS[mark] in marks
    ]
    entries += [(None, "", _NOTE)]
    for domain, mark, text in entries:
        ahead = _LINE + 6.0 if domain else 20.0 if mark else 0.0
        size = ahead + text_width(text, _SIZE) + 24.0
        if x + size > _MARGIN + width:
            x, y = _MARGIN, y + _ROW
        if domain:
            leads.append(Lead(domain, ((x, y - 3.5), (x + _LINE, y - 3.5)), ""))
        elif mark:
            symbols.append(Symbol(MARKS[mark], x + 12.0, y - 3.5, Box(x, y - 12.5, 14.0, 18.0)))
        labels.append(Label(text, x + ahead, y, _SIZE, soft=True))
        x += size
    return replace(
        drawn,
        symbols=(*(item.moved(dx, dy) for item in drawn.symbols), *symbols),
        labels=(*(item.moved(dx, dy) for item in drawn.labels), *labels),
        leads=(*(item.moved(dx, dy) for item in drawn.leads), *leads),
        wires=tuple(item.moved(dx, dy) for item in drawn.wires),
        box=Box(0.0, 0.0, width + 2 * _MARGIN, y + _MARGIN),
    )


def _of_fluid(network: Network, domain: Domain) -> str:
    fluid = {"hydraulic": network.fluid, "pneumatic": network.gas}.get(domain)
    if fluid is None:
        return ""
    return cut(f": {fluid.name}, {network.ambient.temperature - 273.15:.4g} °C", 60)


_INK, _SOFT, _PAPER = COLOURS["black"], "#5b626b", "#ffffff"
_FONT = "'DejaVu Sans',Verdana,Arial,sans-serif"
_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_WIRES: dict[Domain, str] = {
    "mechanical": f'stroke="{_INK}" stroke-width="3"',
    "hydraulic": f'stroke="{COLOURS["blue"]}" stroke-width="1.8"',
    "pneumatic": f'stroke="{COLOURS["green"]}" stroke-width="2" stroke-dasharray="1 4"',
    "electric": f'stroke="{COLOURS["red"]}" stroke-width="1.6" stroke-dasharray="5 3"',
    "thermal": f'stroke="{COLOURS["orange"]}" stroke-width="1.8" stroke-dasharray="8 3 1 3"',
}
_DOTS: dict[Domain, str] = {
    "mechanical": _INK,
    "hydraulic": COLOURS["blue"],
    "pneumatic": COLOURS["green"],
    "electric": COLOURS["red"],
    "thermal": COLOURS["orange"],
}
_INKS = {
    "line": f'fill="none" stroke="{_INK}" stroke-width="1.4"',
    "thin": f'fill="none" stroke="{_INK}" stroke-width="0.8"',
    "heavy": f'fill="none" stroke="{_INK}" stroke-width="2.6"',
    "solid": f'fill="{_INK}" stroke="none"',
    "fluid": f'fill="#cfe6f5" stroke="{_INK}" stroke-width="1.2"',
    "metal": f'fill="#e6e8eb" stroke="{_INK}" stroke-width="1.2"',
    "paper": f'fill="{_PAPER}" stroke="{_INK}" stroke-width="1.2"',
    "unknown": f'fill="{_PAPER}" stroke="{COLOURS["red"]}" stroke-width="1.4"'
    ' stroke-dasharray="3 2"',
}


def svg_of(drawn: Schematic, name: str = "", *, has_targets: bool = False) -> str:
    """Picture as text; ``name`` is for screen readers.

    ``has_targets`` puts clear shapes over components and ports, for pages in which they are
    clicked: ``data-name`` and ``data-port`` say what is hit.
    """
    box = drawn.box
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{box.width:g}" height="{box.height:g}" '
        f'viewBox="{box.x:g} {box.y:g} {box.width:g} {box.height:g}" font-family="{_FONT}" '
        'stroke-linecap="round" stroke-linejoin="round" role="img">',
        f"<title>{_safe(name)}</title>" if name else "",
        f'<rect x="{box.x:g}" y="{box.y:g}" width="{box.width:g}" height="{box.height:g}" '
        f'fill="{_PAPER}"/>',
        *_ordered_lines(drawn),
        *(_symbol(symbol) for symbol in drawn.symbols),
        *(_label(label) for label in drawn.labels),
        *(_targets(drawn) if has_targets else ()),
        "</svg>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _ordered_lines(drawn: Schematic) -> Iterable[str]:
    """Wires with leads, thick ones first, which hide no others."""
    for domain in ("mechanical", "hydraulic", "pneumatic", "electric", "thermal"):
        for wire in drawn.wires:
            if wire.domain == domain:
                leads = [lead.points for lead in drawn.leads if lead.node == wire.node]
                yield _wire(wire, leads)
        for lead in drawn.leads:
            if lead.domain == domain and lead.node is None:
                yield _drawn(_line(lead.points), lead.domain)


def _wire(wire: Wire, leads: Iterable[tuple[Point, ...]]) -> str:
    path = " ".join(_line(points) for points in (*wire.lines, *leads))
    dots = "".join(
        f'<circle cx="{x:g}" cy="{y:g}" r="3.5" fill="{_DOTS[wire.domain]}"/>'
        for x, y in wire.branches
    )
    title = _safe(", ".join(wire.joints))
    return f'<g class="node"><title>{title}</title>{_drawn(path, wire.domain)}{dots}</g>'


def _drawn(path: str, domain: Domain) -> str:
    return f'<path d="{path}" fill="none" {_WIRES[domain]}/>'


def _line(points: Iterable[Point]) -> str:
    return "M" + " L".join(f"{x:g},{y:g}" for x, y in points)


def _symbol(symbol: Symbol) -> str:
    place = f"translate({symbol.x:g} {symbol.y:g})"
    place += f" rotate({symbol.turn})" if symbol.turn else ""
    named = f' class="component" data-name="{_safe(symbol.component)}"' if symbol.component else ""
    return f'<g transform="{place}"{named}>{"".join(map(_stroke, symbol.strokes))}</g>'


def _targets(drawn: Schematic) -> Iterable[str]:
    """Clear shapes over symbols and, above those, over the outer ends of ports."""
    for symbol in drawn.symbols:
        if name := _safe(symbol.component):
            box = symbol.box
            yield (
                f'<rect class="target" data-name="{name}" x="{box.x - 4:g}" y="{box.y - 4:g}" '
                f'width="{box.width + 8:g}" height="{box.height + 8:g}" rx="5" fill="none" '
                f'pointer-events="all"><title>{name}</title></rect>'
            )
    for lead in drawn.leads:
        if port := _safe(lead.port):
            x, y = lead.points[0]
            yield (
                f'<circle class="target" data-port="{port}" cx="{x:g}" cy="{y:g}" r="9" '
                f'fill="none" pointer-events="all"><title>{port}</title></circle>'
            )


def _stroke(stroke: Stroke) -> str:
    return f'<path d="{stroke.path}" {_INKS[stroke.ink]}/>'


def _label(label: Label) -> str:
    anchor = "" if label.anchor == "start" else f' text-anchor="{label.anchor}"'
    weight = ' font-weight="bold"' if label.bold else ""
    colour = _SOFT if label.soft else _INK
    return (
        f'<text x="{label.x:g}" y="{label.y:g}" font-size="{label.size:g}" fill="{colour}"'
        f"{anchor}{weight}>{_safe(label.text)}</text>"
    )


def _safe(text: str) -> str:
    return escape(_FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", text), {'"': "&quot;"})


def schematic_svg(network: Network, title: str = "") -> str:
    """Draw a network with its legend; the same text every time.

    >>> from klack.mechanics.rigid_mass import RigidMass
    >>> from klack.mechanics.spring import Spring
    >>> parts = {"mass": RigidMass(mass=1.0), "spring": Spring(stiffness=1e3, preload=0.0)}
    >>> picture = schematic_svg(Network(parts, [["mass.body", "spring.end"]]))
    >>> picture.startswith("<svg"), "stiffness 1 N/mm" in picture
    (True, True)
    """
    return svg_of(
        with_legend(schematic_of(network), network, title), title or "Schematic of the network"
    )
