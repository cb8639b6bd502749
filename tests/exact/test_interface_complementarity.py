"""Compiled complementarity solver of the time step; truth: the plain solver and the conditions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.contact.complementarity import solve_lcp
from klack.transient.active_set import solve_active
from klack.transient.interface_arrays import ActiveSet


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
