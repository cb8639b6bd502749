"""Case and result folder of a study; paths from the opened folder."""

import asyncio
import json
import re
from dataclasses import dataclass
from hashlib import sha256
from math import isfinite
from pathlib import Path, PurePosixPath
from typing import Any

from klack.app.folder import RESULT_NAME, OpenFolder
from klack.app.jobs import Job
from klack.app.state import State
from klack.errors import InputError, KlackError

__all__ = [
    "PointsSource",
    "beside_case",
    "case_of_study",
    "free_name",
    "points_answer",
    "points_source",
    "result_of_study",
]


_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}")
_UNMISTAKABLE = re.compile(r"[^.+]+\.yaml")  # path without a separator of the name of its result
_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.+-]")
_LONGEST_NAME = 100  # bytes


def case_of_study(folder: OpenFolder, study: str, named: str) -> str:
    """Path of a study's case, relative to its file."""
    parts: list[str] = list(PurePosixPath(study).parent.parts)
    asked = PurePosixPath(named)
    for part in asked.parts:
        if part == ".." and parts:
            parts.pop()
        elif part == ".." or part.startswith("/") or "\\" in part:
            raise _outside(named)
        elif part != ".":
            parts.append(part)
    path = "/".join(parts)
    try:
        folder.case_text(path)
    except KlackError:
        raise _outside(named) from None
    return path


def _outside(named: str) -> InputError:
    return InputError(
        "study: case",
        got=f"{named[:200]!r}",
        expected="a case file below the folder of the application that is not a link",
        hint="name one relative to the file of the study, or choose one here.",
    )


def result_of_study(command: str, study: str, case: str = "") -> str:
    """Result folder of a study, unique for its files.

    Dots join the parts of the path. A path with dots, with another ending, or a long one gets a
    hash after two dots, which no plain name has.

    Parameters
    ----------
    command
        ``"study"`` or ``"optimise"``.
    study
        File of the study, or case with a study in it.
    case
        Chosen for a study that names none.

    Examples
    --------
    >>> result_of_study("study", "valve/study.yaml")
    'klack-results/study/valve.study'
    >>> result_of_study("optimise", "softer.yaml", "valve/case.yaml")
    'klack-results/optimum/softer+valve.case'
    """
    files = [file for file in (study, case) if file]
    name = "+".join(file.removesuffix(".yaml").replace("/", ".") for file in files)
    is_plain = all(_UNMISTAKABLE.fullmatch(file) for file in files)
    if not is_plain or len(name.encode()) > _LONGEST_NAME:
        start = _NOT_PLAIN.sub("_", name)[:_LONGEST_NAME].strip(".")
        name = f"{start}..{sha256('+'.join(map(repr, files)).encode()).hexdigest()[:12]}"
    return f"klack-results/{'optimum' if command == 'optimise' else 'study'}/{name}"


def beside_case(folder: OpenFolder, job: Job | None, name: str, text: str) -> str:
    """Folder of the case of a study, for the files that it names: empty for the opened one.

    ``job`` made the study; ``name`` and ``text`` are those of the case, as the study has it.
    """
    if job is not None:
        return _parent(job.case)
    alike = []
    for case in folder.look().cases:
        path = PurePosixPath(case)
        if name in (path.stem, path.parent.name):
            try:
                same = folder.case_text(case) == text
            except KlackError:
                continue
            if same:
                return _parent(case)
            alike.append(case)
    return _parent(alike[0]) if len(alike) == 1 else ""


def _parent(path: str) -> str:
    parent = PurePosixPath(path).parent.as_posix()
    return "" if parent == "." else parent


def free_name(folder: OpenFolder, parent: str, name: str, otherwise: str) -> str:
    """Plain, unused path for a new file."""
    stem, _, ending = (name if _PLAIN.fullmatch(name) else otherwise).rpartition(".")
    head = f"{parent}/" if parent else ""
    found = f"{head}{stem}.{ending}"
    count = 2
    while folder.exists(found):
        found = f"{head}{stem}_{count}.{ending}"
        count += 1
    return found


_KEPT = 4  # studies whose text is kept


@dataclass(frozen=True, kw_only=True)
class PointsSource:
    """Where the points of a result are.

    Parameters
    ----------
    folder
        With a record, if there is one.
    job
        The latest one for the result.
    is_live
        Whether the study runs or was stopped.
    mark
        Changes with the record.
    """

    folder: Path | None
    job: Job | None
    is_live: bool
    mark: str


def points_source(state: State, out: str) -> PointsSource:
    """Record of a running or stopped study, or of a result."""
    job = state.jobs.of_result(out)
    places = [out]
    if job is not None:
        live = state.jobs.live(job.name).relative_to(state.folder.path).as_posix()
        places = [out, live] if job.state == "done" else [live, out]
        if job.state == "running":
            places = [live]
    for place in places:
        mark = _mark(state, place)
        if mark:
            return PointsSource(
                folder=state.folder.path / place, job=job, is_live=place != out, mark=mark
            )
    if job is None:
        raise InputError(
            f"result {out[:200]!r}",
            got="no study",
            expected="the folder of a study below the folder of the application",
            hint="choose a study in the list of results.",
        )
    if job.state == "done":
        raise InputError(
            f"result {out[:200]!r}",
            got="a result that no longer exists",
            expected="the result of a study that has ended",
            hint="start the study again from the list of cases.",
        )
    return PointsSource(folder=None, job=job, is_live=True, mark="")


def _mark(state: State, place: str) -> str:
    """Identity of a record; empty without one."""
    try:
        found = (state.folder.absolute(f"{place}/{RESULT_NAME}") / "zarr.json").stat()
    except (OSError, KlackError):
        return ""
    return f"{place} {found.st_ino} {found.st_mtime_ns}"


async def points_answer(state: State, out: str, known: str) -> bytes:
    """JSON: ``job``, ``mark`` and, for another mark, ``study``."""
    try:
        source = await asyncio.to_thread(points_source, state, out)
        told: dict[str, Any] = {
            "job": None if source.job is None else _told(source.job),
            "live": source.is_live,
            "mark": source.mark,
        }
        if source.folder is None or source.mark == known:
            return json.dumps(told).encode()
        study = await _study(state, source)
        return b'%s,"study":%s}' % (json.dumps(told).encode()[:-1], study)
    except KlackError as error:
        return json.dumps({"error": str(error)}).encode()


async def _study(state: State, source: PointsSource) -> bytes:
    place = str(source.folder)
    kept = state.points.get(place)
    if kept is not None and kept[0] == source.mark:
        return kept[1]
    study: bytes = await state.reader.call("points", place)
    state.points.pop(place, None)
    state.points[place] = source.mark, study
    while len(state.points) > _KEPT:
        state.points.pop(next(iter(state.points)))
    return study


def _told(job: Job) -> dict[str, Any]:
    count = job.points
    return {
        "name": job.name,
        "command": job.command,
        "state": job.state,
        "stage": job.stage,
        "fraction": min(max(job.fraction, 0.0), 1.0) if isfinite(job.fraction) else 0.0,
        "done": None if count is None else count.done,
        "most": None if count is None else count.most,
        "left": None if count is None else count.left,
        "best": "" if count is None else count.best,
        "told": job.told,
    }
