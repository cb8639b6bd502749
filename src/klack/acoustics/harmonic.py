r"""Response of a structure to a harmonic force of 1 N, ``exp(+i omega t)``.

With :math:`H_i = 1/(\omega_i^2 - \omega^2 + 2 i \zeta_i \omega_i \omega)` and the mobility
:math:`Y_s` of the support (zero for a rigid hold) the blocked force and the apparent mass are

.. math:: B = 1 + \omega^2 \sum_i p_i \varphi_i H_i, \qquad
          A = M + \omega^2 \sum_i p_i^2 H_i

and the held surfaces move with :math:`v = B Y_s / (1 + i \omega A Y_s)`, the modes with
:math:`\dot q_i = i \omega H_i (\varphi_i - i \omega p_i v)`. Exact for kept modes; others respond
statically, and move with the support.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.at_mounts import blocked_force, mount_impedance
from klack.acoustics.interface import laplace
from klack.acoustics.mount import Mount, axial_freedom, moved_mass, support_mobility
from klack.acoustics.plate import Plate
from klack.bodies.reduction.structure import Structure
from klack.errors import refuse_if

__all__ = ["SUPPORT", "HarmonicResponse", "harmonic_response", "response_axis"]

SUPPORT = "support"
"""Port of a force on the held surfaces themselves, as of other bodies on the same mount."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HarmonicResponse:
    """Velocities per force at one port.

    Parameters
    ----------
    frequency (k,) [Hz]
    fields (k, b)
        Of the structure: ``q'`` of modes [1/(sqrt(kg) ...)], ``i omega`` of the static rest of the
        loaded port, velocity of the support.
    support_velocity (k,) [m/(N s)]
    support_force (k,) [-]
        Axial; of a rigid hold the blocked force, which goes to 1 towards 0 Hz. Above the kept modes
        it means nothing.
    """

    frequency: NDArray[np.float64]
    fields: NDArray[np.complex128]
    support_velocity: NDArray[np.complex128]
    support_force: NDArray[np.complex128]


def harmonic_response(
    structure: Structure,
    frequency: NDArray[np.float64],
    port: str,
    *,
    mount: Mount | None = None,
    plate: Plate | None = None,
) -> HarmonicResponse:
    """Velocities of modes, static rest and support under 1 N along +z at a port or the support.

    Parameters
    ----------
    frequency (k,) [Hz]
        Zero or above.
    mount, plate
        Below the held surfaces.
    """
    f, carried = response_axis(frequency), port == SUPPORT
    at = 0 if carried else structure.port_index(port)
    m, count = len(structure.omega), len(structure.port_names)
    omega = 2.0 * np.pi * f[:, None]
    w, zeta = structure.omega, structure.damping
    receptance = 1.0 / (w**2 - omega**2 + 2j * zeta * w * omega)
    phi, p = structure.port_shapes[:, at] * (not carried), structure.participation
    omega, s = omega[:, 0], laplace(f)
    force = np.ones(f.size, dtype=complex)
    if not carried:
        driven_port = np.zeros((f.size, count), dtype=complex)
        driven_port[:, at] = 1.0
        force = blocked_force(axial_freedom(structure, structure.mass), driven_port, s)[:, 0]
    velocity = np.zeros(f.size, dtype=complex)
    if mount is not None or plate is not None:
        own = mount_impedance(axial_freedom(structure, moved_mass(structure, mount)), s)[:, 0, 0]
        below = support_mobility(f, mount, plate)
        force = force / (1.0 + own * below)
        velocity = force * below
    fields = np.zeros((f.size, m + count + 1), dtype=complex)
    driven = phi - 1j * (omega * velocity)[:, None] * p
    fields[:, :m] = 1j * omega[:, None] * receptance * driven
    if not carried:
        fields[:, m + at] = 1j * omega
    fields[:, -1] = velocity
    return HarmonicResponse(
        frequency=f, fields=fields, support_velocity=velocity, support_force=force
    )


def response_axis(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Check frequencies [Hz]: one row, none below zero."""
    f = np.asarray(frequency, dtype=float)
    refuse_if(
        f.ndim != 1 or not f.size or not np.all(f >= 0.0),
        "frequency",
        got=f"an array of shape {f.shape}, lowest {np.min(f, initial=np.inf):g} Hz",
        expected="one row of frequencies, none below 0 Hz",
        hint="for example numpy.geomspace(20.0, 2e5, 2000).",
    )
    return f
