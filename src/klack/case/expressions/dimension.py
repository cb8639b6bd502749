"""Dimensions of expressions and units, with angles and cycles told apart."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from klack.units import (
    ANGLE,
    FREQUENCY,
    KINDS,
    RATE,
    RATIO,
    ROTATION,
    base_powers,
    powers_of_unit,
    size_of_unit,
)

__all__ = [
    "ANYTHING",
    "CELSIUS",
    "HALF_TURN",
    "NUMBER",
    "NUMBER_OR_ANGLE",
    "Dimension",
    "UnitLiteral",
    "dimension_of",
    "unit_literal",
    "unit_words",
]


Turns = frozenset[tuple[Fraction, Fraction]]
"""Powers of (rad, cycle) that a value can be read with."""

_NONE, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True)
class Dimension:
    """Powers of the base units of one value.

    Base units tell neither an angle from a ratio nor Hz from 1/s. Powers of rad and of cycle are
    therefore kept beside them, with all ways to read a value: pi is a number, pi rad or pi rad per
    cycle, so that ``pi / 2 - angle`` is an angle and ``2 * pi * frequency`` a rate, while ``1 -
    angle`` is nothing and ``frequency`` alone no rate. A time is s or s per cycle: its inverse is
    a rate or a frequency. Where other units remain, angle and cycle do not count: ``radius *
    angle`` is a length.

    Parameters
    ----------
    powers
        Base units with non-zero powers, ordered by name.
    turns
        Powers of rad and of cycle, one for each way to read the value.
    zero
        True for the number 0, which fits every unit.
    """

    powers: tuple[tuple[str, Fraction], ...] = ()
    turns: Turns = frozenset({(_NONE, _NONE)})
    zero: bool = False

    @property
    def plain(self) -> bool:
        """Whether no base unit remains."""
        return not self.powers

    @property
    def number(self) -> bool:
        """Whether this can be a number without a unit."""
        return self.plain and (_NONE, _NONE) in self.turns

    def times(self, other: "Dimension") -> "Dimension":
        """Dimension of a product."""
        turns = {(a + c, b + d) for a, b in self.turns for c, d in other.turns}
        return Dimension(_sum(self.powers, other.powers), _nearest_to_none(turns))

    def over(self, other: "Dimension") -> "Dimension":
        """Dimension of a quotient; a number by pi may be a number."""
        quotient = self.times(other.to_the(Fraction(-1)))
        return NUMBER if quotient.number and len(other.turns) > 1 else quotient

    def to_the(self, power: Fraction) -> "Dimension":
        """Dimension of a power."""
        if power == 0:
            return NUMBER
        powers = tuple((base, own * power) for base, own in self.powers)
        return Dimension(powers, frozenset((a * power, b * power) for a, b in self.turns))

    def shared(self, other: "Dimension") -> "Dimension | None":
        """Common readings of two values that are added or compared, if any."""
        if self.zero:
            return other
        if other.zero:
            return self
        if self.powers != other.powers:
            return None
        if self._turned or other._turned:
            turns = self.turns & other.turns
            return Dimension(self.powers, turns) if turns else None
        return Dimension(self.powers, self.turns | other.turns)

    def fits(self, unit: str) -> bool:
        """Whether it can have this SI unit; ``"-"``: none."""
        return self.shared(dimension_of(unit)) is not None

    @property
    def _turned(self) -> bool:
        """Whether angle and cycle matter."""
        return self.powers in ((), _PER_SECOND)

    def __str__(self) -> str:
        """As in messages: ``a force [N]``, or base units: ``kg^2/s``."""
        for kind in KINDS:
            if self == dimension_of(kind.unit):
                return kind.name if kind.bare else f"{kind.name} [{kind.unit}]"
        if self.number:
            return "a number without a unit"
        for kind in KINDS:
            if self.fits(kind.unit):
                return f"{kind.name} [{kind.unit}]"
        return f"a quantity in {self.unit}"

    @property
    def unit(self) -> str:
        """Product of base units: ``kg*m^2*s^-2``."""
        extra: tuple[tuple[str, Fraction], ...] = ()
        if self._turned:
            angle, cycle = min(self.turns)
            extra = tuple((n, p) for n, p in (("rad", angle), ("cycle", cycle)) if p)
        return "*".join(
            base
            if power == 1
            else f"{base}^{power}"
            if power.denominator == 1
            else f"{base}^({power})"
            for base, power in (*self.powers, *extra)
        )


def dimension_of(unit: str) -> Dimension:
    """Dimension of a coherent SI unit; ``"-"`` is a number."""
    turns = {
        "rad": ((_ONE, _NONE),),
        "rad/s": ((_ONE, _NONE),),
        "Hz": ((_NONE, _ONE),),
        "s": ((_NONE, _NONE), (_NONE, -_ONE)),
    }.get(unit, ((_NONE, _NONE),))
    return Dimension(base_powers(unit), frozenset(turns))


def _nearest_to_none(turns: set[tuple[Fraction, Fraction]]) -> Turns:
    """At most 16 readings: a product of fifty times pi has thousands."""
    order = sorted(turns, key=lambda turn: (abs(turn[0]) + abs(turn[1]), turn))
    return frozenset(order[:16])


def _sum(
    a: Iterable[tuple[str, Fraction]], b: Iterable[tuple[str, Fraction]]
) -> tuple[tuple[str, Fraction], ...]:
    powers = dict(a)
    for base, power in b:
        powers[base] = powers.get(base, _NONE) + power
    return tuple(sorted((base, power) for base, power in powers.items() if power))


_PER_SECOND = (("s", -_ONE),)
NUMBER = Dimension()
"""A number without unit."""
ANYTHING = Dimension(zero=True)
"""The number 0."""
NUMBER_OR_ANGLE = Dimension(turns=frozenset({(_NONE, _NONE), (_ONE, _NONE)}))
"""What asin, acos and atan give."""
HALF_TURN = Dimension(turns=frozenset({(_NONE, _NONE), (_ONE, _NONE), (_NONE, -_ONE)}))
"""pi: a number, pi rad, or rad per cycle as in ``2 * pi * frequency``."""


CELSIUS = ("degC", "°C")
"""Units with an offset: a temperature that cannot be added to another."""
_TABLES = (RATIO, ANGLE, FREQUENCY, RATE, ROTATION)
_TIME = (("s", Fraction(1)),)
_FACTOR = re.compile(r"(?P<sign>[*/]?)(?P<word>[^\W\d_]+|[%°])(?:\^(?P<power>-?\d(?:\.\d)?))?")

UnitLiteral = tuple[float, Dimension]
"""Value [SI] and dimension."""


def unit_literal(number: float, unit: str) -> UnitLiteral | None:
    """Value of a number with its unit; None for an unknown one.

    As :func:`klack.units.parse_quantity`, to the bit.

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
    """Words of a unit: ``N``, ``mm`` of ``N/mm^2``."""
    return tuple(match["word"] for match in _FACTOR.finditer(unit))


@lru_cache(maxsize=1000)
def _unit(unit: str) -> tuple[float, Dimension, bool] | None:
    """Size in SI, dimension, and whether multiples are left unrounded."""
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
    """Product over the words of a unit; None if one is unknown."""
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
    """Dimension of a word such as ``mm``; None if it cannot be multiplied."""
    for kind in (ANGLE, FREQUENCY):
        if word in kind.factors:
            return dimension_of(kind.unit)
    powers = powers_of_unit(word) if word not in ROTATION.factors else None
    if powers is None:
        return None
    return dimension_of("s") if powers == _TIME else Dimension(powers)
