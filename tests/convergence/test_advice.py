"""Advice against finer runs.

The adviser's expected errors against runs far finer than those that it made.

A steel sphere falls on a short rod, both coarsely meshed and reduced.  Truth: the same impact with
one setting, or all of them, refined further.  An expected error is an extrapolation of two or three
runs: a factor of 2 is what it aims at, on the force history (measured: 0.6 to 2.1).  Errors are
added without sign, so their sum is a bound.

Advice for a whole valve: its step against a step eight times finer, and its check (convergence).

The demo stroke with coarse contacts and few modes, until its needle has opened.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.advice.advice import Advice, Counsel, settle
from klack.analyses.advice.impact import advise_impact
from klack.analyses.advice.ladder import score
from klack.analyses.advice.modes import (
    HISTORY,
    counted,
    impact_errors,
    impact_measures,
    interface_history,
)
from klack.analyses.advice.settings import applied
from klack.analyses.advice.stroke import advise_stroke, first_impacts, step_ladder, stroke_measures
from klack.assembling.modes import mode_pools
from klack.assembling.problem import ContactProblem, build_problem
from klack.assembling.reduced_pair import first_stiffness, impact_system, own_pair
from klack.assembling.valve import build_valve
from klack.case import find_case, read_case
from klack.case.any_case import load_valve_case, read_valve_case
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.contact.history import ImpactHistory
from klack.machine.progress import silent
from klack.simulation.impact import simulate_impact

pytestmark = pytest.mark.slow


TEXT = """
klack: 1
title: Sphere on a short rod, coarse
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  sphere:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          sphere:
            start: [0, 0]
            edges:
              - {arc: [2, 2], centre: [0, 2], name: tip}
              - {arc: [0, 4], centre: [0, 2], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 0.8 mm, grading: 0.4, contact: {size: 0.025 mm, extent: 0.2 mm}}
  rod:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          rod:
            start: [0, -10]
            edges:
              - {line: [4, -10], name: foot}
              - {line: [4, 0], name: side}
              - {line: [0, 0], name: end}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1.5 mm, grading: 0.4, contact: {size: 0.025 mm, extent: 0.2 mm}}
    fixed: [{surface: foot}]
contact: {between: [sphere.tip, rod.end], gap: 0 um, reach: 20 um}
motion: {speed: 0.5 m/s}
reduction:
  modes: {sphere: {count: 2}, rod: {count: 2}}
run: {levels: [reduced], duration: 25 us, reduced_step: 100 ns, interface_step: 100 ns}
"""

CONTACT, GROWTH = "contact of sphere and rod", "growth in sphere and rod"
SPHERE, ROD = "sphere, away from the contact", "rod, away from the contact"
STEP = "step, reduced level"
FINEST = {CONTACT: 1 / 4, GROWTH: 1 / 4, SPHERE: 1 / 8, ROD: 1 / 8}


@pytest.fixture(scope="module")
def case() -> Case:
    return read_case(TEXT, Path("sphere.yaml"))


@pytest.fixture(scope="module")
def advice(case: Case) -> Advice:
    return advise_impact(case)


@pytest.fixture(scope="module")
def finest(case: Case, advice: Advice) -> ImpactHistory:
    return reduced(refined(case, advice, FINEST))


def counsel(advice: Advice, name: str) -> Counsel:
    return next(item for item in advice.counsels if item.measured.setting.name == name)


def refined(case: Case, advice: Advice, factors: Mapping[str, float]) -> Case:
    for name, factor in factors.items():
        case = applied(case, counsel(advice, name).measured.setting.at(factor))
    return case


def prepared(case: Case, *, modes: int = 1):
    problem: ContactProblem = build_problem(case, silent)
    pools = mode_pools(problem, at_least=modes, progress=silent)
    return problem, pools, own_pair(problem, pools, stiffness=first_stiffness(problem))


def reduced(case: Case, *, step: float | None = None) -> ImpactHistory:
    problem, _, pair = prepared(case)
    problem.close()
    return simulate_impact(
        impact_system(case, pair.upper, pair.lower, pair.law),
        speed=case.motion.speed,
        duration=case.run.duration,
        step=step or case.run.reduced_step,
    )


def history_error(advice: Advice, truth: ImpactHistory, run: ImpactHistory) -> float:
    return float(impact_errors(truth, run, advice.up_to)[HISTORY])


@pytest.mark.parametrize("region", [CONTACT, GROWTH, ROD])
def test_expected_error_of_a_region_is_that_of_a_mesh_refined_further(case, advice, finest, region):
    coarse = reduced(refined(case, advice, {**FINEST, region: 1.0}))
    expected = counsel(advice, region).now[HISTORY]

    true = history_error(advice, finest, coarse)

    assert true > 1e-5
    assert 0.5 <= expected / true <= 2.5  # the rest that is extrapolated may not be there


def test_expected_error_of_a_region_that_scatters_is_an_upper_bound(case, advice, finest):
    """Three runs of the sphere away from its contact show the scatter of meshes, no order."""
    item = counsel(advice, SPHERE)
    coarse = reduced(refined(case, advice, {**FINEST, SPHERE: 1.0}))

    assert item.measured.ladder.scattered
    assert item.factor >= 1.0  # finer would not be better
    assert item.now[HISTORY] >= history_error(advice, finest, coarse)


@pytest.mark.parametrize("body", ["sphere", "rod"])
def test_expected_error_of_modes_is_that_against_forty_of_them(case, advice, body):
    problem, pools, pair = prepared(case, modes=40)
    every = {name: 40 for name in pools}
    kept = counted(case.reduction.choice(body), pools[body])

    def run(counts):
        return interface_history(problem, pools, pair.ports, counts, step=100e-9)

    true = history_error(advice, run(every), run({**every, body: kept}))
    problem.close()

    assert kept == 2
    assert 0.5 <= counsel(advice, f"modes of {body}").now[HISTORY] / true <= 2.0


def test_expected_error_of_the_step_is_that_against_a_thirtysecond_of_it(case, advice):
    item = counsel(advice, STEP)
    true = history_error(advice, reduced(case, step=100e-9 / 32), reduced(case))

    assert item.measured.ladder.raw_order == pytest.approx(2.0, abs=0.05)  # of the method
    assert item.now[HISTORY] == pytest.approx(true, rel=0.5)


def test_a_case_that_rubs_is_advised_with_its_friction(case):
    """In a cone.  Truth: its own levels, which are far apart where one of them has no friction."""
    cone = TEXT.replace("[4, 0], name: side", "[4, 3.172], name: side")
    cone = cone.replace("[0, 0], name: end", "[0, -0.828], name: end")
    case = read_case(cone, Path("cone.yaml"))
    rubbing = read_case(cone.replace("reach:", "friction: 0.2, reach:"), Path("cone.yaml"))
    told = advise_impact(rubbing, confirm=False)
    (pattern,) = told.fixed
    now = reduced(rubbing)
    lossless = history_error(told, now, reduced(case))

    assert lossless > 0.1
    assert pattern.errors[HISTORY] < 0.2 * lossless
    true = history_error(told, reduced(rubbing, step=100e-9 / 32), now)
    assert counsel(told, STEP).now[HISTORY] == pytest.approx(true, rel=0.5)


def test_the_advised_case_meets_the_target_against_the_finest_run(case, advice):
    problem, pools, pair = prepared(refined(case, advice, FINEST), modes=30)
    truth = interface_history(problem, pools, pair.ports, {"sphere": 30, "rod": 30}, step=12.5e-9)
    problem.close()
    measures = impact_measures(0.01, 1.0)
    advised = impact_errors(truth, reduced(applied(case, advice.changes)), advice.up_to)
    present = impact_errors(truth, reduced(case), advice.up_to)

    assert advice.changes
    assert score(advised, measures) <= 1.0
    assert np.all(advised[:4] <= 1.5 * advice.then[:4])  # the sum is a bound, but for the reference
    assert np.all(present[:4] <= 1.5 * advice.now[:4])


def test_a_loose_target_is_met_by_the_case_as_it_is(case, advice):
    loose = impact_measures(0.1, 10.0)
    told = Advice(
        case="",
        title="",
        level="reduced",
        measures=loose,
        up_to=advice.up_to,
        band_from_case=True,
        counsels=settle([item.measured for item in advice.counsels], advice.fixed, loose),
        fixed=advice.fixed,
    )

    assert told.is_good
    assert told.meets


def test_a_tighter_target_never_advises_a_coarser_setting(advice):
    measured = [item.measured for item in advice.counsels]
    before = None
    for error in np.geomspace(0.2, 1e-4, 60):
        settled = settle(measured, advice.fixed, impact_measures(float(error), 100.0 * error))
        factors = np.array([item.factor for item in settled])
        if before is not None:
            assert np.all(factors <= before * (1 + 1e-9))
        before = factors


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
