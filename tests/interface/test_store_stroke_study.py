"""A stroke study on disk: truth = the study itself, and what a foreign reader finds."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.store import stored_format
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
