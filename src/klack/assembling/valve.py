"""From a valve case to a network that can run: meshes, modes, stops, laws."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from klack.assembling.bodies import (
    Places,
    assemble_body,
    find_touch,
    mesh_body,
    named_contact,
    wanted_sizes,
    with_size,
)
from klack.assembling.candidates import likely_loads
from klack.assembling.given_shapes import require_given_shapes, tell_effort
from klack.assembling.layers import LayerState, layer_states, tell_layers
from klack.assembling.modes import damping_of, mode_pool, selection_of
from klack.assembling.spatial import build_spatial, check_heights
from klack.assembling.spatial_rings import build_spatial_rings
from klack.assembling.stops import StopContact, StopFaces, build_stop, stop_law, touching
from klack.assembling.structures import valve_structures
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.ports import Port, pressure_port, surface_port
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.structure import Structure
from klack.case.placed_errors import tells_place
from klack.case.valve import ValveCase
from klack.case.valve_consistency import is_consistent
from klack.case.valve_roles import FLEXIBLE_BODY, find_roles
from klack.errors import InputError
from klack.machine.cache.result_cache import result_cache
from klack.machine.cores import blas_threads, side_by_side, threads_for
from klack.machine.progress import Progress, silent
from klack.machine.stages import warnings_of
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mesh.mesh import Mesh
from klack.network.component import Component
from klack.network.network import Network
from klack.transient.spatial_run import SpatialValve

__all__ = [
    "Valve",
    "ValveParts",
    "build_valve",
    "build_valve_bodies",
    "filled_network",
    "mesh_valve_bodies",
    "valve_of_bodies",
    "valve_parts",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class Valve:
    """A valve ready to run.

    Parameters
    ----------
    reduced
        With all ports.
    contacts, laws
        By end stop; consistent laws.
    network
        With bodies and laws filled in: the variant ``wet``.
    structures
        Held bodies as sources of sound.
    spatial
        Bodies that meet point by point, in three dimensions.
    layers
        Of all bodies.
    """

    case: ValveCase
    bodies: Mapping[str, ElasticBody]
    reduced: Mapping[str, ReducedBody]
    contacts: Mapping[str, StopContact]
    laws: Mapping[str, StopFaces]
    network: Network
    structures: tuple[Structure, ...] = ()
    spatial: SpatialValve | None = None
    layers: tuple[LayerState, ...] = ()


@tells_place
def build_valve(
    case: ValveCase, progress: Progress = silent, *, threads: int | None = None
) -> Valve:
    """Mesh and factorise each body once, solve the static contact of each stop, reduce, join.

    Parameters
    ----------
    threads
        Of the solvers, which decide the last bits; default: all cores.  Bodies of few unknowns
        always take one, which is faster.
    """
    return valve_of_bodies(case, build_valve_bodies(case, progress), progress, threads=threads)


def valve_of_bodies(
    case: ValveCase,
    bodies: Mapping[str, ElasticBody],
    progress: Progress,
    *,
    threads: int | None = None,
) -> Valve:
    """As :func:`build_valve`, of meshed and assembled bodies."""
    if case.motion == "three-dimensional":
        check_heights(case, find_roles(case), bodies)
    # side by side, unless one of them is worth several threads
    threads = threads_for(max((body.dof_count for body in bodies.values()), default=0), threads)
    with blas_threads(threads):
        return _built(case, bodies, progress, threads)


@dataclass(frozen=True, kw_only=True, eq=False)
class ValveParts:
    """What the reduced bodies of a valve are made of; flexibilities are to be closed."""

    bodies: Mapping[str, ElasticBody]
    flexibilities: Mapping[str, Flexibility]
    pools: Mapping[str, Modes]
    contacts: Mapping[str, StopContact]
    ports: Mapping[str, list[Port]]


def valve_parts(
    case: ValveCase, bodies: Mapping[str, ElasticBody], progress: Progress, threads: int | None
) -> ValveParts:
    """Factorise bodies; modes and static contact of each stop; cached."""
    progress("factorise", 0.0)
    # directions of friction would be loads as well, and too many
    pairs = {} if case.rubs else {n: touching(n, stop, bodies) for n, stop in case.stops.items()}
    loads = likely_loads(pairs.values())
    made = side_by_side(
        [
            partial(
                Flexibility,
                body,
                threads=threads,
                cache=result_cache(),
                at_once=threads == 1,
                loads=loads.get(name),
            )
            for name, body in bodies.items()
        ],
        at_once=threads == 1,
    )
    flexibilities = dict(zip(bodies, made, strict=True))
    pools = _mode_pools(case, bodies, flexibilities, progress)
    # in space the contact points rub
    with_law = case.without_friction() if case.motion == "three-dimensional" else case
    contacts = {
        name: build_stop(with_law, name, bodies, flexibilities, pools, progress)
        for name in case.stops
    }
    return ValveParts(
        bodies=bodies,
        flexibilities=flexibilities,
        pools=pools,
        contacts=contacts,
        ports={name: _ports(case, body, contacts) for name, body in bodies.items()},
    )


def _built(
    case: ValveCase, bodies: Mapping[str, ElasticBody], progress: Progress, threads: int | None
) -> Valve:
    parts = valve_parts(case, bodies, progress, threads)
    flexibilities, pools = parts.flexibilities, parts.pools
    contacts, ports = parts.contacts, parts.ports
    in_space, reduced = case.motion == "three-dimensional", {}
    for i, (name, body) in enumerate(bodies.items()):
        progress("reduced", i / len(bodies))
        whole = reduce_body(
            body,
            ports[name],
            modes=selection_of(case.reduction.choice(name)),
            correction=case.reduction.correction,
            damping=damping_of(case.bodies[name].damping),
            modes_pool=pools[name],
            flexibility=flexibilities[name],
            shifts=case.reduction.shifts_of(name, case.reduction.correction),
        )
        reduced[name] = whole if in_space else whole.along_axis()
    progress("radiating surfaces", 0.0)
    structures = valve_structures(case, bodies, ports, contacts, pools, flexibilities)
    spatial = None
    if in_space and all(body.dimension == 2 for body in bodies.values()):
        progress("contact points", 0.0)
        rings = build_spatial_rings(case, find_roles(case), bodies, pools, ports, contacts, reduced)
        spatial, reduced = rings.spatial, dict(rings.reduced)
    elif in_space:
        progress("contact points", 0.0)
        spatial = build_spatial(
            case, find_roles(case), bodies, flexibilities, pools, ports, contacts
        )
    for flexibility in flexibilities.values():
        flexibility.close()
    laws = {}
    for name, contact in contacts.items():
        if is_consistent(case.network.components[name]):
            upper, lower = (reduced[body.name] for body in (contact.pair.upper, contact.pair.lower))
            with warnings_of(f"stop '{name}'"):
                laws[name] = stop_law(contact, upper, lower)
    network = filled_network(case, reduced, laws)
    return Valve(
        case=case,
        bodies=bodies,
        reduced=reduced,
        contacts=contacts,
        laws=laws,
        network=network,
        structures=structures,
        spatial=spatial,
        layers=tuple(
            state for body in bodies.values() for state in layer_states(body, pools[body.name])
        ),
    )


def build_valve_bodies(case: ValveCase, progress: Progress) -> dict[str, ElasticBody]:
    """Mesh every body, fine at first touches, and assemble it."""
    return {
        name: assemble_body(case, name, mesh)
        for name, mesh in mesh_valve_bodies(case, progress).items()
    }


def mesh_valve_bodies(case: ValveCase, progress: Progress) -> dict[str, Mesh]:
    """Mesh every body as drawn, fine at first touches."""
    progress("mesh", 0.0)
    shapes = require_given_shapes(
        case, lambda name: mesh_body(case.bodies[name], name, ()), progress
    )
    places = _touched_places(case)
    tell_effort(case, shapes, wanted_sizes(case.bodies, places), progress)

    def places_at(name: str, size: float) -> Places:
        return _touched_places(with_size(case, name, size))[name]

    result = {}
    for i, (name, given) in enumerate(case.bodies.items()):
        progress("mesh", i / len(case.bodies))
        result[name] = mesh_body(given, name, places[name], partial(places_at, name))
    return result


def _touched_places(case: ValveCase) -> dict[str, Places]:
    """First touches of each body at its stops, as drawn."""
    places: dict[str, Places] = dict.fromkeys(case.bodies, ())
    for name, stop in case.stops.items():
        with named_contact(case, ("stops", name, "between"), stop.upper, stop.lower):
            touch = find_touch(case.bodies, stop.upper, stop.lower)
        if touch is not None:
            places[stop.upper.body] += touch.upper
            places[stop.lower.body] += touch.lower
    return places


def _mode_pools(
    case: ValveCase,
    bodies: Mapping[str, ElasticBody],
    flexibilities: Mapping[str, Flexibility],
    progress: Progress,
) -> dict[str, Modes]:
    progress("modes", 0.0)
    pools = side_by_side(
        [
            partial(mode_pool, selection_of(case.reduction.choice(name)), bodies[name], item)
            for name, item in flexibilities.items()
        ],
        at_once=all(item.at_once for item in flexibilities.values()),
    )
    progress("modes", 1.0)
    found = dict(zip(flexibilities, pools, strict=True))
    tell_layers(bodies.values(), found)
    return found


def _ports(case: ValveCase, body: ElasticBody, contacts: Mapping[str, StopContact]) -> list[Port]:
    """Ports of a body: contacts, then other points of the network."""
    ports = [
        port
        for contact in contacts.values()
        for side, port in zip((contact.pair.upper, contact.pair.lower), contact.ports, strict=True)
        if side.name == body.name
    ]
    known = {port.name for port in ports}
    for part in case.network.components.values():
        if isinstance(part, FlexibleBody) and part.body == body.name:
            missing = [point for point in part.points if point not in known]
            ports += [_surface_port(case, body.name, body.mesh, point) for point in missing]
    return ports


def _surface_port(case: ValveCase, body: str, mesh: Mesh, point: str) -> Port:
    """Port of a point that is no contact; +z is up, whatever the pressed side."""
    given = case.bodies[body].ports.get(point)
    surface = given.surface if given is not None else point
    if given is None or given.load == "axial":
        return surface_port(mesh, surface, "z", name=point)
    port = pressure_port(mesh, surface, name=point)
    axial = float(port.pattern[mesh.dimension - 1 :: mesh.dimension].sum())
    if abs(abs(axial) - 1.0) > 1e-6:
        raise InputError(
            f"bodies.{body}.ports.{point}",
            got=f"a pressure whose resultant is {abs(axial):.3g} N along z for a total of 1 N",
            expected="a resultant along the axis",
            hint="name a surface all the way round the axis, or use load: axial.",
        )
    return Port(point, np.sign(axial) * port.pattern)


def filled_network(
    case: ValveCase, reduced: Mapping[str, ReducedBody], laws: Mapping[str, StopFaces]
) -> Network:
    """Network of a case with its reduced bodies and computed laws."""
    network = case.network.network()
    return network.with_components(_filled_in(network, reduced, laws))


def _filled_in(
    network: Network, reduced: Mapping[str, ReducedBody], laws: Mapping[str, StopFaces]
) -> dict[str, Component]:
    """Components that had to wait for the bodies."""
    filled: dict[str, Component] = {}
    for name, part in network.components.items():
        if part.type == FLEXIBLE_BODY and isinstance(part, FlexibleBody):
            filled[name] = part.with_reduced(reduced[part.body])
        elif isinstance(part, EndStop) and name in laws:
            filled[name] = _with_law(part, laws[name])
    return filled


def _with_law(stop: EndStop, law: StopFaces) -> EndStop:
    if stop.film is None:
        return stop.with_law(law.law)
    return stop.with_law(law.faces, law.bulk)
