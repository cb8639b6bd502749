"""Bodies that lie on each other at rest, point by point, under constant forces.

Elastic modes are damped critically meanwhile; all velocities are set to zero whenever the kinetic
energy begins to fall (kinetic damping: P. A. Cundall, Rock Mechanics 1976): what is left is an
equilibrium of the same equations that the run goes on with.
"""

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.errors import AccuracyWarning, ConvergenceError
from klack.transient.interface_arrays import GUIDE_STRAIN, Bore, Outside, Record, State
from klack.transient.interface_kernel import FAILED, march
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import contact_points, modes_of_step

__all__ = ["settle_at_rest", "shaft_pressed"]

Vector = NDArray[np.float64]

_MOST = 6000
_FOUND = 1e-10  # of the force on the bodies
_DOUBT = 1e-5


def settle_at_rest(
    model: InterfaceModel, state: State, gap: Vector, bore: Bore, force: Vector, step: float
) -> None:
    """Bring the bodies to rest under a constant modal force, in place.

    Parameters
    ----------
    model : InterfaceModel
    state : State
        In: where they are; out: at rest.
    gap : array, shape (nc,) [m]
        At q = 0.
    bore : Bore
    force : array, shape (M,)
    step : float [s]

    Raises
    ------
    ConvergenceError
        Where no contact forces are found.

    Warns
    -----
    AccuracyWarning
        Where more than 1e-5 of the force is left.
    """
    damped = replace(model, damping=np.where(model.omega > 0.0, 1.0 - 1e-9, 0.0))
    modes = modes_of_step(damped, step)._replace(push=force)
    points = contact_points(damped, modes.B1, step)._replace(gap=gap)
    smooth = bore._replace(friction=np.zeros_like(bore.friction))
    state.v[:] = 0.0
    scale = float(np.linalg.norm(force)) or 1.0
    kinetic, left = 0.0, np.inf
    record = Record.empty(1, len(model.bodies), model.count, keep_points=False)
    for _ in range(_MOST):
        _, status = march(1, 0, modes, Outside(1.0, 0.0), points, smooth, state, record)
        if status == FAILED:
            raise ConvergenceError(
                "needle: no contact forces found at rest.\nTry: fewer kept modes."
            )
        now = float(state.v @ state.v)
        if now < kinetic:
            state.v[:] = 0.0
            now = 0.0
            left = _left(model, state, bore, force) / scale
            if left < _FOUND:
                break
        kinetic = now
    state.v[:] = 0.0
    if left > _DOUBT:
        warnings.warn(
            f"the needle is not at rest at the start: {left:.1e} of the force on it is left. Where "
            "nothing holds it across the axis it creeps; check placement and guide.",
            AccuracyWarning,
            stacklevel=2,
        )
    state.books[:] = 0.0
    shaft_pressed(bore, state)


def _left(model: InterfaceModel, state: State, bore: Bore, force: Vector) -> float:
    """Modal force that is not balanced."""
    rest = force + model.traces.T @ state.lam - model.omega**2 * state.q
    rest = rest + np.einsum("kc,kci->i", state.guide_force, bore.traces)
    return float(np.linalg.norm(rest))


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
