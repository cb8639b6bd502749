"""Stored studies of impacts and strokes.

A stroke study on disk: truth = the study itself, and what a foreign reader finds.

Round trip and damage of stored studies; the truth is the object that was saved.
"""

import json
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from klack.analyses import store as record_store
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.store import RESULT_NAME, RecordFormat, load_record, save_record, stored_format
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.record import (
    FluidSummary,
    LineSummary,
    StopSummary,
    StrokeChannels,
    StrokeStudy,
    StrokeVariant,
)
from klack.analyses.stroke.times import LiftTimes, Passage
from klack.assembling.body_summary import BodySummary
from klack.errors import InputError
from klack.simulation.network_result import (
    ChannelData,
    EnergyBooks,
    ImpactEvent,
    InterfaceRecord,
    NetworkResult,
)


def fill(kind: type, **known: Any) -> Any:
    """Make a record with a value of its own in every field."""
    values: dict[str, Any] = dict(known)
    for i, field in enumerate(fields(kind)):
        if field.name in values:
            continue
        values[field.name] = {
            float: 0.25 + i,
            int: 3 + i,
            str: f"{field.name} of it",
            bool: True,
        }.get(field.type, np.linspace(0.0, 1.0 + i, 5))
    return kind(**values)


def result() -> NetworkResult:
    events = (
        fill(ImpactEvent, stop="opening", time=2e-4),
        fill(ImpactEvent, stop="seat", time=6e-4, restitution=float("nan")),
    )
    return fill(
        NetworkResult,
        channels={
            "needle.tip displacement": ChannelData(unit="m", values=np.linspace(0.0, 1e-4, 5)),
            "sac pressure": ChannelData(unit="Pa", values=np.full(5, 1.013e5)),
        },
        interfaces={
            "seat": fill(InterfaceRecord, complete=False),
            "opening": InterfaceRecord(
                **dict.fromkeys(
                    ("time", "step", "contact_force", "film_force", "gap"), np.empty(0)
                ),
                complete=True,
            ),
        },
        events=events,
        books=EnergyBooks(
            supplies={"coil electric": 3e-2},
            losses={"coil ohmic": 2e-2, "seat film": 1e-6},
            stores_before={"spring energy": 0.0},
            stores_after={"spring energy": 1e-6},
        ),
        state={"clock": np.arange(4), "bodies.q": np.linspace(0, 1, 7)},
    )


@pytest.fixture
def study() -> StrokeStudy:
    times = LiftTimes(
        body="needle",
        starts="closed",
        lift=1e-4,
        between_stops=True,
        opening=Passage(at_10=1e-4, at_50=1.5e-4, stop="opening"),
        closing=Passage(at_50=5e-4, at_10=5.5e-4, stop="seat", touch=6e-4),
    )
    variant = fill(
        StrokeVariant,
        name="wet",
        result=result(),
        opening_time=None,
        closing_time=6e-4,
        times=(times, replace(times, body="piston", lift=None)),
    )
    return fill(
        StrokeStudy,
        lift=1e-4,
        switch_off=None,
        versions={"numpy": "2.0"},
        stage_times={"mesh": 0.5},
        variants={"wet": variant, "dry": replace(variant, name="dry", wet=False)},
        channels=fill(
            StrokeChannels,
            **dict.fromkeys(("voltage", "current", "magnetic_force", "flows"), ("coil x",)),
            pressures=("sac pressure", "inlet pressure"),
        ),
        bodies=(fill(BodySummary),),
        stops=(fill(StopSummary), fill(StopSummary, name="opening", share=np.empty(0))),
        fluid=fill(FluidSummary),
        lines=(fill(LineSummary),),
        warnings=("one",),
    )


def assert_same(one: Any, other: Any) -> None:
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    elif is_dataclass(one):
        assert type(one) is type(other)
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, Mapping):
        assert list(one) == list(other)
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    else:
        assert one == other or (one != one and other != other)


def test_a_study_comes_back_whole(study: StrokeStudy, tmp_path: Path):
    STROKE.save(study, tmp_path)

    assert_same(STROKE.load(tmp_path), study)


def test_a_dry_valve_has_no_fluid(study: StrokeStudy, tmp_path: Path):
    STROKE.save(replace(study, fluid=None, lines=()), tmp_path)

    assert STROKE.load(tmp_path).fluid is None


def test_nan_of_an_earlier_version_is_none(study: StrokeStudy, tmp_path: Path):
    nan = float("nan")
    STROKE.save(replace(study, lift=nan, switch_off=nan), tmp_path)

    found = STROKE.load(tmp_path)

    assert found.lift is None
    assert found.switch_off is None


def test_any_zarr_reader_finds_channels_with_their_unit(study: StrokeStudy, tmp_path: Path):
    path = STROKE.save(study, tmp_path)

    channel = zarr.open_group(path)["study/variants/wet/result/channels/sac pressure"]

    assert channel.attrs["values"]["unit"] == "Pa"
    np.testing.assert_array_equal(channel["values"][...], np.full(5, 1.013e5))


def test_the_two_kinds_of_studies_are_told_apart(study: StrokeStudy, tmp_path: Path):
    STROKE.save(study, tmp_path)

    assert stored_format(tmp_path) == STROKE.form.name
    with pytest.raises(InputError, match="klack impact"):
        IMPACT.load(tmp_path)


def test_events_and_reference_are_found(study: StrokeStudy):
    wet = study.variants["wet"]

    assert study.reference is wet
    assert [event.time for event in wet.impacts("seat")] == [6e-4]
    assert wet.impacts("seat", slowest=1e3) == ()
    assert wet.channel("no such") is None


def assert_same_study(a: object, b: object, where: str = "study") -> None:
    """Equal to the last bit, arrays also in shape and kind of number."""
    if is_dataclass(a):
        assert type(a) is type(b), where
        for field in fields(a):
            assert_same_study(
                getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}"
            )
    elif isinstance(a, np.ndarray):
        assert isinstance(b, np.ndarray), where
        assert a.dtype == b.dtype, where
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif isinstance(a, dict):
        assert list(a) == list(b), where
        for key in a:
            assert_same_study(a[key], b[key], f"{where}[{key!r}]")
    elif isinstance(a, tuple):
        assert len(a) == len(b), where
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            assert_same_study(one, other, f"{where}[{i}]")
    else:
        assert a == b or (a != a and b != b), where


def test_a_study_comes_back_to_the_last_bit(impact_study: ImpactStudy, tmp_path: Path) -> None:
    assert IMPACT.save(impact_study, tmp_path) == tmp_path / RESULT_NAME

    assert_same_study(IMPACT.load(tmp_path), impact_study)
    assert_same_study(IMPACT.load(tmp_path / RESULT_NAME), impact_study)
    assert [path.name for path in tmp_path.iterdir()] == [RESULT_NAME]


def test_numbers_that_json_lacks_and_odd_names_come_back(
    lonely_study: ImpactStudy, tmp_path: Path
) -> None:
    """Infinity (mass of a held body), nan (no separation), names with slashes and empty arrays."""
    measures = replace(lonely_study.levels["reduced"].measures, restitution=float("nan"))
    result = replace(lonely_study.levels["reduced"], measures=measures)
    odd = replace(
        lonely_study, title="a/b: <é> 100 %", levels={"reduced/1 §": result}, versions={"a/b": "1"}
    )

    IMPACT.save(odd, tmp_path)

    assert_same_study(IMPACT.load(tmp_path), odd)


def test_arrays_carry_units_for_other_readers(impact_study: ImpactStudy, tmp_path: Path) -> None:
    IMPACT.save(impact_study, tmp_path)

    force = zarr.open_array(tmp_path / RESULT_NAME / "study/levels/full/history/force", mode="r")

    assert force.attrs["unit"] == "N"
    np.testing.assert_array_equal(force[...], impact_study.levels["full"].history.force)


@dataclass(frozen=True)
class Arrays:
    """Kinds of numbers that records have."""

    numbers: dict[str, np.ndarray]


@pytest.mark.parametrize("most", [1, 40, 1 << 24])
def test_arrays_of_several_files_come_back_by_zarr(most: int, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(record_store, "_CHUNK", most)
    x = np.arange(-5.0, 9.0)
    numbers = {
        "double": x,
        "columns": np.asfortranarray(x.reshape(7, 2)),
        "single": x.astype(np.float32).reshape(2, 7),
        "swapped": x.astype(">f8"),
        "complex": (x - 1j * x).reshape(7, 1, 2),
        "true": x > 2.0,
        "short": x.astype(np.int16),
        "byte": x.astype(np.uint8),
        "zero": np.array([0.0, -0.0, np.nan]),
        "none": np.zeros((0, 3)),
        "hollow": np.zeros((3, 0), dtype=np.int64),
    }
    form = RecordFormat(name="arrays", version=1, kind=Arrays, command="none", units={"true": "1"})
    save_record(Arrays(numbers), tmp_path, form)

    stored = zarr.open_group(tmp_path / RESULT_NAME / "study" / "numbers", mode="r")
    assert sorted(stored) == sorted(numbers)
    for name, given in numbers.items():
        assert stored[name].dtype == given.dtype.newbyteorder("<")
        assert stored[name][...].tobytes() == given.astype(given.dtype.newbyteorder("<")).tobytes()
        assert stored[name].shape == given.shape
    del numbers["swapped"]  # comes back in the order of this machine
    with pytest.raises(TypeError, match="an array of"):
        save_record(Arrays({"words": np.array(["a"])}), tmp_path / "words", form)
    save_record(Arrays(numbers), tmp_path, form)
    assert_same_study(load_record(tmp_path, form), Arrays(numbers))


def stored_by_zarr(folder: Path) -> RecordFormat:
    """A record whose array zarr has written in pieces along both axes, as klack once did."""
    form = RecordFormat(name="arrays", version=1, kind=Arrays, command="none", units={})
    x = np.arange(35.0).reshape(7, 5)
    save_record(Arrays({"x": x}), folder, form)
    place = folder / RESULT_NAME / "study" / "numbers"
    marks = dict(zarr.open_array(place / "x", mode="r").attrs)
    shutil.rmtree(place / "x")
    root = zarr.open_group(place, mode="r+")
    root.create_array("x", data=x, chunks=(3, 2), attributes=marks)
    return form


def test_pieces_along_all_axes_are_read_without_zarr(tmp_path: Path, monkeypatch):
    form = stored_by_zarr(tmp_path)
    monkeypatch.setitem(sys.modules, "zarr", None)  # its import fails
    assert np.array_equal(load_record(tmp_path, form).numbers["x"], np.arange(35.0).reshape(7, 5))


@pytest.mark.parametrize(
    ("was", "now"),
    [
        ('"float64"', '"object"'),
        ('"float64"', '"<f8"'),
        ('"little"', '"big"'),
        ('"zstd"', '"gzip"'),
        ("3,2", "4,2"),  # another grid than that of the files
        ("3,2", "3,1"),  # files hold more than a piece
        ("3,2", "300000000,300000"),  # a piece larger than the array
        ("3,2", "0,2"),
        ("7,5", "70000000,50000"),
        ('"zarr_format":3', '"zarr_format":2'),
    ],
)
def test_arrays_of_another_kind_are_refused(was: str, now: str, tmp_path: Path):
    form = stored_by_zarr(tmp_path)
    file = tmp_path / RESULT_NAME / "study" / "numbers" / "x" / "zarr.json"
    text = json.dumps(json.loads(file.read_text()), separators=(",", ":"))
    assert was in text
    file.write_text(text.replace(was, now))
    with pytest.raises(InputError, match="result"):
        load_record(tmp_path, form)


def test_saving_again_replaces_the_result(
    impact_study: ImpactStudy, lonely_study: ImpactStudy, tmp_path: Path
) -> None:
    IMPACT.save(impact_study, tmp_path)
    IMPACT.save(lonely_study, tmp_path)

    assert list(IMPACT.load(tmp_path).levels) == ["reduced"]
    assert [path.name for path in tmp_path.iterdir()] == [RESULT_NAME]


def test_an_interrupted_save_leaves_the_old_result(
    impact_study: ImpactStudy,
    lonely_study: ImpactStudy,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    IMPACT.save(impact_study, tmp_path)

    def interrupt(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(record_store, "_checksum", interrupt)
    with pytest.raises(KeyboardInterrupt):
        IMPACT.save(lonely_study, tmp_path)
    monkeypatch.undo()

    assert list(IMPACT.load(tmp_path).levels) == ["full", "reduced"]
    assert [path.name for path in tmp_path.iterdir()] == [RESULT_NAME]


def test_a_result_exchanged_while_it_is_read_is_read_again(
    impact_study: ImpactStudy,
    lonely_study: ImpactStudy,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No numbers of two results may mix: checksums alone would not see it."""
    IMPACT.save(impact_study, tmp_path)
    usual, times = record_store._load, []

    def exchanged(path: Path, form: record_store.RecordFormat, largest: int) -> object:
        record = usual(path, form, largest)
        if not times:
            IMPACT.save(lonely_study, tmp_path)
        times.append(path)
        return record

    monkeypatch.setattr(record_store, "_load", exchanged)

    assert list(IMPACT.load(tmp_path).levels) == ["reduced"]
    assert len(times) == 2


def test_no_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"folder that does not exist.*\nTry: run"):
        IMPACT.load(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no klack result"):
        IMPACT.load(tmp_path)


def test_a_foreign_store_is_refused(tmp_path: Path) -> None:
    zarr.open_group(tmp_path / RESULT_NAME, mode="w", zarr_format=3)

    with pytest.raises(InputError, match="format None"):
        IMPACT.load(tmp_path)


def test_another_format_version_is_refused(lonely_study: ImpactStudy, tmp_path: Path) -> None:
    IMPACT.save(lonely_study, tmp_path)
    root = zarr.open_group(tmp_path / RESULT_NAME, mode="r+")
    root.attrs["format_version"] = 99

    with pytest.raises(InputError, match="format version 99"):
        IMPACT.load(tmp_path)


FORCE = "study/levels/reduced/history/force"


@pytest.mark.parametrize(
    "lost",
    [
        FORCE,
        f"{FORCE}/c",
        f"{FORCE}/zarr.json",
        "study",
        "study/levels/reduced",
        "study/contact/zarr.json",
        "zarr.json",
    ],
)
def test_a_store_with_a_lost_part_is_refused(
    lost: str, lonely_study: ImpactStudy, tmp_path: Path
) -> None:
    """Zarr itself reads a lost chunk as zeros: only the checksum notices."""
    IMPACT.save(lonely_study, tmp_path)
    path = tmp_path / RESULT_NAME / lost
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()

    with pytest.raises(InputError, match=r"result .*\nTry: (copy|run)"):
        IMPACT.load(tmp_path)


@pytest.mark.parametrize("cut", [f"{FORCE}/c/0", f"{FORCE}/zarr.json", "study/zarr.json"])
def test_a_cut_file_is_refused(cut: str, lonely_study: ImpactStudy, tmp_path: Path) -> None:
    IMPACT.save(lonely_study, tmp_path)
    path = tmp_path / RESULT_NAME / cut
    path.write_bytes(path.read_bytes()[:-20])

    with pytest.raises(InputError, match=r"result .*\nTry: copy"):
        IMPACT.load(tmp_path)
