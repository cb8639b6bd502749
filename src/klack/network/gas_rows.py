"""Rows of gas that pneumatic components add; the room of gases makes one element of them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["PASSED", "GasBranchRow", "GasChamberRow", "GasRows", "GasSourceRow", "GasWallRow"]

PASSED = "passed mass"
"""Channel of what a restriction has passed from a to b since the start [kg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GasChamberRow:
    """A volume of gas.

    Parameters
    ----------
    volume [m^3]
        At zero displacements.
    pressure [Pa]
        At the start; None for that of steady flow.
    temperature [K]
        At the start.
    heat [W/K]
        From the wall; below zero for a gas as warm as the wall.
    wall [K]
    """

    component: str
    volume: float
    pressure: float | None
    temperature: float
    heat: float
    wall: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GasSourceRow:
    """A prescribed pressure over time, and the temperature of the gas that comes from there."""

    component: str
    time: tuple[float, ...]
    pressure: tuple[float, ...]
    temperature: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GasBranchRow:
    """A restriction between two gas nodes.

    Parameters
    ----------
    a, b
        Handles of nodes.
    law
        See :func:`klack.hydraulics.gas.flow_law.flow_through`.
    lift
        Handles of the ports whose distance opens it.
    table (2, n)
        Lifts [m], and the opening that scales the flow; empty without a lift.
    """

    component: str
    a: int
    b: int
    law: tuple[float, ...]
    lift: tuple[int, int] | None = None
    table: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class GasWallRow:
    """A face that moves with a port: ``V += area y``, ``F = area (p - p_ambient)`` along +z."""

    component: str
    node: int
    port: int
    area: float


@dataclass(eq=False)
class GasRows:
    """All rows of gas of a network; handle 0 is the surroundings."""

    chambers: dict[int, GasChamberRow] = field(default_factory=dict)
    sources: dict[int, GasSourceRow] = field(default_factory=dict)
    branches: list[GasBranchRow] = field(default_factory=list)
    walls: list[GasWallRow] = field(default_factory=list)

    def highest_pressure(self) -> float:
        """Highest absolute pressure of chambers and sources at the start [Pa]."""
        stated = [row.pressure for row in self.chambers.values() if row.pressure is not None]
        given = [float(np.interp(0.0, s.time, s.pressure)) for s in self.sources.values()]
        return max([*stated, *given], default=0.0)
