"""Fronts; the truth is the definition of dominance, worked by hand or pair by pair."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.errors import InputError
from klack.studies.fronts import compromise, find_front, spread_over


def front_by_pairs(points):
    """Rows that no other one dominates, the first of equal ones; every pair is compared."""
    kept = []
    for i, a in enumerate(points):
        beaten = any(np.all(b <= a) and np.any(b < a) for b in points)
        if not beaten and not any(np.all(b == a) for b in points[:i]):
            kept.append(i)
    return kept


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 60),
    columns=st.integers(1, 5),
    levels=st.sampled_from([2, 4, 1000]),
)
def test_front_is_that_of_all_pairs(seed, count, columns, levels):
    points = np.random.default_rng(seed).integers(0, levels, (count, columns)).astype(float)
    assert find_front(points).points.tolist() == front_by_pairs(points)


@pytest.mark.slow
@pytest.mark.parametrize("columns", [2, 3, 4, 6])
@pytest.mark.parametrize("levels", [3, 30, None])
def test_front_found_by_division_is_that_of_all_pairs(columns, levels):
    points = np.random.default_rng(columns).random((3000, columns))
    points[:1500] /= np.linalg.norm(points[:1500], axis=1)[:, None]  # many on the front
    if levels is not None:
        points = np.round(points * levels)  # many ties and equal points
    assert np.array_equal(find_front(points).points, front_by_blocks(points))


@pytest.mark.slow
@pytest.mark.parametrize("column", [1, 2])
def test_two_values_in_a_column_divide_once(column):
    points = np.random.default_rng(column).normal(size=(3000, 5))
    points = 2.0 - np.abs(points) / np.linalg.norm(points, axis=1)[:, None]
    points[:, column] = points[:, column] > 1.4  # most are 1
    assert np.array_equal(find_front(points).points, front_by_blocks(points))


def front_by_blocks(points):
    less = np.zeros(len(points), dtype=bool)
    for i, a in enumerate(points):
        same = np.all(points == a, axis=1)
        dominates = np.all(points <= a, axis=1) & ~same
        less[i] = dominates.any() or same[:i].any()
    return np.flatnonzero(~less)


@pytest.mark.slow
def test_points_on_a_sphere_are_all_on_the_front():
    points = np.abs(np.random.default_rng(1).normal(size=(20_000, 4)))
    points = 2.0 - points / np.linalg.norm(points, axis=1)[:, None]
    assert len(find_front(points).points) == 20_000


def test_a_feasible_point_beats_a_better_infeasible_one():
    front = find_front([[1.0, 1.0], [0.0, 0.0], [2.0, 0.5]], [[-1.0], [1e-9], [0.0]])
    assert front.points.tolist() == [0, 2]
    assert front.feasible


def test_without_a_feasible_point_the_smallest_sum_of_violations_wins():
    objectives = [[0.0], [5.0], [4.0], [1.0]]
    constraints = [[2.0, -9.0], [0.5, 0.5], [1.0, -1.0], [0.6, 0.6]]
    front = find_front(objectives, constraints)
    assert front.points.tolist() == [2]  # of two with a sum of 1, the one with the lower objective
    assert not front.feasible


def test_failed_points_are_never_on_the_front():
    objectives = [[np.nan, 0.0], [-np.inf, 0.0], [3.0, 3.0], [0.0, 0.0]]
    constraints = [[-1.0], [-1.0], [9.0], [np.nan]]
    front = find_front(objectives, constraints)
    assert front.points.tolist() == [2]
    assert not front.feasible
    nothing = find_front([[np.nan], [np.inf]])
    assert nothing.points.size == 0
    assert not nothing.feasible


def test_negative_zero_is_zero():
    assert find_front([[0.0, 1.0], [-0.0, 1.0]]).points.tolist() == [0]


def test_points_spread_over_a_front():
    """Both ends, evenly between, none twice; all of a short one, none of none."""
    front = np.array([9, 4, 7, 1, 3, 8, 2])
    assert spread_over(front, 3).tolist() == [9, 1, 2]
    assert spread_over(front, 1).tolist() == [9]
    assert spread_over(front, 7).tolist() == spread_over(front, 50).tolist() == front.tolist()
    assert spread_over(front[:0], 3).size == 0
    for most in range(1, 8):
        assert len(set(spread_over(front, most).tolist())) == most


def test_compromise_does_not_depend_on_units():
    front = np.array([[0.0, 1.0], [0.2, 0.3], [1.0, 0.0]])
    assert compromise(front) == 1  # 0.13 against 1 and 1
    assert compromise(front * [1e-6, 1e9] + [5e-6, -3e9]) == 1
    assert compromise([[0.0, 2.0, 7.0], [1.0, 1.0, 7.0], [2.0, 0.0, 7.0]]) == 1
    assert compromise([[4.0, 4.0]]) == 0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: find_front([1.0, 2.0]), "one row per point"),
        (lambda: find_front([[1.0], [2.0, 3.0]]), "rows of numbers"),
        (lambda: find_front([["a"]]), "rows of numbers"),
        (lambda: find_front(np.empty((3, 0))), "one column or more"),
        (lambda: find_front([[1.0]], [[1.0], [2.0]]), "1 rows, as many"),
        (lambda: compromise(np.empty((0, 2))), "one point or more"),
        (lambda: compromise([[1.0, np.nan]]), "row 0, column 1"),
    ],
)
def test_one_error_says_what_does_not_fit(call, words):
    with pytest.raises(InputError, match=words):
        call()
