r"""Forces across the axis of a needle that moves in three dimensions.

The axis of the needle is the line :math:`(a_x + s_x z,\; a_y + s_y z)`, with ``z`` as in its
drawing.  A component whose force depends on these four numbers adds a :class:`SideLaw` to its rows,
which axial motions ignore.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from klack.arrays import Vector

__all__ = ["OffAxisPart", "SideInputs", "SideLaw"]


class SideInputs(NamedTuple):
    """Inputs of a force across the axis.

    Parameters
    ----------
    axis (4,) [m], [m], [-], [-]
        ``a_x, a_y, s_x, s_y``, in the middle of the step.
    ports [m]
        Axial displacements of the ports of the row, in the middle of the step.
    state
        Of the row, at the start of the step.
    ahead [s]
        From there to the middle of the step.
    pressures (2,) [Pa]
        Of the nodes of a branch, as they act in the step; zeros for an element.
    """

    axis: Vector
    ports: Vector
    state: Vector
    ahead: float
    pressures: Vector


class SideLaw(Protocol):
    """Force across the axis of a needle."""

    def force(self, now: SideInputs) -> Vector:
        """Force and moments on the needle, shape (4,) [N], [N], [N m], [N m].

        Their work on a small change of ``now.axis`` is the scalar product of both.
        """

    def room(self, now: SideInputs) -> float:
        """Distance [m] left until the faces meet, where the law ends."""

    def left_out(self, now: SideInputs) -> float:
        """Share of the axial action that the position changes and the row does not [-]."""

    def placement(self, axis: Vector) -> Vector:
        """Numbers that the step function of the row takes of the position of the axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OffAxisPart:
    """A part of a component that acts across the axis of the needle.

    Parameters
    ----------
    key
        Where the component says so.
    port
        That has to be at the needle.
    heights [m]
        Of its ends, in the drawing of the needle.
    room [m]
        Lateral displacement that it allows at these heights; infinite where nothing can touch.
    """

    key: tuple[str | int, ...]
    port: str
    heights: tuple[float, ...]
    room: float
