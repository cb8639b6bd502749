r"""Gaps after a rigid motion: truth = the contact space built anew, and a sphere in a cone.

The bodies are a third of a ring: hats at its ends may lose sight of the other surface.  From the
centre c of the sphere a line along n meets the cone :math:`z = \rho - \sqrt2 R` at the distance s
where :math:`c_z + s n_z + \sqrt2 R = |c_{xy} + s n_{xy}|`; the gap is s - R.
"""

import pickle

import numpy as np
import pytest

from klack.contact.gap_update import RigidGaps
from klack.contact.mortar import contact_space
from klack.errors import InputError
from klack.mesh.rigid import Pose
from klack.verification.contact import sphere_on_cone

CENTRE = np.array([0.0, 0.0, 2e-3])
MOVES = {
    "none": np.zeros(6),
    "up": np.array([0.0, 0.0, 2e-6, 0.0, 0.0, 0.0]),
    "aside": np.array([3e-6, -1e-6, 3e-6, 0.0, 0.0, 0.0]),
    "tilted": np.array([0.0, 1e-6, 2e-6, 4e-4, -3e-4, 0.0]),
    "turned": np.array([0.0, 0.0, 1e-6, 0.0, 0.0, 3e-3]),
    "turned far": np.array([0.0, 0.0, 1e-6, 0.0, 0.0, 0.4]),
}


@pytest.fixture(scope="module", params=[("tet10", "a"), ("tet10", "b"), ("hex20", "a")], ids=str)
def pair(request):
    """Sphere and cone, their contact points, and the gaps as a function of the placement."""
    family, slave = request.param
    sphere, cone, _ = sphere_on_cone(family, (20, 18))
    bodies = (sphere, sphere.surface("bottom"), cone, cone.surface("top"))
    space = contact_space(*bodies, reach=2e-6, slave=slave)
    return bodies, space, RigidGaps.of(space, *bodies, centre=CENTRE)


@pytest.mark.parametrize("name", MOVES)
def test_gaps_are_those_of_the_space_built_anew(pair, name):
    bodies, space, gaps = pair
    move = MOVES[name]
    placed = bodies[0].placed(Pose(rotation=move[3:], about=CENTRE, shift=move[:3]))
    # candidates with larger gaps as well: those of the first space are among them
    anew = contact_space(placed, *bodies[1:], reach=60e-6, slave=space.slave)
    _, own, new = np.intersect1d(space.nodes, anew.nodes, return_indices=True)
    here = gaps(move)

    assert len(own) > 0.6 * space.count
    assert name == "turned far" or len(own) == space.count
    # round-off of coordinates of a millimetre
    assert here[own] == pytest.approx(anew.gap[new], abs=1e-17)
    assert np.all(np.isfinite(here))
    assert np.all(np.delete(here, own) == gaps.away)


def test_the_farthest_turn_is_beyond_the_lists_of_near_faces(pair):
    _, _, gaps = pair
    arm = np.hypot(*gaps.position[:, :2].T)

    assert 3e-3 * arm.max() < gaps.within < 0.4 * arm.min()


def distance_to_cone(centre, n, radius):
    """Distance from the centre of the sphere along n to the cone, from the square of the above."""
    height = centre[2] + np.sqrt(2.0) * radius
    a = n[:, 2] ** 2 - n[:, 0] ** 2 - n[:, 1] ** 2
    b = height * n[:, 2] - n[:, :2] @ centre[:2]
    c = height**2 - centre[:2] @ centre[:2]
    return c / (-b + np.sqrt(b**2 - a * c))  # a is nearly 0


@pytest.mark.parametrize("name", ["aside", "tilted"])
def test_a_sphere_aside_in_its_cone(name):
    """Faces of 60 um and eight nodes give gaps to a quarter nanometre."""
    radius = 1e-3
    sphere, cone, _ = sphere_on_cone("hex20", (26, 24), radius=radius)
    bodies = (sphere, sphere.surface("bottom"), cone, cone.surface("top"))
    space = contact_space(*bodies, reach=1e-6, slave="a")
    gaps = RigidGaps.of(space, *bodies, centre=CENTRE)
    pose = Pose(rotation=MOVES[name][3:], about=CENTRE, shift=MOVES[name][:3])

    centre = pose.of(np.zeros(3))
    n = pose.of(gaps.position) - centre
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    exact = distance_to_cone(centre, n, radius) - radius
    mean = gaps.weight @ exact / (gaps.weight @ np.ones(len(exact)))
    angle = np.arctan2(space.points[:, 1], space.points[:, 0])
    inner = (angle > 0.2) & (angle < 1.9)  # all of the hat sees the cone

    assert np.abs(gaps(MOVES[name]) - mean)[inner].max() < 0.3e-9


def test_small_motions_follow_the_matrices_where_the_surfaces_are_parallel():
    """Elsewhere a motion along one surface has a share across the other: their angle."""
    sphere, cone, _ = sphere_on_cone("hex20", (26, 24))
    bodies = (sphere, sphere.surface("bottom"), cone, cone.surface("top"))
    space = contact_space(*bodies, reach=2e-6, slave="a")
    gaps = RigidGaps.of(space, *bodies, centre=CENTRE)
    angle = np.arctan2(space.points[:, 1], space.points[:, 0])
    latitude = np.arctan2(np.hypot(*space.points[:, :2].T), -space.points[:, 2])
    inner = (angle > 0.2) & (angle < 1.9)
    move = np.array([1e-6, 2e-6, 1e-6, 2e-4, -1e-4, 0.0])

    u = sphere.placed(Pose(rotation=move[3:], about=CENTRE, shift=move[:3])).points - sphere.points
    error = gaps(move) - space.gap - space.G_a @ u.ravel()
    largest = np.linalg.norm(u, axis=1).max()

    # 0.003: motion over the radius
    assert np.all(np.abs(error[inner]) < largest * (np.abs(latitude[inner] - np.pi / 4) + 0.003))
    assert np.abs(error[inner]).max() > 0.01 * largest


def test_a_body_out_of_sight_is_far_away(pair):
    _, space, gaps = pair

    gone = gaps(np.array([50e-3, 0.0, 0.0, 0.0, 0.0, 0.0]))

    assert np.all(gone == gaps.away)
    assert gaps.away > 100 * space.reach


def test_gaps_travel_to_other_processes(pair):
    _, _, gaps = pair
    copy = pickle.loads(pickle.dumps(gaps))

    assert np.array_equal(copy(MOVES["tilted"]), gaps(MOVES["tilted"]))


def test_axisymmetric_bodies_are_refused():
    from klack.assembling.bodies import build_bodies
    from klack.case import find_case, load_case
    from klack.progress import silent

    pair = build_bodies(load_case(find_case("demo-valve-axisymmetric")), silent)
    bodies = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    space = contact_space(*bodies, reach=3e-6)

    with pytest.raises(InputError, match="swept"):
        RigidGaps.of(space, *bodies, centre=np.zeros(3))
