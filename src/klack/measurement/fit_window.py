"""Which samples of a stroke are fitted, and how much each counts.

Later bounces magnify every difference between strokes until they say nothing about the valve; free
flight and first impacts are repeatable.  The windows follow from the impacts of the *measured*
strokes and stay as they are while the parameters move.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["FitWindow", "fit_windows", "sample_weights", "window_taper"]

Vector = NDArray[np.float64]

_GUARD = 3.0
"""Standard deviations of the impact time that a window ends before it."""
_LEAST_GUARD = 5e-6  # [s]
_LEAD = 0.1e-3  # [s] of rest before the needle leaves the opening stop
_LEFT = 0.03
"""Share of the lift by which the needle has left its stop."""
_TAPER = 20e-6  # [s]
_FLOOR = 1e-3
"""Error of any model, as a share of the range of a channel: keeps noiseless data from ruling."""
_SMOOTHED = 15e-6  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitWindow:
    """One stretch of time that is fitted.

    Parameters
    ----------
    first, last : float [s]
        From the trigger.
    what : str
        In words.
    """

    first: float
    last: float
    what: str


def fit_windows(
    time: Vector,
    lift: Vector,
    impacts: Mapping[str, Sequence[Sequence[float]]],
    count: int = 1,
) -> tuple[FitWindow, ...]:
    """Windows up to the impact after the last one that is fitted, on each stop.

    Parameters
    ----------
    time : array, shape (n,) [s]
    lift : array, shape (n,) [m]
        Mean stroke.
    impacts : mapping of "opening" and "seat" to impact times [s], stroke by stroke
    count : int
        Impacts on each stop that are fitted.
    """
    end = float(time[-1])
    opening = _times(impacts.get("opening", ()))
    seat = _times(impacts.get("seat", ()))
    if opening:
        seat = [item for item in seat if item[0] > opening[0][0]]
    plural = "impact" if count == 1 else f"{count} impacts"
    windows = []
    if opening:
        last = _before(opening, count, end if not seat else _release(time, lift, opening, seat))
        windows.append(
            FitWindow(first=float(time[0]), last=last, what=f"opening, {plural}, flight after it")
        )
        if seat:
            first = max(_release(time, lift, opening, seat), last)
            last = _before(seat, count, end)
            windows.append(
                FitWindow(first=first, last=last, what=f"closing, {plural}, flight after it")
            )
    elif seat:
        last = _before(seat, count, end)
        windows.append(
            FitWindow(first=float(time[0]), last=last, what=f"stroke, {plural} on the seat")
        )
    else:
        windows.append(FitWindow(first=float(time[0]), last=end, what="whole record"))
    return tuple(windows)


def window_taper(time: Vector, windows: Sequence[FitWindow]) -> Vector:
    """Weight 0 to 1 of each sample, shape (n,): 1 inside, falling to 0 towards the end.

    The end is soft, so that an impact that the model puts there fades in instead of jumping.
    """
    result = np.zeros_like(time)
    for window in windows:
        inside = (time >= window.first) & (time <= window.last)
        soft = min(_TAPER, 0.1 * (window.last - window.first))
        rest = np.clip((window.last - time) / max(soft, 1e-12), 0.0, 1.0)
        result[inside] = np.maximum(result[inside], 0.5 - 0.5 * np.cos(np.pi * rest[inside]))
    return result


def sample_weights(strokes: NDArray[np.float64], step: float) -> Vector:
    r"""Inverse variance of single samples, shape (m,).

    .. math:: 1 / w = \sigma_{noise}^2 + \sigma_{strokes}^2(t) + (10^{-3} \Delta)^2

    Where strokes differ most, near impacts and in late flights, samples count least.  The variance
    between strokes is averaged over 15 us; ``Delta`` is the range of the mean stroke.

    Parameters
    ----------
    strokes : array, shape (n, m)
        One channel.
    step : float [s]
    """
    count, samples = strokes.shape
    second = np.diff(strokes, 2, axis=1)
    noise = float(np.median(np.abs(second))) / (0.6745 * np.sqrt(6.0)) if samples > 2 else 0.0
    mean = strokes.mean(axis=0)
    floor = _FLOOR * float(np.ptp(mean)) or 1e-12
    variance = np.zeros(samples)
    if count > 1:
        width = max(1, min(round(_SMOOTHED / step), samples))
        kernel = np.ones(width)
        spread = strokes.var(axis=0, ddof=1)
        covered = np.convolve(np.ones(samples), kernel, mode="same")
        variance = np.convolve(spread, kernel, mode="same") / covered
    else:
        variance[:] = noise**2
    return np.asarray(1.0 / (np.maximum(variance, noise**2) + floor**2))


def _times(strokes: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """Median time of every impact and its standard deviation, of those that most strokes have."""
    result: list[tuple[float, float]] = []
    longest = max((len(times) for times in strokes), default=0)
    for k in range(longest):
        found = np.array([times[k] for times in strokes if len(times) > k])
        if 2 * found.size <= len(strokes):
            break
        centre = float(np.median(found))
        spread = 1.4826 * float(np.median(np.abs(found - centre)))
        result.append((centre, spread))
    return result


def _before(impacts: Sequence[tuple[float, float]], count: int, otherwise: float) -> float:
    """End of the flight after the impact ``count``."""
    if len(impacts) <= count:
        return otherwise
    time, spread = impacts[count]
    return time - max(_GUARD * spread, _LEAST_GUARD)


def _release(
    time: Vector,
    lift: Vector,
    opening: Sequence[tuple[float, float]],
    seat: Sequence[tuple[float, float]],
) -> float:
    """Start of the closing window: some rest before the needle leaves the opening stop."""
    between = (time > opening[0][0]) & (time < seat[0][0])
    if not between.any():
        return seat[0][0]
    last = time[between]
    late = last > 0.5 * (last[0] + last[-1])
    level, rest = float(np.median(lift[between][late])), float(lift[0])
    high = np.flatnonzero(lift[between] > level - _LEFT * (level - rest))
    left = float(last[high[-1]]) if high.size else float(last[0])
    return max(left - _LEAD, float(last[0]))
