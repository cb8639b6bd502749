"""Sections of a shaft of revolution, and its ports among modes of all orders.

Truth: rigid motions, by which every section moves exactly; the same shaft as a solid; the motion
along the axis, which further orders leave as it is.
"""

import numpy as np
import pytest

from klack.elasticity.body import elastic_body
from klack.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.mesh.swept import sweep
from klack.transient.guide import _section
from klack.transient.revolved_guide import turned_sections
from klack.verification.ring_bodies import NeedleOnRing, RingStroke
from klack.verification.transient import STEEL

HEIGHTS = (5e-3, 0.0123, 20e-3)  # on a ring of nodes or between two


@pytest.fixture(scope="module")
def pair():
    return NeedleOnRing(bulk=2e-3)


@pytest.fixture(scope="module")
def sections(pair):
    return turned_sections("needle", pair.bodies[0].mesh, "guide", HEIGHTS)


@pytest.fixture(scope="module")
def stroke():
    return RingStroke(pair=NeedleOnRing(), placement=np.array([3e-7, 1e-7, 0.0, 5e-5, 0.0, 0.0]))


def test_sections_follow_rigid_motions(pair, sections):
    assert sections.radius == pytest.approx(2e-3, rel=1e-12)
    for order in (0, 1):
        body = pair.in_order(0)(order)
        shift, turn = np.split(sections.of_order(order) @ body.rigid_motions, 2)
        far = np.hypot(2e-3, np.abs(pair.bodies[0].mesh.points[:, 1] - body.centre_of_mass).max())
        arm = np.array(HEIGHTS) - body.centre_of_mass
        angle = 1.0 / (pair.bodies[0].mesh.points[:, 0].max() if order == 0 else far)
        np.testing.assert_allclose(shift[:, 0], 1.0, rtol=1e-12)
        np.testing.assert_allclose(turn[:, 0], 0.0, atol=1e-9 * angle)
        # the farthest point moves by 1; the tip is on the axis
        if order == 0:
            np.testing.assert_allclose(shift[:, 1], 0.0, atol=1e-12)
            np.testing.assert_allclose(turn[:, 1], angle, rtol=1e-12)
        else:
            np.testing.assert_allclose(shift[:, 1], arm * turn[:, 1], rtol=1e-12)
            np.testing.assert_allclose(turn[:, 1], turn[0, 1], rtol=1e-12)
    assert sections.of_order(2).nnz == 0


@pytest.mark.slow
def test_rigid_modes_turn_and_shift_sections(stroke):
    """Rotation vectors of sections are those of the needle, with their signs."""
    model, points = stroke._reduced
    centre, rigid = model.centre, points[0].body.rigid
    for section, height in zip(points[0].sections, stroke.sections.heights, strict=True):
        arm = np.array([0.0, 0.0, height]) - centre
        np.testing.assert_allclose(section[3:, :6], rigid[3:], atol=1e-9 * np.abs(rigid[3:]).max())
        moved = rigid[:3] + np.cross(rigid[3:].T, arm).T
        np.testing.assert_allclose(section[:3, :6], moved, atol=1e-9 * np.abs(moved).max())


@pytest.mark.slow
def test_a_section_yields_as_that_of_a_solid(pair):
    needle = pair.bodies[0].mesh
    (solid,) = needle.solids
    whole = elastic_body("needle", sweep(needle, 12), {solid: STEEL})
    loads = np.column_stack([_section(whole, "guide", z).load[:, 0] for z in HEIGHTS])
    with Flexibility(whole) as flexibility:
        expected = np.einsum("ik,ik->k", loads, flexibility.deflections(loads))
    across = turned_sections("needle", needle, "guide", HEIGHTS).of_order(1)[:3].toarray().T
    with Flexibility(pair.in_order(0)(1)) as flexibility:
        found = np.einsum("ik,ik->k", across, flexibility.deflections(across))

    np.testing.assert_allclose(found, expected, rtol=4e-3)  # 12 layers


@pytest.mark.slow
def test_ports_move_along_the_axis_as_before(stroke):
    for number, body in enumerate(stroke.bodies):
        alone = stroke.along_axis(number)
        assert body.rigid_count == (6 if number == 0 else 0)
        if number == 0:
            assert float(body.rigid_axial @ body.rigid_axial) == pytest.approx(body.mass, rel=1e-12)
        for shape, other in ((body, alone), (alone, body)):
            pushed = shape.omega[np.abs(shape.port_shapes[:, 0]) > 1e-9]
            assert np.all(np.isclose(pushed[:, None], other.omega, rtol=1e-12).any(axis=1))
        # the same mobility at the port, at a frequency between modes
        s = 2.0 * np.pi * 33e3
        a, b = (np.sum(r.port_shapes[:, 0] ** 2 / (r.omega**2 - s**2)) for r in (body, alone))
        assert a == pytest.approx(b, rel=1e-9)
        assert body.static_compliance == pytest.approx(alone.static_compliance, rel=1e-12)


def test_a_guide_needs_a_shaft(pair):
    mesh = pair.bodies[0].mesh
    with pytest.raises(InputError, match="cylinder around the axis"):
        turned_sections("needle", mesh, "end", HEIGHTS)
    with pytest.raises(InputError, match="heights"):
        turned_sections("needle", mesh, "guide", (5e-3, 0.5))
