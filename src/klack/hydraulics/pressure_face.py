"""Pressure face: where a pressure pushes a body, and the body moves fluid."""

from typing import ClassVar

from klack.hydraulics.face import FaceComponent
from klack.hydraulics.network_fluid import network_fluid
from klack.network.port import ELEMENT, FLOW
from klack.network.rows import Rows

__all__ = ["PressureFace"]


class PressureFace(FaceComponent):
    r"""Projected area of a body on which a pressure acts.

    .. math:: F = \pm A\,(p - p_{amb}), \qquad \Delta V = \pm A\,y

    ``+`` for ``direction: opening``: the pressure lifts the body, and a rising body makes room
    below it.  The same area moves the fluid, so the work on the body is that taken from the fluid.
    A stepped needle has one face per pressure, from ``inner_diameter`` to ``outer_diameter``.
    Closed on its seat the pressure steps at the sealing diameter.

    Limits: one pressure over the whole face.  For the ring of a narrow land between two pressures
    see :class:`~klack.hydraulics.land_face.LandFace`.
    """

    type: ClassVar[str] = "pressure-face"
    ports: ClassVar = {"fluid": FLOW, "body": ELEMENT}

    def add_rows(self, rows: Rows) -> None:
        """Add one moving wall."""
        network_fluid(rows)
        rows.wall(rows.port("fluid"), rows.port("body"), self.signed_area)
