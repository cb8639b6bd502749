"""Flow source: a flow that the rest of the valve cannot change."""

from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.network_fluid import energy_table, network_fluid
from klack.hydraulics.time_table import SourceOverTime, check_table
from klack.input.section import Section
from klack.network.port import FLOW, Port, Role
from klack.network.rows import Book, Rows
from klack.network.step_function import carray, step_function
from klack.units import Time, VolumeFlow

__all__ = ["FlowSource", "FlowStep", "FlowTable"]


@step_function
def flow_source_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow of the middle of the step, and its work.

    ``par``: size of all, number ``n`` of times, ``n`` times, ``n`` mass flows, fluid table.
    ``state``: interval, and the places in the fluid table of both ends.
    """
    size, n = int(par[0]), int(par[1])
    t, h = inp[0] + 0.5 * inp[1], inp[1]
    i = int(state[0])
    while i > 0 and t < par[2 + i]:
        i -= 1
    while i < n - 1 and t >= par[3 + i]:
        i += 1
    flow = par[2 + n + i]
    if i < n - 1 and t > par[2 + i]:
        share = (t - par[2 + i]) / (par[3 + i] - par[2 + i])
        flow += share * (par[3 + n + i] - flow)
    table = carray(par, (size,))[2 + 2 * n :]
    _, _, g_a, hint_a = fluid_at(table, inp[2], int(state[1]))
    _, _, g_b, hint_b = fluid_at(table, inp[3], int(state[2]))
    out[0], out[1], out[2] = flow, 0.0, 0.0
    out[3], out[4], out[5] = i, hint_a, hint_b
    out[6] = flow * (g_b - g_a) * h
    return 0


class FlowStep(Section):
    """Straight ramp to another flow, which then stays."""

    to: VolumeFlow = Field(description="At ambient density.")
    at: Time = Field(ge=0, description="Start of the ramp.")
    rise: Time = Field(default=1e-6, gt=0, description="Length of the ramp.")


class FlowTable(Section):
    """Flow over time: straight between its points, constant beyond them."""

    time: tuple[Time, ...] = Field(description="Rising.")
    flow: tuple[VolumeFlow, ...] = Field(description="At ambient density, one per time.")

    @model_validator(mode="after")
    def _usable(self) -> Self:
        check_table(self.time, self.flow, "flow")
        return self


class FlowSource(SourceOverTime):
    """Prescribed flow from a to b: constant, with a step, or from a table.

    A pump without leakage: it reaches any pressure, and its work ``(g_b - g_a) m`` (``g`` the
    integral of ``dp/rho``) is counted as a supply.  Left alone, port a takes the fluid from the
    surroundings.  The flow is a volume at ambient density, times that density a mass flow.

    Limits: a flow out of an empty chamber continues; its pressure then falls to its lower end, and
    the run says so.
    """

    type: ClassVar[str] = "flow-source"
    quantity: ClassVar[str] = "flow"
    ports: ClassVar = {
        "a": Port("hydraulic", Role.FLOW, optional=True),
        "b": FLOW,
    }

    flow: VolumeFlow | None = Field(
        default=None, description="At ambient density; before the step, if there is one."
    )
    step: FlowStep | None = Field(default=None, description="Changes the flow once.")
    table: FlowTable | None = Field(default=None, description="Instead of the flow.")

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that supplies energy."""
        fluid = network_fluid(rows)
        time, flow = self.history()
        mass_flow = np.array(flow) * float(fluid.density(rows.ambient.pressure))
        table = energy_table(rows)
        numbers = [*time, *mass_flow, *table]
        rows.branch(
            flow_source_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=[len(numbers) + 2, len(time), *numbers],
            state=(0.0, 0.0, 0.0),
            books=(Book("pump work", "supply"),),
        )
