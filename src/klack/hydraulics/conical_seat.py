r"""Conical seat with two ends and a needle with an edge: the narrowest section moves."""

from collections.abc import Mapping
from math import degrees, pi, sqrt
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from klack.compiling.jit import inner
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.narrowest_mantle import narrowest_mantle
from klack.hydraulics.needle_contour import NeedleContour
from klack.hydraulics.network_fluid import ambient_viscosity, viscosity_law
from klack.hydraulics.opening import OpeningComponent
from klack.hydraulics.orifice import NOT_CHOKED
from klack.hydraulics.seat import gap_pass
from klack.input.problem import CaseProblem
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Angle, Area, Length

__all__ = ["ConicalSeat", "conical_seat_step", "conical_seat_under_pressure_step"]

_FAR = 100.0  # length of the shank over the diameter of the seat
_PARALLEL = 1e-9  # between chamfer and seat [rad]


@inner(error_model="numpy")
def _pass(par: Any, state: Any, inp: Any, out: Any, law: int, base: int) -> None:
    x = max(par[4] + 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]), 0.0)
    area, radius = narrowest_mantle(par, base, x)
    gap = area / par[1]
    gap_pass(par, state, inp, out, x, area, gap, gap * gap * gap, law)
    out[10] = 2.0 * radius if area <= par[5] else 0.0


@step_function
def conical_seat_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the mean lift of the step, and the forces of the flow.

    ``par``: 0 unused, 1 circumference of the seal, 2-3 unused, 4-15 those of
    :func:`~klack.hydraulics.seat.seat_step`, from 16 on the contours for
    :func:`~klack.hydraulics.narrowest_mantle.narrowest_mantle`.
    ``state``: those of the seat, and the acting diameter.
    """
    _pass(par, state, inp, out, 0, 16)
    return 0


@step_function
def conical_seat_under_pressure_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Step of :func:`conical_seat_step` with ``par``: 16-17 the law, 18 on the contours."""
    _pass(par, state, inp, out, 16, 18)
    return 0


class ConicalSeat(OpeningComponent):
    r"""Restriction between a conical seat of finite length and a needle that seals with an edge.

    .. math:: A(x) = \min_{P, Q}\ \pi (r_P + r_Q)\,|PQ|, \qquad h = \frac{A}{\pi d_s}, \qquad
              |p_a - p_b| = a Q + b Q^2

    ``P`` on the contour of the needle, ``Q`` on the seat between both of its ends, ``x`` the lift,
    ``A`` at most the area of the bore at the lower end; ``a`` and ``b`` are those of a ``seat``.
    The tip of the needle is blunter than the seat and the shank above the edge is steeper, so that
    the edge seals: sharp, with a chamfer, or rounded.  While it lifts, the narrowest section moves
    from the edge to the upper end of the seat, or to its lower end and the tip of the needle.

    The channel ``acting diameter`` is that of the needle at the narrowest section: there the
    pressure steps from one side to the other.  Closed it is the sealing diameter, which the
    ``pressure-face`` of both sides take; it is 0 where the bore is the narrowest section.

    Limits: concentric, quasi-steady, rigid; of two narrow sections only the narrower one counts.
    The faces keep their diameters: the shift of the acting diameter is not part of the force.  The
    contours beyond the ends of the seat must be wider than those ends.  The taper of the gap beside
    the edge adds no viscous resistance of its own (``land_width``).
    Sources: elementary geometry (areas); Merritt 1967, ch. 3 and 5 (flow, jet).
    """

    type: ClassVar[str] = "conical-seat"
    ports: ClassVar[Mapping[str, Port]] = {
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
            self._refuse_with(("chamfer_width",), "edge_radius", "an edge is rounded or chamfered")
        self._check_angles()
        self._check_edge()
        return self

    def _check_angles(self) -> None:
        seat = degrees(self.half_angle)
        if self.half_angle >= pi / 2:
            raise CaseProblem(
                ("half_angle",),
                got=f"{seat:g} deg",
                expected="less than 90 deg, measured from the axis",
                hint="half of the angle in a drawing; a flat seat is a seat with shape: flat.",
            )
        if self.tip_half_angle <= self.half_angle:
            raise CaseProblem(
                ("tip_half_angle",),
                got=f"{degrees(self.tip_half_angle):g} deg",
                expected=f"more than the {seat:g} deg of the seat: the tip must leave it below "
                "the edge",
                hint="swap both angles; a tip that is steeper than its seat touches the upper end "
                "of the seat: that is a seat with shape: cone.",
            )
        if self.shank_half_angle >= self.half_angle:
            raise CaseProblem(
                ("shank_half_angle",),
                got=f"{degrees(self.shank_half_angle):g} deg",
                expected=f"less than the {seat:g} deg of the seat: the shank must leave it above "
                "the edge",
                hint="0 deg is a cylinder; angles are measured from the axis.",
            )
        chamfer = self.chamfer_half_angle
        if chamfer is None:
            return
        if not self.shank_half_angle < chamfer < self.tip_half_angle:
            raise CaseProblem(
                ("chamfer_half_angle",),
                got=f"{degrees(chamfer):g} deg",
                expected=f"between those of shank and tip, {degrees(self.shank_half_angle):g} and "
                f"{degrees(self.tip_half_angle):g} deg",
                hint="measured from the axis, like all of them.",
            )
        if abs(chamfer - self.half_angle) < _PARALLEL:
            raise CaseProblem(
                ("chamfer_half_angle",),
                got=f"{degrees(chamfer):g} deg, parallel to the seat",
                expected="another angle than that of the seat: a land has no sealing diameter",
                hint="a parallel land is a seat with shape: cone, its land_width and a land-face.",
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
        if not self.lower_diameter < seal < self.upper_diameter:
            raise CaseProblem(
                ("edge_diameter",),
                got=f"a needle that meets the cone at {1e3 * seal:g} mm",
                expected=f"between the ends of the seat, {1e3 * self.lower_diameter:g} and "
                f"{1e3 * self.upper_diameter:g} mm",
                hint="check the diameters and their units; an end of the seat that seals is a seat "
                "with shape: cone.",
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
        """Where the closed needle touches the seat [m]: that of the pressure faces."""
        return 2.0 * self.contour.seal(self.half_angle)[0]

    @property
    def contours(self) -> tuple[float, ...]:
        """Numbers of both contours, closed."""
        lower, upper = 0.5 * self.lower_diameter, 0.5 * self.upper_diameter
        return self.contour.numbers(self.half_angle, lower, upper)

    def opening(self, lift: float) -> tuple[float, float]:
        """Flow area [m^2] and acting diameter [m] at a lift [m]; a negative one is closed."""
        area, radius = narrowest_mantle(np.array(self.contours), 0, max(lift, 0.0))
        bore = pi / 4.0 * self.lower_diameter**2
        return (float(area), 2.0 * float(radius)) if area <= bore else (bore, 0.0)

    def parameters(self, viscosity: float, vapour_pressure: float) -> tuple[float, ...]:
        """First 16 that :func:`conical_seat_step` takes, for a viscosity [Pa s] and pressure [Pa].

        They are those of a ``seat`` but for its shape.
        """
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
        law = viscosity_law(rows)
        rows.branch(
            conical_seat_step if law is None else conical_seat_under_pressure_step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("needle"), rows.port("body")),
            parameters=(
                *self.parameters(viscosity, fluid.vapour_pressure),
                *(law.numbers if law else ()),
                *self.contours,
            ),
            state=(self.lift, 0.0, 0.0, 0.0, 0.0, self.sealing_diameter),
            channels=(
                Channel("lift", "m", 0, derived=True),
                Channel("area", "m^2", 1, derived=True),
                Channel("jet force", "N", 2, derived=True),
                Channel("acting diameter", "m", 5, derived=True),
            ),
        )
