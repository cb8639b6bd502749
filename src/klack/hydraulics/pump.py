r"""Pump of pistons: displacement with its kinematic ripple, and leakage."""

from math import pi, sin
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.network_fluid import energy_table, gas_is_slow
from klack.input.problem import CaseProblem
from klack.input.section import Count
from klack.machine.compiling.jit import njit
from klack.network.component import Component
from klack.network.port import FLOW, Port, Role
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import carray, step_function
from klack.units import Angle, Pressure, Ratio, Rotation, Volume

__all__ = ["Pump", "laminar_leak_step", "pump_step", "swept_share"]

_TURN = 2.0 * pi


@njit(error_model="numpy")
def swept_share(angle: float, turned: float, pistons: int) -> float:
    r"""Share of the displacement that all pistons deliver while the shaft turns.

    .. math:: s = \frac{1}{2z}\sum_{k=0}^{z-1}\int_\varphi^{\varphi + \Delta\varphi}
              \max\bigl(0, \sin(\vartheta + 2\pi k/z)\bigr)\,d\vartheta

    One turn delivers 1, exactly.  ``angle`` and ``turned``, zero or more, are in rad.
    """
    turns = int(turned / _TURN)
    rest = turned - turns * _TURN
    total = 2.0 * turns * pistons
    for k in range(pistons):
        begin = angle + _TURN * k / pistons
        begin -= _TURN * int(begin / _TURN)
        if begin < 0.0:
            begin += _TURN
        end = begin + rest
        if begin < pi:
            half = 0.5 * (min(end, pi) - begin)
            total += 2.0 * sin(begin + half) * sin(half)  # difference of cosines
        if end > _TURN:
            half = 0.5 * min(end - _TURN, pi)
            total += 2.0 * sin(half) * sin(half)
    return total / (2.0 * pistons)


@step_function
def pump_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow that the pistons deliver in the step, at the density before the pump.

    ``par``: 0 size of all, 1 displacement, 2 turns per time, 3 pistons (0: no ripple), 4 angle at
    time zero, 5 whether the gas of the fluid takes time to leave and enter it, fluid table.
    ``state``: places in the fluid table of both ends, volume flow.
    """
    table = carray(par, (int(par[0]),))[6:]
    t, h, omega = inp[0], inp[1], _TURN * par[2]
    flow = par[1] * par[2]
    if par[3] > 0.0 and t >= 0.0:
        pistons = int(par[3])
        if h > 0.0:
            share = swept_share(par[4] + omega * t, omega * h, pistons)
            flow = par[1] * share / h
        else:
            total = 0.0
            for k in range(pistons):
                total += max(sin(par[4] + omega * t + _TURN * k / pistons), 0.0)
            flow *= pi / pistons * total
    rho, slope, g_a, hint_a = fluid_at(table, inp[2], int(state[0]))
    _, _, g_b, hint_b = fluid_at(table, inp[3], int(state[1]))
    if par[5] > 0.0:
        rho = inp[4]
    out[0], out[1], out[2] = rho * flow, slope * flow, 0.0
    out[3], out[4], out[5] = hint_a, hint_b, flow
    out[6] = rho * flow * (g_b - g_a) * h
    return 0


@step_function
def laminar_leak_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Volume flow along a narrow gap; ``par``: flow per pressure [m^3/(s Pa)]."""
    slope = par[0] * (inp[4] if inp[2] >= inp[3] else inp[5])
    out[0], out[1], out[2] = slope * (inp[2] - inp[3]), slope, -slope
    return 0


class Pump(Component):
    r"""Displacement pump from a to b at a given speed, with the kinematic ripple of its pistons.

    .. math:: Q = V_g n\,\frac{\pi}{z}\sum_{k=0}^{z-1}
              \max\Bigl(0, \sin\bigl(2\pi n t + \varphi_0 + \tfrac{2\pi k}{z}\bigr)\Bigr)
              - \frac{(1 - \eta)\,V_g n}{p_r}\,(p_b - p_a)

    Each of ``z`` pistons delivers half a sine per turn; the mean is exactly ``V_g n`` and the
    ripple has the order ``z`` of the shaft for an even and ``2 z`` for an odd number.  Its
    non-uniformity ``(Q_max - Q_min)/Q`` is ``pi/(2 z) tan(pi/(4 z))`` for odd and ``pi/z tan(pi/(2
    z))`` for even ``z``.  A step takes the volume swept within it, at the density before the pump:
    a pump whose inlet cavitates delivers less.  The leakage is laminar and given by the volumetric
    efficiency at one pressure difference.

    The work of the pistons is a supply, the leakage a loss.  Left alone, port a takes the fluid
    from the surroundings.  The static equilibrium before time zero has the mean flow.

    Limits: constant speed; no compression in the pistons (whose pulsation adds to the kinematic
    one, often several times as large, and depends on the valve plate), no torque losses.
    Source: Ivantysyn & Ivantysynova, Hydrostatic Pumps and Motors, 2001, ch. 3.
    """

    type: ClassVar[str] = "pump"
    ports: ClassVar = {
        "a": Port("hydraulic", Role.FLOW, optional=True),
        "b": FLOW,
    }

    displacement: Volume = Field(gt=0, examples=["10 cm^3"], description="Per turn, V_g.")
    speed: Rotation = Field(gt=0, examples=["1500 rpm"], description="Of the shaft, n.")
    pistons: Count | None = Field(
        default=None, description="Number of pistons z; without it the flow has no ripple."
    )
    phase: Angle = Field(default=0.0, description="Angle of the shaft at time zero.")
    volumetric_efficiency: Ratio = Field(
        default=1.0, gt=0, le=1, description="At the rated pressure; 1: no leakage."
    )
    rated_pressure: Pressure | None = Field(
        default=None, gt=0, description="Difference b - a at which that efficiency holds."
    )

    @model_validator(mode="after")
    def _whole_leakage(self) -> Self:
        if (self.volumetric_efficiency < 1.0) != (self.rated_pressure is not None):
            given = "volumetric_efficiency" if self.rated_pressure is None else "rated_pressure"
            missing = "rated_pressure" if self.rated_pressure is None else "volumetric_efficiency"
            raise CaseProblem(
                (),
                got=f"{given} without {missing}",
                expected="an efficiency below 1 and the pressure difference at which it holds",
                hint=f"add {missing}, or leave both out for a pump without leakage.",
            )
        return self

    @property
    def mean_flow(self) -> float:
        """``V_g n`` [m^3/s]."""
        return self.displacement * self.speed

    @property
    def leakage(self) -> float:
        """Leakage per pressure [m^3/(s Pa)]."""
        if self.rated_pressure is None:
            return 0.0
        return (1.0 - self.volumetric_efficiency) * self.mean_flow / self.rated_pressure

    def add_rows(self, rows: Rows) -> None:
        """Add a branch that supplies energy, and one that leaks."""
        table = energy_table(rows)
        shaft = self.displacement, self.speed, self.pistons or 0, self.phase
        numbers = [*shaft, float(gas_is_slow(rows)), *table]
        a, b = rows.port("a"), rows.port("b")
        rows.branch(
            pump_step,
            a=a,
            b=b,
            parameters=[len(numbers) + 1, *numbers],
            state=(0.0, 0.0, 0.0),
            books=(Book("shaft work", "supply"),),
            channels=(Channel("displaced flow", "m^3/s", 2, derived=True),),
        )
        if self.leakage > 0.0:
            rows.branch(laminar_leak_step, a=a, b=b, parameters=(self.leakage,), label="leak")
