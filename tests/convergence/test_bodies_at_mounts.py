"""Craig-Bampton bodies at their mounts: against direct solutions, closed forms and conservation."""

import numpy as np
import pytest
import scipy

from klack.acoustics.at_mounts import mount_impedance, source_at_mounts
from klack.acoustics.harmonic import harmonic_response
from klack.acoustics.interface import InterfacePoint, SourceAtMounts, laplace
from klack.acoustics.mount import Mount, axial_freedom
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.fourier_body import fourier_body
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.craig_bampton import (
    CraigBampton,
    Interface,
    averages_of,
    constrained_modes,
    craig_bampton,
)
from klack.bodies.reduction.damping import Damping, LossFactor, RayleighDamping
from klack.bodies.reduction.mounting import interface_of, mounting_surface
from klack.bodies.reduction.ports import surface_port
from klack.materials.material import Material
from klack.mesh.mesh import Mesh
from klack.verification.lattice import lattice_mesh
from klack.verification.reduction import LENGTH, RADIUS, STEEL_WITHOUT_POISSON
from klack.verification.vibration import rod_structure

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7800.0)
BETA = 2e-8  # of a damping that any basis carries exactly: K (1 + beta s)
DAMPING = RayleighDamping(alpha=0.0, beta=BETA)
LINES = np.array([200.0, 1e3, 3e3, 8e3, 15e3, 20e3])


def block() -> Mesh:
    """A block of 60 x 20 x 30 mm; its two ends are mounts."""
    sizes = ((0.06, 5), (0.02, 1), (0.03, 2))
    return lattice_mesh("hex20", [np.linspace(0.0, length, n + 1) for length, n in sizes])


def at_ends(
    kinds: tuple[str, str], count: int, *, damping: Damping = DAMPING
) -> tuple[CraigBampton, ElasticBody, list[Interface], np.ndarray]:
    """Craig-Bampton body of the block, itself, its interfaces, and the pattern of the force."""
    mesh = block()
    surfaces = [
        mounting_surface(mesh, [name], name, kind=kind)  # type: ignore[arg-type]
        for name, kind in zip(("left", "right"), kinds, strict=True)
    ]
    held = [part.nodes for part in surfaces if part.kind == "rigid"]
    nodes = np.unique(np.concatenate(held)) if held else ()
    body = elastic_body("block", mesh, {"solid": STEEL}, fixed_nodes=nodes)
    parts = [interface_of(body, surface) for surface in surfaces]
    direction = np.array([0.3, 0.2, 1.0])
    pattern = surface_port(mesh, "top", direction, name="push").pattern[:, None]
    with Flexibility(body) as flexibility:
        averaged = averages_of(body, parts)
        if averaged.shape[1]:
            modes = constrained_modes(flexibility, averaged, 150e3)
        else:
            modes = eigenmodes(body, count=max(count, 1), flexibility=flexibility)
        modes = Modes(modes.omega[:count], modes.shapes[:, :count])
        reduced = craig_bampton(
            flexibility, parts, modes, damping=damping, port_names=["push"], patterns=pattern
        )
    return reduced, body, parts, pattern


def points_of(body: CraigBampton) -> tuple[InterfacePoint, ...]:
    return tuple(InterfacePoint(name=name) for name in dict.fromkeys(body.mounts))


def source(body: CraigBampton, shift: float = 0.0, lines: np.ndarray = LINES) -> SourceAtMounts:
    forces = np.ones((lines.size, len(body.port_names)), dtype=complex)
    return source_at_mounts([body], [forces], points_of(body), lines, shift=shift)


def direct(
    body: ElasticBody, parts: list[Interface], pattern: np.ndarray, s: complex
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocked force, free velocity and mobility of all unknowns at once."""
    D = (body.K * (1.0 + BETA * s) + s**2 * body.M).tocsc()
    moved = [part.moved() for part in parts if part.kind == "rigid"]
    free = np.setdiff1d(np.arange(body.dof_count), body.fixed)
    T = scipy.sparse.hstack(
        [
            scipy.sparse.eye_array(body.dof_count).tocsc()[:, free],
            *map(scipy.sparse.csc_array, moved),
        ]
    ).tocsc()
    A, f = (T.T @ D @ T).tocsc(), (T.T @ pattern)[:, 0]
    reads = np.zeros((A.shape[0], 0))
    at = len(free)
    for part in parts:
        d = len(part.directions)
        if part.kind == "rigid":
            read = np.zeros((A.shape[0], d))
            read[at : at + d] = np.eye(d)
            at += d
        else:
            read = T.T @ part.averages()
        reads = np.hstack([reads, read])
    solve = scipy.sparse.linalg.splu(A).solve
    U = solve(np.column_stack([reads, f]).astype(complex))
    Y = s * reads.T @ U[:, :-1]
    v = s * reads.T @ U[:, -1]
    return np.linalg.solve(Y, v), v, Y


@pytest.mark.parametrize("kinds", [("rigid", "rigid"), ("averaged", "averaged")])
def test_convergence_to_the_direct_solution(kinds: tuple[str, str]) -> None:
    """Largest errors over 0.2 to 20 kHz fall with the number of modes, for forces fastest."""
    errors = []
    for count in (5, 40):
        body, full, parts, pattern = at_ends(kinds, count)
        found, worst = source(body), np.zeros(3)
        for k, s in enumerate(laplace(LINES)):
            F, v, Y = direct(full, parts, pattern, s)
            lever = np.where(np.array(body.directions) > 3, 0.02, 1.0)
            for i, (ours, truth) in enumerate(
                (
                    (found.blocked_force[k] / lever, F / lever),
                    (found.free_velocity[k] * lever, v * lever),
                    (found.mobility[k] * np.outer(lever, lever), Y * np.outer(lever, lever)),
                )
            ):
                worst[i] = max(worst[i], np.abs(ours - truth).max() / np.abs(truth).max())
        errors.append(worst)
    assert np.all(errors[1] < errors[0] / 3.0)
    force, velocity, mobility = errors[1]  # 40 modes, to 150 kHz
    assert force < 1e-3
    assert velocity < 3e-3
    assert mobility < 5e-3  # near a resonance of the free block


@pytest.mark.parametrize("shift", [0.0, 700.0])
def test_all_modes_are_the_whole_body(shift: float) -> None:
    """Of a small mesh, on the axis of frequency and beside it."""
    mesh = lattice_mesh(
        "hex20", [np.linspace(0.0, x, n) for x, n in ((0.06, 3), (0.02, 2), (0.03, 2))]
    )
    surfaces = [mounting_surface(mesh, [name], name, kind="rigid") for name in ("left", "right")]
    nodes = np.unique(np.concatenate([part.nodes for part in surfaces]))
    body = elastic_body("block", mesh, {"solid": STEEL}, fixed_nodes=nodes)
    parts = [interface_of(body, surface) for surface in surfaces]
    pattern = surface_port(mesh, "top", "z", name="push").pattern[:, None]
    with Flexibility(body) as flexibility:
        modes = eigenmodes(body, count=len(body.free), flexibility=flexibility)
        reduced = craig_bampton(
            flexibility, parts, modes, damping=DAMPING, port_names=["push"], patterns=pattern
        )
    found = source(reduced, shift)
    for k, s in enumerate(laplace(LINES, shift)):
        F, v, Y = direct(body, parts, pattern, s)
        assert found.blocked_force[k] == pytest.approx(F, rel=1e-8, abs=1e-8 * np.abs(F).max())
        assert found.free_velocity[k] == pytest.approx(v, rel=1e-8, abs=1e-8 * np.abs(v).max())
        assert found.mobility[k] == pytest.approx(Y, rel=1e-8, abs=1e-9 * np.abs(Y).max())


@pytest.mark.parametrize("kinds", [("rigid", "averaged"), ("averaged", "averaged")])
def test_reciprocal_passive_and_rigid_at_low_frequency(kinds: tuple[str, str]) -> None:
    """Of a rigid motion the mounts move as one; ``v_f`` is that of a mass and its inertia."""
    body, full, _, pattern = at_ends(kinds, 20, damping=LossFactor(eta=0.02))
    lines = np.geomspace(5.0, 20e3, 40)
    lever = np.where(np.array(body.directions) > 3, 0.02, 1.0)
    Z = mount_impedance(body, laplace(lines)) / np.outer(lever, lever)
    assert np.abs(Z - Z.transpose(0, 2, 1)).max(axis=(1, 2)) == pytest.approx(
        np.zeros(lines.size), abs=1e-10 * np.abs(Z).max()
    )
    found = source(body, lines=lines)
    Y = found.mobility * np.outer(lever, lever)
    real = np.linalg.eigvalsh((Y.real + Y.real.transpose(0, 2, 1)) / 2)
    assert np.all(real.min(axis=1) > -1e-10 * np.abs(Y).max(axis=(1, 2)))
    # rigid body: momentum and moment of momentum about the centre of mass
    mesh, centre = full.mesh, full.centre_of_mass
    load = pattern.reshape(-1, 3)
    wrench = np.concatenate([load.sum(axis=0), np.cross(mesh.points - centre, load).sum(axis=0)])
    s = 2j * np.pi * lines[0]
    moved = np.concatenate([wrench[:3] / full.mass, np.linalg.solve(full.inertia, wrench[3:])]) / s
    for i, x in enumerate((0.0, 0.06)):
        arm = np.array([x, 0.01, 0.015]) - centre
        truth = np.concatenate([moved[:3] + np.cross(moved[3:], arm), moved[3:]])
        own = found.free_velocity[0, 6 * i : 6 * i + 6]
        assert own == pytest.approx(truth, rel=1e-6, abs=1e-6 * np.abs(moved).max())


def test_one_mount_along_the_axis_is_that_of_the_structure() -> None:
    """Participation, blocked force, and the motion on an elastic mount with all of the mass."""
    structure = rod_structure(modes=12, damping=0.01)
    mesh = lattice_mesh(
        "quad8", [np.array([0.0, RADIUS]), np.linspace(0.0, LENGTH, 81)], solid="rod"
    )
    top = mounting_surface(mesh, ["top"], "top", kind="rigid")
    body = elastic_body("rod", mesh, {"rod": STEEL_WITHOUT_POISSON}, fixed_nodes=top.nodes)
    pattern = surface_port(mesh, "bottom", "z", name="tip").pattern[:, None]
    with Flexibility(body) as flexibility:
        modes = eigenmodes(body, count=12, flexibility=flexibility)
        reduced = craig_bampton(
            flexibility,
            [interface_of(body, top)],
            modes,
            damping=LossFactor(eta=0.02),
            port_names=["tip"],
            patterns=pattern,
        )
    old = axial_freedom(structure, structure.mass)
    assert np.abs(reduced.participation) == pytest.approx(np.abs(old.participation), abs=1e-9)
    assert reduced.mass == pytest.approx(old.mass, rel=1e-9)
    assert np.abs(reduced.stiffness).max() < 1e-9 * structure.omega[0] ** 2 * structure.mass
    f = np.geomspace(20.0, 200e3, 30)
    ours, mount = source(reduced, lines=f), Mount(stiffness=1e6, loss_factor=0.1)
    held = harmonic_response(structure, f, "tip")
    assert ours.blocked_force[:, 0] == pytest.approx(held.support_force, rel=1e-9)
    carried = harmonic_response(structure, f, "tip", mount=mount)
    below = laplace(f) / (1e6 * (1.0 + 0.1j))
    force = ours.free_velocity[:, 0] / (ours.mobility[:, 0, 0] + below)
    assert force == pytest.approx(carried.support_force, rel=1e-9)


def rod_stiffness(s: complex, modulus: complex, length: float, factor: float) -> np.ndarray:
    """Exact dynamic stiffness of a uniform rod between its ends, (2, 2)."""
    k = s / np.sqrt(modulus / STEEL_WITHOUT_POISSON.density)
    a = modulus * factor * k
    own, across = a / np.tanh(k * length), -a / np.sinh(k * length)
    return np.array([[own, across], [across, own]])


def test_free_rod_along_and_about_its_axis() -> None:
    """A free rod of revolution pushed at one end, its mount at the other, and its torsion."""
    mesh = lattice_mesh(
        "quad8", [np.array([0.0, RADIUS]), np.linspace(0.0, LENGTH, 81)], solid="rod"
    )
    top = mounting_surface(mesh, ["top"], "top", kind="rigid")
    pattern = surface_port(mesh, "bottom", "z", name="tip").pattern[:, None]
    materials = {"rod": STEEL_WITHOUT_POISSON}
    axial = elastic_body("rod", mesh, materials, fixed_nodes=top.nodes)
    torsion = fourier_body("rod", mesh, materials, order=0, fixed_nodes=top.nodes)
    beta = RayleighDamping(alpha=0.0, beta=1e-8)
    bodies = []
    for body, load in ((axial, pattern), (torsion, None)):
        with Flexibility(body) as flexibility:
            modes = eigenmodes(body, count=40, flexibility=flexibility)
            names = ["tip"] if load is not None else []
            bodies.append(
                craig_bampton(
                    flexibility,
                    [interface_of(body, top)],
                    modes,
                    damping=beta,
                    port_names=names,
                    patterns=load,
                )
            )
    f = np.array([100.0, 3e3, 20e3, 60e3, 110e3])
    force = [np.ones((f.size, 1), dtype=complex), np.zeros((f.size, 0), dtype=complex)]
    found = source_at_mounts(bodies, force, (InterfacePoint(name="top"),), f)
    young, area = STEEL_WITHOUT_POISSON.young, np.pi * RADIUS**2
    for k, s in enumerate(laplace(f)):
        along = np.linalg.inv(rod_stiffness(s, young * (1.0 + 1e-8 * s), LENGTH, area)) * s
        about = rod_stiffness(s, young / 2.0 * (1.0 + 1e-8 * s), LENGTH, area * RADIUS**2 / 2.0)
        assert found.free_velocity[k, 0] == pytest.approx(along[0, 1], rel=3e-4)
        assert found.mobility[k, 0, 0] == pytest.approx(along[1, 1], rel=3e-4)
        assert found.blocked_force[k, 0] == pytest.approx(along[0, 1] / along[1, 1], rel=3e-5)
        assert found.mobility[k, 1, 1] == pytest.approx(s * np.linalg.inv(about)[1, 1], rel=3e-3)
    assert np.all(found.mobility[:, 0, 1] == 0.0)


@pytest.mark.parametrize("kind", ["rigid", "averaged"])
def test_a_body_of_revolution_tilts_as_a_mass(kind: str) -> None:
    """Order 1: mass and inertia of a cylinder about its end; x and y are alike but for signs."""
    radius, length = 4e-3, 15e-3
    mesh = lattice_mesh("quad8", [np.linspace(0.0, radius, 4), np.linspace(0.0, length, 9)])
    end = mounting_surface(mesh, ["top"], "end", kind=kind)  # type: ignore[arg-type]
    nodes = end.nodes if kind == "rigid" else ()
    body = fourier_body("cylinder", mesh, {"solid": STEEL}, order=1, fixed_nodes=nodes)
    parts = []
    with Flexibility(body) as flexibility:
        for turned in (False, True):
            part = interface_of(body, end, turned=turned)
            if kind == "averaged":
                modes = constrained_modes(flexibility, part.averages(), 500e3)
            else:
                modes = eigenmodes(body, max_frequency=500e3, flexibility=flexibility)
            parts.append(craig_bampton(flexibility, [part], modes, damping=DAMPING))
    f = np.array([10.0, 20e3])
    nothing = [np.zeros((2, 0), dtype=complex)] * 2
    found = source_at_mounts(parts, nothing, (InterfacePoint(name="end"),), f)
    assert [str(freedom) for freedom in found.freedoms] == ["end.x", "end.y", "end.rx", "end.ry"]
    mass, arm = np.pi * radius**2 * length * STEEL.density, length / 2.0
    inertia = mass * (radius**2 / 4.0 + length**2 / 12.0 + arm**2)  # about the end
    M = np.diag([mass, mass, inertia, inertia])
    M[0, 3] = M[3, 0] = -mass * arm  # x and ry: the centre of mass is below the end
    M[1, 2] = M[2, 1] = mass * arm
    truth = np.linalg.inv(M) / (2j * np.pi * 10.0)
    size = 1.0 / np.sqrt(np.abs(np.diag(truth)))
    # the static share of the joint's own flexibility is far below the motion as a mass
    assert found.mobility[0] * np.outer(size, size) == pytest.approx(
        truth * np.outer(size, size), abs=1e-6
    )
    Y = found.mobility[1]
    assert Y[0, 0] == pytest.approx(Y[1, 1], rel=1e-12)
    assert Y[2, 2] == pytest.approx(Y[3, 3], rel=1e-12)
    assert Y[0, 3] == pytest.approx(-Y[1, 2], rel=1e-9)
