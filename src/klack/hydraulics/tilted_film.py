r"""Squeeze film of a ring or disc that tilts: Reynolds' equation over sectors and circles.

.. math:: \nabla\cdot\Bigl(\frac{h^3}{12\mu}\nabla p\Bigr) = \dot h

Each of ``S`` sectors of the land has its own height, or several, on ``N`` circles, with straight
lines between.  Over the radius the pressure is a sum of given functions, the first one that of
parallel faces; their amplitudes differ from sector to sector (finite volumes round the
circumference, Galerkin's method over the radius).  So parallel faces have exactly the force of
:class:`~klack.hydraulics.film.RingFilm` or :class:`~klack.hydraulics.film.DiscFilm` for any number
of sectors and circles.

Forces do the work of the pressure on the heights.  With the amplitudes ``P``, ``K P = L^T V`` and
``F = L P``, the power ``F V = P^T K P`` is never negative, and with a limited tension (an obstacle
problem for the mean pressure of every sector) it is ``P^T K P`` or more.
"""

from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

import numpy as np

from klack.arrays import Cube, Floats, Matrix, Vector
from klack.errors import refuse_if, require_nonnegative, require_positive
from klack.hydraulics.ring_system import Ring, ring_of, solve_ring
from klack.machine.compiling.jit import FAST, inner, njit
from klack.network.step_function import first

__all__ = [
    "MOST_SECTORS",
    "FilmRoom",
    "FilmRows",
    "Land",
    "SectorFilm",
    "add_slopes",
    "film_forces",
    "film_room",
    "film_rows",
    "land_of",
    "mean_mobility",
    "sector_film",
    "sector_forces",
    "sector_step",
    "solve_film",
    "solved_film",
]


_POINTS, _FEWER = 12, 8  # Gauss points between two circles: faces that touch have kinks there
_FEWEST_SECTORS = 4
_ACTIVE_SETS = 60  # before sectors change one at a time
_TINY = 1e-12  # of the largest tension: round-off

MOST_SECTORS = 360
_STRIDE = MOST_SECTORS + 8
"""From one row to the next: known to the compiler, so that it sees that rows are apart."""

_part = inner(_nrt=False, error_model="numpy", fastmath=FAST, forceinline=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SectorFilm:
    """Land of a film in sectors and circles, prepared for any heights.

    Parameters
    ----------
    inner_radius, outer_radius [m]
        An inner radius of 0 makes a disc.
    angles (S,) [rad]
        Middles of the sectors.
    radii (N,) [m]
        Of the circles with heights; a single one is at the centre of the pressure of parallel
        faces.
    spread [-]
        Mean of ``cos`` over a sector, over that of its middle.
    shared
        Functions of the radius with one amplitude for all sectors.
    between (G, N) [-]
        Shares of the circles in the height of the points of quadrature.
    along, around (G, Q, Q) [-]
        ``f_a' f_b' r dr`` times the angle of a sector, and ``f_a f_b dr / r`` over it, at the
        points; functions ``f`` have no unit.
    load (G, Q) [m^2]
        ``f_a r dr`` times the angle of a sector.
    head (G, Q) [-]
        ``f_a' l' r dr`` times the angle, of the logarithm ``l`` that is 1 at the inner edge.
    inward (N,) [m^2]
        ``int l r dr`` times the angle, shared among the circles.
    area (N,) [m^2]
        Of a sector, shared among the circles.
    """

    inner_radius: float
    outer_radius: float
    angles: Floats
    radii: Floats
    spread: float
    shared: int
    between: Floats
    along: Floats
    around: Floats
    load: Floats
    head: Floats
    inward: Floats
    area: Floats

    @property
    def sectors(self) -> int:
        """Number of sectors."""
        return self.angles.size

    @property
    def circles(self) -> int:
        """Number of heights in a sector."""
        return self.radii.size

    def rows(self) -> Floats:
        """Heights per lift and both tilts; shape (S N, 3) [-], [m], [m].

        Lift along +z, ``h = z + r (tilt_x cos + tilt_y sin)``.  These rows, transposed, times the
        forces are force and moments with the same work.
        """
        reach = self.spread * self.radii
        rows = np.empty((self.sectors, self.circles, 3))
        rows[:, :, 0] = 1.0
        rows[:, :, 1] = np.cos(self.angles)[:, None] * reach
        rows[:, :, 2] = np.sin(self.angles)[:, None] * reach
        return rows.reshape(-1, 3)


def sector_film(
    inner_radius: float, outer_radius: float, *, sectors: int = 36, circles: int = 1
) -> SectorFilm:
    """Cut a flat ring or disc into sectors and circles.

    Parameters
    ----------
    inner_radius, outer_radius [m]
    sectors
        At least 4; 36 are within 0.5 % of many.
    circles
        1 for a narrow land; 2 for a rigid tilt, straight between both edges; more for faces that
        bend.
    """
    require_nonnegative("sector_film: inner_radius", inner_radius, "m")
    require_positive("sector_film: width", outer_radius - inner_radius, "m")
    for name, number, least in (("sectors", sectors, _FEWEST_SECTORS), ("circles", circles, 1)):
        refuse_if(
            number < least,
            f"sector_film: {name}",
            got=f"{number}",
            expected=f"at least {least}",
            hint="36 sectors and 1 circle for a narrow land, 2 for a wide one.",
        )
    refuse_if(
        sectors > MOST_SECTORS,
        "sector_film: sectors",
        got=f"{sectors}",
        expected=f"at most {MOST_SECTORS}",
        hint="36 sectors are within 0.5 % of the limit of many.",
    )
    width, angle = outer_radius - inner_radius, 2.0 * pi / sectors
    panels = max(circles - 1, 1)
    points = _FEWER if outer_radius < 2.0 * inner_radius else _POINTS
    x, weight = np.polynomial.legendre.leggauss(points)
    half = 0.5 * width / panels
    starts = 2.0 * half * np.arange(panels)[:, None]
    inside = (starts + half * (1.0 + x)).ravel()  # above the inner radius
    dr = np.tile(half * weight, panels)
    r = inner_radius + inside
    f, slope, shared = _radial_functions(inner_radius, outer_radius, inside, circles + 1)
    if circles == 1:
        radii = np.array([np.sum(f[0] * r * r * dr) / np.sum(f[0] * r * dr)])
        between = np.ones((r.size, 1))
    else:
        radii = np.linspace(inner_radius, outer_radius, circles)
        place = inside / width * (circles - 1)
        between = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(circles)))
    share, share_slope = np.zeros_like(r), np.zeros_like(r)
    if inner_radius > 0.0:
        t = np.log1p(width / inner_radius)
        share, share_slope = 1.0 - np.log1p(inside / inner_radius) / t, -1.0 / (t * r)
    own = f.copy()
    own[:shared] = 0.0
    return SectorFilm(
        inner_radius=inner_radius,
        outer_radius=outer_radius,
        angles=angle * np.arange(sectors, dtype=np.float64),
        radii=radii,
        spread=float(np.sinc(0.5 * angle / pi)),
        shared=shared,
        between=between,
        along=angle * np.einsum("ap,bp,p->pab", slope, slope, r * dr),
        around=np.einsum("ap,bp,p->pab", own, own, dr / r) / angle,
        load=angle * (f * r * dr).T.copy(),
        head=angle * (slope * share_slope * r * dr).T.copy(),
        inward=angle * (share * r * dr) @ between,
        area=angle * (r * dr) @ between,
    )


def _radial_functions(
    inner: float, outer: float, inside: Floats, count: int
) -> tuple[Floats, Floats, int]:
    """Functions of the radius, zero at both edges, their slopes [1/m], and how many are shared."""
    width, r = outer - inner, inner + inside
    s, s_slope = 2.0 * inside / width - 1.0, 2.0 / width
    if inner == 0.0:
        # the pressure in the middle has no direction: the first function has one amplitude
        y = r / outer
        f, slope = [1.0 - y * y], [-2.0 * y / outer]
        bubble, bubble_slope = y * (1.0 - y * y), (1.0 - 3.0 * y * y) / outer
        powers = range(count)
    else:
        t = np.log1p(width / inner)
        square, scale = width * (2.0 * inner + width), 1.0 / (width * width)
        f = [scale * (square * np.log1p(inside / inner) / t - inside * (2.0 * inner + inside))]
        slope = [scale * (square / (t * r) - 2.0 * r)]
        bubble, bubble_slope = 1.0 - s * s, -2.0 * s * s_slope
        powers = range(1, count)
    for n in powers:
        f.append(bubble * s**n)
        slope.append(bubble_slope * s**n + (n * bubble * s ** (n - 1) * s_slope if n else 0.0))
    return np.array(f), np.array(slope), 1 if inner == 0.0 else 0


def sector_forces(
    film: SectorFilm,
    heights: Floats,
    closing: Floats,
    viscosity: float,
    *,
    tension: float = np.inf,
    inner_pressure: float = 0.0,
    outer_pressure: float = 0.0,
) -> Floats:
    """Forces [N] that press the faces apart, at one instant; shape (S, N).

    Parameters
    ----------
    heights (S, N) [m]
        Above 0: gap and what the roughness leaves.
    closing (S, N) [m/s]
        ``-dh/dt``.
    viscosity [Pa s]
    tension [Pa]
        Largest mean tension of a sector, ``p_ambient - p_cavitation``.
    inner_pressure, outer_pressure [Pa]
        At the edges, above ambient; of a disc only the outer one.
    """
    _require_heights("sector_forces: heights", film, heights)
    x = heights @ film.between.T
    edges = _edges(film, inner_pressure, outer_pressure)
    mobility = x**3 / (12.0 * viscosity)
    return solved_film(film, mobility, closing, np.zeros_like(x), edges, tension, 0.0)[0]


def sector_step(
    film: SectorFilm,
    before: Floats,
    after: Floats,
    step: float,
    viscosity: float,
    *,
    tension: float = np.inf,
    inner_pressure: float = 0.0,
    outer_pressure: float = 0.0,
) -> tuple[Floats, Floats]:
    r"""Mean forces (S, N) [N] over a step, and slopes (S N, S N) [N/m] with the heights after.

    A point that goes from ``x_0`` to ``x_1`` has the mobility of the height with

    .. math:: \bar h^3 = \frac{2 x_0^2 x_1^2}{x_0 + x_1},

    the mean of ``1/h^3``.  So the work ``F (x_0 - x_1)`` is dissipated exactly, at every step size,
    and parallel faces lose the momentum of their film impulse.

    Parameters
    ----------
    film, viscosity, tension, inner_pressure, outer_pressure
        As of :func:`sector_forces`.
    before, after (S, N) [m]
        Heights, above 0.
    step [s]
    """
    for name, heights in (("before", before), ("after", after)):
        _require_heights(f"sector_step: {name}", film, heights)
    require_positive("sector_step: step", step, "s")
    x0, x1 = before @ film.between.T, after @ film.between.T
    mobility = mean_mobility(x0, x1, viscosity)
    change = x0**2 * x1 * (2.0 * x0 + x1) / (6.0 * viscosity * (x0 + x1) ** 2)
    edges = _edges(film, inner_pressure, outer_pressure)
    return solved_film(film, mobility, (before - after) / step, change, edges, tension, 1.0 / step)


def mean_mobility(before: Floats, after: Floats, viscosity: float) -> Floats:
    """Mobility [m^3/(Pa s)] of points between two heights: see :func:`sector_step`."""
    return np.asarray(before**2 * after**2 / (6.0 * viscosity * (before + after)))


def _edges(film: SectorFilm, inner: float, outer: float) -> tuple[Floats, Floats]:
    """Driving [Pa] and forces on the circles [N] of parallel faces between both pressures."""
    if film.inner_radius == 0.0:
        inner = outer
    return (inner - outer) * film.head, outer * film.area + (inner - outer) * film.inward


def solved_film(
    film: SectorFilm,
    mobility: Floats,
    closing: Floats,
    change: Floats,
    edges: tuple[Floats, Floats],
    tension: float,
    rate: float,
) -> tuple[Floats, Floats]:
    """Forces on the circles, shape (S, N) [N], and with a rate their slopes with the heights.

    Parameters
    ----------
    mobility, change : array (S, G)
        ``h^3/12 mu`` at the points of all sectors, and its slope with the height.
    closing : array (S, N) [m/s]
    edges
        Driving of the pressures at the edges [Pa], and forces on the circles [N].
    rate [1/s]
        How the closing falls with the heights: 1 over a step.
    """
    heights = film.sectors * film.circles
    land = land_of(film, np.eye(heights) if rate else np.zeros((heights, 0)))
    (N, G, Q), w, S = land[1:4], len(land.ways), film.sectors
    room, at = film_room(*land[:5], w), film_rows(N, G, Q, w)
    room.rows[at.mobility : at.change, :S], room.rows[at.change : at.all, :S] = mobility.T, change.T
    room.rows[at.mobility : at.change, S] = mobility[0]
    room.rows[at.closing : at.moves, :S] = closing.T
    room.rows[at.moves : at.mobility] = 1.0
    room.head[:], room.still[:] = edges
    held, slopes = np.zeros(S), np.zeros((w, w))
    film_forces(land, room, tension, held, rate, slopes)
    return room.rows[at.force : at.closing, :S].T.copy(), slopes


def _require_heights(where: str, film: SectorFilm, heights: Floats) -> None:
    refuse_if(
        heights.shape != (film.sectors, film.circles),
        where,
        got=f"an array of shape {heights.shape}",
        expected=f"heights of all sectors and circles, shape {(film.sectors, film.circles)}",
        hint="a film with one circle takes heights[:, None].",
    )
    require_positive(where, float(np.min(heights)), "m")


class Land(NamedTuple):
    """A :class:`SectorFilm` as its pressure is computed: sectors come last.

    Arrays may be larger than what the numbers say, so that films of several sizes fit in one.
    """

    sectors: int
    circles: int
    points: int
    functions: int
    shared: int
    ways: Cube  # (w, N, S) heights along each way that is asked for
    worked: Cube  # (w, Q, S) [m^2] what drives the pressure along it
    between: Matrix  # (G, N)
    along: Cube  # (G, Q, Q)
    around: Cube  # (G, Q, Q)
    load: Matrix  # (N, Q) [m^2] force on a circle per unit of each function of the radius
    area: Vector  # (N,)


def land_of(film: SectorFilm, ways: Floats) -> Land:
    """Return the arrays of a film, for slopes along some ways of its heights, shape (S N, w)."""
    apart = ways.T.reshape(ways.shape[1], film.sectors, film.circles).transpose(0, 2, 1)
    load = film.between.T @ film.load
    points, functions = film.load.shape
    return Land(
        film.sectors,
        film.circles,
        points,
        functions,
        film.shared,
        np.ascontiguousarray(apart),
        np.ascontiguousarray(np.einsum("ja,wjk->wak", load, apart)),
        np.ascontiguousarray(film.between),
        np.ascontiguousarray(film.along),
        np.ascontiguousarray(film.around),
        load,
        film.area,
    )


class FilmRows(NamedTuple):
    """Where the rows of a film lie in its memory, each with a number for every sector."""

    loads: int  # 2 Q + 1 [m^3/s]
    drive: int  # Q [m^3/s]
    amplitudes: int  # (1 + w) Q [Pa], then per unit of force along each way; the first one again
    apart: int  # (1 + w) Q, the same less those of the next sector
    stiff: int  # Q Q, and as many for the flow to the next sector
    gained: int  # w N
    force: int  # N [N] out
    closing: int  # N [m/s]
    moves: int  # N, 1 where a height follows the ways, 0 where it stays
    mobility: int  # G [m^3/(Pa s)] h^3/12 mu at the points; that of the first sector again
    change: int  # G [m^2/(Pa s)] slope of the mobility with the height
    all: int


@njit(_nrt=False, forceinline=True)
def film_rows(N: int, G: int, Q: int, w: int) -> FilmRows:
    """Rows for so many circles, points, functions and ways; the first four are for work."""
    loads, n = 4, (1 + w) * Q
    amplitudes = loads + 1 + 3 * Q
    stiff = amplitudes + 2 * n
    gained = stiff + 2 * Q * Q
    force = gained + w * N
    mobility = force + 3 * N
    return FilmRows(
        loads,
        loads + 1 + 2 * Q,
        amplitudes,
        amplitudes + n,
        stiff,
        gained,
        force,
        force + N,
        force + 2 * N,
        mobility,
        mobility + G,
        mobility + 2 * G,
    )


class FilmRoom(NamedTuple):
    """What a film is asked, and memory to answer."""

    rows: Matrix  # (all, MOST_SECTORS + 8) see FilmRows
    head: Matrix  # (G, Q) [Pa m^2] of the pressures at the edges
    still: Vector  # (N,) [N] the same
    ring: Vector  # with the drive, then a unit of force along each way, as right sides
    border: Cube  # (S, o, s) of each cell with what all share
    corner: Matrix  # (s, s)
    raised: Matrix  # (S, o) amplitudes that make a unit of force on sectors at the limit of tension
    pulled: Matrix  # (S, o)
    mean: Vector  # (Q,)
    cross: Vector  # (s,)


@njit
def film_room(S: int, N: int, G: int, Q: int, shared: int, w: int) -> FilmRoom:
    """Room for films of so many sectors, circles, points, functions and ways."""
    o = Q - shared
    return FilmRoom(
        np.empty((film_rows(N, G, Q, w).all, _STRIDE)),
        np.zeros((G, Q)),
        np.zeros(N),
        np.zeros(ring_of(S, o, shared, 1 + w).all),
        np.zeros((S, o, shared)),
        np.zeros((shared, shared)),
        np.zeros((S, o)),
        np.zeros((S, o)),
        np.zeros(Q),
        np.zeros(shared),
    )


@_part
def _stiffness(land: Land, room: FilmRoom, N: int, Q: int, w: int) -> None:
    """Blocks and links of the ring, its coupling with what all share, and that itself."""
    M, R, S, shared, n = first(room.rows), first(room.ring), land.sectors, land.shared, _STRIDE
    at, ring = film_rows(N, land.points, Q, w), ring_of(S, Q - shared, shared, 1 + w)
    own, mobility, stiff, flow = Q - shared, at.mobility * n, at.stiff * n, (at.stiff + Q * Q) * n
    for a in range(Q):
        for b in range(a, Q):
            for k in range(S):
                M[stiff + (a * Q + b) * n + k] = 0.0
                M[flow + (a * Q + b) * n + k] = 0.0
    for p in range(land.points):
        for k in range(S):  # half a sector of each, in series
            here, after = M[mobility + p * n + k], M[mobility + p * n + k + 1]
            M[k], M[n + k] = here, 2.0 * here * after / (here + after)
        for a in range(Q):
            for b in range(a, Q):
                along, around = land.along[p, a, b], land.around[p, a, b]
                for k in range(S):
                    M[stiff + (a * Q + b) * n + k] += along * M[k]
                    M[flow + (a * Q + b) * n + k] += around * M[n + k]
    for k in range(S):
        before = k - 1 if k > 0 else S - 1
        for a in range(own):
            for b in range(own):
                c = (min(a, b) * Q + max(a, b) + shared * (Q + 1)) * n
                place = (k * own + a) * own + b
                R[ring.links + place] = -M[flow + c + k]
                R[ring.blocks + place] = M[stiff + c + k] + M[flow + c + k] + M[flow + c + before]
            for b in range(shared):
                room.border[k, a, b] = M[stiff + (b * Q + a + shared) * n + k]
    for a in range(shared):
        for b in range(shared):
            room.corner[a, b] = 0.0
            for k in range(S):
                room.corner[a, b] += M[stiff + (min(a, b) * Q + max(a, b)) * n + k]


@_part
def _begin(land: Land, room: FilmRoom, N: int, Q: int, w: int) -> None:
    """Coupling of the sectors, and what drives their pressure."""
    M, S, n = first(room.rows), land.sectors, _STRIDE
    at = film_rows(N, land.points, Q, w)
    drive, closing, mobility = at.drive * n, at.closing * n, at.mobility * n
    _stiffness(land, room, N, Q, w)
    for a in range(Q):
        for k in range(S):
            value = 0.0
            for j in range(N):
                value += land.load[j, a] * M[closing + j * n + k]
            M[drive + a * n + k] = value
        for p in range(land.points):
            head = room.head[p, a]
            if head != 0.0:
                for k in range(S):
                    M[drive + a * n + k] -= head * M[mobility + p * n + k]


@_part
def _end(land: Land, room: FilmRoom, N: int, Q: int, w: int) -> None:
    """Amplitudes of the pressure and per unit of force along each way; forces on the circles."""
    M, R, S, shared, n = first(room.rows), first(room.ring), land.sectors, land.shared, _STRIDE
    at, ring = film_rows(N, land.points, Q, w), ring_of(S, Q - shared, shared, 1 + w)
    amplitudes, force = at.amplitudes * n, at.force * n
    for d in range(1 + w):
        for a in range(Q):
            row = amplitudes + (d * Q + a) * n
            for k in range(S):
                place = ring.y + a * ring.n + d
                if a >= shared:
                    place = ring.x + (k * ring.o + a - shared) * ring.wide + Q + d
                M[row + k] = R[place]
            M[row + S] = M[row]
    for j in range(N):
        for k in range(S):
            value = room.still[j]
            for a in range(Q):
                value += land.load[j, a] * M[amplitudes + a * n + k]
            M[force + j * n + k] = value


@_part
def _ask(land: Land, room: FilmRoom, R: Any, ring: Ring) -> None:
    """Right sides of the ring: what drives the pressure, and a unit of force along each way."""
    S, Q, shared, n = land.sectors, land.functions, land.shared, ring.n
    drive = film_rows(land.circles, land.points, Q, n - 1).drive
    for a in range(shared):
        for b in range(shared):
            R[ring.corner + a * shared + b] = room.corner[a, b]
        for d in range(n):
            total = 0.0
            way = room.rows[drive + a] if d == 0 else land.worked[d - 1, a]
            for k in range(S):
                total += way[k]
            R[ring.y + a * n + d] = total
    for k in range(S):
        for a in range(ring.o):
            row = ring.x + (k * ring.o + a) * ring.wide + Q
            R[row] = room.rows[drive + a + shared, k]
            for d in range(n - 1):
                R[row + 1 + d] = land.worked[d, a + shared, k]
            for b in range(shared):
                R[ring.shared + (k * ring.o + a) * shared + b] = room.border[k, a, b]


@_part
def _pull(R: Any, ring: Ring, k: int, a: int, to: Any, first_of: int, wide: int) -> float:
    """What unknown ``a`` of a cell feels of the amplitudes of it and of both neighbours."""
    o, S = ring.o, ring.S
    before, after, total = k - 1 if k > 0 else S - 1, k + 1 if k < S - 1 else 0, 0.0
    for b in range(o):
        total += R[ring.blocks + (k * o + a) * o + b] * to[first_of + (k * o + b) * wide]
        total += R[ring.links + (k * o + a) * o + b] * to[first_of + (after * o + b) * wide]
        total += R[ring.links + (before * o + b) * o + a] * to[first_of + (before * o + b) * wide]
    return total


@_part
def _hold(land: Land, room: FilmRoom, R: Any, ring: Ring, base: float) -> None:
    """Right sides and coupling with held sectors at the limit.

    The amplitudes are ``w - raised (base + common y)``, where w of a held sector does not change
    its mean pressure; ``base`` only of those of the drive.
    """
    raised, pulled, mean, cross = room.raised, room.pulled, room.mean, room.cross
    S, Q, s, o, square = land.sectors, land.functions, land.shared, ring.o, 0.0
    for k in range(S):
        for a in range(o):
            pulled[k, a] = _pull(R, ring, k, a, first(raised), 0, 1)
            square += raised[k, a] * pulled[k, a]
    for b in range(s):
        cross[b] = 0.0
        for k in range(S):
            for a in range(o):
                cross[b] += raised[k, a] * room.border[k, a, b]
    for d in range(ring.n):
        load, base_here = 0.0, base if d == 0 else 0.0
        for k in range(S):
            for a in range(o):
                place = ring.x + (k * o + a) * ring.wide + Q + d
                load += raised[k, a] * R[place]
                R[place] += base_here * pulled[k, a]
        for a in range(s):
            R[ring.y + a * ring.n + d] += (
                base_here * cross[a] - (square * base_here + load) * mean[a]
            )
    for b in range(s):
        for a in range(s):
            R[ring.corner + a * s + b] += square * mean[a] * mean[b]
            R[ring.corner + a * s + b] -= cross[a] * mean[b] + mean[a] * cross[b]
        for k in range(S):
            for a in range(o):
                R[ring.shared + (k * o + a) * s + b] -= pulled[k, a] * mean[b]


@_part
def _raise(land: Land, room: FilmRoom, R: Any, ring: Ring, base: float) -> None:
    """Amplitudes of held sectors from what solves the ring."""
    for d in range(ring.n):
        part = base if d == 0 else 0.0
        for a in range(ring.s):
            part += room.mean[a] * R[ring.y + a * ring.n + d]
        for k in range(ring.S):
            for a in range(ring.o):
                place = ring.x + (k * ring.o + a) * ring.wide + land.functions + d
                R[place] -= room.raised[k, a] * part


@_part
def _regroup(
    land: Land, room: FilmRoom, R: Any, ring: Ring, base: float, held: Vector, one: bool
) -> bool:
    """Hold sectors with tension beyond its limit, release those that are pulled at.

    ``base + mean P >= 0`` with ``K P = drive + mean lift``, ``lift >= 0``, one of them zero: a
    primal-dual active set (Hintermueller, Ito and Kunisch 2003), or with ``one`` the least-index
    rule (Murty 1974), which ends for every positive definite K.  Returns whether any changed.
    """
    mean, Q, s, o = room.mean, land.functions, land.shared, ring.o
    drive = film_rows(land.circles, land.points, Q, ring.n - 1).drive
    changed, common = False, base
    for a in range(s):
        common += mean[a] * R[ring.y + a * ring.n]
    largest = abs(base)
    for k in range(ring.S):
        if held[k] > 0.0:
            lift = 0.0
            for a in range(o):
                force = _pull(R, ring, k, a, R, ring.x + Q, ring.wide)
                for b in range(s):
                    force += room.border[k, a, b] * R[ring.y + b * ring.n]
                lift += mean[a + s] * (force - room.rows[drive + a + s, k])
            other = lift < 0.0
        else:
            free = common
            for a in range(o):
                free += mean[a + s] * R[ring.x + (k * o + a) * ring.wide + Q]
            largest = max(largest, abs(free))
            other = free < -_TINY * largest
        if other:
            held[k] = 1.0 - held[k]
            if one:
                return True
            changed = True
    return changed


@inner(_nrt=False, error_model="numpy", fastmath=FAST)
def solve_film(land: Land, room: FilmRoom, tension: float, held: Vector) -> None:
    """Forces of a film on its circles, and amplitudes of its pressure, into ``room``.

    Parameters
    ----------
    tension [Pa]
    held (S,)
        In: sectors with which the search for those at the limit of tension begins, 0 or 1; out:
        those.
    """
    mean, shared, R = room.mean, land.shared, first(room.ring)
    S, N, Q, w = land.sectors, land.circles, land.functions, len(land.ways)
    if Q == 2 and N == 1 and w == 3:  # the films of strokes: loops that the compiler can write out
        _begin(land, room, 1, 2, 3)
    elif Q == 3 and N == 2 and w == 3:
        _begin(land, room, 2, 3, 3)
    else:
        _begin(land, room, N, Q, w)
    base, square = 0.0, 0.0
    for j in range(N):
        base += tension * land.area[j] + room.still[j]
    for a in range(Q):
        mean[a] = 0.0
        for j in range(N):
            mean[a] += land.load[j, a]
        if a >= shared:
            square += mean[a] * mean[a]
    ring, tries = ring_of(S, Q - shared, shared, 1 + w), 0
    while True:
        some = False
        for k in range(S):
            some = some or held[k] > 0.0
            for a in range(shared, Q):
                room.raised[k, a - shared] = held[k] * mean[a] / square
        _ask(land, room, R, ring)
        if some:
            _hold(land, room, R, ring, base)
        solve_ring(R, ring, held, mean[shared:])
        if some:
            _raise(land, room, R, ring, base)
        if tension == np.inf or tries >= _ACTIVE_SETS + S * S:
            break
        one = tries >= _ACTIVE_SETS  # by one at a time, the first one: it never turns in a circle
        if not _regroup(land, room, R, ring, base, held, one):
            break
        tries += 1
    if Q == 2 and N == 1 and w == 3:
        _end(land, room, 1, 2, 3)
    elif Q == 3 and N == 2 and w == 3:
        _end(land, room, 2, 3, 3)
    else:
        _end(land, room, N, Q, w)


@_part
def _gain(land: Land, room: FilmRoom, rate: float, N: int, Q: int, w: int) -> None:
    """What each height gains a unit of force along each way, with its sign.

    Through the closing, and the change of the stiffness between both amplitudes: K is symmetric.
    """
    M, S, n, at = first(room.rows), land.sectors, _STRIDE, film_rows(N, land.points, Q, w)
    amplitudes, apart, loads, gained = (
        at.amplitudes * n, at.apart * n, at.loads * n, at.gained * n
    )  # fmt: skip
    mobility, change = at.mobility * n, at.change * n
    for c in range((1 + w) * Q):
        for k in range(S):
            M[apart + c * n + k] = M[amplitudes + c * n + k] - M[amplitudes + c * n + k + 1]
    for d in range(w):
        for j in range(N):
            for k in range(S):
                value = 0.0
                for a in range(Q):
                    value += land.load[j, a] * M[amplitudes + ((1 + d) * Q + a) * n + k]
                M[gained + (d * N + j) * n + k] = rate * value
    for p in range(land.points):
        for k in range(S):
            here, after = M[mobility + p * n + k], M[mobility + p * n + k + 1]
            share = 1.0 / (here + after)
            M[k] = 2.0 * (after * share) ** 2
            M[n + k] = 2.0 * (here * share) ** 2
            M[2 * n + k] = M[change + p * n + k]
        for a in range(Q):
            for k in range(S):
                one, other = room.head[p, a], 0.0
                for b in range(Q):
                    one += land.along[p, a, b] * M[amplitudes + b * n + k]
                    other += land.around[p, a, b] * M[apart + b * n + k]
                M[loads + a * n + k] = one
                M[loads + (Q + a) * n + k] = other
        for d in range(w):
            for k in range(S):
                one, other = 0.0, 0.0
                for a in range(Q):
                    one += M[amplitudes + ((1 + d) * Q + a) * n + k] * M[loads + a * n + k]
                    other += M[apart + ((1 + d) * Q + a) * n + k] * M[loads + (Q + a) * n + k]
                M[3 * n + k] = one + M[k] * other
                M[loads + 2 * Q * n + k + 1] = M[n + k] * other
            M[loads + 2 * Q * n] = M[loads + 2 * Q * n + S]
            for j in range(N):
                part = land.between[p, j]
                for k in range(S):
                    way = M[3 * n + k] + M[loads + 2 * Q * n + k]
                    M[gained + (d * N + j) * n + k] += part * M[2 * n + k] * way


@inner(_nrt=False, error_model="numpy", fastmath=FAST)
def add_slopes(land: Land, room: FilmRoom, rate: float, slopes: Matrix) -> None:
    """Add how forces along each way change with motion along each of them, shape (w, w) [N].

    Parameters
    ----------
    room
        As :func:`solve_film` leaves it, with the slopes of the mobility, and what moves.
    rate [1/s]
        How the closing falls with the heights: 1 over a step.
    """
    S, N, Q, w = land.sectors, land.circles, land.functions, len(land.ways)
    if Q == 2 and N == 1 and w == 3:
        _gain(land, room, rate, 1, 2, 3)
    elif Q == 3 and N == 2 and w == 3:
        _gain(land, room, rate, 2, 3, 3)
    else:
        _gain(land, room, rate, N, Q, w)
    at = film_rows(N, land.points, Q, w)
    for c in range(w):
        for d in range(w):
            total = 0.0
            for j in range(N):
                gained, moves, way = (
                    room.rows[at.gained + c * N + j], room.rows[at.moves + j], land.ways[d, j]
                )  # fmt: skip
                for k in range(S):
                    total += gained[k] * moves[k] * way[k]
            slopes[c, d] -= total


@njit
def film_forces(
    land: Land, room: FilmRoom, tension: float, held: Vector, rate: float, slopes: Matrix
) -> None:
    """:func:`solve_film`, then :func:`add_slopes`."""
    solve_film(land, room, tension, held)
    if rate > 0.0:
        add_slopes(land, room, rate, slopes)
