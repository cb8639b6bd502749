"""Studies: points, expressions, what is kept, and what is refused.

Truth: single strokes of the changed cases, bit for bit; the points of an uninterrupted study.
"""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.study.analysis import STUDY as ANALYSIS
from klack.analyses.study.asked_points import PointRow, PointSteps, groups_of
from klack.analyses.study.content import study_content
from klack.analyses.study.evaluation import KeptPoint, point_key
from klack.analyses.study.kinds import ask
from klack.analyses.study.points import parameters_of, short_names
from klack.analyses.study.wording import steps_texts
from klack.case.any_case import load_any_case
from klack.case.reader import parse
from klack.case.study import CaseStudy
from klack.case.study_source import StudySource
from klack.cli.main import main
from klack.errors import InputError
from klack.report.html import write_report
from klack.studies.designs import Normal

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
GAP = "network.components.opening.gap"
STIFFNESS = "network.components.spring.stiffness"
HEAD = "klack: 1\nstudy:\n"
INJECTOR = SMALL.with_name("injected_mass.yaml")
STUDY = f"""
  parameters:
    {PRELOAD}: {{from: 10 N, to: 14 N}}
    lift: {{normal: {{mean: 100 um, sd: 3 um}}}}
    part: {{fixed: 10 um}}
  linked:
    {GAP}: lift
    {STIFFNESS}: 0.1 * preload / part
  measures: [opening_time, opening.peak_force, impacts]
  design: {{points: 8}}
  variant: dry
"""


@pytest.fixture
def study(tmp_path):
    return write(tmp_path, STUDY)


def write(folder, text, name="study.yaml"):
    file = folder / name
    file.write_text(HEAD + text)
    return file


def columns(record, kind="measures"):
    return {item.name: item.values for item in getattr(record, kind)}


class TestNumbers:
    @pytest.mark.slow
    def test_every_point_is_the_stroke_of_the_changed_case(self, study):
        record = klack.run_study(SMALL, study, threads=2).record
        case = klack.load_case(SMALL)
        assert record.count == 8
        assert not record.failed.any()
        preload, lift = (columns(record, "parameters")[name] for name in (PRELOAD, "lift"))
        stiffness = columns(record, "linked")[STIFFNESS]
        np.testing.assert_array_equal(columns(record, "linked")[GAP], lift)
        np.testing.assert_allclose(stiffness, 0.1 * preload / 10e-6, rtol=1e-15)
        assert ((preload >= 10.0) & (preload <= 14.0)).all()
        for i in (0, 5):
            changed = case.with_value(PRELOAD, f"{float(preload[i])!r} N")
            changed = changed.with_value(GAP, f"{float(lift[i])!r} m")
            changed = changed.with_value(STIFFNESS, f"{float(stiffness[i])!r} N/m")
            found = klack.run_stroke(changed, ["dry"]).measures
            assert columns(record)["opening_time"][i] == found["dry"]["opening_time"].value
            assert columns(record)["impacts"][i] == found["dry"]["impacts"].value

    def test_masses_are_those_of_the_restrictions_of_the_stroke(self, tmp_path):
        """Also of one command of the driver, with a doubt where it does not end in time."""
        names = ["nozzle.mass", "nozzle.2.mass", "nozzle.9.mass", "delivered_mass"]
        text = f"""
  parameters:
    parameters.pulse: {{values: [0.5 ms, 0.6 ms]}}
    parameters.period: {{fixed: 0.7 ms}}
  measures: [{", ".join(names)}]
  design: {{kind: grid, levels: 2}}
"""
        file = write(tmp_path, text)
        record = klack.run_study(INJECTOR, file).record
        case = klack.load_case(INJECTOR)
        for key, value in (("pulse", "0.5 ms"), ("period", "0.7 ms")):
            case = case.with_value(f"parameters.{key}", value)
        measures = klack.run_stroke(case).measures
        one, two = measures["wet, nozzle"]["mass"], measures["wet, nozzle.2"]["mass"]
        found = [columns(record)[name][0] for name in names]
        assert found[:2] == [one.value, two.value]
        assert np.isnan(found[2])
        assert found[3] == measures["wet"]["delivered_mass"].value == one.value
        assert "'nozzle.2' still passes" in record.notes[0]

    def test_the_case_as_it_is_stands_beside(self, study):
        record = klack.run_study(SMALL, study).record
        today = klack.run_stroke(SMALL, ["dry"]).measures["dry"]
        assert record.measures[0].today == today["opening_time"].value
        assert record.parameters[0].today == 12.0
        assert record.parameters[1].today == 100e-6  # the word that the gap equals
        assert record.linked[0].today == 100e-6

    @pytest.mark.parametrize(
        ("design", "count"),
        [
            ("{kind: grid, levels: 3}", 9),
            ("{kind: one-at-a-time, levels: 3}", 7),
            ("{kind: latin-hypercube, points: 5}", 5),
            ("{kind: file, file: points.csv}", 2),
        ],
    )
    def test_designs(self, tmp_path, design, count):
        (tmp_path / "points.csv").write_text(f"{GAP},{PRELOAD}\n90 um,11 N\n0.11 mm,12.5 N\n")
        text = f"""
  parameters:
    {PRELOAD}: {{from: 10 N, to: 14 N}}
    {GAP}: {{from: 90 um, to: 110 um}}
  measures: [opening_time]
  design: {design}
  variant: dry
"""
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        assert record.count == count
        preload, gap = columns(record, "parameters").values()
        if "grid" in design:
            assert preload.tolist() == [10.0] * 3 + [12.0] * 3 + [14.0] * 3
            np.testing.assert_allclose(gap[:3], [90e-6, 100e-6, 110e-6], rtol=1e-14)
        if "one-at" in design:
            assert preload.tolist() == [12.0, 10.0, 12.0, 14.0, 12.0, 12.0, 12.0]
        if "file" in design:
            assert (preload.tolist(), gap.tolist()) == ([11.0, 12.5], [90e-6, 110e-6])

    def test_words_and_whole_numbers_are_listed(self, tmp_path):
        text = """
  parameters:
    network.components.bores.count: {values: [2, 4]}
    run.accuracy: {values: [normal, fine]}
  measures: [opening_time]
  design: {kind: grid}
  variant: wet
"""
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        assert record.parameters[0].values.tolist() == [2.0, 2.0, 4.0, 4.0]
        assert record.parameters[1].words == ("normal", "fine")
        assert record.parameters[1].today == 0.0
        assert len({*columns(record)["opening_time"].tolist()}) == 4

    def test_points_that_fail_are_rows(self, tmp_path):
        """A ring whose outer radius is below its inner one, 1.5 mm."""
        text = """
  parameters: {network.components.opening.film.outer_radius: {values: [2 mm, 1 mm]}}
  measures: [opening_time]
  design: {kind: grid}
  variant: wet
"""
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        assert record.failed.tolist() == [False, True]
        assert np.isnan(columns(record)["opening_time"][1])
        assert "1 of 2 points have no measures" in record.warnings[0]

        def remarks(record):
            sections = {section.title: section for section in study_content(record).sections}
            points, below = sections["Points"].tables
            return [row[-1] for row in points.rows], below.rows

        noted = replace(record, notes=("8 g, so slow\nTry: 3 g\nother", ""))
        marks, texts = remarks(noted)
        assert marks == ["a, b", "failed: c"]
        assert texts[:2] == (("a", "1", "8 g, so slow\nTry: 3 g"), ("b", "1", "other"))
        assert texts[2][2] == record.failures[1].partition("\n")[0]
        marks, texts = remarks(
            replace(noted, failures=("", ""), notes=("8 g is lost", "9 g is lost"))
        )
        assert marks == ["a", "a"]
        assert texts == (("a", "2, 1 with these numbers", "8 g is lost"),)
        text = text.replace("2 mm, 1 mm", "1 mm, 1.1 mm")
        with pytest.raises(InputError, match="none of which can be computed") as caught:
            klack.run_study(SMALL, write(tmp_path, text))
        assert str(caught.value).count("Try:") == 1


class TestSteps:
    """Truth: what single strokes say of their steps, and the definition of a certificate."""

    def test_each_point_tells_how_its_steps_were_checked(self, tmp_path):
        text = f"""
  parameters:
    {PRELOAD}: {{values: [10 N, 14 N]}}
    run.step: {{values: [20 ns, 200 ns]}}
  measures: [opening.peak_force]
  design: {{kind: grid}}
  variant: dry
"""
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        steps = columns(record, "parameters")["run.step"]
        np.testing.assert_array_equal(record.halvings > 0.0, steps == 200e-9)
        assert (record.step_changes <= 0.5).all()
        found = ANALYSIS.to_json(record)
        assert found["halvings"] == record.halvings.tolist()
        assert found["step_changes"] == record.step_changes.tolist()
        (told,) = steps_texts(record)
        assert "checked at 4 of 4 points, halved at 2; their measures are certified" in told
        doubtful = replace(record, step_changes=np.array([0.1, np.inf, 0.6, 0.2]))
        assert "2 not certified: 1, 2." in next(steps_texts(doubtful))

        plain = write(tmp_path, text, "plain.yaml")
        out, numbers = str(tmp_path / "out"), str(tmp_path / "numbers.json")
        words = ["study", str(SMALL), "--study", str(plain), "--out", out, "--no-report"]
        assert main([*words, "--no-check-steps", "--json", numbers]) == 0
        found = json.loads(Path(numbers).read_text())
        assert (found["halvings"], found["step_changes"]) == ([0.0] * 4, [None] * 4)
        assert "unchecked" in next(steps_texts(klack.load_result(out).record))

    def test_points_with_and_without_a_check_are_not_taken_for_each_other(self):
        tree = klack.load_case(SMALL).tree
        assert point_key(tree, "dry", {}) != point_key(tree, "dry", {}, checks=False)

    def test_a_kept_point_has_the_worse_certificate_of_two_runs(self):
        first = PointRow((1.0,), steps=PointSteps(0, 0.3))
        point = KeptPoint(values={}, failure="", notes=()).with_row(("one",), first)
        both = point.with_row(("two",), PointRow((2.0,), steps=PointSteps(2, 0.1)))
        assert both.row(("one", "two")).steps == PointSteps(2, 0.3)


class TestKept:
    @pytest.mark.slow
    def test_more_points_and_other_measures_use_what_is_there(self, study, tmp_path):
        first = klack.run_study(SMALL, study, folder=tmp_path / "out").record
        assert (first.computed, first.kept) == (9, 0)
        again = klack.run_study(SMALL, study, folder=tmp_path / "out").record
        assert (again.computed, again.kept) == (0, 9)
        more = write(tmp_path, STUDY.replace("points: 8", "points: 16"), "more.yaml")
        second = klack.run_study(SMALL, more, folder=tmp_path / "out").record
        assert (second.computed, second.kept) == (8, 9)
        other = write(tmp_path, STUDY.replace("impacts]", "closing_time]"), "other.yaml")
        third = klack.run_study(SMALL, other, folder=tmp_path / "out").record
        assert third.computed == 9
        for name, values in columns(first).items():
            np.testing.assert_array_equal(columns(again)[name], values)
            np.testing.assert_array_equal(columns(second)[name][:8], values)

    @pytest.mark.slow
    def test_another_case_finds_nothing_and_destroys_nothing(self, study, tmp_path):
        klack.run_study(SMALL, study, folder=tmp_path / "out")
        heavier = klack.load_case(SMALL).with_value("network.components.needle.mass", "4 g")
        assert klack.run_study(heavier, study, folder=tmp_path / "out").record.computed == 9
        assert klack.run_study(SMALL, study, folder=tmp_path / "out").record.computed == 0

    def test_a_changed_file_is_another_point(self, tmp_path):
        from klack.analyses.study.evaluation import point_key
        from klack.case.any_case import read_case_tree

        case = tmp_path / "case.yaml"
        case.write_text(SMALL.read_text())
        tree = read_case_tree(case)
        (tmp_path / "a.inp").write_text("1")
        before = point_key(tree, "dry", {"bodies.needle.geometry.mesh.file": "a.inp"})
        (tmp_path / "a.inp").write_text("2")
        assert point_key(tree, "dry", {"bodies.needle.geometry.mesh.file": "a.inp"}) != before

    @pytest.mark.slow
    @pytest.mark.parametrize("lines", [1, 6])
    def test_killed_at_any_point_it_resumes_to_the_same_numbers(self, study, tmp_path, lines):
        """The signal cannot be caught; a line that was cut off is computed again."""
        whole = klack.run_study(SMALL, study).record
        program = "from klack.cli.main import main; import sys; sys.exit(main(sys.argv[1:]))"
        command = ["study", str(SMALL), "--study", str(study), "--out", str(tmp_path / "out")]
        process = subprocess.Popen(
            [sys.executable, "-c", program, *command, "--no-report", "--threads", "1"],
            env=os.environ | {"COLUMNS": "80"},
            stdout=subprocess.DEVNULL,
        )
        end = time.monotonic() + 120.0
        while time.monotonic() < end and process.poll() is None:
            found = list((tmp_path / "out").glob("points-*.jsonl"))
            if found and found[0].read_bytes().count(b"\n") > lines:
                break
            time.sleep(0.002)
        process.kill()
        process.wait()
        (log,) = (tmp_path / "out").glob("points-*.jsonl")
        log.write_bytes(log.read_bytes()[:-7])  # as if the last line had been cut off
        record = klack.run_study(SMALL, study, folder=tmp_path / "out").record
        assert record.kept >= lines - 1
        for name, values in columns(whole).items():
            np.testing.assert_array_equal(columns(record)[name], values)

    @pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
    def test_ctrl_c_says_what_is_kept(self, study, tmp_path, capsys, monkeypatch):
        from klack.analyses.study import computing

        def stopped(asked, places, *others):
            real(asked, list(places)[:3], *others)
            signal.raise_signal(signal.SIGINT)

        real = computing.compute_points
        monkeypatch.setattr(computing, "compute_points", stopped)
        # a suite in the background ignores it
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = main(["study", str(SMALL), "--study", str(study), "--out", str(tmp_path / "out")])
        assert code == 130
        assert "3 computed points are kept in" in capsys.readouterr().err


WRONG = [
    (f"{PRELOAD}:", "network.components.sprig.preload:", "did you mean 'spring'?"),
    ("from: 10 N", "from: 10 um", "a force"),
    ("from: 10 N", "from: 10", "add a unit"),
    ("from: 10 N", "from: 15 N", "more than 'from'"),
    ("to: 14 N", "too: 14 N", "the unknown key 'too'"),
    (", to: 14 N", "", "a range needs both ends"),
    ("from: 10 N, to: 14 N", "values: []", "values"),
    (f"{GAP}: lift", f"{GAP}: lft", "did you mean 'lift'?"),
    (f"{GAP}: lift", f"{GAP}: preload", "a length"),
    (f"{GAP}: lift", f"{GAP}: lift + 1", "length"),
    (f"{GAP}: lift", f"{GAP}: __import__('os')", "arithmetic"),
    (f"{GAP}: lift", f"{PRELOAD}: preload", "a key that is also a parameter"),
    (f"{GAP}: lift", f"{GAP}: stiffness * part / 1e6", "a length"),
    ("opening_time,", "opening_tim,", "did you mean 'opening_time'?"),
    ("opening_time,", "bore.mass,", "did you mean 'bores.mass'?"),
    ("variant: dry", "variant: damp", "wet"),
    ("points: 8", "points: 0", "1 or more"),
    ("points: 8", "kind: file", "without a file"),
    ("sd: 3 um", "sd: 0 um", "more than 0"),
    ("lift:", "the lift:", "letters, digits and _"),
    ("part: {fixed: 10 um}", "part: {fixed: blue}", "a number with its unit"),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_what_cannot_be_is_one_error_with_its_line(tmp_path, capsys, old, new, words):
    assert old in STUDY
    file = write(tmp_path, STUDY.replace(old, new, 1))
    out = tmp_path / "out"
    assert main(["study", str(SMALL), "--study", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said
    assert str(file) in said
    assert not (out / "result.zarr").exists()


@pytest.mark.parametrize("sd", ["5 K", "5 degC"])
def test_the_spread_of_a_temperature_is_a_difference(sd):
    """5 degC of scatter are 5 K; a mean of 20 degC is 293.15 K."""
    given = {"normal": {"mean": "20 degC", "sd": sd}}
    source = StudySource(
        study=CaseStudy.model_validate(
            {"parameters": {"network.ambient.temperature": given}, "measures": ["opening_time"]}
        ),
        path=SMALL,
        lines=parse("study: {}", SMALL)[1],
        text="",
    )

    (found,) = parameters_of(load_any_case(SMALL), source)

    assert found.spread == Normal(293.15, 5.0)


def test_expressions_in_a_circle(tmp_path):
    text = STUDY.replace("lift\n", "10 um * gap / gap\n").replace(
        "0.1 * preload", "stiffness * gap"
    )
    with pytest.raises(InputError):
        klack.run_study(SMALL, write(tmp_path, text))
    text = STUDY.replace(f"{GAP}: lift", f"{GAP}: part * stiffness * part / preload").replace(
        "0.1 * preload / part", "preload / gap"
    )
    with pytest.raises(InputError, match="circle"):
        klack.run_study(SMALL, write(tmp_path, text))


def test_a_case_without_a_study_says_so(capsys):
    assert main(["study", str(SMALL)]) == 2
    assert "--study FILE" in capsys.readouterr().err


def test_the_section_of_the_case_serves_as_well(tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text(SMALL.read_text() + "study:" + STUDY)
    record = klack.run_study(case).record
    assert (record.count, record.study_text) == (8, "")


def test_a_measure_without_values_is_told(tmp_path):
    text = STUDY.replace("impacts]", "seat.7.peak_force]")
    record = klack.run_study(SMALL, write(tmp_path, text)).record
    assert np.isnan(columns(record)["seat.7.peak_force"]).all()
    assert any("'seat.7.peak_force' has no value at any point" in note for note in record.warnings)


def test_parameters_that_a_dry_variant_leaves_out_are_named(tmp_path):
    """Truth = the definition of the variant: no restrictions, no films."""
    bores, film = "network.components.bores.diameter", "network.components.opening.film.roughness"
    more = f"{bores}: {{from: 1 mm, to: 1.4 mm}}\n    {film}: {{values: [0.1 um, 1 um]}}\n    lift:"
    text = STUDY.replace("lift: {normal", more + " {normal")

    found = klack.run_study(SMALL, write(tmp_path, text)).record.warnings

    assert [note.split(" Try")[0] for note in found if "no effect" in note] == [
        f"'{bores}' has no effect: the variant 'dry' leaves 'bores' out.",
        f"'{film}' has no effect: the variant 'dry' leaves the film of 'opening' out.",
    ]


def test_command_writes_result_report_and_numbers(study, tmp_path, capsys):
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    command = ["study", str(SMALL), "--study", str(study), "--out", str(out)]
    assert main([*command, "--json", str(numbers)]) == 0
    assert "8 points, Sobol points, seed 1" in capsys.readouterr().out
    found = json.loads(numbers.read_text())
    assert found["schema"] == "klack-study/1"
    assert len(found["measures"]["opening_time"]["values"]) == 8
    assert "drawParallel" in (out / "report.html").read_text()
    assert (out / "report.pdf").stat().st_size > 10_000
    stored = klack.load_result(out)
    data = stored.to_xarray()
    assert data["opening_time"].attrs["units"] == "s"
    assert data["opening_time"].values.tolist() == found["measures"]["opening_time"]["values"]
    assert data["network_components_spring_preload"].attrs["comment"] == "10 N to 14 N"
    assert "data:image/png" in stored._repr_html_()
    assert stored.json["measures"] == found["measures"]
    assert main(["export", str(out), "--to", "csv", "--out", str(tmp_path / "table")]) == 0
    (file,) = (tmp_path / "table").glob("*.csv")
    rows = list(csv.reader(file.read_text().splitlines()))
    assert len(rows) == 9
    assert f"{PRELOAD} [N]" in rows[0]
    assert main(["export", str(out), "--to", "parquet", "--out", str(tmp_path / "table")]) == 0
    assert (tmp_path / "table" / "points.parquet").read_bytes()[:4] == b"PAR1"
    capsys.readouterr()
    for source, words in (
        ((str(out), "netcdf"), "--to csv or parquet"),
        ((str(SMALL), "parquet"), "the folder of klack study"),
    ):
        assert main(["export", source[0], "--to", source[1], "--out", str(tmp_path / "no")]) == 2
        assert words in capsys.readouterr().err
        assert not (tmp_path / "no").exists()


@pytest.mark.parametrize("name", ["small_study.yaml", "small_robust.yaml"])
def test_editors_check_a_study_by_its_schema(name, capsys):
    """Truth: what klack itself takes and refuses."""
    jsonschema = pytest.importorskip("jsonschema")
    assert main(["schema", "--kind", "study"]) == 0
    check = jsonschema.Draft202012Validator(json.loads(capsys.readouterr().out))
    data, _ = parse((SMALL.parent / name).read_text(), SMALL)
    check.validate(data)
    data["study"]["design"] = {"kind": "sobool"}
    assert not check.is_valid(data)


def test_short_names_are_ends_that_no_other_has():
    words = short_names(("a.gap", "b.gap", "tip", "network.x-y.z"))
    assert words["a_gap"] == "a.gap"
    assert "gap" not in words
    assert words["tip"] == "tip"
    assert words["x_y_z"] == "network.x-y.z"


class TestNoise:
    """Truth: the noise of the stroke of the changed case, by the command for noise."""

    ROD = """
klack: 1
title: A rod on an elastic block
materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  needle:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          needle:
            start: [0, 0]
            edges:
              - {line: [1.5, 0], name: tip}
              - {line: [1.5, 20], name: shaft}
              - {line: [0, 20], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm}
    damping: {modal: 1 %}
  block:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          block:
            start: [0, -4]
            edges:
              - {line: [6, -4], name: bottom}
              - {line: [6, 0], name: outside}
              - {line: [0, 0], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm}
    fixed: [{surface: bottom}]
    damping: {modal: 1 %}
reduction: {modes: {needle: {count: 4}, block: {count: 6}}, correction: none}
network:
  components:
    needle: {type: flexible-body, body: needle, points: [tip, top]}
    block: {type: flexible-body, body: block, points: [top]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}}
    opening: {type: end-stop, gap: 50 um, law: {kind: linear, stiffness: 1e8 N/m}}
    spring: {type: spring, stiffness: 10 N/mm, preload: 5 N}
    magnet: {type: force-over-time, time: [10 us, 11 us, 300 us, 301 us],
             force: [0 N, 20 N, 20 N, 0 N]}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, block.top]
    - [opening.upper, ground]
    - [needle.top, opening.lower, spring.end, magnet.end]
stops: {seat: {between: [needle.tip, block.top], speed: 1 m/s, force: 20 N}}
noise: {surfaces: [block.outside], mount: {stiffness: 10 N/um, loss_factor: 10 %, mass: 60 g}}
run: {duration: 1 ms, step: 50 ns, variants: [dry]}
"""

    @pytest.mark.slow
    def test_noise_of_a_point_is_that_of_its_stroke(self, tmp_path):
        case = tmp_path / "rod.yaml"
        case.write_text(self.ROD)
        mount = "noise.mount.stiffness"
        text = f"""
  parameters:
    {PRELOAD}: {{values: [5 N, 6 N]}}
    {mount}: {{values: [10 N/um, 20 N/um]}}
  measures: [noise.sound_exposure_level_weighted, noise.radiated_energy, noise.loudness_max]
  design: {{kind: grid}}
"""
        found = columns(klack.run_study(case, write(tmp_path, text)).record)
        changed = klack.load_case(case).with_value(PRELOAD, "6 N").with_value(mount, "20 N/um")
        noise = klack.noise_of(klack.run_stroke(changed, ["dry"]))
        (truth,) = (
            numbers for name, numbers in noise.measures.items() if "rod" in name and "," not in name
        )
        for name, values in found.items():
            assert values[3] == truth[name.partition(".")[2]].value
            if name != "noise.loudness_max":  # too faint to have one
                assert len({*values.tolist()}) == 4

    def test_the_way_to_the_ear_makes_no_bodies(self, tmp_path):
        case = tmp_path / "rod.yaml"
        case.write_text(self.ROD)
        loaded = klack.load_case(case)
        points = [
            {"noise.mount.stiffness": "10 N/um", "noise.distance": "1 m"},
            {"noise.mount.stiffness": "20 N/um", "noise.distance": "2 m"},
        ]
        name = "noise.sound_exposure_level_weighted"
        asked = ask(loaded.checked, loaded.tree, points, [name], None)
        assert [group.places for group in groups_of(asked, range(2))] == [(0, 1)]
        assert asked.kind.makes_bodies(asked.case, ("noise", "surfaces"))

    @pytest.mark.slow
    def test_clicks_of_a_front_are_those_of_their_strokes(self, tmp_path):
        """Truth: the sound of klack noise for the case of the point."""
        case = tmp_path / "rod.yaml"
        case.write_text(self.ROD)
        text = f"""
  parameters: {{{PRELOAD}: {{from: 4.5 N, to: 6 N}}}}
  measures: [closing_time]
  objectives: {{noise.sound_exposure_level_weighted: minimise, closing_time: minimise}}
  search: {{population: 20, generations: 1, refinements: 0}}
"""
        result = klack.optimise(case, write(tmp_path, text))
        record = result.record
        today, best, *others = record.sounds
        assert (today.point, best.point) == (-1, record.optimum.best)
        assert {item.point for item in others} <= set(record.optimum.front.tolist())
        place = best.point
        preload = f"{float(columns(record, 'parameters')[PRELOAD][place])!r} N"
        changed = klack.load_case(case).with_value(PRELOAD, preload)
        noise = klack.noise_of(klack.run_stroke(changed, ["dry"])).record
        np.testing.assert_array_equal(best.pressure.values, noise.designs[0].sound.pressure.values)
        result.save(tmp_path / "kept")
        again = klack.load_result(tmp_path / "kept").record
        np.testing.assert_array_equal(again.sounds[1].pressure.values, best.pressure.values)

    def test_a_valve_without_stops_has_no_noise_but_its_stroke(self, tmp_path, capsys):
        text = SMALL.read_text().partition("    chamber:")[0]
        text = "\n".join(line for line in text.splitlines() if "seat:" not in line)
        head, _, rest = text.partition("    opening:")
        rest = rest[rest.index("    spring:") :]
        text = f"""{head}{rest}
  connections:
    - [needle.top, spring.end, magnet.end]
run: {{duration: 0.5 ms, variants: [dry]}}
"""
        case = tmp_path / "free.yaml"
        case.write_text(text.replace("points: [tip, top]", "points: [top]"))
        file = write(
            tmp_path,
            f"""
  parameters: {{{PRELOAD}: {{values: [5 N, 6 N]}}}}
  measures: [noise.sound_exposure_level_weighted, end_time]
  design: {{kind: grid}}
""",
        )
        record = klack.run_study(case, file).record
        assert not record.failed.any()
        assert np.isfinite(columns(record)["end_time"]).all()
        assert np.isnan(columns(record)["noise.sound_exposure_level_weighted"]).all()
        assert "no end stop" in record.notes[0]
        stroke = klack.run_stroke(case, ["dry"])
        with pytest.raises(InputError, match="no end stop"):
            klack.noise_of(stroke)


class TestSensitivity:
    @pytest.mark.slow
    def test_what_has_no_effect_has_no_share_and_the_others_share_all(self, tmp_path):
        """Peak force of a rigid mass, sqrt(2 k x (F - P - c x / 2)): independent of its mass.

        It is nearly linear in magnet force and preload, whose ranges are equally wide.
        """
        text = f"""
  parameters:
    {PRELOAD}: {{from: 10 N, to: 14 N}}
    network.components.needle.mass: {{from: 2.5 g, to: 3.5 g}}
    network.components.magnet.force.1: {{from: 33 N, to: 37 N}}
  measures: [opening.peak_force]
  design: {{kind: saltelli, points: 64}}
  variant: dry
"""
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        assert record.count == 64 * 5
        (found,) = record.sensitivities
        preload, mass, force = found.total
        assert mass < 1e-4
        assert preload == pytest.approx(0.5, abs=0.12)
        assert force == pytest.approx(0.5, abs=0.12)
        assert found.first.sum() == pytest.approx(1.0, abs=0.1)
        assert found.first_low[0] < found.first[0] < found.first_high[0]


class TestScreening:
    @pytest.mark.slow
    def test_effects_have_the_size_of_the_change_over_a_range(self, tmp_path):
        """Truth: the two ends of a range, of a measure that is nearly linear; and no effect."""
        text = f"""
  parameters:
    {PRELOAD}: {{from: 11.9 N, to: 12.1 N}}
    network.components.magnet.force.1: {{from: 34.9 N, to: 35.1 N}}
    network.components.opening.restitution: {{from: 0.4, to: 0.6}}
  measures: [opening_time]
  design: {{kind: morris, points: 6}}
  variant: dry
"""
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        assert record.count == 6 * 4
        (found,) = record.screenings
        case = klack.load_case(SMALL)
        for k, key, low, high in (
            (0, PRELOAD, "11.9 N", "12.1 N"),
            (1, "network.components.magnet.force.1", "34.9 N", "35.1 N"),
        ):
            ends = [
                klack.run_stroke(case.with_value(key, value), ["dry"])
                .measures["dry"]["opening_time"]
                .value
                for value in (low, high)
            ]
            assert found.mean[k] == pytest.approx(ends[1] - ends[0], rel=0.02)
            assert found.size[k] == pytest.approx(abs(ends[1] - ends[0]), rel=0.02)
        assert (found.size[2], found.scatter[2]) == (0.0, 0.0)
        assert found.effects.tolist() == [6, 6, 6]


class TestRobustness:
    """Truth: counting, and the exact binomial interval of one in 64 points."""

    @pytest.mark.slow
    def test_missed_bounds_are_counted(self, tmp_path):
        text = STUDY.replace("  design: {points: 8}", "  design: {points: 64}").replace(
            "  design:",
            "  constraints: {opening.peak_force: {most: today - 10 %, least: 1 kN}}\n  design:",
        )
        record = klack.run_study(SMALL, write(tmp_path, text)).record
        force, today = columns(record)["opening.peak_force"], record.measures[1].today
        most, least = record.missed
        assert most.missed == (force > today - 0.1 * today).sum() > 0
        assert (most.points, most.failed) == (64, 0)
        assert most.probability == most.missed / 64
        assert most.low < most.probability < most.high
        assert (least.missed, least.low) == (0, 0.0)
        assert least.at_most == pytest.approx(1.0 - 0.05 ** (1.0 / 64.0), rel=1e-9)

    def test_bounds_that_exclude_each_other_are_one_error(self, tmp_path):
        bounds = "  constraints: {opening.peak_force: {most: today, least: today + 1 %}}\n"
        text = STUDY.replace("  design:", f"{bounds}  design:")
        with pytest.raises(InputError, match=r"least: today \+ 1 % above most: today"):
            klack.run_study(SMALL, write(tmp_path, text))

    def test_a_grid_is_no_sample(self, tmp_path):
        text = STUDY.replace("design: {points: 8}", "design: {kind: grid, levels: 2}")
        text = text.replace("  design:", "  constraints: {impacts: {most: 9}}\n  design:")
        assert klack.run_study(SMALL, write(tmp_path, text)).record.missed == ()


OPTIMUM = f"""
  parameters:
    {PRELOAD}: {{from: 10 N, to: 14 N}}
    lift: {{from: 90 um, to: 110 um}}
  linked: {{{GAP}: lift}}
  measures: [impacts]
  objectives: {{opening_time: minimise, opening.peak_force: minimise}}
  constraints: {{opening.peak_force: {{most: today - 1 %}}, opening_time: {{least: 1 us}}}}
  search: {{population: 20, generations: 4, refinements: 30}}
  variant: dry
"""


class TestOptimum:
    """Truth: definitions of the front, an exhaustive grid, and bounds by the case as it is."""

    @pytest.mark.slow
    def test_nothing_that_was_computed_beats_the_front(self, tmp_path):
        file = write(tmp_path, OPTIMUM)
        record = klack.optimise(SMALL, file, folder=tmp_path / "out").record
        found = record.optimum
        time, force = (columns(record)[name] for name in ("opening_time", "opening.peak_force"))
        today = {item.name: item.today for item in record.measures}
        most = 0.99 * today["opening.peak_force"]
        assert found.feasible
        np.testing.assert_array_equal(found.kept, force <= most)
        for i in found.front:
            better = found.kept & (time <= time[i]) & (force <= force[i])
            assert not (better & ((time < time[i]) | (force < force[i]))).any()
        assert found.best in found.front
        assert (record.step_changes[found.front] <= 0.5).all()  # the others as they are
        assert np.isnan(record.step_changes).sum() > 40
        assert record.count > 80  # refinements came after the generations
        again = klack.optimise(SMALL, file, folder=tmp_path / "out").record
        assert again.computed == 0
        np.testing.assert_array_equal(again.optimum.front, found.front)
        grid = OPTIMUM.replace("  search:", "  design: {kind: grid, levels: 7}\n  search:")
        grid = grid.replace("measures: [impacts]", "measures: [opening_time, opening.peak_force]")
        every = columns(klack.run_study(SMALL, write(tmp_path, grid, "grid.yaml")).record)
        for t, f in zip(*every.values(), strict=True):
            if f <= most:  # within 1 %, no point of a grid is better than all of the front
                assert ((time[found.front] <= 1.01 * t) & (force[found.front] <= 1.01 * f)).any()

    def test_without_pymoo_nothing_is_computed_or_written(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setitem(sys.modules, "pymoo.config", None)
        out = tmp_path / "out"
        file = write(tmp_path, OPTIMUM)

        assert main(["optimise", str(SMALL), "--study", str(file), "--out", str(out)]) == 2
        assert "--extra optimise" in capsys.readouterr().err
        assert not out.exists()

    @pytest.mark.slow
    def test_one_objective_finds_the_corner(self, tmp_path, capsys, monkeypatch):
        """A strong spring opens late: the latest opening is at the highest preload and lift."""
        text = OPTIMUM.replace("opening.peak_force: minimise}", "}").replace(
            "opening_time: minimise, ", "opening_time: maximise"
        )
        text = text.replace("opening.peak_force: {most: today - 1 %}, ", "")
        out = tmp_path / "out"
        command = ["optimise", str(SMALL), "--study", str(write(tmp_path, text)), "--out", str(out)]
        monkeypatch.setattr("klack.analyses.study.live._FIRST", 0.0)
        assert main([*command, "--json", str(tmp_path / "o.json")]) == 0
        assert "best so far" in capsys.readouterr().err
        found = json.loads((tmp_path / "o.json").read_text())
        best = found["optimum"]["best"]
        assert found["parameters"][PRELOAD]["values"][best] == pytest.approx(14.0, rel=1e-3)
        assert found["parameters"]["lift"]["values"][best] == pytest.approx(110e-6, rel=1e-3)
        assert "today&#39;s case</h2>" in (out / "report.html").read_text()

        assert main(["export", str(out), "--to", "case", "--out", str(tmp_path / "case")]) == 0
        (case,) = (tmp_path / "case").glob("*.yaml")
        stroke = klack.run_stroke(case, ["dry"]).measures["dry"]
        assert stroke["opening_time"].value == found["measures"]["opening_time"]["values"][best]
        assert main(["export", str(out), "--to", "case", "--point", "9999"]) == 2
        assert "--point" in capsys.readouterr().err

    @pytest.mark.slow
    def test_the_best_so_far_is_a_page_while_it_runs(self, tmp_path, capsys, monkeypatch):
        pages = []

        def seen(content, path):
            write_report(content, path)
            if path.name == "progress.html":
                pages.append((content, path.read_text()))

        monkeypatch.setattr("klack.analyses.study.live._FIRST", 0.0)
        monkeypatch.setattr("klack.report.html.write_report", seen)
        out = tmp_path / "out"
        command = ["optimise", str(SMALL), "--study", str(write(tmp_path, OPTIMUM))]
        assert main([*command, "--out", str(out)]) == 0
        told = capsys.readouterr().err.replace("\n", "").replace(" ", "")
        assert str(out / "progress.html") in told
        counts = [int(content.subtitle.split(" points")[0].split()[-1]) for content, _ in pages]
        assert len(counts) > 1
        assert counts == sorted(set(counts))
        assert all("the search is running" in text for _, text in pages)
        assert not (out / "progress.html").exists()

        def broken(content, path):
            if path.name != "progress.html":
                return write_report(content, path)
            raise OSError("no space left")

        monkeypatch.setattr("klack.report.html.write_report", broken)
        assert main([*command, "--out", str(tmp_path / "other")]) == 0
        assert capsys.readouterr().err.count("no space left") == 1

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ("objectives:", "others:", "the unknown key 'others'"),
            ("{opening_time: minimise, opening.peak_force: minimise}", "{}", "no objectives"),
            ("opening_time: minimise", "opening_tim: minimise", "did you mean"),
            ("today - 1 %", "400 mm", "a force"),
            ("today - 1 %", "today - 1 mm", "a force"),
            ("{most: today - 1 %}", "{}", "no bound"),
            ("population: 20", "population: 5", "8 or more"),
            ("most: today - 1 %", "most: 1 N", "No point meets all bounds"),
            ("from: 10 N, to: 14 N", "from: 60 N, to: 70 N", "No point has a value of every"),
        ],
    )
    def test_what_cannot_be(self, tmp_path, capsys, old, new, words):
        assert old in OPTIMUM
        file = write(tmp_path, OPTIMUM.replace(old, new, 1))
        command = ["optimise", str(SMALL), "--study", str(file), "--out", str(tmp_path / "out")]
        code = main([*command, "--no-report"])
        assert code == (0 if new == "most: 1 N" or words.startswith("No point") else 2)
        said = capsys.readouterr()
        assert words in " ".join((said.out + said.err).split())
