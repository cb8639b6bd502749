"""The same measurement in every format gives the same numbers in SI.

Truth: the arrays that were given to the writers of the formats' own libraries.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels, windows
from klack.measurement.recording import open_recording

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
