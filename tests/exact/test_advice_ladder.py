"""Expected errors of the adviser on exact power laws, and its share-out of a target (exact)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.analyses.advice.advice import Advice, Measured, settle
from klack.analyses.advice.affordable import added
from klack.analyses.advice.ladder import REACH, Ladder, Measure, allotment, coarsest_within, score
from klack.analyses.advice.settings import Setting, SettingValue, rounded_down, rounded_up

MEASURES = (Measure(name="history", limit=0.01), Measure(name="bands", limit=1.0, decibel=True))


def power_law(order, *, error=0.004, level=0.3, factors=(2.0, 1.0, 0.5), assumed=1.0):
    """Runs whose error at factor f is exactly (error, level) f^order, all of one sign."""
    exact = np.array([[error, level]]) * np.array(factors)[:, None] ** order
    return Ladder(
        factors=factors,
        differences=exact[:-1] - exact[-1],
        steps=-np.diff(exact[:, 0]),
        assumed_order=assumed,
    )


@pytest.mark.parametrize("order", [0.7, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("factors", [(2.0, 1.0, 0.5), (1.0, 0.5, 0.25), (4.0, 2.0, 1.0, 0.5)])
def test_order_and_errors_of_a_power_law_are_found(order, factors):
    ladder = power_law(order, factors=factors)

    assert ladder.raw_order == pytest.approx(order, rel=1e-9)
    for f in (8.0, 2.0, 1.3, 1.0, 0.5, 0.01):  # between the runs and beyond them
        assert ladder.error(f) == pytest.approx(np.array([0.004, 0.3]) * f**order, rel=1e-6)


def test_two_runs_take_the_order_that_is_assumed():
    ladder = power_law(2.0, factors=(1.5, 1.0), assumed=2.0)

    assert np.isnan(ladder.raw_order)
    assert not ladder.scattered
    assert ladder.error(1.0) == pytest.approx([0.004, 0.3], rel=1e-9)


def test_runs_that_do_not_converge_are_scatter():
    """Three runs that differ by the same: finer is not better, nothing finer is advised."""
    ladder = Ladder(
        factors=(1.0, 0.5, 0.25),
        differences=np.array([[2e-3, 0.1], [3e-3, 0.2]]),
        steps=np.array([2.5e-3, 3e-3]),
        assumed_order=1.0,
    )

    assert ladder.scattered
    assert ladder.error(1.0) == pytest.approx([3e-3, 0.2])  # the worst of the runs
    assert ladder.error(1e-3) == pytest.approx([3e-3, 0.2])
    assert coarsest_within(ladder, 0.01, MEASURES, coarsest=2.0) == 1.0


def test_the_coarsest_within_a_share_uses_it_whole():
    ladder = power_law(2.0)  # score 0.4 f^2

    factor = coarsest_within(ladder, 0.1, MEASURES, coarsest=4.0)

    assert factor == pytest.approx(0.5, rel=1e-6)
    assert coarsest_within(ladder, 1e3, MEASURES, coarsest=4.0) == 4.0
    assert coarsest_within(ladder, 1e-9, MEASURES, coarsest=4.0) == 0.5 / REACH


def test_what_a_setting_cannot_use_goes_to_the_others():
    assert allotment([0.1, 5.0, 5.0], 1.0) == pytest.approx(0.45)
    assert allotment([5.0, 5.0], 1.0) == pytest.approx(0.5)
    assert allotment([0.1, 0.2], 1.0) == np.inf  # all at their coarsest leave some over


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(st.floats(0.5, 4.0), st.floats(1e-6, 0.1)), min_size=1, max_size=6),
    st.floats(1e-4, 0.1),
    st.floats(1.01, 10.0),
)
def test_shares_add_up_and_a_tighter_target_is_never_coarser(laws, limit, tighter):
    measured = [
        Measured(setting=size(f"region {i}"), ladder=power_law(p, error=e, level=1e-6), runs="")
        for i, (p, e) in enumerate(laws)
    ]
    loose = settle(measured, (), (Measure(name="h", limit=limit), Measure(name="b")))
    strict = settle(measured, (), (Measure(name="h", limit=limit / tighter), Measure(name="b")))

    if all(item.reached for item in loose):
        assert sum(float(item.then[0]) for item in loose) <= limit * (1 + 1e-6)
    for a, b in zip(loose, strict, strict=True):
        assert b.factor <= a.factor * (1 + 1e-9)


def size(name, value=1e-3):
    key = ("bodies", name, "mesh", "size")
    return Setting(name=name, group="mesh", values=(SettingValue(key=key, value=value, unit="m"),))


def test_a_good_setting_is_kept_and_a_wasteful_one_is_not():
    good, wasteful = power_law(2.0, error=0.006), power_law(2.0, error=1e-5, level=0.0)
    measured = [
        Measured(setting=size("a"), ladder=good, runs=""),
        Measured(setting=size("b"), ladder=wasteful, runs=""),
    ]

    a, b = settle(measured, (), MEASURES)

    assert (a.factor, a.changes) == (1.0, {})  # 1.3 times coarser would do: not worth a change
    assert b.values == {("bodies", "b", "mesh", "size"): 2e-3}  # no more than twice as coarse
    assert score(a.then + b.then, MEASURES) <= 1.0


@given(st.floats(1e-9, 1e3))
def test_rounding_is_down_and_by_no_more_than_a_third(value):
    rounded = rounded_down(value)

    assert rounded <= value * (1 + 1e-8)
    assert rounded >= value / 1.34  # from 3 to 4, from 6 to 8, from 1.5 to 2


@given(st.floats(0.1, 5000.0))
def test_counts_are_rounded_up(count):
    assert count <= rounded_up(count) * (1 + 1e-8) <= count + 11


def test_a_frequency_follows_the_number_of_modes_below_it():
    table = (10e3, 20e3, 40e3, 80e3, 160e3, 320e3)
    value = SettingValue(
        key=("reduction", "modes", "a", "frequency"),
        value=50e3,  # three modes
        unit="Hz",
        kind="frequency",
        table=table,
    )

    assert value.advised(0.5) == pytest.approx(320e3)  # six
    assert value.advised(0.8) == pytest.approx(80e3)  # four
    assert value.factor_of(80e3) == pytest.approx(3 / 4)
    assert value.factor_of(value.advised(2.9)) == pytest.approx(3 / 2)


def test_degrees_of_freedom_of_a_region_of_fixed_extent():
    """Exact: 700 elsewhere and 300 f^-3 in the region, whichever run it was learnt from."""
    for known in (1.5, 0.5, 2 / 3):
        run = (known, round(700 + 300 * known**-3))
        for factor in (2.0, 1.0, 0.25):
            expected = 300 * (factor**-3 - 1)
            assert added(1000, run, factor, 3) == pytest.approx(expected, abs=200 * 0.5)
    assert added(1000, (0.5, 990), 0.25, 3) == 0.0  # a finer mesh with fewer nodes: scatter


def test_a_grading_reaches_only_what_a_case_accepts():
    key = ("bodies", "a", "mesh", "grading")
    value = SettingValue(key=key, value=0.7, most=1.0)
    setting = Setting(name="growth in a", group="mesh", values=(value,))

    assert not setting.reaches(1.5)
    assert setting.reaches(1.4)
    assert setting.reaches(0.25)


def test_a_reference_is_as_fine_as_runs_and_advice():
    """Sizes the smaller, counts the larger of what was run and what is advised."""
    count = SettingValue(key=("reduction", "modes", "a", "count"), value=10.0, kind="count")
    modes = Setting(name="modes of a", group="modes", values=(count,))
    measured = [
        Measured(setting=size("a"), ladder=power_law(1.0, error=0.1), runs=""),
        Measured(setting=size("b"), ladder=power_law(2.0, error=1e-6, level=0.0), runs=""),
        Measured(setting=modes, ladder=power_law(1.0, error=0.03, level=0.0), runs=""),
    ]
    counsels = settle(measured, (), MEASURES)
    advice = Advice(
        case="",
        title="",
        level="reduced",
        measures=MEASURES,
        up_to=1e5,
        band_from_case=True,
        counsels=counsels,
    )
    a, b, c = (item.values for item in counsels)

    assert a[("bodies", "a", "mesh", "size")] < 0.5e-3 < b[("bodies", "b", "mesh", "size")]
    assert advice.finest == {**a, ("bodies", "b", "mesh", "size"): 0.5e-3, **c}
    assert c[count.key] > 20
