"""Sobol's indices of the measures of a study."""

from collections.abc import Sequence

from klack.analyses.study.record import Sensitivity, StudyColumn
from klack.studies.sensitivity import sobol_indices

__all__ = ["sensitivities_of"]


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
