"""Run a network: static start, time loop, channels, impacts, energy books."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack import energy_balance
from klack.errors import AccuracyWarning, ConvergenceError, InputError, require_positive
from klack.network.rows import BranchRow, ElementRow, Rows
from klack.simulation.impact_events import impact_events
from klack.simulation.limits import Limits
from klack.simulation.modal_step import ROW
from klack.simulation.network_arrays import (
    BEFORE,
    ELEMENTS_BEFORE,
    LAST,
    PORTS,
    SEEN,
    WORK,
    Y0,
    Recording,
    Scratch,
    scratch_memory,
)
from klack.simulation.network_compile import (
    CompiledNetwork,
    compile_bodies,
    compile_network,
    interface_compliance,
)
from klack.simulation.network_kernel import (
    STATUS_BRANCH,
    STATUS_DONE,
    STATUS_ELEMENT,
    STATUS_PRESSURES,
    read_stores,
    run_network,
)
from klack.simulation.network_ledger import energy_books, energy_stores, reset_books
from klack.simulation.network_recorder import Recorder
from klack.simulation.network_result import NetworkResult
from klack.simulation.rest import resting_dissipation
from klack.units import format_si

__all__ = ["simulate_network"]

Vector = NDArray[np.float64]
State = Mapping[str, NDArray[np.generic]]

_BLOCK = 16  # most fine steps between two looks at the record, without coarse steps
_BALANCE = 1e-6  # energy residual over its scale; 1e-9 is usual
_SETTLE_SHARE = 0.02  # of the longest time to rest is a step of the static start
_SETTLE_STEP = 1e-6  # [s] the same where nothing can rest on anything
_SETTLE_STEPS = 1000  # between two looks at whether the ports still move
_SETTLE_LOOKS = 100
_SETTLED = 1e-9  # way of a port between two looks over the largest way of any since the beginning
_UNDAMPED = float(np.finfo(float).tiny)  # [s/m]: known, and nothing
_CHUNK = 250_000  # fine steps between two looks at the keyboard: about 0.1 s


def simulate_network(
    rows: Rows,
    *,
    duration: float,
    step: float = 20e-9,
    coarse: int = 16,
    record: float = 0.5e-6,
    start: Literal["rest", "free"] = "rest",
    state: State | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> NetworkResult:
    """Compute a network over time.

    Parameters
    ----------
    rows : Rows
        From :meth:`klack.network.network.Network.rows`.
    duration : float [s]
        Rounded up to whole records.
    step : float [s]
        Fine step: 20 ns resolves first impacts to 0.1 %, 50 ns is enough for sweeps.
    coarse : int
        Fine steps of a coarse step, taken while nothing touches; 1 switches them off.
    record : float [s]
        Spacing of the records; rounded to whole coarse steps.
    start : "rest" or "free"
        ``"rest"``: bodies start in static equilibrium under all forces of the first moment;
        ``"free"``: undeformed, with the speeds of their rows.
    state : mapping of str to array, optional
        :attr:`NetworkResult.state` of a former run of the same network and steps, to go on from;
        ``start`` then has no meaning, time goes on, and the books count from there.
    progress : callable
        Told the fraction done.

    Raises
    ------
    InputError
        For steps that do not fit, and for a state of another network.
    ConvergenceError
        When a step fails: time, component, its state, and what to try.

    Warns
    -----
    AccuracyWarning
        When the energy balance does not close to 1e-6 of :attr:`EnergyBooks.scale`
        (:mod:`klack.energy_balance`).
    """
    for name, value in (("duration", duration), ("step", step), ("record", record)):
        require_positive(f"simulate_network: {name}", value, "s")
    if coarse < 1:
        raise InputError(
            "simulate_network: coarse",
            got=str(coarse),
            expected="1 or more",
            hint="1 switches coarse steps off, 16 is usual.",
        )
    network = compile_network(rows, step=step, coarse=coarse)
    block = coarse
    if coarse == 1:  # no coarse steps: as many fine ones at a time as divide a record
        of_record = max(1, round(record / step))
        block = next(size for size in range(_BLOCK, 0, -1) if of_record % size == 0)
    per_record = max(1, round(record / (block * step)))
    records = max(1, int(np.ceil(duration / (per_record * block * step) - 1e-9)))
    recorder = Recorder(network, records)
    clock = np.array([0, -1, 0, 0], dtype=np.int64)
    if state is not None:
        _restore(network, clock, state)
    elif start == "rest":
        large = _SETTLE_SHARE * float(np.max(network.interfaces.rest, initial=0.0)) or _SETTLE_STEP
        _settle(network, recorder.recording, step * max(1, round(large / step)))
    first_step, done_before = int(clock[0]), clock[2:4].copy()
    reset_books(network)
    _read_stores(network)
    before = energy_stores(network)
    recorder.take(0)
    limits = Limits(network, [column.name for column in recorder.points])
    time = step * np.arange(records + 1, dtype=float) * (per_record * block) + first_step * step
    chunk = max(1, _CHUNK // (per_record * block))
    begin = perf_counter()
    for first in range(0, records, chunk):
        count = min(chunk, records - first)
        failure = None
        try:
            _advance(
                network,
                recorder.recording,
                clock,
                count * per_record,
                per_record,
                first + 1,
                step,
                block,
                coarse > 1,
            )
            filled = first + count + 1
        except ConvergenceError as error:
            failure, filled = error, int(np.searchsorted(time, (error.time or 0.0) + 0.5 * step))
        points, moments = recorder.recording.points[first:filled], time[first:filled]
        limits.tell(points, moments)
        left = limits.left(points, moments)
        if left is not None:  # on the way to a failure it is the better word
            raise left[1] from failure
        if failure is not None:
            raise failure
        progress((first + count) / records)
    wall_time = perf_counter() - begin
    channels = recorder.channels()
    interfaces = recorder.interfaces()
    books = energy_books(network, before)
    scale = books.scale or 1.0
    energy_balance.check_energy_balance(
        "simulate_network",
        books.residual / scale,
        books.least_loss / scale,
        limit=_BALANCE,
        advice="a shorter step",
    )
    return NetworkResult(
        time=time,
        channels=channels,
        interfaces=interfaces,
        events=impact_events(rows, time, channels, interfaces),
        books=books,
        step=step,
        fine_steps=int(clock[2] - done_before[0]),
        coarse_steps=int(clock[3] - done_before[1]),
        wall_time=wall_time,
        state=_save(network, clock),
    )


def _advance(
    network: CompiledNetwork,
    recording: Recording,
    clock: NDArray[np.int64],
    macros: int,
    per_record: int,
    record0: int,
    step: float,
    block: int,
    allow_coarse: bool,
    *,
    settle: bool = False,
) -> None:
    report = np.zeros(3)
    status = run_network(
        macros,
        per_record,
        record0,
        clock,
        block,
        step,
        allow_coarse,
        settle,
        network.bodies,
        network.elements,
        network.branches,
        network.nodes,
        network.lines,
        network.line_state,
        network.line_books,
        network.interfaces,
        recording,
        _scratch(network, recording),
        network.books,
        network.book_kind,
        report,
    )
    if status != STATUS_DONE:
        raise _failure(network, status, report)


def _scratch(network: CompiledNetwork, recording: Recording) -> Scratch:
    return scratch_memory(
        interfaces=len(network.rows.interfaces),
        nodes=len(network.nodes.p),
        branches=len(network.rows.branches),
        ends=len(network.nodes.end_node),
        sums=recording.means.shape[1],
    )


def _settle(network: CompiledNetwork, recording: Recording, step: float) -> None:
    """Find the static start: large steps, all velocities taken out after each, until nothing moves.

    Warns
    -----
    AccuracyWarning
        When the ports still move.
    """
    bodies, _ = compile_bodies(network.rows.bodies, (step, step))
    own = interface_compliance(bodies, network.interfaces.upper, network.interfaces.lower)
    interfaces = network.interfaces._replace(G=own)
    still = replace(network, bodies=bodies, interfaces=interfaces)
    ports = slice(Y0, Y0 + bodies.first.size - 1)
    for look in range(_SETTLE_LOOKS + 1):
        before = bodies.at[ports].copy()
        clock = np.array([0, -1, 0, 0], dtype=np.int64)
        _advance(still, recording, clock, _SETTLE_STEPS, 1, 0, step, 1, False, settle=True)
        way = float(np.max(np.abs(bodies.at[ports] - before), initial=0.0))
        if way <= _SETTLED * float(np.max(np.abs(bodies.at[ports]), initial=0.0)):
            break
        if look == _SETTLE_LOOKS:
            warnings.warn(
                f"the static start was not found: ports still move by {format_si(way, 'm', 2)} in "
                f"{_SETTLE_STEPS} steps of {format_si(step, 's', 2)}. Try: look for a body that "
                "nothing holds, or a very soft spring; in Python, start='free' leaves it out.",
                AccuracyWarning,
                stacklevel=3,
            )
    real = network.bodies
    for k in range(len(real.modes)):
        begin = real.start[k]
        real.fine[begin : begin + ROW] = bodies.coarse[begin : begin + ROW]
    rows = ((Y0, Y0), (SEEN, Y0), (LAST, LAST), (BEFORE, LAST), (ELEMENTS_BEFORE, ELEMENTS_BEFORE))
    for row, source in rows:
        real.at[row : row + PORTS] = bodies.at[source : source + PORTS]
    nodes = network.nodes
    for w in range(len(nodes.wall_node)):
        i = nodes.wall_node[w]
        if i < nodes.volumes:
            nodes.held[i] += nodes.wall_area[w] * real.at[Y0 + nodes.wall_port[w]]
    nodes.mass[:] *= nodes.held / nodes.volume
    interfaces.rate[:] = 0.0
    interfaces.e[:] = interfaces.series * interfaces.force  # in equilibrium with the contacts
    closed = interfaces.gap + interfaces.e < 0.0
    interfaces.since[closed] = -np.inf
    owner = {handle: row for row in network.rows.bodies for handle in row.ports}
    for c, touching in enumerate(network.rows.interfaces):
        pair = (owner.get(touching.upper), owner.get(touching.lower))
        chi = resting_dissipation(touching, pair, -float(interfaces.gap[c] + interfaces.e[c]))
        # 0 would be for "not touched yet"
        interfaces.chi[c] = chi or (_UNDAMPED if closed[c] and interfaces.alpha[c] > 0.0 else 0.0)


def _failure(network: CompiledNetwork, status: int, report: Vector) -> ConvergenceError:
    row, code, time = int(report[0]), int(report[1]), float(report[2])
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
            "Try: a smaller step, and look whether its parameters and start values make sense.",
            time=time,
        )
    if status == STATUS_PRESSURES:
        handle = network.node_order[row]
        name = network.rows.nodes[handle].component
        return ConvergenceError(
            f"{name}: the pressures did not settle {when}.\n"
            f"State: {_numbers(network.nodes.p)} Pa.\n"
            "Try: a smaller step; a volume that no wall can close (V_0 + A y above 0); some "
            "entrained gas.",
            time=time,
        )
    return ConvergenceError(
        f"the forces at the ports did not settle {when} (ports still move by {report[0]:.2g} m).\n"
        f"State: interface gaps {_numbers(network.interfaces.gap)} m.\n"
        "Try: a smaller step; look for a stiffness far above 1e10 N/m.",
        time=time,
    )


def _numbers(values: Vector) -> str:
    return ", ".join(f"{value:.4g}" for value in values[:12]) or "none"


def _read_stores(network: CompiledNetwork) -> None:
    nodes = network.nodes
    rho = np.full(len(nodes.p), nodes.density)
    for rows, head in ((network.elements, 0), (network.branches, 3)):
        failed = read_stores(
            rows,
            head,
            network.bodies.at,
            nodes.p,
            rho,
            network.books,
            network.book_kind,
        )
        if failed >= 0:
            status = STATUS_BRANCH if head else STATUS_ELEMENT
            raise _failure(network, status, np.array([float(failed), 0.0, 0.0]))


_SAVED = {
    "bodies": ("fine", "at"),
    "elements": ("state",),
    "branches": ("state",),
    "nodes": ("mass", "held", "p", "before", "g", "hint"),
    "line_state": ("samples", "head", "memory", "cavity"),
    "interfaces": ("hint", "e", "gap", "rate", "force", "chi", "deepest", "since", "film_before"),
}


def _save(network: CompiledNetwork, clock: NDArray[np.int64]) -> dict[str, NDArray[np.generic]]:
    saved: dict[str, NDArray[np.generic]] = {"clock": clock.copy()}
    for owner, names in _SAVED.items():
        for name in names:
            saved[f"{owner}.{name}"] = getattr(getattr(network, owner), name).copy()
    saved["bodies.at"][WORK : WORK + PORTS] = 0.0  # counts from the start of each run
    return saved


def _restore(network: CompiledNetwork, clock: NDArray[np.int64], state: State) -> None:
    targets: dict[str, NDArray[np.generic]] = {"clock": clock}
    for owner, names in _SAVED.items():
        for name in names:
            targets[f"{owner}.{name}"] = getattr(getattr(network, owner), name)
    for key, target in targets.items():
        if key not in state or state[key].shape != target.shape:
            came = f"shape {state[key].shape}" if key in state else "nothing"
            raise InputError(
                f"state: {key}",
                got=came,
                expected=f"shape {target.shape}",
                hint="go on with the same network, step and coarse that the state was made with.",
            )
        target[...] = state[key]
