"""Held bodies of a case at the mounts of its noise section."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from klack.arrays import Ints, Vector
from klack.assembling.held_nodes import held_nodes
from klack.assembling.layers import layers_of
from klack.assembling.modes import damping_of
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body
from klack.bodies.elasticity.rigid_motions import held_dofs
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.craig_bampton import (
    CraigBampton,
    averages_of,
    constrained_modes,
    craig_bampton,
)
from klack.bodies.reduction.damping import Damping, ModalDamping
from klack.bodies.reduction.mounting import MountingSurface, interface_of, mounting_surface
from klack.bodies.reduction.ports import Port, surface_port
from klack.case.bodies import CaseFile
from klack.case.noise import CaseNoise, mounting_places
from klack.errors import AccuracyWarning

__all__ = ["ASSUMED_DAMPING", "at_mounts", "mount_references", "reaction_ports"]

ASSUMED_DAMPING = 0.005
"""Damping ratio of modes at mounts where the case gives none."""
_HIGHEST = 200e3  # [Hz] of modes in Fourier orders and on averaged surfaces


def mount_references(
    noise: CaseNoise | None, bodies: Mapping[str, ElasticBody]
) -> dict[str, Vector]:
    """Reference point of each mount: the centroid of its first surface."""
    mounts = (noise.mounts or {}) if noise else {}
    return {
        name: mounting_surface(
            bodies[mount.surfaces[0].body].mesh,
            [mount.surfaces[0].surface],
            name,
            kind="rigid",
        ).reference
        for name, mount in mounts.items()
    }


def at_mounts(
    case: CaseFile,
    noise: CaseNoise | None,
    body: ElasticBody,
    modes: Modes,
    flexibility: Flexibility,
    ports: Sequence[Port],
    references: Mapping[str, Vector],
) -> tuple[CraigBampton, ...]:
    """A held body at its mounts: of a solid one part, of a body of revolution one per order.

    Parameters
    ----------
    modes, flexibility
        Of the body with all of its supports held.
    ports
        With those of reactions.
    references (3,) [m]
        Of each mount.
    """
    surfaces = _surfaces(case, noise, body, references)
    if noise is None or not surfaces:
        return ()
    damping = damping_of(case.bodies[body.name].damping)
    if not damping.ratios([1.0])[0] > 0.0:
        damping = ModalDamping(ratio=ASSUMED_DAMPING)
    parts = [_axial_or_solid(body, surfaces, modes, flexibility, damping, ports)]
    if body.dimension == 3:
        return tuple(parts)
    if case.bodies[body.name].matrices is not None:
        warnings.warn(
            f"mounts of '{body.name}': only the motion along the axis is known, because its "
            "matrices describe axisymmetric motion. Try: a body that klack meshes, or a solid "
            "one.",
            AccuracyWarning,
            stacklevel=2,
        )
        return tuple(parts)
    for order in (0, 1):
        parts += _by_order(case, body, surfaces, flexibility, damping, order)
    return tuple(parts)


def _surfaces(
    case: CaseFile, noise: CaseNoise | None, body: ElasticBody, references: Mapping[str, Vector]
) -> list[MountingSurface]:
    found = []
    for name, mount in ((noise.mounts or {}) if noise else {}).items():
        own = [place.surface for place in mount.surfaces if place.body == body.name]
        if own:
            found.append(
                mounting_surface(
                    body.mesh,
                    own,
                    name,
                    kind=mount.interface,
                    nodes=_held_at(case, body, own),
                    reference=references[name],
                )
            )
    return found


def _held_at(case: CaseFile, body: ElasticBody, own: Sequence[str]) -> Ints:
    """Nodes of some supports of a body."""
    given = case.bodies[body.name]
    kept = tuple(support for support in given.fixed or () if support.surface in own)
    return held_nodes(given.model_copy(update={"fixed": kept}), body.mesh)


def reaction_ports(noise: CaseNoise | None, body: ElasticBody, ports: Sequence[Port]) -> list[Port]:
    """Uniform loads along z on surfaces of reactions that are no ports yet."""
    if noise is None:
        return []
    known = {port.name for port in ports}
    places = [place for key, place in mounting_places(noise) if key[1] != "mounts"]
    wanted = dict.fromkeys(place.surface for place in places if place.body == body.name)
    return [surface_port(body.mesh, name, "z", name=name) for name in wanted if name not in known]


def _axial_or_solid(
    body: ElasticBody,
    surfaces: Sequence[MountingSurface],
    modes: Modes,
    flexibility: Flexibility,
    damping: Damping,
    ports: Sequence[Port],
) -> CraigBampton:
    patterns = np.column_stack([port.pattern for port in ports])
    names = [port.name for port in ports]
    parts = [interface_of(body, surface) for surface in surfaces]
    averaged = averages_of(body, parts)
    if not averaged.shape[1]:
        return craig_bampton(
            flexibility, parts, modes, damping=damping, port_names=names, patterns=patterns
        )
    loose = replace(body, fixed=held_dofs(body.mesh, _held(surfaces)))
    with Flexibility(loose, cache=flexibility.cache) as own:
        modes = constrained_modes(own, averaged, min(_HIGHEST, float(modes.frequency[-1])))
        return craig_bampton(
            own, parts, modes, damping=damping, port_names=names, patterns=patterns
        )


def _by_order(
    case: CaseFile,
    body: ElasticBody,
    surfaces: Sequence[MountingSurface],
    flexibility: Flexibility,
    damping: Damping,
    order: int,
) -> list[CraigBampton]:
    """Torsion, or tilts about x and about y, which no axisymmetric force excites."""
    materials = case.materials_of(body.name, body.mesh.solids)
    whole: FourierBody = fourier_body(
        body.name,
        body.mesh,
        materials,
        order=order,
        fixed_nodes=_held(surfaces),
        layers=layers_of(case, body.name),
    )
    found = []
    with Flexibility(whole, cache=flexibility.cache) as own:
        modes: Modes | None = None
        for turned in (False, True)[: 1 + order]:
            parts = [interface_of(whole, surface, turned=turned) for surface in surfaces]
            averaged = averages_of(whole, parts)
            if averaged.shape[1]:  # signs of the turned motion are others
                modes = constrained_modes(own, averaged, _HIGHEST)
            elif modes is None:
                modes = eigenmodes(whole, max_frequency=_HIGHEST, flexibility=own)
            found.append(craig_bampton(own, parts, modes, damping=damping))
    return found


def _held(surfaces: Sequence[MountingSurface]) -> Ints:
    nodes = [surface.nodes for surface in surfaces if surface.kind == "rigid"]
    return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *nodes]))
