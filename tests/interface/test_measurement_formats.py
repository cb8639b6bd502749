"""One measurement in every format, and channels that start at different times.

The same measurement in every format gives the same numbers in SI.

Truth: the arrays that were given to the writers of the formats' own libraries.

Channels that start at different times, as their files say it, come onto one clock.

Truth: signals whose value at any time of the clock is known.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import common_time, read_channels, windows

asammdf = pytest.importorskip("asammdf")
h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
pyuff = pytest.importorskip("pyuff")
scipy_io = pytest.importorskip("scipy.io")

COUNT, STEP, START = 3000, 2e-6, -1e-3  # [-], [s], [s]
TIME = START + STEP * np.arange(COUNT)
FILE = {  # values and unit in the file
    "lift": (80.0 * np.exp(-((TIME / 1e-3) ** 2)), "µm"),
    "current": (3.0 * np.tanh(2e3 * TIME), "A"),
    "p_rail": (200.0 + 5.0 * np.sin(3e3 * TIME), "bar"),
    "acc": (40.0 * np.sin(8e4 * TIME), "g"),
}
SI = {
    "lift": 1e-6 * FILE["lift"][0],
    "current": FILE["current"][0],
    "pressure": 1e5 * FILE["p_rail"][0],
    "acceleration": 9.80665 * FILE["acc"][0],
}


def csv(path):
    lines = [";".join(["t [ms]", *(f"{name} [{unit}]" for name, (_, unit) in FILE.items())])]
    for k in range(COUNT):
        row = (1e3 * TIME[k], *(values[k] for values, _ in FILE.values()))
        lines.append(";".join(f"{x:.17g}" for x in row))
    path.write_text("\n".join(lines), encoding="latin-1")


def mdf(path, version="4.10", **options):
    file = asammdf.MDF(version=version)
    file.append(
        [
            asammdf.Signal(values, TIME, unit=unit, name=name)
            for name, (values, unit) in FILE.items()
        ]
    )
    saved = file.save(path, overwrite=True, **options)
    file.close()
    return saved


def mdf3(path):
    mdf(path, "3.30")


def mdf4_compressed(path):
    mdf(path, compression=2)


def tdms(path):
    channels = [
        nptdms.ChannelObject(
            "bench",
            name,
            values,
            {"unit_string": unit, "wf_increment": STEP, "wf_start_offset": START},
        )
        for name, (values, unit) in FILE.items()
    ]
    with nptdms.TdmsWriter(path) as writer:
        for k in range(0, COUNT, 1000):  # in segments, as a logger writes them
            writer.write_segment(
                [
                    nptdms.ChannelObject("bench", c.channel, c.data[k : k + 1000], c.properties)
                    for c in channels
                ]
            )


def tdms_with_time(path):
    channels = [nptdms.ChannelObject("bench", "Time", TIME, {"unit_string": "s"})]
    for name, (values, unit) in FILE.items():
        channels.append(nptdms.ChannelObject("bench", name, values, {"unit_string": unit}))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)


def uff(path, binary=0, even=1):
    file = pyuff.UFF(str(path))
    for name, (values, unit) in FILE.items():
        header = pyuff.prepare_58(
            binary=binary,
            func_type=1,
            rsp_node=1,
            rsp_dir=3,
            ref_node=1,
            ref_dir=3,
            data=values,
            x=TIME,
            id1=name,
            ord_data_type=4,
            abscissa_spacing=even,
            abscissa_min=START,
            abscissa_inc=STEP,
            abscissa_spec_data_type=17,
            abscissa_axis_units_lab="s",
            ordinate_spec_data_type=0,
            ordinate_axis_units_lab=unit.replace("µ", "u"),
            orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
        )
        file.write_sets(header, "add")


def uff_binary(path):
    uff(path, binary=1)


def uff_uneven(path):
    uff(path, even=0)


def uff_uneven_binary(path):
    uff(path, binary=1, even=0)


def hdf5(path):
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        file["time"].attrs["unit"] = "s"
        for name, (values, unit) in FILE.items():
            file[name] = values
            file[name].attrs["unit"] = unit


def hdf5_with_step(path):
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = 1.0 / STEP
        file.attrs["t0"] = START
        for name, (values, unit) in FILE.items():
            file.create_dataset(f"bench/{name}", data=values, chunks=(1000,), compression="gzip")
            file[f"bench/{name}"].attrs["units"] = np.bytes_(unit.encode())


def matlab(path):
    content = {f"{name}_{unit.replace('µ', 'u')}": v for name, (v, unit) in FILE.items()}
    scipy_io.savemat(path, {"t": TIME, **content})


def matlab_structures(path):
    scipy_io.savemat(
        path,
        {
            name: {"time": TIME[:, None], "values": values[:, None], "unit": unit}
            for name, (values, unit) in FILE.items()
        },
        do_compression=True,
    )


def matlab_73(path):
    """As MATLAB writes it: a user block, rows as columns, texts as numbers of signs."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, (values, unit) in FILE.items():
            group = file.create_group(name)
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            group["time"], group["values"] = TIME[None, :], values[None, :]
            group["unit"] = np.array([[ord(c)] for c in unit], dtype=np.uint16)
            group["unit"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(128))


FORMATS = {
    "csv": (csv, "a.csv"),
    "MDF4": (mdf, "a.mf4"),
    "MDF4 compressed": (mdf4_compressed, "a.mf4"),
    "MDF3": (mdf3, "a.mdf"),
    "TDMS": (tdms, "a.tdms"),
    "TDMS with a channel of time": (tdms_with_time, "a.tdms"),
    "UFF 58": (uff, "a.uff"),
    "UFF 58b": (uff_binary, "a.unv"),
    "UFF 58 uneven": (uff_uneven, "a.uff"),
    "UFF 58b uneven": (uff_uneven_binary, "a.unv"),
    "HDF5": (hdf5, "a.h5"),
    "HDF5 with a rate": (hdf5_with_step, "a.hdf5"),
    "MATLAB": (matlab, "a.mat"),
    "MATLAB structures": (matlab_structures, "a.mat"),
    "MATLAB 7.3": (matlab_73, "a.mat"),
}
# text of a universal file has 12 digits, counted from the largest value
ACCURACY = {"UFF 58": 1e-11, "UFF 58 uneven": 1e-11}


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_gives_the_same_channels(tmp_path, form):
    write, name = FORMATS[form]
    write(tmp_path / name)

    with open_recording(tmp_path / name) as recording:
        (found,) = find_channels(recording)
        series = read_channels(recording, found)
        parts = list(windows(recording, found, length=1.1e-3, overlap=1e-4))

    accuracy = ACCURACY.get(form, 1e-14)
    assert set(series) == set(SI)
    for role, values in SI.items():
        np.testing.assert_allclose(
            series[role].values, values, rtol=accuracy, atol=accuracy * np.max(np.abs(values))
        )
        assert series[role].step == pytest.approx(STEP, rel=1e-9)
        assert series[role].start == pytest.approx(START, rel=1e-9)
    assert len(parts) == 6
    for part in parts:
        first = round((part["lift"].start - START) / STEP)
        whole = series["lift"].values[first : first + part["lift"].values.size]
        np.testing.assert_array_equal(part["lift"].values, whole)


@pytest.mark.parametrize("form", FORMATS)
def test_a_file_that_was_cut_off_ends_in_a_clear_error(tmp_path, form):
    write, name = FORMATS[form]
    path = tmp_path / name
    write(path)
    path.write_bytes(path.read_bytes()[: 2 * path.stat().st_size // 3])
    whole_until_there = form == "csv" or form.startswith(("UFF", "TDMS"))

    try:
        with open_recording(path) as recording:
            for channel in recording.channels:
                recording.read(channel.name)
        text = ""
    except InputError as error:
        text = str(error)

    assert whole_until_there if text == "" else path.name in text and "Try: " in text


COUNT_STARTS, TICK = 600, 10e-6  # [-], [s]
START_STARTS = np.datetime64("2026-03-02T08:00:00", "ns")
LATER = 300  # [us] of the current


def lift_at(time):
    """Lift on the clock [um]."""
    return 80.0 * np.sin(400.0 * time)


def current_at(time):
    """Current on the clock [A]."""
    return 3.0 * np.cos(500.0 * time)


TICKS = TICK * np.arange(COUNT_STARTS)
LIFT, CURRENT = lift_at(TICKS), current_at(TICKS + 1e-6 * LATER)
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


def tdms_starts(path, groups=("bench", "bench"), later=LATER, first=START_STARTS):
    one = {"wf_increment": TICK, "wf_start_offset": 0.0}
    begin = {"wf_start_time": stamp(first)} if first is not None else {}
    then = {"wf_start_time": stamp(START_STARTS + np.timedelta64(later, "us"))}
    lift = nptdms.ChannelObject(groups[0], "lift", LIFT, {**one, **begin, "unit_string": "um"})
    current = nptdms.ChannelObject(
        groups[1], "current", CURRENT, {**one, **then, "unit_string": "A"}
    )
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([current, lift])
    return path


@pytest.mark.parametrize("groups", [("bench", "bench"), ("slow", "fast")])
def test_start_times_of_tdms_waveforms_count(tmp_path, groups):
    check(tdms_starts(tmp_path / "a.tdms", groups))


def test_a_tdms_waveform_without_a_start_time_is_told(tmp_path):
    for first in (None, np.datetime64("1904-01-01")):  # nothing, and what LabVIEW writes for it
        series, notes = read(tdms_starts(tmp_path / "a.tdms", first=first))
        assert any("lift without a start time; assumed to start with" in note for note in notes)
        assert series["lift"].values.size == COUNT_STARTS


def test_tdms_waveforms_of_different_days_are_refused_with_their_times(tmp_path):
    path = tdms_starts(tmp_path / "a.tdms", later=86_400_000_000)
    with pytest.raises(InputError, match=r"lift \(0 to 0.00599 s\).*current \(86400 to 86400 s\)"):
        read(path)


def test_time_stamps_as_a_channel_of_tdms(tmp_path):
    path, groups = tmp_path / "a.tdms", []
    for name, unit, values, later in CHANNELS:
        stamps = (
            START_STARTS
            + np.timedelta64(round(1e6 * later), "us")
            + (1e9 * TICKS).round().astype("m8[ns]")
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
            file[name].attrs.update({"unit": unit, "dt": TICK, "t0": later})


def hdf5_dates(path):
    """Own steps, and starts as dates."""
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[name] = values
            date = f"2026-03-02T08:00:00.{round(1e6 * later):06d}Z"
            file[name].attrs.update({"unit": unit, "wf_increment": TICK, "wf_start_time": date})


def netcdf(path):
    """Stored times in the manner of netCDF."""
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[f"{name}/time"] = 1e6 * TICKS
            date = f"2026-03-02 08:00:00.{round(1e4 * later):04d} +00:00"
            file[f"{name}/time"].attrs["units"] = f"microseconds since {date}"
            file[f"{name}/values"] = values
            file[f"{name}/values"].attrs["units"] = unit


def matlab_starts(path):
    """Structures of timeseries; dates of MATLAB count to 1 s, so its times start later."""
    about = {"Units": "milliseconds", "StartDate": "2026-03-02 08:00:00"}
    scipy_io.savemat(
        path,
        {
            name: {
                "Time": 1e3 * (TICKS + later)[:, None],
                "Data": values[:, None],
                "TimeInfo": about,
                "DataInfo": {"Units": unit},
            }
            for name, unit, values, later in CHANNELS
        },
    )


def mdf_starts(path):
    file = asammdf.MDF(version="4.10")
    for name, unit, values, later in CHANNELS:
        file.append([asammdf.Signal(values, TICKS + later, unit=unit, name=name)])
    file.save(path, overwrite=True)
    file.close()


def uff_starts(path):
    file = pyuff.UFF(str(path))
    for name, unit, values, later in CHANNELS:
        file.write_sets(
            pyuff.prepare_58(
                binary=1, func_type=1, rsp_node=1, rsp_dir=3, ref_node=1, ref_dir=3, data=values,
                x=TICKS + later, id1=name, ord_data_type=4, abscissa_spacing=1, abscissa_min=later,
                abscissa_inc=TICK, abscissa_spec_data_type=17, abscissa_axis_units_lab="s",
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
        (matlab_starts, "a.mat"),
        (mdf_starts, "a.mf4"),
        (uff_starts, "a.uff"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_starts_count_in_every_format_that_has_them(tmp_path, write, name):
    write(tmp_path / name)
    check(tmp_path / name, told=write in (hdf5_dates, netcdf))


def test_different_starts_beside_one_stored_time_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_s"] = TICKS
        for name, unit, values, later in CHANNELS:
            file[name] = values
            file[name].attrs.update({"unit": unit, "t0": later})
    with pytest.raises(InputError, match=r"with one stored time: '\w+' 0.*'\w+' 0"):
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
    for time, lift, current in zip(TICKS, LIFT, current_at(TICKS), strict=True):
        cells = [form.format(59.99 + time), f"{lift:.9f}"]
        rows.append(separator.join([*cells, f"{current:.9f}"]).replace(".", decimal))
    text = f"Logger 3 of 08:00:00.5\n\nTimestamp{separator}lift [um]{separator}current [A]\n"
    path = tmp_path / "a.csv"
    path.write_text(text + "\n".join(rows))
    series, notes = read(path)
    assert any("taken as seconds" in note for note in notes)
    assert series["lift"].step == pytest.approx(TICK, rel=1e-9)  # stamps have 1 us, steps 10
    np.testing.assert_allclose(series["lift"].values, 1e-6 * LIFT, rtol=0, atol=1e-15)
    np.testing.assert_allclose(series["current"].values, current_at(TICKS), rtol=0, atol=1e-9)


def test_time_stamps_of_19_digits_are_not_cut(tmp_path):
    path = tmp_path / "a.h5"
    zero = START_STARTS.astype(np.int64)  # [ns], of which a real number keeps 256
    with h5py.File(path, "w") as file:
        for name, unit, values, later in CHANNELS:
            file[f"{name}/time"] = zero + np.round(1e9 * (TICKS + later)).astype(np.int64)
            file[f"{name}/time"].attrs["unit"] = "ns"
            file[f"{name}/values"] = values
            file[f"{name}/values"].attrs["unit"] = unit
    check(path)
