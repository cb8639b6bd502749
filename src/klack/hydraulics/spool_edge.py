r"""Metering edge of a spool: the restriction between its land and the sleeve."""

from math import hypot, inf, pi, radians, sqrt
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.hydraulics.annulus import eccentricity_factor
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.notch import NUMBERS, Notch, notch_opening
from klack.hydraulics.opening import OpeningComponent
from klack.hydraulics.orifice import NOT_CHOKED, choked_flow
from klack.hydraulics.pressure_viscosity import CONSTANT
from klack.hydraulics.seat import gap_flow, gap_pass
from klack.input.problem import refuse_key_if
from klack.machine.compiling.jit import inner
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Ratio

__all__ = ["JET_ANGLE", "SpoolEdge", "notched_edge_step", "spool_edge_step"]

JET_ANGLE = radians(69.0)
"""Angle [rad] between jet and axis at a sharp edge without clearance (von Mises 1917)."""


@inner(error_model="numpy")
def _edge(par: Any, state: Any, inp: Any, out: Any, x: float) -> None:
    """Flow past the edge itself, open by ``x``, and its forces."""
    slot = max(x, 0.0)
    gap = sqrt(slot * slot + par[3] * par[3])
    covered = -x if x < 0.0 else 0.0
    gap_pass(par, state, inp, out, x, par[2] * gap, gap, 1.0 / covered if covered > 0.0 else inf)
    jet = out[7] * par[0] * slot / gap
    out[3] += jet - out[7]
    out[4] -= jet - out[7]
    out[7] = jet


@step_function
def spool_edge_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the mean position of the step, and the forces of the flow.

    ``par``: 0 sign of the motion that opens, 1 overlap, 2 width, 3 clearance, 5 largest area,
    6 ``C_q``, 7 ``12 mu/(w c^3)`` of the closed gap, 8 ``lambda_c mu/8``, 9 contraction, 10 vapour
    pressure, 11-13 no leak, 14 ``C_v cos(theta)``, 15 damping length, 16-17 viscosity law.
    ``state``: opening, area, jet force, mass flow, 1 once that flow is known.
    """
    x = par[0] * 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]) - par[1]
    _edge(par, state, inp, out, x)
    return 0


@step_function
def notched_edge_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Step of :func:`spool_edge_step` with notches in parallel to the rest of the edge.

    ``par``: 2 width without notches, 18 number of their shapes, 19 ``12 mu``, 20 ``c^3`` with the
    factor of the eccentricity, 21 gap length that resists as the edge, from 22 on the notches for
    :func:`~klack.hydraulics.notch.notch_opening`.
    """
    x = par[0] * 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]) - par[1]
    _edge(par, state, inp, out, x)
    p_a, p_b, rho_a, rho_b = inp[2], inp[3], inp[4], inp[5]
    forward = p_a >= p_b
    supply, density = (p_a, rho_a) if forward else (p_b, rho_b)
    drop, area, jet = abs(p_a - p_b), out[6], out[7]
    flow = up = down = leak = 0.0
    for n in range(int(par[18])):
        k = 22 + NUMBERS * n
        clear, narrow, gap, along, covered, flank = notch_opening(par, k, x, par[3], par[21])
        leak += par[k + 1] * flank
        total = min(par[k + 1] * clear, par[5] - area)
        if total <= 0.0 or gap <= 1e-12:
            continue
        area += total
        conductance = par[6] * total
        linear = par[19] * (along + covered / par[20]) / par[k + 1] + par[8] / (conductance * gap)
        volume, slope = gap_flow(drop, linear, 0.5 * density / (conductance * conductance))
        passed, more, less = choked_flow(
            density * volume,
            density * slope,
            -density * slope,
            supply,
            density,
            par[9] * total,
            par[10],
        )
        flow, up, down = flow + passed, up + more, down + less
        jet -= par[0] * par[14] * passed * passed / (density * conductance) * narrow / clear
    if par[15] != 0.0 and state[4] > 0.0 and inp[1] > 0.0:
        lag = par[15] * (flow if forward else -flow) / inp[1]
        out[3] -= lag
        out[4] += lag
    out[3] += jet - out[7]
    out[4] -= jet - out[7]
    leak *= density * par[20] / par[19]
    through, up, down = flow + leak * drop, up + leak, down - leak
    if forward:
        out[0], out[1], out[2] = out[0] + through, out[1] + up, out[2] + down
    else:
        out[0], out[1], out[2] = out[0] - through, out[1] - down, out[2] - up
    out[6], out[7] = area, jet
    out[8] += flow if forward else -flow
    return 0


class SpoolEdge(OpeningComponent):
    r"""Sharp edge of a spool that opens a slot in its sleeve.

    .. math:: A = w \sqrt{x^2 + c^2}\quad (x \ge 0), \qquad
              |p_a - p_b| = a Q + b Q^2, \qquad
              a = \frac{12 \mu\,\max(-x, 0)}{w c^3 (1 + \tfrac32\varepsilon^2)}
                  + \frac{\lambda_c \mu}{8 C_q A \sqrt{x^2 + c^2}}, \qquad
              b = \frac{\varrho}{2 (C_q A)^2}

    with the opening ``x = s (y_spool - y_body) - overlap``, the radial clearance ``c`` and the
    width ``w`` of the slots, ``pi d`` of a full annulus.  The area is exactly that of the shortest
    surface between both edges.  Closed, the edge of area ``w c`` and the covered length of the gap
    ``-x`` are in series: laminar leakage that falls with the overlap.  Flow and slopes are
    continuous at ``x = 0``.

    The jet pulls the spool shut with ``rho Q v cos(theta)``, as in a ``seat``; its angle is 69
    degrees by default, and the force fades with ``x/sqrt(x^2 + c^2)`` where the slot is narrower
    than the clearance.  A negative ``overlap`` is an underlap.

    ``notches`` open ahead of the edge, in parallel: the narrowest section of each
    (:mod:`~klack.hydraulics.notch`) by the same law, with the friction along the notch and through
    a covered tip in ``a``, and its own jet force.

    Limits: sharp edges, coaxial spool (``eccentricity`` counts for the leakage), rectangular slots;
    no side force.  Rounded edges act as a clearance larger by about their radius.
    Sources: Merritt 1967, sec. 5-6 and 5-7 (area, jet); von Mises, ZVDI 61 (1917) 447; Blackburn,
    Reethof & Shearer 1960, ch. 4 (leakage).
    """

    type: ClassVar[str] = "spool-edge"
    ports: ClassVar = {
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
        default=None,
        ge=0,
        description="Total width of all slots; default: whole circumference; 0: only the "
        "notches open.",
    )
    notches: tuple[Notch, ...] = Field(
        default=(), max_length=8, description="Metering notches that open ahead of the edge."
    )
    largest_area: Area | None = Field(
        default=None, gt=0, description="Area of the port behind the edge; default: no limit."
    )
    eccentricity: Ratio = Field(
        default=0.0, ge=0, le=1, description="Offset of the axes over the clearance."
    )
    flow_force: FlowForce | None = Field(default=None, description="Of the jet on the spool.")

    @model_validator(mode="after")
    def _notches_fit(self) -> Self:
        refuse_key_if(
            self.width == 0.0 and not self.notches,
            ("width",),
            got="0 mm without notches",
            expected="an edge that opens: a width above 0, or notches",
            hint="leave width out for the whole circumference.",
        )
        for k, notch in enumerate(self.notches):
            self._check_notch(k, notch)
        taken = sum(notch.count * notch.edge_width for notch in self.notches)
        around = self.slot_width or pi * self.diameter
        wide = max(taken, max((notch.count * notch.width for notch in self.notches), default=0.0))
        refuse_key_if(
            wide > around,
            ("notches",),
            got=f"notches with a total width of {1e3 * wide:g} mm",
            expected=f"at most the {1e3 * around:g} mm of the edge",
            hint="check count and width; width is the width of one notch.",
        )
        return self

    def _check_notch(self, k: int, notch: Notch) -> None:
        if notch.depth is None:
            return
        refuse_key_if(
            not self.radial_clearance < notch.depth < 0.5 * self.diameter,
            ("notches", k, "depth"),
            got=f"{1e3 * notch.depth:g} mm",
            expected=f"between the clearance of {1e3 * self.radial_clearance:g} mm and the "
            f"radius of the spool, {500 * self.diameter:g} mm",
            hint="a notch no deeper than the clearance is part of the gap: leave it out.",
        )

    @property
    def land_width(self) -> float:
        """Width of the edge without its notches [m]."""
        taken = sum(notch.count * notch.edge_width for notch in self.notches)
        return max(self.slot_width - taken, 0.0)

    @property
    def slot_width(self) -> float:
        """Width of the opening along the circumference [m]."""
        return pi * self.diameter if self.width is None else self.width

    def opening(self, x: float) -> float:
        """Flow area [m^2] of edge and notches with their clearance, open by ``x`` [m]."""
        clearance = self.radial_clearance
        area = self.land_width * hypot(max(x, 0.0), clearance)
        for notch in self.notches:
            numbers = np.array(notch.numbers)
            area += notch.count * notch_opening(numbers, 0, x, clearance, clearance)[0]
        return min(area, self.largest_area or inf)

    @property
    def _gap_cubed(self) -> float:
        return self.radial_clearance**3 * eccentricity_factor(self.eccentricity)

    def notch_parameters(self, viscosity: float) -> tuple[float, ...]:
        """Further parameters of :func:`notched_edge_step`; none without notches."""
        if not self.notches:
            return ()
        numbers = (number for notch in self.notches for number in notch.numbers)
        edge = max(self.critical_flow_number / (96.0 * self.discharge), 1.0)
        gap_as_edge = edge * self.radial_clearance
        return len(self.notches), 12.0 * viscosity, self._gap_cubed, gap_as_edge, *numbers

    def parameters(self, viscosity: float, vapour_pressure: float) -> tuple[float, ...]:
        """Parameters of :func:`spool_edge_step` from viscosity [Pa s] and vapour pressure [Pa]."""
        force, leak = self.flow_force, self.land_width * self._gap_cubed
        return (
            1.0 if self.direction == "opening" else -1.0,
            self.overlap,
            self.land_width,
            self.radial_clearance,
            0.0,
            self.largest_area or inf,
            self.discharge,
            12.0 * viscosity / leak if leak > 0.0 else 0.0,
            self.critical_flow_number * viscosity / 8.0,
            NOT_CHOKED if self.cavitation is None else self.cavitation,
            vapour_pressure,
            0.0,
            0.0,
            0.0,
            force.momentum(JET_ANGLE) if force else 0.0,
            force.damping_length if force else 0.0,
            *CONSTANT.numbers,
        )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that pushes spool and body."""
        fluid, viscosity = fixed_viscosity(rows)
        rows.branch(
            notched_edge_step if self.notches else spool_edge_step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("spool"), rows.port("body")),
            parameters=(
                *self.parameters(viscosity, fluid.vapour_pressure),
                *self.notch_parameters(viscosity),
            ),
            state=(0.0, 0.0, 0.0, 0.0, 0.0),
            channels=(
                Channel("opening", "m", 0, derived=True),
                Channel("area", "m^2", 1, derived=True),
                Channel("jet force", "N", 2, derived=True),
            ),
        )
