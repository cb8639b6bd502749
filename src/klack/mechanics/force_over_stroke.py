"""Force given over displacement: a nonlinear spring."""

from typing import Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function
from klack.units import Force, Length

__all__ = ["ForceOverStroke"]


@step_function
def stroke_force_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Mean over the way of straight lines between points; par: n, places, forces, their work.

    The state is the interval that holds the start; ``k`` ends at point ``k``.
    """
    n = int(par[0])
    start, end = inp[2] - inp[4], inp[3] - inp[5]
    k = int(state[0])
    while k < n and par[1 + k] <= start:
        k += 1
    while k > 0 and par[k] > start:
        k -= 1
    first = k
    # walk from start to end; the pieces all have one sign, so nothing cancels
    impulse, left = 0.0, start
    while True:
        right, following = end, k
        if end > start and k < n and par[1 + k] < end:
            right, following = par[1 + k], k + 1
        elif end < start and k > 0 and par[k] > end:
            right, following = par[k], k - 1
        if k == 0:
            value = par[1 + n]
        elif k >= n:
            value = par[n + n]
        else:
            t, width = 0.5 * (left + right) - par[k], par[1 + k] - par[k]
            value = par[n + k] + (par[1 + n + k] - par[n + k]) * (t / width)
        if end == start:
            mean = value
            break
        impulse += value * (right - left)
        left = right
        if following == k:
            mean = impulse / (end - start)
            break
        k = following
    if k == 0:
        work = par[1 + n] * (end - par[1])
    elif k >= n:
        work = par[3 * n] + par[n + n] * (end - par[n])
    else:
        t, width = end - par[k], par[1 + k] - par[k]
        slope = (par[1 + n + k] - par[n + k]) / width
        work = par[2 * n + k] + t * (par[n + k] + 0.5 * slope * t)
    out[0] = mean
    out[1] = -mean
    out[2] = float(first)
    out[3] = -work
    return 0


class ForceOverStroke(Component):
    r"""Force along +z on ``end``, straight lines between points of the relative displacement.

    .. math:: F = F(y_\text{end} - y_\text{base}), \qquad
              \bar F = \frac{1}{x_1 - x_0} \int_{x_0}^{x_1} F(x)\,\mathrm dx

    Disc springs, magnetic latches, springs with a kink.  Conservative: the mean over a step keeps
    the energy to round-off.  Constant beyond the first and the last point.
    """

    type: ClassVar[str] = "force-over-stroke"
    ports: ClassVar = {
        "end": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
    }

    stroke: tuple[Length, ...] = Field(
        min_length=2, description="Displacements of 'end' relative to 'base', increasing."
    )
    force: tuple[Force, ...] = Field(min_length=2, description="Force along +z at each of them.")

    @model_validator(mode="after")
    def _table(self) -> "ForceOverStroke":
        refuse_key_if(
            len(self.stroke) != len(self.force),
            ("force",),
            got=f"{len(self.force)} forces for {len(self.stroke)} displacements",
            expected="one force for each displacement",
            hint="add or remove values.",
        )
        refuse_key_if(
            not np.all(np.diff(self.stroke) > 0),
            ("stroke",),
            got="displacements that do not increase",
            expected="each larger than the previous one",
            hint="sort them.",
        )
        return self

    def work(self) -> np.ndarray:
        """Work of the force [J] from the first point to every point, shape (n,)."""
        x, force = np.array(self.stroke), np.array(self.force)
        return np.concatenate(([0.0], np.cumsum(0.5 * np.diff(x) * (force[1:] + force[:-1]))))

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``base`` it acts against the ground."""
        rows.element(
            stroke_force_step,
            ports=(rows.port("end"), rows.port("base")),
            parameters=(len(self.stroke), *self.stroke, *self.force, *self.work()),
            state=(0.0,),
            books=(Book("energy", "store"),),
        )
