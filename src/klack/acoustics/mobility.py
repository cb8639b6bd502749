r"""Mobility: velocity per force between the ports of a structure.

.. math:: Y_{pq} = i\omega \left( \sum_i \frac{\varphi_{ip} \varphi_{iq}}
          {\omega_i^2 - \omega^2 + 2 i \zeta_i \omega_i \omega} + R_{pq} \right)

``R`` is the residual compliance, a spring that takes up no power. On a mount the motion of the
support is added. Symmetric (reciprocity); the real part at the driven port is never below zero.
"""

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.harmonic import harmonic_response
from klack.acoustics.mount import Mount
from klack.acoustics.plate import Plate
from klack.bodies.reduction.structure import Structure

__all__ = ["transfer_mobility"]


def transfer_mobility(
    structure: Structure,
    output: str,
    source: str,
    frequency: NDArray[np.float64],
    *,
    mount: Mount | None = None,
    plate: Plate | None = None,
    residual: bool = True,
) -> NDArray[np.complex128]:
    """Velocity of one port per force at another [m/(N s)], ``exp(+i omega t)``, shape (k,).

    Parameters
    ----------
    frequency (k,) [Hz]
    mount, plate
        Below the held surfaces.
    residual
        Add ``R``.
    """
    answer = harmonic_response(structure, frequency, source, mount=mount, plate=plate)
    i, j = structure.port_index(output), structure.port_index(source)
    m = len(structure.omega)
    velocity = answer.fields[:, :m] @ structure.port_shapes[:, i] + answer.support_velocity
    if residual:
        omega = 2.0 * np.pi * answer.frequency
        velocity = velocity + 1j * omega * structure.residual_compliance[i, j]
    return velocity
