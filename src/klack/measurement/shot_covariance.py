r"""Uncertainty of fitted parameters when whole strokes scatter, not single samples.

Noise averages out over the thousands of samples of a stroke, differences between strokes do not:
the residuals of one stroke move together. The usual covariance ``s^2 (J^T J)^-1`` of independent
samples is far too small. Strokes are independent; each alone would give the parameters

.. math:: \theta_s = \theta + (J^T W J)^{-1} J^T W r_s, \qquad
          C = \frac{1}{n (n - 1)} \sum_s (\theta_s - \bar\theta)(\theta_s - \bar\theta)^T ,

one Gauss-Newton step with residuals ``r_s = y_s - f(theta)``. This "sandwich" of White (1980) with
strokes as clusters (Liang & Zeger 1986) is right for any weights *W* and any correlation within a
stroke. Intervals take Student's t with ``n - 1`` degrees of freedom. Since strokes share *J*,
fitting the mean stroke is fitting all strokes.

Limits: scatter is small enough for one linear step; with few strokes (n near the number of
parameters) correlations, not single errors, become unreliable.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = [
    "Identifiability",
    "ShotCovariance",
    "identifiability",
    "identifiability_warnings",
    "noise_covariance",
    "seen_by_data",
    "shot_covariance",
    "shot_estimates",
]


Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_NOTHING = 1e-9
"""Relative sensitivity below which the data do not depend on a parameter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShotCovariance:
    """Uncertainty of the parameters, in the units of the Jacobian.

    Parameters
    ----------
    covariance (p, p)
        inf on the diagonal of parameters that the data do not see.
    degrees
        Of freedom of Student's t.
    estimates (n, p)
        Of every stroke alone, or empty.
    """

    covariance: Matrix
    degrees: int
    estimates: Matrix

    @property
    def standard_error(self) -> Vector:
        """Of every parameter, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def quantile(self) -> float:
        """Standard errors to each end of the 95 % interval."""
        return float(scipy.stats.t.ppf(0.975, self.degrees))

    @property
    def correlation(self) -> Matrix:
        """Correlation (p, p); 0 for parameters without effect."""
        return correlation_of(self.covariance)


def correlation_of(covariance: Matrix) -> Matrix:
    """Correlation matrix; 0 where a variance is 0 or infinite."""
    deviation = np.sqrt(np.diag(covariance))
    known = np.isfinite(deviation) & (deviation > 0.0)
    scale = np.where(known, 1.0 / np.where(known, deviation, 1.0), 0.0)
    result = np.where(np.isfinite(covariance), covariance, 0.0) * np.outer(scale, scale)
    np.fill_diagonal(result, 1.0)
    return np.asarray(np.clip(result, -1.0, 1.0))


def seen_by_data(jacobian: Matrix, weights: Vector) -> NDArray[np.bool_]:
    """Parameters that the data respond to at all, shape (p,)."""
    size = np.sqrt(weights @ jacobian**2)
    return np.asarray(size > _NOTHING * max(float(size.max(initial=0.0)), 1e-300))


def shot_estimates(jacobian: Matrix, weights: Vector, residuals: Matrix) -> Matrix:
    """Parameter step of each stroke, shape (n, p); nan for parameters that the data do not see.

    Parameters
    ----------
    jacobian (m, p)
    weights (m,)
    residuals (n, m)
        Measured less computed.
    """
    root = np.sqrt(weights)
    seen = seen_by_data(jacobian, weights)
    steps = np.full((residuals.shape[0], jacobian.shape[1]), np.nan)
    A = root[:, None] * jacobian[:, seen]
    scale = np.linalg.norm(A, axis=0)
    solution = np.linalg.lstsq(A / scale, (root * residuals).T, rcond=1e-12)[0]
    steps[:, seen] = (solution / scale[:, None]).T
    return steps


def shot_covariance(jacobian: Matrix, weights: Vector, residuals: Matrix) -> ShotCovariance:
    """Covariance of the parameters from the scatter of two or more strokes.

    Arguments as of :func:`shot_estimates`.
    """
    steps = shot_estimates(jacobian, weights, residuals)
    seen = ~np.isnan(steps[0])
    n, p = steps.shape
    covariance = np.full((p, p), np.nan)
    covariance[np.ix_(seen, seen)] = np.atleast_2d(np.cov(steps[:, seen].T)) / n
    covariance[~seen, ~seen] = np.inf
    return ShotCovariance(covariance=covariance, degrees=n - 1, estimates=steps)


def noise_covariance(jacobian: Matrix, weights: Vector, residual: Vector) -> ShotCovariance:
    """Covariance from the residuals of a single stroke: its own noise, no scatter of strokes.

    ``C = s^2 tau (J^T W J)^-1``, with ``tau`` samples that move together by the autocorrelation of
    the weighted residuals up to its first zero. Too small as soon as strokes differ.
    """
    seen = seen_by_data(jacobian, weights)
    used = weights > 0.0
    r = np.sqrt(weights[used]) * residual[used]
    degrees = max(r.size - int(seen.sum()), 1)
    p = jacobian.shape[1]
    A = np.sqrt(weights)[:, None] * jacobian[:, seen]
    covariance = np.full((p, p), np.nan)
    inverse = np.linalg.pinv(A.T @ A, rcond=1e-15, hermitian=True)
    variance = float(r @ r) / degrees * _together(r)
    covariance[np.ix_(seen, seen)] = variance * inverse
    covariance[~seen, ~seen] = np.inf
    empty = np.empty((0, p))
    return ShotCovariance(covariance=covariance, degrees=degrees, estimates=empty)


def _together(r: Vector) -> float:
    """Number of neighbouring samples that count as one."""
    n = r.size
    spectrum = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n]
    if not correlation[0] > 0.0:
        return 1.0
    correlation /= correlation[0]
    below = np.flatnonzero(correlation <= 0.0)
    last = int(below[0]) if below.size else n
    return float(1.0 + 2.0 * correlation[1:last].sum())


_STRONG = 0.95
_WIDE = 1.0
_MOST_PART = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class Identifiability:
    """Identifiability from the sensitivities alone, without scatter.

    With the Jacobian ``J`` by ``z`` and weights *W*, the singular values of ``W^1/2 J`` say by how
    many standard deviations of the data the model moves when a combination of parameters (right
    singular vector) crosses its bounds; the data do not see small ones (Bellman & Aström 1970;
    Belsley, Kuh & Welsch 1980, ch. 3).

    Parameters
    ----------
    singular_values (p,) [-]
        Falling.
    directions (p, p) [-]
        Combinations in rows.
    correlation (p, p) [-]
        Of the estimates for independent samples: a property of what was measured, not of the
        scatter of strokes.
    """

    singular_values: NDArray[np.float64]
    directions: NDArray[np.float64]
    correlation: NDArray[np.float64]


def identifiability(jacobian: NDArray[np.float64], weights: NDArray[np.float64]) -> Identifiability:
    """Judge a Jacobian (m, p) by the scaled parameters, with weights (m,)."""
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
    """Warnings on what the data do not determine, by scaled parameters z and their covariance."""
    C, error = covariance.covariance, covariance.standard_error
    notes = [
        f"The data do not depend on '{name}': it stays at its start value. Remove it from the "
        "calibration, or measure a quantity that it affects."
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
                f"'{name}' ended at its {side} bound: its interval is not reliable. Widen the "
                "bounds if they are not physical limits; otherwise another parameter or a part "
                "of the model is wrong."
            )
    return tuple(notes)


def _wide_combinations(
    names: Sequence[str], C: NDArray[np.float64], alone: NDArray[np.bool_]
) -> list[str]:
    """Combinations that may cross their bounds within one standard error."""
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
