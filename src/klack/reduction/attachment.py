r"""Attachment modes: deflections that give a truncated basis its static share back.

A body under the load ``b`` of a port deflects statically as the sum over *all* modes; the retained
ones carry a part.  The rest is the residual attachment mode (MacNeal 1971; Craig & Kurdila 2006,
ch. 17)

.. math:: \psi = K^{+} b - \sum_{i=1}^{m} \varphi_i \frac{\varphi_i^T b}{\omega_i^2},
          \qquad K^{+} = K^{-1} \text{ or } P^T K^{-}_{iso} P, \quad P = I - M R R^T

with inertia relief for a free body.  Being a sum over omitted modes it is M- and K-orthogonal to
the retained and the rigid ones; it needs only to be diagonalised among its like (several ports) to
have modal form again.  Then the static compliance at the ports is exact, for any number of modes:
``psi^T K psi = psi^T b``, hence ``(psi^T b)^2 / (psi^T K psi) = b^T psi``.

The shifted attachment mode (Dietz 1999: frequency response modes) does without inertia relief:

.. math:: \psi_s = (K - s M)^{-1} b - \text{its rigid and retained modal part}

It reproduces the response at ``omega^2 = s`` exactly.  Only negative shifts are taken, for then
``K - s M`` is positive definite, body free or not.  The default :func:`default_shift`,
``s = -omega_1^2``, is far below every omitted mode, so the static response is exact but for an
error of the order ``(omega_1 / omega_{m+1})^4``.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array

from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import Modes
from klack.elasticity.factorization import Backend, factorize
from klack.errors import InputError

__all__ = ["default_shift", "residual_attachment", "shifted_attachment"]

_DEPENDENT = 1e-8  # a vector that keeps less than this share of its M-norm is round-off


def default_shift(omega: NDArray[np.float64]) -> float:
    """Shift ``-omega_1^2`` [(rad/s)^2] for elastic frequencies ``omega`` (m,) [rad/s]."""
    return -(float(omega[0]) ** 2)


def residual_attachment(body: ElasticBody, kept: Modes, deflections: NDArray[np.float64]) -> Modes:
    """Residual attachment modes in modal form.

    Parameters
    ----------
    body : ElasticBody
    kept : Modes
        Retained elastic modes.
    deflections : array, shape (n_dof, n_ports) [m/N]
        ``Flexibility(body).solve(patterns)``.

    Returns
    -------
    Modes
        At most one per port, M-orthonormal among themselves and to ``kept`` and the rigid modes;
        a pattern that the retained modes already carry in full adds none.
    """
    return _in_modal_form(body, kept, deflections)


def shifted_attachment(
    body: ElasticBody,
    kept: Modes,
    patterns: NDArray[np.float64],
    shifts: Sequence[float],
    *,
    backend: Backend = "auto",
    threads: int | None = None,
) -> Modes:
    """Shifted attachment modes in modal form; one factorisation for each shift.

    Parameters
    ----------
    body : ElasticBody
    kept : Modes
        Retained elastic modes.
    patterns : array, shape (n_dof, n_ports) [-]
    shifts : sequence of float [(rad/s)^2]
        Negative, see the module text.
    backend, threads
        Of :func:`klack.elasticity.factorization.factorize`.
    """
    deflections = [_shifted_solve(body, patterns, s, backend, threads) for s in shifts]
    return _in_modal_form(body, kept, np.hstack(deflections))


def _shifted_solve(
    body: ElasticBody,
    patterns: NDArray[np.float64],
    shift: float,
    backend: Backend,
    threads: int | None,
) -> NDArray[np.float64]:
    if not shift < 0:
        raise InputError(
            f"shifted attachment modes of body '{body.name}': shift",
            got=f"{shift:g} (rad/s)^2",
            expected="a value below 0 (rad/s)^2",
            hint="use -(2 pi f)^2 with f near the first elastic frequency.",
        )
    free = body.free
    matrix = (body.K - shift * body.M)[free][:, free]
    result = np.zeros_like(patterns)
    with factorize(matrix, backend=backend, threads=threads) as factors:
        result[free] = factors.solve(patterns[free])
    return result


def _in_modal_form(body: ElasticBody, kept: Modes, vectors: NDArray[np.float64]) -> Modes:
    """Remove the rigid and retained part, orthonormalise, diagonalise (Rayleigh-Ritz)."""
    M = body.M
    rest = vectors / _norms(M, vectors)
    for _ in range(2):  # twice is enough (Kahan, Parlett)
        for basis in (body.rigid_modes, kept.shapes):
            rest = rest - basis @ (basis.T @ (M @ rest))
    norms = _norms(M, rest)
    rest = rest[:, norms > _DEPENDENT] / norms[norms > _DEPENDENT]
    values, turn = eigh(rest.T @ (M @ rest))
    independent = values > _DEPENDENT**2
    rest = rest @ (turn[:, independent] / np.sqrt(values[independent]))
    squares, turn = eigh(rest.T @ (body.K @ rest))
    return Modes(omega=np.sqrt(squares), shapes=rest @ turn)


def _norms(M: csr_array, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))
