"""How far off an impact may be, and how far off one run is from another."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.comparison import compare_histories, impact_third_octaves
from klack.acoustics.third_octave import ThirdOctaves
from klack.analyses.advice.ladder import Measure
from klack.contact.history import ImpactHistory
from klack.errors import InputError
from klack.units import format_si

__all__ = ["HISTORY", "highest_band", "impact_errors", "impact_measures", "judged_up_to"]

HISTORY = 2
"""Place of the force history among the measures: the norm that orders are measured on."""

_RANGE = 40.0  # [dB] below the highest band


def impact_measures(error: float, level: float) -> tuple[Measure, ...]:
    """Measures of one impact.

    Parameters
    ----------
    error : float [-]
        Accepted for peak force, contact time and force history (rms, over the peak force).
    level : float [dB]
        Accepted in every third octave of the target band.
    """
    return (
        Measure(name="peak force", limit=error),
        Measure(name="contact time", limit=error),
        Measure(name="force history", limit=error),
        Measure(name="third octaves", limit=level, decibel=True),
        Measure(name="impulse"),
        Measure(name="restitution"),
    )


def highest_band(history: ImpactHistory) -> float:
    """Middle frequency [Hz] of the highest third octave within 40 dB of the strongest."""
    bands = impact_third_octaves(history)
    return float(bands.middle[_judged(bands)][-1])


def judged_up_to(history: ImpactHistory, up_to: float) -> float:
    """Middle frequency [Hz] of the highest band that is judged in a target band.

    Raises
    ------
    InputError
        For a target band below the first third octave of the force.
    """
    bands = impact_third_octaves(history)
    judged = bands.middle[_judged(bands) & (bands.low < up_to)]
    if not judged.size:
        raise InputError(
            "--up-to",
            got=format_si(up_to, "Hz"),
            expected=f"{format_si(float(bands.low[0]), 'Hz', 2)} or more",
            hint="give the highest frequency that matters, e.g. 20 kHz.",
        )
    return float(judged[-1])


def _judged(bands: ThirdOctaves) -> NDArray[np.bool_]:
    return np.asarray(bands.level >= bands.level.max() - _RANGE)


def impact_errors(
    reference: ImpactHistory, candidate: ImpactHistory, up_to: float
) -> NDArray[np.float64]:
    """Absolute deviations in the order of :func:`impact_measures`, shape (6,).

    Parameters
    ----------
    reference, candidate : ImpactHistory
    up_to : float [Hz]
        Third octaves that begin below it are compared, as far as those of the reference lie
        within 40 dB of its strongest.
    """
    whole = compare_histories(reference, candidate)
    high = 0.1 / max(reference.step, candidate.step)
    bands = [impact_third_octaves(item, high=high) for item in (reference, candidate)]
    chosen = _judged(bands[0]) & (bands[0].low < up_to)
    difference = np.abs(bands[1].level - bands[0].level)[chosen]
    found: Sequence[float] = (
        whole.peak_force,
        whole.contact_time,
        whole.history_l2,
        float(difference.max(initial=0.0)),
        whole.impulse,
        whole.restitution,
    )
    return np.abs(np.nan_to_num(np.array(found)))
