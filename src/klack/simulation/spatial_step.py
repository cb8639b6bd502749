"""Elements and fluid of a network in a step of bodies that others move.

Each step of :class:`klack.simulation.network_run.MovingBodies`, short or long, is what a macro step
is in :mod:`klack.simulation.network_kernel`: at its beginning forces are guessed, the bodies act,
elements and fluid answer, and the end accepts the step.  One compiled function does all three: to
take in the network is most of the time that each would take to compile.
"""

from typing import Any, NamedTuple

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
from klack.simulation.phase import STATUS_DONE, STATUS_REFUSED, STATUS_REPEAT, unfolded
from klack.simulation.row_calls import end_elements
from klack.simulation.wave_rows import waves_commit, waves_incoming

__all__ = ["BEGINS", "ENDS", "Stage", "spatial_step"]


BEGINS, ENDS = -1, -2


class Stage(NamedTuple):
    """What is done in a step of bodies that others move."""

    attempt: int  # of the bodies, whose motion is answered; or ``BEGINS``, ``ENDS``
    level: int
    steps: int  # fine ones
    t: float  # [s] at its beginning
    H: float  # [s] its length
    ratio: float = 1.0  # of its length to that of the last one
    fresh: bool = False  # after steps of another loop
    excess: float = 0.0  # [J] what the bodies got beyond what was given to them
    record: int = -1  # row of a record that ends here, below zero for none
    record_time: float = 0.0  # [s] length of this record


@njit(_nrt=False, error_model="numpy")
def spatial_step(
    stage: Stage,
    network: NetworkArrays,
    recording: Recording,
    scratch: Scratch,
    report: Vector,
) -> int:
    """Begin a step, answer the motion of the ports, or accept the step; a status."""
    bodies, elements = pointers(network.bodies), pointers(network.elements)
    fluid = Fluid(
        pointers(network.nodes),
        pointers(network.node_state),
        pointers(scratch.nodes),
        pointers(network.branches),
        pointers(scratch.flows),
    )
    if stage.attempt == BEGINS:
        _begin(stage, network, scratch, bodies, fluid)
        return STATUS_DONE
    if stage.attempt == ENDS:
        _end(stage, network, recording, scratch, bodies, elements, fluid)
        return STATUS_DONE
    contacts = Contacts(
        network.interfaces.law,
        pointers(network.interfaces),
        pointers(network.interface_state),
        pointers(scratch.interfaces),
    )
    return _answer(stage, bodies, elements, fluid, contacts, report)


@unfolded
def _begin(stage: Stage, network: NetworkArrays, scratch: Scratch, bodies: Any, fluid: Any) -> None:
    """Guess forces and pressures."""
    steps, H, ratio = stage.steps, stage.H, stage.ratio
    if stage.fresh:
        begin_fluid(fluid)
    begin_macro_step(bodies)
    if ratio != 1.0:
        respace_forces(bodies, ratio)
    guess_forces(bodies)
    guess_pressures(fluid, stage.t + H, H, ratio == 1.0)
    if fluid.nodes.ends > 0:
        lines_incoming(network.lines, network.line_state, steps, scratch.flows.c, scratch.flows.Z)
        waves_incoming(network.waves, H, scratch.flows.c, scratch.flows.Z)


@unfolded
def _answer(
    stage: Stage, bodies: Any, elements: Any, fluid: Any, contacts: Any, report: Vector
) -> int:
    """Forces of elements and fluid for the motion of the ports, and what was missed.

    Returns ``STATUS_REPEAT`` where what was missed matters, ``STATUS_REFUSED`` where a port is not
    finite.
    """
    level, H = stage.level, stage.H
    S = bodies.at
    for p in range(bodies.ports):
        S[FREE + p] = S[Y0 + p]
    step = Step(level, stage.steps, stage.t, H, 1.0 / H)
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
        if not fine or stage.attempt < FEW_REPEATS:
            return STATUS_REPEAT
        if moved > moved_by_round_off(G, bodies.ports, elements, fluid, contacts):
            report[0], report[2] = moved, stage.t
            return STATUS_REPEAT
    if not fine:
        repay(bodies, G, H)
    return STATUS_DONE


@unfolded
def _end(
    stage: Stage,
    network: NetworkArrays,
    recording: Recording,
    scratch: Scratch,
    bodies: Any,
    elements: Any,
    fluid: Any,
) -> None:
    """Accept states, masses, waves and accounts."""
    steps, H, excess = stage.steps, stage.H, stage.excess
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
    if stage.record >= 0:
        peaks = first(scratch.peaks)
        record_means(recording, stage.record, stage.record_time, sums, peaks)
