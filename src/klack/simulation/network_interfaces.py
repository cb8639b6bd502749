"""Phases of a step for interfaces: contacts and films between bodies.

The film of an open interface far apart changes little in a macro step, so sub-steps leave it out.
It answers once for the motion that happened, as elements do, and its force is guessed, asked,
repaired and judged among theirs (rows ``ANSWER``, ``BEFORE``, ``LAST``).  The mean force over a gap
that goes from one value to another is exact at any length of the step.
"""

from typing import Any

import numpy as np

from klack.contact.step_constants import (
    LAW_RUBBING,
    LAW_YIELDING,
    NO_LAW,
    SEPARATED,
    SLOWEST,
)
from klack.network.step_function import shift
from klack.simulation.contact_step import mean_force
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
    PORTS,
    RISE,
    TURN,
    Y1,
    Recording,
    Step,
)
from klack.simulation.network_ports import (
    mean_displacement,
    move_body,
    port_speed,
    watch_averages,
)
from klack.simulation.network_sliders import push_by_last_friction, slip, slip_seen_late
from klack.simulation.phase import phase

__all__ = [
    "FORCE_ROUND_OFF",
    "begin_cut_contacts",
    "begin_interfaces",
    "begin_macro_interfaces",
    "begin_swings",
    "coarse_step_holds",
    "contacts_hold",
    "cost_of_catching_up",
    "end_far_films",
    "end_interfaces",
    "end_macro_interfaces",
    "end_swings",
    "far_ones_stay",
    "forget_interfaces",
    "forget_swings",
    "keep_dissipation",
    "mark_far_ones",
    "mark_none_far",
    "may_fly",
    "may_press",
    "may_swing",
    "may_touch",
    "push_by_far_films",
    "push_by_guess",
    "push_by_rise",
    "smooth_films",
    "solve_interfaces",
    "stay_closed",
    "swings_follow",
    "swings_hold",
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
_ROUGH = 0.1  # of the time after which a closed contact rests: until swings are followed again
_STILL = 0.1  # of that: at rest of an elastic contact, which is followed while it swings
_SMOOTH = 0.06  # of a gap and its cut-off: way in a middle step that the film follows
_HARDENING = 0.015  # the same in a sub-step of a macro step: a peak of the film is 1e-4 higher
_SOFTENING = 0.15  # ... while it presses less than before, or pulls
_AS_HARD = 1.0002  # times the deepest indentation: what is missed of it matters to no peak
_HARDER = 1.002  # the same of what is expected
_STAYS = 0.5  # of the gap of a closed contact: way in a step in which it stays closed
_BEND = 2e-3  # of a force that swings: what its second derivative changes in the mean of a step
_CREST = 1e-5  # the same where a contact presses harder than before
_JERK = 1e-3  # the same of the change from one step to the next: 1e-5 of the time of the swings


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
        if state.since[c] < np.inf:
            # a swing is steady for a moment at its crests
            if now - max(state.since[c], state.calm[c]) < rows.rest[c]:
                quiet = False
        elif not _flies(contacts, c, length):
            quiet = False
    return quiet


@phase
def _flies(contacts: Any, c: int, length: float) -> bool:
    """Whether an open interface stays far apart, with a small film force."""
    rows, state = contacts.rows, contacts.state
    rate = abs(state.rate[c])
    x = state.gap[c] - 3.0 * rate * length
    creeping = rate * length < 1e-3 * (max(state.gap[c], 0.0) + rows.cut_off[c])
    if rows.dry[c] != 0:
        return x > 0.0
    if x <= 0.0:
        return creeping
    return creeping or rate * film_damping(rows, c, x) <= rows.film_small[c]


@phase
def may_swing(contacts: Any, now: float, length: float) -> bool:
    """Whether contacts stay closed in the next ``length`` [s] while they swing, others far apart.

    Of those that swing the law must be elastic: its force then depends on the gap alone.  None may
    press harder than before: that is the peak of an impact.
    """
    rows, state = contacts.rows, contacts.state
    may = True
    for c in range(rows.interfaces):
        rate = abs(state.rate[c])
        if state.since[c] == np.inf:
            may = may and _flies(contacts, c, length)
        elif not _elastic(contacts, c) or now < state.rough[c]:
            may = False
        else:
            deep = -state.gap[c]
            may = may and rate * length <= _STAYS * deep and state.film_before[c] == 0.0
            may = may and deep - state.rate[c] * length <= _HARDER * state.deepest[c]
    return may


@phase
def may_press(contacts: Any, length: float, sub: float) -> bool:
    """Whether interfaces stay open for the next ``length`` [s], their films smooth in ``sub`` [s].

    None may be about to cavitate.  The mean of a step is below a peak of ``v/x^3`` by half the
    square of the share of the gap that is gone through.
    """
    rows, state = contacts.rows, contacts.state
    may = True
    for c in range(rows.interfaces):
        rate = state.rate[c]
        x = state.gap[c] + 3.0 * min(rate, 0.0) * length
        may = may and state.since[c] == np.inf and state.film_before[c] == 0.0 and x > 0.0
        may = may and (state.pulled[c] != 0.0 or state.force[c] >= -HELD * rows.suction[c])
        share = _HARDENING if state.force[c] > max(state.force_before[c], 0.0) else _SOFTENING
        may = may and (rows.dry[c] != 0 or abs(rate) * sub <= share * (x + rows.cut_off[c]))
    return may


@phase
def stay_closed(contacts: Any, H: float) -> bool:
    """Whether contacts that are closed stay so in a sub-step, and all of them are elastic."""
    state, closed, stay = contacts.state, False, True
    for c in range(contacts.rows.interfaces):
        if state.since[c] < np.inf:
            closed, deep = True, -(state.gap[c] + state.e[c])
            stay = stay and _elastic(contacts, c) and state.film_before[c] == 0.0
            stay = stay and abs(state.rate[c]) * H <= _STAYS * deep
    return closed and stay


@phase
def _elastic(contacts: Any, c: int) -> bool:
    rows = contacts.rows
    return rows.alpha[c] == 0.0 and rows.kind[c] < LAW_RUBBING and rows.kind[c] != NO_LAW


@phase
def swings_follow(contacts: Any, length: float) -> bool:
    """Whether one step of this length is expected to follow the swings of closed contacts."""
    state, follow = contacts.state, True
    for c in range(contacts.rows.interfaces):
        if state.since[c] < np.inf:
            follow = follow and state.jerk[c] * length**3 <= _JERK * state.force[c]
    return follow


@phase
def forget_swings(contacts: Any, now: float) -> None:
    """Expect nothing of closed contacts; try no longer steps for a while after ``now`` [s]."""
    rows, state = contacts.rows, contacts.state
    for c in range(rows.interfaces):
        state.jerk[c] = np.inf
        state.rough[c] = max(state.rough[c], now + _ROUGH * rows.rest[c])


@phase
def begin_swings(contacts: Any, bodies: Any, step: Step, swing: bool) -> None:
    """Slopes of the forces of closed contacts in a sub-step, and mean ways without all forces.

    The slope in the middle of the way that is ahead at the last speed.
    """
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    for c in range(rows.interfaces):
        trial.stiffness[c] = trial.rise[c] = 0.0
        if swing and state.since[c] < np.inf and state.far[c] == 0.0:
            series, deep = rows.series[c], -(state.gap[c] + state.e[c])
            k = _stiffness(contacts, c, deep)
            ahead = -0.5 * state.rate[c] * step.H / (1.0 + k * series)
            k = _stiffness(contacts, c, max(deep + ahead, 0.5 * deep))
            trial.stiffness[c] = k / (1.0 + k * series)
    if swing:
        watch_averages(bodies, step.level, step.rate)


@phase
def _stiffness(contacts: Any, c: int, deep: float) -> float:
    """Slope of the law of a contact at an indentation; 0 where it is open."""
    rows, hint = contacts.rows, contacts.state.hint[c]
    _, slope, _ = mean_force(rows.kind[c], contacts.laws, rows.law0[c], deep, deep, hint)
    return 2.0 * slope


@phase
def push_by_rise(contacts: Any, bodies: Any, share: float) -> None:
    """Rise of the forces of ports in a sub-step, which is a ``share`` of the macro step."""
    rows, rise, S = contacts.rows, contacts.trial.rise, bodies.at
    for p in range(bodies.ports + 1):
        S[TURN + p] = share * S[RISE + p]
    for c in range(rows.interfaces):
        S[TURN + rows.upper[c]] += rise[c]
        S[TURN + rows.lower[c]] -= rise[c]


@phase
def swings_hold(contacts: Any, length: float) -> bool:
    """Whether contacts stayed closed and followed their swings, and nothing else was met.

    A contact that presses harder than before has the peak of its impact: nothing of it is missed.
    """
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    holds = True
    for c in range(rows.interfaces):
        force = trial.contact[c]
        if state.since[c] < np.inf:
            bend = abs(trial.stiffness[c] * trial.bow[c])
            deep = 1.5 * max(trial.bow[c], 0.0) + max(-state.gap[c], -trial.gap[c])  # at a crest
            deeper = deep > _AS_HARD * state.deepest[c]
            holds = holds and trial.stiffness[c] > 0.0 and abs(trial.rise[c]) <= force
            holds = holds and bend <= (_CREST if deeper else _BEND) * force
            if state.bend[c] < np.inf:
                jerk = trial.stiffness[c] * trial.bow[c] - state.bend[c] * length**2
                holds = holds and abs(jerk) <= 2.0 * _JERK * force
        elif force > 0.0 or abs(trial.film[c]) > 2.0 * rows.film_small[c]:
            holds = False
    return holds


@phase
def end_swings(contacts: Any, step: Step, first: bool) -> None:
    """Take over how the forces of closed contacts changed in a sub-step."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    for c in range(rows.interfaces):
        was = state.bend[c]
        if trial.stiffness[c] == 0.0:
            continue
        state.bend[c] = trial.stiffness[c] * trial.bow[c] * step.rate * step.rate
        jerk = abs(state.bend[c] - was) * step.rate if was < np.inf else np.inf
        state.jerk[c] = jerk if first or state.jerk[c] == np.inf else max(state.jerk[c], jerk)


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
    Gr = shift(bodies.Gr, step.level * PORTS * PORTS)
    for sweep in range(_MOST_SWEEPS):
        moved = 0.0
        for c in range(rows.interfaces):
            if state.far[c] != 0.0:
                continue
            u, low = rows.upper[c], rows.lower[c]
            rise = trial.rise[c]
            _solve_interface(contacts, bodies, c, step)
            if trial.stiffness[c] > 0.0:
                rise = trial.rise[c] - rise
                S[TURN + u] += rise
                S[TURN + low] -= rise
                moved = move_body(bodies, Gr, u, rise, moved)
                moved = move_body(bodies, Gr, low, -rise, moved)
            change = trial.contact[c] + trial.film[c] - trial.force[c]
            if change != 0.0 or trial.force[c] != 0.0:
                trial.force[c] += change
                S[FORCE + u] += change
                S[FORCE + low] -= change
                way = move_body(bodies, G, u, change, 0.0)
                way = move_body(bodies, G, low, -change, way)
                if way > _ROUND_OFF * abs(trial.gap[c]):  # of the gap, which a film feels
                    moved = max(moved, way)
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
def _solve_interface(contacts: Any, bodies: Any, c: int, step: Step) -> None:
    """Force of one interface, whose changes move its gap.

    That of a contact that swings is ``F + s (t/h - 1/2)`` with the change ``s = -k (g1 - g0)`` over
    the step and the mean ``F = F* + k ((g0 + g1)/2 - g_mean)``, ``F*`` the discrete gradient.  Its
    work on the bodies is ``F* (g1 - g0)``, whatever the slope ``k``.  Gaps are linear in ``F`` and
    ``s``: ``F*`` meets a free gap and a compliance as it does elsewhere.
    """
    rows, state, trial, S = contacts.rows, contacts.state, contacts.trial, bodies.at
    G, g0, k = rows.G[step.level * rows.interfaces + c], state.gap[c], trial.stiffness[c]
    gap_free = gap_between(rows, S, c) - G * trial.force[c]
    mean, turned, more, average, softer = 0.0, 0.0, 0.0, 0.0, 1.0
    if k > 0.0:
        u, low, at = rows.upper[c], rows.lower[c], step.level * PORTS * PORTS
        turned = _opened(shift(bodies.Gr, at), u, low)
        more = _opened(shift(bodies.Gm, at), u, low)
        mean = mean_displacement(bodies, step.level, u) - mean_displacement(bodies, step.level, low)
        average = turned + 0.5 * G
        mean += rows.gap0[c] - average * trial.force[c] - more * trial.rise[c]
        gap_free -= turned * trial.rise[c]
        softer = 1.0 + k * average
        slope = (1.0 + k * turned) * softer / G - k * (0.5 + k * more)
        gap_free = softer / G * (gap_free + k * turned * g0) + k * (g0 * (0.5 - k * more) - mean)
        gap_free /= slope
        G = 1.0 / slope
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
    if k > 0.0:
        g1 = trial.gap[c]
        trial.rise[c] = -k * (g1 - g0)
        change = 0.5 * (g0 + g1) - mean + k * more * (g1 - g0)
        trial.bow[c] = (change - average * (trial.contact[c] + trial.film[c])) / softer
        trial.contact[c] += k * trial.bow[c]


@phase
def _opened(G: Any, upper: int, lower: int) -> float:
    """Opening of a gap per force, from displacements per force."""
    cross = G[upper * PORTS + lower] + G[lower * PORTS + upper]
    return G[upper * PORTS + upper] + G[lower * PORTS + lower] - cross


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
        state.bend,
        state.jerk,
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
    trial.first[c] = trial.stiffness[c] = trial.rise[c] = 0.0
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
            between = abs(state.gap[c] + state.e[c])
            may = may or between <= 3.0 * abs(state.rate[c]) * H or state.film_before[c] != 0.0
            may = may or state.pulled[c] != 0.0 or state.force[c] < -HELD * rows.suction[c]
    return may


@phase
def contacts_hold(contacts: Any) -> bool:
    """Whether no contact closed or opened in this step, and no film began or ceased to cavitate."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    holds = True
    for c in range(rows.interfaces):
        if (state.since[c] < np.inf) != (trial.contact[c] > 0.0):
            holds = False
        if (state.pulled[c] != 0.0) != _pulls(contacts, c) or state.film_before[c] != 0.0:
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
        share = _STILL if _elastic(contacts, c) else 1.0
        if not _steady(begin, state.force[c], share * step.H / longest):
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
            force, half = trial.force[c], 0.5 * trial.rise[c]
            if first:
                trial.first[c] = force - half
            trial.least[c] = min(trial.least[c], force - abs(half))
            trial.most[c] = max(trial.most[c], force + abs(half))
            if trial.stiffness[c] == 0.0:
                state.bend[c] = state.jerk[c] = np.inf
        else:
            state.force[c] = 0.0
        state.pulled[c] = 1.0 if _pulls(contacts, c) else 0.0
        state.rate[c] = (gap - state.gap[c]) * step.rate
        state.gap[c] = gap + settled
        state.deepest[c] = max(state.deepest[c], -gap)
        if gap > SEPARATED * state.deepest[c]:
            state.chi[c] = state.deepest[c] = 0.0


@phase
def _opening(bodies: Any, recording: Recording, c: int, level: int) -> float:
    """Speed of the gap at the start of the step [m/s]; see ``Recording.parting``.

    Modes have moved freely since, which does not change the speed of a body as a whole.
    """
    at = recording.parting
    upper = port_speed(bodies, level, at[c, 0], at[c, 1], at[c, 2])
    return upper - port_speed(bodies, level, at[c, 3], at[c, 4], at[c, 5])


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
