"""Rows of a record about an impact; truths: impulses that are given, and the times of touch."""

import numpy as np
import pytest

from klack.transient.impact_recorder import (
    FILM_ROWS,
    LOAD_ROWS,
    MODE_ROWS,
    NUMBER,
    PHASE,
    PRESSED,
    RESTING,
    SQUEEZED,
    ImpactRows,
    follow,
)

pytestmark = pytest.mark.slow

H = 20e-9  # [s]
PAUSE, REST = 1e-6, 1e-3  # [s]


def steps_of(force, film=None, start=0.0):
    """Arguments of a record whose sectors carry shares 1/4 and 3/4 of these forces."""
    n = len(force)
    loads = np.outer(force, [0.25, 0.75])
    levers = np.outer(force, [2e-3, 4e-6, 1e-2])
    film = np.zeros(0) if film is None else np.asarray(film, dtype=float)
    lands = np.tile(np.arange(6.0), (n, 1))
    places = np.column_stack([start / H + np.arange(1.0, n + 1), np.ones(n)])
    return loads, levers, film, lands, places


def feed(rows, force, start=0.0, film=None, rest=REST):
    loads, levers, film, lands, places = steps_of(force, film, start)
    args = (start, H, loads, levers, film, lands, 1e-3, places, PAUSE, rest)
    return follow(rows, 0, 0, *args)


def ready(films=0):
    rows = ImpactRows.empty(1, 2, 2, films)
    feed(rows, np.zeros(60), start=-60 * H)
    return rows


@pytest.mark.parametrize("count", [3, 400, 401, 799, 5000])
def test_joined_intervals_keep_the_impulse_of_every_sector(count):
    force, rows = np.random.default_rng(count).uniform(1.0, 50.0, count), ready()
    for begin in range(0, count, 64):
        assert feed(rows, force[begin : begin + 64], start=begin * H) == -1

    filled = rows.words[0, LOAD_ROWS]
    assert rows.words[0, PHASE] == PRESSED
    assert filled == (count if count <= 400 else pytest.approx(300, abs=100))
    edges = rows.edges[0, : filled + 1]
    assert np.all(np.diff(edges) > 0.0)
    assert edges[0] == pytest.approx(0.0, abs=1e-20)
    assert edges[-1] == pytest.approx(count * H, rel=1e-12)
    impulse = H * force.sum()
    np.testing.assert_allclose(
        rows.load[0, :filled].sum(axis=0), [0.25 * impulse, 0.75 * impulse], rtol=1e-12
    )
    np.testing.assert_allclose(
        rows.sums[0], impulse * np.array([1.0, 2e-3, 4e-6, 1e-2]), rtol=1e-12
    )
    # and every interval has the impulse of its own steps
    whole = np.concatenate([[0.0], np.cumsum(H * force)])
    np.testing.assert_allclose(
        np.cumsum(rows.load[0, :filled].sum(axis=1)),
        np.interp(edges[1:], H * np.arange(count + 1), whole),
        rtol=1e-10,
    )


def test_contacts_within_the_pause_are_one_impact_and_later_ones_another():
    rows = ready()
    force = np.zeros(200)
    force[10:20], force[50:60], force[120:130] = 5.0, 6.0, 7.0  # pauses of 0.6 and 1.2 us

    over = feed(rows, force)

    assert over == 110  # 50 steps, one pause, after step 60
    assert rows.words[0, NUMBER] == 1
    assert rows.load[0, : rows.words[0, LOAD_ROWS]].sum() == pytest.approx(H * 110.0, rel=1e-12)
    assert rows.edges[0, 0] == pytest.approx(10 * H, rel=1e-9)


def test_a_stop_that_carries_from_the_start_is_not_hit():
    rows = ImpactRows.empty(1, 2, 2, 0)

    assert feed(rows, np.full(100, 20.0)) == -1
    assert rows.words[0, PHASE] == RESTING
    assert feed(rows, np.zeros(20), start=100 * H) == -1
    assert feed(rows, np.full(10, 20.0), start=120 * H) == -1  # trembles: no impact either
    assert rows.words[0, PHASE] == RESTING
    assert rows.total[0] == 0


def test_an_impact_that_comes_to_rest_is_over():
    rows = ready()

    over = feed(rows, np.full(100, 20.0), rest=40 * H)

    assert over in (40, 41)  # the sum of times has round-off
    assert rows.words[0, PHASE] == RESTING
    assert feed(rows, np.full(60, 20.0), start=100 * H, rest=40 * H) == -1
    assert rows.total[0] == 1


def test_time_without_steps_is_an_interval_without_force():
    rows = ready()
    feed(rows, np.full(5, 20.0))
    feed(rows, np.full(5, 30.0), start=25 * H)  # 20 steps in flight, less than the pause

    filled = rows.words[0, LOAD_ROWS]
    assert filled == 11
    np.testing.assert_allclose(
        np.diff(rows.edges[0, : filled + 1]), H * np.array([1] * 5 + [20] + [1] * 5)
    )
    np.testing.assert_allclose(rows.load[0, 5], 0.0)


def test_a_film_is_sampled_from_where_it_is_felt_one_pause_before_the_touch():
    rows = ready(films=1)
    feed(rows, np.zeros(1000), film=np.full(1000, 0.5))
    assert rows.words[0, PHASE] == SQUEEZED
    assert rows.words[0, FILM_ROWS] <= 400

    force = np.zeros(30)
    force[10:] = 5.0
    feed(rows, force, start=1000 * H, film=np.full(30, 0.5))

    filled = rows.words[0, FILM_ROWS]
    samples = rows.film[0, :filled]
    assert samples[0, 0] >= 1010 * H - PAUSE - 1e-12
    assert samples[0, 0] <= 1010 * H - PAUSE + 10 * H
    assert np.all(np.diff(samples[:, 0]) > 0.0)
    assert samples[-1, 0] == pytest.approx(1029 * H, rel=2e-3)
    np.testing.assert_allclose(samples[:, 2], 0.5)
    np.testing.assert_allclose(samples[:, 3:], np.tile(np.arange(6.0), (filled, 1)))


def test_motion_begins_before_the_touch_and_is_thinned_evenly():
    rows = ready()
    force = np.zeros(1000)
    force[3:] = 5.0
    feed(rows, force)

    count = rows.words[0, MODE_ROWS]
    assert 100 <= count <= 200
    np.testing.assert_allclose(rows.places[0, :count, 0] * H, rows.moments[0, :count], atol=1e-15)
    assert rows.moments[0, 0] == pytest.approx(3 * H, rel=1e-9)
    assert np.ptp(np.diff(rows.moments[0, 1:count])) < 1e-3 * H
