"""A quantity in equal sectors of a ring over time: an animation on screen, moments on paper."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["RingFrames", "frame_text", "squeezed", "ticks_of"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingFrames:
    """Values of the sectors of a ring, seen from above, at some moments.

    Colours are linear up to ``linear`` and logarithmic beyond, on both sides of zero.

    Parameters
    ----------
    name, title : str
    label, unit : str
        Of the values.
    time : array, shape (k,)
        In ``time_unit``.
    time_unit : str
    values : array, shape (k, S)
        Sector ``s`` has its middle at the angle ``2 pi s / S`` from x towards y.
    marked : array of bool, shape (k, S)
        Sectors drawn in grey.
    mark : str
        What grey means.
    captions : tuple of str
        What stands with each moment beside its time.
    linear : float
    prefix : str
        What stands before the time.
    note : str
    """

    name: str
    title: str
    label: str
    unit: str
    time: Floats
    time_unit: str
    values: Floats
    marked: NDArray[np.bool_]
    mark: str
    captions: tuple[str, ...]
    linear: float = 1.0
    prefix: str = "time: "
    note: str = ""

    @property
    def sectors(self) -> int:
        """Number of sectors."""
        return self.values.shape[1]

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value of the colours."""
        low, high = float(self.values.min()), float(self.values.max())
        return min(low, 0.0), max(high, self.linear)


def squeezed(chart: RingFrames, values: Floats) -> Floats:
    """Place of values on the scale of colours: ``asinh(v / linear)``."""
    return np.asarray(np.arcsinh(values / chart.linear))


def ticks_of(chart: RingFrames) -> tuple[float, ...]:
    """Round values within the scale of colours."""
    low, high = chart.ends
    powers = [chart.linear * 10.0**k for k in range(12)]
    both = [-p for p in reversed(powers)] + [0.0] + powers
    return tuple(v for v in both if low <= v <= high)


def frame_text(chart: RingFrames, k: int) -> str:
    """Time and caption of a moment."""
    time = f"{chart.time[k]:.2f}".replace("-", "\N{MINUS SIGN}")
    return ", ".join(filter(None, (f"{time} {chart.time_unit}", chart.captions[k])))
