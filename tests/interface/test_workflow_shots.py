"""Many shots; truth = a ball thrown upwards, energy, and the same shots computed otherwise."""

import warnings
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from energy_ledger import allowed
from same_shots import ROUND_OFF, columns_of, same

from klack.analyses.impact.interface_level import build_guide, build_interface
from klack.analyses.shots import checked_step, one_shot
from klack.analyses.shots.analysis import (
    DISTRIBUTION_COLUMNS,
    SHOTS,
    distribution_rows,
)
from klack.analyses.shots.checked_step import (
    PROMISED,
    CheckedStep,
    in_checked_steps,
    step_doubt,
)
from klack.analyses.shots.draw import centric_draw, draw_shot
from klack.analyses.shots.model import build_shots
from klack.analyses.shots.one_shot import (
    SHOT_LOG,
    run_shot,
    shot_log,
    shots_mark,
    simulate_shot,
)
from klack.analyses.shots.record import FIRST_IMPACT, ShotColumns
from klack.analyses.shots.run import DroppedShots, judge_rule, run_shots, run_shots_on, shot_doubts
from klack.analyses.store import stored_format
from klack.api import Result
from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.case import load_case
from klack.case.guide import Placement
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.machine.progress import silent
from klack.transient.interface_kernel import march

pytestmark = pytest.mark.slow

CASE = load_case(Path(__file__).parents[2] / "docs" / "how-to" / "guided_needle.yaml")


@pytest.fixture(scope="module")
def model():
    return build_shots(CASE, silent, threads=1)


@pytest.fixture(scope="module")
def draws(model):
    return [draw_shot(CASE, 1, index, model.touch_height) for index in range(4)]


@pytest.fixture(scope="module")
def centred(model):
    return run_shot(model.setup, centric_draw(CASE))


@pytest.fixture(scope="module")
def alone(model, draws):
    """The shots one by one, in this process."""
    return [run_shot(model.setup, draw) for draw in draws]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study that was interrupted after two shots and went on."""
    folder = tmp_path_factory.mktemp("shots")

    def stop(stage: str, fraction: float) -> None:
        if stage == "shots" and fraction >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_shots(CASE, count=4, workers=1, folder=folder, progress=stop, threads=1)
    assert SHOT_LOG.count(folder) == 2
    done = run_shots(CASE, count=4, workers=1, folder=folder, threads=1)
    SHOT_LOG.remove(folder)
    assert not (folder / SHOT_LOG.file).exists()
    return done


def test_a_step_that_is_too_long_is_halved_until_shots_do_not_depend_on_it(model, draws):
    """Truth: steps of 12.5 ns, to what is promised; in 250 ns the peak is 0.14 % off."""
    pair = (centric_draw(CASE), draws[0])
    with allowed("simulate_interface", 1e-2):  # the guide in 500 ns
        found = in_checked_steps(replace(model.setup, step=250e-9), pair, silent)

    assert found.halvings >= 1
    assert found.setup.step == pytest.approx(250e-9 / 2**found.halvings, abs=0.0)
    assert found.doubt == ""
    for outcome, draw in zip(found.outcomes, pair, strict=True):
        truth = run_shot(replace(model.setup, step=12.5e-9), draw).numbers
        for key, promised in PROMISED.items():
            assert outcome.numbers[key] == pytest.approx(truth[key], rel=promised, abs=0.0)


def test_a_step_that_is_short_enough_stays_and_its_shots_are_used(model, draws, centred, alone):
    """Twice as long: a change below half of the promise."""
    found = in_checked_steps(model.setup, (centric_draw(CASE), draws[0]), silent)

    assert found.setup is model.setup
    assert 0.0 < found.change < 0.5
    same(columns_of(found.outcomes), columns_of([centred, alone[0]]))


def test_shots_that_depend_on_any_step_are_told(model, draws, monkeypatch):
    """Peaks of first order never converge here; times alone that do not fall end it at once."""

    def run(setup, draw, worn=None, *, by):
        way = setup.step / model.setup.step
        numbers = {"peak_force": 100.0, "contact_time": 1e-5, "restitution": 0.9}
        return SimpleNamespace(numbers=numbers | by(way))

    def checked(by):
        monkeypatch.setattr(checked_step, "run_shot", partial(run, by=by))
        return in_checked_steps(model.setup, draws[:2], silent)

    found = checked(lambda way: {"peak_force": 100.0 + way})
    assert found.halvings == 4
    assert found.change == pytest.approx(0.0625 / 100.0625 / 1e-3)
    assert found.doubt.startswith(
        "with a time step of 6.25 ns instead of 3.125 ns shot 0 changes by +0.0625 % of its peak "
        "force, +0 % of its contact time and +0 in restitution; shot 1 changes"
    )
    found = checked(lambda way: {"restitution": 0.9 + 0.01 * (np.log2(way) % 2)})
    assert found.halvings == 1
    assert "and -0.01 in restitution. A step" in found.doubt.replace("; shot 1", ". A step")
    found = checked(lambda way: {"restitution": np.nan if way > 1.0 else 0.9})
    assert (found.halvings, found.doubt) == (1, "")

    one = found.outcomes[0]
    assert "shot 2 cannot be compared" in step_doubt(model.setup, draws[2], one, None)


def test_without_a_gap_shots_arrive_at_the_stated_speed():
    """Truth: the case.  From 20 steps above, 1 N made it 0.8 % faster, and the peak as well."""
    case = CASE.model_copy(update={"contact": CASE.contact.model_copy(update={"gap": None})})
    setup = build_shots(case, silent, threads=1).setup
    found = run_shot(setup, centric_draw(case)).numbers

    assert found["approach_speed"] == pytest.approx(case.motion.speed, rel=1e-5)


def test_a_centred_rebound_is_a_throw(model, centred):
    """Height v^2 m / (2 F) and time 2 v m / F after the impact; the body still rings a little."""
    numbers = centred.numbers
    speed = numbers["restitution"] * numbers["approach_speed"]
    fall = numbers["force"] / model.setup.model.mass

    # the bodies are still pressed together at separation: 1 % of the height
    assert numbers["rebound_height"] == pytest.approx(speed**2 / (2 * fall), rel=0.02)
    flight = numbers["second_impact"] - numbers["contact_time"]
    assert flight == pytest.approx(2 * speed / fall, rel=0.02)
    # waves of the coarse mesh, 8 layers round the circle
    assert numbers["rocking"] < 1e-5
    assert numbers["impacts"] == 2
    impulse = model.setup.model.mass * (1 + numbers["restitution"]) * numbers["approach_speed"]
    pressed = numbers["force"] * numbers["contact_time"]
    assert numbers["impulse"] == pytest.approx(impulse + pressed, rel=1e-3)


def test_traces_start_at_first_touch(model, centred, alone):
    time, force_time = model.setup.trace_time, model.setup.force_time
    for outcome in (centred, *alone):
        assert outcome.height[0] == pytest.approx(0.0, abs=1e-9)
        top = np.nanmax(outcome.height[time < outcome.numbers["second_impact"]])
        # on a grid of duration/600
        assert top == pytest.approx(outcome.numbers["rebound_height"], rel=1e-3)
    assert centred.numbers["sub_contacts"] == 1
    impulse = np.trapezoid(centred.force, force_time)
    assert impulse == pytest.approx(centred.numbers["impulse"], rel=0.01)


def test_shots_off_centre_lose_rebound_to_rocking_and_keep_the_books(alone):
    for outcome in alone:
        assert outcome.numbers["eccentricity"] > 0
        assert outcome.numbers["rocking"] > 1e-4
        assert abs(outcome.numbers["energy_residual"]) < 1e-4


def test_a_frictionless_guide_takes_no_energy(model, draws):
    """Steps of 50 ns in the contact with the bore: 0.1 % of the energy, of either sign."""
    for draw in draws:
        with allowed("simulate_interface", 1e-3):
            energy = simulate_shot(model.setup, replace(draw, friction=0.0)).energy
        assert abs(energy.guide) < 1e-3 * energy.initial


def test_friction_in_the_guide_brakes(model, draws):
    energy = simulate_shot(model.setup, replace(draws[1], friction=0.3)).energy
    assert energy.guide > 1e-3 * energy.initial


def test_two_processes_give_the_same_numbers(model, draws, alone):
    log = shot_log(None, "")
    run_shots_on(2, model.setup, draws, log, silent)

    same(columns_of([log.done[draw.index] for draw in draws]), columns_of(alone), ROUND_OFF)
    for draw, outcome in zip(draws, alone, strict=True):
        scale = np.abs(outcome.height).max()
        np.testing.assert_allclose(
            log.done[draw.index].height / scale, outcome.height / scale, rtol=0, atol=1.2e-7
        )


def test_arrays_are_whole_as_other_processes_get_them(alone):
    # a strided one would have machine code of its own, which rounds differently on some processors
    assert "C)" in str(march.nopython_signatures)
    assert ", A)" not in str(march.nopython_signatures)


def test_an_interrupted_study_goes_on_with_the_same_numbers(study, alone):
    assert study.resumed == 2
    same(study.shots, columns_of(alone))


def test_a_log_of_another_study_is_not_used(tmp_path: Path, alone):
    mark = shots_mark(CASE, 1, None)
    with shot_log(tmp_path, mark) as log:
        for outcome in alone:
            log.add(outcome.index, outcome)

    with shot_log(tmp_path, mark) as again:
        assert set(again.done) == {0, 1, 2, 3}
    assert shots_mark(CASE, 2, None) != mark
    with shot_log(tmp_path, shots_mark(CASE, 2, None)) as other:
        assert other.done == {}
    assert SHOT_LOG.count(tmp_path) == 0


def test_a_line_cut_off_costs_one_shot(tmp_path: Path, alone):
    with shot_log(tmp_path, "mark") as log:
        for outcome in alone:
            log.add(outcome.index, outcome)
    path = tmp_path / SHOT_LOG.file
    path.write_bytes(path.read_bytes()[:-40])

    with shot_log(tmp_path, "mark") as again:
        assert set(again.done) == {0, 1, 2}
        again.add(3, alone[3])
    with shot_log(tmp_path, "mark") as whole:
        assert set(whole.done) == {0, 1, 2, 3}
    same(columns_of(list(whole.done.values())), columns_of(alone))


def test_two_processes_do_not_share_a_log(tmp_path: Path):
    """Both would compute the same shots, and one would cut off what the other just writes."""
    with (
        shot_log(tmp_path, "mark"),
        pytest.raises(InputError, match="in use by another process of klack"),
    ):
        shot_log(tmp_path, "mark")
    shot_log(tmp_path, "mark").close()


def test_a_failing_shot_is_named(model, draws):
    rim = replace(
        model.setup.model,
        rim=np.ones(model.setup.model.count, dtype=bool),
        beyond=np.zeros(model.setup.model.count),
    )
    with pytest.raises(InputError, match=r"(?s)shot 2.*contact\.reach"):
        run_shots_on(1, replace(model.setup, model=rim), draws[2:3], shot_log(None, ""), silent)


def test_shots_whose_workers_die_end_with_a_way_out(model, draws, alone, tmp_path, monkeypatch):
    """What they share is larger than the pipe to a new process; truth = exit code of the worker."""
    (tmp_path / "sitecustomize.py").write_text(
        "import os, sys\nif any('spawn_main' in word for word in sys.orig_argv):\n    os._exit(3)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    log = shot_log(None, "")
    log.add(0, alone[0])
    words = r"a worker process died with exit code 3; finished shots so far: 1\.\nTry: fewer"
    with pytest.raises(ConvergenceError, match=words):
        run_shots_on(2, model.setup, draws, log, silent)


def test_a_study_comes_back_from_disk(study, tmp_path: Path):
    SHOTS.save(study, tmp_path)
    back = SHOTS.load(tmp_path)

    assert stored_format(tmp_path) == SHOTS.form.name
    same(back.shots, study.shots)
    assert back.rule == study.rule
    assert back.distributions == study.distributions
    assert set(back.pressures) == {"centric", "highest", "lowest"}
    np.testing.assert_array_equal(back.shot_traces.height, study.shot_traces.height)


def test_numbers_for_scripts(study):
    data = SHOTS.to_json(study)

    assert data["seed"] == 1
    assert len(data["shots"]) == 4
    assert data["shots"][0].keys() == data["centric"].keys()
    for key in ("restitution", "rebound_height_m", "peak_force_N", "contact_time_s", "tilt_rad"):
        assert data["shots"][2][key] is not None
    highest = max(range(4), key=lambda i: data["shots"][i]["rebound_height_m"])
    assert data["highest"] == highest
    bias = data["shots"][highest]["rebound_height_m"] - data["centric"]["rebound_height_m"]
    assert data["rule"]["rebound_height_bias"] == pytest.approx(bias)
    spread = data["distribution"]["restitution"]
    values = [shot["restitution"] for shot in data["shots"]]
    assert spread["mean"] == pytest.approx(np.mean(values))
    assert spread["quantile_1"] == max(values)
    rows = distribution_rows(study)
    assert len(rows) == len(FIRST_IMPACT)
    assert all(len(row) == len(DISTRIBUTION_COLUMNS) for row in rows)


def columns(restitution, height) -> ShotColumns:
    given = {"restitution": restitution, "rebound_height": height}
    return ShotColumns(
        **{
            field.name: np.array(given.get(field.name, np.zeros(len(restitution))))
            for field in fields(ShotColumns)
        }
    )


def test_the_rule_is_judged_by_the_restitution_of_the_highest_shot():
    centric = columns([0.8], [20e-6])
    right = judge_rule(columns([0.7, 0.804, 0.81], [15e-6, 21e-6, 19e-6]), centric, 1)
    wrong = judge_rule(columns([0.7, 0.78], [15e-6, 19e-6]), centric, 1)

    assert right.holds
    assert right.relative_restitution_bias == pytest.approx(0.005)
    assert right.rebound_height_bias == pytest.approx(1e-6)
    assert right.rank == 1
    assert "right for this valve" in right.sentence
    assert not wrong.holds
    assert wrong.restitution_bias == pytest.approx(-0.02)
    assert wrong.rank == 0
    assert "wrong for this valve" in wrong.sentence
    assert "-2.50 %" in wrong.sentence


def test_shots_as_a_dataset(study):
    """Truth = the record, shot by shot; the last row is the centred drop."""
    xarray = pytest.importorskip("xarray")
    data = Result(study, SHOTS).to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data.shot.values.tolist() == [1, 2, 3, 4, 0]
    for index in range(4):
        row = study.shots.row(index)
        shot = data.sel(shot=index + 1)
        assert {key: float(shot[key]) for key in row} == pytest.approx(row, nan_ok=True, rel=0)
        np.testing.assert_array_equal(shot.height, study.shot_traces.height[index])
        np.testing.assert_array_equal(shot.contact_force, study.shot_traces.force[index])
    assert float(data.restitution.sel(shot=0)) == study.centric.restitution[0]
    np.testing.assert_array_equal(data.contact_force.sel(shot=0), study.centric_traces.force[0])
    # mechanics: the impulse is the integral of the force, sampled 400 times
    assert float(data.contact_force.sel(shot=0).integrate("force_time")) == pytest.approx(
        float(data.impulse.sel(shot=0)), rel=1e-3
    )
    assert data.peak_force.attrs["units"] == "N"
    shots = Result(study, SHOTS)
    np.testing.assert_array_equal(shots["force"], data.contact_force)
    frame = shots.to_dataframe()
    assert frame.index.name == "shot"
    np.testing.assert_array_equal(frame["restitution"], data.restitution)
    heights = shots.to_dataframe(axis="time")["height"]
    np.testing.assert_array_equal(heights.loc[2], study.shot_traces.height[1])
    with pytest.raises(InputError, match="one of: shots"):
        Result(study, SHOTS).to_xarray("1")


def test_doubts_of_a_shot_stay_with_it_in_the_log(model, draws, alone, tmp_path, monkeypatch):
    """Also those of a worker process, and of a run that was interrupted."""

    def doubtful(*given, **named):
        warnings.warn("it is off by 2e-3", AccuracyWarning, stacklevel=1)
        return real(*given, **named)

    real = one_shot.simulate_shot
    monkeypatch.setattr(one_shot, "simulate_shot", doubtful)
    with shot_log(tmp_path, "mark") as log:
        run_shots_on(1, model.setup, draws[:2], log, silent)
    with shot_log(tmp_path, "mark") as again:
        assert [again.done[index].doubts for index in (0, 1)] == [("it is off by 2e-3",)] * 2
        outcomes = (*(again.done[index] for index in (0, 1)), alone[2])
    checked = CheckedStep(setup=model.setup, outcomes=(), doubt="depends on the step")
    dropped = DroppedShots(checked=checked, draws=(), outcomes=outcomes, alone=alone[3])
    assert shot_doubts(CASE, dropped) == (
        "depends on the step",
        "2 of 3 shots, first shot 0: it is off by 2e-3",
    )


def test_no_shot_begins_inside_the_wall(model):
    """Truth: energy; sections between rings of nodes once threw some needles out of the bore."""
    setup = model.setup
    for index in range(24):
        draw = draw_shot(CASE, 3, index, model.touch_height)
        coordinates, *_ = np.linalg.lstsq(setup.model.rigid, setup.placement(draw), rcond=1e-12)
        aside = np.linalg.norm(setup.guide.offset + setup.guide.traces @ coordinates, axis=1)
        assert aside.max() < CASE.guide.clearance * (1.0 + 1e-6)
        shot = run_shot(setup, draw)
        assert shot.doubts == ()
        assert shot.numbers["rocking"] < 1.0


@pytest.mark.parametrize(("tilt", "fits"), [(0.00035, True), (0.00045, False)])
def test_a_placement_inside_the_wall_is_refused(tilt, fits):
    """The upper height is 7.4 mm above first touch, the clearance 3 um."""
    motion = CASE.motion.model_copy(update={"placement": Placement(eccentricity=0.0, tilt=tilt)})
    problem = build_problem(CASE.model_copy(update={"motion": motion}), silent, threads=1)
    pools = mode_pools(problem, at_least=1, progress=silent)
    guided = partial(build_guide, problem, build_interface(problem, pools), pools)
    if fits:
        assert guided() is not None
        return
    with pytest.raises(InputError, match="at most the clearance, 3 um"):
        guided()
