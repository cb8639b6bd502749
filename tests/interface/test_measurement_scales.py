"""Packed numbers, with the scale that the file states, are the plain ones; unknown scales are told.

Truth: the plain numbers.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.channels import ChannelChoice
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels
from klack.measurement.recording import open_recording

asammdf = pytest.importorskip("asammdf")
h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
pyuff = pytest.importorskip("pyuff")
scipy_io = pytest.importorskip("scipy.io")

TIME = 1e-5 * np.arange(400)  # [s]
COUNTS = np.arange(400, dtype=np.int16)
FACTOR, OFFSET = 0.25, -8.0  # powers of two: products are exact
LIFT = FACTOR * COUNTS + OFFSET  # [um]


def read(path, channels=None):
    with open_recording(path) as recording:
        (found,) = find_channels(recording, channels)
        return read_channels(recording, found)["lift"]


def check(path, channels=None):
    lift = read(path, channels)
    np.testing.assert_allclose(lift.values, 1e-6 * LIFT, rtol=1e-14)
    assert lift.step == pytest.approx(1e-5, rel=1e-6)


def hdf5(path, about, values=COUNTS, **root):
    with h5py.File(path, "w") as file:
        file["time_s"], file["lift"] = TIME, values
        file["lift"].attrs.update({"units": "um", **about})
        file.attrs.update(root)
    return path


def netcdf3(path, about, values=COUNTS):
    with scipy_io.netcdf_file(path, "w") as file:
        file.createDimension("sample", len(values))
        time, lift = (file.createVariable(n, t, ("sample",)) for n, t in NETCDF)
        time[:], lift[:] = TIME, values
        time.units, lift.units = "s", "um"
        for key, value in about.items():
            setattr(lift, key, value)
    return path


NETCDF = (("time", "d"), ("lift", "h"))


def matlab(path, about):
    lift = {"values": COUNTS[:, None], "unit": "um", "time": TIME[:, None], **about}
    scipy_io.savemat(path, {"lift": lift})
    return path


def tdms(path, about, values=COUNTS):
    about = {"unit_string": "um", "wf_increment": 1e-5, **about}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("bench", "lift", values, about)])
    return path


def mdf(path, conversion, version="4.10"):
    file = asammdf.MDF(version=version)
    file.append([asammdf.Signal(COUNTS, TIME, unit="um", name="lift", conversion=conversion)])
    file.save(path, overwrite=True)
    file.close()
    return path


def uff(path, unit, values, kind=0):
    pyuff.UFF(str(path)).write_sets(
        pyuff.prepare_58(
            binary=1, func_type=1, rsp_node=1, rsp_dir=3, ref_node=1, ref_dir=3, data=values,
            x=TIME, id1="lift", ord_data_type=4, abscissa_spacing=1, abscissa_min=0.0,
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
    with pytest.warns(UserWarning, match="3 missing values of 'lift' filled"):
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
        file["time"], file["lift"] = COUNTS, LIFT
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
    check(tdms(tmp_path / "a.tdms", about | {"NI_Scaling_Status": "scaled"}, LIFT))


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
    check(uff(tmp_path / "a.uff", "um", LIFT))
    check(uff(tmp_path / "b.uff", "mm", 1e-3 * LIFT))
    check(uff(tmp_path / "c.uff", "NONE", 1e-6 * LIFT, kind=8))  # a displacement in SI


def test_units_of_columns(tmp_path):
    for unit, factor in (("um", 1.0), ("mm", 1e-3)):
        head = f"time [s],lift [{unit}]"
        rows = np.column_stack([TIME, factor * LIFT])
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
        hdf5(tmp_path / "a.h5", {key: value}, LIFT),
        tdms(tmp_path / "a.tdms", {key: value}, LIFT),
    ):
        check(path)
