"""Values that are not finite."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError

__all__ = ["require_finite"]


def require_finite(run: str, step: float, record: Mapping[str, NDArray[np.floating]]) -> None:
    """Reject a record with NaN or infinity in it, with the name and time of the first one.

    Parameters
    ----------
    run
        What was run, start of the text.
    step [s]
        From one row of the record to the next.

    Examples
    --------
    >>> require_finite("simulate", 1e-6, {"contact force": np.zeros(5)})
    """
    first: tuple[int, str] | None = None
    for name, values in record.items():
        if np.isfinite(values.sum(dtype=float)):  # one number of them would show in the sum
            continue
        wrong = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        row = int(np.argmax(wrong))
        if wrong[row] and (first is None or row < first[0]):
            first = row, name
    if first is not None:
        raise ConvergenceError(
            f"{run}: {first[1]} is not a finite number {1e6 * step * first[0]:.4g} us after the "
            "start of the record.\n"
            "Try: check the bodies, materials and laws for nan and inf; a shorter step."
        )
