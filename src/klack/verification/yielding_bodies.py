"""A sphere and a seat that yield, with their static loops."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.assembling.yielding import loops_with_yield
from klack.contact.mortar import ContactSpace, contact_space, touching_shift
from klack.contact.statics import (
    ReachError,
    StaticContact,
    contact_compliance,
    static_contact,
)
from klack.elasticity.body import elastic_body
from klack.elasticity.statics import Flexibility
from klack.hardening import Hardening
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement
from klack.plasticity.ladder import YieldingContact
from klack.plasticity.loaded_body import LoadedBody
from klack.plasticity.loops import YieldingLoops
from klack.plasticity.yielding_body import YieldingBody
from klack.verification.impacts import STEEL

__all__ = [
    "RADIUS",
    "SOFT",
    "FirstYield",
    "SoftPair",
    "ball_in_seat",
    "pressed_again",
    "sphere_on_sphere",
]

RADIUS = 1.25e-3
"""Of all balls [m]."""

_REACH = 2e-6  # [m], of the first candidate points

SOFT = replace(STEEL, hardening=Hardening(yield_stress=280e6, isotropic=1e9))
"""Soft steel, 280 MPa."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstYield:
    """First yield of two equal spheres, or of one on a rigid plane.

    Johnson, Contact Mechanics, 1985, 4.2 and 6.2; Jackson & Green, J. Tribol. 127 (2005) 343.

    Parameters
    ----------
    modulus : float [Pa]
        E* of the contact.
    radius : float [m]
    yield_stress : float [Pa]
    poisson : float [-]
    """

    modulus: float
    radius: float
    yield_stress: float
    poisson: float

    @property
    def pressure(self) -> float:
        """Highest one [Pa]."""
        return 1.295 * exp(0.736 * self.poisson) * self.yield_stress

    @property
    def contact(self) -> float:
        """Radius of the contact [m]."""
        return pi * self.pressure * self.radius / (2.0 * self.modulus)

    @property
    def force(self) -> float:
        """Force [N]."""
        return 2.0 / 3.0 * pi * self.contact**2 * self.pressure

    @property
    def approach(self) -> float:
        """Approach [m]."""
        return self.contact**2 / self.radius

    def speed(self, mass: float) -> float:
        """Speed [m/s] of a rigid mass [kg] whose impact just reaches it."""
        return sqrt(0.8 * self.force * self.approach / mass)


class SoftPair(NamedTuple):
    """Two soft bodies: their static loops, contact points and elastic compliance (nc, nc) [m/N]."""

    loops: YieldingLoops
    space: ContactSpace
    C: NDArray[np.float64]


def sphere_on_sphere(*, size: float, extent: float, energy: float) -> YieldingLoops:
    """Loops of two equal hemispheres, each held at its equator.

    Parameters
    ----------
    size, extent : float [m]
        Of the elements at the contact, and how far these reach.
    energy : float [J]
        Up to which.
    """
    return _loops(*_spheres(size, extent), energy).loops


def pressed_again(*, size: float, extent: float, energy: float) -> tuple[float, float]:
    """Plastic work [J] of two spheres pressed once, and of two more cycles to the same approach.

    The finite elements yield as they like on the way back; see :func:`sphere_on_sphere`.
    """
    with _pressed(*_spheres(size, extent), energy, _REACH) as (static, C, upper, lower):
        radius = 6.0 * float(static.half_width[-1])
        bodies = [
            YieldingBody(one, csr_array(G), np.zeros(2), radius)
            for one, G in ((upper, static.space.G_a), (lower, static.space.G_b))
        ]
        contact = YieldingContact(static.space, C, bodies)
        deepest = float(static.approach[-1])
        for share in np.linspace(0.1, 1.0, 12):
            first = contact.load(share * deepest)
        again = first
        for share in (0.8, 0.65, 1.0, 0.65, 1.0):
            again = contact.load(share * deepest)
    return first.plastic_work, again.plastic_work - first.plastic_work


def _spheres(size: float, extent: float) -> tuple["_Part", "_Part"]:
    upper = Profile(
        (0.0, 0.0),
        (
            Arc((RADIUS, RADIUS), (0.0, RADIUS), "tip"),
            Line((0.0, RADIUS), "top"),
            Line((0.0, 0.0), "axis"),
        ),
    )
    lower = Profile(
        (0.0, -RADIUS),
        (
            Line((RADIUS, -RADIUS), "base"),
            Arc((0.0, 0.0), (0.0, -RADIUS), "tip"),
            Line((0.0, -RADIUS), "axis"),
        ),
    )
    fine = (Refinement(position=(0.0, 0.0), size=size, radius=extent),)
    sizing = MeshSizing(size=0.1e-3, refinements=fine, grading=0.4)
    return (
        _Part(mesh_meridian({"upper": upper}, sizing), "upper", "tip", "top"),
        _Part(mesh_meridian({"lower": lower}, sizing), "lower", "tip", "base"),
    )


def ball_in_seat(*, size: float, extent: float, energy: float) -> SoftPair:
    """A hemisphere held at its equator, in a cone of 90 degrees held at its base."""
    ring = RADIUS / sqrt(2.0)
    ball = Profile(
        (0.0, -RADIUS),
        (
            Arc((RADIUS, 0.0), (0.0, 0.0), "tip"),
            Line((0.0, 0.0), "top"),
            Line((0.0, -RADIUS), "axis"),
        ),
    )
    inner, outer, bottom = 0.4e-3, 4.0e-3, -6.0e-3
    seat = Profile(
        (inner, bottom),
        (
            Line((outer, bottom), "base"),
            Line((outer, ring + 0.5e-3 - 2.0 * ring), "side"),
            Line((ring + 0.5e-3, 0.5e-3 - ring), "top"),
            Line((inner, inner - 2.0 * ring), "cone"),
            Line((inner, bottom), "bore"),
        ),
    )
    fine = (Refinement(position=(ring, -ring), size=size, radius=extent),)
    near = MeshSizing(size=0.1e-3, refinements=fine, grading=0.4)
    far = MeshSizing(size=0.4e-3, refinements=fine, grading=0.4)
    return _loops(
        _Part(mesh_meridian({"ball": ball}, near), "ball", "tip", "top"),
        _Part(mesh_meridian({"seat": seat}, far), "seat", "cone", "base"),
        energy,
    )


class _Part(NamedTuple):
    mesh: Mesh
    solid: str
    face: str  # that touches
    held: str


class _Pair(NamedTuple):
    static: StaticContact  # of elastic bodies, beyond the energy
    C: NDArray[np.float64]
    upper: LoadedBody
    lower: LoadedBody


def _loops(above: _Part, below: _Part, energy: float) -> SoftPair:
    """Loops of two soft bodies up to an energy [J]."""
    reach = _REACH
    while True:
        with _pressed(above, below, energy, reach) as (static, C, upper, lower):
            try:
                loops = loops_with_yield(
                    static, static.space, C, upper, lower, energy=energy, closing=0.0
                )
                return SoftPair(loops, static.space, C)
            except ReachError:
                reach = 1.5 * static.space.reach


@contextmanager
def _pressed(above: _Part, below: _Part, energy: float, reach: float) -> Iterator[_Pair]:
    """Two soft bodies that touch, on as many contact points as elastic bodies need."""
    faces = [part.mesh.surface(part.face) for part in (above, below)]
    lift = touching_shift(above.mesh, faces[0], below.mesh, faces[1])
    above = above._replace(mesh=above.mesh.moved(np.array([0.0, lift])))
    upper, lower = _held(above), _held(below)
    try:
        while True:
            space = contact_space(
                above.mesh,
                above.mesh.surface(above.face),
                below.mesh,
                below.mesh.surface(below.face),
                reach=reach,
            )
            C = contact_compliance(space, upper.flexibility, lower.flexibility)
            try:
                static = _beyond(space, C, 1.15 * energy)
                break
            except ReachError:
                reach *= 1.5
        yield _Pair(static, C, upper, lower)
    finally:
        upper.flexibility.close()
        lower.flexibility.close()


def _beyond(space: ContactSpace, C: NDArray[np.float64], energy: float) -> StaticContact:
    """Static contact of elastic bodies that stores more than an energy [J]."""
    force = 1e-3
    while True:
        static = static_contact(space, C, force)
        stored = np.trapezoid(np.append(0.0, static.force), np.append(0.0, static.approach))
        if stored > energy:
            return static
        force *= 1.05 * (energy / stored) ** 0.6  # a sphere; a line needs a round more


def _held(part: _Part) -> LoadedBody:
    held = part.mesh.surface(part.held).nodes
    body = elastic_body(part.solid, part.mesh, {part.solid: SOFT}, fixed_nodes=held)
    return LoadedBody(body=body, flexibility=Flexibility(body), materials={part.solid: SOFT})
