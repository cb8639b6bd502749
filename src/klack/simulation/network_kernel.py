"""The time loop of a network: bodies, elements, fluid nodes, branches, lines, contacts and films.

One step of length ``h`` (or ``M h`` while nothing touches):

1. Every mode moves exactly, without the forces of this step.
2. Sweeps: all elements, then all pressures (Newton), then all interfaces find their mean forces
   from the port displacements at both ends of the step; the forces move the ports by ``G F``;
   again, until no port moves by more than a small share of the way in the step.  Elements and
   fluid live on the displacements that they saw last, so what is left of that change costs energy
   in second order: the change of their forces times it, a small share of the work of the step.
3. States, masses, waves and energy accounts are taken over; the forces stay pending for the next
   pass over the modes.

A coarse step is tried when all interfaces are far apart or at rest; if it ends in a contact, in a
release or in a noticeable film, it is discarded and done again in fine steps.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit
from klack.network.step_function import first, pointers, shift
from klack.simulation.delay_line import Lines, LineState, lines_commit, lines_incoming
from klack.simulation.network_arrays import (
    ELEMENTS,
    FORCE,
    PORTS,
    Accounts,
    Bodies,
    Contacts,
    FlowTrial,
    Fluid,
    NetworkArrays,
    Recording,
    Scratch,
    Step,
    StepRows,
)
from klack.simulation.network_elements import end_elements, push_by_elements
from klack.simulation.network_interfaces import (
    begin_interfaces,
    changed_by_interfaces,
    coarse_step_holds,
    end_interfaces,
    forget_interfaces,
    level_of_step,
    push_by_interfaces,
    solve_interfaces,
)
from klack.simulation.network_ports import (
    apply_pending,
    begin_ports,
    end_ports,
    finite,
    forget_forces,
    guess_forces,
    move_free,
    move_ports,
    move_ports_by_guess,
    row_length,
    settled_ports,
    start_coarse,
)
from klack.simulation.network_pressures import (
    begin_fluid,
    end_branches,
    end_ends,
    end_nodes,
    guess_pressures,
    push_by_fluid,
    solve_pressures,
)
from klack.simulation.network_record import record_means, record_points
from klack.simulation.phase import phase, unfolded
from klack.simulation.step_status import STATUS_DONE, STATUS_FORCES, STATUS_REFUSED

__all__ = ["run_network"]

Index = NDArray[np.int64]
Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_SETTLED = 5e-5  # last change of a port displacement over the longest way of a port in the step
_SETTLED_COARSE = 3e-8  # the same for a coarse step, whose forces change more
_FORCE_ROUND_OFF = 2e-15  # of each force that acts, whatever the others leave of their sum
_FEW_SWEEPS = 8  # are enough, unless what still changes is round-off
_MOST_SWEEPS = 200
_COARSE_SWEEPS = 20  # without success: fine steps


class _Loop(NamedTuple):
    """All that the loop works on; bundles of pointers but for lines and records."""

    bodies: Bodies
    elements: StepRows
    fluid: Fluid
    contacts: Contacts
    lines: Lines
    line_state: LineState
    ends: FlowTrial
    accounts: Accounts
    kind: Index
    line_losses: Matrix
    recording: Recording
    sums: Vector  # of elements, then branches, then interfaces
    peaks: Vector


# without the runtime of numba there is no counting of references, half the time of a step
@njit(_nrt=False, error_model="numpy")
def run_network(
    macros: int,
    per_record: int,
    clock: Index,
    M: int,
    h: float,
    allow_coarse: bool,
    network: NetworkArrays,
    recording: Recording,
    scratch: Scratch,
    report: Vector,
) -> int:
    """Integrate ``macros`` blocks of ``M`` fine steps, in place.

    ``clock`` counts: time in fine steps, level of the last step, fine and coarse steps done;
    ``report`` gets the row of a failure, its status and its time.
    """
    loop = _begin(network, recording, scratch)
    bodies, contacts = loop.bodies, loop.contacts
    now, last_level = clock[0], clock[1]
    in_record, record, record_time = 0, 0, 0.0
    fine_steps, coarse_steps = 0, 0
    inverse_h = 1.0 / h
    for _macro in range(macros):
        level = level_of_step(contacts, now * h, M * h) if allow_coarse else 0
        if level == 1:
            start_coarse(bodies)
        done = 0
        while done < M:
            steps = M if level == 1 else 1
            rate = inverse_h if level == 0 else inverse_h / M
            step = Step(level, steps, now * h, steps * h, rate)
            status = _try_step(step, loop, level == last_level, first(report))
            if status > STATUS_DONE:
                return status
            # a coarse step may not meet what it cannot see
            if level == 1 and (status == STATUS_REFUSED or not coarse_step_holds(contacts)):
                level, last_level = 0, -1
                forget_forces(bodies)
                forget_interfaces(contacts)
                continue
            _end_step(step, loop)
            last_level = level
            done += steps
            now += steps
            coarse_steps += level
            fine_steps += 1 - level
        apply_pending(bodies, level)
        in_record += 1
        record_time += M * h
        if in_record == per_record:
            record_means(recording, record, record_time, loop.sums, loop.peaks)
            record_points(
                recording,
                record,
                network.bodies,
                network.node_state.p,
                network.elements.state,
                network.branches.state,
                network.interface_state.gap,
            )
            record += 1
            in_record, record_time = 0, 0.0
    clock[0], clock[1] = now, last_level
    clock[2] += fine_steps
    clock[3] += coarse_steps
    return STATUS_DONE


@unfolded
def _begin(network: NetworkArrays, recording: Recording, scratch: Scratch) -> _Loop:
    """Begin a run: no force is pending, no density known, nothing summed."""
    loop = _Loop(
        bodies=pointers(network.bodies),
        elements=pointers(network.elements),
        fluid=Fluid(
            pointers(network.nodes),
            pointers(network.node_state),
            pointers(scratch.nodes),
            pointers(network.branches),
            pointers(scratch.flows),
        ),
        contacts=Contacts(
            network.interfaces.law,
            pointers(network.interfaces),
            pointers(network.interface_state),
            pointers(scratch.interfaces),
        ),
        lines=network.lines,
        line_state=network.line_state,
        ends=scratch.flows,
        accounts=pointers(network.accounts),
        kind=first(network.account_kind),
        line_losses=network.accounts.lines,
        recording=recording,
        sums=first(scratch.sums),
        peaks=first(scratch.peaks),
    )
    begin_ports(loop.bodies)
    begin_interfaces(loop.contacts, loop.peaks)
    begin_fluid(loop.fluid)
    for k in range(scratch.sums.size):
        loop.sums[k] = 0.0
    return loop


@unfolded
def _try_step(step: Step, loop: Any, straight: bool, report: Any) -> int:
    """One step up to what it would change; ``straight`` guesses on the line of the last two.

    Returns
    -------
    int
        ``STATUS_DONE``; ``STATUS_REFUSED`` for a coarse step that does not settle; or what failed.
    """
    bodies, fluid = loop.bodies, loop.fluid
    move_free(bodies, step.level)
    if straight:
        guess_forces(bodies)
    else:
        forget_forces(bodies)
    guess_pressures(fluid, step.t + step.H, straight)
    if fluid.nodes.ends > 0:
        lines_incoming(loop.lines, loop.line_state, step.steps, loop.ends.c, loop.ends.Z)
    status = _settle(step, bodies, loop.elements, fluid, loop.contacts, report)
    bodies.at[FORCE + bodies.ports] = 0.0  # what pushes the ground moves nothing
    return status


@unfolded
def _end_step(step: Step, loop: Any) -> None:
    """Take over states, masses, waves and accounts; the forces stay pending."""
    bodies, elements, fluid = loop.bodies, loop.elements, loop.fluid
    accounts, kind, H = loop.accounts, loop.kind, step.H
    sums_of_branches = shift(loop.sums, elements.port0[elements.rows])
    sums_of_interfaces = shift(sums_of_branches, fluid.branches.rows)
    end_elements(elements, H, accounts, kind, loop.sums)
    if fluid.nodes.nodes > 0:
        end_branches(fluid, bodies.at, H, accounts, kind, sums_of_branches)
        end_ends(fluid, H)
        if fluid.nodes.ends > 0:
            lines_commit(loop.lines, loop.line_state, step.steps, loop.ends.q, loop.line_losses)
        end_nodes(fluid, accounts)
    end_interfaces(
        loop.contacts, bodies.at, step, accounts, loop.recording, sums_of_interfaces, loop.peaks
    )
    end_ports(bodies)


@unfolded
def _settle(step: Step, bodies: Any, elements: Any, fluid: Any, contacts: Any, report: Any) -> int:
    """Sweep over elements, pressures and interfaces until no port moves any more.

    Returns
    -------
    int
        ``STATUS_DONE``; ``STATUS_REFUSED`` for a coarse step that does not settle; or what failed.
    """
    S = bodies.at
    G = shift(bodies.G, step.level * PORTS * PORTS)
    share = _SETTLED if step.level == 0 else _SETTLED_COARSE
    for sweep in range(_MOST_SWEEPS):
        move_ports_by_guess(bodies, G)
        status = _push_by_rows(step, bodies, elements, fluid, report)
        if status != STATUS_DONE:
            return status
        push_by_interfaces(contacts, S)
        moved = move_ports(bodies, G)
        moved = solve_interfaces(contacts, bodies, G, step, moved)
        left, work = changed_by_interfaces(contacts, S)
        if settled_ports(bodies, moved, share, left, work):
            return STATUS_DONE
        if sweep >= _FEW_SWEEPS and moved <= _moved_by_round_off(
            G, bodies.ports, elements, fluid, contacts
        ):
            return STATUS_DONE
        if step.level == 1 and sweep >= _COARSE_SWEEPS:
            return STATUS_REFUSED
        if sweep == _MOST_SWEEPS - 1 or (sweep == 0 and not finite(bodies)):
            report[0], report[2] = moved, step.t
            return STATUS_FORCES
    return STATUS_FORCES


@phase
def _push_by_rows(step: Step, bodies: Any, elements: Any, fluid: Any, report: Any) -> int:
    """Forces of elements and fluid for the displacements of this sweep."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[FORCE + i] = 0.0
    status = push_by_elements(elements, S, step, report)
    if status == STATUS_DONE and fluid.nodes.nodes > 0:
        status = solve_pressures(fluid, S, step, report)
        push_by_fluid(fluid, S)
    for i in range(bodies.ports):
        S[ELEMENTS + i] = S[FORCE + i]
    return status


@phase
def _moved_by_round_off(G: Any, ports: int, elements: Any, fluid: Any, contacts: Any) -> float:
    """Displacement that the round-off of the forces of a sweep makes [m], the largest of a port.

    Forces that hold each other in balance leave a sum of nothing, but not without the round-off of
    each.  A pressure that follows from the mass in a volume is known to the round-off of that mass
    times the bulk modulus ``rho dp/drho``.  ``G`` of its level is zero between bodies.
    """
    nodes, trial, largest = fluid.nodes, fluid.trial, 0.0
    for port in range(ports):
        row = shift(G, port * PORTS)
        total = _moved_by_rows(row, elements, 0.0)
        total = _moved_by_rows(row, fluid.branches, total)
        for w in range(nodes.walls):
            i = nodes.wall_node[w]
            known = abs(trial.p[i]) + nodes.ambient
            if i < nodes.volumes and trial.slope[i] > 0.0:
                known += trial.rho[i] / trial.slope[i]
            total += abs(row[nodes.wall_port[w]] * nodes.wall_area[w]) * known
        for c in range(contacts.rows.interfaces):
            way = row[contacts.rows.upper[c]] - row[contacts.rows.lower[c]]
            total += abs(way * contacts.trial.force[c])
        largest = max(largest, total)
    return _FORCE_ROUND_OFF * largest


@phase
def _moved_by_rows(G: Any, rows: Any, total: float) -> float:
    """Add what each force of elements or branches moves one port by, whatever its sign."""
    for k in range(rows.rows):
        o0, q0 = rows.output0[k] + rows.head, rows.port0[k]
        for j in range(q0, rows.port0[k + 1]):
            total += abs(G[rows.ports[j]] * rows.outputs[o0 + j - q0])
    return total
