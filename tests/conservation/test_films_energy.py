"""Truth: ``-F (g1 - g0) = change of stores + losses`` in every single step, losses not negative."""

import numpy as np
import pytest

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.contact.step_constants import NO_LAW
from klack.network.rows import FilmRow
from klack.simulation.interface_step import interface_store, solve_interface
from klack.verification.interface_motion import interface_motion
from klack.verification.one_dimension import steel_rod

pytestmark = pytest.mark.slow

DEPTH = 6e-6 * np.linspace(0.0, 1.0, 30)[1:]  # [m]
LAWS = {
    "none": None,
    "linear": LinearLaw(1e9),
    "hertz": HertzLaw(2e11),
    "table": TableLaw(DEPTH, 2e11 * DEPTH**1.5),
}


@pytest.mark.parametrize("name", list(LAWS))
def test_any_step_from_any_state(name):
    """4000 steps: films from none to far too stiff, 1 ns to 1 us, open, closed and between."""
    law = LAWS[name]
    kind, data = (NO_LAW, np.zeros(1)) if law is None else (law.flat().kind, law.flat().parameters)
    rng = np.random.default_rng(7)
    acted = 0
    for _ in range(4000):
        film = rng.integers(3)
        chi = rng.choice([0.0, 5e7 * rng.random()]) if law else 0.0
        series = rng.choice([0.0, 1e-9, 1e-8])
        g0 = rng.uniform(-1.0, 1.0) * 10.0 ** rng.uniform(-8.0, -4.0)
        e0 = rng.uniform(-0.3, 1.0) * 1e-7 if series else 0.0
        contact, pull, g1, e1, _, lost, loss = solve_interface(
            kind,
            data,
            0,
            chi,
            10.0 ** rng.uniform(-20.0, -14.0) if film else 0.0,
            10.0 ** rng.uniform(-14.0, -9.0) if film == 2 else 0.0,
            10.0 ** rng.uniform(-8.0, -6.0),
            rng.choice([0.0, 1.0, 50.0]),
            10.0 ** rng.uniform(-9.0, -6.0),
            10.0 ** rng.uniform(-14.0, -9.0),
            series,
            g0,
            g0 + rng.uniform(-1.0, 1.0) * 10.0 ** rng.uniform(-9.0, -6.0),
            e0,
            rng.uniform(-10.0, 300.0),
            0,
            rng.choice([0.0, 100.0 * rng.random()]),
        )
        force = contact + pull
        before = interface_store(kind, data, 0, series, g0, e0)
        after = interface_store(kind, data, 0, series, g1, e1)
        taken = -force * (g1 - g0)
        scale = abs(taken) + before + after + lost + loss
        # forces are accepted with an error of 1e-9 N
        accepted = 1e-12 * scale + 2e-9 * abs(g1 + e1 - g0 - e0)
        assert taken == pytest.approx(after - before + lost + loss, rel=0, abs=accepted)
        assert min(lost, loss) > -accepted
        assert contact >= 0.0
        acted += force != 0.0
    assert acted > 1000


@pytest.mark.parametrize("step", [1e-6, 100e-9, 20e-9], ids=["1 us", "100 ns", "20 ns"])
@pytest.mark.parametrize("suction", [0.6, 1e9], ids=["cavitating", "pulling"])
def test_rods_with_film_asperities_and_compliance(step, suction):
    film = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.2e-6, suction=suction)
    law = HuntCrossley(LinearLaw(1e10), gonthier_coefficient(0.9))

    m = interface_motion(
        steel_rod("a", 0.04, 20),
        steel_rod("b", 0.08, 40),
        law,
        film=film,
        series=1e-9,
        gap=5e-6,
        speed=0.5,
        step=step,
        steps=int(200e-6 / step),
    )

    assert m.contact_force.max() > 30.0
    assert m.film_loss.sum() > 0.01 * m.kinetic
    assert abs(m.residual) < 1e-11
    # a coarse step lets the film do its work in one or two of them
    assert m.film_loss.min() > -1e-18
    assert m.contact_loss.min() > -1e-18


def test_thousands_of_impacts_on_a_film():
    """200 N press the needle on its seat for 20 ms; books hold to 1e-10 of the throughput."""
    film = FilmRow(cubic=1e-19, linear=0.0, cut_off=0.2e-6, suction=0.6)
    m = interface_motion(
        steel_rod("a", 0.04, 19),
        steel_rod("b", 0.1, 40, clamped=True),
        LinearLaw(1e10),
        film=film,
        series=1e-9,
        gap=1e-6,
        speed=1.0,
        press=200.0,
        step=100e-9,
        steps=200_000,
    )

    impacts = np.sum((m.contact_force[1:] > 0.0) & (m.contact_force[:-1] == 0.0))
    assert impacts > 100
    assert abs(m.residual) < 1e-10
