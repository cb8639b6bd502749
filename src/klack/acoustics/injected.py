r"""Energy that forces bring into a structure, over frequency.

.. math:: \int F v\,\mathrm dt = \int_0^\infty 2\, \mathrm{Re}(Y)\, |\hat F|^2\,\mathrm df

Only damping takes up power for good: the density is what the modes lose until they rest. With the
spectrum of the *steps* of the force it stays finite for a force that begins or ends above zero:

.. math:: e(f) = 2 \sum_i 2 \zeta_i \omega_i \left| H_i \sum_p \varphi_{ip}\,
          \widehat{\mathrm dF}_p \right|^2

Its integral is the energy into vibration: injected, less the change of the static energy.
"""

from collections.abc import Mapping

import numpy as np
import scipy

from klack.acoustics.force_response import aligned_forces
from klack.bodies.reduction.structure import Structure
from klack.errors import refuse_if
from klack.machine.compiling.jit import njit
from klack.signals.sampled import Spectrum, TimeSeries

__all__ = ["injected_density", "injected_energy"]

_PER_HALF_WIDTH = 3.0  # frequencies per zeta f: the trapezoidal rule errs by 2 exp(-2 pi 3) = 1e-8


def injected_density(
    structure: Structure, forces: Mapping[str, TimeSeries], *, resolution: float | None = None
) -> Spectrum:
    """Density of the energy that the modes lose, from the first force to rest [J/Hz]; one-sided.

    Rejects undamped modes, whose spectrum is a row of lines.

    Parameters
    ----------
    forces [N]
        By port, along +z, constant over intervals; the last value is held.
    resolution [Hz]
        Inverse of the time left to decay; default: a third of the narrowest half width ``zeta f``.
    """
    width = structure.damping * structure.omega / (2.0 * np.pi)
    refuse_if(
        not np.all(width > 0.0),
        f"injected energy of '{structure.name}' over frequency",
        got=f"{int(np.sum(width <= 0.0))} modes without damping",
        expected="damping in every mode",
        hint=f"give bodies.{structure.name}.damping, or take the energy from modal_response.",
    )
    axis, values = aligned_forces(structure, forces)
    step, spacing = axis.step, resolution or float(width.min()) / _PER_HALF_WIDTH
    # room for the vibration to die away after the record: what is cut off comes back at its start
    n = scipy.fft.next_fast_len(len(values) + int(np.ceil(1.0 / (spacing * step))), real=True)
    steps = np.diff(values, axis=0, prepend=values[:1])
    frequency = scipy.fft.rfftfreq(n, step)
    turned = scipy.fft.rfft(steps, n, axis=0)
    density = _density(
        2.0 * np.pi * frequency, turned, structure.omega, structure.damping, structure.port_shapes
    )
    return Spectrum(frequency=frequency, values=density, unit="J/Hz", name=structure.name)


def injected_energy(density: Spectrum) -> float:
    """Integral of :func:`injected_density` [J]."""
    return float(np.trapezoid(np.real(density.values), density.frequency))


@njit
def _density(omega, steps, w, zeta, phi):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Losses of all modes at all frequencies, shape (k,)."""
    out = np.zeros(omega.size)
    for k in range(omega.size):
        square = omega[k] * omega[k]
        for i in range(w.size):
            real, imag = 0.0, 0.0
            for p in range(phi.shape[1]):
                real += phi[i, p] * steps[k, p].real
                imag += phi[i, p] * steps[k, p].imag
            a, b = w[i] * w[i] - square, 2.0 * zeta[i] * w[i] * omega[k]
            out[k] += 4.0 * zeta[i] * w[i] * (real * real + imag * imag) / (a * a + b * b)
    return out
