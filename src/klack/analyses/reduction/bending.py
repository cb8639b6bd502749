"""Bending modes of the axisymmetric bodies, beside their axial ones."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.assembling.bending import bending_body
from klack.assembling.modes import elastic_count
from klack.assembling.problem import ContactProblem
from klack.cache.setting import result_cache
from klack.elasticity.eigen import Modes, eigenmodes
from klack.elasticity.statics import Flexibility
from klack.progress import Progress
from klack.reduction.reduced_body import ReducedBody

__all__ = ["BendingModes", "bending_modes"]


@dataclass(frozen=True, kw_only=True, eq=False)
class BendingModes:
    """Lowest elastic modes of an axisymmetric body, as many of either kind as it keeps.

    Parameters
    ----------
    body : str
    axial : array, shape (m,) [Hz]
        Of Fourier order 0 without torsion: those of the impact.
    bending : array, shape (m,) [Hz]
        Of order 1; each is two modes, in directions at right angles.
    rigid : int
        Rigid modes of order 1: 2 (shift and rotation) of a free body, 0 of a held one.
    """

    body: str
    axial: NDArray[np.float64]
    bending: NDArray[np.float64]
    rigid: int


def bending_modes(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    reduced: tuple[ReducedBody, ...],
    *,
    threads: int | None,
    progress: Progress,
) -> tuple[BendingModes, ...]:
    """Bending modes of both bodies; none of solids and of bodies from given matrices."""
    found = []
    progress("bending modes", 0.0)
    for body, kept in zip((problem.pair.upper, problem.pair.lower), reduced, strict=True):
        bending = bending_body(problem.case, body.name, body.mesh)
        if bending is None:
            continue
        count = max(1, elastic_count(kept))
        with Flexibility(bending, threads=threads, cache=result_cache()) as flexibility:
            modes = eigenmodes(bending, count=count, flexibility=flexibility)
        found.append(
            BendingModes(
                body=body.name,
                axial=pools[body.name].frequency[:count],
                bending=modes.frequency,
                rigid=bending.rigid_modes.shape[1],
            )
        )
    progress("bending modes", 1.0)
    return tuple(found)
