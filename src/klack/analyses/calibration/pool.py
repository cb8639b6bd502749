"""Trials of a calibration on all cores, each computed once."""

from collections.abc import Sequence

from klack.analyses.calibration.log import TrialKey, TrialLog
from klack.analyses.calibration.motion import Motion, MotionModel
from klack.analyses.logged_work import LoggedWork

__all__ = ["TrialPool"]


class TrialPool(LoggedWork[TrialKey, Motion]):
    """Computes trials that the log does not hold yet, and keeps them there.

    Parameters
    ----------
    model : MotionModel
    workers : int
    log : TrialLog
    """

    def __init__(self, model: MotionModel, workers: int, log: TrialLog) -> None:
        super().__init__(_run, model, workers, log, self._name_of)
        self.model = model
        self.used: set[TrialKey] = set()

    def motions(self, values: Sequence[Sequence[float]], duration: float) -> list[Motion]:
        """Motions for several parameter vectors [SI], in their order.

        Raises
        ------
        InputError, ConvergenceError
            Of a trial that cannot be computed; its parameters are named.
        """
        keys: list[TrialKey] = [(duration, *map(float, item)) for item in values]
        self.used.update(keys)
        for _ in self.completed({key: key for key in keys}):
            pass
        return [self.log.done[key] for key in keys]

    def _name_of(self, key: TrialKey) -> str:
        values = ", ".join(
            f"{parameter.name} = {value:.6g} {parameter.unit}".rstrip()
            for parameter, value in zip(self.model.parameters, key[1:], strict=True)
        )
        return f"trial with {values}"


def _run(model: MotionModel, key: TrialKey) -> Motion:
    return model.run(key[1:], key[0])
