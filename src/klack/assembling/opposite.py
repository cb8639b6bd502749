"""The upper stop: meshed, placed, and its contact points chosen."""

from dataclasses import dataclass, replace

import numpy as np

from klack.assembling.bodies import (
    BodyPair,
    assemble_body,
    find_touch,
    mesh_body,
    named_contact,
)
from klack.assembling.candidates import Candidates
from klack.assembling.ladder import impact_energy, static_ladder
from klack.case.schema import Case
from klack.closing import Closing
from klack.contact.mortar import ContactSpace, touching_shift
from klack.contact.statics import StaticContact
from klack.elasticity.body import ElasticBody
from klack.elasticity.statics import Flexibility
from klack.mesh.mesh import Surface
from klack.mesh.rigid import Pose
from klack.progress import Progress

__all__ = ["OppositeStop", "build_opposite"]


@dataclass(frozen=True, kw_only=True, eq=False)
class OppositeStop(Closing):
    """A second end of the travel.

    Parameters
    ----------
    body : ElasticBody
        The upper stop, placed at the gap of the case.
    surface, moving_surface : Surface
        Of the stop and of the moving body.
    flexibility : Flexibility
    static : StaticContact
    space : ContactSpace
        Its contact points with the gaps of the start; body a is the stop.
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
    """Mesh the upper stop, place it, and solve its static contact.

    Parameters
    ----------
    case : Case
    pair : BodyPair
        The other two bodies, placed.
    moving : Flexibility
        Of the moving body.
    progress : callable
    threads : int, optional

    Returns
    -------
    OppositeStop, or None when the case has none.
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
    progress("upper stop", 0.5)
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
    """Return the same body a little higher; nothing but its place changes."""
    along = np.array([0.0] * (body.dimension - 1) + [distance])
    return replace(body, mesh=body.mesh.moved(along))
