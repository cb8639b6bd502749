"""A body that yields: its zone, its history, and its linear answer at one state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.elasticity.factorization import factorize
from klack.hardening import Hardening
from klack.plasticity.radial_return import (
    PlasticState,
    Returned,
    radial_return,
    von_mises_of_strain,
)
from klack.plasticity.zone import PlasticZone, StrainPoints

__all__ = ["Answer", "YieldingBody"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """How the plastic gap of one body follows contact forces, to first order.

    ``plastic_gap + compliance @ (lam - lam_now)`` [m].

    Parameters
    ----------
    plastic_gap : array, shape (nc,) [m]
    compliance : array, shape (nc, nc) [m/N]
        Symmetric, positive semi-definite.
    step : array, shape (nz,) [m]
        Change of w at the present forces.
    along : array, shape (nz, nc) [m/N]
        Change of w per contact force.
    residual : float [-]
        Forces out of balance over the plastic ones.
    """

    plastic_gap: Floats
    compliance: Floats
    step: Floats
    along: Floats
    residual: float


class YieldingBody:
    """One of the two bodies; the state of the last accepted step, and of the step being tried.

    Parameters
    ----------
    zone : PlasticZone
    U : array, shape (nz, nc) [m/N]
        Elastic displacements of the zone under unit forces of the contact points.
    """

    def __init__(self, zone: PlasticZone, U: Floats) -> None:
        self.zone, self.U = zone, U
        self.w = np.zeros(len(zone.dofs))
        self.states = [PlasticState.none(block.volume.size) for block in zone.points]
        self.work = 0.0

    def answer(self, lam: Floats, w: Floats, *, loading: bool) -> Answer:
        """Linear answer about forces ``lam`` [N] and displacements ``w`` [m].

        Parameters
        ----------
        lam : array, shape (nc,)
        w : array, shape (nz,)
        loading : bool
            As in :func:`klack.plasticity.radial_return.radial_return`.
        """
        kept = self.zone.kept
        f, J = self._plastic(lam, w, loading=loading)
        out_of_balance = self.zone.K @ w - f
        V = J @ self.U
        with factorize(csr_array(self.zone.K - J)[kept][:, kept]) as factor:
            solved = factor.solve(np.column_stack([-out_of_balance, V])[kept])
        moves = np.zeros((len(w), 1 + V.shape[1]))
        moves[kept] = solved
        step, along = moves[:, 0], moves[:, 1:]
        compliance = self.U.T @ V + V.T @ along
        size = float(np.abs(f).max(initial=0.0))
        wrong = float(np.abs(out_of_balance[kept]).max(initial=0.0))
        return Answer(
            plastic_gap=self.U.T @ f + V.T @ step,
            compliance=(compliance + compliance.T) / 2.0,
            step=step,
            along=along,
            residual=wrong / size if size > 0.0 else 0.0,
        )

    def elastic_utilisation(self, lam: Floats) -> float:
        """Largest von Mises stress over the yield stress in the zone, were it all elastic."""
        u = np.append(self.U @ lam, 0.0)
        return max(
            float(von_mises_of_strain(block.strain(u), block.material.shear_modulus).max())
            / _hardening(block).yield_stress
            for block in self.zone.points
        )

    def accept(self, lam: Floats, w: Floats) -> None:
        """Take a converged step into the history."""
        returned = self._returned(lam, w, loading=False)
        for block, result in zip(self.zone.points, returned, strict=True):
            self.work += float(result.work @ block.volume.ravel())
        self.states = [result.state for result in returned]
        self.w = w

    def plastic_gap(self) -> Floats:
        """Plastic gap of the accepted history at the contact points, shape (nc,) [m]."""
        return self.U.T @ self.plastic_forces()

    def plastic_forces(self) -> Floats:
        """Forces of the accepted plastic strain, shape (nz,) [N]."""
        return self._forces([state.strain for state in self.states])

    @property
    def has_yielded(self) -> bool:
        """Whether any point has."""
        return any(bool(np.any(state.equivalent > 0.0)) for state in self.states)

    def _plastic(self, lam: Floats, w: Floats, *, loading: bool) -> tuple[Floats, csr_array]:
        count = len(w)
        returned = self._returned(lam, w, loading=loading)
        J = csr_array((count, count))
        for block, result in zip(self.zone.points, returned, strict=True):
            J = J + block.stiffness(result.taken, result.yielding, count + 1)[:count, :count]
        return self._forces([result.state.strain for result in returned]), csr_array(J)

    def _returned(self, lam: Floats, w: Floats, *, loading: bool) -> list[Returned]:
        u = np.append(self.U @ lam + w, 0.0)
        return [
            radial_return(
                block.strain(u),
                state,
                _hardening(block),
                block.material.shear_modulus,
                loading=loading,
            )
            for block, state in zip(self.zone.points, self.states, strict=True)
        ]

    def _forces(self, strains: list[Floats]) -> Floats:
        count = len(self.zone.dofs) + 1
        f = np.zeros(count)
        for block, strain in zip(self.zone.points, strains, strict=True):
            f += block.forces(2.0 * block.material.shear_modulus * strain, count)
        return f[:-1]


def _hardening(block: StrainPoints) -> Hardening:
    assert block.material.hardening is not None
    return block.material.hardening
