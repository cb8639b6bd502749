"""Phases of a step for interfaces: contacts and films between bodies.

The film of an open interface far apart changes little in a macro step, so sub-steps leave it out.
It answers once for the motion that happened, as elements do, and its force is guessed, asked,
repaired and judged among theirs (rows ``ANSWER``, ``BEFORE``, ``LAST``).  The mean force over a gap
that goes from one value to another is exact at any length of the step.
"""

from typing import Any

import numpy as np

from klack.contact.step_constants import LAW_RUBBING, LAW_YIELDING, SEPARATED, SLOWEST
from klack.network.step_function import shift
from klack.simulation.interface_step import open_film, solve_interface
from klack.simulation.lasting_laws import (
    keep_faces,
    keep_sliders,
    press,
    settle,
    settled_since,
    slide,
    take_back_faces,
    take_back_sliders,
)
from klack.simulation.network_arrays import (
    AHEAD,
    ANSWER,
    BEFORE,
    BEFORE_2,
    BEFORE_3,
    BEGIN,
    FORCE,
    GUESS,
    KEPT,
    LAST,
    MEAN,
    RISE,
    Y1,
    Recording,
    Step,
)
from klack.simulation.network_ports import move_body, port_speed
from klack.simulation.network_sliders import push_by_last_friction, slip, slip_seen_late
from klack.simulation.phase import phase

__all__ = [
    "FORCE_ROUND_OFF",
    "begin_cut_contacts",
    "begin_interfaces",
    "begin_macro_interfaces",
    "coarse_step_holds",
    "contacts_hold",
    "cost_of_catching_up",
    "end_far_films",
    "end_interfaces",
    "end_macro_interfaces",
    "far_ones_stay",
    "forget_interfaces",
    "keep_dissipation",
    "mark_far_ones",
    "mark_none_far",
    "may_fly",
    "may_touch",
    "push_by_far_films",
    "push_by_guess",
    "smooth_films",
    "solve_interfaces",
    "take_back_interfaces",
]


_ENERGY_LEFT = 1e-12  # energy that what is left of the last change costs, over the work of the step
_LEAST_CHANGE = 1e-3  # of a force in the next step, where it happened to stay the same in this one
_ROUND_OFF = 4e-16  # of a displacement
FORCE_ROUND_OFF = 2e-15  # of each force that acts, whatever the others leave of their sum
_FEW_SWEEPS = 8  # are enough, unless what still changes is that of friction that holds a body
_MOST_SWEEPS = 200
_FALLS = 1.5  # times the force now: a contact that had so much a macro step ago releases soon
HELD = 0.5  # of the suction: a film that pulls more may begin to cavitate
_SHAKEN = 0.04  # of the force of a contact at rest: its change in a macro step
_SMOOTH = 0.06  # of a gap and its cut-off: way in a middle step that the film follows


@phase
def begin_interfaces(contacts: Any, peaks: Any) -> None:
    """Begin a run with the forces of the last step."""
    forget_interfaces(contacts)
    for c in range(contacts.rows.interfaces):
        peaks[c] = 0.0


@phase
def forget_interfaces(contacts: Any) -> None:
    """Forces of the last step, after a discarded one."""
    for c in range(contacts.rows.interfaces):
        contacts.trial.force[c] = contacts.state.force[c]


@phase
def _steady(before: float, now: float, share: float = 1.0) -> bool:
    """Whether macro steps follow the force of a contact at rest, within a ``share``."""
    return abs(now - before) <= share * _SHAKEN * max(abs(now), abs(before))


@phase
def film_damping(rows: Any, c: int, x: float) -> float:
    """Film force per closing speed at a gap ``x`` [N s/m]."""
    return rows.cubic[c] / x**3 + rows.linear[c] / x


@phase
def may_fly(contacts: Any, now: float, length: float) -> bool:
    """Whether one step of this length may be tried: all interfaces far apart or at rest."""
    rows, state = contacts.rows, contacts.state
    quiet = True
    for c in range(rows.interfaces):
        rate = abs(state.rate[c])
        if state.since[c] < np.inf:
            # a swing is steady for a moment at its crests
            if now - max(state.since[c], state.calm[c]) < rows.rest[c]:
                quiet = False
            continue
        x = state.gap[c] - 3.0 * rate * length
        creeping = rate * length < 1e-3 * (max(state.gap[c], 0.0) + rows.cut_off[c])
        if x <= 0.0:
            if not (creeping and rows.dry[c] == 0):
                quiet = False
        elif rows.dry[c] == 0:
            if rate * film_damping(rows, c, x) > rows.film_small[c] and not creeping:
                quiet = False
    return quiet


@phase
def push_by_guess(contacts: Any, sliding: Any, bodies: Any, late: float) -> None:
    """Forces of the ports: the guess of elements and fluid, and those of the sub-step so far.

    ``late``: place of the middle of the sub-step in the macro step, -1/2 to 1/2.
    """
    rows, force, S = contacts.rows, contacts.trial.force, bodies.at
    for p in range(bodies.ports + 1):
        S[FORCE + p] = S[GUESS + p] + late * S[RISE + p]
    for c in range(rows.interfaces):
        if force[c] != 0.0:
            S[FORCE + rows.upper[c]] += force[c]
            S[FORCE + rows.lower[c]] -= force[c]
    push_by_last_friction(sliding, S)


@phase
def gap_between(rows: Any, S: Any, c: int) -> float:
    """Gap between the bodies at the end of the step."""
    return rows.gap0[c] + S[Y1 + rows.upper[c]] - S[Y1 + rows.lower[c]]


@phase
def solve_interfaces(contacts: Any, sliding: Any, bodies: Any, G: Any, step: Step) -> bool:
    """Forces of all interfaces and sliders, in turn until they agree; whether they do.

    Each moves the ports of its two bodies.  All live on the gaps and displacements that they saw,
    which the last change of the others moved; they catch up in the next step.
    """
    rows, state, trial, S = contacts.rows, contacts.state, contacts.trial, bodies.at
    for sweep in range(_MOST_SWEEPS):
        moved = 0.0
        for c in range(rows.interfaces):
            if state.far[c] != 0.0:
                continue
            u, low = rows.upper[c], rows.lower[c]
            _solve_interface(contacts, S, c, step)
            change = trial.contact[c] + trial.film[c] - trial.force[c]
            if change != 0.0 or trial.force[c] != 0.0:
                trial.force[c] += change
                S[FORCE + u] += change
                S[FORCE + low] -= change
                moved = move_body(bodies, G, u, change, moved)
                moved = move_body(bodies, G, low, -change, moved)
        moved = slip(sliding, bodies, G, step, sweep == 0, moved)
        left, work = slip_seen_late(sliding, S)
        distance, held = 0.0, 0.0
        for s in range(sliding.rows.sliders):
            upper, lower = sliding.rows.upper[s], sliding.rows.lower[s]
            distance = max(distance, abs(S[Y1 + upper]), abs(S[Y1 + lower]))
            own = sliding.rows.G[step.level * sliding.rows.sliders + s]
            held = max(held, own * abs(sliding.trial.force[s]))
        for c in range(rows.interfaces):
            if trial.force[c] != 0.0:
                gap = gap_between(rows, S, c)
                change = abs(trial.force[c] - state.force[c])
                left += (change + _LEAST_CHANGE * abs(trial.force[c])) * abs(gap - trial.gap[c])
                work += abs(trial.force[c] * (gap - state.gap[c]))
                distance = max(distance, abs(S[Y1 + rows.upper[c]]), abs(S[Y1 + rows.lower[c]]))
        if left <= _ENERGY_LEFT * work or moved <= _ROUND_OFF * distance:
            return True
        if sweep >= _FEW_SWEEPS and moved <= FORCE_ROUND_OFF * held:
            return True
    return False


@phase
def _solve_interface(contacts: Any, S: Any, c: int, step: Step) -> None:
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    G, g0 = rows.G[step.level * rows.interfaces + c], state.gap[c]
    gap_free = gap_between(rows, S, c) - G * trial.force[c]
    trial.gap[c] = gap_free
    if rows.dry[c] and g0 >= 0.0 and gap_free >= 0.0 and state.e[c] == 0.0:
        trial.contact[c] = trial.film[c] = trial.e[c] = 0.0
        trial.contact_loss[c] = trial.film_loss[c] = 0.0
        return
    if rows.alpha[c] > 0.0 and state.chi[c] == 0.0 and gap_free < 0.0:
        speed = max((g0 - gap_free) * step.rate, SLOWEST)
        state.chi[c] = rows.alpha[c] / speed
    (
        trial.contact[c],
        trial.film[c],
        trial.gap[c],
        trial.e[c],
        state.hint[c],
        trial.contact_loss[c],
        trial.film_loss[c],
    ) = solve_interface(
        rows.kind[c],
        contacts.laws,
        rows.law0[c],
        state.chi[c] * step.rate,
        rows.cubic[c],
        rows.linear[c],
        rows.cut_off[c],
        rows.suction[c],
        step.H,
        G,
        rows.series[c],
        g0,
        gap_free,
        state.e[c],
        trial.force[c],
        state.hint[c],
        state.film_before[c],
    )


@phase
def coarse_step_holds(contacts: Any) -> bool:
    """Whether a coarse step met nothing that it cannot resolve: a touch, a release, a film."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    holds = True
    for c in range(rows.interfaces):
        closed = state.since[c] < np.inf
        if closed != (trial.contact[c] > 0.0):
            holds = False
        if closed and not _steady(state.force[c], trial.force[c]):
            holds = False
        if abs(trial.film[c]) > 2.0 * rows.film_small[c]:
            holds = False
    return holds


@phase
def _remembered(contacts: Any, accounts: Any, peaks: Any) -> tuple[Any, ...]:
    """What a repeated macro step starts from, its gap second and its force fourth."""
    state = contacts.state
    return (
        state.e,
        state.gap,
        state.rate,
        state.force,
        state.chi,
        state.deepest,
        state.since,
        state.film_before,
        state.pulled,
        accounts.contact,
        accounts.film,
        peaks,
    )


@phase
def begin_macro_interfaces(
    contacts: Any, accounts: Any, recording: Recording, sums: Any, peaks: Any
) -> None:
    """Keep what a repeated macro step starts from."""
    state, trial = contacts.state, contacts.trial
    for c in range(contacts.rows.interfaces):
        k = KEPT * c
        for values in _remembered(contacts, accounts, peaks):
            trial.kept[k] = values[c]
            k += 1
        trial.kept[k] = float(state.hint[c])
        trial.kept[k + 1], trial.kept[k + 2] = sums[2 * c], sums[2 * c + 1]
        trial.kept[k + 3] = float(recording.filled[c])
        if contacts.rows.kind[c] == LAW_RUBBING:
            keep_sliders(contacts.laws, contacts.rows.law0[c])
        if contacts.rows.kind[c] == LAW_YIELDING:
            keep_faces(contacts.laws, contacts.rows.law0[c])
        begin_attempt(contacts, c)


@phase
def begin_attempt(contacts: Any, c: int) -> None:
    """Nothing has acted yet; the last force is the first guess."""
    state, trial = contacts.state, contacts.trial
    force = state.force[c]
    trial.force[c] = trial.least[c] = trial.most[c] = force
    trial.first[c] = 0.0
    if state.far[c] != 0.0:  # it acts among elements
        trial.first[c] = force
        trial.force[c] = trial.contact[c] = trial.film[c] = 0.0
        trial.contact_loss[c] = trial.film_loss[c] = 0.0


@phase
def take_back_interfaces(
    contacts: Any, accounts: Any, recording: Recording, sums: Any, peaks: Any
) -> None:
    """Go back to the start of the macro step."""
    state, kept = contacts.state, contacts.trial.kept
    for c in range(contacts.rows.interfaces):
        k = KEPT * c
        for values in _remembered(contacts, accounts, peaks):
            values[c] = kept[k]
            k += 1
        state.hint[c] = int(kept[k])
        sums[2 * c], sums[2 * c + 1] = kept[k + 1], kept[k + 2]
        recording.filled[c] = int(kept[k + 3])
        if contacts.rows.kind[c] == LAW_RUBBING:
            take_back_sliders(contacts.laws, contacts.rows.law0[c])
        if contacts.rows.kind[c] == LAW_YIELDING:
            contacts.rows.gap0[c] -= settled_since(contacts.laws, contacts.rows.law0[c])
            take_back_faces(contacts.laws, contacts.rows.law0[c])
        begin_attempt(contacts, c)


@phase
def smooth_films(contacts: Any, H: float, middle: float) -> bool:
    """Whether films follow steps of ``middle`` [s] for the next ``H`` [s].

    Not where the gap changes much meanwhile, nor about a release: the film that begins then
    determines how fast the bodies part.
    """
    rows, state = contacts.rows, contacts.state
    smooth = True
    for c in range(rows.interfaces):
        if state.far[c] != 0.0 or rows.dry[c] != 0:
            continue
        rate = abs(state.rate[c])
        if state.since[c] < np.inf:
            smooth = smooth and _FALLS * state.force[c] > state.force_before[c]
        else:
            x = max(state.gap[c] - 3.0 * rate * H, 0.0) + rows.cut_off[c]
            smooth = smooth and rate * middle <= _SMOOTH * x
    return smooth


@phase
def may_touch(contacts: Any, H: float) -> bool:
    """Whether a contact may close or open in the next ``H`` [s], or a film begin to cavitate."""
    rows, state = contacts.rows, contacts.state
    may = False
    for c in range(rows.interfaces):
        if state.far[c] == 0.0:
            if abs(state.gap[c]) <= 3.0 * abs(state.rate[c]) * H or state.pulled[c] != 0.0:
                may = True
            if state.force[c] < -HELD * rows.suction[c]:
                may = True
    return may


@phase
def contacts_hold(contacts: Any) -> bool:
    """Whether no contact closed or opened in this step, and no film began or ceased to cavitate."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    holds = True
    for c in range(rows.interfaces):
        if (state.since[c] < np.inf) != (trial.contact[c] > 0.0):
            holds = False
        if (state.pulled[c] != 0.0) != _pulls(contacts, c):
            holds = False
    return holds


@phase
def _pulls(contacts: Any, c: int) -> bool:
    film = contacts.trial.film[c]
    return film < 0.0 and film <= -contacts.rows.suction[c]


@phase
def keep_dissipation(contacts: Any) -> None:
    """Keep what the first solution of a step may change."""
    for c in range(contacts.rows.interfaces):
        contacts.trial.chi[c] = contacts.state.chi[c]


@phase
def begin_cut_contacts(contacts: Any) -> None:
    """Begin a step once more."""
    state, trial = contacts.state, contacts.trial
    for c in range(contacts.rows.interfaces):
        state.chi[c] = trial.chi[c]
        if state.far[c] == 0.0:
            trial.force[c] = state.force[c]


@phase
def cost_of_catching_up(contacts: Any, S: Any) -> tuple[float, float]:
    """Energy that it costs interfaces to see the missed force a step late, and their work [J]."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    left, work = 0.0, 0.0
    for c in range(rows.interfaces):
        d = S[AHEAD + rows.upper[c]] - S[AHEAD + rows.lower[c]]
        left += abs(d) * (trial.most[c] - trial.least[c])
        work += abs(trial.force[c] * (state.gap[c] - trial.kept[KEPT * c + 1]))
    return left, work


@phase
def end_macro_interfaces(contacts: Any, S: Any, step: Step, longest: float) -> float:
    """End a macro step of interfaces, one of ``longest`` [s] at most.

    Returns the energy [J] that bodies got beyond what the interfaces give: each was behind by what
    had been missed, until its first sub-step.
    """
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    excess = 0.0
    for c in range(rows.interfaces):
        begin = trial.kept[KEPT * c + 3]
        state.force_before[c] = begin
        if not _steady(begin, state.force[c], step.H / longest):
            state.calm[c] = step.t + step.H
        behind = rows.gap0[c] + S[BEGIN + rows.upper[c]] - S[BEGIN + rows.lower[c]]
        if rows.kind[c] == LAW_YIELDING:
            behind -= settled_since(contacts.laws, rows.law0[c])
        excess += (begin - trial.first[c]) * (behind - trial.kept[KEPT * c + 1])
    return excess


@phase
def end_interfaces(
    contacts: Any,
    bodies: Any,
    step: Step,
    first: bool,
    accounts: Any,
    recording: Recording,
    sums: Any,
    peaks: Any,
) -> None:
    """Accept gaps, forces and compressions, and record them; ``first`` in its macro step."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    for c in range(rows.interfaces):
        if state.far[c] != 0.0:
            if first and rows.dry[c] == 0:
                trial.opening[c] = _opening(bodies, recording, c, step.level)
            continue
        acted = trial.contact[c] != 0.0 or trial.film[c] != 0.0 or trial.contact_loss[c] != 0.0
        gap, settled = gap_between(rows, bodies.at, c), 0.0
        if acted or state.since[c] < np.inf:
            gap = trial.gap[c]  # what the others move after that it sees in the next step
            if state.since[c] == np.inf or trial.contact[c] == 0.0:
                trial.opening[c] = _opening(bodies, recording, c, step.level)
            settled = end_force(contacts, c, step, gap, accounts, recording, sums, peaks)
            if first:
                trial.first[c] = trial.force[c]
            trial.least[c] = min(trial.least[c], trial.force[c])
            trial.most[c] = max(trial.most[c], trial.force[c])
        else:
            state.force[c] = 0.0
        state.pulled[c] = 1.0 if _pulls(contacts, c) else 0.0
        state.rate[c] = (gap - state.gap[c]) * step.rate
        state.gap[c] = gap + settled
        if state.chi[c] != 0.0:
            state.deepest[c] = max(state.deepest[c], -gap)
            if gap > SEPARATED * state.deepest[c]:
                state.chi[c] = state.deepest[c] = 0.0


@phase
def _opening(bodies: Any, recording: Recording, c: int, level: int) -> float:
    """Speed at which the centres of mass part at the start of the step [m/s].

    Modes have moved freely since, which does not change the speed of a body as a whole.
    """
    at = recording.parting
    upper = port_speed(bodies, level, at[c, 0], at[c, 1], -1)
    return upper - port_speed(bodies, level, at[c, 2], at[c, 3], -1)


@phase
def end_force(
    contacts: Any,
    c: int,
    step: Step,
    gap: float,
    accounts: Any,
    recording: Recording,
    sums: Any,
    peaks: Any,
) -> float:
    """Accept a step of one interface that ends at ``gap``; the growth [m] of gaps by yielding."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    settled = 0.0
    contact, film = trial.contact[c], trial.film[c]
    was_closed = state.since[c] < np.inf
    if rows.kind[c] == LAW_RUBBING:
        before, after = -(state.gap[c] + state.e[c]), -(gap + trial.e[c])
        accounts.contact[c] += slide(contacts.laws, rows.law0[c], before, after)
    if rows.kind[c] == LAW_YIELDING and contact > 0.0:
        before, after = -(state.gap[c] + state.e[c]), -(gap + trial.e[c])
        accounts.contact[c] += press(contacts.laws, rows.law0[c], before, after, contact)
        settled = settle(contacts.laws, rows.law0[c])
        rows.gap0[c] += settled
    state.e[c] = trial.e[c]
    state.force[c] = trial.force[c]
    accounts.contact[c] += trial.contact_loss[c]
    accounts.film[c] += trial.film_loss[c]
    state.film_before[c] = 0.0
    if contact > 0.0:
        if not was_closed:
            state.since[c] = step.t
            state.film_before[c] = film
    else:
        state.since[c] = np.inf
    sums[2 * c] += step.H * contact
    sums[2 * c + 1] += step.H * film
    peaks[c] = max(peaks[c], trial.force[c])
    if abs(film) > rows.film_felt[c] or was_closed or contact > 0.0:
        _record_step(recording, c, step, trial, gap)
    return settled


@phase
def _record_step(recording: Recording, c: int, step: Step, trial: Any, gap: float) -> None:
    """Keep one step in which an interface carried force, while there is room."""
    place = recording.filled[c]
    if place < recording.fine.shape[1]:
        recording.fine[c, place, 0] = step.t
        recording.fine[c, place, 1] = step.H
        recording.fine[c, place, 2] = trial.contact[c]
        recording.fine[c, place, 3] = trial.film[c]
        recording.fine[c, place, 4] = gap
        recording.fine[c, place, 5] = trial.opening[c]
    recording.filled[c] = place + 1


_FASTEST = 5.0  # [m/s]: no gap closes faster between two macro steps
_GENTLE = 0.02  # of a gap and its cut-off: way in a macro step that its film follows
_WEAK = 1e-3  # of a change of the film force: what it changes in the film force by moving the gap
_NEAR = 0.5  # of the gap at the start: far ones do not come so near


@phase
def mark_far_ones(contacts: Any, bodies: Any, level: int, H: float) -> None:
    """Mark the interfaces that sub-steps of the next macro step of this size leave out."""
    rows, state = contacts.rows, contacts.state
    for c in range(rows.interfaces):
        gap, way = state.gap[c], abs(state.rate[c]) * H
        far = state.since[c] == np.inf and state.chi[c] == 0.0 and state.pulled[c] == 0.0
        least = gap - 3.0 * way
        far = far and gap > _FASTEST * H and least > 0.0
        if far and rows.dry[c] != 0:
            far = state.e[c] == 0.0
        elif far:
            x = least + rows.cut_off[c]
            damping = film_damping(rows, c, x)
            G = rows.G[level * rows.interfaces + c] + rows.series[c]
            far = (
                way <= _GENTLE * x
                and damping * G <= _WEAK * H
                and damping * way <= HELD * rows.suction[c] * H
            )
        _take_turns(contacts, bodies.at, c, far)


@phase
def mark_none_far(contacts: Any, bodies: Any) -> None:
    """Let all interfaces act in the next step."""
    for c in range(contacts.rows.interfaces):
        _take_turns(contacts, bodies.at, c, False)


@phase
def _take_turns(contacts: Any, S: Any, c: int, far: bool) -> None:
    """Add the last force of an interface to those of elements, or take it out."""
    rows, state = contacts.rows, contacts.state
    if far == (state.far[c] != 0.0):
        return
    state.far[c] = 1.0 if far else 0.0
    force = state.force[c] if far else -state.force[c]
    if force != 0.0:
        u, low = rows.upper[c], rows.lower[c]
        for row in (BEFORE, BEFORE_2, BEFORE_3, LAST, MEAN):
            S[row + u] += force
            S[row + low] -= force


@phase
def far_ones_stay(contacts: Any, S: Any) -> bool:
    """Whether interfaces that were left out are still far apart."""
    stay = True
    for c in range(contacts.rows.interfaces):
        if contacts.state.far[c] != 0.0:
            if gap_between(contacts.rows, S, c) <= _NEAR * contacts.state.gap[c]:
                stay = False
    return stay


@phase
def push_by_far_films(contacts: Any, S: Any, step: Step) -> None:
    """Forces of films far apart for the motion of their gaps."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    force = shift(S, ANSWER)
    for c in range(rows.interfaces):
        if state.far[c] == 0.0:
            continue
        gap = gap_between(rows, S, c)
        trial.gap[c] = gap
        if rows.dry[c] != 0:
            continue
        trial.film[c], trial.e[c], trial.film_loss[c] = open_film(
            rows.cubic[c],
            rows.linear[c],
            rows.cut_off[c],
            rows.suction[c],
            step.H,
            rows.series[c],
            state.gap[c],
            gap,
            state.e[c],
            state.force[c],
        )
        force[rows.upper[c]] += trial.film[c]
        force[rows.lower[c]] -= trial.film[c]


@phase
def end_far_films(
    contacts: Any, step: Step, accounts: Any, recording: Recording, sums: Any, peaks: Any
) -> None:
    """Take over gaps, forces and compressions of interfaces far apart."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    for c in range(rows.interfaces):
        if state.far[c] == 0.0:
            continue
        if rows.dry[c] == 0:
            trial.force[c] = trial.film[c]
            end_force(contacts, c, step, trial.gap[c], accounts, recording, sums, peaks)
        state.rate[c] = (trial.gap[c] - state.gap[c]) * step.rate
        state.gap[c] = trial.gap[c]
