"""Roles of a measured channel, and the quantity of each."""

from collections.abc import Mapping
from typing import Literal

from klack.units import ACCELERATION, CURRENT, FORCE, LENGTH, PRESSURE, SPEED, VOLTAGE, Kind

__all__ = ["LIFT_ALONE", "ROLES", "Role"]

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
"""Kind of quantity of each role; inside klack its values are in the SI unit of that kind."""

LIFT_ALONE: tuple[Role, ...] = ("lift",)
"""Channels that a comparison needs of a recording, in addition to its trigger."""
