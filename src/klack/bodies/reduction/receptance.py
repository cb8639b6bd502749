"""Receptance: displacement per force over frequency, of full and of reduced bodies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.bodies.reduction.reduced_body import ReducedBody, port_among
from klack.errors import refuse_if

__all__ = ["Receptance", "frequency_axis", "modal_sum", "observed_receptance", "reduced_receptance"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Receptance:
    """Displacement per force between the ports of a body, harmonic ``exp(+i w t)``.

    Symmetric (reciprocity), with ``imag <= 0`` on the diagonal (passivity).

    Parameters
    ----------
    frequencies (n,) [Hz]
    values (n, n_ports, n_ports) [m/N]
        ``values[:, i, j]``: displacement of port i per force at port j.
    """

    label: str
    port_names: tuple[str, ...]
    frequencies: NDArray[np.float64]
    values: NDArray[np.complex128]

    def between(self, output: str, source: str) -> NDArray[np.complex128]:
        """Displacement of ``output`` per force at ``source``, shape (n,) [m/N]."""
        return self.values[:, self._index(output), self._index(source)]

    def drive(self, port: str) -> NDArray[np.complex128]:
        """Displacement per force at the same port, shape (n,) [m/N]."""
        return self.between(port, port)

    def _index(self, port: str) -> int:
        hint = "use the names given to the ports."
        return port_among(self.port_names, port, f"receptance '{self.label}'", "it", hint)


def reduced_receptance(
    reduced: ReducedBody,
    frequencies: ArrayLike,
    *,
    with_residual: bool,
    loss_factor: float | None = None,
    label: str | None = None,
) -> Receptance:
    r"""Receptance of a reduced body.

    .. math:: G_{pq}(\omega) = \sum_i \frac{\varphi_{ip} \varphi_{iq}}
              {\omega_i^2 - \omega^2 + 2 i \zeta_i \omega_i \omega} \;[+\; R_{pq}]

    Parameters
    ----------
    frequencies (n,) [Hz]
        Ascending, above zero.
    with_residual
        Add the residual compliance ``R``, as the consistent contact law does in the time domain;
        zero with attachment modes.
    loss_factor [-]
        Structural damping ``omega_i^2 (1 + i eta)`` instead of the viscous one, as of the full
        order; equal at each resonance if ``eta = 2 zeta``.
    label
        Legend; default: number of modes and correction.
    """
    frequencies = frequency_axis("reduced_receptance: frequencies", frequencies)
    denominator = _denominator(reduced, frequencies, loss_factor)
    values = modal_sum(reduced.port_shapes, denominator)
    if with_residual:
        values = values + reduced.residual_compliance
    return Receptance(
        label=label or _label(reduced, with_residual),
        port_names=reduced.port_names,
        frequencies=frequencies,
        values=values,
    )


def observed_receptance(
    reduced: ReducedBody, frequencies: ArrayLike, *, loss_factor: float | None = None
) -> NDArray[np.complex128]:
    """Displacement of the observers per force at the ports, shape (n, n_observers, n_ports) [m/N].

    Of the modes alone, not reciprocal; parameters as of :func:`reduced_receptance`.
    """
    axis = frequency_axis("observed_receptance: frequencies", frequencies)
    products = np.einsum("mo,mp->mop", reduced.observer_shapes, reduced.port_shapes)
    return np.tensordot(1.0 / _denominator(reduced, axis, loss_factor), products, axes=(1, 0))


def _denominator(
    reduced: ReducedBody, frequencies: NDArray[np.float64], loss_factor: float | None
) -> NDArray[np.complex128]:
    """Dynamic stiffness of each mode, shape (n, m) [(rad/s)^2]."""
    omega = 2.0 * np.pi * frequencies[:, None]
    squares = reduced.omega**2
    if loss_factor is None:
        return np.asarray(
            squares - omega**2 + 2j * reduced.damping * reduced.omega * omega, dtype=np.complex128
        )
    return np.asarray(squares * (1 + 1j * loss_factor) - omega**2, dtype=np.complex128)


def modal_sum(
    shapes: NDArray[np.float64], denominator: NDArray[np.complexfloating]
) -> NDArray[np.complex128]:
    """Sum over modes of ``phi phi^T / denominator``, shape (n, p, p) [m/N].

    Parameters
    ----------
    shapes (m, p) [1/sqrt(kg)]
    denominator (n, m) [(rad/s)^2]
    """
    products = np.einsum("mp,mq->mpq", shapes, shapes)
    return np.tensordot(1.0 / denominator, products, axes=(1, 0))


def frequency_axis(where: str, frequencies: ArrayLike) -> NDArray[np.float64]:
    """Check frequencies [Hz]: one-dimensional, above zero, ascending."""
    axis = np.asarray(frequencies, dtype=float)
    refuse_if(
        axis.ndim != 1 or not axis.size or not axis[0] > 0 or not np.all(np.diff(axis) > 0),
        where,
        got=f"{axis.size} values of shape {axis.shape}",
        expected="one row of ascending frequencies above 0 Hz",
        hint="for example numpy.geomspace(1e3, 1e6, 700).",
    )
    return axis


def _label(reduced: ReducedBody, with_residual: bool) -> str:
    elastic = reduced.mode_count - reduced.rigid_count - reduced.attachment_count
    text = f"{elastic} modes"
    if reduced.attachment_count:
        text += f" + {reduced.attachment_count} attachment"
    return text + (" + residual compliance" if with_residual else "")
