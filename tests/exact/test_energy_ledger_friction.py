"""Friction as an entry of the energy balance (exact)."""

import pytest

from klack.contact.history import BodyEnergy, EnergyLedger
from klack.transient.interface_result import InterfaceEnergy

BODY = BodyEnergy(name="needle", translation=0.7, vibration=0.05, strain=0.01)


def test_friction_is_a_loss_like_the_others():
    ledger = EnergyLedger(
        initial=1.0, bodies=(BODY,), contact_dissipation=0.02, damping=0.03, friction=0.2
    )
    assert ledger.residual == pytest.approx(0.0, abs=1e-15)
    assert ledger.lost == pytest.approx(0.25)
    assert ledger.parts()["friction"] == 0.2
    assert ledger.least_loss == 0.02


def test_a_gain_by_friction_is_a_negative_loss():
    ledger = EnergyLedger(initial=1.0, bodies=(BODY,), damping=0.3, friction=-0.05)
    assert ledger.least_loss == pytest.approx(-0.05)


def test_so_it_is_at_the_interface_level():
    energy = InterfaceEnergy(
        initial=1.0, final=0.9, damping=0.1, guide=0.02, work=0.0, debt=0.0, friction=-0.02
    )
    assert energy.residual == pytest.approx(0.0, abs=1e-15)
    assert energy.least_loss == pytest.approx(-0.02)


def test_without_friction_there_is_no_entry_for_it():
    ledger = EnergyLedger(initial=1.0, bodies=(BODY,), contact_dissipation=0.02, damping=0.03)
    assert "friction" not in ledger.parts()
    assert ledger.least_loss == 0.02
