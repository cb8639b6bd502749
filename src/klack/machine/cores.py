"""Processor cores of this process, and work that shares them."""

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from importlib import import_module
from typing import TypeVar

__all__ = ["available_cores", "blas_threads", "share_of", "side_by_side", "threads_for"]

_T = TypeVar("_T")

_FEW_UNKNOWNS = 100_000  # up to which several threads cost more than they save


def available_cores() -> int:
    """Cores that the scheduler allows this process; all of the machine if unknown."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def threads_for(unknowns: int, threads: int | None = None) -> int | None:
    """Threads of BLAS for all bodies together; as given, or None (all), for many unknowns.

    Few take one: their bits are then the same on any number of threads.
    """
    return 1 if unknowns <= _FEW_UNKNOWNS else threads


def share_of(threads: int | None, parts: int) -> int:
    """Threads of each part; of all cores without a number."""
    return max(1, (threads or available_cores()) // parts)


def blas_threads(threads: int | None) -> AbstractContextManager[object]:
    """Limit of the threads of BLAS in NumPy, SciPy and MKL; none by default."""
    from threadpoolctl import threadpool_limits

    import_module("scipy.linalg")  # a library that is loaded later is not limited
    return threadpool_limits(limits=threads, user_api="blas")


def side_by_side(tasks: Sequence[Callable[[], _T]], *, at_once: bool = True) -> list[_T]:
    """Results of independent tasks, in their order.

    Parameters
    ----------
    tasks
        Best outside of the interpreter: solves, products.
    at_once
        Each with one thread of BLAS; else in turn with all.
    """
    if not (at_once and tasks):
        return [task() for task in tasks]
    from concurrent.futures import ThreadPoolExecutor

    with (
        blas_threads(1),
        ThreadPoolExecutor(max_workers=len(tasks)) as workers,
    ):
        jobs = [workers.submit(task) for task in tasks]
        return [job.result() for job in jobs]
