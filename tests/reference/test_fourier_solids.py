"""Truth: the same body as a solid in three dimensions, and Timoshenko's beam for slender rods."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body, rows_around
from klack.bodies.elasticity.loads import order_load, traction_load
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.gauges.fourier_field import field_rows
from klack.materials.material import Material
from klack.mesh.mesh import Mesh
from klack.mesh.swept import sweep
from klack.verification.elasticity import free_bar_frequencies
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
BOTH_WAYS = (0.0, np.pi / 2)
SLOPE = 0.4 * 3.0 / 8.0
"""Of the wall of the lower part, dr/dz."""


def half_section() -> Mesh:
    """Peg D6 x 12 mm whose lower 8 mm taper to D3.6."""

    def tapered(points: np.ndarray) -> np.ndarray:
        r, z = points.T
        return np.column_stack([r * (0.6 + 0.4 * np.minimum(z / 8e-3, 1.0)), z])

    mesh = lattice_mesh("tri6", [np.linspace(0, 3e-3, 5), np.linspace(0, 12e-3, 16)], tapered)
    return replace(mesh, surfaces={name: mesh.surface(name) for name in ("outer", "top")})


@cache
def peg(held: bool) -> tuple[FourierBody, Modes, ElasticBody, Modes]:
    """In order 1 and as a solid of 16 layers, with their modes."""
    mesh = half_section()
    solid = sweep(mesh, 16)

    def nodes(of: Mesh) -> np.ndarray:
        return of.surface("top").nodes if held else np.empty(0, dtype=np.int64)

    bending = fourier_body("peg", mesh, {"solid": STEEL}, order=1, fixed_nodes=nodes(mesh))
    body = elastic_body("peg", solid, {"solid": STEEL}, fixed_nodes=nodes(solid))
    return bending, eigenmodes(bending, count=3), body, eigenmodes(body, count=10)


def pairs(frequency: float, modes: Modes) -> np.ndarray:
    """The two modes of the solid that belong to a frequency of order 1."""
    return np.argsort(np.abs(modes.frequency - frequency))[:2]


def cylindrical(points: np.ndarray) -> np.ndarray:
    x, y, z = points.T
    return np.column_stack([np.hypot(x, y), z, np.arctan2(y, x)])


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_frequencies_are_the_double_ones_of_the_solid(held):
    """The solid is the stiffer one by its mesh: 2e-4 to 4e-4 with 16 layers, less with more."""
    _, modes, _, of_solid = peg(held)
    for frequency in modes.frequency:
        pair = of_solid.frequency[pairs(frequency, of_solid)]
        assert pair[1] == pytest.approx(pair[0], rel=1e-9)
        assert 0 < pair[0] / frequency - 1 < 5e-4


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_fields_span_the_same_two_shapes(held):
    """Both motions of a mode, put into space, are orthonormal in the mass of the solid."""
    bending, modes, body, of_solid = peg(held)
    place = cylindrical(body.mesh.points)
    fields = [
        field_rows(bending, place, where="test", towards=towards) @ modes.shapes
        for towards in BOTH_WAYS
    ]
    for k, frequency in enumerate(modes.frequency):
        both = np.column_stack([field[:, k] for field in fields])
        np.testing.assert_allclose(both.T @ (body.M @ both), np.eye(2), atol=5e-4)
        shapes = of_solid.shapes[:, pairs(frequency, of_solid)]
        cosines = np.linalg.svd(both.T @ (body.M @ shapes), compute_uv=False)
        np.testing.assert_allclose(cosines, 1.0, atol=3e-4)  # error of the mesh squared


@pytest.mark.slow
def test_traces_on_a_ring_are_those_of_the_solid():
    """Displacement along the outward normal of the taper, at all nodes of one ring of it."""
    bending, modes, body, of_solid = peg(False)
    outer = bending.mesh.surface("outer").nodes
    node = outer[np.argmin(np.abs(bending.mesh.points[outer, 1] - 0.8e-3))]
    radius, height = bending.mesh.points[node]
    normal = np.array([1.0, -SLOPE]) / np.hypot(1.0, SLOPE)
    place = cylindrical(body.mesh.points)
    ring = np.flatnonzero(np.hypot(place[:, 0] - radius, place[:, 1] - height) < 1e-9)
    assert ring.size == 32  # corners and mid nodes
    angles = place[ring, 2]
    outward = np.column_stack(
        [normal[0] * np.cos(angles), normal[0] * np.sin(angles), np.full(32, normal[1])]
    )
    row = np.zeros((bending.mesh.node_count, 2))
    row[node] = normal
    for k, frequency in enumerate(modes.frequency):
        both = np.column_stack(
            [
                rows_around(csr_array(row.reshape(1, -1)), 1, angles, towards=towards)
                @ modes.shapes[:, k]
                for towards in BOTH_WAYS
            ]
        )
        solid = of_solid.shapes[:, pairs(frequency, of_solid)].reshape(-1, 3, 2)[ring]
        normal_part = np.einsum("ki,kij->kj", outward, solid)
        amounts, *_ = np.linalg.lstsq(both, normal_part, rcond=None)
        assert np.abs(both).max() > 1.0
        misfit = np.abs(both @ amounts - normal_part).max() / np.abs(normal_part).max()
        assert misfit < 3e-3
        # not only the course around the ring, its size as well: a rotation of two unit vectors
        np.testing.assert_allclose(amounts.T @ amounts, np.eye(2), atol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_static_answer_is_that_of_the_solid(held):
    """The side is pushed along x; the free peg answers with inertia relief.

    Tolerances: the error of the solid's mesh, largest next to the edges of its ends.
    """
    bending, _, body, _ = peg(held)
    half = bending.mesh
    load = order_load(
        half, half.surface("outer"), lambda x, n: np.tile([1.0, -1.0, 0.0], (len(x), 1)), 1
    )
    of_solid = traction_load(
        body.mesh,
        body.mesh.surface("outer"),
        lambda x, n: np.tile([1.0, 0.0, 0.0], (len(x), 1)),
    )
    with Flexibility(bending) as flexibility, Flexibility(body) as solid:
        u, expected = flexibility.solve(load), solid.solve(of_solid)
    field = field_rows(bending, cylindrical(body.mesh.points), where="test") @ u
    assert load @ u == pytest.approx(of_solid @ expected, rel=2e-3, abs=0.0)
    np.testing.assert_allclose(field, expected, rtol=0, atol=5e-3 * np.abs(expected).max())


def test_slender_rods_bend_as_beams():
    """Length over diameter 7.5, 15, 30: Timoshenko to 4e-6, Euler-Bernoulli in the limit."""
    from_euler, from_timoshenko = [], []
    for slenderness, cells in ((7.5, 60), (15, 120), (30, 240)):
        radius, length = 1e-3, 2e-3 * slenderness
        mesh = lattice_mesh("quad8", [np.linspace(0, radius, 4), np.linspace(0, length, cells + 1)])
        rod = fourier_body("rod", mesh, {"solid": STEEL}, order=1)
        frequency = eigenmodes(rod, count=3).frequency
        euler, timoshenko = free_bar_frequencies(STEEL, radius, length)
        from_euler.append(frequency / euler - 1)
        from_timoshenko.append(frequency / timoshenko - 1)
    # shear and rotary inertia lower the frequency by (radius/length)^2 times a number
    assert np.max(from_euler) < 0
    orders = np.log2(np.abs(from_euler[1]) / np.abs(from_euler[2]))
    np.testing.assert_allclose(orders[:2], 2.0, atol=0.1)
    # Timoshenko is one order of (radius/length)^2 better
    assert np.abs(from_timoshenko[0]).max() < 4e-4
    assert np.abs(from_timoshenko[1]).max() < 4e-5
    assert np.abs(from_timoshenko[2]).max() < 4e-6
