r"""Static contact of two bodies that yield, over rising approaches.

With the plastic gap :math:`g_p` of both bodies (:mod:`klack.plasticity.zone`),

.. math:: g = g_0 + g_p(\lambda; \text{history}) - \delta a + C \lambda \ge 0, \quad
    \lambda \ge 0, \quad \lambda^T g = 0 .

Newton's method takes the tangent of the plastic gap and solves the complementarity problem exactly
in every round.  Once the load falls the plastic gap stays as it is: the contact opens elastically
on the deformed faces, which :func:`klack.contact.statics.static_contact` solves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from klack.contact.complementarity import ComplementaritySolver
from klack.contact.mortar import ContactSpace
from klack.contact.statics import check_state
from klack.errors import ConvergenceError
from klack.plasticity.yielding_body import Answer, YieldingBody

__all__ = ["LoadingState", "YieldingContact"]

Floats = NDArray[np.float64]

_ROUNDS = 20  # of one step
_FREE = 4  # of them without a look at what came out of the last one
_HALVED = 12  # steps that are halved on the way to one approach
_SMALL = 1e-9  # forces out of balance, and change of the contact forces, over their size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadingState:
    """One state of the ladder.

    Parameters
    ----------
    approach : float [m]
        From first touch.
    force : float [N]
    pressures : array, shape (nc,) [N]
        Forces of the contact points.
    plastic_gap : array, shape (nc,) [m]
    plastic_work : float [J]
        Of both bodies since the beginning.
    rounds : int
        Of Newton's method.
    """

    approach: float
    force: float
    pressures: Floats
    plastic_gap: Floats
    plastic_work: float
    rounds: int


class YieldingContact:
    """Loads two bodies step by step.

    Parameters
    ----------
    space : ContactSpace
    C : array, shape (nc, nc) [m/N]
        Elastic compliance of both.
    bodies : sequence of YieldingBody
        Those that may yield.
    """

    def __init__(self, space: ContactSpace, C: Floats, bodies: Sequence[YieldingBody]) -> None:
        self.space, self.C, self.bodies = space, C, tuple(bodies)
        self._start = min(space.clearance, space.touch)
        self._elastic = ComplementaritySolver(C)
        self._lam = np.zeros(space.count)
        self._active: NDArray[np.bool_] | None = None
        self._approach = 0.0

    def load(self, approach: float) -> LoadingState:
        """Press the bodies together by ``approach`` [m] from first touch.

        A step too large for Newton's method is halved.

        Raises
        ------
        ConvergenceError
            Where no state is found.
        ReachError
            Where the contact grows to the border of the candidate points.
        """
        targets, rounds, halved = [approach], 0, 0
        while targets:
            found = self._step(targets[-1])
            rounds += _ROUNDS if found is None else found
            if found is not None:
                self._approach = targets.pop()
                continue
            halved += 1
            if halved > _HALVED:
                raise ConvergenceError(
                    f"elastic-plastic contact: no state found beyond an approach of "
                    f"{self._approach * 1e6:.4g} um, on the way to {approach * 1e6:.4g} um.\n"
                    "Try: smaller elements at the contact, or more hardening."
                )
            targets.append((self._approach + targets[-1]) / 2.0)
        return LoadingState(
            approach=approach,
            force=float(self.space.axial @ self._lam),
            pressures=self._lam,
            plastic_gap=self.plastic_gap(),
            plastic_work=sum(body.work for body in self.bodies),
            rounds=rounds,
        )

    def _step(self, approach: float) -> int | None:
        """Rounds of Newton's method that the step took; None where it found nothing."""
        space = self.space
        q = space.gap - (self._start + approach) * space.axial
        lam, w, active = self._lam, [body.w for body in self.bodies], self._active
        best = np.inf
        for rounds in range(1, _ROUNDS + 1):
            answers = [
                body.answer(lam, one, loading=rounds == 1)
                for body, one in zip(self.bodies, w, strict=True)
            ]
            new, active = self._closed(q, lam, answers, active)
            worst = max((answer.residual for answer in answers), default=0.0)
            # points that yield in every other round: half a step lies between
            part = 0.5 if rounds > _FREE and worst > 0.5 * best else 1.0
            best = min(best, worst) if rounds > 1 else np.inf
            w = [
                one + part * (answer.step + answer.along @ (new - lam))
                for one, answer in zip(w, answers, strict=True)
            ]
            change, size = float(np.abs(new - lam).max()), float(new.max())
            lam = lam + part * (new - lam)
            if rounds > 1 and worst < _SMALL and change <= _SMALL * size:
                force = float(space.axial @ lam)
                check_state(
                    space,
                    approach,
                    lam,
                    below=float(space.axial @ self._lam),
                    needed=force,
                    deepest=approach,
                )
                self._lam, self._active = lam, active
                for body, one in zip(self.bodies, w, strict=True):
                    body.accept(lam, one)
                return rounds
        return None

    def first_yield(self, deepest: float) -> float | None:
        """Approach [m] at which the first point yields; None where none does up to ``deepest``."""
        if self._over_yield(deepest) < 0.0:
            return None
        lowest = max(self.space.touch - self._start, 1e-6 * deepest)
        if self._over_yield(lowest) > 0.0:
            return lowest
        return float(brentq(self._over_yield, lowest, deepest, rtol=1e-3))

    def _over_yield(self, approach: float) -> float:
        """Largest von Mises stress over the yield stress, less one, of bodies still elastic."""
        lam, _, _ = self._elastic.solve(
            self.space.gap - (self._start + approach) * self.space.axial, None
        )
        return max(body.elastic_utilisation(lam) for body in self.bodies) - 1.0

    def plastic_gap(self) -> Floats:
        """Plastic gap of both bodies, shape (nc,) [m]."""
        total = np.zeros(self.space.count)
        for body in self.bodies:
            total += body.plastic_gap()
        return total

    def _closed(
        self,
        q: Floats,
        lam: Floats,
        answers: Sequence[Answer],
        active: NDArray[np.bool_] | None,
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Contact forces that close the linearised gaps."""
        solver, gap = self._elastic, q
        if any(np.any(answer.compliance) for answer in answers):
            more = sum(answer.compliance for answer in answers)
            solver = ComplementaritySolver(self.C + more)
            gap = q - more @ lam
        gap = gap + sum((answer.plastic_gap for answer in answers), np.zeros_like(q))
        new, active, _ = solver.solve(gap, active)
        return new, active
