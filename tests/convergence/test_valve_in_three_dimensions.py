"""An axial stroke of bodies in three dimensions; truth: the same drawing in the half section."""

from pathlib import Path

import pytest

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import read_valve_case

FILE = Path(__file__).parents[1] / "data" / "case" / "stroke.yaml"


def first_impacts(*, swept):
    text = FILE.read_text()
    finer = [("size: 1 mm", "size: 2 mm"), ("{size: 0.012 mm, ", "{size: 0.04 mm, ")]
    finer += [("{size: 0.02 mm, ", "{size: 0.05 mm, "), ("land: 0.04 mm", "land: 0.1 mm")]
    if swept:
        finer.append(("model: axisymmetric", "model: swept\n      layers: 12"))
    for old, new in finer:
        assert old in text
        text = text.replace(old, new)
    variant = run_stroke(read_valve_case(text, FILE)).variants["dry"]
    assert abs(variant.result.books.relative_residual) < 1e-10
    return {stop: variant.impacts(stop)[0] for stop in ("opening", "seat")}


@pytest.mark.slow
def test_swept_bodies_strike_as_their_half_section():
    """Convergence: rings of twelve second-order elements, the same elements in the half section.

    The second impact, after 0.7 ms, has the deviations of the first one to bear.
    """
    solid, section = first_impacts(swept=True), first_impacts(swept=False)
    for stop, truth in section.items():
        found = solid[stop]
        assert found.time == pytest.approx(truth.time, rel=2e-3)
        assert found.approach_speed == pytest.approx(truth.approach_speed, rel=5e-3)
        assert found.impulse == pytest.approx(truth.impulse, rel=0.01)
        assert found.peak_force == pytest.approx(truth.peak_force, rel=0.03)
