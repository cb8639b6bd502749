"""Trials of a calibration on all cores, each computed once."""

from collections.abc import Sequence

from klack.analyses.calibration.log import TrialKey, TrialLog
from klack.analyses.calibration.motion import Motion, MotionModel
from klack.analyses.workers import Failure, WorkerDied, WorkerPool, answer, shared, unwrapped
from klack.closing import Closing
from klack.errors import ConvergenceError

__all__ = ["TrialPool"]


class TrialPool(Closing):
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
        self._pool = WorkerPool(workers, model)

    def close(self) -> None:
        """End the processes."""
        self._pool.close()

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
        try:
            for key, found in self._pool.completed(_run, keys):
                self._keep(key, found)
        except WorkerDied as error:
            raise ConvergenceError(
                f"calibration: {error}; the trials so far are kept.\n"
                "Try: fewer --workers if the memory was full; the same command resumes from here."
            ) from None

    def _keep(self, key: TrialKey, found: Motion | Failure) -> None:
        values = ", ".join(
            f"{parameter.name} = {value:.6g} {parameter.unit}".rstrip()
            for parameter, value in zip(self.model.parameters, key[1:], strict=True)
        )
        self.log.add(key, unwrapped(f"trial with {values}", found))


def _run(key: TrialKey) -> Motion | Failure:
    return _answer(shared(), key)


def _answer(model: MotionModel, key: TrialKey) -> Motion | Failure:
    return answer(lambda: model.run(key[1:], key[0]))
