"""Contact forces point by point, reduced to the needs of a picture."""

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.record import FrictionRecord, PressureRecord
from klack.contact.history import ImpactHistory
from klack.contact.restitution import measure_impact

__all__ = ["pressure_record"]

_INSTANTS = 120


def pressure_record(
    history: ImpactHistory,
    point_force: NDArray[np.float32],
    points: NDArray[np.float64],
    area: NDArray[np.float64],
    friction: FrictionRecord | None = None,
) -> PressureRecord | None:
    """Contact forces of all points over the first impact, thinned to a hundred instants or so.

    ``friction`` is that of every step of the history, as ``point_force`` is.
    """
    if not len(point_force):
        return None
    measures = measure_impact(history)
    first = int((measures.first_touch - history.start) / history.step)
    last = int((measures.first_touch + measures.total_contact_time - history.start) / history.step)
    last = min(last + 2, len(point_force))
    every = max(1, (last - first) // _INSTANTS)
    chosen = slice(max(first, 0), last, every)
    return PressureRecord(
        time=history.time[chosen],
        points=points,
        area=area,
        point_force=np.ascontiguousarray(point_force[chosen]),
        friction=None
        if friction is None
        else FrictionRecord(
            force=np.ascontiguousarray(friction.force[chosen]),
            doing=np.ascontiguousarray(friction.doing[chosen]),
            coefficient=friction.coefficient,
        ),
    )
