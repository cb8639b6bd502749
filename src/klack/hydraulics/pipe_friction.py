r"""Friction of a pipe, laminar and turbulent, without inertia and compliance."""

from collections.abc import Iterator, Mapping
from math import log, pi, sqrt
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import fixed_viscosity
from klack.input.problem import refuse_key_if
from klack.machine.compiling.jit import njit
from klack.network.component import Component
from klack.network.port import FLOW, Port
from klack.network.rows import Channel, Liquid, Rows
from klack.network.step_function import step_function
from klack.units import Length, format_si

__all__ = [
    "LAMINAR",
    "PipeFriction",
    "laminar_doubts",
    "pipe_friction_step",
    "reynolds_of",
    "root_of",
]

LAMINAR = 2300.0
"""Reynolds number at which laminar flow ends."""

_TOLD = 1e3  # [Pa]: 1 % of the atmosphere

_TURBULENT = 4000.0  # turbulent flow is developed
_LAST = sqrt(64.0 * LAMINAR)  # Re sqrt(f) where laminar flow ends
_ROUGHEST = 0.05  # of the diameter, in the diagram of Moody
_OVER_LN10 = 1.0 / log(10.0)
_MOST_NEWTON = 30
_SETTLED = 1e-7  # Newton step over the root; what is left is its square


@njit(error_model="numpy")
def _colebrook(x: float, rough: float) -> tuple[float, float]:
    """Reynolds number of turbulent flow at ``x = Re sqrt(f)``, and its slope."""
    inside = rough + 2.51 / x
    value = -2.0 * x * log(inside) * _OVER_LN10
    return value, value / x + 2.0 * _OVER_LN10 * 2.51 / (x * inside)


@njit(error_model="numpy")
def reynolds_of(x: float, rough: float, first: float) -> tuple[float, float]:
    r"""Reynolds number that belongs to ``x = Re sqrt(f)``, and its slope.

    ``x = D/nu sqrt(2 dp D/(rho L))`` follows from the pressure drop, which makes the law of
    Colebrook explicit:

    .. math:: Re = \frac{x^2}{64}\ \text{(laminar)}, \qquad
              Re = -2 x \lg\Bigl(\frac{\varepsilon}{3.7 D} + \frac{2.51}{x}\Bigr)
              \ \text{(turbulent)} ,

    and a straight line in ``x`` from Re = 2300 to 4000.

    Parameters
    ----------
    x [-]
        Zero or more.
    rough [-]
        ``eps/(3.7 D)``.
    first [-]
        ``x`` at which turbulent flow is developed.
    """
    if x <= _LAST:
        return x * x / 64.0, x / 32.0
    if x >= first:
        return _colebrook(x, rough)
    top, _ = _colebrook(first, rough)
    slope = (top - LAMINAR) / (first - _LAST)
    return LAMINAR + slope * (x - _LAST), slope


def laminar_doubts(
    component: str, reynolds: float, time: float, drop: float | None
) -> Iterator[str]:
    r"""Sentence on laminar friction beyond its range, where it matters by 0.01 bar or more.

    In a smooth pipe the turbulent pressure drop is :math:`0.3164\,Re^{3/4}/64` times the laminar
    ``drop`` [Pa] (Blasius, Mitt. Forschungsarb. 131 (1913)); None if unknown.
    """
    times = 0.3164 * reynolds**0.75 / 64.0
    if reynolds <= LAMINAR or (drop is not None and (times - 1.0) * drop < _TOLD):
        return
    number = f"{float(f'{reynolds:.3g}'):.0f}"
    shown = "" if drop is None else f", {1e-5 * drop:.2g} bar as computed,"
    yield (
        f"'{component}': the flow in this line, whose friction is laminar, reaches a Reynolds "
        f"number of {number} at {format_si(time, 's', 4)}; steady laminar flow ends at "
        f"{LAMINAR:g}. In the first milliseconds of a change the flow stays laminar above that; "
        f"later the pressure drop{shown} is about {times:.2g} times the laminar one.\n"
        f"Try: components.{component}.friction: turbulent."
    )


@njit(error_model="numpy", _nrt=False)
def root_of(reynolds: float, rough: float, first: float) -> float:
    """``x = Re sqrt(f)`` of a Reynolds number: the inverse of :func:`reynolds_of`."""
    if reynolds <= LAMINAR:
        return 8.0 * sqrt(reynolds)
    top, _ = _colebrook(first, rough)
    if reynolds < top:
        return _LAST + (reynolds - LAMINAR) * (first - _LAST) / (top - LAMINAR)
    x = first * reynolds / top  # Newton's method on a concave function, from below
    for _ in range(_MOST_NEWTON):
        found, slope = _colebrook(x, rough)
        step = (reynolds - found) / slope
        x += step
        if abs(step) < _SETTLED * x:
            break
    return x


@step_function
def pipe_friction_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """``par``: viscosity, length, diameter, area, relative roughness over 3.7, first ``x``."""
    drop = inp[2] - inp[3]
    density = inp[4] if drop >= 0.0 else inp[5]
    viscosity, length, diameter, area = par[0], par[1], par[2], par[3]
    scale = 2.0 * diameter * density / length
    square = (diameter / viscosity) ** 2 * scale * abs(drop)
    to_flow = viscosity * area / diameter
    if square <= _LAST * _LAST:  # no root where the flow reverses
        reynolds = square / 64.0
        by = to_flow / 64.0 * (diameter / viscosity) ** 2 * scale
        out[0], out[1] = by * drop, by
    else:
        x = sqrt(square)
        reynolds, slope = reynolds_of(x, par[4], par[5])
        out[0] = to_flow * reynolds if drop >= 0.0 else -to_flow * reynolds
        out[1] = 0.5 * to_flow * slope * x / abs(drop)
    out[2] = -out[1]
    out[3] = reynolds
    return 0


class PipeFriction(Component):
    r"""Friction of a straight round pipe between two pressures, from creeping to rough flow.

    .. math:: \Delta p = f\,\frac{L}{D}\,\frac{\varrho}{2}v^2, \qquad
              f = \frac{64}{Re}\ (Re \le 2300), \qquad
              \frac{1}{\sqrt f} = -2\lg\Bigl(\frac{\varepsilon}{3.7 D} + \frac{2.51}{Re\sqrt f}
              \Bigr)\ (Re \ge 4000)

    Hagen-Poiseuille and Colebrook, joined by a straight line in ``Re sqrt(f)``, which the pressure
    drop gives: no iteration, and monotone.  In a row with an ``inertance`` or a ``line``
    (``friction: none``), with a small chamber between, it makes their flow turbulent.

    Limits: steady friction, fully developed; transients of milliseconds from rest remain laminar
    above Re = 2300 (see ``line``).  Viscosity is that at ambient pressure.
    Sources: Colebrook, J. Inst. Civ. Eng. 11 (1939) 133; Moody, Trans. ASME 66 (1944) 671.
    """

    type: ClassVar[str] = "pipe-friction"
    ports: ClassVar[Mapping[str, Port]] = {"a": FLOW, "b": FLOW}

    length: Length = Field(gt=0, description="Of the pipe.")
    diameter: Length = Field(gt=0, description="Of the bore.")
    roughness: Length = Field(
        default=0.0,
        ge=0,
        description="Of the wall, after Colebrook; drawn tubes 1.5 um, hoses 5 um.",
    )

    @model_validator(mode="after")
    def _rough_but_a_pipe(self) -> Self:
        refuse_key_if(
            self.roughness > _ROUGHEST * self.diameter,
            ("roughness",),
            got=f"{self.roughness:g} m in a bore of {self.diameter:g} m",
            expected=f"at most {_ROUGHEST:g} of the diameter, the end of Colebrook's law",
            hint="check the units; model a corrugated hose as a pressure-loss.",
        )
        return self

    def parameters(self, viscosity: float) -> tuple[float, ...]:
        """Parameters of :func:`pipe_friction_step` from the viscosity [Pa s]."""
        rough = self.roughness / (3.7 * self.diameter)
        first = _LAST
        for _ in range(60):  # Re = 4000: a contraction, by Colebrook's own form
            first = -_TURBULENT / (2.0 * log(rough + 2.51 / first) * _OVER_LN10)
        area = pi / 4.0 * self.diameter**2
        return viscosity, self.length, self.diameter, area, rough, max(first, _LAST * 1.001)

    def add_rows(self, rows: Rows) -> None:
        """Add one branch."""
        fluid, viscosity = fixed_viscosity(rows)
        area = pi / 4.0 * self.diameter**2
        liquid = Liquid(
            inertance=float(fluid.density(rows.ambient.pressure)) * self.length / area,
            length=self.length,
            resistance=8.0 * pi * viscosity * self.length / area**2,
        )
        self.add_between(rows, rows.port("a"), rows.port("b"), viscosity, liquid=liquid)

    def add_between(
        self,
        rows: Rows,
        a: int,
        b: int,
        viscosity: float,
        label: str = "",
        liquid: Liquid | None = None,
    ) -> None:
        """Add the branch between two nodes of the present component; ``liquid`` of a whole pipe."""
        rows.branch(
            pipe_friction_step,
            a=a,
            b=b,
            parameters=self.parameters(viscosity),
            state=(0.0,),
            channels=(Channel("Reynolds number", "-", 0, derived=True),),
            label=label,
            liquid=liquid,
        )
