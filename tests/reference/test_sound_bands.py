"""Truth: IEC 61260-1:2014 (limits of class 1), IEC 61672-1:2013 (A-weighting), PyOctaveBand."""

from math import pi

import numpy as np
import pytest

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.signal_statistics import a_weighted, a_weighting, pressure_third_octaves
from klack.acoustics.sound import click_pressure
from klack.acoustics.third_octave import band_edges, band_energies, middle_frequencies
from klack.signals import Spectrum, TimeSeries

RATE = 48_000
G = 10.0**0.3

# IEC 61260-1:2014, Table 1, class 1: exponent of G (octaves), least and largest attenuation [dB]
INSIDE = ((0.0, -0.4, 0.4), (1 / 8, -0.4, 0.5), (1 / 4, -0.4, 0.7), (3 / 8, -0.4, 1.4))
EDGE_INSIDE, EDGE_OUTSIDE = (-0.4, 5.3), 1.2
OUTSIDE = ((1.0, 16.6), (2.0, 40.5), (3.0, 60.0), (4.0, 70.0))

# IEC 61672-1:2013, Table 3 [dB] at nominal frequencies; they stand for 10^(n/10) exactly
A_TABLE = {
    10: -70.4, 16: -56.7, 20: -50.5, 31.5: -39.4, 63: -26.2, 100: -19.1, 125: -16.1, 250: -8.6,
    500: -3.2, 1000: 0.0, 2000: 1.2, 2500: 1.3, 4000: 1.0, 8000: -1.1, 10_000: -2.5,
    12_500: -4.3, 16_000: -6.6, 20_000: -9.3,
}  # fmt: skip


def third(exponent):
    """Normalised frequency of a one-third-octave breakpoint, formula (9) of the standard."""
    return 1.0 + (G ** (1 / 6) - 1.0) / (G**0.5 - 1.0) * (G**exponent - 1.0)


def attenuation(omega, *, number=0):
    """Of a line at ``omega`` times the middle frequency, by band ``number`` [dB]."""
    f = omega * float(middle_frequencies(np.array([number]))[0])
    width = 1e-6 * f
    density = Spectrum(
        frequency=np.array([0.0, f - width, f, f + width, 1e3 * f]),
        values=np.array([0.0, 0.0, 1.0, 0.0, 0.0]),
        unit="Pa^2 s/Hz",
    )
    low, high = band_edges(np.array([number]))
    energy = band_energies(density, low=float(low[0]), high=float(high[0])).energy
    assert energy.shape == (1,)
    share = max(float(energy[0]), 0.0) / width
    return -10.0 * np.log10(share) if share > 1e-12 else np.inf


@pytest.mark.parametrize("number", [-17, 0, 23])
def test_bands_keep_the_limits_of_class_1(number):
    for exponent, least, largest in INSIDE:
        for omega in (third(exponent), 1.0 / third(exponent)):
            assert least <= attenuation(omega, number=number) <= largest
    for side in (1.0, -1.0):
        edge = third(0.5)
        inside = attenuation((edge * (1.0 - 1e-5)) ** side, number=number)
        assert EDGE_INSIDE[0] <= inside <= EDGE_INSIDE[1]
        assert attenuation((edge * (1.0 + 1e-5)) ** side, number=number) >= EDGE_OUTSIDE
        for exponent, least in OUTSIDE:
            assert attenuation(third(exponent) ** side, number=number) >= least


def test_limits_are_those_of_another_transcription():
    from pyoctaveband.compliance import class_limits

    omega = np.array([third(e) for e, _, _ in INSIDE])
    least, largest = class_limits(3, 1, omega)
    np.testing.assert_allclose(least, [low for _, low, _ in INSIDE], atol=1e-9)
    np.testing.assert_allclose(largest, [high for _, _, high in INSIDE], atol=1e-9)
    beyond = class_limits(3, 1, np.array([third(e) * (1.0 + 1e-12) for e, _ in OUTSIDE]))[0]
    np.testing.assert_allclose(beyond, [low for _, low in OUTSIDE], atol=1e-6)


def test_neighbouring_bands_share_a_line_without_loss():
    """The standard allows sums to be 0.8 dB low or 1.8 dB high; here nothing is lost."""
    edge = float(band_edges(np.array([0]))[1][0])
    f = np.linspace(0.0, 4e3, 400_001)
    values = np.exp(-0.5 * ((f - edge) / 2.0) ** 2)
    density = Spectrum(frequency=f, values=values, unit="Pa^2 s/Hz")
    bands = band_energies(density, low=890.0, high=1500.0)

    assert bands.number.tolist() == [0, 1]
    assert bands.energy.sum() == pytest.approx(np.trapezoid(values, f), rel=1e-9)
    assert bands.energy[0] == pytest.approx(bands.energy[1], rel=1e-3)


def click():
    """A click of 250 N and 15 us through a transfer that rises slowly."""
    step = 50e-9
    edges = step * np.arange(40_001)
    x = np.clip((edges - 1e-3) / 15e-6, 0.0, 1.0)
    values = np.diff(250.0 * 15e-6 / pi * (1.0 - np.cos(pi * x))) / step
    force = TimeSeries(step=step, values=values, unit="N", start=0.5 * step)
    f = np.geomspace(10.0, 30e3, 300)
    return click_pressure(
        force, f, 1e-10 * (f / 1e3) ** 0.5, distance=1.0, density=1.204, sound_speed=343.2
    )


@pytest.mark.parametrize("what", ["click", "pattern", "noise"])
def test_levels_are_those_of_pyoctaveband(what):
    """Butterworth filters of order 6 against ideal bands: smooth spectra differ by 0.25 dB at most.

    Bands from 315 Hz to 10 kHz: in lower ones its decimated filters keep few samples of a click,
    and few lines of a pattern of 10 Hz; measured up to 0.75 dB at 100 Hz, 0.2 dB from 315 Hz on.
    """
    from pyoctaveband import octavefilter

    if what == "noise":
        f = np.fft.rfftfreq(4 * RATE, 1.0 / RATE)
        phase = np.exp(2j * pi * np.random.default_rng(3).random(f.size))
        values = np.fft.irfft(phase / np.sqrt(np.maximum(f, 10.0))) * 10.0
        pressure = TimeSeries(step=1.0 / RATE, values=values, unit="Pa")
    else:
        pressure = click() if what == "click" else drive_pattern(click(), 10.0, 2.0)
    size = pressure.values.size
    level, middle = octavefilter(
        pressure.values, RATE, fraction=3, limits=[300.0, 11e3], detrend=False
    )
    bands = pressure_third_octaves(pressure, low=270.0, high=11.5e3)
    ours = bands.level_re((20e-6) ** 2 * size / RATE)
    at = [int(np.abs(bands.middle - m).argmin()) for m in middle]

    assert len(at) == 16
    np.testing.assert_allclose(bands.middle[at], middle, rtol=1e-3)
    np.testing.assert_allclose(np.asarray(level), ours[at], atol=0.25)


def test_a_weighting_is_that_of_the_table():
    nominal = np.array(list(A_TABLE))
    level = 20.0 * np.log10(a_weighting(10.0 ** (np.round(10.0 * np.log10(nominal)) / 10.0)))

    np.testing.assert_allclose(level, list(A_TABLE.values()), atol=0.05 + 1e-9)  # one decimal


def test_a_weighted_level_of_noise_is_that_of_pyoctaveband():
    """Its digital filter is of class 1, which allows 1 dB; broad noise evens it out."""
    from pyoctaveband.parametric_filters import WeightingFilter

    values = np.random.default_rng(5).standard_normal(2 * RATE)
    low = np.fft.rfft(values)
    low[np.fft.rfftfreq(values.size, 1.0 / RATE) > 8e3] = 0.0
    values = np.fft.irfft(low)
    theirs = WeightingFilter(RATE, "A").filter(values)
    ours = a_weighted(TimeSeries(step=1.0 / RATE, values=values, unit="Pa")).values

    ratio = np.sum(ours**2) / np.sum(np.asarray(theirs) ** 2)
    assert 10.0 * np.log10(ratio) == pytest.approx(0.0, abs=0.2)
