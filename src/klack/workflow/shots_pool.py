"""Many shots on all cores: one process per core, one thread each."""

import multiprocessing
import os
import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool

from threadpoolctl import threadpool_limits

from klack.errors import ConvergenceError, InputError, KlackError
from klack.workflow.progress import Progress
from klack.workflow.shot_draw import ShotDraw
from klack.workflow.shot_run import ShotOutcome, ShotSetup, run_shot
from klack.workflow.shots_log import ShotLog

__all__ = ["available_cores", "run_shots_on"]

_FEWEST = 3  # shots that make up for the start of a second process

_Answer = ShotOutcome | tuple[str, ...]
"""A shot, or kind and parts of the error that it ended with."""


def available_cores() -> int:
    """Processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_shots_on(
    workers: int, setup: ShotSetup, draws: Sequence[ShotDraw], log: ShotLog, progress: Progress
) -> None:
    """Run the shots that the log does not hold yet, and put them there.

    The numbers do not depend on ``workers``: every shot is computed by one thread, from the same
    arrays.

    Raises
    ------
    InputError, ConvergenceError
        Of the first shot that fails; it is named.
    """
    left = [draw for draw in draws if draw.index not in log.done]
    total = len(draws)
    progress("shots", (total - len(left)) / total)
    workers = min(workers, len(left))
    if workers <= 1 or len(left) < _FEWEST:
        for draw in left:
            log.add(draw.index, _unwrapped(draw.index, _answer(setup, draw)))
            progress("shots", len(log.done) / total)
        return
    # a fork would inherit the threads and locks of the libraries
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        max_workers=workers, mp_context=context, initializer=_start, initargs=(setup,)
    )
    try:
        jobs = {pool.submit(_run, draw): draw.index for draw in left}
        for job in as_completed(jobs):
            log.add(jobs[job], _unwrapped(jobs[job], job.result()))
            progress("shots", len(log.done) / total)
    except BrokenProcessPool:
        raise ConvergenceError(
            f"shots: a worker process died; {len(log.done)} of {total} shots are finished.\n"
            "Try: fewer --workers if the memory was full; the same command goes on from here."
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


_shared: list[ShotSetup] = []


def _start(setup: ShotSetup) -> None:
    """Prepare a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threadpool_limits(limits=1)
    _shared[:] = [setup]


def _run(draw: ShotDraw) -> _Answer:
    return _answer(_shared[0], draw)


def _answer(setup: ShotSetup, draw: ShotDraw) -> _Answer:
    """Shot or error, in a form that travels between processes."""
    try:
        return run_shot(setup, draw)
    except InputError as error:
        return ("input", error.where, error.got, error.expected, error.hint)
    except KlackError as error:
        return ("other", str(error))


def _unwrapped(index: int, answer: _Answer) -> ShotOutcome:
    if isinstance(answer, ShotOutcome):
        return answer
    name = f"shot {index}" if index >= 0 else "the centred shot"
    if answer[0] == "input":
        where, got, expected, hint = answer[1:]
        raise InputError(f"{name}: {where}", got=got, expected=expected, hint=hint)
    raise ConvergenceError(f"{name}: {answer[1]}")
