r"""Compliance that modes miss, from frequency responses of the same body.

Far below the modes that are left out, the difference

.. math:: H(\omega) - \sum_k \frac{\varphi_k \varphi_k^T}{\omega_k^2 - \omega^2
          + 2 i \zeta_k \omega_k \omega}

is the real constant that belongs into the feedthrough.  It is fitted with weights ``1/|sum|``, so
that the resonances, where five decimals of a frequency matter, have no say.
"""

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["fit_residual"]

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
    """Residual compliance [m/N] between two places.

    Parameters
    ----------
    where : str
        File and places, for messages.
    frequency, response : array, shape (n,) [Hz], [m/N]
    omega, damping, product : array, shape (m,) [rad/s], [-], [1/kg]
        Modes, rigid ones included, and the product of their shapes at both places.

    Raises
    ------
    InputError
        If there are fewer than three frequencies below half the highest mode, or if modes and
        responses disagree by more than a tenth in the median.
    """
    low = frequency <= _HIGHEST * float(omega.max(initial=0.0)) / (2.0 * np.pi)
    if np.sum(low) < _FEWEST:
        raise InputError(
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
    if not apart <= _AGREEMENT:
        raise InputError(
            where,
            got=f"responses that differ from the modes by {100 * apart:.3g} % in the median",
            expected="at most 10 %",
            hint="modes and responses belong to different bodies, supports or units.",
        )
    return residual
