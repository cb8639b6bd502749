"""Models that would make energy are refused, and what passes keeps its energy balance.

Truth: reciprocity and passivity of elastic bodies; a rod whose outputs are disturbed breaks them.
"""

from dataclasses import replace

import numpy as np
import pytest

from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.from_modal_data import body_of_craig_bampton, body_of_modal_data
from klack.bodies.reduction.from_state_space import body_of_state_space
from klack.bodies.reduction.reduced_body import StateSpace
from klack.contact.laws import LinearLaw
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

STEEL = {"length": 0.03, "area": 1e-5, "young": 2e11, "density": 8e3}
ROD = rod_body("rod", elastic_modes=20, damping=0.001, **STEEL)


def model(with_residual: bool = True) -> StateSpace:
    return ROD.state_space(with_residual=with_residual)


def refusal(given: StateSpace, **more: float) -> InputError:
    with pytest.raises(InputError) as caught:
        body_of_state_space("rod", given, where="rod.mat", **more)
    return caught.value


def disturbed(share: float) -> StateSpace:
    """Outputs of the elastic modes off by a random share, as one node for a loaded area."""
    given = model()
    C = given.C.copy()
    noise = np.random.default_rng(3).normal(size=(2, ROD.mode_count - 1))
    C[:, 1 : ROD.mode_count] *= 1.0 + share * noise
    return replace(given, C=C)


def test_two_per_cent_between_force_and_displacement_are_refused():
    error = refusal(disturbed(0.02))
    assert "rod.mat: mode" in error.where
    assert "kHz" in error.where
    assert "'bottom'" in error.got
    assert "'top'" in error.got
    assert "reciprocity" in error.expected
    body_of_state_space("rod", disturbed(1e-5), where="rod.mat")  # rounding of a text file


def test_one_port_shows_a_mode_of_the_wrong_sign():
    given = model()
    C = given.C[:1].copy()
    C[0, 5] *= -1.0
    single = StateSpace(
        A=given.A,
        B=given.B[:, :1],
        C=C,
        feedthrough=given.feedthrough[:1, :1],
        input_names=("bottom",),
        output_names=("bottom",),
    )
    error = refusal(single)
    assert error.where.startswith("rod.mat: mode 5 ")
    assert "passivity" in error.expected


def test_energy_of_a_converted_body_is_kept():
    body = body_of_state_space("rod", model(), where="rod.mat")
    wall = fixed_body("wall")
    contact = ContactPair(
        body_a="rod",
        port_a="bottom",
        body_b="wall",
        port_b="contact",
        law=LinearLaw(1e9),
        gap=0.0,
        series_compliance=float(body.residual_compliance[0, 0]),
    )
    system = ReducedSystem(bodies=(body, wall), contacts=(contact,))
    history = simulate_impact(system, speed=0.5, duration=40e-6, step=20e-9)
    assert history.force.max() > 100.0
    assert abs(history.ledger.residual) < 1e-10


def test_growing_pole_is_refused_but_round_off_is_not():
    given = model()
    A = given.A.copy()
    m = ROD.mode_count
    A[m + 3, m + 3] = 2e-3 * ROD.omega[3]  # damping of -0.1 %
    error = refusal(replace(given, A=A))
    assert error.where == "rod.mat: stability"
    assert f"{ROD.frequencies[3] / 1e3:.6g} kHz" in error.got
    A[m + 3, m + 3] = 1e-9 * ROD.omega[3]
    assert body_of_state_space("rod", replace(given, A=A), where="x").damping[3] == 0.0


def test_velocity_and_acceleration_are_no_displacements():
    given = model(with_residual=False)
    velocity = replace(given, C=given.C @ given.A)
    assert "velocity" in refusal(velocity).got
    acceleration = replace(
        given, C=given.C @ given.A @ given.A, feedthrough=given.C @ given.A @ given.B
    )
    with pytest.raises(InputError, match=r"passivity|0 or more|poles at zero|displacement"):
        body_of_state_space("rod", acceleration, where="x")


def test_turned_port_is_refused():
    given = model(with_residual=False)
    C = given.C.copy()
    C[1] *= -1.0
    assert "have the same direction" in refusal(replace(given, C=C)).expected
    assert "move together along z" in refusal(replace(given, C=C, B=given.B * [1.0, -1.0])).got


def test_feedthrough_must_be_reciprocal_and_positive():
    given = model()
    D = given.feedthrough.copy()
    D[0, 1] *= 1.5
    assert "reciprocity" in refusal(replace(given, feedthrough=D)).expected
    error = refusal(replace(given, feedthrough=-given.feedthrough))
    assert error.where == "rod.mat: feedthrough"
    assert "not passive" in error.expected


def test_drag_on_the_rigid_motion_is_refused():
    given = model(with_residual=False)
    A = given.A.copy()
    A[ROD.mode_count, ROD.mode_count] = -50.0
    assert refusal(replace(given, A=A)).where == "rod.mat: poles at zero"


def test_damping_that_couples_modes_is_refused():
    """A dashpot at one end: complex shapes."""
    given = model(with_residual=False)
    m = ROD.mode_count
    A = given.A.copy()
    shape = ROD.port_shapes[1:, 0]
    A[m + 1 :, m + 1 :] -= 30.0 * np.outer(shape, shape)
    error = refusal(replace(given, A=A))
    assert "complex shape" in error.got


def test_first_order_filter_is_refused():
    given = model(with_residual=False)
    n = len(given.A)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[n, n] = given.A, -1e5
    B, C = np.vstack([given.B, [1.0, 1.0]]), np.hstack([given.C, [[1e-3], [1e-3]]])
    error = refusal(replace(given, A=A, B=B, C=C))
    assert "real pole at -100000 1/s" in error.where


def test_mass_of_the_case_is_compared():
    assert body_of_state_space("rod", model(), where="x", mass=ROD.mass).mass == pytest.approx(
        ROD.mass
    )
    error = refusal(model(), mass=2 * ROD.mass)
    assert error.where == "rod.mat: mass"


def test_modal_data_and_matrices_are_held_to_the_same():
    with pytest.raises(InputError, match="damping of mode 3"):
        body_of_modal_data(
            "rod",
            frequency=ROD.frequencies,
            damping=np.where(np.arange(ROD.mode_count) == 2, -0.01, 0.0),
            shapes=ROD.port_shapes,
            port_names=ROD.port_names,
            where="rod.uff",
        )
    for K, M, word in (
        (np.array([[1e8, -2e8], [-2e8, 1e8]]), np.eye(2), "negative stiffness"),
        (np.eye(2) * 1e8, np.array([[1.0, 2.0], [2.0, 1.0]]), "singular or negative"),
        (np.array([[1e8, 1e7], [2e7, 1e8]]), np.eye(2), "symmetric"),
    ):
        with pytest.raises(InputError, match=word):
            body_of_craig_bampton(
                "b",
                K,
                M,
                port_names=["tip"],
                rows=[0],
                damping=ModalDamping(ratio=0.0),
                where="cb.mat",
            )
