"""Points of a study in processes: orders and answers."""

import os
import pickle
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from threading import Lock
from time import perf_counter
from typing import Self

import klack
from klack.analyses.study.asked_points import AskedPoints, PointRow, groups_of
from klack.analyses.study.computing import (
    Agenda,
    Builds,
    PointWorkers,
    Tally,
    compute_alone,
)
from klack.analyses.study.evaluation import point_log_form
from klack.analyses.study.kinds import kind_of
from klack.analyses.unfinished import code_of_klack
from klack.analyses.workers import Failure, WorkerDied, WorkerPool, answer, shared, unwrapped
from klack.bodies.elasticity.factorization import chosen_backend
from klack.case.any_case import AnyCase, CaseTree
from klack.case.points import PointKey, Points, PointValue
from klack.errors import ConvergenceError, InputError, refuse_if
from klack.machine.memory import require_memory
from klack.machine.progress import Progress

__all__ = [
    "Answer",
    "PointOrder",
    "ProcessWorkers",
    "SentCase",
    "answered",
    "died_row",
    "versions_here",
]


_DECIDING = ("numpy", "scipy", "numba", "netgen-mesher", "mosqito")
"""Packages that decide the bits of a point."""


@dataclass(frozen=True, slots=True, eq=False)
class SentCase:
    """A case as it was written, for a process that may run on another machine.

    Parameters
    ----------
    content
        Tree of the case: plain data, and own components by module and name.
    folder
        Of the sender: paths are relative to it.
    mark
        Of case, files, components and klack, for the log of points.
    """

    content: bytes
    folder: str
    mark: str
    versions: Mapping[str, str]

    @classmethod
    def of(cls, case: AnyCase, tree: CaseTree) -> Self:
        """Case ready to be sent.

        InputError for a component whose class other processes cannot import.
        """
        try:
            content = pickle.dumps(tree)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise InputError(
                "workers",
                got=f"a case that cannot be sent to another process ({error})",
                expected="components whose class is defined at the top level of a module",
                hint="put the class into a separate module, or compute on threads.",
            ) from None
        return cls(content, str(Path.cwd()), point_log_form(case, tree)[1], versions_here())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SentCase) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[object, ...]:
        return self.content, self.folder, self.mark, *sorted(self.versions.items())

    def read(self) -> tuple[AnyCase, CaseTree]:
        """Check the case where it has arrived.

        InputError where a package that decides the bits of a point has another version, or a file
        or a class of the case is missing or has another content.
        """
        self._require_versions()
        try:
            tree: CaseTree = pickle.loads(self.content)
        except (ImportError, AttributeError) as error:
            raise InputError(
                "components",
                got=f"a class that cannot be imported there ({error})",
                expected="the modules of your components in a folder of PYTHONPATH there",
                hint="install them there; a class in a script or notebook cannot be found.",
            ) from None
        if not tree.path.is_absolute() and Path.cwd() != Path(self.folder):
            tree = replace(tree, path=Path(self.folder) / tree.path)
        try:
            case = tree.any_case()
        except InputError as error:
            raise InputError(
                error.where,
                got=error.got,
                expected=f"{error.expected}, as where the study was started",
                hint="files that the case names must have the same path on every machine: use a "
                "shared folder.",
            ) from None
        refuse_if(
            point_log_form(case, tree)[1] != self.mark,
            str(tree.path),
            got="files or components of the case with different contents",
            expected="the same bytes as where the study was started",
            hint="share the folder of the case, or copy it to every machine again.",
        )
        return case, tree

    def _require_versions(self) -> None:
        here = versions_here()
        for name, wanted in self.versions.items():
            refuse_if(
                here.get(name) != wanted,
                "version",
                got=f"{name} {here.get(name, 'not installed')}",
                expected=f"{name} {wanted}, as where the study was started: points are kept "
                "by their version",
                hint="install the same versions on every machine, and restart its workers.",
            )


@cache  # of the code that runs, which may not be what stands on the disk later
def versions_here() -> Mapping[str, str]:
    """Versions that decide the bits of a point: klack, its code, packages, the solver."""
    code = sha256()
    for part in code_of_klack():
        code.update(part)
    found = {"klack": klack.__version__, "the code of klack": code.hexdigest()[:12]}
    for name in _DECIDING:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found | {"the solver": chosen_backend("auto")}


_CASES = 4


@dataclass(frozen=True, slots=True)
class PointOrder:
    """Points that a worker shall compute: plain data.

    ``keys`` are all that the points of the study exchange, ``written`` is what each point
    exchanges.
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
    """Rows of an order, and the worker's time [s]."""

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
        """The same in the sender's words, with warnings that every process can read."""
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


PROCESS_SIZE = 0.5e9
"""Memory [byte] of a process with klack, small bodies, and a stroke."""
_ATTEMPTS = 3

_Asked = tuple[tuple[int, ...], PointOrder]


class ProcessWorkers(PointWorkers):
    """Processes of this machine, of one thread each.

    They start with the first points, end with this one, however it ends, and do not hear Ctrl-C.
    One that dies is replaced; its point is computed again.  InputError if so many do not fit into
    the memory, or if the case cannot be sent.
    """

    words = "processes"

    def __init__(self, case: AnyCase, tree: CaseTree, processes: int) -> None:
        require_memory(
            "workers",
            processes * PROCESS_SIZE,
            what=f"{processes} processes",
            hint="use fewer workers, or threads, which share their data.",
        )
        self.count = processes
        self._pool = WorkerPool(processes, SentCase.of(case, tree))

    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        """Compute some of the points, as :class:`PointWorkers` says.

        ConvergenceError if no process can begin.
        """
        agenda = Agenda([group.places for group in groups_of(asked, places)])

        def take(worker: object) -> _Asked | None:
            taken = agenda.take(worker)
            return (taken, PointOrder.of(asked, taken)) if taken else None

        with Tally(len(asked.points), len(places), keep, progress) as tally:
            tally.tell()
            try:
                for item, found in self._pool.answers(_in_a_worker, take, _ATTEMPTS):
                    _keep(asked, item, found, tally)
                    tally.tell()
            except KeyboardInterrupt:
                for item, found in self._pool.finished():
                    _keep(asked, item, found, tally)
                raise
            except WorkerDied as died:
                raise ConvergenceError(
                    f"{died}, repeatedly before it could begin.\n"
                    "Try: fewer workers if the memory is full; in a script, the call under if "
                    "__name__ == '__main__'."
                ) from None

    def close(self) -> None:
        """End the processes; work in progress is lost."""
        self._pool.close()


def died_row(asked: AskedPoints, how: str) -> PointRow:
    """Row of a point over which workers died; another run tries it again."""
    return replace(asked.failed(RuntimeError()), failure=f"worker died: {how}")


def _in_a_worker(item: _Asked) -> Answer | Failure:
    return answered(shared(), item[1])


def _keep(
    asked: AskedPoints, item: _Asked, found: Answer | Failure | WorkerDied, tally: Tally
) -> None:
    places, _ = item
    if isinstance(found, WorkerDied):
        rows: tuple[PointRow, ...] = (died_row(asked, f"{found}, {_ATTEMPTS} times"),) * len(places)
    else:
        rows = unwrapped("a worker process", found).rows
    for place, row in zip(places, rows, strict=True):
        tally(place, row)
