r"""Coulomb friction and films of a guide over one step.

At a height where the bore presses with :math:`N`, the mean of both ends of the step, the rim of the
shaft touches it at :math:`r n` from the axis, :math:`n` against the force.  Its slip within the
step along the axis and around it (:math:`t = e_z \times n`) is

.. math:: \Delta s = R\, (q_1 - q_0), \qquad
    R = \begin{pmatrix} T_z + r\,(n_y \Theta_x - n_x \Theta_y) \\
    t \cdot T + r\, \Theta_z \end{pmatrix}

with the displacement :math:`T q` and the rotation :math:`\Theta q` of the section.  One force *f*
over the step, set-valued, without a speed below which it fades:

.. math:: |f| \le \mu |N|, \qquad f = -|f| \frac{\Delta s}{|\Delta s|} \text{ where }
    \Delta s \ne 0, \qquad f \cdot R v_1 \le 0 ,

and of these the largest: friction holds the shaft as long as it can, opposes slip with :math:`\mu
|N|`, and stops the shaft in the step in which it comes to rest (a force that makes :math:`\Delta s`
zero there leaves :math:`v_1 = -v_0`, and a shaft at rest would tremble).  So :math:`-f \cdot \Delta
s \ge 0` in every step.

With one height the slip follows from its force by two compliances,
:math:`\Delta s = \Delta s_f + R B_1 R^T f` and :math:`R v_1 = R v_f + R B_2 R^T f`; heights take
turns until no force changes.

Limits: along the axis and around it the section has only the compliance of the kept modes; how
several heights share the friction of a held shaft is not unique; the bore stays round and at rest.
Friction is found before the contact forces of the seat and once more after them, which leaves these
with a gap of less than :math:`h^2 \mu N / m` in steps in which the shaft turns round; the energy
debt of the seat is paid last, some 1e-6 of its force.

At each height the shaft squeezes the film of a short bearing (:mod:`klack.hydraulics.guide_film`),
with the clearance of the guide and what the roughness leaves, so that a shaft at the wall still has
a film.  A shaft that the wall holds squeezes it only along the wall.
"""

from typing import NamedTuple

import numpy as np

from klack.arrays import Cube, Matrix, Vector
from klack.hydraulics.guide_film import guide_film_step
from klack.machine.compiling.jit import FAST, inner, njit
from klack.simulation.phase import phase
from klack.transient.interface_arrays import Films, Guide, Modes, State, Step

__all__ = [
    "GuideRub",
    "begin_rub",
    "count_bearing",
    "no_rub",
    "rub_guide",
    "shaft_place",
    "squeeze_guide",
    "stopping_force",
]


Four = tuple[float, float, float, float]

_NEWTON = 60
_HALVINGS = 60
_TURNS = 200
_TINY = 1e-15  # of the compliance: a direction in which nothing moves
_ROUND = 1e-14
_STILL = 1e-13  # of the largest force: heights that take turns have settled


class GuideRub(NamedTuple):
    """Friction of the guide over the present step."""

    most: Vector  # (k,) [N]
    force: Matrix  # (k, 2) [N] on the shaft, along the axis and around it
    rim: Cube  # (k, 2, M) displacement of the rim of the shaft in these directions


@inner
def no_rub(heights: int, modes: int) -> GuideRub:
    """Room for the friction at some heights."""
    return GuideRub(np.zeros(heights), np.zeros((heights, 2)), np.zeros((heights, 2, modes)))


@inner
def _on_disc(C: Four, s0: float, s1: float, most: float) -> tuple[float, float]:
    """Force of at most ``most`` whose slip s + C f vanishes, or is opposite to it."""
    d = _TINY * (C[0] + C[3])
    f0, f1, size, slips = 0.0, 0.0, 0.0, False
    for _ in range(_NEWTON):
        a, b = C[0] + d, C[3] + d
        det = a * b - C[1] * C[1]
        f0, f1 = (C[1] * s1 - b * s0) / det, (C[1] * s0 - a * s1) / det
        size = np.sqrt(f0 * f0 + f1 * f1)
        if size <= most * (1.0 + _ROUND):
            break
        # 1/|f| is concave over d: every step stays below the root
        slips = True
        soft = (b * f0 * f0 - 2.0 * C[1] * f0 * f1 + a * f1 * f1) / det
        d += (size / most - 1.0) * size * size / soft
    if slips and size > 0.0:
        f0, f1 = f0 * most / size, f1 * most / size
    return f0, f1


@njit
def stopping_force(
    C: Four, s0: float, s1: float, D: Four, u0: float, u1: float, most: float
) -> tuple[float, float]:
    """Friction of one height over a step [N], at most ``most``.

    Parameters
    ----------
    C [m/N]
        Slip per force, row by row; symmetric.
    s0, s1 [m]
        Slip without the force.
    D [m/(N s)]
        Speed at the end per force.
    u0, u1 [m/s]
        That speed without the force.
    """
    if most <= 0.0:
        return 0.0, 0.0
    low, high = 0.0, most
    f0, f1 = _on_disc(C, s0, s1, most)
    for halving in range(_HALVINGS):
        stops = f0 * (D[0] * f0 + D[1] * f1) + f1 * (D[2] * f0 + D[3] * f1)
        turned = f0 * u0 + f1 * u1 + stops > _ROUND * stops
        if halving == 0:
            if not turned:
                return f0, f1
            high = np.sqrt(f0 * f0 + f1 * f1)
        elif turned:
            high = 0.5 * (low + high)
        else:
            low = 0.5 * (low + high)
        f0, f1 = _on_disc(C, s0, s1, 0.5 * (low + high))
    if low == 0.0:
        return 0.0, 0.0
    return _on_disc(C, s0, s1, low)


@phase
def begin_rub(bore: Guide, before: Matrix, after: Matrix, rub: GuideRub) -> bool:
    """Take the normal forces at both ends of a step; whether any height rubs."""
    rubs = False
    for k in range(len(rub.most)):
        x = 0.5 * (before[k, 0] + after[k, 0])
        y = 0.5 * (before[k, 1] + after[k, 1])
        normal = np.sqrt(x * x + y * y)
        rub.most[k] = bore.friction[k] * normal
        rub.force[k, 0] = rub.force[k, 1] = 0.0
        if rub.most[k] > 0.0:
            rubs = True
            nx, ny, r = -x / normal, -y / normal, bore.radius[k]
            for i in range(rub.rim.shape[2]):
                turn = ny * bore.turn[k, 0, i] - nx * bore.turn[k, 1, i]
                rub.rim[k, 0, i] = bore.slide[k, i] + r * turn
                across = nx * bore.traces[k, 1, i] - ny * bore.traces[k, 0, i]
                rub.rim[k, 1, i] = across + r * bore.turn[k, 2, i]
    return rubs


@inner(_nrt=False, error_model="numpy", fastmath=FAST)
def rub_guide(modes: Modes, rub: GuideRub, before: Vector, step: Step) -> float:
    """Let friction act against what the other forces make of a step; returns the spring's part [N].

    Called again after other forces, it changes the friction accordingly.

    Parameters
    ----------
    before (M,)
        Coordinates at the start of the step.
    step
        In and out: modal forces of the step and the state at its end.
    """
    known, whole, q, v, share = step.known, step.whole, step.q, step.v, step.share
    push, B1, B2 = modes.push, modes.B1, modes.B2
    answer = 0.0
    largest = 0.0
    for k in range(len(rub.most)):
        largest = max(largest, rub.most[k])
    for _ in range(_TURNS):
        changed = 0.0
        for k in range(len(rub.most)):
            if rub.most[k] <= 0.0:
                continue
            along, around = rub.rim[k, 0], rub.rim[k, 1]
            c00 = c01 = c11 = d00 = d01 = d11 = s0 = s1 = u0 = u1 = 0.0
            p0 = p1 = w0 = w1 = 0.0  # of the spring
            for i in range(len(q)):
                a, b = along[i] * B1[i], around[i] * B1[i]
                c00 += a * along[i]
                c01 += a * around[i]
                c11 += b * around[i]
                p0 += a * push[i]
                p1 += b * push[i]
                a, b = along[i] * B2[i], around[i] * B2[i]
                d00 += a * along[i]
                d01 += a * around[i]
                d11 += b * around[i]
                w0 += a * push[i]
                w1 += b * push[i]
                s0 += along[i] * (q[i] - before[i])
                s1 += around[i] * (q[i] - before[i])
                u0 += along[i] * v[i]
                u1 += around[i] * v[i]
            C = (
                c00 - share * p0 * p0,
                c01 - share * p0 * p1,
                c01 - share * p1 * p0,
                c11 - share * p1 * p1,
            )
            D = (
                d00 - share * w0 * p0,
                d01 - share * w0 * p1,
                d01 - share * w1 * p0,
                d11 - share * w1 * p1,
            )
            f0, f1 = rub.force[k, 0], rub.force[k, 1]
            s0 -= C[0] * f0 + C[1] * f1
            s1 -= C[2] * f0 + C[3] * f1
            u0 -= D[0] * f0 + D[1] * f1
            u1 -= D[2] * f0 + D[3] * f1
            rub.force[k, 0], rub.force[k, 1] = stopping_force(C, s0, s1, D, u0, u1, rub.most[k])
            f0, f1 = rub.force[k, 0] - f0, rub.force[k, 1] - f1
            pull = -share * (p0 * f0 + p1 * f1)
            for i in range(len(q)):
                kick = along[i] * f0 + around[i] * f1 + push[i] * pull
                known[i] += kick
                whole[i] += kick
                q[i] += B1[i] * kick
                v[i] += B2[i] * kick
            answer += pull
            changed = max(changed, abs(f0), abs(f1))
        if changed <= _STILL * largest:
            break
    return answer


_ROUNDS, _SMALLER = 40, 12
_FOUND, _NEARLY = 1e-11, 1e-6  # places that do not fit, over the clearance


@inner
def shaft_place(bore: Guide, k: int, q: Vector) -> Vector:
    """Place of the shaft across the axis [m], shape (2,)."""
    place = bore.offset[k].copy()
    for c in range(2):
        for i in range(len(q)):
            place[c] += bore.traces[k, c, i] * q[i]
    return place


@inner
def _within(place: Vector, clearance: float) -> float:
    distance = np.sqrt(place[0] ** 2 + place[1] ** 2)
    return clearance / distance if distance > clearance else 1.0


@inner
def _bearings(
    films: Films, bore: Guide, before: Matrix, after: Matrix, step: float, slides: bool
) -> tuple[Vector, Matrix]:
    """Forces of all heights over a step (2 g,), and their slopes with the places after.

    ``slides``: slopes of a shaft that slides along the wall that stops it.
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

    By Newton's method on the places at the end of the step, halved where it goes too far.  Returns
    how far this moves the shaft, over its displacement in the step; below zero if no forces are
    found.
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
    """Forces of the films by Newton's method, and the misfit of places [m]."""
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
        for _ in range(_SMALLER):
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
