"""Places of the cells: their order in each column, and their heights.

Each column is sorted by where the other ends of its wires are (the barycentre heuristic of
Sugiyama, K.; Tagawa, S.; Toda, M. (1981), IEEE Trans. SMC 11, 109-125), back and forth over all
columns.  Bodies keep an order of their own: what an end stop calls the upper part is above.  At
last cells move down until no wires of different nodes lie on one line between two columns.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median_low

from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import Role
from klack.schematic.cells import STEP, Cell, PlannedPort, Side, cell_of, passage
from klack.schematic.columns import Plan
from klack.schematic.routing import crossings, runs_between

__all__ = ["Column", "columns_of_cells"]

_SWEEPS, _PORT_ORDERS, _APART, _CROSSING = 8, 4, 18.0, 60.0


@dataclass(slots=True)
class Column:
    """Cells of a column from top to bottom, and the heights of their upper edges."""

    cells: list[Cell]
    tops: list[float]
    fixed: bool = False

    @property
    def width(self) -> float:
        """Of its widest cell."""
        return max((cell.width for cell in self.cells), default=0.0)

    def copy(self) -> "Column":
        """One that can be sorted on its own."""
        return Column(list(self.cells), list(self.tops), self.fixed)

    def pins(self, side: Side) -> list[tuple[int, float]]:
        """Nodes and heights of wires on one side."""
        return [
            (pin.node, top + pin.y)
            for cell, top in zip(self.cells, self.tops, strict=True)
            for pin in cell.pins
            if pin.side == side
        ]


def columns_of_cells(network: Network, plan: Plan) -> list[Column]:
    """Draw and place all components."""
    numbers = sorted({*plan.columns.values(), *plan.homes.values()})
    ports = {name: _by_role(network, name, plan.ports[name]) for name in plan.ports}
    found: list[list[Column]] = []
    middle = numbers.index(0) if 0 in numbers else len(numbers) - 1
    for _ in range(_PORT_ORDERS):
        columns = [_column(network, plan, ports, number) for number in numbers]
        found.append(_sort(columns, middle))
        ports = _ports_by_height(network, ports, found[-1])
    return min(found[1:], key=_cost)  # the first one has the ports as the case lists them


# --------------------------------------------------------------------------- cells of a column


def _column(
    network: Network,
    plan: Plan,
    ports: Mapping[str, Sequence[PlannedPort]],
    number: int,
) -> Column:
    names = [name for name, column in plan.columns.items() if column == number]
    bodies = number == 0
    cells = [
        cell_of(name, network.components[name], ports[name])
        for name in (_from_above(network, names) if bodies else names)
    ]
    ruled = {pin.node for cell in cells for pin in cell.pins if plan.homes[pin.node] == number}
    for index, node in plan.nodes.items():
        reach = {plan.columns[joint.component] for joint in node.joints} | {plan.homes[index]}
        if index not in ruled and min(reach) < number < max(reach):
            cells.append(passage(index))
    tops, y = [], 0.0
    for cell in cells:
        tops.append(y)
        y += cell.height + _APART
    return Column(cells, tops, bodies)


def _by_role(network: Network, name: str, ports: Sequence[PlannedPort]) -> tuple[PlannedPort, ...]:
    """Ports from top to bottom: grounded ones and upper parts first."""
    part = network.components[name]
    if _is_magnet(part):
        down = getattr(part, "closes", "upward") == "downward"
        return tuple(sorted(ports, key=lambda port: (port.name == "base") == down))
    if _is_stop(part):
        return tuple(ports)
    if any(port.domain == "mechanical" and port.node is not None for port in ports):
        return tuple(sorted(ports, key=lambda port: port.node is not None or not port.mark))
    return tuple(ports)


def _is_stop(part: Component) -> bool:
    """Whether it keeps two parts apart."""
    kinds = part.port_kinds()
    return all(name in kinds and kinds[name].domain == "mechanical" for name in ("upper", "lower"))


def _is_magnet(part: Component) -> bool:
    return {"armature", "base"} <= part.port_kinds().keys()


def _ports_by_height(
    network: Network,
    ports: Mapping[str, Sequence[PlannedPort]],
    columns: Sequence[Column],
) -> dict[str, tuple[PlannedPort, ...]]:
    """Ports by the heights that they lead to."""
    heights: dict[tuple[str, int], list[float]] = {}
    for column in columns:
        for cell, top in zip(column.cells, column.tops, strict=True):
            for pin in cell.pins:
                heights.setdefault((cell.name, pin.node), []).append(top + pin.y)
    ranks = _stop_ranks(network)
    found = {}
    for name, planned in ports.items():
        part = network.components[name]
        if _is_stop(part) or _is_magnet(part):
            found[name] = tuple(planned)
            continue

        def key(port: PlannedPort, name: str = name) -> tuple[int, float]:
            rank = ranks.get((name, port.name), 0)
            others = [
                y
                for (other, node), ys in heights.items()
                if node == port.node and other != name
                for y in ys
            ]
            marked = -1e9 if port.domain == "mechanical" else 1e9
            return rank, sum(others) / len(others) if others else marked

        found[name] = tuple(sorted(planned, key=key))
    return found


def _stop_ranks(network: Network) -> dict[tuple[str, str], int]:
    """-1 for points that hit something above, 1 for below."""
    ranks: dict[tuple[str, str], int] = {}
    for node in network.nodes:
        for joint in node.joints:
            if _is_stop(network.components[joint.component]):
                rank = -1 if joint.name == "lower" else 1
                for body in node.having(Role.MOTION):
                    ranks[body.component, body.name] = rank
    return ranks


def _from_above(network: Network, names: Sequence[str]) -> list[str]:
    """Bodies from top to bottom by their end stops, else as in the case."""
    upper: dict[str, str] = {}
    lower: dict[str, str] = {}
    for node in network.nodes:
        here = [joint.component for joint in node.joints if joint.component in names]
        for joint in node.joints:
            if here and _is_stop(network.components[joint.component]):
                (upper if joint.name == "upper" else lower)[joint.component] = here[0]
    above: dict[str, set[str]] = {name: set() for name in names}
    for stop, body in lower.items():
        if stop in upper and upper[stop] != body:
            above[body].add(upper[stop])
    found: list[str] = []
    rest = list(names)
    while rest:
        free = [name for name in rest if not above[name] & set(rest)]
        chosen = _next(found, free or rest, above)
        found.append(chosen)
        rest.remove(chosen)
    return found


def _next(found: Sequence[str], free: Sequence[str], above: Mapping[str, set[str]]) -> str:
    if found:
        for name in free:
            if found[-1] in above[name]:
                return name
    return free[0]


# --------------------------------------------------------------------------- order and heights


def _sort(columns: Sequence[Column], middle: int) -> list[Column]:
    """Sort and place columns back and forth; return the best."""
    columns = [column.copy() for column in columns]
    outward = [*range(middle - 1, -1, -1), *range(middle + 1, len(columns))]
    found: list[list[Column]] = []
    for sweep in range(_SWEEPS):
        before = [column.copy() for column in columns]
        for i in outward:
            inner = i + 1 if i < middle else i - 1
            _settle(columns, i, [inner] if sweep == 0 else _beside(columns, i))
        found += [_ended(columns, middle, outward, sort=sort) for sort in (False, True)]
        for i in (*reversed(outward), middle):
            _settle(columns, i, _beside(columns, i))
        if sweep > 0 and columns == before:  # all that follow would be the same
            break
    return min(found, key=_cost)


def _ended(
    columns: Sequence[Column], middle: int, outward: Sequence[int], *, sort: bool
) -> list[Column]:
    """Last placement from the middle outward, with wires apart."""
    ended = [column.copy() for column in columns]
    for i in outward:
        _settle(ended, i, [i + 1 if i < middle else i - 1], sort=sort)
        _clear(ended, i, middle)
    return ended


def _cost(columns: Sequence[Column]) -> float:
    """Length of upright wires [px], plus :data:`_CROSSING` for each crossing."""
    cost = 0.0
    for left, right in pairwise(columns):
        runs = runs_between(left.pins("right"), right.pins("left"))
        cost += sum(run.high - run.low for run in runs) + _CROSSING * crossings(runs)
    return cost


def _ends(
    columns: Sequence[Column], i: int, near: Iterable[int]
) -> dict[Side, dict[int, list[float]]]:
    """Heights of wires from neighbouring columns, by side and node."""
    found: dict[Side, dict[int, list[float]]] = {"left": {}, "right": {}}
    for k in near:
        here: Side = "left" if k < i else "right"
        there: Side = "right" if k < i else "left"
        for node, y in columns[k].pins(there):
            found[here].setdefault(node, []).append(y)
    return found


def _settle(columns: list[Column], i: int, near: list[int], *, sort: bool = True) -> None:
    """Place cells for short and straight wires."""
    column = columns[i]
    beside, ends = _beside(columns, i), _ends(columns, i, near)
    others = ends if near == beside else _ends(columns, i, beside)
    wishes = []
    for cell, top in zip(column.cells, column.tops, strict=True):
        found = _wishes(cell, ends) or _wishes(cell, others)
        wishes.append((sum(found) / len(found), median_low(found)) if found else (top, top))
    order = list(range(len(wishes)))
    if sort and not column.fixed:
        order.sort(key=lambda k: wishes[k][0] + 0.5 * column.cells[k].height)
    column.cells = [column.cells[k] for k in order]
    column.tops = _packed([wishes[k][1] for k in order], [cell.height for cell in column.cells])


def _wishes(cell: Cell, ends: Mapping[Side, Mapping[int, Sequence[float]]]) -> list[float]:
    """Heights that make one wire straight."""
    return [y - pin.y for pin in cell.pins for y in ends[pin.side].get(pin.node, ())]


def _beside(columns: Sequence[Column], i: int) -> list[int]:
    return [k for k in (i - 1, i + 1) if 0 <= k < len(columns)]


def _packed(wishes: Sequence[float], heights: Sequence[float]) -> list[float]:
    """Heights nearest to the wishes, in the given order without overlap.

    Cells that would overlap form blocks; a block lies at the median of its wishes, so that at least
    one of its wires is straight.
    """
    blocks: list[tuple[list[float], float]] = []  # wishes for its upper edge, height
    for wish, height in zip(wishes, heights, strict=True):
        blocks.append(([wish], height + _APART))
        while len(blocks) > 1 and _top(blocks[-2]) + blocks[-2][1] > _top(blocks[-1]):
            lower, length = blocks.pop()
            upper, before = blocks.pop()
            blocks.append(([*upper, *(wish - before for wish in lower)], before + length))
    tops: list[float] = []
    for block in blocks:
        y = STEP * round(_top(block) / STEP)
        if tops:
            y = max(y, tops[-1] + heights[len(tops) - 1] + _APART)
        for _ in block[0]:
            tops.append(y)
            y += heights[len(tops) - 1] + _APART
    return tops


def _top(block: tuple[list[float], float]) -> float:
    return median_low(block[0])


def _clear(columns: list[Column], i: int, middle: int) -> None:
    """Move cells down until no wires of different nodes meet head on."""
    column = columns[i]
    inner: Side = "right" if i < middle else "left"
    ends = _ends(columns, i, [i + 1 if i < middle else i - 1])[inner]
    taken = {y: node for node, ys in ends.items() for y in ys}
    least = -1e9
    for k, cell in enumerate(column.cells):
        y = max(column.tops[k], least)
        while any(
            taken.get(y + pin.y, pin.node) != pin.node for pin in cell.pins if pin.side == inner
        ):
            y += STEP
        column.tops[k] = y
        least = y + cell.height + _APART
