"""Answers of many strokes, in sentences."""

from collections.abc import Callable, Iterator

import numpy as np

from klack.analyses.stroke_shots.record import HighestRebound, StrokeShotsStudy, highest_rebound
from klack.analyses.stroke_shots.scatter import Scattered, scatter_ratio, scattered, wet_and_dry
from klack.units import format_si

__all__ = [
    "Told",
    "highest_answers",
    "ratio_answers",
    "scatter_answers",
    "stroke_answers",
    "told_value",
]

Told = Callable[[float, str, int], str]

_ANSWERED = ("peak_force", "rebound_height", "contact_time")
_RATIOS = ("peak_force", "rebound_height", "injected_energy")


def told_value(value: float, unit: str, digits: int = 4) -> str:
    """A value in a sentence or a table of a terminal; a dash where there is none."""
    if not np.isfinite(value):
        return "–"
    return format_si(value, unit, digits) if unit != "1" else f"{value:.4f}"


def stroke_answers(study: StrokeShotsStudy, told: Told = told_value) -> Iterator[str]:
    """Scatter of each variant, wet against dry, and the highest rebound from each stop.

    Parameters
    ----------
    study : StrokeShotsStudy
    told : callable
        Writes a value with its unit and so many digits.
    """
    yield from scatter_answers(study, told)
    yield from ratio_answers(study)
    yield from highest_answers(study, told)


def scatter_answers(study: StrokeShotsStudy, told: Told) -> Iterator[str]:
    """Mean and standard deviation of the first impact on each stop."""
    for name, shots in study.variants.items():
        for stop in shots.stops:
            text = _scatter(stop, scattered(shots), told)
            if text:
                yield f"{name}, '{stop}': {text}"


def ratio_answers(study: StrokeShotsStudy) -> Iterator[str]:
    """Standard deviations wet over dry, of the main measures."""
    for wet, dry in wet_and_dry(study).values():
        if wet.measure.key in _RATIOS:
            text = _ratio(wet, dry, carry=study.carry)
            if text:
                yield text


def highest_answers(study: StrokeShotsStudy, told: Told) -> Iterator[str]:
    """Whether the highest rebound from each stop is that of the most centred stroke."""
    for name, shots in study.variants.items():
        for stop in shots.stops:
            found = highest_rebound(shots, stop)
            if found is not None:
                yield f"{name}, '{stop}': {_highest(found, told)}"


def _scatter(stop: str, items: tuple[Scattered, ...], told: Told) -> str:
    parts = []
    for item in items:
        known = item.values[np.isfinite(item.values)]
        if item.stop == stop and item.measure.key in _ANSWERED and known.size > 1:
            mean, deviation = float(np.mean(known)), float(np.std(known))
            share = f" ({100.0 * deviation / mean:.2g} %)" if mean > 0.0 else ""
            unit = item.measure.unit
            parts.append(
                f"{item.measure.name} {told(mean, unit, 4)} with a standard deviation of "
                f"{told(deviation, unit, 3)}{share}"
            )
    return f"{'; '.join(parts)}." if parts else ""


def _ratio(wet: Scattered, dry: Scattered, *, carry: bool) -> str:
    found = scatter_ratio(wet.values, dry.values)
    if not np.isfinite(found.ratio):
        return ""
    at = f" at '{wet.stop}'" if wet.stop else ""
    within = ""
    if np.isfinite(found.low):
        within = f" (95 % interval {100.0 * found.low:.3g} to {100.0 * found.high:.3g} %)"
    return (
        f"The scatter of the {wet.measure.name}{at} wet is {100.0 * found.ratio:.3g} % of dry"
        f"{within}, over {found.pairs} strokes {'of each row' if carry else 'with the same draws'}."
    )


def _highest(found: HighestRebound, told: Told) -> str:
    text = (
        f"the highest of {found.count} rebounds is stroke {found.stroke}, "
        f"{told(found.rebound_height, 'm', 4)}, eccentricity at touch "
        f"{told(found.eccentricity, 'm', 3)}: "
    )
    if found.is_most_centred:
        text += "the most centred one."
    else:
        text += (
            f"the {_ordinal(found.place)} most centred, not the most centred one, which is stroke "
            f"{found.most_centred} with {told(found.most_centred_height, 'm', 4)} at "
            f"{told(found.most_centred_eccentricity, 'm', 3)}."
        )
    if np.isfinite(found.relative_height_bias):
        text += (
            f" The stroke that starts centred has {told(found.centred_height, 'm', 4)}: the "
            f"highest is {100.0 * found.relative_height_bias:+.2f} % off, its restitution "
            f"{found.restitution_bias:+.4f}."
        )
    return text


def _ordinal(number: int) -> str:
    """Number in an order.

    >>> [_ordinal(n) for n in (1, 2, 3, 4, 11, 22)]
    ['1st', '2nd', '3rd', '4th', '11th', '22nd']
    """
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if 10 < number % 100 < 14 else ending}"
