r"""Friction between the faces in a step of the interface level.

Tangential offsets of the points, of the moving body past the other,

.. math:: s = \Phi_t q + e, \qquad e = C_{tn} \lambda_n + C_{tt} \lambda_t ,

change by :math:`\Delta s` within a step, part of it elastic, and Coulomb's law holds on that
increment (:mod:`klack.transient.rubbing`), without any smoothing.  A point that closes begins with
:math:`\lambda_t = 0` from where it is; one that opens forgets.

Energy: with the mean forces :math:`\bar\lambda_t = \tfrac12 (\lambda_{t0} + \lambda_{t1})` of a
step and the part :math:`\tfrac12 \lambda_t^T e` of the potential of the contact,

.. math:: \bar\lambda_t^T \Phi_t \Delta q + \Delta (\tfrac12 \lambda_t^T e) =
    \bar\lambda_t^T \Delta s + \tfrac12 (\lambda_{t1}^T e_0 - \lambda_{t0}^T e_1) .

The first term is what friction takes, of the right sign wherever the slip turns by less than a
right angle within a step; the rest joins the debt of the contact, as the second term does (of
points that close or open), and is paid by normal forces: friction never pays.  The motion of closed
points by a payment is no slip, but part of their offset *e* from then on.

Without friction ``grip`` is None, and all this is not compiled.

A repair :math:`\delta q` of the modes between two steps of bodies in a network moves a closed point
by :math:`\Phi_t\,\delta q` without slip: its offset becomes :math:`e - \Phi_t\,\delta q`, so that
the slip of the next step contains this motion.  The potential of the contact, :math:`\tfrac12
\lambda_n^T C \lambda + \tfrac12 \lambda_t^T e`, then changes by :math:`-\tfrac12 \lambda_t^T
\Phi_t\,\delta q`, as it does along the normals.

At rest the faces start without tangential forces.
"""

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Index, Vector
from klack.machine.compiling.jit import inner
from klack.simulation.phase import phase
from klack.transient.interface_arrays import (
    FRICTION,
    ContactPoints,
    Grip,
    Record,
    Rubbing,
    State,
    Step,
)
from klack.transient.interface_model import InterfaceModel
from klack.transient.rubbing import OPEN, SLIP, STICK, solve_rubbing

__all__ = [
    "across",
    "across_energy",
    "begin_offsets",
    "forget",
    "forget_inverse",
    "held_across",
    "lie_without_friction",
    "push_across",
    "remember",
    "repair_offsets",
    "rub",
    "rubbing_arrays",
    "tell_friction",
]


_SHARE = 1e-2
"""Residual of the law over the force that counts as zero.

It is energy that the contact owes; where the bodies turn round they travel too little for a small
change of the forces to pay it.
"""


@inner
def _offset_change(grip: Grip, before: Vector, step: Step) -> None:
    """Motion of the points across their normals by the modes, so far."""
    for i in range(len(step.way)):
        step.way[i] = step.q[i] - before[i]
    np.dot(grip.tangents, step.way, step.moved)


@inner
def begin_offsets(grip: Grip | None, state: State, step: Step) -> None:
    """Offsets at the end of the step by the modes and the law."""
    if grip is not None:
        n, rubbing = len(state.rubbing.slip), state.rubbing
        _offset_change(grip, state.q, step)
        for i in range(len(step.bent)):
            step.bent[i] = rubbing.bent[i] + step.motion[n + i] - step.moved[i]


@phase
def forget(grip: Grip | None, rubbing: Rubbing, step: Step) -> None:
    """Points that have all opened begin anew."""
    if grip is not None:
        for i in range(len(step.bent)):
            step.bent[i] = 0.0
            rubbing.forces[len(rubbing.slip) + i] = 0.0


@inner
def _hold_offsets(grip: Grip, state: State, step: Step) -> None:
    """Keep the slip of closed points, wherever the modes move afterwards.

    That motion, by the payment of a debt or the guide, joins their offsets, as it does the gaps.
    """
    n, rubbing = len(state.rubbing.slip), state.rubbing
    _offset_change(grip, state.q, step)
    for i in range(len(step.moved)):
        if rubbing.forces[i % n] > 0.0:
            step.bent[i] = rubbing.bent[i] + step.motion[n + i] - step.moved[i]


@phase
def across(grip: Grip | None, state: State, step: Step) -> float:
    """Total work of tangential forces, energy that they hold, and loss in friction [J]."""
    if grip is None:
        return 0.0
    _hold_offsets(grip, state, step)
    given, lost = _friction_work(state.rubbing, step.bent, step.moved)
    return given + held_across(grip, state.rubbing, step.bent) + lost


@phase
def held_across(grip: Grip | None, rubbing: Rubbing, bent: Vector) -> float:
    """Energy of the contact across the normals at the end of the step [J]."""
    held = 0.0
    if grip is not None:
        n = len(rubbing.slip)
        for i in range(len(bent)):
            held += 0.5 * rubbing.forces[n + i] * bent[i]
    return held


@phase
def _guess(rubbing: Rubbing) -> None:
    """Change the forces by as much as in the step before."""
    n = len(rubbing.slip)
    forces, before = rubbing.forces, rubbing.before
    for k in range(n):
        carries = forces[k] > 0.0 and before[k] > 0.0 and 2.0 * forces[k] > before[k]
        for i in range(k, len(forces), n):
            now = forces[i]
            if carries:
                forces[i] = 2.0 * now - before[i]
            before[i] = now


@inner
def rub(points: ContactPoints, grip: Grip, state: State, step: Step, tolerance: float) -> int:
    """Forces of all directions at the end of the step; returns the rounds, -1: none found.

    Gaps and increments of offset without and with the new forces are written into ``step``.
    """
    n, rubbing = len(points.gap), state.rubbing
    _offset_change(grip, state.q, step)
    for k in range(n):
        step.free[k] = step.open_gap[k]
        fall = 1.0
        if rubbing.slip[k] > 0.0:
            fall = np.exp(-rubbing.slip[k] / grip.fade[k]) if grip.fade[k] > 0.0 else 0.0
        step.mu[k] = grip.kinetic[k] + fall * (grip.static[k] - grip.kinetic[k])
    for i in range(len(step.moved)):
        step.free[n + i] = step.moved[i] - rubbing.bent[i]
    _guess(rubbing)
    rounds = solve_rubbing(
        points.A,
        step.free,
        step.mu,
        rubbing.closed,
        grip.rings,
        rubbing.forces,
        step.motion,
        rubbing.doing,
        _SHARE * tolerance,
    )
    carrying = 0
    for k in range(n):
        step.lam[k] = rubbing.forces[k]
        step.gap[k] = step.motion[k]
        if rubbing.forces[k] > 0.0:
            carrying += 1
    state.contact.counts[0] = carrying
    return abs(rounds) if rounds != 0 else -1


@phase
def push_across(grip: Grip | None, forces: Vector, first: int, factor: float, kick: Vector) -> None:
    """Add ``factor`` times the modal force of tangential forces from ``first`` on."""
    if grip is not None:
        for i in range(len(forces) - first):
            if forces[first + i] != 0.0:
                a = factor * forces[first + i]
                for j in range(len(kick)):
                    kick[j] += a * grip.tangents[i, j]


@phase
def _friction_work(rubbing: Rubbing, bent: Vector, moved: Vector) -> tuple[float, float]:
    """Work of the mean tangential forces on the modes, and loss in friction [J]."""
    n = len(rubbing.slip)
    ways = len(moved) // n
    given, taken = 0.0, 0.0
    for k in range(n):
        lost = 0.0
        for c in range(ways):
            i = c * n + k
            mean = 0.5 * (rubbing.across[i] + rubbing.forces[n + i])
            if mean != 0.0:
                given += mean * moved[i]
                lost -= mean * (moved[i] + bent[i] - rubbing.bent[i])
        if lost > 0.0:
            taken += lost
    return given, taken


@phase
def tell_friction(
    grip: Grip | None,
    stop: Index,
    rubbing: Rubbing,
    record: Record,
    taken: int,
    pressed: float,
) -> float:
    """Record the mean friction of every point; returns its axial resultant [N]."""
    force = 0.0
    if grip is not None:
        n = len(rubbing.slip)
        for i in range(len(rubbing.across)):
            mean = 0.5 * (rubbing.across[i] + rubbing.forces[n + i])
            force += grip.axial[i] * mean
            if record.stops.shape[1]:
                record.stops[taken, stop[i % n], 0] += grip.axial[i] * mean
            if len(record.across):
                record.across[taken, i] = mean
        record.pressed[taken] = pressed
        if len(record.doing):
            for k in range(n):
                record.doing[taken, k] = rubbing.doing[k]
    return force


@phase
def remember(grip: Grip | None, state: State, step: Step) -> None:
    """The end of the step becomes the state."""
    if grip is None or len(step.moved) == 0:
        return
    rubbing, bent, moved = state.rubbing, step.bent, step.moved
    n = len(rubbing.slip)
    ways = len(moved) // n
    state.books[FRICTION] += _friction_work(rubbing, bent, moved)[1]
    for k in range(n):
        way, taken = 0.0, 0.0
        for c in range(ways):
            i = c * n + k
            slid = moved[i] + bent[i] - rubbing.bent[i]
            if rubbing.doing[k] == SLIP:
                way += slid**2
            taken -= 0.5 * (rubbing.across[i] + rubbing.forces[n + i]) * slid
        rubbing.slip[k] = np.sqrt(way)
        if taken > 0.0:
            rubbing.lost[k] += taken
    for i in range(len(moved)):
        rubbing.across[i] = rubbing.forces[n + i]
        rubbing.bent[i] = bent[i]


def rubbing_arrays(rubbing: Rubbing) -> dict[str, NDArray[np.generic]]:
    """Arrays that a step changes and the next one starts from, without the closed points.

    Those and their inverse belong to the solver: it finds the forces from any of them.
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
    """Begin with faces that stick under these normal forces (nc,) [N], without others."""
    n = model.count
    for forces in (rubbing.forces, rubbing.before):
        forces[:n], forces[n:] = lam, 0.0
    rubbing.across[:] = 0.0
    rubbing.bent[:] = model.compliance[n:, :n] @ lam
    rubbing.doing[:] = np.where(lam > 0.0, STICK, OPEN)
    rubbing.slip[:] = 0.0
    forget_inverse(rubbing)


def forget_inverse(rubbing: Rubbing) -> None:
    """Let the next step admit closed points anew, for another matrix or a stored state."""
    closed = rubbing.closed
    closed.place[:] = -1
    closed.row[:] = -1
    closed.counts[:] = 0


def repair_offsets(model: InterfaceModel, rubbing: Rubbing, dq: Vector) -> float:
    """Add a change of the modes (M,) to the offsets; the work of friction on it [J]."""
    moved = model.tangents @ dq
    work = float(rubbing.across @ moved)
    closed = np.tile(rubbing.forces[: model.count] > 0.0, model.ways)
    rubbing.bent[closed] -= moved[closed]
    return work


def across_energy(model: InterfaceModel, rubbing: Rubbing, first: int, last: int) -> float:
    """Potential of some points held by their forces across the normals [J]."""
    shape = (model.ways, model.count)
    part = np.s_[:, first:last]
    return float(
        0.5 * np.sum(rubbing.across.reshape(shape)[part] * rubbing.bent.reshape(shape)[part])
    )
