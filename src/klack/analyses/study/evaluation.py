"""Rows of points: those that are known, and the others computed and kept.

A file in the folder of the results holds them for each case and version of klack; a point is known
by what the case has there and by its variant.  A later study of the same case finds the points that
both have.
"""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.asked_points import AskedPoints, PointRow, PointSteps
from klack.analyses.study.computing import PointWorkers
from klack.analyses.study.kinds import ask, kind_of
from klack.analyses.study.points import Space, Values
from klack.analyses.study.record import StudyColumn
from klack.analyses.study.wording import alike
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.any_case import AnyCase, CaseTree
from klack.case.key_path import split_path
from klack.case.points import GivenPoints, PointValue
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.machine.progress import Progress

__all__ = [
    "Evaluation",
    "KeptPoint",
    "asked_of",
    "dry_warnings",
    "measure_columns",
    "point_fields",
    "point_key",
    "point_log_form",
    "require_some",
    "row_warnings",
    "step_columns",
]


_ASIDE = ("study", "calibration", "measurement", "title", "description")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptPoint:
    """Measures of one point, or why it has none."""

    values: Mapping[str, float | None]
    failure: str
    notes: tuple[str, ...]
    model: str = ""
    steps: PointSteps | None = None

    def row(self, measures: tuple[str, ...]) -> PointRow | None:
        """Row of these measures, if all are known."""
        if self.failure:
            return PointRow((None,) * len(measures), self.failure, self.notes, steps=self.steps)
        if not all(name in self.values for name in measures):
            return None
        values = tuple(self.values[name] for name in measures)
        return PointRow(values, "", self.notes, model=self.model, steps=self.steps)

    def with_row(self, measures: tuple[str, ...], row: PointRow) -> "KeptPoint":
        """The same with new values; earlier doubts stay."""
        values = dict(self.values) | dict(zip(measures, row.values, strict=True))
        notes, steps = tuple(dict.fromkeys((*self.notes, *row.notes))), row.steps
        if steps is not None and self.steps is not None:
            steps = steps.with_other(self.steps)
        return KeptPoint(
            values=values, failure=row.failure, notes=notes, model=row.model, steps=steps
        )


PointLog = UnfinishedLog[str, KeptPoint]
"""Points by :func:`point_key`."""


def point_log_form(case: AnyCase, tree: CaseTree) -> tuple[LogForm[str, KeptPoint], str]:
    """Storage of the points of a case, and its mark."""
    data = {name: value for name, value in tree.data.items() if name not in _ASIDE}
    source = json.dumps(data, sort_keys=True, default=str)
    mark = fingerprint(case, _own_code(case), source)
    return (
        LogForm(
            file=f"points-{mark[:12]}.jsonl",
            format="klack points 2",
            parts="computed points",
            data=_data,
            read=_kept,
        ),
        mark,
    )


def point_key(
    tree: CaseTree, variant: str, written: Mapping[str, PointValue], *, checks: bool = True
) -> str:
    """What tells a point of a case from all others: its values, with the content of files.

    And whether its steps were checked.
    """
    marks = {name: _with_content(tree.path.parent, value) for name, value in written.items()}
    way = variant if checks else f"{variant}, steps unchecked"
    return json.dumps([way, dict(sorted(marks.items()))], separators=(",", ":"))


def _with_content(folder: Path, value: PointValue) -> PointValue | list[str]:
    if isinstance(value, str):
        file = folder / value
        try:
            if file.is_file():
                return [value, sha256(file.read_bytes()).hexdigest()]
        except (OSError, ValueError):  # no name of a file
            return value
    return value


def _own_code(case: AnyCase) -> Iterator[bytes]:
    for name, digest in case.own_components.items():
        # a worker process knows the script that started it by another name
        yield f"{name.replace('__mp_main__:', '__main__:')} {digest}".encode()
    for name, file in case.component_files.items():
        yield f"{name} {sha256(file.read_bytes()).hexdigest()}".encode()


def _data(key: str, point: KeptPoint) -> Mapping[str, Any]:
    return {
        "point": key,
        "values": dict(point.values),
        "failure": point.failure,
        "notes": list(point.notes),
    } | (
        ({"model": point.model} if point.model else {})
        | ({"steps": list(map(str, point.steps))} if point.steps is not None else {})
    )


def _kept(data: Mapping[str, Any]) -> tuple[str, KeptPoint]:
    values = {
        str(name): None if value is None else float(value) for name, value in data["values"].items()
    }
    return str(data["point"]), KeptPoint(
        values=values,
        failure=str(data["failure"]),
        notes=tuple(map(str, data["notes"])),
        model=str(data.get("model", "")),
        steps=PointSteps(int(data["steps"][0]), float(data["steps"][1]))
        if "steps" in data
        else None,
    )


_KEYS = ("measures", "variant", "level")
"""Keys of a study that errors name without their file."""


def asked_of(
    case: AnyCase,
    tree: CaseTree,
    source: StudySource,
    written: GivenPoints,
    names: Iterable[str],
) -> AskedPoints:
    """Points of a study with these measures; errors name file, line and key."""
    try:
        variant = kind_of(case).asked_variant(source.study)
        return ask(case, tree, written, names, variant)
    except InputError as error:
        if error.where in _KEYS:
            raise source.refuse((error.where,), error) from None
        raise


class Evaluation:
    """Computes what the log lacks; counts points and seconds."""

    def __init__(self, log: PointLog, workers: PointWorkers) -> None:
        self._log, self._workers = log, workers
        self.computed, self.seconds = 0, 0.0
        self.so_far: list[PointRow | None] = []
        """Rows computed so far."""

    @property
    def done(self) -> int:
        """Number of rows in :attr:`so_far`."""
        return sum(row is not None for row in self.so_far)

    def rows(self, asked: AskedPoints, progress: Progress) -> list[PointRow]:
        """Rows of all points, equal ones computed once."""
        begin = perf_counter()
        measures = tuple(item.name for item in asked.chosen)
        keys = [
            point_key(asked.tree, asked.variant, row, checks=asked.checks)
            for row in asked.points.written
        ]
        kept = [self._log.done.get(key) for key in keys]
        self.so_far = rows = [None if point is None else point.row(measures) for point in kept]
        first: dict[str, int] = {}
        for place, (key, row) in enumerate(zip(keys, rows, strict=True)):
            if row is None:
                first.setdefault(key, place)

        def keep(place: int, row: PointRow) -> None:
            rows[place] = row
            self.computed += 1
            if not row.by_chance:
                key = keys[place]
                before = self._log.done.get(key, KeptPoint(values={}, failure="", notes=()))
                self._log.add(key, before.with_row(measures, row))

        if first:
            # the case as it is first: who watches compares every point with it
            order = sorted(first.values(), key=lambda place: bool(asked.points.written[place]))
            self._workers.compute(asked, tuple(order), keep, progress)
        self.seconds += perf_counter() - begin
        none = PointRow((None,) * len(measures), "not computed", by_chance=True)
        # the row of a point that equals an earlier one is there
        return [row or rows[first[key]] or none for key, row in zip(keys, rows, strict=True)]

    def effort(self, points: int) -> dict[str, Any]:
        """What a record of so many points tells."""
        return dict(
            threads=self._workers.count,
            workers=self._workers.words,
            computed=self.computed,
            kept=points - self.computed,
            point_time=self.seconds,
        )


_TOLD = 5
"""Kinds of notes that are told; those of a kind differ in numbers only."""


def require_some(source: StudySource, rows: Sequence[PointRow]) -> None:
    """Refuse a study without a single number."""
    reasons = Counter(row.failure.partition("\n")[0] for row in rows)
    if rows and not reasons[""]:
        reason, times = reasons.most_common(1)[0]
        raise InputError(
            source.where(("parameters",)),
            got=f"{len(rows)} points, none of which can be computed; {times} times: {reason}",
            expected="ranges in which the valve works",
            hint="narrow the ranges, or compute the case with only one of these values.",
        )


def point_fields(
    asked: AskedPoints,
    space: Space,
    values: Sequence[Values],
    rows: Sequence[PointRow],
    today: PointRow,
) -> dict[str, Any]:
    """Values of parameters and linked keys, and how each point ended."""
    known = space.known()
    steps = step_columns(rows)
    return dict(
        variant=asked.variant,
        parameters=tuple(
            _column(values, item.name, item.unit, item.text(), known.get(item.name))
            for item in space.parameters
        ),
        linked=tuple(
            _column(values, item.name, item.unit, f"= {item.expression.text}", item.today)
            for item in space.linked
        ),
        failures=tuple(row.failure for row in rows),
        notes=tuple("\n".join(row.notes) for row in rows),
        model=_model(rows, today),
        halvings=steps[0],
        step_changes=steps[1],
    )


def step_columns(rows: Sequence[PointRow]) -> NDArray[np.float64]:
    """What the check of the steps of each stroke has found, shape (2, points); (2, 0) of impacts.

    Rows: see :class:`~klack.analyses.study.asked_points.PointSteps`; nan where none was computed.
    """
    if all(row.steps is None for row in rows):
        return np.zeros((2, 0))
    return np.array([row.steps or (np.nan, np.nan) for row in rows], dtype=float).T


def _model(rows: Sequence[PointRow], today: PointRow) -> str:
    first = next((row.model for row in (today, *rows) if row.model), "")
    others = sum(1 for row in rows if row.model not in ("", first))
    points = "1 point" if others == 1 else f"{others} points"
    return f"{first}; other modes, meshes or laws at {points}" if others else first


def _column(
    points: Sequence[Values], name: str, unit: str, spread: str, today: float | str | None
) -> StudyColumn:
    values = [point[name] for point in points]
    words: tuple[str, ...] = ()
    if not unit:
        words = tuple(dict.fromkeys(str(value) for value in values))
        values = [float(words.index(str(value))) for value in values]
        today = words.index(str(today)) if str(today) in words else None
    return StudyColumn(
        name=name,
        title=name.rpartition(".")[2].replace("_", " "),
        unit=unit,
        spread=spread,
        today=float("nan") if today is None else float(today),
        values=np.array(values, dtype=float),
        words=words,
        is_whole=bool(unit) and all(isinstance(point[name], int) for point in points),
    )


def measure_columns(
    asked: AskedPoints, rows: Sequence[PointRow], today: PointRow
) -> tuple[StudyColumn, ...]:
    """Columns of the measures; ``today`` is the case as it is."""
    return tuple(
        StudyColumn(
            name=item.name,
            title=item.measure.name,
            unit=item.measure.unit,
            spread="",
            today=today.numbers[k],
            values=np.array([row.numbers[k] for row in rows], dtype=float),
        )
        for k, item in enumerate(asked.chosen)
    )


def _today_notes(today: PointRow) -> tuple[str, ...]:
    if today.failure:
        return (f"Today's case cannot be computed: {today.failure.partition(chr(10))[0]}",)
    return tuple(f"Today's case: {note}" for note in today.notes)


def _of_rows(rows: Sequence[PointRow]) -> tuple[str, ...]:
    found = []
    failures = Counter(row.failure.partition("\n")[0] for row in rows if row.failure)
    if failures:
        reason, times = failures.most_common(1)[0]
        found.append(
            f"{failures.total()} of {len(rows)} points have no measures; {times} times: {reason}"
        )
    kinds = sorted(alike(row.notes for row in rows).values(), key=lambda notes: -notes.total())
    for notes in kinds[:_TOLD]:
        note = notes.most_common(1)[0][0]
        other = ", with other numbers" if len(notes) > 1 else ""
        found.append(f"{notes.total()} of {len(rows)} points{other}: {note}")
    if len(kinds) > _TOLD:
        found.append(f"{len(kinds) - _TOLD} other notes; the table of points lists all of them.")
    return tuple(found)


def _to_have(measure: str) -> str:
    """What may give a measure a value."""
    if measure.startswith("noise."):
        return (
            "bodies with named surfaces; levels at mounts need noise.mounts as well, a sharpness a "
            "click of 0.1 sone"
        )
    return "a longer run.duration, if it occurs later"


def row_warnings(
    rows: Sequence[PointRow], today: PointRow, columns: Sequence[StudyColumn]
) -> tuple[str, ...]:
    """Numbers of failed and doubtful points, with frequent reasons."""
    missing = (
        f"'{item.name}' has no value at any point. Try: {_to_have(item.name)}."
        for item in columns
        if not np.isfinite(item.values).any()
    )
    return (*_of_rows(rows), *missing, *_today_notes(today))


def dry_warnings(asked: AskedPoints, space: Space) -> tuple[str, ...]:
    """Parameters of parts and films that a dry variant leaves out."""
    if not isinstance(asked.case, ValveCase) or not asked.variant.startswith("dry"):
        return ()
    parts = asked.case.network.components
    used = {name for item in space.linked for name in item.words.values()}
    found = []
    for name in (item.name for item in space.varied if item.is_key and item.name not in used):
        section, place, *rest = (*split_path(name), "", "")
        if section != "network" or place != "components" or rest[0] not in parts:
            continue
        if rest[1] == "film" or parts[str(rest[0])].dry() is None:
            left = f"the film of '{rest[0]}'" if rest[1] == "film" else f"'{rest[0]}'"
            found.append(
                f"'{name}' has no effect: the variant '{asked.variant}' leaves {left} out. "
                "Try: variant: wet."
            )
    return tuple(found)
