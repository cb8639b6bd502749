"""Rest levels of the needle, and the least motion above the noise."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.differentiation import VelocityEstimate, velocity_of

__all__ = ["SmoothLift", "StopLevels", "find_levels", "smooth_lift"]

_LEAST_SMOOTHING = 20e-6  # [s] window that averages the vibration of the needle out
_MOST_SMOOTHING = 50e-6  # [s] flights shorter than this are not told apart anyway
_REST_SPEED = 0.03  # of the fastest motion
_REST_TIME = 25e-6  # [s]
_NEAR = 0.12  # of the span: rests farther from its ends are turning points
_NOISE = 5.0  # standard deviations of the smoothed lift
_LEAST_SHARE = 0.01  # of the span


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothLift:
    """Lift and velocity from which events are found; numbers are fitted to the raw lift.

    Parameters
    ----------
    lift, velocity : array, shape (n,) [m], [m/s]
    noise : float [m]
        White noise of one raw sample.
    lift_noise, velocity_noise : float [m], [m/s]
        Standard deviation that is left in the smoothed ones.
    half : int
        Half window [samples].
    least_height : float [m]
        Motion below this is not told from noise or from vibration.
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
    """Levels of rest; nan where the needle never rests.

    Parameters
    ----------
    seat, opening : float [m]
    seat_se, opening_se : float [m]
    """

    seat: float
    opening: float
    seat_se: float
    opening_se: float


def smooth_lift(time: NDArray[np.float64], lift: NDArray[np.float64]) -> SmoothLift:
    """Lift as cubic windows smooth it: as wide as the noise demands, at least 20 us."""
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
    """Levels of rest at the lower and upper end of the motion: medians over half a rest.

    The needle rests where its speed stays below 3 % of the fastest motion (and within its noise)
    for 25 us, at most 12 % of the span away from the ends of the motion; not where its speed runs
    evenly from one bound to the other, as in a turning point.
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
    """Samples from the start of a record that lie within its noise, if there are enough."""
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
    """Half of a rest: away from the motion, and from the last small bounces."""
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
