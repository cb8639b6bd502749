"""Three bodies in a row: a struck one that may leave the body behind it, assembled as a valve.

Meshes, factors, modes, static contacts, ports and laws are those of the same bodies in a stroke.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt

from klack.assembling.ladder import closing_force, moving_energy
from klack.assembling.reduced_pair import impact_system
from klack.assembling.stops import StopContact
from klack.assembling.valve import Valve, build_valve_bodies, valve_of_bodies
from klack.bodies.elasticity.body import ElasticBody
from klack.case.bodies import SurfaceName
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.case.valve_sections import CaseStop, StrokeRun, ValveBody
from klack.errors import InputError
from klack.machine.progress import Progress
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ConstantForce
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import ConsistentStopLaw
from klack.network.component import Component
from klack.network.declaration import NetworkSection
from klack.simulation.system import ContactPair, ReducedSystem, ReturnSpring

__all__ = ["BACKING", "CONTACT", "BodyRow", "build_row", "row_as_valve"]

CONTACT, BACKING = "contact", "backing"
"""Stops of the valve: sections of the case."""

_CLAMP = "clamp"


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyRow:
    """Three bodies in a row, ready to meet.

    Parameters
    ----------
    valve
        Of the same bodies; stops :data:`CONTACT` and :data:`BACKING`.
    system
        With both contacts, in this order.
    """

    valve: Valve
    system: ReducedSystem

    def contact(self, name: str) -> StopContact:
        """Static contact of a stop."""
        return self.valve.contacts[name]


def build_row(case: Case, progress: Progress, *, threads: int | None = None) -> BodyRow:
    """Mesh, factorise and reduce three bodies, with the laws of both contacts."""
    try:
        valve_case = row_as_valve(case)
        bodies = build_valve_bodies(valve_case, progress)
        fast = valve_case.model_copy(update={"stops": _stops(case, bodies)})
        valve = valve_of_bodies(fast, bodies, progress, threads=threads)
    except InputError as error:
        raise _in_words_of(error) from error
    return BodyRow(valve=valve, system=_system(case, valve))


def _in_words_of(error: InputError) -> InputError:
    """The error at the key of the impact instead of that of the valve."""
    where = error.where.removeprefix("case: ").removeprefix("stops.")
    return InputError(where, got=error.got, expected=error.expected, hint=error.hint)


def row_as_valve(case: Case) -> ValveCase:
    """Valve of three bodies in a row: both contacts as end stops, the clamp a spring."""
    assert case.backing is not None
    sides = {CONTACT: case.contact.between, BACKING: case.backing.between}
    gaps = {CONTACT: case.contact.gap or 0.0, BACKING: case.backing.gap}
    clamp, struck = case.backing.clamp, case.contact.stop.body
    surfaces = [side for pair in sides.values() for side in pair]
    connections = []
    for name, (upper, lower) in sides.items():
        connections += [(str(upper), f"{name}.upper"), (str(lower), f"{name}.lower")]
    springs: dict[str, Component] = {}
    if clamp is not None:
        surfaces.append(SurfaceName(body=struck, surface=clamp.surface))
        connections.append((str(surfaces[-1]), f"{_CLAMP}.end"))
        springs[_CLAMP] = (
            Spring(stiffness=clamp.stiffness, preload=clamp.preload)
            if clamp.stiffness
            else ConstantForce(force=-clamp.preload)
        )
    bodies: dict[str, Component] = {
        body: FlexibleBody(
            body=body,
            points=tuple(side.surface for side in surfaces if side.body == body),
            speed=-case.motion.speed if body == case.contact.moving.body else 0.0,
        )
        for body in case.bodies
    }
    stops: dict[str, Component] = {
        name: EndStop(gap=gaps[name], law=ConsistentStopLaw(kind="consistent")) for name in sides
    }
    return ValveCase.model_construct(
        **{name: getattr(case, name) for name in ("klack", "title", "description", "materials")},
        bodies={
            name: ValveBody.model_construct(**dict(body), ports={})
            for name, body in case.bodies.items()
        },
        stops=_stops(case, {}),
        reduction=case.reduction,
        network=NetworkSection.model_construct(
            components={**bodies, **stops, **springs}, connections=tuple(connections)
        ),
        motion="axial",
        run=StrokeRun.model_construct(
            duration=case.run.duration, lift=case.contact.moving, seat=CONTACT
        ),
    )


def _stops(case: Case, bodies: Mapping[str, ElasticBody]) -> dict[str, CaseStop]:
    """Both contacts, each with a speed at which it takes all energy of the body that moves."""
    assert case.backing is not None
    way = (case.contact.gap or 0.0) + case.backing.gap

    def stop(
        between: tuple[SurfaceName, SurfaceName], force: float, reach: float | None
    ) -> CaseStop:
        speed = case.motion.speed
        if bodies:
            free = [bodies[side.body] for side in between if not bodies[side.body].is_fixed]
            energy = moving_energy(case, bodies[case.contact.moving.body].mass, way)
            speed = sqrt(2.0 * energy * sum(1.0 / body.mass for body in free))
        return CaseStop.model_construct(between=between, speed=speed, force=force, reach=reach)

    closing = closing_force(case)
    return {
        CONTACT: stop(case.contact.between, closing, case.contact.reach),
        BACKING: stop(case.backing.between, closing + case.backing.preload, case.backing.reach),
    }


def _system(case: Case, valve: Valve) -> ReducedSystem:
    """The impact of the upper two bodies, and what is below.

    Laws are elastic: one with memory is not for several contacts.
    """
    assert case.backing is not None
    moving, struck = case.contact.between
    lower, third = case.backing.between
    system = impact_system(
        case,
        valve.reduced[moving.body],
        valve.reduced[struck.body],
        valve.laws[CONTACT].local.law,
        ports=(moving.surface, struck.surface),
    )
    second = ContactPair(
        body_a=lower.body,
        port_a=lower.surface,
        body_b=third.body,
        port_b=third.surface,
        law=valve.laws[BACKING].local.law,
        gap=case.backing.gap,
        preload=case.backing.preload,
    )
    springs, clamp = system.springs, case.backing.clamp
    if clamp is not None:
        pressed = ReturnSpring(
            body=lower.body, port=clamp.surface, stiffness=clamp.stiffness, preload=clamp.preload
        )
        springs = (*springs, pressed)
    return replace(
        system,
        bodies=(*system.bodies, valve.reduced[third.body]),
        contacts=(*system.contacts, second),
        springs=springs,
    )
