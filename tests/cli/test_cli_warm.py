"""``klack warm``: truth = the number of functions that a command compiles after it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from klack.case.valve_reader import load_valve_case
from klack.cli.main import main
from klack.errors import KlackError
from klack.network.step_function import is_step_function
from klack.warming.groups import GROUPS, all_steps

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
# an output stage with capacitor, gas, several free volumes at the start, three dimensions
STROKES = (
    *("demo-stroke", "measured"),
    *(
        HOW_TO / f"{name}.yaml"
        for name in ("boost_driver", "pneumatic_valve", "common_rail", "half_section_stroke")
    ),
)
COUNT = """
import sys
from klack.warming.counted import counted
from klack.cli.main import main
with counted() as count:
    code = main(sys.argv[1:])
print(code, count.functions)
"""


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Run it once, with whatever the store of this machine holds already."""
    file = tmp_path_factory.mktemp("warm") / "warm.json"
    command = [sys.executable, "-m", "klack", "warm", "--json", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(file.read_text()), done.stdout


def compiled_by(*words, out=None):
    command = [sys.executable, "-c", COUNT, *map(str, words), "--quiet"]
    if out is not None:
        command += ["--no-report", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=True)
    code, functions = done.stdout.split()[-2:]
    assert code == "0", done.stderr
    return int(functions)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_every_step_of_the_valves_of_the_how_to_pages_is_in_a_group():
    """Wherever its file is; steps of the user's own and of other programs are compiled by none."""
    known, found = all_steps(), set()
    for path in sorted(HOW_TO.glob("*.yaml")):
        try:
            rows = load_valve_case(path).network.network().rows()
        except KlackError:  # a study, an impact, or a valve with bodies
            continue
        found |= {row.step for row in (*rows.elements, *rows.branches)}

    found = {step for step in found if is_step_function(step)}
    assert len(found) > 15
    assert found <= known


@pytest.mark.slow
def test_it_says_what_was_compiled_and_where(warm):
    numbers, said = warm

    assert numbers["schema"] == "klack-warm/1"
    assert numbers["folder"] in said
    assert numbers["count"] > 150
    assert numbers["size_B"] > 1e6
    assert set(numbers["groups"]) == set(GROUPS)


@pytest.mark.slow
def test_a_second_time_compiles_nothing(warm, capsys):
    assert main(["warm", "--json", "-"]) == 0

    again = json.loads(capsys.readouterr().out)
    assert not any(group["compiled"] for group in again["groups"].values())
    assert again["count"] >= warm[0]["count"]  # other processes may add to the store


@pytest.mark.parametrize("case", STROKES, ids=lambda case: Path(case).stem)
@pytest.mark.slow
def test_strokes_of_shipped_cases_compile_nothing(warm, tmp_path, case):
    assert compiled_by("stroke", case, "--duration", "0.1 ms", out=tmp_path / "out") == 0


@pytest.mark.slow
def test_impacts_compile_nothing(warm, tmp_path):
    words = ("impact", "two-rods", "--level", "reduced,interface")
    assert compiled_by(*words, out=tmp_path / "out") == 0


@pytest.mark.slow
def test_derivatives_of_a_valve_compile_nothing(warm, tmp_path):
    valve, parameter = HOW_TO / "small_valve.yaml", "network.components.spring.preload"

    assert compiled_by("linearise", valve, out=tmp_path / "out") == 0
    assert compiled_by("sensitivities", valve, "--parameter", parameter) == 0


def test_no_folder_is_a_clear_error(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))

    assert main(["warm"]) == 2

    problem = capsys.readouterr().err
    assert str(tmp_path / "file") in problem
    assert "NUMBA_CACHE_DIR" in problem
