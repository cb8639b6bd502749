"""Power of random sources on random receivers: what the source gives is lost or passed on."""

import numpy as np
import pytest

from klack.acoustics.coupling import couple
from klack.acoustics.interface import InterfacePoint, SourceAtMounts, freedoms_of, laplace
from klack.acoustics.isolator import Spring
from klack.errors import InputError
from klack.verification.structure_borne import KnownReceiver

POINTS = tuple(InterfacePoint(name=name) for name in "ab")
FREEDOMS = (*freedoms_of("a"), *freedoms_of("b"))


def body(draw: np.random.Generator, n: int, s: np.ndarray) -> np.ndarray:
    """Mobility of a random damped body, (k, n, n), in the units of forces and moments."""
    modes = int(draw.integers(n, 2 * n + 1))
    scale = np.where(np.arange(n) % 6 < 3, 1.0, 10.0 ** draw.uniform(0.5, 2.5))
    shapes = draw.normal(size=(modes, n)) * scale * 10.0 ** draw.uniform(-1.5, 1.5)
    omega = np.where(draw.uniform(size=modes) < 0.2, 0.0, 10.0 ** draw.uniform(1.5, 5.0, modes))
    loss = 2.0 * 10.0 ** draw.uniform(-4.0, -0.5, modes) * np.maximum(omega, 1.0)
    H = 1.0 / (omega**2 + loss * s[:, None] + s[:, None] ** 2)
    return s[:, None, None] * np.einsum("mp,km,mq->kpq", shapes, H, shapes)


def test_balance_of_200_random_sources_and_receivers() -> None:
    """Power from the source = loss of elements + power into the receiver, which is never below 0.

    The receiver's power is computed twice: by freedom, and as a form of the real part of its
    mobility.
    """
    draw = np.random.default_rng(48)
    for _ in range(200):
        f = np.sort(10.0 ** draw.uniform(1.3, 4.3, 4))
        s = laplace(f)
        n = int(draw.integers(1, 13))
        Y_S, Y_R = body(draw, n, s), body(draw, n, s)
        vf = draw.normal(size=(4, n)) + 1j * draw.normal(size=(4, n))
        source = SourceAtMounts(
            frequency=f,
            points=POINTS,
            freedoms=FREEDOMS[:n],
            free_velocity=vf,
            blocked_force=np.zeros_like(vf),
            mobility=Y_S,
        )
        receiver = KnownReceiver(points=POINTS, freedoms=FREEDOMS[:n], mobility=lambda s, Y=Y_R: Y)
        spring = Spring(
            values={int(d): 10.0 ** draw.uniform(2, 7) for d in draw.choice([1, 2, 3], 2)},
            loss_factor=float(draw.uniform(0, 0.5)),
        )
        isolators = {"a": spring} if draw.uniform() < 0.5 else {}
        joined = couple(source, receiver, isolators=isolators)
        F, g = joined.source_force, joined.force
        given = 0.5 * np.real(np.einsum("ki,ki->k", F.conj(), vf))
        kept = 0.5 * np.real(np.einsum("ki,kij,kj->k", F.conj(), Y_S, F))
        taken = 0.5 * np.real(np.einsum("ki,kij,kj->k", g.conj(), Y_R, g))
        lost = joined.power_from_source.sum(axis=1) - joined.power.sum(axis=1)
        size = np.abs(given) + kept + taken
        assert np.abs(given - kept - lost - joined.power.sum(axis=1)).max() <= 1e-9 * size.max()
        assert (np.abs(joined.power.sum(axis=1) - taken) <= 1e-9 * size).all()
        assert (joined.power.sum(axis=1) >= -1e-10 * size).all()
        assert (lost >= -1e-10 * size).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_mobilities_that_carry_no_force_are_one_error(value: float) -> None:
    """Neither side moves, or a number is none."""
    f = np.array([100.0])
    one = np.ones((1, 1), dtype=complex)
    source = SourceAtMounts(
        frequency=f,
        points=POINTS,
        freedoms=FREEDOMS[:1],
        free_velocity=one,
        blocked_force=one,
        mobility=np.full((1, 1, 1), value, dtype=complex),
    )
    receiver = KnownReceiver(
        points=POINTS, freedoms=FREEDOMS[:1], mobility=lambda s: 0.0 * one[..., None]
    )
    with pytest.raises(InputError, match="singular or not finite"):
        couple(source, receiver)
