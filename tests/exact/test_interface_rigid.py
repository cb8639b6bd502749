"""Impacts of rigid bodies at the interface level; truth: rigid-body impact, mass on a spring.

A body that is hit at a distance r from its centre of mass acts like the mass 1/(1/m + r^2/J):

    e' = (1 + e) / (1 + m r^2 / J) - 1      (restitution of the centre of mass)
"""

from math import inf, pi, sqrt

import numpy as np
import pytest

from klack.contact.restitution import measure_impact
from klack.transient.interface_model import InterfaceContact
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import modal_model, reduce_bodies, rigid_body
from klack.verification.transient import block_on_pad

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


@pytest.mark.parametrize("arm", [0.0, 1e-3, 4e-3])
def test_block_on_a_soft_pad_is_nearly_rigid(arm):
    """Steel block of finite elements on a pad of 0.2 mm, 1000 times softer than the block.

    The pad tilts with the block, so its resultant wanders inwards by (width^2/12) m r/(J + m r^2),
    0.2 um of 4 mm; the waves in the block cost less than 1e-6.
    """
    block, pad, space = block_on_pad(arm)
    model, _ = reduce_bodies(
        (block, pad),
        [InterfaceContact(name="pad", upper="block", lower="pad", space=space)],
        (10, 0),
    )
    mass, J = block.mass, block.inertia[1, 1]
    duration = pi * sqrt(mass / (1e9 * 0.4e-3))

    run = simulate_interface(model, speed=0.1, duration=1.2 * duration, step=duration / 4000)

    expected = 2.0 / (1.0 + mass * arm**2 / J) - 1.0
    end = run.motion.velocity[-1]
    energy = 0.5 * mass * end[2] ** 2 + 0.5 * J * end[4] ** 2
    assert end[2] / 0.1 == pytest.approx(expected, abs=1e-4)
    assert energy == pytest.approx(0.5 * mass * 0.01, rel=1e-6)
