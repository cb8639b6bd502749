"""Drag with memory: a sphere that settles or oscillates, a layer along a wall."""

from math import pi, sqrt

import numpy as np
import pytest
from draws import each

from klack.errors import InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import Vapour
from klack.hydraulics.unsteady_drag import (
    LONGEST_MEMORY,
    SHORTEST_MEMORY,
    UnsteadyDrag,
    basset,
    couette,
    decaying_sum,
    mei_adrian,
    unsteady_drag_step,
)
from klack.mechanics.force import ConstantForce
from klack.mechanics.lever import Lever
from klack.mechanics.rigid_mass import RigidMass
from klack.network.network import Network
from klack.network.step_function import evaluate
from klack.simulation.network_run import simulate_network
from klack.verification.sphere_in_liquid import settling_error

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

DENSITY = 935.0  # [kg/m^3]
RADIUS = 1.5e-3  # [m]


def liquid(viscosity: float) -> Fluid:
    return Fluid(
        name="silicone oil",
        temperature=293.15,
        liquid=Murnaghan(density_at_reference=DENSITY, bulk_modulus_at_reference=1e9),
        base_viscosity=viscosity,
        vapour=Vapour(pressure=10.0, density=1e-3),
    )


def falling(drag: UnsteadyDrag, viscosity: float, mass: float, force: float, speed: float = 0.0):
    parts = {
        "sphere": RigidMass(mass=mass, speed=speed),
        "push": ConstantForce(force=force),
        "drag": drag,
    }
    joined = [["sphere.body", "push.end", "drag.body"]]
    return Network(parts, joined, fluid=liquid(viscosity)).rows()


@each(("kernel", "span", "scale", "slowest"), [
    (basset, (1e-7, 10.0), None, None),
    (mei_adrian, (1e-6, 100.0), None, None),
    (couette, (1e-5, 1.0), basset, 1.0 / pi**2),
])  # fmt: skip
def test_a_sum_of_layers_is_its_kernel(kernel, span, scale, slowest):
    """Definition: between the points of the fit as well."""
    weights, times = decaying_sum(kernel, *span, scale=scale, slowest=slowest)
    x = np.geomspace(*span, 1777)
    found = np.exp(-x[:, None] / times) @ weights
    assert np.abs((found - kernel(x)) / (scale or kernel)(x)).max() < 3e-3
    assert np.all(weights > 0.0)


def test_both_series_of_couettes_start_are_one():
    """Exact: Jacobi's transform of the theta function, on both sides of its change."""
    n = np.arange(1.0, 200.0)
    for x in (1e-3, 0.0999, 0.1001, 0.5):
        series = 2.0 * np.exp(-(n**2) * pi**2 * x).sum()
        assert couette(np.array([x]))[0] == pytest.approx(series, rel=1e-9, abs=1e-12)


def impedance(drag: UnsteadyDrag, viscosity: float, omega: float) -> complex:
    """Force per speed against the motion, without added mass and steady drag."""
    damping, time = drag.layers(DENSITY, viscosity)
    return complex(np.sum(damping * 1j * omega * time / (1.0 + 1j * omega * time)))


def allowed(omega: float) -> float:
    """The kernel is right to 0.3 %, and its part before 10 ns is missing."""
    return 5e-3 + 0.5 * sqrt(omega * SHORTEST_MEMORY)


@each("frequency", [1.0, 30.0, 1e3, 3e4])
def test_a_sphere_that_oscillates_drags_stokes_layer(frequency):
    """Exact: Stokes 1851, ``6 pi mu a sqrt(i omega a^2/nu)`` beside steady drag and added mass."""
    mu, omega = 0.01, 2.0 * pi * frequency
    exact = 6.0 * pi * mu * RADIUS * np.sqrt(1j * omega * RADIUS**2 * DENSITY / mu)
    found = impedance(UnsteadyDrag(shape="sphere", radius=RADIUS), mu, omega)
    assert abs(found - exact) < allowed(omega) * abs(exact)


@each("frequency", [1.0, 1e2, 1e4])
def test_a_wall_that_oscillates_drags_a_layer(frequency):
    """Exact: ``mu A/h x coth x`` with ``x^2 = i omega h^2/nu``, less the steady part."""
    mu, omega, area, height = 0.01, 2.0 * pi * frequency, 2e-4, 0.2e-3
    x = np.sqrt(1j * omega * height**2 * DENSITY / mu)
    exact = mu * area / height * (x / np.tanh(x))
    found = mu * area / height + impedance(
        UnsteadyDrag(shape="layer", area=area, height=height), mu, omega
    )
    assert abs(found - exact) < allowed(omega) * abs(exact)


def test_slow_and_fast_limits_of_the_kernel_of_mei_and_adrian():
    """Limits: Basset's kernel at first, ``t^-2`` with the flow at last."""
    mu, speed = 0.01, 0.5
    nu = mu / DENSITY
    damping, time = UnsteadyDrag(shape="sphere", radius=RADIUS, typical_speed=speed).layers(
        DENSITY, mu
    )
    f = 0.75 + 0.105 * 2.0 * RADIUS * speed / nu
    for t in (1e-6, 1e-3, 0.05):
        early = (pi * nu * t / RADIUS**2) ** 0.25
        late = sqrt(pi / 2.0 * speed**3 / (RADIUS * nu * f**3) * t**2)
        exact = 6.0 * pi * mu * RADIUS / (early + late) ** 2
        assert np.sum(damping * np.exp(-t / time)) == pytest.approx(exact, rel=3e-3)


@pytest.mark.slow
def test_a_sphere_settles_as_basset_boussinesq_and_oseen_found():
    """Exact: at a Reynolds number of 1e-3; without memory it is 14 % faster at the end."""
    assert settling_error() < 3e-3


@pytest.mark.slow
def test_steady_motion_goes_on():
    """Definition: at the terminal speed of Schiller and Naumann from the start, with its past."""
    mu, speed = 0.01, 0.5
    mass = 8.0 * DENSITY * 4.0 / 3.0 * pi * RADIUS**3
    reynolds = 2.0 * RADIUS * speed * DENSITY / mu
    force = 6.0 * pi * mu * RADIUS * speed * (1.0 + 0.15 * reynolds**0.687)
    drag = UnsteadyDrag(shape="sphere", radius=RADIUS)
    rows = falling(drag, mu, mass, force, speed)
    run = simulate_network(rows, duration=0.02, step=1e-5, record=1e-3, start="free")
    np.testing.assert_allclose(run.channels["sphere.body velocity"].values, speed, rtol=1e-9)
    seen = run.channels["drag Reynolds number"].values
    np.testing.assert_allclose(seen[1:], reynolds, rtol=1e-9)


@pytest.mark.slow
def test_a_reversal_costs_what_its_layers_hold():
    """Conservation: the energy of the layers comes from the body and ends as heat."""
    drag = UnsteadyDrag(shape="sphere", radius=RADIUS)
    mass = 8.0 * DENSITY * 4.0 / 3.0 * pi * RADIUS**3
    rows = falling(drag, 0.01, mass, -0.003, 0.5)
    run = simulate_network(rows, duration=0.05, step=1e-6, record=1e-4, start="free")
    assert abs(run.books.relative_residual) < 1e-9  # of iterations, 30 times what was seen
    assert run.channels["sphere.body velocity"].values[-1] < 0.0


def test_a_step_of_any_length_is_exact_for_even_motion():
    """Exact: one long step and a thousand short ones of one speed end alike."""
    damping, time = UnsteadyDrag(shape="sphere", radius=RADIUS).layers(DENSITY, 0.01)
    n = len(damping)
    par = [1e-3, 50.0, n, *np.column_stack((damping, time)).ravel()]

    def walk(steps: int) -> tuple[np.ndarray, float, float]:
        state, pulse, heat = np.zeros(n + 1), 0.0, 0.0
        h = 1e-3 / steps
        for k in range(steps):
            y = np.array([k, k + 1.0]) * 0.3 * h
            status, out = evaluate(unsteady_drag_step, par, state, [k * h, h, *y, 0.0, 0.0], n + 5)
            assert status == 0
            state, pulse, heat = out[2 : 3 + n], pulse + out[0] * h, heat + out[4 + n]
        return state, pulse, heat

    one, many = walk(1), walk(1000)
    np.testing.assert_allclose(one[0], many[0], rtol=1e-10, atol=1e-12)
    assert one[1:] == pytest.approx(many[1:], rel=1e-10)


def test_times_of_the_memory_reach_from_impacts_to_flights():
    """Definition: what the docstring states."""
    _, time = UnsteadyDrag(shape="sphere", radius=RADIUS).layers(DENSITY, 0.01)
    assert time.min() < SHORTEST_MEMORY < LONGEST_MEMORY < time.max()
    assert len(time) < 40


@each(("keys", "named"), [
    ({"shape": "sphere"}, "radius"),
    ({"shape": "layer", "area": 1e-4}, "height"),
    ({"shape": "layer", "area": 1e-4, "height": 1e-4, "radius": 1e-3}, "radius"),
    ({"shape": "layer", "area": 1e-4, "height": 1e-4, "typical_speed": 1.0}, "typical_speed"),
    ({"shape": "sphere", "radius": 1e-3, "area": 1e-4}, "area"),
])  # fmt: skip
def test_keys_belong_to_a_shape(keys, named):
    with pytest.raises(InputError, match=named):
        UnsteadyDrag(**keys)


def test_added_mass_moves_with_the_body_as_a_whole():
    """Definition: of a rigid mode; elastic modes, and a body that is held, keep theirs."""
    drag = UnsteadyDrag(shape="layer", area=1e-4, height=1e-4, added_mass=3e-3)
    body = falling(drag, 0.01, 1e-3, 0.0).bodies[0].body
    assert body.mass == pytest.approx(4e-3)
    assert body.port_shapes[0, 0] == pytest.approx(1.0 / sqrt(4e-3))
    assert body.rigid_axial[0] == pytest.approx(sqrt(4e-3))


def test_added_mass_at_an_arm_counts_with_its_square():
    """Definition: the inertia about the pivot, as a mass at the first arm."""
    arms = {"pushed": 10e-3, "wet": -20e-3}
    parts = {
        "lever": Lever(effective_mass=1e-3, arms=arms),
        "drag": UnsteadyDrag(shape="layer", area=1e-4, height=1e-4, added_mass=3e-3),
    }
    body = Network(parts, [["lever.wet", "drag.body"]], fluid=liquid(0.01)).rows().bodies[0].body
    assert body.mass == pytest.approx(1e-3 + 4.0 * 3e-3)
    assert body.port_shapes[0] == pytest.approx(np.array([1.0, -2.0]) / sqrt(13e-3))


def test_without_the_liquid_nothing_is_left():
    """Definition: what the dry variant of a stroke asks."""
    assert UnsteadyDrag(shape="sphere", radius=RADIUS).dry() is None


@pytest.mark.slow
def test_what_moves_along_with_its_surroundings_is_not_dragged():
    """Exact: one speed from the start, so no force; of two speeds the momentum stays."""
    drag = UnsteadyDrag(shape="layer", area=1e-4, height=1e-4)
    for other, momentum in ((0.5, 1.5e-3), (-0.25, 0.0)):
        parts = {
            "needle": RigidMass(mass=1e-3, speed=0.5),
            "housing": RigidMass(mass=2e-3, speed=other),
            "drag": drag,
        }
        joined = [["needle.body", "drag.body"], ["housing.body", "drag.around"]]
        rows = Network(parts, joined, fluid=liquid(0.01)).rows()
        run = simulate_network(rows, duration=5e-3, step=1e-6, record=1e-4, start="free")
        needle, housing = (
            run.channels[f"{name}.body velocity"].values for name in ("needle", "housing")
        )
        np.testing.assert_allclose(1e-3 * needle + 2e-3 * housing, momentum, atol=1e-15)
        if other == 0.5:
            np.testing.assert_allclose(needle, 0.5, rtol=1e-12)
