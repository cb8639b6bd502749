"""Broken surroundings: full disks, folders that may only be read, no home, closed streams.

Truth: exit code 2 and one message, whole files or none, and the former result as it was.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import klack
from klack.analyses.catalogue import load_result
from klack.cli.main import main
from klack.errors import InputError
from klack.terminal.tables import printable

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="mounts and capabilities")

DATA = Path(__file__).parents[1] / "data"
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
CASES = Path(__file__).parents[2] / "cases"
RODS = str(DATA / "tiny_rods.yaml")
ALONE = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("result") / "r"
    assert main(["impact", RODS, "--no-certify", "--no-report", "-q", "--out", str(folder)]) == 0
    return folder


def run(commands: list[list[str]], folder: Path, *before: str, **env: str) -> list:
    program = [*before, sys.executable, str(DATA / "several_commands.py"), json.dumps(commands)]
    done = subprocess.run(
        program, cwd=folder, env=ALONE | env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout))


def without_rights() -> tuple[str, ...]:
    """Words that start a program whose root may do no more than other users."""
    if os.geteuid() != 0:
        return ()
    if shutil.which("setpriv") is None:
        pytest.skip("setpriv is not installed, and root may write anywhere")
    return ("setpriv", "--inh-caps=-all", "--bounding-set=-all")


def tree(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.slow
def test_a_folder_that_may_only_be_read(result: Path, tmp_path: Path):
    """Every command that writes says so before it computes."""
    closed = tmp_path / "closed"
    shutil.copytree(result, closed / "r")
    (tmp_path / "strokes.csv").write_text("time [s],lift [m]\n0,0\n")
    for path in (closed, *closed.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = tree(closed)
    valve = str(HOW_TO / "small_valve.yaml")
    measured = str(CASES / "measured" / "strokes_synthetic.csv")
    out = ["--out", "closed/new"]
    commands = [
        ["impact", RODS, "--no-certify", *out],
        ["impact", RODS, "--no-certify", "--json", "closed/x.json"],
        ["reduce", RODS, *out],
        ["stroke", valve, *out],
        ["shots", str(HOW_TO / "guided_needle.yaml"), *out],
        ["calibrate", "measured", "--measurement", measured, *out],
        ["noise", "closed/r", *out],
        *(["export", RODS, "--to", to, *out] for to in ("mat", "fmu", "calculix", "vtk")),
        ["export", "closed/r", "--to", "csv"],
        ["report", "closed/r"],
        ["schema", "--json", "closed/x.json"],
        ["verify", "--group", "contact", "--json", "closed/x.json"],
    ]
    found = run(commands, tmp_path, *without_rights())
    for words, (code, said) in zip(commands, found, strict=True):
        assert code == 2, (words, said)
        assert "not writable" in said, (words, said)
        assert said.count("\n") <= 3, (words, said)
    assert tree(closed) == before
    for path in (closed, *closed.rglob("*")):
        path.chmod(0o755)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of its own, which tests fill."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if (
        os.geteuid() != 0
        or subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=4m", "klack-test", str(disk)],
            capture_output=True,
            check=False,
        ).returncode
    ):
        pytest.skip("mounting is not allowed")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


@pytest.mark.slow
def test_a_disk_that_fills_at_any_time(result: Path, small_disk: Path):
    """Results, exports and JSON with room for less and less of them."""
    assert (
        main(["impact", RODS, "--no-certify", "--no-report", "-q", "--out", str(small_disk / "r")])
        == 0
    )
    before = tree(small_disk / "r")
    ballast = small_disk / "ballast"
    free = shutil.disk_usage(small_disk).free
    commands = [
        ["impact", RODS, "--no-certify", "--no-report", "-q", "--out", str(small_disk / "r")],
        ["reduce", RODS, "-q", "--out", str(small_disk / "reduced")],
        ["impact", RODS, "--no-certify", "--no-report", "-q", "--json", str(small_disk / "x.json")],
        *(
            ["export", str(result), "--to", to, "-q", "--out", str(small_disk / to)]
            for to in ("netcdf", "mdf", "mat", "csv")
        ),
    ]
    refused = 0
    for room in (0, 65_536):
        ballast.write_bytes(bytes(max(free - room, 0) // 4096 * 4096))
        for words, (code, said) in zip(commands, run(commands, small_disk.parent), strict=True):
            refused += code == 2
            assert code in (0, 2), (room, words, said)
            assert code == 0 or "No space left" in said or "the disk is full" in said, (words, said)
            # the error itself; what the impact had to note before stands above it
            error = [line for line in said.splitlines() if not line.startswith("Note: ")]
            assert code == 0 or len(error) <= 3, (words, said)
            assert load_result(small_disk / "r") is not None
            if words[0] == "impact" and code == 2:
                assert tree(small_disk / "r").keys() == before.keys()
        hidden = [path for path in small_disk.rglob(".klack-*")]
        assert hidden == []
        for name in ("netcdf", "mdf", "mat", "csv", "reduced"):
            shutil.rmtree(small_disk / name, ignore_errors=True)
        (small_disk / "x.json").unlink(missing_ok=True)
        ballast.unlink()
    assert refused >= 6


@pytest.mark.slow
def test_a_report_without_room_keeps_the_result(tmp_path: Path, monkeypatch, capsys):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("klack.report.html.write_report", full)
    assert main(["impact", RODS, "--no-certify", "-q", "--out", str(tmp_path / "r")]) == 2

    err = capsys.readouterr().err
    assert "No space left" in err
    assert "klack report" in err
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == ["result.zarr"]


@pytest.mark.slow
def test_no_home_and_no_folder_for_temporary_files(result: Path, tmp_path: Path):
    """The report needs temporary files; the result is kept without them."""
    nowhere = str(tmp_path / "nowhere")
    room = {name: nowhere for name in ("TMPDIR", "TEMP", "TMP")}
    words = [
        ["impact", RODS, "--no-certify", "--no-report", "--out", "a"],
        ["report", str(result), "--out", "b"],
    ]
    found = run(words, tmp_path, HOME=nowhere, XDG_CACHE_HOME=nowhere, **room)

    assert [code for code, _ in found] == [0, 0], found  # /tmp is tried as well
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == ["report.html", "report.pdf"]


def test_without_any_place_compiled_functions_are_kept_for_one_command(monkeypatch, capsys):
    """In a private folder: numba runs what it finds there."""
    import klack.cli.surroundings as surroundings
    from klack.machine.compiling import compiled_folder

    monkeypatch.setattr(os, "environ", dict(os.environ))
    os.environ.pop("NUMBA_CACHE_DIR", None)
    surroundings.prepare_compiling()
    assert "NUMBA_CACHE_DIR" not in os.environ  # this machine has a place
    monkeypatch.setattr(compiled_folder, "is_usable", lambda folder: False)
    monkeypatch.setattr(compiled_folder, "compiled_folder", lambda: None)
    surroundings.prepare_compiling()
    place = Path(os.environ["NUMBA_CACHE_DIR"])
    assert place.stat().st_mode & 0o077 == 0
    assert "compiled functions cannot be cached" in capsys.readouterr().err


@pytest.mark.slow
def test_bytecode_is_kept_apart_from_sources_where_a_variable_forbids_it(tmp_path: Path):
    """Of a command alone, in a private folder that ``klack warm --clear`` empties."""
    from klack.machine.compiling.compiled_folder import clear_folder

    source = tmp_path / "source"
    shutil.copytree(
        Path(klack.__file__).parent, source / "klack", ignore=shutil.ignore_patterns("__pycache__")
    )
    env = {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(source)}
    env["NUMBA_CACHE_DIR"] = str(tmp_path / "own")
    store = tmp_path / "own" / "klack-compiled"

    def written_by(*words: str) -> int:
        command = [sys.executable, *words]
        subprocess.run(command, cwd=tmp_path, env=ALONE | env, capture_output=True, check=True)
        assert not [*source.rglob("__pycache__")]
        return len([*store.rglob("units.*.pyc")])

    assert written_by("-c", "import klack.units") == 0  # the user's own process
    assert (
        written_by("-c", "import klack.cli.main as m; m.main(['cache']); import klack.units") == 0
    )
    assert written_by("-P", "-m", "klack", "schema") == 1
    kept = store / "bytecode"
    assert kept.stat().st_mode & 0o777 == 0o700
    clear_folder(store)
    assert not kept.exists()
    store.chmod(0o777)  # another user may exchange it
    assert written_by("-P", "-m", "klack", "schema") == 0


@pytest.mark.parametrize("spoil", ["others may read", "another user", "a parent", "a file"])
def test_bytecode_is_kept_in_no_folder_that_others_reach(spoil: str, tmp_path: Path, monkeypatch):
    """Truth: Python runs what lies there, whoever wrote it."""
    from klack.machine.compiling import compiled_folder

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "own"))
    found = compiled_folder.bytecode_folder()
    assert found is not None
    if spoil == "others may read":
        found.chmod(0o711)
    elif spoil == "another user":
        monkeypatch.setattr(compiled_folder, "caller", lambda: os.geteuid() + 1)
    elif spoil == "a parent":
        (tmp_path / "own").chmod(0o777)
    else:
        found.rmdir()
        found.touch()
    assert compiled_folder.bytecode_folder() is None


def shell(text: str, folder: Path, **env: str) -> "subprocess.CompletedProcess[str]":
    klack = f"'{sys.executable}' -m klack"
    return subprocess.run(
        ["bash", "-c", text.replace("klack ", f"{klack} ", 1)],
        cwd=folder,
        env=ALONE | env,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_streams_that_are_closed_or_full(result: Path, tmp_path: Path):
    closed = shell(f"klack export '{result}' --to csv --out a >&- 2>&- <&-", tmp_path)
    assert closed.returncode == 0
    assert (tmp_path / "a" / "about.json").is_file()
    full = shell("klack schema > /dev/full", tmp_path)
    assert full.returncode == 2
    assert full.stderr.startswith("klack schema: the disk is full")
    assert "Traceback" not in full.stderr
    assert "Exception ignored" not in full.stderr


@pytest.mark.slow
def test_terminals_without_umlauts_and_odd_names(result: Path, tmp_path: Path):
    shutil.copytree(result, tmp_path / "-ä ö ü")
    plain = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0", "COLUMNS": "20"}
    for out in ("ü b", "x" * 200, "deep/" * 20 + "e"):
        done = shell(f"klack export './-ä ö ü' --to csv --out '{out}'", tmp_path, **plain)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / out / "about.json").is_file()
    long = shell(f"klack export './-ä ö ü' --to csv --out '{'x' * 300}'", tmp_path)
    assert long.returncode == 2
    assert "Traceback" not in long.stderr


@pytest.mark.slow
def test_a_result_folder_that_is_a_file_or_a_link(result: Path, tmp_path: Path, capsys):
    (tmp_path / "file").write_text("mine")
    assert main(["export", str(result), "--to", "csv", "--out", str(tmp_path / "file")]) == 2
    assert (tmp_path / "file").read_text() == "mine"
    assert main(["report", str(tmp_path / "file")]) == 2
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    assert (
        main(["impact", RODS, "--no-certify", "-q", "--no-report", "--out", str(tmp_path / "link")])
        == 0
    )
    assert load_result(tmp_path / "real") is not None
    (tmp_path / "lost").symlink_to("nowhere")
    assert main(["export", str(result), "--to", "csv", "--out", str(tmp_path / "lost")]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_folder_that_goes_while_a_run_computes(tmp_path: Path, monkeypatch):
    """It is made again: what was computed is not lost."""
    import klack.analyses.impact.run as workflow

    usual = workflow.run_impact

    def computed(*given: object, **options: object) -> object:
        study = usual(*given, **options)
        shutil.rmtree(tmp_path / "r", ignore_errors=True)
        return study

    monkeypatch.setattr(workflow, "run_impact", computed)
    (tmp_path / "r").mkdir()
    assert (
        main(["impact", RODS, "--no-certify", "-q", "--no-report", "--out", str(tmp_path / "r")])
        == 0
    )
    assert load_result(tmp_path / "r") is not None


@pytest.mark.slow
def test_two_processes_write_into_one_folder(tmp_path: Path):
    """Of two different cases one result stands there in the end, and all of it."""
    other = tmp_path / "other.yaml"
    other.write_text(Path(RODS).read_text().replace("1 m/s", "2 m/s"))
    commands = [
        ["impact", str(case), "--no-certify", "-q", "--out", "r"] for case in (RODS, other, RODS)
    ]
    program = [sys.executable, str(DATA / "several_commands.py")]
    running = [
        subprocess.Popen(
            [*program, json.dumps([words] * 2)],
            cwd=tmp_path,
            env=ALONE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for words in commands
    ]
    seen = set()
    while any(process.poll() is None for process in running):
        if (tmp_path / "r").is_dir():
            try:
                seen.add(load_result(tmp_path / "r").speed)
            except InputError as error:
                seen.add(error.got)
    for process in running:
        out, err = process.communicate()
        assert process.returncode == 0, err
        assert [code for code, _ in json.loads(out)] == [0, 0]
    assert seen <= {1.0, 2.0, "no klack result"}  # the last one before there is any
    names = sorted(path.name for path in (tmp_path / "r").iterdir())
    assert names == ["report.html", "report.pdf", "result.zarr"]
    study = load_result(tmp_path / "r")
    title = (tmp_path / "r" / "report.html").read_text()
    assert f"{study.speed:g} m/s" in title


def test_signs_that_steer_a_terminal_are_shown(capsys, tmp_path: Path):
    assert printable("a\x1b[2Jb\nc\r\x07ü") == "a\\x1b[2Jb\nc\\r\\x07ü"
    path = tmp_path / "case.yaml"
    path.write_text('klack: 1\n"\\e[2J": 1\n')
    assert main(["impact", str(path)]) == 2
    assert "\x1b" not in capsys.readouterr().err


@pytest.mark.parametrize("words", ["impact two-rods", "inspect two-rods", "stroke demo-stroke"])
def test_a_deleted_working_folder_is_one_clear_error(words, tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    done = shell(f"cd {gone} && rmdir {gone} && klack {words}", tmp_path)

    assert done.returncode == 2
    assert "the present folder: got an error" in done.stderr
    assert "Traceback" not in done.stderr
