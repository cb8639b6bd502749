"""Transfer functions at the contact: full order against reduced."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from klack.assembling.problem import ContactProblem
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import LossFactor
from klack.bodies.reduction.full_order import (
    entry_of_receptance,
    full_order_receptance,
    receptance_of_entry,
)
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.receptance import Receptance, reduced_receptance
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.selection import ByCount
from klack.bodies.reduction.transfer import TransferComparison, compare_receptances
from klack.case.impact_sections import TransferSweep
from klack.case.schema import Case
from klack.machine.cores import side_by_side
from klack.machine.progress import Progress

__all__ = ["LOSS_FACTOR", "TRANSFER_COUNTS", "TRANSFER_MODES", "compare_transfer", "sweep_of"]

TRANSFER_COUNTS = (20, 50)
"""Elastic modes of the compared reduced bodies."""

TRANSFER_MODES = max(TRANSFER_COUNTS)
"""Elastic modes of each body for the comparison."""

LOSS_FACTOR = 0.01
"""With less damping the notches between two points of the axis would decide the comparison."""


def sweep_of(case: Case) -> NDArray[np.float64]:
    """Frequencies of the transfer functions of a case [Hz]."""
    sweep = case.run.transfer or TransferSweep.model_validate(
        {"from": "2 kHz", "to": "400 kHz", "points": 300}
    )
    return np.asarray(np.geomspace(sweep.lowest, sweep.highest, sweep.points))


def compare_transfer(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port],
    *,
    progress: Progress,
) -> tuple[TransferComparison, ...]:
    """Compare 20 and 50 modes, with and without correction, with the full order.

    Both carry the same structural damping, so that every peak and notch is finite.
    """
    frequencies = sweep_of(problem.case)
    bodies = (
        (problem.pair.upper, problem.flexibility_upper),
        (problem.pair.lower, problem.flexibility_lower),
    )
    progress("transfer functions", 0.0)
    comparisons = side_by_side(
        [
            partial(_compare, body, flexibility, pools[body.name], port, frequencies)
            for (body, flexibility), port in zip(bodies, ports, strict=True)
        ],
        at_once=problem.flexibility_upper.at_once,
    )
    progress("transfer functions", 1.0)
    return tuple(comparisons)


def _compare(
    body: ElasticBody,
    flexibility: Flexibility,
    pool: Modes,
    port: Port,
    frequencies: NDArray[np.float64],
) -> TransferComparison:
    full = flexibility.remembered(
        "full-order receptance",
        (port.name, port.pattern, frequencies, LOSS_FACTOR, pool.omega, pool.shapes),
        lambda: full_order_receptance(
            body,
            [port],
            frequencies,
            loss_factor=LOSS_FACTOR,
            flexibility=flexibility,
            modes=pool,
        ),
        entry_of_receptance,
        receptance_of_entry,
    )
    candidates: list[Receptance] = []
    for count in TRANSFER_COUNTS:
        if count > len(pool.omega):
            continue
        reduced = reduce_body(
            body,
            [port],
            modes=ByCount(count),
            correction="consistent",
            damping=LossFactor(eta=LOSS_FACTOR),
            modes_pool=pool,
            flexibility=flexibility,
        )
        for with_residual, words in ((False, "modes alone"), (True, "modes with correction")):
            candidates.append(
                reduced_receptance(
                    reduced,
                    frequencies,
                    with_residual=with_residual,
                    loss_factor=LOSS_FACTOR,
                    label=f"{count} {words}",
                )
            )
    return compare_receptances(
        full.receptance,
        candidates,
        port.name,
        body=body.name,
        loss_factor=LOSS_FACTOR,
        reference_note=full.note,
    )
