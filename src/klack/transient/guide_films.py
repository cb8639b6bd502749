"""Films in the guide of a needle, in the compiled step of the interface level.

At each height the shaft squeezes the film of a short bearing (:mod:`klack.hydraulics.guide_film`).
Its clearance is that of the guide and what the roughness leaves, so that a shaft at the wall has a
film yet.  Where the wall holds it no film is squeezed across, only along the wall.
"""

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit
from klack.hydraulics.guide_film import guide_film_step
from klack.transient.interface_arrays import Bore, Films, Modes, State

__all__ = ["count_bearing", "shaft_place", "squeeze_guide"]

Vector = NDArray[np.float64]

_ROUNDS, _HALVINGS = 40, 12
_FOUND, _NEARLY = 1e-11, 1e-6  # places that do not fit, over the clearance


@njit
def shaft_place(bore: Bore, k: int, q: Vector) -> Vector:
    """Place of the shaft across the axis at a height [m], shape (2,)."""
    place = bore.offset[k].copy()
    for c in range(2):
        for i in range(len(q)):
            place[c] += bore.traces[k, c, i] * q[i]
    return place


@njit
def _within(place: Vector, clearance: float) -> float:
    """Share of a place that lies within the clearance."""
    distance = np.sqrt(place[0] ** 2 + place[1] ** 2)
    return clearance / distance if distance > clearance else 1.0


@njit
def squeeze_guide(
    films: Films, k: int, modes: Modes, bore: Bore, state: State, q: Vector, kick: Vector
) -> bool:
    """Modal force of the film at a height over the step that leads to ``q`` without it.

    Newton's method on the place at the end of the step, halved where it goes too far; False if none
    is found.
    """
    room, clearance = films.room[k], bore.clearance[k]
    before, free = shaft_place(bore, k, state.q), shaft_place(bore, k, q)
    before *= _within(before, clearance)
    soft = np.zeros((2, 2))
    for c in range(2):
        for d in range(2):
            for i in range(len(q)):
                soft[c, d] += bore.traces[k, c, i] * modes.B1[i] * bore.traces[k, d, i]
    u, f, slopes = before.copy(), np.zeros(2), np.zeros((2, 2))
    left, size, found = free - u, np.inf, False
    change = np.zeros(2)
    for rounds in range(_ROUNDS):
        if rounds > 0:
            change = np.linalg.solve(np.eye(2) - soft @ slopes, left)
        share, now = 1.0, size
        for _ in range(_HALVINGS):
            tried = u + share * change
            inside = _within(tried, clearance)
            x, y, steep = guide_film_step(
                before[0] / room, before[1] / room,
                inside * tried[0] / room, inside * tried[1] / room, modes.step,
            )  # fmt: skip
            force = np.array([x, y]) * films.bearing[k]
            rest = free + soft @ force - tried
            now = np.sqrt(rest[0] ** 2 + rest[1] ** 2)
            if now < size:
                break
            share *= 0.5
        if not now < size:  # round-off
            break
        u, f, left, size = tried, force, rest, now
        # the wall turns no way across it into a way along it
        slopes = steep * (films.bearing[k] / room) * inside
        if size <= _FOUND * room:
            found = True
            break
    if not (found or size < _NEARLY * room):
        return False
    for i in range(len(q)):
        kick[i] = bore.traces[k, 0, i] * f[0] + bore.traces[k, 1, i] * f[1]
    state.bearing[k, 0], state.bearing[k, 1] = f[0], f[1]
    return True


@njit
def count_bearing(k: int, bore: Bore, state: State, q: Vector) -> None:
    """Add the loss of the film at a height over the step that leads to ``q``."""
    for c in range(2):
        for i in range(len(q)):
            way = bore.traces[k, c, i] * (q[i] - state.q[i])
            state.bearing[k, 2] -= state.bearing[k, c] * way
