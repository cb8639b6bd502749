"""End stops of a valve: static contact of two bodies, and the law that is left.

A stop is as an impact: two surfaces, a ladder of static contact states, a pressure pattern that
makes a port of each body, and a local law. Bodies are meshed and factorised once, with a port for
each of their stops.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from klack.assembling.bodies import BodyPair
from klack.assembling.candidates import Candidates
from klack.assembling.ladder import effective_mass, static_ladder, wider_space
from klack.assembling.modes import damping_of, selection_of
from klack.assembling.rubbing import fitted_loops, static_loops
from klack.assembling.yielding import law_loops, law_with_yield, loaded_body
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case.valve import ValveCase
from klack.case.valve_consistency import is_consistent
from klack.case.valve_sections import CaseStop
from klack.contact.laws import ContactLaw, LinearLaw, TableLaw
from klack.contact.local_law import LocalLaw, consistent_law
from klack.contact.mortar import ContactSpace, touching_shift
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.statics import ReachError, StaticContact
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.machine.progress import Progress
from klack.machine.stages import trial, warnings_of
from klack.mesh.rigid import Pose
from klack.simulation.impact import simulate
from klack.simulation.system import ContactPair, ReducedSystem
from klack.transient.rubbing_ladder import RubbingContact

__all__ = [
    "StopContact",
    "StopFaces",
    "build_stop",
    "bulk_compliance",
    "stop_law",
    "without_bulk",
]

StopTable = TableLaw | RubbingLaw | YieldingLaw

_FIRST_FORCE = 0.7  # of the end of the ladder: about the peak of an impact of elastic bodies
_ROUNDS = 3
_SETTLED = 0.02
_CONTACT_TIMES = 3.0  # of a rigid mass on the secant of the static contact
_STEP = 20e-9
_BULK_SHARE = 0.9


@dataclass(frozen=True, kw_only=True, eq=False)
class StopContact:
    """Static contact of one end stop, and its ports.

    Parameters
    ----------
    pair
        Touching; meshes are moved copies, matrices shared.
    static
        Without friction.
    ports
        Upper and lower, resultant +1 N along z each, named like the surface.
    pattern_force [N]
        Of the pressure pattern: peak of an impact at the speed of the case.
    rubbing
        With friction.
    loops
        Of faces that yield.
    """

    name: str
    pair: BodyPair
    static: StaticContact
    ports: tuple[Port, Port]
    pattern_force: float
    rubbing: RubbingContact | None = None
    loops: YieldingLoops | None = None

    @property
    def closing(self) -> StaticContact:
        """Static contact while closing, with friction."""
        return self.static if self.rubbing is None else self.rubbing.closing

    @property
    def key(self) -> str:
        """Friction of the faces in the case."""
        return _friction_key(self.name)


@dataclass(frozen=True, kw_only=True, eq=False)
class StopFaces:
    """Law of an end stop, alone and beside a squeeze film.

    Parameters
    ----------
    local
        While closing, with its shares.
    law
        All that the modes miss; with memory for friction or yield.
    faces
        Without the bulk, on which a film presses as well.
    bulk [m/N]
        Series compliance behind ``faces``.
    """

    local: LocalLaw
    law: StopTable
    faces: StopTable
    bulk: float


def build_stop(
    case: ValveCase,
    name: str,
    bodies: Mapping[str, ElasticBody],
    flexibilities: Mapping[str, Flexibility],
    pools: Mapping[str, Modes],
    progress: Progress,
) -> StopContact:
    """Bring two surfaces together, solve their static contact and settle the port pattern.

    It is that at the peak force of one impact of both bodies at the speed of the stop. Rejects a
    stop between two held bodies.
    """
    stop = case.stops[name]
    pair = touching(name, stop, bodies)
    flexibility = [flexibilities[body.name] for body in (pair.upper, pair.lower)]
    static, _ = static_ladder(
        Candidates(pair, *flexibility),
        energy=0.5 * effective_mass(pair) * stop.speed**2,
        closing=stop.force,
        reach=stop.reach,
        progress=progress,
        worn=None if stop.worn is None else stop.worn.faces,
    )
    rubbing = None
    if stop.friction > 0.0:
        with warnings_of(f"stop '{name}'"):
            upper, lower = flexibility
            rubbing = static_loops(
                static, pair, upper, lower, stop.friction, key=_friction_key(name)
            )
    loops = None
    # contact point by point is elastic, and told as such
    yields = case.motion == "axial" and stop.worn is None
    if yields and is_consistent(case.network.components[name]):
        with warnings_of(f"stop '{name}'"):
            loops = _loops(case, stop, pair, flexibility, static, progress, name)
    loaded = static if rubbing is None else rubbing
    found = StopContact(
        name=name,
        pair=pair,
        static=static,
        ports=_ports_at(_FIRST_FORCE * loaded.max_force, pair, loaded),
        pattern_force=_FIRST_FORCE * loaded.max_force,
        rubbing=rubbing,
        loops=loops,
    )
    for _ in range(_ROUNDS):
        with trial():  # the law of the stop comes with all its ports, and says what it lacks
            peak = _peak_force(case, stop, found, flexibility, pools)
        settled = abs(peak - found.pattern_force) <= _SETTLED * found.pattern_force
        force = min(peak, loaded.max_force)
        found = replace(found, ports=_ports_at(force, pair, loaded), pattern_force=force)
        if settled:
            break
    return found


def _loops(
    case: ValveCase,
    stop: CaseStop,
    pair: BodyPair,
    flexibilities: list[Flexibility],
    static: StaticContact,
    progress: Progress,
    name: str,
) -> YieldingLoops | None:
    def wider(space: ContactSpace, error: ReachError) -> ContactSpace:
        if stop.reach is not None:
            raise error
        return wider_space(pair, space)

    return law_loops(
        static,
        loaded_body(case, pair.upper, flexibilities[0]),
        loaded_body(case, pair.lower, flexibilities[1]),
        wider,
        energy=0.5 * effective_mass(pair) * stop.speed**2,
        closing=stop.force,
        beside=_friction_key(name) if stop.friction > 0.0 else "",
        progress=progress,
    )


def stop_law(contact: StopContact, upper: ReducedBody, lower: ReducedBody) -> StopFaces:
    """Law of what the modes of both bodies miss at this stop.

    Warns
    -----
    AccuracyWarning
        Of missing friction or yield.
    """
    modal = 0.0
    for body, port in zip((upper, lower), contact.ports, strict=True):
        i = body.port_index(port.name)
        modal += float(body.modal_compliance[i, i])
    local, rubbing, key = consistent_law(contact.closing, modal), contact.rubbing, contact.key
    whole = None if contact.loops is None else law_with_yield(contact.loops, modal)
    if contact.loops is not None and whole is not None:
        D = bulk_compliance(local, whole)
        alone = law_with_yield(contact.loops, modal + D)
        if alone is not None:
            return StopFaces(local=local, law=whole, faces=alone, bulk=D)
    fit = None if rubbing is None else fitted_loops(rubbing, local, key=key)
    law = local.law if fit is None else fit.law
    D = bulk_compliance(local, law)
    beside = without_bulk(local, D)
    if rubbing is None or not isinstance(law, RubbingLaw):
        return StopFaces(local=local, law=law, faces=beside.law, bulk=D)
    fit = fitted_loops(rubbing, beside, key=f"{key} together with a film")
    return StopFaces(local=local, law=law, faces=beside.law if fit is None else fit.law, bulk=D)


def bulk_compliance(local: LocalLaw, law: StopTable) -> float:
    r"""Compliance [m/N] of the bulk behind the faces, in series with them and with a film.

    .. math:: \delta_{loc}(P) = \delta_{faces}(P) + D P, \qquad D = 0.9 \min \delta_{loc}'(P)

    A squeeze film beside the contact presses on the same bulk, which yields in proportion to the
    force; what is left grows with the contact zone and stays monotone. Faces with friction are
    stiffest where all hold, faces that yield where they open; *D* is 0.9 of their compliance
    there.
    """
    force, indentation = np.append(0.0, local.force), np.append(0.0, local.force_indentation)
    least = float(np.min(np.diff(indentation) / np.diff(force)))
    if not isinstance(law, TableLaw):
        least = min(least, 1.0 / float(np.max(law.tangent_stiffness(indentation))))
    return _BULK_SHARE * least


def without_bulk(local: LocalLaw, D: float) -> LocalLaw:
    """Local law of the faces alone, as if the modes included the bulk's *D* [m/N].

    Both are linear and in series: loops of faces with friction keep their loss.
    """
    indentation = local.force_indentation - D * local.force
    return replace(
        local,
        law=TableLaw(indentation, local.force),
        share=indentation / local.approach,
        tangent_share=np.diff(indentation, prepend=0.0) / np.diff(local.approach, prepend=0.0),
        modal_compliance=local.modal_compliance + D,
    )


def touching(name: str, stop: CaseStop, bodies: Mapping[str, ElasticBody]) -> BodyPair:
    """Both bodies of a stop, the upper one moved to first touch."""
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


def _friction_key(stop: str) -> str:
    return f"stops.{stop}.friction"


def _ports_at(
    force: float, pair: BodyPair, loaded: StaticContact | RubbingContact
) -> tuple[Port, Port]:
    """Ports in the shape of pressure and friction at a force."""
    load_upper, load_lower = loaded.load_patterns(force)
    return Port(pair.upper_surface.name, load_upper), Port(pair.lower_surface.name, -load_lower)


def _peak_force(
    case: ValveCase,
    stop: CaseStop,
    touching: StopContact,
    flexibilities: list[Flexibility],
    pools: Mapping[str, Modes],
) -> float:
    """Peak force [N] of an impact of the two reduced bodies."""
    pair, static, ports = touching.pair, touching.static, touching.ports
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
            shifts=case.reduction.shifts_of(body.name, case.reduction.correction),
        )
        for body, port, flexibility in zip(bodies, ports, flexibilities, strict=True)
    )
    secant = static.max_force / float(static.approach[-1])
    law: ContactLaw | RubbingLaw | YieldingLaw = LinearLaw(secant)
    if case.reduction.correction == "consistent":
        law = stop_law(touching, upper, lower).law
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
