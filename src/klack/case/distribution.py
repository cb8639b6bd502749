"""A number that varies: a fixed value or a distribution."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import exp, log1p, pi, sqrt
from typing import Annotated, Any, Literal

import scipy
from pydantic import PlainValidator, ValidationInfo, WithJsonSchema

from klack.errors import InputError
from klack.input.problem import CaseProblem, nearest, one_of, refuse_key_if
from klack.units import ANGLE, FORCE, LENGTH, RATIO, Kind, format_si, parse_quantity

__all__ = [
    "AngleDistribution",
    "Distribution",
    "ForceDistribution",
    "LengthDistribution",
    "RatioDistribution",
]


@dataclass(frozen=True, slots=True)
class Distribution:
    r"""Distribution of a size, which is never negative.

    =========  ====================================  ===================
    kind       density                               first, second
    =========  ====================================  ===================
    fixed      one value                             value, -
    uniform    constant between two values           lowest, highest
    normal     Gauss, cut off below 0                mean, standard deviation
    rayleigh   :math:`x/s^2 \exp(-x^2/2s^2)`         scale s, -
    =========  ====================================  ===================

    Mean and standard deviation are those before the cut. The length of a plane vector with two
    normal components of deviation *s* follows Rayleigh.
    """

    kind: Literal["fixed", "uniform", "normal", "rayleigh"]
    first: float
    second: float = 0.0

    def quantile(self, share: float) -> float:
        """Value that is not exceeded with the probability ``share``, 0 <= share < 1.

        Of a uniform share it is one draw (inversion; Devroye 1986, chapter II.2), which takes
        exactly one random number.
        """
        if self.kind == "uniform":
            return self.first + share * (self.second - self.first)
        if self.kind == "rayleigh":
            return float(self.first * (-2.0 * log1p(-share)) ** 0.5)
        if self.kind == "normal" and self.second > 0.0:
            below = float(scipy.special.ndtr(-self.first / self.second))
            value = self.first + self.second * float(
                scipy.special.ndtri(below + share * (1.0 - below))
            )
            return max(value, 0.0)
        return self.first

    @property
    def mean(self) -> float:
        """Mean of all draws."""
        if self.kind == "uniform":
            return 0.5 * (self.first + self.second)
        if self.kind == "rayleigh":
            return self.first * sqrt(pi / 2.0)
        if self.kind == "normal" and self.second > 0.0:
            a = self.first / self.second
            density = exp(-0.5 * a * a) / sqrt(2.0 * pi)
            return self.first + self.second * density / float(scipy.special.ndtr(a))
        return self.first

    @property
    def largest(self) -> float:
        """Value that one draw in 1e12 exceeds, or the end."""
        return self.quantile(1.0 - _RARE) if self.kind != "uniform" else self.second

    @property
    def is_fixed(self) -> bool:
        """True if every draw gives the same."""
        return self.kind == "fixed" or (self.kind == "uniform" and self.first == self.second)

    @property
    def written(self) -> float | dict[str, float | tuple[float, float]]:
        """Form in a case file [SI]: a number, or one key with its numbers."""
        if self.kind == "fixed":
            return self.first
        both = (self.first, self.second)
        return {self.kind: both if _NUMBERS[self.kind] == 2 else self.first}

    def text(self, unit: str) -> str:
        """In words: ``uniform between 1 um and 3 um``."""
        first, second = format_si(self.first, unit), format_si(self.second, unit)
        return {
            "fixed": first,
            "uniform": f"uniform between {first} and {second}",
            "normal": f"normal, mean {first}, standard deviation {second}",
            "rayleigh": f"Rayleigh, scale {first}",
        }[self.kind]


_RARE = 1e-12
_NUMBERS = {"uniform": 2, "normal": 2, "rayleigh": 1}
_MEANING = {
    "uniform": "[lowest, highest]",
    "normal": "[mean, standard deviation]",
    "rayleigh": "scale",
}


def _read(value: Any, info: ValidationInfo, *, kind: Kind) -> Distribution:
    """A plain value, or one kind with its numbers."""
    if isinstance(value, Distribution):
        return value
    if not isinstance(value, Mapping):
        return Distribution("fixed", _size(value, info, kind, ()))
    refuse_key_if(
        len(value) != 1,
        (),
        got=f"a mapping with the keys: {one_of(map(str, value))}",
        expected=f"a value, or exactly one of: {one_of(_NUMBERS)}",
        hint=f"write {{uniform: [{kind.example}, {kind.example}]}}.",
    )
    name, numbers = next(iter(value.items()))
    if name not in _NUMBERS:
        raise CaseProblem(
            (str(name),),
            got=f"the unknown distribution '{name}'",
            expected=f"one of: {one_of(_NUMBERS)}",
            hint=nearest(str(name), _NUMBERS, "a plain value is the same in every shot."),
            on_key=True,
        )
    if _NUMBERS[name] == 1:
        if isinstance(numbers, list | tuple | Mapping):
            raise _wrong_count(name, numbers)
        return Distribution("rayleigh", _size(numbers, info, kind, (name,)))
    if not isinstance(numbers, list | tuple) or len(numbers) != 2:
        raise _wrong_count(name, numbers)
    first, second = (_size(x, info, kind, (name, i)) for i, x in enumerate(numbers))
    if name == "normal":
        return Distribution("normal", first, second)
    refuse_key_if(
        second < first,
        (name,),
        got=f"from {format_si(first, kind.unit)} to {format_si(second, kind.unit)}",
        expected="the lowest value first",
        hint="swap them.",
    )
    return Distribution("uniform", first, second)


def _wrong_count(name: str, numbers: Any) -> CaseProblem:
    return CaseProblem(
        (name,),
        got=f"'{numbers}'"[:80],
        expected=f"{name}: {_MEANING[name]}",
        hint="write numbers with their units.",
    )


def _size(value: Any, info: ValidationInfo, kind: Kind, key: tuple[str | int, ...]) -> float:
    """One number of 0 or more; numbers given in Python (no context) are SI."""
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        number = float(value) if info.context is None and plain else parse_quantity(value, kind)
    except InputError as error:
        raise CaseProblem(key, got=error.got, expected=error.expected, hint=error.hint) from None
    refuse_key_if(
        not number >= 0.0,
        key,
        got=format_si(number, kind.unit),
        expected="0 or more",
        hint="directions are drawn over the whole circle; give magnitudes here.",
    )
    return number


def _typed(kind: Kind) -> tuple[PlainValidator, WithJsonSchema]:
    """Metadata of a field of this kind, or a distribution of it."""
    value = {"type": ["string", "number"], "examples": [kind.example], "$comment": kind.name}
    pair = {"type": "array", "items": value, "minItems": 2, "maxItems": 2}
    choices: list[dict[str, Any]] = [value]
    for name, count in _NUMBERS.items():
        properties = {name: {**(pair if count == 2 else value), "description": _MEANING[name]}}
        choices.append(
            {
                "type": "object",
                "properties": properties,
                "required": [name],
                "additionalProperties": False,
            }
        )
    return PlainValidator(partial(_read, kind=kind)), WithJsonSchema({"anyOf": choices})


LengthDistribution = Annotated[Distribution, *_typed(LENGTH)]
AngleDistribution = Annotated[Distribution, *_typed(ANGLE)]
ForceDistribution = Annotated[Distribution, *_typed(FORCE)]
RatioDistribution = Annotated[Distribution, *_typed(RATIO)]
