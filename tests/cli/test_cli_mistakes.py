"""Mistakes in a case are told at once; truth: the exit code, the key, and what was not loaded."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pages import HOW_TO

from klack.cli.main import main

CASES = Path(__file__).parents[2] / "cases"

IMPACT = ("impact", "noise", "reduce", "advise --error=2%", "study", "optimise", "show")
IMPACT += ("export --to=mat", "export --to=calculix", "sensitivities")
STROKE = ("stroke", "shots", "study", "optimise", "show", "noise", "advise --error=2%")
STROKE += ("export --to=fmu", "linearise", "heat", "calibrate --strokes=1 --measurement={file}")
STROKE += ("sensitivities",)

SMALL = "{search: {population: 6}, parameters: {motion.speed: 1 m/s}, measures: [peak_force]}"

RUN = """
import json, sys
from klack.cli.main import main
heavy = {"numba", "scipy.optimize", "scipy.sparse", "netgen", "zarr", "matplotlib"}
for words in json.loads(sys.argv[1]):
    print(main(words), *sorted(heavy & set(sys.modules)), flush=True)
"""


@pytest.fixture
def written(tmp_path):
    """Write a case anew, with one piece of its text exchanged; return its path."""

    def write(case: str, old: str, new: str) -> str:
        text = (CASES / case / "case.yaml").read_text("utf-8")
        assert old in text
        file = tmp_path / f"{case}-{len(list(tmp_path.iterdir()))}.yaml"
        file.write_text(text.replace(old, new, 1), "utf-8")
        return str(file)

    return write


def test_a_mistake_is_told_before_anything_heavy_is_loaded(written, tmp_path):
    """Else it takes seconds, or the time of a first mesh, until one hears of a misspelt key."""
    impact = written("two-rods", "motion:", "motoin:")
    stroke = written("demo-stroke", "network:", "netwerk: {}\nnetwork:")
    file = tmp_path / "strokes.csv"
    file.write_text("", "utf-8")
    asked = [
        *([words.split()[0], impact, *words.split()[1:]] for words in IMPACT),
        *([words.split()[0], stroke, *words.format(file=file).split()[1:]] for words in STROKE),
        ["impact", "two-rods", "--level", "reducde"],
        ["optimise", written("two-rods", "motion:", f"study: {SMALL}\nmotion:")],
    ]
    command = [sys.executable, "-c", RUN, json.dumps(asked)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path)

    assert done.stdout.split("\n")[:-1] == ["2"] * len(asked), done.stderr
    told = done.stderr.split("klack ")
    for words in ("motoin", "netwerk", "reducde", "population"):
        assert any(words in text for text in told), done.stderr


def test_a_search_for_nothing_computes_nothing(monkeypatch, capsys):
    monkeypatch.setattr("klack.analyses.study.optimise.asked_of", pytest.fail)

    assert main(["optimise", "demo-stroke"]) == 2
    assert "no objectives" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["linearise", "stroke --steady", "advise", "sensitivities"])
def test_commands_of_the_axis_alone_refuse_a_motion_in_space(command, capsys):
    name, *options = command.split()

    assert main([name, str(HOW_TO / "armature_off_axis.yaml"), *options]) == 2
    told = capsys.readouterr().err
    assert f"armature_off_axis.yaml: motion: got 'three-dimensional' in klack {command}" in told
