"""Junction of lines: a node without volume."""

from typing import ClassVar

from pydantic import Field

from klack.hydraulics.network_fluid import network_fluid
from klack.network.component import Component
from klack.network.port import COMPLIANCE
from klack.network.rows import Rows
from klack.units import Pressure

__all__ = ["Junction"]


class Junction(Component):
    r"""Node without volume at which lines meet each other and other flows.

    .. math:: \sum_i \dot m_i = 0, \qquad P = c_k + Z_k q_k \;\; \text{at each line end}, \qquad
              P = \frac{\sum_k c_k/Z_k}{\sum_k 1/Z_k} \;\; \text{of lines alone}

    Each line end answers a flow at once with its impedance ``Z``, so nothing has to be stored.  A
    wave from line ``j`` enters line ``k`` with the share ``2 Y_j / sum Y``, ``Y = 1/Z``, of its
    pressure, and is reflected with that share less one: exact for any number of lines, at any step.
    Orifices, seats, losses and sources at the node are solved together with it.  With one line it
    is the end of that line, shut or with what else is joined.  A chamber instead delays waves by
    ``V/K sum Y``, and needs a volume.

    Where its pressure would fall below that of boiling, a cavity holds that pressure until it is
    filled again (discrete vapour cavity, as in a line).

    Limits: needs the end of a line; no face may move there (its room is a chamber); one pressure,
    that of fluid at rest, so no loss by mixing (put a pressure-loss into each branch); in a run
    that begins between pressures far apart, lines begin with the steady flow of their friction.
    Source: Wylie & Streeter 1993, ch. 3 (junctions in series and branching) and 8 (cavities).
    """

    type: ClassVar[str] = "junction"
    ports: ClassVar = {"fluid": COMPLIANCE}

    pressure: Pressure | None = Field(
        default=None,
        gt=0,
        description="Absolute, at the start; by default that of steady flow, or ambient.",
    )

    def add_rows(self, rows: Rows) -> None:
        """Make the node a junction."""
        network_fluid(rows)
        rows.junction(rows.port("fluid"), pressure=self.pressure)
