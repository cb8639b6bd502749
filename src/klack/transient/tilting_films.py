r"""Squeeze films between faces that tilt, in the compiled step of the interface level.

Lift and tilts :math:`u = (g, t_x, t_y)` of the land give the force and the moments :math:`f` that
do the work of the pressure (:mod:`klack.hydraulics.tilted_film`),

.. math:: h = \max(g + r\,(t_x \cos\theta + t_y \sin\theta), 0) + h_r, \qquad
    u = u_0 + Y q + D (f + S^T \lambda), \qquad g_k = g_{0k} + (\Phi q + C_l \lambda + S D f)_k .

Film and contact lie side by side in series with the compliance D of the bulk (as along the axis:
:class:`klack.mechanics.end_stop.EndStop`); S are lift and tilts at the contact points.  Where faces
are closed no film acts.

Forces are means over a step, from the heights at both ends, so that the work of the film is
dissipated at every step size.  The bulk holds :math:`\tfrac12 f^T D f + f^T D S^T \lambda`.  The
film is found before the contact, with the contact forces of the step before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from klack.arrays import Floats, Matrix, Vector
from klack.hydraulics.tilted_film import Land, SectorFilm, film_pressure, film_slopes
from klack.machine.compiling.jit import inner, njit
from klack.network.rows import FilmRow
from klack.transient.interface_arrays import Films, Guide, Modes, State
from klack.transient.interface_model import InterfaceModel

__all__ = [
    "LOST",
    "BearingFilm",
    "TiltingFilm",
    "begin_films",
    "bend_faces",
    "bulk_work",
    "count_squeeze",
    "film_arrays",
    "film_state",
    "film_strain",
    "squeeze",
    "tell_land",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TiltingFilm:
    """Land of a film at the contact points of an end stop.

    Parameters
    ----------
    stop
        Contact in the model.
    land
        None for a film that no tilt changes: a sphere.
    cubic [m^4]
        Force of the land over viscosity and closing speed, times the height cubed.
    slope [-]
        Sine of the angle between the axis and the land: 1 for a flat one.
    fit (3, n)
        Lift [-] and tilts [1/m] that fit gaps of the contact points best.
    base (3,)
        The same of the gaps of the centred faces in touch.
    """

    stop: str
    land: SectorFilm | None
    cubic: float
    slope: float
    fit: Floats
    base: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingFilm:
    """Film at each height of a guide, a short bearing.

    Parameters
    ----------
    length [m]
        Along the axis.
    cut_off [m]
        Height that the roughness leaves.
    """

    length: float
    cut_off: float

    def arrays(self, guide: Guide, viscosity: float) -> tuple[Floats, Floats]:
        """``mu L^3 R / c^2`` [N s] and clearance with the cut-off [m] at each height."""
        room = guide.clearance + self.cut_off
        return viscosity * self.length**3 * guide.radius / room**2, room


def film_arrays(
    model: InterfaceModel,
    films: Sequence[TiltingFilm],
    rows: Mapping[str, FilmRow],
    series: Mapping[str, float],
    bearing: Floats,
    room: Floats,
) -> Films:
    """Arrays of films for the compiled step, at the gaps of the model.

    Parameters
    ----------
    rows
        Of each of their stops, between parallel faces along the axis.
    series [m/N]
        Axial compliance of the bulk of the bodies at these stops.
    bearing, room (g,) [N s], [m]
        Of the films at the heights of the guide; empty without.
    """
    at = {name: slice(first, last) for name, first, last in model.contacts}
    here = [(film, rows[film.stop]) for film in films]
    lands = [_laid_out(film.land) for film in films]
    starts = np.cumsum([0, *(len(land) for land in lands)])[:-1]
    slope = np.array([film.slope for film in films])
    M, n = model.mode_count, model.count

    def each(values: list[Floats], *shape: int) -> Floats:
        return np.array(values) if values else np.zeros((0, *shape))

    return Films(
        rows=each([film.fit @ model.traces[at[film.stop]] for film in films], 3, M),
        offset=each([film.fit @ model.gap[at[film.stop]] - film.base for film in films], 3),
        lowest=slope * [row.cut_off for _, row in here],
        reach=np.array([1e-3 if f.land is None else f.land.outer_radius for f in films]),
        viscosity=np.array([row.cubic * film.slope / film.cubic for film, row in here]),
        tension=np.array([row.suction / (film.slope * _area(film)) for film, row in here]),
        shear=np.array([row.linear for _, row in here]) / slope,
        axial=slope,
        arms=each([_arms(model, film) for film in films], n, 3),
        span=np.array([(at[f.stop].start, at[f.stop].stop) for f in films], int).reshape(-1, 2),
        compliance=each([_bulk(model, film, series[film.stop]) for film in films], 3, 3),
        bearing=bearing,
        room=room,
        sizes=np.array([_sizes(film.land) for film in films], dtype=np.int64).reshape(-1, 5),
        start=np.array(starts, dtype=np.int64),
        land=np.concatenate([np.zeros(0), *lands]),
    )


def _arms(model: InterfaceModel, film: TiltingFilm) -> Floats:
    """Lift and tilts at the contact points of a film, zero at others, (n, 3)."""
    arms = np.zeros((model.count, 3))
    for name, first, last in model.contacts:
        if name == film.stop:
            arms[first:last, 0], arms[first:last, 1:] = 1.0, model.points[first:last, :2]
    return arms


def _bulk(model: InterfaceModel, film: TiltingFilm, series: float) -> Floats:
    """Compliance of the bulk as an elastic bed under the touching ring.

    Along the axis it is ``series``; a bed of the same stiffness under a ring of radius r has the
    tilting compliance 2/r^2 times as large.
    """
    points = slice(*next(c[1:] for c in model.contacts if c[0] == film.stop))
    radius = np.linalg.norm(model.points[points, :2], axis=1)
    weight = film.fit[0]
    square = float(weight @ radius**2 / np.sum(weight))
    return film.slope**2 * series * np.diag([1.0, 2.0 / square, 2.0 / square])


def _area(film: TiltingFilm) -> float:
    """Of the land [m^2]; 1 without one."""
    if film.land is None:
        return 1.0
    return pi * (film.land.outer_radius**2 - film.land.inner_radius**2)


def _sizes(land: SectorFilm | None) -> list[int]:
    if land is None:
        return [0, 0, 0, 0, 0]
    points, functions = land.load.shape
    return [land.sectors, land.circles, points, functions, land.shared]


def _laid_out(land: SectorFilm | None) -> Floats:
    if land is None:
        return np.zeros(0)
    parts = (land.rows(), land.between, land.along, land.around, land.load, land.area)
    return np.concatenate([part.ravel() for part in parts])


_ROUNDS, _SEARCHES = 60, 40
_ENOUGH = 0.2  # of the slope of the potential: found along a change
_ROUND_OFF = 1e-16
_FOUND = 1e-11  # heights that do not fit, over lift and the least height
_EXACTLY = 1e-13  # of the way of a step: no correction is left
_NEARLY = 1e-4  # the same at a corner, where sectors take turns in opening and closing
_LINEAR = 1e-4  # of the force: a change by so little follows the slopes
_UNMOVED = 1e-6  # of the way of a step: a film need not be solved again
_ALONG = 1e-3  # of the way of a step: slopes of an earlier one serve for so little

BEFORE, LOST, RATE, LENGTH, KNOWN, SLOPES, SOLVED, LIMIT = 3, 6, 7, 10, 11, 12, 21, 24
"""Columns of the state of a film, behind force and moments: those of the step before, the energy
lost, what the forces change by [1/s], the length of the last step [s], that of the step whose
slopes are known [s], these nine slopes, lift and tilts for which the film was solved, and which
sectors are at the limit of tension."""


@inner
def land_at(films: Films, k: int) -> Land:
    """Arrays of the land of film ``k``."""
    S, N, G, Q, shared = films.sizes[k]
    at, data = films.start[k] + S * N * 3, films.land
    between = data[at : at + G * N].reshape((G, N))
    at += G * N
    along = data[at : at + G * Q * Q].reshape((G, Q, Q))
    at += G * Q * Q
    around = data[at : at + G * Q * Q].reshape((G, Q, Q))
    at += G * Q * Q
    load = data[at : at + G * Q].reshape((G, Q))
    at += G * Q
    return Land(between, along, around, load, data[at : at + N], shared)


@inner
def _spread(films: Films, k: int) -> Matrix:
    """Heights of the circles of all sectors per lift and tilts, (S N, 3)."""
    S, N = films.sizes[k, 0], films.sizes[k, 1]
    begin = films.start[k]
    return films.land[begin : begin + S * N * 3].reshape((S * N, 3))


@njit
def film_state(films: Films, k: int, q: Vector) -> Vector:
    """Lift and tilts of a film without its own compliance, shape (3,)."""
    u = np.empty(3)
    for c in range(3):
        u[c] = films.offset[k, c]
        for i in range(len(q)):
            u[c] += films.rows[k, c, i] * q[i]
    return u


@inner
def contact_resultant(films: Films, k: int, lam: Vector) -> Vector:
    """Force and moments of contact forces under a film, shape (3,)."""
    held = np.zeros(3)
    for i in range(films.span[k, 0], min(films.span[k, 1], len(lam))):
        if lam[i] > 0.0:
            for c in range(3):
                held[c] += films.arms[k, i, c] * lam[i]
    return held


@njit
def bend_faces(films: Films, k: int, change: Vector, gap: Vector) -> None:
    """Open the gaps of contact points by a change of the film's force and moments."""
    bend = films.compliance[k] @ change
    for i in range(films.span[k, 0], min(films.span[k, 1], len(gap))):
        for c in range(3):
            gap[i] += films.arms[k, i, c] * bend[c]


@inner
def _raw_heights(films: Films, k: int, u: Vector) -> Matrix:
    """Gaps of the circles of all sectors, shape (S, N) [m]; below 0 where closed."""
    S, N = films.sizes[k, 0], films.sizes[k, 1]
    spread, x = _spread(films, k), np.zeros((S, N))
    for s in range(S):
        for j in range(N):
            for c in range(3):
                x[s, j] += spread[s * N + j, c] * u[c]
    return x


@inner
def _pressed(
    films: Films, k: int, u0: Vector, u1: Vector, step: float, steeply: bool, limit: Vector
) -> tuple[Vector, Matrix]:
    """Mean force and moments over a step, and ``steeply`` their slopes with its end.

    ``limit``: sectors at the limit of tension, 0 or 1; in: start of the search.
    """
    f, slopes = np.zeros(3), np.zeros((3, 3))
    lowest = films.lowest[k]
    if films.sizes[k, 0]:
        x0, x1 = _raw_heights(films, k, u0), _raw_heights(films, k, u1)
        if max(np.max(x0), np.max(x1)) <= 0.0:
            return f, slopes
        spread, land = _spread(films, k), land_at(films, k)
        S, N = x0.shape
        G = land.between.shape[0]
        mobility, change = np.empty((S, G)), np.empty((S, G))
        viscous = 6.0 * films.viscosity[k]
        for s in range(S):
            for p in range(G):
                a, b = 0.0, 0.0
                for j in range(N):
                    a += land.between[p, j] * x0[s, j]
                    b += land.between[p, j] * x1[s, j]
                open_now = b > 0.0
                a, b = max(a, 0.0) + lowest, max(b, 0.0) + lowest
                mobility[s, p] = a * a * b * b / (viscous * (a + b))
                change[s, p] = 0.0
                if open_now:
                    change[s, p] = a * a * b * (2.0 * a + b) / (viscous * (a + b) ** 2)
        head, still = np.zeros(land.load.shape), np.zeros(N)
        closing = np.empty((S, N))
        for s in range(S):
            for j in range(N):
                closing[s, j] = (max(x0[s, j], 0.0) - max(x1[s, j], 0.0)) / step
        held = limit[:S] > 0.0
        force, pressed = film_pressure(land, mobility, closing, head, still, films.tension[k], held)
        for s in range(S):
            limit[s] = 1.0 if held[s] else 0.0
        for s in range(S):
            for j in range(N):
                for c in range(3):
                    f[c] += spread[s * N + j, c] * force[s, j]
        if steeply:
            ways = spread.copy()
            for s in range(S):
                for j in range(N):
                    if x1[s, j] <= 0.0:
                        for c in range(3):
                            ways[s * N + j, c] = 0.0
            along = film_slopes(land, pressed, mobility, change, head, 1.0 / step, ways)
            for i in range(S * N):
                for c in range(3):
                    for d in range(3):
                        slopes[c, d] += spread[i, c] * along[i, d]
    if films.shear[k] > 0.0:
        a, b = max(u0[0], 0.0) + lowest, max(u1[0], 0.0) + lowest
        # mean of 1/h over the way
        share = np.log(a / b) / (a - b) if abs(a - b) > 1e-6 * a else 2.0 / (a + b)
        drag = films.shear[k] * share * (a - b) / step
        if films.sizes[k, 0] == 0 and drag < -films.tension[k]:
            drag = -films.tension[k]
        elif u1[0] > 0.0:
            slopes[0, 0] -= films.shear[k] / (b * step)
        f[0] += drag
    return f, slopes


@inner
def begin_films(state: State, step: float) -> None:
    """Remember the forces of the last step, and extrapolate them."""
    films = state.films
    for k in range(len(films)):
        for c in range(3):
            films[k, BEFORE + c] = films[k, c]
            films[k, c] += films[k, RATE + c] * 0.5 * (films[k, LENGTH] + step)
            films[k, SOLVED + c] = np.inf


@inner
def squeeze(films: Films, k: int, modes: Modes, state: State, q: Vector, kick: Vector) -> float:
    """Change of the modal force of a film over the step that leads to ``q`` with its present force.

    Returns the change of its heights over their displacement in the step; below zero if no force is
    found.

    Newton's method on lift and tilts, first with the slopes of an earlier step.  They minimise a
    convex potential, that of ``soft`` and that of the film; where Newton's step goes too far, its
    slope along the step is brought near zero.  A small last change of the forces is linear.
    """
    step, reach = modes.step, films.reach[k]
    rows, D = films.rows[k], films.compliance[k]
    soft, before = np.zeros((3, 3)), film_state(films, k, state.q)
    free = film_state(films, k, q)
    held = contact_resultant(films, k, state.lam)
    now = state.films[k, :3].copy()
    for c in range(3):
        for d in range(3):
            before[c] += D[c, d] * (state.films[k, BEFORE + d] + held[d])
            free[c] += D[c, d] * held[d]
            for i in range(len(q)):
                soft[c, d] += rows[c, i] * modes.B1[i] * rows[d, i]
    free -= soft @ now
    soft += D
    tiny = _FOUND * (films.lowest[k] + abs(before[0]) + abs(free[0] - before[0]))
    u = free + soft @ now
    way = _size(u - before, reach)
    solved, limit = state.films[k, SOLVED : SOLVED + 3], state.films[k, LIMIT:]
    if _size(u - solved, reach) <= _UNMOVED * (tiny + way):  # other films moved nothing here
        kick[:] = 0.0
        return 0.0
    known = state.films[k, KNOWN]
    steeply = known == state.films[k, LENGTH]  # the step before had to find slopes
    f, slopes = _pressed(films, k, before, u, step, steeply, limit)
    left = free + soft @ f - u
    least = _size(left, reach)
    best = f.copy()
    found = least <= min(tiny, _EXACTLY * way)
    if known > 0.0 and not steeply and (least <= tiny or least <= _ALONG * way):
        for c in range(3):
            for d in range(3):
                slopes[c, d] = state.films[k, SLOPES + 3 * c + d] * known / step
        found = found or _follow(films, k, u, f, slopes, soft, left, best) or least <= tiny
    if not found:
        stiff = np.linalg.inv(soft)
        rounds = 0
        while rounds < _ROUNDS:
            rounds += 1
            if rounds > 1 or not steeply:
                f, slopes = _pressed(films, k, before, u, step, True, limit)
            change = np.linalg.solve(np.eye(3) - soft @ slopes, left)
            along = stiff @ change
            first = along @ left  # slope of the potential along the change, its sign turned
            if first > 0.0 and _follow(films, k, u, f, slopes, soft, left, best):
                least = 0.0
                break
            if not first > 0.0:
                change = np.linalg.solve(np.eye(3) + soft @ _resisting(slopes, reach), left)
                along = stiff @ change
                first = along @ left
            low, high, at_low, at_high, share = 0.0, 1.0, first, 0.0, 1.0
            for search in range(_SEARCHES):
                tried = u + share * change
                f, _ = _pressed(films, k, before, tried, step, False, limit)
                left = free + soft @ f - tried
                slope = along @ left
                if (share == 1.0 and slope >= 0.0) or abs(slope) <= _ENOUGH * abs(first):
                    break
                if slope > 0.0:
                    low, at_low = share, slope
                else:
                    high, at_high = share, slope
                # across a corner a straight line finds little: every other time the middle
                share = at_low / (at_low - at_high) if search % 2 == 0 else 0.5
                share = low + (high - low) * share
            u = tried
            size = _size(left, reach)
            if size < least:
                least = size
                best = f.copy()
            if size <= tiny or _size(share * change, reach) <= _ROUND_OFF * _size(u, reach):
                break
            if size <= _ALONG * way and _follow(films, k, u, f, slopes, soft, left, best):
                least = 0.0
                break
        if not least < _NEARLY / _FOUND * tiny:
            return -1.0
        for c in range(3):
            for d in range(3):
                state.films[k, SLOPES + 3 * c + d] = slopes[c, d]
        state.films[k, KNOWN] = step
    fits = free + soft @ best
    for c in range(3):
        state.films[k, c], solved[c] = best[c], fits[c]
    best -= now
    for i in range(len(q)):
        kick[i] = 0.0
        for c in range(3):
            kick[i] += rows[c, i] * best[c]
    return float(_size(soft @ best, reach) / (tiny + _size(u - before, reach)))


@inner
def _follow(
    films: Films,
    k: int,
    u: Vector,
    f: Vector,
    slopes: Matrix,
    soft: Matrix,
    left: Vector,
    best: Vector,
) -> bool:
    """Let the forces follow their slopes to where heights fit, into ``best``, if that is little.

    Where sectors open or close on the way, slopes mean nothing: then the change has to be little
    also of the forces that ``soft`` would need for it, which none exceeds.
    """
    reach = films.reach[k]
    change = np.linalg.solve(np.eye(3) - soft @ slopes, left)
    more = slopes @ change
    little = _LINEAR * _weight(f, reach)
    if _weight(more, reach) > little:
        return False
    size, corner = _size(change, reach), False
    if films.sizes[k, 0]:
        x = _raw_heights(films, k, u)
        for height in x.flat:
            corner = corner or abs(height) <= size
    else:
        corner = abs(u[0]) <= size
    if corner and _weight(np.linalg.solve(soft, change), reach) > little:
        return False
    for c in range(3):  # a slice would have the text of its error compiled
        best[c] = f[c] + more[c]
    return True


@inner
def _weight(f: Vector, reach: float) -> float:
    """Force and moments as one force [N]."""
    return abs(f[0]) + (abs(f[1]) + abs(f[2])) / reach


@inner
def _resisting(slopes: Matrix, reach: float) -> Matrix:
    """Resisting part of a film's stiffness: symmetric, without what is below zero.

    Cavitating sectors beside closed ones have a little of the other kind.
    """
    scale = np.array([1.0, 1.0 / reach, 1.0 / reach])
    stiff = -0.5 * (slopes + slopes.T) * np.outer(scale, scale)
    values, shapes = np.linalg.eigh(stiff)
    stiff = (shapes * np.maximum(values, 0.0)) @ shapes.T
    return stiff / np.outer(scale, scale)


@inner
def _size(u: Vector, reach: float) -> float:
    return abs(u[0]) + reach * np.sqrt(u[1] ** 2 + u[2] ** 2)


@inner
def bulk_work(films: Films, k: int, state: State, lam: Vector) -> float:
    """Work [J] of the contact forces, up to ``lam``, on the bulk that a film bends."""
    D, work = films.compliance[k], 0.0
    first, last = contact_resultant(films, k, state.lam), contact_resultant(films, k, lam)
    for c in range(3):
        for d in range(3):
            change = state.films[k, d] - state.films[k, d + 3]
            work += 0.5 * (first[c] + last[c]) * D[c, d] * change
    return work


@inner
def bulk_energy(films: Films, k: int, force: Vector, held: Vector) -> float:
    """Energy [J] of the bulk by a film beside that by contact forces, ``held``."""
    D, energy = films.compliance[k], 0.0
    for c in range(3):
        for d in range(3):
            energy += D[c, d] * force[d] * (0.5 * force[c] + held[c])
    return energy


@inner
def count_squeeze(films: Films, k: int, state: State, q: Vector, lam: Vector, step: float) -> None:
    """Add the loss of a film over the step that leads to ``q`` and the contact forces ``lam``."""
    f = state.films[k]
    lost = bulk_work(films, k, state, lam)
    lost += bulk_energy(films, k, f[3:6], contact_resultant(films, k, state.lam))
    lost -= bulk_energy(films, k, f[:3], contact_resultant(films, k, lam))
    for c in range(3):
        for i in range(len(q)):
            lost -= f[c] * films.rows[k, c, i] * (q[i] - state.q[i])
    f[LOST] += lost
    for c in range(3):
        change = f[c] - f[BEFORE + c] if f[LENGTH] > 0.0 else 0.0
        f[RATE + c] = change / (0.5 * (f[LENGTH] + step))
    f[LENGTH] = step


@njit
def film_strain(films: Films, k: int, state: State) -> float:
    """Energy [J] that a film holds in the bulk."""
    held = contact_resultant(films, k, state.lam)
    return float(bulk_energy(films, k, state.films[k, :3], held))


@inner
def tell_land(films: Films, k: int, state: State, q: Vector, out: Vector) -> None:
    """Write lift and tilts of film ``k`` at the start and the end of a step, shape (6,).

    Called between the solutions of film and contact: ``q`` is what the film saw, and the contact
    forces are those of the step before.
    """
    D, held = films.compliance[k], contact_resultant(films, k, state.lam)
    first, last = film_state(films, k, state.q), film_state(films, k, q)
    for c in range(3):
        out[c], out[c + 3] = first[c], last[c]
        for d in range(3):
            out[c] += D[c, d] * (state.films[k, d + 3] + held[d])
            out[c + 3] += D[c, d] * (state.films[k, d] + held[d])
