r"""Attachment modes: deflections that give a truncated basis its static share back.

The static deflection under the load ``b`` of a port, less the part that the retained modes carry,
is the residual attachment mode (MacNeal 1971; Craig & Kurdila 2006, ch. 17)

.. math:: \psi = K^{+} b - \sum_{i=1}^{m} \varphi_i \frac{\varphi_i^T b}{\omega_i^2},
          \qquad K^{+} = K^{-1} \text{ or } P^T K^{-}_{iso} P, \quad P = I - M R R^T

with inertia relief for a free body. A sum over omitted modes, it is M- and K-orthogonal to the
retained and rigid ones, and is diagonalised among those of other ports. The static compliance at
the ports is exact for any number of modes: ``psi^T K psi = psi^T b``, hence ``(psi^T b)^2 / (psi^T
K psi) = b^T psi``.

The shifted attachment mode (Dietz 1999: frequency response modes) does without inertia relief:

.. math:: \psi_s = (K - s M)^{-1} b - \text{its rigid and retained modal part}

The response at ``omega^2 = s`` is then exact at every node, not at the port alone (Galerkin's
solution is exact where that lies in the basis). Each shift adds one mode per port. A negative
shift makes ``K - s M`` positive definite, body free or not; a positive one is exact at the
frequency ``sqrt(s) / 2 pi``, and must stay away from the eigenfrequencies, where the response is
that eigenmode alone. All are made M-orthonormal, to the rigid and retained modes and among each
other, and K-diagonal (Rayleigh-Ritz); nearly parallel ones would be a basis of round-off and are
rejected. With :func:`default_shift`, ``s = -omega_1^2``, far below every omitted mode, the static
response has an error of the order ``(omega_1 / omega_{m+1})^4``; with two shifts far below, ``(s_1
/ omega_{m+1}^2)^2 (s_2 / omega_{m+1}^2)^2``.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
import scipy
from scipy.sparse import csr_array

from klack.arrays import Floats
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.dynamic_stiffness import Solver, factorized_symmetric
from klack.errors import InputError
from klack.machine.cache.entry import Entry
from klack.units import format_si

__all__ = [
    "default_shift",
    "frequency_of_shift",
    "residual_attachment",
    "shift_at",
    "shifted_attachment",
]


_DEPENDENT = 1e-8  # a vector that keeps less than this share of its M-norm is round-off
_PARALLEL = 1e-4  # sine of the angle to the modes of other shifts; half of the digits are left
_NEAR = 1e-3  # of the frequency: the finite elements know eigenfrequencies no better
_RIGID_SHARE = 1e-5  # of the M-norm left without rigid motion; a third of the digits are lost
_ROUNDS = 4  # of the inverse iteration


def default_shift(omega: Floats) -> float:
    """Shift ``-omega_1^2`` [(rad/s)^2] for elastic frequencies (m,) [rad/s]."""
    return -(float(omega[0]) ** 2)


def residual_attachment(body: ElasticBody, kept: Modes, deflections: Floats) -> Modes:
    """Residual attachment modes in modal form, at most one per port.

    A pattern that the retained modes carry in full adds none.

    Parameters
    ----------
    deflections (n_dof, n_ports) [m/N]
        ``Flexibility(body).solve(patterns)``.
    """
    return _diagonal(body, _new_directions(body, kept, deflections))


def shift_at(frequency: float) -> float:
    """Shift [(rad/s)^2] of a frequency [Hz], with its sign.

    Examples
    --------
    >>> [round(shift_at(f), 3) for f in (1.0, -1.0)]
    [39.478, -39.478]
    """
    return float(np.copysign((2.0 * np.pi * frequency) ** 2, frequency))


def frequency_of_shift(shift: float) -> float:
    """Inverse of :func:`shift_at`."""
    return float(np.copysign(np.sqrt(abs(shift)) / (2.0 * np.pi), shift))


def shifted_attachment(
    body: ElasticBody,
    kept: Modes,
    patterns: Floats,
    shifts: Sequence[float],
    flexibility: Flexibility,
) -> Modes:
    """Shifted attachment modes in modal form; one factorisation for each shift, kept in the cache.

    Rejects a shift at an eigenfrequency that the patterns excite, of a free body also at 0 Hz.

    Parameters
    ----------
    patterns (n_dof, n_ports) [-]
    shifts [(rad/s)^2]
    """
    found = np.empty((body.dof_count, 0))
    for i, shift in enumerate(shifts):
        deflections = flexibility.remembered(
            "shifted deflections",
            (patterns, float(shift)),
            partial(_shifted_solve, body, patterns, float(shift), flexibility),
            lambda U: Entry(arrays={"U": U}),
            lambda entry: entry.arrays["U"],
        )
        own = _new_directions(body, kept, deflections)
        if not own.shape[1]:
            continue  # the kept modes have it all
        rest = own - found @ (found.T @ (body.M @ own))
        sine = np.sqrt(
            max(float(scipy.linalg.eigh(rest.T @ (body.M @ rest), eigvals_only=True)[0]), 0.0)
        )
        if sine < _PARALLEL:
            raise _parallel(body, shifts, i, sine)
        found = np.hstack([found, _orthonormal(body.M, rest)])
    return _diagonal(body, found)


def _shifted_solve(
    body: ElasticBody, patterns: Floats, shift: float, flexibility: Flexibility
) -> Floats:
    """Response at a shift; rejected where it is one mode alone."""
    free = body.free
    K, M = body.K[free][:, free], body.M[free][:, free]
    load, rigid = patterns[free], body.rigid_modes[free]
    at_rest = rigid.shape[1] > 0 and shift == 0.0
    if not np.isfinite(shift) or at_rest:
        raise _at_eigenfrequency(body, shift, 0.0)
    matrix, result = (K - shift * M).tocsr(), np.zeros_like(patterns)
    if shift < 0:
        with flexibility.factorised(matrix) as factors:
            response = factors.solve(load)
    else:
        with factorized_symmetric(matrix) as solve:
            response = solve(load)
            nearest = _nearest(solve, K, M, response, shift)
        if nearest is not None:
            raise _at_eigenfrequency(body, shift, nearest)
    elastic = response - rigid @ (rigid.T @ (M @ response))
    if np.any(_norms(M, elastic) < _RIGID_SHARE * _norms(M, response)):
        raise _at_eigenfrequency(body, shift, 0.0)
    result[free] = response
    return result


def _nearest(
    solve: Solver, K: csr_array, M: csr_array, response: Floats, shift: float
) -> float | None:
    """Square of an eigenfrequency [(rad/s)^2] too near to a shift, else None.

    Inverse iteration from the response of unit M-norm: the next vector is at most as long as one
    over the distance to the nearest eigenvalue that the load excites.
    """
    limit = 2.0 * _NEAR * shift
    for column in response.T:
        x = column
        for _ in range(_ROUNDS):
            size = float(np.sqrt(x @ (M @ x)))
            if not np.isfinite(size):
                return shift
            x = x / size if size > 0.0 else x
            following = solve(M @ x[:, None])[:, 0]
            distance = 1.0 / max(float(np.sqrt(following @ (M @ following))), 1e-300)
            x = following
        if not distance > limit:
            return float(x @ (K @ x)) / float(x @ (M @ x))
    return None


def _new_directions(body: ElasticBody, kept: Modes, vectors: Floats) -> Floats:
    """M-orthonormal basis of vectors beside the rigid and retained modes."""
    M = body.M
    rest = vectors / _norms(M, vectors)
    for _ in range(2):  # twice is enough (Kahan, Parlett)
        for basis in (body.rigid_modes, kept.shapes):
            rest = rest - basis @ (basis.T @ (M @ rest))
    norms = _norms(M, rest)
    rest = rest[:, norms > _DEPENDENT] / norms[norms > _DEPENDENT]
    return _orthonormal(M, rest)


def _orthonormal(M: csr_array, vectors: Floats) -> Floats:
    values, turn = scipy.linalg.eigh(vectors.T @ (M @ vectors))
    independent = values > _DEPENDENT**2
    return np.asarray(vectors @ (turn[:, independent] / np.sqrt(values[independent])))


def _diagonal(body: ElasticBody, vectors: Floats) -> Modes:
    """Rayleigh-Ritz in the span of M-orthonormal vectors."""
    squares, turn = scipy.linalg.eigh(vectors.T @ (body.K @ vectors))
    return Modes(omega=np.sqrt(squares), shapes=vectors @ turn)


def _at_eigenfrequency(body: ElasticBody, shift: float, square: float) -> InputError:
    what = "its rigid motion" if square == 0.0 else "an eigenfrequency"
    at = format_si(np.sqrt(max(square, 0.0)) / (2.0 * np.pi), "Hz", 6)
    return InputError(
        f"shifted attachment modes of body '{body.name}': shift",
        got=f"{format_si(frequency_of_shift(shift), 'Hz')}, at {what} ({at})",
        expected=f"a frequency that is {100 * _NEAR:g} % or more from what the contact excites"
        if square
        else "a shift away from 0 Hz: the body is free",
        hint="a shift below zero (-20 kHz: s = -(2 pi 20 kHz)^2) is never at an eigenfrequency; "
        "use one of the order of the first elastic frequency.",
    )


def _parallel(body: ElasticBody, shifts: Sequence[float], i: int, sine: float) -> InputError:
    others = ", ".join(format_si(frequency_of_shift(s), "Hz") for s in shifts[:i])
    return InputError(
        f"shifted attachment modes of body '{body.name}': shifts",
        got=f"{format_si(frequency_of_shift(shifts[i]), 'Hz')} after {others}: only {sine:.1g} "
        "of its attachment mode is independent of the kept modes",
        expected=f"{_PARALLEL:g} or more; otherwise the modes are parallel except for round-off",
        hint="move the shifts farther apart, keep fewer modes, or use one shift fewer.",
    )


def _norms(M: csr_array, vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))
