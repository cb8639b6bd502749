"""A ball off the axis of a 45 degree seat: half a turn of both, and the same in the meridian plane.

Both meshes have the same half section, so that plastic flow in the plane and in three dimensions
is compared element by element.  Each body is the neighbourhood of the contact, 0.8 mm deep and
wide, held at its back.
"""

from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from klack.assembling.yielding import loops_with_yield
from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.mortar import contact_space
from klack.contact.plasticity.yielding_body import LoadedBody
from klack.contact.statics import contact_compliance, static_contact
from klack.materials.hardening import Hardening
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.transient.interface_arrays import ActiveSet, Limit, Worn
from klack.transient.yielding_points import let_yield, solve_yielding
from klack.verification.transient import STEEL

__all__ = [
    "Pressed",
    "RingPair",
    "at_borders",
    "columns",
    "per_turn",
    "press",
    "ring_loops",
    "ring_pair",
]

BALL = 1.25e-3  # [m]
RING = BALL / sqrt(2.0)
DEEP = 0.8e-3
GROWTH = 3.0  # of the elements outside of the finest ones


@dataclass(frozen=True, kw_only=True, eq=False)
class RingPair:
    """Ball and seat, each with its material, static solutions and the contact points of both."""

    layers: int  # of half a turn; 0 in the meridian plane
    bodies: tuple
    materials: tuple
    flexibilities: tuple
    space: object
    C: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Pressed:
    """Forces [N] and sets [m] of the contact points at one approach."""

    forces: np.ndarray
    set: np.ndarray


def _ball(along, depth):
    angle, radius = pi / 4 + along / BALL, BALL - depth
    return radius * np.sin(angle), -radius * np.cos(angle)


def _seat(along, depth):
    return RING + (along + depth) / sqrt(2.0), -RING + (along - depth) / sqrt(2.0)


def _spaced(size, fine):
    """Corners from the contact into the body: so many fine elements, then growing ones."""
    sizes = [size] * fine
    while sum(sizes) < DEEP:
        sizes.append(GROWTH * sizes[-1])
    x = np.append(0.0, np.cumsum(sizes))
    x[fine:] = x[fine] + (x[fine:] - x[fine]) * (DEEP - x[fine]) / (x[-1] - x[fine])
    x[-1] = DEEP
    return x


def _halved(x):
    return np.insert(x, np.arange(1, len(x)), (x[1:] + x[:-1]) / 2.0)


def _mesh(name, place, order, along, depth, layers):
    """Second-order bricks of half a turn, or quadrilaterals of the half section.

    ``order`` of (along, depth) in which their area is positive in (r, z).
    """
    family = FAMILIES["hex20" if layers else "quad8"]
    d = 3 if layers else 2
    unit = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [2, 0, 2], [2, 2, 2], [0, 2, 2]]
    corners = np.array(unit)[: family.corners, :d]
    nodes = np.vstack([corners, [(corners[a] + corners[b]) // 2 for a, b in family.edges]])
    grid = (_halved(along), _halved(depth))
    first, second = (grid[k] for k in order)
    shape = (len(first), len(second), 2 * layers + 1)[:d]
    cells = np.meshgrid(*(np.arange(0, n - 1, 2) for n in shape), indexing="ij")
    places = np.stack(cells, axis=-1).reshape(-1, 1, d) + nodes
    used, numbers = np.unique(
        np.ravel_multi_index(tuple(places.reshape(-1, d).T), shape), return_inverse=True
    )
    connectivity = numbers.reshape(places.shape[:2])
    index = np.unravel_index(used, shape)
    at = (first[index[0]], second[index[1]])
    inward = at[order.index(1)]
    r, z = place(at[order.index(0)], inward)
    points = np.column_stack([r, z])
    if layers:
        theta = pi * (1.0 - index[2] / (2.0 * layers))  # r, z, theta is left-handed
        y = np.where(index[2] % (2 * layers) == 0, 0.0, r * np.sin(theta))
        points = np.column_stack([r * np.cos(theta), y, z])

    def surface(called, chosen):
        sides = np.vstack([connectivity[:, list(face.nodes)] for face in family.faces])
        block = FaceBlock(family.faces[0].family, sides[chosen[sides].all(axis=1)])
        return Surface(called, (block,))

    faces = {"face": surface("face", inward == 0.0), "back": surface("back", inward == DEEP)}
    return Mesh(
        points=points, blocks=(ElementBlock(family.name, connectivity, name),), surfaces=faces
    )


def _body(mesh, material):
    name, back = mesh.solids[0], mesh.surface("back").nodes
    if mesh.dimension == 2:
        return elastic_body(name, mesh, {name: material}, fixed_nodes=back)
    K, M = assemble(mesh, {name: material})
    held = (3 * back[:, None] + np.arange(3)).ravel()
    mirror = 3 * np.flatnonzero(mesh.points[:, 1] == 0.0) + 1
    fixed = np.unique(np.concatenate([held, mirror]))
    return ElasticBody(name=name, mesh=mesh, K=K, M=M, fixed=fixed)


def ring_pair(*, yield_stress, size, fine, layers, reach, hard_seat=False):
    """Ball and seat with elements of ``size`` [m], ``fine`` of them to each side of the contact."""
    soft = replace(STEEL, hardening=Hardening(yield_stress=yield_stress, isotropic=1e9))
    half, depth = _spaced(size, fine), _spaced(size, fine)
    along = np.concatenate([-half[:0:-1], half])
    meshes = (
        _mesh("ball", _ball, (0, 1), along, depth, layers),
        _mesh("seat", _seat, (1, 0), along, depth, layers),
    )
    materials = (soft, STEEL if hard_seat else soft)
    bodies = tuple(_body(mesh, one) for mesh, one in zip(meshes, materials, strict=True))
    flexibilities = tuple(Flexibility(body) for body in bodies)
    sides = [side for mesh in meshes for side in (mesh, mesh.surface("face"))]
    space = contact_space(*sides, reach=reach, slave="a")
    return RingPair(
        layers=layers,
        bodies=bodies,
        materials=materials,
        flexibilities=flexibilities,
        space=space,
        C=contact_compliance(space, *flexibilities),
    )


def ring_loops(pair, force):
    """Static loops of a pair in the meridian plane, about as far as an elastic force [N]."""
    static = static_contact(pair.space, pair.C, force)
    stored = np.trapezoid(np.append(0.0, static.force), np.append(0.0, static.approach))
    loaded = [
        LoadedBody(body=body, flexibility=flexibility, materials={body.name: material})
        for body, flexibility, material in zip(
            pair.bodies, pair.flexibilities, pair.materials, strict=True
        )
    ]
    return loops_with_yield(
        static, pair.space, pair.C, *loaded, energy=float(stored) / 1.15, closing=0.0
    )


def press(pair, limit, *, eccentricity, approaches):
    """Press the ball into the seat, that far [m] aside, from one approach [m] to the next."""
    space, C = pair.space, pair.C
    aside = space.G_a @ np.tile([1.0, 0.0, 0.0], pair.bodies[0].mesh.node_count)
    gap = space.gap + eccentricity * aside
    gap -= space.axial * np.min(gap / space.axial)
    law = Limit(space.area, limit.set, limit.pressure, limit.softness)
    n, A, found = space.count, np.array(C), []
    worn, carrying, lam, after = Worn.none(n), ActiveSet.none(n), np.zeros(n), np.zeros(n)
    opened, scale = np.zeros(n), float(np.mean(np.diag(C)))
    for approach in approaches:
        q = gap + opened - approach * space.axial
        rounds = solve_yielding(A, q, law, worn, carrying, lam, after, 1e-18, scale)
        assert rounds > 0
        let_yield(law, worn, lam, opened)
        found.append(Pressed(forces=lam.copy(), set=worn.set.copy()))
    return found


def columns(pair):
    """Number of the half layer that each contact point lies on, 0 where the ball is pressed to."""
    x, y = pair.space.points[:, :2].T
    return np.rint(np.arctan2(y, x) * 2 * pair.layers / pi).astype(int)


def per_turn(pair, values):
    """Sums over the points within half a layer of each layer's border, as of a whole turn."""
    sums = np.bincount(columns(pair), values, 2 * pair.layers + 1)
    middle = sums[1::2] / 2.0
    whole = sums[::2] + np.append(middle, 0.0) + np.append(0.0, middle)
    whole[[0, -1]] *= 2.0
    return 2.0 * pair.layers * whole


def at_borders(pair, values):
    """Largest value on each border of two layers."""
    return np.array([values[columns(pair) == 2 * k].max() for k in range(pair.layers + 1)])
