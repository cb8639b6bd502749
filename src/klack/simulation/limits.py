"""Ranges of laws while a network runs: a departure is warned of once, a gross one stops the run.

Only records are looked at, not steps: an excursion shorter than a record may be missed.
"""

import warnings
from collections.abc import Iterator

import numpy as np

from klack.arrays import Matrix, Vector
from klack.errors import AccuracyWarning, ConvergenceError
from klack.network.ranges import limits_of, range_text, value_text
from klack.network.rows import LimitRow
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_record import extremes
from klack.units import format_si

__all__ = ["Limits"]


class Limits:
    """Watches all ranges of a network.

    Parameters
    ----------
    columns
        Names of the recorded columns: see :func:`klack.simulation.network_record.record_points`.
    """

    def __init__(self, network: CompiledNetwork, columns: list[str]) -> None:
        self._told: set[str] = set()
        ports = len(network.ports)
        self._limits = limits_of(network.rows)
        self._weights = np.zeros((len(self._limits), len(columns)))
        for limit, weights in zip(self._limits, self._weights, strict=True):
            for handle, factor in limit.ports:
                place = network.port_of[handle]
                if place < ports:  # the last one is the ground
                    weights[place] += factor
            if limit.node is not None:
                component = network.rows.nodes[limit.node].component
                weights[columns.index(f"{component} pressure")] = 1.0
            if limit.channel:
                weights[columns.index(limit.channel)] = 1.0
        self._start = np.array([limit.start for limit in self._limits])
        self._usable = np.array([limit.usable for limit in self._limits]).reshape(-1, 2)
        slack = np.array([(-limit.slack, limit.slack) for limit in self._limits]).reshape(-1, 2)
        self._valid = slack + np.array([limit.valid for limit in self._limits]).reshape(-1, 2)

    def left(self, points: Matrix, time: Vector) -> tuple[int, ConvergenceError] | None:
        """First record in which a quantity has left what can be computed with, and the error."""
        found: tuple[int, ConvergenceError] | None = None
        for k, values in self._near(points, self._usable):
            low, high = self._usable[k]
            gone = np.flatnonzero((values <= low) | (values > high))
            if gone.size and (found is None or gone[0] < found[0]):
                place = int(gone[0])
                stop = _stop(self._limits[k], float(values[place]), float(time[place]))
                found = place, stop
        return found

    def tell(self, points: Matrix, time: Vector) -> None:
        """Warn of ranges that are left in some records, once for each law."""
        for k, values in self._near(points, self._valid):
            limit = self._limits[k]
            if limit.at_start and time[0] > 0.0:
                continue
            low, high = self._valid[k]
            out = np.flatnonzero((values < low) | (values > high))
            if out.size and limit.law not in self._told:
                self._told.add(limit.law)
                warnings.warn(_warning(limit, values, time, int(out[0])), AccuracyWarning, 3)

    def _near(self, points: Matrix, ranges: Matrix) -> Iterator[tuple[int, Vector]]:
        """Numbers of those limits whose range the extremes of the records leave, and quantities."""
        low, high = extremes(points)
        up, down = np.maximum(self._weights, 0.0), np.minimum(self._weights, 0.0)
        least = self._start + up @ low + down @ high
        most = self._start + up @ high + down @ low
        inside = (least > ranges[:, 0]) & (most < ranges[:, 1])  # not where a number is none
        for k in map(int, np.flatnonzero(~inside)):
            used = np.flatnonzero(self._weights[k])
            yield k, self._start[k] + points[:, used] @ self._weights[k, used]


def _warning(limit: LimitRow, values: Vector, time: Vector, first: int) -> str:
    low, high = limit.valid
    beyond = np.maximum(low - values, values - high)
    worst = int(np.nanargmax(beyond))
    furthest = value_text(float(values[worst]), limit.unit)
    begins = value_text(float(values[first]), limit.unit)
    if begins != furthest:
        furthest = f"{begins}, later {furthest}"
    return (
        f"'{limit.component}': {_when(float(time[first]), 4)} the {limit.quantity} leaves "
        f"the range of {limit.law}, {range_text(limit)}: it is {furthest}. "
        f"{limit.effect(float(values[worst]))}\nTry: {limit.advice}"
    )


def _when(time: float, digits: int) -> str:
    return f"at {format_si(time, 's', digits)}" if time > 0.0 else "at the start"


def _stop(limit: LimitRow, value: float, time: float) -> ConvergenceError:
    return ConvergenceError(
        f"{limit.component}: the {limit.quantity} is {value_text(value, limit.unit)} "
        f"{_when(time, 6)}, far outside the range of {limit.law}, {range_text(limit)}.\n"
        f"Try: {limit.advice}"
    )
