"""Films in the guide of a needle, in the compiled step of the interface level.

At each height the shaft squeezes the film of a short bearing (:mod:`klack.hydraulics.guide_film`).
Its clearance is that of the guide and what the roughness leaves, so that a shaft at the wall has a
film yet.  Where the wall holds it no film is squeezed across, only along the wall.
"""

import numpy as np

from klack.arrays import Matrix, Vector
from klack.compiling.jit import inner
from klack.hydraulics.guide_film import guide_film_step
from klack.transient.interface_arrays import Films, Guide, Modes, State

__all__ = ["count_bearing", "shaft_place", "squeeze_guide"]


_ROUNDS, _HALVINGS = 40, 12
_FOUND, _NEARLY = 1e-11, 1e-6  # places that do not fit, over the clearance


@inner
def shaft_place(bore: Guide, k: int, q: Vector) -> Vector:
    """Place of the shaft across the axis at a height [m], shape (2,)."""
    place = bore.offset[k].copy()
    for c in range(2):
        for i in range(len(q)):
            place[c] += bore.traces[k, c, i] * q[i]
    return place


@inner
def _within(place: Vector, clearance: float) -> float:
    """Share of a place that lies within the clearance."""
    distance = np.sqrt(place[0] ** 2 + place[1] ** 2)
    return clearance / distance if distance > clearance else 1.0


@inner
def _bearings(
    films: Films, bore: Guide, before: Matrix, after: Matrix, step: float, slides: bool
) -> tuple[Vector, Matrix]:
    """Forces of all heights over a step, shape (2 g,), and their slopes with the places after.

    ``slides``: slopes of a shaft that the wall stops and that slides along it, as it is.
    """
    heights = len(films.room)
    force, slopes = np.zeros(2 * heights), np.zeros((2 * heights, 2 * heights))
    for k in range(heights):
        room, strength = films.room[k], films.bearing[k]
        first = _within(before[k], bore.clearance[k]) / room
        last = _within(after[k], bore.clearance[k]) / room
        x, y, steep = guide_film_step(
            first * before[k, 0], first * before[k, 1],
            last * after[k, 0], last * after[k, 1], step,
        )  # fmt: skip
        force[2 * k], force[2 * k + 1] = strength * x, strength * y
        for c in range(2):
            for d in range(2):
                slopes[2 * k + c, 2 * k + d] = strength * steep[c, d] * last
        if slides and last * room < 1.0:  # no further out: the slope along the wall is left
            nx, ny = after[k, 0], after[k, 1]
            square = nx * nx + ny * ny
            for c in range(2):
                out = slopes[2 * k + c, 2 * k] * nx + slopes[2 * k + c, 2 * k + 1] * ny
                slopes[2 * k + c, 2 * k] -= out * nx / square
                slopes[2 * k + c, 2 * k + 1] -= out * ny / square
    return force, slopes


@inner
def squeeze_guide(
    films: Films, modes: Modes, bore: Guide, state: State, q: Vector, kick: Vector
) -> float:
    """Change of the modal force of the films at all heights over the step that leads to ``q``.

    Returns by how much the shaft moves by that, over its way in this step; below zero if no forces
    are found.

    Newton's method on the places at the end of the step, halved where it goes too far.
    """
    heights, M = len(films.room), len(q)
    n = 2 * heights
    rows = bore.traces.reshape((n, M))
    before, free = np.empty((heights, 2)), np.empty(n)
    for k in range(heights):
        was, now = shaft_place(bore, k, state.q), shaft_place(bore, k, q)
        for c in range(2):
            before[k, c], free[2 * k + c] = was[c], now[c]
    soft = (rows * modes.B1) @ rows.T
    old = state.bearing[:, :2].copy().reshape(n)
    free -= soft @ old
    least = np.min(films.room)
    slides = False
    force, size = _search(films, bore, before, free, soft, old, modes.step, slides)
    if not size < _NEARLY * least:
        slides = True
        force, size = _search(films, bore, before, free, soft, old, modes.step, slides)
    if not size < _NEARLY * least:
        return -1.0
    for k in range(heights):
        state.bearing[k, 0], state.bearing[k, 1] = force[2 * k], force[2 * k + 1]
    way = np.max(np.abs(free + soft @ force - before.reshape(n))) + _FOUND * least
    force -= old
    pushed = rows.T @ force
    for i in range(M):
        kick[i] = pushed[i]
    return float(np.max(np.abs(soft @ force)) / way)


@inner
def _search(
    films: Films,
    bore: Guide,
    before: Matrix,
    free: Vector,
    soft: Matrix,
    old: Vector,
    step: float,
    slides: bool,
) -> tuple[Vector, float]:
    """Forces of the films by Newton's method, and by how much places do not fit [m]."""
    n, heights = len(free), len(before)
    u = free + soft @ old
    force, slopes = _bearings(films, bore, before, u.reshape((heights, 2)), step, slides)
    left = free + soft @ force - u
    size, least = np.max(np.abs(left)), np.min(films.room)
    rounds = 0
    while size > _FOUND * least and rounds < _ROUNDS:
        rounds += 1
        change = np.linalg.solve(np.eye(n) - soft @ slopes, left)
        share, now = 1.0, size
        for _ in range(_HALVINGS):
            tried = u + share * change
            force, slopes = _bearings(
                films, bore, before, tried.reshape((heights, 2)), step, slides
            )
            left = free + soft @ force - tried
            now = np.max(np.abs(left))
            if now < size:
                break
            share *= 0.5
        u = tried
        if not now < size:  # round-off
            break
        size = now
    return force, size


@inner
def count_bearing(k: int, bore: Guide, state: State, q: Vector) -> None:
    """Add the loss of the film at a height over the step that leads to ``q``."""
    for c in range(2):
        for i in range(len(q)):
            way = bore.traces[k, c, i] * (q[i] - state.q[i])
            state.bearing[k, 2] -= state.bearing[k, c] * way
