"""Sampled signals and spectra with axis and unit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if, require_positive

__all__ = ["Spectrum", "TimeSeries"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimeSeries:
    """Values on a uniform time axis.

    Parameters
    ----------
    step [s]
    values (n,) [unit]
    unit
        As ``"N"``.
    start [s]
        Of the first value.
    """

    step: float
    values: NDArray[np.float64]
    unit: str
    start: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        require_positive(f"TimeSeries '{self.name}': step", self.step, "s")
        refuse_if(
            self.values.ndim != 1 or self.values.size == 0,
            f"TimeSeries '{self.name}': values",
            got=f"an array of shape {self.values.shape}",
            expected="one axis with at least one value",
            hint="give one channel at a time.",
        )

    @property
    def time(self) -> NDArray:
        """Time of each value [s], shape (n,)."""
        return self.start + self.step * np.arange(self.values.size)

    @property
    def rate(self) -> float:
        """Values per second [Hz]."""
        return 1.0 / self.step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spectrum:
    """One-sided values over frequency.

    Parameters
    ----------
    frequency (k,) [Hz]
        Uniform, from 0.
    values (k,) [unit]
        Complex, or real for a density.
    unit
        As ``"N s"``.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complex128] | NDArray[np.float64]
    unit: str
    name: str = ""

    def __post_init__(self) -> None:
        refuse_if(
            self.frequency.shape != self.values.shape or self.frequency.size < 2,
            f"Spectrum '{self.name}'",
            got=f"{self.frequency.size} frequencies and {self.values.size} values",
            expected="an equal number of both, at least two",
            hint="use klack.acoustics.spectrum to make spectra from time series.",
        )

    @property
    def resolution(self) -> float:
        """Distance of neighbouring frequencies [Hz]."""
        return float(self.frequency[1] - self.frequency[0])
