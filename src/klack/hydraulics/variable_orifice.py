r"""Variable orifice: its area follows a table over time or over the lift of a body."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.opening import OpeningComponent, opening_flow
from klack.input.problem import refuse_key_if
from klack.machine.compiling.jit import inner
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Time

__all__ = ["VariableOrifice", "area_over_lift_step", "area_over_time_step"]


@inner(error_model="numpy")
def _pass(par: Any, state: Any, inp: Any, out: Any, x: float, place: int) -> None:
    """Flow at the area of the table at ``x``; state to ``out[place]``.

    ``par``: 0-3 of the opening, 4 number ``n`` of points, ``n`` places, ``n`` areas.
    """
    n, i = int(par[4]), int(state[0])
    while i > 0 and x < par[5 + i]:
        i -= 1
    while i < n - 2 and x >= par[6 + i]:
        i += 1
    area = par[5 + n + i]
    if n > 1 and x > par[5 + i]:
        share = min((x - par[5 + i]) / (par[6 + i] - par[5 + i]), 1.0)
        area += share * (par[6 + n + i] - area)
    out[0], out[1], out[2], _ = opening_flow(
        inp[2], inp[3], inp[4], inp[5], area, par[0], par[1], par[2], par[3]
    )
    out[place], out[place + 1] = i, area


@step_function
def area_over_time_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the area in the middle of the step."""
    _pass(par, state, inp, out, inp[0] + 0.5 * inp[1], 3)
    return 0


@step_function
def area_over_lift_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the area of the mean lift of the step; no force on the bodies."""
    _pass(par, state, inp, out, 0.5 * (inp[6] + inp[7] - inp[8] - inp[9]), 5)
    out[3], out[4] = 0.0, 0.0
    return 0


class VariableOrifice(OpeningComponent):
    r"""Orifice whose area is a table over the lift of a body, or over time.

    .. math:: \dot m = C_q A(x) \sqrt{2 \varrho |p_a - p_b|}\;\mathrm{sgn}(p_a - p_b), \qquad
              x = y_\text{needle} - y_\text{body}\ \text{or}\ x = t

    Straight between the points, constant beyond the first and the last one; laminar at small flow
    and limited by cavitation as the ``orifice``, with the hydraulic diameter of a circle of that
    area.  For measured or computed areas of any shape, and for openings driven from outside of the
    network.  Over the lift, ``needle`` moves against ``body``, the ground if that is not joined.

    Limits: quasi-steady; no force on the body (for geometry with forces take ``seat`` or
    ``spool-edge``).  A jump in the table over time is written as a short ramp.
    Source: Merritt 1967, ch. 3.
    """

    type: ClassVar[str] = "variable-orifice"
    ports: ClassVar[Mapping[str, Port]] = {
        "a": FLOW,
        "b": FLOW,
        "needle": Port("mechanical", Role.ELEMENT, optional=True),
        "body": Port("mechanical", Role.ELEMENT, optional=True),
    }

    lift: tuple[Length, ...] | None = Field(
        default=None, min_length=2, description="Displacements of needle minus body, ascending."
    )
    time: tuple[Time, ...] | None = Field(
        default=None, min_length=2, description="Instead of the lift: times, ascending."
    )
    area: tuple[Area, ...] = Field(min_length=2, description="One area for each lift or time.")

    @model_validator(mode="after")
    def _table(self) -> Self:
        name = self._exactly_one(("lift", "time"), "what determines the area")
        _check_areas(name, self.points, self.area)
        return self

    @property
    def points(self) -> tuple[float, ...]:
        """Lifts [m] or times [s] of the table."""
        return self.lift or self.time or ()

    def port_kinds(self) -> Mapping[str, Port]:
        """Mechanical ports only where the area follows a lift."""
        if self.lift is None:
            return {"a": FLOW, "b": FLOW}
        return {**self.ports, "needle": ELEMENT}

    def add_rows(self, rows: Rows) -> None:
        """Add one branch."""
        fluid, viscosity = fixed_viscosity(rows)
        moving = self.lift is not None
        rows.branch(
            area_over_lift_step if moving else area_over_time_step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("needle"), rows.port("body")) if moving else (),
            parameters=(
                *self.opening_constants(viscosity, fluid.vapour_pressure),
                len(self.points),
                *self.points,
                *self.area,
            ),
            state=(0.0, 0.0),
            channels=(Channel("area", "m^2", 1, derived=True),),
        )


def _check_areas(name: str, points: Sequence[float], area: Sequence[float]) -> None:
    refuse_key_if(
        len(points) != len(area),
        ("area",),
        got=f"{len(area)} areas for {len(points)} values of {name}",
        expected="one area for each of them",
        hint="add or remove values.",
    )
    for k in range(1, len(points)):
        refuse_key_if(
            not points[k] > points[k - 1],
            (name, k),
            got=f"{points[k]:g} after {points[k - 1]:g}",
            expected="values that rise",
            hint="sort them; write a jump as a short ramp.",
        )
    for k, value in enumerate(area):
        refuse_key_if(
            value < 0.0,
            ("area", k),
            got=f"{value:g} m^2",
            expected="0 or more",
            hint="closed is an area of 0.",
        )
