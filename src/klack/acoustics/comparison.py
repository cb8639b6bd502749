"""Two impacts compared: force history and one-third-octave levels."""

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.acoustics.spectrum import energy_spectral_density, impulse_spectrum
from klack.acoustics.third_octave import ThirdOctaves, band_energies
from klack.contact.history import ImpactHistory
from klack.contact.restitution import Deviation, find_contacts, measure_impact
from klack.signals.sampled import TimeSeries

__all__ = ["compare_histories", "first_impact", "impact_third_octaves"]

_LOWEST_BAND = 17.0  # [Hz] below the band at 20 Hz
_RESOLVED = 0.1  # highest band edge times record step
_RANGE = 40.0  # [dB] below the highest band


def first_impact(history: ImpactHistory) -> TimeSeries:
    """Force of the first impact [N], from the record before touch to the one after release.

    Time from first touch.
    """
    measures = measure_impact(history)
    end = measures.first_touch + measures.total_contact_time
    phases = [p for p in find_contacts(history) if p.start <= end]
    first, last = phases[0].first, phases[-1].last
    values = np.concatenate(([0.0], history.force[first:last], [0.0]))
    return TimeSeries(
        step=history.step,
        values=values,
        unit="N",
        start=history.start + (first - 0.5) * history.step - measures.first_touch,
        name="first impact",
    )


def impact_third_octaves(history: ImpactHistory, *, high: float | None = None) -> ThirdOctaves:
    """One-third-octave energies of the force of the first impact, from 20 Hz up.

    Parameters
    ----------
    high [Hz]
        Default: a tenth of the record rate.
    """
    series = first_impact(history)
    limit = _RESOLVED / series.step if high is None else high
    duration = series.values.size * series.step
    spectrum = impulse_spectrum(series, resolution=min(1.0 / (20.0 * duration), 5e3))
    return band_energies(energy_spectral_density(spectrum), low=_LOWEST_BAND, high=limit)


def compare_histories(reference: ImpactHistory, candidate: ImpactHistory) -> Deviation:
    """Deviation of the first impact of ``candidate`` from ``reference``.

    Both are aligned at first touch and averaged over the coarser record step.
    """
    a, b = measure_impact(reference), measure_impact(candidate)
    high = _RESOLVED / max(reference.step, candidate.step)
    bands_a = impact_third_octaves(reference, high=high)
    bands_b = impact_third_octaves(candidate, high=high)
    compared = bands_a.level >= bands_a.level.max() - _RANGE
    difference = np.abs(bands_b.level - bands_a.level)[compared]
    return Deviation(
        peak_force=b.peak_force / a.peak_force - 1.0,
        contact_time=b.contact_time / a.contact_time - 1.0,
        impulse=b.impulse / a.impulse - 1.0,
        restitution=b.restitution - a.restitution,
        history_l2=_history_l2(reference, candidate),
        third_octave_max_dB=float(difference.max()),
        third_octave_up_to_Hz=float(bands_a.middle[compared][-1]),
    )


def _history_l2(reference: ImpactHistory, candidate: ImpactHistory) -> float:
    a, b = first_impact(reference), first_impact(candidate)
    step = max(a.step, b.step)
    measures = measure_impact(reference), measure_impact(candidate)
    end = max(m.total_contact_time for m in measures)
    edges = np.linspace(0.0, step * np.ceil(end / step), int(np.ceil(end / step)) + 1)
    difference = _means(b, edges) - _means(a, edges)
    return float(np.sqrt(np.mean(difference**2)) / measures[0].peak_force)


def _means(series: TimeSeries, edges: NDArray) -> NDArray:
    """Mean values between new edges; interpolated impulses lose nothing."""
    own = series.start + series.step * (np.arange(series.values.size + 1) - 0.5)
    gathered = np.concatenate(([0.0], np.cumsum(series.values) * series.step))
    impulse = scipy.interpolate.PchipInterpolator(own, gathered)(np.clip(edges, own[0], own[-1]))
    return np.diff(impulse) / np.diff(edges)
