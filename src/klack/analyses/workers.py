"""Processes that share one thing and answer with results or errors."""

import multiprocessing
import os
import re
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from threadpoolctl import threadpool_limits

from klack.analyses.unfinished import UnfinishedLog
from klack.errors import ConvergenceError, InputError, KlackError
from klack.files.closing import Closing

__all__ = [
    "Failure",
    "LoggedWork",
    "WorkerDied",
    "WorkerPool",
    "answer",
    "deaf_to_interrupts",
    "grouped_doubts",
    "shared",
    "unwrapped",
]


Item = TypeVar("Item")
Result = TypeVar("Result")

_STARTS = 10  # processes that may end one after another before they begin, if any may end
_LAST_MOMENTS = 10.0  # [s] from the end of a connection to that of its process

_shared: list[Any] = []


@dataclass(frozen=True, slots=True)
class Failure:
    """Error for other processes: where, got, expected, hint; or its text."""

    kind: str
    parts: tuple[str, ...]


class WorkerDied(Exception):
    """A worker process ended without an answer; the text says how."""


@dataclass(eq=False)
class _Task(Generic[Item]):
    item: Item
    deaths: int = 0


class WorkerPool(Closing):
    """Processes of one thread each that share one thing; see :func:`shared`.

    Each has a connection of its own, of which this process holds one end only: a worker that dies
    is seen at once, also while it starts.  (The pool of the standard library hands what is shared
    to a new process through a pipe of which it holds both ends; where that is more than the pipe
    takes, 64 kB, and the process is gone, it waits endlessly.  Its executor, and that of loky, end
    all work with the first process that dies, and take three and five times as long per item.)

    Parameters
    ----------
    workers
        Processes at most; they start when there is work for them.
    given
        Sent to each of them once.
    """

    def __init__(self, workers: int, given: object) -> None:
        self.workers, self._given = workers, given
        self._processes: dict[Connection, BaseProcess] = {}
        self._starting: set[Connection] = set()
        self._tasks: dict[Connection, _Task[Any]] = {}
        self._read_from: Connection | None = None
        self._is_busy = False

    def close(self) -> None:
        """End the processes; work in progress is lost."""
        for connection, process in self._processes.items():
            connection.close()
            process.terminate()
        for process in self._processes.values():
            process.join()
        self._processes.clear()
        self._starting.clear()
        self._tasks.clear()
        self._read_from = None
        self._is_busy = False

    def completed(
        self, compute: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result]]:
        """Compute something for each item; yield item and result, in the order of their end.

        ``compute`` is a function of a module.  WorkerDied when a process ends without an answer.
        """
        left = deque(items)
        if not left:
            return
        for item, found in self.answers(compute, lambda _: left.popleft() if left else None):
            if isinstance(found, WorkerDied):
                raise found
            yield item, found

    def answers(
        self,
        compute: Callable[[Item], Result],
        take: Callable[[object], Item | None],
        attempts: int = 1,
    ) -> Iterator[tuple[Item, "Result | WorkerDied"]]:
        """Compute something for items that are taken one by one, in the order of their end.

        A process that ends without an answer is replaced, and its item computed again, after all
        others: not by a process that has still to start, which chance may end as well.

        Parameters
        ----------
        compute
            Of a module, with one argument.
        take
            Next item for a process, which it gets as a thing to compare with others; None if there
            is none.
        attempts
            Processes that an item may end, until that is its answer.

        Raises
        ------
        WorkerDied
            If ten processes one after another ended before they could begin, and nothing was
            answered meanwhile; the first one, where an item has a single attempt.
        """
        if self._is_busy:  # with what was asked for before, and given up
            self.close()
        self._is_busy = True
        again: deque[_Task[Item]] = deque()
        in_vain, most = 0, _STARTS if attempts > 1 else 1

        def next_task(worker: object) -> _Task[Item] | None:
            item = take(worker)
            if item is not None:
                return _Task(item)
            return again.popleft() if again else None

        while True:
            self._employ(compute, next_task)
            if not self._tasks:
                break
            ready = wait(list(self._tasks))  # with an answer, or of a process that is gone
            for connection in [one for one in self._tasks if one in ready]:
                task = self._tasks[connection]
                try:
                    result, error = self._receive(connection)
                except (EOFError, OSError):
                    died = self._buried(connection)
                    if connection in self._starting:
                        self._starting.remove(connection)
                        in_vain += 1
                        if in_vain >= most:
                            raise died from None
                    else:
                        task.deaths += 1
                    if task.deaths >= attempts:
                        yield task.item, died
                    else:
                        again.append(task)
                    continue
                if error is not None:
                    raise error
                in_vain = 0
                if connection in self._starting:  # and now ready
                    self._starting.remove(connection)
                    continue
                del self._tasks[connection]
                self._employ(compute, next_task)
                yield task.item, result
        self._is_busy = False

    def finished(self) -> Iterator[tuple[Any, Any]]:
        """Late answers to who gave up asking, each with its item."""
        whole = {key: task for key, task in self._tasks.items() if key is not self._read_from}
        for connection, task in whole.items():
            with suppress(EOFError, OSError):
                while connection in self._tasks and connection.poll():
                    result, error = self._receive(connection)
                    if connection in self._starting:
                        self._starting.remove(connection)
                    elif error is None:
                        del self._tasks[connection]
                        yield task.item, result

    def _employ(
        self, compute: Callable[[Item], Any], next_task: "Callable[[object], _Task[Item] | None]"
    ) -> None:
        """Give work to idle processes; start further ones while there is some."""
        for connection in [one for one in self._processes if one not in self._tasks]:
            task = next_task(connection)
            if task is not None:
                self._tasks[connection] = task
                self._send(connection, (compute, task.item))
        new = []
        while len(self._processes) < self.workers:
            task = next_task(None)
            if task is None:
                break
            new.append(self._started())
            self._tasks[new[-1]] = task
        for connection in new:  # all have begun to start: more than a pipe takes is waited for
            self._send(connection, self._given)
            self._send(connection, (compute, self._tasks[connection].item))

    def _started(self) -> Connection:
        """Connection to a new process, before what is shared is sent."""
        # a fork would inherit the threads and locks of the libraries
        context = multiprocessing.get_context("spawn")
        with deaf_to_interrupts():
            here, there = context.Pipe()
            process = context.Process(target=_work, args=(there, _start), daemon=True)
            process.start()
            there.close()
            self._processes[here] = process
            self._starting.add(here)
        return here

    def _send(self, connection: Connection, what: object) -> None:
        with suppress(OSError):  # it is gone, as its answer will tell
            connection.send(what)

    def _receive(self, connection: Connection) -> Any:
        self._read_from = connection
        found = connection.recv()
        self._read_from = None
        return found

    def _buried(self, connection: Connection) -> WorkerDied:
        """Forget a dead process and its item; return how it ended."""
        died = self._died(connection)
        process = self._processes.pop(connection)
        process.kill()  # where it only closed its connection
        process.join()
        self._tasks.pop(connection, None)
        self._read_from = None
        connection.close()
        return died

    def _died(self, connection: Connection) -> WorkerDied:
        process = self._processes[connection]
        process.join(_LAST_MOMENTS)
        code = process.exitcode
        if code is None:
            return WorkerDied("a worker process does not answer")
        how = f"by signal {-code}" if code < 0 else f"with exit code {code}"
        return WorkerDied(f"a worker process died {how}")


def shared() -> Any:
    """Shared data of the :class:`WorkerPool`, inside a worker."""
    return _shared[0]


def answer(compute: Callable[[], Result]) -> Result | Failure:
    """Result, or the error that it ended with."""
    try:
        return compute()
    except InputError as error:
        return Failure("input", (error.where, error.got, error.expected, error.hint))
    except KlackError as error:
        return Failure("other", (str(error),))


def unwrapped(name: str, found: Result | Failure) -> Result:
    """Result of an answer, or its error raised under the name of the work."""
    if not isinstance(found, Failure):
        return found
    if found.kind == "input":
        where, got, expected, hint = found.parts
        raise InputError(f"{name}: {where}", got=got, expected=expected, hint=hint)
    raise ConvergenceError(f"{name}: {found.parts[0]}")


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Start processes that never hear Ctrl-C: they inherit it.

    One that comes meanwhile is heard at the end.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(connection: Connection, start: Callable[[object], None]) -> None:
    with suppress(EOFError, OSError):  # the process that asked has closed its end
        connection.send(_attempt(start, connection.recv()))  # that it is ready
        while True:
            compute, item = connection.recv()
            connection.send(_attempt(compute, item))


def _attempt(compute: Callable[[Item], Result], item: Item) -> tuple[Result | None, Any]:
    try:
        return compute(item), None
    except Exception as error:  # an internal error, to be seen where the work was asked for
        error.add_note(f"In a worker process:\n{traceback.format_exc()}")
        return None, error


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _start(given: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threadpool_limits(limits=1)
    _shared[:] = [given]


Key = TypeVar("Key")
Part = TypeVar("Part")


class LoggedWork(Closing, Generic[Key, Part]):
    """Computes parts that the log does not hold yet, and keeps them there.

    The numbers do not depend on the number of workers: every part is computed by one thread, from
    the same arrays.

    Parameters
    ----------
    run
        Of a module: part of what is given and an item.
    given
        Sent to each process once.
    workers
        Processes; 1 computes in this one.
    name
        What an error calls the part of a key.
    fewest
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

        An error names the part.
        """
        left = {key: item for key, item in items.items() if key not in self.log.done}
        if self._pool.workers < 2 or len(left) < self._fewest:
            for key, item in left.items():
                yield self._keep(key, _part(self._run, self._given, item))
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
    return _part(run, shared(), item[1])


def _part(run: Callable[[Any, Any], Part], given: Any, item: Any) -> Part | Failure:
    return answer(lambda: run(given, item))


_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def grouped_doubts(doubts: Iterable[tuple[int, Iterable[str]]], shots: str) -> list[str]:
    """How many shots have each doubt, and the first of them.

    ``doubts`` are the number of each shot and its doubts; ``shots`` is what they are called.

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
