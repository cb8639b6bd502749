"""Local refinement and local optima by derivatives.

Local refinement; the truth is optima known in closed form.

Local optima by derivatives.

Truth: closed forms of quadratic problems, and published optima.
"""

import warnings

import numpy as np
import pytest

from klack.studies.polish import NoValue, polish
from klack.studies.refinement import Refinement, RefinementSettings, Secants, achievement


def rosenbrock(x):
    z = 4.0 * x - 2.0
    return (100.0 * (z[:, 1:] - z[:, :-1] ** 2) ** 2 + (1.0 - z[:, :-1]) ** 2).sum(axis=1)[:, None]


def two_spheres(x):
    """The front is the straight line between the centres 0.3 and 0.7."""
    return np.column_stack((((x - 0.3) ** 2).sum(axis=1), ((x - 0.7) ** 2).sum(axis=1)))


def refine(values, start, limits=lambda x: np.zeros((len(x), 1)), settings=None, **more):
    """The refinement at its end, and all points evaluated."""
    start = np.asarray(start, dtype=float)
    goals = values(start)
    settings = settings or RefinementSettings(first_step=0.1)
    more = {"scales": np.ones(goals.shape[1])} | more
    refinement = Refinement(settings, start, goals, limits(start), **more)
    seen = []
    for points in refinement:
        seen.append(points)
        refinement.tell(values(points), limits(points))
    return refinement, np.concatenate(seen)


def test_achievement_by_hand():
    goals = [[3.0, 10.0], [1.0, 30.0], [np.nan, 1.0]]
    found = achievement(goals, [1.0, 10.0], [2.0, 40.0])
    assert found[:2] == pytest.approx([1.001, 0.5005], rel=1e-12)
    assert np.isnan(found[2])
    assert achievement([[5.0]], [3.0], [2.0]) == pytest.approx([1.001], rel=1e-12)


def test_a_quadratic_needs_one_poll_and_one_batch_more():
    centre = np.linspace(0.3, 0.6, 8)
    weights = np.arange(1.0, 9.0)
    refinement, seen = refine(lambda x: ((x - centre) ** 2 @ weights)[:, None], [[0.45] * 8])
    assert refinement.points[0] == pytest.approx(centre, abs=1e-12)
    assert np.abs(seen[:32] - centre).max(axis=1).min() < 1e-12


@pytest.mark.parametrize(("parameters", "evaluations"), [(2, 700), (4, 1500)])
def test_the_curved_valley_is_followed_to_its_end(parameters, evaluations):
    settings = RefinementSettings(first_step=0.1, evaluations=evaluations)
    start = np.where(np.arange(parameters) % 2, 0.55, 0.4)[None]
    refinement, seen = refine(rosenbrock, start, settings=settings)
    assert rosenbrock(refinement.points)[0, 0] < 1e-6
    assert refinement.points[0] == pytest.approx(0.75, abs=1e-3)
    assert len(seen) <= evaluations


def test_a_corner_of_the_cube_is_reached():
    refinement, seen = refine(lambda x: np.abs(x - 1.0).sum(axis=1)[:, None], [[0.4, 0.7, 0.5]])
    assert refinement.points.tolist() == [[np.nextafter(1.0, 0.0)] * 3]
    assert np.all((seen >= 0.0) & (seen < 1.0))
    inside = RefinementSettings(edge=0.01)
    refinement, seen = refine(lambda x: x.sum(axis=1)[:, None], [[0.1, 0.2]], settings=inside)
    assert refinement.points.tolist() == [[0.01, 0.01]]


def test_several_points_improve_in_every_objective_to_the_front():
    start = np.random.default_rng(3).uniform(0.3, 0.7, (5, 4))
    refinement, _ = refine(two_spheres, start)
    before, after = two_spheres(start), two_spheres(refinement.points)
    assert np.all(after <= before + 1e-3 * np.abs(after - before).sum())
    assert np.all(np.any(after < before, axis=1))
    # on the front sqrt(f1) + sqrt(f2) is the distance of the centres
    assert np.sqrt(after).sum(axis=1) == pytest.approx(np.sqrt(4 * 0.16), rel=2e-3)


def test_constraints_are_reached_and_kept():
    def limits(x):
        return np.column_stack((0.5 - x[:, 0], 0.2 - x[:, 1]))

    refinement, _ = refine(lambda x: x.sum(axis=1)[:, None], [[0.1, 0.05, 0.3]], limits)
    assert np.all(limits(refinement.points) <= 0.0)
    assert refinement.points[0].sum() == pytest.approx(0.7, abs=2e-3)


def test_failed_points_are_never_chosen():
    def values(x):
        goals = np.repeat(((x - 0.5) ** 2).sum(axis=1)[:, None], 2, axis=1)
        goals[x[:, 0] < 0.6] = np.nan
        goals[x[:, 1] > 0.82] = -np.inf, np.inf
        return goals

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refinement, seen = refine(values, [[0.8, 0.8, 0.4], [0.61, 0.2, 0.9]])
    assert np.isnan(values(seen)).any()
    assert np.isinf(values(seen)).any()
    assert values(refinement.points)[:, 0] == pytest.approx(0.01, abs=1e-3)
    assert np.all(refinement.points[:, 0] >= 0.6)


@pytest.mark.parametrize("huge", [1e160, 1e300, np.finfo(float).max])
@pytest.mark.parametrize("both", [False, True])
def test_huge_objectives_are_never_chosen(huge, both):
    def values(x):
        goals = two_spheres(x)
        goals[x[:, 0] > 0.62] = huge, huge if both else -huge
        goals[x[:, 1] > 0.57] = huge
        return goals

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refinement, seen = refine(values, [[0.6, 0.55, 0.5]], scales=[0.1, 0.1])
    assert (seen[:, 0] > 0.62).any()
    assert refinement.points[0, 0] <= 0.62


def test_where_all_fails_the_start_stays():
    start = [[0.8, 0.8]]
    refinement = Refinement(RefinementSettings(), start, [[2.0, 3.0]], scales=[1.0, 1.0])
    for points in refinement:
        refinement.tell(np.full((len(points), 2), np.nan))
    assert refinement.points.tolist() == start


def test_nothing_beyond_the_budget_is_evaluated():
    for evaluations in (1, 7, 8, 100):
        settings = RefinementSettings(evaluations=evaluations)
        refinement = Refinement(settings, [[0.3] * 4], [[1.0]], scales=[1.0])
        count = 0
        for points in refinement:
            count += len(points)
            refinement.tell(rosenbrock(points))
        assert count <= evaluations
        assert (count == 0) == (evaluations < 8)


def test_a_refinement_told_stored_values_asks_for_the_same_points():
    start = np.random.default_rng(5).uniform(0.3, 0.7, (3, 4))
    first, seen = refine(two_spheres, start)
    store = {point.tobytes(): two_spheres(point[None])[0] for point in seen}
    again = Refinement(RefinementSettings(first_step=0.1), start, two_spheres(start), scales=[1, 1])
    asked = 0
    for points in again:
        assert np.array_equal(points, seen[asked : asked + len(points)])
        asked += len(points)
        again.tell([store[point.tobytes()] for point in points])
    assert asked == len(seen)
    assert np.array_equal(again.points, first.points)


def test_secants_of_a_quadratic_are_its_inverse():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(4, 4))
    second = root @ root.T + np.eye(4)
    lowest, point = rng.normal(size=4), rng.normal(size=4)
    secants = Secants()
    assert secants.descent(point, second @ (point - lowest)).tolist() == [0.0] * 4
    for _ in range(60):  # without line search BFGS still converges here
        slope = second @ (point - lowest)
        step = secants.descent(point, slope)
        point = point + (step if np.any(step) else -0.01 * slope)
    assert point == pytest.approx(lowest, abs=1e-9)


class Seen:
    """Functions of a point with their derivatives; keeps the points."""

    def __init__(self, values, slopes):
        self._values, self._slopes = values, slopes
        self.points, self.steps = [], 0

    def values(self, x):
        self.points.append(x)
        objectives, constraints = self._values(x)
        return np.array(objectives, dtype=float), np.array(constraints, dtype=float)

    def slopes(self, x):
        self.steps += 1
        objectives, constraints = self._slopes(x)
        shape = (-1, x.size)
        return np.reshape(objectives, shape), np.reshape(constraints, shape).astype(float)

    def run(self, start, **given):
        polish(start, self.values, self.slopes, **({"steps": 50, "scales": [1.0]} | given))
        return self.points[-1]


def test_a_quadratic_bowl_ends_at_its_lowest_point():
    lowest = np.array([0.3, 0.8])
    weights = np.array([1.0, 30.0])
    bowl = Seen(
        lambda x: ([np.sum(weights * (x - lowest) ** 2)], []),
        lambda x: ([2.0 * weights * (x - lowest)], []),
    )
    np.testing.assert_allclose(bowl.run([0.9, 0.1]), lowest, atol=1e-3)
    assert bowl.steps < 15


def test_a_bound_is_reached_and_kept():
    """Least x + y with x y >= 1/8: both are sqrt(1/8)."""
    found = Seen(
        lambda x: ([x.sum()], [0.125 - x[0] * x[1]]),
        lambda x: ([[1.0, 1.0]], [[-x[1], -x[0]]]),
    )
    end = found.run([0.9, 0.6])
    np.testing.assert_allclose(end, np.sqrt(0.125), rtol=1e-3)
    assert end[0] * end[1] >= 0.125 - 1e-6


def test_a_start_that_misses_a_bound_comes_back():
    """Farthest point of a circle of radius 1/2 along x, at a height of 0.3 or more: (0.4, 0.3)."""
    found = Seen(
        lambda x: ([-x[0]], [x @ x - 0.25, 0.3 - x[1]]),
        lambda x: ([[-1.0, 0.0]], [2.0 * x, [0.0, -1.0]]),
    )
    np.testing.assert_allclose(found.run([0.9, 0.05]), [0.4, 0.3], atol=1e-4)


def test_two_objectives_end_on_their_front_and_none_gets_worse():
    """The front of two distances is the line between the points."""
    ends = np.array([[0.2, 0.2], [0.8, 0.6]])
    found = Seen(
        lambda x: ([((x - end) ** 2).sum() for end in ends], []),
        lambda x: (2.0 * (x - ends), []),
    )
    start = np.array([0.3, 0.9])
    last = found.run(start, scales=[0.5, 0.5])
    way, own = ends[1] - ends[0], last - ends[0]
    assert abs(way[0] * own[1] - way[1] * own[0]) / np.linalg.norm(way) < 2e-3
    for end in ends:
        assert ((last - end) ** 2).sum() < ((start - end) ** 2).sum()


def test_points_keep_to_the_cube_and_from_its_ends():
    found = Seen(lambda x: ([x.sum()], []), lambda x: ([np.ones(2)], []))
    np.testing.assert_allclose(found.run([0.4, 1.0], edge=0.01), 0.01)
    assert np.min(found.points) >= 0.01
    assert np.max(found.points) <= 0.99


@pytest.mark.parametrize("of", ["values", "slopes"])
def test_a_point_without_a_value_ends_it(of):
    def fails(x):
        if x[0] < 0.5:
            raise NoValue
        return [x[0]], []

    found = Seen(
        fails if of == "values" else lambda x: ([x[0]], []),
        fails if of == "slopes" else lambda x: ([[1.0]], []),
    )
    found.run([0.9])
    assert 1 <= len(found.points) <= 3
