"""A schematic as an SVG picture, without scripts and with every text escaped.

The domains are told apart by line style as well as by colour, so that a black and white copy stays
readable: fluid thin, gas dotted, mechanical thick, electric dashed.
"""

import re
from collections.abc import Iterable
from xml.sax.saxutils import escape

from klack.report.chart import COLOURS
from klack.schematic.schematic import Schematic
from klack.schematic.shapes import Domain, Label, Point, Stroke, Symbol, Wire

__all__ = ["svg_of"]

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


def svg_of(drawn: Schematic, name: str = "") -> str:
    """Picture as text; ``name`` is what a reader for the blind says."""
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
        "</svg>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _ordered_lines(drawn: Schematic) -> Iterable[str]:
    """Wires with their leads; the thick ones first, so that they hide no other."""
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
    """Text for XML: escaped, without the letters that it cannot have."""
    return escape(_FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", text), {'"': "&quot;"})
