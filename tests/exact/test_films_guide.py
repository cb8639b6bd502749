"""Truth: quadrature of the short bearing, the closed forms of Ocvirk and Booker, exact energy."""

from itertools import pairwise
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from draws import each
from scipy.integrate import quad

from klack.hydraulics.guide_film import (
    guide_film_damping,
    guide_film_drag,
    guide_film_force,
    guide_film_step,
)


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


def test_drag_along_the_guide():
    """``int dtheta/(2 pi (1 - eps cos))``."""
    mean = quad(lambda t: 1.0 / (1.0 - 0.8 * cos(t)), 0.0, 2.0 * pi)[0] / (2.0 * pi)

    assert guide_film_drag(0.8) == pytest.approx(mean, rel=1e-10)
    assert guide_film_drag(0.8) == pytest.approx(1.0 / sqrt(1.0 - 0.64), rel=1e-14)
