"""Truth: integrals of polynomials over flat and parabolic faces, in closed form.

The weights of the integration points meet in every gap and every contact force; constant fields
alone, which the patch test sends through them, do not tell one weight from another.
"""

import numpy as np
import pytest
from draws import each

from klack.contact.mortar import contact_space, hat_quadrature
from klack.verification.lattice import lattice_mesh

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
