"""Truth: parallel faces, closed forms of tilted lands and discs, a polar grid of finite volumes."""

from math import log, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import nnls
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from klack.errors import InputError
from klack.hydraulics.film import DiscFilm, RingFilm
from klack.hydraulics.tilted_film import (
    SectorFilm,
    sector_film,
    sector_forces,
    sector_step,
)
from klack.simulation.interface_step import film_force

pytestmark = pytest.mark.slow

MU = 4e-4  # [Pa s]
SHAPES = [(1.4e-3, 2e-3), (0.5e-3, 2e-3), (0.0, 2e-3), (1e-3, 1.001e-3)]
NAMES = ["valve seat", "wide ring", "disc", "narrow"]


def parallel(inner, outer):
    """``B`` [N s m^2] of the present film."""
    if inner == 0.0:
        return MU * DiscFilm(shape="disc", radius=outer).coefficients()[0]
    return MU * RingFilm(shape="ring", inner_radius=inner, outer_radius=outer).coefficients()[0]


def tilted(film: SectorFilm, height, tilt, turn=0.0):
    """Heights of a land that is tilted by ``tilt`` [rad] towards ``turn``."""
    rows = film.rows()
    flat = height + tilt * (np.cos(turn) * rows[:, 1] + np.sin(turn) * rows[:, 2])
    return flat.reshape(film.sectors, film.circles)


def force_and_moments(film, forces):
    return film.rows().T @ forces.ravel()


def by_grid(inner, outer, height, lift_rate, tilt_rate, rings, sectors):
    """Force and moment by finite volumes in polar coordinates, second order.

    ``height``, a function of radius and angle; closing with ``lift_rate + tilt_rate r cos``.
    """
    edges = np.linspace(inner, outer, rings + 1)
    r, dr, dt = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0], 2.0 * pi / sectors
    t = dt * np.arange(sectors)
    cell = np.arange(rings * sectors).reshape(rings, sectors)
    entries = [[], [], []]

    def add(i, j, g):
        for row, column, value in ((i, i, g), (j, j, g), (i, j, -g), (j, i, -g)):
            if column is not None and row is not None:
                entries[0].append(row.ravel())
                entries[1].append(column.ravel())
                entries[2].append(value.ravel())

    R, T = np.meshgrid(edges, t, indexing="ij")
    along = height(R, T) ** 3 / (12.0 * MU) * R * dt / dr
    add(cell[:-1], cell[1:], along[1:-1])
    for edge, last in ((0, 0), (-1, rings - 1)):
        entries[0].append(cell[last])
        entries[1].append(cell[last])
        entries[2].append(2.0 * along[edge])
    R, T = np.meshgrid(r, t + 0.5 * dt, indexing="ij")
    around = height(R, T) ** 3 / (12.0 * MU) * dr / (R * dt)
    add(cell, np.roll(cell, -1, axis=1), around)
    K = coo_array((np.concatenate(entries[2]), (np.concatenate(entries[0]),
                                                np.concatenate(entries[1])))).tocsr()  # fmt: skip
    R, T = np.meshgrid(r, t, indexing="ij")
    reach = R * np.cos(T)
    volume = R * dr * dt
    p = spsolve(K, ((lift_rate + tilt_rate * reach) * volume).ravel()).reshape(R.shape)
    return np.array([np.sum(p * volume), np.sum(p * reach * volume)])


@pytest.mark.parametrize(("inner", "outer"), SHAPES, ids=NAMES)
@pytest.mark.parametrize(("sectors", "circles"), [(4, 1), (36, 1), (12, 3)])
def test_parallel_faces_have_the_force_of_the_present_film(inner, outer, sectors, circles):
    film = sector_film(inner, outer, sectors=sectors, circles=circles)
    flat = np.full((sectors, circles), 2e-6)

    forces = sector_forces(film, flat, np.full_like(flat, 0.3), MU)

    expected = parallel(inner, outer) * 0.3 / 2e-6**3
    force, *moments = force_and_moments(film, forces)
    # the pressure of a ring 1 um wide on 1 mm is a difference that loses three digits
    assert force == pytest.approx(expected, rel=1e-10)
    np.testing.assert_allclose(moments, 0.0, atol=1e-10 * expected * outer)


@pytest.mark.parametrize(("inner", "outer"), SHAPES, ids=NAMES)
@pytest.mark.parametrize(("before", "after"), [(2e-6, 1.7e-6), (0.4e-6, 5e-6)])
def test_a_parallel_step_loses_the_film_impulse(inner, outer, before, after):
    film = sector_film(inner, outer, sectors=8, circles=2)
    ones = np.ones((8, 2))

    forces, slopes = sector_step(film, before * ones, after * ones, 1e-7, MU)

    B = parallel(inner, outer)
    expected = film_force(B, 0.0, 1e-12, 1e-7, before - 1e-12, after - 1e-12)
    assert forces.sum() == pytest.approx(expected, rel=1e-10)
    # d/dx1 of [B/(2 x1^2) - B/(2 x0^2)] / dt
    assert slopes.sum() == pytest.approx(-B / after**3 / 1e-7, rel=1e-9)


def test_moment_of_a_disc_that_begins_to_tilt_is_exact():
    """``p = 3 mu w/(2 h^3) (R^2 r - r^3) cos``, so ``M = pi mu w R^6 / (8 h^3)``."""
    R, h, rate = 2e-3, 2e-6, 100.0
    exact = pi * MU * rate * R**6 / (8.0 * h**3)

    found = [begins_to_tilt(0.0, R, h, rate, sectors, 2) for sectors in (36, 72, 144)]

    errors = np.array(found) / exact - 1.0
    assert np.all(np.abs(errors) < 2e-3)
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.01)
    # what is left is of the fourth order in the angle
    assert found[2] + (found[2] - found[1]) / 3.0 == pytest.approx(exact, rel=1e-7)


def begins_to_tilt(inner, outer, h, rate, sectors, circles):
    film = sector_film(inner, outer, sectors=sectors, circles=circles)
    flat = np.full((sectors, circles), h)
    return force_and_moments(film, sector_forces(film, flat, tilted(film, 0.0, rate), MU))[1]


@pytest.mark.parametrize(
    ("inner", "circles", "left"),
    [(1.4e-3, 1, 3e-3), (1.4e-3, 2, 3e-7), (0.5e-3, 1, 4e-2), (0.5e-3, 2, 1e-5), (0.5e-3, 3, 1e-6)],
)
def test_moment_of_a_ring_that_begins_to_tilt(inner, circles, left):
    """``p = c (a r + b/r - r^3/8) cos`` with zeros at both edges; one circle has one height."""
    outer, h, rate = 2e-3, 2e-6, 100.0
    b2, a2 = outer**2, inner**2
    a, b = (a2 + b2) / 8.0, -a2 * b2 / 8.0
    integral = sum(
        sign * (a * r**4 / 4.0 + b * r**2 / 2.0 - r**6 / 48.0)
        for r, sign in ((outer, 1), (inner, -1))
    )
    exact = 12.0 * MU * rate / h**3 * pi * integral

    coarse, fine = (begins_to_tilt(inner, outer, h, rate, n, circles) for n in (72, 144))

    assert fine + (fine - coarse) / 3.0 == pytest.approx(exact, rel=left)


@pytest.mark.parametrize("tilt", [0.3, 0.6, 0.9])
def test_a_narrow_tilted_land_is_a_row_of_strips(tilt):
    """``F = 2 pi r mu w^3 V/h^3 (2 + e^2) / (2 (1 - e^2)^(5/2))``: nothing flows round the ring."""
    r, w, h, V = 1e-3, 2e-6, 2e-6, 0.1
    film = sector_film(r - 0.5 * w, r + 0.5 * w, sectors=288)
    heights = tilted(film, h, tilt * h / r)

    force = force_and_moments(film, sector_forces(film, heights, np.full_like(heights, V), MU))[0]

    strips = 2.0 * pi * r * MU * w**3 * V / h**3 * (2.0 + tilt**2) / (2.0 * (1 - tilt**2) ** 2.5)
    # sectors (1.3e-3 at 0.9), and the flow round the ring
    assert force == pytest.approx(strips, rel=2e-3)


@pytest.mark.parametrize(
    ("inner", "tilt", "circles", "left"),
    [(1.4e-3, 0.5, 2, 1e-5), (1.4e-3, 0.8, 3, 3e-4), (0.5e-3, 0.5, 5, 1e-6), (0.0, 0.5, 5, 3e-6)],
)
def test_a_land_that_is_tilted_much_against_a_grid(inner, tilt, circles, left):
    """Force and moment while it closes, and while it tilts on; both extrapolated."""
    outer, h = 2e-3, 2e-6
    angle = tilt * h / outer

    def height(r, t):
        return h + angle * r * np.cos(t)

    for lift_rate, tilt_rate in ((0.2, 0.0), (0.0, 100.0)):
        grid = [by_grid(inner, outer, height, lift_rate, tilt_rate, n, 3 * n) for n in (48, 96)]
        exact = grid[1] + (grid[1] - grid[0]) / 3.0
        ours = []
        for sectors in (72, 144):
            film = sector_film(inner, outer, sectors=sectors, circles=circles)
            closing = tilted(film, lift_rate, tilt_rate)
            forces = sector_forces(film, tilted(film, h, angle), closing, MU)
            ours.append(force_and_moments(film, forces)[:2])
        # five functions of the radius are left of the deviation; that of the grid is 6e-7
        np.testing.assert_allclose(ours[1] + (ours[1] - ours[0]) / 3.0, exact, rtol=left)


@pytest.mark.parametrize("inner", [1.4e-3, 0.5e-3])
def test_the_first_order_in_a_tilt(inner):
    r"""``p = p_0 + p_1 cos``, ``(r p_1')' - p_1/r = -(3 a/h) (r^2 p_0')'``: the moment per tilt."""
    outer, h, V, tilt = 2e-3, 2e-6, 0.3, 1e-6
    scale = 12.0 * MU * V / h**3
    half = (outer**2 - inner**2) / (4.0 * log(outer / inner))

    def slope0(r):
        """``p_0'`` of parallel faces."""
        return scale * (half / r - 0.5 * r)

    def equation(r, y):
        # (r^2 p_0')' = scale (half - 3 r^2 / 2)
        return np.vstack([y[1], (y[0] / r - y[1] - 3.0 / h * scale * (half - 1.5 * r**2)) / r])

    start = np.linspace(inner, outer, 101)
    solved = solve_bvp(
        equation, lambda a, b: np.array([a[0], b[0]]), start, np.zeros((2, 101)), tol=1e-10,
        max_nodes=100_000,
    )  # fmt: skip
    r, weight = np.polynomial.legendre.leggauss(60)
    r, weight = inner + 0.5 * (outer - inner) * (1.0 + r), 0.5 * (outer - inner) * weight
    exact = pi * np.sum(weight * solved.sol(r)[0] * r**2) * tilt

    found = []
    for sectors in (72, 144):
        film = sector_film(inner, outer, sectors=sectors, circles=3)
        heights = tilted(film, h, tilt)
        forces = sector_forces(film, heights, np.full_like(heights, V), MU)
        found.append(force_and_moments(film, forces)[1])
    assert slope0(sqrt(2.0 * half)) == pytest.approx(0.0, abs=1e-6 * scale * outer)
    # tilt times radius is 1e-3 of the height: 1e-6 of the third order
    assert found[1] + (found[1] - found[0]) / 3.0 == pytest.approx(exact, rel=1e-5)


def test_edge_pressures_of_parallel_faces():
    """``F = pi [p2 r2^2 - p1 r1^2 - (p2 - p1)(r2^2 - r1^2)/(2 ln(r2/r1))]``, and no film force."""
    r1, r2, p1, p2 = 1.4e-3, 2e-3, 5e5, 1e5
    film = sector_film(r1, r2, sectors=12, circles=2)
    flat = np.full((12, 2), 2e-6)

    forces = sector_forces(film, flat, 0.0 * flat, MU, inner_pressure=p1, outer_pressure=p2)

    exact = pi * (p2 * r2**2 - p1 * r1**2 - (p2 - p1) * (r2**2 - r1**2) / (2.0 * log(r2 / r1)))
    assert forces.sum() == pytest.approx(exact, rel=1e-12)


def test_edge_pressures_of_a_tilted_land_do_not_change_a_uniform_pressure():
    film = sector_film(1.4e-3, 2e-3, sectors=12, circles=2)
    heights = tilted(film, 2e-6, 0.5e-3)

    forces = sector_forces(film, heights, 0.0 * heights, MU, inner_pressure=3e5, outer_pressure=3e5)

    np.testing.assert_allclose(forces, np.tile(3e5 * film.area, (12, 1)), rtol=1e-12)


def drawn(seed, film):
    random = np.random.default_rng(seed)
    shape = film.sectors, film.circles
    before = 0.3e-6 * np.exp(random.normal(0.0, 1.0, shape))
    return before, before * np.exp(random.normal(0.0, 0.3, shape))


@pytest.mark.parametrize("tension", [np.inf, 1e5], ids=["no cavitation", "cavitation"])
@pytest.mark.parametrize(("inner", "outer"), SHAPES[:3], ids=NAMES[:3])
def test_a_film_never_gives_energy(inner, outer, tension):
    film = sector_film(inner, outer, sectors=8, circles=2)
    pulled = 0
    for seed in range(40):
        before, after = drawn(seed, film)
        forces, _ = sector_step(film, before, after, 1e-6, MU, tension=tension)
        assert np.sum(forces * (before - after)) >= 0.0
        if tension < np.inf:
            least = -tension * film.area.sum()
            assert forces.sum(axis=1).min() >= least * (1.0 + 1e-9)
            pulled += int(np.sum(forces.sum(axis=1) < 0.999 * least))
    assert tension == np.inf or pulled > 20


@pytest.mark.parametrize(("inner", "outer"), SHAPES[:3], ids=NAMES[:3])
def test_damping_is_symmetric_and_positive(inner, outer):
    """Truth: the dissipation ``V^T D V`` of a viscous film, Lorentz reciprocity."""
    film = sector_film(inner, outer, sectors=6, circles=2)
    heights, _ = drawn(2, film)
    D = np.array([
        sector_forces(film, heights, row.reshape(6, 2), MU).ravel() for row in np.eye(12)
    ])  # fmt: skip
    least, *_, largest = np.linalg.eigvalsh(0.5 * (D + D.T))

    np.testing.assert_allclose(D, D.T, atol=1e-12 * largest)
    assert least > -1e-13 * largest


@pytest.mark.parametrize(("inner", "outer"), SHAPES[:3], ids=NAMES[:3])
def test_sectors_at_the_limit_of_tension_are_an_obstacle_problem(inner, outer):
    """Truth: the same quadratic programme, dense, by non-negative least squares (SciPy).

    ``K P = L V + mean lift`` with ``lift >= 0`` and a mean pressure of every sector above ``-T``,
    one of both at its limit: heights and rates of any kind, and where they vary a thousandfold.
    """
    random = np.random.default_rng(3)
    film = sector_film(inner, outer, sectors=9, circles=2)
    reached = 0
    for spread in np.repeat([0.1, 1.0, 3.5], 12):
        heights = 2e-6 * np.exp(spread * random.normal(size=(9, 2)))
        closing = 0.3 * random.normal(size=(9, 2))
        tension = 2e4
        K, drive, mean = dense(film, heights, closing)
        U = np.linalg.inv(np.linalg.cholesky(K)) @ mean
        W, room = U.T @ U, tension * film.area.sum() + mean.T @ np.linalg.solve(K, drive)
        scale = np.sqrt(np.diag(W))
        # min |U lift + c|^2 / 2 with U^T c = room, lift >= 0
        c = np.linalg.lstsq(U.T / scale[:, None], room / scale, rcond=None)[0]
        lift = nnls(U / scale, -c, maxiter=10_000)[0] / scale
        pressures = np.linalg.solve(K, drive + mean @ lift)
        exact = mean.T @ pressures
        reached += bool(np.any(lift > 0.0))

        forces = sector_forces(film, heights, closing, MU, tension=tension).sum(axis=1)

        np.testing.assert_allclose(forces, exact, atol=1e-7 * np.abs(exact).max())
    assert reached > 20


def dense(film: SectorFilm, heights, closing):
    """Stiffness of the amplitudes of all sectors, what drives them, and their mean pressures."""
    sectors, functions, shared = film.sectors, film.load.shape[1], film.shared
    own = functions - shared
    place = np.empty((sectors, functions), dtype=int)
    place[:, :shared] = sectors * own + np.arange(shared)
    place[:, shared:] = np.arange(sectors * own).reshape(sectors, own)
    size = sectors * own + shared
    K, drive, mean = np.zeros((size, size)), np.zeros(size), np.zeros((size, sectors))
    x = (heights @ film.between.T) ** 3 / (12.0 * MU)
    loads = film.between.T @ film.load
    for k in range(sectors):
        here, after = place[k], place[(k + 1) % sectors]
        K[np.ix_(here, here)] += np.einsum("p,pab->ab", x[k], film.along)
        m = x[(k + 1) % sectors]
        flow = np.einsum("p,pab->ab", 2.0 * x[k] * m / (x[k] + m), film.around)
        for rows, columns, sign in ((here, here, 1), (after, after, 1), (here, after, -1)):
            K[np.ix_(rows[shared:], columns[shared:])] += sign * flow[shared:, shared:]
            if sign < 0:
                K[np.ix_(columns[shared:], rows[shared:])] += sign * flow[shared:, shared:]
        drive[here] += loads.T @ closing[k]
        mean[here, k] += loads.sum(axis=0)
    return K, drive, mean


def test_all_sectors_cavitate_as_the_present_film_does():
    film = sector_film(1.4e-3, 2e-3, sectors=12)
    flat = np.full((12, 1), 2e-6)

    forces = sector_forces(film, flat, -0.5 + 0.0 * flat, MU, tension=1e5)

    assert forces.sum() == pytest.approx(-1e5 * pi * (2e-3**2 - 1.4e-3**2), rel=1e-12)


def test_only_the_opening_side_cavitates():
    """A land that tilts: the closing half as without a limit, the other at most the tension."""
    film = sector_film(1.95e-3, 2e-3, sectors=36)
    flat = np.full((36, 1), 1e-6)
    closing = tilted(film, 0.0, 50.0)

    free = sector_forces(film, flat, closing, MU)
    limited = sector_forces(film, flat, closing, MU, tension=1e4)

    middle = film.angles == 0.0
    assert limited[middle] == pytest.approx(free[middle], rel=1e-6)
    assert limited.min() == pytest.approx(-1e4 * film.area[0], rel=1e-9)
    assert limited.sum() > 0.5 * np.abs(free).max()


@pytest.mark.parametrize("tension", [np.inf, 1e5], ids=["no cavitation", "cavitation"])
@pytest.mark.parametrize(("inner", "outer"), SHAPES[1:3], ids=NAMES[1:3])
def test_slopes_are_those_of_finite_differences(inner, outer, tension):
    film = sector_film(inner, outer, sectors=6, circles=2)
    before, after = drawn(5, film)
    edges = {"inner_pressure": 2e5 if inner else 0.0, "outer_pressure": 1e5}

    def forces(x):
        return sector_step(film, before, x, 1e-6, MU, tension=tension, **edges)[0].ravel()

    _, slopes = sector_step(film, before, after, 1e-6, MU, tension=tension, **edges)

    for c in range(after.size):
        moved = np.zeros(after.size)
        moved[c] = 1e-5 * after.ravel()[c]
        change = moved.reshape(after.shape)
        numeric = (forces(after + change) - forces(after - change)) / (2.0 * moved[c])
        # central differences: 1e-10 of truncation, round-off over 1e-5
        np.testing.assert_allclose(slopes[:, c], numeric, atol=1e-7 * np.abs(slopes).max())


def test_sectors_converge():
    """Chosen: 36, within 0.5 %; heights vary by a third over the land of a needle."""
    h, outer = 2e-6, 2e-3
    moments = []
    for sectors in (12, 24, 36, 72, 288):
        film = sector_film(1.4e-3, outer, sectors=sectors, circles=3)
        heights = tilted(film, h, 0.3 * h / outer)
        forces = sector_forces(film, heights, np.full_like(heights, 0.3), MU)
        moments.append(force_and_moments(film, forces)[:2])
    errors = np.abs(np.array(moments[:-1]) / moments[-1] - 1.0)

    assert np.all(errors[2] < 5e-3)
    assert np.all(errors[1] / errors[3] > 8.0)  # second order: 9 and the error of 288


def test_directions_are_alike():
    """A tilt by half a sector more turns the moment with it."""
    film = sector_film(1.4e-3, 2e-3, sectors=36, circles=2)
    results = []
    for turn in (0.0, pi / 36.0, 1.0):
        heights = tilted(film, 2e-6, 0.4e-3, turn)
        results.append(
            force_and_moments(film, sector_forces(film, heights, np.full_like(heights, 0.3), MU))
        )
    forces = [found[0] for found in results]
    moments = [sqrt(found[1] ** 2 + found[2] ** 2) for found in results]

    np.testing.assert_allclose(forces, forces[0], rtol=1e-6)
    np.testing.assert_allclose(moments, moments[0], rtol=1e-5)


def test_wrong_cells_are_refused():
    with pytest.raises(InputError, match="got 3, expected at least 4"):
        sector_film(1e-3, 2e-3, sectors=3)
    with pytest.raises(InputError, match="width"):
        sector_film(2e-3, 1e-3)
    film = sector_film(1e-3, 2e-3, sectors=6)
    with pytest.raises(InputError, match="heights of all sectors and circles"):
        sector_forces(film, np.ones(6), np.ones(6), MU)
    with pytest.raises(InputError, match="heights"):
        sector_forces(film, np.zeros((6, 1)), np.ones((6, 1)), MU)
