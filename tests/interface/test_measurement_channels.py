"""What channels mean, in which unit they are, and how they come onto one time.

Truth: signals whose values are known at any time, and the words of the cases below.
"""

import re

import numpy as np
import pytest
from ruamel.yaml import YAML

from klack.case.measurement import CaseMeasurement
from klack.errors import AccuracyWarning, InputError
from klack.measurement.channels import ROLES, ChannelChoice
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.loading import load_stroke_set
from klack.measurement.read_channels import common_time, read_channels, windows
from klack.measurement.unit_text import roles_of_unit, unit_factor
from klack.units import TIME


def table(path, names, columns, digits=12):
    rows = [",".join(names)]
    rows += [
        ",".join("" if np.isnan(x) else f"{x:.{digits}g}" for x in row)
        for row in np.column_stack(columns)
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


def some(path, *names):
    time = 1e-5 * np.arange(20)
    return table(path, ["t [s]", *names], [time, *(k + time for k in range(len(names)))])


def meaning(path, channels=None, **options):
    with open_recording(path, **options) as recording:
        found = find_channels(recording, channels)
    return [{role: channel.name for role, channel in each.items()} for each in found]


# units ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "role", "factor"),
    [
        ("µm", "lift", 1e-6),
        ("μm", "lift", 1e-6),  # the Greek letter
        ("um", "lift", 1e-6),
        ("[mm]", "lift", 1e-3),
        ("A", "current", 1.0),
        ("mA", "current", 1e-3),
        ("bar", "pressure", 1e5),
        ("kN/mm^2", "pressure", 1e9),
        ("V", "voltage", 1.0),
        ("m/s^2", "acceleration", 1.0),
        ("m/s²", "acceleration", 1.0),
        ("m·s⁻²", "acceleration", 1.0),
        ("g", "acceleration", 9.80665),
        ("Pa", "pressure", 1.0),
        ("N", "force", 1.0),
        ("mm/s", "velocity", 1e-3),
    ],
)
def test_units_as_people_write_them(text, role, factor):
    assert unit_factor(text, role, "x").factor == pytest.approx(factor, rel=1e-12)


def test_gauge_pressure_is_turned_into_absolute_pressure():
    assert unit_factor("bar(g)", "pressure", "x").offset == 101325.0


def test_a_unit_of_time():
    assert unit_factor("(ms)", TIME, "x").factor == 1e-3


@pytest.mark.parametrize(
    ("text", "role", "message"),
    [
        ("", "lift", "a.csv: got no unit, expected the unit of a length, e.g. m"),
        ("-", "lift", "got no unit"),
        ("A", "lift", r"got the unit 'A' \(a current\), expected a unit of a length: m, cm"),
        ("Furlong", "current", "got the unit 'Furlong', expected a unit of a current"),
        ("__import__('os')", "lift", "expected a unit of a length"),
        ("9**9**9**9", "lift", "expected a unit of a length"),
    ],
)
def test_other_units_are_refused(text, role, message):
    with pytest.raises(InputError, match=message):
        unit_factor(text, role, "a.csv")


def test_roles_of_units():
    assert roles_of_unit("mg") == ("acceleration",)
    assert roles_of_unit("parsec") == ()


# meaning ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("lift [um]", "current [A]"), {"lift": "lift", "current": "current"}),
        (("Nadelhub [µm]", "Spulenstrom [A]"), {"lift": "Nadelhub", "current": "Spulenstrom"}),
        (("x_needle [mm]", "i_coil [mA]"), {"lift": "x_needle", "current": "i_coil"}),
        (("Weg (mm)", "Druck (bar)"), {"lift": "Weg", "pressure": "Druck"}),
        (("p_rail [bar]", "acc_z [g]"), {"pressure": "p_rail", "acceleration": "acc_z"}),
        (("CH1 [um]", "CH2 [A]", "CH3 [V]"), {"lift": "CH1", "current": "CH2", "voltage": "CH3"}),
        (("Needle Velocity [m/s]", "u [V]"), {"velocity": "Needle Velocity", "voltage": "u"}),
        # a voltage of the lift sensor is no lift, and temperatures are nothing
        (("lift [V]", "T_oil [degC]", "hub [um]"), {"lift": "hub", "voltage": "lift"}),
        # two pressures, none of them needed
        (("lift [um]", "p_rail [bar]", "p_return [bar]"), {"lift": "lift"}),
    ],
)
def test_channels_are_found_by_name_and_unit(tmp_path, names, expected):
    assert meaning(some(tmp_path / "a.csv", *names)) == [expected]


def test_named_channels_units_and_scales(tmp_path):
    path = some(tmp_path / "a.csv", "CH1 [V]", "CH2")
    channels = {
        "lift": ChannelChoice(name="CH1", unit="um", scale=-20.0),
        "current": ChannelChoice(name="CH2", unit="mA"),
    }
    with open_recording(path) as recording:
        (found,) = find_channels(recording, channels)
        series = read_channels(recording, found)
    np.testing.assert_allclose(series["lift"].values, -20e-6 * 1e-5 * np.arange(20), rtol=1e-12)
    np.testing.assert_allclose(series["current"].values, 1e-3 * (1 + 1e-5 * np.arange(20)))
    assert found["lift"].note == ""


def test_a_pattern_gives_one_stroke_per_match_in_the_order_of_the_file(tmp_path):
    names = ["lift_2 [um]", "i_2 [A]", "lift_1 [um]", "i_1 [A]", "p [bar]"]
    path = some(tmp_path / "a.csv", *names)
    expected = [
        {"lift": "lift_2", "current": "i_2", "pressure": "p"},
        {"lift": "lift_1", "current": "i_1", "pressure": "p"},
    ]
    channels = {"lift": ChannelChoice(name="lift_*"), "current": ChannelChoice(name="i_?")}
    assert meaning(path, channels) == expected
    assert meaning(path) == expected  # names that differ in their numbers only are a series


@pytest.mark.parametrize(
    ("names", "channels", "message"),
    [
        (("hub_a [um]", "hub_b [um]"), {}, r"several that could be the lift: hub_a, hub_b"),
        (("T [K]", "level"), {}, r"none that could be the lift: T \[K\], level"),
        (("lift [V]",), {"lift": "lift"}, r"'scale' is the number of m per 'V' of a sensor"),
        (("lift [um]",), {"lift": "hub"}, r"channels.lift: got no channel 'hub', expected one of"),
        (("lift",), {"lift": "lift"}, "got no unit, expected the unit of a length"),
        (("lift [A]",), {"lift": "lift"}, r"the unit 'A' \(a current\)"),
        (
            ("x_1 [um]", "x_2 [um]", "x_3 [um]", "i_1 [A]", "i_2 [A]"),
            {},
            "got 3 channels of lift and 2 of current, expected one of current for all, or 3",
        ),
    ],
)
def test_unclear_channels_are_refused(tmp_path, names, channels, message):
    choices = {role: ChannelChoice(name=name) for role, name in channels.items()}
    with pytest.raises(InputError, match=message):
        meaning(some(tmp_path / "a.csv", *names), choices)


def test_needed_channels_must_be_there_and_clear(tmp_path):
    path = some(tmp_path / "a.csv", "lift [um]", "p_rail [bar]", "p_return [bar]")
    with open_recording(path) as recording:
        with pytest.raises(InputError, match="none that could be the current: lift"):
            find_channels(recording, needed=("lift", "current"))
        with pytest.raises(InputError, match="several that could be the pressure: p_rail, p_ret"):
            find_channels(recording, needed=("pressure",))
    with (
        open_recording(some(tmp_path / "volts.csv", "out [V]")) as recording,
        pytest.raises(InputError, match=r"scale: 1\}\}\}, with the um per V"),
    ):
        find_channels(recording, needed=("lift",))


# time -------------------------------------------------------------------------------------------


def lift_of(time):
    return 40.0 * (1.0 - np.cos(2e3 * time))


def read(path, **options):
    with open_recording(path, **options) as recording:
        (found,) = find_channels(recording)
        return read_channels(recording, found), common_time(recording, found)


def test_slower_channels_come_onto_the_time_of_the_fastest(tmp_path):
    fast, slow = 1e-6 * np.arange(2000), 1.04e-4 + 1e-5 * np.arange(150)
    pressure = np.full(2000, np.nan)
    pressure[:150] = 3e3 * slow
    clock = np.full(2000, np.nan)
    clock[:150] = slow
    path = table(
        tmp_path / "a.csv",
        ["t1 [s]", "lift [um]", "t2 [s]", "p [bar]"],
        [fast, lift_of(fast), clock, pressure],
    )
    series, clock = read(path)
    assert clock.step == pytest.approx(1e-6)
    assert clock.start == pytest.approx(1.04e-4)  # where both have begun
    assert clock.count == 149 * 10 + 1
    time = series["lift"].time
    # twelve digits were written; a straight line is met by straight lines
    np.testing.assert_allclose(series["lift"].values, 1e-6 * lift_of(time), rtol=1e-9)
    np.testing.assert_allclose(series["pressure"].values, 1e5 * 3e3 * time, rtol=1e-9)
    assert any("'p' (step 1e-05 s) resampled to steps of 1e-06 s" in n for n in clock.notes)


def test_a_rounded_time_is_taken_as_uniform(tmp_path):
    true = 1.25e-5 * np.arange(3000)
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]"], [np.round(true, 6), lift_of(true)])
    series, clock = read(path)
    assert clock.step == pytest.approx(1.25e-5, rel=1e-4)
    np.testing.assert_allclose(series["lift"].values, 1e-6 * lift_of(true), rtol=1e-9)
    assert any("rounded" in note for note in clock.notes)


def test_a_jittering_time_is_resampled_with_a_note(tmp_path):
    rng = np.random.default_rng(5)
    time = 1e-6 * (np.arange(3000) + 0.2 * rng.uniform(-1, 1, 3000))
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]"], [time, lift_of(time)])
    series, clock = read(path)
    assert any("jitters" in note for note in clock.notes)
    expected = 1e-6 * lift_of(series["lift"].time)
    # straight lines over 1.4 us of a curvature of 160 um/ms^2: 4e-11 m
    np.testing.assert_allclose(series["lift"].values, expected, atol=5e-11)
    with open_recording(path) as recording:
        (found,) = find_channels(recording)
        for part in windows(recording, found, 4e-4, 1e-4):
            first = round((part["lift"].start - clock.start) / clock.step)
            whole = series["lift"].values[first : first + part["lift"].values.size]
            np.testing.assert_allclose(part["lift"].values, whole, rtol=1e-12)


def test_a_few_lost_samples_are_bridged_and_many_refused(tmp_path):
    time = np.delete(1e-6 * np.arange(3000), [700, 701])
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]"], [time, lift_of(time)])
    series, clock = read(path)
    assert any("leaves out samples" in note for note in clock.notes)
    expected = 1e-6 * lift_of(1e-6 * np.arange(3000))
    np.testing.assert_allclose(series["lift"].values, expected, atol=3e-10)

    time = np.delete(1e-6 * np.arange(3000), np.arange(700, 720))
    table(path, ["t [s]", "lift [um]"], [time, lift_of(time)])
    with pytest.raises(
        InputError, match=r"got a gap of 2\.1e-05 s in its time before row 701 of its numbers"
    ):
        read(path)


def test_a_few_missing_values_are_bridged_and_many_refused(tmp_path):
    time = 1e-6 * np.arange(500)
    lift = lift_of(time)
    lift[100:104] = np.nan
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]"], [time, lift])
    with pytest.warns(AccuracyWarning, match="4 missing values of 'lift' were filled"):
        series, _ = read(path)
    np.testing.assert_allclose(series["lift"].values, 1e-6 * lift_of(time), atol=1e-9)
    lift[100:110] = np.nan
    table(path, ["t [s]", "lift [um]"], [time, lift])
    with pytest.raises(InputError, match=r"got 10 missing values in a row at 0\.0001 s"):
        read(path)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda t: t.__setitem__(30, t[28]),
            r"does not increase: 2.8e-05 s at row 31 of its numbers",
        ),
        (
            lambda t: t.__setitem__(30, t[29]),
            r"does not increase: 2.9e-05 s at row 31 of its numbers",
        ),
        (
            lambda t: t.__setitem__(30, 2e6),
            r"does not increase: 3.1e-05 s at row 32 of its numbers",
        ),
        (lambda t: t.__setitem__(slice(30, 50), t[30:50] + 2.0), "a gap of 2 s .* before row 31"),
        (lambda t: t.__setitem__(49, 2e6), "a gap of 2e.06 s .* before row 50 of its numbers"),
        (
            lambda t: t.__setitem__(30, np.nan),
            "does not increase: no value at row 31 of its numbers",
        ),
    ],
)
def test_times_that_cannot_be_are_refused_with_their_row(tmp_path, spoil, message):
    time = 1e-6 * np.arange(50)
    lift = lift_of(time)
    spoil(time)
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]"], [time, lift])
    with pytest.raises(InputError, match=message):
        load_stroke_set([path])


@pytest.mark.parametrize("name", [None, "lift"])
def test_a_time_that_starts_again_is_cut_into_segments(tmp_path, name):
    one = 1e-6 * np.arange(-10, 490)
    time = np.concatenate([one, one + 2e-7, one[:-1]])  # of an oscilloscope: by parts of a step
    number = np.repeat([1.0, 2.0, 3.0], [500, 500, 499])
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]", "i [A]"], [time, number, -number])
    channels = {} if name is None else {"lift": name, "current": "i"}
    section = CaseMeasurement.model_validate({"channels": channels})
    found = load_stroke_set([path], section)

    assert len(found.strokes) == 3
    assert any("the time restarts; the record is cut into 3 parts" in note for note in found.notes)
    np.testing.assert_array_equal(found.matrix("current").mean(axis=1), [-1.0, -2.0, -3.0])
    with open_recording(path) as recording:
        assert [c.name for c in recording.channels][:3] == ["lift #1", "lift #2", "lift #3"]
        np.testing.assert_allclose(recording.time("lift #2"), one + 2e-7, rtol=0, atol=1e-17)


def test_channels_that_never_overlap_are_refused(tmp_path):
    time = 1e-6 * np.arange(50)
    path = table(
        tmp_path / "a.csv",
        ["t [s]", "lift [um]", "t [s]", "p [bar]"],
        [time, time, 1.0 + time, time],
    )
    with pytest.raises(InputError, match=r"no common time of lift \(0 to 4.9e-05 s\), p \(1 to"):
        read(path)


def test_a_step_replaces_a_missing_time(tmp_path):
    series, _ = read(table(tmp_path / "a.csv", ["lift [um]"], [np.arange(10.0)]), time_step=2e-5)
    assert series["lift"].step == 2e-5
    assert series["lift"].values[-1] == pytest.approx(9e-6)


def test_windows_cover_everything_and_share_the_overlap(tmp_path):
    time = 1e-6 * np.arange(1001)
    path = table(tmp_path / "a.csv", ["t [s]", "lift [um]"], [time, time])
    with open_recording(path) as recording:
        (found,) = find_channels(recording)
        parts = [w["lift"] for w in windows(recording, found, 3e-4, 1e-4)]
        with pytest.raises(InputError, match="windows: overlap"):
            next(windows(recording, found, 1e-4, 1e-4))
    assert [round(part.start / 1e-6) for part in parts] == [0, 200, 400, 600, 800]
    assert [part.values.size for part in parts] == [300, 300, 300, 300, 201]


@pytest.mark.parametrize(
    ("names", "proposed"),
    [
        (("current [A]",), "current"),
        (("current [A]", "lift [mV]"), "lift"),
        (("i_coil [A]", "CH1 [V]"), "CH1"),
        (("current [A]", "distance [furlong]"), "distance"),
    ],
)
@pytest.mark.parametrize("trigger", [{}, {"trigger": {"channel": "current", "level": "0.5 A"}}])
def test_without_a_lift_the_key_of_the_sensor_is_proposed(tmp_path, names, proposed, trigger):
    path = some(tmp_path / "a.csv", *names)
    section = CaseMeasurement.model_validate(trigger)
    for roles in (("lift",), tuple(ROLES)):
        with pytest.raises(InputError) as caught:
            load_stroke_set([path], section, roles=roles)
        text = str(caught.value)
        assert "none that could be the lift: " + ", ".join(names) in text
        assert (
            f"measurement: {{channels: {{lift: {{name: {proposed}, unit: um, scale: 1}}}}" in text
        )
    if trigger or len(names) == 1:
        return
    # and it works: 1 is 25 um
    lift = ChannelChoice(name=proposed, unit="um", scale=25.0)
    given = CaseMeasurement.model_validate({"channels": {"lift": lift}})
    found = load_stroke_set([path], given, roles=("lift",))
    np.testing.assert_allclose(found.matrix("lift")[0], 25e-6 * (1 + 1e-5 * np.arange(20)))


@pytest.mark.parametrize("name", ["1", "a: b", "it's", "# 3", "[x]"])
def test_the_proposed_key_can_be_pasted_into_a_case(tmp_path, name):
    path = some(tmp_path / "a.csv", f"{name} [V]")
    with pytest.raises(InputError) as caught:
        load_stroke_set([path])
    (text,) = re.findall(r"measurement: (\{.*\}\})", str(caught.value))
    given = CaseMeasurement.model_validate(YAML(typ="safe").load(text))
    assert load_stroke_set([path], given).count == 1
