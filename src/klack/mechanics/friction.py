"""Friction of a needle in its guide."""

from collections.abc import Mapping
from math import exp, tanh
from typing import Any, ClassVar

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function
from klack.units import DampingCoefficient, Force, Speed, format_si

__all__ = ["GuideFriction"]


@step_function
def friction_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Friction at the mean velocity of the step; never gives energy."""
    coulomb, excess, stribeck, smoothing, viscous = par[0], par[1], par[2], par[3], par[4]
    out[0] = out[1] = out[2] = 0.0
    moved = (inp[3] - inp[2]) - (inp[5] - inp[4])
    if inp[1] <= 0.0 or moved == 0.0:
        return 0
    speed = moved / inp[1]
    # far from rest both transcendental functions are constants
    level, x = coulomb, speed / stribeck
    if excess != 0.0 and x * x < 40.0:
        level += excess * exp(-x * x)
    x = speed / smoothing
    sign = tanh(x) if abs(x) < 20.0 else (1.0 if x > 0.0 else -1.0)
    force = level * sign + viscous * speed
    out[0] = -force
    out[1] = force
    out[2] = force * moved
    return 0


class GuideFriction(Component):
    r"""Stribeck friction, smooth at rest.

    .. math:: F = -\Bigl[F_c + (F_s - F_c)\, e^{-(v/v_s)^2}\Bigr] \tanh\frac{v}{v_d} - b v

    Taken at the mean velocity of the step: the loss ``-F v h`` is never negative.  ``tanh``
    replaces the jump at rest, so a body under a force below ``F_s`` does not stick but creeps with
    less than ``v_d``; an opening delay by sticking needs a model with memory.

    Limit: the time step, the coarse one too, must stay below ``2 m v_d/F_s`` (5 us for 1 g, 1 mm/s
    and 0.4 N), or the forces of a step do not settle near rest.
    """

    type: ClassVar[str] = "guide-friction"
    ports: ClassVar[Mapping[str, Port]] = {
        "body": ELEMENT,
        "guide": Port("mechanical", ELEMENT.role, optional=True),
    }

    coulomb: Force = Field(ge=0, description="Sliding friction Fc; 0.05 to 1 N in small valves.")
    breakaway: Force | None = Field(
        default=None, ge=0, description="Largest friction Fs near rest; default Fc."
    )
    stribeck_speed: Speed = Field(
        default=0.01, gt=0, description="Speed vs at which the excess of Fs has decayed to 1/e."
    )
    smoothing_speed: Speed = Field(
        default=1e-3, gt=0, description="Speed vd below which friction falls to zero."
    )
    viscous: DampingCoefficient = Field(default=0.0, ge=0, description="Viscous part b.")

    @model_validator(mode="after")
    def _excess(self) -> "GuideFriction":
        if self.breakaway is not None and self.breakaway < self.coulomb:
            raise CaseProblem(
                ("breakaway",),
                got=format_si(self.breakaway, "N"),
                expected=f"at least the sliding friction, {format_si(self.coulomb, 'N')}",
                hint="remove it for equal values.",
            )
        return self

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``guide`` the guide is the ground."""
        breakaway = self.coulomb if self.breakaway is None else self.breakaway
        rows.element(
            friction_step,
            ports=(rows.port("body"), rows.port("guide")),
            parameters=(
                *(self.coulomb, breakaway - self.coulomb),
                *(self.stribeck_speed, self.smoothing_speed, self.viscous),
            ),
            books=(Book("loss", "loss"),),
        )
