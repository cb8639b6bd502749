"""Sobol's indices and elementary effects of the measures of a study."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.record import Screening, Sensitivity, StudyColumn
from klack.studies.screening import elementary_effects
from klack.studies.sensitivity import sobol_indices

__all__ = ["screenings_of", "sensitivities_of"]


def sensitivities_of(
    measures: Sequence[StudyColumn], parameters: Sequence[str]
) -> tuple[Sensitivity, ...]:
    """Indices of each measure over the points of Saltelli's design, in the order of the design."""
    return tuple(_sensitivity(item, tuple(parameters)) for item in measures)


def _sensitivity(item: StudyColumn, parameters: tuple[str, ...]) -> Sensitivity:
    found = sobol_indices(item.values, len(parameters))
    return Sensitivity(
        measure=item.name,
        parameters=parameters,
        first=found.first.value,
        first_low=found.first.low,
        first_high=found.first.high,
        total=found.total.value,
        total_low=found.total.low,
        total_high=found.total.high,
        rows=found.rows,
        discarded=found.discarded,
        confidence=found.confidence,
        reason=found.reason,
    )


def screenings_of(
    measures: Sequence[StudyColumn], parameters: Sequence[str], cube: NDArray[np.float64]
) -> tuple[Screening, ...]:
    """Elementary effects of each parameter on each measure, over the trajectories of Morris."""
    return tuple(_screening(item, tuple(parameters), cube) for item in measures)


def _screening(
    item: StudyColumn, parameters: tuple[str, ...], cube: NDArray[np.float64]
) -> Screening:
    found = elementary_effects(cube, item.values)
    return Screening(
        measure=item.name,
        parameters=parameters,
        size=found.mean_size,
        size_error=found.mean_size_error,
        mean=found.mean,
        scatter=found.scatter,
        effects=found.effects,
    )
