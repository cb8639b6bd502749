"""Recordings of strokes.

Truth: recordings made here, whose triggers, strokes and defects are known.

Truth: a valve that stays closed until it opens has touched nothing before.
"""

import numpy as np
import pytest

from klack.analyses.comparison.strokes import require_same_way
from klack.case.measurement import CaseMeasurement
from klack.errors import InputError
from klack.measurement.channels import Trigger
from klack.measurement.cutting import Piece, common_axis, cut_strokes, onto_axis, trigger_level
from klack.measurement.loading import _saturated, find_outliers, load_stroke_set
from klack.measurement.stop_levels import SmoothLift, find_touches
from klack.signals.sampled import TimeSeries

STEP = 2e-6  # [s]
TRIGGER = Trigger(channel="current", share=0.5, before="0.2 ms", after="3 ms")


def pulses(instants, duration, *, noise=0.0, step=STEP):
    """Currents that rise over 50 us, stay for 2 ms and fall."""
    t = step * np.arange(round(duration / step))
    x = np.zeros_like(t)
    for instant in instants:
        x += np.clip((t - instant) / 50e-6, 0.0, 1.0) * (t < instant + 2e-3)
    return t, 5.0 * x + noise * np.random.default_rng(3).normal(size=t.size)


def in_windows(values, size, overlap):
    first = 0
    while True:
        last = min(first + size, values.size)
        yield {
            "current": TimeSeries(
                step=STEP, values=values[first:last], unit="A", start=first * STEP
            )
        }
        if last == values.size:
            return
        first = last - overlap


@pytest.mark.parametrize("size", [2000, 2351, 5003, 10**6])
def test_windows_do_not_change_what_is_cut(size):
    instants = [3e-3, 10.0007e-3, 17.0013e-3, 24e-3, 31.0001e-3]
    _, x = pulses(instants, 40e-3)
    level = trigger_level(in_windows(x, size, 0), TRIGGER)
    pieces = list(cut_strokes(in_windows(x, size, 1610), TRIGGER, level))

    assert level == pytest.approx(2.5, rel=1e-6)
    np.testing.assert_allclose(
        [piece.instant for piece in pieces], np.array(instants) + 25e-6, atol=1e-10
    )
    assert all(piece.start <= -0.2e-3 and piece.end >= 3e-3 for piece in pieces)


def test_noise_at_the_level_does_not_trigger_twice():
    instants = np.arange(20) * 10e-3 + 2e-3
    _, x = pulses(instants, 0.2, noise=0.2)
    trigger = TRIGGER.model_copy(update={"dead_time": 1e-4})
    pieces = list(cut_strokes(in_windows(x, 20_000, 1610), trigger, 2.5))

    assert len(pieces) == 20
    # 0.2 A of noise on a slope of 0.1 A/us, and the first of several crossings
    np.testing.assert_allclose([piece.instant for piece in pieces], instants + 25e-6, atol=10e-6)


def test_falling_slope_and_absolute_level():
    _, x = pulses([3e-3], 10e-3)
    trigger = Trigger(channel="current", level="1 A", slope="falling", after="1 ms")
    (piece,) = cut_strokes(in_windows(x, 10**6, 0), trigger, trigger.value)

    assert piece.instant == pytest.approx(5e-3, abs=STEP)


def test_a_still_channel_cannot_trigger():
    with pytest.raises(InputError, match="stays at"):
        trigger_level(in_windows(np.ones(100), 100, 0), TRIGGER)


def test_alignment_puts_a_cubic_where_it_belongs():
    t = np.arange(50) * 1e-6
    piece = Piece(start=-20.3e-6, step=1e-6, values={"lift": (t - 20.3e-6) ** 3}, instant=0.0)
    axis = common_axis([piece], -1.0, 1.0)

    assert 0.0 in axis
    np.testing.assert_allclose(onto_axis(piece, axis)["lift"], axis**3, atol=1e-26)


def strokes(count=12, noise=0.3e-6):
    rng = np.random.default_rng(7)
    t = STEP * np.arange(1500)
    lift = 80e-6 * np.clip((t - 0.5e-3) / 0.3e-3, 0.0, 1.0)
    return t, lift + noise * rng.normal(size=(count, t.size)) + 1e-6 * rng.normal(size=(count, 1))


def test_good_strokes_are_all_kept():
    assert find_outliers(*strokes()) == {}


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda x: 0.05 * x, "no motion"),
        (lambda x: np.minimum(x, 60e-6), "clipped"),
        (lambda x: x + 3e-6 * np.random.default_rng(0).normal(size=x.size), "noise"),
        (lambda x: np.roll(x, 200), "shape"),
    ],
)
def test_a_spoilt_stroke_is_put_aside_with_its_reason(spoil, reason):
    t, lift = strokes()
    lift[4] = spoil(lift[4])
    found = find_outliers(t, lift)

    assert list(found) == [4]
    assert found[4].startswith(reason)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda x: np.minimum(x, 60e-6), "highest lift (median 60 um)"),
        (lambda x: np.maximum(x, 10e-6), "lowest lift (median 10 um)"),
        (lambda x: x, ""),
        (lambda x: np.round(x, 6), ""),  # a coarse recorder repeats all values
    ],
)
def test_a_set_at_the_end_of_its_range_is_doubted(spoil, said):
    """Truth: the clipped value; without clipping, and without noise, no word."""
    notes = [*_saturated(spoil(strokes()[1])), *_saturated(strokes(noise=0.0)[1])]

    assert len(notes) == bool(said)
    assert all(said in note for note in notes)


def write(path, instants, duration):
    t, current = pulses(instants, duration)
    lift = np.zeros_like(t)
    for instant in instants:
        up = np.clip((t - instant - 0.2e-3) / 0.3e-3, 0.0, 1.0)
        lift += 80.0 * up * (t < instant + 2.5e-3)
    lift += 5.0 + 0.1 * np.random.default_rng(1).normal(size=t.size)
    rows = np.column_stack([1e3 * t, lift, current])
    np.savetxt(
        path, rows, delimiter=",", fmt="%.6f", header="time [ms],lift [um],current [A]", comments=""
    )


def section(**more):
    return CaseMeasurement.model_validate(
        {"trigger": {"channel": "current", "before": "0.2 ms", "after": "3 ms"}, **more}
    )


def test_a_long_file_becomes_a_set(tmp_path):
    write(tmp_path / "bench.csv", [1e-3, 6e-3, 11e-3, 16e-3], 17e-3)
    shares = []
    found = load_stroke_set([tmp_path / "bench.csv"], section(), shares.append)

    assert [stroke.name for stroke in found.strokes] == [f"bench.csv #{k}" for k in (1, 2, 3)]
    assert [(bad.name, bad.reason[:10]) for bad in found.rejected] == [
        ("bench.csv #4", "incomplete")
    ]
    assert found.time[0] == pytest.approx(-0.2e-3)
    assert found.time[-1] == pytest.approx(3e-3)
    assert found.matrix("lift")[:, found.time < 0.0].mean() == pytest.approx(0.0, abs=0.05e-6)
    assert found.matrix("lift").max() == pytest.approx(80e-6, abs=1e-6)
    assert [stroke.start for stroke in found.strokes] == pytest.approx(
        [1.01e-3, 6.01e-3, 11.01e-3], abs=2e-7
    )  # 20 % of a rise of 50 us
    assert shares[0] == 0.0
    assert shares[-1] == 1.0


def test_the_lift_stays_as_measured_if_asked(tmp_path):
    write(tmp_path / "bench.csv", [1e-3], 6e-3)
    found = load_stroke_set([tmp_path / "bench.csv"], section(zero="none"))

    assert found.matrix("lift")[0, 0] == pytest.approx(5e-6, abs=0.5e-6)


def test_files_without_a_trigger_are_strokes(tmp_path):
    for k in range(3):
        write(tmp_path / f"shot{k}.csv", [1e-3], 6e-3)
    found = load_stroke_set([tmp_path / f"shot{k}.csv" for k in range(3)])

    assert [stroke.name for stroke in found.strokes] == ["shot0.csv", "shot1.csv", "shot2.csv"]
    assert found.time[0] == 0.0


def test_no_stroke_at_all_is_an_error(tmp_path):
    write(tmp_path / "bench.csv", [1e-3], 6e-3)
    high = {"channel": "current", "level": "50 A"}
    with pytest.raises(InputError, match="no stroke"):
        load_stroke_set([tmp_path / "bench.csv"], section(trigger=high))


def test_a_bench_that_records_less_shares_the_description_of_another(tmp_path):
    write(tmp_path / "bench.csv", [1e-3, 6e-3], 12e-3)
    rich = section(channels={"lift": "lift", "current": "current", "pressure": "P_Inlet"})

    found = load_stroke_set([tmp_path / "bench.csv"], rich, roles=("lift",))

    assert found.roles == ("lift", "current")  # the trigger is always read
    assert found.notes == ()
    with pytest.raises(InputError, match="no channel 'P_Inlet'"):
        load_stroke_set([tmp_path / "bench.csv"], rich)


@pytest.mark.parametrize("shift", [0.1, 0.37, 0.5, 0.9])
def test_a_step_between_samples_stays_within_its_samples(shift):
    # a cubic spline leaves 0 to 5 by 0.54
    t = np.arange(60.0)
    smooth = 7.0 - (t - 30.3) ** 2
    values = {"current": np.where(t < 30, 0.0, 5.0), "lift": smooth}
    piece = Piece(start=-shift, step=1.0, values=values, instant=0.0)
    found = onto_axis(piece, axis := np.arange(58.0))

    assert found["current"].min() == 0.0
    assert found["current"].max() == 5.0
    # and a crest is what it is, not the highest sample: rounding of numbers up to 900
    np.testing.assert_allclose(found["lift"], 7.0 - (axis + shift - 30.3) ** 2, atol=1e-12)


def test_every_resampled_channel_is_named(tmp_path):
    t = 10e-6 * np.arange(600)
    slow = np.column_stack([t, 80e3 * t, 0.2e-3 + 0.7 * t, np.where(t < 1e-3, 0.0, 5.0)])
    head = "t1 [s],lift [um],t2 [s],current [A]"
    np.savetxt(tmp_path / "a.csv", slow, "%.9f", ",", header=head, comments="")
    trigger = {"channel": "current", "level": "1 A", "before": "0.2 ms", "after": "3 ms"}
    found = load_stroke_set([tmp_path / "a.csv"], section(trigger=trigger))

    text = "\n".join(found.notes)
    assert "'lift' (step 1e-05 s) resampled to steps of 7e-06 s by linear interpolation" in text
    assert "lift, current: samples interpolated onto a common time from the trigger" in text
    current = found.matrix("current")
    assert (current.min(), current.max()) == (0.0, 5.0)


def test_channels_of_one_uneven_time_are_all_named(tmp_path):
    t = 10e-6 * (np.arange(600) + 0.2 * np.random.default_rng(2).random(600))
    rows = np.column_stack([t, 80e3 * t, 5e3 * t])
    head = "t [s],lift [um],current [A]"
    np.savetxt(tmp_path / "a.csv", rows, "%.9f", ",", header=head, comments="")
    found = load_stroke_set([tmp_path / "a.csv"])

    assert any("'lift', 'current': time jitters" in note for note in found.notes)


@pytest.mark.parametrize("offset", [0.0, 200e-6])
def test_a_lift_that_counts_backwards_is_refused_with_the_key(offset):
    time = np.linspace(0.0, 4e-3, 500)
    lift = 80e-6 * np.clip((time - 0.4e-3) / 0.1e-3, 0.0, 1.0) * (time < 2.6e-3)
    noise = 1e-6 * np.random.default_rng(1).normal(size=time.size)
    require_same_way("bench.csv", lift, lift + noise + offset)
    require_same_way("bench.csv", lift, 0.0 * lift)
    with pytest.raises(InputError, match=r"(?s)lift: got a lift that moves against .*scale: -1"):
        require_same_way("bench.csv", lift, offset - lift + noise)


def test_recordings_whose_trigger_jitters_are_aligned(tmp_path):
    paths = []
    for k in range(5):
        paths.append(tmp_path / f"shot{k}.csv")
        write(paths[k], [1e-3 + 37.3e-6 * k], 6e-3)
    found = load_stroke_set(paths, section(zero="none"))

    assert len(found.strokes) == 5
    lift = found.matrix("lift")[:, found.time < 2.4e-3]  # later it falls between two samples
    # the noise of 0.1 um, and 2 us of a rise of 80 um in 300 us where a sample is held
    assert np.abs(lift - np.median(lift, axis=0)).max() < 0.6e-6 + 2e-6 * 80e-6 / 300e-6
    starts = np.array([stroke.start for stroke in found.strokes])
    np.testing.assert_allclose(np.diff(starts), 37.3e-6, rtol=0, atol=1e-8)


@pytest.mark.parametrize("end", [slice(0, 3), slice(-3, None)])
def test_the_noisy_ends_of_a_smoothed_record_make_no_impacts(end):
    lift = np.zeros(400)
    lift[150:250] = 80e-6
    lift[end] = 5e-6  # above twice the least height
    smooth = SmoothLift(
        lift=lift,
        velocity=np.gradient(lift, 1e-6),
        noise=1e-6,
        lift_noise=0.3e-6,
        velocity_noise=0.03,
        half=10,
        least_height=1.5e-6,
    )
    touches = find_touches(smooth, {"seat": 0.0})

    assert [(touch.index, touch.rebounds) for touch in touches] == [(250, False)]
