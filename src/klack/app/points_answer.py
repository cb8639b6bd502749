"""What a page of points asks for again and again: how the study gets on, and its points if new."""

import asyncio
import json
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from klack.app.folder import RESULT_NAME
from klack.app.jobs import Job
from klack.app.state import State
from klack.errors import InputError, KlackError

__all__ = ["PointsSource", "points_answer", "points_source"]

_KEPT = 4  # studies whose text is kept


@dataclass(frozen=True, kw_only=True)
class PointsSource:
    """Where the points of a result are.

    Parameters
    ----------
    folder : Path or None
        With a record of a study; None before there is one.
    job : Job or None
        The latest one that writes, or wrote, the result.
    is_live : bool
        Whether the record is that of a study that runs or was stopped.
    mark : str
        Changes with the record.
    """

    folder: Path | None
    job: Job | None
    is_live: bool
    mark: str


def points_source(state: State, out: str) -> PointsSource:
    """Record of a study that runs, of its result, or of one that was stopped.

    Raises
    ------
    InputError
        For a path that leads out of the folder, one without a result, and a result that is gone.
    """
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
            expected="the folder of a study below that of the application",
            hint="choose a study in the list of results.",
        )
    if job.state == "done":
        raise InputError(
            f"result {out[:200]!r}",
            got="nothing there any more",
            expected="the result of a study that has ended",
            hint="start the study again; the list of cases has it.",
        )
    return PointsSource(folder=None, job=job, is_live=True, mark="")


def _mark(state: State, place: str) -> str:
    """What tells this very record from later ones; empty without one."""
    try:
        found = (state.folder.absolute(f"{place}/{RESULT_NAME}") / "zarr.json").stat()
    except (OSError, KlackError):
        return ""
    return f"{place} {found.st_ino} {found.st_mtime_ns}"


async def points_answer(state: State, out: str, known: str) -> bytes:
    """JSON: ``job``, ``mark`` and, unless its mark is known already, ``study``."""
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
