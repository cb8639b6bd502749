r"""Run a network together with its derivatives in some directions.

The compiled time loop runs on numbers that carry derivatives
(:mod:`klack.machine.compiling.tangent_number`).  All of it is differentiated but for its decisions,
which are those of the run itself.

**Steps follow the touches.**  Impacts begin with an error that depends on the phase of the touch
within its step, a saw-tooth as high as :math:`10^{-5}` and as narrow as one step.  Its slope, the
derivative of the program at fixed steps, has nothing to do with that of the valve.  So the steps
stretch with the parameter such that each touch keeps its phase: beside the requested directions
runs one in which only the length of all steps changes,

.. math:: h(p) = h\,[1 + c\,(p - p_0)] ,

and since tangents add up, ``c`` follows at each touch, for every direction, from its phase.  The
record then belongs to times that move along: :math:`t(p) = t + \theta (p - p_0)`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from time import process_time
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError, InputError, refuse_if
from klack.machine.memory import require_memory
from klack.network.accuracy import Accuracy
from klack.network.rows import Rows
from klack.simulation.impact_events import ImpactFinder, judged
from klack.simulation.network_arrays import PARTS, scratch_memory
from klack.simulation.network_compile import compile_network
from klack.simulation.network_kernel import CLOCK
from klack.simulation.network_record import moment_of
from klack.simulation.network_recorder import Recorder, gap_rates
from klack.simulation.network_result import (
    ChannelData,
    EnergyBooks,
    InterfaceRecord,
    NetworkResult,
    StepCounts,
)
from klack.simulation.network_run import grid_of, has_python_steps
from klack.simulation.phase import STATUS_DONE
from klack.simulation.rest import effective_mass, longest_period
from klack.simulation.static_start import begin_at_rest
from klack.simulation.step_sizes import StepSizes, step_sizes
from klack.simulation.tangent_loop import (
    LANES,
    lanes_of,
    run_with_tangents,
    start_with_tangents,
    tangent_address,
)
from klack.simulation.tangent_numbers import (
    STRETCH,
    Direction,
    arrays_of,
    begin_stretch,
    end_stretch,
    lifted,
    mode_places,
    numbers_at_rest,
    set_stretch,
    state_arrays,
    waves_under_way,
)
from klack.units import format_si

__all__ = [
    "DIRECTIONS",
    "TangentRun",
    "Touch",
    "compile_tangents",
    "require_differentiable",
    "run_tangents",
]

Lanes = NDArray[np.float64]
"""Numbers with derivatives: value, stretch of the steps, directions."""

_FIRST = STRETCH + 1  # lane of the first direction
DIRECTIONS = LANES - _FIRST
"""Directions of one run."""

_CHUNK = 32  # looks between two searches for touches
_STRETCHED = 16  # looks before a touch in which the steps stretch
_QUIET = 8  # looks before a touch in which they do not: the end of its approach
_NOTICED = 0.02  # of the fastest touch: slower ones have no phase to keep
_WITHOUT_BOUND = 1e3  # of the longest displacement: bounces alone let derivatives grow to 1e2


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """A touch whose phase all directions keep.

    Parameters
    ----------
    time [s]
    speed [m/s]
        Of closing.
    slopes (directions,) [s per unit]
        Of the time.
    """

    stop: str
    time: float
    speed: float
    slopes: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class TangentRun:
    """A run with its touches and derivatives in every direction.

    Parameters
    ----------
    cpu_time [s]
        With compiling, if that was needed.
    looks
        Records of the loop in one of the result.
    """

    rows: Rows
    directions: tuple[Direction, ...]
    touches: tuple[Touch, ...]
    sizes: StepSizes
    cpu_time: float
    looks: int
    _columns: Any
    _time: Lanes  # (looks + 1,)
    _points: Lanes
    _means: Lanes
    _fine: tuple[Lanes, ...]

    @cached_property
    def _peaks(self) -> tuple[tuple[str, Lanes | None, Lanes | None], ...]:
        places = {row.component: c for c, row in enumerate(self.rows.interfaces)}
        return tuple(
            (event.stop, *_vertex(self._fine[places[event.stop]], event.peak_time))
            for event in self._moved(0, 0.0).events
        )

    def moved(self, direction: int, amount: float) -> NetworkResult:
        """The run after a change of the parameter of a direction by ``amount``, to first order.

        Times change as well.  A peak between two steps is found on the parabola through three of
        them: the largest step would depend on where these lie.  There is no state to continue from.
        """
        result = self._moved(direction, amount)
        peaks = self._peaks
        if [event.stop for event in result.events] != [stop for stop, _, _ in peaks]:
            return result
        events = []
        for event, (_, force, time) in zip(result.events, peaks, strict=True):
            if force is None or time is None:
                events.append(event)
                continue
            lane = _FIRST + direction
            events.append(
                replace(
                    event,
                    peak_force=float(force[0] + amount * force[lane]),
                    peak_time=float(time[0] + amount * time[lane]),
                )
            )
        return replace(result, events=tuple(events))

    def _moved(self, direction: int, amount: float) -> NetworkResult:
        def at(values: Lanes) -> NDArray[np.float64]:
            if amount == 0.0:
                return np.ascontiguousarray(values[..., 0])
            return np.asarray(values[..., 0] + amount * values[..., _FIRST + direction])

        time, points, fine = at(self._time), at(self._points), [at(part) for part in self._fine]
        finder = ImpactFinder(self.rows, float(self._time[0, 0]), self.sizes.step)
        finder.feed(time, gap_rates(points, self._columns[2]), fine)
        heavier = self._heavier(direction, amount)
        result = self._result(time, points, at(self._means), fine)
        events = tuple(
            replace(event, energy_loss=heavier.get(event.stop, 1.0) * event.energy_loss)
            for event in finder.events(result.channels)
        )
        until, none = float(time[-1]), np.empty((0, 0))
        events, _ = judged(events, self.rows, result.interfaces, until, none, {})
        return replace(result, events=events)

    def _heavier(self, direction: int, amount: float) -> dict[str, float]:
        """Mass of the relative motion at each stop over that of the run, where it changes."""
        if amount == 0.0:
            return {}
        way = self.directions[direction]
        mass, plus, minus = map(_masses, (self.rows, way.plus, way.minus))
        return {
            stop: 1.0 + amount * (plus[stop] - minus[stop]) / way.distance / own
            for stop, own in mass.items()
            if np.isfinite(own)
        }

    def without_bound(self, direction: int, amount: float) -> float | None:
        """Time from which derivatives grow without bound; None where they do not.

        That is, a change of the parameter by ``amount`` would move a port a thousand times as far
        as any port moves.
        """
        ports = [i for i, c in enumerate(self._columns[1]) if c.name.endswith(" displacement")]
        longest = np.max(np.abs(self._points[:, ports, 0]), initial=0.0)
        moved = np.abs(amount * self._points[:, ports, _FIRST + direction])
        looks = np.flatnonzero(np.any(~(moved <= _WITHOUT_BOUND * longest), axis=1))
        return float(self._time[looks[0], 0]) if len(looks) and longest > 0.0 else None

    def rates(self, direction: int) -> tuple[NetworkResult, NDArray[np.float64]]:
        """Derivatives with the parameter of a direction, at times that move along.

        Returns
        -------
        rates : NetworkResult
            Of all channels and forces, at the times of the run; without impacts.
        late : array, shape (looks + 1,) [s per unit]
            Of the times that divide the run into equal parts.
        """
        lane = _FIRST + direction
        fine = [np.concatenate([part[:, :2, 0], part[:, 2:, lane]], axis=1) for part in self._fine]
        time, points, means = self._time[:, 0], self._points[..., lane], self._means[..., lane]
        return self._result(time, points, means, fine), self._time[:, lane]

    def _result(
        self,
        time: NDArray[np.float64],
        points: NDArray[np.float64],
        means: NDArray[np.float64],
        fine: Sequence[NDArray[np.float64]],
    ) -> NetworkResult:
        """What was recorded, as channels by their names; without impacts."""
        means_of, points_of, _ = self._columns
        count = (len(time) - 1) // self.looks
        ends = np.arange(count + 1) * self.looks
        channels = {
            column.name: ChannelData(unit=column.unit, values=points[ends, i])
            for i, column in enumerate(points_of)
        }
        if len(means):
            thin = means[: count * self.looks].reshape(count, self.looks, -1).mean(axis=1)
            thin = np.concatenate([thin[:1], thin])
            channels |= {
                column.name: ChannelData(unit=column.unit, values=thin[:, i])
                for i, column in enumerate(means_of)
            }
        records = {
            row.component: InterfaceRecord(
                time=part[:, 0],
                step=part[:, 1],
                contact_force=part[:, 2],
                film_force=part[:, 3],
                gap=part[:, 4],
                complete=True,
            )
            for row, part in zip(self.rows.interfaces, fine, strict=True)
        }
        return NetworkResult(
            time=time[ends],
            channels=channels,
            interfaces=records,
            events=(),
            books=EnergyBooks(supplies={}, losses={}, stores_before={}, stores_after={}),
            sizes=self.sizes,
            steps=StepCounts(*([0] * (CLOCK - 2))),
            wall_time=self.cpu_time,
            state={},
        )


def run_tangents(
    rows: Rows,
    directions: Sequence[Direction],
    *,
    duration: float,
    accuracy: Accuracy = "normal",
    step: float | None = None,
    coarse: int | None = None,
    sizes: StepSizes | None = None,
    record: float = 0.5e-6,
    start: Literal["rest", "free"] = "rest",
    progress: Callable[[float], None] = lambda fraction: None,
) -> TangentRun:
    """Compute a network over time, with its derivatives.

    Parameters
    ----------
    rows, duration, accuracy, step, coarse, sizes, record, start, progress
        As of :func:`klack.simulation.network_run.simulate_network`.
    directions
        At most :data:`DIRECTIONS`.

    Raises
    ------
    InputError
        For a component that calls Python or an FMU, and for a direction in which the numbers of
        the network do not change smoothly.
    """
    require_differentiable(rows)
    sizes = sizes or step_sizes(rows, accuracy, step=step, coarse=coarse)
    begin = process_time()
    running = _Running(rows, directions, sizes, duration, record, start)
    found = running.run(progress)
    return replace(found, cpu_time=process_time() - begin)


def require_differentiable(rows: Rows) -> None:
    """Raise InputError for a network whose run has no derivatives."""
    refuse_if(
        has_python_steps(rows),
        "sensitivities",
        got="a component that calls Python or an FMU",
        expected="compiled components only",
        hint="run klack study with a few values of each parameter, which calls the unchanged "
        "program.",
    )
    driven = [row.component for row in rows.bodies if row.course is not None]
    if driven:
        raise InputError(
            f"components.{driven[0]}",
            got="derivatives of a run with a prescribed motion",
            expected="bodies moved by forces",
            hint="use differences of runs (klack study).",
        )
    if rows.controllers:
        raise InputError(
            f"components.{rows.controllers[0].component}",
            got="derivatives of a run with a controller",
            expected="a valve without controllers",
            hint="use differences of runs (klack study), or a driver without signals.",
        )
    if rows.waves:
        raise InputError(
            f"components.{rows.waves[0].component}.properties",
            got="derivatives of a run with a line of local properties",
            expected="properties: fixed",
            hint="use differences of runs (klack study), or properties: fixed with the "
            "working pressure.",
        )


def compile_tangents(rows: Rows, *, step: float | None = None) -> None:
    """Compile or load all that a run with derivatives needs, by a run of no steps."""
    for function in [row.step for row in rows.elements] + [row.step for row in rows.branches]:
        tangent_address(function)
    sizes = step_sizes(rows, "normal", step=step)
    _Running(rows, (), sizes, sizes.step, sizes.step, "rest").compile()


class _Running:
    def __init__(
        self,
        rows: Rows,
        directions: Sequence[Direction],
        sizes: StepSizes,
        duration: float,
        record: float,
        start: Literal["rest", "free"],
    ) -> None:
        self.rows, self.directions, self.sizes = rows, tuple(directions), sizes
        self.grid = grid_of(duration, sizes, record)
        network = compile_network(rows, sizes)
        rest = begin_at_rest(network, sizes.step)[1] if start == "rest" else None
        self.network = network
        self.with_slopes = numbers_at_rest(network, rest, directions, sizes)
        self.numbers = self.with_slopes.arrays
        changing = state_arrays(self.numbers)
        waves = self.numbers.line_state.samples  # most of them have arrived
        self.states = [a for a in changing if a.dtype == np.float64 and a is not waves]
        self.places = [array for array in changing if array.dtype != np.float64]
        self.modes = mode_places(self.numbers)
        self.clock = np.zeros(CLOCK, dtype=np.int64)
        self.clock[1] = -1
        self.h, self.origin = lanes_of(()), lanes_of(())
        self.h[0] = sizes.step
        chunk = min(_CHUNK, self.grid.records * self.grid.looks)
        recorder = Recorder(
            network, records=1, looks=1, chunk=chunk, fine=PARTS * chunk * self.grid.look_steps
        )
        self.recorder = recorder
        columns = recorder.recording.points.shape[1] + recorder.recording.means.shape[1] + 1
        looks = self.grid.records * self.grid.looks
        require_memory(
            "sensitivities",
            2.0 * 8.0 * LANES * looks * columns,
            what=f"{looks} moments of {columns} channels with their derivatives",
            hint="use a shorter duration.",
        )
        self.recording = lifted(recorder.recording, ())
        self.scratch = lifted(
            scratch_memory(
                interfaces=network.interfaces.interfaces,
                sliders=network.sliders.sliders,
                nodes=network.nodes.nodes,
                links=len(network.nodes.later),
                branches=network.branches.rows,
                ends=network.nodes.ends,
                sums=recorder.recording.means.shape[1],
            ),
            (),
        )
        self.pause = [longest_period(bodies) for bodies in rows.meeting]
        self.closed = network.interface_state.force > 0.0
        self.released = np.full(len(rows.interfaces), -inf)
        self.fastest = 0.0
        self.touches: list[Touch] = []
        self.done: list[_Part] = []

    def compile(self) -> None:
        self._start()
        self._advance(0)

    def run(self, progress: Callable[[float], None]) -> TangentRun:
        looks, looked = self.grid.records * self.grid.looks, 0
        start = self._start()
        before: _Kept | None = None  # start of the last chunk, if it had no touch
        while looked < looks:
            count = min(_CHUNK, looks - looked)
            back = before is not None and bool(np.any(self.origin[_FIRST:]))
            back = back and count >= _STRETCHED
            count = _STRETCHED if back else count
            kept: _Kept | None = self._kept()
            part = self._stretched(count) if back else self._advance(count)
            found = self._touch(part)
            if found is None:
                if back:  # to where drives switch
                    self._add([part], -self.origin[_FIRST:] / self.origin[STRETCH])
                self._take(part)
            else:
                flight = count = found.look + 1
                if flight < _STRETCHED + _QUIET and before is not None:
                    kept, flight = before, flight + len(self.done.pop().time)
                self._put_back(kept)
                self._fly_to_touch(flight)
                kept = None
            looked, before = looked + count, kept
            progress(looked / looks)
        parts = [start, *self.done]
        return TangentRun(
            rows=self.rows,
            directions=self.directions,
            touches=tuple(self.touches),
            sizes=self.sizes,
            cpu_time=0.0,
            looks=self.grid.looks,
            _columns=(self.recorder.means, self.recorder.points, self.recorder.sides),
            _time=np.concatenate([part.time for part in parts]),
            _points=np.concatenate([part.points for part in parts]),
            _means=np.concatenate([part.means for part in parts]),
            _fine=tuple(
                _with_releases(np.concatenate([part.fine[c] for part in parts]))
                for c in range(len(self.rows.interfaces))
            ),
        )

    def _fly_to_touch(self, looks: int) -> None:
        """Advance to the end of the look with the next touch, which keeps its phase."""
        quiet = min(_QUIET, (looks + 1) // 2)
        stretched = min(_STRETCHED, looks - quiet)
        if looks > quiet + stretched:
            self._take(self._advance(looks - quiet - stretched))
        parts = []
        if stretched:
            parts.append(self._stretched(stretched))
            self._take(parts[0])
        else:
            self._begin_stretch()
        part = self._advance(quiet)
        if not stretched:
            self._end_stretch()
        parts.append(part)
        self._keep_phase(parts, self._touch(part))
        self._take(part)

    def _stretched(self, looks: int) -> "_Part":
        self._begin_stretch()
        part = self._advance(looks)
        self._end_stretch()
        return part

    def _kept(self) -> "_Kept":
        laid_out, places = self.modes
        changing = [*self.states, *self.places, self.clock, self.origin]
        changing += [self.closed, self.released]
        changing += waves_under_way(self.numbers.lines, self.numbers.line_state)
        return _Kept(arrays=[(array, array.copy()) for array in changing], modes=laid_out[places])

    def _put_back(self, kept: "_Kept | None") -> None:
        assert kept is not None
        laid_out, places = self.modes
        for array, values in kept.arrays:
            array[...] = values
        laid_out[places] = kept.modes

    def _start(self) -> "_Part":
        none = np.zeros((0, self.recording.fine.shape[2], LANES))
        start_with_tangents(self.recording, moment_of(self.numbers))
        return _Part(
            time=np.zeros((1, LANES)),
            points=self.recording.points[:1].copy(),
            means=np.zeros((0, self.recording.means.shape[1], LANES)),
            fine=tuple(none for _ in self.rows.interfaces),
        )

    def _advance(self, count: int) -> "_Part":
        grid, now = self.grid, int(self.clock[0])
        self.recording.filled[:] = 0
        for array in arrays_of(self.scratch):
            array[...] = 0.0
        report = lanes_of((3,))
        status = run_with_tangents(
            count * grid.look,
            grid.look,
            self.clock,
            grid.block,
            self.sizes.near,
            self.sizes.middle,
            self.origin,
            self.h,
            self.sizes.coarse > 1,
            self.numbers,
            self.recording,
            self.scratch,
            report,
        )
        if status != STATUS_DONE:
            at = format_si(float(report[2, 0]), "s", 5)
            raise ConvergenceError(
                f"a step with derivatives failed at {at}.\nTry: klack stroke, which names the "
                "part; a smaller step."
            )
        steps = now + grid.look_steps * np.arange(1, count + 1)
        return _Part(
            time=self.origin + steps[:, None] * self.h,
            points=self.recording.points[:count].copy(),
            means=self.recording.means[:count].copy(),
            fine=tuple(
                self.recording.fine[c, :filled].copy()
                for c, filled in enumerate(self.recording.filled)
            ),
        )

    def _touch(self, part: "_Part") -> "_Found | None":
        """First touch of a chunk that needs to keep its phase."""
        found: _Found | None = None
        for c, rows in enumerate(part.fine):
            contact = rows[:, 2, 0] > 0.0
            before = np.concatenate(([self.closed[c]], contact[:-1]))
            released = self.released[c]
            for k in np.flatnonzero(contact != before):
                time = float(rows[k, 0, 0])
                if not contact[k]:
                    released = time
                    continue
                if time - released <= self.pause[c] or k + 1 >= len(rows):
                    continue
                speed = (rows[k, 4, 0] - rows[k + 1, 4, 0]) / rows[k + 1, 1, 0]
                if speed <= _NOTICED * self.fastest:
                    continue
                if found is None or time < found.time:
                    look = int(np.searchsorted(part.time[:, 0], rows[k + 1, 0, 0], side="right"))
                    look = min(look, len(part.time) - 1)
                    found = _Found(look=look, interface=c, row=int(k), time=time)
                break
        return found

    def _take(self, part: "_Part") -> None:
        """Keep which contacts are closed, and when the others were released."""
        self.done.append(part)
        for c, rows in enumerate(part.fine):
            contact = rows[:, 2, 0] > 0.0
            before = np.concatenate(([self.closed[c]], contact[:-1]))
            opened = np.flatnonzero(before & ~contact)
            if len(opened):
                self.released[c] = rows[opened[-1], 0, 0]
            if len(rows):
                self.closed[c] = contact[-1]

    def _begin_stretch(self) -> None:
        """Begin to stretch the steps: no state has changed by it yet."""
        laid_out, places = self.modes
        for array in self.states:
            array[..., STRETCH] = 0.0
        laid_out[places, STRETCH] = 0.0
        set_stretch(self.with_slopes, True)
        begin_stretch(self.numbers.lines, self.numbers.line_state, STRETCH)
        self.h[STRETCH] = self.h[0]
        self.origin[STRETCH] = -float(self.clock[0]) * self.h[0]

    def _end_stretch(self) -> None:
        set_stretch(self.with_slopes, False)
        end_stretch(self.numbers.lines, self.numbers.line_state, STRETCH)
        self.origin[STRETCH] += float(self.clock[0]) * self.h[STRETCH]
        self.h[STRETCH] = 0.0

    def _keep_phase(self, parts: Sequence["_Part"], found: "_Found | None") -> None:
        """Stretch the steps so that the touch in the last part keeps its phase."""
        if found is None:
            raise AssertionError("a repeated run behaves in the same way")
        rows = parts[-1].fine[found.interface]
        row, after = rows[found.row], rows[found.row + 1]
        speed = _quotient(row[4] - after[4], after[1])
        phase = _quotient(_quotient(row[4], speed), row[1])
        within = 1.0 + phase[0]
        if row[3, 0] != 0.0:  # a film bends the bodies: between its faces is another gap
            phase, within = row[2], _within(row[2, 0], after[2, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            share = -phase[_FIRST:] / phase[STRETCH]
        self._add(parts, np.where(np.isfinite(share), share, 0.0))
        row[0, _FIRST:] += within * row[1, _FIRST:]
        self.fastest = max(self.fastest, float(speed[0]))
        self.touches.append(
            Touch(
                stop=self.rows.interfaces[found.interface].component,
                time=found.time,
                speed=float(speed[0]),
                slopes=row[0, _FIRST : _FIRST + len(self.directions)].copy(),
            )
        )

    def _add(self, parts: Sequence["_Part"], share: Lanes) -> None:
        """Add to each direction the effect of steps longer by ``share``."""
        arrays = [self.origin, *self.states]
        arrays += waves_under_way(self.numbers.lines, self.numbers.line_state)
        for part in parts:
            arrays += [part.time, part.points, part.means, *part.fine]
        for array in arrays:
            array[..., _FIRST:] += share * array[..., STRETCH : STRETCH + 1]
        laid_out, places = self.modes
        state = laid_out[places]
        state[:, _FIRST:] += share * state[:, STRETCH : STRETCH + 1]
        laid_out[places] = state


@dataclass(slots=True)
class _Part:
    time: Lanes
    points: Lanes
    means: Lanes
    fine: tuple[Lanes, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kept:
    arrays: list[tuple[Any, Any]]
    modes: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    look: int
    interface: int
    row: int
    time: float


def _masses(rows: Rows) -> dict[str, float]:
    return {
        row.component: effective_mass(row, bodies)
        for row, bodies in zip(rows.interfaces, rows.meeting, strict=True)
    }


def _quotient(a: Lanes, b: Lanes) -> Lanes:
    found = (a - a[0] / b[0] * b) / b[0]
    found[0] = a[0] / b[0]
    return found


def _vertex(rows: Lanes, peak_time: float) -> tuple[Lanes | None, Lanes | None]:
    """Force and time of a peak on the parabola through three steps."""
    middle = rows[:, 0] + 0.5 * rows[:, 1]
    k = int(np.argmin(np.abs(middle[:, 0] - peak_time))) if len(rows) else 0
    if not 0 < k < len(rows) - 1:
        return None, None
    near = slice(k - 1, k + 2)
    t, f = middle[near], rows[near, 2] + rows[near, 3]
    force, time = lanes_of(()), lanes_of(())
    found = _parabola(t[:, 0], f[:, 0])
    if found is None:
        return None, None
    force[0], time[0] = found
    for lane in range(_FIRST, LANES):
        size = np.max(np.abs(f[:, lane])) + np.max(np.abs(t[:, lane])) / np.ptp(t[:, 0]) * force[0]
        if size > 0.0:
            eps = 1e-5 * abs(force[0]) / size
            plus = _parabola(t[:, 0] + eps * t[:, lane], f[:, 0] + eps * f[:, lane])
            minus = _parabola(t[:, 0] - eps * t[:, lane], f[:, 0] - eps * f[:, lane])
            if plus is None or minus is None:
                return None, None
            force[lane] = (plus[0] - minus[0]) / (2.0 * eps)
            time[lane] = (plus[1] - minus[1]) / (2.0 * eps)
    return force, time


def _parabola(t: Lanes, f: Lanes) -> tuple[float, float] | None:
    """Value and place of the highest point; None if it is not between the three."""
    a, b = (f[1] - f[0]) / (t[1] - t[0]), (f[2] - f[1]) / (t[2] - t[1])
    bend = (b - a) / (t[2] - t[0])
    if not bend < 0.0:
        return None
    place = 0.5 * (t[0] + t[1]) - 0.5 * a / bend
    if not t[0] <= place <= t[2]:
        return None
    return float(f[0] + (place - t[0]) * (a + bend * (place - t[1]))), float(place)


def _within(force: float, after: float) -> float:
    """Share of a step before the touch, from its mean contact force and that of the next step.

    With the indentation growing evenly on a linear law: ``k d^2 / 2 v h`` and ``k (d + v h / 2)``.
    """
    ratio = max(after / force, 1.0)
    return max(1.0 - (1.0 + (1.0 + ratio) ** 0.5) / ratio, 0.0)


def _with_releases(rows: Lanes) -> Lanes:
    """Let the first step after each contact begin when its gap opens, in the derivatives.

    That time lies between the ends of two steps, on a straight line.  The speed at the start of
    that step belongs to another time, so that records after it tell the opening speed.
    """
    contact = rows[:, 2, 0] > 0.0
    for k in np.flatnonzero(contact[:-1] & ~contact[1:]):
        rows[k + 1, 5] = np.nan
        if k < 1:
            continue
        end0, end1 = rows[k, 0] + rows[k, 1], rows[k + 1, 0] + rows[k + 1, 1]
        g0, g1 = rows[k, 4], rows[k + 1, 4]
        if not g1[0] > g0[0]:
            continue
        share = _quotient(-g0, g1 - g0)
        way = end1 - end0
        opened = end0 + share[0] * way + share * way[0]
        late = opened - rows[k + 1, 0]
        late[0] = 0.0
        rows[k + 1, 0, 1:] += late[1:]
        rows[k, 1, 1:] += late[1:]
    return rows
