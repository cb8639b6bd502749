"""Finite-element bodies whose impacts are known, for the interface level and the full order."""

from dataclasses import dataclass
from math import gamma, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.contact.mortar import ContactSpace, contact_space, touching_shift
from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.eigen import Modes, eigenmodes
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    interface_model,
)
from klack.verification.impacts import STEEL, blocked_bar
from klack.verification.lattice import lattice_mesh

__all__ = [
    "HertzImpact",
    "block_between_plates",
    "block_on_pad",
    "blocked_bar_model",
    "free_blocks",
    "hertz_impact",
    "two_spheres",
]

Array = NDArray[np.float64]

_RIGID = Material(name="rigid", young=1e6 * STEEL.young, poisson=0.3, density=STEEL.density)
_SOFT = Material(name="pad", young=1e9, poisson=0.3, density=1000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzImpact:
    """Peak force [N], contact time [s], approach [m] and contact radius [m]."""

    peak_force: float
    contact_time: float
    approach: float
    radius: float


def hertz_impact(
    radius_a: float, radius_b: float, speed: float, material: Material = STEEL
) -> HertzImpact:
    """Central impact of two free spheres of one material (Johnson 1985, section 11.4)."""
    radius = 1.0 / (1.0 / radius_a + 1.0 / radius_b)
    masses = [material.density * 4.0 / 3.0 * pi * r**3 for r in (radius_a, radius_b)]
    mass = 1.0 / (1.0 / masses[0] + 1.0 / masses[1])
    K = 4.0 / 3.0 * 0.5 * material.plane_strain_modulus * sqrt(radius)
    approach = (5.0 * mass * speed**2 / (4.0 * K)) ** 0.4
    return HertzImpact(
        peak_force=K * approach**1.5,
        contact_time=4.0 * sqrt(pi) / 5.0 * gamma(0.4) / gamma(0.9) * approach / speed,
        approach=approach,
        radius=sqrt(radius * approach),
    )


def two_spheres(
    radius_a: float, radius_b: float, *, size: float
) -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Free steel spheres that touch, axisymmetric; elements of ``size`` [m] at the contact."""
    upper = Profile(
        (0.0, 0.0),
        (Arc((0.0, 2.0 * radius_a), (0.0, radius_a), "ball"), Line((0.0, 0.0), "axis")),
    )
    lower = Profile(
        (0.0, -2.0 * radius_b),
        (Arc((0.0, 0.0), (0.0, -radius_b), "ball"), Line((0.0, -2.0 * radius_b), "axis")),
    )
    fine = (Refinement(position=(0.0, 0.0, 0.0), size=size, radius=1e-4),)
    meshes = [
        mesh_meridian(
            {"ball": profile}, MeshSizing(size=radius / 5.0, refinements=fine, grading=0.4)
        )
        for profile, radius in ((upper, radius_a), (lower, radius_b))
    ]
    a, b = meshes
    faces = a.surface("ball"), b.surface("ball")
    a = a.moved(np.array([0.0, touching_shift(a, faces[0], b, faces[1])]))
    return (
        elastic_body("upper", a, {"ball": STEEL}),
        elastic_body("lower", b, {"ball": STEEL}),
        contact_space(a, faces[0], b, faces[1], reach=8e-6),
    )


def blocked_bar_model(
    length: float,
    *,
    modes: int,
    radius: float = 2e-3,
    material: Material = STEEL,
    elements: int = 60,
) -> InterfaceModel:
    """Bar without lateral strain over a wall that is a million times stiffer.

    Parameters
    ----------
    length : float [m]
    modes : int
        Plane ones of the bar, the lowest; picked by the compliance they give a uniform pressure.
    radius : float [m]
    material : Material
    elements : int
    """
    bar, _ = blocked_bar(length, radius, elements, material)
    corners = [np.array([0.0, 2.0 * radius]), np.array([-length, 0.0])]
    wall_mesh = lattice_mesh("quad8", corners)
    wall = elastic_body(
        "wall", wall_mesh, {"solid": _RIGID}, fixed_nodes=wall_mesh.surface("bottom").nodes
    )
    space = contact_space(
        bar.mesh, bar.mesh.surface("bottom"), wall.mesh, wall_mesh.surface("top"), reach=1e-6
    )
    flexibility = Flexibility(bar)
    pool = eigenmodes(bar, count=4 * modes, flexibility=flexibility)
    share = ((space.area @ (space.G_a @ pool.shapes)) / pool.omega) ** 2
    plane = np.flatnonzero(share > 1e-9 * share.max())[:modes]
    none = Modes(np.zeros(0), np.zeros((wall.dof_count, 0)))
    return interface_model(
        [
            InterfaceBody(
                body=bar,
                flexibility=flexibility,
                modes=Modes(pool.omega[plane], pool.shapes[:, plane]),
                damping=np.zeros(len(plane)),
            ),
            InterfaceBody(
                body=wall, flexibility=Flexibility(wall), modes=none, damping=np.zeros(0)
            ),
        ],
        [InterfaceContact(name="wall", upper="bar", lower="wall", space=space)],
    )


def block_on_pad(
    arm: float, *, width: float = 0.2e-3
) -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Steel block of 10 x 10 x 20 mm whose lower face meets a small soft pad off its axis.

    Parameters
    ----------
    arm : float [m]
        From the axis of the block to the middle of the pad, along x.
    width : float [m]
        Of the square pad, half as high; its stiffness is about E width * 2.
    """
    half = 5e-3
    upper = lattice_mesh(
        "hex20", [_line(-half, half, 4), _line(-half, half, 4), _line(0, 20e-3, 3)]
    )
    sides = _line(-0.5 * width, 0.5 * width, 3)
    lower = lattice_mesh("hex20", [arm + sides, sides, _line(-0.5 * width, 0.0, 2)])
    return (
        elastic_body("block", upper, {"solid": STEEL}),
        elastic_body("pad", lower, {"solid": _SOFT}, fixed_nodes=lower.surface("bottom").nodes),
        contact_space(
            upper, upper.surface("bottom"), lower, lower.surface("top"), reach=1e-3, slave="b"
        ),
    )


def free_blocks() -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Two free steel blocks, the upper one crowned (R 50 mm) and off-axis."""
    upper, lower = _crowned(4e-3), _plate(8e-3, 5e-3).moved(np.array([0.7e-3, 0.4e-3, 0.0]))
    faces = upper.surface("bottom"), lower.surface("top")
    return (
        elastic_body("upper", upper, {"solid": STEEL}),
        elastic_body("lower", lower, {"solid": STEEL}),
        contact_space(upper, faces[0], lower, faces[1], reach=7e-6),
    )


def block_between_plates(
    play: float,
) -> tuple[tuple[ElasticBody, ...], tuple[InterfaceContact, ...]]:
    """Block with two crowned ends, a plate below and one above it, at a distance ``play`` [m]."""
    height = 6e-3
    block = _crowned(4e-3, height=height, both=True)
    below = _plate(6e-3, 3e-3)
    above = _plate(6e-3, 3e-3).moved(np.array([0.0, 0.0, height + 3e-3 + play]))
    bodies = (
        elastic_body("block", block, {"solid": STEEL}),
        elastic_body("seat", below, {"solid": STEEL}, fixed_nodes=below.surface("bottom").nodes),
        elastic_body("stop", above, {"solid": STEEL}, fixed_nodes=above.surface("top").nodes),
    )
    seat = contact_space(block, block.surface("bottom"), below, below.surface("top"), reach=7e-6)
    stop = contact_space(above, above.surface("bottom"), block, block.surface("top"), reach=7e-6)
    return bodies, (
        InterfaceContact(name="seat", upper="block", lower="seat", space=seat),
        InterfaceContact(name="stop", upper="stop", lower="block", space=stop),
    )


def _line(start: float, end: float, cells: int) -> Array:
    return np.linspace(start, end, cells + 1)


def _towards_middle(half: float) -> Array:
    """Cell borders from -half to half, an eighth of the size in the middle."""
    side = half * np.array([0.0, 0.0625, 0.125, 0.25, 0.5, 1.0])
    return np.concatenate([-side[:0:-1], side])


def _crowned(width: float, *, height: float = 6e-3, both: bool = False) -> Mesh:
    """Square block on z = 0 with a parabolic lower end (and upper end) of R 50 mm."""
    radius = 50e-3

    def shape(x: Array) -> Array:
        crown = (x[:, 0] ** 2 + x[:, 1] ** 2) / (2.0 * radius)
        share = 1.0 - (2.0 if both else 1.0) * x[:, 2] / height
        return np.column_stack([x[:, 0], x[:, 1], x[:, 2] + crown * share])

    side = _towards_middle(0.5 * width)
    return lattice_mesh(
        "hex20", [side, side, height * np.array([0.0, 0.05, 0.2, 0.8, 0.95, 1.0])], shape
    )


def _plate(width: float, height: float) -> Mesh:
    """Square plate with its upper face on z = 0."""
    side = _line(-0.5 * width, 0.5 * width, 6)
    return lattice_mesh("hex20", [side, side, height * np.array([-1.0, -0.3, 0.0])])
