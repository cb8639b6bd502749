r"""Pulsating flow source: a mean flow and its harmonics."""

from math import pi, sin
from typing import Any, ClassVar

from pydantic import Field

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.network_fluid import energy_table, network_fluid
from klack.input.section import Section
from klack.network.component import Component
from klack.network.port import FLOW, Port, Role
from klack.network.rows import Book, Rows
from klack.network.step_function import carray, step_function
from klack.units import Angle, Frequency, VolumeFlow

__all__ = ["FlowHarmonic", "PulsatingFlow", "pulsating_flow_step"]


@step_function
def pulsating_flow_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Mean over the step of a constant flow and of sines.

    ``par``: size of all, number of sines, constant mass flow, angular frequency, amplitude and
    phase of each, fluid table.  ``state``: places in the fluid table of both ends.
    """
    sines = int(par[1])
    t, h = inp[0], inp[1]
    flow = par[2]
    if t >= 0.0:
        for k in range(sines):
            omega = par[3 + 3 * k]
            half = 0.5 * omega * h
            mean = sin(half) / half if half > 0.0 else 1.0
            flow += par[4 + 3 * k] * mean * sin(omega * t + half + par[5 + 3 * k])
    table = carray(par, (int(par[0]),))[3 + 3 * sines :]
    _, _, g_a, hint_a = fluid_at(table, inp[2], int(state[0]))
    _, _, g_b, hint_b = fluid_at(table, inp[3], int(state[1]))
    out[0], out[1], out[2] = flow, 0.0, 0.0
    out[3], out[4] = hint_a, hint_b
    out[5] = flow * (g_b - g_a) * h
    return 0


class FlowHarmonic(Section):
    """One sine of a pulsation."""

    frequency: Frequency = Field(gt=0, description="Of the sine.")
    amplitude: VolumeFlow = Field(ge=0, description="At ambient density.")
    phase: Angle = Field(default=0.0, description="Of the sine at time zero.")


class PulsatingFlow(Component):
    r"""Prescribed flow from a to b: a mean and sines, as measured behind a pump.

    .. math:: Q = Q_0 + \sum_k a_k \sin(2\pi f_k t + \varphi_k)

    Steps of any length deliver the same volume, by its exact mean.  As the ``flow-source`` it
    reaches any pressure, its work is a supply, the volume counts at ambient density, and port a
    left alone takes the fluid from the surroundings.  The static equilibrium has the mean flow.  A
    pulsation of *pressure* is a ``pressure-source`` with a table.

    Limits: no internal impedance: the flow does not answer to the pressure.
    Source: definition; the harmonics of a pump come from measurements as in ISO 10767-1.
    """

    type: ClassVar[str] = "pulsating-flow"
    ports: ClassVar = {
        "a": Port("hydraulic", Role.FLOW, optional=True),
        "b": FLOW,
    }

    mean: VolumeFlow = Field(description="At ambient density, Q_0.")
    harmonics: tuple[FlowHarmonic, ...] = Field(
        min_length=1, description="Sines: frequency, amplitude, phase."
    )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that supplies energy."""
        fluid = network_fluid(rows)
        density = float(fluid.density(rows.ambient.pressure))
        sines = [
            number
            for sine in self.harmonics
            for number in (2.0 * pi * sine.frequency, density * sine.amplitude, sine.phase)
        ]
        table = energy_table(rows)
        numbers = [len(self.harmonics), density * self.mean, *sines, *table]
        rows.branch(
            pulsating_flow_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=[len(numbers) + 1, *numbers],
            state=(0.0, 0.0),
            books=(Book("pump work", "supply"),),
        )
