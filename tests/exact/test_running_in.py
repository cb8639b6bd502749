"""Impacts one after another on faces that yield."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from klack.analyses.impact.run import run_impact
from klack.analyses.impact.running_in import running_in
from klack.analyses.impact.yielding_level import doubt_large_strain
from klack.assembling.ladder import impact_energy
from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.case.reader import read_case
from klack.errors import ConvergenceError
from klack.plasticity.ladder import YieldingContact
from klack.plasticity.stored_loops import loops_of_entry, loops_to_entry

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
YIELD = ", yield: 280 MPa, hardening: {isotropic: 1 GPa}"
KEYS = "run: {levels: [reduced]"


def _case(keys, given=YIELD):
    text = SPHERES.read_text("utf-8")
    assert KEYS in text
    assert YIELD in text
    return read_case(text.replace(KEYS, f"{KEYS}, {keys}").replace(YIELD, given), SPHERES)


@pytest.mark.slow
def test_running_in_follows_the_recursion_of_two_energies():
    """Exact for rigid bodies: W_L(P_n) = E + D(P_(n-1)), e_n^2 = W_e(P_n)/E; 1 %.

    The spheres keep 2e-5 of the energy as vibration; the loops have a state every 15 % of force.
    """
    case = _case("impacts: 3, run_in: true")
    problem = build_problem(case, lambda *_: None)
    loops = problem.yielding(lambda *_: None)
    assert loops is not None
    pair = own_pair(
        problem,
        mode_pools(problem, at_least=1, progress=lambda *_: None),
        stiffness=first_stiffness(problem),
        loops=loops,
    )
    found = running_in(case, pair, loops)
    assert found is not None
    E = impact_energy(case, problem.pair)
    again = loops_of_entry(loops_to_entry(loops))  # exact: the cache keeps every bit
    for name in ("force", "loss", "taken", "half_width"):
        np.testing.assert_array_equal(getattr(again, name), getattr(loops, name))
    np.testing.assert_array_equal(again.states[-1].plastic_gap, loops.states[-1].plastic_gap)
    np.testing.assert_array_equal(again.elastic.force, loops.elastic.force)
    taken = PchipInterpolator(loops.force, loops.taken)
    stored = PchipInterpolator(loops.force, [one.energy for one in loops.openings])

    lost = 0.0
    for n in range(3):
        force = brentq(lambda P, lost=lost: taken(P) - E - lost, *loops.force[[0, -1]])
        lost, before = float(taken(force) - stored(force)), lost
        assert found.lost[n] == pytest.approx(lost - before, rel=0.05, abs=1e-3 * E)
        assert found.peak_force[n] == pytest.approx(force, rel=0.01)
        assert found.restitution[n] == pytest.approx(np.sqrt(stored(force) / E), abs=0.01)
    shakedown = brentq(lambda P: stored(P) - E, *loops.force[[0, -1]])
    assert found.run_in
    assert found.peak_force[-1] == pytest.approx(shakedown, rel=0.01)
    assert found.restitution[-1] == pytest.approx(1.0, abs=2e-4)
    assert len(found.peak_force) > found.asked == 3
    assert np.all(np.diff(found.set) >= 0.0)
    assert np.all(np.diff(found.land) >= 0.0)
    assert np.all(found.lost >= 0.0)


def _fails_above(monkeypatch, force):
    """Let the ladder find no state above a force [N], and keep nothing from here on."""
    monkeypatch.setenv("KLACK_CACHE", "off")
    load = YieldingContact.load

    def limited(self, approach):
        state = load(self, approach)
        if state.force > force:
            raise ConvergenceError("no state found.\nTry: more hardening.")
        return state

    monkeypatch.setattr(YieldingContact, "load", limited)


@pytest.mark.slow
def test_loops_that_end_below_the_impact_say_how_far_they_go(monkeypatch):
    """Bad input: one warning with force, share of the speed and what to try; elastic otherwise."""
    _fails_above(monkeypatch, 0.1)
    study = run_impact(_case("impacts: 3"), levels=("reduced",), certify=False)

    (told,) = [text for text in study.warnings if "leaves out the yield" in text]
    assert re.search(r"they end at 0\.09\d* N, the peak of an impact at 1\d % of this speed", told)
    assert told.endswith("Try: more hardening.")
    assert study.running_in is None


@pytest.mark.slow
def test_loops_that_end_above_the_first_impact_answer_it(monkeypatch):
    """Exact: the first two impacts as with whole loops; 1e-3 for tables between other states."""
    whole = run_impact(_case("impacts: 9"), levels=("reduced",), certify=False).running_in
    assert whole is not None
    _fails_above(monkeypatch, 0.5 * float(whole.peak_force[1] + whole.peak_force[2]))
    study = run_impact(_case("impacts: 9"), levels=("reduced",), certify=False)

    found = study.running_in
    assert found is not None
    assert not found.run_in
    count = len(found.peak_force)
    assert 1 <= count < 3
    np.testing.assert_allclose(found.peak_force, whole.peak_force[:count], rtol=1e-3)
    assert any("where the static loops end" in text for text in study.warnings)


@pytest.mark.slow
def test_a_plastic_strain_beyond_small_strain_is_doubted():
    """Bad input: the same loops with the strain of softer faces."""
    case = _case("impacts: 1")
    loops = build_problem(case, lambda *_: None).yielding(lambda *_: None)
    assert loops is not None
    result = run_impact(case, levels=("reduced",), certify=False).levels["reduced"]
    assert doubt_large_strain(result, loops) is result
    softer = tuple(replace(one, plastic_strain=0.2) for one in loops.states)

    (doubt,) = doubt_large_strain(result, replace(loops, states=softer)).doubts
    assert doubt.startswith("plastic strain reaches 20 % at the peak")


@pytest.mark.slow
def test_elastic_faces_say_that_all_impacts_are_alike():
    study = run_impact(_case("run_in: true", ""), levels=("reduced",), certify=False)

    assert study.running_in is None
    assert any("all impacts are like the first" in text for text in study.warnings)
