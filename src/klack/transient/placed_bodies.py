"""Coordinates and energy of placed modal bodies, and the hold of a guide."""

import numpy as np

from klack.arrays import Matrix, Vector
from klack.transient.interface_arrays import GUIDE_STRAIN, Guide, State
from klack.transient.interface_model import InterfaceModel

__all__ = ["SCALE", "modal_energy", "rigid_coordinates", "shaft_pressed", "surely_unguided"]

SCALE = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])
"""A millimetre of translation weighs like a radian over a metre: lengths of valves."""


def rigid_coordinates(shapes: Matrix, rigid: Vector) -> Vector:
    """Coordinates of rigid modes, shapes (6, r), for a translation and rotation vector."""
    q, *_ = np.linalg.lstsq(shapes / SCALE[:, None], rigid / SCALE, rcond=1e-12)
    return np.asarray(q)


def modal_energy(model: InterfaceModel, q: Vector, v: Vector) -> float:
    """Kinetic and strain energy of the modes [J]."""
    return float(0.5 * v @ v + 0.5 * np.sum((model.omega * q) ** 2))


def surely_unguided(model: InterfaceModel, bore: Guide, state: State, time: float) -> bool:
    """Whether the shaft stays clear of its guide for this time [s], however its modes swing."""
    if not len(bore.clearance):
        return True
    if np.any(state.guide_force):
        return False
    q, v, elastic = state.q, state.v, model.omega > 0
    swing, drift = np.zeros(model.mode_count), np.where(elastic, 0.0, v)
    if time > 0.0:
        swing[elastic] = np.hypot(q[elastic], v[elastic] / model.omega[elastic]) + np.abs(
            q[elastic]
        )
    position = bore.offset + bore.traces @ q
    reach = np.linalg.norm(bore.traces @ drift, axis=1) * time
    reach = reach + np.linalg.norm(np.abs(bore.traces) @ swing, axis=1)
    return bool(np.all(np.linalg.norm(position, axis=1) + reach < bore.clearance))


def shaft_pressed(bore: Guide, state: State) -> None:
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
