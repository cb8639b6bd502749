"""Course of a stroke, in one paragraph."""

from math import isfinite

import numpy as np

from klack.analyses.stroke.measures import real_time_factor
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.analyses.stroke.summary import touch_event
from klack.report.wording import quantity, share
from klack.simulation.network_result import ImpactEvent

__all__ = ["largest", "stroke_answer"]


def stroke_answer(study: StrokeStudy) -> str:
    """Opening, closing and the impacts of the reference, and how the other variants differ."""
    variant = study.reference
    times = variant.needle_times
    ways = [_opening(study, variant), _closing(study, variant)]
    if times.starts == "open":
        ways = [f"The {study.needle} starts open.", *ways[::-1]]
    words = [" ".join(ways)]
    words.append(
        f"These numbers come from the variant '{variant.name}' ({variant.label}), "
        f"{quantity(float(variant.result.time[-1] - variant.result.time[0]), 's', 3)} computed in "
        f"{quantity(variant.result.wall_time, 's', 2)}: {real_time_factor(variant):.3g} times the "
        "real time."
    )
    words += [_compared(variant, other) for other in list(study.variants.values())[1:]]
    return " ".join(word for word in words if word)


def largest(variant: StrokeVariant, channels: tuple[str, ...]) -> float:
    """Largest magnitude of some channels over the run; nan if there are none."""
    found = [data for name in channels if (data := variant.channel(name)) is not None]
    return max((float(np.abs(data.values).max(initial=0.0)) for data in found), default=np.nan)


def _opening(study: StrokeStudy, variant: StrokeVariant) -> str:
    passage = variant.needle_times.opening
    stop = study.channels.opening_stop
    event = touch_event(variant, passage)
    if passage.touch is not None and event is not None:
        again = " again" if variant.needle_times.starts == "open" else ""
        return (
            f"The {study.needle} reaches the opening stop{again} after "
            f"{quantity(passage.touch, 's', 4)} {_hit(study, variant, event)}."
        )
    if variant.needle_times.starts == "open":
        if passage.at_90 is not None:
            return f"It is open again, to 90 % of its lift, at {quantity(passage.at_90, 's', 4)}."
        return "It has not opened again at the end of the run."
    lift = variant.channel(study.channels.lift)
    way = float(lift.values.max()) if lift is not None else float("nan")
    end = " and does not reach the opening stop." if stop else "."
    if stop and passage.at_90 is not None:
        end = (
            f", passes 90 % of its lift at {quantity(passage.at_90, 's', 4)} and does not touch "
            "the opening stop."
        )
    return f"The {study.needle} lifts by {quantity(way, 'm', 3)}{end}"


def _closing(study: StrokeStudy, variant: StrokeVariant) -> str:
    seat = study.channels.seat
    passage = variant.needle_times.closing
    if passage.touch is None:
        if passage.at_10 is not None:
            return (
                f"It is closed to 10 % of its lift at {quantity(passage.at_10, 's', 4)} and does "
                "not touch its seat."
            )
        return "It has not closed at the end of the run." if seat else ""
    event = touch_event(variant, passage)
    is_first = variant.needle_times.starts == "open"
    text = f"It {'touches' if is_first else 'is back on'} its seat at "
    text += quantity(passage.touch, "s", 4)
    if study.switch_off is not None and passage.touch > study.switch_off:
        after = quantity(passage.touch - study.switch_off, "s", 3)
        text += f", {after} after the end of the drive"
    if event is None:
        return f"{text}."
    bounces = len(variant.impacts(seat)) - 1
    more = f", and bounces {bounces} times" if bounces > 1 else ""
    return f"{text}, {_hit(study, variant, event)}{more}."


def _hit(study: StrokeStudy, variant: StrokeVariant, event: ImpactEvent) -> str:
    filmed = variant.wet and any(stop.film for stop in study.stops if stop.name == event.stop)
    since = " (the highest since its film force set in)" if filmed else ""
    text = (
        f"with {event.approach_speed:.3g} m/s{since} and a peak force of "
        f"{quantity(event.peak_force, 'N', 3)}"
    )
    if isfinite(event.restitution):
        text += f" (restitution {event.restitution:.3g})"
    return text


def _compared(reference: StrokeVariant, other: StrokeVariant) -> str:
    """Difference of the opening and closing times of another variant."""
    parts = []
    here, there = reference.needle_times, other.needle_times
    for word, one, two in (
        ("opens", here.opening.touch, there.opening.touch),
        ("closes", here.closing.touch, there.closing.touch),
    ):
        if one is not None and two is not None:
            side = "later" if two >= one else "earlier"
            apart = abs(two - one)
            parts.append(f"{word} {quantity(apart, 's', 3)} {side} ({share(apart / one, 1)})")
    return f"Variant '{other.name}' {' and '.join(parts)}." if parts else ""
