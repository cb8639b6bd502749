"""Sound files: content read back by soundfile, stated level, and errors."""

from io import BytesIO

import numpy as np
import pytest
import soundfile

from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes, write_wav
from klack.errors import InputError
from klack.signals import TimeSeries

RATE = 48_000


def sound(amplitude, *, rate=RATE):
    t = np.arange(rate // 10) / rate
    values = amplitude * np.sin(2e3 * np.pi * t)
    return TimeSeries(step=1.0 / rate, values=values, unit="Pa", name="tone")


def test_what_is_written_is_read_back(tmp_path):
    pressure = sound(0.02)
    write_wav(tmp_path / "tone.wav", pressure, full_scale=0.05)
    values, rate = soundfile.read(tmp_path / "tone.wav")

    assert rate == RATE
    np.testing.assert_allclose(values * 0.05, pressure.values, atol=0.05 * 2.0**-23)


def test_the_file_says_how_loud_it_is(tmp_path):
    write_wav(tmp_path / "tone.wav", sound(0.02), full_scale=0.05)
    with soundfile.SoundFile(tmp_path / "tone.wav") as file:
        assert (file.subtype, file.channels, file.title) == ("PCM_24", 1, "tone")
        assert file.comment == level_statement(0.05)
    # 20 lg(0.05 / 20e-6) = 67.96, a sine 3.01 less
    assert "0.05 Pa peak (68.0 dB peak re 20 uPa" in level_statement(0.05)
    assert "64.9 dB SPL" in level_statement(0.05)


def test_sounds_share_a_full_scale():
    loud, quiet = sound(0.02), sound(0.001)
    full_scale = full_scale_of(loud, quiet)
    peak = np.abs(loud.values).max()

    assert 20.0 * np.log10(peak / full_scale) == pytest.approx(-6.0, abs=1e-9)
    assert full_scale_of(sound(0.0)) == 20e-6
    played = [
        np.abs(soundfile.read(BytesIO(wav_bytes(p, full_scale=full_scale)))[0]).max()
        for p in (loud, quiet)
    ]
    assert played[0] / played[1] == pytest.approx(20.0, rel=1e-3)


def test_clipping_and_other_rates_are_refused():
    for given, scale, words in (
        (sound(0.1), 0.05, "full_scale_of"),
        (sound(0.01, rate=44_100), 0.05, "48000 Hz"),
        (sound(0.01), 0.0, "full_scale"),
    ):
        with pytest.raises(InputError, match=words):
            wav_bytes(given, full_scale=scale)
