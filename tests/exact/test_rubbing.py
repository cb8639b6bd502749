"""Forces of contact points with Coulomb friction.

Truth: the law itself on random problems, another way to solve it, its limits, and impacts on one
point with events (tests/data/friction_one_point.csv).
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from draws import each

from klack.bodies.elasticity.ring_points import RingPoints
from klack.machine.compiling.jit import njit
from klack.transient.active_set import solve_active
from klack.transient.closed_points import invert, multiply
from klack.transient.closed_rings import rings_of, solve_on_rings
from klack.transient.interface_arrays import ActiveSet, Closed, Rings
from klack.transient.rubbing import OPEN, SLIP, STICK, solve_rubbing

pytestmark = pytest.mark.slow

TABLE = Path(__file__).parents[1] / "data" / "friction_one_point.csv"
CASES = [row for row in csv.DictReader(line for line in TABLE.open() if not line.startswith("#"))]
TOLERANCE = 1e-11


def solved(A, q, mu, guess=None, closed=None, rings=None):
    lam = np.zeros(len(q)) if guess is None else guess.copy()
    w, doing = np.zeros(len(q)), np.zeros(len(mu), dtype=np.int64)
    closed = Closed.none(len(mu), len(q) // len(mu) - 1) if closed is None else closed
    rings = Rings.none() if rings is None else rings
    rounds = solve_rubbing(A, q, mu, closed, rings, lam, w, doing, TOLERANCE)
    assert rounds != 0
    return lam, w, doing, rounds


def in_turn(A, q, mu, sweeps=2000):
    """The same another way: every point satisfies its own law in turn."""
    n, lam = len(mu), np.zeros(len(q))
    stiff = np.diag(A).reshape(-1, n)
    own = stiff[1:].max(axis=0)
    for _ in range(sweeps):
        before = lam.copy()
        for k in range(n):
            lam[k] = max(0.0, lam[k] - (q[k] + A[k] @ lam) / stiff[0, k])
            rows = slice(n + k, None, n)
            tau = lam[rows] - (q[rows] + A[rows] @ lam) / own[k]
            lam[rows] = tau * min(1.0, mu[k] * lam[k] / max(np.linalg.norm(tau), 1e-300))
        if np.abs(lam - before).max() < 1e-14:
            return lam
    return None


def broken(A, q, mu, lam):
    """How far forces are from the law: gaps, forces, discs and the most that friction can take."""
    n = len(mu)
    w = q + A @ lam
    normal, gap = lam[:n], w[:n]
    across, slip = lam[n:].reshape(-1, n), w[n:].reshape(-1, n)
    bound = mu * normal
    return max(
        -normal.min(),
        -gap.min(),
        np.abs(normal * gap).max(),
        (np.linalg.norm(across, axis=0) - bound).max(),
        np.abs(bound * np.linalg.norm(slip, axis=0) + (across * slip).sum(axis=0)).max(),
    )


def problem(seed, ways, coefficient=None, most=20, own=1.0):
    """A random one: as stiff in one direction as in another, by a factor of some."""
    rng = np.random.default_rng([seed, ways])
    n = int(rng.integers(1, most))
    G = rng.normal(size=((ways + 1) * n, (ways + 1) * n + 3))
    A = G @ G.T / len(G) + own * np.diag(rng.uniform(0.2, 2.0, len(G)))
    mu = np.full(n, rng.choice([0.05, 0.1, 0.3, 0.6]) if coefficient is None else coefficient)
    return A, rng.normal(size=len(G)), mu


@each("ways", [1, 2])
@each("seed", range(40))
def test_forces_obey_the_law(seed, ways):
    A, q, mu = problem(seed, ways)
    lam, w, doing, _ = solved(A, q, mu)
    n = len(mu)
    np.testing.assert_allclose(w, q + A @ lam, atol=1e-12)
    normal, gap = lam[:n], w[:n]
    across, slip = lam[n:].reshape(ways, n), w[n:].reshape(ways, n)
    assert normal.min() >= 0.0
    assert gap.min() > -1e-9
    assert np.abs(normal * gap).max() < 1e-9
    size = np.linalg.norm(across, axis=0)
    assert np.all(size <= mu * normal + 1e-9)
    assert np.abs(slip[:, doing == STICK]).max(initial=0.0) < 1e-9
    assert size[doing == OPEN].max(initial=0.0) == 0.0
    rubbing = doing == SLIP
    way = slip[:, rubbing] / np.linalg.norm(slip[:, rubbing], axis=0)
    np.testing.assert_allclose(across[:, rubbing], -(mu * normal)[rubbing] * way, atol=1e-7)


@each("ways", [1, 2])
@each("seed", range(10))
def test_taking_turns_gives_the_same(seed, ways):
    A, q, mu = problem(seed, ways)
    np.testing.assert_allclose(solved(A, q, mu)[0], in_turn(A, q, mu), atol=1e-8)


@pytest.mark.parametrize("ways", [1, 2])
@pytest.mark.parametrize("coefficient", [0.0, 0.05, 0.3, 0.9, 2.0])
def test_points_close_stick_slip_and_open_in_a_sequence(ways, coefficient):
    """Each step from the step before, with what it carries along; the same as from nothing."""
    seen, rounds = set(), []
    for seed in range(8):
        A, q, mu = problem(seed, ways, coefficient, most=60)
        closed, lam, before = Closed.none(len(mu), ways), np.zeros(len(q)), None
        drift = np.random.default_rng(seed).normal(size=len(q))
        for step in range(40):
            now = q + 1.5 * np.sin(0.08 * step) * drift
            lam, w, doing, count = solved(A, now, mu, lam, closed)
            assert broken(A, now, mu, lam) < 1e-9
            shut = lam[: len(mu)] > 0.0
            rows = np.tile(shut, ways + 1)
            np.testing.assert_allclose(w[rows], (now + A @ lam)[rows], atol=1e-11)
            if before is not None:
                seen |= set(zip(before, doing, strict=True))
                rounds.append(count)
            before = doing
            if step % 10 == 9:
                np.testing.assert_allclose(solved(A, now, mu)[0], lam, atol=1e-8)
    moves = {(OPEN, SLIP), (SLIP, OPEN)}
    assert moves | ({(STICK, SLIP), (SLIP, STICK)} if coefficient else set()) <= seen
    assert min(rounds) > 0
    assert np.mean(rounds) < 9.0  # 8.6 at most; a fresh inverse costs many of them


def test_where_newtons_method_does_not_end_points_take_turns():
    """Hardly any compliance of its own and much friction: negative rounds, and the law holds."""
    turns = 0
    for seed in range(12):
        A, q, mu = problem(seed, 2, 2.0, own=0.01)
        lam, _, _, rounds = solved(A, q, mu)
        assert broken(A, q, mu, lam) < 1e-8
        turns += rounds < 0
    assert turns > 0


@pytest.mark.parametrize("ways", [1, 2])
def test_the_next_step_takes_few_rounds(ways):
    """Few for Newton's method with an inverse that lags; taking turns is never needed."""
    counts = []
    for seed in range(30):
        A, q, mu = problem(seed, ways)
        first = solved(A, q, mu)[0]
        drift = 0.02 * np.random.default_rng(seed).normal(size=len(q))
        counts.append(solved(A, q + drift, mu, guess=first)[3])
    assert min(counts) > 0
    assert np.mean(counts) < 5.0


@pytest.mark.parametrize("ways", [1, 2])
def test_without_friction_it_is_the_smooth_contact(ways):
    A, q, mu = problem(3, ways, 0.0)
    n = len(mu)
    lam, gap = np.zeros(n), np.zeros(n)
    normal = np.ascontiguousarray(A[:n, :n])
    solve_active(normal, q[:n], ActiveSet.none(n), lam, gap, 1e-13, 1.0)
    found = solved(A, q, mu)[0]
    np.testing.assert_allclose(found[:n], lam, atol=1e-9)
    assert not found[n:].any()


@pytest.mark.parametrize("ways", [1, 2])
def test_with_much_friction_what_is_closed_sticks(ways):
    A, q, mu = problem(5, ways, 1e3)
    n = len(mu)
    A[:n, n:] *= 0.1  # strong coupling may leave no solution for so much friction
    A[n:, :n] *= 0.1
    _, w, doing, _ = solved(A, q, mu)
    assert STICK in doing
    assert SLIP not in doing
    assert np.abs(w[n:].reshape(ways, -1)[:, doing == STICK]).max() < 1e-9


def test_directions_of_the_frame_do_not_matter():
    """Each point has its own two directions; forces turn with them."""
    A, q, mu = problem(7, 2)
    n = len(mu)
    angle = np.random.default_rng(1).uniform(0.0, 6.0, n)
    c, s = np.diag(np.cos(angle)), np.diag(np.sin(angle))
    none = np.zeros((n, n))
    turn = np.block([[np.eye(n), none, none], [none, c, s], [none, -s, c]])
    lam = solved(A, q, mu)[0]
    turned = solved(np.ascontiguousarray(turn @ A @ turn.T), turn @ q, mu)[0]
    np.testing.assert_allclose(turned, turn @ lam, atol=1e-9)


def impact(case, steps):
    """Velocities after an impact in steps of constant mean force, as of the interface level."""
    names = ("m11", "m12", "m22", "mu", "vt0", "vn0", "kn", "kt", "contact_time")
    m11, m12, m22, mu, vt, vn, kn, kt, time = (float(case[name]) for name in names)
    mobility, soft = np.array([[m22, m12], [m12, m11]]), np.diag([1.0 / kn, 1.0 / kt])
    h = time / steps
    A = soft + 0.25 * h * h * mobility
    x, v, lam, offset = np.zeros(2), np.array([vn, vt]), np.zeros(2), 0.0
    while True:
        free = x + h * v + 0.25 * h * h * mobility @ lam
        new = solved(A, free - [0.0, offset], np.array([mu]), guess=lam)[0]
        mean = 0.5 * (lam + new)
        x, v = x + h * v + 0.5 * h * h * mobility @ mean, v + h * mobility @ mean
        lam, offset = new, x[1] + new[1] / kt
        if lam[0] == 0.0 and v[0] > 0.0:
            return v[::-1]


def missed(case, steps):
    vt, vn = impact(case, steps)
    speed = np.hypot(float(case["vt0"]), float(case["vn0"]))
    return max(abs(vt - float(case["vt1"])), abs(vn - float(case["vn1"]))) / speed


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case['case']}-{case['vt0']}")
def test_impacts_on_one_point_stick_slip_reverse_and_jam(case):
    """Truth: the same by events; 400 steps for each contact."""
    assert missed(case, 400) < 1e-4


def test_errors_fall_with_the_square_of_the_step():
    coarse, fine = (np.median([missed(case, n) for case in CASES]) for n in (100, 400))
    assert coarse / fine > 12.0


def test_faces_that_close_and_turn_round_as_a_whole_take_few_rounds():
    """Points on a half-plane: their compliance is large together and small one by one."""
    at = np.linspace(0.0, 1.0, 16)
    kernel = 3.0 - np.log(np.abs(at[:, None] - at) + 0.03)
    A, mu = np.kron(np.eye(2), kernel), np.full(16, 0.1)
    gap = 1.0 * (at - 0.45) ** 2
    q = np.concatenate([gap - 0.5, np.full(16, -0.5)])
    lam, w, doing = np.zeros(32), np.empty(32), np.zeros(16, dtype=np.int64)
    assert 0 < solve_rubbing(A, q, mu, Closed.none(16, 1), Rings.none(), lam, w, doing, 1e-12) < 10
    closed = lam[:16] > 0
    assert 4 < closed.sum() < 16  # the rest opens on the way
    np.testing.assert_allclose(lam[16:], mu * lam[:16], atol=1e-12)
    for move, state in ((0.01, STICK), (1.0, SLIP)):
        again, back = lam.copy(), np.concatenate([q[:16], move - kernel @ lam[16:]])
        assert (
            0
            < solve_rubbing(A, back, mu, Closed.none(16, 1), Rings.none(), again, w, doing, 1e-12)
            < 10
        )
        assert np.any(doing == state)
        if state == SLIP:
            np.testing.assert_allclose(again[16:], -mu * again[:16], atol=1e-12)


def ring_compliance(rng, rings, angles):
    """Of all rings in three directions; near rings move each other, most in low orders."""
    spectrum = np.empty((angles // 2 + 1, 3 * rings, 3 * rings))
    near = np.exp(-0.5 * np.abs(np.subtract.outer(np.arange(rings), np.arange(rings))))
    for order in range(len(spectrum)):
        G = rng.normal(size=(3, 3, 5))
        both = np.einsum("ijk,ljk->il", G, G) / 15.0 + 0.5 * np.eye(3)
        spectrum[order] = np.kron(both, near) / (1.0 + order)
    row = np.repeat(np.arange(3 * rings), angles)
    points = RingPoints(
        row=row,
        turn=np.tile(np.arange(angles), 3 * rings),
        count=angles,
        is_sine=np.arange(3 * rings) >= 2 * rings,
    )
    return points.compliance(spectrum)


@njit
def newton_twice(rings, closed, missed):
    """Solution with Newton's matrix to 1e-10 of the residual by the rings, and by its inverse."""
    found, other, last = np.empty(len(missed)), np.empty(len(missed)), closed.counts[2]
    solve_on_rings(rings, closed, missed, 1e-10, found)
    invert(closed, True)
    multiply(closed.inverse, len(missed), missed, other)
    closed.counts[2] = last
    return found, other


@pytest.mark.parametrize("angles", [9, 12])
@pytest.mark.parametrize("coefficient", [0.0, 0.6])
def test_rings_find_the_forces_of_the_inverse_while_points_open_stick_and_slip(angles, coefficient):
    """From few closed points, where both invert, to most of them and back.

    Compliances of whole rings are random, their orders those of tests/exact/test_ring_points.py.
    Forces are of the order of 1; the residual of both is 1e-11, times the condition of A, 300.
    """
    rng = np.random.default_rng([angles, int(10 * coefficient)])
    A = ring_compliance(rng, 16, angles)
    n = 16 * angles
    rings, mu = rings_of(A, angles), np.full(n, coefficient)
    start, drift = 0.3 * rng.normal(size=3 * n), 0.3 * rng.normal(size=3 * n)
    both = Closed.none(n, 2), Closed.none(n, 2)
    lam, seen, listed = np.zeros(3 * n), set(), []
    for step in range(13):
        q = start + np.sin(0.5 * step) * drift
        q[:n] -= 20.0 * np.sin(0.26 * step) - 6.0
        other = solved(A, q, mu, lam, both[1])[0]
        lam, w, doing, _ = solved(A, q, mu, lam, both[0], rings)
        np.testing.assert_allclose(lam, other, atol=1e-8)
        np.testing.assert_allclose(w, q + A @ lam, atol=1e-12 * n)
        assert broken(A, q, mu, lam) < 1e-9
        seen |= set(doing)
        listed.append(both[0].counts[2] < 0)
        if listed[-1]:
            missed = rng.normal(size=both[0].counts[1])
            found = newton_twice(rings, both[0], missed)
            np.testing.assert_allclose(*found, atol=1e-7 * np.abs(found[1]).max())
    assert 6 < sum(listed) < 11
    assert seen == ({OPEN, STICK, SLIP} if coefficient else {OPEN, SLIP})


def test_points_that_are_alike_round_no_ring_have_none():
    rng = np.random.default_rng(1)
    A = ring_compliance(rng, 4, 8)
    assert len(rings_of(A, 8).place) == 4
    assert len(rings_of(A, 0).place) == 0
    uneven = A.copy()
    uneven[5, 5] *= 1.0 + 1e-6
    assert len(rings_of(uneven, 8).place) == 0
