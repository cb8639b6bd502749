r"""Viscous damping of a full-order body, as the reduced levels have it.

.. math:: C = \sum_i 2 \zeta_i \omega_i \, (M \varphi_i)(M \varphi_i)^T
    + \alpha \left(M - M R R^T M\right) + \beta K

with mass-normalised modes :math:`\varphi_i` and rigid modes *R*: damping ratios of a few modes make
a matrix of low rank, Rayleigh damping a sparse one.  Rigid motion is never damped, as in
:mod:`klack.bodies.reduction.damping`.

A step solves :math:`(S + Z D Z^T) x = b + G^T \lambda` with a sparse *S* and the thin :math:`Z`.
With :math:`Y = S^{-1} Z` and :math:`P = (D^{-1} + Z^T Y)^{-1}` (Woodbury)

.. math::
    x = S^{-1}\left(b - Z P \, Y^T b + G^T \lambda\right) - Y P \, (G Y)^T \lambda

at the cost of two thin products beside the solve with *S*.

A non-reflecting end adds the sparse matrix of its dashpots
(:func:`klack.bodies.elasticity.loads.face_dashpots`), which brakes rigid motion as well: the body
continues beyond that face.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.factorization import Factorization
from klack.bodies.reduction.damping import Damping, LossFactor, RayleighDamping, damping_ratios
from klack.errors import require_nonnegative
from klack.transient.interface_solve import InterfaceSolve

__all__ = ["BodyDamping", "DampingMatrix", "LowRankSolve", "body_damping"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyDamping:
    """Damping of one body.

    Parameters
    ----------
    shapes (n_dof, m)
        Mass-normalised elastic modes, zero where fixed.
    rate (m,) [rad/s]
        ``2 zeta omega`` of each.
    alpha [1/s]
    beta [s]
    ends (n_dof, n_dof) [N s/m]
        Dashpots of non-reflecting ends.
    """

    shapes: NDArray[np.float64]
    rate: NDArray[np.float64]
    alpha: float = 0.0
    beta: float = 0.0
    ends: csr_array | None = None

    def __post_init__(self) -> None:
        lowest = float(np.min(self.rate, initial=np.inf))
        require_nonnegative("BodyDamping.rate", lowest, "rad/s")
        require_nonnegative("BodyDamping.alpha", self.alpha, "1/s")
        require_nonnegative("BodyDamping.beta", self.beta, "s")


def body_damping(
    damping: Damping, modes: Modes, body: ElasticBody | None = None
) -> BodyDamping | None:
    """Damping of a whole body; None without any.

    Parameters
    ----------
    damping
        Rayleigh damping acts on the whole body, a ratio or a loss factor on the modes.
    modes
        Elastic modes that the reduced levels keep.
    body
        With layers, whose loss acts on these modes as well.
    """
    alpha, beta = 0.0, 0.0
    if isinstance(damping, RayleighDamping):
        alpha, beta, damping = damping.alpha, damping.beta, LossFactor(eta=0.0)
    ratios = damping.ratios(modes.omega)
    if body is not None:
        ratios = damping_ratios(damping, body, modes.omega, modes.shapes)
    rate = 2.0 * ratios * modes.omega
    damped = rate > 0.0
    if not np.any(damped) and alpha == 0.0 == beta:
        return None
    return BodyDamping(shapes=modes.shapes[:, damped], rate=rate[damped], alpha=alpha, beta=beta)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DampingMatrix:
    """C on the free degrees of freedom: a sparse part and Z diag(rate) Z^T [N s/m].

    Parameters
    ----------
    columns (n, r) [kg^(1/2)]
        Z.
    rate (r,) [rad/s]
        Below zero for what takes the drag of ``alpha M`` off the rigid motion.
    ends (n, n) [N s/m]
        Share of non-reflecting ends in ``sparse``.
    """

    sparse: csr_array
    columns: NDArray[np.float64]
    rate: NDArray[np.float64]
    ends: csr_array | None = None

    @classmethod
    def of(cls, damping: BodyDamping, body: ElasticBody, M: csr_array) -> "DampingMatrix":
        """Assemble the matrix of a body.

        Parameters
        ----------
        M (n_dof, n_dof) [kg]
            Mass that the run moves, which may differ at the contact nodes from that of the body.
        """
        free = body.free
        columns, rate = M @ damping.shapes, damping.rate
        if not body.is_fixed:
            rigid = body.rigid_modes
            loads = M @ rigid
            root = np.linalg.cholesky(rigid.T @ loads)
            loads = scipy.linalg.solve_triangular(root, loads.T, lower=True).T
            motion = scipy.linalg.solve_triangular(root, rigid.T, lower=True).T
            # modes of another mass than M would drag the rigid motion a little
            columns = columns - loads @ (motion.T @ columns)
            if damping.alpha > 0.0:
                columns = np.hstack([columns, loads])
                rate = np.append(rate, np.full(loads.shape[1], -damping.alpha))
        ends = None
        if damping.ends is not None:
            ends = csr_array(damping.ends[free][:, free])
        return cls(
            sparse=csr_array(sparse_damping(damping, body, M)[free][:, free]),
            columns=columns[free],
            rate=rate,
            ends=ends,
        )

    def force(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """C v of a velocity, shape (n,) [N]."""
        return self.sparse @ v + self.columns @ (self.rate * (self.columns.T @ v))


def sparse_damping(damping: BodyDamping, body: ElasticBody, M: csr_array) -> csr_array:
    """Sparse part of C on all degrees of freedom [N s/m]."""
    sparse = csr_array(damping.alpha * M + damping.beta * csr_array(body.K))
    return sparse if damping.ends is None else csr_array(sparse + damping.ends)


class LowRankSolve:
    """:class:`InterfaceSolve` of S with the low-rank term Z diag(weight) Z^T added.

    Parameters
    ----------
    plain, factorization
        Of S alone.
    G (nc, n) [-]
    columns (n, r)
        Z.
    weight (r,)
        None of them zero; S + Z diag(weight) Z^T is positive definite.
    """

    def __init__(
        self,
        plain: InterfaceSolve,
        factorization: Factorization,
        G: csr_array,
        columns: NDArray[np.float64],
        weight: NDArray[np.float64],
    ) -> None:
        self._plain = plain
        self._Z = columns
        self._Y = factorization.solve(columns)
        inner = np.diag(1.0 / weight) + columns.T @ self._Y
        self._P = np.linalg.inv(0.5 * (inner + inner.T))
        self._traces = G @ self._Y
        self._taken = self._traces @ self._P @ self._traces.T
        self._selected = self._traces[:0]
        self.compliance = np.zeros((G.shape[0],) * 2)

    def learn(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._plain.learn(points)
        self.compliance = self._plain.compliance - self._taken

    def select(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._plain.select(points)
        self._selected = self._traces[points]

    def predict(self, b: NDArray[np.float64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._plain.predict(b - self._Z @ (self._P @ (self._Y.T @ b)))

    def response(self) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        return self._plain.response()

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        x = self._plain.complete(lam)
        if np.any(lam):
            x = x - self._Y @ (self._P @ (self._selected.T @ lam))
        return x
