"""A case file runs no code: only the option --component lets a class of the user in.

Truth: the how-to's brake by eddy currents, whose answer does not depend on how it was let in; and a
file that code would write if it ran.
"""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from klack.case.any_case import load_any_case, load_valve_case, read_case_tree
from klack.cli.main import main
from klack.errors import InputError

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
CASE = """
klack: 1
title: Needle with a brake
network:
  components:
    needle: {{type: rigid-mass, mass: 3 g, points: [tip, top]}}
    seat: {{type: end-stop, gap: 0 um, law: {{kind: linear, stiffness: 1e8 N/m}}}}
    stop: {{type: end-stop, gap: 80 um, law: {{kind: linear, stiffness: 1e8 N/m}}}}
    spring: {{type: spring, stiffness: 10 N/mm, preload: 11 N}}
    magnet: {{type: force-over-time, time: [0 us, 50 us, 1 ms], force: [0 N, 30 N, 30 N]}}
    brake: {{type: "{word}", damping: 2 N*s/m, critical_speed: 0.5 m/s}}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [needle.top, stop.lower, spring.end, magnet.end, brake.disc]
    - [stop.upper, ground]
run: {{duration: 0.2 ms, step: 0.2 us, coarse: 8, record: 2 us, variants: [dry]}}
"""
EVIL = "import pathlib\npathlib.Path(__file__).with_name('it-ran').touch()\nclass X: pass\n"
BRAKE = "eddy_brake:EddyBrake"


@pytest.fixture
def evil(tmp_path, monkeypatch) -> Path:
    """Folder of a stranger: a case, and beside it the module that it names."""
    (tmp_path / "evil.py").write_text(EVIL)
    path = tmp_path / "case.yaml"
    path.write_text(CASE.format(word="evil:X"))
    (tmp_path / "recording.csv").write_text("time [s],lift [m]\n0,0\n1,0\n")
    monkeypatch.syspath_prepend(tmp_path)  # as "python -m klack" or PYTHONPATH do
    return path


COMMANDS = {
    "stroke": ["stroke", "case.yaml"],
    "inspect": ["inspect", "case.yaml"],
    "inspect a folder": ["inspect", "."],
    "advise": ["advise", "case.yaml"],
    "calibrate": ["calibrate", "case.yaml", "--measurement", "recording.csv"],
    "noise": ["noise", "case.yaml"],
    "export models": ["export", "case.yaml", "--to", "fmu"],
    "export results": ["export", "case.yaml", "--to", "mdf"],
    "impact": ["impact", "case.yaml"],
    "shots": ["shots", "case.yaml"],
    "reduce": ["reduce", "case.yaml"],
}


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_no_command_runs_code_that_a_case_names(words, evil, capsys):
    assert main(words) == 2

    assert not (evil.parent / "it-ran").exists()
    told = capsys.readouterr().err
    if words[0] not in ("impact", "shots", "reduce"):  # these read no case of a valve at all
        assert "network.components.brake.type: got 'evil:X', a class that is not part" in told
        assert "--component evil:X" in told


def test_no_reader_runs_code_that_a_case_names(evil):
    for read in (load_valve_case, load_any_case, lambda path: read_case_tree(path).case()):
        with pytest.raises(InputError, match="a case file runs no code"):
            read(evil)

    assert not (evil.parent / "it-ran").exists()


@pytest.mark.slow
def test_the_folder_of_a_case_is_no_place_of_modules(evil):
    """Python itself would put the present folder in front of all modules."""
    (evil.parent / "numpy.py").write_text(EVIL)

    said = subprocess.run(
        [sys.executable, "-m", "klack", "inspect", "case.yaml"],
        cwd=evil.parent,
        capture_output=True,
        text=True,
        check=False,
    )

    assert said.returncode == 2, said.stderr
    assert "a case file runs no code" in said.stderr
    assert not (evil.parent / "it-ran").exists()


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("evil:X", "got something that is not a component"),
        ("no_such_module:X", "cannot be imported"),
        ("eddy_brake:NoClass", "cannot be imported"),
        ("eddy_brake", "expected package.module:Class"),
        (":EddyBrake", "expected package.module:Class"),
    ],
)
def test_a_wrong_option_is_named(word, words, evil, monkeypatch, capsys):
    monkeypatch.syspath_prepend(HOW_TO)

    assert main(["stroke", "case.yaml", "--component", word]) == 2

    told = capsys.readouterr().err
    assert "--component" in told
    assert words in told


def test_an_option_for_another_class_lets_this_one_stay_out(evil, monkeypatch, capsys):
    monkeypatch.syspath_prepend(HOW_TO)

    assert main(["inspect", "case.yaml", "--component", BRAKE]) == 2

    assert f"expected one of: {BRAKE}, rigid-mass" in capsys.readouterr().err
    assert not (evil.parent / "it-ran").exists()


@pytest.mark.slow
def test_a_class_that_was_let_in_acts_and_stands_in_the_record(monkeypatch):
    monkeypatch.syspath_prepend(HOW_TO)
    Path("case.yaml").write_text(CASE.format(word=BRAKE))

    assert (
        main(["stroke", "case.yaml", "--component", BRAKE, "--out=o", "--json=n.json", "-q"]) == 0
    )

    numbers = json.loads(Path("n.json").read_text())
    assert list(numbers["own_components"]) == [BRAKE]
    digest = numbers["own_components"][BRAKE]
    assert f"own component {BRAKE} ({digest})" in Path("o/report.html").read_text()
    assert numbers["energy_residual"] < 1e-9

    from eddy_brake import EddyBrake

    assert load_any_case("case.yaml", [EddyBrake]).own_components == {BRAKE: digest}
    tree = read_case_tree(Path("case.yaml"), [EddyBrake])
    assert tree.case().own_components == {BRAKE: digest}
    sent = pickle.loads(pickle.dumps(tree))  # to the workers of a calibration
    assert sent.case().own_components == {BRAKE: digest}
    changed = HOW_TO.joinpath("eddy_brake.py").read_bytes() + b"\n"
    Path("eddy_brake.py").write_bytes(changed)
    monkeypatch.setattr(sys.modules["eddy_brake"], "__file__", str(Path("eddy_brake.py")))
    assert load_any_case("case.yaml", [EddyBrake]).own_components != {BRAKE: digest}


def test_noise_of_a_stored_stroke_names_it_too(monkeypatch, capsys):
    """Neither noise nor report reads the case as a case again, so that they need no option."""
    monkeypatch.syspath_prepend(HOW_TO)
    Path("case.yaml").write_text(CASE.format(word=BRAKE))
    assert main(["stroke", "case.yaml", "--component", BRAKE, "--out=o", "--no-report", "-q"]) == 0

    assert main(["noise", "o", "--no-report", "--out=n", "--json=n.json", "-q"]) == 0

    assert list(json.loads(Path("n.json").read_text())["own_components"]) == [BRAKE]


def test_a_case_of_klack_alone_has_none():
    assert load_any_case(HOW_TO / "small_valve.yaml").own_components == {}
