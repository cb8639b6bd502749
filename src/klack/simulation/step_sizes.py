"""Sizes of the steps of a network: from what bodies, contacts and lines follow."""

from dataclasses import dataclass

from klack.simulation.network_arrays import PARTS

__all__ = ["StepSizes"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSizes:
    """Steps of a run.

    Parameters
    ----------
    step : float [s]
        Fine step, at first touch and release.
    coarse : int
        Fine steps of a macro step in flight; 1 for no macro steps.
    near : int
        Fine steps of a macro step about a touch; divides ``coarse``.
    middle : int
        Fine steps of a sub-step while contact forces are smooth; divides ``near``.
    """

    step: float
    coarse: int
    near: int
    middle: int

    @property
    def seconds(self) -> tuple[float, ...]:
        """Lengths [s] in the order of the sizes of the time loop."""
        whole = (1, self.coarse, self.near, self.middle)
        return (*(count * self.step for count in whole), self.step / PARTS)
