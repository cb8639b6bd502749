r"""Pressure loss of a bend, a branch of a junction, or a change of cross-section."""

from math import pi, sqrt
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.seat import gap_flow
from klack.network.component import Component
from klack.network.port import FLOW
from klack.network.rows import Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Ratio

__all__ = ["PressureLoss", "pressure_loss_step"]


@step_function
def pressure_loss_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """``par``: laminar term [Pa s/m^3], coefficient over ``2 A^2`` from a to b, and from b to a."""
    drop = inp[2] - inp[3]
    forward = drop >= 0.0
    density = inp[4] if forward else inp[5]
    volume, slope = gap_flow(drop, par[0], density * (par[1] if forward else par[2]))
    out[0], out[1], out[2] = density * volume, density * slope, -density * slope
    return 0


class PressureLoss(Component):
    r"""Loss of a fitting by its coefficient, between two pressures.

    .. math:: \Delta p = \Bigl(\frac{K_1}{Re} + \zeta\Bigr)\frac{\varrho}{2} v^2
              = \frac{K_1 \mu}{2 D A}\,Q + \frac{\zeta\varrho}{2 A^2}\,Q^2, \qquad
              v = \frac{Q}{A},\quad Re = \frac{\varrho v D}{\mu}

    with Hooper's coefficients ``zeta`` at large and ``K_1`` at small Reynolds numbers: smooth and
    monotone, with another coefficient for each direction if needed.  A junction of lines with
    losses is a ``chamber`` of the volume of the crossing with one pressure loss per branch.

    ``zeta`` for round bores: bend of 90 degrees 0.2 to 0.4, sharp 1.1; tee straight on 0.1, as an
    elbow 0.7 to 1; sharp inlet 0.5, outlet into a chamber 1, step from ``A`` to the larger ``A_2``
    ``(1 - A/A_2)^2`` (Borda-Carnot).  ``K_1``: bends 800, tees 200 to 500.

    Limits: total pressure: where cross-sections differ, pressures of flowing fluid are not
    distinguished from those at rest; coefficients of a tee that depend on the division of the flow
    are constant here; no cavitation limit (take an ``orifice``).
    Sources: Hooper, Chem. Eng. 88 (1981) no. 17, 96; Idelchik, Handbook of Hydraulic Resistance.
    """

    type: ClassVar[str] = "pressure-loss"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    diameter: Length | None = Field(default=None, gt=0, description="Of the bore.")
    area: Area | None = Field(default=None, gt=0, description="Instead of the diameter.")
    coefficient: Ratio = Field(gt=0, examples=["0.4"], description="From a to b, zeta.")
    reverse_coefficient: Ratio | None = Field(
        default=None, gt=0, description="From b to a; the same by default."
    )
    laminar_coefficient: Ratio = Field(
        default=500.0, gt=0, description="K_1, over the Reynolds number."
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        self._exactly_one(("diameter", "area"), "size of the bore")
        return self

    @property
    def bore_area(self) -> float:
        """Cross-section [m^2]."""
        return pi / 4.0 * self.diameter**2 if self.diameter else self.area or 0.0

    def add_rows(self, rows: Rows) -> None:
        """Add one branch."""
        _, viscosity = fixed_viscosity(rows)
        area = self.bore_area
        back = self.coefficient if self.reverse_coefficient is None else self.reverse_coefficient
        rows.branch(
            pressure_loss_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=(
                0.5 * self.laminar_coefficient * viscosity / (sqrt(4.0 * area / pi) * area),
                0.5 * self.coefficient / area**2,
                0.5 * back / area**2,
            ),
        )
