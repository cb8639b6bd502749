"""The command klack through main(argv): truth = the exit codes and messages it promises."""

import json
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from shlex import quote
from types import ModuleType, SimpleNamespace

import pytest

import klack
import klack.cli.commands as demo_module
from klack import verification
from klack.cli.commands import COMMANDS
from klack.cli.main import main
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.terminal.output import staged_folder, write_json
from klack.terminal.progress import show_progress
from klack.terminal.tables import print_table
from klack.verification import GROUPS, Check, compare, run_checks

DRAWN = Path(__file__).parents[1] / "data" / "case" / "drawn.yaml"
NAMES = [command.__name__ for command in COMMANDS]


def contents(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize("command", ["", *NAMES])
def test_help_names_the_options(command, capsys):
    assert main([*command.split(), "--help"]) == 0

    out = capsys.readouterr().out
    assert out.startswith(f"Usage: klack {command}".rstrip())
    if not command:
        assert all(name in out for name in NAMES)
        assert "70 internal error" in out
    elif command not in ("schema", "cache", "app", "completion"):
        assert "--quiet" in out


def test_help_imports_nothing_heavy():
    """One process for all commands: what the first ones leave alone the last one has not either."""
    # this is what keeps --help below half a second; times themselves are not asserted
    code = (
        "import sys; from klack.cli.main import main\n"
        "heavy = {'numpy', 'scipy', 'numba', 'pydantic', 'pint', 'zarr', 'ruamel.yaml', 'plotly'}\n"
        f"for command in {['', *NAMES]!r}:\n"
        "    code = main([*command.split(), '--help'])\n"
        "    found = heavy & set(sys.modules)\n"
        "    if code or found: sys.exit(f'{command}: {code}, {found}')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_version(capsys):
    from klack import __version__

    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"klack {__version__}\n"


def test_about_lists_what_is_installed(capsys):
    """Truth = what Python itself knows of its packages."""
    assert main(["about", "--json", "-"]) == 0
    about = json.loads(capsys.readouterr().out)["about"]
    for name in ("numpy", "scipy", "numba"):
        assert about[name] == version(name)
    assert about["klack"] == klack.__version__
    assert f"zarr {version('zarr')}" in about["packages"]
    assert Path(about["installed_in"]).expanduser() == Path(klack.__file__).parent


def test_about_does_not_tell_the_name_of_the_user(capsys, monkeypatch, tmp_path):
    home = Path(klack.__file__).parents[1]
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    main(["about", "--json", "-"])
    out = capsys.readouterr().out
    assert str(home) not in out
    assert json.loads(out)["about"]["installed_in"] == str(Path("~", "klack"))


@pytest.mark.parametrize(("words", "offered"), [("imp", "impact"), ("impact --lev", "--level")])
def test_bash_completes_commands_and_options(words, offered, capsys, tmp_path):
    """Truth = what bash itself offers."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash here")
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "klack.bash"
    script.write_text(capsys.readouterr().out)
    typed = ["klack", *words.split()]
    asked = f"source {script}; COMP_WORDS=({' '.join(typed)}); COMP_CWORD={len(typed) - 1}; _klack"
    done = subprocess.run(
        [bash, "-c", f'{asked}; echo "${{COMPREPLY[@]}}"'],
        capture_output=True,
        text=True,
        check=True,
    )
    assert offered in done.stdout.split()


def test_module_is_the_command():
    command = [sys.executable, "-m", "klack", "impact", "no.yaml"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)

    assert done.returncode == 2
    assert done.stderr.startswith("klack impact: no.yaml: got neither a file nor a shipped case")


# arguments, words that the one message must contain; {} is the text of a good case
BAD = {
    "unknown command": (["impct"], ["klack impct:", 'Did you mean "impact"', "klack --help"]),
    "no case": (["impact"], ["klack impact:", "CASE", "klack impact --help"]),
    "two cases": (["impact", "a", "b"], ["got 'b', which belongs to no option"]),
    "two formats": (["export", "a", "--to", "mat", "csv"], ["got 'csv', which belongs to no"]),
    "unknown option": (["impact", "a", "--modes"], ["--modes"]),
    "missing file": (["impact", "valve.yaml"], ["valve.yaml", "neither a file nor a shipped"]),
    "misspelled shipped case": (["impact", "demo-vave"], ["did you mean 'demo-valve'"]),
    "folder without case": (["impact", "."], ["a folder without case.yaml"]),
    "threads no number": (["impact", str(DRAWN), "--threads", "x"], ["--threads", "x"]),
    "threads zero": (["impact", str(DRAWN), "--threads", "0"], ["--threads", "0"]),
    "unknown level": (["impact", str(DRAWN), "--level", "ful"], ["'ful'", "did you mean 'full'"]),
    "JSON into nothing": (
        ["impact", str(DRAWN), "--json", "none/x.json"],
        ["--json none/x.json", "a folder that does not exist"],
    ),
    "JSON into a folder": (["schema", "--json", "."], ["--json .", "a folder"]),
    "results into a file": (
        ["impact", str(DRAWN), "--out", f"{DRAWN}/x"],
        ["--out", "drawn.yaml, expected a folder"],
    ),
    "report of nothing": (["report", "none"], ["none", "result.zarr"]),
    "reduce a missing file": (["reduce", "valve.yaml"], ["klack reduce: valve.yaml"]),
    "unknown group": (["verify", "--group", "foo"], ["'foo'", "elasticity"]),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_give_one_message_and_exit_2(name, capsys, tmp_path):
    arguments, words = BAD[name]

    code = main(arguments)

    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert err.startswith(f"klack {arguments[0]}: ")
    assert "\nTry: " in err
    assert "Traceback" not in err
    for word in words:
        assert word in err
    assert contents(tmp_path) == []


@pytest.mark.parametrize(
    ("old", "new", "where", "word"),
    [
        ("motion: {", "motion: ", ":44", "not YAML"),  # a hole in the file
        ("size: 1.2 mm", "size: 1.2 bar", ":23: bodies.needle.mesh.size", "a pressure"),
        ("density:", "densty:", ":6: materials.steel.densty", "did you mean 'density'"),
        ("needle.tip", "needle.tipp", ":42: contact.between[0]", "did you mean 'tip'"),
        ("count: 20", "count: 0", ":45: reduction.modes.needle.count", "0 modes"),
        ("gap: 0", "gap: -2 um", ":43: contact.gap", "already penetrate"),
        ("title:", "title: a\ntitle:", ":3: title", "for the second time"),
        ("klack: 1", "hello", ":1", "without 'key: value'"),  # where it stands
    ],
)
@pytest.mark.parametrize("command", ["impact", "reduce"])
def test_bad_cases_give_one_message_and_exit_2(command, old, new, where, word, capsys, tmp_path):
    text = DRAWN.read_text(encoding="utf-8")
    assert old in text
    Path("valve.yaml").write_text(text.replace(old, new, 1), encoding="utf-8")

    code = main([command, "valve.yaml"])

    out, err = capsys.readouterr()
    assert (code, out) == (2, "")
    assert err.startswith(f"klack {command}: valve.yaml{where}: got ")
    assert word in err
    assert "Traceback" not in err
    assert contents(tmp_path) == ["valve.yaml"]


def test_schema_is_printed_and_written(capsys):
    assert main(["schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert main(["schema", "--json", "case.schema.json"]) == 0

    assert printed["properties"]["klack"]["const"] == 1
    assert json.loads(Path("case.schema.json").read_text()) == printed


# ------------------------------------------------------------------ the run of a case, played


def play(monkeypatch: pytest.MonkeyPatch, run: Callable[..., object]) -> None:
    """Replace the calculation by ``run``; all else is the real command."""
    module = ModuleType("klack.analyses.impact.run")
    module.run_impact = run  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "klack.analyses.impact.run", module)


def raising(error: BaseException) -> Callable[..., object]:
    def run(
        case: object, *, levels: object, certify: bool, progress: Callable, threads: object
    ) -> object:
        progress("mesh", 0.5)
        raise error

    return run


@pytest.mark.parametrize(
    "words",
    [["--level", "full,reduced"], ["--level", "reduced", "full"], ["--level=reduced,full"]],
    ids=["with a comma", "with a space", "with an equals sign"],
)
def test_several_levels_in_one_option(words, monkeypatch):
    asked = []

    def run(
        case: object, *, levels: object, certify: bool, progress: object, threads: object
    ) -> object:
        asked.append(levels)
        raise ConvergenceError("far enough")

    play(monkeypatch, run)

    assert main(["impact", str(DRAWN), *words]) == 1
    assert asked == [("reduced", "full")]


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "klack impact: stopped; no partial files are left."),
        (ConvergenceError("the contact did not settle in 50 rounds"), 1, "50 rounds"),
        (InputError("mesh", got="a", expected="b", hint="c"), 2, "mesh: got a, expected b."),
        (MemoryError(), 2, "memory"),
        (ZeroDivisionError("bug"), 70, "klack impact: internal error"),
        (FileNotFoundError(2, "lost", "x"), 70, "klack impact: internal error"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_each_kind_of_trouble_has_its_exit_code(error, code, words, monkeypatch, capsys, tmp_path):
    play(monkeypatch, raising(error))

    assert main(["impact", str(DRAWN), "--json", "numbers.json"]) == code

    err = capsys.readouterr().err
    assert words in err
    assert ("Traceback" in err) == (code == 70)
    assert contents(tmp_path) == []


def test_doubts_about_accuracy_are_notes_without_source_lines(monkeypatch, capsys):
    def run(*arguments: object, **options: object) -> object:
        warnings.warn("too few modes", AccuracyWarning, stacklevel=2)
        raise KeyboardInterrupt

    play(monkeypatch, run)
    main(["impact", str(DRAWN), "-q"])

    assert capsys.readouterr().err.startswith("klack impact: note: too few modes\nklack impact: st")


def test_units_in_brackets_survive_the_table(capsys):
    # rich would take [us] for a style and drop it
    print_table("a [b] table", ["level", "time [us]"], [["[bold]full", "1.5"]])

    out = capsys.readouterr().out
    for words in ("a [b] table", "time [us]", "[bold]full"):
        assert words in out


# ------------------------------------------------------------------ verification


def play_group(monkeypatch: pytest.MonkeyPatch, group: str, checks: Callable[[], list]) -> None:
    module = ModuleType(f"klack.verification.{group.replace('-', '_')}")
    module.checks = checks  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)


def check(computed: float, tolerance: float = 0.1) -> Check:
    known = dict(expected=2.0, tolerance=tolerance, source="a closed formula")
    return compare("impact", "speed [m/s]", computed=computed, **known)


def stop() -> list[Check]:
    raise ConvergenceError("no rest after 50 rounds")


@pytest.mark.parametrize(
    ("checks", "code", "verdicts", "words"),
    [
        (lambda: [check(2.0), check(2.1)], 0, [True, True], "2 of 2 checks passed"),
        (lambda: [check(2.0), check(2.3)], 1, [True, False], "FAILED"),
        (lambda: [check(float("nan"))], 1, [False], "0 of 1"),
        (stop, 1, [False], "no rest after 50"),  # counted, not skipped
        (lambda: [], 1, [False], "no checks"),  # an empty group proves nothing
    ],
    ids=["all pass", "one fails", "not a number", "stops", "empty"],
)
def test_verify_fails_when_a_check_fails(checks, code, verdicts, words, monkeypatch, capsys):
    play_group(monkeypatch, "impact", checks)

    assert main(["verify", "--group", "impact", "--json", "checks.json"]) == code

    assert words in capsys.readouterr().out
    written = json.loads(Path("checks.json").read_text())["checks"]
    assert [one["passed"] for one in written] == verdicts
    keys = {"group", "name", "expected", "computed", "deviation", "deviation_unit", "tolerance"}
    keys |= {"headroom", "wide", "passed", "source", "reason"}
    assert all(set(one) == keys for one in written)


def test_numbers_on_the_terminal_are_pure_json(monkeypatch, capsys):
    play_group(monkeypatch, "impact", lambda: [check(2.2, tolerance=0.2)])

    assert main(["verify", "--group", "impact", "--json", "-"]) == 0

    out, err = capsys.readouterr()
    assert json.loads(out)["checks"][0]["deviation"] == pytest.approx(0.1, rel=1e-12)
    assert "1 of 1" in err


def test_groups_run_once_each_in_a_fixed_order(monkeypatch):
    ran = []
    for group in GROUPS:
        play_group(monkeypatch, group, lambda group=group: ran.append(group) or [check(2.0)])

    assert len(run_checks()) == len(GROUPS)
    assert tuple(ran) == GROUPS
    ran.clear()
    run_checks([GROUPS[3], GROUPS[1], GROUPS[3]])
    assert ran == [GROUPS[1], GROUPS[3]]


def test_every_module_with_checks_is_a_group():
    folder = Path(verification.__file__).parent
    found = {path.stem for path in folder.glob("*.py") if "\ndef checks(" in path.read_text()}

    assert found == {group.replace("-", "_") for group in GROUPS}
    assert len(set(GROUPS)) == len(GROUPS)


# ------------------------------------------------------------------ files and progress


def test_staged_files_appear_together_and_leave_others_alone(tmp_path):
    out = tmp_path / "deep" / "out"
    out.mkdir(parents=True)
    (out / "notes.txt").write_text("mine")
    (out / "result.zarr").mkdir()
    (out / "result.zarr" / "old").write_text("old")
    (out / "report.html").write_text("old")

    with staged_folder(out) as stage:
        (stage / "result.zarr").mkdir()
        (stage / "result.zarr" / "new").write_text("new")
        (stage / "report.html").write_text("new")
        assert (out / "report.html").read_text() == "old"

    assert contents(out) == ["notes.txt", "report.html", "result.zarr", "result.zarr/new"]
    assert (out / "report.html").read_text() == "new"


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interruption_leaves_the_folder_as_it_was(error, tmp_path):
    old = tmp_path / "old"
    old.mkdir()
    (old / "report.html").write_text("old")

    def interrupted(folder: Path) -> None:
        with staged_folder(folder) as stage:
            (stage / "report.html").write_text("half")
            raise error

    for folder in (old, tmp_path / "new" / "deep"):
        with pytest.raises(error):
            interrupted(folder)

    assert contents(tmp_path) == ["old", "old/report.html"]
    assert (old / "report.html").read_text() == "old"


def test_full_disk_is_one_clear_error(tmp_path):
    with pytest.raises(InputError, match="No space left"), staged_folder(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert contents(tmp_path) == []


def test_json_is_whole_or_absent(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.terminal.output.json", json)  # this is no result of a command
    target = tmp_path / "x.json"
    write_json(target, {"peak_force_N": 250.0})

    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(target, {"peak_force_N": float("nan")})

    assert json.loads(target.read_text()) == {"peak_force_N": 250.0}
    assert contents(tmp_path) == ["x.json"]


def test_progress_reports_only_stages_that_took_long(monkeypatch, capsys):
    clock = iter([0.0, 0.0, 0.0, 1.0, 1.0, 6.0, 6.0, 6.5])
    played = SimpleNamespace(perf_counter=lambda: next(clock))
    monkeypatch.setattr("klack.terminal.progress.time", played)

    with show_progress() as progress:
        progress("mesh", 0.0)
        progress("modes", 0.0)
        progress("modes", 1.0)
        progress("run", 1.0)

    assert capsys.readouterr().err == "modes: 5.0 s\n"


def test_quiet_is_quiet(capsys):
    with show_progress(quiet=True) as progress:
        progress("mesh", 0.5)

    assert capsys.readouterr() == ("", "")


def test_browser_needs_a_screen(monkeypatch):
    monkeypatch.setattr(demo_module.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(demo_module.sys.stdout, "isatty", lambda: True, raising=False)
    assert not demo_module._has_display()

    monkeypatch.setenv("DISPLAY", ":0")
    assert demo_module._has_display()

    monkeypatch.setattr(demo_module.sys.stdout, "isatty", lambda: False, raising=False)
    assert not demo_module._has_display()


@pytest.mark.slow
def test_reader_of_a_pipe_may_leave_early():
    # klack schema | head -1: no traceback, and no error code for the shell to stumble over
    command = f"{quote(sys.executable)} -m klack schema; echo code $? >&2"
    done = subprocess.run(
        ["bash", "-c", f"({command}) | head -1"],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )

    assert (done.stdout, done.stderr) == ("{\n", "code 0\n")


@pytest.mark.parametrize("name", ["valve.yaml", "table.CSV"])
def test_a_file_as_the_folder_of_results_is_one_error(tmp_path, capsys, name):
    out = tmp_path / name
    assert main(["export", "two-rods", "--to", "mat", "--out", str(out)]) == 2
    told = capsys.readouterr().err
    assert "the name of a file" in told
    assert str(out.with_suffix("")) in told.replace("\n", "")
    assert not out.exists()
