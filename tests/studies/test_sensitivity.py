"""Sobol indices; truth: exact ones of Ishigami and G-function, SciPy's own, definitions.

T. Ishigami and T. Homma (1990); A. Saltelli and I. M. Sobol (1995) for the G-function.
"""

import numpy as np
import pytest
from scipy import stats

from klack.errors import InputError
from klack.studies.designs import sobol_sequence
from klack.studies.sensitivity import SobolIndices, saltelli_design, sobol_indices

PI4 = np.pi**4


def ishigami(u):
    x = np.pi * (2 * u - 1)
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def exact_ishigami(a=7.0, b=0.1):
    alone, other = 0.5 * (1 + b * PI4 / 5) ** 2, a**2 / 8
    together = 8 * b**2 * PI4**2 / 225
    first, total = np.array([alone, other, 0]), np.array([alone + together, other, together])
    return first / (alone + other + together), total / (alone + other + together)


COEFFICIENTS = np.array([0, 1, 4.5, 9, 99, 99, 99, 99])


def g_function(u):
    return np.prod((np.abs(4 * u - 2) + COEFFICIENTS) / (1 + COEFFICIENTS), axis=1)


def exact_g_function():
    own = 1 / (3 * (1 + COEFFICIENTS) ** 2)
    variance = np.prod(1 + own) - 1
    return own / variance, own * np.prod(1 + own) / (1 + own) / variance


CASES = {
    "ishigami": (ishigami, 3, exact_ishigami()),
    "g-function": (g_function, 8, exact_g_function()),
}


def held(indices: SobolIndices, exact) -> np.ndarray:
    """Whether each interval holds the exact index."""
    both = zip((indices.first, indices.total), exact, strict=True)
    return np.array([(e.low <= true) & (true <= e.high) for e, true in both])


@pytest.mark.parametrize("case", CASES)
def test_intervals_hold_the_exact_indices(case):
    """As often as claimed, over seeds; errors fall faster than those of random points."""
    function, parameters, exact = CASES[case]
    found = [
        sobol_indices(function(saltelli_design(parameters, 1024, seed)), parameters)
        for seed in range(20)
    ]
    errors = [(f.first.value - exact[0], f.total.value - exact[1]) for f in found]

    assert np.mean([held(f, exact) for f in found]) >= 0.95
    assert np.max(np.abs(errors)) < 0.04
    assert all(f.rows == 1024 and f.discarded == 0 and f.reason == "" for f in found)


@pytest.mark.slow
def test_few_rows_are_doubted_where_intervals_hold_less_than_they_claim():
    """The worst index of the G-function at 64 rows."""
    function, parameters, exact = CASES["g-function"]
    found = [
        sobol_indices(function(saltelli_design(parameters, 64, seed)), parameters)
        for seed in range(60)
    ]
    share = np.mean([held(f, exact) for f in found], axis=0)

    assert share.mean() > 0.92
    assert share.min() < 0.8


@pytest.mark.parametrize("case", CASES)
def test_many_rows_give_the_exact_indices(case):
    function, parameters, exact = CASES[case]
    found = sobol_indices(function(saltelli_design(parameters, 2**14, 3)), parameters)

    assert np.all(held(found, exact))
    assert np.abs(found.first.value - exact[0]).max() < 3e-3
    assert np.abs(found.total.value - exact[1]).max() < 3e-3


@pytest.mark.slow
def test_intervals_of_independent_rows_are_missed_as_often_as_claimed():
    """Truth: a sum of coordinates with weights 1, 2, 3 has the indices 1/14, 4/14, 9/14."""
    weights = np.array([1.0, 2.0, 3.0])
    exact = weights**2 / np.sum(weights**2)
    random = np.random.default_rng(8)
    hits = []
    for _ in range(200):
        a, b = random.random((2, 300, 1, 3))
        points = np.concatenate((a, np.where(np.eye(3, dtype=bool), b, a), b), axis=1)
        found = sobol_indices((points @ weights).ravel(), 3)
        hits.append(held(found, (exact, exact)))

    # 1200 intervals, correlated: the standard deviation of the share is about 0.01
    assert np.mean(hits) == pytest.approx(0.95, abs=0.035)


@pytest.mark.parametrize("case", CASES)
def test_estimators_are_those_of_scipy(case):
    function, parameters, _ = CASES[case]
    values = function(saltelli_design(parameters, 512, seed=2))
    rows = values.reshape(512, -1)
    theirs = stats.sobol_indices(
        func={
            "f_A": rows[:, 0][None].copy(),
            "f_B": rows[:, -1][None].copy(),
            "f_AB": rows[:, 1:-1].T[:, None].copy(),
        },
        n=512,
    )
    found = sobol_indices(values, parameters)

    assert found.first.value == pytest.approx(theirs.first_order, rel=1e-9, abs=1e-12)
    assert found.total.value == pytest.approx(theirs.total_order, rel=1e-9, abs=1e-12)


def test_design_takes_one_coordinate_from_the_other_point():
    rows = saltelli_design(4, 32, seed=7).reshape(32, 6, 4)
    both = sobol_sequence(32, 8, seed=7)

    assert np.array_equal(rows[:, 0], both[:, :4])
    assert np.array_equal(rows[:, -1], both[:, 4:])
    for parameter in range(4):
        changed = rows[:, 1 + parameter] != rows[:, 0]
        assert np.array_equal(np.flatnonzero(changed.any(axis=0)), [parameter])
        assert np.array_equal(rows[:, 1 + parameter, parameter], rows[:, -1, parameter])


def test_design_is_extended_exactly():
    assert np.array_equal(saltelli_design(3, 128, 5)[: 64 * 5], saltelli_design(3, 64, 5))


def test_one_parameter():
    found = sobol_indices(saltelli_design(1, 4096, seed=1)[:, 0] ** 2, 1)

    assert found.first.value == pytest.approx([1.0], abs=2e-3)
    assert found.total.value == pytest.approx([1.0], abs=2e-3)


@pytest.mark.parametrize("failure", [np.nan, np.inf, -np.inf])
def test_a_failed_point_discards_its_row_and_no_other(failure):
    points = saltelli_design(3, 256, seed=1)
    rows = ishigami(points).reshape(256, 5)
    failed = {3: 0, 40: 2, 41: 4, 200: 3}
    some = rows.copy()
    for row, column in failed.items():
        some[row, column] = failure
    found = sobol_indices(some.ravel(), 3)
    expected = sobol_indices(np.delete(rows, list(failed), axis=0).ravel(), 3)

    assert (found.rows, found.discarded) == (252, 4)
    for mine, theirs in ((found.first, expected.first), (found.total, expected.total)):
        assert np.array_equal(mine.value, theirs.value)
        assert np.array_equal(mine.low, theirs.low)
        assert np.array_equal(mine.high, theirs.high)


@pytest.mark.slow
def test_intervals_hold_the_exact_indices_where_points_fail_by_chance():
    hits = []
    for seed in range(20):
        values = ishigami(saltelli_design(3, 1024, seed))
        values[np.random.default_rng(seed).random(values.size) < 0.05] = np.nan
        found = sobol_indices(values, 3)
        hits.append(held(found, exact_ishigami()))
        assert found.rows + found.discarded == 1024
        assert found.rows == pytest.approx(1024 * 0.95**5, rel=0.05)

    assert np.mean(hits) >= 0.93


def test_given_values_are_not_changed():
    values = ishigami(saltelli_design(3, 64, seed=1))
    before = values.copy()
    sobol_indices(values, 3)

    assert np.array_equal(values, before)


@pytest.mark.parametrize(
    ("scale", "offset"),
    [(1e-200, 0.0), (4e307, 0.0), (-3.0, 7.0), (1.0, 1e6), (1e-6, 1.0)],
)
def test_indices_do_not_depend_on_unit_and_origin(scale, offset):
    values = g_function(saltelli_design(8, 256, seed=1))
    plain, other = sobol_indices(values, 8), sobol_indices(scale * values + offset, 8)

    assert other.first.value == pytest.approx(plain.first.value, rel=1e-7, abs=1e-8)
    assert other.total.high == pytest.approx(plain.total.high, rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("value", [0.0, 3.5, -1e-9, 1e300])
@pytest.mark.parametrize("noise", [0.0, 1e-15])
def test_a_constant_measure_has_no_indices_and_says_so(value, noise):
    found = sobol_indices(value * (1 + noise * np.random.default_rng(1).standard_normal(64 * 5)), 3)

    assert "same value" in found.reason
    for estimates in (found.first, found.total):
        assert np.all(np.isnan([estimates.value, estimates.low, estimates.high]))


def test_too_few_rows_say_so():
    values = ishigami(saltelli_design(3, 16, seed=1))
    assert sobol_indices(values, 3).reason == ""
    values[0] = np.nan
    found = sobol_indices(values, 3)

    assert "only 15 of 16 base rows" in found.reason
    assert np.all(np.isnan(found.first.value))
    assert "only 0 of 16" in sobol_indices(np.full(80, np.nan), 3).reason


def test_a_measure_that_differs_at_one_point_has_no_intervals():
    values = np.zeros((64, 5))
    values[7, 0] = 1.0
    found = sobol_indices(values.ravel(), 3)

    assert "few points" in found.reason
    assert np.all(np.isfinite(found.total.value))
    assert np.all(np.isnan([found.total.low, found.first.high]))


def test_a_design_that_memory_does_not_hold_is_refused():
    with pytest.raises(InputError, match="points of 300 parameters"):
        saltelli_design(300, 10**5, 1)
