"""Rest levels of the needle, and the least motion above the noise."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.differentiation import VelocityEstimate, velocity_of
from klack.measurement.stroke_measures import Stop

__all__ = ["SmoothLift", "StopLevels", "Touch", "find_levels", "find_touches", "smooth_lift"]


_LEAST_SMOOTHING = 20e-6  # [s] window that averages the vibration of the needle out
_MOST_SMOOTHING = 50e-6  # [s] flights shorter than this are not told apart anyway
_REST_SPEED = 0.03  # of the fastest motion
_REST_TIME = 25e-6  # [s]
_NEAR = 0.12  # of the span: rests farther from its ends are turning points
_NOISE = 5.0  # standard deviations of the smoothed lift
_LEAST_SHARE = 0.01  # of the span


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothLift:
    """Lift and velocity for finding events; measures are fitted to the raw lift.

    Parameters
    ----------
    lift, velocity (n,) [m], [m/s]
    noise [m]
        Of one raw sample, white.
    lift_noise, velocity_noise [m], [m/s]
        Standard deviations left.
    half
        Half window [samples].
    least_height [m]
        Motion below it may be noise or vibration.
    """

    lift: NDArray[np.float64]
    velocity: NDArray[np.float64]
    noise: float
    lift_noise: float
    velocity_noise: float
    half: int
    least_height: float


@dataclass(frozen=True, kw_only=True)
class StopLevels:
    """Levels of rest [m]; nan where the needle never rests."""

    seat: float
    opening: float
    seat_se: float
    opening_se: float


def smooth_lift(time: NDArray[np.float64], lift: NDArray[np.float64]) -> SmoothLift:
    """Lift smoothed by cubic windows as wide as the noise demands, at least 20 us."""
    step = float(time[-1] - time[0]) / (time.size - 1)
    chosen: VelocityEstimate = velocity_of(time, lift)
    narrow = max(2, round(0.5 * _LEAST_SMOOTHING / step))
    wide = max(narrow, round(0.5 * _MOST_SMOOTHING / step))
    half = min(max(chosen.window // 2, narrow), wide, (time.size - 1) // 2)
    window = 2 * half + 1
    smooth = scipy.signal.savgol_filter(lift, window, 3)
    shake = chosen.lift_noise * float(np.sqrt(np.sum(scipy.signal.savgol_coeffs(window, 3) ** 2)))
    rate = scipy.signal.savgol_coeffs(window, 3, deriv=1, delta=step)
    return SmoothLift(
        lift=smooth,
        velocity=scipy.signal.savgol_filter(lift, window, 3, deriv=1, delta=step),
        noise=chosen.lift_noise,
        lift_noise=shake,
        velocity_noise=chosen.lift_noise * float(np.sqrt(np.sum(rate**2))),
        half=half,
        least_height=max(_NOISE * shake, _LEAST_SHARE * float(np.ptp(smooth))),
    )


def find_levels(
    time: NDArray[np.float64], lift: NDArray[np.float64], smooth: SmoothLift
) -> StopLevels:
    """Levels of rest at both ends of the motion: medians over half a rest.

    The needle rests where its speed is below 3 % of the fastest (and within its noise) for 25 us,
    within 12 % of the span from an end; not where its speed runs evenly from bound to bound, as in
    a turning point.
    """
    step = float(time[-1] - time[0]) / (time.size - 1)
    low, high = np.quantile(smooth.lift, (0.002, 0.998))
    speed = max(4.0 * smooth.velocity_noise, _REST_SPEED * float(np.max(np.abs(smooth.velocity))))
    still = np.abs(smooth.velocity) < speed
    runs = [
        run
        for run in _runs(still, max(3, round(_REST_TIME / step)))
        if not _turns(smooth.velocity[run[0] : run[1]], speed)
    ]
    runs.extend(_first_rest(lift, smooth.noise, max(8, round(_REST_TIME / step))))
    near = _NEAR * (high - low)
    seat = [run for run in runs if _level(lift, run) < low + near]
    opening = [run for run in runs if _level(lift, run) > high - near]
    return StopLevels(
        seat=_longest(lift, seat),
        opening=_longest(lift, opening),
        seat_se=_error(smooth.noise, seat),
        opening_se=_error(smooth.noise, opening),
    )


def _runs(mask: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [(a, b) for a, b in zip(starts.tolist(), ends.tolist(), strict=True) if b - a >= least]


def _first_rest(lift: NDArray[np.float64], noise: float, least: int) -> list[tuple[int, int]]:
    """First samples within the noise, if enough."""
    level = float(np.median(lift[:least]))
    beyond = np.flatnonzero(np.abs(lift - level) > _NOISE * noise)
    count = int(beyond[0]) if beyond.size else lift.size
    return [(0, count)] if count >= least else []


def _turns(velocity: NDArray[np.float64], speed: float) -> bool:
    k = np.arange(velocity.size) - 0.5 * (velocity.size - 1)
    change = float(k @ velocity) / float(k @ k) * velocity.size
    return abs(change) > speed


def _level(lift: NDArray[np.float64], run: tuple[int, int]) -> float:
    return float(np.median(lift[run[0] : run[1]]))


def _settled(run: tuple[int, int]) -> tuple[int, int]:
    """Half of a rest: away from motion and last small bounces."""
    middle = (run[0] + run[1]) // 2
    return (0, middle) if run[0] == 0 else (middle, run[1])


def _longest(lift: NDArray[np.float64], runs: list[tuple[int, int]]) -> float:
    if not runs:
        return float("nan")
    return _level(lift, _settled(max(runs, key=lambda run: run[1] - run[0])))


def _error(noise: float, runs: list[tuple[int, int]]) -> float:
    if not runs:
        return float("nan")
    return 1.2533 * noise / float(np.sqrt(max((b - a) // 2 for a, b in runs)))


_SHARPER = 2.0  # an impact bends the motion at least that much more than its flight does
_COMES = 3.0  # least heights from which a first approach must come
_LARGE = 0.2  # of the span: smaller turns are not asked for their sharpness


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One impact, roughly.

    Parameters
    ----------
    index
        Of the turn, or of the arrival.
    rebounds
        Above the noise.
    """

    stop: Stop
    index: int
    rebounds: bool


def find_touches(smooth: SmoothLift, levels: Mapping[Stop, float]) -> tuple[Touch, ...]:
    """Impacts on the given stops [m], in order of time.

    An impact is a turn of the lift near a stop, higher than ``smooth.least_height`` on both sides,
    or an arrival after which nothing more is seen. A turn in free flight (the top of a bounce near
    the other stop) bends no sharper than the flight beside it and does not count.
    """
    touches: list[Touch] = []
    span = float(np.ptp(smooth.lift))
    for stop, level in levels.items():
        away = (smooth.lift - level) * (1.0 if stop == "seat" else -1.0)
        turns = _touching_turns(away, smooth, span)
        touches.extend(Touch(stop=stop, index=i, rebounds=True) for i in turns)
        touches.extend(
            Touch(stop=stop, index=i, rebounds=False)
            for i in _arrivals(away, smooth, span)
            if not any(abs(i - k) <= 3 * smooth.half for k in turns)
        )
    return tuple(sorted(touches, key=lambda touch: touch.index))


def _touching_turns(away: NDArray[np.float64], smooth: SmoothLift, span: float) -> list[int]:
    """Samples of least distance from a stop, near it."""
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
    """Whether the motion bends more in a turn than beside it."""
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
    """Samples at which the needle arrives and stays."""
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
