"""Sets of strokes and odd layouts in files of other programs.

Truth: the arrays that were given to the writers of the formats' own libraries.
"""

import re
import sys

import numpy as np
import pytest

from klack.errors import InputError, MissingExtraError
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels

asammdf = pytest.importorskip("asammdf")
h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
scipy_io = pytest.importorskip("scipy.io")

TIME = 1e-5 * np.arange(400)  # [s]
STROKES = [np.minimum(80.0, (70.0 + k) * 1e3 * TIME) for k in range(3)]  # [um]
CURRENT = 3.0 * (1.0 - np.exp(-TIME / 1e-3))  # [A]


def strokes_of(path, **options):
    with open_recording(path, **options) as recording:
        return [read_channels(recording, found) for found in find_channels(recording)]


def check(strokes, shared=False):
    assert len(strokes) == 3
    for stroke, lift in zip(strokes, STROKES, strict=True):
        np.testing.assert_allclose(stroke["lift"].values, 1e-6 * lift, rtol=1e-12)
        assert stroke["lift"].step == pytest.approx(1e-5, rel=1e-9)
        if shared:
            np.testing.assert_allclose(stroke["current"].values, CURRENT, rtol=1e-12)


def test_mdf_with_one_group_per_stroke(tmp_path):
    file = asammdf.MDF(version="4.10")
    for k, lift in enumerate(STROKES):
        file.append(
            [
                asammdf.Signal(lift, TIME + k, unit="um", name="lift"),
                asammdf.Signal(CURRENT, TIME + k, unit="A", name="current"),
            ]
        )
    file.save(tmp_path / "a.mf4")
    file.close()
    strokes = strokes_of(tmp_path / "a.mf4")
    check(strokes, shared=True)
    assert [stroke["lift"].start for stroke in strokes] == pytest.approx([0, 1, 2])


def test_mdf_numbers_are_converted_and_formulas_left_out(tmp_path):
    counts = np.arange(100, dtype=np.int16)
    file = asammdf.MDF(version="4.10")
    linear, formula = {"a": 0.5, "b": -3.0}, {"formula": "X1*2"}
    file.append(
        [
            asammdf.Signal(counts, TIME[:100], unit="um", name="lift", conversion=linear),
            asammdf.Signal(counts, TIME[:100], unit="A", name="current", conversion=formula),
        ]
    )
    file.save(tmp_path / "a.mf4")
    file.close()
    with open_recording(tmp_path / "a.mf4") as recording:
        assert [channel.name for channel in recording.channels] == ["lift"]
        assert any("'current' left out" in note for note in recording.notes)
        np.testing.assert_allclose(recording.read("lift")[1], 0.5 * counts - 3.0)


PARTIAL = {
    "a value": {"val_0": 65535, "text_0": b"sensor fault"},
    "a range": {"lower_0": 65000, "upper_0": 65535, "text_0": b"sensor fault"},
}


@pytest.mark.parametrize("texts", PARTIAL.values(), ids=PARTIAL)
@pytest.mark.parametrize("alone", [False, True])
def test_mdf_samples_that_are_texts_among_numbers_are_missing(tmp_path, texts, alone):
    counts = np.arange(100, dtype=np.uint16)
    counts[7] = 65535
    rules = {**texts, "default_addr": {"a": 0.5, "b": -3.0}}
    signals = [asammdf.Signal(counts, TIME[:100], unit="um", name="lift", conversion=rules)]
    words = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on"}
    if not alone:
        signals += [
            asammdf.Signal(counts, TIME[:100], name="state", conversion=words),
            asammdf.Signal(np.array([b"x"] * 100), TIME[:100], name="remark", encoding="utf-8"),
        ]
    file = asammdf.MDF(version="4.10")
    file.append(signals)
    file.save(tmp_path / "a.mf4")
    file.close()
    with open_recording(tmp_path / "a.mf4") as recording:
        assert [channel.name for channel in recording.channels] == ["lift"]
        expected = 0.5 * counts - 3.0
        expected[7] = np.nan
        np.testing.assert_array_equal(recording.values("lift"), expected)
        notes = "\n".join(recording.notes)
    assert "a.mf4: lift: text samples are treated as missing." in notes
    assert alone or "'state' left out: its values are codes of texts" in notes
    assert alone or "'remark' left out: no numbers" in notes


def test_a_file_with_nothing_but_texts_says_what_it_left_out(tmp_path):
    words = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on"}
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(np.arange(9) % 2, TIME[:9], name="state", conversion=words)])
    file.save(tmp_path / "a.mf4")
    file.close()
    with pytest.raises(InputError, match=r"no channel of numbers.*'state' left out: its values"):
        open_recording(tmp_path / "a.mf4")


def test_mdf_values_marked_invalid_are_missing(tmp_path):
    invalid = np.zeros(400, dtype=bool)
    invalid[[5, 77]] = True
    signal = asammdf.Signal(STROKES[0], TIME, unit="um", name="lift", invalidation_bits=invalid)
    file = asammdf.MDF(version="4.10")
    file.append([signal])
    file.save(tmp_path / "a.mf4")
    file.close()
    with open_recording(tmp_path / "a.mf4") as recording:
        _, values = recording.read("lift", 70, 80)
        np.testing.assert_array_equal(np.isnan(values), invalid[70:80])


def test_tdms_with_one_group_per_stroke(tmp_path):
    about = {"unit_string": "um", "wf_increment": 1e-5}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        for k, lift in enumerate(STROKES):
            writer.write_segment([nptdms.ChannelObject(f"stroke {k + 1}", "lift", lift, about)])
    with open_recording(tmp_path / "a.tdms") as recording:
        assert recording.channels[0].name == "stroke 1/lift"
    check(strokes_of(tmp_path / "a.tdms"))


@pytest.mark.parametrize("turned", [False, True])
def test_hdf5_matrix_of_strokes(tmp_path, turned):
    matrix = np.array(STROKES)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["lift"] = TIME, matrix.T if turned else matrix
        file["current"] = CURRENT
        file["lift"].attrs["unit"], file["time"].attrs["unit"] = "um", "s"
        file["current"].attrs["unit"] = "A"
    check(strokes_of(tmp_path / "a.h5"), shared=True)


def test_matlab_matrix_and_structure_array_of_strokes(tmp_path):
    scipy_io.savemat(
        tmp_path / "a.mat",
        {"lift_um": np.array(STROKES).T, "current": CURRENT, "current_unit": "A", "fs": 1e5},
    )
    check(strokes_of(tmp_path / "a.mat"), shared=True)

    kind = [("t", object), ("lift_um", object)]
    array = np.array([(TIME, lift) for lift in STROKES], dtype=kind)
    scipy_io.savemat(tmp_path / "b.mat", {"strokes": array})
    check(strokes_of(tmp_path / "b.mat"))


def test_hdf5_does_not_reach_into_other_files(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = STROKES[0]
    STROKES[0].tofile(tmp_path / "other.bin")
    layout = h5py.VirtualLayout(shape=(400,), dtype="f8")
    layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "secret", shape=(400,))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["dt"] = 1e-5
        file["lift_um"] = STROKES[1]
        file["linked_um"] = h5py.ExternalLink("other.h5", "secret")
        file["gone_um"] = h5py.SoftLink("/nowhere")
        file.create_virtual_dataset("virtual_um", layout)
        file.create_dataset(
            "raw_um", (400,), "f8", external=[(str(tmp_path / "other.bin"), 0, 3200)]
        )
    with open_recording(tmp_path / "a.h5") as recording:
        assert [channel.name for channel in recording.channels] == ["lift_um"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"lift_um": STROKES[0]}, "a.mat: 'lift_um': got no time"),
        ({"lift_um": STROKES[0], "fs": 0.0}, "fs: got 0, expected a value above 0"),
        ({"note": "nothing measured"}, "got no channel of numbers over time"),
        ({"t": 1e3 * TIME, "lift_um": STROKES[0]}, "'t': got a time without unit, with steps of"),
    ],
)
def test_unclear_layouts_are_refused(tmp_path, content, message):
    scipy_io.savemat(tmp_path / "a.mat", content)
    with pytest.raises(InputError, match=message):
        open_recording(tmp_path / "a.mat")


def test_the_step_of_the_case_replaces_a_missing_time(tmp_path):
    scipy_io.savemat(tmp_path / "a.mat", {"lift_um": STROKES[0]})
    (stroke,) = strokes_of(tmp_path / "a.mat", time_step=2e-6)
    assert stroke["lift"].step == 2e-6


@pytest.mark.parametrize(
    ("name", "head", "package"),
    [
        ("a.mf4", b"MDF     4.10    ", "asammdf"),
        ("a.tdms", b"TDSm", "nptdms"),
        ("a.uff", b"    -1\n    58\n", "pyuff"),
        ("a.h5", b"\x89HDF\r\n\x1a\n", "h5py"),
    ],
)
def test_a_missing_package_is_named_with_the_way_to_install_it(
    tmp_path, monkeypatch, name, head, package
):
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / name).write_bytes(head)
    with pytest.raises(MissingExtraError, match=r"pip install 'FILE.whl\[measurement\]'"):
        open_recording(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.mf4", b"MDF     4.10    TGT 15.0" + bytes(200)),
        ("a.mdf", b"MDF     3.30    TGT 15.0" + bytes(200)),
        ("a.tdms", b"TDSm" + bytes(range(200))),
        ("a.uff", b"    -1\n    58\nnothing\n    -1\n"),
        ("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(100)),
        ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(range(200))),
        ("a.mat", b"no matlab"),
    ],
)
def test_damaged_files_end_in_a_clear_error(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        open_recording(tmp_path / name)


def test_mdf_channels_outside_their_record_are_refused(tmp_path):
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(STROKES[0], TIME, unit="um", name="lift")])
    file.save(tmp_path / "a.mf4")
    file.close()
    content = bytearray((tmp_path / "a.mf4").read_bytes())
    # place of the values in their record: 4 bytes, 92 bytes behind the start of the channel block
    places = [m.start() + 92 for m in re.finditer(b"##CN", content)]
    (place,) = (p for p in places if content[p : p + 4] == b"\x08\0\0\0")
    content[place + 3] = 0x48
    (tmp_path / "a.mf4").write_bytes(content)
    with pytest.raises(InputError, match="'lift': got a position outside its record"):
        open_recording(tmp_path / "a.mf4")


def test_hdf5_arrays_larger_than_the_file_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["dt"] = 1e-5
        file.create_dataset("lift_um", (10**12,), "f8", chunks=(1000,))
    with pytest.raises(InputError, match="'lift_um': got 1000000000000 values in 0 bytes"):
        open_recording(tmp_path / "a.h5")
