"""Loudness and sharpness of a sound: ISO 532-1 (Zwicker), time varying, and DIN 45692.

One-third-octave levels every 0.5 ms pass the ear's masking and slow decay; one value per 2 ms is
given. Method of the package MoSQITo.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.machine.compiling.jit import njit
from klack.signals.sampled import TimeSeries

__all__ = ["Loudness", "loudness_level", "nonlinear_decay", "time_varying_loudness"]

_RATE = 48_000
_STEP, _EVERY = 2e-3, 4  # [s] of the loudness given, steps of 0.5 ms
_SHORT, _LONG, _VARIABLE = 5e-3, 15e-3, 75e-3  # [s] of the decay in the ear
_CORE_STEP, _FINE = 0.5e-3, 24  # [s], steps within each
_BARK = 0.1  # [Bark] steps of the specific loudness
_QUIET = 0.1  # [sone] below this sharpness is not defined in DIN 45692
_SILENT = "below the threshold of hearing: 0 sone, and no sharpness"
_FAINT = "less than 0.1 sone at its loudest: no sharpness is given"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loudness:
    """Loudness over time and single measures.

    Parameters
    ----------
    time (n,) [s]
        Every 2 ms.
    loudness (n,) [sone]
    maximum [sone]
        ``N_max``.
    percentile_5 [sone]
        ``N_5``, exceeded in 5 % of the time. For a single click it depends on the silence
        recorded; compare drive patterns.
    level [phon]
        Of the maximum.
    sharpness [acum]
        DIN 45692, of the specific loudness over the whole sound; nan where too faint (``note``).
    note
        Empty, or a remark on the numbers.
    """

    time: NDArray[np.float64]
    loudness: NDArray[np.float64]
    maximum: float
    percentile_5: float
    level: float
    sharpness: float
    note: str = ""


def time_varying_loudness(pressure: TimeSeries) -> Loudness:
    """Loudness of a sound [Pa] at 48 kHz, free field from the front, ISO 532-1:2017, time varying.

    The filters start from silence: a sudden sound needs 0.3 s to its final loudness.
    """
    refuse_if(
        abs(pressure.rate / _RATE - 1.0) > 1e-6,
        f"time_varying_loudness of '{pressure.name}'",
        got=f"a rate of {pressure.rate:.6g} Hz",
        expected=f"{_RATE} Hz, for which the filters of ISO 532-1 are defined",
        hint="make the sound with click_pressure(..., rate=48000).",
    )
    total, specific = _zwicker(pressure.values)
    count = max(round(pressure.values.size * pressure.step / _STEP), 1)
    total, specific = total[:count], specific[:, :count]
    maximum = float(total.max())
    note = _SILENT if maximum == 0.0 else _FAINT if maximum < _QUIET else ""
    return Loudness(
        time=np.asarray(pressure.start + _STEP * np.arange(total.size), dtype=float),
        loudness=total,
        maximum=maximum,
        percentile_5=float(np.percentile(total, 95.0)),
        level=loudness_level(maximum),
        sharpness=nan if note else _sharpness(specific.sum(axis=1)),
        note=note,
    )


def loudness_level(loudness: float) -> float:
    r"""Loudness level [phon] of a loudness [sone].

    .. math:: L_N = 40 + 10 \log_2 N \ (N \ge 1), \qquad
              L_N = \max(3,\ 40 (N + 0.0005)^{0.35}) \ (N < 1)

    ISO 532-1:2017, 5.8; 3 phon is the least.

    Examples
    --------
    >>> loudness_level(4.0), loudness_level(0.0)
    (60.0, 3.0)
    """
    if loudness >= 1.0:
        return float(40.0 + 10.0 * np.log2(loudness))
    return float(max(3.0, 40.0 * (loudness + 0.0005) ** 0.35))


def _zwicker(pressure: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Loudness, shape (n,) [sone], and specific loudness, shape (240, n) [sone/Bark].

    Steps of MoSQITo's ``loudness_zwtv``, but its decay of hearing, which takes three quarters of
    the time, and lets the end of a sound act on its beginning.
    """
    from mosqito.sq_metrics.loudness.loudness_zwst._calc_slopes import _calc_slopes
    from mosqito.sq_metrics.loudness.loudness_zwst._main_loudness import _main_loudness
    from mosqito.sq_metrics.loudness.loudness_zwtv._temporal_weighting import _temporal_weighting
    from mosqito.sq_metrics.loudness.loudness_zwtv._third_octave_levels import _third_octave_levels

    levels = _third_octave_levels(pressure, _RATE)[0]
    core = nonlinear_decay(_main_loudness(levels, "free"))
    total, specific = _calc_slopes(core)
    return _temporal_weighting(total)[::_EVERY], specific[:, ::_EVERY]


def nonlinear_decay(core: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Core loudness with the decay of hearing, shape (bands, n) [sone/Bark].

    The diode network of ISO 532-1:2017, clause 6.  Per critical band the core loudness ``u``
    charges a capacitor (``v``) at once, and through a diode and a resistor a second one (``w``).
    When it falls, both follow a linear network: the decay after a click is fast, after a long sound
    slow.

    .. math::
        \text{rising } (u \ge v): &\quad v = u, \quad t_v\, \dot w = u - w \\
        \text{falling, } v > w: &\quad
            \dot v = -\frac{v}{t_s} - \frac{t_l - t_s}{t_s\, t_v}\,(v - w), \quad
            t_v\, \dot w = v - w \\
        \text{falling, } v \le w: &\quad t_l\, \dot v = -v, \quad w = v

    with ``t_s = 5 ms``, ``t_l = 15 ms``, ``t_v = 75 ms``; ``v`` never falls below ``u``, nor does
    ``w`` rise above ``v`` in falling. ``u`` is straight between values every 0.5 ms, in 24 exact
    steps.

    Parameters
    ----------
    core (bands, n) [sone/Bark]
        Every 0.5 ms, zero or more; silence before and after.
    """
    h = _CORE_STEP / _FINE
    b = (_LONG - _SHORT) / (_SHORT * _VARIABLE)
    network = np.array([[-1.0 / _SHORT - b, b], [1.0 / _VARIABLE, -1.0 / _VARIABLE]])
    out: NDArray[np.float64] = _follow(
        np.ascontiguousarray(core, dtype=float),
        scipy.linalg.expm(h * network),
        float(np.exp(-h / _LONG)),
        float(np.exp(-h / _VARIABLE)),
        _FINE,
    )
    return out


@njit(nogil=True)
def _follow(core, both, alone, charge, fine):  # type: ignore[no-untyped-def]
    bands, n = core.shape
    out = np.empty((bands, n))
    for i in range(bands):
        v = 0.0
        w = 0.0
        for j in range(n):
            ahead = core[i, j + 1] if j + 1 < n else 0.0
            rise = (ahead - core[i, j]) / fine
            u = core[i, j]
            for k in range(fine):
                if u >= v:
                    w = u + (w - u) * charge
                    v = u
                elif v > w:
                    next_v = max(both[0, 0] * v + both[0, 1] * w, u)
                    w = min(both[1, 0] * v + both[1, 1] * w, next_v)
                    v = next_v
                else:
                    v = max(alone * v, u)
                    w = v
                if k == 0:
                    out[i, j] = v
                u += rise
    return out


def _sharpness(specific: NDArray[np.float64]) -> float:
    r"""Sharpness [acum] of a specific loudness (240,) of any scale.

    .. math:: S = 0.11\, \frac{\int N' g(z) z\,\mathrm dz}{\int N'\,\mathrm dz}, \qquad
              g = 1\ (z \le 15.8), \quad 0.15\, e^{0.42 (z - 15.8)} + 0.85\ (z > 15.8)
    """
    z = _BARK * (np.arange(specific.size) + 1.0)
    g = np.where(z > 15.8, 0.15 * np.exp(0.42 * (z - 15.8)) + 0.85, 1.0)
    return float(0.11 * np.sum(specific * g * z) / np.sum(specific))
