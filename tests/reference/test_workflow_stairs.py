"""Truth: Joukowsky and the echo of a line that is open at one end, against the shipped valve.

The theory is that of the tutorial, ``docs/tutorials/files/stairs.py``: it takes the speed of the
needle and the flow through the seat from the run, and the line from two lines of text.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.case.reader import find_case

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).parents[2] / "docs" / "tutorials" / "files" / "stairs.py"


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def study():
    return run_stroke(load_valve_case(find_case("stairs")))


@pytest.mark.parametrize("number", [0, 1], ids=["first impact", "second impact"])
def test_stairs_of_the_wet_needle_are_those_of_the_line(script, study, number):
    """Length 2 L / a and height A dp, both within 5 %; an edge lasts as long as the impact."""
    wet = study.variants["wet"]
    mass = next(body.mass for body in study.bodies if body.name == "needle")
    count = 3 if number == 0 else 2  # the next impact comes then
    edges, found = script["stairs"](wet, wet.impacts("seat")[number], count)
    echo = script["theory"]()[0]

    assert np.diff(edges) == pytest.approx([echo] * (count - 1), rel=0.05)
    computed = np.diff([stair.force for stair in found])
    expected = np.diff([stair.expected_force for stair in found])
    felt = mass * np.diff([stair.slope for stair in found])
    assert np.min(np.abs(expected)) > 5.0  # [N], of a spring force of 22 N
    assert computed == pytest.approx(expected, rel=0.05)
    assert felt == pytest.approx(expected, rel=0.05)


def test_the_dry_needle_has_no_stairs(script, study):
    """Spring and friction over mass; the spring changes by 1 % over the rebound."""
    dry = study.variants["dry"]
    mass = next(body.mass for body in study.bodies if body.name == "needle")

    slopes = script["slopes"](dry, dry.impacts("seat")[0], 3)

    assert slopes == pytest.approx([-22.0 / mass] * 3, rel=0.03)
