"""Frequency limit of a reduced body: its receptance against that of the full body.

The magnitude of the deviation in decibels, ``20 log10 |G_reduced / G_full|``, is averaged over a
sliding window of one-third octave (equal weight per logarithmic frequency):

- A point-wise limit would be decided by antiresonances, where a shift of a fraction of a per cent
  gives tens of decibels over a negligible share of the band.
- An energy mean over the band would be decided by the resonances alone, which the modes have right
  by construction; a missing static share would go unnoticed.
- The mean *magnitude* of the level difference counts resonances, antiresonances and everything
  between by the share of the band that they spoil.

Both have the same declared loss factor, so that every peak and notch is finite; the axis should
have at least two points per half-power bandwidth (``ln 2 / eta`` per octave and more).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.bodies.reduction.receptance import Receptance
from klack.errors import InputError, require_positive

__all__ = [
    "TransferComparison",
    "compare_curves",
    "compare_receptances",
    "mean_level_deviation",
    "valid_up_to",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class TransferComparison:
    """Receptances at one port, the reference first.

    Parameters
    ----------
    frequencies (n,) [Hz]
    labels (k,)
    curves (k, n) [m/N]
    level_deviations (k, n) [dB]
        Against the first curve.
    mean_deviations (k, n) [dB]
        Of the magnitude, over one-third octave.
    tolerance [dB]
    valid_up_to (k,) [Hz]
        Frequency below which the mean deviation stays within the tolerance; 0 if it never does,
        the top of the axis if it always does.
    loss_factor [-]
    reference_note
        What the reference is and how it was verified.
    """

    body: str
    port: str
    frequencies: NDArray[np.float64]
    labels: tuple[str, ...]
    curves: NDArray[np.complex128]
    level_deviations: NDArray[np.float64]
    mean_deviations: NDArray[np.float64]
    tolerance: float
    valid_up_to: NDArray[np.float64]
    loss_factor: float
    reference_note: str


def compare_receptances(
    reference: Receptance,
    candidates: Sequence[Receptance],
    port: str,
    *,
    body: str,
    loss_factor: float,
    reference_note: str,
    tolerance: float = 1.0,
) -> TransferComparison:
    """Compare receptances of reduced bodies with that of the full one, on one axis."""
    for candidate in candidates:
        if not np.array_equal(candidate.frequencies, reference.frequencies):
            raise InputError(
                f"compare_receptances: '{candidate.label}'",
                got=f"{len(candidate.frequencies)} frequencies",
                expected=f"the {len(reference.frequencies)} frequencies of the reference",
                hint="compute all receptances on one axis.",
            )
    return compare_curves(
        reference.frequencies,
        {item.label: item.drive(port) for item in (reference, *candidates)},
        body=body,
        port=port,
        loss_factor=loss_factor,
        reference_note=reference_note,
        tolerance=tolerance,
    )


def compare_curves(
    frequencies: NDArray[np.float64],
    curves: Mapping[str, NDArray[np.complex128]],
    *,
    body: str,
    port: str,
    loss_factor: float,
    reference_note: str,
    tolerance: float = 1.0,
) -> TransferComparison:
    """Compare transfer functions with the first of them.

    Parameters
    ----------
    frequencies (n,) [Hz]
    curves
        By label, shape (n,) [m/N].
    tolerance [dB]
    """
    require_positive("compare_curves: tolerance", tolerance, "dB")
    values = np.array(list(curves.values()))
    levels = 20.0 * np.log10(np.abs(values / values[0]))
    means = np.array([mean_level_deviation(frequencies, level) for level in levels])
    return TransferComparison(
        body=body,
        port=port,
        frequencies=frequencies,
        labels=tuple(curves),
        curves=values,
        level_deviations=levels,
        mean_deviations=means,
        tolerance=tolerance,
        valid_up_to=np.array([valid_up_to(frequencies, m, tolerance) for m in means]),
        loss_factor=loss_factor,
        reference_note=reference_note,
    )


def mean_level_deviation(
    frequencies: NDArray[np.float64], level: NDArray[np.float64], octaves: float = 1.0 / 3.0
) -> NDArray[np.float64]:
    """Magnitude of a level difference over a sliding window of log frequency, shape (n,) [dB].

    Parameters
    ----------
    level (n,) [dB]
    octaves
        Window; at the ends of the axis it is cut, not shifted.

    Examples
    --------
    >>> f = np.geomspace(1.0, 8.0, 31)
    >>> np.allclose(mean_level_deviation(f, np.full(31, -2.0)), 2.0)
    True
    """
    x = np.log2(frequencies)
    magnitude = np.abs(level)
    steps = np.diff(x) * (magnitude[1:] + magnitude[:-1]) / 2.0
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    low = np.maximum(x - octaves / 2.0, x[0])
    high = np.minimum(x + octaves / 2.0, x[-1])
    return (np.interp(high, x, integral) - np.interp(low, x, integral)) / (high - low)


def valid_up_to(
    frequencies: NDArray[np.float64], deviation: NDArray[np.float64], tolerance: float
) -> float:
    """Highest frequency [Hz] below which ``deviation`` never exceeds ``tolerance`` (0 if none).

    Examples
    --------
    >>> valid_up_to(np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.1, 0.5, 1.2, 0.3]), 1.0)
    2.0
    """
    exceeded = np.flatnonzero(~(deviation <= tolerance))
    if not exceeded.size:
        return float(frequencies[-1])
    return float(frequencies[exceeded[0] - 1]) if exceeded[0] else 0.0
