"""From frequencies and shapes of a modal analysis to modes at ports."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.reduction.given_modes import RIGID_FREQUENCY, ModesAtPorts, body_of_modes
from klack.reduction.reduced_body import ReducedBody

__all__ = ["body_of_modal_data"]


def body_of_modal_data(
    name: str,
    *,
    frequency: NDArray[np.float64],
    damping: NDArray[np.float64],
    shapes: NDArray[np.float64],
    port_names: Sequence[str],
    residual: NDArray[np.float64] | None = None,
    where: str,
    mass: float | None = None,
) -> ReducedBody:
    """Take mass-normalised modes as they are; those below 1 Hz are rigid.

    Parameters
    ----------
    name : str
    frequency, damping : array, shape (m,) [Hz], [-]
    shapes : array, shape (m, n_ports) [1/sqrt(kg)]
        The mean displacement of each port along +z, weighted as its force.
    port_names : sequence of str
    residual : array, shape (n_ports, n_ports), optional [m/N]
        Compliance of the modes that are left out.
    where : str
        File, for messages.
    mass : float, optional [kg]

    Raises
    ------
    InputError
        For negative frequencies or damping, and as
        :func:`klack.reduction.given_modes.body_of_modes`.
    """
    for key, values, unit in (("frequency", frequency, "Hz"), ("damping", damping, "-")):
        if not np.all(np.isfinite(values)) or np.any(values < 0):
            worst = int(np.argmax(~np.isfinite(values) | (values < 0)))
            raise InputError(
                f"{where}: {key} of mode {worst + 1}",
                got=f"{values[worst]:g} {unit}",
                expected=f"0 {unit} or more",
                hint="a negative damping creates energy; correct or leave out the mode.",
            )
    rigid = frequency < RIGID_FREQUENCY
    count = len(port_names)
    return body_of_modes(
        name,
        where,
        ModesAtPorts(
            port_names=tuple(port_names),
            omega=2.0 * np.pi * frequency[~rigid],
            damping=damping[~rigid],
            shapes=shapes[~rigid],
            rigid_gram=shapes[rigid].T @ shapes[rigid],
            residual=np.zeros((count, count)) if residual is None else residual,
            coordinates=len(frequency),
        ),
        mass=mass,
    )
