"""Bodies that follow a course over time: before each step they get the speed that leads there."""

from typing import Any

from klack.simulation.modal_step import ROW, ROW_Q, ROW_V
from klack.simulation.network_arrays import ANSWER, FORCE, GUESS
from klack.simulation.network_ports import block_of
from klack.simulation.phase import phase

__all__ = ["drive_bodies", "drive_force"]


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
