"""Designs of points, and their evenness.

Designs of points; truth: their definitions, and points as computed by several SciPy versions.

Evenness of points; truth: its mean over random points is 1, exactly.
"""

import warnings
from hashlib import sha256

import numpy as np
import pytest
from scipy.stats import qmc

from klack.errors import InputError
from klack.studies.designs import balanced, even_levels, latin_hypercube, sobol_sequence, unevenness


def test_even_levels():
    assert even_levels(5).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert even_levels(4, bounded=False).tolist() == [0.125, 0.375, 0.625, 0.875]
    assert even_levels(1).tolist() == even_levels(1, bounded=False).tolist() == [0.5]


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_each_class_of_a_latin_hypercube_holds_one_point(count):
    points = latin_hypercube(count, 5, seed=3)

    classes = np.sort(np.floor(points * count).astype(int), axis=0)
    assert np.array_equal(classes, np.tile(np.arange(count)[:, None], 5))
    assert np.all((points > 0) & (points < 1))


@pytest.mark.parametrize("parameters", [1, 2, 8])
def test_sobol_points_are_balanced(parameters):
    """Of 2^m points, each of 2^m equal intervals of a parameter holds one."""
    points = sobol_sequence(256, parameters, seed=11)

    classes = np.sort(np.floor(points * 256).astype(int), axis=0)
    assert np.array_equal(classes, np.tile(np.arange(256)[:, None], parameters))


def test_two_sobol_parameters_fill_every_box():
    """A (0, m, 2)-net: each box of area 2^-m holds one point, whatever its sides."""
    points = sobol_sequence(64, 2, seed=4)

    for power in range(7):
        boxes = np.floor(points * [2**power, 2 ** (6 - power)]).astype(int)
        assert len({tuple(box) for box in boxes}) == 64


@pytest.mark.parametrize("count", [1, 2, 3, 64, 100, 1000, 1024])
def test_sobol_points_are_extended_exactly(count):
    assert np.array_equal(
        sobol_sequence(2 * count, 6, seed=5)[:count], sobol_sequence(count, 6, seed=5)
    )
    assert np.array_equal(sobol_sequence(4096, 6, seed=5)[:count], sobol_sequence(count, 6, seed=5))


def test_sobol_points_are_those_of_scipy_in_the_middle_of_their_class():
    engine = qmc.Sobol(4, scramble=True, **{_keyword(): np.random.default_rng(3)})

    assert np.array_equal(sobol_sequence(64, 4, seed=3), engine.random(64) + 2.0**-31)


def _keyword():
    """Name of the argument that this SciPy takes without a word."""
    for keyword in ("rng", "seed"):
        try:
            qmc.Sobol(1, **{keyword: np.random.default_rng(0)})
        except TypeError:
            continue
        return keyword
    raise AssertionError


def test_no_coordinate_is_a_bound():
    """The unscrambled sequence begins with 0, where a normal distribution has no value."""
    points = np.concatenate([sobol_sequence(4096, 3, seed) for seed in range(20)])

    assert points.min() >= 2.0**-31
    assert points.max() <= 1.0 - 2.0**-31


def test_an_unbalanced_number_of_points_is_told_by_the_predicate_alone():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sobol_sequence(1000, 3, seed=1).shape == (1000, 3)
    assert [n for n in range(-1, 20) if balanced(n)] == [1, 2, 4, 8, 16]


@pytest.mark.parametrize("design", [latin_hypercube, sobol_sequence])
def test_the_seed_decides(design):
    first = design(64, 3, seed=1)

    assert np.array_equal(first, design(64, 3, seed=1))
    assert not np.any(np.isin(first, design(64, 3, seed=2)))


@pytest.mark.parametrize(
    ("design", "digest"),
    [(sobol_sequence, "603ff54985b72a1e"), (latin_hypercube, "9729117b0bdcd709")],
)
def test_points_are_those_of_other_versions(design, digest):
    """Same bytes from SciPy 1.14.0, 1.15.0, 1.16.0 and 1.17.1 with NumPy 2.0.0 and 2.4.6."""
    assert sha256(design(1000, 4, seed=3).tobytes()).hexdigest()[:16] == digest


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: latin_hypercube(10**9, 2, 1), r"1e\+09 points"),
        (lambda: sobol_sequence(2, 30000, 1), "30000 columns"),
        (lambda: sobol_sequence(10**9, 1, 1), r"1e\+09 points"),
    ],
)
def test_what_is_no_design_is_one_error(call, said):
    with pytest.raises(InputError, match=said):
        call()


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
