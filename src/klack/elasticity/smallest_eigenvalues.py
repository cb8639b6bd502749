r"""The lowest end of the spectra of K and M: definiteness, and motions without strain."""

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import csr_array, dia_array
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from klack.elasticity.factorization import factorize
from klack.errors import InputError
from klack.mesh.mesh import Mesh

__all__ = ["first_frequency", "require_positive_mass"]

_DENSE = 400
_SHIFT = 1e-2
_STRAINLESS = 1e-6


def require_positive_mass(where: str, M: csr_array, free: NDArray[np.int64]) -> None:
    """Check that the mass matrix is positive definite, by the smallest eigenvalue (Lanczos).

    Scaled to a unit diagonal, a consistent mass matrix has eigenvalues of the order of 0.1.

    Raises
    ------
    InputError
        With the smallest scaled eigenvalue.
    """
    A = M[free][:, free]
    scale = dia_array((1.0 / np.sqrt(A.diagonal())[None], [0]), shape=A.shape)
    scaled = (scale @ A @ scale).tocsr()
    if len(free) <= _DENSE:
        smallest = float(scipy.linalg.eigvalsh(scaled.toarray(), subset_by_index=[0, 0])[0])
    else:
        start = np.random.default_rng(5).standard_normal(len(free))
        values = eigsh(scaled, k=1, which="SA", tol=1e-2, v0=start, return_eigenvectors=False)
        smallest = float(values[0])
    if not smallest > 0:
        raise InputError(
            where,
            got=f"a mass matrix with a negative eigenvalue ({smallest:.2g} of its diagonal)",
            expected="a positive definite mass matrix",
            hint="the entry is K, or only the off-diagonal part of M; take consistent mass.",
        )


def first_frequency(
    where: str,
    K: csr_array,
    M: csr_array,
    mesh: Mesh,
    free: NDArray[np.int64],
    rigid: int,
) -> float:
    r"""Lowest elastic eigenfrequency [Hz], after checks that nothing else lies below it.

    The stiffness of a held body must have a Cholesky factor.  For a free one polynomials of second
    degree give an upper bound :math:`\lambda` of the lowest elastic eigenvalue;
    :math:`K + 0.01 \lambda M` must then have a factor (no eigenvalue below
    :math:`-0.01 \lambda`), and inverse iteration finds the lowest ones.

    Parameters
    ----------
    where : str
    K, M : csr_array
    mesh : Mesh
    free : int array
    rigid : int
        Rigid motions that are left free: all or none.

    Raises
    ------
    InputError
        For a stiffness with a negative eigenvalue, or with more motions without strain than the
        rigid ones.
    """
    A, B = K[free][:, free], M[free][:, free]
    if len(free) <= _DENSE:
        values = scipy.linalg.eigvalsh(A.toarray(), B.toarray())[: rigid + 2]
    else:
        shift = _SHIFT * _ritz_bound(A, B, _polynomials(mesh)[free], rigid) if rigid else 0.0
        values = _iterated(where, A, B, shift, rigid + 2)
    scale = float(abs(values).max())
    if values[0] < -_STRAINLESS * scale:
        raise _indefinite(where)
    strainless = int(np.sum(values <= _STRAINLESS * scale))
    if strainless > rigid or len(values) <= rigid:
        raise InputError(
            where,
            got=f"{strainless} or more motions without strain",
            expected=f"{rigid}, the rigid ones",
            hint="the body is in several pieces or has a mechanism: glue its solids before the "
            "matrices are written, one body per file.",
        )
    return float(np.sqrt(values[rigid]) / (2 * np.pi))


def _iterated(
    where: str, A: csr_array, B: csr_array, shift: float, count: int
) -> NDArray[np.float64]:
    """Lowest eigenvalues, ascending."""
    try:
        factor = factorize(csr_array(A + shift * B) if shift else A)
    except InputError as error:
        raise _indefinite(where) from error
    with factor:
        operator = LinearOperator(A.shape, matvec=factor.solve, dtype=np.float64)
        start = np.random.default_rng(6).standard_normal(A.shape[0])
        try:
            values = eigsh(
                A,
                k=count,
                M=B,
                sigma=-shift,
                OPinv=operator,
                v0=start,
                tol=1e-6,
                return_eigenvectors=False,
            )
        except ArpackError as error:
            raise _indefinite(where) from error
    return np.sort(values)


def _polynomials(mesh: Mesh) -> NDArray[np.float64]:
    """Displacement fields of second degree in the coordinates, shape (n_dof, 30 | 12)."""
    x = mesh.points - mesh.points.mean(axis=0)
    x = x / np.abs(x).max()
    d = mesh.dimension
    powers = [np.ones(len(x)), *x.T, *(x[:, i] * x[:, j] for i in range(d) for j in range(i + 1))]
    fields = np.zeros((len(x), d, d, len(powers)))
    for way in range(d):
        fields[:, way, way] = np.stack(powers, axis=1)
    if d == 2:  # no radial motion on the axis
        fields[:, 0] *= (mesh.points[:, 0] / np.ptp(mesh.points[:, 0]))[:, None, None]
    return fields.reshape(mesh.dof_count, -1)


def _ritz_bound(A: csr_array, B: csr_array, trial: NDArray[np.float64], rigid: int) -> float:
    """Upper bound of the lowest elastic eigenvalue of a free body."""
    left, sizes, _ = np.linalg.svd(trial, full_matrices=False)
    basis = left[:, sizes > 1e-10 * sizes[0]]
    values = scipy.linalg.eigvalsh(basis.T @ (A @ basis), basis.T @ (B @ basis))
    above = values[rigid:]
    positive = above[above > _STRAINLESS * abs(values).max()]
    return float(positive.min()) if len(positive) else float(abs(values).max())


def _indefinite(where: str) -> InputError:
    return InputError(
        where,
        got="a stiffness matrix with a negative eigenvalue",
        expected="a positive semi-definite stiffness",
        hint="write the stiffness of the unloaded body: no stress stiffening under pressure, no "
        "contact; or K and M are exchanged.",
    )
