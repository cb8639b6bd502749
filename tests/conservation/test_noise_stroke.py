"""Noise of the shipped stroke, dry: impulse and energy from the force of the stops to the modes.

Truth: the impulse of each impact as the run itself booked it; work of the forces over time against
their spectrum times the real part of the mobility; mass times acceleration of the needle.
"""

from itertools import pairwise

import numpy as np
import pytest

from klack.acoustics.force_bands import force_bands
from klack.analyses.noise.record import NoiseDesign
from klack.analyses.noise.run import run_noise
from klack.analyses.noise.source import NoiseSource, stroke_sources
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.case.reader import find_case
from klack.case.valve import ValveCase
from klack.signals.sampled import TimeSeries

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study() -> StrokeStudy:
    """The dry stroke until it has bounced on the opening stop for a while."""
    case: ValveCase = load_valve_case(find_case("demo-stroke"))
    run = case.run.model_copy(update={"duration": 1e-3})
    return run_stroke(case.model_copy(update={"run": run}), variants=("dry",))


@pytest.fixture(scope="module")
def source(study: StrokeStudy) -> NoiseSource:
    (found,) = stroke_sources(study)
    return found


@pytest.fixture(scope="module")
def design(source: NoiseSource) -> NoiseDesign:
    return run_noise([source]).reference


def test_every_impact_keeps_its_impulse(study, source):
    (force,) = [stop.force for stop in source.stops if stop.name == "opening"]
    events = study.reference.impacts("opening")
    assert len(events) > 3
    edge = force.start - 0.5 * force.step
    for event, after in pairwise(events):
        # dry: nothing acts between the contacts
        first = round((event.time - edge) / force.step) - 2
        last = round((after.time - edge) / force.step) - 2
        impulse = force.values[first:last].sum() * force.step
        assert impulse == pytest.approx(event.impulse, rel=1e-9)


def test_energy_injected_is_energy_found(design):
    assert {body.name for body in design.bodies} == {"housing", "pole"}
    for body in design.bodies:
        assert abs(body.residual) < 1e-9
        # the housing that the needle leaves gives back what its seat had stored
        assert (body.injected.sum() > 0.0) == (body.name == "pole")
        assert body.vibration_energy > 0.0
        found = body.vibration_energy + body.static_energy
        assert body.injected.sum() == pytest.approx(found, rel=1e-9)
        # trapezia over resonances that are resolved three times per half width
        assert body.vibration_spectral == pytest.approx(body.vibration_energy, rel=1e-6)


def test_at_high_frequencies_nothing_but_the_contacts_pushes_the_needle(design, source):
    """Newton: contact forces of both stops, with their signs, are mass times acceleration."""
    signs = {"seat": 1.0, "opening": -1.0}
    values = np.sum([signs[stop.name] * stop.force.values for stop in source.stops], axis=0)
    force = source.stops[0].force
    contact = TimeSeries(step=force.step, values=np.pad(values, 1, mode="edge"), unit="N")
    net = source.net
    assert net is not None
    moved = TimeSeries(step=net.step, values=np.pad(net.values, 1), unit="N")

    one, other = force_bands(contact), force_bands(moved)

    shown = (one.middle[: other.middle.size] > 6e3) & (other.middle < 50e3)
    difference = (one.level[: other.level.size] - other.level)[shown]
    assert shown.sum() > 8
    # magnet and spring change slowly: half a decibel at 6 kHz
    assert np.abs(difference).max() < 0.5
    # and at 500 Hz they have taken back nearly all of it
    slow = int(np.flatnonzero(np.isclose(one.middle, 501.19, rtol=1e-3))[0])
    assert design.net_share[slow] < 0.03
    assert 1e3 < design.balanced_below < 6e3
