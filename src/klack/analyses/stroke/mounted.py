"""A valve on its machine: held bodies become one that stands on the receiver of the noise section.

What pushes moving parts against the ground in the network pushes them against the surface that
``noise.reactions`` names; so within the valve all forces cancel.

The whole may drift without bounds, on an infinite plate or as a free body. Points of moving bodies
are therefore recorded as seen from the stop of the valve that is named; centres of mass and the
valve itself as seen from the ground.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy

from klack.acoustics.at_mounts import points_of
from klack.acoustics.standing import StandingValve, standing_valve
from klack.analyses.noise.machine import machine_of, mounted
from klack.assembling.valve import Valve
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.structure import Structure
from klack.case.bodies import SurfaceName
from klack.case.noise import CaseNoise
from klack.errors import InputError
from klack.input.problem import one_of
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.friction import GuideFriction
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import Role
from klack.network.rows import Rows
from klack.simulation.network_result import NetworkResult
from klack.units import format_si

__all__ = ["STANDING", "moving_note", "seen_from_valve", "standing_network"]

STANDING = "mounted"
"""Component of all held bodies; its ports are named BODY-PORT."""
_GROUND = "ground"


def standing_network(valve: Valve, network: Network) -> Network:
    """Put the held bodies of a network without fluid on the machine of the case.

    Raises
    ------
    InputError
        Without a machine, for one that has no law in time, and for reactions without a place.
    """
    noise = valve.case.noise
    if noise is None or noise.receiver is None or valve.spatial is not None:
        raise InputError(
            "variant",
            got="'dry-mounted' "
            + ("in three dimensions" if valve.spatial else "without a machine below the valve"),
            expected="noise.mounts and noise.receiver, and a motion along the axis",
            hint="describe the machine that carries the valve, or run the variant 'dry'.",
        )
    structures = mounted(valve.structures, noise, valve.case.path.name if valve.case.path else "")
    parts = [part for item in structures for part in item.at_mounts]
    points = points_of(parts)
    machine = machine_of(noise, valve.case.materials, points)
    standing = standing_valve(
        parts,
        points,
        machine.receiver,
        placements=machine.placements,
        isolators=machine.isolators,
        missing=machine.missing,
    )
    names = dict.fromkeys([STANDING, *(f"{STANDING}-{key}" for key in standing.dampers)])
    if taken := [name for name in names if name in network.components]:
        raise InputError(
            "network.components",
            got=f"the name '{taken[0]}'",
            expected=f"another one: {one_of(names)} belong to the variant 'dry-mounted'",
            hint="rename the component.",
        )
    held = {
        name: part
        for name, part in network.components.items()
        if isinstance(part, FlexibleBody) and part.body in {item.name for item in structures}
    }
    connections = _connections(network, held, noise)
    reduced, places = _reduced(structures, standing)
    if both := [key for key in standing.dampers if key in places]:
        raise InputError(
            "noise.mounts",
            got=f"the motion '{both[0]}' of a mount, which is also "
            f"{' and '.join(places[both[0]])}, body and surface",
            expected="different names of mounts and bodies",
            hint="rename the mount.",
        )
    used = {p.partition(".")[2] for c in connections for p in c if p.startswith(f"{STANDING}.")}
    connections += [[f"{STANDING}.{key}", f"{STANDING}-{key}.body"] for key in standing.dampers]
    points_used = [name for name in reduced.port_names if name in used or name not in places]
    whole = FlexibleBody.of(reduced, points_used, places=places)
    components: dict[str, Component] = {STANDING: whole}
    for key, (_, c) in standing.dampers.items():
        components[f"{STANDING}-{key}"] = GuideFriction(coulomb=0.0, viscous=c)
    kept = {name: part for name, part in network.components.items() if name not in held}
    return replace(network, components={**kept, **components}, connections=connections)


def seen_from_valve(result: NetworkResult, rows: Rows, stops: Sequence[str]) -> NetworkResult:
    """Points of moving bodies as seen from the first of some stops that the valve has."""
    whole = next((row for row in rows.bodies if row.body.momentum is not None), None)
    if whole is None:
        return result
    held = dict(zip(whole.ports, whole.names, strict=True))
    ends = {row.component: (row.upper, row.lower) for row in rows.interfaces}
    places = [held[end] for stop in stops for end in ends.get(stop, ()) if end in held]
    channels = dict(result.channels)
    for row in rows.bodies if places else ():
        for point in row.names if row.body.rigid_count > 0 and row.course is None else ():
            for what in ("displacement", "velocity"):
                key, place = f"{row.component}.{point} {what}", f"{STANDING}.{places[0]} {what}"
                moved = channels[key].values - channels[place].values
                channels[key] = replace(channels[key], values=moved)
    return replace(result, channels=channels)


def moving_note(variant: str, result: NetworkResult) -> str:
    """How far the valve of a mounted variant moves, and from where lift counts."""
    ways = [
        float(np.abs(data.values).max())
        for name, data in result.channels.items()
        if name.startswith(f"{STANDING}.") and name.endswith(" displacement")
    ]
    if not variant.endswith("mounted") or not ways:
        return ""
    return (
        f"'{variant}': the valve itself moves by up to {format_si(max(ways), 'm', 3)}. Lift and "
        "motion of other points of moving bodies are relative to the seat, which moves with the "
        "valve; speeds of centres of mass are relative to the ground."
    )


def _connections(
    network: Network, held: Mapping[str, FlexibleBody], noise: CaseNoise
) -> list[list[str]]:
    """Connections of a network with one body for those held, and reactions in their places."""
    given, homeless, ends = noise.reactions or {}, [], []
    found: list[list[str]] = []
    loose: list[tuple[str, str]] = [(port, port.partition(".")[0]) for port in _standing(network)]
    for connection in network.connections:
        ports = [_renamed(port, held) for port in connection]
        if _GROUND in ports:
            loose += [(port, port.partition(".")[0]) for port in ports if port != _GROUND]
        else:
            found.append(ports)
    for port, component in loose:
        place = given.get(component)
        if place is None:
            homeless.append(component)
        elif isinstance(place, SurfaceName) and port == component:
            ends.append(component)
        elif isinstance(place, SurfaceName):
            _meet(found, f"{STANDING}.{place.body}-{place.surface}", port)
    if homeless:
        raise InputError(
            "noise.reactions",
            got=f"no surface for the reaction of {one_of(dict.fromkeys(homeless))}",
            expected="a surface of a held body for each component with an end on the ground, or "
            "'outside' for each that acts from outside",
            hint=f"add, for example, noise.reactions: {{{homeless[0]}: BODY.SURFACE}}.",
        )
    if ends:
        raise InputError(
            f"noise.reactions.{ends[0]}",
            got=f"a surface for '{ends[0]}', which has no second end to push on it",
            expected="'outside' in a run on the machine, which leaves this reaction out",
            hint="use a component with two ends, such as a solenoid or a spring; or run the "
            "variant dry, whose noise includes the reaction.",
        )
    return found


def _standing(network: Network) -> Iterator[str]:
    """Mechanical ports of components that stand on the ground without a word.

    Of components that have no such port, their name.
    """
    joined = {port for connection in network.connections for port in connection}
    for name, part in network.components.items():
        own = [
            f"{name}.{port}"
            for port, kind in part.port_kinds().items()
            if kind.domain == "mechanical" and kind.role is not Role.MOTION
        ]
        if len(own) == 1 and own[0] in joined:
            yield name
        elif any(port in joined for port in own):
            yield from (port for port in own if port not in joined)


def _renamed(port: str, held: Mapping[str, FlexibleBody]) -> str:
    component, _, point = port.partition(".")
    return f"{STANDING}.{held[component].body}-{point}" if component in held else port


def _meet(connections: list[list[str]], node: str, port: str) -> None:
    for connection in connections:
        if node in connection:
            connection.append(port)
            return
    connections.append([node, port])


def _reduced(
    structures: Sequence[Structure], standing: StandingValve
) -> tuple[ReducedBody, dict[str, tuple[str, str]]]:
    """The standing valve as a reduced body, and body and port of each of its ports."""
    places = {  # parts behind the first have no ports
        f"{item.name}-{port}": (item.name, port)
        for item in structures
        for port in item.at_mounts[0].port_names
    }
    rest = scipy.linalg.block_diag(*(item.residual_compliance for item in structures))
    mass = float(sum(item.mass for item in structures))
    return standing.reduced(STANDING, tuple(places), mass, rest), places
