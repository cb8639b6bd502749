r"""What a Craig-Bampton body does at its mounts: blocked force, free velocity, mobility.

With :math:`H_i = 1/(\omega_i^2 + 2 \zeta_i \omega_i s + s^2)` and forces on ports of which
:math:`\Phi^T f` falls on the modes and :math:`\Psi^T f` on the mounts,

.. math:: F_{bl} = \Psi^T f - s^2 \sum_i P_i^T H_i\, \varphi_i^T f, \qquad
          Y_S^{-1} = \frac 1s \Big[ K_b + s C_b + s^2 M_b - s^4 \sum_i P_i^T H_i P_i \Big], \qquad
          v_f = Y_S F_{bl} .

The blocked force is the momentum form: at rest it is exact for any number of modes, where a sum of
their spring forces is not. Neither is :math:`Y_S` inverted to find the force, nor do rigid motions
need a form of their own: the bracket is the dynamic stiffness of the free body, regular at every
frequency above zero but for undamped resonances.
"""

from collections.abc import Sequence

import numpy as np
import scipy

from klack.acoustics.interface import (
    Complexes,
    Freedom,
    InterfacePoint,
    SourceAtMounts,
    laplace,
)
from klack.arrays import Matrix, Vector
from klack.bodies.reduction.craig_bampton import CraigBampton

__all__ = [
    "blocked_force",
    "freedoms_of_bodies",
    "mount_impedance",
    "points_of",
    "source_at_mounts",
    "spectra_of_means",
]


def blocked_force(body: CraigBampton, forces: Complexes, s: Complexes) -> Complexes:
    """Force on mounts that are held (k, n) from forces at the ports (k, p)."""
    on_modes = forces @ body.port_shapes.T
    return np.asarray(
        forces @ body.port_motion.T
        - (s**2)[:, None] * ((_receptance(body, s) * on_modes) @ body.participation)
    )


def mount_impedance(body: CraigBampton, s: Complexes) -> Complexes:
    """Force per velocity at the mounts of the free body, shape (k, n, n)."""
    n, P = len(body.mounts), body.participation
    pairs = (P[:, :, None] * P[:, None, :]).reshape(-1, n * n)
    at = s[:, None, None]
    carried = (_receptance(body, s) @ pairs).reshape(-1, n, n)
    return body.stiffness / at + body.loss + at * (body.mass - at**2 * carried)


def points_of(bodies: Sequence[CraigBampton]) -> tuple[InterfacePoint, ...]:
    """Mounts of bodies, each once."""
    places = {
        mount: place
        for body in bodies
        for mount, place in zip(body.mounts, body.references, strict=True)
    }
    return tuple(InterfacePoint(name=name, position=place) for name, place in places.items())


def freedoms_of_bodies(
    bodies: Sequence[CraigBampton], points: Sequence[InterfacePoint]
) -> tuple[Freedom, ...]:
    """Motions of mounts that bodies share, each once, in the order of the points."""
    found = {pair for body in bodies for pair in zip(body.mounts, body.directions, strict=True)}
    order = [point.name for point in points]
    return tuple(
        Freedom(*pair) for pair in sorted(found, key=lambda pair: (order.index(pair[0]), pair[1]))
    )


def source_at_mounts(
    bodies: Sequence[CraigBampton],
    forces: Sequence[Complexes],
    points: tuple[InterfacePoint, ...],
    frequency: Vector,
    *,
    shift: float = 0.0,
) -> SourceAtMounts:
    """Bodies that share their mounts as one source.

    Parameters
    ----------
    bodies
        Freedoms of equal mount and direction move together.
    forces (k, p) each [N/Hz]
        At the ports of each body.
    points
        All mounts, in the order of the freedoms.
    frequency (k,) [Hz]
    shift [1/s]
    """
    s = laplace(frequency, shift)
    freedoms = freedoms_of_bodies(bodies, points)
    n = len(freedoms)
    F, Z = np.zeros((s.size, n), dtype=complex), np.zeros((s.size, n, n), dtype=complex)
    for body, force in zip(bodies, forces, strict=True):
        own = zip(body.mounts, body.directions, strict=True)
        places = [freedoms.index(Freedom(*pair)) for pair in own]
        F[:, places] += blocked_force(body, force, s)
        Z[:, np.array(places)[:, None], places] += mount_impedance(body, s)
    # moments and forces differ in unit: rows and columns by their sizes before the inverse
    size = np.sqrt(np.abs(np.einsum("kii->ki", Z)))
    scaled = Z / (size[:, :, None] * size[:, None, :])
    Y = np.linalg.inv(scaled) / (size[:, :, None] * size[:, None, :])
    Y = (Y + Y.transpose(0, 2, 1)) / 2.0
    return SourceAtMounts(
        frequency=frequency,
        points=points,
        freedoms=freedoms,
        free_velocity=(Y @ F[..., None])[..., 0],
        blocked_force=F,
        mobility=Y,
        shift=shift,
    )


def _receptance(body: CraigBampton, s: Complexes) -> Complexes:
    at = s[:, None]
    return np.asarray(1.0 / (body.omega**2 + 2.0 * body.damping * body.omega * at + at**2))


def spectra_of_means(
    step: float,
    values: Matrix,
    ends: tuple[Vector, Vector],
    frequency: Vector,
    shift: float = 0.0,
) -> Complexes:
    r"""Spectra of signals known as means over steps, :math:`\int f e^{-st}\,\mathrm dt`, (k, p).

    What has acted before the first step is taken off, what acts after the last one stays.

    Parameters
    ----------
    values (t, p) [N]
    ends (p,) each [N]
        Before and after.
    frequency (k,) [Hz]
        At even distances; above 0 where ``shift`` is 0.
    """
    (before, after), s = ends, laplace(frequency, shift)
    changes = values - before
    count, apart = frequency.size, float(frequency[-1] - frequency[0]) / max(frequency.size - 1, 1)
    first = np.exp(s[0] * step)
    turn = np.exp(-2j * np.pi * apart * step)
    sums = scipy.signal.czt(changes, count, turn, first, axis=0)
    half = 0.5 * s * step
    # a mean over a step is the signal times sinh(x)/x in the spectrum
    whole = sums * (step * np.exp(-half) * half / np.sinh(half))[:, None]
    # summed to infinity in the same way, so that what stays has no jump at the end of the record
    last = np.exp(-s * step * len(values)) * step * half / (2.0 * np.sinh(half) ** 2)
    return np.asarray(whole + last[:, None] * (after - before))
