"""Transfer functions of exported matrices equal the sum over the modes."""

import sys

import numpy as np
import pytest

from klack.contact.laws import HertzLaw, LinearLaw
from klack.errors import MissingExtraError
from klack.exchange.modal_model import Provenance, body_model, pair_model
from klack.exchange.state_space import second_order, state_space, to_control
from klack.simulation.bodies import rod_body
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

ORIGIN = Provenance(case="rod", title="", version="0", created="today")
FREQUENCY = np.array([0.01, 3.0, 40.0, 200.0, 900.0]) * 1e3 + 1.7  # off the poles


def _rod(name="rod", support="free", modes=15):
    # the last of 15 modes lies at 0.94 MHz, its omega^2 at 3.5e13
    return rod_body(
        name,
        length=0.04,
        area=1.2e-5,
        young=2.1e11,
        density=7850,
        elastic_modes=modes,
        damping=0.002,
        support=support,
    )


def _modal_sum(body, s):
    """Displacements of the ports by unit forces on them."""
    gain = 1.0 / (s**2 + 2.0 * body.damping * body.omega * s + body.omega**2)
    return (body.port_shapes.T * gain) @ body.port_shapes


@pytest.fixture
def body():
    return _rod()


@pytest.fixture
def pair():
    system = ReducedSystem(
        bodies=(_rod("needle"), _rod("seat", "bottom")),
        contacts=tuple(
            ContactPair(
                body_a="needle",
                port_a=port,
                body_b="seat",
                port_b="top",
                law=law,
                gap=gap,
            )
            for port, law, gap in (("bottom", LinearLaw(1e9), 1e-6), ("top", HertzLaw(1e11), 2e-6))
        ),
        forces=(AxialForce(body="needle", force=-5.0),),
    )
    return pair_model(
        "rods",
        system,
        moving="needle",
        contact_names=("tip", "head"),
        speed=-0.25,
        step=2e-8,
        duration=1e-4,
        provenance=ORIGIN,
    )


@pytest.mark.parametrize("frequency", FREQUENCY)
def test_first_order_form_is_the_modal_sum(body, frequency):
    form, s = state_space(body_model(body, provenance=ORIGIN, step=2e-8)), 2j * np.pi * frequency
    found = form.C @ np.linalg.solve(s * np.eye(len(form.A)) - form.A, form.B) + form.D
    moved = _modal_sum(body, s)
    np.testing.assert_allclose(found[:2], moved, rtol=0, atol=1e-12 * abs(moved).max())
    np.testing.assert_allclose(found[2:], s * moved, rtol=0, atol=1e-12 * abs(s * moved).max())


@pytest.mark.parametrize("frequency", FREQUENCY)
def test_second_order_form_is_the_modal_sum(body, frequency):
    form, s = second_order(body_model(body, provenance=ORIGIN, step=2e-8)), 2j * np.pi * frequency
    M, D, K, B = (matrix.toarray() for matrix in (form.M, form.D, form.K, form.B))
    q = np.linalg.solve(s**2 * M + s * D + K, B)
    moved = _modal_sum(body, s)
    np.testing.assert_allclose(form.C @ q + s * (form.G @ q), [*moved, *(s * moved)], rtol=1e-12)


def test_residual_compliance_completes_the_static_one(body):
    form = state_space(body_model(body, provenance=ORIGIN, step=2e-8))
    elastic = body.port_shapes[1:].T / body.omega[1:] ** 2 @ body.port_shapes[1:]
    np.testing.assert_allclose(
        elastic + form.residual_feedthrough[:2], body.static_compliance, rtol=1e-12
    )
    assert not form.residual_feedthrough[2:].any()
    assert not form.D.any()


def test_pair_has_contact_forces_in_and_gaps_out(pair):
    form = state_space(pair)
    assert form.input_names == ("force", "total_force_tip", "total_force_head")
    assert form.output_names == ("lift", "velocity", "gap_tip", "gap_head")
    assert form.output_units == ("m", "m/s", "m", "m")
    s = 2j * np.pi * 2.3e3
    found = form.C @ np.linalg.solve(s * np.eye(len(form.A)) - form.A, form.B)
    needle, seat = _modal_sum(_rod(), s), _modal_sum(_rod("seat", "bottom"), s)[1, 1]
    scale = abs(needle).max()
    np.testing.assert_allclose(found[2:, 1:], needle + seat, rtol=0, atol=1e-12 * scale)
    mass = _rod().mass
    assert found[0, 0] == pytest.approx(1.0 / (mass * s**2), rel=1e-12)
    np.testing.assert_allclose(form.output_offset[2:], [1e-6, 2e-6], rtol=1e-12)
    rate = form.A @ form.start + form.constant_rate
    assert (form.C @ rate)[1] == pytest.approx(-5.0 / mass, rel=1e-12)
    assert (form.C @ rate)[0] == pytest.approx(-0.25, rel=1e-12)


def test_python_control_has_the_same_poles_and_response(body):
    pytest.importorskip("control")
    plant = to_control(body_model(body, provenance=ORIGIN, step=2e-8), residual_compliance=True)
    poles = plant.poles()
    omega = np.sort(abs(poles[poles.imag > 1.0]))
    np.testing.assert_allclose(omega, body.omega[1:], rtol=1e-10)
    response = plant(2j * np.pi * 3e3)
    expected = _modal_sum(body, 2j * np.pi * 3e3) + body.residual_compliance
    np.testing.assert_allclose(response[:2], expected, rtol=1e-10)
    assert plant.name == "rod"
    assert plant.input_labels == ["force_bottom", "force_top"]
    assert plant.output_labels[2] == "velocity_bottom"


def test_without_python_control_the_message_names_it(body, monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingExtraError, match=r"pip install control\."):
        to_control(body_model(body, provenance=ORIGIN, step=2e-8))
