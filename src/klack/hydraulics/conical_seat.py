r"""Conical seat with two ends and a needle with an edge: the narrowest section moves."""

from math import degrees, pi, sqrt
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.errors import InputError
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.narrowest_mantle import acting_area, narrowest_mantle
from klack.hydraulics.needle_contour import NeedleContour
from klack.hydraulics.network_fluid import ambient_viscosity, viscosity_law
from klack.hydraulics.opening import OpeningComponent
from klack.hydraulics.orifice import NOT_CHOKED
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.seat import gap_pass
from klack.input.problem import CaseProblem, refuse_key_if
from klack.machine.compiling.jit import inner
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Angle, Area, Length

__all__ = [
    "ConicalSeat",
    "acting_seat_step",
    "conical_seat_step",
]

_FAR = 100.0  # length of the shank over the diameter of the seat
_PARALLEL = 1e-9  # between chamfer and seat [rad]
_MET = 2e-3  # a diameter with four digits is that of the seat [-]


@inner(error_model="numpy")
def _pass(par: Any, state: Any, inp: Any, out: Any, base: int) -> None:
    """Pass of the seat; ``base``: place of the contours in ``par``."""
    x = max(par[4] + 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]), 0.0)
    area, radius = narrowest_mantle(par, base, x)
    gap = area / par[1]
    gap_pass(par, state, inp, out, x, area, gap, gap * gap * gap)
    out[10] = 2.0 * radius if area <= par[5] else 0.0


@step_function
def conical_seat_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the mean lift of the step, and the forces of the flow.

    ``par``: 1 circumference of the seal, 4-17 those of :func:`~klack.hydraulics.seat.seat_step`,
    from 18 on the contours for :func:`~klack.hydraulics.narrowest_mantle.narrowest_mantle`.
    ``state``: those of the seat, and the acting diameter.
    """
    _pass(par, state, inp, out, 18)
    return 0


@step_function
def acting_seat_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Step of :func:`conical_seat_step` that corrects the faces by the acting area.

    ``par``: 18 side of the tip, 19 acting area when closed, 20 point of the edge, 21 on the
    contours.  ``state``: one more, the force of the shift.
    """
    _pass(par, state, inp, out, 21)
    p_a, p_b, rho_a, rho_b = inp[2], inp[3], inp[4], inp[5]
    side, edge = par[18], int(par[20])  # 1: the tip is at b, -1: at a
    area = acting_area(par, 21, edge, out[5], par[5])
    more = area - par[19]
    shift = more * side * (p_b - p_a)
    out[3] += shift
    out[4] -= shift
    if inp[1] > 0.0:
        moved = inp[7] - inp[6] - inp[9] + inp[8]
        displaced = -side * more * moved / inp[1]  # from a to b
        out[0] += displaced * (rho_a if displaced >= 0.0 else rho_b)
    out[10], out[11] = sqrt(4.0 * area / pi), shift
    return 0


class ConicalSeat(OpeningComponent):
    r"""Restriction between a conical seat of finite length and a needle that seals with an edge.

    .. math:: A(x) = \min_{P, Q}\ \pi (r_P + r_Q)\,|PQ|, \qquad h = \frac{A}{\pi d_s}, \qquad
              |p_a - p_b| = a Q + b Q^2

    with ``P`` on the contour of the needle, ``Q`` on the seat between its ends, the lift ``x``, and
    ``A`` at most the area of the bore at the lower end; ``a`` and ``b`` are those of a ``seat``.
    The tip is blunter than the seat and the shank is steeper, so that the edge seals: sharp, with a
    chamfer, or rounded.  With the lift the narrowest section moves from the edge to the upper end
    of the seat, or to its lower end and the tip.

    The channel ``acting diameter`` is that of the needle at the narrowest section, where the
    pressure steps: closed the sealing diameter, which the ``pressure-face`` of both sides take, and
    0 where the bore is narrowest.

    With ``tip_side`` the pressure faces follow: the seat adds to their force, of constant area,

    .. math:: F = (S(x) - S(0))\,(p_{tip} - p_{shank}), \qquad Q = (S(x) - S(0))\,\dot x

    with the acting area ``S`` of :mod:`~klack.hydraulics.narrowest_mantle`, and takes the volume
    ``Q`` that this area sweeps from the side of the tip to the other one (virtual work).  The
    channel ``acting diameter`` is then that of ``S``.

    Limits: concentric, quasi-steady, rigid; of two narrow sections only the narrower one counts for
    the flow.  Without ``tip_side`` the faces keep their diameters.  The contours beyond the ends of
    the seat must be wider than those ends.  The taper of the gap beside the edge adds no viscous
    resistance of its own (``land_width``).
    Sources: elementary geometry (areas); Merritt 1967, ch. 3 and 5 (flow, jet).
    """

    type: ClassVar[str] = "conical-seat"
    ports: ClassVar = {
        "a": FLOW,
        "b": FLOW,
        "needle": ELEMENT,
        "body": Port("mechanical", Role.ELEMENT, optional=True),
    }

    half_angle: Angle = Field(
        gt=0, examples=["30 deg"], description="Of the seat: between axis and surface."
    )
    lower_diameter: Length = Field(
        gt=0, examples=["1 mm"], description="Of the seat at its lower end, that of the bore."
    )
    upper_diameter: Length = Field(
        gt=0, examples=["2.4 mm"], description="Of the seat at its upper end."
    )
    edge_diameter: Length = Field(
        gt=0,
        examples=["2 mm"],
        description="Where the surfaces of tip and shank of the needle meet.",
    )
    tip_half_angle: Angle = Field(
        gt=0,
        le=pi / 2,
        examples=["31 deg"],
        description="Of the needle below the edge, larger than that of the seat; 90 deg: flat.",
    )
    shank_half_angle: Angle = Field(
        default=0.0,
        ge=0,
        description="Of the needle above the edge, smaller than that of the seat; 0: a cylinder.",
    )
    tip_diameter: Length = Field(default=0.0, ge=0, description="Of a blunt end of the tip.")
    edge_radius: Length | None = Field(
        default=None, gt=0, description="Of a rounded edge, tangent to tip and shank."
    )
    chamfer_half_angle: Angle | None = Field(
        default=None, gt=0, description="Of a chamfered edge, between those of tip and shank."
    )
    chamfer_width: Length | None = Field(
        default=None, gt=0, description="Of a chamfered edge, along its surface."
    )
    lift: Length = Field(default=0.0, ge=0, description="At the start.")
    land_width: Length = Field(
        default=0.0, ge=0, description="Of the narrow gap at the edge, along the flow."
    )
    leak_area: Area = Field(default=0.0, ge=0, description="When closed; 0 to 1 um^2.")
    flow_force: FlowForce | None = Field(default=None, description="Of the jet on the needle.")
    tip_side: Literal["a", "b"] | None = Field(
        default=None,
        description="Port at the tip of the needle: the pressure faces at both ports, which meet "
        "at the sealing diameter, then follow the acting diameter; default: they keep it.",
    )

    @model_validator(mode="after")
    def _edge_seals_on_the_cone(self) -> Self:
        if (self.chamfer_half_angle is None) != (self.chamfer_width is None):
            given = "width" if self.chamfer_half_angle is None else "half_angle"
            missing = "half_angle" if self.chamfer_half_angle is None else "width"
            raise CaseProblem(
                (),
                got=f"chamfer_{given} without chamfer_{missing}",
                expected="both, or none for a sharp edge",
                hint=f"add chamfer_{missing}.",
            )
        if self.edge_radius is not None:
            self._refuse_with(
                ("chamfer_width",), "edge_radius", "an edge is either rounded or chamfered"
            )
        self._check_angles()
        self._check_edge()
        return self

    def _check_angles(self) -> None:
        seat = degrees(self.half_angle)
        refuse_key_if(
            self.half_angle >= pi / 2,
            ("half_angle",),
            got=f"{seat:g} deg",
            expected="less than 90 deg, measured from the axis",
            hint="half of the angle in a drawing; a flat seat is a seat with shape: flat.",
        )
        refuse_key_if(
            self.tip_half_angle <= self.half_angle,
            ("tip_half_angle",),
            got=f"{degrees(self.tip_half_angle):g} deg",
            expected=f"more than the {seat:g} deg of the seat: the tip must leave it below "
            "the edge",
            hint="swap both angles; a tip steeper than its seat touches the upper end of "
            "the seat: describe that as a seat with shape: cone.",
        )
        refuse_key_if(
            self.shank_half_angle >= self.half_angle,
            ("shank_half_angle",),
            got=f"{degrees(self.shank_half_angle):g} deg",
            expected=f"less than the {seat:g} deg of the seat: the shank must leave it above "
            "the edge",
            hint="0 deg is a cylinder; angles are measured from the axis.",
        )
        chamfer = self.chamfer_half_angle
        if chamfer is None:
            return
        refuse_key_if(
            not self.shank_half_angle < chamfer < self.tip_half_angle,
            ("chamfer_half_angle",),
            got=f"{degrees(chamfer):g} deg",
            expected=f"between those of shank and tip, {degrees(self.shank_half_angle):g} and "
            f"{degrees(self.tip_half_angle):g} deg",
            hint="all angles are measured from the axis.",
        )
        refuse_key_if(
            abs(chamfer - self.half_angle) < _PARALLEL,
            ("chamfer_half_angle",),
            got=f"{degrees(chamfer):g} deg, parallel to the seat",
            expected="an angle other than that of the seat: a land has no sealing diameter",
            hint="describe a parallel land as a seat with shape: cone, with its land_width "
            "and a land-face.",
        )

    def _check_edge(self) -> None:
        start, blunt = 2e3 * self.contour.edge_start, 1e3 * self.tip_diameter
        if start <= blunt:
            given = ("chamfer_width", "edge_radius")
            name = next((key for key in given if getattr(self, key)), "tip_diameter")
            raise CaseProblem(
                (name,),
                got=f"an edge that begins at {start:g} mm on a tip that ends at {blunt:g} mm",
                expected="a tip of some length between its end and the edge",
                hint=f"make {name} smaller.",
            )
        seal = self.sealing_diameter
        refuse_key_if(
            not self.lower_diameter < seal < self.upper_diameter,
            ("edge_diameter",),
            got=f"a needle that meets the cone at {1e3 * seal:g} mm",
            expected=f"between the ends of the seat, {1e3 * self.lower_diameter:g} and "
            f"{1e3 * self.upper_diameter:g} mm",
            hint="check the diameters and their units; if an end of the seat seals, use a "
            "seat with shape: cone.",
        )

    @property
    def contour(self) -> NeedleContour:
        """Contour of the needle."""
        chamfer = None
        if self.chamfer_half_angle is not None and self.chamfer_width is not None:
            chamfer = (self.chamfer_half_angle, self.chamfer_width)
        return NeedleContour.of(
            0.5 * self.edge_diameter,
            self.tip_half_angle,
            self.shank_half_angle,
            _FAR * self.upper_diameter,
            tip_radius=0.5 * self.tip_diameter,
            rounding=self.edge_radius or 0.0,
            chamfer=chamfer,
        )

    @property
    def sealing_diameter(self) -> float:
        """Diameter [m] of contact and of the pressure faces."""
        return 2.0 * self.contour.seal(self.half_angle)[0]

    @property
    def contours(self) -> tuple[float, ...]:
        """Numbers of both contours, closed."""
        lower, upper = 0.5 * self.lower_diameter, 0.5 * self.upper_diameter
        return self.contour.numbers(self.half_angle, lower, upper)

    def opening(self, lift: float) -> tuple[float, float]:
        """Flow area [m^2] and acting diameter [m] at a lift [m], closed below zero."""
        area, radius = narrowest_mantle(np.array(self.contours), 0, max(lift, 0.0))
        bore = pi / 4.0 * self.lower_diameter**2
        return (float(area), 2.0 * float(radius)) if area <= bore else (bore, 0.0)

    def parameters(self, viscosity: float, vapour_pressure: float) -> tuple[float, ...]:
        """First 16 of :func:`conical_seat_step`, those of a ``seat`` but for its shape."""
        contraction = NOT_CHOKED if self.cavitation is None else self.cavitation
        leak_size = sqrt(4.0 * self.leak_area / pi)
        force, around = self.flow_force, pi * self.sealing_diameter
        return (
            0.0,
            around,
            0.0,
            0.0,
            self.lift,
            pi / 4.0 * self.lower_diameter**2,
            self.discharge,
            12.0 * viscosity * self.land_width / around,
            self.critical_flow_number * viscosity / 8.0,
            contraction,
            vapour_pressure,
            self.discharge * self.leak_area,
            2.0 * leak_size / (viscosity * self.critical_flow_number),
            contraction * self.leak_area,
            force.momentum(self.half_angle) if force else 0.0,
            force.damping_length if force else 0.0,
        )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that pushes needle and body."""
        fluid, viscosity = ambient_viscosity(rows)
        follows = self.tip_side is not None
        if follows:
            self._check_faces(rows)
        rows.branch(
            acting_seat_step if follows else conical_seat_step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("needle"), rows.port("body")),
            parameters=(
                *self.parameters(viscosity, fluid.vapour_pressure),
                *viscosity_law(rows).numbers,
                *(self._acting_parameters() if follows else ()),
                *self.contours,
            ),
            state=(self.lift, 0.0, 0.0, 0.0, 0.0, self.sealing_diameter, *([0.0] * follows)),
            channels=(
                Channel("lift", "m", 0, derived=True),
                Channel("area", "m^2", 1, derived=True),
                Channel("jet force", "N", 2, derived=True),
                Channel("acting diameter", "m", 5, derived=True),
                *([Channel("shift force", "N", 6, derived=True)] * follows),
            ),
        )

    def acting_area(self, lift: float) -> float:
        """Area [m^2] on which the tip pressure acts, at a lift [m] of zero or more."""
        bore = pi / 4.0 * self.lower_diameter**2
        return float(acting_area(np.array(self.contours), 0, self.contour.edge_point, lift, bore))

    def _acting_parameters(self) -> tuple[float, float, float]:
        side = 1.0 if self.tip_side == "b" else -1.0
        return side, self.acting_area(0.0), float(self.contour.edge_point)

    def _check_faces(self, rows: Rows) -> None:
        """Reject faces whose diameter is not the one that the correction counts from."""
        seal = self.sealing_diameter
        for port in ("a", "b"):
            at_tip = port == self.tip_side
            faces = [
                part
                for part in rows.partner(port)
                if isinstance(part, PressureFace) and part.direction == "opening"
            ]
            edges = [f.outer_diameter if at_tip else f.inner_diameter for f in faces]
            given = [edge for edge in edges if edge]
            unknown = any(face.area is not None for face in faces)
            met = any(abs(edge - seal) <= _MET * seal for edge in given)
            if met or unknown or not (at_tip or given):
                continue
            name = "outer_diameter" if at_tip else "inner_diameter"
            told = " and ".join(f"{1e3 * edge:.6g} mm" for edge in given)
            raise InputError(
                f"components.{rows.component}.tip_side",
                got=f"{name} {told} of the pressure faces at port {port}"
                if given
                else f"no pressure-face with direction: opening at port {port}",
                expected=f"a pressure-face with {name}: {1e3 * seal:.6g} mm, the sealing "
                "diameter, from which this seat follows the lift itself",
                hint=f"give the face that {name}, or leave tip_side out, which keeps the "
                "diameters of the faces; for the other port at the tip write tip_side: "
                f"{'a' if self.tip_side == 'b' else 'b'}.",
            )
