"""Angles of its rings that a contact of half sections carries on at the peak of an impact."""

import warnings
from dataclasses import dataclass, field
from math import ceil

import numpy as np
from numpy.typing import NDArray

from klack.errors import AccuracyWarning

__all__ = ["FEWEST_ANGLES", "ArcWatch", "RingArcs"]

FEWEST_ANGLES = 8
"""Angles that have to carry: with 5 of them the peak force is off by 1 %, with 9 by 0.1 %."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingArcs:
    """Angles of the contact points of the stops of a valve.

    Parameters
    ----------
    count
        Angles of every ring.
    turn
        Number of the angle of each point, by stop.
    weakest [N]
        Lower peaks on each stop are not judged.
    """

    count: int
    stops: tuple[str, ...]
    turn: tuple[NDArray[np.int64], ...]
    weakest: tuple[float, ...]


@dataclass(slots=True, eq=False)
class ArcWatch:
    """Checks the contacts of one run, and warns once for each stop."""

    arcs: RingArcs
    peak: dict[int, float] = field(default_factory=dict)
    angles: dict[int, int] = field(default_factory=dict)
    told: set[int] = field(default_factory=set)

    def see(self, stop: int, force: float, carried: NDArray[np.float64]) -> None:
        """Check a stop after a step; warn after an impact whose peak force few angles carried.

        Parameters
        ----------
        stop
            Its number.
        force [N]
            Axial.
        carried (n,) [N]
            At its points.
        """
        if force > self.peak.get(stop, 0.0):
            turns = self.arcs.turn[stop][carried > 0.0]
            self.peak[stop], self.angles[stop] = force, len(np.unique(turns))
        elif force <= 0.0 and stop in self.peak:
            self._judge(stop, self.peak.pop(stop), self.angles.pop(stop))

    def _judge(self, stop: int, peak: float, angles: int) -> None:
        arcs = self.arcs
        few = 0 < angles < FEWEST_ANGLES and peak >= arcs.weakest[stop]
        if few and stop not in self.told:
            self.told.add(stop)
            warnings.warn(
                f"the contact at '{arcs.stops[stop]}' is so short that only {angles} of "
                f"{arcs.count} angles of its rings carry load at {peak:.3g} N, the peak of an "
                f"impact; {FEWEST_ANGLES} or more are needed. Try: angles: "
                f"{ceil(arcs.count * FEWEST_ANGLES / angles)}.",
                AccuracyWarning,
                stacklevel=2,
            )
