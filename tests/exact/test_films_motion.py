"""Truth: film impulse, Stefan's fall time, the cavitation limit, and the loop without films."""

from decimal import Decimal, getcontext

import numpy as np
import pytest

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.contact.step_constants import NO_LAW
from klack.network.rows import FilmRow
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.interface_step import film_force, interface_store, solve_interface
from klack.verification.interface_motion import interface_motion
from klack.verification.one_dimension import one_contact, steel_rod

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
