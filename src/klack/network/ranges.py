"""Ranges of a whole network: travel of its bodies between the stops, and the check before a run."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self

import numpy as np
import scipy

from klack.input.problem import CaseProblem
from klack.network.rows import AMBIENT, LimitRow, Rows
from klack.units import format_si

__all__ = ["StopBound", "Travel", "check_ranges", "limits_of", "range_text", "value_text"]


_LEAST_LENGTH = 1e-6  # [m] the solver's tolerances are meant for numbers around one


@dataclass(frozen=True, slots=True)
class StopBound:
    """A stop with a ``gap`` [m] between two bodies; None is what does not move."""

    name: str
    upper: str | None
    lower: str | None
    gap: float

    @property
    def stands(self) -> bool:
        """Whether one side does not move, which ends a chain of bodies that push each other."""
        return self.upper is None or self.lower is None


@dataclass(frozen=True, slots=True)
class Travel:
    r"""Greatest and smallest value of a sum of displacements that no stop forbids.

    Rigid bodies along one axis, each with one displacement :math:`y_b`.  Every stop keeps its gap
    open, :math:`g_0 + y_\text{upper} - y_\text{lower} \ge 0`: a linear programme.

    Limits: rigid contacts, no tilt; springs and films stop nothing.
    """

    bounds: Sequence[StopBound]

    @classmethod
    def of(cls, rows: Rows) -> Self:
        """Travel of a network whose contacts are known."""
        owner = _owners(rows)
        sides = [(row, owner.get(row.upper), owner.get(row.lower)) for row in rows.interfaces]
        return cls(
            [
                StopBound(row.component, upper, lower, max(row.gap, 0.0))
                for row, upper, lower in sides
                if row.law is not None and upper != lower
            ]
        )

    def highest(self, factors: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
        """Greatest ``sum(factor * displacement)``, or infinity, and the stops that bound it.

        ``factors`` are by component of the body; stops against what does not move come first.
        """
        wanted = {body: factor for body, factor in factors.items() if factor != 0.0}
        if not wanted:
            return 0.0, ()
        found = self._of_one_body(wanted)
        return self._of_a_chain(wanted) if found is None else found

    def _of_one_body(self, wanted: Mapping[str, float]) -> tuple[float, tuple[str, ...]] | None:
        """Answer for one body: the nearest of its stops if they do not move, infinity without any.

        None for several bodies, and where two stops are equally near.  The scaling is that of the
        linear programme, so that both give the same number.
        """
        ((body, factor), *others) = wanted.items()
        if not others and all(body not in (bound.upper, bound.lower) for bound in self.bounds):
            return inf, ()
        if others or any({bound.upper, bound.lower} != {body, None} for bound in self.bounds):
            return None
        gaps = [
            bound for bound in self.bounds if (bound.lower if factor > 0.0 else bound.upper) == body
        ]
        if not gaps:
            return inf, ()
        nearest, *further = sorted(gaps, key=lambda bound: bound.gap)
        if further and further[0].gap == nearest.gap:
            return None
        length = max(_LEAST_LENGTH, *(bound.gap for bound in self.bounds))
        return nearest.gap / length * length * abs(factor), (nearest.name,)

    def _of_a_chain(self, wanted: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
        sides = [side for bound in self.bounds for side in (bound.upper, bound.lower) if side]
        place = {body: i for i, body in enumerate(dict.fromkeys([*sides, *wanted]))}
        closing = np.zeros((len(self.bounds), len(place)))
        for row, bound in zip(closing, self.bounds, strict=True):
            if bound.lower:
                row[place[bound.lower]] += 1.0
            if bound.upper:
                row[place[bound.upper]] -= 1.0
        gaps = np.array([bound.gap for bound in self.bounds])
        length = max(float(gaps.max(initial=0.0)), _LEAST_LENGTH)
        most = max(abs(factor) for factor in wanted.values())
        cost = np.zeros(len(place))
        for body, factor in wanted.items():
            cost[place[body]] = -factor / most
        found = scipy.optimize.linprog(cost, A_ub=closing, b_ub=gaps / length, bounds=(None, None))
        if found.fun is None or found.status != 0:
            return inf, ()
        met = [
            bound
            for bound, share in zip(self.bounds, found.ineqlin.marginals, strict=True)
            if abs(share) > 1e-9
        ]
        names = tuple(bound.name for bound in sorted(met, key=lambda bound: not bound.stands))
        return -float(found.fun) * length * most, names

    def lowest(self, factors: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
        """Smallest ``sum(factor * displacement)`` and the stops; minus infinity without."""
        value, names = self.highest({body: -factor for body, factor in factors.items()})
        return 0.0 - value, names

    def lift(
        self, body: str, at: float = 0.0
    ) -> tuple[tuple[float, float], tuple[tuple[str, ...], tuple[str, ...]]]:
        """Lowest and highest place of what a body travels itself, and the stops that end it there.

        It rests at the nearer end of its range from ``at`` [m].  The other end is that of its range
        too, unless no stop of its own stands there and another body carries it: then it ends where
        the carrier ends.  A needle whose armature travels freely before it carries the needle has
        the travel of the armature less the free one; what the needle may fly further is no lift.
        """
        (low, below), (high, above) = self.lowest({body: 1.0}), self.highest({body: 1.0})
        if at - low <= high - at:
            high, above = self._carried(body, 1.0, high, above)
        else:
            low, below = self._carried(body, -1.0, -low, below)
            low = -low
        return (low, high), (below, above)

    def _carried(
        self, body: str, sign: float, far: float, stops: tuple[str, ...]
    ) -> tuple[float, tuple[str, ...]]:
        """Where a body ends along ``sign``, at most ``far`` [m] away."""
        sides = [
            (b.upper, b.lower, b) if sign > 0.0 else (b.lower, b.upper, b) for b in self.bounds
        ]
        if any(carrier == body and ahead is None for ahead, carrier, _ in sides):
            return far, stops
        pushed = [
            (end - bound.gap, names)
            for ahead, carrier, bound in sides
            if ahead == body and carrier is not None
            for end, names in [self.highest({carrier: sign})]
        ]
        end, names = max(pushed, default=(far, stops))
        return (end, names) if end < far else (far, stops)

    @staticmethod
    def factors(rows: Rows, ports: Iterable[tuple[int, float]]) -> dict[str, float]:
        """Factors of bodies from those of ports (handles); fixed ports do not count."""
        owner = _owners(rows)
        total: dict[str, float] = {}
        for port, factor in ports:
            body = owner.get(port)
            if body is not None:
                total[body] = total.get(body, 0.0) + factor
        return total


def _owners(rows: Rows) -> dict[int, str]:
    free = [row for row in rows.bodies if row.body.rigid_count > 0]
    return {handle: row.component for row in free for handle in row.ports}


_EMPTY = -1e3  # [Pa] less than a millionth of the vapour is left: more flowed out than there was
_ROUNDING = 1e-9  # of the start value: what sums of lengths leave


def limits_of(rows: Rows) -> list[LimitRow]:
    """Every range of a network: those of its components, volumes, and fluid."""
    return [*rows.limits, *_volumes(rows), *_pressures(rows), *_liquids(rows)]


def _volumes(rows: Rows) -> list[LimitRow]:
    walls = defaultdict[int, list[tuple[int, float]]](list)
    for wall in rows.walls:
        if rows.nodes[wall.node].volume > 0.0:
            walls[wall.node].append((wall.port, wall.area))
    return [
        LimitRow(
            component=rows.nodes[node].component,
            quantity="volume",
            unit="m^3",
            valid=(0.0, inf),
            usable=(0.0, inf),
            law="a chamber",
            effect=lambda value: "It has no fluid left.",
            advice="give its volume with all faces at their start positions, dead volume "
            "included, or correct the area of the moving face.",
            key="volume",
            start=rows.nodes[node].volume,
            ports=tuple(ports),
        )
        for node, ports in walls.items()
    ]


def _pressures(rows: Rows) -> list[LimitRow]:
    if rows.fluid is None:
        return []
    known = rows.fluid.pressure_range
    name = rows.fluid.name
    return [
        LimitRow(
            component=row.component,
            quantity="pressure",
            unit="Pa",
            valid=(known.lowest, known.highest),
            usable=(_EMPTY, known.usable),
            law=f"the fluid '{name}'",
            source=known.source,
            effect=lambda value: (
                "Stiffness and wave speed are wrong by more than 10 % and 5 %, volumes and flows "
                "by less."
            ),
            advice="check volumes, flows and pressures (absolute, with their units); where they "
            "are intended, define your own fluid with a table of densities.",
            node=node,
        )
        for node, row in rows.nodes.items()
    ]


def _liquids(rows: Rows) -> list[LimitRow]:
    """Supplies are liquid, volumes and junctions begin so; what boils later is computed."""
    if rows.fluid is None:
        return []
    fluid = rows.fluid
    boils = f"{1e-5 * fluid.vapour_pressure:.3g} bar at {fluid.temperature - 273.15:.4g} degC"
    return [
        LimitRow(
            component=row.component,
            quantity="pressure",
            unit="Pa",
            valid=(fluid.all_liquid_from, inf),
            usable=(0.0 if row.prescribed else -inf, inf),
            law=f"liquid '{fluid.name}' in '{row.component}'",
            source=f"absolute; it boils at {boils}",
            effect=_flows_out if row.prescribed else _begins,
            advice="pressures are absolute: add the ambient pressure, usually 1.013 bar, to a "
            "gauge pressure; check the temperature of the fluid.",
            node=node,
            at_start=not row.prescribed,
        )
        for node, row in rows.nodes.items()
        if node > AMBIENT or (node == AMBIENT and _gives_fluid(rows))  # below: inside of lines
    ]


def _flows_out(pressure: float) -> str:
    return "The flow from there is partly or wholly vapour."


def _begins(pressure: float) -> str:
    return "At the start it holds vapour, partly or wholly."


def _gives_fluid(rows: Rows) -> bool:
    ends = [(row.a, row.b) for row in rows.branches] + [(row.a, row.b) for row in rows.lines]
    return any(AMBIENT in both for both in ends)


def check_ranges(rows: Rows) -> None:
    """Reject what must leave a range: by the stops, by a start, or by a prescribed pressure."""
    travel = Travel.of(rows)
    for limit in limits_of(rows):
        if limit.ports:
            _check_motion(rows, limit, travel)
        elif limit.node is not None:
            _check_pressure(rows, limit)


def _check_motion(rows: Rows, limit: LimitRow, travel: Travel) -> None:
    low, high = limit.valid
    factors = Travel.factors(rows, limit.ports)
    least, below = travel.lowest(factors)
    most, above = travel.highest(factors)
    slack = _ROUNDING * abs(limit.start)
    if not low - slack <= limit.start <= high + slack:
        raise CaseProblem(
            ("components", limit.component, *([limit.key] if limit.key else [])),
            got=f"{value_text(limit.start, limit.unit)} at the start",
            expected=f"a {limit.quantity} in the range of {limit.law}, {range_text(limit)}",
            hint=limit.advice,
        )
    for way, stops, is_out in (
        (least, below, limit.start + least < low - slack),
        (most, above, limit.start + most > high + slack),
    ):
        if not is_out or abs(way) == inf:  # nothing bounds it: the run will show
            continue
        raise CaseProblem(
            ("components", limit.component, *([limit.key] if limit.key else [])),
            got=_way_text(rows, limit, way, stops),
            expected=f"a {limit.quantity} {range_text(limit)} anywhere between the stops",
            hint=limit.advice,
        )


def _way_text(rows: Rows, limit: LimitRow, way: float, stops: tuple[str, ...]) -> str:
    """Initial value and its largest change within the stops."""
    start, change = (value_text(abs(value), limit.unit) for value in (limit.start, way))
    gaps = {row.component: row.gap for row in rows.interfaces}
    named = " and ".join(f"components.{name}.gap: {format_si(gaps[name], 'm')}" for name in stops)
    if not stops:
        return f"{start} at the start"
    does = "from which a stroke can take" if way < 0.0 else "to which a stroke can add"
    return f"{start} at the start, {does} up to {change} ({named})"


def _check_pressure(rows: Rows, limit: LimitRow) -> None:
    assert limit.node is not None
    row = rows.nodes[limit.node]
    start, highest = row.at_start, float(row.pressure.max())
    key = ("ambient",) if limit.node == AMBIENT else ("components", limit.component)
    if highest > limit.usable[1]:
        raise CaseProblem(
            key,
            got=f"a pressure of {value_text(highest, 'Pa')}",
            expected=f"at most {value_text(limit.usable[1], 'Pa')}; {limit.law} is described "
            f"{range_text(limit)}",
            hint=limit.advice,
        )
    if row.prescribed and start < limit.valid[0]:
        raise CaseProblem(
            key,
            got=f"a pressure of {value_text(start, 'Pa')} at the start",
            expected=f"{limit.law}, {range_text(limit)}",
            hint=limit.advice,
        )


def range_text(limit: LimitRow) -> str:
    """Range of the law as text: "from 0 um to 4 mm", "above 0 mm^3", "up to 500 bar (source)"."""
    low, high = limit.valid
    text = f"from {value_text(low, limit.unit)} to {value_text(high, limit.unit)}"
    if high == inf:
        text = f"above {value_text(low, limit.unit)}"
    elif low <= 0.0 and limit.unit == "Pa":
        text = f"up to {value_text(high, limit.unit)}"
    return f"{text} ({limit.source})" if limit.source else text


def value_text(value: float, unit: str) -> str:
    """Quantity as usual in this field: pressures in bar, volumes in mm^3."""
    if unit == "Pa":
        return f"{1e-5 * value:.5g} bar"
    if unit == "m^3":
        return f"{1e9 * value:.4g} mm^3"
    if unit == "kg/s":
        return f"{1e3 * value:.4g} g/s"
    return format_si(value, unit)
