"""Which turns of a lift are impacts."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.stop_levels import SmoothLift
from klack.measurement.stroke_measures import Stop

__all__ = ["Touch", "find_touches"]

_NEAR = 0.12  # of the span: an impact turns at most this far from its stop
_SHARPER = 2.0  # an impact bends the motion at least that much more than its flight does
_COMES = 3.0  # least heights from which a first approach must come
_LARGE = 0.2  # of the span: smaller turns are not asked for their sharpness


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One impact, roughly.

    Parameters
    ----------
    stop : "opening" or "seat"
    index : int
        Sample of the turn, or of the arrival if it does not turn.
    rebounds : bool
        Whether a rebound above the noise follows.
    """

    stop: Stop
    index: int
    rebounds: bool


def find_touches(smooth: SmoothLift, levels: Mapping[Stop, float]) -> tuple[Touch, ...]:
    """Impacts on the given stops, in order of time.

    An impact is a turn of the lift near a stop and away from it, higher than
    ``smooth.least_height`` on both sides; or an arrival after which nothing more is seen.  A turn
    in free flight (the top of a bounce that comes near the other stop) bends no sharper than the
    flight beside it and is not counted.

    Parameters
    ----------
    smooth : SmoothLift
    levels : mapping of stop to float [m]
        Of the stops that exist.
    """
    touches: list[Touch] = []
    span = float(np.ptp(smooth.lift))
    for stop, level in levels.items():
        away = (smooth.lift - level) * (1.0 if stop == "seat" else -1.0)
        turns = _turns(away, smooth, span)
        touches.extend(Touch(stop=stop, index=i, rebounds=True) for i in turns)
        touches.extend(
            Touch(stop=stop, index=i, rebounds=False)
            for i in _arrivals(away, smooth, span)
            if not any(abs(i - k) <= 3 * smooth.half for k in turns)
        )
    return tuple(sorted(touches, key=lambda touch: touch.index))


def _turns(away: NDArray[np.float64], smooth: SmoothLift, span: float) -> list[int]:
    """Samples at which a distance from a stop is least, near the stop."""
    inner = away[smooth.half : away.size - smooth.half]  # its smoothed ends are noisy
    peaks, found = scipy.signal.find_peaks(-inner, prominence=smooth.least_height)
    peaks = peaks + smooth.half
    near = max(_NEAR * span, 2.0 * smooth.least_height)
    out = []
    for peak, prominence in zip(peaks.tolist(), found["prominences"].tolist(), strict=True):
        if away[peak] > near:
            continue
        if float(np.max(away[smooth.half : peak], initial=0.0)) < _COMES * smooth.least_height:
            continue  # it has not left this stop yet
        if prominence > _LARGE * span and not _sharp(away, peak, smooth.half):
            continue
        out.append(peak)
    return out


def _sharp(away: NDArray[np.float64], peak: int, half: int) -> bool:
    """Whether the motion bends more in a turn than beside it, over windows of one width."""
    w = 2 * half

    def bend(middle: int) -> float:
        if middle - w < 0 or middle + w >= away.size:
            return float("nan")
        return float(away[middle - w] - 2.0 * away[middle] + away[middle + w])

    beside = np.array([bend(peak - 2 * w), bend(peak + 2 * w)])
    beside = beside[np.isfinite(beside)]
    if not beside.size:
        return True
    return abs(bend(peak)) > _SHARPER * float(np.min(np.abs(beside)))


def _arrivals(away: NDArray[np.float64], smooth: SmoothLift, span: float) -> list[int]:
    """Samples at which the needle arrives from a distance and stays."""
    here = max(smooth.least_height, 0.01 * span)
    far = 2.0 * here
    out: list[int] = []
    coming = False
    inside = (away < here) | (away > far)
    inside[: smooth.half] = False  # the smoothed ends of a record are several times as noisy
    inside[away.size - smooth.half :] = False
    for i in np.flatnonzero(inside).tolist():
        if away[i] > far:
            coming = True
        elif coming:
            out.append(i)
            coming = False
    return out
