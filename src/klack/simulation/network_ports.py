"""Phases of a step for bodies: modes in free motion, guessed forces, and what they missed."""

from typing import Any

import numpy as np

from klack.network.step_function import shift
from klack.simulation.modal_step import (
    FIXED_ROWS,
    ROW,
    ROW_B1,
    ROW_Q,
    ROW_R1,
    ROW_V,
    advance,
    apply_forces,
    apply_rising,
    average,
    copy_state,
    kick,
    watch,
)
from klack.simulation.network_arrays import (
    AHEAD,
    ANSWER,
    AVERAGE,
    BEFORE,
    BEFORE_2,
    BEFORE_3,
    BEGIN,
    COARSE,
    CUT,
    EXCESS,
    FINE,
    FORCE,
    FREE,
    GUESS,
    LAST,
    MEAN,
    MISSED,
    PENDING,
    PENDING_BEGIN,
    PORTS,
    REPAID,
    RISE,
    RISE_MISSED,
    SEEN,
    TURN,
    WITHIN,
    WITHIN_BEGIN,
    WORK,
    WORK_BEGIN,
    Y0,
    Y1,
)
from klack.simulation.phase import phase

__all__ = [
    "begin_course",
    "begin_cut",
    "begin_macro_step",
    "begin_ports",
    "bring",
    "catch_up",
    "count_rise",
    "drive_bodies",
    "drive_force",
    "end_ports",
    "end_sub_step",
    "finite",
    "guess_answer",
    "guess_forces",
    "guess_rise",
    "keep_for_cut",
    "keep_modes",
    "largest_missed",
    "matters",
    "mean_displacement",
    "miss",
    "miss_rise",
    "move_body",
    "move_free",
    "move_ports_by_guess",
    "port_speed",
    "repay",
    "respace_forces",
    "row_length",
    "take_back_ports",
    "turn_ports",
    "turn_ports_by_all",
    "watch_averages",
]


_LONGER = 4.0  # times the steps before
_OWED = 1e-4  # of the largest force of elements and fluid: most that repays
_NUDGE = 1e-3  # of the way of a step: most that the repaying force may add to it
_UNSEEN = 1e-10  # of the displacements by all forces of a step: no smaller change is asked for
_ROUND_OFF = 4e-16  # of the displacements themselves


@phase
def row_length(bodies: Any) -> int:
    """Ports with the ground, rounded up to whole vector registers."""
    return 4 * (bodies.ports // 4 + 1)


@phase
def begin_ports(bodies: Any) -> None:
    """Begin a run: no force is pending."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[PENDING + i] = S[TURN + i] = 0.0


@phase
def block_of(bodies: Any, k: int, level: int) -> Any:
    """Numbers of a block of modes, with the matrices of a step size."""
    return shift(bodies.laid_out, level * bodies.size + bodies.start[k])


@phase
def _copy_state(bodies: Any, source: int, target: int) -> None:
    for k in range(bodies.blocks):
        a, b = block_of(bodies, k, source), block_of(bodies, k, target)
        copy_state(a, b, bodies.modes[k])


@phase
def bring(bodies: Any, source: int, target: int) -> None:
    """Bring the modes from one step size to another, with the pending forces."""
    S, pending, turning = bodies.at, False, False
    for p in range(bodies.ports):
        turning = turning or S[TURN + p] != 0.0
        pending = pending or turning or S[PENDING + p] != 0.0
    if pending:
        for k in range(bodies.blocks):
            port0, port1 = bodies.port0[k], bodies.port1[k]
            block = block_of(bodies, k, source)
            if turning:
                apply_rising(
                    block, bodies.modes[k], shift(S, PENDING), shift(S, TURN), port0, port1
                )
            else:
                apply_forces(block, bodies.modes[k], shift(S, PENDING), port0, port1)
        for i in range(row_length(bodies)):
            S[PENDING + i] = S[TURN + i] = 0.0
    if target != source:
        _copy_state(bodies, source, target)


@phase
def keep_modes(bodies: Any, level: int) -> None:
    """Keep the state of the modes, where another step size has none meanwhile."""
    _copy_state(bodies, level, _kept_at(level))


@phase
def _kept_at(level: int) -> int:
    return FINE if level == COARSE else COARSE


@phase
def keep_for_cut(bodies: Any, level: int) -> None:
    """Keep the state of the modes at the start of a sub-step that may be cut."""
    _copy_state(bodies, level, CUT)


@phase
def _kick_block(bodies: Any, k: int, level: int, of: int, forces: int, row: int) -> float:
    """Add the response to the forces of a row over a step of size ``of``; its energy."""
    block, step = block_of(bodies, k, level), block_of(bodies, k, of)
    port0, port1 = bodies.port0[k], bodies.port1[k]
    return kick(block, step, bodies.modes[k], shift(bodies.at, forces), port0, port1, row)


@phase
def begin_cut(bodies: Any, level: int) -> None:
    """Begin a sub-step once more, in parts, with the forces pending then."""
    S = bodies.at
    for k in range(bodies.blocks):
        _kick_block(bodies, k, CUT, level, PENDING, ROW_B1)
    for i in range(row_length(bodies)):
        S[PENDING + i] = S[TURN + i] = 0.0


@phase
def begin_macro_step(bodies: Any) -> None:
    """Keep what a repeated macro step starts from."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[BEGIN + i] = S[Y0 + i]
        S[WORK_BEGIN + i] = S[WORK + i]
        S[PENDING_BEGIN + i] = S[PENDING + i]
    S[WITHIN_BEGIN] = S[WITHIN]


@phase
def take_back_ports(bodies: Any, level: int, kept: bool) -> None:
    """Go back to the start of the macro step; the modes too, where they were ``kept``."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[Y0 + i] = S[BEGIN + i]
        S[WORK + i] = S[WORK_BEGIN + i]
        S[PENDING + i] = S[PENDING_BEGIN + i]
        S[TURN + i] = 0.0
    S[WITHIN] = S[WITHIN_BEGIN]
    if kept:
        _copy_state(bodies, _kept_at(level), level)


@phase
def move_free(bodies: Any, level: int) -> None:
    """Move all modes over the step without its forces; those of the last step are pending."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[FREE + i] = 0.0
    for k in range(bodies.blocks):
        port0, port1 = bodies.port0[k], bodies.port1[k]
        block = block_of(bodies, k, level)
        advance(block, bodies.modes[k], shift(S, PENDING), port0, port1, shift(S, FREE))


@phase
def guess_forces(bodies: Any) -> None:
    """Forces of elements and fluid on the parabola through the last three steps."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[GUESS + i] = 3.0 * (S[BEFORE + i] - S[BEFORE_2 + i]) + S[BEFORE_3 + i]
    S[GUESS + bodies.ports] = 0.0  # what pushes the ground moves nothing


@phase
def guess_rise(bodies: Any, ratio: float) -> None:
    """Forces rise as in the last step; this one is ``ratio`` times as long, 0 if fine: no rise."""
    S = bodies.at
    for i in range(row_length(bodies)):
        rise = ratio * (S[RISE + i] + S[RISE_MISSED + i])
        S[RISE + i] = rise if ratio > 0.0 and abs(rise) < np.inf else 0.0  # of a step that failed
        S[RISE_MISSED + i] = 0.0


@phase
def respace_forces(bodies: Any, ratio: float) -> None:
    """Forces of the last three steps as if they had been longer by ``ratio``.

    As means they lie on the same parabola.  Longer steps that reach far beyond what is known begin
    with the last force.
    """
    S = bodies.at
    for i in range(row_length(bodies)):
        a, b, c = S[BEFORE + i], S[BEFORE_2 + i], S[BEFORE_3 + i]
        first, second = b - a, 0.5 * (c - 2.0 * b + a)
        if ratio > _LONGER:
            first, second = 0.0, 0.0
        # x steps before the last one: a + first x + second x (x - 1)
        x1, x2, x3 = 0.5 * ratio - 0.5, 1.5 * ratio - 0.5, 2.5 * ratio - 0.5
        S[BEFORE + i] = a + x1 * (first + second * (x1 - 1.0))
        S[BEFORE_2 + i] = a + x2 * (first + second * (x2 - 1.0))
        S[BEFORE_3 + i] = a + x3 * (first + second * (x3 - 1.0))


@phase
def guess_answer(bodies: Any) -> None:
    """Take the forces that elements and fluid gave as the next guess."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[GUESS + i] = S[ANSWER + i]
        S[RISE + i] += S[RISE_MISSED + i]


@phase
def _port_end(bodies: Any, G: Any, p: int, force: int) -> float:
    """Displacement of a port under the forces of its body in row ``force``."""
    S, total = bodies.at, 0.0
    for j in range(bodies.first[p], bodies.last[p]):
        total += G[p * PORTS + j] * S[force + j]
    return total


@phase
def move_ports_by_guess(bodies: Any, G: Any) -> None:
    """Displacements at the end of a step under the forces so far; ``G`` of its level.

    Loops over ports stay scalar: a vector loaded from numbers stored one by one a moment before
    waits until they have left the store buffer.
    """
    S = bodies.at
    for p in range(bodies.ports):
        S[Y1 + p] = S[FREE + p] + _port_end(bodies, G, p, FORCE)


@phase
def _turned(bodies: Any, level: int, p: int, rise: int) -> float:
    """Displacement of a port by forces of row ``rise``, whose mean over the step is zero."""
    return _port_end(bodies, shift(bodies.Gr, level * PORTS * PORTS), p, rise)


@phase
def turn_ports(bodies: Any, level: int) -> None:
    """Add what the rise of the guessed forces does in one step of this size."""
    S = bodies.at
    for p in range(bodies.ports):
        S[Y1 + p] += _turned(bodies, level, p, RISE)


@phase
def turn_ports_by_all(bodies: Any, level: int) -> None:
    """Add what the rise of all forces does in a sub-step."""
    S = bodies.at
    for p in range(bodies.ports):
        S[Y1 + p] += _turned(bodies, level, p, TURN)


@phase
def watch_averages(bodies: Any, level: int, rate: float) -> None:
    """Mean displacements of ports in free motion; before the modes move, no force is pending."""
    S = bodies.at
    for p in range(bodies.ports):
        S[AVERAGE + p] = 0.0
    for k in range(bodies.blocks):
        block, port0 = block_of(bodies, k, level), bodies.port0[k]
        for p in range(port0, bodies.port1[k]):
            S[AVERAGE + p] += average(block, bodies.modes[k], rate, FIXED_ROWS + p - port0)


@phase
def mean_displacement(bodies: Any, level: int, port: int) -> float:
    """Mean displacement of a port over a sub-step under the forces so far and their rise."""
    at = level * PORTS * PORTS
    G, Gr, Gm = shift(bodies.G, at), shift(bodies.Gr, at), shift(bodies.Gm, at)
    forced = _port_end(bodies, Gr, port, FORCE) + 0.5 * _port_end(bodies, G, port, FORCE)
    return bodies.at[AVERAGE + port] + forced + _port_end(bodies, Gm, port, TURN)


@phase
def count_rise(bodies: Any, level: int, share: float) -> None:
    """Count the work of forces that rise over a sub-step, before it is accepted.

    By parts that of a rise ``s`` is ``s ((y0 + y1)/2 - y_mean)``.  ``share`` of those of elements
    and fluid over the macro step are in it, which count beside their mean forces.
    """
    S = bodies.at
    for p in range(bodies.ports):
        if S[TURN + p] != 0.0:
            bow = 0.5 * (S[Y0 + p] + S[Y1 + p]) - mean_displacement(bodies, level, p)
            S[WORK + p] += S[TURN + p] * bow
            S[WITHIN] += share * S[RISE + p] * bow


@phase
def move_body(bodies: Any, G: Any, port: int, change: float, moved: float) -> float:
    """Move the ports of a body by a changed force at one of them; the largest move so far."""
    S = bodies.at
    for i in range(bodies.first[port], bodies.last[port]):
        way = G[i * PORTS + port] * change
        S[Y1 + i] += way
        moved = max(moved, abs(way))
    return moved


@phase
def port_speed(bodies: Any, level: int, block0: int, block1: int, row: int) -> float:
    """Velocity of a row of shapes [m/s] over the blocks of a body, -1 for the last row.

    Pending forces are not included.
    """
    total = 0.0
    for k in range(block0, block1):
        shape = row
        if row < 0:
            shape += (bodies.start[k + 1] - bodies.start[k]) // ROW
        total += watch(block_of(bodies, k, level), bodies.modes[k], ROW_V, shape)
    return total


@phase
def end_sub_step(bodies: Any, late: float) -> None:
    """Accept displacements and the work of interfaces; the forces stay pending.

    ``late`` as in ``push_by_guess``: the share of the rise is taken out of the forces.
    """
    S = bodies.at
    for p in range(bodies.ports):
        way, rise = S[Y1 + p] - S[Y0 + p], late * S[RISE + p]
        S[WORK + p] += (S[FORCE + p] - S[GUESS + p]) * way
        S[WITHIN] += rise * way
        S[Y0 + p] = S[Y1 + p]
        S[PENDING + p] = S[FORCE + p]
        S[FORCE + p] -= rise


@phase
def miss(bodies: Any, G: Any) -> None:
    """What the guess missed, and the displacements that it makes over the whole macro step."""
    S = bodies.at
    for p in range(bodies.ports):
        S[MISSED + p] = S[ANSWER + p] - S[GUESS + p]
    for p in range(bodies.ports):
        S[AHEAD + p] = _port_end(bodies, G, p, MISSED)


@phase
def miss_rise(bodies: Any, level: int, ratio: float) -> None:
    """What the guess missed of the rise over the macro step, and the displacements that it makes.

    Means of three steps of one length give the slope at the middle of the last one.  In a step that
    is ``ratio`` times as long as the one before, their two means do.
    """
    S = bodies.at
    for p in range(bodies.ports):
        rise = _rise(bodies, p, ratio)
        if ratio == 1.0:
            rise = 1.5 * S[ANSWER + p] - 2.0 * S[BEFORE + p] + 0.5 * S[BEFORE_2 + p]
        S[RISE_MISSED + p] = rise - S[RISE + p]
    for p in range(bodies.ports):
        S[AHEAD + p] += _turned(bodies, level, p, RISE_MISSED)


@phase
def matters(bodies: Any, level: int, share: float, energy: float, left: float, work: float) -> bool:
    """Whether what the guess missed matters, so that the step is repeated.

    ``left`` and ``work`` are what the interfaces add to both sums.  Elements and fluid live
    ``d = AHEAD`` behind the bodies, and catch up in the next step: of ``F dy`` the energy
    ``F_n (d_n - d_(n-1))`` is lost, in sum ``(F_n - F_(n+1)) d_n``.
    """
    S = bodies.at
    moved, way = 0.0, 0.0
    for p in range(bodies.ports):
        force, d = S[ANSWER + p], abs(S[AHEAD + p])
        here = abs(S[Y1 + p] - S[BEGIN + p])
        way = max(way, here)
        moved = max(moved, d)
        left += abs(force - S[LAST + p]) * d
        work += abs(force) * here
    if moved <= share * way and left <= energy * work and work < np.inf:
        return False
    displacement, by_forces = 0.0, 0.0
    for p in range(bodies.ports):
        displacement = max(displacement, abs(S[Y1 + p]))
        if level == FINE:
            by_forces = max(by_forces, abs(S[Y1 + p] - S[FREE + p]))
    # a force or displacement that is not finite never settles
    return not (work < np.inf and moved <= max(_UNSEEN * by_forces, _ROUND_OFF * displacement))


@phase
def largest_missed(bodies: Any) -> float:
    """Largest displacement of a port by the missed force [m]."""
    moved = 0.0
    for p in range(bodies.ports):
        moved = max(moved, abs(bodies.at[AHEAD + p]))
    return moved


@phase
def finite(bodies: Any) -> bool:
    """Whether all ports are finite; checked while the part to blame can be found."""
    total = 0.0
    for p in range(bodies.ports):
        total += bodies.at[Y1 + p] + bodies.at[AHEAD + p]
    return abs(total) < np.inf


@phase
def repay(bodies: Any, G: Any, H: float) -> None:
    """Take back the energy that bodies got beyond what was given to them, by a minute force.

    Elements, fluid and interfaces see what was missed a step late, at the forces of that step.  The
    force acts where the displacement is largest, and is limited: then the rest is left for the next
    step.  A body at rest must not be nudged by more than is repaid.
    """
    S = bodies.at
    port, longest, largest = 0, 0.0, 0.0
    for p in range(bodies.ports):
        way = abs(S[Y1 + p] + S[AHEAD + p] - S[BEGIN + p])
        if way > longest and G[p * PORTS + p] > 0.0:
            port, longest = p, way
        largest = max(largest, abs(S[ANSWER + p]))
    own = G[port * PORTS + port]
    most = min(_OWED * largest, _NUDGE * longest / own) if own > 0.0 else 0.0
    if most > 0.0 and S[EXCESS] != 0.0:
        way = S[Y1 + port] + S[AHEAD + port] - S[BEGIN + port]
        force = -S[EXCESS] / way
        force = min(max(force, -most), most)
        S[MISSED + port] += force
        S[REPAID + port] += H * force
        for i in range(bodies.first[port], bodies.last[port]):
            S[AHEAD + i] += G[i * PORTS + port] * force
        S[EXCESS] += force * (S[Y1 + port] + S[AHEAD + port] - S[BEGIN + port])


@phase
def _response(bodies: Any, level: int, port: int) -> float:
    """Displacement of a port per unit force on it; 0 of a driven body."""
    return bodies.G[(level * PORTS + port) * PORTS + port]


@phase
def catch_up(bodies: Any, level: int, macro: int, one_step: bool) -> None:
    """Let what the guess missed act as if it had acted all the time, in the macro step ``macro``.

    The response is that to a constant force over the macro step; in ``one_step`` it only joins the
    pending forces.  Counted are the work on the bodies, and the energy beyond what is given to
    them: elements and fluid are behind by what was missed before, interfaces will be by what is
    missed now.

    The rise of the forces acts after that, all of it in ``one_step``, else what is missing of it.
    Parts see the displacement that it makes under the mean forces; the difference of the works is
    no excess, since a force that rises while a body speeds up does more than its mean.
    """
    S = bodies.at
    excess, rise = 0.0, RISE_MISSED
    if one_step:
        rise = RISE
        for p in range(bodies.ports):
            S[RISE + p] += S[RISE_MISSED + p]
        for p in range(bodies.ports):
            turned = _turned(bodies, macro, p, RISE)
            S[PENDING + p] += S[MISSED + p]
            way = S[Y1 + p] + S[AHEAD + p] - S[BEGIN + p] - turned
            S[WORK + p] += (S[GUESS + p] + S[MISSED + p]) * way
            S[WORK + p] += (S[FORCE + p] - S[GUESS + p]) * (S[AHEAD + p] - turned)
            S[WITHIN] -= (S[FORCE + p] + S[MISSED + p]) * turned
    else:
        bring(bodies, level, level)
        for k in range(bodies.blocks):
            energy = _kick_block(bodies, k, level, macro, MISSED, ROW_B1)
            if bodies.driven > 0 and _response(bodies, macro, bodies.port0[k]) == 0.0:
                for p in range(bodies.port0[k], bodies.port1[k]):  # no speed, but work
                    energy += S[MISSED + p] * (S[Y1 + p] - S[BEGIN + p])
            S[WORK + bodies.port0[k]] += energy
            excess += energy
        for p in range(bodies.ports):
            turned = _turned(bodies, macro, p, RISE_MISSED)
            way, d = S[Y1 + p] - S[BEGIN + p], S[AHEAD + p] - turned
            S[WORK + p] += S[GUESS + p] * way
            excess -= S[MISSED + p] * (way + d) + S[FORCE + p] * d
            S[WITHIN] -= (S[FORCE + p] + S[MISSED + p]) * turned
    if macro != FINE:
        bring(bodies, level, level)
        for k in range(bodies.blocks):
            energy = _kick_block(bodies, k, level, macro, rise, ROW_R1)
            S[WORK + bodies.port0[k]] += energy
            S[WITHIN] += energy
    for p in range(bodies.ports):
        excess += (S[LAST + p] - S[ANSWER + p]) * (S[BEGIN + p] - S[SEEN + p])
        S[SEEN + p] = S[Y1 + p]
        S[Y1 + p] += S[AHEAD + p]
    S[EXCESS] += excess


@phase
def _rise(bodies: Any, p: int, ratio: float) -> float:
    """Rise over a step ``ratio`` times as long as the one before; 0 without one."""
    S = bodies.at
    return 2.0 * ratio / (1.0 + ratio) * (S[ANSWER + p] - S[MEAN + p])


@phase
def begin_course(bodies: Any, ratio: float) -> None:
    """Put the forces before a step of another length on the line through both means."""
    S = bodies.at
    for i in range(row_length(bodies)):
        rise = _rise(bodies, i, ratio)
        S[BEFORE + i] = S[ANSWER + i] - rise
        S[BEFORE_2 + i] = S[ANSWER + i] - 2.0 * rise


@phase
def end_ports(bodies: Any) -> None:
    """Take over displacements and forces of the macro step."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[Y0 + i] = S[Y1 + i]
        S[BEFORE_3 + i] = S[BEFORE_2 + i]
        S[BEFORE_2 + i] = S[BEFORE + i]
        S[BEFORE + i] = S[LAST + i] = S[MEAN + i] = S[ANSWER + i]


@phase
def _course_at(course: Any, at: int, t: float) -> float:
    """Displacement of a course at a time; layout: :meth:`MotionCourse.numbers`."""
    n = int(course[at])
    low, high = 0, n
    while low < high:
        middle = (low + high) // 2
        if course[at + 1 + middle] > t:
            high = middle
        else:
            low = middle + 1
    if low == 0:
        return course[at + 1 + n]
    if low == n:
        return course[at + 2 * n]
    t0 = course[at + low]
    h = course[at + 1 + low] - t0
    y0, s = course[at + n + low], (t - t0) / h
    rise = course[at + 1 + n + low] - y0
    a, b = h * course[at + 2 * n + low], h * course[at + 1 + 3 * n + low]
    return y0 + s * (a + s * (3.0 * rise - 2.0 * a - b + s * (a + b - 2.0 * rise)))


@phase
def drive_bodies(bodies: Any, level: int, t: float, H: float) -> None:
    """Give driven bodies the constant speed that ends on their course after a step from ``t``."""
    for d in range(bodies.driven):
        block = block_of(bodies, bodies.driven_block[d], level)
        end = _course_at(bodies.course, bodies.course0[d], t + H)
        block[ROW_V * ROW] = (end - block[ROW_Q * ROW]) / H


@phase
def drive_force(bodies: Any, d: int) -> float:
    """Force that a driven body needed in the last step [N]."""
    S, k, total = bodies.at, bodies.driven_block[d], 0.0
    for p in range(bodies.port0[k], bodies.port1[k]):
        total += S[ANSWER + p] + S[FORCE + p] - S[GUESS + p]
    return -total
