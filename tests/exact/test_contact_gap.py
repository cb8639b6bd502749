r"""Contact points of two faces: gaps, quadrature, tangents, candidates.

Gaps between curved faces; truth: distance of a sphere to a cone, in closed form.

Gaps after a rigid motion: truth = the contact space built anew, and a sphere in a cone.

The bodies are a third of a ring: hats at its ends may lose sight of the other surface.  From the
centre c of the sphere a line along n meets the cone :math:`z = \rho - \sqrt2 R` at the distance s
where :math:`c_z + s n_z + \sqrt2 R = |c_{xy} + s n_{xy}|`; the gap is s - R.

Truth: integrals of polynomials over flat and parabolic faces, in closed form.

The weights of the integration points meet in every gap and every contact force; constant fields
alone, which the patch test sends through them, do not tell one weight from another.

Patch test: two cubes that do not match transmit a uniform pressure; truth: p = E d / (2 L).

The pressure of single hats oscillates by a few percent on quadratic faces that do not match, since
quadratic displacements cannot follow linear hats exactly; the resultant is good to 1e-5.

Tangential displacement at contact points.

Truth: rigid motions, for which it is known exactly; momentum of the forces that belong to it.

Compliance by grades of the reach: parts of a far reach are those of a short one, exactly.

More contact points than were prepared; truth = all of them prepared at once.
"""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from draws import each
from scipy.sparse import csr_array

import klack
from klack.analyses.impact.full_level import run_full
from klack.assembling.candidates import Candidates, grade_of, reach_of
from klack.assembling.modes import kept_modes, mode_pools
from klack.assembling.problem import build_problem, place_bodies
from klack.bodies.elasticity.condensation import condensed_inverse
from klack.bodies.elasticity.loads import NearLoads
from klack.bodies.elasticity.statics import Flexibility
from klack.case import find_case, load_case
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.gap_update import RigidGaps
from klack.contact.history import ImpactHistory
from klack.contact.mortar import (
    ContactSpace,
    contact_space,
    hat_quadrature,
    tangent_rows,
    touching_shift,
)
from klack.contact.pairing import face_geometry, project_to_surface
from klack.contact.statics import (
    ReachError,
    contact_compliance,
    extended_compliance,
    static_contact,
)
from klack.errors import InputError
from klack.machine.progress import silent
from klack.mesh.rigid import Pose
from klack.verification.contact import (
    STEEL,
    half_spaces,
    parabola,
    sphere_on_cone,
    uniform_compression,
)
from klack.verification.lattice import lattice_mesh


def pointwise(family, layers, xi, **size):
    sphere, cone, exact = sphere_on_cone(family, layers, **size)
    at = face_geometry(sphere.points, sphere.surface("bottom").blocks[0], xi)
    position, normal = at.position.reshape(-1, 3), at.normal.reshape(-1, 3)
    met = project_to_surface(position, normal, cone, cone.surface("top"))
    assert met.met.mean() > 0.7
    return (met.gap - exact(position))[met.met]


def test_serendipity_faces_of_60_um_give_gaps_to_a_quarter_nanometre():
    xi = np.array([(x, y) for x in (-0.9, -0.3, 0.4, 0.8) for y in (-0.8, 0.1, 0.7)])

    error = pointwise("hex20", (26, 24), xi)

    assert np.abs(error).max() < 0.3e-9


def test_six_node_faces_of_60_um_are_right_on_average():
    """They lack the mixed cubic term: some nanometres up and down, which the hats average out."""
    xi = np.array([(0.2, 0.2), (0.6, 0.2), (0.2, 0.6), (1 / 3, 1 / 3), (0.05, 0.5), (0.5, 0.05)])

    error = pointwise("tet10", (26, 24), xi)

    assert np.abs(error).max() < 15e-9
    assert abs(error.mean()) < 0.5e-9


def test_gap_error_falls_with_the_third_power_of_the_element_size():
    xi = np.array([(0.2, 0.2), (0.6, 0.2), (0.2, 0.6)])
    layers = np.array([13, 26, 52])

    error = [np.abs(pointwise("tet10", (n, n - 2), xi, h=1.56e-3 / n)).max() for n in layers]

    order = -np.polyfit(np.log(layers), np.log(error), 1)[0]
    assert order == pytest.approx(3.0, abs=0.35)


@pytest.mark.parametrize("start", [-0.3e-3, 0.0, 5e-3], ids=["overlap", "touching", "far"])
def test_touching_shift_from_anywhere(start):
    """The sphere touches at height 0; the weighted gap of 60 um elements closes 0.1 um later."""
    sphere, cone, _ = sphere_on_cone("hex20", (26, 24))
    moved = sphere.moved(np.array([0, 0, start]))

    shift = touching_shift(moved, moved.surface("bottom"), cone, cone.surface("top"))

    placed = moved.moved(np.array([0, 0, shift]))
    space = contact_space(placed, placed.surface("bottom"), cone, cone.surface("top"))
    assert start + shift == pytest.approx(0.0, abs=0.12e-6)
    assert space.gap.min() == pytest.approx(0.0, abs=1e-12)


def test_reach_marks_its_border_as_rim():
    sphere, cone, exact = sphere_on_cone("hex20", (26, 24))

    space = contact_space(sphere, sphere.surface("bottom"), cone, cone.surface("top"), reach=4e-6)

    assert 0 < space.rim.sum() < space.count
    assert space.gap.max() <= 4.01e-6
    assert exact(space.points)[~space.rim].max() < exact(space.points)[space.rim].max()
    # rows across the ring: the rim is its inner and outer border only
    r = np.hypot(space.points[:, 0], space.points[:, 1])
    assert r[space.rim].min() == r.min()
    assert r[space.rim].max() == r.max()


@pytest.mark.parametrize("lift", [0.0, 0.1e-6])
def test_clearance_is_that_of_the_surfaces(lift):
    """The weighted gap of 60 um elements closes 0.1 um later; measured to 1 nm."""
    sphere, cone, _ = sphere_on_cone("hex20", (26, 24))
    lifted = sphere.moved(np.array([0, 0, lift]))

    space = contact_space(lifted, lifted.surface("bottom"), cone, cone.surface("top"), reach=4e-6)

    assert space.clearance == pytest.approx(lift, abs=3e-9)
    assert space.touch - space.clearance > 50e-9
    assert space.shifted(1e-6).clearance == pytest.approx(space.clearance + 1e-6, rel=1e-9)


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

    assert 3e-3 * arm.max() < gaps.near.within < 0.4 * arm.min()


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
    from klack.machine.progress import silent

    pair = build_bodies(load_case(find_case("demo-valve-axisymmetric")), silent)
    bodies = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    space = contact_space(*bodies, reach=3e-6)

    with pytest.raises(InputError, match="swept"):
        RigidGaps.of(space, *bodies, centre=np.zeros(3))


SIZE = 1e-3  # [m]
BORDERS = [np.array([0.0, 0.2, 0.55, 1.0]) * SIZE, np.array([0.0, 0.35, 0.6, 1.0]) * SIZE]
HEIGHT = np.array([0.0, 0.5, 1.0]) * SIZE
FAMILIES = ["tet10", "hex20", "wedge15", "tet4", "hex8"]


def moment(i: int, j: int) -> float:
    """Integral of ``x^i y^j`` over the square face."""
    return SIZE ** (i + j + 2) / ((i + 1) * (j + 1))


@pytest.fixture(scope="module", params=FAMILIES)
def hats(request):
    """Hats of a whole square face that lies on a larger one."""
    upper = lattice_mesh(request.param, [*BORDERS, HEIGHT + SIZE])
    wide = np.linspace(-0.5, 1.5, 4) * SIZE
    lower = lattice_mesh("hex20", [wide, wide, HEIGHT])
    face = upper.surface("bottom")
    space = contact_space(upper, face, lower, lower.surface("top"), reach=1e-6, slave="a")
    assert space.count == len(face.nodes)
    return space, hat_quadrature(space, upper, face)


def test_hats_add_up_to_one_under_every_polynomial(hats):
    """Of degree 4, the degree of the rule on a triangle; a quad would be exact further."""
    _, points = hats
    x, y = points.position[:, 0], points.position[:, 1]
    total = points.weight.sum(axis=0)

    for i in range(5):
        for j in range(5 - i):
            assert total @ (x**i * y**j) == pytest.approx(moment(i, j), rel=1e-12, abs=0.0)


def test_hats_carry_linear_fields_under_every_polynomial(hats):
    """``sum x_k psi_k = x``: each hat is one at its node and falls to its neighbours in a line."""
    space, points = hats
    x, y = points.position[:, 0], points.position[:, 1]

    for axis in range(2):
        field = points.weight.T @ space.points[:, axis]
        for i in range(4):
            for j in range(4 - i):
                exact = moment(i + (axis == 0), j + (axis == 1))
                assert field @ (x**i * y**j) == pytest.approx(exact, rel=1e-12, abs=0.0)


def test_areas_and_gaps_are_the_same_integrals(hats):
    space, points = hats

    np.testing.assert_allclose(space.area, points.weight.sum(axis=1), rtol=1e-13)
    np.testing.assert_allclose(space.gap, 0.0, atol=1e-15)


@each("family", FAMILIES)
@each(("i", "j"), [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])
def test_mean_gap_over_a_curved_face(family, i, j):
    """The volume between a flat slave and a paraboloid, which an 8-node face follows exactly."""
    depth = 2e-5 / SIZE ** (i + j)

    def bowl(points):
        x, y, z = points.T
        return np.column_stack([x, y, z - depth * x**i * y**j * (z / SIZE)])

    upper = lattice_mesh(family, [*BORDERS, HEIGHT + SIZE])
    wide = np.linspace(-0.5, 1.5, 4) * SIZE
    lower = lattice_mesh("hex20", [wide, wide, HEIGHT], bowl)
    space = contact_space(
        upper, upper.surface("bottom"), lower, lower.surface("top"), reach=1e-4, slave="a"
    )

    # the projection ends 1e-13 of the size of a face away
    volume = depth * moment(i, j)
    assert space.area @ space.gap == pytest.approx(volume, rel=1e-9, abs=0.0)


PAIRS = [
    ("tet10", "tet10", (4, 3), 0.0),
    ("tet10", "tet10", (3, 4), 0.03),
    ("hex20", "hex20", (4, 3), 0.0),
    ("hex20", "tet10", (4, 3), 0.03),
    ("wedge15", "hex20", (4, 3), 0.0),
    ("hex8", "hex8", (4, 3), 0.0),
    ("tet4", "tet4", (4, 3), 0.0),
]


@pytest.mark.parametrize(("family_a", "family_b", "cells", "skew"), PAIRS)
def test_uniform_pressure_passes_between_meshes_that_do_not_match(family_a, family_b, cells, skew):
    problem = uniform_compression(family_a, family_b, cells, skew=skew)

    static = problem.solve(1e9, count=2)

    exact = STEEL.young * static.approach[-1] / 2.0
    pressure = static.pressures[-1] / problem.space.area
    assert static.active_count[-1] == problem.space.count
    assert static.force[-1] == pytest.approx(exact, rel=1e-4)
    assert np.abs(pressure / exact - 1.0).max() < 0.08
    assert np.average((pressure / exact - 1.0) ** 2, weights=problem.space.area) < 0.02**2


@pytest.mark.parametrize("family", ["tet10", "hex20"])
def test_matching_meshes_are_exact(family):
    problem = uniform_compression(family, family, (3, 3))

    static = problem.solve(1e9, count=2)

    pressure = static.pressures[-1] / problem.space.area
    np.testing.assert_allclose(pressure, STEEL.young * static.approach[-1] / 2.0, rtol=1e-9)


def test_the_finer_side_carries_the_hats():
    assert uniform_compression("tet10", "tet10", (4, 3)).space.slave == "a"
    assert uniform_compression("tet10", "tet10", (3, 4)).space.slave == "b"
    assert uniform_compression("hex20", "tet10", (3, 3)).space.slave == "a"


FLAT = [("tet10", "tet10", (4, 3)), ("hex20", "tet10", (3, 4)), ("hex8", "hex8", (3, 3))]


def translation(mesh, vector):
    return np.tile(vector, mesh.node_count)


def spin(mesh):
    """Rotation about z by one."""
    x, y, _ = mesh.points.T
    return np.column_stack([-y, x, np.zeros_like(x)]).ravel()


def flat(families):
    problem = uniform_compression(*families[:2], families[2], skew=0.03)
    a, b = problem.body_a.mesh, problem.body_b.mesh
    rows = tangent_rows(problem.space, a, a.surface("bottom"), b, b.surface("top"))
    return problem.space, a, b, rows


@pytest.fixture(scope="module", params=["tet10", "hex20"])
def ring(request):
    """A sphere on a cone of 45 degrees, a third of the circle."""
    sphere, cone, _ = sphere_on_cone(request.param, (7, 7))
    surfaces = (sphere, sphere.surface("bottom"), cone, cone.surface("top"))
    space = contact_space(*surfaces, reach=1e-6)
    return space, sphere, cone, tangent_rows(space, *surfaces)


@pytest.mark.parametrize("families", FLAT)
def test_a_face_that_moves_past_another(families):
    _, a, b, (T_a, T_b) = flat(families)
    moved = np.array([0.3, -0.4, 0.7])
    first, second = (T_a @ translation(a, moved)).reshape(2, -1)
    # along z only the gap; the directions turn a little within a hat
    np.testing.assert_allclose(np.hypot(first, second), 0.5, rtol=0.02)
    still = T_a @ translation(a, moved) + T_b @ translation(b, moved)
    assert np.abs(still).max() < 1e-12


def test_both_slaves_tell_the_same_slip():
    moved = np.array([0.3, -0.4, 0.0])
    found = []
    for slave in ("a", "b"):
        problem = uniform_compression("tet10", "tet10", (3, 3))
        a, b = problem.body_a.mesh, problem.body_b.mesh
        sides = (a, a.surface("bottom"), b, b.surface("top"))
        space = contact_space(*sides, reach=0.1, slave=slave)
        T_a, _ = tangent_rows(space, *sides)
        found.append(np.sort((T_a @ translation(a, moved))[: space.count]))
    np.testing.assert_allclose(*found, atol=1e-9)


def test_forces_cancel(ring):
    *_, (T_a, T_b) = ring
    lam = np.random.default_rng(2).normal(size=T_a.shape[0])
    on_a, on_b = ((T.T @ lam).reshape(-1, 3).sum(axis=0) for T in (T_a, T_b))
    np.testing.assert_allclose(on_a, -on_b, atol=1e-12 * np.abs(lam).sum())


def test_a_seat_slides_along_its_meridian_and_turns_round_its_axis(ring):
    """A lift opens the gap by its share along the normal, and slides by the rest."""
    space, sphere, _, (T_a, _) = ring
    along, round_it = (T_a @ translation(sphere, np.array([0.0, 0.0, 1.0]))).reshape(2, -1)
    np.testing.assert_allclose(np.hypot(along, space.axial), 1.0, atol=1e-3)
    assert np.abs(along).mean() == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert np.abs(round_it).max() < 1e-2
    along, round_it = (T_a @ spin(sphere)).reshape(2, -1)
    radius = np.linalg.norm(space.points[:, :2], axis=1)
    np.testing.assert_allclose(np.abs(round_it), radius, rtol=0.01)
    assert np.abs(along).max() < 1e-2 * radius.max()


def test_a_meridian_has_one_direction():
    """The demo valve has a seat of 45 degrees."""
    placed = place_bodies(klack.load_case("demo-valve-axisymmetric").checked, silent, threads=1)
    pair = placed.pair
    surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    space = contact_space(*surfaces, reach=2e-6)
    T_a, T_b = tangent_rows(space, *surfaces)
    placed.close()
    assert T_a.shape == (space.count, pair.upper.mesh.dof_count)
    lift = np.array([0.0, 1.0])
    slid = T_a @ translation(pair.upper.mesh, lift)
    np.testing.assert_allclose(slid**2 + space.axial**2, 1.0, atol=1e-4)
    np.testing.assert_allclose(slid, -T_b @ translation(pair.lower.mesh, lift), atol=1e-12)


@pytest.fixture(scope="module")
def placed():
    with place_bodies(load_case(find_case("demo-valve-axisymmetric")), silent, threads=1) as found:
        yield found


def fresh(placed) -> Candidates:
    return Candidates(placed.pair, placed.flexibility_upper, placed.flexibility_lower)


def test_a_far_reach_holds_a_short_one_bit_for_bit(placed):
    grade = grade_of(3e-6)
    alone = fresh(placed).at(grade)
    both = fresh(placed)
    far = both.at(grade + 5)
    part = both.at(grade)

    assert 10 < alone.space.count < far.space.count
    assert np.array_equal(part.space.nodes, alone.space.nodes)
    assert np.array_equal(part.upper, alone.upper)
    assert np.array_equal(part.lower, alone.lower)


def test_grades_are_the_compliance_of_the_whole(placed):
    found = fresh(placed).at(grade_of(6e-6))
    whole = contact_compliance(found.space, placed.flexibility_upper, placed.flexibility_lower)

    # another order of sums
    np.testing.assert_allclose(found.compliance, whole, rtol=0, atol=1e-11 * np.abs(whole).max())
    assert np.array_equal(found.compliance, found.compliance.T)


def test_points_enter_at_their_reach(placed):
    """What is a candidate at a reach are all points that enter before it."""
    candidates = fresh(placed)
    far = candidates.at(grade_of(8e-6)).space
    for grade in range(grade_of(2e-6), grade_of(8e-6)):
        near = candidates.at(grade).space
        assert np.array_equal(near.nodes, far.nodes[far.entry <= reach_of(grade)])


class Dense:
    """A factorised full matrix."""

    dtype = np.dtype(float)

    def __init__(self, size: int, seed: int) -> None:
        A = np.random.default_rng(seed).normal(size=(size, size))
        self.A = A @ A.T + size * np.eye(size)
        self.L = np.linalg.cholesky(self.A)

    def solve(self, B):
        return np.linalg.solve(self.A, B)

    def forward(self, B):
        return np.linalg.solve(self.L, B)

    def backward(self, Y):
        return np.linalg.solve(self.L.T, Y)


def test_groups_are_condensed_apart_and_together():
    factor, rng = Dense(30, seed=3), np.random.default_rng(4)
    G = csr_array(rng.normal(size=(9, 30)))
    groups = [np.array([4, 1, 7]), np.array([0, 8]), np.array([2, 3, 5, 6])]
    expected = G @ np.linalg.solve(factor.A, G.T.toarray())

    for largest in (2**29, 8 * 30 * 4, 0):  # forward halves, some of them, whole solutions
        C = condensed_inverse(factor, G, groups=groups, largest=largest)
        np.testing.assert_allclose(C, expected, rtol=1e-11, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("largest", [2**29, 0], ids=["halves", "whole solutions"])
def test_later_groups_change_no_bit_of_the_first(largest):
    factor, rng = Dense(1200, seed=8), np.random.default_rng(9)
    factor.L[::2, 1::2] = factor.L[1::2, ::2] = 0.0  # loads on even rows never reach odd ones
    factor.A = factor.L @ factor.L.T
    loads = rng.normal(size=(143, 1200))
    loads[:102, 1::2] = 0.0
    G = csr_array(loads)
    groups = [np.arange(61), np.arange(61, 102), np.arange(102, 143)]

    whole = condensed_inverse(factor, G, groups=groups, largest=largest)
    fewer = condensed_inverse(factor, G[:102], groups=groups[:2], largest=largest)

    assert np.array_equal(whole[:102, :102], fewer)


def test_a_factor_follows_points_that_join_and_leave():
    """Whatever the order, forces close the gaps of the active points."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(12, 12))
    A = A @ A.T + np.eye(12)
    solver = ComplementaritySolver(A)
    q = rng.normal(size=12)
    for _ in range(40):
        active = rng.random(12) < rng.random()
        forces = solver._forces(q, active)
        order = solver._active

        assert np.array_equal(np.sort(order), np.flatnonzero(active))
        np.testing.assert_allclose(A[np.ix_(order, order)] @ forces, -q[order], atol=1e-9)


def test_near_loads_are_combined_and_others_solved():
    rng = np.random.default_rng(7)
    F = rng.normal(size=(20, 20))
    F = F @ F.T + np.eye(20)
    near, solved = NearLoads(), []

    def solve(f):
        solved.append(f)
        return F @ f

    basis = rng.normal(size=(3, 20))
    for f in basis:
        near.answer(f, float(f @ F @ f), solve)
    assert len(solved) == 3
    f = np.array([1.0, -2.0, 0.5]) @ basis
    u = near.answer(f, float(f @ F @ f), solve)
    np.testing.assert_allclose(u, F @ f, rtol=1e-9)
    assert len(solved) == 3

    # 1 % aside in the norm of the energy: it is solved
    aside = rng.normal(size=20)
    aside *= 0.01 * np.sqrt(f @ F @ f / (aside @ F @ aside))
    u = near.answer(f + aside, float((f + aside) @ F @ (f + aside)), solve)
    assert len(solved) == 4
    np.testing.assert_allclose(u, F @ (f + aside), rtol=1e-12)


def test_near_loads_stay_bounded():
    near = NearLoads()
    for f in np.eye(200):
        near.answer(f, 1.0, lambda load: load)
    assert len(near._answers) <= 48


BALL = Path(__file__).parents[1] / "data" / "small_ball.yaml"


def test_new_points_join_the_known_ones():
    problem = half_spaces(parabola(10e-3, 0.2e-3), contact=0.1e-3, cells=(8, 8), reach=2e-6)
    keep = problem.space.gap < np.median(problem.space.gap)
    keep[3] = False  # and one in the middle, so that the order of the points matters
    fewer = problem.space.restricted(keep)

    with Flexibility(problem.body_a) as a, Flexibility(problem.body_b) as b:
        whole = contact_compliance(problem.space, a, b)
        known = static_contact(fewer, contact_compliance(fewer, a, b), 1e-3)
        extended = extended_compliance(problem.space, known, a, b)

    assert 0 < known.space.count < problem.space.count - 1
    # round-off of the triangular solves
    assert extended == pytest.approx(whole, rel=1e-10, abs=1e-12 * np.abs(whole).max())


@pytest.mark.slow
def test_the_full_order_goes_on_to_as_many_points_as_it_reaches():
    """As the interface level does: the static contact bounds one quasi-static impact only."""
    problem = build_problem(load_case(BALL), silent)
    pools = mode_pools(problem, at_least=1, progress=silent)
    kept = kept_modes(problem, pools)
    problem.close()
    near = problem.space.gap < np.sort(problem.space.gap)[3]
    narrow = replace(problem.space.restricted(near), reach=problem.space.reach / 3.0)

    def run(space: ContactSpace, **contact: float) -> ImpactHistory:
        changed = problem.case.contact.model_copy(update=contact)
        asked = problem.case.model_copy(update={"contact": changed})
        given = replace(problem, space=space, case=asked)
        return run_full(given, pools, kept=kept, progress=silent, threads=1)[0].history

    expected = run(problem.space).force

    # the clock starts at the same placement; round-off of factors in single precision, 250 steps
    assert run(narrow).force == pytest.approx(expected, rel=1e-6, abs=3e-6 * expected.max())
    with pytest.raises(ReachError, match="at the edge of the candidate area, at"):
        run(narrow, reach=1e-6)
