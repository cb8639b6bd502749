"""Screening of parameters; truth: a linear function, closed moments, the function of Morris (1991).

Its inputs are numbered from 1 in the paper: 1 to 10 matter, 8 to 10 of them linearly, 1 to 7 with
curvature or interactions, 11 to 20 hardly.
"""

from hashlib import sha256
from itertools import combinations

import numpy as np
import pytest
from draws import each

from klack.studies.sensitivity import elementary_effects, morris_design

LINEAR, CURVED, SMALL = slice(7, 10), slice(0, 7), slice(10, 20)


def morris_function(x, seed):
    """Test function of Morris (1991), section 5; its small coefficients are standard normal."""
    random = np.random.default_rng(seed)
    w = 2 * (x - 0.5)
    for column in (2, 4, 6):
        w[:, column] = 2 * (1.1 * x[:, column] / (x[:, column] + 0.1) - 0.5)
    single = random.standard_normal(20)
    single[:10] = 20.0
    double = np.triu(random.standard_normal((20, 20)), 1)
    double[:6, :6] = np.triu(np.full((6, 6), -15.0), 1)
    y = random.standard_normal() + w @ single + np.einsum("ni,ij,nj->n", w, double, w)
    for three in combinations(range(5), 3):
        y -= 10.0 * np.prod(w[:, three], axis=1)
    for four in combinations(range(4), 4):
        y += 5.0 * np.prod(w[:, four], axis=1)
    return y


@pytest.mark.slow
@each("seed", range(5))
def test_groups_of_the_function_of_morris_are_found(seed):
    points = morris_design(20, 10, seed)
    found = elementary_effects(points, morris_function(points, seed))

    assert points.shape == (210, 20)
    assert found.mean_size[:10].min() > 1.5 * found.mean_size[SMALL].max()
    # 2 dw/dx = 2 times the coefficient 20, and small interactions that cancel
    error = np.abs(found.mean[LINEAR] - 40.0)
    assert np.all(error < 4.0 * found.scatter[LINEAR] / np.sqrt(10))
    assert np.all(found.scatter[LINEAR] < 0.3 * found.mean_size[LINEAR])
    # for each of 1 to 7 sigma is of the size of mu*: nonlinear or interacting
    assert np.all(found.scatter[CURVED] > 0.3 * found.mean_size[CURVED])


@pytest.mark.parametrize("bounded", [True, False])
def test_a_linear_function_is_exact(bounded):
    slopes = np.array([3.0, -2.0, 0.0, 1e-3, 500.0])
    points = morris_design(5, 8, seed=1, bounded=bounded)
    found = elementary_effects(points, 7.0 + points @ slopes)

    assert found.mean == pytest.approx(slopes, rel=1e-9, abs=1e-11)
    assert found.mean_size == pytest.approx(np.abs(slopes), rel=1e-9, abs=1e-11)
    assert np.all(found.scatter < 1e-11)
    assert np.all(found.mean_size_error < 1e-11)
    assert found.effects.tolist() == [8] * 5


@pytest.mark.slow
def test_moments_of_an_interaction_are_those_of_its_levels():
    """The effect of a on a * b is b, which takes the levels 0, 1/3, 2/3, 1 alike.

    Its mean is 1/2, its variance (1/4 + 1/36) / 2 = 5/36.
    """
    points = morris_design(2, 4000, seed=2)
    found = elementary_effects(points, points[:, 0] * points[:, 1])

    assert np.all(np.abs(found.mean - 0.5) < 4 * found.mean_size_error)
    assert found.scatter == pytest.approx(np.sqrt(5 / 36), rel=0.02)


def test_moments_of_three_effects_by_hand():
    """Effects -1, 2, 5 of one parameter."""
    points = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.5])[:, None]
    found = elementary_effects(points, [3.0, 2.0, 0.0, -2.0, 0.0, 2.5])

    assert found.mean == pytest.approx([2.0], rel=1e-12)
    assert found.mean_size == pytest.approx([8 / 3], rel=1e-12)
    assert found.scatter == pytest.approx([3.0], rel=1e-12)
    sizes = np.array([1.0, 2.0, 5.0]) - 8 / 3
    assert found.mean_size_error == pytest.approx([np.sqrt(np.sum(sizes**2) / 2 / 3)], rel=1e-12)


def test_effects_of_both_signs_cancel_in_mu_and_not_in_mu_star():
    """(x - 1/2)^2 on the middles of classes: the effect of a jump is odd in the jump's middle."""
    points = morris_design(1, 2000, seed=1, bounded=False)
    found = elementary_effects(points, (points[:, 0] - 0.5) ** 2)

    # jumps 1/8 -> 5/8 and 3/8 -> 7/8: effects -1/4 and +1/4
    assert np.abs(found.mean[0]) < 4 * found.scatter[0] / np.sqrt(2000)
    assert found.mean_size[0] == pytest.approx(0.25, rel=1e-12)
    assert found.mean_size_error[0] < 1e-12
    assert found.scatter[0] == pytest.approx(0.25, rel=1e-3)


@pytest.mark.slow
def test_standard_errors_are_the_scatter_of_repeated_screenings():
    def screened(seed):
        points = morris_design(3, 20, seed)
        return elementary_effects(
            points, np.exp(points[:, 0]) * (points[:, 1] - 0.3) * points[:, 2]
        )

    many = [screened(seed) for seed in range(400)]
    seen = np.std([one.mean_size for one in many], axis=0)
    claimed = np.sqrt(np.mean([one.mean_size_error**2 for one in many], axis=0))
    assert claimed == pytest.approx(seen, rel=0.2)


def test_each_trajectory_changes_each_parameter_once_by_the_jump():
    paths = morris_design(6, 50, seed=3).reshape(50, 7, 6)
    steps = np.diff(paths, axis=1)

    assert np.all(np.sum(steps != 0, axis=1) == 1)
    assert np.all(np.sum(steps != 0, axis=2) == 1)
    assert np.abs(steps[steps != 0]) == pytest.approx(2 / 3, rel=1e-12)
    assert np.all(np.isin(paths, np.arange(4) / 3))


def test_all_levels_orders_and_signs_are_equally_likely():
    paths = morris_design(4, 4000, seed=5).reshape(4000, 5, 4)
    steps = np.diff(paths, axis=1)
    expected = 4000 / 4
    margin = 5 * np.sqrt(expected)

    for column in range(4):
        levels = np.unique(paths[:, 0, column], return_counts=True)[1]
        places = np.bincount(np.argmax(steps[:, :, column] != 0, axis=1))
        assert np.all(np.abs(levels - expected) < margin)
        assert np.all(np.abs(places - expected) < margin)
        assert abs(np.sum(steps[:, :, column] > 0) - 2000) < margin


def test_a_parameter_without_ends_never_stands_at_one():
    points = morris_design(3, 30, seed=1, bounded=[True, False, True])

    assert set(np.unique(points[:, 1])) == {0.125, 0.375, 0.625, 0.875}
    assert points[:, 0].min() == 0.0
    assert points[:, 2].max() == 1.0


def test_design_is_extended_exactly_and_the_seed_decides():
    assert np.array_equal(morris_design(5, 20, 1)[:60], morris_design(5, 10, 1))
    assert not np.array_equal(morris_design(5, 10, 1), morris_design(5, 10, 2))


def test_points_are_those_of_other_versions():
    """Same bytes from NumPy 2.0.0 and 2.4.6."""
    points = morris_design(6, 10, seed=3)

    assert sha256(points.tobytes()).hexdigest()[:16] == "7c309c13f4036991"


@pytest.mark.parametrize("failure", [np.nan, np.inf])
def test_a_failed_point_takes_away_the_effects_next_to_it_and_no_other(failure):
    points = morris_design(4, 6, seed=1)
    values = np.sin(5 * points).sum(axis=1) + points[:, 0] * points[:, 1]
    whole = elementary_effects(points, values)
    some = values.copy()
    some[7] = failure  # third point of the second trajectory
    found = elementary_effects(points, some)
    steps = np.diff(points[5:10], axis=0)
    hit = {int(np.flatnonzero(steps[row])[0]) for row in (1, 2)}

    assert len(hit) == 2
    for column in range(4):
        assert found.effects[column] == 6 - (column in hit)
        assert (found.mean_size[column] == whole.mean_size[column]) == (column not in hit)
    slope = elementary_effects(points, np.where(np.isfinite(some), points @ [1, 2, 3, 4], failure))
    assert slope.mean == pytest.approx([1, 2, 3, 4], rel=1e-12)


def test_fewer_than_two_effects_say_so():
    points = morris_design(2, 2, seed=1)
    values = points @ [1.0, 2.0]
    values[0] = np.nan
    found = elementary_effects(points, values)
    first = int(np.flatnonzero(points[1] != points[0])[0])

    assert found.effects[first] == 1
    assert np.isnan(found.mean_size[first])
    assert found.mean[1 - first] == pytest.approx([1.0, 2.0][1 - first], rel=1e-12)
    nothing = elementary_effects(points, np.full(6, np.nan))
    assert nothing.effects.tolist() == [0, 0]


def test_a_constant_measure_has_no_effects():
    points = morris_design(3, 5, seed=1)
    found = elementary_effects(points, np.full(20, 4.0))

    assert found.mean_size.tolist() == found.scatter.tolist() == [0.0] * 3


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_effects_have_the_unit_of_the_measure(scale):
    points = morris_design(3, 10, seed=1)
    values = np.exp(points).sum(axis=1)
    plain, scaled = (elementary_effects(points, v) for v in (values, scale * values))

    assert scaled.scatter / scale == pytest.approx(plain.scatter, rel=1e-9)
    assert scaled.mean_size_error / scale == pytest.approx(plain.mean_size_error, rel=1e-9)
