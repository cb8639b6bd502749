"""Truth: Reynolds' equation solved on a grid, dissipation by quadrature, and limiting shapes."""

from math import cos, pi, sin

import numpy as np
import pytest

from klack.hydraulics.film import ConeFilm, DiscFilm, RingFilm, flow_factor, mean_flow_factor
from klack.verification.interface_motion import squeeze_by_volumes


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
