"""Speeds of an impact between two records: a film stops a needle within less than their spacing.

Truth: a motion made up in closed form, of even acceleration by all other forces, a film that grows
and pulls exponentially, and a contact of a half sine; wherever the records lie.
"""

from math import cos, exp, pi

import numpy as np
import pytest
from draws import each

from klack.mechanics.end_stop import EndStop
from klack.mechanics.lever import Lever
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.network import Network
from klack.simulation.impact_events import ImpactFinder
from klack.simulation.network_result import ChannelData

MASS, STEP, LOOK = 2.5e-3, 20e-9, 64  # fine steps between two records
SPEED, ACCELERATION, JERK = 0.95, 1.2e4, 2e7  # towards the stop, at the time 0
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
    return -SPEED - ACCELERATION * t - 0.5 * JERK * t**2 + share * impulse(t) / MASS


def event(rows, body, phase, share=1.0):
    """The impact, with records that begin a phase of fine steps late."""
    (found,) = events(rows, body, phase, share)
    return found


def events(rows, body, phase, share=1.0, scale=1.0, at_work=0.0):
    """Impacts of a motion of this scale, where the largest force is ``at_work`` [N]."""
    ends = STEP * np.arange(1201)
    force = np.diff([impulse(t) for t in ends]) / STEP
    touches = (ends[:-1] > TOUCH - 0.5 * STEP) & (ends[:-1] < TOUCH + CONTACT - 0.5 * STEP)
    steps = np.full((1200, 6), np.nan)
    steps[:, 0], steps[:, 1] = ends[:-1], STEP
    steps[:, 2] = np.where(touches, scale * force, 0.0)
    steps[:, 3] = np.where(touches, 0.0, scale * force)
    times = STEP * np.arange(phase, 1201, LOOK)
    speeds = {body: scale * np.array([rate(t, share) for t in times])}
    finder = ImpactFinder(rows, 0.0, STEP)
    finder.feed(times, speeds, [steps[steps[:, 0] < times[-1] - 0.5 * STEP]])
    return finder.events({"force": ChannelData(unit="N", values=np.array([0.0, -at_work]))})


@each("phase", range(0, LOOK, 7))
def test_speeds_do_not_depend_on_where_the_records_lie(phase):
    parts = {"needle": RigidMass(mass=MASS), "stop": STOP}
    rows = Network(parts, [["needle.body", "stop.upper"], ["stop.lower", "ground"]]).rows()
    found = event(rows, "needle", phase)

    fastest = max(-rate(t) for t in STEP * np.arange(501))
    left = rate(TOUCH + CONTACT)
    assert -rate(0.0) < 0.98 * fastest
    assert found.approach_speed == pytest.approx(fastest, rel=1e-6)
    # the trend after it is that between two records: J h^2
    assert found.restitution == pytest.approx(left / fastest, abs=1e-4)


def test_an_arm_moves_its_lever_by_its_ratio():
    """A force at a third of the first arm: that one moves by a third as much."""
    parts = {"lever": Lever(arms={"far": 30e-3, "near": 10e-3}, effective_mass=MASS), "stop": STOP}
    rows = Network(parts, [["lever.near", "stop.upper"], ["stop.lower", "ground"]]).rows()
    found = event(rows, "lever", 17, share=1.0 / 3.0)

    fastest = max(-rate(t, 1.0 / 3.0) for t in STEP * np.arange(501))
    assert found.approach_speed == pytest.approx(fastest, rel=1e-6)


def test_round_off_of_the_forces_at_work_hits_nothing():
    """Where nothing presses, a closed contact trembles: 1e-15 is the round-off of 1 N."""
    parts = {"needle": RigidMass(mass=MASS), "stop": STOP}
    rows = Network(parts, [["needle.body", "stop.upper"], ["stop.lower", "ground"]]).rows()

    (weak,) = events(rows, "needle", 0, scale=1e-14 / PEAK, at_work=1.0)
    assert weak.peak_force == pytest.approx(1e-14, rel=1e-3, abs=0.0)  # a step is 1 / 400 of it
    assert events(rows, "needle", 0, scale=1e-15 / PEAK, at_work=1.0) == ()
    assert len(events(rows, "needle", 0, scale=1e-15 / PEAK)) == 1
