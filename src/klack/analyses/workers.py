"""Processes that share one thing and answer with results or with errors."""

import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from klack.closing import Closing
from klack.errors import ConvergenceError, InputError, KlackError

__all__ = [
    "Failure",
    "WorkerDied",
    "WorkerPool",
    "answer",
    "deaf_to_interrupts",
    "shared",
    "unwrapped",
]

Item = TypeVar("Item")
Result = TypeVar("Result")

_LAST_MOMENTS = 10.0  # [s] from the end of a connection to that of its process

_shared: list[Any] = []


@dataclass(frozen=True, slots=True)
class Failure:
    """Error in a form for other processes: where, got, expected, hint; or its text."""

    kind: str
    parts: tuple[str, ...]


class WorkerDied(Exception):
    """A worker process ended without an answer; says how."""


class WorkerPool(Closing):
    """Processes of one thread each that share one thing; see :func:`shared`.

    Each has a connection of its own, of which this process holds one end only: a worker that dies
    is seen at once, also while it starts.  (The pool of the standard library hands what is shared
    to a new process through a pipe of which it holds both ends; where that is more than the pipe
    takes, 64 kB, and the process is gone, it waits endlessly.)

    Parameters
    ----------
    workers : int
        Processes at most; they start when there is work for them.
    given : object
        Sent to each of them once.
    """

    def __init__(self, workers: int, given: object) -> None:
        self.workers, self._given = workers, given
        self._processes: dict[Connection, BaseProcess] = {}
        self._is_busy = False

    def close(self) -> None:
        """End the processes; what they compute at this moment is lost."""
        for connection, process in self._processes.items():
            connection.close()
            process.terminate()
        for process in self._processes.values():
            process.join()
        self._processes.clear()
        self._is_busy = False

    def completed(
        self, compute: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result]]:
        """Compute something for each item; yield item and result, in the order of their end.

        Parameters
        ----------
        compute : callable
            Of a module, with one argument.
        items : iterable

        Raises
        ------
        WorkerDied
            When a process ends without an answer.
        Exception
            Of ``compute``.
        """
        if self._is_busy:  # with what was asked for before, and given up
            self.close()
        self._is_busy = True
        left = deque(items)
        running: dict[Connection, Item] = {}
        self._staff(min(self.workers, len(left)))
        for connection in list(self._processes)[: len(left)]:
            running[connection] = left.popleft()
            self._send(connection, (compute, running[connection]))
        while running:
            for connection in _ready(running):
                result, error = self._receive(connection)
                if error is not None:
                    raise error
                item = running.pop(connection)
                if left:
                    running[connection] = left.popleft()
                    self._send(connection, (compute, running[connection]))
                yield item, result
        self._is_busy = False

    def _staff(self, count: int) -> None:
        """Keep the given number of processes, all with the shared data."""
        # a fork would inherit the threads and locks of the libraries
        context = multiprocessing.get_context("spawn")
        new = []
        with deaf_to_interrupts():
            for _ in range(count - len(self._processes)):
                here, there = context.Pipe()
                process = context.Process(target=_work, args=(there, _start), daemon=True)
                process.start()
                there.close()
                self._processes[here] = process
                new.append(here)
        for connection in new:
            self._send(connection, self._given)

    def _send(self, connection: Connection, what: object) -> None:
        try:
            connection.send(what)
        except OSError:
            raise self._died(connection) from None

    def _receive(self, connection: Connection) -> Any:
        try:
            return connection.recv()
        except (EOFError, OSError):
            raise self._died(connection) from None

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
    """Result of an answer; its error, under the name of the work, is raised."""
    if not isinstance(found, Failure):
        return found
    if found.kind == "input":
        where, got, expected, hint = found.parts
        raise InputError(f"{name}: {where}", got=got, expected=expected, hint=hint)
    raise ConvergenceError(f"{name}: {found.parts[0]}")


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, from their first moment on: they inherit it.

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


def _ready(running: Iterable[Connection]) -> list[Connection]:
    """Connections with an answer, or of a process that is gone; wait for the first."""
    ready = wait(list(running))
    return [connection for connection in running if connection in ready]


def _work(connection: Connection, start: Callable[[object], None]) -> None:
    """Loop of a worker until it is stopped."""
    with suppress(EOFError, OSError):  # the process that asked has closed its end
        start(connection.recv())
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
    """End this worker when its parent process is gone."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _start(given: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threadpool_limits(limits=1)
    _shared[:] = [given]
