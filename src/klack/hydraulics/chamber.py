"""Chamber: a volume of fluid with one pressure."""

from typing import ClassVar

from pydantic import Field

from klack.hydraulics.fluid_store import WALL, fluid_store_step
from klack.hydraulics.fluid_table import fluid_table
from klack.hydraulics.network_fluid import network_fluid
from klack.hydraulics.wall_compliance import Wall
from klack.network.component import Component
from klack.network.port import COMPLIANCE
from klack.network.rows import AMBIENT, Book, Rows
from klack.units import Pressure, Volume

__all__ = ["Chamber"]


class Chamber(Component):
    r"""Volume of fluid with one pressure; its walls may move.

    .. math:: \frac{dm}{dt} = \sum \dot m, \qquad V \varrho(p) = m, \qquad
              V = V_0 + \sum_i A_i y_i

    The state is the *mass*, so nothing drifts, while the usual ``dp/dt = K/V (sum Q - dV/dt)``
    loses mass whenever ``K`` changes in a step, as with gas and vapour.  Walls are
    :class:`~klack.hydraulics.pressure_face.PressureFace`.  The hydraulic spring on a face is ``K
    A^2/V``, 1e6 to 1e8 N/m in a valve.

    With a section ``wall`` its volume also grows with the pressure, ``dV = V_0 dp/K_wall`` from
    that of the surroundings on; the strain energy of the wall is a store.  That share follows by
    an implicit step of first order, whose loss is counted: damping ratios of ``omega h/4`` times
    the share of the wall in the compliance.

    Limits: one pressure, so shorter than 1/20 of a wave; isothermal.  A volume that vanishes as
    faces move in stops the run.
    Source: Merritt 1967, sec. 3-8.
    """

    type: ClassVar[str] = "chamber"
    ports: ClassVar = {"fluid": COMPLIANCE}

    volume: Volume = Field(gt=0, description="With all faces at their start positions.")
    pressure: Pressure | None = Field(
        default=None,
        gt=0,
        description="Absolute, at the start; by default that of steady flow, or ambient.",
    )
    wall: Wall | None = Field(default=None, description="Elastic wall; rigid without it.")

    def add_rows(self, rows: Rows) -> None:
        """Make the node a chamber."""
        fluid = network_fluid(rows)
        rows.chamber(rows.port("fluid"), volume=self.volume, pressure=self.pressure)
        if self.wall is None:
            return
        ambient = rows.ambient.pressure
        no_inlet = (0.0, 0.0, 0.0, fluid.vapour_pressure)
        law = (WALL, ambient, self.volume * self.wall.compliance, 0.0, 0.0, 0.0)
        numbers = [*law, *no_inlet, *fluid_table(fluid, ambient)]
        rows.branch(
            fluid_store_step,
            a=rows.port("fluid"),
            b=AMBIENT,
            parameters=[len(numbers) + 1, *numbers],
            state=(self.pressure or 0.0, 0.0, 0.0, 0.0 if self.pressure is None else 1.0),
            books=(Book("energy", "store"),),
            label="wall",
        )
