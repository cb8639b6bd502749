"""From a measure to one number of a table."""

from typing import TypeVar

from klack.analyses.measures import Measure
from klack.exchange.results.table import ResultScalar

__all__ = ["measure_scalar"]

Of = TypeVar("Of")


def measure_scalar(measure: Measure[Of], of: Of) -> ResultScalar:
    """Name, unit, value and definition of a measure; nan where it has no value."""
    value = measure.read(of)
    return ResultScalar(
        name=measure.name,
        unit=measure.unit,
        value=float("nan") if value is None else float(value),
        meaning=measure.definition,
    )
