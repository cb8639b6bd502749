r"""How prominent an impulsive sound is: the objective method of ISO/PAS 1996-3.

The squared A-weighted pressure is averaged with the time constant :math:`\tau` = 125 ms,

.. math:: L(t) = 10 \lg \frac{1}{p_0^2 \tau} \int_{-\infty}^t p_A^2(s)\, e^{-(t - s)/\tau} ds .

In steps of 20 ms a rise of more than 10 dB/s is an *onset*; from its start to its end the level
rises by *LD* [dB] with the slope *OR* [dB/s] (least squares), which gives prominence and adjustment

.. math:: P = 3 \lg OR + 2 \lg LD, \qquad K_I = \max(0,\ 1.8\,(P - 5))\ \text{dB} .

The onset with the highest P counts.  ISO/PAS 1996-3:2022 allows steps of 10 to 25 ms.  A click is
shorter than any of them: its slope is LD over the step, and the choice is worth 1.2 in P.
"""

from dataclasses import dataclass
from math import log10

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.signal_statistics import PRESSURE_REFERENCE, fast_square, weighted
from klack.errors import require_positive
from klack.signals.sampled import TimeSeries

__all__ = [
    "LEVEL_STEP",
    "Prominence",
    "impulsive_prominence",
    "prominence_of_levels",
]

LEVEL_STEP = 0.02
"""Steps in which the level is read [s]."""
_LEAST_SLOPE = 10.0  # dB/s
_GAP = 0.05  # s; onsets that follow each other within it may be one
_SILENCE = -200.0  # dB, of a level that there is none of


@dataclass(frozen=True, slots=True, kw_only=True)
class Prominence:
    """Most prominent onset of a sound.

    Parameters
    ----------
    prominence [-]
        P; nan where nothing rises by more than 10 dB/s.
    adjustment [dB]
        K_I, of the equivalent level.  Above 5 dB the source is called highly impulsive, above 9 dB
        the formula is beyond its usual range.
    level_difference [dB]
    onset_rate [dB/s]
    """

    prominence: float
    adjustment: float
    level_difference: float
    onset_rate: float


def impulsive_prominence(pattern: TimeSeries, background: float | None = None) -> Prominence:
    """Prominence of a sound that repeats.

    The steps lie so that the level is read where it is highest, from where it has its highest
    onset.

    Parameters
    ----------
    pattern [Pa]
        Whole periods of it, without weighting.
    background [dB re 20 uPa]
        A-weighted level of steady noise besides.  Without one a click stands out from what is left
        of the one before.
    """
    square = fast_square(weighted(pattern, "A"), periodic=True)
    step = max(round(LEVEL_STEP / pattern.step), 1)
    ahead = int(np.argmax(square))
    periods = -(-2 * square.size // step) * step  # two of them, in whole steps
    at = ahead + step + np.arange(-periods, 1, step)
    ratio = square[(at - step) % square.size] / PRESSURE_REFERENCE**2
    if background is not None:
        ratio = ratio + 10.0 ** (0.1 * background)
    floor = 10.0 ** (0.1 * _SILENCE)
    return prominence_of_levels(10.0 * np.log10(np.maximum(ratio, floor)), step * pattern.step)


def prominence_of_levels(levels: NDArray[np.float64], step: float) -> Prominence:
    """Most prominent onset of levels with the weightings A and F.

    Parameters
    ----------
    levels (n,) [dB]
    step [s]
        Between two of them.
    """
    require_positive("prominence_of_levels: step", step, "s")
    found = [_onset(levels[first : last + 1], step) for first, last in _onsets(levels, step)]
    nothing = Prominence(
        prominence=float("nan"), adjustment=0.0, level_difference=0.0, onset_rate=0.0
    )
    return max(found, key=lambda onset: onset.prominence, default=nothing)


def _onsets(levels: NDArray[np.float64], step: float) -> list[tuple[int, int]]:
    """First and last level of every onset; a short pause in a rise does not part it."""
    rising = np.concatenate(([False], np.diff(levels) > _LEAST_SLOPE * step, [False]))
    edges = np.flatnonzero(rising[1:] != rising[:-1])
    found: list[tuple[int, int]] = []
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found:
            start, end = found[-1]
            near = (first - end) * step <= _GAP * (1.0 + 1e-9)
            least = _LEAST_SLOPE * step
            up = levels[last] - levels[end] > least * (last - end)
            if near and up and levels[first] - levels[start] > least * (first - start):
                found[-1] = (start, last)
                continue
        found.append((first, last))
    return found


def _onset(levels: NDArray[np.float64], step: float) -> Prominence:
    difference = float(levels[-1] - levels[0])
    rate = float(np.polyfit(step * np.arange(levels.size), levels, 1)[0])
    prominence = 3.0 * log10(rate) + 2.0 * log10(difference)
    return Prominence(
        prominence=prominence,
        adjustment=max(0.0, 1.8 * (prominence - 5.0)),
        level_difference=difference,
        onset_rate=rate,
    )
