"""The whole impact without MKL: the same numbers from the solvers that take over."""

import sys

import pytest

from klack.analyses.impact.run import run_impact
from klack.case import load_case, shipped_cases
from klack.elasticity.factorization import available_backends


@pytest.mark.slow
@pytest.mark.parametrize("missing", [("pypardiso",), ("pypardiso", "ngsolve")])
def test_impact_without_mkl(missing: tuple[str, ...], monkeypatch: pytest.MonkeyPatch):
    case = load_case(shipped_cases()["demo-valve-axisymmetric"])
    levels = ("reduced", "full")
    expected = run_impact(case, levels=levels, certify=False)
    for module in missing:
        monkeypatch.setitem(sys.modules, module, None)
    assert "pardiso" not in available_backends()
    study = run_impact(case, levels=levels, certify=False)
    for level in levels:
        a, b = study.levels[level].measures, expected.levels[level].measures
        # round-off of another factorisation, grown over the iterations of the modes
        assert a.peak_force == pytest.approx(b.peak_force, rel=1e-6)
        assert a.restitution == pytest.approx(b.restitution, abs=1e-6)
