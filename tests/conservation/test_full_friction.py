"""Energy and momentum where faces rub.

Friction in full-order impacts: momentum, energy and the law (conservation, exact limits).

Energy and momentum of bodies whose faces rub, point by point.

Truth: conservation.  The known numbers of friction are in ``klack verify --group friction``.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace, contact_space, tangent_rows, touching_shift
from klack.errors import InputError
from klack.mesh.swept import sweep
from klack.transient.full_order import simulate_full_order
from klack.transient.interface_run import simulate_interface
from klack.transient.result import FullOrderResult
from klack.transient.rubbing import OPEN, SLIP, STICK
from klack.verification.interface_bodies import lateral_guide, reduce_bodies, rubbing_faces
from klack.verification.transient import (
    STEEL,
    block_between_plates,
    free_blocks,
    needle_over_seat,
    sphere_over_cylinder,
)

pytestmark = pytest.mark.slow


SCHEMES = ["contact-stabilised-newmark", "massless"]


@cache
def seat() -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Needle that hits a cone of 90 degrees, axisymmetric."""
    return needle_over_seat(size=12e-6, bulk=1e-3, length=8e-3)


@cache
def balls() -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Solid ball over a solid block, both free; the block is turned by 0.13 rad."""
    a, b, _ = sphere_over_cylinder(
        sphere_radius=2e-3, radius=3e-3, height=3e-3, size=120e-6, bulk=3e-3
    )
    ball, block = sweep(a.mesh, 8), sweep(b.mesh, 8, start_angle=0.13)
    faces = ball.surface("ball"), block.surface("top")
    ball = ball.moved(np.array([0.0, 0.0, touching_shift(ball, faces[0], block, faces[1])]))
    return (
        elastic_body("ball", ball, {"ball": STEEL}),
        elastic_body("block", block, {"block": STEEL}),
        contact_space(ball, faces[0], block, faces[1], reach=8e-6),
    )


NAMES = {seat: ("tip", "cone"), balls: ("ball", "top")}


@cache
def rows(problem) -> tuple[csr_array, csr_array]:
    a, b, space = problem()
    of_a, of_b = NAMES[problem]
    return tangent_rows(space, a.mesh, a.mesh.surface(of_a), b.mesh, b.mesh.surface(of_b))


@cache
def run(problem, law: Friction | float | None, **options) -> FullOrderResult:
    a, b, space = problem()
    friction = None
    if law is not None:
        T_a, T_b = rows(problem)
        law = law if isinstance(law, Friction) else Friction.coulomb(law)
        friction = FaceFriction(law=law, T_a=T_a, T_b=T_b)
    given = {"speed": 0.3, "duration": 25e-6, "step": 100e-9, "energy_interval": 1} | options
    if "across" in given:
        given["across"] = np.array(given["across"])
    return simulate_full_order(a, b, space, friction=friction, **given)


def oblique(law, **options) -> FullOrderResult:
    return run(
        balls,
        law,
        **({"across": (0.3, 0.2, 0.0, 0.0, 0.0, 0.0), "duration": 15e-6, "step": 200e-9} | options),
    )


@pytest.mark.parametrize("scheme", SCHEMES)
def test_no_coefficient_is_no_friction(scheme):
    """To the bit."""
    without, zero = run(seat, None, scheme=scheme), run(seat, 0.0, scheme=scheme)
    assert zero.rubbing is None
    np.testing.assert_array_equal(without.history.force, zero.history.force)
    np.testing.assert_array_equal(without.point_force, zero.point_force)
    np.testing.assert_array_equal(without.fields[0].end_velocity, zero.fields[0].end_velocity)


@pytest.mark.parametrize("law", [0.1, 0.6, Friction(kinetic=0.1, static=0.2, speed=0.05)], ids=str)
def test_friction_takes_energy_in_every_step(law):
    """E1 - E0 = lam_t^T s <= 0, one force per step: a loss of strict sign, and no other entry."""
    energy = run(seat, law).energy
    scale = energy.total[0]

    assert np.max(np.abs(energy.residual)) < 1e-9 * scale
    assert np.min(np.diff(energy.friction)) >= 0.0
    assert energy.friction[-1] > 0.01 * scale
    assert np.min(np.diff(energy.contact)) > -1e-11 * scale
    assert np.max(np.diff(energy.total)) <= 5e-11 * scale


def test_massless_scheme_agrees():
    """Forces at the ends of the steps: friction keeps its sign, and the energy its balance."""
    massless, stabilised = run(seat, 0.1, scheme="massless"), run(seat, 0.1)
    energy, scale = massless.energy, massless.energy.total[0]

    assert np.max(np.abs(energy.residual)) < 1e-9 * scale
    assert np.min(np.diff(energy.friction)) >= 0.0
    assert energy.friction[-1] == pytest.approx(stabilised.energy.friction[-1], rel=0.01)
    assert massless.history.force.max() == pytest.approx(stabilised.history.force.max(), rel=2e-3)


def test_energy_of_single_precision_balances():
    single, double = run(seat, 0.1, precision="single"), run(seat, 0.1)
    assert abs(single.history.ledger.residual) < 1e-9
    assert single.energy.friction[-1] == pytest.approx(double.energy.friction[-1], rel=1e-4)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_impulse_of_the_axial_force_is_the_change_of_momentum(scheme):
    """On a cone friction has a part along z, counted in the contact force."""
    history = run(seat, 0.3, scheme=scheme).history
    gained = history.mass_a * (history.velocity_a[-1] - history.velocity_a[0])
    assert history.impulse == pytest.approx(gained, rel=1e-9)


def test_forces_obey_the_law():
    result = run(seat, 0.1)
    rubbing, normal = result.rubbing, result.point_force
    assert rubbing is not None
    size = np.linalg.norm(rubbing.force, axis=1)
    assert set(np.unique(rubbing.doing)) == {OPEN, STICK, SLIP}
    slips = rubbing.doing == SLIP
    np.testing.assert_allclose(size[slips], 0.1 * normal[slips], rtol=1e-6)
    assert np.all(size <= 0.1 * normal * (1.0 + 1e-6) + 1e-9)
    assert not size[rubbing.doing == OPEN].any()


def restitution(law) -> float:
    return float(run(seat, law).history.velocity_a[-1] / 0.3)


def test_a_seat_of_rubbing_faces_returns_less_speed():
    """Until so much friction that the faces hold: half angle 45 degrees, sticking from mu = 1."""
    speeds = [restitution(mu) for mu in (None, 0.03, 0.1, 0.2)]
    assert np.all(np.diff(speeds) < -0.002)
    lost = {mu: run(seat, mu).energy.friction[-1] for mu in (0.1, 0.6, 100.0)}
    assert lost[0.1] > lost[0.6] > lost[100.0]


def test_faces_that_stick_lose_nothing():
    result = run(seat, 100.0)
    assert result.rubbing is not None
    assert result.energy.friction[-1] < 1e-9 * result.energy.total[0]
    assert SLIP not in result.rubbing.doing
    assert STICK in result.rubbing.doing


def momentum(body: ElasticBody, velocity: np.ndarray) -> np.ndarray:
    return (body.M @ velocity).reshape(-1, 3).sum(axis=0)


@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_an_oblique_impact_keeps_the_momentum_in_every_direction(mu):
    a, b, _ = balls()
    result = oblique(mu)
    mass = result.history.mass_a
    total = sum(
        momentum(body, field.end_velocity)
        for body, field in zip((a, b), result.fields, strict=True)
    )
    np.testing.assert_allclose(total / mass, [0.3, 0.2, -0.3], atol=1e-12)
    assert np.max(np.abs(result.energy.residual)) < 1e-9 * result.energy.total[0]
    assert np.min(np.diff(result.energy.friction)) >= 0.0


def test_a_ball_that_slides_gains_mu_times_the_impulse():
    """Coulomb: the lateral impulse is mu times the normal one, against the motion."""
    _, b, _ = balls()
    result = oblique(0.02)
    assert result.rubbing is not None
    assert STICK not in result.rubbing.doing
    given = momentum(b, result.fields[1].end_velocity)[:2]
    wanted = 0.02 * result.history.impulse * np.array([3.0, 2.0]) / np.sqrt(13.0)
    np.testing.assert_allclose(given, wanted, rtol=1e-3)


def test_direction_of_the_motion_does_not_matter():
    """Bodies swept in 8 layers: a turn by a quarter is a symmetry of both."""
    first, turned = oblique(0.1), oblique(0.1, across=(-0.2, 0.3, 0.0, 0.0, 0.0, 0.0))
    assert turned.energy.friction[-1] == pytest.approx(first.energy.friction[-1], rel=1e-6)
    scale = first.history.force.max()
    np.testing.assert_allclose(turned.history.force, first.history.force, atol=1e-6 * scale)


def test_static_coefficient_holds_until_the_first_slip():
    """Faces below the kinetic limit stick under both; a static one above delays the slip."""
    plain, held = run(seat, 0.1), run(seat, Friction(kinetic=0.1, static=100.0))
    assert held.rubbing is not None
    assert SLIP not in held.rubbing.doing
    assert plain.rubbing is not None
    assert SLIP in plain.rubbing.doing


def test_sideways_motion_of_an_axisymmetric_body_is_refused():
    with pytest.raises(InputError, match="axisymmetric"):
        run(seat, None, across=(0.1, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_foreign_rows_are_refused():
    a, b, space = seat()
    T_a, T_b = rows(seat)
    friction = FaceFriction(law=Friction.coulomb(0.1), T_a=T_a[1:], T_b=T_b)
    with pytest.raises(InputError, match="1 for each contact point"):
        simulate_full_order(
            a,
            b,
            space,
            speed=0.3,
            duration=1e-6,
            friction=friction,
        )


@pytest.fixture(scope="module")
def blocks():
    a, b, space = free_blocks()
    return reduce_bodies((a, b), [rubbing_faces(a, b, space, ("bottom", "top"), 0.2)], (8, 8))[0]


def hit(model, friction, *, sideways=0.3, **options):
    model = replace(model, friction=(friction,) * len(model.friction))
    return simulate_interface(
        model,
        speed=0.5,
        duration=60e-6,
        step=80e-9,
        velocity=np.array([sideways, 0.1, 0.0, 2.0, -3.0, 10.0]),
        **options,
    )


@pytest.mark.parametrize(
    "friction",
    [
        Friction.coulomb(0.05),
        Friction.coulomb(0.4),
        Friction.coulomb(2.0),
        Friction(kinetic=0.1, static=0.3),
        Friction(kinetic=0.1, static=0.3, speed=0.05),
    ],
    ids=repr,
)
def test_energy_is_kept_but_for_friction(blocks, friction):
    result = hit(blocks, friction)
    # faces that hold whatever comes leave some debt that the last step of the contact cannot pay
    limit = 1e-12 if friction.static < 1.0 else 1e-5
    assert abs(result.energy.residual) < limit
    assert result.energy.friction > 0.0
    assert result.history.ledger.friction == result.energy.friction


def test_friction_pushes_against_the_slip(blocks):
    still, moving = (
        hit(blocks, Friction.coulomb(0.2), sideways=0.0),
        hit(blocks, Friction.coulomb(0.2)),
    )
    lost = 0.3 - moving.motion.velocity[-1, 0] + still.motion.velocity[-1, 0]
    # two blocks: the upper one loses most of mu (1 + e) v m_b / (m_a + m_b), none gains
    assert 0.02 < lost < 0.3
    smooth = hit(blocks.without_friction(), Friction.coulomb(0.0))
    assert smooth.energy.friction == 0.0
    assert abs(smooth.motion.velocity[-1, 0] - 0.3) < 0.01


def test_records_hold_the_sum_of_the_forces(blocks):
    result = hit(blocks, Friction.coulomb(0.2))
    segment, ways = result.impacts[0], blocks.ways
    axial = segment.point_force @ blocks.axial + segment.friction_force @ blocks.axial_across
    np.testing.assert_allclose(axial, result.history.force, atol=1e-4 * axial.max())
    assert segment.friction_force.shape == (len(axial), ways * blocks.count)
    assert segment.doing.shape == (len(axial), blocks.count)


def test_faces_and_guide_rub_at_once(blocks):
    guide = lateral_guide(blocks, clearance=1e-6, stiffness=2e7, friction=0.2, heights=(0.5e-3,))
    result = hit(blocks, Friction.coulomb(0.2), guide=guide)
    assert abs(result.energy.residual) < 1e-10
    assert result.energy.guide > 0.0
    assert result.energy.friction > 0.0


def test_two_stops_with_different_friction():
    bodies, contacts = block_between_plates(2e-6)
    names = {body.name: body for body in bodies}
    faces = {"seat": ("bottom", "top"), "stop": ("bottom", "top")}
    rubbing = [
        replace(
            contact,
            faces=FaceFriction.on(
                Friction.coulomb(mu),
                contact.space,
                names[contact.upper].mesh,
                names[contact.upper].mesh.surface(faces[contact.name][0]),
                names[contact.lower].mesh,
                names[contact.lower].mesh.surface(faces[contact.name][1]),
            ),
        )
        for contact, mu in zip(contacts, (0.3, 0.0), strict=True)
    ]
    model = reduce_bodies(bodies, rubbing, (4, 4, 4))[0]
    result = simulate_interface(
        model,
        speed=0.2,
        duration=200e-6,
        step=80e-9,
        height=1e-6,
        flight=True,
        velocity=np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]),
    )
    assert {1.0, -1.0} <= {impact.side for impact in result.impacts}
    assert abs(result.energy.residual) < 1e-12
    for impact in result.impacts:
        lost = impact.history.ledger.friction
        assert lost > 0.0 if impact.side > 0 else lost == 0.0
        assert impact.history.force.min() >= 0.0
