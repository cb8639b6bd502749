"""Candidate points of a contact and their compliance, kept for impacts that reach as far.

The reach depends on speed and force; the compliance at the points does not. So the reach rises in
grades, :math:`2^{k/4}` micrometres, and the compliance is condensed grade by grade: that of a far
reach holds every shorter one, to the last bit.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, log2
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.assembling.bodies import BodyPair
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.statics import compliances_of
from klack.contact.worn_faces import WornFaces, opened_by

__all__ = ["Candidates", "CondensedSpace", "grade_of", "likely_loads", "reach_of"]

_STEPS = 4
"""Grades for twice the reach: on average 9 % farther than needed."""

_UNIT = 1e-6  # [m]

_FIRST_POINTS = 48
"""Points touching first that the first estimate loads."""

_FEW = 500
"""Likely points that may become twice as many by a reach of at least ``_FLAT``."""

_FLAT = 20e-6  # [m]

_FIRST_GROUP = 64
"""Fewest points of the first group, solved for at once."""

Array = NDArray[np.float64]


def grade_of(reach: float) -> int:
    """First grade that reaches ``reach`` [m]."""
    return ceil(_STEPS * log2(reach / _UNIT))


def reach_of(grade: int) -> float:
    """Reach of a grade [m].

    Examples
    --------
    >>> grade_of(reach_of(9)), f"{reach_of(8):.1e}"
    (9, '4.0e-06')
    """
    return float(_UNIT * 2.0 ** (grade / _STEPS))


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedSpace:
    """Contact points, and the static compliance of each body there, (nc, nc) [m/N]."""

    space: ContactSpace
    upper: Array
    lower: Array

    @property
    def compliance(self) -> Array:
        """Of both bodies [m/N]."""
        return self.upper + self.lower


@dataclass(frozen=True, kw_only=True, eq=False)
class _Kept:
    """Compliances of the farthest reach of one slave side."""

    grade: int
    nodes: NDArray[np.int64]
    upper: Array
    lower: Array


class Candidates:
    """Candidate points of two surfaces, which need not touch."""

    def __init__(self, pair: BodyPair, upper: Flexibility, lower: Flexibility) -> None:
        self.pair, self._upper, self._lower = pair, upper, lower
        self._first: dict[float | None, tuple[ContactSpace, float]] = {}
        self._spaces: dict[int, ContactSpace] = {}
        self._farthest: dict[str, _Kept] = {}
        self._least: int | None = None

    def first(
        self, reach: float | None, worn: WornFaces | None = None
    ) -> tuple[ContactSpace, float]:
        """Candidates up to a reach, or as many as are cheap, and a compliance [m/N].

        It is the axial one of both bodies under pressure on the points that touch first.
        """
        if worn is not None:
            space = opened_by(self.first(reach)[0], worn)
            return space, self._first_compliance(space)
        if reach not in self._first:
            space = self._space(reach)
            self._first[reach] = space, self._first_compliance(space)
        return self._first[reach]

    def within(self, reach: float, worn: WornFaces | None = None) -> CondensedSpace:
        """Candidates with exactly this reach [m]."""
        space = self._space(reach)
        upper, lower = compliances_of(space, self._upper, self._lower)
        return CondensedSpace(space=opened_by(space, worn), upper=upper, lower=lower)

    def at(self, grade: int, worn: WornFaces | None = None) -> CondensedSpace:
        """Candidates with the reach of a grade."""
        if grade not in self._spaces:
            self._spaces[grade] = self._space(reach_of(grade))
        space = self._spaces[grade]
        known = self._farthest.get(space.slave)
        if known is None or not known.grade >= grade >= self._first_grade():
            known = self._condensed(space, grade)
        at = np.searchsorted(known.nodes, space.nodes)
        upper, lower = (whole.take(at, 0).take(at, 1) for whole in (known.upper, known.lower))
        return CondensedSpace(space=opened_by(space, worn), upper=upper, lower=lower)

    def _condensed(self, space: ContactSpace, grade: int) -> _Kept:
        groups = _groups(space, self._first_grade(), grade)
        upper, lower = compliances_of(space, self._upper, self._lower, groups)
        found = _Kept(grade=grade, nodes=space.nodes, upper=upper, lower=lower)
        if grade >= self._first_grade():
            self._farthest[space.slave] = found
        return found

    def _first_grade(self) -> int:
        """Grade from which points are in groups, for every reach."""
        if self._least is None:
            entry = np.sort(self.first(None)[0].entry)
            least = float(entry[min(_FIRST_GROUP, len(entry)) - 1])
            self._least = grade_of(max(least, 1e-6 * _UNIT))
        return self._least

    def _space(self, reach: float | None) -> ContactSpace:
        return _space(self.pair, reach)

    def _first_compliance(self, space: ContactSpace) -> float:
        gap = np.where(space.axial > 1e-6, space.gap, np.inf)
        first = np.argsort(gap, kind="stable")[:_FIRST_POINTS]
        lam = np.zeros(space.count)
        lam[first] = space.area[first]
        lam /= space.axial @ lam
        compliance = 0.0
        for G, flexibility in ((space.G_a, self._upper), (space.G_b, self._lower)):
            load = G.T @ lam
            compliance += float(load @ flexibility.deflections(load[:, None])[:, 0])
        return compliance


def _space(
    pair: BodyPair, reach: float | None, slave: Literal["a", "b"] | None = None
) -> ContactSpace:
    return contact_space(
        pair.upper.mesh,
        pair.upper_surface,
        pair.lower.mesh,
        pair.lower_surface,
        reach=reach,
        slave=pair.slave if slave is None else slave,
        form=pair.form,
    )


def likely_loads(pairs: Iterable[BodyPair]) -> Mapping[str, csr_array]:
    """Loads of 1 N, one per row, on each body of contacts of solids, at points that may carry.

    As many as are cheap, known before the bodies are factorised. Bodies of revolution have few
    points, and are quick without.
    """
    loads: dict[str, list[csr_array]] = {}
    for pair in pairs:
        if pair.upper.dimension == 3:
            space = _space(pair, None)
            if space.count < _FEW:  # flat faces all have one gap: their last ones are left out
                wide = _space(pair, max(_FLAT, space.reach), space.slave)
                space = wide if wide.count < 2 * _FEW else space
            for body, G in ((pair.upper, space.G_a), (pair.lower, space.G_b)):
                loads.setdefault(body.name, []).append(G)
    return {name: csr_array(vstack(rows, format="csr")) for name, rows in loads.items()}


def _groups(space: ContactSpace, first: int, last: int) -> Sequence[NDArray[np.int64]]:
    """Points by grade, those up to the first one together."""
    entry = np.maximum(space.entry, 1e-6 * _UNIT)
    grade = np.ceil(_STEPS * np.log2(entry / _UNIT)).astype(int).clip(first, max(first, last))
    groups = [np.flatnonzero(grade == one) for one in range(first, max(first, last) + 1)]
    return [group for group in groups if len(group)]
