"""Ring contact of a spherical tip on a cone: solid against axisymmetric; truth: convergence.

The solid is a quarter with rollers on its two cuts, swept from the same meridian, with layers that
do not match: it has to give a quarter of the force.
"""

import numpy as np
import pytest

from klack.contact.mortar import contact_space, touching_shift
from klack.elasticity.body import ElasticBody, elastic_body
from klack.verification.contact import STEEL, IndentationProblem
from klack.verification.lattice import lattice_mesh

RADIUS = 1e-3
RING = RADIUS / np.sqrt(2.0)


def needle(x):
    height = -np.sqrt(RADIUS**2 - x[:, 0] ** 2)
    return np.column_stack([x[:, 0], height + (1e-3 - height) * x[:, -1]])


def seat(x):
    height = x[:, 0] - np.sqrt(2.0) * RADIUS
    return np.column_stack([x[:, 0], height - (2e-3 + height) * (1 - x[:, -1])])


def swept(meridian):
    def shape(x):
        r, z = meridian(x).T
        return np.column_stack([r * np.cos(x[:, 1]), r * np.sin(x[:, 1]), z])

    return shape


def lines(h, low, high):
    near = RING + h * np.arange(-3, 4)
    outward, inward = [near[-1]], [near[0]]
    while outward[-1] + 2.5 * h < high:
        outward.append(outward[-1] + 1.6 * (outward[-1] - ([near[-2], *outward])[-2]))
    while inward[-1] - 2.5 * h > low:
        inward.append(inward[-1] - 1.6 * (([near[1], *inward])[-2] - inward[-1]))
    outward, inward = [r for r in outward if r < high - h], [r for r in inward if r > low + h]
    return np.array([low, *inward[::-1], *near[1:-1], *outward, high])


def problem(h, layers):
    meridians = ((needle, lines(h, 0.3e-3, 0.92e-3)), (seat, lines(1.2 * h, 0.4e-3, 1.3e-3)))
    depth = np.array([0, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0])
    bodies = []
    for k, (meridian, r) in enumerate(meridians):
        z = depth if k == 0 else 1.0 - depth[::-1]
        if layers is None:
            mesh = lattice_mesh("quad8", [r, z], meridian)
        else:
            around = np.linspace(0, np.pi / 2, layers[k] + 1)
            mesh = lattice_mesh("hex20", [r, around, z], swept(meridian))
        held = mesh.surface("top" if k == 0 else "bottom").nodes
        body = elastic_body("body", mesh, {"solid": STEEL}, fixed_nodes=held)
        if layers is not None:
            rollers = (3 * mesh.surface("front").nodes + 1, 3 * mesh.surface("back").nodes)
            fixed = np.unique(np.concatenate([body.fixed, *rollers]))
            body = ElasticBody(body.name, mesh, body.K, body.M, fixed)
        bodies.append(body)
    a, b = bodies
    shift = np.zeros(a.dimension)
    shift[-1] = touching_shift(a.mesh, a.mesh.surface("bottom"), b.mesh, b.mesh.surface("top"))
    placed = a.mesh.moved(shift)
    space = contact_space(
        placed, placed.surface("bottom"), b.mesh, b.mesh.surface("top"), reach=12e-6
    )
    return IndentationProblem(body_a=a, body_b=b, space=space)


def force_at(static, approach, parts):
    return parts * np.interp(approach, static.approach, static.force)


@pytest.mark.slow
def test_solid_ring_equals_the_axisymmetric_one():
    """24 against 20 layers per circle; measured 0.2 %.  Element size over half width is 1.1."""
    approach = np.array([1.0e-6, 2.0e-6, 3.0e-6, 4.0e-6])
    flat = problem(20e-6, None).solve(300.0)
    solid = problem(20e-6, (6, 5)).solve(75.0)

    np.testing.assert_allclose(
        force_at(solid, approach, 4.0), force_at(flat, approach, 1.0), rtol=0.01
    )
    assert solid.half_width[-1] == pytest.approx(flat.half_width[-1], rel=0.1)


def test_force_converges_with_the_elements_across_the_ring():
    approach = np.array([2.0e-6, 4.0e-6])
    force = np.array(
        [force_at(problem(h, None).solve(300.0), approach, 1.0) for h in (20e-6, 10e-6, 5e-6)]
    )

    error = np.abs(force[:2] / force[2] - 1.0)
    assert np.all(error[1] < error[0])
    assert np.all(error[0] < 0.02)
    assert np.all(error[1] < 0.005)
