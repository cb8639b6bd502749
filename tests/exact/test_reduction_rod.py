"""Reduction of rods and its ports.

Reduced rods against closed formulas.

Truth: free-free rod end, receptance ``-cot(kL)/(EAk)``, and the series of its modes; the table of
residual flexibilities in ``tests/data`` is evaluated from them independently.

Port patterns against integrals known in closed form.

Reduced models become the rods they were made from.

Truth: the exact spectra, shapes and compliances of elastic rods; closed forms of a rigid lever and
of an overdamped oscillator; a rod of springs and masses solved in full.
"""

from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.attachment import default_shift, shift_at, shifted_attachment
from klack.bodies.reduction.damping import LossFactor, ModalDamping
from klack.bodies.reduction.from_modal_data import body_of_craig_bampton, body_of_modal_data
from klack.bodies.reduction.from_state_space import body_of_state_space, state_space_in_si
from klack.bodies.reduction.full_order import full_order_receptance
from klack.bodies.reduction.ports import node_observer, pressure_port, surface_port
from klack.bodies.reduction.receptance import reduced_receptance
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody, StateSpace
from klack.bodies.reduction.selection import ByCount
from klack.input.unit_systems import UNIT_SYSTEMS, unit_system
from klack.simulation.bodies import rod_body
from klack.verification.lattice import lattice_mesh
from klack.verification.reduction import (
    LENGTH,
    RADIUS,
    STEEL_WITHOUT_POISSON,
    exact_receptance,
    rod,
)

TABLE = np.genfromtxt(
    Path(__file__).parents[1] / "data" / "rod_residual_flexibility.csv",
    delimiter=",",
    skip_header=2,
)
SPRING = STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2 / LENGTH  # EA / L
DAMPING = LossFactor(eta=1e-2)


@pytest.fixture(scope="module")
def free():
    body, lower, upper = rod(elements=120, clamped=False)
    return body, [lower, upper], eigenmodes(body, count=20), Flexibility(body)


@pytest.fixture(scope="module")
def clamped():
    body, lower, _ = rod(elements=120, clamped=True)
    return body, [lower], eigenmodes(body, count=20), Flexibility(body)


def reduced(parts, count, correction, shifts=None):
    body, ports, pool, flexibility = parts
    return reduce_body(
        body,
        ports,
        modes=ByCount(count),
        correction=correction,
        damping=DAMPING,
        modes_pool=pool,
        flexibility=flexibility,
        shifts=shifts,
    )


# Tolerance: the frequency of mode n of a quadratic rod is high by (n pi h / L)^4 / 720, 1e-4 for
# n = 20 and 120 elements, and the residual is a small difference of nearly equal sums.
@pytest.mark.parametrize(("column", "support"), [(1, "free"), (2, "clamped")])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 10, 20])
def test_missing_compliance_matches_the_table(count, column, support, request):
    expected = TABLE[TABLE[:, 0] == count, column].item()

    body = reduced(request.getfixturevalue(support), count, "consistent")

    assert body.residual_compliance[0, 0] * SPRING == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("support", ["free", "clamped"])
@pytest.mark.parametrize("count", [0, 1, 5, 20])
def test_attachment_modes_make_the_static_response_exact(count, support, request):
    body = reduced(request.getfixturevalue(support), count, "attachment")

    assert_allclose(body.modal_compliance, body.static_compliance, rtol=1e-10, atol=0)
    exact = 1 / 3 if support == "free" else 1.0
    assert body.modal_compliance[0, 0] * SPRING == pytest.approx(exact, rel=1e-8)


def test_end_to_end_compliance_of_the_free_rod(free):
    """Inertia relief, far end: sum of 2 (-1)^n / (n pi)^2 = -1/6."""
    body = reduced(free, 3, "attachment")

    assert body.static_compliance[0, 1] * SPRING == pytest.approx(-1 / 6, rel=1e-8)


def test_shifted_attachment_modes_are_exact_at_their_shift(free):
    """At w^2 = s < 0: coth(aL)/(EAa), a^2 = -s rho/E, from the receptance at imaginary w."""
    pool = free[2]
    shift = default_shift(pool.omega)
    body = reduced(free, 3, "attachment", shifts=(shift,))

    computed = np.sum(body.port_shapes[:, 0] ** 2 / (body.omega**2 - shift))

    a = np.sqrt(-shift * STEEL_WITHOUT_POISSON.density / STEEL_WITHOUT_POISSON.young)
    exact = 1 / np.tanh(a * LENGTH) / (STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2 * a)
    assert computed == pytest.approx(exact, rel=1e-8)


# Tolerance: quadratic elements are off by (k h)^4 / 720, 2e-7 at 190 kHz and 120 elements, which
# the distance from the nearest resonance or notch magnifies.
@pytest.mark.parametrize("ends", [(0, 0), (1, 0)], ids=["drive point", "far end"])
@pytest.mark.parametrize("shifts", [(20e3, 190e3), (130e3, -40e3)], ids=["above", "both signs"])
def test_two_shifted_attachment_modes_are_exact_at_both_shifts(free, shifts, ends):
    """Without damping, -cot(kL)/(EAk) and -1/(sin(kL) EAk); both signs: with imaginary k."""
    body = reduced(free, 1, "attachment", shifts=[shift_at(f) for f in shifts])
    E, rho = STEEL_WITHOUT_POISSON.young, STEEL_WITHOUT_POISSON.density

    for f in shifts:
        k = 2 * np.pi * np.sqrt(complex(np.sign(f))) * abs(f) * np.sqrt(rho / E)
        exact = -1 / (
            E * np.pi * RADIUS**2 * k * (np.tan if ends == (0, 0) else np.sin)(k * LENGTH)
        )
        phi = body.port_shapes
        computed = np.sum(phi[:, ends[0]] * phi[:, ends[1]] / (body.omega**2 - shift_at(f)))
        assert computed == pytest.approx(exact.real, rel=1e-5)


@pytest.mark.parametrize(("count", "shifts"), [(1, (20e3, 190e3)), (3, (-50e3, 30e3, -200e3))])
def test_every_shift_adds_one_orthonormal_mode_per_port(free, count, shifts):
    """M-orthonormal and K-diagonal to round-off: the recovered shapes of all nodes tell."""
    body, ports, pool, flexibility = free
    kept = Modes(omega=pool.omega[:count], shapes=pool.shapes[:, :count])
    patterns = np.column_stack([port.pattern for port in ports])

    extra = shifted_attachment(body, kept, patterns, [shift_at(f) for f in shifts], flexibility)

    assert len(extra.omega) == 2 * len(shifts)  # two ports
    V = np.hstack([body.rigid_modes, kept.shapes, extra.shapes])
    omega = np.concatenate([np.zeros(body.rigid_modes.shape[1]), kept.omega, extra.omega])
    assert_allclose(V.T @ (body.M @ V), np.eye(len(omega)), atol=1e-9)
    assert_allclose(
        V.T @ (body.K @ V) / omega.max() ** 2, np.diag(omega / omega.max()) ** 2, atol=1e-9
    )


def test_two_low_shifts_leave_the_square_of_the_static_error_of_one(free):
    """Both far below the omitted modes: relative error below (s_1 / w^2)^2 (s_2 / w^2)^2."""
    pool = free[2]
    shifts = (default_shift(pool.omega), 0.25 * default_shift(pool.omega))

    one = reduced(free, 3, "attachment", shifts=shifts[:1]).residual_compliance[0, 0]
    two = reduced(free, 3, "attachment", shifts=shifts).residual_compliance[0, 0]

    ratios = [s / pool.omega[3] ** 2 for s in shifts]
    assert 0 < one * SPRING < ratios[0] ** 2
    assert abs(two) * SPRING < np.prod(ratios) ** 2 + 1e-12


@pytest.mark.parametrize("count", [3, 10])
def test_shifted_attachment_modes_are_nearly_exact_statically(free, count):
    """Documented error of the default shift: of the order (omega_1 / omega_(m+1))^4, from above."""
    pool = free[2]
    body = reduced(free, count, "attachment", shifts=(default_shift(pool.omega),))

    missing = body.residual_compliance[0, 0] * SPRING

    assert 0 < missing < (pool.omega[0] / pool.omega[count]) ** 4


def test_full_order_receptance_is_that_of_the_exact_rod(free):
    """1 kHz to 1 MHz, 27 resonances; 120 elements leave 1.2e-3 at the sharpest of them."""
    body, ports, _, flexibility = free
    axis = np.geomspace(1e3, 1e6, 600)

    full = full_order_receptance(
        body, ports, axis, loss_factor=1e-2, flexibility=flexibility, tolerance=1e-4
    )

    assert full.error_bound.max() <= 1e-4
    assert_allclose(full.receptance.values[:, 0, :], exact_receptance(axis), rtol=2e-3)


@pytest.mark.parametrize(
    ("correction", "tolerance"), [("consistent", 0.1), ("attachment", 2e-3), ("none", None)]
)
def test_correction_restores_the_receptance(free, correction, tolerance):
    """10 modes (to 860 kHz), up to 250 kHz, every antiresonance included.

    The constant residual misses a share (f / f_11)^2 = 7 % of itself at the top, which shows at the
    antiresonances (0.085 there); the attachment mode the square of it.  Without correction the
    antiresonances are elsewhere (factor 5).
    """
    axis = np.linspace(5e3, 250e3, 300)
    body = reduced(free, 10, correction)

    computed = reduced_receptance(
        body, axis, with_residual=correction == "consistent", loss_factor=1e-2
    )

    deviation = np.max(np.abs(computed.values[:, 0, 0] / exact_receptance(axis)[:, 0] - 1))
    assert deviation > 3 if tolerance is None else deviation < tolerance


def test_viscous_damping_has_the_same_resonance_peaks(free):
    """At a resonance zeta = eta / 2 gives the peak of the loss factor: |G| = phi^2 / (eta w^2)."""
    body = reduced(free, 5, "attachment")
    axis = body.frequencies[1:4]

    viscous = reduced_receptance(body, axis, with_residual=False)
    structural = reduced_receptance(body, axis, with_residual=False, loss_factor=1e-2)

    # the other modes stand beside the peak; their damping differs, a few eta^2 of the peak
    assert_allclose(np.abs(viscous.drive("bottom")), np.abs(structural.drive("bottom")), rtol=5e-4)


def box(family):
    lines = [np.array([0.0, 0.4, 1.0]), np.array([0.0, 1.0]), np.array([0.0, 2.0])]
    return lattice_mesh(family, lines)


def cone(family):
    """Frustum: radius 1 at z = 0, 0.5 at z = 1; the outer side is the conical one."""
    lines = [np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 4)]
    return lattice_mesh(
        family, lines, lambda x: x * np.stack([1 - x[:, 1] / 2, 1 + 0 * x[:, 1]], 1)
    )


@pytest.mark.parametrize("family", ["tet4", "tet10", "hex8", "hex20", "wedge15"])
def test_mean_displacement_over_a_rectangle(family):
    """Exact: mean of x^2 over [0, 1] x [0, 1] is 1/3 (quadratic families), of x is 1/2 (all)."""
    mesh = box(family)
    port = surface_port(mesh, "top", "y", name="top")
    x = mesh.points[:, 0]

    def mean(values):
        field = np.zeros((mesh.node_count, 3))
        field[:, 1] = values
        return port.pattern @ field.ravel()

    assert mean(np.ones_like(x)) == pytest.approx(1.0, rel=1e-12)
    assert mean(x) == pytest.approx(1 / 2, rel=1e-12)
    if family in ("tet10", "hex20", "wedge15"):
        assert mean(x**2) == pytest.approx(1 / 3, rel=1e-12)


def test_corner_nodes_of_a_quadratic_triangle_carry_nothing():
    """Exact: the integrals of the corner functions of a six-node triangle vanish."""
    mesh = lattice_mesh("tet10", [np.array([0.0, 1.0])] * 3)
    pattern = surface_port(mesh, "top", "z", name="top").pattern.reshape(-1, 3)
    face = mesh.surface("top").blocks[0].connectivity[0]

    assert_allclose(pattern[face[:3], 2], 0.0, atol=1e-15)
    assert np.count_nonzero(np.abs(pattern[:, 2]) > 0.1) == 5  # 4 edges and the diagonal


@pytest.mark.parametrize("family", ["quad4", "quad8", "tri3", "tri6"])
def test_mean_over_a_disc_weights_with_the_radius(family):
    """Exact: mean of r over the unit disc is 2/3."""
    mesh = lattice_mesh(family, [np.linspace(0.0, 1.0, 4), np.array([0.0, 1.0])])
    pattern = surface_port(mesh, "top", "z", name="top").pattern.reshape(-1, 2)

    assert pattern[:, 1].sum() == pytest.approx(1.0, rel=1e-12)
    assert pattern[:, 1] @ mesh.points[:, 0] == pytest.approx(2 / 3, rel=1e-12)


@pytest.mark.parametrize("family", ["quad8", "tri6"])
def test_pressure_on_a_cone(family):
    """Exact: axial resultant p pi (R^2 - r^2) = 3/4 pi p, radial load 2 pi p int r dz = 3/2 pi p.

    The cone narrows upwards: a unit resultant of the pressure on it points down.
    """
    pattern = pressure_port(cone(family), "outer", name="seat").pattern.reshape(-1, 2)

    assert pattern[:, 1].sum() == pytest.approx(-1.0, rel=1e-12)
    assert pattern[:, 0].sum() == pytest.approx(-2.0, rel=1e-12)


def test_pressure_on_a_plane_is_a_uniform_traction():
    """Pressure on the upper face pushes down."""
    mesh = box("hex20")
    pressure = pressure_port(mesh, "top", name="a")
    traction = surface_port(mesh, "top", (0.0, 0.0, -5.0), name="b")

    assert_allclose(pressure.pattern, traction.pattern, atol=1e-15)


def test_observer_reads_the_nearest_node():
    mesh = box("hex8")
    observer = node_observer(mesh, (1.01, 0.0, 2.0), "x", name="corner")

    assert observer.weights @ mesh.points.ravel() == 1.0
    assert np.count_nonzero(observer.weights) == 1


STEEL = {"length": 0.03, "area": 1e-5, "young": 2e11, "density": 8e3}


def rod_reduced(support: str = "free", modes: int = 30, damping: float = 0.001) -> ReducedBody:
    return rod_body("rod", elastic_modes=modes, support=support, damping=damping, **STEEL)


def at_top(model: StateSpace) -> StateSpace:
    """Port at the top alone: the bottom of a held rod does not move."""
    return StateSpace(
        A=model.A,
        B=model.B[:, 1:],
        C=model.C[1:],
        feedthrough=model.feedthrough[1:, 1:],
        input_names=("top",),
        output_names=("top",),
    )


def changed(model: StateSpace, T: np.ndarray) -> StateSpace:
    """The same model in the states ``T x``."""
    back = np.linalg.inv(T)
    return StateSpace(
        A=T @ model.A @ back,
        B=T @ model.B,
        C=model.C @ back,
        feedthrough=model.feedthrough,
        input_names=model.input_names,
        output_names=model.output_names,
    )


def from_si(model: StateSpace, name: str) -> StateSpace:
    units = unit_system(name)
    return StateSpace(
        A=model.A * units.time,
        B=model.B * units.time * units.force,
        C=model.C / units.length,
        feedthrough=model.feedthrough * units.force / units.length,
        input_names=model.input_names,
        output_names=model.output_names,
    )


def assert_same(found: ReducedBody, truth: ReducedBody, *, rel: float, shapes: float) -> None:
    assert found.rigid_count == truth.rigid_count
    assert found.omega == pytest.approx(truth.omega, rel=rel)
    assert found.damping == pytest.approx(truth.damping, rel=1e-6, abs=1e-10)
    ports = [truth.port_names.index(name) for name in found.port_names]
    expected = truth.port_shapes[:, ports]
    largest = np.abs(expected).max()
    for got, wanted in zip(found.port_shapes, expected, strict=True):
        sign = 1.0 if got @ wanted > 0 else -1.0
        assert sign * got == pytest.approx(wanted, abs=shapes * largest)
    assert found.static_compliance == pytest.approx(
        truth.static_compliance[np.ix_(ports, ports)], rel=1e-6
    )
    if truth.rigid_count:
        assert found.mass == pytest.approx(truth.mass, rel=1e-9)
        assert found.rigid_axial @ found.rigid_axial == pytest.approx(truth.mass, rel=1e-9)


def test_free_rod_keeps_its_rigid_motion_apart():
    truth = rod_reduced()
    model = truth.state_space(with_residual=True)
    assert_same(body_of_state_space("rod", model, where="rod"), truth, rel=1e-12, shapes=1e-8)


def test_held_rod():
    truth = rod_reduced("bottom")
    found = body_of_state_space(
        "rod", at_top(truth.state_space(with_residual=True)), where="rod", mass=truth.mass
    )
    assert_same(found, truth, rel=1e-12, shapes=1e-8)
    assert np.isnan(
        body_of_state_space("rod", at_top(truth.state_space(with_residual=False)), where="r").mass
    )


@pytest.mark.parametrize("support", ["free", "bottom"])
def test_any_choice_of_states_gives_the_same_body(support):
    """Positions and velocities of one size, then mixed at random: condition about 200."""
    truth = rod_reduced(support)
    model = truth.state_space(with_residual=True)
    model = model if support == "free" else at_top(model)
    n = len(model.A)
    scale = np.concatenate([np.full(n // 2, 1e6), np.ones(n // 2)])
    mix = np.random.default_rng(1).normal(size=(n, n)) / sqrt(n)
    found = body_of_state_space("rod", changed(model, mix * scale), where="rod", mass=truth.mass)
    assert_same(found, truth, rel=1e-8, shapes=1e-6)


@pytest.mark.parametrize("name", list(UNIT_SYSTEMS))
def test_units_of_a_state_space(name):
    truth = rod_reduced()
    model = from_si(truth.state_space(with_residual=True), name)
    found = body_of_state_space("rod", state_space_in_si(model, unit_system(name)), where="rod")
    assert_same(found, truth, rel=1e-11, shapes=1e-8)


def test_bending_modes_in_two_planes_share_their_frequency():
    """Two modes at one frequency: their shapes are any pair, their sum of squares is not."""
    truth = rod_reduced(modes=4)
    omega = np.concatenate([truth.omega, truth.omega[2:4]])
    shapes = np.vstack([truth.port_shapes, [[3.0, 7.0], [-5.0, 2.0]]])
    m = len(omega)
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.diag(omega**2), -2e-3 * np.diag(omega)]])
    model = StateSpace(
        A=A,
        B=np.vstack([np.zeros((m, 2)), shapes]),
        C=np.hstack([shapes.T, np.zeros((2, m))]),
        feedthrough=np.zeros((2, 2)),
        input_names=("bottom", "top"),
        output_names=("bottom", "top"),
    )
    # mixed states: the eigenvectors of equal poles are then any basis, not an orthogonal one
    mix = np.random.default_rng(2).normal(size=(2 * m, 2 * m)) / sqrt(2 * m)
    mixed = changed(model, mix * np.concatenate([np.full(m, 1e6), np.ones(m)]))
    found = body_of_state_space("rod", mixed, where="rod")
    assert found.mode_count == m
    for w in np.unique(omega):
        mine = found.port_shapes[np.isclose(found.omega, w, rtol=1e-6)]
        given = shapes[omega == w]
        assert mine.T @ mine == pytest.approx(given.T @ given, rel=1e-7)


def test_overdamped_mode_is_a_pair_of_real_poles():
    omega, ratio, shape = 2e4, 3.0, 20.0
    model = StateSpace(
        A=np.array([[0.0, 1.0], [-(omega**2), -2 * ratio * omega]]),
        B=np.array([[0.0], [shape]]),
        C=np.array([[shape, 0.0]]),
        feedthrough=np.zeros((1, 1)),
        input_names=("tip",),
        output_names=("tip",),
    )
    found = body_of_state_space("film", model, where="film")
    assert found.omega == pytest.approx([omega], rel=1e-12)
    assert found.damping == pytest.approx([ratio], rel=1e-12)
    assert found.port_shapes == pytest.approx(np.array([[shape]]), rel=1e-12)


def test_rigid_lever_shows_translation_and_rotation():
    """Mass m, inertia J, ports at -r and +2 r: G = 1/m + a b / J."""
    m, J, arms = 0.005, 2e-8, np.array([-1e-3, 2e-3])
    shapes = np.array([np.full(2, 1 / sqrt(m)), arms / sqrt(J)])
    model = StateSpace(
        A=np.block([[np.zeros((2, 2)), np.eye(2)], [np.zeros((2, 4))]]),
        B=np.vstack([np.zeros((2, 2)), shapes]),
        C=np.hstack([shapes.T, np.zeros((2, 2))]),
        feedthrough=np.zeros((2, 2)),
        input_names=("left", "right"),
        output_names=("left", "right"),
    )
    body = body_of_state_space("lever", model, where="lever", mass=m)
    assert body.rigid_count == 2
    assert body.port_shapes.T @ body.port_shapes == pytest.approx(shapes.T @ shapes, rel=1e-9)
    assert body.port_shapes.T @ body.rigid_axial == pytest.approx([1.0, 1.0], rel=1e-9)
    assert body.rigid_axial @ body.rigid_axial == pytest.approx(m, rel=1e-9)


def test_modes_of_a_modal_analysis():
    truth = rod_reduced()
    frequency = truth.frequencies.copy()
    frequency[0] = 0.02  # what an eigenvalue solver makes of zero
    found = body_of_modal_data(
        "rod",
        frequency=frequency,
        damping=truth.damping,
        shapes=truth.port_shapes,
        port_names=truth.port_names,
        residual=truth.residual_compliance,
        where="rod",
        mass=truth.mass,
    )
    assert_same(found, truth, rel=1e-12, shapes=1e-12)


def spring_chain(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rod of two-node elements with consistent mass."""
    L, A, E, rho = STEEL["length"], STEEL["area"], STEEL["young"], STEEL["density"]
    size = L / count
    K, M = np.zeros((count + 1,) * 2), np.zeros((count + 1,) * 2)
    for i in range(count):
        K[i : i + 2, i : i + 2] += E * A / size * np.array([[1, -1], [-1, 1]])
        M[i : i + 2, i : i + 2] += rho * A * size / 6 * np.array([[2, 1], [1, 2]])
    return K, M


@pytest.mark.parametrize("held", [False, True])
def test_craig_bampton_matrices_keep_what_they_hold(held):
    """All fixed-interface modes: the reduction is exact, so are frequencies and shapes."""
    K, M = spring_chain(40)
    if held:
        K, M = K[1:, 1:], M[1:, 1:]
    ends = [len(K) - 1] if held else [0, len(K) - 1]
    inside = [i for i in range(len(K)) if i not in ends]
    _, modes = scipy.linalg.eigh(K[np.ix_(inside, inside)], M[np.ix_(inside, inside)])
    T = np.zeros_like(K)
    T[ends, range(len(ends))] = 1.0
    T[np.ix_(inside, range(len(ends)))] = -np.linalg.solve(
        K[np.ix_(inside, inside)], K[np.ix_(inside, ends)]
    )
    T[np.ix_(inside, range(len(ends), len(K)))] = modes
    names = ["top"] if held else ["bottom", "top"]
    found = body_of_craig_bampton(
        "rod",
        T.T @ K @ T,
        T.T @ M @ T,
        port_names=names,
        rows=range(len(ends)),
        damping=ModalDamping(ratio=0.002),
        where="rod",
    )
    omega2, shapes = scipy.linalg.eigh(K, M)
    first = 0 if held else 1
    assert found.rigid_count == first
    assert found.omega[first:] == pytest.approx(np.sqrt(omega2[first:]), rel=1e-9)
    assert np.abs(found.port_shapes) == pytest.approx(np.abs(shapes[ends].T), abs=1e-6)
    assert found.damping[first:] == pytest.approx(0.002)
    exact = rod_reduced("bottom" if held else "free", modes=3)
    lowest = slice(first, first + 3)  # 40 elements: (n pi / 40)^2 / 24
    assert found.omega[lowest] == pytest.approx(exact.omega[lowest], rel=3e-3)


def test_state_space_of_a_mode_follows_its_closed_form():
    """The receptance of the converted body is that of the rod with the same modes."""
    truth = rod_reduced(modes=12)
    found = body_of_state_space("rod", truth.state_space(with_residual=True), where="rod")
    for body_frequency in (3e3, 51e3, 220e3):
        s = 2j * pi * body_frequency

        def receptance(body: ReducedBody, s: complex = s) -> np.ndarray:
            own = s**2 + 2 * body.damping * body.omega * s + body.omega**2
            modal = body.port_shapes.T @ (body.port_shapes / own[:, None])
            return modal + body.residual_compliance

        assert receptance(found) == pytest.approx(receptance(truth), rel=1e-8)
