"""Many strokes; truth = the single stroke from the same position, and the same strokes again."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from shots_valve import valve_case

import klack.analyses.stroke_shots.one_stroke as one_stroke
from klack.analyses.stroke.run import one_variant
from klack.analyses.stroke_shots.analysis import STROKE_SHOTS
from klack.analyses.stroke_shots.one_stroke import (
    CENTRED,
    STROKE_LOG,
    Starts,
    StrokeTask,
    rebound_height,
    run_one_stroke,
    strokes_mark,
)
from klack.analyses.stroke_shots.record import StopColumns, StrokeColumns
from klack.analyses.stroke_shots.run import compute_strokes, run_stroke_shots, stroke_setup
from klack.assembling.spatial import placement_of
from klack.assembling.valve import build_valve
from klack.case.valve_roles import find_roles
from klack.errors import ConvergenceError
from klack.machine.progress import silent
from klack.mesh.rigid import rigid_placement
from klack.simulation.spatial_impact import SpatialPath

pytestmark = pytest.mark.slow

CASE = valve_case()


@pytest.fixture(scope="module")
def valve():
    return build_valve(CASE, threads=1)


@pytest.fixture(scope="module")
def setup(valve):
    return stroke_setup(valve, find_roles(CASE))


@pytest.fixture(scope="module")
def starts(valve):
    return Starts.of(valve, "needle", 1)


@pytest.fixture(scope="module")
def alone(setup, starts):
    """The centred stroke and three others one by one, in this process."""
    begun = [starts.centred(), *(starts.drawn(index) for index in range(3))]
    return [run_one_stroke(setup, StrokeTask(variant="dry", start=start)) for start in begun]


def same(columns, outcomes, numbers) -> None:
    """Columns of a study have these numbers, to the last bit."""
    for item in fields(columns):
        found = getattr(columns, item.name)
        np.testing.assert_array_equal(found, [numbers(one)[item.name] for one in outcomes])


def test_a_stroke_is_that_of_the_same_placement(valve, starts, alone):
    """Truth: the valve run by itself with the placement that its case would give."""
    start, outcome = starts.drawn(1), alone[2]
    numbers = outcome.stroke
    angles = {key: float(np.degrees(numbers[key])) for key in ("direction", "tilt_direction")}
    text = (
        f"placement: {{eccentricity: {numbers['eccentricity']} m, direction: {angles['direction']}"
        f" deg, tilt: {numbers['tilt']} rad, tilt_direction: {angles['tilt_direction']} deg}}"
    )
    given = placement_of(valve_case(text), starts.height)
    about = np.array([0.0, 0.0, starts.height])
    placement = rigid_placement(*given, about, starts.centre)
    assert placement == pytest.approx(start.placement, rel=1e-9, abs=1e-18)

    spatial = replace(valve.spatial, placement=placement)
    run = one_variant(replace(valve, spatial=spatial), find_roles(CASE), "dry", silent, check=False)
    first = run.variant.impacts("opening")[0]
    # round-off of the placement grows about a thousandfold until the end of an impact
    for key in ("peak_force", "contact_time", "impulse", "restitution", "approach_speed"):
        assert outcome.stops["opening"][key] == pytest.approx(getattr(first, key), rel=1e-6)
    assert numbers["opening_time"] == pytest.approx(first.time, rel=1e-9)
    # the axis at the seat is that of the recorded channels, straight between records of 1 us
    result, touch = run.variant.result, run.variant.impacts("seat")[0].time
    x, y = (
        float(np.interp(touch, result.time, result.channels[f"needle {name}"].values))
        for name in ("x", "y")
    )
    at = outcome.stops["seat"]
    found = at["eccentricity"] * np.array([np.cos(at["direction"]), np.sin(at["direction"])])
    assert found == pytest.approx([x, y], abs=2e-9)


def test_placements_decide_where_the_needle_touches(alone):
    centred, *others = alone
    for stop in ("seat", "opening"):
        assert centred.stops[stop]["eccentricity"] < 1e-11
        found = [outcome.stops[stop]["eccentricity"] for outcome in others]
        # at most what guide and height allow, and a little penetration of the bore
        assert all(1e-8 < off < 12e-6 for off in found)
        assert len(set(found)) == 3
    # a guide without Coulomb friction, which a centred needle does not touch
    assert centred.stroke["guide_loss"] == 0.0
    assert others[1].stroke["guide_loss"] > 0.0
    assert others[1].stops["opening"]["peak_force"] != centred.stops["opening"]["peak_force"]


def test_two_strokes_tell_how_far_impacts_depend_on_the_steps(setup, starts, alone):
    """The centred and the first one, as klack stroke does; in steps of 1 us they are off."""
    case = setup.valve.case
    run = case.run.model_copy(update={"step": 1e-6, "duration": 0.5 * case.run.duration})
    coarse = replace(setup, valve=replace(setup.valve, case=case.model_copy(update={"run": run})))
    begun = [starts.centred(), starts.drawn(0), starts.drawn(1)]
    found = [run_one_stroke(coarse, StrokeTask(variant="dry", start=start)) for start in begun]
    told = ["all time steps twice as long" in " ".join(one.doubts) for one in found]
    assert told == [True, True, False]


def test_strokes_keep_the_energy_balance(alone):
    for outcome in alone:
        assert abs(outcome.stroke["energy_residual"]) < 1e-9
        assert np.isnan(outcome.stroke["faces_loss"])  # faces without friction
        assert outcome.stroke["injected_energy"] > 0.0
        assert np.isnan(outcome.stroke["radiated_energy"])  # no section noise
        assert np.isnan(outcome.stroke["delivered_mass"])  # dry
        assert not outcome.failure


def test_friction_of_the_guide_is_that_of_the_draw(setup, starts):
    start = starts.drawn(1)
    smooth, rough = (
        run_one_stroke(setup, StrokeTask(variant="dry", start=replace(start, friction=mu)))
        for mu in (0.05, 0.2)
    )
    assert smooth.stroke["friction"] == 0.05
    # the side force is the same at first, and friction turns the needle besides
    assert 1.5 < rough.stroke["guide_loss"] / smooth.stroke["guide_loss"] < 8.0


def test_drawn_friction_of_the_faces_is_that_of_the_stops(starts):
    """Truth: the same stroke of a case whose stops have that coefficient."""
    drawn = valve_case("shots: {count: 3, contact_friction: {uniform: [0.1, 0.3]}}")
    rubs = {n: stop.model_copy(update={"friction": 0.2}) for n, stop in CASE.stops.items()}
    given = CASE.model_copy(update={"stops": rubs})
    start = starts.drawn(1)
    found = [
        run_one_stroke(
            stroke_setup(build_valve(case, threads=1), find_roles(case)),
            StrokeTask(variant="dry", start=replace(start, contact_friction=mu)),
        )
        for case, mu in ((drawn, 0.2), (given, np.nan))
    ]

    assert found[0].stops["opening"] == pytest.approx(found[1].stops["opening"], nan_ok=True)
    for outcome in found:
        assert outcome.stroke["faces_loss"] > 1e-3 * outcome.stroke["impact_loss"]
        assert abs(outcome.stroke["energy_residual"]) < 1e-9
    assert found[0].stroke["contact_friction"] == 0.2


def test_the_rebound_height_is_that_of_a_throw():
    """Up with v under g: v^2/2g after v/g; recorded every 10 us, between which cubics run."""
    v, g, first = 0.5, 5e3, 1e-4
    path = SpatialPath()
    for t in np.linspace(0.0, 4e-4, 41):
        place, speed = np.zeros(6), np.zeros(6)
        up = t - first
        place[2], speed[2] = (v * up - 0.5 * g * up**2, v - g * up) if up > 0 else (-v * up, -v)
        path.add(t, place, speed, np.zeros((1, 2)))

    def event(time, stop="seat", restitution=0.9):
        return SimpleNamespace(time=time, stop=stop, restitution=restitution)

    hit = event(first)
    assert rebound_height([hit], hit, path, 1.0) == pytest.approx(v**2 / (2 * g), rel=1e-9)
    # touched before the top: no turn; still rising at the end of the record: none yet
    stopped = [hit, event(first + 0.5 * v / g, "opening")]
    assert np.isnan(rebound_height(stopped, hit, path, 1.0))
    short = SpatialPath()
    for t, z, w in zip(path.time[:16], path.position[:16], path.velocity[:16], strict=True):
        short.add(t, z, w, np.zeros((1, 2)))
    assert np.isnan(rebound_height([hit], hit, short, 1.0))
    # a needle that comes to rest has no rebound
    still = SpatialPath()
    for t in path.time:
        still.add(t, np.zeros(6), np.zeros(6), np.zeros((1, 2)))
    rest = event(first, restitution=0.0)
    assert rebound_height([rest], rest, still, 1.0) == 0.0
    assert np.isnan(rebound_height([rest], event(first), still, 1.0))


def test_a_log_keeps_every_bit(tmp_path, alone):
    mark = strokes_mark(CASE, 1, None)
    with STROKE_LOG.open(tmp_path, mark) as log:
        for outcome in alone:
            log.add((outcome.variant, outcome.index), outcome)
    with STROKE_LOG.open(tmp_path, mark) as log:
        assert set(log.done) == {("dry", index) for index in (CENTRED, 0, 1, 2)}
        for outcome in alone:
            back = log.done["dry", outcome.index]
            assert np.array_equal(list(back.stroke.values()), list(outcome.stroke.values()), True)
            np.testing.assert_array_equal(back.lift, outcome.lift)
            np.testing.assert_array_equal(back.end, outcome.end)
    assert strokes_mark(CASE, 2, None) != mark
    changed = CASE.model_copy(update={"run": CASE.run.model_copy(update={"duration": 1e-3})})
    assert strokes_mark(changed, 1, None) != mark


class Told:
    """Keeps the lines of a progress report."""

    def __init__(self):
        self.lines = []

    def __call__(self, stage, fraction):
        assert stage == "strokes"
        assert 0.0 <= fraction <= 1.0

    def remark(self, line):
        self.lines.append(line)


def test_a_row_starts_where_it_has_ended(setup, starts):
    """Truth: the end of each stroke, and the draw that independent ones would have."""
    case = valve_case("shots: {count: 3, carry: true}")
    valve = replace(setup.valve, case=case)
    log, told = STROKE_LOG.open(None, ""), Told()
    compute_strokes(
        replace(setup, valve=valve), replace(starts, case=case), ("dry",), 3, 1, log, told
    )
    assert [line.partition(",")[0] for line in told.lines] == [
        "centred stroke (dry): 1 of 4",
        *(f"stroke {k} (dry): {k + 2} of 4" for k in range(3)),
    ]
    assert all(" s each" in line for line in told.lines)
    assert [line.endswith(" left") for line in told.lines] == [True, True, True, False]
    for index in (1, 2):
        end, row = log.done["dry", index - 1].end, log.done["dry", index].stroke
        lean = np.array([end[4], -end[3]])
        aside = end[:2] + (starts.height - starts.centre[2]) * lean
        assert row["eccentricity"] == pytest.approx(np.hypot(*aside), rel=1e-9)
        assert row["tilt"] == pytest.approx(np.hypot(*lean), rel=1e-9)
        assert row["eccentricity"] != pytest.approx(np.hypot(*starts.drawn(index).aside), rel=1e-3)
    # the first one is the drawn one, and none of them has come to rest in so short a time
    first = log.done["dry", 0]
    assert first.stroke["eccentricity"] == np.hypot(*starts.drawn(0).aside)
    assert any("not at rest on its seat" in doubt for doubt in first.doubts)
    assert not any("at rest" in doubt for doubt in log.done["dry", CENTRED].doubts)


def test_a_failed_stroke_costs_its_row_alone(setup, starts, monkeypatch):
    real = one_stroke.one_variant

    def failing(valve, *args, **more):
        if np.array_equal(valve.spatial.placement, starts.drawn(0).placement):
            raise ConvergenceError("needle: no contact forces found.\nTry: a shorter step.")
        return real(valve, *args, **more)

    monkeypatch.setattr(one_stroke, "one_variant", failing)
    log = STROKE_LOG.open(None, "")
    compute_strokes(setup, starts, ("dry",), 1, 1, log, silent)

    assert not log.done["dry", CENTRED].failure
    lost = log.done["dry", 0]
    assert lost.failure == "needle: no contact forces found. Try: a shorter step."
    assert np.isnan(lost.stroke["impacts"])
    assert lost.stroke["eccentricity"] == np.hypot(*starts.drawn(0).aside)
    row = replace(starts, case=valve_case("shots: {carry: true}"))
    with pytest.raises(ConvergenceError, match=r"stroke 0 \(dry\): needle"):
        compute_strokes(setup, row, ("dry",), 2, 1, log, silent)


def test_an_interrupted_study_goes_on_with_the_same_numbers(tmp_path, alone):
    """Bodies are built anew: their bits are the same, too."""

    def stop(stage: str, fraction: float) -> None:
        if stage == "strokes" and fraction >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_stroke_shots(CASE, workers=1, folder=tmp_path, progress=stop, threads=1)
    assert STROKE_LOG.count(tmp_path) == 2
    study = run_stroke_shots(CASE, workers=1, folder=tmp_path, threads=1)

    assert study.resumed == 2
    assert study.schematic.startswith("<svg")
    shots = study.variants["dry"]
    same(shots.strokes, alone[1:], lambda outcome: outcome.stroke)
    same(shots.centric, alone[:1], lambda outcome: outcome.stroke)
    for stop_name in ("seat", "opening"):
        same(shots.stops[stop_name], alone[1:], lambda outcome: outcome.stops[stop_name])  # noqa: B023
    for i, outcome in enumerate(alone[1:]):
        np.testing.assert_array_equal(shots.lift[i], outcome.lift)
    # and what is stored comes back
    STROKE_SHOTS.save(study, tmp_path)
    back = STROKE_SHOTS.load(tmp_path)
    assert isinstance(back.variants["dry"].strokes, StrokeColumns)
    assert isinstance(back.variants["dry"].stops["seat"], StopColumns)
    same(back.variants["dry"].strokes, alone[1:], lambda outcome: outcome.stroke)


def test_two_processes_give_the_same_numbers(setup, starts, alone):
    log = STROKE_LOG.open(None, "")
    compute_strokes(setup, starts, ("dry",), 3, 2, log, silent)

    for outcome in alone:
        found = log.done["dry", outcome.index]
        assert np.array_equal(list(found.stroke.values()), list(outcome.stroke.values()), True)
        assert found.stops.keys() == outcome.stops.keys()
        for stop, numbers in outcome.stops.items():
            one, other = list(found.stops[stop].values()), list(numbers.values())
            assert np.array_equal(one, other, equal_nan=True)
        np.testing.assert_array_equal(found.lift, outcome.lift)
