"""One step of one branch, called apart from any network."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.network.component import Component
from klack.network.rows import Ambient, BranchRow, Rows
from klack.network.step_function import evaluate
from klack.verification.supply_networks import OIL

__all__ = ["branch_of", "branch_step"]

AMBIENT = Ambient()
RHO = float(OIL.density(AMBIENT.pressure))

Vector = NDArray[np.float64]


def branch_of(part: Component, number: int = 0) -> BranchRow:
    """One branch of a part between two nodes, a needle and the ground."""
    handles = {"a": 1, "b": 2, "fluid": 1, "needle": 0, "spool": 0, "body": -1}
    rows = Rows(ambient=AMBIENT, fluid=OIL, component="part", handles=handles)
    part.add_rows(rows)
    return rows.branches[number]


def branch_step(
    row: BranchRow,
    p_a: float,
    p_b: float,
    *,
    t: float = 0.0,
    h: float = 1e-6,
    state: Sequence[float] | Vector | None = None,
    ports: Sequence[float] = (),
) -> Vector:
    """What one step gives out: flow, its slopes, forces, next state, energies."""
    size = 3 + len(row.ports) + row.state.size + len(row.books)
    start = row.state if state is None else state
    return evaluate(row.step, row.parameters, start, [t, h, p_a, p_b, RHO, RHO, *ports], size)[1]
