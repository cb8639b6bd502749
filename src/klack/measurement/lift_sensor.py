r"""Output of a lift sensor for a motion, and its inverse for smooth ones.

An inductive sensor follows the tip through a low pass,

.. math:: D(\tau_0 s)\, y = x, \qquad D(s) = 1 + s \quad\text{or a Butterworth polynomial},
          \quad \tau_0 = 1 / (2 \pi f_b),

3 dB down at the bandwidth ``f_b`` (Butterworth 1930). It shows ``sensitivity * y + offset``,
rounded to its resolution.
"""

from collections.abc import Mapping
from math import pi

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import ConvergenceError
from klack.measurement.channels import LiftSensor, Trigger
from klack.measurement.time_base import uniform_step
from klack.signals.low_pass import low_passed

__all__ = [
    "recorded_stroke",
    "sense",
    "sensor_poles",
    "sensor_polynomial",
    "trigger_instant",
]


def sense(
    time: NDArray[np.float64], lift: NDArray[np.float64], sensor: LiftSensor
) -> NDArray[np.float64]:
    """Lift as the sensor shows it [m], of the shape of ``lift``.

    The low pass is exact for motions straight between samples, at any step
    (:mod:`klack.signals.low_pass`); before the first sample the valve is at rest.

    Parameters
    ----------
    time (n,) [s]
        Uniform.
    lift (n,) or (strokes, n) [m]
        True, at the sensor.
    """
    step = uniform_step(time, "sense: time")
    shown = np.asarray(lift, dtype=np.float64)
    if sensor.bandwidth is not None:
        shown = low_passed(shown, sensor_poles(sensor), step)
    shown = sensor.sensitivity * shown + sensor.offset
    if sensor.resolution > 0.0:
        shown = sensor.resolution * np.round(shown / sensor.resolution)
    return np.asarray(shown)


def sensor_poles(sensor: LiftSensor) -> NDArray[np.complex128]:
    """Poles of the low pass [1/s], shape (order,); none without a bandwidth.

    After a sharp event the sensor deviates by ``sum_i C_i exp(p_i t)``.
    """
    if sensor.bandwidth is None:
        return np.empty(0, dtype=np.complex128)
    _, denominator = scipy.signal.butter(sensor.order, 2.0 * pi * sensor.bandwidth, analog=True)
    return np.asarray(np.roots(denominator), dtype=np.complex128)


def sensor_polynomial(sensor: LiftSensor) -> NDArray[np.float64]:
    """Coefficients ``d_i`` [s^i] of ``x = d_0 y + d_1 y' + d_2 y'' + ...``, shape (order + 1,).

    Exact for polynomials.
    """
    if sensor.bandwidth is None:
        return np.ones(1)
    _, denominator = scipy.signal.butter(sensor.order, 2.0 * pi * sensor.bandwidth, analog=True)
    ascending = np.asarray(denominator[::-1], dtype=np.float64)
    return np.asarray(ascending / ascending[0])


Vector = NDArray[np.float64]

_PHASES = 32


def recorded_stroke(
    time: Vector,
    channels: Mapping[str, Vector],
    grid: Vector,
    *,
    sensor: LiftSensor,
    trigger: Trigger | None,
    zeroed: bool,
) -> dict[str, Vector]:
    """Apply sensor, trigger and zero to a computed stroke, on the time axis of a set.

    Parameters
    ----------
    time (n,) [s]
        Uniform; before it the valve is at rest.
    channels (n,)
        By role, SI; true lift.
    grid (k,) [s]
        From the trigger.
    sensor
        Without resolution: rounding averages out over strokes, and has no slope.
    trigger
        None: the time of the computation is that of the record.
    zeroed
        Set the lift before the trigger to zero.

    Raises
    ------
    ConvergenceError
        If the stroke never triggers.
    """
    shown = dict(channels)
    if "lift" in shown:
        exact = sensor.model_copy(update={"resolution": 0.0})
        shown["lift"] = sense(time, shown["lift"], exact)
    step = float(grid[1] - grid[0])
    begin = 0.0 if trigger is None else trigger_instant(time, shown[trigger.channel], trigger, step)
    result = {role: np.interp(grid, time - begin, values) for role, values in shown.items()}
    before = grid < 0.0
    if zeroed and "lift" in result and before.any():
        result["lift"] = result["lift"] - np.median(result["lift"][before])
    return result


def trigger_instant(time: Vector, values: Vector, trigger: Trigger, step: float) -> float:
    """First instant at which a recorder finds the crossing of a trigger level [s].

    A recorder joins samples by straight lines, which cross the level of a bent channel a little
    aside: 0.1 us for a current sampled every 2.5 us. The same is done here, averaged over where
    the samples may lie.

    Parameters
    ----------
    time, values (n,) [s], [SI]
    step [s]
        Of the recorder.
    """
    sign = 1.0 if trigger.slope == "rising" else -1.0
    level = trigger.value
    if level is None:
        rest = float(values[0])
        far = float(values[np.argmax(sign * (values - rest))])
        level = rest + trigger.share_of_way * (far - rest)
    above = sign * (values - level) >= 0.0
    crossings = np.flatnonzero(above[1:] & ~above[:-1])
    if not crossings.size:
        raise ConvergenceError(
            f"The computed {trigger.channel} never crosses the trigger level of {level:.4g} (its "
            f"range is {values.min():.4g} to {values.max():.4g}, SI).\n"
            "Try: the level of measurement.trigger, and bounds within which the valve opens."
        )
    i = int(crossings[0])
    share = (level - values[i]) / (values[i + 1] - values[i])
    exact = time[i] + share * (time[i + 1] - time[i])
    first = exact - step * (np.arange(_PHASES) + 0.5) / _PHASES
    low, high = np.interp(first, time, values), np.interp(first + step, time, values)
    crosses = sign * (high - level) > sign * (low - level)
    shares = np.where(crosses, (level - low) / np.where(crosses, high - low, 1.0), np.nan)
    found = (first + step * shares)[crosses & (shares >= 0.0) & (shares <= 1.0)]
    return float(found.mean()) if found.size else float(exact)
