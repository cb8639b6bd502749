"""``klack reduce``: both bodies reduced at their contact, and limits of trust."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.transfer import TRANSFER_MODES, compare_transfer
from klack.analyses.reduction.one_node import (
    OneNode,
    OneNodeImpact,
    one_node_impacts,
    one_nodes,
)
from klack.assembling.bending import bending_body
from klack.assembling.given_pair import build_given_pair
from klack.assembling.modes import mode_pools
from klack.assembling.problem import ContactProblem, build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.assembling.yielding import tell_elastic
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.reduced_body import ReducedBody, elastic_count
from klack.bodies.reduction.transfer import TransferComparison
from klack.case.placed_errors import tells_place
from klack.case.schema import Case
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, silent

__all__ = ["ReductionStudy", "run_reduce"]


@dataclass(frozen=True, kw_only=True, eq=False)
class BendingModes:
    """Lowest elastic modes of an axisymmetric body, as many of either kind as it keeps.

    Parameters
    ----------
    axial (m,) [Hz]
        Of Fourier order 0 without torsion: those of the impact.
    bending (m,) [Hz]
        Of order 1; each is two modes, in directions at right angles.
    rigid
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
    """Bending modes of both bodies; none of solids and of given matrices."""
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


@dataclass(frozen=True, kw_only=True, eq=False)
class ReductionStudy:
    """Two reduced bodies with a port at their contact, and their transfer functions.

    ``transfer``: of each body full order first, then 20 and 50 modes with and without correction.
    ``impacts``: with 20 and 50 modes a body, where the case names a node.
    """

    case: str
    title: str
    bodies: tuple[ReducedBody, ...]
    transfer: tuple[TransferComparison, ...]
    nodes: tuple[OneNode, ...] = ()
    impacts: tuple[OneNodeImpact, ...] = ()
    bending: tuple[BendingModes, ...] = ()

    def save(self, folder: Path) -> None:
        """Write the files of each body into a folder.

        ``NAME.reduced.npz``; ``NAME.transfer.csv`` and ``.svg``, at the contact; ``NAME.node.csv``
        and ``.svg``, at the node that the case names.
        """
        from klack.analyses.impact.figures import transfer_chart
        from klack.analyses.reduction.one_node import node_chart
        from klack.report.printed import svg_chart

        for body in self.bodies:
            body.save(folder / f"{body.name}.reduced.npz")
        for item in self.transfer:
            _write_table(item, folder / f"{item.body}.transfer.csv")
            (folder / f"{item.body}.transfer.svg").write_bytes(svg_chart(transfer_chart(item)))
        for node in self.nodes:
            _write_table(node.transfer, folder / f"{node.body}.node.csv")
            (folder / f"{node.body}.node.svg").write_bytes(svg_chart(node_chart(node)))


def _write_table(item: TransferComparison, path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["frequency [Hz]"]
            + [f"|{label}| [m/N]" for label in item.labels]
            + [f"deviation of {label} [dB]" for label in item.labels[1:]]
        )
        table = np.vstack([item.frequencies, np.abs(item.curves), item.level_deviations[1:]]).T
        writer.writerows([f"{value:.9g}" for value in row] for row in table)


@tells_place
def run_reduce(
    case: Case, *, progress: Progress = silent, threads: int | None = None
) -> ReductionStudy:
    """Reduce both bodies of a case at their contact and compare transfer functions.

    The reduced bodies keep the displacement of all named surfaces (recovery), for pictures.  Where
    a body has no surfaces, both are reduced at their ports, without transfer functions: the full
    order of a reduced model is not known.
    """
    tell_elastic(case, "reduced bodies are those of")
    if not case.has_surfaces:
        given = build_given_pair(case, progress, threads=threads)
        return ReductionStudy(
            case=case.name, title=case.title, bodies=(given.upper, given.lower), transfer=()
        )
    case.require_ends("a reduction")
    case.require_on_axis("a reduction")
    problem = build_problem(case.without_outputs(), progress, threads=threads)
    pools = mode_pools(problem, at_least=TRANSFER_MODES, progress=progress)
    progress("reduced", 0.0)
    pair = own_pair(problem, pools, stiffness=first_stiffness(problem), recovery=True)
    progress("reduced", 1.0)
    transfer = compare_transfer(problem, pools, pair.ports, progress=progress)
    nodes = one_nodes(problem, pools, pair.ports, progress=progress)
    impacts = one_node_impacts(problem, pools, pair.ports, nodes)
    problem.close()
    bodies = (pair.upper, pair.lower)
    bending = bending_modes(problem, pools, bodies, threads=threads, progress=progress)
    return ReductionStudy(
        case=case.name,
        title=case.title,
        bodies=bodies,
        transfer=transfer,
        nodes=nodes,
        impacts=impacts,
        bending=bending,
    )
