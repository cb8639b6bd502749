"""Measures of impacts and of strokes.

Truth: histories written down by formula, so every measure is known beforehand.

Which level is the answer; truth: half sines whose steps are counted by hand.

Speeds of an impact between two records: a film stops a needle within less than their spacing.

Truth: a motion made up in closed form, of even acceleration by all other forces, a film that grows
and pulls exponentially, and a contact of a half sine; wherever the records lie.

Opening and closing times: straight lines whose crossings are known, and small valves.

Truth: where a straight line passes 10, 50 and 90 % of a lift; the order of events; the equation of
motion under a constant force.

Travel of one body between stops: the nearest stop. Truth: the linear programme, bit for bit.
"""

from dataclasses import replace
from math import cos, exp, inf, pi
from pathlib import Path
from types import SimpleNamespace as Of

import numpy as np
import pytest
from draws import each
from scipy.integrate import solve_ivp

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.levels import deviations, level_result
from klack.analyses.impact.record import LevelResult
from klack.analyses.impact.trust import best_level, trust_notes
from klack.analyses.stroke.pairs import impacts_by_pair
from klack.analyses.stroke.times import all_lift_times, lift_times
from klack.case.any_case import read_valve_case
from klack.case.valve_roles import find_roles
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.contact.restitution import find_contacts, measure_impact
from klack.errors import InputError
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce
from klack.mechanics.lever import Lever
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.network import Network
from klack.network.ranges import StopBound, Travel
from klack.simulation.impact_events import ImpactFinder
from klack.simulation.network_result import ChannelData, ImpactEvent
from klack.simulation.network_run import simulate_network

MASS = 2e-3  # [kg]


def written(force_of, *, step=20e-9, duration=80e-6, speed=0.5, external=0.0, **extra):
    """History of a needle under a force given as exact impulse J(t) of the contact."""
    edges = step * np.arange(round(duration / step) + 1)
    J = force_of(edges)
    force = np.diff(J) / step
    velocity = -speed + (J + external * edges) / MASS
    return ImpactHistory(
        step=step,
        force=force,
        gap=np.zeros(force.size),
        velocity_a=velocity,
        velocity_b=np.zeros(edges.size),
        speed=speed,
        mass_a=MASS,
        mass_b=np.inf,
        external_force=np.full(force.size, external),
        ledger=EnergyLedger(initial=0.5 * MASS * speed**2, bodies=()),
        **extra,
    )


def half_sine(peak, start, length):
    def impulse(t):
        return peak * length / pi * (1.0 - np.cos(pi * np.clip((t - start) / length, 0.0, 1.0)))

    return impulse


@pytest.mark.parametrize("start", [3.0e-6, 3.0041e-6, 3.0137e-6, 3.0199e-6])
def test_half_sine_is_measured_between_its_samples(start):
    m = measure_impact(written(half_sine(200.0, start, 14e-6)))

    assert m.first_touch == pytest.approx(start, abs=2e-12)  # 1e-4 of a step
    assert m.contact_time == pytest.approx(14e-6, rel=1e-6)
    assert m.peak_force == pytest.approx(200.0, rel=5e-6)  # mean over a step of 1/700
    assert m.impulse == pytest.approx(200.0 * 14e-6 * 2.0 / pi, rel=1e-12)
    assert m.restitution == pytest.approx(m.impulse / (MASS * 0.5) - 1.0, rel=1e-12)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, rel=1e-12)
    assert m.vibration_share == pytest.approx(1.0 - m.restitution**2, rel=1e-12)


@pytest.mark.parametrize("exponent", [1.0, 1.3, 1.5, 2.0])
def test_touch_is_found_for_every_exponent_of_the_law(exponent):
    """F = A t^n at both ends (a symmetric pulse)."""
    n, start, length = exponent, 2.0133e-6, 10e-6
    scale = 100.0 / (0.5 * length) ** n

    def impulse(t):
        x = np.clip(t - start, 0.0, length)
        rising = scale * np.minimum(x, 0.5 * length) ** (n + 1) / (n + 1)
        left = np.minimum(length - x, 0.5 * length)
        whole = scale * (0.5 * length) ** (n + 1) / (n + 1)
        return np.where(x < 0.5 * length, rising, 2.0 * whole - scale * left ** (n + 1) / (n + 1))

    m = measure_impact(written(impulse))

    assert m.first_touch == pytest.approx(start, abs=1e-12)
    assert m.contact_time == pytest.approx(length, rel=1e-6)


def test_fading_contact_ends_at_the_threshold():
    """Exponential tail: the end is where 0.5 % of the peak is crossed, not the first zero."""
    tau, start, plateau = 0.4e-6, 2e-6, 10e-6

    def impulse(t):
        x = t - start
        flat = np.clip(x, 0.0, plateau)
        tail = np.clip(x - plateau, 0.0, None)
        return 200.0 * (flat + tau * (1.0 - np.exp(-tail / tau)))

    history = written(impulse)
    m = measure_impact(history)

    # straight lines between records of tau/20: h^2/(8 tau) off
    assert m.contact_time == pytest.approx(plateau + tau * np.log(200.0), abs=1e-9)
    assert m.impulse == pytest.approx(200.0 * (plateau + tau), rel=1e-4)  # the tail is counted


def test_swelling_contact_begins_at_the_threshold():
    """The same backwards: no zero before it, so touch is where 0.5 % of the peak is crossed."""
    tau, start, plateau = 0.4e-6, 8e-6, 10e-6

    def impulse(t):
        x = t - start
        flat = np.clip(x, 0.0, plateau)
        return 200.0 * (flat + tau * np.exp(np.clip(x, None, 0.0) / tau))

    m = measure_impact(written(impulse))

    assert m.first_touch == pytest.approx(start - tau * np.log(200.0), abs=1e-9)


def test_peak_is_in_the_middle_of_its_record():
    """The top of the half sine lies 10 ns behind the beginning of a record of 20 ns."""
    m = measure_impact(written(half_sine(200.0, 3.01e-6, 14e-6)))

    assert m.first_touch + m.peak_time == pytest.approx(10.01e-6, rel=1e-12, abs=0.0)


def test_two_touches_within_50_us_are_one_impact():
    first, second = half_sine(200.0, 5e-6, 10e-6), half_sine(60.0, 25e-6, 6e-6)
    third = half_sine(90.0, 120e-6, 8e-6)
    history = written(lambda t: first(t) + second(t) + third(t), duration=200e-6)
    m = measure_impact(history)
    impulse = (200.0 * 10e-6 + 60.0 * 6e-6) * 2.0 / pi

    assert len(find_contacts(history)) == 3
    assert (m.sub_contacts, m.impacts) == (2, 2)
    assert (m.contact_time, m.total_contact_time) == pytest.approx((10e-6, 26e-6), rel=1e-06)
    assert m.impulse == pytest.approx(impulse, rel=1e-12)
    assert m.restitution == pytest.approx(impulse / (MASS * 0.5) - 1.0, rel=1e-12)


def test_long_periods_of_the_needle_widen_the_cluster():
    both = half_sine(200.0, 5e-6, 10e-6), half_sine(60.0, 85e-6, 6e-6)
    near, far = (
        measure_impact(
            written(lambda t: both[0](t) + both[1](t), duration=150e-6, longest_period=period)
        )
        for period in (40e-6, 30e-6)
    )

    assert (near.impacts, far.impacts) == (1, 2)


def test_chatter_below_the_threshold_is_no_contact():
    main = half_sine(200.0, 5e-6, 10e-6)
    chatter = half_sine(0.8, 30e-6, 1e-6)
    m = measure_impact(written(lambda t: main(t) + chatter(t)))

    assert m.sub_contacts == 1
    assert m.total_contact_time == pytest.approx(10e-6, rel=1e-6)


@pytest.mark.parametrize("start", [4e-6, 4.0137e-6], ids=["with a record", "inside a record"])
def test_preload_does_not_spoil_the_restitution(start):
    """Known mean acceleration: the speed is carried back to the instant of separation."""
    external, length = -50.0, 12e-6
    m = measure_impact(written(half_sine(250.0, start, length), external=external))
    J = 250.0 * length * 2.0 / pi
    before = -0.5 + external * start / MASS
    after = -0.5 + (J + external * (start + length)) / MASS

    # touch is found to 1e-12 s, in which the preload gives 3e-8 m/s
    assert m.approach_speed == pytest.approx(-before, rel=1e-7)
    assert m.restitution == pytest.approx(-after / before, rel=1e-6)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, rel=1e-6)
    assert m.impulse_residual == pytest.approx(0.0, abs=1e-12)


def test_contact_that_has_not_ended_has_no_restitution():
    m = measure_impact(written(half_sine(100.0, 5e-6, 40e-6), duration=20e-6))

    assert np.isnan(m.restitution)
    assert m.contact_time == pytest.approx(15e-6, rel=1e-6)


def test_no_contact_is_an_error_that_says_what_to_do():
    with pytest.raises(InputError, match="gap / speed"):
        measure_impact(written(lambda t: 0.0 * t))


def test_shapes_that_do_not_fit_are_refused():
    history = written(half_sine(200.0, 3e-6, 14e-6))
    with pytest.raises(InputError, match=r"velocity_a: got shape \(4000,\)"):
        replace(history, velocity_a=history.velocity_a[:-1])


def test_a_history_does_not_deviate_from_itself():
    history = written(half_sine(200.0, 3e-6, 14e-6))
    d = compare_histories(history, history)

    values = (d.peak_force, d.contact_time, d.impulse, d.restitution, d.history_l2)
    assert values == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert d.third_octave_max_dB == 0.0
    assert d.third_octave_up_to_Hz > 100e3


def test_deviation_of_a_stronger_pulse_is_the_factor():
    a = written(half_sine(200.0, 3.000e-6, 14e-6), step=20e-9)
    b = written(half_sine(210.0, 5.013e-6, 14e-6), step=50e-9)  # later, coarser
    d = compare_histories(a, b)

    assert d.peak_force == pytest.approx(0.05, abs=2e-5)
    assert d.impulse == pytest.approx(0.05, rel=1e-9)
    assert d.contact_time == pytest.approx(0.0, abs=1e-6)
    # rms of 5 % of half a sine over its length
    assert d.history_l2 == pytest.approx(0.05 / np.sqrt(2.0), rel=1e-2)
    assert d.third_octave_max_dB == pytest.approx(20.0 * np.log10(1.05), abs=0.02)


def test_touch_alignment_takes_a_delay_out():
    a, b = (written(half_sine(200.0, start, 14e-6)) for start in (3.0e-6, 4.4567e-6))
    d = compare_histories(a, b)

    assert d.history_l2 < 1e-4
    assert d.third_octave_max_dB < 1e-3


TIME, MASS_TRUST, SPEED = 40e-6, 3e-3, 0.3


def run(
    level: str,
    *,
    steps: float,
    peak: float = 100.0,
    time: float = TIME,
    duration: float = 2 * TIME,
    shape=lambda x: np.sin(np.pi * x),
    frequency: float = 0.0,
    ringing: float = 0.0,
) -> LevelResult:
    """A pulse of ``time`` in so many steps, and a mode that rings afterwards."""
    step = time / steps
    middle = (np.arange(round(duration / step)) + 0.5) * step - 0.1 * time
    inside = (middle > 0) & (middle < time)
    force = np.where(inside, peak * shape(middle / time), 0.0)
    velocity = -SPEED + np.concatenate([[0.0], np.cumsum(force) * step / MASS_TRUST])
    initial = 0.5 * MASS_TRUST * SPEED**2
    body = BodyEnergy(
        name="needle",
        translation=0.5 * MASS_TRUST * velocity[-1] ** 2,
        vibration=ringing * initial,
        strain=0.0,
        frequency=np.array([frequency]),
        modal=np.array([ringing * initial]),
    )
    history = ImpactHistory(
        step=step,
        force=force,
        gap=np.zeros(len(force)),
        velocity_a=velocity,
        velocity_b=np.zeros(len(velocity)),
        speed=SPEED,
        mass_a=MASS_TRUST,
        mass_b=np.inf,
        ledger=EnergyLedger(initial=initial, bodies=(body,)),
    )
    return level_result(
        history, level=level, label=level, dofs=1, step=step, wall_time=0.0, setup_time=0.0
    )


@pytest.mark.parametrize(
    ("level", "key"),
    [("full", "full_step"), ("interface", "interface_step"), ("reduced", "reduced_step")],
)
def test_fewer_than_a_hundred_steps_per_contact_are_told(level, key):
    """With the step that keeps half a per cent, and the key that gives it."""
    assert run(level, steps=110).doubts == ()
    (doubt,) = run(level, steps=80).doubts
    assert "80 steps of 500 ns in a contact of 40 us" in doubt
    assert f"Try: run.{key}: 400 ns." in doubt


def test_the_shortest_contact_that_carries_counts():
    """A first contact of a quarter of the time, with a tenth of the impulse."""

    def two(x):
        first, second = x / 0.2, (x - 0.25) / 0.75
        return np.where(
            x < 0.2,
            0.5 * np.sin(np.pi * np.clip(first, 0, 1)),
            np.sin(np.pi * np.clip(second, 0, 1)),
        )

    (doubt,) = run("reduced", steps=200, shape=two).doubts
    assert "40 steps" in doubt
    assert run("reduced", steps=600, shape=two).doubts == ()


def test_many_contacts_of_which_none_carries_a_share_count_all():
    """25 half sines in one impact, of 4 % of its impulse and 80 steps each."""
    many = run("interface", steps=4000, shape=lambda x: np.maximum(np.sin(50 * np.pi * x), 0.0))
    assert many.measures.sub_contacts == 25
    (doubt,) = many.doubts
    assert "80 steps" in doubt


def test_a_mode_that_rings_needs_its_steps_only_in_the_full_order():
    """(omega h)^2 / 12 = 0.5 % at 26 steps per period; modal levels take modes exactly."""
    mode = {"frequency": 250e3, "ringing": 0.05}  # 4 us, 20 steps of 200 ns
    (doubt,) = run("full", steps=200, **mode).doubts
    assert "20 steps of 200 ns in a vibration of 250 kHz" in doubt
    assert run("full", steps=400, **mode).doubts == ()
    assert run("interface", steps=200, **mode).doubts == ()
    assert run("full", steps=200, frequency=250e3, ringing=0.001).doubts == ()


def test_a_front_within_a_few_steps_is_told():
    (doubt,) = run("full", steps=400, shape=np.ones_like).doubts
    assert "flat faces" in doubt


def test_a_run_cut_off_in_contact_is_no_reference():
    cut = run("full", steps=400, duration=0.5 * TIME)
    assert cut.measures.cut_off
    assert "ends before separation" in cut.doubts[0]
    results = {"full": cut, "reduced": run("reduced", steps=400)}
    assert best_level(results) == "reduced"
    assert deviations(results, "reduced") == {}


def test_a_coarse_full_order_measures_nobody():
    """It was called the reference with 3 % less peak force, 17 % at a longer step."""
    coarse, fine = run("full", steps=20, peak=97.0), run("reduced", steps=2000)
    results = {"reduced": fine, "full": coarse}

    assert best_level(results) == "reduced"
    notes = trust_notes(results, "reduced", deviations(results, "reduced"))
    assert any(
        "the answer is from level 'reduced'; level 'full' is not a reference" in n for n in notes
    )
    assert best_level({"full": coarse, "lumped": fine}) == "full"
    assert deviations({"full": coarse, "lumped": fine}, "full") == {}
    notes = trust_notes({"full": coarse, "lumped": fine}, "full", {})
    assert any("no level can be a reference" in note for note in notes)


def test_the_better_of_two_levels_that_disagree_is_the_answer():
    results = {
        "reduced": run("reduced", steps=500, peak=70.0),
        "interface": run("interface", steps=500, peak=110.0),
        "lumped": run("lumped", steps=500, peak=200.0),
    }
    assert best_level(results) == "interface"
    (note,) = trust_notes(results, "interface", deviations(results, "interface"))
    assert "level 'reduced' deviates by -36.4 % in peak force" in note
    close = results | {"reduced": run("reduced", steps=500, peak=109.5)}
    assert trust_notes(close, "interface", deviations(close, "interface")) == ()


MASS_SPEEDS, STEP, LOOK = 2.5e-3, 20e-9, 64  # fine steps between two records
SPEED_SPEEDS, ACCELERATION, JERK = 0.95, 1.2e4, 2e7  # towards the stop, at the time 0
FILM, RISE = 600.0, 0.4e-6  # its force at the touch, and how fast it grows
TOUCH, CONTACT, PEAK = 10e-6, 8e-6, 820.0
PULL, DECAY = 90.0, 0.6e-6

STOP = EndStop(gap=0.0, law=LinearStopLaw(kind="linear", stiffness=1e9))


def impulse(t):
    """Of film and contact until ``t`` [N s]."""
    before = FILM * RISE * exp((min(t, TOUCH) - TOUCH) / RISE)
    within = min(max(t - TOUCH, 0.0), CONTACT)
    after = max(t - TOUCH - CONTACT, 0.0)
    return (
        before
        + PEAK * CONTACT / pi * (1.0 - cos(pi * within / CONTACT))
        - PULL * DECAY * (1.0 - exp(-after / DECAY))
    )


def rate(t, share=1.0):
    """Speed of the gap, above zero when it opens."""
    return -SPEED_SPEEDS - ACCELERATION * t - 0.5 * JERK * t**2 + share * impulse(t) / MASS_SPEEDS


def event(rows, phase, share=1.0):
    """The impact, with records that begin a phase of fine steps late."""
    (found,) = events(rows, phase, share)
    return found


def events(rows, phase, share=1.0, scale=1.0, at_work=0.0):
    """Impacts of a motion of this scale, where the largest force is ``at_work`` [N]."""
    ends = STEP * np.arange(1201)
    force = np.diff([impulse(t) for t in ends]) / STEP
    touches = (ends[:-1] > TOUCH - 0.5 * STEP) & (ends[:-1] < TOUCH + CONTACT - 0.5 * STEP)
    steps = np.full((1200, 6), np.nan)
    steps[:, 0], steps[:, 1] = ends[:-1], STEP
    steps[:, 2] = np.where(touches, scale * force, 0.0)
    steps[:, 3] = np.where(touches, 0.0, scale * force)
    times = STEP * np.arange(phase, 1201, LOOK)
    rates = scale * np.array([[rate(t, share) for t in times]])
    finder = ImpactFinder(rows, 0.0, STEP)
    finder.feed(times, rates, [steps[steps[:, 0] < times[-1] - 0.5 * STEP]])
    return finder.events({"force": ChannelData(unit="N", values=np.array([0.0, -at_work]))})


@each("phase", range(0, LOOK, 7))
def test_speeds_do_not_depend_on_where_the_records_lie(phase):
    parts = {"needle": RigidMass(mass=MASS_SPEEDS), "stop": STOP}
    rows = Network(parts, [["needle.body", "stop.upper"], ["stop.lower", "ground"]]).rows()
    found = event(rows, phase)

    fastest = max(-rate(t) for t in STEP * np.arange(501))
    left = rate(TOUCH + CONTACT)
    assert -rate(0.0) < 0.98 * fastest
    assert found.approach_speed == pytest.approx(fastest, rel=1e-6)
    # where the film hands over to the contact: it has braked by 2.4 % of the speed since
    assert found.touch_speed == pytest.approx(-rate(TOUCH), rel=1e-4)
    assert found.touch_speed < 0.98 * fastest
    # the trend after it is that between two records: J h^2
    assert found.restitution == pytest.approx(left / fastest, abs=1e-4)


def test_an_arm_moves_its_lever_by_its_ratio():
    """A mass at the first arm is nine times as heavy at a third of it."""
    parts = {
        "lever": Lever(arms={"far": 30e-3, "near": 10e-3}, effective_mass=MASS_SPEEDS),
        "stop": STOP,
    }
    rows = Network(parts, [["lever.near", "stop.upper"], ["stop.lower", "ground"]]).rows()
    found = event(rows, 17, share=1.0 / 9.0)

    fastest = max(-rate(t, 1.0 / 9.0) for t in STEP * np.arange(501))
    assert found.approach_speed == pytest.approx(fastest, rel=1e-6)


def test_round_off_of_the_forces_at_work_hits_nothing():
    """Where nothing presses, a closed contact trembles: 1e-15 is the round-off of 1 N."""
    parts = {"needle": RigidMass(mass=MASS_SPEEDS), "stop": STOP}
    rows = Network(parts, [["needle.body", "stop.upper"], ["stop.lower", "ground"]]).rows()

    (weak,) = events(rows, 0, scale=1e-14 / PEAK, at_work=1.0)
    assert weak.peak_force == pytest.approx(1e-14, rel=1e-3, abs=0.0)  # a step is 1 / 400 of it
    assert events(rows, 0, scale=1e-15 / PEAK, at_work=1.0) == ()
    assert len(events(rows, 0, scale=1e-15 / PEAK)) == 1


TIME_TIMES = np.linspace(0.0, 10e-3, 10_001)
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
        TIME_TIMES,
        1e-6 * np.interp(TIME_TIMES, 1e-3 * at, lift),
        events,
        body="needle",
        ends=ends,
        stops=(("seat",), ("stop",)),
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
    assert all(0.0 <= t <= TIME_TIMES[-1] for t in known)
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


FREE = """
klack: 1
title: An armature that travels freely on its needle
network:
  components:
    needle: {type: rigid-mass, mass: 1.1 g, points: [tip, collar, ring]}
    armature: {type: rigid-mass, mass: 1.6 g, points: [top, bottom]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 2e8 N/m}, restitution: 0.5}
    carry: {type: end-stop, gap: 40 um, law: {kind: linear, stiffness: 2e8 N/m}, restitution: 0.5}
    rest: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 2e8 N/m}, restitution: 0.5}
    pole: {type: end-stop, gap: 100 um, law: {kind: linear, stiffness: 2e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 20 N/mm, preload: 25 N}
    coupling: {type: spring, stiffness: 3 N/mm, preload: 4 N}
    magnet:
      {type: force-over-time, time: [0 us, 100 us, 700 us, 800 us], force: [0 N, 60 N, 60 N, 0 N]}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [needle.collar, carry.upper, spring.end, coupling.base]
    - [needle.ring, rest.lower]
    - [armature.top, carry.lower, pole.lower, coupling.end, magnet.end]
    - [armature.bottom, rest.upper]
    - [pole.upper, ground]
run: {duration: 1.3 ms, step: 20 ns, record: 1 us, variants: [dry], lift: needle.tip}
"""
ON_HOUSING = FREE.replace("[needle.ring, rest.lower]", "[ground, rest.lower]")


def rows_of_free(text=FREE):
    return read_valve_case(text, Path("free.yaml")).network.network().rows()


@pytest.fixture(scope="module")
def free_run():
    rows = rows_of_free()
    return rows, simulate_network(rows, duration=1.3e-3, step=20e-9, record=1e-6)


@pytest.mark.parametrize("text", [FREE, ON_HOUSING], ids=["rest on needle", "rest on housing"])
def test_the_lift_of_a_carried_needle_is_that_of_its_armature_less_the_free_travel(text):
    """100 um less 40 um; with its rest on the housing, the needle has no stop above at all."""
    travel = Travel.of(rows_of_free(text))

    (low, high), (below, above) = travel.lift("needle")
    assert (low, high) == (0.0, pytest.approx(60e-6, rel=1e-9))
    assert (below[0], above[0]) == ("seat", "pole")
    (low, high), (below, above) = travel.lift("armature")
    assert (low, high) == (pytest.approx(0.0, abs=1e-15), pytest.approx(100e-6, rel=1e-9))
    assert (below[-1], above) == ("rest", ("pole",))


def test_a_stop_of_its_own_ends_the_lift_of_a_carried_body():
    own = StopBound("own", None, "needle", 80e-6)
    travel = Travel([*Travel.of(rows_of_free()).bounds, own])

    (low, high), (_, above) = travel.lift("needle")
    assert (low, high) == (0.0, pytest.approx(80e-6, rel=1e-9))
    assert above == ("own",)


@each("seed", range(30))
def test_the_lift_upside_down_is_the_same(seed: int):
    """A random chain, mirrored: its ends change places and signs."""
    rng = np.random.default_rng(seed)
    names: list[str | None] = [None, "a", "b", "c"]
    bounds = [StopBound("seat", "a", None, 1e-6 * float(rng.integers(0, 9)))]
    for k in range(int(rng.integers(2, 6))):
        upper, lower = (names[i] for i in rng.choice(4, 2, replace=False))
        bounds.append(StopBound(f"stop {k}", upper, lower, 1e-6 * float(rng.integers(0, 200))))
    turned = [StopBound(b.name, b.lower, b.upper, b.gap) for b in bounds]
    for body in ("a", "b", "c"):
        travel = Travel(bounds)
        if inf == travel.highest({body: 1.0})[0] == -travel.lowest({body: 1.0})[0]:
            continue  # no end to rest at: taken as closed, upside down too
        (low, high), _ = Travel(bounds).lift(body, 0.1e-6)
        (low_turned, high_turned), _ = Travel(turned).lift(body, -0.1e-6)
        assert (-high_turned, -low_turned) == pytest.approx((low, high), rel=1e-9, abs=1e-15)


def test_times_of_a_chain_lie_between_start_and_touch(free_run):
    rows, result = free_run
    touches = {}
    for found in result.events:
        touches.setdefault(found.stop, found.time)

    needle, armature = all_lift_times(result, rows, "needle", "tip")
    assert (needle.lift, armature.lift) == pytest.approx((60e-6, 100e-6), rel=1e-9)
    for times in (needle, armature):
        for way in (times.opening, times.closing):
            passed = [way.at_10, way.at_50, way.at_90]
            assert None not in passed
            assert max(passed) < way.touch
        assert times.opening.at_10 < times.opening.at_50 < times.opening.at_90
        assert times.closing.at_90 < times.closing.at_50 < times.closing.at_10
    assert needle.opening.touch == armature.opening.touch == touches["pole"]
    # the armature travels on freely behind its needle, down to its own stop
    assert needle.closing.touch == touches["seat"]
    assert armature.closing.stop == "rest"
    assert armature.closing.touch > needle.closing.touch


def test_only_undisturbed_impacts_have_a_restitution(free_run):
    """Truth: momentum.  Two bodies, changed by one stop, part by (J / m); by two, by more than J.

    The springs and the magnet, up to 90 N on 1.1 g, change the speed by 1.1 m/s in 14 us of the
    longest such contact, so what they do is taken out as the mean force about the impact.
    """
    _, result = free_run
    velocity = {body: result.channels[f"{body} velocity"].values for body in ("needle", "armature")}
    others = {"carry": ("seat", "pole", "rest"), "rest": ("seat", "pole", "carry")}
    clean, disturbed = 0, 0
    for found in result.events:
        if found.stop not in others or not found.is_over:
            continue
        record = [result.interfaces[stop] for stop in others[found.stop]]
        end = found.separation_time
        pressed = sum(
            float(np.sum((r.contact_force * r.step)[(r.time >= found.time) & (r.time < end)]))
            for r in record
        )
        if found.besides:
            disturbed += 1
            assert np.isnan([found.restitution, found.energy_loss]).all()
            assert pressed > 0.005 * found.impulse
        elif found.restitution > 0.0:
            clean += 1
            assert pressed < 0.02 * found.impulse
            before, after = np.searchsorted(result.time, [found.time, end])
            before -= 1
            rate = velocity["needle"] - velocity["armature"]
            if found.stop == "rest":
                rate = -rate
            change = float(rate[after] - rate[before])
            mu = 1 / 1.1e-3 + 1 / 1.6e-3
            drift = (result.time[after] - result.time[before]) * 90.0 * mu
            assert change == pytest.approx(mu * found.impulse, abs=drift)
    assert clean >= 3
    assert disturbed >= 1


def test_a_run_in_pieces_blanks_the_same_impacts(free_run):
    """Cut inside an impact that another stop disturbs, where only the first piece saw the other."""
    rows, whole = free_run
    disturbed = next(found for found in whole.events if found.besides)
    for share in (0.3, 0.9):
        cut = disturbed.time + share * (disturbed.separation_time - disturbed.time)
        cut = 1e-6 * np.ceil(cut / 1e-6)
        first = simulate_network(rows, duration=float(cut), step=20e-9, record=1e-6)
        rest = simulate_network(
            rows, duration=1.3e-3 - cut, step=20e-9, record=1e-6, state=first.state
        )
        found = {(e.stop, e.time): e.besides for e in (*first.events, *rest.events)}
        assert found == {(e.stop, e.time): e.besides for e in whole.events}


@pytest.mark.parametrize("law", [{"kind": "linear", "stiffness": 3e8}, None])
def test_a_body_that_hits_another_stop_within_a_microsecond_has_its_own_restitution(law):
    """Conservation: without losses it leaves each stop as fast as it came, 4 m/s over 5 um.

    Records are 1.28 us apart, so that the next contact lies in the first of them.  A step before
    the touch, of 2.5 ns at least, is 0.1 % of the contact.
    """
    stop = law or {"kind": "hertz", "radius": 0.01, "modulus": 115e9}
    parts = {
        "needle": RigidMass(mass=1e-4, speed=4.0, points=("low", "high")),
        "below": EndStop(gap=1e-6, law=stop),
        "above": EndStop(gap=4e-6, law=stop),
    }
    links = [
        ["needle.low", "below.upper"],
        ["below.lower", "ground"],
        ["needle.high", "above.lower"],
        ["above.upper", "ground"],
    ]
    result = simulate_network(
        Network(parts, links).rows(), duration=150e-6, step=5e-9, start="free"
    )
    found = [event for event in result.events if event.is_over]
    assert len(found) > 10
    for event in found:
        assert event.approach_speed == pytest.approx(4.0, rel=3e-3)
        assert event.restitution == pytest.approx(1.0, abs=3e-3)


@pytest.mark.slow
def test_the_first_impacts_of_a_chain_are_those_of_another_integration():
    """Elastic contacts, by Runge and Kutta with the touches as events (SciPy).

    The chain amplifies what differs; over the first ten impacts both agree to 2.4 ns.
    """
    text = FREE.replace(", restitution: 0.5", "")
    run = simulate_network(rows_of_free(text), duration=0.8e-3, step=5e-9, record=1e-6)
    stiffness, needle, armature = 2e8, 1.1e-3, 1.6e-3
    gaps = {
        "seat": lambda _, y: y[0],
        "carry": lambda _, y: 40e-6 + y[0] - y[1],
        "rest": lambda _, y: y[1] - y[0],
        "pole": lambda _, y: 100e-6 - y[1],
    }
    for gap in gaps.values():
        gap.direction = -1.0

    def rate(t, y):
        seat, carry, rest, pole = (stiffness * max(-gap(t, y), 0.0) for gap in gaps.values())
        magnet = np.interp(t, [0.0, 100e-6, 700e-6, 800e-6], [0.0, 60.0, 60.0, 0.0])
        coupling = 4.0 + 3e3 * (y[1] - y[0])
        on_needle = seat + carry - rest + coupling - 25.0 - 20e3 * y[0]
        on_armature = rest - carry - pole - coupling + magnet
        return [y[2], y[3], on_needle / needle, on_armature / armature]

    start = [-25.0 / stiffness, -29.0 / stiffness, 0.0, 0.0]
    events = list(gaps.values())
    found = solve_ivp(
        rate, (0.0, 0.8e-3), start, max_step=0.1e-6, rtol=1e-9, atol=1e-14, events=events
    )
    touches = dict(zip(gaps, found.t_events, strict=True))

    late = [float(np.min(np.abs(touches[e.stop] - e.time))) for e in run.events[:10]]
    assert {e.stop for e in run.events[:10]} >= {"carry", "pole", "rest"}
    assert max(late) < 10e-9


def drawn(rng: np.random.Generator) -> list[StopBound]:
    def gap() -> float:
        return float(np.exp(rng.uniform(np.log(1e-9), np.log(1e-2)))) if rng.random() < 0.8 else 0.0

    return [
        StopBound(
            f"stop {i}", *(("needle", None) if rng.random() < 0.5 else (None, "needle")), gap()
        )
        for i in range(rng.integers(1, 5))
    ]


@each("seed", range(100))
def test_the_nearest_stop_is_the_answer_of_the_programme(seed: int):
    rng = np.random.default_rng(seed)
    travel = Travel(drawn(rng))
    wanted = {"needle": float(rng.choice([1.0, -1.0, 2.5, rng.normal()]))}
    direct, whole = travel._of_one_body(wanted), travel._of_a_chain(wanted)
    assert direct is None or direct == whole
    assert travel.highest(wanted) == whole


def test_two_stops_equally_near_are_left_to_the_programme():
    bounds = [StopBound("a", None, "needle", 1e-4), StopBound("b", None, "needle", 1e-4)]
    assert Travel(bounds)._of_one_body({"needle": 1.0}) is None
    assert Travel(bounds).highest({"needle": 1.0})[0] == 1e-4


def test_a_body_between_moving_ones_is_left_to_the_programme():
    """An armature that pushes a needle: both ways add up."""
    chain = Travel(
        [StopBound("a", "needle", "armature", 2e-5), StopBound("b", None, "needle", 1e-4)]
    )
    assert chain._of_one_body({"armature": 1.0}) is None
    assert chain.highest({"armature": 1.0})[0] == pytest.approx(1.2e-4, rel=1e-12)
    assert chain.highest({"armature": -1.0})[0] == inf


def test_a_body_without_stops_goes_anywhere():
    travel = Travel([StopBound("a", None, "needle", 1e-4)])
    assert travel.highest({"housing": 1.0}) == travel._of_a_chain({"housing": 1.0}) == (inf, ())


def test_impacts_of_a_pair_lose_what_contact_and_friction_of_its_faces_lose():
    """Where several bodies meet point by point the balance has friction beside the contact."""
    losses = {
        "seat contact": 1.0,
        "driver contact": 2.0,
        "driver friction": 4.0,
        "guide friction": 8.0,
    }
    acting = [("seat", "needle"), ("seat", ""), ("driver", "needle"), ("driver", "armature")]
    variant = Of(
        moving=[Of(body="needle"), Of(body="armature")],
        acting=[Of(channel=f"{x} contact force", component=x, body=body) for x, body in acting],
        result=Of(books=Of(losses=losses), interfaces={"seat": None, "driver": None}, events=()),
    )
    lost = {name: found.lost for name, found in impacts_by_pair(variant)}
    assert lost == {
        "seat: needle on ground": 1.0,
        "driver: needle on armature": 6.0,
        "all of needle": 7.0,
        "all of armature": 6.0,
    }


@pytest.mark.parametrize("gap", [0.0, 1e-9])
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_a_body_that_starts_in_touch_strikes_with_its_speed(gap, speed):
    """Truth: a mass on a linear stop presses with v sqrt(k m); without a speed it rests there."""
    law = LinearStopLaw(kind="linear", stiffness=1e8)
    parts = {
        "needle": RigidMass(mass=MASS, speed=speed, points=("tip",)),
        "stop": EndStop(gap=gap, law=law),
        "push": ConstantForce(force=1e-6),
    }
    joints = (("needle.tip", "stop.lower", "push.end"), ("stop.upper", "ground"))

    found = simulate_network(Network(parts, joints).rows(), duration=60e-6, record=1e-6).events

    peaks = [speed * (1e8 * MASS) ** 0.5] if speed else []
    assert [event.peak_force for event in found] == pytest.approx(peaks, rel=5e-4)  # the promise
    assert [event.approach_speed for event in found] == pytest.approx([speed] * len(peaks))
