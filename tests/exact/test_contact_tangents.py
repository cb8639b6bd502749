"""Tangential displacement at contact points.

Truth: rigid motions, for which it is known exactly; momentum of the forces that belong to it.
"""

import numpy as np
import pytest

import klack
from klack.assembling.problem import place_bodies
from klack.contact.mortar import contact_space, tangent_rows
from klack.progress import silent
from klack.verification.contact import sphere_on_cone, uniform_compression

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
