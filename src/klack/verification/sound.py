"""From force to ear: clicks, bands, weighting, loudness, sharpness."""

from collections.abc import Iterator
from dataclasses import replace
from math import pi, sqrt

import numpy as np

from klack.acoustics.cumulative import cumulative_energy
from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.impulsive import impulsive_prominence
from klack.acoustics.loudness import time_varying_loudness
from klack.acoustics.signal_statistics import (
    crest_factor,
    kurtosis,
    sound_exposure_level,
    sound_statistics,
    weighting,
)
from klack.acoustics.sound import audio_band, click_pressure, minimum_phase_filter
from klack.acoustics.spectrum import energy_spectral_density, force_spectrum
from klack.signals.sampled import TimeSeries
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.one_dimension import half_sines

__all__ = ["checks"]

RATE = 48_000
LENGTH, PEAK, TOUCH = 15e-6, 250.0, 1e-3  # [s], [N], [s]
DENSITY, SPEED = 1.204, 343.2  # [kg/m^3], [m/s]
STRENGTH = DENSITY * SPEED / (4.0 * pi)  # [Pa^2/W] at 1 m
# frequency [Hz], level [dB], loudness [sone]
TONES = ((250.0, 80.0, 14.655), (1000.0, 60.0, 4.019), (4000.0, 40.0, 1.549))
# duration [s], loudness [sone] of pulses of 1 kHz and 70 dB
PULSES = ((0.05, 5.975), (0.5, 8.077))
# [Hz], [dB]
A_WEIGHTS = ((31.622777, -39.4), (100.0, -19.1), (1e3, 0.0), (3981.0717, 1.0), (15848.932, -6.6))


def checks() -> list[Check]:
    """Click, pattern, weighting, cumulative energy, loudness, sharpness."""
    return [*_click(), *_filter(), *_pattern(), *_weighting(), *_cumulative(), *_loudness()]


def _half_sine() -> TimeSeries:
    """Half sine, 250 N, 15 us, in 4 ms on a preload of 30 N, means over 50 ns."""
    pulse = half_sines(
        step=50e-9, count=round(4e-3 / 50e-9), times=(TOUCH,), length=LENGTH, peak=PEAK
    )
    return replace(pulse, values=pulse.values + 30.0)


def _spectrum(f: np.ndarray) -> np.ndarray:
    x = f * LENGTH
    return np.asarray(2.0 / pi * PEAK * LENGTH * np.abs(np.cos(pi * x) / (1.0 - 4.0 * x * x)))


def _transfer(f: np.ndarray) -> np.ndarray:
    return np.asarray(1e-12 * (f / 1e3) ** 2)


def _pressure() -> TimeSeries:
    f = np.geomspace(20.0, 30e3, 200)
    return click_pressure(
        _half_sine(), f, _transfer(f), distance=1.0, density=DENSITY, sound_speed=SPEED
    )


def _click() -> Iterator[Check]:
    click = _pressure()
    f = np.linspace(20.0, 24e3, 100_001)
    energy = np.cumsum(click.values**2) * click.step / STRENGTH

    def exact_spectrum(at: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(STRENGTH * _transfer(at)) * _spectrum(at))

    def found_spectrum(at: np.ndarray) -> np.ndarray:
        turned = np.exp(-2j * pi * np.outer(at, click.time))
        return np.asarray(np.abs(turned @ click.values) * click.step)

    axis = np.geomspace(50.0, 17e3, 60)  # below the edge of the audio band
    curve = ComparedCurve(
        x_label="frequency [Hz]",
        y_label="sound pressure spectrum [Pa s]",
        expected=(axis, exact_spectrum(axis)),
        computed=(axis, found_spectrum(axis)),
        x_log=True,
        y_log=True,
    )
    yield from [
        check(
            "energy of a click through a sphere of 1 m against the radiated energy [J]",
            expected=float(
                np.trapezoid(_transfer(f) * 2.0 * (_spectrum(f) * audio_band(f)) ** 2, f)
            ),
            computed=float(energy[-1]),
            tolerance=1e-6,
            source="integral of 2 T |F|^2, F of a half sine in closed form",
        ),
        check(
            "share of that energy 0.2 ms before the impact [-]",
            expected=0.0,
            computed=float(energy[np.searchsorted(click.time, TOUCH - 0.2e-3)] / energy[-1]),
            tolerance=1e-6,
            source="causality",
        ),
    ]
    for frequency in (100.0, 1e3, 15e3):
        at = np.array([frequency])
        yield check(
            f"sound pressure spectrum of the click at {frequency:g} Hz [Pa s]",
            expected=float(exact_spectrum(at)[0]),
            computed=float(found_spectrum(at)[0]),
            tolerance=1e-4,
            source="sqrt(rho c T / (4 pi r^2)) |F|",
            reason="0.0004 dB; the highest frequency of the pulse decides for all",
            curve=curve,
        )


def _filter() -> list[Check]:
    z = np.exp(-1j * np.linspace(0.0, pi, 1025))
    inside = (1.0 - 0.9 * z) * (1.0 + 0.5 * z) / (1.0 - 0.7 * z)
    found = minimum_phase_filter(np.abs((z - 0.9) * (1.0 + 0.5 * z) / (1.0 - 0.7 * z)))
    return [
        check(
            "minimum phase of a magnitude against the filter with its zeros inside [-]",
            expected=0.0,
            computed=float(np.abs(found - inside).max()),
            tolerance=5e-14,
            source="Oppenheim & Schafer, Discrete-Time Signal Processing, ch. 12",
        )
    ]


def _pattern() -> list[Check]:
    t = np.arange(4800) / RATE
    click = TimeSeries(
        step=1.0 / RATE,
        values=np.exp(-0.5 * ((t - 6e-3) / 0.8e-3) ** 2) * np.cos(6e3 * pi * t),
        unit="Pa",
    )
    sine = TimeSeries(step=1.0 / RATE, values=np.sin(2e3 * pi * np.arange(RATE) / RATE), unit="Pa")
    short = TimeSeries(step=1.0 / RATE, values=np.concatenate(([1.0], np.zeros(4799))), unit="Pa")
    on_noise = sound_statistics(short).fast_level_A - 20.0
    rise = 10.0 * np.log10(1.0 + 10.0 ** (0.1 * 20.0))
    return [
        check(
            "highest level with A and F of a short click above its exposure level [dB]",
            expected=10.0 * float(np.log10(1.0 / 0.125)),
            computed=sound_statistics(short).fast_level_A
            - sound_statistics(short).exposure_level_A,
            tolerance=0.03,
            source="integral of an exponential mean of 125 ms, IEC 61672-1",
            reason="the A-weighting rings for a part of a millisecond",
            absolute=True,
        ),
        check(
            "impulsive prominence of a click 20 dB above steady noise [-]",
            expected=float(3.0 * np.log10(rise / 0.02) + 2.0 * np.log10(rise)),
            computed=impulsive_prominence(drive_pattern(short, 0.1, 10.0), on_noise).prominence,
            tolerance=5e-6,
            source="ISO/PAS 1996-3:2022, formula 2, a rise within one step of 20 ms",
            reason="the level of the click alone is that of a record of 0.1 s",
        ),
        check(
            "sound exposure of 34 clicks over that of one (2000 rpm, four strokes, 2 s) [dB]",
            expected=10.0 * float(np.log10(34.0)),
            computed=sound_exposure_level(drive_pattern(click, 2000.0 / 60.0 * 0.5, 2.0))
            - sound_exposure_level(click),
            tolerance=2e-13,
            source="10 lg n for tails that do not overlap",
        ),
        check(
            "kurtosis of a sine [-]",
            expected=1.5,
            computed=kurtosis(sine),
            tolerance=5e-14,
            source="moments of a sine",
        ),
        check(
            "crest factor of a sine [-]",
            expected=sqrt(2.0),
            computed=crest_factor(sine),
            tolerance=5e-14,
            source="moments of a sine",
        ),
    ]


def _weighting() -> list[Check]:
    table, axis = np.array(A_WEIGHTS).T, np.geomspace(20.0, 20e3, 200)
    curve = ComparedCurve(
        x_label="frequency [Hz]",
        y_label="A-weighting [dB]",
        expected=(table[0], table[1]),
        computed=(axis, 20.0 * np.log10(np.abs(weighting(axis)))),
        x_log=True,
    )
    return [
        check(
            f"A-weighting at {frequency:.6g} Hz [dB]",
            expected=level,
            computed=float(20.0 * np.log10(np.abs(weighting(frequency)))),
            tolerance=0.05,
            source="IEC 61672-1:2013, Table 3, one decimal",
            reason="half of the last digit of the table",
            absolute=True,
            curve=curve,
        )
        for frequency, level in A_WEIGHTS
    ]


def _cumulative() -> list[Check]:
    density = energy_spectral_density(force_spectrum(_half_sine(), high=2e6, resolution=200.0))
    cumulative = cumulative_energy(density, low=0.0, high=2e6)
    f = np.linspace(0.0, cumulative.frequency_below(0.9), 100_001)
    return [
        check(
            "energy of a half sine on a preload over all frequencies [N^2 s]",
            expected=0.5 * PEAK**2 * LENGTH,
            computed=cumulative.total,
            tolerance=5e-5,
            source="Parseval: F0^2 T / 2",
        ),
        check(
            "share of its energy below the frequency of 90 % [-]",
            expected=0.9,
            computed=float(np.trapezoid(2.0 * _spectrum(f) ** 2, f) / (0.5 * PEAK**2 * LENGTH)),
            tolerance=1e-4,
            source="closed density of a half sine",
        ),
    ]


def _loudness() -> Iterator[Check]:
    for frequency, level, loudness in TONES:
        found = time_varying_loudness(_pulse(frequency, level, 0.6, end=0.0))
        yield check(
            f"loudness of a tone of {frequency:g} Hz and {level:g} dB [sone]",
            expected=loudness,
            computed=found.maximum,
            tolerance=max(0.05 * loudness, 0.1),
            source="ISO 532-1:2017, Annex B.3; its tolerance: 5 % or 0.1 sone",
            reason="the tolerance of the standard",
            absolute=True,
        )
    for duration, loudness in PULSES:
        found = time_varying_loudness(_pulse(1000.0, 70.0, duration, end=0.2))
        yield check(
            f"largest loudness of 1 kHz, 70 dB for {duration * 1e3:g} ms [sone]",
            expected=loudness,
            computed=found.maximum,
            tolerance=0.05,
            source="ISO 532-1:2017, Annex B.4 (ramps of 2 ms assumed)",
        )
    noise = time_varying_loudness(_narrow_noise())
    yield check(
        "sharpness of noise from 920 to 1080 Hz, 60 dB [acum]",
        expected=1.0,
        computed=noise.sharpness,
        tolerance=0.05,
        source="DIN 45692:2009: defines 1 acum; its tolerance",
    )


def _pulse(frequency: float, level: float, duration: float, *, end: float) -> TimeSeries:
    t = np.arange(round((0.1 + duration + end) * RATE)) / RATE - 0.1
    ramp = 2e-3
    rise = 0.5 - 0.5 * np.cos(pi * np.clip(t / ramp + 0.5, 0.0, 1.0))
    fall = 0.5 + 0.5 * np.cos(pi * np.clip((t - duration) / ramp + 0.5, 0.0, 1.0))
    peak = sqrt(2.0) * 20e-6 * 10.0 ** (level / 20.0)
    wave = peak * rise * (fall if end else 1.0) * np.sin(2.0 * pi * frequency * t)
    return TimeSeries(step=1.0 / RATE, values=wave, unit="Pa")


def _narrow_noise() -> TimeSeries:
    f = np.fft.rfftfreq(RATE, 1.0 / RATE)
    phase = np.exp(2j * pi * np.random.default_rng(0).random(f.size))
    values = np.fft.irfft(np.where((f >= 920.0) & (f < 1080.0), phase, 0.0), RATE)
    return TimeSeries(
        step=1.0 / RATE, values=values * 0.02 / np.sqrt(np.mean(values**2)), unit="Pa"
    )
