"""The interface level: rigid bodies, free flight.

Impacts of rigid bodies at the interface level; truth: rigid-body impact, mass on a spring.

A body that is hit at a distance r from its centre of mass acts like the mass 1/(1/m + r^2/J):

    e' = (1 + e) / (1 + m r^2 / J) - 1      (restitution of the centre of mass)

Jumps over free flight; truth: exact modal motion, and the same run in fine steps throughout.
"""

from dataclasses import replace
from math import inf, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.contact.restitution import find_contacts, measure_impact
from klack.simulation.propagator import modal_propagator
from klack.transient.interface_kernel import safe_flight
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import (
    free_rod,
    lateral_guide,
    modal_model,
    rigid_body,
    rod_between_stops,
    sphere_on_beam,
)

MASS, INERTIA, STIFFNESS = 2.96e-3, (2.3e-7, 2.3e-7, 5.9e-9), 1e8  # needle D4 x L30 mm


def bar(*points):
    return rigid_body(
        mass=MASS, inertia=INERTIA, points=np.array(points), stiffness=STIFFNESS, gap=1e-8
    )


@pytest.mark.parametrize(
    ("scale", "arm"),
    [(1.0, 0.0), (1.0, 1e-6), (1.0, 1e-3), (1.0, 2e-3), (1.0, 20e-3), (1e3, 0.5)],
)
def test_eccentric_rigid_bar(scale, arm):
    """Valve scale, an arm at which the centre goes on falling (20 mm), and a bar of metres."""
    mass, J = MASS * scale, INERTIA[1] * scale**3
    reduced = 1.0 / (1.0 / mass + arm**2 / J)
    duration = pi * sqrt(reduced / STIFFNESS)
    model = rigid_body(
        mass=mass,
        inertia=np.array(INERTIA) * scale**3,
        points=np.array([[arm, 0.0, 0.0]]),
        stiffness=STIFFNESS,
    )

    run = simulate_interface(model, speed=0.5, duration=1.1 * duration, step=duration / 4000)

    expected = 2.0 / (1.0 + mass * arm**2 / J) - 1.0
    end = run.motion.velocity[-1]
    assert end[2] / 0.5 == pytest.approx(expected, abs=1e-6)
    # the contact force turns the body about y: J omega = -arm P, P = m (v' + v)
    assert end[4] == pytest.approx(-arm * mass * 0.5 * (1.0 + expected) / J, rel=2e-6)
    assert run.history.force.max() == pytest.approx(0.5 * sqrt(STIFFNESS * reduced), rel=1e-6)
    assert measure_impact(run.history).contact_time == pytest.approx(duration, rel=1e-6)


@pytest.mark.parametrize("turn", [0.0, 0.5 * pi, 2.0, pi])
def test_direction_of_the_arm_turns_with_it(turn):
    arm = 2e-3 * np.array([np.cos(turn), np.sin(turn), 0.0])

    end = simulate_interface(bar(arm), speed=0.5, duration=25e-6, step=5e-9).motion.velocity[-1]
    assert end[2] / 0.5 == pytest.approx(2.0 / (1.0 + MASS * 4e-6 / INERTIA[0]) - 1.0, abs=1e-6)
    impulse = MASS * (end[2] + 0.5)
    assert end[3:] == pytest.approx(np.cross(arm, [0, 0, impulse]) / INERTIA, rel=1e-12)


def test_two_feet_share_a_centred_impact():
    """Springs in parallel: half sine of a mass on 2 k, no rotation."""
    run = simulate_interface(
        bar([2e-3, 0.0, 0.0], [-2e-3, 0.0, 0.0]), speed=0.5, duration=20e-6, step=4e-9
    )

    measures = measure_impact(run.history)
    assert measures.contact_time == pytest.approx(pi * sqrt(MASS / (2 * STIFFNESS)), rel=1e-6)
    assert measures.peak_force == pytest.approx(0.5 * sqrt(2 * STIFFNESS * MASS), rel=1e-6)
    assert run.motion.velocity[-1] == pytest.approx([0, 0, 0.5, 0, 0, 0], abs=1e-6)
    left, right = run.impacts[0].point_force.T
    np.testing.assert_allclose(left, right, rtol=1e-6)


def test_springs_of_two_feet_couple():
    """Off-diagonal compliance s: two feet pressed alike feel 1/k + s each."""
    model = bar([2e-3, 0.0, 0.0], [-2e-3, 0.0, 0.0])
    soft = 1.0 / STIFFNESS
    coupled = modal_model(
        masses=(MASS, inf),
        omega=model.omega,
        traces=model.traces,
        compliance=soft * np.array([[1.0, 0.4], [0.4, 1.0]]),
        gap=model.gap,
        rigid=model.rigid,
    )

    run = simulate_interface(coupled, speed=0.5, duration=20e-6, step=4e-9)

    stiffness = 2.0 * STIFFNESS / 1.4
    expected = pi * sqrt(MASS / stiffness)
    assert measure_impact(run.history).contact_time == pytest.approx(expected, rel=1e-6)


def test_constant_force_presses_during_contact():
    """Half period of a mass that hangs on a spring under F: v at the end is v again."""
    force = 40.0
    run = simulate_interface(
        bar([0.0, 0.0, 0.0]), speed=0.5, duration=30e-6, step=2e-9, force=force
    )

    omega = sqrt(STIFFNESS / MASS)
    speed = sqrt(0.5**2 + 2 * force / MASS * 1e-8)  # through the gap of 10 nm
    still = force / STIFFNESS
    peak = force + STIFFNESS * sqrt(still**2 + (speed / omega) ** 2)
    time = (pi + 2 * np.arctan(still * omega / speed)) / omega
    measures = measure_impact(run.history)
    assert measures.peak_force == pytest.approx(peak, rel=1e-6)
    assert measures.contact_time == pytest.approx(time, rel=1e-6)
    assert run.energy.residual == pytest.approx(0.0, abs=1e-6)


def test_spring_to_ground_swings_in_its_own_period():
    """No contact: z = -v / omega sin(omega t) about the start."""
    stiffness = 1e5
    omega = sqrt(stiffness / MASS)
    model = rigid_body(
        mass=MASS,
        inertia=INERTIA,
        points=np.zeros((1, 3)),
        stiffness=STIFFNESS,
        gap=1.0,
    )

    run = simulate_interface(
        model, speed=0.5, duration=0.5 * pi / omega, step=1e-7, spring_stiffness=stiffness
    )

    assert run.motion.position[-1, 2] == pytest.approx(-0.5 / omega, rel=1e-5)
    assert run.motion.velocity[-1, 2] == pytest.approx(0.0, abs=1e-3)  # last step of 1e-7 s
    assert abs(run.energy.residual) < 1e-12  # round-off of some 2700 steps


def modal_motion(omega, q, v, force, t):
    """Exact coordinates at times t under constant forces, shape (M, times)."""
    t = np.asarray(t)[None]
    q, v, f, w = (x[:, None] for x in (q, v, force, np.where(omega > 0, omega, 1.0)))
    swing = f / w**2 + (q - f / w**2) * np.cos(w * t) + v / w * np.sin(w * t)
    return np.where(omega[:, None] > 0, swing, q + v * t + 0.5 * f * t**2)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    seed=st.integers(0, 100_000),
    points=st.integers(1, 4),
    rigid=st.integers(1, 3),
    elastic=st.integers(0, 4),
    pull=st.booleans(),
)
def test_no_gap_closes_during_safe_flight(seed, points, rigid, elastic, pull):
    rng = np.random.default_rng(seed)
    omega = np.concatenate([np.zeros(rigid), rng.uniform(0.5, 20.0, elastic)])
    M = len(omega)
    traces, q, v = rng.standard_normal((points, M)), rng.standard_normal(M), rng.standard_normal(M)
    force = rng.standard_normal(M) if pull else np.zeros(M)
    gap0 = rng.uniform(0.0, 3.0, points) - np.minimum(traces @ q, 0.0)
    horizon = 5.0

    safe = safe_flight(gap0, traces, omega, q, v, force, horizon)

    assert 0.0 <= safe <= horizon
    t = np.linspace(0.0, safe, 400)
    gaps = gap0[:, None] + traces @ modal_motion(omega, q, v, force, t)
    assert safe == 0.0 or gaps.min() > -1e-9


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_rigid_flight_is_told_exactly(seed):
    """One falling point: the root of gap - v t - f t^2 / 2."""
    gap, speed, pull = np.random.default_rng(seed).uniform(0.01, 3.0, 3)

    safe = safe_flight(
        np.array([gap]),
        np.ones((1, 1)),
        np.zeros(1),
        np.zeros(1),
        np.array([-speed]),
        np.array([-pull]),
        100.0,
    )

    assert safe == pytest.approx((sqrt(speed**2 + 2 * pull * gap) - speed) / pull, rel=1e-12)


def test_what_rises_without_a_pull_never_touches():
    arguments = np.array([1e-6]), np.ones((1, 1)), np.zeros(1), np.zeros(1), np.ones(1), np.zeros(1)

    assert safe_flight(*arguments, 7.0) == 7.0


def test_a_swing_as_wide_as_the_gap_is_not_safe():
    """Amplitude 1 about 0, gap 0.99 and 1.01."""
    arguments = np.ones((1, 1)), np.array([3.0]), np.array([0.6]), np.array([2.4]), np.zeros(1)

    assert safe_flight(np.array([0.99]), *arguments, 7.0) == 0.0
    assert safe_flight(np.array([1.01]), *arguments, 7.0) == 7.0


def bounces(model, flight, **more):
    settings_ = {"speed": 0.2, "duration": 1.2e-3, "force": 8.0, "points": False} | more
    return simulate_interface(model, flight=flight, **settings_)


def test_jumping_changes_nothing():
    """Rod with ten modes under a constant force: every impact at its time, with its force.

    Both runs keep to one grid of time; only round-off is left, which impacts amplify.
    """
    model = free_rod(10, stiffness=1e8, gap=5e-6)

    fine, jumped = bounces(model, False), bounces(model, True)

    assert len(jumped.impacts) >= 4
    assert jumped.steps < 0.6 * fine.steps
    for segment in jumped.impacts:
        history = segment.history
        first = round(history.start / fine.history.step)
        same = slice(first, first + len(history.force))
        np.testing.assert_allclose(
            history.force, fine.history.force[same], atol=1e-6 * history.force.max()
        )
        np.testing.assert_allclose(
            history.velocity_a, fine.history.velocity_a[first : same.stop + 1], atol=1e-7
        )
    everywhere = sum(segment.history.impulse for segment in jumped.impacts)
    assert everywhere == pytest.approx(fine.history.impulse, rel=1e-7)
    np.testing.assert_allclose(jumped.motion.velocity[-1], fine.motion.velocity[-1], atol=1e-6)


def test_jumping_with_a_tilted_body_changes_nothing():
    """Rigid body on four feet that rocks from foot to foot."""
    feet = 2e-3 * np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    model = rigid_body(mass=3e-3, inertia=(2e-8, 2e-8, 1e-8), points=feet, stiffness=1e7, gap=5e-6)
    tilt = np.array([0.0, 0.0, 0.0, 3e-4, -1e-4, 0.0])

    fine, jumped = (bounces(model, flight, offset=tilt, duration=2e-3) for flight in (False, True))

    assert len(jumped.impacts) >= 2
    assert jumped.steps < fine.steps
    for segment in jumped.impacts:
        first = round(segment.history.start / fine.history.step)
        v = fine.history.velocity_a[first : first + len(segment.history.velocity_a)]
        # round-off grows tenfold with every foot that lands
        np.testing.assert_allclose(segment.history.velocity_a, v, atol=1e-6)
    np.testing.assert_allclose(jumped.motion.velocity[-1], fine.motion.velocity[-1], atol=1e-5)


def test_both_stops_are_met_at_their_times():
    """No force: alternating impacts, the flight between them at the speed of the rebound."""
    model = rod_between_stops(6, stiffness=1e9, gaps=(40e-6, 60e-6))

    run = simulate_interface(model, speed=0.5, duration=1.5e-3, flight=True)

    assert [segment.contact for segment in run.impacts][:4] == ["seat", "stop", "seat", "stop"]
    first = measure_impact(run.impacts[0].history)
    second = measure_impact(run.impacts[1].history)
    assert first.first_touch == pytest.approx(40e-6 / 0.5, rel=1e-6)
    assert second.approach_speed == pytest.approx(first.rebound_speed, rel=1e-9)
    # a record sees the other body below; the stop pushes down
    assert [segment.side for segment in run.impacts][:4] == [1.0, -1.0, 1.0, -1.0]
    assert run.impacts[1].velocity[2] == -run.impacts[1].history.velocity_a[0] > 0.0
    for segment in run.impacts:
        assert measure_impact(segment.history).impulse_residual == pytest.approx(0.0, abs=1e-9)


def test_the_run_stops_after_so_many_impacts():
    run = bounces(free_rod(4, stiffness=1e8, gap=5e-6), True, impacts=2, duration=1.0)

    assert len(run.impacts) == 2
    assert run.motion.time[-1] < 5e-3


def test_sub_impacts_are_one_impact_while_the_longest_mode_still_swings():
    """Sphere on a beam: open for 119 us between its first two contacts.

    An impact is over when nothing has touched for 50 us, or two periods of the longest mode.
    """
    model = sphere_on_beam().model()
    slow = replace(model, longest_period=80e-6)
    run = {"speed": 0.5, "duration": 1e-3, "step": 1e-6, "flight": True, "points": False}

    apart, together = (simulate_interface(m, **run).impacts for m in (model, slow))

    assert len(apart) == 2
    assert [len(find_contacts(impact.history)) for impact in apart] == [1, 1]
    first = apart[0].history
    assert 49e-6 < first.edges[-1] - find_contacts(first)[0].end < 53e-6
    assert [len(find_contacts(impact.history)) for impact in together] == [2]


def test_damping_is_booked_in_flight_and_in_contact():
    rod = free_rod(6, stiffness=1e8, gap=5e-6)
    damped = modal_model(
        masses=rod.masses,
        omega=rod.omega,
        traces=rod.traces,
        compliance=rod.compliance,
        gap=rod.gap,
        damping=np.where(rod.omega > 0, 0.01, 0.0),
    )

    fine, jumped = bounces(damped, False), bounces(damped, True)

    for run in (fine, jumped):
        assert run.energy.damping > 1e-3 * run.energy.initial
        assert run.energy.residual == pytest.approx(0.0, abs=1e-5)
    assert jumped.energy.damping == pytest.approx(fine.energy.damping, rel=1e-5)


def test_gaps_follow_the_geometry_over_many_impacts():
    """A floor that falls by 1 um per mm to the right, unknown to the traces of the model."""
    model = rigid_body(
        mass=3e-3, inertia=(1e-8,) * 3, points=np.zeros((1, 3)), stiffness=1e8, gap=10e-6
    )
    asked = []

    def gaps(placement):
        asked.append(placement)
        return np.array([10e-6 + placement[2] + 1e-3 * placement[0]])

    run = simulate_interface(
        model,
        speed=0.2,
        duration=3e-3,
        force=4.0,
        velocity=np.array([0.1, 0, 0, 0, 0, 0]),
        gaps=gaps,
        flight=True,
    )

    assert len(run.impacts) > 5
    for segment in run.impacts:
        touch = measure_impact(segment.history).first_touch - segment.history.start
        x, z = segment.position[0] + 0.1 * touch, segment.position[2]
        z += segment.velocity[2] * touch - 0.5 * 4.0 / 3e-3 * touch**2
        # within an impact the gaps are linear: it slides on by less than 1 um per 10 us
        assert 10e-6 + z + 1e-3 * x == pytest.approx(0.0, abs=2e-9)
    assert len(asked) < 10 * len(run.impacts)
    assert run.motion.position[-1, 0] == pytest.approx(0.1 * run.motion.time[-1], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("flight", [False, True])
def test_a_guided_body_meets_its_bore_in_flight(flight):
    """Lateral speed 0.1 m/s, clearance 4 um: the bore is met long before the seat."""
    model = rigid_body(
        mass=3e-3, inertia=(2e-7, 2e-7, 6e-9), points=np.zeros((1, 3)), stiffness=1e9, gap=1e-4
    )
    run = simulate_interface(
        model,
        speed=0.1,
        duration=8e-4,
        guide=lateral_guide(model, clearance=4e-6, stiffness=1e7),
        velocity=np.array([0.1, 0, 0, 0, 0, 0]),
        flight=flight,
    )

    assert np.abs(run.motion.position[:, 0]).max() < 4e-6 + 1.01 * 0.1 * sqrt(3e-3 / 1e7)
    assert abs(run.motion.velocity[-1, 0]) <= 0.1 * (1 + 1e-6)
    assert run.energy.residual == pytest.approx(0.0, abs=1e-12)
    assert abs(run.energy.guide) < 1e-5 * run.energy.initial


def test_a_body_that_flies_away_has_no_impacts():
    model = modal_model(
        masses=(1e-3, inf),
        omega=np.zeros(1),
        traces=np.array([[1e-3**-0.5]]),
        compliance=np.array([[1e-9]]),
        gap=np.array([1e-6]),
    )

    run = simulate_interface(
        model, speed=0.0, duration=1e-2, velocity=np.array([0, 0, 0.3, 0, 0, 0]), flight=True
    )

    assert run.impacts == ()
    assert run.motion.position[-1, 2] == pytest.approx(0.3 * run.motion.time[-1], rel=1e-12)


def test_in_steps_the_bodies_move_as_by_the_trapezoidal_rule():
    """A step as defined, (2/h)^2 (u1 - u0 - h v0) + w^2 (u0 + u1) = 2 f; equal to round-off."""
    h, model = 2e-7, free_rod(10, stiffness=1e9)
    rng = np.random.default_rng(3)
    rule = model.in_steps(h)
    P = modal_propagator(rule.omega, rule.damping, h)
    u, v = np.zeros((2, model.mode_count))
    q, p = np.zeros((2, model.mode_count))

    for force in rng.uniform(0.0, 100.0, 200):
        f = model.traces[0] * force
        u1 = (2 * f + 4 / h**2 * (u + h * v) - model.omega**2 * u) / (4 / h**2 + model.omega**2)
        v, u = 2 / h * (u1 - u) - v, u1
        f = rule.traces[0] * force
        q, p = P.A11 * q + P.A12 * p + P.B1 * f, P.A21 * q + P.A22 * p + P.B2 * f

        assert rule.traces @ q == pytest.approx(model.traces @ u, rel=1e-10, abs=0.0)
    assert model.omega[-1] * h > 0.2  # far from the exact motion
