"""A free needle hits a seat off its axis, at points on rings: momentum, energy, reciprocity.

Truth: Newton's laws; the forces are summed over the hats of the half section, without orders.
"""

from dataclasses import replace

import numpy as np
import pytest

from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.restitution import measure_impact
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.transient.interface_model import InterfaceBody, InterfaceContact, interface_model
from klack.transient.interface_run import simulate_interface
from klack.transient.revolved_model import reduced_bodies
from klack.verification.ring_bodies import NeedleOnRing, impulse_on_needle, momentum_of_needle

pytestmark = pytest.mark.slow

STEP = 40e-9
ASIDE = np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])


@pytest.fixture(scope="module")
def pair():
    return NeedleOnRing()


def hit(model, speed=0.1):
    return simulate_interface(model, speed=speed, duration=90e-6, step=STEP)


@pytest.mark.parametrize("count", [12, 13])
def test_momentum_and_moment_about_the_centre_of_mass(pair, count):
    space, _ = pair.placed(count, ASIDE)
    result = hit(pair.model(space, axial=6, others=8))

    gained = momentum_of_needle(pair, result.motion.velocity[-1] - result.motion.velocity[0])
    pushed = impulse_on_needle(pair, space, result, STEP)

    # point forces are kept in single precision
    np.testing.assert_allclose(gained[:3], pushed[:3], atol=3e-7 * np.abs(pushed[:3]).max())
    np.testing.assert_allclose(gained[3:], pushed[3:], atol=3e-7 * np.abs(pushed[3:]).max())
    assert np.hypot(*pushed[:2]) > 0.02 * pushed[2]  # pushed aside
    assert np.abs(pushed[3:5]).min() > 0.01 * np.abs(pushed[3:5]).max()
    assert abs(result.energy.residual) < 1e-10
    assert len(result.impacts) == 1
    assert 0.5 < measure_impact(result.history).restitution < 1.0


def test_statics_are_reciprocal_and_those_of_every_order(pair):
    space, _ = pair.placed(12, ASIDE)
    for friction in (None, Friction(kinetic=0.2, static=0.2)):
        model = pair.model(space, axial=3, others=4, friction=friction)
        assert model.checks.reciprocity < 1e-12
        assert model.checks.static_limit < 1e-11
        assert model.checks.lowest_pivot > 0
        assert len(model.compliance) == (1 if friction is None else 3) * model.count


def test_bodies_on_their_own_add_up_to_the_model(pair):
    """What a model of a whole valve takes: rigid motions, modes, traces, residual compliance."""
    space, _ = pair.placed(12, ASIDE)
    model = pair.model(space, axial=3, others=4)
    (needle, seat), _ = reduced_bodies(pair.revolved(3, 4), [pair.contact(space)])

    # the mean of both triangles is what the model takes
    residual = needle.residual + seat.residual
    np.testing.assert_allclose(residual, model.compliance, atol=1e-12 * np.abs(residual).max())
    assert list(needle.order[:6]) == [0, 0, 1, 1, 1, 1]
    assert np.all(needle.body.omega[:6] == 0.0)
    assert np.all(needle.body.omega[6:] > 0.0)
    assert np.linalg.matrix_rank(needle.body.rigid) == 6
    assert needle.body.traces.shape == (len(space.gap), 6 + 3 + 4)
    assert not np.isfinite(seat.body.mass)
    assert seat.body.traces.shape == (len(space.gap), 3 + 4)
    pairs = needle.body.omega[9:].reshape(-1, 2)
    np.testing.assert_array_equal(pairs[:, 0], pairs[:, 1])
    assert np.all(np.diff(pairs[:, 0]) > 0)


@pytest.mark.parametrize("count", [9, 10])
@pytest.mark.parametrize("friction", [None, 0.15])
def test_a_centred_impact_is_that_of_the_half_section(pair, count, friction):
    """Rings of any number of points against one point per ring, with and without friction."""
    law = None if friction is None else Friction(kinetic=friction, static=friction)
    space, _ = pair.placed(count, np.zeros(6))
    assert len(space.gap) == count * len(np.unique(space.ring))
    rings = hit(pair.model(space, axial=6, others=8, friction=law))

    keep = np.isin(np.arange(pair.section.count), space.ring)
    section = pair.section.restricted(keep)
    lift = float(np.min(section.gap / section.axial))
    contact = InterfaceContact(
        name="seat",
        upper=pair.bodies[0].name,
        lower=pair.bodies[1].name,
        space=section.shifted(-lift),
        faces=None if law is None else FaceFriction.on(law, section, *pair.sides),
    )
    bodies = []
    for body in pair.bodies:
        modes = eigenmodes(body, count=6)
        item = InterfaceBody(
            body=body, flexibility=Flexibility(body), modes=modes, damping=np.zeros(6)
        )
        bodies.append(item)
    plane = hit(interface_model(bodies, [contact]))

    ours, theirs = measure_impact(rings.history), measure_impact(plane.history)
    assert ours.peak_force == pytest.approx(theirs.peak_force, rel=1e-6)
    assert ours.contact_time == pytest.approx(theirs.contact_time, rel=1e-6)
    assert ours.restitution == pytest.approx(theirs.restitution, abs=1e-6)
    np.testing.assert_allclose(rings.motion.velocity[-1][[0, 1, 3, 4, 5]], 0.0, atol=1e-9)


def test_the_number_of_angles_converges_fast(pair):
    """A ring that is loaded unevenly: 24 points against 48."""
    peaks = {}
    for count in (24, 48):
        space, _ = pair.placed(count, ASIDE)
        peaks[count] = measure_impact(hit(pair.model(space, axial=6, others=8)).history)
    assert peaks[24].peak_force == pytest.approx(peaks[48].peak_force, rel=2e-3)
    assert peaks[24].restitution == pytest.approx(peaks[48].restitution, abs=1e-3)


def test_all_others_up_to_a_frequency_are_kept(pair):
    """Truth: eigenvalues of each order alone; both motions of an order count."""
    below = 2.0 * np.pi * 400e3
    space, _ = pair.placed(12, ASIDE)
    bodies = [replace(body, others=None, below=below) for body in pair.revolved(3, 4)]
    reduced, _ = reduced_bodies(bodies, [pair.contact(space)])
    for number, item in enumerate(reduced):
        low = {
            order: eigenmodes(pair.in_order(number)(order), max_frequency=400e3).omega
            for order in range(1, 6)
        }
        expected = sorted(w for values in low.values() for w in values for _ in range(2))
        others = item.body.omega[(item.order > 0) & (item.body.omega > 0.0)]
        assert len(expected) > 8
        assert item.order.max() > number  # of the seat, beyond bending
        np.testing.assert_allclose(np.sort(others), expected, rtol=1e-9)
