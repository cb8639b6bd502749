"""Quantities of an operating point."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from klack.case.valve_roles import ValveRoles
from klack.magnetics.constant_drive import coils_of, current_left
from klack.network.gas_rows import PASSED
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.operating_point import OperatingPoint

__all__ = ["Measured", "measured"]

Key = tuple[str, str, str]
"""Component, quantity and unit."""

_NONE_AT_REST = (
    *("velocity", "peak force", "film force", "driver state", "flow", "mass flow"),
    PASSED,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """Numbers of one operating point: ``values`` by component, quantity and unit.

    What is left: ``force_left`` [N], ``flow_left`` [m^3/s], ``voltage_left`` [V].
    """

    values: Mapping[Key, float]
    force_left: float
    flow_left: float
    voltage_left: float


def measured(
    point: OperatingPoint,
    network: Network,
    rows: Rows,
    currents: Mapping[str, float],
    roles: ValveRoles,
) -> Measured:
    """Quantities of a point: bodies, stops, magnets, volumes, flows."""
    names = sorted((*network.components, "ambient"), key=len, reverse=True)
    found: dict[Key, float] = {}
    sliding = {f"{row.component}.{port} force" for row in rows.sliders for port in row.names}
    for channel, data in point.values.items():
        owner = next(name for name in names if _belongs(channel, name))
        quantity = channel[len(owner) :].lstrip(" .")
        is_null = any(quantity == word or quantity.endswith(f" {word}") for word in _NONE_AT_REST)
        if is_null or owner == "ambient" or channel in sliding:
            continue
        found[owner, quantity, data.unit] = 0.0 + float(data.values[0])  # no minus before nothing
    found |= _walls(point, rows)
    found |= _flows(point, rows)
    free = [name for name in point.start.residual if name in point.compliance]
    for name in free:
        compliance = point.compliance[name]
        found[name, "static stiffness", "N/m"] = 1.0 / compliance if compliance else np.inf
    for name, way in point.friction.items():
        found[name, "reach of dry friction", "m"] = way
    left = {name: abs(point.start.residual[name]) for name in free}
    for name, force in point.start.residual.items():
        if name == roles.needle and name not in point.compliance:
            found[name, "holding force", "N"] = 0.0 - force
    return Measured(
        values=found,
        force_left=max(left.values(), default=0.0),
        flow_left=max((abs(flow) for flow in point.inflow.values()), default=0.0),
        voltage_left=_voltage_left(point, network, rows, currents),
    )


def _belongs(channel: str, name: str) -> bool:
    return channel.startswith(name) and channel[len(name) : len(name) + 1] in (" ", ".")


def _walls(point: OperatingPoint, rows: Rows) -> dict[Key, float]:
    """Force of the pressures on each face, along +z."""
    names = {handle: row.component for handle, row in rows.nodes.items()}
    found: dict[Key, float] = {}
    for wall in rows.walls:
        pressure = point.value(f"{names[wall.node]} pressure")
        key = (wall.component, "pressure force", "N")
        force = wall.area * (pressure - rows.ambient.pressure)
        found[key] = found.get(key, 0.0) + force
    return found


def _flows(point: OperatingPoint, rows: Rows) -> dict[Key, float]:
    gas = {
        row.component: point.value(f"{row.component} mass flow") for row in rows.gas_rows.branches
    }
    of_gas = {(name, "mass flow", "kg/s"): flow for name, flow in gas.items()}
    return _liquid_flows(point, rows) | of_gas


def _liquid_flows(point: OperatingPoint, rows: Rows) -> dict[Key, float]:
    if rows.fluid is None:
        return {}
    density = float(rows.fluid.density(rows.ambient.pressure))
    found: dict[Key, float] = {}
    for name, flow in point.start.flow.items():
        owner, _, label = name.partition(" ")
        words = " ".join(filter(None, (label, "volume flow")))
        found[owner, words, "m^3/s"] = flow / density
        found[owner, words.replace("volume", "mass"), "kg/s"] = flow
    return found


def _voltage_left(
    point: OperatingPoint, network: Network, rows: Rows, currents: Mapping[str, float]
) -> float:
    """Largest difference of the voltage for a coil's fluxes from that at it."""
    moved = {
        handle: point.start.displacement[f"{row.component}.{name}"]
        for row in rows.bodies
        for handle, name in zip(row.ports, row.names, strict=True)
    }
    gaps = {
        limit.component: limit.start + sum(f * moved.get(port, 0.0) for port, f in limit.ports)
        for limit in rows.limits
        if limit.quantity == "gap"
    }
    largest = 0.0
    coils = coils_of(network)
    for name, coil in coils.items():
        voltage = point.value(f"{coil.label} voltage")
        largest = max(largest, abs(voltage - coil.resistance * currents[name]))
        if coil.port == "terminals":
            together = {
                other.port: currents[key]
                for key, other in coils.items()
                if other.component == coil.component
            }
            left = current_left(coil.magnet, together, gaps[coil.component])
            largest = max(largest, coil.resistance * abs(left))
    return largest
