"""Probabilities, quantiles, margins of samples; the truth is binomial sums and simulation."""

from math import comb, fsum

import numpy as np
import pytest
from draws import each

from klack.errors import InputError
from klack.studies.samples import (
    count_exceedance,
    exceedance_of,
    mean_and_margin,
    runs_for_quantile,
    sample_quantile,
)


def binomial(counts, runs, probability):
    """Sum of binomial probabilities, term by term, rounded once."""
    p = probability
    return fsum(comb(runs, i) * p**i * (1.0 - p) ** (runs - i) for i in counts)


@pytest.mark.parametrize(("exceeded", "runs"), [(1, 10), (3, 50), (9, 10), (17, 60)])
def test_ends_leave_exact_binomial_tails(exceeded, runs):
    found = count_exceedance(exceeded, runs, confidence=0.9)
    assert binomial(range(exceeded, runs + 1), runs, found.low) == pytest.approx(0.05, rel=1e-9)
    assert binomial(range(exceeded + 1), runs, found.high) == pytest.approx(0.05, rel=1e-9)
    assert binomial(range(exceeded + 1), runs, found.at_most) == pytest.approx(0.1, rel=1e-9)
    assert found.estimate == exceeded / runs


def test_an_interval_of_a_table():
    """Clopper and Pearson: 2 of 10 at 95 %, as in tables, 2.52 % to 55.61 %."""
    found = count_exceedance(2, 10)
    assert (found.low, found.high) == pytest.approx((0.02521, 0.55610), abs=5e-06)


def test_no_exceedance_gives_the_rule_of_three():
    for runs in (1, 30, 1000):
        found = count_exceedance(0, runs)
        assert found.estimate == found.low == 0.0
        assert found.at_most == pytest.approx(1.0 - 0.05 ** (1.0 / runs), rel=1e-12)
        assert found.high == pytest.approx(1.0 - 0.025 ** (1.0 / runs), rel=1e-12)
    assert found.at_most == pytest.approx(3.0 / 1000, rel=0.005)
    assert count_exceedance(0, 10**9).at_most == pytest.approx(2.9957323e-9, rel=1e-6)


def test_all_exceeded_mirrors_none():
    none, all_ = count_exceedance(0, 20), count_exceedance(20, 20)
    assert (all_.low, all_.high, all_.at_most) == (pytest.approx(1.0 - none.high), 1.0, 1.0)


def test_failed_runs_widen_the_doubt_only():
    clean, doubtful = count_exceedance(2, 90), count_exceedance(2, 90, failed=10)
    assert (clean.low, clean.high, clean.estimate) == (
        doubtful.low,
        doubtful.high,
        doubtful.estimate,
    )
    assert doubtful.low_if_none == count_exceedance(2, 100).low
    assert doubtful.high_if_all == count_exceedance(12, 100).high
    assert (clean.low_if_none, clean.high_if_all) == (clean.low, clean.high)


def test_values_are_compared_with_the_limit():
    found = exceedance_of([1.0, 2.0, 3.0, np.nan, np.inf, 2.0], 2.0)
    assert (found.exceeded, found.runs, found.failed) == (1, 4, 2)
    assert exceedance_of([1.0], -np.inf).exceeded == 1


@pytest.mark.parametrize("probability", [0.003, 0.03, 0.4])
@pytest.mark.parametrize("runs", [20, 200])
def test_intervals_hold_the_true_probability_as_often_as_stated(probability, runs):
    counts = np.arange(runs + 1)
    found = [count_exceedance(int(k), runs) for k in counts]
    low, high, bound = (
        np.array([getattr(f, name) for f in found]) for name in ("low", "high", "at_most")
    )
    drawn = np.random.default_rng(4).binomial(runs, probability, 20_000)
    held = (low[drawn] <= probability) & (probability <= high[drawn])
    assert held.mean() > 0.95 - 0.003  # two standard errors of the simulation
    assert (probability <= bound[drawn]).mean() > 0.95 - 0.003
    exact = [k for k in counts.tolist() if low[k] <= probability <= high[k]]
    assert binomial(exact, runs, probability) >= 0.95


@each("probability", [0.06, 0.5, 0.91, 0.99])
@each("runs", [1, 5, 59, 60, 150])
def test_ranks_of_a_quantile_are_the_narrowest_that_binomials_allow(probability, runs):
    found = sample_quantile(np.arange(1.0, runs + 1.0), probability, confidence=0.9)
    lower = max(
        rank for rank in range(runs + 1) if binomial(range(rank), runs, probability) <= 0.05
    )
    upper = min(
        rank
        for rank in range(1, runs + 2)
        if binomial(range(rank, runs + 1), runs, probability) <= 0.05
    )
    assert found.low == (lower if lower else -np.inf)
    assert found.high == (upper if upper <= runs else np.inf)
    exact = binomial(range(lower, upper), runs, probability)
    assert found.coverage == pytest.approx(exact, abs=1e-12)
    assert found.coverage >= 0.9


@pytest.mark.slow
def test_quantiles_are_covered_as_often_as_stated():
    rng = np.random.default_rng(8)
    for probability, truth in ((0.5, np.log(2.0)), (0.9, np.log(10.0))):
        found = [sample_quantile(rng.exponential(size=80), probability) for _ in range(2000)]
        held = np.mean([f.low <= truth <= f.high for f in found])
        assert held == pytest.approx(found[0].coverage, abs=0.012)
        below = np.mean([f.estimate < truth for f in found])
        assert below == pytest.approx(0.5, abs=0.04)  # median-unbiased


def test_failed_runs_move_the_ends_of_a_quantile():
    values = np.random.default_rng(1).permutation(np.arange(1.0, 101.0))
    clean = sample_quantile(values, 0.5)
    assert (clean.low_if_low, clean.high_if_high) == (clean.low, clean.high)
    doubtful = sample_quantile([*values, *[np.nan] * 20], 0.5)
    assert (doubtful.low, doubtful.high, doubtful.failed) == (clean.low, clean.high, 20)
    worst = sample_quantile([*values, *range(1000, 1020)], 0.5)
    best = sample_quantile([*values, *range(-1000, -980)], 0.5)
    assert (doubtful.low_if_low, doubtful.high_if_high) == (best.low, worst.high)
    assert sample_quantile([1.0, np.nan, np.nan], 0.5).low_if_low == -np.inf


@pytest.mark.parametrize("probability", [0.001, 0.05, 0.5, 0.99])
@pytest.mark.parametrize("confidence", [0.5, 0.9, 0.999])
def test_fewest_runs_are_just_enough(probability, confidence):
    runs = runs_for_quantile(probability, confidence=confidence)
    enough = sample_quantile(np.arange(runs), probability, confidence=confidence)
    assert np.isfinite([enough.low, enough.high]).all()
    fewer = sample_quantile(np.arange(runs - 1), probability, confidence=confidence)
    assert not np.isfinite([fewer.low, fewer.high]).all()


def test_margin_by_hand():
    found = mean_and_margin([1.0, 2.0, 3.0, np.nan], 2.0)
    assert (found.mean, found.deviation, found.value) == (2.0, 1.0, 4.0)
    assert found.mean_error == pytest.approx(np.sqrt(1 / 3))
    assert found.deviation_error == pytest.approx(np.sqrt(2 / 3 / 12))  # m4 = 2/3, (n - 3) = 0
    assert (found.runs, found.failed) == (3, 1)
    same = mean_and_margin([5.0, 5.0], 3.0)
    assert (same.value, same.value_error) == (5.0, 0.0)


@pytest.mark.parametrize("draw", ["standard_normal", "standard_exponential", "random"])
def test_errors_of_a_margin_are_those_of_repeated_samples(draw):
    rng = np.random.default_rng(3)
    found = [mean_and_margin(getattr(rng, draw)(400), 3.0) for _ in range(1500)]
    for number in ("mean", "deviation", "value"):
        scatter = np.std([getattr(f, number) for f in found], ddof=1)
        stated = np.sqrt(np.mean([getattr(f, f"{number}_error") ** 2 for f in found]))
        assert stated == pytest.approx(scatter, rel=0.07)


def test_errors_of_normal_samples_are_the_closed_form():
    sample = np.random.default_rng(0).standard_normal(400_000)
    found = mean_and_margin(sample * 1e-90 - 3e-90, 2.0)
    assert found.mean == pytest.approx(-3e-90, rel=2e-3)
    expected = found.deviation * np.sqrt((1.0 + 2.0**2 / 2.0) / 400_000)
    assert found.value_error == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: count_exceedance(3, 2), "from 0 to 2"),
        (lambda: count_exceedance(0, 0), "runs with a value: got 0"),
        (lambda: count_exceedance(0, 5, failed=-1), "failed runs"),
        (lambda: count_exceedance(0.5, 5), "whole number"),
        (lambda: count_exceedance(0, 5, confidence=95), "percent are divided"),
        (lambda: exceedance_of([np.nan], 1.0), "runs with a value: got 0"),
        (lambda: exceedance_of([[1.0]], 1.0), "one number per run"),
        (lambda: exceedance_of(["a"], 1.0), "one number per run"),
        (lambda: exceedance_of([1.0], np.nan), "limit of a measure"),
        (lambda: sample_quantile([1.0], 1.0), "above 0, below 1"),
        (lambda: sample_quantile([1.0], np.nan), "above 0, below 1"),
        (lambda: sample_quantile([np.nan, np.nan], 0.5), "2 runs without a value"),
        (lambda: sample_quantile([1.0], 0.5, confidence=1.0), "0.5 to below 1"),
        (lambda: runs_for_quantile(0.0), "above 0, below 1"),
        (lambda: mean_and_margin([1.0, np.nan], 3.0), "two runs"),
        (lambda: mean_and_margin([1.0, 2.0], np.inf), "finite"),
    ],
)
def test_one_error_says_what_does_not_fit(call, words):
    with pytest.raises(InputError, match=words):
        call()
