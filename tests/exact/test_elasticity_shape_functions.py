"""Truth: definitions of shape functions and exact integrals of monomials (round-off only)."""

from itertools import product
from math import factorial

import numpy as np
import pytest

from klack.elasticity.quadrature import quadrature
from klack.elasticity.shape_functions import reference_nodes, shape_functions
from klack.mesh.families import FAMILIES

FAMILY_NAMES = sorted(FAMILIES)
MEASURE = {"line": 2, "tri": 1 / 2, "quad": 4, "tet": 1 / 6, "wedge": 1, "hex": 8}


def shape_of(family: str) -> str:
    return family.rstrip("0123456789")


def monomial_integral(shape: str, powers: tuple[int, ...]) -> float:
    """Closed formulas: 2/(k+1) on [-1, 1], i! j! k! / (i + j + k + d)! on a simplex."""

    def line(k: int) -> float:
        return 2 / (k + 1) if k % 2 == 0 else 0.0

    def simplex(powers: tuple[int, ...]) -> float:
        top = np.prod([factorial(k) for k in powers])
        return float(top / factorial(sum(powers) + len(powers)))

    if shape in ("tri", "tet"):
        return simplex(powers)
    if shape == "wedge":
        return simplex(powers[:2]) * line(powers[2])
    return float(np.prod([line(k) for k in powers]))


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_each_function_is_one_at_its_node_and_zero_at_the_others(family):
    N, _ = shape_functions(family, reference_nodes(family))
    np.testing.assert_allclose(N, np.eye(FAMILIES[family].nodes), atol=1e-15)


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_linear_fields_are_reproduced_with_their_gradient(family):
    nodes = reference_nodes(family)
    d = nodes.shape[1]
    xi = np.random.default_rng(3).uniform(0.05, 0.3, (7, d))
    N, dN = shape_functions(family, xi)
    slope = np.arange(1.0, d + 1)
    np.testing.assert_allclose(N @ (nodes @ slope + 2), xi @ slope + 2, rtol=1e-14)
    gradient = np.einsum("qnd,n->qd", dN, nodes @ slope + 2)
    np.testing.assert_allclose(gradient, np.tile(slope, (7, 1)), rtol=1e-13)


@pytest.mark.parametrize("family", [name for name in FAMILY_NAMES if FAMILIES[name].quadratic])
def test_quadratic_fields_are_reproduced(family):
    nodes = reference_nodes(family)
    xi = np.random.default_rng(4).uniform(0.05, 0.3, (7, nodes.shape[1]))
    N, _ = shape_functions(family, xi)
    np.testing.assert_allclose(N @ nodes.sum(axis=1) ** 2, xi.sum(axis=1) ** 2, rtol=1e-13)


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_derivatives_are_those_of_the_values(family):
    """Truth: the complex-free central difference; its own error is below 1e-9."""
    d = reference_nodes(family).shape[1]
    xi = np.random.default_rng(5).uniform(0.05, 0.3, (4, d))
    _, dN = shape_functions(family, xi)
    step = 1e-5
    for k in range(d):
        e = step * np.eye(d)[k]
        difference = (shape_functions(family, xi + e)[0] - shape_functions(family, xi - e)[0]) / (
            2 * step
        )
        np.testing.assert_allclose(dN[:, :, k], difference, atol=1e-9)


@pytest.mark.parametrize(
    ("family", "purpose", "degree"),
    [
        *(("tet4", "stiffness", 1), ("tet4", "mass", 2), ("tet10", "stiffness", 2)),
        *(("tet10", "mass", 5), ("tri3", "mass", 4), ("tri6", "mass", 6), ("tri6", "stiffness", 6)),
        *(
            ("line2", "mass", 3),
            ("line3", "mass", 5),
            ("wedge6", "stiffness", 2),
            ("wedge15", "mass", 4),
        ),
        *(
            ("quad4", "stiffness", 3),
            ("quad8", "mass", 5),
            ("hex8", "stiffness", 3),
            ("hex20", "mass", 5),
        ),
    ],
)
def test_rules_integrate_monomials_exactly(family, purpose, degree):
    """Mass of a straight-sided element needs twice the degree of its functions."""
    xi, w = quadrature(family, purpose)
    shape, d = shape_of(family), xi.shape[1]
    assert (w > 0).all()
    checked = 0
    for powers in product(range(degree + 1), repeat=d):
        if sum(powers) <= degree:
            value = w @ np.prod(xi**powers, axis=1)
            assert value == pytest.approx(monomial_integral(shape, powers), rel=1e-13, abs=1e-14)
            checked += 1
    assert checked > degree


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_weights_add_up_to_the_measure(family):
    for purpose in ("stiffness", "mass"):
        assert quadrature(family, purpose)[1].sum() == pytest.approx(
            MEASURE[shape_of(family)], rel=1e-14
        )
