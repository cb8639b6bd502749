"""Truth: Reynolds' equation by quadrature, the logarithm of the heights, and published limits."""

from math import log, pi

import numpy as np
import pytest
from scipy.integrate import quad

from klack.errors import InputError
from klack.hydraulics.film import DiscFilm, SphereFilm
from klack.mechanics.end_stop import EndStop
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.verification import sphere_in_liquid as spheres
from klack.verification.interface_motion import interface_motion


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
