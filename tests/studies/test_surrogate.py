"""Surrogates; truth: polynomials, exact indices of Ishigami and G-function, brute-force refits."""

import sys

import numpy as np
import pytest

from klack.errors import MissingExtraError
from klack.studies.designs import Listed, Normal, Range, latin_hypercube, sobol_sequence
from klack.studies.sensitivity import saltelli_design, sobol_indices
from klack.studies.surrogate import fewest_points, fit_surrogate
from klack.studies.surrogate_chaos import ChaosFit
from klack.studies.surrogate_model import SurrogateAxis, share_estimates
from klack.studies.surrogate_process import ProcessFit

KINDS = ("polynomial-chaos", "gaussian-process")
LONG = [KINDS[0], pytest.param(KINDS[1], marks=pytest.mark.slow)]  # seconds of optimisation
COUNTS = {"polynomial-chaos": 128, "gaussian-process": 200}
SPREADS = {
    "range": Range(2.0, 5.0),
    "log": Range(1e-7, 1e-5, is_log=True),
    "normal": Normal(12.0, 0.5),
    "numbers": Listed((1.0, 2.0, 2.0, 8.0)),
    "words": Listed(("oil", "water", "fuel")),
}
UNIT = SurrogateAxis.of(Range(0.0, 1.0))
PI4 = np.pi**4


def ishigami(u):
    x = np.pi * (2 * u - 1)
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


ISHIGAMI = (np.array([0.3139, 0.4424, 0.0]), np.array([0.5576, 0.4424, 0.2437]))
SIZES = np.array([0.0, 1.0, 4.5, 9.0])


def g_function(u):
    return np.prod((np.abs(4 * u - 2) + SIZES) / (1 + SIZES), axis=1)


def exact_g_function():
    own = 1 / (3 * (1 + SIZES) ** 2)
    variance = np.prod(1 + own) - 1
    return own / variance, own * np.prod(1 + own) / (1 + own) / variance


def smooth(u):
    return np.exp(u[:, 0] - 0.5 * u[:, 1]) * np.sqrt(1 + u[:, 2])


def fitted(kind, function, parameters, count, seed=1):
    u = sobol_sequence(count, parameters, seed)
    return fit_surrogate(kind, [UNIT] * parameters, 2 * u - 1, function(u))


@pytest.mark.parametrize("name", SPREADS)
def test_functions_are_orthonormal_under_the_distribution(name):
    """Truth: means over a million values of the distribution itself."""
    spread = SPREADS[name]
    axis = SurrogateAxis.of(spread)
    shares = (np.arange(40_000) + 0.5) / 40_000
    t = axis.coordinate([spread.at(float(share)) for share in shares])
    functions = axis.functions(t, 3)
    assert np.allclose(functions[:, 0], 1.0)
    assert functions.shape[1] == {"numbers": 3, "words": 3}.get(name, 4)
    assert np.allclose(functions.T @ functions / len(t), np.eye(functions.shape[1]), atol=5e-3)
    some = spread.at(0.3)
    back = axis.value(float(axis.coordinate([some])[0]))
    assert back == some if name == "words" else back == pytest.approx(some)


def test_functions_of_a_normal_distribution_are_those_of_hermite():
    """Its cut at five standard deviations moves them by less than 0.1 %."""
    axis = SurrogateAxis.of(Normal(12.0, 0.5))
    z = np.linspace(-2.0, 2.0, 9)
    exact = np.column_stack((z**0, z, (z**2 - 1) / np.sqrt(2), (z**3 - 3 * z) / np.sqrt(6)))
    assert axis.functions(axis.coordinate(12.0 + 0.5 * z), 3) == pytest.approx(exact, abs=1e-3)


def test_a_polynomial_is_reproduced_exactly():
    """All kinds of parameters; its indices by hand: a + b t + c t s with orthonormal parts."""
    axes = [SurrogateAxis.of(spread) for spread in SPREADS.values()]
    cube = sobol_sequence(64, len(axes), 2)
    t = np.column_stack(
        [
            axis.coordinate([axis.spread.at(float(share)) for share in cube[:, k]])
            for k, axis in enumerate(axes)
        ]
    )

    def of(at):
        one, two, three, four, five = (axis.functions(at[:, k], 2) for k, axis in enumerate(axes))
        alone = 3.0 + 2.0 * one[:, 1] + three[:, 1] + two[:, 2]
        return alone + 0.5 * one[:, 1] * four[:, 1] + five[:, 2]

    found = fit_surrogate("polynomial-chaos", axes, t, of(t))
    assert found.predictivity == pytest.approx(1.0, abs=1e-12)
    assert found.largest < 1e-6
    elsewhere = t[::-1].copy()
    elsewhere[:, 0] *= 0.9
    assert found.model.predict(elsewhere) == pytest.approx(of(elsewhere), abs=1e-6)
    assert found.first.value == pytest.approx(np.array([4, 1, 1, 0, 1]) / 7.25, abs=1e-6)
    assert found.total.value == pytest.approx(np.array([4.25, 1, 1, 0.25, 1]) / 7.25, abs=1e-6)
    effect = found.model.main_effect(0, np.array([-1.0, 0.5]))
    assert effect == pytest.approx(3.0 + 2.0 * np.sqrt(3.0) * np.array([-1.0, 0.5]), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", LONG)
def test_indices_of_ishigami_are_within_the_stated_error(kind):
    found = fitted(kind, ishigami, 3, COUNTS[kind])
    assert found.reason == ""
    apart = {"polynomial-chaos": 0.003, "gaussian-process": 0.03}[kind]
    for estimates, exact in zip((found.first, found.total), ISHIGAMI, strict=True):
        assert np.all(estimates.low <= exact + 1e-4)
        assert np.all(exact - 1e-4 <= estimates.high)
        assert estimates.value == pytest.approx(exact, abs=apart)


@pytest.mark.slow
@pytest.mark.parametrize("kind", LONG)
def test_indices_of_the_g_function_are_within_the_stated_error(kind):
    """A function with kinks; as those of Saltelli's design with 30 times as many points."""
    found = fitted(kind, g_function, 4, COUNTS[kind])
    assert found.reason == ""
    sampled = sobol_indices(g_function(saltelli_design(4, 1024, 1)), 4)
    both = zip(
        (found.first, found.total), (sampled.first, sampled.total), exact_g_function(), strict=True
    )
    for estimates, other, exact in both:
        assert np.all((estimates.low <= exact) & (exact <= estimates.high))
        assert estimates.value == pytest.approx(exact, abs=0.05)
        assert other.value == pytest.approx(exact, abs=0.05)


@pytest.mark.parametrize("fit", [ChaosFit, ProcessFit])
def test_residuals_are_those_of_refits_without_the_point(fit):
    """Brute force: the same choice, fitted to all points but one, at that one."""
    u = latin_hypercube(40, 3, 4)
    t, y = 2 * u - 1, smooth(u)
    own = fit([UNIT] * 3, t)
    chosen = own.choose(y, np.arange(len(y)))
    refits = []
    for k in range(len(y)):
        others = np.delete(np.arange(len(y)), k)
        model = fit([UNIT] * 3, t[others]).model(y[others], chosen)
        refits.append(y[k] - model.predict(t[k : k + 1])[0])
    assert own.residuals(y, chosen) == pytest.approx(np.array(refits), rel=1e-5, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("fit", [ChaosFit, ProcessFit])
def test_stated_residuals_have_not_seen_the_point(fit):
    """A value that changes moves its own residual by as much, and no choice made for it."""
    kind = KINDS[[ChaosFit, ProcessFit].index(fit)]
    u = sobol_sequence(40, 3, 1)
    y = smooth(u)
    before = fit_surrogate(kind, [UNIT] * 3, 2 * u - 1, y).residuals
    y[7] += 0.02
    after = fit_surrogate(kind, [UNIT] * 3, 2 * u - 1, y).residuals
    assert after[7] - before[7] == pytest.approx(0.02, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", LONG)
@pytest.mark.parametrize(("function", "parameters"), [(smooth, 3), (g_function, 4)])
def test_fresh_points_are_predicted_as_well_as_stated(kind, function, parameters):
    found = fitted(kind, function, parameters, COUNTS[kind])
    u = sobol_sequence(1024, parameters, 9)
    apart = function(u) - found.model.predict(2 * u - 1)
    assert 0.1 < np.sqrt(np.mean(apart**2)) / found.error < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_noise_is_not_explained(kind):
    """The closed form with terms selected once claims 0.5 and more of it."""
    for parameters, count in ((3, 32), (10, 64)):
        noise = np.random.default_rng(3).standard_normal(count)
        t = 2 * sobol_sequence(count, parameters, 1) - 1
        found = fit_surrogate(kind, [UNIT] * parameters, t, noise)
        assert found.predictivity < 0.3
        assert "Q2" in found.reason
        assert found.model is None
        assert found.first is None


@pytest.mark.parametrize("kind", KINDS)
def test_one_parameter(kind):
    found = fitted(kind, lambda u: np.sin(5 * u[:, 0]), 1, 24)
    assert found.predictivity > 0.999
    assert found.first.value == pytest.approx(1.0, abs=1e-6)
    assert found.total.value == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_fifteen_parameters(kind):
    """Truth: shares of a sum, 1 / k^2 over their sum."""
    weights = 1.0 / np.arange(1.0, 16.0)
    found = fitted(kind, lambda u: u @ weights, 15, 64)
    assert found.predictivity > 0.999
    exact = weights**2 / np.sum(weights**2)
    assert found.first.value == pytest.approx(exact, abs=0.01)
    assert found.total.value == pytest.approx(exact, abs=0.01)


@pytest.mark.slow
def test_analytic_parts_of_a_process_are_those_of_its_values():
    """Truth: Sobol's estimators over many values of the same surrogate."""
    found = fitted("gaussian-process", smooth, 3, 64)
    design = saltelli_design(3, 4096, 3)
    sampled = sobol_indices(found.model.predict(2 * design - 1), 3)
    assert found.first.value == pytest.approx(sampled.first.value, abs=0.003)
    assert found.total.value == pytest.approx(sampled.total.value, abs=0.003)
    t = np.linspace(-1.0, 1.0, 5)
    u = sobol_sequence(2048, 3, 5)
    for k, at in enumerate(t):
        fixed = 2 * u - 1
        fixed[:, 1] = at
        mean = np.mean(found.model.predict(fixed))
        assert found.model.main_effect(1, t)[k] == pytest.approx(mean, abs=1e-3)


def test_a_process_is_that_of_scikit_learn():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    u = sobol_sequence(40, 2, 1)
    axes = [UNIT, UNIT]
    y = smooth(np.column_stack((u, u[:, 0])))
    fit = ProcessFit(axes, 2 * u - 1)
    chosen = fit.choose(y, np.arange(40))
    x, at = np.sqrt(12.0) * (u - 0.5), np.sqrt(12.0) * (u[:5] * 0.9 - 0.5)
    # a constant of unknown size is one with a large variance
    kernel = RBF(chosen.lengths) + WhiteKernel(chosen.noise) + ConstantKernel(1e3)
    other = GaussianProcessRegressor(kernel, alpha=0.0, optimizer=None).fit(x, y)
    own = fit.model(y, chosen).predict(2 * 0.9 * u[:5] - 1)
    assert own == pytest.approx(other.predict(at), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_failed_and_repeated_points_are_left_out_and_counted(kind):
    u = sobol_sequence(40, 2, 1)
    y = u[:, 0] + u[:, 1] ** 2
    alone = fit_surrogate(kind, [UNIT] * 2, 2 * u - 1, y)
    more = np.vstack((u, u[:3], [[0.5, 0.5], [0.1, 0.2]]))
    values = np.concatenate((y, y[:3], [np.nan, np.inf]))
    found = fit_surrogate(kind, [UNIT] * 2, 2 * more - 1, values)
    assert (found.points, found.failed, found.repeated) == (40, 2, 3)
    assert found.predictivity == alone.predictivity
    assert np.isnan(found.residuals[40:]).all()


def test_reasons_against_a_surrogate():
    t = 2 * sobol_sequence(64, 2, 1) - 1
    axes = [UNIT, UNIT]

    def reason(values, at=t):
        found = fit_surrogate("polynomial-chaos", axes, at, values)
        assert found.model is None
        return found.reason

    assert reason(np.full(64, 3.5)) == "the measure has the same value, 3.5, at all points"
    assert reason(np.zeros(64)) == "the measure has the same value, 0, at all points"
    assert reason(t[:19, 0], t[:19]).startswith("too few points: 19 different ones")
    assert reason(np.where(t[:, 0] > 0.7, np.nan, t[:, 0])).startswith("9 of 64 points have no")
    assert reason(np.full(64, np.nan)).startswith("64 of 64 points have no value")
    assert fewest_points([UNIT] * 15) == 32
    assert fewest_points([SurrogateAxis.of(SPREADS["words"])] * 10) == 42


def test_a_word_that_one_point_has_is_no_knowledge():
    """Its effect cannot be predicted from the other points."""
    axes = [UNIT, SurrogateAxis.of(Listed(("oil", "water")))]
    u = sobol_sequence(40, 1, 1)[:, 0]
    t = np.column_stack((2 * u - 1, np.arange(40) == 11))
    assert not fit_surrogate("polynomial-chaos", axes, t, u + 100.0 * t[:, 1]).predictivity > 0.9


@pytest.mark.parametrize("kind", KINDS)
def test_a_measure_that_differs_at_one_point_is_not_explained(kind):
    """Without that point all values are the same."""
    t = 2 * sobol_sequence(40, 2, 1) - 1
    found = fit_surrogate(kind, [UNIT] * 2, t, (np.arange(40) == 5) * 1.0)
    assert found.predictivity < 0.1
    assert "Q2" in found.reason


def test_no_error_is_no_interval():
    found = share_estimates(np.array([0.0, 0.3, 1.0]), 1.0, 0.0)
    assert found.low == pytest.approx(found.value)
    assert found.high == pytest.approx(found.value)


def test_scale_and_shift_of_a_measure_change_nothing():
    u = sobol_sequence(40, 2, 1)
    y = np.exp(u[:, 0]) + u[:, 1]
    one, other = (
        fit_surrogate("polynomial-chaos", [UNIT] * 2, 2 * u - 1, values)
        for values in (y, 3e-200 * y - 1e-199)
    )
    assert other.first.value == pytest.approx(one.first.value)
    assert other.error == pytest.approx(3e-200 * one.error, rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_without_the_library_there_is_one_clear_error(monkeypatch, kind):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    for name in [name for name in sys.modules if name.startswith("sklearn.")]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtraError, match=r"whl\[surrogate\]"):
        fitted(kind, smooth, 3, 32)
