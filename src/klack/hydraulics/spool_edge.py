r"""Metering edge of a spool: the restriction between its land and the sleeve."""

from collections.abc import Mapping
from math import inf, pi, radians, sqrt
from typing import Any, ClassVar, Literal

from pydantic import Field

from klack.hydraulics.annulus import eccentricity_factor
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.opening import OpeningComponent
from klack.hydraulics.orifice import NOT_CHOKED
from klack.hydraulics.seat import gap_pass
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Ratio

__all__ = ["JET_ANGLE", "SpoolEdge", "spool_edge_step"]

JET_ANGLE = radians(69.0)
"""Between jet and axis at a sharp edge without clearance (von Mises 1917) [rad]."""


@step_function
def spool_edge_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the mean position of the step, and the forces of the flow.

    ``par``: 0 sign of the motion that opens, 1 overlap, 2 width, 3 clearance, 4 unused, 5 largest
    area, 6 ``C_q``, 7 ``12 mu/(w c^3)`` of the closed gap, 8 ``lambda_c mu/8``, 9 contraction, 10
    vapour pressure, 11-13 no leak, 14 ``C_v cos(theta)``, 15 damping length.
    ``state``: opening, area, jet force, mass flow, 1 once that flow is known.
    """
    x = par[0] * 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]) - par[1]
    slot = max(x, 0.0)
    gap = sqrt(slot * slot + par[3] * par[3])
    covered = -x if x < 0.0 else 0.0
    gap_pass(par, state, inp, out, x, par[2] * gap, gap, 1.0 / covered if covered > 0.0 else inf, 0)
    jet = out[7] * par[0] * slot / gap
    out[3] += jet - out[7]
    out[4] -= jet - out[7]
    out[7] = jet
    return 0


class SpoolEdge(OpeningComponent):
    r"""Sharp edge of a spool that opens a slot in its sleeve.

    .. math:: A = w \sqrt{x^2 + c^2}\quad (x \ge 0), \qquad
              |p_a - p_b| = a Q + b Q^2, \qquad
              a = \frac{12 \mu\,\max(-x, 0)}{w c^3 (1 + \tfrac32\varepsilon^2)}
                  + \frac{\lambda_c \mu}{8 C_q A \sqrt{x^2 + c^2}}, \qquad
              b = \frac{\varrho}{2 (C_q A)^2}

    with the opening ``x = s (y_spool - y_body) - overlap``, the radial clearance ``c`` and the
    width ``w`` of the slots, ``pi d`` of a full annulus.  The slot runs aslant over the clearance,
    so its area is exactly that of the shortest surface between both edges.  Closed, the same edge
    of area ``w c`` and the covered length of the gap ``-x`` are in series: laminar leakage that
    falls with the overlap.  Flow and slopes are continuous at ``x = 0``.

    The jet pulls the spool shut with ``rho Q v cos(theta)``, as in a ``seat``; its angle is 69
    degrees by default, and the force fades with ``x/sqrt(x^2 + c^2)`` where the slot is narrower
    than the clearance.  A negative ``overlap`` is an underlap.

    Limits: sharp edges, coaxial spool (``eccentricity`` counts for the leakage), rectangular slots;
    no side force.  Rounded edges act as a clearance larger by about their radius.
    Sources: Merritt 1967, sec. 5-6 and 5-7 (area, jet); von Mises, ZVDI 61 (1917) 447; Blackburn,
    Reethof & Shearer 1960, ch. 4 (leakage).
    """

    type: ClassVar[str] = "spool-edge"
    ports: ClassVar[Mapping[str, Port]] = {
        "a": FLOW,
        "b": FLOW,
        "spool": ELEMENT,
        "body": Port("mechanical", Role.ELEMENT, optional=True),
    }

    diameter: Length = Field(gt=0, examples=["6 mm"], description="Of the spool.")
    radial_clearance: Length = Field(
        gt=0, examples=["4 um"], description="Between spool and sleeve."
    )
    overlap: Length = Field(
        description="Distance that the spool moves from the start before the edge opens; negative: "
        "underlap."
    )
    direction: Literal["opening", "closing"] = Field(
        description="Motion of the spool that opens the edge: opening is +z."
    )
    width: Length | None = Field(
        default=None, gt=0, description="Of all slots together; default: whole circumference."
    )
    largest_area: Area | None = Field(
        default=None, gt=0, description="Of the port behind the edge; default: no limit."
    )
    eccentricity: Ratio = Field(
        default=0.0, ge=0, le=1, description="Offset of the axes over the clearance."
    )
    flow_force: FlowForce | None = Field(default=None, description="Of the jet on the spool.")

    @property
    def slot_width(self) -> float:
        """Width of the opening along the circumference [m]."""
        return pi * self.diameter if self.width is None else self.width

    def parameters(self, viscosity: float, vapour_pressure: float) -> tuple[float, ...]:
        """Return what :func:`spool_edge_step` takes, for a viscosity [Pa s] and pressure [Pa]."""
        leak = self.slot_width * self.radial_clearance**3 * eccentricity_factor(self.eccentricity)
        force = self.flow_force
        return (
            1.0 if self.direction == "opening" else -1.0,
            self.overlap,
            self.slot_width,
            self.radial_clearance,
            0.0,
            self.largest_area or inf,
            self.discharge,
            12.0 * viscosity / leak,
            self.critical_flow_number * viscosity / 8.0,
            NOT_CHOKED if self.cavitation is None else self.cavitation,
            vapour_pressure,
            0.0,
            0.0,
            0.0,
            force.momentum(JET_ANGLE) if force else 0.0,
            force.damping_length if force else 0.0,
        )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that pushes spool and body."""
        fluid, viscosity = fixed_viscosity(rows)
        rows.branch(
            spool_edge_step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("spool"), rows.port("body")),
            parameters=self.parameters(viscosity, fluid.vapour_pressure),
            state=(0.0, 0.0, 0.0, 0.0, 0.0),
            channels=(
                Channel("opening", "m", 0, derived=True),
                Channel("area", "m^2", 1, derived=True),
                Channel("jet force", "N", 2, derived=True),
            ),
        )
