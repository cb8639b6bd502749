"""Impacts of a stroke by pair and by body, where several bodies move."""

from collections.abc import Sequence
from dataclasses import dataclass

from klack.analyses.measures import Column, Measure, described_in
from klack.analyses.stroke.record import StrokeVariant
from klack.simulation.network_result import ImpactEvent

__all__ = ["BY_PAIR", "PAIR_MEASURES", "ImpactsOf", "impacts_by_pair"]

BY_PAIR = "impacts by pair and by body"


@dataclass(frozen=True, kw_only=True)
class ImpactsOf:
    """Impacts on one stop, or on all stops of one body; ``lost`` [J] in their contacts."""

    events: Sequence[ImpactEvent]
    lost: float | None


PAIR_MEASURES: tuple[Measure[ImpactsOf], ...] = described_in(
    "theory/stroke",
    Measure(
        key="count",
        name="impacts",
        definition="Impacts on the stop, or on all stops of the body.",
        read=lambda of: len(of.events),
        kind="whole",
        column=Column("", 1.0, "d"),
        page=True,
    ),
    Measure(
        key="first_touch",
        unit="s",
        definition="First touch of the first of them, from the start of the run.",
        read=lambda of: min((event.time for event in of.events), default=None),
        digits=5,
        column=Column("ms", 1e3, ".4f"),
        page=True,
    ),
    Measure(
        key="fastest_touch",
        unit="m/s",
        definition="Highest of their speeds at touch.",
        read=lambda of: max((event.touch_speed for event in of.events), default=None),
        form="fixed",
        column=Column("m/s", 1.0, ".4f"),
        page=True,
    ),
    Measure(
        key="largest_force",
        unit="N",
        definition="Largest of their peak forces.",
        read=lambda of: max((event.peak_force for event in of.events), default=None),
        column=Column("N", 1.0, ".4g"),
        page=True,
    ),
    Measure(
        key="sum_of_impulses",
        unit="N s",
        definition="Sum over all of them.",
        read=lambda of: sum(event.impulse for event in of.events),
        column=Column("mN s", 1e3, ".4g"),
        page=True,
    ),
    Measure(
        key="lost_in_contacts",
        unit="J",
        definition="Energy that the contacts dissipate in the whole run, including friction of "
        "their faces, from the energy balance: also where a single impact has no energy loss.",
        read=lambda of: of.lost,
        digits=3,
        column=Column("uJ", 1e6, ".4g"),
        page=True,
    ),
)


def impacts_by_pair(variant: StrokeVariant) -> tuple[tuple[str, ImpactsOf], ...]:
    """Each stop as "seat: needle on ground", then each body that moves; empty for one body."""
    moving = {body.body for body in variant.moving}
    if len(moving) < 2:
        return ()
    meeting: dict[str, list[str]] = {}
    for force in variant.acting:
        if force.channel == f"{force.component} contact force":
            meeting.setdefault(force.component, []).append(force.body or "ground")
    losses = variant.result.books.losses
    lost = {
        # friction of the faces is in the law of a contact, point by point it is beside it
        stop: sum(losses.get(f"{stop} {part}", 0.0) for part in ("contact", "friction"))
        for stop in meeting
        if stop in variant.result.interfaces
    }
    pairs = {f"{stop}: {' on '.join(meeting[stop])}": [stop] for stop in lost}
    for body in variant.moving:
        pairs[f"all of {body.body}"] = [stop for stop in lost if body.body in meeting[stop]]
    return tuple(
        (
            name,
            ImpactsOf(
                events=[event for event in variant.result.events if event.stop in stops],
                lost=sum(lost[stop] for stop in stops),
            ),
        )
        for name, stops in pairs.items()
        if stops
    )
