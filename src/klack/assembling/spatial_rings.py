"""From a valve case of half sections to bodies in three dimensions.

Each moves in all Fourier orders (:mod:`klack.transient.revolved_model`); ports of the network push
along the axis: only order 0 has a share in them.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.assembling.modes import selection_of
from klack.assembling.off_axis import ANGLES, off_axis_space, turned
from klack.assembling.spatial import (
    Meeting,
    Movers,
    body_guide,
    seat_height,
    valve_of_meetings,
)
from klack.assembling.stops import StopContact
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.ring_points import RingSections
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import kept_modes
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case.guide import LinearGuideLaw, ValveGuide
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles
from klack.contact.friction import Friction
from klack.contact.gap_update import RingGaps
from klack.contact.rings import RingFriction, RingSpace
from klack.errors import AccuracyWarning
from klack.machine.cache.result_cache import result_cache
from klack.transient.guide import ShaftSection, shaft_sections, turned_sections
from klack.transient.revolved_model import (
    RevolvedBody,
    RevolvedPoints,
    RingContact,
    model_of_reduced,
    reduced_bodies,
)
from klack.transient.ring_arcs import RingArcs
from klack.transient.spatial_run import SpatialValve

__all__ = ["RingValve", "build_spatial_rings", "in_all_orders"]

Vector = NDArray[np.float64]

_JUDGED = 0.1  # of the peak force at the speed that the case gives for a stop


@dataclass(frozen=True, kw_only=True, eq=False)
class RingValve:
    """A valve of half sections in three dimensions; ``reduced`` with modes of all orders."""

    spatial: SpatialValve
    reduced: Mapping[str, ReducedBody]


def build_spatial_rings(
    case: ValveCase,
    roles: ValveRoles,
    bodies: Mapping[str, ElasticBody],
    pools: Mapping[str, Modes],
    ports: Mapping[str, Sequence[Port]],
    contacts: Mapping[str, StopContact],
    reduced: Mapping[str, ReducedBody],
) -> RingValve:
    """Bodies of a valve with all freedoms, contact points on rings, and the guide.

    As :func:`klack.assembling.spatial.build_spatial`; beside order 0, modes as of
    :func:`klack.assembling.off_axis.turned`.  Rejects a contact around the axis.

    Parameters
    ----------
    reduced
        In motion along the axis.

    Warns
    -----
    AccuracyWarning
        Of linear elements, and a body without elastic mode across its axis.
    """
    needle = str(getattr(case.network.components[roles.needle], "body", ""))
    names = [needle, *(name for name in bodies if name != needle)]
    movers = Movers.of(case, needle, bodies, seat_height(contacts, needle))
    count = ANGLES if case.angles is None else case.angles
    found = [
        _meeting(
            contact,
            movers,
            float(getattr(case.network.components[name], "gap", 0.0)),
            count,
            Friction.coulomb(case.stops[name].friction) if case.rubs else None,
        )
        for name, contact in contacts.items()
    ]
    sections: dict[str, dict[str, RingSections]] = {name: {} for name in names}
    for name, guide, on in movers.guided():
        for body, surface in (name, guide.surface), *([(on.body, on.surface)] if on else []):
            sections[body][name] = turned_sections(body, bodies[body].mesh, surface, guide.heights)
    points, loads = reduced_bodies(
        [_revolved(case, bodies[name], pools[name], ports[name], sections[name]) for name in names],
        [contact for _, contact in found],
        cache=result_cache(),
    )
    for item in points:
        _tell_stiff(item)
    model = model_of_reduced(points, loads, [contact for _, contact in found])

    def at_sections(body: str, guided: str, guide: ValveGuide) -> list[ShaftSection]:
        """Sections of a body in the guide of a body, of all its own."""
        own = sections[body]
        first = sum(own[each].count for each in list(own)[: list(own).index(guided)])
        told = shaft_sections(_joined(own), points[names.index(body)])
        here = told[first : first + own[guided].count]
        linear = isinstance(guide.law, LinearGuideLaw)
        return [section._replace(compliance=None) for section in here] if linear else here

    spatial = valve_of_meetings(
        case,
        model,
        [meeting for meeting, _ in found],
        {
            name: body_guide(
                model,
                name,
                guide,
                at_sections(name, name, guide),
                None if on is None else (on.body, at_sections(on.body, name, guide)),
            )
            for name, guide, on in movers.guided()
        },
        movers,
    )
    arcs = RingArcs(
        count=count,
        stops=spatial.stops,
        turn=tuple(contact.space.turn for _, contact in found),
        weakest=tuple(_JUDGED * contact.pattern_force for contact in contacts.values()),
    )
    whole = {
        name: in_all_orders(reduced[name], item) for name, item in zip(names, points, strict=True)
    }
    return RingValve(
        spatial=replace(spatial, arcs=arcs), reduced={name: whole[name] for name in bodies}
    )


def _meeting(
    contact: StopContact,
    movers: Movers,
    gap: float,
    count: int,
    friction: Friction | None,
) -> tuple[Meeting, RingContact]:
    pair, static = contact.pair, contact.static
    pairing = movers.pairing(pair, gap)
    upper_moves = pairing.is_upper
    centre = (pair.upper if upper_moves else pair.lower).centre_in_space
    farthest, off_axis = movers.reach(pairing, turns=1)
    angle = 2.0 * np.pi * np.arange(count) / count
    section = off_axis_space(
        pair,
        static.space,
        farthest,
        off_axis,
        angle=angle,
        centre=centre,
        upper_moves=upper_moves,
    )
    up = np.array([0.0, 0.0, gap])
    raised, open_by = pair.upper.mesh.moved(up[1:]), section.shifted(gap)
    space = RingSpace.within(
        open_by,
        np.tile(open_by.gap[:, None], count),
        inf,
        where=f"stop '{contact.name}'",
        more="where the guide allows the needle to touch there, smaller elements on both "
        "surfaces (mesh.surfaces), a smaller guide.clearance, or guiding heights farther "
        "apart. Else ",
    )
    meeting = Meeting(
        name=contact.name,
        space=space,
        reach=static.space.reach,
        arm=np.array([0.0, 0.0, float(space.points[:, 2].mean() - centre[2])]),
        gaps=RingGaps.of(
            open_by,
            raised,
            pair.upper_surface,
            pair.lower.mesh,
            pair.lower_surface,
            angle=angle,
            centre=centre + up if upper_moves else centre,
            form=pair.form,
        ),
        pairing=pairing,
    )
    faces = None
    if friction is not None:
        surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
        faces = RingFriction.on(friction, space.section.shifted(-gap), *surfaces)
    ring = RingContact(
        name=contact.name,
        upper=pair.upper.name,
        lower=pair.lower.name,
        space=space,
        faces=faces,
    )
    return meeting, ring


def _revolved(
    case: ValveCase,
    body: ElasticBody,
    pool: Modes,
    ports: Sequence[Port],
    sections: Mapping[str, RingSections],
) -> RevolvedBody:
    patterns = np.column_stack([port.pattern for port in ports])
    choice = selection_of(case.reduction.choice(body.name))
    kept = kept_modes(choice, pool, patterns)
    return turned(case, body, kept, _joined(sections) if sections else None)


def _joined(sections: Mapping[str, RingSections]) -> RingSections:
    """Sections of one body in all guides."""
    parts = list(sections.values())
    return RingSections(
        heights=np.concatenate([part.heights for part in parts]),
        weights=csr_array(vstack([part.weights for part in parts])),
        points=parts[0].points,
    )


def _tell_stiff(body: RevolvedPoints) -> None:
    """Warn of a body that cannot vibrate across its axis."""
    if not np.any((body.order == 1) & (body.body.omega > 0.0)):
        name, free = body.body.name, body.body.rigid.shape[1] > 0
        moves = "moves as a rigid body" if free else "does not vibrate"
        warnings.warn(
            f"'{name}' keeps no elastic mode of order 1: across its axis it {moves}, and deforms "
            f"only statically. Try: more modes in reduction.modes.{name}.",
            AccuracyWarning,
            stacklevel=2,
        )


def in_all_orders(body: ReducedBody, points: RevolvedPoints) -> ReducedBody:
    """Reduced body with modes of all orders, whose ports push those of order 0.

    Parameters
    ----------
    body
        In motion along the axis.
    points
        The same, with the same modes of order 0.
    """
    own, rigid = points.body, points.body.rigid.shape[1]
    elastic = body.mode_count - body.rigid_count
    shapes = np.zeros((len(own.omega), len(body.port_names)))
    shapes[:rigid] = own.rigid[2][:, None]  # a resultant of 1 N along the axis
    shapes[rigid : rigid + elastic] = body.port_shapes[body.rigid_count :]
    observed = np.zeros((len(own.omega), len(body.observer_names)))
    observed[rigid : rigid + elastic] = body.observer_shapes[body.rigid_count :]
    return replace(
        body,
        omega=own.omega,
        damping=own.damping,
        port_shapes=shapes,
        observer_shapes=observed,
        rigid_count=rigid,
        rigid_axial=body.mass * own.rigid[2],
        recovery=None,
    )
