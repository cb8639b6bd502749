"""What the interface model refuses, and what it says; truth: the documented errors."""

from dataclasses import replace

import numpy as np
import pytest

from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.restitution import measure_impact
from klack.errors import ConvergenceError, InputError
from klack.transient.interface_model import InterfaceBody, InterfaceContact, interface_model
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import free_rod, modal_model, rigid_body, rod_between_stops
from klack.verification.transient import needle_over_seat


class Distorted(Flexibility):
    """Answers that depend on the place of the answer, not of the load: not reciprocal."""

    def solve(self, F):
        u = super().solve(F)
        grow = np.random.default_rng(1).uniform(1.0, 1.01, len(u))
        return (grow * u.T).T


@pytest.fixture(scope="module")
def bodies():
    return needle_over_seat(size=20e-6, bulk=2e-3)


def item(body, count=4, *, flexibility=None, scale=1.0):
    flexibility = flexibility or Flexibility(body)
    modes = eigenmodes(body, count=count)
    return InterfaceBody(
        body=body,
        flexibility=flexibility,
        modes=Modes(modes.omega / scale, modes.shapes),
        damping=np.zeros(count),
    )


def contact(space, lower="seat"):
    return InterfaceContact(name="seat", upper="needle", lower=lower, space=space)


def test_sound_statics_are_stated(bodies):
    a, b, space = bodies

    model = interface_model([item(a), item(b)], [contact(space)])

    assert model.checks.lowest_pivot > 1e-3
    assert 0.0 < model.checks.reciprocity < 1e-10  # measured, not symmetrised away
    assert model.checks.static_limit < 1e-10
    assert 0.1 < model.checks.modal_share < 0.9
    assert model.bodies == ("needle", "seat")
    assert model.masses == (pytest.approx(a.mass), np.inf)


def test_a_flexibility_that_is_not_reciprocal_is_refused(bodies):
    a, b, space = bodies

    with pytest.raises(ConvergenceError, match=r"miss reciprocity by \d(\.\d)?e-05"):
        interface_model([item(a, flexibility=Distorted(a)), item(b)], [contact(space)])


def test_a_compliance_of_other_bodies_is_refused(bodies):
    a, b, space = bodies
    good = interface_model([item(a, 1), item(b, 1)], [contact(space)])
    modal = (good.traces[:, 1:] / good.omega[1:]) @ (good.traces[:, 1:] / good.omega[1:]).T
    wrong = InterfaceContact(
        name="seat",
        upper="needle",
        lower="seat",
        space=space,
        compliance=1.01 * (good.compliance + modal),
    )

    with pytest.raises(ConvergenceError, match=r"the exact solution by 0\.01"):
        interface_model([item(a), item(b)], [wrong])


@pytest.mark.parametrize("scale", [3.0, 10.0])
def test_modes_softer_than_the_body_are_refused(bodies, scale):
    """At 10 not one diagonal entry of the residual is left above zero."""
    a, b, space = bodies

    with pytest.raises(ConvergenceError, match="not positive definite"):
        interface_model([item(a, scale=scale), item(b)], [contact(space)])


def test_the_moving_body_must_be_free(bodies):
    a, b, space = bodies

    with pytest.raises(InputError, match="free along z"):
        interface_model([item(b), item(a)], [contact(space)])


def test_contacts_name_known_bodies(bodies):
    a, b, space = bodies

    with pytest.raises(InputError, match="one of: needle, seat"):
        interface_model([item(a), item(b)], [contact(space, lower="stop")])


@pytest.mark.parametrize(
    "numbers",
    [
        {"speed": -1.0, "duration": 1e-6},
        {"speed": 1.0, "duration": 0.0},
        {"speed": 1.0, "duration": 1e-6, "step": 0.0},
    ],
)
def test_numbers_of_a_run_have_a_sign(numbers):
    with pytest.raises(InputError, match="simulate_interface"):
        simulate_interface(free_rod(2, stiffness=1e9), **numbers)


def test_a_body_of_revolution_cannot_tilt():
    with pytest.raises(InputError, match="bodies of revolution"):
        simulate_interface(
            free_rod(2, stiffness=1e9),
            speed=0.1,
            duration=1e-6,
            offset=np.array([0.0, 0.0, 0.0, 1e-3, 0.0, 0.0]),
        )


def test_start_height_is_counted_from_first_touch_of_the_tilted_body():
    """Two feet 4 mm apart; a tilt of 1 mrad puts the left one 2 um lower."""
    feet = np.array([[-2e-3, 0.0, 0.0], [2e-3, 0.0, 0.0]])
    model = rigid_body(mass=1e-3, inertia=(1e-8,) * 3, points=feet, stiffness=1e8)
    tilt = np.array([0.0, 0.0, 0.0, 0.0, -1e-3, 0.0])

    run = simulate_interface(model, speed=0.5, duration=8e-6, step=10e-9, offset=tilt, height=1e-6)

    first = run.history.time[np.argmax(run.history.force > 0)]
    left, right = run.impacts[0].point_force.T
    assert first == pytest.approx(2e-6, abs=20e-9)
    assert left.any()
    assert not right[: np.argmax(left > 0) + 100].any()


def test_a_run_without_flight_is_one_record():
    run = simulate_interface(free_rod(3, stiffness=1e9, gap=1e-6), speed=0.5, duration=20e-6)

    assert len(run.impacts) == 1
    assert run.history.force.shape == (500,)
    assert run.impacts[0].point_force.shape == (500, 1)
    assert run.steps == 500
    assert 0 < run.steps_in_contact < 500
    assert run.motion.time[[0, -1]] == pytest.approx([0.0, 20e-6])


def test_points_may_be_left_out():
    model = free_rod(3, stiffness=1e9, gap=1e-6)

    run = simulate_interface(model, speed=0.5, duration=20e-6, points=False)

    assert run.impacts[0].point_force.shape == (0, 1)
    assert run.history.force.max() > 0


def test_progress_ends_at_one():
    told = []

    simulate_interface(
        free_rod(3, stiffness=1e9, gap=1e-5),
        speed=0.5,
        duration=1e-3,
        force=5.0,
        flight=True,
        progress=told.append,
    )

    assert told == sorted(told)
    assert told[-1] == 1.0


def edge(model, beyond):
    """The same model, with contact points that all lie at the border of the candidates."""
    return replace(model, rim=np.ones(model.count, dtype=bool), beyond=np.full(model.count, beyond))


@pytest.mark.parametrize("height", [None, 0.1e-6, 20e-6])
def test_a_contact_at_the_rim_is_complete_while_nothing_beyond_closes(height):
    """Approach of about 1.4 um, wherever the body starts."""
    model = free_rod(3, stiffness=1e9, gap=0.1e-6)
    run = {"speed": 0.5, "duration": 70e-6, "height": height}
    reached = simulate_interface(model, **run).approach

    simulate_interface(edge(model, 1.2 * (reached + 0.1e-6)), **run)
    with pytest.raises(InputError, match="edge of the candidate area"):
        simulate_interface(edge(model, 1.05 * (reached + 0.1e-6)), **run)


def test_a_start_below_the_meshes_does_not_hide_the_rim():
    model = edge(free_rod(3, stiffness=1e9, gap=10e-6), 10.5e-6)
    lowered = np.array([0.0, 0.0, -9.9e-6, 0.0, 0.0, 0.0])

    with pytest.raises(InputError, match="edge of the candidate area"):
        simulate_interface(model, speed=0.5, duration=20e-6, offset=lowered)


def test_the_rim_of_the_stop_counts_the_way_up():
    rod = rod_between_stops(3, stiffness=1e9, gaps=(50e-6, 10e-6))
    up = {"speed": 0.0, "velocity": np.array([0, 0, 0.5, 0, 0, 0]), "duration": 40e-6}

    run = simulate_interface(edge(rod, 13e-6), **up)
    with pytest.raises(InputError, match="edge of the candidate area"):
        simulate_interface(edge(rod, 11.5e-6), **up)

    assert run.impacts[0].contact == "stop"
    assert run.approach == 0.0


def test_an_impact_on_the_stop_is_seen_with_the_stop_below():
    """Mirror image of the same impact on the seat; the stop is free and takes momentum."""
    mass, soft = 3e-3, 1e-8
    model = modal_model(
        masses=(mass, 4 * mass),
        omega=np.zeros(2),
        traces=np.array([[1.0, -0.5], [-1.0, 0.5]]) / np.sqrt(mass),
        compliance=soft * np.eye(2),
        gap=np.array([1e-6, 1e-3]),
        owner=np.array([0, 1]),
        axial=np.array([1.0, -1.0]),
        contacts=(("seat", 0, 1), ("stop", 1, 2)),
    )
    model = replace(model, drift=np.diag([1.0, 0.5]) / np.sqrt(mass))

    down = simulate_interface(model, speed=0.5, duration=60e-6, force=3.0)
    up = simulate_interface(
        replace(model, gap=np.array([1e-3, 1e-6])),
        speed=0.0,
        duration=60e-6,
        force=-3.0,
        velocity=np.array([0, 0, 0.5, 0, 0, 0]),
    )

    (seat,), (stop,) = down.impacts, up.impacts
    assert (seat.contact, seat.side, stop.contact, stop.side) == ("seat", 1.0, "stop", -1.0)
    for name in ("force", "gap", "velocity_a", "velocity_b", "external_force"):
        np.testing.assert_allclose(getattr(stop.history, name), getattr(seat.history, name))
    measures = measure_impact(stop.history)
    assert measures.approach_speed == pytest.approx(0.502, rel=1e-3)  # 3 N along 1 um
    assert measures.restitution == pytest.approx(1.0, abs=1e-2)  # 3 N press during 10 us
    assert measures.impulse_residual == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(stop.velocity, -seat.velocity)
