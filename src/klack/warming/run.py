"""Compile all groups, one after another."""

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from klack.cache.setting import FOLDER_VARIABLE
from klack.errors import CacheWarning
from klack.warming.counted import counted
from klack.warming.groups import GROUPS

__all__ = ["Warmed", "warm"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Warmed:
    """One group that is in the store now.

    Parameters
    ----------
    name : str
    functions : int
        Functions of klack that had to be compiled for it; 0 if all were there.
    seconds : float [s]
        Spent on compiling, waiting for other processes included.
    """

    name: str
    functions: int
    seconds: float


def warm(groups: Sequence[str]) -> Iterator[Warmed]:
    """Compile groups of functions; yield each when it is done.

    In one process: groups share most of their functions, and what two processes compile at the
    same time costs more than it saves unless two cores are free.
    """
    for name in groups:
        with _computed_anew(), counted() as count:
            GROUPS[name].compute()
        yield Warmed(name=name, functions=count.functions, seconds=count.seconds)


@contextmanager
def _computed_anew() -> Iterator[None]:
    """Without stored results, which need no functions, and without words about the cases."""
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
