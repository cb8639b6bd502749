r"""Identifiability of parameters and their combinations from the data.

With the Jacobian scaled by the bounds, ``J`` by ``z``, and weights *W*, the singular values of
``W^1/2 J`` say by how many standard deviations of the data the model moves when a combination of
parameters (the right singular vector) crosses its bounds; small ones are combinations that the data
do not see (Bellman & Aström 1970; Belsley, Kuh & Welsch 1980, ch. 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.measurement.shot_covariance import ShotCovariance, correlation_of, seen_by_data

__all__ = ["Identifiability", "identifiability", "identifiability_warnings"]

_STRONG = 0.95
_WIDE = 1.0
_MOST_PART = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class Identifiability:
    """Identifiability from the sensitivities alone, without scatter.

    Parameters
    ----------
    singular_values : array, shape (p,) [-]
        Falling; of the weighted Jacobian by the scaled parameters.
    directions : array, shape (p, p) [-]
        Rows: the combinations that belong to them.
    correlation : array, shape (p, p) [-]
        Of the estimates for independent samples of the weights' variance: a property of what was
        measured, not of how the strokes scatter.
    """

    singular_values: NDArray[np.float64]
    directions: NDArray[np.float64]
    correlation: NDArray[np.float64]


def identifiability(jacobian: NDArray[np.float64], weights: NDArray[np.float64]) -> Identifiability:
    """Judge a Jacobian, shape (m, p) by the scaled parameters, with weights (m,)."""
    A = np.sqrt(weights)[:, None] * jacobian
    _, values, directions = np.linalg.svd(A, full_matrices=False)
    seen = seen_by_data(jacobian, weights)
    covariance = np.full((seen.size, seen.size), np.nan)
    part = A[:, seen]
    covariance[np.ix_(seen, seen)] = np.linalg.pinv(part.T @ part, rcond=1e-15, hermitian=True)
    return Identifiability(
        singular_values=values, directions=directions, correlation=correlation_of(covariance)
    )


def identifiability_warnings(
    names: Sequence[str],
    z: NDArray[np.float64],
    found: Identifiability,
    covariance: ShotCovariance,
) -> tuple[str, ...]:
    """Warnings on what the data do not determine.

    Parameters
    ----------
    names : sequence of str
    z : array, shape (p,) [-]
        Scaled parameters where the fit ended.
    found : Identifiability
    covariance : ShotCovariance
        Of the scaled parameters.
    """
    C, error = covariance.covariance, covariance.standard_error
    notes = [
        f"The data do not depend on '{name}': it stays at its start value. "
        "Remove it from the calibration, or measure something that it affects."
        for name, e in zip(names, error, strict=True)
        if np.isinf(e)
    ]
    alone = np.isfinite(error) & (error > _WIDE)
    notes += [
        f"The data do not determine '{name}': its standard error is {e:.2g} times the range "
        "between its bounds. Fix it, or fit more channels."
        for name, e, wide in zip(names, error, alone, strict=True)
        if wide
    ]
    notes += _wide_combinations(names, C, alone)
    for i, first in enumerate(names):
        for j in range(i):
            design, whole = found.correlation[i, j], covariance.correlation[i, j]
            enough = covariance.degrees > len(names) + 1
            strongest = whole if enough and abs(whole) > abs(design) else design
            if abs(strongest) > _STRONG:
                ways = "the same way" if strongest > 0 else "opposite ways"
                notes.append(
                    f"'{names[j]}' and '{first}' are hard to separate (correlation "
                    f"{strongest:+.3f}): the data hardly change when both change {ways}. Their "
                    "intervals are valid, but wide; fix one of them if it is known."
                )
    for name, place in zip(names, z, strict=True):
        if place < 1e-3 or place > 1.0 - 1e-3:
            side = "lower" if place < 0.5 else "upper"
            notes.append(
                f"'{name}' ended at its {side} bound: its interval is not reliable. "
                "Widen the bounds if they are not a physical limit; else another parameter "
                "or a part of the model is wrong."
            )
    return tuple(notes)


def _wide_combinations(
    names: Sequence[str], C: NDArray[np.float64], alone: NDArray[np.bool_]
) -> list[str]:
    """Combinations of parameters that may cross their bounds within one standard error."""
    known = np.isfinite(np.diag(C)) & ~alone
    if known.sum() < 2:
        return []
    variances, vectors = np.linalg.eigh(C[np.ix_(known, known)])
    kept = [name for name, ok in zip(names, known, strict=True) if ok]
    notes = []
    for variance, vector in zip(variances, vectors.T, strict=True):
        if variance > _WIDE**2:
            parts = [name for name, v in zip(kept, vector, strict=True) if abs(v) > _MOST_PART]
            notes.append(
                f"A combination of {', '.join(parts)} is not determined: it may cross the whole "
                "range between the bounds within one standard error."
            )
    return notes
