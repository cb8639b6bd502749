"""Faces that run in, and the limit of their pressure.

Impacts one after another on faces that yield.

Faces as running-in has left them, written as a case and read again.

Contact points whose pressure is limited: the law, one mass on one point, the fit to loops.
"""

import re
from dataclasses import replace
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from draws import each
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from klack.analyses.impact.command import run_case
from klack.analyses.impact.run import run_impact
from klack.analyses.impact.running_in import running_in, worn_text
from klack.analyses.impact.yielding_level import doubt_large_strain
from klack.assembling.ladder import impact_energy
from klack.assembling.modes import mode_pools
from klack.assembling.pressure_limit import meridian_case
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.case import load_case, read_case
from klack.contact.plasticity.ladder import YieldingContact
from klack.contact.plasticity.loops import loops_of_entry, loops_to_entry
from klack.contact.pressure_limit import PressureLimit
from klack.contact.worn_faces import WornFaces, opened_by
from klack.errors import ConvergenceError, InputError
from klack.terminal.options import WantedResult
from klack.transient.interface_arrays import ActiveSet, Limit, Worn
from klack.transient.interface_run import simulate_interface
from klack.transient.yielding_points import let_yield, solve_yielding
from klack.verification.interface_bodies import modal_model, rigid_body
from klack.verification.plasticity import ball_in_seat

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
    assert any("all impacts equal the first" in text for text in study.warnings)


CASES = Path(__file__).parents[2] / "cases" / "demo-valve-axisymmetric"
STEEL = "density: 7850 kg/m^3}"
SOFT = "density: 7850 kg/m^3, yield: 600 MPa, hardening: {isotropic: 1 GPa}}"
ELEMENT, FINE = "size: 0.004 mm", "size: 0.002 mm"


def _changed(text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@cache
def _run_in():
    text = _changed(
        (CASES / "case.yaml").read_text("utf-8"),
        (STEEL, SOFT),
        ("run:\n", "run:\n  run_in: true\n"),
    )
    study = run_impact(read_case(text, CASES / "case.yaml"), levels=("reduced",), certify=False)
    assert study.running_in is not None
    assert study.running_in.run_in
    found = study.running_in
    return found, worn_text(text, CASES / "case.yaml", found, CASES, "1")


def _impact(text, *levels):
    return run_impact(read_case(text, CASES / "worn.yaml"), levels=levels, certify=False)


@pytest.mark.parametrize("level", ["reduced", "interface"])
@pytest.mark.slow
def test_an_elastic_impact_on_the_written_case_is_the_run_in_one(level):
    """Exact but for the smooth start of an elastic law: the same contact problem; 0.5 %."""
    found, text = _run_in()
    study = _impact(text, level)
    measures = study.levels[level].measures

    assert measures.peak_force == pytest.approx(found.peak_force[-1], rel=5e-3)
    assert measures.contact_time == pytest.approx(found.contact_time[-1], rel=5e-3)
    assert measures.restitution == pytest.approx(found.restitution[-1], abs=5e-4)
    assert study.levels[level].energies.get("plastic", 0.0) == 0.0
    assert not any("yields" in warning for warning in study.warnings)


@pytest.mark.slow
def test_a_mesh_twice_as_fine_reads_the_same_faces():
    """Convergence: the set between the contact points is a straight line; 2 %."""
    found, text = _run_in()
    measures = _impact(_changed(text, (ELEMENT, FINE)), "reduced").levels["reduced"].measures

    assert measures.peak_force == pytest.approx(found.peak_force[-1], rel=0.02)
    assert measures.restitution == pytest.approx(found.restitution[-1], abs=1e-3)


@pytest.mark.slow
def test_a_faster_impact_than_those_that_have_worn_the_faces_is_told():
    _, text = _run_in()
    study = _impact(_changed(text, ("speed: 0.3 m/s", "speed: 0.5 m/s")), "reduced")

    assert any("is worn up to 126.9 N and yields again" in told for told in study.warnings)


def test_a_set_that_is_a_shift_along_the_axis_changes_nothing():
    """Exact: faces touch where they did, and only the shape of the gap matters."""
    case = read_case((CASES / "case.yaml").read_text("utf-8"), CASES / "case.yaml")
    space = build_problem(case, lambda *_: None).space
    order = np.argsort(space.points[:, 0])
    lower = WornFaces(radius=space.points[order, 0], opening=3e-7 * space.axial[order])
    start = min(space.clearance, space.touch)
    found = opened_by(space, lower)

    assert opened_by(space, None) is space
    touching = space.gap + (start - space.touch) * space.axial
    np.testing.assert_allclose(found.gap, touching, rtol=0, atol=1e-18)
    assert found.clearance == start


@pytest.mark.parametrize(
    ("worn", "message"),
    [
        ("{force: 100 N, radius: [0.5 mm], opening: [0 um]}", "contact.worn.radius"),
        ("{force: 100 N, radius: [0.5 mm, 0.6 mm], opening: [0 um, 1 um, 0 um]}", "3 values for 2"),
        (
            "{force: 100 N, radius: [0.6 mm, 0.5 mm], opening: [0 um, 1 um]}",
            "ascending radii from 0",
        ),
        ("{force: 100 N, radius: [0.5 mm, 0.6 mm], opening: [0 um, 1 mm]}", "check the units"),
        ("{force: 0 N, radius: [0.5 mm, 0.6 mm], opening: [0 um, 1 um]}", "contact.worn.force"),
        ("{force: 100 N, radius: [0.5 mm, .nan], opening: [0 um, 1 um]}", "contact.worn.radius"),
        ("worn.csv", "contact.worn"),
    ],
)
def test_a_profile_that_is_none_is_refused(worn, message):
    """Bad input: one clear error."""
    text = (CASES / "case.yaml").read_text("utf-8")
    text = _changed(text, ("  gap: 0 um", f"  gap: 0 um\n  worn: {worn}"))
    with pytest.raises(InputError, match=message):
        read_case(text, CASES / "case.yaml")


@pytest.mark.slow
def test_the_command_writes_a_case_that_it_reads_again(tmp_path):
    """Exact: the file of one command is that of the next; nothing is written without running-in."""
    spheres = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
    text = spheres.read_text("utf-8")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "case.yaml").write_text(
        _changed(text, ("run: {", "run: {impacts: 2, "), ("size: 0.004 mm", "size: 0.01 mm")),
        "utf-8",
    )
    wanted = WantedResult(out=tmp_path / "b", report=False, quiet=True)
    run_case(tmp_path / "a" / "case.yaml", [], wanted, certify=False)
    worn = load_case(tmp_path / "b" / "worn.yaml")
    wanted = WantedResult(out=tmp_path / "c", report=False, quiet=True)
    run_case(tmp_path / "b" / "worn.yaml", [], wanted, certify=False)

    assert worn.contact.worn is not None
    assert worn.run.impacts == 1
    assert not (tmp_path / "c" / "worn.yaml").exists()


@pytest.mark.slow
def test_the_written_case_says_where_it_comes_from():
    found, text = _run_in()

    assert text.startswith("# klack 1, klack impact: faces of case.yaml after ")
    case = read_case(text, CASES / "worn.yaml")
    assert case.contact.worn is not None
    assert case.contact.worn.force == pytest.approx(found.worn_by, rel=1e-4)
    assert not case.run.run_in
    np.testing.assert_allclose(case.contact.worn.opening, found.opening, atol=1e-13)
    assert "not yet run in" in worn_text(
        (CASES / "case.yaml").read_text("utf-8"),
        CASES / "case.yaml",
        replace(found, run_in=False),
        CASES,
        "1",
    )


AXISYMMETRIC = Path(__file__).parents[2] / "cases" / "demo-valve-axisymmetric" / "case.yaml"
VALVE = Path(__file__).parents[2] / "cases" / "demo-valve" / "case.yaml"

LIMIT = PressureLimit(set=np.array([0.0, 1e-6, 3e-6]), pressure=np.array([20.0, 30.0, 32.0]))
STIFFNESS, MASS = 2.5e8, 3e-3


def test_the_loss_is_the_integral_of_the_limit():
    """Exact: trapezoids under straight lines, and the last line beyond them."""
    np.testing.assert_allclose(
        LIMIT.loss(np.array([0.0, 0.5e-6, 1e-6, 3e-6, 5e-6])),
        [0.0, 0.5e-6 * 22.5, 25e-6, 25e-6 + 62e-6, 25e-6 + 62e-6 + 66e-6],
        rtol=1e-14,
    )
    assert LIMIT.deepest == 3e-6


@pytest.mark.parametrize(
    ("sets", "pressures"),
    [
        ([0.0], [20.0]),
        ([0.0, 1e-6], [20.0, 20.0]),
        ([0.0, 0.0], [20.0, 30.0]),
        ([1e-9, 1e-6], [20.0, 30.0]),
        ([0.0, 1e-6], [0.0, 30.0]),
    ],
)
def test_a_limit_that_does_not_rise_is_refused(sets, pressures):
    """Bad input: the set would not be unique."""
    with pytest.raises(InputError, match="both increasing"):
        PressureLimit(set=np.array(sets), pressure=np.array(pressures))


def drawn(rng):
    """Random points, from one to sixty, stiff and soft, with a limit of two to nine lines."""
    n, m = int(rng.integers(1, 60)), int(rng.integers(2, 9))
    x = np.sort(rng.uniform(0.0, 1.0, n))
    C = 1e-9 * np.exp(-np.abs(x[:, None] - x) / rng.uniform(0.02, 0.5))
    C += np.eye(n) * 10.0 ** rng.uniform(-12, -9)
    limit = PressureLimit(
        set=np.append(0.0, np.cumsum(10.0 ** rng.uniform(-9, -6, m - 1))),
        pressure=1e9 * np.append(1.0, 1.0 + np.cumsum(10.0 ** rng.uniform(-4, 0, m - 1))),
    )
    area = 10.0 ** rng.uniform(-11, -8) * rng.uniform(0.5, 2.0, n)
    return C, limit, area, rng.uniform(-1.0, 1.0, n) * 10.0 ** rng.uniform(-8, -5)


@pytest.mark.slow
@each("seed", range(40))
def test_random_points_keep_the_law_as_they_are_pressed_and_let_go(seed):
    """Exact: complementarity, pressure at most at the limit, and there where the set has grown."""
    rng = np.random.default_rng(seed)
    C, limit, area, gap = drawn(rng)
    n, A = len(gap), C.copy()
    law, worn, carrying = (
        Limit(area, limit.set, limit.pressure, limit.softness),
        Worn.none(n),
        ActiveSet.none(n),
    )
    lam, after, opened = np.zeros(n), np.zeros(n), np.zeros(n)
    size = np.max(np.abs(gap))
    for step in range(25):
        load = 3.0 * np.sin(step / 4.0) + rng.uniform(-0.1, 0.1)
        q = gap + opened - load * size
        before = worn.set.copy()
        tolerance = max(1e-15, 1e-13 * np.max(np.abs(q)))
        assert (
            solve_yielding(
                A, q, law, worn, carrying, lam, after, tolerance, float(np.mean(np.diag(A)))
            )
            > 0
        )
        lost = let_yield(law, worn, lam, opened)

        g, wide = q + C @ lam + worn.set - before, np.max(np.abs(q))
        assert np.all(lam >= 0.0)
        assert np.max(np.abs(g[lam > 0.0]), initial=0.0) < 1e-8 * wide
        assert np.min(g) > -1e-8 * wide
        last = worn.set - limit.set[-1]
        most = np.interp(worn.set, limit.set, limit.pressure)
        most += np.where(last > 0.0, last / limit.softness[-1], 0.0)
        assert np.all(lam / area <= most * (1.0 + 1e-9))
        grown = worn.set > before
        np.testing.assert_allclose((lam / area)[grown], most[grown], rtol=1e-9)
        assert lost == pytest.approx(area @ (limit.loss(worn.set) - limit.loss(before)), rel=1e-9)
        np.testing.assert_allclose(opened, worn.set, rtol=1e-12)


def one_point(limit):
    """A rigid mass above one point with an area of 1 m^2."""
    model = modal_model(
        masses=(MASS, np.inf),
        omega=np.zeros(1),
        traces=np.full((1, 1), MASS**-0.5),
        compliance=np.full((1, 1), 1.0 / STIFFNESS),
        gap=np.zeros(1),
    )
    return replace(model, limit=limit)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_three_impacts_of_a_mass_on_one_point(speed):
    """Exact: energy of two straight lines, closing 1/k + 1/H and opening 1/k; order 2 in time.

    At 0.05 m/s the limit is beyond the elastic force, and nothing is lost.
    """
    first, rise = 45.0, 5e6
    limit = PressureLimit(set=np.array([0.0, 1e-6]), pressure=first + np.array([0.0, 1e-6 * rise]))
    model, energy = one_point(limit), 0.5 * MASS * speed**2
    soft = 1.0 / STIFFNESS + 1.0 / rise
    time, force, worn = np.pi * sqrt(MASS * soft), first, np.zeros(1)
    for _ in range(3):
        run = simulate_interface(
            model, speed=speed, duration=1.2 * time, step=time / 4000, worn=worn
        )
        stored = 0.5 * force**2 / STIFFNESS
        if energy > stored:
            force = sqrt(force**2 + 2.0 * (energy - stored) / soft)
        peak = min(force, speed * sqrt(MASS * STIFFNESS))
        assert run.history.force.max() == pytest.approx(peak, rel=1e-5)
        returned = 0.5 * peak**2 / STIFFNESS
        assert float(run.history.velocity_a[-1]) == pytest.approx(
            speed * sqrt(returned / energy), rel=1e-5
        )
        assert run.energy.plastic == pytest.approx(energy - returned, rel=1e-4, abs=1e-9 * energy)
        assert run.history.ledger.plastic == run.energy.plastic
        assert abs(run.energy.residual) < 1e-12
        assert run.worn[0] == pytest.approx((force - first) / rise, rel=1e-4, abs=1e-15)
        worn = run.worn


@pytest.mark.slow
def test_a_limit_that_is_not_reached_changes_nothing():
    """Definition: the same forces as of elastic points, to the round-off of 1000 steps.

    The two are compiled apart: their products are added in another order.
    """
    far = PressureLimit(set=np.array([0.0, 1e-6]), pressure=np.array([1e9, 2e9]))
    runs = [
        simulate_interface(one_point(limit), speed=0.3, duration=2e-5, step=20e-9)
        for limit in (far, None)
    ]

    force = runs[1].history.force
    np.testing.assert_allclose(runs[0].history.force, force, rtol=0.0, atol=1e-12 * force.max())
    assert not np.any(runs[0].worn)
    assert len(runs[1].worn) == 0


@pytest.mark.slow
def test_points_take_what_the_loops_take():
    """Reference: loss of the static loops, 6 %, and their force, 1 %, from 4 times first yield on.

    Below that one or two elements are in contact.
    """
    pair = ball_in_seat(size=8e-6, extent=60e-6, energy=0.5 * MASS * 0.25**2)
    loops, space = pair.loops, pair.space
    limit, n = loops.pressure_limit, space.count
    assert limit is not None
    law = Limit(space.area, limit.set, limit.pressure, limit.softness)
    start, seen = min(space.clearance, space.touch), 0
    for state, loss in zip(loops.states, loops.loss, strict=True):
        if state.force > 4.0 * loops.first_yield:
            seen += 1
            worn, lam, gap = Worn.none(n), np.zeros(n), np.zeros(n)
            q = space.gap - (start + state.approach) * space.axial
            solve_yielding(
                np.array(pair.C), q, law, worn, ActiveSet.none(n), lam, gap, 1e-16, pair.C[0, 0]
            )
            assert let_yield(law, worn, lam, gap) == pytest.approx(loss, rel=0.06)
            assert space.axial @ lam == pytest.approx(state.force, rel=0.01)
            assert worn.set.max() == pytest.approx(state.plastic_gap.max(), rel=0.1)
    assert seen > 3


@pytest.mark.slow
def test_running_in_at_the_interface_level():
    """Reference: the law with memory of the same loops; 4 % on ten elements over the contact."""
    case = read_case(SPHERES.read_text("utf-8").replace("run: {", "run: {impacts: 3, "), SPHERES)
    ran = [
        run_impact(case, levels=(level,), certify=False).running_in
        for level in ("reduced", "interface")
    ]
    assert ran[0] is not None
    assert ran[1] is not None
    assert ran[1].level == "interface"
    np.testing.assert_allclose(ran[1].peak_force, ran[0].peak_force, rtol=0.04)
    np.testing.assert_allclose(ran[1].restitution, ran[0].restitution, atol=0.02)
    assert np.all(np.diff(ran[1].set) > 0.0)


@pytest.mark.slow
def test_interface_level_agrees_with_the_law_of_the_reduced_level():
    """Reference: the law with memory of the same loops, on thirty points; 0.1 % and 0.003."""
    text = AXISYMMETRIC.read_text("utf-8").replace(
        "density: 7850 kg/m^3",
        "density: 7850 kg/m^3, yield: 600 MPa, hardening: {isotropic: 1 GPa}",
    )
    study = run_impact(
        read_case(text, AXISYMMETRIC), levels=("reduced", "interface"), certify=False
    )

    reduced, points = (study.levels[name] for name in ("reduced", "interface"))
    assert points.energies["plastic"] > 0.1 * points.energies["initial kinetic"]
    assert points.measures.peak_force == pytest.approx(reduced.measures.peak_force, rel=1e-3)
    assert points.measures.restitution == pytest.approx(reduced.measures.restitution, abs=3e-3)
    assert abs(points.energy_residual) < 1e-12


def test_the_meridian_case_of_solids():
    """Definition: the same profiles, centred, held all round, finer at the contact."""
    case = read_case(VALVE.read_text("utf-8"), VALVE)
    twin = meridian_case(case, 20e-6, 1.5)

    assert twin is not None
    assert twin.motion.speed == pytest.approx(1.5 * case.motion.speed)
    for name, body in twin.bodies.items():
        assert body.geometry.dimension == 2
        assert body.geometry.profile == case.bodies[name].geometry.profile
        assert body.mesh is not None
        assert body.mesh.contact is not None
        assert body.mesh.contact.size == pytest.approx(4e-6)
        assert all(support.sectors is None for support in body.fixed or ())
    assert meridian_case(case, 20e-6, 1.02).motion.speed == case.motion.speed


@pytest.mark.slow
@each("seed", range(12))
def test_random_bodies_that_tilt_on_points_that_yield_keep_the_energy(seed):
    """Conservation: three impacts of a rigid body off its axis, each on the faces of the last."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 40))
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    radius = 0.5e-3 * rng.uniform(0.8, 1.2, count)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)])
    points[:, 0] += rng.uniform(0.0, 0.4e-3)
    model = rigid_body(
        mass=MASS, inertia=(2e-8, 2e-8, 1e-9), points=points, stiffness=STIFFNESS / count
    )
    whole = 0.3 * sqrt(MASS * STIFFNESS)  # force of the elastic impact
    first = whole / count * 10.0 ** rng.uniform(-2.0, 0.0)
    m = int(rng.integers(2, 8))
    limit = PressureLimit(
        set=np.append(0.0, np.cumsum(10.0 ** rng.uniform(-9, -6, m - 1))),
        pressure=first * np.append(1.0, 1.0 + np.cumsum(10.0 ** rng.uniform(-2, 0, m - 1))),
    )
    worn = np.zeros(count)
    for _ in range(3):
        run = simulate_interface(
            replace(model, limit=limit), speed=0.3, duration=80e-6, step=40e-9, worn=worn
        )
        assert abs(run.energy.residual) < 1e-10
        assert run.energy.plastic >= 0.0
        assert np.all(run.worn >= worn)
        taken = np.sum(limit.loss(run.worn) - limit.loss(worn))
        assert run.energy.plastic == pytest.approx(taken, rel=1e-9, abs=1e-15)
        worn = run.worn
    assert np.any(worn > 0.0)
