"""Channels that start at different times, as their files say it, come onto one clock.

Truth: signals whose value at any time of the clock is known.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import common_time, read_channels
from klack.measurement.recording import open_recording

asammdf = pytest.importorskip("asammdf")
h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
pyuff = pytest.importorskip("pyuff")
scipy_io = pytest.importorskip("scipy.io")

COUNT, STEP = 600, 10e-6  # [-], [s]
START = np.datetime64("2026-03-02T08:00:00", "ns")
LATER = 300  # [us] of the current


def lift_at(time):
    """Lift on the clock [um]."""
    return 80.0 * np.sin(400.0 * time)


def current_at(time):
    """Current on the clock [A]."""
    return 3.0 * np.cos(500.0 * time)


TIME = STEP * np.arange(COUNT)
LIFT, CURRENT = lift_at(TIME), current_at(TIME + 1e-6 * LATER)
CHANNELS = (("lift", "um", LIFT, 0.0), ("current", "A", CURRENT, 1e-6 * LATER))


def read(path):
    with open_recording(path) as recording:
        (found,) = find_channels(recording)
        return read_channels(recording, found), common_time(recording, found).notes


def check(path, *, told=True, accuracy=1e-12):  # times are rounded at 1e-18 s, changes 500 / s
    series, notes = read(path)
    time = series["lift"].time - series["lift"].time[0] + 1e-6 * LATER
    for name, values, size in (
        ("lift", 1e-6 * lift_at(time), 80e-6),
        ("current", current_at(time), 3.0),
    ):
        np.testing.assert_allclose(series[name].values, values, rtol=0, atol=accuracy * size)
    assert any("current' starts 0.0003 s later" in note for note in notes) == told


def stamp(start):
    return nptdms.types.TimeStamp(start)


def tdms(path, groups=("bench", "bench"), later=LATER, first=START):
    one = {"wf_increment": STEP, "wf_start_offset": 0.0}
    begin = {"wf_start_time": stamp(first)} if first is not None else {}
    then = {"wf_start_time": stamp(START + np.timedelta64(later, "us"))}
    lift = nptdms.ChannelObject(groups[0], "lift", LIFT, {**one, **begin, "unit_string": "um"})
    current = nptdms.ChannelObject(
        groups[1], "current", CURRENT, {**one, **then, "unit_string": "A"}
    )
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([current, lift])
    return path


@pytest.mark.parametrize("groups", [("bench", "bench"), ("slow", "fast")])
def test_start_times_of_tdms_waveforms_count(tmp_path, groups):
    check(tdms(tmp_path / "a.tdms", groups))


def test_a_tdms_waveform_without_a_start_time_is_told(tmp_path):
    for first in (None, np.datetime64("1904-01-01")):  # nothing, and what LabVIEW writes for it
        series, notes = read(tdms(tmp_path / "a.tdms", first=first))
        assert any("lift without a start time; taken to start with" in note for note in notes)
        assert series["lift"].values.size == COUNT


def test_tdms_waveforms_of_different_days_are_refused_with_their_times(tmp_path):
    path = tdms(tmp_path / "a.tdms", later=86_400_000_000)
    with pytest.raises(InputError, match=r"lift \(0 to 0.00599 s\).*current \(86400 to 86400 s\)"):
        read(path)


def test_time_stamps_as_a_channel_of_tdms(tmp_path):
    path, groups = tmp_path / "a.tdms", []
    for name, unit, values, later in CHANNELS:
        stamps = (
            START + np.timedelta64(round(1e6 * later), "us") + (1e9 * TIME).round().astype("m8[ns]")
        )
        groups += [
            nptdms.ChannelObject(name, "stamps", stamps),
            nptdms.ChannelObject(name, name, values, {"unit_string": unit}),
        ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(groups)
    check(path)


def hdf5_rates(path):
    """Own steps, and starts as numbers."""
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[f"{name}/data"] = values
            file[name].attrs.update({"unit": unit, "dt": STEP, "t0": later})


def hdf5_dates(path):
    """Own steps, and starts as dates."""
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[name] = values
            date = f"2026-03-02T08:00:00.{round(1e6 * later):06d}Z"
            file[name].attrs.update({"unit": unit, "wf_increment": STEP, "wf_start_time": date})


def netcdf(path):
    """Stored times in the manner of netCDF."""
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[f"{name}/time"] = 1e6 * TIME
            date = f"2026-03-02 08:00:00.{round(1e4 * later):04d} +00:00"
            file[f"{name}/time"].attrs["units"] = f"microseconds since {date}"
            file[f"{name}/values"] = values
            file[f"{name}/values"].attrs["units"] = unit


def matlab(path):
    """Structures of timeseries; dates of MATLAB count to 1 s, so its times start later."""
    about = {"Units": "milliseconds", "StartDate": "2026-03-02 08:00:00"}
    scipy_io.savemat(
        path,
        {
            name: {
                "Time": 1e3 * (TIME + later)[:, None],
                "Data": values[:, None],
                "TimeInfo": about,
                "DataInfo": {"Units": unit},
            }
            for name, unit, values, later in CHANNELS
        },
    )


def mdf(path):
    file = asammdf.MDF(version="4.10")
    for name, unit, values, later in CHANNELS:
        file.append([asammdf.Signal(values, TIME + later, unit=unit, name=name)])
    file.save(path, overwrite=True)
    file.close()


def uff(path):
    file = pyuff.UFF(str(path))
    for name, unit, values, later in CHANNELS:
        file.write_sets(
            pyuff.prepare_58(
                binary=1, func_type=1, rsp_node=1, rsp_dir=3, ref_node=1, ref_dir=3, data=values,
                x=TIME + later, id1=name, ord_data_type=4, abscissa_spacing=1, abscissa_min=later,
                abscissa_inc=STEP, abscissa_spec_data_type=17, abscissa_axis_units_lab="s",
                ordinate_spec_data_type=0, ordinate_axis_units_lab=unit, orddenom_spec_data_type=0,
                z_axis_spec_data_type=0,
            ),
            "add",
        )  # fmt: skip


@pytest.mark.parametrize(
    ("write", "name"),
    [
        (hdf5_rates, "a.h5"),
        (hdf5_dates, "a.h5"),
        (netcdf, "a.nc"),
        (matlab, "a.mat"),
        (mdf, "a.mf4"),
        (uff, "a.uff"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_starts_count_in_every_format_that_has_them(tmp_path, write, name):
    write(tmp_path / name)
    check(tmp_path / name, told=write in (hdf5_dates, netcdf))


def test_different_starts_beside_one_stored_time_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_s"] = TIME
        for name, unit, values, later in CHANNELS:
            file[name] = values
            file[name].attrs.update({"unit": unit, "t0": later})
    with pytest.raises(InputError, match=r"beside one stored time: '\w+' 0.*'\w+' 0"):
        open_recording(tmp_path / "a.h5")


STAMPS = {
    "dates": ("2026-03-02 08:00:{:09.6f}", ",", "."),
    "dates of ISO 8601": ("2026-03-02T08:00:{:09.6f}Z", ";", ","),
    "times of day": ("08:00:{:09.6f}", "\t", "."),
    "decimal comma": ("08:00:{:09.6f}", ";", ","),
}


@pytest.mark.parametrize(("form", "separator", "decimal"), STAMPS.values(), ids=STAMPS)
def test_time_stamps_as_a_column(tmp_path, form, separator, decimal):
    rows = []
    for time, lift, current in zip(TIME, LIFT, current_at(TIME), strict=True):
        cells = [form.format(59.99 + time), f"{lift:.9f}"]
        rows.append(separator.join([*cells, f"{current:.9f}"]).replace(".", decimal))
    text = f"Logger 3 of 08:00:00.5\n\nTimestamp{separator}lift [um]{separator}current [A]\n"
    path = tmp_path / "a.csv"
    path.write_text(text + "\n".join(rows))
    series, notes = read(path)
    assert any("taken as seconds" in note for note in notes)
    assert series["lift"].step == pytest.approx(STEP, rel=1e-9)  # stamps have 1 us, steps 10
    np.testing.assert_allclose(series["lift"].values, 1e-6 * LIFT, rtol=0, atol=1e-15)
    np.testing.assert_allclose(series["current"].values, current_at(TIME), rtol=0, atol=1e-9)


def test_time_stamps_of_19_digits_are_not_cut(tmp_path):
    path = tmp_path / "a.h5"
    zero = START.astype(np.int64)  # [ns], of which a real number keeps 256
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[f"{name}/time"] = zero + np.round(1e9 * (TIME + later)).astype(np.int64)
            file[f"{name}/time"].attrs["unit"] = "ns"
            file[f"{name}/values"] = values
            file[f"{name}/values"].attrs["unit"] = unit
    check(path)
