"""Gas face: where the pressure of a gas pushes a body, and the body moves gas."""

from typing import ClassVar

from klack.hydraulics.face import FaceComponent
from klack.hydraulics.gas.network_gas import network_gas
from klack.network.gas_rows import GasWallRow
from klack.network.port import ELEMENT, GAS_FLOW
from klack.network.rows import Rows

__all__ = ["GasFace"]


class GasFace(FaceComponent):
    r"""Projected area of a body on which a gas pushes; the twin of ``pressure-face``.

    .. math:: F = \pm A\,(p - p_{amb}), \qquad \Delta V = \pm A\,y

    ``+`` for ``direction: opening``: the pressure lifts the body, and a rising body makes room
    below it.  The work on the body is taken from the internal energy of the gas.  A body with a
    face in liquid and one in gas is a piston between both.

    Limits: one pressure over the whole face.
    """

    type: ClassVar[str] = "gas-face"
    ports: ClassVar = {"gas": GAS_FLOW, "body": ELEMENT}

    def add_rows(self, rows: Rows) -> None:
        """Add one moving wall."""
        network_gas(rows)
        rows.gas_rows.walls.append(
            GasWallRow(
                component=rows.component,
                node=rows.port("gas"),
                port=rows.port("body"),
                area=self.signed_area,
            )
        )
