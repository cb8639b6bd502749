"""Processes that share one thing and answer with results or with errors."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from klack.errors import ConvergenceError, InputError, KlackError

__all__ = [
    "Failure",
    "answer",
    "deaf_to_interrupts",
    "shared",
    "unwrapped",
    "worker_pool",
]

Result = TypeVar("Result")

_shared: list[Any] = []


@dataclass(frozen=True, slots=True)
class Failure:
    """Error in a form that travels between processes: where, got, expected, hint; or its words."""

    kind: str
    parts: tuple[str, ...]


def worker_pool(workers: int, given: object) -> ProcessPoolExecutor:
    """Processes of one thread each, to which ``given`` is sent once; see :func:`shared`."""
    return ProcessPoolExecutor(
        max_workers=workers,
        # a fork would inherit the threads and locks of the libraries
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start,
        initargs=(given,),
    )


def shared() -> Any:
    """What :func:`worker_pool` was given, inside of a worker."""
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


def _end_with_parent() -> None:
    """End this worker when the process that asked is gone; killed, it could not say so."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _start(given: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threadpool_limits(limits=1)
    _shared[:] = [given]
