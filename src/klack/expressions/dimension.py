"""Dimension of an expression of quantities, with angles and cycles told apart."""

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from klack.units import KINDS, base_powers

__all__ = ["ANYTHING", "HALF_TURN", "NUMBER", "NUMBER_OR_ANGLE", "Dimension", "dimension_of"]

Turns = frozenset[tuple[Fraction, Fraction]]
"""Powers of (rad, cycle) that a value can be read with."""

_NONE, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True)
class Dimension:
    """Powers of the base units of one value.

    Dimension alone tells neither an angle from a ratio nor Hz from 1/s.  Therefore powers of rad
    and of cycle are kept beside it, with all ways to read a value: pi is a number, pi rad or
    pi rad per cycle, so that ``pi / 2 - angle`` is an angle and ``2 * pi * frequency`` is a rate,
    while ``1 - angle`` is nothing and ``frequency`` alone is no rate.  A time is s or s per cycle:
    its inverse is a rate or a frequency.  Where a unit other than these remains, angle and cycle
    have no say: ``radius * angle`` is a length.

    Parameters
    ----------
    powers : tuple of (str, Fraction)
        Base units with their powers, ordered by name, none of them 0.
    turns : frozenset of (Fraction, Fraction)
        Powers of rad and of cycle; several if the value can be read in several ways.
    zero : bool
        True for the number 0, which fits every unit.
    """

    powers: tuple[tuple[str, Fraction], ...] = ()
    turns: Turns = frozenset({(_NONE, _NONE)})
    zero: bool = False

    @property
    def plain(self) -> bool:
        """Whether no base unit remains: numbers and angles."""
        return not self.powers

    @property
    def number(self) -> bool:
        """Whether this can be read as a number without unit."""
        return self.plain and (_NONE, _NONE) in self.turns

    def times(self, other: "Dimension") -> "Dimension":
        """Dimension of a product."""
        turns = {(a + c, b + d) for a, b in self.turns for c, d in other.turns}
        return Dimension(_sum(self.powers, other.powers), _nearest_to_none(turns))

    def over(self, other: "Dimension") -> "Dimension":
        """Dimension of a quotient; one by pi that can be a number is a number."""
        quotient = self.times(other.to_the(Fraction(-1)))
        return NUMBER if quotient.number and len(other.turns) > 1 else quotient

    def to_the(self, power: Fraction) -> "Dimension":
        """Dimension of a power."""
        if power == 0:
            return NUMBER
        powers = tuple((base, own * power) for base, own in self.powers)
        return Dimension(powers, frozenset((a * power, b * power) for a, b in self.turns))

    def shared(self, other: "Dimension") -> "Dimension | None":
        """What two values have in common that are added or compared; None if nothing."""
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
        """Whether a value of this dimension is a quantity with this SI unit; ``"-"``: none."""
        return self.shared(dimension_of(unit)) is not None

    @property
    def _turned(self) -> bool:
        """Whether angle and cycle matter: numbers, angles, rates, frequencies."""
        return self.powers in ((), _PER_SECOND)

    def __str__(self) -> str:
        """Kind and unit as a message says them: ``a force [N]``, or base units: ``kg^2/s``."""
        for kind in KINDS:
            if self == dimension_of(kind.unit):
                return kind.name if kind.bare else f"{kind.name} [{kind.unit}]"
        if self.number:
            return "a number without unit"
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
    """Dimension of a value whose SI unit has this text; ``"-"`` is a number.

    Raises
    ------
    InputError
        If ``unit`` is unknown or no coherent SI unit.
    """
    turns = {
        "rad": ((_ONE, _NONE),),
        "Hz": ((_NONE, _ONE),),
        "s": ((_NONE, _NONE), (_NONE, -_ONE)),
    }.get(unit, ((_NONE, _NONE),))
    return Dimension(base_powers(unit), frozenset(turns))


def _nearest_to_none(turns: set[tuple[Fraction, Fraction]]) -> Turns:
    """At most 16 ways to read a value: a product of fifty times pi has thousands."""
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
