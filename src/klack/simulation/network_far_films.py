"""Phases of a step for interfaces far apart: their films answer once per macro step.

The film of an open interface changes little in a macro step as long as its gap does, so sub-steps
need not ask it.  It answers for the way really gone, as elements do, and its force is among theirs
(rows ``ANSWER``, ``BEFORE``, ``LAST``) for so long: guessed, asked, repaired, judged with them.
The mean force over a gap that goes from one value to another is exact at any length of the step.
"""

from typing import Any

import numpy as np

from klack.network.step_function import shift
from klack.simulation.interface_step import open_film
from klack.simulation.network_arrays import (
    ANSWER,
    BEFORE,
    BEFORE_2,
    BEFORE_3,
    LAST,
    MEAN,
    Recording,
    Step,
)
from klack.simulation.network_interfaces import HELD, end_force, film_damping, gap_between
from klack.simulation.phase import phase

__all__ = ["end_far_films", "far_ones_stay", "mark_far_ones", "mark_none_far", "push_by_far_films"]

_FASTEST = 5.0  # [m/s]: no gap closes faster between two macro steps
_GENTLE = 0.02  # of a gap and its cut-off: way in a macro step that its film follows
_WEAK = 1e-3  # of a change of the film force: what it changes in the film force by moving the gap
_NEAR = 0.5  # of the gap at the start: far ones do not come so near


@phase
def mark_far_ones(contacts: Any, bodies: Any, level: int, H: float) -> None:
    """Mark the interfaces that the sub-steps of the next macro step of this size leave out."""
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
    """Bring the force of an interface among those of elements, or take it out, as it was last."""
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
    """Forces of films far apart for the way that their gaps went."""
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
