"""Points on several processes of this machine."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from klack.analyses.study.agenda import Agenda
from klack.analyses.study.asked_points import AskedPoints, groups_of
from klack.analyses.study.point_order import Answer, PointOrder, answered
from klack.analyses.study.point_row import PointRow
from klack.analyses.study.sent_case import SentCase
from klack.analyses.study.tally import Tally
from klack.analyses.workers import Failure, WorkerDied, WorkerPool, shared, unwrapped
from klack.case.any_case import AnyCase
from klack.case.case_tree import CaseTree
from klack.closing import Closing
from klack.errors import ConvergenceError
from klack.memory import require_memory
from klack.progress import Progress

__all__ = ["PROCESS_SIZE", "ProcessWorkers", "died_row"]

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
