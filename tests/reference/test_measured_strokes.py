"""The shipped synthetic measurement beside the model.

Truth: the values with which the strokes were computed (``cases/measured/truth.yaml``).  With them
the model agrees within the scatter, and the lift as far as the noise allows: the median of n
strokes with noise s is off by ``1.25 s / sqrt(n)`` (Laplace).  With the nominal values it does not.
"""

import re
from io import StringIO
from math import sqrt
from pathlib import Path

import pytest
from pages import blocks, printed
from ruamel.yaml import YAML

from klack.analyses.comparison.record import MeasuredStrokeStudy
from klack.analyses.comparison.strokes import compare_strokes
from klack.analyses.comparison.strokes_summary import MEASURED_STROKES, agreement
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case, read_valve_case
from klack.case.key_path import quantity_at, split_path
from klack.case.reader import shipped_cases
from klack.case.valve import ValveCase
from klack.measurement.loading import load_stroke_set

CASE = shipped_cases()["measured"]
FOLDER = CASE.parent
WET, DRY = FOLDER / "strokes_synthetic.csv", FOLDER / "dry_strokes_synthetic.csv"
TRUTH = YAML(typ="safe").load((FOLDER / "truth.yaml").read_text(encoding="utf-8"))
PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "measurements.md").read_text()
STROKES, NOISE = 10, 1e-6  # as the header of the file says
UNITS = {"preload": "N", "friction": "N", "film_gap": "m", "damping": "", "offset": "m"}


def with_truth() -> ValveCase:
    """The case with the hidden values in the place of its own."""
    yaml = YAML(typ="safe")
    case = yaml.load(CASE.read_text(encoding="utf-8"))
    for name, parameter in case["calibration"]["parameters"].items():
        *path, last = parameter["key"].split(".")
        node = case
        for part in path:
            node = node[part]
        node[last] = f"{TRUTH[name]!r} {UNITS[name]}".strip()
    text = StringIO()
    yaml.dump(case, text)
    return read_valve_case(text.getvalue(), FOLDER / "hidden.yaml")


def test_the_truth_names_what_is_calibrated_and_differs_from_the_case():
    case = load_valve_case(CASE)
    assert case.calibration is not None
    assert set(TRUTH) == set(case.calibration.parameters)
    for name, parameter in case.calibration.parameters.items():
        (key,) = parameter.key
        nominal = quantity_at(case, split_path(key)).value
        assert TRUTH[name] != pytest.approx(nominal, rel=0.03)


def test_every_file_says_that_it_is_synthetic():
    assert [path.name for path in FOLDER.glob("strokes_synthetic.*")] == [WET.name]
    files = sorted(FOLDER.glob("*.csv"))
    assert len(files) == 3
    for path in files:
        assert "synthetic" in path.name
        with path.open(encoding="utf-8") as lines:
            assert next(lines).startswith("# SYNTHETIC: ")
        assert path.stat().st_size < 1.5e6


def test_the_record_is_cut_into_its_strokes():
    section = load_valve_case(CASE).measurement
    strokes = load_stroke_set([WET], section)
    assert strokes.count == STROKES
    assert not strokes.rejected
    assert set(strokes.roles) == {"lift", "current", "pressure"}
    rest = strokes.matrix("lift")[:, strokes.time < -20e-6]
    # the offset of the sensor, with a drift of 0.6 um over the set
    assert rest.mean() == pytest.approx(TRUTH["offset"], abs=0.2e-6)
    assert rest.std(axis=1).mean() == pytest.approx(NOISE, rel=0.1)


@pytest.fixture(scope="module")
def hidden() -> MeasuredStrokeStudy:
    case = with_truth()
    study = run_stroke(case, variants=("wet", "dry"))
    return compare_strokes(study, {"wet": [WET], "dry": [DRY]}, case.measurement)


@pytest.mark.slow
def test_hidden_values_agree_with_the_measurement(hidden):
    wet, dry = hidden.variants["wet"], hidden.variants["dry"]
    assert (wet.count, dry.count) == (STROKES, 6)
    assert agreement(hidden, wet) == agreement(hidden, dry) == "excellent"
    # more by what the scatter of preload and friction bends, in late bounces most of all
    assert wet.lift_rms == pytest.approx(1.25 * NOISE / sqrt(STROKES), rel=0.15)
    assert wet.lift_scatter == pytest.approx(NOISE, rel=0.15)
    for variant in (wet, dry):
        for stop in ("opening", "seat"):
            first = variant.first(stop)
            assert first is not None
            assert first.restitution.difference == pytest.approx(0.0, abs=0.02)
            # after thirty bounces on the stop the dry closing depends on the steps: 2732 to 2739 us
            chaotic = variant is dry and stop == "seat"
            assert first.time.difference == pytest.approx(0.0, abs=8e-6 if chaotic else 2e-6)


@pytest.mark.slow
def test_nominal_values_do_not(hidden):
    case = load_valve_case(CASE)
    study = run_stroke(case, variants=("wet",))
    found = compare_strokes(study, {"wet": [WET]}, case.measurement)
    wet = found.variants["wet"]
    assert agreement(found, wet) == "none"
    assert wet.lift_rms > 10 * hidden.variants["wet"].lift_rms
    first = wet.first("opening")
    assert first is not None
    row = re.search(r"\| rebound height \[um\] \| ([\d.]+) \| ([\d.]+) \|", PAGE)
    assert row is not None
    # the last digits may differ with the version of the mesher
    height = first.rebound_height
    assert 1e6 * height.computed == pytest.approx(float(row.group(1)), rel=5e-3)
    assert 1e6 * height.measured == pytest.approx(float(row.group(2)), rel=5e-3)


@pytest.mark.slow
def test_the_python_example_of_the_page_runs(hidden, tmp_path, monkeypatch):
    MEASURED_STROKES.save(hidden, tmp_path / "klack-results" / "measured" / "measured")
    monkeypatch.chdir(tmp_path)
    told = printed(blocks(PAGE, "python")[0], "measurements.md")
    rms, scatter, over = map(float, told.split())
    assert rms == hidden.variants["wet"].lift_rms
    assert rms < scatter
    assert abs(over) < 2


def test_the_section_on_the_page_is_that_of_the_case():
    block = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert block is not None
    shown = YAML(typ="safe").load(block.group(1))["measurement"]
    stated = YAML(typ="safe").load(CASE.read_text(encoding="utf-8"))["measurement"]
    del stated["channels"]["pressure"]
    assert shown == stated


def test_the_files_of_the_page_are_there():
    named = re.findall(r"cases/measured/\w+\.csv", PAGE)
    assert {name.rsplit("/", 1)[-1] for name in named} == {p.name for p in FOLDER.glob("*.csv")}
