"""Films of fluid between faces that stay parallel.

Truth: Reynolds' equation solved on a grid, dissipation by quadrature, and limiting shapes.

Truth: Reynolds' equation by quadrature, the logarithm of the heights, and published limits.

Truth: quadrature of the short bearing, the closed forms of Ocvirk and Booker, exact energy.

Truth: film impulse, Stefan's fall time, the cavitation limit, and the loop without films.
"""

from decimal import Decimal, getcontext
from itertools import pairwise
from math import cos, log, pi, sin

import numpy as np
import pytest
from draws import each
from scipy.integrate import quad

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.contact.step_constants import NO_LAW
from klack.errors import InputError
from klack.hydraulics.film import (
    ConeFilm,
    DiscFilm,
    RingFilm,
    SphereFilm,
    flow_factor,
    mean_flow_factor,
)
from klack.hydraulics.guide_film import (
    guide_film_damping,
    guide_film_force,
    guide_film_step,
)
from klack.mechanics.end_stop import EndStop
from klack.network.rows import FilmRow
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.interface_step import film_force, interface_store, solve_interface
from klack.verification import sphere_in_liquid as spheres
from klack.verification.interface_motion import interface_motion, squeeze_by_volumes
from klack.verification.one_dimension import one_contact, steel_rod


@pytest.mark.parametrize(
    ("inner", "outer"),
    [(1.4e-3, 2e-3), (0.1e-3, 2e-3), (1.99e-3, 2e-3), (1.0, 3.0)],
    ids=["valve seat", "wide", "narrow", "unit scale"],
)
def test_ring_solves_reynolds_equation(inner, outer):
    ring = RingFilm(shape="ring", inner_radius=inner, outer_radius=outer)

    cells = np.array([250, 500, 1000])
    grid = np.array([squeeze_by_volumes(inner, outer, int(n)) for n in cells])
    extrapolated = grid[-1] + (grid[-1] - grid[-2]) / 3.0  # second order

    # the grid error falls as 1/n^2; what is left of it is below 1e-8
    assert ring.coefficients() == (pytest.approx(extrapolated, rel=2e-8), 0.0)


def test_disc_solves_reynolds_equation():
    cells = squeeze_by_volumes(0.0, 1e-3, 500), squeeze_by_volumes(0.0, 1e-3, 1000)

    expected = cells[1] + (cells[1] - cells[0]) / 3.0
    assert DiscFilm(shape="disc", radius=1e-3).coefficients()[0] == pytest.approx(expected, 1e-9)


def test_published_number_of_a_ring():
    """34.68 N: 1.4/2.0 mm, 0.4 mPa s, 2 um, 0.3 m/s, from the textbook formula with logarithms."""
    film = RingFilm(shape="ring", inner_radius=1.4e-3, outer_radius=2e-3).film_row(4e-4, 1e5)

    r1, r2 = 1.4e-3, 2e-3
    textbook = r2**4 - r1**4 - (r2**2 - r1**2) ** 2 / np.log(r2 / r1)
    assert film.cubic == pytest.approx(1.5 * pi * 4e-4 * textbook, rel=1e-12)
    assert film.cubic * 0.3 / 2e-6**3 == pytest.approx(34.6808, rel=1e-6)
    assert film.suction == pytest.approx(1e5 * pi * (r2**2 - r1**2), rel=1e-14)


@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-6])
def test_narrow_ring_is_a_strip_without_loss_of_digits(share):
    """Curvature acts by (w/r)^2; the formula with logarithms has lost 1e-4 at w/r = 1e-6."""
    ring = RingFilm(shape="ring", inner_radius=1e-3, outer_radius=1e-3 * (1.0 + share))
    width = ring.outer_radius - ring.inner_radius
    strip = 2.0 * pi * (1e-3 + 0.5 * width) * width**3

    assert ring.coefficients()[0] == pytest.approx(strip, rel=share**2 + 1e-12)


def test_cone_of_90_degrees_is_a_flat_narrow_ring():
    cone = ConeFilm(shape="cone", mean_radius=1e-3, width=1e-6, half_angle=pi / 2)
    ring = RingFilm(shape="ring", inner_radius=0.9995e-3, outer_radius=1.0005e-3)

    cubic, linear = cone.coefficients()

    assert cubic == pytest.approx(ring.coefficients()[0], rel=1e-5)
    assert linear == pytest.approx(0.0, abs=1e-30)
    assert cone.area == pytest.approx(ring.area, rel=1e-12)


@pytest.mark.parametrize("degrees", [30.0, 45.0, 70.0])
def test_cone_does_the_work_that_the_fluid_dissipates(degrees):
    """Squeeze flow to both edges and shear along the land, integrated over the film."""
    alpha, mean, width, axial, V = np.radians(degrees), 0.75e-3, 0.25e-3, 1.5e-6, 0.4
    cone = ConeFilm(shape="cone", mean_radius=mean, width=width, half_angle=alpha)
    h = axial * sin(alpha)
    s = np.linspace(-0.5 * width, 0.5 * width, 4001)
    flow = V * sin(alpha) * s  # per length, away from the middle
    rate = 12.0 * flow**2 / h**3 + (V * cos(alpha)) ** 2 / h
    dissipated = 2.0 * pi * mean * np.trapezoid(rate, s)

    cubic, linear = cone.coefficients()

    assert (cubic / axial**3 + linear / axial) * V**2 == pytest.approx(dissipated, rel=1e-6)


def test_flow_factor_rises_from_a_tenth_to_one():
    """The fit itself: 0.1 at h = 0, half the defect per 1.24 sigma, 1 far away."""
    half = np.log(2.0) / 0.56

    assert flow_factor(0.0) == pytest.approx(0.1)
    assert 1.0 - flow_factor(2.0 + half) == pytest.approx(0.5 * (1.0 - flow_factor(2.0)))
    assert flow_factor(3.0) < mean_flow_factor(3.0) < 1.0
    assert mean_flow_factor(1e4) == pytest.approx(1.0, abs=1e-6)


def test_rough_film_has_the_impulse_of_the_height_dependent_factor():
    sigma, cut_off = 0.2e-6, 0.4e-6
    rough = RingFilm(
        shape="ring", inner_radius=1e-3, outer_radius=1.2e-3, roughness=sigma, cut_off=cut_off
    )
    h = np.geomspace(cut_off, 1e-3, 400_001)
    factor = np.array([flow_factor(x) for x in h[::4] / sigma])
    h = h[::4]
    impulse = np.trapezoid(rough.coefficients()[0] / (h**2 * factor), np.log(h))

    film = rough.film_row(1.0, 1e5)

    assert 0.5 * film.cubic / film.cut_off**2 == pytest.approx(impulse, rel=1e-5)


def test_cut_off_comes_from_the_roughness():
    ring = {"shape": "ring", "inner_radius": 1e-3, "outer_radius": 1.2e-3}

    assert RingFilm(**ring).lowest_height == 0.3e-6
    assert RingFilm(**ring, roughness=0.2e-6).lowest_height == pytest.approx(0.6e-6)
    assert RingFilm(**ring, roughness=0.2e-6, cut_off=0.5e-6).lowest_height == 0.5e-6


def reynolds(radius, edge, height):
    """``F/(mu V)`` [m] of a face that ends at ``edge``, from ``p' = -6 mu V r/h^3``."""
    rise = edge**2 / (2.0 * radius)

    def shell(u):
        """``pi r^2 (-p') dr`` over ``u = ln(h/height)``; ``r dr = R dh``."""
        h = height * np.exp(u)
        return 12.0 * pi * radius**2 * (h - height) / h**2

    return quad(shell, 0.0, log((height + rise) / height), epsabs=0, epsrel=1e-12)[0]


@pytest.mark.parametrize(("radius", "height"), [(3e-3, 0.3e-6), (1.0, 1e-4)])
def test_force_is_that_of_reynolds_without_an_edge(radius, height):
    cubic, linear = SphereFilm(shape="sphere", radius=radius, cut_off=height).coefficients()

    assert cubic == 0.0
    # an edge far away takes 2 h/s
    assert linear / height == pytest.approx(reynolds(radius, 1e3 * radius, height), rel=1e-9)


@pytest.mark.parametrize("height", [0.5e-6, 5e-6, 50e-6])
def test_an_edge_weakens_the_film_as_documented(height):
    film = SphereFilm(shape="sphere", radius=50e-3, edge_radius=0.75e-3, cut_off=0.25e-6)
    exact = reynolds(film.radius, film.edge_radius, height)
    weaker = (film.rise / (height + film.rise)) ** 2

    assert film.coefficients()[1] / height * weaker == pytest.approx(exact, rel=1e-9)


def test_far_away_a_crowned_face_is_a_disc():
    disc = DiscFilm(shape="disc", radius=0.75e-3).coefficients()[0]

    assert reynolds(50e-3, 0.75e-3, 5e-2) == pytest.approx(disc / 5e-2**3, rel=1e-3)


@pytest.mark.parametrize("step", [1e-6, 50e-9])
def test_momentum_lost_is_the_logarithm_of_the_heights(step):
    film = SphereFilm(shape="sphere", radius=3e-3).film_row(1e-2, 1e9)
    m = interface_motion(
        rigid_mass_body("sphere", 1e-3, port="bottom"),
        fixed_body("wall", port="top"),
        None,
        film=film,
        gap=1e-3,
        speed=0.02,
        step=step,
        steps=int(20e-3 / step),
    )

    lost = 6.0 * pi * 1e-2 * 3e-3**2 * log((1e-3 + 0.3e-6) / (m.gap[-1] + 0.3e-6))
    assert m.gap[-1] < 0.8e-3
    # accepted error of 1e-9 N per step, at most 400 000 of them
    assert 1e-3 * (m.upper_speed + 0.02) == pytest.approx(lost, rel=1e-7)


@pytest.mark.parametrize("stokes", [30.0, 100.0, 1000.0])
def test_a_bounce_on_the_film_alone(stokes):
    """``e = 1 - 2 ln(h/h_r)/St`` whatever the material; speeds are read from records of 20 us."""
    expected = spheres.film_alone(stokes, 0.3e-6)

    assert spheres.restitution(spheres.GLASS, stokes) == pytest.approx(expected, abs=1e-5)


def test_smooth_faces_are_stopped_by_their_own_flattening():
    """Critical Stokes number ``ln(x_0/x_r)`` (Davis, Rager & Good 2002), within 4 %."""
    height = spheres.elastohydrodynamic_height(spheres.STEEL, 100.0)
    smooth = spheres.on_compliance(spheres.STEEL, 100.0, cut_off=1e-3 * height, pull=False)
    rough = spheres.on_compliance(spheres.STEEL, 100.0, cut_off=10.0 * height, pull=False)

    assert 100.0 * (1.0 - smooth) == pytest.approx(log(spheres.READ_AT / height), rel=0.04)
    # the roughness acts first; the compliance takes 0.5 % more
    assert 100.0 * (1.0 - rough) == pytest.approx(log(spheres.READ_AT / (10.0 * height)), rel=5e-3)


def test_a_film_that_may_not_pull_takes_momentum_once():
    once = spheres.restitution(spheres.GLASS, 100.0, pull=False)

    assert once == pytest.approx(0.5 * (1.0 + spheres.film_alone(100.0, 0.3e-6)), abs=1e-4)


def test_flat_crowns_are_refused():
    film = {"shape": "sphere", "radius": 0.1, "edge_radius": 1e-3}
    with pytest.raises(InputError, match=r"(?s)rises by 5 um to its edge.*use shape: disc"):
        EndStop(gap=1e-6, film=film)
    with pytest.raises(InputError, match="at most the radius of the sphere, 1 mm"):
        EndStop(gap=1e-6, film={"shape": "sphere", "radius": 1e-3, "edge_radius": 2e-3})


def test_a_stop_that_opens_beyond_the_sphere_is_refused():
    film = {"shape": "sphere", "radius": 50e-3, "edge_radius": 1e-3}
    assert EndStop(gap=10e-6, film=film).film.rise == pytest.approx(10e-6)
    with pytest.raises(InputError, match=r"rises by 10 um to its edge.*a rise of the gap, 20 um"):
        EndStop(gap=20e-6, film=film)
    assert EndStop(gap=20e-6, film={"shape": "sphere", "radius": 50e-3}).film.rise > 24e-3


def by_quadrature(eps, rate, whirl, ruptured):
    """Integrate the line load ``(rate cos + eps whirl sin)/(1 - eps cos)^3`` round the needle."""

    def load(theta):
        value = (rate * cos(theta) + eps * whirl * sin(theta)) / (1.0 - eps * cos(theta)) ** 3
        return max(value, 0.0) if ruptured else value

    edge = float(np.arctan2(eps * whirl, rate))
    points = [edge - 0.5 * pi, edge + 0.5 * pi, edge + 1.5 * pi]
    total = np.zeros(2)
    small = 1e-11 / (1.0 - eps) ** 2.5  # of the radial force, for those that vanish
    for a, b in pairwise(points):
        for i, part in enumerate((cos, sin)):
            total[i] -= quad(
                lambda t, part=part: load(t) * part(t), a, b, epsabs=small, epsrel=1e-10, limit=400
            )[0]
    return total


MOTIONS = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 2.0), (-1.0, 0.5), (-0.3, -2.0)]


@each("ruptured", [False, True])
@each("eps", [0.01, 0.4, 0.9, 0.99])
@each(("rate", "whirl"), MOTIONS)
def test_forces_are_the_integrals_of_the_short_bearing(eps, rate, whirl, ruptured):
    expected = by_quadrature(eps, rate, whirl, ruptured)

    found = guide_film_force(eps, rate, whirl, ruptured)

    # at 0.99 the integrand has a peak of 1e6 over 0.01: the quadrature keeps 1e-9 of it
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("eps", [0.1, 0.5, 0.9])
def test_a_turning_journal_has_the_forces_of_ocvirk(eps):
    """``F_r = -eps^2/(1-eps^2)^2``, ``F_t = pi eps/(4 (1-eps^2)^1.5)`` of ``mu omega L^3 R/c^2``.

    Ocvirk (NACA TN 2808, 1952); Hamrock, Fundamentals of Fluid Film Lubrication, short journal
    bearings.  The radial force pushes the journal back, the tangential one drives it on.
    """
    radial, tangential = guide_film_force(eps, 0.0, -0.5, True)

    assert radial == pytest.approx(-(eps**2) / (1.0 - eps**2) ** 2, rel=1e-12)
    assert tangential == pytest.approx(pi * eps / (4.0 * (1.0 - eps**2) ** 1.5), rel=1e-12)


@pytest.mark.parametrize("eps", [0.0, 0.3, 0.95])
def test_squeeze_of_the_whole_film(eps):
    """Booker (1965): ``pi (1 + 2 eps^2)/(1 - eps^2)^2.5`` along, ``pi/(1 - eps^2)^1.5`` across."""
    along = guide_film_force(eps, 1.0, 0.0, False)
    across = guide_film_force(eps, 0.0, 1.0, False)

    left = 1.0 - eps**2
    assert along[0] == pytest.approx(-pi * (1.0 + 2.0 * eps**2) / left**2.5, rel=1e-12)
    assert across[1] == pytest.approx(-pi * eps / left**1.5, rel=1e-12, abs=1e-300)
    assert along[1] == pytest.approx(0.0, abs=1e-12 * abs(along[0]))
    assert across[0] == pytest.approx(0.0, abs=1e-12 * abs(along[0]))


def test_rupture_halves_a_centred_film():
    whole, half = (guide_film_force(0.0, 1.0, 0.0, ruptured) for ruptured in (False, True))

    assert half[0] == pytest.approx(0.5 * whole[0], rel=1e-14)


@pytest.mark.parametrize("x", [0.0, 0.2, -0.7])
@pytest.mark.parametrize("y", [0.0, 0.5, -0.6])
def test_damping_is_the_force_in_any_direction(x, y):
    C = guide_film_damping(x, y)
    eps, angle = np.hypot(x, y), np.arctan2(y, x)
    for u, v in ((1.0, 0.0), (0.0, 1.0), (0.3, -2.0)):
        rate = u * np.cos(angle) + v * np.sin(angle)
        across = -u * np.sin(angle) + v * np.cos(angle)
        if eps > 0.0:
            radial, tangential = guide_film_force(eps, rate, across / eps, False)
        else:
            radial, tangential = -pi * rate, -pi * across
        force = [
            radial * np.cos(angle) - tangential * np.sin(angle),
            radial * np.sin(angle) + tangential * np.cos(angle),
        ]
        np.testing.assert_allclose(-C @ [u, v], force, rtol=1e-12, atol=1e-12 * np.abs(C).max())
    assert np.all(np.linalg.eigvalsh(C) > 0.0)


def test_a_step_dissipates_and_its_slopes_are_right():
    random = np.random.default_rng(3)
    for _ in range(50):
        x0, y0, x1, y1 = 0.65 * random.uniform(-1.0, 1.0, 4)
        fx, fy, slopes = guide_film_step(x0, y0, x1, y1, 1e-6)
        assert fx * (x1 - x0) + fy * (y1 - y0) <= 0.0
        for column, (dx, dy) in enumerate(((1e-6, 0.0), (0.0, 1e-6))):
            ahead = guide_film_step(x0, y0, x1 + dx, y1 + dy, 1e-6)[:2]
            behind = guide_film_step(x0, y0, x1 - dx, y1 - dy, 1e-6)[:2]
            numeric = (np.array(ahead) - behind) / 2e-6
            # central differences: 1e-12 over distances of 0.1, round-off over 1e-6
            np.testing.assert_allclose(slopes[:, column], numeric, atol=1e-7 * np.abs(slopes).max())


NEVER = 1e9  # [N] no cavitation
WALL = fixed_body("wall", port="top")
DEPTH = 6e-6 * np.linspace(0.0, 1.0, 30)[1:]  # [m]


def mass(m=3e-3):
    return rigid_mass_body("needle", m, port="bottom")


@pytest.mark.parametrize("step", [1e-6, 50e-9, 10e-9])
def test_momentum_lost_in_a_film_at_any_step_size(step):
    film = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=NEVER)
    m = interface_motion(
        mass(), WALL, None, film=film, gap=20e-6, speed=0.02, step=step, steps=int(4e-4 / step)
    )

    x0, x1 = 20e-6 + film.cut_off, m.gap[-1] + film.cut_off
    impulse = 0.5 * film.cubic * (x1**-2 - x0**-2) + film.linear * np.log(x0 / x1)
    assert x1 < 15e-6
    # accepted error of 1e-9 N per step, at most 40 000 of them
    assert 3e-3 * (m.upper_speed + 0.02) == pytest.approx(impulse, rel=1e-8)


def test_fall_time_of_a_plate():
    """Stefan (1874): 46.13 us from 20 to 1 um under 10 N; 20 ns steps."""
    film = FilmRow(cubic=9.248221602e-16, linear=0.0, cut_off=1e-12, suction=NEVER)
    m = interface_motion(
        mass(1e-10), WALL, None, film=film, gap=25e-6, press=10.0, step=20e-9, steps=3000
    )

    time = m.step * np.arange(m.gap.size)
    fall = np.interp(1e-6**-2, m.gap**-2, time) - np.interp(20e-6**-2, m.gap**-2, time)
    exact = film.cubic / 20.0 * (1e-6**-2 - 20e-6**-2)
    assert exact == pytest.approx(46.1255e-6, rel=1e-5)
    assert fall == pytest.approx(exact, rel=1e-5)  # a step is 4e-4 of it


def test_parting_film_pulls_with_its_suction_and_no_more():
    film = FilmRow(cubic=5e-17, linear=0.0, cut_off=0.3e-6, suction=0.6)
    m = interface_motion(mass(), WALL, None, film=film, gap=0.0, speed=-0.1, step=20e-9, steps=500)

    assert m.film_force.min() == -0.6
    # while it cavitates the mass is slowed evenly
    cavitating = int(np.sum(m.film_force == -0.6))
    assert cavitating > 100
    assert m.film_loss[:cavitating] == pytest.approx(0.6 * np.diff(m.gap)[:cavitating], rel=1e-9)


def test_film_force_keeps_its_digits_over_small_steps():
    """Against 40 digits: 1 fm of 5 um; subtracting two impulses would leave 6 digits."""
    getcontext().prec = 40
    cubic, linear, cut_off, h, z0, z1 = 5e-17, 4e-12, 1e-7, 20e-9, 5e-6, 5e-6 - 1e-15
    x0, x1 = Decimal(z0) + Decimal(cut_off), Decimal(z1) + Decimal(cut_off)
    impulse = Decimal(cubic) / 2 * (1 / x1**2 - 1 / x0**2) + Decimal(linear) * (x0 / x1).ln()

    force = film_force(cubic, linear, cut_off, h, z0, z1)

    assert force == pytest.approx(float(impulse / Decimal(h)), rel=1e-14)


@pytest.mark.parametrize("ratio", [0.9, 0.999, 1.001, 1.2, 30.0])
def test_logarithm_of_the_shear_film(ratio):
    force = film_force(0.0, 4e-12, 1e-7, 20e-9, 2e-6 - 1e-7, 2e-6 * ratio - 1e-7)

    assert force == pytest.approx(-4e-12 * np.log(ratio) / 20e-9, rel=1e-11)


@pytest.mark.parametrize(
    "law",
    [
        LinearLaw(1e9),
        HertzLaw(2e11),
        TableLaw(DEPTH, 2e11 * DEPTH**1.5),
        HuntCrossley(LinearLaw(1e9), gonthier_coefficient(0.8)),
    ],
    ids=["linear", "hertz", "table", "hunt-crossley"],
)
@pytest.mark.parametrize("series", [0.0, 1e-9])
@pytest.mark.parametrize("cubic", [0.0, 1e-28], ids=["no film", "film that vanishes"])
def test_without_a_film_it_is_the_contact_loop(law, series, cubic):
    """A film of 1e-12 of a usual one must change nothing either: then theta is seen to be right."""
    a, b = steel_rod("a", 0.04, 8), steel_rod("b", 0.08, 12)
    film = FilmRow(cubic=cubic, linear=0.0, cut_off=0.2e-6, suction=NEVER)
    known = simulate_impact(
        one_contact(a, b, law, gap=1.23e-6, series=series), speed=0.5, step=20e-9, duration=40e-6
    )

    m = interface_motion(
        a, b, law, film=film, series=series, gap=1.23e-6, speed=0.5, step=20e-9, steps=2000
    )

    # laws other than linear are solved to 1e-9 N in each step
    assert known.peak_force.max() > 50.0
    np.testing.assert_allclose(m.contact_force, known.force, rtol=0, atol=1e-6)


@pytest.mark.parametrize("damper", [1e-3, 1e-2, 0.1, 0.9])
def test_compression_dies_without_changing_its_sign(damper):
    """Open gap at rest, ``D c/h`` from 1e-3 to 0.9: the trapezoidal rule would swing to and fro."""
    h, D, gap = 20e-9, 1e-9, 5e-6
    cubic = damper * h / D * (gap + 1e-7) ** 3
    e, seen = 1e-9, []
    g = gap
    for _ in range(30):
        _, _, g, e, _, lost, loss = solve_interface(
            NO_LAW,
            np.zeros(1),
            0,
            0.0,
            cubic,
            0.0,
            1e-7,
            NEVER,
            h,
            1e-16,
            D,
            g,
            g,
            e,
            0.0,
            0,
            0.0,
        )
        assert lost == 0.0
        assert loss >= 0.0
        seen.append(e)

    # 1e-21 m: round-off of a gap of 5 um
    assert np.all(np.array(seen) > -1e-21)
    assert np.all(np.diff(np.array([1e-9, *seen])) < 1e-21)
    assert abs(seen[-1]) < 1e-13


def test_compression_left_at_release_vanishes_and_is_booked():
    law, D, e0 = LinearLaw(1e9).flat(), 1e-9, 2e-9

    contact, film, g1, e1, _, lost, loss = solve_interface(
        law.kind,
        law.parameters,
        0,
        0.0,
        0.0,
        0.0,
        1e-7,
        0.0,
        20e-9,
        1e-13,
        D,
        1e-8,
        2e-8,
        e0,
        0.0,
        0,
        0.0,
    )

    assert (contact, film, g1, e1, loss) == (0.0, 0.0, 2e-8, 0.0, 0.0)
    assert lost == pytest.approx(interface_store(law.kind, law.parameters, 0, D, 1e-8, e0))
    assert lost == pytest.approx(0.5 * e0**2 / D)
