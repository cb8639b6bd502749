"""Options, messages and equivalent ways of computing a full-order impact."""

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csr_array, eye_array

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.factorization import available_backends, factorize
from klack.contact.restitution import measure_impact
from klack.errors import ConvergenceError, InputError
from klack.transient import full_order
from klack.transient.full_body import (
    FullBody,
    InverseMass,
    KnownBody,
    massless_nodes,
    open_gaps,
    scalar_mass,
)
from klack.transient.full_order import recommended_step, simulate_full_order
from klack.transient.interface_solve import SplitSolve, WholeSolve
from klack.verification.transient import STEEL, rod_body, rod_contact, sphere_over_cylinder

AREA = 1e-4
needs_pardiso = pytest.mark.skipif(
    "pardiso" not in available_backends(), reason="MKL is not installed here"
)


@cache
def problem():
    return sphere_over_cylinder(
        sphere_radius=2e-3, radius=4e-3, height=6e-3, size=25e-6, bulk=1.5e-3
    )


@cache
def run(**options):
    a, b, space = problem()
    return simulate_full_order(a, b, space, speed=0.5, duration=20e-6, step=100e-9, **options)


def drop(rod: ElasticBody, wall: None = None, **options):
    space = options.pop("space", None) or rod_contact(rod, wall, area=AREA, gap=0.0)
    given = {"speed": 0.5, "duration": 2e-6, "step": 0.1e-6} | options
    return simulate_full_order(rod, wall, space, **given)


def rod(**changes) -> ElasticBody:
    return replace(rod_body("rod", STEEL, area=AREA, length=0.02, elements=20), **changes)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"backend": "superlu"}, id="superlu"),
        pytest.param({"threads": 2}, id="two threads"),
    ],
)
def test_every_way_of_solving_gives_the_same_impact(options):
    """Round-off grows over 200 steps: 1e-8 of the peak."""
    reference, other = run(), run(**options)

    scale = reference.history.force.max()
    assert other.history.force == pytest.approx(reference.history.force, abs=1e-8 * scale)
    assert other.history.velocity_a[-1] == pytest.approx(reference.history.velocity_a[-1], rel=1e-9)


@pytest.mark.slow
@needs_pardiso
def test_single_precision_changes_the_force_by_a_millionth():
    """Only increments of one step pass through the factor: 1.2e-7 measured on 62k unknowns.

    What a solve leaves of the equations is paid back, and its work is counted: energy as in double.
    """
    reference, single = run(), run(precision="single")

    scale = reference.history.force.max()
    assert not np.array_equal(single.history.force, reference.history.force)
    assert single.history.force == pytest.approx(reference.history.force, abs=3e-6 * scale)
    assert abs(single.history.ledger.residual) < 1e-11
    change = (
        single.history.ledger.contact_dissipation - reference.history.ledger.contact_dissipation
    )
    assert abs(change) < 1e-6 * reference.history.ledger.initial


@needs_pardiso
def test_single_precision_keeps_the_momentum():
    """What all solves have left, added up, is that of the last one: 6e-10; 3e-8 if it were kept."""
    history = run(precision="single").history
    impulse = history.force.sum() * history.step
    scale = history.mass_a * history.speed

    gained = history.mass_a * (history.velocity_a[-1] - history.velocity_a[0])
    taken = history.mass_b * (history.velocity_b[-1] - history.velocity_b[0])

    assert abs(gained - impulse) < 3e-9 * scale
    assert abs(taken + impulse) < 3e-9 * scale


@needs_pardiso
def test_half_and_whole_solves_agree():
    """Both give S^-1 (b + G^T lam) and G S^-1 b; points learned in two batches, some selected."""
    rng = np.random.default_rng(3)
    size, count = 400, 12
    S = csr_array(eye_array(size) * 4.0 - eye_array(size, k=1) - eye_array(size, k=-1))
    G = np.zeros((count, size))
    G[:, 180:210] = rng.standard_normal((count, 30))
    points, b, lam = np.array([1, 4, 7, 11]), rng.standard_normal(size), rng.uniform(0, 1, 4)
    with (
        factorize(S, backend="pardiso") as fast,
        factorize(S, backend="superlu") as slow,
    ):
        results = []
        for solve in (SplitSolve(fast, csr_array(G)), WholeSolve(slow, csr_array(G))):
            solve.learn(np.arange(7))
            solve.learn(np.arange(7, count))
            solve.select(points)
            solve.predict(b)
            response = solve.response()
            wrong = solve.complete(2.0 * lam)  # a first guess of the forces may be revised
            results.append((solve.compliance, response, wrong, solve.complete(lam)))

    dense = np.linalg.inv(S.toarray())
    expected = (
        G @ dense @ G.T,
        (G @ dense @ b)[points],
        dense @ (b + 2.0 * G[points].T @ lam),
        dense @ (b + G[points].T @ lam),
    )
    for result in results:
        for got, wanted in zip(result, expected, strict=True):
            np.testing.assert_allclose(got, wanted, rtol=1e-10, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["contact-stabilised-newmark", "massless"])
def test_points_that_close_unwatched_are_found(scheme, monkeypatch):
    """Watching almost nothing costs repeated steps, not accuracy."""
    reference = run(scheme=scheme)
    a, b, space = problem()
    monkeypatch.setattr(full_order, "_WATCH_STEPS", 0.02)

    blind = simulate_full_order(a, b, space, speed=0.5, duration=20e-6, step=100e-9, scheme=scheme)

    scale = reference.history.force.max()
    assert scheme != "massless" or blind.statistics.repeats > reference.statistics.repeats
    assert blind.history.force == pytest.approx(reference.history.force, abs=1e-8 * scale)


def test_mobility_adds_up_all_directions():
    """Columns of G M^-1 G^T against dense algebra, with some directions fixed."""
    a, _, _ = problem()
    rng = np.random.default_rng(5)
    G = np.zeros((4, len(a.free)))
    G[:, 100:140] = rng.standard_normal((4, 40))
    points = np.array([0, 3])
    inverse = InverseMass(a.M, a.free, 2, backend="superlu", threads=None)

    columns = inverse.mobility(csr_array(G), points)

    dense = np.linalg.solve(a.M.toarray()[np.ix_(a.free, a.free)], G.T)
    np.testing.assert_allclose(columns, (G @ dense)[:, points], rtol=1e-9)
    np.testing.assert_allclose(inverse.whole_mobility(csr_array(G)), G @ dense, rtol=1e-9)
    np.testing.assert_allclose(inverse.solve(G.T), dense, rtol=0, atol=1e-9 * abs(dense).max())
    inverse.close()


def test_velocity_of_massless_nodes_follows_the_body():
    """After the impact a compact sphere moves almost rigidly: 10 % of its speed."""
    _, _, space = problem()
    nodes = np.unique(space.G_a.indices // 2)

    result = run(scheme="massless")

    end = result.fields[0].end_velocity.reshape(-1, 2)[nodes, 1]
    assert end == pytest.approx(result.history.velocity_a[-1], rel=0.1)


def test_run_ends_early_after_the_separation():
    whole, short = run(), run(stop_after_separation=0.5e-6)

    count = short.history.force.size
    assert count < whole.history.force.size
    assert short.history.force == pytest.approx(whole.history.force[:count], rel=1e-12)
    assert short.history.impulse == pytest.approx(whole.history.impulse, rel=1e-12)


def known(bodies, space, count):
    """Lowest modes of both bodies, and their compliance at the contact points."""
    found = []
    for body, G in zip(bodies, (space.G_a, space.G_b), strict=True):
        rigid = body.rigid_modes.shape[1]
        square, X = scipy.linalg.eigh(
            *(A[body.free][:, body.free].toarray() for A in (body.K, body.M))
        )
        omega = np.sqrt(square[rigid:])
        shapes = np.zeros((body.dof_count, len(omega)))
        shapes[body.free] = X[:, rigid:]
        compliance = np.sum((G @ shapes / omega) ** 2, axis=1)
        found.append(KnownBody(modes=Modes(omega, shapes).kept(count), compliance=compliance))
    return tuple(found)


@pytest.mark.slow
def test_run_ends_where_bodies_have_parted_for_good():
    """As the run to the end, whose last steps are free flight."""
    a, b, space = problem()
    whole = run()

    short = run(known=known((a, b), space, np.arange(20)))

    assert short.statistics.steps < 0.9 * whole.statistics.steps
    assert measured(short) == pytest.approx(measured(whole), rel=1e-9)
    for name in ("force", "external_force", "velocity_a", "velocity_b"):
        one, other = getattr(short.history, name), getattr(whole.history, name)
        assert one == pytest.approx(other, rel=1e-9, abs=1e-9 * abs(other).max()), name
    assert short.history.gap == pytest.approx(whole.history.gap, abs=2e-9)  # m; up to 3 um
    assert np.array_equal(short.point_force, whole.point_force)
    assert short.approach == pytest.approx(whole.approach, rel=1e-12)
    assert abs(short.history.ledger.residual) < 1e-11
    for one, other in zip(short.history.ledger.bodies, whole.history.ledger.bodies, strict=True):
        assert one.total == pytest.approx(other.total, rel=1e-9)


def measured(result):
    found = measure_impact(result.history)
    return [getattr(found, field.name) for field in fields(found) if field.name != "impacts"]


def struck_on_a_wall():
    """A light rod on a longer one that stands on a wall, from where its wave comes back."""
    light = replace(STEEL, density=0.64 * STEEL.density)  # 0.8 of the impedance
    a = rod_body("a", light, area=AREA, length=0.02, elements=40)
    b = rod_body("b", STEEL, area=AREA, length=0.06, elements=120, bottom=-0.06)
    b = replace(b, fixed=np.array([0]))
    vars(a)["rigid_modes"] = np.full((a.dof_count, 1), a.M.sum() ** -0.5)
    vars(b)["rigid_modes"] = np.zeros((b.dof_count, 0))
    return a, b, rod_contact(a, b, area=AREA, gap=0.0)


@pytest.mark.slow
def test_a_second_contact_is_not_missed():
    """The wave of the first one comes back from the wall while the rods are apart."""
    a, b, space = struck_on_a_wall()
    options = {"speed": 1.0, "duration": 30e-6, "step": 50e-9}
    whole = simulate_full_order(a, b, space, **options)
    touches = np.flatnonzero(np.diff((whole.history.force > 0.0).astype(int), prepend=0) == 1)
    assert len(touches) > 1, "no second contact: the test has lost its point"
    assert whole.history.gap.max() > 1e-6  # m, as far apart as bodies are that never come back

    found = simulate_full_order(a, b, space, known=known((a, b), space, np.arange(30)), **options)

    assert np.array_equal(found.history.force, whole.history.force)


def test_what_no_mode_knows_is_feared():
    """Energy beyond the known modes could come back to the contact: the bound says so."""
    a, b, space = struck_on_a_wall()
    every = known((a, b), space, np.arange(20))
    bodies = [FullBody(a, space.G_a, "a", None), FullBody(b, space.G_b, "b", None)]
    for body in bodies:
        body.set_up(50e-9, "contact-stabilised-newmark", "auto", "double", 1)
    bodies[0].u = 1e-6 * bodies[0].axis  # 1 um apart, and at rest
    deep = every[1].modes.kept(np.array([9]))
    swing = 1.5e-6 / abs((space.G_b @ deep.shapes).item())
    bodies[1].v = (swing * deep.omega * deep.shapes[b.free, 0:1].T).ravel()

    def gaps(count, steps):
        modes = known((a, b), space, np.arange(count))
        return open_gaps(bodies, modes, space.gap, np.zeros(1), steps=steps, slack=1e-9)

    assert gaps(20, 1) is not None
    assert gaps(20, 400) is None  # it comes back
    assert gaps(9, 1) is None  # it might: nobody knows when
    for body in bodies:
        body.close()


def test_result_says_what_it_holds():
    a, b, space = problem()
    result = run()

    n = result.history.force.size
    assert n == 200
    assert result.point_force.shape == (n, space.count)
    # the axial force is the sum of the points, to single precision
    np.testing.assert_allclose(
        result.point_force @ space.axial, result.history.force, rtol=1e-5, atol=1e-4
    )
    assert [field.name for field in result.fields] == ["sphere", "target"]
    assert [len(field.peak_displacement) for field in result.fields] == [
        a.dof_count,
        b.dof_count,
    ]
    # Hertz: approach and deflection are some um at 0.5 m/s
    assert 1e-6 < result.approach < 4e-6
    assert result.energy.time[0] == result.history.start
    assert result.energy.time[-1] == pytest.approx(result.history.edges[-1])
    assert result.statistics.steps == n
    assert result.statistics.degrees_of_freedom == len(a.free) + len(b.free)
    assert 1.0 <= result.statistics.rounds_per_step < 2.0
    assert "full order" in result.history.solver


def test_progress_goes_up_to_one():
    seen: list[float] = []

    drop(rod(), progress=seen.append)

    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_interruption_leaves_the_inputs_alone():
    a, b, space = problem()
    gap = space.gap.copy()

    def stop(fraction: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_full_order(a, b, space, speed=0.5, duration=20e-6, progress=stop)
    np.testing.assert_array_equal(space.gap, gap)


def test_overlap_is_backed_out_and_told():
    body = rod()
    space = rod_contact(body, None, area=AREA, gap=-2e-9)

    result = drop(body, space=space)

    assert result.retraction == pytest.approx(2e-9, rel=1e-12)
    assert result.energy.strain[0, 0] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speed": -0.5}, "speed"),
        ({"step": 0.0}, "step"),
        ({"duration": float("nan")}, "duration"),
        ({"stop_after_separation": -1e-6}, "stop_after_separation"),
        ({"scheme": "trapezoidal"}, "contact-stabilised-newmark"),
    ],
)
def test_bad_numbers_are_named(options, message):
    with pytest.raises(InputError, match=message):
        drop(rod(), **options)


def test_needle_fixed_along_the_axis_is_refused():
    with pytest.raises(InputError, match="free to move"):
        drop(rod(fixed=np.array([20])))


def test_foreign_contact_space_is_refused():
    other = rod_body("other", STEEL, area=AREA, length=0.02, elements=7)
    space = rod_contact(other, None, area=AREA, gap=0.0)

    with pytest.raises(InputError, match=r"rows for 8 degrees of freedom, expected .* 21"):
        drop(rod(), space=space)


def test_sideways_contact_is_refused():
    body = rod()
    space = replace(rod_contact(body, None, area=AREA, gap=0.0), axial=np.array([0.0]))

    with pytest.raises(InputError, match="axis of motion is z"):
        drop(body, space=space)


def test_closed_rim_asks_for_more_reach():
    a, b, space = problem()
    near = space.restricted(space.gap < 0.3e-6)

    with pytest.raises(InputError, match="larger reach"):
        simulate_full_order(a, b, near, speed=0.5, duration=20e-6, step=100e-9)


def test_motion_that_is_not_finite_stops_with_its_time():
    body = rod()
    force = np.inf

    with pytest.raises(ConvergenceError, match=r"step 1, 0\.1 us"):
        drop(body, axial_force=force)


def test_mass_that_differs_between_directions_is_refused():
    M = csr_array(np.diag([1.0, 2.0, 1.0, 2.0]))

    with pytest.raises(InputError, match="the same mass matrix in every direction"):
        scalar_mass(M, 2)


def test_massless_nodes_keep_mass_and_have_none():
    """Total mass to round-off; contact rows are empty; the rest stays positive definite."""
    a, _, space = problem()
    nodes = np.unique(space.G_a.indices // 2)

    M = massless_nodes(a.M, nodes, 2)

    along = np.zeros(a.dof_count)
    along[1::2] = 1.0
    assert along @ (M @ along) == pytest.approx(a.mass, rel=1e-12)
    light = np.repeat(np.isin(np.arange(a.dof_count // 2), nodes), 2)
    assert abs(M[light]).sum() == 0.0
    rest = M[~light][:, ~light].toarray()
    np.testing.assert_allclose(rest, rest.T, rtol=0, atol=1e-18)
    assert np.linalg.eigvalsh(rest)[0] > 0


def test_recommended_step():
    assert recommended_step(22e-6) == pytest.approx(50e-9)
    with pytest.raises(InputError):
        recommended_step(0.0)
