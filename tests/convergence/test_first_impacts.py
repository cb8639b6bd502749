"""Truth: first impacts in shorter steps, extrapolated or not (convergence), half a sine (exact).

Exact too: the momentum that a film takes over a way, and the time of that way.

What the steps miss of a peak is estimated by ``klack.simulation.impact_doubts``; it is held against
the same stroke in much shorter steps.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doubts import doubts
from numpy.typing import NDArray

from klack.case.any_case import load_valve_case
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.surging_spring import SurgingSpring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import FilmRow, Rows
from klack.simulation.impact_doubts import impact_doubts, late_by_swinging, missing_peak
from klack.simulation.network_arrays import PARTS
from klack.simulation.network_result import InterfaceRecord, NetworkResult
from klack.simulation.network_run import simulate_network

STEEP = FilmRow(cubic=2e-15, linear=0.0, cut_off=1e-6, suction=1e9)
"""Hardest at touch: a needle of 2 g at 2 m/s crosses it without losing much of its speed."""
THICK = FilmRow(cubic=2.9e-14, linear=0.0, cut_off=2e-6, suction=1e9)
"""Takes nine tenths of the momentum before the touch: hardest while the needle still flies."""


def rows(restitution: float | None = None, film: FilmRow | None = None) -> Rows:
    """A needle of 2 g flies at 2 m/s onto a stop of 200 N/um."""
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=2e-3, points=("tip",), speed=-2.0),
        "seat": EndStop(
            gap=40e-6, law={"kind": "linear", "stiffness": 2e8}, restitution=restitution
        ),
    }
    found = Network(parts, [["needle.tip", "seat.upper"], ["seat.lower", "ground"]]).rows()
    if film is None:
        return found
    return replace(found, interfaces=[replace(found.interfaces[0], film=film)])


def impact(of: Rows, step: float | None = None) -> tuple[NetworkResult, list[str]]:
    """One stroke and its doubts."""
    with doubts() as said:
        result = simulate_network(of, duration=60e-6, step=step, start="free")
    return result, said


def test_a_film_that_stops_a_needle_does_so_in_macro_steps_after_its_peak():
    """Exact: ``m (v0 - v) = C/2 (1/x^2 - 1/x0^2)``, ``F = C v/x^3``, ``t`` integrates ``dx/v``."""
    film = replace(THICK, cut_off=1e-6)
    needle = rows(film=film)
    needle.bodies[0] = replace(needle.bodies[0], speed=-0.5)

    result = simulate_network(needle, duration=100e-6, record=1.28e-6, start="free")

    x = result.channels["seat gap"].values + film.cut_off
    v = 0.5 - film.cubic / (2.0 * 2e-3) * (1.0 / x**2 - 1.0 / x[0] ** 2)
    assert v[-1] < 0.02
    # the mean force over a way is exact: 4e-11 is round-off
    assert -result.channels["needle velocity"].values == pytest.approx(v, abs=1e-9)
    fine = np.geomspace(x[-1], x[0], 200_001)
    speed = 0.5 - film.cubic / (2.0 * 2e-3) * (1.0 / fine**2 - 1.0 / x[0] ** 2)
    time = np.trapezoid(fine / speed, np.log(fine))
    # 3e-4: a gap that changes by some per cent in a step is a straight line in it
    assert result.time[-1] == pytest.approx(time, rel=1e-3)
    force = film.cubic * speed / fine**3
    # means of steps, which are short while the film presses ever harder: 1e-4 below the peak
    assert result.channels["seat peak force"].values.max() == pytest.approx(force.max(), rel=3e-4)
    assert result.steps.near < result.steps.flight  # it falls for most of the time


@pytest.mark.parametrize("restitution", [0.05, 0.2, 0.5, 1.0])
def test_default_steps_resolve_a_stop_of_any_restitution(restitution):
    result, doubts = impact(rows(restitution))
    finer, _ = impact(rows(restitution), 2.5e-9)

    assert not doubts
    first, truth = result.events[0], finer.events[0]
    assert first.time == pytest.approx(truth.time, abs=5e-8)
    assert first.peak_force == pytest.approx(truth.peak_force, rel=3e-4)


@pytest.mark.parametrize(
    ("restitution", "film", "step"),
    [
        (0.05, None, 100e-9),
        (None, None, 200e-9),
        (None, THICK, 200e-9),
        (None, STEEP, 20e-9),
        (None, STEEP, 100e-9),
    ],
    ids=["low restitution", "elastic", "thick film", "film at touch", "film at touch, coarse"],
)
def test_a_peak_that_the_steps_miss_is_told_with_its_size(restitution, film, step):
    result, doubts = impact(rows(restitution, film), step)
    finer, _ = impact(rows(restitution, film), step / 20.0)

    missing = finer.events[0].peak_force / result.events[0].peak_force - 1.0
    first = result.events[0]
    share, _, _ = missing_peak(result.interfaces["seat"], first.peak_time, first.restitution)
    assert missing > 6e-4
    assert len(doubts) == 1
    assert "first impact on 'seat'" in doubts[0]
    assert "run.step: " in doubts[0]
    assert share == pytest.approx(missing, rel=0.25, abs=1e-4)


def test_the_step_that_a_doubt_advises_ends_it():
    _, doubts = impact(rows(0.05), 100e-9)
    words = doubts[0].split("run.step: ")[1].split()

    assert words[1].rstrip(";") == "ns"
    _, again = impact(rows(0.05), float(words[0]) * 1e-9)
    assert not again


@pytest.mark.parametrize("step", [500e-9, 1e-6, 2e-6, 5e-6])
@pytest.mark.parametrize("restitution", [0.02, 0.5, 1.0])
def test_steps_that_resolve_no_peak_promise_no_better_value(restitution, step):
    """The peak is off by 2 % and more, or the contact has fewer than eight steps."""
    result, doubts = impact(rows(restitution), step)
    truth, _ = impact(rows(restitution), 2.5e-9)

    missing = truth.events[0].peak_force / result.events[0].peak_force - 1.0
    told = [text for text in doubts if "first impact on 'seat'" in text]
    assert len(told) == 1
    assert "run.step: " in told[0]
    if "assume about" in told[0]:
        assert missing < 0.03
    else:
        assert "or more" in told[0] or "not resolved" in told[0]


@pytest.mark.parametrize("place", [0.0, 0.2, 0.5], ids=lambda share: f"{share} of a step")
def test_half_a_sine_misses_what_its_means_miss(place):
    """Thirty steps of half a sine: 1 less the largest mean, to a twentieth of it."""
    h = np.pi / 30.0
    edges = h * (np.arange(31) + place)
    means = (np.cos(edges[:-1]) - np.cos(edges[1:])) / h
    record = InterfaceRecord(
        time=edges[:-1],
        step=np.full(30, h),
        contact_force=means,
        film_force=np.zeros(30),
        gap=-np.sin(edges[1:]),
        complete=True,
    )
    k = int(np.argmax(means))

    share, at_touch, length = missing_peak(record, edges[k] + 0.5 * h)

    assert not at_touch
    assert length == h
    assert share == pytest.approx(1.0 / means[k] - 1.0, rel=0.05)


def test_impacts_without_a_record_are_not_doubted():
    result, _ = impact(rows(0.05), 100e-9)
    none = np.zeros(0)
    empty = InterfaceRecord(
        time=none, step=none, contact_force=none, film_force=none, gap=none, complete=False
    )

    assert list(impact_doubts(result.events, {"seat": empty}, 100e-9)) == []


def loaded(restitution: float | None) -> Rows:
    """A needle of 0.13 g pressed by 3.5 N; 13 N more push it in 1 us, and go in 20 us."""
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=1.3e-4, points=("tip",)),
        "spring": Spring(stiffness=2e4, preload=3.5),
        "seat": EndStop(
            gap=0.0, law={"kind": "linear", "stiffness": 1.4e7}, restitution=restitution
        ),
        "load": ForceOverTime(time=(1e-4, 1.01e-4, 5e-4, 5.2e-4), force=(0.0, -13.0, -13.0, 0.0)),
    }
    nodes = [["needle.tip", "spring.end", "seat.upper", "load.end"], ["seat.lower", "ground"]]
    return Network(parts, nodes).rows()


def stroke(of: Rows, **steps: float) -> tuple[NetworkResult, list[str]]:
    with doubts() as said:
        result = simulate_network(of, duration=7e-4, **steps)
    return result, said


def test_a_stop_that_was_swung_on_is_told_with_the_shift_of_its_first_impact():
    """Truth: fine steps of everything together, which follow each swing."""
    result, (doubt,) = stroke(loaded(None), coarse=1, step=200e-9)
    finer, silent = stroke(loaded(None), coarse=1, step=10e-9)

    assert not silent
    late = abs(result.events[0].time - finer.events[0].time)
    assert late > 5e-8
    told = late_by_swinging(result.interfaces["seat"], result.events[0].time)
    assert told[0] == pytest.approx(late, rel=0.4)  # swings of all sizes, each by its share
    assert told[2] == pytest.approx(2.0 * np.pi * np.sqrt(1.3e-4 / 1.402e7), rel=0.02)  # 19 us
    assert f"oscillated on it {told[1]} times, each 19 us long" in doubt
    assert "Try: run.step: 100 ns" in doubt


def test_macro_steps_in_which_forces_rise_and_fall_follow_the_same_swings():
    """The same truth; the error of these steps is of fourth order, and told to be none."""
    result, _ = stroke(loaded(None), step=100e-9)
    finer, _ = stroke(loaded(None), coarse=1, step=10e-9)
    time = result.events[0].time

    assert time == pytest.approx(finer.events[0].time, abs=5e-8)
    assert late_by_swinging(result.interfaces["seat"], time, rises=True)[0] < 5e-8


def test_a_swing_is_at_rest_nowhere():
    """Its force is steady for a moment at each crest, where a step in flight would be too long."""
    result, silent = stroke(loaded(None))
    finer, _ = stroke(loaded(None), coarse=1, step=5e-9)

    assert not silent
    assert result.events[0].time == pytest.approx(finer.events[0].time, abs=5e-8)
    assert result.events[0].peak_force == pytest.approx(finer.events[0].peak_force, rel=5e-4)


def test_a_stop_that_damps_the_swing_is_not():
    assert not stroke(loaded(0.5))[1]


def first_impacts(of: Rows, duration: float, **options: Any) -> dict[str, NDArray[np.float64]]:
    """Time [us], approach speed [m/s] and peak [N] of the first impact on each stop."""
    result = simulate_network(of, duration=duration, **options)
    found: dict[str, NDArray[np.float64]] = {}
    for event in result.events:
        measures = np.array([event.time * 1e6, event.approach_speed, event.peak_force])
        found.setdefault(event.stop, measures)
    return found


def extrapolated(of: Rows, duration: float, **options: Any) -> dict[str, NDArray[np.float64]]:
    """The same in fine steps of everything together, from three of their sizes.

    The error falls with the step; what the last halving changes is more than what is left.
    """
    steps = (10e-9, 5e-9, 2.5e-9)
    halved = [first_impacts(of, duration, coarse=1, step=step, **options) for step in steps]
    truth = {}
    for stop, finest in halved[2].items():
        coarsest, middle = halved[0][stop], halved[1][stop]
        truth[stop] = 2.0 * finest - middle
        doubt = np.abs(truth[stop] - (2.0 * middle - coarsest))
        assert doubt[0] < 0.01
        assert np.all(doubt[1:] < 1e-4 * truth[stop][1:])
    return truth


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::klack.errors.AccuracyWarning")
def test_a_touch_is_cut_where_everything_goes_in_fine_steps():
    """Behind a film that is hardest at the touch; force and time extrapolated over three steps."""
    film = FilmRow(cubic=1e-16, linear=0.0, cut_off=0.5e-6, suction=1e9)
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=2e-4, points=("tip",), speed=-2.0),
        "seat": EndStop(
            gap=40.37e-6, law={"kind": "linear", "stiffness": 1.5e9}, restitution=0.665
        ),
    }
    of = Network(parts, [["needle.tip", "seat.upper"], ["seat.lower", "ground"]]).rows()
    of = replace(of, interfaces=[replace(of.interfaces[0], film=film)])

    def touch(step: float) -> NDArray[np.float64]:
        """Start [ns] of the closed contact and the last force [N] before it, then both at gap 0."""
        run = simulate_network(of, duration=25e-6, coarse=1, step=step, start="free")
        assert run.books.relative_residual < 1e-12
        record = run.interfaces["seat"]
        k = int(np.flatnonzero(record.contact_force > 0.0)[0])
        before, begin = record.film_force[:k], record.time[k]
        closes = begin + record.step[k] * record.gap[k - 1] / -np.diff(record.gap)[k - 1]
        middle = record.time[k - 2 : k] + 0.5 * record.step[k - 2 : k]
        rise = np.diff(before)[-1] / np.diff(middle)[0]
        there = before[-1] + rise * (closes - middle[-1])
        return np.array([begin * 1e9, before[-1], closes * 1e9, there])

    halved = [touch(step)[2:] for step in (5e-9, 2.5e-9, 1.25e-9)]
    truth = 2.0 * halved[2] - halved[1]
    assert np.all(np.abs(truth - 2.0 * halved[1] + halved[0]) < [0.1, 0.5])
    begin, force, _, _ = touch(20e-9)

    part = 20.0 / PARTS  # [ns]; the mean force of one is half of its rise below that at its end
    assert begin == pytest.approx(truth[0], abs=part)
    assert force == pytest.approx(truth[1], abs=1.7 * 1.5 * part)  # it rises by 1.7 N a ns


@pytest.mark.parametrize("place", [0.0, 0.6e-9, 17.6e-9], ids=["a", "b", "c"])
def test_a_touch_behind_a_compliance_is_cut_wherever_it_falls(place):
    """A film presses the compliance: faces touch at gap + compression 0, long after gap 0.

    The parts last until the force of the film has gone over to that of the contact.
    """
    film = FilmRow(cubic=1e-16, linear=0.0, cut_off=0.5e-6, suction=1e9)
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=2e-4, points=("tip",), speed=-2.0),
        "seat": EndStop(
            gap=10e-6 + 2.0 * place,
            law={"kind": "linear", "stiffness": 1.5e9},
            series_compliance=1e-9,
        ),
    }
    of = Network(parts, [["needle.tip", "seat.upper"], ["seat.lower", "ground"]]).rows()
    of = replace(of, interfaces=[replace(of.interfaces[0], film=film)])
    run = simulate_network(of, duration=8e-6, coarse=1, step=20e-9, start="free")

    record = run.interfaces["seat"]
    k = int(np.flatnonzero(record.contact_force > 0.0)[0])
    assert record.gap[k - 1] < -50e-9
    assert record.step[k : k + 2] == pytest.approx(20e-9 / PARTS, rel=1e-9)


def test_a_mass_under_a_force_that_rises_flies_as_far_as_it_should():
    """Exact: a cubic parabola; forces constant over a step would be off by 6e-5 of it.

    The first step knows of no rise, which leaves (H/T)^3/4, 3e-7 of the way.
    """
    parts: dict[str, Component] = {
        "mass": RigidMass(mass=2e-3, points=("body",)),
        "magnet": ForceOverTime(time=(0.0, 200e-6), force=(0.0, 50.0)),
    }
    of = Network(parts, [["mass.body", "magnet.end"]]).rows()
    run = simulate_network(of, duration=115.2e-6, record=1.28e-6, start="free")

    way = run.channels["mass.body displacement"].values[-1]
    assert way == pytest.approx(50.0 / 200e-6 * run.time[-1] ** 3 / (6.0 * 2e-3), rel=5e-7)


def magnet(*points: tuple[float, float]) -> ForceOverTime:
    """Force [N] over time [us]."""
    time, force = zip(*points, strict=True)
    return ForceOverTime(time=tuple(1e-6 * point for point in time), force=force)


STEEP_RAMP = {
    "needle": RigidMass(mass=1.07e-3, points=("tip",)),
    "spring": Spring(stiffness=1620.0, preload=31.5),
    "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 8.43e8}),
    "stop": EndStop(gap=37.6e-6, law={"kind": "linear", "stiffness": 2e7}),
    "magnet": magnet((9.06, 0.0), (9.81, 80.0), (219.3, 80.0), (219.9, 0.0)),
}
"""It rises within 1.2 macro steps, while the seat rings; the needle comes back at 0.05 m/s."""

TURNING = {
    "needle": RigidMass(mass=15.7e-3, points=("tip",)),
    "spring": Spring(stiffness=1045.0, preload=51.6, damping=0.576),
    "guide": GuideFriction(coulomb=0.467, breakaway=5.16),
    "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1.34e9}, restitution=0.717),
    "stop": EndStop(gap=264e-6, law={"kind": "linear", "stiffness": 4e7}),
    "magnet": magnet((14.8, 0.0), (280.0, 226.0), (3000.0, 226.0), (3000.8, 0.0)),
}
"""Friction is eleven times as high where it turns, which it does in flight after each rebound."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parts", "duration"),
    [(STEEP_RAMP, 0.34e-3), (TURNING, 3.7e-3)],
    ids=["steep ramp", "turning friction"],
)
def test_first_impacts_do_not_depend_on_the_step(parts, duration):
    nodes = [
        ["needle.tip", "spring.end", "seat.upper", "stop.lower", "magnet.end"],
        ["seat.lower", "stop.upper", "ground"],
    ]
    if "guide" in parts:
        nodes[0].append("guide.body")
    of = Network(parts, nodes).rows()
    truth, found = extrapolated(of, duration), first_impacts(of, duration)

    assert list(found) == list(truth) == ["stop", "seat"]
    for stop, (time, speed, peak) in truth.items():
        assert found[stop][0] == pytest.approx(time, abs=0.05)
        assert found[stop][1] == pytest.approx(speed, rel=5e-4)
        assert found[stop][2] == pytest.approx(peak, rel=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("needle", "modes"), [(2e-3, 6), (1e-3, 6), (2e-3, 12)])
def test_first_impacts_on_a_spring_whose_coils_surge_do_not_depend_on_the_step(needle, modes):
    """Its coils ring through the whole stroke; a phase that is off shows at the seat."""
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=needle, points=("tip",)),
        "spring": SurgingSpring(stiffness=2e4, preload=5.0, mass=0.6e-3, modes=modes, damping=0.01),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 2e8}),
        "stop": EndStop(gap=100e-6, law={"kind": "linear", "stiffness": 5e8}, restitution=0.6),
        "magnet": ForceOverTime(time=(10e-6, 40e-6, 0.5e-3, 0.55e-3), force=(0.0, 60.0, 60.0, 0.0)),
    }
    nodes = [
        ["needle.tip", "spring.end", "seat.upper", "stop.lower", "magnet.end"],
        ["seat.lower", "stop.upper", "ground"],
    ]
    of = Network(parts, nodes).rows()
    truth, found = extrapolated(of, 1e-3), first_impacts(of, 1e-3)

    for stop, (time, speed, peak) in truth.items():
        assert found[stop][0] == pytest.approx(time, abs=0.05)
        assert found[stop][1] == pytest.approx(speed, rel=5e-4)
        assert found[stop][2] == pytest.approx(peak, rel=5e-4)


@pytest.mark.slow
def test_a_film_that_brakes_a_creeping_needle_belongs_to_its_impact():
    """It presses hardest long before the touch, while the needle flies in macro steps."""
    film = FilmRow(cubic=4e-15, linear=0.0, cut_off=0.45e-6, suction=1e9)
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=24e-3, points=("tip",), speed=-0.15),
        "spring": Spring(stiffness=5e4, preload=5.0),
        "seat": EndStop(gap=60e-6, law={"kind": "linear", "stiffness": 1.3e9}, restitution=0.7),
    }
    nodes = [["needle.tip", "spring.end", "seat.upper"], ["seat.lower", "ground"]]
    of = Network(parts, nodes).rows()
    of = replace(of, interfaces=[replace(of.interfaces[0], film=film)])
    truth = extrapolated(of, 3e-3, start="free")
    found = first_impacts(of, 3e-3, start="free")

    time, speed, peak = truth["seat"]
    assert found["seat"][0] == pytest.approx(time, abs=0.1)
    assert found["seat"][1] == pytest.approx(speed, rel=5e-4)
    assert found["seat"][2] == pytest.approx(peak, rel=5e-4)


@pytest.mark.slow
def test_the_speed_of_an_approach_is_in_the_record():
    """Of a needle that runs on into its armature while another stop throws that back."""
    film = FilmRow(cubic=3e-15, linear=0.0, cut_off=1.5e-6, suction=1e9)
    law = {"kind": "linear", "stiffness": 1e9}
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=1.16e-3, points=("ring",), speed=1.5),
        "armature": RigidMass(mass=2.5e-3, points=("foot", "land"), speed=1.5),
        "opening": EndStop(gap=10e-6, law=law, restitution=0.5),
        "rest": EndStop(gap=40e-6, law=law, restitution=0.5),
    }
    nodes = [
        ["ground", "opening.upper"],
        ["armature.land", "opening.lower"],
        ["armature.foot", "rest.upper"],
        ["needle.ring", "rest.lower"],
    ]
    of = Network(parts, nodes).rows()
    of = replace(of, interfaces=[of.interfaces[0], replace(of.interfaces[1], film=film)])
    result = simulate_network(of, duration=60e-6, start="free")
    fine = simulate_network(of, duration=60e-6, step=5e-9, coarse=1, record=5e-9, start="free")

    needle, armature = (fine.channels[f"{name} velocity"] for name in ("needle", "armature"))
    (event,) = (event for event in result.events if event.stop == "rest")
    # the highest of speeds 5 ns apart is below that between them by 4e-6
    assert event.approach_speed == pytest.approx((needle.values - armature.values).max(), rel=2e-5)
    assert event.energy_loss <= 0.5 * (1.16e-3 + 2.5e-3) * 1.5**2


@pytest.mark.slow
def test_the_impulse_of_an_impact_does_not_depend_on_the_step():
    """It begins where the film sets in, also if that is in flight after an earlier impact."""
    case = load_valve_case(Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml")
    rows, duration = case.network.network().rows(), 0.4e-3
    options: tuple[dict[str, Any], ...] = {}, {"coarse": 1, "step": 5e-9}
    found, fine = (simulate_network(rows, duration=duration, **o) for o in options)

    assert len(found.events) == len(fine.events) == 3
    for event, other in zip(found.events, fine.events, strict=True):
        # steps of 20 ns are off by 2e-4, fine steps of everything of that length by 4e-4
        assert event.impulse == pytest.approx(other.impulse, rel=5e-4)
