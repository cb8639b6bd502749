"""Phases of a step for bodies: modes in free motion, guesses, and the displacements of ports."""

from typing import Any

import numpy as np

from klack.network.step_function import shift
from klack.simulation.modal_step import ROW, advance, apply_forces
from klack.simulation.network_arrays import (
    BEFORE,
    ELEMENTS,
    ELEMENTS_BEFORE,
    FORCE,
    FREE,
    LAST,
    PENDING,
    PORTS,
    SEEN,
    USED,
    WORK,
    Y0,
    Y1,
)
from klack.simulation.phase import phase

__all__ = [
    "apply_pending",
    "begin_ports",
    "end_ports",
    "finite",
    "forget_forces",
    "guess_forces",
    "move_free",
    "move_ports",
    "move_ports_by_guess",
    "row_length",
    "settled_ports",
    "start_coarse",
]

_ENERGY_LEFT = 1e-12  # energy that what is left of that change costs, over the work of the step
_UNSEEN = 1e-10  # of the displacements by all forces of a step: no smaller change is asked for
_ROUND_OFF = 4e-16  # of the displacements themselves


@phase
def row_length(bodies: Any) -> int:
    """Ports with the ground, in whole vector registers."""
    return 4 * (bodies.ports // 4 + 1)


@phase
def begin_ports(bodies: Any) -> None:
    """Begin a run: no force is pending."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[PENDING + i] = 0.0
        S[FORCE + i] = S[LAST + i]


@phase
def _block(bodies: Any, k: int, level: int) -> Any:
    start = bodies.fine
    if level == 1:
        start = bodies.coarse
    return shift(start, bodies.start[k])


@phase
def _copy_state(source: Any, target: Any, bodies: Any) -> None:
    for k in range(bodies.blocks):
        s = bodies.start[k]
        for i in range(bodies.modes[k]):
            target[s + i] = source[s + i]
            target[s + ROW + i] = source[s + ROW + i]


@phase
def start_coarse(bodies: Any) -> None:
    """Give the modes of the coarse step the present state."""
    _copy_state(bodies.fine, bodies.coarse, bodies)


@phase
def move_free(bodies: Any, level: int) -> None:
    """Move all modes over the step, without its forces; those of the last step are pending."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[FREE + i] = 0.0
    for k in range(bodies.blocks):
        port0, port1 = bodies.port0[k], bodies.port1[k]
        block = _block(bodies, k, level)
        advance(block, bodies.modes[k], shift(S, PENDING), port0, port1, shift(S, FREE))


@phase
def apply_pending(bodies: Any, level: int) -> None:
    """Bring the forces of the last step into the modes, and these to the fine step."""
    S = bodies.at
    for k in range(bodies.blocks):
        port0, port1 = bodies.port0[k], bodies.port1[k]
        block = _block(bodies, k, level)
        apply_forces(block, bodies.modes[k], shift(S, PENDING), port0, port1)
    for i in range(row_length(bodies)):
        S[PENDING + i] = 0.0
    if level == 1:
        _copy_state(bodies.coarse, bodies.fine, bodies)


@phase
def guess_forces(bodies: Any) -> None:
    """Forces on the line through those of the last two steps."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[FORCE + i] = 2.0 * S[LAST + i] - S[BEFORE + i]
        S[BEFORE + i] = S[LAST + i]


@phase
def forget_forces(bodies: Any) -> None:
    """Forces of the last step, after one of another length or one that was discarded."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[FORCE + i] = S[LAST + i]
        S[BEFORE + i] = S[LAST + i]


@phase
def _port_end(bodies: Any, G: Any, p: int) -> float:
    """Displacement of a port at the end of the step under the forces of its body."""
    S = bodies.at
    total = S[FREE + p]
    for j in range(bodies.first[p], bodies.last[p]):
        total += G[p * PORTS + j] * S[FORCE + j]
    return total


@phase
def move_ports_by_guess(bodies: Any, G: Any) -> None:
    """Displacements at the end of a step under the forces so far; ``G`` of its level.

    These loops over ports stay scalar on purpose: a vector that is loaded from numbers stored one
    by one a moment before has to wait until they have left the store buffer.
    """
    S = bodies.at
    for p in range(bodies.ports):
        total = _port_end(bodies, G, p)
        S[Y1 + p] = total
        S[USED + p] = total


@phase
def move_ports(bodies: Any, G: Any) -> float:
    """The same under the new forces; returns the largest change."""
    S, moved = bodies.at, 0.0
    for p in range(bodies.ports):
        total = _port_end(bodies, G, p)
        S[Y1 + p] = total
        moved = max(moved, abs(total - S[USED + p]))
    return moved


@phase
def settled_ports(bodies: Any, moved: float, share: float, left: float, work: float) -> bool:
    """Whether the last change of the displacements matters no more.

    ``left`` and ``work`` are what the interfaces add to both sums.  What an element saw is
    ``d = Y1 - USED`` short of the end of the step, and catches up in the next one: of ``F dy`` the
    energy ``F_n (d_n - d_(n-1))`` is lost, in sum ``(F_n - F_(n+1)) d_n``.
    """
    S = bodies.at
    way = 0.0
    for p in range(bodies.ports):
        y, force = S[Y1 + p], S[ELEMENTS + p]
        here = abs(y - S[Y0 + p])
        way = max(way, here)
        left += abs((force - S[ELEMENTS_BEFORE + p]) * (y - S[USED + p]))
        work += abs(force) * here
    if moved <= share * way and left <= _ENERGY_LEFT * work and work < np.inf:
        return True
    displacement, by_forces = 0.0, 0.0
    for p in range(bodies.ports):
        displacement = max(displacement, abs(S[Y1 + p]))
        by_forces = max(by_forces, abs(S[Y1 + p] - S[FREE + p]))
    # a force or displacement that is not finite never settles
    return work < np.inf and moved <= max(_UNSEEN * by_forces, _ROUND_OFF * displacement)


@phase
def finite(bodies: Any) -> bool:
    """Whether all ports are somewhere; looked at while it can be seen which part is to blame."""
    total = 0.0
    for p in range(bodies.ports):
        total += bodies.at[Y1 + p]
    return abs(total) < np.inf


@phase
def end_ports(bodies: Any) -> None:
    """Take over displacements, forces and their work; the forces stay pending."""
    S = bodies.at
    for i in range(row_length(bodies)):
        S[WORK + i] += S[FORCE + i] * (S[Y1 + i] - S[Y0 + i])
        S[Y0 + i] = S[Y1 + i]
        S[SEEN + i] = S[USED + i]
        S[PENDING + i] = S[FORCE + i]
        S[LAST + i] = S[FORCE + i]
        S[ELEMENTS_BEFORE + i] = S[ELEMENTS + i]
