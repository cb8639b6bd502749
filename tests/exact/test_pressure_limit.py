"""Contact points whose pressure is limited: the law, one mass on one point, the fit to loops."""

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from draws import each

from klack.analyses.impact.run import run_impact
from klack.assembling.pressure_limit import meridian_case
from klack.case.reader import read_case
from klack.contact.pressure_limit import PressureLimit
from klack.errors import InputError
from klack.transient.interface_arrays import ActiveSet, Limit, Worn
from klack.transient.interface_run import simulate_interface
from klack.transient.yielding_points import let_yield, solve_yielding
from klack.verification.interface_bodies import modal_model, rigid_body
from klack.verification.plasticity import ball_in_seat

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
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
def test_a_limit_that_is_not_reached_changes_no_bit():
    """Definition: the same forces as of elastic points."""
    far = PressureLimit(set=np.array([0.0, 1e-6]), pressure=np.array([1e9, 2e9]))
    runs = [
        simulate_interface(one_point(limit), speed=0.3, duration=2e-5, step=20e-9)
        for limit in (far, None)
    ]

    np.testing.assert_array_equal(runs[0].history.force, runs[1].history.force)
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
