"""Consistent local law; truth: its definition, and Hertz where no mode is kept."""

import numpy as np
import pytest

from klack.contact.local_law import consistent_law
from klack.errors import AccuracyWarning, InputError
from klack.verification.contact import STEEL, half_spaces, parabola

RADIUS, WIDTH = 40e-3, 100e-6
STIFFNESS = 4.0 / 3.0 * STEEL.plane_strain_modulus / 2.0 * np.sqrt(RADIUS)
FORCE = STIFFNESS * (WIDTH**2 / RADIUS) ** 1.5


@pytest.fixture(scope="module")
def static():
    problem = half_spaces(
        parabola(RADIUS, 4 * WIDTH),
        contact=WIDTH,
        cells=(8, 6),
        reach=(1.5 * WIDTH) ** 2 / (2 * RADIUS),
    )
    return problem.solve(FORCE)


def test_modes_and_law_give_the_static_approach_back(static):
    modal = 0.5 * static.approach[-1] / static.force[-1]

    local = consistent_law(static, modal)

    at = static.force[static.force > local.resolved_force]
    assert len(at) > 10
    indentation = np.interp(at, local.force, local.force_indentation)
    np.testing.assert_allclose(
        indentation + at * modal, np.interp(at, static.force, static.approach), rtol=1e-12
    )
    np.testing.assert_allclose(local.law.force(indentation), at, rtol=1e-9)
    assert local.share[-1] == pytest.approx(0.5, rel=1e-12)


def test_without_modes_it_is_hertz_from_the_first_touch(static):
    """The ladder starts with a single hat (29 % too stiff here); the power law repairs that.

    Eight elements per half width; measured 0.4 % above 5 % of the force, 3 % at 0.1 %.
    """
    local = consistent_law(static, 0.0)

    d = WIDTH**2 / RADIUS * np.array([0.01, 0.03, 0.1, 0.2, 0.5, 0.9])
    np.testing.assert_allclose(local.law.force(d), STIFFNESS * d**1.5, rtol=0.04)
    np.testing.assert_allclose(local.law.force(d[3:]), STIFFNESS * d[3:] ** 1.5, rtol=0.005)
    assert local.exponent == pytest.approx(1.5, abs=0.05)
    assert 0 < local.resolved_force < 0.05 * FORCE


def test_law_is_monotone_with_potential(static):
    local = consistent_law(static, 0.4 * static.approach[-1] / static.force[-1])

    d = np.linspace(0, local.force_indentation[-1], 4001)
    force = local.law.force(d)
    work = np.sum((force[1:] + force[:-1]) / 2 * np.diff(d))

    assert np.all(np.diff(force) > 0)
    assert local.law.potential(d[-1]) == pytest.approx(work, rel=1e-5)  # trapezoids
    assert np.all(local.tangent_share > 0)
    assert local.max_force >= FORCE


def test_too_many_modes_are_refused_with_the_force(static):
    """The compliance of a growing contact falls: 1.05 times its final slope leaves nothing."""
    slope = np.diff(static.approach)[-1] / np.diff(static.force)[-1]

    with pytest.raises(InputError, match="keep fewer modes"):
        consistent_law(static, 1.05 * slope)


def test_a_small_rest_is_warned_of(static):
    slope = np.diff(static.approach)[-1] / np.diff(static.force)[-1]

    with pytest.warns(AccuracyWarning, match=r"left to the local law"):
        consistent_law(static, 0.9 * slope)
