"""Truth: closed formulas of the laws, and calculus (potential = integral, slope = derivative)."""

from itertools import pairwise

import numpy as np
import pytest
from draws import each

from klack.contact.laws import (
    HertzLaw,
    HuntCrossley,
    LinearLaw,
    TableLaw,
    gonthier_coefficient,
)
from klack.simulation.contact_step import law_potential, mean_force, solve_step

HERTZ = 7.5e9  # [N/m^1.5]
DEPTH = np.array([2e-7, 5e-7, 1e-6, 1.8e-6, 3e-6, 4e-6])  # [m]
LAWS = [
    LinearLaw(1e9),
    HertzLaw(HERTZ),
    HertzLaw(3e8, exponent=1.2),
    TableLaw(DEPTH, HERTZ * DEPTH**1.5),
    TableLaw([1e-6], [50.0]),
]
IDS = ["linear", "hertz", "power", "table", "one point"]
PAIRS = [  # [m] from, to: open, onset, release, inside, tiny, across points, beyond the last point
    (-2e-7, -1e-7),
    (-1e-8, 3e-8),
    (4e-8, -5e-9),
    (9.1e-7, 9.4e-7),
    (1e-6, 1e-6 + 1e-13),
    (2.5e-6, 3.7e-7),
    (-1e-7, 4.4e-6),
    (4.2e-6, 6e-6),
    (1.3e-6, 1.3e-6),
]


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_potential_is_the_integral_of_the_force(law):
    x, weights = np.polynomial.legendre.leggauss(20)
    points = np.concatenate(([0.0], DEPTH, [6e-6]))
    work = 0.0
    for a, b in pairwise(points):
        work += 0.5 * (b - a) * weights @ law.force(0.5 * (a + b) + 0.5 * (b - a) * x)
        # Gauss is exact for the cubics; 1e-7 for the root at the origin of the power laws
        assert float(law.potential(b)) == pytest.approx(work, rel=3e-7)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_tangent_is_the_derivative_of_the_force(law):
    d, step = np.array([1.1e-7, 7.3e-7, 1.5e-6, 3.7e-6, 5e-6]), 1e-11
    slope = (law.force(d + step) - law.force(d - step)) / (2.0 * step)

    np.testing.assert_allclose(law.tangent_stiffness(d), slope, rtol=1e-6)  # second difference


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_law_is_zero_when_open_and_rises_when_closed(law):
    d = np.linspace(-1e-6, 6e-6, 500)
    force = law.force(d)

    assert np.all(force[d <= 0.0] == 0.0)
    assert np.all(np.diff(force[d >= 0.0]) > 0.0)
    assert np.all(law.potential(d[d <= 0.0]) == 0.0)


def test_table_meets_its_points_and_goes_on_straight():
    law = TableLaw(DEPTH, HERTZ * DEPTH**1.5)

    np.testing.assert_allclose(law.force(DEPTH), HERTZ * DEPTH**1.5, rtol=1e-15)
    assert np.ptp(law.tangent_stiffness(np.linspace(4e-6, 9e-6, 9))) == 0.0
    assert float(law.tangent_stiffness(5e-6)) > 0.0


def test_softening_table_still_rises_beyond_its_end():
    law = TableLaw([1e-6, 2e-6, 3e-6], [100.0, 199.0, 200.0])

    assert float(law.force(5e-6)) > float(law.force(4e-6)) > 200.0


@each("pair", PAIRS)
@each("law", LAWS)
def test_kernel_mean_force_is_the_discrete_gradient(law, pair):
    d0, d1 = pair
    flat = law.flat()

    mean, slope, _ = mean_force(flat.kind, flat.parameters, 0, d0, d1, 0)

    if abs(d1 - d0) > 1e-12:
        expected = float(law.potential(d1) - law.potential(d0)) / (d1 - d0)
    else:
        expected = float(law.force(0.5 * (d0 + d1)))
    assert mean == pytest.approx(expected, rel=1e-9, abs=1e-12)  # the difference of V loses digits
    step = 1e-11
    up, down = (mean_force(flat.kind, flat.parameters, 0, d0, d1 + s, 0)[0] for s in (step, -step))
    assert slope == pytest.approx((up - down) / (2.0 * step), rel=2e-3, abs=1e3)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_kernel_potential_is_the_law_potential(law):
    flat = law.flat()
    for d in (-1e-7, 1e-8, 1.2e-6, 5e-6):
        ours = law_potential(flat.kind, flat.parameters, 0, d)
        assert ours == pytest.approx(float(law.potential(d)), rel=1e-13)


@each("G", [1e-14, 1e-11, 1e-8])  # [m/N], soft against the step and stiff
@each("pair", PAIRS[1:])
@each("law", LAWS)
def test_kernel_step_satisfies_its_equation(law, pair, G):
    d0, d_free = pair
    flat = law.flat()

    force, _, lost = solve_step(flat.kind, flat.parameters, 0, 0.0, G, d0, d_free, 0.0, 0)
    d1 = d_free - G * force
    mean, _, _ = mean_force(flat.kind, flat.parameters, 0, d0, d1, 0)

    assert lost == 0.0
    # residual of a force where G k is small, of an indentation where it is large
    assert abs(force - mean) <= 1e-8 + 1e-10 * force or abs(G * (force - mean)) <= 1e-16


@pytest.mark.parametrize("e", np.linspace(0.05, 0.99, 9))
def test_gonthier_coefficient_solves_its_equation(e):
    D = e * gonthier_coefficient(e)

    # at e = 0.05 the root is 1 - 1.6e-8, which costs eight digits
    assert np.log1p(D / e) - np.log1p(-D) == pytest.approx(D * (1.0 + 1.0 / e), rel=1e-9)


def test_hunt_crossley_is_elastic_at_rest():
    law = HuntCrossley(LAWS[3], 0.4)

    np.testing.assert_array_equal(law.force(DEPTH), LAWS[3].force(DEPTH))
    assert law.flat().dissipation == 0.4
