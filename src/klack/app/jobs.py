"""Runs that were started from the application, each in a process of its own.

Its folder below ``.klack-app/jobs`` holds all of it, so that a server that was killed finds it
again::

    job.json       what was asked for: command, case, folder of the result
    process.json   number of the process and when it began
    progress.json  stage, fraction and seconds of earlier stages; of a study also its points
    curves.json    curves so far, of commands that draw them
    live           record of a study that runs or was stopped
    ending.json    exit code, when it ended
    cancelled      empty: it was asked to stop
    stdout, stderr what the command printed
"""

import json
import os
import re
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from pathlib import Path
from threading import Lock
from typing import Any, Literal

import numpy as np
import psutil

from klack.app.folder import OWN, OpenFolder, replace_file, result_names
from klack.errors import InputError
from klack.files.held import HeldFolder
from klack.machine.progress import PointCount, SoFar, duration_text
from klack.terminal.progress import CURVES_FILE, PROGRESS_FILE

__all__ = ["COMMANDS", "LIVE", "OF_STUDIES", "Job", "Jobs", "State"]

State = Literal["running", "done", "failed", "cancelled", "lost"]
COMMANDS = ("impact", "stroke", "magnet", "noise", "shots", "study", "optimise")
"""Commands that the application starts."""
OF_STUDIES = ("study", "optimise")
"""Those of them that are stopped and resumed."""

LIVE = "live"
"""Of :mod:`klack.analyses.study.live`, whose import takes seconds."""

_RUNS = "jobs"
_NAME = re.compile(r"[0-9]{8}-[0-9]{6}-[0-9a-f]{8}")
_MOST_RUNNING = 4
_AGAIN = 10.0  # [s] after which a run that was cancelled is asked again
_TOLD = 4000  # last characters of what a command printed
_STOPPED = (130, 143)
_CANCELLED = "cancelled"  # file: a process that only begins has no exit code to tell


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run.

    Parameters
    ----------
    name
        Of its folder.
    case, out, study
        Paths from the folder; that of a study in the case is empty.
    started [s]
        Since 1970.
    stage
        What it does now, to a ``fraction``.
    told
        The last of what it printed.
    points
        Of a study that has begun to compute.
    since, ended [s]
        Since 1970: when the stage began, and the run ended; 0 if not.
    spent [s]
        Time of each stage before, once ended of all.
    before [s]
        The same of an earlier run of the case that reached its end.
    """

    name: str
    command: str
    case: str
    out: str
    started: float
    state: State = "running"
    stage: str = ""
    fraction: float = 0.0
    code: int | None = None
    told: str = ""
    study: str = ""
    points: PointCount | None = None
    since: float = 0.0
    ended: float = 0.0
    spent: Mapping[str, float] = field(default_factory=dict)
    before: Mapping[str, float] = field(default_factory=dict)

    def progress(self, now: float) -> tuple[float | None, str]:
        """Share of the whole, as long as an earlier run tells it, and words on stage and times."""
        fraction = min(max(self.fraction, 0.0), 1.0)
        words = [self.stage]
        if self.stage in self.before:
            words[0] += f" ({[*self.before].index(self.stage) + 1} of {len(self.before)})"
        elif self.spent:
            words[0] += f" (stage {len({*self.spent} - {self.stage}) + 1})"
        if fraction:
            words[0] += f", {100.0 * fraction:.0f} % of it"
        elif self.since:
            words[0] += f" for {duration_text(max(now - self.since, 0.0))}"
        words.append(f"{duration_text(max(now - self.started, 0.0))} so far")
        if self.stage not in self.before:
            return None, "; ".join(words)
        ahead = [*self.before].index(self.stage)
        times = [*self.before.values()]
        share = fraction or min(max(now - self.since, 0.0) / max(times[ahead], 1e-9), 1.0)
        left = sum(times[ahead + 1 :]) + times[ahead] * (1.0 - share)
        words.append(f"about {duration_text(left)} left, judging by the last run")
        return 1.0 - left / max(sum(times), 1e-9), "; ".join(words)


class Jobs:
    """All runs of a folder."""

    def __init__(self, folder: OpenFolder) -> None:
        self._folder = folder
        self._place = folder.path / OWN / _RUNS
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._starting = Lock()  # pages start runs in threads: a double click is two of them

    def start(
        self, command: str, case: str, out: str, options: Sequence[str] = (), study: str = ""
    ) -> Job:
        """Start a run that outlives this server.

        A study that was stopped resumes: its points lie in the folder of its result.  InputError
        for too many runs at a time, or one that writes to the same folder.
        """
        if command not in COMMANDS:
            raise _refused(command, f"one of: {', '.join(COMMANDS)}")
        path = self._folder.absolute(case)
        if study:
            options = [*options, "--study", str(self._folder.absolute(study))]
        with self._starting:
            return self._started(command, case, path, out, options, study)

    def start_case(self, command: str, case: str) -> Job:
        """Run a saved case; its result has its name, in ``klack-results``."""
        names = result_names({*self._folder.look().cases, case})
        return self.start(command, case, f"klack-results/{names[case]}")

    def resume(self, job: Job) -> Job:
        """Start a stopped study again, with its points."""
        return self.start(job.command, job.case, job.out, (), job.study)

    def _started(
        self, command: str, case: str, path: Path, out: str, options: Sequence[str], study: str
    ) -> Job:
        running = [job for job in self.all() if job.state == "running"]
        if len(running) >= _MOST_RUNNING:
            raise _refused(f"{len(running)} runs at a time", f"at most {_MOST_RUNNING}")
        if any(job.out == out for job in running):
            raise _refused(f"a second run that writes to {out}", "one at a time")
        name = time.strftime("%Y%m%d-%H%M%S-") + secrets.token_hex(4)
        job = Job(name=name, command=command, case=case, out=out, started=time.time(), study=study)
        arguments = [command, str(path), "--out", str(self._folder.path / out), *options]
        try:
            self._folder.require_own(out)
            with self._folder.own(_RUNS, name) as held:
                _write(held, "job.json", asdict(job))
                self._launch(name, held, arguments)
        except (OSError, InputError) as error:
            child = self._children.pop(name, None)
            if child is not None:  # nobody could tell it from another process
                child.kill()
                child.wait()
            self._remove(name)
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"run of {case}",
                got=error.strerror or str(error),
                expected="free disk space, and permission to write there",
                hint=(
                    "free some space, or change the permissions of the folder, then run it again."
                ),
            ) from None
        return job

    def _remove(self, name: str) -> None:
        with suppress(OSError, InputError), self._folder.own(_RUNS) as held:
            held.remove(name)

    def _launch(self, name: str, held: HeldFolder, arguments: list[str]) -> None:
        # by its handle where the system can: nothing is written behind a link in its place
        place, new = held.steady_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL
        with (
            os.fdopen(held.open("stdout", new), "wb") as output,
            os.fdopen(held.open("stderr", new), "wb") as errors,
        ):
            child = subprocess.Popen(
                # -P: not from the opened folder, where a stranger's numpy.py may lie
                [sys.executable, "-P", "-m", "klack.cli.job_process", str(place), *arguments],
                cwd=self._folder.path,
                env=os.environ | {PROGRESS_FILE: str(place / "progress.json")},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=errors,
                start_new_session=True,
                pass_fds=() if held.handle is None else (held.handle,),
            )
        self._children[name] = child
        begun = psutil.Process(child.pid).create_time()
        _write(held, "process.json", {"pid": child.pid, "begun": begun})

    def all(self) -> list[Job]:
        """Every run, the latest first."""
        try:
            names = sorted(os.listdir(self._place), reverse=True)
        except OSError:
            return []
        read = (self._job(name) for name in names if _NAME.fullmatch(name))
        found = [job for job in read if job is not None]
        whole = {
            (job.command, job.case): job.spent for job in reversed(found) if job.state == "done"
        }
        return [
            replace(job, before=whole.get((job.command, job.case), {}))
            if job.state == "running"
            else job
            for job in found
        ]

    def live(self, name: str) -> Path:
        """Record folder of a running or stopped study."""
        return self._place / _require_name(name) / LIVE

    def curves(self, name: str) -> tuple[SoFar, ...]:
        """What a run has drawn so far."""
        told = self._read(_require_name(name), CURVES_FILE).get("curves", [])
        try:
            return tuple(_curve(one) for one in told)
        except (KeyError, TypeError, ValueError):  # not of this version
            return ()

    def of_result(self, out: str) -> Job | None:
        """Latest run for a result of a study."""
        return next(
            (job for job in self.all() if job.out == out and job.command in OF_STUDIES), None
        )

    def cancel(self, name: str) -> None:
        """Ask a run to stop; nothing is left half written."""
        process = self._process(_require_name(name))
        if process is not None:
            self._ask_to_stop(name, process)

    def forget(self, name: str) -> None:
        """Remove an ended run, not its result."""
        job = self._job(_require_name(name))
        if job is not None and job.state != "running":
            self._remove(name)

    def _job(self, name: str) -> Job | None:
        asked = self._read(name, "job.json")
        if not asked:
            return None
        if name in self._children and self._children[name].poll() is not None:
            del self._children[name]
        process, cancelled = self._process(name), self._place / name / _CANCELLED
        is_running, is_cancelled = process is not None, cancelled.exists()
        if process is not None and is_cancelled and _seconds_since(cancelled) > _AGAIN:
            self._ask_to_stop(name, process)  # a library may have dropped the first request
        ending = self._read(name, "ending.json")  # after the look at the process
        progress = self._read(name, "progress.json")
        try:
            known = {key: asked[key] for key in ("command", "case", "out", "started")}
            code = int(ending["code"]) if ending else None
            stage, since = str(progress.get("stage", "starting")), float(progress.get("since", 0.0))
            spent = {str(of): float(time) for of, time in progress.get("spent", {}).items()}
            end = float(ending.get("ended", 0.0)) if ending else 0.0
            if end and since:
                spent[stage] = spent.get(stage, 0.0) + end - since
            return Job(
                name=name,
                **known,
                state=_state(is_running, code, is_cancelled),
                stage="stopping" if is_cancelled else stage,
                fraction=float(progress.get("fraction", 0.0)),
                code=code,
                told=self._tail(name) if code else "",
                study=str(asked.get("study", "")),
                points=_points(progress.get("points")),
                since=since,
                ended=end,
                spent=spent,
            )
        except (AttributeError, KeyError, TypeError, ValueError):  # not of this version
            return None

    def _process(self, name: str) -> psutil.Process | None:
        """Its process, if running; the number may be another's by now."""
        told = self._read(name, "process.json")
        try:
            process = psutil.Process(int(told["pid"]))
            same = abs(process.create_time() - float(told["begun"])) < 0.01
            alive = process.status() != psutil.STATUS_ZOMBIE
            return process if same and alive else None
        except (psutil.Error, KeyError, TypeError, ValueError):
            return None

    def _ask_to_stop(self, name: str, process: psutil.Process) -> None:
        with self._folder.own(_RUNS, name) as held:
            replace_file(held, _CANCELLED, b"")
        with suppress(psutil.Error):
            process.send_signal(signal.SIGTERM)

    def _read(self, name: str, file: str) -> dict[str, Any]:
        return self._folder.own_json(_RUNS, name, file)

    def _tail(self, name: str) -> str:
        try:
            told = self._folder.read(f"{OWN}/{_RUNS}/{name}/stderr")
        except InputError:
            return ""
        return told.decode("utf-8", errors="replace")[-_TOLD:].strip()


def _seconds_since(file: Path) -> float:
    try:
        return time.time() - file.stat().st_mtime
    except OSError:  # dismissed at this moment
        return 0.0


def _state(is_running: bool, code: int | None, is_cancelled: bool) -> State:
    if code is None:
        return "running" if is_running else "cancelled" if is_cancelled else "lost"
    if code in _STOPPED:
        return "cancelled"
    return "done" if code == 0 else "failed"


def _points(told: Any) -> PointCount | None:
    if not isinstance(told, dict):
        return None
    left = told["left"]
    return PointCount(
        done=int(told["done"]),
        most=int(told["most"]),
        left=None if left is None or not isfinite(left) else float(left),
        best=str(told["best"]),
    )


def _curve(told: Mapping[str, Any]) -> SoFar:
    x, y = (np.asarray(told[key], dtype=float) for key in ("x", "y"))
    if x.ndim != 1 or x.shape != y.shape:
        raise ValueError("x and y of equal length")
    words = {key: str(told[key]) for key in ("title", "x_label", "name")}
    return SoFar(x=x, y=y, dots=bool(told["dots"]), **words)


def _require_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise _refused(f"run {name[:80]!r}", "one of the list")
    return name


def _refused(got: str, expected: str) -> InputError:
    return InputError("run", got=got, expected=expected, hint="wait for a run, or cancel it.")


def _write(held: HeldFolder, name: str, values: dict[str, Any]) -> None:
    replace_file(held, name, json.dumps(values).encode())
