"""``klack heat``: tables, files, JSON and report of a warm-up and of soaked strokes."""

import csv
import json
from math import isfinite

import pytest

import klack
from klack.analyses.heat.summary import HEAT
from klack.cli.main import main
from klack.verification.heat import SMALL


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SMALL.replace("duration: 1 s", "duration: 0.3 s"), encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_warm_up_with_its_files(case, tmp_path, capsys):
    assert main(["heat", str(case), "--json", "heat.json", "--no-report"]) == 0

    said = capsys.readouterr().out
    assert "Warm-up, dry, a stroke every 20 ms" in said
    assert "resistance of the copper" in said
    folder = tmp_path / "klack-results" / "small-heat"
    made = {path.name for path in folder.iterdir()}
    assert {"heat.csv", "heat-causes.csv", "warm-up.png", "result.zarr"} <= made
    assert "heat.unfinished.jsonl" not in made
    numbers = json.loads((tmp_path / "heat.json").read_text())
    with (folder / "heat.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time [s]"]) for row in rows] == numbers["time_s"]
    copper = numbers["temperature_K"]["copper"]
    assert [float(row["copper temperature [K]"]) for row in rows] == copper
    assert copper[0] == 293.15
    assert copper[-1] > copper[0] + 1.0
    heat = sum(numbers["supplied_J"].values())
    spent = sum(numbers["stored_J"].values()) + sum(numbers["given_off_J"].values())
    assert heat == pytest.approx(spent, rel=1e-9)
    record = klack.load_result(folder).record
    assert (record.case, record.end) == ("small", "duration")
    assert [section.title for section in HEAT.content(record).sections][:4] == [
        "Over time",
        "Causes",
        "Points",
        "Where the heat went",
    ]


@pytest.mark.slow
def test_soaked_strokes_with_their_causes(case, tmp_path, capsys):
    soak = "-30 degC, 80 degC, -30 degC"
    assert main(["heat", str(case), "--soak", soak, "--json", "-", "-q", "--no-report"]) == 0

    numbers = json.loads(capsys.readouterr().out)
    assert numbers["temperature_K"]["valve"] == [243.15, 353.15]
    assert [(row["state"], row["cause"]) for row in numbers["causes"]] == [
        ("20 °C", "base"),
        *(("-30 °C", cause) for cause in ("copper", "gaps", "all")),
        *(("80 °C", cause) for cause in ("copper", "gaps", "all")),
    ]
    closing = {
        (row["state"], row["cause"]): row["numbers"]["closing delay"] for row in numbers["causes"]
    }
    assert all(map(isfinite, closing.values()))
    assert closing["-30 °C", "copper"] > closing["20 °C", "base"] > closing["80 °C", "copper"]
    assert numbers["strokes"]["closing delay"]["values"] == [
        closing["-30 °C", "all"],
        closing["80 °C", "all"],
    ]


WRONG = {
    "no unit": (["--soak", "20"], "without unit"),
    "below zero": (["--soak", "-300 degC"], "one above 0 K"),
    "both": (["--soak", "20 degC", "--duration", "1 s"], "a duration together with --soak"),
    "no time": (["--duration", "0 s"], "above 0 s"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_option_is_one_error(name, case, capsys):
    options, said = WRONG[name]

    assert main(["heat", str(case), *options]) == 2
    assert said in capsys.readouterr().err
