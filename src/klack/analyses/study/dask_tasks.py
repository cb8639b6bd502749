"""Points on their way through a cluster of dask, and what comes back."""

import asyncio
from collections import Counter
from collections.abc import Callable
from concurrent import futures
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, TypeVar
from uuid import uuid4

import klack
from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.point_order import Answer, PointOrder, answered
from klack.analyses.study.process_workers import died_row
from klack.analyses.study.sent_case import SentCase
from klack.analyses.study.tally import Tally
from klack.analyses.workers import Failure, unwrapped
from klack.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["LOST", "DaskTasks"]

Given = TypeVar("Given")

LOST = (OSError, futures.CancelledError, asyncio.CancelledError)
"""Raised where a worker, or the scheduler, is lost; a timeout is the first of them."""
_FETCH = 5.0
"""For the rows of a task to come from its worker [s]."""
_ROUNDS = 2
"""Times that dask gives a point up, each after four workers: over a neighbour, then over itself."""


class DaskTasks:
    """Tasks of a client, each with some points.

    Parameters
    ----------
    client : Client
    sent : SentCase
    asked : AskedPoints
    tally : Tally
        Gets the rows.
    learn : callable
        Gets each answer.
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

        Raises
        ------
        InputError
            Where a worker cannot compute any point.
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
        """Keep the rows that have come, and take back the rest."""
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
        fetch of all tasks at once would wait for that, and lose the rows of others meanwhile.

        Raises
        ------
        Exception
            Where what has come cannot be read: it would not be read another time either.
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
        """Send points of a task without an answer once more, one by one; or give them up."""
        from distributed import KilledWorker

        places = self._places.pop(future)
        error = future.exception() if future.status == "error" else None
        if isinstance(error, ImportError | AttributeError):
            raise InputError(
                "dask",
                got=f"a worker that cannot load what it is sent ({error})",
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
            self._tally(place, died_row(self._asked, str(error or "the task was taken back")))

    def _send_case(self) -> "Future":
        """A task of its own: the scheduler has it done again where its worker is lost."""
        key = f"klack-case-{uuid4().hex}"
        return self._client.submit(_same, self._sent, key=key)


def _same(given: Given) -> Given:
    return given


def _on_worker(sent: SentCase, order: PointOrder) -> tuple[str, Answer | Failure]:
    from distributed import get_worker

    return get_worker().address, answered(sent, order)
