"""Rings of contact points off the axis.

Points on rings: sums over Fourier orders and the resultants of forces.

Truth: the sum written out, sines and cosines alone, trigonometric interpolation, rigid motions.

Gaps of a needle off its axis; truth: a sphere and a cone, and the rigid modes to first order.

Sections of a shaft of revolution, and its ports among modes of all orders.

Truth: rigid motions, by which every section moves exactly; the same shaft as a solid; the motion
along the axis, which further orders leave as it is.

Whether points of first touch are a ring; truth: where they were put.

A body placed off its axis: truth = a rigid motion, and a sphere on a cone.

A sphere of radius R whose centre is at the distance e from the axis of a cone z = r tan(a) touches
it on the side it was shifted to.  The centre is then R away from the straight line of that side, at
the height z = e tan(a) + R/cos(a): higher by e tan(a) than centred.  A lean by the angle t about a
point of the axis at the distance h from the centre of the sphere shifts that centre by h sin(t) and
lowers it by h (1 - cos t).
"""

from math import cos, pi, sin

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.assembling.bodies import build_bodies
from klack.assembling.touch_ring import goes_round
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.ring_points import (
    RingPoints,
    RingRows,
    resolved_orders,
    share_of_order,
)
from klack.bodies.elasticity.statics import Flexibility
from klack.case import find_case, read_case
from klack.errors import AccuracyWarning, InputError
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Line, Profile
from klack.mesh.rigid import Pose, rotation_matrix
from klack.mesh.sizing import MeshSizing
from klack.mesh.swept import sweep
from klack.transient.guide import _section, turned_sections
from klack.verification.interface import gaps_of_sphere_over_cone
from klack.verification.ring_bodies import NeedleOnRing, RingStroke
from klack.verification.transient import STEEL


def points_of(count, rows=(0, 1, 2), sine=(False, False, True)):
    """All angles of three rows, the last of which reads along the ring."""
    row, turn = (x.ravel() for x in np.meshgrid(rows, np.arange(count), indexing="ij"))
    return RingPoints(row=row, turn=turn, count=count, is_sine=np.array(sine))


def spectrum_of(count, rows=3):
    """Symmetric positive compliances that fall with the order."""
    A = np.random.default_rng(count).normal(size=(count // 2 + 1, rows, rows))
    spectrum = A @ A.transpose(0, 2, 1) / (1.0 + np.arange(count // 2 + 1))[:, None, None]
    # in order 0 what moves along the ring is torsion alone
    spectrum[0, :2, 2] = spectrum[0, 2, :2] = 0.0
    return spectrum


@pytest.mark.parametrize("count", [8, 9, 24, 25])
def test_compliance_is_the_sum_over_the_orders(count):
    """Force at j, motion bent towards it: u_r ~ cos n(t - t_j), u_theta ~ sin n(t - t_j)."""
    points, spectrum = points_of(count), spectrum_of(count)

    C = points.compliance(spectrum)

    for i, j in np.random.default_rng(1).integers(0, len(points.row), (60, 2)):
        apart = points.angle[i] - points.angle[j]
        own, other = points.is_sine[points.row[[i, j]]]
        total = 0.0
        for n in range(count // 2 + 1):
            share = 0.5 if 2 * n == count else 1.0
            # a force along the ring bends the body towards a quarter of a wave ahead of it
            wave = np.cos(n * apart) if own == other else np.sin(n * apart)
            sign = -1.0 if other and not own else 1.0
            total += share * sign * spectrum[n, points.row[i], points.row[j]] * wave
        assert C[i, j] == pytest.approx(total, rel=1e-12, abs=1e-13)
    np.testing.assert_allclose(C, C.T, atol=1e-13)
    assert np.linalg.eigvalsh(C)[0] > 0


@pytest.mark.parametrize("count", [8, 9, 24, 25])
def test_modes_and_forces_of_an_order_make_the_same_compliance(count):
    """Each order once more as two motions with their own factors, as modes are read."""
    points, spectrum = points_of(count), spectrum_of(count)
    again = np.zeros((len(points.row),) * 2)
    for n in resolved_orders(count):
        c = spectrum[n][np.ix_(points.row, points.row)]
        for factor in points.factors(n):
            again += share_of_order(n, count) * factor[:, None] * c * factor

    np.testing.assert_allclose(points.compliance(spectrum), again, atol=1e-12)


@pytest.mark.parametrize("count", [12, 13])
def test_a_wave_of_forces_answers_in_its_own_order(count):
    """A line load cos(n t) of unit amplitude: 2 pi / N per point, and pi c_n, n = N/2 included."""
    points = points_of(count, rows=(0,), sine=(False,))
    spectrum = np.arange(1.0, count // 2 + 2)[:, None, None]
    C = points.compliance(spectrum)
    for n in range(1, count // 2 + 1):
        load = 2.0 * np.pi / count * np.cos(n * points.angle)
        np.testing.assert_allclose(
            C @ load, np.pi * spectrum[n, 0, 0] * np.cos(n * points.angle), atol=1e-12
        )


@pytest.mark.parametrize("count", [12, 13])
def test_forces_give_the_resultants_of_a_rigid_body(count):
    """Order 1 sums forces along x and y, of radial and hoop forces alike."""
    points = points_of(count)
    loads = np.random.default_rng(2).normal(size=(len(points.row), 1))
    first, second = points.forces(1, loads)
    c, s = np.cos(points.angle), np.sin(points.angle)
    radial, hoop = points.row == 0, points.row == 2
    # a shift along x is u_r = cos t and u_theta = -sin t: V = -U
    x = (loads[:, 0] * c)[radial].sum() - (loads[:, 0] * s)[hoop].sum()
    y = (loads[:, 0] * s)[radial].sum() + (loads[:, 0] * c)[hoop].sum()
    assert first[0, 0] - first[2, 0] == pytest.approx(x, rel=1e-12)
    assert second[0, 0] - second[2, 0] == pytest.approx(y, rel=1e-12)


def test_rows_of_an_order_read_amplitudes():
    """Of one node with a, b, W: U = a + b in the plane, V = b - a along the ring."""
    rows = RingRows(
        along=csr_array([[2.0, 3.0]]), around=csr_array([[5.0]]), turned=csr_array([[7.0, 11.0]])
    )
    a, b, W = 0.3, 0.5, -0.2
    read = rows.of_order(4) @ np.array([a, b, W])
    expected = [2 * (a + b) + 3 * W, 5 * (b - a) + 4 * (7 * (a + b) + 11 * W)]
    np.testing.assert_allclose(read, expected, rtol=1e-14)
    assert list(rows.is_sine) == [False, True]


TIP = 2e-3


@pytest.fixture(scope="module")
def pair():
    return NeedleOnRing()


def test_on_the_axis_every_angle_has_the_gap_of_the_half_section(pair):
    gaps = pair.gaps(7)(np.zeros(6))
    np.testing.assert_allclose(gaps, np.repeat(pair.section.gap[:, None], 7, axis=1), atol=1e-16)


@pytest.mark.parametrize(
    "placement",
    [
        [3e-6, -2e-6, 1e-6, 0, 0, 0],
        [0, 0, 1e-6, 5e-4, 8e-4, 0.3],
        [30e-6, 10e-6, 40e-6, -3e-3, 2e-3, 0],
    ],
)
def test_gaps_of_a_sphere_over_a_cone(pair, placement):
    """A line from the sphere along its radius, cut with the cone z = r - c."""
    placement = np.array(placement, dtype=float)
    assert pair.section.slave == "a"
    exact, gaps = gaps_of_sphere_over_cone(pair, 8, placement), pair.gaps(8)
    ours = gaps(placement)
    met = ours < 0.5 * gaps.away
    assert met.mean() > 0.9
    # the arc of quadratic elements differs from the circle by less than a nanometre
    np.testing.assert_allclose(ours[met], exact[met], atol=1e-9)
    assert np.ptp(exact) > 2e-6


@pytest.mark.slow
@pytest.mark.parametrize("slave", ["a", "b"])
def test_small_motions_move_the_gaps_as_the_rigid_modes_say(slave):
    """Traces of the six rigid modes: u = t + w x (x - c) in space, read by the half section.

    And against the gaps themselves next to the ring of first touch, where both normals are one:
    half an element of 30 um away from it they differ by 0.8 %.
    """
    count, pair = 9, NeedleOnRing(slave=slave)
    space, _ = pair.placed(count, np.zeros(6))
    model = pair.model(space, axial=1, others=0)
    gaps, (r, z) = pair.gaps(count), pair.sides[0].points.T
    near = int(np.argmin(pair.section.gap))
    touching = space.ring == near
    assert touching.sum() == count
    for k, size in enumerate([1e-9, 1e-9, 1e-9, 1e-6, 1e-6, 1e-6]):
        motion = np.zeros(6)
        motion[k] = size
        expected = np.zeros((pair.section.count, count))
        for j, angle in enumerate(gaps.angle):
            away = np.array([np.cos(angle), np.sin(angle), 0.0])
            x = r[:, None] * away + z[:, None] * [0.0, 0.0, 1.0]
            u = motion[:3] + np.cross(motion[3:], x - gaps.centre)
            expected[:, j] = pair.section.G_a @ np.column_stack([u @ away, u[:, 2]]).ravel()
        q = np.linalg.solve(model.rigid[:, :6], motion)
        ours = model.traces[:, :6] @ q
        scale = size * (1.0 if k < 3 else TIP)
        at = (space.ring, space.turn)
        np.testing.assert_allclose(ours, expected[at], atol=1e-9 * scale, err_msg=str(k))
        change = (gaps(motion) - gaps(-motion))[near] / 2.0
        np.testing.assert_allclose(ours[touching], change, atol=0.02 * scale, err_msg=str(k))
        assert (np.abs(change).max() > 0.5 * scale) == (k != 5)  # a turn about the axis moves none
    needle = pair.bodies[0]
    kinetic = model.rigid[:, :6] @ model.rigid[:, :6].T  # inverse of the inertia of the body
    expected = np.zeros((6, 6))
    expected[:3, :3], expected[3:, 3:] = needle.mass * np.eye(3), needle.inertia
    np.testing.assert_allclose(np.linalg.inv(kinetic), expected, rtol=1e-9, atol=1e-17)


HEIGHTS = (5e-3, 0.0123, 20e-3)  # on a ring of nodes or between two


@pytest.fixture(scope="module")
def pair_sections():
    return NeedleOnRing(bulk=2e-3)


@pytest.fixture(scope="module")
def sections(pair_sections):
    return turned_sections("needle", pair_sections.bodies[0].mesh, "guide", HEIGHTS)


@pytest.fixture(scope="module")
def stroke():
    return RingStroke(pair=NeedleOnRing(), placement=np.array([3e-7, 1e-7, 0.0, 5e-5, 0.0, 0.0]))


def test_sections_follow_rigid_motions(pair_sections, sections):
    assert sections.radius == pytest.approx(2e-3, rel=1e-12)
    for order in (0, 1):
        body = pair_sections.in_order(0)(order)
        shift, turn = np.split(sections.of_order(order) @ body.rigid_motions, 2)
        far = np.hypot(
            2e-3, np.abs(pair_sections.bodies[0].mesh.points[:, 1] - body.centre_of_mass).max()
        )
        arm = np.array(HEIGHTS) - body.centre_of_mass
        angle = 1.0 / (pair_sections.bodies[0].mesh.points[:, 0].max() if order == 0 else far)
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
def test_a_section_yields_as_that_of_a_solid(pair_sections):
    needle = pair_sections.bodies[0].mesh
    (solid,) = needle.solids
    whole = elastic_body("needle", sweep(needle, 12), {solid: STEEL})
    loads = np.column_stack([_section(whole, "guide", z).load[:, 0] for z in HEIGHTS])
    with Flexibility(whole) as flexibility:
        expected = np.einsum("ik,ik->k", loads, flexibility.deflections(loads))
    across = turned_sections("needle", needle, "guide", HEIGHTS).of_order(1)[:3].toarray().T
    with Flexibility(pair_sections.in_order(0)(1)) as flexibility:
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


def test_a_guide_needs_a_shaft(pair_sections):
    mesh = pair_sections.bodies[0].mesh
    with pytest.raises(InputError, match="cylinder around the axis"):
        turned_sections("needle", mesh, "end", HEIGHTS)
    with pytest.raises(InputError, match="heights"):
        turned_sections("needle", mesh, "guide", (5e-3, 0.5))


TURN = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)


def ring(radius, centre=(0.0, 0.0), turn=TURN):
    x, y = centre
    return np.column_stack(
        [x + radius * np.cos(turn), y + radius * np.sin(turn), np.full(turn.size, 1e-3)]
    )


@pytest.mark.parametrize("centre", [(0.0, 0.0), (3e-3, -1e-3)], ids=["centred", "off-axis"])
def test_a_ring_is_one_wherever_its_centre_is(centre):
    assert goes_round(ring(1e-3, centre))
    assert goes_round(ring(1e-3, centre, TURN[::4]))


def test_a_spot_of_many_points_is_none():
    """The top of a meshed dome: its centre and four rings of up to 48 points."""
    rings = [ring(r * 1e-5, turn=TURN[:: 8 // r]) for r in (1, 2, 4, 8)]
    spot = np.vstack([[[0.0, 0.0, 1e-3]], *rings])

    assert len(spot) > 40
    assert not goes_round(spot)


def test_some_pads_are_none():
    at = np.concatenate([TURN[:6], TURN[16:22], TURN[32:38]])

    assert not goes_round(ring(1e-3, turn=at))


def test_few_points_are_none():
    assert not goes_round(ring(1e-3, turn=TURN[::12]))
    assert not goes_round(np.zeros((0, 3)))


STEEL_PLACEMENT = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
DEMO = find_case("demo-valve")
# the cone of the demo valve: a = 45 deg; its sphere touches 0.4243 mm below the centre
HEIGHT = 0.6e-3 * sin(pi / 4)


def placed(placement: str):
    text = DEMO.read_text(encoding="utf-8").replace("0.012 mm", "0.025 mm")
    text = text.replace("motion: {", f"motion: {{placement: {placement}, ")
    return build_bodies(read_case(text, DEMO), silent)


@pytest.fixture(scope="module")
def centred():
    return placed("{}")


def test_a_rotation_keeps_lengths_and_turns_about_its_axis():
    for angle in (0.0, 1e-12, 1e-4, 1.0, pi, 4.0):
        axis = np.array([0.6, 0.0, 0.8])
        R = rotation_matrix(angle * axis)
        side = np.array([0.0, 1.0, 0.0])

        assert R @ R.T == pytest.approx(np.eye(3), abs=1e-14)
        assert R @ axis == pytest.approx(axis, abs=1e-14)
        expected = cos(angle) * side + sin(angle) * np.cross(axis, side)
        assert R @ side == pytest.approx(expected, abs=1e-14)


def test_a_pose_is_undone_by_going_back_to_the_drawing():
    pose = Pose(
        rotation=np.array([0.1, -0.2, 0.3]),
        about=np.array([1.0, 2.0, 3.0]),
        shift=np.array([-4.0, 5.0, -6.0]),
    )
    x = np.random.default_rng(3).normal(size=(7, 3))

    assert pose.drawn(pose.of(x)) == pytest.approx(x, abs=1e-14)
    assert pose.of(pose.about) == pytest.approx(pose.about + pose.shift)
    assert Pose.along_z(2.0).of(x) == pytest.approx(x + np.array([0.0, 0.0, 2.0]))


def test_a_placed_body_keeps_mass_inertia_and_frequencies():
    outline = Profile(
        (0.0, 0.0), tuple(Line(p) for p in ((1e-3, 0.0), (2e-3, 4e-3), (0.0, 4e-3), (0.0, 0.0)))
    )
    mesh = sweep(mesh_meridian({"cone": outline}, MeshSizing(size=1e-3)), 6)
    pose = Pose(
        rotation=np.array([0.3, -0.2, 0.1]), about=np.array([0, 0, 1e-3]), shift=np.full(3, 2e-3)
    )
    bodies = [elastic_body("cone", m, {"cone": STEEL_PLACEMENT}) for m in (mesh, mesh.placed(pose))]
    modes = [eigenmodes(b, count=6, flexibility=Flexibility(b)) for b in bodies]

    assert bodies[1].mass == pytest.approx(bodies[0].mass, rel=1e-13)
    assert bodies[1].centre_of_mass == pytest.approx(pose.of(bodies[0].centre_of_mass), abs=1e-14)
    principal = [np.linalg.eigvalsh(body.inertia) for body in bodies]
    assert principal[1] == pytest.approx(principal[0], rel=1e-12)
    # the inertia turns with the body
    R = rotation_matrix(pose.rotation)
    turned = R @ bodies[0].inertia @ R.T
    assert bodies[1].inertia == pytest.approx(turned, abs=1e-12 * principal[0][-1])
    # iterative eigenvalues
    assert modes[1].frequency == pytest.approx(modes[0].frequency, rel=1e-9)


def test_an_axisymmetric_mesh_cannot_leave_its_axis():
    outline = Profile((0.0, 0.0), tuple(Line(p) for p in ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0))))
    mesh = mesh_meridian({"body": outline}, MeshSizing(size=0.5))

    with pytest.raises(InputError, match="swept"):
        mesh.placed(Pose.along_z(1.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("placement", "aside", "lowered"),
    [
        ("{eccentricity: 3 um, direction: 130 deg}", 3e-6, 0.0),
        (
            "{tilt: 0.5 deg, tilt_direction: 50 deg}",
            HEIGHT * sin(0.5 * pi / 180),
            HEIGHT * (1.0 - cos(0.5 * pi / 180)),
        ),
    ],
)
def test_an_eccentric_ball_stands_higher_on_its_cone(centred, placement, aside, lowered):
    pair = placed(placement)

    # 2 %: elements of 0.15 mm round the circle average the gap over the narrow side
    assert pair.shift - centred.shift == pytest.approx(aside + lowered, rel=0.02)
    centre = pair.pose.of(np.zeros(3)) - centred.pose.of(np.zeros(3))
    # the height of first touch comes from 4001 samples of the meridian
    assert np.hypot(*centre[:2]) == pytest.approx(aside, rel=2e-4)
    towards = np.radians(130 if lowered == 0.0 else 50)
    assert np.arctan2(centre[1], centre[0]) == pytest.approx(towards, rel=1e-9)


@pytest.mark.slow
def test_a_touch_outside_the_fine_mesh_is_told():
    with pytest.warns(AccuracyWarning, match="'housing' touches first"):
        placed("{eccentricity: 40 um}")
