"""Results of impacts and strokes as one table of runs."""

from collections.abc import Iterable, Mapping
from math import isfinite
from typing import TypeVar

import numpy as np

from klack.analyses.impact.measures import measures_of
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.analyses.measures import Measure
from klack.analyses.noise.record import NoiseStudy
from klack.analyses.record import CaseRecord
from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.assembling.body_summary import BodySummary
from klack.bodies.reduction.transfer import TransferComparison
from klack.contact.history import ImpactHistory
from klack.exchange.results.table import (
    ResultAxis,
    ResultChannel,
    ResultRun,
    ResultScalar,
    ResultTable,
)
from klack.simulation.network_result import ImpactEvent, InterfaceRecord

__all__ = ["about_study", "result_table", "stroke_table"]


def about_study(
    study: CaseRecord | NoiseStudy, own: Mapping[str, str], bodies: Iterable[BodySummary] = ()
) -> dict[str, str]:
    """Case, versions, date and meshes of bodies, with the study's own lines between."""
    about = {
        "case": study.case,
        "title": study.title,
        "description": study.description,
        "klack": study.version,
        "created": study.created,
        "libraries": ", ".join(f"{name} {number}" for name, number in study.versions.items()),
        **own,
    }
    for body in bodies:
        about[f"mesh of {body.name}"] = (
            f"{body.model}, {body.nodes} nodes, {body.elements} elements, {body.dofs} degrees of "
            f"freedom, {body.mass!r} kg, {body.support}"
        )
    if study.warnings:
        about["warnings"] = " ".join(study.warnings)
    return about


Of = TypeVar("Of")


def measure_scalar(measure: Measure[Of], of: Of) -> ResultScalar:
    """Name, unit, value (or nan) and definition of a measure."""
    value = measure.read(of)
    return ResultScalar(
        name=measure.name,
        unit=measure.unit,
        value=float("nan") if value is None else float(value),
        meaning=measure.definition,
    )


_MEAN = "mean over the interval around that time"


def impact_table(study: ImpactStudy) -> ResultTable:
    """Histories of all levels, numbers of the impact, modal energies, transfer functions.

    Without pressure fields and pictures.
    """
    about = about_study(
        study,
        {
            "impact speed": f"{study.speed!r} m/s",
            "gap": f"{study.gap!r} m",
            "contact": study.contact.surfaces,
            "reference": study.reference,
        },
        study.bodies,
    )
    runs = [_level(level) for level in study.ordered]
    runs += [_transfer(item) for item in study.transfer]
    return ResultTable(kind="impact", about=about, case_text=study.case_text, runs=tuple(runs))


def _level(level: LevelResult) -> ResultRun:
    history = level.history
    axes = [
        ResultAxis(
            name="time",
            quantity="time",
            unit="s",
            values=history.time,
            meaning="middle of each recorded interval",
        ),
        ResultAxis(
            name="time_edge",
            quantity="time",
            unit="s",
            values=history.edges,
            meaning="ends of the recorded intervals",
        ),
    ]
    channels = _history(history)
    for record in level.gauges:
        channels.append(
            ResultChannel(
                name=f"output {record.name}",
                axis="time_edge",
                unit=record.unit,
                values=record.values,
                meaning=record.label,
            )
        )
    for item in level.modal_energy:
        axis = f"frequency_{item.body}"
        order = np.argsort(item.frequency, kind="stable")
        frequency = item.frequency[order]
        if frequency.size == 0 or np.any(np.diff(frequency) <= 0.0):
            continue  # pairs of equal modes of a round body have no order
        axes.append(
            ResultAxis(
                name=axis,
                quantity="frequency",
                unit="Hz",
                values=frequency,
                meaning=f"eigenfrequencies of {item.body}",
            )
        )
        channels.append(
            ResultChannel(
                name=f"{item.body} modal energy",
                axis=axis,
                unit="J",
                values=item.energy[order],
                meaning="kinetic and strain energy of each mode after the impact",
            )
        )
    return ResultRun(
        name=level.level,
        label=level.label,
        solver=history.solver,
        axes=tuple(axes),
        channels=tuple(channels),
        scalars=_scalars(level),
    )


def _history(history: ImpactHistory) -> list[ResultChannel]:
    names = [body.name for body in history.ledger.bodies]
    a, b = (*names, "a", "opposite")[:2] if names else ("a", "b")
    parts = [
        ("contact force", "N", history.force, f"{_MEAN}; pushes {a} in +z"),
        ("interval peak force", "N", history.peak_force, "largest of any step within the interval"),
        ("gap", "m", history.gap, f"{_MEAN}; negative where closed"),
        ("external force", "N", history.external_force, f"{_MEAN}; on {a} along +z"),
        (f"{a} velocity", "m/s", history.velocity_a, "centre of mass, along +z"),
        (f"{b} velocity", "m/s", history.velocity_b, "centre of mass, along +z"),
        (f"{a} displacement", "m", history.displacement_a, "contact port, along +z"),
        (f"{b} displacement", "m", history.displacement_b, "contact port, along +z"),
    ]
    at_edges = history.edges.size
    return [
        ResultChannel(
            name=name,
            axis="time_edge" if values.size == at_edges else "time",
            unit=unit,
            values=values,
            meaning=meaning,
        )
        for name, unit, values, meaning in parts
        if values.size
    ]


def _scalars(level: LevelResult) -> tuple[ResultScalar, ...]:
    return (
        *(measure_scalar(measure, level) for measure in measures_of(level)),
        *(
            ResultScalar(name=f"energy {key}", unit="J", value=float(value), meaning="ledger")
            for key, value in level.energies.items()
        ),
    )


def _transfer(item: TransferComparison) -> ResultRun:
    axis = ResultAxis(
        name="frequency",
        quantity="frequency",
        unit="Hz",
        values=np.asarray(item.frequencies, dtype=float),
        meaning="excitation frequency",
    )
    channels, scalars = [], []
    for k, label in enumerate(item.labels):
        for part, values in (("real", item.curves[k].real), ("imaginary", item.curves[k].imag)):
            channels.append(
                ResultChannel(
                    name=f"{label} {part}",
                    axis="frequency",
                    unit="m/N",
                    values=np.ascontiguousarray(values),
                    meaning=f"{part} part of the receptance",
                )
            )
        scalars.append(
            ResultScalar(
                name=f"{label} valid up to",
                unit="Hz",
                value=float(item.valid_up_to[k]),
                meaning=f"within {item.tolerance:g} dB of the first curve",
            )
        )
    return ResultRun(
        name=f"transfer-{item.body}",
        label=f"receptance of {item.body} at {item.port}, loss factor {item.loss_factor:g}",
        solver=item.reference_note,
        axes=(axis,),
        channels=tuple(channels),
        scalars=tuple(scalars),
    )


def stroke_table(study: StrokeStudy) -> ResultTable:
    """Channels of all variants, records of end stops, impacts, energy balance."""
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
        scalars=_stroke_scalars(variant),
    )


def _interface(stop: str, record: InterfaceRecord) -> tuple[ResultAxis, list[ResultChannel]]:
    end = "" if record.complete else "; truncated because the record was full"
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


def _stroke_scalars(variant: StrokeVariant) -> tuple[ResultScalar, ...]:
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


def result_table(study: ImpactStudy | StrokeStudy) -> ResultTable:
    """Every curve and number of a study, computed or loaded, with units and what made them."""
    if isinstance(study, ImpactStudy):
        return impact_table(study)
    return stroke_table(study)
