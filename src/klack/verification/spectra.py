"""Spectra of pulses and one-third-octave bands."""

from collections.abc import Iterator
from math import cos, pi

import numpy as np

from klack.acoustics.spectrum import energy_spectral_density, impulse_spectrum
from klack.acoustics.third_octave import band_edges, band_energies, middle_frequencies
from klack.contact.laws import HertzLaw
from klack.signals.sampled import Spectrum, TimeSeries
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.one_dimension import half_sines, hertz_force, mass_on_law

__all__ = ["checks"]

LENGTH, PEAK, STEP = 15e-6, 250.0, 10e-9  # [s], [N], [s]
_PULSE = half_sines(step=STEP, count=round(25e-6 / STEP), times=(5e-6,), length=LENGTH, peak=PEAK)
# band number, lower and upper edge [Hz]
EDGES = ((-17, 17.7828, 22.3872), (0, 891.251, 1122.02), (23, 177828.0, 223872.0))
# f T, |F|/(F0 T) of a Hertz pulse, integrated numerically
HERTZ = ((0.0, 0.543612), (0.5, 0.449625), (1.0, 0.240011), (2.5, 0.010565))


def checks() -> list[Check]:
    """Return the checks."""
    return [*_half_sine(), *_hertz(), *_parseval(), *_bands()]


def _at(spectrum: Spectrum, frequency: float) -> float:
    return float(np.abs(np.interp(frequency, spectrum.frequency, spectrum.values)))


def _half_sine() -> Iterator[Check]:
    spectrum = impulse_spectrum(_PULSE, resolution=50.0)

    def exact_share(x: np.ndarray) -> np.ndarray:
        return np.asarray(2.0 / pi * np.abs(np.cos(pi * x) / (1.0 - 4.0 * x * x)))

    at = spectrum.frequency[spectrum.frequency * LENGTH < 4.5][::40] * LENGTH
    curve = ComparedCurve(
        x_label="frequency times length f T [-]",
        y_label="spectrum [F0 T]",
        expected=(at, exact_share(at)),
        computed=(at, np.array([_at(spectrum, x / LENGTH) for x in at]) / (PEAK * LENGTH)),
    )
    for x in (0.0, 0.25, 1.0, 2.0, 4.0):
        yield check(
            f"half sine, |F| at f T = {x:g} [F0 T]",
            expected=2.0 / pi * abs(cos(pi * x)) / abs(1.0 - 4.0 * x * x),
            computed=_at(spectrum, x / LENGTH) / (PEAK * LENGTH),
            tolerance=1e-5,
            source="(2/pi) |cos(pi f T)| / |1 - 4 (f T)^2|",
            reason="held force: one tolerance for all frequencies, the highest decides",
            curve=curve,
        )
    yield check(
        "half sine, |F| at its first zero f T = 1.5 [F0 T]",
        expected=0.0,
        computed=_at(spectrum, 1.5 / LENGTH) / (PEAK * LENGTH),
        tolerance=5e-14,
        source="zeros at f T = 1.5, 2.5, ...",
        curve=curve,
    )


def _hertz() -> list[Check]:
    mass, K, speed = 1e-3, 7e9, 0.5
    depth = (5.0 * mass * speed**2 / (4.0 * K)) ** 0.4
    duration = 2.9432751844 * depth / speed
    history = mass_on_law(mass, HertzLaw(K), speed=speed, step=10e-9, duration=1.2 * duration)
    series = TimeSeries(step=history.step, values=history.force, unit="N", name="Hertz impact")
    spectrum = impulse_spectrum(series, resolution=50.0)
    scale = K * depth**1.5 * duration
    x = np.linspace(0.0, 3.0, 121)
    computed = np.array([_at(spectrum, one / duration) for one in x]) / scale
    curve = ComparedCurve(
        x_label="frequency times length f T [-]",
        y_label="spectrum [F0 T]",
        expected=(x, _hertz_spectrum(x)),
        computed=(x, computed),
    )
    return [
        check(
            f"simulated Hertz impact, |F| at f T = {x:g} [F0 T]",
            expected=expected,
            computed=_at(spectrum, x / duration) / scale,
            tolerance=2e-5,
            source="Fourier integral of the Hertz pulse, numerically",
            reason="held force: one tolerance for all frequencies, the highest decides",
            absolute=True,
            curve=curve,
        )
        for x, expected in HERTZ
    ]


def _hertz_spectrum(x: np.ndarray) -> np.ndarray:
    """Of the pulse, peak and length one, by the trapezoidal rule."""
    time = np.linspace(0.0, 1.0, 20_001)
    return np.asarray(
        np.abs(
            np.trapezoid(
                np.exp(-2j * pi * np.outer(x, time)) * hertz_force(time, duration=1.0, peak=1.0),
                time,
                axis=1,
            )
        )
    )


def _parseval() -> list[Check]:
    spectrum = impulse_spectrum(_PULSE, resolution=50.0, interval_means=False)
    density = energy_spectral_density(spectrum)
    return [
        check(
            "integral of the energy density against that of F^2 [N^2 s]",
            expected=float(np.sum(_PULSE.values**2) * _PULSE.step),
            computed=float(np.trapezoid(density.values, density.frequency)),
            tolerance=5e-14,
            source="Parseval",
        ),
        check(
            "spectrum at 0 Hz against the impulse [N s]",
            expected=2.0 / pi * PEAK * LENGTH,
            computed=float(np.abs(spectrum.values[0])),
            tolerance=5e-14,
            source="F(0) = integral of F dt",
        ),
    ]


def _bands() -> Iterator[Check]:
    for number, low, high in EDGES:
        edges = band_edges(np.array([number]))
        for what, expected, computed in (("lower", low, edges[0]), ("upper", high, edges[1])):
            yield check(
                f"{what} edge of band {number} [Hz]",
                expected=expected,
                computed=float(computed[0]),
                tolerance=5e-6,
                source="IEC 61260-1:2014, base ten, six digits",
            )
    yield check(
        "middle frequency of band 23 [Hz]",
        expected=10.0**5.3,
        computed=float(middle_frequencies(np.array([23]))[0]),
        tolerance=5e-14,
        source="1000 Hz * 10^(0.1 k)",
    )
    f = np.arange(0.0, 30e3, 37.0)
    band = band_energies(
        Spectrum(frequency=f, values=2.0 + 1e-3 * f, unit="(N s)^2"), low=800.0, high=1200.0
    )
    exact = 2.0 * (band.high - band.low) + 0.5e-3 * (band.high**2 - band.low**2)
    yield check(
        "energy of a rising density in the band at 1 kHz [N^2 s]",
        expected=float(exact[0]),
        computed=float(band.energy[0]),
        tolerance=5e-14,
        source="integral with partial steps at both edges",
    )
