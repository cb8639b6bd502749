"""The schematic of a valve network: what is drawn where.

Read from left to right: sources, lines and chambers of the fluid, what joins fluid and bodies, the
bodies, springs, stops and magnets, drivers.  See :mod:`klack.schematic.columns`.
"""

from dataclasses import dataclass
from itertools import pairwise

from klack.network.network import Network
from klack.schematic.cells import Cell
from klack.schematic.columns import plan_of
from klack.schematic.placing import Column, columns_of_cells
from klack.schematic.routing import channel_width, routed, runs_between, tracks_of
from klack.schematic.shapes import Box, Label, Lead, Point, Symbol, Wire, bounds

__all__ = ["Schematic", "schematic_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Schematic:
    """A drawn network, in px.

    Parameters
    ----------
    symbols : tuple of Symbol
        One for each component, by its ``component``; marks and junctions have none.
    labels : tuple of Label
    leads : tuple of Lead
        From the edges of the cells to the symbols.
    wires : tuple of Wire
        One for each node with two ports or more.
    box : Box
        Round all of it.
    """

    symbols: tuple[Symbol, ...]
    labels: tuple[Label, ...]
    leads: tuple[Lead, ...]
    wires: tuple[Wire, ...]
    box: Box


def schematic_of(network: Network) -> Schematic:
    """Lay out a network; the same network gives the same picture."""
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
    """Place of a cell in its column: to the side of the bodies, and in between on its middle."""
    spare = column.width - cell.width
    sides = {pin.side for pin in cell.pins}
    if sides == {"left"}:
        return 0.0
    return spare if sides == {"right"} else 0.5 * spare


def _to_edges(cell: Cell, shift: float, width: float) -> list[tuple[int, tuple[Point, Point]]]:
    """Lines from the ports of a cell to the edges of its column; through it for a passage."""
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
