"""Land face: the ring of a narrow gap, over which the pressure falls."""

from math import expm1, log1p, pi
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import network_fluid
from klack.input.problem import refuse_key_if
from klack.network.component import Component
from klack.network.port import ELEMENT, FLOW
from klack.network.rows import Rows
from klack.units import Length

__all__ = ["LandFace", "land_areas"]


def land_areas(inner: float, outer: float) -> tuple[float, float]:
    r"""Areas [m^2] with which the pressures inside and outside of a land push its ring.

    .. math:: A_1 = \pi\,(s - r_1^2), \qquad A_2 = \pi\,(r_2^2 - s), \qquad
              s = \frac{r_2^2 - r_1^2}{2 \ln(r_2/r_1)}

    from the laminar radial flow ``p(r) = p_1 + (p_2 - p_1) ln(r/r_1)/ln(r_2/r_1)``.  With
    ``x = 2 ln(r_2/r_1)`` and ``f(x) = (e^x - 1 - x)/x`` they are ``pi r_1^2 f(x)`` and
    ``-pi r_2^2 f(-x)``, which keeps its digits for narrow lands.

    Parameters
    ----------
    inner, outer [m]
        Radii, ``0 < inner < outer``.

    Examples
    --------
    >>> inside, outside = land_areas(0.9e-3, 1.0e-3)
    >>> round((inside + outside) / (pi * (1.0e-6 - 0.81e-6)), 12)
    1.0
    """
    x = 2.0 * log1p((outer - inner) / inner)
    return pi * inner**2 * _beyond_straight(x), -pi * outer**2 * _beyond_straight(-x)


def _beyond_straight(x: float) -> float:
    """``(e^x - 1 - x)/x``, also for small ``x``."""
    if abs(x) > 0.5:
        return (expm1(x) - x) / x
    total = 0.0
    for n in range(16, 1, -1):  # x/2! + x^2/3! + ..., the last ones first
        total = x / n * (1.0 + total)
    return total


class LandFace(Component):
    r"""Ring of a seat land between two pressures, laminar in between.

    .. math:: F = \pm [A_1 (p_1 - p_{amb}) + A_2 (p_2 - p_{amb})]

    with the areas of :func:`land_areas`, about half of the ring each.  Fluid that the ring moves is
    shared in the same ratio.

    Limits: viscous radial flow through a parallel gap, which is a land at small lift; far open the
    pressure falls at the edge, and the jet force of the seat takes over.
    Source: Reynolds' equation in polar coordinates.
    """

    type: ClassVar[str] = "land-face"
    ports: ClassVar = {"inside": FLOW, "outside": FLOW, "body": ELEMENT}

    direction: Literal["opening", "closing"] = Field(
        description="Direction of the pressure force: opening is +z."
    )
    inner_diameter: Length = Field(gt=0, description="Of the land.")
    outer_diameter: Length = Field(gt=0, description="Of the land.")

    @model_validator(mode="after")
    def _inside_is_smaller(self) -> Self:
        refuse_key_if(
            self.inner_diameter >= self.outer_diameter,
            ("inner_diameter",),
            got=f"{self.inner_diameter:g} m inside {self.outer_diameter:g} m",
            expected="less than outer_diameter",
            hint="swap both.",
        )
        return self

    def add_rows(self, rows: Rows) -> None:
        """Add two moving walls."""
        network_fluid(rows)
        sign = 1.0 if self.direction == "opening" else -1.0
        areas = land_areas(0.5 * self.inner_diameter, 0.5 * self.outer_diameter)
        for name, area in zip(("inside", "outside"), areas, strict=True):
            rows.wall(rows.port(name), rows.port("body"), sign * area)
