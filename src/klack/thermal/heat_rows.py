"""What thermal components add to the heat network, and their base class."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

from klack.network.component import Component
from klack.network.rows import Rows

__all__ = ["HeatPath", "HeatRows", "HeatSupply", "ThermalComponent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatPath:
    """Heat from node ``a`` to node ``b``, ``conductance (T_a - T_b) + radiation (T_a^4 - T_b^4)``.

    Parameters
    ----------
    conductance [W/K]
    radiation [W/K^4]
        Area times emissivity times the constant of Stefan and Boltzmann.
    """

    component: str
    a: int
    b: int
    conductance: float = 0.0
    radiation: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatSupply:
    """Heat flow [W] into a node over time [s]: straight between its points, constant beyond."""

    component: str
    node: int
    time: tuple[float, ...]
    power: tuple[float, ...]


@dataclass(kw_only=True)
class HeatRows:
    """Collects what the components of a network add.

    ``node`` are the nodes of the ports of the present component; node 0 is the surroundings.
    """

    ambient: float
    component: str = ""
    node: Mapping[str, int] = field(default_factory=dict)
    capacity: dict[int, float] = field(default_factory=dict)
    start: dict[int, float] = field(default_factory=dict)
    fixed: dict[int, float] = field(default_factory=dict)
    paths: list[HeatPath] = field(default_factory=list)
    supplies: list[HeatSupply] = field(default_factory=list)

    def store(self, node: int, capacity: float, start: float | None) -> None:
        """Add a heat capacity [J/K]; its start temperature [K] is that of the surroundings."""
        self.capacity[node] = self.capacity.get(node, 0.0) + capacity
        if start is not None:
            self.start[node] = start

    def path(self, *, conductance: float = 0.0, radiation: float = 0.0) -> None:
        """Join the two ports of the present component."""
        a, b = self.node.values()
        self.paths.append(
            HeatPath(
                component=self.component, a=a, b=b, conductance=conductance, radiation=radiation
            )
        )


class ThermalComponent(Component):
    """A component of the heat network alone, which takes no part in a stroke."""

    def add_rows(self, rows: Rows) -> None:
        """Add nothing: within a stroke temperatures are constant."""

    @abstractmethod
    def add_heat(self, heat: HeatRows) -> None:
        """Add what it stores, carries or supplies."""
