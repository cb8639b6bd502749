"""Reduced bodies from modes with their responses, and from Craig-Bampton matrices."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.bodies.reduction.damping import Damping
from klack.bodies.reduction.given_modes import RIGID_FREQUENCY, ModesAtPorts, body_of_modes
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import InputError, refuse_if

__all__ = ["body_of_craig_bampton", "body_of_modal_data", "fit_residual"]


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
    frequency, damping (m,) [Hz], [-]
    shapes (m, n_ports) [1/sqrt(kg)]
        Mean displacement of each port along +z, weighted as its force.
    residual (n_ports, n_ports) [m/N]
        Compliance of the omitted modes.
    mass [kg]
        As of :func:`klack.bodies.reduction.given_modes.body_of_modes`.
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


_SYMMETRIC = 1e-6
_SINGULAR = 1e-13


def body_of_craig_bampton(
    name: str,
    K: NDArray[np.float64],
    M: NDArray[np.float64],
    *,
    port_names: Sequence[str],
    rows: Sequence[int],
    damping: Damping,
    where: str,
    mass: float | None = None,
) -> ReducedBody:
    r"""Solve the reduced eigenvalue problem and take the ports from the boundary rows.

    The matrices of boundary displacements and fixed-interface coordinates are small: all modes of
    :math:`K \varphi = \omega^2 M \varphi` are kept.  Rejects asymmetry, an M that is not positive
    definite and a K that is not semidefinite.

    Parameters
    ----------
    K, M (n, n) [N/m], [kg]
    rows
        Of the boundary displacement of each port, from 0: its shape.
    mass [kg]
        As of :func:`klack.bodies.reduction.given_modes.body_of_modes`.
    """
    for key, matrix in (("K", K), ("M", M)):
        apart = float(np.max(np.abs(matrix - matrix.T)))
        if apart > _SYMMETRIC * float(np.max(np.abs(matrix))):
            i, j = np.unravel_index(int(np.argmax(np.abs(matrix - matrix.T))), matrix.shape)
            raise InputError(
                f"{where}: {key}",
                got=f"{matrix[i, j]:.6g} in row {i + 1}, column {j + 1} and {matrix[j, i]:.6g} "
                "in the transposed place",
                expected="a symmetric matrix",
                hint="rotating and damping terms are not supported; export only K and M.",
            )
    omega2, shapes = _all_modes(where, 0.5 * (K + K.T), 0.5 * (M + M.T))
    limit = (2.0 * np.pi * RIGID_FREQUENCY) ** 2 + 1e-12 * float(np.max(np.abs(omega2)))
    refuse_if(
        omega2[0] < -limit,
        f"{where}: K",
        got=f"a negative stiffness (lowest omega^2 {omega2[0]:.4g} 1/s^2)",
        expected="a stiffness of 0 or more in every direction: otherwise the body is unstable",
        hint="export K without preload and geometric stiffness.",
    )
    rigid = omega2 < limit
    at_ports = shapes[list(rows)].T
    omega = np.sqrt(omega2[~rigid])
    return body_of_modes(
        name,
        where,
        ModesAtPorts(
            port_names=tuple(port_names),
            omega=omega,
            damping=damping.ratios(omega),
            shapes=at_ports[~rigid],
            rigid_gram=at_ports[rigid].T @ at_ports[rigid],
            residual=np.zeros((len(rows), len(rows))),
            coordinates=len(K),
        ),
        mass=mass,
    )


def _all_modes(
    where: str, K: NDArray[np.float64], M: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """All modes, mass-normalised; scaled first, as modal and physical coordinates differ much."""
    diagonal = np.diag(M)
    if np.all(diagonal > 0):
        scale = 1.0 / np.sqrt(diagonal)
        M = M * np.outer(scale, scale)
        lowest = float(np.linalg.eigvalsh(M)[0])
        if lowest > _SINGULAR:
            omega2, vectors = scipy.linalg.eigh(K * np.outer(scale, scale), M)
            return omega2, vectors * scale[:, None]
    raise InputError(
        f"{where}: M",
        got="a mass matrix that is singular or negative",
        expected="mass above 0 in every coordinate",
        hint="leave out coordinates without mass (statically condensed rotations, multipliers).",
    )


_HIGHEST = 0.5  # of the highest mode: above, the modes left out are no constant
_FEWEST = 3
_AGREEMENT = 0.1


def fit_residual(
    where: str,
    frequency: NDArray[np.float64],
    response: NDArray[np.complex128],
    *,
    omega: NDArray[np.float64],
    damping: NDArray[np.float64],
    product: NDArray[np.float64],
) -> float:
    r"""Residual compliance [m/N] between two places.

    Far below the omitted modes, the difference

    .. math:: H(\omega) - \sum_k \frac{\varphi_k \varphi_k^T}{\omega_k^2 - \omega^2
              + 2 i \zeta_k \omega_k \omega}

    is the real constant of the feedthrough. The weights ``1/|sum|`` silence the resonances, where
    five decimals of a frequency matter.

    Rejects fewer than three frequencies below half the highest mode, and modes that disagree with
    the responses by more than a tenth in the median.

    Parameters
    ----------
    frequency, response (n,) [Hz], [m/N]
    omega, damping, product (m,) [rad/s], [-], [1/kg]
        Modes, rigid ones included; product of their shapes at both places.
    """
    low = frequency <= _HIGHEST * float(omega.max(initial=0.0)) / (2.0 * np.pi)
    refuse_if(
        np.sum(low) < _FEWEST,
        where,
        got=f"{int(np.sum(low))} frequencies below half of the highest mode",
        expected=f"at least {_FEWEST}",
        hint="export the responses over the range of the modes, or leave them out.",
    )
    w = 2.0 * np.pi * frequency[low, None]
    modal = np.sum(product / (omega**2 - w**2 + 2j * damping * omega * w), axis=1)
    missing = response[low] - modal
    weight = 1.0 / np.maximum(np.abs(modal), 1e-12 * np.abs(modal).max(initial=1e-300)) ** 2
    residual = float(np.sum(weight * missing.real) / np.sum(weight))
    size = np.maximum(np.abs(response[low]), 1e-300)
    apart = float(np.median(np.abs(missing - residual) / size))
    refuse_if(
        not apart <= _AGREEMENT,
        where,
        got=f"responses with a median difference of {100 * apart:.3g} % from the modes",
        expected="at most 10 %",
        hint="modes and responses belong to different bodies, supports or units.",
    )
    return residual
