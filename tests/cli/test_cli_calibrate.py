"""klack calibrate: result folder, calibrated case, JSON, going on after an interruption, errors."""

import json
import sys

import numpy as np
import pytest
from rigid_valve import write_bench

from klack.analyses.calibration.analysis import CALIBRATION
from klack.analyses.calibration.motion import TRIAL_LOG, MotionModel
from klack.case.any_case import load_valve_case
from klack.cli.main import main

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A case and a file of three strokes, one column each."""
    folder = tmp_path_factory.mktemp("bench")
    write_bench(folder, 5, 3)
    return folder


def command(bench, out, *more):
    return [
        "calibrate",
        str(bench / "valve.yaml"),
        "--measurement",
        str(bench / "strokes.csv"),
        "--out",
        str(out),
        "--workers",
        "1",
        *more,
    ]


@pytest.fixture(scope="module")
def done(bench, tmp_path_factory):
    out = tmp_path_factory.mktemp("done") / "result"
    assert main(command(bench, out, "--json", str(out.parent / "numbers.json"), "--quiet")) == 0
    return out


def test_all_of_it_lies_in_the_folder(done):
    names = {path.name for path in done.iterdir()}
    assert names == {"result.zarr", "case_calibrated.yaml", "report.html", "report.pdf"}
    page = (done / "report.html").read_text()
    assert "Calibration to measured strokes" in page
    assert "preload" in page
    assert (done / "report.pdf").read_bytes().startswith(b"%PDF")


def test_json_has_values_errors_and_units_in_si(done):
    data = json.loads((done.parent / "numbers.json").read_text())
    assert list(data["parameters"]) == ["preload", "friction", "offset"]
    preload = data["parameters"]["preload"]
    assert preload["unit"] == "N"
    assert preload["start"] == 11.0
    assert preload["value"] == pytest.approx(12.4, abs=5 * preload["standard_error"])
    assert preload["lower_95"] < preload["value"] < preload["upper_95"]
    assert data["residual_rms_um"] < 0.5  # of the mean of three strokes with 0.5 um noise
    assert data["evaluations"] > 10
    assert np.array(data["correlation"]).shape == (3, 3)


def test_stored_study_is_the_one_of_the_json(done):
    study = CALIBRATION.load(done)
    data = json.loads((done.parent / "numbers.json").read_text())
    for item in study.parameters:
        assert data["parameters"][item.name]["value"] == item.value


def test_calibrated_case_holds_the_values_and_runs(done, tmp_path):
    text = (done / "case_calibrated.yaml").read_text()
    assert text.startswith("# Calibrated by klack")
    assert "to 3 strokes of strokes.csv" in text
    assert text.endswith("  # the end\n")
    case = load_valve_case(done / "case_calibrated.yaml")
    found = {item.name: item.value for item in CALIBRATION.load(done).parameters}
    assert case.network.components["spring"].preload == pytest.approx(found["preload"], rel=1e-6)
    assert case.measurement.sensor.offset == pytest.approx(found["offset"], rel=1e-6)
    run = ["stroke", str(done / "case_calibrated.yaml"), "--out", str(tmp_path), "--no-report"]
    assert main([*run, "--quiet"]) == 0


def test_an_interrupted_calibration_goes_on_to_the_same_bits(
    bench, done, tmp_path, monkeypatch, capsys
):
    run, calls = MotionModel.run, []

    def interrupted(self, values, duration):
        calls.append(values)
        if len(calls) == 9:
            raise KeyboardInterrupt
        return run(self, values, duration)

    monkeypatch.setattr(MotionModel, "run", interrupted)
    assert main(command(bench, tmp_path, "--no-report", "--quiet")) == 130
    assert "8 computed strokes are kept" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {TRIAL_LOG.file}
    with (tmp_path / TRIAL_LOG.file).open("ab") as file:
        file.write(b'{"trial": [0.001')  # cut off in the middle of a line

    monkeypatch.setattr(MotionModel, "run", run)
    assert main(command(bench, tmp_path, "--no-report", "--quiet")) == 0
    again, before = CALIBRATION.load(tmp_path), CALIBRATION.load(done)
    assert again.resumed == 8
    assert again.evaluations == before.evaluations
    for a, b in zip(again.parameters, before.parameters, strict=True):
        assert (a.value, a.standard_error) == (b.value, b.standard_error)
    assert not (tmp_path / TRIAL_LOG.file).exists()


def test_the_report_is_made_again_from_the_result(done, tmp_path):
    assert main(["report", str(done), "--out", str(tmp_path), "--quiet"]) == 0
    assert "Calibration to measured strokes" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("calibration:", None, "got no section 'calibration'"),
        (", offset: 0 um", "", "write 'offset: 0.0 m' there"),
        ("  variant: dry\n", "  variant: dry\n  channels: [lift, current]\n", "'current'"),
    ],
)
def test_mistakes_are_one_message(bench, tmp_path, capsys, old, new, words):
    text = (bench / "valve.yaml").read_text()
    assert old in text
    text = text[: text.index(old)] if new is None else text.replace(old, new)
    (tmp_path / "valve.yaml").write_text(text)
    args = command(bench, tmp_path / "out", "--quiet")
    assert main([args[0], str(tmp_path / "valve.yaml"), *args[2:]]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Try:" in error


def test_a_lift_that_counts_backwards_is_refused(bench, tmp_path, capsys):
    table = np.loadtxt(bench / "strokes.csv", delimiter=",", skiprows=1)
    head = (bench / "strokes.csv").read_text().splitlines()[0]
    table[:, 1:] *= -1.0
    np.savetxt(tmp_path / "strokes.csv", table, "%.9e", ",", header=head, comments="")
    (tmp_path / "valve.yaml").write_text((bench / "valve.yaml").read_text())

    assert main(command(tmp_path, tmp_path / "out", "--quiet")) == 2
    assert "a lift that moves against the computed one" in capsys.readouterr().err


def test_a_missing_file_is_named(bench, tmp_path, capsys, monkeypatch):
    args = command(bench, tmp_path / "out", "--quiet")
    args[3] = str(tmp_path / "nothing.csv")
    monkeypatch.setitem(sys.modules, "klack.case.any_case", None)  # nothing long has begun
    assert main(args) == 2
    assert "nothing.csv" in capsys.readouterr().err
