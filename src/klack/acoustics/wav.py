"""Sound files with their full-scale level."""

from io import BytesIO
from math import log10
from pathlib import Path

import numpy as np

from klack.errors import refuse_if, require_positive
from klack.signals.sampled import TimeSeries

__all__ = ["full_scale_of", "level_statement", "wav_bytes", "write_wav"]

_RATE = 48_000
_PRESSURE_REFERENCE = 20e-6  # [Pa]
_SUBTYPE = "PCM_24"


def full_scale_of(*pressures: TimeSeries, headroom: float = 6.0) -> float:
    """Full scale [Pa] that sounds can share, to compare by ear; 20 uPa if all are silent.

    Parameters
    ----------
    headroom [dB]
        From the highest peak to full scale.
    """
    peak = max((float(np.max(np.abs(p.values))) for p in pressures), default=0.0)
    return float(peak * 10.0 ** (headroom / 20.0)) if peak > 0.0 else _PRESSURE_REFERENCE


def level_statement(full_scale: float) -> str:
    """Full scale in pascal and as a level.

    A full-scale sine has ``20 lg(full scale / (sqrt(2) 20 uPa))`` dB.

    Examples
    --------
    >>> level_statement(2.0)
    'full scale = 2 Pa peak (100.0 dB peak re 20 uPa; a sine at full scale: 97.0 dB SPL)'
    """
    peak = 20.0 * log10(full_scale / _PRESSURE_REFERENCE)
    sine = peak - 10.0 * log10(2.0)
    return (
        f"full scale = {full_scale:.6g} Pa peak ({peak:.1f} dB peak re 20 uPa; "
        f"a sine at full scale: {sine:.1f} dB SPL)"
    )


def write_wav(path: Path, pressure: TimeSeries, *, full_scale: float) -> None:
    """Write a sound [Pa] at 48 kHz as WAV of 24 bit, with its level in the comment.

    Rejects a peak above full scale.

    Parameters
    ----------
    full_scale [Pa]
        Largest number of the file; see :func:`full_scale_of`.
    """
    path.write_bytes(wav_bytes(pressure, full_scale=full_scale))


def wav_bytes(pressure: TimeSeries, *, full_scale: float) -> bytes:
    """Content of the file of :func:`write_wav`."""
    import soundfile

    require_positive("write_wav: full_scale", full_scale, "Pa")
    _require_rate(pressure)
    peak = float(np.max(np.abs(pressure.values)))
    refuse_if(
        peak > full_scale,
        f"write_wav: '{pressure.name}'",
        got=f"a peak of {peak:.4g} Pa",
        expected=f"at most the full scale of {full_scale:.4g} Pa",
        hint="use full_scale_of all sounds that are to be compared.",
    )
    buffer = BytesIO()
    with soundfile.SoundFile(
        buffer, "w", samplerate=_RATE, channels=1, subtype=_SUBTYPE, format="WAV"
    ) as file:
        file.title = pressure.name or "sound"
        file.comment = level_statement(full_scale)
        file.write(pressure.values / full_scale)
    return buffer.getvalue()


def _require_rate(pressure: TimeSeries) -> None:
    refuse_if(
        abs(pressure.rate / _RATE - 1.0) > 1e-6,
        f"write_wav: '{pressure.name}'",
        got=f"a rate of {pressure.rate:.6g} Hz",
        expected=f"{_RATE} Hz",
        hint="make the sound with click_pressure(..., rate=48000).",
    )
