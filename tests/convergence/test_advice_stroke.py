"""Advice for a whole valve: its step against a step eight times finer, and its check (convergence).

The demo stroke with coarse contacts and few modes, until its needle has opened.
"""

from pathlib import Path

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
from klack.case.any_case import load_valve_case, read_valve_case
from klack.case.reader import find_case
from klack.case.valve import ValveCase

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


PUSHED = """
klack: 1
title: A pushed needle beside a line of cells
network:
  fluid: n-heptane
  components:
    tank: {type: pressure-source, pressure: 20 bar}
    pipe:
      {type: line, length: 30 mm, diameter: 2 mm, pressure: 20 bar, properties: local, cells: 10}
    inlet: {type: chamber, volume: 100 mm^3, pressure: 20 bar}
    nozzle: {type: orifice, diameter: 0.4 mm}
    face: {type: pressure-face, direction: opening, outer_diameter: 4 mm}
    needle: {type: rigid-mass, mass: 3 g, points: [tip]}
    spring: {type: spring, stiffness: 10 N/mm, preload: 12 N}
    stop: {type: end-stop, gap: 60 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
  connections:
    - [tank.fluid, pipe.a]
    - [pipe.b, inlet.fluid, nozzle.a, face.fluid]
    - [nozzle.b, ambient]
    - [needle.tip, seat.upper, spring.end, face.body, stop.lower]
    - [seat.lower, ground]
    - [stop.upper, ground]
run: {duration: 0.3 ms, variants: [wet]}
"""


@pytest.mark.parametrize(("cells", "words"), [(10, "wet: h, h/2, h/4"), (4, "wet: 2h, h, h/2")])
def test_a_line_of_cells_bounds_the_step_that_is_tried(cells, words):
    """10 cells of 3 mm allow steps of 1.12 us, 4 cells of 2.81 us; two macro steps take 1.28 us."""
    text = PUSHED.replace("cells: 10", f"cells: {cells}")
    valve = build_valve(read_valve_case(text, Path("pushed.yaml")))

    found = step_ladder(valve, first_impacts(valve), stroke_measures(0.01))

    assert found.runs == words
    assert found.coarsest == 1.0 if cells == 10 else found.coarsest > 1.0
