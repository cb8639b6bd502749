"""Massless spring, the return spring of a valve."""

from typing import Any, ClassVar

from pydantic import Field

from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function
from klack.units import DampingCoefficient, Force, Stiffness

__all__ = ["Spring"]


@step_function
def spring_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Linear spring between two ports: force of the mean deflection, exact discrete gradient."""
    stiffness, preload, damping = par[0], par[1], par[2]
    h, start, end = inp[1], inp[2] - inp[4], inp[3] - inp[5]
    force = preload + 0.5 * stiffness * (start + end)
    loss = 0.0
    if damping > 0.0 and h > 0.0:
        rate = (end - start) / h
        force += damping * rate
        loss = damping * rate * (end - start)
    out[0] = -force
    out[1] = force
    out[2] = end * (preload + 0.5 * stiffness * end)
    out[3] = loss
    return 0


class Spring(Component):
    r"""Linear spring with preload that pushes ``end`` down, in -z, against ``base``.

    .. math:: F_\text{end} = -F_0 - k\,(y_\text{end} - y_\text{base}) - c\,\dot y_\text{rel}

    The return spring of a normally closed valve; with a negative preload the opening spring of a
    normally open one.  The elastic force of a step is that of the mean deflection, so the stored
    energy is balanced to round-off and the frequency is right to second order.

    Limits: no mass, so no surge waves in its coils (its first surge frequency should be well above
    1/(opening time); add a third of its mass to the needle); it also pulls when it would be
    unloaded.
    """

    type: ClassVar[str] = "spring"
    ports: ClassVar = {
        "end": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
    }

    stiffness: Stiffness = Field(gt=0, description="Spring rate k.")
    preload: Force = Field(
        description="Force F0 on 'end' at the start, positive in -z (closing); negative opens."
    )
    damping: DampingCoefficient = Field(
        default=0.0, ge=0, description="Viscous damping c between the ends."
    )

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``base`` the spring acts against the ground."""
        rows.element(
            spring_step,
            ports=(rows.port("end"), rows.port("base")),
            parameters=(self.stiffness, self.preload, self.damping),
            books=(Book("energy", "store"), Book("damping", "loss")),
        )
