"""An impact study as a table: every level with its history, its numbers and its modes."""

import numpy as np

from klack.analyses.impact.measures import LEVEL_MEASURES
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.contact.history import ImpactHistory
from klack.exchange.results.about import about_study
from klack.exchange.results.scalars import measure_scalar
from klack.exchange.results.table import (
    ResultAxis,
    ResultChannel,
    ResultRun,
    ResultScalar,
    ResultTable,
)
from klack.reduction.transfer import TransferComparison

__all__ = ["impact_table"]

_MEAN = "mean over the interval around that time"


def impact_table(study: ImpactStudy) -> ResultTable:
    """Time histories of all levels, numbers of the impact, modal energies, transfer functions.

    Pressure fields and pictures of the study are left out: they are no curves.

    Parameters
    ----------
    study : ImpactStudy
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
        *(measure_scalar(measure, level) for measure in LEVEL_MEASURES),
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
