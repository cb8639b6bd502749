"""A stroke study as a table: every variant with its channels, end stops, impacts and books."""

from math import isfinite

import numpy as np

from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.exchange.results.about import about_study
from klack.exchange.results.scalars import measure_scalar
from klack.exchange.results.table import (
    ResultAxis,
    ResultChannel,
    ResultRun,
    ResultScalar,
    ResultTable,
)
from klack.simulation.network_result import ImpactEvent, InterfaceRecord

__all__ = ["stroke_table"]


def stroke_table(study: StrokeStudy) -> ResultTable:
    """All channels of all variants, the fine record of every end stop, impacts and energy balance.

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
        kind="stroke",
        about=about_study(study, own, study.bodies),
        case_text=study.case_text,
        runs=runs,
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
        scalars=_scalars(variant),
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
            name=f"{stop} impact {measure.name}",
            axis=axis.name,
            unit=measure.unit,
            values=np.array([measure.read(event) for event in events], dtype=float),
            meaning=measure.definition,
        )
        for measure in EVENT_MEASURES
        if measure.key != "time"  # the axis
    ]


def _scalars(variant: StrokeVariant) -> tuple[ResultScalar, ...]:
    books = variant.result.books
    kinds = {
        "supplied": books.supplies,
        "lost": books.losses,
        "stored before": books.stores_before,
        "stored after": books.stores_after,
    }
    measured = (measure_scalar(measure, variant) for measure in VARIANT_MEASURES)
    return (
        *(scalar for scalar in measured if isfinite(scalar.value)),
        *(
            ResultScalar(
                name=f"energy {kind} {key}", unit="J", value=float(value), meaning="energy balance"
            )
            for kind, entries in kinds.items()
            for key, value in entries.items()
        ),
    )
