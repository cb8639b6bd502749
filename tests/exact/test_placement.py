r"""A body placed off its axis: truth = a rigid motion, and a sphere on a cone.

A sphere of radius R whose centre is at the distance e from the axis of a cone z = r tan(a) touches
it on the side it was shifted to.  The centre is then R away from the straight line of that side, at
the height z = e tan(a) + R/cos(a): higher by e tan(a) than centred.  A lean by the angle t about a
point of the axis at the distance h from the centre of the sphere shifts that centre by h sin(t) and
lowers it by h (1 - cos t).
"""

from math import cos, pi, sin

import numpy as np
import pytest

from klack.assembling.bodies import build_bodies
from klack.case import find_case, read_case
from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.errors import AccuracyWarning, InputError
from klack.materials import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Line, Profile
from klack.mesh.rigid import Pose, rotation_matrix
from klack.mesh.sizing import MeshSizing
from klack.mesh.swept import sweep
from klack.progress import silent

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
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
    bodies = [elastic_body("cone", m, {"cone": STEEL}) for m in (mesh, mesh.placed(pose))]
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
