"""Rare parts and packed numbers of measured files.

What readers of measured files meet rarely: odd parts are left out or refused, the rest is read.

Truth: the arrays that were written.

Packed numbers, with the scale that the file states, are the plain ones; unknown scales are told.

Truth: the plain numbers.
"""

import warnings

import numpy as np
import pytest

from klack.errors import AccuracyWarning, InputError
from klack.measurement.channels import ChannelChoice
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.loading import load_stroke_set
from klack.measurement.read_channels import read_channels

asammdf = pytest.importorskip("asammdf")
h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
pyuff = pytest.importorskip("pyuff")
scipy_io = pytest.importorskip("scipy.io")

TIME = 1e-5 * np.arange(50)  # [s]
LIFT = 80.0 * np.sin(3e3 * TIME)


def uff(path, **other):
    about = {
        **dict(binary=1, func_type=1, rsp_node=7, rsp_dir=3, ref_node=1, ref_dir=3),
        **dict(data=LIFT, x=TIME, id1="lift", ord_data_type=4, abscissa_spacing=1),
        **dict(abscissa_min=0.0, abscissa_inc=1e-5, abscissa_spec_data_type=17),
        **dict(abscissa_axis_units_lab="s", ordinate_spec_data_type=8),
        **dict(ordinate_axis_units_lab="NONE", orddenom_spec_data_type=0),
        **dict(z_axis_spec_data_type=0),
    }
    pyuff.UFF(str(path)).write_sets(pyuff.prepare_58(**(about | other)), "add")
    return path


def opened(path, **options):
    with open_recording(path, **options) as recording:
        read = {c.name: (c.unit, *recording.read(c.name)) for c in recording.channels}
        return read, "\n".join(recording.notes)


def test_universal_files(tmp_path):
    path = uff(tmp_path / "a.uff", abscissa_axis_units_lab="NONE", id1="NONE", rsp_ent_name="NONE")
    uff(path, func_type=4, abscissa_spec_data_type=18)  # a transfer function
    read, notes = opened(path)
    assert list(read) == ["node 7 direction 3"]
    assert read["node 7 direction 3"][0] == "m"
    np.testing.assert_array_equal(read["node 7 direction 3"][2], LIFT)
    assert "set 2 (lift)' left out: not over time" in notes

    millimetres = pyuff.prepare_164(
        units_code=5, units_description="mm", temp_mode=1, length=1e3, force=1e3, temp=1.0,
        temp_offset=0.0,
    )  # fmt: skip
    path = tmp_path / "b.uff"
    pyuff.UFF(str(path)).write_sets(millimetres, "add")
    assert opened(uff(path))[0]["lift"][0] == ""  # 8 is a displacement, but not in SI


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"x": TIME[::-1]}, "50 values with steps of -1e-05 s"),
        ({"data": LIFT * 1j, "ord_data_type": 6}, "50 values of type complex"),
        # the format has six digits of uneven times
        ({"x": 100.0 + 0.01 * TIME, "binary": 0, "abscissa_spacing": 0}, "with steps of 0 s"),
    ],
)
def test_universal_sets_that_cannot_be(tmp_path, other, message):
    with pytest.raises(InputError, match=message):
        opened(uff(tmp_path / "a.uff", **other))


def test_a_universal_file_of_an_end_mark_alone(tmp_path):
    """What pyuff leaves where a binary set is to overwrite a file."""
    path = tmp_path / "a.uff"
    path.write_text("    -1\n")
    with pytest.raises(InputError, match="no channel of numbers over time"):
        opened(path)


def test_a_universal_file_that_is_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr("klack.measurement.files.uff_file._LARGEST", 100)
    with pytest.raises(InputError, match="a universal file of"):
        opened(uff(tmp_path / "a.uff"))


def test_mdf_over_an_angle_needs_the_step_of_the_case(tmp_path):
    signal = asammdf.Signal(LIFT, TIME, unit="um", name="lift", master_metadata=("angle", 2))
    records = np.rec.fromarrays([LIFT, LIFT], names=["a", "b"])
    file = asammdf.MDF(version="4.10")
    file.append([signal])
    file.append([asammdf.Signal(LIFT[:1], TIME[:1], unit="um", name="single")])
    file.append([asammdf.Signal(records, TIME, name="pair")])
    file.save(tmp_path / "a.mf4")
    file.close()
    with pytest.raises(InputError, match="group 1: got no time"):
        opened(tmp_path / "a.mf4")
    read, notes = opened(tmp_path / "a.mf4", time_step=1e-5)
    np.testing.assert_allclose(read["lift"][1], TIME, rtol=1e-14)
    assert "'single' left out: fewer than two samples" in notes
    assert "'pair' left out: " in notes


def test_tdms_without_a_time(tmp_path):
    def write(*channels):
        with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
            writer.write_segment([nptdms.ChannelObject("bench", *one) for one in channels])

    lift = ("lift", LIFT, {"unit_string": "um"})
    write(lift, ("words", ["a", "b"]))
    with pytest.raises(InputError, match="channel 'lift': got no time"):
        opened(tmp_path / "a.tdms")
    read, notes = opened(tmp_path / "a.tdms", time_step=1e-5)
    np.testing.assert_allclose(read["lift"][1], TIME, rtol=1e-14)
    assert "'bench/words' left out: no numbers" in notes
    write(("time", TIME), lift)
    read, notes = opened(tmp_path / "a.tdms")
    np.testing.assert_array_equal(read["lift"][1], TIME)
    assert "the time has no unit and is taken as seconds" in notes


def test_hdf5_leaves_out_what_is_no_channel_and_says_so(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["lift_um"] = LIFT
        file["cube"] = np.zeros((3, 4, 5))
        file["complex"] = LIFT * 1j
        file["words"] = np.array([b"a", b"b"])
        file["note"] = "bench 3"
        file["dt"] = 1e-5
        file.attrs["odd"] = np.zeros((), dtype=[("a", "f8")])
        file.attrs["none"] = h5py.Empty("f8")
        file.create_dataset("nothing", (0,), "f8")
    read, notes = opened(tmp_path / "a.h5")
    assert list(read) == ["lift_um"]
    for name in ("cube", "complex", "words"):
        assert f"'{name}'" in notes


def test_matlab_leaves_out_what_is_no_channel_and_says_so(tmp_path):
    content = {"lift_um": LIFT, "fs": 1e5, "complex": LIFT * 1j, "empty": []}
    scipy_io.savemat(tmp_path / "a.mat", content)
    read, notes = opened(tmp_path / "a.mat")
    assert list(read) == ["lift_um"]
    np.testing.assert_array_equal(read["lift_um"][2], LIFT)
    assert "'complex'" in notes


def test_tables(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,lift [um]\n0,1\n1,2\n2,3\n")
    read, notes = opened(path, time_step=1e-5)
    np.testing.assert_allclose(read["lift"][1], 1e-5 * np.arange(3))
    assert "time without unit replaced by time_step" in notes
    for rows in ("1\n2\n3\n", "0,1\n5,2\n3,3\n"):  # one column, and a first one that is no time
        path.write_text(rows)
        with pytest.raises(InputError, match="got no time"):
            opened(path)
    path.write_bytes("t [s];lift [-]\n0;1\n1e-5;2\n2e-5;3\n".encode("utf-16-be"))
    assert opened(path)[0]["lift"][0] == ""


def test_one_sample_far_outside_all_others_is_told(tmp_path):
    lift = LIFT.copy()
    lift[20] = 4e6
    path = hdf5_of(tmp_path / "a.h5", lift)
    with pytest.warns(AccuracyWarning, match="1 values of 'lift_um' are far outside.* at 0.0002 s"):
        load_stroke_set([path])
    # a pulse of several samples and the last digit of a converter are signals
    pulse = np.where(np.arange(50) // 3 == 7, 4e6, LIFT)
    digit = np.where(np.arange(50) % 9 == 7, 1.0, 0.0)
    for values in (pulse, digit):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            load_stroke_set([hdf5_of(path, values)])


def test_values_beyond_any_instrument_are_missing(tmp_path):
    lift = LIFT.copy()
    lift[[20, 21]] = 1e308, np.inf
    with pytest.warns(
        AccuracyWarning, match=r"2 missing values of 'lift_um' were filled.* at 0.0002 s"
    ):
        found = load_stroke_set([hdf5_of(tmp_path / "a.h5", lift)])
    assert np.isfinite(found.matrix("lift")).all()


def hdf5_of(path, lift):
    with h5py.File(path, "w") as file:
        file["lift_um"], file["dt"] = lift, 1e-5
    return path


def test_a_tdms_file_that_ends_early_is_told(tmp_path, capfd):
    about = {"unit_string": "um", "wf_increment": 1e-5}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("bench", "lift", LIFT, about)])
    (tmp_path / "a.tdms").write_bytes((tmp_path / "a.tdms").read_bytes()[:-80])
    read, notes = opened(tmp_path / "a.tdms")
    np.testing.assert_array_equal(read["lift"][2], LIFT[:40])
    assert "less data than expected" in notes
    assert capfd.readouterr().err == ""


def test_an_uneven_universal_set_without_its_end_is_refused(tmp_path):
    path = uff(tmp_path / "a.uff", abscissa_spacing=0)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) - 60] + content[-7:])
    with pytest.raises(InputError, match=r"a\.uff: .*(times|values|cannot be read)"):
        opened(path)


def test_hdf5_attributes_of_odd_types_are_passed_over(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["lift"], file["dt"] = LIFT, 1e-5
        file["#refs#/a"] = LIFT
        attrs = file["lift"].attrs
        attrs["unit"] = np.array(["um"], dtype=object)
        attrs["vector"] = np.arange(3.0)
        attrs["empty"] = h5py.Empty("f8")
        attrs["pair"] = np.zeros(2, dtype=[("a", "f8")])
        attrs["reference"] = file["lift"].ref
    read, _ = opened(tmp_path / "a.h5")
    assert list(read) == ["lift"]
    assert read["lift"][0] == "um"


def test_a_matrix_of_too_many_columns_is_left_out(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_s"], file["lift_um"] = TIME, LIFT
        file["map"] = np.zeros((50, 100_001), dtype=np.int8)
    read, notes = opened(tmp_path / "a.h5")
    assert list(read) == ["lift_um"]
    assert "'map' left out: 100001 columns of 50 values" in notes


def test_mdf_files_that_are_cut_within_their_records(tmp_path):
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(LIFT, TIME, unit="um", name="lift")])
    file.save(tmp_path / "a.mf4")
    file.close()
    with open_recording(tmp_path / "a.mf4") as recording:
        group = recording._mdf.groups[0]
        group.channel_group.cycles_nr += 20  # as if the header said more than there is
        with pytest.raises(InputError, match="got 50 values from sample 1, expected 70"):
            recording._values(recording.channel("lift"), 0, 70)
        with pytest.raises(InputError, match="less than the 70 records declared"):
            recording._group_time(tmp_path / "a.mf4", 0, None, False)


def test_mdf_3_has_its_units_as_bytes_of_the_conversion(tmp_path):
    file = asammdf.MDF(version="3.30")
    file.append([asammdf.Signal(LIFT, TIME, unit="µm", name="lift", conversion={"a": 2, "b": 0})])
    file.save(tmp_path / "a.mdf")
    file.close()
    read, _ = opened(tmp_path / "a.mdf")
    assert read["lift"][0] == "um"
    np.testing.assert_array_equal(read["lift"][2], 2.0 * LIFT)


def test_columns_that_end_before_a_segment_have_no_part_in_it(tmp_path):
    one = 1e-5 * np.arange(30)
    lines = [f"{t:.6f},{k},{k if k < 30 else ''}" for k, t in enumerate(np.tile(one, 2))]
    (tmp_path / "a.csv").write_text("\n".join(["t [s],lift [um],i [A]", *lines]))
    read, _ = opened(tmp_path / "a.csv")
    assert list(read) == ["lift #1", "lift #2", "i #1"]


def test_times_that_look_like_stamps_but_are_none_stay_text(tmp_path):
    lines = [f"2026-13-02 08:00:{k:02d}.5,{k}" for k in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["time,lift [um]", *lines]))
    with pytest.raises(InputError, match="no line of numbers"):
        opened(tmp_path / "a.csv")


TIME_SCALES = 1e-5 * np.arange(400)  # [s]
COUNTS = np.arange(400, dtype=np.int16)
FACTOR, OFFSET = 0.25, -8.0  # powers of two: products are exact
LIFT_SCALES = FACTOR * COUNTS + OFFSET  # [um]


def read(path, channels=None):
    with open_recording(path) as recording:
        (found,) = find_channels(recording, channels)
        return read_channels(recording, found)["lift"]


def check(path, channels=None):
    lift = read(path, channels)
    np.testing.assert_allclose(lift.values, 1e-6 * LIFT_SCALES, rtol=1e-14)
    assert lift.step == pytest.approx(1e-5, rel=1e-6)


def hdf5(path, about, values=COUNTS, **root):
    with h5py.File(path, "w") as file:
        file["time_s"], file["lift"] = TIME_SCALES, values
        file["lift"].attrs.update({"units": "um", **about})
        file.attrs.update(root)
    return path


def netcdf3(path, about, values=COUNTS):
    with scipy_io.netcdf_file(path, "w") as file:
        file.createDimension("sample", len(values))
        time, lift = (file.createVariable(n, t, ("sample",)) for n, t in NETCDF)
        time[:], lift[:] = TIME_SCALES, values
        time.units, lift.units = "s", "um"
        for key, value in about.items():
            setattr(lift, key, value)
    return path


NETCDF = (("time", "d"), ("lift", "h"))


def matlab(path, about):
    lift = {"values": COUNTS[:, None], "unit": "um", "time": TIME_SCALES[:, None], **about}
    scipy_io.savemat(path, {"lift": lift})
    return path


def tdms(path, about, values=COUNTS):
    about = {"unit_string": "um", "wf_increment": 1e-5, **about}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("bench", "lift", values, about)])
    return path


def mdf(path, conversion, version="4.10"):
    file = asammdf.MDF(version=version)
    file.append(
        [asammdf.Signal(COUNTS, TIME_SCALES, unit="um", name="lift", conversion=conversion)]
    )
    file.save(path, overwrite=True)
    file.close()
    return path


def uff_scales(path, unit, values, kind=0):
    pyuff.UFF(str(path)).write_sets(
        pyuff.prepare_58(
            binary=1, func_type=1, rsp_node=1, rsp_dir=3, ref_node=1, ref_dir=3, data=values,
            x=TIME_SCALES, id1="lift", ord_data_type=4, abscissa_spacing=1, abscissa_min=0.0,
            abscissa_inc=1e-5, abscissa_spec_data_type=17, abscissa_axis_units_lab="s",
            ordinate_spec_data_type=kind, ordinate_axis_units_lab=unit, orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
        ),
        "add",
    )  # fmt: skip
    return path


PACKED = {"scale_factor": FACTOR, "add_offset": OFFSET}


@pytest.mark.parametrize("write", [hdf5, netcdf3])
def test_netcdf_is_unpacked_and_its_fill_values_are_missing(tmp_path, write):
    check(write(tmp_path / "a.nc", PACKED))
    check(matlab(tmp_path / "a.mat", PACKED))
    stored = COUNTS.copy()
    stored[[5, 7, 9]] = -999, -998, 2000
    about = {**PACKED, "_FillValue": np.int16(-999), "missing_value": np.int16(-998)}
    about["valid_range"] = np.array([0, 1000], np.int16)
    with open_recording(write(tmp_path / "a.nc", about, stored)) as recording:
        values = recording.values("lift")
    assert np.flatnonzero(np.isnan(values)).tolist() == [5, 7, 9]
    with pytest.warns(UserWarning, match="3 missing values of 'lift' were filled"):
        check(tmp_path / "a.nc")


def test_a_netcdf_3_file_that_ends_early_is_one_error(tmp_path):
    path = netcdf3(tmp_path / "a.nc", PACKED)
    data = path.read_bytes()
    for end in (len(data) - 1, len(data) // 2, 100, 10, 4):
        path.write_bytes(data[:end])
        with pytest.raises(InputError, match=r"a netCDF 3 file that cannot be read"):
            read(path)


def test_netcdf_times_are_unpacked(tmp_path):
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["time"], file["lift"] = COUNTS, LIFT_SCALES
        file["lift"].attrs["units"] = "um"
        file["time"].attrs.update({"units": "s", "scale_factor": 1e-5})
    check(tmp_path / "a.nc")


SCALES = {
    "Linear": {"Slope": FACTOR, "Y_Intercept": OFFSET},
    "Polynomial": {"Coefficients_Size": 2, "Coefficients[0]": OFFSET, "Coefficients[1]": FACTOR},
}


@pytest.mark.parametrize("kind", SCALES)
def test_scales_of_tdms(tmp_path, kind):
    prefix = "NI_Scale[0]"
    about = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled"}
    about |= {f"{prefix}_Scale_Type": kind}
    about |= {f"{prefix}_{kind}_{key}": value for key, value in SCALES[kind].items()}
    check(tdms(tmp_path / "a.tdms", about))
    about[f"{prefix}_Scale_Type"] = "Spline"
    with pytest.raises(InputError, match=r"does not know: NI_Scale\[0\]_Scale_Type = Spline"):
        read(tdms(tmp_path / "a.tdms", about))
    check(tdms(tmp_path / "a.tdms", about | {"NI_Scaling_Status": "scaled"}, LIFT_SCALES))


CONVERSIONS = {
    "linear": {"a": FACTOR, "b": OFFSET},
    "rational": {"P1": 0, "P2": FACTOR, "P3": OFFSET, "P4": 0, "P5": 0, "P6": 1},
    "table": {"raw_0": 0, "phys_0": OFFSET, "raw_1": 400, "phys_1": 400 * FACTOR + OFFSET,
              "interpolation": True},
}  # fmt: skip


@pytest.mark.parametrize("kind", CONVERSIONS)
def test_conversions_of_mdf(tmp_path, kind):
    check(mdf(tmp_path / "a.mf4", CONVERSIONS[kind]))
    if kind == "linear":
        check(mdf(tmp_path / "a.mdf", CONVERSIONS[kind], "3.30"))


def test_units_of_uff(tmp_path):
    check(uff_scales(tmp_path / "a.uff", "um", LIFT_SCALES))
    check(uff_scales(tmp_path / "b.uff", "mm", 1e-3 * LIFT_SCALES))
    check(
        uff_scales(tmp_path / "c.uff", "NONE", 1e-6 * LIFT_SCALES, kind=8)
    )  # a displacement in SI


def test_units_of_columns(tmp_path):
    for unit, factor in (("um", 1.0), ("mm", 1e-3)):
        head = f"time [s],lift [{unit}]"
        rows = np.column_stack([TIME_SCALES, factor * LIFT_SCALES])
        np.savetxt(tmp_path / "a.csv", rows, "%.17g", ",", header=head, comments="")
        check(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("gain", 0.25),
        ("Scale", "0.25 um"),
        ("um_per_bit", 0.25),
        ("offset", -8.0),
        ("sensitivity_V", 0.5),
        ("coefficients", "-8, 0.25"),
        ("scale_factor", "0.25"),
    ],
)
def test_scales_that_are_not_known_are_refused_by_name(tmp_path, key, value):
    paths = [hdf5(tmp_path / "a.h5", {key: value}), matlab(tmp_path / "a.mat", {key: value})]
    paths += [hdf5(tmp_path / "b.h5", {}, **{key: value})]
    paths += [tdms(tmp_path / "a.tdms", {key: value})]
    for path in paths:
        with pytest.raises(InputError, match=rf"(?i)does not know: {key} = .*(?s:.*)scale: 1"):
            read(path)
        said = ChannelChoice(name="lift", unit="um", scale=3.0)
        np.testing.assert_allclose(read(path, {"lift": said}).values, 3e-6 * COUNTS, rtol=1e-14)


@pytest.mark.parametrize(
    ("key", "value"),
    [("gain", 1.0), ("offset", 0.0), ("calibration_date", "2026-03-02"), ("scaling", "applied")],
)
def test_what_changes_nothing_is_no_scale(tmp_path, key, value):
    for path in (
        hdf5(tmp_path / "a.h5", {key: value}, LIFT_SCALES),
        tdms(tmp_path / "a.tdms", {key: value}, LIFT_SCALES),
    ):
        check(path)
