"""Mean plus a multiple of the standard deviation, as robust design weighs it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from klack.errors import InputError
from klack.studies.samples import split_failed

__all__ = ["Margin", "mean_and_margin"]


@dataclass(frozen=True, slots=True)
class Margin:
    """Mean, scatter and their sum, with standard errors.

    Attributes
    ----------
    mean, deviation : float
        Of the runs with a value, in the unit of the measure; the standard deviation with ``n - 1``.
    multiple : float
        ``k``.
    value : float
        ``mean + k deviation``.
    mean_error, deviation_error, value_error : float
        Standard errors: standard deviations of the three over repetitions of all runs.
    runs, failed : int
        Runs with a value, and runs without one, which are not among ``runs``.
    """

    mean: float
    deviation: float
    multiple: float
    value: float
    mean_error: float
    deviation_error: float
    value_error: float
    runs: int
    failed: int


def mean_and_margin(values: ArrayLike, multiple: float) -> Margin:
    r"""Mean plus ``k`` standard deviations of independent runs, for any distribution.

    With the central moments ``m_3`` and ``m_4`` of the sample and ``s`` its standard deviation,

    .. math::

        \sigma^2(\bar x) = \frac{s^2}{n}, \quad
        \sigma^2(s) = \frac{1}{4 s^2 n} \left(m_4 - s^4 \frac{n - 3}{n - 1}\right), \quad
        \mathrm{cov}(\bar x, s) = \frac{m_3}{2 s n}

    and ``sigma^2(x + k s) = sigma^2(x) + 2 k cov(x, s) + k^2 sigma^2(s)``: exact for the mean, to
    first order in ``1 / n`` for the others.  With fewer than about 30 runs, or rare large values
    that no run has met yet, the errors of ``s`` come out too small; a quantile does not share this.

    Parameters
    ----------
    values : array_like, shape (runs,)
        In one unit; what is not finite is a failed run.
    multiple : float
        ``k``, of either sign.

    Raises
    ------
    InputError
        With fewer than two values, or if ``k`` is not finite.

    Notes
    -----
    Cramer (1946), Mathematical Methods of Statistics, sections 27.4 to 27.7.
    """
    if not math.isfinite(multiple):
        raise InputError(
            "multiple of the standard deviation",
            got=f"{multiple}",
            expected="a finite number",
            hint="3 is usual.",
        )
    found, failed = split_failed(values)
    count = len(found)
    if count < 2:
        raise InputError(
            "values of a measure",
            got=f"{count} runs with a value, {failed} without",
            expected="two runs with a value or more",
            hint="compute more runs, or look at the reasons of the failed ones.",
        )
    mean = math.fsum(found / count)
    size = float(np.abs(found - mean).max())
    if size == 0.0:
        return Margin(mean, 0.0, multiple, mean, 0.0, 0.0, 0.0, count, failed)
    scaled = (found - mean) / size  # so that fourth powers of small numbers keep their digits
    variance = math.fsum(scaled**2) / (count - 1)
    third, fourth = math.fsum(scaled**3) / count, math.fsum(scaled**4) / count
    spread = math.sqrt(variance)
    of_mean = variance / count
    of_spread = (fourth - variance**2 * (count - 3) / (count - 1)) / (4.0 * variance * count)
    of_spread = max(of_spread, 0.0)
    common = third / (2.0 * spread * count)
    of_value = max(of_mean + 2.0 * multiple * common + multiple**2 * of_spread, 0.0)
    return Margin(
        mean=mean,
        deviation=size * spread,
        multiple=multiple,
        value=mean + multiple * size * spread,
        mean_error=size * math.sqrt(of_mean),
        deviation_error=size * math.sqrt(of_spread),
        value_error=size * math.sqrt(of_value),
        runs=count,
        failed=failed,
    )
