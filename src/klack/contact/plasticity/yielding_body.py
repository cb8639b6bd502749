"""A body that yields: its zone, its history, and its linear answer at one state."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from scipy.sparse import csr_array

from klack.arrays import Flags, Floats
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.plasticity.radial_return import (
    PlasticState,
    Returned,
    radial_return,
    von_mises_of_strain,
)
from klack.contact.plasticity.zone import PlasticZone, StrainPoints, plastic_zone, strain_points
from klack.errors import ConvergenceError
from klack.materials.hardening import Hardening
from klack.materials.material import Material

__all__ = ["Answer", "LoadedBody", "YieldingBody"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedBody:
    """A body of a contact, in the meridian plane; its solids with hardening yield."""

    body: ElasticBody
    flexibility: Flexibility
    materials: Mapping[str, Material]

    @property
    def yields(self) -> bool:
        """Whether any of its solids may yield."""
        return any(material.hardening is not None for material in self.materials.values())

    @property
    def plastic_numbers(self) -> tuple[str | float, ...]:
        """Solids that may yield, each with yield stress and both slopes [Pa]."""
        found: list[str | float] = []
        for solid, material in sorted(self.materials.items()):
            if material.hardening is not None:
                found += [solid, *astuple(material.hardening)]
        return tuple(found)

    def elements_near(self, place: Floats, radius: float) -> Flags:
        """Elements that may yield within a radius of a place [m], shape (n_elements,)."""
        near = []
        for block in self.body.mesh.blocks:
            middle = self.body.mesh.points[block.connectivity].mean(axis=1)
            yields = self.materials[block.solid].hardening is not None
            near.append((np.linalg.norm(middle - place, axis=1) < radius) & yields)
        return np.concatenate(near)


_WIDER, _TRIES = 1.5, 4
_BEGUN = 1e-3  # of the contact force of a point: smaller plastic forces need not be exact


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """How the plastic gap of one body follows contact forces, to first order.

    ``plastic_gap + compliance @ (lam - lam_now)`` [m].

    Parameters
    ----------
    plastic_gap (nc,) [m]
    compliance (nc, nc) [m/N]
        Symmetric, positive semi-definite.
    step (nz,) [m]
        Change of w.
    along (nz, nc) [m/N]
        Of w per contact force.
    residual [-]
        Forces out of balance over the plastic ones; where these begin, over a thousandth of the
        contact force of a point.
    """

    plastic_gap: Floats
    compliance: Floats
    step: Floats
    along: Floats
    residual: float


class YieldingBody:
    """State of the last accepted step, and of the step being tried.

    Only a zone about the contact may yield.  Where the rest would, the zone is widened, and keeps
    what has yielded.

    Parameters
    ----------
    rows (nc, n_dof) [-]
        Gaps of the contact points per displacement.
    place (2,) [m]
        Middle of the contact.
    radius [m]
        Of the first zone.
    """

    def __init__(self, body: LoadedBody, rows: csr_array, place: Floats, radius: float) -> None:
        self._body, self._rows, self._place = body, rows, place
        self._radius, self._widest = radius, radius * _WIDER**_TRIES
        self.work = 0.0
        self._choose()
        self.w = np.zeros(len(self.zone.dofs))
        self.states = [PlasticState.none(block.volume.size) for block in self.zone.points]

    def _choose(self) -> None:
        one = self._body
        near = one.elements_near(self._place, self._radius)
        beyond = one.elements_near(self._place, np.inf) & ~near
        self.zone: PlasticZone = plastic_zone(one.body, one.materials, near)
        self.U: Floats = one.flexibility.solve(self._rows.T.toarray())[self.zone.dofs]
        self._rest = strain_points(one.body.mesh, one.materials, beyond, one.body.name)

    def rest_is_elastic(self, lam: Floats, w: Floats) -> bool:
        """Whether no point outside of the zone yields."""
        if not self._rest:
            return True
        load = self._rows.T @ lam
        load[self.zone.dofs] += self._plastic_forces(lam, w)
        u = self._body.flexibility.solve(load)
        for block in self._rest:
            stress = von_mises_of_strain(block.strain(u), block.material.shear_modulus)
            if np.any(stress > _hardening(block).yield_stress):
                return False
        return True

    def widen(self) -> None:
        """Widen the zone; the history stays.

        Raises
        ------
        ConvergenceError
            Where it is as wide as no local contact is.
        """
        if self._radius * _WIDER > self._widest:
            raise ConvergenceError(
                f"elastic-plastic contact: '{self._body.body.name}' yields more than "
                f"{1e3 * self._radius:.3g} mm from the contact.\n"
                "Try: a lower speed, or a realistic yield stress; the contact is not local at "
                "this depth."
            )
        self._radius *= _WIDER
        load = np.zeros(self._body.body.dof_count)
        load[self.zone.dofs] = self.plastic_forces()
        former, states = self.zone.points, self.states
        self._choose()
        self.w = self._body.flexibility.solve(load)[self.zone.dofs]
        self.states = [_carried(block, former, states) for block in self.zone.points]

    def answer(self, lam: Floats, w: Floats, *, loading: bool) -> Answer:
        """Linear answer about forces ``lam`` (nc,) [N] and displacements ``w`` (nz,) [m].

        ``loading`` as in :func:`klack.contact.plasticity.radial_return.radial_return`.
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
        size = max(float(np.abs(f).max(initial=0.0)), _BEGUN * float(lam.max(initial=0.0)))
        wrong = float(np.abs(out_of_balance[kept]).max(initial=0.0))
        return Answer(
            plastic_gap=self.U.T @ f + V.T @ step,
            compliance=(compliance + compliance.T) / 2.0,
            step=step,
            along=along,
            residual=wrong / size if size > 0.0 else 0.0,
        )

    def out_of_balance(self, lam: Floats, w: Floats) -> Floats:
        """Forces that hold ``w`` less those of the plastic strain, shape (nz,) [N]."""
        return np.asarray(self.zone.K @ w - self._plastic_forces(lam, w))

    def opened(self, w: Floats) -> Floats:
        """Gaps [m] that displacements ``w`` [m] open, shape (nc,)."""
        return np.asarray(self.U.T @ (self.zone.K @ w))

    def elastic_utilisation(self, lam: Floats) -> float:
        """Largest von Mises stress over yield stress in the zone, were it elastic."""
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
        """Plastic gap of the accepted history, shape (nc,) [m]."""
        return self.U.T @ self.plastic_forces()

    def plastic_forces(self) -> Floats:
        """Forces of the accepted plastic strain, shape (nz,) [N]."""
        return self._forces([state.strain for state in self.states])

    @property
    def largest_strain(self) -> float:
        """Largest equivalent plastic strain [-] of the accepted history."""
        return max(float(state.equivalent.max(initial=0.0)) for state in self.states)

    def _plastic_forces(self, lam: Floats, w: Floats) -> Floats:
        """The same at a tried state."""
        returned = self._returned(lam, w, loading=False)
        return self._forces([result.state.strain for result in returned])

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


def _carried(
    block: StrainPoints, former: Sequence[StrainPoints], states: Sequence[PlasticState]
) -> PlasticState:
    """History of points partly in a smaller zone."""
    state = PlasticState.none(block.volume.size)
    strain = state.strain.reshape(*block.volume.shape, 4)
    equivalent = state.equivalent.reshape(block.volume.shape)
    for old, known in zip(former, states, strict=True):
        _, here, there = np.intersect1d(block.elements, old.elements, return_indices=True)
        strain[here] = known.strain.reshape(*old.volume.shape, 4)[there]
        equivalent[here] = known.equivalent.reshape(old.volume.shape)[there]
    return state


def _hardening(block: StrainPoints) -> Hardening:
    assert block.material.hardening is not None
    return block.material.hardening
