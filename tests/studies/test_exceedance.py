"""Samples: probabilities and quantiles, fronts, and the lines that a study tells.

Probabilities, quantiles, margins of samples; the truth is binomial sums and simulation.

Fronts; the truth is the definition of dominance, worked by hand or pair by pair.

Lines that a study tells: doubts by their kind, and how long it will take.
"""

from math import comb, fsum

import numpy as np
import pytest
from draws import each
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.analyses.study import live
from klack.analyses.study.asked_points import PointRow
from klack.analyses.study.evaluation import row_warnings
from klack.analyses.study.live import Pace
from klack.errors import InputError
from klack.machine.progress import duration_text
from klack.studies.fronts import compromise, find_front, spread_over
from klack.studies.samples import (
    count_exceedance,
    exceedance_of,
    mean_and_margin,
    sample_quantile,
)


def binomial(counts, runs, probability):
    """Sum of binomial probabilities, term by term, rounded once."""
    p = probability
    return fsum(comb(runs, i) * p**i * (1.0 - p) ** (runs - i) for i in counts)


@pytest.mark.parametrize(("exceeded", "runs"), [(1, 10), (3, 50), (9, 10), (17, 60)])
def test_ends_leave_exact_binomial_tails(exceeded, runs):
    found = count_exceedance(exceeded, runs)
    assert binomial(range(exceeded, runs + 1), runs, found.low) == pytest.approx(0.025, rel=1e-9)
    assert binomial(range(exceeded + 1), runs, found.high) == pytest.approx(0.025, rel=1e-9)
    assert binomial(range(exceeded + 1), runs, found.at_most) == pytest.approx(0.05, rel=1e-9)
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
    found = sample_quantile(np.arange(1.0, runs + 1.0), probability)
    lower = max(
        rank for rank in range(runs + 1) if binomial(range(rank), runs, probability) <= 0.025
    )
    upper = min(
        rank
        for rank in range(1, runs + 2)
        if binomial(range(rank, runs + 1), runs, probability) <= 0.025
    )
    assert found.low == (lower if lower else -np.inf)
    assert found.high == (upper if upper <= runs else np.inf)


@pytest.mark.slow
def test_quantiles_are_covered_as_often_as_stated():
    rng = np.random.default_rng(8)
    for probability, truth in ((0.5, np.log(2.0)), (0.9, np.log(10.0))):
        found = [sample_quantile(rng.exponential(size=80), probability) for _ in range(2000)]
        held = np.mean([f.low <= truth <= f.high for f in found])
        assert 0.95 - 0.012 < held < 0.985
        below = np.mean([f.estimate < truth for f in found])
        assert below == pytest.approx(0.5, abs=0.04)  # median-unbiased


def test_margin_by_hand():
    assert mean_and_margin([1.0, 2.0, 3.0], 2.0) == 4.0
    assert mean_and_margin([5.0, 5.0], 3.0) == 5.0
    tiny = np.array([-4.0, -3.0, -2.0]) * 1e-200  # whose squares are zero
    assert mean_and_margin(tiny, 2.0) == pytest.approx(-1e-200, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: exceedance_of([np.nan], 1.0), "runs with a value: got 0"),
        (lambda: exceedance_of([1.0], np.nan), "limit of a measure"),
    ],
)
def test_one_error_says_what_does_not_fit(call, words):
    with pytest.raises(InputError, match=words):
        call()


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


def row(*notes):
    return PointRow((1.0,), notes=notes)


def test_notes_that_differ_in_numbers_only_are_told_once():
    rows = [row("only 18 % left", "slow"), row("only 19.5 % left"), row("only 18 % left"), row()]
    assert row_warnings(rows, row(), ()) == (
        "3 of 4 points, with other numbers: only 18 % left",
        "1 of 4 points: slow",
    )


def test_a_note_counts_once_for_a_point():
    assert row_warnings([row("a 1", "a 2")], row(), ()) == ("1 of 1 points: a 2",)


class _Heard:
    def __init__(self):
        self.lines = []

    def __call__(self, stage, fraction):
        pass

    def remark(self, line):
        self.lines.append(line)


def test_pace_counts_what_is_computed_and_what_is_left(monkeypatch):
    """Truth: 100 points computed in 10 s are 36 000 in an hour; 300 more take 30 s."""
    now = 0.0
    monkeypatch.setattr(live, "perf_counter", lambda: now)
    heard = _Heard()
    told = Pace(heard, 500)
    now = 4.0
    told.tell(190, 90)
    now = 10.0
    told.tell(200, 100, "best so far point 7")
    now = 11.0
    told.tell(250, 150)
    now = 60.0
    told.tell(500, 400)
    assert heard.lines == ["200 of 500 points, 36 000 in an hour, 30 s left; best so far point 7"]


@pytest.mark.parametrize(
    ("seconds", "text"), [(12.3, "12 s"), (150.0, "2 min"), (6000.0, "1 h 40 min")]
)
def test_durations(seconds, text):
    assert duration_text(seconds) == text


def test_lines_of_nothing_computed_have_no_rate(monkeypatch):
    now = 0.0
    monkeypatch.setattr(live, "perf_counter", lambda: now)
    heard = _Heard()
    told = Pace(heard, 10)
    now = 9.0
    told.tell(4, 0)
    assert heard.lines == ["4 of 10 points"]
