"""Reduced models become the rods they were made from.

Truth: the exact spectra, shapes and compliances of elastic rods; closed forms of a rigid lever and
of an overdamped oscillator; a rod of springs and masses solved in full.
"""

from math import pi, sqrt

import numpy as np
import pytest
import scipy.linalg

from klack.reduction.damping import ModalDamping
from klack.reduction.from_modal_data import body_of_craig_bampton, body_of_modal_data
from klack.reduction.from_state_space import body_of_state_space, state_space_in_si
from klack.reduction.reduced_body import ReducedBody, StateSpace
from klack.simulation.bodies import rod_body
from klack.unit_systems import UNIT_SYSTEMS, unit_system

STEEL = {"length": 0.03, "area": 1e-5, "young": 2e11, "density": 8e3}


def rod(support: str = "free", modes: int = 30, damping: float = 0.001) -> ReducedBody:
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
    truth = rod()
    model = truth.state_space(with_residual=True)
    assert_same(body_of_state_space("rod", model, where="rod"), truth, rel=1e-12, shapes=1e-8)


def test_held_rod():
    truth = rod("bottom")
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
    truth = rod(support)
    model = truth.state_space(with_residual=True)
    model = model if support == "free" else at_top(model)
    n = len(model.A)
    scale = np.concatenate([np.full(n // 2, 1e6), np.ones(n // 2)])
    mix = np.random.default_rng(1).normal(size=(n, n)) / sqrt(n)
    found = body_of_state_space("rod", changed(model, mix * scale), where="rod", mass=truth.mass)
    assert_same(found, truth, rel=1e-8, shapes=1e-6)


@pytest.mark.parametrize("name", list(UNIT_SYSTEMS))
def test_units_of_a_state_space(name):
    truth = rod()
    model = from_si(truth.state_space(with_residual=True), name)
    found = body_of_state_space("rod", state_space_in_si(model, unit_system(name)), where="rod")
    assert_same(found, truth, rel=1e-11, shapes=1e-8)


def test_bending_modes_in_two_planes_share_their_frequency():
    """Two modes at one frequency: their shapes are any pair, their sum of squares is not."""
    truth = rod(modes=4)
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
    truth = rod()
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
    exact = rod("bottom" if held else "free", modes=3)
    lowest = slice(first, first + 3)  # 40 elements: (n pi / 40)^2 / 24
    assert found.omega[lowest] == pytest.approx(exact.omega[lowest], rel=3e-3)


def test_state_space_of_a_mode_follows_its_closed_form():
    """The receptance of the converted body is that of the rod with the same modes."""
    truth = rod(modes=12)
    found = body_of_state_space("rod", truth.state_space(with_residual=True), where="rod")
    for body_frequency in (3e3, 51e3, 220e3):
        s = 2j * pi * body_frequency

        def receptance(body: ReducedBody, s: complex = s) -> np.ndarray:
            own = s**2 + 2 * body.damping * body.omega * s + body.omega**2
            modal = body.port_shapes.T @ (body.port_shapes / own[:, None])
            return modal + body.residual_compliance

        assert receptance(found) == pytest.approx(receptance(truth), rel=1e-8)
