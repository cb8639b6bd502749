"""What no reduction may break: reciprocity, passivity, mass, and no compliance counted twice."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import LossFactor, ModalDamping
from klack.bodies.reduction.full_order import full_order_receptance
from klack.bodies.reduction.ports import Observer, node_observer, surface_port
from klack.bodies.reduction.receptance import reduced_receptance
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.selection import ByCount, ByParticipation
from klack.materials.material import Material
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
AXIS = np.geomspace(2e3, 1e6, 300)


@pytest.fixture(scope="module")
def block():
    """Free steel block 4 x 5 x 12 mm, no symmetry in its loads."""
    lines = [np.linspace(0, 4e-3, 3), np.linspace(0, 5e-3, 3), np.linspace(0, 12e-3, 5)]
    mesh = lattice_mesh("hex20", lines, solid="block")
    body = elastic_body("block", mesh, {"block": STEEL})
    ports = [
        surface_port(mesh, "bottom", "z", name="seat"),
        surface_port(mesh, "left", (1.0, 2.0, 0.5), name="side"),
    ]
    return body, ports, eigenmodes(body, count=40), Flexibility(body)


def reduced(block, correction, count=12, observers=(), ports=None):
    body, all_ports, pool, flexibility = block
    return reduce_body(
        body,
        ports or all_ports,
        modes=ByCount(count),
        correction=correction,
        damping=ModalDamping(ratio=5e-3),
        observers=observers,
        modes_pool=pool,
        flexibility=flexibility,
    )


@pytest.mark.parametrize("correction", ["consistent", "attachment", "none"])
def test_modal_and_residual_compliance_make_the_static_one(block, correction):
    """Algebra: nothing counted twice; and the modes never carry more than there is."""
    body = reduced(block, correction)

    total = body.modal_compliance + body.residual_compliance
    assert_allclose(total, body.static_compliance, rtol=1e-12)
    scale = np.linalg.norm(body.static_compliance)
    assert np.linalg.eigvalsh(body.residual_compliance).min() > -1e-9 * scale


def test_all_modes_carry_all_the_compliance():
    """Conservation: the modal sum over every elastic mode is the inertia-relief compliance."""
    mesh = lattice_mesh("hex8", [np.linspace(0, 1e-2, 3)] * 3, solid="cube")
    body = elastic_body("cube", mesh, {"cube": STEEL})
    port = surface_port(mesh, "top", "z", name="top")
    everything = eigenmodes(body, count=body.dof_count - 6 - 3)
    rest = reduce_body(
        body,
        [port],
        modes=ByCount(len(everything.omega)),
        correction="consistent",
        damping=LossFactor(eta=0.0),
        modes_pool=everything,
    )

    assert rest.compliance_share[0] == pytest.approx(1.0, rel=1e-3)


def test_mass_of_the_free_body(block):
    """Conservation: rho V; unit axial velocity has the momentum m and the energy m/2."""
    body = reduced(block, "consistent")

    assert body.rigid_count == 6
    assert body.mass == pytest.approx(7850 * 4e-3 * 5e-3 * 12e-3, rel=1e-12)
    assert body.rigid_axial @ body.rigid_axial == pytest.approx(body.mass, rel=1e-9)


def test_uniform_motion_moves_the_port_with_it(block):
    """Conservation: the port displacement of a unit axial translation is 1 (resultant 1 N)."""
    body = reduced(block, "consistent")

    assert body.rigid_axial @ body.port_shapes[:6, 0] == pytest.approx(1.0, rel=1e-9)


def test_modes_and_attachment_modes_are_orthonormal(block):
    """Every mode of a reduced body is M-orthonormal and K-diagonal, attachment modes too."""
    full_body, ports, pool, flexibility = block
    body = reduce_body(
        full_body,
        ports,
        modes=ByCount(12),
        correction="attachment",
        damping=LossFactor(eta=0.0),
        modes_pool=pool,
        flexibility=flexibility,
        recovery_nodes=np.arange(full_body.dof_count // 3),
    )
    V = body.recovery.shapes

    assert body.attachment_count == 2
    assert_allclose(V.T @ (full_body.M @ V), np.eye(body.mode_count), atol=1e-8)
    stiffness = V.T @ (full_body.K @ V)
    assert_allclose(stiffness, np.diag(body.omega**2), atol=1e-8 * body.omega[-1] ** 2)


def test_force_here_seen_there_is_force_there_seen_here(block):
    """Maxwell and Betti, between two reductions that do not know of each other."""
    seat, side = block[1]
    here = reduced(block, "none", ports=[seat], observers=[Observer("side", side.pattern)])
    there = reduced(block, "none", ports=[side], observers=[Observer("seat", seat.pattern)])

    s = 2j * np.pi * AXIS[:, None]
    gain = here.omega**2 + 2 * here.damping * here.omega * s + s**2
    one_way = np.sum(here.port_shapes[:, 0] * here.observer_shapes[:, 0] / gain, axis=1)
    other_way = np.sum(there.port_shapes[:, 0] * there.observer_shapes[:, 0] / gain, axis=1)

    assert_allclose(one_way, other_way, rtol=1e-9, atol=1e-12 * np.abs(one_way).max())


def test_single_node_is_not_reciprocal_with_the_surface(block):
    """Why a node is an observer only: it moves differently from the mean that does the work."""
    corner = node_observer(block[0].mesh, (0.0, 0.0, 0.0), "z", name="corner")
    body = reduced(block, "none", observers=[corner])

    elastic = slice(body.rigid_count, None)
    read = body.observer_shapes[elastic, 0] / body.omega[elastic]
    loaded = body.port_shapes[elastic, 0] / body.omega[elastic]

    assert np.linalg.norm(read - loaded) > 0.1 * np.linalg.norm(loaded)


@pytest.mark.parametrize(
    ("correction", "with_residual", "loss_factor"),
    [("none", False, None), ("consistent", True, 1e-2), ("attachment", False, 1e-2)],
)
def test_damped_body_takes_in_power(block, correction, with_residual, loss_factor):
    """Passivity: the power w/2 F^H (-Im G) F of any pair of port forces is never negative."""
    receptance = reduced_receptance(
        reduced(block, correction), AXIS, with_residual=with_residual, loss_factor=loss_factor
    )

    lowest = np.linalg.eigvalsh(-receptance.values.imag)[:, 0]
    assert np.all(lowest > -1e-12 * np.abs(receptance.values).max(axis=(1, 2)))


@pytest.mark.slow
def test_full_order_receptance_agrees_with_direct_solutions(block):
    """Truth: K - w^2 M factorised at four frequencies; 1e-6 for those close to a resonance."""
    body, ports, _, flexibility = block

    full = full_order_receptance(
        body, ports, AXIS, loss_factor=1e-2, flexibility=flexibility, tolerance=1e-5, checks=4
    )

    assert len(full.checked_frequencies) == 4
    assert full.checked_deviations.max() < 1e-6
    assert "direct solutions at 4 of them" in full.note


@pytest.mark.slow
def test_error_bound_of_the_krylov_receptance_holds(block):
    """Truth: the same curve with a far smaller tolerance; the bound lies above, within 1/eta."""
    body, ports, _, flexibility = block
    coarse, fine = (
        full_order_receptance(
            body, ports, AXIS, loss_factor=1e-2, flexibility=flexibility, tolerance=t, checks=0
        )
        for t in (0.5, 1e-8)
    )

    error = np.abs(coarse.receptance.values - fine.receptance.values)
    drive = np.einsum("wpp->wp", error / np.abs(fine.receptance.values))

    assert coarse.basis_size < fine.basis_size
    assert drive.max() > 1e-4  # otherwise nothing is tested
    assert np.all(drive <= 1.01 * coarse.error_bound + 1e-8)


@pytest.mark.slow
def test_known_modes_shorten_the_krylov_basis(block):
    """The same receptance from a basis that starts with modes; both bounds say 1e-4 at most."""
    body, ports, pool, flexibility = block
    kwargs = {"loss_factor": 1e-2, "flexibility": flexibility, "tolerance": 1e-4}

    plain = full_order_receptance(body, ports, AXIS, **kwargs)
    started = full_order_receptance(body, ports, AXIS, modes=pool, **kwargs)

    scale = np.abs(plain.receptance.values).max(axis=(1, 2))
    difference = np.abs(plain.receptance.values - started.receptance.values).max(axis=(1, 2))
    assert np.all(difference < 2e-4 * scale)
    assert started.basis_size - len(pool.omega) < plain.basis_size


def test_participation_carries_more_than_the_lowest_modes(block):
    """By definition of the ranking; here 81 % against 61 %, for bending and torsion modes cost."""
    body, ports, pool, flexibility = block
    share = {}
    for selection in (ByCount(5), ByParticipation(5, 40)):
        share[type(selection)] = reduce_body(
            body,
            ports[:1],
            modes=selection,
            correction="consistent",
            damping=LossFactor(eta=0.0),
            modes_pool=pool,
            flexibility=flexibility,
        ).compliance_share[0]

    assert share[ByParticipation] > 1.2 * share[ByCount]
