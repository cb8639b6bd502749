"""Count what is compiled."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from numba.core import event

__all__ = ["Compiled", "counted"]


@dataclass
class Compiled:
    """Functions of klack that were compiled, and how long that took.

    Parameters
    ----------
    functions : int
    seconds : float [s]
    """

    functions: int = 0
    seconds: float = 0.0


@contextmanager
def counted() -> Iterator[Compiled]:
    """Count the functions that this process compiles meanwhile; what it loads does not count."""
    count = Compiled()
    depth, begin = 0, 0.0

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            nonlocal depth, begin
            if depth == 0:
                begin = perf_counter()
            depth += 1

        def on_end(self, event: Any) -> None:
            nonlocal depth
            depth -= 1
            count.functions += event.data["dispatcher"].py_func.__module__.startswith("klack")
            if depth == 0:
                count.seconds += perf_counter() - begin

    listener = Listener()
    event.register("numba:compile", listener)
    try:
        yield count
    finally:
        event.unregister("numba:compile", listener)
