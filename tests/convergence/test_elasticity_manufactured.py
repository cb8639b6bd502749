"""Order of elastic bodies and of their stress.

Truth: a made-up smooth displacement with its exact body force.

The error must fall with h^2 in the energy norm and with h^3 in L2 for quadratic elements (h and h^2
for linear ones).

Truth: Lame's thick cylinder under inner pressure, in plane strain.

sigma_r = A - B / r^2, sigma_theta = A + B / r^2, sigma_z = 2 nu A with A = p a^2 / (b^2 - a^2),
B = A b^2.  The finite elements are solved, so the error of the displacements is inside.
"""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.loads import traction_load
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.bodies.elasticity.stress import StressField
from klack.materials.material import Material
from klack.verification.lattice import lattice_mesh

MATERIAL = Material(name="unit", young=1.0, poisson=0.3, density=1.0)
LAMBDA, MU = MATERIAL.lame_lambda, MATERIAL.shear_modulus
WAVE = np.array([1.3, 0.9, 1.1])


def solid_field(x: np.ndarray) -> np.ndarray:
    """Return u = grad phi + curl (0, 0, phi), phi = sin ax sin by cos cz."""
    a, b, c = WAVE
    s, k = np.sin(x * WAVE), np.cos(x * WAVE)
    phi = [
        a * k[..., 0] * s[..., 1] * k[..., 2],
        b * s[..., 0] * k[..., 1] * k[..., 2],
        -c * s[..., 0] * s[..., 1] * s[..., 2],
    ]
    return np.stack([phi[0] + phi[1], phi[1] - phi[0], phi[2]], axis=-1)


def solid_force(x: np.ndarray) -> np.ndarray:
    """-div sigma = (lambda + 2 mu) k^2 grad phi + mu k^2 curl (0, 0, phi)."""
    u = solid_field(x)
    gradient = np.stack([(u[..., 0] - u[..., 1]) / 2, (u[..., 0] + u[..., 1]) / 2, u[..., 2]], -1)
    return WAVE @ WAVE * ((LAMBDA + MU) * gradient + MU * u)


def round_field(x: np.ndarray) -> np.ndarray:
    """Return u_r = r^3 sin z, u_z = r^2 cos z."""
    r, z = x[..., 0], x[..., 1]
    return np.stack([r**3 * np.sin(z), r**2 * np.cos(z)], axis=-1)


def round_force(x: np.ndarray) -> np.ndarray:
    """Minus the Navier equations of a body of revolution, worked out by hand."""
    r, z = x[..., 0], x[..., 1]
    # div u = e = 4 r^2 sin z - r^2 sin z = 3 r^2 sin z
    de_dr, de_dz = 6 * r * np.sin(z), 3 * r**2 * np.cos(z)
    # vector Laplacian: r: u_r,rr + u_r,r/r - u_r/r^2 + u_r,zz ; z: u_z,rr + u_z,r/r + u_z,zz
    laplace_r = (6 + 3 - 1) * r * np.sin(z) - r**3 * np.sin(z)
    laplace_z = (2 + 2) * np.cos(z) - r**2 * np.cos(z)
    return -np.stack(
        [(LAMBDA + MU) * de_dr + MU * laplace_r, (LAMBDA + MU) * de_dz + MU * laplace_z], axis=-1
    )


def errors(family: str, cells: int) -> tuple[float, float]:
    """Energy and L2 error of the solution with exact displacements on the whole boundary."""
    solid = family in ("tet4", "tet10", "hex8", "hex20", "wedge15")
    field, force = (solid_field, solid_force) if solid else (round_field, round_force)
    d = 3 if solid else 2
    lines = [np.linspace(0.0, 1.0, cells + 1)] * d
    bend = np.array([0.1, 0.05, -0.08])[:d]
    mesh = lattice_mesh(
        family, lines, lambda x: x + bend * np.prod(np.sin(np.pi * x), axis=1)[:, None]
    )
    K, M = assemble(mesh, {"solid": MATERIAL})
    held = np.unique(np.concatenate([s.nodes for s in mesh.surfaces.values()]))
    if not solid:  # the axis is no boundary, but there u_r = 0
        held = np.union1d(held, mesh.surface("inner").nodes)
    fixed = np.zeros(mesh.dof_count, dtype=bool)
    fixed.reshape(-1, d)[held] = True
    u = np.where(fixed, field(mesh.points).ravel(), 0.0)
    load = M @ force(mesh.points).ravel() - K @ u  # nodal interpolation: one order better
    free = np.flatnonzero(~fixed)
    with factorize(K[free][:, free]) as factor:
        u[free] = factor.solve(load[free])
    return error_norms(mesh, u.reshape(-1, d), field)


def error_norms(mesh, u, field) -> tuple[float, float]:
    """Energy-like (full gradient) and L2 norm by the mass rule."""
    (block,) = mesh.blocks
    xi, w = quadrature(block.family, "mass")
    N, dN = shape_functions(block.family, xi)
    nodes, values = mesh.points[block.connectivity], u[block.connectivity]
    J = np.einsum("eia,qib->eqab", nodes, dN)
    x = np.einsum("qi,eia->eqa", N, nodes)
    volume = w * np.linalg.det(J)
    if mesh.dimension == 2:
        volume = volume * 2 * np.pi * x[..., 0]
    slope = np.einsum("eia,qib,eqbc->eqac", values, dN, np.linalg.inv(J))
    exact = np.stack(
        [(field(x + 1e-6 * e) - field(x - 1e-6 * e)) / 2e-6 for e in np.eye(mesh.dimension)], -1
    )
    difference = np.einsum("qi,eia->eqa", N, values) - field(x)
    energy = np.sum(volume * np.sum((slope - exact) ** 2, axis=(2, 3)))
    return float(np.sqrt(energy)), float(np.sqrt(np.sum(volume * np.sum(difference**2, axis=2))))


@pytest.mark.parametrize(
    ("family", "coarse", "order"),
    [
        *(("tet4", 5, 1), ("hex8", 5, 1), ("quad4", 8, 1), ("tri3", 8, 1)),
        *(("tet10", 3, 2), ("hex20", 3, 2), ("wedge15", 3, 2), ("quad8", 4, 2), ("tri6", 4, 2)),
    ],
)
def test_error_falls_with_the_order_of_the_element(family, coarse, order):
    """Slope over one halving; the band allows for meshes that are still coarse."""
    energy_1, l2_1 = errors(family, coarse)
    energy_2, l2_2 = errors(family, 2 * coarse)
    assert order - 0.2 < np.log2(energy_1 / energy_2) < order + 0.5
    assert order + 0.8 < np.log2(l2_1 / l2_2) < order + 1.6


STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
INNER, OUTER, PRESSURE = 2e-3, 4e-3, 100e6


def largest_error(family: str, cells: int) -> float:
    """Largest error of any stress at any node, over the pressure."""
    lines = [np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, 3)]
    mesh = lattice_mesh(
        family, lines, lambda x: x * [OUTER - INNER, 2 / cells * (OUTER - INNER)] + [INNER, 0.0]
    )
    K, _ = assemble(mesh, {"solid": STEEL})
    bore = traction_load(
        mesh,
        mesh.surface("inner"),
        lambda x, n: -PRESSURE * n,
    )
    radial = 2 * np.arange(mesh.node_count)
    u = np.zeros(mesh.dof_count)
    u[radial] = spsolve(K.tocsc()[np.ix_(radial, radial)], bore[radial])

    stress = StressField(mesh, {"solid": STEEL})(u)

    r = mesh.points[:, 0]
    A = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    B = A * OUTER**2
    exact = np.column_stack([A - B / r**2, A + B / r**2, 2 * STEEL.poisson * A + 0 * r])
    return float(np.abs(stress[:, :3] - exact).max() / PRESSURE)


@pytest.mark.parametrize(
    ("family", "order", "finest"),
    [("tri3", 1, 0.1), ("quad4", 1, 0.1), ("tri6", 2, 4e-3), ("quad8", 2, 4e-3)],
)
def test_stresses_of_a_thick_cylinder_converge(family: str, order: int, finest: float):
    """The largest error is at the bore; the order comes up from below as 1/r gets smooth."""
    error = [largest_error(family, cells) for cells in (8, 16)]

    assert np.log2(error[0] / error[1]) == pytest.approx(order, abs=0.15)
    assert error[1] < finest
