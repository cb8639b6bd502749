"""Stiffness of the contact region alone: the classical constant contact stiffness.

The usual recipe for reduced bodies takes it from a static model of a small region around the
contact, fixed at its cut, and fits a straight line: the "linear, 1e9 N/m" of the literature.  It
depends on the size of the region (a larger one yields more) and on the load, and the modes count
part of it again.  It serves to reproduce the recipe; the consistent law
(:mod:`klack.contact.local_law`) needs no such choice.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.statics import StaticContact, contact_compliance, static_contact
from klack.errors import refuse_if, require_positive
from klack.machine.cache.result_cache import ResultCache

__all__ = ["LocalStiffness", "local_stiffness"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalStiffness:
    """Force against approach of the contact region alone, and a line through it.

    Parameters
    ----------
    static
        Of the region.
    stiffness [N/m]
        Of the least-squares line within ``fit_range``.
    fit_range [N]
    size [m]
        Distance from the contact within which the bodies deform.
    """

    static: StaticContact
    stiffness: float
    fit_range: tuple[float, float]
    size: float


def local_stiffness(
    static: StaticContact,
    body_a: ElasticBody,
    body_b: ElasticBody,
    *,
    size: float,
    fit_share: tuple[float, float] = (0.5, 1.0),
    cache: ResultCache | None = None,
) -> LocalStiffness:
    """Linear stiffness of the region within ``size`` of the contact, both bodies together.

    Nodes farther than ``size`` from the points that carry at the end of the ladder are held.

    Parameters
    ----------
    static
        Of the full bodies: where the contact is, and up to which force.
    size [m]
        Some half widths of the contact; the result depends on it.
    fit_share [-]
        Range of the fit over the highest force.
    """
    require_positive("contact submodel: size", size, "m")
    low, high = fit_share
    refuse_if(
        not 0 <= low < high <= 1,
        "contact submodel: fit_share",
        got=f"{low:g} to {high:g}",
        expected="two shares between 0 and 1, the lower one first",
        hint="0.5 to 1 fits the upper half of the force range.",
    )
    space = static.space
    carrying = space.points[static.pressures[-1] > 0]
    with (
        Flexibility(_region(body_a, carrying, size), cache=cache) as first,
        Flexibility(_region(body_b, carrying, size), cache=cache) as second,
    ):
        C = contact_compliance(space, first, second)
    yields = np.diag(C) > 1e-6 * np.max(np.diag(C))  # a held point has no compliance at all
    space, C = space.restricted(yields), C[np.ix_(yields, yields)]
    region = static_contact(space, C, static.max_force, count=len(static.force))
    fit_range = (low * static.max_force, high * static.max_force)
    # the ladder may end 1 % above the force that was asked for
    inside = (region.force >= fit_range[0]) & (region.force <= 1.011 * fit_range[1])
    refuse_if(
        np.count_nonzero(inside) < 3,
        "contact submodel: fit_share",
        got=f"{np.count_nonzero(inside)} states of the ladder within the fit range",
        expected="three or more",
        hint="widen the range, or use a ladder with more states.",
    )
    slope = np.polyfit(region.approach[inside], region.force[inside], 1)[0]
    return LocalStiffness(
        static=region,
        stiffness=float(slope),
        fit_range=fit_range,
        size=size,
    )


def _region(body: ElasticBody, carrying: NDArray[np.float64], size: float) -> ElasticBody:
    """Body with everything beyond ``size`` held."""
    distance, _ = scipy.spatial.cKDTree(carrying).query(body.mesh.points)
    beyond = np.flatnonzero(distance > size)
    free = body.mesh.node_count - len(beyond)
    refuse_if(
        not len(beyond) or free < 10,
        "contact submodel: size",
        got=f"{size * 1e3:.4g} mm, which lets {free} of {body.mesh.node_count} nodes of "
        f"'{body.name}' deform",
        expected="a region larger than a few elements and smaller than the body",
        hint="a few half widths of the contact are usual, for example 0.2 to 1 mm.",
    )
    d = body.mesh.dimension
    held = (d * beyond[:, None] + np.arange(d)).ravel()
    return replace(body, fixed=np.union1d(body.fixed, held))
