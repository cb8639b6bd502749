"""Line with water hammer: a bore in which pressure travels as waves."""

from functools import lru_cache
from math import inf, pi
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from klack.errors import InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.line_friction import KAGAWA, laminar_resistance, unsteady_terms
from klack.hydraulics.liquid import HIGHEST_PRESSURE
from klack.hydraulics.local_line import LocalLine
from klack.hydraulics.network_fluid import network_fluid
from klack.hydraulics.pipe_friction import LAMINAR, PipeFriction
from klack.hydraulics.wall_compliance import Wall
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Count
from klack.network.component import Component
from klack.network.port import FLOW
from klack.network.protocols import NetworkFluid
from klack.network.ranges import value_text
from klack.network.rows import LimitRow, Rows
from klack.units import Length, Modulus, Pressure, percent_text

__all__ = ["Line"]

_FOLLOWED = 0.1  # error of wave speed and impedance that is not worth a word
_CELLS = 50  # of a line with local properties
_LOOKED_AT = 400  # pressures, in equal ratios
# two with friction damp all modes of a fed line as spread friction does; turbulent lumps, which
# are not at the ends, want four
_PARTS = {"none": 1, "steady": 2, "kagawa": 2, "turbulent": 4}


class Line(Component):
    r"""Straight round bore with water hammer between two nodes.

    .. math:: \frac{\partial p}{\partial t} + \varrho a^2 \frac{\partial u}{\partial x} = 0, \qquad
              \varrho \frac{\partial u}{\partial t} + \frac{\partial p}{\partial x} + J = 0

    Without ``J`` both waves cross the bore unchanged in ``T = L / a``: two delays and the impedance
    ``Z = rho a / A`` are exact for every step, where a grid or a chain of volumes and inertances
    smears fronts.  The jump ``rho a du`` of a needle that stops comes back every ``2 L / a``: the
    stairs in a measured rebound velocity.

    Friction ``J`` is lumped between segments and at both ends.  ``kagawa`` remembers how the flow
    changed; ``steady`` is Hagen-Poiseuille, which damps the first mode of a short fuel line fifty
    times too little.  ``turbulent`` adds to that memory the steady drop of
    :class:`~klack.hydraulics.pipe_friction.PipeFriction` (Colebrook from Re = 4000 on), in equal
    lumps between pieces that meet in junctions.  Where the pressure between two segments would fall
    below that of vapour, a cavity opens there and collapses later (discrete vapour cavities).

    Two segments damp every mode of a line open at one end, and the odd ones of a closed line; oils
    of 50 mm^2/s and more need 4 to 8, cavities a segment for each place.

    Limits: one sound speed and density, those at ``pressure`` (steps of some 10 bar change them by
    a few per cent, free gas by far more; a run warns where the pressure at an end changes either by
    more than 10 %); laminar friction, which fits transients of ms from rest also above Re = 2300,
    but for ``turbulent``, whose memory is that of laminar flow as well; bends and fittings are a
    pressure-loss.  A line needs a chamber, a junction or a pressure at each end; a junction alone
    closes it.
    Sources: Wylie & Streeter 1993, ch. 1 (speed in a thin-walled tube that may lengthen), 3 and 8;
    Krus et al. (transmission-line modelling); Kagawa et al. 1983.
    """

    type: ClassVar[str] = "line"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    length: Length = Field(examples=["100 mm"], gt=0, description="From end to end.")
    diameter: Length = Field(examples=["2 mm"], gt=0, description="Of the bore.")
    pressure: Pressure | None = Field(
        default=None,
        gt=0,
        description="Absolute, of the linear waves; sets sound speed and density. "
        "Default: the higher start pressure stated at its ends.",
    )
    wall_thickness: Length | None = Field(
        default=None, gt=0, description="Of a tube; without it the wall is rigid."
    )
    wall_modulus: Modulus | None = Field(
        default=None, gt=0, description="Young's modulus of a tube."
    )
    wall: Wall | None = Field(
        default=None,
        description="A hose with its bulk modulus, or a tube of any thickness; instead of "
        "wall_thickness and wall_modulus.",
    )
    friction: Literal["none", "steady", "kagawa", "turbulent"] = Field(
        default="kagawa",
        description="none, steady laminar, unsteady after Kagawa, or unsteady and turbulent.",
    )
    roughness: Length | None = Field(
        default=None, ge=0, description="Of the wall, for turbulent friction; smooth without it."
    )
    segments: Count | None = Field(
        default=None,
        description="Segments between which friction and cavities are lumped; "
        "default 2, 1 without friction, 4 lumps of turbulent friction.",
    )
    properties: Literal["fixed", "local"] = Field(
        default="fixed",
        description="fixed: density, sound speed and viscosity at one pressure; local: in cells, "
        "following the pressure, where ``pressure`` has no meaning.",
    )
    cells: Count | None = Field(
        default=None, ge=4, description="Of a line with local properties; default 50."
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
        refuse_key_if(
            self.roughness is not None and self.friction != "turbulent",
            ("roughness",),
            got=f"a roughness with friction: {self.friction}",
            expected="a roughness only with friction: turbulent",
            hint="leave it out, or choose friction: turbulent.",
        )
        wrong = "segments" if self.properties == "local" else "cells"
        refuse_key_if(
            getattr(self, wrong) is not None,
            (wrong,),
            got=f"{wrong} in a line with properties: {self.properties}",
            expected="segments with properties: fixed, cells with properties: local",
            hint="leave it out, or change properties.",
        )
        if self.wall is not None:
            self._refuse_with(tuple(given), "wall", "the wall is already given")
            if self.wall.diameter not in (None, self.diameter):
                raise CaseProblem(
                    ("wall", "diameter"),
                    got=f"{self.wall.diameter:g} m in a line of {self.diameter:g} m",
                    expected="the diameter of the line",
                    hint="give both the same.",
                )
        return self

    @property
    def parts(self) -> int:
        """Number of segments in use."""
        return self.segments or _PARTS[self.friction]

    def wave_speed(self, fluid: NetworkFluid, pressure: float | None = None) -> float:
        """Speed of pressure waves [m/s], lowered by the wall: ``1/a^2 + rho D / (E s)``.

        ``pressure`` [Pa], absolute, is by default that of the line.
        """
        about = self.pressure if pressure is None else pressure
        if about is None:
            raise InputError(
                "Line.wave_speed: pressure",
                got="none",
                expected="the pressure of the linear waves",
                hint="give it here or to the line; in a network it is that of its ends.",
            )
        return float(self._speeds(fluid, about))

    def _speeds(self, fluid: NetworkFluid, pressure: ArrayLike) -> NDArray[np.float64]:
        slowness = fluid.sound_speed(pressure) ** -2.0
        if self.wall_modulus is not None and self.wall_thickness is not None:
            stretch = self.diameter / (self.wall_modulus * self.wall_thickness)
            slowness = slowness + fluid.density(pressure) * stretch
        if self.wall is not None:
            slowness = slowness + fluid.density(pressure) * self.wall.area_compliance
        return np.asarray(1.0 / np.sqrt(slowness))

    def echo_time(self, fluid: NetworkFluid, pressure: float | None = None) -> float:
        """``2 L / a`` [s], after which an end hears of the other one."""
        return 2.0 * self.length / self.wave_speed(fluid, pressure)

    def working_pressure(self, rows: Rows) -> float:
        """Pressure [Pa] for the properties of the line: given, or the higher one of its ends.

        An end with a stated start pressure comes before one that begins in steady flow, which is
        not known yet.
        """
        if self.pressure is not None:
            return self.pressure
        known = [rows.nodes.get(rows.port(port)) for port in self.ports]
        ends = [end for end in known if end is not None]
        stated = [end for end in ends if end.stated]
        return max((end.at_start for end in stated or ends), default=rows.ambient.pressure)

    def add_rows(self, rows: Rows) -> None:
        """Add the delay line, or the row of its cells."""
        fluid = network_fluid(rows)
        if self.properties == "local":
            rows.waves.append(self._local().row(rows, self._speeds))
            return
        pressure = self.working_pressure(rows)
        self._require_liquid(rows, fluid, pressure)
        rho = float(fluid.density(pressure))
        # the network counts P = rho_ref g and q = mdot / rho_ref, with rho_ref at ambient pressure
        scale = (float(fluid.density(rows.ambient.pressure)) / rho) ** 2
        a, viscosity = self.wave_speed(fluid, pressure), float(fluid.viscosity(pressure))
        resistance = scale * laminar_resistance(self.length, self.diameter, viscosity)
        gain, rate = unsteady_terms(
            KAGAWA,
            resistance=resistance,
            diameter=self.diameter,
            kinematic_viscosity=viscosity / rho,
        )
        memory = self.friction in {"kagawa", "turbulent"} and viscosity > 0.0
        turbulent = self.friction == "turbulent" and viscosity > 0.0
        for begin, end, share in self._pieces(rows, viscosity, turbulent=turbulent):
            rows.line(
                a=begin,
                b=end,
                delay=share * self.length / a,
                impedance=scale * rho * a / (0.25 * pi * self.diameter**2),
                segments=1 if turbulent else self.parts,
                resistance=0.0 if turbulent or self.friction == "none" else resistance,
                unsteady_gain=share * gain if memory else (),
                unsteady_rate=rate if memory else (),
                vapour_pressure=fluid.vapour_pressure,
                laminar_flow=self._laminar_flow(rows, fluid, viscosity),
            )
        rows.limits += self._limits(rows, fluid, pressure)

    def _error(self, fluid: NetworkFluid, pressure: float, p: ArrayLike) -> NDArray[np.float64]:
        """Larger one of the errors of speed and impedance, ``a / rho`` as the network counts it."""
        at = np.append(np.asarray(p, dtype=float).ravel(), pressure)
        speed = self._speeds(fluid, at)
        both = [q[-1] / q[:-1] - 1.0 for q in (speed, speed / fluid.density(at))]
        return np.asarray(np.max(np.abs(both), axis=0))

    def _require_liquid(self, rows: Rows, fluid: NetworkFluid, pressure: float) -> None:
        """Reject a line below boiling, where linear waves would have the speed in vapour."""
        if pressure >= fluid.all_liquid_from:
            return
        found = "" if self.pressure is not None else ", the higher start pressure of its ends"
        raise CaseProblem(
            ("components", rows.component, *(["pressure"] if self.pressure is not None else [])),
            got=f"{value_text(pressure, 'Pa')}{found}",
            expected=f"at least {value_text(fluid.all_liquid_from, 'Pa')}, where '{fluid.name}' "
            f"of {fluid.temperature - 273.15:.4g} degC has no vapour left",
            hint=f"give components.{rows.component}.pressure the working pressure of the relevant "
            "waves; pressures are absolute.",
        )

    def _laminar_flow(self, rows: Rows, fluid: NetworkFluid, viscosity: float) -> float:
        """Flow of Re = 2300 as the network counts it; infinite without laminar friction."""
        if self.friction not in ("steady", "kagawa") or viscosity <= 0.0:
            return inf
        reference = float(fluid.density(rows.ambient.pressure))
        return LAMINAR * 0.25 * pi * self.diameter * viscosity / reference

    def _local(self) -> LocalLine:
        stretch = 0.0 if self.wall is None else self.wall.area_compliance
        if self.wall_modulus is not None and self.wall_thickness is not None:
            stretch = self.diameter / (self.wall_modulus * self.wall_thickness)
        return LocalLine(
            length=self.length,
            diameter=self.diameter,
            stretch=stretch,
            friction=self.friction,
            roughness=self.roughness or 0.0,
            cells=self.cells or _CELLS,
        )

    def _pieces(
        self, rows: Rows, viscosity: float, *, turbulent: bool
    ) -> list[tuple[int, int, float]]:
        """Nodes and share of each piece; between them equal lumps of turbulent friction."""
        begin, last = rows.port("a"), rows.port("b")
        if not turbulent:
            return [(begin, last, 1.0)]
        part = PipeFriction(
            length=self.length / self.parts,
            diameter=self.diameter,
            roughness=self.roughness or 0.0,
        )
        pieces, share = [], 0.5 / self.parts
        for k in range(1, self.parts + 1):
            before = rows.inner_junction(f"before friction {k}")
            after = rows.inner_junction(f"behind friction {k}")
            part.add_between(rows, before, after, viscosity, label=f"friction {k}")
            pieces.append((begin, before, share))
            begin, share = after, 1.0 / self.parts
        return [*pieces, (begin, last, 0.5 / self.parts)]

    def _limits(self, rows: Rows, fluid: NetworkFluid, pressure: float) -> list[LimitRow]:
        """Pressures at the ends for which its one wave speed and impedance hold."""

        def effect(p: float) -> str:
            speeds = [self.wave_speed(fluid, x) for x in (pressure, p)]
            off = percent_text(float(self._error(fluid, pressure, p)[0]))
            return (
                f"Its waves run at {speeds[0]:.4g} m/s, but waves at {1e-5 * p:.4g} bar run at "
                f"{speeds[1]:.4g} m/s: echo times, pressures of flow changes and the stored "
                f"fluid are then wrong by up to {off}."
            )

        if isinstance(fluid, Fluid):
            valid = _kept_range(self, fluid, pressure)
        else:  # of the user's own
            valid = _followed(self, fluid, pressure)
        nodes = {rows.port(port) for port in self.ports} & rows.nodes.keys()
        return [
            LimitRow(
                component=rows.component,
                quantity="pressure at an end",
                unit="Pa",
                valid=valid,
                law=f"the line '{rows.component}' with the fluid of {1e-5 * pressure:.4g} bar",
                effect=effect,
                advice=f"give components.{rows.component}.pressure the working pressure of "
                "the relevant waves, or let its properties follow the pressure with properties: "
                "local.",
                key="pressure",
                node=node,
            )
            for node in sorted(nodes)
        ]


@lru_cache(maxsize=100)
def _kept_range(line: Line, fluid: Fluid, pressure: float) -> tuple[float, float]:
    return _followed(line, fluid, pressure)


def _followed(line: Line, fluid: NetworkFluid, pressure: float) -> tuple[float, float]:
    """Pressures about that of a line for which its one speed and impedance hold."""
    boiling = fluid.all_liquid_from  # below it the line opens a cavity of its own
    below = np.geomspace(min(boiling, pressure), pressure, _LOOKED_AT)
    above = np.geomspace(pressure, max(HIGHEST_PRESSURE, 2.0 * pressure), _LOOKED_AT)
    fits_below, fits_above = (line._error(fluid, pressure, p) <= _FOLLOWED for p in (below, above))
    low = 0.0 if fits_below.all() else float(below[np.flatnonzero(~fits_below)[-1] + 1])
    high = above[-1] if fits_above.all() else above[np.flatnonzero(~fits_above)[0] - 1]
    return low, float(high)
