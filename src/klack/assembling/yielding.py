"""Static loops of a contact whose bodies yield, in the meridian plane.

The same for the contact of an impact and an end stop of a valve.  Where a law has no yield though
the materials do, a warning says so and the law stays elastic.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.contact.mortar import ContactSpace
from klack.contact.statics import ReachError, StaticContact, extended_compliance
from klack.elasticity.body import ElasticBody
from klack.elasticity.statics import Flexibility
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.materials import Material
from klack.plasticity.ladder import YieldingContact
from klack.plasticity.loops import YieldingLoops, yielding_loops
from klack.plasticity.radial_return import von_mises_of_strain
from klack.plasticity.stored_loops import loops_of_entry, loops_to_entry
from klack.plasticity.yielding_body import YieldingBody
from klack.plasticity.zone import plastic_zone, strain_points
from klack.progress import Progress

__all__ = ["LoadedBody", "law_loops", "loops_with_yield"]

Floats = NDArray[np.float64]

_ZONE = 5.0
"""Radius of the first zone, over the half width of the elastic contact at its highest force."""

_WIDER, _TRIES = 1.5, 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedBody:
    """One of the two bodies of a contact.

    Parameters
    ----------
    body : ElasticBody
        In the meridian plane.
    flexibility : Flexibility
    materials : mapping of str to Material
        Of its solids; those with hardening yield.
    """

    body: ElasticBody
    flexibility: Flexibility
    materials: Mapping[str, Material]

    @property
    def yields(self) -> bool:
        """Whether any of its solids may yield."""
        return any(material.hardening is not None for material in self.materials.values())

    @property
    def plastic_numbers(self) -> tuple[str | float, ...]:
        """Names of its solids that may yield, each with yield stress and both slopes [Pa]."""
        found: list[str | float] = []
        for solid, material in sorted(self.materials.items()):
            if material.hardening is not None:
                found += [solid, *astuple(material.hardening)]
        return tuple(found)

    def elements_near(self, place: Floats, radius: float) -> NDArray[np.bool_]:
        """Elements that may yield, within a radius of a place [m], shape (n_elements,)."""
        near = []
        for block in self.body.mesh.blocks:
            middle = self.body.mesh.points[block.connectivity].mean(axis=1)
            yields = self.materials[block.solid].hardening is not None
            near.append((np.linalg.norm(middle - place, axis=1) < radius) & yields)
        return np.concatenate(near)


def law_loops(
    static: StaticContact,
    upper: LoadedBody,
    lower: LoadedBody,
    wider: Callable[[ContactSpace, ReachError], ContactSpace],
    *,
    energy: float,
    closing: float,
    friction: float,
    key: str,
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
    friction : float [-]
        Between the faces: a law has one of the two.
    key : str
        Of the friction in the case, for words.
    progress : callable

    Warns
    -----
    AccuracyWarning
        Where yield is left out though the materials have it.
    """
    if not (upper.yields or lower.yields) or upper.body.dimension != 2:
        return None
    left = "the reduced level leaves out the yield of its faces"
    if friction > 0.0:
        warnings.warn(
            f"{left}: its law has either friction or yield. Try: the case without {key} beside it.",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    progress("faces that yield", 0.0)

    def computed() -> YieldingLoops:
        space, C = static.space, static.compliance
        while True:
            try:
                return loops_with_yield(
                    static, space, C, upper, lower, energy=energy, closing=closing
                )
            except ReachError as error:
                space = wider(space, error)
                C = extended_compliance(space, static, upper.flexibility, lower.flexibility)

    try:
        loops = upper.flexibility.remembered(
            "static loops with yield",
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
        warnings.warn(f"{left}: {error}", AccuracyWarning, stacklevel=2)
        return None
    progress("faces that yield", 1.0)
    return loops if loops.states else None


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
    """Static loops up to the energy of an impact.

    The zone that may yield is widened until the rest stays elastic.

    Parameters
    ----------
    static : StaticContact
        Of the elastic bodies, beyond that energy: it says where they may yield.
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
        Where a zone as large as the contact does not hold what yields.
    ReachError
        Where the contact grows to the border of the candidate points.
    """
    weight = static.pressures[-1] / static.pressures[-1].sum()
    place = weight @ static.space.points
    if place[0] < static.half_width[-1]:
        place[0] = 0.0
    radius = _ZONE * max(float(static.half_width[-1]), 2.0 * float(weight @ static.space.size))
    bodies = (upper, csr_array(space.G_a)), (lower, csr_array(space.G_b))
    for _ in range(_TRIES):
        held = []
        for one, rows in bodies:
            near = one.elements_near(place, radius)
            if near.any():
                zone = plastic_zone(one.body, one.materials, near)
                U = one.flexibility.solve(rows.T.toarray())[zone.dofs]
                held.append((one, rows, near, YieldingBody(zone, U)))
        contact = YieldingContact(space, C, [body for *_, body in held])
        loops = yielding_loops(
            contact, deepest=float(static.approach[-1]), energy=energy, closing=closing
        )
        if not loops.states or all(
            _rest_is_elastic(one, near, rows.T @ loops.states[-1].pressures, body)
            for one, rows, near, body in held
        ):
            return loops
        radius *= _WIDER
    raise ConvergenceError(
        f"elastic-plastic contact: material yields more than {1e3 * radius / _WIDER:.3g} mm from "
        "the contact.\nTry: a lower speed, or a yield stress that suits the body; this is no "
        "local contact any more."
    )


def _rest_is_elastic(
    one: LoadedBody, near: NDArray[np.bool_], load: Floats, body: YieldingBody
) -> bool:
    """Whether no point outside of the zone is beyond its yield stress."""
    load = load.copy()
    load[body.zone.dofs] += body.plastic_forces()
    u = one.flexibility.solve(load)
    yields = one.elements_near(np.zeros(2), np.inf)
    for block in strain_points(one.body.mesh, one.materials, yields & ~near, one.body.name):
        stress = von_mises_of_strain(block.strain(u), block.material.shear_modulus)
        assert block.material.hardening is not None
        if np.any(stress > block.material.hardening.yield_stress):
            return False
    return True
