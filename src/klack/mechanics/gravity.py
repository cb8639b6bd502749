"""Weight."""

from math import cos
from typing import Any, ClassVar

from pydantic import Field

from klack.errors import refuse_if
from klack.network.component import Component
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function
from klack.units import Acceleration, Angle

__all__ = ["STANDARD_GRAVITY", "Gravity"]

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2]; 3rd General Conference on Weights and Measures."""


@step_function
def gravity_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Constant weight with a potential."""
    out[0] = -par[0]
    out[1] = par[0] * inp[3]
    return 0


class Gravity(Component):
    r"""Weight of a body, acting on one of its ports.

    .. math:: F = -m g \cos\vartheta

    Seldom matters in a valve (a needle of 3 g weighs 0.03 N, its spring pushes with 20 N).  At one
    port of a flexible body the motion of the centre of mass is right; the spread of the weight over
    the volume is neglected (nanometres).
    """

    type: ClassVar[str] = "gravity"
    ports: ClassVar = {"body": ELEMENT}

    acceleration: Acceleration = Field(
        default=STANDARD_GRAVITY, gt=0, description="Acceleration of free fall g."
    )
    inclination: Angle = Field(
        default=0.0, description="Angle between +z (opening) and upwards; 0: the valve closes down."
    )

    def add_rows(self, rows: Rows) -> None:
        """Add the weight of the body at the port."""
        masses = [body.mass for body in rows.partner("body") if hasattr(body, "mass")]
        refuse_if(
            len(masses) != 1,
            f"component '{rows.component}'",
            got="no body with a mass at its port",
            expected="a rigid mass or a flexible body",
            hint="connect it to its body.",
        )
        weight = masses[0] * self.acceleration * cos(self.inclination)
        rows.element(
            gravity_step,
            ports=(rows.port("body"),),
            parameters=(weight,),
            books=(Book("energy", "store"),),
        )
