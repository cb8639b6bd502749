"""Trigger that cuts a long recording into strokes."""

from typing import Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem
from klack.input.section import Section, Text
from klack.measurement.roles import ROLES, Role
from klack.units import Ratio, Time, parse_quantity

__all__ = ["Trigger"]

_USUAL_SHARE = 0.2


class Trigger(Section):
    """Time zero of a stroke: where a channel crosses a level.

    The same rule is applied to computed channels, so that computed and measured strokes share their
    time zero.
    """

    channel: Role = Field(default="current", description="Channel that triggers.")
    level: Text | None = Field(
        default=None, description="Value at which it triggers, with its unit, e.g. 1 A."
    )
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
        description="No second trigger within this time; default the time kept after it.",
    )

    @model_validator(mode="after")
    def _one_level(self) -> Self:
        if self.level is not None and self.share is not None:
            self._exactly_one(("level", "share"), "at which value it triggers")
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
        """Share of the range from the rest value to the highest value, without a level."""
        return _USUAL_SHARE if self.share is None else self.share
