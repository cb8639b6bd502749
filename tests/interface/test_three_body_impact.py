"""``klack impact`` of three bodies in a row: the numbers of the page, a stroke, and refusals.

Truth: the loop of a stroke with the same bodies and laws, which marches them on its own.
"""

import re
from dataclasses import replace

import pytest
from pages import HOW_TO

import klack
from klack.assembling.body_row import build_row
from klack.case import read_case
from klack.contact.restitution import measure_impact
from klack.errors import InputError
from klack.machine.progress import silent
from klack.simulation.impact import simulate
from klack.simulation.network_run import simulate_network

CASE = HOW_TO / "seat_insert_impact.yaml"
TEXT = CASE.read_text("utf-8")
PAGE = (HOW_TO / "seat-insert.md").read_text("utf-8")


@pytest.fixture(scope="module")
def row():
    return build_row(klack.load_case(CASE).checked, silent)


def moved(system, preload):
    """The row with another preload of its second contact, and its clamp."""
    first, second = system.contacts
    springs = tuple(
        replace(one, preload=preload) if one.port == "shoulder" else one for one in system.springs
    )
    return replace(system, contacts=(first, replace(second, preload=preload)), springs=springs)


def test_a_stroke_of_the_same_bodies_gives_the_same_impact(row):
    """Peaks to 0.1 %, times to 0.05 us; the stroke starts with its own static equilibrium."""
    run = simulate_network(row.valve.network.rows(), duration=30e-6, step=10e-9, coarse=1)
    seat, foot = run.interfaces["contact"], run.interfaces["backing"]
    preload = float(foot.contact_force[0])
    assert 450 < preload < 500  # the clamp gives way by the sink of the insert
    record = simulate(
        moved(row.system, preload), velocities={"needle": -1.6}, step=10e-9, duration=30e-6
    )
    (event,) = [one for one in run.events if one.stop == "contact"]
    found = measure_impact(record.impact(0))

    assert found.peak_force == pytest.approx(event.peak_force, rel=1e-3)
    assert found.contact_time == pytest.approx(event.contact_time, abs=5e-8)
    assert record.force[:, 1].max() == pytest.approx(foot.contact_force.max(), rel=1e-3)
    assert record.force[:, 1].min() == pytest.approx(foot.contact_force.min(), rel=1e-3)
    assert found.impulse == pytest.approx((seat.contact_force * seat.step).sum(), rel=1e-3)
    assert abs(record.ledger.residual) < 1e-12
