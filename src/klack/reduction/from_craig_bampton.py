r"""From reduced stiffness and mass (Craig and Bampton 1968) to modes at ports.

The matrices of boundary displacements and fixed-interface coordinates are small, so all modes of
:math:`K \varphi = \omega^2 M \varphi` are computed and kept; nothing is lost.  The shape of a port
is the row of its boundary displacement.
"""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import InputError
from klack.reduction.damping import Damping
from klack.reduction.given_modes import RIGID_FREQUENCY, ModesAtPorts, body_of_modes
from klack.reduction.reduced_body import ReducedBody

__all__ = ["body_of_craig_bampton"]

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
    """Solve the reduced eigenvalue problem and take the ports from the boundary rows.

    Parameters
    ----------
    name : str
    K, M : array, shape (n, n) [N/m], [kg]
    port_names : sequence of str
    rows : sequence of int
        Row of the boundary displacement of each port, from 0.
    damping : Damping
    where : str
        File, for messages.
    mass : float, optional [kg]

    Raises
    ------
    InputError
        If the matrices are not symmetric, M is not positive definite or K not semidefinite.
    """
    for key, matrix in (("K", K), ("M", M)):
        apart = float(np.max(np.abs(matrix - matrix.T)))
        if apart > _SYMMETRIC * float(np.max(np.abs(matrix))):
            i, j = np.unravel_index(int(np.argmax(np.abs(matrix - matrix.T))), matrix.shape)
            raise InputError(
                f"{where}: {key}",
                got=f"{matrix[i, j]:.6g} in row {i + 1}, column {j + 1} and {matrix[j, i]:.6g} "
                "across",
                expected="a symmetric matrix",
                hint="rotating and damping terms are not supported; export K and M alone.",
            )
    omega2, shapes = _all_modes(where, 0.5 * (K + K.T), 0.5 * (M + M.T))
    limit = (2.0 * np.pi * RIGID_FREQUENCY) ** 2 + 1e-12 * float(np.max(np.abs(omega2)))
    if omega2[0] < -limit:
        raise InputError(
            f"{where}: K",
            got=f"a negative stiffness (lowest omega^2 {omega2[0]:.4g} 1/s^2)",
            expected="a stiffness of 0 or more in every direction: else the body is unstable",
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
