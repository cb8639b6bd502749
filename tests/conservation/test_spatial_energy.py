"""Energy and momentum off the axis.

Energy of a needle that meets stops and guide off its axis, driven by elements.

Truth: what came in is held or lost, to round-off, whatever the steps; a run in two parts is the run
in one.

A free needle hits a seat off its axis, at points on rings: momentum, energy, reciprocity.

Truth: Newton's laws; the forces are summed over the hats of the half section, without orders.

Half sections off their axis in a network: momentum, its moment, energy. Truth: Newton's laws.
"""

from dataclasses import replace

import numpy as np
import pytest
from energy_ledger import allowed
from spatial_needle import ABOVE, BELOW, LIFT, Needle, move, ring

from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.restitution import measure_impact
from klack.mechanics.force import ForceOverTime
from klack.mechanics.spring import Spring
from klack.simulation.network_result import NetworkResult
from klack.transient.interface_model import InterfaceBody, InterfaceContact, interface_model
from klack.transient.interface_run import simulate_interface
from klack.transient.revolved_model import reduced_bodies
from klack.verification.ring_bodies import (
    NeedleOnRing,
    RingStroke,
    impulse_on_needle,
    momentum_of_needle,
)

pytestmark = pytest.mark.slow


NEEDLE = Needle(
    seat=ring(8, 0.6e-3, BELOW),
    stop=ring(8, 2e-3, ABOVE),
    ports={"top": (0.1e-3, 0.2e-3, 6e-3)},
).with_modes()
RUBS = replace(NEEDLE, friction=(0.1, 0.2), half_angle=1.0, coupling=0.15)


def stroke(
    duration: float, friction: float = 0.15, needle: Needle = NEEDLE, **more: object
) -> NetworkResult:
    """Opens and closes, leaning on its guide."""
    joints = {
        "top": Spring(stiffness=200e3, preload=12.0, damping=2.0),
        "land": ForceOverTime(time=(0.0, 1e-6, 200e-6, 201e-6), force=(0.0, 45.0, 45.0, 0.0)),
    }
    placed = np.array([1e-7, -5e-8, 0.0, 2e-5, 3e-5, 0.0])
    valve = needle.valve(placement=placed, guide=needle.guide(friction=friction, clearance=0.2e-6))
    return move(needle.rows(joints), valve, duration, **more)


@pytest.mark.parametrize(("step", "coarse"), [(40e-9, 1), (40e-9, None), (20e-9, None)])
def test_energy_of_a_stroke_off_its_axis_closes(step, coarse):
    run = stroke(330e-6, step=step, coarse=coarse)

    books, land = run.books, run.channels["needle.land displacement"].values
    # points of the stop are as far as its mean, but for the tilt: 1 um
    np.testing.assert_allclose(run.channels["opening gap"].values, LIFT - land, atol=1e-6)
    assert {event.stop for event in run.events} == {"seat", "opening"}
    assert books.losses["guide friction"] > 1e-3 * books.scale
    assert max(run.channels[f"guide {k} force"].values.max() for k in (1, 2)) > 1.0
    # round-off of some 1e4 steps, and what the last one did not settle
    assert abs(books.residual) < 1e-11 * books.scale


@pytest.mark.parametrize(
    ("mu", "step", "coarse"), [(0.1, 40e-9, 1), (0.3, 20e-9, None), (0.8, 40e-9, None)]
)
def test_energy_of_faces_that_rub_closes(mu, step, coarse):
    needle = replace(RUBS, friction=(mu, 0.5 * mu))
    books = stroke(330e-6, needle=needle, step=step, coarse=coarse).books

    assert abs(books.residual) < 1e-11 * books.scale
    for stop in ("seat", "opening"):
        assert books.losses[f"{stop} friction"] > 1e-3 * books.scale


def test_a_needle_that_comes_to_rest_sticks_without_loss():
    """Its modes still ring: what pays the debts of the contact must not count as slip."""
    needle = Needle(
        seat=ring(8, 0.6e-3, BELOW), stop=ring(8, 2e-3, ABOVE), friction=(0.2, 0.2), half_angle=1.05
    ).with_modes()
    joints = {
        "tip": Spring(stiffness=200e3, preload=12.0, damping=60.0),
        "land": ForceOverTime(time=(0.0, 1e-6, 200e-6, 201e-6), force=(0.0, 45.0, 45.0, 0.0)),
    }
    placed = np.array([1e-7, 0.0, 0.0, 2e-5, 0.0, 0.0])

    run = move(needle.rows(joints), needle.valve(placement=placed), 2.4e-3)

    assert abs(run.books.residual) < 1e-10 * run.books.scale  # 1e-7 where payments slip
    assert run.channels["seat contact force"].values[-1] > 10.0
    assert run.books.losses["seat friction"] > 1e-3 * run.books.scale


def test_a_run_in_two_parts_of_faces_that_rub():
    """The first part ends while the needle leaves its seat; then within its impact there."""
    for parts in ((1, 40), (200, 25)):
        first, second = (count * 1.28e-6 for count in parts)
        with allowed("simulate_network", 1e-6):  # a contact owes what its next step pays
            whole = stroke(first + second, needle=RUBS)
            before = stroke(first, needle=RUBS)
            after = stroke(second, needle=RUBS, state=before.state)

        assert np.any(before.state["moving.friction"] != 0.0)
        for name, channel in whole.channels.items():
            start = len(before.time) - 1
            now, then = after.channels[name].values, channel.values[start:]
            scale = np.abs(channel.values).max()
            np.testing.assert_allclose(now, then, rtol=1e-6, atol=1e-6 * scale, err_msg=name)
        lost = [run.books.losses["seat friction"] for run in (whole, before, after)]
        assert lost[0] == pytest.approx(lost[1] + lost[2], rel=1e-6)
        assert lost[2] > 0.0


def test_a_shaft_that_does_not_rub_loses_next_to_nothing_in_its_guide():
    """The bore is elastic: what a step of 40 ns loses or gains there is numerical."""
    books = stroke(330e-6, friction=0.0, step=20e-9).books

    assert abs(books.losses["guide friction"]) < 1e-3 * books.scale


@pytest.mark.parametrize("parts", [(40, 270), (120, 190), (163, 147)])
def test_a_run_in_two_parts_is_the_run_in_one(parts):
    """Bit by bit up to the next contact; in contact the order of the points is another."""
    first, second = (count * 1.28e-6 for count in parts)
    whole = stroke(first + second)

    before = stroke(first)
    after = stroke(second, state=before.state)

    for name, channel in whole.channels.items():
        start = len(before.time) - 1
        earlier = before.channels[name].values  # interpolated within other ends: round-off
        np.testing.assert_allclose(channel.values[: start + 1], earlier, rtol=1e-12, atol=1e-20)
        now, then = after.channels[name].values[:8], channel.values[start : start + 8]
        np.testing.assert_allclose(now, then, rtol=1e-9, atol=1e-9 * np.abs(channel.values).max())
    assert after.books.scale > 0.0


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


VELOCITY = np.array([1e-3, 2e-3, 0.0, 3.0, -2.0, 50.0])  # [m/s], [rad/s]


@pytest.fixture(scope="module")
def stroke_stroke():
    placement = np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])
    return RingStroke(pair=NeedleOnRing(), placement=placement)


def test_a_free_flight_keeps_momentum_and_its_moment(stroke_stroke):
    result = stroke_stroke.fly(speed=-0.1, duration=50e-6, velocity=VELOCITY)

    expected = VELOCITY + np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    # momentum and its moment are these times mass and inertia: no force acts
    np.testing.assert_allclose(result.path.velocity[-1], expected, rtol=1e-11)
    moved = result.path.position[-1] - result.path.position[0]
    np.testing.assert_allclose(moved, expected * result.path.time[-1], rtol=1e-11)


def test_an_eccentric_impact_takes_the_momentum_that_it_gives(stroke_stroke):
    result = stroke_stroke.fly(speed=0.1, duration=90e-6)

    (event,) = result.events
    change = result.path.velocity[-1] - result.path.velocity[0]
    assert change[2] * stroke_stroke.pair.bodies[0].mass == pytest.approx(event.impulse, rel=1e-9)
    assert np.hypot(*change[:2]) > 0.02 * change[2]  # it is pushed aside
    assert abs(result.books.relative_residual) < 1e-11


def test_a_guide_with_friction_spins_the_needle_and_loses_what_is_missing(stroke_stroke):
    guide = stroke_stroke.guide(clearance=0.6e-6, friction=0.1)
    result = stroke_stroke.fly(speed=0.1, duration=400e-6, guide=guide)

    assert np.min(np.max(result.path.guide_force, axis=0)) > 10.0  # at both heights
    assert result.books.losses["guide friction"] > 0.0
    assert abs(result.books.relative_residual) < 1e-11
    at, arms = result.path.position, guide.heights - stroke_stroke.model.centre[2]
    slope = np.column_stack([at[:, 4], -at[:, 3]])
    place = at[:, None, :2] + arms[:, None] * slope[:, None]
    # a rigid needle within the bore, and what its shaft gives under some 75 N
    assert np.max(np.linalg.norm(place, axis=2)) < 0.6e-6 + 1.5e-9 * 80.0
