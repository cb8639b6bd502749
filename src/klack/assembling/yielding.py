"""Static loops of a contact whose bodies yield, in the meridian plane.

The same for the contact of an impact and an end stop of a valve.  Where a law has no yield though
the materials do, a warning says so and the law stays elastic.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from threadpoolctl import threadpool_limits

from klack.assembling.limit_fit import fitted_limit
from klack.case.bodies import CaseFile
from klack.contact.mortar import ContactSpace
from klack.contact.statics import ReachError, StaticContact, extended_compliance
from klack.contact.yielding_law import YieldingLaw
from klack.elasticity.body import ElasticBody
from klack.elasticity.statics import Flexibility
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.plasticity.ladder import YieldingContact
from klack.plasticity.loaded_body import LoadedBody
from klack.plasticity.loops import YieldingLoops, yielding_loops
from klack.plasticity.stored_loops import loops_of_entry, loops_to_entry
from klack.plasticity.yielding_body import YieldingBody
from klack.plasticity.yielding_fit import yielding_law
from klack.progress import Progress

__all__ = ["law_loops", "law_with_yield", "loaded_body", "loops_with_yield"]

Floats = NDArray[np.float64]

_LEFT_OUT = "the contact leaves out the yield of its faces"

_ZONE = 5.0
"""Radius of the first zone, over the half width of the elastic contact at its highest force."""


def loaded_body(case: CaseFile, body: ElasticBody, flexibility: Flexibility) -> LoadedBody:
    """Body of a contact with its materials; one that is given by its matrices does not yield."""
    given = case.bodies[body.name].material is None
    materials = {} if given else case.materials_of(body.name, body.mesh.solids)
    return LoadedBody(body=body, flexibility=flexibility, materials=materials)


def law_loops(
    static: StaticContact,
    upper: LoadedBody,
    lower: LoadedBody,
    wider: Callable[[ContactSpace, ReachError], ContactSpace],
    *,
    energy: float,
    closing: float,
    beside: str,
    progress: Progress,
) -> YieldingLoops | None:
    """Static loops for the law of a reduced model; None where it stays elastic.

    They are kept in the cache of the upper body.  Bodies of three dimensions are told of by
    :func:`klack.analyses.impact.yield_check.check_yield`.

    Parameters
    ----------
    static : StaticContact
        Of the elastic bodies, beyond that energy.
    upper, lower : LoadedBody
    wider : callable
        Contact points of the same surfaces that reach further, or the error again.
    energy : float [J]
    closing : float [N]
        Force that keeps working while the bodies approach.
    beside : str
        Key of what else the law has, and so has no yield; empty for nothing.
    progress : callable

    Warns
    -----
    AccuracyWarning
        Where yield is left out though the materials have it.
    """
    if not (upper.yields or lower.yields) or upper.body.dimension != 2:
        return None
    if beside:
        warnings.warn(
            f"{_LEFT_OUT}: faces have either yield or {beside}. Try: the case without the latter.",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    progress("faces that yield", 0.0)

    def computed() -> YieldingLoops:
        space, C = static.space, static.compliance
        while True:
            try:
                # small matrices: threads of the BLAS would wait for each other
                with threadpool_limits(limits=1, user_api="blas"):
                    return loops_with_yield(
                        static, space, C, upper, lower, energy=energy, closing=closing
                    )
            except ReachError as error:
                space = wider(space, error)
                C = extended_compliance(space, static, upper.flexibility, lower.flexibility)

    try:
        loops = upper.flexibility.remembered(
            "static loops with yield and limit",
            (
                lower.flexibility.key,
                static.space.gap,
                static.compliance,
                static.approach,
                *upper.plastic_numbers,
                *lower.plastic_numbers,
                energy,
                closing,
            ),
            computed,
            loops_to_entry,
            loops_of_entry,
        )
    except (ConvergenceError, InputError) as error:
        warnings.warn(f"{_LEFT_OUT}: {error}", AccuracyWarning, stacklevel=2)
        return None
    progress("faces that yield", 1.0)
    return loops if loops.states else None


def law_with_yield(loops: YieldingLoops, modal_compliance: float) -> YieldingLaw | None:
    """Law of these loops, see :func:`klack.plasticity.yielding_fit.yielding_law`; None for none.

    Warns
    -----
    AccuracyWarning
        Where there is none.
    """
    try:
        return yielding_law(loops, modal_compliance)
    except InputError as error:
        warnings.warn(f"{_LEFT_OUT}: {error}", AccuracyWarning, stacklevel=2)
        return None


def loops_with_yield(
    static: StaticContact,
    space: ContactSpace,
    C: Floats,
    upper: LoadedBody,
    lower: LoadedBody,
    *,
    energy: float,
    closing: float,
) -> YieldingLoops:
    """Static loops up to the energy of an impact, and the pressure limit fitted to them.

    Parameters
    ----------
    static : StaticContact
        Of the elastic bodies, beyond that energy: it says where they may yield first.
    space : ContactSpace
        Of that contact, or wider.
    C : array, shape (nc, nc) [m/N]
        Elastic compliance of both bodies at its points.
    upper, lower : LoadedBody
    energy : float [J]
    closing : float [N]
        Force that keeps working while the bodies approach.

    Raises
    ------
    ConvergenceError
        Where the loops end below the impact.
    ReachError
        Where the contact grows to the border of the candidate points.
    """
    weight = static.pressures[-1] / static.pressures[-1].sum()
    place = weight @ static.space.points
    if place[0] < static.half_width[-1]:
        place[0] = 0.0
    radius = _ZONE * max(float(static.half_width[-1]), 2.0 * float(weight @ static.space.size))
    bodies = [
        YieldingBody(one, csr_array(rows), place, radius)
        for one, rows in ((upper, space.G_a), (lower, space.G_b))
        if one.elements_near(place, radius).any()
    ]
    loops = yielding_loops(
        YieldingContact(space, C, bodies),
        deepest=float(static.approach[-1]),
        energy=energy,
        closing=closing,
    )
    return replace(loops, pressure_limit=fitted_limit(loops, space, C))
