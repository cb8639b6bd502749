r"""Whether bodies that have parted meet again: their linear motion says so, not a rule of thumb.

Without forces a step of the trapezoidal rule turns each mode by :math:`\theta = 2 \arctan(\omega h
/ 2)`, and rigid motion goes straight on.  The gaps of all later steps are therefore known, but for
what the known modes leave of displacement and velocity.  That rest keeps an energy *E* of its own,
and changes the gap of a row *g* (Cauchy-Schwarz) by no more than

.. math:: |g u| \le \sqrt{2 E c}, \qquad c = g K^+ g^T - \sum_i \frac{(g \varphi_i)^2}{\omega_i^2},

with what the known modes leave of the static compliance: 0.1 um for a needle and its seat of 87 000
unknowns, which part at 0.01 um a step and are let go after 30 steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats
from klack.elasticity.eigen import Modes
from klack.transient.full_body import FullBody

__all__ = ["KnownBody", "open_gaps"]


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownBody:
    """What is known of a body before it moves.

    Parameters
    ----------
    modes : Modes
        Converged elastic modes, any of them: the more, the sooner a run can end.
    compliance : array, shape (nc,) [m/N]
        Static compliance of the body at each contact point.
    """

    modes: Modes
    compliance: Floats


def open_gaps(
    bodies: Sequence[FullBody],
    known: Sequence[KnownBody],
    at_rest: Floats,
    y: Floats,
    *,
    steps: int,
    slack: float,
) -> Floats | None:
    """Gaps of bodies on which no force acts, now and after each further step, if none closes.

    Parameters
    ----------
    bodies, known : sequence of FullBody, KnownBody
        One or two, in the same order; without damping and springs.
    at_rest : array, shape (nc,) [m]
        Gaps without displacement.
    y : array, shape (nc,)
        Contact-sized part of the velocity, as of :meth:`FullBody.velocity`.
    steps : int
    slack : float [m]
        What gaps have to stay wider than, besides the bound of the rest.

    Returns
    -------
    array, shape (nc, steps + 1) [m], or None
        Without the share of the rest, which the bound limits; None where a gap may close.
    """
    gaps, most = at_rest[:, None], np.zeros(len(at_rest))
    for body, one in zip(bodies, known, strict=True):
        course, bound = _course(body, one, y, steps)
        gaps, most = gaps + course, most + bound
    return gaps if np.all(gaps > (most + slack)[:, None]) else None


def _course(body: FullBody, known: KnownBody, y: Floats, steps: int) -> tuple[Floats, Floats]:
    """Share of one body in the gaps, shape (nc, steps + 1), and bound of its rest, (nc,) [m]."""
    rigid, shapes = body.body.rigid_modes[body.free], known.modes.shapes[body.free]
    omega, since = known.modes.omega, body.step * np.arange(steps + 1)
    u, v = body.u, body.velocity(y)
    Mu, Mv = body.M @ u, body.M @ v
    drifts = (rigid.T @ Mu)[:, None] + (rigid.T @ Mv)[:, None] * since
    q, p = shapes.T @ Mu, shapes.T @ Mv
    angle = 2.0 * np.arctan(0.5 * body.step * omega)[:, None] * np.arange(steps + 1)
    turns = q[:, None] * np.cos(angle) + (p / omega)[:, None] * np.sin(angle)
    rows = body.G @ shapes
    u = u - rigid @ drifts[:, 0] - shapes @ q
    v = v - rigid @ (rigid.T @ Mv) - shapes @ p
    twice = float(u @ (body.K @ u) + v @ (body.M @ v))
    left = np.maximum(known.compliance - np.sum((rows / omega) ** 2, axis=1), 0.0)
    return (body.G @ rigid) @ drifts + rows @ turns, np.sqrt(twice * left)
