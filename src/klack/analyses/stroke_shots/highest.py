"""The stroke with the highest rebound, and whether it is the most centred one."""

from dataclasses import dataclass

import numpy as np

from klack.analyses.stroke_shots.record import VariantShots

__all__ = ["HighestRebound", "highest_rebound"]


@dataclass(frozen=True, slots=True)
class HighestRebound:
    """Highest rebound from one stop, against the most centred stroke and the centred one.

    Parameters
    ----------
    stroke : int
        Its number.
    rebound_height, eccentricity : float [m]
        Its own; the eccentricity is that at first touch.
    place : int
        In the order of that eccentricity; 1 is the most centred.
    count : int
        Strokes with a rebound.
    most_centred : int
        Number of the most centred stroke among them.
    most_centred_height, most_centred_eccentricity : float [m]
    centred_height : float [m]
        Of the stroke that starts centred.
    relative_height_bias : float [-]
        Highest rebound over that, minus 1.
    restitution_bias : float [-]
        Restitution minus that of the stroke that starts centred.
    """

    stroke: int
    rebound_height: float
    eccentricity: float
    place: int
    count: int
    most_centred: int
    most_centred_height: float
    most_centred_eccentricity: float
    centred_height: float
    relative_height_bias: float
    restitution_bias: float

    @property
    def is_most_centred(self) -> bool:
        """Whether the highest rebound is that of the most centred stroke."""
        return self.stroke == self.most_centred


def highest_rebound(shots: VariantShots, stop: str) -> HighestRebound | None:
    """Find the highest rebound of all strokes of a variant; None where no stroke has one."""
    columns, alone = shots.stops[stop], shots.centric_stops[stop]
    height, off = columns.rebound_height, columns.eccentricity
    known = np.flatnonzero(np.isfinite(height) & np.isfinite(off))
    if not known.size or not np.any(height[known] > 0.0):
        return None
    best = int(known[np.argmax(height[known])])
    centred = int(known[np.argmin(off[known])])
    middle = float(alone.rebound_height[0])
    return HighestRebound(
        stroke=best,
        rebound_height=float(height[best]),
        eccentricity=float(off[best]),
        place=1 + int(np.sum(off[known] < off[best])),
        count=int(known.size),
        most_centred=centred,
        most_centred_height=float(height[centred]),
        most_centred_eccentricity=float(off[centred]),
        centred_height=middle,
        relative_height_bias=float(height[best]) / middle - 1.0 if middle > 0.0 else float("nan"),
        restitution_bias=float(columns.restitution[best] - alone.restitution[0]),
    )
