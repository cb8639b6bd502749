"""The linear equations of the pressures in a step.

Truth: rational arithmetic.  Volumes that hold next to nothing are joined by wide channels: their
storage is below the round-off of what the channels let through.
"""

from fractions import Fraction

import numpy as np
from draws import each
from numba import njit

from klack.network.step_function import first
from klack.simulation.mass_balance import solve_mass_balance


@njit
def solved(A, own, r):
    solve_mass_balance(first(A), first(own), first(r), len(r))


def exactly(storage, channels, r):
    """Solve by elimination with fractions."""
    n = len(storage)
    A = [[Fraction(0)] * n for _ in range(n)]
    for i, value in enumerate(storage):
        A[i][i] = Fraction(value)
    for (a, b), (up, down) in channels.items():
        A[a][a] += Fraction(up)
        A[b][a] -= Fraction(up)
        A[a][b] -= Fraction(down)
        A[b][b] += Fraction(down)
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


@each("seed", range(20))
def test_storage_below_the_round_off_of_the_flow_is_not_lost(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    storage = 10.0 ** rng.uniform(-40.0, -10.0, n)
    pairs = [(i, i + 1) for i in range(n - 1)] + [(0, n - 1)] * (n > 2)
    channels = {pair: 10.0 ** rng.uniform(-16.0, -4.0, 2) for pair in pairs}
    r = 10.0 ** rng.uniform(-20.0, -10.0, n)
    A, own, x = np.zeros(n * n), storage.copy(), r.copy()
    for (a, b), (up, down) in channels.items():
        A[b * n + a] -= up
        A[a * n + b] -= down

    solved(A, own, x)

    # no operation subtracts: every one of some n^3 leaves its round-off
    np.testing.assert_allclose(x, exactly(storage, channels, r), rtol=n**3 * 4e-16)
