"""Complementarity problem; truth: enumeration of all active sets, and the conditions."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.contact import complementarity
from klack.contact.complementarity import ComplementaritySolver, solve_lcp
from klack.errors import ConvergenceError, InputError


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
