"""Chamber: a volume of fluid with one pressure."""

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from klack.hydraulics.network_fluid import network_fluid
from klack.network.component import Component
from klack.network.port import COMPLIANCE, Port
from klack.network.rows import Rows
from klack.units import Pressure, Volume

__all__ = ["Chamber"]


class Chamber(Component):
    r"""Volume of fluid with one pressure; its walls may move.

    .. math:: \frac{dm}{dt} = \sum \dot m, \qquad V \varrho(p) = m, \qquad
              V = V_0 + \sum_i A_i y_i

    The state is the *mass*, the pressure follows from the density of the fluid: nothing drifts,
    with gas and vapour too, where the usual ``dp/dt = K/V (sum Q - dV/dt)`` loses mass whenever
    ``K`` changes in a step.  Walls are :class:`~klack.hydraulics.pressure_face.PressureFace`.  The
    hydraulic spring on a face is ``K A^2/V``, 1e6 to 1e8 N/m in a valve.

    Limits: one pressure, so shorter than 1/20 of a wave; isothermal.  Choose the volume at y = 0
    large enough for every face that moves in: a volume that vanishes stops the run.
    Source: Merritt 1967, sec. 3-8.
    """

    type: ClassVar[str] = "chamber"
    ports: ClassVar[Mapping[str, Port]] = {"fluid": COMPLIANCE}

    volume: Volume = Field(gt=0, description="With all faces at their start positions.")
    pressure: Pressure | None = Field(
        default=None,
        gt=0,
        description="Absolute, at the start; by default that of steady flow, or ambient.",
    )

    def add_rows(self, rows: Rows) -> None:
        """Make the node a chamber."""
        network_fluid(rows)
        rows.chamber(rows.port("fluid"), volume=self.volume, pressure=self.pressure)
