"""Points of a study as bounded JSON for a page, and their clicks."""

import json
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.signal_statistics import sound_statistics
from klack.acoustics.wav import level_statement, wav_bytes
from klack.analyses.store import load_record
from klack.analyses.study.analysis import STUDY
from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.computing import Builds, compute_alone, sounds_of
from klack.analyses.study.goals import Goals, goals_of
from klack.analyses.study.kinds import ask
from klack.analyses.study.point_case import written_of_point
from klack.analyses.study.record import NOT_YET, StudyColumn, StudyRecord
from klack.analyses.study.wording import short_labels, shown_unit
from klack.app.answers import Heard, typed
from klack.app.explorer import common_scale
from klack.case.any_case import tree_of
from klack.case.reader import parse, validated
from klack.case.study import StudyFile
from klack.case.study_source import StudySource
from klack.errors import InputError, KlackError
from klack.machine.progress import silent
from klack.report.wording import printed_unit
from klack.signals.sampled import TimeSeries
from klack.studies.fronts import compromise, find_front
from klack.units import is_level

__all__ = ["MOST_DRAWN", "Front", "Listener", "StudyPoints", "front_of", "points_json"]


MOST_DRAWN = 10_000
"""Points on a page; of more, the front and an even choice."""
LARGEST_STORE = 400_000_000
"""Bytes of arrays, and of files, of a study on a page."""
_MOST_NUMBERS = 1_000_000
"""Of all columns together."""
_LISTED, _LONGEST = 300, 1500  # failed points and kinds of doubts; characters of one


@dataclass(frozen=True, kw_only=True, eq=False)
class Front:
    """What no other point beats.

    Parameters
    ----------
    ways
        ``"minimise"`` or ``"maximise"``, by the objective.
    points
        By the first objective.
    best
        -1 without a front.
    kept
        Points that keep all bounds, if there are bounds.
    """

    ways: dict[str, str]
    bounds: tuple[str, ...]
    points: tuple[int, ...]
    best: int
    kept: NDArray[np.bool_] | None
    feasible: bool


class StudyPoints:
    """The latest record, read again when replaced."""

    def __init__(self) -> None:
        self._known: tuple[object, StudyRecord] | None = None

    def record(self, folder: str) -> StudyRecord:
        """Record of a folder, if it is a good study and not too large."""
        place = Path(folder)
        mark = (folder, _mark(place))
        if self._known is None or self._known[0] != mark or mark[1] is None:
            _require_small(place)
            found = load_record(place, STUDY.form, largest=LARGEST_STORE)
            _require_even(found, place)
            self._known = mark, found
        return self._known[1]


def _mark(place: Path) -> object:
    try:
        state = (place / "result.zarr" / "zarr.json").stat()
    except OSError:
        return None
    return state.st_ino, state.st_mtime_ns, state.st_size


def _require_small(place: Path) -> None:
    total = 0
    for folder, _, names in os.walk(place / "result.zarr"):
        for name in names:
            try:
                total += os.lstat(Path(folder, name)).st_size
            except OSError:  # replaced at this moment
                continue
        if total > LARGEST_STORE:
            raise InputError(
                f"result {place.name}",
                got=f"files of more than {LARGEST_STORE / 1e6:.0f} MB",
                expected="a study of up to some hundred thousand points",
                hint="klack export --to csv writes all points, for other programs.",
            )


def _require_even(record: StudyRecord, place: Path) -> None:
    """Require a value per point in every column: a store may be foreign."""
    lengths = {item.values.shape for item in record.columns} | {(len(record.notes),)}
    found = record.optimum
    inside = found is None or (
        found.kept.shape == (record.count,)
        and bool(np.all((found.front >= 0) & (found.front < record.count)))
        and -1 <= found.best < record.count
    )
    if lengths != {(record.count,)} or not inside:
        raise InputError(
            f"result {place.name}",
            got="columns of different lengths",
            expected="a value of every column for every point",
            hint="run the study again.",
        )


def front_of(record: StudyRecord) -> Front:
    """Front of a search, or of a study with objectives."""
    found = record.optimum
    if found is not None:
        return Front(
            ways=dict(zip(found.objectives, found.ways, strict=False)),
            bounds=found.bounds,
            points=tuple(map(int, found.front)),
            best=int(found.best),
            kept=np.asarray(found.kept, dtype=bool) if found.bounds else None,
            feasible=bool(found.feasible),
        )
    try:
        goals = _goals(record)
    except KlackError:  # a bound by today, while today is not computed yet
        goals = None
    if goals is None:
        return Front(ways={}, bounds=(), points=(), best=-1, kept=None, feasible=True)
    columns = {item.name: item for item in record.measures}
    of = {side: columns[side[0]].values for side in goals.sides}
    objectives, violations = goals.objective_values(of), goals.violations(of)
    front = find_front(objectives, violations)
    points = front.points[np.argsort(objectives[front.points, 0], kind="stable")]
    return Front(
        ways=dict(zip(goals.objectives, goals.ways, strict=True)),
        bounds=goals.bound_texts(
            {name: item.unit for name, item in columns.items()}, lambda measure, _: measure
        ),
        points=tuple(map(int, points)),
        best=int(points[compromise(objectives[points])]) if points.size else -1,
        kept=np.all(violations <= 0.0, axis=1) if goals.bounds else None,
        feasible=front.feasible,
    )


def _goals(record: StudyRecord) -> Goals | None:
    path = Path("study.yaml")
    text = record.study_text or record.case_text
    data, lines = parse(text, path)
    given = data.get("study")
    if not isinstance(given, dict):
        return None
    # a design may name a file that lies beside the study
    plain = {name: value for name, value in given.items() if name != "design"}
    study = validated(StudyFile, text, path, {"klack": 1, "study": plain}, lines).study
    columns: dict[str, Any] = {item.name: item for item in record.measures}
    if not study.objectives or not {*study.objectives, *study.constraints} <= columns.keys():
        return None
    source = StudySource(study=study, path=path, lines=lines)
    return goals_of(source, columns, {name: item.today for name, item in columns.items()})


def points_json(record: StudyRecord) -> bytes:
    """Columns, front, doubts and failures of a study."""
    front, labels = front_of(record), short_labels(record)
    most = max(min(MOST_DRAWN, _MOST_NUMBERS // max(len(record.columns), 1)), 1)
    drawn = _drawn(record.count, front, most)
    waiting = np.array([text == NOT_YET for text in record.failures], dtype=bool)
    failed = record.failed & ~waiting
    roles = (
        *((item, "parameter") for item in record.parameters),
        *((item, "linked") for item in record.linked),
        *((item, "measure") for item in record.measures),
    )
    kinds, doubt = _doubts(record.notes, drawn)
    data = {
        "title": record.title or record.case,
        "case": record.case,
        "version": record.version,
        "created": record.created,
        "design": record.design,
        "count": record.count,
        "failed": int(failed.sum()),
        "waiting": int(waiting.sum()),
        "doubtful": sum(1 for note in record.notes if note),
        "points": drawn.tolist(),
        "columns": [
            _column(item, role, labels.get(item.name, item.name), front, drawn)
            for item, role in roles
        ],
        "front": list(front.points)[:MOST_DRAWN],
        "best": front.best,
        "feasible": front.feasible,
        "bounds": list(front.bounds),
        "missed": [] if front.kept is None else _places((~front.kept & ~record.failed)[drawn]),
        "lost": _places(failed[drawn]),
        "doubts": kinds,
        "doubt": doubt,
        "failures": _failures(record.failures, failed),
        "warnings": [text[:_LONGEST] for text in record.warnings[:50]],
    }
    return json.dumps(data, allow_nan=False, separators=(",", ":")).encode()


def _drawn(count: int, front: Front, most: int) -> NDArray[np.int64]:
    if count <= most:
        return np.arange(count)
    first = np.array(front.points[:most], dtype=np.int64)
    others = np.setdiff1d(np.arange(count), first)
    room = most - first.size
    even = others[np.linspace(0, others.size - 1, room).astype(np.int64)] if room else others[:0]
    return np.unique(np.concatenate([first, even]))


def _column(
    item: StudyColumn, role: str, label: str, front: Front, drawn: NDArray[np.int64]
) -> dict[str, Any]:
    unit, factor = shown_unit(item.unit)
    known = item.values[np.isfinite(item.values)]
    if item.words or is_level(item.unit):
        scale = 1.0
    else:
        unit, scale = printed_unit(factor * known, unit)
    values = factor * scale * item.values[drawn]
    return {
        "name": item.name,
        "label": label,
        "role": role,
        "unit": typed(unit),
        "words": list(item.words),
        "varies": item.varies,
        "level": is_level(item.unit),
        "time": item.unit == "s",
        "way": front.ways.get(item.name, ""),
        "spread": item.spread,
        "today": _number(factor * scale * item.today),
        "values": [_number(value) for value in values],
    }


def _places(which: NDArray[np.bool_]) -> list[int]:
    return [int(place) for place in np.flatnonzero(which)]


def _number(value: float) -> float | None:
    return float(f"{value:.7g}") if isfinite(value) else None


def _doubts(
    notes: Sequence[str], drawn: NDArray[np.int64]
) -> tuple[list[str], list[tuple[int, int]]]:
    """Different texts, and pairs: place of a drawn point, its text."""
    kinds: dict[str, int] = {}
    found = []
    for place, point in enumerate(drawn.tolist()):
        text = notes[point][:_LONGEST]
        if text:
            kind = kinds.setdefault(text, min(len(kinds), _LISTED))
            found.append((place, kind))
    texts = list(kinds)[:_LISTED]
    return [*texts, "A doubt; klack export --to csv writes its text."], found


def _failures(failures: Sequence[str], failed: NDArray[np.bool_]) -> dict[str, Any]:
    """Counts of reasons, and reasons of the first points."""
    places = np.flatnonzero(failed)
    reasons = Counter(failures[place].partition("\n")[0][:_LONGEST] for place in places.tolist())
    return {
        "reasons": reasons.most_common(20),
        "points": [[place, failures[place][:_LONGEST]] for place in places[:_LISTED].tolist()],
    }


_LEVEL = "noise.sound_exposure_level_weighted"
_CASE = -1  # the case as it is, among the points
_MOST = 64  # clicks that are kept


class Listener:
    """The object behind the players of a study."""

    def __init__(self) -> None:
        self._points = StudyPoints()
        self._record: StudyRecord | None = None
        self._sounds: dict[int, TimeSeries] = {}

    def listen(self, folder: str, near: str, point: int) -> Heard:
        """Click of a point and of the case as it is, to one full scale.

        ``folder`` is that of the result, ``near`` that of the case, for the files that it names.
        InputError where nothing radiates, with the reason.
        """
        record = self._points.record(folder)
        if not 0 <= point < record.count:
            raise InputError(
                "point",
                got=str(point),
                expected=f"0 to {record.count - 1}",
                hint="choose a point of the chart or of the table.",
            )
        if self._record is not record:
            if self._record is None or not _same_points(self._record, record):
                self._sounds = {}
            self._sounds |= {item.point: item.pressure for item in record.sounds}
            self._record = record
        base = self._sound(record, near, _CASE)
        own = self._sound(record, near, point)
        scale = common_scale(own, base)
        return Heard(
            point=point,
            wav=wav_bytes(own, full_scale=scale),
            base_wav=wav_bytes(base, full_scale=scale),
            scale=level_statement(scale),
            level=sound_statistics(own).exposure_level_A,
            base_level=sound_statistics(base).exposure_level_A,
        )

    def _sound(self, record: StudyRecord, near: str, point: int) -> TimeSeries:
        if point not in self._sounds:
            asked = _asked(record, near, point)
            (found,) = sounds_of(asked, silent)
            if found is None:
                raise _silent(asked, point)
            while len(self._sounds) >= _MOST:
                self._sounds.pop(next(key for key in self._sounds if key != _CASE))
            self._sounds[point] = found
        return self._sounds[point]


def _same_points(one: StudyRecord, other: StudyRecord) -> bool:
    """Whether a number means the same point in both, also in a running study."""

    def told(record: StudyRecord) -> tuple[str, ...]:
        return record.case_text, record.study_text, record.variant, record.design

    return told(one) == told(other)


def _asked(record: StudyRecord, near: str, point: int) -> AskedPoints:
    tree = tree_of(record.case_text, Path(near) / f"{record.case}.yaml")
    written: dict[str, Any] = {} if point == _CASE else written_of_point(record, point)
    return ask(tree.any_case(), tree, [written], (_LEVEL,), _variant(record))


def _variant(record: StudyRecord) -> str | None:
    """Variant, or level of an impact; shots have their own."""
    if not record.model:
        return record.variant
    level = record.variant.partition(" + ")[0]
    return None if level == "shots" else level


def _silent(asked: AskedPoints, point: int) -> InputError:
    with Builds() as builds:
        row = compute_alone(asked, builds)[0]
    words: Sequence[str] = [row.failure] if row.failure else row.notes
    which = "today's case" if point == _CASE else f"point {point}"
    reason = " ".join(words).replace("\n", " ") or "nothing that radiates"
    return InputError(
        f"click of {which}",
        got=reason.rstrip("."),
        expected="a section 'noise', and bodies with surfaces",
        hint="klack noise says what is missing.",
    )
