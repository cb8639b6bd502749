"""Rows of points: those that are known, and the others computed and kept.

They are kept for the same case, whatever the studies of it: a file in the folder of the results for
each case and version of klack; a point is known by what the case has there and by its variant.  A
later study of the same case finds the points that both have.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any, TypedDict

from klack.analyses.study.asked_points import AskedPoints, PointRow, PointSteps
from klack.analyses.study.computing import PointWorkers
from klack.analyses.study.kinds import ask, kind_of
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.any_case import AnyCase
from klack.case.bodies import CaseBody
from klack.case.case_tree import CaseTree
from klack.case.points import GivenPoints, PointValue
from klack.case.study_source import StudySource
from klack.errors import InputError
from klack.progress import Progress

__all__ = ["EffortFields", "Evaluation", "KeptPoint", "asked_of", "point_key", "point_log_form"]


_ASIDE = ("study", "calibration", "measurement", "title", "description")
"""Sections of a case that no point depends on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptPoint:
    """Measures of one point by their names, or why it has none.

    Parameters
    ----------
    values : mapping of str to float or None
    failure : str
    notes : tuple of str
    model : str
    steps : PointSteps or None
        See :class:`~klack.analyses.study.asked_points.PointRow`.
    """

    values: Mapping[str, float | None]
    failure: str
    notes: tuple[str, ...]
    model: str = ""
    steps: PointSteps | None = None

    def row(self, measures: tuple[str, ...]) -> PointRow | None:
        """Row of a table of these measures; None if one of them is not known."""
        if self.failure:
            return PointRow((None,) * len(measures), self.failure, self.notes, steps=self.steps)
        if not all(name in self.values for name in measures):
            return None
        values = tuple(self.values[name] for name in measures)
        return PointRow(values, "", self.notes, model=self.model, steps=self.steps)

    def with_row(self, measures: tuple[str, ...], row: PointRow) -> "KeptPoint":
        """The same with what was computed now; doubts of what was there before stay."""
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
    """How the points of a case are kept, and the mark of the case."""
    mark = fingerprint(_Deciding.of(case, tree), _own_code(case))
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
    way = variant if checks else f"{variant}, steps as they are"
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Deciding:
    """What of a case decides a point, as :func:`fingerprint` wants it."""

    source: str
    bodies: Mapping[str, CaseBody]

    @classmethod
    def of(cls, case: AnyCase, tree: CaseTree) -> "_Deciding":
        data = {name: value for name, value in tree.data.items() if name not in _ASIDE}
        return cls(source=json.dumps(data, sort_keys=True, default=str), bodies=case.bodies)


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


class EffortFields(TypedDict):
    """Fields of a record that tell who computed its points, and how many were known."""

    threads: int
    workers: str
    computed: int
    kept: int
    point_time: float


def asked_of(
    case: AnyCase,
    tree: CaseTree,
    source: StudySource,
    written: GivenPoints,
    names: Iterable[str],
) -> AskedPoints:
    """Points of a study, with the measures of these names.

    Raises
    ------
    InputError
        With file, line and key: for a measure, a variant or a level that does not exist; and
        those of :func:`~klack.analyses.study.kinds.ask`.
    """
    try:
        variant = kind_of(case).asked_variant(source.study)
        return ask(case, tree, written, names, variant)
    except InputError as error:
        if error.where in _KEYS:
            raise source.refuse((error.where,), error) from None
        raise


class Evaluation:
    """Computes what the log does not hold; counts points and seconds.

    Parameters
    ----------
    log : PointLog
    workers : PointWorkers
    """

    def __init__(self, log: PointLog, workers: PointWorkers) -> None:
        self._log, self._workers = log, workers
        self.computed, self.seconds = 0, 0.0
        self.so_far: list[PointRow | None] = []
        """Rows of the points that are being computed, as far as they are there."""

    @property
    def done(self) -> int:
        """Number of rows in :attr:`so_far`."""
        return sum(row is not None for row in self.so_far)

    def rows(self, asked: AskedPoints, progress: Progress) -> list[PointRow]:
        """Rows of all points that are asked for, equal ones computed once."""
        begin = perf_counter()
        measures = tuple(item.name for item in asked.chosen)
        keys = [
            point_key(asked.tree, asked.variant, row, checks=asked.checks)
            for row in asked.points.written
        ]
        self.so_far = rows = [self._known(key, measures) for key in keys]
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
        return [
            row or self._as(rows, first, key, measures) for key, row in zip(keys, rows, strict=True)
        ]

    def effort(self, points: int) -> EffortFields:
        """What a record of so many points tells."""
        return EffortFields(
            threads=self._workers.count,
            workers=self._workers.words,
            computed=self.computed,
            kept=points - self.computed,
            point_time=self.seconds,
        )

    def _known(self, key: str, measures: tuple[str, ...]) -> PointRow | None:
        kept = self._log.done.get(key)
        return None if kept is None else kept.row(measures)

    def _as(
        self,
        rows: Sequence[PointRow | None],
        first: dict[str, int],
        key: str,
        measures: tuple[str, ...],
    ) -> PointRow:
        """Row of a point that equals an earlier one."""
        none = PointRow((None,) * len(measures), "not computed", by_chance=True)
        return rows[first[key]] or none
