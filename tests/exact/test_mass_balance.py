"""Mass balances of many volumes, over the links between them.

Truth: rational arithmetic.  Volumes that hold next to nothing are joined by wide channels: their
storage is below the round-off of what the channels let through.

Truth: a dense solution by NumPy, also of masses and energies of gas, and by SciPy for one step of
a network; conservation of mass.
"""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from draws import each
from numba import njit
from scipy.optimize import root

from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.gas.gas_step import HEAD, _solve
from klack.hydraulics.mass_balance import find_links, solve_mass_balance
from klack.network.network import Network
from klack.network.step_function import evaluate, first, pointers
from klack.simulation.network_run import simulate_network
from klack.verification.benches import AMBIENT, HEPTANE, component

TABLE = fluid_table(HEPTANE, AMBIENT.pressure)
STEP = 1e-6  # [s]


def structures(n, rng):
    """Pairs of volumes that exchange mass, by the name of their structure."""
    parents = [(int(rng.integers(0, i)), i) for i in range(1, n)]
    half = n // 2
    return {
        "chain": [(i, i + 1) for i in range(n - 1)],
        "ring": [(i, (i + 1) % n) for i in range(n)] if n > 2 else [(0, 1)],
        "star": [(i, 0) for i in range(1, n)],
        "tree": parents,
        "tree with shortcuts": parents
        + [tuple(map(int, rng.choice(n, 2, replace=False))) for _ in range(n // 3)],
        "all with all": list(combinations(range(n), 2)),
        "two parts": [(i, i + 1) for i in range(n - 1) if i + 1 != half],
    }


STRUCTURES = tuple(structures(4, np.random.default_rng(0)))


@njit
def eliminate(links, into, own, r):
    solve_mass_balance(pointers(links), first(into), first(own), first(r))


def solved(storage, channels, r):
    """Answer to ``r`` of volumes with these storages, and of channels with slopes up and down."""
    links = find_links(len(storage), tuple(pair for pair, _, _ in channels))
    into, own, x = np.zeros(2 * len(links.later) + 2), storage.copy(), r.copy()
    for n, (_, up, down) in enumerate(channels):
        into[links.place[2 * n]] += down
        into[links.place[2 * n + 1]] += up
    eliminate(links, into, own, x)
    return x


def dense(storage, channels, number=float):
    """The matrix of :func:`solved`."""
    n = len(storage)
    A = [[number(storage[i] if i == j else 0) for j in range(n)] for i in range(n)]
    for (a, b), up, down in channels:
        A[a][a] += number(up)
        A[b][a] -= number(up)
        A[a][b] -= number(down)
        A[b][b] += number(down)
    return A


def exactly(storage, channels, r):
    """Solve by elimination with fractions."""
    n, A = len(storage), dense(storage, channels, Fraction)
    x = [Fraction(value) for value in r]
    for k in range(n):
        for i in range(k + 1, n):
            c = A[i][k] / A[k][k]
            for j in range(k, n):
                A[i][j] -= c * A[k][j]
            x[i] -= c * x[k]
    for k in reversed(range(n)):
        x[k] = (x[k] - sum(A[k][j] * x[j] for j in range(k + 1, n))) / A[k][k]
    return [float(value) for value in x]


@each("seed", range(8))
@each("structure", STRUCTURES)
def test_storage_below_the_round_off_of_the_flow_is_not_lost(structure, seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    storage = 10.0 ** rng.uniform(-40.0, -10.0, n)
    pairs = structures(n, rng)[structure]
    channels = [(pair, *10.0 ** rng.uniform(-16.0, -4.0, 2)) for pair in pairs]
    r = 10.0 ** rng.uniform(-20.0, -10.0, n)

    x = solved(storage, channels, r)

    # no operation subtracts: every one of some n^3 leaves its round-off
    np.testing.assert_allclose(x, exactly(storage, channels, r), rtol=n**3 * 4e-16)


@each("n", [1, 2, 3, 5, 30, 60])
@each("structure", STRUCTURES)
def test_answers_are_those_of_a_dense_solution(structure, n):
    rng = np.random.default_rng(n)
    pairs = structures(n, rng)[structure] if n > 1 else []
    channels = [(pair, *rng.uniform(0.0, 1.0, 2)) for pair in pairs]
    # some channels are shut, some let through one way only
    channels = [
        (pair, up * (k % 3 > 0), down * (k % 4 > 0)) for k, (pair, up, down) in enumerate(channels)
    ]
    channels.append(((0, 0), 0.3, 0.2))  # from a volume into itself: nothing
    storage, r = rng.uniform(0.01, 1.0, n), rng.standard_normal(n)

    x = solved(storage, channels, r)

    A = np.array(dense(storage, channels[:-1]))
    size = np.abs(np.linalg.solve(A, np.abs(r))).max()  # its inverse has no number below zero
    np.testing.assert_allclose(x, np.linalg.solve(A, r), rtol=0.0, atol=1e-12 * size)


@njit
def eliminate_gas(par, A, r):
    return _solve(first(par), first(A), r)


@each("n", [1, 2, 3, 8, 40])
@each("structure", STRUCTURES)
def test_blocks_of_gas_are_solved_as_a_dense_matrix(structure, n):
    """Two equations a chamber; those of energy are a thousand times as large."""
    rng = np.random.default_rng(n)
    pairs = structures(n, rng)[structure] if n > 1 else []
    _, *arrays = links = find_links(n, tuple(pairs))
    starts = HEAD + np.cumsum([0, *map(len, arrays)])
    par = np.concatenate([np.zeros(HEAD), *arrays])
    par[0], par[14:HEAD] = n, starts[:-1]
    dense = np.zeros((n, n, 2, 2))
    for a, b in {frozenset(pair) for pair in pairs}:
        dense[a, b], dense[b, a] = rng.standard_normal((2, 2, 2))
    for k in range(n):
        dense[k, k] = rng.standard_normal((2, 2)) + 6.0 * n * np.eye(2)[:: rng.choice([1, -1])]
    dense[:, :, 1] *= 1e3
    right = rng.standard_normal((n, 2))
    blocks = np.zeros((n + 2 * len(links.later), 2, 2))
    blocks[:n] = dense[range(n), range(n)]
    for (a, b), into_a, into_b in zip(pairs, links.place[::2], links.place[1::2], strict=True):
        blocks[n + into_a], blocks[n + into_b] = dense[a, b], dense[b, a]
    A = np.concatenate([blocks.ravel(), right.ravel()])

    assert eliminate_gas(par, A, blocks.size)

    matrix = dense.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n)
    expected = np.linalg.solve(matrix, right.ravel())
    np.testing.assert_allclose(
        A[blocks.size :], expected, rtol=0.0, atol=1e-12 * np.abs(expected).max()
    )


@each("n", [3, 10, 200])
def test_elimination_makes_few_links(n):
    rng = np.random.default_rng(n)
    by_structure = structures(n, rng)
    links = {name: len(find_links(n, tuple(pairs)).later) for name, pairs in by_structure.items()}

    for name in ("chain", "star", "tree", "two parts"):
        assert links[name] == len(by_structure[name])
    assert links["ring"] == 2 * n - 3  # of each polygon: its triangulation
    assert links["all with all"] == n * (n - 1) // 2


def test_a_chain_is_eliminated_from_both_ends():
    links = find_links(6, tuple((i, i + 1) for i in range(5)))
    assert links.order.tolist() == [0, 5, 1, 4, 2, 3]


def network(structure, n, rng):
    """Rows of chambers at pressures of their own, joined by orifices and check valves."""
    parts = {"needle": component("rigid-mass", mass=1e-3)}
    parts["spring"] = component("spring", stiffness=1e4, preload=0.0)
    joints = [[f"v{i}.fluid"] for i in range(n)]
    for i in range(n):
        volume, pressure = 10.0 ** rng.uniform(-9.0, -7.0), rng.uniform(2e5, 60e5)
        parts[f"v{i}"] = component("chamber", volume=volume, pressure=pressure)
    for k, (a, b) in enumerate(structures(n, rng)[structure]):
        parts[f"c{k}"] = component("orifice", diameter=10.0 ** rng.uniform(-4.0, -3.0))
        if k % 3 == 1:
            parts[f"c{k}"] = component(
                "check-valve", cracking_pressure=1e5, open_pressure=8e5, diameter=5e-4
            )
        joints[a].append(f"c{k}.a")
        joints[b].append(f"c{k}.b")
    return Network(parts, [["needle.body", "spring.end"], *joints], fluid=HEPTANE).rows()


def run(rows, duration):
    return simulate_network(
        rows, duration=duration, step=STEP, coarse=1, record=duration, start="free"
    )


def pressures(rows, result):
    """Of each volume at the start and at the end, in the order of their handles."""
    names = [node.component for node in rows.nodes.values() if node.volume > 0.0]
    return np.array([result.channels[f"{name} pressure"].values[[0, -1]] for name in names]).T


def densities(p):
    return np.array([fluid_at(TABLE, value, 0)[0] for value in p])


@each("n", [4, 5, 12])
@each("structure", STRUCTURES)
def test_one_step_of_a_network_is_that_of_scipy(structure, n):
    """The first step of a run is fully implicit: ``V (rho_1 - rho_0) = h sum mdot(p_1)``."""
    rows = network(structure, n, np.random.default_rng(n))
    place = {
        handle: i
        for i, (handle, node) in enumerate(
            (handle, node) for handle, node in rows.nodes.items() if node.volume > 0.0
        )
    }
    volume = np.array([rows.nodes[handle].volume for handle in place])
    before, after = pressures(rows, run(rows, STEP))
    held = volume * densities(before)

    def missing(share):
        p = share * before
        rho = densities(p)
        left = volume * rho - held
        for row in rows.branches:
            a, b = place[row.a], place[row.b]
            inputs = [0.0, STEP, p[a], p[b], rho[a], rho[b]]
            count = 3 + len(row.state) + len(row.books)
            mdot = evaluate(row.step, row.parameters, row.state, inputs, count)[1][0]
            left[a] += STEP * mdot
            left[b] -= STEP * mdot
        return left / held

    found = root(missing, np.ones(n), tol=1e-13)
    assert np.ptp(after / before) > 1e-3  # something happened
    # what is left of the last Newton step
    np.testing.assert_allclose(after, found.x * before, rtol=1e-8)


@each("structure", STRUCTURES)
def test_many_volumes_keep_their_fluid(structure):
    rows = network(structure, 40 if structure != "all with all" else 12, np.random.default_rng(7))
    volume = np.array([node.volume for node in rows.nodes.values() if node.volume > 0.0])

    result = run(rows, 40e-6)

    before, after = (volume * densities(p) for p in pressures(rows, result))
    assert np.abs(after - before).max() > 1e-4 * before.max()
    assert after.sum() == pytest.approx(before.sum(), rel=1e-12, abs=0.0)
    assert result.books.relative_residual < 1e-9
