"""Parts of a long work on all cores, each computed once and kept in a log."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, Generic, TypeVar

from klack.analyses.unfinished import UnfinishedLog
from klack.analyses.workers import Failure, WorkerDied, WorkerPool, answer, shared, unwrapped
from klack.closing import Closing
from klack.errors import ConvergenceError

__all__ = ["LoggedWork", "grouped_doubts"]


Key = TypeVar("Key")
Part = TypeVar("Part")


class LoggedWork(Closing, Generic[Key, Part]):
    """Computes parts that the log does not hold yet, and keeps them there.

    The numbers do not depend on the number of workers: every part is computed by one thread, from
    the same arrays.

    Parameters
    ----------
    run : callable
        Of a module: part of what is given and an item.
    given : object
        Sent to each process once.
    workers : int
        Processes; 1 computes in this one.
    log : UnfinishedLog
    name : callable
        What an error calls the part of a key.
    fewest : int
        Parts that make up for the start of a second process.
    """

    def __init__(
        self,
        run: Callable[[Any, Any], Part],
        given: object,
        workers: int,
        log: UnfinishedLog[Key, Part],
        name: Callable[[Key], str],
        fewest: int = 2,
    ) -> None:
        self._run, self._given, self._name, self.log = run, given, name, log
        self._fewest = fewest
        self._pool = WorkerPool(workers, given)

    def close(self) -> None:
        """End the processes."""
        self._pool.close()

    def completed(self, items: Mapping[Key, Any]) -> Iterator[Key]:
        """Compute items by their key, those that are not there yet; yield each key when it is.

        Raises
        ------
        InputError, ConvergenceError
            Of a part that cannot be computed; it is named.
        """
        left = {key: item for key, item in items.items() if key not in self.log.done}
        if self._pool.workers < 2 or len(left) < self._fewest:
            for key, item in left.items():
                yield self._keep(key, _attempt(self._run, self._given, item))
            return
        work = partial(_in_a_worker, self._run)
        try:
            for (key, _), found in self._pool.completed(work, left.items()):
                yield self._keep(key, found)
        except WorkerDied as error:
            raise ConvergenceError(
                f"{error}; {self.log.form.parts} so far: {len(self.log.done)}.\n"
                "Try: fewer --workers if the memory was full; the same command resumes from here."
            ) from None

    def _keep(self, key: Key, found: Part | Failure) -> Key:
        self.log.add(key, unwrapped(self._name(key), found))
        return key


def _in_a_worker(run: Callable[[Any, Any], Part], item: tuple[Any, Any]) -> Part | Failure:
    return _attempt(run, shared(), item[1])


def _attempt(run: Callable[[Any, Any], Part], given: Any, item: Any) -> Part | Failure:
    return answer(lambda: run(given, item))


_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def grouped_doubts(doubts: Iterable[tuple[int, Iterable[str]]], shots: str) -> list[str]:
    """How many shots have each doubt, and the first of them.

    Parameters
    ----------
    doubts : iterable of (int, iterable of str)
        Number of each shot, and its doubts.
    shots : str
        What they are called, ``"shots"``.

    Examples
    --------
    >>> grouped_doubts([(0, ["off by 2 %"]), (1, ["off by 3.5 %"]), (2, [])], "shots")
    ['2 of 3 shots, first shot 0: off by 2 %']
    """
    alike: dict[str, list[tuple[int, str]]] = {}
    count = 0
    for index, own in doubts:
        count += 1
        for doubt in own:
            alike.setdefault(_NUMBER.sub("#", doubt), []).append((index, doubt))
    return [
        f"{len(found)} of {count} {shots}, first {shots.rstrip('s')} {found[0][0]}: {found[0][1]}"
        for found in alike.values()
    ]
