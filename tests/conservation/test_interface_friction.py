"""Energy and momentum of bodies whose faces rub, point by point.

Truth: conservation.  The known numbers of friction are in ``klack verify --group friction``.
"""

from dataclasses import replace

import numpy as np
import pytest

from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import lateral_guide, reduce_bodies, rubbing_faces
from klack.verification.transient import block_between_plates, free_blocks

pytestmark = pytest.mark.slow


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
