"""Record of ``klack heat``."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord

__all__ = ["CauseRow", "HeatStudy", "WarmColumn"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WarmColumn:
    """One quantity [SI] at every point; nan where a stroke does not have it."""

    name: str
    unit: str
    values: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class CauseRow:
    """A stroke with one cause, or all of them, at other temperatures than the base.

    ``state`` says at which temperatures; ``cause`` is ``"base"``, an aspect, or ``"all"``.
    """

    state: str
    cause: str
    numbers: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class HeatStudy(CaseRecord):
    """Warm-up of a valve, or its strokes soaked.

    Parameters
    ----------
    period [s]
        From one stroke to the next.
    time (points,) [s]
        Infinite for the steady state; 0 of soaked strokes.
    temperature [K], heat [W]
        Of the nodes, and mean heat of the strokes into them.
    numbers, values
        Of the strokes: delays and peaks; resistances and gaps.
    end
        ``"steady"``, ``"duration"``, ``"runaway"``, ``"hot"``, or ``"soaked"``.
    gain [-]
        See :class:`~klack.thermal.slow_warm_up.SlowWarmUp`.
    supplied, stored, given_off [J]
        By node, over the time of the warm-up.
    energy_residual [-]
    unsent [W]
        Mean power of losses of the last stroke that warm no node.
    strokes, repeats
        Computed strokes, and repeated steps.
    cpu_time [s]
        Of the strokes.
    """

    variant: str
    period: float
    time: Vector
    temperature: tuple[WarmColumn, ...]
    heat: tuple[WarmColumn, ...]
    numbers: tuple[WarmColumn, ...]
    values: tuple[WarmColumn, ...]
    causes: tuple[CauseRow, ...]
    end: str
    gain: float
    supplied: Mapping[str, float]
    stored: Mapping[str, float]
    given_off: Mapping[str, float]
    energy_residual: float
    unsent: Mapping[str, float]
    strokes: int
    repeats: int
    cpu_time: float

    @property
    def columns(self) -> tuple[WarmColumn, ...]:
        """All but the time."""
        return (*self.temperature, *self.heat, *self.numbers, *self.values)
