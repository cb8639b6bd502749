"""``klack cache`` and ``klack warm``.

``klack cache``: truth = the folder as it is, and the exit codes that the command promises.

``klack warm``: truth = the number of functions that a command compiles after it.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from klack.case.any_case import load_valve_case
from klack.cli.main import main
from klack.errors import KlackError
from klack.machine.cache.entry import Entry
from klack.machine.cache.result_cache import result_cache
from klack.network.step_function import is_step_function
from klack.warming.groups import GROUPS, all_steps


@pytest.fixture
def filled(tmp_path, monkeypatch):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "cache"))
    for n in range(3):
        result_cache().store(f"{n:064x}", Entry(arrays={}, text="x" * 1000))
    return tmp_path / "cache"


@pytest.mark.slow
def test_it_says_where_how_many_and_how_large(filled, capsys):
    assert main(["cache", "--json", "-"]) == 0

    out, words = capsys.readouterr()
    size = sum(path.stat().st_size for path in filled.glob("*.entry"))
    assert json.loads(out) == {
        "schema": "klack-cache/1",
        "folder": str(filled),
        "count": 3,
        "size_B": size,
        "limit_B": 5_000_000_000,
    }
    assert str(filled) in words
    assert "3, 3.47 kB of at most 5 GB" in words


def test_clear_deletes_the_results_and_nothing_else(filled, capsys):
    (filled / "mine.txt").write_text("mine")

    assert main(["cache", "--clear"]) == 0

    assert "Deleted 3 results, 3.47 kB" in capsys.readouterr().out
    assert sorted(path.name for path in filled.iterdir()) == ["CACHEDIR.TAG", "mine.txt"]
    assert main(["cache", "--clear"]) == 0
    assert "Deleted 0 results" in capsys.readouterr().out


def test_an_absent_folder_is_empty_and_not_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "none"))

    assert main(["cache"]) == 0

    assert "Results: 0" in capsys.readouterr().out
    assert not (tmp_path / "none").exists()


def test_off_is_said(monkeypatch, capsys):
    monkeypatch.setenv("KLACK_CACHE", "off")

    assert main(["cache", "--json", "-"]) == 0

    out, words = capsys.readouterr()
    assert json.loads(out)["folder"] is None
    assert "off" in words


def test_a_wrong_size_is_bad_input(monkeypatch, capsys):
    monkeypatch.setenv("KLACK_CACHE", "somewhere")
    monkeypatch.setenv("KLACK_CACHE_SIZE", "plenty")

    assert main(["cache"]) == 2

    assert "KLACK_CACHE_SIZE: got 'plenty'" in capsys.readouterr().err


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
import json, sys
from klack.warming.run import counted
from klack.cli.main import main
for words in json.loads(sys.argv[1]):
    with counted() as count:
        code = main(words)
    print(code, count.functions, *words)
"""


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Run it once, with whatever the store of this machine holds already."""
    file = tmp_path_factory.mktemp("warm") / "warm.json"
    command = [sys.executable, "-m", "klack", "warm", "--json", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(file.read_text()), done.stdout


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
def test_what_comes_after_it_compiles_nothing(warm, tmp_path):
    """The same again, strokes, an impact at two levels, derivatives: in one new process.

    The commands come first: what they load is what the store holds for them.
    """
    valve, parameter = HOW_TO / "small_valve.yaml", "network.components.spring.preload"
    again = tmp_path / "again.json"
    kept = ["--quiet", "--no-report", "--out", str(tmp_path / "out")]
    commands = [
        *(["stroke", str(case), "--duration", "0.1 ms", *kept] for case in STROKES),
        ["impact", "two-rods", "--level", "reduced,interface", *kept],
        ["linearise", str(valve), *kept],
        ["sensitivities", str(valve), "--parameter", parameter, *kept],
        ["warm", "--quiet", "--json", str(again)],
    ]
    program = [sys.executable, "-c", COUNT, json.dumps(commands)]
    done = subprocess.run(program, capture_output=True, text=True, check=True)

    expected = [" ".join(["0 0", *words]) for words in commands]
    assert [line for line in done.stdout.splitlines() if line] == expected, done.stderr
    numbers = json.loads(again.read_text())
    assert not any(group["compiled"] for group in numbers["groups"].values())
    assert numbers["count"] >= warm[0]["count"]  # other processes may add to the store


def test_no_folder_is_a_clear_error(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))

    assert main(["warm"]) == 2

    problem = capsys.readouterr().err
    assert str(tmp_path / "file") in problem
    assert "NUMBA_CACHE_DIR" in problem
