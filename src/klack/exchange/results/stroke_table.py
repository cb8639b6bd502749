"""A stroke study as a table: every variant with its channels, end stops, impacts and books."""

import numpy as np

from klack.exchange.results.about import about_study
from klack.exchange.results.table import (
    ResultAxis,
    ResultChannel,
    ResultRun,
    ResultScalar,
    ResultTable,
)
from klack.simulation.network_result import ImpactEvent, InterfaceRecord, NetworkResult
from klack.workflow.stroke_study import StrokeStudy, StrokeVariant
from klack.workflow.stroke_times import LiftTimes

__all__ = ["stroke_table"]

_EVENT = (
    ("approach speed", "m/s", "approach_speed", "of the centres of mass"),
    ("peak force", "N", "peak_force", "contact and film together"),
    ("peak time", "s", "peak_time", "on the time axis"),
    ("contact time", "s", "contact_time", "closed, all contacts of the impact"),
    ("separation time", "s", "separation_time", "on the time axis; missing if it stays closed"),
    ("impulse", "N s", "impulse", "contact and film together"),
    ("restitution", "1", "restitution", "missing without separation"),
    ("energy loss", "J", "energy_loss", "kinetic, of the centre of mass"),
)


def stroke_table(study: StrokeStudy) -> ResultTable:
    """All channels of all variants, the fine record of every end stop, impacts and energy books.

    Parameters
    ----------
    study : StrokeStudy
    """
    own = {
        "reference": study.reference.name,
        "needle": study.needle,
        **_known("lift", study.lift, "m"),
        **_known("switch off", study.switch_off, "s"),
        "lift channel": study.channels.lift,
        "velocity channel": study.channels.velocity,
    }
    if study.fluid is not None:
        own["fluid"] = f"{study.fluid.name} at {study.fluid.temperature!r} K"
    runs = tuple(_variant(item, study.step) for item in study.variants.values())
    return ResultTable(
        kind="stroke", about=about_study(study, own), case_text=study.case_text, runs=runs
    )


def _known(name: str, value: float | None, unit: str) -> dict[str, str]:
    return {} if value is None else {name: f"{value!r} {unit}"}


def _variant(variant: StrokeVariant, step: float) -> ResultRun:
    result = variant.result
    axes = [
        ResultAxis(
            name="time", quantity="time", unit="s", values=result.time, meaning="time of the record"
        )
    ]
    channels = [
        ResultChannel(
            name=name,
            axis="time",
            unit="1" if data.unit in ("", "-") else data.unit,
            values=data.values,
            meaning=name,
        )
        for name, data in result.channels.items()
    ]
    for stop, record in result.interfaces.items():
        if record.time.size:
            axis, values = _interface(stop, record)
            axes.append(axis)
            channels += values
    for stop in dict.fromkeys(event.stop for event in result.events):
        axis, values = _events(stop, [event for event in result.events if event.stop == stop])
        axes.append(axis)
        channels += values
    return ResultRun(
        name=variant.name,
        label=variant.label,
        solver=f"fine step {step:g} s, {variant.modes} modal degrees of freedom",
        axes=tuple(axes),
        channels=tuple(channels),
        scalars=_scalars(variant, result, step),
    )


def _interface(stop: str, record: InterfaceRecord) -> tuple[ResultAxis, list[ResultChannel]]:
    end = "" if record.complete else "; cut off, the record was full"
    axis = ResultAxis(
        name=f"{stop}_time",
        quantity="time",
        unit="s",
        values=record.time,
        meaning=f"start of every fine step in which '{stop}' carries force{end}",
    )
    parts = (
        ("step", "s", record.step, "length of the step"),
        ("fine contact force", "N", record.contact_force, "mean over the step"),
        ("fine film force", "N", record.film_force, "mean over the step; pulls where negative"),
        ("fine gap", "m", record.gap, "at the end of the step; negative where closed"),
    )
    return axis, [
        ResultChannel(
            name=f"{stop} {name}", axis=axis.name, unit=unit, values=values, meaning=meaning
        )
        for name, unit, values, meaning in parts
    ]


def _events(stop: str, events: list[ImpactEvent]) -> tuple[ResultAxis, list[ResultChannel]]:
    axis = ResultAxis(
        name=f"{stop}_impact",
        quantity="time",
        unit="s",
        values=np.array([event.time for event in events]),
        meaning=f"first touch of every impact on '{stop}'",
    )
    return axis, [
        ResultChannel(
            name=f"{stop} impact {name}",
            axis=axis.name,
            unit=unit,
            values=np.array([getattr(event, field) for event in events], dtype=float),
            meaning=meaning,
        )
        for name, unit, field, meaning in _EVENT
    ]


def _times(times: LiftTimes) -> list[tuple[str, str, float, str]]:
    """Moments of the needle that the run reaches."""
    ways = (("opening", times.opening, "the opening stop"), ("closing", times.closing, "the seat"))
    found = [
        entry
        for way, passage, stop in ways
        for entry in (
            (f"{way} time", passage.touch, f"first touch of {passage.stop or stop}"),
            (f"{way} time at 10 percent", passage.at_10, "of the lift"),
            (f"{way} time at 50 percent", passage.at_50, "of the lift"),
            (f"{way} time at 90 percent", passage.at_90, "of the lift"),
        )
    ]
    return [(name, "s", time, meaning) for name, time, meaning in found if time is not None]


def _scalars(
    variant: StrokeVariant, result: NetworkResult, step: float
) -> tuple[ResultScalar, ...]:
    books = result.books
    numbers = [
        *_times(variant.needle_times),
        ("complete", "1", not result.failure, "1 if the run came to its end"),
        ("impacts", "1", len(result.events), "on all stops"),
        ("energy residual", "1", books.relative_residual, "share of the throughput"),
        ("energy throughput", "J", books.throughput, "scale of the residual"),
        ("degrees of freedom", "1", variant.modes, "of all bodies"),
        ("fine steps", "1", result.fine_steps, "of the time integration"),
        ("coarse steps", "1", result.coarse_steps, "of the time integration"),
        ("step", "s", step, "fine step"),
        ("wall time", "s", result.wall_time, "of the time loop"),
        ("setup time", "s", variant.setup_time, "of everything before it"),
    ]
    kinds = {
        "supplied": books.supplies,
        "lost": books.losses,
        "stored before": books.stores_before,
        "stored after": books.stores_after,
    }
    for kind, entries in kinds.items():
        numbers += [(f"energy {kind} {key}", "J", value, "books") for key, value in entries.items()]
    return tuple(
        ResultScalar(name=name, unit=unit, value=float(value), meaning=meaning)
        for name, unit, value, meaning in numbers
    )
