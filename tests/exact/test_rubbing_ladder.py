"""Static contact with friction, and the law with memory that the reduced level makes of it.

Truth: one point on a cone in closed form, with the stiffnesses of the ring measured on the same
bodies; the frictionless contact; convergence; the loops of the full bodies.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import friction_doubt
from klack.case import read_case
from klack.contact.friction import Friction
from klack.contact.laws import TableLaw
from klack.contact.local_law import consistent_law
from klack.contact.rubbing_fit import rubbing_fit
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.statics import contact_compliance, static_contact
from klack.errors import AccuracyWarning
from klack.exchange.case_models import case_models
from klack.machine.progress import silent
from klack.transient.rubbing_ladder import rubbing_contact

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::klack.errors.AccuracyWarning"),
]

CASE = """
klack: 1
title: A ball on a cone of 45 degrees
unusual: true  # a soft solid as dense as steel
materials:
  hard: {{young: {young} GPa, poisson: 0.3, density: 7850 kg/m^3}}
  soft: {{young: 1 GPa, poisson: 0.45, density: 7850 kg/m^3}}
bodies:
  needle:
    geometry:
      model: axisymmetric
      profile: {{unit: mm, parts: {{needle: {{start: [0, 0], edges: [
        {{arc: [1, 1], centre: [0, 1], name: tip}}, {{line: [1, 4]}}, {{line: [0, 4]}},
        {{close: true}}]}}}}}}
    material: hard
    mesh: {{size: 0.5 mm, grading: 0.5, contact: {{size: {size} um, extent: 50 um}}}}
  housing:
    geometry:
      model: axisymmetric
      profile: {{unit: mm, parts: {{housing: {{start: [0.2, -4], edges: [
        {{line: [4, -4], name: bottom}}, {{line: [4, 0]}}, {{line: [1.2, 0]}},
        {{line: [0.2, {low}], name: seat}}, {{close: true}}]}}}}}}
    material: soft
    mesh: {{size: 0.5 mm, grading: 0.5, contact: {{size: {size} um, extent: 50 um}}}}
    fixed: [{{surface: bottom}}]
contact: {{between: [needle.tip, housing.seat], gap: 0.1 um, friction: {friction}{more}}}
motion: {{speed: 0.1 m/s}}
reduction: {{modes: {{needle: {{count: 4}}, housing: {{count: {modes}}}}}}}
run: {{duration: 800 us, reduced_step: 200 ns, levels: [reduced]}}
lumped: {{stiffness: 1e7 N/m}}
"""
HALF_ANGLE = np.pi / 4


def case(friction, *, young=990, size=4, more="", modes=8, low=-1.0):
    text = CASE.format(friction=friction, young=young, size=size, more=more, modes=modes, low=low)
    return read_case(text, Path("cone.yaml"))


@pytest.fixture(scope="module")
def seat():
    """A needle a thousand times as stiff as its seat."""
    problem = build_problem(case(0.1), silent)
    yield problem
    problem.close()


def compliance(problem):
    return contact_compliance(
        problem.space,
        problem.flexibility_upper,
        problem.flexibility_lower,
        faces=problem.rubbing.faces,
    )


def faces_of(problem, friction):
    return replace(problem.rubbing.faces, law=Friction.coulomb(friction))


def restitution(contact, place=-1):
    loop = contact.loops[place]
    return np.sqrt(1.0 - loop.loss / work(contact, loop))


def work(contact, loop):
    return float(
        TableLaw(contact.closing.approach, contact.closing.force).potential(loop.approach[0])
    )


def one_point(K, friction):
    """Restitution of one point with stiffnesses K (normal, tangential, coupled) on the cone."""
    kn, kt, both, sine, cosine = K[0, 0], K[1, 1], K[0, 1], np.sin(HALF_ANGLE), np.cos(HALF_ANGLE)
    free = (kn - both**2 / kt) * sine  # normal force while it slips, without friction
    closing, opening = (
        free / (1 - s * friction * both / kt) * (sine + s * friction * cosine) for s in (1, -1)
    )
    held = sine**2 * kn + 2 * sine * cosine * both + cosine**2 * kt
    back = (held - closing) / (held - opening)
    return np.sqrt((opening * back**2 + (1 - back) * (closing + opening * back)) / closing)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.3])
def test_a_stiff_needle_loses_what_one_point_does(seat, friction):
    """Stiffnesses of the ring: a unit displacement of its faces along and across the normal.

    One point has no pressure that slip makes uneven: with a seat of Poisson's ratio 0.3 instead of
    0.45 the restitution is 0.001, 0.003 and 0.006 below it at friction 0.1, 0.2 and 0.3.
    """
    C = compliance(seat)
    contact = rubbing_contact(seat.static, faces_of(seat, friction), C)
    carries = np.flatnonzero(contact.closing.pressures[-1] > 0)
    both = np.concatenate([carries, carries + seat.space.count])
    unit = np.kron(np.eye(2), np.ones((len(carries), 1)))
    K = unit.T @ np.linalg.solve(C[np.ix_(both, both)], unit)
    assert restitution(contact) == pytest.approx(one_point(K, friction), abs=0.003)
    # without the coupling of the directions it is that of the table
    R = K[1, 1] / K[0, 0] / np.tan(HALF_ANGLE) / friction
    e2 = 1 - 2 * friction / (1 + friction) * (R - 1) / (R + 1)
    assert one_point(np.diag(np.diag(K)), friction) == pytest.approx(np.sqrt(e2), abs=1e-12)


def test_all_depths_lose_the_same_share(seat):
    assert np.ptp([restitution(seat.rubbing, place) for place in range(3)]) < 0.002


def test_little_friction_is_the_frictionless_contact(seat):
    contact = rubbing_contact(seat.static, faces_of(seat, 1e-9), compliance(seat))
    force = seat.static.force
    # the law is solved to a residual of 1e-9 of the highest force
    np.testing.assert_allclose(contact.closing.force, force, rtol=1e-7, atol=1e-9 * force[-1])
    for mine, smooth in zip(
        contact.load_patterns(0.5), seat.static.load_patterns(0.5), strict=True
    ):
        np.testing.assert_allclose(mine, smooth, atol=1e-7 * np.abs(smooth).max())


def test_patterns_have_a_resultant_of_one(seat):
    for load, sign in zip(seat.rubbing.load_patterns(0.4), (1, -1), strict=True):
        assert load.reshape(-1, 2)[:, 1].sum() == pytest.approx(sign, abs=1e-9)


def test_increments_converge(seat):
    C = compliance(seat)
    n = seat.space.count
    fine = static_contact(seat.space, C[:n, :n], seat.static.max_force, count=96)
    more = rubbing_contact(fine, seat.rubbing.faces, C, count=96)
    assert restitution(more) == pytest.approx(restitution(seat.rubbing), abs=2e-3)
    force = np.interp(seat.static.approach, fine.approach, more.closing.force)
    np.testing.assert_allclose(seat.rubbing.closing.force[12:], force[12:], rtol=5e-3)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_the_law_has_the_loops_of_the_bodies(seat, share):
    """Whatever part of the compliance the modes carry."""
    contact = seat.rubbing
    modal = share * contact.closing.approach[-1] / contact.closing.force[-1]
    fit = rubbing_fit(consistent_law(contact.closing, modal), contact.loops)
    assert isinstance(fit.law, RubbingLaw)
    assert fit.error < 0.003
    for loop in contact.loops:
        apart = fit.law.along(np.append(0.0, loop.approach - modal * loop.force))[1:] - loop.force
        assert np.abs(apart).max() < (0.03 if share > 0.4 else 0.01) * loop.force[0]


@pytest.mark.filterwarnings("default::klack.errors.AccuracyWarning")
def test_faces_that_lock_have_no_law_with_memory():
    """Steeper than the friction, and too stiff across the normal to stick from the start."""
    locked = case(0.75, low=-1.732)
    problem = build_problem(locked, silent)
    with pytest.warns(AccuracyWarning, match="the faces lock"):
        assert problem.rubbing is None
    problem.close()
    study = run_impact(locked, levels=["reduced"], certify=False)
    assert any("leaves out contact.friction 0.75" in d for d in study.levels["reduced"].doubts)
    assert any("the faces lock" in text for text in study.warnings)


@pytest.fixture(scope="module")
def study():
    return run_impact(case(0.1, young=200, modes=12), levels=["reduced", "lumped"], certify=False)


def test_an_impact_loses_energy_by_friction(study):
    """One loop of the static contact, as long as the bodies ring little."""
    level = study.levels["reduced"]
    assert abs(level.energy_residual) < 1e-9
    share = level.energies["friction"] / level.energies["initial kinetic"]
    problem = build_problem(case(0.1, young=200, modes=12), silent)
    loop = problem.rubbing.loops[-1]
    assert share == pytest.approx(loop.loss / work(problem.rubbing, loop), rel=0.15)
    problem.close()
    assert level.doubts == ()
    assert "with friction" in level.label


def test_a_law_without_memory_says_so(study):
    assert any("leaves out contact.friction 0.1" in text for text in study.levels["lumped"].doubts)
    assert any("leaves out contact.friction 0.1" in text for text in study.warnings)


def test_a_consistent_law_without_memory_says_why():
    """Not that the law of the case is the wrong kind."""
    doubt = friction_doubt(case(0.1), has_memory=False, correction="consistent")
    assert "faces that lock have no law" in doubt
    assert "only the consistent" in friction_doubt(case(0.1), has_memory=False)


def test_what_slows_with_speed_says_so():
    rough = case(0.1, more=", static_friction: 0.2")
    assert "leaves out static_friction 0.2" in friction_doubt(rough, has_memory=True)
    assert friction_doubt(case(0.1), has_memory=True) == ""
    assert friction_doubt(case(0.0), has_memory=False) == ""


@pytest.mark.filterwarnings("default::klack.errors.AccuracyWarning")
def test_an_exported_pair_is_smooth_and_says_so():
    with pytest.warns(AccuracyWarning, match=r"leaves out contact\.friction 0\.1"):
        models = case_models(case(0.1))
    smooth = case_models(case(0.0))
    a, b = (m.pair.contacts[0].law.flat().parameters for m in (models, smooth))
    np.testing.assert_array_equal(a, b)
