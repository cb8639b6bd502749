"""What others plant in a folder that klack writes to.

Truth: what is planted, and what it leads to, is as it was afterwards; it is named once; what klack
writes comes to its place all the same, or there is one clear error.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from klack.cli.main import main
from klack.errors import InputError, LeftAloneWarning
from klack.files import own as own_file
from klack.files.held import HeldFolder
from klack.files.locks import LOCK_NAME, own_lock_name
from klack.files.stage import Stage
from klack.files.whole import completed, whole_file, whole_files

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="users, links and pipes")

NOBODY = 65534
STAGES = ".klack-[0-9a-f]*"
as_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may become another user"
)


def tree(folder: Path) -> dict[str, str]:
    """All below a folder: links by what they lead to, files by what is in them."""
    return {
        str(path.relative_to(folder)): os.readlink(path)
        if path.is_symlink()
        else path.read_text()
        if path.is_file()
        else ""
        for path in sorted(folder.rglob("*"))
        if not path.name.startswith(LOCK_NAME)  # of a killed process; it goes with the next one
    }


def as_nobody(act: Callable[[], object]) -> int:
    """Exit code of a child that does something as another user."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            act()
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def open_to_all(folder: Path) -> Path:
    """A folder that others come to and may write into."""
    folder.mkdir(exist_ok=True)
    folder.chmod(0o777)
    for parent in folder.parents:
        if parent.stat().st_uid == os.geteuid() and parent != Path("/"):
            parent.chmod(parent.stat().st_mode | 0o011)
    return folder


def write_schema(folder: Path) -> None:
    assert main(["schema", "--json", str(folder / "out.json")]) == 0
    assert json.loads((folder / "out.json").read_text())


# --------------------------------------------------------------------------- links and archives


@pytest.mark.parametrize("planted", ["ready", "stage", "gone"])
def test_a_link_to_the_home_of_somebody_moves_nothing(planted: str, tmp_path: Path, capsys):
    home, shared = tmp_path / "home", tmp_path / "shared"
    (home / "ready").mkdir(parents=True)
    (home / "keys").write_text("secret")
    (home / "ready" / "letter").write_text("secret")
    shared.mkdir()
    if planted == "stage":
        (shared / ".klack-x").symlink_to(home)
    else:
        (shared / ".klack-x" / "ready").mkdir(parents=True)
        (shared / ".klack-x" / "new").mkdir()
        (shared / ".klack-x" / "ready").rmdir()
        (shared / ".klack-x" / planted).symlink_to(home)
    before = tree(home), tree(shared / ".klack-x")

    write_schema(shared)

    assert (tree(home), tree(shared / ".klack-x")) == before
    said = capsys.readouterr().err
    assert said.count("'.klack-x'") == said.count("note") == 1
    assert ("a symbolic link" if planted == "stage" else "without klack's seal") in said


@pytest.mark.parametrize("forged", [False, True], ids=["plain", "forged manifest"])
def test_a_stage_out_of_an_archive_does_nothing(forged: bool, tmp_path: Path):
    """Unpacked by the user himself: his own files, and closed to others."""
    made = tmp_path / "made"
    with whole_files(made) as stage:  # a real one, as the klack of the stranger made it
        (stage / "case.yaml").write_text("evil")
        shutil.copytree(made, tmp_path / "packed", symlinks=True)
    (packed,) = (tmp_path / "packed").glob(".klack-*")
    (packed / "new").rename(packed / "ready")
    (packed / "old").mkdir()
    (packed / "ready" / "case.yaml").write_text("evil")
    (packed / "moves").write_text('[{"case.yaml": [[1, 2], null]}, {"mine.txt": [1, 2]}, {}]')
    if not forged:
        (packed / "manifest").unlink()
    packed.chmod(0o700)
    with tarfile.open(tmp_path / "a.tar", "w") as archive:
        archive.add(tmp_path / "packed", "project")
    with tarfile.open(tmp_path / "a.tar") as archive:
        archive.extractall(tmp_path)
    project = tmp_path / "project"
    (project / "case.yaml").write_text("mine")
    (project / "mine.txt").write_text("mine")
    before = tree(project)

    for step in (lambda: completed(project), lambda: write_one(project)):
        with pytest.warns(LeftAloneWarning, match="without klack's seal"):
            step()
    assert tree(project) == before | {"out": "mine"}


def write_one(folder: Path) -> None:
    with whole_file(folder / "out") as new:
        new.write_text("mine")


def test_names_in_messages_are_in_one_line(tmp_path: Path):
    (tmp_path / ".klack-\nklack: note: all is well").mkdir()
    (tmp_path / ".klack-\nklack: note: all is well" / "x").write_text("")
    with pytest.warns(LeftAloneWarning) as found:
        write_one(tmp_path)
    (message,) = {str(one.message) for one in found if one.category is LeftAloneWarning}
    assert "\n" not in message


def dead_stage_in(folder: Path, content: str = "new") -> Path:
    """Stage of a process that was killed when its file was ready."""
    child = os.fork()
    if child == 0:
        Stage._move = lambda self, moves: os._exit(99)  # type: ignore[method-assign]
        with whole_file(folder / "r") as new:
            new.write_text(content)
    os.waitpid(child, 0)
    (stage,) = folder.glob(STAGES)
    return stage


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda stage: (stage / "more").write_text(""), "unknown entry 'more'"),
        (lambda stage: stage.chmod(0o777), "others may write to it"),
        (lambda stage: (stage / "seal").chmod(0o644), "without klack's seal"),  # its time of change
        (lambda stage: (stage / "manifest").write_text("[" * 100_000), "without klack's seal"),
        (lambda stage: os.link(stage / "seal", stage.parent / "seal"), "without klack's seal"),
    ],
)
def test_a_stage_that_somebody_changed_is_left_alone(change, reason: str, tmp_path: Path):
    stage = dead_stage_in(tmp_path)
    change(stage)
    before = tree(tmp_path)
    with pytest.warns(LeftAloneWarning, match=reason):
        write_one(tmp_path)
    assert tree(tmp_path) == before | {"out": "mine"}


@pytest.mark.parametrize("name", ["../up", "/etc/x", "..", "a/b", ""])
def test_moves_lead_nowhere_else(name: str, tmp_path: Path):
    folder = tmp_path / "in"
    folder.mkdir()
    stage = dead_stage_in(folder)
    (stage / "moves").write_text(json.dumps([{name: [[1, 1], None]}, {name: [1, 1]}, {}]))
    (tmp_path / "up").write_text("mine")
    completed(folder)
    assert tree(tmp_path) == {"in": "", "up": "mine"}


def test_of_another_user_by_number(tmp_path: Path, monkeypatch):
    """The rule itself, without a second user: the stage is of a number that is not the caller's."""
    stage = dead_stage_in(tmp_path)
    before = tree(stage)
    usual = own_file.caller()
    for module in ("klack.files.stage", "klack.files.own", "klack.files.locks"):
        monkeypatch.setattr(f"{module}.caller", lambda: 12345)
    with pytest.warns(LeftAloneWarning, match=f"of another user \\(number {usual}\\)"):
        completed(tmp_path)
    assert tree(stage) == before


# --------------------------------------------------------------------------- swapped while at work


def test_a_folder_that_is_swapped_for_a_link_gets_nothing(tmp_path: Path):
    """Between the making of the stage and its filling, and again before it is removed."""
    home, shared = tmp_path / "home", tmp_path / "shared"
    (home / "new").mkdir(parents=True)
    (home / "new" / "r").write_text("secret")
    (home / "old").mkdir()
    shared.mkdir()
    before = tree(home)

    def write() -> None:
        with whole_files(shared) as content:
            if not str(content).startswith("/proc"):
                pytest.skip("this system has no paths of open folders")
            (stage,) = shared.glob(STAGES)
            stage.rename(shared / "aside")
            stage.symlink_to(home)
            (content / "r").write_text("new")
            (content / "s").write_text("new")

    with pytest.warns(LeftAloneWarning, match="a symbolic link"):
        write()
    assert tree(home) == before
    assert (shared / "r").read_text() == (shared / "s").read_text() == "new"


def test_the_folder_itself_may_be_renamed(tmp_path: Path):
    shared, home = tmp_path / "shared", tmp_path / "home"
    shared.mkdir()
    home.mkdir()
    with whole_files(shared) as content:
        if not str(content).startswith("/proc"):
            pytest.skip("this system has no paths of open folders")
        shared.rename(tmp_path / "aside")
        shared.symlink_to(home)
        (content / "r").write_text("new")
    assert tree(home) == {}
    assert tree(tmp_path / "aside") == {"r": "new"}


def test_a_folder_of_the_user_in_the_place_of_the_stage_keeps_its_files(
    tmp_path: Path, monkeypatch
):
    """Who may write to the folder can give another folder of the user the name of the stage."""
    (tmp_path / "project").mkdir()
    (tmp_path / "project" / "work").write_text("mine")
    make = HeldFolder.make

    def swapped(self: HeldFolder, name: str, mode: int = 0o777) -> None:
        make(self, name, mode)
        if name.startswith(".klack-"):
            (tmp_path / name).rename(tmp_path / "aside")
            (tmp_path / "project").rename(tmp_path / name)

    monkeypatch.setattr(HeldFolder, "make", swapped)
    with pytest.raises(InputError, match="has replaced klack's own"):
        write_one(tmp_path)
    (moved,) = tmp_path.glob(STAGES)
    assert tree(moved) == {"work": "mine"}


# --------------------------------------------------------------------------- a second user


@as_root
def test_what_another_user_planted_is_left_alone(tmp_path: Path):
    shared, home = open_to_all(tmp_path / "shared"), tmp_path / "home"
    home.mkdir()
    (home / "keys").write_text("secret")

    def plant() -> None:
        (shared / ".klack-x").mkdir()
        (shared / ".klack-x" / "ready").symlink_to(home)
        os.mkfifo(shared / own_lock_name().replace(str(NOBODY), "0"))

    assert as_nobody(plant) == 0
    before = tree(home)
    with pytest.warns(LeftAloneWarning, match=f"of another user \\(number {NOBODY}\\)"):
        write_one(shared)
    assert tree(home) == before
    assert (shared / "out").read_text() == "mine"
    assert (shared / ".klack-x" / "ready").is_symlink()


@as_root
def test_a_lock_of_another_user_stops_nobody(tmp_path: Path):
    """He holds a lock on the folder, and on everything in it that he can open."""
    shared = open_to_all(tmp_path / "shared")
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        import fcntl

        os.setuid(NOBODY)
        handles = [os.open(shared, os.O_RDONLY)]
        handles.append(os.open(shared / own_lock_name().replace(str(NOBODY), "0"), os.O_CREAT))
        for handle in handles:
            fcntl.flock(handle, fcntl.LOCK_EX)
        os.write(writer, b"x")
        time.sleep(60)
        os._exit(0)
    os.read(reader, 1)
    begin = time.monotonic()
    try:
        write_one(shared)
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert (shared / "out").read_text() == "mine"
    assert time.monotonic() - begin < 29  # s; it was never waited for: 30 s is the patience


@as_root
def test_two_users_read_one_truth(tmp_path: Path):
    """A is killed when its result is ready; B writes; both read that of B, before and after."""
    shared = open_to_all(tmp_path / "shared")
    (shared / "r").write_text("old")
    (shared / "r").chmod(0o666)
    dead_stage_in(shared, "of root")
    seen = shared / "seen"

    def read_and_write() -> None:
        first = (completed(shared) / "r").read_text()
        with whole_file(shared / "r") as new:
            new.write_text("of nobody")
        seen.write_text(first + ", " + (completed(shared) / "r").read_text())

    assert as_nobody(read_and_write) == 0
    assert seen.read_text() == "old, of nobody"
    assert (completed(shared) / "r").read_text() == "of nobody"
    assert list(shared.glob(".klack-*")) == []


# --------------------------------------------------------------------------- odd targets


def klack(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run klack as a process of its own, which must end by itself."""
    return subprocess.run(
        [sys.executable, "-m", "klack", *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.mark.slow
def test_a_pipe_that_nobody_reads_is_one_error(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    done = klack("schema", "--json", str(tmp_path / "pipe"))
    assert done.returncode == 2
    assert done.stderr.startswith("klack schema: --json")
    assert done.stderr.count("\n") == 2


def test_a_full_device_and_a_pipe_as_folder(tmp_path: Path, capsys):
    if Path("/dev/full").exists():
        assert main(["schema", "--json", "/dev/full"]) == 2
    os.mkfifo(tmp_path / "pipe")
    assert main(["reduce", "demo-valve", "--out", str(tmp_path / "pipe")]) == 2
    assert "Traceback" not in capsys.readouterr().err


@as_root
def test_a_link_of_another_user_is_no_folder_for_results(tmp_path: Path, capsys):
    shared, home = open_to_all(tmp_path / "shared"), tmp_path / "home"
    home.mkdir()
    assert as_nobody(lambda: (shared / "out").symlink_to(home)) == 0

    assert main(["reduce", "demo-valve", "--out", str(shared / "out")]) == 2
    assert f"a symbolic link of another user (number {NOBODY})" in capsys.readouterr().err
    with pytest.raises(InputError, match="a symbolic link of another user"):
        write_one(shared / "out")
    assert tree(home) == {}
    (tmp_path / "own").symlink_to(home)
    write_one(tmp_path / "own")
    assert tree(home) == {"out": "mine"}


@as_root
def test_a_pipe_or_a_link_of_another_user_is_not_written_through(tmp_path: Path, capsys):
    shared = open_to_all(tmp_path / "shared")

    def plant() -> None:
        os.mkfifo(shared / "pipe")
        (shared / "link").symlink_to("/dev/null")

    assert as_nobody(plant) == 0
    for name in ("pipe", "link"):
        assert main(["schema", "--json", str(shared / name)]) == 2
        assert f"of another user (number {NOBODY})" in capsys.readouterr().err


def test_no_device_or_pipe_is_replaced(tmp_path: Path):
    os.mkfifo(tmp_path / "out")
    with pytest.raises(InputError, match="a named pipe has the name 'out'"):
        write_one(tmp_path)
    assert (tmp_path / "out").is_fifo()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_held_folder_follows_no_link_inside(tmp_path: Path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    with HeldFolder(tmp_path) as folder, pytest.raises(OSError, match=r"link|directory"):
        folder.inner("link")
