"""Steps and meshes of impacts.

Truth: rod on a spring as a piecewise linear system, propagated by its exact eigen-solution.

The reference finds touch and release by root finding and knows no time step.

Step of the interface level; truth: order two, and motion that runs backwards as well.

Refinement of the time step in full-order impacts with friction.

A swept solid against the axisymmetric body of the same meridian mesh: same impact.

Ring contact of a spherical tip on a cone: solid against axisymmetric; truth: convergence.

The solid is a quarter with rollers on its two cuts, swept from the same meridian, with layers that
do not match: it has to give a quarter of the force.

An axial stroke of bodies in three dimensions; truth: the same drawing in the half section.
"""

from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from klack.analyses.stroke.run import run_stroke
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.case.any_case import read_valve_case
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.laws import HertzLaw, LinearLaw
from klack.contact.mortar import contact_space, tangent_rows, touching_shift
from klack.contact.restitution import find_contacts, measure_impact
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate
from klack.simulation.system import ContactPair, ReducedSystem
from klack.transient.full_order import simulate_full_order
from klack.transient.interface_run import simulate_interface
from klack.verification.contact import STEEL, IndentationProblem
from klack.verification.interface_bodies import advance, free_rod, rigid_body, sphere_on_beam
from klack.verification.lattice import lattice_mesh
from klack.verification.transient import needle_over_seat

MODES, STIFFNESS, GAP, DURATION = 5, 20.0, 0.1, 6.0  # unit rod, unit speed


def rod_system(law, series=0.0):
    rod = rod_body("rod", length=1.0, area=1.0, young=1.0, density=1.0, elastic_modes=MODES)
    pair = ContactPair(
        body_a="rod",
        port_a="bottom",
        body_b="wall",
        port_b="contact",
        law=law,
        gap=GAP,
        series_compliance=series,
    )
    return ReducedSystem(bodies=(rod, fixed_body("wall")), contacts=(pair,))


def flow(K, origin):
    """Return the exact motion q'' = -K (q - origin) as a function of state and time."""
    values, V = np.linalg.eigh(K)
    w = np.sqrt(np.maximum(values, 0.0))
    w[w < 1e-6] = 0.0

    def move(state, t):
        a, b = V.T @ (state[0] - origin), V.T @ state[1]
        s = t * np.sinc(w * t / np.pi)
        q = a * np.cos(w * t) + b * s
        v = -w * np.sin(w * t) * a + b * np.cos(w * t)
        return V @ q + origin, V @ v

    return move


def exact_end(stiffness):
    """State of the rod at the end: flights and contacts with located events."""
    rod = rod_system(LinearLaw(1.0)).bodies[0]
    phi, K = rod.port_shapes[:, 0], np.diag(rod.omega**2)
    closed_K = K + stiffness * np.outer(phi, phi)
    origin = np.linalg.solve(closed_K, -stiffness * GAP * phi)  # rests where the spring is free
    open_flow, closed_flow = flow(K, np.zeros(phi.size)), flow(closed_K, origin)
    state = np.zeros(phi.size), np.eye(phi.size)[0] * -1.0
    t, closed = 0.0, False
    while True:
        move = closed_flow if closed else open_flow
        sign = -1.0 if closed else 1.0

        def gap(s, move=move, state=state, sign=sign):
            return sign * (GAP + phi @ move(state, s)[0])

        grid = np.linspace(0.0, DURATION - t, 4001)[1:]
        crossed = [i for i in range(1, grid.size) if gap(grid[i - 1]) > 0.0 >= gap(grid[i])]
        if not crossed:
            return move(state, DURATION - t)
        i = crossed[0]
        s = brentq(gap, grid[i - 1], grid[i], xtol=1e-15)
        state, t, closed = move(state, s), t + s, not closed


def error_norm(system, step, reference):
    record = simulate(system, velocities={"rod": -1.0}, step=step, duration=DURATION)
    omega = system.bodies[0].omega
    dq, dv = record.final_position[0] - reference[0], record.final_velocity[0] - reference[1]
    return sqrt(np.sum(dv**2) + np.sum((omega * dq) ** 2) + dq[0] ** 2)


def order(steps, errors):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.mark.slow
def test_contact_scheme_is_of_second_order():
    reference = exact_end(STIFFNESS)
    steps = DURATION / np.array([750, 1500, 3000, 6000, 12000])
    errors = [error_norm(rod_system(LinearLaw(STIFFNESS)), step, reference) for step in steps]

    assert order(steps, errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-4


@pytest.mark.slow
def test_series_spring_keeps_the_order():
    """Linear law and series spring are together one linear spring, which the reference has."""
    series = 0.03
    reference = exact_end(STIFFNESS / (1.0 + STIFFNESS * series))
    steps = DURATION / np.array([750, 1500, 3000, 6000, 12000])
    system = rod_system(LinearLaw(STIFFNESS), series)
    errors = [error_norm(system, step, reference) for step in steps]

    # 0.2: the kink of the onset meets the grid differently each time
    assert order(steps, errors) == pytest.approx(2.0, abs=0.2)


def test_hertz_law_is_of_second_order():
    """Self-convergence on a sphere, whose end speed and place depend on the law's curvature."""
    pair = ContactPair(
        body_a="sphere",
        port_a="contact",
        body_b="wall",
        port_b="contact",
        law=HertzLaw(1.0),
        gap=0.05,
    )
    system = ReducedSystem(
        bodies=(rigid_mass_body("sphere", 1.0), fixed_body("wall")), contacts=(pair,)
    )

    def place(steps):
        record = simulate(system, velocities={"sphere": -1.0}, step=5.0 / steps, duration=5.0)
        return record.final_position[0][0]

    counts = np.array([125, 250, 500, 1000])
    fine = place(64000)
    errors = np.array([abs(place(n) - fine) for n in counts])

    assert order(5.0 / counts, errors) == pytest.approx(2.0, abs=0.1)


SPEED = 0.5
STEPS = np.array([250, 500, 1000, 2000, 4000])


def order_step(errors, steps=STEPS):
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


def start(model):
    v = np.zeros(model.mode_count)
    v[0] = -SPEED * np.sqrt(model.mass)
    return np.zeros(model.mode_count), v


@pytest.mark.parametrize("duration", [8e-6, 20e-6], ids=["while closed", "after separation"])
def test_rod_with_ten_modes_converges_with_order_two(duration):
    model = free_rod(10, stiffness=1e9, gap=0.1e-6)
    q, v = start(model)

    def end(n):
        return advance(model, q, v, step=duration / n, steps=n)

    exact = end(200_000)
    errors = [np.linalg.norm(end(n).v - exact.v) / SPEED / np.sqrt(model.mass) for n in STEPS]

    assert np.any(exact.force) == (duration < 10e-6)
    assert order_step(errors) == pytest.approx(2.0, abs=0.05)
    assert errors[2] < 2e-4


def test_peak_force_and_contact_time_of_a_half_sine():
    """Mass on a spring: the mean forces of steps miss the peak by (omega h)^2 / 8 or less."""
    model = rigid_body(
        mass=3e-3, inertia=(1e-7,) * 3, points=np.zeros((1, 3)), stiffness=1e8, gap=1e-8
    )
    period = np.pi * np.sqrt(3e-3 / 1e8)
    peak = SPEED * np.sqrt(3e-3 * 1e8)

    measures = [
        measure_impact(
            simulate_interface(model, speed=SPEED, duration=1.2 * period, step=period / n).history
        )
        for n in (100, 400, 1600)
    ]

    for measure, n in zip(measures, (100, 400, 1600), strict=True):
        assert measure.peak_force == pytest.approx(peak, rel=1.3 * (np.pi / n) ** 2)
        assert measure.contact_time == pytest.approx(period, rel=1.3 * (np.pi / n) ** 2)


def test_impulses_of_sub_impacts_converge_with_order_two():
    """Sphere on a beam: 30 springs in parallel that close and open one after the other."""
    impact = sphere_on_beam()
    n = np.array([500, 1000, 2000, 4000])

    def impulses(count):
        run = simulate_interface(
            impact.model(), speed=SPEED, duration=1e-3, step=1e-3 / count, points=False
        )
        history = run.history
        phases = find_contacts(history, threshold=1e-3)
        return np.array([history.force[p.first : p.last].sum() * history.step for p in phases])

    exact = impulses(64_000)
    errors = [np.abs(impulses(count) / exact - 1.0).max() for count in n]

    assert len(exact) == 2
    assert order_step(errors, n) > 1.7
    assert errors[-1] < 2e-6


@pytest.mark.parametrize(("step", "rtol"), [(100e-9, 1e-5), (25e-9, 1e-7)])
def test_time_runs_backwards(step, rtol):
    """Turned round after the impact, the rod comes back to its start.

    The trapezoidal step is symmetric in time; only the payment of the energy debt is not.
    """
    model = free_rod(10, stiffness=1e9, gap=0.1e-6)
    q, v = start(model)
    steps = round(20e-6 / step)

    there = advance(model, q, v, step=step, steps=steps)
    back = advance(model, there.q, -there.v, step=step, steps=steps)

    assert there.v[0] > 0.9 * abs(v[0])
    assert not there.force.any()
    np.testing.assert_allclose(back.v, -v, atol=rtol * abs(v[0]))
    np.testing.assert_allclose(back.q, q, atol=rtol * np.abs(there.q).max())


STEPS_STEP = np.array([400e-9, 200e-9, 100e-9, 50e-9])


@pytest.mark.slow
def test_what_friction_takes_settles_with_the_step():
    """11 % of the energy of a needle on its seat; first order: slip counts from the step's start.

    Truth: half the step of the finest one, and the massless scheme.
    """
    a, b, space = needle_over_seat(size=12e-6, bulk=1e-3, length=8e-3)
    tip, cone = a.mesh.surface("tip"), b.mesh.surface("cone")
    T_a, T_b = tangent_rows(space, a.mesh, tip, b.mesh, cone)
    friction = FaceFriction(law=Friction.coulomb(0.1), T_a=T_a, T_b=T_b)

    def taken(step, scheme="contact-stabilised-newmark"):
        energy = simulate_full_order(
            a,
            b,
            space,
            speed=0.3,
            duration=20e-6,
            step=step,
            scheme=scheme,
            friction=friction,
        ).energy
        return energy.friction[-1] / energy.total[0]

    truth = taken(25e-9)
    error = np.abs(np.array([taken(step) for step in STEPS_STEP]) / truth - 1.0)
    order = np.polyfit(np.log(STEPS_STEP), np.log(error), 1)[0]
    assert np.all(np.diff(error) < 0.0)
    assert error[2] < 0.01
    assert order > 0.8
    assert abs(taken(50e-9, "massless") / truth - 1.0) < 5e-3


@pytest.mark.slow
def test_solid_needle_hits_like_the_axisymmetric_one():
    """Short needle on a seat cone, 20 non-matching layers, ring elements of 40 um.

    The chords of the layers make the ring 0.02 % smaller and its gaps uneven by 5 nm: peak and
    impulse to 1 %, rebound to 0.3 %, history (aligned at its centre of impulse) to 1 % of the peak.
    """
    histories = []
    for layers in (0, 20):
        a, b, space = needle_over_seat(size=40e-6, bulk=1.5e-3, layers=layers, length=10e-3)
        run = simulate_full_order(
            a, b, space, speed=SPEED, duration=14e-6, step=100e-9, stop_after_separation=0.3e-6
        )
        assert 0.0 < run.energy_loss < 1e-3
        histories.append(run.history)
    plane, solid = histories

    assert solid.mass_a == pytest.approx(plane.mass_a, rel=1e-4)
    assert solid.force.max() == pytest.approx(plane.force.max(), rel=1e-2)
    assert solid.impulse == pytest.approx(plane.impulse, rel=5e-3)
    assert solid.velocity_a[-1] == pytest.approx(plane.velocity_a[-1], rel=3e-3)
    centre = [float(h.time @ h.force / h.force.sum()) for h in histories]
    shifted = np.interp(plane.time, solid.time - centre[1] + centre[0], solid.force)
    assert np.sqrt(np.mean((shifted - plane.force) ** 2)) < 1e-2 * plane.force.max()


RADIUS = 1e-3
RING = RADIUS / np.sqrt(2.0)


def needle(x):
    height = -np.sqrt(RADIUS**2 - x[:, 0] ** 2)
    return np.column_stack([x[:, 0], height + (1e-3 - height) * x[:, -1]])


def seat(x):
    height = x[:, 0] - np.sqrt(2.0) * RADIUS
    return np.column_stack([x[:, 0], height - (2e-3 + height) * (1 - x[:, -1])])


def swept(meridian):
    def shape(x):
        r, z = meridian(x).T
        return np.column_stack([r * np.cos(x[:, 1]), r * np.sin(x[:, 1]), z])

    return shape


def lines(h, low, high):
    near = RING + h * np.arange(-3, 4)
    outward, inward = [near[-1]], [near[0]]
    while outward[-1] + 2.5 * h < high:
        outward.append(outward[-1] + 1.6 * (outward[-1] - ([near[-2], *outward])[-2]))
    while inward[-1] - 2.5 * h > low:
        inward.append(inward[-1] - 1.6 * (([near[1], *inward])[-2] - inward[-1]))
    outward, inward = [r for r in outward if r < high - h], [r for r in inward if r > low + h]
    return np.array([low, *inward[::-1], *near[1:-1], *outward, high])


def problem(h, layers):
    meridians = ((needle, lines(h, 0.3e-3, 0.92e-3)), (seat, lines(1.2 * h, 0.4e-3, 1.3e-3)))
    depth = np.array([0, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0])
    bodies = []
    for k, (meridian, r) in enumerate(meridians):
        z = depth if k == 0 else 1.0 - depth[::-1]
        if layers is None:
            mesh = lattice_mesh("quad8", [r, z], meridian)
        else:
            around = np.linspace(0, np.pi / 2, layers[k] + 1)
            mesh = lattice_mesh("hex20", [r, around, z], swept(meridian))
        held = mesh.surface("top" if k == 0 else "bottom").nodes
        body = elastic_body("body", mesh, {"solid": STEEL}, fixed_nodes=held)
        if layers is not None:
            rollers = (3 * mesh.surface("front").nodes + 1, 3 * mesh.surface("back").nodes)
            fixed = np.unique(np.concatenate([body.fixed, *rollers]))
            body = ElasticBody(body.name, mesh, body.K, body.M, fixed)
        bodies.append(body)
    a, b = bodies
    shift = np.zeros(a.dimension)
    shift[-1] = touching_shift(a.mesh, a.mesh.surface("bottom"), b.mesh, b.mesh.surface("top"))
    placed = a.mesh.moved(shift)
    space = contact_space(
        placed, placed.surface("bottom"), b.mesh, b.mesh.surface("top"), reach=12e-6
    )
    return IndentationProblem(body_a=a, body_b=b, space=space)


def force_at(static, approach, parts):
    return parts * np.interp(approach, static.approach, static.force)


@pytest.mark.slow
def test_solid_ring_equals_the_axisymmetric_one():
    """24 against 20 layers per circle; measured 0.2 %.  Element size over half width is 1.1."""
    approach = np.array([1.0e-6, 2.0e-6, 3.0e-6, 4.0e-6])
    flat = problem(20e-6, None).solve(300.0)
    solid = problem(20e-6, (6, 5)).solve(75.0)

    np.testing.assert_allclose(
        force_at(solid, approach, 4.0), force_at(flat, approach, 1.0), rtol=0.01
    )
    assert solid.half_width[-1] == pytest.approx(flat.half_width[-1], rel=0.1)


def test_force_converges_with_the_elements_across_the_ring():
    approach = np.array([2.0e-6, 4.0e-6])
    force = np.array(
        [force_at(problem(h, None).solve(300.0), approach, 1.0) for h in (20e-6, 10e-6, 5e-6)]
    )

    error = np.abs(force[:2] / force[2] - 1.0)
    assert np.all(error[1] < error[0])
    assert np.all(error[0] < 0.02)
    assert np.all(error[1] < 0.005)


FILE = Path(__file__).parents[1] / "data" / "case" / "stroke.yaml"


def first_impacts(*, swept):
    text = FILE.read_text()
    finer = [("size: 1 mm", "size: 2 mm"), ("{size: 0.012 mm, ", "{size: 0.04 mm, ")]
    finer += [("{size: 0.02 mm, ", "{size: 0.05 mm, "), ("land: 0.04 mm", "land: 0.1 mm")]
    if swept:
        finer.append(("model: axisymmetric", "model: swept\n      layers: 12"))
    for old, new in finer:
        assert old in text
        text = text.replace(old, new)
    variant = run_stroke(read_valve_case(text, FILE)).variants["dry"]
    assert abs(variant.result.books.relative_residual) < 1e-10
    return {stop: variant.impacts(stop)[0] for stop in ("opening", "seat")}


@pytest.mark.slow
def test_swept_bodies_strike_as_their_half_section():
    """Convergence: rings of twelve second-order elements, the same elements in the half section.

    The second impact, after 0.7 ms, has the deviations of the first one to bear.
    """
    solid, section = first_impacts(swept=True), first_impacts(swept=False)
    for stop, truth in section.items():
        found = solid[stop]
        assert found.time == pytest.approx(truth.time, rel=2e-3)
        assert found.approach_speed == pytest.approx(truth.approach_speed, rel=5e-3)
        assert found.impulse == pytest.approx(truth.impulse, rel=0.01)
        assert found.peak_force == pytest.approx(truth.peak_force, rel=0.03)
