"""Where the points of a study are computed, as the user wants it: threads, processes, a cluster."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from klack.analyses.study.asked_points import AskedPoints, PointRow, groups_of
from klack.analyses.study.computing import Agenda, PointWorkers, Tally, ThreadWorkers
from klack.analyses.study.sent_points import Answer, PointOrder, SentCase, answered
from klack.analyses.workers import Failure, WorkerDied, WorkerPool, shared, unwrapped
from klack.case.any_case import AnyCase
from klack.case.case_tree import CaseTree
from klack.closing import Closing
from klack.cores import available_cores
from klack.errors import ConvergenceError, InputError, refuse_if
from klack.memory import available_memory, require_memory
from klack.progress import Progress

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["HERE", "Where", "died_row"]


PROCESS_SIZE = 0.5e9
"""Memory of a process with klack, the bodies of a small valve, and a stroke [byte]."""
_ATTEMPTS = 3

_Asked = tuple[tuple[int, ...], PointOrder]


class ProcessWorkers(Closing):
    """Processes of this machine, of one thread each.

    They start with the first points, end with this one, however it ends, and do not hear Ctrl-C.
    One that dies is replaced; its point is computed again.

    Parameters
    ----------
    case : Case or ValveCase
    tree : CaseTree
        The same as it was written.
    processes : int

    Raises
    ------
    InputError
        If so many do not fit into the memory, or if the case cannot be sent.
    """

    words = "processes"

    def __init__(self, case: AnyCase, tree: CaseTree, processes: int) -> None:
        require_memory(
            "workers",
            processes * PROCESS_SIZE,
            what=f"{processes} processes",
            hint="use fewer of them, or threads, which share what they need.",
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

        Raises
        ------
        ConvergenceError
            If no process can begin.
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
                    f"{died}, again and again before it could begin.\n"
                    "Try: fewer workers if the memory is full; in a script, the call under "
                    "if __name__ == '__main__'."
                ) from None

    def close(self) -> None:
        """End the processes; what they compute at this moment is lost."""
        self._pool.close()


def died_row(asked: AskedPoints, how: str) -> PointRow:
    """Row of a point over which its workers died; another run tries it again."""
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


_HOLDING = 64
"""Points with noise (0.15 s), or impacts, that make up for the start of processes (4 s)."""
_GEOMETRIES = 16
"""New bodies (0.7 s) that do: threads mesh one after another."""


@dataclass(frozen=True, kw_only=True)
class Where:
    """Threads of this process, processes of this machine, or a cluster.

    Parameters
    ----------
    threads : int, optional
        All cores by default.
    workers : int, optional
        Processes, in place of threads.
    dask : str, Client or Cluster of distributed, optional
        Address of a scheduler, or a file that has it.
    is_free : bool
        Whether klack may take processes in place of threads where that is faster.

    Raises
    ------
    InputError
        For numbers that cannot be, and for two places at once.
    MissingExtraError
        For a cluster without dask.distributed.
    """

    threads: int | None = None
    workers: int | None = None
    dask: "str | Client | None" = None
    is_free: bool = False

    def __post_init__(self) -> None:
        """Check what was asked for."""
        for name, value in (("threads", self.threads), ("workers", self.workers)):
            if value is not None and (isinstance(value, bool) or value < 1):
                raise InputError(
                    name, got=str(value), expected="1 or more", hint="leave it out: all cores."
                )
        given = {"threads": self.threads, "workers": self.workers, "dask": self.dask}
        names = [name for name, value in given.items() if value is not None]
        refuse_if(
            len(names) > 1,
            " and ".join(names),
            got="several places for the points",
            expected="one of: threads, workers (processes of this machine), dask (a cluster)",
            hint="leave out all but one.",
        )
        if self.dask is not None:
            from klack.analyses.study.dask_workers import require_dask

            require_dask()

    @contextmanager
    def open(self, case: AnyCase, tree: CaseTree) -> Iterator[PointWorkers]:
        """Workers for the points of a case, which end with this block.

        Raises
        ------
        InputError
            If they do not fit into the memory; if the scheduler of a cluster does not answer.
        """
        workers = self._of(case, tree)
        try:
            yield workers
        finally:
            workers.close()

    def _of(self, case: AnyCase, tree: CaseTree) -> PointWorkers:
        if self.dask is not None:
            from klack.analyses.study.dask_workers import DaskWorkers

            return DaskWorkers(case, tree, self.dask)
        if self.workers is not None:
            return ProcessWorkers(case, tree, self.workers)
        if self.is_free and self.threads is None:
            return _Fitting(case, tree)
        return ThreadWorkers(self.threads)


HERE = Where()
"""All cores of this process."""


class _Fitting(Closing):
    """Threads, until there are many points that processes compute faster."""

    def __init__(self, case: AnyCase, tree: CaseTree) -> None:
        self._case, self._tree = case, tree
        self._chosen: PointWorkers = ThreadWorkers()
        self._points = 0
        self._bodies: set[tuple[object, ...]] = set()

    @property
    def count(self) -> int:
        return self._chosen.count

    @property
    def words(self) -> str:
        return self._chosen.words

    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        if isinstance(self._chosen, ThreadWorkers) and self._pays(asked, places):
            self._chosen.close()
            self._chosen = ProcessWorkers(self._case, self._tree, self._processes())
        self._chosen.compute(asked, places, keep, progress)

    def close(self) -> None:
        self._chosen.close()

    def _pays(self, asked: AskedPoints, places: Sequence[int]) -> bool:
        """Whether these points hold the interpreter for long."""
        self._points += len(places)
        self._bodies |= {tuple(group.made.items()) for group in groups_of(asked, places)}
        if self._processes() < 2 or _has_python(self._case):
            return False
        slow = asked.kind.holds_interpreter(asked) and self._points >= _HOLDING
        return slow or len(self._bodies) >= _GEOMETRIES

    def _processes(self) -> int:
        return min(available_cores(), int(0.8 * available_memory().size / PROCESS_SIZE))


def _has_python(case: AnyCase) -> bool:
    """Components of the user's own and FMUs, which need not bear several calls at a time."""
    return bool(case.own_components) or bool(case.component_files)
