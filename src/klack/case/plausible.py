"""Numbers that a valve can have: doubt about unusual ones, errors at impossible ones.

A wrong unit makes a number a thousand times off. Sizes and masses of bodies:
:mod:`klack.assembling.given_shapes`; materials:
:attr:`klack.materials.material.Material.question`.
"""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from klack.errors import InputError
from klack.input.problem import Key, key_text
from klack.units import format_si

__all__ = ["GO_ON", "MOVING_MASS", "PART_MASS", "SIZE", "SPEED", "Number", "Range"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """Range of one kind of number, in doubt outside ``usual``, an error outside ``possible``.

    Parameters
    ----------
    unit
        SI, without prefix.
    reason
        One clause.
    """

    unit: str
    usual: tuple[float, float]
    possible: tuple[float, float]
    reason: str

    def is_usual(self, value: float) -> bool:
        """Whether nothing has to be said."""
        return self.usual[0] <= value <= self.usual[1]

    def is_possible(self, value: float) -> bool:
        """Whether it can be at all."""
        return self.possible[0] <= value <= self.possible[1]

    @property
    def in_words(self) -> str:
        """The usual range."""
        return " to ".join(self.shown(value) for value in self.usual)

    def shown(self, value: float) -> str:
        """Number with unit, masses below 1 kg in grams."""
        if self.unit == "kg" and value < 1.0:
            return f"{1e3 * value:.3g} g"
        return format_si(value, self.unit)


SPEED = Range(
    unit="m/s",
    usual=(2e-3, 20.0),
    possible=(0.0, 100.0),
    reason="a flat impact of steel on steel gives 20 MPa per m/s, and at 100 m/s hardened steel "
    "yields throughout; needles hit at 0.02 to 5 m/s",
)
"""Of an impact [m/s]. At 2 mm/s a stroke of 0.1 mm takes 50 ms: no valve is so slow."""

MOVING_MASS = Range(
    unit="kg",
    usual=(1e-5, 0.5),
    possible=(0.0, inf),
    reason="needles of injectors weigh 10 mg and more, armatures of large solenoid valves up to "
    "0.5 kg",
)
"""Of the moving body [kg]; size and material tell what cannot be."""

PART_MASS = Range(
    unit="kg",
    usual=(1e-6, 10.0),
    possible=(1e-9, 1000.0),
    reason="a rigid part of a valve weighs 1 mg to 10 kg, with its housing",
)
"""Of a rigid part of a network [kg]."""

SIZE = Range(
    unit="m",
    usual=(1e-3, 0.2),
    possible=(1e-4, 1.0),
    reason="needles and housings are 1 to 200 mm long",
)
"""Longest side [m] of the largest body."""

GO_ON = "check its unit; with 'unusual: true' at the top of the case it is computed nevertheless."
"""Advice at what cannot be."""


class Number(NamedTuple):
    """Number of a case, its key and range."""

    key: Key
    value: float
    range: Range

    @property
    def doubt(self) -> str | None:
        """Doubt in words; None for a usual number."""
        if self.range.is_usual(self.value):
            return None
        return (
            f"{key_text(self.key)}: {self.range.shown(self.value)} is unusual (usual: "
            f"{self.range.in_words}; {self.range.reason}). Try: check its unit."
        )

    def require_possible(self, where: str) -> None:
        """Reject an impossible number."""
        if self.range.is_possible(self.value):
            return
        least, most = (self.range.shown(limit) for limit in self.range.possible)
        expected = f"{most} or less" if self.value > self.range.possible[1] else f"{least} or more"
        raise InputError(
            where,
            got=self.range.shown(self.value),
            expected=f"{expected}: {self.range.reason}",
            hint=GO_ON,
        )
