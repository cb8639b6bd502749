"""End stops of a valve: where two bodies meet, their static contact, and the law that is left.

One stop is what one impact is: two surfaces, a ladder of static contact states, a pressure pattern
that makes a port of each body, and a local law.  Several stops share their bodies, so each body is
meshed and factorised once and carries one port for each of its stops.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi, sqrt

import numpy as np

from klack.assembling.bodies import BodyPair
from klack.assembling.damping_choice import damping_of
from klack.assembling.ladder import effective_mass, static_ladder
from klack.assembling.modes import selection_of
from klack.case.valve import ValveCase
from klack.case.valve_sections import CaseStop
from klack.contact.laws import ContactLaw, LinearLaw, TableLaw
from klack.contact.local_law import LocalLaw, consistent_law
from klack.contact.mortar import touching_shift
from klack.contact.statics import StaticContact
from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import Modes
from klack.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.mesh.rigid import Pose
from klack.progress import Progress
from klack.reduction.ports import Port
from klack.reduction.reduce import reduce_body
from klack.reduction.reduced_body import ReducedBody
from klack.simulation.impact import simulate
from klack.simulation.system import ContactPair, ReducedSystem
from klack.stages import trial

__all__ = ["StopContact", "build_stop", "split_law", "stop_law"]

_FIRST_FORCE = 0.7  # of the end of the ladder: about the peak of an impact of elastic bodies
_ROUNDS = 3
_SETTLED = 0.02
_CONTACT_TIMES = 3.0  # of a rigid mass on the secant of the static contact
_STEP = 20e-9
_BULK_SHARE = 0.9


@dataclass(frozen=True, kw_only=True, eq=False)
class StopContact:
    """Static contact of one end stop, and the ports that it gives to its two bodies.

    Parameters
    ----------
    name : str
    pair : BodyPair
        Both bodies as they touch; the meshes are moved copies, the matrices are shared.
    static : StaticContact
    ports : pair of Port
        Of the upper and of the lower body, resultant +1 N along z each, named like the surface.
    pattern_force : float [N]
        Force at which the pressure pattern of the ports was taken: the peak of an impact at the
        speed of the case.
    """

    name: str
    pair: BodyPair
    static: StaticContact
    ports: tuple[Port, Port]
    pattern_force: float


def build_stop(
    case: ValveCase,
    name: str,
    bodies: Mapping[str, ElasticBody],
    flexibilities: Mapping[str, Flexibility],
    pools: Mapping[str, Modes],
    progress: Progress,
) -> StopContact:
    """Bring two surfaces together, solve their static contact and settle the port pattern.

    The pattern is that at the peak force of one impact of the two bodies alone, at the speed that
    the case gives for this stop.

    Raises
    ------
    InputError
        For surfaces that do not face each other, or a stop between two held bodies.
    """
    stop = case.stops[name]
    pair = _touching(name, stop, bodies)
    flexibility = [flexibilities[body.name] for body in (pair.upper, pair.lower)]
    static = static_ladder(
        pair,
        *flexibility,
        energy=0.5 * effective_mass(pair) * stop.speed**2,
        closing=stop.force,
        reach=stop.reach,
        progress=progress,
    )
    force = _FIRST_FORCE * static.max_force
    for _ in range(_ROUNDS):
        ports = _contact_ports(pair, static, force)
        with trial():  # the law of the stop comes with all its ports, and says what it lacks
            peak = _peak_force(case, stop, pair, static, ports, flexibility, pools)
        settled = abs(peak - force) <= _SETTLED * force
        force = min(peak, static.max_force)
        if settled:
            break
    ports = _contact_ports(pair, static, force)
    return StopContact(name=name, pair=pair, static=static, ports=ports, pattern_force=force)


def stop_law(contact: StopContact, upper: ReducedBody, lower: ReducedBody) -> LocalLaw:
    """Local law that carries what the modes of the two bodies miss at this stop."""
    compliance = 0.0
    for body, port in zip((upper, lower), contact.ports, strict=True):
        i = body.port_index(port.name)
        compliance += float(body.modal_compliance[i, i])
    return consistent_law(contact.static, compliance)


@lru_cache(maxsize=100)
def split_law(local: LocalLaw) -> tuple[TableLaw, float]:
    r"""Cut a local law into the faces and the bulk behind them.

    .. math:: \delta_{loc}(P) = \delta_{faces}(P) + D P, \qquad D = 0.9 \min \delta_{loc}'(P)

    A squeeze film lies between the faces, beside their contact, and presses on the same bulk.  The
    bulk yields in proportion to the force, whatever presses; what is left grows with the contact
    zone and stays monotone.

    Returns
    -------
    law : TableLaw
        Of the faces.
    D : float [m/N]
        Series compliance.
    """
    force, indentation = np.append(0.0, local.force), np.append(0.0, local.force_indentation)
    D = _BULK_SHARE * float(np.min(np.diff(indentation) / np.diff(force)))
    return TableLaw((indentation - D * force)[1:], local.force), D


def _touching(name: str, stop: CaseStop, bodies: Mapping[str, ElasticBody]) -> BodyPair:
    upper, lower = bodies[stop.upper.body], bodies[stop.lower.body]
    if upper.is_fixed and lower.is_fixed:
        raise InputError(
            f"stops.{name}.between",
            got=f"the held bodies '{upper.name}' and '{lower.name}'",
            expected="at least one body that can move",
            hint="remove 'fixed' from the needle.",
        )
    surfaces = upper.mesh.surface(stop.upper.surface), lower.mesh.surface(stop.lower.surface)
    shift = touching_shift(upper.mesh, surfaces[0], lower.mesh, surfaces[1])
    along = np.array([0.0] * (upper.dimension - 1) + [shift])
    return BodyPair(
        upper=replace(upper, mesh=upper.mesh.moved(along)),
        lower=lower,
        upper_surface=surfaces[0],
        lower_surface=surfaces[1],
        pose=Pose.along_z(shift),
    )


def _contact_ports(pair: BodyPair, static: StaticContact, force: float) -> tuple[Port, Port]:
    load_upper, load_lower = static.load_patterns(force)
    return (
        Port(pair.upper_surface.name, load_upper),
        Port(pair.lower_surface.name, -load_lower),
    )


def _peak_force(
    case: ValveCase,
    stop: CaseStop,
    pair: BodyPair,
    static: StaticContact,
    ports: tuple[Port, Port],
    flexibilities: list[Flexibility],
    pools: Mapping[str, Modes],
) -> float:
    """Peak force [N] of an impact of the two reduced bodies alone."""
    bodies = (pair.upper, pair.lower)
    upper, lower = (
        reduce_body(
            body,
            [port],
            modes=selection_of(case.reduction.choice(body.name)),
            correction=case.reduction.correction,
            damping=damping_of(case.bodies[body.name].damping),
            modes_pool=pools[body.name],
            flexibility=flexibility,
        )
        for body, port, flexibility in zip(bodies, ports, flexibilities, strict=True)
    )
    secant = static.max_force / float(static.approach[-1])
    law: ContactLaw = LinearLaw(secant)
    if case.reduction.correction == "consistent":
        modal = float(upper.modal_compliance[0, 0] + lower.modal_compliance[0, 0])
        law = consistent_law(static, modal).law
    contact = ContactPair(
        body_a=upper.name,
        port_a=ports[0].name,
        body_b=lower.name,
        port_b=ports[1].name,
        law=law,
        gap=0.0,
    )
    # downwards if the upper body is free, else the lower one flies up
    velocities = {lower.name: stop.speed} if pair.upper.is_fixed else {upper.name: -stop.speed}
    record = simulate(
        ReducedSystem(bodies=(upper, lower), contacts=(contact,)),
        velocities=velocities,
        step=_STEP,
        duration=_CONTACT_TIMES * pi * sqrt(effective_mass(pair) / secant),
    )
    return float(record.peak_force.max())
