"""Bodies of a case in their places, and the contact problem of an impact."""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from klack.assembling.bodies import (
    BodyPair,
    assemble_body,
    build_bodies,
    find_touch,
    mesh_body,
    named_contact,
)
from klack.assembling.candidates import Candidates, CondensedSpace
from klack.assembling.ladder import closing_force, impact_energy, static_ladder, wider_space
from klack.assembling.rubbing import static_loops
from klack.assembling.yielding import law_loops, loaded_body
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.budget import Budget
from klack.bodies.elasticity.eigen import mode_memory
from klack.bodies.elasticity.statics import Flexibility
from klack.case.schema import Case
from klack.contact.mortar import ContactSpace, touching_shift
from klack.contact.pairing import axial_distance
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.plasticity.yielding_body import LoadedBody
from klack.contact.statics import ReachError, StaticContact
from klack.contact.worn_faces import opened_by
from klack.files.closing import Closing
from klack.machine.cache.result_cache import result_cache
from klack.machine.cores import blas_threads, side_by_side, threads_for
from klack.machine.progress import Progress, remark
from klack.mesh.mesh import Surface
from klack.mesh.rigid import Pose
from klack.transient.rubbing_ladder import RubbingContact

__all__ = ["ContactProblem", "PlacedBodies", "build_problem", "contact_problem", "place_bodies"]


@dataclass(frozen=True, kw_only=True, eq=False)
class OppositeStop(Closing):
    """Upper stop, placed at the gap of the case.

    Parameters
    ----------
    surface, moving_surface
        Of the stop and of the moving body.
    space
        With the gaps of the start; body a is the stop.
    """

    body: ElasticBody
    surface: Surface
    moving_surface: Surface
    flexibility: Flexibility
    static: StaticContact
    space: ContactSpace

    def close(self) -> None:
        """Free the factorisation."""
        self.flexibility.close()


def build_opposite(
    case: Case,
    pair: BodyPair,
    moving: Flexibility,
    progress: Progress,
    *,
    threads: int | None = None,
) -> OppositeStop | None:
    """Mesh the upper stop, if any, place it, and solve its static contact.

    Parameters
    ----------
    pair
        The other two, placed.
    moving
        Of the moving body.
    """
    asked = case.opposite
    if asked is None:
        return None
    progress("upper stop", 0.0)
    name = asked.stop.body
    with named_contact(case, ("opposite", "between"), asked.stop, asked.moving):
        touch = find_touch(case.bodies, asked.stop, asked.moving)
    mesh = mesh_body(case.bodies[name], name, touch.upper if touch else ())
    surface = mesh.surface(asked.stop.surface)
    moving_surface = pair.upper.mesh.surface(asked.moving.surface)
    with named_contact(case, ("opposite", "between"), asked.stop, asked.moving):
        shift = touching_shift(mesh, surface, pair.upper.mesh, moving_surface)
    body = assemble_body(case, name, mesh.moved(np.array([0.0] * (mesh.dimension - 1) + [shift])))
    flexibility = Flexibility(body, threads=threads, cache=moving.cache)
    contact = BodyPair(
        upper=body,
        lower=pair.upper,
        upper_surface=surface,
        lower_surface=moving_surface,
        pose=Pose.along_z(shift),
    )
    # nothing gathers more energy than the first impact may have, whatever drives it up there
    static, _ = static_ladder(
        Candidates(contact, flexibility, moving),
        energy=impact_energy(case, pair),
        closing=0.0,
        reach=asked.reach,
        progress=progress,
    )
    progress("upper stop", 1.0)
    return OppositeStop(
        body=_raised(body, asked.gap),
        surface=surface,
        moving_surface=moving_surface,
        flexibility=flexibility,
        static=static,
        space=static.space.shifted(asked.gap),
    )


def _raised(body: ElasticBody, distance: float) -> ElasticBody:
    """Same body, higher."""
    along = np.array([0.0] * (body.dimension - 1) + [distance])
    return replace(body, mesh=body.mesh.moved(along))


_USUAL_MODES = 50  # of a case that asks for a frequency


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedBodies(Closing):
    """Bodies of a case in their places, with their static solutions.

    The same for every impact of these bodies; an upper stop is not: its contact points are those
    that the energy of an impact can reach.

    Parameters
    ----------
    case
        With its gap, given or drawn.
    flexibility_upper, flexibility_lower
        :meth:`close` before a full-order run gives their memory back.
    candidates
        Points where they can touch.
    """

    case: Case
    pair: BodyPair
    flexibility_upper: Flexibility
    flexibility_lower: Flexibility
    candidates: Candidates
    opposite: OppositeStop | None = None

    @property
    def bodies(self) -> list[ElasticBody]:
        """The pair, then that of an upper stop."""
        above = () if self.opposite is None else (self.opposite.body,)
        return [self.pair.upper, self.pair.lower, *above]

    def keep_no_more(self) -> None:
        """Cache no more static solutions: many impacts ask for others."""
        for flexibility in self._flexibilities:
            flexibility.cache = None

    @property
    def threads(self) -> int | None:
        """Threads of BLAS: one, or all."""
        return threads_for(self.pair.unknowns)

    def close(self) -> None:
        """Free the factorisations."""
        for flexibility in self._flexibilities:
            flexibility.close()

    @property
    def _flexibilities(self) -> tuple[Flexibility, ...]:
        above = () if self.opposite is None else (self.opposite.flexibility,)
        return (self.flexibility_upper, self.flexibility_lower, *above)


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactProblem(PlacedBodies):
    """Bodies, points and static contact of one impact.

    Parameters
    ----------
    static
        Ladder beyond the highest force of the impact.
    condensed
        Compliance of each body at these points.
    """

    space: ContactSpace
    static: StaticContact
    condensed: CondensedSpace

    @cached_property
    def rubbing(self) -> RubbingContact | None:
        """Static contact with the friction of the case, if any; first used before :meth:`close`.

        Warns
        -----
        AccuracyWarning
            Where none is found, and the law of the reduced level stays smooth.
        """
        friction = self.case.contact.faces.kinetic
        if friction == 0.0:
            return None
        return static_loops(
            self.static,
            self.pair,
            self.flexibility_upper,
            self.flexibility_lower,
            friction,
            key="contact.friction",
        )

    @property
    def loaded(self) -> tuple[LoadedBody, LoadedBody]:
        """Upper and lower body with their materials."""
        return (
            loaded_body(self.case, self.pair.upper, self.flexibility_upper),
            loaded_body(self.case, self.pair.lower, self.flexibility_lower),
        )

    def yielding(self, progress: Progress) -> YieldingLoops | None:
        """Static loops of faces that yield; None where the law stays elastic.

        First used before :meth:`close`.

        Warns
        -----
        AccuracyWarning
            Of yield that is left out.
        """
        if self.case.contact.worn is not None:  # they do not yield any more
            return None
        return law_loops(
            self.static,
            *self.loaded,
            self.wider,
            energy=impact_energy(self.case, self.pair),
            closing=closing_force(self.case),
            beside="contact.friction"
            if not self.case.contact.faces.is_none
            else "contact.roughness"
            if self.pair.layer is not None
            else "",
            progress=progress,
        )

    def wider(self, space: ContactSpace, error: ReachError) -> ContactSpace:
        """Contact points with twice the reach of ``space``.

        ``error`` is raised again where the case gives the reach, or has an upper stop.
        """
        if self.case.contact.reach is not None or self.opposite is not None:
            raise error
        return opened_by(wider_space(self.pair, space), self.case.contact.worn_faces)


def build_problem(case: Case, progress: Progress, *, threads: int | None = None) -> ContactProblem:
    """Mesh, place, factorise, and solve the static contact; see :func:`contact_problem`."""
    return contact_problem(case, place_bodies(case, progress, threads=threads), progress)


def place_bodies(case: Case, progress: Progress, *, threads: int | None = None) -> PlacedBodies:
    """Mesh, place and factorise.

    A case without ``contact.gap`` gets the drawn one, where every level starts.
    """
    pair = build_bodies(case, progress)
    if case.contact.gap is None:
        case = _with_gap(case, _drawn_gap(pair))
    progress("factorise", 0.0)
    bodies = (pair.upper, pair.lower)
    # large ones take the memory that is left one after the other, as its plan says
    blas, of_solver = threads_for(pair.unknowns), threads_for(pair.unknowns, threads)
    at_once = threads != 1 and blas == 1
    with blas_threads(blas):
        upper, lower = side_by_side(
            [
                partial(
                    Flexibility,
                    body,
                    threads=of_solver,
                    cache=result_cache(),
                    budget=_budget(case, body, progress),
                    at_once=at_once,
                )
                for body in bodies
            ],
            at_once=at_once,
        )
    progress("factorise", 1.0)
    return PlacedBodies(
        case=case,
        pair=pair,
        flexibility_upper=upper,
        flexibility_lower=lower,
        candidates=Candidates(pair, upper, lower),
        opposite=build_opposite(case, pair, upper, progress, threads=of_solver),
    )


def contact_problem(case: Case, bodies: PlacedBodies, progress: Progress) -> ContactProblem:
    """Solve the static contact of an impact of placed bodies.

    An impact of relative speed v and effective mass m stores at most m v^2 / 2 and the work of
    closing forces, and the static curve gives force and approach at that energy. The candidate
    points reach further.

    Parameters
    ----------
    case
        Of these bodies and places; speed, forces and law may differ, not with an upper stop.
    """
    case = _with_gap(case, bodies.case.contact.gap)
    static, condensed = static_ladder(
        bodies.candidates,
        energy=impact_energy(case, bodies.pair),
        closing=closing_force(case),
        reach=case.contact.reach,
        progress=progress,
        worn=case.contact.worn_faces,
    )
    return ContactProblem(
        case=case,
        pair=bodies.pair,
        flexibility_upper=bodies.flexibility_upper,
        flexibility_lower=bodies.flexibility_lower,
        candidates=bodies.candidates,
        opposite=bodies.opposite,
        space=static.space,
        static=static,
        condensed=condensed,
    )


def _budget(case: Case, body: ElasticBody, progress: Progress) -> Budget:
    """Memory of the modes of a body while its factor is held."""
    choice = case.reduction.choice(body.name)
    count = choice.count or choice.pool or _USUAL_MODES
    return Budget(
        name=body.name,
        later=mode_memory(body, count),
        reason=f"{count} modes",
        tell=lambda line: remark(progress, line),
    )


def _drawn_gap(pair: BodyPair) -> float:
    sides = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    return axial_distance(*sides) if pair.form is None else -touching_shift(*sides, pair.form)


def _with_gap(case: Case, gap: float | None) -> Case:
    """The gap of the bodies, where the case has none."""
    if case.contact.gap is not None:
        return case
    contact = case.contact.model_copy(update={"gap": gap})
    return case.model_copy(update={"contact": contact})
