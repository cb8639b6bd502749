"""Runs of the browser application: found again, cancelled, told apart."""

import errno
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from klack.app import jobs as jobs_module
from klack.app.folder import OpenFolder
from klack.app.jobs import Job, Jobs
from klack.errors import InputError


@pytest.fixture
def folder(tmp_path: Path) -> OpenFolder:
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
def test_a_run_tells_what_went_wrong_in_the_words_of_klack(folder):
    jobs = Jobs(folder)
    jobs.start("impact", "bad.yaml", "klack-results/bad")

    job = ended(jobs)

    assert (job.state, job.code) == ("failed", 2)
    assert "nothing" in job.told
    assert "Try:" in job.told


def test_another_server_finds_a_run_and_cancels_it(folder, sleeping):
    Jobs(folder).start("impact", "bad.yaml", "out")
    other = Jobs(folder)  # the first one was killed

    (job,) = other.all()
    assert job.state == "running"
    with pytest.raises(InputError, match="beside another"):
        other.start("impact", "bad.yaml", "out")
    other.cancel(job.name)
    sleeping[0].wait(10)

    assert ended(other).state == "cancelled"
    other.forget(job.name)
    assert other.all() == []


def test_a_run_that_was_killed_is_lost_and_its_number_may_be_given_out_again(folder, sleeping):
    jobs = Jobs(folder)
    job = jobs.start("impact", "bad.yaml", "out")
    sleeping[0].kill()
    sleeping[0].wait(10)
    assert ended(jobs).state == "lost"

    file = folder.path / ".klack-app" / "jobs" / job.name / "process.json"
    own = psutil.Process()
    file.write_text(json.dumps({"pid": own.pid, "begun": own.create_time() - 100.0}))

    assert ended(jobs).state == "lost"
    jobs.cancel(job.name)  # this process goes on


def test_progress_is_read_from_the_folder(folder, sleeping):
    jobs = Jobs(folder)
    place = folder.path / ".klack-app" / "jobs" / jobs.start("impact", "bad.yaml", "out").name
    (place / "progress.json").write_text('{"stage": "modes", "fraction": 0.25}')

    (found,) = jobs.all()

    assert (found.stage, found.fraction) == ("modes", 0.25)


@pytest.mark.parametrize("name", ["..", "../../x", "20260101-000000-0123456g", ""])
def test_names_of_runs_lead_nowhere_else(folder, name):
    for use in (Jobs(folder).cancel, Jobs(folder).forget):
        with pytest.raises(InputError):
            use(name)


def test_what_is_started_is_bounded(folder, sleeping):
    jobs = Jobs(folder)
    for bad in ("rm", "cache", "app"):
        with pytest.raises(InputError, match="one of"):
            jobs.start(bad, "bad.yaml", "out")
    with pytest.raises(InputError):
        jobs.start("impact", "../bad.yaml", "out")
    for k in range(4):
        jobs.start("impact", "bad.yaml", f"out{k}")
    with pytest.raises(InputError, match="at most 4"):
        jobs.start("impact", "bad.yaml", "out9")


def test_damaged_files_of_a_run_are_no_run(folder):
    place = folder.path / ".klack-app" / "jobs" / "20260101-000000-01234567"
    place.mkdir(parents=True)
    for text in ("", "[]", "{}", '{"command": 1}', "{"):
        (place / "job.json").write_text(text)
        assert Jobs(folder).all() == []


def test_a_run_that_cannot_be_written_down_is_not_left_running(folder, sleeping, monkeypatch):
    def write(held, name, values):
        if name == "process.json":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(jobs_module, "_write", write)

    with pytest.raises(InputError, match="No space left on device, expected room"):
        Jobs(folder).start("impact", "bad.yaml", "klack-results/bad")
    assert [child.poll() is not None for child in sleeping] == [True]
    assert list((folder.path / ".klack-app" / "jobs").iterdir()) == []


def test_a_run_that_misses_the_first_request_to_stop_is_asked_again(folder, monkeypatch):
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
    jobs = Jobs(folder)
    name = jobs.start("impact", "bad.yaml", "klack-results/bad").name
    place = folder.path / ".klack-app" / "jobs" / name

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


def test_a_double_click_starts_one_run(folder, sleeping):
    jobs = Jobs(folder)

    def start(_):
        try:
            return jobs.start("impact", "bad.yaml", "klack-results/bad")
        except InputError:
            return None

    with ThreadPoolExecutor(4) as threads:
        found = [job for job in threads.map(start, range(4)) if job is not None]

    assert len(found) == len(sleeping) == 1
