"""Hidden values must come out, within their interval, as often as the interval says.

A rigid valve of three components; truth is its own model, see ``rigid_valve``.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigid_valve import NO_PROFILE, SCATTER, TEXT, TRUTH, measured, tree_of

from klack.analyses.calibration.run import _repeatable, calibrated_text, run_calibration
from klack.measurement.fit_window import FitWindow
from klack.measurement.stroke_measures import MeasuredStroke

pytestmark = pytest.mark.slow


def calibrate(strokes, text=TEXT, **options):
    return run_calibration(tree_of(text), strokes, workers=1, **options)


SEEDS = range(7)


@pytest.fixture(scope="module")
def studies():
    return [calibrate(measured(seed), NO_PROFILE) for seed in SEEDS]


def test_intervals_hold_the_truth_as_often_as_they_say(studies):
    """21 intervals of 95 %: 3 or fewer misses have a probability of 0.98 if they are independent.

    Intervals of independent samples would be several times too narrow and miss most.
    """
    misses = [
        (study.parameters[j].name, seed)
        for seed, study in zip(SEEDS, studies, strict=True)
        for j in range(3)
        if not study.parameters[j].lower_95 <= TRUTH[j] <= study.parameters[j].upper_95
    ]
    assert len(misses) <= 3, misses


def test_standard_errors_are_those_of_repeated_calibrations(studies):
    """Error of each set over its own standard error: Student's t with 5 degrees has rms 1.29."""
    errors = np.array(
        [
            [(p.value - TRUTH[j]) / p.standard_error for j, p in enumerate(s.parameters)]
            for s in studies
        ]
    )
    rms = np.sqrt(np.mean(errors**2, axis=0))
    assert np.all(rms > 0.5), rms  # not far too wide
    assert np.all(rms < 2.2), rms  # nor too narrow; 7 sets tell it to 30 %
    assert np.all(np.abs(errors.mean(axis=0)) < 1.5), errors.mean(axis=0)  # no bias


def test_scatter_from_stroke_to_stroke_is_found(studies):
    """Median over the sets; the noise of a stroke adds a little to that of its offset."""
    found = np.median([[p.scatter for p in s.parameters] for s in studies], axis=0)
    assert found == pytest.approx(SCATTER, rel=0.5)  # 7 sets of 6 strokes each


def test_computed_strokes_lie_on_the_measured_ones(studies):
    for study in studies:
        assert study.converged
        assert study.misfit < 1.5
        assert study.residual_rms < 0.5 * study.residual_rms_before
        for impact in study.impacts:
            assert impact.after == pytest.approx(impact.measured, abs=1e-6)


def test_profile_of_a_nearly_linear_parameter_is_its_interval():
    study = calibrate(measured(1))
    (profile,) = study.profiles
    friction = study.parameters[1]
    width = friction.upper_95 - friction.lower_95
    assert profile.lower == pytest.approx(friction.lower_95, abs=0.15 * width)
    assert profile.upper == pytest.approx(friction.upper_95, abs=0.15 * width)


def test_steps_that_are_too_long_are_halved(studies):
    """Truth: the same fit in short steps; without the check it is 8 times as far, and says so."""
    text = NO_PROFILE.replace("step: 0.2 us", "step: 1 us")
    checked = calibrate(measured(0), text)
    plain = calibrate(measured(0), text.replace("step: 1 us", "step: 1 us, check_steps: false"))

    def off(study):
        pairs = zip(study.parameters, studies[0].parameters, strict=True)
        return max(abs(a.value - b.value) / b.standard_error for a, b in pairs)

    assert off(checked) < 0.02 < off(plain)
    assert checked.warnings == ()
    assert ["too low by about" in note for note in plain.warnings] == [True, True]


def test_an_offset_that_is_zeroed_away_is_said_to_be_invisible():
    strokes = measured(2, count=3, begin=-0.1e-3)
    zeroed = tuple(
        MeasuredStroke(name=s.name, values={"lift": lift - np.median(lift[strokes.time < 0.0])})
        for s in strokes.strokes
        for lift in (s.values["lift"],)
    )
    text = NO_PROFILE.replace("zero: none", "zero: start")
    study = calibrate(replace(strokes, strokes=zeroed), text)

    offset = study.parameters[2]
    assert np.isinf(offset.standard_error)
    assert offset.value == pytest.approx(offset.start, abs=1e-12)
    assert any("do not depend on 'offset'" in note for note in study.warnings)


def test_a_wrong_model_is_not_passed_over(studies):
    """The true needle is a fifth heavier: no preload or friction makes up for it."""
    text = NO_PROFILE.replace("mass: 3 g", "mass: 2.5 g")
    study = calibrate(measured(3), text)
    assert study.misfit > 3.0
    assert any("does not explain the strokes" in note for note in study.warnings)


@pytest.mark.parametrize(("last", "kept"), [(1.0e-3, 2), (2.4e-3, 1)])
def test_a_closing_that_the_last_bounces_decide_is_left_out(last, kept):
    """The needle leaves the stop at 2.5 ms: it rested since 1 ms, or bounced until 2.4 ms."""
    windows = (
        FitWindow(first=0.0, last=0.4e-3, what="opening"),
        FitWindow(first=2.5e-3, last=3.1e-3, what="closing"),
    )
    seen = {"opening": [0.2e-3, 0.4e-3], "seat": [2.8e-3, 3.1e-3]}
    computed = {"opening": [0.2e-3, 0.4e-3, last, 3.0e-3], "seat": [2.8e-3, 3.1e-3]}

    found, notes = _repeatable(windows, seen, computed)

    assert len(found) == kept
    assert any("only the opening was fitted" in note for note in notes) == (kept == 1)


def test_a_parameter_of_the_case_is_fitted_as_its_key_is():
    """Truth: the fit of the key; the new text changes the parameter alone."""
    strokes = measured(0)
    text = NO_PROFILE.replace("network:", "parameters: {F: 11 N}  # today\nnetwork:", 1)
    text = text.replace("preload: 11 N", "preload: = F")
    text = text.replace("key: network.components.spring.preload", "key: parameters.F")
    plain, found = calibrate(strokes, NO_PROFILE), calibrate(strokes, text)

    for one, other in zip(plain.parameters, found.parameters, strict=True):
        assert (one.value, one.standard_error) == (other.value, other.standard_error)
    new = calibrated_text(tree_of(text), found, Path())
    value = found.parameters[0].value
    assert f"parameters: {{F: {value:.7g} N}}  # today" in new
    assert "preload: = F" in new
