"""Compliance by grades of the reach: parts of a far reach are those of a short one, exactly."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.assembling.candidates import Candidates, grade_of, reach_of
from klack.assembling.problem import place_bodies
from klack.case.reader import find_case, load_case
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.statics import contact_compliance
from klack.elasticity.condensation import condensed_inverse
from klack.elasticity.loads import NearLoads
from klack.progress import silent


@pytest.fixture(scope="module")
def placed():
    with place_bodies(load_case(find_case("demo-valve-axisymmetric")), silent, threads=1) as found:
        yield found


def fresh(placed) -> Candidates:
    return Candidates(placed.pair, placed.flexibility_upper, placed.flexibility_lower)


def test_a_far_reach_holds_a_short_one_bit_for_bit(placed):
    grade = grade_of(3e-6)
    alone = fresh(placed).at(grade)
    both = fresh(placed)
    far = both.at(grade + 5)
    part = both.at(grade)

    assert 10 < alone.space.count < far.space.count
    assert np.array_equal(part.space.nodes, alone.space.nodes)
    assert np.array_equal(part.upper, alone.upper)
    assert np.array_equal(part.lower, alone.lower)


def test_grades_are_the_compliance_of_the_whole(placed):
    found = fresh(placed).at(grade_of(6e-6))
    whole = contact_compliance(found.space, placed.flexibility_upper, placed.flexibility_lower)

    # another order of sums
    np.testing.assert_allclose(found.compliance, whole, rtol=0, atol=1e-11 * np.abs(whole).max())
    assert np.array_equal(found.compliance, found.compliance.T)


def test_points_enter_at_their_reach(placed):
    """What is a candidate at a reach are all points that enter before it."""
    candidates = fresh(placed)
    far = candidates.at(grade_of(8e-6)).space
    for grade in range(grade_of(2e-6), grade_of(8e-6)):
        near = candidates.at(grade).space
        assert np.array_equal(near.nodes, far.nodes[far.entry <= reach_of(grade)])


class Dense:
    """A factorised full matrix."""

    dtype = np.dtype(float)

    def __init__(self, size: int, seed: int) -> None:
        A = np.random.default_rng(seed).normal(size=(size, size))
        self.A = A @ A.T + size * np.eye(size)
        self.L = np.linalg.cholesky(self.A)

    def solve(self, B):
        return np.linalg.solve(self.A, B)

    def forward(self, B):
        return np.linalg.solve(self.L, B)

    def backward(self, Y):
        return np.linalg.solve(self.L.T, Y)


def test_groups_are_condensed_apart_and_together():
    factor, rng = Dense(30, seed=3), np.random.default_rng(4)
    G = csr_array(rng.normal(size=(9, 30)))
    groups = [np.array([4, 1, 7]), np.array([0, 8]), np.array([2, 3, 5, 6])]
    expected = G @ np.linalg.solve(factor.A, G.T.toarray())

    for largest in (2**29, 8 * 30 * 4, 0):  # forward halves, some of them, whole solutions
        C = condensed_inverse(factor, G, groups=groups, largest=largest)
        np.testing.assert_allclose(C, expected, rtol=1e-11, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("largest", [2**29, 0], ids=["halves", "whole solutions"])
def test_later_groups_change_no_bit_of_the_first(largest):
    factor, rng = Dense(1200, seed=8), np.random.default_rng(9)
    factor.L[::2, 1::2] = factor.L[1::2, ::2] = 0.0  # loads on even rows never reach odd ones
    factor.A = factor.L @ factor.L.T
    loads = rng.normal(size=(143, 1200))
    loads[:102, 1::2] = 0.0
    G = csr_array(loads)
    groups = [np.arange(61), np.arange(61, 102), np.arange(102, 143)]

    whole = condensed_inverse(factor, G, groups=groups, largest=largest)
    fewer = condensed_inverse(factor, G[:102], groups=groups[:2], largest=largest)

    assert np.array_equal(whole[:102, :102], fewer)


def test_a_factor_follows_points_that_join_and_leave():
    """Whatever the order, forces close the gaps of the active points."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(12, 12))
    A = A @ A.T + np.eye(12)
    solver = ComplementaritySolver(A)
    q = rng.normal(size=12)
    for _ in range(40):
        active = rng.random(12) < rng.random()
        forces = solver._forces(q, active)
        order = solver._active

        assert np.array_equal(np.sort(order), np.flatnonzero(active))
        np.testing.assert_allclose(A[np.ix_(order, order)] @ forces, -q[order], atol=1e-9)


def test_near_loads_are_combined_and_others_solved():
    rng = np.random.default_rng(7)
    F = rng.normal(size=(20, 20))
    F = F @ F.T + np.eye(20)
    near, solved = NearLoads(), []

    def solve(f):
        solved.append(f)
        return F @ f

    basis = rng.normal(size=(3, 20))
    for f in basis:
        near.answer(f, float(f @ F @ f), solve)
    assert len(solved) == 3
    f = np.array([1.0, -2.0, 0.5]) @ basis
    u = near.answer(f, float(f @ F @ f), solve)
    np.testing.assert_allclose(u, F @ f, rtol=1e-9)
    assert len(solved) == 3

    # 1 % aside in the norm of the energy: it is solved
    aside = rng.normal(size=20)
    aside *= 0.01 * np.sqrt(f @ F @ f / (aside @ F @ aside))
    u = near.answer(f + aside, float((f + aside) @ F @ (f + aside)), solve)
    assert len(solved) == 4
    np.testing.assert_allclose(u, F @ (f + aside), rtol=1e-12)


def test_near_loads_stay_bounded():
    near = NearLoads()
    for f in np.eye(200):
        near.answer(f, 1.0, lambda load: load)
    assert len(near._answers) <= 48
