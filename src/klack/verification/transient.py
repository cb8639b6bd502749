"""Bodies whose impacts are known - rods, bars, spheres, blocks - and checks of the full order."""

from dataclasses import dataclass, replace
from math import gamma, pi, sqrt

import numpy as np
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.history import ImpactHistory
from klack.contact.mortar import ContactSpace, contact_space, touching_shift
from klack.materials.material import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement
from klack.mesh.swept import sweep
from klack.transient.full_order import Scheme, simulate_full_order
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    interface_model,
)
from klack.transient.result import FullOrderResult
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.lattice import STEEL, lattice_mesh
from klack.verification.one_dimension import hertz_force

__all__ = [
    "STEEL",
    "HertzImpact",
    "block_between_plates",
    "block_on_pad",
    "blocked_bar",
    "blocked_bar_model",
    "bulk_wave_speed",
    "checks",
    "drop_blocked_bar",
    "drop_rod",
    "drop_sphere",
    "force_curve",
    "free_blocks",
    "hertz_impact",
    "needle_over_seat",
    "plateau",
    "rod_body",
    "rod_contact",
    "since_touch",
    "sphere_over_cylinder",
    "square_pulse",
    "two_spheres",
]


def rod_body(
    name: str, material: Material, *, area: float, length: float, elements: int, bottom: float = 0.0
) -> ElasticBody:
    """Rod along z of two-node elements with consistent mass; node 0 is its lower end.

    Parameters
    ----------
    material
        Without Poisson's ratio.
    area [m^2]
    length [m]
    bottom [m]
        Height of node 0.
    """
    size = length / elements
    lower, upper = np.eye(elements, elements + 1), np.eye(elements, elements + 1, k=1)
    stretch, mean = csr_array(upper - lower), csr_array(upper + lower)
    # [[2, 1], [1, 2]] rho A h / 6 per element
    M = (3.0 * (mean.T @ mean) + stretch.T @ stretch) * (material.density * area * size / 12.0)
    return ElasticBody(
        name=name,
        mesh=Mesh(points=bottom + size * np.arange(elements + 1.0)[:, None], blocks=()),
        K=csr_array(stretch.T @ stretch * (material.young * area / size)),
        M=csr_array(M),
        fixed=np.empty(0, dtype=np.int64),
    )


def rod_contact(a: ElasticBody, b: ElasticBody | None, *, area: float, gap: float) -> ContactSpace:
    """Lower end of rod a above the upper end of rod b, or a rigid wall (``None``)."""
    count = 1 if b is None else b.dof_count
    return ContactSpace(
        G_a=csr_array(([1.0], ([0], [0])), shape=(1, a.dof_count)),
        G_b=csr_array(([-1.0], ([0], [count - 1])), shape=(1, count)),
        gap=np.array([gap]),
        area=np.array([area]),
        points=a.mesh.points[:1],
        axial=np.array([1.0]),
        rim=np.zeros(1, dtype=bool),
        size=np.array([np.sqrt(area)]),
        slave="a",
        nodes=np.zeros(1, dtype=np.int64),
        reach=gap,
        clearance=gap,
        entry=np.zeros(1),
    )


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
    weight: float = 0.0,
    returns: float = 1.6,
) -> FullOrderResult:
    """Rod of ``length`` [m] on a rigid wall, or on a free rod of length ``other`` [m].

    Elements of one size h; time step ``courant`` h / c; ``weight`` [N] of the rod; the run takes
    so many return times of the wave.
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
        duration=returns * 2.0 * length / material.bar_wave_speed,
        step=courant * size / material.bar_wave_speed,
        axial_force=-weight,
        scheme=scheme,
    )


def plateau(result: FullOrderResult, duration: float) -> float:
    """Mean force [N] between 20 % and 80 % of an expected contact time [s]."""
    history = result.history
    since = history.time - history.time[int(np.argmax(history.force > 0))]
    return float(history.force[(since > 0.2 * duration) & (since < 0.8 * duration)].mean())


def since_touch(history: ImpactHistory) -> np.ndarray:
    """Middles of steps since first touch [s]."""
    first = int(np.argmax(history.force > 0))
    return np.asarray(history.time - history.time[first] + 0.5 * history.step)


def force_curve(history: ImpactHistory, known: np.ndarray) -> ComparedCurve:
    """Force since first touch, beside the known one [N]."""
    since = since_touch(history)
    return ComparedCurve(
        x_label="time since first touch [us]",
        y_label="force [N]",
        expected=(since * 1e6, known),
        computed=(since * 1e6, history.force),
    )


def square_pulse(history: ImpactHistory, height: float, duration: float) -> ComparedCurve:
    """The same for a constant force [N] of some duration [s]."""
    since = since_touch(history)
    return force_curve(history, np.where((since > 0.0) & (since < duration), height, 0.0))


def blocked_bar(
    length: float, radius: float, elements: int, material: Material
) -> tuple[ElasticBody, ContactSpace]:
    """Bar of quad8 elements, axisymmetric, that cannot move sideways, over a rigid plane.

    Its bulk wave runs at c_p = sqrt(E (1-nu) / (rho (1+nu) (1-2nu))).
    """
    bar = _strip(length, radius, elements)
    body = elastic_body("bar", bar, {"solid": material})
    body = replace(body, fixed=np.arange(0, body.dof_count, 2))
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

    Elements of ``size`` [m] within 0.1 mm of the contact, then up to ``bulk`` [m].
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
    return (
        elastic_body("sphere", upper, {"ball": material}),
        elastic_body("target", lower, {"block": material}),
        contact_space(upper, faces[0], lower, faces[1], reach=8e-6),
    )


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

    Elements of ``size`` [m] within 60 um of the ring, then up to ``bulk`` [m]. Axisymmetric, or
    with ``layers`` swept to solids, the seat turned by 0.13 rad so that they do not match.
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
    """One column of quad8 elements, 0 to ``length``, 0 to ``radius``."""
    points = np.stack(
        np.meshgrid(
            np.array([0.0, 0.5 * radius, radius]), np.linspace(0.0, length, 2 * elements + 1)
        ),
        axis=-1,
    ).reshape(-1, 2)
    low = 6 * np.arange(elements)[:, None]
    corners_and_middles = low + np.array([0, 2, 8, 6, 1, 5, 7, 3])
    used, flat = np.unique(corners_and_middles, return_inverse=True)  # drops the element centres
    connectivity: np.ndarray = flat.reshape(corners_and_middles.shape)
    bottom, top = connectivity[0, [0, 1, 4]], connectivity[-1, [2, 3, 6]]
    return Mesh(
        points=points[used],
        blocks=(ElementBlock("quad8", connectivity, "solid"),),
        surfaces={
            "bottom": Surface("bottom", (FaceBlock("line3", bottom[None]),)),
            "top": Surface("top", (FaceBlock("line3", top[None]),)),
        },
    )


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
    length [m]
    modes
        Lowest plane ones, by the compliance they give a uniform pressure.
    radius [m]
    """
    bar, _ = blocked_bar(length, radius, elements, material)
    wall_mesh = lattice_mesh("quad8", [np.array([0.0, 2.0 * radius]), np.array([-length, 0.0])])
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
    return interface_model(
        [
            InterfaceBody(
                body=bar,
                flexibility=flexibility,
                modes=Modes(pool.omega[plane], pool.shapes[:, plane]),
                damping=np.zeros(len(plane)),
            ),
            InterfaceBody(
                body=wall,
                flexibility=Flexibility(wall),
                modes=Modes(np.zeros(0), np.zeros((wall.dof_count, 0))),
                damping=np.zeros(0),
            ),
        ],
        [InterfaceContact(name="wall", upper="bar", lower="wall", space=space)],
    )


def block_on_pad(
    arm: float, *, width: float = 0.2e-3
) -> tuple[ElasticBody, ElasticBody, ContactSpace]:
    """Steel block of 10 x 10 x 20 mm whose lower face meets a small soft pad off-axis.

    Parameters
    ----------
    arm [m]
        From the axis to the middle of the pad, along x.
    width [m]
        Of the square pad, half as high; stiffness about E width * 2.
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
    """Block with two crowned ends between plates, ``play`` [m] from the upper one."""
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


def _line(start: float, end: float, cells: int) -> np.ndarray:
    return np.linspace(start, end, cells + 1)


def _towards_middle(half: float) -> np.ndarray:
    """Cell borders from -half to half, smaller in the middle (an eighth)."""
    side = half * np.array([0.0, 0.0625, 0.125, 0.25, 0.5, 1.0])
    return np.concatenate([-side[:0:-1], side])


def _crowned(width: float, *, height: float = 6e-3, both: bool = False) -> Mesh:
    """Square block on z = 0 with a parabolic lower end (and upper end) of R 50 mm."""
    radius = 50e-3

    def shape(x: np.ndarray) -> np.ndarray:
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


_SPEED = 0.5  # [m/s]
_AREA = 1e-4  # [m^2]
_ELEMENTS = 200


def checks() -> list[Check]:
    """Return all checks of the full-order impact."""
    return [*_rod_on_wall(), *_two_rods(), *_blocked_bar(), *_sphere_on_block()]


def _rod_on_wall() -> list[Check]:
    length = 0.03
    impedance = STEEL.density * STEEL.bar_wave_speed * _AREA
    contact_time = 2.0 * length / STEEL.bar_wave_speed
    run = drop_rod(length, elements=_ELEMENTS)
    other = drop_rod(length, elements=_ELEMENTS, scheme="massless")
    history = run.history
    curve = square_pulse(run.history, impedance * _SPEED, contact_time)
    source = "bar on rigid wall, one-dimensional wave equation: "
    return [
        check(
            "rod on rigid wall: force [N]",
            expected=impedance * _SPEED,
            computed=plateau(run, contact_time),
            tolerance=1e-5,
            source=source + "F = rho c A v",
            curve=curve,
        ),
        check(
            "rod on rigid wall: contact time [s]",
            expected=contact_time,
            computed=_contact_time(run),
            tolerance=1e-2,
            source=source + "T = 2 L / c; dispersion smears the front",
            curve=curve,
        ),
        check(
            "rod on rigid wall: restitution",
            expected=1.0,
            computed=history.velocity_a[-1] / _SPEED,
            tolerance=1.5e-2,
            source=source + "e = 1; falls short by the dispersed tail of the front",
        ),
        check(
            "rod on rigid wall: impulse against change of momentum [N s]",
            expected=history.mass_a * (history.velocity_a[-1] + _SPEED),
            computed=history.impulse,
            tolerance=5e-14,
            source="Newton's second law",
        ),
        check(
            "rod on rigid wall: energy residual over impact energy",
            expected=0.0,
            computed=history.ledger.residual,
            tolerance=5e-14,
            source="energy theorem of the scheme: losses -lam.g0 and -2 mu.g1 / h^2 are counted",
        ),
        check(
            "rod on rigid wall: impulse, massless against contact-stabilised [N s]",
            expected=history.impulse,
            computed=other.history.impulse,
            tolerance=5e-3,
            source="two schemes for one continuous problem",
        ),
    ]


def _two_rods() -> list[Check]:
    length = 0.02
    impedance = STEEL.density * STEEL.bar_wave_speed * _AREA
    contact_time = 2.0 * length / STEEL.bar_wave_speed
    run = drop_rod(length, 2.0 * length, elements=_ELEMENTS)
    unequal = drop_rod(length, 2.0 * length, elements=_ELEMENTS, other_area=3.0 * _AREA)
    history = run.history
    parting = history.velocity_a[-1] - history.velocity_b[-1]
    source = "St Venant; Goldsmith 1960, ch. 2: "
    return [
        check(
            "two rods 1:2: force [N]",
            expected=0.5 * impedance * _SPEED,
            computed=plateau(run, contact_time),
            tolerance=1e-5,
            source=source + "F = rho c A v / 2",
            curve=square_pulse(run.history, 0.5 * impedance * _SPEED, contact_time),
        ),
        check(
            "two rods 1:2: restitution",
            expected=0.5,
            computed=parting / _SPEED,
            tolerance=2e-2,
            source=source + "e = L1 / L2",
        ),
        check(
            "rods of areas 1:3: force [N]",
            expected=0.75 * impedance * _SPEED,
            computed=plateau(unequal, contact_time),
            tolerance=1e-5,
            source=source + "F = v Z1 Z2 / (Z1 + Z2)",
            curve=square_pulse(unequal.history, 0.75 * impedance * _SPEED, contact_time),
        ),
    ]


def _blocked_bar() -> list[Check]:
    length, speed = 0.03, _SPEED
    c = bulk_wave_speed(STEEL)
    run = drop_blocked_bar(length, 60, speed)
    return [
        check(
            "bar without lateral strain on rigid wall, axisymmetric: force [N]",
            expected=STEEL.density * c * pi * 2e-3**2 * speed,
            computed=plateau(run, 2.0 * length / c),
            tolerance=1e-3,
            source="F = rho c_p A v, c_p^2 = E (1-nu) / (rho (1+nu) (1-2nu))",
            curve=square_pulse(
                run.history, STEEL.density * c * pi * 2e-3**2 * speed, 2.0 * length / c
            ),
        )
    ]


def _sphere_on_block() -> list[Check]:
    """Sphere of 4 mm on a block too large for echoes."""
    run = drop_sphere(radius=50e-3, height=50e-3, bulk=3e-3, speed=_SPEED)
    history = run.history
    peak, contact_time = 30.4775197, 15.8774048e-6
    curve = force_curve(
        history, hertz_force(since_touch(history), duration=contact_time, peak=peak)
    )
    return [
        check(
            "steel sphere on thick steel block, 0.5 m/s: share of energy radiated, 1 - e^2",
            expected=4.4152e-3,
            computed=1.0 - (history.velocity_a[-1] / _SPEED) ** 2,
            tolerance=5e-2,
            source="Hertz force radiated into a half-space: Hunter 1957; Miller & Pursey 1955",
        ),
        check(
            "steel sphere D4 on thick steel block, 0.5 m/s: peak force [N]",
            expected=peak,
            computed=float(np.max(history.force)),
            tolerance=1e-2,
            source="Hertz 1882 (quasi-static; contact radius 1/27 of the sphere's)",
            curve=curve,
        ),
        check(
            "steel sphere D4 on thick steel block, 0.5 m/s: contact time [s]",
            expected=contact_time,
            computed=_contact_time(run),
            tolerance=1e-2,
            source="Hertz 1882, T = 2.9433 delta_max / v",
            curve=curve,
        ),
        check(
            "steel sphere on thick steel block: energy lost by the scheme",
            expected=0.0,
            computed=run.energy_loss,
            tolerance=1e-4,
            source="Deuflhard, Krause & Ertel 2008: the loss vanishes with the step",
        ),
    ]


def _contact_time(run: FullOrderResult) -> float:
    return float(np.count_nonzero(run.history.force > 0) * run.history.step)
