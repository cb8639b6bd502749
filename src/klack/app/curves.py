"""Curves with as many points as a screen shows, and the numbers beside them."""

import numpy as np

from klack.analyses.impact.measures import CONTACT_TIME, PEAK_FORCE, RESTITUTION
from klack.analyses.impact.record import LevelResult
from klack.analyses.measures import json_of
from klack.analyses.stroke.analysis import first_impact
from klack.analyses.stroke.record import StrokeChannels, StrokeVariant
from klack.app.answers import Floats, Number
from klack.contact.history import ImpactHistory
from klack.signals import TimeSeries

__all__ = ["drawn", "enveloped", "impact_numbers", "stroke_numbers", "travelled"]

_DRAWN = 700  # points of a curve; a chart is up to 800 pixels wide


def drawn(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Points of a smooth curve in equal steps, with its ends and its highest and lowest point."""
    steps = np.linspace(0, x.size - 1, min(x.size, _DRAWN)).round().astype(int)
    shown = np.union1d(steps, [y.argmin(), y.argmax()])
    return x[shown], y[shown]


def travelled(history: ImpactHistory) -> tuple[Floats, Floats]:
    """Displacement of the centre of mass of the moving body since the start, up is positive.

    The integral of its velocity, which every level records.
    """
    mean = 0.5 * (history.velocity_a[1:] + history.velocity_a[:-1])
    return history.edges, np.append(0.0, np.cumsum(mean) * history.step)


def enveloped(force: TimeSeries) -> tuple[Floats, Floats]:
    """Lowest and highest value of each stretch: no impact falls between two points."""
    count = _DRAWN // 2
    size = max(1, -(-force.values.size // count))
    padded = np.pad(force.values, (0, -force.values.size % size), mode="edge").reshape(-1, size)
    at = force.start + force.step * size * (np.arange(padded.shape[0]) + 0.5)
    return np.repeat(at, 2), np.column_stack([padded.min(axis=1), padded.max(axis=1)]).ravel()


def impact_numbers(level: LevelResult) -> tuple[Number, ...]:
    """Of an impact; what a run that is cut off in contact does not have has no value."""
    return tuple(
        Number(
            key=measure.key,
            name=measure.name + measure.remark(level),
            unit=unit,
            value=None if value is None else scale * value,
            difference=difference,
        )
        for measure, unit, scale, difference in (
            (PEAK_FORCE, "N", 1.0, "%"),
            (CONTACT_TIME, "us", 1e6, "us"),
            (RESTITUTION, "", 1.0, "1"),
        )
        for value in json_of([measure], level).values()
    )


def stroke_numbers(variant: StrokeVariant, channels: StrokeChannels) -> tuple[Number, ...]:
    """Of a stroke: its times, and the first impact on each stop."""
    times = (
        ("opening", "opening time", variant.opening_time),
        ("closing", "closing time", variant.closing_time),
    )
    stops = [name for name in (channels.opening_stop, channels.seat) if name]
    firsts = [(stop, first_impact(variant, stop)) for stop in stops]
    return (
        *(
            Number(
                key=key,
                name=name,
                unit="us",
                value=None if value is None else 1e6 * value,
                difference="us",
            )
            for key, name, value in times
        ),
        *(
            Number(
                key=f"peak_{stop}",
                name=f"first peak, {stop}",
                unit="N",
                value=None if event is None else event.peak_force,
            )
            for stop, event in firsts
        ),
    )
