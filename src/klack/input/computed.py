"""A value that an expression gave, on its way to the key that says which quantity it must be."""

from dataclasses import dataclass
from typing import Protocol

__all__ = ["Computed", "plain_number"]


class _Dimension(Protocol):
    def fits(self, unit: str) -> bool: ...


@dataclass(frozen=True, slots=True)
class Computed:
    """Result of an expression in a case.

    Parameters
    ----------
    value : float [SI]
    dimension : object
        Says by ``fits`` whether the value is a quantity with an SI unit, and in words what it is.
    text : str
        The expression.
    """

    value: float
    dimension: _Dimension
    text: str

    def __str__(self) -> str:
        return f"'{self.text}', which is {self.value:.6g}, {self.dimension}"


def plain_number(value: object) -> object:
    """Number that an expression without unit gave; anything else as it is."""
    if isinstance(value, Computed) and value.dimension.fits("-"):
        return value.value
    return value
