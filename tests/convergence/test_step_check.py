"""Changes of impacts when all steps are doubled.

Truth: errors against fine steps alone, extrapolated from three lengths; definition for the pairs.
"""

from dataclasses import fields, replace
from math import inf, isnan, nan, pi, sin, sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from draws import program

import klack
from klack.analyses.heat.run import run_heat
from klack.analyses.stroke import run as stroke_run
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.measures import steps_told
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.analyses.stroke.run import run_stroke
from klack.analyses.stroke.step_check import ImpactChange, checked_steps, impact_changes, told
from klack.app.explorer import Explorer
from klack.case.any_case import load_valve_case, read_valve_case
from klack.errors import InputError
from klack.machine.stages import trial
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.network.accuracy import PROMISED
from klack.network.network import Network
from klack.simulation.network_result import ImpactEvent, NetworkResult
from klack.simulation.network_run import Watch, simulate_network
from klack.simulation.step_sizes import StepSizes, scaled

ROOT = Path(__file__).parents[2]
HOW_TO = ROOT / "docs" / "how-to"
DRAWS = program("random_valves")


def impact(time: float, speed: float = 1.0, lasts: float = 5e-6, **more: float) -> ImpactEvent:
    """An impact on the seat of unit peak and impulse."""
    values = {field.name: 1.0 for field in fields(ImpactEvent)} | {
        "stop": "seat",
        "besides": "",
        "time": time,
        "approach_speed": speed,
        "peak_time": time + 0.5 * lasts,
        "contact_time": lasts,
        "separation_time": time + lasts,
    }
    return ImpactEvent(**values | more)


def test_an_impact_that_another_stop_disturbs_is_over_all_the_same():
    """Its restitution is blank for a reason; its impulse is complete."""
    disturbed = impact(1e-3, restitution=nan, energy_loss=nan)
    (change,) = impact_changes([impact(1e-3)], [replace(disturbed, besides="pole")])
    assert (change.peak_force, change.impulse, change.reason) == (0.0, 0.0, "")


def test_changes_are_those_of_the_longer_steps_to_the_shorter_ones():
    run = (impact(1e-3), impact(2e-3, speed=0.01), impact(3e-3, speed=0.5))
    other = (impact(1.0001e-3), impact(3e-3, speed=0.51, peak_force=0.9, impulse=1.2))

    first, slow, second = impact_changes(run, (other[0], other[1]))

    assert (first.number, slow.number, second.number) == (1, 0, 2)
    assert first.time == pytest.approx(1e-7, rel=1e-9, abs=0.0)
    assert "slower than 2 %" in slow.reason
    assert isnan(slow.peak_force)
    changes = (second.approach_speed, second.peak_force, second.impulse)
    assert changes == pytest.approx((0.02, -0.1, 0.2), rel=1e-9, abs=0.0)


@pytest.mark.parametrize(
    ("run", "other", "reasons"),
    [
        ([1e-3, 2e-3, 3e-3], [1e-3, 2e-3], ["", "", "missing with longer steps"]),
        ([1e-3, 3e-3], [1e-3, 2e-3, 3e-3], ["", "at another time with longer steps"]),
        (
            [1e-3, 1.004e-3],
            [1e-3],
            ["one impact in one run, several in the other", "an earlier impact"],
        ),
        ([1e-3], [1e-3, 1.004e-3], ["one impact in one run, several in the other"]),
        ([1e-3, 2e-3], [1.01e-3, 2e-3], ["at another time with longer steps", "an earlier impact"]),
    ],
    ids=["missing", "one more between", "split", "split by longer steps", "too far apart"],
)
def test_impacts_without_a_pair_have_a_reason_and_no_number(run, other, reasons):
    events, others = ([impact(time) for time in times] for times in (run, other))

    changes = impact_changes(events, others)

    for change, reason in zip(changes, reasons, strict=True):
        assert bool(reason) == isnan(change.peak_force) == bool(change.reason)
        assert reason in change.reason
    assert ("cannot be compared" in told(events, changes, "normal")) == any(reasons)


def test_an_impact_of_the_longer_steps_alone_is_told():
    assert "there is an impact 1 on 'seat'" in told([], (), "normal", [impact(1e-3)])
    seen = [impact(1e-3)]
    assert "there is an impact 2 on 'seat'" in told(
        seen, impact_changes(seen, seen), "normal", [*seen, impact(2e-3)]
    )


def test_impacts_later_than_what_is_asked_for_do_not_count():
    """Neither one that changes nor one that longer steps have alone."""
    end = np.array([5e-3])
    run: Any = SimpleNamespace(events=(impact(1e-3), impact(3e-3)), time=end)
    longer: Any = SimpleNamespace(events=(impact(1e-3), impact(3e-3, peak_force=0.9)), time=end)
    more: Any = SimpleNamespace(events=(*run.events, impact(4e-3)), time=end)

    for other in (longer, more):
        assert checked_steps(run, other, "normal", 0).doubt != ""
        early = checked_steps(run, other, "normal", 2, until=2e-3)
        assert [change.number for change in early.changes] == [1, 0]
        assert (early.doubt, early.certificate("normal")) == ("", (2, 0.0))
    assert checked_steps(run, longer, "normal", 0).certificate("normal")[1] == pytest.approx(200.0)
    assert checked_steps(run, more, "normal", 0).certificate("normal") == (0, inf)


def test_the_end_of_a_run_cuts_off_what_still_grows():
    (change,) = impact_changes([impact(1e-3)], [impact(1e-3, restitution=nan)])
    assert (change.peak_force, isnan(change.impulse), change.reason) == (0.0, True, "")

    rising = impact(1e-3, restitution=nan, peak_time=1.005e-3)
    (change,) = impact_changes([impact(1e-3)], [rising])
    assert isnan(change.peak_force)
    assert (change.time, change.reason) == (0.0, "not finished when the run ends")


@pytest.mark.parametrize(("end", "grows"), [(0.3, True), (0.95, True), (1.5, False)])
def test_the_end_of_a_run_before_the_peak_is_a_doubt(end, grows):
    """Truth: a mass on a linear stop presses hardest a quarter of a period after the touch.

    A run ends with a whole record, up to 1 us later: 2 % of the quarter.
    """
    mass, stiffness, gap, speed = 3e-2, 1e7, 50e-6, 0.5
    quarter = 0.5 * pi * sqrt(mass / stiffness)
    law = {"kind": "linear", "stiffness": stiffness}
    parts = {
        "needle": RigidMass(mass=mass, speed=speed, points=("tip",)),
        "stop": EndStop(gap=gap, law=law),
    }
    rows = Network(parts, (("needle.tip", "stop.lower"), ("stop.upper", "ground"))).rows()

    with trial() as caught:
        duration = gap / speed + end * quarter
        run = simulate_network(rows, duration=duration, step=20e-9, record=1e-6)

    (event,) = run.events
    reached = speed * sqrt(stiffness * mass) * sin(0.5 * pi * min(end, 1.0))
    assert (event.grows, event.peak_force) == (grows, pytest.approx(reached, rel=0.07))
    told = [str(item.message) for item in caught]
    assert [text.partition(",")[0] for text in told] == [
        "the run ends during impact 1 on 'stop'" for _ in range(grows)
    ]


@pytest.mark.parametrize("accuracy", ["normal", "fine"])
def test_more_than_half_of_the_promise_is_told_of_three_impacts(accuracy):
    peak, time = PROMISED[accuracy]
    for number, share, doubtful in ((1, 0.49, False), (3, 0.51, True), (4, 10.0, False)):
        for change in (
            ImpactChange(number=number, peak_force=-share * peak),
            ImpactChange(number=number, time=share * time),
        ):
            assert change.doubtful(accuracy) == doubtful


def dry(**run: Any) -> StrokeVariant:
    """Dry stroke of a rigid needle: three impacts and more on each stop."""
    case = load_valve_case(HOW_TO / "small_valve.yaml")
    changed = case.run.model_copy(update={"check_steps": True} | run)
    return run_stroke(case.model_copy(update={"run": changed}), variants=("dry",)).reference


@pytest.fixture(scope="module")
def truth() -> list[tuple[float, float]]:
    """Time and peak force of each impact, extrapolated from fine steps alone.

    What halves from one length to the next vanishes.  Of the first three impacts on each stop, the
    faster ones, the two extrapolations are within 0.001 us and 0.001 %.
    """
    three = [dry(check_steps=False, coarse=1, step=h).result.events for h in (1e-8, 5e-9, 2.5e-9)]
    found = []
    for a, b, c in zip(*three, strict=True):
        before, last = (
            (2.0 * y.time - x.time, 2.0 * y.peak_force - x.peak_force) for x, y in ((a, b), (b, c))
        )
        if b.approach_speed > 0.2:
            assert last == pytest.approx(before, abs=1e-9, rel=1e-5)
        found.append(last)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("run", [{}, {"accuracy": "fine", "step": None}], ids=["normal", "fine"])
def test_changes_cover_the_error(run, truth):
    variant = dry(**run)

    counted = [
        (event, change, true)
        for event, change, true in zip(variant.result.events, variant.changes, truth, strict=True)
        if change.promised
    ]
    assert len(counted) == 6
    for event, change, (time, peak) in counted:
        # a touch is located to an eighth of a step of 20 ns
        assert abs(event.time - time) < abs(change.time) + 2.5e-9
        # and a peak falls between two of them: 1.8e-5 where the change is 3e-6, promised are 1e-4
        assert abs(event.peak_force / peak - 1.0) < abs(change.peak_force) + 2e-5


@pytest.mark.slow
def test_steps_that_are_too_long_are_halved_until_impacts_are_right(truth):
    """Steps of 100 ns are off in all six impacts; in an eighth of it by a 64th (second order)."""
    long, checked = dry(step=1e-7, check_steps=False), dry(step=1e-7)
    off = {
        variant.halvings: [
            change.number
            for event, change, (time, peak) in zip(
                variant.result.events, checked.changes, truth, strict=True
            )
            if change.promised
            and (abs(event.peak_force / peak - 1.0) > 5e-4 or abs(event.time - time) > 5e-8)
        ]
        for variant in (long, checked)
    }

    assert len(off[0]) == 6
    assert off[checked.halvings] == []
    assert checked.result.sizes == replace(
        long.result.sizes, step=long.result.sizes.step / 2**checked.halvings
    )
    assert told(checked.result.events, checked.changes, "normal") == ""


@pytest.mark.slow
def test_points_of_a_study_are_computed_in_steps_that_are_short_enough(truth):
    """Unasked, for the impacts that their measures are of; as they are where the case says so."""
    names = ["opening.1.peak_force", "opening.2.peak_force"]
    case = klack.load_case(HOW_TO / "small_valve.yaml").with_value("run.step", "100 ns")
    peaks = [peak for _, peak in truth[:2]]

    found = klack.run_many(case, [{}], names, variant="dry")
    plain = klack.run_many(case.with_value("run.check_steps", False), [{}], names, variant="dry")

    off = [
        [abs(t[name][0] / peak - 1.0) for name, peak in zip(names, peaks, strict=True)]
        for t in (found, plain)
    ]
    assert max(off[0]) < 5e-4 < min(off[1])
    assert found["halvings"][0] > 0.0
    assert 0.0 < found["step_change"][0] <= 0.5
    assert plain["halvings"][0] == 0.0
    assert isnan(plain["step_change"][0])


@pytest.mark.slow
def test_sliders_take_the_steps_that_the_stroke_of_the_case_requires(truth):
    """Truth: fine steps alone; a preload that makes impacts faster, and so depend on them more."""
    path = HOW_TO / "small_valve.yaml"
    text = path.read_text().replace("step: 20 ns", "step: 100 ns")

    def first_peak(text: str) -> float:
        opened = Explorer().open(text, str(path))
        return next(n.value for n in opened.first.numbers if n.key == "peak_opening")

    unchecked = first_peak(text.replace("step: 100 ns", "step: 100 ns, check_steps: false"))
    peak = truth[0][1]
    assert abs(first_peak(text) / peak - 1.0) < 5e-4 < abs(unchecked / peak - 1.0)


def test_sliders_say_where_their_steps_are_too_long():
    """Far from the case: shorter steps, which klack stroke takes there, have no doubt."""
    path = HOW_TO / "small_valve.yaml"
    text = path.read_text().replace("duration: 2 ms, step: 20 ns", "duration: 300 us, step: 40 ns")
    explorer = Explorer()
    explorer.open(text, str(path))
    heavy = {"network.components.spring.preload": 0.5, "network.components.opening.gap": 4e-4}

    here, there = explorer.judge({}), explorer.judge(heavy)

    assert (here.grade, "The time steps are short enough." in here.words) == ("none", True)
    assert (there.grade, "too long for this valve" in there.words) == ("out", True)


@pytest.mark.slow
def test_derivatives_are_those_of_strokes_in_steps_that_are_short_enough(truth):
    """Unasked, as of a single stroke: the values are those of the truth."""
    names = ["opening.peak_force", "opening.2.peak_force"]
    case = klack.load_case(HOW_TO / "small_valve.yaml")
    key = "network.components.spring.preload"

    def off(**run: Any) -> float:
        changed = case
        for name, value in {"step": "100 ns", **run}.items():
            changed = changed.with_value(f"run.{name}", value)
        found = klack.sensitivities(changed, parameters=[key], measures=names, variant="dry")
        pairs = zip(found.measures, truth, strict=False)
        return max(abs((one.value or 0.0) / peak - 1.0) for one, (_, peak) in pairs)

    assert off() < 5e-4 < off(check_steps=False)


def test_a_warm_up_takes_the_steps_that_its_stroke_requires():
    """Truth: the same in steps that need not be halved (0.02 %, promised 0.05 %)."""
    case = load_valve_case(ROOT / "cases" / "warm-valve" / "case.yaml")

    def soaked(**changes: Any) -> dict[str, Any]:
        run = case.run.model_copy(update=changes)
        found = run_heat(case.model_copy(update={"run": run}), soak=[353.15])
        return {column.name: column.values[0] for column in found.numbers}

    fine, checked, plain = soaked(), soaked(step=4e-7), soaked(step=4e-7, check_steps=False)
    peaks = ["first peak at the stop", "first peak at the seat"]
    assert all(checked[name] == pytest.approx(fine[name], rel=5e-5) for name in peaks)
    assert any(abs(plain[name] / fine[name] - 1.0) > 1e-4 for name in peaks)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "measures", "shorter"),
    [
        ("20 ns", ("opening_time", "opening.1.peak_force"), True),  # all that counts is over soon
        ("20 ns", ("energy_residual",), False),  # of the whole run
        ("100 ns", ("energy_residual", "seat.3.peak_force"), True),  # one impact is off: halve
    ],
)
def test_a_comparison_ends_where_no_more_of_it_is_needed(monkeypatch, step, measures, shorter):
    """Truth: whole comparisons, which choose the same steps, so the same bits."""
    case = klack.load_case(HOW_TO / "small_valve.yaml").with_value("run.step", step)
    ends = []

    def recorded(*given: Any, **named: Any) -> Any:
        found = attempt(*given, **named)
        ends.append(float(found.result.time[-1]))
        return found

    attempt = stroke_run._attempt
    monkeypatch.setattr(stroke_run, "_attempt", recorded)
    table = klack.run_many(case, [{}], measures, variant="dry", threads=1)
    computed = ends.copy()
    monkeypatch.setattr(stroke_run, "watched", lambda *given: None)
    whole = klack.run_many(case, [{}], measures, variant="dry", threads=1)

    assert (min(computed) < 0.8 * max(computed)) == shorter
    assert len(computed) == len(ends) - len(computed)
    for name in (*measures, "halvings", "step_change"):
        assert table[name].tolist() == whole[name].tolist()


def test_a_run_that_is_watched_is_the_begin_of_the_whole_one():
    """To the last bit; it ends at the look behind the time at which enough is known."""
    case = load_valve_case(HOW_TO / "small_valve.yaml")
    rows = case.network.network().dry().rows()
    times = (1e-4, 4e-4)

    def stroke(watch: Watch | None) -> NetworkResult:
        return simulate_network(rows, duration=6e-4, watch=watch)

    whole = stroke(None)
    part = stroke(Watch(times, lambda now, settled: now > 3e-4))

    count = len(part.time)
    assert times[1] <= part.time[-1] < times[1] + 2.0 * (part.time[1] - part.time[0])
    assert list(part.time) == list(whole.time[:count])
    for name, channel in part.channels.items():
        np.testing.assert_array_equal(channel.values, whole.channels[name].values[:count])


@pytest.mark.slow
def test_steps_in_three_dimensions_are_halved_where_that_is_asked_for():
    """Steps of 320 ns miss 0.2 % of the peak; truth: 10 and 5 ns, extrapolated, 0.002 % apart."""
    case = load_valve_case(HOW_TO / "half_section_stroke.yaml")

    def stroke(**changes: Any) -> StrokeVariant:
        run = case.run.model_copy(update={"duration": 1.75e-4, **changes})
        return run_stroke(case.model_copy(update={"run": run})).reference

    one, half = (stroke(step=h, check_steps=False).result.events[0] for h in (1e-8, 5e-9))
    long, checked = (stroke(step=3.2e-7, check_steps=asked) for asked in (None, True))
    peak, time = (2.0 * getattr(half, k) - getattr(one, k) for k in ("peak_force", "time"))

    assert half.peak_force == pytest.approx(one.peak_force, rel=2e-5)
    off = [abs(v.result.events[0].peak_force / peak - 1.0) for v in (long, checked)]
    assert off[1] < 5e-4 < off[0]
    assert abs(checked.result.events[0].time - time) < 5e-8
    assert (long.halvings, checked.halvings > 0) == (0, True)
    assert told(long.result.events, long.changes, "normal") != ""


@pytest.mark.slow
def test_short_runs_are_halved_on(tmp_path):
    """A damped wet stop: 1 % after one halving, 0.2 % after three, promised 0.05 %, no less.

    Truth: fine steps alone, extrapolated over two lengths, which differ by 0.015 % from those of
    twice these lengths.
    """
    case = read_valve_case(DRAWS["draw"](38), tmp_path / "valve.yaml")

    def wet(**changes: Any) -> StrokeVariant:
        run = case.run.model_copy(update={"duration": 1.1e-4, **changes})
        return run_stroke(case.model_copy(update={"run": run}), variants=("wet",)).reference

    one, half = (wet(step=h, coarse=1, check_steps=False).result.events for h in (5e-9, 2.5e-9))
    checked = wet()

    assert checked.halvings > 3
    assert len(checked.result.events) == len(half) == 3
    for event, long, short in zip(checked.result.events, one, half, strict=True):
        assert event.peak_force == pytest.approx(2.0 * short.peak_force - long.peak_force, rel=5e-4)
        assert event.time == pytest.approx(2.0 * short.time - long.time, abs=5e-8, rel=0.0)


@pytest.mark.slow
def test_steps_that_are_short_enough_stay_as_they_are():
    """The run is that without a check, to the last bit."""
    plain, checked = dry(step=1e-8, check_steps=False), dry(step=1e-8, check_steps=None)

    assert checked.halvings == 0
    assert repr(checked.result.events) == repr(plain.result.events)  # nan is not itself
    assert len(checked.changes) == len(plain.result.events)
    assert plain.changes == ()


@pytest.mark.slow
def test_changes_vanish_with_the_square_of_the_step():
    """Errors of rebounds are of second order; later impacts add them up as lateness."""
    runs = {h: dry(step=h, coarse=1, check_steps=False) for h in (4e-7, 2e-7, 1e-7, 5e-8)}
    late = {
        step: {
            event.stop: change.time
            for event, change in zip(
                run.result.events,
                impact_changes(run.result.events, runs[2.0 * step].result.events),
                strict=True,
            )
            if change.number == 3
        }
        for step, run in runs.items()
        if step < 4e-7
    }
    for longer, shorter in ((2e-7, 1e-7), (1e-7, 5e-8)):
        for stop in ("opening", "seat"):
            # touches are located to an eighth of a step: 6 ns of 56, the third power adds 5 %
            assert late[longer][stop] / late[shorter][stop] == pytest.approx(4.0, rel=0.15)


@pytest.mark.slow
def test_a_stroke_tells_its_changes_after_storing(tmp_path):
    text = (HOW_TO / "small_valve.yaml").read_text().replace("duration: 2 ms", "duration: 300 us")
    text = text.replace("step: 20 ns", "step: 3.2 us, check_steps: true")
    made = run_stroke(read_valve_case(text, tmp_path / "valve.yaml"), variants=("dry",))
    STROKE.save(made, tmp_path)
    loaded = STROKE.load(tmp_path)

    (change,) = made.reference.changes
    assert loaded.reference.changes == made.reference.changes
    assert loaded.reference.halvings == made.reference.halvings == 6
    assert "50 ns; halved because impacts depended on them: 6 times" in steps_told(loaded.reference)
    (event,) = STROKE.to_json(loaded)["events"]
    assert event["doubled_steps"]["peak_force_change"] == change.peak_force
    assert event["doubled_steps"]["promised"]
    assert any("impact 1 on 'opening' changes by" in line for line in made.warnings)
    without = replace(loaded.reference, changes=())
    plain = replace(loaded, variants={"dry": without})
    assert STROKE.to_json(plain)["events"][0]["doubled_steps"] is None


def test_an_exchange_that_would_no_longer_hold_whole_steps_is_refused():
    row = SimpleNamespace(interval=30e-6)
    rows: Any = SimpleNamespace(elements=[row], controllers=[])
    sizes = StepSizes(step=20e-9, coarse=50, near=25, middle=5)

    assert scaled(rows, sizes, 2.0) == replace(sizes, step=40e-9, middle=1)
    assert scaled(rows, sizes, 0.5) == replace(sizes, step=10e-9)
    row.interval = 31e-6
    with pytest.raises(InputError, match="exchange every 31 us"):
        scaled(rows, sizes, 2.0)
    row.interval = 30.5e-6  # between steps already
    assert scaled(rows, sizes, 2.0).step == 40e-9


@pytest.mark.slow
def test_a_continued_run_has_a_reason_and_no_number_and_keeps_the_steps():
    """Two runs are one run in the same steps, to the last bit."""
    case = load_valve_case(HOW_TO / "small_valve.yaml")

    def run(duration: float, after: StrokeStudy | None = None, **changes: Any) -> StrokeStudy:
        changed = case.run.model_copy(update={"duration": duration, "step": 1e-7, **changes})
        return run_stroke(case.model_copy(update={"run": changed}), variants=("dry",), after=after)

    first = run(3e-4)
    after = run(3e-4, after=first)

    assert first.reference.halvings > 0
    assert {change.reason for change in after.reference.changes} == {"no other run"}
    assert all(isnan(change.time) for change in after.reference.changes)
    (note,) = after.warnings
    assert "the time steps were not checked: the run continues another run" in note
    step = first.reference.result.sizes.step
    whole = run(6e-4, step=step, coarse=first.reference.result.sizes.coarse, check_steps=False)
    assert after.reference.result.sizes.step == step
    events, last = after.reference.result.events, whole.reference.result.events
    assert repr(events) == repr(last[-len(events) :])  # nan is not itself
