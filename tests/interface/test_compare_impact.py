"""klack compare of an impact with recordings of a sensor: options, files, errors.

Truth: the recordings are the computed output itself, scaled and moved.
"""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.comparison.impacts_summary import MEASURED_IMPACT
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.run import run_impact
from klack.case import read_case
from klack.cli.main import main
from klack.exchange.results.study_table import result_table

CASE = (Path(__file__).parents[1] / "data" / "struck_rod.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("struck")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = run_impact(read_case(CASE, folder / "case.yaml"), levels=["full"], certify=False)
    IMPACT.save(study, folder)
    (folder / "case.yaml").write_text(CASE, encoding="utf-8")
    return folder


def recording(path: Path, result: Path, factor: float = -1.5, unit: str = "um/m") -> Path:
    record = IMPACT.load(result).levels["full"].gauges[0]
    table = np.column_stack([record.time - 3e-6, 1e6 * factor * record.values])
    np.savetxt(path, table, delimiter=",", header=f"time [s],strain [{unit}]", comments="")
    return path


@pytest.mark.slow
def test_the_same_pulse_is_found_again(result, tmp_path, capsys):
    files = [str(recording(tmp_path / f"{k}.csv", result, -1.5 - 0.1 * k)) for k in range(2)]
    table = tmp_path / "numbers.json"
    code = main(["compare", str(result), "--measurement", *files, "--output", "front",
                 "--out", str(tmp_path / "out"), "--json", str(table)])  # fmt: skip

    assert code == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Against 2 recordings" in text
    assert "the height of a pulse is not a prediction" in text
    found = json.loads(table.read_text())
    assert found["schema"] == "klack-compare-impact/1"
    for pulse, factor in zip(found["pulses"], (1.5, 1.6), strict=True):
        assert pulse["factor"] == pytest.approx(factor, rel=1e-3)
        assert pulse["length_difference"] == pytest.approx(0.0, abs=1e-3)
        assert pulse["rms"] < 1e-3
    stored = MEASURED_IMPACT.load(tmp_path / "out")
    assert stored.measured.shape == (2, len(stored.time))
    assert (tmp_path / "out" / "report.html").is_file()


def test_a_known_speed_keeps_the_factor(result, tmp_path, capsys):
    file = recording(tmp_path / "shot.csv", result, -1.5)
    code = main(["compare", str(result), "--measurement", str(file), "--output", "front",
                 "--known-speed", "--no-report", "--out", str(tmp_path / "out")])  # fmt: skip

    assert code == 0
    assert "No factor was fitted" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_outputs_are_in_files_reports_and_json(result, tmp_path):
    assert main(["export", str(result), "--to", "csv", "--out", str(tmp_path), "--quiet"]) == 0
    text = "".join(path.read_text() for path in tmp_path.rglob("*.csv"))
    assert "output front" in text
    assert "output stress" in text
    study = IMPACT.load(result)
    record = study.levels["full"].gauges[0]
    table = result_table(study).runs[0].channel("output front")
    np.testing.assert_array_equal(table.values, record.values)
    assert (table.unit, table.meaning) == ("1", record.label)
    outputs = IMPACT.to_json(study)["levels"]["full"]["outputs"]
    assert outputs["front"]["lowest"] == record.values.min()
    assert outputs["stress"]["unit"] == "Pa"
    charts = [chart.name for part in IMPACT.content(study).sections for chart in part.charts]
    assert {"output-front", "output-stress"} <= set(charts)


def test_python_compares_the_same(result, tmp_path):
    file = recording(tmp_path / "shot.csv", result)
    record = klack.compare(klack.load_result(result), file, output="front").record

    assert record.pulses[0].factor == pytest.approx(1.5, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ([], "several outputs"),
        (["--output", "back"], "expected one of: front, stress"),
        (["--output", "front", "--channel", "hub"], "no channel 'hub'"),
        (["--output", "front", "--level", "reduced"], "no level 'reduced'"),
    ],
)
def test_what_is_not_there_is_said(result, tmp_path, capsys, options, text):
    file = recording(tmp_path / "shot.csv", result)

    assert main(["compare", str(result), "--measurement", str(file), *options]) == 2
    assert re.search(text, " ".join(capsys.readouterr().err.split()))


def test_a_record_without_a_plateau_or_with_volts_is_an_error(result, tmp_path, capsys):
    time = np.linspace(-20e-6, 40e-6, 400)
    bell = tmp_path / "bell.csv"
    np.savetxt(bell, np.column_stack([time, np.exp(-((time / 8e-6) ** 2))]), delimiter=",",
               header="time [s],strain", comments="")  # fmt: skip
    volts = recording(tmp_path / "volts.csv", result, unit="V")

    for file, text in ((bell, "no plateau"), (volts, "the unit 'V'"), (tmp_path / "x", "no such")):
        assert main(["compare", str(result), "--measurement", str(file), "--output", "front"]) == 2
        assert text in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("unit", "factor", "said", "not_said"),
    [
        ("um/m", -1.5, "If the recordings are absolute, the speeds were", "without a unit"),
        ("", -1.5, "A recording without a unit, or with an unknown scale", "absolute"),
        ("um/m", -4000.0, "The recordings are not absolute", "If the recordings"),
    ],
)
def test_a_speed_is_said_only_where_it_can_be_true(
    result, tmp_path, capsys, unit, factor, said, not_said
):
    file = recording(tmp_path / "shot.csv", result, factor, unit)
    assert main(["compare", str(result), "--measurement", str(file), "--output", "front",
                 "--no-report", "--out", str(tmp_path / "out")]) == 0  # fmt: skip
    text = " ".join(capsys.readouterr().out.split())
    assert said in text
    assert not_said not in text


@pytest.mark.parametrize(
    ("row", "text", "said"),
    [
        (51, None, "a time that does not increase: .* at row 51 of its numbers"),
        (51, "2e6,1", "a time that does not increase: .* at row 52 of its numbers"),
        (51, "nan,1", "a time that does not increase: no value at row 51 of its numbers"),
    ],
)
def test_a_time_that_cannot_be_is_told_with_its_row(result, tmp_path, capsys, row, text, said):
    file = recording(tmp_path / "shot.csv", result)
    lines = file.read_text().splitlines()  # the names are line 0
    lines[row] = lines[row - 1] if text is None else text
    file.write_text("\n".join(lines))
    assert main(["compare", str(result), "--measurement", str(file), "--output", "front"]) == 2
    assert re.search(said, " ".join(capsys.readouterr().err.split()))


def test_missing_values_of_a_pulse_are_told_with_the_first(result, tmp_path):
    file = recording(tmp_path / "shot.csv", result)
    lines = file.read_text().splitlines()
    for row, value in ((21, "inf"), (40, "nan")):
        lines[row] = lines[row].split(",")[0] + "," + value
    file.write_text("\n".join(lines))
    record = klack.compare(klack.load_result(result), file, output="front").record
    assert any(
        "2 missing values of 'strain' left out, the first at row 21" in n for n in record.notes
    )
