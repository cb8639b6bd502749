"""Surrogates and polished optima in a study.

Surrogates in a study: what is shown, what is not, and what is refused.

Truth: fresh strokes; shares by Saltelli's design; the rules of the page.

Optima polished by derivatives.

Truth: strokes on both sides of a point; an optimum that a search without derivatives finds too.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.study.evaluation import asked_of
from klack.analyses.study.goals import Bound, Goals
from klack.analyses.study.gradients import Gradients, require_gradients
from klack.analyses.study.points import space_of
from klack.case.study_source import study_of
from klack.cli.main import main
from klack.errors import InputError
from klack.machine.progress import silent

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
MASS = "network.components.needle.mass"
STUDY = f"""
klack: 1
study:
  parameters:
    {PRELOAD}: {{from: 10 N, to: 14 N}}
    {MASS}: {{normal: {{mean: 3 g, sd: 0.1 g}}}}
    lift: {{from: 90 um, to: 110 um}}
  linked:
    network.components.opening.gap: lift
  measures: [opening_time, opening.peak_force]
  design: {{kind: sobol, points: 40}}
  surrogate: {{kind: polynomial-chaos}}
  variant: dry
"""


def write(folder, text=STUDY, name="study.yaml"):
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def surrogates(record):
    return {item.measure: item for item in record.surrogates}


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return klack.run_study(SMALL, write(tmp_path_factory.mktemp("study"))).record


@pytest.mark.slow
def test_leave_one_out_errors_are_those_of_fresh_strokes(record, tmp_path):
    """Truth: 40 other points; the surrogate that is judged is rebuilt from the record."""
    from klack.studies.designs import Normal, Range
    from klack.studies.surrogate import fit_surrogate
    from klack.studies.surrogate_model import SurrogateAxis

    spreads = (Range(10.0, 14.0), Normal(3e-3, 1e-4), Range(90e-6, 110e-6))
    axes = [SurrogateAxis.of(spread) for spread in spreads]

    def at(of):
        pairs = zip(axes, of.parameters, strict=True)
        return np.column_stack([axis.coordinate(item.values) for axis, item in pairs])

    fresh = klack.run_study(
        SMALL, write(tmp_path, STUDY.replace("points: 40", "points: 40, seed: 7"))
    ).record
    for item, other in zip(record.measures, fresh.measures, strict=True):
        fitted = fit_surrogate("polynomial-chaos", axes, at(record), item.values)
        found = surrogates(record)[item.name]
        assert found.error == pytest.approx(fitted.error, rel=1e-6)
        apart = other.values - fitted.model.predict(at(fresh))
        assert np.sqrt(np.mean(apart**2)) < 2.0 * found.error
        assert np.max(np.abs(apart)) < 3.0 * found.largest
        assert found.predictivity > 0.999


@pytest.mark.slow
def test_shares_are_those_of_saltelli_with_fewer_points(record, tmp_path):
    text = STUDY.replace("kind: sobol, points: 40", "kind: saltelli, points: 32")
    text = text.replace("  surrogate: {kind: polynomial-chaos}\n", "")
    for item in klack.run_study(SMALL, write(tmp_path, text)).record.sensitivities:
        found = surrogates(record)[item.measure]
        assert np.all(
            (item.total_low - 0.02 < found.total) & (found.total < item.total_high + 0.02)
        )
    force = surrogates(record)["opening.peak_force"]
    assert force.total[1] < 1e-3  # a rigid needle hits with the root of the work, not of its mass


@pytest.mark.slow
def test_points_stay_as_they_were_computed(record, tmp_path):
    plain = STUDY.replace("  surrogate: {kind: polynomial-chaos}\n", "")
    without = klack.run_study(SMALL, write(tmp_path, plain)).record
    assert without.surrogates == ()
    for with_it, alone in zip(record.measures, without.measures, strict=True):
        np.testing.assert_array_equal(with_it.values, alone.values)
    assert surrogates(record)["opening_time"].residuals.shape == (40,)


@pytest.mark.slow
def test_command_result_report_and_json(tmp_path, capsys):
    text = STUDY.replace("opening.peak_force]", "opening.peak_force, end_time, seat.9.time]")
    text = text.replace(
        f"{MASS}: {{normal: {{mean: 3 g, sd: 0.1 g}}}}",
        ("network.fluid: {values: [n-heptane, n-decane]}"),
    )
    out = tmp_path / "out"
    asked = ["study", str(SMALL), "--study", str(write(tmp_path, text)), "--out", str(out)]
    numbers = tmp_path / "numbers.json"
    assert main([*asked, "--json", str(numbers)]) == 0
    told = capsys.readouterr().out
    found = json.loads(numbers.read_text(encoding="utf-8"))["surrogates"]
    assert found["opening_time"]["predictivity"] > 0.99
    assert found["opening_time"]["largest_error"] >= found["opening_time"]["error"] > 0
    assert found["opening_time"]["effects"]["network.fluid"]["at"] == ["n-heptane", "n-decane"]
    assert found["opening_time"]["shares"]["lift"]["total"] > 0.4
    for name, reason in (("end_time", "same value"), ("seat.9.time", "40 of 40 points")):
        assert reason in found[name]["reason"]
        assert found[name]["predictivity"] is None
        assert found[name]["shares"] == found[name]["effects"] == {}
    page = (out / "report.html").read_text(encoding="utf-8")
    for words in ("Surrogates: main effects", "No computed point is replaced", "n-decane"):
        assert words in page
    loaded = surrogates(klack.load_result(out).record)
    assert loaded["end_time"].reason == found["end_time"]["reason"]
    assert loaded["opening_time"].effects[0].mean.shape == (41,)
    assert "Each point predicted from the others" in told
    assert "The surrogate gives no shares and no main effects of 'end_time'" in told
    assert "Shares of the variance of end_time" not in told


@pytest.mark.slow
def test_few_points_are_doubted(tmp_path):
    text = STUDY.replace("points: 40", "points: 16")
    record = klack.run_study(SMALL, write(tmp_path, text)).record
    assert all("too few points: 16" in item.reason for item in record.surrogates)
    assert any("too few points" in note for note in record.warnings)


WRONG = [
    ("kind: sobol", "kind: grid", "a design that fills the ranges"),
    ("kind: sobol", "kind: one-at-a-time", "a design that fills the ranges"),
    ("kind: sobol", "kind: saltelli", "a design that fills the ranges"),
    ("kind: sobol", "kind: morris", "a design that fills the ranges"),
    ("kind: polynomial-chaos", "kind: kriging", "gaussian-process"),
    ("{kind: polynomial-chaos}", "{}", "kind"),
    (
        "points: 40}\n  surrogate: {kind: polynomial-chaos",
        "points: 501}\n  surrogate: {kind: gaussian-process",
        "at most 500 points",
    ),
    ("points: 40", "points: 10001", "at most 10000 points"),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_what_cannot_be_is_one_error_with_its_line(tmp_path, capsys, old, new, words):
    assert old in STUDY
    file = write(tmp_path, STUDY.replace(old, new))
    assert main(["study", str(SMALL), "--study", str(file), "--no-report"]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert f"{file}:" in said


def test_without_the_library_nothing_is_computed(tmp_path, capsys, monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "sklearn"]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "sklearn", None)
    out = tmp_path / "out"
    assert main(["study", str(SMALL), "--study", str(write(tmp_path)), "--out", str(out)]) == 2
    assert "uv sync --extra surrogate" in capsys.readouterr().err
    assert not (out / "result.zarr").exists()


def points_file(folder, rows):
    with (folder / "points.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow((PRELOAD, MASS, "lift"))
        table.writerows((f"{a!r} N", f"{b!r} g", f"{c!r} um") for a, b, c in rows)
    text = STUDY.replace("{kind: sobol, points: 40}", "{kind: file, file: points.csv}")
    return write(folder, text)


def drawn(count):
    u = np.random.default_rng(2).random((count, 3))
    z = np.clip(np.random.default_rng(3).standard_normal(count), -2.5, 2.5)
    return np.column_stack((10 + 4 * u[:, 0], 3 + 0.1 * z, 90 + 20 * u[:, 2])).round(4)


def levels(rows):
    rows[:, 0] = np.where(rows[:, 0] < 12, 10, 14)
    return rows


def crowded(rows):
    rows[:, 2] = 90 + 0.2 * (rows[:, 2] - 90)
    return rows


def outside(rows):
    rows[7, 2] = 120.0
    return rows


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (levels, "2 different values in 40 points"),
        (crowded, "the squared discrepancy of random points"),
        (outside, "lift: 1 values such as"),
    ],
)
def test_points_of_a_file_have_to_fill_the_ranges(tmp_path, capsys, change, words):
    file = points_file(tmp_path, change(drawn(40)).tolist())
    assert main(["study", str(SMALL), "--study", str(file), "--no-report"]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_drawn_points_of_a_file_serve(tmp_path):
    rows = drawn(40).tolist()
    record = klack.run_study(SMALL, points_file(tmp_path, [*rows, rows[3]])).record
    found = surrogates(record)["opening_time"]
    assert (found.points, found.repeated, found.reason) == (40, 1, "")
    assert np.isnan(found.residuals[40])


STUDY_POLISH = """klack: 1
study:
  parameters:
    network.components.spring.preload: {from: 10 N, to: 14 N}
    network.components.needle.mass: {from: 2.7 g, to: 3.3 g, scale: log}
    lift: {from: 90 um, to: 110 um}
  linked:
    network.components.opening.gap: lift
  measures: [opening_time]
  objectives: {opening.peak_force: minimise}
  constraints: {opening_time: {most: 165 us}}
  search: {population: 20, generations: 3, refinements: 0, polish: 20}
  variant: dry
"""
ROBUST = "  robust: {scatter: {network.components.spring.preload: 0.3 N}, valves: 4}\n"


def write_polish(folder: Path, text: str) -> Path:
    file = folder / "study.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("opening.peak_force:", "noise.loudness_max:", "noise.loudness_max'?, without"),
        ("lift: {from: 90 um, to: 110 um}", "lift: {values: [90 um, 110 um]}", "a list of values"),
        ("  variant: dry\n", f"  variant: dry\n{ROBUST}", "a robust search"),
        (
            "network.components.needle.mass: {from: 2.7 g, to: 3.3 g, scale: log}",
            "run.step: {from: 10 ns, to: 20 ns}",
            "run.step, a setting of the run",
        ),
    ],
)
def test_what_has_no_derivative_is_refused_before_the_first_run(old, new, words, tmp_path):
    pytest.importorskip("pymoo")
    assert old in STUDY_POLISH
    with pytest.raises(InputError, match=words) as caught:
        klack.optimise(
            SMALL, write_polish(tmp_path, STUDY_POLISH.replace(old, new)), folder=tmp_path / "out"
        )
    assert "search.polish" in caught.value.where
    assert not list(tmp_path.glob("out/points*"))


@pytest.mark.slow  # the loop with derivatives compiles for a minute
class TestPolish:
    def test_derivatives_are_those_of_the_unit_cube(self, tmp_path):
        """A range, a logarithmic one, a word that a key follows from; both signs."""
        case = klack.load_case(SMALL)
        source = study_of(case.checked, case.tree, write_polish(tmp_path, STUDY_POLISH))
        space = space_of(case.checked, source)
        names = ("opening.peak_force", "opening_time", "noise.force_level")
        asked = asked_of(case.checked, case.tree, source, [{}], names)
        slopes = require_gradients(source, asked, space)
        goals = Goals(
            objectives=names,
            signs=(-1.0, 1.0, 1.0),
            bounds=(Bound(measure="opening_time", value=165e-6, is_most=False),),
        )
        point = np.array([0.4, 0.6, 0.3])
        gradients = Gradients.of(asked, slopes, space, goals, silent)
        of_objectives, of_bounds = gradients.at(point)

        shares = [point + way * 0.05 * axis for axis in np.eye(3) for way in (1.0, -1.0)]
        written = [space.written(space.at(share)) for share in shares]
        table = klack.run_many(SMALL, written, names, variant="dry")
        force, time, level = ((table[name][::2] - table[name][1::2]) / 0.1 for name in names)
        largest = np.abs(force).max()
        np.testing.assert_allclose(of_objectives[0], -force, rtol=0.01, atol=0.01 * largest)
        np.testing.assert_allclose(of_objectives[1], time, rtol=0.01)
        # all bounces count in a level, those of the two strokes by 0.005 dB each
        np.testing.assert_allclose(of_objectives[2], level, atol=2 * 0.005 / 0.1)
        np.testing.assert_allclose(of_bounds[0], -time / 165e-6, rtol=0.01)
        assert gradients.notes == []

    def test_it_finds_what_a_search_without_derivatives_finds(self, tmp_path):
        pytest.importorskip("pymoo")
        polished = klack.optimise(SMALL, write_polish(tmp_path, STUDY_POLISH)).record
        text = STUDY_POLISH.replace("refinements: 0, polish: 20", "refinements: 300")
        searched = klack.optimise(SMALL, write_polish(tmp_path, text)).record
        found = []
        for record in (polished, searched):
            own = {item.name: item.values for item in record.measures}
            assert own["opening_time"][record.optimum.best] <= 165e-6
            found.append(own["opening.peak_force"][record.optimum.best])
        assert found[0] == pytest.approx(found[1], rel=1e-3)
        assert polished.count - 60 < 50
        assert "polished in 20 steps at most" in polished.design
        assert polished.warnings == ()

    def test_it_resumes(self, tmp_path):
        pytest.importorskip("pymoo")
        file, out = write_polish(tmp_path, STUDY_POLISH), tmp_path / "out"
        first = klack.optimise(SMALL, file, folder=out).record
        again = klack.optimise(SMALL, file, folder=out).record
        assert again.computed == 0
        assert again.optimum.best == first.optimum.best
