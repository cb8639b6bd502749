"""Truth: the matrix exponential of the same mode (scipy), and closed formulas."""

import numpy as np
import pytest
from draws import each
from scipy.linalg import expm

from klack.errors import InputError
from klack.simulation.propagator import damping_loss, modal_propagator

OMEGA = [1e3, 3e4, 4e5, 6e6]  # [rad/s]
ZETA = [0.0, 1e-3, 0.02, 0.9, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.5, 20.0]
STEP = [5e-9, 2e-8, 3e-7, 1e-5]  # [s]


@each("step", STEP)
@each("zeta", ZETA)
@each("omega", OMEGA)
def test_step_is_the_matrix_exponential(omega, zeta, step):
    P = modal_propagator(np.array([omega]), np.array([zeta]), step)
    x = omega * step  # state (q, q'/omega, f/omega^2, its rise): every entry of order one
    matrix = np.zeros((4, 4))
    matrix[:3, 1:] = [[x, 0.0, 0.0], [-2.0 * zeta * x, x, 0.0], [0.0, 0.0, 1.0]]
    matrix[1, 0] = -x
    E = expm(matrix)

    ours = [P.A11, P.A12 * omega, P.A21 / omega, P.A22, P.B1 * omega**2, P.B2 * omega]
    ours += [P.R1 * omega**2, P.R2 * omega]
    theirs = [E[0, 0], E[0, 1], E[1, 0], E[1, 1], E[0, 2], E[1, 2]]
    theirs += [E[0, 3] - 0.5 * E[0, 2], E[1, 3] - 0.5 * E[1, 2]]  # from -1/2 to 1/2
    small = min(1.0, x)
    scale = np.array([1.0, small, small, 1.0, small**2, small, small**2, small])

    # 1e-11: what scipy's scaling and squaring keeps at 60 rad per step; ours is 1e-14
    np.testing.assert_allclose(
        np.ravel(ours) / scale, np.array(theirs) / scale, rtol=1e-11, atol=1e-11
    )


@pytest.mark.parametrize("step", STEP)
def test_rigid_mode_under_constant_force_is_a_parabola(step):
    P = modal_propagator(np.zeros(1), np.zeros(1), step)
    steps, f, v0 = 100, 3.0, -0.5
    q, v = 0.0, v0
    for _ in range(steps):
        q, v = P.A11[0] * q + P.A12[0] * v + P.B1[0] * f, P.A21[0] * q + P.A22[0] * v + P.B2[0] * f
    t = steps * step

    assert q == pytest.approx(v0 * t + 0.5 * f * t**2, rel=1e-14)
    assert v == pytest.approx(v0 + f * t, rel=1e-14)
    assert P.R1[0] == pytest.approx(-(step**2) / 12.0, rel=1e-14)
    assert P.R2[0] == 0.0


def test_two_steps_are_one_double_step():
    omega, zeta = np.array([0.0, 1e4, 2e6, 5e5]), np.array([0.0, 0.3, 0.002, 3.0])
    one, two = (modal_propagator(omega, zeta, h) for h in (1e-6, 2e-6))

    np.testing.assert_allclose(one.A11**2 + one.A12 * one.A21, two.A11, atol=1e-14)
    np.testing.assert_allclose(one.A11 * one.B1 + one.A12 * one.B2 + one.B1, two.B1, rtol=1e-12)


def test_damping_loss_closes_the_energy_balance_of_one_step():
    """Conservation: energy lost = work in - energy gained; the loss is integrated, not balanced."""
    omega, zeta = np.array([1e5, 2e6, 3e7, 1e6]), np.array([0.01, 0.002, 0.02, 1.4])
    h = 2e-7
    P, L = modal_propagator(omega, zeta, h), damping_loss(omega, zeta, h)
    q, v, f = 1.0 / omega, np.array([0.3, -1.0, 0.8, 0.4]), 0.7 * omega
    q1, v1 = P.A11 * q + P.A12 * v + P.B1 * f, P.A21 * q + P.A22 * v + P.B2 * f
    energy = 0.5 * (v**2 + (omega * q) ** 2), 0.5 * (v1**2 + (omega * q1) ** 2)

    lost = L.Q11 * q**2 + L.Q12 * q * v + L.Q22 * v**2 + f * (L.L1 * q + L.L2 * v) + L.S * f**2

    # 1e-12 of the energy: the balance itself loses that much by subtraction
    np.testing.assert_allclose(lost, energy[0] + f * (q1 - q) - energy[1], atol=1e-12)
    assert np.all(lost > 0.0)


@pytest.mark.parametrize(
    ("omega", "zeta", "step"), [([1e3], [-0.1], 1e-6), ([-1.0], [0.0], 1e-6), ([1.0], [0.0], 0.0)]
)
def test_impossible_modes_are_refused(omega, zeta, step):
    with pytest.raises(InputError, match="modal_propagator"):
        modal_propagator(np.array(omega), np.array(zeta), step)
