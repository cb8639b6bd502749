"""Seat of a network whose needle is off-axis: its place, and the force of the pressure.

The flow is that of :func:`~klack.hydraulics.off_axis_opening.off_axis_opening`, the force across
the axis that of :func:`~klack.hydraulics.off_axis_seat.pressure_load`.  Axial forces of the faces
act at a point of the axis of the needle, about which the moments are taken.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from klack.arrays import Vector
from klack.hydraulics.off_axis_seat import SeatFace, pressure_load
from klack.input.section import Section
from klack.network.across import SideInputs
from klack.units import Length

__all__ = ["SeatAcross", "SeatPlace"]


_ANGLES = 24  # exact to round-off while nothing overlaps


class SeatPlace(Section):
    """Where the edge of a seat meets the needle, so that it follows a needle off its axis."""

    height: Length = Field(
        description="Height z of the edge with the seat closed, in the drawing of the needle."
    )
    inside: Literal["a", "b"] = Field(
        default="b", description="Port at the bore of the seat: its pressure is inside the edge."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatAcross:
    """Law of the force across the axis.

    Parameters
    ----------
    height [m]
        Of the edge in the drawing of the needle.
    lift [m]
        While both ports are at rest.
    inside
        0 or 1: node whose pressure is inside the edge.
    """

    face: SeatFace
    height: float
    lift: float
    inside: int

    def placement(self, axis: Vector) -> Vector:
        """Offset [m] and slopes of the face of the needle, shape (4,)."""
        return np.concatenate((axis[:2] + self.height * axis[2:], -axis[2:]))

    def force(self, now: SideInputs) -> Vector:
        """Force and moments, shape (4,) [N], [N], [N m], [N m]."""
        lift = self.lift + float(now.ports[0] - now.ports[1])
        at = self.placement(now.axis)
        push, moment = pressure_load(self.face, (lift, *at), angles=_ANGLES)
        turn = moment - np.cross((at[0], at[1], lift), push)
        drop = float(now.pressures[self.inside] - now.pressures[1 - self.inside])
        # the axis slopes by (theta_y, -theta_x)
        moments = self.height * push[:2] + np.array([turn[1], -turn[0]])
        return np.asarray(drop * np.concatenate((push[:2], moments)))

    def left_out(self, now: SideInputs) -> float:
        """Zero: the flow is that of the position."""
        return 0.0

    def room(self, now: SideInputs) -> float:
        """Infinite: faces may overlap, where nothing flows."""
        return np.inf
