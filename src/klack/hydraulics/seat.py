r"""Seat: the restriction that a needle opens and closes."""

from math import acos, cos, inf, pi, sin, sqrt
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.network_fluid import ambient_viscosity, viscosity_law
from klack.hydraulics.off_axis_opening import off_axis_opening
from klack.hydraulics.off_axis_seat import SeatFace, SeatShape
from klack.hydraulics.orifice import (
    NOT_CHOKED,
    choked_flow,
    orifice_flow,
)
from klack.hydraulics.pressure_viscosity import CONSTANT, PressureViscosity, mean_viscosity_ratio
from klack.hydraulics.seat_across import SeatAcross, SeatPlace
from klack.input.problem import CaseProblem, refuse_key_if
from klack.machine.compiling.jit import inner, njit
from klack.network.across import OffAxisPart
from klack.network.component import Component
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Angle, Area, Length, Ratio

__all__ = ["Seat", "ball_opening", "cone_opening", "flat_opening", "gap_flow", "gap_pass"]

_FLAT, _CONE, _BALL = 0.0, 1.0, 2.0
_KINDS = {"flat": _FLAT, "cone": _CONE, "ball": _BALL}


@njit(error_model="numpy")
def flat_opening(x: float, r: float) -> tuple[float, float]:
    """Area [m^2] and gap [m] of a flat face at lift ``x`` over an edge of radius ``r`` [m]."""
    return 2.0 * pi * r * x, x


@njit(error_model="numpy")
def cone_opening(x: float, r: float, s: float, c: float) -> tuple[float, float]:
    """Area and normal gap of a cone in a sharp edge of radius ``r``; sine and cosine of its angle.

    The area is the frustum between the edge and its foot on the cone, constant from the lift on at
    which that foot is on the axis.
    """
    gap = x * s
    if gap * c > r:
        return pi * r * r / c, gap
    return pi * gap * (2.0 * r - gap * c), gap


@njit(error_model="numpy")
def ball_opening(x: float, r: float, R: float, x0: float) -> tuple[float, float]:
    """Area and gap of a ball of radius ``R`` in a sharp edge; ``x0 = sqrt(R^2 - r^2)``."""
    rise = x * (x + 2.0 * x0)
    distance = sqrt(r * r + (x + x0) * (x + x0))
    return pi * r * rise / distance, rise / (distance + R)


@njit(error_model="numpy")
def gap_flow(drop: float, linear: float, square: float) -> tuple[float, float]:
    r"""Flow [m^3/s] through a gap and an edge in series, and its slope with the drop.

    .. math:: \Delta p = a Q + b Q|Q| \quad\Longrightarrow\quad
              |Q| = \frac{2|\Delta p|}{a + \sqrt{a^2 + 4 b |\Delta p|}}, \qquad
              \frac{dQ}{d\Delta p} = \frac{1}{\sqrt{a^2 + 4 b |\Delta p|}}

    Smooth and monotone, without cancellation.

    Parameters
    ----------
    drop [Pa]
    linear, square [Pa s/m^3], [Pa s^2/m^6]
        ``a``, above zero, and ``b``.
    """
    root = sqrt(linear * linear + 4.0 * square * abs(drop))
    return 2.0 * drop / (linear + root), 1.0 / root


@inner(error_model="numpy")
def _opening(kind: float, x: float, r: float, g1: float, g2: float) -> tuple[float, float]:
    if kind == _CONE:
        return cone_opening(x, r, g1, g2)
    if kind == _BALL:
        return ball_opening(x, r, g1, g2)
    return flat_opening(x, r)


@inner(error_model="numpy")
def gap_pass(
    par: Any,
    state: Any,
    inp: Any,
    out: Any,
    x: float,
    area: float,
    gap: float,
    cube: float,
) -> None:
    """Flow through an opening at the lift ``x``, and the forces of the flow.

    ``area`` of the mantle, ``gap`` of its edge, ``cube`` that of the land to the third power;
    ``par`` from 5 on and ``state`` as of :func:`seat_step`.
    """
    p_a, p_b, rho_a, rho_b = inp[2], inp[3], inp[4], inp[5]
    area = min(area, par[5])
    flow = up = down = 0.0
    forward = p_a >= p_b
    density = rho_a if forward else rho_b
    if area > 0.0 and gap > 1e-12:
        conductance = par[6] * area
        linear = par[7] / cube + par[8] / (conductance * gap)
        square = 0.5 * density / (conductance * conductance)
        p_up, p_down = (p_a, p_b) if forward else (p_b, p_a)
        ratio, by_up, by_down = mean_viscosity_ratio(p_up, p_down, par[16], par[17])
        volume, slope = gap_flow(abs(p_a - p_b), ratio * linear, square)
        slope *= density
        flow, up, down = choked_flow(
            density * volume,
            slope * (1.0 - linear * volume * by_up),
            -slope * (1.0 + linear * volume * by_down),
            p_up,
            density,
            par[9] * area,
            par[10],
        )
    jet = -par[14] * flow * flow / (density * par[6] * area) if flow > 0.0 else 0.0
    if forward:
        out[0], out[1], out[2] = flow, up, down
    else:
        out[0], out[1], out[2] = -flow, -down, -up
    push = jet
    if par[15] != 0.0 and state[4] > 0.0 and inp[1] > 0.0:
        push -= par[15] * (out[0] - state[3]) / inp[1]
    out[3], out[4] = push, -push
    out[5], out[6], out[7], out[8], out[9] = x, area, jet, out[0], 1.0
    if par[11] > 0.0:
        flow, up, down = orifice_flow(
            p_a, p_b, rho_a, rho_b, par[11], par[12], par[13], par[10], par[16], par[17]
        )
        out[0] += flow
        out[1] += up
        out[2] += down


@step_function
def seat_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the mean lift of the step, and the forces of the flow.

    ``par``: 0 kind, 1 radius, 2-3 shape, 4 lift at the start, 5 largest area, 6 ``C_q``, 7
    ``12 mu w/(pi d)``, 8 ``lambda_c mu/8``, 9 contraction, 10 vapour pressure, 11-13 leak
    (conductance, number, throat), 14 ``C_v cos(theta)``, 15 damping length, 16-17 viscosity law.
    ``state``: lift, area, jet force, mass flow, 1 once that flow is known.
    """
    x = max(par[4] + 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]), 0.0)
    area, gap = _opening(par[0], x, par[1], par[2], par[3])
    gap_pass(par, state, inp, out, x, area, gap, gap * gap * gap)
    return 0


@step_function
def off_axis_seat_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Step of a seat whose needle is off-axis or tilted.

    ``par``, behind that of :func:`seat_step`: 18-19 sine and cosine of the angle of the face, 20-21
    offset, 22-23 slopes of the face.
    """
    x = par[4] + 0.5 * (inp[6] + inp[7] - inp[8] - inp[9])
    area, gap, cube = off_axis_opening(
        par[0], par[1], par[18], par[19], x, par[20], par[21], par[22], par[23]
    )
    gap_pass(par, state, inp, out, max(x, 0.0), area, gap, cube)
    return 0


class Seat(Component):
    r"""Restriction between a needle and its seat, opened by the lift.

    .. math:: |p_a - p_b| = a Q + b Q^2, \qquad
              a = \frac{12 \mu w}{\pi d h^3} + \frac{\lambda_c \mu}{8 C_q A h}, \qquad
              b = \frac{\varrho}{2 (C_q A)^2}

    with the lift ``x = lift_0 + y_needle - y_body``, never below zero, the area ``A(x)`` between
    both surfaces, not above that of the bore, and the gap ``h(x)`` normal to them.  The first term
    of ``a`` is the land of width ``w``, the second lets a sharp edge turn laminar at rest like an
    :class:`~klack.hydraulics.orifice.Orifice` of hydraulic diameter ``2 h`` (its slope, not its
    hyperbolic tangent: resistances in series stay one smooth monotone law).

    =====  ===============================================  =================================
    shape  area                                             gap
    =====  ===============================================  =================================
    flat   ``2 pi r x``                                     ``x``
    cone   ``pi x sin(al) (2 r - x sin(al) cos(al))``       ``x sin(al)``
    ball   ``pi r x (x + 2 x0) / sqrt(r^2 + (x + x0)^2)``   ``sqrt(r^2 + (x + x0)^2) - R``
    =====  ===============================================  =================================

    ``al`` is the angle between axis and cone surface, ``x0 = sqrt(R^2 - r^2)``.  Closed, only the
    leak area is left, an orifice in parallel.  Positive flow runs from a to b; the cavitation limit
    is that of an orifice.

    With ``off_axis``, for a needle that moves in three dimensions, area and gap are those where the
    needle is (:mod:`~klack.hydraulics.off_axis_seat`), and the pressure pushes it across the axis.

    With ``viscosity_law`` of the fluid, ``mu`` is the mean between both pressures.

    Limits: concentric without that section, quasi-steady (no inertia of the fluid in the gap),
    rigid.
    Sources: Merritt 1967, ch. 3 and 5; areas by elementary geometry.
    """

    type: ClassVar[str] = "seat"
    ports: ClassVar = {
        "a": FLOW,
        "b": FLOW,
        "needle": ELEMENT,
        "body": Port("mechanical", Role.ELEMENT, optional=True),
    }

    shape: SeatShape = Field(description="flat, cone or ball: the surface of the needle.")
    diameter: Length = Field(gt=0, description="Of the edge of the seat.")
    half_angle: Angle | None = Field(
        default=None, gt=0, description="Of a cone: between its axis and its surface."
    )
    ball_diameter: Length | None = Field(default=None, gt=0, description="Of a ball.")
    bore_diameter: Length | None = Field(
        default=None,
        gt=0,
        description="Diameter of the bore, which limits the area; default: the seat diameter.",
    )
    lift: Length = Field(default=0.0, ge=0, description="At the start.")
    discharge: Ratio = Field(default=0.7, gt=0, le=1, description="Turbulent flow coefficient.")
    critical_flow_number: Ratio = Field(
        default=100.0, gt=0, description="Where laminar flow turns turbulent; 50 to 150."
    )
    land_width: Length = Field(default=0.0, ge=0, description="Of the narrow gap, along the flow.")
    leak_area: Area = Field(default=0.0, ge=0, description="When closed; 0 to 1 um^2.")
    cavitation: Ratio | None = Field(
        default=0.62,
        gt=0,
        le=1,
        description="Contraction of the cavitating jet; null: no cavitation limit.",
    )
    flow_force: FlowForce | None = Field(default=None, description="Of the jet on the needle.")
    off_axis: SeatPlace | None = Field(
        default=None,
        description="With motion: three-dimensional: opening and side force at the position of "
        "the needle; without it only those of its lift.",
    )

    @model_validator(mode="after")
    def _shape_has_its_numbers(self) -> Self:
        wanted = {"flat": None, "cone": "half_angle", "ball": "ball_diameter"}[self.shape]
        for name in ("half_angle", "ball_diameter"):
            refuse_key_if(
                name == wanted and getattr(self, name) is None,
                (),
                got=f"no key '{name}'",
                expected=f"{name}, since the shape is {self.shape}",
                hint=f"add {name}, or choose another shape.",
            )
            if name != wanted:
                self._refuse_with((name,), f"shape {self.shape}", "it has none")
        if self.half_angle is not None and self.half_angle >= pi / 2:
            raise CaseProblem(
                ("half_angle",),
                got=f"{self.half_angle * 180 / pi:g} deg",
                expected="less than 90 deg, measured from the axis",
                hint="half of the angle in a drawing; a flat seat has shape: flat.",
            )
        if self.ball_diameter is not None and self.ball_diameter <= self.diameter:
            raise CaseProblem(
                ("ball_diameter",),
                got=f"{self.ball_diameter:g} m in a seat of {self.diameter:g} m",
                expected="a ball larger than its seat",
                hint="check both diameters and their units.",
            )
        return self

    @property
    def surface_angle(self) -> float:
        """Angle between axis and needle surface at the edge [rad]."""
        if self.half_angle is not None:
            return self.half_angle
        return acos(self.diameter / self.ball_diameter) if self.ball_diameter else pi / 2

    def parameters(
        self, viscosity: float, vapour_pressure: float, law: PressureViscosity = CONSTANT
    ) -> tuple[float, ...]:
        """Parameters of :func:`seat_step` from viscosity [Pa s] and vapour pressure [Pa]."""
        r, bore = 0.5 * self.diameter, self.bore_diameter or self.diameter
        shape = (0.0, 0.0)
        if self.half_angle is not None:
            shape = (sin(self.half_angle), cos(self.half_angle))
        elif self.ball_diameter is not None:
            R = 0.5 * self.ball_diameter
            shape = (R, sqrt(R**2 - r**2))
        contraction = NOT_CHOKED if self.cavitation is None else self.cavitation
        leak_size = sqrt(4.0 * self.leak_area / pi)
        force = self.flow_force
        return (
            _KINDS[self.shape],
            r,
            *shape,
            self.lift,
            pi / 4.0 * bore**2,
            self.discharge,
            12.0 * viscosity * self.land_width / (pi * self.diameter),
            self.critical_flow_number * viscosity / 8.0,
            contraction,
            vapour_pressure,
            self.discharge * self.leak_area,
            2.0 * leak_size / (viscosity * self.critical_flow_number),
            contraction * self.leak_area,
            force.momentum(self.surface_angle) if force else 0.0,
            force.damping_length if force else 0.0,
            *law.numbers,
        )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that pushes needle and body."""
        fluid, viscosity = ambient_viscosity(rows)
        parameters = self.parameters(viscosity, fluid.vapour_pressure, viscosity_law(rows))
        step = seat_step
        if self.off_axis is not None:
            beta = self.surface_angle
            parameters = (*parameters, sin(beta), cos(beta), 0.0, 0.0, 0.0, 0.0)
            step = off_axis_seat_step
        rows.branch(
            step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("needle"), rows.port("body")),
            parameters=parameters,
            state=(self.lift, 0.0, 0.0, 0.0, 0.0),
            channels=(
                Channel("lift", "m", 0, derived=True),
                Channel("area", "m^2", 1, derived=True),
                Channel("jet force", "N", 2, derived=True),
            ),
        )
        if self.off_axis is not None:
            rows.side_of_branch(
                SeatAcross(
                    face=SeatFace.of(self),
                    height=self.off_axis.height,
                    lift=self.lift,
                    inside="ab".index(self.off_axis.inside),
                ),
                len(parameters) - 4,
            )

    def off_axis_parts(self) -> tuple[OffAxisPart, ...]:
        """The edge, if its place on the needle is given."""
        if self.off_axis is None:
            return ()
        heights = (self.off_axis.height,)
        return (OffAxisPart(key=("off_axis",), port="needle", heights=heights, room=inf),)
