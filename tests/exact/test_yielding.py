"""Impacts of faces that yield: law, bodies, ``klack impact``, ``klack stroke``.

Impacts on faces that yield.

Truth: two straight lines, loading with k1 and elastic with k2 (Walton & Braun, J. Rheol. 30 (1986)
949), have closed forms for every impact on the same place; and the energy.

Two bodies that yield under their own contact forces.

Truth: an elastic sphere on a plane with the finite elements of others, published fits, and
conservation.

``klack impact`` of bodies that yield.

``klack stroke`` of a valve whose faces yield.
"""

import warnings
from functools import cache
from math import exp, pi
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.analysis import STROKE, yield_told
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.run import run_stroke
from klack.assembling import yielding
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import impact_system
from klack.case import load_case, read_case
from klack.case.any_case import read_valve_case
from klack.contact.plasticity.ladder import YieldingContact
from klack.contact.plasticity.yielding_body import LoadedBody, YieldingBody
from klack.contact.plasticity.zone import plastic_zone
from klack.contact.yielding_law import YieldingLaw
from klack.errors import AccuracyWarning, InputError
from klack.exchange.modal_model import _without_memory
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import propose_step, simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

MASS, SPEED, LOADING, ELASTIC = 3e-3, 0.3, 1e8, 2.5e8
RATIO = LOADING / ELASTIC
ALONE = SPEED * np.sqrt(MASS * LOADING)  # force of the first impact


def _two_lines(end=10e-6, states=40):
    largest = np.linspace(1e-10, end, states)
    return YieldingLaw(
        largest=largest,
        set=largest * (1 - RATIO),
        closing=LOADING * largest,
        shape=np.tile((np.arange(17) / 16) ** 2, (states, 1)),
    )


def _impact(law, step=20e-9, speed=SPEED):
    contact = ContactPair(
        body_a="needle", port_a="contact", body_b="seat", port_b="contact", law=law, gap=0.0
    )
    system = ReducedSystem(
        bodies=(rigid_mass_body("needle", MASS), fixed_body("seat")), contacts=(contact,)
    )
    return simulate_impact(system, speed=speed, duration=40e-6, step=step)


@pytest.mark.parametrize("step", [200e-9, 20e-9])
def test_impacts_on_the_same_place_run_in(step):
    """Exact: F_n^2 = F^2 + (1 - r) F_(n-1)^2 and e_n^2 = r F_n^2/F^2, r = k1/k2; order 2."""
    law, before = _two_lines(), 0.0
    for _ in range(6):
        history = _impact(law, step)
        force = np.sqrt(ALONE**2 + (1 - RATIO) * before**2)
        tolerance = 1e-4 if step < 1e-7 else 5e-3
        assert history.velocity_a[-1] / SPEED == pytest.approx(
            np.sqrt(RATIO) * force / ALONE, rel=tolerance
        )
        assert np.max(history.peak_force) == pytest.approx(force, rel=tolerance)
        assert LOADING * history.pressed == pytest.approx(force, rel=tolerance)
        assert abs(history.ledger.residual) < 1e-12
        loss = 0.5 * (1 - RATIO) / LOADING * (force**2 - before**2)
        assert history.ledger.plastic == pytest.approx(loss, rel=20 * tolerance)
        law, before = law.after(history.pressed), force


def test_less_than_before_is_elastic():
    """Exact: half the speed on faces that are run in; a linear spring, half a period in contact."""
    law = _two_lines()
    law = law.after(_impact(law).pressed)

    history = _impact(law, speed=0.5 * SPEED)

    assert history.ledger.plastic == 0.0
    assert history.velocity_a[-1] == pytest.approx(0.5 * SPEED, rel=1e-12)
    contact = np.count_nonzero(history.force) * history.step
    assert contact == pytest.approx(np.pi * np.sqrt(MASS / ELASTIC), abs=2 * history.step)
    assert law.set_after(law.reached) == pytest.approx(ALONE / LOADING * (1 - RATIO), rel=1e-4)


def test_elastic_curve_and_closing_meet():
    """Exact: continuous where yield resumes, no force below the set."""
    law = _two_lines().after(4e-6)
    around = 4e-6 + 1e-12 * np.array([-1.0, 1.0])

    assert law.force(around) == pytest.approx(LOADING * 4e-6, rel=1e-5)
    assert law.force(law.set_after(4e-6)) == 0.0
    assert law.force(3e-6) == pytest.approx(ELASTIC * (3e-6 - 4e-6 * (1 - RATIO)), rel=1e-12)


def test_impact_beyond_the_last_state_is_refused():
    with pytest.raises(InputError, match=r"at most 1\.5 um, 150 N"):
        _impact(_two_lines(end=1.5e-6))


def test_loss_that_falls_is_refused():
    """Conservation: else pressing further would give energy."""
    law = _two_lines()
    with pytest.raises(InputError, match="a loss that falls"):
        YieldingLaw(
            largest=law.largest, set=law.set[::-1] * 0, closing=law.closing, shape=law.shape**0.01
        )


def test_random_drives_lose_and_never_gain():
    """Conservation: laws and speeds drawn at random, bounced three times."""
    rng = np.random.default_rng(7)
    run = 0
    while run < 40:
        power = rng.uniform(1.0, 1.6)
        largest = np.linspace(1e-9, 30e-6, 60)
        force = rng.uniform(2e7, 4e8) * largest * (largest / 5e-6) ** (power - 1)
        left = largest * rng.uniform(0.0, 0.8) * (1 - np.exp(-largest / 5e-6))
        shape = np.tile((np.arange(33) / 32) ** (2 * rng.uniform(1.0, 1.5)), (60, 1))
        try:
            law = YieldingLaw(largest=largest, set=left, closing=force, shape=shape)
        except InputError:
            continue
        run += 1
        for _ in range(3):
            history = _impact(law, step=rng.uniform(5e-9, 3e-7), speed=rng.uniform(0.05, 0.4))
            assert abs(history.ledger.residual) < 1e-10
            assert history.ledger.plastic >= -1e-9 * history.ledger.initial
            law = law.after(history.pressed)


SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
RADIUS, YOUNG, POISSON, YIELD = 1.25e-3, 210e9, 0.3, 280e6
MODULUS = YOUNG / (1 - POISSON**2)  # of one sphere on a rigid plane: the plane of symmetry
PRESSURE = 1.295 * exp(0.736 * POISSON) * YIELD  # Jackson & Green 2005, at first yield
CONTACT = pi * PRESSURE * RADIUS / (2 * MODULUS)
FORCE, APPROACH = 2 / 3 * pi * CONTACT**2 * PRESSURE, CONTACT**2 / RADIUS


@pytest.fixture(scope="module")
def problem():
    return build_problem(load_case(SPHERES), lambda *_: None)


@pytest.fixture(scope="module")
def loops(problem):
    return problem.yielding(lambda *_: None)


def _jackson_green(ratio):
    """Force over that of first yield at an approach over its own (J. Tribol. 127 (2005) 343)."""
    strain = YIELD / MODULUS
    B, beyond = 0.14 * exp(23 * strain), ratio / 1.9
    contact = CONTACT * np.sqrt(ratio * beyond**B)
    hardness = 2.84 * (1 - np.exp(-0.82 * (contact / RADIUS) ** -0.7))
    pressed = 4 * hardness / (PRESSURE / YIELD) * (1 - np.exp(-(ratio ** (5 / 9)) / 25)) * ratio
    return np.exp(-(ratio ** (5 / 12)) / 4) * ratio**1.5 + pressed


@pytest.mark.slow
def test_first_yield_is_below_the_surface_of_a_sphere(loops):
    """Reference: Johnson 1985, 4.2; a third of an element in the approach on this mesh, 15 %."""
    assert loops.first_yield == pytest.approx(FORCE, rel=0.15)


@pytest.mark.slow
def test_force_over_approach_is_that_of_a_sphere(loops):
    """Reference: fit of Jackson & Green, 3 %, and as much for a contact of few elements."""
    for state in loops.states:
        ratio = state.approach / 2 / APPROACH
        if 3 < ratio:
            assert state.force / FORCE == pytest.approx(_jackson_green(ratio), rel=0.06)
    assert loops.states[-1].force > 10 * FORCE


@pytest.mark.slow
def test_set_is_that_of_a_sphere(loops):
    """Reference: Etsion, Kligerman & Kadin 2005, residual over largest approach within 0.03."""
    for state, opening in zip(loops.states, loops.openings, strict=True):
        ratio = state.approach / 2 / APPROACH
        if ratio > 2:
            fit = (1 - ratio**-0.28) * (1 - ratio**-0.69)
            assert opening.set / state.approach == pytest.approx(fit, abs=0.035)


@pytest.mark.slow
def test_loss_is_the_plastic_work_and_a_little_that_stays_inside(loops):
    """Conservation: what is lost over a loop, less the plastic work, is elastic energy inside."""
    locked = loops.loss - np.array([state.plastic_work for state in loops.states])
    share = locked[-1] / loops.loss[-1]
    assert 0.0 < share < 0.2
    assert np.all(np.diff(loops.loss) >= 0.0)


@pytest.mark.slow
def test_opening_begins_where_closing_ended(loops):
    """Exact: the same complementarity problem."""
    for state, opening in zip(loops.states, loops.openings, strict=True):
        assert opening.force[-1] == pytest.approx(state.force, rel=1e-6)  # yield that begins
        assert opening.approach[-1] == pytest.approx(state.approach, rel=1e-12)


@pytest.mark.slow
def test_bodies_that_do_not_yield_have_no_states():
    """Exact: a yield stress beyond the stresses of the impact."""
    text = SPHERES.read_text("utf-8").replace("yield: 280 MPa", "yield: 4 GPa")
    problem = build_problem(read_case(text, SPHERES), lambda *_: None)

    assert problem.yielding(lambda *_: None) is None


@pytest.mark.slow
def test_no_step_needs_to_be_halved(loops):
    """Exact: Newton's method with its line search, to 70 times first yield."""
    assert loops.force[-1] > 60.0 * loops.first_yield
    assert max(state.rounds for state in loops.states) <= 20


def _contact(problem, radius):
    rows = problem.space.G_a, problem.space.G_b
    bodies = [
        YieldingBody(one, csr_array(one_rows), np.zeros(2), radius)
        for one, one_rows in zip(problem.loaded, rows, strict=True)
    ]
    return YieldingContact(problem.space, problem.static.compliance, bodies)


@pytest.mark.slow
def test_a_zone_that_is_widened_on_the_way_keeps_what_has_yielded(problem, loops):
    """Exact: the rest is elastic at every state of both; 1e-6 for what Newton's method leaves."""
    narrow, wide = _contact(problem, 1.2e-5), _contact(problem, 1e-4)
    sizes = [len(body.zone.dofs) for body in narrow.bodies]
    for known in loops.states[:24]:
        one, other = narrow.load(known.approach), wide.load(known.approach)
        assert one.force == pytest.approx(other.force, rel=1e-6)
        assert one.plastic_work == pytest.approx(other.plastic_work, rel=1e-6, abs=1e-15)
        scale = np.abs(other.plastic_gap).max()
        np.testing.assert_allclose(one.plastic_gap, other.plastic_gap, rtol=0, atol=1e-6 * scale)

    for body, size in zip(narrow.bodies, sizes, strict=True):
        assert 2 * size < len(body.zone.dofs)


def test_whatever_yields_the_stiffness_stays_positive(problem):
    """Exact: Bessel's inequality, on curved elements and at the axis too."""
    body = problem.pair.lower
    one = LoadedBody(
        body=body,
        flexibility=problem.flexibility_lower,
        materials=problem.case.materials_of(body.name, body.mesh.solids),
    )
    zone = plastic_zone(one.body, one.materials, one.elements_near(np.zeros(2), 2e-5))
    count = len(zone.dofs)
    D = np.zeros((4, 4))
    D[:3, :3] = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    D += YOUNG / (1 + POISSON) * np.diag([1, 1, 1, 0.5])
    K = zone.K.toarray()
    for block in zone.points:
        every = np.arange(block.volume.size)
        all_of_it = np.broadcast_to(D, (len(every), 4, 4))
        K -= block.stiffness(all_of_it, every, count + 1)[:count, :count].toarray()

    assert np.linalg.eigvalsh(K).min() > -1e-9 * np.abs(zone.K).max()


YIELD_IMPACT = ", yield: 280 MPa, hardening: {isotropic: 1 GPa}"


def _case(given=YIELD_IMPACT, *changes):
    text = SPHERES.read_text("utf-8")
    assert YIELD_IMPACT in text
    text = text.replace(YIELD_IMPACT, given)
    for old, new in (
        ("reduced_step: 10 ns", "reduced_step: 10 ns, interface_step: 5 ns"),
        *changes,
    ):
        assert old in text
        text = text.replace(old, new)
    return read_case(text, SPHERES)


@cache
def _study(given=YIELD_IMPACT, levels=("reduced", "interface"), *changes):
    return run_impact(_case(given, *changes), levels=levels)


@pytest.mark.parametrize("level", ["reduced", "interface"])
@pytest.mark.slow
def test_levels_with_yield_keep_the_energy(level):
    """Conservation: what yields is what is missing."""
    study = _study()
    result = study.levels[level]

    assert study.reference == "reduced"  # the law has the loops themselves
    assert "yield" in result.label
    assert not result.doubts
    assert abs(result.energy_residual) < 1e-12
    E = result.energies["initial kinetic"]
    left = sum(v for k, v in result.energies.items() if k not in ("initial kinetic", "plastic"))
    assert result.energies["plastic"] == pytest.approx(E - left, abs=1e-12 * E)
    assert 0.01 < result.energies["plastic"] / E < 0.6


@pytest.mark.slow
def test_elastic_levels_are_doubted_and_the_law_is_measured_with_yield():
    """Truth: the interface level, whose points yield too, as far as its modes leave it open."""
    lumped = ("contact:\n", "lumped: {stiffness: 1e8 N/m}\ncontact:\n")
    study, elastic = _study(YIELD_IMPACT, ("lumped", "reduced", "interface"), lumped), _study("")

    assert any(
        "Try: level reduced, which includes yield" in d for d in study.levels["lumped"].doubts
    )
    for level in ("reduced", "interface"):
        assert study.levels[level].measures.restitution < 0.99 * (
            elastic.levels[level].measures.restitution
        )
    found, margin = study.estimates["reduced"], study.estimate_margins["reduced"]
    points, law = (study.levels[name].history for name in ("interface", "reduced"))
    apart = compare_histories(points, law)
    assert found.peak_force == pytest.approx(apart.peak_force, abs=2.0 * margin.peak_force)
    assert found.history_l2 > 2.0 * elastic.estimates["reduced"].history_l2
    assert study.estimate_basis.endswith("yield by a pressure limit")
    assert (
        sum("first impact on new faces: yielding dissipates" in text for text in study.warnings)
        == 1
    )


@pytest.mark.slow
def test_a_high_yield_stress_changes_no_bit():
    """Exact."""
    hard, elastic = _study(", yield: 4 GPa"), _study("")

    for level in elastic.levels:
        np.testing.assert_array_equal(
            hard.levels[level].history.force, elastic.levels[level].history.force
        )
        assert not hard.levels[level].doubts
    assert hard.reference == elastic.reference


@pytest.mark.slow
def test_yield_beside_friction_is_left_out_aloud():
    study = _study(YIELD_IMPACT, ("reduced",), ("  gap: 0 um", "  gap: 0 um\n  friction: 0.1"))

    assert "plastic" not in study.levels["reduced"].energies or (
        study.levels["reduced"].energies["plastic"] == 0.0
    )
    assert any("faces have either yield or contact.friction" in text for text in study.warnings)


def test_a_law_without_a_step_of_its_own_and_an_export():
    """Bad input: exported models have no memory."""
    law = YieldingLaw(
        largest=np.array([1e-6, 2e-6]),
        set=np.array([0.0, 5e-7]),
        closing=np.array([100.0, 150.0]),
        shape=np.tile(np.linspace(0.0, 1.0, 5) ** 2, (2, 1)),
    )
    # the steepest line: 150 N over 1.5 um between two places of (i/4)^2 is 1 of the secant
    assert law.stiffest == pytest.approx(1e8, rel=1e-12)
    system = impact_system(
        _case(), rigid_mass_body("a", 1e-3, port="contact"), fixed_body("b", port="contact"), law
    )

    # a hundredth of the half period of that mass on that spring, in steps of 1, 2 and 5
    assert 5e-8 <= propose_step(system, speed=0.1) <= 0.01 * np.pi * np.sqrt(1e-3 / 1e8)
    with pytest.raises(InputError, match="without a yield stress"):
        _without_memory(system.contacts[0])


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
def _study_valve(*changes):
    return run_stroke(_valve(*changes))


@pytest.mark.slow
def test_first_impact_is_that_of_the_impact():
    """Reference: ``klack impact`` of the same bodies; 10 ns steps, ports of another force."""
    study = _study_valve()
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
    study = _study_valve()
    variant = study.variants["dry"]
    faces = variant.result.faces["seat"]

    (line,) = yield_told(variant)
    assert "the faces of 'seat' have yielded: a set of" in line
    assert faces.force == pytest.approx(variant.result.events[0].peak_force, rel=0.01)
    assert faces.force < faces.known_force
    assert STROKE.to_json(study)["faces"]["seat"]["set_m"] == faces.set
    further = next(s for s in stroke_content(study).sections if s.title == "Further numbers")
    assert any(row[0] == "permanent set on seat" for table in further.tables for row in table.rows)
    assert variant.result.books.losses["seat contact"] > 0.1 * 0.5 * 3.21e-5 * 0.1**2
    assert not any("yields before" in text for text in study.warnings)


@pytest.mark.slow
def test_a_continued_stroke_has_faces_that_are_run_in():
    """Exact: the same bits as one stroke."""
    whole = _study_valve(("duration: 400 us", "duration: 384 us")).variants["dry"].result
    first = _study_valve(("duration: 400 us", "duration: 192 us"))
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
        _study_valve().variants["dry"].result.events[0].peak_force, rel=0.15
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
    study = _study_valve(*changes)
    wet, dry = (study.variants[name].result for name in ("wet", "dry"))

    assert wet.books.relative_residual < 1e-10
    assert wet.books.losses["seat film"] > 0.0
    assert wet.events[0].peak_force == pytest.approx(dry.events[0].peak_force, rel=0.02)
    assert dry.events[0].peak_force == pytest.approx(
        _study_valve().variants["dry"].result.events[0].peak_force, rel=2e-3
    )  # faces and bulk apart


@pytest.mark.slow
def test_friction_and_yield_are_not_had_together():
    """Bad input: the law has one of the two; a warning names what is left out."""
    study = _study_valve(("speed: 0.1 m/s}", "speed: 0.1 m/s, friction: 0.1}"))

    assert any("either yield or stops.seat.friction" in text for text in study.warnings)
    assert not study.variants["dry"].result.faces
    assert any("yields before" in text for text in study.warnings)


@pytest.mark.slow
def test_a_high_yield_stress_changes_no_bit_valve():
    """Exact."""
    hard = _study_valve(("yield: 280 MPa", "yield: 4 GPa")).variants["dry"].result
    soft = (
        _study_valve((", yield: 280 MPa, hardening: {isotropic: 1 GPa}", "")).variants["dry"].result
    )

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
    study = _study_valve(("speed: 0.1 m/s}", f"speed: 0.1 m/s, worn: {WORN}}}"))
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
    assert expected.peak_force > 1.02 * _study_valve().variants["dry"].result.events[0].peak_force


def test_worn_faces_of_a_stop_without_a_computed_law_are_refused():
    with pytest.raises(InputError, match=r"stops.seat.worn: .* law is not computed"):
        _valve(
            ("speed: 0.1 m/s}", f"speed: 0.1 m/s, worn: {WORN}}}"),
            ("law: {kind: consistent}", "law: {kind: linear, stiffness: 1e7 N/m}"),
        )
