"""Several objectives as one number: how far a point is from what is wished for."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError
from klack.studies.values import values_of_points

__all__ = ["achievement"]


def achievement(
    objectives: ArrayLike, reference: ArrayLike, scales: ArrayLike, *, sum_weight: float = 1e-3
) -> NDArray[np.float64]:
    r"""Augmented achievement function of every point, to be minimised.

    .. math:: s = \max_i \frac{f_i - z_i}{w_i} + \rho \sum_i \frac{f_i - z_i}{w_i}

    Its minimum is on the front for any reference ``z``, reachable or not, also where the front is
    not convex; a weighted sum misses such parts.  With one objective it is that objective, shifted
    and scaled.

    Parameters
    ----------
    objectives : array_like, shape (points, objectives)
        Numbers to minimise; nan gives nan.
    reference : array_like, shape (objectives,) or (points, objectives)
        Wished-for value ``z`` of each objective, in its unit.
    scales : array_like, shape (objectives,)
        What counts as one in each objective ``w``, above zero, in its unit: its range on the front.
    sum_weight : float
        ``rho``, zero or more: which loss in one objective is traded for gains in the others.

    Raises
    ------
    InputError
        If the shapes do not fit, the reference is not finite or a scale is not above zero.

    Notes
    -----
    Wierzbicki (1980), in: Multiple Criteria Decision Making, Theory and Application, 468-486.
    """
    values = values_of_points(objectives, None).objectives
    goal, unit = np.asarray(reference, dtype=float), np.asarray(scales, dtype=float)
    if goal.shape not in (values.shape, values.shape[1:]) or not np.all(np.isfinite(goal)):
        raise InputError(
            "reference of an achievement function",
            got=f"{goal}",
            expected=f"{values.shape[1]} finite numbers, one per objective",
            hint="take the objectives of the point to improve, or the best value of each.",
        )
    if unit.shape != values.shape[1:] or not np.all((unit > 0.0) & np.isfinite(unit)):
        raise InputError(
            "scales of an achievement function",
            got=f"{unit}",
            expected=f"{values.shape[1]} numbers above zero, one per objective",
            hint="take the range of each objective on the front, and its size where that is zero.",
        )
    if not (sum_weight >= 0.0 and np.isfinite(sum_weight)):
        raise InputError(
            "weight of the sum in an achievement function",
            got=f"{sum_weight:g}",
            expected="zero or more",
            hint="0.001 is usual.",
        )
    with np.errstate(over="ignore", invalid="ignore"):  # huge values give infinity, or nan
        distances = (values - goal) / unit
        return np.asarray(distances.max(axis=1) + sum_weight * distances.sum(axis=1))
