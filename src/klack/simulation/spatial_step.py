"""Elements and fluid of a network in a step of bodies that others move.

Each step of :class:`klack.simulation.network_run.MovingBodies`, short or long, is what a macro step
is in :mod:`klack.simulation.network_kernel`: :func:`begin_step` guesses forces, the bodies act,
:func:`answer_step` asks elements and fluid, and :func:`end_step` accepts the step.
"""

from klack.arrays import Vector
from klack.machine.compiling.jit import njit
from klack.network.step_function import first, pointers, shift
from klack.simulation.delay_line import lines_commit, lines_incoming
from klack.simulation.network_arrays import (
    AHEAD,
    ANSWER,
    BEGIN,
    EXCESS,
    FINE,
    FREE,
    LAST,
    PORTS,
    SEEN,
    Y0,
    Y1,
    Contacts,
    Fluid,
    NetworkArrays,
    Recording,
    Scratch,
    Step,
)
from klack.simulation.network_kernel import (
    FEW_REPEATS,
    SETTLED,
    moved_by_round_off,
    push_by_rows,
)
from klack.simulation.network_ports import (
    begin_macro_step,
    end_ports,
    finite,
    guess_forces,
    largest_missed,
    matters,
    miss,
    repay,
    respace_forces,
)
from klack.simulation.network_pressures import (
    begin_fluid,
    end_branches,
    end_ends,
    end_nodes,
    guess_pressures,
)
from klack.simulation.network_record import record_means
from klack.simulation.phase import STATUS_DONE, STATUS_REFUSED, STATUS_REPEAT
from klack.simulation.row_calls import end_elements
from klack.simulation.wave_rows import waves_commit, waves_incoming

__all__ = ["answer_step", "begin_step", "end_step"]


@njit(_nrt=False, error_model="numpy")
def begin_step(
    steps: int,
    ratio: float,
    t: float,
    H: float,
    fresh: bool,
    network: NetworkArrays,
    scratch: Scratch,
) -> None:
    """Guess forces and pressures of a step of ``H`` [s], ``steps`` fine ones, from ``t`` [s].

    ``ratio``: its length over that of the last one; ``fresh``: after steps of another loop.
    """
    bodies = pointers(network.bodies)
    fluid = Fluid(
        pointers(network.nodes),
        pointers(network.node_state),
        pointers(scratch.nodes),
        pointers(network.branches),
        pointers(scratch.flows),
    )
    if fresh:
        begin_fluid(fluid)
    begin_macro_step(bodies)
    if ratio != 1.0:
        respace_forces(bodies, ratio)
    guess_forces(bodies)
    guess_pressures(fluid, t + H, H, ratio == 1.0)
    if fluid.nodes.ends > 0:
        lines_incoming(network.lines, network.line_state, steps, scratch.flows.c, scratch.flows.Z)
        waves_incoming(network.waves, H, scratch.flows.c, scratch.flows.Z)


@njit(_nrt=False, error_model="numpy")
def answer_step(
    level: int,
    steps: int,
    attempt: int,
    t: float,
    H: float,
    network: NetworkArrays,
    scratch: Scratch,
    report: Vector,
) -> int:
    """Forces of elements and fluid for the motion of the ports, and what was missed.

    Returns ``STATUS_REPEAT`` where what was missed matters, ``STATUS_REFUSED`` where a port is not
    finite.
    """
    bodies, elements = pointers(network.bodies), pointers(network.elements)
    fluid = Fluid(
        pointers(network.nodes),
        pointers(network.node_state),
        pointers(scratch.nodes),
        pointers(network.branches),
        pointers(scratch.flows),
    )
    contacts = Contacts(
        network.interfaces.law,
        pointers(network.interfaces),
        pointers(network.interface_state),
        pointers(scratch.interfaces),
    )
    S = bodies.at
    for p in range(bodies.ports):
        S[FREE + p] = S[Y0 + p]
    step = Step(level, steps, t, H, 1.0 / H)
    status = push_by_rows(step, bodies, elements, fluid, contacts, first(report))
    if status != STATUS_DONE:
        return status
    fine = level == FINE
    G = shift(bodies.G, level * PORTS * PORTS)
    miss(bodies, G)
    share, energy = SETTLED[1 if fine else 0]
    if matters(bodies, level, share, energy, 0.0, 0.0):
        if not finite(bodies):
            return STATUS_REFUSED
        moved = largest_missed(bodies)
        if not fine or attempt < FEW_REPEATS:
            return STATUS_REPEAT
        if moved > moved_by_round_off(G, bodies.ports, elements, fluid, contacts):
            report[0], report[2] = moved, t
            return STATUS_REPEAT
    if not fine:
        repay(bodies, G, H)
    return STATUS_DONE


@njit(_nrt=False, error_model="numpy")
def end_step(
    steps: int,
    H: float,
    excess: float,
    record: int,
    record_time: float,
    network: NetworkArrays,
    recording: Recording,
    scratch: Scratch,
) -> None:
    """Accept states, masses, waves and accounts.

    ``excess`` [J] is what the bodies got beyond what was given to them; ``record`` is the row of a
    record of ``record_time`` [s] that ends here, below zero for none.
    """
    bodies, elements = pointers(network.bodies), pointers(network.elements)
    fluid = Fluid(
        pointers(network.nodes),
        pointers(network.node_state),
        pointers(scratch.nodes),
        pointers(network.branches),
        pointers(scratch.flows),
    )
    accounts, kind, sums = (
        pointers(network.accounts),
        first(network.account_kind),
        first(scratch.sums),
    )
    S = bodies.at
    end_elements(elements, H, accounts, kind, sums)
    if fluid.nodes.nodes > 0:
        end_branches(fluid, S, H, accounts, kind, shift(sums, elements.port0[elements.rows]))
        end_ends(fluid, H)
        if fluid.nodes.ends > 0:
            lines_commit(
                network.lines, network.line_state, steps, scratch.flows.q, network.accounts.lines
            )
            waves_commit(
                network.waves,
                H,
                scratch.flows.c,
                scratch.flows.Z,
                scratch.flows.q,
                network.accounts.waves,
            )
        end_nodes(fluid, H, accounts)
    for p in range(bodies.ports):
        excess += (S[LAST + p] - S[ANSWER + p]) * (S[BEGIN + p] - S[SEEN + p])
        S[SEEN + p] = S[Y1 + p]
        S[Y1 + p] += S[AHEAD + p]
    S[EXCESS] += excess
    end_ports(bodies)
    if record >= 0:
        record_means(recording, record, record_time, sums, first(scratch.peaks))
