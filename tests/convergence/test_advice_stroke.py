"""Advice for a whole valve: its step against a step eight times finer, and its check (convergence).

The demo stroke with coarse contacts and few modes, until its needle has opened.
"""

import numpy as np
import pytest

from klack.analyses.advice.settings import applied
from klack.analyses.advice.stroke import (
    advise_stroke,
    first_impacts,
    step_ladder,
    stroke_measures,
)
from klack.assembling.valve import build_valve
from klack.case.shipped import find_case
from klack.case.valve import ValveCase
from klack.case.valve_reader import load_valve_case

pytestmark = pytest.mark.slow


def opening() -> ValveCase:
    case = load_valve_case(find_case("demo-stroke"))
    case = applied(case, {("run", "duration"): 0.4e-3})
    return case.model_copy(update={"noise": None})


def test_expected_error_of_the_step_bounds_that_against_an_eighth_of_it():
    """Peak force of the first impact; events come in whole steps, so it scatters."""
    valve = build_valve(opening())
    step = valve.case.run.fine_step
    fine, now = (first_impacts(valve, step=f * step) for f in (1 / 8, 1.0))
    true = max(abs(now[stop][1] / fine[stop][1] - 1.0) for stop in fine)

    expected = step_ladder(valve, now, stroke_measures(0.02)).ladder.error(1.0)[1]

    assert list(fine) == ["opening"]  # the only stop within this time
    # peaks scatter by 1e-4 with the phase of macro steps
    assert true <= max(expected, 1e-4)
    assert expected <= 10.0 * max(true, 1e-4)


def test_three_levels_of_every_setting_and_a_check():
    """No order is assumed; the advised valve is nearer to a run that is in nothing coarser."""
    sizes = {"needle": 20e-6, "housing": 20e-6, "pole": 25e-6}
    coarse = {("bodies", name, "mesh", "contact", "size"): size for name, size in sizes.items()}
    few = {("reduction", "modes", name, "count"): 4.0 for name in sizes}
    land = {("bodies", "needle", "mesh", "surfaces", "land"): 50e-6}

    advice = advise_stroke(applied(opening(), {**coarse, **few, **land}), error=0.02)

    names = [c.measured.setting.name for c in advice.counsels]
    assert names[0] == "contact of needle and housing and pole"
    assert names[-1] == "step of the network"
    assert {f"modes of {name}" for name in sizes} < set(names)
    assert all(np.isfinite(c.measured.ladder.raw_order) for c in advice.counsels)
    assert np.all(advice.then[:3] <= advice.now[:3] + 0.02)
    assert np.isnan(advice.up_to)
    for key, value in advice.changes.items():
        fewer = advice.finest[key] <= value
        assert advice.finest[key] == value or fewer == (key[0] != "reduction")
    assert advice.checked is not None
    present, advised = (float(np.max(item[:3])) for item in advice.checked)
    assert advised < present
    assert advised <= float(np.max(advice.then[:3]))
