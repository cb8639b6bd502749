"""The static start of a network.

Truth: Hooke's law for the rest position, the energy of the spring for what comes after it, and the
decay of a damped oscillator.
"""

import numpy as np
import pytest

from klack.contact.laws import gonthier_coefficient
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

MASS, STIFFNESS, FORCE = 2e-3, 1e9, 12.0
PULLED = 20e-6  # [s]


def pressed(step: float, *, restitution: float, pull: float, **law: float) -> NetworkResult:
    """A mass is pressed onto a stop from the start on, and pulled at a known time."""
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "seat": EndStop(gap=0.0, law={"kind": "linear", **law}, restitution=restitution),
        "force": ForceOverTime(
            time=(0.0, PULLED, PULLED + 1e-9, 1.0),
            force=(-FORCE, -FORCE, pull - FORCE, pull - FORCE),
        ),
    }
    joints = [["needle.tip", "seat.upper", "force.end"], ["seat.lower", "ground"]]
    return simulate_network(
        Network(parts, joints).rows(), duration=100e-6, step=step, coarse=1, record=4 * step
    )


@pytest.mark.parametrize("step", [20e-9, 5e-9])
def test_a_pressed_mass_rests_at_hookes_depth_and_leaves_with_its_energy(step):
    result = pressed(step, restitution=1.0, pull=FORCE, stiffness=STIFFNESS)

    way = result.channels["needle.tip displacement"].values
    held = result.time < PULLED - 1e-6
    np.testing.assert_allclose(way[held], -FORCE / STIFFNESS, rtol=1e-9)
    speed = result.channels["needle.tip velocity"].values[-1]
    # the force ends within 1 ns, and the step resolves 0.014 of the period over 2 pi
    assert speed == pytest.approx(FORCE / np.sqrt(STIFFNESS * MASS), rel=1e-4)


@pytest.mark.parametrize("step", [20e-9, 5e-9])
@pytest.mark.parametrize("stiffness", [1e9, 3e7])
@pytest.mark.parametrize("restitution", [0.5, 0.8])
def test_a_resting_contact_has_half_of_its_factor_as_damping_ratio(restitution, stiffness, step):
    """Pulled by a little, it swings beyond by exp(-pi zeta / sqrt(1 - zeta^2)) of the way."""
    pull = 1e-3 * FORCE
    result = pressed(step, restitution=restitution, pull=pull, stiffness=stiffness)

    way = result.channels["needle.tip displacement"].values
    beyond = (way.max() - way[0]) / (pull / stiffness) - 1.0
    zeta = 0.5 * gonthier_coefficient(restitution)
    expected = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
    # the law is not linear: its damping falls with the indentation, 1e-3 of it here
    assert beyond == pytest.approx(expected, abs=3e-3)
