r"""Bodies that lie on each other at rest, point by point, under constant forces.

Unknown are the rigid coordinates :math:`z` of the needle; everything else follows from them. With
the elastic modes at rest, :math:`q_e = \Omega^{-2} (f_e + \Phi_e^T \lambda)`, contact is

.. math:: g = g_0 + \Phi_r z + \Phi_e \Omega^{-2} f_e + C \lambda, \qquad
    C = C_l + \Phi_e \Omega^{-2} \Phi_e^T, \qquad 0 \le \lambda \perp g \ge 0,

and the guide one such point more at each height, along its present normal.  The forces on the rigid
coordinates balance in the end of proximal steps (R. T. Rockafellar, SIAM J. Control Optim. 14
(1976) 877): :math:`z_{k+1} = z_k + \sigma (f_r + \Phi_r^T \lambda_{k+1})`, each of them one
complementarity problem with :math:`C + \sigma \Phi_r \Phi_r^T`.  The rotation about the axis, which
smooth faces of revolution do not hold, is left out.  A ball in its seat is free to tilt as well:
there the facets of a mesh leave some 1e-5 of the force, and the needle creeps.
"""

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from klack.contact.complementarity import solve_lcp
from klack.errors import AccuracyWarning
from klack.transient.interface_arrays import GUIDE_STRAIN, Bore, State
from klack.transient.interface_model import InterfaceModel

__all__ = ["settle_at_rest", "shaft_pressed"]

Vector = NDArray[np.float64]

_SOFTER = 1e4  # a proximal step than the contact points
_MOST = 40
_FOUND = 1e-12  # of the force on the bodies
_DOUBT = 1e-3
_SLOW = 0.9  # no less of the force left than before: what is left moves the needle across


def settle_at_rest(
    model: InterfaceModel,
    state: State,
    gaps: Callable[[], Vector],
    bore: Bore,
    force: Vector,
) -> None:
    """Bring the bodies to rest under a constant modal force, in place.

    Parameters
    ----------
    model : InterfaceModel
    state : State
        In: where they are; out: at rest.
    gaps : callable
        Gaps at q = 0, shape (nc,) [m], where ``state.q`` is now.
    bore : Bore
    force : array, shape (M,)

    Raises
    ------
    ConvergenceError
        Where no contact forces are found.

    Warns
    -----
    AccuracyWarning
        Where more than 1e-3 of the force is left.
    """
    elastic = model.omega > 0.0
    soft = np.where(elastic, 1.0 / np.where(elastic, model.omega, 1.0) ** 2, 0.0)
    points, heights = model.count, len(bore.clearance)
    rigid = ~elastic
    largest = float(np.max(np.sum(model.traces[:, rigid] ** 2, axis=1), initial=0.0))
    stiff = float(np.mean(np.diag(model.compliance)))
    sigma = _SOFTER * stiff / largest if largest > 0.0 else 0.0
    scale = float(np.linalg.norm(force)) or 1.0
    spin = _spin(model, rigid)
    force = force - spin * (spin @ force)
    active, left, before = np.zeros(points + heights, dtype=bool), np.inf, np.inf
    for _ in range(_MOST):
        rows, gap, local = _rows(model, state, bore, gaps())
        turned = rows @ (spin * (spin @ state.q))
        rows -= np.outer(rows @ spin, spin)
        given = soft * force + np.where(rigid, state.q + sigma * force, 0.0)
        seen = rows @ given + turned
        answer = soft + np.where(rigid, sigma, 0.0)
        A = local + (rows * answer) @ rows.T
        lam, active, _ = solve_lcp(0.5 * (A + A.T), gap + seen, active)
        push = rows.T @ lam
        state.q[:] = given + answer * push
        left = float(np.linalg.norm((force + push)[rigid])) / scale
        if left < _FOUND or (left < _DOUBT and left > _SLOW * before):
            break
        before = left
    state.v[:] = 0.0
    state.lam[:] = lam[:points]
    carrying = np.flatnonzero(state.lam > 0.0)
    state.contact.active[:] = state.lam > 0.0
    state.contact.points[: len(carrying)] = carrying
    state.contact.counts[:] = len(carrying), 0
    state.carried[carrying] = True
    if left > _DOUBT:
        warnings.warn(
            f"the needle is not at rest at the start: {left:.1e} of the force on it is left. "
            "Nothing holds it across the axis, or keeps it from tilting: it moves. Check placement "
            "and guide.",
            AccuracyWarning,
            stacklevel=2,
        )
    state.books[:] = 0.0
    shaft_pressed(bore, state)


def _spin(model: InterfaceModel, rigid: NDArray[np.bool_]) -> Vector:
    """Modal direction of the rotation about the axis, of length 1; zero without one."""
    scale = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])
    about = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    mine = rigid & (model.owner == 0)
    q, *_ = np.linalg.lstsq(model.rigid[:, mine] / scale[:, None], about, rcond=1e-12)
    spin = np.zeros(model.mode_count)
    spin[mine] = q / (float(np.linalg.norm(q)) or 1.0)
    return spin


def _rows(
    model: InterfaceModel, state: State, bore: Bore, gap: Vector
) -> tuple[NDArray[np.float64], Vector, NDArray[np.float64]]:
    """Traces, gaps at q = 0 and local compliance of contact points, then of heights of the guide.

    A shaft in the middle of the bore has no normal; any does.
    """
    place = bore.offset + bore.traces @ state.q
    distance = np.linalg.norm(place, axis=1)
    normal = np.where(distance[:, None] > 0.0, place, [1.0, 0.0])
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    rows = np.vstack([model.traces, -np.einsum("kc,kci->ki", normal, bore.traces)])
    free = bore.clearance - np.einsum("kc,kc->k", normal, bore.offset)
    held = np.einsum("kc,kcd,kd->k", normal, bore.compliance, normal)
    n = model.count
    local = np.zeros((len(rows), len(rows)))
    local[:n, :n] = model.compliance
    local[range(n, len(rows)), range(n, len(rows))] = held
    return rows, np.concatenate([gap, free]), local


def shaft_pressed(bore: Bore, state: State) -> None:
    """Let the bore hold a shaft that is placed against it."""
    for k in range(len(bore.clearance)):
        place, C = bore.offset[k] + bore.traces[k] @ state.q, bore.compliance[k]
        distance = float(np.hypot(*place))
        state.guide_force[k] = 0.0
        if distance > bore.clearance[k]:
            n = place / distance
            state.guide_force[k] = -(distance - bore.clearance[k]) / (n @ C @ n) * n
    held = np.einsum("kc,kcd,kd", state.guide_force, bore.compliance, state.guide_force)
    state.books[GUIDE_STRAIN] = 0.5 * float(held)
