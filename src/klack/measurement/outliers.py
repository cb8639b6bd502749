"""Strokes that cannot be used, each with its reason.

Only what is beyond doubt is discarded: scatter from shot to shot is the matter to be measured.

========== ==================================================================================
no motion  lift moves by less than 20 % of the median way
clipped    ten samples or more stay at the largest or smallest value, while the median stroke
           exceeds it by five standard deviations of the noise
noise      more than 3 times the median noise of the set
shape      RMS distance from the median stroke above 4 times the median distance, and above it by
           6 standard deviations (from the median absolute deviation); 6 strokes or more
========== ==================================================================================
"""

import numpy as np
from numpy.typing import NDArray

from klack.measurement.differentiation import noise_floor

__all__ = ["find_outliers"]

Matrix = NDArray[np.float64]

_MOTION = 0.2
_CLIPPED_SAMPLES = 10
_CLIPPED_NOISE = 5.0
_NOISE = 3.0
_DISTANCE, _SPREAD = 4.0, 6.0
_FEWEST = 6


def find_outliers(time: NDArray[np.float64], lift: Matrix) -> dict[int, str]:
    """Reasons by the row of the stroke.

    Parameters
    ----------
    time : array, shape (n,) [s]
    lift : array, shape (strokes, n) [m]
    """
    step = float(time[1] - time[0])
    way = np.quantile(lift, 0.99, axis=1) - np.quantile(lift, 0.01, axis=1)
    noise = np.array([noise_floor(row[None], step)[1] for row in lift])
    out: dict[int, str] = {}
    for k in np.flatnonzero(way < _MOTION * np.median(way)).tolist():
        out[k] = f"no motion: moves by {1e6 * way[k]:.3g} um, the others by "
        out[k] += f"{1e6 * float(np.median(way)):.3g} um"
    good = [k for k in range(len(lift)) if k not in out]
    middle, usual = np.median(lift[good], axis=0), float(np.median(noise[good]))
    for k in good:
        if len(good) > 2 and (reason := _clipped(lift[k], middle, usual)):
            out[k] = reason
        elif len(good) > 2 and noise[k] > _NOISE * usual > 0.0:
            out[k] = f"noise of {1e6 * noise[k]:.3g} um, the others {1e6 * usual:.3g} um"
    good = [k for k in good if k not in out]
    if len(good) >= _FEWEST:
        out.update(_far(lift, good))
    return out


def _clipped(row: Matrix, middle: Matrix, noise: float) -> str:
    for sign, word in ((1.0, "highest"), (-1.0, "lowest")):
        limit = float(np.max(sign * row))
        stays = sign * row == limit
        missed = stays & (sign * middle > limit + _CLIPPED_NOISE * noise)
        if _longest_run(stays & missed) >= _CLIPPED_SAMPLES:
            return f"clipped: stays at its {word} value of {sign * limit * 1e6:.4g} um"
    return ""


def _longest_run(mask: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _far(lift: Matrix, good: list[int]) -> dict[int, str]:
    middle = np.median(lift[good], axis=0)
    distance = np.sqrt(np.mean((lift[good] - middle) ** 2, axis=1))
    usual = float(np.median(distance))
    spread = 1.4826 * float(np.median(np.abs(distance - usual)))
    limit = max(_DISTANCE * usual, usual + _SPREAD * spread)
    return {
        k: f"shape: {1e6 * d:.3g} um (RMS) from the median stroke, the others {1e6 * usual:.3g} um"
        for k, d in zip(good, distance.tolist(), strict=True)
        if d > limit
    }
