"""The heat network of a valve: capacities, conductances and supplies as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import InputError
from klack.network.network import Network
from klack.network.port import Role
from klack.thermal.heat_rows import HeatPath, HeatRows, HeatSupply, ThermalComponent

__all__ = ["HeatNetwork", "Links", "heat_network"]

Array = NDArray[np.float64]

_RULING = (Role.HEAT_STORE, Role.TEMPERATURE)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Links:
    """Conductances at given temperatures.

    Parameters
    ----------
    between (n, n) [W/K]
        Of free nodes, symmetric, the diagonal 0.
    to_fixed (n, f) [W/K]
        To the nodes of known temperature.
    """

    between: Array
    to_fixed: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class HeatNetwork:
    """Nodes of unknown temperature, and what joins them.

    Parameters
    ----------
    names
        Of the free nodes: the first heat capacity there, or the ports that meet.
    node_of
        Free node of every heat capacity.
    capacity (n,) [J/K]
    start (n,) [K]
    fixed_names
        ``"ambient"`` first.
    fixed (f,) [K]
    paths
        Nodes 0 to n - 1 are free, ``n + j`` is the fixed node ``j``.
    supplies
        Into free nodes.
    """

    names: tuple[str, ...]
    node_of: Mapping[str, int]
    capacity: Array
    start: Array
    fixed_names: tuple[str, ...]
    fixed: Array
    paths: tuple[HeatPath, ...]
    supplies: tuple[HeatSupply, ...]

    @property
    def count(self) -> int:
        """Number of free nodes."""
        return len(self.names)

    def links(self, temperature: Array) -> Links:
        """Conductances; radiation counts with its secant at these temperatures [K]."""
        n = self.count
        every = np.concatenate((temperature, self.fixed))
        table = np.zeros((len(every), len(every)))
        for path in self.paths:
            a, b = every[path.a], every[path.b]
            secant = path.radiation * (a * a + b * b) * (a + b)
            table[path.a, path.b] += path.conductance + secant
            table[path.b, path.a] += path.conductance + secant
        np.fill_diagonal(table, 0.0)
        return Links(between=table[:n, :n], to_fixed=table[:n, n:])

    def supplied(self, time: float) -> Array:
        """Heat flow of all sources into each free node at a time, shape (n,) [W]."""
        found = np.zeros(self.count)
        for item in self.supplies:
            found[item.node] += float(np.interp(time, item.time, item.power))
        return found

    @cached_property
    def corners(self) -> tuple[float, ...]:
        """Times at which a source has a corner, above zero, rising [s]."""
        times = {t for item in self.supplies for t in item.time if t > 0.0 and len(item.time) > 1}
        return tuple(sorted(times))

    @cached_property
    def floating(self) -> tuple[tuple[int, ...], ...]:
        """Islands of free nodes without a path to a known temperature."""
        n = self.count
        links = self.links(self.start)
        _, label = scipy.sparse.csgraph.connected_components(links.between > 0.0, directed=False)
        islands = [tuple(np.flatnonzero(label == i).tolist()) for i in np.unique(label)]
        return tuple(nodes for nodes in islands if n and not links.to_fixed[list(nodes)].any())


def heat_network(network: Network) -> HeatNetwork | None:
    """Heat network of a valve; None if nothing stores or carries heat.

    Raises
    ------
    InputError
        For a node without storage of heat and without a path to one.
    """
    parts = {
        name: part
        for name, part in network.components.items()
        if isinstance(part, ThermalComponent)
    }
    if not parts:
        return None
    rows = HeatRows(ambient=network.ambient.temperature, fixed={0: network.ambient.temperature})
    at = {
        (joint.component, joint.name): 0 if node.word else 1 + node.index
        for node in network.nodes
        if node.domain == "thermal"
        for joint in node.joints
    }
    words = {1 + node.index: str(node) for node in network.nodes}
    named: dict[str, int] = {}
    for name, part in parts.items():
        ruled = [port for port, kind in part.port_kinds().items() if kind.role in _RULING]
        for port in ruled:  # one in no connection is a node of its own
            named[name] = at.setdefault((name, port), 1 + len(network.nodes) + len(named))
        rows.component = name
        rows.node = {port: at.get((name, port), 0) for port in part.port_kinds()}
        part.add_heat(rows)
    words |= {node: name for name, node in reversed(named.items())}  # of several the first one
    stores = {name: node for name, node in named.items() if node in rows.capacity}
    made = _numbered(rows, words, stores)
    _require_known(made)
    return made


def _numbered(rows: HeatRows, words: Mapping[int, str], stores: Mapping[str, int]) -> HeatNetwork:
    used = set(rows.capacity) | {node for path in rows.paths for node in (path.a, path.b)}
    used |= {item.node for item in rows.supplies}
    free = sorted(used - set(rows.fixed))
    fixed = [0, *sorted(set(rows.fixed) - {0})]
    place = {node: i for i, node in enumerate([*free, *fixed])}
    return HeatNetwork(
        names=tuple(words[node] for node in free),
        node_of={name: place[node] for name, node in stores.items()},
        capacity=np.array([rows.capacity.get(node, 0.0) for node in free]),
        start=np.array([rows.start.get(node, rows.ambient) for node in free]),
        fixed_names=("ambient", *(words[node] for node in fixed[1:])),
        fixed=np.array([rows.fixed[node] for node in fixed]),
        paths=tuple(
            HeatPath(
                component=path.component,
                a=place[path.a],
                b=place[path.b],
                conductance=path.conductance,
                radiation=path.radiation,
            )
            for path in rows.paths
        ),
        supplies=tuple(
            HeatSupply(
                component=item.component, node=place[item.node], time=item.time, power=item.power
            )
            for item in rows.supplies
            if item.node not in rows.fixed
        ),
    )


def _require_known(network: HeatNetwork) -> None:
    for nodes in network.floating:
        if not network.capacity[list(nodes)].any():
            names = " and ".join(f"'{network.names[i]}'" for i in nodes)
            raise InputError(
                "network: thermal nodes",
                got=f"{names}: nothing there stores heat, and no path leads to a known temperature",
                expected="a heat capacity above 0, or a path to ambient",
                hint="give the heat-capacity a capacity, or connect a conductance to ambient.",
            )
