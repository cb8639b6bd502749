"""The guide of a needle; truth: motion of a rigid body on springs, with friction and with drag."""

from dataclasses import replace
from math import exp, pi, sqrt

import numpy as np
import pytest
from energy_ledger import allowed

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.mesh.mesh import Surface
from klack.mesh.profile import Line, Profile
from klack.mesh.rigid import Pose
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_revolved
from klack.transient.guide import guide_of_shaft
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import lateral_guide, modal_model, rigid_body
from klack.verification.lattice import lattice_mesh
from klack.verification.transient import STEEL, needle_over_seat

pytestmark = pytest.mark.slow

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
    run = move(
        needle,
        lateral_guide(needle, clearance=CLEARANCE, stiffness=STIFFNESS),
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

    assert half.motion.velocity[-1, 2] == pytest.approx(-0.25, rel=1e-5)
    assert abs(rest.motion.velocity[-1, 2]) < 1e-9
    assert rest.motion.position[-1, 2] == pytest.approx(-0.5 * 0.5**2 / braking, rel=1e-5)
    for run in (half, rest):
        assert run.energy.residual == pytest.approx(0.0, abs=1e-12)


def test_friction_stops_the_shaft_and_does_not_turn_it_round(needle):
    """In steps of 5 us, each of which would take 33 mm/s from it."""
    guide = squeezed(needle, 0.2)

    # the squeezed springs hold 17 times m v^2/2, and sway a little in such steps
    with allowed("simulate_interface", 1e-2):
        run = move(needle, guide, [0] * 6, 150e-6, speed=0.1, step=5e-6)

    assert abs(run.energy.residual) < 1e-12
    speed = run.history.velocity_a
    assert np.all(np.diff(speed) >= 0.0)
    assert speed[-1] == pytest.approx(0.0, abs=1e-9)
    with allowed("simulate_interface", 1e300):  # nothing but the walls, swaying
        smooth = move(needle, squeezed(needle, 0.0), [0] * 6, 150e-6, step=5e-6)
    lost = run.energy.guide - smooth.energy.guide
    assert lost == pytest.approx(0.5 * MASS * 0.01, rel=1e-9)


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


LENGTH, RADIUS = 24e-3, 2e-3


def round_shaft(structured):
    """Cylinder D4 x L24 mm; swept in layers of 3 mm, or tetrahedra that know no rings."""
    edges = (
        Line((RADIUS, 0.0), "bottom"),
        Line((RADIUS, LENGTH), "shaft"),
        Line((0.0, LENGTH), "end"),
        Line((0.0, 0.0), "axis"),
    )
    profile = {"shaft": Profile((0.0, 0.0), edges)}
    if not structured:
        return mesh_revolved(profile, MeshSizing(size=1.5e-3))
    square, z = np.linspace(-1.0, 1.0, 5), np.linspace(0.0, LENGTH, 9)

    def disc(x):
        """Square to disc: concentric squares become circles."""
        out = x.copy()
        reach = np.max(np.abs(x[:, :2]), axis=1)
        length = np.maximum(np.linalg.norm(x[:, :2], axis=1), 1e-12)
        out[:, :2] *= (RADIUS * reach / length)[:, None]
        return out

    mesh = lattice_mesh("hex20", [square, square, z], disc)
    sides = [mesh.surface(name) for name in ("left", "right", "front", "back")]
    skin = Surface("shaft", tuple(block for side in sides for block in side.blocks))
    return replace(mesh, surfaces={**mesh.surfaces, "shaft": skin})


@pytest.fixture(scope="module", params=[True, False], ids=["hexahedra", "tetrahedra"])
def shaft(request):
    mesh = round_shaft(request.param)
    body = elastic_body("shaft", mesh, {mesh.solids[0]: STEEL})
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
    settings = {"surface": "shaft", "heights": (6e-3, 18e-3), "clearance": 4e-6} | more
    return guide_of_shaft(model, body, shapes, flexibility, **settings), omega


@pytest.mark.parametrize("count", [0, 1, 8])
def test_consistent_law_makes_the_statics_of_a_section_exact(shaft, count):
    """Modes + residual = static flexibility, whatever is kept, plus the bore."""
    bore = 2e8
    guide, omega = shaft_guide(shaft, count, stiffness=bore)
    whole, _ = shaft_guide(shaft, 0)

    for k in range(2):
        modal = guide.traces[k][:, omega > 0] / omega[omega > 0]
        np.testing.assert_allclose(
            guide.compliance[k] + modal @ modal.T,
            whole.compliance[k] + np.eye(2) / bore,
            rtol=1e-9,
            atol=1e-18,
        )
        assert np.linalg.eigvalsh(guide.compliance[k] - np.eye(2) / bore)[0] > 0


def test_a_load_on_a_section_bends_the_shaft_as_a_beam():
    """Free shaft, force P at 6 mm: deflection there by Timoshenko's beam with inertia relief."""
    mesh = round_shaft(True)
    body = elastic_body("shaft", mesh, {mesh.solids[0]: STEEL})

    guide, _ = shaft_guide((body, Flexibility(body)), 0)

    x = np.linspace(0.0, LENGTH, 4001)
    h, at = x[1], 1000  # 6 mm
    mass, arm = 1.0 / LENGTH, x - 0.5 * LENGTH
    # rigid acceleration under a unit force, its inertia forces, shear and bending moment
    accelerated = mass * (1.0 + 12.0 / LENGTH**2 * arm[at] * arm)
    shear = np.append(0.0, np.cumsum(0.5 * (accelerated[1:] + accelerated[:-1])) * h)
    shear = shear - (x > x[at])
    moment = np.append(0.0, np.cumsum(0.5 * (shear[1:] + shear[:-1])) * h)
    area, inertia = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
    kappa = 6 * 1.3 / (7 + 6 * 0.3)
    expected = np.sum(moment**2) * h / (210e9 * inertia)
    expected += np.sum(shear**2) * h / (kappa * STEEL.shear_modulus * area)
    assert guide.compliance[0, 0, 0] == pytest.approx(expected, rel=0.1)  # a ring dents locally
    assert guide.compliance[0, 0, 0] > expected
    assert guide.compliance[0, 0, 1] == pytest.approx(0.0, abs=1e-6 * expected)


def test_linear_law_is_the_bore_alone(shaft):
    guide, _ = shaft_guide(shaft, 3, stiffness=1e8, consistent=False)

    np.testing.assert_allclose(guide.compliance, np.repeat(np.eye(2)[None] / 1e8, 2, axis=0))


def test_sections_move_as_the_axis_does(shaft):
    """Any rigid motion: displacement of the axis at the height of the section, exactly."""
    body, _ = shaft
    guide, _ = shaft_guide(shaft, 0)
    shift, turn = np.array([0.01, 0.02, 0.03]), np.array([0.1, 0.2, 0.3])
    heights = np.column_stack([np.zeros((2, 2)), guide.heights])
    expected = shift + np.cross(turn, heights - body.centre_of_mass)
    field = (shift + np.cross(turn, body.mesh.points - body.centre_of_mass)).ravel()
    q = body.rigid_modes.T @ (body.M @ field)

    np.testing.assert_allclose(guide.heights, (6e-3, 18e-3), rtol=1e-12)
    np.testing.assert_allclose(guide.traces @ q, expected[:, :2], rtol=1e-6)
    np.testing.assert_allclose(guide.slide @ q, expected[:, 2], rtol=1e-6)
    np.testing.assert_allclose(guide.turn @ q, [turn, turn], rtol=1e-6)
    np.testing.assert_allclose(guide.radius, RADIUS, rtol=1e-9)


def test_a_shaft_that_leans_off_its_axis_is_found_where_it_is(shaft):
    """3 um aside and leaning by 1 mrad about its middle: axis of the section within 20 nm."""
    body, _ = shaft
    pose = Pose(
        rotation=np.array([0.0, 1e-3, 0.0]),
        about=np.array([0.0, 0.0, 12e-3]),
        shift=np.array([3e-6, -1e-6, 0.0]),
    )
    placed = replace(body, mesh=body.mesh.placed(pose))

    guide, _ = shaft_guide((placed, Flexibility(placed)), 0)

    aside = 3e-6 + 1e-3 * (guide.heights - 12e-3)
    np.testing.assert_allclose(guide.offset, np.column_stack([aside, [-1e-6] * 2]), atol=20e-9)


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
        ({"heights": (6e-3, 30e-3)}, "and 24 mm"),
        ({"consistent": False}, "stiffness of the bore"),
        ({"clearance": 0.0}, "clearance"),
        ({"friction": -1.0}, "friction"),
        ({"viscous": -1.0}, "viscous"),
        ({"surface": "collar"}, "one of"),
        ({"surface": "bottom", "heights": (0.0,)}, "cylinder around the axis"),
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
