"""Numbers with their units inside an expression: ``0.3 mm``, in SI with their dimension."""

import re
from fractions import Fraction
from functools import lru_cache

from klack.expressions.dimension import NUMBER, Dimension, dimension_of
from klack.units import (
    ANGLE,
    FREQUENCY,
    KINDS,
    RATE,
    RATIO,
    ROTATION,
    powers_of_unit,
    size_of_unit,
)

__all__ = ["CELSIUS", "UnitLiteral", "unit_literal", "unit_words"]

CELSIUS = ("degC", "°C")
"""Units with an offset: a temperature of its own, which cannot be added to another one."""
_TABLES = (RATIO, ANGLE, FREQUENCY, RATE, ROTATION)
_TIME = (("s", Fraction(1)),)
_FACTOR = re.compile(r"(?P<sign>[*/]?)(?P<word>[^\W\d_]+|[%°])(?:\^(?P<power>-?\d(?:\.\d)?))?")

UnitLiteral = tuple[float, Dimension]
"""Value [SI] and dimension."""


def unit_literal(number: float, unit: str) -> UnitLiteral | None:
    """Value of a number with its unit; None for an unknown unit.

    The same number as that of :func:`klack.units.parse_quantity`, to the bit.

    Examples
    --------
    >>> value, dimension = unit_literal(0.3, "mm")
    >>> value, str(dimension)
    (0.0003, 'a length [m]')
    """
    if unit in CELSIUS:
        return round(number + 273.15, 6), dimension_of("K")
    found = _unit(unit)
    if found is None:
        return None
    size, dimension, exact = found
    value = number * size
    return (value if exact else float(f"{value:.15g}")), dimension


def unit_words(unit: str) -> tuple[str, ...]:
    """Words of a unit: ``N`` and ``mm`` of ``N/mm^2``."""
    return tuple(match["word"] for match in _FACTOR.finditer(unit))


@lru_cache(maxsize=1000)
def _unit(unit: str) -> tuple[float, Dimension, bool] | None:
    """Size of a unit in SI, its dimension, and whether its multiples are left unrounded."""
    plain = unit.replace("**", "^").replace("·", "*")
    for kind in _TABLES:
        if plain in kind.factors:
            return kind.factors[plain], dimension_of(kind.unit), True
    dimension = _dimension(plain)
    if dimension is None:
        return None
    fitting = (kind.unit for kind in KINDS if not kind.factors and dimension.fits(kind.unit))
    # in the unit of its kind, as where a case has it without arithmetic
    return size_of_unit(plain, next(fitting, "")), dimension, False


def _dimension(unit: str) -> Dimension | None:
    """Product of the dimensions of all words of a unit; None if one is unknown."""
    result = NUMBER
    for match in _FACTOR.finditer(unit.replace("1/", "/")):
        own = _word(match["word"])
        if own is None:
            return None
        power = Fraction(match["power"] or 1)
        result = result.times(own.to_the(-power if match["sign"] == "/" else power))
    return result


@lru_cache(maxsize=1000)
def _word(word: str) -> Dimension | None:
    """Dimension of one word, such as ``mm``; None if it is no unit that can be multiplied."""
    for kind in (ANGLE, FREQUENCY):
        if word in kind.factors:
            return dimension_of(kind.unit)
    powers = powers_of_unit(word) if word not in ROTATION.factors else None
    if powers is None:
        return None
    return dimension_of("s") if powers == _TIME else Dimension(powers)
