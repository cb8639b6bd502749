"""Measurement of a valve: channels, start of a stroke, sensor."""

from typing import Literal

from pydantic import Field

from klack.input.section import Section
from klack.measurement.channels import Channels
from klack.measurement.sensor import LiftSensor
from klack.measurement.trigger import Trigger
from klack.units import Frequency, Time

__all__ = ["CaseMeasurement"]


class CaseMeasurement(Section):
    """Channels, trigger and sensor of recordings of this valve."""

    channels: Channels = Field(
        default_factory=dict,
        description="Names of the channels by quantity (lift, velocity, current, voltage, "
        "pressure, acceleration, force); others are found by name and unit.",
    )
    time_step: Time | None = Field(
        default=None, gt=0, description="Sampling step of files that have no time."
    )
    trigger: Trigger | None = Field(
        default=None,
        description="Cuts recordings into strokes; default: each recording is one stroke.",
    )
    zero: Literal["start", "none"] = Field(
        default="start",
        description="start: lift before the trigger is the closed valve, and set to zero; none: "
        "the lift stays as it was measured.",
    )
    sensor: LiftSensor = Field(default=LiftSensor(), description="Sensor of the lift.")
    velocity_bandwidth: Frequency | None = Field(
        default=None,
        gt=0,
        description="Bandwidth of the velocity from the lift; default chosen by its noise.",
    )
