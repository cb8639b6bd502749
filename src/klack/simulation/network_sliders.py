r"""Phases of a step for friction between ports: Coulomb's law, set-valued.

With a constant force *f* over a step *h* the modes move exactly, so that displacement and speed of
slip at its end are

.. math:: \Delta = \Delta_f + G f, \qquad v_1 = v_f + D f .

Friction is a viscous part and a dry one,

.. math:: f = -\frac{b}{h}\,\Delta - C\,\mathrm{sign}\,\Delta, \qquad
    0 \le C \le L(|\Delta|/h), \qquad L(v) = F_c + (F_s - F_c)\, e^{-(v/v_s)^2} ,

and of all *C* the largest with which neither :math:`\Delta` nor :math:`v_1` turns round.  So it
holds a body at rest against any force up to :math:`F_s`, without creep; opposes slip with *L*; and
stops a body in the step in which it comes to rest.  (A force that makes :math:`\Delta` vanish would
leave :math:`v_1 = -v_0`, and a body at rest would tremble.)  The loss :math:`-f \Delta` is never
negative.

Where *L* falls with the speed, a body may stick or slip in the same step.  This is decided once in
a step, before the contacts answer, or both would alternate endlessly.

Where other forces reverse *v* within the step, *C* is 0 for this step: an error of the impulse
below :math:`F_s h`.
"""

from math import exp
from typing import Any

from klack.machine.compiling.jit import njit
from klack.simulation.network_arrays import AHEAD, BEGIN, FORCE, KEPT_SLIDER, PORTS, Y1, Step
from klack.simulation.network_ports import move_body, port_speed
from klack.simulation.phase import phase

__all__ = [
    "begin_macro_sliders",
    "begin_sub_sliders",
    "cost_of_late_sliders",
    "end_macro_sliders",
    "end_sliders",
    "largest_friction",
    "push_by_last_friction",
    "slider_force",
    "sliders_hold",
    "slip",
    "slip_seen_late",
    "take_back_sliders",
]


_TURNS = 60
_LEFT = 1e-14  # of the way without friction


@njit(error_model="numpy", _nrt=False)
def largest_friction(
    coulomb: float,
    excess: float,
    stribeck: float,
    viscous: float,
    h: float,
    G: float,
    way: float,
) -> float:
    """Largest dry friction [N] of a step: ``Fs`` where it holds, else ``L`` at its speed of slip.

    Parameters
    ----------
    coulomb, excess [N]
        ``Fc`` and ``Fs - Fc``, not negative.
    stribeck [m/s]
    viscous [N s/m]
    h [s]
    G [m/N]
        Displacement per force, above 0.
    way [m]
        Displacement without the force.
    """
    yielding = 1.0 / (1.0 + G * viscous / h)
    g, a = G * yielding, abs(way) * yielding
    if excess == 0.0 or a <= g * (coulomb + excess):
        return coulomb + excess
    # h u + g L(u) = a
    low, high = (a - g * (coulomb + excess)) / h, (a - g * coulomb) / h
    u, level = high, coulomb
    for _ in range(_TURNS):
        x = u / stribeck
        part = excess * exp(-x * x) if x * x < 40.0 else 0.0
        level = coulomb + part
        left = h * u + g * level - a
        if abs(left) <= _LEFT * a:
            break
        if left > 0.0:
            high = u
        else:
            low = u
        slope = h - 2.0 * g * part * x / stribeck
        u = u - left / slope if slope > 0.0 else low
        if not low < u < high:
            u = 0.5 * (low + high)
    return level


@njit(error_model="numpy", _nrt=False)
def slider_force(
    most: float, viscous: float, h: float, G: float, D: float, way: float, speed: float
) -> tuple[float, float]:
    """Mean friction of one slider over a step, on the body whose way counts, and its slip [m].

    Parameters
    ----------
    most [N]
        From :func:`largest_friction`.
    viscous [N s/m]
    h [s]
    G, D [m/N], [m/(N s)]
        Displacement and speed at the end of the step per force, above 0.
    way, speed [m], [m/s]
        Without the force.
    """
    drag = viscous / h
    yielding = 1.0 / (1.0 + G * drag)
    way *= yielding
    g = G * yielding
    speed -= D * drag * way
    sign = 1.0 if way > 0.0 else -1.0
    dry = min(most, abs(way) / g, max(sign * speed / (D * (1.0 - drag * g)), 0.0))
    slip = way - sign * g * dry
    if sign * slip < 0.0:
        slip = 0.0  # round-off
    return -drag * slip - sign * dry, slip


_SHAKEN = 0.25  # of the largest friction: its change in a coarse step
_ROUND_OFF = 4e-16  # of a force
_LEAST_CHANGE = 1e-3  # of a force in the next step, where it happened to stay the same in this one


@phase
def _apart(rows: Any, S: Any, row: int, s: int) -> float:
    """Displacement of the upper port relative to the lower one, from a row of the ports."""
    return S[row + rows.upper[s]] - S[row + rows.lower[s]]


@phase
def begin_macro_sliders(sliding: Any, accounts: Any, sums: Any) -> None:
    """Keep what a repeated macro step starts from."""
    state, trial = sliding.state, sliding.trial
    for s in range(sliding.rows.sliders):
        k = KEPT_SLIDER * s
        trial.kept[k] = state.seen[s]
        trial.kept[k + 1] = state.force[s]
        trial.kept[k + 2] = accounts.friction[s]
        trial.kept[k + 3] = sums[2 * s]
        trial.kept[k + 4] = sums[2 * s + 1]
        _begin_attempt(sliding, s)


@phase
def _begin_attempt(sliding: Any, s: int) -> None:
    force = sliding.state.force[s]
    trial = sliding.trial
    trial.force[s] = trial.least[s] = trial.most[s] = force
    trial.first[s] = 0.0


@phase
def take_back_sliders(sliding: Any, accounts: Any, sums: Any) -> None:
    """Go back to the start of the macro step."""
    state, kept = sliding.state, sliding.trial.kept
    for s in range(sliding.rows.sliders):
        k = KEPT_SLIDER * s
        state.seen[s] = kept[k]
        state.force[s] = kept[k + 1]
        accounts.friction[s] = kept[k + 2]
        sums[2 * s] = kept[k + 3]
        sums[2 * s + 1] = kept[k + 4]
        _begin_attempt(sliding, s)


@phase
def begin_sub_sliders(sliding: Any, bodies: Any, level: int) -> None:
    """Speeds of slip at the end of a step without its forces, after the free motion."""
    rows, state, trial = sliding.rows, sliding.state, sliding.trial
    for s in range(rows.sliders):
        u, low = 2 * s, 2 * s + 1
        upper = port_speed(bodies, level, rows.block0[u], rows.block1[u], rows.row[u])
        lower = port_speed(bodies, level, rows.block0[low], rows.block1[low], rows.row[low])
        trial.speed[s] = upper - lower
        trial.force[s] = state.force[s]


@phase
def push_by_last_friction(sliding: Any, S: Any) -> None:
    """Add the friction so far to the forces of the ports."""
    rows, force = sliding.rows, sliding.trial.force
    for s in range(rows.sliders):
        S[FORCE + rows.upper[s]] += force[s]
        S[FORCE + rows.lower[s]] -= force[s]


@phase
def slip(sliding: Any, bodies: Any, G: Any, step: Step, first: bool, moved: float) -> float:
    """Friction of all sliders under the other forces so far; the largest move of a port.

    The ``first`` sweep of a step determines which of them hold.
    """
    rows, state, trial, S = sliding.rows, sliding.state, sliding.trial, bodies.at
    for s in range(rows.sliders):
        u, low = rows.upper[s], rows.lower[s]
        at = step.level * rows.sliders + s
        own, drive = rows.G[at], rows.D[at]
        force = trial.force[s]
        speed = trial.speed[s] - drive * force
        for j in range(bodies.first[u], bodies.last[u]):
            speed += rows.kick[at * PORTS + j] * S[FORCE + j]
        if bodies.first[low] != bodies.first[u]:
            for j in range(bodies.first[low], bodies.last[low]):
                speed += rows.kick[at * PORTS + j] * S[FORCE + j]
        way = _apart(rows, S, Y1, s) - state.seen[s] - own * force
        viscous = rows.viscous[s]
        if first:
            trial.largest[s] = largest_friction(
                rows.coulomb[s], rows.excess[s], rows.stribeck[s], viscous, step.H, own, way
            )
        trial.force[s], trial.way[s] = slider_force(
            trial.largest[s], viscous, step.H, own, drive, way, speed
        )
        change = trial.force[s] - force
        if abs(change) <= _ROUND_OFF * abs(force):
            trial.force[s], trial.way[s] = force, way + own * force
        else:
            S[FORCE + u] += change
            S[FORCE + low] -= change
            moved = move_body(bodies, G, u, change, moved)
            moved = move_body(bodies, G, low, -change, moved)
    return moved


@phase
def slip_seen_late(sliding: Any, S: Any) -> tuple[float, float]:
    """Energy that it costs to see the last change of the others late, and the work [J]."""
    rows, state, trial = sliding.rows, sliding.state, sliding.trial
    left, work = 0.0, 0.0
    for s in range(rows.sliders):
        way = _apart(rows, S, Y1, s) - state.seen[s]
        change = abs(trial.force[s] - state.force[s]) + _LEAST_CHANGE * abs(trial.force[s])
        left += change * abs(way - trial.way[s])
        work += abs(trial.force[s] * way)
    return left, work


@phase
def sliders_hold(sliding: Any) -> bool:
    """Whether friction changed so little in a step that nothing turned or came to rest.

    Where slip turns, friction is anything up to its largest value.
    """
    rows, state, trial = sliding.rows, sliding.state, sliding.trial
    holds = True
    for s in range(rows.sliders):
        most = rows.coulomb[s] + rows.excess[s]
        if abs(trial.force[s] - state.force[s]) > _SHAKEN * max(most, abs(trial.force[s])):
            holds = False
        if state.force[s] != 0.0 and state.force[s] * trial.force[s] <= 0.0:
            holds = False
    return holds


@phase
def end_sliders(sliding: Any, step: Step, first: bool, accounts: Any, sums: Any) -> None:
    """Accept displacements and forces; ``first`` is for the first step of a macro step."""
    rows, state, trial = sliding.rows, sliding.state, sliding.trial
    for s in range(rows.sliders):
        force = trial.force[s]
        state.seen[s] += trial.way[s]
        state.force[s] = force
        accounts.friction[s] -= force * trial.way[s]
        sums[2 * s] += step.H * force
        sums[2 * s + 1] -= step.H * force
        if first:
            trial.first[s] = force
        trial.least[s] = min(trial.least[s], force)
        trial.most[s] = max(trial.most[s], force)


@phase
def cost_of_late_sliders(sliding: Any, S: Any) -> tuple[float, float]:
    """Energy that it costs sliders to see the missed force a step late, and their work [J]."""
    rows, state, trial = sliding.rows, sliding.state, sliding.trial
    left, work = 0.0, 0.0
    for s in range(rows.sliders):
        left += abs(_apart(rows, S, AHEAD, s)) * (trial.most[s] - trial.least[s])
        work += abs(trial.force[s] * (state.seen[s] - trial.kept[KEPT_SLIDER * s]))
    return left, work


@phase
def end_macro_sliders(sliding: Any, S: Any) -> float:
    """Energy that bodies got before beyond what sliders, being behind, give [J]."""
    rows, trial = sliding.rows, sliding.trial
    excess = 0.0
    for s in range(rows.sliders):
        k = KEPT_SLIDER * s
        excess += (trial.kept[k + 1] - trial.first[s]) * (_apart(rows, S, BEGIN, s) - trial.kept[k])
    return excess
