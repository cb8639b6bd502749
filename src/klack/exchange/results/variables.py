"""Named arrays with dimensions and attributes, as xarray takes them."""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from klack.analyses.measures import Measure

__all__ = ["Variable", "about_measure"]


class Variable(NamedTuple):
    """Dimensions, values and attributes (``units``, ``long_name``, ``comment``) of one quantity."""

    dimensions: tuple[str, ...]
    values: NDArray[Any] | float | int | bool
    attributes: dict[str, str]


def about_measure(measure: Measure[Any]) -> dict[str, str]:
    """Attributes of the values of a measure."""
    return {"units": measure.unit, "long_name": measure.name, "comment": measure.definition}
