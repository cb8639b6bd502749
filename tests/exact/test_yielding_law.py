"""Impacts on faces that yield.

Truth: two straight lines, loading with k1 and elastic with k2 (Walton & Braun, J. Rheol. 30 (1986)
949), have closed forms for every impact on the same place; and the energy.
"""

import numpy as np
import pytest

from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

MASS, SPEED, LOADING, ELASTIC = 3e-3, 0.3, 1e8, 2.5e8
RATIO = LOADING / ELASTIC
ALONE = SPEED * np.sqrt(MASS * LOADING)  # force of the first impact


def _two_lines(end=10e-6, states=40):
    largest = np.linspace(1e-10, end, states)
    return YieldingLaw(
        largest=largest,
        set=largest * (1 - RATIO),
        closing=LOADING * largest,
        shape=np.tile((np.arange(17) / 16) ** 2, (states, 1)),
    )


def _impact(law, step=20e-9, speed=SPEED):
    contact = ContactPair(
        body_a="needle", port_a="contact", body_b="seat", port_b="contact", law=law, gap=0.0
    )
    system = ReducedSystem(
        bodies=(rigid_mass_body("needle", MASS), fixed_body("seat")), contacts=(contact,)
    )
    return simulate_impact(system, speed=speed, duration=40e-6, step=step)


@pytest.mark.parametrize("step", [200e-9, 20e-9])
def test_impacts_on_the_same_place_run_in(step):
    """Exact: F_n^2 = F^2 + (1 - r) F_(n-1)^2 and e_n^2 = r F_n^2/F^2, r = k1/k2; order 2."""
    law, before = _two_lines(), 0.0
    for _ in range(6):
        history = _impact(law, step)
        force = np.sqrt(ALONE**2 + (1 - RATIO) * before**2)
        tolerance = 1e-4 if step < 1e-7 else 5e-3
        assert history.velocity_a[-1] / SPEED == pytest.approx(
            np.sqrt(RATIO) * force / ALONE, rel=tolerance
        )
        assert np.max(history.peak_force) == pytest.approx(force, rel=tolerance)
        assert LOADING * history.pressed == pytest.approx(force, rel=tolerance)
        assert abs(history.ledger.residual) < 1e-12
        loss = 0.5 * (1 - RATIO) / LOADING * (force**2 - before**2)
        assert history.ledger.plastic == pytest.approx(loss, rel=20 * tolerance)
        law, before = law.after(history.pressed), force


def test_less_than_before_is_elastic():
    """Exact: half the speed on faces that are run in; a linear spring, half a period in contact."""
    law = _two_lines()
    law = law.after(_impact(law).pressed)

    history = _impact(law, speed=0.5 * SPEED)

    assert history.ledger.plastic == 0.0
    assert history.velocity_a[-1] == pytest.approx(0.5 * SPEED, rel=1e-12)
    contact = np.count_nonzero(history.force) * history.step
    assert contact == pytest.approx(np.pi * np.sqrt(MASS / ELASTIC), abs=2 * history.step)
    assert law.set_after(law.reached) == pytest.approx(ALONE / LOADING * (1 - RATIO), rel=1e-4)


def test_elastic_curve_and_closing_meet():
    """Exact: continuous where yield resumes, no force below the set."""
    law = _two_lines().after(4e-6)
    around = 4e-6 + 1e-12 * np.array([-1.0, 1.0])

    assert law.force(around) == pytest.approx(LOADING * 4e-6, rel=1e-5)
    assert law.force(law.set_after(4e-6)) == 0.0
    assert law.force(3e-6) == pytest.approx(ELASTIC * (3e-6 - 4e-6 * (1 - RATIO)), rel=1e-12)


def test_impact_beyond_the_last_state_is_refused():
    with pytest.raises(InputError, match=r"at most 1\.5 um, 150 N"):
        _impact(_two_lines(end=1.5e-6))


def test_loss_that_falls_is_refused():
    """Conservation: else pressing further would give energy."""
    law = _two_lines()
    with pytest.raises(InputError, match="a loss that falls"):
        YieldingLaw(
            largest=law.largest, set=law.set[::-1] * 0, closing=law.closing, shape=law.shape**0.01
        )


def test_random_drives_lose_and_never_gain():
    """Conservation: laws and speeds drawn at random, bounced three times."""
    rng = np.random.default_rng(7)
    run = 0
    while run < 40:
        power = rng.uniform(1.0, 1.6)
        largest = np.linspace(1e-9, 30e-6, 60)
        force = rng.uniform(2e7, 4e8) * largest * (largest / 5e-6) ** (power - 1)
        left = largest * rng.uniform(0.0, 0.8) * (1 - np.exp(-largest / 5e-6))
        shape = np.tile((np.arange(33) / 32) ** (2 * rng.uniform(1.0, 1.5)), (60, 1))
        try:
            law = YieldingLaw(largest=largest, set=left, closing=force, shape=shape)
        except InputError:
            continue
        run += 1
        for _ in range(3):
            history = _impact(law, step=rng.uniform(5e-9, 3e-7), speed=rng.uniform(0.05, 0.4))
            assert abs(history.ledger.residual) < 1e-10
            assert history.ledger.plastic >= -1e-9 * history.ledger.initial
            law = law.after(history.pressed)
