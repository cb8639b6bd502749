"""Measurements of the valve, and what is calibrated by them."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, field_validator

from klack.case.study import Written
from klack.input.section import Count, Name, Section, Text
from klack.measurement.channels import Channels, LiftSensor, Trigger
from klack.units import Frequency, Time

__all__ = ["CalibrationParameter", "CaseCalibration", "CaseMeasurement"]


class CaseMeasurement(Section):
    """Channels, trigger and sensor of recordings of this valve."""

    channels: Channels = Field(
        default_factory=dict,
        description="Names of the channels by quantity (lift, velocity, current, voltage, "
        "pressure, acceleration, force); others are found by name and unit.",
    )
    time_step: Time | None = Field(
        default=None, gt=0, description="Sampling step of files without a time channel."
    )
    trigger: Trigger | None = Field(
        default=None,
        description="Cuts recordings into strokes; default: each recording is one stroke.",
    )
    zero: Literal["start", "none"] = Field(
        default="start",
        description="start: the lift before the trigger is that of the closed valve and is set "
        "to zero; none: the lift stays as measured.",
    )
    sensor: LiftSensor = Field(default=LiftSensor(), description="Sensor of the lift.")
    velocity_bandwidth: Frequency | None = Field(
        default=None,
        gt=0,
        description="Bandwidth of the velocity from the lift; default: chosen by its noise.",
    )


class CalibrationParameter(Section):
    """One fitted number, and its keys in the case.

    Its value in the case is where the search begins.
    """

    key: tuple[Text, ...] = Field(
        min_length=1,
        description="Path of the key in the case, e.g. network.components.spring.preload; a "
        "list of paths shares one value.",
    )
    lower: Written = Field(description="Lower bound, with the unit of the key.")
    upper: Written = Field(description="Upper bound.")

    @field_validator("key", mode="before")
    @classmethod
    def _one_key(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value


class CaseCalibration(Section):
    """Parameters that are fitted to measured strokes."""

    variant: Literal["wet", "dry"] = Field(
        default="wet", description="State of the measured valve: with its fluid, or dry."
    )
    parameters: Mapping[Name, CalibrationParameter] = Field(
        min_length=1, description="name: a fitted key of the case, and its bounds."
    )
    profile: tuple[Name, ...] = Field(
        default=(),
        description="Parameters whose profile likelihood is computed: an interval without the "
        "assumption that the model is linear.",
    )
    impacts: Count = Field(
        default=1,
        le=20,
        description="Impacts on each stop that are fitted, with the flights before and after.",
    )
    channels: tuple[Literal["lift", "current"], ...] = Field(
        default=("lift",), min_length=1, description="Fitted channels: lift, current."
    )
