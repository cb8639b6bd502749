"""Impacts of simple bodies whose outcome is known: rods, a bar without lateral strain, a sphere."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.contact.mortar import ContactSpace, contact_space, touching_shift
from klack.elasticity.body import ElasticBody, elastic_body
from klack.materials import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement
from klack.mesh.swept import sweep
from klack.transient.full_order import Scheme, simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.rod_bodies import rod_body, rod_contact

__all__ = [
    "STEEL",
    "blocked_bar",
    "bulk_wave_speed",
    "drop_blocked_bar",
    "drop_rod",
    "drop_sphere",
    "needle_over_seat",
    "plateau",
    "sphere_over_cylinder",
    "zener_parameter",
]

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


def drop_rod(
    length: float,
    other: float | None = None,
    *,
    elements: int,
    area: float = 1e-4,
    other_area: float = 1e-4,
    speed: float = 0.5,
    scheme: Scheme = "contact-stabilised-newmark",
    material: Material = STEEL,
    courant: float = 1.0,
) -> FullOrderResult:
    """Rod of ``length`` [m] on a rigid wall, or on a free rod of length ``other`` [m].

    Both have elements of the same size h; the time step is ``courant`` h / c; the run ends 1.6
    times the wave's return time after the start.
    """
    size = length / elements
    a = rod_body("upper", material, area=area, length=length, elements=elements)
    b = None
    if other is not None:
        b = rod_body(
            "lower",
            material,
            area=other_area,
            length=other,
            elements=round(other / size),
            bottom=-other,
        )
    return simulate_full_order(
        a,
        b,
        rod_contact(a, b, area=min(area, other_area), gap=0.0),
        speed=speed,
        duration=1.6 * 2.0 * length / material.bar_wave_speed,
        step=courant * size / material.bar_wave_speed,
        scheme=scheme,
    )


def plateau(result: FullOrderResult, duration: float) -> float:
    """Mean force [N] between 20 % and 80 % of an expected contact time [s]."""
    history = result.history
    since = history.time - history.time[int(np.argmax(history.force > 0))]
    return float(history.force[(since > 0.2 * duration) & (since < 0.8 * duration)].mean())


def blocked_bar(
    length: float, radius: float, elements: int, material: Material
) -> tuple[ElasticBody, ContactSpace]:
    """Bar of quad8 elements, axisymmetric, that cannot move sideways, over a rigid plane.

    Its bulk wave runs at c_p = sqrt(E (1-nu) / (rho (1+nu) (1-2nu))) and hits as on a rod.
    """
    bar = _strip(length, radius, elements)
    body = elastic_body("bar", bar, {"solid": material})
    sideways = np.arange(0, body.dof_count, 2)
    body = replace(body, fixed=sideways)
    wall = _strip(length, 2.0 * radius, 1).moved(np.array([0.0, -length]))
    space = contact_space(bar, bar.surface("bottom"), wall, wall.surface("top"), reach=1e-6)
    return body, space


def drop_blocked_bar(length: float, elements: int, speed: float) -> FullOrderResult:
    """Drop the blocked bar of steel (radius 2 mm) on a rigid wall."""
    body, space = blocked_bar(length, 2e-3, elements, STEEL)
    c = bulk_wave_speed(STEEL)
    return simulate_full_order(
        body,
        None,
        space,
        speed=speed,
        duration=1.6 * 2.0 * length / c,
        step=0.5 * length / elements / c,
    )


def bulk_wave_speed(material: Material) -> float:
    """Speed of longitudinal waves without lateral strain [m/s]."""
    nu = material.poisson
    stretch = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    return float(np.sqrt(material.young * stretch / material.density))


def sphere_over_cylinder(
    *,
    sphere_radius: float,
    radius: float,
    height: float,
    size: float,
    bulk: float,
    material: Material = STEEL,
) -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Free sphere that touches the upper face of a free cylinder, both axisymmetric.

    Elements of ``size`` [m] within 0.1 mm of the contact, growing to ``bulk`` [m] far away.
    """
    ball = Profile(
        (0.0, 0.0),
        (
            Arc((0.0, 2.0 * sphere_radius), (0.0, sphere_radius), "ball"),
            Line((0.0, 0.0), "axis"),
        ),
    )
    block = Profile(
        (0.0, 0.0),
        (
            Line((0.0, -height), "axis"),
            Line((radius, -height), "base"),
            Line((radius, 0.0), "side"),
            Line((0.0, 0.0), "top"),
        ),
    )
    fine = (Refinement(position=(0.0, 0.0, 0.0), size=size, radius=1e-4),)
    upper = mesh_meridian(
        {"ball": ball}, MeshSizing(size=sphere_radius / 5.0, refinements=fine, grading=0.4)
    )
    lower = mesh_meridian({"block": block}, MeshSizing(size=bulk, refinements=fine, grading=0.4))
    faces = upper.surface("ball"), lower.surface("top")
    upper = upper.moved(np.array([0.0, touching_shift(upper, faces[0], lower, faces[1])]))
    a = elastic_body("sphere", upper, {"ball": material})
    b = elastic_body("target", lower, {"block": material})
    return a, b, contact_space(upper, faces[0], lower, faces[1], reach=8e-6)


def needle_over_seat(
    *,
    size: float,
    bulk: float,
    layers: int = 0,
    length: float = 30e-3,
    grading: float = 0.4,
    material: Material = STEEL,
) -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Needle D4 with a spherical tip that touches a seat cone of 90 degrees in a ring.

    Elements of ``size`` [m] within 60 um of the ring, growing to ``bulk`` [m] far away.  With
    ``layers`` the same meridian meshes are swept to solids, the seat turned by 0.13 rad so that the
    two do not match; without, both are axisymmetric.
    """
    tip, ring = 2e-3, 2e-3 / sqrt(2.0)
    needle = Profile(
        (0.0, -tip),
        (
            Arc((tip, 0.0), (0.0, 0.0), "tip"),
            Line((tip, length - tip), "guide"),
            Line((0.0, length - tip), "end"),
            Line((0.0, -tip), "axis"),
        ),
    )
    bore, outer, bottom = 0.7e-3, 6e-3, -9e-3
    seat = Profile(
        (bore, bottom),
        (
            Line((outer, bottom), "base"),
            Line((outer, 0.8e-3 - ring), "side"),
            Line((ring + 0.8e-3, 0.8e-3 - ring), "top"),
            Line((bore, bore - 2.0 * ring), "cone"),
            Line((bore, bottom), "bore"),
        ),
    )
    fine = (Refinement(position=(ring, -ring), size=size, radius=60e-6),)
    upper = mesh_meridian(
        {"needle": needle}, MeshSizing(size=bulk, refinements=fine, grading=grading)
    )
    lower = mesh_meridian(
        {"seat": seat}, MeshSizing(size=1.6 * bulk, refinements=fine, grading=grading)
    )
    if layers:
        upper, lower = sweep(upper, layers), sweep(lower, layers, start_angle=0.13)
    faces = upper.surface("tip"), lower.surface("cone")
    lift = touching_shift(upper, faces[0], lower, faces[1])
    upper = upper.moved(lift * np.eye(upper.dimension)[-1])
    return (
        elastic_body("needle", upper, {"needle": material}),
        elastic_body("seat", lower, {"seat": material}, fixed_nodes=lower.surface("base").nodes),
        contact_space(upper, faces[0], lower, faces[1], reach=6e-6),
    )


def drop_sphere(
    *,
    sphere_radius: float = 2e-3,
    radius: float,
    height: float,
    bulk: float,
    speed: float = 0.5,
    size: float = 10e-6,
    step: float = 50e-9,
    duration: float = 20e-6,
) -> FullOrderResult:
    """Drop a steel sphere on the end of a free steel cylinder, until they part."""
    a, b, space = sphere_over_cylinder(
        sphere_radius=sphere_radius, radius=radius, height=height, size=size, bulk=bulk
    )
    return simulate_full_order(
        a,
        b,
        space,
        speed=speed,
        duration=duration,
        step=step,
        stop_after_separation=4 * step,
    )


def _strip(length: float, radius: float, elements: int) -> Mesh:
    """One column of quad8 elements from z = 0 to ``length``, r = 0 to ``radius``."""
    z = np.linspace(0.0, length, 2 * elements + 1)
    r = np.array([0.0, 0.5 * radius, radius])
    points = np.stack(np.meshgrid(r, z), axis=-1).reshape(-1, 2)
    low = 6 * np.arange(elements)[:, None]
    corners_and_middles = low + np.array([0, 2, 8, 6, 1, 5, 7, 3])
    used, flat = np.unique(corners_and_middles, return_inverse=True)  # drops the element centres
    connectivity: NDArray[np.int64] = flat.reshape(corners_and_middles.shape)
    bottom, top = connectivity[0, [0, 1, 4]], connectivity[-1, [2, 3, 6]]
    return Mesh(
        points=points[used],
        blocks=(ElementBlock("quad8", connectivity, "solid"),),
        surfaces={
            "bottom": Surface("bottom", (FaceBlock("line3", bottom[None]),)),
            "top": Surface("top", (FaceBlock("line3", top[None]),)),
        },
    )


def zener_parameter(material: Material, sphere_radius: float, radius: float, speed: float) -> float:
    """Zener's lambda = m / (Z T0) of a sphere on the end of a rod of the same material [-]."""
    mass = material.density * 4.0 / 3.0 * pi * sphere_radius**3
    stiffness = 4.0 / 3.0 * 0.5 * material.plane_strain_modulus * np.sqrt(sphere_radius)
    time = (mass**2 / (stiffness**2 * speed)) ** 0.2
    impedance = material.density * material.bar_wave_speed * pi * radius**2
    return float(mass / (impedance * time))
