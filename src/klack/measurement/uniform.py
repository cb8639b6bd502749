"""Uniform time axis of records."""

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["uniform_step"]

_JITTER = 0.01
"""Largest deviation of a sample from a uniform axis, in steps: text files round their times."""


def uniform_step(time: NDArray[np.float64], where: str) -> float:
    """Step of a uniform time axis [s].

    Parameters
    ----------
    time : array, shape (n,) [s]
        At least two times.
    where : str
        Named in the error.

    Raises
    ------
    InputError
        If a time is more than 1 % of a step beside the uniform axis, or the time does not rise.
    """
    n = time.size
    step = float(time[-1] - time[0]) / (n - 1) if time.ndim == 1 and n > 1 else 0.0
    if not step > 0.0:
        raise InputError(
            where,
            got=f"{n} times from {time[0] if n else 0:g} s",
            expected="at least two rising times",
            hint="check the time channel and its unit.",
        )
    worst = float(np.max(np.abs(time - time[0] - step * np.arange(n)))) / step
    if not worst <= _JITTER:  # also nan
        raise InputError(
            where,
            got=f"samples up to {worst:.2g} steps off a uniform axis",
            expected="uniform sampling",
            hint="interpolate the record to one step first.",
        )
    return step
