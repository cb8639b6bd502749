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

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit
from klack.errors import InputError, require_nonnegative, require_positive

__all__ = ["SectorFilm", "sector_film", "sector_forces", "sector_step"]

Array = NDArray[np.float64]

_POINTS = 12  # Gauss points between two circles
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
    x, weight = np.polynomial.legendre.leggauss(_POINTS)
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
    force, slopes = _film(
        film.between, film.along, film.around, film.load, film.area, film.shared,
        mobility, np.ascontiguousarray(closing, dtype=float), change, *edges, tension, rate,
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


@njit
def _film(
    between: Array,
    along: Array,
    around: Array,
    load: Array,
    area: Array,
    shared: int,
    mobility: Array,
    closing: Array,
    change: Array,
    head: Array,
    still: Array,
    tension: float,
    rate: float,
) -> tuple[Array, Array]:
    """Forces on the circles; their slopes too where ``rate`` (1 over the step) is not 0.

    ``mobility`` at the points of all sectors and ``change``, its slope with the height there;
    ``head`` and ``still`` belong to the pressures at the edges.
    """
    S, G = mobility.shape
    N, Q = between.shape[1], load.shape[1]
    own = Q - shared
    n = shared + S * own
    K, push, L = np.zeros((n, n)), np.zeros(n), np.zeros((S * N, n))
    at = np.empty((S, Q), dtype=np.int64)  # places of the amplitudes of a sector
    for k in range(S):
        for a in range(Q):
            at[k, a] = a if a < shared else shared + k * own + a - shared
    for k in range(S):
        after = (k + 1) % S
        for p in range(G):
            m, m_after = mobility[k, p], mobility[after, p]
            across = 2.0 * m * m_after / (m + m_after)  # half a sector of each, in series
            for a in range(Q):
                i = at[k, a]
                for j in range(N):
                    L[k * N + j, i] += between[p, j] * load[p, a]
                push[i] -= m * head[p, a]
                for b in range(Q):
                    K[i, at[k, b]] += m * along[p, a, b]
                    if a >= shared and b >= shared:
                        flow = across * around[p, a, b]
                        K[i, at[k, b]] += flow
                        K[at[after, a], at[after, b]] += flow
                        K[i, at[after, b]] -= flow
                        K[at[after, a], at[k, b]] -= flow
    LT = L.T.copy()
    push += LT @ closing.copy().reshape(S * N)
    P = np.linalg.solve(K, push)
    held = np.zeros(S, dtype=np.bool_)
    C = np.zeros((S, n))
    if tension < np.inf:
        room = np.empty(S)
        for k in range(S):
            for j in range(N):
                C[k] += L[k * N + j]
            room[k] = C[k] @ P + tension * np.sum(area) + np.sum(still)
        if np.min(room) < 0.0:
            Y = np.linalg.solve(K, C.T.copy())
            lift, held = _obstacle(C @ Y, room)
            P += Y @ lift
    force = (L @ P).reshape(S, N) + still
    slopes = np.zeros((S * N, S * N))
    if rate == 0.0:
        return force, slopes
    R = -rate * LT
    for k in range(S):
        for p in range(G):
            m = mobility[k, p]
            for a in range(Q):
                drive = head[p, a]
                for b in range(Q):
                    drive += along[p, a, b] * P[at[k, b]]
                for j in range(N):
                    R[at[k, a], k * N + j] -= change[k, p] * between[p, j] * drive
            for other in ((k - 1) % S, (k + 1) % S):
                o = mobility[other, p]
                share = 2.0 * (o / (m + o)) ** 2 * change[k, p]
                for a in range(shared, Q):
                    drive = 0.0
                    for b in range(shared, Q):
                        drive += around[p, a, b] * (P[at[k, b]] - P[at[other, b]])
                    for j in range(N):
                        moved = share * between[p, j] * drive
                        R[at[k, a], k * N + j] -= moved
                        R[at[other, a], k * N + j] += moved
    X = np.linalg.solve(K, R)
    kept = np.flatnonzero(held)
    if kept.size > 0:
        T = np.empty((kept.size, n))
        for row in range(kept.size):
            T[row] = C[kept[row]]
        Y = np.linalg.solve(K, T.T.copy())
        X -= Y @ np.linalg.solve(T @ Y, T @ X)
    slopes[:, :] = L @ X
    return force, slopes


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
