r"""Static contact of two bodies that yield, over rising approaches.

With the plastic gap :math:`g_p` of both bodies (:mod:`klack.contact.plasticity.zone`),

.. math:: g = g_0 + g_p(\lambda; \text{history}) - \delta a + C \lambda \ge 0, \quad
    \lambda \ge 0, \quad \lambda^T g = 0 .

Newton's method with the tangent of the plastic gap solves the complementarity problem exactly in
every round, starts on the line of the last two states, and goes as far as the energy of the bodies
falls. When the load falls the plastic gap stays: the contact opens elastically on the deformed
faces.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.arrays import Floats
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.mortar import ContactSpace
from klack.contact.plasticity.yielding_body import Answer, YieldingBody
from klack.contact.statics import check_state
from klack.errors import ConvergenceError

__all__ = ["LoadingState", "YieldingContact", "lowest_share"]


_ENOUGH = 0.5  # of the first slope: a whole step is taken
_EXACT = 1e-4  # of the step


def lowest_share(slope: Callable[[float], float], noise: float) -> float:
    """Share of a step, at most 1, at which a convex function is lowest, within 1e-4.

    Parameters
    ----------
    slope
        Along the step, rising with the share.  The whole step is taken where the slope there is
        at most half of the first one.
    noise
        Slopes below are round-off, and the whole step is taken.
    """
    first, last = slope(0.0), slope(1.0)
    if last <= _ENOUGH * abs(first) or max(abs(first), last) <= noise or first >= 0.0:
        return 1.0
    return float(scipy.optimize.brentq(slope, 0.0, 1.0, xtol=_EXACT))


_ROUNDS = 20  # of one step
_HALVED = 12  # steps that are halved on the way to one approach
_SMALL = 1e-9  # forces out of balance, and change of the contact forces, over their size
_ROUND_OFF = 1e-12  # of the elastic energy


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadingState:
    """One state of the ladder.

    Parameters
    ----------
    approach [m]
        From first touch.
    force [N]
    pressures (nc,) [N]
        Forces of the contact points.
    plastic_gap (nc,) [m]
    plastic_work [J]
        Of both bodies since the beginning.
    plastic_strain [-]
        Largest equivalent one.
    rounds
        Of Newton's method.
    """

    approach: float
    force: float
    pressures: Floats
    plastic_gap: Floats
    plastic_work: float
    plastic_strain: float
    rounds: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Trial:
    """Contact forces [N], and displacements [m] beyond those of elastic bodies."""

    approach: float
    lam: Floats
    w: tuple[Floats, ...]

    def towards(self, other: "_Trial", share: float) -> "_Trial":
        """State on the line to another, beyond it above 1."""
        return _Trial(
            approach=self.approach + share * (other.approach - self.approach),
            lam=self.lam + share * (other.lam - self.lam),
            w=tuple(w + share * (end - w) for w, end in zip(self.w, other.w, strict=True)),
        )


class YieldingContact:
    """Loads two bodies step by step.

    Parameters
    ----------
    C (nc, nc) [m/N]
        Elastic, of both.
    bodies
        That may yield.
    """

    def __init__(self, space: ContactSpace, C: Floats, bodies: Sequence[YieldingBody]) -> None:
        self.space, self.C, self.bodies = space, C, tuple(bodies)
        self._start = min(space.clearance, space.touch)
        self._elastic = ComplementaritySolver(C)
        self._now = _Trial(
            approach=0.0, lam=np.zeros(space.count), w=tuple(body.w for body in self.bodies)
        )
        self._before: _Trial | None = None
        self._active: NDArray[np.bool_] | None = None

    def load(self, approach: float) -> LoadingState:
        """Press the bodies together by ``approach`` [m] from first touch, in parts where needed.

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
                targets.pop()
                continue
            halved += 1
            if halved > _HALVED:
                raise ConvergenceError(
                    f"elastic-plastic contact: no state found beyond an approach of "
                    f"{self._now.approach * 1e6:.4g} um, on the way to {approach * 1e6:.4g} um.\n"
                    "Try: smaller elements at the contact, or more hardening."
                )
            targets.append((self._now.approach + targets[-1]) / 2.0)
        return LoadingState(
            approach=approach,
            force=float(self.space.axial @ self._now.lam),
            pressures=self._now.lam,
            plastic_gap=self.plastic_gap(),
            plastic_work=sum(body.work for body in self.bodies),
            plastic_strain=max((body.largest_strain for body in self.bodies), default=0.0),
            rounds=rounds,
        )

    def _step(self, approach: float) -> int | None:
        """Rounds of Newton's method; None where it found nothing."""
        space = self.space
        q = space.gap - (self._start + approach) * space.axial
        now, active = self._ahead(approach), self._active
        for rounds in range(1, _ROUNDS + 1):
            answers = [
                body.answer(now.lam, w, loading=rounds == 1)
                for body, w in zip(self.bodies, now.w, strict=True)
            ]
            lam, active = self._closed(q, now.lam, answers, active)
            w = tuple(
                w + answer.step + answer.along @ (lam - now.lam)
                for w, answer in zip(now.w, answers, strict=True)
            )
            worst = max((answer.residual for answer in answers), default=0.0)
            change, size = float(np.abs(lam - now.lam).max()), float(lam.max())
            if rounds > 1 and worst < _SMALL and change <= _SMALL * size:
                now = _Trial(approach=approach, lam=lam, w=w)
                if self._widened(now):
                    return self._step(approach)
                self._accept(now, active)
                return rounds
            # the first one may penetrate, which has no energy to compare with
            new = _Trial(approach=approach, lam=lam, w=w)
            now = new if rounds == 1 else self._lowest(now, new)
        return None

    def _ahead(self, approach: float) -> "_Trial":
        """State on the line of the last two."""
        if self._before is None:
            return self._now
        way = self._now.approach - self._before.approach
        return self._before.towards(self._now, (approach - self._before.approach) / way)

    def _widened(self, found: "_Trial") -> bool:
        """Whether a body yields outside of its zone, now widened."""
        outgrown = [
            body
            for body, w in zip(self.bodies, found.w, strict=True)
            if not body.rest_is_elastic(found.lam, w)
        ]
        for body in outgrown:
            body.widen()
        if outgrown:
            self._now = replace(self._now, w=tuple(body.w for body in self.bodies))
            self._before = None
        return bool(outgrown)

    def _accept(self, found: "_Trial", active: NDArray[np.bool_]) -> None:
        check_state(
            self.space,
            found.approach,
            found.lam,
            below=float(self.space.axial @ self._now.lam),
            needed=float(self.space.axial @ found.lam),
            deepest=found.approach,
        )
        self._before, self._now, self._active = self._now, found, active
        for body, w in zip(self.bodies, found.w, strict=True):
            body.accept(found.lam, w)

    def _lowest(self, now: "_Trial", new: "_Trial") -> "_Trial":
        r"""State between two where the energy of the bodies is lowest.

        All between them keep the gaps closed or open. With the gaps opened on the way,
        :math:`\Delta g`, the energy of the step of time rises by :math:`\lambda^T \Delta g + (\hat
        K w - f_p)^T \Delta u`; it is convex, so this line search finds the minimum from anywhere.
        """
        pressed = new.lam - now.lam
        opened = self.C @ pressed
        moved = []
        for body, w, end in zip(self.bodies, now.w, new.w, strict=True):
            opened += body.opened(end - w)
            moved.append(body.U @ pressed + end - w)

        def slope(share: float) -> float:
            at = now.towards(new, share)
            return float(at.lam @ opened) + sum(
                float(body.out_of_balance(at.lam, w) @ move)
                for body, w, move in zip(self.bodies, at.w, moved, strict=True)
            )

        noise = _ROUND_OFF * float(new.lam @ (self.C @ new.lam))
        return now.towards(new, lowest_share(slope, noise))

    def first_yield(self, deepest: float) -> float | None:
        """Approach [m] of first yield; None where none is up to ``deepest``."""
        if self._over_yield(deepest) < 0.0:
            return None
        lowest = max(self.space.touch - self._start, 1e-6 * deepest)
        if self._over_yield(lowest) > 0.0:
            return lowest
        return float(scipy.optimize.brentq(self._over_yield, lowest, deepest, rtol=1e-3))

    def _over_yield(self, approach: float) -> float:
        """Largest von Mises stress over yield stress, less one, of bodies still elastic."""
        lam, _, _ = self._elastic.solve(
            self.space.gap - (self._start + approach) * self.space.axial, None
        )
        return max((body.elastic_utilisation(lam) for body in self.bodies), default=0.0) - 1.0

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
