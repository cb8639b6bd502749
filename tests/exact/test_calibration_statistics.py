"""Fit, covariance and profile of a linear model, where all of them are known in closed form."""

import numpy as np
import pytest
from scipy.stats import t as student

from klack.measurement.fitting import fit_within_bounds, follow_profiles
from klack.measurement.shot_covariance import (
    identifiability,
    identifiability_warnings,
    noise_covariance,
    shot_covariance,
    shot_estimates,
)

M, N = 200, 8  # samples, strokes
TRUE = np.array([0.4, 0.6, 0.55])


@pytest.fixture
def design():
    """Smooth sensitivities of three parameters, and weights that are not all the same."""
    x = np.linspace(0.0, 1.0, M)
    A = np.column_stack([np.sin(3.0 * x), x**2, np.exp(-2.0 * x)])
    return 50.0 * A, 1.0 + x


@pytest.fixture
def strokes(design):
    """Strokes whose parameters differ; each is exact for its own."""
    A, _ = design
    own = TRUE + 0.01 * np.random.default_rng(1).standard_normal((N, 3))
    return own, own @ A.T


def linear(A):
    return lambda vectors: [A @ z for z in vectors]


def test_each_stroke_alone_gives_its_own_parameters(design, strokes):
    A, w = design
    own, y = strokes
    assert shot_estimates(A, w, y - A @ TRUE) == pytest.approx(own - TRUE, rel=1e-9, abs=1e-12)


def test_covariance_is_that_of_the_mean_of_the_strokes(design, strokes):
    """Whatever the weights: the strokes are exact, so theta_s is exact (White 1980 in one line)."""
    A, w = design
    own, y = strokes
    found = shot_covariance(A, w, y - A @ own.mean(axis=0))

    assert found.covariance == pytest.approx(np.cov(own.T) / N, rel=1e-9)
    assert found.quantile == pytest.approx(student.ppf(0.975, N - 1), rel=1e-12)
    assert found.correlation == pytest.approx(np.corrcoef(own.T), rel=1e-9)


def test_correlated_residuals_do_not_fool_it(design):
    """Samples of one stroke share one deviation: s^2 (J^T J)^-1 would be 10 times too small."""
    A, w = design
    rng = np.random.default_rng(2)
    y = rng.standard_normal((4000, 1)) * A[:, :1].T  # scatter of the first parameter, sigma 1
    found = shot_covariance(A[:, :1], w, y)

    assert found.standard_error[0] * np.sqrt(4000) == pytest.approx(1.0, rel=0.04)  # 1/sqrt(2n)


def test_fit_of_the_mean_is_the_weighted_solution_in_closed_form(design, strokes):
    A, w = design
    rng = np.random.default_rng(3)
    data = strokes[1].mean(axis=0) + 0.3 * rng.standard_normal(M)
    exact = np.linalg.solve(A.T @ (w[:, None] * A), A.T @ (w * data))

    fit = fit_within_bounds(linear(A), data, w, np.full(3, 0.5))

    assert fit.converged
    assert fit.z == pytest.approx(exact, abs=1e-5)  # ends at a relative change of S of 1e-6
    assert fit.jacobian == pytest.approx(A, rel=1e-7, abs=1e-7)


def test_profile_of_a_linear_model_is_the_linear_interval(design, strokes):
    """Lambda is the parabola of the covariance of the strokes, not that of single samples."""
    A, w = design
    _, y = strokes
    fit = fit_within_bounds(linear(A), y.mean(axis=0), w, np.full(3, 0.5), tolerance=1e-12)
    covariance = shot_covariance(fit.jacobian, w, y - fit.model)

    for profile in follow_profiles(linear(A), y.mean(axis=0), w, fit, covariance, (0, 2)):
        i = profile.index
        half = covariance.quantile * covariance.standard_error[i]
        parabola = (profile.z - fit.z[i]) ** 2 / covariance.covariance[i, i]
        assert profile.excess == pytest.approx(parabola, rel=1e-4, abs=1e-4)
        assert profile.lower == pytest.approx(fit.z[i] - half, abs=1e-3 * half)
        assert profile.upper == pytest.approx(fit.z[i] + half, abs=1e-3 * half)


def test_profile_of_a_bent_model_is_one_sided(design, strokes):
    """For f(z^2), S_p is the parabola in z^2: the interval of z is its root, not symmetric."""
    A, w = design
    _, y = strokes
    y = y + 6.0 * np.random.default_rng(4).standard_normal((N, 1)) * A[:, 0] / 50.0
    data = y.mean(axis=0)

    def bent(vectors):
        return [A @ np.array([z[0] ** 2, z[1], z[2]]) for z in vectors]

    fit = fit_within_bounds(bent, data, w, np.full(3, 0.5), tolerance=1e-12)
    covariance = shot_covariance(fit.jacobian, w, y - fit.model)
    (profile,) = follow_profiles(bent, data, w, fit, covariance, (0,))

    half = covariance.quantile * covariance.standard_error[0] * 2.0 * fit.z[0]  # of z^2
    assert profile.upper == pytest.approx(np.sqrt(fit.z[0] ** 2 + half), rel=5e-3)  # interpolated
    assert profile.lower == pytest.approx(np.sqrt(fit.z[0] ** 2 - half), rel=5e-3)
    assert fit.z[0] - profile.lower > 1.02 * (profile.upper - fit.z[0])


def test_a_parameter_without_effect_has_no_error_but_infinity(design, strokes):
    A, w = design
    blind = np.column_stack([A[:, 0], np.zeros(M), A[:, 2]])
    found = shot_covariance(blind, w, strokes[1] - strokes[1].mean(axis=0))

    assert np.isinf(found.standard_error).tolist() == [False, True, False]
    notes = identifiability_warnings(
        ("a", "b", "c"), np.full(3, 0.5), identifiability(blind, w), found
    )
    assert [note for note in notes if "do not depend on 'b'" in note]


def test_twins_and_bounds_are_named(design, strokes):
    A, w = design
    twins = np.column_stack([A[:, 0], 2.0 * A[:, 0] + 1e-3 * A[:, 1], A[:, 2]])
    found = shot_covariance(twins, w, strokes[1] - strokes[1].mean(axis=0))
    notes = "\n".join(
        identifiability_warnings(
            ("a", "b", "c"), np.array([0.5, 0.5, 1.0]), identifiability(twins, w), found
        )
    )
    for words in (
        "'a' and 'b' are hard to separate (correlation -",
        "both change opposite ways",
        "do not determine 'a'",
        "'c' ended at its upper bound",
    ):
        assert words in notes


def test_single_stroke_counts_samples_that_move_together():
    """A running mean over 5 samples leaves as much information as a fifth of them."""
    rng = np.random.default_rng(5)
    runs, width, count = 300, 5, 4000
    A = np.sin(np.linspace(0.0, 3.0, count))[:, None]
    kernel = np.ones(width) / width
    noise = np.array(
        [
            np.convolve(rng.standard_normal(count + width - 1), kernel, mode="valid")
            for _ in range(runs)
        ]
    )
    flat = np.ones(count)
    true = np.std(shot_estimates(A, flat, noise), ddof=1)
    found = np.mean([noise_covariance(A, flat, r).standard_error[0] for r in noise])
    assert found == pytest.approx(true, rel=0.12)  # 300 records tell the true one to 4 %
