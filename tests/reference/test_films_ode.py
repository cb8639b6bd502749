"""Truth: an implicit Runge-Kutta solver of order 5 (scipy, Radau IIA) on the same equations."""

import numpy as np
import pytest

from klack.network.rows import FilmRow
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.verification.interface_motion import film_by_ode, interface_motion
from klack.verification.one_dimension import steel_rod

pytestmark = pytest.mark.slow

FILM = FilmRow(cubic=5e-17, linear=0.0, cut_off=1e-8, suction=1e9)
SHEARED = FilmRow(cubic=5e-17, linear=2e-11, cut_off=1e-8, suction=1e9)


@pytest.mark.parametrize("film", [FILM, SHEARED], ids=["squeeze", "squeeze and shear"])
def test_mass_on_a_film_before_a_spring(film):
    """3 g, 0.4 m/s, 1e9 N/m: the film alone stops the needle 0.1 um before the wall."""
    needle, wall = rigid_mass_body("needle", 3e-3, port="bottom"), fixed_body("wall", port="top")
    given = {"series": 1e-9, "gap": 4e-6, "speed": 0.4}
    peak, state = film_by_ode(needle, wall, film, **given, duration=30e-6, relative=1e-10)

    m = interface_motion(needle, wall, None, film=film, **given, step=20e-9, steps=1500)

    assert m.peak_force == pytest.approx(peak, rel=5e-5)  # mean of a step at the peak
    assert m.upper_speed == pytest.approx(state[1] / np.sqrt(3e-3), rel=5e-4)
    assert 0.05e-6 < m.law_gap.min() < 0.2e-6


def test_two_rods_kept_apart_by_a_film_converge_with_order_two():
    a, b = steel_rod("a", 0.04, 20), steel_rod("b", 0.08, 40)
    given = {"series": 1e-9, "gap": 5e-6, "speed": 0.5}
    _, exact = film_by_ode(a, b, FILM, **given, duration=60e-6, relative=1e-9)
    weight = np.concatenate([a.omega, b.omega, np.ones(a.omega.size + b.omega.size)])

    steps = np.array([375, 750, 1500, 3000])
    errors = []
    for n in steps:
        m = interface_motion(a, b, None, film=FILM, **given, step=60e-6 / n, steps=int(n))
        errors.append(np.linalg.norm(weight * (m.state - exact)) / np.linalg.norm(weight * exact))

    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.08)
    assert errors[-1] < 1e-5
