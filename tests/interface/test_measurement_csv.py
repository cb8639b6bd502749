"""Text tables in all dialects, and as oscilloscopes and loggers write them.

Text tables in all their dialects give the numbers that were written (truth: the numbers).

Tables as oscilloscopes and loggers write them, by files and by the manuals of their makers.

Truth: the voltages and times that were written.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from klack.errors import InputError
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels

TIME = 2e-6 * np.arange(60)  # [s]
LIFT = 80.0 * (1.0 - np.cos(2e4 * TIME))  # [um]
CURRENT = 3.0 * np.sin(1e4 * TIME)  # [A]
ROWS = np.column_stack([TIME, LIFT, CURRENT])

HEADERS = {
    "names with units": "time [s];lift [um];current [A]",
    "round brackets": "time (s);lift (µm);current (A)",
    "underscores": "time_s;lift_um;current_A",
    "slashes": "time / s;lift / um;current / A",
    "unit row": "time;lift;current\ns;um;A",
    "unit row in brackets": "time;lift;current\n[s];[µm];[A]",
    "German": "Zeit [s];Nadelhub [µm];Spulenstrom [A]",
    "metadata above": "Bench 3\nOperator;N. N.\nDate;2024-01-31\n\ntime;lift;current\ns;um;A\n",
    "comments": "# bench 3\n# time [s];lift [um];current [A]",
    "no blanks": "time/s;lift/um;current/A",
    "PicoScope": "Time;Lift;Current\n(s);(um);(A)\n",
    "LabVIEW": "Separator;Tab\n***End***;;\n;;\nX_Value;lift_um;current_A;Comment",
    "quotes": '"time [s]";"lift [um]";"current [A]"',
}


def written(path, header, rows=ROWS, separator=";", decimal=".", encoding="utf-8", end="\n"):
    lines = [separator.join(f"{x:.9e}".replace(".", decimal) for x in row) for row in rows]
    text = (header.replace(";", separator) + "\n" if header else "") + "\n".join(lines) + "\n"
    path.write_bytes(text.replace("\n", end).encode(encoding))
    return path


def read_si(path, **options):
    with open_recording(path, **options) as recording:
        (found,) = find_channels(recording)
        return read_channels(recording, found)


def check(series):
    # ten digits were written
    assert series["lift"].step == pytest.approx(2e-6, rel=1e-9)
    np.testing.assert_allclose(series["lift"].values, 1e-6 * LIFT, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(series["current"].values, CURRENT, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("header", HEADERS.values(), ids=HEADERS)
def test_names_and_units_are_found_in_the_header(tmp_path, header):
    check(read_si(written(tmp_path / "a.csv", header)))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_encodings(tmp_path, encoding, end):
    header = "Zeit [s];Hub [µm];Strom [A]"
    check(read_si(written(tmp_path / "a.txt", header, encoding=encoding, end=end)))


@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), ("  ", "."), (" ", ",")],
)
def test_separators_and_decimal_marks(tmp_path, separator, decimal):
    path = written(tmp_path / "a.asc", HEADERS["names with units"], ROWS, separator, decimal)
    check(read_si(path))


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    data=st.lists(
        st.tuples(
            st.floats(-1e6, 1e6, allow_subnormal=False),
            st.one_of(st.floats(-1e-3, 1e3, allow_subnormal=False), st.integers(-9, 9)),
        ),
        min_size=4,
        max_size=30,
    ),
    separator=st.sampled_from([";", "\t", ",", " ", "   ", " ; ", "|"]),
    decimal=st.sampled_from(".,"),
    style=st.sampled_from(["r", ".17e", ".3f", "g"]),
    end=st.sampled_from(["\n", "\r\n"]),
    trailing=st.booleans(),
    last_line=st.booleans(),
    header=st.sampled_from(
        ["lift [um];current [A]", "# lift (um);current (A)", "lift;current\num;A"]
    ),
)
def test_every_dialect_gives_back_its_numbers(
    tmp_path: Path, data, separator, decimal, style, end, trailing, last_line, header
):
    if separator.strip() == decimal:
        decimal = "."
    texts = [[repr(float(x)) if style == "r" else format(x, style) for x in row] for row in data]
    rows = [separator.join(t.replace(".", decimal) for t in row) for row in texts]
    closing = separator.strip() if trailing else ""
    text = end.join(
        [header.replace(";", separator).replace("\n", end), *(r + closing for r in rows)]
    )
    path = tmp_path / "dialect.csv"
    path.write_bytes((text + (end if last_line else "")).encode())

    with open_recording(path, time_step=1e-6) as recording:
        assert [(c.name, c.unit) for c in recording.channels] == [("lift", "um"), ("current", "A")]
        for k, name in enumerate(("lift", "current")):
            _, values = recording.read(name)
            # two units in the last place beyond 15 digits
            np.testing.assert_allclose(values, [float(t[k]) for t in texts], rtol=5e-16, atol=0)


def test_missing_values_end_a_channel_or_are_nan(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],lift [um],p [bar]\n0,1,5\n1e-6,,6\n2e-6,3\n3e-6,NaN\n4e-6,5,\n5e-6\n")
    with open_recording(path) as recording:
        assert [c.count for c in recording.channels] == [5, 2]
        np.testing.assert_array_equal(recording.read("lift")[1], [1, np.nan, 3, np.nan, 5])
        np.testing.assert_array_equal(recording.read("p")[1], [5, 6])


@pytest.mark.parametrize(
    ("header", "names"),
    [("lift [um]", ["lift"]), ("lift [um],current [A]", ["lift", "current"])],
)
def test_the_header_tells_a_decimal_comma_from_two_columns(tmp_path, header, names):
    path = tmp_path / "a.csv"
    path.write_text(header + "\n0,5\n0,75\n1,25\n")
    with open_recording(path, time_step=1e-6) as recording:
        assert [c.name for c in recording.channels] == names
        expected = [0.5, 0.75, 1.25] if len(names) == 1 else [0, 0, 1]
        np.testing.assert_array_equal(recording.read("lift")[1], expected)


def test_no_header_at_all(tmp_path):
    with open_recording(written(tmp_path / "a.csv", "")) as recording:
        assert [c.name for c in recording.channels] == ["column 2", "column 3"]
        assert any("column 1 increases evenly" in note for note in recording.notes)
        time, values = recording.read("column 2")
    np.testing.assert_allclose(time, TIME, rtol=1e-9)
    np.testing.assert_allclose(values, LIFT, rtol=1e-9)


def test_sentences_above_numbers_between_blanks_are_no_names(tmp_path):
    path = written(tmp_path / "a.txt", "# Created by Octave\n# columns: 3", separator=" ")
    with open_recording(path) as recording:
        assert [c.name for c in recording.channels] == ["column 2", "column 3"]


def test_every_lift_column_may_have_a_time_of_its_own(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t;lift_1 [um];t;lift_2 [um]\n0;1;5;3\n1e-4;2;5.0002;4\n2e-4;2;5.0004;4\n")
    with open_recording(path) as recording:
        first, second = recording.channels
    assert (first.start, first.step) == pytest.approx((0, 1e-4))
    assert (second.start, second.step) == pytest.approx((5, 2e-4))


FAULTS = {
    "no number": ("t [s],lift [um]\n0,1\n1,2\n2,3\n3,x4\n", r"a.csv:5, column 2: got 'x4'"),
    "too many": (
        "t [s],lift [um]\n0,1\n1,2\n2,3\n3,4,5\n",
        r"a.csv:5, column 3: got a surplus value '5', expected 2 values \(commas, decimal point",
    ),
    "only words": ("time,lift\na,b\n", "got no line of numbers"),
    "empty": ("", "got an empty file"),
    "no time": (
        "lift [um],current [A]\n1,2\n1,2\n2,3\n",
        "got no time among the columns 'lift .*time_step",
    ),
    "slow time without unit": (
        "t,lift [um]\n0,1\n1,2\n2,3\n",
        "a time without unit, with steps of 1",
    ),
    "a date": ("t [s],lift [um]\n0,1\n1,2\n2,3\n2024-01-01 12:00,4\n", "a.csv:5, column 1"),
}


@pytest.mark.parametrize(("text", "message"), FAULTS.values(), ids=FAULTS)
def test_faults_name_the_place(tmp_path, text, message):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"(?s)" + message):
        open_recording(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: got no such file"):
        open_recording(tmp_path / "none.csv")


@pytest.mark.parametrize("head", [b"PK\x03\x04", b"\x1f\x8b\x08", bytes(range(256)) * 4])
def test_files_that_are_no_text_are_refused(tmp_path, head):
    path = tmp_path / "a.csv"
    path.write_bytes(head)
    with pytest.raises(InputError, match="expected text"):
        open_recording(path)


def test_large_tables_are_parsed_again_in_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.measurement.files.csv_file._KEPT", 900)
    monkeypatch.setattr("klack.measurement.files.csv_file._BLOCK", 300)
    rows = np.column_stack([1e-6 * np.arange(5000), np.arange(5000) % 97])
    with open_recording(written(tmp_path / "a.csv", "t [s];lift [um]", rows)) as recording:
        for first, last in [(0, 10), (250, 260), (4000, 5000), (255, 1300), (0, 5000)]:
            np.testing.assert_array_equal(
                recording.read("lift", first, last)[1], rows[first:last, 1]
            )


@pytest.mark.parametrize("first", ["0.0,0.#0,0", "xx,0.0,0", "0.0x,0.0x,0x", "0,0,0,5,6"])
def test_a_damaged_first_row_is_told_and_names_nothing(tmp_path, first):
    rows = [f"{1e-5 * k:.5f},{0.5 * k:.2f},{k % 7}" for k in range(1, 50)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time [s],lift [um],current [A]", first, *rows]))

    with open_recording(path) as recording:
        assert [(c.name, c.unit, c.count) for c in recording.channels] == [
            ("lift", "um", 49),
            ("current", "A", 49),
        ]
        assert "1 row above the first complete rows, from line 2, left out" in recording.notes[0]


STEP, START, COUNT = 1e-5, -1e-3, 300
TIME_SCOPES = START + STEP * np.arange(COUNT)
FIRST, SECOND = np.round(np.sin(3e3 * TIME_SCOPES), 6), np.round(5 * np.cos(2e3 * TIME_SCOPES), 6)


def rows(*columns, separator=",", form="%.9e", end=""):
    return "".join(
        separator.join(form % x if not isinstance(x, str) else x for x in row) + end + "\n"
        for row in zip(*columns, strict=True)
    )


KEYSIGHT = "x-axis,1,2\nsecond,Volt,Ampere\n" + rows(TIME_SCOPES, FIRST, SECOND)
KEYSIGHT_INFINIIUM = (
    "Revision: 0\nType: raw\nStart: 0\nPoints: 300\nXInc: 1.0E-05\nXOrg: -1.0E-03\n"
    "XUnits: second\nYUnits: Volt\nFrame: DSOX\nData:\n" + rows(FIRST)
)
TEKTRONIX_LEFT = ["Record Length,3.0e+02", "Sample Interval,1.0e-05", "Trigger Point,1.0e+02"]
TEKTRONIX_LEFT += ["Source,CH1", "Vertical Units,V", "Horizontal Units,s", "Probe Atten,1.0e+00"]
TEKTRONIX = "".join(
    f"{TEKTRONIX_LEFT[k] if k < len(TEKTRONIX_LEFT) else ','},,{t:018.12f},{x:.6f},\n"
    for k, (t, x) in enumerate(zip(TIME_SCOPES, FIRST, strict=True))
)
TEKTRONIX_MSO = (
    "Model,MSO4104\nLabel,,\nWaveform Type,ANALOG\nHorizontal Units,s\nSample Interval,1.0E-05\n"
    "Record Length,300\nZero Index,100\nVertical Units,V,A\nVertical Offset,0,0\n\n"
    "TIME,CH1,CH2\n" + rows(TIME_SCOPES, FIRST, SECOND)
)
RIGOL_1000Z = (
    "X,CH1,CH2,Start,Increment,\nSequence,Volt,Ampere,-1.000000e-03,1.000000e-05\n"
    + rows([str(k) for k in range(COUNT)], FIRST, SECOND, end=",")
)  # fmt: skip
RIGOL_1000E = "X,CH1,CH2,\nSecond,Volt,Ampere,\n" + rows(TIME_SCOPES, FIRST, SECOND, end=",")
RIGOL_5000 = "CH1(V),CH2(A),t0 = -1.000000e-03, tInc = 1.000000e-05,\n" + rows(FIRST, SECOND)
SIGLENT = (
    "Record Length,Analog:300\nSample Interval,Analog:1e-05\nVertical Units,CH1:V,CH2:A\n"
    "Vertical Scale,CH1:1.00,CH2:0.50\nHorizontal Units,s\nModel Number,SDS1104X-E\n"
    "Source,CH1,CH2\nSecond,Volt,Ampere\n" + rows(TIME_SCOPES, FIRST, SECOND)
)
ROHDE_SCHWARZ = "in s,CH1 in V,CH2 in A\n" + rows(TIME_SCOPES, FIRST, SECOND)
SCOPY = (
    ";Scopy version,1.4\n;Exported on,Mon Mar 2 2026\n;Device,M2K\n;Nr of samples,300\n"
    ";Sample rate,100000\n;Tool,Oscilloscope\n;Additional Information,\n"
    "Sample,Time(S),CH1(V),CH2(A)\n"
    + rows([str(k) for k in range(COUNT)], TIME_SCOPES, FIRST, SECOND)
)  # fmt: skip
LECROY = (
    "LECROYWS3024,12345,Waveform\nSegments,1,SegmentSize,300\nSegment,TrigTime,TimeSinceSegment1\n"
    "#1,02-Mar-2026 08:00:00,0\nTime,Ampl\n" + rows(TIME_SCOPES, FIRST)
)
PICOSCOPE = "Time,Channel A,Channel B\n(ms),(V),(A)\n\n" + rows(1e3 * TIME_SCOPES, FIRST, SECOND)
YOKOGAWA = (
    '"Model","DL850"\n"BlockNumber",1\n"TraceName","CH1","CH2"\n"BlockSize",300\n'
    '"VUnit","V","A"\n"SampleRate",1.0E+05\n"HResolution",1.0E-05\n"HOffset",-1.0E-03\n'
    '"HUnit","s"\n"Date","2026/03/02"\n\n' + rows(FIRST, SECOND)
)
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\t{form}\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t300\t300\t\nDate\t2026/03/02\t2026/03/02\t\n"
    "Time\t08:00:00.25\t08:00:00.25\t\nY_Unit_Label\tVolts\tAmps\t\nX_Dimension\tTime\tTime\t\n"
    "X0\t-1.0E-3\t-1.0E-3\t\nDelta_X\t1.0E-5\t1.0E-5\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tCH1\tCH2\tComment\n"
)
LABVIEW_NONE = LABVIEW.format(form="No") + rows([""] * COUNT, FIRST, SECOND, separator="\t")
LABVIEW_ONE = LABVIEW.format(form="One") + rows(TIME_SCOPES, FIRST, SECOND, separator="\t")

SCOPES = {
    "Keysight": (KEYSIGHT, ("V", "A")),
    "Keysight Infiniium": (KEYSIGHT_INFINIIUM, ("V",)),
    "Tektronix": (TEKTRONIX, ("V",)),
    "Tektronix MSO": (TEKTRONIX_MSO, ("V", "A")),
    "Rigol 1000Z": (RIGOL_1000Z, ("V", "A")),
    "Rigol 1000E": (RIGOL_1000E, ("V", "A")),
    "Rigol 5000": (RIGOL_5000, ("V", "A")),
    "Siglent": (SIGLENT, ("V", "A")),
    "Rohde & Schwarz": (ROHDE_SCHWARZ, ("V", "A")),
    "Scopy": (SCOPY, ("", "V", "A")),
    "LeCroy": (LECROY, ("",)),
    "PicoScope": (PICOSCOPE, ("V", "A")),
    "Yokogawa": (YOKOGAWA, ("V", "A")),
    "LabVIEW without times": (LABVIEW_NONE, ("V", "A")),
    "LabVIEW with times": (LABVIEW_ONE, ("V", "A")),
}
SAID = {"Volt": "V", "Volts": "V", "Ampere": "A", "Amps": "A"}


@pytest.mark.parametrize(("text", "units"), SCOPES.values(), ids=SCOPES)
def test_tables_of_oscilloscopes(tmp_path, text, units):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with open_recording(path) as recording:
        channels = recording.channels
        assert [SAID.get(c.unit, c.unit) for c in channels] == list(units)
        for channel in channels:
            time, values = recording.read(channel.name)
            expected = {"V": FIRST, "A": SECOND, "": FIRST}[SAID.get(channel.unit, channel.unit)]
            if channel.name == "Sample":
                continue
            # times have ten digits in the file, as far as they are there
            np.testing.assert_allclose(time, TIME_SCOPES, rtol=0, atol=1e-12)
            np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("sign", ["9.91e37", "+9.9E+37", "-∞", "Infinity", "OL", "***", "nan"])
def test_signs_of_over_range_are_missing_values(tmp_path, sign):
    text = [f"{x:.6f}" for x in FIRST]
    text[7] = sign
    path = tmp_path / "a.csv"
    path.write_text("x-axis,1\nsecond,Volt\n" + rows(TIME_SCOPES, text), encoding="utf-8")
    with open_recording(path) as recording:
        values = recording.values("1")
    assert np.flatnonzero(np.isnan(values)).tolist() == [7]


def test_a_made_time_is_told(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(YOKOGAWA)
    with open_recording(path) as recording:
        assert any("time made from 'HResolution' of the header" in n for n in recording.notes)


def test_a_table_without_time_names_its_columns(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("gate [V],lift [um]\n1,2\n1,2\n2,3\n")
    with pytest.raises(InputError, match=r"got no time among the columns 'gate \[V\]', 'lift \[um"):
        open_recording(path)


def test_counted_rows_that_leave_some_out_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("X,CH1,Start,Increment\nSequence,Volt,0.0,1e-5\n0,1,\n2,3,\n3,4,\n4,4,\n")
    with pytest.raises(InputError, match="4 rows counted from 0 to 4"):
        open_recording(path)


def test_labview_channels_that_start_apart_keep_it(tmp_path):
    text = LABVIEW_NONE.replace("08:00:00.25\t08:00:00.25", "08:00:00.25\t08:00:00.2503")
    path = tmp_path / "a.lvm"
    path.write_text(text.replace("CH1", "lift").replace("Volts", "um"))
    with open_recording(path) as recording:
        (found,) = find_channels(recording)
        series = read_channels(recording, found)
    assert series["current"].start == pytest.approx(START + 3e-4, rel=1e-9)
    np.testing.assert_allclose(series["lift"].values, 1e-6 * FIRST[30:], atol=1e-18)
    np.testing.assert_allclose(series["current"].values, SECOND[:-30], atol=1e-12)


def notes_of(path, text):
    path.write_text(text)
    with open_recording(path) as recording:
        return "\n".join(recording.notes)


def test_rows_above_a_faulty_one_are_told(tmp_path):
    lines = YOKOGAWA.splitlines(keepends=True)
    lines[13] = "1.0,2..0\n"  # of the made time, two rows would be missing without a word
    assert "3 rows above the first complete rows, from line 12, left out" in notes_of(
        tmp_path / "a.csv", "".join(lines)
    )


@pytest.mark.parametrize(
    "text",
    [SIGLENT, TEKTRONIX_MSO, YOKOGAWA, KEYSIGHT_INFINIIUM, SCOPY, LABVIEW_NONE, LABVIEW_ONE],
)
def test_a_table_shorter_than_its_header_says_is_told(tmp_path, text):
    assert "the header states" not in notes_of(tmp_path / "a.csv", text)
    lines = text.splitlines(keepends=True)
    del lines[-7:]
    said = notes_of(tmp_path / "a.csv", "".join(lines))
    assert "the header states 300 rows, but the table has 293" in said


def test_names_of_traces_are_those_of_the_header(tmp_path):
    path = tmp_path / "a.csv"
    for text in (YOKOGAWA, YOKOGAWA.replace('"Model","DL850"\n', "")):
        path.write_text(text)
        with open_recording(path) as recording:
            assert [c.name for c in recording.channels] == ["CH1", "CH2"]


@pytest.mark.parametrize(
    ("header", "step"),
    [
        ("Sample Interval,10 us", 1e-5),
        ("Sample Interval: 1e-5", 1e-5),
        ("Sample Rate,100 kHz", 1e-5),
        ("Sample Rate,1e5 S/s", 1e-5),
        ("Horizontal Units,ms\nSample Interval,0.01", 1e-5),
        ("Horizontal Units,Hz\nSample Interval,0.01", None),  # a spectrum
        ("Sample Interval,10 furlong", None),
        ("Sample Rate,100 rpm", None),
        ("Sample Interval,short", None),
    ],
)
def test_steps_of_headers(tmp_path, header, step):
    path = tmp_path / "a.csv"
    path.write_text(f"{header}\nlift [um],i [A]\n" + rows(FIRST, SECOND))
    if step is None:
        with pytest.raises(InputError, match="no time among the columns 'lift"):
            open_recording(path)
        return
    with open_recording(path) as recording:
        assert recording.channels[0].step == pytest.approx(step, rel=1e-12)


def test_a_header_in_a_file_of_its_own(tmp_path):
    """R&S RTO: ``a.csv`` has the words, ``a.Wfm.csv`` the values."""
    head = "Resolution:1e-05:\nRecordLength:298:\nXStart:-0.00098:\nHardwareXStart:-0.001:\n"
    head += "SignalHardwareRecordLength:300:\nSignalResolution:1e-05:\nSource:Ch1:\n"
    table, words = tmp_path / "a.Wfm.csv", tmp_path / "a.csv"
    words.write_text(head)
    table.write_text(rows(FIRST))
    with open_recording(table) as recording:
        (channel,) = recording.channels
        assert (channel.name, channel.start, channel.step) == ("Ch1", -1e-3, 1e-5)
        np.testing.assert_allclose(recording.values("Ch1"), FIRST, atol=1e-15)
    table.write_text(rows(FIRST[2:]))
    with open_recording(table) as recording:
        assert recording.channels[0].start == -0.98e-3
    with pytest.raises(InputError, match=r"give a\.Wfm\.csv, whose header this is"):
        open_recording(words)
    table.write_text(2 * rows(FIRST))
    with pytest.raises(InputError, match=r"got 600 rows, but the header states 300"):
        open_recording(table)


@pytest.mark.parametrize("sign", ["inf", "OL", "OVR", "9.9E+37", "nan"])
def test_a_recording_of_over_range_alone_says_so(tmp_path, sign):
    (tmp_path / "a.csv").write_text(
        "time [s],lift [um]\n" + "".join(f"{t},{sign}\n" for t in TIME_SCOPES)
    )
    with pytest.raises(InputError, match="missing or marked as over range"):
        open_recording(tmp_path / "a.csv")
