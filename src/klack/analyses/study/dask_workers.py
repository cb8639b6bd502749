"""Points on a cluster, by dask.distributed."""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent import futures
from importlib.metadata import version
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic, sleep
from typing import TYPE_CHECKING, TypeVar
from uuid import uuid4

import klack
from klack.analyses.study.asked_points import AskedPoints, PointRow, groups_of
from klack.analyses.study.computing import Agenda, PointWorkers, Tally
from klack.analyses.study.processes import Answer, PointOrder, SentCase, answered, died_row
from klack.analyses.workers import Failure, unwrapped
from klack.case.any_case import AnyCase, CaseTree
from klack.errors import ConvergenceError, InputError, MissingExtraError, refuse_if
from klack.machine.progress import Progress, remark

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["DaskTasks", "DaskWorkers", "require_dask"]


Given = TypeVar("Given")

LOST = (OSError, futures.CancelledError, asyncio.CancelledError)
"""Raised where a worker or the scheduler is lost; a timeout is the first."""
_FETCH = 5.0
"""Time limit for fetching rows of a task [s]."""
_ROUNDS = 2
"""Times that dask gives a point up, each after four workers: over a neighbour, then over itself."""


class DaskTasks:
    """Tasks of a client, each with some points.

    ``tally`` gets the rows, ``learn`` each answer.
    """

    def __init__(
        self,
        client: "Client",
        sent: SentCase,
        asked: AskedPoints,
        tally: Tally,
        learn: Callable[[Answer], None],
    ) -> None:
        self._client, self._sent, self._asked = client, sent, asked
        self._tally, self._learn = tally, learn
        self._case = self._send_case()
        self._ended: SimpleQueue[Future] = SimpleQueue()
        self._places: dict[Future, tuple[int, ...]] = {}
        self._lost: set[Future] = set()
        self._given_up: Counter[int] = Counter()

    def __len__(self) -> int:
        return len(self._places)

    def submit(self, places: tuple[int, ...]) -> None:
        """Send points on their way."""
        order = PointOrder.of(self._asked, places)
        key = f"klack-points-{uuid4().hex}"
        future = self._client.submit(_on_worker, self._case, order, key=key)
        self._places[future] = places
        future.add_done_callback(self._ended.put)

    def settle(self, patience: float) -> None:
        """Wait for tasks that end, at most so long [s], and keep their rows.

        InputError where a worker cannot compute any point.
        """
        ended = {*self._taken(patience), *self._lost}
        self._lost.clear()
        refused: list[tuple[str, Failure]] = []
        for future in ended & self._places.keys():
            if future.status == "finished":
                refused += self._keep(future)
            elif future.status in ("error", "cancelled"):
                self._again(future)
            else:
                self._lost.add(future)
        for address, failure in refused:
            unwrapped(f"worker {address}", failure)

    def give_up(self) -> None:
        """Keep rows that have come; take back the rest."""
        try:
            for future in [one for one in self._places if one.status == "finished"]:
                self._keep(future)
        finally:
            self._client.cancel([*self._places, self._case])
            self._places.clear()

    def _taken(self, patience: float) -> list["Future"]:
        found: list[Future] = []
        try:
            found.append(self._ended.get(timeout=patience))
            while True:
                found.append(self._ended.get_nowait())
        except Empty:
            return found

    def _keep(self, future: "Future") -> list[tuple[str, Failure]]:
        """Fetch the rows of a task; return why its worker refused, if it did.

        The worker that has them may be lost at this moment.  Dask has them computed again then; a
        fetch of all tasks at once would wait for that, and lose the rows of others meanwhile.  It
        raises where what has come cannot be read: it would not be read another time either.
        """
        try:
            address, found = future.result(timeout=_FETCH)
        except (Exception, *LOST) as error:
            if future.status == "finished" and not isinstance(error, LOST):
                raise
            self._lost.add(future)
            return []
        places = self._places.pop(future)
        future.release()
        if isinstance(found, Failure):
            return [(address, found)]
        self._learn(found)
        for place, row in zip(places, found.rows, strict=True):
            self._tally(place, row)
        return []

    def _again(self, future: "Future") -> None:
        from distributed import KilledWorker

        places = self._places.pop(future)
        error = future.exception() if future.status == "error" else None
        refuse_if(
            isinstance(error, ImportError | AttributeError),
            "dask",
            got=f"a worker that cannot load the data sent to it ({error})",
            expected=f"klack {klack.__version__} in the environment of every worker",
            hint="start the workers in the same environment as this command.",
        )
        if error is not None and not isinstance(error, KilledWorker):
            raise error
        self._case = self._send_case()
        for place in places:
            self._given_up[place] += len(places) == 1
            if self._given_up[place] < _ROUNDS:
                self.submit((place,))
                continue
            self._tally(place, died_row(self._asked, str(error or "the task was withdrawn")))

    def _send_case(self) -> "Future":
        """A task of its own: the scheduler repeats it where its worker is lost."""
        key = f"klack-case-{uuid4().hex}"
        return self._client.submit(_same, self._sent, key=key)


def _same(given: Given) -> Given:
    return given


def _on_worker(sent: SentCase, order: PointOrder) -> tuple[str, Answer | Failure]:
    from distributed import get_worker

    return get_worker().address, answered(sent, order)


_LOOK = 0.2
"""Between two looks for Ctrl-C [s]."""
_COUNT = 1.0
"""Between two counts of the workers [s]."""
_PATIENCE = 20.0
"""For the scheduler to answer [s]."""
_AHEAD = 2
"""Tasks on their way for each worker."""
_FEWEST = 16
"""Tasks on their way, also to a growing cluster."""


def require_dask() -> None:
    """Refuse a cluster without dask.distributed."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise MissingExtraError("distributed", "A study on a cluster", "dask") from None


class DaskWorkers(PointWorkers):
    """Workers of a cluster of dask compute, this process keeps the rows.

    Points that a lost worker had at that moment are computed by others.  InputError if the
    scheduler (address, a file with it, a client, which stays open, or a cluster) does not answer,
    or if the case cannot be sent.
    """

    words = "workers of dask"

    def __init__(self, case: AnyCase, tree: CaseTree, scheduler: "str | Client") -> None:
        require_dask()
        self._sent = SentCase.of(case, tree)
        self._client, self._is_own = _client(scheduler)
        self._size = _TaskSize()
        self.count, self._now, self._counted = 0, 0, -_COUNT
        self._checked: set[str] = set()
        self._told = False

    def close(self) -> None:
        """Leave the cluster."""
        if self._is_own:
            self._client.close()

    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        """Compute some of the points, as :class:`PointWorkers` says.

        ConvergenceError if the scheduler is lost.
        """
        self._require_a_worker(progress)
        groups = groups_of(asked, places)
        agenda = Agenda([group.places for group in groups])
        with Tally(len(asked.points), len(places), keep, progress) as tally:
            tasks = DaskTasks(self._client, self._sent, asked, tally, self._size.learn)
            try:
                while agenda.left or tasks:
                    tally.tell()
                    self._require_scheduler()
                    self._count_workers(progress)
                    most = max(_FEWEST, _AHEAD * self._now)
                    while agenda.left and len(tasks) < most:
                        points = self._size.points(agenda.left, most, len(groups) > 1)
                        tasks.submit(agenda.take(most=points))
                    tasks.settle(_LOOK)
                tally.tell()
            except LOST as error:
                raise self._lost(error) from None
            finally:
                if self._client.status == "running":
                    tasks.give_up()

    def _require_a_worker(self, progress: Progress) -> None:
        """Wait for the first worker, by a task that needs no klack."""
        probe = self._client.submit(version, "klack", pure=False)
        try:
            while not probe.done():
                self._require_scheduler()
                self._count_workers(progress)
                sleep(_LOOK / 10)
            self._count_workers(progress)
        except LOST as error:
            raise self._lost(error) from None
        finally:
            probe.release()

    def _count_workers(self, progress: Progress) -> None:
        """Count workers once a second, and check new ones."""
        if monotonic() < self._counted + _COUNT:
            return
        self._counted = monotonic()
        threads = self._client.nthreads()
        before, self._now = self._now, len(threads)
        self.count = max(self.count, self._now)
        if not threads and (before or not self._checked):
            remark(progress, "no Dask worker: waiting for one")
        new = [address for address in threads if address not in self._checked]
        if not new:
            return
        try:
            told = self._client.run(version, "klack", workers=new, on_error="return")
        except (OSError, ValueError, KeyError):  # one of them has gone: next time
            return
        for address, found in told.items():
            _require_version(address, found)
            self._checked.add(address)
        if max(threads[address] for address in new) > 1 and not self._told:
            self._told = True
            remark(
                progress,
                "Dask workers with several threads compute one point at a time; start them with "
                "--nthreads 1",
            )

    def _require_scheduler(self) -> None:
        if self._client.status != "running":
            raise self._lost(self._client.status)

    def _lost(self, why: object) -> ConvergenceError:
        return ConvergenceError(
            f"the connection to the Dask scheduler is lost ({str(why) or type(why).__name__}).\n"
            "Try: restart it; all points received so far are kept, and the same command resumes."
        )


def _require_version(address: str, found: object) -> None:
    """Refuse a worker without this klack before it gets what it cannot read."""
    if found == klack.__version__ or not isinstance(found, str | ImportError):  # it has gone again
        return
    got = f"klack {found}" if isinstance(found, str) else f"no klack ({found})"
    raise InputError(
        f"worker {address}",
        got=got,
        expected=f"klack {klack.__version__}, as where the study was started: points are kept by "
        "its version",
        hint="start the workers in the same environment as this command.",
    )


class _TaskSize:
    """Number of points in a task that is worth its way."""

    _short, _long, _most = 0.5, 5.0, 64
    """Work of a task with the bodies of all others, and with its own [s]; points."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=32)

    def learn(self, answer: Answer) -> None:
        self._seconds.append(answer.seconds / max(len(answer.rows), 1))

    def points(self, left: int, tasks: int, own_bodies: bool) -> int:
        if not self._seconds:
            return 1
        usual = sorted(self._seconds)[len(self._seconds) // 2]
        goal = self._long if own_bodies else self._short
        return int(max(1, min(goal / max(usual, 1e-6), self._most, -(-left // tasks))))


def _client(scheduler: "str | Client") -> "tuple[Client, bool]":
    """A client, and whether to close it; InputError without an answer."""
    from distributed import Client

    if isinstance(scheduler, Client):
        return scheduler, False
    if hasattr(scheduler, "scheduler_address"):  # a cluster
        return Client(scheduler, set_as_default=False), True
    text = str(scheduler)
    try:
        if Path(text).is_file():
            client = Client(scheduler_file=text, timeout=_PATIENCE, set_as_default=False)
        else:
            client = Client(text, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError) as error:
        raise InputError(
            f"dask {text}",
            got=f"no answer ({str(error).strip() or type(error).__name__})",
            expected="the address of a running Dask scheduler, or its scheduler file",
            hint="start a scheduler: dask scheduler --scheduler-file scheduler.json.",
        ) from None
    return client, True
