"""Forces of the mechanical components against their formulas, at the scale of a valve."""

from math import cos, pi

import numpy as np
import pytest

from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.force_over_stroke import ForceOverStroke
from klack.mechanics.gravity import STANDARD_GRAVITY, Gravity
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.step_function import evaluate

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

H = 20e-9  # [s]


def force_of(part: Component, y0: float, y1: float, t: float = 0.0, h: float = H) -> float:
    """Mean force [N] on a needle of 3 g that moves from y0 to y1."""
    parts = {"needle": RigidMass(mass=3e-3), "part": part}
    row = Network(parts, [["needle.body", f"part.{next(iter(part.port_kinds()))}"]]).rows()
    element = row.elements[0]
    inputs = [t, h, *[y0, y1] + [0.0, 0.0] * (len(element.ports) - 1)]
    status, out = evaluate(element.step, element.parameters, element.state, inputs, 8)
    assert status == 0
    return float(out[0])


def test_return_spring_closes_with_preload_and_rate():
    spring = Spring(stiffness=5e3, preload=20.0)

    assert force_of(spring, 0.0, 0.0) == -20.0
    assert force_of(spring, 80e-6, 80e-6) == pytest.approx(-20.4, rel=1e-15)
    assert force_of(spring, 40e-6, 120e-6) == pytest.approx(-20.4, rel=1e-15)


def test_spring_damping_is_that_of_the_mean_speed():
    spring = Spring(stiffness=5e3, preload=0.0, damping=0.5)

    force = force_of(spring, -5e-9, 5e-9)  # 0.5 m/s through zero

    assert force == pytest.approx(-0.25, rel=1e-14)


def test_constant_force_is_constant():
    assert force_of(ConstantForce(force=-15.0), 1.0, 2.0) == -15.0


@pytest.mark.parametrize("h", [20e-9, 3e-6, 40e-6])
def test_force_over_time_has_the_exact_impulse_for_any_step(h):
    time, force = np.array([2e-6, 5e-6, 5.001e-6, 30e-6]), np.array([1.0, 1.0, 40.0, -10.0])
    part = ForceOverTime(time=tuple(time), force=tuple(force))
    parts = {"needle": RigidMass(mass=3e-3), "part": part}
    row = Network(parts, [["needle.body", "part.end"]]).rows().elements[0]

    impulse, state, count = 0.0, row.state, int(np.ceil(42e-6 / h))
    for k in range(count):
        _, out = evaluate(row.step, row.parameters, state, [k * h, h, 0.0, 0.0], 3)
        impulse, state = impulse + out[0] * h, out[1:2]

    end = count * h
    exact = 1.0 * 2e-6 + np.trapezoid(force, time) - 10.0 * (end - 30e-6)
    assert impulse == pytest.approx(exact, rel=1e-12)  # 2100 sums


def test_force_over_stroke_reads_its_lines_and_stays_constant_beyond():
    latch = ForceOverStroke(stroke=(0.0, 30e-6, 80e-6), force=(-12.0, 3.0, 40.0))

    assert force_of(latch, 10e-6, 10e-6) == pytest.approx(-7.0, rel=1e-14)
    assert force_of(latch, 5e-6, 15e-6) == pytest.approx(-7.0, rel=1e-14)
    assert force_of(latch, -50e-6, -20e-6) == -12.0
    assert force_of(latch, 90e-6, 200e-6) == 40.0


@pytest.mark.parametrize("way", [(10e-6, 60e-6), (60e-6, 10e-6), (-40e-6, 140e-6)])
def test_force_over_stroke_is_the_mean_over_the_way(way):
    x, force = np.array([0.0, 30e-6, 80e-6]), np.array([-12.0, 3.0, 40.0])
    latch = ForceOverStroke(stroke=tuple(x), force=tuple(force))
    fine = np.unique(np.concatenate([np.clip(x, min(way), max(way)), way]))

    mean = np.trapezoid(np.interp(fine, x, force), fine) / (fine[-1] - fine[0])

    assert force_of(latch, *way) == pytest.approx(mean, rel=1e-13)


def test_weight_counts_the_inclination():
    upright, lying = Gravity(), Gravity(inclination=pi / 2)

    assert force_of(upright, 0.0, 0.0) == pytest.approx(-3e-3 * STANDARD_GRAVITY, rel=1e-15)
    assert force_of(Gravity(inclination=0.5), 0.0, 0.0) == pytest.approx(
        -3e-3 * STANDARD_GRAVITY * cos(0.5), rel=1e-15
    )
    assert force_of(lying, 0.0, 0.0) == pytest.approx(0.0, abs=1e-17)


def test_a_rigid_mass_moves_by_newton_and_starts_with_its_speed():
    rows = Network({"needle": RigidMass(mass=3e-3, speed=-0.5, points=("tip", "top"))}, []).rows()

    body = rows.bodies[0].body
    assert body.port_shapes.T @ body.port_shapes == pytest.approx(1 / 3e-3, rel=1e-15)
    assert rows.bodies[0].speed * (body.port_shapes.T @ body.rigid_axial) == pytest.approx(-0.5)
