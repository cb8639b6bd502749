"""Statics of the interface model; truth: static solutions of the whole bodies.

Modes and residual compliance together answer *every* load pattern exactly, for any number of modes.
"""

import numpy as np
import pytest

from klack.bodies.elasticity.statics import Flexibility
from klack.transient.interface_model import InterfaceContact, rigid_motion
from klack.verification.interface_bodies import free_rod, reduce_bodies, rod_between_stops
from klack.verification.transient import block_between_plates, free_blocks

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def blocks():
    return free_blocks()


@pytest.fixture(scope="module")
def plates():
    bodies, contacts = block_between_plates(40e-6)
    return bodies, contacts, reduce_bodies(bodies, contacts, (6, 3, 3))[0]


def modal_compliance(model):
    elastic = model.omega > 0
    shares = model.traces[:, elastic] / model.omega[elastic]
    return shares @ shares.T


@pytest.mark.parametrize("counts", [(0, 0), (1, 2), (12, 7)])
def test_any_pressure_pattern_has_its_exact_static_answer(blocks, counts):
    a, b, space = blocks
    contact = InterfaceContact(name="face", upper="upper", lower="lower", space=space)
    rng = np.random.default_rng(3)
    one_point, ring = np.zeros(space.count), rng.uniform(0.5, 1.5, space.count)
    one_point[space.count // 3] = 1.0
    loads = np.column_stack([one_point, ring, rng.uniform(0.0, 1.0, space.count) ** 8])

    model, _ = reduce_bodies((a, b), [contact], counts)

    with Flexibility(a) as on_a, Flexibility(b) as on_b:
        exact = space.G_a @ on_a.solve(space.G_a.T @ loads)
        exact += space.G_b @ on_b.solve(space.G_b.T @ loads)
    ours = (model.compliance + modal_compliance(model)) @ loads
    np.testing.assert_allclose(ours, exact, atol=1e-12 * np.abs(exact).max())
    assert np.linalg.eigvalsh(model.compliance)[0] > 0
    assert model.checks.reciprocity < 1e-12
    assert np.sum(model.omega == 0) == 12  # both bodies are free


def test_more_modes_leave_less_to_the_residual(blocks):
    a, b, space = blocks
    contact = InterfaceContact(name="face", upper="upper", lower="lower", space=space)

    shares = [reduce_bodies((a, b), [contact], (n, n))[0].checks.modal_share for n in (0, 3, 12)]

    assert shares[0] == 0.0
    assert shares[0] < shares[1] < shares[2] < 1.0


def test_rigid_modes_of_the_model_are_those_of_the_body(blocks):
    """A unit translation or rotation moves every gap as the geometry says."""
    a, b, space = blocks
    contact = InterfaceContact(name="face", upper="upper", lower="lower", space=space)
    model, _ = reduce_bodies((a, b), [contact], (2, 2))
    R = model.rigid[:, :6]
    arm = a.mesh.points - a.centre_of_mass

    for k, motion in enumerate(np.eye(6)):
        field = motion[:3] + np.cross(motion[3:], arm)
        gaps = space.G_a @ field.ravel()
        q = np.linalg.solve(R, motion)
        np.testing.assert_allclose(
            model.traces[:, :6] @ q, gaps, atol=1e-9 * max(1.0, np.abs(gaps).max()), err_msg=str(k)
        )
    np.testing.assert_allclose(model.axial, model.traces[:, :6] @ np.linalg.solve(R, np.eye(6)[2]))
    kinetic = R @ R.T  # inverse of the inertia of the body
    np.testing.assert_allclose(np.linalg.inv(kinetic[:3, :3]), a.mass * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(kinetic[3:, 3:]), a.inertia, rtol=1e-9, atol=1e-18)
    np.testing.assert_array_equal(model.rigid[:, 6:], 0.0)
    np.testing.assert_allclose(rigid_motion(a), R)


def test_two_contacts_of_one_body_are_coupled(plates):
    """A force on the seat moves the gap at the stop, and the other way round (Maxwell)."""
    bodies, contacts, model = plates
    (_, low, high), (_, low2, high2) = model.contacts
    whole = model.compliance + modal_compliance(model)
    with Flexibility(bodies[0]) as block:
        # the block is the upper body of the seat and the lower one of the stop
        cross = contacts[1].space.G_b @ block.solve(contacts[0].space.G_a.T.toarray())

    np.testing.assert_allclose(whole[low2:high2, low:high], cross, atol=1e-12 * np.abs(whole).max())
    np.testing.assert_array_equal(model.compliance, model.compliance.T)
    assert np.linalg.eigvalsh(model.compliance)[0] > 0
    assert np.abs(cross).max() > 1e-3 * np.abs(whole).max()
    assert model.checks.static_limit < 1e-12
    assert model.axial[low:high].min() > 0.99
    assert model.axial[low2:high2].max() < -0.99


def test_end_to_end_compliance_of_a_rod():
    """Free steel rod with inertia relief: L/(3EA) at an end, L/(6EA) from end to end."""
    soft = 30e-3 / (210e9 * np.pi * 2e-3**2)
    for modes in (1, 4, 30):
        model = rod_between_stops(modes, stiffness=1e9, gaps=(0.0, 0.0))

        whole = model.compliance + modal_compliance(model)

        np.testing.assert_allclose(np.diag(whole), soft / 3 + 1e-9, rtol=1e-12)
        np.testing.assert_allclose(whole[0, 1], soft / 6, rtol=1e-12)
        assert np.linalg.eigvalsh(model.compliance)[0] > 0
    one = free_rod(4, stiffness=1e9)
    assert one.compliance[0, 0] == rod_between_stops(4, stiffness=1e9, gaps=(0, 0)).compliance[0, 0]
