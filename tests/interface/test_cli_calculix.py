"""klack export and klack compare through main(argv); truth: what their help and messages promise.

The program ccx is played by small scripts, so that its failures can be.
"""

import json
import os
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from klack.analyses.comparison.calculix import COMPARISON_COLUMNS
from klack.analyses.impact.analysis import IMPACT
from klack.case import find_case
from klack.cli.commands import parser
from klack.cli.main import main
from klack.errors import ConvergenceError, InputError
from klack.exchange.calculix_run import run_calculix

BARS = Path(__file__).parents[1] / "data" / "calculix_bars.dat"
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to" / "check-with-calculix.md"
MASS = 1.5667291666666663e-05  # kg, of the bar in that file

GOOD = f"""cp {BARS} $2.dat
echo "   1   1   1   4  0.1E-06  0.1E-06  0.1E-06" > $2.sta
echo " Job finished"; echo "Total CalculiX Time: 7.5"
"""
REFUSING = """echo " *ERROR reading *STEP: no such thing"; echo "   in line 12"; echo; exit 201"""
DIVERGING = """echo "   1   3   1   4  0.3E-05  0.3E-05  0.1E-06" > $2.sta
echo; echo " *ERROR: solution seems to diverge; please try"; echo " automatic incrementation"
exit 201
"""
CRASHING = "kill -SEGV $$"
LAZY = 'echo "   1   2   1   4  0.2E-06  0.2E-06  0.1E-06" > $2.sta; exec sleep 60'


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def play(tmp_path, monkeypatch):
    """Put a script in the place of ccx; None: nothing is installed."""

    def install(script: str | None) -> None:
        folder = tmp_path / "bin"
        folder.mkdir()
        if script is not None:
            (folder / "ccx").write_text(f"#!/bin/sh\n{script}\n")
            (folder / "ccx").chmod(0o755)
        monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
        if script is None:
            monkeypatch.setattr("klack.exchange.calculix_run._NAMES", ("no-such-ccx",))

    return install


def deck(folder: Path) -> Path:
    path = folder / "run.inp"
    path.write_text("*STEP\n")
    return path


def test_a_run_leaves_its_files_and_its_progress(play, tmp_path):
    play(GOOD)
    (tmp_path / "run.frd").write_text("of an earlier run")

    run = run_calculix(deck(tmp_path), duration=1e-6)

    assert run.data == tmp_path / "run.dat"
    assert run.wall_time < 60
    assert run.data.stat().st_size == BARS.stat().st_size
    assert "Total CalculiX Time" in (tmp_path / "run.log").read_text()
    assert not (tmp_path / "run.frd").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "kind", "words"),
    [
        (None, InputError, "apt-get install calculix-ccx"),
        (REFUSING, InputError, r"\*ERROR reading \*STEP: no such thing in line 12"),
        (DIVERGING, ConvergenceError, "ended early at 3 us .*solution seems to diverge.*automatic"),
        (CRASHING, ConvergenceError, "exit code -11"),
        ("exit 0", ConvergenceError, "ended early at 0 us"),
        (LAZY, ConvergenceError, r"stopped after 0.5 s .* at 0.2 us of 1 us"),
    ],
    ids=["missing", "refusing", "diverging", "crashing", "silent", "lazy"],
)
def test_a_run_that_fails_says_why(script, kind, words, play, tmp_path):
    play(script)

    with pytest.raises(kind, match=words):
        run_calculix(deck(tmp_path), duration=1e-6, time_limit=0.5)


def test_export_writes_a_deck_and_says_how_to_run_it(capsys):
    assert main(["export", "witness", "--to", "calculix", "--step", "100 ns", "--out", "o"]) == 0

    out = capsys.readouterr().out
    assert "o/witness.inp: 100 steps of 100 ns, penalty 8.1" in out
    assert "ccx -i witness" in out
    text = Path("o/witness.inp").read_text()
    assert text.startswith("*HEADING\nWitness")
    assert "\n1e-07, 1e-05\n" in text
    assert sorted(path.name for path in Path("o").iterdir()) == ["witness.inp"]


def test_export_can_run_the_program(play, capsys):
    play(GOOD)

    assert main(["export", "witness", "--to", "calculix", "--run", "--penalty", "1e8 MPa/mm"]) == 0

    out = capsys.readouterr().out
    assert "penalty 1e+08 MPa/mm" in out
    assert "klack-results/witness/witness.dat" in out
    assert Path("klack-results/witness/witness.dat").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["witness"], ["--to"]),
        (["witness", "--to", "ansys"], ["--to", "calculix"]),
        (["witness", "--to", "calculix", "--step", "5 mm"], ["--step", "a length"]),
        (["witness", "--to", "calculix", "--penalty", "1e9"], ["--penalty", "MPa/mm"]),
        (["witness", "--to", "calculix", "--penalty", "1 GPa"], ["--penalty", "a pressure"]),
        (["witness", "--to", "calculix", "--threads", "0"], ["--threads"]),
        (["demo-valve-axisymmetric", "--to", "calculix"], ["axisymmetric", "model: swept"]),
        (["nowhere", "--to", "calculix"], ["nowhere"]),
    ],
)
def test_export_refuses_with_one_message(arguments, words, capsys, tmp_path):
    assert main(["export", *arguments]) == 2

    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("klack export: ")
    assert all(word in err for word in words)
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_the_how_to_page_asks_for_what_there_is(monkeypatch):
    """Its commands are taken as they stand, and its table has the columns of the real one."""
    # the folder of the second command is made by the first
    monkeypatch.setattr("klack.terminal.options.require_json_target", lambda path: None)
    text = HOW_TO.read_text(encoding="utf-8")
    commands = [line for line in text.splitlines() if line.startswith("klack ")]
    assert len(commands) == 4
    for line in commands:
        command, bound, _ = parser.parse_args(
            shlex.split(line)[1:], print_error=False, exit_on_error=False
        )
        assert command.__name__ in ("impact", "export", "compare")
        if command.__name__ != "compare":
            assert find_case(bound.args[0]).is_file()
    assert all(column in text for column in COMPARISON_COLUMNS)


def test_export_looks_for_the_program_before_it_works(play, capsys):
    play(None)

    assert main(["export", "witness", "--to", "calculix", "--run"]) == 2

    assert "no program 'ccx'" in capsys.readouterr().err
    assert not Path("klack-results").exists()


def stored(impact_study) -> Path:
    """The made-up study, with the bar of the stored file as its needle."""
    full = impact_study.levels["full"]
    scale = MASS / full.history.mass_a
    history = replace(full.history, mass_a=MASS, force=scale * full.history.force)
    study = replace(
        impact_study, levels={"full": replace(full, history=history)}, deviations={}, transfer=()
    )
    IMPACT.save(study, Path("result"))
    return Path("result")


def test_compare_prints_writes_and_draws(impact_study, capsys):
    folder = stored(impact_study)

    assert main(["compare", str(folder), "--calculix", str(BARS), "--json", "c.json"]) == 0

    out = capsys.readouterr().out
    for words in ("CalculiX", "klack, full", "klack from it", "Force history:", "rms of the peak"):
        assert words in out
    numbers = json.loads(Path("c.json").read_text())
    assert numbers["other"]["peak_force_N"] == pytest.approx(10.14, rel=1e-3)
    assert numbers["deviation"]["history_l2"] > 0
    picture = (folder / "calculix.svg").read_text()
    assert picture.lstrip().startswith("<?xml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "--calculix", str(BARS)], ["nowhere"]),
        (["result", "--calculix", "no.dat"], ["no.dat", "does not exist"]),
        (["result"], ["--calculix"]),
        (["result", "--calculix", str(BARS), "--level", "reduced"], ["no level 'reduced'"]),
        (["result", "--calculix", str(BARS), "--json", "no/x.json"], ["--json"]),
    ],
)
def test_compare_refuses_with_one_message(arguments, words, impact_study, capsys):
    stored(impact_study)

    assert main(["compare", *arguments]) == 2

    out, err = capsys.readouterr()
    assert (out, err.startswith("klack compare: ")) == ("", True)
    assert all(word in err for word in words)
    assert not Path("result/calculix.svg").exists()
