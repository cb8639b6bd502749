"""The same work for several bodies at once, each with its share of the cores."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from threadpoolctl import threadpool_limits

from klack.cores import available_cores

__all__ = ["share_of", "side_by_side"]

_T = TypeVar("_T")


def share_of(threads: int | None, parts: int) -> int:
    """Threads of each part; of all cores without a number."""
    return max(1, (threads or available_cores()) // parts)


def side_by_side(tasks: Sequence[Callable[[], _T]], *, at_once: bool = True) -> list[_T]:
    """Results of independent tasks, in their order.

    Parameters
    ----------
    tasks : sequence of callable
        What takes long in them runs outside of the interpreter: solves and products.
    at_once : bool
        One after the other if not, with all threads of BLAS.
    """
    if not at_once:
        return [task() for task in tasks]
    with (
        threadpool_limits(limits=share_of(None, len(tasks)), user_api="blas"),
        ThreadPoolExecutor(max_workers=len(tasks)) as workers,
    ):
        jobs = [workers.submit(task) for task in tasks]
        return [job.result() for job in jobs]
