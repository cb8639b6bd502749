"""Truth: potentials and Fourier integrals: what every contact law and every signal must obey."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from property_profiles import examples

from klack.acoustics.spectrum import impulse_spectrum
from klack.contact.laws import ElasticLaw, HertzLaw, LinearLaw, TableLaw, gonthier_coefficient
from klack.errors import InputError
from klack.signals import TimeSeries
from klack.simulation.contact_step import law_potential, solve_step


def log_range(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


DEPTHS = log_range(1e-15, 1e-2)
STIFFNESSES = log_range(1.0, 1e12)
EXPONENTS = st.sampled_from([1.0, 1.1, 1.5, 2.0, 3.0])


def law_of(kind: str, depth: float, stiffness: float, n: float) -> ElasticLaw:
    """A law of this secant stiffness at this depth."""
    if kind == "linear":
        return LinearLaw(stiffness)
    curved = stiffness * depth ** (1.0 - n)
    if kind == "hertz":
        return HertzLaw(curved, n)
    d = depth * np.linspace(0.0, 1.0, 12)[1:] ** 1.3
    return TableLaw(d, curved * d**n)


LAWS = st.tuples(st.sampled_from(["linear", "hertz", "table"]), DEPTHS, STIFFNESSES, EXPONENTS)


@examples(50)
@given(LAWS)
def test_force_is_the_slope_of_the_potential_and_never_falls(numbers):
    law, depth = law_of(*numbers), numbers[1]
    d = depth * np.linspace(-1.0, 3.0, 401)
    F, V = law.force(d), law.potential(d)

    assert np.all(F[d <= 0.0] == 0.0)
    assert np.all(V[d <= 0.0] == 0.0)
    assert np.all(np.diff(F) >= 0.0)
    assert np.all(np.diff(V) >= 0.0)
    work = np.diff(V) / np.diff(d)  # between the forces at both ends, since they rise
    slack = 1e-9 * F[1:]
    assert np.all(work >= F[:-1] - slack)
    assert np.all(work <= F[1:] + slack)


@examples(100)
@given(LAWS, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), log_range(1e-4, 1e4), st.floats(-1.0, 3.0))
# a table without curvature that is left on the first step: its first cubic seemed to go on
@example(("table", float(np.exp(-5.0)), 1.0, 1.0), 0.03125, 0.0, 1.0, 0.0)
def test_a_step_does_the_work_that_the_law_stores(numbers, before, free, yielding, guess):
    """The discrete gradient, whatever the size, the stiffness and the first guess."""
    law, (_, depth, stiffness, _) = law_of(*numbers), numbers
    flat = law.flat()
    G, d0, df = yielding / stiffness, before * depth, free * depth
    F, _, lost = solve_step(
        flat.kind, flat.parameters, 0, 0.0, G, d0, df, guess * stiffness * depth, 0
    )
    d1 = df - G * F
    stored = [law_potential(flat.kind, flat.parameters, 0, d) for d in (d0, d1)]

    assert F >= 0.0
    assert lost == 0.0
    # the larger potential sets the digits; F and d1 are left with those of the free motion; what
    # lies below the round-off of the first guess, 1e-16 of the depth, cannot be told
    scale = max(stored) + F * max(abs(d0), abs(df)) + 1e-22 * stiffness * depth**2
    assert F * (d1 - d0) == pytest.approx(stored[1] - stored[0], rel=0.0, abs=1e-10 * scale)


@examples(50)
@given(st.floats(1e-6, 1.0), st.floats(1e-6, 1.0))
def test_more_damping_for_less_restitution(one, other):
    low, high = sorted((one, other))
    assert gonthier_coefficient(low) >= gonthier_coefficient(high) >= 0.0


@examples(50)
@given(st.one_of(st.floats(max_value=0.0), st.just(float("nan"))))
def test_laws_refuse_what_is_no_stiffness(value):
    with pytest.raises(InputError):
        LinearLaw(value)
    with pytest.raises(InputError):
        HertzLaw(value)


@examples(30)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=60),
    log_range(1e-9, 1e-3),
    log_range(1e-6, 1e6),
    st.integers(0, 50),
)
def test_spectra_know_time_gain_and_energy(values, step, gain, later):
    """Parseval over all frequencies up to half the rate; a later start turns phases only."""
    values = np.concatenate([[0.0], values, np.zeros(2)])
    values[1] += 2.0  # never all zero

    def spectrum(x: np.ndarray, start: float = 0.0) -> np.ndarray:
        series = TimeSeries(step=step, values=x, unit="N", start=start, name="x")
        found = impulse_spectrum(series, resolution=1.0 / (128 * step), interval_means=False)
        points.append(round(1.0 / (found.resolution * step)))  # padded length
        return np.asarray(found.values)

    points: list[int] = []
    plain = np.abs(spectrum(values))
    scale = plain.max()
    count = points[0]
    whole = 2.0 * np.sum(plain**2) - plain[0] ** 2 - (0.0 if count % 2 else plain[-1] ** 2)
    assert whole / (count * step) == pytest.approx(np.sum(values**2) * step, rel=1e-9)
    np.testing.assert_allclose(
        np.abs(spectrum(gain * values)), gain * plain, atol=1e-9 * gain * scale
    )
    shifted = np.abs(spectrum(values, start=later * step))
    np.testing.assert_allclose(shifted, plain, atol=1e-9 * scale)
