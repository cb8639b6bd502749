"""klack compare RESULT --measurement through main(argv), on the rigid valve of the how-to page.

Truth: the recording is the computed stroke itself, with noise, an offset or a gain put on it, so
that every residual is known beforehand: noise s leaves a scatter of s, an offset d a difference of
d, and the restitution is the one of the case.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.stroke.analysis import STROKE
from klack.cli.main import main

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
STROKES, NOISE, RATE = 3, 0.2e-6, 400e3
REST = 0.3e-3  # [s] before each stroke
SECTION = """
measurement:
  channels: {lift: Hub}
  trigger: {channel: lift, share: 20 %, before: 0.1 ms, after: 1.7 ms}
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> Path:
    """Folder with the computed strokes and the case that says how they were measured."""
    folder = tmp_path_factory.mktemp("measured")
    case = folder / "case.yaml"
    case.write_text(CASE.read_text() + SECTION)
    assert main(["stroke", str(case), "--out", str(folder), "--no-report", "-q"]) == 0
    return folder


def record(result: Path, path: Path, variant: str = "wet", **changes: float) -> Path:
    """Write strokes of the result behind each other, with semicolons and decimal commas."""
    run = STROKE.load(result).variants[variant].result
    lift = run.channels["needle.tip displacement"].values
    period = REST + float(run.time[-1])
    time = np.arange(0.0, changes.get("strokes", STROKES) * period, 1.0 / RATE)
    # the clock of the recorder is no multiple of the stroke
    shown = np.interp(time % period - REST, run.time, lift)
    shown = changes.get("gain", 1.0) * shown + changes.get("offset", 0.0)
    shown += NOISE * np.random.default_rng(7).standard_normal(time.size)
    rows = [
        f"{1e3 * t:.4f};{1e6 * x:.3f}".replace(".", ",") for t, x in zip(time, shown, strict=True)
    ]
    path.write_text("\n".join(["# made by a test", "Zeit;Hub", "ms;um", *rows]) + "\n")
    return path


def compared(result: Path, *words: str) -> dict:
    numbers = Path("numbers.json").absolute()
    assert main(["compare", str(result), *words, "--json", str(numbers), "--no-report", "-q"]) == 0
    return json.loads(numbers.read_text())


@pytest.mark.slow
def test_a_stroke_agrees_with_itself(result, tmp_path, capsys):
    path = record(result, tmp_path / "strokes.csv")
    numbers = tmp_path / "numbers.json"
    words = ["--measurement", str(path), "--json", str(numbers), "--no-report"]
    assert main(["compare", str(result), *words]) == 0
    found, out = json.loads(numbers.read_text()), capsys.readouterr().out

    assert found["variant"] == "wet"
    assert found["strokes"] == STROKES
    assert found["agreement"] == "excellent"
    # less than one stroke alone: the rest of the noise, and of the trigger's
    assert 0.4 * NOISE < found["lift_rms_m"] < NOISE
    # about the median of three the strokes scatter sqrt(2/3) as much, and more by the trigger
    assert 0.7 * NOISE < found["lift_rms_scatter_m"] < 1.3 * NOISE
    first = {impact["stop"]: impact for impact in reversed(found["impacts"])}
    assert set(first) == {"opening", "seat"}
    for impact in first.values():
        assert abs(impact["time_difference_in_scatter"]) < 2
        assert abs(impact["restitution_difference_in_scatter"]) < 2
        assert impact["restitution"] == pytest.approx(impact["restitution_measured"], abs=0.01)

    seat = next(shot for shot in found["highest_rebound"] if shot["stop"] == "seat")
    assert seat["stroke"].startswith("strokes.csv")
    assert seat["strokes"] == STROKES
    # the same stroke three times: what is above the others is reading error
    assert seat["rebound_height_m"] >= first["seat"]["rebound_height_measured_m"]
    assert seat["restitution"] == pytest.approx(0.5, abs=0.03)
    assert 0.0 <= seat["too_high_by_reading_m"] < 3.0 * seat["rebound_height_error_m"]
    assert abs(seat["above_median_m"]) < 3.0 * seat["rebound_height_error_m"]

    for part in (
        "highest rebound",
        "in std. dev.",
        "opening stop #1",
        f"Excellent agreement of 'wet' with {STROKES} measured strokes",
        "Rule: the agreement is excellent if",
        "Later impacts and the lift between the stops are shown, but not judged.",
    ):
        assert part in out


@pytest.mark.slow
def test_dry_impacts_have_the_restitution_of_the_case(result, tmp_path):
    path = record(result, tmp_path / "dry.csv", "dry")
    found = compared(result, "--measurement", f"dry={path}")

    assert list(found["variants"]) == ["dry"]
    first = {impact["stop"]: impact for impact in reversed(found["impacts"])}
    for impact in first.values():
        # medians of three readings with an error of 0.01 each
        assert impact["restitution"] == pytest.approx(0.5, abs=0.02)
        assert impact["restitution_measured"] == pytest.approx(0.5, abs=0.02)


@pytest.mark.slow
def test_an_offset_is_a_residual_until_the_sensor_has_it(result, tmp_path):
    away = 3e-6
    path = record(result, tmp_path / "strokes.csv", offset=away)
    case = tmp_path / "raw.yaml"
    case.write_text(CASE.read_text() + SECTION + "  zero: none\n")
    raw = compared(result, "--measurement", str(path), "--case", str(case))
    assert raw["lift_rms_m"] == pytest.approx(away, rel=0.05)
    assert raw["agreement"] == "none"

    case.write_text(CASE.read_text() + SECTION + "  zero: none\n  sensor: {offset: 3 um}\n")
    known = compared(result, "--measurement", str(path), "--case", str(case))
    assert known["lift_rms_m"] < NOISE
    assert known["agreement"] == "excellent"


@pytest.mark.slow
def test_lift_that_is_zeroed_forgets_the_offset(result, tmp_path):
    path = record(result, tmp_path / "strokes.csv", offset=3e-6)
    assert compared(result, "--measurement", str(path))["lift_rms_m"] < NOISE


@pytest.mark.slow
def test_one_stroke_has_no_scatter(result, tmp_path, capsys):
    """What strokes scatter is not known of one; differences are judged by its reading error."""
    path = record(result, tmp_path / "strokes.csv", strokes=1)
    found = compared(result, "--measurement", str(path))

    words = ["--measurement", str(path), "--out", str(tmp_path / "one")]
    assert main(["compare", str(result), *words]) == 0
    assert ", wet: 1 stroke " in capsys.readouterr().out
    page = (tmp_path / "one" / "report.html").read_text(encoding="utf-8")
    assert "1 measured stroke (" in page
    assert "1 stroke used" in page
    assert "highest measured rebound: wet" not in page  # of one, none is the highest
    assert found["strokes"] == 1
    assert "times the reading error" in found["verdict"]
    assert "does not show the scatter between strokes" in found["verdict"]
    for impact in found["impacts"]:
        assert impact["time_scatter_s"] is None
        expected = impact["time_difference_s"] / impact["time_reading_error_s"]
        assert impact["time_difference_in_scatter"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_another_lift_is_told_from_the_computed_one(result, tmp_path):
    found = compared(
        result, "--measurement", str(record(result, tmp_path / "strokes.csv", gain=1.05))
    )
    assert found["agreement"] == "none"
    assert "No agreement" in found["verdict"]
    assert found["lift_difference_m"] == pytest.approx(-5e-6, rel=0.05)
    for impact in found["impacts"]:
        width = max(impact["time_scatter_s"], impact["time_reading_error_s"])
        expected = (impact["time_s"] - impact["time_measured_s"]) / width
        assert impact["time_difference_in_scatter"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_both_variants_and_the_report(result, tmp_path):
    wet = record(result, tmp_path / "wet.csv")
    dry = record(result, tmp_path / "dry.csv", "dry")
    words = ["compare", str(result), "--measurement", str(wet), "--measurement", f"dry={dry}"]
    assert main([*words, "-q"]) == 0
    folder = result / "measured"
    assert (folder / "report.pdf").read_bytes().startswith(b"%PDF")
    page = (folder / "report.html").read_text()
    for words in (
        "Side by side",
        "The whole stroke: wet",
        "First impacts: dry",
        "Rule:",
        "5 to 95 %",
    ):
        assert words in page

    (folder / "report.html").unlink()
    assert main(["report", str(folder), "-q"]) == 0
    assert "Side by side" in (folder / "report.html").read_text()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "neither of them"),
        (("--measurement", "a.csv", "--calculix", "b.dat"), "both of them"),
        (("--measurement", "nowhere.csv"), "no such file"),
        (("--measurement", "{here}", "--variant", "dry"), "Try: --measurement dry=FILE"),
        (("--measurement", "dry=nowhere.csv"), "VARIANT=FILE"),
        (("--measurement", "wet-lumped={here}"), "without the variant 'wet-lumped'"),
        (("--measurement", "{here}", "--case", "nowhere"), "neither a file nor a shipped case"),
    ],
)
def test_wrong_words_are_one_message(result, tmp_path, capsys, words, told):
    here = str(record(result, tmp_path / "strokes.csv"))
    words = [word.replace("{here}", here) for word in words]
    assert main(["compare", str(result), *words, "-q"]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert "Traceback" not in error


def test_a_trigger_that_the_model_never_meets(result, tmp_path, capsys):
    path = record(result, tmp_path / "strokes.csv", gain=2.0)
    case = tmp_path / "high.yaml"
    case.write_text(CASE.read_text() + SECTION.replace("share: 20 %", "level: 150 um"))
    assert main(["compare", str(result), "--measurement", str(path), "--case", str(case)]) == 1
    assert "never crosses the trigger level" in capsys.readouterr().err
