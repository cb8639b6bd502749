"""Trials of a calibration on all cores, each computed once."""

import multiprocessing
import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Self

from threadpoolctl import threadpool_limits

from klack.errors import ConvergenceError, InputError, KlackError
from klack.workflow.calibration_log import TrialKey, TrialLog
from klack.workflow.calibration_motion import Motion, MotionModel

__all__ = ["TrialPool"]

_Answer = Motion | tuple[str, ...]
"""A motion, or kind and parts of the error that it ended with."""


class TrialPool:
    """Computes trials that the log does not hold yet, and keeps them there.

    The numbers do not depend on the number of workers.

    Parameters
    ----------
    model : MotionModel
    workers : int
        Processes; 1 computes in this one.
    log : TrialLog
    """

    def __init__(self, model: MotionModel, workers: int, log: TrialLog) -> None:
        self.model, self.workers, self.log = model, workers, log
        self.used: set[TrialKey] = set()
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)

    def motions(self, values: Sequence[Sequence[float]], duration: float) -> list[Motion]:
        """Motions for several parameter vectors [SI], in their order.

        Raises
        ------
        InputError, ConvergenceError
            Of a trial that cannot be computed; its parameters are named.
        """
        keys: list[TrialKey] = [(duration, *map(float, item)) for item in values]
        self.used.update(keys)
        left = [key for key in dict.fromkeys(keys) if key not in self.log.done]
        if len(left) < 2 or self.workers < 2:
            for key in left:
                self._keep(key, _answer(self.model, key))
        else:
            self._compute(left)
        return [self.log.done[key] for key in keys]

    def _compute(self, keys: Sequence[TrialKey]) -> None:
        if self._pool is None:
            # a fork would inherit the threads and locks of the libraries
            self._pool = ProcessPoolExecutor(
                max_workers=self.workers,
                mp_context=multiprocessing.get_context("spawn"),
                initializer=_start,
                initargs=(self.model,),
            )
        try:
            jobs = {self._pool.submit(_run, key): key for key in keys}
            for job in as_completed(jobs):
                self._keep(jobs[job], job.result())
        except BrokenProcessPool:
            raise ConvergenceError(
                "calibration: a worker process died; the trials so far are kept.\n"
                "Try: fewer --workers if the memory was full; the same command goes on from here."
            ) from None

    def _keep(self, key: TrialKey, answer: _Answer) -> None:
        if isinstance(answer, Motion):
            self.log.add(key, answer)
            return
        values = ", ".join(
            f"{parameter.name} = {value:.6g} {parameter.unit}".rstrip()
            for parameter, value in zip(self.model.parameters, key[1:], strict=True)
        )
        if answer[0] == "input":
            where, got, expected, hint = answer[1:]
            raise InputError(f"trial with {values}: {where}", got=got, expected=expected, hint=hint)
        raise ConvergenceError(f"trial with {values}: {answer[1]}")


_shared: list[MotionModel] = []


def _start(model: MotionModel) -> None:
    """Prepare a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threadpool_limits(limits=1)
    _shared[:] = [model]


def _run(key: TrialKey) -> _Answer:
    return _answer(_shared[0], key)


def _answer(model: MotionModel, key: TrialKey) -> _Answer:
    """Motion or error, in a form that travels between processes."""
    try:
        return model.run(key[1:], key[0])
    except InputError as error:
        return ("input", error.where, error.got, error.expected, error.hint)
    except KlackError as error:
        return ("other", str(error))
