"""What leaves out the yield stress of a material says so."""

import warnings
from pathlib import Path

import pytest

from klack.analyses.reduction.run import run_reduce
from klack.assembling.elastic_only import tell_elastic
from klack.assembling.problem import build_problem
from klack.case.reader import load_case, read_case
from klack.errors import AccuracyWarning
from klack.exchange.case_models import case_models
from klack.exchange.results.recovered_motion import recovered_motion

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"


def _quiet(*_):
    pass


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
