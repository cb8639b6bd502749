"""Tables as oscilloscopes and loggers write them, by files and by the manuals of their makers.

Truth: the voltages and times that were written.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels
from klack.measurement.recording import open_recording

STEP, START, COUNT = 1e-5, -1e-3, 300
TIME = START + STEP * np.arange(COUNT)
FIRST, SECOND = np.round(np.sin(3e3 * TIME), 6), np.round(5 * np.cos(2e3 * TIME), 6)


def rows(*columns, separator=",", form="%.9e", end=""):
    return "".join(
        separator.join(form % x if not isinstance(x, str) else x for x in row) + end + "\n"
        for row in zip(*columns, strict=True)
    )


KEYSIGHT = "x-axis,1,2\nsecond,Volt,Ampere\n" + rows(TIME, FIRST, SECOND)
KEYSIGHT_INFINIIUM = (
    "Revision: 0\nType: raw\nStart: 0\nPoints: 300\nXInc: 1.0E-05\nXOrg: -1.0E-03\n"
    "XUnits: second\nYUnits: Volt\nFrame: DSOX\nData:\n" + rows(FIRST)
)
TEKTRONIX_LEFT = ["Record Length,3.0e+02", "Sample Interval,1.0e-05", "Trigger Point,1.0e+02"]
TEKTRONIX_LEFT += ["Source,CH1", "Vertical Units,V", "Horizontal Units,s", "Probe Atten,1.0e+00"]
TEKTRONIX = "".join(
    f"{TEKTRONIX_LEFT[k] if k < len(TEKTRONIX_LEFT) else ','},,{t:018.12f},{x:.6f},\n"
    for k, (t, x) in enumerate(zip(TIME, FIRST, strict=True))
)
TEKTRONIX_MSO = (
    "Model,MSO4104\nLabel,,\nWaveform Type,ANALOG\nHorizontal Units,s\nSample Interval,1.0E-05\n"
    "Record Length,300\nZero Index,100\nVertical Units,V,A\nVertical Offset,0,0\n\n"
    "TIME,CH1,CH2\n" + rows(TIME, FIRST, SECOND)
)
RIGOL_1000Z = (
    "X,CH1,CH2,Start,Increment,\nSequence,Volt,Ampere,-1.000000e-03,1.000000e-05\n"
    + rows([str(k) for k in range(COUNT)], FIRST, SECOND, end=",")
)  # fmt: skip
RIGOL_1000E = "X,CH1,CH2,\nSecond,Volt,Ampere,\n" + rows(TIME, FIRST, SECOND, end=",")
RIGOL_5000 = "CH1(V),CH2(A),t0 = -1.000000e-03, tInc = 1.000000e-05,\n" + rows(FIRST, SECOND)
SIGLENT = (
    "Record Length,Analog:300\nSample Interval,Analog:1e-05\nVertical Units,CH1:V,CH2:A\n"
    "Vertical Scale,CH1:1.00,CH2:0.50\nHorizontal Units,s\nModel Number,SDS1104X-E\n"
    "Source,CH1,CH2\nSecond,Volt,Ampere\n" + rows(TIME, FIRST, SECOND)
)
ROHDE_SCHWARZ = "in s,CH1 in V,CH2 in A\n" + rows(TIME, FIRST, SECOND)
SCOPY = (
    ";Scopy version,1.4\n;Exported on,Mon Mar 2 2026\n;Device,M2K\n;Nr of samples,300\n"
    ";Sample rate,100000\n;Tool,Oscilloscope\n;Additional Information,\n"
    "Sample,Time(S),CH1(V),CH2(A)\n"
    + rows([str(k) for k in range(COUNT)], TIME, FIRST, SECOND)
)  # fmt: skip
LECROY = (
    "LECROYWS3024,12345,Waveform\nSegments,1,SegmentSize,300\nSegment,TrigTime,TimeSinceSegment1\n"
    "#1,02-Mar-2026 08:00:00,0\nTime,Ampl\n" + rows(TIME, FIRST)
)
PICOSCOPE = "Time,Channel A,Channel B\n(ms),(V),(A)\n\n" + rows(1e3 * TIME, FIRST, SECOND)
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
LABVIEW_ONE = LABVIEW.format(form="One") + rows(TIME, FIRST, SECOND, separator="\t")

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
            np.testing.assert_allclose(time, TIME, rtol=0, atol=1e-12)
            np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("sign", ["9.91e37", "+9.9E+37", "-∞", "Infinity", "OL", "***", "nan"])
def test_signs_of_over_range_are_missing_values(tmp_path, sign):
    text = [f"{x:.6f}" for x in FIRST]
    text[7] = sign
    path = tmp_path / "a.csv"
    path.write_text("x-axis,1\nsecond,Volt\n" + rows(TIME, text), encoding="utf-8")
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
    assert "3 rows above the first whole ones, from line 12 on, left out" in notes_of(
        tmp_path / "a.csv", "".join(lines)
    )


@pytest.mark.parametrize(
    "text",
    [SIGLENT, TEKTRONIX_MSO, YOKOGAWA, KEYSIGHT_INFINIIUM, SCOPY, LABVIEW_NONE, LABVIEW_ONE],
)
def test_a_table_shorter_than_its_header_says_is_told(tmp_path, text):
    assert "the header speaks of" not in notes_of(tmp_path / "a.csv", text)
    lines = text.splitlines(keepends=True)
    del lines[-7:]
    said = notes_of(tmp_path / "a.csv", "".join(lines))
    assert "the header speaks of 300 rows, the table has 293" in said


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
    with pytest.raises(InputError, match=r"got 600 rows, where the header says 300"):
        open_recording(table)


@pytest.mark.parametrize("sign", ["inf", "OL", "OVR", "9.9E+37", "nan"])
def test_a_recording_of_over_range_alone_says_so(tmp_path, sign):
    (tmp_path / "a.csv").write_text("time [s],lift [um]\n" + "".join(f"{t},{sign}\n" for t in TIME))
    with pytest.raises(InputError, match="missing or signs of over range"):
        open_recording(tmp_path / "a.csv")
