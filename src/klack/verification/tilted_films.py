"""Checks of films that tilt and of the film in a guide."""

from functools import partial
from math import cos, pi

import numpy as np
from scipy.integrate import quad

from klack.hydraulics.film import RingFilm
from klack.hydraulics.guide_film import guide_film_force
from klack.hydraulics.tilted_film import SectorFilm, sector_film, sector_forces, sector_step
from klack.verification.check import Check, ComparedCurve, compare

__all__ = ["tilted_films"]

_check = partial(compare, "films")

_MU, _HEIGHT = 4e-4, 2e-6  # [Pa s], [m]
_SECTORS = "finite volumes round the circumference: order 2, 36 sectors"


def tilted_films() -> list[Check]:
    """Parallel faces, disc and narrow land that tilt, cavitation, guide."""
    return [_parallel(), _disc(), _narrow(), _step(), *_guide()]


def _heights(film: SectorFilm, height: float, tilt: float) -> np.ndarray:
    return (height + tilt * film.rows()[:, 1]).reshape(film.sectors, film.circles)


def _parallel() -> Check:
    film = sector_film(1.4e-3, 2e-3, circles=2)
    flat = _heights(film, _HEIGHT, 0.0)
    ring = RingFilm(shape="ring", inner_radius=1.4e-3, outer_radius=2e-3)
    return _check(
        "36 parallel sectors of a ring, force at 0.3 m/s [N]",
        expected=_MU * ring.coefficients()[0] * 0.3 / _HEIGHT**3,
        computed=float(sector_forces(film, flat, np.full_like(flat, 0.3), _MU).sum()),
        tolerance=5e-14,
        source="film of parallel faces",
    )


def _disc() -> Check:
    rate, radius = 100.0, 2e-3
    film = sector_film(0.0, radius, circles=2)
    flat = _heights(film, _HEIGHT, 0.0)
    forces = sector_forces(film, flat, _heights(film, 0.0, rate), _MU)
    return _check(
        "disc of 2 mm radius that begins to tilt, moment [N m]",
        expected=pi * _MU * rate * radius**6 / (8.0 * _HEIGHT**3),
        computed=float((film.rows().T @ forces.ravel())[1]),
        tolerance=3e-3,
        source=f"p = 3 mu w/(2 h^3) (R^2 r - r^3) cos; {_SECTORS}",
    )


def _narrow() -> Check:
    r, w, speed = 1e-3, 2e-6, 0.1
    film = sector_film(r - 0.5 * w, r + 0.5 * w)

    def force(tilt: float) -> float:
        heights = _heights(film, _HEIGHT, tilt * _HEIGHT / r)
        return float(sector_forces(film, heights, np.full_like(heights, speed), _MU).sum())

    def strips(tilt: float) -> float:
        even = 2.0 * pi * r * _MU * w**3 * speed / _HEIGHT**3
        return float(even * (2.0 + tilt**2) / (2.0 * (1.0 - tilt**2) ** 2.5))

    tilts = np.linspace(0.0, 0.8, 17)
    return _check(
        "narrow land, tilted by half of its height, force [N]",
        expected=strips(0.5),
        computed=force(0.5),
        tolerance=3e-3,
        source="strips mu w^3 V/h^3 round the circumference, in closed form",
        curve=ComparedCurve(
            x_label="tilt times radius over the mean height [-]",
            y_label="force [N]",
            expected=(tilts, np.array([strips(x) for x in tilts])),
            computed=(tilts, np.array([force(x) for x in tilts])),
        ),
    )


def _step() -> Check:
    film = sector_film(1.4e-3, 2e-3, circles=2)
    before, after = _heights(film, _HEIGHT, 0.5e-3), _heights(film, 0.7 * _HEIGHT, -0.3e-3)
    _, slopes = sector_step(film, before, after, 1e-6, _MU, tension=1e5)
    way = np.cos(np.arange(before.size)).reshape(before.shape) * 1e-11
    ahead, behind = (
        sector_step(film, before, after + sign * way, 1e-6, _MU, tension=1e5)[0] for sign in (1, -1)
    )
    numeric = (ahead - behind).ravel() / 2.0
    worst = np.abs(slopes @ way.ravel() - numeric).max() / np.abs(numeric).max()
    return _check(
        "slopes of a step of 36 sectors that cavitate, largest deviation [-]",
        expected=0.0,
        computed=float(worst),
        tolerance=1e-8,
        source="central differences",
    )


def _guide() -> list[Check]:
    eps, rate, whirl = 0.6, 1.0, 2.0

    def load(theta: float) -> float:
        squeezed = rate * cos(theta) + eps * whirl * np.sin(theta)
        return max(float(squeezed), 0.0) * cos(theta) / (1.0 - eps * cos(theta)) ** 3

    edge = float(np.arctan2(eps * whirl, rate))
    expected = -quad(load, edge - 0.5 * pi, edge + 0.5 * pi, epsrel=1e-12)[0]
    turning = guide_film_force(eps, 0.0, -0.5, True)
    return [
        _check(
            "guide, film of 180 degrees, squeeze and whirl: radial force over mu L^3 R/c^2 [1/s]",
            expected=expected,
            computed=guide_film_force(eps, rate, whirl, True)[0],
            tolerance=5e-14,
            source="short bearing (Ocvirk 1952; Booker 1965) by quadrature",
        ),
        _check(
            "the same, journal that turns: tangential force over mu w L^3 R/c^2 [-]",
            expected=pi * eps / (4.0 * (1.0 - eps**2) ** 1.5),
            computed=turning[1],
            tolerance=5e-14,
            source="Ocvirk (1952)",
        ),
    ]
