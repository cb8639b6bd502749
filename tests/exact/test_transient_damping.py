"""Damping of the full order against the damped modes themselves (exact for a linear free decay).

A trapezoidal step maps the coordinate q of a damped mode and its velocity exactly as

    (1 - h/2 B)^-1 (1 + h/2 B),    B = [[0, 1], [-omega^2, -2 zeta omega]]

so that after separation every mode of a body has to follow that map, to round-off.
"""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh

from klack.contact.mortar import ContactSpace
from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.eigen import Modes
from klack.reduction.damping import Damping, LossFactor, ModalDamping, RayleighDamping
from klack.transient.body_damping import body_damping
from klack.transient.full_order import Scheme, simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.transient import STEEL, blocked_bar

LENGTH, SPEED, KEPT = 0.03, 0.5, 6
PERIOD = 2 * LENGTH / STEEL.bar_wave_speed
STEP = PERIOD / 100
DAMPINGS = {
    "modal": ModalDamping(ratio=0.05),
    "loss factor": LossFactor(eta=0.02),
    "Rayleigh": RayleighDamping(alpha=4e3, beta=2e-8),
}


@cache
def bar() -> tuple[ElasticBody, ContactSpace]:
    """A free bar, axisymmetric, over a rigid wall."""
    blocked, space = blocked_bar(LENGTH, 2e-3, 12, STEEL)
    return elastic_body("bar", blocked.mesh, {"solid": STEEL}), space


@cache
def modes() -> Modes:
    """Every elastic mode, dense."""
    body = bar()[0]
    grid = np.ix_(body.free, body.free)
    squares, vectors = eigh(body.K.toarray()[grid], body.M.toarray()[grid])
    shapes = np.zeros((body.dof_count, len(squares)))
    shapes[body.free] = vectors
    return Modes(np.sqrt(squares[1:]), shapes[:, 1:])  # the first one is rigid


def run(
    damping: Damping, duration: float, scheme: Scheme = "contact-stabilised-newmark"
) -> FullOrderResult:
    body, space = bar()
    kept = Modes(modes().omega[:KEPT], modes().shapes[:, :KEPT])
    return simulate_full_order(
        body,
        None,
        space,
        speed=SPEED,
        duration=duration,
        step=STEP,
        scheme=scheme,
        damping=(body_damping(damping, kept), None),
        energy_interval=1,
    )


def coordinates(result: FullOrderResult) -> np.ndarray:
    """Modal coordinates and velocities at the end, shape (2, m)."""
    weighted = bar()[0].M @ modes().shapes
    fields = result.fields[0]
    return np.array([weighted.T @ fields.end_displacement, weighted.T @ fields.end_velocity])


def stepped(state: np.ndarray, omega: np.ndarray, zeta: np.ndarray, steps: int) -> np.ndarray:
    """The map above, mode by mode."""
    out = np.empty_like(state)
    for i, (w, z) in enumerate(zip(omega, zeta, strict=True)):
        B = np.array([[0.0, 1.0], [-(w**2), -2 * z * w]])
        one = np.linalg.solve(np.eye(2) - STEP / 2 * B, np.eye(2) + STEP / 2 * B)
        out[:, i] = np.linalg.matrix_power(one, steps) @ state[:, i]
    return out


@pytest.mark.slow
@pytest.mark.parametrize("name", DAMPINGS)
def test_every_mode_decays_as_its_damping_says(name):
    """Kept modes with their ratio, the others without; Rayleigh damping all of them."""
    damping, steps = DAMPINGS[name], 300
    apart = run(damping, 2 * PERIOD)
    later = run(damping, 2 * PERIOD + steps * STEP)
    assert later.history.force.max() > 0.0
    assert later.history.force[-steps - 1 :].max() == 0.0

    omega = modes().omega
    zeta = damping.ratios(omega)
    if name != "Rayleigh":
        zeta = np.where(np.arange(len(omega)) < KEPT, zeta, 0.0)
    expected = stepped(coordinates(apart), omega, zeta, steps)
    found = coordinates(later)
    scale = np.max(np.hypot(omega * expected[0], expected[1]))
    assert np.max(np.abs(omega * (found[0] - expected[0]))) < 1e-8 * scale  # 300 steps of round-off
    assert np.max(np.abs(found[1] - expected[1])) < 1e-8 * scale


@pytest.mark.parametrize("name", DAMPINGS)
def test_damping_leaves_rigid_motion_alone(name):
    """The bar flies on with its velocity, although ``alpha M`` alone would slow it down."""
    velocity = run(DAMPINGS[name], 8 * PERIOD).history.velocity_a
    assert velocity[-1] > 0.1 * SPEED
    assert velocity[-1] == pytest.approx(velocity[len(velocity) // 2], rel=1e-9)


@pytest.mark.parametrize("scheme", ["contact-stabilised-newmark", "massless"])
@pytest.mark.parametrize("name", DAMPINGS)
def test_energy_taken_by_damping_is_booked_in_every_step(name, scheme):
    result = run(DAMPINGS[name], 2 * PERIOD, scheme)
    energy = result.energy

    assert np.max(np.abs(energy.residual)) < 1e-10 * energy.total[0]  # as without damping
    assert np.all(np.diff(energy.damping) >= 0.0)
    assert result.history.ledger.damping == energy.damping[-1] > 1e-3 * energy.total[0]
    assert abs(result.history.ledger.residual) < 1e-10


@pytest.mark.parametrize("scheme", ["contact-stabilised-newmark", "massless"])
def test_a_spring_gives_and_takes_what_is_booked(scheme):
    """Momentum and energy of a damped bar that a stiff spring holds back, to round-off."""
    body, space = bar()
    kept = Modes(modes().omega[:KEPT], modes().shapes[:, :KEPT])
    result = simulate_full_order(
        body,
        None,
        space,
        speed=SPEED,
        duration=3 * PERIOD,
        step=STEP,
        scheme=scheme,
        axial_force=-5.0,
        spring_stiffness=1e7,
        damping=(body_damping(DAMPINGS["modal"], kept), None),
        energy_interval=1,
    )
    history = result.history
    pushed = (history.force.sum() + history.external_force.sum()) * STEP
    gained = history.mass_a * (history.velocity_a[-1] + SPEED)
    assert gained == pytest.approx(pushed, rel=1e-9)
    assert np.ptp(history.external_force) > 10.0
    assert np.max(np.abs(result.energy.residual)) < 1e-10 * result.energy.total[0]
    assert history.ledger.spring == result.energy.spring[-1] != 0.0


def test_no_damping_is_no_matrix():
    assert body_damping(ModalDamping(ratio=0.0), modes()) is None
    assert body_damping(RayleighDamping(alpha=0.0, beta=0.0), modes()) is None
