r"""Velocity from lift, with the effect of the differentiator stated.

A cubic is fitted to every window of ``2 m + 1`` samples and differentiated in its middle (Savitzky
& Golay 1964). Weights are antisymmetric: nothing is delayed, cubics are exact, a sine of frequency
f is reduced by ``G(f)``,

.. math:: G(f) = \frac{2}{2 \pi f h} \sum_{k=1}^{m} c_k \sin(2 \pi f k h), \qquad
          \sigma_v = \frac{\sigma_x}{h} \sqrt{2 \sum_{k=1}^{m} c_k^2} .

Without a bandwidth the window has the least expected squared error of the velocity, lost signal
plus noise left,

.. math:: \sum_f (2 \pi f)^2 \left[(1 - G)^2 S + G^2 N\right],

``N`` the plateau at the high end of the periodogram of the lift, ``S`` what lies above it up to
the first third octave without any; both from the second difference, which different ends of a
record do not smear.

A smoothing spline of the same record: see the theory page.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError, refuse_if, require_positive
from klack.measurement.time_base import uniform_step

__all__ = ["VelocityEstimate", "differentiator_gain", "noise_floor", "velocity_of"]

_DEGREE = 3
_PLATEAU = 0.6  # share of the half sampling rate above which only noise is expected
_LARGEST_SHARE = 8  # no window above this part of the record
_BAND = 2.0 ** (1.0 / 3.0)
_NOTICED = 3.0  # standard deviations of the mean of a band


@dataclass(frozen=True, kw_only=True, eq=False)
class VelocityEstimate:
    """A velocity with the parameters of its estimate.

    Parameters
    ----------
    time (n,) [s]
    velocity (..., n) [m/s]
    bandwidth [Hz]
        Of 3 dB loss of the window.
    noise [m/s]
        Standard deviation, from ``lift_noise``.
    lift_noise [m]
        Standard deviation of the lift, from the plateau of its spectrum.
    delay [s]
        0: the window is symmetric.
    window
        Samples of one fit.
    step [s]
    chosen
        True if the noise chose the bandwidth.
    """

    time: NDArray[np.float64]
    velocity: NDArray[np.float64]
    bandwidth: float
    noise: float
    lift_noise: float
    delay: float
    window: int
    step: float
    chosen: bool

    def amplitude_error(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Error of the amplitude at a frequency [-], below zero."""
        return differentiator_gain(np.asarray(frequency), self.window, self.step) - 1.0


def velocity_of(
    time: NDArray[np.float64], lift: NDArray[np.float64], *, bandwidth: float | None = None
) -> VelocityEstimate:
    """Velocity of one record, or of a set with one window for all.

    Parameters
    ----------
    time (n,) [s]
        Uniform.
    lift (n,) or (strokes, n) [m]
    bandwidth [Hz]
        At which 3 dB may be lost, by the nearest window that loses no more; default: by the noise.
    """
    step = uniform_step(time, "velocity_of: time")
    records = np.atleast_2d(np.asarray(lift, dtype=np.float64))
    power, noise = noise_floor(records, step)
    chosen = bandwidth is None
    half = (
        _least_error(power, noise, records, step)
        if bandwidth is None
        else _half_window(bandwidth, records.shape[-1], step)
    )
    window = 2 * half + 1
    weights = _weights(window)
    velocity = scipy.signal.savgol_filter(
        np.asarray(lift, dtype=np.float64), window, _DEGREE, deriv=1, delta=step, axis=-1
    )
    return VelocityEstimate(
        time=time,
        velocity=velocity,
        bandwidth=_lost_3_dB(window, step),
        noise=noise / step * float(np.sqrt(2.0 * np.sum(weights**2))),
        lift_noise=noise,
        delay=0.0,
        window=window,
        step=step,
        chosen=chosen,
    )


def differentiator_gain(
    frequency: NDArray[np.float64], window: int, step: float
) -> NDArray[np.float64]:
    """Velocity amplitude of a sine over the true one [-]; 1 at 0 Hz."""
    c = _weights(window)
    omega = 2.0 * pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64)) * step
    k = np.arange(1, c.size + 1)
    small = np.abs(omega) < 1e-6
    safe = np.where(small, 1.0, omega)
    gain = 2.0 * np.sin(np.outer(safe, k)) @ c / safe
    return np.asarray(np.where(small, 1.0, gain).reshape(np.shape(frequency)))


def noise_floor(records: NDArray[np.float64], step: float) -> tuple[NDArray[np.float64], float]:
    """Mean periodogram of lift (n // 2,) [m^2], and the standard deviation of its white noise [m].

    The periodogram is that of second differences at the frequencies ``1 .. n // 2`` of the record,
    scaled so that white noise of standard deviation s gives s^2 at every line.  The noise is the
    median above 60 % of the half sampling rate.

    Parameters
    ----------
    records (strokes, n) [m]
    step [s]
    """
    second = np.diff(records, 2, axis=-1)
    n = second.shape[-1]
    refuse_if(
        n < 8,
        "velocity_of: lift",
        got=f"{records.shape[-1]} samples",
        expected="at least 10",
        hint="a stroke needs a few hundred samples.",
    )
    taper = np.hanning(n + 2)[1:-1]
    lines = np.fft.rfft(second * taper, axis=-1)[:, 1 : n // 2 + 1]
    angle = 2.0 * pi * np.arange(1, n // 2 + 1) / n
    share = (2.0 * np.sin(0.5 * angle)) ** 4  # of white noise that a second difference passes
    power = np.mean(np.abs(lines) ** 2, axis=0) / (np.sum(taper**2) * share)
    plateau = power[angle > _PLATEAU * pi]
    # a periodogram line of r records is chi^2_{2r} / 2r; its median is about 1 - 1/(9 r), cubed
    median_over_mean = (1.0 - 1.0 / (9.0 * records.shape[0])) ** 3
    return power, float(np.sqrt(np.median(plateau) / median_over_mean))


def _weights(window: int) -> NDArray[np.float64]:
    """Weights ``c_1 .. c_m`` for a step of one."""
    c = scipy.signal.savgol_coeffs(window, _DEGREE, deriv=1, use="dot")
    return np.asarray(c[window // 2 + 1 :])


def _lost_3_dB(window: int, step: float) -> float:
    """Frequency of 3 dB loss [Hz]; else half the rate."""
    f = np.linspace(0.0, 0.5, 4001)[1:] / step
    f = f[: max(2, int(np.ceil(8001 * 2.0 / window)))]
    gain = differentiator_gain(f, window, step)
    below = np.flatnonzero(gain < np.sqrt(0.5))
    if not below.size:
        return 0.5 / step
    k = int(below[0])
    if k == 0:
        return float(f[0])
    return float(np.interp(np.sqrt(0.5), [gain[k], gain[k - 1]], [f[k], f[k - 1]]))


def _half_window(bandwidth: float, samples: int, step: float) -> int:
    require_positive("velocity_of: bandwidth", bandwidth, "Hz")
    # the product of window and bandwidth is nearly constant
    guess = max(2, int(1.1 / (bandwidth * step)))
    while guess > 2 and _lost_3_dB(2 * guess + 1, step) < bandwidth:
        guess -= 1
    if _lost_3_dB(2 * guess + 1, step) < bandwidth:
        raise InputError(
            "velocity bandwidth",
            got=f"{bandwidth:g} Hz at {1.0 / step:g} samples per second",
            expected=f"at most {_lost_3_dB(5, step):.3g} Hz: the narrowest window",
            hint="request less bandwidth, or sample faster.",
        )
    refuse_if(
        2 * guess + 1 > samples,
        "velocity bandwidth",
        got=f"{bandwidth:g} Hz for {samples} samples of {step:g} s",
        expected=f"a record of {2 * guess + 1} samples or more",
        hint="request more bandwidth, or keep more time around the stroke.",
    )
    return guess


def _signal_power(power: NDArray[np.float64], noise: float, records: int) -> NDArray[np.float64]:
    """Power above the noise in third octaves; none from the first empty one."""
    signal = np.zeros_like(power)
    edges = np.unique(np.round(_BAND ** np.arange(0.0, np.log(power.size + 1) / np.log(_BAND) + 1)))
    for low, high in pairwise(np.minimum(edges, power.size + 1).astype(int).tolist()):
        band = power[low - 1 : high - 1]
        if not band.size:
            break
        above = float(np.mean(band)) - noise
        if above <= _NOTICED * noise / np.sqrt(band.size * records):
            break
        signal[low - 1 : high - 1] = above
    return signal


def _least_error(
    power: NDArray[np.float64], noise: float, records: NDArray[np.float64], step: float
) -> int:
    """Half window with the least expected squared error of the velocity."""
    samples = records.shape[-1]
    n = samples - 2
    f = np.arange(1, power.size + 1) / (n * step)
    signal = _signal_power(power, noise**2, len(records))
    largest = max(3, samples // _LARGEST_SHARE)
    halves = np.unique(np.round(np.geomspace(2, largest, 60)).astype(int))

    def error(half: int) -> float:
        gain = differentiator_gain(f, 2 * half + 1, step)
        return float(np.sum(f**2 * ((1.0 - gain) ** 2 * signal + gain**2 * noise**2)))

    return int(min(halves.tolist(), key=error))
