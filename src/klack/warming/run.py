"""Compile groups, and count."""

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from numba.core import event

from klack.errors import CacheWarning
from klack.machine.cache.result_cache import FOLDER_VARIABLE
from klack.warming.groups import GROUPS

__all__ = ["Compiled", "Warmed", "warm"]


@dataclass
class Compiled:
    """Newly compiled functions of klack, and their time [s]."""

    functions: int = 0
    seconds: float = 0.0


@contextmanager
def counted() -> Iterator[Compiled]:
    """Count functions compiled meanwhile; loaded ones do not count."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Warmed:
    """One group that is in the store now.

    Parameters
    ----------
    functions
        Compiled for it; 0 if all were there.
    seconds [s]
        Spent on compiling, waiting for other processes included.
    """

    name: str
    functions: int
    seconds: float


def warm(groups: Sequence[str]) -> Iterator[Warmed]:
    """Compile groups of functions; yield each when it is done.

    In one process, since groups share most of their functions.
    """
    for name in groups:
        with _computed_anew(), counted() as count:
            GROUPS[name].compute()
        yield Warmed(name=name, functions=count.functions, seconds=count.seconds)


@contextmanager
def _computed_anew() -> Iterator[None]:
    """Without stored results, which need no functions, and without words."""
    before = os.environ.get(FOLDER_VARIABLE)
    os.environ[FOLDER_VARIABLE] = "off"
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", category=UserWarning)
            warnings.filterwarnings("always", category=CacheWarning)
            yield
    finally:
        if before is None:
            del os.environ[FOLDER_VARIABLE]
        else:
            os.environ[FOLDER_VARIABLE] = before
