"""A rigid block that slides on a rigid plane (exact): Coulomb's law in textbook form."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace
from klack.elasticity.body import ElasticBody
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.transient.full_order import simulate_full_order

MASS, PRESS, STEP = 0.01, 20.0, 1e-6
SIDEWAYS = (0.03, -0.04)
SPEED = float(np.hypot(*SIDEWAYS))


def block() -> ElasticBody:
    """A solid of one node: three displacements, no stiffness."""
    return ElasticBody(
        name="block",
        mesh=Mesh(points=np.zeros((1, 3)), blocks=()),
        K=csr_array((3, 3)),
        M=csr_array(MASS * np.eye(3)),
        fixed=np.empty(0, dtype=np.int64),
    )


def slide(law: Friction, duration: float, body: ElasticBody | None = None, **options):
    """Along x and y, pressed against the plane z = 0."""
    body = body or block()
    along = csr_array(np.eye(3)[:2])
    space = ContactSpace(
        G_a=csr_array(np.eye(3)[2:]),
        G_b=csr_array((1, 3)),
        gap=np.zeros(1),
        area=np.array([1e-6]),
        points=np.zeros((1, 3)),
        axial=np.ones(1),
        rim=np.zeros(1, dtype=bool),
        size=np.array([1e-3]),
        slave="a",
        nodes=np.zeros(1, dtype=np.int64),
        reach=0.0,
        clearance=0.0,
        entry=np.zeros(1),
    )
    given = {"speed": 1e-9, "step": STEP, "axial_force": -PRESS, "sideways": SIDEWAYS} | options
    return simulate_full_order(
        body,
        None,
        space,
        duration=duration,
        energy_interval=1,
        friction=FaceFriction(law=law, T_a=along, T_b=csr_array((2, 3))),
        **given,
    )


@pytest.mark.slow
def test_it_slows_down_by_mu_times_the_impulse_against_its_way():
    """Velocity times mass falls by mu times the normal impulse."""
    result = slide(Friction.coulomb(0.2), 50e-6)
    lost = 0.2 * result.history.impulse / MASS
    expected = np.array(SIDEWAYS) * (1.0 - lost / SPEED)
    assert 0.2 < lost / SPEED < 0.9
    np.testing.assert_allclose(result.fields[0].end_velocity[:2], expected, rtol=1e-10)
    energy = result.energy
    gone = 0.5 * MASS * (SPEED**2 - (SPEED - lost) ** 2)
    assert energy.friction[-1] == pytest.approx(gone, rel=1e-6)


@pytest.mark.slow
def test_it_stops_where_its_energy_is_spent():
    """After v^2 m / (2 mu F), to the step; then it holds, with less than mu times the force."""
    result = slide(Friction.coulomb(0.2), 300e-6)
    way = result.fields[0].end_displacement[:2]
    length = SPEED**2 * MASS / (2.0 * 0.2 * PRESS)
    np.testing.assert_allclose(way, length * np.array(SIDEWAYS) / SPEED, atol=SPEED * STEP)
    later = slide(Friction.coulomb(0.2), 400e-6)
    np.testing.assert_allclose(later.fields[0].end_displacement[:2], way, rtol=1e-12)
    kinetic = 0.5 * MASS * SPEED**2
    assert result.energy.friction[-1] == pytest.approx(kinetic, rel=1e-3)


@pytest.mark.slow
def test_the_coefficient_follows_the_speed_of_slip():
    """Stribeck's curve: m dv/dt = -mu(v) F, in a hundred parts of each step."""
    law = Friction(kinetic=0.1, static=0.4, speed=0.05)
    result = slide(law, 50e-6)
    v, parts = SPEED, 100
    for force in result.history.force:
        for _ in range(parts):
            v -= float(law.coefficient(np.array(v))) * force * STEP / MASS / parts
    found = float(np.hypot(*result.fields[0].end_velocity[:2]))
    kinetic_only = SPEED - 0.1 * result.history.impulse / MASS
    assert found == pytest.approx(v, rel=0.02)
    assert kinetic_only > 1.3 * v


def test_a_plane_across_which_nothing_can_move_is_refused():
    held = block()
    held = ElasticBody(
        name="held", mesh=held.mesh, K=held.K, M=held.M, fixed=np.array([0, 1], dtype=np.int64)
    )
    with pytest.raises(InputError, match="nothing can move across"):
        slide(Friction.coulomb(0.2), 5e-6, held, sideways=(0.0, 0.0))
    with pytest.raises(InputError, match="held sideways"):
        slide(Friction.coulomb(0.2), 5e-6, held)
