"""Truth: fields whose stress is known in closed form.

Constant stress on distorted meshes; pure bending of a beam, whose displacement is quadratic and
whose stress is linear; two bars of different materials in series.
"""

from dataclasses import replace

import numpy as np
import pytest

from klack.bodies.elasticity.stress import StressField, von_mises
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.mesh import ElementBlock, Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
BRASS = Material(name="brass", young=100e9, poisson=0.3, density=8500.0)
SOLIDS = ("tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15")
PLANES = ("tri3", "tri6", "quad4", "quad8")


def box(family: str, scale: float, shift: float) -> Mesh:
    """3 x 3 (x 3) cells on straight edges; inner corners moved by up to ``shift`` of the box."""
    d = 3 if family in SOLIDS else 2
    mesh = lattice_mesh(family, [np.linspace(0.0, 1.0, 4)] * d, lambda x: scale * x)
    (block,) = mesh.blocks
    inner = np.all((mesh.points > 1e-9) & (mesh.points < scale * (1 - 1e-9)), axis=1)
    moved = np.random.default_rng(7).uniform(-1, 1, mesh.points.shape) * shift * scale
    points = mesh.points + moved * inner[:, None]
    if block.topology.quadratic:
        for k, (i, j) in enumerate(block.topology.edges):
            ends = block.connectivity[:, [i, j]]
            points[block.connectivity[:, block.topology.corners + k]] = points[ends].mean(axis=1)
    return replace(mesh, points=points)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("family", SOLIDS)
def test_a_linear_displacement_has_constant_stress(family: str, scale: float):
    mesh = box(family, scale, 1 / 21)
    gradient = np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.7, -0.6, 0.2]]) * 1e-4
    strain = (gradient + gradient.T) / 2
    tensor = STEEL.lame_lambda * np.trace(strain) * np.eye(3) + 2 * STEEL.shear_modulus * strain

    stress = StressField(mesh, {"solid": STEEL})((mesh.points @ gradient.T).ravel())

    expected = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))]
    assert stress.shape == (mesh.node_count, 6)
    np.testing.assert_allclose(stress - expected, 0.0, atol=1e-11 * np.abs(tensor).max())
    # the length of the deviator, another way to the same number
    deviator = tensor - np.trace(tensor) / 3 * np.eye(3)
    np.testing.assert_allclose(von_mises(stress), np.sqrt(1.5) * np.linalg.norm(deviator), 1e-11)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("family", PLANES)
def test_a_body_of_revolution_that_swells_has_constant_stress(family: str, scale: float):
    """u_r = a r, u_z = b z + c r: with a shear, too; nodes on the axis are among them."""
    mesh = box(family, scale, 1 / 21)
    a, b, c = 2e-4, -3e-4, 1e-4
    r, z = mesh.points.T

    stress = StressField(mesh, {"solid": STEEL})(np.column_stack([a * r, b * z + c * r]))

    volume = STEEL.lame_lambda * (2 * a + b)
    shear = STEEL.shear_modulus
    expected = [volume + 2 * shear * a] * 2 + [volume + 2 * shear * b, 0.0, 0.0, shear * c]
    np.testing.assert_allclose(stress - expected, 0.0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(("family", "shift"), [("tet10", 1 / 21), ("hex20", 0.0), ("wedge15", 0.0)])
def test_pure_bending_is_exact_with_quadratic_elements(family: str, shift: float):
    """Beam along x, curvature k: u = (k x y, -k/2 (x^2 + nu (y^2 - z^2)), -nu k y z)."""
    mesh = box(family, 1.0, shift)
    x, y, z = mesh.points.T
    k, nu = 1e-3, STEEL.poisson
    u = np.column_stack([k * x * y, -0.5 * k * (x**2 + nu * (y**2 - z**2)), -nu * k * y * z])

    stress = StressField(mesh, {"solid": STEEL})(u)

    np.testing.assert_allclose(stress[:, 0] - STEEL.young * k * y, 0.0, atol=1e-10 * 210e6)
    np.testing.assert_allclose(stress[:, 1:], 0.0, atol=1e-10 * 210e6)
    np.testing.assert_allclose(von_mises(stress), STEEL.young * k * y, atol=1e-10 * 210e6)


def test_stress_jumps_where_materials_meet():
    """Two cubes with the same strain: shared nodes get one stress for each material."""
    points = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)], float)
    left, right = np.array([[0, 1, 4, 3, 6, 7, 10, 9]]), np.array([[1, 2, 5, 4, 7, 8, 11, 10]])
    mesh = Mesh(
        points=points,
        blocks=(ElementBlock("hex8", left, "steel"), ElementBlock("hex8", right, "brass")),
    )
    field = StressField(mesh, {"steel": STEEL, "brass": BRASS})

    stress = field((points * [1e-3, 0.0, 0.0]).ravel())

    assert len(field.nodes) == 16
    np.testing.assert_array_equal(field.mesh.points, points[field.nodes])
    modulus = STEEL.lame_lambda + 2 * STEEL.shear_modulus
    ratio = BRASS.young / STEEL.young
    np.testing.assert_allclose(stress[:8, 0], 1e-3 * modulus, rtol=1e-12)
    np.testing.assert_allclose(stress[8:, 0], 1e-3 * modulus * ratio, rtol=1e-12)


def test_a_solid_without_material_is_named():
    mesh = box("tet4", 1.0, 0.0)

    with pytest.raises(InputError, match="solid 'solid'"):
        StressField(mesh, {"body": STEEL})
