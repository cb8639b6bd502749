"""Optima polished by derivatives.

Truth: strokes on both sides of a point; an optimum that a search without derivatives finds too.
"""

from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.study.evaluation import asked_of
from klack.analyses.study.goals import Bound, Goals
from klack.analyses.study.gradients import Gradients, require_gradients
from klack.analyses.study.points import space_of
from klack.case.study_source import study_of
from klack.errors import InputError
from klack.progress import silent

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
STUDY = """klack: 1
study:
  parameters:
    network.components.spring.preload: {from: 10 N, to: 14 N}
    network.components.needle.mass: {from: 2.7 g, to: 3.3 g, scale: log}
    lift: {from: 90 um, to: 110 um}
  linked:
    network.components.opening.gap: lift
  measures: [opening_time]
  objectives: {opening.peak_force: minimise}
  constraints: {opening_time: {most: 165 us}}
  search: {population: 20, generations: 3, refinements: 0, polish: 20}
  variant: dry
"""
ROBUST = "  robust: {scatter: {network.components.spring.preload: 0.3 N}, valves: 4}\n"


def write(folder: Path, text: str) -> Path:
    file = folder / "study.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("opening.peak_force:", "noise.loudness_max:", "noise.loudness_max'?, without"),
        ("lift: {from: 90 um, to: 110 um}", "lift: {values: [90 um, 110 um]}", "a list of values"),
        ("  variant: dry\n", f"  variant: dry\n{ROBUST}", "a robust search"),
        (
            "network.components.needle.mass: {from: 2.7 g, to: 3.3 g, scale: log}",
            "run.step: {from: 10 ns, to: 20 ns}",
            "run.step, a setting of the run",
        ),
    ],
)
def test_what_has_no_derivative_is_refused_before_the_first_run(old, new, words, tmp_path):
    pytest.importorskip("pymoo")
    assert old in STUDY
    with pytest.raises(InputError, match=words) as caught:
        klack.optimise(SMALL, write(tmp_path, STUDY.replace(old, new)), folder=tmp_path / "out")
    assert "search.polish" in caught.value.where
    assert not list(tmp_path.glob("out/points*"))


@pytest.mark.slow  # the loop with derivatives compiles for a minute
class TestPolish:
    def test_derivatives_are_those_of_the_unit_cube(self, tmp_path):
        """A range, a logarithmic one, a word that a key follows from; both signs."""
        case = klack.load_case(SMALL)
        source = study_of(case.checked, case.tree, write(tmp_path, STUDY))
        space = space_of(case.checked, source)
        names = ("opening.peak_force", "opening_time", "noise.force_level")
        asked = asked_of(case.checked, case.tree, source, [{}], names)
        slopes = require_gradients(source, asked, space)
        goals = Goals(
            objectives=names,
            signs=(-1.0, 1.0, 1.0),
            bounds=(Bound(measure="opening_time", value=165e-6, is_most=False),),
        )
        point = np.array([0.4, 0.6, 0.3])
        gradients = Gradients.of(asked, slopes, space, goals, silent)
        of_objectives, of_bounds = gradients.at(point)

        shares = [point + way * 0.05 * axis for axis in np.eye(3) for way in (1.0, -1.0)]
        written = [space.written(space.at(share)) for share in shares]
        table = klack.run_many(SMALL, written, names, variant="dry")
        force, time, level = ((table[name][::2] - table[name][1::2]) / 0.1 for name in names)
        largest = np.abs(force).max()
        np.testing.assert_allclose(of_objectives[0], -force, rtol=0.01, atol=0.01 * largest)
        np.testing.assert_allclose(of_objectives[1], time, rtol=0.01)
        # all bounces count in a level, those of the two strokes by 0.005 dB each
        np.testing.assert_allclose(of_objectives[2], level, atol=2 * 0.005 / 0.1)
        np.testing.assert_allclose(of_bounds[0], -time / 165e-6, rtol=0.01)
        assert gradients.notes == []

    def test_it_finds_what_a_search_without_derivatives_finds(self, tmp_path):
        pytest.importorskip("pymoo")
        polished = klack.optimise(SMALL, write(tmp_path, STUDY)).record
        text = STUDY.replace("refinements: 0, polish: 20", "refinements: 300")
        searched = klack.optimise(SMALL, write(tmp_path, text)).record
        found = []
        for record in (polished, searched):
            own = {item.name: item.values for item in record.measures}
            assert own["opening_time"][record.optimum.best] <= 165e-6
            found.append(own["opening.peak_force"][record.optimum.best])
        assert found[0] == pytest.approx(found[1], rel=1e-3)
        assert polished.count - 60 < 50
        assert "polished in 20 steps at most" in polished.design
        assert polished.warnings == ()

    def test_it_resumes(self, tmp_path):
        pytest.importorskip("pymoo")
        file, out = write(tmp_path, STUDY), tmp_path / "out"
        first = klack.optimise(SMALL, file, folder=out).record
        again = klack.optimise(SMALL, file, folder=out).record
        assert again.computed == 0
        assert again.optimum.best == first.optimum.best
