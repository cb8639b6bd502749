"""Force that a controller sets."""

from typing import Any, ClassVar

from klack.control.controlled import Controlled
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function

__all__ = ["ControlledForce"]


@step_function
def controlled_force_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Held force; what it takes back is an entry of its own."""
    work = par[0] * (inp[3] - inp[2])
    out[0] = par[0]
    out[1], out[2] = max(0.0, work), max(0.0, -work)
    return 0


class ControlledForce(Controlled):
    """Force along +z on one port that follows from signals, sampled and held.

    The controller's output is the force [N], constant over a sample time: an ideal actuator, such
    as a voice coil or a piezo stack with its amplifier.  Its work is a supply, what it takes back
    while it brakes a loss.
    """

    type: ClassVar[str] = "controlled-force"
    output_unit: ClassVar[str] = "N"
    ports: ClassVar = {"end": ELEMENT}

    def add_rows(self, rows: Rows) -> None:
        """Add one element and its controller."""
        rows.element(
            controlled_force_step,
            ports=(rows.port("end"),),
            parameters=(0.0,),
            books=(Book("work", "supply"), Book("returned", "loss")),
        )
        self.control(rows, "force", len(rows.elements) - 1)
