"""Friction of a needle in its guide."""

import warnings
from typing import ClassVar

from pydantic import Field, model_validator

from klack.errors import AccuracyWarning
from klack.input.problem import CaseProblem
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Rows
from klack.units import DampingCoefficient, Force, Speed, format_si

__all__ = ["GuideFriction", "require_breakaway"]


def require_breakaway(coulomb: float, breakaway: float | None) -> None:
    """Reject a friction at rest [N] below the sliding one."""
    if breakaway is not None and breakaway < coulomb:
        raise CaseProblem(
            ("breakaway",),
            got=format_si(breakaway, "N"),
            expected=f"at least the sliding friction, {format_si(coulomb, 'N')}",
            hint="remove it for equal values.",
        )


class GuideFriction(Component):
    r"""Stribeck friction that sticks.

    .. math:: F = -\Bigl[F_c + (F_s - F_c)\, e^{-(v/v_s)^2}\Bigr] \mathrm{sign}\, v - b v,
              \qquad |F| \le F_s \text{ at rest}

    Set-valued at rest: a body stays, however long, under a force below ``F_s``, and breaks away
    above it.  The loss of a step is never negative.

    Limits: no displacement while it sticks (pre-sliding), and no friction that grows with the time
    at rest.
    Source: Stribeck 1902.
    """

    type: ClassVar[str] = "guide-friction"
    ports: ClassVar = {
        "body": ELEMENT,
        "guide": Port("mechanical", ELEMENT.role, optional=True),
    }

    coulomb: Force = Field(ge=0, description="Sliding friction Fc; 0.05 to 1 N in small valves.")
    breakaway: Force | None = Field(
        default=None, ge=0, description="Largest friction Fs at rest; default Fc."
    )
    stribeck_speed: Speed = Field(
        default=0.01, gt=0, description="Speed vs at which the excess of Fs has decayed to 1/e."
    )
    viscous: DampingCoefficient = Field(default=0.0, ge=0, description="Viscous part b.")
    smoothing_speed: Speed | None = Field(
        default=None, gt=0, description="Obsolete, because friction sticks at rest; remove it."
    )

    @model_validator(mode="after")
    def _excess(self) -> "GuideFriction":
        require_breakaway(self.coulomb, self.breakaway)
        if self.smoothing_speed is not None:
            warnings.warn(
                "guide-friction: smoothing_speed has no effect, because friction sticks at "
                "rest. Remove it.",
                AccuracyWarning,
                stacklevel=2,
            )
        return self

    def add_rows(self, rows: Rows) -> None:
        """Add one slider; without ``guide`` the guide is the ground."""
        rows.slider(
            upper=rows.port("body"),
            lower=rows.port("guide"),
            coulomb=self.coulomb,
            breakaway=self.coulomb if self.breakaway is None else self.breakaway,
            stribeck_speed=self.stribeck_speed,
            viscous=self.viscous,
        )
