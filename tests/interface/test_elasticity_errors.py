"""Wrong meshes and supports are refused with a text that says what to do."""

from dataclasses import replace

import numpy as np
import pytest

from klack.elasticity.assembly import assemble
from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.materials import Material
from klack.mesh.mesh import ElementBlock, Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
LINES = [np.linspace(0, 1e-3, 3), np.linspace(0, 1e-3, 3), np.linspace(0, 2e-3, 3)]


def test_inverted_element_is_named_with_its_place():
    mesh = lattice_mesh("tet10", LINES)
    (block,) = mesh.blocks
    connectivity = block.connectivity.copy()
    connectivity[7] = connectivity[7][[0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    bad = replace(mesh, blocks=(ElementBlock("tet10", connectivity, "needle"),))
    centre = 1e3 * mesh.points[connectivity[7]].mean(axis=0)
    with pytest.raises(InputError, match="solid 'needle', tet10 element 7") as error:
        assemble(bad, {"needle": STEEL})
    assert ", ".join(f"{c:.4f}" for c in centre) in str(error.value)
    for words in ("a Jacobian of -1 ", "wrong order", "1 of 48 elements"):
        assert words in str(error.value)


def test_mid_node_out_of_place_is_refused():
    mesh = lattice_mesh("hex20", LINES)
    (block,) = mesh.blocks
    points = mesh.points.copy()
    points[block.connectivity[2, 8]] += (0.0, 0.9e-3, 0.0)
    with pytest.raises(InputError, match="mid-edge"):
        assemble(replace(mesh, points=points), {"solid": STEEL})


def test_solid_without_material_is_named():
    with pytest.raises(InputError, match="no material for solid 'solid'"):
        assemble(lattice_mesh("hex8", LINES), {"body": STEEL})


def test_plane_elements_in_space_are_refused():
    mesh = lattice_mesh("hex8", LINES)
    flat = ElementBlock("quad4", mesh.blocks[0].connectivity[:, :4], "solid")
    with pytest.raises(InputError, match="elements of dimension 3"):
        assemble(replace(mesh, blocks=(flat,)), {"solid": STEEL})


def test_negative_radius_is_refused():
    lines = [np.linspace(-1e-3, 1e-3, 3), np.linspace(0, 2e-3, 3)]
    with pytest.raises(InputError, match="radius -1 mm"):
        assemble(lattice_mesh("quad8", lines), {"solid": STEEL})


def test_two_parts_are_counted_and_the_smaller_one_is_placed():
    large = lattice_mesh("hex8", LINES)
    small = lattice_mesh(
        "hex8", [np.linspace(0, 1e-3, 2)] * 3, lambda x: x + np.array([0, 0, 5e-3])
    )
    shifted = small.blocks[0].connectivity + large.node_count
    mesh = Mesh(
        points=np.vstack([large.points, small.points]),
        blocks=(*large.blocks, ElementBlock("hex8", shifted, "solid")),
    )
    with pytest.raises(InputError, match=r"2 parts.*8 nodes around \(0.5000, 0.5000, 5.5000\)"):
        elastic_body("pair", mesh, {"solid": STEEL})


def test_node_without_element_is_refused():
    mesh = lattice_mesh("hex8", LINES)
    stray = replace(mesh, points=np.vstack([mesh.points, [[0.0, 0.0, 9e-3]]]))
    with pytest.raises(InputError, match=r"1 nodes around \(0.0000, 0.0000, 9.0000\)"):
        elastic_body("box", stray, {"solid": STEEL})


@pytest.mark.parametrize(("nodes", "left"), [([4], 3), ("line", 1)])
def test_supports_that_leave_a_rotation_are_refused(nodes, left):
    mesh = lattice_mesh("hex8", LINES)
    if nodes == "line":
        nodes = np.flatnonzero((mesh.points[:, 0] == 0) & (mesh.points[:, 1] == 0))
    with pytest.raises(InputError, match=f"leave {left} of 6 rigid motions free"):
        elastic_body("box", mesh, {"solid": STEEL}, fixed_nodes=nodes)


def test_unknown_support_node_is_refused():
    mesh = lattice_mesh("hex8", LINES)
    with pytest.raises(InputError, match="numbers from 0 to 26"):
        elastic_body("box", mesh, {"solid": STEEL}, fixed_nodes=[3, 27])


def test_three_corner_nodes_are_support_enough():
    body = elastic_body("box", lattice_mesh("hex8", LINES), {"solid": STEEL}, fixed_nodes=[0, 2, 6])
    assert body.is_fixed


def test_two_bodies_that_share_one_edge_can_fold_and_are_refused():
    """A hinge is a mechanism: connected, but the stiffness has a seventh zero."""
    first = lattice_mesh("hex8", [np.linspace(0, 1e-3, 3)] * 3)
    second = lattice_mesh(
        "hex8", [np.linspace(0, 1e-3, 3)] * 3, lambda x: x + np.array([1e-3, 1e-3, 0])
    )
    points, where = np.unique(
        np.vstack([first.points, second.points]).round(9), axis=0, return_inverse=True
    )
    cells = np.vstack([first.blocks[0].connectivity, second.blocks[0].connectivity + 27])
    mesh = Mesh(points=points, blocks=(ElementBlock("hex8", where.ravel()[cells], "solid"),))
    body = elastic_body("hinge", mesh, {"solid": STEEL})
    with pytest.raises(InputError, match="not positive definite"):
        Flexibility(body)


def test_hidden_supports_are_noticed_by_the_modes():
    free = elastic_body("box", lattice_mesh("hex8", LINES), {"solid": STEEL})
    K = free.K.tolil()
    K[0, 0] *= 1.001
    held = ElasticBody(name="box", mesh=free.mesh, K=K.tocsr(), M=free.M, fixed=free.fixed)
    with pytest.raises(InputError, match=r"below 0\.1 Hz for a free body"):
        eigenmodes(held, count=3)


def test_requests_for_modes_are_checked():
    body = elastic_body("box", lattice_mesh("hex8", LINES), {"solid": STEEL})
    for asked, words in (
        ({}, "neither count nor max_frequency"),
        ({"count": 76}, "between 1 and 75"),
        ({"max_frequency": -1.0}, "max_frequency"),
    ):
        with pytest.raises(InputError, match=words):
            eigenmodes(body, **asked)


def test_loads_of_the_wrong_length_are_refused():
    body = elastic_body("box", lattice_mesh("hex8", LINES), {"solid": STEEL})
    with Flexibility(body) as flexibility, pytest.raises(InputError, match=r"\(81,\) or \(81, m\)"):
        flexibility.solve(np.zeros(80))
