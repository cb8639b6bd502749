"""Line with water hammer: a bore in which pressure travels as waves."""

from math import pi, sqrt
from typing import TYPE_CHECKING, ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.hydraulics.line_friction import KAGAWA, laminar_resistance, unsteady_terms
from klack.hydraulics.network_fluid import network_fluid
from klack.input.problem import CaseProblem
from klack.input.section import Count
from klack.network.component import Component
from klack.network.port import FLOW
from klack.network.rows import Rows
from klack.units import Length, Modulus, Pressure

if TYPE_CHECKING:
    from klack.hydraulics.fluid import Fluid

__all__ = ["Line"]

_SEGMENTS = 2  # with friction: damps all modes of a fed line as spread friction does


class Line(Component):
    r"""Straight round bore with water hammer between two nodes.

    .. math:: \frac{\partial p}{\partial t} + \varrho a^2 \frac{\partial u}{\partial x} = 0, \qquad
              \varrho \frac{\partial u}{\partial t} + \frac{\partial p}{\partial x} + J = 0

    Without ``J`` both waves cross the bore unchanged in ``T = L / a``: the line is two delays and
    the impedance ``Z = rho a / A``, exact for every step, where a grid or a chain of volumes and
    inertances smears fronts.  A needle that stops shuts the flow and the jump ``rho a du`` comes
    back every ``2 L / a``: the stairs in a measured rebound velocity.

    Friction ``J`` is lumped between segments and at both ends.  ``kagawa`` remembers how the flow
    changed; ``steady`` is Hagen-Poiseuille, which damps the first mode of a short fuel line fifty
    times too little.  Where the pressure between two segments would fall below that of vapour, a
    cavity opens there and collapses later (discrete vapour cavities).

    Two segments damp every mode of a line that is open at one end, and the odd ones of a closed
    line; oils of 50 mm^2/s and more want 4 to 8, cavities a segment for each place.

    Limits: one sound speed and density, those at ``pressure`` (steps of some 10 bar change them by
    a few per cent, free gas by far more); laminar friction, which fits transients of ms from rest
    also above Re = 2300; bends and fittings belong into an orifice.  A line needs a chamber or a
    pressure at each end; a tiny chamber closes it.
    Sources: Wylie & Streeter 1993, ch. 1 (speed in a thin-walled tube that may lengthen), 3 and 8;
    Krus et al. (transmission-line modelling); Kagawa et al. 1983.
    """

    type: ClassVar[str] = "line"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    length: Length = Field(examples=["100 mm"], gt=0, description="From end to end.")
    diameter: Length = Field(examples=["2 mm"], gt=0, description="Of the bore.")
    pressure: Pressure = Field(
        gt=0, description="Absolute, about which waves run; sets sound speed and density."
    )
    wall_thickness: Length | None = Field(
        default=None, gt=0, description="Of a tube; without it the wall is rigid."
    )
    wall_modulus: Modulus | None = Field(
        default=None, gt=0, description="Young's modulus of a tube."
    )
    friction: Literal["none", "steady", "kagawa"] = Field(
        default="kagawa", description="none, steady laminar, or with memory after Kagawa."
    )
    segments: Count | None = Field(
        default=None, description="Parts between which friction and cavities sit; 2, or 1 without."
    )

    @model_validator(mode="after")
    def _whole_wall(self) -> Self:
        given = {"wall_thickness": self.wall_thickness, "wall_modulus": self.wall_modulus}
        missing = [name for name, value in given.items() if value is None]
        if len(missing) == 1:
            raise CaseProblem(
                (),
                got=f"an elastic wall without {missing[0]}",
                expected="wall_thickness and wall_modulus together, or none of them",
                hint=f"add {missing[0]}; leave both out for a bore in a thick body.",
            )
        return self

    @property
    def parts(self) -> int:
        """Number of segments in use."""
        return self.segments or (1 if self.friction == "none" else _SEGMENTS)

    def wave_speed(self, fluid: "Fluid") -> float:
        r"""Speed of pressure waves [m/s], lowered by the wall: ``1/a^2 + rho D / (E s)``."""
        slowness = float(fluid.sound_speed(self.pressure)) ** -2
        if self.wall_modulus is not None and self.wall_thickness is not None:
            stretch = self.diameter / (self.wall_modulus * self.wall_thickness)
            slowness += float(fluid.density(self.pressure)) * stretch
        return 1.0 / sqrt(slowness)

    def echo_time(self, fluid: "Fluid") -> float:
        """Return ``2 L / a`` [s], after which an end hears of the other one."""
        return 2.0 * self.length / self.wave_speed(fluid)

    def add_rows(self, rows: Rows) -> None:
        """Add the delay line."""
        fluid = network_fluid(rows)
        rho = float(fluid.density(self.pressure))
        # the network counts P = rho_ref g and q = mdot / rho_ref, with rho_ref at ambient pressure
        scale = (float(fluid.density(rows.ambient.pressure)) / rho) ** 2
        a, viscosity = self.wave_speed(fluid), float(fluid.viscosity(self.pressure))
        resistance = scale * laminar_resistance(self.length, self.diameter, viscosity)
        gain, rate = unsteady_terms(
            KAGAWA,
            resistance=resistance,
            diameter=self.diameter,
            kinematic_viscosity=viscosity / rho,
        )
        memory = self.friction == "kagawa" and viscosity > 0.0
        rows.line(
            a=rows.port("a"),
            b=rows.port("b"),
            delay=self.length / a,
            impedance=scale * rho * a / (0.25 * pi * self.diameter**2),
            segments=self.parts,
            resistance=resistance if self.friction != "none" else 0.0,
            unsteady_gain=gain if memory else (),
            unsteady_rate=rate if memory else (),
            vapour_pressure=fluid.vapour_pressure,
        )
