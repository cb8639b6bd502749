"""Reduced rods against closed formulas.

Truth: free-free rod end, receptance ``-cot(kL)/(EAk)``, and the series of its modes; the table of
residual flexibilities in ``tests/data`` is evaluated from them independently.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from klack.elasticity.eigen import Modes, eigenmodes
from klack.elasticity.statics import Flexibility
from klack.reduction.attachment import default_shift, shift_at, shifted_attachment
from klack.reduction.damping import LossFactor
from klack.reduction.full_order import full_order_receptance
from klack.reduction.receptance import reduced_receptance
from klack.reduction.reduce import reduce_body
from klack.reduction.selection import ByCount
from klack.verification.reduction import (
    LENGTH,
    RADIUS,
    STEEL_WITHOUT_POISSON,
    exact_receptance,
    rod,
)

TABLE = np.genfromtxt(
    Path(__file__).parents[1] / "data" / "rod_residual_flexibility.csv",
    delimiter=",",
    skip_header=2,
)
SPRING = STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2 / LENGTH  # EA / L
DAMPING = LossFactor(eta=1e-2)


@pytest.fixture(scope="module")
def free():
    body, lower, upper = rod(elements=120, clamped=False)
    return body, [lower, upper], eigenmodes(body, count=20), Flexibility(body)


@pytest.fixture(scope="module")
def clamped():
    body, lower, _ = rod(elements=120, clamped=True)
    return body, [lower], eigenmodes(body, count=20), Flexibility(body)


def reduced(parts, count, correction, shifts=None):
    body, ports, pool, flexibility = parts
    return reduce_body(
        body,
        ports,
        modes=ByCount(count),
        correction=correction,
        damping=DAMPING,
        modes_pool=pool,
        flexibility=flexibility,
        shifts=shifts,
    )


# Tolerance: the frequency of mode n of a quadratic rod is high by (n pi h / L)^4 / 720, 1e-4 for
# n = 20 and 120 elements, and the residual is a small difference of nearly equal sums.
@pytest.mark.parametrize(("column", "support"), [(1, "free"), (2, "clamped")])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 10, 20])
def test_missing_compliance_matches_the_table(count, column, support, request):
    expected = TABLE[TABLE[:, 0] == count, column].item()

    body = reduced(request.getfixturevalue(support), count, "consistent")

    assert body.residual_compliance[0, 0] * SPRING == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("support", ["free", "clamped"])
@pytest.mark.parametrize("count", [0, 1, 5, 20])
def test_attachment_modes_make_the_static_response_exact(count, support, request):
    body = reduced(request.getfixturevalue(support), count, "attachment")

    assert_allclose(body.modal_compliance, body.static_compliance, rtol=1e-10, atol=0)
    exact = 1 / 3 if support == "free" else 1.0
    assert body.modal_compliance[0, 0] * SPRING == pytest.approx(exact, rel=1e-8)


def test_end_to_end_compliance_of_the_free_rod(free):
    """Inertia relief, far end: sum of 2 (-1)^n / (n pi)^2 = -1/6."""
    body = reduced(free, 3, "attachment")

    assert body.static_compliance[0, 1] * SPRING == pytest.approx(-1 / 6, rel=1e-8)


def test_shifted_attachment_modes_are_exact_at_their_shift(free):
    """At w^2 = s < 0: coth(aL)/(EAa), a^2 = -s rho/E, from the receptance at imaginary w."""
    pool = free[2]
    shift = default_shift(pool.omega)
    body = reduced(free, 3, "attachment", shifts=(shift,))

    computed = np.sum(body.port_shapes[:, 0] ** 2 / (body.omega**2 - shift))

    a = np.sqrt(-shift * STEEL_WITHOUT_POISSON.density / STEEL_WITHOUT_POISSON.young)
    exact = 1 / np.tanh(a * LENGTH) / (STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2 * a)
    assert computed == pytest.approx(exact, rel=1e-8)


# Tolerance: quadratic elements are off by (k h)^4 / 720, 2e-7 at 190 kHz and 120 elements, which
# the distance from the nearest resonance or notch magnifies.
@pytest.mark.parametrize("ends", [(0, 0), (1, 0)], ids=["drive point", "far end"])
@pytest.mark.parametrize("shifts", [(20e3, 190e3), (130e3, -40e3)], ids=["above", "both signs"])
def test_two_shifted_attachment_modes_are_exact_at_both_shifts(free, shifts, ends):
    """Without damping, -cot(kL)/(EAk) and -1/(sin(kL) EAk); both signs: with imaginary k."""
    body = reduced(free, 1, "attachment", shifts=[shift_at(f) for f in shifts])
    E, rho = STEEL_WITHOUT_POISSON.young, STEEL_WITHOUT_POISSON.density

    for f in shifts:
        k = 2 * np.pi * np.sqrt(complex(np.sign(f))) * abs(f) * np.sqrt(rho / E)
        exact = -1 / (
            E * np.pi * RADIUS**2 * k * (np.tan if ends == (0, 0) else np.sin)(k * LENGTH)
        )
        phi = body.port_shapes
        computed = np.sum(phi[:, ends[0]] * phi[:, ends[1]] / (body.omega**2 - shift_at(f)))
        assert computed == pytest.approx(exact.real, rel=1e-5)


@pytest.mark.parametrize(("count", "shifts"), [(1, (20e3, 190e3)), (3, (-50e3, 30e3, -200e3))])
def test_every_shift_adds_one_orthonormal_mode_per_port(free, count, shifts):
    """M-orthonormal and K-diagonal to round-off: the recovered shapes of all nodes tell."""
    body, ports, pool, flexibility = free
    kept = Modes(omega=pool.omega[:count], shapes=pool.shapes[:, :count])
    patterns = np.column_stack([port.pattern for port in ports])

    extra = shifted_attachment(body, kept, patterns, [shift_at(f) for f in shifts], flexibility)

    assert len(extra.omega) == 2 * len(shifts)  # two ports
    V = np.hstack([body.rigid_modes, kept.shapes, extra.shapes])
    omega = np.concatenate([np.zeros(body.rigid_modes.shape[1]), kept.omega, extra.omega])
    assert_allclose(V.T @ (body.M @ V), np.eye(len(omega)), atol=1e-9)
    assert_allclose(
        V.T @ (body.K @ V) / omega.max() ** 2, np.diag(omega / omega.max()) ** 2, atol=1e-9
    )


def test_two_low_shifts_leave_the_square_of_the_static_error_of_one(free):
    """Both far below the omitted modes: relative error below (s_1 / w^2)^2 (s_2 / w^2)^2."""
    pool = free[2]
    shifts = (default_shift(pool.omega), 0.25 * default_shift(pool.omega))

    one = reduced(free, 3, "attachment", shifts=shifts[:1]).residual_compliance[0, 0]
    two = reduced(free, 3, "attachment", shifts=shifts).residual_compliance[0, 0]

    ratios = [s / pool.omega[3] ** 2 for s in shifts]
    assert 0 < one * SPRING < ratios[0] ** 2
    assert abs(two) * SPRING < np.prod(ratios) ** 2 + 1e-12


@pytest.mark.parametrize("count", [3, 10])
def test_shifted_attachment_modes_are_nearly_exact_statically(free, count):
    """Documented error of the default shift: of the order (omega_1 / omega_(m+1))^4, from above."""
    pool = free[2]
    body = reduced(free, count, "attachment", shifts=(default_shift(pool.omega),))

    missing = body.residual_compliance[0, 0] * SPRING

    assert 0 < missing < (pool.omega[0] / pool.omega[count]) ** 4


def test_full_order_receptance_is_that_of_the_exact_rod(free):
    """1 kHz to 1 MHz, 27 resonances; 120 elements leave 1.2e-3 at the sharpest of them."""
    body, ports, _, flexibility = free
    axis = np.geomspace(1e3, 1e6, 600)

    full = full_order_receptance(
        body, ports, axis, loss_factor=1e-2, flexibility=flexibility, tolerance=1e-4
    )

    assert full.error_bound.max() <= 1e-4
    assert_allclose(full.receptance.values[:, 0, :], exact_receptance(axis), rtol=2e-3)


@pytest.mark.parametrize(
    ("correction", "tolerance"), [("consistent", 0.1), ("attachment", 2e-3), ("none", None)]
)
def test_correction_restores_the_receptance(free, correction, tolerance):
    """10 modes (to 860 kHz), up to 250 kHz, every antiresonance included.

    The constant residual misses a share (f / f_11)^2 = 7 % of itself at the top, which shows at the
    antiresonances (0.085 there); the attachment mode the square of it.  Without correction the
    antiresonances are elsewhere (factor 5).
    """
    axis = np.linspace(5e3, 250e3, 300)
    body = reduced(free, 10, correction)

    computed = reduced_receptance(
        body, axis, with_residual=correction == "consistent", loss_factor=1e-2
    )

    deviation = np.max(np.abs(computed.values[:, 0, 0] / exact_receptance(axis)[:, 0] - 1))
    assert deviation > 3 if tolerance is None else deviation < tolerance


def test_viscous_damping_has_the_same_resonance_peaks(free):
    """At a resonance zeta = eta / 2 gives the peak of the loss factor: |G| = phi^2 / (eta w^2)."""
    body = reduced(free, 5, "attachment")
    axis = body.frequencies[1:4]

    viscous = reduced_receptance(body, axis, with_residual=False)
    structural = reduced_receptance(body, axis, with_residual=False, loss_factor=1e-2)

    # the other modes stand beside the peak; their damping differs, a few eta^2 of the peak
    assert_allclose(np.abs(viscous.drive("bottom")), np.abs(structural.drive("bottom")), rtol=5e-4)
