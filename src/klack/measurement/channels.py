"""What channels of a recording measure, and what a case says of sensor and trigger."""

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem
from klack.input.section import Count, Section, Text
from klack.units import (
    ACCELERATION,
    CURRENT,
    FORCE,
    LENGTH,
    PRESSURE,
    SPEED,
    VOLTAGE,
    Frequency,
    Kind,
    Length,
    Ratio,
    Time,
    parse_quantity,
)

__all__ = ["LIFT_ALONE", "ROLES", "ChannelChoice", "Channels", "LiftSensor", "Role", "Trigger"]


Role = Literal["lift", "velocity", "current", "voltage", "pressure", "acceleration", "force"]

ROLES: Mapping[Role, Kind] = {
    "lift": LENGTH,
    "velocity": SPEED,
    "current": CURRENT,
    "voltage": VOLTAGE,
    "pressure": PRESSURE,
    "acceleration": ACCELERATION,
    "force": FORCE,
}
"""Kind of quantity of each role; values are in its SI unit."""

LIFT_ALONE: tuple[Role, ...] = ("lift",)
"""Channels that a comparison needs beside the trigger."""


class ChannelChoice(Section):
    """One channel of a recording, or one per stroke.

    A plain text is its name. With ``*`` and ``?`` it is a pattern; each match is a stroke of its
    own, in the order of the file.
    """

    name: Text = Field(min_length=1, description="Name of the channel, or a pattern with * and ?.")
    unit: Text | None = Field(
        default=None, description="Unit of its values; default that of the file."
    )
    scale: Ratio = Field(
        default=1.0, description="Factor on its values; -1 reverses the direction."
    )

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"name": value} if isinstance(value, str) else value


Channels = Mapping[Role, ChannelChoice]
"""Channels by quantity."""


class LiftSensor(Section):
    """Inductive (or other) lift sensor: low pass, sensitivity, offset, resolution."""

    bandwidth: Frequency | None = Field(
        default=None, gt=0, description="Frequency at which 3 dB are lost; default unlimited."
    )
    order: Count = Field(
        default=1, le=4, description="Order of its low pass (Butterworth above 1)."
    )
    sensitivity: Ratio = Field(
        default=1.0, gt=0, description="Measured change over true change of the lift."
    )
    offset: Length = Field(default=0.0, description="Reading of the closed valve.")
    resolution: Length = Field(
        default=0.0, ge=0, description="Smallest step of its reading; default none."
    )


_USUAL_SHARE = 0.2


class Trigger(Section):
    """Time zero of a stroke: where a channel crosses a level.

    Computed channels obey the same rule, so that computed and measured strokes share their time
    zero.
    """

    channel: Role = Field(default="current", description="Channel that triggers.")
    level: Text | None = Field(default=None, description="Trigger level with its unit, e.g. 1 A.")
    share: Ratio | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Level as a share of the range from its rest value to its highest "
        "value; 20 % without a level.",
    )
    slope: Literal["rising", "falling"] = Field(
        default="rising", description="Direction of the crossing."
    )
    before: Time = Field(default=0.2e-3, ge=0, description="Time kept before the trigger.")
    after: Time = Field(default=5e-3, gt=0, description="Time kept after the trigger.")
    dead_time: Time | None = Field(
        default=None,
        gt=0,
        description="No second trigger within this time; default: the time kept after the trigger.",
    )

    @model_validator(mode="after")
    def _one_level(self) -> Self:
        if self.level is not None and self.share is not None:
            self._exactly_one(("level", "share"), "the trigger level")
        if self.level is not None:
            try:
                parse_quantity(self.level, ROLES[self.channel], "level")
            except ValueError as error:
                raise CaseProblem(
                    ("level",),
                    got=f"'{self.level}'",
                    expected=f"{ROLES[self.channel].name} with its unit",
                    hint=f"the channel is '{self.channel}': e.g. {ROLES[self.channel].example}.",
                ) from error
        return self

    @property
    def value(self) -> float | None:
        """Trigger level in SI; None if it is a share."""
        if self.level is None:
            return None
        return parse_quantity(self.level, ROLES[self.channel], "level")

    @property
    def share_of_way(self) -> float:
        """Share of the range from rest to the highest value, without a level."""
        return _USUAL_SHARE if self.share is None else self.share
