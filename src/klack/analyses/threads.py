"""Work on the threads of this process, for what mostly runs outside of the interpreter.

Beside :mod:`klack.analyses.workers`, whose processes each load klack and hold their own arrays.
"""

import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from queue import Empty, SimpleQueue
from typing import Any, TextIO, TypeVar

from threadpoolctl import ThreadpoolController

__all__ = ["Stopped", "never_stopped", "on_threads", "one_thread_of_blas", "warnings_of_threads"]

Item = TypeVar("Item")
Result = TypeVar("Result")

_LOOK = 0.2  # [s] between two looks for Ctrl-C: a wait without end lets none through on Windows


class Stopped(Exception):
    """A thread was asked to stop."""


def on_threads(
    items: Sequence[Item],
    compute: Callable[[Item, Callable[[], None]], Result],
    threads: int,
    keep: Callable[[Item, Result], None],
    tell: Callable[[], None],
) -> None:
    """Compute something for every item on threads.

    Parameters
    ----------
    items : sequence
        Taken in their order.
    compute : callable
        Gets an item and a function to call now and then, which raises :class:`Stopped` once the
        work has been given up.  Must not raise anything else.
    threads : int
    keep : callable
        Called in this thread with an item and its result, in the order of their end.
    tell : callable
        Called after it.

    Raises
    ------
    BaseException
        Of ``tell``, or Ctrl-C: after all threads have ended and ``keep`` has got what they had
        finished.
    """
    left, answers = iter(items), SimpleQueue[tuple[Item, Result]]()
    guard, stop = threading.Lock(), threading.Event()

    def check() -> None:
        if stop.is_set():
            raise Stopped

    def work() -> None:
        while not stop.is_set():
            with guard:
                item = next(left, nothing)
            if item is nothing:
                return
            try:
                answers.put((item, compute(item, check)))  # type: ignore[arg-type]
            except Stopped:
                return

    nothing = object()
    crew = [threading.Thread(target=work) for _ in range(min(threads, len(items)))]
    open_items = len(items)
    try:
        for thread in crew:
            thread.start()
        while open_items and any(thread.is_alive() for thread in crew):
            if _taken(answers, keep, _LOOK):
                open_items -= 1
                tell()
    finally:
        stop.set()
        for thread in crew:
            if thread.ident is not None:
                thread.join()
        while _taken(answers, keep, 0.0):
            pass


def _taken(
    answers: "SimpleQueue[tuple[Item, Result]]",
    keep: Callable[[Item, Result], None],
    patience: float,
) -> bool:
    try:
        item, result = answers.get(timeout=patience) if patience else answers.get_nowait()
    except Empty:
        return False
    keep(item, result)
    return True


def never_stopped() -> None:
    """The check of work that nothing asks to stop."""


@contextmanager
def one_thread_of_blas() -> Iterator[None]:
    """Let NumPy and SciPy take one thread each: points are what is computed side by side."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache  # it looks at all libraries of the process, which takes milliseconds
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


@contextmanager
def warnings_of_threads() -> Iterator[Callable[[], list[warnings.WarningMessage]]]:
    """Collect warnings of each thread apart from those of the others.

    Within, nothing else may exchange the filters of warnings: they belong to the whole process.

    Yields
    ------
    callable
        Warnings of the thread that calls it, since it called last.
    """
    caught: dict[int, list[warnings.WarningMessage]] = {}

    def keep(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        mine = caught.setdefault(threading.get_ident(), [])
        mine.append(warnings.WarningMessage(message, category, filename, lineno, file, line))

    def taken() -> list[warnings.WarningMessage]:
        return caught.pop(threading.get_ident(), [])

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        original: Any = warnings.showwarning
        warnings.showwarning = keep
        try:
            yield taken
        finally:
            warnings.showwarning = original
