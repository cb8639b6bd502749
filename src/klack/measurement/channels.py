"""Which channels of a recording mean what."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_validator

from klack.input.section import Section, Text
from klack.measurement.roles import Role
from klack.units import Ratio

__all__ = ["ChannelChoice", "Channels"]


class ChannelChoice(Section):
    """One channel of a recording, or one per stroke.

    A plain text is its name.  With ``*`` and ``?`` the name is a pattern; if several channels
    match, each of them is a stroke of its own, in the order of the file.
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
