"""Local optima by derivatives.

Truth: closed forms of quadratic problems, and published optima.
"""

import numpy as np
import pytest

from klack.studies.polish import NoValue, polish


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
