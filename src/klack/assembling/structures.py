"""Structures of radiating bodies, built while modes and statics are available."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.assembling.modes import damping_of, selection_of
from klack.assembling.mounting import at_mounts, mount_references, reaction_ports
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair
from klack.assembling.stops import StopContact
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.loads import NearLoads
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import kept_modes
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.structure import Structure, StructurePort, build_structure
from klack.case.bodies import CaseBody, SurfaceName
from klack.case.noise import CaseNoise
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.input.problem import one_of
from klack.mechanics.flexible_body import FlexibleBody

__all__ = [
    "IMPACT_STOP",
    "impact_structures",
    "radiating_surfaces",
    "valve_structures",
]

IMPACT_STOP = "contact"
"""Stop of ``klack impact``, whose force its histories hold."""


def impact_structures(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    own: ReducedPair,
    near: Mapping[str, NearLoads] | None = None,
) -> tuple[Structure, ...]:
    """Structures of the held bodies of an impact, with modes of the level ``reduced``.

    Parameters
    ----------
    problem
        With its factorisations.
    own
        With its ports.
    near
        Of earlier impacts: the static rest away from the contact may come from their solutions.
    """
    case, pair = problem.case, problem.pair
    sides = (
        (pair.upper, problem.flexibility_upper, own.ports[0], own.upper, 1.0),
        (pair.lower, problem.flexibility_lower, own.ports[1], own.lower, -1.0),
    )
    held = [body.name for body, *_ in sides if body.is_fixed]
    references = mount_references(case.noise, {body.name: body for body, *_ in sides})

    def static(flexibility: Flexibility, port: Port, reduced: ReducedBody) -> NDArray[np.float64]:
        load = port.pattern[:, None]
        if near is None:
            return flexibility.deflections(load)
        energy = float(reduced.static_compliance[0, 0])
        return near[reduced.name].answer(port.pattern, energy, flexibility.solve)[:, None]

    return tuple(
        _structure(
            case,
            body,
            [StructurePort(port=port, stop=IMPACT_STOP, sign=sign)],
            kept_modes(
                selection_of(case.reduction.choice(body.name)),
                pools[body.name],
                port.pattern[:, None],
            ),
            static(flexibility, port, reduced),
            radiating_surfaces(case.noise, body, held, _contact_names(case, body.name)),
            (flexibility, references),
        )
        for body, flexibility, port, reduced, sign in sides
        if body.is_fixed
    )


def valve_structures(
    case: ValveCase,
    bodies: Mapping[str, ElasticBody],
    ports: Mapping[str, Sequence[Port]],
    contacts: Mapping[str, StopContact],
    pools: Mapping[str, Modes],
    flexibilities: Mapping[str, Flexibility],
) -> tuple[Structure, ...]:
    """Structures of the held bodies of a valve; mappings by body, contacts by stop."""
    held = [name for name, body in bodies.items() if body.is_fixed]
    references = mount_references(case.noise, bodies)
    joined = _joined_stops(case)
    every = {
        name: [*ports[name], *reaction_ports(case.noise, bodies[name], ports[name])]
        for name in held
    }
    return tuple(
        _structure(
            case,
            bodies[name],
            [_pushed(port, name, contacts, joined) for port in every[name]],
            kept_modes(
                selection_of(case.reduction.choice(name)), pools[name], _patterns(ports[name])
            ),
            flexibilities[name].deflections(_patterns(every[name])),
            radiating_surfaces(case.noise, bodies[name], held, _stop_names(case, name)),
            (flexibilities[name], references),
        )
        for name in held
    )


def radiating_surfaces(
    noise: CaseNoise | None, body: ElasticBody, held: Sequence[str], contacts: Iterable[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Surfaces of a held body that meet the air, and those whose faces never do.

    Rejects wanted surfaces of a body that is not held.

    Parameters
    ----------
    held
        All held bodies.
    contacts
        Surfaces that hit or hold something; they count only if wanted.
    """
    if noise is not None and noise.surfaces is not None:
        _check_held(noise.surfaces, held)
        return tuple(item.surface for item in noise.surfaces if item.body == body.name), ()
    left_out = tuple(dict.fromkeys(contacts))
    return tuple(name for name in body.mesh.surfaces if name not in left_out), left_out


def _check_held(surfaces: Iterable[SurfaceName], held: Sequence[str]) -> None:
    for surface in surfaces:
        if surface.body not in held:
            raise InputError(
                "noise.surfaces",
                got=f"'{surface}'",
                expected=f"surfaces of held bodies ({one_of(held) or 'the case has none'})",
                hint="a free body, such as a needle, radiates into the fluid.",
            )


def _structure(
    case: Case | ValveCase,
    body: ElasticBody,
    ports: Sequence[StructurePort],
    modes: Modes,
    deflections: NDArray[np.float64],
    surfaces: tuple[tuple[str, ...], tuple[str, ...]],
    mounts: tuple[Flexibility, Mapping[str, NDArray[np.float64]]],
) -> Structure:
    """``mounts``: factors of the body, and the reference point of each mount."""
    plain = [item.port for item in ports]
    structure = build_structure(
        body,
        modes=modes,
        damping=damping_of(case.bodies[body.name].damping),
        ports=ports,
        deflections=deflections,
        surfaces=surfaces[0],
        left_out=surfaces[1],
    )
    if case.noise is None or not case.noise.mounts:
        return structure
    return replace(
        structure,
        at_mounts=at_mounts(case, case.noise, body, modes, mounts[0], plain, mounts[1]),
    )


def _patterns(ports: Sequence[Port]) -> NDArray[np.float64]:
    return np.column_stack([port.pattern for port in ports])


def _joined_stops(case: ValveCase) -> dict[tuple[str, str], tuple[str, float]]:
    """Stop and its sign at each point of a body that is joined to one end of it."""
    network = case.network.network()
    found = {}
    for connection in network.connections:
        ports = [port.partition(".")[::2] for port in connection]
        ends = [(name, _SIGNS[end]) for name, end in ports if end in _SIGNS]
        for name, point in ports if ends else ():
            part = network.components.get(name)
            if isinstance(part, FlexibleBody):
                found[part.body, point] = ends[0]
    return found


_SIGNS = {"upper": 1.0, "lower": -1.0}
"""Of the force of a stop on what is joined to its ends, along +z."""


def _pushed(
    port: Port,
    body: str,
    contacts: Mapping[str, StopContact],
    joined: Mapping[tuple[str, str], tuple[str, float]],
) -> StructurePort:
    for name, contact in contacts.items():
        sides = (contact.pair.upper.name, contact.pair.lower.name)
        for side, own, sign in zip(sides, contact.ports, _SIGNS.values(), strict=True):
            if side == body and own is port:
                return StructurePort(port=port, stop=name, sign=sign)
    stop, sign = joined.get((body, port.name), ("", 1.0))
    return StructurePort(port=port, stop=stop, sign=sign)


def _contact_names(case: Case, body: str) -> list[str]:
    names = [item.surface for item in case.contact.between if item.body == body]
    return names + _supports(case.bodies[body])


def _stop_names(case: ValveCase, body: str) -> list[str]:
    sides = [side for stop in case.stops.values() for side in stop.between if side.body == body]
    return [side.surface for side in sides] + _supports(case.bodies[body])


def _supports(body: CaseBody) -> list[str]:
    return [support.surface for support in body.fixed or ()]
