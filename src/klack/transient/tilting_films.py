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
from klack.hydraulics.tilted_film import (
    Land,
    SectorFilm,
    add_slopes,
    film_room,
    film_rows,
    land_of,
    solve_film,
)
from klack.machine.compiling.jit import FAST, inner, njit
from klack.network.rows import FilmRow
from klack.network.step_function import first
from klack.transient.interface_arrays import Films, FilmWork, Guide, Modes, State, Step
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
    "film_change",
    "film_state",
    "film_strain",
    "film_work",
    "hold_films",
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
    """Film at each height of the guides, a short bearing; one number is that of all heights.

    Parameters
    ----------
    length [m]
        Along the axis; 0 without a film.
    cut_off [m]
        Height that the roughness leaves.
    """

    length: float | Floats
    cut_off: float | Floats

    def arrays(self, guide: Guide, viscosity: float) -> tuple[Floats, Floats]:
        """``mu L^3 R / c^2`` [N s] and clearance with the cut-off [m] at each height."""
        room = guide.clearance + self.cut_off
        return viscosity * self.length**3 * np.abs(guide.radius) / room**2, room


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
    lands = [None if film.land is None else land_of(film.land, film.land.rows()) for film in films]
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
        ways=_stacked(lands, "ways", 3),
        worked=_stacked(lands, "worked", 3),
        between=_stacked(lands, "between", 2),
        along=_stacked(lands, "along", 3),
        around=_stacked(lands, "around", 3),
        load=_stacked(lands, "load", 2),
        area=_stacked(lands, "area", 1),
    )


def _arms(model: InterfaceModel, film: TiltingFilm) -> Floats:
    """Lift and tilts at the contact points of a film, zero at others, (n, 3)."""
    arms = np.zeros((model.count, 3))
    for name, begin, end in model.contacts:
        if name == film.stop:
            arms[begin:end, 0], arms[begin:end, 1:] = 1.0, model.points[begin:end, :2]
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


def _stacked(lands: Sequence[Land | None], name: str, dimensions: int) -> Floats:
    """Arrays of all lands, each with as much room as the largest one takes."""
    arrays = [
        np.zeros((0,) * dimensions) if land is None else getattr(land, name) for land in lands
    ]
    shapes = [array.shape for array in arrays] or [(0,) * dimensions]
    stacked = np.zeros((len(arrays), *np.max(shapes, axis=0)))
    for place, array in zip(stacked, arrays, strict=True):
        place[tuple(slice(length) for length in array.shape)] = array
    return stacked


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


Three = tuple[float, float, float]

_part = inner(_nrt=False, error_model="numpy", fastmath=FAST)
_short = inner(_nrt=False, error_model="numpy", fastmath=FAST, forceinline=True)


@_short
def land_at(films: Films, k: int) -> Land:
    """Land of film ``k``."""
    S, N, G, Q, shared = films.sizes[k]
    return Land(
        S,
        N,
        G,
        Q,
        shared,
        films.ways[k],
        films.worked[k],
        films.between[k],
        films.along[k],
        films.around[k],
        films.load[k],
        films.area[k],
    )


@inner
def film_work(films: Films, modes: Modes) -> FilmWork:
    """Memory of the films, and what does not change from step to step."""
    count, M = len(films.lowest), len(modes.B1)
    most = np.zeros(5, dtype=np.int64)
    for k in range(count):
        for c in range(5):
            most[c] = max(most[c], films.sizes[k, c])
    S, N, G, Q, shared = most
    soft = films.compliance.copy()
    for k in range(count):
        for c in range(3):
            for d in range(3):
                for i in range(M):
                    soft[k, c, d] += films.rows[k, c, i] * modes.B1[i] * films.rows[k, d, i]
    return FilmWork(
        film_room(S, N, G, Q + shared, shared, 3),
        soft,
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((count, 2, 3)),
    )


@njit(_nrt=False, error_model="numpy", fastmath=FAST)
def film_state(films: Films, k: int, q: Vector) -> Three:
    """Lift and tilts of a film without its own compliance."""
    lift, x, y = films.offset[k, 0], films.offset[k, 1], films.offset[k, 2]
    first, second, third = films.rows[k, 0], films.rows[k, 1], films.rows[k, 2]
    for i in range(len(q)):
        lift += first[i] * q[i]
        x += second[i] * q[i]
        y += third[i] * q[i]
    return lift, x, y


@_short
def _three(of: Vector) -> Three:
    return of[0], of[1], of[2]


@_short
def _times(A: Matrix, x: Three) -> Three:
    return (
        A[0, 0] * x[0] + A[0, 1] * x[1] + A[0, 2] * x[2],
        A[1, 0] * x[0] + A[1, 1] * x[1] + A[1, 2] * x[2],
        A[2, 0] * x[0] + A[2, 1] * x[1] + A[2, 2] * x[2],
    )


@_short
def _plus(x: Three, y: Three, share: float) -> Three:
    return x[0] + share * y[0], x[1] + share * y[1], x[2] + share * y[2]


@_short
def _dot(x: Three, y: Three) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@_short
def _solved(a: Three, b: Three, c: Three, x: Three) -> Three:
    """Solution of three equations with these rows."""
    p = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    q = c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]
    r = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    over = 1.0 / _dot(a, p)
    return (
        over * (p[0] * x[0] + q[0] * x[1] + r[0] * x[2]),
        over * (p[1] * x[0] + q[1] * x[1] + r[1] * x[2]),
        over * (p[2] * x[0] + q[2] * x[1] + r[2] * x[2]),
    )


@_short
def _against(soft: Matrix, x: Three) -> Three:
    """Force and moments that make lift and tilts."""
    return _solved(_three(soft[0]), _three(soft[1]), _three(soft[2]), x)


@_short
def _yield_to(soft: Matrix, slopes: Matrix, x: Three) -> Three:
    """Newton's change: lift and tilts for which ``(1 - soft slopes) u`` is ``x``."""
    rows = (
        _plus((1.0, 0.0, 0.0), _row_times(soft, 0, slopes), -1.0),
        _plus((0.0, 1.0, 0.0), _row_times(soft, 1, slopes), -1.0),
        _plus((0.0, 0.0, 1.0), _row_times(soft, 2, slopes), -1.0),
    )
    return _solved(rows[0], rows[1], rows[2], x)


@_short
def _row_times(A: Matrix, c: int, B: Matrix) -> Three:
    return (
        A[c, 0] * B[0, 0] + A[c, 1] * B[1, 0] + A[c, 2] * B[2, 0],
        A[c, 0] * B[0, 1] + A[c, 1] * B[1, 1] + A[c, 2] * B[2, 1],
        A[c, 0] * B[0, 2] + A[c, 1] * B[1, 2] + A[c, 2] * B[2, 2],
    )


@njit(_nrt=False, error_model="numpy")
def contact_resultant(films: Films, k: int, lam: Vector) -> Three:
    """Force and moments of contact forces under a film."""
    force, x, y = 0.0, 0.0, 0.0
    arms = films.arms[k]
    for i in range(films.span[k, 0], min(films.span[k, 1], len(lam))):
        if lam[i] > 0.0:
            force += arms[i, 0] * lam[i]
            x += arms[i, 1] * lam[i]
            y += arms[i, 2] * lam[i]
    return force, x, y


@njit(_nrt=False, error_model="numpy")
def bend_faces(films: Films, k: int, change: Three, gap: Vector) -> None:
    """Open the gaps of contact points by a change of the film's force and moments."""
    bend, arms = _times(films.compliance[k], change), films.arms[k]
    for i in range(films.span[k, 0], min(films.span[k, 1], len(gap))):
        gap[i] += arms[i, 0] * bend[0] + arms[i, 1] * bend[1] + arms[i, 2] * bend[2]


@_part
def _fill(films: Films, k: int, work: FilmWork, u0: Three, u1: Three, step: float) -> bool:
    """Mobility of a film over a step, and how it closes; False where all of it is closed."""
    land, room, n = land_at(films, k), work.room, work.room.rows.shape[1]
    S, N, M = land.sectors, land.circles, first(room.rows)
    at = film_rows(N, land.points, land.functions, 3)
    lowest, viscous, opened = films.lowest[k], 1.0 / (6.0 * films.viscosity[k]), 0.0
    closing, moves, mobility, slope = (
        at.closing * n, at.moves * n, at.mobility * n, at.change * n
    )  # fmt: skip
    for j in range(N):  # two at most
        lift, x, y = land.ways[0, j], land.ways[1, j], land.ways[2, j]
        for k_ in range(S):
            was = lift[k_] * u0[0] + x[k_] * u0[1] + y[k_] * u0[2]
            now = lift[k_] * u1[0] + x[k_] * u1[1] + y[k_] * u1[2]
            M[2 * j * n + k_], M[(2 * j + 1) * n + k_] = was, now
            opened += 1.0 if was > 0.0 else 0.0
            opened += 1.0 if now > 0.0 else 0.0
            M[closing + j * n + k_] = (max(was, 0.0) - max(now, 0.0)) / step
            M[moves + j * n + k_] = 1.0 if now > 0.0 else 0.0
    if opened == 0.0:
        return False
    for p in range(land.points):
        here, there = land.between[p, 0], land.between[p, N - 1] if N > 1 else 0.0
        other = 2 * (N - 1) * n
        for k_ in range(S):
            was = here * M[k_] + there * M[other + k_]
            now = here * M[n + k_] + there * M[other + n + k_]
            a, b = max(was, 0.0) + lowest, max(now, 0.0) + lowest
            over = 1.0 / (a + b)
            M[mobility + p * n + k_] = a * a * b * b * viscous * over
            steep = a * a * b * (2.0 * a + b) * viscous * over * over
            M[slope + p * n + k_] = steep if now > 0.0 else 0.0
        M[mobility + p * n + S] = M[mobility + p * n]
    return True


@_part
def _pressed(
    films: Films,
    k: int,
    work: FilmWork,
    ends: tuple[Three, Three],
    step: float,
    steeply: bool,
    limit: Vector,
) -> Three:
    """Mean force and moments over a step between two heights.

    ``steeply`` also their slopes with the second one, into ``work``.  ``limit``: sectors at the
    limit of tension, 0 or 1; in: where the search for them begins.
    """
    u0, u1 = ends
    slopes, lowest = work.slopes, films.lowest[k]
    force, x, y = 0.0, 0.0, 0.0
    for c in range(9 if steeply else 0):
        slopes[c // 3, c % 3] = 0.0
    if films.sizes[k, 0]:
        if not _fill(films, k, work, u0, u1, step):
            return 0.0, 0.0, 0.0
        land, room = land_at(films, k), work.room
        solve_film(land, room, films.tension[k], limit)
        row = film_rows(land.circles, land.points, land.functions, 3).force
        for j in range(land.circles):
            pushed = room.rows[row + j]
            lift, tilt_x, tilt_y = land.ways[0, j], land.ways[1, j], land.ways[2, j]
            for s in range(land.sectors):
                force += lift[s] * pushed[s]
                x += tilt_x[s] * pushed[s]
                y += tilt_y[s] * pushed[s]
        if steeply:
            add_slopes(land, room, 1.0 / step, slopes)
    if films.shear[k] > 0.0:
        a, b = max(u0[0], 0.0) + lowest, max(u1[0], 0.0) + lowest
        # mean of 1/h over the way
        share = np.log(a / b) / (a - b) if abs(a - b) > 1e-6 * a else 2.0 / (a + b)
        drag = films.shear[k] * share * (a - b) / step
        if films.sizes[k, 0] == 0 and drag < -films.tension[k]:
            drag = -films.tension[k]
        elif steeply and u1[0] > 0.0:
            slopes[0, 0] -= films.shear[k] / (b * step)
        force += drag
    return force, x, y


@_short
def film_change(state: State, k: int, now: float, before: float) -> Three:
    """Sum of a film's force and moments and those of the step before, times factors."""
    own = state.films[k]
    zero = (0.0, 0.0, 0.0)
    return _plus(_plus(zero, _three(own), now), _three(own[BEFORE:]), before)


@_part
def begin_films(films: Films, work: FilmWork, state: State, step: float, fresh: bool) -> None:
    """Remember the forces of the step before, and guess those of this one on a straight line.

    ``fresh`` where ``work`` does not know what the contact forces do there.
    """
    now = state.films
    for k in range(len(now)):
        if fresh:
            held = contact_resultant(films, k, state.lam)
            work.held[k, 1, 0], work.held[k, 1, 1], work.held[k, 1, 2] = held
        for c in range(3):
            work.held[k, 0, c], work.held[k, 1, c] = work.held[k, 1, c], 0.0
            now[k, BEFORE + c] = now[k, c]
            now[k, c] += now[k, RATE + c] * 0.5 * (now[k, LENGTH] + step)
            now[k, SOLVED + c] = np.inf


@_part
def hold_films(films: Films, work: FilmWork, lam: Vector) -> None:
    """Take in the contact forces at the end of the step."""
    for k in range(len(films.lowest)):
        held = contact_resultant(films, k, lam)
        work.held[k, 1, 0], work.held[k, 1, 1], work.held[k, 1, 2] = held


@_part
def squeeze(films: Films, k: int, step: float, state: State, trial: Step, work: FilmWork) -> float:
    """Change of the modal force of a film over the step that ends with its present force.

    Returns the change of its heights over their displacement in the step; below zero if no force is
    found.

    Newton's method on lift and tilts, first with the slopes of an earlier step.  They minimise a
    convex potential, that of ``soft`` and that of the film; where Newton's step goes too far, its
    slope along the step is brought near zero.  A small last change of the forces is linear.
    """
    reach, soft, slopes = films.reach[k], work.soft[k], work.slopes
    own, kick = state.films[k], trial.kick
    held = _three(work.held[k, 0])
    now = _three(own)
    before = film_state(films, k, state.q)
    before = _plus(before, _times(films.compliance[k], _plus(held, _three(own[BEFORE:]), 1.0)), 1.0)
    free = film_state(films, k, trial.q)
    free = _plus(free, _times(films.compliance[k], _plus(held, now, 1.0)), 1.0)
    free = _plus(free, _times(soft, now), -1.0)
    tiny = _FOUND * (films.lowest[k] + abs(before[0]) + abs(free[0] - before[0]))
    u = _plus(free, _times(soft, now), 1.0)
    way = _size(_plus(u, before, -1.0), reach)
    limit = own[LIMIT:]
    if _size(_plus(u, _three(own[SOLVED:]), -1.0), reach) <= _UNMOVED * (tiny + way):
        for i in range(len(kick)):  # other films moved nothing here
            kick[i] = 0.0
        return 0.0
    known = own[KNOWN]
    steeply = known == own[LENGTH]  # the step before had to find slopes
    f = _pressed(films, k, work, (before, u), step, steeply, limit)
    left = _plus(_plus(free, _times(soft, f), 1.0), u, -1.0)
    least, best = _size(left, reach), f
    found = least <= min(tiny, _EXACTLY * way)
    if known > 0.0 and not steeply and (least <= tiny or least <= _ALONG * way):
        for c in range(3):
            for d in range(3):
                slopes[c, d] = own[SLOPES + 3 * c + d] * known / step
        if not found:
            follows, followed = _follow(films, k, u, f, slopes, soft, left)
            best = followed if follows else best
            found = follows or least <= tiny
    if not found:
        for rounds in range(_ROUNDS):
            if rounds > 0 or not steeply:
                f = _pressed(films, k, work, (before, u), step, True, limit)
            change = _yield_to(soft, slopes, left)
            along = _against(soft, change)
            downhill = _dot(along, left)  # slope of the potential along it, its sign turned
            if downhill > 0.0:
                follows, followed = _follow(films, k, u, f, slopes, soft, left)
                if follows:
                    best, least = followed, 0.0
                    break
            if not downhill > 0.0:
                _resist(slopes, reach, work.stiffer)
                change = _yield_to(soft, work.stiffer, left)
                along = _against(soft, change)
                downhill = _dot(along, left)
            low, high, at_low, at_high, share = 0.0, 1.0, downhill, 0.0, 1.0
            tried = u
            for search in range(_SEARCHES):
                tried = _plus(u, change, share)
                f = _pressed(films, k, work, (before, tried), step, False, limit)
                left = _plus(_plus(free, _times(soft, f), 1.0), tried, -1.0)
                slope = _dot(along, left)
                if (share == 1.0 and slope >= 0.0) or abs(slope) <= _ENOUGH * abs(downhill):
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
                least, best = size, f
            if size <= tiny or share * _size(change, reach) <= _ROUND_OFF * _size(u, reach):
                break
            if size <= _ALONG * way:
                follows, followed = _follow(films, k, u, f, slopes, soft, left)
                if follows:
                    best, least = followed, 0.0
                    break
        if not least < _NEARLY / _FOUND * tiny:
            return -1.0
        for c in range(3):
            for d in range(3):
                own[SLOPES + 3 * c + d] = slopes[c, d]
        own[KNOWN] = step
    fits = _plus(free, _times(soft, best), 1.0)
    own[0], own[1], own[2] = best
    own[SOLVED], own[SOLVED + 1], own[SOLVED + 2] = fits
    best = _plus(best, now, -1.0)
    lift, tilt_x, tilt_y = films.rows[k, 0], films.rows[k, 1], films.rows[k, 2]
    for i in range(len(kick)):
        kick[i] = lift[i] * best[0] + tilt_x[i] * best[1] + tilt_y[i] * best[2]
    return _size(_times(soft, best), reach) / (tiny + _size(_plus(u, before, -1.0), reach))


@_part
def _follow(
    films: Films, k: int, u: Three, f: Three, slopes: Matrix, soft: Matrix, left: Three
) -> tuple[bool, Three]:
    """Let the forces follow their slopes to where heights fit, if that is little; those forces.

    Where sectors open or close on the way, slopes mean nothing: then the change has to be little
    also of the forces that ``soft`` would need for it, which none exceeds.
    """
    reach = films.reach[k]
    change = _yield_to(soft, slopes, left)
    more = _times(slopes, change)
    little = _LINEAR * _weight(f, reach)
    if _weight(more, reach) > little:
        return False, f
    size, corner = _size(change, reach), 0.0
    if films.sizes[k, 0]:
        for j in range(films.sizes[k, 1]):
            lift, x, y = films.ways[k, 0, j], films.ways[k, 1, j], films.ways[k, 2, j]
            for s in range(films.sizes[k, 0]):
                height = lift[s] * u[0] + x[s] * u[1] + y[s] * u[2]
                corner += 1.0 if abs(height) <= size else 0.0
    elif abs(u[0]) <= size:
        corner = 1.0
    if corner > 0.0 and _weight(_against(soft, change), reach) > little:
        return False, f
    return True, _plus(f, more, 1.0)


@_short
def _weight(f: Three, reach: float) -> float:
    """Force and moments as one force [N]."""
    return abs(f[0]) + (abs(f[1]) + abs(f[2])) / reach


@inner
def _resist(slopes: Matrix, reach: float, out: Matrix) -> None:
    """The part of a film's slopes that resists: symmetric, without stiffness below zero.

    Cavitating sectors beside closed ones have a little of the other kind.
    """
    scale = np.array([1.0, 1.0 / reach, 1.0 / reach])
    stiff = -0.5 * (slopes + slopes.T) * np.outer(scale, scale)
    values, shapes = np.linalg.eigh(stiff)
    stiff = (shapes * np.maximum(values, 0.0)) @ shapes.T
    for c in range(3):
        for d in range(3):
            out[c, d] = -stiff[c, d] / (scale[c] * scale[d])


@_short
def _size(u: Three, reach: float) -> float:
    """Largest height that lift and tilts make [m]."""
    return abs(u[0]) + reach * np.sqrt(u[1] ** 2 + u[2] ** 2)


@_part
def bulk_work(films: Films, k: int, work: FilmWork, state: State) -> float:
    """Work [J] of the contact forces of a step on the bulk that a film bends."""
    own, D = state.films[k], films.compliance[k]
    both = _plus(_three(work.held[k, 0]), _three(work.held[k, 1]), 1.0)
    return 0.5 * _dot(both, _times(D, _plus(_three(own), _three(own[BEFORE:]), -1.0)))


@_short
def bulk_energy(films: Films, k: int, force: Three, held: Three) -> float:
    """Energy [J] that the bulk holds by a film beside that by contact forces, ``held``."""
    return _dot(_plus(held, force, 0.5), _times(films.compliance[k], force))


@_part
def count_squeeze(
    films: Films, k: int, work: FilmWork, state: State, q: Vector, step: float
) -> None:
    """Add the loss of a film over the step that leads to ``q``, with its contact forces."""
    own = state.films[k]
    force, before = _three(own), _three(own[BEFORE:])
    lost = bulk_work(films, k, work, state)
    lost += bulk_energy(films, k, before, _three(work.held[k, 0]))
    lost -= bulk_energy(films, k, force, _three(work.held[k, 1]))
    lift, x, y = films.rows[k, 0], films.rows[k, 1], films.rows[k, 2]
    for i in range(len(q)):
        lost -= (lift[i] * force[0] + x[i] * force[1] + y[i] * force[2]) * (q[i] - state.q[i])
    own[LOST] += lost
    for c in range(3):
        change = own[c] - own[BEFORE + c] if own[LENGTH] > 0.0 else 0.0
        own[RATE + c] = change / (0.5 * (own[LENGTH] + step))
    own[LENGTH] = step


@njit(_nrt=False, error_model="numpy")
def film_strain(films: Films, k: int, state: State) -> float:
    """Energy [J] that a film holds in the bulk."""
    return bulk_energy(films, k, _three(state.films[k]), contact_resultant(films, k, state.lam))


@_part
def tell_land(films: Films, k: int, work: FilmWork, state: State, q: Vector, out: Vector) -> None:
    """Write lift and tilts of film ``k`` at the start and at the end of a step, shape (6,).

    Called between the solutions of film and contact: ``q`` is what the film saw, and the contact
    forces are those of the step before.
    """
    D, held, own = films.compliance[k], _three(work.held[k, 0]), state.films[k]
    first_, last = film_state(films, k, state.q), film_state(films, k, q)
    first_ = _plus(first_, _times(D, _plus(held, _three(own[BEFORE:]), 1.0)), 1.0)
    last = _plus(last, _times(D, _plus(held, _three(own), 1.0)), 1.0)
    out[0], out[1], out[2] = first_
    out[3], out[4], out[5] = last
