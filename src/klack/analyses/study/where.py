"""Where points are computed: threads, processes, a cluster."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from klack.analyses.study.asked_points import AskedPoints, PointRow, groups_of
from klack.analyses.study.computing import (
    PointWorkers,
    ThreadWorkers,
)
from klack.analyses.study.processes import PROCESS_SIZE, ProcessWorkers
from klack.case.any_case import AnyCase, CaseTree
from klack.errors import refuse_if
from klack.machine.cores import available_cores
from klack.machine.memory import available_memory
from klack.machine.progress import Progress

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["HERE", "Where"]


_HOLDING = 64
"""Points with noise (0.15 s), or impacts, that repay starting processes (4 s)."""
_GEOMETRIES = 16
"""New bodies (0.7 s) that do: threads mesh one after another."""


@dataclass(frozen=True, kw_only=True)
class Where:
    """Threads of this process, processes of this machine, or a cluster.

    Parameters
    ----------
    threads
        All cores by default.
    workers
        Processes, in place of threads.
    dask
        Address of a scheduler, or a file that has it.
    is_free
        Whether klack may take processes in place of threads where that is faster.
    """

    threads: int | None = None
    workers: int | None = None
    dask: "str | Client | None" = None
    is_free: bool = False

    def __post_init__(self) -> None:
        """Check what was asked for."""
        for name, value in (("threads", self.threads), ("workers", self.workers)):
            refuse_if(
                value is not None and (isinstance(value, bool) or value < 1),
                name,
                got=str(value),
                expected="1 or more",
                hint="leave the number out to use all cores.",
            )
        given = {"threads": self.threads, "workers": self.workers, "dask": self.dask}
        names = [name for name, value in given.items() if value is not None]
        refuse_if(
            len(names) > 1,
            " and ".join(names),
            got="several places to compute the points",
            expected="one of: threads, workers (processes of this machine), dask (a cluster)",
            hint="keep only one of them.",
        )
        if self.dask is not None:
            from klack.analyses.study.dask_workers import require_dask

            require_dask()

    def open(self, case: AnyCase, tree: CaseTree) -> PointWorkers:
        """Workers for the points of a case, if the memory suffices."""
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


class _Fitting(PointWorkers):
    """Threads, until processes are faster for many points."""

    def __init__(self, case: AnyCase, tree: CaseTree) -> None:
        self._case, self._tree = case, tree
        self._chosen: PointWorkers = ThreadWorkers()
        self.count, self.words = self._chosen.count, self._chosen.words
        self._points = 0
        self._bodies: set[tuple[object, ...]] = set()

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
            self.count, self.words = self._chosen.count, self._chosen.words
        self._chosen.compute(asked, places, keep, progress)
        self.count = self._chosen.count

    def close(self) -> None:
        self._chosen.close()

    def _pays(self, asked: AskedPoints, places: Sequence[int]) -> bool:
        """Whether these points hold the interpreter for long."""
        self._points += len(places)
        self._bodies |= {tuple(group.made.items()) for group in groups_of(asked, places)}
        # components of the user's own and FMUs need not bear several calls at a time
        if self._processes() < 2 or self._case.own_components or self._case.component_files:
            return False
        slow = asked.kind.holds_interpreter(asked) and self._points >= _HOLDING
        return slow or len(self._bodies) >= _GEOMETRIES

    def _processes(self) -> int:
        return min(available_cores(), int(0.8 * available_memory().size / PROCESS_SIZE))
