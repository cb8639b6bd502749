"""Results in files of other programs: truth = the study, read by readers that share no code.

netCDF4-python, Octave, asammdf, the csv module, and klack's own reader of measurements.
"""

import csv
import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.stroke.record import StopSummary, StrokeChannels, StrokeStudy, StrokeVariant
from klack.analyses.stroke.times import LiftTimes, Passage
from klack.assembling.body_summary import BodySummary
from klack.errors import InputError
from klack.exchange.results.csv_files import write_csv
from klack.exchange.results.mat import write_mat
from klack.exchange.results.mdf import write_mdf
from klack.exchange.results.netcdf import write_netcdf
from klack.exchange.results.study_table import result_table
from klack.exchange.results.table import (
    ResultAxis,
    ResultChannel,
    ResultRun,
    ResultTable,
    file_stems,
    identifiers,
)
from klack.measurement.channels import ChannelChoice
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels
from klack.simulation.network_result import (
    ChannelData,
    EnergyBooks,
    ImpactEvent,
    InterfaceRecord,
    NetworkResult,
    StepCounts,
)
from klack.simulation.step_sizes import StepSizes

TITLE = "Ventil für <Öl> & Wasser, 80 µm"
STEP = 1e-6


def fill(kind: type, **known: Any) -> Any:
    """Make a record with a value of its own in every field."""
    values: dict[str, Any] = dict(known)
    for i, field in enumerate(fields(kind)):
        if field.name not in values:
            plain = {float: 0.25 + i, int: 3 + i, str: f"{field.name} of it", bool: True}
            values[field.name] = plain.get(field.type, np.linspace(0.0, 1.0 + i, 5))
    return kind(**values)


@pytest.fixture(scope="module")
def stroke_study() -> StrokeStudy:
    rng = np.random.default_rng(7)
    time = STEP * np.arange(400)
    lift = 1e-4 * np.sin(8e3 * time) ** 2 * (1.0 + 1e-3 * rng.standard_normal(time.size))
    fine = 1e-7 * np.sort(rng.choice(4000, 150, replace=False))
    result = fill(
        NetworkResult,
        time=time,
        channels={
            "needle.tip displacement": ChannelData(unit="m", values=lift),
            "coil current": ChannelData(unit="A", values=rng.standard_normal(time.size)),
            "coil driver state": ChannelData(unit="-", values=np.round(lift * 1e4)),
        },
        interfaces={
            "seat": fill(
                InterfaceRecord,
                time=fine,
                **{
                    name: rng.standard_normal(fine.size)
                    for name in ("step", "contact_force", "film_force", "gap")
                },
            ),
            "opening": InterfaceRecord(
                **dict.fromkeys(
                    ("time", "step", "contact_force", "film_force", "gap"), np.empty(0)
                ),
                complete=True,
            ),
        },
        events=(
            fill(ImpactEvent, stop="opening", time=2e-4),
            fill(ImpactEvent, stop="seat", time=2.5e-4, restitution=0.25),
            fill(ImpactEvent, stop="seat", time=3.5e-4, restitution=float("nan")),
        ),
        books=EnergyBooks(
            supplies={"coil electric": 3e-2},
            losses={"coil ohmic": 2e-2},
            stores_before={"spring energy": 0.0},
            stores_after={"spring energy": 1e-6},
        ),
        sizes=StepSizes(step=20e-9, coarse=32, near=16, middle=4),
        steps=StepCounts(flight=300, near=40, sub=200, sub_fine=80),
        state={},
    )
    times = LiftTimes(
        body="needle",
        starts="closed",
        lift=1e-4,
        between_stops=True,
        opening=Passage(at_10=1e-4, at_50=1.5e-4, stop="opening"),
        closing=Passage(at_50=5e-4, at_10=5.5e-4, stop="seat", touch=6e-4),
    )
    wet = fill(
        StrokeVariant,
        name="wet",
        result=result,
        opening_time=None,
        closing_time=6e-4,
        times=(times, replace(times, body="piston", lift=None)),
        restrictions=(),
        line_ends=(),
    )
    return fill(
        StrokeStudy,
        title=TITLE,
        lift=1e-4,
        switch_off=None,
        created="2026-03-01T08:30:00+00:00",
        versions={"numpy": "2.0"},
        stage_times={},
        variants={"wet": wet, "dry-lumped": replace(wet, name="dry-lumped")},
        channels=fill(
            StrokeChannels,
            lift="needle.tip displacement",
            **dict.fromkeys(
                ("voltage", "current", "magnetic_force", "pressures", "flows"), ("coil current",)
            ),
        ),
        bodies=(fill(BodySummary),),
        stops=(fill(StopSummary),),
        fluid=None,
        lines=(),
        structures=(),
        warnings=(),
    )


@pytest.fixture(scope="module")
def tables(impact_study: ImpactStudy, stroke_study: StrokeStudy) -> dict[str, ResultTable]:
    study = replace(impact_study, title=TITLE)
    return {"impact": result_table(study), "stroke": result_table(stroke_study)}


@pytest.fixture(params=["impact", "stroke"])
def table(request: pytest.FixtureRequest, tables: dict[str, ResultTable]) -> ResultTable:
    return tables[request.param]


def curves(
    table: ResultTable,
) -> Iterator[tuple[ResultRun, ResultAxis, tuple[ResultChannel, ...]]]:
    for run in table.runs:
        for axis, channels in run.along():
            yield run, axis, channels


# --------------------------------------------------------------------------- table


def test_an_impact_becomes_a_table(impact_study: ImpactStudy):
    table = result_table(impact_study)
    history = impact_study.levels["reduced"].history
    run = table.run("reduced")
    numbers = {item.name: item for item in run.scalars}

    assert [item.name for item in table.runs][:2] == ["full", "reduced"]
    np.testing.assert_array_equal(run.channel("contact force").values, history.force)
    assert run.channel("contact force").axis == "time"
    assert run.channel("needle velocity").axis == "time_edge"
    assert numbers["contact time"].value == impact_study.levels["reduced"].measures.contact_time
    assert (numbers["impulse"].unit, numbers["step"].unit) == ("N s", "s")
    assert "14042 degrees of freedom" in table.about["mesh of needle"]
    assert table.about["created"] == impact_study.created
    # complex receptances go out as two real curves each
    transfer = table.run("transfer-needle")
    full = transfer.channel("full real").values + 1j * transfer.channel("full imaginary").values
    np.testing.assert_array_equal(full, impact_study.transfer[0].curves[0])


def test_a_stroke_becomes_a_table(stroke_study: StrokeStudy):
    run = result_table(stroke_study).run("wet")
    axes = {axis.name: axis.values for axis in run.axes}

    assert list(axes) == ["time", "seat_time", "opening_impact", "seat_impact"]
    np.testing.assert_array_equal(axes["seat_impact"], [2.5e-4, 3.5e-4])
    assert run.channel("seat impact restitution").values[0] == 0.25
    assert run.channel("coil driver state").unit == "1"
    assert {item.name for item in run.scalars} >= {"energy lost coil ohmic", "closing time"}


def test_a_channel_must_fit_its_axis():
    axis = ResultAxis(name="time", quantity="time", unit="s", values=np.arange(3.0), meaning="")
    channel = ResultChannel(name="x", axis="time", unit="m", values=np.arange(4.0), meaning="")

    with pytest.raises(InputError, match="one value for each of the 3"):
        ResultRun(name="a", label="", solver="", axes=(axis,), channels=(channel,), scalars=())


def test_names_stay_apart_and_inside_their_folder():
    long = "x" * 80
    names = identifiers([long, long, "a b", "A.b", "é"], ["time"])

    assert len({name.lower() for name in names}) == len(names)
    assert max(map(len, names)) == 63
    assert identifiers(["time"], ["time"]) == ("time_2",)
    assert file_stems(["../etc/x", "", ".hidden", "a/b"]) == ("___etc_x", "run", "_hidden", "a_b")


# --------------------------------------------------------------------------- netCDF


def test_netcdf_is_read_by_the_library_of_unidata(table: ResultTable, tmp_path: Path):
    netcdf = pytest.importorskip("netCDF4")
    with netcdf.Dataset(write_netcdf(table, tmp_path / "result.nc")) as file:
        assert file.Conventions.startswith("CF-")
        assert file.title == table.about["title"]
        assert str(file["case_text"][...]) == table.case_text
        groups = {group.getncattr("name"): group for group in file.groups.values()}
        assert list(groups) == [run.name for run in table.runs]
        for run, axis, channels in curves(table):
            group = groups[run.name]
            read = {item.long_name: item for item in group.variables.values()}
            for channel in channels:
                variable = read[channel.name]
                assert variable.units == channel.unit
                np.testing.assert_array_equal(np.ma.getdata(variable[...]), channel.values)
                (dimension,) = variable.dimensions
                coordinate = group[dimension]
                assert coordinate.units == axis.unit
                np.testing.assert_array_equal(np.ma.getdata(coordinate[...]), axis.values)
            for scalar in run.scalars:
                assert read[scalar.name].shape == ()
                np.testing.assert_equal(float(np.ma.getdata(read[scalar.name][...])), scalar.value)


def test_netcdf_takes_long_texts_and_none(tables: dict[str, ResultTable], tmp_path: Path):
    netcdf = pytest.importorskip("netCDF4")
    table = tables["stroke"]
    about = {**table.about, "title": "", "warnings": "µ" * 100_000}
    odd = replace(table, about=about, case_text="ä: 1\n" * 50_000, runs=(
        replace(table.runs[0], label="", solver=""),
    ))  # fmt: skip

    with netcdf.Dataset(write_netcdf(odd, tmp_path / "result.nc")) as file:
        assert str(file["case_text"][...]) == odd.case_text
        assert set(file.warnings) == {"µ"}


def test_netcdf_dump_shows_units(tables: dict[str, ResultTable], tmp_path: Path):
    """``ncdump`` is the reader in C; it is not everywhere."""
    if shutil.which("ncdump") is None:
        pytest.skip("ncdump is not installed")
    path = write_netcdf(tables["impact"], tmp_path / "result.nc")

    done = subprocess.run(["ncdump", "-h", path], capture_output=True, text=True, check=True)

    assert 'contact_force:units = "N"' in done.stdout


# --------------------------------------------------------------------------- text


def test_csv_gives_the_same_doubles(table: ResultTable, tmp_path: Path):
    paths = write_csv(table, tmp_path)

    assert all(path.is_file() for path in paths)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(p.name for p in paths)
    for path, (_, axis, channels) in zip(paths, curves(table), strict=False):
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = list(csv.reader(file))
        numbers = np.array([[text or "nan" for text in row] for row in rows], dtype=float).T
        assert header[0] == f"{axis.quantity} [{axis.unit}]"
        assert header[1:] == [f"{item.name} [{item.unit}]" for item in channels]
        np.testing.assert_array_equal(numbers, [axis.values, *(c.values for c in channels)])
    with (tmp_path / "numbers.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = [
        (run.name, s.name, s.unit, repr(s.value)) for run in table.runs for s in run.scalars
    ]
    assert [(r["run"], r["name"], r["unit"], r["value"]) for r in rows] == expected
    assert json.loads((tmp_path / "about.json").read_text(encoding="utf-8"))["title"] == TITLE


def test_no_text_says_nan(tables: dict[str, ResultTable], tmp_path: Path):
    """What does not exist is left out, or empty: a restitution, the end of a drive."""
    table = tables["stroke"]
    write_csv(table, tmp_path)

    told = [*table.about.values(), *table.about]
    told += [item.meaning for run in table.runs for item in (*run.channels, *run.scalars)]
    told += [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()]
    assert table.about["lift"] == "0.0001 m"
    assert "switch off" not in table.about
    assert not any(re.search(r"\b(nan|NaN|None)\b", text) for text in told)
    assert any(",,," in text or ",," in text for text in told)  # the missing restitution


def test_csv_of_a_stroke_passes_as_a_measurement(tables: dict[str, ResultTable], tmp_path: Path):
    table = tables["stroke"]
    write_csv(table, tmp_path)

    with open_recording(tmp_path / "wet.csv") as recording:
        time, values = recording.read("needle.tip displacement")

    # the fast reader of measurements rounds the last bit on its own
    run = table.run("wet")
    np.testing.assert_array_max_ulp(values, run.channel("needle.tip displacement").values, 1)
    np.testing.assert_array_max_ulp(time, run.axes[0].values, 1)


# --------------------------------------------------------------------------- MATLAB


OCTAVE = """
load('{path}');
printf('%s\\n', about.title);
names = fieldnames({run});
for i = 1:numel(names)
  values = {run}.(names{{i}});
  if isnumeric(values)
    printf('%s %s', names{{i}}, {run}.units.(names{{i}}));
    printf(' %.17g', values);
    printf('\\n');
  end
end
printf('%s\\n', {run}.axes.{channel});
"""


@pytest.mark.parametrize(
    ("kind", "run", "channel", "axis"),
    [
        ("impact", "reduced", "needle_velocity", "time_edge"),
        ("stroke", "dry-lumped", "coil_current", "time"),
    ],
)
def test_octave_reads_every_number(
    kind: str, run: str, channel: str, axis: str, tables: dict[str, ResultTable], tmp_path: Path
):
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        pytest.skip("octave is not installed")
    table = tables[kind]
    path = write_mat(table, tmp_path / "result.mat")
    name = run.replace("-", "_")

    script = OCTAVE.format(path=path, run=name, channel=channel)
    done = subprocess.run(
        [octave, "--no-gui", "--norc", "--eval", script],
        capture_output=True, text=True, check=True, encoding="utf-8",
    )  # fmt: skip

    title, *lines, drawn_over = done.stdout.splitlines()
    read = {line.split()[0]: line.split(" ") for line in lines}
    assert title == TITLE
    assert drawn_over == axis
    expected = table.run(run)
    words = identifiers([item.name for item in expected.axes])
    words += identifiers([item.name for item in expected.channels])
    for word, item in zip(words, (*expected.axes, *expected.channels), strict=True):
        # a unit may hold a blank
        units, numbers = item.unit.split(" "), read[word]
        assert numbers[1 : 1 + len(units)] == units
        np.testing.assert_array_equal(np.array(numbers[1 + len(units) :], float), item.values)


def test_scipy_reads_numbers_and_names(tables: dict[str, ResultTable], tmp_path: Path):
    from scipy.io import loadmat

    table = tables["stroke"]
    read = loadmat(write_mat(table, tmp_path / "result.mat"), simplify_cells=True)

    assert read["about"]["runs"].tolist() == ["wet", "dry_lumped"]
    assert read["wet"]["names"]["needle_tip_displacement"] == "needle.tip displacement"
    for item, word in zip(
        table.run("wet").scalars,
        identifiers([item.name for item in table.run("wet").scalars]),
        strict=True,
    ):
        np.testing.assert_equal(read["wet"]["numbers"][word], item.value)
        assert read["wet"]["units"]["numbers"][word] == item.unit


def test_a_run_too_large_for_matlab_5_is_refused(tmp_path: Path):
    values = np.broadcast_to(0.0, (2**28,))  # 2 GiB that take no memory
    axis = ResultAxis(name="time", quantity="time", unit="s", values=values, meaning="")
    run = ResultRun(name="a", label="", solver="", axes=(axis,), channels=(), scalars=())

    with pytest.raises(InputError, match="2 GiB"):
        write_mat(
            ResultTable(kind="impact", about={}, case_text="", runs=(run,)), tmp_path / "a.mat"
        )


# --------------------------------------------------------------------------- MDF


def test_asammdf_reads_every_time_channel(table: ResultTable, tmp_path: Path):
    with pytest.importorskip("asammdf").MDF(write_mdf(table, tmp_path / "result.mf4")) as file:
        count = 0
        for run, axis, channels in curves(table):
            if axis.quantity != "time":
                continue
            for channel in channels:
                signal = file.get(f"{run.name}/{channel.name}")
                np.testing.assert_array_equal(signal.samples, channel.values)
                np.testing.assert_array_equal(signal.timestamps, axis.values)
                assert (signal.unit, signal.comment) == (channel.unit, channel.meaning)
            count += bool(channels)
        assert len(file.groups) == count
        assert TITLE in ElementTree.fromstring(file.header.comment).findtext("TX", "")
        assert file.header.start_time.isoformat() == table.about["created"]
        assert file.groups[0].channel_group.acq_source is None
        assert file.groups[0].channel_group.acq_name == table.runs[0].name


def test_a_computed_stroke_is_read_like_a_measured_one(
    tables: dict[str, ResultTable], tmp_path: Path
):
    pytest.importorskip("asammdf")
    table = tables["stroke"]
    path = write_mdf(table, tmp_path / "result.mf4")
    channels = {
        "lift": ChannelChoice(name="wet/needle.tip displacement"),
        "current": ChannelChoice(name="wet/coil current"),
    }

    with open_recording(path) as recording:
        (found,) = find_channels(recording, channels, roles=tuple(channels))
        read = read_channels(recording, found)

    run = table.run("wet")
    assert read["lift"].unit == "m"
    assert read["lift"].step == pytest.approx(STEP, rel=1e-12)  # a mean of differences
    np.testing.assert_array_equal(
        read["lift"].values, run.channel("needle.tip displacement").values
    )
    np.testing.assert_array_equal(read["current"].values, run.channel("coil current").values)


# --------------------------------------------------------------------------- whole or nothing


WRITERS = {
    "result.nc": write_netcdf,
    "result.mat": write_mat,
    "result.mf4": write_mdf,
    "result.dat": write_mdf,
}


@pytest.mark.parametrize("name", WRITERS)
def test_files_are_whole_or_as_before(
    name: str, tables: dict[str, ResultTable], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "deep" / name
    table = tables["stroke"]
    WRITERS[name](table, path)
    before = path.read_bytes()
    assert [item.name for item in path.parent.iterdir()] == [name]

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        WRITERS[name](table, path)

    assert path.read_bytes() == before
    assert [item.name for item in path.parent.iterdir()] == [name]


def test_tables_of_text_come_together_or_not(
    tables: dict[str, ResultTable], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "notes.txt").write_text("mine")

    def broken(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", broken)
    with pytest.raises(InputError, match="No space left"):
        write_csv(tables["stroke"], tmp_path)

    assert [item.name for item in tmp_path.iterdir()] == ["notes.txt"]


def test_a_folder_that_is_a_file_is_refused(tables: dict[str, ResultTable], tmp_path: Path):
    (tmp_path / "file").write_text("")

    for write in (write_csv, write_netcdf, write_mat, write_mdf):
        with pytest.raises(InputError, match="a writable path"):
            write(tables["stroke"], tmp_path / "file" / "result")
