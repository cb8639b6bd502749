"""Energy and momentum at the interface level.

Energy and momentum at the interface level and the full order; truth: conservation.

A needle between seat and stop above, at the interface level.

Truth: conservation of energy and momentum; flight that is jumped over must not change anything;
a crowned face is no flat one (geometry).
"""

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest
from numba import njit

from klack.analyses.impact.interface_level import build_interface
from klack.assembling.bodies import find_touch
from klack.assembling.modes import mode_pools
from klack.assembling.problem import ContactProblem, build_problem
from klack.bodies.elasticity.body import elastic_body
from klack.case import load_case, shipped_cases
from klack.case.schema import Case
from klack.contact.restitution import measure_impact
from klack.errors import InputError
from klack.machine.progress import silent
from klack.simulation.propagator import modal_propagator
from klack.transient.full_order import simulate_full_order
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import free_rod, reduce_bodies
from klack.verification.transient import (
    STEEL,
    block_between_plates,
    needle_over_seat,
    sphere_over_cylinder,
    two_spheres,
)


def total_energies(run, force):
    """Energy at the start of every impact over that of the start, with the potential of a force."""
    lift = np.array([s.position[2] for s in run.impacts]) - run.motion.position[0, 2]
    energy = np.array([s.history.ledger.initial for s in run.impacts])
    return (energy + force * lift) / run.energy.initial


@pytest.mark.slow
def test_hundreds_of_impacts_of_a_pressed_rod_keep_the_energy():
    model = free_rod(10, stiffness=1e9)
    force = 2 * 0.1 * model.mass / 1e-3

    run = simulate_interface(
        model, speed=0.1, duration=1.0, force=force, flight=True, impacts=200, points=False
    )

    energies = total_energies(run, force)
    assert len(energies) == 200
    assert np.abs(energies - 1.0).max() < 1e-5
    # the rod rings: its flight takes a changing part of the energy
    share = [0.5 * model.mass * s.velocity[2] ** 2 for s in run.impacts]
    assert np.ptp(share) > 0.1 * run.energy.initial


@pytest.mark.parametrize(("period", "flight"), [(1e-4, False), (1e-3, True)])
def test_a_closing_spring_gives_back_what_it_holds(period, flight):
    """A spring brings the rod back to its stop: fine steps in contact, long ones in free flight.

    Taken at the start of a step, the spring lost 1e-6 in contact and 1e-2 in flight.
    """
    model = free_rod(10, stiffness=1e9)
    stiffness = model.mass * (2.0 * np.pi / period) ** 2

    run = simulate_interface(
        model,
        speed=0.5,
        duration=10.0 * period if flight else 3.0 * period,
        force=0.1 * np.pi * model.mass / period,
        spring_stiffness=stiffness,
        flight=flight,
        points=False,
    )

    closed = [np.diff((impact.history.force > 0).astype(int)) == 1 for impact in run.impacts]
    assert sum(np.count_nonzero(item) for item in closed) >= 5
    assert len(run.impacts) == (21 if flight else 1)
    assert abs(run.energy.residual) < 1e-11


@njit
def trapezoid(steps, A, P, c, softness, gap, push, q, v):
    """The step without payment, one point; returns forces, and energies where it is open."""
    forces, energies = np.zeros(steps), np.zeros(steps)
    force = 0.0
    for n in range(steps):
        f = push + 0.5 * force * c
        free_q = P[0] * q + P[1] * v + P[4] * f
        v = P[2] * q + P[3] * v + P[5] * f
        new = max(0.0, -(gap + np.sum(c * free_q)) / (softness + 0.5 * np.sum(c * c * P[4])))
        q = free_q + 0.5 * P[4] * c * new
        v = v + 0.5 * P[5] * c * new
        forces[n], force = 0.5 * (force + new), new
        energies[n] = 0.5 * np.sum(v * v + A * q * q) - np.sum(push * q) if new == 0.0 else np.nan
    return forces, energies


@pytest.mark.slow
def test_without_payment_the_energy_would_wander():
    """The same step written down again, without the payment of what touching points gain."""
    model, step = free_rod(10, stiffness=1e9), 40e-9
    P = modal_propagator(model.omega, model.damping, step)
    force, speed = 2 * 0.1 * model.mass / 1e-4, 0.1
    push = -force * model.rigid[2]
    q, v = np.zeros(11), -speed * model.rigid[2] * model.mass
    arrays = np.array([P.A11, P.A12, P.A21, P.A22, P.B1, P.B2])
    start = 0.5 * v @ v

    paid = simulate_interface(model, speed=speed, duration=40e-3, step=step, force=force)
    forces, energies = trapezoid(
        10**6, model.omega**2, arrays, model.traces[0], model.compliance[0, 0], 0.0, push, q, v
    )

    unpaid = np.nanmax(np.abs(energies / start - 1.0))
    assert unpaid > 2e-3
    assert abs(paid.energy.residual) < 1e-5
    # the first impact is the same but for its last step, which pays what it cannot keep
    end = np.argmin(forces > 0)
    first = slice(0, end - 1)
    assert end > 300
    np.testing.assert_allclose(
        paid.history.force[first], forces[first], atol=1e-5 * forces[first].max()
    )


@pytest.mark.slow
def test_two_crowned_ends_between_two_plates():
    """Tilted block of finite elements, 40 um of play, twenty impacts."""
    bodies, contacts = block_between_plates(40e-6)
    model, _ = reduce_bodies(bodies, contacts, (10, 6, 6))

    run = simulate_interface(
        model,
        speed=0.3,
        duration=0.1,
        offset=np.array([0.0, 0.0, 20e-6, 1e-3, -5e-4, 0.0]),
        flight=True,
        impacts=20,
    )

    assert [s.contact for s in run.impacts] == ["seat", "stop"] * 10
    energies = np.array([s.history.ledger.initial for s in run.impacts]) / run.energy.initial
    assert np.abs(energies - 1.0).max() < 1e-5
    assert np.abs(run.motion.velocity[-1, 3:]).max() > 1.0  # it tumbles by now
    seat, stop = (s.point_force.sum(axis=0) for s in run.impacts[:2])
    (_, low, high), (_, low2, high2) = model.contacts
    assert seat[low:high].any()
    assert not seat[low2:high2].any()
    assert stop[low2:high2].any()
    assert not stop[low:high].any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "speed"),
    [
        (lambda: needle_over_seat(size=20e-6, bulk=2e-3), 0.3),
        (lambda: two_spheres(2e-3, 3e-3, size=12e-6), 0.5),
    ],
    ids=["needle on seat", "two spheres"],
)
def test_one_impact_in_full_order_loses_less_than_a_ten_thousandth(problem, speed):
    a, b, space = problem()

    run = simulate_full_order(
        a, b, space, speed=speed, duration=40e-6, step=50e-9, stop_after_separation=1e-6
    )

    assert not run.history.force[-10:].any()
    assert 0.0 < run.energy_loss < 3e-5
    assert np.abs(run.energy.residual).max() < 1e-11 * run.energy.total[0]


@pytest.mark.slow
def test_a_row_of_impacts_in_full_order_loses_less_than_a_ten_thousandth_each():
    """Sphere pressed on a floor; the later impacts meet a ringing floor."""
    ball, floor, space = sphere_over_cylinder(
        sphere_radius=2e-3, radius=10e-3, height=10e-3, size=20e-6, bulk=2.5e-3
    )
    floor = elastic_body(
        "floor", floor.mesh, {"block": STEEL}, fixed_nodes=floor.mesh.surface("base").nodes
    )
    force = 2 * 0.3 * ball.mass / 10e-6

    run = simulate_full_order(
        ball, floor, space, speed=0.3, duration=0.26e-3, step=50e-9, axial_force=-force
    )

    on = run.history.force > 0
    contacts = np.count_nonzero(on[1:] & ~on[:-1]) + on[0]
    assert contacts >= 8
    assert 0.0 < run.energy_loss / contacts < 1e-4


_POLE = """
  pole:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          pole:
            start: [2, 20]
            edges:
              - {arc: [4, 20], centre: [3, 40], name: stop}  # crowned
              - {line: [4, 26], name: outside}
              - {line: [2, 26], name: rim}
              - {close: true, name: bore}
    material: steel
    mesh:
      size: 1 mm
      contact: {size: 0.02 mm, extent: 0.15 mm}
    fixed:
      - surface: rim
contact:
"""
_OPPOSITE = "  gap: 2 um\nopposite: {between: [pole.stop, needle.top], gap: 30 um}\n"


def case_text() -> str:
    text = shipped_cases()["demo-valve-axisymmetric"].read_text(encoding="utf-8")
    text = text.replace("contact:\n  between", _POLE.strip("\n") + "\n  between")
    return text.replace("  gap: 0 um\n", _OPPOSITE)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    file = tmp_path_factory.mktemp("opposite") / "case.yaml"
    file.write_text(case_text(), encoding="utf-8")
    return load_case(file)


@pytest.fixture(scope="module")
def problem_stops(case: Case) -> ContactProblem:
    return build_problem(case, silent)


@pytest.fixture(scope="module")
def model(problem_stops: ContactProblem) -> InterfaceModel:
    return build_interface(problem_stops, mode_pools(problem_stops, at_least=1, progress=silent))


def test_bounces_between_both_ends_keep_the_energy(model: InterfaceModel):
    run = simulate_interface(model, speed=0.3, duration=800e-6, flight=True, points=False)
    assert [segment.contact for segment in run.impacts[:4]] == [
        "contact",
        "opposite",
        "contact",
        "opposite",
    ]
    # some 1000 closings and openings of points; each pays its debt within a step or two
    assert abs(run.energy.residual) < 1e-6
    for segment in run.impacts[:4]:
        change = segment.history.velocity_a[-1] - segment.history.velocity_a[0]
        # seen with the stop below, whichever it is
        assert segment.side == (1.0 if segment.contact == "contact" else -1.0)
        assert model.mass * change == pytest.approx(segment.history.impulse, rel=1e-9)
    first = measure_impact(run.impacts[0].history)
    assert 0.98 < first.restitution < 1.0  # 0.997 on this seat without the stop above


def test_the_stop_above_is_where_the_case_says(model: InterfaceModel):
    """30 um up from the start until the centre of mass has gone as far."""
    run = simulate_interface(
        model, speed=0.0, velocity=np.array([0, 0, 0.3, 0, 0, 0]), duration=150e-6
    )
    first = np.argmax(run.history.force > 0)
    # weighted gaps close up to a hat's curvature later, some tens of nanometres on 20 um elements
    assert run.history.time[first] * 0.3 == pytest.approx(30e-6, abs=0.1e-6)


def test_jumping_over_flight_changes_nothing(model: InterfaceModel):
    """The exact propagator: a segment starts within a step, so forces agree to their slope."""
    jumped = simulate_interface(model, speed=0.3, duration=300e-6, flight=True, points=False)
    stepped = simulate_interface(model, speed=0.3, duration=300e-6, points=False)
    assert jumped.steps < 0.9 * stepped.steps
    assert jumped.motion.position[-1][2] == pytest.approx(stepped.motion.position[-1][2], rel=1e-3)


def test_points_of_both_ends_answer_each_other_reciprocally(model: InterfaceModel):
    (_, _, seat), (_, stop, _) = model.contacts
    cross = model.compliance[:seat, stop:]
    assert np.max(np.abs(cross)) > 0.0
    assert model.checks.reciprocity < 1e-12
    assert model.checks.static_limit < 1e-10
    assert model.checks.lowest_pivot > 0.0


def test_crowned_face_is_refined_where_it_touches(case: Case):
    """A crown of 20 mm radius rises by 25 nm over 1 um: a ring, not a flat zone."""
    assert case.opposite is not None
    touch = find_touch(case.bodies, case.opposite.stop, case.opposite.moving)
    assert touch is not None
    assert touch.upper[0][0] == pytest.approx(3e-3, abs=2e-6)


def test_surfaces_of_coarse_faces_find_each_other(case: Case):
    """Both sides far coarser than the crown: whatever is chosen as slave has a contact point."""
    bodies = dict(case.bodies)
    for name in ("needle", "pole"):
        bodies[name] = bodies[name].model_copy(
            update={"mesh": bodies[name].mesh.model_copy(update={"contact": None})}
        )
    coarse = case.model_copy(update={"bodies": bodies})
    problem = build_problem(coarse, silent)
    assert problem.opposite is not None
    assert problem.opposite.space.count >= 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("pole.stop, needle.top", "needle.top, pole.stop", "which moves"),
        ("pole.stop, needle.top", "housing.top, needle.top", "third body"),
        ("gap: 30 um", "gap: -30 um", "above 0"),
        ("needle.top]", "needle.lid]", "top"),
    ],
)
def test_mistakes_are_explained(tmp_path: Path, old: str, new: str, words: str):
    file = tmp_path / "case.yaml"
    file.write_text(case_text().replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match="opposite") as error:
        load_case(file)
    assert words in str(error.value)


def test_result_is_plain(model: InterfaceModel):
    """What goes to worker processes holds arrays, numbers and words only."""
    for field in dataclasses.fields(model):
        value = getattr(model, field.name)
        assert isinstance(value, np.ndarray | tuple | float | int | None) or field.name == "checks"


def test_hits_on_both_stops_in_quick_succession_are_two_impacts(model: InterfaceModel):
    """4 um between the stops: 13 us of flight, less than what ends an impact on one stop alone."""
    above = np.arange(model.count) >= model.contacts[1][1]
    near = dataclasses.replace(model, gap=model.gap - np.where(above, 26e-6, 0.0))
    run = simulate_interface(near, speed=0.3, duration=250e-6, flight=True, points=False)
    names = [segment.contact for segment in run.impacts]
    assert names[:4] == ["contact", "opposite", "contact", "opposite"]
    first = measure_impact(run.impacts[0].history)
    assert first.sub_contacts == 1
    assert 0.9 < first.restitution < 1.0
    # nothing is lost or done twice where one impact ends and the next begins
    for before, after in itertools.pairwise(run.impacts[:4]):
        gone = before.history.velocity_a[-1]  # seen from the stop below, then from that above
        assert after.history.velocity_a[0] == pytest.approx(-gone, rel=1e-9)
    assert abs(run.energy.residual) < 1e-6
