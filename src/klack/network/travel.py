"""Travel of the bodies of a network between the stops, before the run."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self

import numpy as np
import scipy

from klack.network.rows import Rows

__all__ = ["StopBound", "Travel"]

_LEAST_LENGTH = 1e-6  # [m] the solver's tolerances are meant for numbers around one


@dataclass(frozen=True, slots=True)
class StopBound:
    """A stop between two bodies; None is what does not move.

    Parameters
    ----------
    name : str
    upper, lower : str or None
    gap : float [m]
    """

    name: str
    upper: str | None
    lower: str | None
    gap: float

    @property
    def stands(self) -> bool:
        """Whether one side does not move: it ends a chain of bodies that push each other."""
        return self.upper is None or self.lower is None


@dataclass(frozen=True, slots=True)
class Travel:
    r"""Greatest and smallest value of a sum of displacements that no stop forbids.

    Rigid bodies along one axis, each with one displacement :math:`y_b`.  Every stop keeps its gap
    open, :math:`g_0 + y_\text{upper} - y_\text{lower} \ge 0`, which leaves a linear programme: a
    chain of bodies that push each other is one stop for all of them.

    Limits: rigid contacts, no tilt; springs and films stop nothing.

    Parameters
    ----------
    bounds : sequence of StopBound
    """

    bounds: Sequence[StopBound]

    @classmethod
    def of(cls, rows: Rows) -> Self:
        """Travel of a network whose contacts are known."""
        owner = _owners(rows)
        sides = [(row, owner.get(row.upper), owner.get(row.lower)) for row in rows.interfaces]
        return cls(
            [
                StopBound(row.component, upper, lower, max(row.gap, 0.0))
                for row, upper, lower in sides
                if row.law is not None and upper != lower
            ]
        )

    def highest(self, factors: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
        """Greatest ``sum(factor * displacement)`` and the stops that bound it.

        Parameters
        ----------
        factors : mapping of str to float
            By the component of the body.

        Returns
        -------
        float
            Infinity where no stop bounds it.
        tuple of str
            Stops against what does not move come first.
        """
        wanted = {body: factor for body, factor in factors.items() if factor != 0.0}
        if not wanted:
            return 0.0, ()
        found = self._of_one_body(wanted)
        return self._of_a_chain(wanted) if found is None else found

    def _of_one_body(self, wanted: Mapping[str, float]) -> tuple[float, tuple[str, ...]] | None:
        """Answer for one body: the nearest of its stops if they do not move, infinity without any.

        None for several bodies, and where two stops are equally near.  The scaling is that of the
        linear programme, so that both give the same number.
        """
        ((body, factor), *others) = wanted.items()
        if not others and all(body not in (bound.upper, bound.lower) for bound in self.bounds):
            return inf, ()
        if others or any({bound.upper, bound.lower} != {body, None} for bound in self.bounds):
            return None
        gaps = [
            bound for bound in self.bounds if (bound.lower if factor > 0.0 else bound.upper) == body
        ]
        if not gaps:
            return inf, ()
        nearest, *further = sorted(gaps, key=lambda bound: bound.gap)
        if further and further[0].gap == nearest.gap:
            return None
        length = max(_LEAST_LENGTH, *(bound.gap for bound in self.bounds))
        return nearest.gap / length * length * abs(factor), (nearest.name,)

    def _of_a_chain(self, wanted: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
        """Answer of the linear programme."""
        sides = [side for bound in self.bounds for side in (bound.upper, bound.lower) if side]
        place = {body: i for i, body in enumerate(dict.fromkeys([*sides, *wanted]))}
        closing = np.zeros((len(self.bounds), len(place)))
        for row, bound in zip(closing, self.bounds, strict=True):
            if bound.lower:
                row[place[bound.lower]] += 1.0
            if bound.upper:
                row[place[bound.upper]] -= 1.0
        gaps = np.array([bound.gap for bound in self.bounds])
        length = max(float(gaps.max(initial=0.0)), _LEAST_LENGTH)
        most = max(abs(factor) for factor in wanted.values())
        cost = np.zeros(len(place))
        for body, factor in wanted.items():
            cost[place[body]] = -factor / most
        found = scipy.optimize.linprog(cost, A_ub=closing, b_ub=gaps / length, bounds=(None, None))
        if found.fun is None or found.status != 0:
            return inf, ()
        met = [
            bound
            for bound, share in zip(self.bounds, found.ineqlin.marginals, strict=True)
            if abs(share) > 1e-9
        ]
        names = tuple(bound.name for bound in sorted(met, key=lambda bound: not bound.stands))
        return -float(found.fun) * length * most, names

    def lowest(self, factors: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
        """Smallest ``sum(factor * displacement)`` and the stops; minus infinity without."""
        value, names = self.highest({body: -factor for body, factor in factors.items()})
        return 0.0 - value, names

    @staticmethod
    def factors(rows: Rows, ports: Iterable[tuple[int, float]]) -> dict[str, float]:
        """Factors of bodies from those of ports (handles); fixed ports count nothing."""
        owner = _owners(rows)
        total: dict[str, float] = {}
        for port, factor in ports:
            body = owner.get(port)
            if body is not None:
                total[body] = total.get(body, 0.0) + factor
        return total


def _owners(rows: Rows) -> dict[int, str]:
    """Free body of every port."""
    free = [row for row in rows.bodies if row.body.rigid_count > 0]
    return {handle: row.component for row in free for handle in row.ports}
