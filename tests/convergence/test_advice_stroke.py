"""Advice for a whole valve: its step against a step eight times finer (convergence)."""

import numpy as np
import pytest

from klack.advice.stroke import advise_stroke, first_impacts
from klack.case.shipped import find_case
from klack.case.valve_reader import load_valve_case
from klack.workflow.valve import build_valve

pytestmark = pytest.mark.slow


def test_step_of_a_stroke_and_its_settings():
    """Peak force of first impacts: the expected error of the step bounds that against h/8."""
    case = load_valve_case(find_case("demo-stroke"))
    case = case.model_copy(update={"run": case.run.model_copy(update={"duration": 0.4e-3})})
    valve = build_valve(case)
    fine, now = (first_impacts(valve, step=factor * case.run.step) for factor in (1 / 8, 1.0))
    true = max(abs(now[stop][1] / fine[stop][1] - 1.0) for stop in fine)

    advice = advise_stroke(case, error=0.02, confirm=False)

    step = next(c for c in advice.counsels if c.measured.setting.group == "step")
    assert list(fine) == ["opening"]  # the only stop within this time
    assert true <= step.now[1] <= 10.0 * true  # a bound: events come in whole steps, so it scatters
    names = [c.measured.setting.name for c in advice.counsels]
    assert names[0] == "contact of needle and housing and pole"
    assert names[-1] == "step of the network"
    assert {f"modes of {name}" for name in ("needle", "housing", "pole")} < set(names)
    assert np.all(advice.then[:3] <= advice.now[:3] + 0.02)
    assert np.isnan(advice.up_to)
