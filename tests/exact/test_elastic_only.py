"""What leaves out the yield stress of a material says so."""

import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from klack.analyses.impact.recovered_motion import recovered_motion
from klack.analyses.impact.run import run_impact
from klack.analyses.noise.source import impact_sources
from klack.analyses.reduction.run import run_reduce
from klack.assembling.problem import build_problem
from klack.assembling.yielding import tell_elastic
from klack.case.reader import load_case, read_case
from klack.errors import AccuracyWarning
from klack.exchange.case_models import case_models

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"


def _quiet(*_):
    pass


@pytest.mark.slow
def test_reduced_bodies_exports_and_recovered_motion_say_that_they_are_elastic():
    case = load_case(SPHERES)
    with pytest.warns(AccuracyWarning, match="reduced bodies are those of elastic .* 'steel'"):
        run_reduce(case)
    with pytest.warns(AccuracyWarning, match="exported models are those of elastic bodies"):
        case_models(case)
    with pytest.warns(AccuracyWarning, match="recovered motion is that of elastic bodies"):
        list(recovered_motion(build_problem(case, _quiet), [0], _quiet))


def test_elastic_materials_say_nothing():
    text = SPHERES.read_text("utf-8")
    given = ", yield: 280 MPa, hardening: {isotropic: 1 GPa}"
    assert given in text
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tell_elastic(read_case(text.replace(given, ""), SPHERES), "these are")


@pytest.mark.slow
def test_noise_of_an_impact_says_that_its_faces_were_new():
    """Truth: the share of the energy in the balance of the impact."""
    study = run_impact(load_case(SPHERES), levels=["reduced"], certify=False)
    energies = study.levels["reduced"].energies
    share = energies["plastic"] / energies["initial kinetic"]

    (source,) = impact_sources(study)

    told = [note for note in source.notes if "first on new faces" in note]
    assert len(told) == 1
    assert f"takes {100 * share:.2g} % of the energy" in told[0]
    worn = replace(study.levels["reduced"], energies=energies | {"plastic": 0.0})
    (after,) = impact_sources(replace(study, levels={"reduced": worn}))
    assert not any("new faces" in note for note in after.notes)
