"""The application writes and deletes only its own files, and waits for no odd one of others."""

import asyncio
import os
import socket
import subprocess
import sys
import time
from contextlib import chdir
from pathlib import Path

import pytest

from klack.app import folder as app_folder
from klack.app import jobs as jobs_module
from klack.app.folder import OpenFolder
from klack.app.jobs import Jobs
from klack.app.state import Notes, Uploads
from klack.app.valve_plan import Plans, ValvePlan
from klack.errors import InputError

NAME = "20260101-000000-01234567"


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A folder of the user's beside the opened one, with more STEP files than are kept."""
    place = tmp_path / "outside"
    for inner in ("uploads", f"jobs/{NAME}", "run"):
        (place / inner).mkdir(parents=True)
    for number in range(20):
        for folder in (place, place / "uploads"):
            (folder / f"{number:024x}.step").write_text("ISO-10303-21;")
    for name in ("notes.json", "new-valve.json"):
        (place / name).write_text('{"case.yaml": "of another"}')
    (place / "jobs" / NAME / "job.json").write_text(
        '{"command": "impact", "case": "case.yaml", "out": "x", "started": 1.0}'
    )
    return place


@pytest.fixture
def folder(tmp_path: Path) -> OpenFolder:
    """An opened folder with a case."""
    (tmp_path / "cases").mkdir()
    (tmp_path / "cases" / "case.yaml").write_text("klack: 1\n")
    return OpenFolder(tmp_path / "cases")


def _content(place: Path) -> dict[str, bytes]:
    return {
        path.relative_to(place).as_posix(): path.read_bytes() if path.is_file() else b""
        for path in place.rglob("*")
    }


def _upload(folder: OpenFolder) -> str:
    async def parts():
        yield b"ISO-10303-21;"

    return asyncio.run(Uploads(folder).take(parts()))


def _start(folder: OpenFolder) -> object:
    return Jobs(folder).start("impact", "case.yaml", "klack-results/case")


@pytest.mark.parametrize(
    ("planted", "act"),
    [
        (".klack-app", _upload),
        (".klack-app/uploads", _upload),
        (".klack-app", lambda folder: Notes(folder).set_note("case.yaml", "mine")),
        (".klack-app", lambda folder: Notes(folder).set_draft("case.yaml", "mine")),
        (".klack-app", lambda folder: Plans(folder).keep(ValvePlan())),
        (".klack-app", lambda folder: Plans(folder).forget()),
        (".klack-app", _start),
        (".klack-app/jobs", _start),
        ("klack-results", _start),
        ("klack-results/case", _start),
    ],
)
def test_what_is_behind_a_planted_link_stays_as_it_was(planted, act, folder, outside):
    before = _content(outside)
    link = folder.path / planted
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(outside, target_is_directory=True)

    with pytest.raises(InputError, match="a link"):
        act(folder)
    assert _content(outside) == before


_WAITING = """
import pathlib, sys, time
while not pathlib.Path("go").exists():
    time.sleep(0.02)
from klack.cli.job_process import run
sys.exit(run(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="folders are named by handles on Linux")
def test_a_run_writes_nothing_behind_a_link_that_takes_the_place_of_its_folder(
    folder, outside, monkeypatch
):
    """Exact: what is behind the link stays, and the folder that was moved gets the ending."""
    real = subprocess.Popen
    monkeypatch.setattr(
        jobs_module.subprocess,
        "Popen",
        lambda words, **more: real([*words[:2], "-c", _WAITING, *words[4:]], **more),
    )
    jobs, before = Jobs(folder), _content(outside)
    jobs.start("impact", "case.yaml", "klack-results/case")
    (place,) = (folder.path / ".klack-app" / "jobs").iterdir()
    place.rename(folder.path / "moved")
    place.symlink_to(outside, target_is_directory=True)
    (folder.path / "go").touch()
    for _ in range(1200):
        if (folder.path / "moved" / "ending.json").exists():
            break
        time.sleep(0.05)

    assert (folder.path / "moved" / "ending.json").exists()
    assert _content(outside) == before


def test_runs_and_notes_behind_a_link_are_not_there(folder, outside):
    (folder.path / ".klack-app").symlink_to(outside, target_is_directory=True)
    jobs, before = Jobs(folder), _content(outside)

    assert Notes(folder).note("case.yaml") == ""
    assert jobs.all() == []
    jobs.forget(NAME)
    jobs.cancel(NAME)
    assert _content(outside) == before


def test_uploads_beyond_the_most_go_and_files_of_other_names_stay(folder):
    place = folder.path / ".klack-app" / "uploads"
    place.mkdir(parents=True)
    strange = [f"part {number}.step" for number in range(20)]
    for name in strange:
        (place / name).write_text("ISO-10303-21;")
        os.utime(place / name, (1.0, 1.0))
    own = [_upload(folder).rpartition("/")[2] for _ in range(14)]

    assert {path.name for path in place.iterdir()} == {*strange, *own[2:]}


# --------------------------------------------------------------------------- odd entries


@pytest.fixture
def odd(folder: OpenFolder) -> OpenFolder:
    """The opened folder, with entries of all kinds that are no plain files."""
    os.mkfifo(folder.path / "pipe.yaml")
    (folder.path / "endless.yaml").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as own, chdir(folder.path):
        own.bind("socket.step")
    for name in (b"caf\xe9.yaml", b"caf\xe9.step"):
        Path(os.fsdecode(os.fsencode(folder.path) + b"/" + name)).write_text("klack: 1\n")
    return folder


@pytest.mark.skipif(sys.platform != "linux", reason="names that are no text are of Linux")
def test_the_list_names_odd_entries_and_waits_for_none(odd):
    found = odd.look()

    assert (found.cases, found.steps, found.is_whole) == (("case.yaml",), (), True)
    assert found.odd == (
        "caf\\xe9.step (a name that is not UTF-8)",
        "caf\\xe9.yaml (a name that is not UTF-8)",
        "endless.yaml (a symbolic link)",
        "pipe.yaml (a named pipe)",
        "socket.step (a socket)",
    )
    for text in found.odd:
        text.encode()  # else no page of it reaches the browser


def test_a_file_that_becomes_a_pipe_while_it_is_listed_does_not_block(odd):
    assert not app_folder._is_case(odd.path / "pipe.yaml")
    assert not app_folder._is_case(odd.path / "endless.yaml")
    assert app_folder._is_case(odd.path / "case.yaml")


def test_a_result_with_a_pipe_in_it_is_refused_before_it_is_read(folder):
    result = folder.path / "run" / "result.zarr" / "inner"
    result.mkdir(parents=True)
    (result / "plain").write_text("")
    folder.require_plain("run/result.zarr")
    os.mkfifo(result / "zarr.json")

    with pytest.raises(InputError, match=r"run/result\.zarr/inner/zarr\.json.*\n?.*a named pipe"):
        folder.require_plain("run/result.zarr")


def test_names_that_are_no_text_are_refused_in_words(folder, tmp_path):
    with pytest.raises(InputError, match="not below the folder"):
        folder.read("\udce9.yaml")
    strange = tmp_path / os.fsdecode(b"\xe9")
    strange.mkdir()
    with pytest.raises(InputError, match="not UTF-8"):
        OpenFolder(strange)


def test_ten_thousand_entries_hide_no_case(folder):
    for number in range(10_000):
        (folder.path / f"{number}.yaml").symlink_to("case.yaml")
    (folder.path / "z").mkdir()
    (folder.path / "z" / "case.yaml").write_text("klack: 1\n")
    found = folder.look()

    assert (found.cases, found.is_whole) == (("case.yaml", "z/case.yaml"), True)
    assert len(found.odd) == 10_000
