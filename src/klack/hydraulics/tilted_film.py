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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, require_nonnegative, require_positive
from klack.hydraulics.ring_system import eliminate_ring, solve_ring
from klack.machine.compiling.jit import inner, njit

__all__ = [
    "Land",
    "Pressed",
    "SectorFilm",
    "film_pressure",
    "film_slopes",
    "land_of",
    "mean_mobility",
    "sector_film",
    "sector_forces",
    "sector_step",
]

Array = NDArray[np.float64]

_POINTS, _FEWER = 12, 8  # Gauss points between two circles: faces that touch have kinks there
_FEWEST_SECTORS = 4
_ACTIVE_SETS = 60  # before sectors change one at a time
_TINY = 1e-12  # of the largest tension: round-off


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
    return _solved(film, mobility, (before - after) / step, change, edges, tension, 1.0 / step)


def mean_mobility(before: Array, after: Array, viscosity: float) -> Array:
    """Mobility [m^3/(Pa s)] of points between two heights: see :func:`sector_step`."""
    return np.asarray(before**2 * after**2 / (6.0 * viscosity * (before + after)))


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
    land, head, still = land_of(film), *edges
    closing = np.ascontiguousarray(closing, dtype=float)
    held = np.zeros(film.sectors, dtype=np.bool_)
    force, pressed = film_pressure(land, mobility, closing, head, still, tension, held)
    slopes = film_slopes(land, pressed, mobility, change, head, rate, ways)
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
    """Arrays of a :class:`SectorFilm` for its pressure."""

    between: Array
    along: Array
    around: Array
    load: Array
    area: Array
    shared: int


def land_of(film: SectorFilm) -> Land:
    """Return the arrays of a film."""
    along, around = np.ascontiguousarray(film.along), np.ascontiguousarray(film.around)
    return Land(film.between, along, around, film.load, film.area, film.shared)


class Pressed(NamedTuple):
    """Pressure over a land.

    ``amplitudes`` (S, Q) [Pa]; ``ring`` and ``links`` of
    :func:`~klack.hydraulics.ring_system.eliminate_ring`; ``held``: sectors at the limit of tension;
    ``raised`` (S, own): amplitudes that make a unit of force on them.
    """

    amplitudes: Array
    ring: tuple[Array, Array, Array, Array, Array]
    links: Array
    held: NDArray[np.bool_]
    raised: Array


@njit(error_model="numpy")
def film_pressure(
    land: Land,
    mobility: Array,
    closing: Array,
    head: Array,
    still: Array,
    tension: float,
    held: NDArray[np.bool_],
) -> tuple[Array, Pressed]:
    """Forces on the circles, shape (S, N) [N], and the pressure.

    Parameters
    ----------
    mobility (S, G) [m^3/(Pa s)]
        ``h^3/12 mu`` at the points of all sectors.
    closing (S, N) [m/s] head, still (G, Q) [Pa m^2], (N,) [N]
        Of the pressures at the edges.
    tension [Pa]
    held (S,)
        Sectors at the limit of tension; in: first guess.
    """
    shared = land.shared
    S, N = closing.shape
    Q = land.load.shape[1]
    own = Q - shared
    L = _loads(land)
    blocks, links, border, corner = _stiffness(land, mobility)
    x, y = np.zeros((S, own, 1)), np.zeros((shared, 1))
    for k in range(S):
        for a in range(Q):
            drive = 0.0
            for j in range(N):
                drive += L[j, a] * closing[k, j]
            for p in range(mobility.shape[1]):
                drive -= mobility[k, p] * head[p, a]
            if a >= shared:
                x[k, a - shared, 0] = drive
            else:
                y[a, 0] += drive
    mean, base = np.zeros(Q), tension * np.sum(land.area) + np.sum(still)
    for j in range(N):
        for a in range(Q):
            mean[a] += L[j, a]
    normal, common = mean[shared:], mean[:shared]
    raised, square = np.zeros((S, own)), normal @ normal
    X, Y = x.copy(), y.copy()
    tries = 0
    while True:
        some = False
        for k in range(S):
            some = some or held[k]
            for a in range(own):
                raised[k, a] = normal[a] / square if held[k] else 0.0
        if some:
            ring = _hold(blocks, links, border, corner, held, normal, common, raised, base, X, Y)
        else:
            ring = eliminate_ring(blocks, links, border, corner, held, normal, X, Y)
        if tension == np.inf or tries >= _ACTIVE_SETS + S * S:
            break
        one = tries >= _ACTIVE_SETS  # by one at a time, the first one: it never turns in a circle
        if not _regroup(blocks, links, border, x, X, Y, mean, base, held, one):
            break
        tries += 1
        X, Y = x.copy(), y.copy()
    P, force = np.empty((S, Q)), np.empty((S, N))
    for k in range(S):
        for a in range(Q):
            P[k, a] = X[k, a - shared, 0] if a >= shared else Y[a, 0]
        for j in range(N):
            force[k, j] = still[j]
            for a in range(Q):
                force[k, j] += L[j, a] * P[k, a]
    return force, Pressed(P, ring, links, held, raised)


@njit(error_model="numpy")
def film_slopes(
    land: Land,
    pressed: Pressed,
    mobility: Array,
    change: Array,
    head: Array,
    rate: float,
    ways: Array,
) -> Array:
    """Change of the forces along some directions of the heights, shape (S N, w) [N per unit].

    Parameters
    ----------
    land, mobility, head
        As of :func:`film_pressure`.
    change (S, G) [m^2/(Pa s)]
        Slope of the mobility with the height.
    rate [1/s]
        How the closing falls with the heights: 1 over a step.
    ways (S N, w)
        The directions.
    """
    between, along, around, shared = land.between, land.along, land.around, land.shared
    S, G = mobility.shape
    N, Q, count = between.shape[1], land.load.shape[1], ways.shape[1]
    own, P, L = Q - shared, pressed.amplitudes, _loads(land)
    X, Y = np.zeros((S, own, count)), np.zeros((shared, count))
    moved, drive, gone = np.zeros((S, G, count)), np.empty((Q, count)), np.empty((own, count))
    for k in range(S):
        for p in range(G):
            for j in range(N):
                part = change[k, p] * between[p, j]
                for d in range(count):
                    moved[k, p, d] += part * ways[k * N + j, d]
    for k in range(S):
        drive[:] = 0.0
        for a in range(Q):
            for j in range(N):
                for d in range(count):
                    drive[a, d] -= rate * L[j, a] * ways[k * N + j, d]
            for p in range(G):
                load = head[p, a]
                for b in range(Q):
                    load += along[p, a, b] * P[k, b]
                for d in range(count):
                    drive[a, d] -= load * moved[k, p, d]
        after = k + 1 if k < S - 1 else 0
        gone[:] = 0.0
        for p in range(G):
            m, o = mobility[k, p], mobility[after, p]
            here, there = 2.0 * (o / (m + o)) ** 2, 2.0 * (m / (m + o)) ** 2
            for a in range(own):
                load = 0.0
                for b in range(shared, Q):
                    load += around[p, a + shared, b] * (P[k, b] - P[after, b])
                for d in range(count):
                    gone[a, d] += load * (here * moved[k, p, d] + there * moved[after, p, d])
        for d in range(count):
            for a in range(shared):
                Y[a, d] += drive[a, d]
            for a in range(own):
                X[k, a, d] += drive[a + shared, d] - gone[a, d]
                X[after, a, d] += gone[a, d]
    if shared and np.any(pressed.held):
        common = np.zeros(shared)
        for a in range(shared):
            for j in range(N):
                common[a] += L[j, a]
        for d in range(count):
            along_raised = 0.0
            for k in range(S):
                for a in range(own):
                    along_raised += pressed.raised[k, a] * X[k, a, d]
            for a in range(shared):
                Y[a, d] -= common[a] * along_raised
        solve_ring(pressed.ring, pressed.links, X, Y)
        for d in range(count):
            part = 0.0
            for a in range(shared):
                part += common[a] * Y[a, d]
            for k in range(S):
                for a in range(own):
                    X[k, a, d] -= pressed.raised[k, a] * part
    else:
        solve_ring(pressed.ring, pressed.links, X, Y)
    slopes = np.zeros((S * N, count))
    for k in range(S):
        for j in range(N):
            for a in range(Q):
                for d in range(count):
                    slopes[k * N + j, d] += L[j, a] * (
                        X[k, a - shared, d] if a >= shared else Y[a, d]
                    )
    return slopes


@inner(error_model="numpy")
def _loads(land: Land) -> Array:
    G, N = land.between.shape
    L = np.zeros((N, land.load.shape[1]))
    for p in range(G):
        for j in range(N):
            for a in range(L.shape[1]):
                L[j, a] += land.between[p, j] * land.load[p, a]
    return L


@inner(error_model="numpy")
def _stiffness(land: Land, mobility: Array) -> tuple[Array, Array, Array, Array]:
    """Blocks and links of the ring, its coupling with the shared part, and that part."""
    along, around, shared = land.along, land.around, land.shared
    S, G = mobility.shape
    Q = land.load.shape[1]
    own = Q - shared
    square, flow = np.zeros((S, Q * Q)), np.zeros((S, Q * Q))
    stiff, weak = along.reshape((G, Q * Q)), around.reshape((G, Q * Q))
    for k in range(S):
        after = k + 1 if k < S - 1 else 0
        for p in range(G):
            m, m_after = mobility[k, p], mobility[after, p]
            across = 2.0 * m * m_after / (m + m_after)  # half a sector of each, in series
            for c in range(Q * Q):
                square[k, c] += m * stiff[p, c]
                flow[k, c] += across * weak[p, c]
    blocks, links = np.empty((S, own, own)), np.empty((S, own, own))
    border, corner = np.empty((S, own, shared)), np.zeros((shared, shared))
    for k in range(S):
        for a in range(own):
            row = (a + shared) * Q + shared
            for b in range(own):
                links[k, a, b] = -flow[k, row + b]
                blocks[k, a, b] = square[k, row + b] + flow[k, row + b] + flow[k - 1, row + b]
            for b in range(shared):
                border[k, a, b] = square[k, (a + shared) * Q + b]
        for a in range(shared):
            for b in range(shared):
                corner[a, b] += square[k, a * Q + b]
    return blocks, links, border, corner


@inner(error_model="numpy")
def _regroup(
    blocks: Array,
    links: Array,
    border: Array,
    drive: Array,
    x: Array,
    y: Array,
    mean: Array,
    base: float,
    held: NDArray[np.bool_],
    one: bool,
) -> bool:
    """Hold sectors with tension beyond its limit, release those that are pulled at.

    ``base + mean P >= 0`` with ``K P = drive + mean lift``, ``lift >= 0``, one of them zero: a
    primal-dual active set (Hintermueller, Ito and Kunisch 2003), or with ``one`` the least-index
    rule (Murty 1974), which ends for every positive definite K.  Returns whether any changed.
    """
    S, own = drive.shape[0], drive.shape[1]
    shared, changed = len(mean) - own, False
    common = base
    for a in range(shared):
        common += mean[a] * y[a, 0]
    largest = abs(base)
    for k in range(S):
        if held[k]:
            before, after, lift = (k - 1) % S, (k + 1) % S, 0.0
            for a in range(own):
                force = -drive[k, a, 0]
                for b in range(own):
                    force += blocks[k, a, b] * x[k, b, 0] + links[k, a, b] * x[after, b, 0]
                    force += links[before, b, a] * x[before, b, 0]
                for b in range(shared):
                    force += border[k, a, b] * y[b, 0]
                lift += mean[a + shared] * force
            other = lift < 0.0
        else:
            room = common
            for a in range(own):
                room += mean[a + shared] * x[k, a, 0]
            largest = max(largest, abs(room))
            other = room < -_TINY * largest
        if other:
            held[k] = not held[k]
            if one:
                return True
            changed = True
    return changed


@inner(error_model="numpy")
def _hold(
    blocks: Array,
    links: Array,
    border: Array,
    corner: Array,
    held: NDArray[np.bool_],
    normal: Array,
    common: Array,
    raised: Array,
    base: float,
    x: Array,
    y: Array,
) -> tuple[Array, Array, Array, Array, Array]:
    """Solve with held sectors at the limit, in place; returns the eliminated ring.

    The amplitudes are ``w - raised (base + common y)``, where w of a held sector does not change
    its mean pressure.
    """
    S, own, shared = raised.shape[0], raised.shape[1], len(common)
    pulled, square, load = np.zeros((S, own)), 0.0, 0.0
    for k in range(S):
        before, after = (k - 1) % S, (k + 1) % S
        for a in range(own):
            for b in range(own):
                pulled[k, a] += blocks[k, a, b] * raised[k, b] + links[k, a, b] * raised[after, b]
                pulled[k, a] += links[before, b, a] * raised[before, b]
            square += raised[k, a] * pulled[k, a]
            load += raised[k, a] * x[k, a, 0]
    side, middle = border, corner
    if shared:
        side, middle, cross = border.copy(), corner.copy(), np.zeros(shared)
        for k in range(S):
            for a in range(own):
                for b in range(shared):
                    cross[b] += raised[k, a] * border[k, a, b]
                    side[k, a, b] -= pulled[k, a] * common[b]
        for a in range(shared):
            for b in range(shared):
                middle[a, b] += square * common[a] * common[b]
                middle[a, b] -= cross[a] * common[b] + common[a] * cross[b]
            y[a, 0] += base * cross[a] - (square * base + load) * common[a]
    for k in range(S):
        for a in range(own):
            x[k, a, 0] += base * pulled[k, a]
    ring = eliminate_ring(blocks, links, side, middle, held, normal, x, y)
    part = base
    for a in range(shared):
        part += common[a] * y[a, 0]
    for k in range(S):
        for a in range(own):
            x[k, a, 0] -= raised[k, a] * part
    return ring
