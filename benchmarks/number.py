"""One measured number, with its goal and the accuracy that it was bought with."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

__all__ = ["Number", "Size", "exponent", "number_of"]

Size = Literal["smallest", "quick", "full"]
"""How much a part measures: seconds (for tests), less than a minute, as long as it takes."""


@dataclass(frozen=True, kw_only=True)
class Number:
    """One measured number.

    Parameters
    ----------
    name : str
        The same in every run, so that two runs can be compared.
    value : float
    unit : str
    goal : float, optional
        That the value should not exceed.
    at_least : bool
        The goal is a lower bound instead.
    accuracy : float, optional
        Error of the computation that was timed.
    accuracy_of : str
        What that error is.
    series : str
        Name of the curve that the number is a point of, empty for none.
    at : float, optional
        Abscissa in that curve.
    part : str
        Part of the benchmarks that measured it.
    """

    name: str
    value: float
    unit: str
    goal: float | None = None
    at_least: bool = False
    accuracy: float | None = None
    accuracy_of: str = ""
    series: str = ""
    at: float | None = None
    part: str = ""

    @property
    def met(self) -> bool | None:
        """True if the goal is met; None without a goal."""
        if self.goal is None:
            return None
        return self.value >= self.goal if self.at_least else self.value <= self.goal

    @property
    def verdict(self) -> str:
        """Goal and verdict in words."""
        if self.goal is None:
            return ""
        return f"{'>=' if self.at_least else '<='} {self.goal:g} {'ok' if self.met else 'MISSED'}"

    @property
    def beside(self) -> str:
        """Accuracy in words."""
        return "" if self.accuracy is None else f"{self.accuracy_of} {self.accuracy:.1e}"

    def line(self) -> str:
        """One line of the table in the terminal."""
        value = f"{self.value:.4g}" if abs(self.value) < 1e4 else f"{self.value:,.0f}"
        return f"{self.name:<66}{value:>11} {self.unit:<8}{self.verdict:<18}{self.beside}".rstrip()

    def entry(self) -> dict[str, Any]:
        """As the JSON holds it."""
        return {key: value for key, value in asdict(self).items() if key != "name"}


def number_of(name: str, entry: dict[str, Any]) -> Number:
    """Return the number that an entry of a JSON holds; keys of other versions are left out."""
    known = {key: entry[key] for key in Number.__dataclass_fields__ if key in entry}
    return Number(name=name, **known)


def exponent(sizes: list[float], values: list[float]) -> float:
    """Slope of the least-squares line through the logarithms; nan where a value is not above 0."""
    if min(values) <= 0.0:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
