"""The model that is fitted: from scaled parameters to the samples of a stroke that count."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.calibration.motion import Motion, TrialPool
from klack.case.free_parameters import FreeParameter
from klack.measurement.computed_stroke import recorded_stroke
from klack.measurement.sensor import LiftSensor
from klack.measurement.trigger import Trigger

__all__ = ["StrokeModel"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeModel:
    """Computed strokes as the bench would have recorded them.

    Parameters
    ----------
    parameters : tuple of FreeParameter
        All of them, in the order of the fit.
    pool : TrialPool
        Computes motions from those parameters that are not of the sensor.
    sensor : LiftSensor
        Of the case.
    zeroed : bool
        True if the lift before the trigger is set to zero.
    time : array, shape (k,) [s]
        Of the measured strokes.
    channels : tuple of str
        Roles that are fitted.
    counted : bool array, shape (k,)
        Samples that are fitted.
    duration : float [s]
        To compute: up to the last of them.
    """

    parameters: tuple[FreeParameter, ...]
    pool: TrialPool
    sensor: LiftSensor
    trigger: Trigger | None
    zeroed: bool
    time: Vector
    channels: tuple[str, ...]
    counted: NDArray[np.bool_]
    duration: float

    def __call__(self, vectors: Sequence[Vector]) -> list[Vector]:
        """Samples that are fitted, all channels behind each other, for scaled parameters."""
        values = [self.unscaled(z) for z in vectors]
        motions = self.pool.motions([self._of_motion(v) for v in values], self.duration)
        return [
            np.concatenate([self.recorded(m, v)[role][self.counted] for role in self.channels])
            for m, v in zip(motions, values, strict=True)
        ]

    def unscaled(self, z: Vector) -> Vector:
        """Parameters [SI] from scaled ones."""
        return np.array(
            [
                p.lower + share * (p.upper - p.lower)
                for p, share in zip(self.parameters, z, strict=True)
            ]
        )

    def scaled(self, values: Vector) -> Vector:
        """Scaled parameters from those in SI."""
        return np.array(
            [
                (v - p.lower) / (p.upper - p.lower)
                for p, v in zip(self.parameters, values, strict=True)
            ]
        )

    def motion(self, values: Vector, duration: float) -> Motion:
        """Compute one motion for parameters in SI."""
        return self.pool.motions([self._of_motion(values)], duration)[0]

    def recorded(self, motion: Motion, values: Vector) -> Mapping[str, Vector]:
        """Channels on the time axis of the set, for a motion and parameters in SI."""
        return recorded_stroke(
            motion.time,
            {role: trace.astype(np.float64) for role, trace in motion.channels.items()},
            self.time,
            sensor=self.sensor_of(values),
            trigger=self.trigger,
            zeroed=self.zeroed,
        )

    def sensor_of(self, values: Vector) -> LiftSensor:
        """Sensor with its parameters in place."""
        changed = {
            str(place.key[-1]): float(value)
            for parameter, value in zip(self.parameters, values, strict=True)
            for place in parameter.places
            if place.key[0] == "measurement"
        }
        return LiftSensor.model_validate({**dict(self.sensor), **changed})

    def _of_motion(self, values: Vector) -> list[float]:
        return [
            float(value)
            for parameter, value in zip(self.parameters, values, strict=True)
            if not parameter.of_sensor
        ]
