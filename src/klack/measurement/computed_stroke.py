"""A computed stroke as the same bench would have recorded it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError
from klack.measurement.lift_sensor import sense
from klack.measurement.sensor import LiftSensor
from klack.measurement.trigger import Trigger

__all__ = ["recorded_stroke", "trigger_instant"]

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
    time : array, shape (n,) [s]
        Uniform; before it the valve is at rest.
    channels : mapping of str to array, shape (n,)
        By role, SI; the lift as it truly is.
    grid : array, shape (k,) [s]
        From the trigger.
    sensor : LiftSensor
        Its resolution is left out: rounding averages out over strokes, and has no slope.
    trigger : Trigger or None
        None: the time of the computation is that of the record.
    zeroed : bool
        True if the lift before the trigger is set to zero.

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

    A recorder joins two samples by a straight line; where the channel bends, that crosses the level
    a little aside, 0.1 us for a current that is sampled every 2.5 us.  The same is done here, and
    averaged over where the samples may lie.

    Parameters
    ----------
    time, values : array, shape (n,) [s], [SI]
    trigger : Trigger
    step : float [s]
        Between two samples of the recorder.
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
            f"The computed {trigger.channel} never crosses the trigger level of {level:.4g} "
            f"(it runs from {values.min():.4g} to {values.max():.4g}, SI).\n"
            "Try: the level of measurement.trigger, and bounds that keep the valve opening."
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
