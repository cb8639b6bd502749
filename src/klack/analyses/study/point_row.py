"""What one point of a study leaves behind."""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from typing import NamedTuple

from klack.errors import AccuracyWarning

__all__ = ["UNCHECKED", "PointRow", "PointSteps", "doubts_in", "others_in"]


class PointSteps(NamedTuple):
    """What a check of the time steps of a stroke has found.

    Parameters
    ----------
    halvings : int
        How often all steps were halved.
    change : float [-]
        Largest change of the impacts that the measures depend on with all steps twice as long, over
        what the accuracy promises; inf where one has no counterpart, nan where nothing was checked.
    """

    halvings: int = 0
    change: float = nan

    def with_other(self, other: "PointSteps") -> "PointSteps":
        """Of two runs of one point, for different measures."""
        return PointSteps(max(self.halvings, other.halvings), max(self.change, other.change))


UNCHECKED = PointSteps()


@dataclass(frozen=True, slots=True)
class PointRow:
    """What one point leaves behind.

    Parameters
    ----------
    values : tuple of float or None
        Of the measures, in their order.
    failure : str
        Why there are none; empty if it was computed.
    notes : tuple of str
        Doubts about the numbers.
    others : tuple of WarningMessage
        Warnings that are no doubt about a number.
    by_chance : bool
        True if the same point may be computed another time: the memory was full, or a component
        of the user's own has failed.
    model : str
        What the numbers come from, in words: level, modes and meshes of an impact.
    steps : PointSteps or None
        Of a stroke.
    """

    values: tuple[float | None, ...]
    failure: str = ""
    notes: tuple[str, ...] = ()
    others: tuple[warnings.WarningMessage, ...] = ()
    by_chance: bool = False
    model: str = ""
    steps: PointSteps | None = None

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values with nan where there is none."""
        return tuple(float("nan") if value is None else value for value in self.values)


def doubts_in(caught: Iterable[warnings.WarningMessage]) -> tuple[str, ...]:
    """Warnings that are doubts about numbers, as text."""
    return tuple(str(item.message) for item in caught if issubclass(item.category, AccuracyWarning))


def others_in(
    caught: Iterable[warnings.WarningMessage],
) -> tuple[warnings.WarningMessage, ...]:
    """Warnings that are no doubt about a number, to be shown as usual."""
    return tuple(item for item in caught if not issubclass(item.category, AccuracyWarning))
