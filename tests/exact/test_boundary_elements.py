"""Boundary elements: spheres and cylinders, interior points, far field, order, what is refused."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from boundary_box import box
from scipy.special import eval_legendre

from klack.acoustics.boundary.revolved import Meridian
from klack.acoustics.boundary.solution import LARGEST_RESIDUAL, radiation
from klack.errors import ConvergenceError, InputError
from klack.verification.radiation import sphere_efficiency, sphere_meridian, sphere_pressure

# ka; efficiencies in P_0 to P_4, printed with nine digits
SPHERE = (
    (0.3, 0.0825688073, 0.00202090766, 8.91257654e-06, 1.80620934e-08, 2.12591126e-11),
    (1.0, 0.5, 0.2, 0.0112359551, 0.00025220681, 3.33181181e-06),
    (5.0, 0.961538462, 0.9936407, 1.0643008, 1.18111724, 1.284845),
    (10.0, 0.99009901, 0.99960016, 1.01938774, 1.05119752, 1.09810007),
)


def modes(mesh: Meridian, *orders: int) -> np.ndarray:
    cosine = mesh.centres[:, 1] / np.hypot(*mesh.centres.T)
    return np.column_stack([eval_legendre(n, cosine) for n in orders])


def cylinder(size: float, order: int) -> Meridian:
    """Radius 1 m, 3 m long."""
    up, out = np.arange(-1.5, 1.5, size), np.arange(0.0, 1.0, size)
    corners = [np.column_stack([out, np.full(out.size, -1.5)]), np.column_stack([up * 0 + 1, up])]
    top = np.column_stack([np.append(out, 1.0)[::-1], np.full(out.size + 1, 1.5)])
    return Meridian(nodes=np.vstack([*corners, top]), order=order)


def test_series_of_the_sphere() -> None:
    """Against printed ones; in P_4 at ka 5 more than plane waves radiate."""
    for ka, *known in SPHERE:
        found = [sphere_efficiency(n, ka) for n in range(5)]
        assert found == pytest.approx(known, rel=1e-8)
    assert sphere_efficiency(4, 5.0) > 1.28


@pytest.mark.parametrize("ka", [1.0, pi, 10.0])
def test_second_order_in_the_size_of_elements(ka: float) -> None:
    errors = []
    for count in (20, 40, 80):
        mesh = sphere_meridian(count)
        found = radiation(mesh, ka, modes(mesh, 2))
        exact = sphere_pressure(2, ka) * modes(mesh, 2)
        errors.append(np.sqrt(mesh.areas @ np.abs(found.pressure - exact) ** 2)[0])
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((order > 1.7) & (order < 2.4))


def test_without_interior_points_the_fictitious_resonance_spoils_all() -> None:
    """At ka = pi the inside resonates in P_0."""
    mesh = sphere_meridian(40)
    G, H = mesh.kernels(mesh.centres, pi)
    alone = np.linalg.solve(0.5 * np.eye(40) - H, 1j * pi * G.sum(axis=1))
    assert np.abs(alone / sphere_pressure(0, pi) - 1.0).max() > 0.05
    joined = radiation(mesh, pi, modes(mesh, 0)).pressure[:, 0]
    assert np.abs(joined / sphere_pressure(0, pi) - 1.0).max() < 2e-3


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("k", [0.3, 3.0, 8.0])
def test_power_through_the_surface_arrives_far_away(order: int, k: float) -> None:
    """Two integrals over different surfaces; constant elements leave 0.04 dB."""
    mesh = cylinder(0.1, order)
    found = radiation(mesh, k, mesh.rigid[:, :1])
    cosine, weights = np.polynomial.legendre.leggauss(40)
    by_pressure, by_velocity = mesh.far_field(k, np.arccos(cosine))
    far = by_pressure @ found.pressure + by_velocity @ found.velocity
    power = 2.0 * pi / (1 + order) * (weights @ np.abs(far) ** 2)[0]
    assert abs(10.0 * np.log10(found.matrix[0, 0] / power)) < 0.05


@pytest.mark.parametrize("order", [0, 1])
def test_pressure_at_points_becomes_the_far_field(order: int) -> None:
    mesh, k, r = cylinder(0.1, order), 8.0, 3e4
    found = radiation(mesh, k, mesh.rigid)
    at = np.array([[r * np.sin(1.0), r * np.cos(1.0)]])
    by_pressure, by_velocity = mesh.far_field(k, np.array([1.0]))
    far = by_pressure @ found.pressure + by_velocity @ found.velocity
    away = found.pressure_at(at) * r * np.exp(1j * k * r)
    moving = slice(0, 1 + order)
    assert away[0, moving] == pytest.approx(far[0, moving], rel=2e-3)


def test_turning_about_its_centre_a_sphere_is_silent() -> None:
    """And off its centre it moves across."""
    mesh = sphere_meridian(40, order=1)
    raised = replace(mesh, nodes=mesh.nodes + np.array([0.0, 2.0]))
    assert np.abs(mesh.rigid[:, 1]).max() < 1e-12
    assert raised.rigid[:, 1] == pytest.approx(2.0 * raised.rigid[:, 0], abs=1e-12)
    moved = radiation(raised, 1.0, raised.rigid)
    assert moved.matrix[1, 1] == pytest.approx(4.0 * moved.matrix[0, 0], rel=1e-9)


def test_matrix_of_powers_is_symmetric_and_never_negative() -> None:
    """Reciprocity: what is symmetrised differs by the error of elements only."""
    mesh = cylinder(0.1, 0)
    fields = np.column_stack([mesh.rigid[:, 0], mesh.normals[:, 0], mesh.centres[:, 1] > 0.4])
    found = radiation(mesh, 1.0, fields)
    raw = np.real(found.pressure.conj().T @ (mesh.weights[:, None] * fields))
    assert np.abs(raw - raw.T).max() < 0.02 * np.abs(raw).max()
    values = np.linalg.eigvalsh(found.matrix)
    assert values[0] > -1e-6 * values[-1]


def test_elements_too_large_for_the_wave_are_refused() -> None:
    mesh = sphere_meridian(12)
    with pytest.raises(ConvergenceError, match=r"remains inside.*\n.*six or more to a wavelength"):
        radiation(mesh, 25.0, modes(mesh, 0))
    assert radiation(mesh, 1.0, modes(mesh, 0)).residual < LARGEST_RESIDUAL


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda nodes: nodes[::-1], "air on its left"),
        (lambda nodes: nodes[3:], "not closed"),
        (lambda nodes: nodes * (-1.0, 1.0), "negative or unknown radius"),
        (lambda nodes: nodes[:2], "array of shape"),
    ],
)
def test_what_is_no_closed_surface(change, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Meridian(nodes=change(sphere_meridian(20).nodes))


@pytest.mark.parametrize(
    ("k", "along", "rocking"), [(0.3, 5.08e-4, 3.4e-7), (1.0, 0.0544, None), (4.0, 1.14, None)]
)
def test_rigid_box_in_triangles(k: float, along: float, rocking: float | None) -> None:
    """Efficiency of another program, 0.3 dB; with motions that cancel 5 %."""
    mesh = box(0.125)
    found = radiation(mesh, k, mesh.rigid)
    assert found.efficiency[2] == pytest.approx(along, rel=0.07)
    assert found.efficiency[0] == pytest.approx(found.efficiency[1], rel=1e-2)
    if rocking is not None:
        assert found.efficiency[4] == pytest.approx(rocking, rel=0.05)


def test_small_box_is_a_dipole() -> None:
    mesh, k = box(0.2), 0.05
    found = radiation(mesh, k, mesh.rigid[:, 2:3])
    moved = found.added_mass(mesh.rigid[:, 2])[0] + mesh.volume
    dipole = (k * moved) ** 2 * k**2 / (12.0 * pi)
    assert abs(10.0 * np.log10(found.matrix[0, 0] / dipole)) < 0.05


def test_rigid_motions_of_triangles_push_no_air_out() -> None:
    mesh = box(0.25)
    assert np.abs(mesh.rigid.T @ mesh.areas).max() < 1e-12
    assert mesh.volume == pytest.approx(1.5)


def test_triangles_that_do_not_close() -> None:
    whole = box(0.5)
    with pytest.raises(InputError, match="edges without a neighbour"):
        replace(whole, corners=whole.corners[1:])
    with pytest.raises(InputError, match="normals that point into the body"):
        replace(whole, corners=whole.corners[:, ::-1])
