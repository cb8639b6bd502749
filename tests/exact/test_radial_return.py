"""Von Mises plasticity point by point.

Truth: closed forms of simple shear, the derivative of the stress, and Drucker's inequality.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.hardening import Hardening
from klack.plasticity.radial_return import PlasticState, radial_return

G, Y = 80e9, 280e6


def _sheared(*shears, isotropic=0.0, kinematic=0.0):
    """Shear stress [Pa] after each engineering shear, and the last state."""
    hardening = Hardening(yield_stress=Y, isotropic=isotropic, kinematic=kinematic)
    state, stresses = PlasticState.none(1), []
    for shear in shears:
        strain = np.array([[0.0, 0.0, 0.0, shear / 2]])
        state = radial_return(strain, state, hardening, G).state
        stresses.append(2 * G * (shear / 2 - state.strain[0, 3]))
    return np.array(stresses), state


def test_shear_yields_at_the_yield_stress_over_root_three_and_hardens_on_a_line():
    """Exact: tau = Y/sqrt(3) + (H/3)(gamma - tau/G), whatever the steps."""
    H = 2e9
    one, state = _sheared(0.01, isotropic=H)
    many, _ = _sheared(*np.linspace(0, 0.01, 40), isotropic=H)

    tau = (Y / np.sqrt(3) + H / 3 * 0.01) / (1 + H / (3 * G))
    assert one[-1] == pytest.approx(tau, rel=1e-12)
    assert many[-1] == pytest.approx(tau, rel=1e-12)
    assert state.equivalent[0] == pytest.approx((0.01 - tau / G) / np.sqrt(3), rel=1e-12)


@pytest.mark.slow
def test_reversed_shear_yields_earlier_with_kinematic_hardening():
    """Exact: the elastic range is 2 tau of first yield (kinematic) or twice the last stress."""
    H, back = 20e9, np.linspace(0.01, -0.002, 4000)
    for name, width in (("kinematic", 2 * Y / np.sqrt(3)), ("isotropic", None)):
        stress, _ = _sheared(*back, **{name: H})
        slope = np.diff(stress) / np.diff(back)
        last_elastic = stress[1:][slope > 0.99 * G][-1]
        expected = stress[0] - (2 * stress[0] if width is None else width)
        assert last_elastic == pytest.approx(expected, abs=2 * G * 3e-6)


@pytest.mark.parametrize("kind", [{"isotropic": 3e9}, {"kinematic": 3e9}, {}])
def test_tangent_is_the_derivative_of_the_plastic_stress(kind):
    """Exact: central differences, 1e-6; the stiffness taken off is between none and all."""
    rng = np.random.default_rng(3)
    hardening = Hardening(yield_stress=Y, **kind)
    strain = rng.normal(size=(50, 4)) * 3e-3
    before = radial_return(0.7 * strain, PlasticState.none(50), hardening, G).state
    result = radial_return(strain, before, hardening, G)
    assert len(result.yielding) > 40

    step = 1e-8
    for component in range(4):
        change = np.zeros(4)
        change[component] = step / (2.0 if component == 3 else 1.0)  # engineering shear
        ends = [
            radial_return(strain + sign * change, before, hardening, G).state.strain
            for sign in (1.0, -1.0)
        ]
        slope = 2 * G * (ends[0] - ends[1])[result.yielding] / (2 * step)
        assert slope == pytest.approx(result.taken[:, :, component], abs=1e-6 * G)
    elastic = 2 * G * np.diag([1.0, 1.0, 1.0, 0.5])
    elastic[:3, :3] -= 2 * G / 3
    assert np.linalg.eigvalsh(result.taken).min() > -1e-6 * G
    assert np.linalg.eigvalsh(elastic - result.taken).min() > -1e-6 * G


def test_plastic_work_is_never_negative():
    """Conservation: along random paths, and plastic strain keeps the volume."""
    rng = np.random.default_rng(5)
    hardening = Hardening(yield_stress=Y, isotropic=1e9, kinematic=1e9)
    state, strain = PlasticState.none(200), np.zeros((200, 4))
    for _ in range(60):
        strain = strain + rng.normal(size=strain.shape) * 5e-4
        result = radial_return(strain, state, hardening, G)
        assert result.work.min() >= 0.0
        assert np.all(result.state.equivalent >= state.equivalent)
        state = result.state
    assert np.abs(state.strain[:, :3].sum(axis=1)).max() < 1e-15


@pytest.mark.parametrize(
    ("given", "message"),
    [({"yield_stress": 0.0}, "yield stress"), ({"isotropic": -1.0}, "isotropic hardening")],
)
def test_what_no_metal_does_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        Hardening(**({"yield_stress": Y} | given))
