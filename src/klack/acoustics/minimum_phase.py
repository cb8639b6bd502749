r"""Causal filters of a given magnitude that answer as early as possible.

A magnitude alone does not say when a filter answers.  Of all causal and stable filters of one
magnitude the minimum-phase one gathers its energy first; its phase is the Hilbert transform of the
logarithm of its magnitude (Oppenheim and Schafer, Discrete-Time Signal Processing, ch. 12).
"""

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["minimum_phase_filter"]


def minimum_phase_filter(magnitude: NDArray[np.float64]) -> NDArray[np.complex128]:
    r"""Frequency response of minimum phase with a given magnitude.

    .. math:: \ln H = \mathcal F\{ w_n\, \mathcal F^{-1}\{\ln |H|\} \}, \qquad
              w_0 = w_{N/2} = 1,\ w_n = 2 \ (0 < n < N/2),\ w_n = 0 \ (n > N/2)

    Parameters
    ----------
    magnitude : array, shape (N/2 + 1,)
        At N/2 + 1 frequencies, evenly from 0 to half the sampling rate; above zero everywhere.
        The cepstrum must have died out within N/2 samples, so N is taken much longer than the
        filter rings.

    Returns
    -------
    complex array, shape (N/2 + 1,)

    Examples
    --------
    A filter that is of minimum phase already comes back, here 1 + 0.5 z^-1:

    >>> z = np.exp(-1j * np.linspace(0.0, np.pi, 65))
    >>> bool(np.allclose(minimum_phase_filter(abs(1.0 + 0.5 * z)), 1.0 + 0.5 * z))
    True
    """
    n = 2 * (magnitude.size - 1)
    cepstrum = scipy.fft.irfft(np.log(magnitude), n)
    cepstrum[1 : n // 2] *= 2.0
    cepstrum[n // 2 + 1 :] = 0.0
    response: NDArray[np.complex128] = np.exp(scipy.fft.rfft(cepstrum))
    return response
