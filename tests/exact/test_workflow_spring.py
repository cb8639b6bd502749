"""A closing spring between the start and first touch; truth = its work.

The spring pushes with its preload at first touch and harder above, so over a gap g it does the work
P g + k g^2 / 2.
"""

from math import sqrt

import pytest

from klack.analyses.impact.run import run_impact
from klack.case import find_case, read_case

GAP, PRELOAD, RATE, SPEED = 20e-6, 10.0, 1e6, 0.3


@pytest.mark.slow
def test_the_needle_arrives_with_the_work_of_the_spring():
    path = find_case("demo-valve-axisymmetric")
    text = path.read_text(encoding="utf-8")
    assert "gap: 0 um" in text
    assert "motion: {speed: 0.3 m/s}" in text
    text = text.replace("gap: 0 um", "gap: 20 um").replace(
        "motion: {speed: 0.3 m/s}",
        "motion: {speed: 0.3 m/s, spring: {stiffness: 1000 N/mm, preload: 10 N}}",
    )
    case = read_case(text, path)
    run = case.run.model_copy(update={"duration": 130e-6, "transfer": None})
    case = case.model_copy(update={"run": run})
    study = run_impact(case, levels=("reduced", "interface"), certify=False)

    mass = study.bodies[0].mass
    work = PRELOAD * GAP + 0.5 * RATE * GAP**2
    exact = sqrt(SPEED**2 + 2.0 * work / mass)
    assert exact > 1.4 * SPEED
    for level in study.levels.values():
        # weighted gaps close some ten nanometres late
        assert level.measures.approach_speed == pytest.approx(exact, rel=2e-3)
        assert abs(level.energy_residual) < 1e-6
