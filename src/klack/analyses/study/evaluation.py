"""Rows of points: those that are known, and the others computed and kept."""

from collections.abc import Iterable, Sequence
from time import perf_counter
from typing import TypedDict

from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.kinds import ask, kind_of
from klack.analyses.study.log import KeptPoint, PointLog, point_key
from klack.analyses.study.point_row import PointRow
from klack.analyses.study.point_workers import PointWorkers
from klack.case.any_case import AnyCase
from klack.case.case_tree import CaseTree
from klack.case.points import GivenPoints
from klack.case.study_source import StudySource
from klack.errors import InputError
from klack.progress import Progress

__all__ = ["EffortFields", "Evaluation", "asked_of"]


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
