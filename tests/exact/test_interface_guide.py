"""The guide of a needle; truth: motion of a rigid body on springs, with friction and with drag."""

from math import exp, pi, sqrt

import numpy as np
import pytest

from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.materials import Material
from klack.transient.guide import guide_of_shaft
from klack.transient.interface_run import simulate_interface
from klack.verification.impacts import needle_over_seat
from klack.verification.interface_bodies import lateral_guide, modal_model, rigid_body
from klack.verification.lattice import lattice_mesh

MASS, INERTIA, STIFFNESS, CLEARANCE = 3e-3, (2.4e-7, 2.4e-7, 6e-9), 1e7, 4e-6
PERIOD = 2 * pi * sqrt(MASS / STIFFNESS)


@pytest.fixture(scope="module")
def needle():
    """Far above its seat."""
    return rigid_body(mass=MASS, inertia=INERTIA, points=np.zeros((1, 3)), stiffness=1e9, gap=1.0)


def move(model, guide, velocity, duration, **more):
    settings = {"speed": 0.0, "step": 0.5 * PERIOD / 2000} | more
    return simulate_interface(
        model, guide=guide, velocity=np.array(velocity), duration=duration, **settings
    )


def test_inside_of_the_clearance_nothing_happens(needle):
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS, friction=0.5)

    run = move(needle, guide, [0.03, -0.01, -0.2, 1.0, 2.0, 3.0], 100e-6)

    np.testing.assert_allclose(run.motion.velocity[-1], [0.03, -0.01, -0.2, 1, 2, 3], rtol=1e-12)
    assert run.energy.guide == 0.0


@pytest.mark.parametrize("direction", [0.0, 1.0, 3.0, -2.0])
def test_shaft_bounces_off_the_bore_like_a_mass_on_a_spring(needle, direction):
    """Through the clearance, half a period outside, and back through the middle."""
    speed = 0.1
    n = np.array([np.cos(direction), np.sin(direction)])
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS)
    there, turned = CLEARANCE / speed + 0.25 * PERIOD, 2 * CLEARANCE / speed + 0.5 * PERIOD
    velocity = [*(speed * n), 0.0, 0.0, 0.0, 0.0]

    outermost = move(needle, guide, velocity, there, step=there / 4000)
    back = move(needle, guide, velocity, turned, step=turned / 4000)

    reach = CLEARANCE + speed * sqrt(MASS / STIFFNESS)
    np.testing.assert_allclose(outermost.motion.position[-1, :2], reach * n, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(back.motion.position[-1, :2], 0.0, atol=1e-5 * CLEARANCE)
    np.testing.assert_allclose(back.motion.velocity[-1, :2], -speed * n, rtol=1e-6, atol=1e-9)
    assert back.energy.residual == pytest.approx(0.0, abs=1e-12)
    assert abs(back.energy.guide) < 1e-7 * back.energy.initial


def test_a_second_order_step(needle):
    """Position after one and a half bounces."""
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS)
    end = CLEARANCE / 0.1 + 0.5 * PERIOD + 2 * CLEARANCE / 0.1 + 0.3 * PERIOD

    position = [
        move(needle, guide, [0.1, 0, 0, 0, 0, 0], end, step=end / n).motion.position[-1, 0]
        for n in (500, 1000, 2000, 4000, 64000)
    ]

    error = np.abs(np.array(position[:-1]) - position[-1])
    assert -np.polyfit(np.log([500, 1000, 2000, 4000]), np.log(error), 1)[0] > 1.8


def test_two_heights_hold_the_tilt(needle):
    """Rotation about y between guides at +-8 mm: half a period of J on 2 k l^2."""
    arm, rate = 8e-3, 20.0
    guide = lateral_guide(
        needle,
        clearance=CLEARANCE,
        stiffness=STIFFNESS,
        heights=(arm, -arm),
        offset=((0.0, 0.0), (0.0, 0.0)),
    )
    outside = pi * sqrt(INERTIA[1] / (2 * STIFFNESS * arm**2))
    angle = CLEARANCE / arm

    time = 2 * angle / rate + outside

    run = move(needle, guide, [0, 0, 0, 0, rate, 0], time, step=time / 4000)

    np.testing.assert_allclose(run.motion.velocity[-1], [0, 0, 0, 0, -rate, 0], atol=1e-6 * rate)
    assert run.motion.position[-1, 4] == pytest.approx(0.0, abs=1e-5 * angle)


def test_a_round_bore_keeps_the_moment_of_momentum(needle):
    """Central force: a shaft that orbits in the bore keeps x v_y - y v_x for many turns."""
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS)

    run = move(
        needle,
        guide,
        [0.1, 0.05, 0, 0, 0, 0],
        5e-3,
        offset=np.array([0.0, 1e-6, 0.0, 0.0, 0.0, 0.0]),
    )

    x, v = run.motion.position, run.motion.velocity
    np.testing.assert_allclose(x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0], -1e-7, rtol=1e-6)
    assert np.hypot(x[:, 0], x[:, 1]).max() > CLEARANCE
    assert abs(run.energy.guide) < 1e-5 * run.energy.initial


def squeezed(needle, friction, depth=5e-6):
    """Two bores that press from both sides with k depth."""
    out = CLEARANCE + depth
    return lateral_guide(
        needle,
        clearance=CLEARANCE,
        stiffness=STIFFNESS,
        heights=(0.0, 0.0),
        offset=((out, 0.0), (-out, 0.0)),
        friction=friction,
    )


def test_coulomb_friction_brakes_by_mu_n_over_m(needle):
    """Constant side forces of 50 N from two sides: v = v0 - 2 mu N t / m, then rest."""
    guide = squeezed(needle, 0.2)
    braking = 2 * 0.2 * STIFFNESS * 5e-6 / MASS  # [m/s^2]
    time = 0.5 * 0.5 / braking

    half = move(needle, guide, [0] * 6, time, speed=0.5, step=50e-9)
    rest = move(needle, guide, [0] * 6, 1.5 * 0.5 / braking, speed=0.5, step=50e-9)

    # the first step has no force at its start: one step in 750
    assert half.motion.velocity[-1, 2] == pytest.approx(-0.25, rel=2e-3)
    assert abs(rest.motion.velocity[-1, 2]) < 1e-9
    assert rest.motion.position[-1, 2] == pytest.approx(-0.5 * 0.5**2 / braking, rel=3e-3)
    for run in (half, rest):
        assert run.energy.residual == pytest.approx(0.0, abs=1e-12)


def test_friction_stops_the_shaft_and_does_not_turn_it_round(needle):
    """In steps of 5 us, each of which would take 33 mm/s from it."""
    guide = squeezed(needle, 0.2)

    run = move(needle, guide, [0] * 6, 150e-6, speed=0.1, step=5e-6)

    speed = run.history.velocity_a
    assert np.all(np.diff(speed) >= 0.0)
    assert speed[-1] == pytest.approx(0.0, abs=1e-9)
    assert run.energy.guide == pytest.approx(0.5 * MASS * 0.01 - run.energy.final, abs=1e-12)


def test_friction_needs_a_side_force(needle):
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS, friction=0.3)

    run = move(needle, guide, [0] * 6, 50e-6, speed=0.5)

    assert run.motion.velocity[-1, 2] == -0.5
    assert np.all(run.history.external_force == 0.0)


def test_a_sliding_bounce_loses_mu_times_the_side_impulse(needle):
    """Lateral bounce with impulse 2 m v_x: the axial speed falls by 2 mu v_x."""
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS, friction=0.1)

    run = move(needle, guide, [0.1, 0, 0, 0, 0, 0], 2 * CLEARANCE / 0.1 + 0.5 * PERIOD, speed=0.5)

    assert run.motion.velocity[-1, 2] == pytest.approx(-0.5 + 2 * 0.1 * 0.1, rel=1e-4)
    lost = 0.5 * MASS * (0.5**2 - 0.48**2)
    assert run.energy.guide == pytest.approx(lost, rel=1e-3)
    assert run.energy.residual == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("flight", "rtol"), [(False, 1e-6), (True, 5e-3)])
def test_viscous_drag_decays_exponentially(needle, flight, rtol):
    """Speed v0 exp(-c t / m); a step of flight lasts up to a fifth of m / c here."""
    drag, time = 30.0, 100e-6
    guide = lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS, viscous=drag)

    run = move(needle, guide, [0] * 6, time, speed=0.5, step=50e-9, flight=flight)

    decay = exp(-drag * run.motion.time[-1] / MASS)
    assert run.motion.velocity[-1, 2] == pytest.approx(-0.5 * decay, rel=rtol)
    lost = 0.5 * MASS * 0.25 * (1 - decay**2)
    assert run.energy.guide == pytest.approx(lost, rel=rtol)
    assert run.energy.residual == pytest.approx(0.0, abs=1e-12)


STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


@pytest.fixture(scope="module")
def shaft():
    """Square shaft of 4 x 4 x 24 mm with nodes at every 3 mm; all sides are its surface."""
    side, length = np.linspace(-2e-3, 2e-3, 3), np.linspace(0.0, 24e-3, 9)
    mesh = lattice_mesh("hex20", [side, side, length])
    body = elastic_body("shaft", mesh, {"solid": STEEL})
    return body, Flexibility(body)


def shaft_guide(shaft, count, **more):
    body, flexibility = shaft
    shapes = body.rigid_modes
    omega = np.zeros(6)
    if count:
        modes = eigenmodes(body, count=count, flexibility=flexibility)
        shapes, omega = np.hstack([shapes, modes.shapes]), np.concatenate([omega, modes.omega])
    model = modal_model(
        masses=(body.mass, np.inf),
        omega=omega,
        traces=np.zeros((1, len(omega))),
        compliance=np.ones((1, 1)),
        gap=np.ones(1),
    )
    settings = {"surface": "right", "heights": (6e-3, 18e-3), "clearance": 4e-6} | more
    return guide_of_shaft(model, body, shapes, flexibility, **settings), omega


@pytest.mark.parametrize("count", [0, 1, 8])
def test_consistent_law_makes_the_statics_of_a_section_exact(shaft, count):
    """Modes + residual = static flexibility of the shaft, plus the bore."""
    body, flexibility = shaft
    bore = 2e8
    guide, omega = shaft_guide(shaft, count, stiffness=bore)
    nodes = body.mesh.surface("right").nodes

    for k, height in enumerate((6e-3, 18e-3)):
        ring = nodes[np.abs(body.mesh.points[nodes, 2] - height) < 1e-9]
        load = np.zeros((body.dof_count, 2))
        load[3 * ring, 0] = load[3 * ring + 1, 1] = 1.0 / len(ring)
        exact = load.T @ flexibility.solve(load)
        modal = guide.traces[k][:, omega > 0] / omega[omega > 0]
        np.testing.assert_allclose(
            guide.compliance[k] + modal @ modal.T, exact + np.eye(2) / bore, rtol=1e-9, atol=1e-18
        )
        assert np.linalg.eigvalsh(guide.compliance[k] - np.eye(2) / bore)[0] > 0
        assert guide.heights[k] == pytest.approx(height)


def test_linear_law_is_the_bore_alone(shaft):
    guide, _ = shaft_guide(shaft, 3, stiffness=1e8, consistent=False)

    np.testing.assert_allclose(guide.compliance, np.repeat(np.eye(2)[None] / 1e8, 2, axis=0))


def test_sections_move_with_the_body(shaft):
    """Rigid modes of the guide: translation of the section, and along the axis."""
    body, _ = shaft
    guide, _ = shaft_guide(shaft, 0)
    R = np.array([[0.01, 0.02, 0.03, 0.1, 0.2, 0.3]])
    arm = np.array([[2e-3, 0.0, z] for z in guide.heights]) - body.centre_of_mass
    expected = R[0, :3] + np.cross(R[0, 3:], arm)
    field = (R[0, :3] + np.cross(R[0, 3:], body.mesh.points - body.centre_of_mass)).ravel()
    q = body.rigid_modes.T @ (body.M @ field)

    np.testing.assert_allclose(guide.traces @ q, expected[:, :2], rtol=1e-9)
    np.testing.assert_allclose(guide.slide @ q, expected[:, 2], rtol=1e-9)
    np.testing.assert_allclose(guide.offset, [[2e-3, 0.0]] * 2, atol=1e-12)


def test_drag_is_shared_and_friction_can_be_changed(shaft):
    guide, _ = shaft_guide(shaft, 1, friction=0.1, viscous=3.0)

    np.testing.assert_allclose(guide.viscous, [1.5, 1.5])
    np.testing.assert_allclose(guide.friction, [0.1, 0.1])
    np.testing.assert_allclose(guide.with_friction(0.2).friction, [0.2, 0.2])
    with pytest.raises(InputError, match="friction"):
        guide.with_friction(-0.1)


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ({"heights": (6e-3, 30e-3)}, "between 0 and 24 mm"),
        ({"consistent": False}, "stiffness of the bore"),
        ({"clearance": 0.0}, "clearance"),
        ({"friction": -1.0}, "friction"),
        ({"viscous": -1.0}, "viscous"),
        ({"surface": "collar"}, "one of"),
    ],
)
def test_errors_say_what_to_do(shaft, more, text):
    with pytest.raises(InputError, match=text):
        shaft_guide(shaft, 1, **more)


def test_a_body_of_revolution_has_no_guide(shaft):
    needle, _, _ = needle_over_seat(size=40e-6, bulk=2e-3)
    model = modal_model(
        masses=(needle.mass, np.inf),
        omega=np.zeros(1),
        traces=np.ones((1, 1)),
        compliance=np.ones((1, 1)),
        gap=np.ones(1),
    )

    with pytest.raises(InputError, match="swept or solid"):
        guide_of_shaft(
            model,
            needle,
            needle.rigid_modes,
            Flexibility(needle),
            surface="guide",
            heights=(10e-3,),
            clearance=4e-6,
        )
