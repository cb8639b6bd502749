"""Cumulative energy of a transient over frequency."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.signals.sampled import Spectrum

__all__ = ["CumulativeEnergy", "cumulative_energy"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CumulativeEnergy:
    r"""Share of the energy below each frequency.

    .. math:: s(f) = \frac{\int_{f_1}^{f} E\,\mathrm df}{\int_{f_1}^{f_2} E\,\mathrm df}

    Parameters
    ----------
    frequency (k,) [Hz]
        From ``f_1`` to ``f_2``.
    share (k,) [-]
    total [unit^2 s]
        Between ``f_1`` and ``f_2``.
    """

    frequency: NDArray[np.float64]
    share: NDArray[np.float64]
    total: float

    def frequency_below(self, share: float) -> float:
        """Frequency [Hz] below which a share (0 to 1) of the energy lies."""
        refuse_if(
            not 0.0 < share < 1.0,
            "CumulativeEnergy.frequency_below",
            got=f"a share of {share:g}",
            expected="a value above 0 and below 1",
            hint="0.5, 0.9 and 0.99 are usual.",
        )
        i = int(np.searchsorted(self.share, share))
        low, high = self.share[i - 1], self.share[i]
        part = (share - low) / (high - low)
        return float(self.frequency[i - 1] + part * (self.frequency[i] - self.frequency[i - 1]))


def cumulative_energy(density: Spectrum, *, low: float, high: float) -> CumulativeEnergy:
    """Sum the energy of a transient over frequency, by trapezia.

    Parameters
    ----------
    density
        One-sided, from :func:`klack.acoustics.spectrum.energy_spectral_density`.
    low, high [Hz]
        ``f_1`` and ``f_2``; state them with a share. A force that stays has no finite energy from
        0 Hz on.
    """
    frequency, values = density.frequency, np.real(density.values)
    refuse_if(
        not 0.0 <= low < high <= frequency[-1] * (1.0 + 1e-12),
        f"cumulative_energy of '{density.name}'",
        got=f"{low:g} to {high:g} Hz",
        expected=f"limits in ascending order between 0 and {frequency[-1]:g} Hz",
        hint="20 Hz to 200 kHz covers valves.",
    )
    inner = (frequency > low) & (frequency < high)
    f = np.concatenate(([low], frequency[inner], [high]))
    e = np.interp(f, frequency, values)
    gathered = np.concatenate(([0.0], np.cumsum(0.5 * (e[1:] + e[:-1]) * np.diff(f))))
    total = float(gathered[-1])
    refuse_if(
        not total > 0.0,
        f"cumulative_energy of '{density.name}'",
        got="a density without energy",
        expected="some energy between the limits",
        hint="is there an impact in the record?",
    )
    return CumulativeEnergy(frequency=f, share=gathered / total, total=total)
