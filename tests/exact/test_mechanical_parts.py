"""Mechanical components: formulas, forces, one of one's own.

Nonlinear spring, surge, rubber, LuGre friction, lever: their formulas, ends and errors.

Forces of the mechanical components against their formulas, at the scale of a valve.

The component of the how-to page slows down as its formula says, compiled and in Python.
"""

import re
import warnings
from collections.abc import Iterator
from dataclasses import astuple
from importlib import import_module
from itertools import pairwise, product
from math import cos, pi
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml
from draws import each
from scipy.linalg import expm

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.control.pid import PidController
from klack.control.sensor import Sensor
from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.controlled_force import ControlledForce
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.force_over_stroke import ForceOverStroke
from klack.mechanics.friction import GuideFriction
from klack.mechanics.gravity import STANDARD_GRAVITY, Gravity
from klack.mechanics.lever import Lever
from klack.mechanics.lugre_friction import LuGreFriction
from klack.mechanics.nonlinear_spring import NonlinearSpring
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.rubber_stop import MaxwellElement, RubberStop
from klack.mechanics.spring import Spring
from klack.mechanics.surging_spring import SurgingSpring
from klack.network.catalogue import component_class
from klack.network.component import Component
from klack.network.network import Network
from klack.network.relaxation import relaxed
from klack.network.step_function import evaluate
from klack.simulation.network_run import simulate_network

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")


_H = 20e-9


def step(part: Component, y0: float, y1: float, state: np.ndarray | None = None) -> np.ndarray:
    """Outputs of a part at a mass for one step of 20 ns, its base at the ground."""
    port = next(iter(part.port_kinds()))
    parts = {"mass": RigidMass(mass=3e-3), "part": part}
    row = Network(parts, [["mass.body", f"part.{port}"]]).rows().elements[0]
    state = row.state if state is None else state
    outputs = 2 + len(row.state) + len(row.books)
    status, out = evaluate(row.step, row.parameters, state, [0, _H, y0, y1, 0, 0], outputs)
    assert status == 0
    return out


def test_a_polynomial_has_its_force_and_energy():
    part = NonlinearSpring(stiffness=2e4, higher=(0.5, 1.0), reference=1e-3, start=0.5e-3)

    out = step(part, 1.5e-3, 1.5e-3)

    # k s (1 + a1 s/r + a2 (s/r)^2) at s = 2 mm, and its integral
    assert out[0] == pytest.approx(-2e4 * 2e-3 * (1 + 0.5 * 2 + 4.0), rel=1e-14)
    energy = 2e4 * (2e-3**2 / 2 + 0.5e3 * 2e-3**3 / 3 + 1e6 * 2e-3**4 / 4)
    assert out[2] == pytest.approx(energy, rel=1e-14)


def test_a_table_meets_its_points_and_continues_straight():
    part = NonlinearSpring(deflection=(-1e-3, 0.0, 1e-3, 2e-3), force=(-5.0, 0.0, 7.0, 8.0))

    at_points = [-step(part, s, s)[0] for s in (-1e-3, 0.0, 1e-3, 2e-3)]
    beyond = [-step(part, s, s)[0] for s in (2.1e-3, 2.2e-3, 2.3e-3)]

    assert at_points == pytest.approx([-5.0, 0.0, 7.0, 8.0], rel=1e-13, abs=1e-13)
    assert np.diff(beyond) == pytest.approx(np.diff(beyond)[:1].repeat(2), rel=1e-9)


def test_two_points_are_a_linear_spring():
    straight = NonlinearSpring(deflection=(0.0, 1e-3), force=(2.0, 7.0))
    known = Spring(stiffness=5e3, preload=2.0)

    for y0, y1 in ((-1e-3, -0.5e-3), (0.2e-3, 0.4e-3), (0.9e-3, 2.5e-3)):
        assert step(straight, y0, y1)[0] == pytest.approx(step(known, y0, y1)[0], rel=1e-13)


def test_leaving_the_table_of_a_spring_warns():
    parts = {
        "mass": RigidMass(mass=3e-3, speed=1.0),
        "spring": NonlinearSpring(deflection=(0.0, 50e-6), force=(0.0, 1.0)),
    }
    rows = Network(parts, [["mass.body", "spring.end"]]).rows()

    with pytest.warns(AccuracyWarning, match="leaves the range of the table of 'spring'"):
        simulate_network(rows, duration=1e-4, start="free")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "neither stiffness nor table"),
        ({"stiffness": 1e4, "deflection": (0.0, 1e-3), "force": (0.0, 1.0)}, "and a table"),
        ({"stiffness": 1e4, "higher": (0.1,)}, "1 terms"),
        ({"stiffness": 1e4, "reference": 1e-3}, "0 terms and a reference"),
        ({"deflection": (0.0, 1e-3), "force": (1.0,)}, "1 forces for 2 deflections"),
        ({"deflection": (1e-3, 0.0), "force": (1.0, 2.0)}, "do not increase"),
    ],
)
def test_a_wrong_curve_is_one_clear_error(keys, words):
    with pytest.raises(InputError, match=words):
        NonlinearSpring(**keys)


def test_modes_and_the_rest_have_the_whole_mass():
    table = SurgingSpring(stiffness=2e4, preload=0.0, mass=2e-3, modes=3).oscillators()

    # even and odd modes alike as seen from one end: a third of the mass (Rayleigh)
    assert table[:, 2].sum() == pytest.approx(2e-3 / 3, rel=1e-13)
    # moved as a whole only the odd ones count, with both ends
    assert 4.0 * table[table[:, 3] > 0, 2].sum() == pytest.approx(2e-3, rel=1e-13)


def test_a_spring_without_motion_pushes_as_one_without_mass():
    heavy = SurgingSpring(stiffness=2e4, preload=5.0, mass=2e-3)

    parts = {
        "mass": RigidMass(mass=3e-3),
        "spring": heavy,
        "other": Spring(stiffness=1e4, preload=-8.0),
    }
    rows = Network(parts, [["mass.body", "spring.end", "other.end"]]).rows()
    place = simulate_network(rows, duration=5e-5).channels["mass.body displacement"].values
    assert place == pytest.approx(3.0 / 3e4, rel=1e-9)


@pytest.mark.parametrize("periods", [1e-4, 0.05, 0.7, 3.3, 200.0], ids=lambda n: f"{n} periods")
@pytest.mark.parametrize("damping", [0.0, 0.01, 0.6])
def test_coils_swing_exactly_between_ends_that_move_evenly(periods, damping):
    """Truth: the matrix exponential of the oscillators; the mean force from their momentum."""
    spring = SurgingSpring(stiffness=2e4, preload=5.0, mass=2e-3, modes=3, damping=damping)
    parts = {"a": RigidMass(mass=1.0), "b": RigidMass(mass=1.0), "spring": spring}
    row = Network(parts, [["a.body", "spring.end"], ["b.body", "spring.base"]]).rows().elements[0]
    h, rng = periods / spring.frequencies()[-1], np.random.default_rng(3)
    state = rng.uniform(-1e-4, 1e-4, len(row.state)) * np.where(np.arange(10) % 2, 1e4, 1.0)
    end0, end1, base0, base1 = 3e-5, 8e-5, -2e-5, 1e-5
    inputs = [0.0, h, end0, end1, base0, base1]

    _, out = evaluate(row.step, row.parameters, state, inputs, 2 + len(state) + 2)

    after, forces = [], np.array([-1.0, 1.0]) * (5.0 + 2e4 * (5.5e-5 + 0.5e-5))
    for (k, c, m, sign), x, v in zip(spring.oscillators(), state[::2], state[1::2], strict=True):
        s0, rate = end0 + sign * base0, (end1 - end0 + sign * (base1 - base0)) / h
        # of x, v, the place and the speed of what they hang on
        law = np.array([[0, 1, 0, 0], [-k / m, -c / m, k / m, c / m], [0, 0, 0, 1], [0, 0, 0, 0]])
        x1, v1, _, _ = expm(law * h) @ [x, v, s0, rate]
        after += [x1, v1]
        forces -= np.array([1.0, sign]) * m * (v1 - v) / h
    scale = np.where(np.arange(10) % 2, 1e5 * 1e-4, 1e-4)
    # the exponential of a long step loses a few digits itself
    assert np.abs((out[2:12] - after) / scale).max() < 1e-13 * max(10.0, 30.0 * periods)
    assert out[:2] == pytest.approx(forces, rel=1e-10)


@pytest.mark.parametrize("x", [0.0, 1e-9, 0.05, 0.0999, 0.1001, 3.0, 60.0, 1e6])
def test_weights_of_a_relaxation_are_exact(x):
    @np.vectorize
    def weights(u):
        return np.exp(-x * u)

    decay, phi1, phi2 = relaxed.py_func(x)
    u, w = np.polynomial.legendre.leggauss(60)
    if x <= 60.0:
        u, w = 0.5 * (u + 1.0), 0.5 * w
        assert decay == pytest.approx(np.exp(-x), rel=1e-13, abs=1e-15)
        assert phi1 == pytest.approx(np.sum(w * weights(u)), rel=1e-12)
        assert phi2 == pytest.approx(np.sum(w * (1.0 - u) * weights(u)), rel=1e-12)
    else:
        assert (decay, phi1, phi2) == pytest.approx((0.0, 1.0 / x, 1.0 / x), rel=2e-6, abs=1e-300)


def test_rubber_never_pulls_and_its_surface_stays_behind():
    rubber = RubberStop(
        gap=0.0, stiffness=1e5, maxwell=(MaxwellElement(stiffness=1e6, time=50e-6),)
    )
    state, force, left = np.zeros(3), [], []
    way = np.concatenate((np.linspace(0.0, -50e-6, 200), np.linspace(-50e-6, 20e-6, 100)))
    for y0, y1 in pairwise(way):
        out = step(rubber, y0, y1, state)
        force.append(out[0])
        state = out[2:5].copy()
        left.append(state[0] + y1)

    assert min(force) >= 0.0
    assert max(left) > 20e-6  # the indentation is still there when the body has gone
    assert state[0] > 0.0


def test_a_compressed_buffer_starts_relaxed():
    rubber = RubberStop(
        gap=-20e-6, stiffness=1e5, maxwell=(MaxwellElement(stiffness=1e6, time=50e-6),)
    )
    parts = {
        "mass": RigidMass(mass=3e-3),
        "stop": rubber,
        "push": Spring(stiffness=1e4, preload=2.0),
    }
    rows = Network(parts, [["mass.body", "stop.upper", "push.end"]]).rows()
    run = simulate_network(rows, duration=5e-5)

    # 1e5 (20 um - y) = 2 + 1e4 y
    assert run.channels["mass.body displacement"].values == pytest.approx(0.0, abs=1e-12)


def test_rubber_that_softens_is_refused():
    with pytest.raises(InputError, match="a negative term"):
        RubberStop(gap=0.0, stiffness=1e5, higher=(-0.1,), reference=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.6])
@pytest.mark.parametrize("way", [1e-9, 1e-6, 1e-2, 10.0])
def test_bristles_stay_bounded_in_any_step(share, way):
    part = LuGreFriction(coulomb=0.5, breakaway=0.8, bristle_stiffness=1e7, elastic_share=share)

    out = step(part, 0.0, way)

    assert 0.0 < out[2] <= 0.8 / 1e7 * (1.0 + 1e-12)
    assert out[4] >= 0.0


def test_friction_about_rest_is_a_spring():
    out = step(LuGreFriction(coulomb=0.5, bristle_stiffness=1e6, elastic_share=0.9), 0.0, 0.4e-6)

    assert out[0] == pytest.approx(-1e6 * 0.2e-6, rel=1e-13)
    assert out[4] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("coarse", [1, 64])
def test_a_belt_takes_a_block_along_by_friction(coarse):
    """A driven body has no speed by forces: half of what the block gets is lost, none more."""
    friction, mass, speed, end = 5.0, 2e-3, 0.4, 1e-3
    parts = {
        "belt": PrescribedMotion(
            points=("top",), time=(0.0, end), displacement=(0.0, speed * end), between="straight"
        ),
        "block": RigidMass(mass=mass, points=("tip",)),
        "grip": GuideFriction(coulomb=friction),
        "load": Spring(stiffness=1e3, preload=800.0),
    }
    nodes = [["block.tip", "grip.body"], ["belt.top", "grip.guide", "load.end"]]
    rows = Network(parts, nodes).rows()
    run = simulate_network(rows, duration=0.3e-3, coarse=coarse, record=1.28e-6, start="free")

    slips = np.minimum(run.time, mass * speed / friction)
    way = 0.5 * friction / mass * slips**2 + speed * (run.time - slips)
    assert run.channels["block.tip displacement"].values == pytest.approx(way, abs=1e-14)
    assert run.books.losses["grip loss"] == pytest.approx(0.5 * mass * speed**2, rel=1e-12)
    assert run.channels["grip.body force"].values[50] == pytest.approx(friction, rel=1e-12)


def test_friction_below_sliding_is_refused():
    with pytest.raises(InputError, match=r"300 mN|0\.3 N"):
        LuGreFriction(coulomb=0.5, breakaway=0.3, bristle_stiffness=1e6)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"arms": {}}, "no arms"),
        ({"arms": {"a": 0.0}}, "an arm of 0 m"),
        ({"arms": {"a": 0.01}, "carried": {"b": 1e-3}}, "a mass at 'b'"),
        ({"arms": {"a": 0.01}, "effective_mass": 0.0}, "moment of inertia of 0"),
    ],
)
def test_a_lever_that_cannot_turn_is_refused(keys, words):
    with pytest.raises(InputError, match=words):
        Lever(**{"effective_mass": 1e-3, **keys})


def _random_part(rng: np.random.Generator) -> Component:
    """One of the parts with numbers as a valve could have them."""

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    kind = rng.integers(6)
    if kind == 0:
        return NonlinearSpring(
            stiffness=log(1e3, 1e6),
            higher=(float(rng.uniform(-0.2, 0.5)), log(0.01, 2.0)),
            reference=log(50e-6, 2e-3),
            start=float(rng.uniform(-1e-4, 1e-3)),
            damping=float(rng.choice([0.0, 0.5])),
        )
    if kind == 1:
        points = np.sort(rng.uniform(-3e-3, 3e-3, 6))
        return NonlinearSpring(
            deflection=tuple(points.tolist()),
            force=tuple(np.cumsum(rng.uniform(-3, 8, 6)).tolist()),
        )
    if kind == 2:
        return SurgingSpring(
            stiffness=log(1e3, 1e6),
            preload=float(rng.uniform(-10, 30)),
            mass=log(1e-5, 1e-2),
            modes=int(rng.integers(1, 12)),
            damping=float(rng.choice([0.0, 0.02])),
        )
    if kind == 3:
        return RubberStop(
            gap=float(rng.uniform(-20e-6, 100e-6)),
            stiffness=log(1e4, 1e8),
            higher=(0.0, log(0.01, 3.0)),
            reference=log(20e-6, 1e-3),
            maxwell=tuple(
                MaxwellElement(stiffness=log(1e4, 1e8), time=log(1e-8, 1e-2))
                for _ in range(rng.integers(4))
            ),
        )
    if kind == 4:
        return ControlledForce(
            sample_time=float(rng.choice([6.4e-6, 12.8e-6])),
            sensors={
                "x": Sensor(
                    channel="needle.body displacement",
                    unit="um",
                    delay=float(rng.choice([0.0, 10e-6])),
                    noise=float(rng.choice([0.0, 2.0])),
                    quantisation=float(rng.choice([0.0, 0.5])),
                )
            },
            controller=PidController(
                kind="pid",
                sensor="x",
                setpoint=float(rng.uniform(-50, 50)),
                gain=log(0.01, 2.0),
                integral_time=log(1e-4, 1e-2),
                derivative_time=float(rng.choice([0.0, 1e-4])),
                derivative_filter=2e-5,
                lower=-20.0,
                upper=20.0,
            ),
        )
    coulomb = log(0.01, 5.0)
    return LuGreFriction(
        coulomb=coulomb,
        breakaway=coulomb * float(rng.uniform(1.0, 2.0)),
        stribeck_speed=log(1e-4, 0.1),
        bristle_stiffness=log(1e4, 1e9),
        bristle_damping=float(rng.choice([0.0, log(0.1, 30.0)])),
        viscous=float(rng.choice([0.0, log(0.01, 1.0)])),
        elastic_share=float(rng.choice([0.0, 0.7])),
    )


@pytest.mark.slow
@each("seed", range(5))
def test_random_networks_keep_their_energy(seed):
    rng = np.random.default_rng(seed)
    worst, ended = 0.0, 0
    for _ in range(40):
        bodies = {
            "needle": RigidMass(mass=float(rng.uniform(1e-3, 2e-2)), speed=float(rng.normal(0, 1))),
            "lever": Lever(
                effective_mass=float(rng.uniform(1e-3, 1e-2)),
                arms={"a": 0.01, "b": float(rng.choice([-0.03, -0.004, 0.02]))},
            ),
        }
        if rng.random() < 0.4:
            lift = rng.uniform(-50e-6, 200e-6, 4)
            bodies["driven"] = PrescribedMotion(
                time=(0.0, 5e-5, 1.5e-4, 2.5e-4), displacement=tuple(lift.tolist())
            )
        parts = {f"part{i}": _random_part(rng) for i in range(rng.integers(1, 6))}
        points = ["needle.body", "lever.a", "lever.b"] + ["driven.body"] * ("driven" in bodies)
        nodes = {point: [point] for point in points}
        for name, part in parts.items():
            first, *second = part.port_kinds()
            at, other = rng.choice(len(points), 2, replace=False)
            nodes[points[at]].append(f"{name}.{first}")
            if second and rng.random() < 0.5:
                nodes[points[other]].append(f"{name}.{second[0]}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            network = Network({**bodies, **parts}, [n for n in nodes.values() if len(n) > 1])
            step, coarse = rng.choice([20e-9, 200e-9]), rng.choice([1, 16])
            try:
                rows = network.rows()
                run = simulate_network(
                    rows, duration=2e-4, step=float(step), coarse=int(coarse), start="free"
                )
            except InputError:
                ended += 1
                continue
        worst = max(worst, abs(run.books.residual) / run.books.scale)
        assert all(np.all(np.isfinite(c.values)) for c in run.channels.values())

    assert worst <= 1e-9
    assert ended <= 4


def test_the_example_of_the_page_runs_and_keeps_its_energy():
    docs = Path(__file__).parents[2] / "docs"
    case = load_valve_case(docs / "how-to" / "mechanical_parts.yaml")

    (variant,) = run_stroke(case).variants.values()

    assert abs(variant.result.books.relative_residual) <= 1e-12
    lift = variant.result.channels["lever.needle displacement"].values
    assert 150e-6 < lift.max() < 155e-6  # up to the stop, which gives way


def test_components_shown_on_the_page_are_valid(tmp_path):
    (tmp_path / "lift.csv").write_text("time,lift\n0,0\n1,80\n2,0\n")
    page = Path(__file__).parents[2] / "docs" / "theory" / "mechanical-parts.md"
    shown = re.findall(r"```yaml-part\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)

    assert shown
    for block in shown:
        for keys in yaml.safe_load(block).values():
            component_class(keys.pop("type")).model_validate(keys, context={"folder": tmp_path})


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


HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"


@pytest.fixture(scope="module")
def example() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(HOW_TO)
        yield import_module("eddy_brake")


def test_the_brake_slows_down_by_its_formula(example):
    speed, residual = example.slow_down(example.EddyBrake(damping=2.0, critical_speed=0.5))

    # second order: (h/tau)^2 with tau = m/c = 1.5 ms
    assert example.time_to(speed, 2.0, 0.5) == pytest.approx(2e-3, rel=1e-7)
    assert residual < 1e-12


def test_plain_python_gives_the_same(example):
    settings = {"damping": 2.0, "critical_speed": 0.5}

    compiled = example.slow_down(example.EddyBrake(**settings))
    plain = example.slow_down(example.PlainEddyBrake(**settings))

    assert plain[0] == pytest.approx(compiled[0], rel=1e-12)  # order of operations


def test_the_page_shows_the_code_that_runs():
    source = (HOW_TO / "eddy_brake.py").read_text()
    page = (HOW_TO / "add-a-component.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)

    assert len(blocks) == 4
    lines = {line.split("#")[0].strip() for line in source.splitlines()}
    for block in blocks[:3]:
        assert {line.strip() for line in block.splitlines()} <= lines


STIFF = {"kind": "linear", "stiffness": 1e8}  # [N/m]
RING = {"shape": "ring", "inner_radius": 1e-3, "outer_radius": 1.3e-3}


def turned(moment, arms, first, rate=0.0):
    """A lever that turns at a ``rate`` [rad/s], whichever arm comes first."""
    names = sorted(arms, key=lambda name: name != first)
    inertia, speed = moment / arms[first] ** 2, rate * arms[first]
    return Lever(effective_mass=inertia, arms={name: arms[name] for name in names}, speed=speed)


@each("far", (20e-3, 5e-3, -20e-3, 10e-3))
def test_an_impact_at_an_arm_has_the_speed_of_that_arm(far):
    """Half a sine with the inertia of the lever at that arm, up to the steps of 20 ns."""
    moment, rate = 3e-3 * 10e-3**2, 50.0
    lever = turned(moment, {"near": 10e-3, "far": far}, "near", -np.sign(far) * rate)
    parts = {"lever": lever, "stop": EndStop(gap=10e-6, law=STIFF)}
    rows = Network(parts, [["lever.far", "stop.upper"], ["stop.lower", "ground"]]).rows()

    (found,) = simulate_network(rows, duration=100e-6, start="free").events

    mass, approach = moment / far**2, rate * abs(far)
    assert found.approach_speed == pytest.approx(approach, rel=1e-9)
    assert found.touch_speed == pytest.approx(approach, rel=1e-9)
    assert found.time == pytest.approx(10e-6 / approach, abs=H)
    assert found.restitution == pytest.approx(1.0, rel=1e-6)  # nothing is lost
    assert found.impulse == pytest.approx(2.0 * mass * approach, rel=1e-6)
    assert found.peak_force == pytest.approx(approach * (mass * 1e8) ** 0.5, rel=1e-4)


def chain(first, second, film=None):
    """A lever that strikes another one, whose long arm strikes a stop."""
    arms, others = {"pushed": 8e-3, "nose": -13e-3}, {"struck": 7e-3, "end": 21e-3}
    parts = {
        "one": turned(2.1e-7, arms, first, rate=90.0),
        "two": turned(3.4e-7, others, second),
        "hit": EndStop(gap=10e-6, law=STIFF, restitution=0.6),
        "stop": EndStop(gap=60e-6, law=STIFF, restitution=0.6, film=film),
    }
    lines = [["two.struck", "hit.lower"], ["one.nose", "hit.upper"]]
    lines += [["two.end", "stop.upper"], ["ground", "stop.lower"]]
    return Network(parts, lines, fluid=library_fluid("n-heptane").at(293.15)).rows()


def test_levers_in_a_chain_strike_with_the_speeds_of_their_faces():
    """The first impact keeps the moments; the arms carry the speed it leaves to the second."""
    run = simulate_network(chain("pushed", "struck"), duration=140e-6, start="free")

    hit, stop = run.events
    masses = 2.1e-7 / 13e-3**2, 3.4e-7 / 7e-3**2
    common = 1.0 / sum(1.0 / mass for mass in masses)
    left = (1.0 + hit.restitution) * common * hit.approach_speed  # impulse
    assert hit.approach_speed == pytest.approx(90.0 * 13e-3, rel=1e-9)
    assert hit.impulse == pytest.approx(left, rel=1e-9)
    assert stop.approach_speed == pytest.approx(21.0 / 7.0 * left / masses[1], rel=1e-9)
    for event in (hit, stop):
        lost = run.books.losses[f"{event.stop} contact"]
        assert event.restitution == pytest.approx(0.6, rel=1e-4)  # of the law, in steps
        assert event.energy_loss == pytest.approx(lost, rel=1e-6)


@pytest.mark.parametrize("film", [None, RING])
def test_the_order_of_the_arms_changes_nothing(film):
    """Up to round-off, which a peak and its time may put into another step."""
    runs = [
        simulate_network(chain(first, second, film), duration=140e-6, start="free").events
        for first, second in product(("pushed", "nose"), ("struck", "end"))
    ]

    assert [event.stop for event in runs[0]] == ["hit", "stop"]
    for run in runs[1:]:
        for event, other in zip(runs[0], run, strict=True):
            numbers = [astuple(x)[1:-1] for x in (event, other)]
            assert numbers[1] == pytest.approx(numbers[0], rel=1e-9, abs=0.0, nan_ok=True)


def test_a_body_on_a_course_strikes_with_its_speed():
    """The law of Newton in the frame of a body that nothing stops."""
    course = PrescribedMotion(time=(0.0, 1e-3), displacement=(0.0, 1e-3), between="straight")
    parts = {
        "hammer": course,
        "anvil": RigidMass(mass=3e-3),
        "hit": EndStop(gap=10e-6, law=STIFF, restitution=0.6),
    }
    rows = Network(parts, [["anvil.body", "hit.upper"], ["hammer.body", "hit.lower"]]).rows()

    run = simulate_network(rows, duration=100e-6, start="free")

    (found,) = run.events
    assert found.approach_speed == pytest.approx(1.0, rel=1e-9)
    assert found.impulse == pytest.approx(
        3e-3 * run.channels["anvil velocity"].values[-1], rel=1e-9
    )
    assert found.impulse == pytest.approx(3e-3 * (1.0 + found.restitution), rel=1e-9)
    assert found.energy_loss == pytest.approx(run.books.losses["hit contact"], rel=1e-6)
