"""A bar that bounces ten periods long under its weight: exact and periodic."""

import pytest

from klack.verification.bouncing_bar import bounce, lines_of_force

CONTACTS = 20
DURATION = 4.0 * CONTACTS  # [T]


@pytest.mark.parametrize(("level", "modes"), [("interface", 80), ("reduced", 80)])
def test_modal_levels_keep_the_energy_of_twenty_flat_impacts(level, modes):
    """No steps lose energy: what the bar has at the end is round-off apart (some 3e5 steps)."""
    history = bounce(level, modes, duration=DURATION)
    ledger = history.ledger
    assert abs(ledger.residual) < 5e-11
    assert ledger.least_loss > -5e-11
    assert ledger.contact_dissipation == pytest.approx(0.0, abs=5e-11 * ledger.initial)


def test_the_first_six_contacts_stay_with_the_exact_ones():
    """Forces within 3 % of Z v and touches within 1 % of T: 80 modes ring at fronts (Gibbs).

    Each contact begins with what all before it left; some contacts later the touches stray.
    """
    found = list(lines_of_force("reduced", bounce("reduced", 80, duration=24.0)))
    assert len(found) == 6
    for contact, (touch, start, end) in enumerate(found):
        assert touch == pytest.approx(4.0 * contact, abs=1e-2)
        known = (1.0, 5.0 / 3.0) if contact % 2 == 0 else (5.0 / 3.0, 1.0)
        assert (start, end) == pytest.approx(known, abs=3e-2)


def test_the_full_order_takes_energy_from_flat_impacts_and_counts_it():
    """Loss in the first contact falls with the elements; the balance closes to round-off."""
    lost = []
    for elements in (100, 200):
        ledger = bounce("full", elements, duration=3.0).ledger
        assert abs(ledger.residual) < 1e-12
        lost.append(ledger.contact_dissipation / ledger.initial)
    assert 0.0 < lost[1] < lost[0] < 0.02
