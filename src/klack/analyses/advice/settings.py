"""Settings that are made finer or coarser together."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Any, Literal

from klack.input.problem import Key
from klack.input.section import Section

__all__ = ["Setting", "SettingValue", "applied", "rounded_down", "rounded_up"]

_SERIES = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
_KEEP = 1.5  # a setting that would only be this much coarser stays as it is


@dataclass(frozen=True, kw_only=True)
class SettingValue:
    """One number of a case.

    Parameters
    ----------
    value
        In SI, as the case has it.
    unit
        ``m``, ``s``, ``Hz``; empty for a plain number.
    kind
        How it follows the factor: ``size`` in proportion, ``count`` inversely, ``frequency`` so
        that the number of modes below it does.
    least, most
        What the case accepts.
    table [Hz]
        Frequencies of modes, ascending, of a ``frequency``.
    """

    key: Key
    value: float
    unit: str = ""
    kind: Literal["size", "count", "frequency"] = "size"
    least: float = 0.0
    most: float = float("inf")
    table: tuple[float, ...] = ()

    def at(self, factor: float) -> float:
        """Value [SI] at a factor; only counts are rounded."""
        if self.kind == "size":
            return min(self.value * factor, self.most)
        if self.kind == "frequency":
            return self._frequency(self._count(self.value) / factor)
        return max(float(round(self.value / factor)), self.least)

    def advised(self, factor: float) -> float:
        """Value [SI] in few digits, never coarser than the factor."""
        if factor == 1.0:
            return self.value
        if self.kind == "size":
            scaled = min(self.value * factor, self.most)
            return rounded_down(scaled) if self.unit else max(floor(100.0 * scaled), 1) / 100.0
        if self.kind == "count":
            return float(max(rounded_up(self.value / factor), self.least))
        # three digits, rounded up: the mode itself must be below it
        frequency = self._frequency(self._count(self.value) / factor)
        decade = 10.0 ** (floor(log10(frequency)) - 2)
        return ceil(frequency / decade) * decade

    def finer(self, first: float, second: float) -> float:
        """Finer of two values."""
        return min(first, second) if self.kind == "size" else max(first, second)

    def factor_of(self, value: float) -> float:
        """Factor at which this value stands."""
        if self.kind == "frequency":
            return self._count(self.value) / self._count(value)
        return value / self.value if self.kind == "size" else self.value / value

    def _count(self, frequency: float) -> float:
        below = sum(item <= frequency for item in self.table)
        if below < len(self.table):
            return max(float(below), 1.0)
        return len(self.table) * frequency / self.table[-1]  # evenly spaced above the pool

    def _frequency(self, count: float) -> float:
        whole = ceil(count - 1e-9)
        if whole <= len(self.table):
            return self.table[whole - 1]
        return self.table[-1] * whole / len(self.table)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Numbers of a case that change together; ``name`` as ``"needle, away from the contact"``."""

    name: str
    group: Literal["mesh", "layers", "modes", "step"]
    values: tuple[SettingValue, ...]

    def at(self, factor: float) -> dict[Key, float]:
        """Values [SI] at a factor."""
        return {item.key: item.at(factor) for item in self.values}

    def reaches(self, factor: float) -> bool:
        """Whether every value can follow the factor: a grading ends at 1."""
        return all(item.kind != "size" or item.value * factor <= item.most for item in self.values)

    def advised(self, factor: float) -> dict[Key, float]:
        """Values [SI] for a factor; those of the case if they are good enough."""
        kept = 1.0 if 1.0 <= factor < _KEEP else factor
        return {item.key: item.advised(kept) for item in self.values}

    def factor_of(self, values: Mapping[Key, float]) -> float:
        """Coarsest factor among values."""
        return max(item.factor_of(values[item.key]) for item in self.values)


def rounded_down(value: float) -> float:
    """Next number of the series 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 that is not above.

    >>> rounded_down(0.00379), rounded_down(2.5e-8)
    (0.003, 2.5e-08)
    """
    decade = floor(log10(value) + 1e-9)
    fits = [step for step in _SERIES if step * 10.0**decade <= value * (1 + 1e-9)]
    return float(f"{(fits[-1] if fits else 1.0) * 10.0**decade:.3g}")


def rounded_up(count: float) -> int:
    """Next number of modes or layers: every one to 20, fives to 100, tens above.

    >>> rounded_up(12.2), rounded_up(41), rounded_up(113)
    (13, 45, 120)
    """
    step = 1 if count <= 20 else 5 if count <= 100 else 10
    return step * ceil(count / step - 1e-9)


def applied(node: Any, values: Mapping[Key, float]) -> Any:
    """Case with other numbers at existing keys, whole ones where it has them."""
    for key, value in values.items():
        node = _with(node, key, value)
    return node


def _with(node: Any, key: Key, value: float) -> Any:
    head, rest = key[0], key[1:]
    if isinstance(node, Section):
        name = str(head)
        now = getattr(node, name)
        new = _with(now, rest, value) if rest else _like(now, value)
        return node.model_copy(update={name: new})
    now = node[head]
    return {**node, head: _with(now, rest, value) if rest else _like(now, value)}


def _like(now: Any, value: float) -> float | int:
    return round(value) if isinstance(now, int) else value
