"""One-third-octave bands of transients, base ten (IEC 61260-1:2014).

Middle frequencies ``f_m = 1000 Hz * G^(k/3)`` with ``G = 10^(3/10)``, bands from ``f_m G^(-1/6)``
to ``f_m G^(1/6)``, beyond the audible range of the standard too. A band energy is the integral of
the energy spectral density, with fractions of steps at the edges: ideal filters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.signals.sampled import Spectrum

__all__ = [
    "ThirdOctaves",
    "band_edges",
    "band_energies",
    "band_numbers",
    "middle_frequencies",
    "nominal_label",
]

_G = 10.0**0.3
_R10 = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
ENERGY_REFERENCE = 1e-12  # [N^2 s], (1 uN)^2 over 1 s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThirdOctaves:
    """Energy of a transient in bands.

    Parameters
    ----------
    number (n,)
        ``k``: 0 is the band at 1 kHz.
    middle, low, high (n,) [Hz]
    energy (n,) [unit^2 s]
        N^2 s for a force, Pa^2 s for a sound.
    """

    number: NDArray[np.int64]
    middle: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    energy: NDArray[np.float64]

    @property
    def level(self) -> NDArray[np.float64]:
        """Level of each band of a force [dB re (1 uN)^2 s], shape (n,)."""
        return self.level_re(ENERGY_REFERENCE)

    def level_re(self, reference: float) -> NDArray[np.float64]:
        """Level of each band [dB re ``reference``], of a sound (20 uPa)^2 s, shape (n,)."""
        smallest = np.finfo(float).tiny
        return 10.0 * np.log10(np.maximum(self.energy, smallest) / reference)


def middle_frequencies(number: NDArray[np.int64]) -> NDArray[np.float64]:
    """Exact middle frequencies [Hz] of bands (0 is 1 kHz).

    Examples
    --------
    >>> middle_frequencies(np.array([-10, 0, 23])).round(1).tolist()
    [100.0, 1000.0, 199526.2]
    """
    return 1000.0 * _G ** (np.asarray(number) / 3.0)


def band_edges(number: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper edges [Hz] of bands."""
    middle = middle_frequencies(number)
    return middle * _G ** (-1.0 / 6.0), middle * _G ** (1.0 / 6.0)


def band_numbers(low: float, high: float) -> NDArray[np.int64]:
    """Bands within ``low`` to ``high`` [Hz], edges included."""
    refuse_if(
        not 0.0 < low < high,
        "band_numbers",
        got=f"{low:g} to {high:g} Hz",
        expected="0 < low < high",
        hint="20 Hz to 200 kHz covers valves.",
    )
    tolerance = 1e-9  # in band numbers: an edge given as a limit counts as inside
    first = np.ceil(10.0 * np.log10(low / 1000.0) + 0.5 - tolerance)
    last = np.floor(10.0 * np.log10(high / 1000.0) - 0.5 + tolerance)
    return np.arange(int(first), int(last) + 1)


def nominal_label(number: int) -> str:
    """Nominal middle frequency of a band, from the R10 series.

    Examples
    --------
    >>> nominal_label(0), nominal_label(-15), nominal_label(21)
    ('1 kHz', '31.5 Hz', '125 kHz')
    """
    decade, place = divmod(number, 10)
    value = _R10[place] * 10.0 ** (3 + decade)
    return f"{value / 1e3:g} kHz" if value >= 1e3 else f"{value:g} Hz"


def band_energies(density: Spectrum, *, low: float, high: float) -> ThirdOctaves:
    """Integrate a one-sided energy spectral density over one-third-octave bands.

    Parameters
    ----------
    density
        Linear between its frequencies.
    low, high [Hz]
        See :func:`band_numbers`; at most the last frequency.
    """
    frequency, values = density.frequency, np.real(density.values)
    refuse_if(
        high > frequency[-1],
        "band_energies: high",
        got=f"{high:g} Hz",
        expected=f"at most {frequency[-1]:g} Hz, half the sampling rate",
        hint="take a smaller time step or a lower limit.",
    )
    number = band_numbers(low, high)
    edge_low, edge_high = band_edges(number)
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(frequency)
    gathered = np.concatenate(([0.0], np.cumsum(steps)))

    def up_to(f: NDArray[np.float64]) -> NDArray[np.float64]:
        i = np.clip(np.searchsorted(frequency, f, side="right") - 1, 0, frequency.size - 2)
        x = f - frequency[i]
        slope = (values[i + 1] - values[i]) / (frequency[i + 1] - frequency[i])
        return gathered[i] + x * (values[i] + 0.5 * slope * x)

    return ThirdOctaves(
        number=number,
        middle=middle_frequencies(number),
        low=edge_low,
        high=edge_high,
        energy=up_to(edge_high) - up_to(edge_low),
    )
