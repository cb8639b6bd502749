"""Factor of a body in equal sectors, and an impact with it, against the factor of the whole matrix.

Truth: the same linear system.  Tolerances: round-off at a condition of some 1e4.
"""

import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from time import sleep

import numpy as np
import pytest
import scipy
from scipy.sparse import csr_array, diags_array

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.cyclic import cyclic_factorization
from klack.bodies.elasticity.factorization import available_backends, factorize
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.swept import sweep
from klack.transient.full_order import simulate_full_order
from klack.verification.transient import STEEL, needle_over_seat

pytestmark = pytest.mark.skipif(
    "pardiso" not in available_backends(), reason="MKL is not installed here"
)
MM, STEP = 1e-3, 100e-9


@cache
def body(bore: float, layers: int, support: str) -> ElasticBody:
    """A disc, or a ring, held at the foot: nowhere, all round, along z, in part, on the axis."""
    lines = [
        Line((4 * MM, 0), "foot"),
        Line((4 * MM, 2 * MM), "outside"),
        Line((bore, 2 * MM), "top"),
        Line((bore, 0), "bore" if bore else "axis"),
    ]
    meridian = mesh_meridian({"disc": Profile((bore, 0), tuple(lines))}, MeshSizing(size=1.5 * MM))
    mesh = sweep(meridian, layers, start_angle=0.3)
    foot = mesh.surface("foot").nodes
    x, y, _ = mesh.points[foot].T
    fixed = {
        "none": foot[:0],
        "round": 3 * foot[:, None] + np.arange(3),
        "along": 3 * foot + 2,
        "part": 3 * foot[y > 1 * MM, None] + np.arange(3),
        "axis": 3 * foot[np.hypot(x, y) < 1e-9, None] + np.arange(3),
    }[support]
    made = elastic_body("disc", mesh, {"disc": STEEL})
    return replace(made, fixed=np.sort(fixed.ravel()))


def dynamic(made: ElasticBody) -> csr_array:
    return csr_array(made.M * (4.0 / STEP**2) + made.K)


@pytest.mark.parametrize(
    ("bore", "layers", "support"),
    [
        (0.0, 6, "none"),
        (0.0, 7, "round"),
        (0.0, 8, "part"),
        (0.0, 7, "axis"),
        (0.0, 6, "along"),
        (2 * MM, 7, "part"),
        (2 * MM, 8, "round"),
    ],
)
def test_solves_are_those_of_the_whole_matrix(bore, layers, support):
    made = body(bore, layers, support)
    S, free = dynamic(made), made.free
    B = np.random.default_rng(4).standard_normal((len(free), 3))
    whole = csr_array(S[free][:, free])
    with factorize(whole) as plain:
        expected = plain.solve(B)

    with cyclic_factorization(S, made.mesh.points, made.fixed) as factor:
        products = factor.products([S, csr_array(made.M)])(B[:, 0])
    for got, A in zip(products, (S, made.M), strict=True):
        wanted = A[free][:, free] @ B[:, 0]
        assert abs(got - wanted).max() < 1e-13 * abs(wanted).max()
    for precision, tolerance in (("double", 1e-12), ("single", 1e-4)):
        factor = cyclic_factorization(S, made.mesh.points, made.fixed, precision)
        assert factor is not None
        assert factor.size == len(free)
        with factor:
            halves, one = factor.forward(B), factor.solve(B[:, 1])
            X = factor.backward(halves)
        scale = abs(expected).max()
        assert abs(X - expected).max() < tolerance * scale
        assert abs(one - expected[:, 1]).max() < tolerance * scale
        # G S^-1 b is the product of two halves
        shared = halves.T @ halves
        assert abs(shared - B.T @ expected).max() < tolerance * abs(shared).max()


def test_a_part_that_is_held_takes_little_memory_at_set_up():
    """A few times what is kept of it, beside what the sectors take without."""
    made = body(0.0, 30, "none")
    S, points = dynamic(made), made.mesh.points
    held = np.sort(np.random.default_rng(7).choice(len(points) * 3, 500, replace=False))

    def peak(fixed):
        tracemalloc.start()
        try:
            with cyclic_factorization(S, points, fixed) as factor:
                return tracemalloc.get_traced_memory()[1], factor._held.nbytes
        finally:
            tracemalloc.stop()

    (without, _), (highest, kept) = peak(held[:0]), peak(held)
    assert highest - without < 4 * kept


def test_parts_held_of_two_bodies_leave_the_threads_of_blas(monkeypatch):
    """Limits that overlap in time would restore each other's."""
    made, inside, most, plain = body(0.0, 8, "part"), [0], [0], scipy.linalg.qr

    def qr(*given, **options):
        inside[0] += 1
        most[0] = max(most[0], inside[0])
        sleep(0.05)
        inside[0] -= 1
        return plain(*given, **options)

    monkeypatch.setattr(scipy.linalg, "qr", qr)
    S = dynamic(made)
    with ThreadPoolExecutor(2) as pool:
        for factor in pool.map(
            lambda _: cyclic_factorization(S, made.mesh.points, made.fixed), "ab"
        ):
            factor.close()
    assert most[0] == 1


def test_bodies_that_do_not_repeat_are_left_alone():
    made = body(0.0, 7, "none")
    S, points, none = dynamic(made), made.mesh.points, made.fixed
    heavier = np.zeros(S.shape[0])
    heavier[-3:] = 1e-6 * S.diagonal()[-3:]

    assert cyclic_factorization(S, points, none) is not None
    assert cyclic_factorization(csr_array(S + diags_array(heavier)), points, none) is None
    assert cyclic_factorization(S, points + 1e-6, none) is None
    moved = points.copy()
    moved[len(points) // 2] *= 1.0 + 1e-6
    assert cyclic_factorization(S, moved, none) is None


@pytest.mark.slow
def test_an_impact_in_sectors_is_that_of_whole_factors(monkeypatch):
    """Forces, velocities and losses to round-off; energy as exact; two bodies turned apart."""
    a, b, space = needle_over_seat(size=60e-6, bulk=2e-3, layers=8)

    def impact(**options):
        return simulate_full_order(
            a, b, space, speed=0.5, duration=6e-6, step=STEP, energy_interval=1, **options
        )

    ours, single = impact(), impact(precision="single")
    monkeypatch.setattr("klack.transient.full_body.cyclic_factorization", lambda *given: None)
    plain = impact()

    assert "sectors" in ours.statistics.backend
    assert "sectors" not in plain.statistics.backend
    assert ours.statistics.factor_entries < 0.4 * plain.statistics.factor_entries
    peak = plain.history.force.max()
    assert peak > 1.0
    assert abs(ours.history.force - plain.history.force).max() < 1e-9 * peak
    assert abs(single.history.force - plain.history.force).max() < 1e-6 * peak
    assert abs(ours.history.velocity_a - plain.history.velocity_a).max() < 1e-10
    assert abs(ours.history.ledger.residual) < 1e-11
