r"""Strokes with derivatives, at the case or about another point of the same parameters.

A run with derivatives records means over intervals whose ends move along,
:math:`t(p) = t + \dot t\,\delta p`.  Noise is a function of the force over the time of a clock.
The impulse of an interval that moves is :math:`f h`; what enters and leaves at the ends of one that
stays is the force there times their speed (Reynolds' transport theorem), so that the mean over it
has

.. math::

    \dot f_\text{fixed} = \dot f + \frac{f\,(\dot t_1 - \dot t_0)}{h}
        - \frac{f(t_1)\,\dot t_1 - f(t_0)\,\dot t_0}{h} ,

with the force at an end as the mean of both neighbours.  The sum is the derivative of the impulse.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, partial
from math import isfinite
from time import process_time
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.analyses.noise.body import Transfers
from klack.analyses.noise.force import first_part, interrupted_impact, stop_force
from klack.analyses.noise.reactions import HeldForces
from klack.analyses.noise.source import NoiseSource, held_forces, net_force, stroke_sources
from klack.analyses.sensitivities.parameters import SlopeSpace, VariedKey
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.analyses.stroke.run import (
    VariantRun,
    body_summaries,
    halved,
    one_variant,
    stop_summaries,
    study_of_run,
    variant_network,
    variant_of,
)
from klack.analyses.study.measures import TIMES, ChosenMeasure, PointNoise, StrokeOfPoint
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.case.any_case import CaseTree
from klack.case.levels import Variant
from klack.case.points import case_at, checked_parts, points_of
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.errors import InputError
from klack.machine.progress import Progress
from klack.network.rows import Rows
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import NetworkResult
from klack.simulation.tangent_numbers import Direction
from klack.simulation.tangent_run import (
    DIRECTIONS,
    TangentRun,
    compile_tangents,
    require_differentiable,
    run_tangents,
)

__all__ = ["SlopeRunner", "has_slope", "measured", "moved_forces", "transported"]


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MovedForces:
    """Forces behind the noise of a run, and their derivatives with one parameter.

    ``stops`` and ``net`` [N per unit] are derivatives at the times of ``source``; ``held`` gives
    all forces on held bodies where the parameter has changed by an amount.
    """

    source: NoiseSource
    stops: Mapping[str, Floats]
    net: Floats | None
    held: Callable[[float], HeldForces | None]

    def at(self, amount: float) -> NoiseSource:
        """Forces where the parameter has changed by an amount, to first order.

        All but the strongest impact alone, from which no measure is read.
        """
        net = self.source.net
        return replace(
            self.source,
            stops=tuple(
                replace(stop, force=_added(stop.force, amount, self.stops[stop.name]))
                for stop in self.source.stops
            ),
            net=net if net is None or self.net is None else _added(net, amount, self.net),
            held=self.held(amount),
        )


def moved_forces(
    study: StrokeStudy, case: ValveCase, run: TangentRun, direction: int
) -> MovedForces:
    """Differentiate the forces of a run at fixed times.

    The section ``noise`` is that of ``case``.
    """
    source = stroke_sources(study, case=case)[0]
    variant = study.reference
    followed, _ = first_part(variant.result)
    moving, late = run.rates(direction)
    rates, _ = first_part(moving)
    part = (late.size - 1) * (rates.time.size - 1) // (moving.time.size - 1)
    stops = {}
    for stop in source.stops:
        force = stop_force(followed, stop.name).values
        ends = _evenly(late[: part + 1], force.size)
        along = stop_force(rates, stop.name).values + force * np.diff(ends) / rates.step
        stops[stop.name] = along + transported(force, ends, rates.step)
    net = net_force(study, replace(variant, result=followed))
    pushed = net_force(study, replace(variant, result=rates))
    of_net = None
    if net is not None and pushed is not None:  # its impulse is what the speed changes by
        ends = _evenly(late[: part + 1], net.values.size)
        of_net = pushed.values + transported(net.values, ends, net.step)
    whole = replace(variant, result=followed)
    last = None if net is None else interrupted_impact(followed.events, net)
    moved = (
        _moved_channels(whole, rates, late[: part + 1])
        if source.held is not None
        else dict[str, Floats]()
    )

    def held(amount: float) -> HeldForces | None:
        channels = dict(followed.channels)
        for name, along in moved.items():
            values = channels[name].values + amount * along
            channels[name] = replace(channels[name], values=values)
        now = replace(whole, result=replace(followed, channels=channels))
        return held_forces(study, now, source.noise, last)

    return MovedForces(source=source, stops=stops, net=of_net, held=held)


def _moved_channels(
    variant: StrokeVariant, rates: NetworkResult, late: Floats
) -> dict[str, Floats]:
    """Derivatives at fixed times of the channels that forces on held bodies come from.

    Impulses and speeds are sums of means over intervals; pressures are values at their ends.
    """
    result = variant.result
    ends, step = _evenly(late, result.time.size - 1), float(result.time[1] - result.time[0])
    sums = [part.channel for part in variant.acting if part.impulse]
    sums += [name for body in variant.moving for name in (body.velocity, body.repaid) if name]
    means = [part.channel for part in variant.acting if not part.impulse]
    means += [name for item in variant.passages for name in item.flows]
    found = {}
    for name in dict.fromkeys(means):
        values, own = result.channels[name].values[1:], rates.channels[name].values
        along = own[1:] + values * np.diff(ends) / step + transported(values, ends, step)
        found[name] = np.concatenate([own[:1], along])
    for name in dict.fromkeys(sums):
        values, own = np.diff(result.channels[name].values), rates.channels[name].values
        along = np.diff(own) + step * transported(values / step, ends, step)
        found[name] = own[0] + np.concatenate([[0.0], np.cumsum(along)])
    for name in dict.fromkeys(name for item in variant.passages for name in item.pressures if name):
        values = result.channels[name].values
        found[name] = rates.channels[name].values - np.gradient(values, step) * ends
    return found


def transported(values: Floats, late: Floats, step: float) -> Floats:
    """What enters intervals that stay less what leaves them, where times move, per interval.

    ``values`` (n,) are means over the intervals, ``late`` (n + 1,) [s per unit] derivatives of the
    times of their ends, ``step`` [s] their length.
    """
    at_ends = np.concatenate([values[:1], 0.5 * (values[:-1] + values[1:]), values[-1:]])
    return -np.diff(at_ends * late) / step


def _evenly(late: Floats, count: int) -> Floats:
    """Derivatives of the times of interval ends, linear between known ones."""
    places = np.arange(late.size) * (count / (late.size - 1))
    return np.interp(np.arange(count + 1), places, late)


def _added(series: TimeSeries, amount: float, rates: Floats) -> TimeSeries:
    return replace(series, values=series.values + amount * rates[: series.values.size])


_OF_NOISE = ("J", "dB", "dBA")
"""Units of measures of the noise that do: energies and levels."""

_SHIFT = 3e-5  # of the size of a parameter: what its numbers are differentiated by
_AHEAD = 1e-6  # of the size: what a measure is differentiated by, along straight lines
_STAGE = "derivatives"


def has_slope(item: ChosenMeasure) -> bool:
    """Whether a measure has derivatives: times, impacts, flows, energies and levels."""
    if item.of in ("impact", "delivery") or item.name == "delivered_mass":
        return True
    if item.is_noise:
        return item.measure.unit in _OF_NOISE
    return item.of == "variant" and item.name.partition("_at_")[0] in TIMES


class SlopeRunner:
    """One variant of a case, at points about it."""

    def __init__(
        self,
        case: ValveCase,
        tree: CaseTree,
        space: SlopeSpace,
        name: Variant,
        clock: Progress,
        threads: int | None,
    ) -> None:
        self.space, self.name, self.clock = space, name, clock
        self.runs_time = 0.0
        self.halvings = 0
        written = space.written({})
        points = points_of(case, tree, [written])
        self._places = {key.name: key.place for key in points.keys}
        valve = build_valve(case, clock, threads=threads)
        self._tree, self._valve = tree, valve
        self._bodies, self._stops = body_summaries(valve), stop_summaries(valve)
        self._transfers = Transfers()
        self.notes: tuple[str, ...] = ()
        self._parts = checked_parts(tree, case, self._places.values())
        self.valve = self.at({})
        self.roles: ValveRoles = find_roles(self.valve.case, self.valve.network)

    def about(self, space: SlopeSpace) -> Self:
        """The same strokes about another point."""
        other = copy(self)
        other.space, other.runs_time = space, 0.0
        other.valve = other.at({})
        return other

    def at(self, shifts: Mapping[str, float]) -> Valve:
        """Valve with shifted parameters."""
        written = self.space.written(shifts)
        changes = {self._places[name]: value for name, value in written.items()}
        case = case_at(ValveCase, self._tree, self._parts, changes)
        network = filled_network(case, self._valve.reduced, self._valve.laws)
        return replace(self._valve, case=case, network=network)

    def rows(self, shifts: Mapping[str, float]) -> Rows:
        """Rows of the network with shifted parameters."""
        return variant_network(self.at(shifts), self.name).rows()

    def tangents(self) -> list[TangentRun]:
        """Runs with derivatives, each for some directions."""
        run, rows, found = self.valve.case.run, self.rows({}), list[TangentRun]()
        require_differentiable(rows)
        compile_tangents(rows, step=run.fine_step)
        begin = process_time()
        directions = [self._direction(item) for item in self.space.varied]
        self.runs_time = process_time() - begin
        for first in range(0, len(directions), DIRECTIONS):
            part = directions[first : first + DIRECTIONS]
            done, share = first / len(directions), len(part) / len(directions)
            found.append(
                run_tangents(
                    rows,
                    part,
                    duration=run.duration,
                    sizes=halved(self.valve.case, rows, self.halvings),
                    record=run.record,
                    progress=partial(self._tell, done, share),
                )
            )
        self.runs_time += sum(item.cpu_time for item in found)
        return found

    def _tell(self, done: float, share: float, fraction: float) -> None:
        self.clock(_STAGE, done + share * fraction)

    def _direction(self, item: VariedKey) -> Direction:
        shift = _SHIFT * item.size
        ends = []
        for sign in (1.0, -1.0):
            try:
                ends.append(self.rows({item.name: sign * shift}))
            except InputError as error:
                raise InputError(
                    f"--parameter {item.name}",
                    got=f"a value at the end of its allowed range ({error.got})",
                    expected="a value with room on both sides",
                    hint="klack study varies it to one side.",
                ) from None
        return Direction(name=item.name, plus=ends[0], minus=ends[1], distance=2.0 * shift)

    def check_steps(self) -> None:
        """Halve all steps as often as the stroke in the middle requires, and warn of the rest."""
        require_differentiable(self.rows({}))  # before any stroke
        run = one_variant(self.valve, self.roles, self.name, self.clock)
        self.halvings = run.variant.halvings

    def stroke(self, shifts: Mapping[str, float]) -> StrokeOfPoint:
        """Stroke without derivatives, with shifted parameters."""
        valve = self.at(shifts)

        def progress(stage: str, done: float) -> None:
            self.clock("check", done)

        # in the steps of the run with derivatives
        run = one_variant(
            valve, self.roles, self.name, progress, halvings=self.halvings, check=False
        )
        if run.failure is not None:
            raise run.failure

        def source() -> NoiseSource:
            return stroke_sources(self._study(valve, run), case=valve.case)[0]

        return StrokeOfPoint(run.variant, PointNoise(source, self._transfers))

    def slopes(
        self, runs: Sequence[TangentRun], items: Sequence[ChosenMeasure]
    ) -> list[tuple[float | None, tuple[float | None, ...]]]:
        """Value of each measure, and its derivatives [per unit of each parameter].

        What speaks against the noise of the run is kept in ``notes``.
        """
        point = self._ahead(runs[0], 0)(0.0)
        values = [measured(item, point) for item in items]
        self.notes = tuple(point.noise.notes)
        found: list[list[float | None]] = [[] for _ in items]
        for k, parameter in enumerate(self.space.varied):
            at = self._ahead(runs[k // DIRECTIONS], k % DIRECTIONS)
            ahead = _AHEAD * parameter.size
            plus, minus = at(ahead), at(-ahead)
            for item, value, slopes in zip(items, values, found, strict=True):
                ends = measured(item, plus), measured(item, minus)
                if value is None or ends[0] is None or ends[1] is None:
                    slopes.append(None)
                else:
                    slopes.append((ends[0] - ends[1]) / (2.0 * ahead))
        return list(zip(values, map(tuple, found), strict=True))

    def _ahead(self, run: TangentRun, direction: int) -> Callable[[float], StrokeOfPoint]:
        """Stroke with the parameter of a direction changed by an amount."""
        name = run.directions[direction].name if run.directions else ""
        end = float(run.moved(direction, 0.0).time[-1])

        def moved(amount: float) -> VariantRun:
            result = run.moved(direction, amount)
            valve = self.at({name: amount})  # stops may end another lift, drivers start later
            rows = variant_network(valve, self.name).rows()
            variant = variant_of(valve, self.roles, self.name, rows, result, until=end)
            return VariantRun(variant=variant, rows=rows, failure=None)

        @cache
        def forces() -> MovedForces:
            study = self._study(self.valve, moved(0.0))
            return moved_forces(study, self.valve.case, run, direction)

        def at(amount: float) -> StrokeOfPoint:
            noise = PointNoise(lambda: forces().at(amount), self._transfers)
            return StrokeOfPoint(moved(amount).variant, noise)

        return at

    def _study(self, valve: Valve, run: VariantRun) -> StrokeStudy:
        return study_of_run(valve, self.roles, self.name, run, self._bodies, self._stops)


def measured(item: ChosenMeasure, point: StrokeOfPoint) -> float | None:
    """Value of a measure in a stroke, if it has one."""
    value = item.value(point)
    return value if value is not None and isfinite(value) else None
