"""Elastic modes selected by a case, and kept by its bodies."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from klack.assembling.layers import tell_layers
from klack.assembling.problem import ContactProblem, PlacedBodies
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import Damping, LossFactor, ModalDamping, RayleighDamping
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import kept_modes as chosen_modes
from klack.bodies.reduction.selection import ByCount, ByFrequency, ByParticipation, ModeSelection
from klack.case.bodies import BodyDamping, ModeChoice
from klack.case.schema import Case
from klack.machine.cores import side_by_side
from klack.machine.progress import Progress

__all__ = [
    "PARTICIPATION_POOL",
    "damping_of",
    "is_damped",
    "kept_modes",
    "mode_pool",
    "mode_pools",
    "participating",
    "selection_of",
    "shape_marks",
]


PARTICIPATION_POOL = 100
"""Modes of each body for the level ``reduced-participation``."""

_PARTICIPATING = (8, 20)  # of the upper and of the lower body


def selection_of(choice: ModeChoice) -> ModeSelection:
    """Selection of modes in a case."""
    if choice.count is not None:
        return ByCount(choice.count)
    if choice.frequency is not None:
        return ByFrequency(choice.frequency)
    return ByParticipation(choice.participation or 1, choice.pool or 1)


def mode_pools(
    placed: PlacedBodies, *, at_least: int, rough: int = 0, progress: Progress
) -> Mapping[str, Modes]:
    """Elastic modes of all bodies: as many as the case needs, at least ``at_least``.

    ``rough`` as of :func:`klack.bodies.elasticity.eigen.eigenmodes`.
    """
    bodies = placed.bodies
    flexibilities = [placed.flexibility_upper, placed.flexibility_lower]
    if placed.opposite is not None:
        flexibilities.append(placed.opposite.flexibility)
    progress("modes", 0.0)
    pools = side_by_side(
        [
            partial(
                mode_pool,
                selection_of(placed.case.reduction.choice(body.name)),
                body,
                flexibility,
                at_least=at_least,
                rough=rough,
            )
            for body, flexibility in zip(bodies, flexibilities, strict=True)
        ],
        at_once=placed.flexibility_upper.at_once,
    )
    progress("modes", 1.0)
    found = {body.name: pool for body, pool in zip(bodies, pools, strict=True)}
    tell_layers(bodies, found)
    return found


def mode_pool(
    choice: ModeSelection,
    body: ElasticBody,
    flexibility: Flexibility,
    *,
    at_least: int = 1,
    rough: int = 0,
) -> Modes:
    """Elastic modes of a body for a selection; as :func:`mode_pools`."""
    count = at_least
    if isinstance(choice, ByCount):
        count = max(count, choice.count)
    elif isinstance(choice, ByParticipation):
        count = max(count, choice.pool)
    else:
        count = max(count, rough)
    most = len(body.free) - body.rigid_modes.shape[1]
    pool = eigenmodes(body, count=min(count, most), rough=min(rough, most), flexibility=flexibility)
    if isinstance(choice, ByFrequency) and pool.frequency[-1] < choice.maximum:
        return eigenmodes(body, max_frequency=choice.maximum, flexibility=flexibility)
    return pool


def kept_modes(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port] | None = None,
) -> dict[str, Modes]:
    """Elastic modes of both bodies that the reduced level keeps.

    Parameters
    ----------
    ports
        For modes chosen by participation; default: near the highest force.
    """
    if ports is None:
        loads = problem.static.load_patterns(0.7 * problem.static.max_force)
    else:
        loads = (ports[0].pattern, ports[1].pattern)
    kept = {}
    for body, load in zip((problem.pair.upper, problem.pair.lower), loads, strict=True):
        pool = pools[body.name]
        selection = selection_of(problem.case.reduction.choice(body.name))
        kept[body.name] = chosen_modes(selection, pool, load[:, None])
    return kept


def participating(pair_names: tuple[str, str]) -> dict[str, ModeSelection]:
    """The 8 + 20 modes of 100 with most compliance at the contact."""
    return {
        name: ByParticipation(count, PARTICIPATION_POOL)
        for name, count in zip(pair_names, _PARTICIPATING, strict=True)
    }


Floats = NDArray[np.float64]

_FRACTION = 0.6180339887498949  # of the golden section: no two nodes get nearly the same weight


def shape_marks(shapes: Floats) -> Floats:
    """Sum of each shape (n_dof, m) with fixed weights between -1 and 1, shape (m,).

    Other libraries may turn the sign of a mode, or a pair of equal frequencies; former modal
    coordinates then belong to other shapes.
    """
    weights = 2.0 * ((1.0 + np.arange(len(shapes))) * _FRACTION % 1.0) - 1.0
    return np.asarray(weights @ shapes)


def damping_of(damping: BodyDamping) -> Damping:
    """Damping model of a case."""
    if damping.modal is not None:
        return ModalDamping(ratio=damping.modal)
    if damping.rayleigh is not None:
        return RayleighDamping(alpha=damping.rayleigh.alpha, beta=damping.rayleigh.beta)
    return LossFactor(eta=damping.loss_factor or 0.0)


def is_damped(case: Case, name: str) -> bool:
    """Whether a body has damping, or a layer with loss."""
    body = case.bodies[name]
    lossy = any(row[-1] > 0.0 for layer in (body.layers or {}).values() for row in layer.rows)
    return lossy or bool(damping_of(body.damping).ratios([1.0])[0] > 0.0)
