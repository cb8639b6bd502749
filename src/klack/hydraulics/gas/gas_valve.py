"""Gas valve: an opening for gas that a lift rules."""

from math import cos, pi, sin
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from klack.hydraulics.gas.network_gas import add_restriction, network_gas
from klack.hydraulics.gas.restriction import (
    RestrictionComponent,
    factor_of_area,
    factor_of_conductance,
)
from klack.input.problem import refuse_key_if
from klack.network.port import ELEMENT, GAS_FLOW, Port, Role
from klack.network.rows import Rows
from klack.units import Angle, Length, Ratio, SonicConductance

__all__ = ["GasValve", "mantle_area"]

_POINTS = 65  # of the area of a cone over the lift


class GasValve(RestrictionComponent):
    r"""Seat of a gas valve: ``gas-orifice`` whose opening follows the lift of a needle.

    .. math:: \dot m = C(x)\,\varrho_0 p_1 \sqrt{T_0/T_1}\;\psi(p_2/p_1), \qquad
              x = x_0 + y_\text{needle} - y_\text{body}

    Either a table of sonic conductances over the lift, straight between its points and constant
    beyond them, or a seat: the mantle between a sharp edge of the ``diameter`` and a flat or
    conical face, at most the area of the bore, times ``discharge`` as an ideal nozzle,

    .. math:: A = \pi h\,(d - h \cos\alpha), \quad h = x \sin\alpha, \qquad A \le \pi d^2/4 .

    Closed, the ``leak`` remains.

    Limits: no force on the needle: what the gas pushes is given by ``gas-face``, of the sealing
    diameter when closed.  The jet lowers the pressure at the rim of a face; that share is part of
    no component.  Limits of ``gas-orifice`` hold.
    Source: ISO 6358-1:2013; mantle of a frustum.
    """

    type: ClassVar[str] = "gas-valve"
    ports: ClassVar = {
        "a": GAS_FLOW,
        "b": GAS_FLOW,
        "needle": ELEMENT,
        "body": Port("mechanical", Role.ELEMENT, optional=True),
    }

    lift: tuple[Length, ...] | None = Field(
        default=None, min_length=2, description="Lifts of the table, ascending."
    )
    conductance: tuple[SonicConductance, ...] | None = Field(
        default=None, min_length=2, description="Sonic conductances C with air, one for each lift."
    )
    diameter: Length | None = Field(
        default=None, gt=0, description="Of the edge of the seat, instead of a table."
    )
    half_angle: Angle | None = Field(
        default=None,
        gt=0,
        le=pi / 2,
        description="Between axis and face of the needle; default 90 deg, a flat face.",
    )
    discharge: Ratio | None = Field(
        default=None, gt=0, le=1, description="Share of the area that acts; default 0.8."
    )
    start_lift: Length = Field(default=0.0, description="Lift at the start.")
    leak: SonicConductance = Field(
        default=0.0, ge=0, description="Sonic conductance that remains in the closed state."
    )

    @model_validator(mode="after")
    def _one_opening(self) -> Self:
        if self._exactly_one(("lift", "diameter"), "the opening over the lift") == "diameter":
            return self._refuse_with(("conductance",), "diameter", "the area follows from the seat")
        self._refuse_with(("half_angle", "discharge"), "lift", "a sonic conductance contains it")
        self._require_with(("conductance", "critical_ratio"), "lift", "those of the data sheet")
        lift, conductance = self.lift or (), self.conductance or ()
        refuse_key_if(
            len(lift) != len(conductance),
            ("conductance",),
            got=f"{len(conductance)} conductances for {len(lift)} lifts",
            expected="one for each lift",
            hint="add or remove values.",
        )
        for k in range(1, len(lift)):
            refuse_key_if(
                not lift[k] > lift[k - 1],
                ("lift", k),
                got=f"{lift[k]:g} m after {lift[k - 1]:g} m",
                expected="lifts that rise",
                hint="sort them.",
            )
        return self

    def table(self) -> NDArray[np.float64]:
        """Lifts [m], then sonic conductances or effective areas [m^2]."""
        if self.lift is not None:
            return np.array([self.lift, self.conductance])
        diameter = self.diameter or 0.0
        angle = pi / 2 if self.half_angle is None else self.half_angle
        full = _full_lift(diameter, angle)
        lifts = np.linspace(0.0, full, 2 if angle == pi / 2 else _POINTS)
        return np.array([lifts, (self.discharge or 0.8) * mantle_area(lifts, diameter, angle)])

    def add_rows(self, rows: Rows) -> None:
        """Add one restriction, and its leak."""
        gas, table = network_gas(rows), self.table()
        factor = factor_of_conductance(gas) if self.lift is not None else factor_of_area(gas)
        table[0] -= self.start_lift
        table[1] += self.leak * factor_of_conductance(gas) / factor
        add_restriction(
            rows,
            self.law(gas, factor),
            lift=(rows.port("needle"), rows.port("body")),
            table=table,
        )


def mantle_area(lift: NDArray[np.float64], diameter: float, angle: float) -> NDArray[np.float64]:
    """Area between a sharp edge and a cone of this half angle, at most that of the bore [m^2]."""
    h = lift * sin(angle)
    area = pi * h * (diameter - h * cos(angle))
    return np.asarray(np.minimum(area, pi / 4.0 * diameter**2))


def _full_lift(diameter: float, angle: float) -> float:
    """Lift from which the bore is narrower: ``h (d - h cos a) = d^2/4``, or its largest value."""
    c = cos(angle)
    if c < 1e-9:
        return 0.25 * diameter
    root = 1.0 - c
    h = diameter * (1.0 - root**0.5) / (2.0 * c)
    return h / sin(angle)
