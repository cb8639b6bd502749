"""Title above a schematic, and what its lines and marks mean below it."""

from dataclasses import replace

from klack.network.network import Network
from klack.network.ranges import value_text
from klack.schematic.drawn_symbols import MARKS
from klack.schematic.lettering import cut, text_width
from klack.schematic.schematic import Schematic
from klack.schematic.shapes import Box, Domain, Label, Lead, Symbol

__all__ = ["with_legend"]

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

    The legend names the fluid, its temperature and the pressure of the surroundings.
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
