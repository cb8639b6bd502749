"""Contact points with a layer of asperities at the interface level.

Truth: arcs of oscillators on the pieces of the curve, one point in series with a spring, the static
solver of the ladder, smooth points in the limit of no roughness (exact); energy (conservation);
order of convergence in the step; the full order on the same meshes (reference).
"""

from dataclasses import replace
from math import inf, sqrt

import numpy as np
import pytest

from klack.contact.asperity_layer import AsperityLayer, press
from klack.contact.friction import Friction
from klack.errors import ConvergenceError, InputError
from klack.transient.interface_arrays import Layer, Pressed
from klack.transient.interface_run import simulate_interface
from klack.transient.rough_points import layer_energy, solve_rough
from klack.verification.interface_bodies import (
    LAYER,
    MassOnLayer,
    advance,
    free_rod,
    modal_model,
    rigid_body,
    rough_rod,
    time_above,
)

pytestmark = pytest.mark.slow


def arrays(layer, area):
    return Layer(area, layer.closure, layer.pressure, layer.state(layer.closure)[2])


def solved(A, q, layer, area, pressed=None):
    """Forces, gaps and rounds."""
    n = len(q)
    lam, gap = np.zeros(n), np.zeros(n)
    pressed = Pressed.none(n) if pressed is None else pressed
    rounds = solve_rough(A, q, arrays(layer, area), pressed, lam, gap)
    return lam, gap, rounds


def half_plane(n, *, soft=2e-9, reach=3.0):
    """Compliance of points in a row that share their load with neighbours."""
    apart = np.abs(np.arange(n)[:, None] - np.arange(n))
    return soft * np.exp(-apart / reach) + 0.05 * soft * np.eye(n)


@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_a_rigid_mass_on_a_layer(speed):
    mass = MassOnLayer()
    peak = mass.peak(speed)
    half = mass.time_above(0.5 * peak, speed)
    step = half / 500

    run = simulate_interface(mass.model, speed=speed, duration=40 * half, step=step)

    force = run.history.force
    assert force.max() == pytest.approx(peak, rel=1e-5)
    assert time_above(0.5 * peak, force, step) == pytest.approx(half, rel=1e-5)
    whole = mass.time_above(0.0, speed)  # ends within a step
    assert np.count_nonzero(force) * step == pytest.approx(whole, abs=2.5 * step)
    assert run.motion.velocity[-1, 2] == pytest.approx(speed, rel=1e-12)


def test_time_of_contact_by_quadrature():
    """The arcs themselves: T = 2 int dc / v(c)."""
    mass, speed = MassOnLayer(), 0.1
    energy = 0.5 * mass.mass * speed**2
    area, layer = mass.area, mass.layer
    deepest = layer.closure_at(mass.peak(speed) / area)

    s = (np.arange(20_000) + 0.5) / 20_000  # c = deepest (1 - s^2) takes the root away
    left = energy - area * layer.state(deepest * (1.0 - s**2))[2]
    time = 2.0 * np.mean(2.0 * deepest * s / np.sqrt(2.0 * left / mass.mass))

    assert area * layer.state(np.array([deepest]))[2][0] == pytest.approx(energy, rel=1e-10)
    assert mass.time_above(0.0, speed) == pytest.approx(time, rel=1e-5)


@pytest.mark.parametrize("force", [1e-3, 1.0, 30.0, 3e4])
def test_a_point_on_a_spring_takes_the_series_of_both(force):
    """The approach is C P + h(P / A), also far beyond the end of the curve."""
    area, C = 1e-6, 2e-9
    approach = C * force + LAYER.closure_at(force / area)

    lam, gap, _ = solved(np.array([[C]]), np.array([-approach]), LAYER, np.array([area]))

    assert lam[0] == pytest.approx(force, rel=1e-9)
    assert -gap[0] == pytest.approx(LAYER.closure_at(force / area), rel=1e-9)


@pytest.mark.parametrize("rms", [0.01e-6, 0.2e-6, 2e-6])
@pytest.mark.parametrize("depth", [0.02e-6, 1e-6, 20e-6])
def test_many_points_are_pressed_as_in_the_ladder(rms, depth):
    n, layer = 60, AsperityLayer.of_summits(rms=rms, radius=50e-6, density=0.05, modulus=115e9)
    A, area = half_plane(n), np.full(n, 1e-9)
    q = 1e-8 * (np.arange(n) - 0.3 * n) ** 2 - depth

    lam, gap, _ = solved(A, q, layer, area)

    expected, ends = press(layer, area, A, q)  # its gaps are good to 1e-14 m
    assert lam == pytest.approx(expected, rel=2e-6, abs=1e-7 * expected.max())
    assert gap == pytest.approx(ends, rel=1e-7, abs=1e-13)
    assert gap == pytest.approx(q + A @ lam, abs=1e-9 * depth)


def test_a_fresh_inverse_needs_few_rounds():
    """Newton's method, once the points are near: a wrong slope would take tens of rounds."""
    n, area = 40, np.full(40, 1e-9)
    A, pressed = half_plane(n), Pressed.none(n)
    q = 1e-8 * (np.arange(n) - 20.0) ** 2 - 1e-6
    solved(A, q, LAYER, area, pressed)

    _, _, again = solved(A, q - 1e-12, LAYER, area, pressed)
    pressed.counts[0] = 0
    pressed.stiffness[:] = 0.0
    _, _, renewed = solved(A, q - 5e-9, LAYER, area, pressed)

    assert again <= 5
    assert renewed <= 6


def test_the_energy_is_that_of_the_layer():
    law, area = arrays(LAYER, np.array([2e-6, 3e-6])), np.array([2e-6, 3e-6])
    gap = np.array([-0.41e-6, -0.93e-6])
    pressure, _, energy = LAYER.state(-gap)
    lam = area * pressure

    held = layer_energy(law, lam, gap)

    assert held + 0.5 * lam @ -gap == pytest.approx(area @ energy, rel=1e-12)


def test_no_roughness_is_the_smooth_points():
    """Two feet of a rigid bar: the deviation falls with the height of the asperities."""
    bar = rigid_body(
        mass=3e-3, inertia=(2e-7, 2e-7, 6e-9), points=np.array([[2e-3, 0, 0], [-1e-3, 0, 0]]),
        stiffness=1e8, gap=1e-8,
    )  # fmt: skip
    smooth = simulate_interface(bar, speed=0.5, duration=25e-6, step=10e-9).history.force
    missed = []
    for rms in (1e-9, 1e-10, 1e-12):
        layer = AsperityLayer.of_summits(rms=rms, radius=50e-6, density=0.05, modulus=115e9)
        rough = replace(bar, layer=layer, area=np.full(2, 1e-6))
        run = simulate_interface(rough, speed=0.5, duration=25e-6, step=10e-9)
        missed.append(np.abs(run.history.force - smooth).max() / smooth.max())
        assert abs(run.energy.residual) < 1e-12

    assert missed[0] > missed[1] > missed[2]
    assert missed[2] < 2e-4  # a step of 10 nm: where within it the points close


@pytest.mark.parametrize("duration", [1.1e-6, 3.3e-6, 5.7e-6, 30e-6])
def test_energy_closes_in_every_step(duration):
    """Ended before, within and after the contact, and coarse: eight steps of it."""
    for step in (20e-9, 1e-6):
        run = simulate_interface(rough_rod(), speed=0.5, duration=duration, step=step)
        assert abs(run.energy.residual) < 1e-13
        assert abs(run.energy.debt) < 1e-13 * run.energy.initial


def test_energy_closes_on_a_spring_under_a_force():
    """Pressed against its stop it bounces on and on; 0.5 ms, with modes and damping."""
    rod = replace(rough_rod(), damping=np.append(0.0, np.full(10, 0.01)))

    run = simulate_interface(
        rod, speed=0.1, duration=500e-6, force=20.0, spring_stiffness=1e5, step=40e-9
    )

    assert run.steps_in_contact > 1000
    assert abs(run.energy.residual) < 1e-12
    assert run.energy.damping > 0.0


def test_the_order_in_the_step_is_two():
    model = rough_rod()
    q, v = np.zeros((2, model.mode_count))
    v[0] = -0.5 * sqrt(model.mass)

    def end(steps):
        return advance(model, q, v, step=20e-6 / steps, steps=steps).v

    exact = end(32_000)
    errors = np.array([np.linalg.norm(end(n) - exact) for n in (500, 1000, 2000)])

    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.05)


def test_a_mass_that_rests_on_its_layer_stays():
    """Placed where the layer carries the force that presses it."""
    mass, force = MassOnLayer(stiffness=1e9), 20.0
    closure = LAYER.closure_at(force / mass.area) + force / mass.stiffness

    run = simulate_interface(
        mass.model,
        speed=0.0,
        duration=20e-6,
        step=20e-9,
        force=force,
        offset=np.array([0.0, 0.0, -closure, 0.0, 0.0, 0.0]),
    )

    assert run.history.force == pytest.approx(force, rel=1e-9)
    assert np.abs(run.motion.velocity[:, 2]).max() < 1e-9
    held = mass.area * LAYER.state(np.array([LAYER.closure_at(force / mass.area)]))[2][0]
    assert run.energy.initial == pytest.approx(held + 0.5 * force**2 / mass.stiffness, rel=1e-9)


def test_a_pressed_start_gives_its_energy():
    """Placed 0.3 um into the layer and let go: all of it becomes speed."""
    mass = MassOnLayer()
    energy = mass.area * LAYER.state(np.array([0.3e-6]))[2][0]

    run = simulate_interface(
        mass.model,
        speed=0.0,
        duration=200e-6,
        step=20e-9,
        offset=np.array([0.0, 0.0, -0.3e-6, 0.0, 0.0, 0.0]),
    )

    assert run.motion.velocity[-1, 2] == pytest.approx(sqrt(2.0 * energy / mass.mass), rel=1e-6)


def test_flight_between_bounces_on_a_layer():
    """Rigid: every impact is like the first, and as with fine steps throughout."""
    mass = MassOnLayer(stiffness=1e9)
    run = simulate_interface(
        mass.model, speed=0.1, duration=5e-3, force=3.0, flight=True, impacts=5, step=40e-9
    )

    assert len(run.impacts) == 5
    peaks = [impact.history.force.max() for impact in run.impacts]
    assert peaks == pytest.approx([peaks[0]] * 5, rel=1e-3)  # where a step falls
    assert abs(run.energy.residual) < 1e-12


def test_a_layer_beside_what_it_is_not_computed_with_is_one_clear_error():
    layer = {"layer": LAYER, "area": np.array([1e-6])}
    two = modal_model(
        masses=(1e-3, inf), omega=np.zeros(1), traces=np.full((2, 1), 30.0),
        compliance=1e-9 * np.eye(2), gap=np.zeros(2), contacts=(("a", 0, 1), ("b", 1, 2)),
    )  # fmt: skip
    rubbing = replace(
        free_rod(2, stiffness=1e9), **layer, tangents=np.zeros((1, 3)), axial_across=np.zeros(1),
        compliance=1e-9 * np.eye(2), friction=(Friction(kinetic=0.1, static=0.1),),
    )  # fmt: skip
    for model, beside in ((replace(two, layer=LAYER), "second contact"), (rubbing, "friction")):
        with pytest.raises(InputError, match=beside):
            simulate_interface(model, speed=0.1, duration=1e-6)


def test_a_curve_that_is_not_finite_ends_the_run():
    """The rounds always end."""
    broken = AsperityLayer(closure=np.array([0.0, 1e-6]), pressure=np.array([0.0, np.nan]))
    with pytest.raises(ConvergenceError, match="no contact forces"):
        simulate_interface(MassOnLayer(layer=broken).model, speed=0.1, duration=5e-6)
