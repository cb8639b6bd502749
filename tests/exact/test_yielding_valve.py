"""``klack stroke`` of a valve whose faces yield."""

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.analysis import STROKE, yield_told
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.run import run_stroke
from klack.assembling import yielding
from klack.case.any_case import read_valve_case
from klack.case.reader import read_case
from klack.errors import AccuracyWarning, InputError

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
VALVE = """
stops:
  seat: {between: [upper.tip, lower.tip], speed: 0.1 m/s}
network:
  components:
    needle: {type: flexible-body, body: upper, points: [tip, top], speed: -0.1 m/s}
    housing: {type: flexible-body, body: lower, points: [tip]}
    seat: {type: end-stop, gap: 0.2 um, law: {kind: consistent}}
    push: {type: constant-force, force: -0.02 N}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, housing.tip]
    - [needle.top, push.end]
run: {duration: 400 us, step: 10 ns, variants: [dry]}
"""
REDUCTION = """
reduction:
  correction: consistent
  modes: {upper: {count: 10}, lower: {count: 10}}
"""


def _valve(*changes):
    text = SPHERES.read_text("utf-8")
    text = text[: text.index("contact:\n  between")] + REDUCTION + VALVE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return read_valve_case(text, SPHERES)


@cache
def _study(*changes):
    return run_stroke(_valve(*changes))


@pytest.mark.slow
def test_first_impact_is_that_of_the_impact():
    """Reference: ``klack impact`` of the same bodies; 10 ns steps, ports of another force."""
    study = _study()
    text = SPHERES.read_text("utf-8").replace("gap: 0 um", "gap: 0.2 um")
    text = text.replace("speed: 0.1 m/s", "speed: 0.1 m/s, force: 20 mN")
    impact = run_impact(read_case(text, SPHERES), levels=("reduced",), certify=False)
    expected = impact.levels["reduced"].measures
    first, *later = study.variants["dry"].result.events

    assert first.peak_force == pytest.approx(expected.peak_force, rel=2e-3)
    assert first.restitution == pytest.approx(expected.restitution, abs=2e-3)
    assert expected.restitution < 0.95
    # pushed back at 0.07 m/s: slower, so elastic, and as hard as before
    assert later[0].restitution > 0.999
    assert later[0].peak_force == pytest.approx(first.peak_force, rel=0.01)
    assert study.variants["dry"].result.books.relative_residual < 1e-10


@pytest.mark.slow
def test_what_yield_has_left_is_told():
    """Conservation: the loss of the stop; the set in terminal, report and JSON."""
    study = _study()
    variant = study.variants["dry"]
    faces = variant.result.faces["seat"]

    (line,) = yield_told(variant)
    assert "the faces of 'seat' have yielded: a set of" in line
    assert faces.force == pytest.approx(variant.result.events[0].peak_force, rel=0.01)
    assert faces.force < faces.known_force
    assert STROKE.to_json(study)["faces"]["seat"]["set_m"] == faces.set
    assert any(row[0] == "set left on seat" for row in stroke_content(study).numbers.rows)
    assert variant.result.books.losses["seat contact"] > 0.1 * 0.5 * 3.21e-5 * 0.1**2
    assert not any("yields before" in text for text in study.warnings)


@pytest.mark.slow
def test_a_continued_stroke_has_faces_that_are_run_in():
    """Exact: the same bits as one stroke."""
    whole = _study(("duration: 400 us", "duration: 384 us")).variants["dry"].result
    first = _study(("duration: 400 us", "duration: 192 us"))
    second = run_stroke(_valve(("duration: 400 us", "duration: 192 us")), after=first)

    result = second.variants["dry"].result
    assert result.faces == whole.faces
    gap = result.channels["seat gap"].values
    np.testing.assert_array_equal(gap, whole.channels["seat gap"].values[-len(gap) :])


@pytest.mark.slow
def test_a_stop_hit_harder_than_its_loops_go_is_told():
    """Bad input: a speed of the stop below that of the stroke."""
    slow = _valve(("speed: 0.1 m/s}", "speed: 0.03 m/s}"))
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always", AccuracyWarning)
        study = run_stroke(slow)
    faces = study.variants["dry"].result.faces["seat"]

    assert faces.force > faces.known_force
    assert any("Raise the speed of stop 'seat'" in text for text in study.warnings)
    # a straight line up to four times the force of the loops is too soft
    assert study.variants["dry"].result.events[0].peak_force == pytest.approx(
        _study().variants["dry"].result.events[0].peak_force, rel=0.15
    )


@pytest.mark.slow
def test_a_film_lies_beside_faces_that_yield():
    """Conservation: the energy of a wet stroke on faces that yield; a thin film takes little."""
    changes = (
        ("law: {kind: consistent}", "law: {kind: consistent}, film: {shape: ring, "
         "inner_radius: 0.05 mm, outer_radius: 0.06 mm, roughness: 0.3 um}"),
        ("network:\n", "network:\n  fluid: n-heptane\n"),
        ("variants: [dry]", "variants: [wet, dry]"),
    )  # fmt: skip
    study = _study(*changes)
    wet, dry = (study.variants[name].result for name in ("wet", "dry"))

    assert wet.books.relative_residual < 1e-10
    assert wet.books.losses["seat film"] > 0.0
    assert wet.events[0].peak_force == pytest.approx(dry.events[0].peak_force, rel=0.02)
    assert dry.events[0].peak_force == pytest.approx(
        _study().variants["dry"].result.events[0].peak_force, rel=2e-3
    )  # faces and bulk apart


@pytest.mark.slow
def test_friction_and_yield_are_not_had_together():
    """Bad input: the law has one of the two; a warning names what is left out."""
    study = _study(("speed: 0.1 m/s}", "speed: 0.1 m/s, friction: 0.1}"))

    assert any("either yield or stops.seat.friction" in text for text in study.warnings)
    assert not study.variants["dry"].result.faces
    assert any("yields before" in text for text in study.warnings)


@pytest.mark.slow
def test_a_high_yield_stress_changes_no_bit():
    """Exact."""
    hard = _study(("yield: 280 MPa", "yield: 4 GPa")).variants["dry"].result
    soft = _study((", yield: 280 MPa, hardening: {isotropic: 1 GPa}", "")).variants["dry"].result

    np.testing.assert_array_equal(
        hard.channels["seat gap"].values, soft.channels["seat gap"].values
    )
    assert not hard.faces


@pytest.mark.slow
def test_a_law_that_cannot_be_leaves_the_stop_elastic(monkeypatch):
    """Bad input: modes that carry more than the loops; a warning, and the yield check says more."""

    def refused(loops, modal):
        raise InputError("law of faces that yield", got="this", expected="that", hint="a try.")

    monkeypatch.setattr(yielding, "yielding_law", refused)
    study = run_stroke(_valve())

    assert any("leaves out the yield of its faces" in text for text in study.warnings)
    assert any("yields before" in text for text in study.warnings)
    assert not study.variants["dry"].result.faces


WORN = "{force: 30 N, radius: [0 um, 20 um, 40 um], opening: [300 nm, 80 nm, 0 nm]}"


@pytest.mark.slow
def test_a_worn_stop_is_that_of_the_worn_impact():
    """Reference: ``klack impact`` of the same faces; exact but for the start of the gap, 0.5 %."""
    study = _study(("speed: 0.1 m/s}", f"speed: 0.1 m/s, worn: {WORN}}}"))
    text = SPHERES.read_text("utf-8").replace("gap: 0 um", f"gap: 0.2 um\n  worn: {WORN}")
    text = text.replace("speed: 0.1 m/s", "speed: 0.1 m/s, force: 20 mN")
    expected = (
        run_impact(read_case(text, SPHERES), levels=("reduced",), certify=False)
        .levels["reduced"]
        .measures
    )
    first = study.variants["dry"].result.events[0]

    assert first.peak_force == pytest.approx(expected.peak_force, rel=5e-3)
    assert first.contact_time == pytest.approx(expected.contact_time, rel=5e-3)
    assert first.restitution > 0.99  # a run-in seat does not yield any more
    assert expected.peak_force > 1.02 * _study().variants["dry"].result.events[0].peak_force


def test_worn_faces_of_a_stop_without_a_computed_law_are_refused():
    with pytest.raises(InputError, match=r"stops.seat.worn: .* law is not computed"):
        _valve(
            ("speed: 0.1 m/s}", f"speed: 0.1 m/s, worn: {WORN}}}"),
            ("law: {kind: consistent}", "law: {kind: linear, stiffness: 1e7 N/m}"),
        )
