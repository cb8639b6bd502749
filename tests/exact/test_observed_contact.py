"""A contact whose gap is read at another place than the force acts.

Truth: closed forms of a rigid mass that is read ``alpha`` times as far as it moves; an integration
of two modes by another method; and the reciprocal contact of the same bodies.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.laws import LinearLaw
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.observed_contact import observed_impact
from klack.simulation.system import ContactPair, ReducedSystem

MASS, STIFFNESS, SPEED = 2e-3, 1e9, 0.4  # [kg], [N/m], [m/s]
WALL = fixed_body("wall")
NOTHING = WALL.port_shapes[:, 0]


def two_modes() -> ReducedBody:
    """Free body with one elastic mode."""
    rigid = rigid_mass_body("needle", MASS)
    return replace(
        rigid,
        omega=np.array([0.0, 2 * np.pi * 60e3]),
        damping=np.zeros(2),
        port_shapes=np.vstack([rigid.port_shapes, [[20.0]]]),
        observer_shapes=np.zeros((2, 0)),
    )


def run(body, read, duration, step=5e-9):
    return observed_impact(
        body,
        WALL,
        outputs=(read, NOTHING),
        stiffness=STIFFNESS,
        speed=SPEED,
        duration=duration,
        step=step,
    )


@pytest.mark.parametrize("alpha", [0.5, 1.0, 1.3])
def test_rigid_mass_read_with_a_factor(alpha):
    """``m y'' = -k alpha y``: half a sine of that frequency; the spring has ``alpha`` of ``E``."""
    body = rigid_mass_body("needle", MASS)
    read = alpha * body.port_shapes[:, 0]
    half = np.pi * np.sqrt(MASS / (alpha * STIFFNESS))

    whole = run(body, read, 1.3 * half)
    deepest = run(body, read, 0.5 * half, step=0.5 * half / 2000)

    # the step of 1/1000 of the contact leaves 1e-6
    assert whole.peak_force == pytest.approx(SPEED * np.sqrt(alpha * STIFFNESS * MASS), rel=1e-5)
    assert whole.restitution == pytest.approx(1.0, rel=1e-5)
    assert whole.energy == pytest.approx(1.0, rel=1e-9)
    assert deepest.energy == pytest.approx(alpha, rel=1e-5)


@pytest.mark.parametrize(("share", "sign"), [(1.5, -1.0), (0.7, 1.0), (1.0, 0.0)])
def test_energy_is_that_of_another_integration(share, sign):
    """The elastic mode is read with another amplitude: energy appears or disappears."""
    body = two_modes()
    load = body.port_shapes[:, 0]
    read = load * [1.0, share]
    duration = 12e-6

    def rate(_, state):
        q, v = state[:2], state[2:]
        force = STIFFNESS * max(-float(read @ q), 0.0)
        return np.concatenate([v, load * force - body.omega**2 * q])

    start = np.concatenate([np.zeros(2), -SPEED * body.rigid_axial, [0.0]])
    end = solve_ivp(rate, (0.0, duration), start, rtol=1e-10, atol=1e-16, max_step=20e-9).y[:, -1]
    expected = 0.5 * float(end[2:] @ end[2:] + (body.omega * end[:2]) @ (body.omega * end[:2]))
    expected += 0.5 * STIFFNESS * max(-float(read @ end[:2]), 0.0) ** 2
    expected /= 0.5 * MASS * SPEED**2

    found = run(body, read, duration, step=1e-9)

    assert found.energy == pytest.approx(expected, rel=1e-4)
    assert np.sign(round(expected - 1.0, 6)) == sign  # the case makes a difference
    if sign == 0:
        assert found.energy == pytest.approx(1.0, abs=1e-12)


def test_read_at_the_port_it_is_the_reciprocal_impact():
    body = two_modes()
    contact = ContactPair(
        body_a="needle",
        port_a="contact",
        body_b="wall",
        port_b="contact",
        law=LinearLaw(STIFFNESS),
        gap=0.0,
    )
    system = ReducedSystem(bodies=(body, WALL), contacts=(contact,))
    history = simulate_impact(system, speed=SPEED, duration=12e-6, step=5e-9)

    found = run(body, body.port_shapes[:, 0], 12e-6)

    np.testing.assert_allclose(found.force, history.force, rtol=1e-9, atol=1e-9 * found.peak_force)
    assert found.restitution == pytest.approx(history.velocity_a[-1] / SPEED, rel=1e-9)


def test_a_node_that_moves_against_the_load_is_refused():
    body = two_modes()
    with pytest.raises(InputError, match="use a node on the contact surface"):
        run(body, body.port_shapes[:, 0] * [1.0, -3.0], 12e-6)
