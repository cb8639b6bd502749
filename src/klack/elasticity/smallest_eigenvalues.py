r"""The lowest end of the spectra of K and M: definiteness, and motions without strain."""

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array, dia_array

from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.errors import InputError

__all__ = ["first_frequency", "require_positive_mass"]

_DENSE = 400


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
        values = scipy.sparse.linalg.eigsh(
            scaled, k=1, which="SA", tol=1e-2, v0=start, return_eigenvectors=False
        )
        smallest = float(values[0])
    if not smallest > 0:
        raise InputError(
            where,
            got=f"a mass matrix with a negative eigenvalue ({smallest:.2g} of its diagonal)",
            expected="a positive definite mass matrix",
            hint="the entry is K, or only the off-diagonal part of M; use a consistent mass "
            "matrix.",
        )


def first_frequency(where: str, body: ElasticBody) -> float:
    r"""Lowest elastic eigenfrequency [Hz], after the check that nothing else is below it.

    With K R = 0, and with as many degrees of freedom held as there are rigid motions, K has a
    Cholesky factor exactly if it has no negative eigenvalue and no motions without strain but the
    rigid ones.

    Raises
    ------
    InputError
        For a stiffness with a negative eigenvalue or further motions without strain.
    """
    try:
        with Flexibility(body) as flexibility:
            modes = eigenmodes(body, count=1, flexibility=flexibility)
    except InputError as error:
        raise InputError(
            where,
            got=f"{body.rigid_modes.shape[1]} rigid motions free, and {error.got}",
            expected="a stiffness with strain in every other motion, all eigenvalues above 0",
            hint="the body is in several pieces or has a mechanism (glue its solids before the "
            "matrices are written), or the matrix has stress stiffening, or K and M are exchanged.",
        ) from error
    return float(modes.frequency[0])
