r"""Bodies at rest on each other, point by point, under constant forces.

Unknown are the rigid coordinates :math:`z` of the bodies; everything else follows from them. With
the elastic modes at rest, :math:`q_e = \Omega^{-2} (f_e + \Phi_e^T \lambda)`, contact is

.. math:: g = g_0 + \Phi_r z + \Phi_e \Omega^{-2} f_e + C \lambda, \qquad
    C = C_l + \Phi_e \Omega^{-2} \Phi_e^T, \qquad 0 \le \lambda \perp g \ge 0,

and the guide is made of such points too: straight walls that touch its bore, one more in each step
(J. E. Kelley, J. SIAM 8 (1960) 703).  The forces on the rigid coordinates are balanced by proximal
steps (R. T. Rockafellar, SIAM J. Control Optim. 14 (1976) 877), :math:`z_{k+1} = z_k + \sigma (f_r
+ \Phi_r^T \lambda_{k+1})`, each of them one complementarity problem with :math:`C + \sigma \Phi_r
\Phi_r^T`.  Rotations about the axis, which smooth faces of revolution do not hold, are left out.
Nor is the tilt of a ball in its seat held: there the facets of a mesh leave some 1e-5 of the force,
and the needle creeps.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.contact.complementarity import solve_lcp
from klack.errors import AccuracyWarning
from klack.transient.interface_arrays import Guide, State
from klack.transient.interface_model import InterfaceModel
from klack.transient.placed_bodies import rigid_coordinates, shaft_pressed

__all__ = ["settle_at_rest"]


_WATCHED = 1e-6  # [m] gaps of points that are looked at first
_SOFTER = 1e4  # a proximal step than the contact points
_MOST = 100
_FOUND = 1e-12  # of the force on the bodies
_DOUBT = 1e-3
_SAME = 1e-10  # walls so alike are one
_TURNS = 3  # without success, while walls come and go
_SLOW = 0.9  # no less of the force left than before: what is left moves the needle across


def settle_at_rest(
    model: InterfaceModel,
    state: State,
    gaps: Callable[[], Vector],
    bore: Guide,
    force: Vector,
) -> None:
    """Bring the bodies to rest under a constant modal force, in place.

    Parameters
    ----------
    model
        Without friction between the faces.
    state
        In: start; out: at rest, but for the set of carrying points.
    gaps
        Gaps at q = 0 (nc,) [m] for the present ``state.q``.
    force (M,)

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
    points = model.count
    rigid = ~elastic
    largest = float(np.max(np.sum(model.traces[:, rigid] ** 2, axis=1), initial=0.0))
    stiff = float(np.mean(np.diag(model.compliance)))
    sigma = _SOFTER * stiff / largest if largest > 0.0 else 0.0
    scale = float(np.linalg.norm(force)) or 1.0
    spins = _spins(model)
    for spin in spins:
        force = force - spin * (spin @ force)
    left, before, stalled = np.inf, np.inf, 0
    walls = _Walls.none()
    lam = np.zeros(points)
    for _ in range(_MOST):
        walls = walls.carrying(lam[points:])
        active = np.append(lam[:points] > 0.0, np.ones(len(walls.height), dtype=bool))
        walls = walls.with_present(bore, state.q)
        rows, gap, local = _rows(model, bore, gaps(), walls)
        watched = gap + rows @ state.q < _WATCHED
        watched[points:] = True
        active = np.append(active, np.zeros(len(rows) - len(active), dtype=bool))
        turned = np.zeros(len(rows))
        for spin in spins:
            turned += rows @ (spin * (spin @ state.q))
            rows -= np.outer(rows @ spin, spin)
        given = soft * force + np.where(rigid, state.q + sigma * force, 0.0)
        seen = rows @ given + turned
        answer = soft + np.where(rigid, sigma, 0.0)
        lam, push = _forces(rows, answer, local, gap + seen, active, watched)
        state.q[:] = given + answer * push
        left = float(np.linalg.norm((force + push)[rigid])) / scale
        left = max(left, walls.missed(bore, state.q, lam[points:], rows[points:, rigid]) / scale)
        stalled = stalled + 1 if left > _SLOW * before else 0
        before = left
        if left < _FOUND or (left < _DOUBT and stalled > (_TURNS if np.any(lam[points:]) else 0)):
            break
    state.v[:] = 0.0
    state.lam[:] = lam[:points]
    state.carried[state.lam > 0.0] = True
    if left > _DOUBT:
        warnings.warn(
            f"the needle is not at rest at the start: {left:.1e} of the force on it is left. It "
            "moves, because nothing holds it across the axis or keeps it from tilting. Check "
            "placement and guide.",
            AccuracyWarning,
            stacklevel=2,
        )
    state.books[:] = 0.0
    shaft_pressed(bore, state)


def _forces(
    rows: NDArray[np.float64],
    answer: Vector,
    local: NDArray[np.float64],
    gap: Vector,
    active: NDArray[np.bool_],
    watched: NDArray[np.bool_],
) -> tuple[Vector, Vector]:
    """Contact forces, and the modal force that they make.

    All but the watched rows stay open; those that would not are watched, too, and all begins anew.
    """
    lam, watched = np.zeros(len(rows)), watched | active
    while True:
        w = np.flatnonzero(watched)
        A = local[np.ix_(w, w)] + (rows[w] * answer) @ rows[w].T
        lam[w], active[w], _ = solve_lcp(0.5 * (A + A.T), gap[w], active[w])
        push = rows[w].T @ lam[w]
        closes = ~watched & (gap + local[:, w] @ lam[w] + rows @ (answer * push) < 0.0)
        if not np.any(closes):
            return lam, rows.T @ lam
        watched |= closes


def _spins(model: InterfaceModel) -> NDArray[np.float64]:
    """Unit modal directions of the rotation of each body about the axis; zero without one."""
    turn = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1e3])
    spins = np.zeros((len(model.moving), model.mode_count))
    for spin, body in zip(spins, model.moving, strict=True):
        own = model.rigid_of(body.number)
        q = rigid_coordinates(body.rigid[:, own], turn)
        spin[own] = q / (float(np.linalg.norm(q)) or 1.0)
    return spins


@dataclass(frozen=True, eq=False)
class _Walls:
    """Straight walls that touch the round bore, outside of which the shaft cannot be.

    Tangents of a disc hold in all of it, so former ones stay while they carry.
    """

    height: NDArray[np.int64]  # (w,) number of the height in the bore
    normal: NDArray[np.float64]  # (w, 2) outwards

    @classmethod
    def none(cls) -> Self:
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, 2)))

    def carrying(self, force: Vector) -> Self:
        keep = np.flatnonzero(force > 0.0)
        return type(self)(self.height[keep], self.normal[keep])

    def with_present(self, bore: Guide, q: Vector) -> Self:
        """These and, at each height, the one nearest to the shaft (any for a centred one)."""
        place = bore.offset + bore.traces @ q
        distance = np.linalg.norm(place, axis=1)
        normal = np.where(distance[:, None] > 0.0, place, [1.0, 0.0])
        normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        known = [
            bool(np.any(self.normal[self.height == k] @ normal[k] > 1.0 - _SAME))
            for k in range(len(distance))
        ]
        new = np.flatnonzero(~np.array(known, dtype=bool))
        return type(self)(
            np.concatenate([self.height, new]), np.concatenate([self.normal, normal[new]])
        )

    def missed(self, bore: Guide, q: Vector, force: Vector, rows: NDArray[np.float64]) -> float:
        """Largest modal force by which the round bore and these walls differ."""
        missed = 0.0
        for k in range(len(bore.clearance)):
            here = self.height == k
            place, C = bore.offset[k] + bore.traces[k] @ q, bore.compliance[k]
            pressed, distance = np.zeros(2), float(np.hypot(*place))
            if distance > bore.clearance[k]:
                n = place / distance
                pressed = (distance - bore.clearance[k]) / float(n @ C @ n) * n
            wrong = float(np.linalg.norm(pressed - force[here] @ self.normal[here]))
            missed = max(missed, wrong * float(np.linalg.norm(rows[here], axis=1).max()))
        return missed


def _rows(
    model: InterfaceModel, bore: Guide, gap: Vector, walls: _Walls
) -> tuple[NDArray[np.float64], Vector, NDArray[np.float64]]:
    """Traces, gaps at q = 0 and local compliance of contact points, then of walls."""
    k, normal = walls.height, walls.normal
    rows = np.vstack([model.traces, -np.einsum("wc,wci->wi", normal, bore.traces[k])])
    free = bore.clearance[k] - np.einsum("wc,wc->w", normal, bore.offset[k])
    held = np.einsum("wc,wcd,vd->wv", normal, bore.compliance[k], normal)
    held[k[:, None] != k] = 0.0
    held[np.diag_indices(len(k))] *= 1.0 + _SAME
    n = model.count
    local = np.zeros((len(rows), len(rows)))
    local[:n, :n] = model.compliance
    local[n:, n:] = held
    return rows, np.concatenate([gap, free]), local
