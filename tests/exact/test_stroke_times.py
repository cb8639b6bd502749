"""Opening and closing times: straight lines whose crossings are known, and small valves.

Truth: where a straight line passes 10, 50 and 90 % of a lift; the order of events; the equation of
motion under a constant force.
"""

from pathlib import Path

import numpy as np
import pytest
from draws import each

from klack.analyses.stroke.times import all_lift_times, lift_times
from klack.case.any_case import read_valve_case
from klack.case.valve_roles import find_roles
from klack.simulation.network_result import ImpactEvent
from klack.simulation.network_run import simulate_network

TIME = np.linspace(0.0, 10e-3, 10_001)
LIFT = 100e-6


def hit(stop, time):
    numbers = dict.fromkeys(
        (
            "approach_speed",
            "peak_force",
            "peak_time",
            "contact_time",
            "separation_time",
            "impulse",
            "restitution",
            "energy_loss",
        ),
        0.0,
    )
    return ImpactEvent(stop=stop, time=time, **numbers)


def times_of(corners, events=(), ends=(0.0, LIFT)):
    """Times of a motion in straight lines between (ms, um)."""
    at, lift = np.array(corners, dtype=float).T
    return lift_times(
        TIME,
        1e-6 * np.interp(TIME, 1e-3 * at, lift),
        events,
        body="needle",
        ends=ends,
        stops=("seat", "stop"),
    )


def moments(passage):
    return [passage.at_10, passage.at_50, passage.at_90, passage.touch]


def test_a_valve_that_starts_closed_opens_and_closes():
    events = (hit("stop", 2e-3), hit("stop", 2.4e-3), hit("seat", 6e-3), hit("seat", 6.5e-3))
    times = times_of([(1, 0), (2, 100), (2.2, 80), (2.4, 100), (5, 100), (6, 0)], events)

    assert (times.starts, times.lift, times.between_stops) == ("closed", LIFT, True)
    assert moments(times.opening) == pytest.approx([1.1e-3, 1.5e-3, 1.9e-3, 2e-3], rel=1e-12)
    assert moments(times.closing) == pytest.approx([5.9e-3, 5.5e-3, 5.1e-3, 6e-3], rel=1e-12)
    assert [way for way, _ in times.in_order] == ["opening", "closing"]


def test_a_valve_that_starts_open_closes_before_it_opens_again():
    events = (hit("seat", 2e-3), hit("stop", 8e-3))
    times = times_of([(1, 100), (2, 0), (6, 0), (8, 100)], events)

    assert times.starts == "open"
    assert moments(times.closing) == pytest.approx([1.9e-3, 1.5e-3, 1.1e-3, 2e-3], rel=1e-12)
    assert moments(times.opening) == pytest.approx([6.2e-3, 7e-3, 7.8e-3, 8e-3], rel=1e-12)
    assert [way for way, _ in times.in_order] == ["closing", "opening"]


def test_what_a_run_does_not_reach_is_none_and_never_nan():
    drawn = times_of([(1, 100), (2, 0)], (hit("seat", 2e-3),))
    assert moments(drawn.opening) == [None] * 4
    cushioned = times_of([(1, 0), (2, 99), (6, 99), (7, 0.5)])
    assert cushioned.opening.touch is None
    assert cushioned.closing.touch is None
    assert cushioned.opening.at_90 == pytest.approx(1e-3 + 90 / 99 * 1e-3, rel=1e-12)
    partial = times_of([(1, 0), (2, 60), (3, 0)], (hit("seat", 3e-3),))
    assert moments(partial.opening)[2:] == [None, None]
    assert partial.opening.at_50 == pytest.approx((1 + 5 / 6) * 1e-3, rel=1e-12)
    assert partial.closing.at_90 is None
    assert partial.closing.touch == 3e-3
    still = times_of([(0, 0), (1, 1e-3)])
    assert moments(still.opening) == moments(still.closing) == [None] * 4
    stuck = times_of([(0, 0), (1, 0)], ends=(-np.inf, np.inf))
    assert stuck.lift is None
    assert not stuck.opening.moves


def test_the_first_whole_stroke_counts_not_a_bounce_before_it():
    events = (hit("seat", 1.5e-3), hit("stop", 4e-3), hit("seat", 7e-3))
    corners = [(1, 0), (1.2, 15), (1.5, 0), (3, 0), (4, 100), (6, 100), (7, 0), (8, 0), (9, 100)]
    times = times_of(corners, events)

    assert times.opening.at_10 == pytest.approx(3.1e-3, rel=1e-12)
    assert times.closing.touch == 7e-3


@each("seed", range(40))
def test_every_time_lies_in_the_run_and_closing_follows_opening(seed):
    """Truth: the order of events.  Random motions, most of them closed or open at an end."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.uniform(0.0, 10.0, 12))
    lift = np.clip(rng.uniform(-60.0, 160.0, 12), 0.0, 100.0)
    lift[0] = rng.choice([0.0, 100.0])
    events = [
        hit("seat" if x <= 0.0 else "stop", 1e-3 * t)
        for t, x in zip(at, lift, strict=True)
        if x in (0.0, 100.0)
    ]
    (_, first), (_, second) = times_of(np.column_stack([at, lift]), events).in_order

    known = [t for passage in (first, second) for t in moments(passage) if t is not None]
    assert all(0.0 <= t <= TIME[-1] for t in known)
    if first.touch is not None and second.touch is not None:
        assert second.touch > first.touch


def test_a_needle_that_stays_on_its_seat_has_no_closing_time():
    events = (hit("seat", 1e-3), hit("seat", 2e-3))  # it chatters by nothing that counts
    times = times_of([(0, 0), (1, 0.004), (2, 0), (10, 0)], events)

    assert moments(times.opening) == moments(times.closing) == [None] * 4


def test_without_an_opening_stop_the_lift_is_that_of_the_run():
    times = times_of([(1, 0), (2, 40), (3, 0)], ends=(0.0, np.inf))

    assert (times.lift, times.between_stops) == (pytest.approx(40e-6, rel=1e-12), False)
    assert times.opening.at_90 == pytest.approx(1.9e-3, rel=1e-12)


def test_a_valve_that_stays_far_below_its_stop_is_timed_by_its_own_lift():
    times = times_of([(1, 0), (2, 40), (3, 0)], (hit("seat", 3e-3),), ends=(0.0, 1e-3))

    assert (times.lift, times.between_stops) == (pytest.approx(40e-6, rel=1e-12), False)
    assert moments(times.opening)[:3] == pytest.approx([1.1e-3, 1.5e-3, 1.9e-3], rel=1e-12)
    assert times.opening.touch is None
    assert times.closing.touch == 3e-3


CHAIN = """
klack: 1
title: chain
network:
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [tip, top]}
    piston: {type: rigid-mass, mass: 2 g, points: [foot, head]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    rod: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    end: {type: end-stop, gap: 250 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 0.001 N/mm, preload: 10 N}
    pull: {type: force-over-time, time: [0 us, 1 us, 4 ms, 4.001 ms], force: [0 N, 30 N, 30 N, 0 N]}
  connections:
    - [needle.tip, seat.upper, pull.end]
    - [seat.lower, ground]
    - [needle.top, rod.lower]
    - [piston.foot, rod.upper]
    - [piston.head, end.lower, spring.end]
    - [end.upper, ground]
run: {duration: 8 ms, step: 200 ns, record: 2 us, variants: [dry], lift: needle.tip}
"""


@pytest.fixture(scope="module")
def chain():
    case = read_valve_case(CHAIN, Path("chain.yaml"))
    rows = case.network.network().rows()
    result = simulate_network(rows, duration=8e-3, step=50e-9, record=2e-6)
    return case, result, all_lift_times(result, rows, "needle", "tip")


def test_the_stop_of_a_pushed_body_is_the_opening_stop_of_the_one_that_pushes(chain):
    case, result, (needle, piston) = chain
    roles = find_roles(case)

    assert (roles.seat, roles.opening_stop) == ("seat", "end")
    assert (needle.opening.stop, needle.closing.stop) == ("end", "seat")
    assert (piston.body, piston.opening.stop, piston.closing.stop) == ("piston", "end", "seat")
    assert needle.lift == piston.lift == pytest.approx(250e-6, rel=1e-12)
    touches = {event.stop: event.time for event in reversed(result.events)}
    assert needle.opening.touch == piston.opening.touch == touches["end"]


def test_times_of_a_constant_force_follow_from_the_equation_of_motion(chain):
    _, _, (needle, piston) = chain

    # 20 N on 5 g from 2/3 of the first microsecond on, 250 um; rod and seat press by 0.1 um
    for share, found in ((0.5, piston.opening.at_50), (0.9, piston.opening.at_90)):
        assert found == pytest.approx(np.sqrt(2 * share * 250e-6 / 4000.0), rel=5e-3)
    assert needle.opening.at_50 == pytest.approx(piston.opening.at_50, rel=2e-3)
    assert 4e-3 < needle.closing.at_90 < needle.closing.at_50 < needle.closing.at_10
    assert needle.closing.at_10 < needle.closing.touch
