"""One number for a measure that scatters: mean and margin, or a quantile, on the worse side."""

import re
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError
from klack.studies.margins import mean_and_margin
from klack.studies.quantiles import sample_quantile

__all__ = ["RobustValue"]

_MARGIN = re.compile(r"mean\s*\+\s*(?P<number>\d+(?:\.\d*)?)\s*sd")
_QUANTILE = re.compile(r"quantile\s+(?P<number>\d+(?:\.\d*)?)\s*%")
_MOST_MULTIPLE = 10.0


@dataclass(frozen=True, slots=True)
class RobustValue:
    """What stands for the values of many valves.

    Parameters
    ----------
    kind : "margin" or "quantile"
        Mean and a multiple of the standard deviation
        (:func:`~klack.studies.margins.mean_and_margin`), or a quantile
        (:func:`~klack.studies.quantiles.sample_quantile`).
    number : float
        The multiple, or the probability, above one half.

    Examples
    --------
    >>> RobustValue.parse("mean + 2 sd", "robust").of([1.0, 2.0, 3.0], high=True)
    4.0
    >>> RobustValue.parse("quantile 90 %", "robust").words(high=False)
    'quantile 10 %'
    """

    kind: Literal["margin", "quantile"]
    number: float

    @classmethod
    def parse(cls, text: str, where: str) -> Self:
        """Read ``mean + 2 sd`` or ``quantile 95 %``.

        Raises
        ------
        InputError
            For another text, a multiple above 10, and a probability outside of 50 to 100 %.
        """
        margin, quantile = _MARGIN.fullmatch(text.strip()), _QUANTILE.fullmatch(text.strip())
        if margin is not None and float(margin["number"]) <= _MOST_MULTIPLE:
            return cls("margin", float(margin["number"]))
        if quantile is not None and 50.0 < float(quantile["number"]) < 100.0:
            return cls("quantile", float(quantile["number"]) / 100.0)
        raise InputError(
            where,
            got=f"'{text}'",
            expected="'mean + K sd' with K up to 10, or 'quantile P %' with P between 50 and 100",
            hint="mean + 2 sd; the side is that of the objective or bound.",
        )

    def of(self, values: ArrayLike, *, high: bool) -> float:
        """Value of one sample on its high or low side; nan if one of its runs has none.

        A design one of whose valves cannot be computed has no value, however good the others are.
        """
        found = np.asarray(values, dtype=float)
        if not np.isfinite(found).all():
            return float("nan")
        if self.kind == "margin":
            return mean_and_margin(found, self.number if high else -self.number).value
        return sample_quantile(found, self.number if high else 1.0 - self.number).estimate

    def of_rows(self, table: NDArray[np.float64], *, high: bool) -> NDArray[np.float64]:
        """The same for every row, shape (designs, valves) to (designs,)."""
        return np.array([self.of(row, high=high) for row in table])

    def words(self, *, high: bool) -> str:
        """As it is written, with the sign of the side."""
        if self.kind == "margin":
            return f"mean {'+' if high else '-'} {self.number:g} sd"
        return f"quantile {100.0 * (self.number if high else 1.0 - self.number):g} %"
