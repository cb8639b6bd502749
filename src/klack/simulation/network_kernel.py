"""The time loop of a network: bodies, elements, fluid nodes, branches, lines, contacts and films.

One macro step ``H = M h`` while elements and fluid are slow beside it:

1. **Guess** the forces of elements and fluid, their mean over the macro step and an even rise.
2. **Act**: modes move exactly; contacts, films and dry friction find their mean forces.  Far apart
   or at rest, in one step of ``H``; while closed contacts swing, in one or a few in which their
   forces rise or fall; while films of open ones change slowly, in a few; else in sub-steps of a few
   fine ones ``h``, or of one where films change fast; the force of a closed elastic contact rises
   or falls in them as well.  A sub-step in which
   a contact closes or opens is cut into parts.
3. **Answer**: elements, pressures and lines are asked once, for the motion of their ports.
4. **Repair**: what the guess missed of their forces acts as if it had acted all the time.  Modes
   are linear, so that is exact.  Elements, fluid and interfaces see the displacement ``d`` that it
   makes in the next macro step; of the energy this costs ``d`` times the change of the forces
   meanwhile.
5. **Judge**: where that is more than a small share of the work of the step, the macro step is
   repeated with the answer as the guess.

Where the answer does not settle (a stiff spring, a switch), ``M`` fine steps follow each other
with elements and fluid in each of them, repeated until nothing moves any more.
"""

from typing import Any, NamedTuple

import numpy as np

from klack.arrays import Index, Matrix, Vector
from klack.machine.compiling.jit import njit
from klack.network.step_function import first, pointers, shift
from klack.simulation.delay_line import Lines, LineState, lines_commit, lines_incoming
from klack.simulation.network_arrays import (
    ANSWER,
    COARSE,
    CUT,
    EXCESS,
    FINE,
    MIDDLE,
    NEAR,
    PARTS,
    PORTS,
    Accounts,
    Bodies,
    Contacts,
    FlowTrial,
    Fluid,
    NetworkArrays,
    Recording,
    Scratch,
    Sliding,
    Step,
    StepRows,
)
from klack.simulation.network_interfaces import (
    FORCE_ROUND_OFF,
    begin_cut_contacts,
    begin_interfaces,
    begin_macro_interfaces,
    begin_swings,
    coarse_step_holds,
    contacts_hold,
    cost_of_catching_up,
    end_far_films,
    end_interfaces,
    end_macro_interfaces,
    end_swings,
    far_ones_stay,
    forget_swings,
    keep_dissipation,
    mark_far_ones,
    mark_none_far,
    may_fly,
    may_press,
    may_swing,
    may_touch,
    push_by_far_films,
    push_by_guess,
    push_by_rise,
    smooth_films,
    solve_interfaces,
    stay_closed,
    swings_follow,
    swings_hold,
    take_back_interfaces,
)
from klack.simulation.network_ports import (
    begin_course,
    begin_cut,
    begin_macro_step,
    begin_ports,
    bring,
    catch_up,
    count_rise,
    drive_bodies,
    end_ports,
    end_sub_step,
    finite,
    guess_answer,
    guess_forces,
    guess_rise,
    keep_for_cut,
    keep_modes,
    largest_missed,
    matters,
    miss,
    miss_rise,
    move_free,
    move_ports_by_guess,
    repay,
    respace_forces,
    row_length,
    take_back_ports,
    turn_ports,
    turn_ports_by_all,
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
from klack.simulation.network_record import Moment, record_means, record_points
from klack.simulation.network_sliders import (
    begin_macro_sliders,
    begin_sub_sliders,
    cost_of_late_sliders,
    end_macro_sliders,
    end_sliders,
    sliders_hold,
    take_back_sliders,
)
from klack.simulation.phase import (
    STATUS_DONE,
    STATUS_FORCES,
    STATUS_MET,
    STATUS_REFUSED,
    phase,
    unfolded,
)
from klack.simulation.row_calls import end_elements, push_by_elements
from klack.simulation.wave_rows import Waves, waves_commit, waves_incoming

__all__ = [
    "CLOCK",
    "FEW_REPEATS",
    "MACRO_REPEATS",
    "MOST_REPEATS",
    "SETTLED",
    "moved_by_round_off",
    "push_by_rows",
    "run_network",
]


CLOCK = 8
"""Time in fine steps, size of the last step, then
:class:`klack.simulation.network_result.StepCounts`."""

SETTLED = (1e-3, 1e-6), (5e-5, 1e-12)
"""Of a macro step, then of a fine one: displacement by the missed force, over the longest
displacement of a port, and energy that catching up costs over the work of the step."""

FEW_REPEATS = 8  # are enough, unless what still changes is round-off
MOST_REPEATS = 200
MACRO_REPEATS = 6  # without success: fine steps


class _Way(NamedTuple):
    """How bodies move in a step that elements and fluid answer once."""

    parts: int  # sub-steps
    whole: bool  # nothing that acts can be cut, so that the free motion is asked once
    flight: bool
    swing: bool  # longer sub-steps: contacts stay closed, and their forces change within them


class _Loop(NamedTuple):
    """All that the loop works on; pointers but for lines and records."""

    bodies: Bodies
    elements: StepRows
    fluid: Fluid
    contacts: Contacts
    sliding: Sliding
    lines: Lines
    line_state: LineState
    waves: Waves
    ends: FlowTrial
    accounts: Accounts
    kind: Index
    line_losses: Matrix
    wave_losses: Matrix
    recording: Recording
    sums: Vector  # of elements, then branches, interfaces, sliders
    peaks: Vector


# without the runtime of numba there is no counting of references, half the time of a step
@njit(_nrt=False, error_model="numpy", nogil=True)
def run_network(
    macros: int,
    per_record: int,
    clock: Index,
    M: int,
    near: int,
    R: int,
    origin: float,
    h: float,
    allow_macro: bool,
    network: NetworkArrays,
    recording: Recording,
    scratch: Scratch,
    report: Vector,
) -> int:
    """Integrate ``macros`` blocks of ``M`` fine steps, in place.

    ``near`` fine steps are a macro step about a touch, ``R`` of them a sub-step while films are
    smooth.  ``clock`` counts: :data:`CLOCK`, from time ``origin`` on.  ``report`` gets the row of a
    failure, its status and its time.
    """
    loop = _begin(network, recording, scratch)
    bodies, contacts = loop.bodies, loop.contacts
    now, last_level, at = clock[0], clock[1], FINE
    last_steps = _steps_of(last_level, M, near)
    done_steps = last_steps if last_level >= 0 else 0
    in_record, record, record_time, kink = 0, 0, 0.0, 0
    for _macro in range(macros):
        while network.kinks[kink] <= origin + now * h:
            kink += 1
        together = allow_macro and network.kinks[kink] >= origin + (now + M) * h
        flight = together and may_fly(contacts, origin + now * h, M * h)
        swing = together and not flight and bodies.driven == 0
        swing = swing and may_swing(contacts, origin + now * h, M * h)
        press = together and not (flight or swing) and may_press(contacts, M * h, near * h)
        smooth, apart = R > 1, True
        done = 0
        while done < M:
            # what acts: one step, or sub-steps
            level = FINE
            if together:
                level = COARSE if flight or swing or press else NEAR
            steps = _steps_of(level, M, near)
            if together and apart:
                mark_far_ones(contacts, bodies, level, steps * h)
            else:
                mark_none_far(contacts, bodies)
            of_sub, parts = level, 1
            if level == NEAR:
                smooth = smooth and smooth_films(contacts, near * h, R * h)
                of_sub = MIDDLE if smooth else FINE
                parts = near // R if smooth else near
            elif press or (swing and not swings_follow(contacts, M * h)):
                of_sub, parts = NEAR, M // near
            whole = parts == 1 and not swing and not (of_sub == FINE and may_touch(contacts, h))
            way = _Way(parts, whole, flight, swing)
            begin, ratio = origin + now * h, steps / done_steps if done_steps > 0 else 0.0
            step = Step(level, steps, begin, steps * h, 1.0 / (steps * h))
            sub = Step(of_sub, steps // parts, begin, steps // parts * h, parts / (steps * h))
            if at != of_sub:
                bring(bodies, at, of_sub)
                at = of_sub
            begin_macro_step(bodies)
            begin_macro_interfaces(
                contacts, loop.accounts, recording, _interface_sums(loop), loop.peaks
            )
            begin_macro_sliders(loop.sliding, loop.accounts, _slider_sums(loop))
            if together or not whole:
                keep_modes(bodies, of_sub)
            straight = level == last_level
            if not straight:
                respace_forces(bodies, steps / last_steps)
            guess_forces(bodies)
            guess_rise(bodies, steps / last_steps if steps > 1 else 0.0)
            guess_pressures(loop.fluid, step.t + step.H, step.H, straight)
            if loop.fluid.nodes.ends > 0:
                lines_incoming(loop.lines, loop.line_state, steps, loop.ends.c, loop.ends.Z)
                waves_incoming(loop.waves, step.H, loop.ends.c, loop.ends.Z)
            status = _settle(step, sub, way, ratio, loop, first(clock), first(report))
            if status > STATUS_DONE:
                return status
            if status != STATUS_DONE:
                # again: in sub-steps, in fine ones, at the fine rate of elements and fluid
                take_back_ports(bodies, of_sub, True)
                take_back_interfaces(
                    contacts, loop.accounts, recording, _interface_sums(loop), loop.peaks
                )
                take_back_sliders(loop.sliding, loop.accounts, _slider_sums(loop))
                if status == STATUS_REFUSED:
                    together = swing = press = False
                elif flight:
                    flight = False
                elif swing:
                    swing = parts < M // near
                    forget_swings(contacts, -np.inf if swing else begin)
                elif press:
                    press = False
                else:
                    smooth = apart = False
                last_level, last_steps = level, steps  # forces so far are spaced like this now
                continue
            if ratio != 1.0:
                begin_course(bodies, ratio)
            _end_step(step, of_sub, whole, loop, M * h)
            last_level, last_steps = level, steps
            done_steps = steps
            done += steps
            now += steps
            if level == FINE:
                clock[2] += 1
            elif level == COARSE:
                clock[3] += 1
            else:
                clock[4] += 1
                clock[5] += parts
                clock[6] += parts if of_sub == FINE else 0
                smooth, apart = R > 1, True
        in_record += 1
        record_time += M * h
        if in_record == per_record:
            bring(bodies, at, at)
            record_means(recording, record, record_time, loop.sums, loop.peaks)
            moment = Moment(
                bodies,
                loop.elements.state,
                loop.fluid.state.p,
                loop.fluid.nodes.nodes,
                loop.fluid.state.free,
                loop.fluid.nodes.volumes * loop.fluid.nodes.slow_gas,
                loop.fluid.branches.state,
                contacts.state.gap,
                contacts.rows.interfaces,
            )
            record_points(recording, record, at, moment)
            record += 1
            in_record, record_time = 0, 0.0
    bring(bodies, at, FINE)
    clock[0], clock[1] = now, last_level
    return STATUS_DONE


@phase
def _steps_of(level: int, M: int, near: int) -> int:
    """Fine steps of a step that elements and fluid answer once."""
    if level == COARSE:
        return M
    return near if level == NEAR else 1


@unfolded
def _begin(network: NetworkArrays, recording: Recording, scratch: Scratch) -> _Loop:
    """Begin a run: no force pending, no density known, nothing summed."""
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
        sliding=Sliding(
            pointers(network.sliders), pointers(network.slider_state), pointers(scratch.sliders)
        ),
        lines=network.lines,
        line_state=network.line_state,
        waves=network.waves,
        ends=scratch.flows,
        accounts=pointers(network.accounts),
        kind=first(network.account_kind),
        line_losses=network.accounts.lines,
        wave_losses=network.accounts.waves,
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
def _settle(
    step: Step,
    sub: Step,
    way: _Way,
    ratio: float,
    loop: Any,
    clock: Any,
    report: Any,
) -> int:
    """One step up to its end, repeated until its guess missed nothing.

    ``ratio``: its length over that of the step before, 0 without one.

    Returns
    -------
    int
        ``STATUS_DONE``; ``STATUS_MET`` where a contact closed or opened in a step too long for it;
        ``STATUS_REFUSED`` for a macro step that does not settle; or what failed.
    """
    bodies, contacts = loop.bodies, loop.contacts
    G = shift(bodies.G, step.level * PORTS * PORTS)
    fine = step.level == FINE
    share, energy = SETTLED[1 if fine else 0]
    for attempt in range(MOST_REPEATS if fine else MACRO_REPEATS):
        if attempt > 0:
            take_back_ports(bodies, sub.level, not way.whole)
            take_back_interfaces(
                contacts, loop.accounts, loop.recording, _interface_sums(loop), loop.peaks
            )
            take_back_sliders(loop.sliding, loop.accounts, _slider_sums(loop))
            guess_answer(bodies)
            clock[7] += 1
        status = _act(sub, way, fine, attempt == 0, loop, report)
        if status == STATUS_DONE:
            status = push_by_rows(step, bodies, loop.elements, loop.fluid, contacts, report)
        if status != STATUS_DONE:
            return status
        miss(bodies, G)
        if step.steps > 1:
            miss_rise(bodies, step.level, ratio)
        left, work = cost_of_catching_up(contacts, bodies.at)
        late, rubbed = cost_of_late_sliders(loop.sliding, bodies.at)
        if not matters(bodies, step.level, share, energy, left + late, work + rubbed):
            return STATUS_DONE
        if not finite(bodies):
            break
        if fine and attempt >= FEW_REPEATS:
            moved = largest_missed(bodies)
            if moved <= moved_by_round_off(G, bodies.ports, loop.elements, loop.fluid, contacts):
                return STATUS_DONE
    if fine:
        report[0], report[2] = largest_missed(bodies), step.t
        return STATUS_FORCES
    return STATUS_REFUSED


@unfolded
def _act(
    sub: Step,
    way: _Way,
    fine: bool,
    first: bool,
    loop: Any,
    report: Any,
) -> int:
    """Modes, contacts and films over one step, or over all sub-steps of a macro step.

    A step that may meet a touch, a release or a film that begins to cavitate is cut there.  Returns
    a status: ``STATUS_FORCES`` where contacts do not settle in a fine step.
    """
    bodies, contacts, sliding = loop.bodies, loop.contacts, loop.sliding
    parts, whole, swing = way.parts, way.whole, False
    move = first or not whole
    done, cut, kept = 0, 0, False
    all_parts = PARTS * sub.steps
    while done < parts:
        now = Step(sub.level, sub.steps, sub.t + done * sub.H, sub.H, sub.rate)
        if cut > 0:
            H = sub.H / all_parts
            now = Step(CUT, 0, now.t + (all_parts - cut) * H, H, sub.rate * all_parts)
        elif move:
            keep_dissipation(contacts)
            turned = swing
            swing = way.swing
            if parts > 1 and bodies.driven == 0:
                swing = swing or stay_closed(contacts, now.H)
            if swing or turned:
                bring(bodies, now.level, now.level)
            kept = not whole and not way.swing and now.level != NEAR
            kept = kept and (now.level == FINE or may_touch(contacts, now.H))
            if kept:
                keep_for_cut(bodies, now.level)
        G = shift(bodies.G, now.level * PORTS * PORTS)
        if move:
            if bodies.driven > 0:
                drive_bodies(bodies, now.level, now.t, now.H)
            begin_swings(contacts, bodies, now, swing)
            move_free(bodies, now.level)
            begin_sub_sliders(sliding, bodies, now.level)
        late = 0.0
        if not whole:
            late = ((now.t - sub.t) + 0.5 * now.H) / (sub.H * parts) - 0.5
        push_by_guess(contacts, sliding, bodies, late)
        move_ports_by_guess(bodies, G)
        if whole:
            turn_ports(bodies, now.level)
        if swing:
            push_by_rise(contacts, bodies, 1.0 / parts)
            turn_ports_by_all(bodies, now.level)
        if not solve_interfaces(contacts, sliding, bodies, G, now):
            report[0], report[2] = 0.0, now.t
            return STATUS_FORCES if fine else STATUS_REFUSED
        if way.flight and not coarse_step_holds(contacts):
            return STATUS_MET
        if way.swing and not swings_hold(contacts, now.H):
            return STATUS_MET
        if now.level != FINE and now.level != CUT and not sliders_hold(sliding):
            return STATUS_MET
        if not whole and cut == 0 and not contacts_hold(contacts):
            if not kept:
                return STATUS_MET
            begin_cut(bodies, sub.level)
            begin_cut_contacts(contacts)
            cut, swing = all_parts, False
            continue
        begins = done == 0 and (cut == 0 or cut == all_parts)
        if swing:
            end_swings(contacts, now, begins)
            count_rise(bodies, now.level, 1.0 / parts)
        end_interfaces(
            contacts,
            bodies,
            now,
            begins,
            loop.accounts,
            loop.recording,
            _interface_sums(loop),
            loop.peaks,
        )
        end_sliders(sliding, now, begins, loop.accounts, _slider_sums(loop))
        end_sub_step(bodies, late)
        if cut == 0:
            done += 1
        else:
            cut -= 1
            if cut == 0:
                bring(bodies, CUT, sub.level)
                done += 1
    return STATUS_DONE if far_ones_stay(contacts, bodies.at) else STATUS_MET


@unfolded
def _end_step(step: Step, level: int, whole: bool, loop: Any, longest: float) -> None:
    bodies, elements, fluid = loop.bodies, loop.elements, loop.fluid
    accounts, kind, H = loop.accounts, loop.kind, step.H
    end_elements(elements, H, accounts, kind, loop.sums)
    if fluid.nodes.nodes > 0:
        sums_of_branches = shift(loop.sums, elements.port0[elements.rows])
        end_branches(fluid, bodies.at, H, accounts, kind, sums_of_branches)
        end_ends(fluid, H)
        if fluid.nodes.ends > 0:
            lines_commit(loop.lines, loop.line_state, step.steps, loop.ends.q, loop.line_losses)
            waves_commit(loop.waves, H, loop.ends.c, loop.ends.Z, loop.ends.q, loop.wave_losses)
        end_nodes(fluid, H, accounts)
    end_far_films(loop.contacts, step, accounts, loop.recording, _interface_sums(loop), loop.peaks)
    if step.level != FINE:  # fine steps owe nothing but round-off
        repay(bodies, shift(bodies.G, step.level * PORTS * PORTS), H)
    catch_up(bodies, level, step.level, whole)
    bodies.at[EXCESS] += end_macro_interfaces(loop.contacts, bodies.at, step, longest)
    bodies.at[EXCESS] += end_macro_sliders(loop.sliding, bodies.at)
    end_ports(bodies)


@phase
def _interface_sums(loop: Any) -> Any:
    elements, branches = loop.elements, loop.fluid.branches
    return shift(loop.sums, elements.port0[elements.rows] + branches.rows)


@phase
def _slider_sums(loop: Any) -> Any:
    return shift(_interface_sums(loop), 2 * loop.contacts.rows.interfaces)


@phase
def push_by_rows(
    step: Step, bodies: Any, elements: Any, fluid: Any, contacts: Any, report: Any
) -> int:
    """Forces of elements, fluid and far films for the motion of their ports."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[ANSWER + i] = 0.0
    status = push_by_elements(elements, S, step, report)
    if status == STATUS_DONE and fluid.nodes.nodes > 0:
        status = solve_pressures(fluid, S, step, report)
        push_by_fluid(fluid, S)
    push_by_far_films(contacts, S, step)
    S[ANSWER + bodies.ports] = 0.0  # what pushes the ground moves nothing
    return status


@phase
def moved_by_round_off(G: Any, ports: int, elements: Any, fluid: Any, contacts: Any) -> float:
    """Largest displacement of a port by the round-off of the forces of a sweep [m].

    Forces in balance leave a sum of nothing, but not without the round-off of each.  A pressure
    follows from the mass in a volume to the round-off of that mass times the bulk modulus
    ``rho dp/drho``.  ``G`` of its level is zero between bodies.
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
    return FORCE_ROUND_OFF * largest


@phase
def _moved_by_rows(G: Any, rows: Any, total: float) -> float:
    """Add what the magnitude of each force of elements or branches moves one port by."""
    for k in range(rows.rows):
        o0, q0 = rows.output0[k] + rows.head, rows.port0[k]
        for j in range(q0, rows.port0[k + 1]):
            total += abs(G[rows.ports[j]] * rows.outputs[o0 + j - q0])
    return total
