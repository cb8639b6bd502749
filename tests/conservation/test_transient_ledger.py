"""Momentum and energy of full-order impacts: both must balance to round-off at any step."""

from functools import cache

import numpy as np
import pytest

from klack.elasticity.body import ElasticBody
from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.transient import sphere_over_cylinder

SCHEMES = ["contact-stabilised-newmark", "massless"]
SPEED = 0.5


@cache
def problem():
    return sphere_over_cylinder(
        sphere_radius=2e-3, radius=4e-3, height=6e-3, size=25e-6, bulk=1.5e-3
    )


@cache
def run(scheme: str, step: float = 100e-9, axial_force: float = 0.0) -> FullOrderResult:
    a, b, space = problem()
    return simulate_full_order(
        a,
        b,
        space,
        speed=SPEED,
        duration=25e-6,
        step=step,
        scheme=scheme,
        axial_force=axial_force,
        energy_interval=1,
    )


def momentum(body: ElasticBody, velocity: np.ndarray) -> float:
    return float((body.M @ velocity)[1::2].sum())


@pytest.mark.parametrize("scheme", SCHEMES)
def test_impulse_is_the_change_of_momentum_of_both_bodies(scheme):
    a, b, _ = problem()
    result = run(scheme)
    history = result.history

    assert history.impulse > 0
    assert history.mass_a * np.diff(history.velocity_a[[0, -1]])[0] == pytest.approx(
        history.impulse, rel=1e-10
    )
    assert history.mass_b * np.diff(history.velocity_b[[0, -1]])[0] == pytest.approx(
        -history.impulse, rel=1e-10
    )
    # the recorded velocity fields carry the same momentum; the massless scheme moves the mass of
    # the contact nodes by part of an element
    rel = 1e-10 if scheme == "contact-stabilised-newmark" else 1e-5
    total = momentum(a, result.fields[0].end_velocity) + momentum(b, result.fields[1].end_velocity)
    assert total == pytest.approx(-history.mass_a * SPEED, rel=rel)


@pytest.mark.parametrize("step", [pytest.param(20e-9, marks=pytest.mark.slow), 100e-9, 400e-9])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_energy_balances_at_every_step(scheme, step):
    result = run(scheme, step)
    energy = result.energy

    assert np.max(np.abs(energy.residual)) < 1e-10 * energy.total[0]
    assert abs(result.history.ledger.residual) < 1e-10
    assert result.energy_loss == pytest.approx(
        result.history.ledger.contact_dissipation / energy.total[0], abs=1e-10
    )


def test_stabilised_scheme_never_gains_energy():
    """Deuflhard, Krause & Ertel 2008: both losses grow monotonically."""
    energy = run("contact-stabilised-newmark", 400e-9).energy
    scale = energy.total[0]

    assert np.all(np.diff(energy.contact) >= -1e-13 * scale)
    assert np.all(np.diff(energy.overshoot) >= -1e-13 * scale)
    assert np.max(np.diff(energy.total)) <= 1e-11 * scale  # round-off
    assert energy.contact[-1] + energy.overshoot[-1] > 1e-6 * scale


def test_end_fields_hold_the_recorded_energy():
    """v^T M v / 2 with the true velocity, M^-1 G^T y taken off."""
    a, b, _ = problem()
    result = run("contact-stabilised-newmark")

    for i, (body, field) in enumerate(zip((a, b), result.fields, strict=True)):
        kinetic = 0.5 * field.end_velocity @ (body.M @ field.end_velocity)
        strain = 0.5 * field.end_displacement @ (body.K @ field.end_displacement)
        assert kinetic == pytest.approx(result.energy.kinetic[-1, i], rel=1e-9)
        size = np.abs(field.end_displacement)
        round_off = np.finfo(float).eps * size @ (abs(body.K) @ size)  # of the terms of strain
        assert strain == pytest.approx(result.energy.strain[-1, i], rel=1e-9, abs=round_off)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_constant_force_is_booked_as_work(scheme):
    result = run(scheme, axial_force=-60.0)
    history = result.history

    total = history.impulse - 60.0 * history.force.size * history.step
    assert history.mass_a * (history.velocity_a[-1] + SPEED) == pytest.approx(total, rel=1e-9)
    assert result.energy.work[-1] != 0.0
    assert np.max(np.abs(result.energy.residual)) < 1e-10 * result.energy.total[0]


def test_forces_only_push_and_only_where_closed():
    result = run("contact-stabilised-newmark")
    history = result.history

    assert np.all(result.point_force >= 0)
    assert np.all(history.gap > -1e-12)
    assert np.all(history.gap[history.force > 1.0] < 30e-9)  # mean over a step of 0.5 m/s x 100 ns
    assert 0 < np.max((result.point_force > 0) @ result.area) < np.sum(result.area)
    assert result.pressure[result.peak_index].max() > 1e9
