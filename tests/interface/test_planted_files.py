"""Files that klack opens again, replaced by something else: logs, results and entries of the cache.

Truth: what a link leads to is as it was; nothing waits for ever; numbers come from the caller's own
files or are computed anew.
"""

import json
import os
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rigid_valve import write_bench

from klack.analyses.calibration.motion import TRIAL_LOG, Motion, trial_log
from klack.analyses.catalogue import load_result
from klack.analyses.shots.one_shot import SHOT_LOG, shot_log
from klack.cli.main import main
from klack.errors import InputError
from klack.machine.cache.entry import Entry
from klack.machine.cache.result_cache import ResultCache

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="users, links and pipes")

DATA = Path(__file__).parents[1] / "data"
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
RODS = str(DATA / "tiny_rods.yaml")
LONGER = int(os.environ.get("KLACK_LONG", "1"))


# --------------------------------------------------------------------------- logs


PLANTED: dict[str, tuple[Callable[[Path, Path], object], str]] = {
    "link": (lambda path, mine: path.symlink_to(mine), "a symbolic link"),
    "lost link": (lambda path, mine: path.symlink_to(mine.parent / "new"), "a symbolic link"),
    "pipe": (lambda path, mine: os.mkfifo(path), "a named pipe"),
    "folder": (lambda path, mine: path.mkdir(), "a folder"),
    "hard link": (lambda path, mine: os.link(mine, path), "2 names"),
}


@pytest.mark.parametrize("open_log", [shot_log, trial_log])
@pytest.mark.parametrize("planted", PLANTED)
def test_a_log_is_a_regular_file_of_the_caller(planted: str, open_log, tmp_path: Path):
    plant, reason = PLANTED[planted]
    form = SHOT_LOG if open_log is shot_log else TRIAL_LOG
    mine = tmp_path / "mine"
    mine.write_text("secret\nsecret\n")
    folder = tmp_path / "out"
    folder.mkdir()
    plant(folder / form.file, mine)

    with pytest.raises(InputError, match=reason):
        open_log(folder, "mark")

    assert form.count(folder) == 0
    form.remove(folder)
    assert mine.read_text() == "secret\nsecret\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "out"]


def test_a_log_of_another_user_is_refused(tmp_path: Path, monkeypatch):
    trial_log(tmp_path, "mark").close()
    monkeypatch.setattr("klack.files.own.caller", lambda: 12345)
    with pytest.raises(InputError, match="of another user"):
        trial_log(tmp_path, "mark")


def test_nobody_else_can_open_a_log_to_lock_it(tmp_path: Path):
    path = tmp_path / TRIAL_LOG.file
    path.write_text("of an earlier klack")
    path.chmod(0o644)
    with trial_log(tmp_path, "mark"):
        assert path.stat().st_mode & 0o077 == 0


def test_a_name_that_changes_under_a_log_does_not_matter(tmp_path: Path):
    """Everything goes through the file that was opened and checked."""
    mine = tmp_path / "mine"
    mine.write_text("secret")
    motion = Motion(step=1e-6, channels={}, impacts={})
    with trial_log(tmp_path, "mark") as log:
        (tmp_path / TRIAL_LOG.file).unlink()
        (tmp_path / TRIAL_LOG.file).symlink_to(mine)
        log.add((1.0,), motion)
    assert mine.read_text() == "secret"


def test_the_command_ends_with_one_message(tmp_path: Path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    os.mkfifo(out / SHOT_LOG.file)
    words = ["shots", str(HOW_TO / "guided_needle.yaml"), "--shots", "1", "-q", "--out", str(out)]
    assert main(words) == 2
    err = capsys.readouterr().err
    assert "got a named pipe" in err
    assert err.count("\n") == 2


# --------------------------------------------------------------------------- results


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("result") / "r"
    assert main(["impact", RODS, "--no-certify", "--no-report", "-q", "--out", str(folder)]) == 0
    return folder


@pytest.mark.parametrize("kind", ["pipe", "link"])
def test_an_unpacked_result_with_pipes_and_links_is_refused(kind, result: Path, tmp_path: Path):
    """An archive may hold both; a reader of a pipe would wait for ever."""
    with tarfile.open(tmp_path / "a.tar", "w") as archive:
        archive.add(result, "r")
    with tarfile.open(tmp_path / "a.tar") as archive:
        archive.extractall(tmp_path)
    for name in ("zarr.json", "c"):
        copy = tmp_path / f"copy-{name}"
        shutil.copytree(tmp_path / "r", copy)
        path = next(path for path in copy.glob(f"result.zarr/*/**/{name}"))
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
        with pytest.raises(InputError, match="pipe" if kind == "pipe" else "symbolic link"):
            load_result(copy)


@pytest.mark.slow
def test_tampered_results_and_entries_give_the_stored_numbers_or_one_error(
    result: Path, tmp_path: Path
):
    """Bytes, words, shapes, missing and special files; checksums repaired where a forger would."""
    words = [str(result), str(tmp_path / "work"), str(20 * LONGER), "1"]
    program = [sys.executable, str(DATA / "tampered_stores.py"), *words]
    done = subprocess.run(program, capture_output=True, text=True, check=True)

    for found in json.loads(done.stdout).values():
        assert found["wrong"] == []
        assert found["refused"] > 10 * LONGER


# --------------------------------------------------------------------------- cache


@pytest.fixture
def cache(tmp_path: Path) -> ResultCache:
    cache = ResultCache(tmp_path / "cache", 10**9)
    cache.store("0" * 64, Entry(arrays={"x": np.arange(3.0)}))
    assert cache.load("0" * 64, "test") is not None
    return cache


def test_an_entry_that_others_may_write_is_not_read(cache: ResultCache):
    (path,) = cache.folder.glob("*.entry")
    path.chmod(0o666)
    assert cache.load("0" * 64, "test") is None


def test_an_entry_of_another_user_is_not_read(cache: ResultCache, monkeypatch):
    """It has the right key and checksum, and could hold any numbers."""
    (path,) = cache.folder.glob("*.entry")
    if os.geteuid() == 0:
        os.chown(path, 65534, 65534)
    else:
        monkeypatch.setattr("klack.machine.cache.entry.caller", lambda: 12345)
    assert cache.load("0" * 64, "test") is None
    cache.store("0" * 64, Entry(arrays={"x": np.arange(3.0)}))
    monkeypatch.undo()
    assert cache.load("0" * 64, "test") is not None


def test_an_entry_that_is_a_link_or_a_pipe_is_replaced(cache: ResultCache, tmp_path: Path):
    (path,) = cache.folder.glob("*.entry")
    path.rename(tmp_path / "mine")
    before = (tmp_path / "mine").stat()
    path.symlink_to(tmp_path / "mine")
    assert cache.load("0" * 64, "test") is None
    assert (tmp_path / "mine").stat().st_mtime_ns == before.st_mtime_ns
    path.unlink()
    os.mkfifo(path)
    assert cache.load("0" * 64, "test") is None
    cache.store("0" * 64, Entry(arrays={"x": np.arange(3.0)}))
    assert cache.load("0" * 64, "test") is not None


# --------------------------------------------------------------------------- stopped reports


def stopped(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    write_bench(folder, 3, 2)
    words = ["stroke", str(folder / "valve.yaml"), "--no-report", "-q"]
    assert main([*words, "--out", str(folder / "stroke")]) == 0
    return folder


SHOTS = pytest.param("shots", marks=pytest.mark.slow)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["impact", "noise", SHOTS, "stroke", "calibrate", "compare"])
def test_a_run_stopped_in_its_report_keeps_its_result(
    command: str, result: Path, bench: Path, tmp_path: Path, monkeypatch, capsys
):
    """The result is whole in its place, no report of another one is beside it, nothing is left."""
    strokes = ["--measurement", str(bench / "strokes.csv")]
    words = {
        "impact": ["impact", RODS, "--no-certify"],
        "noise": ["noise", str(result)],
        "shots": ["shots", str(HOW_TO / "guided_needle.yaml"), "--shots", "1", "--workers", "1"],
        "stroke": ["stroke", str(bench / "valve.yaml")],
        "calibrate": ["calibrate", str(bench / "valve.yaml"), *strokes, "--workers", "1"],
        "compare": ["compare", str(bench / "stroke"), *strokes],
    }[command]
    out = tmp_path / "r"
    out.mkdir()
    for name in ("report.html", "report.pdf"):
        (out / name).write_text("of an earlier result")
    monkeypatch.setattr("klack.report.pdf.write_pdf", stopped)  # the page itself is written

    assert main([*words, "-q", "--out", str(out)]) == 130

    assert capsys.readouterr().err.splitlines()[-1] == (
        f"klack {command}: stopped; the result is in {out}; klack report {out} writes its report."
    )
    assert load_result(out) is not None
    extra = {
        "calibrate": {"case_calibrated.yaml"},
        "noise": {path.name for path in out.glob("*.wav")},
    }
    names = {path.name for path in out.iterdir()}
    assert names == {"result.zarr"} | extra.get(command, set())
