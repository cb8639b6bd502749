"""Strokes with derivatives, at the case or about another point of the same parameters."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from math import isfinite
from time import process_time
from typing import Any, Self

from klack.analyses.noise.body import Transfers
from klack.analyses.sensitivities.parameters import SlopeSpace, VariedKey
from klack.analyses.stroke.record import StrokeVariant
from klack.analyses.stroke.run import run_variant, variant_network, variant_of
from klack.analyses.study.chosen_measures import ChosenMeasure, PointNoise
from klack.analyses.study.stroke_measures import StrokeOfPoint
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.case.case_tree import CaseTree
from klack.case.points import case_at, checked_parts, points_of
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.case.variants import Variant
from klack.errors import InputError, KlackError
from klack.network.rows import Rows
from klack.progress import Progress
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import has_python_steps
from klack.simulation.tangent_numbers import Direction
from klack.simulation.tangent_run import DIRECTIONS, TangentRun, compile_tangents, run_tangents

__all__ = ["TIMES", "SlopeRunner", "has_slope", "measured"]

TIMES = ("opening_time", "closing_time")
"""Measures of a stroke, beside those of its impacts, that have derivatives."""

_SHIFT = 3e-5  # of the size of a parameter: what its numbers are differentiated by
_AHEAD = 1e-6  # of the size: what a measure is differentiated by, along straight lines
_STAGE = "derivatives"


def has_slope(item: ChosenMeasure) -> bool:
    """Whether a measure has derivatives here: times of the stroke, and impacts."""
    if item.of == "impact":
        return True
    return item.of == "variant" and item.name.partition("_at_")[0] in TIMES


class SlopeRunner:
    """One variant of a case, at points about that of the case."""

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
        written = space.written({})
        points = points_of(case, tree, [written])
        self._places = {key.name: key.place for key in points.keys}
        valve = build_valve(case, clock, threads=threads)
        self._tree, self._valve = tree, valve
        self._parts = checked_parts(tree, case, self._places.values())
        self.valve = self.at({})
        self.roles: ValveRoles = find_roles(self.valve.case, self.valve.network)

    def about(self, space: SlopeSpace) -> Self:
        """The same strokes about another point, of the same parameters."""
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
        """Runs with derivatives, each in some of the directions."""
        run, rows, found = self.valve.case.run, self.rows({}), list[TangentRun]()
        if not has_python_steps(rows):
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
                    accuracy=run.accuracy,
                    step=run.step,
                    coarse=run.coarse,
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
                    got=f"a value at the end of what is allowed ({error.got})",
                    expected="one with room on both sides",
                    hint="klack study varies it to one side.",
                ) from None
        return Direction(name=item.name, plus=ends[0], minus=ends[1], distance=2.0 * shift)

    def variant(self, result: NetworkResult) -> StrokeVariant:
        """Times of the needle in a run."""
        rows = variant_network(self.valve, self.name).rows()
        return variant_of(self.valve, self.roles, self.name, rows, result)

    def stroke(self, shifts: Mapping[str, float]) -> StrokeVariant:
        """Stroke without derivatives, with shifted parameters."""
        valve = self.at(shifts)
        rows = variant_network(valve, self.name).rows()
        result = run_variant(valve.case, rows, lambda fraction: self.clock("check", fraction))
        return variant_of(valve, self.roles, self.name, rows, result)

    def slopes(
        self, runs: Sequence[TangentRun], item: ChosenMeasure
    ) -> tuple[float | None, tuple[float | None, ...]]:
        """Value of a measure, and its derivatives [per unit of each parameter]."""
        value = measured(item, self.variant(runs[0].moved(0, 0.0)))
        found: list[float | None] = []
        for k, parameter in enumerate(self.space.varied):
            run, place = runs[k // DIRECTIONS], k % DIRECTIONS
            ahead = _AHEAD * parameter.size
            ends = [
                measured(item, self.variant(run.moved(place, way * ahead))) for way in (1.0, -1.0)
            ]
            if value is None or ends[0] is None or ends[1] is None:
                found.append(None)
            else:
                found.append((ends[0] - ends[1]) / (2.0 * ahead))
        return value, tuple(found)


def measured(item: ChosenMeasure, variant: StrokeVariant) -> float | None:
    """Value of a measure in a stroke; None where it has none."""
    value = item.value(StrokeOfPoint(variant, PointNoise(_no_noise, Transfers())))
    return value if value is not None and isfinite(value) else None


def _no_noise() -> Any:
    raise KlackError("no noise of a run with derivatives")
