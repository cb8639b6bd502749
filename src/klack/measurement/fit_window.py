"""Which samples of a stroke are fitted, and how much each counts.

Later bounces magnify differences between strokes until they say nothing about the valve; free
flight and first impacts are repeatable. The windows follow from the *measured* impacts and stay
while the parameters move.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["FitWindow", "fit_windows", "sample_weights", "touch_shifts", "window_taper"]

Vector = NDArray[np.float64]

_GUARD = 3.0
"""Standard deviations of the impact time between a window and it."""
_LEAST_GUARD = 5e-6  # [s]
_LEAD = 0.1e-3  # [s] of rest before the needle leaves the opening stop
_APPROACH = 40e-6  # [s]
_LEFT = 0.03
"""Share of the lift by which the needle has left its stop."""
_TAPER = 20e-6  # [s]
_FLOOR = 1e-3
"""Error of any model over the range: limits the weight of noiseless data."""
_SMOOTHED = 15e-6  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitWindow:
    """One stretch of time that is fitted.

    Parameters
    ----------
    first, last [s]
        From the trigger.
    what
        In words.
    """

    first: float
    last: float
    what: str


def fit_windows(
    time: Vector,
    strokes: NDArray[np.float64],
    impacts: Mapping[str, Sequence[float]],
    count: int = 1,
) -> tuple[FitWindow, ...]:
    """Windows up to the impact after the last fitted one, on each stop.

    Parameters
    ----------
    time (k,) [s]
    strokes (n, k) [m]
        Lift.
    impacts [s]
        Of the mean stroke, on "opening" and "seat".
    count
        Fitted impacts on each stop.
    """
    mean = strokes.mean(axis=0)
    start, end = float(time[0]), float(time[-1])
    opening = list(impacts.get("opening", ()))
    # what noise of the resting needle looks like an impact is none
    seat = [instant for instant in impacts.get("seat", ()) if not opening or instant > opening[0]]
    plural = "impact" if count == 1 else f"{count} impacts"

    def flight_end(times: Sequence[float], otherwise: float) -> float:
        if len(times) <= count:
            return otherwise
        scatter = float(np.std(touch_shifts(time, strokes, times[count])))
        return times[count] - max(_GUARD * scatter, _LEAST_GUARD)

    if not opening and not seat:
        return (FitWindow(first=start, last=end, what="whole record"),)
    if not opening:
        return (
            FitWindow(
                first=start, last=flight_end(seat, end), what=f"stroke, {plural} on the seat"
            ),
        )
    release = _release(time, mean, opening[0], seat[0]) if seat else end
    last = flight_end(opening, release)
    windows = [FitWindow(first=start, last=last, what=f"opening, {plural}, flight after it")]
    if seat:
        windows.append(
            FitWindow(
                first=max(release, last),
                last=flight_end(seat, end),
                what=f"closing, {plural}, flight after it",
            )
        )
    return tuple(windows)


def touch_shifts(time: Vector, strokes: NDArray[np.float64], instant: float) -> Vector:
    r"""By how much each stroke touches later than the mean stroke, shape (n,) [s].

    .. math:: \delta t_s = -\frac{\int v\, (y_s - \bar y)\, dt}{\int v^2 dt}

    over the 40 us before the mean touch, with the speed *v* of the mean stroke.

    Parameters
    ----------
    time (k,) [s]
    strokes (n, k) [m]
    instant [s]
        Of the mean stroke.
    """
    near = (time > instant - _APPROACH) & (time <= instant)
    if near.sum() < 2:
        return np.zeros(strokes.shape[0])
    mean = strokes.mean(axis=0)
    v = np.gradient(mean, time)[near]
    return np.asarray(-((strokes - mean)[:, near] @ v) / max(float(v @ v), 1e-30))


def window_taper(time: Vector, windows: Sequence[FitWindow]) -> Vector:
    """Weight of each sample, shape (n,): 1 inside, falling to 0 towards the end.

    So an impact of the model at the end fades in.
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

    Near impacts and in late flights, where strokes differ most, samples count least. The variance
    between strokes is averaged over 15 us; ``Delta`` is the range of the mean stroke.

    Parameters
    ----------
    strokes (n, m)
        One channel.
    step [s]
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


def _release(time: Vector, lift: Vector, opening: float, seat: float) -> float:
    """Start of the closing window: some rest before the needle leaves the stop."""
    between = (time > opening) & (time < seat)
    if not between.any():
        return seat
    last = time[between]
    late = last > 0.5 * (last[0] + last[-1])
    level, rest = float(np.median(lift[between][late])), float(lift[0])
    high = np.flatnonzero(lift[between] > level - _LEFT * (level - rest))
    left = float(last[high[-1]]) if high.size else float(last[0])
    return max(left - _LEAD, float(last[0]))
