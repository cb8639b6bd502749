"""Truth: an impact and the rest after it belong to the valve, not to the steps (convergence)."""

import numpy as np
import pytest

from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.bodies import rod_body
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

LIFTED = 400e-6  # [s]


def rod() -> Component:
    body = rod_body(
        "needle", length=0.03, area=8e-6, young=2.1e11, density=7850.0, elastic_modes=5, damping=0.1
    )
    return FlexibleBody.of(body, ("bottom", "top"))


def dropped(needle: Component, step: float) -> NetworkResult:
    """A needle is pushed onto its seat, bounces, rests, and is pulled off at a known time."""
    parts: dict[str, Component] = {
        "needle": needle,
        "seat": EndStop(gap=5e-6, law={"kind": "linear", "stiffness": 2e8}, restitution=0.4),
        "force": ForceOverTime(time=(0.0, LIFTED, LIFTED + 1e-9), force=(-20.0, -20.0, 20.0)),
    }
    joints = [
        ["needle.bottom", "seat.upper"],
        ["needle.top", "force.end"],
        ["seat.lower", "ground"],
    ]
    return simulate_network(
        Network(parts, joints).rows(),
        duration=600e-6,
        step=step,
        coarse=16,
        record=1.28e-6,
        start="free",
    )


@pytest.mark.parametrize("kind", ["rigid", "rod"])
def test_impacts_and_rest_do_not_depend_on_the_step(kind):
    """Also of a rest: it ends when the needle is pulled off, and what hit it does not come back."""
    coarse, fine = (
        dropped(RigidMass(mass=2e-3, points=("bottom", "top")) if kind == "rigid" else rod(), step)
        for step in (20e-9, 2.5e-9)
    )

    for result in (coarse, fine):
        last = result.events[-1]
        assert last.restitution == 0.0
        assert LIFTED < last.separation_time < LIFTED + 8e-6  # a wave through the rod takes 5.8 us
        assert last.contact_time < 0.2 * LIFTED
        assert result.coarse_steps > 0
        record = result.interfaces["seat"]
        before_rest = record.time < last.time + last.contact_time
        assert np.max(record.step[before_rest]) < 4.1 * result.step  # four while it is smooth
        closed = record.contact_force > 0.0
        time = np.sum(record.step[closed & (record.time > last.time)])
        assert time == pytest.approx(last.separation_time - last.time, rel=0.05)
    first = (coarse.events[0], fine.events[0])
    for name in ("peak_force", "contact_time", "impulse"):
        one, other = (getattr(event, name) for event in first)
        assert one == pytest.approx(other, rel=5e-3)
    assert coarse.events[-1].contact_time == pytest.approx(fine.events[-1].contact_time, rel=0.1)
    assert coarse.events[-1].separation_time == pytest.approx(
        fine.events[-1].separation_time, abs=0.1e-6
    )
