r"""Static flexibility of a fixed or of a free body.

A fixed body answers a load with :math:`u = K^{-1} f`.  A free body under a constant load
accelerates; seen from its moving centre it takes the shape (inertia relief, Craig & Kurdila 2006,
ch. 17)

.. math:: u = P^T K^+ P f, \qquad P = 1 - M R R^T,

where P removes the resultant of the load by the inertia forces of the rigid motion, and P^T the
rigid motion from the answer.  K^+ may be any generalised inverse: here six degrees of freedom of
three distant nodes (one of a body of revolution) are held, which costs no reaction force because
the load is in balance.
"""

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from klack.elasticity.body import ElasticBody
from klack.elasticity.closing import Closing
from klack.elasticity.factorization import Backend, Factorization, factorize
from klack.errors import InputError

__all__ = ["Flexibility"]

_CHUNK = 64


class Flexibility(Closing):
    """Elastic static answer of a body to loads; one factorisation, many right-hand sides.

    Parameters
    ----------
    body : ElasticBody
    backend : {"auto", "pardiso", "ngsolve", "superlu"}
    threads : int, optional
        See :func:`klack.elasticity.factorization.factorize`.
    """

    def __init__(
        self, body: ElasticBody, *, backend: Backend = "auto", threads: int | None = None
    ) -> None:
        self.body = body
        self._R = body.rigid_modes
        self._MR = body.M @ self._R
        self._kept = body.free
        if self._R.shape[1]:
            self._kept = np.setdiff1d(body.free, _isostatic_support(body), assume_unique=True)
        self.factorization: Factorization = factorize(
            body.K[self._kept][:, self._kept], backend=backend, threads=threads
        )

    def solve(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacements under loads.

        Parameters
        ----------
        F : array, shape (n_dof,) or (n_dof, m) [N]
            Entries at fixed degrees of freedom are taken by the support.

        Returns
        -------
        array of the same shape [m]
            Column-major; of a free body without rigid motion, R^T M u = 0.
        """
        F = np.asarray(F, dtype=np.float64)
        if F.ndim not in (1, 2) or len(F) != self.body.dof_count:
            raise InputError(
                f"Flexibility of body '{self.body.name}': F",
                got=f"shape {F.shape}",
                expected=f"({self.body.dof_count},) or ({self.body.dof_count}, m)",
                hint="give one force per degree of freedom of the mesh, fixed ones included.",
            )
        U = np.zeros(F.shape, order="F")
        if F.ndim == 1:
            U[:] = self._solve_block(F[:, None])[:, 0]
        else:
            for at in range(0, F.shape[1], _CHUNK):
                U[:, at : at + _CHUNK] = self._solve_block(F[:, at : at + _CHUNK])
        return U

    def close(self) -> None:
        """Give back the memory of the factorisation."""
        self.factorization.close()

    def _solve_block(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        R, MR = self._R, self._MR
        if R.shape[1]:
            F = F - MR @ (R.T @ F)
        U = np.zeros(F.shape, order="F")
        U[self._kept] = self.factorization.solve(F[self._kept])
        if R.shape[1]:
            U -= R @ (MR.T @ U)
        return U


def _isostatic_support(body: ElasticBody) -> NDArray[np.int64]:
    """As many degrees of freedom as rigid modes that, held, stop every rigid motion."""
    d = body.dimension
    x = body.mesh.points
    if d == 2:
        return np.array([2 * np.argmin(x[:, 1]) + 1])
    first = int(np.argmax(np.linalg.norm(x - body.centre_of_mass, axis=1)))
    second = int(np.argmax(np.linalg.norm(x - x[first], axis=1)))
    along = (x[second] - x[first]) / np.linalg.norm(x[second] - x[first])
    third = int(np.argmax(np.linalg.norm(np.cross(x - x[first], along), axis=1)))
    candidates = (3 * np.array([first, second, third])[:, None] + np.arange(3)).ravel()
    # pivoted QR picks the six of the nine that hold the rigid motions best
    _, _, order = scipy.linalg.qr(body.rigid_modes[candidates].T, pivoting=True)
    return np.asarray(candidates[order[:6]])
