"""Coils of a valve that carry a constant current."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from klack.errors import InputError, refuse_if
from klack.input.problem import nearest, one_of
from klack.magnetics.boost_capacitor import BoostCapacitor
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.magnet_rows import main_circuit
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.steady_coil import steady_fluxes
from klack.magnetics.voltage_table import VoltageTable
from klack.magnetics.winding import warm_resistance
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import Role
from klack.units import format_si

__all__ = [
    "Coil",
    "coils_of",
    "current_left",
    "driven",
    "hysteretic_coils",
    "start_currents",
]

Magnet = Solenoid | MagneticNetwork | ForceMapSolenoid


@dataclass(frozen=True, slots=True, kw_only=True)
class Coil:
    """A coil, or some in series, at a driver.

    Parameters
    ----------
    component
        Its magnet.
    resistance [ohm]
        At the temperature of the winding.
    start_current [A]
    """

    component: str
    port: str
    magnet: Magnet
    resistance: float
    start_current: float

    @property
    def label(self) -> str:
        """What its channels are called after."""
        return self.component if self.port == "terminals" else f"{self.component} {self.port}"


def coils_of(network: Network) -> dict[str, Coil]:
    """Coils of a network by name: that of the magnet, or ``magnet.port`` of a further circuit.

    Raises
    ------
    InputError
        For a coil of the user's own, whose current klack cannot set.
    """
    found: dict[str, Coil] = {}
    for name, part in network.components.items():
        if isinstance(part, Magnet):
            circuits = {"terminals": main_circuit(part)}
            circuits |= part.circuits if isinstance(part, MagneticNetwork) else {}
            for port, circuit in circuits.items():
                found[name if port == "terminals" else f"{name}.{port}"] = Coil(
                    component=name,
                    port=port,
                    magnet=part,
                    resistance=warm_resistance(circuit.resistance, circuit.winding_temperature),
                    start_current=circuit.start_current,
                )
        elif any(port.role is Role.COIL for port in part.port_kinds().values()):
            raise InputError(
                f"components.{name}",
                got=f"the type '{part.type}'",
                expected="a solenoid, a magnetic-network or a force-map-solenoid",
                hint="an operating point sets only the current of these.",
            )
    return found


def hysteretic_coils(network: Network) -> list[str]:
    """Magnets whose flux at a constant current depends on their history."""
    return [
        coil.component
        for coil in coils_of(network).values()
        if coil.port == "terminals"
        and not isinstance(coil.magnet, ForceMapSolenoid)
        and coil.magnet.circuit().hysteretic
    ]


def start_currents(network: Network) -> dict[str, float]:
    """Steady current [A] of each coil at the start of a run."""
    return {name: coil.start_current for name, coil in coils_of(network).items()}


def driven(network: Network, currents: Mapping[str, float]) -> Network:
    r"""Network whose coils have carried constant currents for long.

    An ideal source of the voltage :math:`u = R\,i` replaces the driver of each, so that a run keeps
    the current.

    Parameters
    ----------
    currents [A]
        Of all coils, from 0.

    Raises
    ------
    InputError
        For another name, a current below zero, or two coils at one driver.
    """
    coils = coils_of(network)
    for name, current in currents.items():
        if name not in coils:
            raise InputError(
                "current",
                got=f"the coil '{name}'",
                expected=f"one of: {one_of(coils)}" if coils else "a valve with a coil",
                hint=nearest(name, coils, "name a solenoid of the case."),
            )
        refuse_if(
            not 0.0 <= current < np.inf,
            f"current of '{name}'",
            got=format_si(current, "A"),
            expected="0 A or more",
            hint="without magnets the force does not depend on the sign; with magnets exchange "
            "their polarity instead.",
        )
    at = {(coil.component, coil.port): name for name, coil in coils.items()}
    changed: dict[str, Component] = {}
    for node in network.nodes:
        names = [at[joint.component, joint.name] for joint in node.having(Role.COIL)]
        for joint in node.having(Role.VOLTAGE):
            if len(names) == 1 and names[0] in currents:
                name = names[0]
                voltage = coils[name].resistance * currents[name]
                changed[joint.component] = VoltageTable(time=(0.0,), voltage=(voltage,))
    for name, current in currents.items():
        coil = coils[name]
        part = changed.get(coil.component, coil.magnet)
        changed[coil.component] = part.model_copy(update=_starting(part, coil.port, current))
    return _with_sources(network, changed)


def _with_sources(network: Network, changed: Mapping[str, Component]) -> Network:
    """Network with constant sources in place of drivers, which no capacitor feeds."""
    shared = [name for name, part in network.components.items() if isinstance(part, BoostCapacitor)]
    if not shared:
        return network.with_components(changed)
    parts = {name: p for name, p in {**network.components, **changed}.items() if name not in shared}
    outlets = {f"{name}.outlet" for name in shared}
    kept = [line for line in network.connections if not outlets & set(line)]
    return replace(network, components=parts, connections=kept)


def _starting(part: Component, port: str, current: float) -> dict[str, object]:
    """Changed keys of a magnet for another current of one of its coils at the start."""
    if port == "terminals":
        return {"start_current": current}
    circuits = dict(getattr(part, "circuits", {}))
    circuits[port] = circuits[port].model_copy(update={"start_current": current})
    return {"circuits": circuits}


def current_left(magnet: Magnet, currents: Mapping[str, float], gap: float) -> float:
    """Current of the steady fluxes of a magnet at a gap [m], less the wanted one [A].

    ``currents`` [A] are those of its coils by port.  The fluxes of
    :func:`~klack.magnetics.steady_coil.steady_fluxes` are put into the circuit, or the map, again.
    """
    others = dict(currents)
    current = others.pop("terminals")
    if isinstance(magnet, ForceMapSolenoid):
        plant: MagneticCircuit | FluxMap = magnet.flux_map()
    else:
        plant = magnet.circuit()
    fluxes = steady_fluxes(plant, current=current, gap=gap, others=others)
    if isinstance(plant, FluxMap):
        return float(plant.current_at(float(fluxes[0]), gap)) - current
    mmf = plant.loops.T @ plant.mmf(plant.loops @ fluxes, gap)
    left = mmf - current * plant.loop_turns
    for port, more in others.items():
        left -= more * plant.turns_of(port)
    return float(np.max(np.abs(left)) / np.max(np.abs(plant.loop_turns)))
