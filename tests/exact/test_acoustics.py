"""Sound of structures: surfaces, mounts, plates, radiation.

Vibration, mounts, plates and radiation against closed formulas and small exact systems.

Surface integrals and static rests of a structure against closed formulas.
"""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from klack.acoustics.force_response import modal_response
from klack.acoustics.harmonic import harmonic_response
from klack.acoustics.mobility import transfer_mobility
from klack.acoustics.mount import Mount, mounted
from klack.acoustics.plate import Air, Plate, baffled_plate_efficiency
from klack.acoustics.radiation import piston_efficiency, power_transfer
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.ports import surface_port
from klack.bodies.reduction.structure import Structure, StructurePort, build_structure
from klack.materials.material import Material
from klack.mesh.mesh import Mesh, outer_surface
from klack.signals.sampled import TimeSeries
from klack.verification.lattice import lattice_mesh
from klack.verification.reduction import LENGTH, RADIUS, STEEL_WITHOUT_POISSON
from klack.verification.vibration import STEEL, oscillator, rod_structure

MASS, STIFFNESS, BASE = 0.3, 4e6, 0.9  # [kg], [N/m], [kg]
AIR = Air()


@pytest.mark.parametrize("damping", [0.0, 0.1, 1.5])
def test_a_step_of_force_on_one_mode(damping: float) -> None:
    """From rest to F: displacement of an oscillator in closed form."""
    body = oscillator(mass=MASS, stiffness=STIFFNESS, base=BASE, damping=damping)
    h, n = 1e-6, 4000
    values = np.full(n, 50.0)
    values[0] = 0.0  # it has acted for ever
    run = modal_response(body, {"mass": series(h, values)}, sample=10 * h)

    t, w = run.sample_time - h, body.omega[0]
    root = np.sqrt(complex(1 - damping**2)) * w
    swing = np.cos(root * t) + damping * w * np.sin(root * t) / root
    exact = 50.0 / STIFFNESS * (1 - (np.exp(-damping * w * t) * swing).real)
    shown = t >= 0
    moved = run.modal_displacement[:, 0] / np.sqrt(MASS)
    assert moved[shown] == pytest.approx(exact[shown], rel=1e-9, abs=1e-9 * 50 / STIFFNESS)


def test_a_force_that_has_always_acted_moves_nothing() -> None:
    body = rod_structure(modes=6, damping=0.01)

    run = modal_response(body, {"tip": series(1e-7, np.full(500, 80.0))})

    assert run.stored == pytest.approx(np.full(501, run.energy_before), rel=1e-12)
    assert abs(run.injected_energy) < 1e-12 * run.energy_before
    assert run.blocked_force.values == pytest.approx(np.full(500, 80.0), rel=1e-9)
    # the terms of the loss, each up to the stored energy, cancel in each of the 500 intervals
    assert abs(run.vibration_energy) < 500 * np.finfo(float).eps * run.energy_before


@pytest.mark.parametrize("below", ["mount", "plate", "both"])
def test_two_masses_are_solved_exactly(below: str) -> None:
    """Mobility of an oscillator on a spring with losses and on a plate, from its 2 x 2 system."""
    plate = Plate(thickness=2e-3, area=1.0, material=STEEL) if below != "mount" else None
    mount = Mount(stiffness=2e6, loss_factor=0.1) if below != "plate" else None
    zeta = 0.03
    body = oscillator(mass=MASS, stiffness=STIFFNESS, base=BASE, damping=zeta)
    f = np.geomspace(10.0, 5e3, 40)

    computed = transfer_mobility(body, "mass", "mass", f, mount=mount, plate=plate)
    carried = harmonic_response(body, f, "mass", mount=mount, plate=plate).support_force

    dashpot = 2 * zeta * np.sqrt(STIFFNESS * MASS)
    for at, y, share in zip(f, computed, carried, strict=True):
        w = 2 * np.pi * at
        spring = STIFFNESS + 1j * w * dashpot
        soft = 1j * w / (2e6 * (1 + 0.1j)) if mount else 0.0
        support = 1j * w / (soft + (plate.mobility if plate else 0.0))  # dynamic stiffness
        K = np.array([[spring - w**2 * MASS, -spring], [-spring, spring + support - w**2 * BASE]])
        u = np.linalg.solve(K, [1.0, 0.0])
        assert y == pytest.approx(1j * w * u[0], rel=1e-9)
        assert share == pytest.approx(support * u[1], rel=1e-9)


def test_new_modes_on_a_mount_answer_like_the_old_ones() -> None:
    body = rod_structure(modes=8)
    mount = Mount(stiffness=3e5, loss_factor=0.0)
    moved, f = mounted(body, mount), np.geomspace(100.0, 2.3e5, 50)

    for port in body.port_names:
        old = transfer_mobility(body, port, port, f, mount=mount)
        assert transfer_mobility(moved, port, port, f) == pytest.approx(old, rel=1e-7)
    old_power = power_transfer(body, f, "tip", mount=mount).values
    new_power = power_transfer(moved, f, "tip").values
    assert new_power == pytest.approx(old_power, rel=1e-6)
    old_force = harmonic_response(body, f, "tip", mount=mount).support_force
    assert harmonic_response(moved, f, "tip").support_force == pytest.approx(old_force, rel=1e-7)
    assert np.sum(moved.participation**2) == pytest.approx(body.mass, rel=1e-12)
    assert moved.residual_compliance == pytest.approx(body.residual_compliance, rel=1e-6)


def test_losses_of_mount_and_body_are_shared_by_energy() -> None:
    """Decay of the 2 x 2 system from its complex eigenvalues; small losses."""
    zeta, eta, below = 2e-3, 5e-3, 2e6
    body = oscillator(mass=MASS, stiffness=STIFFNESS, base=BASE, damping=zeta)

    moved = mounted(body, Mount(stiffness=below, loss_factor=eta))

    for w, damping in zip(moved.omega, moved.damping, strict=True):
        spring = STIFFNESS + 1j * w * 2 * zeta * np.sqrt(STIFFNESS * MASS)
        K = np.array([[spring, -spring], [-spring, spring + below * (1 + 1j * eta)]])
        roots = np.sqrt(np.linalg.eigvals(K / np.array([[MASS], [BASE]])))
        root = roots[np.argmin(np.abs(roots - w))]
        assert damping == pytest.approx(root.imag / root.real, rel=1e-3)


def test_a_free_body_takes_all_momentum() -> None:
    """Soft mount: m v of the lowest mode is the impulse of the force."""
    moved = mounted(rod_structure(modes=8), Mount(stiffness=1e-2, loss_factor=0.0))
    h = 20e-9
    values = 30.0 * np.sin(np.pi * np.linspace(0, 1, 400)) ** 2

    run = modal_response(moved, {"tip": series(h, values)}, sample=h)

    speed = moved.participation @ run.modal_velocity[-1] / moved.mass
    assert speed == pytest.approx(h * values.sum() / moved.mass, rel=1e-6)


@pytest.mark.parametrize(("thickness", "impedance"), [(1e-3, 98.29), (2e-3, 393.2)])
def test_impedance_of_a_steel_plate(thickness: float, impedance: float) -> None:
    """8 sqrt(D m'') = 2.3 rho c_p h^2 with the plate speed c_p, as the handbooks write it."""
    plate = Plate(thickness=thickness, area=1.0, material=STEEL)
    speed = np.sqrt(STEEL.plane_strain_modulus / STEEL.density)

    assert 1 / plate.mobility == pytest.approx(impedance, rel=1e-4)
    handbook = 4 / np.sqrt(3) * STEEL.density * speed * thickness**2  # 2.309
    assert 1 / plate.mobility == pytest.approx(handbook, rel=1e-12)


def test_a_finite_plate_has_that_mobility_on_average() -> None:
    """Modes of a simply supported plate, averaged over frequency and over places inside."""
    plate = Plate(thickness=1e-3, area=0.5 * 0.41, material=STEEL)
    a, b, eta = 0.5, 0.41, 0.02
    m, n = np.meshgrid(np.arange(1, 80), np.arange(1, 70), indexing="ij")
    root = np.sqrt(plate.bending_stiffness / plate.mass_per_area)
    squares = (root * ((m * np.pi / a) ** 2 + (n * np.pi / b) ** 2)) ** 2 * (1 + 1j * eta)
    omega = 2 * np.pi * np.linspace(2e3, 6e3, 400)
    total = []
    for x, y in np.random.default_rng(1).uniform(0.25, 0.75, (12, 2)):
        shape = 4 * (np.sin(m * np.pi * x) * np.sin(n * np.pi * y)) ** 2
        shape = shape / (plate.mass_per_area * a * b)
        total.append([np.sum(1j * w * shape / (squares - w**2)).real for w in omega])

    # 12 places and about 100 modes: a per cent is left to chance
    assert np.mean(total) == pytest.approx(plate.mobility, rel=0.02)


def test_radiation_efficiency_of_a_plate_against_the_integral_over_its_modes() -> None:
    """Wallace's far-field integral, averaged over the modes of a band; within 1 dB of Maidanik."""
    plate = Plate(thickness=2e-3, area=0.64, material=STEEL)
    side, c, fc = 0.8, AIR.sound_speed, plate.coincidence(AIR)
    root = np.sqrt(plate.bending_stiffness / plate.mass_per_area)
    m, n = np.meshgrid(np.arange(1, 60), np.arange(1, 60), indexing="ij")
    f = root * np.pi / 2 * (m**2 + n**2) / side**2
    for middle in (0.12 * fc, 0.3 * fc, 0.6 * fc):
        inside = (f > middle / 1.12) & (f < middle * 1.12)
        assert inside.sum() > 15
        modes = zip(m[inside], n[inside], f[inside], strict=True)
        exact = np.mean([wallace(i, j, at, side, c) for i, j, at in modes])
        estimate = baffled_plate_efficiency(np.array([middle]), fc, area=0.64, sound_speed=c)[0]
        assert abs(10 * np.log10(estimate / exact)) < 1.0


def wallace(m: int, n: int, f: float, side: float, c: float) -> float:
    """Radiation efficiency of one mode of a square plate, by far-field intensity."""
    k = 2 * np.pi * f / c
    x, wx = np.polynomial.legendre.leggauss(64)
    theta, phi = np.pi / 4 * (x + 1), np.pi / 4 * (x + 1)
    T, P = np.meshgrid(theta, phi, indexing="ij")
    alpha = k * side * np.sin(T) * np.cos(P)
    beta = k * side * np.sin(T) * np.sin(P)
    top = (np.cos if m % 2 else np.sin)(alpha / 2) * (np.cos if n % 2 else np.sin)(beta / 2)
    bottom = ((alpha / (m * np.pi)) ** 2 - 1) * ((beta / (n * np.pi)) ** 2 - 1)
    integrand = (top / bottom) ** 2 * np.sin(T)
    integral = float(np.sum(np.outer(wx, wx) * integrand) * (np.pi / 4) ** 2)
    return 64 * (k * side) ** 2 / (np.pi**6 * m**2 * n**2) * integral


def test_limits_of_the_radiation_of_a_plate() -> None:
    plate = Plate(thickness=1e-3, area=0.5, material=STEEL, loss_factor=0.02)
    fc = plate.coincidence(AIR)
    f = np.array([0.1, 30.0 * fc])

    sigma = plate.efficiency(f, AIR)
    share = plate.radiated_share(f[1:], AIR)

    assert sigma[0] == pytest.approx(4 * 0.5 * (0.1 / AIR.sound_speed) ** 2, rel=1e-12)
    assert sigma[1] == pytest.approx(1 / np.sqrt(1 - 1 / 30), rel=1e-12)
    lost = 2 * AIR.impedance * sigma[1] / (2 * np.pi * f[1] * 7.85)
    assert share == pytest.approx([lost / (lost + 0.02)], rel=1e-12)


def test_corners_and_edges_in_the_notation_of_maidanik() -> None:
    """Efficiency 2 lambda_c^2 g_1 / A + P lambda_c g_2 / A; here corners give a good part."""
    plate = Plate(thickness=1e-3, area=0.04, material=STEEL)
    wave = AIR.sound_speed / plate.coincidence(AIR)
    a = np.sqrt(0.15)
    g1 = 4 / np.pi**4 * (1 - 2 * a**2) / (a * np.sqrt(1 - a**2))
    g2 = ((1 - a**2) * np.log((1 + a) / (1 - a)) + 2 * a) / (4 * np.pi**2 * (1 - a**2) ** 1.5)
    corners, edges = 2 * wave**2 * g1 / 0.04, 4 * 0.2 * wave * g2 / 0.04

    sigma = plate.efficiency(np.array([0.15 * plate.coincidence(AIR)]), AIR)

    assert corners > 0.1 * edges
    assert sigma == pytest.approx([corners + edges], rel=1e-12)


@pytest.mark.parametrize(("first_mode", "limited"), [(0.45, False), (0.55, True)])
def test_plates_change_their_kind_where_the_first_mode_is_at_half_coincidence(
    first_mode: float, limited: bool
) -> None:
    """EN 12354-1, B: beyond it the efficiency near coincidence is sqrt(2 pi f 2 l/(16 c))."""
    c, fc = 343.0, 1000.0
    area = c**2 / (2.0 * fc * first_mode * fc)

    sigma = baffled_plate_efficiency(np.array([0.9 * fc]), fc, area=area, sound_speed=c)

    limit = np.sqrt(2.0 * np.pi * 0.9 * fc * 2.0 * np.sqrt(area) / (16.0 * c))
    assert bool(sigma[0] == pytest.approx(limit, rel=1e-12)) is limited


@pytest.mark.parametrize("x", [1e-4, 3e-3, 0.99e-2, 0.3])
def test_efficiency_of_a_piston_by_the_series_of_the_bessel_function(x: float) -> None:
    """``1 - 2 J_1(x)/x``, ``x = 2 k a``, by its series: ``-(-x^2/4)^k / (k! (k + 1)!)``."""
    area, c = 1e-2, 343.0
    f = x * c / (4.0 * np.pi) / np.sqrt(area / np.pi)

    exact = sum(-((-(x**2) / 4.0) ** k) / (factorial(k) * factorial(k + 1)) for k in range(1, 9))

    # x^4/9216 is left out below 1e-2; the closed form loses 1e-16/(x^2/8)
    sigma = piston_efficiency(np.array([f]), area, c)[0]
    assert sigma == pytest.approx(exact, rel=1e-11, abs=0.0)


def test_all_power_of_a_lossless_valve_goes_into_the_plate() -> None:
    plate = Plate(thickness=1.5e-3, area=0.5, material=STEEL)
    body = rod_structure(modes=8)
    f = np.geomspace(100.0, 2e5, 60)

    taken = transfer_mobility(body, "tip", "tip", f, plate=plate).real
    force = harmonic_response(body, f, "tip", plate=plate).support_force

    assert taken == pytest.approx(plate.mobility * np.abs(force) ** 2, rel=1e-7)


def test_a_plate_adds_its_share_to_the_radiated_power() -> None:
    plate = Plate(thickness=1.5e-3, area=0.5, material=STEEL)
    body, f = rod_structure(modes=8, damping=0.01), np.geomspace(100.0, 2e5, 20)

    power = power_transfer(body, f, "tip", plate=plate)

    force = np.abs(harmonic_response(body, f, "tip", plate=plate).support_force) ** 2
    assert power.names == ("bottom", "outer", "plate")
    expected = plate.mobility * force * plate.radiated_share(f, AIR)
    assert power.group("plate") == pytest.approx(expected, rel=1e-12)
    assert power.total == pytest.approx(power.values.sum(axis=0), rel=1e-12)


def test_radiated_power_from_velocities_face_by_face() -> None:
    """Rho c sum of v^2 A over small faces, against the Gram matrices; the rod's side moves little.

    With Poisson's ratio 0 the side has no normal motion, so the end face alone radiates.
    """
    body = rod_structure(modes=8, damping=0.01)
    f = np.geomspace(1e3, 2e5, 30)
    answer = harmonic_response(body, f, "tip")

    power = power_transfer(body, f, "tip", efficiency="unity")

    shapes = np.hstack([body.face_shapes, body.face_residual, body.axial_normals[:, None]])
    v = answer.fields @ shapes.T.astype(float)
    exact = AIR.impedance * np.abs(v) ** 2 @ body.face_area
    assert power.total == pytest.approx(exact, rel=1e-5)  # single precision
    piston = power_transfer(body, f, "tip", efficiency="piston")
    sigma = piston_efficiency(f, body.area, AIR.sound_speed)
    assert piston.total == pytest.approx(sigma * power.total, rel=1e-12)


@pytest.mark.parametrize("modes", [1, 4])
def test_the_static_rest_radiates_as_well(modes: int) -> None:
    """Far below resonance the end moves by L / (E A) per force, whatever the number of modes."""
    body, f = rod_structure(modes=modes), np.array([50.0])

    power = power_transfer(body, f, "tip", efficiency="unity")

    end = body.group_area[body.group_names.index("bottom")]
    velocity = 2 * np.pi * 50.0 * body.static_compliance[0, 0]
    assert power.group("bottom") == pytest.approx(AIR.impedance * end * velocity**2, rel=1e-5)
    assert body.residual_compliance[0, 0] > 0.04 * body.static_compliance[0, 0]


def test_a_face_that_moves_with_the_mount_radiates_what_it_should() -> None:
    """Rigid oscillation of a face of 1 cm^2: rho c A v^2 with v = 1 / (omega M)."""
    body = oscillator(mass=MASS, stiffness=1e12, base=BASE)
    f = np.array([300.0])

    power = power_transfer(
        body, f, "mass", mount=Mount(stiffness=1e-3, loss_factor=0.0), efficiency="unity"
    )

    v = 1 / (2 * np.pi * 300.0 * (MASS + BASE))
    assert power.total == pytest.approx([AIR.impedance * 1e-4 * v**2], rel=1e-4)  # stiffness


def test_material_of_a_plate() -> None:
    aluminium = Material(name="aluminium", young=70e9, poisson=0.33, density=2700.0)
    plate = Plate(thickness=3e-3, area=0.2, material=aluminium)

    assert plate.bending_stiffness == pytest.approx(70e9 * 27e-9 / 12 / (1 - 0.33**2), rel=1e-12)
    assert plate.mass_per_area == pytest.approx(8.1, rel=1e-12)


def series(step: float, values: np.ndarray) -> TimeSeries:
    return TimeSeries(step=step, values=values, unit="N", start=0.5 * step)


A, B, C = 3e-3, 2e-3, 5e-3  # [m]


def sounding(
    mesh: Mesh, field: np.ndarray, held: str, *surfaces: str, **extra: object
) -> Structure:
    """Structure whose only mode is a given displacement field, shape (n, dimension)."""
    body = elastic_body("body", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface(held).nodes)
    modes = Modes(omega=np.array([1e5]), shapes=field.reshape(-1, 1))
    port = surface_port(mesh, surfaces[0], "z", name="port")
    return build_structure(
        body,
        modes=modes,
        damping=ModalDamping(ratio=0.01),
        ports=[StructurePort(port=port)],
        deflections=np.zeros((body.dof_count, 1)),
        surfaces=surfaces,
        **extra,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tet4", "hex8"])
def test_integrals_over_the_faces_of_a_solid(family: str) -> None:
    """u_z = x y (quadratic families) or x, and u_x = z, over rectangles; exact in the elements."""
    mesh = lattice_mesh(family, [np.linspace(0, length, 3) for length in (A, B, C)])
    x, y, z = mesh.points.T
    quadratic = family in ("tet10", "hex20", "wedge15")
    height = x * y if quadratic else x
    field = np.column_stack([z, 0 * x, height])

    s = sounding(mesh, field, "bottom", "top", "left", "right")

    square = A**3 * B**3 / 9 if quadratic else A**3 * B / 3
    volume = A**2 * B**2 / 4 if quadratic else A**2 * B / 2
    assert s.group_names == ("top", "left", "right")
    assert s.group_area == pytest.approx([A * B, B * C, B * C], rel=1e-12)
    assert s.group_gram[0, 0, 0] == pytest.approx(square, rel=1e-12)
    assert s.group_gram[0, 0, -1] == pytest.approx(volume, rel=1e-12)  # against a unit axial motion
    assert s.group_gram[0, -1, -1] == pytest.approx(A * B, rel=1e-12)
    assert s.group_volume[0, 0] == pytest.approx(volume, rel=1e-12)
    assert s.group_gram[1:, 0, 0] == pytest.approx([B * C**3 / 3] * 2, rel=1e-12)
    assert s.group_volume[1:, 0] == pytest.approx([-B * C**2 / 2, B * C**2 / 2], rel=1e-12)
    assert np.abs(s.group_gram[1:, -1, -1]).max() < 1e-20 * A * B


def test_integrals_over_rings() -> None:
    """u_z = r^2 on the end, u_r = z on the side of a cylinder, dA = 2 pi r ds."""
    mesh = lattice_mesh("quad8", [np.linspace(0, A, 4), np.linspace(0, C, 5)])
    r, z = mesh.points.T

    s = sounding(mesh, np.column_stack([z, r**2]), "bottom", "top", "outer")

    pi = np.pi
    assert s.group_area == pytest.approx([pi * A**2, 2 * pi * A * C], rel=1e-12)
    assert s.group_gram[0, 0, 0] == pytest.approx(pi * A**6 / 3, rel=1e-12)
    assert s.group_volume[0, 0] == pytest.approx(pi * A**4 / 2, rel=1e-12)
    assert s.group_gram[1, 0, 0] == pytest.approx(2 * pi * A * C**3 / 3, rel=1e-12)
    assert s.group_volume[1, -1] == pytest.approx(0.0, abs=1e-18)


def test_a_sphere_that_oscillates_as_a_whole() -> None:
    """Integral of n_z^2 over a sphere: 4 pi a^2 / 3; lines on the axis have no area."""

    def ring(x: np.ndarray) -> np.ndarray:
        return np.column_stack([x[:, 0] * np.sin(x[:, 1]), -x[:, 0] * np.cos(x[:, 1])])

    mesh = lattice_mesh("quad8", [np.array([0.5 * A, A]), np.linspace(0, np.pi, 41)], ring)

    s = sounding(mesh, np.zeros_like(mesh.points), "inner", "outer", "bottom", "top")

    assert s.group_names == ("outer",)
    assert s.area == pytest.approx(4 * np.pi * A**2, rel=1e-6)  # parabolas instead of arcs
    assert s.group_gram[0, -1, -1] == pytest.approx(4 * np.pi * A**2 / 3, rel=1e-6)
    assert abs(s.group_volume[0, -1]) < 1e-12 * s.area


def test_means_over_faces_add_up_to_the_groups() -> None:
    mesh = lattice_mesh("tet10", [np.linspace(0, length, 3) for length in (A, B, C)])
    x, y, z = mesh.points.T
    s = sounding(mesh, np.column_stack([y * z, x * z, x * y]), "bottom", "top", "left")

    for g in range(2):
        own = s.face_group == g
        assert s.face_area[own].sum() == pytest.approx(s.group_area[g], rel=1e-12)
        volume = s.face_area[own] @ s.face_shapes[own].astype(float)
        assert volume == pytest.approx(s.group_volume[g, :1], rel=1e-6)  # single precision
    corners = s.points[s.faces]  # plane triangles
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    assert s.faces.shape[1] == 3
    assert area / 2 == pytest.approx(np.linalg.norm(s.face_area), rel=1e-12)


def test_a_face_counts_once() -> None:
    mesh = lattice_mesh("hex20", [np.linspace(0, length, 3) for length in (A, B, C)])
    mesh = replace(mesh, surfaces={**mesh.surfaces, "skin": outer_surface(mesh)})
    field = np.zeros((mesh.node_count, 3))
    whole = 2 * (A * B + B * C + A * C)

    twice = sounding(mesh, field, "bottom", "top", "skin")
    without = sounding(mesh, field, "bottom", "skin", left_out=("bottom", "left"))

    assert twice.group_area == pytest.approx([A * B, whole - A * B], rel=1e-12)
    assert without.group_area == pytest.approx([whole - A * B - B * C], rel=1e-12)


@pytest.mark.parametrize("modes", [1, 5, 12])
def test_static_motion_of_a_face_is_whole_for_any_number_of_modes(modes: int) -> None:
    """A rod pulled down at its free end by 1 N stretches by L / (E A)."""
    s = rod_structure(modes=modes)
    stretch = LENGTH / (STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2)

    end = s.face_group == s.group_names.index("bottom")
    modal = s.face_shapes[end].astype(float) @ (s.port_shapes[:, 0] / s.omega**2)
    moved = -(modal + s.face_residual[end, 0])  # the end faces down

    assert moved == pytest.approx(np.full(end.sum(), stretch), rel=1e-5)  # single precision
    assert s.static_compliance[0, 0] == pytest.approx(stretch, rel=1e-8)


def test_participation_of_a_rod() -> None:
    """Share of the mass in mode n of a held rod: 8 / (pi (2 n - 1))^2."""
    s = rod_structure(modes=4)

    share = s.participation**2 / s.mass

    odd = 2 * np.arange(1, 5) - 1
    assert share == pytest.approx(8 / (np.pi * odd) ** 2, rel=1e-4)  # mesh of 80 elements


@pytest.mark.parametrize(("modes", "most"), [(6, 5e-3), (20, 1e-4)])
def test_power_transfer_against_the_full_body(modes: int, most: float) -> None:
    """A thick ring with Poisson's ratio, loaded at its inner edge: direct harmonic solution."""
    mesh = lattice_mesh("quad8", [np.linspace(2e-3, 5e-3, 5), np.linspace(0, 8e-3, 9)])
    body = elastic_body("ring", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface("bottom").nodes)
    port = surface_port(mesh, "inner", "z", name="port")
    with Flexibility(body) as flexibility:
        structure = build_structure(
            body,
            modes=eigenmodes(body, count=modes, flexibility=flexibility),
            damping=ModalDamping(ratio=0.0),
            ports=[StructurePort(port=port)],
            deflections=flexibility.solve(port.pattern[:, None]),
            surfaces=("top", "outer"),
        )
    frequency = np.array([2e3, 2e4, 8e4, 1.45e5])  # first modes at 163 and 248 kHz
    powers = power_transfer(structure, frequency, "port", efficiency="unity").values

    keep = body.free
    for f, computed in zip(frequency, powers.T, strict=True):
        omega = 2 * np.pi * f
        u = np.zeros(body.dof_count)
        dynamic = (body.K - omega**2 * body.M)[keep][:, keep]
        u[keep] = spsolve(dynamic.tocsc(), port.pattern[keep])
        exact = [_squares(mesh, name, omega * u) for name in ("top", "outer")]
        assert computed == pytest.approx(Air().impedance * np.array(exact), rel=most)


def _squares(mesh: Mesh, surface: str, u: np.ndarray) -> float:
    """Integral of the squared normal displacement over a flat or round surface."""
    total = 0.0
    normal = 1 if surface == "top" else 0
    xi, weight = np.polynomial.legendre.leggauss(5)
    shape = np.stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2], axis=1)  # ends, middle
    for block in mesh.surface(surface).blocks:
        for nodes in block.connectivity:
            r = shape @ mesh.points[nodes, 0]
            length = np.linalg.norm(mesh.points[nodes[1]] - mesh.points[nodes[0]])
            moved = shape @ u.reshape(-1, 2)[nodes, normal]
            total += float(np.sum(weight * moved**2 * 2 * np.pi * r) * length / 2)
    return total
