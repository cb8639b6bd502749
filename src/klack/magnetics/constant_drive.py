"""Coils of a valve that carry a constant current."""

from collections.abc import Mapping

import numpy as np

from klack.errors import InputError
from klack.input.problem import nearest, one_of
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.steady_coil import steady_fluxes
from klack.magnetics.voltage_table import VoltageTable
from klack.magnetics.winding import warm_resistance
from klack.network.network import Network
from klack.network.port import Role
from klack.units import format_si

__all__ = [
    "coils_of",
    "current_left",
    "driven",
    "hysteretic_coils",
    "resistance_of",
    "start_currents",
]

Coil = Solenoid | MagneticNetwork | ForceMapSolenoid


def coils_of(network: Network) -> dict[str, Coil]:
    """Coils of a network by name.

    Raises
    ------
    InputError
        For a coil of the user's own, whose constant current klack cannot set.
    """
    found: dict[str, Coil] = {}
    for name, part in network.components.items():
        if isinstance(part, Coil):
            found[name] = part
        elif any(port.role is Role.COIL for port in part.port_kinds().values()):
            raise InputError(
                f"components.{name}",
                got=f"the type '{part.type}'",
                expected="a solenoid, a magnetic-network or a force-map-solenoid",
                hint="an operating point sets the current of these alone.",
            )
    return found


def resistance_of(coil: Coil) -> float:
    """Resistance [ohm] at the temperature of the winding."""
    return warm_resistance(coil.resistance, coil.winding_temperature)


def hysteretic_coils(network: Network) -> list[str]:
    """Coils whose flux at a constant current depends on what was before."""
    return [
        name
        for name, coil in coils_of(network).items()
        if not isinstance(coil, ForceMapSolenoid) and coil.circuit().hysteretic
    ]


def start_currents(network: Network) -> dict[str, float]:
    """Steady current [A] with which a run of each coil begins."""
    return {name: float(coil.start_current) for name, coil in coils_of(network).items()}


def driven(network: Network, currents: Mapping[str, float]) -> Network:
    r"""Return a network whose coils have carried constant currents for long.

    Each gets an ideal source of the voltage :math:`u = R\,i` in place of its driver, so that a run
    of this network keeps the current.

    Parameters
    ----------
    network : Network
    currents : mapping of str to float [A]
        By coil, all of them; from 0.

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
        if not 0.0 <= current < np.inf:
            raise InputError(
                f"current of '{name}'",
                got=format_si(current, "A"),
                expected="0 A or more",
                hint="the force of a coil does not depend on the sign of its current.",
            )
    changed = {}
    for node in network.nodes:
        here = node.having(Role.COIL)
        names = [joint.component for joint in here]
        for joint in node.having(Role.VOLTAGE):
            if len(names) == 1 and names[0] in currents:
                name = names[0]
                voltage = resistance_of(coils[name]) * currents[name]
                changed[joint.component] = VoltageTable(time=(0.0,), voltage=(voltage,))
    coiled = {
        name: coils[name].model_copy(update={"start_current": current})
        for name, current in currents.items()
    }
    return network.with_components({**changed, **coiled})


def current_left(coil: Coil, current: float, gap: float) -> float:
    """Current that the steady fluxes of a coil carry at a gap [m], less the wanted one [A].

    The fluxes are those of :func:`~klack.magnetics.steady_coil.steady_fluxes`; here they are put
    into the circuit, or the map, again.
    """
    if isinstance(coil, ForceMapSolenoid):
        plant: MagneticCircuit | FluxMap = coil.flux_map()
    else:
        plant = coil.circuit()
    fluxes = steady_fluxes(plant, current=current, gap=gap)
    if isinstance(plant, FluxMap):
        return float(plant.current_at(float(fluxes[0]), gap)) - current
    mmf = plant.loops.T @ plant.mmf(plant.loops @ fluxes, gap)
    left = mmf - current * plant.loop_turns
    return float(np.max(np.abs(left)) / np.max(np.abs(plant.loop_turns)))
