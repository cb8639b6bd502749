"""What a worker is asked, what it answers, and how it comes to its answer."""

import os
import pickle
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock
from time import perf_counter
from typing import Self

from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.computing import Builds, compute_alone
from klack.analyses.study.kinds import kind_of
from klack.analyses.study.point_row import PointRow
from klack.analyses.study.sent_case import SentCase
from klack.analyses.workers import Failure, answer
from klack.case.points import PointKey, Points, PointValue

__all__ = ["Answer", "PointOrder", "answered"]

_CASES = 4
"""Cases that a worker keeps at hand, with their bodies."""


@dataclass(frozen=True, slots=True)
class PointOrder:
    """Points that a worker shall compute: plain data.

    Parameters
    ----------
    keys : tuple of PointKey
        All that the points of the study exchange.
    measures : tuple of str
    variant : str
    checks : bool
    written : tuple of mapping of str to value
        What each point exchanges.
    """

    keys: tuple[PointKey, ...]
    measures: tuple[str, ...]
    variant: str
    checks: bool
    written: tuple[Mapping[str, PointValue], ...]

    @classmethod
    def of(cls, asked: AskedPoints, places: tuple[int, ...]) -> Self:
        """Order for some of the points."""
        return cls(
            asked.points.keys,
            tuple(item.name for item in asked.chosen),
            asked.variant,
            asked.checks,
            tuple(asked.points.written[i] for i in places),
        )


@dataclass(frozen=True, slots=True)
class Answer:
    """Rows of an order.

    Parameters
    ----------
    rows : tuple of PointRow
    seconds : float [s]
        That the worker took.
    """

    rows: tuple[PointRow, ...]
    seconds: float


def answered(sent: SentCase, order: PointOrder) -> Answer | Failure:
    """Compute the points of an order, in whichever process; a failure is one of the whole study.

    One call at a time in each process: warnings are collected for all of its threads.
    """
    with _TURN:
        begin = perf_counter()
        work = answer(lambda: _at_work(sent))
        if isinstance(work, Failure):
            return work
        rows = work.rows(order)
        return Answer(rows, perf_counter() - begin)


_TURN = Lock()


class _CaseAtWork:
    """A case that was checked once, with the bodies of its latest points."""

    def __init__(self, sent: SentCase) -> None:
        self._case, self._tree = sent.read()
        self._builds = Builds()
        self._folder = "" if Path.cwd() == Path(sent.folder) else f"{sent.folder}{os.sep}"

    def rows(self, order: PointOrder) -> tuple[PointRow, ...]:
        kind = kind_of(self._case)
        asked = AskedPoints(
            kind=kind,
            case=self._case,
            tree=self._tree,
            points=Points(order.keys, order.written),
            chosen=kind.measures(self._case, order.measures),
            variant=order.variant,
            checks=order.checks,
        )
        return tuple(self._sent(row) for row in compute_alone(asked, self._builds))

    def _sent(self, row: PointRow) -> PointRow:
        """The same in the words of the sender, and with warnings that every process can read."""
        return replace(
            row,
            failure=row.failure.replace(self._folder, "") if self._folder else row.failure,
            notes=tuple(note.replace(self._folder, "") for note in row.notes)
            if self._folder
            else row.notes,
            others=tuple(map(_plain, row.others)),
        )


@lru_cache(maxsize=_CASES)
def _at_work(sent: SentCase) -> _CaseAtWork:
    return _CaseAtWork(sent)


def _plain(item: warnings.WarningMessage) -> warnings.WarningMessage:
    try:
        pickle.loads(pickle.dumps(item))
    except Exception:  # a class of the user's own may refuse in any way
        return warnings.WarningMessage(
            UserWarning(str(item.message)), UserWarning, item.filename, item.lineno
        )
    return item
