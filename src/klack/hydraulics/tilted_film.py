r"""Squeeze film of a ring or disc that tilts: Reynolds' equation over sectors and circles.

.. math:: \nabla\cdot\Bigl(\frac{h^3}{12\mu}\nabla p\Bigr) = \dot h

The land is cut into ``S`` sectors.  Each has its own height, or several, on ``N`` circles, with
straight lines between them.  Over the radius the pressure is a sum of given functions, the first
one the exact pressure of parallel faces; their amplitudes differ from sector to sector (finite
volumes round the circumference, Galerkin's method over the radius).  So parallel faces have exactly
the force of :class:`~klack.hydraulics.film.RingFilm` or :class:`~klack.hydraulics.film.DiscFilm`
for any number of sectors and circles.

Forces are those that do the work of the pressure on the heights.  With the amplitudes ``P``,
``K P = L^T V`` and ``F = L P``, the power ``F V = P^T K P`` is never negative, and with a limited
tension (an obstacle problem for the mean pressure of every sector) it is ``P^T K P`` or more.
"""

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit
from klack.errors import InputError, require_nonnegative, require_positive
from klack.hydraulics.ring_system import eliminate_ring, solve_ring

__all__ = [
    "Land",
    "SectorFilm",
    "film_pressure",
    "land_of",
    "sector_film",
    "sector_forces",
    "sector_step",
]

Array = NDArray[np.float64]

_POINTS, _FEWER = 12, 8  # Gauss points between two circles
_FEWEST_SECTORS = 4
_ACTIVE_SETS = 60  # before relaxation takes over


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SectorFilm:
    """Land of a film in sectors and circles, prepared for any heights.

    Parameters
    ----------
    inner_radius, outer_radius : float [m]
        An inner radius of 0 makes a disc.
    angles : array (S,) [rad]
        Middles of the sectors.
    radii : array (N,) [m]
        Of the circles on which heights are given; of a single one the centre of the pressure of
        parallel faces.
    spread : float [-]
        Mean of ``cos`` over a sector, over that of its middle.
    shared : int
        How many of the functions of the radius have one amplitude for all sectors.
    between : array (G, N) [-]
        Shares of the circles in the height of the points of quadrature.
    along, around : array (G, Q, Q) [-]
        ``f_a' f_b' r dr`` times the angle of a sector, and ``f_a f_b dr / r`` over it, at the
        points; functions ``f`` have no unit.
    load : array (G, Q) [m^2]
        ``f_a r dr`` times the angle of a sector.
    head : array (G, Q) [-]
        ``f_a' l' r dr`` times the angle, of the logarithm ``l`` that is 1 at the inner edge.
    inward : array (N,) [m^2]
        ``int l r dr`` times the angle, shared among the circles.
    area : array (N,) [m^2]
        Of a sector, shared among the circles.
    """

    inner_radius: float
    outer_radius: float
    angles: Array
    radii: Array
    spread: float
    shared: int
    between: Array
    along: Array
    around: Array
    load: Array
    head: Array
    inward: Array
    area: Array

    @property
    def sectors(self) -> int:
        """Number of sectors."""
        return self.angles.size

    @property
    def circles(self) -> int:
        """Number of heights in a sector."""
        return self.radii.size

    def rows(self) -> Array:
        r"""Heights per unit of lift and of both tilts; shape (S N, 3) [-], [m], [m].

        Lift along +z, tilts so that ``h = z + r (tilt_x cos + tilt_y sin)``.  These rows,
        transposed, times the forces are force and moments with the same work.
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
    inner_radius, outer_radius : float [m]
    sectors : int
        At least 4; 36 are within 0.5 % of many.
    circles : int
        1: one height across a narrow land; 2: a straight line between both edges, which a rigid
        tilt is; more for faces that bend.
    """
    require_nonnegative("sector_film: inner_radius", inner_radius, "m")
    require_positive("sector_film: width", outer_radius - inner_radius, "m")
    for name, number, least in (("sectors", sectors, _FEWEST_SECTORS), ("circles", circles, 1)):
        if number < least:
            raise InputError(
                f"sector_film: {name}",
                got=f"{number}",
                expected=f"at least {least}",
                hint="36 sectors and 1 circle for a narrow land, 2 for a wide one.",
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
    inner: float, outer: float, inside: Array, count: int
) -> tuple[Array, Array, int]:
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
    heights: Array,
    closing: Array,
    viscosity: float,
    *,
    tension: float = np.inf,
    inner_pressure: float = 0.0,
    outer_pressure: float = 0.0,
) -> Array:
    """Forces [N] that press the faces apart, at one instant; shape (S, N).

    Parameters
    ----------
    film : SectorFilm
    heights : array (S, N) [m]
        Above 0: gap and what the roughness leaves.
    closing : array (S, N) [m/s]
        ``-dh/dt``.
    viscosity : float [Pa s]
    tension : float [Pa]
        Largest mean tension of a sector, ``p_ambient - p_cavitation``.
    inner_pressure, outer_pressure : float [Pa]
        At the edges, above ambient; of a disc only the outer one.
    """
    _require_heights("sector_forces: heights", film, heights)
    x = heights @ film.between.T
    edges = _edges(film, inner_pressure, outer_pressure)
    mobility = x**3 / (12.0 * viscosity)
    return _solved(film, mobility, closing, np.zeros_like(x), edges, tension, 0.0)[0]


def sector_step(
    film: SectorFilm,
    before: Array,
    after: Array,
    step: float,
    viscosity: float,
    *,
    tension: float = np.inf,
    inner_pressure: float = 0.0,
    outer_pressure: float = 0.0,
) -> tuple[Array, Array]:
    r"""Mean forces [N] over a step, shape (S, N), and their slopes with the heights at its end.

    A point that goes from ``x_0`` to ``x_1`` has the mobility of the height with

    .. math:: \bar h^3 = \frac{2 x_0^2 x_1^2}{x_0 + x_1},

    the mean of ``1/h^3`` over its way.  So the work ``F (x_0 - x_1)`` is dissipated exactly, at
    every step size, and parallel faces lose the momentum of their film impulse.

    Parameters
    ----------
    film, viscosity, tension, inner_pressure, outer_pressure
        As of :func:`sector_forces`.
    before, after : array (S, N) [m]
        Heights at both ends of the step, above 0.
    step : float [s]

    Returns
    -------
    forces : array (S, N) [N]
    slopes : array (S N, S N) [N/m]
        Forces over heights at the end.
    """
    for name, heights in (("before", before), ("after", after)):
        _require_heights(f"sector_step: {name}", film, heights)
    require_positive("sector_step: step", step, "s")
    x0, x1 = before @ film.between.T, after @ film.between.T
    mobility = x0**2 * x1**2 / (6.0 * viscosity * (x0 + x1))
    change = x0**2 * x1 * (2.0 * x0 + x1) / (6.0 * viscosity * (x0 + x1) ** 2)
    edges = _edges(film, inner_pressure, outer_pressure)
    return _solved(film, mobility, (before - after) / step, change, edges, tension, 1.0 / step)


def _edges(film: SectorFilm, inner: float, outer: float) -> tuple[Array, Array]:
    """Driving [Pa] and forces on the circles [N] of parallel faces between both pressures."""
    if film.inner_radius == 0.0:
        inner = outer
    return (inner - outer) * film.head, outer * film.area + (inner - outer) * film.inward


def _solved(
    film: SectorFilm,
    mobility: Array,
    closing: Array,
    change: Array,
    edges: tuple[Array, Array],
    tension: float,
    rate: float,
) -> tuple[Array, Array]:
    heights = film.sectors * film.circles
    ways = np.eye(heights) if rate else np.zeros((heights, 0))
    force, slopes = film_pressure(
        land_of(film), mobility, np.ascontiguousarray(closing, dtype=float), change, *edges,
        tension, rate, ways,
    )  # fmt: skip
    return np.asarray(force), np.asarray(slopes)


def _require_heights(where: str, film: SectorFilm, heights: Array) -> None:
    if heights.shape != (film.sectors, film.circles):
        raise InputError(
            where,
            got=f"an array of shape {heights.shape}",
            expected=f"heights of all sectors and circles, shape {(film.sectors, film.circles)}",
            hint="a film with one circle takes heights[:, None].",
        )
    require_positive(where, float(np.min(heights)), "m")


class Land(NamedTuple):
    """Arrays of a :class:`SectorFilm` that its pressure is made of."""

    between: Array
    along: Array
    around: Array
    load: Array
    area: Array
    shared: int


def land_of(film: SectorFilm) -> Land:
    """Return the arrays of a film."""
    return Land(film.between, film.along, film.around, film.load, film.area, film.shared)


@njit
def film_pressure(
    land: Land,
    mobility: Array,
    closing: Array,
    change: Array,
    head: Array,
    still: Array,
    tension: float,
    rate: float,
    ways: Array,
) -> tuple[Array, Array]:
    """Forces on the circles, and how they change along some ways of the heights.

    Parameters
    ----------
    land : Land
    mobility, change : array (S, G) [m^3/(Pa s)]
        ``h^3/12 mu`` at the points of all sectors, and its slope with the height there.
    closing : array (S, N) [m/s]
    head, still : array (G, Q) [Pa m^2], (N,) [N]
        Of the pressures at the edges.
    tension : float [Pa]
    rate : float [1/s]
        How the closing falls with the heights: 1 over a step.
    ways : array (S N, w)

    Returns
    -------
    forces : array (S, N) [N]
    slopes : array (S N, w)
    """
    between, along, around, load, area, shared = land
    S, G = mobility.shape
    N, Q = between.shape[1], load.shape[1]
    own = Q - shared
    L = np.zeros((N, Q))
    for p in range(G):
        for j in range(N):
            for a in range(Q):
                L[j, a] += between[p, j] * load[p, a]
    blocks, links = np.zeros((S, own, own)), np.zeros((S, own, own))
    border, corner = np.zeros((S, own, shared)), np.zeros((shared, shared))
    x, y = np.zeros((S, own, 1)), np.zeros((shared, 1))
    for k in range(S):
        after = (k + 1) % S
        for p in range(G):
            m, m_after = mobility[k, p], mobility[after, p]
            across = 2.0 * m * m_after / (m + m_after)  # half a sector of each, in series
            for a in range(Q):
                for b in range(Q):
                    value = m * along[p, a, b]
                    if a >= shared and b >= shared:
                        flow = across * around[p, a, b]
                        blocks[k, a - shared, b - shared] += value + flow
                        blocks[after, a - shared, b - shared] += flow
                        links[k, a - shared, b - shared] -= flow
                    elif a >= shared:
                        border[k, a - shared, b] += value
                    elif b < shared:
                        corner[a, b] += value
                drive = -m * head[p, a]
                if a >= shared:
                    x[k, a - shared, 0] += drive
                else:
                    y[a, 0] += drive
        for a in range(Q):
            drive = 0.0
            for j in range(N):
                drive += L[j, a] * closing[k, j]
            if a >= shared:
                x[k, a - shared, 0] += drive
            else:
                y[a, 0] += drive
    ring = eliminate_ring(blocks, links, border, corner)
    solve_ring(ring, links, x, y)
    held = np.zeros(S, dtype=np.bool_)
    mean = np.zeros(Q)  # of the amplitudes in the force on a sector
    for j in range(N):
        for a in range(Q):
            mean[a] += L[j, a]
    if tension < np.inf:
        room = np.empty(S)
        base = tension * np.sum(area) + np.sum(still)
        for k in range(S):
            room[k] = base
            for a in range(Q):
                room[k] += mean[a] * (x[k, a - shared, 0] if a >= shared else y[a, 0])
        if np.min(room) < 0.0:
            every = np.arange(S)
            X, Y = _lifted(ring, links, mean, shared, every)
            W = np.zeros((S, S))
            for k in range(S):
                for i in range(S):
                    for a in range(Q):
                        W[k, i] += mean[a] * (X[k, a - shared, i] if a >= shared else Y[a, i])
            lift, held = _obstacle(W, room)
            for i in range(S):
                if lift[i] != 0.0:
                    for k in range(S):
                        for a in range(own):
                            x[k, a, 0] += X[k, a, i] * lift[i]
                    for a in range(shared):
                        y[a, 0] += Y[a, i] * lift[i]
    P = np.empty((S, Q))
    force = np.empty((S, N))
    for k in range(S):
        for a in range(Q):
            P[k, a] = x[k, a - shared, 0] if a >= shared else y[a, 0]
        for j in range(N):
            force[k, j] = still[j]
            for a in range(Q):
                force[k, j] += L[j, a] * P[k, a]
    count = ways.shape[1]
    slopes = np.zeros((S * N, count))
    if count == 0:
        return force, slopes
    X, Y = np.zeros((S, own, count)), np.zeros((shared, count))
    moved = np.empty(count)
    for k in range(S):
        for d in range(count):
            for a in range(Q):
                drive = 0.0
                for j in range(N):
                    drive -= rate * L[j, a] * ways[k * N + j, d]
                if a >= shared:
                    X[k, a - shared, d] += drive
                else:
                    Y[a, d] += drive
        for p in range(G):
            m = mobility[k, p]
            for d in range(count):
                moved[d] = 0.0
                for j in range(N):
                    moved[d] += change[k, p] * between[p, j] * ways[k * N + j, d]
            for a in range(Q):
                drive = head[p, a]
                for b in range(Q):
                    drive += along[p, a, b] * P[k, b]
                for d in range(count):
                    if a >= shared:
                        X[k, a - shared, d] -= moved[d] * drive
                    else:
                        Y[a, d] -= moved[d] * drive
            for side in range(2):
                other = (k - 1) % S if side == 0 else (k + 1) % S
                o = mobility[other, p]
                share = 2.0 * (o / (m + o)) ** 2
                for a in range(shared, Q):
                    drive = 0.0
                    for b in range(shared, Q):
                        drive += around[p, a, b] * (P[k, b] - P[other, b])
                    for d in range(count):
                        X[k, a - shared, d] -= share * moved[d] * drive
                        X[other, a - shared, d] += share * moved[d] * drive
    solve_ring(ring, links, X, Y)
    kept = np.flatnonzero(held)
    if kept.size > 0:
        raised, raised_shared = _lifted(ring, links, mean, shared, kept)
        n = kept.size
        A, right = np.zeros((n, n)), np.zeros((n, count))
        for row in range(n):
            k = kept[row]
            for a in range(Q):
                for column in range(n):
                    A[row, column] += mean[a] * (
                        raised[k, a - shared, column] if a >= shared else raised_shared[a, column]
                    )
                for d in range(count):
                    right[row, d] += mean[a] * (X[k, a - shared, d] if a >= shared else Y[a, d])
        taken = np.linalg.solve(A, right)
        for row in range(n):
            for d in range(count):
                for k in range(S):
                    for a in range(own):
                        X[k, a, d] -= raised[k, a, row] * taken[row, d]
                for a in range(shared):
                    Y[a, d] -= raised_shared[a, row] * taken[row, d]
    for k in range(S):
        for j in range(N):
            for d in range(count):
                for a in range(Q):
                    slopes[k * N + j, d] += L[j, a] * (
                        X[k, a - shared, d] if a >= shared else Y[a, d]
                    )
    return force, slopes


@njit
def _lifted(
    ring: tuple[Array, Array, Array, Array, Array],
    links: Array,
    mean: Array,
    shared: int,
    sectors: NDArray[np.int64],
) -> tuple[Array, Array]:
    """Amplitudes by a unit of lift in each of these sectors."""
    S, own = links.shape[0], links.shape[1]
    X, Y = np.zeros((S, own, sectors.size)), np.zeros((shared, sectors.size))
    for column in range(sectors.size):
        for a in range(own):
            X[sectors[column], a, column] = mean[a + shared]
        for a in range(shared):
            Y[a, column] = mean[a]
    solve_ring(ring, links, X, Y)
    return X, Y


@njit
def _obstacle(W: Array, room: Array) -> tuple[Array, NDArray[np.bool_]]:
    """``lift >= 0`` with ``room + W lift >= 0``, one of them zero for each sector.

    Primal-dual active set; where it turns in a circle, projected relaxation to round-off.
    """
    S = room.size
    held = room < 0.0
    lift = np.zeros(S)
    tiny = 1e-13 * np.max(np.abs(room))
    for _ in range(_ACTIVE_SETS):
        kept = np.flatnonzero(held)
        A, b = np.empty((kept.size, kept.size)), np.empty(kept.size)
        for row in range(kept.size):
            b[row] = -room[kept[row]]
            for column in range(kept.size):
                A[row, column] = W[kept[row], kept[column]]
        found = np.linalg.solve(A, b)
        lift[:] = 0.0
        for row in range(kept.size):
            lift[kept[row]] = found[row]
        left = room + W @ lift
        same = True
        for k in range(S):
            now = lift[k] > 0.0 if held[k] else left[k] < -tiny
            if now != held[k]:
                held[k] = now
                same = False
        if same:
            return lift, held
    lift[:] = np.maximum(lift, 0.0)
    for _ in range(100_000):
        moved = 0.0
        for k in range(S):
            new = max(0.0, lift[k] - (room[k] + W[k] @ lift) / W[k, k])
            moved = max(moved, abs(new - lift[k]) * W[k, k])
            lift[k] = new
        if moved <= tiny:
            break
    return lift, lift > 0.0
