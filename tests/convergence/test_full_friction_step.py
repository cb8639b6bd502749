"""Refinement of the time step in full-order impacts with friction."""

import numpy as np
import pytest

from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.mortar import tangent_rows
from klack.transient.full_order import simulate_full_order
from klack.verification.transient import needle_over_seat

STEPS = np.array([400e-9, 200e-9, 100e-9, 50e-9])


@pytest.mark.slow
def test_what_friction_takes_settles_with_the_step():
    """11 % of the energy of a needle on its seat; first order: slip counts from the step's start.

    Truth: half the step of the finest one, and the massless scheme.
    """
    a, b, space = needle_over_seat(size=12e-6, bulk=1e-3, length=8e-3)
    tip, cone = a.mesh.surface("tip"), b.mesh.surface("cone")
    T_a, T_b = tangent_rows(space, a.mesh, tip, b.mesh, cone)
    friction = FaceFriction(law=Friction.coulomb(0.1), T_a=T_a, T_b=T_b)

    def taken(step, scheme="contact-stabilised-newmark"):
        energy = simulate_full_order(
            a,
            b,
            space,
            speed=0.3,
            duration=20e-6,
            step=step,
            scheme=scheme,
            friction=friction,
        ).energy
        return energy.friction[-1] / energy.total[0]

    truth = taken(25e-9)
    error = np.abs(np.array([taken(step) for step in STEPS]) / truth - 1.0)
    order = np.polyfit(np.log(STEPS), np.log(error), 1)[0]
    assert np.all(np.diff(error) < 0.0)
    assert error[2] < 0.01
    assert order > 0.8
    assert abs(taken(50e-9, "massless") / truth - 1.0) < 5e-3
