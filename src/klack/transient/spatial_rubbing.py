r"""Friction between faces beside the fine steps of bodies in a network.

The fine steps have it themselves (:mod:`klack.transient.interface_friction`): a point remembers its
tangential force :math:`\lambda_t` and the offset *e* by which the residual compliance is bent
across its normal, and slips by :math:`\Delta s = \Phi_t \Delta q + \Delta e` within a step.

A repair :math:`\delta q` of the modes between two steps moves a closed point by
:math:`\Phi_t\,\delta q`.  It has not slipped by that: the offset from which the next step counts
becomes :math:`e - \Phi_t\,\delta q`, so that the slip of that step holds this way, too.  The
potential of the contact, :math:`\tfrac12 \lambda_n^T C \lambda + \tfrac12 \lambda_t^T e`, then
changes by :math:`-\tfrac12 \lambda_t^T \Phi_t\,\delta q`, as it does along the normals.

At rest the faces start without tangential forces, as frictionless ones would lie.
"""

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.transient.interface_arrays import Rubbing
from klack.transient.interface_model import InterfaceModel
from klack.transient.rubbing import OPEN, STICK

__all__ = [
    "across_energy",
    "forget_inverse",
    "lie_without_friction",
    "repair_offsets",
    "rubbing_arrays",
]


def rubbing_arrays(rubbing: Rubbing) -> dict[str, NDArray[np.generic]]:
    """Arrays that a step changes and the next one begins with, but for the closed points.

    Those with their inverse are a means of the solver: it follows the forces from any of them.
    """
    return {
        "rubbing forces": rubbing.forces,
        "rubbing before": rubbing.before,
        "friction": rubbing.across,
        "bent": rubbing.bent,
        "doing": rubbing.doing,
        "slip": rubbing.slip,
        "friction losses": rubbing.lost,
    }


def lie_without_friction(model: InterfaceModel, rubbing: Rubbing, lam: Vector) -> None:
    """Begin with faces that stick under these normal forces, shape (nc,) [N], without others."""
    n = model.count
    for forces in (rubbing.forces, rubbing.before):
        forces[:n], forces[n:] = lam, 0.0
    rubbing.across[:] = 0.0
    rubbing.bent[:] = model.compliance[n:, :n] @ lam
    rubbing.doing[:] = np.where(lam > 0.0, STICK, OPEN)
    rubbing.slip[:] = 0.0
    forget_inverse(rubbing)


def forget_inverse(rubbing: Rubbing) -> None:
    """Let the next step admit closed points afresh, for another matrix or after a stored state."""
    closed = rubbing.closed
    closed.place[:] = -1
    closed.row[:] = -1
    closed.counts[:] = 0


def repair_offsets(model: InterfaceModel, rubbing: Rubbing, dq: Vector) -> float:
    """Take a change of the modes, shape (M,), into the offsets; the work of friction on it [J]."""
    moved = model.tangents @ dq
    work = float(rubbing.across @ moved)
    closed = np.tile(rubbing.forces[: model.count] > 0.0, model.ways)
    rubbing.bent[closed] -= moved[closed]
    return work


def across_energy(model: InterfaceModel, rubbing: Rubbing, first: int, last: int) -> float:
    """Part of the potential of some points that their forces across the normals hold [J]."""
    shape = (model.ways, model.count)
    part = np.s_[:, first:last]
    return float(
        0.5 * np.sum(rubbing.across.reshape(shape)[part] * rubbing.bent.reshape(shape)[part])
    )
