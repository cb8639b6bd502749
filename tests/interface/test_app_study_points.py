"""Studies of the browser application without a browser: what pages are told, made and refused."""

import json
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np
import pytest
import yaml
from made_study import made_study

import klack.app.study_points as study_points
from klack.analyses.study.analysis import STUDY
from klack.analyses.study.evaluation import Evaluation
from klack.analyses.study.live import LiveRecord
from klack.analyses.study.record import NOT_YET, StudyRecord
from klack.analyses.study.run import asked_points, run_study
from klack.app.answers import StudyChoice
from klack.app.folder import OpenFolder
from klack.app.jobs import Jobs
from klack.app.state import State
from klack.app.study_files import (
    beside_case,
    case_of_study,
    free_name,
    points_source,
    result_of_study,
)
from klack.app.study_points import StudyPoints, points_json
from klack.app.texts import checked_text, exchanged_text, study_offer, study_problem, study_text
from klack.case.any_case import read_case_tree
from klack.case.study_source import study_of
from klack.errors import InputError, KlackError
from klack.machine.progress import PointCount, silent
from klack.terminal.progress import PROGRESS_FILE, show_progress

DOCS = Path("docs/how-to")
CASE, STUDY_FILE = DOCS / "small_valve.yaml", DOCS / "small_study.yaml"
PRELOAD, GAP = "network.components.spring.preload", "network.components.opening.gap"
ATTACK = "</script><script>alert(1)</script>"


def told(record: StudyRecord) -> dict:
    return json.loads(points_json(record))


# --------------------------------------------------------------------------- points


def test_points_carry_front_bounds_doubts_and_failures():
    record = made_study(200, failed=3, doubtful=5, word=ATTACK)

    found = told(record)

    assert found["points"] == list(range(200))
    assert (found["failed"], found["doubtful"], found["waiting"]) == (3, 5, 0)
    assert found["lost"] == [0, 1, 2]
    assert [place for place, _ in found["doubt"]] == [3, 4, 5, 6, 7]
    assert found["doubts"][0] == f"a doubt{ATTACK}"
    assert found["failures"]["reasons"] == [[f"no contact{ATTACK}", 3]]
    level = record.measures[2].values
    assert found["missed"] == [k for k in range(3, 200) if level[k] > 48.0]
    time, force = found["columns"][6:8]
    assert (time["unit"], force["unit"], time["way"]) == ("us", "kN", "minimise")
    assert time["values"][:3] == [None] * 3
    np.testing.assert_allclose(time["values"][3:], 1e6 * record.measures[0].values[3:], rtol=1e-6)
    # no point of the front is beaten, every other one is
    pairs = np.column_stack([record.measures[0].values, record.measures[1].values])
    for k in range(3, 200):
        beaten = np.any(np.all(pairs < pairs[k], axis=1))
        assert beaten != (k in found["front"])


class Listed:
    """Workers that compute nothing and note the order they were asked in; an empty log."""

    count, words = 1, ""

    def __init__(self) -> None:
        self.done: dict = {}
        self.asked: tuple[int, ...] = ()

    def compute(self, asked, places, keep, progress) -> None:
        self.asked = places


def test_the_case_as_it_is_is_computed_before_the_points_of_a_study():
    tree = read_case_tree(CASE)
    case = tree.any_case()
    points, asked = asked_points(case, tree, study_of(case, tree, STUDY_FILE))
    listed = Listed()

    Evaluation(listed, listed).rows(asked, silent)

    assert listed.asked == (len(points.values), *range(len(points.values)))


def test_a_study_with_objectives_has_the_front_that_its_text_asks_for():
    record = replace(
        made_study(60),
        optimum=None,
        study_text="klack: 1\nstudy:\n  parameters: {x: {from: 1, to: 2}}\n  measures: [level]\n"
        "  objectives: {seat.peak_force: minimise, opening_time: maximise}\n"
        "  constraints: {level: {most: 48 dBA}}\n",
    )
    found = told(record)

    kept = record.measures[2].values <= 48.0
    time, force = (item.values for item in record.measures[:2])
    front = [
        k for k in np.flatnonzero(kept) if not np.any(kept & (force < force[k]) & (time > time[k]))
    ]
    assert sorted(found["front"]) == front
    assert found["best"] in front
    assert found["bounds"] == ["level at most 48 dBA"]
    assert told(replace(record, study_text=""))["front"] == []


def test_more_points_than_a_page_draws_keep_the_front(monkeypatch):
    monkeypatch.setattr(study_points, "MOST_DRAWN", 50)
    found = told(made_study(1000))

    assert len(found["points"]) == 50
    assert set(found["front"]) <= set(found["points"])
    assert found["count"] == 1000
    assert all(len(column["values"]) == 50 for column in found["columns"])


def test_stores_that_are_too_large_or_uneven_are_refused(tmp_path, monkeypatch):
    STUDY.save(made_study(100), tmp_path / "good")
    short = made_study(100)
    STUDY.save(
        replace(short, linked=(replace(short.parameters[0], values=np.zeros(3)),)),
        tmp_path / "short",
    )
    assert StudyPoints().record(str(tmp_path / "good")).count == 100
    with pytest.raises(InputError, match="different lengths"):
        StudyPoints().record(str(tmp_path / "short"))
    monkeypatch.setattr(study_points, "LARGEST_STORE", 10_000)
    with pytest.raises(InputError, match="more than 0 MB"):
        StudyPoints().record(str(tmp_path / "good"))


def test_a_record_is_read_again_once_it_was_replaced(tmp_path):
    points = StudyPoints()
    STUDY.save(made_study(10), tmp_path)
    first = points.record(str(tmp_path))
    assert points.record(str(tmp_path)) is first
    STUDY.save(made_study(20), tmp_path)
    assert points.record(str(tmp_path)).count == 20


# --------------------------------------------------------------------------- while it runs


def test_a_study_offers_its_points_while_they_come(tmp_path):
    tree = read_case_tree(CASE)
    case = tree.any_case()
    text = STUDY_FILE.read_text("utf-8").replace("points: 128", "points: 4")
    (tmp_path / "study.yaml").write_text(text, "utf-8")
    source = study_of(case, tree, tmp_path / "study.yaml")
    seen: list[StudyRecord] = []

    whole = run_study(case, tree, source, live=lambda make: seen.append(make()))

    first, last = seen[0], seen[-1]
    assert first.failures == (NOT_YET,) * 4
    assert told(first)["waiting"] == 4
    assert told(first)["failed"] == 0
    for record in seen:
        for column, final in zip(record.columns, whole.columns, strict=True):
            known = np.isfinite(column.values)
            np.testing.assert_array_equal(column.values[known], final.values[known])
    assert last.count == whole.count
    assert NOT_YET not in whole.failures  # how many come at once depends on the machine


def test_the_live_record_is_written_seldom_and_ends_no_study(tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(
        "klack.analyses.study.live.STUDY", type("S", (), {"save": lambda *given: None})
    )
    live = LiveRecord(tmp_path, silent)
    for _ in range(5):
        live.offer(lambda: made.append(1))
    assert len(made) == 1
    live.write()
    assert len(made) == 2

    def fails():
        raise RuntimeError("no place")

    broken = LiveRecord(tmp_path, silent)
    broken.offer(fails)
    broken.write()  # told once, then given up


def test_counts_of_points_reach_the_file_of_the_progress(tmp_path, monkeypatch):
    monkeypatch.setenv(PROGRESS_FILE, str(tmp_path / "progress.json"))
    with show_progress() as progress:
        progress.counted(PointCount(done=3, most=8, left=5.0, best="x"))
        progress("points", 0.375)
    found = json.loads((tmp_path / "progress.json").read_text())
    assert found["points"] == {"done": 3, "most": 8, "left": 5.0, "best": "x"}


def made_job(folder: OpenFolder, name: str, out: str, code: int | None, **more: object) -> Path:
    """A run that has ended with this code; None: its process is gone without one."""
    place = folder.path / ".klack-app" / "jobs" / name
    place.mkdir(parents=True)
    asked = {"command": "study", "case": "a.yaml", "out": out, "started": 0.0} | more
    (place / "job.json").write_text(json.dumps(asked))
    if code is not None:
        (place / "ending.json").write_text(json.dumps({"code": code}))
    return place


def test_the_points_of_a_run_stand_before_those_of_an_earlier_result(tmp_path):
    state = State(OpenFolder(tmp_path))
    STUDY.save(made_study(10), tmp_path / "out")
    assert not points_source(state, "out").is_live

    stopped = made_job(state.folder, "20260101-000000-00000001", "out", 143, study="s.yaml")
    assert points_source(state, "out").job.state == "cancelled"
    assert points_source(state, "out").folder == tmp_path / "out"
    STUDY.save(made_study(5), stopped / "live")
    assert points_source(state, "out").is_live
    assert points_source(state, "out").folder == stopped / "live"

    made_job(state.folder, "20260101-000000-00000002", "out", 0)
    assert points_source(state, "out").folder == tmp_path / "out"
    for path in ("../out", "nothing", "", "/etc"):
        with pytest.raises(InputError):
            points_source(state, path)


def test_damaged_counts_are_no_run(tmp_path):
    folder = OpenFolder(tmp_path)
    place = made_job(folder, "20260101-000000-00000001", "out", 0)
    for bad in ('{"points": {"done": 1}}', '{"points": {"done": [], "most": 1, "left": null}}'):
        (place / "progress.json").write_text(bad)
        assert Jobs(folder).all() == []
    (place / "progress.json").write_text(
        '{"points": {"done": 1, "most": 2, "left": NaN, "best": ""}}'
    )
    assert Jobs(folder).all()[0].points == PointCount(done=1, most=2)


# --------------------------------------------------------------------------- files


def test_a_study_names_a_case_below_the_folder_only(tmp_path):
    (tmp_path / "secret.yaml").write_text("klack: 1\n")
    inside = tmp_path / "open"
    (inside / "valve").mkdir(parents=True)
    (inside / "valve" / "case.yaml").write_text("klack: 1\n")
    (inside / "valve" / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    folder = OpenFolder(inside)

    assert case_of_study(folder, "valve/study.yaml", "case.yaml") == "valve/case.yaml"
    assert case_of_study(folder, "valve/study.yaml", "../valve/./case.yaml") == "valve/case.yaml"
    for bad in ("../../secret.yaml", "link.yaml", "/etc/passwd", "none.yaml", "..\\x", "", ".."):
        with pytest.raises(InputError):
            case_of_study(folder, "valve/study.yaml", bad)
    with pytest.raises(InputError):
        Jobs(folder).start("study", "valve/case.yaml", "out", study="../secret.yaml")


def test_names_of_results_and_new_files_are_plain(tmp_path):
    folder = OpenFolder(tmp_path)
    (tmp_path / "a_point_1.yaml").write_text("")
    assert free_name(folder, "", "a_point_1.yaml", "b.yaml") == "a_point_1_2.yaml"
    assert free_name(folder, "x", "../a.yaml", "b.yaml") == "x/b.yaml"


ALIKE = [
    *("study.yaml", "study.yml", "a/study.yaml", "b/study.yaml", "a/b/study.yaml", "a-study.yaml"),
    *("a.study.yaml", "a/b.study.yaml", "a.b/study.yaml", "a.b.study.yaml", "a/study.yml"),
    *("a+study.yaml", "valve.yaml", "valve/case.yaml", "small_study.yaml", "small.yaml", ".yaml"),
    *("small-study.yaml", "ö/study.yaml", "o/study.yaml", "A/study.yaml", "a/.yaml", "..yaml"),
    *("x" * 200 + ".yaml", "x" * 201 + ".yaml", "x" * 200 + "/study.yaml", "a/study.yaml.yaml"),
]


def test_no_two_studies_share_a_result_and_each_finds_its_own_again():
    asked = [
        (command, study, case)
        for command in ("study", "optimise")
        for study in ALIKE
        for case in ("", *ALIKE)
    ]
    names = [result_of_study(*one) for one in asked]

    assert len(set(names)) == len(asked)
    assert names == [result_of_study(*one) for one in asked]
    assert all(len(PurePosixPath(name).parts) == 3 for name in names)  # no case writes there
    assert max(len(name.encode()) for name in names) < 200
    assert result_of_study("study", "valve/study.yaml") == "klack-results/study/valve.study"
    hashed = PurePosixPath(result_of_study("study", "a.b/study.yaml")).name
    assert result_of_study("study", f"{hashed}.yaml") not in names


def test_the_case_of_a_result_is_found_by_its_text(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "case.yaml").write_text(f"klack: 1\ntitle: {name}\n")
    folder = OpenFolder(tmp_path)
    assert beside_case(folder, None, "two", "klack: 1\ntitle: two\n") == "two"
    assert beside_case(folder, None, "none", "klack: 1\n") == ""


# --------------------------------------------------------------------------- texts


def choice(**other: object) -> StudyChoice:
    given = {
        "ranges": {PRELOAD: ("10 N", "13 N"), GAP: ("90 um", "110 um")},
        "measures": ("opening_time",),
        "objectives": {"opening.peak_force": "minimise"},
        "design": "sobol",
        "points": 64,
    }
    return StudyChoice(**{**given, **other})


def test_a_study_made_of_choices_is_one_that_commands_take():
    text = study_text(choice(), CASE.read_text("utf-8"), str(CASE))
    study = yaml.safe_load(text)["study"]

    assert study["parameters"][PRELOAD] == {"from": "10 N", "to": "13 N"}
    assert study["measures"] == ["opening_time", "opening.peak_force"]
    assert "# today 12 N" in text
    path = str(CASE.with_name("new.yaml"))
    found = study_problem(text, path, CASE.read_text("utf-8"), str(CASE))
    assert (found.error, found.has_objectives) == ("", True)
    assert found.title.startswith("64 points, Sobol")
    assert checked_text(text, path).case == "small_valve.yaml"


@pytest.mark.parametrize(
    "bad",
    [
        {"ranges": {}},
        {"measures": (), "objectives": {}},
        {"measures": ("open_time",)},
        {"objectives": {"opening_time": "minimise\nx: 1"}},
        {"design": "file"},
        {"ranges": {PRELOAD: ("10 N}\nklack: 2", "13 N")}},
        {"ranges": {PRELOAD: ("13 N", "10 N")}},
        {"ranges": {PRELOAD: ("1 mm", "2 mm")}},
        {"ranges": {f"{PRELOAD}: 1\nx": ("10 N", "13 N")}},
        {"ranges": {PRELOAD: ("-1 N", "nan")}},
    ],
)
def test_choices_that_are_no_study_are_refused(bad):
    with pytest.raises(KlackError):
        study_text(choice(**bad), CASE.read_text("utf-8"), str(CASE))


def test_what_is_offered_are_numbers_of_the_case_and_measures_of_the_valve():
    offer = study_offer(CASE.read_text("utf-8"), str(CASE))

    assert PRELOAD in {item.key for item in offer.parameters}
    assert [item.name for item in offer.measures[:2]] == ["opening_time", "closing_time"]
    assert "wall_time" not in {item.name for item in offer.measures}


@pytest.mark.slow
def test_a_value_of_a_million_digits_is_refused_as_a_text():
    text, path = CASE.read_text("utf-8"), str(CASE)
    place = ("network", "components", "spring", "preload")
    changed = exchanged_text(text, path, place, "9" * 500_000)

    assert len(changed) > 500_000
    assert "spring.preload: got '999" in checked_text(changed, path).error


def test_a_study_has_a_form_and_the_messages_of_the_checker():
    text, path = STUDY_FILE.read_text("utf-8"), str(STUDY_FILE)
    found = checked_text(text, path)
    written = {item.key: item.written for item in found.fields}

    assert (found.kind, found.has_objectives) == ("study", True)
    assert written[f"study.parameters.{PRELOAD}.from"] == "10 N"
    assert written["study.design.points"] == "128"
    changed = exchanged_text(text, path, ("study", "design", "points"), "64")
    assert changed == text.replace("points: 128", "points: 64")
    bad = checked_text(text.replace("points: 128", "points: many"), path)
    assert "study.design.points" in bad.error
    assert ":13: " in bad.error
    wrong = study_problem(
        text.replace("spring.preload", "spring.prelaod"), path, CASE.read_text("utf-8"), str(CASE)
    )
    assert "preload" in wrong.error


def test_a_title_of_digits_is_text_and_a_speed_of_digits_lacks_its_unit():
    text, path = CASE.read_text("utf-8"), str(CASE)

    named = exchanged_text(text, path, ("title",), "2026")

    assert 'title: "2026"' in named.splitlines()
    assert checked_text(named, path).error == ""
    bare = exchanged_text(text, path, ("network", "components", "spring", "preload"), "12")
    assert "without unit" in checked_text(bare, path).error
