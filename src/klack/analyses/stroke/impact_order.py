"""Which impact of the list of a stroke a record round the ring belongs to."""

from klack.analyses.stroke.record import StrokeVariant
from klack.simulation.network_result import ImpactEvent
from klack.simulation.spatial_impact import SpatialImpact

__all__ = ["recorded_impacts"]


def recorded_impacts(variant: StrokeVariant) -> tuple[tuple[int, ImpactEvent, SpatialImpact], ...]:
    """Impacts of a variant whose contact forces were recorded: number, event, record.

    Numbers count all impacts of the variant from 1, as the table of impacts does.  A touch that is
    no impact, such as a tremble while the stop is left, is not among them.
    """
    found = []
    records = variant.result.spatial_impacts or ()
    for number, event in enumerate(variant.result.events, start=1):
        for record in records:
            if record.stop == event.stop and abs(record.begin - event.time) < _SAME * _first(
                record
            ):
                found.append((number, event, record))
    return tuple(found)


_SAME = 0.5  # of the first interval: an impact of a continued run has the same first touch


def _first(record: SpatialImpact) -> float:
    return float(record.durations[0])
