"""Fluxes of a coil that has carried a constant current for long."""

from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import ConvergenceError
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.static import static_state

__all__ = ["steady_fluxes"]

_WIDEST = 2.0**20  # of the largest linkage of a map: beyond, it goes on straight


def steady_fluxes(
    plant: MagneticCircuit | FluxMap,
    *,
    current: float,
    gap: float,
    others: Mapping[str, float] | None = None,
) -> NDArray[np.float64]:
    """Loop fluxes of a circuit, or the linkage of a map [Wb], without eddy currents.

    Parameters
    ----------
    current [A]
    gap [m]
        Of the circuit or the map.
    others [A]
        Currents of further electric circuits.

    Raises
    ------
    ConvergenceError
        If no flux carries this current at this gap.
    """
    if isinstance(plant, MagneticCircuit):
        return static_state(plant, current=current, gap=gap, others=others).loop_fluxes
    high = float(plant.linkage[-1])
    while plant.current_at(high, gap) < current:
        high *= 2.0
        if high > _WIDEST * plant.linkage[-1]:
            raise ConvergenceError(
                f"force map: no linkage carries {current:g} A at a gap of {gap:g} m.\n"
                "Try: a map that covers the currents and gaps of the run."
            )
    if current == 0.0:
        return np.zeros(1)
    linkage = scipy.optimize.brentq(
        lambda psi: plant.current_at(psi, gap) - current, 0.0, high, xtol=1e-18, rtol=1e-15
    )
    return np.array([linkage])
