"""Evenness of points; truth: its mean over random points is 1, exactly."""

import numpy as np
import pytest

from klack.studies.designs import sobol_sequence, unevenness


@pytest.mark.parametrize(("count", "parameters"), [(20, 1), (30, 3), (64, 6)])
def test_random_points_have_one_on_average(count, parameters):
    random = np.random.default_rng(1)
    found = [unevenness(random.random((count, parameters))) for _ in range(400)]
    assert np.mean(found) == pytest.approx(1.0, abs=4 * np.std(found) / 20)


def test_even_points_have_less_and_clusters_more():
    even = sobol_sequence(64, 3, 1)
    assert unevenness(even) < 0.2
    assert unevenness(even * np.array([0.5, 1.0, 1.0])) > 4
    star = np.full((30, 3), 0.5)
    star[np.arange(30), np.arange(30) % 3] = np.linspace(0.0, 1.0, 30)
    assert unevenness(star) > 4
