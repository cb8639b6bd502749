"""Files and runs of the browser application.

Files of the browser application: only below the folder, whole, bounded.

The application writes and deletes only its own files, and waits for no odd one of others.

Runs of the browser application: found again, cancelled, told apart.
"""

import asyncio
import errno
import json
import os
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from klack.analyses import store
from klack.app import folder as app_folder
from klack.app import jobs as jobs_module
from klack.app.folder import LARGEST_CASE, OpenFolder, result_names
from klack.app.jobs import Job, Jobs
from klack.app.state import Notes, Sounds, State, Uploads
from klack.app.valve_plan import Plans, ValvePlan
from klack.case import case_text
from klack.errors import InputError
from klack.terminal.progress import PROGRESS_FILE, show_progress

TEXT = "klack: 1\ntitle: <script>alert(1)</script>\n"


@pytest.fixture
def folder(tmp_path: Path) -> OpenFolder:
    """A folder with a case, beside a secret."""
    (tmp_path / "secret.yaml").write_text("klack: secret\n")
    place = tmp_path / "cases"
    (place / "valve").mkdir(parents=True)
    (place / "valve" / "case.yaml").write_text(TEXT)
    return OpenFolder(place)


@pytest.mark.parametrize(
    "path",
    [
        "../secret.yaml",
        "valve/../../secret.yaml",
        "/etc/passwd",
        "valve//case.yaml",
        "./valve/case.yaml",
        "valve\\..\\secret.yaml",
        "valve/case.yaml\0",
        "",
        "..",
        "valve/",
    ],
)
def test_no_path_leads_out(folder, path):
    for use in (folder.read, folder.case_text, folder.absolute):
        with pytest.raises(InputError):
            use(path)
    with pytest.raises(InputError):
        folder.write(path, TEXT)
    assert not folder.exists(path)
    assert (folder.path.parent / "secret.yaml").read_text() == "klack: secret\n"


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no links here")
def test_no_link_is_followed(folder):
    (folder.path / "link.yaml").symlink_to(folder.path.parent / "secret.yaml")
    (folder.path / "up").symlink_to(folder.path.parent)

    for path in ("link.yaml", "up/secret.yaml"):
        with pytest.raises(InputError):
            folder.read(path)
        with pytest.raises(InputError):
            folder.write(path, TEXT)
        with pytest.raises(InputError):
            folder.make_file(path, TEXT)
    found = folder.look()
    assert found.cases == ("valve/case.yaml",)
    assert found.odd == ("link.yaml (a symbolic link)", "up (a symbolic link)")
    assert (folder.path.parent / "secret.yaml").read_text() == "klack: secret\n"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_case_of_any_editor_is_listed(folder, encoding):
    (folder.path / "a.yaml").write_bytes(TEXT.encode(encoding))
    assert folder.look().cases == ("a.yaml", "valve/case.yaml")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_does_not_block(folder):
    os.mkfifo(folder.path / "pipe.yaml")

    with pytest.raises(InputError, match="no plain file"):
        folder.read("pipe.yaml")


def test_files_are_bounded(folder):
    (folder.path / "large.yaml").write_bytes(b"#" * (LARGEST_CASE + 1))

    assert LARGEST_CASE == case_text.LARGEST_CASE
    with pytest.raises(InputError, match="bytes, expected at most 1000000"):
        folder.case_text("large.yaml")
    with pytest.raises(InputError, match="bytes, expected at most 1000000"):
        folder.write("new.yaml", "#" * (LARGEST_CASE + 1))
    assert not (folder.path / "new.yaml").exists()


def test_only_yaml_is_a_case_and_only_text(folder):
    (folder.path / "notes.txt").write_text("x")
    (folder.path / "bytes.yaml").write_bytes(b"\xff\xfe")

    with pytest.raises(InputError, match=r"no \.yaml"):
        folder.case_text("notes.txt")
    with pytest.raises(InputError, match="not UTF-8 text"):
        folder.case_text("bytes.yaml")


def test_a_file_is_replaced_as_a_whole_and_keeps_its_rights(folder):
    file = folder.path / "valve" / "case.yaml"
    file.chmod(0o640)
    before = file.stat().st_ino

    folder.write("valve/case.yaml", "klack: 1\n")

    assert file.read_text() == "klack: 1\n"
    assert file.stat().st_mode & 0o777 == 0o640
    assert file.stat().st_ino != before  # another file took the name: never half of one
    assert [item.name for item in file.parent.iterdir()] == ["case.yaml"]


def test_new_files_replace_nothing(folder):
    folder.make_file("other/case.yaml", TEXT)

    with pytest.raises(InputError, match="already exists"):
        folder.make_file("valve/case.yaml", "klack: 1\n")
    assert folder.case_text("valve/case.yaml") == TEXT
    assert folder.look().cases == ("other/case.yaml", "valve/case.yaml")


def test_results_are_found_by_their_store(folder):
    assert app_folder.RESULT_NAME == store.RESULT_NAME
    (folder.path / "klack-results" / "a" / store.RESULT_NAME).mkdir(parents=True)

    found = folder.look()

    assert found.results == ("klack-results/a",)
    assert found.is_whole


def test_a_folder_has_to_be_one(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        OpenFolder(tmp_path / "none")


def test_notes_and_drafts_outlive_the_server(folder):
    Notes(folder).set_note("valve/case.yaml", "hold it <b>tight</b>")
    Notes(folder).set_draft("valve/case.yaml", "klack: 1\ntitle: half")
    Notes(folder).set_draft("other.yaml", "x")

    again = Notes(folder)

    assert again.note("valve/case.yaml") == "hold it <b>tight</b>"
    assert again.draft("valve/case.yaml") == "klack: 1\ntitle: half"
    again.set_draft("valve/case.yaml", None)
    assert again.draft("valve/case.yaml") is None
    assert again.draft("other.yaml") == "x"
    with pytest.raises(InputError, match="at most"):
        again.set_note("valve/case.yaml", "x" * 20_001)


def test_other_commands_load_no_browser_application():
    code = (
        "import sys, klack, klack.cli.commands; "
        "sys.exit(any(n.startswith(('nicegui', 'fastapi', 'klack.app')) for n in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_sounds_are_bounded_and_have_names_that_cannot_be_guessed():
    sounds = Sounds(most=2)
    first, *others = [sounds.add(bytes([k])) for k in range(3)]

    def name(address: str) -> str:
        return address.removeprefix("/sound/").removesuffix(".wav")

    assert sounds.get(name(first)) is None
    assert [sounds.get(name(address)) for address in others] == [b"\1", b"\2"]
    assert len(name(first)) >= 20


def test_a_text_of_another_page_is_not_overwritten(folder):
    notes, other = Notes(folder), Notes(folder)

    assert notes.exchange_draft("a.yaml", None, "one")
    assert not other.exchange_draft("a.yaml", None, "two")  # it has seen no draft
    assert not other.exchange_draft("a.yaml", None, None)  # what it saved is not what waits
    assert notes.draft("a.yaml") == "one"
    assert notes.exchange_draft("a.yaml", "one", "one more")
    assert other.exchange_draft("a.yaml", "one more", None)
    assert notes.exchange_draft("a.yaml", "one more", "one more")  # nothing new since it was kept
    assert notes.draft("a.yaml") is None  # discarded it stays
    assert notes.draft("a.yaml") is None


def test_no_two_cases_write_their_results_to_one_place():
    cases = ["x.yaml", "a/x.yaml", "a-x.yaml", "valve.yaml", "valve/case.yaml", "case.yaml"]

    names = result_names(cases)

    assert len(set(names.values())) == len(cases)
    assert names["case.yaml"] == "case"
    assert result_names(["valve/case.yaml"]) == {"valve/case.yaml": "valve"}


def test_a_page_that_was_left_makes_room_for_another(folder):
    state = State(folder)
    open_pages = [state.explorer() for _ in range(3)]

    with pytest.raises(InputError, match="3 open slider pages"):
        state.explorer()
    state.mark_left(open_pages[0], is_left=True)
    state.mark_left(open_pages[1], is_left=True)
    state.mark_left(open_pages[0], is_left=False)  # it has come back
    assert state.explorer() not in open_pages
    with pytest.raises(InputError, match="reload the page"):
        asyncio.run(open_pages[1].call("move", {}))
    with pytest.raises(InputError, match="3 open slider pages"):
        state.explorer()
    state.close()


def test_a_folder_that_was_renamed_is_named_and_not_made_again(folder):
    notes = Notes(folder)
    folder.path.rename(folder.path.with_name("moved"))

    for act in (
        lambda: notes.set_draft("case.yaml", "typed"),
        lambda: folder.case_text("case.yaml"),
        lambda: folder.write("case.yaml", "typed"),
    ):
        with pytest.raises(InputError, match="former name"):
            act()
    assert not folder.path.exists()


def test_a_full_disk_is_named_as_such(folder, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(app_folder, "synchronise", full)

    with pytest.raises(
        InputError, match="No space left on device, expected free disk space"
    ) as refused:
        folder.write("case.yaml", "typed")
    assert "reload" not in str(refused.value)  # the text is in the page alone


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
def folder_own(tmp_path: Path) -> OpenFolder:
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
def test_what_is_behind_a_planted_link_stays_as_it_was(planted, act, folder_own, outside):
    before = _content(outside)
    link = folder_own.path / planted
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(outside, target_is_directory=True)

    with pytest.raises(InputError, match="a link"):
        act(folder_own)
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
    folder_own, outside, monkeypatch
):
    """Exact: what is behind the link stays, and the folder that was moved gets the ending."""
    real = subprocess.Popen
    monkeypatch.setattr(
        jobs_module.subprocess,
        "Popen",
        lambda words, **more: real([*words[:2], "-c", _WAITING, *words[4:]], **more),
    )
    jobs, before = Jobs(folder_own), _content(outside)
    jobs.start("impact", "case.yaml", "klack-results/case")
    (place,) = (folder_own.path / ".klack-app" / "jobs").iterdir()
    place.rename(folder_own.path / "moved")
    place.symlink_to(outside, target_is_directory=True)
    (folder_own.path / "go").touch()
    for _ in range(1200):
        if (folder_own.path / "moved" / "ending.json").exists():
            break
        time.sleep(0.05)

    assert (folder_own.path / "moved" / "ending.json").exists()
    assert _content(outside) == before


def test_runs_and_notes_behind_a_link_are_not_there(folder_own, outside):
    (folder_own.path / ".klack-app").symlink_to(outside, target_is_directory=True)
    jobs, before = Jobs(folder_own), _content(outside)

    assert Notes(folder_own).note("case.yaml") == ""
    assert jobs.all() == []
    jobs.forget(NAME)
    jobs.cancel(NAME)
    assert _content(outside) == before


def test_uploads_beyond_the_most_go_and_files_of_other_names_stay(folder_own):
    place = folder_own.path / ".klack-app" / "uploads"
    place.mkdir(parents=True)
    strange = [f"part {number}.step" for number in range(20)]
    for name in strange:
        (place / name).write_text("ISO-10303-21;")
        os.utime(place / name, (1.0, 1.0))
    own = [_upload(folder_own).rpartition("/")[2] for _ in range(14)]

    assert {path.name for path in place.iterdir()} == {*strange, *own[2:]}


# --------------------------------------------------------------------------- odd entries


@pytest.fixture
def odd(folder_own: OpenFolder) -> OpenFolder:
    """The opened folder, with entries of all kinds that are no plain files."""
    os.mkfifo(folder_own.path / "pipe.yaml")
    (folder_own.path / "endless.yaml").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as own, chdir(folder_own.path):
        own.bind("socket.step")
    for name in (b"caf\xe9.yaml", b"caf\xe9.step"):
        Path(os.fsdecode(os.fsencode(folder_own.path) + b"/" + name)).write_text("klack: 1\n")
    return folder_own


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


def test_a_result_with_a_pipe_in_it_is_refused_before_it_is_read(folder_own):
    result = folder_own.path / "run" / "result.zarr" / "inner"
    result.mkdir(parents=True)
    (result / "plain").write_text("")
    folder_own.require_plain("run/result.zarr")
    os.mkfifo(result / "zarr.json")

    with pytest.raises(InputError, match=r"run/result\.zarr/inner/zarr\.json.*\n?.*a named pipe"):
        folder_own.require_plain("run/result.zarr")


def test_names_that_are_no_text_are_refused_in_words(folder_own, tmp_path):
    with pytest.raises(InputError, match="not below the folder"):
        folder_own.read("\udce9.yaml")
    strange = tmp_path / os.fsdecode(b"\xe9")
    strange.mkdir()
    with pytest.raises(InputError, match="not UTF-8"):
        OpenFolder(strange)


def test_ten_thousand_entries_hide_no_case(folder_own):
    for number in range(10_000):
        (folder_own.path / f"{number}.yaml").symlink_to("case.yaml")
    (folder_own.path / "z").mkdir()
    (folder_own.path / "z" / "case.yaml").write_text("klack: 1\n")
    found = folder_own.look()

    assert (found.cases, found.is_whole) == (("case.yaml", "z/case.yaml"), True)
    assert len(found.odd) == 10_000


@pytest.fixture
def folder_jobs(tmp_path: Path) -> OpenFolder:
    (tmp_path / "bad.yaml").write_text("klack: 1\nnothing: here\n")
    return OpenFolder(tmp_path)


@pytest.fixture
def sleeping(monkeypatch):
    """Start processes that sleep instead of computing."""
    started = []
    real = subprocess.Popen

    def sleep(arguments, **more):
        child = real([sys.executable, "-c", "import time; time.sleep(60)"], **more)
        started.append(child)
        return child

    monkeypatch.setattr(jobs_module.subprocess, "Popen", sleep)
    yield started
    for child in started:
        child.kill()
        child.wait()


def ended(jobs: Jobs) -> Job:
    for _ in range(1200):
        (job,) = jobs.all()
        if job.state != "running":
            return job
        time.sleep(0.05)
    raise AssertionError("it still runs")


@pytest.mark.slow
def test_a_run_tells_what_went_wrong_in_the_words_of_klack(folder_jobs):
    jobs = Jobs(folder_jobs)
    jobs.start("impact", "bad.yaml", "klack-results/bad")

    job = ended(jobs)

    assert (job.state, job.code) == ("failed", 2)
    assert "nothing" in job.told
    assert "Try:" in job.told


def test_another_server_finds_a_run_and_cancels_it(folder_jobs, sleeping):
    Jobs(folder_jobs).start("impact", "bad.yaml", "out")
    other = Jobs(folder_jobs)  # the first one was killed

    (job,) = other.all()
    assert job.state == "running"
    with pytest.raises(InputError, match="one at a time"):
        other.start("impact", "bad.yaml", "out")
    other.cancel(job.name)
    sleeping[0].wait(10)

    assert ended(other).state == "cancelled"
    other.forget(job.name)
    assert other.all() == []


def test_a_run_that_was_killed_is_lost_and_its_number_may_be_given_out_again(folder_jobs, sleeping):
    jobs = Jobs(folder_jobs)
    job = jobs.start("impact", "bad.yaml", "out")
    sleeping[0].kill()
    sleeping[0].wait(10)
    assert ended(jobs).state == "lost"

    file = folder_jobs.path / ".klack-app" / "jobs" / job.name / "process.json"
    own = psutil.Process()
    file.write_text(json.dumps({"pid": own.pid, "begun": own.create_time() - 100.0}))

    assert ended(jobs).state == "lost"
    jobs.cancel(job.name)  # this process goes on


def test_progress_is_read_from_the_folder(folder_jobs, sleeping):
    jobs = Jobs(folder_jobs)
    place = folder_jobs.path / ".klack-app" / "jobs" / jobs.start("impact", "bad.yaml", "out").name
    (place / "progress.json").write_text('{"stage": "modes", "fraction": 0.25}')

    (found,) = jobs.all()

    assert (found.stage, found.fraction) == ("modes", 0.25)


def test_a_second_run_says_how_far_it_is_of_the_whole(folder_jobs, sleeping):
    """From the stages of the first one: 2, 6 and 4 s; half of the second are 5 of 12 s."""
    jobs = Jobs(folder_jobs)
    runs = folder_jobs.path / ".klack-app" / "jobs"
    first = runs / jobs.start("impact", "bad.yaml", "out").name
    told = {"stage": "report", "fraction": 0.0, "since": 108.0}
    told["spent"] = {"mesh": 2.0, "modes": 6.0}
    (first / "progress.json").write_text(json.dumps(told))
    (first / "ending.json").write_text('{"code": 0, "ended": 112.0}')
    sleeping[0].kill()
    sleeping[0].wait()
    (earlier,) = jobs.all()
    job = jobs.start("impact", "bad.yaml", "out")
    told = {"stage": "modes", "fraction": 0.5, "since": 202.0, "spent": {"mesh": 2.0}}
    (runs / job.name / "progress.json").write_text(json.dumps(told))
    (found,) = (one for one in jobs.all() if one.name == job.name)
    share, words = found.progress(found.started + 5.0)
    alone, alone_words = replace(found, before={}).progress(found.started + 5.0)

    assert dict(earlier.spent) == {"mesh": 2.0, "modes": 6.0, "report": 4.0}
    assert share == pytest.approx(5.0 / 12.0, rel=1e-12)
    assert (
        words == "modes (2 of 3), 50 % of it; 5 s so far; about 7 s left, judging by the last run"
    )
    assert (alone, alone_words) == (None, "modes (stage 2), 50 % of it; 5 s so far")
    silent = replace(found, before={}, fraction=0.0, since=found.started + 3.0)
    assert silent.progress(found.started + 15.0)[1] == "modes (stage 2) for 12 s; 15 s so far"


def test_the_file_of_progress_has_the_times_of_the_stages(tmp_path, monkeypatch):
    file = tmp_path / "progress.json"
    monkeypatch.setenv(PROGRESS_FILE, str(file))
    with show_progress() as progress:
        progress("mesh", 0.0)
        time.sleep(0.3)
        progress("modes", 0.0)
    told = json.loads(file.read_text())

    assert told["stage"] == "modes"
    assert [*told["spent"]] == ["starting", "mesh"]
    assert 0.29 < told["spent"]["mesh"] < 3.0  # the sleep, and a loaded machine


@pytest.mark.parametrize("name", ["..", "../../x", "20260101-000000-0123456g", ""])
def test_names_of_runs_lead_nowhere_else(folder_jobs, name):
    for use in (Jobs(folder_jobs).cancel, Jobs(folder_jobs).forget):
        with pytest.raises(InputError):
            use(name)


def test_what_is_started_is_bounded(folder_jobs, sleeping):
    jobs = Jobs(folder_jobs)
    for bad in ("rm", "cache", "app"):
        with pytest.raises(InputError, match="one of"):
            jobs.start(bad, "bad.yaml", "out")
    with pytest.raises(InputError):
        jobs.start("impact", "../bad.yaml", "out")
    for k in range(4):
        jobs.start("impact", "bad.yaml", f"out{k}")
    with pytest.raises(InputError, match="at most 4"):
        jobs.start("impact", "bad.yaml", "out9")


def test_damaged_files_of_a_run_are_no_run(folder_jobs):
    place = folder_jobs.path / ".klack-app" / "jobs" / "20260101-000000-01234567"
    place.mkdir(parents=True)
    for text in ("", "[]", "{}", '{"command": 1}', "{"):
        (place / "job.json").write_text(text)
        assert Jobs(folder_jobs).all() == []


def test_a_run_that_cannot_be_written_down_is_not_left_running(folder_jobs, sleeping, monkeypatch):
    def write(held, name, values):
        if name == "process.json":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(jobs_module, "_write", write)

    with pytest.raises(InputError, match="No space left on device, expected free disk space"):
        Jobs(folder_jobs).start("impact", "bad.yaml", "klack-results/bad")
    assert [child.poll() is not None for child in sleeping] == [True]
    assert list((folder_jobs.path / ".klack-app" / "jobs").iterdir()) == []


def test_a_run_that_misses_the_first_request_to_stop_is_asked_again(folder_jobs, monkeypatch):
    deaf = """
import signal, time
def drop(*_):
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    print("dropped", flush=True)
signal.signal(signal.SIGTERM, drop)
print("listens", flush=True)
time.sleep(60)
"""
    real = subprocess.Popen
    monkeypatch.setattr(
        jobs_module.subprocess,
        "Popen",
        lambda arguments, **more: real([sys.executable, "-c", deaf], **more),
    )
    jobs = Jobs(folder_jobs)
    name = jobs.start("impact", "bad.yaml", "klack-results/bad").name
    place = folder_jobs.path / ".klack-app" / "jobs" / name

    def says(word):
        while word not in (place / "stdout").read_text():
            time.sleep(0.01)

    says("listens")
    jobs.cancel(name)
    (job,) = jobs.all()
    assert (job.state, job.stage) == ("running", "stopping")
    says("dropped")  # two requests at once would be one
    os.utime(place / "cancelled", (0, 0))  # asked long ago

    assert ended(jobs).state == "cancelled"


def test_a_double_click_starts_one_run(folder_jobs, sleeping):
    jobs = Jobs(folder_jobs)

    def start(_):
        try:
            return jobs.start("impact", "bad.yaml", "klack-results/bad")
        except InputError:
            return None

    with ThreadPoolExecutor(4) as threads:
        found = [job for job in threads.map(start, range(4)) if job is not None]

    assert len(found) == len(sleeping) == 1
