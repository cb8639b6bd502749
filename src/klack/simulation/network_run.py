"""Run a network: static equilibrium, time loop, channels, impacts, energy balance."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil
from time import perf_counter
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.contact.step_constants import LAW_RUBBING, LAW_YIELDING
from klack.contact.yielding_law import YieldingLaw
from klack.errors import AccuracyWarning, ConvergenceError, InputError, require_positive
from klack.hydraulics.fluid_table import fluid_at
from klack.machine.progress import SoFar, drawn
from klack.network.accuracy import Accuracy
from klack.network.rows import BranchRow, ElementRow, Rows
from klack.simulation import energy_balance
from klack.simulation.control_loop import ControlLoop
from klack.simulation.delay_line import LINE_MEMORY
from klack.simulation.displaced_liquid import liquid_doubts
from klack.simulation.impact_doubts import cut_doubts, impact_doubts, line_doubts
from klack.simulation.impact_events import ImpactFinder, judged
from klack.simulation.lasting_laws import pressed_state, slider_places
from klack.simulation.limits import Limits
from klack.simulation.moving_bodies import MovingBodies
from klack.simulation.network_arrays import (
    AHEAD,
    EXCESS,
    PARTS,
    PORTS,
    SEEN,
    STORE,
    WITHIN,
    WITHIN_BEGIN,
    WORK,
    WORK_BEGIN,
    Y0,
    Y1,
    Recording,
    Scratch,
    scratch_memory,
)
from klack.simulation.network_compile import CompiledNetwork, compile_network, modal_state
from klack.simulation.network_energy import balance_since, energy_stores, reset_accounts
from klack.simulation.network_kernel import CLOCK, run_network
from klack.simulation.network_recorder import Recorder, values_now
from klack.simulation.network_result import (
    ImpactEvent,
    IncompleteRunError,
    NetworkResult,
    PressedFaces,
    StaticStart,
    StepCounts,
)
from klack.simulation.phase import STATUS_BRANCH, STATUS_DONE, STATUS_ELEMENT, STATUS_PRESSURES
from klack.simulation.row_calls import SHARE_OF_STEP, call_rows
from klack.simulation.static_start import RestState, begin_at_rest
from klack.simulation.step_sizes import StepSizes, largest_divisor, step_sizes
from klack.units import format_si

__all__ = [
    "Grid",
    "SpatialMotion",
    "Watch",
    "everything",
    "grid_of",
    "has_python_steps",
    "put_back",
    "read_rows",
    "restore_state",
    "saved_state",
    "simulate_network",
]


State = Mapping[str, NDArray[np.generic]]
Changing = NDArray[np.generic]
Kept = Sequence[tuple[Changing, Changing]]

_BLOCK = 16  # most fine steps between two looks at the record, without macro steps
_BALANCE = 1e-6  # energy residual over its scale; 1e-9 is usual
_GUIDED = 1e-3  # a loss in three dimensions: of a guide it is known as well, as in klack shots
_CHUNK = 250_000  # fine steps of a chunk: about 0.1 s
_PYTHON_CHUNK = 2_500  # the same with step functions in Python, some of which cannot step back
_LOOK = 1.5e-6  # [s] longest time between two looks of the search for impacts


class SpatialMotion(Protocol):
    """Bodies of a valve that meet point by point; all others meet at interfaces along the axis."""

    def of(self, network: CompiledNetwork, sizes: StepSizes) -> MovingBodies:
        """Return them in a network."""


@dataclass(frozen=True, slots=True)
class Watch:
    """Ends a run early.

    Parameters
    ----------
    times [s]
        At which it looks in, beside others.
    enough
        Whether the run may end at a time [s], given the impacts that are over for good.
    """

    times: Sequence[float]
    enough: Callable[[float, Sequence[ImpactEvent]], bool]


def simulate_network(
    rows: Rows,
    *,
    duration: float,
    accuracy: Accuracy = "normal",
    step: float | None = None,
    coarse: int | None = None,
    sizes: StepSizes | None = None,
    record: float = 0.5e-6,
    start: Literal["rest", "free"] = "rest",
    state: State | None = None,
    spatial: SpatialMotion | None = None,
    watch: Watch | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> NetworkResult:
    """Compute a network over time.

    Parameters
    ----------
    duration [s]
        Rounded up to whole records.
    accuracy : "normal" or "fine"
        ``"normal"``: first impacts to 0.05 % and 0.05 us; ``"fine"`` takes about four times as
        long.
    step [s]
        Fine step; by the accuracy 20 ns or 5 ns.
    coarse
        Fine steps of a macro step in flight, by default of
        :func:`klack.simulation.step_sizes.step_sizes`; 1 switches macro steps off: bodies, elements
        and fluid take every fine step together.
    sizes
        All steps, in place of what the three above choose.
    record [s]
        Spacing of the records, rounded to whole macro steps.  Impacts do not depend on it: they are
        found during the run, at most 1.5 us (or a macro step) apart.  A run takes eight bytes per
        channel and record, and 50 MB.
    start : "rest" or "free"
        ``"rest"``: bodies start in static equilibrium under all forces of the first moment;
        ``"free"``: undeformed, with the speeds of their rows.
    state
        Of a former run of the same network and steps, to continue from; ``start`` then has no
        meaning, and the energy balance starts there.
    spatial
        Bodies that meet point by point; the interfaces of the network only give names to the
        record.
    watch
        May end the run early.
    progress
        Called with the fraction done.

    Raises
    ------
    InputError
        For steps that do not fit, records larger than the memory, and a state of another network.
    IncompleteRunError
        When a step fails, or a number is not finite; it holds the result up to there.
    ConvergenceError
        The same before the first record.

    Warns
    -----
    AccuracyWarning
        When the energy balance does not close to 1e-6 of :attr:`EnergyBooks.scale`
        (:mod:`klack.simulation.energy_balance`), and when the steps do not resolve the peak force
        of the first impact on a stop to 0.05 %, or its time to 0.05 us
        (:mod:`klack.simulation.impact_doubts`).
    """
    for name, value in (("duration", duration), ("step", step), ("record", record)):
        if value is not None:
            require_positive(f"simulate_network: {name}", value, "s")
    sizes = sizes or step_sizes(rows, accuracy, step=step, coarse=coarse)
    network = compile_network(rows, sizes)
    grid = replace(grid_of(duration, sizes, record), watch=watch)
    if rows.controllers and grid.look > 1:  # instants may lie at any macro step
        grid = replace(grid, look=1, looks=grid.look * grid.looks)
    step = sizes.step
    chunk = _PYTHON_CHUNK if has_python_steps(rows) or spatial is not None else _CHUNK
    chunk = grid.divided(max(1, chunk // grid.look_steps))
    recorder = Recorder(
        network,
        records=grid.records,
        looks=grid.looks,
        chunk=chunk,
        fine=PARTS * chunk * grid.look_steps,  # touched where it is needed
    )
    clock = np.zeros(CLOCK, dtype=np.int64)
    clock[1] = -1
    begun, near = None, None
    if state is None and start == "rest":
        begun, near = begin_at_rest(network, step)
    if spatial is not None:
        network = replace(network, moving=spatial.of(network, sizes))
    if state is not None:
        restore_state(network, clock, state)
    if network.moving is not None and state is None:
        balance = None if near is None else partial(_balance, network, step, near)
        begun = network.moving.start(balance) or begun
    elif network.moving is not None:
        network.moving.resume()
    first_step, done_before = int(clock[0]), clock[2:].copy()
    finder = ImpactFinder(rows, step * first_step, step)
    known = None if state is None else state.get(_IMPACTS)
    fresh = known is None or known.shape != finder.state.shape  # of an earlier version
    if known is not None and not fresh:
        finder.state = np.asarray(known, dtype=float)
    reset_accounts(network)
    _read_stores(network)
    before = energy_stores(network)
    recorder.start(step * first_step, finder, fresh=fresh)
    if state is None:
        short, speeds = SHARE_OF_STEP * step, recorder.port_speeds()
        read_rows(network, -short, short, speeds)
        recorder.first(*values_now(network, speeds, short))
    elif _LAST in state:
        recorder.first(np.asarray(state[_LAST], dtype=float))
    limits = Limits(network, [column.name for column in recorder.points])
    start_point, start_time = recorder.recording.points[:1], np.array([step * first_step])
    limits.tell(start_point, start_time)
    left = limits.left(start_point, start_time)
    if left is not None:
        raise left[1]
    _compile(network, recorder.recording, clock, grid)
    control = None
    if rows.controllers:
        before_now = first_step // grid.look_steps  # a run ends with a record, so with a look
        control = ControlLoop(network, recorder, step * grid.look_steps, before_now)
        if state is None or not control.recall(state):
            control.act(0, recorder.start_values())
    begin = perf_counter()
    failure = _run(network, recorder, finder, limits, clock, grid, progress, control)
    wall_time = perf_counter() - begin
    records = recorder.looked // grid.looks
    if failure is not None and not records:
        raise failure
    time = step * (first_step + np.arange(records + 1) * (grid.looks * grid.look_steps))
    books = balance_since(network, before)
    channels = recorder.channels(records)
    interfaces = recorder.interfaces()
    events, since = judged(
        finder.events(channels),
        rows,
        interfaces,
        float(time[-1]),
        np.asarray((state or {}).get(_SINCE, ())),
        {} if network.moving is None else network.moving.turning(),
    )
    finder.told()
    if network.moving is not None:
        for row, added in zip(rows.interfaces, network.moving.gap(), strict=True):
            channels[f"{row.component} gap"].values[:] += added
        channels |= network.moving.channels(time.astype(float))
    result = NetworkResult(
        path=None if network.moving is None else network.moving.path,
        paths=() if network.moving is None else tuple(network.moving.paths),
        time=time.astype(float),
        channels=channels,
        interfaces=interfaces,
        events=events,
        books=books,
        sizes=sizes,
        steps=StepCounts(*(int(count) for count in clock[2:] - done_before)),
        wall_time=wall_time,
        state=saved_state(network, clock)
        | {_IMPACTS: finder.state, _SINCE: since, _LAST: recorder.last(records)}
        | ({} if control is None else control.memory()),
        failure="" if failure is None else str(failure),
        start=begun,
        faces=_pressed_faces(network),
        spatial_impacts=()
        if network.moving is None
        else network.moving.recorded_impacts(step * int(clock[0])),
    )
    for name, faces in result.faces.items():
        if faces.force > faces.known_force:
            warnings.warn(
                f"the faces of '{name}' were pressed by {format_si(faces.force, 'N', 3)}, but "
                f"their yield is computed only up to {format_si(faces.known_force, 'N', 3)}; "
                f"beyond that their law is a straight line. Raise the speed of stop '{name}'.",
                AccuracyWarning,
                stacklevel=2,
            )
    doubts = [*line_doubts(network, step * first_step)]
    doubts += liquid_doubts(rows, channels, step * grid.looks * grid.look_steps)
    doubts += cut_doubts(events) if failure is None else ()
    for doubt in doubts:
        warnings.warn(doubt, AccuracyWarning, stacklevel=2)
    if network.moving is None:
        rising = _rising(network) if sizes.near > 1 else ()
        for doubt in impact_doubts(result.events, result.interfaces, step, rising):
            warnings.warn(doubt, AccuracyWarning, stacklevel=2)
    if failure is not None:
        raise IncompleteRunError(str(failure), result) from failure
    scale = books.scale or 1.0
    owed = float(network.bodies.at[EXCESS])  # a small one is taken back by the next steps
    owed = owed if abs(owed) > _BALANCE * scale else 0.0
    energy_balance.check_energy_balance(
        "simulate_network",
        (books.residual - owed) / scale,
        books.least_loss / scale,
        limit=_BALANCE,
        advice="a shorter step",
        loss_limit=None if network.moving is None else _GUIDED,
    )
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """How fine steps make blocks, blocks looks, and looks records; and who looks in."""

    sizes: StepSizes
    block: int  # fine steps
    look: int  # blocks
    looks: int  # of a record
    records: int
    watch: Watch | None = None

    @property
    def step(self) -> float:
        """Fine step [s]."""
        return self.sizes.step

    @property
    def look_steps(self) -> int:
        """Fine steps between two looks."""
        return self.look * self.block

    def divided(self, chunk: int) -> int:
        """Looks of a chunk near this one, of which equal ones make the run, in whole records."""
        if chunk < self.looks:
            return chunk
        return self.looks * -(-self.records // max(1, round(self.records * self.looks / chunk)))

    def to_pause(self, looked: int, times: Sequence[float]) -> int:
        """Looks from here to the next of some times [s], or to the end."""
        ends = [ceil(t / (self.look_steps * self.step)) for t in times]
        ends.append(self.records * self.looks)
        return min(end for end in ends if end > looked) - looked


def grid_of(duration: float, sizes: StepSizes, record: float) -> Grid:
    """Choose blocks and looks of a run: see :func:`simulate_network`."""
    step, block = sizes.step, sizes.coarse
    if block == 1:  # no macro steps: as many fine ones at a time as divide a record
        block = largest_divisor(max(1, round(record / step)), _BLOCK)
    of_record = max(1, round(record / (block * step)))
    look = largest_divisor(of_record, int(_LOOK / (block * step)))
    return Grid(
        sizes=sizes,
        block=block,
        look=look,
        looks=of_record // look,
        records=max(1, int(np.ceil(duration / (of_record * block * step) - 1e-9))),
    )


def has_python_steps(rows: Rows) -> bool:
    """Whether the time loop calls Python, or an FMU."""
    steps = [row.step for row in rows.elements] + [row.step for row in rows.branches]
    return any(hasattr(step, "errors") for step in steps)


def _run(
    network: CompiledNetwork,
    recorder: Recorder,
    finder: ImpactFinder,
    limits: Limits,
    clock: NDArray[np.int64],
    grid: Grid,
    progress: Callable[[float], None],
    control: ControlLoop | None,
) -> ConvergenceError | None:
    """Run chunk by chunk; the error that ended it early, with the record before."""
    looks = grid.records * grid.looks
    chunk = len(recorder.recording.points)
    chunk -= chunk % grid.looks if chunk > grid.looks else 0
    while recorder.looked < looks:
        # a chunk ends with a record if it can, wherever the run began
        to_record = grid.looks - recorder.looked % grid.looks
        count = min(chunk, looks - recorder.looked if chunk >= grid.looks else to_record)
        if grid.watch is not None:
            count = min(count, grid.to_pause(recorder.looked, grid.watch.times))
        if control is not None:
            count = min(count, control.next(recorder.looked))
        kept = everything(network, clock)
        good, failure = _try_chunk(network, recorder, limits, clock, grid, count)
        if failure is not None:
            good, failure = _up_to(network, recorder, limits, clock, grid, kept, good, failure)
        if good:
            steps = int(clock[0]) + grid.look_steps * np.arange(1 - good, 1)
            times = np.asarray(grid.step * steps, dtype=float)
            limits.tell(recorder.recording.points[:good], times)
            recorder.take(times, finder)
            if control is not None and failure is None:
                try:
                    control.act(recorder.looked, recorder.values(good))
                except ConvergenceError as error:  # of an FMU: what there is is kept
                    failure = error
        progress(recorder.looked / looks)
        drawn(progress, partial(_so_far, recorder, grid, int(clock[0])))
        now = grid.look_steps * grid.step * recorder.looked
        if failure is not None or (grid.watch and grid.watch.enough(now, finder.settled)):
            return failure
    return None


def _so_far(recorder: Recorder, grid: Grid, step: int) -> list[SoFar]:
    """All channels up to a step, in SI: a reporter chooses."""
    records = recorder.looked // grid.looks
    if records < 2:
        return []
    first = step - recorder.looked * grid.look_steps
    steps = first + np.arange(records + 1) * (grid.looks * grid.look_steps)
    time = np.asarray(grid.step * steps, dtype=float)
    return [
        SoFar(title=name, x=time, y=channel.values, x_label="time [s]")
        for name, channel in recorder.channels(records).items()
    ]


def _up_to(
    network: CompiledNetwork,
    recorder: Recorder,
    limits: Limits,
    clock: NDArray[np.int64],
    grid: Grid,
    kept: Kept,
    good: int,
    failure: ConvergenceError,
) -> tuple[int, ConvergenceError]:
    """Compute a chunk again without the looks that failed, so that all of it is of one moment.

    Returns the looks done, 0 where nothing can be repeated (an FMU does not go back), and the error
    of the first look that fails.
    """
    low, high = 0, good + 1
    count = good
    try:
        while high - low > 1:
            put_back(kept)
            most, again = _try_chunk(network, recorder, limits, clock, grid, count)
            if again is None:
                low, done = count, count
            else:
                high, done, failure = min(count, most + 1), 0, again
            count = (low + high) // 2
        if low and done != low:
            put_back(kept)
            low, _ = _try_chunk(network, recorder, limits, clock, grid, low)
    except InputError:
        low = 0
    if not low:
        put_back(kept)
    return low, failure


def _try_chunk(
    network: CompiledNetwork,
    recorder: Recorder,
    limits: Limits,
    clock: NDArray[np.int64],
    grid: Grid,
    count: int,
) -> tuple[int, ConvergenceError | None]:
    """Advance by so many looks; how many are good, and why not all."""
    report, first = np.zeros(3), int(clock[0])
    good = count
    failure: ConvergenceError | None = None
    recorder.begin()
    try:
        _advance(
            network,
            recorder.recording,
            clock,
            grid,
            count * grid.look,
            report=report,
        )
    except ConvergenceError as error:
        good = max(0, (round(report[2] / grid.step) - first) // grid.look_steps)
        failure = error
    times = grid.step * (first + grid.look_steps * np.arange(1.0, good + 1.0))
    left = limits.left(recorder.recording.points[:good], times)
    if left is not None:  # on the way to a failure it is the better word
        good, failure = left
    wrong = recorder.first_not_finite(good)
    if wrong is not None:
        good = wrong[0]
        failure = _not_a_number(wrong[1], grid.step * (first + (good + 1) * grid.look_steps))
    elif failure is None and (name := _not_finite_account(network)):
        good = count - 1  # or fewer
        failure = _not_a_number(name, grid.step * int(clock[0]))
    return good, failure


def _compile(
    network: CompiledNetwork, recording: Recording, clock: NDArray[np.int64], grid: Grid
) -> None:
    """Compile or load the time loop by a run of no steps, not counted as wall time."""
    _advance(network, recording, clock, grid, 0, report=np.zeros(3))


def _advance(
    network: CompiledNetwork,
    recording: Recording,
    clock: NDArray[np.int64],
    grid: Grid,
    macros: int,
    *,
    report: Vector,
) -> None:
    if network.moving is not None:
        status = network.moving.advance(
            recording,
            scratch_of(network, recording),
            clock,
            grid.block,
            grid.look,
            macros // grid.look,
            report,
        )
        if status != STATUS_DONE:
            raise _failure(network, status, report)
        return
    status = run_network(
        macros,
        grid.look,
        clock,
        grid.block,
        grid.sizes.near,
        grid.sizes.middle,
        0.0,
        grid.step,
        grid.sizes.coarse > 1,
        network.arrays,
        recording,
        scratch_of(network, recording),
        report,
    )
    if status != STATUS_DONE:
        raise _failure(network, status, report)


def scratch_of(network: CompiledNetwork, recording: Recording) -> Scratch:
    """Memory of the time loop of a network."""
    return scratch_memory(
        interfaces=network.interfaces.interfaces,
        sliders=network.sliders.sliders,
        nodes=network.nodes.nodes,
        links=len(network.nodes.later),
        branches=network.branches.rows,
        ends=network.nodes.ends,
        sums=recording.means.shape[1],
    )


def _failure(network: CompiledNetwork, status: int, report: Vector) -> ConvergenceError:
    time = float(report[2])
    for wave, why in zip(network.rows.waves, network.waves.failed, strict=True):
        if why != 0:
            words = wave.failures.get(int(why), f"status {why} of its step function")
            return ConvergenceError(
                f"{wave.component}: {words}, {format_si(time, 's', 8)} after the start.\n"
                "Try: a smaller step; some entrained gas; a slower change of pressure."
            )
    wrong = _not_finite_part(network)
    if wrong:
        return _not_a_number(wrong, time)
    row, code = int(report[0]), int(report[1])
    when = f"at {format_si(time, 's', 8)}"
    if status in (STATUS_ELEMENT, STATUS_BRANCH):
        rows: list[ElementRow] | list[BranchRow]
        rows = network.rows.elements if status == STATUS_ELEMENT else network.rows.branches
        failed = rows[row]
        errors = getattr(failed.step, "errors", [])
        if errors:
            raise errors.pop(0)
        data = network.elements if status == STATUS_ELEMENT else network.branches
        values = data.state[data.state0[row] : data.state0[row + 1]]
        words = failed.failures.get(code, f"status {code} of its step function")
        return ConvergenceError(
            f"{failed.component}: {words}, {when}.\nState: {_numbers(values)}.\n"
            "Try: a smaller step, and check its parameters and start values."
        )
    if status == STATUS_PRESSURES:
        handle = network.node_order[row]
        name = network.rows.nodes[handle].component
        return ConvergenceError(
            f"{name}: the pressures did not converge {when}.\n"
            f"State: {_numbers(network.node_state.p)} Pa.\n"
            "Try: a smaller step; a volume that stays above 0 (V_0 + A y); some "
            "entrained gas."
        )
    missed = np.abs(network.bodies.at[AHEAD : AHEAD + len(network.ports)])
    port = network.ports[int(np.argmax(missed))]
    moved = format_si(float(missed.max()), "m", 2)
    return ConvergenceError(
        f"{port.component}: the forces at its ports did not converge {when} ('{port.port}' still "
        f"moves by {moved}).\nState: interface gaps {_numbers(network.interface_state.gap)} m.\n"
        f"Try: a smaller step; a stiffness at '{port.component}' may be too large for its mass."
    )


def _not_a_number(name: str, time: float) -> ConvergenceError:
    return ConvergenceError(
        f"{name}: not a finite number at {format_si(time, 's', 8)}.\n"
        "Try: check the parameters of this component; a smaller step."
    )


def _not_finite_part(network: CompiledNetwork) -> str:
    """Component whose last step gave a number that is not finite; else empty."""
    elements = [row.component for row in network.rows.elements]
    branches = [row.component for row in network.rows.branches]
    for names, data in ((elements, network.elements), (branches, network.branches)):
        for k, name in enumerate(names):
            if not np.all(np.isfinite(data.outputs[data.output0[k] : data.output0[k + 1]])):
                return name
    for i, handle in enumerate(network.node_order):
        if not np.isfinite(network.node_state.p[i]):
            return f"{network.rows.nodes[handle].component} pressure"
    for c, contact in enumerate(network.rows.interfaces):
        if not np.isfinite(network.interface_state.force[c]):
            return f"{contact.component} force"
    for s, slider in enumerate(network.rows.sliders):
        if not np.isfinite(network.slider_state.force[s]):
            return f"{slider.component} force"
    for i, port in enumerate(network.ports):
        if not np.isfinite(network.bodies.at[Y1 + i]):
            return f"{port.component}.{port.port} displacement"
    return ""


def _not_finite_account(network: CompiledNetwork) -> str:
    """Component whose state or energy is not finite; else empty."""
    of_fluid = (
        (network.line_state.samples, "waves in a line"),
        (network.accounts.lines, "energy of a line"),
        (network.accounts.waves, "energy of a line in cells"),
        (network.node_state.mass, "mass in a chamber"),
        (network.accounts.implicit, "energy of a chamber"),
        (network.accounts.contact, "energy of a contact"),
        (network.accounts.film, "energy of a film"),
        (network.accounts.friction, "energy of a friction"),
    )
    bodies, ports = network.bodies, len(network.ports)
    parts = [bodies.laid_out[: bodies.size], bodies.at[Y1 : Y1 + ports], network.accounts.rows]
    parts += [network.elements.outputs, network.branches.outputs, network.node_state.p]
    parts += [network.interface_state.force, network.slider_state.force]
    if np.isfinite(np.concatenate([*parts, *(values.ravel() for values, _ in of_fluid)])).all():
        return ""
    for name, value in zip(network.account_names, network.accounts.rows, strict=True):
        if not np.isfinite(value):
            return name
    part = _not_finite_part(network)
    if part:
        return part
    for b, row in enumerate(network.rows.bodies):
        if not all(np.all(np.isfinite(x)) for x in modal_state(network, b)):
            return row.component
    return next((what for values, what in of_fluid if not np.all(np.isfinite(values))), "")


def _numbers(values: Vector) -> str:
    return ", ".join(f"{value:.4g}" for value in values[:12]) or "none"


def read_rows(network: CompiledNetwork, t: float, h: float, speeds: Vector, row: int = Y0) -> None:
    """Ask all rows for a step that ends in the present state, with displacements in ``row``."""
    table, p = network.nodes.settled, network.node_state.p
    rho = np.array([fluid_at(table, pressure, 0)[0] for pressure in p])
    if network.nodes.slow_gas:
        state, volumes = network.node_state, network.nodes.volumes
        rho[:volumes] = state.mass / state.held
    at = network.bodies.at[row : row + len(speeds)]
    for rows, status in (
        (network.elements, STATUS_ELEMENT),
        (network.branches, STATUS_BRANCH),
    ):
        failed, code = call_rows(rows, t, h, at, speeds, p, rho)
        if failed >= 0:
            raise _failure(network, status, np.array([float(failed), float(code), 0.0]))


def _read_stores(network: CompiledNetwork) -> None:
    # where elements saw their ports last, a little behind the bodies
    read_rows(network, 0.0, 0.0, np.zeros(len(network.ports) + 1), SEEN)
    for rows in (network.elements, network.branches):
        for k in range(rows.rows):
            ports = rows.port0[k + 1] - rows.port0[k]
            first = rows.output0[k] + rows.head + ports + rows.states[k]
            for j in range(rows.accounts[k]):
                account = rows.account0[k] + j
                if network.account_kind[account] == STORE:
                    network.accounts.rows[account] = rows.outputs[first + j]


_IMPACTS = "impacts.under_way"
_SINCE = "impacts.besides"
_SLIDERS = "sliders."
_LAST = "record.last"
_RECORDS = "moving.impact_"


def _balance(network: CompiledNetwork, step: float, near: RestState, shift: Vector) -> StaticStart:
    return begin_at_rest(network, step, near, shift)[0]


def _changing(network: CompiledNetwork, clock: NDArray[np.int64]) -> dict[str, Changing]:
    """All arrays that a step changes and the next one starts from, by their stored names."""
    line, faces = network.line_state, network.interfaces
    yielding = np.flatnonzero(faces.kind == LAW_YIELDING)
    groups = {
        "bodies": {"fine": network.bodies.laid_out[: network.bodies.size], "at": network.bodies.at},
        "elements": {"state": network.elements.state},
        "branches": {"state": network.branches.state},
        "nodes": {
            name: array
            for name, array in network.node_state._asdict().items()
            if network.nodes.slow_gas or name not in ("free", "dissolved")
        },
        "line_state": {name: getattr(line, name) for name in LINE_MEMORY},
        "waves": {"state": network.waves.state} if network.waves.rows else {},
        "interfaces": network.interface_state._asdict(),
        "sliders": network.slider_state._asdict(),
        "laws": {
            network.rows.interfaces[c].component: slider_places(faces.law, int(faces.law0[c]))
            for c in np.flatnonzero(faces.kind == LAW_RUBBING)
        },
        "faces": {
            network.rows.interfaces[c].component: pressed_state(faces.law, int(faces.law0[c]))
            for c in yielding
        },
        "gaps": {network.rows.interfaces[c].component: faces.gap0[c : c + 1] for c in yielding},
    }
    arrays = {
        f"{owner}.{name}": array for owner, group in groups.items() for name, array in group.items()
    }
    if network.moving is not None:
        arrays |= {f"moving.{name}": array for name, array in network.moving.changing().items()}
    return {"clock": clock} | arrays


def _rising(network: CompiledNetwork) -> list[str]:
    """Stops whose force rises and falls within sub-steps while they are closed."""
    faces, rows = network.interfaces, network.rows.interfaces
    elastic = (faces.alpha == 0.0) & (faces.kind < LAW_RUBBING) & (network.bodies.driven == 0)
    return [row.component for row, rises in zip(rows, elastic, strict=False) if rises]


def _pressed_faces(network: CompiledNetwork) -> dict[str, PressedFaces]:
    at, found = network.interfaces, {}
    for c, row in enumerate(network.rows.interfaces):
        if isinstance(row.law, YieldingLaw):
            deep, parted = pressed_state(at.law, int(at.law0[c]))
            found[row.component] = PressedFaces(
                set=float(parted),
                force=float(row.law.after(float(deep)).force(deep)),
                known_force=float(row.law.closing[-1]),
            )
    return found


def everything(network: CompiledNetwork, clock: NDArray[np.int64]) -> Kept:
    """All arrays that a step changes, and their present content."""
    arrays = [*_changing(network, clock).values(), *network.accounts]
    return [(array, array.copy()) for array in arrays]


def put_back(kept: Kept) -> None:
    """Go back to what :func:`everything` kept."""
    for array, values in kept:
        array[...] = values


def saved_state(network: CompiledNetwork, clock: NDArray[np.int64]) -> dict[str, Changing]:
    """All that a run needs to continue from here, without its record."""
    saved = {name: array.copy() for name, array in _changing(network, clock).items()}
    for row in (WORK, WORK_BEGIN):  # count from the start of each run
        saved["bodies.at"][row : row + PORTS] = 0.0
    saved["bodies.at"][[WITHIN, WITHIN_BEGIN]] = 0.0
    return saved


def restore_state(network: CompiledNetwork, clock: NDArray[np.int64], state: State) -> None:
    """Put a network into a :func:`saved_state`, in place."""
    for key, target in _changing(network, clock).items():
        if key not in state and key.startswith((_SLIDERS, _RECORDS)):  # of an earlier version
            continue
        if key not in state or state[key].shape != target.shape:
            came = f"shape {state[key].shape}" if key in state else "nothing"
            raise InputError(
                f"state: {key}",
                got=came,
                expected=f"shape {target.shape}",
                hint="continue with the network, step, coarse and version of klack of the "
                "stored state.",
            )
        target[...] = state[key]
    if f"{_SLIDERS}seen" not in state:  # of an earlier version
        rows, at = network.sliders, network.bodies.at[Y0:]
        network.slider_state.seen[:] = at[rows.upper] - at[rows.lower]
