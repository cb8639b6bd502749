"""Animated film pressure at first impacts."""

import numpy as np
from numpy.typing import NDArray

from klack.analyses.stroke.record import StrokeVariant
from klack.report.chart import RingFrames
from klack.report.wording import quantity
from klack.simulation.film_sectors import sector_pressure
from klack.simulation.network_result import ImpactEvent
from klack.simulation.spatial_impact import SpatialImpact

__all__ = ["film_charts", "recorded_impacts"]


def recorded_impacts(variant: StrokeVariant) -> tuple[tuple[int, ImpactEvent, SpatialImpact], ...]:
    """Impacts of a variant whose contact forces were recorded: number, event, record.

    Numbers count all impacts of the variant from 1, as the table of impacts does, without touches
    that are no impact, such as a tremble while the stop is left.
    """
    return tuple(
        (number, event, record)
        for number, event in enumerate(variant.result.events, start=1)
        for record in variant.result.spatial_impacts or ()
        if record.stop == event.stop
        and abs(record.begin - event.time) < _SAME * float(record.durations[0])
    )


_SAME = 0.5  # of the first interval: an impact of a continued run has the same first touch


Floats = NDArray[np.float64]

_CHARTS, _FRAMES = 4, 40
_BAR = 1e5  # [Pa]
_EVEN = 0.4  # share of the frames that are spread evenly over time
_FELT = 0.1  # [bar] of some sector, from the first frame to the last


def film_charts(variant: StrokeVariant) -> tuple[RingFrames, ...]:
    """Animations of first impacts with a film in sectors."""
    found = [item for item in recorded_impacts(variant) if item[2].film is not None]
    charts = [_chart(variant, *item, left=len(found) - _CHARTS) for item in found[:_CHARTS]]
    return tuple(chart for chart in charts if chart is not None)


def _chart(
    variant: StrokeVariant, number: int, event: ImpactEvent, record: SpatialImpact, *, left: int
) -> RingFrames | None:
    film = record.film
    if film is None or len(film.time) < 2:
        return None
    every = sector_pressure(film)
    at = _moments(every.time, every.pressure / _BAR)
    forces = film.film_force[at]
    more = f" {left} further impacts are left out." if left > 0 else ""
    return RingFrames(
        name=f"film-{variant.name}-{number}",
        title=f"Pressure in the film of '{event.stop}', {variant.name}, impact {number}",
        label="pressure above ambient",
        unit="bar",
        time=1e6 * (every.time[at] - record.begin),
        time_unit="µs",
        values=every.pressure[at] / _BAR,
        marked=every.cavitates[at],
        mark="cavitates",
        captions=tuple(quantity(float(force), "N", 3) for force in forces),
        prefix="since first touch: ",
        note=(
            f"Mean pressure of each of {film.land.sectors} sectors of the film of '{event.stop}' "
            f"in impact {number} of '{variant.name}', at {quantity(event.time, 's', 4)}; seen "
            "from above, +x to the right, the ring wider than it is. Colours are linear up to 1 "
            "bar and logarithmic beyond. Grey: at the largest tension, where the film "
            "cavitates. Each frame states the time since first touch and the force of the film. "
            f"{len(at)} of {len(film.time)} recorded time steps, closer where the pressure "
            f"changes fast; ten of them in print.{more}"
        ),
    )


def _moments(time: Floats, pressure: Floats) -> NDArray[np.int64]:
    """Places of frames, while the film acts: even in time and in change of colours."""
    felt = np.flatnonzero(np.abs(pressure).max(axis=1) > _FELT)
    first, last = (int(felt[0]), int(felt[-1]) + 1) if len(felt) > 1 else (0, len(time))
    time, colour = time[first:last], np.arcsinh(pressure[first:last])
    changed = np.abs(np.diff(colour, axis=0)).mean(axis=1)
    passed = np.diff(time)
    share = _EVEN * passed / passed.sum()
    if changed.sum() > 0.0:
        share = share + (1.0 - _EVEN) * changed / changed.sum()
    way = np.concatenate([[0.0], np.cumsum(share / share.sum())])
    found = np.searchsorted(way, np.linspace(0.0, 1.0, _FRAMES) - 1e-12)
    peak = int(np.argmax(colour.max(axis=1)))
    found = np.unique(np.append(np.clip(found, 0, len(time) - 1), peak))
    return (first + found).astype(np.int64)
