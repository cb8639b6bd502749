"""Text tables in all their dialects give the numbers that were written (truth: the numbers)."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from klack.errors import InputError
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels
from klack.measurement.recording import open_recording

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
        assert any("column 1 rises evenly" in note for note in recording.notes)
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
        r"a.csv:5, column 3: got a value '5' too many, expected 2 values \(commas, decimal point",
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
        assert "1 row above the first whole ones, from line 2 on, left out" in recording.notes[0]
