"""What a user reads of the static start: one line, and plain numbers."""

from pathlib import Path

import pytest

from klack.analyses.stroke.analysis import STROKE, start_text
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import read_valve_case

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"


def study(tmp_path, **changes):
    text = CASE.read_text().replace("duration: 2 ms", "duration: 20 us")
    for before, after in changes.values():
        assert before in text
        text = text.replace(before, after)
    made = run_stroke(read_valve_case(text, tmp_path / "valve.yaml"))
    STROKE.save(made, tmp_path)
    return STROKE.load(tmp_path)


def test_displacements_and_pressures_are_told_after_storing(tmp_path):
    made = study(
        tmp_path,
        preload=("preload: 12 N", "preload: -12 N"),
        pressure=("volume: 200 mm^3}", "volume: 200 mm^3, pressure: 3 bar}"),
    )

    assert start_text(made.variants["dry"]).startswith("start at rest: needle 100 um; forces")
    wet = start_text(made.variants["wet"])
    # 2 bar above ambient on 10 mm: 16 N hold it closed
    assert wet.startswith("start at rest: needle -")
    assert "chamber 3 bar (stated); forces balance to " in wet
    start = STROKE.to_json(made)["variants"]["dry"]["start"]
    assert start["displacement_m"]["needle.tip"] > 99e-6
    assert abs(start["residual_force_N"]["needle"]) < 1e-9
    assert start["notes"] == []


def test_a_run_that_goes_on_has_no_start_of_its_own(tmp_path):
    first = study(tmp_path)

    text = CASE.read_text().replace("duration: 2 ms", "duration: 20 us")
    after = run_stroke(read_valve_case(text, tmp_path / "valve.yaml"), after=first)

    assert start_text(after.variants["dry"]) == ""
    assert STROKE.to_json(after)["start"] is None


def test_a_run_that_goes_on_in_another_valve_says_so(tmp_path):
    first = study(tmp_path)
    text = CASE.read_text().replace("duration: 2 ms", "duration: 20 us")

    def notes(changed: str) -> str:
        case = read_valve_case(changed, tmp_path / "valve.yaml")
        return " ".join(run_stroke(case, variants=("dry",), after=first).warnings)

    assert "another valve" not in notes(text)
    told = notes(text.replace("preload: 12 N", "preload: 13 N"))
    assert "different valve: network.components.spring differ" in told


def test_times_of_a_run_that_goes_on_are_those_of_the_whole_run(tmp_path):
    """Truth: one run. The second begins while the needle closes, and sees it bounce higher."""
    text = CASE.read_text().replace("step: 20 ns", "step: 20 ns, check_steps: false")

    def stroke(duration, after=None):
        case = text.replace("duration: 2 ms", f"duration: {duration}")
        case = read_valve_case(case, tmp_path / "valve.yaml")
        return run_stroke(case, variants=("dry",), after=after)

    pieces = stroke("2 ms"), stroke("0.8 ms", after=stroke("1.2 ms"))
    expected, found = (one.variants["dry"].times[0] for one in pieces)
    assert found.closing.touch == expected.closing.touch is not None
    assert found.closing.at_10 == pytest.approx(expected.closing.at_10, abs=1e-9)
    assert found.opening.at_50 is None
