"""Solvers of contact points: complementarity, line search, yielding.

Complementarity problem; truth: enumeration of all active sets, and the conditions.

Compiled complementarity solver of the time step; truth: the plain solver and the conditions.

How far to go along a step of Newton's method.

Von Mises plasticity point by point.

Truth: closed forms of simple shear, the derivative of the stress, and Drucker's inequality.
"""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.contact import complementarity
from klack.contact.complementarity import ComplementaritySolver, solve_lcp
from klack.contact.plasticity.ladder import lowest_share
from klack.contact.plasticity.radial_return import PlasticState, radial_return
from klack.errors import ConvergenceError, InputError
from klack.materials.hardening import Hardening
from klack.transient.active_set import solve_active
from klack.transient.interface_arrays import ActiveSet


def random_problem(seed, size, conditioning=1.0):
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((size, size))
    return B @ B.T + conditioning * np.eye(size), rng.standard_normal(size)


def by_enumeration(A, q):
    for choice in product((False, True), repeat=len(q)):
        active = np.array(choice)
        lam = np.zeros(len(q))
        lam[active] = np.linalg.solve(A[np.ix_(active, active)], -q[active])
        if lam.min() >= 0 and (q + A @ lam).min() >= -1e-11:
            return lam
    raise AssertionError("a positive definite problem has a solution")


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.integers(1, 8), guess=st.integers(0, 255))
def test_any_first_guess_finds_the_solution_of_enumeration(seed, size, guess):
    A, q = random_problem(seed, size, conditioning=0.1)
    active = np.array([bool(guess >> k & 1) for k in range(size)])

    lam, _, _ = solve_lcp(A, q, active)

    np.testing.assert_allclose(lam, by_enumeration(A, q), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("scale", [1.0, 1e-9], ids=["unit scale", "metres per newton"])
def test_conditions_hold_for_many_points(scale):
    """Gaps of micrometres and compliances of 1e-9 m/N: tolerances belong to the gaps."""
    A, q = random_problem(3, 300)
    A, q = A * scale, q * scale * 1e3

    lam, active, _ = solve_lcp(A, q)
    gap = q + A @ lam

    assert lam.min() >= 0.0
    assert gap.min() >= -1e-11 * np.abs(q).max()
    assert np.abs(gap * lam).max() <= 1e-10 * np.abs(q).max() * lam.max()
    np.testing.assert_array_equal(active[lam > 0], True)
    assert 10 < active.sum() < 290


def test_open_contact_carries_nothing():
    lam, active, rounds = solve_lcp(np.eye(4), np.full(4, 1e-6))

    assert not lam.any()
    assert not active.any()
    assert rounds == 1


def test_a_sequence_with_kept_factor_equals_single_problems():
    A, q = random_problem(5, 60)
    solver = ComplementaritySolver(A)
    active = None
    for shift in np.linspace(0.5, -0.5, 15):
        lam, active, _ = solver.solve(q + shift, active)
        np.testing.assert_allclose(lam, solve_lcp(A, q + shift)[0], rtol=1e-9, atol=1e-12)


def test_the_solution_as_guess_takes_one_round():
    A, q = random_problem(9, 80)
    _, active, first = solve_lcp(A, q)

    _, _, again = solve_lcp(A, q, active)

    assert first > 1
    assert again == 1


def test_cycling_of_the_fast_iteration_is_broken():
    """Flipping all wrong points at once cycles here (a P-matrix far from an M-matrix)."""
    found = 0
    for seed in range(300):
        A, q = random_problem(seed, 12, conditioning=1e-6)
        lam, _, rounds = solve_lcp(A, q, np.zeros(12, dtype=bool))
        assert (q + A @ lam).min() >= -1e-9
        found += rounds > 8
    assert found > 0


def test_an_indefinite_matrix_is_refused():
    with pytest.raises(ConvergenceError, match="not positive definite"):
        solve_lcp(np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([-1.0, -1.0]))


def test_nan_is_refused():
    with pytest.raises(InputError, match="finite"):
        solve_lcp(np.array([[np.nan]]), np.array([1.0]))


def test_a_contact_that_shrinks_loses_the_points_that_joined_last(monkeypatch):
    """Points of a diagonal compliance carry where they are below, and join all at once.

    The shallowest stand last in the factor: without them, what is left of it is kept.
    """
    depth = np.random.default_rng(4).permutation(40) / 40.0
    solver, added = ComplementaritySolver(np.eye(40)), []
    bordered = complementarity._bordered

    def counting(known, beside, corner):
        added.append(len(corner))
        return bordered(known, beside, corner)

    monkeypatch.setattr(complementarity, "_bordered", counting)
    active = None
    for approach in (0.9, 0.6, 0.3):
        forces, active, _ = solver.solve(depth - approach, active)
        np.testing.assert_allclose(forces, np.maximum(approach - depth, 0.0), atol=1e-15)

    assert added == [36, 0, 0]


class Compiled:
    """Keeps the active set and its inverse from call to call, as the time loop does."""

    def __init__(self, A):
        n = len(A)
        self.A = np.ascontiguousarray(A)
        self.carrying = ActiveSet.none(n)

    def solve(self, q):
        lam, gap = np.zeros(len(q)), np.zeros(len(q))
        rounds = solve_active(
            self.A,
            q,
            self.carrying,
            lam,
            gap,
            1e-13 * np.abs(q).max(initial=1e-300),
            np.mean(np.diag(self.A)),
        )
        return lam, gap, rounds

    def inverse_error(self):
        at = self.carrying.points[: self.carrying.counts[0]]
        B = self.carrying.inverse[: len(at), : len(at)]
        return np.abs(B @ self.A[np.ix_(at, at)] - np.eye(len(at))).max(initial=0.0)


def random_matrix(rng, n, conditioning):
    B = rng.standard_normal((n, n))
    return B @ B.T / n + conditioning * np.eye(n)


def contact_matrix(n, reach=0.1):
    """Points on a line with a smooth decaying compliance, like an elastic face."""
    x = np.linspace(0.0, 1.0, n)
    return np.exp(-np.abs(x[:, None] - x) / reach) * 1e-9 + 1e-12 * np.eye(n)


def check(A, q, lam, gap, rtol=1e-9):
    assert lam.min() >= 0.0
    assert gap.min() >= -1e-12 * np.abs(q).max()
    np.testing.assert_allclose(gap, q + A @ lam, atol=1e-9 * np.abs(q).max())
    assert np.all((lam == 0.0) | (gap == 0.0))
    expected, _, _ = solve_lcp(A, q)
    np.testing.assert_allclose(lam, expected, rtol=rtol, atol=rtol * expected.max(initial=1e-300))


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000), n=st.integers(1, 60), conditioning=st.sampled_from([1e-4, 0.1, 1])
)
def test_cold_start(seed, n, conditioning):
    rng = np.random.default_rng(seed)
    A, q = random_matrix(rng, n, conditioning), rng.standard_normal(n)

    lam, gap, rounds = Compiled(A).solve(q)

    assert rounds > 0
    check(A, q, lam, gap, rtol=1e-8)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 80), jump=st.sampled_from([0.02, 0.3, 3.0]))
def test_warm_start_over_a_sequence(seed, n, jump):
    """Small jumps flip single points, large ones nearly all of them at once."""
    rng = np.random.default_rng(seed)
    A, q = random_matrix(rng, n, 0.05), rng.standard_normal(n)
    solver = Compiled(A)

    for _ in range(25):
        q = q + jump * rng.standard_normal(n)
        lam, gap, rounds = solver.solve(q)
        assert rounds > 0
        check(A, q, lam, gap, rtol=1e-7)


@pytest.mark.slow
def test_hundreds_of_points_closing_and_opening():
    """A stamp that presses, tilts and lifts; several hundred single changes of the inverse."""
    n = 300
    A, x = contact_matrix(n), np.linspace(-1.0, 1.0, n)
    solver = Compiled(A)
    changes, before = 0, np.zeros(n, dtype=bool)

    for phase in np.linspace(0.0, 2 * np.pi, 200):
        q = 1e-6 * (x**2 + 0.5 * x * np.sin(3 * phase) - np.sin(phase))
        lam, gap, rounds = solver.solve(q)
        assert rounds > 0
        check(A, q, lam, gap, rtol=1e-6)
        changes += np.count_nonzero(solver.carrying.active != before)
        before = solver.carrying.active.copy()
        assert solver.inverse_error() < 1e-8

    assert changes > 600  # more than two refreshes of the inverse
    assert not before.any()


def test_the_solution_again_takes_one_round():
    rng = np.random.default_rng(4)
    A, q = random_matrix(rng, 50, 0.1), rng.standard_normal(50)
    solver = Compiled(A)
    lam, _, first = solver.solve(q)

    again, _, rounds = solver.solve(q)

    assert first > 1
    assert rounds == 1
    np.testing.assert_array_equal(again, lam)


@pytest.mark.parametrize("scale", [1.0, 1e-15])
def test_open_points_carry_nothing_whatever_the_unit(scale):
    lam, gap, rounds = Compiled(np.eye(5)).solve(np.full(5, 3.0 * scale))

    assert rounds == 1
    assert not lam.any()
    np.testing.assert_array_equal(gap, 3.0 * scale)


def test_points_that_just_touch():
    """Gaps of exactly zero, and points that repeat each other but for a little of their own."""
    A = np.ones((6, 6)) + 1e-4 * np.eye(6)
    q = np.array([-1.0, -1.0, 0.0, 0.0, 1.0, -1.0])

    lam, gap, rounds = Compiled(A).solve(q)

    assert rounds > 0
    check(A, q, lam, gap, rtol=1e-8)
    assert lam[:2] == pytest.approx(lam[5], rel=1e-8)


@pytest.mark.parametrize(
    ("n", "seed"), [(8, 1466), (8, 1936), (8, 2259), (8, 2355), (12, 454), (12, 3148), (12, 4313)]
)
def test_cycles_of_flipping_all_wrong_points_are_broken(n, seed):
    """Rare draws on which that never ends; single flips of the last wrong point do (Murty 1974)."""
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((n, n))
    A = B @ B.T + 1e-6 * np.eye(n)
    solver, most = Compiled(A), 0

    for _ in range(4):
        q = rng.standard_normal(n)
        lam, _, rounds = solver.solve(q)
        assert rounds > 0
        assert lam.min() >= 0.0
        assert (q + A @ lam).min() >= -1e-8
        most = max(most, rounds)

    assert most > 9


def test_an_indefinite_matrix_is_told():
    _, _, rounds = Compiled(np.array([[1.0, 2.0], [2.0, 1.0]])).solve(np.array([-1.0, -1.0]))

    assert rounds == -1


def test_a_step_that_ends_lower_is_taken_whole():
    """Exact: slopes of a parabola with its minimum at or beyond the end, and round-off."""
    assert lowest_share(lambda share: share - 1.0, 0.0) == 1.0
    assert lowest_share(lambda share: share - 2.0, 0.0) == 1.0
    assert lowest_share(lambda share: 1e-20 * (3.0 * share - 1.0), 1e-18) == 1.0
    assert lowest_share(lambda share: 1.0 + share, 0.0) == 1.0


@pytest.mark.parametrize("steep", [10.0, 1e4])
@pytest.mark.parametrize("kink", [0.01, 0.5, 0.97])
def test_a_step_that_goes_too_far_ends_at_the_minimum(steep, kink):
    """Exact: a slope with a kink, as of points that begin to yield; 1e-4 of the step."""

    def slope(share):
        return -1.0 + 0.2 * share + steep * max(share - kink, 0.0) / (1.0 - kink)

    lowest = kink + (1.0 - 0.2 * kink) / (0.2 + steep / (1.0 - kink))
    assert lowest_share(slope, 1e-12) == pytest.approx(lowest, abs=1.1e-4)


G, Y = 80e9, 280e6


def _sheared(*shears, isotropic=0.0, kinematic=0.0):
    """Shear stress [Pa] after each engineering shear, and the last state."""
    hardening = Hardening(yield_stress=Y, isotropic=isotropic, kinematic=kinematic)
    state, stresses = PlasticState.none(1), []
    for shear in shears:
        strain = np.array([[0.0, 0.0, 0.0, shear / 2]])
        state = radial_return(strain, state, hardening, G).state
        stresses.append(2 * G * (shear / 2 - state.strain[0, 3]))
    return np.array(stresses), state


def test_shear_yields_at_the_yield_stress_over_root_three_and_hardens_on_a_line():
    """Exact: tau = Y/sqrt(3) + (H/3)(gamma - tau/G), whatever the steps."""
    H = 2e9
    one, state = _sheared(0.01, isotropic=H)
    many, _ = _sheared(*np.linspace(0, 0.01, 40), isotropic=H)

    tau = (Y / np.sqrt(3) + H / 3 * 0.01) / (1 + H / (3 * G))
    assert one[-1] == pytest.approx(tau, rel=1e-12)
    assert many[-1] == pytest.approx(tau, rel=1e-12)
    assert state.equivalent[0] == pytest.approx((0.01 - tau / G) / np.sqrt(3), rel=1e-12)


@pytest.mark.slow
def test_reversed_shear_yields_earlier_with_kinematic_hardening():
    """Exact: the elastic range is 2 tau of first yield (kinematic) or twice the last stress."""
    H, back = 20e9, np.linspace(0.01, -0.002, 4000)
    for name, width in (("kinematic", 2 * Y / np.sqrt(3)), ("isotropic", None)):
        stress, _ = _sheared(*back, **{name: H})
        slope = np.diff(stress) / np.diff(back)
        last_elastic = stress[1:][slope > 0.99 * G][-1]
        expected = stress[0] - (2 * stress[0] if width is None else width)
        assert last_elastic == pytest.approx(expected, abs=2 * G * 3e-6)


@pytest.mark.parametrize("kind", [{"isotropic": 3e9}, {"kinematic": 3e9}, {}])
def test_tangent_is_the_derivative_of_the_plastic_stress(kind):
    """Exact: central differences, 1e-6; the stiffness taken off is between none and all."""
    rng = np.random.default_rng(3)
    hardening = Hardening(yield_stress=Y, **kind)
    strain = rng.normal(size=(50, 4)) * 3e-3
    before = radial_return(0.7 * strain, PlasticState.none(50), hardening, G).state
    result = radial_return(strain, before, hardening, G)
    assert len(result.yielding) > 40

    step = 1e-8
    for component in range(4):
        change = np.zeros(4)
        change[component] = step / (2.0 if component == 3 else 1.0)  # engineering shear
        ends = [
            radial_return(strain + sign * change, before, hardening, G).state.strain
            for sign in (1.0, -1.0)
        ]
        slope = 2 * G * (ends[0] - ends[1])[result.yielding] / (2 * step)
        assert slope == pytest.approx(result.taken[:, :, component], abs=1e-6 * G)
    elastic = 2 * G * np.diag([1.0, 1.0, 1.0, 0.5])
    elastic[:3, :3] -= 2 * G / 3
    assert np.linalg.eigvalsh(result.taken).min() > -1e-6 * G
    assert np.linalg.eigvalsh(elastic - result.taken).min() > -1e-6 * G


def test_plastic_work_is_never_negative():
    """Conservation: along random paths, and plastic strain keeps the volume."""
    rng = np.random.default_rng(5)
    hardening = Hardening(yield_stress=Y, isotropic=1e9, kinematic=1e9)
    state, strain = PlasticState.none(200), np.zeros((200, 4))
    for _ in range(60):
        strain = strain + rng.normal(size=strain.shape) * 5e-4
        result = radial_return(strain, state, hardening, G)
        assert result.work.min() >= 0.0
        assert np.all(result.state.equivalent >= state.equivalent)
        state = result.state
    assert np.abs(state.strain[:, :3].sum(axis=1)).max() < 1e-15


@pytest.mark.parametrize(
    ("given", "message"),
    [({"yield_stress": 0.0}, "yield stress"), ({"isotropic": -1.0}, "isotropic hardening")],
)
def test_what_no_metal_does_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        Hardening(**({"yield_stress": Y} | given))
